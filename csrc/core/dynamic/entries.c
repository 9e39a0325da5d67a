/* SPDX-License-Identifier: BSD-3-Clause */
/* entries.c: blocks by size. Those that are free form a list: the first bytes of each say where the
 * next one is. */
#include "entries.h"

#include "../memory/account.h"

#define FIRST_CAPACITY 16
#define MOST_ENTRIES   INT64_C(0xFFFFFFF0) /* places are below HS_NO_PLACE */

void
hs_entries_init(hs_entries *entries, int ndim, bool keeps_given)
{
    memset(entries, 0, sizeof *entries);
    entries->ndim = ndim;
    entries->stride = (size_t)ndim * sizeof(double) + sizeof(hs_entry_tail);
    entries->keeps_given = keeps_given;
    for (int size = 0; size < HS_ENTRY_SIZES; size++) {
        entries->spare[size] = HS_NO_PLACE;
    }
}

void
hs_entries_free(hs_entries *entries)
{
    hs_free(NULL, entries->data);
    hs_free(NULL, entries->given);
    hs_entries_init(entries, entries->ndim, entries->keeps_given);
}

/* Half as many again as there were, at least. */
bool
hs_entries_reserve(hs_entries *entries, int64_t more)
{
    const int64_t needed = entries->n_used + more;
    int64_t       capacity = entries->capacity;
    if (needed <= capacity) {
        return true;
    }
    capacity += capacity / 2;
    capacity = capacity < needed ? needed : capacity;
    capacity = capacity < FIRST_CAPACITY ? FIRST_CAPACITY : capacity;
    capacity = capacity > MOST_ENTRIES ? MOST_ENTRIES : capacity;
    if (needed > capacity) {
        return false;
    }
    if (entries->keeps_given) {
        double *given = hs_grow(NULL, HS_FOR_ORIGINALS, entries->given,
                                (int64_t)entries->n_used * entries->ndim, capacity * entries->ndim,
                                sizeof(double));
        if (given == NULL) {
            return false;
        }
        entries->given = given; /* larger than it must be if the next is refused */
    }
    unsigned char *data =
        hs_grow(NULL, HS_FOR_POINTS, entries->data, entries->n_used, capacity, entries->stride);
    if (data == NULL) {
        return false;
    }
    entries->data = data;
    entries->capacity = (uint32_t)capacity;
    return true;
}

uint32_t
hs_entries_take(hs_entries *entries, int size)
{
    uint32_t place = entries->spare[size];
    if (place != HS_NO_PLACE) {
        memcpy(&entries->spare[size], hs_entry_at(entries, place), sizeof place);
        return place;
    }
    if (!hs_entries_reserve(entries, INT64_C(1) << size)) {
        return HS_NO_PLACE;
    }
    place = entries->n_used;
    entries->n_used += (uint32_t)1 << size;
    return place;
}

void
hs_entries_give(hs_entries *entries, int size, uint32_t place)
{
    memcpy(hs_entry_at(entries, place), &entries->spare[size], sizeof place);
    entries->spare[size] = place;
}

void
hs_entries_copy(const hs_entries *source, uint32_t from, hs_entries *entries, uint32_t to,
                uint32_t n)
{
    memcpy(hs_entry_at(entries, to), hs_entry_at(source, from), n * entries->stride);
    if (entries->keeps_given) {
        memcpy(hs_entry_given(entries, to), hs_entry_given(source, from),
               (size_t)n * (size_t)entries->ndim * sizeof(double));
    }
}

int64_t
hs_entries_bytes(const hs_entries *entries)
{
    const size_t given = entries->keeps_given ? (size_t)entries->ndim * sizeof(double) : 0;
    return (int64_t)entries->capacity * (int64_t)(entries->stride + given);
}
