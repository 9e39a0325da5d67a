/* SPDX-License-Identifier: BSD-3-Clause */
/* arguments.c: numbers first, views last. What is taken when is the order of hs_py_call_take. */
#include "arguments.h"

#include "errors.h"
#include "outputs.h"
#include "system.h"

#include <math.h>
#include <string.h>

#define AS_TEXT(number)      #number
#define MUST_BE_UP_TO(limit) "threads must be a whole number from 1 to " AS_TEXT(limit) " or None"
#define THREADS_MUST_BE      MUST_BE_UP_TO(HS_MOST_THREADS)

/* Points below which a search is expected to be over before another thread could take the GIL: it
 * is kept until the first poll. */
#define FEW_POINTS 256

/* ---- one argument ------------------------------------------------------------------------- */

bool
hs_is_array(PyObject *object, int type, int n_axes)
{
    PyArrayObject *array = (PyArrayObject *)object;
    return PyArray_Check(object) && PyArray_TYPE(array) == type && PyArray_ISCARRAY_RO(array) &&
           PyArray_NDIM(array) == n_axes;
}

bool
hs_entries_of(PyObject *object, int type, int n_axes, int64_t length, int64_t width,
              const char *must, const void **entries)
{
    PyArrayObject *array = (PyArrayObject *)object;
    *entries = NULL;
    if (object == Py_None) {
        return true;
    }
    bool fits = hs_is_array(object, type, n_axes) &&
                (length < 0 || PyArray_DIM(array, 0) == length);
    for (int k = 1; fits && k < n_axes; k++) {
        fits = PyArray_DIM(array, k) == width;
    }
    if (!fits) {
        PyErr_SetString(PyExc_TypeError, must);
        return false;
    }
    *entries = PyArray_DATA(array);
    return true;
}

int64_t
hs_length_of(PyObject *object)
{
    return object != Py_None ? PyArray_DIM((PyArrayObject *)object, 0) : 0;
}

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

/* None or a string; the string borrows from the object. */
static bool
take_name(PyObject *object, const char *argument, const char **name)
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

/* The bit of a letter of HS_LETTERS is its HS_WANT_ bit. */
_Static_assert(HS_WANT_I == 1 && HS_WANT_J == 2 && HS_WANT_DISTANCE == 4 && HS_WANT_VECTOR == 8 &&
                   HS_WANT_SHIFT == 16 && HS_WANT_BOTH == 32 && HS_WANT_SHELL == 64,
               "take_quantities counts on this");

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

/* A string of the known letters, each at most once, and its HS_WANT_ bits. */
static bool
take_quantities(PyObject *object, const char *known, const char **letters, unsigned *want)
{
    unsigned seen = 0;
    if (!PyUnicode_Check(object)) {
        PyErr_Format(PyExc_TypeError, "quantities must be a string of letters, got %s",
                     Py_TYPE(object)->tp_name);
        return false;
    }
    if (!take_name(object, "quantities", letters)) {
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

static bool
take_precision(PyObject *object, hs_precision *precision)
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

static bool
take_algorithm(PyObject *object, hs_algorithm *algorithm)
{
    const int k =
        number_of_name(object, hs_algorithm_names, HS_ALGORITHM_END,
                       "algorithm must be 'auto', 'all-pairs', 'grid', 'hash' or 'hierarchy'");
    *algorithm = k >= 0 ? (hs_algorithm)k : HS_AUTO;
    return k >= 0;
}

static bool
take_memory_limit(PyObject *object, hs_options *options)
{
    if (object == Py_None) {
        options->find_limit = hs_available_memory;
        return true;
    }
    if (!hs_real_of(object, "memory_limit must be a number of bytes", &options->memory_limit)) {
        return false;
    }
    if (!(options->memory_limit >= 0.0)) {
        hs_refuse(PyExc_ValueError, "memory_limit must be a number of bytes", object);
        return false;
    }
    options->memory_limit = fabs(options->memory_limit); /* -0.0 is 0 in messages, too */
    return true;
}

/* A number, or 0 for None: what that means depends on the points. */
static bool
take_threads(PyObject *object, hs_options *options)
{
    options->threads = 0;
    if (object == Py_None) {
        return true;
    }
    double n;
    if (!hs_whole_of(object, THREADS_MUST_BE, &n)) {
        return false;
    }
    if (!(n >= 1.0 && n <= HS_MOST_THREADS)) {
        hs_refuse(PyExc_ValueError, THREADS_MUST_BE, object);
        return false;
    }
    options->threads = (int)n;
    if (n > HS_THREADS_PER_CORE) {
        const int most = hs_most_threads();
        options->threads = n > most ? most : (int)n;
    }
    return true;
}

static bool
take_truth(PyObject *object, bool *value)
{
    const int truth = PyObject_IsTrue(object);
    *value = truth > 0;
    return truth >= 0;
}

/* None is what the environment says. */
static bool
take_kernel(PyObject *object, const char **kernel)
{
    if (object == Py_None) {
        *kernel = hs_environment_kernel();
        return true;
    }
    return take_name(object, "kernel", kernel);
}

static bool
take_integer(PyObject *object, int64_t *value)
{
    *value = PyLong_AsLongLong(object);
    return *value != -1 || !PyErr_Occurred();
}

static bool
take_index_bytes(PyObject *object, int *bytes)
{
    *bytes = (int)PyLong_AsLong(object);
    return *bytes != -1 || !PyErr_Occurred();
}

/* The number is not compared, which might trap. */
static bool
take_real(PyObject *object, double *value)
{
    *value = PyFloat_AsDouble(object);
    return !PyErr_Occurred();
}

/* A number, flag or name; true for what is none. */
static bool
take_number(hs_kind kind, PyObject *object, hs_py_call *call)
{
    hs_options *options = &call->options;
    switch (kind) {
    case HS_ARG_CUTOFF: return take_real(object, &options->cutoff);
    case HS_ARG_INCLUSIVE: return take_truth(object, &options->inclusive);
    case HS_ARG_PRECISION: return take_precision(object, &options->precision);
    case HS_ARG_KERNEL: return take_kernel(object, &options->kernel);
    case HS_ARG_MEMORY_LIMIT: return take_memory_limit(object, options);
    case HS_ARG_PROGRESS: call->progress = object == Py_None ? NULL : object; return true;
    case HS_ARG_THREADS: return take_threads(object, options);
    case HS_ARG_QUANTITIES:
        return take_quantities(object, HS_ALL_LETTERS, &call->letters, &options->want);
    case HS_ARG_SHELL_QUANTITIES:
        return take_quantities(object, HS_LETTERS, &call->letters, &options->want);
    case HS_ARG_ROW_QUANTITIES:
        return take_quantities(object, HS_ROW_LETTERS, &call->letters, &options->want);
    case HS_ARG_SHELL_ROW_QUANTITIES:
        return take_quantities(object, HS_SHELL_ROW_LETTERS, &call->letters, &options->want);
    case HS_ARG_SORT: return take_truth(object, &options->sorted);
    case HS_ARG_INDEX: return take_index_bytes(object, &options->index_bytes);
    case HS_ARG_FLAG: return take_truth(object, &call->flag);
    case HS_ARG_INTEGER: return take_integer(object, &call->integer);
    case HS_ARG_REAL: return take_real(object, &call->real);
    case HS_ARG_ALGORITHM: return take_algorithm(object, &options->algorithm);
    case HS_ARG_CAPACITY: return object == Py_None || take_integer(object, &call->capacity);
    default: return true;
    }
}

/* Points and box: arrays, or what cells hold. */
static bool
take_scene(PyObject *points, PyObject *box, unsigned long repeats, hs_py_call *call)
{
    hs_among *among = &call->among;
    bool      has_box;
    among->points = &call->points;
    among->cells = hs_cells_of(points);
    if (among->cells != NULL) {
        hs_cells_points(among->cells, &call->points.at);
        call->points.at.data = NULL;
        return true;
    }
    if (!hs_points_of(points, "points", &call->points.at) ||
        !hs_box_of(box, repeats, call->points.at.ndim, &call->box, &has_box)) {
        return false;
    }
    among->box = has_box ? &call->box : NULL;
    return true;
}

static bool
take_queries(PyObject *object, hs_py_call *call)
{
    const hs_points *points = &call->points.at, *queries = &call->queries.at;
    if (!hs_points_of(object, "queries", &call->queries.at)) {
        return false;
    }
    if (queries->ndim != points->ndim) {
        PyErr_Format(PyExc_ValueError,
                     "queries and points must have the same number of columns, got shapes "
                     "(%lld, %d) and (%lld, %d)",
                     (long long)queries->n, queries->ndim, (long long)points->n, points->ndim);
        return false;
    }
    call->among.queries = &call->queries;
    return true;
}

static bool
take_out(PyObject *object, hs_py_call *call)
{
    hs_options *options = &call->options;
    call->out = object;
    options->out = &call->arrays;
    return hs_out_of(object, call->letters, call->points.at.ndim, options->index_bytes,
                     &call->arrays);
}

/* The cutoffs of shells, which go with their letter; NULL: one cutoff. */
static bool
take_shells(PyObject *object, hs_options *options)
{
    const bool is_wanted = options->want & HS_WANT_SHELL;
    if (object == NULL) {
        if (is_wanted) {
            PyErr_SetString(PyExc_ValueError,
                            "the letter k in quantities needs several cutoffs, got one");
        }
        return !is_wanted;
    }
    if (!is_wanted || !hs_is_array(object, NPY_DOUBLE, 1)) {
        PyErr_SetString(PyExc_TypeError, "several cutoffs must be a float64 array, with letter k");
        return false;
    }
    options->n_shells = PyArray_DIM((PyArrayObject *)object, 0);
    options->shells = PyArray_DATA((PyArrayObject *)object);
    return true;
}

/* ---- what is known of points; a reach, a selection --------------------------------------- */

bool
hs_known_take(PyObject *of_points, PyObject *of_queries, int type, int n_axes, const char *must,
              size_t member, hs_py_call *call)
{
    PyObject *const given[] = {of_points, of_queries};
    hs_set *const   sets[] = {&call->points, &call->queries}; /* without queries, of none */
    for (int k = 0; k < 2; k++) {
        const void *entries;
        if (!hs_entries_of(given[k], type, n_axes, sets[k]->at.n, call->points.at.ndim, must,
                           &entries)) {
            return false;
        }
        memcpy((char *)sets[k] + member, &entries, sizeof entries);
    }
    return true;
}

/*
 * A tuple (rule, radii, query_radii, types, query_types, table, supports, query_supports, extent):
 * an int of hs_rule; arrays of float64 or, for types, int32, each with one entry for each point or
 * query; a square float64 table of cutoffs; float64 arrays of one matrix of ndim rows for each
 * point or query; and a float, how many times supports or radii count, or None. Any but the rule
 * may be None.
 */
static bool
take_limits(PyObject *object, hs_py_call *call, hs_reach *reach)
{
    static const char *const must = "radii and types must be arrays of one entry for each point or "
                                    "query",
                             *const must_be_matrices = "supports must be float64 arrays of one "
                                                       "matrix for each point or query",
                             *const must_be_table = "the table of cutoffs must be a square float64 "
                                                    "array";
    *reach = (hs_reach){.n_types = 0};
    if (!PyTuple_CheckExact(object) || PyTuple_GET_SIZE(object) != 9 ||
        !PyLong_CheckExact(PyTuple_GET_ITEM(object, 0))) {
        PyErr_SetString(PyExc_TypeError, "reach must be None or a tuple of nine");
        return false;
    }
    PyObject *const *of = &PyTuple_GET_ITEM(object, 0);
    const void      *table;
    const long       rule = PyLong_AsLong(of[0]);
    if (rule < 0 || rule >= HS_RULE_END) {
        PyErr_Clear(); /* of a number that is no long */
        PyErr_SetString(PyExc_ValueError, "there is no such rule");
        return false;
    }
    const int64_t n_types = PyArray_Check(of[5]) && PyArray_NDIM((PyArrayObject *)of[5]) > 0
                                ? PyArray_DIM((PyArrayObject *)of[5], 0)
                                : 0;
    if (!hs_known_take(of[1], of[2], NPY_DOUBLE, 1, must, offsetof(hs_set, radii), call) ||
        !hs_known_take(of[3], of[4], NPY_INT32, 1, must, offsetof(hs_set, types), call) ||
        !hs_entries_of(of[5], NPY_DOUBLE, 2, n_types, n_types, must_be_table, &table)) {
        return false;
    }
    if (table != NULL && (n_types < 1 || n_types > INT32_MAX)) {
        PyErr_SetString(PyExc_TypeError, must_be_table);
        return false;
    }
    *reach = (hs_reach){.rule = (hs_rule)rule, .n_types = (int32_t)n_types, .cutoffs = table};
    if (of[8] == Py_None) {
        return true;
    }
    if (!PyFloat_CheckExact(of[8])) {
        PyErr_SetString(PyExc_TypeError, "extent must be a float");
        return false;
    }
    if (!hs_known_take(of[6], of[7], NPY_DOUBLE, 3, must_be_matrices, offsetof(hs_set, supports),
                       call)) {
        return false;
    }
    reach->has_supports = of[6] != Py_None || of[7] != Py_None;
    reach->extent = PyFloat_AS_DOUBLE(of[8]);
    return true;
}

/*
 * A tuple (groups, query_groups, labels, query_labels, query_numbers, within, excluded,
 * min_distance): int64 arrays of one entry for each point or query; an int; an int64 array of two
 * columns; and a float. Arrays may be None.
 */
static bool
take_selection(PyObject *object, hs_py_call *call, hs_selection *selection)
{
    static const char *const must = "labels must be int64 arrays of one entry for each point or "
                                    "query";
    if (!PyTuple_CheckExact(object) || PyTuple_GET_SIZE(object) != 8 ||
        !PyLong_CheckExact(PyTuple_GET_ITEM(object, 5)) ||
        !PyFloat_CheckExact(PyTuple_GET_ITEM(object, 7))) {
        PyErr_SetString(PyExc_TypeError, "selection must be a tuple of eight");
        return false;
    }
    PyObject *const *of = &PyTuple_GET_ITEM(object, 0);
    const void      *numbers, *excluded;
    const long long  within = PyLong_AsLongLong(of[5]);
    if (within < 0) {
        PyErr_Clear(); /* of a number that is no long long */
        PyErr_SetString(PyExc_ValueError, "labels cannot differ by so much");
        return false;
    }
    if (!hs_known_take(of[0], of[1], NPY_INT64, 1, must, offsetof(hs_set, groups), call) ||
        !hs_known_take(of[2], of[3], NPY_INT64, 1, must, offsetof(hs_set, labels), call) ||
        !hs_entries_of(of[4], NPY_INT64, 1, call->queries.at.n, 0, must, &numbers)) {
        return false;
    }
    if (!hs_entries_of(of[6], NPY_INT64, 2, -1, 2, "excluded must be an int64 array of two columns",
                       &excluded)) {
        return false;
    }
    *selection = (hs_selection){.has_groups = of[0] != Py_None || of[1] != Py_None,
                                .has_labels = of[2] != Py_None || of[3] != Py_None,
                                .query_numbers = numbers,
                                .within = within,
                                .n_excluded = hs_length_of(of[6]),
                                .excluded = excluded,
                                .min_distance = PyFloat_AS_DOUBLE(of[7])};
    return true;
}

/* A reach, or a tuple of two: that or None, and a selection. */
static bool
take_reach(PyObject *object, hs_py_call *call)
{
    if (PyTuple_CheckExact(object) && PyTuple_GET_SIZE(object) == 2) {
        call->among.selection = &call->selection;
        if (!take_selection(PyTuple_GET_ITEM(object, 1), call, &call->selection)) {
            return false;
        }
        object = PyTuple_GET_ITEM(object, 0);
        if (object == Py_None) {
            return true;
        }
    }
    call->among.reach = &call->reach;
    return take_limits(object, call, &call->reach);
}

/* An hs_poll_fn: lets signals be handled and reports progress; false when either raised. From the
 * first poll on the GIL is free: the search is not so small after all. */
static bool
poll_python(void *context, double fraction)
{
    hs_py_call *call = context;
    hs_py_call_acquire(call);
    bool go_on = PyErr_CheckSignals() == 0;
    if (go_on && call->progress != NULL) {
        PyObject *result = PyObject_CallFunction(call->progress, "d", fraction);
        go_on = result != NULL;
        Py_XDECREF(result);
    }
    call->thread = PyEval_SaveThread();
    return go_on;
}

/* Points and box, then what depends on them: queries, reach, `out`, which shares no memory with
 * what it is made from, and the batch. of: by kind, what was given, NULL for None where that may
 * be. */
static bool
take_views(PyObject *const *of, unsigned long repeats, hs_py_call *call)
{
    PyObject *points = of[HS_ARG_POINTS], *box = of[HS_ARG_BOX], *reach = of[HS_ARG_REACH],
             *out = of[HS_ARG_OUT], *batch = of[HS_ARG_BATCH],
             *queries = of[HS_ARG_OTHER_POINTS] != NULL ? of[HS_ARG_OTHER_POINTS]
                                                        : of[HS_ARG_QUERIES];
    if (!take_shells(of[HS_ARG_SHELLS], &call->options) ||
        !take_scene(points, box, repeats, call) ||
        (queries != NULL && !take_queries(queries, call)) ||
        (reach != NULL && !take_reach(reach, call))) {
        return false;
    }
    if (out != NULL &&
        (!take_out(out, call) ||
         (queries != NULL && !hs_out_is_apart(out, call->letters, queries, "queries")) ||
         !hs_out_is_apart(out, call->letters, points, "points") ||
         !hs_out_is_apart(out, call->letters, box, "box"))) {
        return false;
    }
    return batch == NULL || hs_batch_take(batch, call);
}

static int64_t
count_points(const hs_py_call *call)
{
    return call->points.at.n + (call->among.queries != NULL ? call->queries.at.n : 0);
}

bool
hs_expect_arguments(const char *name, Py_ssize_t n_arguments, int expected)
{
    if (n_arguments != expected) {
        PyErr_Format(PyExc_TypeError, "%s takes %d arguments", name, expected);
    }
    return n_arguments == expected;
}

/* How many arguments of its own a call has: those at the end may be left out. A wrong number is
 * brought to the next right one. */
static int
count_own(const hs_argument *takes, int n_given)
{
    int n = 0, n_needed = 0;
    for (; takes[n].kind != HS_ARG_END; n++) {
        n_needed = takes[n].kind < HS_ARG_FIRST_OPTIONAL ? n + 1 : n_needed;
    }
    return n_given < n_needed ? n_needed : n_given < n ? n_given : n;
}

/* Takes what is a number, and notes all by kind; false with an exception set. */
static bool
take_numbers(const hs_argument *takes, int n, PyObject *const *given, PyObject **of,
             hs_py_call *call)
{
    for (int k = 0; k < n; k++) {
        const hs_kind kind = takes[k].kind;
        if (given[k] != Py_None || kind < HS_ARG_OUT || kind == HS_ARG_OTHER_POINTS) {
            of[kind] = given[k];
        }
        if (!take_number(kind, given[k], call)) {
            return false;
        }
    }
    return true;
}

bool
hs_py_call_take(hs_py_call *call, hs_function_number number, PyObject *const *arguments,
                Py_ssize_t n_arguments)
{
    const hs_function *function = &hs_functions[number];
    const int          n_own = count_own(function->own, (int)(n_arguments - HS_CALL_ARGUMENTS));
    PyObject          *of[HS_KINDS] = {NULL};
    hs_options        *options = &call->options;
    unsigned long      repeats;
    if (!hs_expect_arguments(function->name, n_arguments, HS_CALL_ARGUMENTS + n_own) ||
        !hs_repeats_of(arguments[3], &repeats)) {
        return false;
    }
    *options = hs_options_default();
    call->among = (hs_among){.points = NULL};
    call->points = call->queries = (hs_set){.first = NULL};
    call->batch = (hs_batch){.is_given = false};
    call->own = arguments + HS_CALL_ARGUMENTS;
    call->letters = "ij";
    call->out = call->room = NULL;
    call->capacity = 0;
    call->thread = NULL;
    if (!take_numbers(HS_EVERY_SEARCH, HS_CALL_ARGUMENTS, arguments, of, call) ||
        !take_numbers(function->own, n_own, call->own, of, call) ||
        !take_views(of, repeats, call)) {
        return false;
    }
    if (!hs_out_make_room(call)) {
        hs_py_call_end(call);
        return false;
    }
    if (options->threads == 0) {
        /* Where the core would use one thread in any case, the system need not be asked. */
        const bool few = count_points(call) < HS_POINTS_FOR_THREADS;
        options->threads = few ? 1 : -hs_default_threads();
    }
    options->poll = poll_python;
    options->poll_context = call;
    return true;
}

void
hs_py_call_end(hs_py_call *call)
{
    if (call->batch.is_given && !call->batch.are_all) {
        call->failure.system = -1; /* systems are named where each has something of its own */
    }
    hs_batch_free(&call->batch);
}

void
hs_py_call_release(hs_py_call *call)
{
    if (count_points(call) >= FEW_POINTS) {
        call->thread = PyEval_SaveThread();
    }
}

void
hs_py_call_acquire(hs_py_call *call)
{
    if (call->thread != NULL) {
        PyEval_RestoreThread(call->thread);
        call->thread = NULL;
    }
}
