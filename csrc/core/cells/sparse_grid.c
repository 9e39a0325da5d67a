/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * sparse_grid.c: cells whose number has no limit, and whether they are worth it.
 *
 * Why the reach holds at any distance. A place is (t - lower) c with c cells per length: two
 * roundings, so it is within 2^-52 of itself (and 2^-106), and it is a monotone function of t. The
 * cells follow each other without a gap and none is narrower than 1 (in places); so if two indices
 * are s >= 1 apart, s - 1 whole cells lie between the places. For two points within a range of each
 * other the places are at most range c + 2^-51 p apart, p being the larger one.
 *     p < 2^49: choose_pitch makes range c + 2^-51 p at most the reach r, so s - 1 < r.
 *     2^e <= p < 2^(e + 1), e >= 49: cells are w = 2^(e - 48) >= 2 wide and rounding moves places
 *     by at most 2^(e - 50) = w / 4, so range c >= w (s - 1) - w / 4 > s - 1 for s >= 2. Again
 *     s <= r.
 * Where p is just beyond 2^49, some of the cells between may be those before it, 1 wide; rounding
 * is 1/4 there as well, and the first case holds.
 *
 * Places are counted from the number in the points' range that is nearest to 0, which is where
 * float64 is finest: a cell wider than wanted holds at most 32 numbers to a side.
 */
#include "sparse_grid.h"

#include <math.h>
#include <stdlib.h>

/* More than the 1e-5 cells by which stencil.c widens windows, so that these end at the reach. */
#define LEAST_MARGIN 0x1p-16
/* Relative error of a place: 2^-51 for two roundings, times 4/3 for e <= 1/4 in 1 / (1 - e),
 * rounded up. */
#define PLACE_ERROR 0x1p-50
/* No place passes 2^1000, also where the range is 0. */
#define SMALLEST_PITCH 0x1p-1000
/* Indices along periodic axes: their places need no other numbering. */
#define MOST_PER_PERIOD 0x1p31

/* Least width of cells along axis k, `width` ranges to a row. */
static double
choose_pitch(const hs_grid *grid, int k, double extent, double width)
{
    const double split = k == 0 ? HS_SPARSE_SPLIT / width : 1.0 / width;
    double       places = HS_SPARSE_LINEAR;
    if (split * extent < HS_SPARSE_LINEAR * grid->range[k]) {
        places = split * extent / grid->range[k];
    }
    const double margin = LEAST_MARGIN + PLACE_ERROR * places;
    const double floor_of_pitch = SMALLEST_PITCH * fmax(extent, 1.0);
    return fmax(grid->range[k] * (1.0 + margin) / split, floor_of_pitch);
}

static void
set_open_axis(const hs_scene *scene, int k, double pitch, int64_t reach, hs_grid *grid)
{
    const double lower = scene->lower[k], upper = scene->upper[k];
    grid->lower[k] = lower > 0.0 ? lower : upper < 0.0 ? upper : 0.0;
    grid->cell_size[k] = pitch;
    grid->cells_per_length[k] = 1.0 / pitch;
    grid->skipped[k] = hs_sparse_number((lower - grid->lower[k]) * grid->cells_per_length[k]);
    grid->shape[k] = INT64_MAX;
    grid->shape[k] = hs_sparse_index(grid, k, upper) + 1;
    grid->reach[k] = reach < grid->shape[k] ? reach : grid->shape[k] - 1;
}

void
hs_sparse_grid(const hs_scene *scene, const hs_grid *dense, double width, hs_grid *grid)
{
    *grid = *dense;
    grid->n_cells = 0;
    for (int k = 0; k < scene->ndim; k++) {
        const double extent = scene->upper[k] - scene->lower[k];
        const double pitch = choose_pitch(grid, k, extent, width);
        grid->stride[k] = 0;
        grid->skipped[k] = 0;
        grid->by_faces[k] = false;
        if (scene->lattice.row_of_axis[k] >= 0) {
            const double count = floor(fmin(extent / pitch, MOST_PER_PERIOD));
            /* Cells are range / 4 wide or more, or there is one: then its reach is at most that of
             * the dense grid, which has one or more. */
            const hs_status status = hs_grid_set_axis(scene, k, fmax(count, 1.0), grid);
            HS_ASSERT(status == HS_OK);
            (void)status;
            continue;
        }
        const double reach = k == 0 ? fmax(1.0, HS_SPARSE_SPLIT / width) : 1.0;
        set_open_axis(scene, k, pitch, (int64_t)reach, grid);
    }
}

/*
 * Dense or sparse, and how wide the cells. Both grids are judged by how many
 * other points the cell of an average point holds, which a sample tells: samples are compared with
 * each other, so their number grows with the square root of n, and a cell that holds enough of the
 * points to matter holds a few dozen of the samples, for any n.
 */

/* How much larger than wanted a dense cell must be before anything is counted. */
#define WORTH_A_LOOK 4.0
/* Other points in a point's dense cell, below which nothing better is looked for: half as many
 * tests take as long as the sparse grid's longer sort, some 80 ns a point. */
#define CROWDED 800.0
/* Tests that take as long as gathering one neighbourhood, some 150 ns, and as finding a row of
 * cells for it, some 75: a test takes 0.2 to 0.4 ns. So they are in 2 to 6 dimensions. */
#define TESTS_PER_GROUP 600.0
#define TESTS_PER_ROW   300.0
/* In cells so much wider than the cutoff float32 does not tell neighbours from others where a group
 * has points of several clusters, and pairs are decided one by one: some 12 ns each. */
#define FILTER_FAILS       0x1p20
#define TESTS_PER_DECISION 40.0
#define WIDEST             256.0 /* ranges */
#define MOST_SAMPLES       4096  /* 32 kB of stack */

/* A bijection of 64 bits that spreads every bit over all others (the finaliser of MurmurHash3). */
static uint64_t
mix(uint64_t bits)
{
    bits = (bits ^ bits >> 33) * UINT64_C(0xff51afd7ed558ccd);
    bits = (bits ^ bits >> 33) * UINT64_C(0xc4ceb9fe1a85ec53);
    return bits ^ bits >> 33;
}

static int
compare_names(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Other points in the cell of an average point, from how often samples share a cell. The short
 * cells of a sparse grid count together, as cubes. */
static double
mean_company(const hs_scene *scene, const hs_grid *grid, bool sparse)
{
    uint64_t      names[MOST_SAMPLES];
    const double  wanted = fmin(2.0 * sqrt((double)scene->n), MOST_SAMPLES);
    const int64_t samples = (int64_t)fmin(wanted, (double)scene->n), stride = scene->n / samples;
    double        shared = 0.0;
    for (int64_t s = 0; s < samples; s++) {
        /* One point of each range, not always at the same place in it: inputs have patterns. */
        const int64_t i = s * stride + (int64_t)(mix((uint64_t)s) % (uint64_t)stride);
        names[s] = 0;
        for (int k = 0; k < scene->ndim; k++) {
            const double t = hs_scene_coordinate(scene, i, k);
            int64_t      index = sparse ? hs_sparse_index(grid, k, t) : hs_grid_index(grid, k, t);
            index /= sparse && k == 0 ? HS_SPARSE_SPLIT : 1;
            names[s] = mix(names[s] ^ (uint64_t)index);
        }
    }
    qsort(names, (size_t)samples, sizeof *names, compare_names);
    for (int64_t s = 1, run = 0; s < samples; s++) {
        run = names[s] == names[s - 1] ? run + 1 : 0;
        shared += 2.0 * (double)run;
    }
    return shared / ((double)samples * (double)(samples - 1)) * (double)scene->n;
}

/* Tests per point, all costs counted as tests, for cells that hold `company` others. */
static double
cost_of(double company, int ndim)
{
    /* Of the cells around a point half are visited, in half of the rows. Points in clumps have
     * fewer full ones: 2^d of 3^d / 2. */
    const double rows = 0.5 * pow(3.0, ndim - 1);
    return ldexp(company, ndim) + (TESTS_PER_GROUP + TESTS_PER_ROW * rows) / (1.0 + company);
}

/* The cheapest width of cells; *cost: what it costs. */
static double
choose_width(const hs_scene *scene, const hs_grid *dense, double *cost)
{
    double best = 1.0;
    *cost = INFINITY;
    for (double width = 1.0; width <= WIDEST; width *= 2.0) {
        hs_grid grid;
        hs_sparse_grid(scene, dense, width, &grid);
        const double company = mean_company(scene, &grid, true);
        const double found = cost_of(company, scene->ndim);
        if (found < *cost) {
            *cost = found;
            best = width;
        } else if (company > 1.0) { /* wider only gets worse */
            break;
        }
    }
    return best;
}

double
hs_sparse_width(const hs_scene *scene, const hs_grid *dense)
{
    double cost;
    return scene->n < 2 ? 1.0 : choose_width(scene, dense, &cost);
}

double
hs_sparse_choose(const hs_scene *scene, const hs_grid *dense)
{
    double larger = 1.0, widest = 1.0, cost;
    if ((double)scene->n < CROWDED) {
        return 0.0;
    }
    for (int k = 0; k < scene->ndim; k++) {
        if (dense->cell_size[k] > dense->range[k]) {
            const double wider = fmin(dense->cell_size[k] / dense->range[k], 0x1p100);
            larger *= wider;
            widest = fmax(widest, wider);
        }
    }
    if (!(larger > WORTH_A_LOOK)) {
        return 0.0;
    }
    /* At least half of a point's company is tested, whatever its neighbours hold. */
    double crowd = mean_company(scene, dense, false);
    if (widest > FILTER_FAILS) {
        crowd *= TESTS_PER_DECISION;
    }
    if (!(crowd > CROWDED)) {
        return 0.0;
    }
    const double width = choose_width(scene, dense, &cost);
    return 0.5 * crowd > cost ? width : 0.0;
}
