/* SPDX-License-Identifier: BSD-3-Clause */
/* want.c: a table with one entry for each quantity. */
#include "want.h"

/* Bytes of one pair: a fixed number of entries, or one for each axis. */
typedef struct quantity {
    hs_purpose purpose;
    size_t     entry_bytes; /* 0: index_bytes */
    int        n_entries;   /* 0: one for each axis */
} quantity;

static const quantity quantities[HS_QUANTITIES] = {
    {HS_FOR_INDICES, 0, 1},                /* HS_WANT_I */
    {HS_FOR_INDICES, 0, 1},                /* HS_WANT_J */
    {HS_FOR_DISTANCES, sizeof(double), 1}, /* HS_WANT_DISTANCE */
    {HS_FOR_VECTORS, sizeof(double), 0},   /* HS_WANT_VECTOR */
    {HS_FOR_SHIFTS, sizeof(int32_t), 0},   /* HS_WANT_SHIFT */
    {HS_FOR_INDICES, 0, 2},                /* HS_WANT_BOTH */
    {HS_FOR_INDICES, sizeof(int32_t), 1},  /* HS_WANT_SHELL */
};

static size_t
width_of(int k, int ndim, int index_bytes)
{
    const quantity *of = &quantities[k];
    return (of->entry_bytes != 0 ? of->entry_bytes : (size_t)index_bytes) *
           (size_t)(of->n_entries != 0 ? of->n_entries : ndim);
}

int
hs_want_number(unsigned bit)
{
    int k = 0;
    while (k < HS_QUANTITIES && bit != 1u << k) {
        k++;
    }
    return k;
}

size_t
hs_want_width(unsigned bit, int ndim, int index_bytes)
{
    return width_of(hs_want_number(bit), ndim, index_bytes);
}

int64_t
hs_want_bytes(unsigned want, int ndim, int index_bytes)
{
    size_t bytes = 0;
    for (int k = 0; k < HS_QUANTITIES; k++) {
        bytes += want >> k & 1u ? width_of(k, ndim, index_bytes) : 0;
    }
    return (int64_t)bytes;
}

hs_purpose
hs_want_purpose(int k)
{
    return quantities[k].purpose;
}
