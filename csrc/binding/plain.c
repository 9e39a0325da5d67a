/* SPDX-License-Identifier: BSD-3-Clause */
/* plain.c: see plain.h. Nothing here raises but for a wrong number of arguments. */
#include "plain.h"

#include "call.h"
#include "py_functions.h"

#include <string.h>

enum { IS_NOT_PLAIN = -1 };

static bool
is_plain_array(PyObject *object)
{
    return PyArray_CheckExact(object) && !PyArray_ISBYTESWAPPED((PyArrayObject *)object);
}

/* The d of plain points, or IS_NOT_PLAIN. */
static int
dimensions_of(PyObject *object)
{
    if (!is_plain_array(object)) {
        return IS_NOT_PLAIN;
    }
    PyArrayObject *array = (PyArrayObject *)object;
    const int      type = PyArray_TYPE(array);
    if ((type != NPY_FLOAT && type != NPY_DOUBLE) || PyArray_NDIM(array) != 2 ||
        PyArray_DIM(array, 0) > INT32_MAX) {
        return IS_NOT_PLAIN;
    }
    const npy_intp d = PyArray_DIM(array, 1);
    return d >= 1 && d <= HS_MAX_DIM ? (int)d : IS_NOT_PLAIN;
}

static bool
is_plain_box(PyObject *object, int ndim)
{
    if (!is_plain_array(object)) {
        return false;
    }
    PyArrayObject *array = (PyArrayObject *)object;
    const int      n_axes = PyArray_NDIM(array);
    return PyArray_TYPE(array) == NPY_DOUBLE && PyArray_ISCARRAY_RO(array) && n_axes >= 1 &&
           n_axes <= 2 && PyArray_DIM(array, 0) == ndim && PyArray_DIM(array, n_axes - 1) == ndim;
}

static bool
is_flag(PyObject *object)
{
    return object == Py_True || object == Py_False;
}

/* Bit l set where box vector l repeats, or IS_NOT_PLAIN. */
static int
periodic_bits(PyObject *object, bool has_box, int ndim)
{
    const int all = (1 << ndim) - 1;
    int       bits = 0;
    if (object == Py_None) {
        return has_box ? all : 0;
    }
    if (!has_box) {
        return IS_NOT_PLAIN; /* an error unless none repeats */
    }
    if (is_flag(object)) {
        return object == Py_True ? all : 0;
    }
    if (!(PyTuple_CheckExact(object) || PyList_CheckExact(object)) ||
        PySequence_Fast_GET_SIZE(object) != ndim) {
        return IS_NOT_PLAIN;
    }
    for (int l = 0; l < ndim; l++) {
        PyObject *item = PySequence_Fast_GET_ITEM(object, l);
        if (!is_flag(item)) {
            return IS_NOT_PLAIN;
        }
        bits |= (item == Py_True) << l;
    }
    return bits;
}

/* Copies the arguments that all searches share, periodic as the core's functions take it: a new
 * reference in place of the borrowed one. False when some are not plain. */
static bool
take_plain(PyObject *const *arguments, PyObject **taken)
{
    const int ndim = dimensions_of(arguments[0]);
    PyObject *box = arguments[2];
    if (ndim == IS_NOT_PLAIN || !PyFloat_Check(arguments[1]) || !is_flag(arguments[4]) ||
        !(box == Py_None || is_plain_box(box, ndim))) {
        return false;
    }
    const int bits = periodic_bits(arguments[3], box != Py_None, ndim);
    if (bits == IS_NOT_PLAIN) {
        return false;
    }
    memcpy(taken, arguments, HS_CALL_ARGUMENTS * sizeof *taken);
    taken[3] = PyLong_FromLong(bits);
    if (taken[3] == NULL) {
        PyErr_Clear(); /* the way round will say so */
        return false;
    }
    return true;
}

/* 4 or 8 for NumPy's types, or native dtypes of them, else IS_NOT_PLAIN. */
static int
index_bytes_of(PyObject *object)
{
    if (object == (PyObject *)&PyInt64ArrType_Type) {
        return 8;
    }
    if (object == (PyObject *)&PyInt32ArrType_Type) {
        return 4;
    }
    if (!PyArray_DescrCheck(object) || !PyArray_ISNBO(((PyArray_Descr *)object)->byteorder)) {
        return IS_NOT_PLAIN;
    }
    const int type = ((PyArray_Descr *)object)->type_num;
    return type == NPY_INT64 ? 8 : type == NPY_INT32 ? 4 : IS_NOT_PLAIN;
}

PyObject *
hs_py_plain_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    PyObject *taken[HS_CALL_ARGUMENTS + 4];
    if (n_arguments != HS_CALL_ARGUMENTS + 4) {
        PyErr_Format(PyExc_TypeError, "plain_pairs takes %d arguments", HS_CALL_ARGUMENTS + 4);
        return NULL;
    }
    PyObject *const *more = arguments + HS_CALL_ARGUMENTS; /* quantities, sort, index_dtype, out */
    const int        index_bytes = index_bytes_of(more[2]);
    if (!is_flag(more[1]) || index_bytes == IS_NOT_PLAIN ||
        !take_plain(arguments, taken)) {
        Py_RETURN_NOTIMPLEMENTED;
    }
    taken[HS_CALL_ARGUMENTS] = more[0];
    taken[HS_CALL_ARGUMENTS + 1] = more[1];
    taken[HS_CALL_ARGUMENTS + 2] = PyLong_FromLong(index_bytes);
    taken[HS_CALL_ARGUMENTS + 3] = more[3];
    PyObject *result = taken[HS_CALL_ARGUMENTS + 2] == NULL
                           ? NULL
                           : hs_py_pairs(module, taken, HS_CALL_ARGUMENTS + 4);
    Py_XDECREF(taken[HS_CALL_ARGUMENTS + 2]);
    Py_DECREF(taken[3]);
    return result;
}

PyObject *
hs_py_plain_count(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    PyObject *taken[HS_CALL_ARGUMENTS];
    if (n_arguments != HS_CALL_ARGUMENTS) {
        PyErr_Format(PyExc_TypeError, "plain_count takes %d arguments", HS_CALL_ARGUMENTS);
        return NULL;
    }
    if (!take_plain(arguments, taken)) {
        Py_RETURN_NOTIMPLEMENTED;
    }
    PyObject *result = hs_py_count_pairs(module, taken, HS_CALL_ARGUMENTS);
    Py_DECREF(taken[3]);
    return result;
}
