/* SPDX-License-Identifier: BSD-3-Clause */
/* reach.h: the argument that gives each pair a reach of its own. */
#ifndef HS_BINDING_REACH_H
#define HS_BINDING_REACH_H

#include "numpy_api.h"

#include "../halfshell.h"

/*
 * A tuple (rule, radii, query_radii, types, query_types, table, supports, query_supports, extent):
 * an int of hs_rule; arrays of float64 or, for types, int32, each with one entry for each point or
 * query; a square float64 table of cutoffs; float64 arrays of one matrix of ndim rows for each
 * point or query; and a float, how many times supports or radii count, or None. Any but the rule
 * may be None. The view borrows from it and runs no Python code. False with an exception set.
 */
bool hs_reach_of(PyObject *object, int64_t n_points, int64_t n_queries, int ndim, hs_reach *reach);

#endif
