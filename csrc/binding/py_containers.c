/* SPDX-License-Identifier: BSD-3-Clause */
/* py_containers.c: what drop-ins return: sets, dictionaries and lists of Python, made from columns
 * of pairs; and the pairs of few points, without a search. */
#include "arguments.h"
#include "errors.h"
#include "outputs.h"
#include "py_functions.h"

/* Columns of pairs, of which a container is made. */
typedef struct columns {
    npy_intp       n, n_rows;
    const int32_t *i, *j;
    const int64_t *offsets; /* of rows, in place of i */
    const double  *d;
    PyObject      *numbers; /* owned: a list of Python's numbers; NULL: one is made each time */
} columns;

/* A new reference to a number, or NULL. */
static PyObject *
number(const columns *from, int32_t value)
{
    return from->numbers != NULL ? Py_NewRef(PyList_GET_ITEM(from->numbers, value))
                                 : PyLong_FromLong(value);
}

/* Makes each number once if numbers occur often. False with an exception set. */
static bool
share_numbers(columns *from)
{
    int32_t largest = -1;
    for (npy_intp k = 0; k < from->n; k++) {
        const int32_t i = from->i != NULL ? from->i[k] : 0;
        largest = i > largest ? i : largest;
        largest = from->j[k] > largest ? from->j[k] : largest;
    }
    from->numbers = NULL;
    if (from->n <= HS_FEW_PAIRS || largest >= from->n) {
        return true;
    }
    from->numbers = PyList_New((Py_ssize_t)largest + 1);
    for (int32_t k = 0; from->numbers != NULL && k <= largest; k++) {
        PyObject *one = PyLong_FromLong(k);
        if (one == NULL) {
            Py_CLEAR(from->numbers);
        } else {
            PyList_SET_ITEM(from->numbers, k, one);
        }
    }
    return from->numbers != NULL;
}

/* A new tuple (i, j), or NULL. */
static PyObject *
pair_at(const columns *from, npy_intp k)
{
    PyObject *pair = PyTuple_New(2);
    hs_tuple_put(&pair, 0, pair != NULL ? number(from, from->i[k]) : NULL);
    hs_tuple_put(&pair, 1, pair != NULL ? number(from, from->j[k]) : NULL);
    return pair;
}

static PyObject *
set_of(const columns *from)
{
    PyObject *set = PySet_New(NULL);
    for (npy_intp k = 0; set != NULL && k < from->n; k++) {
        PyObject *pair = pair_at(from, k);
        if (pair == NULL || PySet_Add(set, pair) < 0) {
            Py_CLEAR(set);
        }
        Py_XDECREF(pair);
    }
    return set;
}

static PyObject *
dict_of(const columns *from)
{
    PyObject *dict = PyDict_New();
    for (npy_intp k = 0; dict != NULL && k < from->n; k++) {
        PyObject *pair = pair_at(from, k), *distance = PyFloat_FromDouble(from->d[k]);
        if (pair == NULL || distance == NULL || PyDict_SetItem(dict, pair, distance) < 0) {
            Py_CLEAR(dict);
        }
        Py_XDECREF(pair);
        Py_XDECREF(distance);
    }
    return dict;
}

/* A new list of the numbers j of a row, or NULL. */
static PyObject *
row_at(const columns *from, npy_intp row)
{
    const int64_t first = from->offsets[row];
    const int64_t n = from->offsets[row + 1] - first;
    PyObject     *list = PyList_New((Py_ssize_t)n);
    for (int64_t k = 0; list != NULL && k < n; k++) {
        PyObject *one = number(from, from->j[first + k]);
        if (one == NULL) {
            Py_CLEAR(list);
        } else {
            PyList_SET_ITEM(list, (Py_ssize_t)k, one);
        }
    }
    return list;
}

static PyObject *
lists_of(const columns *from)
{
    PyObject *lists = PyList_New(from->n_rows);
    for (npy_intp row = 0; lists != NULL && row < from->n_rows; row++) {
        PyObject *list = row_at(from, row);
        if (list == NULL) {
            Py_CLEAR(lists);
        } else {
            PyList_SET_ITEM(lists, row, list);
        }
    }
    return lists;
}

/* The set, dictionary or lists that these columns are for. */
static PyObject *
container_of(columns *from)
{
    if (!share_numbers(from)) {
        return NULL;
    }
    PyObject *made = from->offsets != NULL ? lists_of(from)
                     : from->d != NULL     ? dict_of(from)
                                           : set_of(from);
    Py_XDECREF(from->numbers);
    return made;
}

PyObject *
hs_py_contain(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    const void *offsets, *i, *j, *d;
    (void)module;
    if (!hs_expect("contain", n_arguments == 4 && hs_is_array(arguments[2], NPY_INT32, 1))) {
        return NULL;
    }
    columns from = {.n = (npy_intp)hs_length_of(arguments[2])};
    if (!hs_expect("contain", hs_entries_of(arguments[0], NPY_INT64, 1, -1, 0, &offsets) &&
                                  hs_entries_of(arguments[1], NPY_INT32, 1, from.n, 0, &i) &&
                                  hs_entries_of(arguments[2], NPY_INT32, 1, from.n, 0, &j) &&
                                  hs_entries_of(arguments[3], NPY_DOUBLE, 1, from.n, 0, &d) &&
                                  (i != NULL) != (offsets != NULL))) {
        return NULL;
    }
    from.n_rows = (npy_intp)hs_length_of(arguments[0]) - 1;
    from.offsets = offsets;
    from.i = i;
    from.j = j;
    from.d = d;
    return container_of(&from);
}

/* ---- few points --------------------------------------------------------------------------- */

/* Rows i and j of intp, as SciPy has them. */
static PyObject *
array_of(const columns *from)
{
    npy_intp  shape[2] = {from->n, 2};
    PyObject *array = PyArray_SimpleNew(2, shape, NPY_INTP);
    npy_intp *to = array != NULL ? PyArray_DATA((PyArrayObject *)array) : NULL;
    for (npy_intp k = 0; to != NULL && k < from->n; k++) {
        to[2 * k] = from->i[k];
        to[2 * k + 1] = from->j[k];
    }
    return array;
}

static PyObject *
arrays_of(const columns *from)
{
    npy_intp  n = from->n;
    PyObject *arrays = PyTuple_New(3);
    hs_tuple_put(&arrays, 0, arrays != NULL ? hs_array_like(from->i, 1, &n, NPY_INT32) : NULL);
    hs_tuple_put(&arrays, 1, arrays != NULL ? hs_array_like(from->j, 1, &n, NPY_INT32) : NULL);
    hs_tuple_put(&arrays, 2, arrays != NULL ? hs_array_like(from->d, 1, &n, NPY_DOUBLE) : NULL);
    return arrays;
}

/* Where each row of few points begins, as pairs ascend. */
static void
find_offsets(const columns *from, int64_t *offsets)
{
    npy_intp k = 0;
    for (npy_intp row = 0; row < from->n_rows; row++) {
        offsets[row] = k;
        while (k < from->n && from->i[k] == row) {
            k++;
        }
    }
    offsets[from->n_rows] = k;
}

/* The letters of what hs_py_few makes: how many, a set, a dictionary, lists, pairs in an array, and
 * with distances, columns in arrays. */
enum { NUMBER = 'n', SET = 's', DICT = 'd', LISTS = 'l', PAIRS = 'P', BOTH = 'b', ARRAYS = 'a' };

/* Whether answers are those of exact arithmetic, as no setting says otherwise. */
static bool
are_settings_usual(PyObject *module)
{
    PyObject **known = PyModule_GetState(module), *set = NULL;
    if (known[HS_SETTINGS] == NULL || PyContextVar_Get(known[HS_SETTINGS], NULL, &set) < 0) {
        PyErr_Clear();
        return false;
    }
    Py_XDECREF(set);
    return set == known[HS_USUAL_SETTINGS];
}

PyObject *
hs_py_few(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    const void *queries, *period;
    double      p, eps, distances[HS_FEW_PAIRS];
    int32_t     i[HS_FEW_PAIRS], j[HS_FEW_PAIRS];
    int64_t     offsets[HS_FEW_PAIRS + 1];
    hs_few      few;
    if (!hs_expect("few", n_arguments == 7 && hs_is_array(arguments[0], NPY_DOUBLE, 2) &&
                              PyUnicode_Check(arguments[6]))) {
        return NULL;
    }
    const Py_UCS4 wanted = PyUnicode_ReadChar(arguments[6], 0);
    few.ndim = (int)PyArray_DIM((PyArrayObject *)arguments[0], 1);
    few.n_points = hs_length_of(arguments[0]);
    if (few.n_points > HS_FEW_PAIRS || few.ndim < 1 || few.ndim > HS_MAX_DIM ||
        !hs_number_of(arguments[3], &few.cutoff) || !hs_number_of(arguments[4], &p) || p != 2.0 ||
        !hs_number_of(arguments[5], &eps) || eps != 0.0 ||
        !hs_entries_of(arguments[1], NPY_DOUBLE, 2, -1, few.ndim, &queries) ||
        !hs_entries_of(arguments[2], NPY_DOUBLE, 1, few.ndim, 0, &period) ||
        !are_settings_usual(module)) {
        Py_RETURN_NONE;
    }
    few.points = PyArray_DATA((PyArrayObject *)arguments[0]);
    few.queries = queries;
    few.n_queries = hs_length_of(arguments[1]);
    few.period = period;
    columns from = {.n_rows = (npy_intp)few.n_queries,
                    .i = i,
                    .j = j,
                    .d = wanted == DICT || wanted == ARRAYS || wanted == BOTH ? distances : NULL};
    from.n = hs_few_pairs(&few, i, j, from.d != NULL ? distances : NULL);
    if (from.n < 0) {
        Py_RETURN_NONE;
    }
    if (wanted == LISTS) {
        find_offsets(&from, offsets);
        from.offsets = offsets;
    }
    return wanted == NUMBER   ? PyLong_FromSsize_t(from.n)
           : wanted == PAIRS  ? array_of(&from)
           : wanted == ARRAYS ? arrays_of(&from)
           : wanted == BOTH   ? Py_BuildValue("(NN)", array_of(&from),
                                              hs_array_like(distances, 1, &from.n, NPY_DOUBLE))
                              : container_of(&from);
}
