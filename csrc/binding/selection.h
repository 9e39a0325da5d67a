/* SPDX-License-Identifier: BSD-3-Clause */
/* selection.h: the argument that says which pairs count. */
#ifndef HS_BINDING_SELECTION_H
#define HS_BINDING_SELECTION_H

#include "numpy_api.h"

#include "../halfshell.h"

/*
 * A tuple (groups, query_groups, labels, query_labels, query_numbers, within,
 * excluded, min_distance): int64
 * arrays of one entry for each point or query; an int; an int64 array of two columns; and a float.
 * Arrays may be None. The view borrows from it and runs no Python code. False with an exception
 * set.
 */
bool hs_selection_of(PyObject *object, int64_t n_points, int64_t n_queries,
                     hs_selection *selection);

#endif
