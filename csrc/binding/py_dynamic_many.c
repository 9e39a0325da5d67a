/* SPDX-License-Identifier: BSD-3-Clause */
/* py_dynamic_many.c: the methods of _core.DynamicCells that take or return arrays of keys. */
#include "py_dynamic.h"

#include "convert.h"
#include "py_call.h"

#include <math.h>
#include <stdlib.h>

/* Arrays of ids (int64), and of tags (int32) or None, of one length. */
static bool
take_keys(PyObject *const *arguments, const int64_t **ids, const int32_t **tags, int64_t *n)
{
    if (!hs_is_array(arguments[0], NPY_INT64, 1) ||
        (arguments[1] != Py_None && !hs_is_array(arguments[1], NPY_INT32, 1))) {
        PyErr_SetString(PyExc_TypeError, "keys must be arrays of int64 and int32");
        return false;
    }
    *ids = PyArray_DATA((PyArrayObject *)arguments[0]);
    *n = PyArray_DIM((PyArrayObject *)arguments[0], 0);
    *tags = arguments[1] == Py_None ? NULL : PyArray_DATA((PyArrayObject *)arguments[1]);
    return true;
}

/* KeyError of an absent key, ValueError of one that comes twice; or what else is wrong. */
static PyObject *
raise_many(const py_dynamic *self, hs_status status, const hs_failure *failure, const int64_t *ids,
           const int32_t *tags)
{
    if (status != HS_ERR_KEY || failure->row < 0) {
        return hs_raise_dynamic(self, status, failure, NULL);
    }
    const long long id = ids[failure->row];
    PyObject *key = self->tagged ? Py_BuildValue("(iL)", tags != NULL ? tags[failure->row] : 0, id)
                                 : PyLong_FromLongLong(id);
    if (key != NULL && failure->column == HS_KEY_ABSENT) {
        PyErr_SetObject(PyExc_KeyError, key);
    } else if (key != NULL) {
        PyErr_Format(PyExc_ValueError, "keys must differ, but keys[%lld] = %R came before",
                     (long long)failure->row, key);
    }
    Py_XDECREF(key);
    return NULL;
}

typedef hs_status put_many_fn(hs_dynamic *, const int64_t *, const int32_t *, const hs_points *,
                              hs_failure *);

/* ids, tags or None, positions. */
static PyObject *
put_many(PyObject *object, PyObject *const *arguments, Py_ssize_t n_arguments, put_many_fn *put)
{
    const py_dynamic *self = (const py_dynamic *)object;
    const int64_t    *ids;
    const int32_t    *tags;
    int64_t           n;
    hs_points         positions;
    hs_failure        failure = {.row = -1};
    if (!hs_expect_arguments("insert_many or move_many", n_arguments, 3) ||
        !take_keys(arguments, &ids, &tags, &n) ||
        !hs_points_of(arguments[2], "positions", &positions)) {
        return NULL;
    }
    if (positions.n != n || positions.ndim != self->ndim) {
        PyErr_SetString(PyExc_ValueError, "keys and positions must be of one length");
        return NULL;
    }
    hs_status status;
    do {
        status = put(self->list, ids, tags, &positions, &failure);
    } while (hs_py_dynamic_again(status));
    if (status != HS_OK) {
        return raise_many(self, status, &failure, ids, tags);
    }
    Py_RETURN_NONE;
}

PyObject *
hs_py_dynamic_insert_many(PyObject *self, PyObject *const *arguments, Py_ssize_t n)
{
    return put_many(self, arguments, n, hs_dynamic_insert_many);
}

PyObject *
hs_py_dynamic_move_many(PyObject *self, PyObject *const *arguments, Py_ssize_t n)
{
    return put_many(self, arguments, n, hs_dynamic_move_many);
}

/* ids, tags or None -> which of them were there. */
PyObject *
hs_py_dynamic_remove_many(PyObject *object, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    const py_dynamic *self = (const py_dynamic *)object;
    const int64_t    *ids;
    const int32_t    *tags;
    int64_t           n;
    hs_failure        failure = {.row = -1};
    if (!hs_expect_arguments("remove_many", n_arguments, 2) ||
        !take_keys(arguments, &ids, &tags, &n)) {
        return NULL;
    }
    npy_intp  shape = (npy_intp)n;
    PyObject *removed = PyArray_SimpleNew(1, &shape, NPY_BOOL);
    if (removed == NULL) {
        return NULL;
    }
    const hs_status status = hs_dynamic_remove_many(
        self->list, ids, tags, n, PyArray_DATA((PyArrayObject *)removed), &failure);
    if (status != HS_OK) {
        Py_DECREF(removed);
        return raise_many(self, status, &failure, ids, tags);
    }
    return removed;
}

/* cursor, most keys -> the next cursor, keys. */
PyObject *
hs_py_dynamic_keys(PyObject *object, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    const py_dynamic *self = (const py_dynamic *)object;
    int64_t           cursor = n_arguments == 2 ? PyLong_AsLongLong(arguments[0]) : -1;
    const int64_t     most = n_arguments == 2 ? PyLong_AsLongLong(arguments[1]) : -1;
    if (PyErr_Occurred() || cursor < 0 || most < 1) {
        return PyErr_Occurred() ? NULL : PyErr_Format(PyExc_ValueError, "keys: bad arguments");
    }
    hs_key *keys = malloc((size_t)most * sizeof *keys);
    if (keys == NULL) {
        return PyErr_NoMemory();
    }
    const int64_t n = hs_dynamic_keys(self->list, &cursor, keys, most);
    PyObject     *result = Py_BuildValue("(LN)", (long long)cursor, hs_keys_array(self, keys, n));
    free(keys);
    return result;
}

/* Keys as an array of this list -> (n, ndim) positions, NaN for those that have none. */
PyObject *
hs_py_dynamic_positions(PyObject *object, PyObject *argument)
{
    const py_dynamic *self = (const py_dynamic *)object;
    if (!hs_is_array(argument, NPY_INT64, self->tagged ? 2 : 1)) {
        PyErr_SetString(PyExc_TypeError, "keys must be an array of int64");
        return NULL;
    }
    const int64_t *data = PyArray_DATA((PyArrayObject *)argument);
    npy_intp       shape[2] = {PyArray_DIM((PyArrayObject *)argument, 0), self->ndim};
    PyObject      *array = PyArray_SimpleNew(2, shape, NPY_DOUBLE);
    double        *rows = array != NULL ? PyArray_DATA((PyArrayObject *)array) : NULL;
    for (npy_intp e = 0; array != NULL && e < shape[0]; e++) {
        const hs_key    key = self->tagged ? (hs_key){data[2 * e + 1], (int32_t)data[2 * e]}
                                           : (hs_key){data[e], 0};
        const hs_status status = hs_dynamic_position(self->list, key, rows + e * self->ndim);
        for (int k = 0; status == HS_ERR_ARGUMENT && k < self->ndim; k++) {
            rows[e * self->ndim + k] = NAN;
        }
        if (status == HS_ERR_KEY) {
            Py_CLEAR(array);
            PyErr_SetString(PyExc_RuntimeError, "the list changed meanwhile");
        }
    }
    return array;
}
