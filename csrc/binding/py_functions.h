/* SPDX-License-Identifier: BSD-3-Clause */
/* py_functions.h: the functions of the module; METH_FASTCALL, positional arguments only. The Python
 * layer has the signatures, defaults and docstrings. */
#ifndef HS_PY_FUNCTIONS_H
#define HS_PY_FUNCTIONS_H

#include "numpy_api.h"

/* Functions with these arguments, and with one or none. */
typedef PyObject *hs_py_search(PyObject *module, PyObject *const *arguments,
                               Py_ssize_t n_arguments);
typedef PyObject *hs_py_single(PyObject *module, PyObject *argument);

/* py_pairs.c. The arguments of py_call.h, then quantities, sort, index_bytes, out. */
hs_py_search hs_py_pairs;
/* The arguments of py_call.h. */
hs_py_search hs_py_count_pairs;
/* The arguments of py_call.h, queries. */
hs_py_search hs_py_count_between;

/* py_histogram.c. The arguments of py_call.h (its cutoff is ignored, inclusive is that of all edges
 * but the last), edges, last_inclusive, queries or None, n_types; types and weights of the points,
 * then of the queries, each an array (int32, float64) or None -> (n_types, n_types, edges). */
hs_py_search hs_py_histogram;

/* py_neighbors.c. The arguments of py_call.h, then quantities, sort (which changes nothing),
 * index_bytes, out; queries. */
hs_py_search hs_py_pairs_between;
/* Those of py_call.h, then quantities of j d D S, index_bytes; queries or None -> offsets and
 * arrays, read-only. */
hs_py_search hs_py_neighbors;
/* The arguments of py_call.h, queries or None. */
hs_py_search hs_py_coordination;

/* py_clusters.c. The arguments of py_call.h, an array of bool or None, winding -> (how many,
 * labels, bits of winding or None). */
hs_py_search hs_py_clusters;

/* py_cells.c. The arguments of py_call.h, the least width of cells or 0 -> cells, which stand for
 * points and box afterwards. */
hs_py_search hs_py_cells_build;
/* cells -> dict of what is visible of them; the arrays are read-only and borrow from the cells. */
hs_py_single hs_py_cells_layout;
/* cells, points -> the cell of each point. */
hs_py_search hs_py_cells_find;
/* The arguments of py_call.h with cells, queries or None -> (offsets, (first, end)). */
hs_py_search hs_py_cells_candidates;

/* The types that the module keeps as its state, by number. */
enum { HS_STREAM_TYPE, HS_DYNAMIC_TYPE, HS_TYPES };

/* py_stream.c. Those of py_call.h, then quantities, index_bytes, max_pairs -> an iterator. */
hs_py_search hs_py_iter_pairs;
/* The type of these, a new reference or NULL. */
PyObject *hs_py_stream_type(PyObject *module);

/* py_visit.c. The arguments of py_call.h, then what to call (a callable, or the address of a
 * hs_pair_fn), the address of its data, and whether threads may call it -> pairs visited. */
hs_py_search hs_py_for_each_pair;

/* py_batch.c. The arguments of py_call.h (where each system has a box of its own, any one of that
 * shape), quantities, sort, index_bytes, out; the parts of many_systems.h; reach and
 * algorithm, as all that find pairs. */
hs_py_search hs_py_batch_pairs;
/* The arguments of py_call.h, the parts of many_systems.h. */
hs_py_search hs_py_batch_count;

/* py_connectivity.c. The arguments of py_call.h, of which points and resources count, then i, j,
 * shifts or None of a half list; n_nodes, n_ghosts, number or None, flags (1: rows of ghosts, 2:
 * pairs of them, 4: rows alone) -> (rows, (nodes, lists)): rows are offsets, indices and, where
 * there are any, shifts; nodes those of pairs, i, j and shifts; lists theirs, or None for both. */
hs_py_search hs_py_connect;
/* Those of py_call.h; n_nodes, n_ghosts, number or None, flags; reach -> the same. */
hs_py_search hs_py_connect_search;
/* Those of py_call.h, offsets and indices of rows; n_nodes, n_ghosts, number or None, flags
 * -> offsets, indices. */
hs_py_search hs_py_overlap;
/* Those of py_call.h, i, j; n_nodes, n_ghosts, number or None, flags -> offsets, indices. */
hs_py_search hs_py_intersect;
/* py_node_changes.c, all with the arguments of py_call.h, of which resources count. offsets,
 * indices, shifts or None of rows; n_nodes, n_ghosts, None, flags -> (None, (nodes, lists)). */
hs_py_search hs_py_pair_rows;
/* offsets, indices, shifts or None; n_nodes, target, place or None; source or None -> rows. */
hs_py_search hs_py_keep_rows;
/* offsets, indices, shifts or None, the same of what goes; the number of lists, whether rows ascend
 * -> rows. */
hs_py_search hs_py_rows_without;
/* i_node, i_list, j_node, j_list, shifts or None; n_nodes or None, target or None; keep or None
 * -> (None, (nodes, lists)). */
hs_py_search hs_py_keep_pairs;
/* py_connectivity.c. points, p, q -> bools; points, low, high -> keys. */
hs_py_search hs_py_feet_between;
hs_py_search hs_py_morton_keys;

/* py_nearest.c. Those of py_call.h (cutoff: the largest distance), then quantities of j d D S,
 * index_bytes; queries or None, k -> arrays of k entries a query, one query after another. */
hs_py_search hs_py_nearest;

/* py_measure.c. Those of py_call.h (cutoff: ignored), then quantities of d D S, i and j (int64), S
 * (int64) or None -> arrays of the pairs. */
hs_py_search hs_py_measure;

/* py_explain.c. The arguments of py_call.h, then quantities, sort, index_bytes, measure. */
hs_py_search hs_py_explain;

/* capi.c. Adds _C_API to the module; -1 with an exception set. */
int hs_py_add_capi(PyObject *module);

/* py_info.c. */
hs_py_single hs_py_kernels;
hs_py_single hs_py_default_kernel;
hs_py_single hs_py_build_info;
hs_py_single hs_py_available_memory;
hs_py_single hs_py_group_memory;
hs_py_single hs_py_clear_cache;
/* A number of bytes -> the limit before. */
hs_py_single hs_py_set_cache_limit;
hs_py_single hs_py_cache_limit;
hs_py_single hs_py_cache_held;

/* py_box.c. box, periodic -> (heights, volume). */
hs_py_search hs_py_box_measure;
/* points, box, periodic -> (wrapped, shifts). */
hs_py_search hs_py_box_wrap;
/* points, box or None, periodic, cutoff, largest -> (places, repeats, reach, width). */
hs_py_search hs_py_box_places;

/* py_verlet.c. A new list. */
hs_py_single hs_py_verlet_new;
/* A list, the arguments of py_call.h, skin, rebuild -> whether it was built. */
hs_py_search hs_py_verlet_update;
/* A list, the arguments of py_call.h with points of shape (0, d), quantities, sort, index_bytes,
 * out. */
hs_py_search hs_py_verlet_pairs;
/* A list -> dict of its state. */
hs_py_single hs_py_verlet_look;

/* py_dynamic_new.c. dim, cell_size, box or None, periodic (bits), storage (a number), max_radius or
 * 0, inclusive, tagged, what makes arrays of positions -> a list. */
hs_py_search hs_py_dynamic_new;
/* py_dynamic.c. The type of these, a new reference or NULL. */
PyObject *hs_py_dynamic_type(PyObject *module);

#endif
