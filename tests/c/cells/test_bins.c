/* SPDX-License-Identifier: BSD-3-Clause */
/* test_bins.c: every point is once in its own cell, in dense grids and in sparse ones. */
#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/cells/bins.h"
#include "../../../csrc/core/memory/memory.h"
#include "../../../csrc/core/threads/call.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"

void test_bins(void);

/* ---- points in cell order: each once, in its own cell, in the caller's order within it ---- */

static random_scene shared;

/* Scene, grid and bins of the shared scene; false where the scene is refused. */
static bool
sort_scene(hs_account *account, const hs_options *options, hs_scene *scene, hs_grid *grid,
           hs_bins *bins)
{
    const hs_points points = points_of(&shared.scene);
    hs_failure      failure;
    hs_account_init(account, options);
    if (hs_scene_make(account, NULL, &(hs_sets){.points = &points}, shared.scene.box, options,
                      scene, NULL, &failure) != HS_OK)
        return false;
    if (hs_grid_init(scene, HS_GRID_ANY, grid, &failure) != HS_OK) {
        hs_scene_free(account, scene);
        return false;
    }
    return hs_bins_build(account, NULL, options, scene, grid, false, bins) == HS_OK;
}

/* X = r - w B is the point, moved by whole box vectors: exactly so in aligned boxes. */
static void
coordinates_and_turns_travel_with_their_point(void)
{
    harness_random random = {141421};
    for (int trial = 0; trial < 120; trial++) {
        hs_account account;
        hs_scene   scene;
        hs_grid    grid;
        hs_bins    bins;
        make_scene(&random, trial % 2 ? SCENE_ALIGNED : SCENE_TRICLINIC, 1 + trial % 4, 200, 40.0,
                   0, &shared);
        shared.scene.cutoff = 0.3;
        hs_options options = options_of(&shared.scene);
        options.want = WANT_ALL;
        if (!sort_scene(&account, &options, &scene, &grid, &bins))
            continue;
        const int d = bins.ndim, m = bins.n_periodic;
        bool      right = bins.turns.known;
        for (int64_t si = 0; right && si < bins.n; si++) {
            const double *r = shared.x + (int64_t)bins.order[si] * d;
            for (int k = 0; k < d; k++) {
                double moved = r[k];
                for (int b = 0; b < m; b++)
                    moved -= (double)hs_turns_get(&bins.turns, b, si) * scene.lattice.rows[b][k];
                right = right && fabs(moved - bins.x[k][si]) < 1e-9;
                right = right && (!bins.keeps_originals || bins.originals[k][si] == r[k]);
            }
        }
        CHECK(right);
        hs_bins_free(&account, &bins);
    }
}

/*
 * ---- bins threads ----
 *
 * Points are sorted into the same order by any number of threads, with as much memory as there is,
 * until a poll says no.
 */

enum { MANY = 2 * HS_POLL_POINTS + 40000, FEW = 70000 }; /* FEW: of four strips */

typedef struct sorted {
    hs_account account;
    hs_options options;
    hs_scene   scene;
    hs_grid    grid;
    double    *x;
} sorted;

/* Points in [-1, 1)^ndim: some of them are outside the box, if there is one. */
static void
open_scene(int ndim, int64_t n, double cutoff, const hs_box *box, sorted *s)
{
    harness_random random = {4711};
    hs_failure     failure;
    s->x = malloc((size_t)(n * ndim) * sizeof *s->x);
    for (int64_t e = 0; e < n * ndim; e++)
        s->x[e] = 2.0 * random_unit(&random) - 1.0;
    const hs_points points = points_in_rows(s->x, n, ndim);
    s->options = hs_options_default();
    s->options.cutoff = cutoff;
    s->options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
    hs_account_init(&s->account, &s->options);
    CHECK(hs_scene_make(&s->account, NULL, &(hs_sets){.points = &points}, box, &s->options,
                        &s->scene, NULL, &failure) == HS_OK);
    CHECK(hs_grid_init(&s->scene, HS_GRID_ANY, &s->grid, &failure) == HS_OK);
}

static void
close_scene(sorted *s)
{
    hs_scene_free(&s->account, &s->scene);
    CHECK(s->account.held == 0);
    hs_account_close(&s->account);
    free(s->x);
}

/* Sorts points of a scene of the same kind, in one go, by so many threads, while allocation nth
 * fails. Whether it was asked for. */
static bool
compare_order(double cutoff, int threads, int nth, const int32_t *expected, int *n_refused)
{
    sorted   s;
    hs_bins  bins;
    hs_team *team = hs_team_create(threads);
    open_scene(2, FEW, cutoff, NULL, &s);
    hs_test_fail_allocation(nth);
    const hs_status status =
        hs_bins_build(&s.account, team, &s.options, &s.scene, &s.grid, false, &bins);
    const bool disturbed = nth > 0 && !hs_test_failure_is_due();
    hs_test_fail_allocation(0);
    CHECK(status == HS_OK || (disturbed && status == HS_ERR_MEMORY));
    *n_refused += status != HS_OK;
    if (status == HS_OK) {
        CHECK(memcmp(bins.order, expected, FEW * sizeof *expected) == 0);
    }
    hs_bins_free(&s.account, &bins);
    close_scene(&s);
    hs_team_free(team);
    return disturbed;
}

/* Sorts the scene as queries of other points, whose grid this is; false where memory was refused
 * for the nth time. */
static bool
check_queries(const sorted *of_points, int64_t n, int nth)
{
    hs_grid  grid = of_points->grid;
    int64_t *cells = malloc((size_t)(n + 1) * sizeof *cells);
    double   squares = 0.0;
    sorted   s;
    hs_bins  bins;
    open_scene(2, n, of_points->options.cutoff, NULL, &s);
    for (int64_t i = 0; i < n; i++) {
        cells[i] = 0;
        for (int k = 0; k < 2; k++)
            cells[i] +=
                hs_grid_index(&grid, k, hs_scene_coordinate(&s.scene, i, k)) * grid.stride[k];
    }
    hs_test_fail_allocation(nth);
    const hs_status status =
        hs_bins_build(&s.account, NULL, &s.options, &s.scene, &grid, true, &bins);
    const bool disturbed = nth > 0 && !hs_test_failure_is_due();
    hs_test_fail_allocation(0);
    CHECK(status == (disturbed ? HS_ERR_MEMORY : HS_OK));
    for (int64_t si = 0, run = 0; status == HS_OK && si < n; si++) {
        const int64_t own = cells[bins.order[si]];
        const int64_t before = si > 0 ? cells[bins.order[si - 1]] : -1;
        CHECK(bins.cells[si] == own && before <= own);
        CHECK(before < own || bins.order[si - 1] < bins.order[si]);
        run = before == own ? run + 1 : 0;
        squares += (double)(2 * run + 1);
    }
    if (status == HS_OK) {
        CHECK(bins.start == NULL && bins.squares == squares);
    }
    hs_bins_free(&s.account, &bins);
    free(cells);
    close_scene(&s);
    return !disturbed;
}

/* Few of them are sorted by themselves, many into all the cells. */
static void
queries_carry_their_cells(void)
{
    static const int64_t counts[] = {0, 1, 2, 25, 1000, 30000};
    sorted               s;
    open_scene(2, FEW, 0.0001, NULL, &s);
    CHECK(s.grid.n_cells / 8 > 1000 && s.grid.n_cells / 8 < 30000);
    for (int c = 0; c < 6; c++) {
        CHECK(check_queries(&s, counts[c], 0));
        for (int nth = 1; !check_queries(&s, counts[c], nth); nth++) {
        }
    }
    close_scene(&s);
}

/* More queries than are sorted between two polls: the caller may say no at each. */
static void
many_queries_can_be_stopped(void)
{
    enum { N = 200, Q = HS_POLL_POINTS + 1000 };
    double         *x = array_of(2 * N, sizeof *x), *q = array_of(2 * Q, sizeof *q);
    harness_random  random = {142};
    const hs_points points = points_in_rows(x, N, 2), queries = points_in_rows(q, Q, 2);
    hs_options      options = hs_options_default();
    hs_status       status = HS_ERR_INTERRUPTED;
    refusal         once = {.nth = 0};
    for (int e = 0; e < 2 * N; e++)
        x[e] = random_unit(&random);
    for (int e = 0; e < 2 * Q; e++)
        q[e] = random_unit(&random);
    options.cutoff = 0.01;
    options.want = HS_WANT_J;
    options.poll = refuse_once;
    options.poll_context = &once;
    for (int64_t nth = 1; status == HS_ERR_INTERRUPTED; nth++) {
        hs_pairs *rows = NULL;
        once = (refusal){.nth = nth};
        status = hs_neighbors_find(QUERIED(&points, &queries, NULL), &options, &rows, NULL);
        CHECK(status == (once.n < nth ? HS_OK : HS_ERR_INTERRUPTED));
        CHECK((rows == NULL) == (status != HS_OK) && once.n <= nth && nth < 100);
        hs_pairs_free(rows);
    }
    CHECK(once.n > 3);
    free(x);
    free(q);
}

/* Few cells, and about as many as points: then threads do not count for themselves. */
static void
any_team_finds_the_same_order(void)
{
    static const double cutoffs[] = {0.02, 0.0001};
    for (int c = 0; c < 2; c++) {
        sorted  s;
        hs_bins bins;
        int     nth = 0, n_refused = 0;
        open_scene(2, FEW, cutoffs[c], NULL, &s);
        CHECK((s.grid.n_cells > FEW / 3) == (c == 1));
        CHECK(hs_bins_build(&s.account, NULL, &s.options, &s.scene, &s.grid, false, &bins) ==
              HS_OK);
        for (int threads = 2; threads <= HS_SLABS + 1; threads += threads == 2 ? 2 : 29)
            (void)compare_order(cutoffs[c], threads, 0, bins.order, &n_refused);
        CHECK(n_refused == 0);
        while (compare_order(cutoffs[c], 2, ++nth, bins.order, &n_refused) && nth < 50) {
        }
        /* The second one, of a thread that counts for itself, is no need. */
        CHECK(nth == (c == 0 ? 3 : 2) && n_refused == 1);
        hs_bins_free(&s.account, &bins);
        close_scene(&s);
    }
}

/* ---- scenes whose points are few and far between, crowded, or both ---- */

enum { SPARSE_MANY = 20000, SPARSE_MANY_KINDS = 8 };

/* Normal, from two uniform numbers. */
static double
random_normal(harness_random *random)
{
    const double angle = 6.283185307179586 * random_unit(random);
    return sqrt(-2.0 * log(1.0 - random_unit(random))) * cos(angle);
}

/* SPARSE_MANY points in three dimensions, for cutoff 1. */
static void
many_points(harness_random *random, int kind, double *many)
{
    const double side = 11.0; /* 15 points per unit of volume, 63 neighbours */
    for (int i = 0; i < SPARSE_MANY; i++) {
        double *x = many + 3 * i, radius = 1.0;
        if (kind == 3) /* lognormal sizes */
            radius = exp(3.0 * random_normal(random));
        else if (kind == 4) /* Plummer */
            radius = 3.0 / sqrt(pow(1.0 - random_unit(random), -2.0 / 3.0) - 1.0 + 1e-12);
        for (int k = 0; k < 3; k++) {
            x[k] = kind < 3 ? side * random_unit(random) : radius * random_normal(random);
            x[k] += kind == 1 && i % 2 ? 1e9 : kind == 2 && i % 2 ? 1e14 : 0.0;
            if (kind == 5)
                x[k] = pow(10.0, -3.0 + 303.0 * random_unit(random));
        }
        if (kind == 6)
            x[1] = x[2] = x[0] * 1e3; /* a line across */
        if (kind == 7 && i % 1000 == 0)
            x[0] = i % 2000 ? 1e300 : -1e300;
        if (kind == 7)
            x[2] = 1e-6 * x[2]; /* a plane */
    }
}

/*
 * ---- sparse grid ----
 *
 * Sparse cells are as far apart as their reach says, at any magnitude of the coordinates.
 */

static double many_sparse_grid[3 * SPARSE_MANY];

/* Scenes that a dense grid serves well are left to it; those it fails are not. */
static void
sparse_pays_where_points_crowd(void)
{
    /* What reaches to 1e300 has been condensed before. */
    static const bool pays[SPARSE_MANY_KINDS] = {false, true, true, true, true, false, true, false};
    harness_random    random = {141};
    for (int kind = 0; kind < SPARSE_MANY_KINDS; kind++) {
        const brute_scene scene = {
            .ndim = 3, .n = SPARSE_MANY, .x = many_sparse_grid, .cutoff = 1.0, .inclusive = true};
        const hs_options options = options_of(&scene);
        const hs_points  points = points_of(&scene);
        hs_account       account;
        hs_scene         read;
        hs_grid          dense;
        hs_failure       failure;
        many_points(&random, kind, many_sparse_grid);
        hs_account_init(&account, &options);
        CHECK(hs_scene_make(&account, NULL, &(hs_sets){.points = &points}, NULL, &options, &read,
                            NULL, &failure) == HS_OK);
        CHECK(hs_grid_init(&read, HS_GRID_ANY, &dense, &failure) == HS_OK);
        CHECK((hs_sparse_choose(&read, &dense, false) > 0.0) == pays[kind]);
        hs_scene_free(&account, &read);
    }
}

void
test_bins(void)
{
    RUN(coordinates_and_turns_travel_with_their_point);
    RUN(any_team_finds_the_same_order);
    RUN(queries_carry_their_cells);
    RUN(many_queries_can_be_stopped);
    RUN(sparse_pays_where_points_crowd);
}
