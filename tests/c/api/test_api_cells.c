/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_api_cells.c: cells that are kept give the answers of searches of their own, for any cutoff
 * and any queries, and stay as they are.
 */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"
#include "../support/range_checks.h"
#include "../support/among.h"
#include "../support/poll_checks.h"

#include "../../../csrc/core/memory/account.h"

void test_api_cells(void);

static bool
same_pairs(const hs_pairs *a, const hs_pairs *b, int ndim)
{
    const size_t d = (size_t)ndim;
    return same_array(a, b, HS_WANT_I, 8) && same_array(a, b, HS_WANT_J, 8) &&
           same_array(a, b, HS_WANT_DISTANCE, 8) && same_array(a, b, HS_WANT_VECTOR, 8 * d) &&
           same_array(a, b, HS_WANT_SHIFT, 4 * d);
}

/* The half list; or rows, of queries that may be NULL. */
static void
compare_lists(const hs_cells *cells, const brute_scene *scene, const hs_options *options)
{
    const hs_points points = points_of(scene);
    hs_pairs       *kept = NULL, *fresh = NULL;
    hs_options      sorted = *options;
    sorted.sorted = true;
    const hs_status status = hs_pairs_find(AMONG(&points, scene->box), &sorted, &fresh, NULL);
    CHECK(hs_pairs_find(IN_CELLS(cells), &sorted, &kept, NULL) == status);
    if (status == HS_OK) {
        int64_t count = -1;
        CHECK(same_pairs(kept, fresh, scene->ndim));
        CHECK(hs_pairs_count(IN_CELLS(cells), options, &count, NULL) == HS_OK);
        CHECK(count == hs_pairs_length(fresh));
    }
    hs_pairs_free(kept);
    hs_pairs_free(fresh);
}

static void
compare_rows(const hs_cells *cells, const brute_scene *scene, const hs_points *queries,
             const hs_options *options)
{
    const hs_points points = points_of(scene);
    hs_pairs       *kept = NULL, *fresh = NULL;
    const hs_status status =
        hs_neighbors_find(QUERIED(&points, queries, scene->box), options, &fresh, NULL);
    CHECK(hs_neighbors_find(QUERIED_CELLS(cells, queries), options, &kept, NULL) == status);
    if (status == HS_OK) {
        const int64_t n = hs_pairs_rows(fresh);
        CHECK(hs_pairs_rows(kept) == n);
        CHECK(memcmp(hs_pairs_offsets(kept), hs_pairs_offsets(fresh),
                     (size_t)(n + 1) * sizeof(int64_t)) == 0);
        CHECK(same_pairs(kept, fresh, scene->ndim));
    }
    hs_pairs_free(kept);
    hs_pairs_free(fresh);
}

/* 0: as is quick. */
static double
wanted_width(int trial, double cutoff)
{
    static const double widths[] = {0.0, 1.0, 0.5, 0.07, 3.0, 0x1p-1000, INFINITY};
    return cutoff > 0.0 ? cutoff * widths[trial % 7] : widths[trial % 7];
}

static void
any_cutoff_and_any_queries(void)
{
    harness_random      random = {20261121};
    static random_scene s, other;
    for (int trial = 0; trial < 480; trial += IS_SLOW ? 7 : 1) {
        const int ndim = 1 + trial / SCENE_KINDS % 5;
        const int n = random_below(&random, ndim <= 3 ? 50 : 10);
        hs_cells *cells = NULL;
        make_scene(&random, trial % SCENE_KINDS, ndim, n, 4.0, trial % 13 ? 0 : 200, &s);
        make_scene(&random, SCENE_OPEN, ndim, n, trial % 3 ? 4.0 : 4000.0, trial % 13 ? 0 : 200,
                   &other);
        const hs_points points = points_of(&s.scene), queries = points_of(&other.scene);
        hs_options      options = options_of(&s.scene);
        options.precision = trial % 9 == 0 ? HS_DOUBLE : HS_EXACT;
        options.cell_size = wanted_width(trial, s.scene.cutoff);
        CHECK(hs_cells_build(&points, s.scene.box, &options, &cells, NULL) == HS_OK);
        options.cell_size = 0.0;
        const double cutoffs[] = {s.scene.cutoff, 0.5 * s.scene.cutoff, 0.01 * s.scene.cutoff, 0.0,
                                  1.25 * s.scene.cutoff};
        options.want = WANT_ALL;
        options.threads = 1 + trial % 2;
        for (int c = 0; c < 5; c++) {
            options.cutoff = cutoffs[c];
            compare_lists(cells, &s.scene, &options);
            compare_rows(cells, &s.scene, NULL, &options);
            compare_rows(cells, &s.scene, &queries, &options);
        }
        hs_cells_free(cells);
    }
}

/* Clusters a long way apart, where only occupied cells are stored. */
static void
cells_that_are_few_and_far_between(void)
{
    enum { N = 3000 };
    static double  x[3 * N], y[3 * N];
    harness_random random = {8};
    brute_scene    scene = {.ndim = 3, .n = N, .x = x, .inclusive = true, .cutoff = 0.1};
    brute_scene    asking = {.ndim = 3, .n = N, .x = y};
    hs_cells      *cells = NULL;
    for (int e = 0; e < 3 * N; e++) {
        const double away = e / 3 % 2 ? 1e9 : 0.0;
        x[e] = random_unit(&random) + away;
        y[e] = 1.2 * random_unit(&random) + (e / 3 % 3 ? away : -2e9);
    }
    const hs_points points = points_of(&scene), queries = points_of(&asking);
    hs_options      options = options_of(&scene);
    CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_OK);
    options.want = WANT_ALL;
    for (int c = 0; c < 3; c++) {
        options.cutoff = c == 0 ? 0.1 : c == 1 ? 0.05 : 0.11;
        compare_lists(cells, &scene, &options);
        compare_rows(cells, &scene, NULL, &options);
        compare_rows(cells, &scene, &queries, &options);
    }
    hs_cells_free(cells);
}

/* The layout is what it says: a permutation, in ascending cells, each point in its own. */
static void
check_layout(const hs_cells *cells, const hs_points *points, const hs_layout *layout)
{
    int64_t *cell = array_of(points->n, sizeof(int64_t));
    bool    *met = array_of(points->n, sizeof(bool));
    memset(met, 0, (size_t)points->n);
    CHECK(layout->n_points == points->n && layout->start[0] == 0);
    CHECK(layout->start[layout->n_cells] == points->n);
    CHECK(hs_cells_find(cells, points, cell, NULL) == HS_OK);
    for (int64_t c = 0; c < layout->n_cells; c++) {
        for (int64_t si = layout->start[c]; si < layout->start[c + 1]; si++) {
            const int32_t i = layout->order[si];
            CHECK(i >= 0 && i < points->n && !met[i]);
            CHECK(si == layout->start[c] || layout->order[si - 1] < i);
            CHECK(cell[i] == c);
            met[i] = true;
        }
    }
    free(met);
    free(cell);
}

static void
the_layout_is_visible_and_holds_all_neighbours(void)
{
    harness_random      random = {314};
    static random_scene s, other;
    for (int trial = 0; trial < 120; trial++) {
        const int ndim = 1 + trial / SCENE_KINDS % 4, n = 1 + random_below(&random, 120);
        hs_cells *cells = NULL;
        hs_pairs *ranges = NULL, *rows = NULL;
        hs_layout layout;
        make_scene(&random, trial % SCENE_KINDS, ndim, n, 4.0, 0, &s);
        make_scene(&random, SCENE_OPEN, ndim, 20, 4.0, 0, &other);
        const hs_points  points = points_of(&s.scene), queries = points_of(&other.scene);
        const hs_points *asking = trial % 2 ? &queries : NULL;
        hs_options       options = options_of(&s.scene);
        options.cutoff *= 0.5;
        options.cell_size = wanted_width(trial, options.cutoff);
        CHECK(hs_cells_build(&points, s.scene.box, &options, &cells, NULL) == HS_OK);
        options.cell_size = 0.0;
        hs_cells_layout(cells, &layout);
        check_layout(cells, &points, &layout);
        options.want = HS_WANT_J;
        CHECK(hs_neighbors_find(QUERIED_CELLS(cells, asking), &options, &rows, NULL) == HS_OK);
        CHECK(hs_cells_candidates(cells, asking, &options, &ranges, NULL) == HS_OK);
        CHECK(ranges_hold_rows(&layout, ranges, rows));
        hs_pairs_free(rows);
        hs_pairs_free(ranges);
        hs_cells_free(cells);
    }
}

/* No narrower than wanted, unless there is one only; as many as fit, but not more than memory of
 * the order of the points holds. */
static void
cells_are_as_wide_as_wanted(void)
{
    enum { N = 500 };
    static double  x[8 * N];
    harness_random random = {5};
    for (int e = 0; e < 8 * N; e++) {
        x[e] = random_unit(&random);
    }
    for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
        brute_scene     scene = {.ndim = ndim, .n = N, .x = x, .inclusive = true, .cutoff = 0.1};
        const hs_points points = points_of(&scene);
        hs_options      options = options_of(&scene);
        for (double width = 0x1p-40; width < 4.0; width *= 1.5) {
            hs_cells *cells = NULL;
            hs_layout layout;
            double    as_wanted = 1.0;
            options.cell_size = width;
            CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_OK);
            hs_cells_layout(cells, &layout);
            CHECK(layout.n_cells <= 2 * N + 64 && !layout.occupied_only);
            for (int k = 0; k < ndim; k++) {
                CHECK(layout.shape[k] == 1 || layout.cell_size[k] >= width);
                as_wanted *= floor(fmax(0.99 / width, 1.0));
            }
            if (ndim <= 3 && width >= 0.02 && as_wanted <= 2 * N) {
                CHECK(layout.n_cells >= as_wanted);
            }
            hs_cells_free(cells);
        }
    }
}

/* Counted by the core: a plane costs two columns, and no rows of cells above or below it. */
static void
a_plane_has_no_third_coordinate(void)
{
    enum { N = 4000 };
    static double  x[3 * N];
    harness_random random = {77};
    hs_counters    counters[2];
    for (int solid = 0; solid < 2; solid++) {
        const int   ndim = 2 + solid;
        brute_scene scene = {.ndim = ndim, .n = N, .x = x, .inclusive = true, .cutoff = 0.5};
        hs_cells   *cells = NULL;
        for (int e = 0; e < ndim * N; e++) {
            x[e] = 10.0 * random_unit(&random);
        }
        const hs_points points = points_of(&scene);
        hs_options      options = options_of(&scene);
        options.counters = &counters[solid];
        CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_OK);
        hs_cells_free(cells);
    }
    const int64_t  column = N * (int64_t)sizeof(double);
    const int64_t *flat = counters[0].bytes, *deep = counters[1].bytes;
    CHECK(flat[HS_FOR_POINTS] >= 2 * column && flat[HS_FOR_POINTS] < 2 * column + 4096);
    CHECK(deep[HS_FOR_POINTS] - flat[HS_FOR_POINTS] == column);
    CHECK(flat[HS_FOR_ORIGINALS] == 2 * column && deep[HS_FOR_ORIGINALS] == 3 * column);
    CHECK(flat[HS_FOR_STENCIL] < deep[HS_FOR_STENCIL]);
}

/* However many pairs calls may find later, cells take memory of their own size. */
static void
cells_of_a_crowd_need_no_room_for_its_pairs(void)
{
    static double   x[4000];
    const hs_points points = {x, 4000, 1, HS_FLOAT64, 8, 8};
    hs_options      options = hs_options_default();
    hs_cells       *cells;
    int64_t         count;
    for (int i = 0; i < 4000; i++)
        x[i] = i;
    options.cutoff = 4000.0;
    options.memory_limit = 1e6; /* 8 million pairs take 128 MB */
    CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_OK);
    CHECK(hs_pairs_count(IN_CELLS(cells), &options, &count, NULL) == HS_OK);
    CHECK(count == 4000 * 3999 / 2);
    hs_cells_free(cells);
}

static void
points_may_change_once_they_are_in_cells(void)
{
    double      x[4] = {0.0, 0.25, 0.5, 0.75};
    brute_scene scene = {.ndim = 1, .n = 4, .x = x, .inclusive = true, .cutoff = 0.25};
    hs_points   points = points_of(&scene);
    hs_options  options = options_of(&scene);
    hs_cells   *cells = NULL;
    int64_t     count = -1;
    CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_OK);
    x[0] = x[1] = NAN;
    CHECK(hs_pairs_count(IN_CELLS(cells), &options, &count, NULL) == HS_OK && count == 3);
    options.cutoff = 1.0; /* by cells that are made for this call */
    CHECK(hs_pairs_count(IN_CELLS(cells), &options, &count, NULL) == HS_OK && count == 6);
    hs_cells_free(cells);
}

static void
failures_leave_nothing_behind(void)
{
    static random_scene s;
    harness_random      random = {99};
    hs_cells           *cells = NULL;
    make_scene(&random, SCENE_TRICLINIC, 3, 40, 4.0, 0, &s);
    const hs_points points = points_of(&s.scene);
    hs_options      options = options_of(&s.scene);
    const int64_t   before = hs_test_live_blocks();
    hs_status       status = HS_ERR_MEMORY;
    for (int64_t nth = 1; status == HS_ERR_MEMORY && nth < 1000; nth++) {
        hs_pairs *rows = NULL;
        hs_test_fail_allocation(nth);
        status = hs_cells_build(&points, s.scene.box, &options, &cells, NULL);
        if (status == HS_OK) {
            status = hs_neighbors_find(QUERIED_CELLS(cells, &points), &options, &rows, NULL);
        }
        hs_test_fail_allocation(0);
        hs_pairs_free(rows);
        hs_cells_free(cells);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(status == HS_OK);
}

/* Whichever allocation is refused: cells that were made have all that a search in them needs. */
static hs_status
build_and_use(void *context)
{
    const hs_points *points = context;
    hs_options       options = hs_options_default();
    hs_cells        *cells = NULL;
    hs_pairs        *rows = NULL;
    options.cutoff = INFINITY;
    options.threads = 1;
    hs_options of_cells = options;
    of_cells.cutoff = 0.5;
    const hs_status built = hs_cells_build(points, NULL, &of_cells, &cells, NULL);
    CHECK((built == HS_OK) == (cells != NULL));
    CHECK(built == HS_OK || built == HS_ERR_MEMORY);
    if (built == HS_OK && hs_test_failure_is_due()) { /* nothing was refused, nor is from now on */
        hs_test_fail_allocation(0);
        CHECK(hs_nearest_find(IN_CELLS(cells), 2, &options, &rows, NULL) == HS_OK);
        hs_test_fail_allocation(INT64_MAX);
    } else {
        CHECK(built == HS_ERR_MEMORY);
    }
    hs_pairs_free(rows);
    hs_cells_free(cells);
    return built;
}

static void
cells_are_whole_or_refused(void)
{
    const double x[4] = {0.0, 0.25, 0.5, 0.75};
    hs_points    points = {x, 4, 1, HS_FLOAT64, 8, 8};
    CHECK(fail_each_allocation(build_and_use, &points, 100) > 3);
}

/* Cells keep no pairs: as many as there are need not fit the limit. */
static void
cells_are_built_where_their_pairs_would_not_fit(void)
{
    enum { MANY = 2000 };
    static double  many[3 * MANY];
    harness_random random = {606};
    const hs_box   box = {
          .ndim = 3, .periodic = {true, true, true}, .rows = {{1.0}, {0.0, 1.0}, {0.0, 0.0, 1.0}}};
    hs_options options = hs_options_default();
    hs_cells  *cells = NULL;
    hs_pairs  *pairs = NULL;
    for (int e = 0; e < 3 * MANY; e++)
        many[e] = random_unit(&random);
    const hs_points points = {many, MANY, 3, HS_FLOAT64, 24, 8};
    options.cutoff = 0.9;
    options.memory_limit = 4e6; /* of six million pairs */
    CHECK(hs_pairs_find(AMONG(&points, &box), &options, &pairs, NULL) == HS_ERR_MEMORY);
    CHECK(hs_cells_build(&points, &box, &options, &cells, NULL) == HS_OK);
    hs_cells_free(cells);
}

void
test_api_cells(void)
{
    RUN(cells_are_built_where_their_pairs_would_not_fit);
    RUN(any_cutoff_and_any_queries);
    RUN(cells_are_whole_or_refused);
    RUN(cells_that_are_few_and_far_between);
    RUN(the_layout_is_visible_and_holds_all_neighbours);
    RUN(cells_are_as_wide_as_wanted);
    RUN(a_plane_has_no_third_coordinate);
    RUN(cells_of_a_crowd_need_no_room_for_its_pairs);
    RUN(points_may_change_once_they_are_in_cells);
    RUN(failures_leave_nothing_behind);
}
