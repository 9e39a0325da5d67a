/* SPDX-License-Identifier: BSD-3-Clause */
/* module.c: the extension module halfshell._core: method table, slots, init, and nothing else. */
#define HS_IMPORTS_NUMPY
#include "py_functions.h"

#define FASTCALL(function) ((PyCFunction)(void (*)(void))(function))

static PyMethodDef methods[] = {
    {"pairs", FASTCALL(hs_py_pairs), METH_FASTCALL, "See halfshell.pairs."},
    {"count_pairs", FASTCALL(hs_py_count_pairs), METH_FASTCALL, "See halfshell.count_pairs."},
    {"explain", FASTCALL(hs_py_explain), METH_FASTCALL, "See halfshell.explain."},
    {"kernels", hs_py_kernels, METH_NOARGS, "See halfshell.kernels."},
    {"build_info", hs_py_build_info, METH_NOARGS, "How this extension was built."},
    {"available_memory", hs_py_available_memory, METH_NOARGS,
     "Bytes that this process may still take."},
    {"box_measure", FASTCALL(hs_py_box_measure), METH_FASTCALL, "See halfshell.Box."},
    {"box_wrap", FASTCALL(hs_py_box_wrap), METH_FASTCALL, "See halfshell.Box.wrap."},
    {NULL, NULL, 0, NULL},
};

static int
module_exec(PyObject *module)
{
    (void)module;
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
