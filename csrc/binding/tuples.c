/* SPDX-License-Identifier: BSD-3-Clause */
/* tuples.c: results of several arrays. */
#include "tuples.h"

void
hs_tuple_put(PyObject **tuple, Py_ssize_t k, PyObject *entry)
{
    if (entry == NULL) {
        Py_CLEAR(*tuple);
    } else {
        PyTuple_SET_ITEM(*tuple, k, entry);
    }
}

PyObject *
hs_tuple_of_integers(const int64_t *values, int n)
{
    PyObject *tuple = PyTuple_New(n);
    for (int k = 0; tuple != NULL && k < n; k++) {
        hs_tuple_put(&tuple, k, PyLong_FromLongLong(values[k]));
    }
    return tuple;
}

PyObject *
hs_tuple_of_reals(const double *values, int n)
{
    PyObject *tuple = PyTuple_New(n);
    for (int k = 0; tuple != NULL && k < n; k++) {
        hs_tuple_put(&tuple, k, PyFloat_FromDouble(values[k]));
    }
    return tuple;
}

PyObject *
hs_tuple_of_names(const char *const *names, int n)
{
    PyObject *tuple = PyTuple_New(n);
    for (int k = 0; tuple != NULL && k < n; k++) {
        hs_tuple_put(&tuple, k, PyUnicode_FromString(names[k]));
    }
    return tuple;
}

bool
hs_dict_put(PyObject *dict, const char *key, PyObject *value)
{
    const bool done = value != NULL && PyDict_SetItemString(dict, key, value) == 0;
    Py_XDECREF(value);
    return done;
}
