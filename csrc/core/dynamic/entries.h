/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * entries.h: where entries lie: in blocks of 1, 2, 4, ... of them, cut from one array that grows. A
 * block that is given back serves the next one of its size. An entry is known by its place, its
 * number in the array, which stays while the array grows.
 */
#ifndef HS_ENTRIES_H
#define HS_ENTRIES_H

#include "../../halfshell_dynamic.h"
#include "../base/base.h"

#define HS_NO_PLACE    UINT32_MAX
#define HS_ENTRY_SIZES 32 /* blocks of 2^0 ... 2^31 entries */

/* What follows the coordinates of an entry. */
typedef struct hs_entry_tail {
    int64_t  id;
    int32_t  tag;
    uint32_t cell;
} hs_entry_tail;

typedef struct hs_entries {
    int            ndim;
    size_t         stride; /* bytes of an entry: ndim doubles, then the tail */
    unsigned char *data;   /* owned */
    double        *given; /* owned: positions as given, ndim each; NULL: they are the coordinates */
    bool           keeps_given;
    uint32_t       n_used, capacity;      /* entries in blocks, past or present; that fit */
    uint32_t       spare[HS_ENTRY_SIZES]; /* first free block of each size, or HS_NO_PLACE */
} hs_entries;

void hs_entries_init(hs_entries *entries, int ndim, bool keeps_given);
void hs_entries_free(hs_entries *entries);

HS_ALWAYS_INLINE double *
hs_entry_at(const hs_entries *entries, uint32_t place)
{
    return (double *)(void *)(entries->data + (size_t)place * entries->stride);
}

HS_ALWAYS_INLINE hs_entry_tail *
hs_entry_tail_at(const hs_entries *entries, uint32_t place)
{
    return (hs_entry_tail *)(void *)(hs_entry_at(entries, place) + entries->ndim);
}

/* The position as it was given. */
HS_ALWAYS_INLINE double *
hs_entry_given(const hs_entries *entries, uint32_t place)
{
    return entries->keeps_given ? entries->given + (size_t)place * (size_t)entries->ndim
                                : hs_entry_at(entries, place);
}

/* The first place of a block of 2^size entries, or HS_NO_PLACE. */
uint32_t hs_entries_take(hs_entries *entries, int size);
void     hs_entries_give(hs_entries *entries, int size, uint32_t place);

/* Makes room for `more` entries in blocks to come: exactly so many where there were none. False
 * when memory is refused: then nothing has changed. */
bool hs_entries_reserve(hs_entries *entries, int64_t more);

/* Copies n entries to other places, also of other entries of the same kind. */
void hs_entries_copy(const hs_entries *source, uint32_t from, hs_entries *entries, uint32_t to,
                     uint32_t n);

int64_t hs_entries_bytes(const hs_entries *entries);

#endif
