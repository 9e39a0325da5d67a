/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The table of the interface: what each function that searches takes. By it arguments.h reads the
 * arguments of a call, and functions.c makes the functions.
 *
 * The Python layer gives a set of points, and queries, as an array or as a tuple (positions, radii,
 * supports, types, weights, groups, labels, where systems begin), of which all but the first may be
 * None; cells may stand in place of positions, with None as box and 0 as periodic. Users give what
 * the public functions take, as far as C converts it.
 */
#ifndef HS_INTERFACE_H
#define HS_INTERFACE_H

#include "numpy_api.h"

#include <stdbool.h>

/* What an argument becomes, see arguments.h. */
typedef enum hs_kind {
    HS_ARG_END, /* of a list */
    /* Of every search, in this order. */
    HS_ARG_POINTS,   /* a set */
    HS_ARG_CUTOFF,   /* a float; or float64 (s,), one for each system */
    HS_ARG_BOX,      /* float64 (d,) or (d, d), or (s, d, d); or None */
    HS_ARG_PERIODIC, /* bits; or uint8 (s,) */
    HS_ARG_INCLUSIVE,
    HS_ARG_PRECISION,
    HS_ARG_KERNEL,
    HS_ARG_MEMORY_LIMIT, /* None: what the machine has */
    HS_ARG_PROGRESS,     /* None: no calls */
    HS_ARG_THREADS,      /* None: as many as pay */
    /* Of some. */
    HS_ARG_QUANTITIES, /* some of its letters, each at most once */
    HS_ARG_SORT,
    HS_ARG_INDEX,        /* bytes of an index */
    HS_ARG_OUT,          /* arrays, or None */
    HS_ARG_OTHER_POINTS, /* queries, which there must be */
    HS_ARG_FLAG,         /* `flag`, `integer` and `real` of the call */
    HS_ARG_INTEGER,
    HS_ARG_REAL,
    HS_ARG_OWN, /* left to the function, which runs no Python code for it */
    /* Of some: None, or what may be left out with all that follow. */
    HS_ARG_QUERIES,   /* a set */
    HS_ARG_PAIRING,   /* a tuple: number of a rule, or None for the cutoff alone; how many times
                       supports or radii count, a float, or None; a square float64 table of cutoffs
                       by types, or None; by how much labels of an excluded pair differ at most, an
                       int, or None; excluded pairs, int64 (k, 2), or None; numbers of queries that
                       are points, int64 (q,), or None; and the least distance, a float */
    HS_ARG_ALGORITHM, /* a name */
    HS_ARG_SHELLS     /* several cutoffs, with the letter k */
} hs_kind;

#define HS_KINDS (HS_ARG_SHELLS + 1)

#define HS_ARG_FIRST_OPTIONAL HS_ARG_QUERIES

typedef struct hs_argument {
    const char *name; /* NULL at the end of a list */
    hs_kind     kind;
    const char *letters; /* of quantities, some of HS_LETTERS */
} hs_argument;

/* Of every search; beyond them, with the end. */
enum { HS_CALL_ARGUMENTS = 10, HS_MOST_OWN = 12 };

/* All letters; k where there are shells. */
#define HS_LETTERS "ijdDSPk"

/* What a function does with its arguments; a new reference, or NULL with an exception set. */
struct hs_py_call;
typedef PyObject *hs_py_search(struct hs_py_call *call);

typedef struct hs_function {
    const char        *name;
    hs_py_search      *body;
    const hs_argument *own[HS_MOST_OWN]; /* beyond HS_EVERY_SEARCH, until NULL */
    /* Whether the cutoff is the largest distance of what is near, max_distance to users, decided
     * exactly in any case. */
    bool is_by_rank;
} hs_function;

extern const hs_argument HS_EVERY_SEARCH[HS_CALL_ARGUMENTS];

/* The argument at this place in the order of the core; NULL behind the last. */
static inline const hs_argument *
hs_argument_at(const hs_function *function, int place)
{
    return place < HS_CALL_ARGUMENTS ? &HS_EVERY_SEARCH[place]
                                     : function->own[place - HS_CALL_ARGUMENTS];
}

extern const hs_function hs_functions[]; /* until one without a name */

#endif
