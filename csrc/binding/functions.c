/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * functions.c: the functions of the table, as the Python layer calls them and as users do. Python
 * needs as long to fill in what users leave out as a search of thirty points.
 */
#include "arguments.h"
#include "errors.h"
#include "outputs.h"
#include "py_functions.h"

#include <numpy/arrayscalars.h>
#include <math.h>
#include <string.h>

enum { MOST_CORE = HS_CALL_ARGUMENTS + HS_MOST_OWN, PRECISION = 2, N_SETTINGS = 5 };

/* A function of the table, with what a call of users begins with. */
typedef struct function_row {
    const hs_function *function;
    PyMethodDef        of_core, of_users;
    int                n_public, n_positional, n_core;
    PyObject          *names[HS_MOST_PUBLIC]; /* owned, as all objects below */
    int       places[HS_MOST_PUBLIC]; /* in the order of the core; -1: only Python takes it */
    PyObject *others[HS_MOST_PUBLIC]; /* what these are where they are left out */
    PyObject *usual[MOST_CORE];       /* NULL: it must be given */
    int       settings[N_SETTINGS];   /* places of those that are set around calls */
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
    if (result == NULL && !PyErr_Occurred()) {
        PyErr_Format(PyExc_TypeError, "%s takes arguments of other types",
                     row_of(self)->function->name);
    }
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
    if (!hs_expect_arguments("scene", n_arguments, 3)) {
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
    for (int k = 0; k < HS_MOST_PUBLIC; k++) {
        Py_XDECREF(row->names[k]);
        Py_XDECREF(row->others[k]);
    }
    for (int k = 0; k < MOST_CORE; k++) {
        Py_XDECREF(row->usual[k]);
    }
    PyMem_Free(row);
}

/* The object that Python writes so; a new reference or NULL. */
static PyObject *
object_of(const char *text)
{
    if (text[0] == '\'') {
        return PyUnicode_FromStringAndSize(text + 1, (Py_ssize_t)strlen(text) - 2);
    }
    if (text[0] >= '0' && text[0] <= '9') {
        return PyLong_FromString(text, NULL, 10);
    }
    return strcmp(text, "numpy.int64") == 0 ? Py_NewRef((PyObject *)&PyInt64ArrType_Type)
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
    for (*place = 0; (argument = hs_argument_at(function, *place)) != NULL; ++*place) {
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
fill_row(function_row *row)
{
    static const char *const settings[N_SETTINGS] = {"kernel", "algorithm", "precision",
                                                     "memory_limit", "threads"};
    const hs_function       *function = row->function;
    const hs_argument       *argument;
    for (; (argument = hs_argument_at(function, row->n_core)) != NULL; row->n_core++) {
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

/* A function of the table, of the Python layer; a new reference or NULL. */
static PyObject *
make_function(PyObject *module, const hs_function *function)
{
    function_row *row = PyMem_Calloc(1, sizeof *row);
    PyObject     *capsule = row != NULL ? PyCapsule_New(row, ROW, free_row) : PyErr_NoMemory();
    if (capsule == NULL) {
        PyMem_Free(row);
        return NULL;
    }
    PyCFunction const of_core = (PyCFunction)(void (*)(void))search,
                      of_users = (PyCFunction)(void (*)(void))attempt;
    row->function = function;
    row->of_core = (PyMethodDef){function->name, of_core, METH_FASTCALL, NULL};
    row->of_users = (PyMethodDef){"attempt", of_users, METH_FASTCALL, NULL};
    PyObject *self = fill_row(row) ? PyTuple_Pack(2, module, capsule) : NULL;
    PyObject *made = self != NULL ? PyCFunction_New(&row->of_core, self) : NULL;
    Py_DECREF(capsule);
    Py_XDECREF(self);
    return made;
}

int
hs_py_add_functions(PyObject *module)
{
    int status = 0;
    for (int k = 0; hs_functions[k].name != NULL && status == 0; k++) {
        PyObject *made = make_function(module, &hs_functions[k]);
        status = PyModule_AddObjectRef(module, hs_functions[k].name, made);
        Py_XDECREF(made);
    }
    return status;
}

PyObject *
hs_py_quick(PyObject *module, PyObject *name)
{
    PyObject *function = NULL, *made = NULL;
    for (int k = 0; hs_functions[k].name != NULL && PyUnicode_Check(name); k++) {
        if (hs_functions[k].users[0] != NULL &&
            PyUnicode_CompareWithASCIIString(name, hs_functions[k].name) == 0) {
            function = PyObject_GetAttr(module, name);
        }
    }
    if (function != NULL && PyCFunction_Check(function)) {
        PyObject *self = PyCFunction_GetSelf(function);
        made = PyCFunction_New((PyMethodDef *)&row_of(self)->of_users, self);
    } else if (!PyErr_Occurred()) {
        PyErr_Format(PyExc_ValueError, "no function for users is called %R", name);
    }
    Py_XDECREF(function);
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
    for (int k = 0; list != NULL && (argument = hs_argument_at(function, k)) != NULL; k++) {
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
    for (int k = 0; dict != NULL && hs_functions[k].name != NULL; k++) {
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
    } things[] = {{"Box", HS_BOX_TYPE},
                  {"Points", HS_POINTS_TYPE},
                  {"CellList", HS_CELLS_TYPE},
                  {"settings", HS_SETTINGS}};
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
    PyErr_SetString(PyExc_ValueError,
                    "know takes \"Box\", \"Points\", \"CellList\" or \"settings\"");
    return NULL;
}
