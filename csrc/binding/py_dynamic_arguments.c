/* SPDX-License-Identifier: BSD-3-Clause */
/* py_dynamic_arguments.c: keys and positions from Python, arrays of keys for it, and the exceptions
 * of dynamic lists. */
#include "py_dynamic.h"

#include "errors.h"
#include "foreign.h"

#include <string.h>

static bool
integer_of(PyObject *object, const char *must, long long *value)
{
    int overflow = 0;
    if (!PyLong_CheckExact(object) &&
        (PyBool_Check(object) || !PyIndex_Check(object) || PyArray_Check(object))) {
        hs_refuse(PyExc_TypeError, must, object);
        return false;
    }
    PyObject *index = PyNumber_Index(object);
    if (index == NULL) {
        return false;
    }
    *value = PyLong_AsLongLongAndOverflow(index, &overflow);
    Py_DECREF(index);
    if (overflow != 0) {
        hs_refuse(PyExc_OverflowError, "key must fit int64", object);
    }
    return overflow == 0;
}

bool
hs_key_of(const py_dynamic *self, PyObject *object, hs_key *key)
{
    long long id = 0, tag = 0;
    if (!self->tagged) {
        if (!integer_of(object, "key must be an integer", &id)) {
            return false;
        }
    } else {
        const char *must = "key must be a tuple (tag, integer) of integers";
        if (!PyTuple_Check(object) || PyTuple_GET_SIZE(object) != 2) {
            hs_refuse(PyExc_TypeError, must, object);
            return false;
        }
        if (!integer_of(PyTuple_GET_ITEM(object, 0), must, &tag) ||
            !integer_of(PyTuple_GET_ITEM(object, 1), must, &id)) {
            return false;
        }
        if (tag < INT32_MIN || tag > INT32_MAX) {
            hs_refuse(PyExc_OverflowError, "the tag of a key must fit int32", object);
            return false;
        }
    }
    *key = (hs_key){.id = id, .tag = (int32_t)tag};
    return true;
}

/* Numbers of a float64 array, or the floats of a list or tuple; false for all else. */
static bool
plain_position(PyObject *object, int ndim, double *position)
{
    if (PyArray_Check(object)) {
        PyArrayObject *array = (PyArrayObject *)object;
        if (PyArray_TYPE(array) != NPY_DOUBLE || PyArray_NDIM(array) != 1 ||
            PyArray_DIM(array, 0) != ndim || !PyArray_ISCARRAY_RO(array) ||
            !PyArray_CheckExact(object)) {
            return false;
        }
        memcpy(position, PyArray_DATA(array), (size_t)ndim * sizeof *position);
        return true;
    }
    if ((!PyTuple_CheckExact(object) && !PyList_CheckExact(object)) ||
        PySequence_Fast_GET_SIZE(object) != ndim) {
        return false;
    }
    for (int k = 0; k < ndim; k++) {
        PyObject *item = PySequence_Fast_GET_ITEM(object, k);
        if (!PyFloat_CheckExact(item)) {
            return false;
        }
        position[k] = PyFloat_AS_DOUBLE(item);
    }
    return true;
}

bool
hs_position_of(const py_dynamic *self, PyObject *object, double *position)
{
    if (plain_position(object, self->ndim, position)) {
        return true;
    }
    PyObject *array = PyObject_CallFunction(self->convert, "Oi", object, self->ndim);
    if (array == NULL) {
        return false;
    }
    const bool is_plain = plain_position(array, self->ndim, position);
    Py_DECREF(array);
    if (!is_plain) {
        PyErr_SetString(PyExc_TypeError, "position must be real numbers");
    }
    return is_plain;
}

PyObject *
hs_keys_array(const py_dynamic *self, const hs_key *keys, int64_t n)
{
    npy_intp  shape[2] = {(npy_intp)n, 2};
    PyObject *array = PyArray_SimpleNew(self->tagged ? 2 : 1, shape, NPY_INT64);
    if (array == NULL) {
        return NULL;
    }
    int64_t *data = PyArray_DATA((PyArrayObject *)array);
    for (int64_t e = 0; e < n; e++) {
        if (self->tagged) {
            data[2 * e] = keys[e].tag;
            data[2 * e + 1] = keys[e].id;
        } else {
            data[e] = keys[e].id;
        }
    }
    return array;
}

static PyObject *
raise_radius(const py_dynamic *self, const hs_failure *failure)
{
    PyObject *radius = PyFloat_FromDouble(failure->value);
    PyObject *most = PyFloat_FromDouble(self->max_radius);
    if (radius != NULL && most != NULL) {
        PyErr_Format(PyExc_ValueError,
                     "radius must be from 0 to max_radius, got radius = %R with max_radius = %R",
                     radius, most);
    }
    Py_XDECREF(radius);
    Py_XDECREF(most);
    return NULL;
}

static PyObject *
raise_coordinate(const hs_failure *failure)
{
    char name[64];
    if (failure->row >= 0) {
        PyOS_snprintf(name, sizeof name, "positions[%lld, %lld]", (long long)failure->row,
                      (long long)failure->column);
    } else {
        PyOS_snprintf(name, sizeof name, "position[%lld]", (long long)failure->column);
    }
    PyObject *value = PyFloat_FromDouble(failure->value);
    if (value != NULL) {
        PyErr_Format(PyExc_ValueError, "%s must be finite, got %R", name, value);
        Py_DECREF(value);
    }
    return NULL;
}

static PyObject *
raise_far(const hs_failure *failure)
{
    char name[64] = "position";
    if (failure->row >= 0) {
        PyOS_snprintf(name, sizeof name, "positions[%lld]", (long long)failure->row);
    }
    PyErr_Format(PyExc_OverflowError,
                 "%s lies 2**51 boxes away, or more, if only in a direction in which a box that "
                 "is oblique to it does not repeat: wrap it into the box first",
                 name);
    return NULL;
}

static PyObject *
raise_grid(const hs_failure *failure)
{
    char needed[32], limit[32];
    PyErr_Format(
        PyExc_ValueError,
        "storage=\"dense\" would need %s for its cells, to reach this far; %s are allowed: "
        "use storage=\"hash\"",
        hs_format_bytes(failure->expected_bytes, needed, sizeof needed),
        hs_format_bytes(failure->limit_bytes, limit, sizeof limit));
    return NULL;
}

PyObject *
hs_raise_dynamic(const py_dynamic *self, hs_status status, const hs_failure *failure, PyObject *key)
{
    switch (status) {
    case HS_ERR_KEY:
        if (key != NULL) {
            PyErr_SetObject(PyExc_KeyError, key);
        } else {
            PyErr_SetString(PyExc_ValueError,
                            "distances need positions, which some of these keys do not have");
        }
        return NULL;
    case HS_ERR_ARGUMENT:
        PyErr_Format(PyExc_ValueError, "key %R has no position", key != NULL ? key : Py_None);
        return NULL;
    case HS_ERR_CUTOFF: return raise_radius(self, failure);
    case HS_ERR_NOT_FINITE: return raise_coordinate(failure);
    case HS_ERR_SHIFT_RANGE: return raise_far(failure);
    case HS_ERR_CAPACITY: return raise_grid(failure);
    case HS_ERR_MEMORY:
        PyErr_SetString(PyExc_MemoryError, "out of memory; the list is as it was");
        return NULL;
    default: return hs_raise(status, failure, NULL);
    }
}
