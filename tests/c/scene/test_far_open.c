/* SPDX-License-Identifier: BSD-3-Clause */
/* test_far_open.c: points that are so far away, in the unit of the box, that its vectors are less
 * than their last digits: along open axes, and along those that repeat. */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/among.h"

void test_far_open(void);

/* Queries of kept cells find what those of a new search find. */
static void
check_queries(const hs_points *points, const hs_box *box, const hs_options *options,
              hs_cells *cells)
{
    int64_t   count = -1, kept = -2;
    hs_pairs *rows = NULL, *of_cells = NULL;
    CHECK(hs_pairs_count(QUERIED(points, points, box), options, &count, NULL) == HS_OK);
    CHECK(hs_pairs_count(QUERIED_CELLS(cells, points), options, &kept, NULL) == HS_OK &&
          kept == count);
    CHECK(hs_nearest_find(AMONG(points, box), 2, options, &rows, NULL) == HS_OK);
    CHECK(hs_nearest_find(IN_CELLS(cells), 2, options, &of_cells, NULL) == HS_OK);
    CHECK(rows != NULL && of_cells != NULL && hs_pairs_length(rows) == hs_pairs_length(of_cells) &&
          memcmp(hs_pairs_array(rows, HS_WANT_DISTANCE), hs_pairs_array(of_cells, HS_WANT_DISTANCE),
                 (size_t)hs_pairs_length(rows) * sizeof(double)) == 0);
    hs_pairs_free(rows);
    hs_pairs_free(of_cells);
}

/* Distances of all pairs of `points` in the box, which must be the n given ones, sorted by i and j;
 * by a search, and from cells where they can be kept. */
static void
check_pairs(const hs_points *points, const hs_box *box, double cutoff, int64_t n, const double *d,
            bool keeps)
{
    hs_cells  *cells = NULL;
    hs_options options = hs_options_default();
    hs_pairs  *pairs = NULL;
    options.cutoff = cutoff;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
    options.sorted = true;
    /* Cells know the shifts, which can be too many. */
    CHECK(hs_cells_build(points, box, &options, &cells, NULL) ==
          (keeps ? HS_OK : HS_ERR_SHIFT_RANGE));
    for (int kept = 0; kept < 1 + keeps; kept++) {
        CHECK((kept ? hs_pairs_find(IN_CELLS(cells), &options, &pairs, NULL)
                    : hs_pairs_find(AMONG(points, box), &options, &pairs, NULL)) == HS_OK);
        CHECK(hs_pairs_length(pairs) == n);
        for (int64_t e = 0; e < n && hs_pairs_length(pairs) == n; e++)
            CHECK(((const double *)hs_pairs_array(pairs, HS_WANT_DISTANCE))[e] == d[e]);
        hs_pairs_free(pairs);
    }
    if (keeps)
        check_queries(points, box, &options, cells);
    hs_cells_free(cells);
}

/* The nearest of each of the three points of points_wrap_from_where_scaling_overflows. */
static void
check_nearest(const hs_points *points, const hs_box *box, double unit)
{
    const double expected[] = {0.25 * unit, 0.25 * unit, 0.5 * unit};
    hs_options   options = hs_options_default();
    hs_pairs    *rows = NULL;
    options.cutoff = INFINITY;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    CHECK(hs_nearest_find(AMONG(points, box), 1, &options, &rows, NULL) == HS_OK);
    CHECK(hs_pairs_length(rows) == 3);
    if (hs_pairs_length(rows) == 3)
        CHECK(memcmp(hs_pairs_array(rows, HS_WANT_DISTANCE), expected, sizeof expected) == 0);
    hs_pairs_free(rows);
}

/* A slab whose vectors are not along the axes, and points far above it. */
static void
points_far_above_a_slab_keep_their_neighbours(void)
{
    static const double heights[] = {0x1p60, 0x1p90, 0x1p100, 0x1p300, 0x1p900};
    static const double distances[] = {0.25};
    const hs_box        box = {
               .ndim = 3, .periodic = {true, true}, .rows = {{1.0, 0.0, 0.0}, {0.25, 1.0, 0.0}}};
    for (int h = 0; h < 5; h++) {
        const double    z = heights[h];
        const double    x[] = {0.125, 0.5, z, 1.375, 0.5, z, 0.125, 0.5, 0.0, 0.625, 0.5, -z};
        const hs_points points = {x, 4, 3, HS_FLOAT64, 24, 8};
        check_pairs(&points, &box, 0.3, 1, distances, true);
    }
}

/* Powers of two that are whole numbers of box lengths, which repeat along the axis. */
static void
points_wrap_from_where_scaling_overflows(void)
{
    static const int exponents[] = {-40, -300, -520, -600, -1000};
    for (int e = 0; e < 5; e++) {
        for (int ndim = 1; ndim <= 2; ndim++) {
            const double unit = ldexp(1.0, exponents[e]), far = ldexp(1.0, 600);
            const double x[] = {far, 0.0, 0.25 * unit, 0.0, -far, 0.5 * unit};
            const double d[] = {0.25 * unit};
            const hs_box box = {
                .ndim = 2, .periodic = {true, ndim == 2}, .rows = {{unit, 0.0}, {0.0, unit}}};
            const hs_points points = {x, 3, 2, HS_FLOAT64, 16, 8};
            check_pairs(&points, &box, 0.3 * unit, 1, d, false);
            check_nearest(&points, &box, unit);
        }
    }
}

void
test_far_open(void)
{
    RUN(points_far_above_a_slab_keep_their_neighbours);
    RUN(points_wrap_from_where_scaling_overflows);
}
