/* SPDX-License-Identifier: BSD-3-Clause */
/* node_call.h: what the functions of node lists share: their arguments as views, and their results
 * as arrays. */
#ifndef HS_NODE_CALL_H
#define HS_NODE_CALL_H

#include "py_call.h"

#include "../halfshell_nodes.h"

/* The arguments of one call; it cannot be moved, as hs_py_call. */
typedef struct hs_node_call {
    hs_py_call       call;
    hs_node_lists    lists;
    PyObject *const *own; /* borrowed: the arguments behind those of every search */
} hs_node_call;

/* Takes the arguments, as hs_py_call_take does. n_nodes, n_ghosts and number are own[lists_at] and
 * those behind it, and the call's integer has the flags, unless lists_at is -1. */
bool hs_node_call_take(hs_node_call *call, const char *name, const char *more, int lists_at,
                       PyObject *const *arguments, Py_ssize_t n_arguments);

/* The entries of a C-contiguous array of this type with n entries, or with any number where n is
 * -1; *length, unless NULL, is that number. NULL with an exception set. */
const void *hs_entries_of(PyObject *object, int type, int64_t n, int64_t *length);

/* The same of an array or None: false with an exception set. */
bool hs_entries_or_none(PyObject *object, int type, int64_t n, const void **entries);

/* Shifts of n entries, or NULL and 1 dimension for None. */
bool hs_take_shifts(PyObject *object, int64_t n, const int32_t **shift, int *ndim);

/* i, j and shift of a half list. */
bool hs_take_half(PyObject *const *arguments, PyObject *shift, hs_half_list *half);

/* offsets, indices, shifts or None of rows of n_lists lists. */
bool hs_take_rows(PyObject *const *arguments, int64_t n_lists, hs_list_rows *rows);

/* What a function returns, the GIL taken, from a result that is freed; NULL with an exception set
 * for a status other than HS_OK. Of rows offsets and indices, and shifts of ndim components where
 * there are any; of a connectivity (rows, (nodes, lists)), None for what is not wanted. */
PyObject *hs_node_call_rows(hs_node_call *call, hs_status status, hs_pairs *rows, int ndim);
enum { HS_ROWS_WANTED = 1, HS_PAIRS_WANTED = 2 };
PyObject *hs_node_call_parts(hs_node_call *call, hs_status status, hs_connectivity *made,
                             int wanted, int ndim);

#endif
