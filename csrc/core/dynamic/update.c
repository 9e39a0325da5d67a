/* SPDX-License-Identifier: BSD-3-Clause */
/* update.c: one point. Memory first, then changes that cannot fail. */
#include "update.h"

#include "cell_room.h"
#include "put_point.h"

/* The cell of a position, which is added where there is none. */
static hs_status
cell_for(hs_dynamic *list, const hs_placed *placed, uint32_t *number, hs_failure *failure)
{
    static const int64_t nowhere[HS_MAX_DIM] = {0};
    const int64_t       *index = placed != NULL ? placed->index : nowhere;
    if (list->cells.dense) {
        double          bytes = 0.0;
        const hs_status status = hs_cell_table_extend(&list->cells, &list->entries, index, index,
                                                      list->grid_bytes, &bytes);
        if (status != HS_OK) {
            failure->expected_bytes = bytes;
            failure->limit_bytes = list->grid_bytes;
            return status;
        }
    }
    *number = hs_cell_table_add(&list->cells, &list->entries, index);
    return *number != HS_NO_CELL ? HS_OK : HS_ERR_MEMORY;
}

hs_status
hs_update_insert(hs_dynamic *list, hs_key key, const hs_placed *placed, hs_failure *failure)
{
    uint32_t  number;
    hs_status status = cell_for(list, placed, &number, failure);
    if (status != HS_OK) {
        return status;
    }
    uint32_t place = hs_key_map_find(&list->map, &list->entries, key);
    if (place == HS_NO_PLACE && !hs_key_map_reserve(&list->map, list->map.n + 1)) {
        return HS_ERR_MEMORY;
    }
    if (place == HS_NO_PLACE || hs_entry_tail_at(&list->entries, place)->cell != number) {
        if (!hs_cell_reserve(list, number, (int64_t)list->cells.cell[number].count + 1)) {
            return HS_ERR_MEMORY;
        }
    }
    if (place == HS_NO_PLACE) {
        hs_put_new(list, key, number, placed);
    } else {
        hs_put_again(list, key, place, number, placed);
    }
    list->changes++;
    return HS_OK;
}

bool
hs_update_remove(hs_dynamic *list, hs_key key)
{
    const uint32_t place = hs_key_map_find(&list->map, &list->entries, key);
    if (place == HS_NO_PLACE) {
        return false;
    }
    list->n_without -= !hs_has_position(list, place);
    hs_key_map_remove(&list->map, key, place);
    hs_take_out(list, place);
    list->changes++;
    return true;
}
