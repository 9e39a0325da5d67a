/* SPDX-License-Identifier: BSD-3-Clause */
/* test_candidates_block.c: the ranges of a query are the block of cells around it and no more, each
 * of its cells once, across the faces of a box too. */
#include "../support/among.h"
#include "../support/harness.h"

#include <math.h>

void test_candidates_block(void);

enum { N = 1200, MOST_DIM = 3 };

static double x[N * MOST_DIM];

/* The way from a query to a point along an axis, to the nearest image if that is periodic. */
static double
apart_along(int d, int64_t query, int32_t point, int k, double side)
{
    const double apart = fabs(x[point * d + k] - x[query * d + k]);
    return side > 0.0 ? fmin(apart, side - apart) : apart;
}

/* Points of the ranges that lie further along some axis than two cells' widths beyond the cutoff,
 * or that come twice. */
static int64_t
too_many(const hs_layout *layout, const hs_pairs *ranges, const double *side, double cutoff)
{
    static int64_t seen_by[N];
    const int64_t *offsets = hs_pairs_offsets(ranges);
    const int64_t *first = hs_pairs_array(ranges, HS_WANT_I);
    const int64_t *end = hs_pairs_array(ranges, HS_WANT_J);
    int64_t        wrong = 0;
    for (int i = 0; i < N; i++)
        seen_by[i] = -1;
    for (int64_t q = 0; q < hs_pairs_rows(ranges); q++) {
        for (int64_t r = offsets[q]; r < offsets[q + 1]; r++) {
            wrong += first[r] >= end[r]; /* empty ones are left out */
            for (int64_t si = first[r]; si < end[r]; si++) {
                const int32_t point = layout->order[si];
                bool          is_far = false;
                for (int k = 0; k < layout->ndim; k++) {
                    const double most = cutoff + 2.0 * layout->cell_size[k];
                    is_far = is_far || apart_along(layout->ndim, q, point, k, side[k]) > most;
                }
                wrong += is_far || seen_by[point] == q;
                seen_by[point] = q;
            }
        }
        wrong += seen_by[q] != q; /* it is in its own block */
    }
    return wrong;
}

/* Points in [0, 12)^d, or in two crowds of that size that far apart along each axis; the first
 * `periodic` axes have a box, with room for both. */
static void
check_blocks(int d, int periodic, double apart)
{
    harness_random  random = {4100 + (uint64_t)(8 * d + periodic)};
    const hs_points points = {x, N, d, HS_FLOAT64, 8 * d, 8};
    hs_options      options = hs_options_default();
    hs_box          box = {.ndim = d};
    hs_cells       *cells = NULL;
    hs_pairs       *ranges = NULL;
    hs_layout       layout;
    double          side[MOST_DIM] = {0.0};
    for (int k = 0; k < d; k++) {
        box.periodic[k] = k < periodic;
        box.rows[k][k] = side[k] = k < periodic ? 12.0 + 2.0 * apart : 0.0;
    }
    for (int e = 0; e < d * N; e++)
        x[e] = 12.0 * random_unit(&random) + (e / d % 2 ? apart : 0.0);
    options.cutoff = 0.75;
    CHECK(hs_cells_build(&points, &box, &options, &cells, NULL) == HS_OK);
    hs_cells_layout(cells, &layout);
    CHECK(apart > 0.0 ? layout.occupied_only || d == 1 : !layout.occupied_only);
    for (int with = 0; with < 2; with++) {
        CHECK(hs_cells_candidates(cells, with ? &points : NULL, &options, &ranges, NULL) == HS_OK);
        CHECK(hs_pairs_rows(ranges) == N && too_many(&layout, ranges, side, 0.75) == 0);
        hs_pairs_free(ranges);
    }
    hs_cells_free(cells);
}

static void
blocks_are_no_larger_than_they_must_be(void)
{
    for (int d = 1; d <= MOST_DIM; d++) {
        for (int periodic = 0; periodic <= d; periodic++) {
            check_blocks(d, periodic, 0.0);
            check_blocks(d, periodic, 1e9);
        }
    }
}

/* In a box as long as the cutoff the block goes round several times: each range is that of all
 * points, once for each time that it goes over them. */
static void
small_boxes_are_gone_over_many_times(void)
{
    const hs_box    box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    const hs_points points = {x, 5, 1, HS_FLOAT64, 8, 8};
    for (int times = 1; times <= 4; times++) {
        hs_options options = hs_options_default();
        hs_cells  *cells = NULL;
        hs_pairs  *ranges = NULL;
        hs_layout  layout;
        for (int i = 0; i < 5; i++)
            x[i] = 0.2 * i;
        options.cutoff = times;
        CHECK(hs_cells_build(&points, &box, &options, &cells, NULL) == HS_OK);
        CHECK(hs_cells_candidates(cells, NULL, &options, &ranges, NULL) == HS_OK);
        hs_cells_layout(cells, &layout);
        const int64_t *offsets = hs_pairs_offsets(ranges);
        const int64_t *first = hs_pairs_array(ranges, HS_WANT_I);
        const int64_t *end = hs_pairs_array(ranges, HS_WANT_J);
        for (int64_t q = 0; q < 5; q++) {
            int64_t n = 0;
            for (int64_t r = offsets[q]; r < offsets[q + 1]; r++)
                n += end[r] - first[r];
            /* itself, at least `times` boxes to each side, and one more with what cells add */
            CHECK(n >= 5 * 2 * times + 1 && n <= 5 * (2 * times + 3));
        }
        hs_pairs_free(ranges);
        hs_cells_free(cells);
    }
}

void
test_candidates_block(void)
{
    RUN(blocks_are_no_larger_than_they_must_be);
    RUN(small_boxes_are_gone_over_many_times);
}
