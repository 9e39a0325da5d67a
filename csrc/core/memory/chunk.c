/* SPDX-License-Identifier: BSD-3-Clause */
/* chunk.c: small chunks come from malloc, large ones are pages. A small one that grows large is
 * copied from the first to the second. */
#include "chunk.h"

#include "pages.h"

#include <stdlib.h>
#include <string.h>

_Static_assert(sizeof(hs_chunk) <= HS_PAGES_HEADROOM, "the header lies in the headroom");
_Static_assert(sizeof(hs_chunk) <= HS_ALIGNMENT, "and in front of an aligned chunk");

/* malloc's memory: the header, up to one alignment of padding, the data. */
#define OVERHEAD (sizeof(hs_chunk) + HS_ALIGNMENT)

hs_chunk *
hs_chunk_of(void *data)
{
    return (hs_chunk *)data - 1;
}

/* What malloc gave is not shrunk by less than this part of it: lists are a little shorter than was
 * foreseen, and a chunk that was cut has no room for the next such list. */
#define WORTH_CUTTING 8

static uintptr_t
round_up(uintptr_t address, size_t multiple)
{
    return (address + multiple - 1) / multiple * multiple;
}

/* How far behind the start of what malloc returned the data lie. */
static size_t
lead_of(const void *raw)
{
    const uintptr_t address = (uintptr_t)raw;
    return (size_t)(round_up(address + sizeof(hs_chunk), HS_ALIGNMENT) - address);
}

/* A chunk of `bytes` bytes in what malloc returned: its data. No part of it can be given back, so
 * all of it counts as touched. */
static void *
place(void *raw, size_t bytes)
{
    const size_t lead = lead_of(raw);
    void        *data = (char *)raw + lead;
    *hs_chunk_of(data) = (hs_chunk){.raw = raw, .lead = lead, .capacity = bytes, .touched = bytes};
    return data;
}

static void *
new_in_pages(size_t bytes)
{
    void  *raw;
    size_t length;
    char  *data = hs_pages_reserve(bytes, &raw, &length);
    if (data != NULL) {
        const size_t capacity = length - (size_t)(data - (char *)raw);
        *hs_chunk_of(data) = (hs_chunk){.raw = raw, .length = length, .capacity = capacity};
    }
    return data;
}

void *
hs_chunk_new(size_t bytes)
{
    if (bytes > PTRDIFF_MAX / 2) {
        return NULL;
    }
    void *data = bytes >= HS_PAGES_FROM ? new_in_pages(bytes) : NULL;
    if (data != NULL) {
        return data;
    }
    void *raw = malloc(bytes + OVERHEAD);
    return raw != NULL ? place(raw, bytes) : NULL;
}

void
hs_chunk_free(void *data)
{
    const hs_chunk chunk = *hs_chunk_of(data);
    if (chunk.length > 0) {
        hs_pages_free(chunk.raw, chunk.length);
    } else {
        free(chunk.raw);
    }
}

static void *
grow_in_pages(void *data, size_t bytes)
{
    hs_chunk     chunk = *hs_chunk_of(data);
    const size_t huge = chunk.huge;
    char        *grown = hs_pages_grow(bytes, &chunk.raw, &chunk.length);
    if (grown == NULL) {
        hs_chunk_of(data)->huge = 0;
        hs_chunk_expect(data, huge);
        return NULL;
    }
    chunk.capacity = chunk.length - (size_t)(grown - (char *)chunk.raw);
    chunk.huge = 0;
    *hs_chunk_of(grown) = chunk;
    hs_chunk_expect(grown, huge);
    return grown;
}

/* A chunk from malloc with another size, the first `kept` bytes of it as they were. */
static void *
resize_in_malloc(void *data, size_t bytes, size_t kept)
{
    const size_t before = hs_chunk_of(data)->lead;
    char        *raw = realloc(hs_chunk_of(data)->raw, bytes + OVERHEAD);
    if (raw == NULL) {
        return NULL;
    }
    /* The data first: the header may come to lie where they are now. */
    if (lead_of(raw) != before) {
        memmove(raw + lead_of(raw), raw + before, kept);
    }
    return place(raw, bytes);
}

void *
hs_chunk_grow(void *data, size_t bytes, size_t used)
{
    const bool in_pages = hs_chunk_of(data)->length > 0;
    if (bytes > PTRDIFF_MAX / 2) {
        return NULL;
    }
    if (in_pages) {
        void *grown = grow_in_pages(data, bytes);
        if (grown != NULL) {
            return grown;
        }
    }
    if (in_pages || bytes >= HS_PAGES_FROM) {
        /* From malloc to pages; or Linux cannot move a mapping in one piece, as in a process forked
         * from the one that made it. */
        void *copy = new_in_pages(bytes);
        if (copy != NULL) {
            memcpy(copy, data, used);
            hs_chunk_touch(copy, used);
            hs_chunk_free(data);
            return copy;
        }
    }
    return in_pages ? NULL : resize_in_malloc(data, bytes, used);
}

void
hs_chunk_expect(void *data, size_t bytes)
{
    hs_chunk *chunk = hs_chunk_of(data);
    if (chunk->length == 0) {
        return;
    }
    if (bytes > chunk->capacity) {
        bytes = chunk->capacity;
    }
    char           *start = data;
    const uintptr_t first = round_up((uintptr_t)data, HS_PAGES_FROM);
    const uintptr_t end = ((uintptr_t)data + bytes) / HS_PAGES_FROM * HS_PAGES_FROM;
    const size_t    huge = end > first ? (size_t)(end - (uintptr_t)data) : 0;
    if (huge <= chunk->touched && chunk->huge <= chunk->touched) {
        return; /* all of that has its pages already */
    }
    if (huge > chunk->huge) {
        /* From the mapping on, so that Linux keeps two mappings and not three; what lies in front
         * of the first whole huge page stays small anyway. */
        hs_pages_advise(chunk->huge > 0 ? start + chunk->huge : chunk->raw, start + huge, true);
    } else if (huge < chunk->huge) {
        hs_pages_advise(huge > 0 ? start + huge : chunk->raw, start + chunk->huge, false);
    }
    chunk->huge = huge;
}

void
hs_chunk_touch(void *data, size_t used)
{
    hs_chunk *chunk = hs_chunk_of(data);
    size_t    touched = used;
    if (used > 0 && used < chunk->huge) { /* the last page is a huge one */
        touched = (size_t)(round_up((uintptr_t)data + used, HS_PAGES_FROM) - (uintptr_t)data);
    }
    if (touched > chunk->capacity) {
        touched = chunk->capacity;
    }
    if (touched > chunk->touched) {
        chunk->touched = touched;
    }
}

/* The part of a chunk from `from` on, a multiple of HS_PAGES_STEP from the mapping, becomes a
 * chunk of its own if what was touched of it deserves that. The rest of it is unmapped. */
static void *
split(void *data, char *from)
{
    hs_chunk *chunk = hs_chunk_of(data);
    char     *end = (char *)chunk->raw + chunk->length;
    char     *rest = (char *)round_up((uintptr_t)from + HS_PAGES_STEP, HS_PAGES_FROM);
    char     *raw = rest - HS_PAGES_STEP;
    if (rest >= end || (size_t)(rest - (char *)data) + HS_PAGES_FROM > chunk->touched ||
        !hs_pages_cut(from, raw)) {
        return NULL;
    }
    const size_t before = (size_t)(rest - (char *)data);
    *hs_chunk_of(rest) = (hs_chunk){
        .raw = raw,
        .length = (size_t)(end - raw),
        .capacity = (size_t)(end - rest),
        .touched = chunk->touched - before,
        .huge = chunk->huge > before ? chunk->huge - before : 0,
    };
    chunk->length = (size_t)(from - (char *)chunk->raw);
    return rest;
}

/* A cut through a huge page pins what is cut off until memory is short. That is left so where it
 * is little, against what is kept. */
static void
tear_at(char *data, char *from)
{
    const hs_chunk *chunk = hs_chunk_of(data);
    const size_t    kept = (size_t)(from - data);
    char           *end = (char *)round_up((uintptr_t)from, HS_PAGES_FROM);
    if (kept < chunk->huge && kept < chunk->touched && (size_t)(end - from) > kept / 8) {
        hs_pages_tear(from, end);
    }
}

static void
cut_in_pages(void *data, size_t bytes, void **rest)
{
    hs_chunk    *chunk = hs_chunk_of(data);
    const size_t head = (size_t)((char *)data - (char *)chunk->raw);
    char        *end = (char *)chunk->raw + chunk->length;
    char        *from = (char *)chunk->raw + round_up(head + bytes, HS_PAGES_STEP);
    if (from >= end) {
        return;
    }
    tear_at(data, from);
    if (rest != NULL) {
        *rest = split(data, from);
    }
    if ((rest == NULL || *rest == NULL) && hs_pages_cut(from, end)) {
        chunk->length = (size_t)(from - (char *)chunk->raw);
    }
    chunk->capacity = chunk->length - head;
    const size_t kept = (size_t)(from - (char *)data);
    chunk->touched = chunk->touched < kept ? chunk->touched : kept;
    chunk->huge = chunk->huge < chunk->capacity ? chunk->huge : chunk->capacity;
}

void *
hs_chunk_cut(void *data, size_t bytes, void **rest)
{
    hs_chunk *chunk = hs_chunk_of(data);
    if (rest != NULL) {
        *rest = NULL;
    }
    if (bytes >= chunk->capacity) {
        return data;
    }
    if (chunk->length > 0) {
        cut_in_pages(data, bytes, rest);
        return data;
    }
    if (chunk->capacity - bytes <= chunk->capacity / WORTH_CUTTING) {
        return data;
    }
    void *shrunk = resize_in_malloc(data, bytes, bytes);
    return shrunk != NULL ? shrunk : data;
}
