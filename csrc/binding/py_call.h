/* SPDX-License-Identifier: BSD-3-Clause */
/* py_call.h: what the searching functions share: one set of arguments, and polling for Ctrl-C. */
#ifndef HS_PY_CALL_H
#define HS_PY_CALL_H

#include "numpy_api.h"

#include "../halfshell.h"

/* The arguments of a search, as views; the Python arguments that they borrow from must stay
 * alive. */
typedef struct hs_py_call {
    hs_points       points;
    const hs_cells *cells;   /* borrowed: points and box are theirs; or NULL */
    hs_points       queries; /* when has_queries */
    bool            has_queries;
    hs_box          box;
    bool            has_box;
    hs_options      options;
    PyObject       *progress; /* borrowed; called with the fraction done, or NULL */
    PyThreadState  *thread;   /* saved while the GIL is released, else NULL */
} hs_py_call;

/* Whether a function got as many arguments as it takes; false with an exception set. */
bool hs_expect_arguments(const char *name, Py_ssize_t n_arguments, int expected);

/*
 * Positional arguments of every search, in this order: points (or cells of cells_build, with None
 * as box and 0 as periodic), cutoff, box, periodic, inclusive,
 * precision, kernel, memory_limit (None: ask the machine), progress (None: no calls), threads
 * (None: as many as pay). Returns false with an exception set.
 */
enum { HS_CALL_ARGUMENTS = 10 };
bool hs_py_call_init(hs_py_call *call, PyObject *const *arguments);

/* The same for two sets. queries: None, or an array as points, with as many columns. */
bool hs_py_call_init_sets(hs_py_call *call, PyObject *const *arguments, PyObject *queries);

/* Release and take the GIL around a call of the core; poll() takes it in between. With few points
 * it stays taken until the first poll: handing it over costs a tenth of a small search. */
void hs_py_call_release(hs_py_call *call);
void hs_py_call_acquire(hs_py_call *call);

/* Among what to search: the cells or the points of the call, which it borrows from. */
hs_among hs_py_call_among(const hs_py_call *call);

/* The box, or NULL for open space. */
static inline const hs_box *
hs_py_call_box(const hs_py_call *call)
{
    return call->has_box ? &call->box : NULL;
}

/* The queries, or NULL where there is one set. */
static inline const hs_points *
hs_py_call_queries(const hs_py_call *call)
{
    return call->has_queries ? &call->queries : NULL;
}

#endif
