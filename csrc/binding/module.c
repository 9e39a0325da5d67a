/* SPDX-License-Identifier: BSD-3-Clause */
/* module.c: the extension module halfshell._core: method table, slots, init, and nothing else. */
#define HS_IMPORTS_NUMPY
#include "environment.h"
#include "py_functions.h"
#include "quick.h"

#define FASTCALL(function) ((PyCFunction)(void (*)(void))(function))

static PyMethodDef methods[] = {
    {"pairs", FASTCALL(hs_py_pairs), METH_FASTCALL, "See halfshell.pairs."},
    {"count_pairs", FASTCALL(hs_py_count_pairs), METH_FASTCALL, "See halfshell.count_pairs."},
    {"iter_pairs", FASTCALL(hs_py_iter_pairs), METH_FASTCALL, "See halfshell.iter_pairs."},
    {"for_each_pair", FASTCALL(hs_py_for_each_pair), METH_FASTCALL, "See halfshell.for_each_pair."},
    {"histogram", FASTCALL(hs_py_histogram), METH_FASTCALL, "See halfshell.pair_histogram."},
    {"plain", FASTCALL(hs_py_plain), METH_FASTCALL,
     "One of these functions, of plain arguments, or NotImplemented."},
    {"quick", FASTCALL(hs_py_quick), METH_FASTCALL, "The same, of arguments by name."},
    {"pairs_between", FASTCALL(hs_py_pairs_between), METH_FASTCALL, "See halfshell.pairs_between."},
    {"count_between", FASTCALL(hs_py_count_between), METH_FASTCALL,
     "See halfshell.count_pairs: of two sets."},
    {"neighbors", FASTCALL(hs_py_neighbors), METH_FASTCALL, "See halfshell.neighbors."},
    {"coordination", FASTCALL(hs_py_coordination), METH_FASTCALL, "See halfshell.coordination."},
    {"clusters", FASTCALL(hs_py_clusters), METH_FASTCALL, "See halfshell.clusters."},
    {"cells_build", FASTCALL(hs_py_cells_build), METH_FASTCALL, "See halfshell.CellList."},
    {"cells_layout", hs_py_cells_layout, METH_O, "The layout of cells."},
    {"cells_find", FASTCALL(hs_py_cells_find), METH_FASTCALL, "See CellList.cell_of."},
    {"cells_candidates", FASTCALL(hs_py_cells_candidates), METH_FASTCALL,
     "See CellList.candidates."},
    {"batch_pairs", FASTCALL(hs_py_batch_pairs), METH_FASTCALL, "pairs of many systems."},
    {"batch_count", FASTCALL(hs_py_batch_count), METH_FASTCALL, "count_pairs of many systems."},
    {"nearest", FASTCALL(hs_py_nearest), METH_FASTCALL, "See halfshell.nearest."},
    {"measure", FASTCALL(hs_py_measure), METH_FASTCALL, "See halfshell.measure."},
    {"connect", FASTCALL(hs_py_connect), METH_FASTCALL, "See halfshell.Connectivity."},
    {"connect_search", FASTCALL(hs_py_connect_search), METH_FASTCALL,
     "See halfshell.Connectivity."},
    {"overlap", FASTCALL(hs_py_overlap), METH_FASTCALL, "See halfshell.Connectivity.overlap."},
    {"intersect", FASTCALL(hs_py_intersect), METH_FASTCALL,
     "See halfshell.Connectivity.intersection."},
    {"pair_rows", FASTCALL(hs_py_pair_rows), METH_FASTCALL, "See halfshell.Connectivity.pairs."},
    {"keep_rows", FASTCALL(hs_py_keep_rows), METH_FASTCALL, "See halfshell.Connectivity.patch."},
    {"keep_pairs", FASTCALL(hs_py_keep_pairs), METH_FASTCALL, "See halfshell.Connectivity.patch."},
    {"rows_without", FASTCALL(hs_py_rows_without), METH_FASTCALL,
     "See halfshell.Connectivity.remove."},
    {"feet_between", FASTCALL(hs_py_feet_between), METH_FASTCALL,
     "See halfshell.Connectivity.intersection_of."},
    {"morton_keys", FASTCALL(hs_py_morton_keys), METH_FASTCALL, "Places on the Z curve."},
    {"explain", FASTCALL(hs_py_explain), METH_FASTCALL, "See halfshell.explain."},
    {"kernels", hs_py_kernels, METH_NOARGS, "See halfshell.kernels."},
    {"default_kernel", hs_py_default_kernel, METH_NOARGS, "The kernel where none is named."},
    {"build_info", hs_py_build_info, METH_NOARGS, "How this extension was built."},
    {"available_memory", hs_py_available_memory, METH_NOARGS,
     "Bytes that this process may still take."},
    {"group_memory", hs_py_group_memory, METH_O,
     "What control groups leave of them; a folder stands in for the root of all files."},
    {"clear_cache", hs_py_clear_cache, METH_NOARGS, "See halfshell.clear_cache."},
    {"set_cache_limit", hs_py_set_cache_limit, METH_O, "See halfshell.set_cache_limit."},
    {"cache_limit", hs_py_cache_limit, METH_NOARGS, "Bytes that the cache holds at most."},
    {"cache_held", hs_py_cache_held, METH_NOARGS, "Bytes that the cache holds."},
    {"box_measure", FASTCALL(hs_py_box_measure), METH_FASTCALL, "See halfshell.Box."},
    {"box_wrap", FASTCALL(hs_py_box_wrap), METH_FASTCALL, "See halfshell.Box.wrap."},
    {"box_places", FASTCALL(hs_py_box_places), METH_FASTCALL, "See halfshell.bricks."},
    {"verlet_new", hs_py_verlet_new, METH_NOARGS, "See halfshell.VerletList."},
    {"verlet_update", FASTCALL(hs_py_verlet_update), METH_FASTCALL,
     "See halfshell.VerletList.update."},
    {"verlet_pairs", FASTCALL(hs_py_verlet_pairs), METH_FASTCALL,
     "See halfshell.VerletList.pairs."},
    {"verlet_look", hs_py_verlet_look, METH_O, "What a list of halfshell.VerletList is like."},
    {"dynamic_new", FASTCALL(hs_py_dynamic_new), METH_FASTCALL, "See halfshell.DynamicCellList."},
    {NULL, NULL, 0, NULL},
};

static int
module_exec(PyObject *module)
{
    PyObject **types = PyModule_GetState(module);
    hs_environment_read();
    types[HS_STREAM_TYPE] = hs_py_stream_type(module);
    types[HS_DYNAMIC_TYPE] = types[HS_STREAM_TYPE] != NULL ? hs_py_dynamic_type(module) : NULL;
    if (types[HS_DYNAMIC_TYPE] == NULL || hs_py_add_capi(module) < 0) {
        return -1;
    }
    return PyArray_ImportNumPyAPI();
}

static int
module_traverse(PyObject *module, visitproc visit, void *arg)
{
    PyObject **types = PyModule_GetState(module);
    Py_VISIT(types[HS_STREAM_TYPE]);
    Py_VISIT(types[HS_DYNAMIC_TYPE]);
    return 0;
}

static int
module_clear(PyObject *module)
{
    PyObject **types = PyModule_GetState(module);
    Py_CLEAR(types[HS_STREAM_TYPE]);
    Py_CLEAR(types[HS_DYNAMIC_TYPE]);
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
    .m_methods = methods,
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
