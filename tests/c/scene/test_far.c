/* SPDX-License-Identifier: BSD-3-Clause */
/* test_far.c: points and boxes far from the origin, or of many sizes. */
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

void test_far(void);

/*
 * ---- far ----
 *
 * Coordinates, boxes and cutoffs from the smallest to the largest numbers in one scene: every
 * search gives the number of pairs that the half list has, or refuses.
 */

enum { N_FAR = 7 };

typedef struct far_scene {
    double    x[3 * N_FAR];
    hs_points points;
    hs_box    box;
    double    cutoff;
} far_scene;

/* A number of any exponent from `lowest` on. */
static double
any_size(harness_random *random, int lowest)
{
    const int range = 1023 - lowest;
    return ldexp(1.0 + random_unit(random), lowest + random_below(random, range));
}

static void
make_far_scene(harness_random *random, int trial, far_scene *s)
{
    const int ndim = 1 + trial % 3, exponent = -1074 + random_below(random, 2000);
    s->cutoff = ldexp(1.0, exponent);
    s->box = (hs_box){.ndim = ndim};
    for (int k = 0; k < ndim; k++) {
        const int    lowest = exponent + 1 > -1074 ? exponent + 1 : -1074;
        const double length = any_size(random, lowest);
        const double places[] = {0.0, any_size(random, lowest), 0.5 * length, -0.5 * length};
        s->box.periodic[k] = random_below(random, 2);
        s->box.rows[k][k] = length;
        for (int i = 0; i < N_FAR; i++) {
            const double step = s->cutoff * 0.75 * random_below(random, 3);
            s->x[i * ndim + k] = places[random_below(random, 4)] + step;
        }
    }
    if (trial % 5 == 0 && ndim > 1 && s->box.periodic[0] && s->box.periodic[1]) {
        s->box.rows[1][0] = 0.25 * s->box.rows[0][0]; /* skewed */
    }
    s->points = (hs_points){
        s->x, N_FAR, ndim, HS_FLOAT64, ndim * (ptrdiff_t)sizeof(double), sizeof(double)};
}

/* A long period, a short one, and numbers that no scale between these holds. */
static void
make_subnormal_scene(harness_random *random, int trial, far_scene *s)
{
    const int    exponents[] = {-30, -1, 1, 10, 20, 21, 60, 500, 990};
    const int    ndim = 2 + trial % 2, exponent = exponents[random_below(random, 9)];
    const double unit = ldexp(1.0, exponent);
    const int    lowest = exponent + 2 > 965 ? exponent + 2 : 965;
    const double long_one = ldexp(1.0, lowest + random_below(random, 1020 - lowest));
    s->cutoff = unit * (0.5 + random_below(random, 3));
    s->box = (hs_box){.ndim = ndim};
    for (int k = 0; k < ndim; k++) {
        const double length = (k + trial) % 2 == 0 ? unit : long_one;
        const double places[] = {0.0,          0x1p-1074,     -0x1p-1030,   0x1p-1000,
                                 0.5 * length, -0.5 * length, 3.0 * length, -5.5 * length};
        s->box.periodic[k] = random_below(random, 5) > 0;
        s->box.rows[k][k] = length;
        for (int i = 0; i < N_FAR; i++) {
            s->x[i * ndim + k] = places[random_below(random, 8)];
        }
    }
    s->points = (hs_points){
        s->x, N_FAR, ndim, HS_FLOAT64, ndim * (ptrdiff_t)sizeof(double), sizeof(double)};
}

/* What scenes may be refused for. */
static bool
is_refusal(hs_status status)
{
    return status == HS_ERR_SHIFT_RANGE || status == HS_ERR_BOX_SKEWED || status == HS_ERR_MEMORY ||
           status == HS_ERR_ROUNDING;
}

static void
check_rows(const far_scene *s, hs_options options, int64_t half)
{
    int64_t   count = -1, counts[N_FAR], bins[2] = {-1, -1}, sum = 0;
    hs_status status =
        hs_pairs_count(QUERIED(&s->points, &s->points, &s->box), &options, &count, NULL);
    CHECK(status == HS_OK ? count == 2 * half + N_FAR : is_refusal(status));
    status = hs_neighbors_count(AMONG(&s->points, &s->box), &options, counts, NULL);
    for (int i = 0; i < N_FAR && status == HS_OK; i++)
        sum += counts[i];
    CHECK(status == HS_OK ? sum == 2 * half : is_refusal(status));
    const double       edges[] = {0.0, s->cutoff};
    const hs_histogram histogram = {
        .edges = edges, .n_edges = 2, .last_inclusive = true, .n_types = 1, .counts = bins};
    status = hs_pairs_histogram(AMONG(&s->points, &s->box), &options, &histogram, NULL);
    CHECK(status == HS_OK ? bins[0] + bins[1] == half : is_refusal(status));
}

static void
check_kept(const far_scene *s, hs_options options, int64_t half)
{
    hs_cells *cells = NULL;
    hs_pairs *rows = NULL;
    int64_t   count = -1, cell[N_FAR];
    hs_status status = hs_cells_build(&s->points, &s->box, &options, &cells, NULL);
    if (status != HS_OK) {
        CHECK(is_refusal(status));
        return;
    }
    status = hs_pairs_count(IN_CELLS(cells), &options, &count, NULL);
    CHECK(status == HS_OK ? count == half : is_refusal(status));
    status = hs_pairs_count(QUERIED_CELLS(cells, &s->points), &options, &count, NULL);
    CHECK(status == HS_OK ? count == 2 * half + N_FAR : is_refusal(status));
    status = hs_cells_find(cells, &s->points, cell, NULL);
    CHECK(status == HS_OK || is_refusal(status));
    status = hs_cells_candidates(cells, &s->points, &options, &rows, NULL);
    CHECK(status == HS_OK || status == HS_ERR_FAR || is_refusal(status));
    hs_pairs_free(rows);
    status = hs_nearest_find(QUERIED_CELLS(cells, &s->points), 2, &options, &rows, NULL);
    CHECK(status == HS_OK || is_refusal(status));
    hs_pairs_free(rows);
    hs_cells_free(cells);
}

static void
check_list(const far_scene *s, hs_options options, int64_t half)
{
    hs_verlet *list = hs_verlet_new();
    hs_pairs  *pairs = NULL;
    bool       rebuilt;
    hs_status  status =
        hs_verlet_update(list, &s->points, &s->box, &options, 0.0, false, &rebuilt, NULL);
    if (status == HS_OK)
        status = hs_verlet_find(list, &options, &pairs, NULL);
    CHECK(status == HS_OK ? hs_pairs_length(pairs) == half : is_refusal(status));
    hs_pairs_free(pairs);
    hs_verlet_free(list);
}

static void
every_search_counts_the_same(void)
{
    harness_random random = {20261122};
    int            answered = 0;
    for (int trial = 0; trial < 600; trial += IS_SLOW ? 10 : 1) {
        far_scene s;
        int64_t   half = -1;
        make_far_scene(&random, trial, &s);
        hs_options options = hs_options_default();
        options.cutoff = s.cutoff;
        options.threads = 1;
        options.precision = trial % 7 == 0 ? HS_DOUBLE : HS_EXACT;
        options.want = trial % 2 ? HS_WANT_I | HS_WANT_J : WANT_ALL;
        const hs_status status = hs_pairs_count(AMONG(&s.points, &s.box), &options, &half, NULL);
        if (status != HS_OK) {
            CHECK(is_refusal(status));
            continue;
        }
        answered++;
        if (options.precision == HS_EXACT) {
            check_rows(&s, options, half);
            check_kept(&s, options, half);
            check_list(&s, options, half);
        }
    }
    CHECK(answered > (IS_SLOW ? 20 : 200));
}

/* None is refused, and with S there are as many pairs. */
static void
subnormal_numbers_in_a_long_box(void)
{
    harness_random random = {20261123};
    for (int trial = 0; trial < 300; trial += IS_SLOW ? 10 : 1) {
        far_scene s;
        hs_pairs *pairs = NULL;
        int64_t   half = -1;
        make_subnormal_scene(&random, trial, &s);
        hs_options options = hs_options_default();
        options.cutoff = s.cutoff;
        options.threads = 1;
        CHECK(hs_pairs_count(AMONG(&s.points, &s.box), &options, &half, NULL) == HS_OK);
        options.want = WANT_ALL;
        CHECK(hs_pairs_find(AMONG(&s.points, &s.box), &options, &pairs, NULL) == HS_OK);
        CHECK(hs_pairs_length(pairs) == half);
        hs_pairs_free(pairs);
        check_rows(&s, options, half);
        check_kept(&s, options, half);
        check_list(&s, options, half);
    }
    /* Two images of each point by itself, and none of the other: a digit pushes it out. */
    const double    x[] = {0.0, 0x1p-1074, 0x1p25, 0.0};
    const hs_points two = {x, 2, 2, HS_FLOAT64, 2 * sizeof(double), sizeof(double)};
    const hs_box    box = {2, {true, true}, {{0x1p1000, 0.0}, {0.0, 0x1p24}}};
    hs_options      options = hs_options_default();
    int64_t         half = -1;
    options.cutoff = 0x1p25;
    CHECK(hs_pairs_count(AMONG(&two, &box), &options, &half, NULL) == HS_OK && half == 4);
}

/*
 * ---- far open ----
 *
 * Points that are so far away, in the unit of the box, that its vectors are less than their last
 * digits: along open axes, and along those that repeat.
 */

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

/* A query so far that its turns are not known: it is named, as a point would be. */
static void
far_queries_are_named(void)
{
    const hs_box    box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    const double    x[2] = {0.25, 0.5}, q[2] = {0.25, 1e300};
    const hs_points points = points_in_rows(x, 2, 1), queries = points_in_rows(q, 2, 1);
    hs_options      options = hs_options_default();
    hs_pairs       *rows = NULL;
    hs_failure      failure;
    options.cutoff = 0.3;
    options.want = HS_WANT_J | HS_WANT_SHIFT;
    CHECK(hs_neighbors_find(QUERIED(&points, &queries, &box), &options, &rows, &failure) ==
          HS_ERR_SHIFT_RANGE);
    CHECK(rows == NULL && failure.in_queries && failure.row == 1);
}

void
test_far(void)
{
    RUN(far_queries_are_named);
    RUN(every_search_counts_the_same);
    RUN(subnormal_numbers_in_a_long_box);
    RUN(points_far_above_a_slab_keep_their_neighbours);
}
