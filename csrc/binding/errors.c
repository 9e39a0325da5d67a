/* SPDX-License-Identifier: BSD-3-Clause */
/* errors.c: a function for each status. Messages say what was wrong, the value, and what is
 * allowed. */
#include "errors.h"

#include "environment.h"
#include "tuples.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

/* Raises the text of `format`, which the number follows: PyErr_Format knows no floating-point
 * numbers; repr does, and shortest. */
static PyObject *
raise_number(PyObject *type, double value, const char *format, ...)
{
    char      text[256];
    PyObject *number = PyFloat_FromDouble(value);
    va_list   arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (number != NULL) {
        PyErr_Format(type, "%s%R", text, number);
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
    const char *set = set_of(failure);
    return raise_number(PyExc_ValueError, failure->value,
                        "%s must be finite, got %s[%lld, %lld] = ", set, set,
                        (long long)failure->row, (long long)failure->column);
}

static PyObject *
raise_box(const hs_failure *failure)
{
    const long long system = failure->system, row = failure->row, column = failure->column;
    return system < 0 ? raise_number(PyExc_ValueError, failure->value,
                                     "box must be finite, got box[%lld, %lld] = ", row, column)
                      : raise_number(PyExc_ValueError, failure->value,
                                     "box must be finite, got box[%lld, %lld, %lld] = ", system,
                                     row, column);
}

static PyObject *
raise_cutoff(const hs_failure *failure)
{
    return failure->system < 0
               ? raise_number(PyExc_ValueError, failure->value,
                              "cutoff must be finite and not negative, got ")
               : raise_number(PyExc_ValueError, failure->value,
                              "cutoff must be finite and not negative, got cutoff[%lld] = ",
                              (long long)failure->system);
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
    char        name[32];
    const char *box = name_box(failure, name, sizeof name);
    return failure->row >= 0
               ? PyErr_Format(PyExc_ValueError,
                              "vector %lld of %s is zero; make that axis not periodic",
                              (long long)failure->row, box)
               : PyErr_Format(PyExc_ValueError,
                              "the periodic vectors of %s must be linearly independent; these are "
                              "exactly dependent",
                              box);
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
    for (; unit < 3 && bytes >= 999.5; unit++) {
        bytes /= 1e3;
    }
    snprintf(text, size, "%.3g %s", bytes, units[unit]);
    return text;
}

const char *
hs_format_limit(double bytes, char *text, size_t size)
{
    char allowed[32];
    if (isinf(bytes)) {
        snprintf(text, size, "the system has no more memory");
    } else {
        snprintf(text, size, "%s are allowed", hs_format_bytes(bytes, allowed, sizeof allowed));
    }
    return text;
}

bool
hs_took_more(const hs_failure *failure)
{
    return !isinf(failure->limit_bytes) &&
           failure->expected_bytes + failure->search_bytes <= failure->limit_bytes;
}

static PyObject *
raise_memory(const hs_failure *failure)
{
    char text[320], pairs[80], bytes[32], search[32], limit[48];
    snprintf(pairs, sizeof pairs, "about %.3g pairs", failure->expected_pairs);
    if (failure->expected_bytes > 0.0) { /* they were to be stored, and not only counted */
        snprintf(pairs, sizeof pairs, "about %.3g pairs (%s)", failure->expected_pairs,
                 hs_format_bytes(failure->expected_bytes, bytes, sizeof bytes));
    }
    hs_format_bytes(failure->search_bytes, search, sizeof search);
    hs_format_limit(failure->limit_bytes, limit, sizeof limit);
    if (isinf(failure->expected_bytes)) {
        snprintf(text, sizeof text,
                 "the result would not fit: the cutoff spans more images of the box than there "
                 "could be pairs in any memory; use a smaller cutoff");
    } else if (failure->search_bytes > 0.0 && hs_took_more(failure)) {
        snprintf(text, sizeof text,
                 "the search would not fit: it needs more than the %s that are allowed; "
                 "%s and %s for the search itself were expected",
                 hs_format_bytes(failure->limit_bytes, bytes, sizeof bytes), pairs, search);
    } else if (failure->search_bytes > 0.0) {
        snprintf(text, sizeof text,
                 "the search would not fit: %s are expected and the search itself takes about %s, "
                 "but %s",
                 pairs, search, limit);
    } else if (failure->expected_pairs == 0.0) { /* nothing is known of what is lacking */
        snprintf(text, sizeof text, "out of memory for the search, its cells or counts: %s", limit);
    } else {
        snprintf(text, sizeof text,
                 "the result would not fit: %s are expected, %s%s; "
                 "use a smaller cutoff, fewer quantities, iter_pairs or count_pairs",
                 pairs, limit, hs_took_more(failure) ? " for them and the search" : "");
    }
    PyErr_SetString(PyExc_MemoryError, text);
    return NULL;
}

static PyObject *
raise_kernel(const hs_options *options)
{
    const char *names[8];
    PyObject   *known = hs_tuple_of_names(names, hs_kernel_names(names, 8));
    if (known == NULL) {
        return NULL;
    }
    const char *name = options != NULL && options->kernel != NULL ? options->kernel : "";
    PyErr_Format(PyExc_ValueError, "kernel must be one of %R on this CPU, got '%.100s'%s", known,
                 name, name == hs_environment_kernel() ? " from HALFSHELL_KERNEL" : "");
    Py_DECREF(known);
    return NULL;
}

/* halfshell.CapacityError, which carries the number that was needed. */
void
hs_raise_capacity(int64_t capacity, int64_t needed)
{
    static const char *const        of_room = "capacity is %lld, but there are %lld pairs",
                             *const of_out =
                                 "out is too small: there are %lld pairs, each array needs room "
                                 "for all";
    const long long n = (long long)needed, most = (long long)capacity;
    PyObject       *module = PyImport_ImportModule("halfshell._errors");
    PyObject       *type = module != NULL ? PyObject_GetAttrString(module, "CapacityError") : NULL;
    PyObject       *message = capacity != 0 ? PyUnicode_FromFormat(of_room, most, n)
                                            : PyUnicode_FromFormat(of_out, n);
    if (type != NULL && message != NULL) {
        PyObject *error = PyObject_CallFunction(type, "OL", message, n);
        if (error != NULL) {
            PyErr_SetObject(type, error);
            Py_DECREF(error);
        }
    }
    Py_XDECREF(module);
    Py_XDECREF(type);
    Py_XDECREF(message);
}

static PyObject *
raise_capacity(const hs_failure *failure)
{
    hs_raise_capacity(0, hs_pairs_needed(failure));
    return NULL;
}

static PyObject *
raise_too_many(const hs_failure *failure)
{
    return raise_number(
        PyExc_OverflowError, failure->value,
        "fewer than 2**31 points and systems and 2**62 pairs can be searched, got ");
}

static PyObject *
raise_edges(const hs_failure *failure)
{
    return raise_number(PyExc_ValueError, failure->value,
                        "edges must be finite, not negative and ascending, got edges[%lld] = ",
                        (long long)failure->row);
}

static PyObject *
raise_types(const hs_failure *failure)
{
    const char *name = failure->in_queries ? "query_types" : "types";
    PyErr_Format(PyExc_ValueError,
                 "%s must be from 0 on and below the number of types, got %s[%lld] = %lld", name,
                 name, (long long)failure->row, (long long)failure->value);
    return NULL;
}

static PyObject *
raise_radii(const hs_failure *failure)
{
    const char *name = failure->in_queries ? "query_radii" : "radii";
    return raise_number(PyExc_ValueError, failure->value,
                        "%s must be finite, not negative, and of ordinary size, got %s[%lld] = ",
                        name, name, (long long)failure->row);
}

static PyObject *
raise_weights(const hs_failure *failure)
{
    const char *name = failure->in_queries ? "query_weights" : "weights";
    return raise_number(PyExc_ValueError, failure->value,
                        "%s must be finite, got %s[%lld] = ", name, name, (long long)failure->row);
}

static PyObject *
raise_supports(const hs_failure *failure)
{
    const char *name = failure->in_queries ? "query_supports" : "supports";
    PyErr_Format(PyExc_ValueError,
                 "%s must be finite, symmetric and positive definite; %s[%lld] is not, for "
                 "exactly the numbers given",
                 name, name, (long long)failure->row);
    return NULL;
}

static PyObject *
raise_support_reach(const hs_failure *failure)
{
    const char *name = failure->in_queries ? "query_supports" : "supports";
    PyErr_Format(PyExc_ValueError,
                 "%s must reach at most 2**1022, and at most 2**1074 times as far in one direction "
                 "as in another; %s[%lld] reaches further",
                 name, name, (long long)failure->row);
    return NULL;
}

static PyObject *
raise_extent(const hs_failure *failure)
{
    return raise_number(PyExc_ValueError, failure->value,
                        "extent must be finite and not negative, got ");
}

static PyObject *
raise_shift(const hs_failure *failure)
{
    PyErr_Format(PyExc_OverflowError,
                 "%s[%lld] lies too many box vectors away, or a point that it pairs with does: "
                 "shifts are counted up to 2**51, and S holds 2**31; wrap the points first",
                 set_of(failure), (long long)failure->row);
    return NULL;
}

static PyObject *
raise_rounding(const hs_failure *failure)
{
    PyErr_Format(PyExc_OverflowError,
                 "%s[%lld] lies so far from the box, or the box is so skewed, that rounding "
                 "errors of precision='double' pass the cutoff; wrap the points first, or "
                 "use precision='exact'",
                 set_of(failure), (long long)failure->row);
    return NULL;
}

static PyObject *
raise_far(const hs_failure *failure)
{
    PyObject *number = PyFloat_FromDouble(failure->value);
    if (number != NULL && failure->row >= 0) {
        PyErr_Format(PyExc_ValueError,
                     "queries[%lld, %lld] = %R lies too far from the points and the box for cells "
                     "that were made without it; query() and pairs_between() have no such limit",
                     (long long)failure->row, (long long)failure->column, number);
    } else if (number != NULL) {
        PyErr_SetString(PyExc_ValueError,
                        "points lie so far apart, or the box is so small in comparison, "
                        "that one cell holds everything, and all points are candidates: the "
                        "other methods and functions have no such limit");
    }
    Py_XDECREF(number);
    return NULL;
}

static PyObject *
raise_interrupted(const hs_failure *failure)
{
    (void)failure;
    if (!PyErr_Occurred()) {
        PyErr_SetString(PyExc_SystemError, "interrupted without an exception");
    }
    return NULL;
}

static PyObject *
raise_argument(const hs_failure *failure)
{
    (void)failure;
    /* Python's arguments are checked before the call; the core refuses what that let through. */
    PyErr_SetString(PyExc_ValueError, hs_status_text(HS_ERR_ARGUMENT));
    return NULL;
}

/* The binding of dynamic lists names keys itself. */
static PyObject *
raise_key(const hs_failure *failure)
{
    (void)failure;
    PyErr_SetString(PyExc_KeyError, hs_status_text(HS_ERR_KEY));
    return NULL;
}

/* By status; NULL for those that are no failure, and for a kernel, whose name the options have. */
static PyObject *(*const RAISE[])(const hs_failure *) = {
    [HS_ERR_MEMORY] = raise_memory,
    [HS_ERR_CUTOFF] = raise_cutoff,
    [HS_ERR_NOT_FINITE] = raise_not_finite,
    [HS_ERR_BOX_FINITE] = raise_box,
    [HS_ERR_BOX_DEPENDENT] = raise_dependent,
    [HS_ERR_BOX_SKEWED] = raise_skewed,
    [HS_ERR_TOO_MANY] = raise_too_many,
    [HS_ERR_SHIFT_RANGE] = raise_shift,
    [HS_ERR_ROUNDING] = raise_rounding,
    [HS_ERR_INTERRUPTED] = raise_interrupted,
    [HS_ERR_FAR] = raise_far,
    [HS_ERR_CAPACITY] = raise_capacity,
    [HS_ERR_EDGES] = raise_edges,
    [HS_ERR_TYPES] = raise_types,
    [HS_ERR_WEIGHTS] = raise_weights,
    [HS_ERR_RADII] = raise_radii,
    [HS_ERR_SUPPORTS] = raise_supports,
    [HS_ERR_SUPPORT_REACH] = raise_support_reach,
    [HS_ERR_EXTENT] = raise_extent,
    [HS_ERR_ARGUMENT] = raise_argument,
    [HS_ERR_KEY] = raise_key,
};

PyObject *
hs_raise(hs_status status, const hs_failure *failure, const hs_options *options)
{
    const size_t number = (size_t)status;
    if (status == HS_ERR_KERNEL) {
        return raise_kernel(options);
    }
    if (number < sizeof RAISE / sizeof RAISE[0] && RAISE[number] != NULL) {
        return RAISE[number](failure);
    }
    PyErr_Format(PyExc_SystemError, "unmapped status %d: %s", (int)status, hs_status_text(status));
    return NULL;
}
