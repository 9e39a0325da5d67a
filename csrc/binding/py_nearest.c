/* SPDX-License-Identifier: BSD-3-Clause */
/* py_nearest.c: _core.nearest. */
#include "py_functions.h"

#include "many_systems.h"
#include "errors.h"

#include <math.h>
#include <stdio.h>

/* Rows have k entries: what they need is known, and fewer would do. */
static PyObject *
raise_memory(const hs_failure *failure)
{
    char text[320], needed[32], limit[48];
    hs_format_limit(failure->limit_bytes, limit, sizeof limit);
    if (failure->expected_bytes > 0.0 && !isinf(failure->expected_bytes)) {
        hs_format_bytes(failure->expected_bytes, needed, sizeof needed);
        snprintf(text, sizeof text,
                 "the result would not fit: %.3g entries (%s), %s%s; use a smaller k, fewer "
                 "quantities, or fewer queries at a time",
                 failure->expected_pairs, needed, limit,
                 hs_took_more(failure) ? " for them and the search" : "");
    } else {
        snprintf(text, sizeof text,
                 "no memory for the search: %s; perhaps a point is so far from the others, or "
                 "the box so small, that too many images are about as near",
                 limit);
    }
    PyErr_SetString(PyExc_MemoryError, text);
    return NULL;
}

PyObject *
hs_py_nearest(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_pairs  *rows = NULL;
    hs_batch   batch;
    (void)module;
    if (!hs_py_call_take(&call, "nearest", "rbQim", arguments, n_arguments)) {
        return NULL;
    }
    if (call.integer < 1) {
        PyErr_SetString(PyExc_ValueError, "k must be 1 or more");
        return NULL;
    }
    if (!hs_batch_take_optional(&call, &batch)) {
        return NULL;
    }
    hs_py_call_release(&call);
    const hs_status status =
        batch.is_given
            ? hs_systems_nearest(&call.points, call.among.queries, &batch.systems, call.integer,
                                 &call.options, &rows, &call.failure)
            : hs_nearest_find(&call.among, call.integer, &call.options, &rows, &call.failure);
    hs_py_call_acquire(&call);
    hs_batch_forget_system(&batch, &call.failure);
    hs_batch_free(&batch);
    return status == HS_ERR_MEMORY ? raise_memory(&call.failure)
                                   : hs_py_call_pairs(&call, status, rows);
}
