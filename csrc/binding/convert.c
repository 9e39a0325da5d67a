/* SPDX-License-Identifier: BSD-3-Clause */
/* convert.c: Python objects to views, without copying what is right already. */
#include "convert.h"

#include "foreign.h"

#include <string.h>

bool
hs_points_of(PyObject *object, const char *name, hs_points *points)
{
    if (!PyArray_Check(object)) {
        PyErr_Format(PyExc_TypeError, "%s must be an array, got %s", name,
                     Py_TYPE(object)->tp_name);
        return false;
    }
    PyArrayObject *array = (PyArrayObject *)object;
    const int      type = PyArray_TYPE(array);
    if ((type != NPY_FLOAT && type != NPY_DOUBLE) || PyArray_ISBYTESWAPPED(array)) {
        PyErr_Format(PyExc_TypeError, "%s must be native float32 or float64", name);
        return false;
    }
    if (PyArray_NDIM(array) != 2) {
        PyErr_Format(PyExc_ValueError, "%s must have shape (n, d), got %d dimension%s", name,
                     PyArray_NDIM(array), PyArray_NDIM(array) == 1 ? "" : "s");
        return false;
    }
    const npy_intp d = PyArray_DIM(array, 1);
    if (d < 1 || d > HS_MAX_DIM) {
        PyErr_Format(PyExc_ValueError, "%s must have shape (n, d) with 1 <= d <= %d, got d = %zd",
                     name, HS_MAX_DIM, (Py_ssize_t)d);
        return false;
    }
    *points = (hs_points){.data = PyArray_DATA(array),
                          .n = PyArray_DIM(array, 0),
                          .ndim = (int)d,
                          .real = type == NPY_FLOAT ? HS_FLOAT32 : HS_FLOAT64,
                          .row_stride = PyArray_STRIDE(array, 0),
                          .column_stride = PyArray_STRIDE(array, 1)};
    return true;
}

bool
hs_is_array(PyObject *object, int type, int n_axes)
{
    PyArrayObject *array = (PyArrayObject *)object;
    return PyArray_Check(object) && PyArray_TYPE(array) == type && PyArray_ISCARRAY_RO(array) &&
           PyArray_NDIM(array) == n_axes;
}

hs_cells *
hs_cells_of(PyObject *object)
{
    return PyCapsule_IsValid(object, HS_CELLS_NAME) ? PyCapsule_GetPointer(object, HS_CELLS_NAME)
                                                    : NULL;
}

bool
hs_repeats_of(PyObject *periodic, unsigned long *repeats)
{
    *repeats = PyLong_AsUnsignedLong(periodic);
    return *repeats != (unsigned long)-1 || !PyErr_Occurred();
}

bool
hs_box_of(PyObject *object, unsigned long repeats, int ndim, hs_box *box, bool *given)
{
    *given = object != Py_None;
    if (!*given) {
        return true;
    }
    PyArrayObject *array = (PyArrayObject *)object;
    const bool     has_rows = hs_is_array(object, NPY_DOUBLE, 2);
    if ((!has_rows && !hs_is_array(object, NPY_DOUBLE, 1)) || PyArray_DIM(array, 0) != ndim ||
        (has_rows && PyArray_DIM(array, 1) != ndim)) {
        PyErr_Format(PyExc_ValueError, "box must be a float64 array of shape (%d, %d)", ndim, ndim);
        return false;
    }
    const double *entries = PyArray_DATA(array);
    box->ndim = ndim;
    for (int l = 0; l < ndim; l++) {
        box->periodic[l] = (repeats >> l & 1) != 0;
        for (int k = 0; k < ndim; k++) {
            box->rows[l][k] = has_rows ? entries[l * ndim + k] : k == l ? entries[l] : 0.0;
        }
    }
    return true;
}

/* The bit of a letter of HS_LETTERS is its HS_WANT_ bit. */
_Static_assert(HS_WANT_I == 1 && HS_WANT_J == 2 && HS_WANT_DISTANCE == 4 && HS_WANT_VECTOR == 8 &&
                   HS_WANT_SHIFT == 16 && HS_WANT_BOTH == 32 && HS_WANT_SHELL == 64,
               "hs_quantities_of counts on this");

/* Names the letters that are known. */
static void
refuse_quantities(const char *known, PyObject *object)
{
    char   text[160] = "quantities must be some of the letters ";
    size_t n = strlen(text);
    for (const char *letter = known; *letter != '\0'; letter++) {
        text[n++] = *letter;
        text[n++] = letter[1] != '\0' ? ' ' : ',';
    }
    strcpy(text + n, " each at most once");
    if (strchr(known, 'i') == NULL) {
        strcat(text, " (i is the row itself)");
    }
    hs_refuse(PyExc_ValueError, text, object);
}

bool
hs_quantities_of(PyObject *object, const char *known, const char **letters, unsigned *want)
{
    unsigned seen = 0;
    if (!PyUnicode_Check(object)) {
        PyErr_Format(PyExc_TypeError, "quantities must be a string, got %s",
                     Py_TYPE(object)->tp_name);
        return false;
    }
    if (!hs_name_of(object, "quantities", letters)) {
        return false;
    }
    for (const char *letter = *letters; *letter != '\0'; letter++) {
        const bool     is_known = strchr(known, *letter) != NULL;
        const unsigned bit = is_known ? 1u << (strchr(HS_LETTERS, *letter) - HS_LETTERS) : 0;
        if (bit == 0 || (seen & bit)) {
            seen = 0;
            break;
        }
        seen |= bit;
    }
    *want = seen;
    if (seen == 0) {
        refuse_quantities(known, object);
    }
    return seen != 0;
}

/* The number of the name that it is; -1 with an exception that says what it must be. */
static int
number_of_name(PyObject *object, const char *const *names, int n, const char *must_be)
{
    for (int k = 0; PyUnicode_Check(object) && k < n; k++) {
        if (PyUnicode_CompareWithASCIIString(object, names[k]) == 0) {
            return k;
        }
    }
    hs_refuse(PyUnicode_Check(object) ? PyExc_ValueError : PyExc_TypeError, must_be, object);
    return -1;
}

bool
hs_precision_of(PyObject *object, hs_precision *precision)
{
    static const char *const names[] = {"exact", "double", "single"};
    const int                k =
        number_of_name(object, names, 3, "precision must be 'exact', 'double' or 'single'");
    *precision = k >= 0 ? (hs_precision)k : HS_EXACT;
    return k >= 0;
}

const char *const hs_algorithm_names[HS_ALGORITHM_END] = {
    [HS_AUTO] = "auto", [HS_ALL_PAIRS] = "all-pairs", [HS_GRID] = "grid",
    [HS_HASH] = "hash", [HS_HIERARCHY] = "hierarchy",
};

bool
hs_algorithm_of(PyObject *object, hs_algorithm *algorithm)
{
    const int k =
        number_of_name(object, hs_algorithm_names, HS_ALGORITHM_END,
                       "algorithm must be 'auto', 'all-pairs', 'grid', 'hash' or 'hierarchy'");
    *algorithm = k >= 0 ? (hs_algorithm)k : HS_AUTO;
    return k >= 0;
}

bool
hs_name_of(PyObject *object, const char *argument, const char **name)
{
    *name = NULL;
    if (object == Py_None) {
        return true;
    }
    if (!PyUnicode_Check(object)) {
        PyErr_Format(PyExc_TypeError, "%s must be a string or None, got %s", argument,
                     Py_TYPE(object)->tp_name);
        return false;
    }
    Py_ssize_t length;
    *name = PyUnicode_AsUTF8AndSize(object, &length);
    if (*name == NULL && PyErr_ExceptionMatches(PyExc_UnicodeError)) {
        PyErr_Clear();
        PyErr_Format(PyExc_ValueError, "%s must not contain lone surrogates", argument);
    }
    if (*name != NULL && strlen(*name) != (size_t)length) {
        PyErr_Format(PyExc_ValueError, "%s must not contain null characters", argument);
        return false;
    }
    return *name != NULL;
}

bool
hs_cutoff_of(PyObject *object, double *cutoff)
{
    *cutoff = PyFloat_AsDouble(object);
    return PyErr_Occurred() == NULL; /* the number is not compared: that might trap */
}
