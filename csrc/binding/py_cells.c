/* SPDX-License-Identifier: BSD-3-Clause */
/* py_cells.c: what is kept between searches, in capsules: cells, which searches take in place of
 * points, and lists for many steps; and boxes. */
#include "py_functions.h"

#include "errors.h"
#include "outputs.h"
#include "system.h"

/* ---- cells -------------------------------------------------------------------------------- */

static void
free_cells(PyObject *capsule)
{
    hs_cells_free(hs_cells_of(capsule));
}

PyObject *
hs_py_cells_build(hs_py_call *call)
{
    hs_cells *cells = NULL;
    call->options.cell_size = call->real;
    const void *domain;
    if (!hs_entries_of(call->own[1], NPY_DOUBLE, 2, 2, call->points.at.ndim, &domain)) {
        return NULL;
    }
    call->options.domain = domain;
    hs_py_call_release(call);
    const hs_status status =
        hs_cells_build(&call->points.at, call->among.box, &call->options, &cells, &call->failure);
    if (!hs_py_call_done(call, status)) {
        return NULL;
    }
    PyObject *capsule = PyCapsule_New(cells, HS_CELLS_NAME, free_cells);
    if (capsule == NULL) {
        hs_cells_free(cells);
    }
    return capsule;
}

/* A read-only array of n rows, or of n numbers if `width` is 0, that borrows from the cells and
 * keeps them alive. */
static PyObject *
view_of(PyObject *capsule, int type, const void *data, int64_t n, int width)
{
    npy_intp  shape[2] = {(npy_intp)n, width};
    const int ndim = width > 0 ? 2 : 1;
    PyObject *array = PyArray_SimpleNewFromData(ndim, shape, type, (void *)(uintptr_t)data);
    if (array == NULL) {
        return NULL;
    }
    PyArray_CLEARFLAGS((PyArrayObject *)array, NPY_ARRAY_WRITEABLE);
    Py_INCREF(capsule);
    if (PyArray_SetBaseObject((PyArrayObject *)array, capsule) < 0) {
        Py_DECREF(array);
        return NULL;
    }
    return array;
}

/* Indices of occupied cells along the axes; None where all cells have an id. */
static PyObject *
indices_of(const hs_cells *cells, const hs_layout *layout)
{
    npy_intp shape[2] = {(npy_intp)layout->n_cells, layout->ndim};
    if (!layout->occupied_only) {
        Py_RETURN_NONE;
    }
    PyObject *array = PyArray_SimpleNew(2, shape, NPY_INT64);
    if (array != NULL) {
        hs_cells_indices(cells, PyArray_DATA((PyArrayObject *)array));
        PyArray_CLEARFLAGS((PyArrayObject *)array, NPY_ARRAY_WRITEABLE);
    }
    return array;
}

PyObject *
hs_py_cells_layout(PyObject *module, PyObject *capsule)
{
    const hs_cells *cells = hs_cells_of(capsule);
    hs_layout       layout;
    hs_points       points;
    (void)module;
    if (!hs_expect("cells_layout", cells != NULL)) {
        return NULL;
    }
    hs_cells_layout(cells, &layout);
    hs_cells_points(cells, &points);
    const int64_t n_starts = layout.n_cells + 1;
    return Py_BuildValue("{s:N,s:N,s:N,s:N,s:N,s:N}", /* takes the references */
                         "shape", hs_tuple_of_integers(layout.shape, layout.ndim), "cell_sizes",
                         hs_tuple_of_reals(layout.cell_size, layout.ndim), "cell_start",
                         view_of(capsule, NPY_INT32, layout.start, n_starts, 0), "order",
                         view_of(capsule, NPY_INT32, layout.order, layout.n_points, 0), "cell_ids",
                         indices_of(cells, &layout), "points",
                         view_of(capsule, NPY_DOUBLE, points.data, points.n, points.ndim));
}

PyObject *
hs_py_cells_find(hs_py_call *call)
{
    npy_intp  n = (npy_intp)call->queries.at.n;
    PyObject *found = call->among.cells != NULL ? PyArray_SimpleNew(1, &n, NPY_INT64) : NULL;
    if (found == NULL) {
        return NULL;
    }
    hs_py_call_release(call);
    const hs_status status = hs_cells_find(call->among.cells, &call->queries.at,
                                           PyArray_DATA((PyArrayObject *)found), &call->failure);
    return hs_py_call_filled(call, status, found);
}

PyObject *
hs_py_cells_candidates(hs_py_call *call)
{
    hs_pairs *ranges = NULL;
    if (call->among.cells == NULL) {
        return NULL;
    }
    hs_py_call_release(call);
    const hs_points *queries = call->among.queries != NULL ? &call->queries.at : NULL;
    const hs_status  status =
        hs_cells_candidates(call->among.cells, queries, &call->options, &ranges, &call->failure);
    return hs_py_call_pairs(call, status, ranges, true); /* "ij": where each begins and ends */
}

/* ---- lists for many steps ----------------------------------------------------------------- */

#define CAPSULE "halfshell._core.verlet"

static void
free_list(PyObject *capsule)
{
    hs_verlet_free(PyCapsule_GetPointer(capsule, CAPSULE));
}

PyObject *
hs_py_verlet_new(PyObject *module, PyObject *ignored)
{
    (void)module;
    (void)ignored;
    hs_verlet *list = hs_verlet_new();
    if (list == NULL) {
        return PyErr_NoMemory();
    }
    PyObject *capsule = PyCapsule_New(list, CAPSULE, free_list);
    if (capsule == NULL) {
        hs_verlet_free(list);
    }
    return capsule;
}

PyObject *
hs_py_verlet_update(hs_py_call *call)
{
    hs_verlet *list = PyCapsule_GetPointer(call->own[0], CAPSULE);
    bool       rebuilt = false;
    if (list == NULL) {
        return NULL;
    }
    hs_py_call_release(call);
    const hs_status status = hs_verlet_update(list, &call->points.at, call->among.box,
                                              &call->options, call->real, call->flag, &rebuilt,
                                              &call->failure);
    return hs_py_call_done(call, status) ? PyBool_FromLong(rebuilt) : NULL;
}

PyObject *
hs_py_verlet_pairs(hs_py_call *call)
{
    hs_verlet *list = PyCapsule_GetPointer(call->own[0], CAPSULE);
    hs_pairs  *pairs = NULL;
    if (list == NULL) {
        return NULL;
    }
    const hs_verlet_state state = hs_verlet_look(list);
    if (call->points.at.ndim != state.ndim) {
        return NULL;
    }
    call->points.at.n = state.n_points; /* those given are none: the list has its own */
    if (call->of[9] == Py_None) {
        call->options.threads = -hs_default_threads();
    }
    hs_py_call_release(call);
    const hs_status status = hs_verlet_find(list, &call->options, &pairs, &call->failure);
    return hs_py_call_pairs(call, status, pairs, false);
}

PyObject *
hs_py_verlet_look(PyObject *module, PyObject *capsule)
{
    (void)module;
    hs_verlet *list = PyCapsule_GetPointer(capsule, CAPSULE);
    if (list == NULL) {
        return NULL;
    }
    const hs_verlet_state state = hs_verlet_look(list);
    return Py_BuildValue("{s:O,s:i,s:L,s:L,s:d,s:d}", "has_list",
                         state.has_list ? Py_True : Py_False, "ndim", state.ndim, "n_points",
                         (long long)state.n_points, "n_listed", (long long)state.n_listed, "margin",
                         state.margin, "tried", state.tried);
}

/* ---- boxes -------------------------------------------------------------------------------- */

/* Points between two looks for Ctrl-C: some hundredths of a second in the most skewed box. */
#define POINTS_PER_CALL 32768

/* Points, the box, unless it is None, and the axes that repeat, of a function that takes so many
 * arguments, these first. */
static bool
take_scene(const char *name, PyObject *const *arguments, Py_ssize_t n_arguments, int expected,
           hs_points *points, hs_box *box)
{
    unsigned long repeats;
    return hs_expect(
        name, n_arguments == expected && hs_points_of(arguments[0], points) &&
                  hs_repeats_of(arguments[2], &repeats) &&
                  (arguments[1] == Py_None || hs_box_of(arguments[1], repeats, points->ndim, box)));
}

PyObject *
hs_py_box_measure(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_box        box;
    hs_failure    failure;
    unsigned long repeats;
    double        heights[HS_MAX_DIM] = {0}, volume;
    (void)module;
    npy_intp ndim = n_arguments == 2 && hs_is_array(arguments[0], NPY_DOUBLE, 2)
                        ? (npy_intp)hs_length_of(arguments[0])
                        : 0;
    if (!hs_expect("box_measure", ndim >= 1 && ndim <= HS_MAX_DIM &&
                                      hs_repeats_of(arguments[1], &repeats) &&
                                      hs_box_of(arguments[0], repeats, (int)ndim, &box))) {
        return NULL;
    }
    const hs_status status = hs_box_measure(&box, heights, &volume, &failure);
    return status == HS_OK
               ? Py_BuildValue("(Nd)", hs_array_like(heights, 1, &ndim, NPY_DOUBLE), volume)
               : hs_raise(status, &failure, NULL);
}

/* Some points after others, without the GIL; signals are handled in between. Without points once,
 * for what is said of the box. Returns false with an exception set. */
static bool
wrap_in_parts(const hs_box *box, const hs_points *points, double *wrapped, int64_t *shifts)
{
    hs_points  part = *points;
    hs_failure failure;
    int64_t    first = 0;
    do {
        const int64_t at = first * points->ndim;
        hs_status     status;
        part.n = points->n - first < POINTS_PER_CALL ? points->n - first : POINTS_PER_CALL;
        part.data = (const char *)points->data + first * points->row_stride;
        Py_BEGIN_ALLOW_THREADS
        status = hs_box_wrap(box, &part, wrapped + at, shifts + at, &failure);
        Py_END_ALLOW_THREADS
        if (status != HS_OK) {
            const bool is_of_point = status == HS_ERR_NOT_FINITE || status == HS_ERR_SHIFT_RANGE;
            failure.row += failure.row >= 0 && is_of_point ? first : 0;
            hs_raise(status, &failure, NULL);
            return false;
        }
        if (PyErr_CheckSignals() != 0) {
            return false;
        }
        first += part.n;
    } while (first < points->n);
    return true;
}

PyObject *
hs_py_box_wrap(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_points points;
    hs_box    box;
    (void)module;
    if (!take_scene("box_wrap", arguments, n_arguments, 3, &points, &box) ||
        !hs_expect("box_wrap", arguments[1] != Py_None)) {
        return NULL;
    }
    npy_intp   shape[2] = {(npy_intp)points.n, points.ndim};
    PyObject  *wrapped = PyArray_SimpleNew(2, shape, NPY_DOUBLE);
    PyObject  *shifts = PyArray_SimpleNew(2, shape, NPY_INT64);
    const bool made = wrapped != NULL && shifts != NULL &&
                      wrap_in_parts(&box, &points, PyArray_DATA((PyArrayObject *)wrapped),
                                    PyArray_DATA((PyArrayObject *)shifts));
    PyObject *both = made ? PyTuple_Pack(2, wrapped, shifts) : NULL;
    Py_XDECREF(wrapped);
    Py_XDECREF(shifts);
    return both;
}

PyObject *
hs_py_box_places(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_points points;
    hs_box    box;
    (void)module;
    if (!take_scene("box_places", arguments, n_arguments, 5, &points, &box)) {
        return NULL;
    }
    const double cutoff = PyFloat_AsDouble(arguments[3]);
    const double largest = PyErr_Occurred() ? 0.0 : PyFloat_AsDouble(arguments[4]);
    npy_intp     shape[2] = {points.ndim, (npy_intp)points.n};
    PyObject    *places = PyErr_Occurred() ? NULL : PyArray_SimpleNew(2, shape, NPY_DOUBLE);
    if (places == NULL) {
        return NULL;
    }
    hs_box_axes axes;
    hs_failure  failure;
    hs_status   status;
    Py_BEGIN_ALLOW_THREADS
    status = hs_box_places(arguments[1] != Py_None ? &box : NULL, &points, cutoff, largest,
                           PyArray_DATA((PyArrayObject *)places), points.n, &axes, &failure);
    Py_END_ALLOW_THREADS
    PyObject *repeats = status == HS_OK ? PyTuple_New(points.ndim)
                                        : hs_raise(status, &failure, NULL);
    if (repeats == NULL) {
        Py_DECREF(places);
        return NULL;
    }
    for (int k = 0; k < points.ndim; k++) {
        PyTuple_SET_ITEM(repeats, k, PyBool_FromLong(axes.repeats[k]));
    }
    return Py_BuildValue("(NNNN)", places, repeats, hs_tuple_of_reals(axes.reach, points.ndim),
                         hs_tuple_of_reals(axes.width, points.ndim));
}
