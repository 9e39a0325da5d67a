/* SPDX-License-Identifier: BSD-3-Clause */
/* plain.c: see plain.h. Nothing here raises but for a wrong number of arguments. */
#include "plain.h"

#include "py_call.h"
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

/* Puts periodic as the core's functions take it in place of the argument: a new reference, where
 * the others stay borrowed. False when some that all searches share are not plain. */
static bool
take_shared(PyObject *const *arguments, PyObject **taken)
{
    const int ndim = dimensions_of(arguments[0]);
    PyObject *box = arguments[2];
    if (ndim == IS_NOT_PLAIN || !PyFloat_Check(arguments[1]) || !is_flag(arguments[4]) ||
        !(arguments[8] == Py_None || PyCallable_Check(arguments[8])) ||
        !(box == Py_None || is_plain_box(box, ndim))) {
        return false;
    }
    const int bits = periodic_bits(arguments[3], box != Py_None, ndim);
    if (bits == IS_NOT_PLAIN) {
        return false;
    }
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

/* A function of the core, and where its arguments beyond those of py_call.h are; 0: nowhere. */
typedef struct plain_form {
    const char *name;
    PyObject *(*function)(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
    int n_arguments;
    int sort;
    int index_dtype;
    int queries;
} plain_form;

enum { MOST_ARGUMENTS = HS_CALL_ARGUMENTS + 5 };

static bool
is_plain_rest(const plain_form *form, PyObject *const *arguments)
{
    PyObject *queries = form->queries > 0 ? arguments[form->queries] : Py_None;
    return (form->sort == 0 || is_flag(arguments[form->sort])) &&
           (queries == Py_None || (dimensions_of(queries) != IS_NOT_PLAIN &&
                                   dimensions_of(queries) == dimensions_of(arguments[0])));
}

static PyObject *
call_plain(const plain_form *form, PyObject *module, PyObject *const *arguments,
           Py_ssize_t n_arguments)
{
    PyObject *taken[MOST_ARGUMENTS], *index_bytes = NULL, *result = NULL;
    if (!hs_expect_arguments(form->name, n_arguments, form->n_arguments)) {
        return NULL;
    }
    memcpy(taken, arguments, (size_t)n_arguments * sizeof *taken);
    const int bytes = form->index_dtype > 0 ? index_bytes_of(arguments[form->index_dtype]) : 0;
    if (bytes == IS_NOT_PLAIN || !is_plain_rest(form, arguments) ||
        !take_shared(arguments, taken)) {
        Py_RETURN_NOTIMPLEMENTED;
    }
    if (form->index_dtype > 0) {
        taken[form->index_dtype] = index_bytes = PyLong_FromLong(bytes);
    }
    if (form->index_dtype == 0 || index_bytes != NULL) {
        result = form->function(module, taken, n_arguments);
    }
    Py_XDECREF(index_bytes);
    Py_DECREF(taken[3]);
    return result;
}

PyObject *
hs_py_plain_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    static const plain_form form = {.name = "plain_pairs",
                                    .function = hs_py_pairs,
                                    .n_arguments = HS_CALL_ARGUMENTS + 4,
                                    .sort = HS_CALL_ARGUMENTS + 1,
                                    .index_dtype = HS_CALL_ARGUMENTS + 2};
    return call_plain(&form, module, arguments, n_arguments);
}

PyObject *
hs_py_plain_count(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    static const plain_form form = {
        .name = "plain_count", .function = hs_py_count_pairs, .n_arguments = HS_CALL_ARGUMENTS};
    return call_plain(&form, module, arguments, n_arguments);
}

PyObject *
hs_py_plain_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    static const plain_form form = {.name = "plain_between",
                                    .function = hs_py_pairs_between,
                                    .n_arguments = HS_CALL_ARGUMENTS + 5,
                                    .sort = HS_CALL_ARGUMENTS + 1,
                                    .index_dtype = HS_CALL_ARGUMENTS + 2,
                                    .queries = HS_CALL_ARGUMENTS + 4};
    return call_plain(&form, module, arguments, n_arguments);
}

PyObject *
hs_py_plain_neighbors(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    static const plain_form form = {.name = "plain_neighbors",
                                    .function = hs_py_neighbors,
                                    .n_arguments = HS_CALL_ARGUMENTS + 3,
                                    .index_dtype = HS_CALL_ARGUMENTS + 1,
                                    .queries = HS_CALL_ARGUMENTS + 2};
    return call_plain(&form, module, arguments, n_arguments);
}

PyObject *
hs_py_plain_count_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    static const plain_form form = {.name = "plain_count_between",
                                    .function = hs_py_count_between,
                                    .n_arguments = HS_CALL_ARGUMENTS + 1,
                                    .queries = HS_CALL_ARGUMENTS};
    return call_plain(&form, module, arguments, n_arguments);
}

PyObject *
hs_py_plain_coordination(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    static const plain_form form = {.name = "plain_coordination",
                                    .function = hs_py_coordination,
                                    .n_arguments = HS_CALL_ARGUMENTS + 1,
                                    .queries = HS_CALL_ARGUMENTS};
    return call_plain(&form, module, arguments, n_arguments);
}
