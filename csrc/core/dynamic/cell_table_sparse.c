/* SPDX-License-Identifier: BSD-3-Clause */
/* cell_table_sparse.c: sparse tables keep the numbers of their cells when they grow, and close the
 * gaps when they drop empty ones. */
#include "cell_table.h"

#include "../memory/account.h"

#define LEAST_ROWS 16

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
hs_cell_table_append(hs_cell_table *table, const int64_t *index)
{
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
