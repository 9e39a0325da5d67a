/* SPDX-License-Identifier: BSD-3-Clause */
/* py_results.c: what searches return: new arrays, the caller's, or some of a fixed length. */
#include "py_call.h"

#include "errors.h"
#include "outputs.h"
#include "tuples.h"

#include <math.h>
#include <string.h>

/* Bytes of arrays for which the system is not asked what it has left. */
#define SMALL_ROOM ((double)(64 << 20))

bool
hs_py_call_make_room(hs_py_call *call)
{
    const hs_options *options = &call->options;
    const int         ndim = call->points.ndim, index_bytes = options->index_bytes;
    const int64_t     capacity = call->capacity < 0 ? -call->capacity : call->capacity;
    if (capacity == 0) {
        return true;
    }
    const double bytes = hs_out_bytes(call->letters, ndim, index_bytes, capacity);
    double       limit = options->memory_limit;
    if (bytes > SMALL_ROOM && options->find_limit != NULL) {
        limit = fmin(limit, options->find_limit(options->find_context));
    }
    if (!(bytes <= limit && bytes <= (double)PY_SSIZE_T_MAX / 2)) {
        char room[48], most[48];
        PyErr_Format(PyExc_MemoryError, "arrays of capacity %lld would take %s; %s",
                     (long long)capacity, hs_format_bytes(bytes, room, sizeof room),
                     hs_format_limit(limit, most, sizeof most));
        return false;
    }
    call->room = hs_out_new(call->letters, ndim, index_bytes, capacity);
    if (call->room != NULL &&
        !hs_out_of(call->room, call->letters, ndim, index_bytes, &call->arrays)) {
        Py_CLEAR(call->room);
    }
    call->out = call->room;
    call->options.out = call->room != NULL ? &call->arrays : NULL;
    return call->room != NULL;
}

/* Entries of the room, and behind them the number of pairs; a new reference or NULL. */
static PyObject *
with_need(PyObject *room, bool is_one, int64_t needed)
{
    const Py_ssize_t n = is_one ? 1 : PyTuple_GET_SIZE(room);
    PyObject        *result = PyTuple_New(n + 1);
    for (Py_ssize_t k = 0; result != NULL && k < n; k++) {
        PyObject *array = is_one ? room : PyTuple_GET_ITEM(room, k);
        Py_INCREF(array);
        hs_tuple_put(&result, k, array);
    }
    if (result != NULL) {
        hs_tuple_put(&result, n, PyLong_FromLongLong(needed));
    }
    return result;
}

/* The room, padded; gives it up. Where the pairs do not fit there is none of them in it. */
static PyObject *
padded(hs_py_call *call, hs_status status, int64_t n_pairs)
{
    const int64_t capacity = call->arrays.capacity;
    const bool    fits = status == HS_OK, is_one = strlen(call->letters) == 1;
    const int64_t needed = fits ? n_pairs : hs_pairs_needed(&call->failure);
    PyObject     *result = NULL;
    if (fits || (status == HS_ERR_CAPACITY && call->capacity < 0)) {
        const hs_points *asking = call->among.queries != NULL ? &call->queries : &call->points;
        hs_out_pad(call->room, call->letters, fits ? needed : 0, asking->n, call->points.n,
                   call->options.n_shells);
        Py_INCREF(call->room);
        result = call->room;
        if (call->capacity < 0) {
            Py_SETREF(result, with_need(call->room, is_one, needed));
        }
    } else if (status == HS_ERR_CAPACITY) {
        hs_raise_capacity(capacity, needed);
    } else {
        hs_raise(status, &call->failure, &call->options);
    }
    Py_CLEAR(call->room);
    return result;
}

PyObject *
hs_py_call_pairs(hs_py_call *call, hs_status status, hs_pairs *pairs)
{
    if (call->room != NULL) {
        const int64_t n_pairs = hs_pairs_length(pairs);
        hs_pairs_free(pairs);
        return padded(call, status, n_pairs);
    }
    if (status != HS_OK) {
        return hs_raise(status, &call->failure, &call->options);
    }
    PyObject *arrays =
        call->out != NULL
            ? hs_out_filled(call->out, call->letters, hs_pairs_length(pairs))
            : hs_arrays_of(pairs, call->letters, call->points.ndim, call->options.index_bytes);
    hs_pairs_free(pairs);
    return arrays;
}

PyObject *
hs_py_call_table(hs_py_call *call, hs_status status, hs_pairs *rows)
{
    if (status != HS_OK) {
        return hs_raise(status, &call->failure, &call->options);
    }
    PyObject *table =
        hs_table_of(rows, call->letters, call->points.ndim, call->options.index_bytes);
    hs_pairs_free(rows);
    return table;
}
