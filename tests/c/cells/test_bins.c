/* SPDX-License-Identifier: BSD-3-Clause */
/* test_bins.c: points in cell order: each once, in its own cell, in the caller's order within
 * it. */
#include "../../../csrc/core/cells/bins.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

void test_bins(void);

static random_scene shared;

/* Scene, grid and bins of the shared scene; false where the scene is refused. */
static bool
sort_scene(hs_account *account, const hs_options *options, hs_scene *scene, hs_grid *grid,
           hs_bins *bins)
{
    const hs_points points = points_of(&shared.scene);
    hs_failure      failure;
    hs_account_init(account, options);
    if (hs_scene_init(account, NULL, &points, shared.scene.box, options, scene, &failure) != HS_OK)
        return false;
    if (hs_grid_init(scene, grid, &failure) != HS_OK) {
        hs_scene_free(account, scene);
        return false;
    }
    return hs_bins_build(account, NULL, options, scene, grid, bins) == HS_OK;
}

static int64_t
cell_of(const hs_scene *scene, const hs_grid *grid, const hs_bins *bins, int64_t si)
{
    double  x[HS_MAX_DIM];
    int64_t cell = 0;
    for (int k = 0; k < bins->ndim; k++)
        x[k] = bins->x[k][si];
    for (int k = 0; k < bins->ndim; k++) {
        const double t = hs_lattice_coordinate(&scene->lattice, x, k);
        cell += hs_grid_index(grid, k, t) * grid->stride[k];
    }
    return cell;
}

static void
check_order(const hs_scene *scene, const hs_grid *grid, const hs_bins *bins)
{
    bool seen[SCENE_POINTS] = {false}, right = true;
    CHECK(bins->start[0] == 0);
    CHECK(bins->start[grid->n_cells] == bins->n);
    for (int64_t c = 0; c < grid->n_cells; c++) {
        right = right && bins->start[c] <= bins->start[c + 1];
        for (int32_t si = bins->start[c]; si < bins->start[c + 1]; si++) {
            const int32_t i = bins->order[si];
            right = right && i >= 0 && i < bins->n && !seen[i];
            seen[i] = true;
            right = right && (si == bins->start[c] || bins->order[si - 1] < i);
            right = right && cell_of(scene, grid, bins, si) == c;
        }
    }
    CHECK(right);
}

static void
every_point_is_once_in_its_own_cell(void)
{
    harness_random random = {16180};
    int            sorted = 0, many_cells = 0;
    for (int trial = 0; trial < 400; trial++) {
        hs_account account;
        hs_scene   scene;
        hs_grid    grid;
        hs_bins    bins;
        make_scene(&random, trial % SCENE_KINDS, 1 + trial / SCENE_KINDS % HS_MAX_DIM,
                   random_below(&random, SCENE_POINTS + 1), trial % 7 ? 4.0 : 1e6, 0, &shared);
        shared.scene.cutoff = random_unit(&random);
        const hs_options options = options_of(&shared.scene);
        if (!sort_scene(&account, &options, &scene, &grid, &bins))
            continue;
        CHECK(bins.n == shared.scene.n);
        CHECK(account.total.bytes[HS_FOR_CELLS] >= 4 * (grid.n_cells + 1));
        check_order(&scene, &grid, &bins);
        many_cells += grid.n_cells > 1;
        sorted++;
        hs_bins_free(&account, &bins);
        CHECK(account.held == 0);
    }
    CHECK(sorted > 300);
    CHECK(many_cells > 50);
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

/* Boxes and open ranges that are whole multiples of the cutoff or its parts, with points on the
 * faces between cells and a last place beside them. */
static void
cells_are_cut_by_faces(void)
{
    harness_random   random = {10};
    const hs_options defaults = hs_options_default();
    const double     units[] = {1.0, 0.1, 0.3, 1.0 / 3.0, 0x1p-30};
    int              cut = 0;
    for (int trial = 0; trial < 300; trial++) {
        const int    ndim = 1 + trial % 3;
        const double unit = units[trial % 5];
        hs_account   account;
        hs_options   options = defaults;
        hs_scene     scene;
        hs_grid      grid;
        hs_bins      bins;
        memset(&shared.box, 0, sizeof shared.box);
        shared.box.ndim = ndim;
        shared.scene = (brute_scene){.ndim = ndim, .n = SCENE_POINTS, .x = shared.x};
        shared.scene.box = trial % 4 ? &shared.box : NULL;
        options.cutoff = unit * (1 + trial / 5 % 2);
        for (int k = 0; k < ndim; k++) {
            shared.box.periodic[k] = trial % 4 != 2 || k == 0;
            shared.box.rows[k][k] = unit * (4 + random_below(&random, 9));
        }
        for (int e = 0; e < ndim * SCENE_POINTS; e++) {
            const double x = unit * random_below(&random, 12) * (trial % 7 ? 1.0 : 0.5);
            const int    step = random_below(&random, 4);
            shared.x[e] = step == 0 ? nextafter(x, -1.0) : step == 1 ? nextafter(x, 99.0) : x;
            if (trial % 2)
                shared.x[e] += trial % 3 ? -5.0 * unit : 0.25 * unit * random_unit(&random);
        }
        if (!sort_scene(&account, &options, &scene, &grid, &bins))
            continue;
        for (int k = 0; k < ndim; k++)
            cut += grid.by_faces[k];
        check_order(&scene, &grid, &bins);
        hs_bins_free(&account, &bins);
        hs_scene_free(&account, &scene);
        hs_account_close(&account);
    }
    CHECK(cut > 20);
}

/* A lattice with a point on each face, whose zeros are negative: they lie on a face, not before
 * it. */
static void
a_zero_has_no_sign(void)
{
    for (int ndim = 1; ndim <= 2; ndim++) {
        hs_account account;
        hs_scene   scene;
        hs_grid    grid;
        hs_bins    bins;
        const int  n = 64, length = ndim == 1 ? 64 : 8;
        shared.scene = (brute_scene){.ndim = ndim,
                                     .n = n,
                                     .x = shared.x,
                                     .box = &shared.box,
                                     .cutoff = 1.0,
                                     .inclusive = true};
        shared.box = (hs_box){.ndim = ndim};
        for (int k = 0; k < ndim; k++) {
            shared.box.periodic[k] = true;
            shared.box.rows[k][k] = (double)length;
        }
        for (int e = 0; e < n * ndim; e++) {
            const int place = (e % ndim == 0 ? e / ndim % length : e / ndim / length) - length / 2;
            shared.x[e] = place == 0 ? -0.0 : (double)place;
        }
        const hs_options options = options_of(&shared.scene);
        CHECK(sort_scene(&account, &options, &scene, &grid, &bins));
        CHECK(grid.by_faces[0] && grid.n_cells > 1);
        check_order(&scene, &grid, &bins);
        hs_bins_free(&account, &bins);
        hs_scene_free(&account, &scene);
        hs_account_close(&account);
    }
}

void
test_bins(void)
{
    RUN(a_zero_has_no_sign);
    RUN(every_point_is_once_in_its_own_cell);
    RUN(coordinates_and_turns_travel_with_their_point);
    RUN(cells_are_cut_by_faces);
}
