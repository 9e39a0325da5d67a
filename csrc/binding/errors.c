/* SPDX-License-Identifier: BSD-3-Clause */
/* errors.c: an exception for each status, by a table of messages or by a function where more is to
 * be said. Messages say what was wrong, the value, and what is allowed. */
#include "errors.h"

#include "system.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Messages by status. A name in braces becomes what the failure says, see field_of. Without a row:
 * where failure->row is -1, if that is another one. All but these are errors of values. */
static const struct {
    const char *message, *without_row;
    bool        is_overflow;
} MESSAGES[] = {
    [HS_ERR_CUTOFF] = {"cutoff must be finite and not negative, got {cutoff}{value}"},
    [HS_ERR_NOT_FINITE] = {"{points} must be finite, got {points}[{row}, {column}] = {value}"},
    [HS_ERR_BOX_FINITE] = {"box must be finite, got box[{system}{row}, {column}] = {value}"},
    [HS_ERR_BOX_DEPENDENT] =
        {"vector {row} of {box} is zero; make that axis not periodic",
         "the periodic vectors of {box} must be linearly independent; these are exactly dependent"},
    [HS_ERR_BOX_SKEWED] =
        {"{points}[{row}] lies so far from {box}, along a direction that does not "
         "repeat, that float64 does not place it in the box; move the points "
         "closer to the origin",
         "{box} is too skewed, or its vectors differ too much in length: float64 "
         "does not place points along the short ones; give an equivalent, less "
         "skewed box, or one along the coordinate axes"},
    [HS_ERR_TOO_MANY] = {"fewer than 2**31 points and systems and 2**62 pairs can be searched, got "
                         "{value}",
                         NULL, true},
    [HS_ERR_SHIFT_RANGE] = {"{points}[{row}] lies too many box vectors away, or a point that it "
                            "pairs with does: shifts are counted up to 2**51, and S holds 2**31; "
                            "wrap the points first",
                            NULL, true},
    [HS_ERR_ROUNDING] = {"{points}[{row}] lies so far from the box, or the box is so skewed, that "
                         "rounding errors of precision='double' pass the cutoff; wrap the points "
                         "first, or use precision='exact'",
                         NULL, true},
    [HS_ERR_FAR] = {"queries[{row}, {column}] = {value} lies too far from the points and the box "
                    "for cells that were made without it; query() and pairs_between() have no such "
                    "limit",
                    "points lie so far apart, or the box is so small in comparison, that one cell "
                    "holds everything, and all points are candidates: the other methods and "
                    "functions have no such limit"},
    [HS_ERR_EDGES] = {"edges must be finite, not negative and ascending, got edges[{row}] = "
                      "{value}"},
    [HS_ERR_TYPES] = {"{query}types must be from 0 on and below the number of types, got "
                      "{query}types[{row}] = {integer}"},
    [HS_ERR_WEIGHTS] = {"{query}weights must be finite, got {query}weights[{row}] = {value}"},
    [HS_ERR_RADII] = {"{query}radii must be finite, not negative, and of ordinary size, got "
                      "{query}radii[{row}] = {value}"},
    [HS_ERR_SUPPORTS] = {"{query}supports must be finite, symmetric and positive definite; "
                         "{query}supports[{row}] is not, for exactly the numbers given"},
    [HS_ERR_SUPPORT_REACH] = {"{query}supports must reach at most 2**1022, and at most 2**1074 "
                              "times as far in one direction as in another; "
                              "{query}supports[{row}] reaches further"},
    [HS_ERR_EXTENT] = {"extent must be finite and not negative, got {value}"},
};

/* What stands in place of the name that is followed by a brace. */
static const char *
field_of(const char *name, const hs_failure *failure, char text[64])
{
    const struct {
        const char *name, *text; /* NULL: a number */
        long long   number;
    } known[] = {
        {"points}", failure->in_queries ? "queries" : "points", 0},
        {"query}", failure->in_queries ? "query_" : "", 0},
        {"row}", NULL, failure->row},
        {"column}", NULL, failure->column},
        {"cutoff}", failure->system < 0 ? "" : "cutoff[%lld] = ", failure->system},
        {"system}", failure->system < 0 ? "" : "%lld, ", failure->system},
        {"box}", failure->system < 0 ? "box" : "box[%lld]", failure->system},
    };
    for (size_t k = 0; k < sizeof known / sizeof known[0]; k++) {
        if (strncmp(name, known[k].name, strlen(known[k].name)) == 0) {
            snprintf(text, 64, known[k].text != NULL ? known[k].text : "%lld", known[k].number);
            return text;
        }
    }
    if (strncmp(name, "integer}", 8) == 0) {
        snprintf(text, 64, "%.0f", failure->value);
        return text;
    }
    return hs_format_real(failure->value, text);
}

static PyObject *
raise_message(hs_status status, const hs_failure *failure)
{
    const char *from = failure->row < 0 && MESSAGES[status].without_row != NULL
                           ? MESSAGES[status].without_row
                           : MESSAGES[status].message;
    char        text[512], field[64];
    size_t      n = 0;
    for (; *from != '\0' && n < sizeof text - sizeof field; from++) {
        if (*from == '{') {
            n += (size_t)snprintf(text + n, sizeof field, "%s", field_of(from + 1, failure, field));
            from = strchr(from, '}');
        } else {
            text[n++] = *from;
        }
    }
    text[n] = '\0';
    PyErr_SetString(MESSAGES[status].is_overflow ? PyExc_OverflowError : PyExc_ValueError, text);
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

/* halfshell.CapacityError, which carries the number that was needed; INT64_MAX where it is more. */
static PyObject *
raise_capacity(const hs_failure *failure)
{
    const long long n = failure->expected_pairs < 0x1p63 ? (long long)failure->expected_pairs
                                                         : INT64_MAX;
    PyObject       *module = PyImport_ImportModule("halfshell._errors");
    PyObject       *type = module != NULL ? PyObject_GetAttrString(module, "CapacityError") : NULL;
    PyObject       *message = PyUnicode_FromFormat(
              "out is too small: there are %lld pairs, each array needs room for all", n);
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
    return NULL;
}

PyObject *
hs_raise(hs_status status, const hs_failure *failure, const hs_options *options)
{
    const size_t number = (size_t)status;
    if (number < sizeof MESSAGES / sizeof MESSAGES[0] && MESSAGES[number].message != NULL) {
        return raise_message(status, failure);
    }
    switch (status) {
    case HS_ERR_MEMORY: return raise_memory(failure);
    case HS_ERR_KERNEL: return raise_kernel(options);
    case HS_ERR_CAPACITY: return raise_capacity(failure);
    case HS_ERR_INTERRUPTED:
        if (!PyErr_Occurred()) {
            PyErr_SetString(PyExc_SystemError, "interrupted without an exception");
        }
        return NULL;
    /* Python's arguments are checked before the call; the core refuses what that let through. */
    case HS_ERR_ARGUMENT: PyErr_SetString(PyExc_ValueError, hs_status_text(status)); return NULL;
    /* The binding of dynamic lists names keys itself. */
    case HS_ERR_KEY: PyErr_SetString(PyExc_KeyError, hs_status_text(status)); return NULL;
    default: break;
    }
    PyErr_Format(PyExc_SystemError, "unmapped status %d: %s", (int)status, hs_status_text(status));
    return NULL;
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
