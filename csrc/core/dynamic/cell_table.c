/* SPDX-License-Identifier: BSD-3-Clause */
/* cell_table.c: cells are found, in either kind of table. */
#include "cell_table.h"

#include "../memory/account.h"

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
    for (int k = 0; k < table->ndim; k++) {
        table->is_wide = table->is_wide || index[k] < INT32_MIN || index[k] > INT32_MAX;
    }
    if (found != HS_NO_CELL || table->dense) {
        return found;
    }
    return hs_cell_table_reserve(table, entries, 1) ? hs_cell_table_append(table, index)
                                                    : HS_NO_CELL;
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
