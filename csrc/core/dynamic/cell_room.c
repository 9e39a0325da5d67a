/* SPDX-License-Identifier: BSD-3-Clause */
/* cell_room.c: a block that is too small is replaced by a larger one; the map learns where its
 * entries are now. */
#include "cell_room.h"

int
hs_block_size(int64_t count)
{
    int size = 0;
    while (INT64_C(1) << size < count) {
        size++;
    }
    return size;
}

bool
hs_cell_reserve(hs_dynamic *list, uint32_t number, int64_t count)
{
    hs_cell *const cell = &list->cells.cell[number];
    uint8_t *const size = &list->cells.size[number];
    const int      larger = hs_block_size(count);
    if (*size != HS_NO_BLOCK && larger <= *size) {
        return true;
    }
    const uint32_t place = larger < HS_ENTRY_SIZES ? hs_entries_take(&list->entries, larger)
                                                   : HS_NO_PLACE;
    if (place == HS_NO_PLACE) {
        return false;
    }
    for (uint32_t e = 0; e < cell->count; e++) {
        const hs_entry_tail *tail = hs_entry_tail_at(&list->entries, cell->start + e);
        hs_entries_copy(&list->entries, cell->start + e, &list->entries, place + e, 1);
        hs_key_map_moved(&list->map, (hs_key){tail->id, tail->tag}, cell->start + e, place + e);
    }
    if (*size != HS_NO_BLOCK) {
        hs_entries_give(&list->entries, *size, cell->start);
    }
    cell->start = place;
    *size = (uint8_t)larger;
    return true;
}
