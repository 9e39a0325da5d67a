/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * put_column.h: a large column of point numbers that is written from its first entry to its last,
 * past the caches: it does not fit them, and what a store misses there would first be read.
 *
 * Usage: hs_put_open(column, index_bytes, &out); hs_put_numbers or hs_put_repeat any
 * number of times; hs_put_close(&out), before which part of it is not there.
 */
#ifndef HS_PUT_COLUMN_H
#define HS_PUT_COLUMN_H

#include "../memory/account.h"

#define HS_PUT_BYTES 4096 /* collected before they are written: well inside the first-level cache */

/* Numbers of 4 or 8 bytes on their way to memory. */
typedef struct hs_put_column {
    char  *to; /* where the collected bytes will go */
    size_t n;  /* of them */
    int    index_bytes;
    union {
        char    bytes[HS_PUT_BYTES + HS_ALIGNMENT];
        int32_t narrow[(HS_PUT_BYTES + HS_ALIGNMENT) / sizeof(int32_t)];
        int64_t wide[(HS_PUT_BYTES + HS_ALIGNMENT) / sizeof(int64_t)];
    } part;
} hs_put_column;

/* column: aligned to HS_ALIGNMENT; borrowed. */
void hs_put_open(void *column, int index_bytes, hs_put_column *out);

/* These n numbers, none of which is negative. */
void hs_put_numbers(hs_put_column *out, const int32_t *numbers, int64_t n);

/* n times this number. */
void hs_put_repeat(hs_put_column *out, int32_t number, int64_t n);

void hs_put_close(hs_put_column *out);

#endif
