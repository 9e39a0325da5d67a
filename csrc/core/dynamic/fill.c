/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * fill.c: a counting sort. A first pass numbers the cells and counts what goes into each, a second
 * one gives them blocks, one behind another, and a third one writes the points there.
 */
#include "fill.h"

#include "cell_room.h"
#include "new_list.h"
#include "rows.h"
#include "../memory/account.h"

#define POINTS_A_CELL 4  /* or more: else a hash table grows meanwhile */
#define AT_ONCE       32 /* rows whose memory is fetched before they are written */

static hs_key
key_of(const int64_t *ids, const int32_t *tags, int64_t i)
{
    return (hs_key){ids[i], tags != NULL ? tags[i] : 0};
}

/* hs_rows_place, for a number of dimensions that the compiler may know. */
HS_ALWAYS_INLINE hs_status
place_row(const hs_dynamic *list, double *const *x, int64_t i, double *given, hs_placed *placed,
          hs_failure *failure, const int ndim)
{
    for (int k = 0; k < ndim; k++) {
        given[k] = x[k][i];
    }
    return hs_dynamic_place_in(list, given, placed, failure, ndim);
}

/* The cell of each row, and how many go to each. */
HS_ALWAYS_INLINE hs_status
count_in(hs_dynamic *list, int64_t n, double *const *x, uint32_t *numbers, hs_failure *failure,
         const int ndim)
{
    double    given[HS_MAX_DIM];
    hs_placed placed;
    for (int64_t i = 0; i < n; i++) {
        if (!hs_rows_go_on(list, i)) {
            return HS_ERR_INTERRUPTED;
        }
        const hs_status status = place_row(list, x, i, given, &placed, failure, ndim);
        if (status != HS_OK) {
            failure->row = i;
            return status;
        }
        numbers[i] = hs_cell_table_add(&list->cells, &list->entries, placed.index);
        if (numbers[i] == HS_NO_CELL) {
            return HS_ERR_MEMORY;
        }
        list->cells.n_empty -= list->cells.cell[numbers[i]].count++ == 0;
    }
    return HS_OK;
}

static hs_status
count_rows(hs_dynamic *list, int64_t n, double *const *x, uint32_t *numbers, hs_failure *failure)
{
    switch (list->lattice.ndim) {
    case 2: return count_in(list, n, x, numbers, failure, 2);
    case 3: return count_in(list, n, x, numbers, failure, 3);
    default: return count_in(list, n, x, numbers, failure, list->lattice.ndim);
    }
}

/* Dense cells as far as there are points. Along the axes of aligned boxes the cell is a monotone
 * function of the coordinate, so that the outermost coordinates are enough; count_rows will see
 * whether each position can be had. */
static hs_status
reach(hs_dynamic *list, int64_t n, double *const *x, hs_failure *failure)
{
    int64_t first[HS_MAX_DIM], last[HS_MAX_DIM];
    double  bytes = 0.0;
    if (!list->lattice.aligned) {
        return hs_rows_reach(list, n, x, failure);
    }
    for (int k = 0; k < list->lattice.ndim; k++) {
        const hs_axis *axis = &list->axes.axis[k];
        double         low = x[k][0], high = low;
        for (int64_t i = 1; axis->n == 0 && i < n; i++) {
            low = hs_smaller(x[k][i], low);
            high = hs_larger(x[k][i], high);
        }
        first[k] = axis->n == 0 ? hs_axis_cell(axis, low) : 0;
        last[k] = axis->n == 0 ? hs_axis_cell(axis, high) : axis->n - 1;
    }
    const hs_status status =
        hs_cell_table_extend(&list->cells, &list->entries, first, last, list->grid_bytes, &bytes);
    failure->expected_bytes = bytes;
    failure->limit_bytes = list->grid_bytes;
    return status;
}

/* A block for each cell that is not empty, in the order of the cells, so that those of neighbours
 * lie side by side. Counts begin again. */
static bool
cut_blocks(hs_dynamic *list)
{
    hs_cell_table *cells = &list->cells;
    int64_t        total = 0;
    for (int64_t c = 0; c < cells->n; c++) {
        total += cells->cell[c].count > 0 ? INT64_C(1) << hs_block_size(cells->cell[c].count) : 0;
    }
    if (!hs_entries_reserve(&list->entries, total)) {
        return false;
    }
    for (int64_t c = 0; c < cells->n; c++) {
        if (cells->cell[c].count > 0) {
            const int size = hs_block_size(cells->cell[c].count);
            cells->size[c] = (uint8_t)size;
            cells->cell[c] = (hs_cell){hs_entries_take(&list->entries, size), 0};
        }
    }
    return true;
}

/* Rows i to i + n - 1. First where each of them goes, so that the memory is there when it is
 * written to: the points of a cell come from anywhere among the rows. */
HS_ALWAYS_INLINE void
write_in(hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t i, int n,
         double *const *x, const uint32_t *numbers, hs_failure *failure, const int ndim)
{
    uint32_t  places[AT_ONCE];
    double    given[HS_MAX_DIM];
    hs_placed placed;
    for (int r = 0; r < n; r++) {
        hs_cell *const cell = &list->cells.cell[numbers[i + r]];
        places[r] = cell->start + cell->count++;
        HS_PREFETCH_WRITE(hs_entry_at(&list->entries, places[r]));
        HS_PREFETCH_WRITE(hs_entry_given(&list->entries, places[r]));
        hs_key_map_expect(&list->map, key_of(ids, tags, i + r));
    }
    for (int r = 0; r < n; r++) {
        const hs_key   key = key_of(ids, tags, i + r);
        hs_entry_tail *tail = hs_entry_tail_at(&list->entries, places[r]);
        (void)place_row(list, x, i + r, given, &placed, failure, ndim); /* as in count_rows */
        *tail = (hs_entry_tail){key.id, key.tag, numbers[i + r]};
        hs_dynamic_write(list, places[r], &placed);
        hs_key_map_add(&list->map, key, places[r]);
    }
}

static void
write_some(hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t i, int n,
           double *const *x, const uint32_t *numbers, hs_failure *failure)
{
    switch (list->lattice.ndim) {
    case 2: write_in(list, ids, tags, i, n, x, numbers, failure, 2); break;
    case 3: write_in(list, ids, tags, i, n, x, numbers, failure, 3); break;
    default: write_in(list, ids, tags, i, n, x, numbers, failure, list->lattice.ndim);
    }
}

hs_status
hs_fill(hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t n, double *const *x,
        hs_failure *failure)
{
    hs_list_clear(list);
    uint32_t *numbers = hs_alloc(NULL, HS_FOR_CELLS, n, sizeof *numbers);
    hs_status status = numbers != NULL ? HS_OK : HS_ERR_MEMORY;
    if (status == HS_OK && list->cells.dense) {
        status = reach(list, n, x, failure);
    } else if (status == HS_OK &&
               !hs_cell_table_reserve(&list->cells, &list->entries, n / POINTS_A_CELL)) {
        status = HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        status = count_rows(list, n, x, numbers, failure);
    }
    if (status == HS_OK && !(cut_blocks(list) && hs_key_map_reserve(&list->map, n))) {
        status = HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        for (int64_t i = 0; i < n; i += AT_ONCE) {
            const int some = (int)(n - i < AT_ONCE ? n - i : AT_ONCE);
            write_some(list, ids, tags, i, some, x, numbers, failure);
        }
    } else {
        hs_list_clear(list);
    }
    hs_free(NULL, numbers);
    return status;
}
