/* SPDX-License-Identifier: BSD-3-Clause */
/* probe_capi.c: a module as others would write it, compiled by test_capi.py as C and as C++. */
#include <Python.h>

#include "halfshell_capi.h"

static const hs_capi *halfshell;

/* points of shape (n, ndim) as a buffer of float64, ndim, cutoff -> pairs */
static PyObject *
count(PyObject *module, PyObject *arguments)
{
    Py_buffer  buffer;
    int        ndim;
    int64_t    n_pairs;
    hs_set     points;
    hs_among   among = {&points, NULL, NULL, NULL, NULL, NULL, NULL};
    hs_failure failure;
    hs_status  status;
    hs_options options = halfshell->options_default();
    (void)module;
    if (!PyArg_ParseTuple(arguments, "y*id", &buffer, &ndim, &options.cutoff)) {
        return NULL;
    }
    memset(&points, 0, sizeof points);
    points.at.data = buffer.buf;
    points.at.ndim = ndim;
    points.at.n = (int64_t)buffer.len / (int64_t)sizeof(double) / ndim;
    points.at.real = HS_FLOAT64;
    points.at.row_stride = (ptrdiff_t)sizeof(double) * ndim;
    points.at.column_stride = (ptrdiff_t)sizeof(double);
    Py_BEGIN_ALLOW_THREADS
    status = halfshell->pairs_count(&among, &options, &n_pairs, &failure);
    Py_END_ALLOW_THREADS
    PyBuffer_Release(&buffer);
    if (status != HS_OK) {
        PyErr_SetString(PyExc_ValueError, halfshell->status_text(status));
        return NULL;
    }
    return PyLong_FromLongLong(n_pairs);
}

static PyObject *
version(PyObject *module, PyObject *ignored)
{
    (void)module;
    (void)ignored;
    return PyLong_FromLong(halfshell->version());
}

static PyMethodDef methods[] = {{"count", count, METH_VARARGS, NULL},
                                {"version", version, METH_NOARGS, NULL},
                                {NULL, NULL, 0, NULL}};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "probe_capi", NULL, -1, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC
PyInit_probe_capi(void)
{
    halfshell = hs_capi_import();
    return halfshell == NULL ? NULL : PyModule_Create(&definition);
}
