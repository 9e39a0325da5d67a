/* SPDX-License-Identifier: BSD-3-Clause */
/* bins.c: a stable counting sort, O(n + cells). See bins.h. */
#include "bins.h"

#include "poll.h"

#include <string.h>

/* The cell of every point, and in start[c + 1] how many points cell c has. */
static hs_status
count_points(const hs_scene *scene, const hs_grid *grid, const hs_options *options,
             uint32_t *cells, int32_t *start)
{
    for (int64_t i = 0; i < scene->n; i++) {
        if (hs_poll_points(options, i + 1) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
        const double *x = scene->x + i * scene->ndim;
        int64_t       cell = 0;
        for (int k = 0; k < scene->ndim; k++) {
            const double t = hs_lattice_coordinate(&scene->lattice, x, k);
            cell += hs_grid_index(grid, k, t) * grid->stride[k];
        }
        cells[i] = (uint32_t)cell;
        start[cell + 1]++;
    }
    return HS_OK;
}

/* On entry start[c + 1] counts cell c; on return start[c] is where cell c begins. */
static void
accumulate(int32_t *start, int64_t n_cells)
{
    for (int64_t c = 0; c < n_cells; c++) {
        start[c + 1] += start[c];
    }
}

static hs_status
allocate(hs_account *account, const hs_scene *scene, const hs_grid *grid, hs_bins *bins)
{
    const int64_t n = scene->n;
    bool          complete = true;
    for (int k = 0; k < scene->ndim; k++) {
        bins->x[k] = hs_alloc(account, HS_FOR_POINTS, n, sizeof(double));
        complete = complete && bins->x[k] != NULL;
    }
    bins->order = hs_alloc(account, HS_FOR_ORDER, n, sizeof(int32_t));
    bins->start = hs_alloc(account, HS_FOR_CELLS, grid->n_cells + 1, sizeof(int32_t));
    complete = complete && bins->order != NULL && bins->start != NULL;
    if (scene->originals != NULL) {
        bins->originals =
            hs_alloc(account, HS_FOR_ORIGINALS, n * scene->ndim, sizeof(double));
        complete = complete && bins->originals != NULL;
    }
    if (scene->turns != NULL) {
        bins->turns =
            hs_alloc(account, HS_FOR_WRAPS, n * bins->n_periodic, sizeof(int64_t));
        complete = complete && bins->turns != NULL;
    }
    return complete ? HS_OK : HS_ERR_MEMORY;
}

static void
place_point(const hs_scene *scene, int64_t i, int64_t si, hs_bins *bins)
{
    const int d = scene->ndim, m = bins->n_periodic;
    bins->order[si] = (int32_t)i;
    for (int k = 0; k < d; k++) {
        bins->x[k][si] = scene->x[i * d + k];
    }
    if (bins->originals != NULL) {
        memcpy(bins->originals + si * d, scene->originals + i * d, (size_t)d * sizeof(double));
    }
    if (bins->turns != NULL) {
        memcpy(bins->turns + si * m, scene->turns + i * m, (size_t)m * sizeof(int64_t));
    }
}

static hs_status
place_points(const hs_scene *scene, const uint32_t *cells, int64_t n_cells,
             const hs_options *options, hs_bins *bins)
{
    int32_t *next = bins->start; /* while placing, start[c] runs ahead to the end of cell c */
    for (int64_t i = 0; i < scene->n; i++) {
        place_point(scene, i, next[cells[i]]++, bins);
        if (hs_poll_points(options, i + 1) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    memmove(next + 1, next, (size_t)n_cells * sizeof(int32_t));
    next[0] = 0;
    return HS_OK;
}

hs_status
hs_bins_build(hs_account *account, const hs_options *options, hs_scene *scene,
              const hs_grid *grid, hs_bins *bins)
{
    *bins = (hs_bins){.n = scene->n,
                      .ndim = scene->ndim,
                      .n_periodic = scene->lattice.n_periodic};
    hs_status status = allocate(account, scene, grid, bins);
    if (status == HS_OK && grid->n_cells == 1) {
        bins->start[0] = 0;
        bins->start[1] = (int32_t)scene->n;
        for (int64_t i = 0; i < scene->n; i++) {
            place_point(scene, i, i, bins);
        }
    } else if (status == HS_OK) {
        uint32_t *cells = hs_alloc(account, HS_FOR_ORDER, scene->n, sizeof(uint32_t));
        if (cells == NULL) {
            status = HS_ERR_MEMORY;
        } else {
            memset(bins->start, 0, (size_t)(grid->n_cells + 1) * sizeof(int32_t));
            status = count_points(scene, grid, options, cells, bins->start);
            if (status == HS_OK) {
                accumulate(bins->start, grid->n_cells);
                status = place_points(scene, cells, grid->n_cells, options, bins);
            }
            hs_free(account, cells);
        }
    }
    hs_scene_free(account, scene);
    if (status != HS_OK) {
        hs_bins_free(account, bins);
    }
    return status;
}

void
hs_bins_free(hs_account *account, hs_bins *bins)
{
    for (int k = 0; k < bins->ndim; k++) {
        hs_free(account, bins->x[k]);
        bins->x[k] = NULL;
    }
    hs_free(account, bins->order);
    hs_free(account, bins->start);
    hs_free(account, bins->originals);
    hs_free(account, bins->turns);
    bins->order = NULL;
    bins->start = NULL;
    bins->originals = NULL;
    bins->turns = NULL;
}
