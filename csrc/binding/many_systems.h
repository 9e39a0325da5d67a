/* SPDX-License-Identifier: BSD-3-Clause */
/* many_systems.h: many systems, as Python gives them: a number for each point, and what each system
 * has of its own. */
#ifndef HS_MANY_SYSTEMS_H
#define HS_MANY_SYSTEMS_H

#include "py_call.h"

/*
 * The systems as the core takes them. Where all share box and cutoff, those without points are left
 * out: numbers may be as far apart as users like. Otherwise each has its place.
 */
typedef struct hs_batch {
    bool       is_given; /* else there is one system, and nothing below is set */
    hs_systems systems;
    int64_t   *first;       /* owned */
    int64_t   *first_query; /* owned; NULL where there are no queries */
    int64_t   *number;      /* owned: of each system; NULL where that is its place */
    int64_t    capacity;    /* of these */
    int64_t    n_numbers;   /* systems, those without points counted */
} hs_batch;

enum { HS_BATCH_PARTS = 5 };

/*
 * The batch of a call, if it has one: five objects, batch, int64 (n,); cutoffs, None or float64
 * (s,); boxes, None or float64 (s, d, d), for which the call's box has the axes that repeat; the
 * batch of queries, int64 (q,), or None where there are none; bits of the axes that repeat in each
 * system, uint8 (s,), or None where they are those of the call. False with an exception set, and
 * nothing to free.
 */
bool hs_batch_take(PyObject *const *given, const hs_py_call *call, hs_batch *batch);

/* The same for functions that have a batch as one of their arguments, letter m. */
bool hs_batch_take_optional(const hs_py_call *call, hs_batch *batch);

/* Idempotent. */
void hs_batch_free(hs_batch *batch);

/* Systems are named where each has something of its own. */
void hs_batch_forget_system(const hs_batch *batch, hs_failure *failure);

/* Zeros of shape (numbers, ...), for as many more axes; NULL with an exception set. */
PyObject *hs_batch_zeros(const hs_batch *batch, int n_axes, const npy_intp *shape, int type);

#endif
