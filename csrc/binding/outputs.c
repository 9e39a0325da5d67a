/* SPDX-License-Identifier: BSD-3-Clause */
/* outputs.c: one table of letters, from which arrays are checked and made. */
#include "outputs.h"

#include "errors.h"

#include <string.h>

/* Bytes from which an array keeps the memory that the search wrote it to; smaller ones are copied,
 * so that what they were written to can be used again at once. */
#define OWN_BYTES ((size_t)256 << 10)

/* What the array of a letter looks like. */
typedef struct array_form {
    unsigned which; /* HS_WANT_ bit */
    int      type;  /* of NumPy */
    npy_intp width; /* entries a row, or 0 for one number a pair */
    size_t   bytes; /* of a row */
} array_form;

static array_form
form_of(char letter, int ndim, int index_bytes)
{
    const int    index_type = index_bytes == 8 ? NPY_INT64 : NPY_INT32;
    const size_t index = (size_t)index_bytes, d = (size_t)ndim;
    switch (letter) {
    case 'i': return (array_form){HS_WANT_I, index_type, 0, index};
    case 'j': return (array_form){HS_WANT_J, index_type, 0, index};
    case 'd': return (array_form){HS_WANT_DISTANCE, NPY_DOUBLE, 0, sizeof(double)};
    case 'D': return (array_form){HS_WANT_VECTOR, NPY_DOUBLE, ndim, d * sizeof(double)};
    case 'S': return (array_form){HS_WANT_SHIFT, NPY_INT32, ndim, d * sizeof(int32_t)};
    case 'k': return (array_form){HS_WANT_SHELL, NPY_INT32, 0, sizeof(int32_t)};
    default: return (array_form){HS_WANT_BOTH, index_type, 2, 2 * index};
    }
}

static void
free_array(PyObject *capsule)
{
    hs_array_free(PyCapsule_GetPointer(capsule, NULL));
}

/* An array over memory of the core; takes ownership of it, also on failure. */
static PyObject *
array_over(void *data, int n_dimensions, npy_intp *shape, int type)
{
    PyObject *capsule = PyCapsule_New(data, NULL, free_array);
    if (capsule == NULL) {
        hs_array_free(data);
        return NULL;
    }
    PyObject *array = PyArray_SimpleNewFromData(n_dimensions, shape, type, data);
    if (array == NULL) {
        Py_DECREF(capsule);
    } else if (PyArray_SetBaseObject((PyArrayObject *)array, capsule) < 0) {
        Py_CLEAR(array); /* the capsule was given up either way */
    }
    return array;
}

PyObject *
hs_array_like(const void *data, int n_dimensions, npy_intp *shape, int type)
{
    PyObject *array = PyArray_SimpleNew(n_dimensions, shape, type);
    if (array != NULL && PyArray_NBYTES((PyArrayObject *)array) > 0) {
        memcpy(PyArray_DATA((PyArrayObject *)array), data,
               (size_t)PyArray_NBYTES((PyArrayObject *)array));
    }
    return array;
}

static PyObject *
new_array(hs_pairs *pairs, array_form form)
{
    npy_intp     shape[2] = {(npy_intp)hs_pairs_length(pairs), form.width};
    const int    n_dimensions = form.width > 0 ? 2 : 1;
    const size_t bytes = form.bytes * (size_t)shape[0];
    if (bytes >= OWN_BYTES) {
        return array_over(hs_pairs_take(pairs, form.which), n_dimensions, shape, form.type);
    }
    return hs_array_like(hs_pairs_array(pairs, form.which), n_dimensions, shape, form.type);
}

static PyObject *
new_offsets(hs_pairs *rows)
{
    npy_intp     length = (npy_intp)hs_pairs_rows(rows) + 1;
    const size_t bytes = (size_t)length * sizeof(int64_t);
    if (bytes >= OWN_BYTES) {
        return array_over(hs_pairs_take_offsets(rows), 1, &length, NPY_INT64);
    }
    return hs_array_like(hs_pairs_offsets(rows), 1, &length, NPY_INT64);
}

PyObject *
hs_arrays_of(hs_pairs *pairs, const char *letters, int ndim, int index_bytes, bool is_table)
{
    const Py_ssize_t n = (Py_ssize_t)strlen(letters), n_before = is_table ? 1 : 0;
    if (n == 1 && !is_table) {
        return new_array(pairs, form_of(letters[0], ndim, index_bytes));
    }
    PyObject *tuple = PyTuple_New(n_before + n);
    if (tuple != NULL && is_table) {
        hs_tuple_put(&tuple, 0, new_offsets(pairs));
    }
    for (Py_ssize_t k = 0; tuple != NULL && k < n; k++) {
        hs_tuple_put(&tuple, n_before + k,
                     new_array(pairs, form_of(letters[k], ndim, index_bytes)));
    }
    return is_table ? hs_read_only(tuple) : tuple;
}

PyObject *
hs_read_only(PyObject *arrays)
{
    for (Py_ssize_t k = 0; arrays != NULL && k < PyTuple_GET_SIZE(arrays); k++) {
        PyArray_CLEARFLAGS((PyArrayObject *)PyTuple_GET_ITEM(arrays, k), NPY_ARRAY_WRITEABLE);
    }
    return arrays;
}

/* Checks one array of `out`; returns how many pairs it holds, or -1 with an exception set. */
static npy_intp
check_array(PyObject *object, char letter, array_form form)
{
    if (!PyArray_Check(object)) {
        PyErr_Format(PyExc_TypeError, "out must hold arrays, got %s for '%c'",
                     Py_TYPE(object)->tp_name, letter);
        return -1;
    }
    PyArrayObject *array = (PyArrayObject *)object;
    if (PyArray_TYPE(array) != form.type || PyArray_ISBYTESWAPPED(array)) {
        PyArray_Descr *wanted = PyArray_DescrFromType(form.type);
        PyErr_Format(PyExc_TypeError, "out for '%c' must have dtype %S, got %S", letter,
                     (PyObject *)wanted, (PyObject *)PyArray_DESCR(array));
        Py_XDECREF(wanted);
        return -1;
    }
    const int n_dimensions = form.width > 0 ? 2 : 1;
    if (PyArray_NDIM(array) != n_dimensions ||
        (form.width > 0 && PyArray_DIM(array, 1) != form.width)) {
        if (form.width > 0) {
            PyErr_Format(PyExc_ValueError, "out for '%c' must have shape (m, %zd)", letter,
                         (Py_ssize_t)form.width);
        } else {
            PyErr_Format(PyExc_ValueError, "out for '%c' must have shape (m,)", letter);
        }
        return -1;
    }
    if (!PyArray_ISCARRAY(array)) {
        PyErr_Format(PyExc_ValueError, "out for '%c' must be C-contiguous, aligned and writable",
                     letter);
        return -1;
    }
    return PyArray_DIM(array, 0);
}

/* The array of letter k; borrowed. NULL with an exception set. */
static PyObject *
item_of(PyObject *out, Py_ssize_t k, Py_ssize_t n)
{
    if (n == 1 && !PyTuple_Check(out)) {
        return out;
    }
    if (!PyTuple_Check(out) || PyTuple_GET_SIZE(out) != n) {
        PyErr_Format(PyExc_TypeError,
                     "out must be a tuple of arrays, one for each of the %zd quantities", n);
        return NULL;
    }
    return PyTuple_GET_ITEM(out, k);
}

/* The bytes that an array reaches over, whatever its strides; false if it has none. */
static bool
range_of(PyArrayObject *array, const char **first, const char **end)
{
    *first = PyArray_BYTES(array);
    *end = *first + PyArray_ITEMSIZE(array);
    for (int k = 0; k < PyArray_NDIM(array); k++) {
        const npy_intp steps = PyArray_DIM(array, k) - 1, stride = PyArray_STRIDE(array, k);
        if (steps < 0) {
            return false;
        }
        *first += stride < 0 ? steps * stride : 0;
        *end += stride > 0 ? steps * stride : 0;
    }
    return true;
}

/* Whether two arrays may share memory: compares where they begin and end. */
static bool
overlap(PyObject *a, PyObject *b)
{
    const char *first, *end, *other_first, *other_end;
    return range_of((PyArrayObject *)a, &first, &end) &&
           range_of((PyArrayObject *)b, &other_first, &other_end) && first < other_end &&
           other_first < end;
}

bool
hs_out_of(PyObject *out, const char *letters, int ndim, int index_bytes, hs_pair_arrays *arrays)
{
    const Py_ssize_t n = (Py_ssize_t)strlen(letters);
    *arrays = (hs_pair_arrays){.capacity = INT64_MAX, .index_bytes = index_bytes};
    for (Py_ssize_t k = 0; k < n; k++) {
        const array_form form = form_of(letters[k], ndim, index_bytes);
        PyObject        *item = item_of(out, k, n);
        const npy_intp   capacity = item == NULL ? -1 : check_array(item, letters[k], form);
        if (capacity < 0) {
            return false;
        }
        for (Py_ssize_t l = 0; l < k; l++) {
            if (overlap(item, item_of(out, l, n))) { /* each would overwrite the other */
                PyErr_SetString(PyExc_ValueError, "the arrays of out must not overlap");
                return false;
            }
        }
        arrays->capacity = capacity < arrays->capacity ? capacity : arrays->capacity;
        void *data = PyArray_DATA((PyArrayObject *)item);
        switch (form.which) {
        case HS_WANT_I: arrays->i = data; break;
        case HS_WANT_J: arrays->j = data; break;
        case HS_WANT_DISTANCE: arrays->distance = data; break;
        case HS_WANT_VECTOR: arrays->vector = data; break;
        case HS_WANT_SHIFT: arrays->shift = data; break;
        case HS_WANT_SHELL: arrays->shell = data; break;
        default: arrays->both = data; break;
        }
    }
    return true;
}

bool
hs_out_is_apart(PyObject *out, const char *letters, PyObject *input)
{
    const Py_ssize_t n = (Py_ssize_t)strlen(letters);
    bool             is_apart = true;
    for (Py_ssize_t k = 0; PyArray_Check(input) && k < n; k++) {
        is_apart = is_apart && !overlap(item_of(out, k, n), input);
    }
    return is_apart;
}

/* The first rows of an array, as a plain array: subclasses may have slices of their own. */
static PyObject *
front_of(PyArrayObject *array, npy_intp n_rows)
{
    npy_intp       shape[2] = {n_rows, PyArray_NDIM(array) > 1 ? PyArray_DIM(array, 1) : 0};
    PyArray_Descr *type = PyArray_DESCR(array);
    Py_INCREF(type); /* given away on the next line */
    PyObject *view = PyArray_NewFromDescr(&PyArray_Type, type, PyArray_NDIM(array), shape, NULL,
                                          PyArray_DATA(array), NPY_ARRAY_CARRAY, NULL);
    if (view == NULL) {
        return NULL;
    }
    Py_INCREF(array); /* given away too, also on failure */
    if (PyArray_SetBaseObject((PyArrayObject *)view, (PyObject *)array) < 0) {
        Py_CLEAR(view);
    }
    return view;
}

/* The filled parts of these arrays, in the same form. */
static PyObject *
out_filled(PyObject *out, const char *letters, int64_t n_pairs)
{
    const Py_ssize_t n = (Py_ssize_t)strlen(letters);
    if (n == 1) {
        return front_of((PyArrayObject *)item_of(out, 0, 1), (npy_intp)n_pairs);
    }
    PyObject *result = PyTuple_New(n);
    for (Py_ssize_t k = 0; result != NULL && k < n; k++) {
        PyArrayObject *array = (PyArrayObject *)item_of(out, k, n);
        hs_tuple_put(&result, k, front_of(array, (npy_intp)n_pairs));
    }
    return result;
}

PyObject *
hs_py_call_pairs(hs_py_call *call, hs_status status, hs_pairs *pairs, bool is_table)
{
    if (!hs_py_call_done(call, status)) {
        return NULL;
    }
    PyObject *arrays = call->out != NULL
                           ? out_filled(call->out, call->letters, hs_pairs_length(pairs))
                           : hs_arrays_of(pairs, call->letters, call->points.at.ndim,
                                          call->options.index_bytes, is_table);
    hs_pairs_free(pairs);
    return arrays;
}

PyObject *
hs_py_call_filled(hs_py_call *call, hs_status status, PyObject *array)
{
    if (!hs_py_call_done(call, status)) {
        Py_CLEAR(array);
    }
    return array;
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

bool
hs_dict_put(PyObject *dict, const char *key, PyObject *value)
{
    const bool done = value != NULL && PyDict_SetItemString(dict, key, value) == 0;
    Py_XDECREF(value);
    return done;
}
