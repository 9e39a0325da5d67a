/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * convert.h: Python arguments to the core's views. Types and shapes are checked here, values in the
 * core. Every function returns false with an exception set when the argument is of the wrong kind.
 */
#ifndef HS_CONVERT_H
#define HS_CONVERT_H

#include "numpy_api.h"

#include "../halfshell.h"

/* A native float32 or float64 array of shape (n, d), 1 <= d <= 8. The view borrows from it. `name`
 * is that of the argument, for messages. */
bool hs_points_of(PyObject *object, const char *name, hs_points *points);

/* Whether it is a native, C-contiguous array of this type of NumPy with so many axes. */
bool hs_is_array(PyObject *object, int type, int n_axes);

/* The cells in an object of _core.cells_build, borrowed; NULL, without an exception, for others. */
hs_cells *hs_cells_of(PyObject *object);
#define HS_CELLS_NAME "halfshell.cells"

/* periodic: int, bit l set when box vector l repeats. */
bool hs_repeats_of(PyObject *periodic, unsigned long *repeats);

/* box: None, or a C-contiguous float64 array: rows (d, d), or edge lengths (d,). *given tells
 * whether there is a box at all. */
bool hs_box_of(PyObject *object, unsigned long repeats, int ndim, hs_box *box, bool *given);

/* A string of the known letters, which are some of HS_LETTERS, each at most once, and its HS_WANT_
 * bits. */
#define HS_LETTERS     "ijdDSPk"
#define HS_ALL_LETTERS "ijdDSP" /* those that every list of pairs has: k needs several cutoffs */
#define HS_ROW_LETTERS "jdDS"   /* a row says itself what i is */
bool hs_quantities_of(PyObject *object, const char *known, const char **letters, unsigned *want);

bool hs_precision_of(PyObject *object, hs_precision *precision);

/* One of these names, by number of the algorithm. */
extern const char *const hs_algorithm_names[HS_ALGORITHM_END];
bool                     hs_algorithm_of(PyObject *object, hs_algorithm *algorithm);

/* None or a string; the string borrows from the object. */
bool hs_name_of(PyObject *object, const char *argument, const char **name);

/* cutoff: anything that float() takes, except strings. */
bool hs_cutoff_of(PyObject *object, double *cutoff);

#endif
