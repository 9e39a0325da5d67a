/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * bins.c: a stable counting sort, O(n + cells).
 *
 * The point numbers are sorted first, then the columns are gathered in their order. While the
 * numbers are sorted the spare column holds the cell of every point.
 *
 * With a team the points are cut into strips, each with counts of its own. Cell after cell, the
 * strips' points follow each other in the order of the strips, which is that of the points: the
 * result does not depend on the number of strips.
 */
#include "bins.h"

#include <string.h>

#include "../../kernels/kernel.h"
#include "../threads/passes.h"

/* Points whose cells are found together: their coordinates stay in the first-level cache. */
#define TILE 512
/* Points for which a strip of its own pays. */
#define STRIP_POINTS 16384

typedef struct sorting {
    const hs_grid    *grid;
    const hs_lattice *lattice;
    const hs_bins    *bins;
    double *const    *x;
    uint32_t         *cells; /* cell of every point */
    int               n_strips;
    int32_t          *counts[HS_SLABS]; /* of each strip: points in each cell, then the place of
                                          * its next point there */
} sorting;

/* id += the part of the cell id that axis k gives, by the steps of hs_grid_index. Cell ids and
 * strides are below 2^32, indices below 2^31. */
static void
add_index(const hs_grid *grid, int k, const double *HS_RESTRICT t, int64_t n,
          uint32_t *HS_RESTRICT id)
{
    const double   lower = grid->lower[k], cells_per_length = grid->cells_per_length[k];
    const double   last = (double)(grid->shape[k] - 1);
    const double   size = grid->cell_size[k];
    const uint32_t stride = (uint32_t)grid->stride[k];
    if (!grid->by_faces[k]) {
        for (int64_t i = 0; i < n; i++) {
            const double place = (t[i] - lower) * cells_per_length;
            const double below = place < last ? place : last;
            const double inside = below > 0.0 ? below : 0.0;
            id[i] += (uint32_t)(int32_t)inside * stride;
        }
        return;
    }
    const double bias = HS_GRID_BIAS * (double)grid->shape[k];
    for (int64_t i = 0; i < n; i++) {
        const double place = (t[i] - lower) * cells_per_length + bias;
        const double below = place < last ? place : last;
        const double cell = (double)(int32_t)(below > 0.0 ? below : 0.0);
        /* Plus zero: t = -0 on a face at 0 is not before it, and the difference of these is -0. */
        const uint64_t beyond = hs_bits_of_double(t[i] - (lower + cell * size) + 0.0);
        id[i] += (uint32_t)((int32_t)cell - (int32_t)(beyond >> 63)) * stride; /* its sign */
    }
}

static hs_status
count_strip(void *context, int strip, int64_t first, int64_t last)
{
    const sorting *sort = context;
    int32_t       *counts = sort->counts[strip];
    double         t[TILE];
    for (int64_t begin = first; begin < last; begin += TILE) {
        const int64_t n = last - begin < TILE ? last - begin : TILE;
        uint32_t     *id = sort->cells + begin;
        const double *from[HS_MAX_DIM];
        for (int k = 0; k < sort->grid->ndim; k++) {
            from[k] = sort->x[k] + begin;
        }
        memset(id, 0, (size_t)n * sizeof *id);
        for (int k = 0; k < sort->grid->ndim; k++) {
            if (sort->grid->shape[k] == 1) {
                continue;
            }
            if (sort->lattice->aligned) {
                add_index(sort->grid, k, from[k], n, id);
            } else {
                hs_fold_coordinates(sort->lattice, k, from, n, t);
                add_index(sort->grid, k, t, n, id);
            }
        }
        for (int64_t i = 0; i < n; i++) {
            counts[id[i]]++;
        }
    }
    return HS_OK;
}

/* Turns numbers of points into places: cell by cell, and in each cell strip by strip. */
static void
accumulate(const sorting *sort)
{
    int32_t place = 0;
    for (int64_t c = 0; c < sort->grid->n_cells; c++) {
        for (int strip = 0; strip < sort->n_strips; strip++) {
            const int32_t count = sort->counts[strip][c];
            sort->counts[strip][c] = place;
            place += count;
        }
    }
}

static hs_status
order_strip(void *context, int strip, int64_t first, int64_t last)
{
    const sorting       *sort = context;
    int32_t *HS_RESTRICT next = sort->counts[strip];
    const uint32_t      *cells = sort->cells;
    int32_t *HS_RESTRICT order = sort->bins->order;
    for (int64_t i = first; i < last; i++) {
        order[next[cells[i]]++] = (int32_t)i;
    }
    return HS_OK;
}

/* Strips for this team: each with points enough, and no more further counts than points. */
static int
choose_strips(const hs_team *team, int64_t n, int64_t n_cells)
{
    int n_strips = hs_team_size(team) < HS_SLABS ? hs_team_size(team) : HS_SLABS;
    while (n_strips > 1 && (n < n_strips * STRIP_POINTS || (n_strips - 1) * n_cells > n)) {
        n_strips--;
    }
    return n_strips;
}

/* Sorts the point numbers into bins->order, and fills bins->start. */
static hs_status
sort_numbers(hs_account *account, hs_team *team, const hs_options *options, sorting *sort)
{
    const int64_t n_cells = sort->grid->n_cells, n = sort->bins->n;
    int32_t      *start = sort->bins->start;
    int32_t      *others = NULL;
    sort->n_strips = choose_strips(team, n, n_cells);
    if (sort->n_strips > 1) {
        others = hs_alloc(account, HS_FOR_CELLS, (sort->n_strips - 1) * n_cells, sizeof *others);
        sort->n_strips = others == NULL ? 1 : sort->n_strips;
    }
    memset(start, 0, (size_t)n_cells * sizeof *start);
    sort->counts[0] = start;
    for (int strip = 1; strip < sort->n_strips; strip++) {
        sort->counts[strip] = others + (strip - 1) * n_cells;
        memset(sort->counts[strip], 0, (size_t)n_cells * sizeof *others);
    }
    hs_status status = hs_walk_strips(team, options, n, sort->n_strips, count_strip, sort);
    if (status == HS_OK) {
        accumulate(sort);
        status = hs_walk_strips(team, options, n, sort->n_strips, order_strip, sort);
    }
    /* The last strip's place in a cell has moved up to where the next cell starts. */
    memmove(start + 1, sort->counts[sort->n_strips - 1], (size_t)n_cells * sizeof *start);
    start[0] = 0;
    hs_free(account, others);
    return status;
}

/* A column on its way to cell order. */
typedef struct moving {
    const int32_t *order;
    const void    *from;
    void          *to;
    size_t         size; /* 4 or 8 bytes an entry */
} moving;

static hs_status
gather_slab(void *context, int slab, int64_t first, int64_t last)
{
    const moving              *move = context;
    const int32_t *HS_RESTRICT order = move->order;
    (void)slab;
    if (move->size == sizeof(double)) {
        const uint64_t *HS_RESTRICT from = move->from;
        uint64_t *HS_RESTRICT       to = move->to;
        for (int64_t si = first; si < last; si++) {
            to[si] = from[order[si]];
        }
    } else {
        const uint32_t *HS_RESTRICT from = move->from;
        uint32_t *HS_RESTRICT       to = move->to;
        for (int64_t si = first; si < last; si++) {
            to[si] = from[order[si]];
        }
    }
    return HS_OK;
}

/* Gathers a column into the free one, and leaves its own place free. */
static hs_status
gather_column(hs_team *team, const hs_options *options, const hs_bins *bins, size_t size,
              void **column, void **free_column)
{
    moving move = {bins->order, *column, *free_column, size};
    *free_column = *column;
    *column = move.to;
    return hs_walk_slabs(team, options, bins->n, gather_slab, &move);
}

static hs_status
gather_doubles(hs_team *team, const hs_options *options, const hs_bins *bins,
               double *columns[HS_MAX_DIM], void **free_column)
{
    hs_status status = HS_OK;
    for (int k = 0; k < bins->ndim && status == HS_OK; k++) {
        void *column = columns[k];
        status = gather_column(team, options, bins, sizeof(double), &column, free_column);
        columns[k] = column;
    }
    return status;
}

/*
 * Columns of x, originals and turns, as bins->order says, in the order in which they lie behind the
 * free column: the wide ones go before the narrow ones. x_is_beside: the originals lie behind the
 * free column, X lies apart. *end: where the last column ends that is still needed. HS_OK or
 * HS_ERR_INTERRUPTED.
 */
static hs_status
gather_columns(hs_team *team, const hs_options *options, bool x_is_beside, hs_bins *bins,
               void *free_column, char **end)
{
    double  **first = x_is_beside ? bins->originals : bins->x;
    double  **second = x_is_beside ? bins->x : bins->originals;
    hs_status status = gather_doubles(team, options, bins, first, &free_column);
    if (status == HS_OK && bins->keeps_originals) {
        status = gather_doubles(team, options, bins, second, &free_column);
    }
    for (int r = 0; bins->turns.known && r < bins->n_periodic && status == HS_OK; r++) {
        const bool   narrow = bins->turns.narrow[r] != NULL;
        const size_t size = narrow ? sizeof(int32_t) : sizeof(int64_t);
        void        *column = narrow ? (void *)bins->turns.narrow[r] : bins->turns.wide[r];
        status = gather_column(team, options, bins, size, &column, &free_column);
        bins->turns.narrow[r] = narrow ? column : NULL;
        bins->turns.wide[r] = narrow ? NULL : column;
    }
    *end = free_column;
    return status;
}

hs_status
hs_bins_arrange(hs_account *account, hs_team *team, const hs_options *options,
                const hs_scene *scene, hs_bins *bins)
{
    char           *end = NULL;
    const hs_status status =
        gather_columns(team, options, scene->x_is_beside, bins, scene->cloud.spare, &end);
    if (status == HS_OK) {
        void *last = bins->beside != NULL ? bins->beside : bins->points;
        hs_trim(account, last, (size_t)(end - (char *)last) + HS_COLUMN_PADDING);
    }
    return status;
}

static hs_status
sort_points(hs_account *account, hs_team *team, const hs_options *options, const hs_scene *scene,
            const hs_grid *grid, hs_bins *bins)
{
    sorting         sort = {.grid = grid,
                            .lattice = &scene->lattice,
                            .bins = bins,
                            .x = bins->x,
                            .cells = (uint32_t *)(void *)scene->cloud.spare};
    const hs_status status = sort_numbers(account, team, options, &sort);
    return status == HS_OK ? hs_bins_arrange(account, team, options, scene, bins) : status;
}

void
hs_bins_take(hs_scene *scene, hs_bins *bins)
{
    *bins = (hs_bins){.n = scene->n, .ndim = scene->ndim, .n_periodic = scene->lattice.n_periodic};
    bins->points = scene->cloud.block;
    bins->beside = scene->beside;
    bins->order = scene->cloud.order;
    bins->turns = scene->turns;
    bins->keeps_originals = scene->keeps_originals;
    memcpy(bins->x, scene->cloud.x, sizeof bins->x);
    memcpy(bins->originals, scene->originals, sizeof bins->originals);
    scene->cloud.block = NULL;
    scene->beside = NULL;
}

hs_status
hs_bins_build(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene,
              const hs_grid *grid, hs_bins *bins)
{
    hs_status status = HS_OK;
    hs_bins_take(scene, bins);
    bins->start = hs_alloc(account, HS_FOR_CELLS, grid->n_cells + 1, sizeof(int32_t));
    if (bins->start == NULL) {
        status = HS_ERR_MEMORY;
    } else if (grid->n_cells == 1) {
        bins->start[0] = 0;
        bins->start[1] = (int32_t)scene->n;
        for (int64_t i = 0; i < scene->n; i++) {
            bins->order[i] = (int32_t)i;
        }
    } else {
        status = sort_points(account, team, options, scene, grid, bins);
    }
    if (status != HS_OK) {
        hs_bins_free(account, bins);
    }
    return status;
}

void
hs_bins_free(hs_account *account, hs_bins *bins)
{
    hs_free(account, bins->points);
    hs_free(account, bins->beside);
    hs_free(account, bins->start);
    bins->points = NULL;
    bins->beside = NULL;
    bins->start = NULL;
}
