/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * py_dynamic.h: the object around a hs_dynamic. Keys and positions are taken apart here, without a
 * detour over arrays where they are plain numbers.
 */
#ifndef HS_PY_DYNAMIC_H
#define HS_PY_DYNAMIC_H

#include "numpy_api.h"

#include "../halfshell_dynamic.h"

#include <stdbool.h>

typedef struct py_dynamic {
    PyObject_HEAD
    hs_dynamic *list;    /* owned */
    PyObject   *convert; /* owned: makes an array of a position that is none */
    int         ndim;
    bool        tagged;
    double      max_radius;
} py_dynamic;

/* For queries that take long, and changes that wait for them: Ctrl-C, and the GIL. */
extern const hs_dynamic_hooks hs_py_dynamic_hooks;

/* Whether the query must be made again: it ended for a signal, whose handler has returned. Else the
 * status stays, with an exception where that is HS_ERR_INTERRUPTED. */
bool hs_py_dynamic_again(hs_status status);

/* Each returns false with an exception set. */
bool hs_key_of(const py_dynamic *self, PyObject *object, hs_key *key);
bool hs_position_of(const py_dynamic *self, PyObject *object, double *position);

/* An array of a key for each row: (n,), or (n, 2) with tags. */
PyObject *hs_keys_array(const py_dynamic *self, const hs_key *keys, int64_t n);

/* The exception for a status; `key`, or NULL, is named where one is at fault. Returns NULL. */
PyObject *hs_raise_dynamic(const py_dynamic *self, hs_status status, const hs_failure *failure,
                           PyObject *key);

/* Methods; those with balls in py_dynamic_balls.c, the others in py_dynamic_many.c. */
PyObject *hs_py_dynamic_insert_many(PyObject *self, PyObject *const *arguments, Py_ssize_t n);
PyObject *hs_py_dynamic_move_many(PyObject *self, PyObject *const *arguments, Py_ssize_t n);
PyObject *hs_py_dynamic_remove_many(PyObject *self, PyObject *const *arguments, Py_ssize_t n);
PyObject *hs_py_dynamic_near(PyObject *self, PyObject *const *arguments, Py_ssize_t n);
PyObject *hs_py_dynamic_within(PyObject *self, PyObject *const *arguments, Py_ssize_t n);
PyObject *hs_py_dynamic_within_many(PyObject *self, PyObject *const *arguments, Py_ssize_t n);
PyObject *hs_py_dynamic_keys(PyObject *self, PyObject *const *arguments, Py_ssize_t n);
PyObject *hs_py_dynamic_positions(PyObject *self, PyObject *keys);

#endif
