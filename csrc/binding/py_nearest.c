/* SPDX-License-Identifier: BSD-3-Clause */
/* py_nearest.c: _core.nearest. */
#include "py_functions.h"

#include "call.h"
#include "convert.h"
#include "errors.h"
#include "result.h"
#include "threads.h"

#include <math.h>
#include <stdio.h>

/* What the other searches say of points and pairs, said of queries and rows. */
static PyObject *
raise_failure(hs_status status, const hs_failure *failure, const hs_options *options)
{
    char text[256];
    if (status == HS_ERR_NOT_FINITE && failure->in_queries) {
        snprintf(text, sizeof text, "queries must be finite, got queries[%lld, %lld] = %g",
                 (long long)failure->row, (long long)failure->column, failure->value);
        PyErr_SetString(PyExc_ValueError, text);
    } else if (status == HS_ERR_SHIFT_RANGE && failure->in_queries) {
        snprintf(text, sizeof text,
                 "queries[%lld] lies too many box vectors away: shifts are counted up to 2**51, "
                 "and S holds 2**31; wrap the queries first",
                 (long long)failure->row);
        PyErr_SetString(PyExc_OverflowError, text);
    } else if (status == HS_ERR_MEMORY && failure->expected_bytes > 0.0 &&
               !isinf(failure->expected_bytes)) {
        snprintf(text, sizeof text,
                 "the result would not fit: %.3g entries (%.3g GB), %.3g GB are allowed; use a "
                 "smaller k, fewer quantities, or fewer queries at a time",
                 failure->expected_pairs, failure->expected_bytes / 1e9,
                 failure->limit_bytes / 1e9);
        PyErr_SetString(PyExc_MemoryError, text);
    } else if (status == HS_ERR_MEMORY) {
        PyErr_SetString(PyExc_MemoryError,
                        "not enough memory for the search: a point is so far from the others, or "
                        "the box so small, that too many images are about as near");
    } else {
        return hs_raise(status, failure, options);
    }
    return NULL;
}

PyObject *
hs_py_nearest(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_call    call;
    hs_result  result;
    hs_failure failure;
    hs_points  queries;
    hs_pairs  *rows = NULL;
    (void)module;
    if (n_arguments != HS_CALL_ARGUMENTS + 6) {
        PyErr_Format(PyExc_TypeError, "nearest takes %d arguments", HS_CALL_ARGUMENTS + 6);
        return NULL;
    }
    PyObject *const *own = arguments + HS_CALL_ARGUMENTS;
    const bool       has_queries = own[4] != Py_None;
    if (!hs_call_init(&call, arguments) || !hs_result_init(&result, own, &call) ||
        (has_queries && !hs_points_of(own[4], &queries))) {
        return NULL;
    }
    const long long k = PyLong_AsLongLong(own[5]);
    if (k < 1 || (has_queries && queries.ndim != call.points.ndim)) {
        if (!PyErr_Occurred()) {
            PyErr_SetString(PyExc_ValueError, "k must be positive, and queries as wide as points");
        }
        return NULL;
    }
    if (arguments[9] == Py_None && has_queries && queries.n >= HS_POINTS_FOR_THREADS) {
        call.options.threads = -hs_default_threads();
    }
    hs_call_release(&call);
    const hs_status status = hs_nearest_find(&call.points, has_queries ? &queries : NULL,
                                             hs_call_box(&call), k, &call.options, &rows, &failure);
    hs_call_acquire(&call);
    if (status != HS_OK) {
        return raise_failure(status, &failure, &call.options);
    }
    PyObject *arrays = hs_result_of(&result, rows, &call);
    hs_pairs_free(rows);
    return arrays;
}
