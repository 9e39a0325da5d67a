/* SPDX-License-Identifier: BSD-3-Clause */
/* py_dynamic.c: _core.DynamicCells: the list of halfshell.DynamicCellList. Its methods hold the GIL
 * but for many queries at once; the list itself sees to its threads. */
#include "py_dynamic.h"

#include "foreign.h"
#include "py_call.h"
#include "py_functions.h"
#include "tuples.h"

#include <string.h>

typedef hs_status put_fn(hs_dynamic *, hs_key, const double *, hs_failure *);

static PyObject *
put(PyObject *object, PyObject *const *arguments, Py_ssize_t n, put_fn *put_in)
{
    const py_dynamic *self = (const py_dynamic *)object;
    double            position[HS_MAX_DIM];
    hs_key            key;
    hs_failure        failure;
    if (!hs_expect_arguments("insert or move", n, 2) || !hs_key_of(self, arguments[0], &key)) {
        return NULL;
    }
    const bool has_position = arguments[1] != Py_None;
    if (has_position && !hs_position_of(self, arguments[1], position)) {
        return NULL;
    }
    const hs_status status = put_in(self->list, key, has_position ? position : NULL, &failure);
    if (status == HS_ERR_ARGUMENT) {
        PyErr_SetString(PyExc_TypeError,
                        "position must not be None but with storage=\"all-pairs\"");
        return NULL;
    }
    if (status != HS_OK) {
        return hs_raise_dynamic(self, status, &failure, arguments[0]);
    }
    Py_RETURN_NONE;
}

static PyObject *
insert(PyObject *object, PyObject *const *arguments, Py_ssize_t n)
{
    return put(object, arguments, n, hs_dynamic_insert);
}

static PyObject *
move(PyObject *object, PyObject *const *arguments, Py_ssize_t n)
{
    return put(object, arguments, n, hs_dynamic_move);
}

static PyObject *
remove_key(PyObject *object, PyObject *argument)
{
    const py_dynamic *self = (const py_dynamic *)object;
    hs_key            key;
    if (!hs_key_of(self, argument, &key)) {
        return NULL;
    }
    return PyBool_FromLong(hs_dynamic_remove(self->list, key));
}

static PyObject *
has(PyObject *object, PyObject *argument)
{
    const py_dynamic *self = (const py_dynamic *)object;
    hs_key            key;
    if (!hs_key_of(self, argument, &key)) {
        return NULL;
    }
    return PyBool_FromLong(hs_dynamic_has(self->list, key));
}

static PyObject *
position_of_key(PyObject *object, PyObject *argument)
{
    const py_dynamic *self = (const py_dynamic *)object;
    double            position[HS_MAX_DIM];
    npy_intp          shape = self->ndim;
    hs_key            key;
    if (!hs_key_of(self, argument, &key)) {
        return NULL;
    }
    const hs_status status = hs_dynamic_position(self->list, key, position);
    if (status != HS_OK) {
        return hs_raise_dynamic(self, status, NULL, argument);
    }
    PyObject *array = PyArray_SimpleNew(1, &shape, NPY_DOUBLE);
    if (array != NULL) {
        memcpy(PyArray_DATA((PyArrayObject *)array), position,
               (size_t)self->ndim * sizeof *position);
    }
    return array;
}

static PyObject *
cell_of_key(PyObject *object, PyObject *argument)
{
    const py_dynamic *self = (const py_dynamic *)object;
    int64_t           cell[HS_MAX_DIM];
    hs_key            key;
    if (!hs_key_of(self, argument, &key)) {
        return NULL;
    }
    const hs_status status = hs_dynamic_cell(self->list, key, cell);
    return status == HS_OK ? hs_tuple_of_integers(cell, self->ndim)
                           : hs_raise_dynamic(self, status, NULL, argument);
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
    if (!hs_expect_arguments("any_within", n, 3) ||
        !hs_real_of(arguments[1], "radius must be a number", &radius) ||
        (arguments[2] != Py_None && !hs_key_of(self, arguments[2], &skip)) ||
        !hs_position_of(self, arguments[0], position)) {
        return NULL;
    }
    const bool skips = arguments[2] != Py_None;
    hs_status  status;
    do {
        status = hs_dynamic_any_within(self->list, position, radius, skips ? &skip : NULL, &any,
                                       &failure);
    } while (hs_py_dynamic_again(status));
    if (status != HS_OK) {
        const bool absent = skips && !hs_dynamic_has(self->list, skip);
        return hs_raise_dynamic(self, status, &failure, absent ? arguments[2] : NULL);
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
    (void)ignored;
    const hs_status status = hs_dynamic_shrink_to_fit(((py_dynamic *)object)->list);
    if (status != HS_OK) {
        return hs_raise_dynamic((py_dynamic *)object, status, NULL, NULL);
    }
    Py_RETURN_NONE;
}

static PyObject *
copy(PyObject *object, PyObject *ignored)
{
    py_dynamic   *self = (py_dynamic *)object;
    PyTypeObject *type = Py_TYPE(object);
    hs_dynamic   *list;
    (void)ignored;
    const hs_status status = hs_dynamic_copy(self->list, &list);
    if (status != HS_OK) {
        return hs_raise_dynamic(self, status, NULL, NULL);
    }
    py_dynamic *made = (py_dynamic *)type->tp_alloc(type, 0);
    if (made == NULL) {
        hs_dynamic_free(list);
        return NULL;
    }
    made->list = list;
    hs_dynamic_hook(list, &hs_py_dynamic_hooks);
    made->convert = Py_NewRef(self->convert);
    made->ndim = self->ndim;
    made->tagged = self->tagged;
    made->max_radius = self->max_radius;
    return (PyObject *)made;
}

static PyObject *
look(PyObject *object, PyObject *ignored)
{
    const hs_dynamic_state state = hs_dynamic_look(((py_dynamic *)object)->list);
    (void)ignored;
    return Py_BuildValue("{s:L,s:L,s:L,s:L,s:L,s:L,s:d,s:N}", "n_points", (long long)state.n_points,
                         "n_without", (long long)state.n_without, "n_cells",
                         (long long)state.n_cells, "n_empty", (long long)state.n_empty, "bytes",
                         (long long)state.bytes, "changes", (long long)state.changes, "max_radius",
                         state.max_radius, "cell_size",
                         hs_tuple_of_reals(state.cell_size, state.ndim));
}

static PyObject *
changes(PyObject *object, PyObject *ignored)
{
    (void)ignored;
    return PyLong_FromLongLong(hs_dynamic_look(((py_dynamic *)object)->list).changes);
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
    return hs_key_of(self, argument, &key) ? hs_dynamic_has(self->list, key) : -1;
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
    {"insert", FASTCALL(insert), METH_FASTCALL, NULL},
    {"move", FASTCALL(move), METH_FASTCALL, NULL},
    {"remove", remove_key, METH_O, NULL},
    {"has", has, METH_O, NULL},
    {"position", position_of_key, METH_O, NULL},
    {"cell", cell_of_key, METH_O, NULL},
    {"any_within", FASTCALL(any_within), METH_FASTCALL, NULL},
    {"near", FASTCALL(hs_py_dynamic_near), METH_FASTCALL, NULL},
    {"within", FASTCALL(hs_py_dynamic_within), METH_FASTCALL, NULL},
    {"within_many", FASTCALL(hs_py_dynamic_within_many), METH_FASTCALL, NULL},
    {"insert_many", FASTCALL(hs_py_dynamic_insert_many), METH_FASTCALL, NULL},
    {"move_many", FASTCALL(hs_py_dynamic_move_many), METH_FASTCALL, NULL},
    {"remove_many", FASTCALL(hs_py_dynamic_remove_many), METH_FASTCALL, NULL},
    {"keys", FASTCALL(hs_py_dynamic_keys), METH_FASTCALL, NULL},
    {"positions", hs_py_dynamic_positions, METH_O, NULL},
    {"clear", clear, METH_NOARGS, NULL},
    {"shrink_to_fit", shrink, METH_NOARGS, NULL},
    {"copy", copy, METH_NOARGS, NULL},
    {"look", look, METH_NOARGS, NULL},
    {"changes", changes, METH_NOARGS, NULL},
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
