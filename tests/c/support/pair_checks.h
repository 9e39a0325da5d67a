/* SPDX-License-Identifier: BSD-3-Clause */
/* pair_checks.h: are the library's answers for a scene those of the brute force? */
#ifndef HS_PAIR_CHECKS_H
#define HS_PAIR_CHECKS_H

#include "brute_force.h"
#include "among.h"

#define WANT_ALL (HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT)

/* What a search returned: arrays taken from it, NULL where not wanted. */
typedef struct found_pairs {
    int64_t  n;
    int64_t *i, *j;
    double  *distance, *vector;
    int32_t *shift;
} found_pairs;

static inline hs_points
points_of(const brute_scene *scene)
{
    return points_in_rows(scene->x, scene->n, scene->ndim);
}

/* The kernel that is checked; NULL: the best of this CPU. */
static const char *kernel_to_check;

/* And the algorithm. */
static hs_algorithm algorithm_to_check;

static inline hs_options
options_of(const brute_scene *scene)
{
    hs_options options = hs_options_default();
    options.cutoff = scene->cutoff;
    options.inclusive = scene->inclusive;
    options.kernel = kernel_to_check;
    options.algorithm = algorithm_to_check;
    return options;
}

/* Whether two searches wrote the same bits. */
static inline bool
same_array(const hs_pairs *a, const hs_pairs *b, unsigned which, size_t width)
{
    const int64_t n = hs_pairs_length(a);
    return n == hs_pairs_length(b) &&
           memcmp(hs_pairs_array(a, which), hs_pairs_array(b, which), (size_t)n * width) == 0;
}

static inline void *
array_of(int64_t count, size_t size)
{
    void *array = malloc(count > 0 ? (size_t)count * size : 1);
    if (array == NULL)
        abort();
    return array;
}

static inline void
found_free(found_pairs *found)
{
    hs_array_free(found->i);
    hs_array_free(found->j);
    hs_array_free(found->distance);
    hs_array_free(found->vector);
    hs_array_free(found->shift);
    memset(found, 0, sizeof *found);
}

/* Find, and take all that options->want names, i and j as int64. */
static inline hs_status
search_pairs(const hs_points *points, const hs_box *box, const hs_options *options,
             found_pairs *found, hs_failure *failure)
{
    hs_pairs *pairs = NULL;
    memset(found, 0, sizeof *found);
    const hs_status status = hs_pairs_find(AMONG(points, box), options, &pairs, failure);
    if (status != HS_OK) {
        return status;
    }
    found->n = hs_pairs_length(pairs);
    found->i = hs_pairs_take(pairs, HS_WANT_I);
    found->j = hs_pairs_take(pairs, HS_WANT_J);
    found->distance = hs_pairs_take(pairs, HS_WANT_DISTANCE);
    found->vector = hs_pairs_take(pairs, HS_WANT_VECTOR);
    found->shift = hs_pairs_take(pairs, HS_WANT_SHIFT);
    hs_pairs_free(pairs);
    return HS_OK;
}

/* |D| within 1 ulp and on its side of the cutoff, D within 1 ulp of |D|; exactly checked. */
static inline bool
measures_are_right(const brute_scene *scene, const brute_rows *r, const brute_pair *pair,
                   double distance, const double *vector)
{
    const double *p = scene->x + (int64_t)pair->i * scene->ndim;
    const double *q = scene->x + (int64_t)pair->j * scene->ndim;
    const double(*rows)[8] = (const double(*)[8])r->rows;
    const double above = nextafter(distance, INFINITY), below = nextafter(distance, 0.0);
    int64_t      shift[HS_MAX_DIM];
    for (int l = 0; l < r->m; l++)
        shift[l] = pair->shift[r->axis[l]];
    const big square = big_square(scene->ndim, r->m, rows, p, q, shift);
    const big low = big_from_double(below);
    if (!(distance >= 0.0) || distance > scene->cutoff ||
        (!scene->inclusive && distance == scene->cutoff) ||
        big_compare(big_product(low, low), square) > 0)
        return false;
    big       ulp = big_from_double(above <= DBL_MAX ? above - distance : distance - below);
    const big high = big_sum(big_from_double(distance), ulp);
    if (big_compare(square, big_product(high, high)) > 0)
        return false;
    for (int k = 0; k < scene->ndim; k++) {
        big off =
            big_difference(big_from_double(vector[k]), big_component(r->m, rows, p, q, shift, k));
        if (big_compare_magnitude(&off, &ulp) > 0)
            return false;
    }
    return true;
}

static inline bool
pair_matches(const brute_scene *scene, const brute_pair *pair, const found_pairs *found, int64_t e)
{
    if (found->i[e] != pair->i || found->j[e] != pair->j)
        return false;
    for (int k = 0; k < scene->ndim; k++) {
        if (found->shift[e * scene->ndim + k] != pair->shift[k])
            return false;
    }
    return true;
}

/* Sorted, with everything; checks the measures of every `stride`-th pair. */
static inline const char *
sorted_difference(const brute_scene *scene, const brute_list *expected, int64_t stride)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    found_pairs     found;
    brute_rows      r;
    const char     *difference = NULL;
    options.want = WANT_ALL;
    options.sorted = true;
    const hs_status status = search_pairs(&points, scene->box, &options, &found, NULL);
    if (status != HS_OK)
        difference = hs_status_text(status);
    else if (found.n != expected->n)
        difference = "another number of pairs";
    (void)brute_prepare(scene, &r);
    for (int64_t e = 0; difference == NULL && e < found.n; e++) {
        if (!pair_matches(scene, &expected->pairs[e], &found, e))
            difference = "another pair";
        else if (e % stride == 0 &&
                 !measures_are_right(scene, &r, &expected->pairs[e], found.distance[e],
                                     found.vector + e * scene->ndim))
            difference = "a wrong distance or vector";
    }
    found_free(&found);
    return difference;
}

static inline int
compare_keys(const void *a, const void *b)
{
    const uint64_t p = *(const uint64_t *)a, q = *(const uint64_t *)b;
    return (p > q) - (p < q);
}

/* Unsorted, i and j only; then the count. */
static inline const char *
plain_difference(const brute_scene *scene, const brute_list *expected)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    found_pairs     found;
    const char     *difference = NULL;
    int64_t         count = -1;
    hs_status       status = search_pairs(&points, scene->box, &options, &found, NULL);
    if (status != HS_OK)
        difference = hs_status_text(status);
    else if (found.n != expected->n)
        difference = "another number of unsorted pairs";
    if (difference == NULL) {
        uint64_t *keys = array_of(found.n, sizeof *keys);
        for (int64_t e = 0; e < found.n; e++)
            keys[e] = (uint64_t)found.i[e] << 32 | (uint64_t)found.j[e];
        qsort(keys, (size_t)found.n, sizeof *keys, compare_keys);
        for (int64_t e = 0; e < found.n; e++) {
            const brute_pair *pair = &expected->pairs[e];
            if (keys[e] != ((uint64_t)pair->i << 32 | (uint64_t)pair->j))
                difference = "another unsorted pair";
        }
        free(keys);
    }
    found_free(&found);
    status = hs_pairs_count(AMONG(&points, scene->box), &options, &count, NULL);
    if (difference == NULL && status != HS_OK)
        difference = hs_status_text(status);
    if (difference == NULL && count != expected->n)
        difference = "another count";
    return difference;
}

/* Unsorted and sorted into arrays of the caller, which have exactly the room, or one pair less. */
static inline const char *
into_difference(const brute_scene *scene, const brute_list *expected)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    const char     *difference = NULL;
    options.want = HS_WANT_BOTH;
    options.index_bytes = 4;
    for (int trial = 0; difference == NULL && trial < 4; trial++) {
        const int64_t  room = expected->n - (trial & 1);
        int32_t       *both = array_of(room, 2 * sizeof(int32_t)); /* a sanitizer guards its end */
        hs_pair_arrays out = {.capacity = room, .index_bytes = 4, .both = both};
        hs_pairs      *pairs = NULL;
        hs_failure     failure;
        options.out = &out;
        options.sorted = trial & 2;
        const hs_status status =
            hs_pairs_find(AMONG(&points, scene->box), &options, &pairs, &failure);
        if (status != (trial & 1 ? HS_ERR_CAPACITY : HS_OK))
            difference = hs_status_text(status);
        else if (trial & 1 && failure.expected_pairs != (double)expected->n)
            difference = "another number of pairs needed";
        for (int64_t e = 0; trial == 2 && difference == NULL && e < room; e++) {
            if (both[2 * e] != expected->pairs[e].i || both[2 * e + 1] != expected->pairs[e].j)
                difference = "another pair in the caller's arrays";
        }
        hs_pairs_free(pairs);
        free(both);
        trial += expected->n == 0; /* there is no less than none */
    }
    return difference;
}

/* What find and count get wrong, or NULL. */
static inline const char *
pairs_difference(const brute_scene *scene, const brute_list *expected, int64_t stride)
{
    const char *difference = plain_difference(scene, expected);
    if (difference == NULL) {
        difference = sorted_difference(scene, expected, stride);
    }
    return difference != NULL ? difference : into_difference(scene, expected);
}

#endif
