/* SPDX-License-Identifier: BSD-3-Clause */
/* py_measure.c: _core.measure. */
#include "py_functions.h"

#include "convert.h"
#include "errors.h"
#include "node_call.h"
#include "threads.h"

/* What is said of a pair, and not of a point. */
static PyObject *
raise_of_pair(hs_status status, hs_py_call *call)
{
    const long long row = (long long)call->failure.row;
    if (row >= 0 && status == HS_ERR_SHIFT_RANGE) {
        PyErr_Format(PyExc_OverflowError,
                     "pair %lld: a point lies too many box vectors away: they are counted up to "
                     "2**51, and S holds 2**31; wrap the points first",
                     row);
    } else if (row >= 0 && status == HS_ERR_FAR) {
        PyErr_Format(PyExc_OverflowError, "pair %lld: the vector is too long for float64", row);
    } else if (row >= 0 && status == HS_ERR_ARGUMENT) {
        PyErr_Format(PyExc_ValueError,
                     "pair %lld: i and j must be numbers of points, and S whole numbers below "
                     "2**62, 0 along axes that do not repeat",
                     row);
    } else {
        return hs_raise(status, &call->failure, &call->options);
    }
    return NULL;
}

static bool
take_pairs(PyObject *const *arguments, int ndim, hs_pair_numbers *pairs)
{
    PyArrayObject *shift = (PyArrayObject *)arguments[2];
    pairs->i = hs_entries_of(arguments[0], NPY_INT64, -1, &pairs->n);
    pairs->j = pairs->i != NULL ? hs_entries_of(arguments[1], NPY_INT64, pairs->n, NULL) : NULL;
    pairs->shift = NULL;
    if (pairs->j == NULL || arguments[2] == Py_None) {
        return pairs->j != NULL;
    }
    if (!hs_is_array(arguments[2], NPY_INT64, 2) || PyArray_DIM(shift, 0) != pairs->n ||
        PyArray_DIM(shift, 1) != ndim) {
        PyErr_SetString(PyExc_TypeError, "S must be an int64 array of a row for each pair");
        return false;
    }
    pairs->shift = PyArray_DATA(shift);
    return true;
}

PyObject *
hs_py_measure(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call      call;
    hs_pair_numbers pairs;
    hs_pairs       *measured = NULL;
    (void)module;
    if (!hs_py_call_take(&call, "measure", "raaa", arguments, n_arguments) ||
        !take_pairs(arguments + HS_CALL_ARGUMENTS + 1, call.points.ndim, &pairs)) {
        return NULL;
    }
    if (call.among.points == NULL || call.options.want & HS_WANT_J) {
        PyErr_SetString(PyExc_TypeError, "measure takes points, and quantities of d D S");
        return NULL;
    }
    if (arguments[9] == Py_None && pairs.n >= HS_POINTS_FOR_THREADS) { /* however few points */
        call.options.threads = -hs_default_threads();
    }
    hs_py_call_release(&call);
    const hs_status status =
        hs_measure(&call.points, call.among.box, &pairs, &call.options, &measured, &call.failure);
    hs_py_call_acquire(&call);
    return status != HS_OK ? raise_of_pair(status, &call)
                           : hs_py_call_pairs(&call, status, measured);
}
