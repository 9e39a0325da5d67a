/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * functions.c: the functions of the table, as the Python layer calls them and as users do. Python
 * needs as long to fill in what users leave out as a search of thirty points.
 */
#include "arguments.h"
#include "outputs.h"
#include "py_functions.h"

#include <numpy/arrayscalars.h>
#include <string.h>

enum {
    MOST_CORE = HS_CALL_ARGUMENTS + HS_MOST_OWN,
    MOST_PUBLIC = 20,
    PRECISION = 2,
    N_SETTINGS = 5
};

/* A function of the table, and for users what a call begins with. */
typedef struct function_row {
    const hs_function *function;
    PyMethodDef        method;
    int                n_public, n_positional, n_core;
    PyObject          *names[MOST_PUBLIC];  /* owned, as all objects below */
    int                places[MOST_PUBLIC]; /* in the order of the core; -1: only Python takes it */
    PyObject          *others[MOST_PUBLIC]; /* what these are where they are left out, or NULL */
    PyObject          *usual[MOST_CORE];    /* NULL: it must be given */
    int                settings[N_SETTINGS]; /* places of those that are set around calls */
} function_row;

static const char ROW[] = "halfshell._core.function";

/* ---- calls -------------------------------------------------------------------------------- */

/* The row of a function, whose `self` is a tuple of the module and this. */
static const function_row *
row_of(PyObject *self)
{
    return PyCapsule_GetPointer(PyTuple_GET_ITEM(self, 1), ROW);
}

/* Calls a function; NULL, without an exception, where it takes no such arguments. */
static PyObject *
run(PyObject *self, PyObject *const *arguments, Py_ssize_t n_arguments, bool is_of_users)
{
    hs_py_call call;
    hs_py_call_begin(&call, PyTuple_GET_ITEM(self, 0), is_of_users);
    call.function = row_of(self)->function;
    call.of = arguments;
    PyObject *result = hs_py_call_take(&call, n_arguments) ? call.function->body(&call) : NULL;
    hs_py_call_end(&call);
    return result;
}

static PyObject *
search(PyObject *self, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    PyObject *result = run(self, arguments, n_arguments, false);
    hs_expect(row_of(self)->function->name, result != NULL);
    return result;
}

/* Where a public argument stands among those of this name; -1: nowhere. */
static int
find_name(const function_row *row, PyObject *name)
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

/* Puts arguments into their places in the order of the core; false if only Python knows what to do
 * with one of them, or if one is missing. */
static bool
place(const function_row *row, PyObject *arguments, PyObject *options, PyObject **given)
{
    const Py_ssize_t n_given = PyTuple_GET_SIZE(arguments);
    PyObject        *name, *value;
    Py_ssize_t       at = 0;
    bool             are_placed = n_given <= row->n_positional;
    memcpy(given, row->usual, sizeof row->usual);
    for (Py_ssize_t k = 0; are_placed && k < n_given; k++) {
        given[row->places[k]] = PyTuple_GET_ITEM(arguments, k);
    }
    while (are_placed && PyDict_Next(options, &at, &name, &value)) {
        const int k = find_name(row, name);
        are_placed = k >= n_given && (row->places[k] >= 0 || value == row->others[k]);
        if (are_placed && row->places[k] >= 0) {
            given[row->places[k]] = value;
        }
    }
    for (int k = 0; are_placed && k < row->n_core; k++) {
        are_placed = given[k] != NULL;
    }
    return are_placed;
}

/* In place of a CellList of points that know nothing more than where they are, what the core has of
 * it, and its own cutoff and threads where others are left out. All are borrowed from it. */
static bool
open_cells(const function_row *row, PyObject *module, PyObject **given)
{
    PyObject **known = PyModule_GetState(module), **threads = &given[row->settings[N_SETTINGS - 1]];
    if (known[HS_CELLS_TYPE] != (PyObject *)Py_TYPE(given[0])) {
        return true;
    }
    PyObject  *plain = PyObject_GetAttrString(given[0], "_plain");
    const bool is_plain = plain != NULL && PyTuple_Check(plain) && PyTuple_GET_SIZE(plain) == 3 &&
                          given[2] == Py_None && given[3] == Py_None;
    if (is_plain) {
        given[0] = PyTuple_GET_ITEM(plain, 0);
        given[1] = given[1] == Py_None ? PyTuple_GET_ITEM(plain, 1) : given[1];
        *threads = *threads == Py_None ? PyTuple_GET_ITEM(plain, 2) : *threads;
    }
    Py_XDECREF(plain);
    PyErr_Clear();
    return is_plain;
}

/* What is set around this call, a tuple that halfshell.settings has checked: kernel, algorithm,
 * precision, memory_limit, and threads for a call that does not say how many. A new reference that
 * these borrow from, or NULL with an exception set. */
static PyObject *
take_settings(const function_row *row, PyObject *module, PyObject **given)
{
    PyObject **known = PyModule_GetState(module), *var = known[HS_SETTINGS], *set = NULL;
    if (var == NULL) {
        return Py_NewRef(Py_None);
    }
    if (PyContextVar_Get(var, NULL, &set) < 0) {
        return NULL;
    }
    if (set == NULL) {
        return Py_NewRef(Py_None);
    }
    for (int k = 0; set != known[HS_USUAL_SETTINGS] && k < N_SETTINGS; k++) {
        const int at = row->settings[k];
        if (at >= 0 && (k < N_SETTINGS - 1 || given[at] == Py_None)) {
            given[at] = PyTuple_GET_ITEM(set, k);
        }
    }
    return set;
}

static PyObject *
attempt(PyObject *self, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    const function_row *row = row_of(self);
    PyObject           *given[MOST_CORE], *result = NULL;
    if (n_arguments != 2 || !PyTuple_CheckExact(arguments[0]) || !PyDict_CheckExact(arguments[1])) {
        PyErr_SetString(PyExc_TypeError, "expected a tuple and a dict of arguments");
        return NULL;
    }
    /* A cutoff that is still left out is by radii, or refused. */
    if (!place(row, arguments[0], arguments[1], given) ||
        !open_cells(row, PyTuple_GET_ITEM(self, 0), given) || given[1] == Py_None) {
        return Py_NewRef(Py_NotImplemented);
    }
    PyObject *set = take_settings(row, PyTuple_GET_ITEM(self, 0), given);
    if (set == NULL) {
        return NULL;
    }
    for (int k = 0; k < row->n_core; k++) { /* held: a signal handler might change the options */
        Py_INCREF(given[k]);
    }
    result = run(self, given, row->n_core, true);
    for (int k = 0; k < row->n_core; k++) {
        Py_DECREF(given[k]);
    }
    Py_DECREF(set);
    return result == NULL && !PyErr_Occurred() ? Py_NewRef(Py_NotImplemented) : result;
}

/* The box of a call as an array of rows, or None. */
static PyObject *
rows_of_box(const hs_py_call *call)
{
    const int d = call->points.at.ndim;
    npy_intp  shape[2] = {d, d};
    if (call->among.box == NULL) {
        return Py_NewRef(Py_None);
    }
    PyObject *rows = PyArray_SimpleNew(2, shape, NPY_DOUBLE);
    for (int l = 0; rows != NULL && l < d; l++) {
        memcpy((double *)PyArray_DATA((PyArrayObject *)rows) + l * d, call->box.rows[l],
               (size_t)d * sizeof(double));
    }
    return rows;
}

PyObject *
hs_py_scene(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    if (!hs_expect("scene", n_arguments == 3)) {
        return NULL;
    }
    hs_py_call_begin(&call, module, true);
    PyObject *result = NULL;
    if (hs_py_call_scene(&call, arguments[0], arguments[1], arguments[2])) {
        result = Py_BuildValue("(ONk)", call.positions, rows_of_box(&call), call.repeats);
    } else if (!PyErr_Occurred()) {
        result = Py_NewRef(Py_NotImplemented);
    }
    hs_py_call_end(&call);
    return result;
}

/* ---- the table ---------------------------------------------------------------------------- */

static void
free_row(PyObject *capsule)
{
    function_row *row = PyCapsule_GetPointer(capsule, ROW);
    for (int k = 0; k < MOST_PUBLIC; k++) {
        Py_XDECREF(row->names[k]);
        Py_XDECREF(row->others[k]);
    }
    for (int k = 0; k < MOST_CORE; k++) {
        Py_XDECREF(row->usual[k]);
    }
    PyMem_Free(row);
}

/* The place of an argument in the order of the core; -1: only Python takes it. */
static int
place_of(const hs_function *function, const char *name)
{
    const hs_argument *argument;
    if (function->is_by_rank && strcmp(name, "max_distance") == 0) {
        name = "cutoff";
    }
    for (int k = 0; (argument = hs_argument_at(function, k)) != NULL; k++) {
        if (strcmp(argument->name, name) == 0) {
            return k;
        }
    }
    return -1;
}

/* What an argument of the core is that users do not have; a new reference or NULL. */
static PyObject *
usual_of(hs_kind kind)
{
    return kind == HS_ARG_PRECISION   ? PyUnicode_FromString("exact")
           : kind == HS_ARG_ALGORITHM ? PyUnicode_FromString("auto")
                                      : Py_NewRef(kind == HS_ARG_SORT ? Py_True : Py_None);
}

/* Fills the row, which has zeros, with what users have: names, in order, and what is left out. */
static bool
fill_row(function_row *row, PyObject *names, PyObject *defaults)
{
    static const char *const settings[N_SETTINGS] = {"kernel", "algorithm", "precision",
                                                     "memory_limit", "threads"};
    const hs_argument       *argument;
    for (; (argument = hs_argument_at(row->function, row->n_core)) != NULL; row->n_core++) {
        row->usual[row->n_core] = usual_of(argument->kind);
        if (row->usual[row->n_core] == NULL) {
            return false;
        }
    }
    for (Py_ssize_t k = 0; k < PyTuple_GET_SIZE(names); k++) {
        PyObject *name = PyTuple_GET_ITEM(names, k),
                 *usual = PyDict_GetItemWithError(defaults, name);
        const char *text = PyUnicode_AsUTF8(name);
        if (text == NULL || k == MOST_PUBLIC) {
            return false;
        }
        const int at = row->places[k] = place_of(row->function, text);
        row->names[k] = Py_NewRef(name);
        row->n_public++;
        Py_XSETREF(*(at < 0 ? &row->others[k] : &row->usual[at]), Py_XNewRef(usual));
    }
    for (int k = 0; k < N_SETTINGS; k++) {
        row->settings[k] =
            row->function->is_by_rank && k == PRECISION ? -1 : place_of(row->function, settings[k]);
    }
    return !PyErr_Occurred();
}

/* A function of the table, and its row, which is to be filled; a new reference or NULL. */
static PyObject *
make_function(PyObject *module, const hs_function *function, const char *name,
              PyObject *(*body)(PyObject *, PyObject *const *, Py_ssize_t), function_row **row)
{
    *row = PyMem_Calloc(1, sizeof **row);
    PyObject *capsule = *row != NULL ? PyCapsule_New(*row, ROW, free_row) : PyErr_NoMemory();
    if (capsule == NULL) {
        PyMem_Free(*row);
        return NULL;
    }
    (*row)->function = function;
    (*row)->method = (PyMethodDef){name, (PyCFunction)(void (*)(void))body, METH_FASTCALL, NULL};
    PyObject *self = PyTuple_Pack(2, module, capsule);
    PyObject *made = self != NULL ? PyCFunction_New(&(*row)->method, self) : NULL;
    Py_DECREF(capsule);
    Py_XDECREF(self);
    return made;
}

int
hs_py_add_functions(PyObject *module)
{
    int           status = 0;
    function_row *row;
    for (const hs_function *one = hs_functions; one->name != NULL && status == 0; one++) {
        PyObject *made = make_function(module, one, one->name, search, &row);
        status = PyModule_AddObjectRef(module, one->name, made);
        Py_XDECREF(made);
    }
    return status;
}

PyObject *
hs_py_quick(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    const hs_function *function = hs_functions;
    function_row      *row;
    if (n_arguments != 4 || !PyUnicode_Check(arguments[0]) || !PyTuple_Check(arguments[1]) ||
        !PyLong_Check(arguments[2]) || !PyDict_Check(arguments[3])) {
        PyErr_SetString(PyExc_TypeError, "quick takes a name, names, a number and a dict");
        return NULL;
    }
    while (function->name != NULL &&
           PyUnicode_CompareWithASCIIString(arguments[0], function->name) != 0) {
        function++;
    }
    if (function->name == NULL) {
        return PyErr_Format(PyExc_ValueError, "no function is called %R", arguments[0]);
    }
    PyObject *made = make_function(module, function, "attempt", attempt, &row);
    if (made != NULL && !fill_row(row, arguments[1], arguments[3])) {
        Py_CLEAR(made);
        if (!PyErr_Occurred()) {
            PyErr_SetString(PyExc_ValueError, "a function for users has fewer arguments");
        }
    } else if (made != NULL) {
        row->n_positional = (int)PyLong_AsLong(arguments[2]);
    }
    return made;
}

PyObject *
hs_py_know(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    static const char *const names[] = {[HS_BOX_TYPE] = "Box",
                                        [HS_POINTS_TYPE] = "Points",
                                        [HS_CELLS_TYPE] = "CellList",
                                        [HS_SETTINGS] = "settings"};
    PyObject               **known = PyModule_GetState(module);
    if (!hs_expect("know", n_arguments == 2)) {
        return NULL;
    }
    for (int k = HS_BOX_TYPE; k <= HS_SETTINGS && PyUnicode_Check(arguments[0]); k++) {
        if (PyUnicode_CompareWithASCIIString(arguments[0], names[k]) != 0) {
            continue;
        }
        if (k == HS_SETTINGS) {
            PyObject *usual = NULL;
            if (PyContextVar_Get(arguments[1], NULL, &usual) < 0) {
                return NULL;
            }
            Py_XSETREF(known[HS_USUAL_SETTINGS], usual);
        }
        Py_XSETREF(known[k], Py_NewRef(arguments[1]));
        Py_RETURN_NONE;
    }
    PyErr_SetString(PyExc_ValueError,
                    "know takes \"Box\", \"Points\", \"CellList\" or \"settings\"");
    return NULL;
}
