/* SPDX-License-Identifier: BSD-3-Clause */
/* cell_table_dense.c: dense tables reach farther by being copied into larger ones. */
#include "cell_table.h"

#include "../memory/account.h"

#define MOST_DENSE_CELLS 0x1p31

/* The number of cells, and how far one along each axis is from the next. */
static double
set_strides(const int64_t *shape, int ndim, int64_t *stride)
{
    double n = 1.0;
    for (int k = ndim - 1; k >= 0; k--) { /* the last axis fastest */
        stride[k] = n < MOST_DENSE_CELLS ? (int64_t)n : 0;
        n *= (double)shape[k];
    }
    return n;
}

/* The range along an axis that holds both, grown by half of the present one where it grows at all.
 * Periodic axes have theirs from the beginning. */
static void
join(const hs_cell_table *table, int k, int64_t first, int64_t last, bool generous, int64_t *lowest,
     int64_t *shape)
{
    const int64_t more = generous ? table->shape[k] / 2 : 0;
    int64_t       low = first, high = last;
    if (table->shape[k] > 0) {
        low = table->lowest[k];
        high = low + table->shape[k] - 1;
        low = first < low ? first - more : low;
        high = last > high ? last + more : high;
    }
    *lowest = low;
    *shape = high - low + 1;
}

/* Moves the old cells to their places in the new ones. */
static void
transfer(hs_cell_table *table, hs_entries *entries, const int64_t *lowest, const int64_t *stride,
         hs_cell *cell, uint8_t *size)
{
    for (int64_t c = 0; c < table->n; c++) {
        int64_t index[HS_MAX_DIM], number = 0;
        if (table->size[c] == HS_NO_BLOCK) {
            continue;
        }
        hs_cell_table_index(table, (uint32_t)c, index);
        for (int k = 0; k < table->ndim; k++) {
            number += (index[k] - lowest[k]) * stride[k];
        }
        cell[number] = table->cell[c];
        size[number] = table->size[c];
        for (uint32_t e = 0; e < cell[number].count; e++) {
            hs_entry_tail_at(entries, cell[number].start + e)->cell = (uint32_t)number;
        }
    }
}

/* Whether the table reaches from `first` to `last` as it is. */
static bool
reaches(const hs_cell_table *table, const int64_t *first, const int64_t *last)
{
    bool all = table->n > 0;
    for (int k = 0; k < table->ndim; k++) {
        all = all && first[k] >= table->lowest[k] && last[k] < table->lowest[k] + table->shape[k];
    }
    return all;
}

hs_status
hs_cell_table_extend(hs_cell_table *table, hs_entries *entries, const int64_t *first,
                     const int64_t *last, double most, double *bytes)
{
    int64_t lowest[HS_MAX_DIM], shape[HS_MAX_DIM], stride[HS_MAX_DIM];
    double  n = 0.0;
    if (reaches(table, first, last)) {
        return HS_OK;
    }
    for (int generous = 1; generous >= 0; generous--) {
        for (int k = 0; k < table->ndim; k++) {
            join(table, k, first[k], last[k], generous == 1, &lowest[k], &shape[k]);
        }
        n = set_strides(shape, table->ndim, stride);
        if (n < MOST_DENSE_CELLS && n * HS_DENSE_CELL_BYTES <= most) {
            break;
        }
    }
    *bytes = n * HS_DENSE_CELL_BYTES;
    if (!(n < MOST_DENSE_CELLS && *bytes <= most)) {
        return HS_ERR_CAPACITY;
    }
    hs_cell *cell = hs_alloc(NULL, HS_FOR_CELLS, (int64_t)n, sizeof *cell);
    uint8_t *size = cell == NULL ? NULL : hs_alloc(NULL, HS_FOR_CELLS, (int64_t)n, sizeof *size);
    if (size == NULL) {
        hs_free(NULL, cell);
        return HS_ERR_MEMORY;
    }
    memset(cell, 0, (size_t)n * sizeof *cell);
    memset(size, HS_NO_BLOCK, (size_t)n * sizeof *size);
    transfer(table, entries, lowest, stride, cell, size);
    hs_free(NULL, table->cell);
    hs_free(NULL, table->size);
    table->cell = cell;
    table->size = size;
    table->n = table->capacity = (int64_t)n;
    memcpy(table->lowest, lowest, sizeof lowest);
    memcpy(table->shape, shape, sizeof shape);
    memcpy(table->stride, stride, sizeof stride);
    return HS_OK;
}
