/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_cells.c: cells that are kept, and ranges of candidates in them. */
#include "../../../csrc/halfshell.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"

#include <math.h>

void test_api_cells(void);

/*
 * ---- api candidates ----
 *
 * What cells say of themselves, dense and of occupied cells only: indices, the cell of any point,
 * ranges of candidates, and what is refused.
 */

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
    const double    away[6] = {1e9, 0.0, 0.0, 0.0, -1e300, 0.0};
    const hs_points points = points_of(&s.scene), query = {away, 2, 3, HS_FLOAT64, 24, 8};
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
    for (int far = 0; far < 2; far++) { /* points, and hundreds of thousands of images of one */
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
        const hs_box ring = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
        s.scene = (brute_scene){.ndim = 1, .n = 1, .x = s.x, .box = &ring, .cutoff = 200000.0};
        options.cutoff = s.scene.cutoff;
        polls = INT32_MAX;
        cells = build(&s.scene, &layout);
    }
    hs_cells_free(cells);
}

/* ---- candidates of queries that lie far from the points, and of points that no cells hold ---- */

/* Along open axes, around points at either end of the numbers. */
static void
queries_at_any_distance(void)
{
    const double places[] = {0.0, 1.0, -0x1p30, 0x1p200};
    for (int p = 0; p < 4; p++) {
        const double    unit = p == 3 ? 0x1p190 : 1.0;
        const double    x[2] = {places[p], places[p] + 0.125 * unit};
        const double    q[5] = {x[1], x[1] + 0.25 * unit, 0x1p800, -0x1p800, 0x1p-1074};
        const int       near = p == 0 ? 2 : 1; /* the last one is the first point, nearly */
        const hs_points points = {x, 2, 1, HS_FLOAT64, 8, 8};
        const hs_points asking = {q, 5, 1, HS_FLOAT64, 8, 8};
        hs_options      options = hs_options_default();
        hs_cells       *cells = NULL;
        hs_pairs       *ranges = NULL;
        options.cutoff = 0.125 * unit;
        CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_OK);
        CHECK(hs_cells_candidates(cells, &asking, &options, &ranges, NULL) == HS_OK);
        CHECK(hs_pairs_length(ranges) >= near);
        const int64_t *offsets = hs_pairs_offsets(ranges);
        CHECK(offsets[1] > 0 && offsets[4] == offsets[1]);
        CHECK((offsets[5] > offsets[4]) == (near == 2));
        hs_pairs_free(ranges);
        hs_cells_free(cells);
    }
}

/* An open axis on which points lie far beyond what a skewed box beside it can be scaled with: all
 * are in one cell, with which no ranges can be told, wherever queries are. Searches in it are
 * right. */
static void
cells_with_everything_have_no_ranges(void)
{
    const double    x[6] = {0.0, 0.0, 1e300, 0.3, 0.0, 1e300}, q[3] = {0.0, 0.0, 0.0};
    const hs_points points = {x, 2, 3, HS_FLOAT64, 24, 8}, asking = {q, 1, 3, HS_FLOAT64, 24, 8};
    const hs_box    box = {3, {true, true, false}, {{1.0}, {0.5, 1.0}, {0.0, 0.0, 1.0}}};
    hs_options      options = hs_options_default();
    hs_cells       *cells = NULL;
    hs_pairs       *ranges = (hs_pairs *)&options;
    hs_layout       layout;
    hs_failure      failure;
    int64_t         count = 0, cell[2] = {-7, -7};
    options.cutoff = 0.4;
    CHECK(hs_cells_build(&points, &box, &options, &cells, NULL) == HS_OK);
    for (int with = 0; with < 2; with++) {
        const hs_points *queries = with ? &asking : NULL;
        memset(&failure, 0x5a, sizeof failure);
        CHECK(hs_cells_candidates(cells, queries, &options, &ranges, &failure) == HS_ERR_FAR);
        CHECK(ranges == NULL && failure.row == -1 && failure.column == -1);
        CHECK(!failure.in_queries && failure.limit_bytes == 0.0);
    }
    hs_cells_layout(cells, &layout);
    CHECK(layout.n_cells == 1 && !layout.occupied_only && layout.n_points == 2);
    for (int k = 0; k < 3; k++)
        CHECK(layout.shape[k] == 1 && layout.cell_size[k] == INFINITY);
    CHECK(hs_cells_find(cells, &points, cell, NULL) == HS_OK && cell[0] == 0 && cell[1] == 0);
    CHECK(hs_pairs_count(IN_CELLS(cells), &options, &count, NULL) == HS_OK && count == 1);
    options.cutoff = 0.2;
    CHECK(hs_cells_candidates(cells, NULL, &options, &ranges, &failure) == HS_ERR_CUTOFF);
    CHECK(failure.value == 0.2 && ranges == NULL);
    hs_cells_free(cells);
}

/* A point so far from a skewed box that its turns are not known. */
static void
turns_that_are_not_known_are_told(void)
{
    const hs_box    box = {2, {true, true}, {{4.0}, {1.0, 4.0}}};
    const double    x[4] = {0.5, 0.5, 1.5, 2.5}, far[4] = {0.5, 0.5, 1e300, 0.25};
    const hs_points points = points_in_rows(x, 2, 2), other = points_in_rows(far, 2, 2);
    hs_options      options = hs_options_default();
    hs_cells       *cells = NULL;
    hs_failure      failure;
    int64_t         cell[2];
    options.cutoff = 1.0;
    CHECK(hs_cells_build(&points, &box, &options, &cells, NULL) == HS_OK);
    CHECK(hs_cells_find(cells, &points, cell, &failure) == HS_OK);
    CHECK(hs_cells_find(cells, &other, cell, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(failure.row == 1 && !failure.in_queries);
    hs_cells_free(cells);
}

/* Cells reach from end to end, whatever points lie within; further where points lie beyond; and along
 * axes where nothing is fixed as if there were no domain. */
static void
cells_reach_over_their_domain(void)
{
    const double    x[6] = {1.0, 1.0, 1.5, 1.25, 9.0, 0.5}, beyond[4] = {-4.0, 1.0, -3.5, 1.0};
    const double    domain[4] = {0.0, 1.0, 20.0, -1.0}, bad[4] = {0.0, 0.0, INFINITY, 1.0};
    const double    nothing[4] = {0.0, NAN, 1.0, 1.0};
    const hs_points points = {x, 3, 2, HS_FLOAT64, 16, 8}, one = {x, 1, 2, HS_FLOAT64, 16, 8};
    const hs_points other = {beyond, 2, 2, HS_FLOAT64, 16, 8};
    const hs_points nowhere = {x, 0, 2, HS_FLOAT64, 16, 8};
    const hs_points sets[3] = {points, one, other};
    hs_options      options = hs_options_default();
    options.cutoff = 1.0;
    options.cell_size = 2.0;
    options.domain = domain;
    for (int s = 0; s < 3; s++) {
        hs_cells *cells = NULL;
        hs_layout layout;
        int64_t   count = -1, cell[3];
        CHECK(hs_cells_build(&sets[s], NULL, &options, &cells, NULL) == HS_OK);
        hs_cells_layout(cells, &layout);
        CHECK(layout.shape[0] == (s == 2 ? 12 : 10) && layout.shape[1] == 1);
        CHECK(layout.cell_size[0] == 2.0);
        CHECK(hs_cells_find(cells, &points, cell, NULL) == HS_OK);
        CHECK(cell[0] == (s == 2 ? 2 : 0) && cell[1] == cell[0] && cell[2] == cell[0] + 4);
        CHECK(hs_pairs_count(IN_CELLS(cells), &options, &count, NULL) == HS_OK);
        CHECK(count == (s == 1 ? 0 : 1));
        hs_cells_free(cells);
    }
    hs_cells *cells = NULL;
    hs_layout layout;
    CHECK(hs_cells_build(&nowhere, NULL, &options, &cells, NULL) == HS_OK);
    hs_cells_layout(cells, &layout);
    CHECK(layout.n_points == 0);
    hs_cells_free(cells);
    const double    large[4] = {0.0, 0.0, 1e300, 1e300}, origin[4] = {0.0};
    const hs_points spot = {origin, 2, 2, HS_FLOAT64, 16, 8};
    int64_t         count = -1;
    options.domain = large;
    options.cutoff = options.cell_size = 0.0;
    CHECK(hs_cells_build(&spot, NULL, &options, &cells, NULL) == HS_OK);
    CHECK(hs_pairs_count(IN_CELLS(cells), &options, &count, NULL) == HS_OK && count == 1);
    hs_cells_free(cells);
    cells = NULL;
    options.cutoff = 1.0;
    options.cell_size = 2.0;
    options.domain = bad;
    CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_ERR_ARGUMENT);
    options.domain = nothing;
    CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_ERR_ARGUMENT);
    CHECK(cells == NULL);
}

void
test_api_cells(void)
{
    RUN(cells_reach_over_their_domain);
    RUN(turns_that_are_not_known_are_told);
    RUN(indices_are_where_points_are);
    RUN(empty_cells_have_no_id);
    RUN(ranges_that_are_refused);
    RUN(cells_with_everything_have_no_ranges);
    RUN(queries_at_any_distance);
}
