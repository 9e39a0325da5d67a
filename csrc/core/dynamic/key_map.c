/* SPDX-License-Identifier: BSD-3-Clause */
/* key_map.c: rows stand as near behind the one that their mark names as others allow. */
#include "key_map.h"

#include "../memory/account.h"

#define LEAST_ROWS 16

HS_ALWAYS_INLINE bool
holds(const hs_entries *entries, uint32_t place, hs_key key)
{
    const hs_entry_tail *tail = hs_entry_tail_at(entries, place);
    return tail->id == key.id && tail->tag == key.tag;
}

void
hs_key_map_free(hs_key_map *map)
{
    hs_free(NULL, map->rows);
    *map = (hs_key_map){0};
}

static void
put(hs_key_row *rows, int64_t capacity, hs_key_row row)
{
    int64_t r = row.mark & (uint64_t)(capacity - 1);
    while (rows[r].place != HS_NO_PLACE) {
        r = (r + 1) & (capacity - 1);
    }
    rows[r] = row;
}

bool
hs_key_map_reserve(hs_key_map *map, int64_t n)
{
    int64_t capacity = map->capacity > 0 ? map->capacity : LEAST_ROWS;
    while (n > capacity / 4 * 3) {
        capacity *= 2;
    }
    if (capacity == map->capacity) {
        return true;
    }
    hs_key_row *rows = hs_alloc(NULL, HS_FOR_ORDER, capacity, sizeof *rows);
    if (rows == NULL) {
        return false;
    }
    memset(rows, 0xFF, (size_t)capacity * sizeof *rows);
    for (int64_t r = 0; r < map->capacity; r++) {
        if (map->rows[r].place != HS_NO_PLACE) {
            put(rows, capacity, map->rows[r]);
        }
    }
    hs_free(NULL, map->rows);
    map->rows = rows;
    map->capacity = capacity;
    return true;
}

uint32_t
hs_key_map_find(const hs_key_map *map, const hs_entries *entries, hs_key key)
{
    const uint32_t mark = hs_key_mark(key);
    if (map->n == 0) {
        return HS_NO_PLACE;
    }
    for (int64_t r = mark & (uint64_t)(map->capacity - 1);; r = (r + 1) & (map->capacity - 1)) {
        const hs_key_row row = map->rows[r];
        if (row.place == HS_NO_PLACE || (row.mark == mark && holds(entries, row.place, key))) {
            return row.place;
        }
    }
}

void
hs_key_map_expect(const hs_key_map *map, hs_key key)
{
    HS_PREFETCH_WRITE(&map->rows[hs_key_mark(key) & (uint64_t)(map->capacity - 1)]);
}

void
hs_key_map_add(hs_key_map *map, hs_key key, uint32_t place)
{
    put(map->rows, map->capacity, (hs_key_row){place, hs_key_mark(key)});
    map->n++;
}

/* The row of a key that is there, known by its place. */
static int64_t
row_of(const hs_key_map *map, hs_key key, uint32_t place)
{
    int64_t r = hs_key_mark(key) & (uint64_t)(map->capacity - 1);
    while (map->rows[r].place != place) {
        r = (r + 1) & (map->capacity - 1);
    }
    return r;
}

void
hs_key_map_moved(hs_key_map *map, hs_key key, uint32_t from, uint32_t to)
{
    map->rows[row_of(map, key, from)].place = to;
}

void
hs_key_map_remove(hs_key_map *map, hs_key key, uint32_t place)
{
    const int64_t last = map->capacity - 1;
    int64_t       gap = row_of(map, key, place);
    for (int64_t r = (gap + 1) & last; map->rows[r].place != HS_NO_PLACE; r = (r + 1) & last) {
        const int64_t home = map->rows[r].mark & (uint64_t)last;
        if (((r - home) & last) >= ((r - gap) & last)) { /* it may stand in the gap */
            map->rows[gap] = map->rows[r];
            gap = r;
        }
    }
    map->rows[gap].place = HS_NO_PLACE;
    map->n--;
}
