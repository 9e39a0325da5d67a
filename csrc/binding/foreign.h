/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * foreign.h: numbers from objects of any kind, and messages about them. Conversion and repr may run
 * code that is not ours: it may raise anything, or change the arrays of the same call.
 *
 * `must` is how a message begins that refuses the object: "threads must be a whole number". Every
 * function that fails has set a TypeError, ValueError, OverflowError or MemoryError, with what the
 * object raised as its cause; or an exception that is not the object's to raise, such as Ctrl-C.
 */
#ifndef HS_FOREIGN_H
#define HS_FOREIGN_H

#include "numpy_api.h"

#include <stdbool.h>

/* Raises `type`: "<must>, got <repr>", the repr on one line and cut short, or the type
 * where there is none. */
void hs_refuse(PyObject *type, const char *must, PyObject *object);

/* An integer, or what has __index__; no bool. Infinite where float64 does not hold it. */
bool hs_whole_of(PyObject *object, const char *must, double *value);

/* A float, also one of NumPy's, or an integer as above; OverflowError where float64 does not hold
 * it. */
bool hs_real_of(PyObject *object, const char *must, double *value);

#endif
