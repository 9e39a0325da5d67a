/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * key_map.h: from a key to the place of its entry. Open addressing with linear probing: a row holds
 * a place and 32 bits of the key's hash, which say where the row belongs; the key itself is in the
 * entry. Removal closes the gap, so that no row is ever wasted on keys that are gone.
 */
#ifndef HS_KEY_MAP_H
#define HS_KEY_MAP_H

#include "entries.h"

typedef struct hs_key_row {
    uint32_t place; /* HS_NO_PLACE: no key */
    uint32_t mark;
} hs_key_row;

typedef struct hs_key_map {
    hs_key_row *rows;     /* owned; capacity of them */
    int64_t     n;        /* keys */
    int64_t     capacity; /* 0, or a power of two; at most three quarters are in use */
} hs_key_map;

/* Bits of a key in which each depends on all of it: the finaliser of SplitMix64 (Steele, Lea and
 * Flood, OOPSLA 2014). */
HS_ALWAYS_INLINE uint32_t
hs_key_mark(hs_key key)
{
    uint64_t x = (uint64_t)key.id + (uint64_t)(uint32_t)key.tag * UINT64_C(0x9E3779B97F4A7C15);
    x = (x ^ (x >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    x = (x ^ (x >> 27)) * UINT64_C(0x94D049BB133111EB);
    return (uint32_t)(x >> 32);
}

void hs_key_map_free(hs_key_map *map);

/* Room for so many keys in all; false when memory is refused: then nothing has changed. */
bool hs_key_map_reserve(hs_key_map *map, int64_t n);

/* The place of a key's entry, or HS_NO_PLACE. */
uint32_t hs_key_map_find(const hs_key_map *map, const hs_entries *entries, hs_key key);

/* A key is about to be added. */
void hs_key_map_expect(const hs_key_map *map, hs_key key);

/* Adds a key that is not there; hs_key_map_reserve has made room. */
void hs_key_map_add(hs_key_map *map, hs_key key, uint32_t place);

/* The entry of a key was at `from`, and is at `to` now. */
void hs_key_map_moved(hs_key_map *map, hs_key key, uint32_t from, uint32_t to);

/* Removes the key whose entry is at `place`. */
void hs_key_map_remove(hs_key_map *map, hs_key key, uint32_t place);

#endif
