/* SPDX-License-Identifier: BSD-3-Clause */
/* py_functions.h: the functions of the module; METH_FASTCALL, positional arguments only. The Python
 * layer has the signatures, defaults and docstrings. */
#ifndef HS_PY_FUNCTIONS_H
#define HS_PY_FUNCTIONS_H

#include "numpy_api.h"

/* py_pairs.c. The arguments of py_call.h, then quantities, sort, index_bytes, out. */
PyObject *hs_py_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* The arguments of py_call.h. */
PyObject *hs_py_count_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* py_histogram.c. The arguments of py_call.h (its cutoff is ignored, inclusive is that of all edges
 * but the last), edges, last_inclusive, queries or None, n_types; types and weights of the points,
 * then of the queries, each an array (int32, float64) or None -> (n_types, n_types, edges). */
PyObject *hs_py_histogram(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* py_neighbors.c. The arguments of py_call.h, then quantities, sort (which changes nothing),
 * index_bytes, out; queries. */
PyObject *hs_py_pairs_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* The arguments of py_call.h, queries. */
PyObject *hs_py_count_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* Those of py_call.h, then quantities of j d D S, index_bytes; queries or None -> offsets and
 * arrays, read-only. */
PyObject *hs_py_neighbors(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* The arguments of py_call.h, queries or None. */
PyObject *hs_py_coordination(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* py_cells.c. The arguments of py_call.h, the least width of cells or 0 -> cells, which stand for
 * points and box afterwards. */
PyObject *hs_py_cells_build(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* cells -> dict of what is visible of them; the arrays are read-only and borrow from the cells. */
PyObject *hs_py_cells_layout(PyObject *module, PyObject *cells);
/* cells, points -> the cell of each point. */
PyObject *hs_py_cells_find(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* The arguments of py_call.h with cells, queries or None -> (offsets, (first, end)). */
PyObject *hs_py_cells_candidates(PyObject *module, PyObject *const *arguments,
                                 Py_ssize_t n_arguments);

/* py_stream.c. Those of py_call.h, then quantities, index_bytes, max_pairs -> an iterator. */
PyObject *hs_py_iter_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* The type of these, a new reference or NULL; the module keeps it as its state. */
PyObject *hs_py_stream_type(PyObject *module);

/* py_visit.c. The arguments of py_call.h, then what to call (a callable, or the address of a
 * hs_pair_fn), the address of its data, and whether threads may call it -> pairs visited. */
PyObject *hs_py_for_each_pair(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* py_batch.c. The arguments of py_call.h (where each system has a box of its own, any one of that
 * shape), quantities, sort, index_bytes, out; batch, cutoffs or None, boxes or None. */
PyObject *hs_py_batch_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* The arguments of py_call.h, batch, cutoffs, boxes. */
PyObject *hs_py_batch_count(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* py_nearest.c. Those of py_call.h (cutoff: the largest distance), then quantities of j d D S,
 * index_bytes; queries or None, k -> arrays of k entries a query, one query after another. */
PyObject *hs_py_nearest(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* py_explain.c. The arguments of py_call.h, then quantities, sort, index_bytes, measure. */
PyObject *hs_py_explain(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* capi.c. Adds _C_API to the module; -1 with an exception set. */
int hs_py_add_capi(PyObject *module);

/* py_info.c. */
PyObject *hs_py_kernels(PyObject *module, PyObject *ignored);
PyObject *hs_py_default_kernel(PyObject *module, PyObject *ignored);
PyObject *hs_py_build_info(PyObject *module, PyObject *ignored);
PyObject *hs_py_available_memory(PyObject *module, PyObject *ignored);
PyObject *hs_py_group_memory(PyObject *module, PyObject *root);
PyObject *hs_py_clear_cache(PyObject *module, PyObject *ignored);
/* A number of bytes -> the limit before. */
PyObject *hs_py_set_cache_limit(PyObject *module, PyObject *limit);
PyObject *hs_py_cache_limit(PyObject *module, PyObject *ignored);
PyObject *hs_py_cache_held(PyObject *module, PyObject *ignored);

/* py_box.c. box, periodic -> (heights, volume). */
PyObject *hs_py_box_measure(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* points, box, periodic -> (wrapped, shifts). */
PyObject *hs_py_box_wrap(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* py_verlet.c. A new list. */
PyObject *hs_py_verlet_new(PyObject *module, PyObject *ignored);
/* A list, the arguments of py_call.h, skin, rebuild -> whether it was built. */
PyObject *hs_py_verlet_update(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* A list, the arguments of py_call.h with points of shape (0, d), quantities, sort, index_bytes,
 * out. */
PyObject *hs_py_verlet_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* A list -> dict of its state. */
PyObject *hs_py_verlet_look(PyObject *module, PyObject *list);

#endif
