/* SPDX-License-Identifier: BSD-3-Clause */
/* py_dynamic.c: _core.DynamicCells: the list of halfshell.DynamicCellList. Its methods hold the GIL
 * but for many queries at once; the list itself sees to its threads. Keys and positions are taken
 * apart here, without a detour over arrays where they are plain numbers. */
#include "py_functions.h"

#include "errors.h"
#include "outputs.h"

#include "../halfshell_dynamic.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct py_dynamic {
    PyObject_HEAD
    hs_dynamic *list;    /* owned */
    PyObject   *convert; /* owned: see take_argument */
    int         ndim;
    bool        tagged;
    double      max_radius;
} py_dynamic;

/* Whether a query ended for a signal, whose handler has returned. Else the status stays, with an
 * exception where that is HS_ERR_INTERRUPTED. */
static bool
is_to_be_made_again(hs_status status)
{
    return status == HS_ERR_INTERRUPTED && PyErr_CheckSignals() == 0;
}

/* An integer of Python or NumPy that fits int64; false, without an exception, for all else. */
static bool
integer_of(PyObject *object, long long *value)
{
    int        overflow = 1;
    const bool is_integer = PyLong_CheckExact(object) || PyArray_IsScalar(object, Integer);
    PyObject  *index = is_integer ? PyNumber_Index(object) : NULL;
    if (index != NULL) {
        *value = PyLong_AsLongLongAndOverflow(index, &overflow);
        Py_DECREF(index);
    }
    PyErr_Clear();
    return overflow == 0;
}

/* An integer, or a tuple of a tag and one, as above. */
static bool
plain_key_of(const py_dynamic *self, PyObject *object, hs_key *key)
{
    long long  id, tag = 0;
    const bool is_pair = PyTuple_Check(object) && PyTuple_GET_SIZE(object) == 2;
    if (!(self->tagged ? is_pair && integer_of(PyTuple_GET_ITEM(object, 0), &tag) &&
                             integer_of(PyTuple_GET_ITEM(object, 1), &id)
                       : integer_of(object, &id)) ||
        tag < INT32_MIN || tag > INT32_MAX) {
        return false;
    }
    *key = (hs_key){.id = id, .tag = (int32_t)tag};
    return true;
}

/* What the argument is that is called so; where it is taken to depends on that. */
typedef enum { KEY, SKIP, RADIUS, POSITION } argument_kind;

static bool
take_plain(const py_dynamic *self, PyObject *object, argument_kind what, void *to)
{
    return what == RADIUS     ? hs_number_of(object, to)
           : what == POSITION ? hs_numbers_of(object, self->ndim, to)
                              : plain_key_of(self, object, to);
}

/* Takes a key, number or position, which `convert` makes plain where it is not; false with an
 * exception set. */
static bool
take_argument(const py_dynamic *self, PyObject *object, argument_kind what, void *to)
{
    static const char *const names[] = {"key", "skip", "radius", "position"};
    if (take_plain(self, object, what, to)) {
        return true;
    }
    PyObject  *plain = PyErr_Occurred()
                           ? NULL
                           : PyObject_CallFunction(self->convert, "Osii", object, names[what],
                                                   self->ndim, self->tagged);
    const bool is_taken = plain != NULL && take_plain(self, plain, what, to);
    if (plain != NULL && !is_taken) {
        PyErr_Format(PyExc_TypeError, "%s was not converted", names[what]);
    }
    Py_XDECREF(plain);
    return is_taken;
}

/* An array of a key for each row: (n,), or (n, 2) with tags. */
static PyObject *
keys_array(const py_dynamic *self, const hs_key *keys, int64_t n)
{
    npy_intp  shape[2] = {(npy_intp)n, 2};
    PyObject *array = PyArray_SimpleNew(self->tagged ? 2 : 1, shape, NPY_INT64);
    if (array == NULL) {
        return NULL;
    }
    int64_t *data = PyArray_DATA((PyArrayObject *)array);
    for (int64_t e = 0; e < n; e++) {
        if (self->tagged) {
            data[2 * e] = keys[e].tag;
            data[2 * e + 1] = keys[e].id;
        } else {
            data[e] = keys[e].id;
        }
    }
    return array;
}

/* The exception for a status; `key`, or NULL, is named where one is at fault. Returns NULL. */
static PyObject *
raise_dynamic(const py_dynamic *self, hs_status status, const hs_failure *failure, PyObject *key)
{
    const bool      is_of_rows = failure != NULL && failure->row >= 0;
    const long long row = is_of_rows ? (long long)failure->row : -1;
    char            name[64] = "position", one[32], other[32];
    if (is_of_rows) {
        PyOS_snprintf(name, sizeof name, "positions[%lld]", row);
    }
    switch (status) {
    case HS_ERR_KEY:
        if (key != NULL) {
            PyErr_SetObject(PyExc_KeyError, key);
        } else {
            PyErr_SetString(PyExc_ValueError,
                            "distances need positions, which some of these keys do not have");
        }
        return NULL;
    case HS_ERR_ARGUMENT:
        return PyErr_Format(PyExc_ValueError, "key %R has no position",
                            key != NULL ? key : Py_None);
    case HS_ERR_CUTOFF:
        return PyErr_Format(
            PyExc_ValueError,
            "radius must be from 0 to max_radius, got radius = %s with max_radius = %s",
            hs_format_real(failure->value, one), hs_format_real(self->max_radius, other));
    case HS_ERR_NOT_FINITE:
        PyOS_snprintf(name, sizeof name, is_of_rows ? "positions[%lld, " : "position[", row);
        return PyErr_Format(PyExc_ValueError, "%s%d] must be finite, got %s", name,
                            (int)failure->column, hs_format_real(failure->value, one));
    case HS_ERR_SHIFT_RANGE:
        return PyErr_Format(
            PyExc_OverflowError,
            "%s lies 2**51 boxes away, or more, if only in a direction in which a box that is "
            "oblique to it does not repeat: wrap it into the box first",
            name);
    case HS_ERR_CAPACITY:
        return PyErr_Format(
            PyExc_ValueError,
            "storage=\"dense\" would need %s for its cells, to reach this far; %s are allowed: "
            "use storage=\"hash\"",
            hs_format_bytes(failure->expected_bytes, one, sizeof one),
            hs_format_bytes(failure->limit_bytes, other, sizeof other));
    case HS_ERR_MEMORY:
        PyErr_SetString(PyExc_MemoryError, "out of memory; the list is as it was");
        return NULL;
    default: return hs_raise(status, failure, NULL);
    }
}

/* Arrays of ids (int64), and of tags (int32) or None, of one length. */
static bool
take_keys(PyObject *const *arguments, const int64_t **ids, const int32_t **tags, int64_t *n)
{
    if (!hs_is_array(arguments[0], NPY_INT64, 1) ||
        (arguments[1] != Py_None && !hs_is_array(arguments[1], NPY_INT32, 1))) {
        PyErr_SetString(PyExc_TypeError, "keys must be arrays of int64 and int32");
        return false;
    }
    *ids = PyArray_DATA((PyArrayObject *)arguments[0]);
    *n = PyArray_DIM((PyArrayObject *)arguments[0], 0);
    *tags = arguments[1] == Py_None ? NULL : PyArray_DATA((PyArrayObject *)arguments[1]);
    return true;
}

/* KeyError of an absent key, ValueError of one that comes twice; or what else is wrong. */
static PyObject *
raise_many(const py_dynamic *self, hs_status status, const hs_failure *failure, const int64_t *ids,
           const int32_t *tags)
{
    if (status != HS_ERR_KEY || failure->row < 0) {
        return raise_dynamic(self, status, failure, NULL);
    }
    const long long id = ids[failure->row];
    PyObject *key = self->tagged ? Py_BuildValue("(iL)", tags != NULL ? tags[failure->row] : 0, id)
                                 : PyLong_FromLongLong(id);
    if (key != NULL && failure->column == HS_KEY_ABSENT) {
        PyErr_SetObject(PyExc_KeyError, key);
    } else if (key != NULL) {
        PyErr_Format(PyExc_ValueError, "keys must differ, but keys[%lld] = %R came before",
                     (long long)failure->row, key);
    }
    Py_XDECREF(key);
    return NULL;
}

/* ids, tags or None, positions, whether all must be there. */
static PyObject *
put_many(PyObject *object, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    const py_dynamic *self = (const py_dynamic *)object;
    const int64_t    *ids;
    const int32_t    *tags;
    int64_t           n;
    hs_points         positions;
    hs_failure        failure = {.row = -1};
    if (!hs_expect("put_many", n_arguments == 4) || !take_keys(arguments, &ids, &tags, &n) ||
        !hs_expect("put_many", hs_points_of(arguments[2], &positions))) {
        return NULL;
    }
    if (positions.n != n || positions.ndim != self->ndim) {
        PyErr_SetString(PyExc_ValueError, "keys and positions must be of one length");
        return NULL;
    }
    hs_status status;
    do {
        status = (arguments[3] == Py_True ? hs_dynamic_move_many : hs_dynamic_insert_many)(
            self->list, ids, tags, &positions, &failure);
    } while (is_to_be_made_again(status));
    if (status != HS_OK) {
        return raise_many(self, status, &failure, ids, tags);
    }
    Py_RETURN_NONE;
}

/* ids, tags or None -> which of them were there. */
static PyObject *
remove_many(PyObject *object, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    const py_dynamic *self = (const py_dynamic *)object;
    const int64_t    *ids;
    const int32_t    *tags;
    int64_t           n;
    hs_failure        failure = {.row = -1};
    if (!hs_expect("remove_many", n_arguments == 2) || !take_keys(arguments, &ids, &tags, &n)) {
        return NULL;
    }
    npy_intp  shape = (npy_intp)n;
    PyObject *removed = PyArray_SimpleNew(1, &shape, NPY_BOOL);
    if (removed == NULL) {
        return NULL;
    }
    const hs_status status = hs_dynamic_remove_many(
        self->list, ids, tags, n, PyArray_DATA((PyArrayObject *)removed), &failure);
    if (status != HS_OK) {
        Py_DECREF(removed);
        return raise_many(self, status, &failure, ids, tags);
    }
    return removed;
}

/* cursor, most keys, whether positions are wanted -> the next cursor, keys, and (n, ndim)
 * positions, NaN for those that have none, or None. */
static PyObject *
next_keys(PyObject *object, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    const py_dynamic *self = (const py_dynamic *)object;
    int64_t           cursor = n_arguments == 3 ? PyLong_AsLongLong(arguments[0]) : -1;
    const int64_t     most = n_arguments == 3 ? PyLong_AsLongLong(arguments[1]) : -1;
    if (PyErr_Occurred() || cursor < 0 || most < 1) {
        return PyErr_Occurred() ? NULL : PyErr_Format(PyExc_ValueError, "keys: bad arguments");
    }
    hs_key *keys = malloc((size_t)most * sizeof *keys);
    if (keys == NULL) {
        return PyErr_NoMemory();
    }
    const int64_t n = hs_dynamic_keys(self->list, &cursor, keys, most);
    npy_intp      shape[2] = {(npy_intp)n, self->ndim};
    PyObject     *positions = arguments[2] == Py_True ? PyArray_SimpleNew(2, shape, NPY_DOUBLE)
                                                      : Py_NewRef(Py_None);
    for (int64_t e = 0; positions != NULL && positions != Py_None && e < n; e++) {
        double *row = (double *)PyArray_DATA((PyArrayObject *)positions) + e * self->ndim;
        if (hs_dynamic_position(self->list, keys[e], row) != HS_OK) {
            for (int k = 0; k < self->ndim; k++) {
                row[k] = NAN;
            }
        }
    }
    PyObject *result =
        Py_BuildValue("(LNN)", (long long)cursor, keys_array(self, keys, n), positions);
    free(keys);
    return result;
}

/* The GIL is taken, to look for signals, so often; the clock is read after so many rows. */
#define CLOCK_ROWS         32
#define SIGNALS_PER_SECOND 20

/* What visits have found, in memory that is not Python's: it grows without the GIL. */
typedef struct gathered {
    const py_dynamic *self;
    hs_key           *keys;
    int32_t          *shifts; /* ndim each; NULL where they are not wanted */
    int64_t           n, capacity;
    bool              with_shift;
    hs_status         status; /* why the visit ended, if early */
    PyThreadState    *thread; /* NULL: this thread has the GIL */
    clock_t           looked; /* for signals, where it has not */
} gathered;

/* An hs_poll_fn: false on Ctrl-C. No handler is run, as that might use the list: it is left first.
 * user: a gathered, or NULL. */
static bool
poll_signals(void *user, double fraction)
{
    gathered *found = user;
    (void)fraction;
    if (found != NULL && found->thread != NULL) {
        if (clock() - found->looked < CLOCKS_PER_SEC / SIGNALS_PER_SECOND) {
            return true;
        }
        found->looked = clock();
        PyEval_RestoreThread(found->thread);
    }
    const bool is_interrupted = PyOS_InterruptOccurred() != 0;
    if (is_interrupted) {
        PyErr_SetInterrupt(); /* for the look at signals that follows */
    }
    if (found != NULL && found->thread != NULL) {
        found->thread = PyEval_SaveThread();
    }
    return !is_interrupted;
}

static void *
give_up_gil(void)
{
    return PyEval_SaveThread();
}

static void
take_gil(void *thread)
{
    PyEval_RestoreThread(thread);
}

/* For queries that take long, and changes that wait for them: Ctrl-C, and the GIL. */
static const hs_dynamic_hooks hooks = {poll_signals, give_up_gil, take_gil};

static bool
grow(gathered *found)
{
    const int64_t capacity = found->capacity * 2 + 64;
    hs_key       *keys = realloc(found->keys, (size_t)capacity * sizeof *keys);
    found->keys = keys != NULL ? keys : found->keys;
    if (keys != NULL && found->with_shift) {
        const size_t width = (size_t)found->self->ndim * sizeof *found->shifts;
        int32_t     *shifts = realloc(found->shifts, (size_t)capacity * width);
        found->shifts = shifts != NULL ? shifts : found->shifts;
        if (shifts == NULL) {
            return false;
        }
    }
    found->capacity = keys != NULL ? capacity : found->capacity;
    return keys != NULL;
}

static int
take(hs_key key, const double *position, const int64_t *shift, void *user)
{
    gathered *found = user;
    (void)position;
    if (found->n == found->capacity && !grow(found)) {
        found->status = HS_ERR_MEMORY;
        return 1;
    }
    for (int k = 0; found->with_shift && k < found->self->ndim; k++) {
        if (shift[k] < INT32_MIN || shift[k] > INT32_MAX) {
            found->status = HS_ERR_SHIFT_RANGE;
            return 1;
        }
        found->shifts[found->n * found->self->ndim + k] = (int32_t)shift[k];
    }
    found->keys[found->n++] = key;
    return 0;
}

/* Keys, or keys and shifts; or the exception for what ended the visits, a status or that of `take`.
 * Frees what was gathered. */
static PyObject *
result_of(gathered *found, hs_status status, const hs_failure *failure)
{
    const py_dynamic *self = found->self;
    npy_intp          shape[2] = {(npy_intp)found->n, self->ndim};
    PyObject         *result = NULL;
    if (status == HS_OK && found->status == HS_ERR_SHIFT_RANGE) {
        PyErr_SetString(PyExc_OverflowError,
                        "S holds 2**31 boxes, and a point in the ball lies further from the centre "
                        "as it was given: wrap both into the box first");
    } else if (status != HS_OK || found->status != HS_OK) {
        (void)raise_dynamic(self, status != HS_OK ? status : found->status, failure, NULL);
    } else {
        result = keys_array(self, found->keys, found->n);
        if (found->with_shift && result != NULL) {
            result =
                Py_BuildValue("(NN)", result, hs_array_like(found->shifts, 2, shape, NPY_INT32));
        }
    }
    free(found->keys);
    free(found->shifts);
    return result;
}

/* position, radius, whether shifts are wanted; None: all that are near. */
static PyObject *
within(PyObject *object, PyObject *const *arguments, Py_ssize_t n)
{
    const py_dynamic *self = (const py_dynamic *)object;
    gathered          found = {.self = self, .status = HS_OK};
    double            position[HS_MAX_DIM], radius;
    hs_failure        failure;
    hs_status         status;
    if (!hs_expect("within", n == 3) || !take_argument(self, arguments[1], RADIUS, &radius) ||
        !take_argument(self, arguments[0], POSITION, position)) {
        return NULL;
    }
    found.with_shift = arguments[2] == Py_True;
    do {
        found.n = 0;
        status = arguments[2] == Py_None
                     ? hs_dynamic_near(self->list, position, radius, take, &found, &failure)
                     : hs_dynamic_within(self->list, position, radius, found.with_shift, take,
                                         &found, &failure);
    } while (is_to_be_made_again(status));
    return result_of(&found, status, &failure);
}

/* The balls around rows of float64, one after another, without the GIL but for a look at signals.
 * HS_ERR_INTERRUPTED has an exception set. */
static hs_status
ask_rows(const py_dynamic *self, const double *rows, int64_t n, double radius, int64_t *offsets,
         gathered *found, hs_failure *failure)
{
    hs_status status = HS_OK;
    found->looked = clock();
    found->thread = PyEval_SaveThread();
    offsets[0] = 0;
    for (int64_t q = 0; q < n && status == HS_OK && found->status == HS_OK; q++) {
        status = hs_dynamic_within(self->list, rows + q * self->ndim, radius, found->with_shift,
                                   take, found, failure);
        failure->row = status != HS_OK ? q : failure->row;
        offsets[q + 1] = found->n;
        const bool is_time = q % CLOCK_ROWS == CLOCK_ROWS - 1 &&
                             clock() - found->looked > CLOCKS_PER_SEC / SIGNALS_PER_SECOND;
        if (is_time || status == HS_ERR_INTERRUPTED) {
            found->looked = clock();
            PyEval_RestoreThread(found->thread);
            if (PyErr_CheckSignals() != 0) {
                status = HS_ERR_INTERRUPTED;
            } else if (status == HS_ERR_INTERRUPTED) { /* this row once more */
                status = HS_OK;
                found->n = offsets[q--];
            }
            found->thread = PyEval_SaveThread();
        }
    }
    PyEval_RestoreThread(found->thread);
    return status;
}

/* positions (q, ndim) of float64, radius, whether shifts are wanted -> offsets, keys[, shifts]. */
static PyObject *
within_many(PyObject *object, PyObject *const *arguments, Py_ssize_t n)
{
    const py_dynamic *self = (const py_dynamic *)object;
    gathered          found = {.self = self, .with_shift = n == 3 && arguments[2] == Py_True};
    hs_failure        failure = {.row = -1};
    double            radius;
    if (n != 3 || !hs_is_array(arguments[0], NPY_DOUBLE, 2) ||
        PyArray_DIM((PyArrayObject *)arguments[0], 1) != self->ndim) {
        PyErr_SetString(PyExc_TypeError, "within_many takes positions, a radius and a bool");
        return NULL;
    }
    if (!take_argument(self, arguments[1], RADIUS, &radius)) {
        return NULL;
    }
    PyArrayObject *positions = (PyArrayObject *)arguments[0];
    npy_intp       rows = PyArray_DIM(positions, 0), ends = rows + 1;
    PyObject      *offsets = PyArray_SimpleNew(1, &ends, NPY_INT64);
    if (offsets == NULL) {
        return NULL;
    }
    const hs_status status = ask_rows(self, PyArray_DATA(positions), rows, radius,
                                      PyArray_DATA((PyArrayObject *)offsets), &found, &failure);
    PyObject       *arrays = result_of(&found, status, &failure);
    if (arrays == NULL) {
        Py_DECREF(offsets);
        return NULL;
    }
    return Py_BuildValue("(NN)", offsets, arrays);
}

/* key, position or None, whether it must be there. */
static PyObject *
put(PyObject *object, PyObject *const *arguments, Py_ssize_t n)
{
    const py_dynamic *self = (const py_dynamic *)object;
    double            position[HS_MAX_DIM];
    hs_key            key;
    hs_failure        failure;
    if (!hs_expect("put", n == 3) || !take_argument(self, arguments[0], KEY, &key)) {
        return NULL;
    }
    const bool has_position = arguments[1] != Py_None;
    if (has_position && !take_argument(self, arguments[1], POSITION, position)) {
        return NULL;
    }
    const hs_status status = (arguments[2] == Py_True ? hs_dynamic_move : hs_dynamic_insert)(
        self->list, key, has_position ? position : NULL, &failure);
    if (status == HS_ERR_ARGUMENT) {
        PyErr_SetString(PyExc_TypeError,
                        "position must not be None but with storage=\"all-pairs\"");
        return NULL;
    }
    if (status != HS_OK) {
        return raise_dynamic(self, status, &failure, arguments[0]);
    }
    Py_RETURN_NONE;
}

static PyObject *
remove_key(PyObject *object, PyObject *argument)
{
    const py_dynamic *self = (const py_dynamic *)object;
    hs_key            key;
    return take_argument(self, argument, KEY, &key)
               ? PyBool_FromLong(hs_dynamic_remove(self->list, key))
               : NULL;
}

/* The position of a key, or the cell that it is in. */
static PyObject *
look_up(const py_dynamic *self, PyObject *argument, bool cell)
{
    double   position[HS_MAX_DIM];
    int64_t  index[HS_MAX_DIM];
    npy_intp shape = self->ndim;
    hs_key   key;
    if (!take_argument(self, argument, KEY, &key)) {
        return NULL;
    }
    const hs_status status = cell ? hs_dynamic_cell(self->list, key, index)
                                  : hs_dynamic_position(self->list, key, position);
    return status != HS_OK ? raise_dynamic(self, status, NULL, argument)
           : cell          ? hs_tuple_of_integers(index, self->ndim)
                           : hs_array_like(position, 1, &shape, NPY_DOUBLE);
}

static PyObject *
position_of_key(PyObject *object, PyObject *argument)
{
    return look_up((const py_dynamic *)object, argument, false);
}

static PyObject *
cell_of_key(PyObject *object, PyObject *argument)
{
    return look_up((const py_dynamic *)object, argument, true);
}

static PyObject *
cell_of_position(PyObject *object, PyObject *argument)
{
    const py_dynamic *self = (const py_dynamic *)object;
    double            position[HS_MAX_DIM];
    int64_t           cell[HS_MAX_DIM];
    hs_failure        failure;
    if (!take_argument(self, argument, POSITION, position)) {
        return NULL;
    }
    const hs_status status = hs_dynamic_cell_of(self->list, position, cell, &failure);
    return status == HS_OK ? hs_tuple_of_integers(cell, self->ndim)
                           : raise_dynamic(self, status, &failure, NULL);
}

/* position, radius, skip or None. */
static PyObject *
any_within(PyObject *object, PyObject *const *arguments, Py_ssize_t n)
{
    const py_dynamic *self = (const py_dynamic *)object;
    double            position[HS_MAX_DIM], radius;
    hs_key            skip;
    hs_failure        failure;
    bool              any = false;
    if (!hs_expect("any_within", n == 3) || !take_argument(self, arguments[1], RADIUS, &radius) ||
        (arguments[2] != Py_None && !take_argument(self, arguments[2], SKIP, &skip)) ||
        !take_argument(self, arguments[0], POSITION, position)) {
        return NULL;
    }
    const bool skips = arguments[2] != Py_None;
    hs_status  status;
    do {
        status = hs_dynamic_any_within(self->list, position, radius, skips ? &skip : NULL, &any,
                                       &failure);
    } while (is_to_be_made_again(status));
    if (status != HS_OK) {
        const bool absent = skips && !hs_dynamic_has(self->list, skip);
        return raise_dynamic(self, status, &failure, absent ? arguments[2] : NULL);
    }
    return PyBool_FromLong(any);
}

static PyObject *
clear(PyObject *object, PyObject *ignored)
{
    (void)ignored;
    hs_dynamic_clear(((py_dynamic *)object)->list);
    Py_RETURN_NONE;
}

static PyObject *
shrink(PyObject *object, PyObject *ignored)
{
    const hs_status status = hs_dynamic_shrink_to_fit(((py_dynamic *)object)->list);
    (void)ignored;
    return status == HS_OK ? Py_NewRef(Py_None)
                           : raise_dynamic((py_dynamic *)object, status, NULL, NULL);
}

/* An object that owns the list, also on failure; NULL with an exception set. */
static PyObject *
own(PyTypeObject *type, hs_dynamic *list, PyObject *convert, int ndim, bool tagged)
{
    py_dynamic *made = (py_dynamic *)type->tp_alloc(type, 0);
    if (made == NULL) {
        hs_dynamic_free(list);
        return NULL;
    }
    hs_dynamic_hook(list, &hooks);
    made->list = list;
    made->convert = Py_NewRef(convert);
    made->ndim = ndim;
    made->tagged = tagged;
    made->max_radius = hs_dynamic_look(list).max_radius;
    return (PyObject *)made;
}

static PyObject *
copy(PyObject *object, PyObject *ignored)
{
    const py_dynamic *self = (py_dynamic *)object;
    hs_dynamic       *list;
    (void)ignored;
    const hs_status status = hs_dynamic_copy(self->list, &list);
    return status == HS_OK ? own(Py_TYPE(object), list, self->convert, self->ndim, self->tagged)
                           : raise_dynamic(self, status, NULL, NULL);
}

static PyObject *
look(PyObject *object, PyObject *ignored)
{
    const hs_dynamic_state state = hs_dynamic_look(((py_dynamic *)object)->list);
    (void)ignored;
    return Py_BuildValue("{s:L,s:L,s:d,s:N}", "bytes", (long long)state.bytes, "changes",
                         (long long)state.changes, "max_radius", state.max_radius, "cell_size",
                         hs_tuple_of_reals(state.cell_size, state.ndim));
}

static Py_ssize_t
length(PyObject *object)
{
    return (Py_ssize_t)hs_dynamic_length(((py_dynamic *)object)->list);
}

static int
contains(PyObject *object, PyObject *argument)
{
    const py_dynamic *self = (const py_dynamic *)object;
    hs_key            key;
    return take_argument(self, argument, KEY, &key) ? hs_dynamic_has(self->list, key) : -1;
}

static int
traverse(PyObject *object, visitproc visit, void *arg)
{
    Py_VISIT(Py_TYPE(object));
    Py_VISIT(((py_dynamic *)object)->convert);
    return 0;
}

static void
dealloc(PyObject *object)
{
    PyTypeObject *type = Py_TYPE(object);
    py_dynamic   *self = (py_dynamic *)object;
    PyObject_GC_UnTrack(object);
    hs_dynamic_free(self->list);
    Py_CLEAR(self->convert);
    type->tp_free(object);
    Py_DECREF(type);
}

#define FASTCALL(function) ((PyCFunction)(void (*)(void))(function))

static PyMethodDef methods[] = {
    {"put", FASTCALL(put), METH_FASTCALL, NULL},
    {"put_many", FASTCALL(put_many), METH_FASTCALL, NULL},
    {"remove", remove_key, METH_O, NULL},
    {"position", position_of_key, METH_O, NULL},
    {"cell", cell_of_key, METH_O, NULL},
    {"cell_of", cell_of_position, METH_O, NULL},
    {"any_within", FASTCALL(any_within), METH_FASTCALL, NULL},
    {"within", FASTCALL(within), METH_FASTCALL, NULL},
    {"within_many", FASTCALL(within_many), METH_FASTCALL, NULL},
    {"remove_many", FASTCALL(remove_many), METH_FASTCALL, NULL},
    {"keys", FASTCALL(next_keys), METH_FASTCALL, NULL},
    {"clear", clear, METH_NOARGS, NULL},
    {"shrink_to_fit", shrink, METH_NOARGS, NULL},
    {"copy", copy, METH_NOARGS, NULL},
    {"look", look, METH_NOARGS, NULL},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot slots[] = {
    {Py_tp_doc, "See halfshell.DynamicCellList."},
    {Py_tp_methods, methods},
    {Py_sq_length, length},
    {Py_sq_contains, contains},
    {Py_tp_traverse, traverse},
    {Py_tp_dealloc, dealloc},
    {0, NULL},
};

static PyType_Spec spec = {
    .name = "halfshell._core.DynamicCells",
    .basicsize = sizeof(py_dynamic),
    .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC | Py_TPFLAGS_DISALLOW_INSTANTIATION |
             Py_TPFLAGS_IMMUTABLETYPE,
    .slots = slots,
};

PyObject *
hs_py_dynamic_type(PyObject *module)
{
    return PyType_FromModuleAndSpec(module, &spec, NULL);
}

static PyObject *
raise_new(hs_status status, const hs_failure *failure)
{
    static const char *const must[] = {
        [HS_LENGTH_CELL_SIZE] = "cell_size must be from 2**-300 to 2**300",
        [HS_LENGTH_MAX_RADIUS] =
            "max_radius must be from 2**-300 to 2**300, and span at most 2**20 images of the box",
        [HS_LENGTH_BOX] =
            "entries of periodic box vectors must be 0 or from 2**-300 to 2**300 in size"};
    if (status == HS_ERR_CUTOFF && failure->column >= 0 && failure->column <= HS_LENGTH_BOX) {
        char value[32];
        return PyErr_Format(PyExc_ValueError, "%s, got %s", must[failure->column],
                            hs_format_real(failure->value, value));
    }
    return hs_raise(status, failure, NULL);
}

PyObject *
hs_py_dynamic_new(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    PyObject         **types = PyModule_GetState(module);
    PyTypeObject      *type = (PyTypeObject *)types[HS_DYNAMIC_TYPE];
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_failure         failure;
    hs_dynamic        *list;
    hs_box             box;
    unsigned long      repeats;
    if (!hs_expect("dynamic_new", n_arguments == 9)) {
        return NULL;
    }
    options.ndim = (int)PyLong_AsLong(arguments[0]);
    options.storage = (hs_storage)PyLong_AsLong(arguments[4]);
    options.inclusive = PyObject_IsTrue(arguments[6]) == 1;
    options.cell_size = PyFloat_AsDouble(arguments[1]);
    options.max_radius = PyFloat_AsDouble(arguments[5]);
    if (PyErr_Occurred() || !hs_repeats_of(arguments[3], &repeats) ||
        !hs_expect("dynamic_new", arguments[2] == Py_None ||
                                      hs_box_of(arguments[2], repeats, options.ndim, &box))) {
        return NULL;
    }
    options.box = arguments[2] != Py_None ? &box : NULL;
    const hs_status status = hs_dynamic_new(&options, &list, &failure);
    if (status != HS_OK) {
        return raise_new(status, &failure);
    }
    return own(type, list, arguments[8], options.ndim, PyObject_IsTrue(arguments[7]) == 1);
}
