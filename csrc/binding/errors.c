/* SPDX-License-Identifier: BSD-3-Clause */
/* errors.c: see errors.h. Messages say what was wrong, the value, and what is allowed. */
#include "errors.h"

#include "environment.h"

#include <math.h>
#include <stdio.h>

/* PyErr_Format knows no floating-point numbers; repr does, and shortest. */
static PyObject *
raise_with_number(PyObject *type, const char *format, double value)
{
    PyObject *number = PyFloat_FromDouble(value);
    if (number != NULL) {
        PyErr_Format(type, format, number);
        Py_DECREF(number);
    }
    return NULL;
}

/* The argument that a failure's row is of. */
static const char *
set_of(const hs_failure *failure)
{
    return failure->in_queries ? "queries" : "points";
}

static PyObject *
raise_not_finite(const hs_failure *failure)
{
    PyObject *number = PyFloat_FromDouble(failure->value);
    if (number != NULL) {
        PyErr_Format(PyExc_ValueError, "%s must be finite, got %s[%lld, %lld] = %R",
                     set_of(failure), set_of(failure), (long long)failure->row,
                     (long long)failure->column, number);
        Py_DECREF(number);
    }
    return NULL;
}

static PyObject *
raise_of_row(const char *format, const hs_failure *failure)
{
    PyObject *number = PyFloat_FromDouble(failure->value);
    if (number != NULL) {
        PyErr_Format(PyExc_ValueError, format, (long long)failure->row, number);
        Py_DECREF(number);
    }
    return NULL;
}

static PyObject *
raise_box(const hs_failure *failure)
{
    PyObject *number = PyFloat_FromDouble(failure->value);
    if (number != NULL) {
        PyErr_Format(PyExc_ValueError, "box must be finite, got box[%lld, %lld] = %R",
                     (long long)failure->row, (long long)failure->column, number);
        Py_DECREF(number);
    }
    return NULL;
}

/* The same for entries of the box of one system out of many. */
static PyObject *
raise_box_of_system(const hs_failure *failure)
{
    PyObject *number = PyFloat_FromDouble(failure->value);
    if (number != NULL) {
        PyErr_Format(PyExc_ValueError, "box must be finite, got box[%lld, %lld, %lld] = %R",
                     (long long)failure->system, (long long)failure->row,
                     (long long)failure->column, number);
        Py_DECREF(number);
    }
    return NULL;
}

static PyObject *
raise_cutoff_of_system(const hs_failure *failure)
{
    PyObject *number = PyFloat_FromDouble(failure->value);
    if (number != NULL) {
        PyErr_Format(PyExc_ValueError,
                     "cutoff must be finite and not negative, got cutoff[%lld] = %R",
                     (long long)failure->system, number);
        Py_DECREF(number);
    }
    return NULL;
}

/* "box", or which one of many. */
static const char *
name_box(const hs_failure *failure, char *name, size_t size)
{
    if (failure->system < 0) {
        return "box";
    }
    snprintf(name, size, "box[%lld]", (long long)failure->system);
    return name;
}

static PyObject *
raise_dependent(const hs_failure *failure)
{
    char name[32];
    PyErr_Format(PyExc_ValueError,
                 "the periodic vectors of %s must be linearly independent; these are exactly "
                 "dependent",
                 name_box(failure, name, sizeof name));
    return NULL;
}

static PyObject *
raise_skewed(const hs_failure *failure)
{
    char name[32];
    PyErr_Format(PyExc_ValueError,
                 "%s is too skewed, or its vectors differ too much in length: float64 does not "
                 "place points along the short ones; give an equivalent, less skewed box, or one "
                 "along the coordinate axes",
                 name_box(failure, name, sizeof name));
    return NULL;
}

const char *
hs_format_bytes(double bytes, char *text, size_t size)
{
    static const char *const units[] = {"bytes", "kB", "MB", "GB"};
    int                      unit = 0;
    if (isinf(bytes)) {
        snprintf(text, size, "no more");
        return text;
    }
    for (; unit < 3 && bytes >= 999.5; unit++) {
        bytes /= 1e3;
    }
    snprintf(text, size, "%.3g %s", bytes, units[unit]);
    return text;
}

static PyObject *
raise_memory(const hs_failure *failure)
{
    char text[320], needed[32], search[32], limit[32];
    hs_format_bytes(failure->expected_bytes, needed, sizeof needed);
    const bool stored = failure->expected_bytes > 0.0; /* and not only counted */
    hs_format_bytes(failure->search_bytes, search, sizeof search);
    hs_format_bytes(failure->limit_bytes, limit, sizeof limit);
    if (isinf(failure->expected_bytes)) {
        snprintf(text, sizeof text,
                 "the result would not fit: the cutoff spans more images of the box than any "
                 "memory holds pairs; use a smaller cutoff");
    } else if (failure->search_bytes > 0.0) {
        snprintf(text, sizeof text,
                 "the search would not fit: about %.3g pairs%s%s%s are expected and the search "
                 "itself takes about %s, but %s %s",
                 failure->expected_pairs, stored ? " (" : "", stored ? needed : "",
                 stored ? ")" : "", search, limit,
                 isinf(failure->limit_bytes) ? "is to be had" : "are allowed");
    } else if (failure->expected_pairs == 0.0) { /* nothing is known of what is lacking */
        snprintf(text, sizeof text, "no memory for the search, its cells or its counts: %s %s",
                 limit, isinf(failure->limit_bytes) ? "is to be had" : "are allowed");
    } else {
        snprintf(text, sizeof text,
                 "the result would not fit: about %.3g pairs (%s) are expected, %s are allowed; "
                 "use a smaller cutoff, fewer quantities, iter_pairs or count_pairs",
                 failure->expected_pairs, needed, limit);
    }
    PyErr_SetString(PyExc_MemoryError, text);
    return NULL;
}

static PyObject *
raise_kernel(const hs_options *options)
{
    const char *names[8];
    const int   n = hs_kernel_names(names, 8);
    PyObject   *known = PyTuple_New(n);
    if (known == NULL) {
        return NULL;
    }
    for (int k = 0; k < n; k++) {
        PyObject *name = PyUnicode_FromString(names[k]);
        if (name == NULL) {
            Py_DECREF(known);
            return NULL;
        }
        PyTuple_SET_ITEM(known, k, name);
    }
    const char *name = options != NULL && options->kernel != NULL ? options->kernel : "";
    PyErr_Format(PyExc_ValueError, "kernel must be one of %R on this CPU, got '%.100s'%s", known,
                 name, name == hs_environment_kernel() ? " from HALFSHELL_KERNEL" : "");
    Py_DECREF(known);
    return NULL;
}

/* halfshell.CapacityError, which carries the number that was needed. */
static PyObject *
raise_capacity(const hs_failure *failure)
{
    const long long needed = (long long)failure->expected_pairs;
    PyObject       *module = PyImport_ImportModule("halfshell._errors");
    PyObject *type = module != NULL ? PyObject_GetAttrString(module, "CapacityError") : NULL;
    PyObject *message = PyUnicode_FromFormat(
        "out is too small: there are %lld pairs, and every array must have room for them", needed);
    if (type != NULL && message != NULL) {
        PyObject *error = PyObject_CallFunction(type, "OL", message, needed);
        if (error != NULL) {
            PyErr_SetObject(type, error);
            Py_DECREF(error);
        }
    }
    Py_XDECREF(module);
    Py_XDECREF(type);
    Py_XDECREF(message);
    return NULL;
}

PyObject *
hs_raise(hs_status status, const hs_failure *failure, const hs_options *options)
{
    switch (status) {
    case HS_ERR_MEMORY: return raise_memory(failure);
    case HS_ERR_CUTOFF:
        if (failure->system >= 0) {
            return raise_cutoff_of_system(failure);
        }
        return raise_with_number(PyExc_ValueError,
                                 "cutoff must be finite and not negative, got %R",
                                 failure->value);
    case HS_ERR_NOT_FINITE: return raise_not_finite(failure);
    case HS_ERR_BOX_FINITE:
        return failure->system >= 0 ? raise_box_of_system(failure) : raise_box(failure);
    case HS_ERR_BOX_DEPENDENT: return raise_dependent(failure);
    case HS_ERR_BOX_SKEWED: return raise_skewed(failure);
    case HS_ERR_TOO_MANY:
        return raise_with_number(PyExc_OverflowError,
                                 "fewer than 2**31 points and systems and 2**62 pairs can be "
                                 "searched, got %R",
                                 failure->value);
    case HS_ERR_EDGES:
        return raise_of_row(
            "edges must be finite, not negative and ascending, got edges[%lld] = %R", failure);
    case HS_ERR_TYPES:
        return raise_of_row(failure->in_queries
                                ? "types must be from 0 on, got query_types[%lld] = %R"
                                : "types must be from 0 on, got types[%lld] = %R",
                            failure);
    case HS_ERR_WEIGHTS:
        return raise_of_row(failure->in_queries
                                ? "query_weights must be finite, got query_weights[%lld] = %R"
                                : "weights must be finite, got weights[%lld] = %R",
                            failure);
    case HS_ERR_SHIFT_RANGE:
        PyErr_Format(PyExc_OverflowError,
                     "%s[%lld] lies too many box vectors away, or a point that it pairs with does: "
                     "shifts are counted up to 2**51, and S holds 2**31; wrap the points first",
                     set_of(failure), (long long)failure->row);
        return NULL;
    case HS_ERR_ROUNDING:
        PyErr_Format(PyExc_OverflowError,
                     "%s[%lld] lies so far from the box, or the box is so skewed, that rounding "
                     "errors of precision='double' pass the cutoff; wrap the points first, or "
                     "use precision='exact'",
                     set_of(failure), (long long)failure->row);
        return NULL;
    case HS_ERR_KERNEL: return raise_kernel(options);
    case HS_ERR_FAR:
        PyErr_SetString(PyExc_ValueError,
                        "queries lie too far from the points and the box for cells that were made "
                        "without them: query() or pairs_between() have no such limit");
        return NULL;
    case HS_ERR_CAPACITY: return raise_capacity(failure);
    case HS_ERR_INTERRUPTED:
        if (!PyErr_Occurred()) {
            PyErr_SetString(PyExc_SystemError, "interrupted without an exception");
        }
        return NULL;
    case HS_ERR_ARGUMENT: /* Python's arguments are checked before: these are for whatever passes */
        PyErr_SetString(PyExc_ValueError, hs_status_text(status));
        return NULL;
    case HS_OK:
    case HS_STATUS_END: break;
    }
    PyErr_Format(PyExc_SystemError, "unmapped status %d: %s", (int)status,
                 hs_status_text(status));
    return NULL;
}
