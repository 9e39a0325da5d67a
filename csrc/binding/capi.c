/* SPDX-License-Identifier: BSD-3-Clause */
/* capi.c: the functions of halfshell.h in a table, which other extension modules find in a capsule
 * and call without linking to this one. */
#include "py_functions.h"

#include "../halfshell_capi.h"

/* Constant: there is one in a process, for all interpreters and threads. */
static const hs_capi table = {
    .abi_version = HS_CAPI_VERSION,
    .size = sizeof(hs_capi),
    .version = hs_version,
    .status_text = hs_status_text,
    .options_default = hs_options_default,
    .pairs_find = hs_pairs_find,
    .pairs_count = hs_pairs_count,
    .neighbors_find = hs_neighbors_find,
    .neighbors_count = hs_neighbors_count,
    .pairs_histogram = hs_pairs_histogram,
    .nearest_find = hs_nearest_find,
    .pairs_rows = hs_pairs_rows,
    .pairs_offsets = hs_pairs_offsets,
    .pairs_take_offsets = hs_pairs_take_offsets,
    .pairs_length = hs_pairs_length,
    .pairs_array = hs_pairs_array,
    .pairs_take = hs_pairs_take,
    .array_free = hs_array_free,
    .pairs_free = hs_pairs_free,
    .stream_open = hs_stream_open,
    .stream_next = hs_stream_next,
    .stream_free = hs_stream_free,
    .pairs_visit = hs_pairs_visit,
    .cells_build = hs_cells_build,
    .cells_free = hs_cells_free,
    .cells_points = hs_cells_points,
    .cells_box = hs_cells_box,
    .cells_layout = hs_cells_layout,
    .cells_indices = hs_cells_indices,
    .cells_find = hs_cells_find,
    .cells_candidates = hs_cells_candidates,
    .systems_find = hs_systems_find,
    .systems_count = hs_systems_count,
    .verlet_new = hs_verlet_new,
    .verlet_update = hs_verlet_update,
    .verlet_find = hs_verlet_find,
    .verlet_look = hs_verlet_look,
    .verlet_free = hs_verlet_free,
    .plan_make = hs_plan_make,
    .box_measure = hs_box_measure,
    .box_wrap = hs_box_wrap,
    .pool_limit = hs_pool_limit,
    .pool_set_limit = hs_pool_set_limit,
    .pool_held = hs_pool_held,
    .pool_clear = hs_pool_clear,
    .kernel_names = hs_kernel_names,
};

int
hs_py_add_capi(PyObject *module)
{
    PyObject *capsule = PyCapsule_New((void *)&table, HS_CAPI_NAME, NULL);
    const int status = PyModule_AddObjectRef(module, "_C_API", capsule); /* NULL: -1 as well */
    Py_XDECREF(capsule);
    return status;
}
