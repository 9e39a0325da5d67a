/* SPDX-License-Identifier: BSD-3-Clause */
/* module.c: the extension module halfshell._core: method table, slots, init, and nothing else. */
#define HS_IMPORTS_NUMPY
#include "environment.h"
#include "plain.h"
#include "py_functions.h"

#define FASTCALL(function) ((PyCFunction)(void (*)(void))(function))

static PyMethodDef methods[] = {
    {"pairs", FASTCALL(hs_py_pairs), METH_FASTCALL, "See halfshell.pairs."},
    {"count_pairs", FASTCALL(hs_py_count_pairs), METH_FASTCALL, "See halfshell.count_pairs."},
    {"plain_pairs", FASTCALL(hs_py_plain_pairs), METH_FASTCALL,
     "pairs of plain arguments, or NotImplemented."},
    {"plain_count", FASTCALL(hs_py_plain_count), METH_FASTCALL,
     "count_pairs of plain arguments, or NotImplemented."},
    {"batch_pairs", FASTCALL(hs_py_batch_pairs), METH_FASTCALL, "pairs of many systems."},
    {"batch_count", FASTCALL(hs_py_batch_count), METH_FASTCALL, "count_pairs of many systems."},
    {"nearest", FASTCALL(hs_py_nearest), METH_FASTCALL, "See halfshell.nearest."},
    {"explain", FASTCALL(hs_py_explain), METH_FASTCALL, "See halfshell.explain."},
    {"kernels", hs_py_kernels, METH_NOARGS, "See halfshell.kernels."},
    {"default_kernel", hs_py_default_kernel, METH_NOARGS, "The kernel where none is named."},
    {"build_info", hs_py_build_info, METH_NOARGS, "How this extension was built."},
    {"available_memory", hs_py_available_memory, METH_NOARGS,
     "Bytes that this process may still take."},
    {"clear_cache", hs_py_clear_cache, METH_NOARGS, "See halfshell.clear_cache."},
    {"set_cache_limit", hs_py_set_cache_limit, METH_O, "See halfshell.set_cache_limit."},
    {"cache_held", hs_py_cache_held, METH_NOARGS, "Bytes that the cache holds."},
    {"box_measure", FASTCALL(hs_py_box_measure), METH_FASTCALL, "See halfshell.Box."},
    {"box_wrap", FASTCALL(hs_py_box_wrap), METH_FASTCALL, "See halfshell.Box.wrap."},
    {NULL, NULL, 0, NULL},
};

static int
module_exec(PyObject *module)
{
    (void)module;
    hs_environment_read();
    return PyArray_ImportNumPyAPI();
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
    .m_size = 0, /* no state: no Python object outlives a call */
    .m_methods = methods,
    .m_slots = slots,
};

PyMODINIT_FUNC PyInit__core(void);

PyMODINIT_FUNC
PyInit__core(void)
{
    return PyModuleDef_Init(&definition);
}
