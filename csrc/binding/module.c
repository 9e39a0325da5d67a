/* SPDX-License-Identifier: BSD-3-Clause */
/* module.c: the extension module halfshell._core: its functions, what it says of itself, slots and
 * init. */
#define HS_IMPORTS_NUMPY
#include "py_functions.h"

#include "outputs.h"
#include "errors.h"
#include "system.h"

static PyObject *
kernels(PyObject *module, PyObject *ignored)
{
    const char *names[8];
    (void)module;
    (void)ignored;
    return hs_tuple_of_names(names, hs_kernel_names(names, 8));
}

static PyObject *
default_kernel(PyObject *module, PyObject *ignored)
{
    const char *best = "", *forced = hs_environment_kernel();
    (void)module;
    (void)ignored;
    hs_kernel_names(&best, 1);
    return PyUnicode_DecodeLocale(forced != NULL ? forced : best, "surrogateescape");
}

#if defined(__clang__)
#define COMPILER "clang " __clang_version__
#elif defined(__GNUC__)
#define COMPILER "gcc " __VERSION__
#elif defined(_MSC_VER)
#define COMPILER "msvc"
#else
#define COMPILER "unknown"
#endif

/* Of the core as compiled, which may be older than the Python files beside it. */
static PyObject *
version(void)
{
    const int number = hs_version();
    return PyUnicode_FromFormat("%d.%d.%d", number / 10000, number / 100 % 100, number % 100);
}

static PyObject *
build_info(PyObject *module, PyObject *ignored)
{
    PyObject *dict = PyDict_New();
    if (dict != NULL && hs_dict_put(dict, "core", version()) &&
        hs_dict_put(dict, "compiler", PyUnicode_FromString(COMPILER)) &&
#ifdef NDEBUG
        hs_dict_put(dict, "assertions", PyBool_FromLong(0)) &&
#else
        hs_dict_put(dict, "assertions", PyBool_FromLong(1)) &&
#endif
        hs_dict_put(dict, "kernels", kernels(module, ignored))) {
        return dict;
    }
    Py_XDECREF(dict);
    return NULL;
}

static PyObject *
available_memory(PyObject *module, PyObject *ignored)
{
    (void)module;
    (void)ignored;
    return PyFloat_FromDouble(hs_available_memory(NULL));
}

static PyObject *
group_memory(PyObject *module, PyObject *root)
{
    const char *folder = PyUnicode_AsUTF8(root);
    (void)module;
    return folder != NULL ? PyFloat_FromDouble(hs_group_memory(folder)) : NULL;
}

static PyObject *
clear_cache(PyObject *module, PyObject *ignored)
{
    (void)module;
    (void)ignored;
    hs_pool_clear();
    Py_RETURN_NONE;
}

static PyObject *
set_cache_limit(PyObject *module, PyObject *limit)
{
    const size_t before = hs_pool_limit();
    const size_t bytes = PyLong_AsSize_t(limit);
    (void)module;
    if (bytes == (size_t)-1 && PyErr_Occurred()) {
        return NULL;
    }
    hs_pool_set_limit(bytes);
    return PyLong_FromSize_t(before);
}

static PyObject *
cache_info(PyObject *module, PyObject *ignored)
{
    (void)module;
    (void)ignored;
    return Py_BuildValue("(nn)", (Py_ssize_t)hs_pool_held(), (Py_ssize_t)hs_pool_limit());
}

#define FASTCALL(function) ((PyCFunction)(void (*)(void))(function))

/* Functions that are not in the table: they search for nothing. */
static PyMethodDef others[] = {
    {"quick", FASTCALL(hs_py_quick), METH_FASTCALL, NULL},
    {"scene", FASTCALL(hs_py_scene), METH_FASTCALL, NULL},
    {"know", FASTCALL(hs_py_know), METH_FASTCALL, NULL},
    {"next_block", FASTCALL(hs_py_next_block), METH_FASTCALL, NULL},
    {"cells_layout", hs_py_cells_layout, METH_O, NULL},
    {"feet_between", FASTCALL(hs_py_feet_between), METH_FASTCALL, NULL},
    {"morton_keys", FASTCALL(hs_py_morton_keys), METH_FASTCALL, NULL},
    {"few", FASTCALL(hs_py_few), METH_FASTCALL, NULL},
    {"contain", FASTCALL(hs_py_contain), METH_FASTCALL, NULL},
    {"triplets", hs_py_triplets, METH_O, NULL},
    {"kernels", kernels, METH_NOARGS, NULL},
    {"default_kernel", default_kernel, METH_NOARGS, NULL},
    {"build_info", build_info, METH_NOARGS, NULL},
    {"available_memory", available_memory, METH_NOARGS, NULL},
    {"group_memory", group_memory, METH_O, NULL},
    {"clear_cache", clear_cache, METH_NOARGS, NULL},
    {"set_cache_limit", set_cache_limit, METH_O, NULL},
    {"cache_info", cache_info, METH_NOARGS, NULL},
    {"box_measure", FASTCALL(hs_py_box_measure), METH_FASTCALL, NULL},
    {"box_wrap", FASTCALL(hs_py_box_wrap), METH_FASTCALL, NULL},
    {"box_places", FASTCALL(hs_py_box_places), METH_FASTCALL, NULL},
    {"verlet_new", hs_py_verlet_new, METH_NOARGS, NULL},
    {"verlet_look", hs_py_verlet_look, METH_O, NULL},
    {"dynamic_new", FASTCALL(hs_py_dynamic_new), METH_FASTCALL, NULL},
    {NULL, NULL, 0, NULL},
};

static int
module_exec(PyObject *module)
{
    PyObject **types = PyModule_GetState(module);
    hs_environment_read();
    if (PyArray_ImportNumPyAPI() < 0) {
        return -1;
    }
    types[HS_DYNAMIC_TYPE] = hs_py_dynamic_type(module);
    return types[HS_DYNAMIC_TYPE] == NULL || hs_py_add_capi(module) < 0 ||
                   PyModule_AddIntConstant(module, "FEW_PAIRS", HS_FEW_PAIRS) < 0
               ? -1
               : hs_py_add_functions(module);
}

static int
module_traverse(PyObject *module, visitproc visit, void *arg)
{
    PyObject **types = PyModule_GetState(module);
    for (int k = 0; k < HS_TYPES; k++) {
        Py_VISIT(types[k]);
    }
    return 0;
}

static int
module_clear(PyObject *module)
{
    PyObject **types = PyModule_GetState(module);
    for (int k = 0; k < HS_TYPES; k++) {
        Py_CLEAR(types[k]);
    }
    return 0;
}

static PyModuleDef_Slot slots[] = {
    {Py_mod_exec, module_exec},
#if PY_VERSION_HEX >= 0x030c0000
    {Py_mod_multiple_interpreters, Py_MOD_MULTIPLE_INTERPRETERS_NOT_SUPPORTED}, /* as NumPy */
#endif
#if PY_VERSION_HEX >= 0x030d0000
    {Py_mod_gil, Py_MOD_GIL_NOT_USED},
#endif
    {0, NULL},
};

static struct PyModuleDef definition = {
    .m_base = PyModuleDef_HEAD_INIT,
    .m_name = "halfshell._core",
    .m_doc = "The C core of halfshell. Private: use the functions of halfshell.",
    .m_size = HS_TYPES * sizeof(PyObject *),
    .m_methods = others,
    .m_slots = slots,
    .m_traverse = module_traverse,
    .m_clear = module_clear,
};

PyMODINIT_FUNC PyInit__core(void);

PyMODINIT_FUNC
PyInit__core(void)
{
    return PyModuleDef_Init(&definition);
}
