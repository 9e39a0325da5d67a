/* SPDX-License-Identifier: BSD-3-Clause */
/* output_checks.h: arrays of a caller for options.out, with marks behind their ends. */
#ifndef HS_OUTPUT_CHECKS_H
#define HS_OUTPUT_CHECKS_H

#include "harness.h"
#include "pair_checks.h"

enum { MARKED = 1024, N_QUANTITIES = 6 }; /* bytes behind each array that must stay as they are */

/* In the order of their HS_WANT_ bits. */
typedef struct caller_arrays {
    hs_pair_arrays arrays;              /* what goes into options.out */
    char          *start[N_QUANTITIES]; /* owned */
    size_t         width[N_QUANTITIES]; /* bytes of a pair; 0 where not wanted */
    int64_t        room;                /* pairs that there really is room for */
} caller_arrays;

static inline void
set_width(unsigned want, int ndim, int index_bytes, size_t *width)
{
    const size_t index = (size_t)index_bytes, d = (size_t)ndim;
    const size_t all[N_QUANTITIES] = {index, index, 8, 8 * d, 4 * d, 2 * index};
    for (int k = 0; k < N_QUANTITIES; k++) {
        width[k] = want >> k & 1u ? all[k] : 0;
    }
}

/* Arrays of `room` pairs, all marked. */
static inline void
make_arrays(unsigned want, int ndim, int index_bytes, int64_t room, caller_arrays *c)
{
    memset(c, 0, sizeof *c);
    set_width(want, ndim, index_bytes, c->width);
    c->room = room;
    for (int k = 0; k < N_QUANTITIES; k++) {
        if (c->width[k] > 0) {
            c->start[k] = array_of((int64_t)((size_t)room * c->width[k]) + MARKED, 1);
            memset(c->start[k], 0xa5, (size_t)room * c->width[k] + MARKED);
        }
    }
    c->arrays = (hs_pair_arrays){.capacity = room,
                                 .index_bytes = index_bytes,
                                 .i = c->start[0],
                                 .j = c->start[1],
                                 .distance = (double *)(void *)c->start[2],
                                 .vector = (double *)(void *)c->start[3],
                                 .shift = (int32_t *)(void *)c->start[4],
                                 .both = c->start[5]};
}

static inline void
free_arrays(caller_arrays *c)
{
    for (int k = 0; k < N_QUANTITIES; k++) {
        free(c->start[k]);
    }
    memset(c, 0, sizeof *c);
}

/* Nothing was written from pair number n on. */
static inline bool
untouched_from(const caller_arrays *c, int64_t n)
{
    bool untouched = true;
    for (int k = 0; k < N_QUANTITIES; k++) {
        const size_t end = (size_t)c->room * c->width[k] + MARKED;
        for (size_t b = (size_t)n * c->width[k]; c->width[k] > 0 && b < end; b++) {
            untouched = untouched && (unsigned char)c->start[k][b] == 0xa5;
        }
    }
    return untouched;
}

/* The first n pairs are those of a result with arrays of its own. */
static inline bool
same_as_result(const caller_arrays *c, const hs_pairs *pairs, int64_t n)
{
    bool same = true;
    for (int k = 0; k < N_QUANTITIES; k++) {
        const void *own = hs_pairs_array(pairs, 1u << k);
        same = same && (c->width[k] == 0 || memcmp(c->start[k], own, (size_t)n * c->width[k]) == 0);
    }
    return same;
}

#endif
