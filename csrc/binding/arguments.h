/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * arguments.h: what the functions of the table share. Each takes its arguments as views, lets
 * others run Python meanwhile, calls the core, and makes arrays or an exception of the outcome.
 *
 * Types and shapes are checked here, values in the core. Numbers of Python may run code of their
 * own, which may give an array another shape or other memory: so all numbers are read first, and
 * views of arrays are taken last, here and nowhere else.
 */
#ifndef HS_ARGUMENTS_H
#define HS_ARGUMENTS_H

#include "interface.h"

#include "../halfshell.h"

#include <stdbool.h>

enum { HS_MOST_MADE = 12 };

/* The arguments of a search, as views; the Python arguments that they borrow from must stay
 * alive. It borrows from itself: it cannot be moved. */
typedef struct hs_py_call {
    const hs_function *function;
    PyObject          *module; /* borrowed */
    PyObject *const   *of;     /* borrowed: what was given, in the order of the core ... */
    PyObject *const   *own;    /* ... beyond the arguments of every search */
    bool               is_of_users;
    hs_among           among;
    hs_set             points, queries;   /* those of cells have no data */
    PyObject          *positions, *asked; /* borrowed: their arrays, or cells */
    hs_box             box;
    unsigned long      repeats; /* bits */
    hs_reach           reach;
    hs_selection       selection;
    hs_each_system     each;
    hs_options         options;
    hs_failure         failure;
    const char        *letters; /* borrowed: the quantities */
    PyObject          *out;     /* borrowed: of the caller, or NULL: new arrays */
    hs_pair_arrays     arrays;  /* those of out */
    bool               flag;
    int64_t            integer;
    double             real;
    PyObject          *progress;           /* borrowed; called with the fraction done, or NULL */
    PyThreadState     *thread;             /* saved while the GIL is released, else NULL */
    PyObject          *made[HS_MOST_MADE]; /* owned: what views are of that was not given */
    int                n_made;
} hs_py_call;

/* A call of which no argument is taken yet. */
void hs_py_call_begin(hs_py_call *call, PyObject *module, bool is_of_users);

/* Takes the arguments of its function, see interface.h. False with an exception set, or without one
 * where only Python can tell what to do with an argument, or what is wrong with it. In either case
 * hs_py_call_end() must follow. */
bool hs_py_call_take(hs_py_call *call, Py_ssize_t n_arguments);

/* Takes points, box and axes that repeat, and nothing else, in the same way. */
bool hs_py_call_scene(hs_py_call *call, PyObject *points, PyObject *box, PyObject *periodic);

/* Release and take the GIL around a call of the core; poll() takes it in between. With few points
 * it stays taken until the first poll: handing it over costs a tenth of a small search. */
void hs_py_call_release(hs_py_call *call);
void hs_py_call_acquire(hs_py_call *call);

/* Takes the GIL, if it is free. False with an exception set for a status other than HS_OK. */
bool hs_py_call_done(hs_py_call *call, hs_status status);

/* Gives back what the arguments took. */
void hs_py_call_end(hs_py_call *call);

/* Whether a function got what it takes; if not, and no exception is set, sets one that says that it
 * takes other arguments. Only the Python layer calls, which gives right ones. */
bool hs_expect(const char *name, bool are_right);

/* Below, false or NULL comes without an exception unless something else is said: functions of the
 * table need not set one, see hs_py_call_take. */

/* Whether it is a native, C-contiguous array of this type of NumPy with so many axes. */
bool hs_is_array(PyObject *object, int type, int n_axes);

/* The entries of such an array, of which axis 0 has this length (-1: any) and the others `width`,
 * or NULL for None. */
bool hs_entries_of(PyObject *object, int type, int n_axes, int64_t length, int64_t width,
                   const void **entries);

/* The length of axis 0 of an array, 0 for None. */
int64_t hs_length_of(PyObject *object);

/* n numbers of a list, tuple or array of so many, whose conversion runs no code of others and loses
 * nothing; false, with an exception if memory was refused, for all else. */
bool hs_numbers_of(PyObject *object, npy_intp n, double *values);

/* A float or a small integer of Python or NumPy. */
bool hs_number_of(PyObject *object, double *value);

/* A native float32 or float64 array of shape (n, d), 1 <= d <= 8. The view borrows from it. */
bool hs_points_of(PyObject *object, hs_points *points);

/* The cells in an object of _core.cells_build, borrowed; NULL for others. */
hs_cells *hs_cells_of(PyObject *object);
#define HS_CELLS_NAME "halfshell.cells"

/* periodic: int, bit l set when box vector l repeats; false with an exception set. */
bool hs_repeats_of(PyObject *periodic, unsigned long *repeats);

/* A C-contiguous float64 array: rows (d, d), or edge lengths (d,). */
bool hs_box_of(PyObject *object, unsigned long repeats, int ndim, hs_box *box);

/* By number of the algorithm. */
extern const char *const hs_algorithm_names[HS_ALGORITHM_END];

#endif
