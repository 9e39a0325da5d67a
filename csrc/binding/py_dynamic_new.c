/* SPDX-License-Identifier: BSD-3-Clause */
/* py_dynamic_new.c: _core.dynamic_new: a list of halfshell.DynamicCellList from its arguments. */
#include "py_dynamic.h"

#include "convert.h"
#include "errors.h"
#include "foreign.h"
#include "py_functions.h"

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
        PyObject *value = PyFloat_FromDouble(failure->value);
        if (value != NULL) {
            PyErr_Format(PyExc_ValueError, "%s, got %R", must[failure->column], value);
            Py_DECREF(value);
        }
        return NULL;
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
    bool               given;
    if (n_arguments != 9) {
        PyErr_SetString(PyExc_TypeError, "dynamic_new takes 9 arguments");
        return NULL;
    }
    options.ndim = (int)PyLong_AsLong(arguments[0]);
    options.storage = (hs_storage)PyLong_AsLong(arguments[4]);
    options.inclusive = PyObject_IsTrue(arguments[6]) == 1;
    if (PyErr_Occurred() ||
        !hs_real_of(arguments[1], "cell_size must be a number", &options.cell_size) ||
        !hs_real_of(arguments[5], "max_radius must be a number", &options.max_radius) ||
        !hs_repeats_of(arguments[3], &repeats) ||
        !hs_box_of(arguments[2], repeats, options.ndim, &box, &given)) {
        return NULL;
    }
    options.box = given ? &box : NULL;
    const hs_status status = hs_dynamic_new(&options, &list, &failure);
    if (status != HS_OK) {
        return raise_new(status, &failure);
    }
    py_dynamic *self = (py_dynamic *)type->tp_alloc(type, 0);
    if (self == NULL) {
        hs_dynamic_free(list);
        return NULL;
    }
    self->list = list;
    hs_dynamic_hook(list, &hs_py_dynamic_hooks);
    self->convert = Py_NewRef(arguments[8]);
    self->ndim = options.ndim;
    self->tagged = PyObject_IsTrue(arguments[7]) == 1;
    self->max_radius = hs_dynamic_look(list).max_radius;
    return (PyObject *)self;
}
