/* SPDX-License-Identifier: BSD-3-Clause */
/* errors.c: an exception for each status, by a table of words or by a function where more is to be
 * said. Messages say what was wrong, the value, and what is allowed. */
#include "errors.h"

#include "system.h"

#include <math.h>
#include <stdio.h>

/* The argument that a failure's row is of. */
static const char *
set_of(const hs_failure *failure)
{
    return failure->in_queries ? "queries" : "points";
}

/* Of a number that is wrong: "<name> <must>, got <name>[...] = <number>"; of what
 * is no number: "<name> <must>; <name>[...] <rest>". */
typedef struct number_words {
    const char *name; /* NULL: that of the set */
    const char *must;
    enum { ALONE, AT_ROW, AT_ELEMENT, OF_SYSTEM } where;
    enum { OF_ONE, OF_QUERIES } of; /* queries have query_ before the name */
    const char *rest;
} number_words;

/* By status. */
static const number_words WORDS[] = {
    [HS_ERR_CUTOFF] = {"cutoff", "must be finite and not negative", OF_SYSTEM, OF_ONE, NULL},
    [HS_ERR_NOT_FINITE] = {NULL, "must be finite", AT_ELEMENT, OF_ONE, NULL},
    [HS_ERR_BOX_FINITE] = {"box", "must be finite", AT_ELEMENT, OF_ONE, NULL},
    [HS_ERR_EDGES] = {"edges", "must be finite, not negative and ascending", AT_ROW, OF_ONE, NULL},
    [HS_ERR_WEIGHTS] = {"weights", "must be finite", AT_ROW, OF_QUERIES, NULL},
    [HS_ERR_RADII] = {"radii", "must be finite, not negative, and of ordinary size", AT_ROW,
                      OF_QUERIES, NULL},
    [HS_ERR_EXTENT] = {"extent", "must be finite and not negative", ALONE, OF_ONE, NULL},
    [HS_ERR_TYPES] = {"types", "must be from 0 on and below the number of types", AT_ROW,
                      OF_QUERIES, NULL},
    [HS_ERR_SUPPORTS] = {"supports", "must be finite, symmetric and positive definite", AT_ROW,
                         OF_QUERIES, "is not, for exactly the numbers given"},
    [HS_ERR_SUPPORT_REACH] = {"supports",
                              "must reach at most 2**1022, and at most 2**1074 times as far in one "
                              "direction as in another",
                              AT_ROW, OF_QUERIES, "reaches further"},
};

static PyObject *
raise_words(hs_status status, const hs_failure *failure, const number_words *said)
{
    const long long system = failure->system, row = failure->row, column = failure->column;
    const char     *name = said->name != NULL ? said->name : set_of(failure);
    const char     *query = said->of == OF_QUERIES && failure->in_queries ? "query_" : "";
    char            place[80] = "", number[32];
    if (said->where == AT_ROW) {
        snprintf(place, sizeof place, "%s%s[%lld]", query, name, row);
    } else if (said->where == AT_ELEMENT && (system < 0 || said->name == NULL)) {
        snprintf(place, sizeof place, "%s[%lld, %lld]", name, row, column);
    } else if (said->where == AT_ELEMENT) {
        snprintf(place, sizeof place, "%s[%lld, %lld, %lld]", name, system, row, column);
    } else if (said->where == OF_SYSTEM && system >= 0) {
        snprintf(place, sizeof place, "%s[%lld]", name, system);
    }
    if (said->rest != NULL) {
        return PyErr_Format(PyExc_ValueError, "%s%s %s; %s %s", query, name, said->must, place,
                            said->rest);
    }
    if (status == HS_ERR_TYPES) {
        snprintf(number, sizeof number, "%lld", (long long)failure->value);
    } else {
        hs_format_real(failure->value, number);
    }
    return PyErr_Format(PyExc_ValueError, "%s%s %s, got %s%s%s", query, name, said->must, place,
                        *place != '\0' ? " = " : "", number);
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
hs_format_real(double value, char text[32])
{
    char *shortest = PyOS_double_to_string(value, 'r', 0, Py_DTSF_ADD_DOT_0, NULL);
    snprintf(text, 32, "%s", shortest != NULL ? shortest : "that"); /* no memory: an exception */
    PyMem_Free(shortest);
    return text;
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
    char number[32];
    return PyErr_Format(PyExc_OverflowError,
                        "fewer than 2**31 points and systems and 2**62 pairs can be searched, got "
                        "%s",
                        hs_format_real(failure->value, number));
}

static PyObject *
raise_shift(const hs_failure *failure)
{
    return PyErr_Format(
        PyExc_OverflowError,
        "%s[%lld] lies too many box vectors away, or a point that it pairs with does: "
        "shifts are counted up to 2**51, and S holds 2**31; wrap the points first",
        set_of(failure), (long long)failure->row);
}

static PyObject *
raise_rounding(const hs_failure *failure)
{
    return PyErr_Format(PyExc_OverflowError,
                        "%s[%lld] lies so far from the box, or the box is so skewed, that rounding "
                        "errors of precision='double' pass the cutoff; wrap the points first, or "
                        "use precision='exact'",
                        set_of(failure), (long long)failure->row);
}

static PyObject *
raise_far(const hs_failure *failure)
{
    char number[32];
    return failure->row < 0
               ? PyErr_Format(PyExc_ValueError,
                              "points lie so far apart, or the box is so small in comparison, "
                              "that one cell holds everything, and all points are candidates: the "
                              "other methods and functions have no such limit")
               : PyErr_Format(PyExc_ValueError,
                              "queries[%lld, %lld] = %s lies too far from the points and the box "
                              "for cells that were made without it; query() and pairs_between() "
                              "have no such limit",
                              (long long)failure->row, (long long)failure->column,
                              hs_format_real(failure->value, number));
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

/* By status: those of which a message says more than WORDS has. */
static PyObject *(*const RAISE[])(const hs_failure *) = {
    [HS_ERR_MEMORY] = raise_memory,           [HS_ERR_BOX_DEPENDENT] = raise_dependent,
    [HS_ERR_BOX_SKEWED] = raise_skewed,       [HS_ERR_TOO_MANY] = raise_too_many,
    [HS_ERR_SHIFT_RANGE] = raise_shift,       [HS_ERR_ROUNDING] = raise_rounding,
    [HS_ERR_INTERRUPTED] = raise_interrupted, [HS_ERR_FAR] = raise_far,
    [HS_ERR_CAPACITY] = raise_capacity,
};

PyObject *
hs_raise(hs_status status, const hs_failure *failure, const hs_options *options)
{
    const size_t number = (size_t)status;
    if (number < sizeof WORDS / sizeof WORDS[0] && WORDS[number].must != NULL) {
        return raise_words(status, failure, &WORDS[number]);
    }
    if (number < sizeof RAISE / sizeof RAISE[0] && RAISE[number] != NULL) {
        return RAISE[number](failure);
    }
    switch (status) {
    case HS_ERR_KERNEL: return raise_kernel(options);
    /* Python's arguments are checked before the call; the core refuses what that let through. */
    case HS_ERR_ARGUMENT: PyErr_SetString(PyExc_ValueError, hs_status_text(status)); return NULL;
    /* The binding of dynamic lists names keys itself. */
    case HS_ERR_KEY: PyErr_SetString(PyExc_KeyError, hs_status_text(status)); return NULL;
    default: break;
    }
    PyErr_Format(PyExc_SystemError, "unmapped status %d: %s", (int)status, hs_status_text(status));
    return NULL;
}

#define SHOWN 80 /* characters of a value in a message */

/* The exception that is set, taken; NULL where it is not the fault of an argument. */
static PyObject *
take_fault(void)
{
    PyObject *type, *value, *trace;
    if (!PyErr_ExceptionMatches(PyExc_Exception) || PyErr_ExceptionMatches(PyExc_MemoryError)) {
        return NULL;
    }
    PyErr_Fetch(&type, &value, &trace);
    PyErr_NormalizeException(&type, &value, &trace);
    if (trace != NULL) {
        PyException_SetTraceback(value, trace);
    }
    Py_XDECREF(type);
    Py_XDECREF(trace);
    return value;
}

/* Makes an exception the cause of the one that is set; takes ownership of it. */
static void
set_cause(PyObject *cause)
{
    PyObject *type, *value, *trace;
    PyErr_Fetch(&type, &value, &trace);
    PyErr_NormalizeException(&type, &value, &trace);
    PyException_SetCause(value, cause);
    PyErr_Restore(type, value, trace);
}

/* The text with one blank for each run of blanks and line breaks; takes ownership. NULL with an
 * exception set, also for NULL. */
static PyObject *
on_one_line(PyObject *text)
{
    PyObject *words = text != NULL ? PyUnicode_Split(text, NULL, -1) : NULL;
    PyObject *blank = words != NULL ? PyUnicode_FromString(" ") : NULL;
    PyObject *joined = blank != NULL ? PyUnicode_Join(blank, words) : NULL;
    Py_XDECREF(blank);
    Py_XDECREF(words);
    Py_XDECREF(text);
    return joined;
}

void
hs_refuse(PyObject *type, const char *must, PyObject *object)
{
    PyObject *text = on_one_line(PyObject_Repr(object));
    if (text == NULL) {
        PyObject *fault = take_fault();
        if (fault == NULL) {
            return;
        }
        Py_DECREF(fault);
        PyErr_Format(type, "%s, got a value of type %.80s", must, Py_TYPE(object)->tp_name);
        return;
    }
    if (PyUnicode_GetLength(text) > SHOWN) {
        Py_SETREF(text, PyUnicode_Substring(text, 0, SHOWN - 3));
        if (text != NULL) {
            PyErr_Format(type, "%s, got %U...", must, text);
        }
    } else {
        PyErr_Format(type, "%s, got %U", must, text);
    }
    Py_XDECREF(text);
}

bool
hs_refuse_kind(const char *must, PyObject *object)
{
    PyObject *fault = take_fault();
    if (fault != NULL) {
        PyErr_Format(PyExc_TypeError, "%s, got %.80s", must, Py_TYPE(object)->tp_name);
        set_cause(fault);
    }
    return false;
}

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
hs_tuple_of_names(const char *const *names, int n)
{
    PyObject *tuple = PyTuple_New(n);
    for (int k = 0; tuple != NULL && k < n; k++) {
        hs_tuple_put(&tuple, k, PyUnicode_FromString(names[k]));
    }
    return tuple;
}
