/* SPDX-License-Identifier: BSD-3-Clause */
/* list_checks.h: does a Verlet list give the pairs of its last step that a search gives? */
#ifndef HS_LIST_CHECKS_H
#define HS_LIST_CHECKS_H

#include "output_checks.h"
#include "among.h"

/* Both results, column by column. */
static inline bool
same_columns(const hs_pairs *one, const hs_pairs *other, unsigned want, int ndim, int index_bytes)
{
    size_t width[N_QUANTITIES];
    bool   same = hs_pairs_length(one) == hs_pairs_length(other);
    set_width(want, ndim, index_bytes, width);
    for (int k = 0; k < N_QUANTITIES && same; k++) {
        same = width[k] == 0 || same_array(one, other, 1u << k, width[k]);
    }
    return same;
}

/* Fewer columns are the same ones, which may be written in another way: all at once, or one alone. */
static inline bool
fewer_are_the_same(const hs_verlet *list, hs_options options, int ndim, const hs_pairs *found)
{
    static const unsigned wants[] = {WANT_ALL, HS_WANT_VECTOR, HS_WANT_I, HS_WANT_J};
    bool                  same = true;
    options.threads = 1; /* several write by parts */
    for (int w = 0; same && w < 4; w++) {
        hs_pairs *fewer = NULL;
        options.want = wants[w];
        same = hs_verlet_find(list, &options, &fewer, NULL) == HS_OK &&
               same_columns(fewer, found, wants[w], ndim, options.index_bytes);
        hs_pairs_free(fewer);
    }
    return same;
}

/* In the order of the list: `both` is i and j side by side, in the caller's arrays too. */
static inline const char *
unsorted_difference(const hs_verlet *list, hs_options options, int ndim, int64_t n)
{
    const char   *difference = NULL;
    hs_pairs     *found = NULL, *into = NULL;
    caller_arrays c;
    const size_t  bytes = (size_t)options.index_bytes;
    options.sorted = false;
    options.want = WANT_ALL | HS_WANT_BOTH;
    make_arrays(options.want, ndim, options.index_bytes, n, &c);
    if (hs_verlet_find(list, &options, &found, NULL) != HS_OK || hs_pairs_length(found) != n) {
        difference = "another number of unsorted pairs";
    }
    for (int64_t e = 0; difference == NULL && e < n; e++) {
        const char *both = hs_pairs_array(found, HS_WANT_BOTH);
        const char *i = hs_pairs_array(found, HS_WANT_I), *j = hs_pairs_array(found, HS_WANT_J);
        if (memcmp(both + 2 * (size_t)e * bytes, i + (size_t)e * bytes, bytes) != 0 ||
            memcmp(both + (2 * (size_t)e + 1) * bytes, j + (size_t)e * bytes, bytes) != 0) {
            difference = "i and j side by side are others";
        }
    }
    if (difference == NULL && !fewer_are_the_same(list, options, ndim, found)) {
        difference = "other pairs where i and j are not side by side";
    }
    options.out = &c.arrays;
    if (difference == NULL && (hs_verlet_find(list, &options, &into, NULL) != HS_OK ||
                               !same_as_result(&c, found, n) || !untouched_from(&c, n))) {
        difference = "other pairs in the caller's arrays";
    }
    hs_pairs_free(into);
    hs_pairs_free(found);
    free_arrays(&c);
    return difference;
}

/* The same pairs in ascending order, with these quantities. */
static inline const char *
sorted_list_difference(const hs_verlet *list, const hs_points *points, const hs_box *box,
                       const hs_options *options, int64_t *n_pairs)
{
    const char *difference = NULL;
    hs_pairs   *found = NULL, *expected = NULL;
    if (hs_pairs_find(AMONG(points, box), options, &expected, NULL) != HS_OK) {
        return "no search";
    }
    *n_pairs = hs_pairs_length(expected);
    if (hs_verlet_find(list, options, &found, NULL) != HS_OK ||
        !same_columns(found, expected, options->want, points->ndim, options->index_bytes)) {
        difference = "other pairs";
    }
    hs_pairs_free(expected);
    hs_pairs_free(found);
    return difference;
}

/* What hs_verlet_find gets wrong about these points, or NULL; *n_pairs becomes more by theirs. */
static inline const char *
list_difference(const hs_verlet *list, const hs_points *points, const hs_box *box,
                hs_options options, int64_t *n_pairs)
{
    static const unsigned wants[] = {WANT_ALL | HS_WANT_BOTH, HS_WANT_BOTH, HS_WANT_DISTANCE};
    const char           *difference = NULL;
    int64_t               n = 0;
    options.sorted = true;
    for (int w = 0; difference == NULL && w < 3; w++) {
        options.want = wants[w];
        difference = sorted_list_difference(list, points, box, &options, &n);
    }
    *n_pairs += n;
    return difference != NULL ? difference : unsorted_difference(list, options, points->ndim, n);
}

#endif
