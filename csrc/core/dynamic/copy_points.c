/* SPDX-License-Identifier: BSD-3-Clause */
/* copy_points.c: all memory first, then cell after cell, in order. */
#include "copy_points.h"

#include "cell_room.h"

/* Memory for all that a copy will hold, and no more. */
static bool
reserve_copy(const hs_dynamic *list, hs_dynamic *copy)
{
    int64_t first[HS_MAX_DIM], last[HS_MAX_DIM], index[HS_MAX_DIM];
    int64_t n_entries = 0, n_cells = 0;
    double  bytes;
    for (int64_t c = 0; c < list->cells.n; c++) {
        if (list->cells.cell[c].count == 0) {
            continue;
        }
        hs_cell_table_index(&list->cells, (uint32_t)c, index);
        for (int k = 0; k < list->lattice.ndim; k++) {
            first[k] = n_cells == 0 || index[k] < first[k] ? index[k] : first[k];
            last[k] = n_cells == 0 || index[k] > last[k] ? index[k] : last[k];
        }
        n_entries += INT64_C(1) << hs_block_size(list->cells.cell[c].count);
        n_cells++;
    }
    return n_cells == 0 ||
           (hs_key_map_reserve(&copy->map, list->map.n) &&
            hs_entries_reserve(&copy->entries, n_entries) &&
            (list->cells.dense ? hs_cell_table_extend(&copy->cells, &copy->entries, first, last,
                                                      list->grid_bytes, &bytes) == HS_OK
                               : hs_cell_table_reserve(&copy->cells, &copy->entries, n_cells)));
}

hs_status
hs_copy_points(const hs_dynamic *list, hs_dynamic *copy)
{
    int64_t index[HS_MAX_DIM];
    if (!reserve_copy(list, copy)) {
        return HS_ERR_MEMORY;
    }
    for (int64_t c = 0; c < list->cells.n; c++) {
        const hs_cell cell = list->cells.cell[c];
        if (cell.count == 0) {
            continue;
        }
        hs_cell_table_index(&list->cells, (uint32_t)c, index);
        const uint32_t number = hs_cell_table_add(&copy->cells, &copy->entries, index);
        (void)hs_cell_reserve(copy, number, cell.count); /* reserve_copy has the memory */
        const uint32_t start = copy->cells.cell[number].start;
        hs_entries_copy(&list->entries, cell.start, &copy->entries, start, cell.count);
        copy->cells.cell[number].count = cell.count;
        copy->cells.n_empty--;
        for (uint32_t e = 0; e < cell.count; e++) {
            hs_entry_tail *tail = hs_entry_tail_at(&copy->entries, start + e);
            tail->cell = number;
            hs_key_map_add(&copy->map, (hs_key){tail->id, tail->tag}, start + e);
        }
    }
    copy->n_without = list->n_without;
    copy->cells.is_wide = list->cells.is_wide;
    copy->magnitude = list->magnitude;
    return HS_OK;
}
