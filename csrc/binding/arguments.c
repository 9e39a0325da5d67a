/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * arguments.c: numbers first, views last. What is taken when is the order of hs_py_call_take.
 *
 * Of users only that is taken which is harmless: exact types of Python and NumPy, whose conversion
 * runs no code of others, with exactly the values that _convert/ makes of it.
 */
#include "arguments.h"

#include "errors.h"
#include "outputs.h"
#include "py_functions.h"
#include "system.h"

#include <numpy/arrayscalars.h>
#include <math.h>
#include <string.h>

/* Points below which a search is expected to be over before another thread could take the GIL: it
 * is kept until the first poll. */
#define FEW_POINTS 256

/* Bytes of a conversion from which _convert/ first looks what the machine has left. */
#define SMALL ((npy_intp)1 << 26)

#define BIGGEST_INTEGER (INT64_C(1) << 53) /* up to here float64 holds every integer */

#define MOST_COUNT (INT64_C(1) << 56) /* more than fits in any memory */

/* ---- arrays as the core takes them -------------------------------------------------------- */

bool
hs_is_array(PyObject *object, int type, int n_axes)
{
    PyArrayObject *array = (PyArrayObject *)object;
    return PyArray_Check(object) && PyArray_TYPE(array) == type && PyArray_ISCARRAY_RO(array) &&
           PyArray_NDIM(array) == n_axes;
}

bool
hs_entries_of(PyObject *object, int type, int n_axes, int64_t length, int64_t width,
              const void **entries)
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
    *entries = fits ? PyArray_DATA(array) : NULL;
    return fits;
}

int64_t
hs_length_of(PyObject *object)
{
    return object != Py_None ? PyArray_DIM((PyArrayObject *)object, 0) : 0;
}

bool
hs_points_of(PyObject *object, hs_points *points)
{
    PyArrayObject *array = (PyArrayObject *)object;
    const bool     has_rows = PyArray_Check(object) && PyArray_NDIM(array) == 2;
    const int      type = has_rows ? PyArray_TYPE(array) : NPY_NOTYPE;
    const npy_intp d = has_rows ? PyArray_DIM(array, 1) : 0;
    if ((type != NPY_FLOAT && type != NPY_DOUBLE) || PyArray_ISBYTESWAPPED(array) || d < 1 ||
        d > HS_MAX_DIM) {
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
hs_box_of(PyObject *object, unsigned long repeats, int ndim, hs_box *box)
{
    PyArrayObject *array = (PyArrayObject *)object;
    const bool     has_rows = hs_is_array(object, NPY_DOUBLE, 2);
    if ((!has_rows && !hs_is_array(object, NPY_DOUBLE, 1)) || PyArray_DIM(array, 0) != ndim ||
        (has_rows && PyArray_DIM(array, 1) != ndim)) {
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

/* ---- numbers and sequences ---------------------------------------------------------------- */

/* A float or a small integer, of Python itself or NumPy's float64. */
static bool
usual_number_of(PyObject *object, double *value)
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

bool
hs_number_of(PyObject *object, double *value)
{
    const PyTypeObject *type = Py_TYPE(object);
    int64_t             whole;
    if (usual_number_of(object, value)) {
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

/* The entries of a list or tuple, or of a short array with one axis, as one of the former: a new
 * reference; NULL for all else. */
static PyObject *
entries_of(PyObject *object)
{
    const bool is_row = PyArray_CheckExact(object) && PyArray_NDIM((PyArrayObject *)object) == 1 &&
                        PyArray_DIM((PyArrayObject *)object, 0) <= HS_MAX_DIM;
    return is_row ? PySequence_List(object) : is_sequence(object) ? Py_NewRef(object) : NULL;
}

bool
hs_numbers_of(PyObject *object, npy_intp n, double *values)
{
    if (PyArray_CheckExact(object) && hs_is_array(object, NPY_DOUBLE, 1) &&
        hs_length_of(object) == n) {
        memcpy(values, PyArray_DATA((PyArrayObject *)object), (size_t)n * sizeof *values);
        return true;
    }
    PyObject *row = entries_of(object);
    bool      are_numbers = row != NULL && PySequence_Fast_GET_SIZE(row) == n;
    for (npy_intp k = 0; are_numbers && k < n; k++) {
        PyObject *item = item_of(row, k);
        are_numbers = item != NULL && usual_number_of(item, &values[k]);
        Py_XDECREF(item);
    }
    Py_XDECREF(row);
    return are_numbers;
}

/* n rows of as many numbers each, with those of the next row so many further on. */
static bool
rows_of(PyObject *rows, Py_ssize_t n, npy_intp width, npy_intp stride, double *values)
{
    bool are_rows = true;
    for (Py_ssize_t k = 0; are_rows && k < n; k++) {
        PyObject *row = item_of(rows, k);
        are_rows = row != NULL && hs_numbers_of(row, width, values + k * stride);
        Py_XDECREF(row);
    }
    return are_rows;
}

/* How many entries the first row has; -1 where it is none. */
static npy_intp
width_of(PyObject *rows)
{
    PyObject      *row = item_of(rows, 0), *first = row != NULL ? entries_of(row) : NULL;
    const npy_intp n = first != NULL ? PySequence_Fast_GET_SIZE(first) : -1;
    Py_XDECREF(first);
    Py_XDECREF(row);
    return n;
}

/* An object that views borrow from, kept until the call ends; takes the reference. */
static bool
keep(hs_py_call *call, PyObject *made)
{
    if (made != NULL) {
        call->made[call->n_made++] = made;
    }
    return made != NULL;
}

/* ---- points ------------------------------------------------------------------------------- */

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

/* An array of real numbers as one of native float64, and C-contiguous if it is a box; or else of
 * float32 where it has these. Itself if it is one. */
static bool
native_of(hs_py_call *call, PyObject **object, bool is_box)
{
    PyArrayObject *array = (PyArrayObject *)*object;
    const int      type = PyArray_TYPE(array);
    const bool     is_float32 = type == NPY_FLOAT && !is_box;
    if (is_box ? type == NPY_DOUBLE && PyArray_ISCARRAY_RO(array)
               : (is_float32 || type == NPY_DOUBLE) && !PyArray_ISBYTESWAPPED(array)) {
        return true;
    }
    if ((type != NPY_DOUBLE && type != NPY_FLOAT && type != NPY_HALF && type != NPY_BOOL &&
         !PyTypeNum_ISINTEGER(type)) ||
        (is_box && type == NPY_BOOL) || PyArray_SIZE(array) > SMALL / (npy_intp)sizeof(double)) {
        return false;
    }
    const bool is_wide = PyTypeNum_ISINTEGER(type) && PyArray_ITEMSIZE(array) > 4;
    *object = PyArray_FROMANY(*object, is_float32 ? NPY_FLOAT : NPY_DOUBLE, 1, 2,
                              NPY_ARRAY_CARRAY_RO | NPY_ARRAY_FORCECAST);
    return keep(call, *object) && (!is_wide || are_exact((PyArrayObject *)*object));
}

/* Points as users give them, as an array that hs_points_of takes. */
static bool
plain_points(hs_py_call *call, PyObject **object)
{
    if (PyArray_CheckExact(*object)) {
        PyArrayObject *array = (PyArrayObject *)*object;
        return PyArray_NDIM(array) == 2 && PyArray_DIM(array, 0) <= INT32_MAX &&
               PyArray_DIM(array, 1) >= 1 && PyArray_DIM(array, 1) <= HS_MAX_DIM &&
               native_of(call, object, false);
    }
    npy_intp  shape[2] = {0, -1};
    PyObject *rows = *object;
    if (is_sequence(rows)) {
        shape[0] = PySequence_Fast_GET_SIZE(rows);
        shape[1] = width_of(rows);
    }
    if (shape[1] < 1 || shape[1] > HS_MAX_DIM ||
        shape[0] > SMALL / (npy_intp)sizeof(double) / shape[1]) {
        return false;
    }
    *object = PyArray_SimpleNew(2, shape, NPY_DOUBLE);
    return keep(call, *object) &&
           rows_of(rows, shape[0], shape[1], shape[1], PyArray_DATA((PyArrayObject *)*object));
}

static bool
take_points(hs_py_call *call, PyObject *object, hs_points *points, PyObject **array)
{
    if (call->is_of_users && !plain_points(call, &object)) {
        return false;
    }
    *array = object;
    return hs_points_of(object, points);
}

/* ---- the box, and axes that repeat -------------------------------------------------------- */

/* An array or Box, rows, lengths, or one for all edges. */
static bool
take_plain_box(hs_py_call *call, PyObject *object, double (*rows)[HS_MAX_DIM])
{
    double     length, lengths[HS_MAX_DIM];
    const int  d = call->points.at.ndim;
    PyObject **known = PyModule_GetState(call->module);
    if (known[HS_BOX_TYPE] == (PyObject *)Py_TYPE(object)) {
        object = PyObject_GetAttrString(object, "_vectors");
        if (!keep(call, object)) {
            return false;
        }
    }
    if (PyArray_CheckExact(object)) {
        PyArrayObject *array = (PyArrayObject *)object;
        const int      n_axes = PyArray_NDIM(array);
        return (n_axes == 1 || n_axes == 2) && PyArray_DIM(array, 0) == d &&
               PyArray_DIM(array, n_axes - 1) == d && native_of(call, &object, true) &&
               hs_box_of(object, 0, d, &call->box);
    }
    const bool is_one = hs_number_of(object, &length);
    memset(rows, 0, (size_t)d * sizeof *rows);
    if (!is_one && is_sequence(object) && PySequence_Fast_GET_SIZE(object) == d &&
        width_of(object) >= 0) {
        return rows_of(object, d, d, HS_MAX_DIM, rows[0]);
    }
    if (!is_one && (!is_sequence(object) || !hs_numbers_of(object, d, lengths))) {
        return false;
    }
    for (int l = 0; l < d; l++) {
        rows[l][l] = is_one ? length : lengths[l];
    }
    return true;
}

/* The box of all, or boxes of systems, in place of which it then has any rows. */
static bool
take_box(hs_py_call *call, PyObject *object)
{
    PyArrayObject *array = (PyArrayObject *)object;
    const int      d = call->points.at.ndim;
    if (object == Py_None) {
        return true;
    }
    call->among.box = &call->box;
    if (call->is_of_users) {
        if (!take_plain_box(call, object, call->box.rows)) {
            return false;
        }
    } else if (PyArray_Check(object) && PyArray_NDIM(array) == 3) {
        if (!hs_is_array(object, NPY_DOUBLE, 3) || PyArray_DIM(array, 1) != d ||
            PyArray_DIM(array, 2) != d) {
            return false;
        }
        call->each.rows = PyArray_DATA(array);
        for (int l = 0; l < d * HS_MAX_DIM; l++) {
            call->box.rows[l / HS_MAX_DIM][l % HS_MAX_DIM] = l % (HS_MAX_DIM + 1) == 0 ? 1.0 : 0.0;
        }
    } else if (!hs_box_of(object, 0, d, &call->box)) {
        return false;
    }
    call->box.ndim = d;
    for (int l = 0; l < d; l++) {
        call->box.periodic[l] = (call->repeats >> l & 1) != 0;
    }
    return true;
}

/* None, a bool, or d of them, which may be 0 and 1. Without a box they are an error unless none
 * repeats. */
static bool
take_plain_periodic(hs_py_call *call, PyObject *object, bool has_box)
{
    const int           d = call->points.at.ndim;
    const unsigned long all = (1ul << d) - 1;
    bool                one, is_plain = true;
    call->repeats = 0;
    if (object == Py_None) {
        call->repeats = has_box ? all : 0;
    } else if (truth_of(object, &one)) {
        call->repeats = one ? all : 0;
    } else {
        PyObject *row = entries_of(object);
        is_plain = row != NULL && PySequence_Fast_GET_SIZE(row) == d;
        for (int l = 0; is_plain && l < d; l++) {
            PyObject *item = item_of(row, l);
            double    number = -1.0;
            is_plain = item != NULL && (truth_of(item, &one) || (PyLong_CheckExact(item) &&
                                                                 usual_number_of(item, &number) &&
                                                                 (number == 0.0 || number == 1.0)));
            call->repeats |= (unsigned long)(number == 1.0 || (number < 0.0 && one)) << l;
            Py_XDECREF(item);
        }
        Py_XDECREF(row);
    }
    return is_plain && (has_box || call->repeats == 0);
}

/* Bits; or bits of each system, and then all axes of the box that they share. */
static bool
take_periodic(hs_py_call *call, PyObject *object, bool has_box)
{
    if (call->is_of_users) {
        return take_plain_periodic(call, object, has_box);
    }
    if (!PyArray_Check(object)) {
        return hs_repeats_of(object, &call->repeats);
    }
    if (!hs_is_array(object, NPY_UINT8, 1)) {
        return false;
    }
    /* In open space the axes only tell how many systems there are. */
    call->each.periodic = has_box ? PyArray_DATA((PyArrayObject *)object) : NULL;
    call->repeats = has_box ? (1ul << call->points.at.ndim) - 1 : 0;
    return true;
}

/* ---- numbers, flags and names ------------------------------------------------------------- */

/* The bit of a letter of HS_LETTERS is its HS_WANT_ bit. */
_Static_assert(HS_WANT_I == 1 && HS_WANT_J == 2 && HS_WANT_DISTANCE == 4 && HS_WANT_VECTOR == 8 &&
                   HS_WANT_SHIFT == 16 && HS_WANT_BOTH == 32 && HS_WANT_SHELL == 64,
               "take_quantities counts on this");

/* A string of the known letters, each at most once, and its HS_WANT_ bits. */
static bool
take_quantities(PyObject *object, const char *known, const char **letters, unsigned *want)
{
    *want = 0;
    *letters = PyUnicode_Check(object) ? PyUnicode_AsUTF8(object) : NULL;
    if (*letters == NULL) {
        PyErr_Clear(); /* of what UTF-8 does not write */
        return false;
    }
    for (const char *letter = *letters; *letter != '\0'; letter++) {
        const bool     is_known = strchr(known, *letter) != NULL;
        const unsigned bit = is_known ? 1u << (strchr(HS_LETTERS, *letter) - HS_LETTERS) : 0;
        if (bit == 0 || (*want & bit)) {
            return false;
        }
        *want |= bit;
    }
    return *want != 0;
}

/* The number of the name that it is, or -1. */
static int
number_of_name(PyObject *object, const char *const *names, int n)
{
    for (int k = 0; PyUnicode_Check(object) && k < n; k++) {
        if (PyUnicode_CompareWithASCIIString(object, names[k]) == 0) {
            return k;
        }
    }
    return -1;
}

/* Below are what halfshell.settings has checked. */
static bool
take_precision(PyObject *object, hs_precision *precision)
{
    static const char *const names[] = {"exact", "double", "single"};
    const int                k = number_of_name(object, names, 3);
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
    const int k = number_of_name(object, hs_algorithm_names, HS_ALGORITHM_END);
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
    return usual_number_of(object, &options->memory_limit) && options->memory_limit >= 0.0;
}

/* None is what the environment says. */
static bool
take_kernel(PyObject *object, const char **kernel)
{
    *kernel = object == Py_None         ? hs_environment_kernel()
              : PyUnicode_Check(object) ? PyUnicode_AsUTF8(object)
                                        : NULL;
    return object == Py_None || *kernel != NULL;
}

/* A number, or 0 for None: what that means depends on the points. */
static bool
take_threads(PyObject *object, hs_options *options)
{
    const long n = PyLong_CheckExact(object) ? PyLong_AsLong(object) : 0;
    PyErr_Clear(); /* of a number that is no long */
    options->threads = (int)n;
    if (n > HS_THREADS_PER_CORE && n <= HS_MOST_THREADS) {
        const int most = hs_most_threads();
        options->threads = n > most ? most : (int)n;
    }
    return object == Py_None || (n >= 1 && n <= HS_MOST_THREADS);
}

/* A length. An infinite cutoff of users is left to Python, which finds a finite one that holds all
 * pairs. The Python layer may also give an array of one for each system, see take_systems. */
static bool
take_cutoff(hs_py_call *call, PyObject *object)
{
    const double endless = (double)INFINITY;
    double      *cutoff = &call->options.cutoff;
    if (!call->is_of_users && PyArray_Check(object)) {
        *cutoff = 0.0;
        return true;
    }
    if (PyFloat_Check(object)) {
        *cutoff = PyFloat_AS_DOUBLE(object);
    } else if (!hs_number_of(object, cutoff)) {
        return false;
    }
    /* Bits are compared, as a subnormal number may be a trap. */
    return !call->is_of_users ||
           (call->function->is_by_rank ? *cutoff >= 0.0
                                       : memcmp(cutoff, &endless, sizeof endless) != 0);
}

/* numpy.int32 or numpy.int64, a dtype of these, or a name of them. */
static int
type_of_index(PyObject *object)
{
    if (object == (PyObject *)&PyInt64ArrType_Type) {
        return NPY_INT64;
    }
    if (object == (PyObject *)&PyInt32ArrType_Type) {
        return NPY_INT32;
    }
    if (PyArray_DescrCheck(object) && PyArray_ISNBO(((PyArray_Descr *)object)->byteorder)) {
        return ((PyArray_Descr *)object)->type_num;
    }
    const bool is_name = PyUnicode_CheckExact(object);
    return is_name && PyUnicode_CompareWithASCIIString(object, "int64") == 0   ? NPY_INT64
           : is_name && PyUnicode_CompareWithASCIIString(object, "int32") == 0 ? NPY_INT32
                                                                               : NPY_NOTYPE;
}

/* One of these; or, from the Python layer, the bytes of an index. */
static bool
take_index(hs_py_call *call, PyObject *object)
{
    int *bytes = &call->options.index_bytes;
    if (!call->is_of_users) {
        *bytes = PyLong_CheckExact(object) ? (int)PyLong_AsLong(object) : 0;
        return *bytes > 0;
    }
    const int type = type_of_index(object);
    *bytes = type == NPY_INT64 ? 8 : 4;
    return type == NPY_INT64 || type == NPY_INT32;
}

/* An integer; those that users give are counts. */
static bool
take_integer(hs_py_call *call, PyObject *object, int64_t *value)
{
    int overflow = 0;
    *value = PyLong_CheckExact(object) ? PyLong_AsLongLongAndOverflow(object, &overflow) : 0;
    return PyLong_CheckExact(object) && overflow == 0 &&
           (!call->is_of_users || (*value >= 1 && *value <= MOST_COUNT));
}

/* A number, flag or name; true also for what is none. */
static bool
take_number(hs_py_call *call, const hs_argument *argument, PyObject *object)
{
    hs_options *options = &call->options;
    switch (argument->kind) {
    case HS_ARG_CUTOFF: return take_cutoff(call, object);
    case HS_ARG_INCLUSIVE: return truth_of(object, &options->inclusive);
    case HS_ARG_PRECISION: return take_precision(object, &options->precision);
    case HS_ARG_KERNEL: return take_kernel(object, &options->kernel);
    case HS_ARG_MEMORY_LIMIT: return take_memory_limit(object, options);
    case HS_ARG_PROGRESS:
        call->progress = object == Py_None ? NULL : object;
        return object == Py_None || PyCallable_Check(object);
    case HS_ARG_THREADS: return take_threads(object, options);
    case HS_ARG_QUANTITIES:
        return take_quantities(object, argument->letters, &call->letters, &options->want);
    case HS_ARG_SORT: return truth_of(object, &options->sorted);
    case HS_ARG_INDEX: return take_index(call, object);
    case HS_ARG_FLAG: return truth_of(object, &call->flag);
    case HS_ARG_INTEGER: return take_integer(call, object, &call->integer);
    case HS_ARG_REAL: return usual_number_of(object, &call->real);
    case HS_ARG_ALGORITHM: return take_algorithm(object, &options->algorithm);
    default: return true;
    }
}

/* ---- sets of points, and what pairs them -------------------------------------------------- */

/* What the core's tuple of a set has behind the positions, for each point. */
static const struct {
    int    type, n_axes;
    size_t member; /* of hs_set */
} KNOWN[] = {
    {NPY_DOUBLE, 1, offsetof(hs_set, radii)}, {NPY_DOUBLE, 3, offsetof(hs_set, supports)},
    {NPY_INT32, 1, offsetof(hs_set, types)},  {NPY_DOUBLE, 1, offsetof(hs_set, weights)},
    {NPY_INT64, 1, offsetof(hs_set, groups)}, {NPY_INT64, 1, offsetof(hs_set, labels)},
};

enum { N_KNOWN = sizeof KNOWN / sizeof KNOWN[0], N_PARTS = N_KNOWN + 2 };

/* The parts of a set: an array, or a tuple of positions, what is known, and where systems begin. */
static bool
parts_of(PyObject **object, PyObject *const **known)
{
    *known = NULL;
    if (!PyTuple_CheckExact(*object)) {
        return true;
    }
    if (PyTuple_GET_SIZE(*object) != N_PARTS) {
        return false;
    }
    *known = &PyTuple_GET_ITEM(*object, 1);
    *object = PyTuple_GET_ITEM(*object, 0);
    return true;
}

static bool
take_known(PyObject *const *known, hs_set *set)
{
    for (int k = 0; known != NULL && k < N_KNOWN; k++) {
        const void *entries;
        if (!hs_entries_of(known[k], KNOWN[k].type, KNOWN[k].n_axes, set->at.n, set->at.ndim,
                           &entries)) {
            return false;
        }
        memcpy((char *)set + KNOWN[k].member, &entries, sizeof entries);
    }
    return true;
}

/* A rule, or None where the cutoff is that of all pairs; extent, or None; and table. */
static bool
take_reach(PyObject *const *of, hs_py_call *call)
{
    const hs_set *points = &call->points, *queries = &call->queries;
    const void   *table;
    const int64_t n_types = of[2] != Py_None && PyArray_Check(of[2]) ? hs_length_of(of[2]) : 0;
    if (of[0] == Py_None) {
        return true;
    }
    const long rule = PyLong_CheckExact(of[0]) ? PyLong_AsLong(of[0]) : -1;
    if (rule < 0 || rule >= HS_RULE_END || (of[1] != Py_None && !PyFloat_CheckExact(of[1])) ||
        !hs_entries_of(of[2], NPY_DOUBLE, 2, n_types, n_types, &table)) {
        return false;
    }
    call->among.reach = &call->reach;
    call->reach = (hs_reach){.rule = (hs_rule)rule,
                             .n_types = (int32_t)n_types,
                             .cutoffs = table,
                             .has_supports = points->supports != NULL || queries->supports != NULL,
                             .extent = of[1] != Py_None ? PyFloat_AS_DOUBLE(of[1]) : 0.0};
    return true;
}

/* By how much labels differ at most, or None; excluded pairs; numbers of queries that are points;
 * and the least distance. */
static bool
take_selection(PyObject *const *of, hs_py_call *call)
{
    const hs_set   *points = &call->points, *queries = &call->queries;
    const void     *numbers, *excluded;
    const long long within = PyLong_CheckExact(of[0]) ? PyLong_AsLongLong(of[0]) : 0;
    if ((of[0] != Py_None && !PyLong_CheckExact(of[0])) || within < 0 ||
        !PyFloat_CheckExact(of[3]) || !hs_entries_of(of[1], NPY_INT64, 2, -1, 2, &excluded) ||
        !hs_entries_of(of[2], NPY_INT64, 1, queries->at.n, 0, &numbers)) {
        return false;
    }
    call->selection =
        (hs_selection){.has_groups = points->groups != NULL || queries->groups != NULL,
                       .has_labels = of[0] != Py_None,
                       .query_numbers = numbers,
                       .within = within,
                       .n_excluded = hs_length_of(of[1]),
                       .excluded = excluded,
                       .min_distance = PyFloat_AS_DOUBLE(of[3])};
    const bool selects = call->selection.has_groups || call->selection.has_labels ||
                         excluded != NULL || call->selection.min_distance > 0.0;
    call->among.selection = selects ? &call->selection : NULL;
    return true;
}

/* A tuple of these seven. */
static bool
take_pairing(PyObject *object, hs_py_call *call)
{
    if (!PyTuple_Check(object) || PyTuple_GET_SIZE(object) != 7) {
        return false;
    }
    PyObject *const *of = &PyTuple_GET_ITEM(object, 0);
    return take_reach(of, call) && take_selection(of + 3, call);
}

/* ---- scenes ------------------------------------------------------------------------------- */

/* The value of an attribute, kept until the call ends; borrowed, or NULL. */
static PyObject *
attribute_of(hs_py_call *call, PyObject *object, const char *name)
{
    PyObject *value = PyObject_GetAttrString(object, name);
    return keep(call, value) ? value : NULL;
}

/* Of users: Points that know nothing more than where they are, and their box, which then is that of
 * the call. */
static bool
open_points(hs_py_call *call, PyObject **points, PyObject **box, PyObject **periodic)
{
    static const char *const others[] = {"radii", "supports", "batch", "_groups"};
    PyObject               **known = PyModule_GetState(call->module), *opened = *points;
    if (known[HS_POINTS_TYPE] != (PyObject *)Py_TYPE(opened)) {
        return true;
    }
    for (size_t k = 0; k < sizeof others / sizeof others[0]; k++) {
        if (attribute_of(call, opened, others[k]) != Py_None) {
            return false;
        }
    }
    if (*box != Py_None || *periodic != Py_None) {
        return false;
    }
    *points = attribute_of(call, opened, "positions");
    *box = *points != NULL ? attribute_of(call, opened, "_box") : NULL;
    PyObject *axes = *box != NULL ? attribute_of(call, opened, "_axes") : NULL;
    *periodic = NULL;
    return axes != NULL && hs_repeats_of(axes, &call->repeats);
}

bool
hs_py_call_scene(hs_py_call *call, PyObject *points, PyObject *box, PyObject *periodic)
{
    call->among.points = &call->points;
    call->among.cells = hs_cells_of(points);
    if (call->among.cells != NULL) {
        call->positions = points;
        hs_cells_points(call->among.cells, &call->points.at);
        call->points.at.data = NULL;
        return true;
    }
    return (!call->is_of_users || open_points(call, &points, &box, &periodic)) &&
           take_points(call, points, &call->points.at, &call->positions) &&
           (periodic == NULL || take_periodic(call, periodic, box != Py_None)) &&
           take_box(call, box);
}

static bool
take_queries(hs_py_call *call, PyObject *object)
{
    const hs_points *points = &call->points.at, *queries = &call->queries.at;
    call->among.queries = &call->queries;
    return take_points(call, object, &call->queries.at, &call->asked) &&
           queries->ndim == points->ndim;
}

/* Arrays of the caller's for `out`; of users, which share no memory with what they are made from:
 * the Python layer has seen to that. */
static bool
take_out(PyObject *const *of, hs_py_call *call)
{
    hs_options *options = &call->options;
    PyObject   *out = of[HS_ARG_OUT];
    PyObject   *inputs[] = {of[HS_ARG_QUERIES], of[HS_ARG_POINTS], of[HS_ARG_BOX],
                            of[HS_ARG_CUTOFF],  call->asked,       call->positions};
    call->out = out;
    options->out = &call->arrays;
    bool is_right =
        hs_out_of(out, call->letters, call->points.at.ndim, options->index_bytes, &call->arrays);
    for (size_t k = 0; is_right && call->is_of_users && k < sizeof inputs / sizeof inputs[0]; k++) {
        is_right = inputs[k] == NULL || hs_out_is_apart(out, call->letters, inputs[k]);
    }
    return is_right;
}

/* The cutoffs of shells, which go with their letter; NULL: one cutoff. */
static bool
take_shells(PyObject *object, hs_options *options)
{
    const bool is_wanted = options->want & HS_WANT_SHELL;
    if (object == NULL || !is_wanted || !hs_is_array(object, NPY_DOUBLE, 1)) {
        return object == NULL && !is_wanted;
    }
    options->n_shells = PyArray_DIM((PyArrayObject *)object, 0);
    options->shells = PyArray_DATA((PyArrayObject *)object);
    return true;
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

/* Where the systems of a batch begin among points and queries; each may have a cutoff, float64
 * (s,), a box, float64 (s, d, d), and bits of axes that repeat, uint8 (s,), of its own. */
static bool
take_systems(PyObject *const *known, PyObject *const *known_of_queries, hs_py_call *call)
{
    PyObject     *first = known != NULL ? known[N_KNOWN] : Py_None;
    PyObject     *first_query = known_of_queries != NULL ? known_of_queries[N_KNOWN] : Py_None;
    const void   *begins_of_queries;
    const int64_t n = hs_is_array(first, NPY_INT64, 1) ? hs_length_of(first) - 1 : -1;
    for (int k = 1; k < 4; k++) { /* cutoffs, boxes, axes */
        PyArrayObject *own = (PyArrayObject *)call->of[k];
        if (!PyArray_Check(call->of[k]) || (k == 2 && PyArray_NDIM(own) != 3)) {
            continue;
        }
        if ((k == 1 && !hs_is_array(call->of[k], NPY_DOUBLE, 1)) || PyArray_DIM(own, 0) != n) {
            return false;
        }
        call->each.cutoffs = k == 1 ? PyArray_DATA(own) : call->each.cutoffs;
    }
    if (first == Py_None) {
        return true;
    }
    if (call->among.cells != NULL || n < 0 || /* cells are of one system */
        !hs_entries_of(first_query, NPY_INT64, 1, n + 1, 0, &begins_of_queries)) {
        return false;
    }
    call->among.each = &call->each;
    call->points.n_systems = call->queries.n_systems = n;
    call->points.first = PyArray_DATA((PyArrayObject *)first);
    call->queries.first = begins_of_queries;
    return true;
}

/* Points and box, then what depends on them: queries, what is known, `out` and systems. of: by
 * kind, what was given, NULL for None where that may be. */
static bool
take_views(PyObject **of, hs_py_call *call)
{
    PyObject        *points = of[HS_ARG_POINTS], *queries = of[HS_ARG_QUERIES];
    PyObject *const *known = NULL, *const *known_of_queries = NULL;
    if (!call->is_of_users && (!parts_of(&points, &known) ||
                               (queries != NULL && !parts_of(&queries, &known_of_queries)))) {
        return false;
    }
    return take_shells(of[HS_ARG_SHELLS], &call->options) &&
           hs_py_call_scene(call, points, of[HS_ARG_BOX], of[HS_ARG_PERIODIC]) &&
           (queries == NULL || take_queries(call, queries)) && take_known(known, &call->points) &&
           take_known(known_of_queries, &call->queries) &&
           (of[HS_ARG_PAIRING] == NULL || take_pairing(of[HS_ARG_PAIRING], call)) &&
           (of[HS_ARG_OUT] == NULL || take_out(of, call)) &&
           (call->is_of_users || take_systems(known, known_of_queries, call));
}

static int64_t
count_points(const hs_py_call *call)
{
    return call->points.at.n + (call->among.queries != NULL ? call->queries.at.n : 0);
}

bool
hs_expect(const char *name, bool are_right)
{
    if (!are_right && !PyErr_Occurred()) {
        PyErr_Format(PyExc_TypeError, "%s takes other arguments", name);
    }
    return are_right;
}

/* How many arguments of its own a call has: those at the end may be left out. A wrong number is
 * brought to the next right one. */
static int
count_own(const hs_argument *const *takes, int n_given)
{
    int n = 0, n_needed = 0;
    for (; takes[n] != NULL; n++) {
        n_needed = takes[n]->kind < HS_ARG_FIRST_OPTIONAL ? n + 1 : n_needed;
    }
    return n_given < n_needed ? n_needed : n_given < n ? n_given : n;
}

/* Takes what is a number, and notes all by kind. */
static bool
take_numbers(hs_py_call *call, int n, PyObject **of)
{
    for (int k = 0; k < n; k++) {
        const hs_argument *argument = hs_argument_at(call->function, k);
        const hs_kind      kind = argument->kind;
        PyObject          *given = call->of[k];
        if (!take_number(call, argument, given) ||
            (kind == HS_ARG_OTHER_POINTS && given == Py_None && call->is_of_users)) {
            return false;
        }
        if (given != Py_None || kind < HS_ARG_OUT || kind == HS_ARG_OTHER_POINTS) {
            of[kind == HS_ARG_OTHER_POINTS ? HS_ARG_QUERIES : kind] = given;
        }
    }
    return true;
}

void
hs_py_call_begin(hs_py_call *call, PyObject *module, bool is_of_users)
{
    call->module = module;
    call->is_of_users = is_of_users;
    call->options = hs_options_default();
    call->among = (hs_among){.points = NULL};
    call->points = call->queries = (hs_set){.first = NULL};
    call->each = (hs_each_system){.rows = NULL};
    call->letters = "ij";
    call->positions = call->asked = call->out = NULL;
    call->repeats = 0;
    call->thread = NULL;
    call->n_made = 0;
}

bool
hs_py_call_take(hs_py_call *call, Py_ssize_t n_arguments)
{
    const hs_function *function = call->function;
    const int          n_own = count_own(function->own, (int)(n_arguments - HS_CALL_ARGUMENTS)),
              n = HS_CALL_ARGUMENTS + n_own;
    PyObject   *of[HS_KINDS] = {NULL};
    hs_options *options = &call->options;
    call->own = call->of + HS_CALL_ARGUMENTS;
    if (n_arguments != n || !take_numbers(call, n, of) || !take_views(of, call)) {
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
    while (call->n_made > 0) {
        Py_DECREF(call->made[--call->n_made]);
    }
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

bool
hs_py_call_done(hs_py_call *call, hs_status status)
{
    const hs_each_system *each = &call->each;
    hs_py_call_acquire(call);
    if (status == HS_OK) {
        return true;
    }
    if (each->rows == NULL && each->cutoffs == NULL && each->periodic == NULL) {
        call->failure.system = -1; /* systems are named where each has something of its own */
    }
    (void)hs_raise(status, &call->failure, &call->options);
    return false;
}
