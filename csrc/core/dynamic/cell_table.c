/* SPDX-License-Identifier: BSD-3-Clause */
/* cell_table.c: dense tables are copied into larger ones; sparse tables keep their numbers when
 * they grow, and close the gaps when they drop empty cells. */
#include "cell_table.h"

#include "../memory/account.h"

#define LEAST_ROWS       16
#define MOST_DENSE_CELLS 0x1p31

void
hs_cell_table_init(hs_cell_table *table, const hs_axes *axes, bool dense)
{
    memset(table, 0, sizeof *table);
    table->dense = dense;
    table->ndim = axes->ndim;
    for (int k = 0; k < axes->ndim; k++) {
        table->shape[k] = axes->axis[k].n; /* 0: none yet, along open axes */
    }
}

void
hs_cell_table_free(hs_cell_table *table)
{
    hs_free(NULL, table->cell);
    hs_free(NULL, table->size);
    hs_free(NULL, table->index);
    hs_free(NULL, table->rows);
    table->cell = NULL;
    table->size = NULL;
    table->index = NULL;
    table->rows = NULL;
    table->n = table->capacity = table->n_rows = table->n_empty = 0;
}

/* ---- dense ---- */

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

static uint32_t
find_dense(const hs_cell_table *table, const int64_t *index)
{
    int64_t number = 0;
    for (int k = 0; k < table->ndim; k++) {
        const int64_t along = index[k] - table->lowest[k];
        if (along < 0 || along >= table->shape[k]) {
            return HS_NO_CELL;
        }
        number += along * table->stride[k];
    }
    return table->n > 0 ? (uint32_t)number : HS_NO_CELL;
}

/* ---- sparse ---- */

static uint32_t
mark_of(const hs_cell_table *table, uint32_t cell)
{
    uint64_t sum = 0;
    for (int k = 0; k < table->ndim; k++) {
        sum += hs_cell_part(k, table->index[(int64_t)cell * table->ndim + k]);
    }
    return hs_cell_mark(sum);
}

static void
put(hs_cell_row *rows, int64_t n_rows, uint32_t cell, uint32_t mark)
{
    int64_t r = mark & (uint64_t)(n_rows - 1);
    while (rows[r].cell != HS_NO_CELL) {
        r = (r + 1) & (n_rows - 1);
    }
    rows[r] = (hs_cell_row){cell, mark};
}

static void
put_all(const hs_cell_table *table, hs_cell_row *rows, int64_t n_rows)
{
    memset(rows, 0xFF, (size_t)n_rows * sizeof *rows);
    for (int64_t c = 0; c < table->n; c++) {
        put(rows, n_rows, (uint32_t)c, mark_of(table, (uint32_t)c));
    }
}

/* Empty cells are dropped; those behind them get lower numbers. */
static void
drop_empty(hs_cell_table *table, hs_entries *entries)
{
    const size_t width = (size_t)table->ndim * sizeof *table->index;
    int64_t      n = 0;
    for (int64_t c = 0; c < table->n; c++) {
        if (table->cell[c].count == 0) {
            if (table->size[c] != HS_NO_BLOCK) {
                hs_entries_give(entries, table->size[c], table->cell[c].start);
            }
            continue;
        }
        for (uint32_t e = 0; n < c && e < table->cell[c].count; e++) {
            hs_entry_tail_at(entries, table->cell[c].start + e)->cell = (uint32_t)n;
        }
        table->cell[n] = table->cell[c];
        table->size[n] = table->size[c];
        memmove(table->index + n * table->ndim, table->index + c * table->ndim, width);
        n++;
    }
    table->n = n;
    table->n_empty = 0;
    put_all(table, table->rows, table->n_rows);
}

/* Room for `capacity` cells and rows for them; on failure all is as it was. */
static bool
grow(hs_cell_table *table, int64_t capacity)
{
    int64_t n_rows = table->n_rows > 0 ? table->n_rows : LEAST_ROWS;
    while (capacity > n_rows / 4 * 3) {
        n_rows *= 2;
    }
    hs_cell     *cell = hs_alloc(NULL, HS_FOR_CELLS, capacity, sizeof *cell);
    uint8_t     *size = hs_alloc(NULL, HS_FOR_CELLS, capacity, sizeof *size);
    int32_t     *index = hs_alloc(NULL, HS_FOR_CELLS, capacity, table->ndim * sizeof *index);
    hs_cell_row *rows = hs_alloc(NULL, HS_FOR_CELLS, n_rows, sizeof *rows);
    if (cell == NULL || size == NULL || index == NULL || rows == NULL) {
        hs_free(NULL, cell);
        hs_free(NULL, size);
        hs_free(NULL, index);
        hs_free(NULL, rows);
        return false;
    }
    if (table->n > 0) {
        memcpy(cell, table->cell, (size_t)table->n * sizeof *cell);
        memcpy(size, table->size, (size_t)table->n * sizeof *size);
        memcpy(index, table->index, (size_t)(table->n * table->ndim) * sizeof *index);
    }
    hs_free(NULL, table->cell);
    hs_free(NULL, table->size);
    hs_free(NULL, table->index);
    hs_free(NULL, table->rows);
    table->cell = cell;
    table->size = size;
    table->index = index;
    table->rows = rows;
    table->n_rows = n_rows;
    table->capacity = capacity;
    put_all(table, rows, n_rows);
    return true;
}

bool
hs_cell_table_reserve(hs_cell_table *table, hs_entries *entries, int64_t more)
{
    if (table->n + more <= table->capacity) {
        return true;
    }
    if (table->n_empty >= table->n / 2 && table->n_empty > 0) {
        drop_empty(table, entries);
    }
    int64_t capacity = table->n + table->n / 2 + LEAST_ROWS;
    capacity = capacity < table->n + more ? table->n + more : capacity;
    if (table->n + more <= table->capacity ||
        (capacity < (int64_t)HS_NO_CELL && grow(table, capacity))) {
        return true;
    }
    if (table->n_empty > 0) {
        drop_empty(table, entries);
    }
    return table->n + more <= table->capacity;
}

uint32_t
hs_cell_table_find(const hs_cell_table *table, const int64_t *index)
{
    uint64_t sum = 0;
    if (table->dense) {
        return find_dense(table, index);
    }
    for (int k = 0; k < table->ndim; k++) {
        sum += hs_cell_part(k, index[k]);
    }
    return hs_cell_table_probe(table, index, hs_cell_mark(sum));
}

uint32_t
hs_cell_table_add(hs_cell_table *table, hs_entries *entries, const int64_t *index)
{
    const uint32_t found = hs_cell_table_find(table, index);
    if (found != HS_NO_CELL || table->dense) {
        return found;
    }
    if (!hs_cell_table_reserve(table, entries, 1)) {
        return HS_NO_CELL;
    }
    const uint32_t cell = (uint32_t)table->n++;
    table->n_empty++;
    table->cell[cell] = (hs_cell){0, 0};
    table->size[cell] = HS_NO_BLOCK;
    for (int k = 0; k < table->ndim; k++) {
        table->index[(int64_t)cell * table->ndim + k] = (int32_t)(uint32_t)index[k];
    }
    put(table->rows, table->n_rows, cell, mark_of(table, cell));
    return cell;
}

void
hs_cell_table_index(const hs_cell_table *table, uint32_t cell, int64_t *index)
{
    int64_t rest = cell;
    for (int k = 0; k < table->ndim; k++) {
        if (table->dense) {
            index[k] = table->lowest[k] + rest / table->stride[k];
            rest %= table->stride[k];
        } else {
            index[k] = table->index[(int64_t)cell * table->ndim + k];
        }
    }
}

int64_t
hs_cell_table_bytes(const hs_cell_table *table)
{
    int64_t bytes = table->capacity * (int64_t)HS_DENSE_CELL_BYTES;
    if (!table->dense) {
        bytes += table->capacity * table->ndim * (int64_t)sizeof *table->index +
                 table->n_rows * (int64_t)sizeof *table->rows;
    }
    return bytes;
}
