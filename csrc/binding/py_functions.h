/* SPDX-License-Identifier: BSD-3-Clause */
/* py_functions.h: the functions of the module; those of the table say there what they take. The
 * Python layer has the signatures and docstrings. */
#ifndef HS_PY_FUNCTIONS_H
#define HS_PY_FUNCTIONS_H

#include "interface.h"

/* What the module keeps as its state, by number: types, and what halfshell makes known. */
enum {
    HS_DYNAMIC_TYPE,
    HS_BOX_TYPE,
    HS_POINTS_TYPE,
    HS_CELLS_TYPE,
    HS_SETTINGS,
    HS_USUAL_SETTINGS,
    HS_TYPES
};

/* The first of them; a new reference or NULL. */
PyObject *hs_py_dynamic_type(PyObject *module);

/* Adds _C_API to the module; -1 with an exception set. */
int hs_py_add_capi(PyObject *module);

/* functions.c */

/*
 * quick(name, names, positional, defaults) -> attempt, for a function of the table that users call,
 * with the names of its arguments in order, how many may be positional, and what those are that may
 * be left out. attempt(arguments, options) returns what that function returns for a tuple and a
 * dict of arguments as users give them. They are converted here, without a line of Python;
 * NotImplemented, and no exception, where an argument needs more than that, is wrong, or is one
 * that only Python knows and not its default.
 */
PyObject *hs_py_quick(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* scene(points, box, periodic) -> the same as (points, rows of the box or None, bits); or
 * NotImplemented. */
PyObject *hs_py_scene(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* Adds the functions of the table; -1 with an exception set. */
int hs_py_add_functions(PyObject *module);

/* know(name, object): makes an object of the Python layer known here: the types "Box" and "Points",
 * and "settings", a context variable with its usual value. */
PyObject *hs_py_know(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* py_searches.c */
hs_py_search hs_py_pairs, hs_py_count_pairs, hs_py_pairs_between, hs_py_neighbors,
    hs_py_coordination, hs_py_nearest, hs_py_histogram, hs_py_clusters, hs_py_measure,
    hs_py_explain;

/* py_streams.c */
hs_py_search hs_py_iter_pairs, hs_py_for_each_pair;
/* The first of what iter_pairs returns, in one call at a time, and what is told of the progress, or
 * None -> arrays as from pairs; None after the last. */
PyObject *hs_py_next_block(PyObject *module, PyObject *const *arguments, Py_ssize_t n);

/* py_cells.c */
hs_py_search hs_py_cells_build, hs_py_cells_find, hs_py_cells_candidates, hs_py_verlet_update,
    hs_py_verlet_pairs;
/* cells -> dict of what is visible of them; the arrays are read-only and borrow from the cells. */
PyObject *hs_py_cells_layout(PyObject *module, PyObject *cells);
/* A new list; a list -> dict of its state. */
PyObject *hs_py_verlet_new(PyObject *module, PyObject *ignored);
PyObject *hs_py_verlet_look(PyObject *module, PyObject *list);
/* box, periodic -> (heights, volume). */
PyObject *hs_py_box_measure(PyObject *module, PyObject *const *arguments, Py_ssize_t n);
/* points, box, periodic -> (wrapped, shifts). */
PyObject *hs_py_box_wrap(PyObject *module, PyObject *const *arguments, Py_ssize_t n);
/* points, box or None, periodic, cutoff, largest -> (places, repeats, reach, width). */
PyObject *hs_py_box_places(PyObject *module, PyObject *const *arguments, Py_ssize_t n);

/* py_nodes.c */
hs_py_search hs_py_connect, hs_py_connect_search, hs_py_overlap, hs_py_intersect, hs_py_pair_rows,
    hs_py_keep_rows, hs_py_rows_without;
/* points, p, q -> bools; points, low, high -> keys. */
PyObject *hs_py_feet_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n);
PyObject *hs_py_morton_keys(PyObject *module, PyObject *const *arguments, Py_ssize_t n);
/* Where rows begin, int32 -> each entry and each other one of its row, arrays of int32; None for
 * very many, and for what is no such array. */
PyObject *hs_py_triplets(PyObject *module, PyObject *starts);

/* py_containers.c */
/* offsets or None, i or None, j, d or None -> lists of the numbers in each row; or pairs (i, j) in
 * a set, or with d in a dictionary. */
PyObject *hs_py_contain(PyObject *module, PyObject *const *arguments, Py_ssize_t n);
/* points, queries or None, periods or None, cutoff, p, eps, letter -> what hs_few_pairs finds; by
 * its letter "n" how many, "s" a set, "d" a dictionary, "l" lists, "P" an array of pairs, "b" this
 * and d, "a" arrays i, j, d. None if it is for a search, or for SciPy, with p or eps of its own. */
PyObject *hs_py_few(PyObject *module, PyObject *const *arguments, Py_ssize_t n);

/* py_dynamic.c: dim, cell_size, box or None, periodic (bits), storage (a number), max_radius or 0,
 * inclusive, tagged, what makes arrays of positions -> a list. */
PyObject *hs_py_dynamic_new(PyObject *module, PyObject *const *arguments, Py_ssize_t n);

#endif
