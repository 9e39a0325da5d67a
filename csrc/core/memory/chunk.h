/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * chunk.h: one chunk of memory that can grow, shrink and be told how far it will be filled. Large
 * ones are reservations of pages (pages.h) where there are such, the others come from malloc. Only
 * region.c, pool.c and account.c use chunks directly.
 *
 * A chunk is known by its data pointer: 64-byte aligned, with this header right in front of it.
 */
#ifndef HS_CHUNK_H
#define HS_CHUNK_H

#include "../base/base.h"

typedef struct hs_chunk {
    void  *raw;      /* the mapping, or what malloc returned */
    size_t length;   /* of the mapping; 0 for malloc */
    size_t lead;     /* bytes before the data, for malloc */
    size_t capacity; /* bytes of data that may be written */
    size_t touched;  /* bytes of data that are taken to be resident */
    size_t huge;     /* bytes of data advised for huge pages; small ones follow */
    bool   is_arena; /* of a call that has ended (account.h): no result takes it */
} hs_chunk;

/* The header of a chunk. */
hs_chunk *hs_chunk_of(void *data);

/* Room for `bytes` bytes, not zeroed, unadvised. NULL when refused. */
void *hs_chunk_new(size_t bytes);
void  hs_chunk_free(void *data);

/* Room for `bytes` bytes, more than before, the first `used` of them kept. May move; NULL when
 * refused: the chunk stays as it was. */
void *hs_chunk_grow(void *data, size_t bytes, size_t used);

/* About `bytes` bytes will be written: huge pages for the whole ones of them, small ones beyond. */
void hs_chunk_expect(void *data, size_t bytes);

/* The first `used` bytes have been written. */
void hs_chunk_touch(void *data, size_t used);

/*
 * Gives back what lies beyond `bytes`, if that is much; may move. *rest, if not NULL: what was
 * touched beyond, if that is large enough for a chunk of its own, else NULL.
 */
void *hs_chunk_cut(void *data, size_t bytes, void **rest);

#endif
