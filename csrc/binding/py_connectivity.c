/* SPDX-License-Identifier: BSD-3-Clause */
/* py_connectivity.c: rows and pairs of node lists, and what is made of them. The Python layer keeps
 * the arrays, and puts what it gives in here together from them. */
#include "py_functions.h"

#include "convert.h"
#include "errors.h"
#include "node_call.h"

/* What the caller wants of a connectivity. */
static int
wanted_of(const hs_node_call *call)
{
    return call->lists.rows_only ? HS_ROWS_WANTED : HS_ROWS_WANTED | HS_PAIRS_WANTED;
}

PyObject *
hs_py_connect(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_node_call     c;
    hs_half_list     half;
    hs_connectivity *made = NULL;
    (void)module;
    if (!hs_node_call_take(&c, "connect", "aaaaaai", 3, arguments, n_arguments) ||
        !hs_take_half(c.own, c.own[2], &half)) {
        return NULL;
    }
    hs_py_call_release(&c.call);
    const hs_status status =
        hs_connectivity_link(&half, &c.lists, &c.call.options, &made, &c.call.failure);
    hs_py_call_acquire(&c.call);
    return hs_node_call_parts(&c, status, made, wanted_of(&c), half.ndim);
}

PyObject *
hs_py_connect_search(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_node_call     c;
    hs_connectivity *made = NULL;
    (void)module;
    if (!hs_node_call_take(&c, "connect_search", "aaaih", 0, arguments, n_arguments)) {
        return NULL;
    }
    hs_py_call_release(&c.call);
    const hs_status status =
        hs_connectivity_build(&c.call.among, &c.lists, &c.call.options, &made, &c.call.failure);
    hs_py_call_acquire(&c.call);
    return hs_node_call_parts(&c, status, made, wanted_of(&c), c.call.points.ndim);
}

PyObject *
hs_py_overlap(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_node_call  c;
    hs_index_rows gather;
    hs_pairs     *rows = NULL;
    (void)module;
    if (!hs_node_call_take(&c, "overlap", "aaaaai", 2, arguments, n_arguments)) {
        return NULL;
    }
    gather.n = c.call.points.n;
    gather.offsets = hs_entries_of(c.own[0], NPY_INT64, gather.n + 1, NULL);
    gather.indices =
        gather.offsets != NULL ? hs_entries_of(c.own[1], NPY_INT32, -1, &gather.n_indices) : NULL;
    if (gather.indices == NULL) {
        return NULL;
    }
    hs_py_call_release(&c.call);
    const hs_status status = hs_connectivity_overlap(&c.call.points, &gather, &c.lists,
                                                     &c.call.options, &rows, &c.call.failure);
    hs_py_call_acquire(&c.call);
    return hs_node_call_rows(&c, status, rows, 1);
}

PyObject *
hs_py_intersect(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_node_call c;
    hs_half_list half;
    hs_pairs    *result = NULL;
    (void)module;
    if (!hs_node_call_take(&c, "intersect", "aaaaai", 2, arguments, n_arguments) ||
        !hs_take_half(c.own, Py_None, &half)) {
        return NULL;
    }
    hs_py_call_release(&c.call);
    const hs_status status = hs_connectivity_intersect(&c.call.points, &half, &c.lists,
                                                       &c.call.options, &result, &c.call.failure);
    hs_py_call_acquire(&c.call);
    return hs_node_call_rows(&c, status, result, 1);
}

/* A new array, or an exception for a status other than HS_OK; takes the reference. */
static PyObject *
checked(PyObject *array, hs_status status, const hs_failure *failure)
{
    if (status == HS_OK) {
        return array;
    }
    Py_DECREF(array);
    return hs_raise(status, failure, NULL);
}

/* points, p, q -> whether the foot of each is between them. */
PyObject *
hs_py_feet_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_points  points;
    hs_failure failure;
    (void)module;
    if (!hs_expect_arguments("feet_between", n_arguments, 3) ||
        !hs_points_of(arguments[0], "points", &points)) {
        return NULL;
    }
    const double *p = hs_entries_of(arguments[1], NPY_DOUBLE, points.ndim, NULL);
    const double *q = p != NULL ? hs_entries_of(arguments[2], NPY_DOUBLE, points.ndim, NULL) : NULL;
    npy_intp      n = (npy_intp)points.n;
    PyObject     *array = q != NULL ? PyArray_SimpleNew(1, &n, NPY_BOOL) : NULL;
    if (array == NULL) {
        return NULL;
    }
    const hs_status status =
        hs_feet_between(&points, p, q, PyArray_DATA((PyArrayObject *)array), &failure);
    return checked(array, status, &failure);
}

/* points, low, high -> uint64 keys. */
PyObject *
hs_py_morton_keys(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_points  points;
    hs_failure failure;
    hs_status  status;
    (void)module;
    if (!hs_expect_arguments("morton_keys", n_arguments, 3) ||
        !hs_points_of(arguments[0], "points", &points)) {
        return NULL;
    }
    const double *low = hs_entries_of(arguments[1], NPY_DOUBLE, points.ndim, NULL);
    const double *high = low != NULL ? hs_entries_of(arguments[2], NPY_DOUBLE, points.ndim, NULL)
                                     : NULL;
    npy_intp      n = (npy_intp)points.n;
    PyObject     *array = high != NULL ? PyArray_SimpleNew(1, &n, NPY_UINT64) : NULL;
    if (array == NULL) {
        return NULL;
    }
    uint64_t *keys = PyArray_DATA((PyArrayObject *)array);
    Py_BEGIN_ALLOW_THREADS
    status = hs_morton_keys(&points, low, high, keys, &failure);
    Py_END_ALLOW_THREADS
    return checked(array, status, &failure);
}
