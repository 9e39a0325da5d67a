/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * py_call.h: what the searching functions share. Each takes its arguments, lets others run Python
 * meanwhile, calls the core, and makes arrays or an exception of the outcome.
 *
 * Numbers of Python may run code of their own, which may give an array another shape or other
 * memory: so all numbers are read first, and views of arrays are taken last, here and nowhere else.
 */
#ifndef HS_PY_CALL_H
#define HS_PY_CALL_H

#include "numpy_api.h"

#include "../halfshell.h"

/* The arguments of a search, as views; the Python arguments that they borrow from must stay
 * alive. It borrows from itself: it cannot be moved. */
typedef struct hs_py_call {
    hs_among       among; /* what is searched; `points` is NULL where there are cells */
    hs_points      points, queries;
    hs_box         box;
    hs_reach       reach;
    hs_selection   selection;
    hs_options     options;
    hs_failure     failure;
    const char    *letters;  /* borrowed: the quantities */
    PyObject      *out;      /* borrowed: of the caller, or NULL: new arrays */
    hs_pair_arrays arrays;   /* those of out */
    PyObject      *room;     /* owned: new arrays of a fixed length that `out` is then, or NULL */
    int64_t        capacity; /* that length, or 0; negative: the number needed is returned too */
    bool           flag;
    int64_t        integer;
    double         real;
    PyObject      *batch;    /* borrowed: what letter m is, for many_systems.h; or NULL */
    PyObject      *progress; /* borrowed; called with the fraction done, or NULL */
    PyThreadState *thread;   /* saved while the GIL is released, else NULL */
} hs_py_call;

/* Whether a function got as many arguments as it takes; false with an exception set. */
bool hs_expect_arguments(const char *name, Py_ssize_t n_arguments, int expected);

/*
 * Positional arguments of every search, in this order: points (or cells of cells_build, with None
 * as box and 0 as periodic), cutoff, box, periodic (bits), inclusive,
 * precision, kernel, memory_limit (None: ask the machine), progress (None: no calls), threads
 * (None: as many as pay). Then what this function takes beyond them, a letter each:
 *
 *   q  quantities: some of HS_ALL_LETTERS    s  sort
 *   k  quantities: some of HS_LETTERS, with e: several cutoffs, or None: may be left out
 *   r  quantities: some of HS_ROW_LETTERS    b  index_bytes
 *   Q  queries, or None                      o  out, or None
 *   R  queries                               f, i, x  `flag`, `integer`, `real` of the call
 *   a  anything: left to the function, which runs no Python code for it
 *   h  reach (reach.h), or None; or a tuple of that and a selection (selection.h): may be left out
 *   g  name of an algorithm, which may be left out
 *   c  capacity: an int, negative where the number of pairs is returned too, and pairs that do not
 *      fit are no error; or None. Comes last, and may be left out
 *   m  many systems: a tuple for many_systems.h, or None: comes behind these, and may be left out
 *
 * Returns false with an exception set, or without one where HS_PLAIN is set: see plain.h.
 */
enum { HS_CALL_ARGUMENTS = 10 };
bool hs_py_call_take(hs_py_call *call, const char *name, const char *more,
                     PyObject *const *arguments, Py_ssize_t n_arguments);

/* Whether `out` lies apart from an input: else false with an exception set. Points, box and queries
 * have been looked at. */
bool hs_py_call_is_apart(const hs_py_call *call, PyObject *input, const char *name);

/* After that, where there is a capacity: arrays of that length, for hs_py_call_pairs to return. It
 * must be called then. False with an exception set, and nothing to release. */
bool hs_py_call_make_room(hs_py_call *call);

/* Release and take the GIL around a call of the core; poll() takes it in between. With few points
 * it stays taken until the first poll: handing it over costs a tenth of a small search. */
void hs_py_call_release(hs_py_call *call);
void hs_py_call_acquire(hs_py_call *call);

/* What a function returns, the GIL taken: arrays of the pairs, which are freed, or those of `out`,
 * or with a capacity all of its room, padded; NULL with an exception set for a status other than
 * HS_OK. */
PyObject *hs_py_call_pairs(hs_py_call *call, hs_status status, hs_pairs *pairs);

/* The same, as a table of rows. */
PyObject *hs_py_call_table(hs_py_call *call, hs_status status, hs_pairs *rows);

#endif
