/* SPDX-License-Identifier: BSD-3-Clause */
/* edges.c: bands are the filter's thresholds at each edge; the table is made as fine as keeps most
 * bands apart. */
#include "edges.h"

#include "../exact/filter.h"

#include <float.h>
#include <math.h>

/* Bits of a float32 that do not choose its cell, in the order in which they are tried. For each
 * power of two there are 128 cells, which tell a hundred bins apart, or 2048 for a thousand, or
 * 32768. Constants make the loop quicker. */
#define FEW_CELLS  16
#define MANY_CELLS 12
#define ALL_CELLS  8
#define MOST_CELLS (1 << 16) /* a megabyte; squares below these share cell 0 */

hs_status
hs_edges_init(hs_account *account, const hs_scene *scene, double filter_error,
              const hs_histogram *histogram, hs_edges *edges)
{
    const int64_t n = histogram->n_edges;
    *edges = (hs_edges){.n = n,
                        .inclusive = histogram->inclusive,
                        .last_inclusive = histogram->last_inclusive,
                        .ndim = scene->ndim,
                        .filter_error = filter_error};
    edges->at = hs_alloc(account, HS_FOR_CANDIDATES, scene->extreme ? 3 * n : n, sizeof(double));
    if (edges->at == NULL) {
        return HS_ERR_MEMORY;
    }
    edges->lower = edges->upper = edges->at;
    if (scene->extreme) {
        edges->lower = edges->at + n;
        edges->upper = edges->lower + n;
    }
    for (int64_t k = 0; k < n; k++) {
        const double given = histogram->edges[k], scaled = hs_scale_apply(scene->scale, given);
        edges->at[k] = scene->extreme ? given : scaled;
        if (scene->extreme) { /* scaling may have rounded or flushed it */
            edges->lower[k] = given > 0.0 ? scaled - HS_SCALING_LOSS : 0.0;
            edges->upper[k] = given > 0.0 ? scaled + HS_SCALING_LOSS : 0.0;
        }
    }
    return HS_OK;
}

void
hs_edges_free(hs_account *account, hs_edges *edges)
{
    hs_free(account, edges->at);
    edges->at = NULL;
}

/* Sets the band of every edge. */
static void
set_bands(const hs_edges *edges, double extent, hs_edge_table *table)
{
    for (int64_t k = 0; k < edges->n; k++) {
        const double lower = edges->lower[k], upper = edges->upper[k];
        if (edges->at[k] == 0.0 && !hs_edge_is_inclusive(edges, k)) {
            table->in[k] = table->out[k] = -1.0f; /* no distance is below zero */
            continue;
        }
        const hs_thresholds near =
            hs_thresholds_of(edges->ndim, upper, extent, edges->filter_error);
        table->out[k] = near.out;
        table->in[k] = near.in;
        if (lower != upper) {
            table->in[k] =
                lower > 0.0 ? hs_thresholds_of(edges->ndim, lower, extent, edges->filter_error).in
                            : -1.0f;
        }
    }
}

/* The cell of a square that is not negative, and no larger than the end of the last band. */
static int32_t
cell_of(const hs_edge_table *table, float square)
{
    const int32_t cell = (int32_t)(hs_bits_of_float(square) >> table->shift) - table->first;
    HS_ASSERT(square >= 0.0f && cell <= table->last);
    return cell < 0 ? 0 : cell;
}

/* Makes cells of 2^shift neighbouring floats each, from the first band that ends above zero to the
 * last. Returns how many pairs of bands share a cell although they do not overlap. */
static int64_t
set_cells(const hs_edges *edges, int shift, hs_edge_table *table)
{
    int64_t k = 0, shared = 0;
    while (k < edges->n - 1 && table->out[k] < 0.0f) {
        k++;
    }
    const float lowest = table->out[k] < 0.0f ? 0.0f : table->out[k];
    const float highest = table->out[edges->n - 1] < 0.0f ? 0.0f : table->out[edges->n - 1];
    table->shift = shift;
    table->first = (int32_t)(hs_bits_of_float(lowest) >> shift);
    table->last = (int32_t)(hs_bits_of_float(highest) >> shift) - table->first;
    if (table->last >= MOST_CELLS) {
        table->first += table->last - (MOST_CELLS - 1);
        table->last = MOST_CELLS - 1;
    }
    for (; k + 1 < edges->n; k++) {
        const float in = table->in[k + 1], out = table->out[k];
        shared += in > out && cell_of(table, in) == cell_of(table, out);
    }
    return shared;
}

/* Chooses as few cells as keep most bands apart. */
static void
choose_cells(const hs_edges *edges, hs_edge_table *table)
{
    const int64_t few = edges->n / 64; /* the last bins share first, and have the most pairs */
    if (set_cells(edges, FEW_CELLS, table) > few && set_cells(edges, MANY_CELLS, table) > few) {
        (void)set_cells(edges, ALL_CELLS, table);
    }
}

static void
fill_cells(const hs_edges *edges, hs_edge_table *table)
{
    int64_t below = 0, reached = 0; /* bands that end before the cell, or begin before its end */
    for (int32_t c = 0; c <= table->last; c++) {
        const uint32_t at = (uint32_t)(table->first + c);
        const float    least = c == 0 ? 0.0f : hs_float_of_bits(at << table->shift);
        const float    most = hs_float_of_bits(((at + 1) << table->shift) - 1);
        while (below < edges->n && table->out[below] < least) {
            below++;
        }
        while (reached < edges->n && (c == table->last || table->in[reached] <= most)) {
            reached++;
        }
        hs_edge_cell *cell = &table->cells[c];
        cell->slot = (int32_t)(2 * below);
        cell->n_bands = (int32_t)(reached - below);
        cell->in = cell->n_bands == 0 ? INT32_MAX : 0;
        cell->out = INT32_MAX;
        if (cell->n_bands == 1) {
            cell->in = table->in[below] < 0.0f ? 0 : (int32_t)hs_bits_of_float(table->in[below]);
            cell->out = (int32_t)hs_bits_of_float(table->out[below]); /* not below `least` */
        }
    }
}

hs_status
hs_edge_table_build(const hs_edges *edges, double extent, hs_edge_table *table)
{
    hs_edge_table_free(table);
    table->in = hs_alloc(NULL, HS_FOR_CANDIDATES, 2 * edges->n, sizeof(float));
    if (table->in == NULL) {
        return HS_ERR_MEMORY;
    }
    table->out = table->in + edges->n;
    set_bands(edges, extent, table);
    table->extent = extent;
    if (!(4.0 * edges->ndim * extent * extent <= FLT_MAX)) { /* four times the largest square */
        return HS_OK;
    }
    choose_cells(edges, table);
    table->cells =
        hs_alloc(NULL, HS_FOR_CANDIDATES, (int64_t)table->last + 1, sizeof(hs_edge_cell));
    if (table->cells == NULL) {
        hs_edge_table_free(table);
        return HS_ERR_MEMORY;
    }
    fill_cells(edges, table);
    return HS_OK;
}

void
hs_edge_table_free(hs_edge_table *table)
{
    hs_free(NULL, table->cells);
    hs_free(NULL, table->in);
    *table = (hs_edge_table){0};
}

HS_ALWAYS_INLINE bool
find_slots(const hs_edge_table *table, const float *squares, int32_t n, int32_t *slots,
           const int shift)
{
    const hs_edge_cell *cells = table->cells;
    const int32_t       first = table->first;
    int32_t             odd = 0;
    for (int32_t h = 0; h < n; h++) {
        const int32_t       bits = (int32_t)hs_bits_of_float(squares[h]);
        const int32_t       at = (bits >> shift) - first;
        const hs_edge_cell *cell = &cells[at < 0 ? 0 : at];
        /* Differences of these do not overflow; their sign bits count. */
        const uint32_t below = (uint32_t)(bits - cell->in) >> 31;
        const uint32_t above = (uint32_t)(cell->out - bits) >> 31;
        slots[h] = cell->slot + 1 - (int32_t)below + (int32_t)above;
        odd |= slots[h];
    }
    return (odd & 1) != 0;
}

bool
hs_edge_slots(const hs_edge_table *table, const float *squares, int32_t n, int32_t *slots)
{
    if (table->cells == NULL) {
        for (int32_t h = 0; h < n; h++) {
            slots[h] = 1;
        }
        return true;
    }
    switch (table->shift) {
    case FEW_CELLS: return find_slots(table, squares, n, slots, FEW_CELLS);
    case MANY_CELLS: return find_slots(table, squares, n, slots, MANY_CELLS);
    default: return find_slots(table, squares, n, slots, ALL_CELLS);
    }
}

/* The first edge of [low, high) whose limit is not below the square. */
static int32_t
first_not_below(const float *limits, int32_t low, int32_t high, float square)
{
    while (low < high) {
        const int32_t middle = low + (high - low) / 2;
        if (limits[middle] < square) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

void
hs_edge_range(const hs_edge_table *table, const hs_edges *edges, float square, int32_t *low,
              int32_t *high)
{
    if (table->cells == NULL) {
        *low = 0;
        *high = (int32_t)edges->n;
        return;
    }
    const hs_edge_cell *cell = &table->cells[cell_of(table, square)];
    const int32_t       first = cell->slot / 2, end = first + cell->n_bands;
    *low = first_not_below(table->out, first, end, square);
    /* Edges with in <= s: up to the first with in > s. */
    *high = first_not_below(table->in, *low, end, nextafterf(square, INFINITY));
}
