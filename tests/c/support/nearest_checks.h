/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_checks.h: rows of the nearest, against all neighbours within a cutoff, put in order by big
 * integers. */
#ifndef HS_NEAREST_CHECKS_H
#define HS_NEAREST_CHECKS_H

#include "harness.h"
#include "pair_checks.h"
#include "among.h"

static const brute_scene *of_rows; /* what the entries that are put in order belong to */
static const double      *origin, *targets;
static double             rows_of_box[8][8];

typedef struct neighbour {
    int64_t j;
    int32_t shift[8];
    big     square;
} neighbour;

static inline int
neighbour_order(const void *a, const void *b)
{
    const neighbour *one = a, *other = b;
    const int        sign = big_compare(one->square, other->square);
    if (sign != 0)
        return sign;
    if (one->j != other->j)
        return one->j < other->j ? -1 : 1;
    for (int l = 0; l < of_rows->ndim; l++) {
        if (one->shift[l] != other->shift[l])
            return one->shift[l] < other->shift[l] ? -1 : 1;
    }
    return 0;
}

static inline void
take_rows(hs_pairs *rows, found_pairs *found)
{
    found->n = hs_pairs_length(rows);
    found->j = hs_pairs_take(rows, HS_WANT_J);
    found->distance = hs_pairs_take(rows, HS_WANT_DISTANCE);
    found->vector = hs_pairs_take(rows, HS_WANT_VECTOR);
    found->shift = hs_pairs_take(rows, HS_WANT_SHIFT);
}

/* Row i of all neighbours, in order of distance. */
static inline int64_t
sort_row(const found_pairs *all, int64_t begin, int64_t end, int64_t i, neighbour *sorted)
{
    const int d = of_rows->ndim;
    for (int64_t e = begin; e < end; e++) {
        neighbour *to = &sorted[e - begin];
        int64_t    shift[8];
        to->j = all->j[e];
        for (int l = 0; l < d; l++)
            shift[l] = to->shift[l] = all->shift[e * d + l];
        to->square = big_square(d, d, (const double(*)[8])rows_of_box, origin + i * d,
                                targets + to->j * d, shift);
    }
    qsort(sorted, (size_t)(end - begin), sizeof *sorted, neighbour_order);
    return end - begin;
}

static inline bool
row_is_right(const neighbour *sorted, int64_t n, const found_pairs *found, int64_t first, int64_t k)
{
    const int d = of_rows->ndim;
    for (int64_t e = 0; e < k; e++) {
        const int64_t at = first + e;
        if (e >= n) {
            if (found->j[at] != -1 || found->distance[at] != INFINITY ||
                found->vector[at * d] == found->vector[at * d] || found->shift[at * d] != 0)
                return false;
            continue;
        }
        if (found->j[at] != sorted[e].j || found->distance[at] > of_rows->cutoff ||
            (e > 0 && found->distance[at] < found->distance[at - 1]) ||
            memcmp(found->shift + at * d, sorted[e].shift, (size_t)d * sizeof(int32_t)) != 0)
            return false;
    }
    return true;
}

/* split < 0: the points ask; else those before it ask for the others. Returns the entries. */
static inline int64_t
compare_rows(brute_scene *scene, int64_t split, int64_t k, int threads)
{
    hs_points   points = points_of(scene), queries = points;
    hs_options  options = options_of(scene);
    found_pairs all = {0}, found = {0};
    hs_pairs   *rows = NULL;
    bool        right = true;
    scene->inclusive = options.inclusive = true;
    options.want = WANT_ALL & ~HS_WANT_I;
    options.threads = threads;
    of_rows = scene;
    memset(rows_of_box, 0, sizeof rows_of_box);
    for (int l = 0; scene->box != NULL && l < scene->ndim; l++) {
        if (scene->box->periodic[l])
            memcpy(rows_of_box[l], scene->box->rows[l], sizeof rows_of_box[l]);
    }
    origin = targets = scene->x;
    if (split >= 0) {
        queries.n = split;
        points.n -= split;
        points.data = targets = scene->x + split * scene->ndim;
    }
    const hs_points *asking = split >= 0 ? &queries : NULL;
    if (hs_neighbors_find(QUERIED(&points, asking, scene->box), &options, &rows, NULL) != HS_OK)
        return 0;
    const int64_t n_rows = hs_pairs_rows(rows);
    int64_t      *offsets = hs_pairs_take_offsets(rows), most = 1;
    take_rows(rows, &all);
    hs_pairs_free(rows);
    CHECK(hs_nearest_find(QUERIED(&points, asking, scene->box), k, &options, &rows, NULL) == HS_OK);
    CHECK(hs_pairs_length(rows) == n_rows * k);
    take_rows(rows, &found);
    hs_pairs_free(rows);
    for (int64_t i = 0; i < n_rows; i++)
        most = offsets[i + 1] - offsets[i] > most ? offsets[i + 1] - offsets[i] : most;
    neighbour *sorted = array_of(most, sizeof *sorted);
    for (int64_t i = 0; i < n_rows && right; i++) {
        const int64_t n = sort_row(&all, offsets[i], offsets[i + 1], i, sorted);
        right = row_is_right(sorted, n, &found, i * k, k);
    }
    CHECK(right);
    if (!right)
        fprintf(stderr, "  d = %d, n = %d, split %d, cutoff %a, k = %d\n", scene->ndim,
                (int)scene->n, (int)split, scene->cutoff, (int)k);
    const int64_t n = all.n;
    free(sorted);
    hs_array_free(offsets);
    found_free(&all);
    found_free(&found);
    return n;
}

#endif
