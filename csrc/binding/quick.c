/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * quick.c: what users give, as the core takes it. Python needs as long to fill in what was left out
 * as a search of thirty points.
 *
 * What is converted here is harmless: exact types of Python and NumPy, whose conversion runs no
 * code of others, with exactly the values that _convert/ makes of it.
 */
#include "quick.h"

#include "outputs.h"
#include "py_functions.h"

#include <numpy/arrayscalars.h>
#include <math.h>
#include <string.h>

/* Bytes of a conversion from which _convert/ first looks what the machine has left. */
#define SMALL ((npy_intp)1 << 26)

#define BIGGEST_INTEGER (INT64_C(1) << 53) /* up to here float64 holds every integer */

#define MOST_COUNT (INT64_C(1) << 56) /* more than fits in any memory */

enum { MOST_CORE = HS_CALL_ARGUMENTS + HS_MOST_OWN };

/* Of a conversion: FAILED has an exception set. */
typedef enum outcome { FAILED = -1, IS_NOT_PLAIN, IS_PLAIN } outcome;

/* A call on its way to the core. */
typedef struct quick_call {
    PyObject **known;            /* borrowed: of the module, by HS_BOX_TYPE and the like */
    PyObject  *given[MOST_CORE]; /* in the order of the core */
    unsigned   owned;            /* bit k: given[k] is; the others are borrowed from the row */
    int        n, ndim;
    unsigned   placed;     /* bit k: users gave given[k]; the others are as the core takes them */
    bool       has_copies; /* of arrays, with which `out` is to be compared as they were given */
} quick_call;

/* Puts an object in the place of what was given; takes the reference. */
static outcome
put(quick_call *call, PyObject **place, PyObject *made)
{
    const unsigned bit = 1u << (place - call->given);
    PyObject      *before = *place;
    if (made == NULL) {
        return FAILED;
    }
    *place = made;
    if (call->owned & bit) {
        Py_DECREF(before);
    }
    call->owned |= bit;
    return IS_PLAIN;
}

static void
let_go(quick_call *call)
{
    for (int k = 0; k < call->n; k++) {
        if (call->owned >> k & 1) {
            Py_DECREF(call->given[k]);
        }
    }
}

/* ---- numbers and sequences ---------------------------------------------------------------- */

/* A float or a small integer, of Python itself or NumPy's float64. */
static bool
number_of(PyObject *object, double *value)
{
    if (PyFloat_CheckExact(object)) {
        *value = PyFloat_AS_DOUBLE(object);
        return true;
    }
    if (PyLong_CheckExact(object)) {
        int             overflow;
        const long long whole = PyLong_AsLongLongAndOverflow(object, &overflow);
        *value = (double)whole;
        return overflow == 0 && whole >= -BIGGEST_INTEGER && whole <= BIGGEST_INTEGER;
    }
    if (Py_TYPE(object) == &PyDoubleArrType_Type) {
        *value = PyArrayScalar_VAL(object, Double);
        return true;
    }
    return false;
}

/* The same, or another number of NumPy. */
static bool
scalar_of(PyObject *object, double *value)
{
    const PyTypeObject *type = Py_TYPE(object);
    int64_t             whole;
    if (number_of(object, value)) {
        return true;
    }
    if (type == &PyFloatArrType_Type) {
        *value = (double)PyArrayScalar_VAL(object, Float);
        return true;
    }
    if (type == &PyIntArrType_Type) {
        whole = PyArrayScalar_VAL(object, Int);
    } else if (type == &PyLongArrType_Type) {
        whole = PyArrayScalar_VAL(object, Long);
    } else if (type == &PyLongLongArrType_Type) {
        whole = PyArrayScalar_VAL(object, LongLong);
    } else {
        return false;
    }
    *value = (double)whole;
    return whole >= -BIGGEST_INTEGER && whole <= BIGGEST_INTEGER;
}

static bool
truth_of(PyObject *object, bool *value)
{
    *value = object == Py_True || object == PyArrayScalar_True;
    return *value || object == Py_False || object == PyArrayScalar_False;
}

static bool
is_sequence(PyObject *object)
{
    return PyList_CheckExact(object) || PyTuple_CheckExact(object);
}

/* A new reference, or NULL, without an exception, behind the end: others may shorten a list. */
static PyObject *
item_of(PyObject *sequence, Py_ssize_t k)
{
#if PY_VERSION_HEX >= 0x030d0000
    if (PyList_CheckExact(sequence)) {
        PyObject *item = PyList_GetItemRef(sequence, k);
        if (item == NULL) {
            PyErr_Clear();
        }
        return item;
    }
#endif
    return k < PySequence_Fast_GET_SIZE(sequence) ? Py_NewRef(PySequence_Fast_GET_ITEM(sequence, k))
                                                  : NULL;
}

/* n numbers of a list or tuple of so many, or of an array of float64. */
static bool
numbers_of(PyObject *row, npy_intp n, double *values)
{
    bool are_numbers = true;
    if (PyArray_CheckExact(row)) {
        PyArrayObject *array = (PyArrayObject *)row;
        if (PyArray_TYPE(array) != NPY_DOUBLE || !PyArray_ISNBO(PyArray_DESCR(array)->byteorder) ||
            PyArray_NDIM(array) != 1 || PyArray_DIM(array, 0) != n) {
            return false;
        }
        for (npy_intp k = 0; k < n; k++) {
            memcpy(&values[k], PyArray_GETPTR1(array, k), sizeof values[k]);
        }
        return true;
    }
    if (!is_sequence(row) || PySequence_Fast_GET_SIZE(row) != n) {
        return false;
    }
    for (npy_intp k = 0; are_numbers && k < n; k++) {
        PyObject *item = item_of(row, k);
        are_numbers = item != NULL && number_of(item, &values[k]);
        Py_XDECREF(item);
    }
    return are_numbers;
}

/* Rows of n numbers each, as an array; *array is NULL where they are something else. */
static outcome
rows_of(PyObject *rows, Py_ssize_t n_rows, npy_intp n, PyObject **array)
{
    npy_intp shape[2] = {n_rows, n};
    bool     are_rows = true;
    *array = NULL;
    if (n < 1 || n > HS_MAX_DIM || n_rows > SMALL / (npy_intp)sizeof(double) / n) {
        return IS_NOT_PLAIN;
    }
    *array = PyArray_SimpleNew(2, shape, NPY_DOUBLE);
    if (*array == NULL) {
        return FAILED;
    }
    double *to = PyArray_DATA((PyArrayObject *)*array);
    for (Py_ssize_t k = 0; are_rows && k < n_rows; k++, to += n) {
        PyObject *row = item_of(rows, k);
        are_rows = row != NULL && numbers_of(row, n, to);
        Py_XDECREF(row);
    }
    if (!are_rows) {
        Py_CLEAR(*array);
    }
    return are_rows ? IS_PLAIN : IS_NOT_PLAIN;
}

/* How many entries a row has; -1 where it is none. */
static npy_intp
width_of(PyObject *rows)
{
    npy_intp  n = -1;
    PyObject *row = item_of(rows, 0);
    if (row != NULL && is_sequence(row)) {
        n = PySequence_Fast_GET_SIZE(row);
    } else if (row != NULL && PyArray_CheckExact(row) && PyArray_NDIM((PyArrayObject *)row) == 1) {
        n = PyArray_DIM((PyArrayObject *)row, 0);
    }
    Py_XDECREF(row);
    return n;
}

/* ---- arrays ------------------------------------------------------------------------------- */

/* Whether float64 holds exactly what these were, which are the nearest to integers of 64 bits. */
static bool
are_exact(PyArrayObject *array)
{
    const double  *values = PyArray_DATA(array);
    const npy_intp n = PyArray_SIZE(array);
    for (npy_intp k = 0; k < n; k++) {
        if (!(values[k] < (double)BIGGEST_INTEGER && values[k] > -(double)BIGGEST_INTEGER)) {
            return false;
        }
    }
    return true;
}

/* An array of real numbers as one of native float64, or float32 where it has these; itself if it is
 * one, with any strides. */
static outcome
native_of(quick_call *call, PyObject **place)
{
    PyArrayObject *array = (PyArrayObject *)*place;
    const int      type = PyArray_TYPE(array);
    if ((type == NPY_DOUBLE || type == NPY_FLOAT) && !PyArray_ISBYTESWAPPED(array)) {
        return IS_PLAIN;
    }
    if ((type != NPY_DOUBLE && type != NPY_FLOAT && type != NPY_HALF && type != NPY_BOOL &&
         !PyTypeNum_ISINTEGER(type)) ||
        PyArray_SIZE(array) > SMALL / (npy_intp)sizeof(double)) {
        return IS_NOT_PLAIN;
    }
    const bool is_wide = PyTypeNum_ISINTEGER(type) && PyArray_ITEMSIZE(array) > 4;
    PyObject  *made = PyArray_Cast(array, type == NPY_FLOAT ? NPY_FLOAT : NPY_DOUBLE);
    if (made != NULL && is_wide && !are_exact((PyArrayObject *)made)) {
        Py_DECREF(made);
        return IS_NOT_PLAIN;
    }
    call->has_copies = true;
    return put(call, place, made);
}

/* Points of as many dimensions as those before, if there were any (0: none). */
static outcome
take_points(quick_call *call, PyObject **place)
{
    PyObject *made;
    if (PyArray_CheckExact(*place)) {
        PyArrayObject *array = (PyArrayObject *)*place;
        if (PyArray_NDIM(array) != 2 || PyArray_DIM(array, 0) > INT32_MAX ||
            PyArray_DIM(array, 1) < 1 || PyArray_DIM(array, 1) > HS_MAX_DIM) {
            return IS_NOT_PLAIN;
        }
        call->ndim = (int)PyArray_DIM(array, 1);
        return native_of(call, place);
    }
    if (!is_sequence(*place)) {
        return IS_NOT_PLAIN;
    }
    call->ndim = (int)width_of(*place);
    const outcome result = rows_of(*place, PySequence_Fast_GET_SIZE(*place), call->ndim, &made);
    return result == IS_PLAIN ? put(call, place, made) : result;
}

/* ---- the box ------------------------------------------------------------------------------ */

/* What lies behind an object of halfshell.Box, else the object itself. */
static outcome
open_box(quick_call *call, PyObject **place)
{
    if (call->known[HS_BOX_TYPE] != (PyObject *)Py_TYPE(*place)) {
        return IS_PLAIN;
    }
    return put(call, place, PyObject_GetAttrString(*place, "_vectors"));
}

static outcome
take_box_array(quick_call *call, PyObject **place)
{
    PyArrayObject *array = (PyArrayObject *)*place;
    const int      n_axes = PyArray_NDIM(array), d = call->ndim;
    if (n_axes < 1 || n_axes > 2 || PyArray_DIM(array, 0) != d ||
        PyArray_DIM(array, n_axes - 1) != d) {
        return IS_NOT_PLAIN;
    }
    const outcome result = native_of(call, place);
    array = (PyArrayObject *)*place;
    if (result != IS_PLAIN || (PyArray_TYPE(array) == NPY_DOUBLE && PyArray_ISCARRAY_RO(array))) {
        return result;
    }
    call->has_copies = true;
    return put(call, place, PyArray_FROMANY(*place, NPY_DOUBLE, 1, 2, NPY_ARRAY_CARRAY_RO));
}

/* None, rows, lengths, or one for all edges. */
static outcome
take_box(quick_call *call, PyObject **place)
{
    double   length;
    npy_intp d = call->ndim;
    if (*place == Py_None) {
        return IS_PLAIN;
    }
    const outcome opened = open_box(call, place);
    if (opened != IS_PLAIN || PyArray_CheckExact(*place)) {
        return opened == IS_PLAIN ? take_box_array(call, place) : opened;
    }
    const bool is_one = scalar_of(*place, &length);
    if (!is_one && (!is_sequence(*place) || PySequence_Fast_GET_SIZE(*place) != d)) {
        return IS_NOT_PLAIN;
    }
    if (!is_one && width_of(*place) >= 0) {
        PyObject     *rows;
        const outcome result = rows_of(*place, d, d, &rows);
        return result == IS_PLAIN ? put(call, place, rows) : result;
    }
    PyObject *lengths = PyArray_SimpleNew(1, &d, NPY_DOUBLE);
    if (lengths == NULL) {
        return FAILED;
    }
    double *to = PyArray_DATA((PyArrayObject *)lengths);
    for (int k = 0; is_one && k < d; k++) {
        to[k] = length;
    }
    if (!is_one && !numbers_of(*place, d, to)) {
        Py_DECREF(lengths);
        return IS_NOT_PLAIN;
    }
    return put(call, place, lengths);
}

/* A bool or 0 or 1 for an axis. */
static bool
repeats_of(PyObject *item, bool *repeats)
{
    double number;
    if (truth_of(item, repeats)) {
        return true;
    }
    *repeats = PyLong_CheckExact(item) && number_of(item, &number) && number == 1.0;
    return *repeats || (PyLong_CheckExact(item) && number_of(item, &number) && number == 0.0);
}

/* None, a bool, or d of them -> bits. Without a box they are an error unless none repeats. */
static outcome
take_periodic(quick_call *call, PyObject **place, bool has_box)
{
    const int d = call->ndim, all = (1 << d) - 1;
    int       bits = 0;
    bool      one, is_plain = true;
    if (*place == Py_None) {
        bits = has_box ? all : 0;
    } else if (truth_of(*place, &one)) {
        bits = one ? all : 0;
    } else if (PyArray_CheckExact(*place)) {
        PyArrayObject *array = (PyArrayObject *)*place;
        is_plain = PyArray_TYPE(array) == NPY_BOOL && PyArray_NDIM(array) == 1 &&
                   PyArray_DIM(array, 0) == d;
        for (int l = 0; is_plain && l < d; l++) {
            bits |= (*(npy_bool *)PyArray_GETPTR1(array, l) != 0) << l;
        }
    } else {
        is_plain = is_sequence(*place) && PySequence_Fast_GET_SIZE(*place) == d;
        for (int l = 0; is_plain && l < d; l++) {
            PyObject *item = item_of(*place, l);
            is_plain = item != NULL && repeats_of(item, &one);
            bits |= (is_plain && one) << l;
            Py_XDECREF(item);
        }
    }
    return is_plain && (has_box || bits == 0) ? put(call, place, PyLong_FromLong(bits))
                                              : IS_NOT_PLAIN;
}

/* ---- other arguments ---------------------------------------------------------------------- */

static outcome
take_length(quick_call *call, PyObject **place)
{
    double value;
    if (PyFloat_Check(*place)) {
        return IS_PLAIN;
    }
    return scalar_of(*place, &value) ? put(call, place, PyFloat_FromDouble(value)) : IS_NOT_PLAIN;
}

/* Where it is infinite, a finite one is found that holds all pairs. Bits are compared, as a
 * subnormal number may be a trap. */
static outcome
take_cutoff(quick_call *call, PyObject **place)
{
    const double  endless = (double)INFINITY;
    const outcome result = take_length(call, place);
    return result == IS_PLAIN &&
                   memcmp(&((PyFloatObject *)*place)->ob_fval, &endless, sizeof endless) == 0
               ? IS_NOT_PLAIN
               : result;
}

static outcome
take_flag(quick_call *call, PyObject **place)
{
    bool value;
    return truth_of(*place, &value) ? put(call, place, Py_NewRef(value ? Py_True : Py_False))
                                    : IS_NOT_PLAIN;
}

/* From 0 on. */
static outcome
take_max_distance(quick_call *call, PyObject **place)
{
    const outcome result = take_length(call, place);
    return result == IS_PLAIN && !(PyFloat_AS_DOUBLE(*place) >= 0.0) ? IS_NOT_PLAIN : result;
}

/* numpy.int32 or numpy.int64, a dtype of these, or a name of them -> bytes. */
static outcome
take_index(quick_call *call, PyObject **place)
{
    int type = NPY_NOTYPE;
    if (*place == (PyObject *)&PyInt64ArrType_Type) {
        type = NPY_INT64;
    } else if (*place == (PyObject *)&PyInt32ArrType_Type) {
        type = NPY_INT32;
    } else if (PyArray_DescrCheck(*place) && PyArray_ISNBO(((PyArray_Descr *)*place)->byteorder)) {
        type = ((PyArray_Descr *)*place)->type_num;
    } else if (PyUnicode_CheckExact(*place)) {
        const bool is_long = PyUnicode_CompareWithASCIIString(*place, "int64") == 0;
        type = is_long                                                  ? NPY_INT64
               : PyUnicode_CompareWithASCIIString(*place, "int32") == 0 ? NPY_INT32
                                                                        : NPY_NOTYPE;
    }
    return type == NPY_INT64 || type == NPY_INT32
               ? put(call, place, PyLong_FromLong(type == NPY_INT64 ? 8 : 4))
               : IS_NOT_PLAIN;
}

/* From 1 on, and no more than there could be of anything. */
static bool
is_count(PyObject *object)
{
    int             overflow = 0;
    const long long count =
        PyLong_CheckExact(object) ? PyLong_AsLongLongAndOverflow(object, &overflow) : 0;
    return overflow == 0 && count >= 1 && count <= MOST_COUNT;
}

static outcome
take_queries(quick_call *call, PyObject **place)
{
    const int ndim = call->ndim;
    if (*place == Py_None) {
        return IS_PLAIN;
    }
    const outcome result = take_points(call, place);
    return result == IS_PLAIN && call->ndim != ndim ? IS_NOT_PLAIN : result;
}

/* Replaces what was given for an argument by what the core takes. What is left as it is, the core
 * checks. */
static outcome
convert(quick_call *call, hs_kind kind, PyObject **place)
{
    switch (kind) {
    case HS_ARG_POINTS: return take_points(call, place);
    case HS_ARG_CUTOFF: return take_cutoff(call, place);
    case HS_ARG_MAX_DISTANCE: return take_max_distance(call, place);
    case HS_ARG_BOX: return take_box(call, place);
    case HS_ARG_PERIODIC: return take_periodic(call, place, call->given[2] != Py_None);
    case HS_ARG_INCLUSIVE:
    case HS_ARG_SORT: return take_flag(call, place);
    case HS_ARG_INDEX: return take_index(call, place);
    case HS_ARG_INTEGER: return is_count(*place) ? IS_PLAIN : IS_NOT_PLAIN;
    case HS_ARG_PROGRESS:
        return *place == Py_None || PyCallable_Check(*place) ? IS_PLAIN : IS_NOT_PLAIN;
    case HS_ARG_OTHER_POINTS: return *place == Py_None ? IS_NOT_PLAIN : take_queries(call, place);
    case HS_ARG_QUERIES: return take_queries(call, place);
    default: return IS_PLAIN;
    }
}

/* ---- calls -------------------------------------------------------------------------------- */

enum { PRECISION = 2, N_SETTINGS = 5 };

#define PERIODIC (1u << 3) /* among those that are placed */

/* A function of the table, with what a call of it begins with. */
typedef struct quick_row {
    const hs_function *function;
    PyObject          *module; /* owned, and all objects below */
    int                n_public, n_positional, n_core;
    PyObject          *names[HS_MOST_PUBLIC];
    int       places[HS_MOST_PUBLIC]; /* in the order of the core; -1: only Python takes it */
    PyObject *others[HS_MOST_PUBLIC]; /* what these are where they are left out */
    PyObject *usual[MOST_CORE];       /* NULL: it must be given */
    int       settings[N_SETTINGS];   /* places of those that are set around calls */
} quick_row;

/* Where a public argument stands among those of this name; -1: nowhere. */
static int
find_name(const quick_row *row, PyObject *name)
{
    for (int k = 0; k < row->n_public; k++) {
        if (row->names[k] == name) { /* names in programs are interned */
            return k;
        }
    }
    for (int k = 0; k < row->n_public; k++) {
        if (PyUnicode_Check(name) && PyUnicode_Compare(row->names[k], name) == 0) {
            return k;
        }
    }
    return -1;
}

/* Puts one argument into its place; false if only Python knows what to do with it. */
static bool
place_one(const quick_row *row, int k, PyObject *value, quick_call *call)
{
    if (row->places[k] < 0) {
        return value == row->others[k];
    }
    call->placed |= 1u << row->places[k];
    /* Held: a signal handler might change the options. */
    return put(call, &call->given[row->places[k]], Py_NewRef(value)) == IS_PLAIN;
}

/* Whether all arguments have a place, and all that must be given are. */
static bool
place(const quick_row *row, PyObject *arguments, PyObject *options, quick_call *call)
{
    const Py_ssize_t n_given = PyTuple_GET_SIZE(arguments);
    PyObject        *name, *value;
    Py_ssize_t       at = 0;
    bool             are_placed = n_given <= row->n_positional;
    for (Py_ssize_t k = 0; are_placed && k < n_given; k++) {
        are_placed = place_one(row, (int)k, PyTuple_GET_ITEM(arguments, k), call);
    }
    while (are_placed && PyDict_Next(options, &at, &name, &value)) {
        const int k = find_name(row, name);
        are_placed = k >= n_given && place_one(row, k, value, call);
    }
    for (int k = 0; are_placed && k < call->n; k++) {
        are_placed = call->given[k] != NULL;
    }
    return are_placed;
}

/* What is set around this call, a tuple that halfshell.settings has checked: kernel, algorithm,
 * precision, memory_limit, and threads for a call that does not say how many. */
static outcome
take_settings(const quick_row *row, quick_call *call)
{
    PyObject *var = call->known[HS_SETTINGS], *set = NULL;
    if (var == NULL) {
        return IS_PLAIN;
    }
    if (PyContextVar_Get(var, NULL, &set) < 0) {
        return FAILED;
    }
    const bool is_usual = set == NULL || set == call->known[HS_USUAL_SETTINGS];
    const bool is_known = is_usual || (PyTuple_Check(set) && PyTuple_GET_SIZE(set) == N_SETTINGS);
    for (int k = 0; !is_usual && is_known && k < N_SETTINGS; k++) {
        const int at = row->settings[k];
        if (at >= 0 && (k < N_SETTINGS - 1 || call->given[at] == Py_None)) {
            (void)put(call, &call->given[at], Py_NewRef(PyTuple_GET_ITEM(set, k)));
        }
    }
    Py_XDECREF(set);
    return is_known ? IS_PLAIN : IS_NOT_PLAIN;
}

/* Points that know nothing more than where they are, and their box. */
static outcome
open_points(quick_call *call, PyObject **points, bool *has_bits)
{
    static const char *const others[] = {"radii", "supports", "batch", "_groups"};
    PyObject                *parts[3] = {NULL};
    static const char *const names[3] = {"positions", "_box", "_axes"};
    *has_bits = call->known[HS_POINTS_TYPE] == (PyObject *)Py_TYPE(*points);
    if (!*has_bits) {
        return IS_PLAIN;
    }
    outcome result = call->given[2] == Py_None && call->given[3] == Py_None ? IS_PLAIN
                                                                            : IS_NOT_PLAIN;
    for (size_t k = 0; result == IS_PLAIN && k < sizeof others / sizeof others[0]; k++) {
        PyObject *part = PyObject_GetAttrString(*points, others[k]);
        result = part == NULL ? FAILED : part == Py_None ? IS_PLAIN : IS_NOT_PLAIN;
        Py_XDECREF(part);
    }
    for (int k = 0; result == IS_PLAIN && k < 3; k++) {
        parts[k] = PyObject_GetAttrString(*points, names[k]);
        result = parts[k] == NULL ? FAILED : IS_PLAIN;
    }
    for (int k = 0; k < 3; k++) {
        if (result == IS_PLAIN) {
            (void)put(call, &call->given[k == 0 ? 0 : k + 1], parts[k]);
        } else {
            Py_XDECREF(parts[k]);
        }
    }
    return result;
}

/* Arguments as they were given to those of the core. */
static outcome
convert_all(const quick_row *row, quick_call *call)
{
    bool    has_bits = false, has_out = false;
    outcome result = take_settings(row, call);
    if (result == IS_PLAIN) {
        result = open_points(call, &call->given[0], &has_bits);
    }
    call->placed |= PERIODIC; /* which depends on the box */
    call->placed &= has_bits ? ~PERIODIC : ~0u;
    if (result == IS_PLAIN && call->given[1] == Py_None) { /* left out: by radii, or refused */
        return IS_NOT_PLAIN;
    }
    for (int k = 0; result == IS_PLAIN && k < call->n; k++) {
        if (call->placed >> k & 1) {
            const hs_kind kind = hs_argument_at(row->function, k)->kind;
            result = convert(call, kind, &call->given[k]);
            has_out = has_out || (kind == HS_ARG_OUT && call->given[k] != Py_None);
        }
    }
    return result == IS_PLAIN && has_out && call->has_copies ? IS_NOT_PLAIN : result;
}

/* A box of lengths as one of rows; that of rows, and none, as it is. */
static outcome
take_rows(quick_call *call, PyObject **box)
{
    PyArrayObject *lengths = (PyArrayObject *)*box;
    if (*box == Py_None || PyArray_NDIM(lengths) == 2) {
        return IS_PLAIN;
    }
    npy_intp  d = PyArray_DIM(lengths, 0), shape[2] = {d, d};
    PyObject *rows = PyArray_ZEROS(2, shape, NPY_DOUBLE, 0);
    for (npy_intp k = 0; rows != NULL && k < d; k++) {
        ((double *)PyArray_DATA((PyArrayObject *)rows))[k * d + k] =
            ((const double *)PyArray_DATA(lengths))[k];
    }
    return put(call, box, rows);
}

PyObject *
hs_py_scene(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    enum { N = 4 };
    quick_call call = {.known = PyModule_GetState(module), .n = N};
    PyObject **points = &call.given[0], **queries = &call.given[1], **box = &call.given[2],
             **periodic = &call.given[3], *result = NULL;
    bool has_bits;
    if (!hs_expect_arguments("scene", n_arguments, N)) {
        return NULL;
    }
    for (int k = 0; k < N; k++) {
        (void)put(&call, &call.given[k], Py_NewRef(arguments[k]));
    }
    outcome made = open_points(&call, points, &has_bits);
    made = made == IS_PLAIN ? take_points(&call, points) : made;
    made = made == IS_PLAIN ? take_box(&call, box) : made;
    made = made == IS_PLAIN ? take_rows(&call, box) : made;
    made = made == IS_PLAIN && !has_bits ? take_periodic(&call, periodic, *box != Py_None) : made;
    made = made == IS_PLAIN ? take_queries(&call, queries) : made;
    if (made == IS_PLAIN) {
        result = PyTuple_Pack(N, *queries, *points, *box, *periodic);
    } else if (made == IS_NOT_PLAIN) {
        result = Py_NewRef(Py_NotImplemented);
    }
    let_go(&call);
    return result;
}

static const char ROW[] = "halfshell._core.quick";

static PyObject *
attempt(PyObject *self, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    const quick_row *row = PyCapsule_GetPointer(self, ROW);
    PyObject        *result = NULL;
    if (row == NULL) {
        return NULL;
    }
    if (n_arguments != 2 || !PyTuple_CheckExact(arguments[0]) || !PyDict_CheckExact(arguments[1])) {
        PyErr_SetString(PyExc_TypeError, "expected a tuple and a dict of arguments");
        return NULL;
    }
    quick_call call;
    call.known = PyModule_GetState(row->module);
    call.n = row->n_core;
    call.owned = call.placed = 0;
    call.has_copies = false;
    memcpy(call.given, row->usual, sizeof call.given);
    const outcome converted =
        place(row, arguments[0], arguments[1], &call) ? convert_all(row, &call) : IS_NOT_PLAIN;
    if (converted == IS_PLAIN) {
        result = row->function->body(row->module, call.given, call.n);
    } else if (converted == IS_NOT_PLAIN) {
        result = Py_NewRef(Py_NotImplemented);
    }
    let_go(&call);
    return result;
}

/* ---- the table ---------------------------------------------------------------------------- */

static void
free_row(PyObject *capsule)
{
    quick_row *row = PyCapsule_GetPointer(capsule, ROW);
    for (int k = 0; k < HS_MOST_PUBLIC; k++) {
        Py_XDECREF(row->names[k]);
        Py_XDECREF(row->others[k]);
    }
    for (int k = 0; k < MOST_CORE; k++) {
        Py_XDECREF(row->usual[k]);
    }
    Py_XDECREF(row->module);
    PyMem_Free(row);
}

/* The object that Python writes so, as the core takes it; a new reference or NULL. */
static PyObject *
object_of(const char *text)
{
    if (text[0] == '\'') {
        return PyUnicode_FromStringAndSize(text + 1, (Py_ssize_t)strlen(text) - 2);
    }
    if (text[0] >= '0' && text[0] <= '9') {
        return PyLong_FromString(text, NULL, 10);
    }
    return strcmp(text, "numpy.int64") == 0 ? PyLong_FromLong(8)
           : strcmp(text, "inf") == 0       ? PyFloat_FromDouble((double)INFINITY)
           : strcmp(text, "True") == 0      ? Py_NewRef(Py_True)
           : strcmp(text, "False") == 0     ? Py_NewRef(Py_False)
                                            : Py_NewRef(Py_None);
}

/* The argument of this name, and its place in the order of the core; -1: only Python takes it. */
static const hs_argument *
argument_of(const hs_function *function, const char *name, int *place)
{
    const hs_argument *argument;
    for (*place = 0; (argument = hs_argument_at(function, *place))->name != NULL; ++*place) {
        if (strcmp(argument->name, name) == 0) {
            return argument;
        }
    }
    *place = -1;
    argument = HS_ONLY_PYTHON;
    while (argument->name != NULL && strcmp(argument->name, name) != 0) {
        argument++;
    }
    return argument;
}

/* Fills the row, which has zeros. */
static bool
fill_row(quick_row *row)
{
    static const char *const settings[N_SETTINGS] = {"kernel", "algorithm", "precision",
                                                     "memory_limit", "threads"};
    const hs_function       *function = row->function;
    const hs_argument       *argument;
    for (; (argument = hs_argument_at(function, row->n_core))->name != NULL; row->n_core++) {
        if (argument->usual != NULL) {
            row->usual[row->n_core] = object_of(argument->usual);
            if (row->usual[row->n_core] == NULL) {
                return false;
            }
        }
    }
    for (const char *const *name = function->users; *name != NULL; name++) {
        if (**name == '*') {
            row->n_positional = row->n_public;
            continue;
        }
        const int k = row->n_public++;
        argument = argument_of(function, *name, &row->places[k]);
        row->names[k] = PyUnicode_InternFromString(*name);
        row->others[k] = row->places[k] < 0 ? object_of(argument->usual) : Py_NewRef(Py_None);
        if (row->names[k] == NULL || row->others[k] == NULL) {
            return false;
        }
    }
    for (int k = 0; k < N_SETTINGS; k++) {
        (void)argument_of(function, settings[k], &row->settings[k]);
        if (function->is_by_rank && k == PRECISION) {
            row->settings[k] = -1;
        }
    }
    return true;
}

PyObject *
hs_py_quick(PyObject *module, PyObject *name)
{
    static PyMethodDef method = {"attempt", (PyCFunction)(void (*)(void))attempt, METH_FASTCALL,
                                 "What the function returns, or NotImplemented."};
    int                number = 0;
    while (number < HS_FUNCTIONS &&
           !(hs_functions[number].users[0] != NULL && PyUnicode_Check(name) &&
             PyUnicode_CompareWithASCIIString(name, hs_functions[number].name) == 0)) {
        number++;
    }
    if (number == HS_FUNCTIONS) {
        return PyErr_Format(PyExc_ValueError, "no function for users is called %R", name);
    }
    quick_row *row = PyMem_Calloc(1, sizeof *row);
    PyObject  *capsule = row != NULL ? PyCapsule_New(row, ROW, free_row) : PyErr_NoMemory();
    if (capsule == NULL) {
        PyMem_Free(row);
        return NULL;
    }
    row->function = &hs_functions[number];
    row->module = Py_NewRef(module);
    PyObject *made = fill_row(row) ? PyCFunction_New(&method, capsule) : NULL;
    Py_DECREF(capsule);
    return made;
}

/* Appends a new reference to the list, or gives up both. */
static PyObject *
appended(PyObject *list, PyObject *entry)
{
    if (list != NULL && (entry == NULL || PyList_Append(list, entry) < 0)) {
        Py_CLEAR(list);
    }
    Py_XDECREF(entry);
    return list;
}

/* Name, usual value and whether it is positional, of each argument for users. */
static PyObject *
arguments_of_users(const hs_function *function)
{
    PyObject *list = PyList_New(0);
    bool      is_positional = true;
    for (const char *const *name = function->users; list != NULL && *name != NULL; name++) {
        int place;
        if (**name == '*') {
            is_positional = false;
            continue;
        }
        list = appended(list,
                        Py_BuildValue("(szO)", *name, argument_of(function, *name, &place)->usual,
                                      is_positional ? Py_True : Py_False));
    }
    return list;
}

/* Name of each argument in the order of the core, and whether it may be left out with all that
 * follow. */
static PyObject *
arguments_of_core(const hs_function *function)
{
    PyObject          *list = PyList_New(0);
    const hs_argument *argument;
    for (int k = 0; list != NULL && (argument = hs_argument_at(function, k))->name != NULL; k++) {
        const bool may_lack = argument->kind >= HS_ARG_FIRST_OPTIONAL;
        list = appended(list, Py_BuildValue("(sO)", argument->name, may_lack ? Py_True : Py_False));
    }
    return list;
}

PyObject *
hs_py_table(PyObject *module, PyObject *ignored)
{
    PyObject *dict = PyDict_New();
    (void)module;
    (void)ignored;
    for (int k = 0; dict != NULL && k < HS_FUNCTIONS; k++) {
        PyObject *core = arguments_of_core(&hs_functions[k]);
        PyObject *users = core != NULL ? arguments_of_users(&hs_functions[k]) : NULL;
        /* "N" takes both over, also where one is NULL. */
        if (!hs_dict_put(dict, hs_functions[k].name, Py_BuildValue("(NN)", core, users))) {
            Py_CLEAR(dict);
        }
    }
    return dict;
}

PyObject *
hs_py_know(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    static const struct {
        const char *name;
        int         place;
    } things[] = {{"Box", HS_BOX_TYPE}, {"Points", HS_POINTS_TYPE}, {"settings", HS_SETTINGS}};
    PyObject **known = PyModule_GetState(module);
    if (!hs_expect_arguments("know", n_arguments, 2)) {
        return NULL;
    }
    for (size_t k = 0; k < sizeof things / sizeof things[0] && PyUnicode_Check(arguments[0]); k++) {
        if (PyUnicode_CompareWithASCIIString(arguments[0], things[k].name) != 0) {
            continue;
        }
        if (things[k].place == HS_SETTINGS) {
            PyObject *usual = NULL;
            if (PyContextVar_Get(arguments[1], NULL, &usual) < 0) {
                return NULL;
            }
            Py_XSETREF(known[HS_USUAL_SETTINGS], usual);
        }
        Py_XSETREF(known[things[k].place], Py_NewRef(arguments[1]));
        Py_RETURN_NONE;
    }
    PyErr_SetString(PyExc_ValueError, "know takes \"Box\", \"Points\" or \"settings\"");
    return NULL;
}
