/* SPDX-License-Identifier: BSD-3-Clause */
/* py_info.c: _core.kernels, default_kernel, build_info, available_memory, group_memory, and the
 * cache of output memory. */
#include "py_functions.h"

#include "tuples.h"

#include "../halfshell.h"
#include "available.h"
#include "environment.h"
#include "groups.h"

PyObject *
hs_py_kernels(PyObject *module, PyObject *ignored)
{
    const char *names[8];
    (void)module;
    (void)ignored;
    return hs_tuple_of_names(names, hs_kernel_names(names, 8));
}

PyObject *
hs_py_default_kernel(PyObject *module, PyObject *ignored)
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

PyObject *
hs_py_build_info(PyObject *module, PyObject *ignored)
{
    PyObject *dict = PyDict_New();
    if (dict != NULL && hs_dict_put(dict, "core", version()) &&
        hs_dict_put(dict, "compiler", PyUnicode_FromString(COMPILER)) &&
#ifdef NDEBUG
        hs_dict_put(dict, "assertions", PyBool_FromLong(0)) &&
#else
        hs_dict_put(dict, "assertions", PyBool_FromLong(1)) &&
#endif
        hs_dict_put(dict, "kernels", hs_py_kernels(module, ignored))) {
        return dict;
    }
    Py_XDECREF(dict);
    return NULL;
}

PyObject *
hs_py_available_memory(PyObject *module, PyObject *ignored)
{
    (void)module;
    (void)ignored;
    return PyFloat_FromDouble(hs_available_memory(NULL));
}

PyObject *
hs_py_group_memory(PyObject *module, PyObject *root)
{
    const char *folder = PyUnicode_AsUTF8(root);
    (void)module;
    return folder != NULL ? PyFloat_FromDouble(hs_group_memory(folder)) : NULL;
}

PyObject *
hs_py_clear_cache(PyObject *module, PyObject *ignored)
{
    (void)module;
    (void)ignored;
    hs_pool_clear();
    Py_RETURN_NONE;
}

PyObject *
hs_py_set_cache_limit(PyObject *module, PyObject *limit)
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

PyObject *
hs_py_cache_limit(PyObject *module, PyObject *ignored)
{
    (void)module;
    (void)ignored;
    return PyLong_FromSize_t(hs_pool_limit());
}

PyObject *
hs_py_cache_held(PyObject *module, PyObject *ignored)
{
    (void)module;
    (void)ignored;
    return PyLong_FromSize_t(hs_pool_held());
}
