/* SPDX-License-Identifier: BSD-3-Clause */
/* py_clusters.c: _core.clusters: the clusters of points, as arrays. */
#include "py_functions.h"

#include "errors.h"
#include "py_call.h"

/* Flags of core points, borrowed, or NULL for None; false with an exception set. They have been
 * made by _functions/clusters.py. */
static bool
take_core(PyObject *given, int64_t n, const uint8_t **core)
{
    *core = NULL;
    if (given == Py_None) {
        return true;
    }
    PyArrayObject *array = (PyArrayObject *)given;
    if (!PyArray_Check(given) || PyArray_TYPE(array) != NPY_BOOL || PyArray_NDIM(array) != 1 ||
        PyArray_DIM(array, 0) != n || !PyArray_IS_C_CONTIGUOUS(array)) {
        PyErr_SetString(PyExc_TypeError, "core is no array of a bool for each point");
        return false;
    }
    *core = PyArray_DATA(array);
    return true;
}

/* An array of n entries, or None where it is not wanted. */
static PyObject *
new_array(bool wanted, npy_intp n, int type)
{
    return wanted ? PyArray_SimpleNew(1, &n, type) : Py_NewRef(Py_None);
}

static void *
data_of(PyObject *array)
{
    return array != Py_None ? PyArray_DATA((PyArrayObject *)array) : NULL;
}

PyObject *
hs_py_clusters(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call     call;
    const uint8_t *core;
    int64_t        n_clusters = 0;
    PyObject      *result = NULL;
    (void)module;
    if (!hs_py_call_take(&call, "clusters", "afhg", arguments, n_arguments) ||
        !take_core(arguments[HS_CALL_ARGUMENTS], call.points.n, &core)) {
        return NULL;
    }
    PyObject *labels = new_array(true, (npy_intp)call.points.n, NPY_INT64);
    PyObject *winding = new_array(call.flag, (npy_intp)call.points.n, NPY_UINT8);
    if (labels != NULL && winding != NULL) {
        hs_py_call_release(&call);
        const hs_status status = hs_clusters_find(&call.among, &call.options, core, data_of(labels),
                                                  data_of(winding), &n_clusters, &call.failure);
        hs_py_call_acquire(&call);
        result = status == HS_OK ? Py_BuildValue("LOO", (long long)n_clusters, labels, winding)
                                 : hs_raise(status, &call.failure, &call.options);
    }
    Py_XDECREF(labels);
    Py_XDECREF(winding);
    return result;
}
