/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * put_point.h: a point comes into a cell, goes out of it or moves on, once there is room: nothing
 * here can fail. A point that stays in its cell is written over; else it is appended to its new
 * cell and taken out of the old one.
 */
#ifndef HS_PUT_POINT_H
#define HS_PUT_POINT_H

#include "dynamic.h"
#include "place_point.h"

/* A new entry behind those of a cell that has room for it; returns its place. */
HS_ALWAYS_INLINE uint32_t
hs_append_entry(hs_dynamic *list, uint32_t number, hs_key key, const hs_placed *placed)
{
    hs_cell *const       cell = &list->cells.cell[number];
    const uint32_t       place = cell->start + cell->count;
    hs_entry_tail *const tail = hs_entry_tail_at(&list->entries, place);
    list->cells.n_empty -= cell->count == 0;
    cell->count++;
    tail->id = key.id;
    tail->tag = key.tag;
    tail->cell = number;
    hs_dynamic_write(list, place, placed);
    return place;
}

/* Takes an entry out of its cell: the last one takes its place. A cell that is left empty gives its
 * block back. */
HS_ALWAYS_INLINE void
hs_take_out(hs_dynamic *list, uint32_t place)
{
    const uint32_t number = hs_entry_tail_at(&list->entries, place)->cell;
    hs_cell *const cell = &list->cells.cell[number];
    const uint32_t last = cell->start + cell->count - 1;
    if (last != place) {
        const hs_entry_tail *tail = hs_entry_tail_at(&list->entries, last);
        hs_key_map_moved(&list->map, (hs_key){tail->id, tail->tag}, last, place);
        hs_entries_copy(&list->entries, last, &list->entries, place, 1);
    }
    cell->count--;
    list->cells.n_empty += cell->count == 0;
    if (cell->count == 0 && !list->keeps_blocks) {
        hs_entries_give(&list->entries, list->cells.size[number], cell->start);
        list->cells.size[number] = HS_NO_BLOCK;
    }
}

HS_ALWAYS_INLINE bool
hs_has_position(const hs_dynamic *list, uint32_t place)
{
    return !isnan(hs_entry_at(&list->entries, place)[0]);
}

/* The point of a key that is there, for which its new cell has room if that is another one. */
HS_ALWAYS_INLINE void
hs_put_again(hs_dynamic *list, hs_key key, uint32_t place, uint32_t number, const hs_placed *placed)
{
    list->n_without += (placed == NULL) - !hs_has_position(list, place);
    if (hs_entry_tail_at(&list->entries, place)->cell == number) {
        hs_dynamic_write(list, place, placed);
        return;
    }
    const uint32_t to = hs_append_entry(list, number, key, placed);
    hs_key_map_moved(&list->map, key, place, to);
    hs_take_out(list, place);
}

HS_ALWAYS_INLINE void
hs_put_new(hs_dynamic *list, hs_key key, uint32_t number, const hs_placed *placed)
{
    list->n_without += placed == NULL;
    hs_key_map_add(&list->map, key, hs_append_entry(list, number, key, placed));
}

#endif
