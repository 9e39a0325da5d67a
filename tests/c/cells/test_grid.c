/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_grid.c: wherever two points within the radius of each other lie, the offset of their cells
 * is met exactly once: forwards from one of them, and not also from the other.
 */
#include <float.h>

#include "../../../csrc/core/cells/stencil.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

void test_grid(void);

static random_scene shared;

typedef struct searched {
    hs_account account;
    hs_scene   scene;
    hs_grid    grid;
    hs_stencil stencil;
} searched;

static hs_status
prepare(searched *s)
{
    const hs_points  points = points_of(&shared.scene);
    const hs_options options = options_of(&shared.scene);
    hs_failure       failure;
    hs_account_init(&s->account, &options);
    hs_status status =
        hs_scene_init(&s->account, NULL, &points, shared.scene.box, &options, &s->scene, &failure);
    if (status != HS_OK)
        return status;
    status = hs_grid_init(&s->scene, &s->grid, &failure);
    if (status == HS_OK)
        status = hs_stencil_build(&s->account, &options, &s->scene, &s->grid, false, &s->stencil);
    if (status != HS_OK)
        hs_scene_free(&s->account, &s->scene);
    return status;
}

static void
release(searched *s)
{
    hs_stencil_free(&s->account, &s->stencil);
    hs_scene_free(&s->account, &s->scene);
    CHECK(s->account.held == 0);
}

/* How many times the stencil goes forward by this offset of cells. */
static int
times_visited(const searched *s, const int64_t *offset, int64_t sign)
{
    int times = 0;
    for (int64_t e = 0; e < s->stencil.n_rows; e++) {
        const hs_stencil_row *row = &s->stencil.rows[e];
        bool                  same = true;
        for (int k = 1; k < s->grid.ndim; k++)
            same = same && row->offset[k] == sign * offset[k];
        times += same && row->first <= sign * offset[0] && sign * offset[0] <= row->last;
    }
    return times;
}

/* The cell of x, images counted on: wraps a copy into the box first, as the search does. False
 * when x is not where points can be. */
static bool
cell_indices(const searched *s, const double *x, int64_t *index)
{
    const hs_lattice *lattice = &s->scene.lattice;
    double            inside[HS_MAX_DIM];
    int64_t           turns[HS_MAX_DIM] = {0};
    memcpy(inside, x, sizeof inside);
    for (int pass = 0; pass < 2; pass++) {
        for (int k = 0; k < s->grid.ndim; k++) {
            const int r = lattice->row_of_axis[k];
            if (r < 0)
                continue;
            const double t = hs_lattice_coordinate(lattice, inside, k);
            const double turn = rint(t / lattice->period[k]);
            for (int c = 0; c < s->grid.ndim; c++)
                inside[c] -= turn * lattice->rows[r][c];
            turns[k] += (int64_t)turn;
        }
    }
    for (int k = 0; k < s->grid.ndim; k++) {
        const double t = hs_lattice_coordinate(&s->scene.lattice, inside, k);
        if (lattice->row_of_axis[k] < 0 && !(t >= s->scene.lower[k] && t <= s->scene.upper[k]))
            return false;
        index[k] = hs_grid_index(&s->grid, k, t) + turns[k] * s->grid.shape[k];
    }
    return true;
}

/* A place in the region, on a cell's face along about half of the axes. */
static void
random_place(harness_random *random, const searched *s, double *x)
{
    double t[HS_MAX_DIM];
    for (int k = 0; k < s->grid.ndim; k++) {
        const double cells = (double)s->grid.shape[k];
        double       place = cells * random_unit(random);
        if (random_below(random, 2))
            place = floor(place) + (random_below(random, 2) ? 0.0 : 1.0 - 1e-12);
        t[k] = s->grid.lower[k] + place * s->grid.cell_size[k];
    }
    for (int c = 0; c < s->grid.ndim; c++) {
        x[c] = 0.0;
        for (int k = 0; k < s->grid.ndim; k++)
            x[c] += t[k] * s->scene.lattice.direction[k][c];
    }
}

/* y = x + a vector no longer than the radius, most of them exactly as long, some along an axis. */
static void
random_neighbour(harness_random *random, const searched *s, const double *x, double *y)
{
    double    vector[HS_MAX_DIM], square = 0.0;
    const int along = random_below(random, 2 * s->grid.ndim);
    for (int k = 0; k < s->grid.ndim; k++) {
        vector[k] = along < s->grid.ndim ? (double)(k == along) : 2.0 * random_unit(random) - 1.0;
        if (random_below(random, 2))
            vector[k] = -vector[k];
        square += vector[k] * vector[k];
    }
    const double length = random_below(random, 4) ? 1.0 - 1e-15 : random_unit(random);
    for (int k = 0; k < s->grid.ndim; k++)
        y[k] = x[k] + (square > 0.0 ? vector[k] / sqrt(square) : 0.0) * length * s->scene.cutoff;
}

/* Returns how many neighbours lay where points can be. */
static int
check_places(harness_random *random, const searched *s, int n_places)
{
    int checked = 0;
    for (int p = 0; p < n_places; p++) {
        double  x[HS_MAX_DIM] = {0}, y[HS_MAX_DIM] = {0};
        int64_t from[HS_MAX_DIM] = {0}, to[HS_MAX_DIM] = {0}, offset[HS_MAX_DIM] = {0};
        bool    own = true;
        random_place(random, s, x);
        random_neighbour(random, s, x, y);
        if (!cell_indices(s, x, from) || !cell_indices(s, y, to))
            continue;
        for (int k = 0; k < s->grid.ndim; k++) {
            offset[k] = to[k] - from[k];
            own = own && offset[k] == 0;
        }
        const int forwards = times_visited(s, offset, 1);
        CHECK(own ? forwards == 1 : forwards + times_visited(s, offset, -1) == 1);
        checked++;
    }
    return checked;
}

static void
neighbouring_cells_are_met_exactly_once(void)
{
    harness_random random = {299792458};
    int            checked = 0, several = 0, few = 0;
    for (int trial = 0; trial < 900; trial++) {
        searched s;
        make_scene(&random, trial % SCENE_KINDS, 1 + trial / SCENE_KINDS % 5,
                   40 + random_below(&random, 361), trial % 9 ? 4.0 : 100.0, 0, &shared);
        shared.scene.cutoff = (trial % 4 ? 0.7 : 3.0) * random_unit(&random);
        if (prepare(&s) != HS_OK)
            continue;
        several += s.grid.n_cells > 1;
        for (int k = 0; k < s.grid.ndim; k++)
            few += s.scene.lattice.row_of_axis[k] >= 0 && s.grid.shape[k] < 3;
        if (s.stencil.n_rows < 3000)
            checked += check_places(&random, &s, 150);
        release(&s);
    }
    CHECK(checked > 60000);
    CHECK(several > 300);
    CHECK(few > 50);
}

static void
offsets_are_listed_once(void)
{
    harness_random random = {6626};
    for (int trial = 0; trial < 200; trial++) {
        searched s;
        make_scene(&random, trial % SCENE_KINDS, 1 + trial / SCENE_KINDS % 4, 300, 4.0, 0, &shared);
        shared.scene.cutoff = 1.5 * random_unit(&random);
        if (prepare(&s) != HS_OK)
            continue;
        const hs_stencil_row *rows = s.stencil.rows;
        bool                  once = s.stencil.n_rows >= 1 && rows[0].first == 0;
        for (int k = 1; k < s.grid.ndim; k++)
            once = once && rows[0].offset[k] == 0;
        for (int64_t a = 0; a < s.stencil.n_rows && a < 300; a++) {
            int64_t offset[HS_MAX_DIM] = {0};
            for (int k = 1; k < s.grid.ndim; k++)
                offset[k] = rows[a].offset[k];
            offset[0] = rows[a].last;
            once = once && times_visited(&s, offset, 1) == 1;
            once = once && (a == 0 || times_visited(&s, offset, -1) == 0);
        }
        CHECK(once);
        release(&s);
    }
}

static void
cells_are_bounded_by_the_points(void)
{
    harness_random random = {137};
    for (int trial = 0; trial < 400; trial++) {
        searched s;
        make_scene(&random, trial % SCENE_KINDS, 1 + trial / 7 % HS_MAX_DIM,
                   random_below(&random, 60), 4.0, trial % 3 ? 0 : 300, &shared);
        const int exponent = random_below(&random, 700);
        for (int e = 0; e < shared.scene.n * shared.scene.ndim; e++)
            shared.x[e] = ldexp(shared.x[e], trial % 2 ? exponent : 0);
        for (int e = 0; e < 64; e++)
            shared.box.rows[e / 8][e % 8] = ldexp(shared.box.rows[e / 8][e % 8], exponent);
        shared.scene.cutoff = ldexp(1.0, -random_below(&random, 1000));
        if (prepare(&s) != HS_OK)
            continue;
        int64_t product = 1;
        for (int k = 0; k < s.grid.ndim; k++) {
            CHECK(s.grid.shape[k] >= 1 && s.grid.stride[k] == product);
            product *= s.grid.shape[k];
        }
        CHECK(product == s.grid.n_cells);
        CHECK(s.grid.n_cells <= 2 * shared.scene.n + HS_GRID_SPARE_CELLS);
        release(&s);
    }
}

/* A reach of 2^31 cells or more must be refused, not rounded into a narrower integer. */
static void
reach_never_passes_its_integers(void)
{
    static const double cutoffs[] = {0x1p30,         0x1.fffffffp+30, 0x1.fffffffep+30,
                                     0x1p31 - 0.5,   0x1p31,          0x1p32,
                                     0x1p31 - 0.001, 0x1p31 - 1.5,    0x1p31 - 2.5};
    hs_box              box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    for (int trial = 0; trial < 9; trial++) {
        searched s;
        shared.x[0] = 0.25;
        shared.scene = (brute_scene){.ndim = 1, .n = 1, .x = shared.x, .box = &box};
        shared.scene.cutoff = cutoffs[trial];
        const hs_status status = prepare(&s);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        if (status == HS_OK) {
            const double cells = (double)s.stencil.rows[0].last;
            CHECK((cells + 1.0) * s.grid.cell_size[0] >= s.scene.cutoff);
            release(&s);
        }
    }
}

void
test_grid(void)
{
    RUN(neighbouring_cells_are_met_exactly_once);
    RUN(offsets_are_listed_once);
    RUN(cells_are_bounded_by_the_points);
    RUN(reach_never_passes_its_integers);
}
