/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_api_candidates.c: what cells say of themselves, dense and of occupied cells only: indices,
 * the cell of any point, ranges of candidates, and what is refused.
 */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"
#include "../support/range_checks.h"
#include "../support/among.h"

#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/base/poll.h"

void test_api_candidates(void);

/* A few dense clusters far apart, whose cells are only the occupied ones. */
enum { CLUSTERS = 4, EACH = 1000, SPARSE_POINTS = CLUSTERS * EACH };
#define APART 1e7

static void
make_sparse(harness_random *random, int ndim, double *x)
{
    for (int i = 0; i < SPARSE_POINTS; i++) {
        for (int k = 0; k < ndim; k++)
            x[i * ndim + k] = 3.0 * random_unit(random) + APART * (i / EACH % (k + 3));
    }
}

static hs_cells *
build(const brute_scene *scene, hs_layout *layout)
{
    const hs_points  points = points_of(scene);
    const hs_options options = options_of(scene);
    hs_cells        *cells = NULL;
    CHECK(hs_cells_build(&points, scene->box, &options, &cells, NULL) == HS_OK);
    hs_cells_layout(cells, layout);
    return cells;
}

/* Indices are within the shape, ascend with the ids, last axis first, and are those of the points:
 * two of these are as many cells apart along an open axis as their distance says, or one beside. */
static void
check_indices(const hs_cells *cells, const brute_scene *scene, const hs_layout *layout)
{
    const int       d = scene->ndim;
    int64_t        *indices = array_of(layout->n_cells * d, sizeof *indices);
    int64_t        *cell = array_of(scene->n, sizeof *cell), wrong = 0;
    const hs_points points = points_of(scene);
    hs_cells_indices(cells, indices);
    CHECK(hs_cells_find(cells, &points, cell, NULL) == HS_OK);
    for (int64_t c = 0; c < layout->n_cells; c++) {
        int64_t id = 0;
        int     order = c == 0 ? 1 : 0;
        for (int k = d - 1; k >= 0; k--) {
            const int64_t at = indices[c * d + k];
            wrong += at < 0 || at >= layout->shape[k];
            id = layout->occupied_only ? 0 : id * layout->shape[k] + at;
            if (order == 0)
                order = (at > indices[(c - 1) * d + k]) - (at < indices[(c - 1) * d + k]);
        }
        wrong += order != 1 || (!layout->occupied_only && id != c);
        wrong += layout->occupied_only && layout->start[c] == layout->start[c + 1];
    }
    for (int64_t i = 1; i < scene->n; i++) {
        wrong += cell[i] < 0 || cell[i] >= layout->n_cells;
        for (int k = 0; k < d; k++) {
            const double apart = (scene->x[i * d + k] - scene->x[k]) / layout->cell_size[k];
            const double steps = (double)(indices[cell[i] * d + k] - indices[cell[0] * d + k]);
            wrong += scene->box == NULL && !(fabs(apart - steps) < 1.0 + 1e-9);
        }
    }
    CHECK(wrong == 0);
    free(indices);
    free(cell);
}

static void
indices_are_where_points_are(void)
{
    harness_random      random = {6};
    static random_scene s;
    static double       x[3 * SPARSE_POINTS];
    for (int trial = 0; trial < 12; trial++) {
        const int   ndim = 2 + trial % 2;
        hs_layout   layout;
        brute_scene scene = {.ndim = ndim, .n = SPARSE_POINTS, .x = x, .cutoff = 0.4};
        make_sparse(&random, ndim, x);
        hs_cells *cells = build(&scene, &layout);
        CHECK(layout.occupied_only);
        check_indices(cells, &scene, &layout);
        hs_cells_free(cells);
        make_scene(&random, trial % SCENE_KINDS, 1 + trial % 4, 200, 4.0, 0, &s);
        s.scene.cutoff *= 0.3;
        cells = build(&s.scene, &layout);
        check_indices(cells, &s.scene, &layout);
        hs_cells_free(cells);
    }
}

/* Points where no other is: no cell of these has an id. */
static void
empty_cells_have_no_id(void)
{
    enum { N = 500 };
    static double  x[2 * SPARSE_POINTS], other[2 * N];
    static int64_t cell[N];
    harness_random random = {7};
    hs_layout      layout;
    int            inside = 0, wrong = 0;
    brute_scene    scene = {.ndim = 2, .n = SPARSE_POINTS, .x = x, .cutoff = 0.4};
    brute_scene    others = {.ndim = 2, .n = N, .x = other};
    hs_failure     failure;
    make_sparse(&random, 2, x);
    for (int e = 0; e < 2 * N; e++) {
        other[e] = e < N ? 3.0 * random_unit(&random) : APART * random_unit(&random);
    }
    hs_cells       *cells = build(&scene, &layout);
    const hs_points points = points_of(&others);
    CHECK(layout.occupied_only);
    CHECK(hs_cells_find(cells, &points, cell, &failure) == HS_OK);
    for (int i = 0; i < N; i++) {
        inside += cell[i] >= 0;
        if (cell[i] >= 0) {
            /* Who is there is less than a cell away. */
            const double *there = x + 2 * layout.order[layout.start[cell[i]]];
            wrong += fabs(there[0] - other[2 * i]) > 1.001 * layout.cell_size[0] ||
                     fabs(there[1] - other[2 * i + 1]) > 1.001 * layout.cell_size[1];
        }
    }
    CHECK(wrong == 0 && inside > N / 8 && inside < 7 * N / 8);
    other[33] = NAN;
    CHECK(hs_cells_find(cells, &points, cell, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == 16 && failure.column == 1);
    CHECK(hs_cells_find(cells, &points, cell, NULL) == HS_ERR_NOT_FINITE);
    hs_cells_free(cells);
}

static void
ranges_of_occupied_cells(void)
{
    static double  x[2 * SPARSE_POINTS];
    harness_random random = {8};
    brute_scene    scene = {.ndim = 2, .n = SPARSE_POINTS, .x = x, .cutoff = 0.4};
    hs_layout      layout;
    make_sparse(&random, 2, x);
    hs_cells       *cells = build(&scene, &layout);
    const hs_points points = points_of(&scene);
    for (int trial = 0; trial < 4; trial++) {
        const hs_points *asking = trial & 1 ? &points : NULL;
        hs_options       options = options_of(&scene);
        hs_pairs        *ranges = NULL, *rows = NULL;
        options.cutoff = trial & 2 ? 0.1 : 0.4;
        options.want = HS_WANT_J;
        CHECK(hs_neighbors_find(QUERIED_CELLS(cells, asking), &options, &rows, NULL) == HS_OK);
        CHECK(hs_cells_candidates(cells, asking, &options, &ranges, NULL) == HS_OK);
        CHECK(ranges_hold_rows(&layout, ranges, rows));
        hs_pairs_free(rows);
        hs_pairs_free(ranges);
    }
    hs_cells_free(cells);
}

static void
ranges_that_are_refused(void)
{
    harness_random      random = {9};
    static random_scene s;
    hs_layout           layout;
    hs_failure          failure;
    hs_pairs           *ranges = NULL;
    make_scene(&random, SCENE_ALIGNED, 3, 100, 4.0, 0, &s);
    s.scene.cutoff = 0.5;
    hs_cells       *cells = build(&s.scene, &layout);
    const double    far[6] = {1e9, 0.0, 0.0, 0.0, -1e300, 0.0};
    const hs_points points = points_of(&s.scene), query = {far, 2, 3, HS_FLOAT64, 24, 8};
    hs_options      options = options_of(&s.scene);
    int64_t         polls = INT32_MAX;
    CHECK(hs_cells_candidates(cells, &query, &options, &ranges, &failure) == HS_ERR_FAR);
    CHECK(failure.row == 1 && failure.column == 1 && failure.value == -1e300);
    CHECK(failure.in_queries && failure.system == -1 && ranges == NULL);
    options.cutoff = 0.75;
    CHECK(hs_cells_candidates(cells, &points, &options, &ranges, NULL) == HS_ERR_CUTOFF);
    options.cutoff = NAN;
    CHECK(hs_cells_candidates(cells, NULL, &options, &ranges, NULL) == HS_ERR_CUTOFF);
    options.cutoff = 0.5;
    options.poll = stop_after;
    options.poll_context = &polls;
    CHECK(hs_cells_candidates(cells, NULL, &options, &ranges, NULL) == HS_OK);
    hs_pairs_free(ranges);
    const int64_t most = INT32_MAX - polls;
    CHECK(most >= 2);
    for (int64_t n = 0; n < most; n++) {
        polls = n;
        CHECK(hs_cells_candidates(cells, NULL, &options, &ranges, NULL) == HS_ERR_INTERRUPTED);
        CHECK(ranges == NULL);
    }
    hs_cells_free(cells);
}

static void
failures_leave_nothing_behind(void)
{
    static double  x[2 * SPARSE_POINTS];
    harness_random random = {10};
    hs_layout      layout;
    brute_scene    scene = {.ndim = 2, .n = SPARSE_POINTS, .x = x, .cutoff = 0.4};
    make_sparse(&random, 2, x);
    hs_cells        *cells = build(&scene, &layout);
    const hs_points  points = points_of(&scene);
    const hs_options options = options_of(&scene);
    const int64_t    before = hs_test_live_blocks();
    static int64_t   cell[SPARSE_POINTS];
    for (int call = 0; call < 3; call++) {
        bool ended = false;
        int  nth = 0;
        while (!ended && nth < 200) {
            hs_pairs *ranges = NULL;
            hs_test_fail_allocation(++nth);
            const hs_status status = call == 2 ? hs_cells_find(cells, &points, cell, NULL)
                                               : hs_cells_candidates(cells, call ? &points : NULL,
                                                                     &options, &ranges, NULL);
            ended = hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(status == HS_OK || (status == HS_ERR_MEMORY && !ended));
            hs_pairs_free(ranges);
            CHECK(hs_test_live_blocks() == before);
        }
        CHECK(ended && nth > 1);
    }
    hs_cells_free(cells);
}

/* Less memory than the ranges need, step by step: refused, or the same ranges. */
static void
memory_limits_are_kept(void)
{
    static double  x[2 * SPARSE_POINTS];
    harness_random random = {12};
    hs_layout      layout;
    brute_scene    scene = {.ndim = 2, .n = SPARSE_POINTS, .x = x, .cutoff = 0.4};
    hs_pairs      *ranges = NULL;
    int            refused = 0;
    make_sparse(&random, 2, x);
    hs_cells  *cells = build(&scene, &layout);
    hs_options options = options_of(&scene);
    CHECK(hs_cells_candidates(cells, NULL, &options, &ranges, NULL) == HS_OK);
    const int64_t n = hs_pairs_length(ranges);
    hs_pairs_free(ranges);
    for (double limit = 1.0; limit < 1e8; limit *= 1.3) {
        options.memory_limit = limit;
        const hs_status status = hs_cells_candidates(cells, NULL, &options, &ranges, NULL);
        CHECK(status == HS_OK ? hs_pairs_length(ranges) == n : status == HS_ERR_MEMORY);
        refused += status == HS_ERR_MEMORY;
        hs_pairs_free(ranges);
    }
    CHECK(refused > 10 && refused < 65);
    hs_cells_free(cells);
}

/* float32 points, and so many that no memory could hold them: only one number is there. */
static void
points_of_any_type_and_number(void)
{
    const float     narrow[] = {0.0f, 0.5f, 0.75f, 8.0f};
    const hs_points few = {narrow, 4, 1, HS_FLOAT32, 4, 4};
    hs_points       kept, many = {narrow, INT64_C(1) << 31, 1, HS_FLOAT32, 0, 0};
    hs_options      options = hs_options_default();
    hs_cells       *cells = NULL;
    hs_failure      failure;
    int64_t         count = -1;
    options.cutoff = 0.5;
    CHECK(hs_cells_build(&few, NULL, &options, &cells, &failure) == HS_OK);
    hs_cells_points(cells, &kept);
    CHECK(kept.real == HS_FLOAT64 && ((const double *)kept.data)[2] == 0.75);
    CHECK(hs_pairs_count(IN_CELLS(cells), &options, &count, NULL) == HS_OK && count == 2);
    hs_cells_free(cells);
    CHECK(hs_cells_build(&many, NULL, &options, &cells, &failure) == HS_ERR_TOO_MANY);
    CHECK(cells == NULL && failure.value == 0x1p31);
}

/* Cells whose scale would round the queries, or that had to round their own points: as a search of
 * its own. */
static void
scales_that_do_not_serve(void)
{
    harness_random random = {11};
    double         x[40], y[40];
    for (int trial = 0; trial < 60; trial++) {
        const int   scale = trial % 3 ? 1000 : 600, other = trial % 2 ? -1060 : -600;
        brute_scene scene = {.ndim = 2, .n = 20, .x = x, .cutoff = ldexp(1.0, scale)};
        brute_scene asking = {.ndim = 2, .n = 20, .x = y};
        hs_cells   *cells = NULL;
        for (int e = 0; e < 40; e++) {
            const bool large = trial % 5 || random_below(&random, 2);
            x[e] = ldexp(random_unit(&random), large ? scale + 1 : other);
            y[e] = ldexp(random_unit(&random), e % 3 ? other : scale);
        }
        const hs_points points = points_of(&scene), queries = points_of(&asking);
        hs_options      options = options_of(&scene);
        CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_OK);
        options.want = HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR;
        for (int call = 0; call < 4; call++) {
            hs_pairs *kept = NULL, *fresh = NULL;
            int64_t   expected = 0;
            options.cutoff = ldexp(1.0, call & 1 ? scale : other);
            const hs_points *from = call & 2 ? &queries : NULL;
            CHECK(hs_neighbors_find(QUERIED_CELLS(cells, from), &options, &kept, NULL) == HS_OK);
            CHECK(hs_neighbors_find(QUERIED(&points, from, NULL), &options, &fresh, NULL) == HS_OK);
            CHECK(same_array(kept, fresh, HS_WANT_J, 8));
            CHECK(same_array(kept, fresh, HS_WANT_DISTANCE, 8));
            CHECK(same_array(kept, fresh, HS_WANT_VECTOR, 16));
            for (int i = 0; i < 20; i++) {
                for (int j = 0; j < 20; j++) {
                    brute_rows    none = {.m = 0};
                    const int64_t still[HS_MAX_DIM] = {0};
                    brute_scene   at = {.ndim = 2, .cutoff = options.cutoff};
                    const double *p = (from != NULL ? y : x) + 2 * i;
                    expected += (from != NULL || i != j) &&
                                brute_sign(&at, &none, p, x + 2 * j, still) <= 0;
                }
            }
            CHECK(hs_pairs_length(fresh) == expected);
            hs_pairs_free(kept);
            hs_pairs_free(fresh);
        }
        hs_cells_free(cells);
    }
}

/* Cells that were made for cutoff 0 answer it, again and again. */
static void
cells_for_equal_points(void)
{
    double     x[50];
    hs_options options = hs_options_default();
    hs_cells  *cells = NULL;
    int64_t    count = -1;
    for (int i = 0; i < 50; i++)
        x[i] = i % 10;
    const hs_points points = {x, 50, 1, HS_FLOAT64, 8, 8};
    CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_OK);
    CHECK(hs_pairs_count(IN_CELLS(cells), &options, &count, NULL) == HS_OK && count == 100);
    CHECK(hs_pairs_count(QUERIED_CELLS(cells, &points), &options, &count, NULL) == HS_OK &&
          count == 250);
    options.cutoff = 1.0;
    CHECK(hs_pairs_count(IN_CELLS(cells), &options, &count, NULL) == HS_OK && count == 325);
    hs_cells_free(cells);
}

void
test_api_candidates(void)
{
    RUN(indices_are_where_points_are);
    RUN(empty_cells_have_no_id);
    RUN(ranges_of_occupied_cells);
    RUN(ranges_that_are_refused);
    RUN(failures_leave_nothing_behind);
    RUN(memory_limits_are_kept);
    RUN(points_of_any_type_and_number);
    RUN(scales_that_do_not_serve);
    RUN(cells_for_equal_points);
}
