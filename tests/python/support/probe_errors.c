/* SPDX-License-Identifier: BSD-3-Clause */
/* probe_errors.c: csrc/binding/errors.c alone, for test_statuses.py to raise what no call does. */
#define HS_IMPORTS_NUMPY /* its table, which nothing here looks into */
#include "errors.h"

#include "system.h"

/* What errors.c asks of others. */
int
hs_kernel_names(const char **names, int capacity)
{
    if (capacity > 0) {
        names[0] = "scalar";
    }
    return 1;
}

const char *
hs_environment_kernel(void)
{
    return NULL;
}

/* status, system, in_queries -> raises what calls raise for it */
static PyObject *
raise_status(PyObject *module, PyObject *arguments)
{
    int        status, system, in_queries;
    hs_failure failure = {.row = 3, .column = 1, .value = 0.5, .expected_pairs = 7.0};
    (void)module;
    if (!PyArg_ParseTuple(arguments, "iip", &status, &system, &in_queries)) {
        return NULL;
    }
    failure.system = system;
    failure.in_queries = in_queries;
    return hs_raise((hs_status)status, &failure, NULL);
}

static PyMethodDef methods[] = {{"raise_status", raise_status, METH_VARARGS, NULL},
                                {NULL, NULL, 0, NULL}};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "probe_errors", NULL, -1, methods, NULL, NULL, NULL, NULL};

static const struct {
    const char *name;
    int         status;
} statuses[] = {
    {"HS_OK", HS_OK},
    {"HS_ERR_MEMORY", HS_ERR_MEMORY},
    {"HS_ERR_CUTOFF", HS_ERR_CUTOFF},
    {"HS_ERR_NOT_FINITE", HS_ERR_NOT_FINITE},
    {"HS_ERR_BOX_FINITE", HS_ERR_BOX_FINITE},
    {"HS_ERR_BOX_DEPENDENT", HS_ERR_BOX_DEPENDENT},
    {"HS_ERR_BOX_SKEWED", HS_ERR_BOX_SKEWED},
    {"HS_ERR_TOO_MANY", HS_ERR_TOO_MANY},
    {"HS_ERR_SHIFT_RANGE", HS_ERR_SHIFT_RANGE},
    {"HS_ERR_ROUNDING", HS_ERR_ROUNDING},
    {"HS_ERR_KERNEL", HS_ERR_KERNEL},
    {"HS_ERR_INTERRUPTED", HS_ERR_INTERRUPTED},
    {"HS_ERR_FAR", HS_ERR_FAR},
    {"HS_ERR_CAPACITY", HS_ERR_CAPACITY},
    {"HS_ERR_EDGES", HS_ERR_EDGES},
    {"HS_ERR_TYPES", HS_ERR_TYPES},
    {"HS_ERR_WEIGHTS", HS_ERR_WEIGHTS},
    {"HS_ERR_RADII", HS_ERR_RADII},
    {"HS_ERR_SUPPORTS", HS_ERR_SUPPORTS},
    {"HS_ERR_SUPPORT_REACH", HS_ERR_SUPPORT_REACH},
    {"HS_ERR_EXTENT", HS_ERR_EXTENT},
    {"HS_ERR_ARGUMENT", HS_ERR_ARGUMENT},
    {"HS_ERR_KEY", HS_ERR_KEY},
    {"HS_STATUS_END", HS_STATUS_END},
};

PyMODINIT_FUNC
PyInit_probe_errors(void)
{
    PyObject *module = PyModule_Create(&definition);
    for (size_t k = 0; module != NULL && k < sizeof statuses / sizeof *statuses; k++) {
        if (PyModule_AddIntConstant(module, statuses[k].name, statuses[k].status) < 0) {
            Py_CLEAR(module);
        }
    }
    return module;
}
