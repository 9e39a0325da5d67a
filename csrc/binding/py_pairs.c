/* SPDX-License-Identifier: BSD-3-Clause */
/* py_pairs.c: half lists of the points, and how many pairs there are, of one set or of two. */
#include "py_functions.h"

#include "errors.h"
#include "py_call.h"

PyObject *
hs_py_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_pairs  *pairs = NULL;
    (void)module;
    if (!hs_py_call_take(&call, "pairs", "ksbohgec", arguments, n_arguments) ||
        !hs_py_call_make_room(&call)) {
        return NULL;
    }
    hs_py_call_release(&call);
    const hs_status status = hs_pairs_find(&call.among, &call.options, &pairs, &call.failure);
    hs_py_call_acquire(&call);
    return hs_py_call_pairs(&call, status, pairs);
}

static PyObject *
count(const char *name, const char *more, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    int64_t    n = 0;
    if (!hs_py_call_take(&call, name, more, arguments, n_arguments)) {
        return NULL;
    }
    hs_py_call_release(&call);
    const hs_status status = hs_pairs_count(&call.among, &call.options, &n, &call.failure);
    hs_py_call_acquire(&call);
    return status == HS_OK ? PyLong_FromLongLong(n)
                           : hs_raise(status, &call.failure, &call.options);
}

PyObject *
hs_py_count_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    (void)module;
    return count("count_pairs", "hg", arguments, n_arguments);
}

PyObject *
hs_py_count_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    (void)module;
    return count("count_between", "Rhg", arguments, n_arguments);
}
