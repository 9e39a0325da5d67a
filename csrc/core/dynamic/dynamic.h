/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_DYNAMIC_DYNAMIC_H
#define HS_DYNAMIC_DYNAMIC_H

#include "../base/base.h"
#include "../../halfshell_dynamic.h"
#include "../base/os.h"
#include "../box/lattice.h"
#include "storage.h"
#include "../box/wrap.h"

/*
 * dynamic.h: a list of points that come, go and move, each under a key.
 *
 * Each point is an entry: wrapped position, key and cell side by side, so that a query reads cells
 * only. The entries of a cell lie in one block of a power of two; a block that is full is replaced
 * by one of twice the size. A map leads from keys to entries. Removal moves the last entry of the
 * cell into the gap and tells the map: it takes the same time however crowded the cell is.
 */

/*
 * A lock that many readers may hold at once, or one writer. Free, it costs two atomic
 * instructions a call, which is what a list of a hundred nanoseconds a call can afford; only a
 * thread that has to wait calls the system.
 */

/* How many readers are inside, or that a writer is, and after how many forks (os_thread.h). */
typedef struct hs_gate {
    volatile int64_t state;
    volatile int64_t holder;  /* number of the thread that is the writer for many calls; 0: none */
    int64_t          held_at; /* how many forks there had been when it became that */
    void *(*pause)(void);     /* around each wait of a writer; NULL: nothing is done */
    void (*resume)(void *paused);
} hs_gate;

void hs_gate_init(hs_gate *gate);

/* Go in, which `end` ends. False: this thread holds the gate, and is inside. */
bool hs_gate_read(hs_gate *gate);
void hs_gate_read_end(hs_gate *gate);
bool hs_gate_write(hs_gate *gate);
void hs_gate_write_end(hs_gate *gate);

/* A writer for many calls. False: this thread holds the gate already. */
bool hs_gate_hold(hs_gate *gate);
bool hs_gate_is_mine(hs_gate *gate); /* whether this thread holds it */
void hs_gate_release(hs_gate *gate); /* which this thread holds */

struct hs_dynamic {
    hs_storage storage;
    bool       inclusive;
    hs_fpenv   held_env; /* hs_dynamic_hold */
    double     max_radius;
    hs_lattice lattice;
    double     spread;            /* sum of all |entries| of B */
    double     row_error;         /* sum of the errors of B */
    bool       moves[HS_MAX_DIM]; /* whether B does, along each coordinate axis */
    double     most_terms;        /* of wrapping: beyond, X errs by a period or so */
    double     magnitude; /* of wrapping, of all points that were ever here: at most most_terms */
    hs_axes    axes;
    hs_offsets offsets;
    hs_entries entries;
    hs_key_map map;
    hs_cell_table        cells;
    int64_t              n_without; /* entries without a position, whose coordinates are NaN */
    int64_t              changes;   /* from here on nothing is copied to another list */
    hs_gate              gate;
    hs_dynamic_hooks     hooks;
    hs_dynamic_counters *counters; /* borrowed, or NULL */
};

/* A position, made ready. */
typedef struct hs_placed {
    const double *given;             /* borrowed; ndim finite numbers */
    double        x[HS_MAX_DIM];     /* X, in the middle period; not rounded in aligned boxes */
    double        t[HS_MAX_DIM];     /* coordinates along the grid axes */
    double        terms[HS_MAX_DIM]; /* sums of absolute products in them; not in aligned boxes */
    int64_t       turns[HS_MAX_DIM]; /* over the rows of B */
    int64_t       index[HS_MAX_DIM]; /* of the cell */
    double        magnitude; /* as hs_wrap_point raises it, of the coordinates that the box moves;
                              * not in aligned boxes */
} hs_placed;

/* Makes room for `count` entries in a cell; those that are there move to a larger block. False when
 * memory is refused: then nothing has changed. */
bool hs_cell_reserve(hs_dynamic *list, uint32_t number, int64_t count);

/* A position as a list stores it: brought into the middle period, and its cell. */

/*
 * X and turns of finite numbers; false beyond HS_WRAP_LIMIT. *magnitude as in hs_wrap_point.
 * Aligned boxes wrap each coordinate exactly, others by compensated sums. Most points are inside
 * or one period away, where the difference is exact, as wrap.c says of its columns.
 */
HS_ALWAYS_INLINE bool
hs_dynamic_wrap(const hs_dynamic *list, const double *given, double *wrapped, int64_t *turns,
                double *magnitude, const int ndim)
{
    bool fits = true;
    if (!list->lattice.aligned) {
        return hs_wrap_point(&list->lattice, given, wrapped, turns, magnitude);
    }
    for (int k = 0; k < ndim; k++) {
        const hs_axis *axis = &list->axes.axis[k];
        const double   x = given[k], size = fabs(x);
        wrapped[k] = x;
        if (axis->row < 0) {
            continue;
        }
        if (size <= 1.25 * axis->period) {
            /* No branch: which half of the box a point is in cannot be predicted. */
            const double turn = (double)((x > axis->half) - (x < -axis->half));
            wrapped[k] = x - turn * axis->period;
            turns[axis->row] = (int64_t)turn;
        } else {
            wrapped[k] = hs_wrap_axis(x, axis->period, &turns[axis->row]);
            fits = fits && turns[axis->row] != HS_WRAP_UNKNOWN;
        }
    }
    return fits;
}

/* In general boxes: whether X and its coordinates are known to within a few periods, so that a ball
 * meets few images. Sets the magnitude and the terms. */
bool hs_dynamic_is_known(const hs_dynamic *list, hs_placed *placed);

/* HS_OK, HS_ERR_NOT_FINITE with column and value, HS_ERR_SHIFT_RANGE. ndim: that of the list, for
 * callers that let the compiler unroll loops. */
HS_ALWAYS_INLINE hs_status
hs_dynamic_place_in(const hs_dynamic *list, const double *given, hs_placed *placed,
                    hs_failure *failure, const int ndim)
{
    placed->given = given;
    placed->magnitude = 0.0;
    for (int k = 0; k < ndim; k++) {
        if (!isfinite(given[k])) {
            failure->column = k;
            failure->value = given[k];
            return HS_ERR_NOT_FINITE;
        }
    }
    if (HS_UNLIKELY(list->counters != NULL) && list->lattice.n_periodic > 0) {
        list->counters->wraps++;
    }
    if (!hs_dynamic_wrap(list, given, placed->x, placed->turns, &placed->magnitude, ndim)) {
        return HS_ERR_SHIFT_RANGE;
    }
    if (!list->lattice.aligned && !hs_dynamic_is_known(list, placed)) {
        return HS_ERR_SHIFT_RANGE;
    }
    for (int k = 0; k < ndim; k++) {
        placed->t[k] = hs_lattice_coordinate(&list->lattice, placed->x, k);
        placed->index[k] = hs_axis_cell(&list->axes.axis[k], placed->t[k]);
    }
    return HS_OK;
}

hs_status hs_dynamic_place(const hs_dynamic *list, const double *given, hs_placed *placed,
                           hs_failure *failure);

/* Lists as a whole: made from options, copied, emptied. */

/* Statuses of hs_dynamic_new. */
hs_status hs_list_new(const hs_dynamic_options *options, hs_dynamic **list, hs_failure *failure);

void      hs_list_free(hs_dynamic *list);
hs_status hs_list_copy(const hs_dynamic *list, hs_dynamic **copy);
void      hs_list_clear(hs_dynamic *list);

/* On failure the list is as it was. */
hs_status hs_list_shrink(hs_dynamic *list);

/*
 * Points come, go and move. Each function either does all that it is for, or returns a status and
 * leaves the list as it was, but for memory that waits for the next point.
 */

/* Adds the point or moves it. placed: NULL for a key without a position. */
hs_status hs_update_insert(hs_dynamic *list, hs_key key, const hs_placed *placed,
                           hs_failure *failure);

/* The same for n keys that differ from each other; positions are columns x[k][i], finite. */
hs_status hs_update_insert_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags,
                                int64_t n, double *const *x, hs_failure *failure);

bool hs_update_remove(hs_dynamic *list, hs_key key);

#endif
