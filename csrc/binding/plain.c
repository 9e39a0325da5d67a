/* SPDX-License-Identifier: BSD-3-Clause */
/* plain.c: looks at types and shapes only, so that no code of the arguments runs. */
#include "plain.h"

#include "../halfshell.h"

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

int
hs_plain_index_bytes(PyObject *object)
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

/* An argument of the function's own. */
static bool
is_plain(char letter, PyObject *object, int ndim)
{
    switch (letter) {
    case 's': return is_flag(object);
    case 'b': return hs_plain_index_bytes(object) != IS_NOT_PLAIN;
    case 'Q':
    case 'R': return object == Py_None || dimensions_of(object) == ndim;
    default: return true;
    }
}

bool
hs_plain_repeats(PyObject *const *arguments, const char *more, PyObject *const *own,
                 unsigned long *repeats)
{
    const int  ndim = dimensions_of(arguments[0]);
    PyObject  *box = arguments[2];
    const bool has_box = box != Py_None;
    if (ndim == IS_NOT_PLAIN || !PyFloat_Check(arguments[1]) || !is_flag(arguments[4]) ||
        !(arguments[8] == Py_None || PyCallable_Check(arguments[8])) ||
        (has_box && !is_plain_box(box, ndim))) {
        return false;
    }
    for (int k = 0; more[k] != '\0' && more[k] != 'h' && more[k] != 'g' && more[k] != 'c'; k++) {
        if (!is_plain(more[k], own[k], ndim)) {
            return false;
        }
    }
    const int bits = periodic_bits(arguments[3], has_box, ndim);
    *repeats = (unsigned long)bits;
    return bits != IS_NOT_PLAIN;
}
