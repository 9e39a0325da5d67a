/* SPDX-License-Identifier: BSD-3-Clause */
#if !defined(_WIN32) && !defined(_POSIX_C_SOURCE)
#define _POSIX_C_SOURCE 200809L
#endif
#include "dynamic.h"
#include "../base/os_thread.h"
#include "../memory/memory.h"
#include "ball.h"

/* dynamic.c: the functions of halfshell_dynamic.h (docs/dynamic.md) but for queries: lists are
 * made and held, keys looked up; and the gate that readers and writers pass. */

/* The way in is one compare-and-swap; threads that do not get in sleep until one leaves. */

#define WRITER      (INT64_C(1) << 31)
#define PER_PROCESS (INT64_C(1) << 32)

/* The state where no thread of this process is inside. */
static int64_t
empty(void)
{
    return hs_atomic_load(&hs_n_forks) * PER_PROCESS;
}

/* Adds to what is inside, unless that is too much; threads of a parent are not. */
static bool
try_enter(hs_gate *gate, int64_t most, int64_t more)
{
    const int64_t state = hs_atomic_load(&gate->state), none = empty();
    const int64_t inside = state < none ? 0 : state - none;
    return inside <= most && hs_atomic_swap_if(&gate->state, state, none + inside + more);
}

static bool
try_read(void *gate)
{
    return try_enter(gate, WRITER - 2, 1);
}

static bool
try_write(void *gate)
{
    return try_enter(gate, 0, WRITER);
}

static bool
is_free(void *gate)
{
    return hs_atomic_load(&((hs_gate *)gate)->state) <= empty();
}

void
hs_gate_init(hs_gate *gate)
{
    *gate = (hs_gate){.state = empty()};
}

bool
hs_gate_is_mine(hs_gate *gate)
{
    const int64_t holder = hs_atomic_load(&gate->holder);
    return holder != 0 && holder == HS_THREAD_NUMBER() &&
           gate->held_at == hs_atomic_load(&hs_n_forks);
}

/* A writer that waits gives up what readers may need to get out, and takes it back before it goes
 * in: never the other way round. */
static HS_NO_INLINE void
wait_to_write(hs_gate *gate)
{
    if (gate->pause == NULL) {
        hs_wait_for(try_write, gate);
        return;
    }
    do {
        void *const paused = gate->pause();
        hs_wait_for(is_free, gate);
        gate->resume(paused);
    } while (!try_write(gate));
}

bool
hs_gate_enter(hs_gate *gate, bool writes)
{
    bool (*const try_to)(void *) = writes ? try_write : try_read;
    if (hs_gate_is_mine(gate)) {
        return false;
    }
    if (!try_to(gate) && !try_to(gate)) {
        if (writes) {
            wait_to_write(gate);
        } else {
            hs_wait_for(try_read, gate);
        }
    }
    return true;
}

void
hs_gate_leave(hs_gate *gate, bool writes)
{
    bool is_last = true;
    if (writes) {
        hs_atomic_store(&gate->state, empty());
    } else {
        is_last = hs_atomic_add(&gate->state, -1) % WRITER == 1;
    }
    if (is_last && hs_atomic_load(&hs_n_waiting) > 0) {
        hs_wake_waiting();
    }
}

bool
hs_gate_hold(hs_gate *gate)
{
    const bool went_in = hs_gate_enter(gate, true);
    if (went_in) {
        gate->held_at = hs_atomic_load(&hs_n_forks);
        hs_atomic_store(&gate->holder, HS_THREAD_NUMBER());
    }
    return went_in;
}

void
hs_gate_release(hs_gate *gate)
{
    hs_atomic_store(&gate->holder, 0);
    hs_gate_leave(gate, true);
}

/* Positions made ready, for the number of dimensions that a list has. */

/* In general boxes: whether X and its coordinates are known to within a few periods, so that a ball
 * meets few images. Sets the magnitude and the terms. */
static bool
is_known(const hs_dynamic *list, hs_placed *placed)
{
    const hs_lattice *lattice = &list->lattice;
    bool              known = true;
    if (placed->magnitude > 0x1p-50 * list->most_terms) {
        /* The largest sum of absolute terms that a coordinate is wrapped by, of those that the box
         * moves: others are what was given. */
        int64_t turns[HS_MAX_DIM];
        (void)hs_lattice_shift(lattice, placed->turns, turns); /* as when it was wrapped */
        placed->magnitude = 0.0;
        for (int c = 0; c < lattice->ndim; c++) {
            double terms = list->moves[c] ? fabs(placed->given[c]) : 0.0;
            for (int l = 0; l < lattice->n_periodic; l++) {
                terms += fabs((double)turns[l] * lattice->given[l][c]);
            }
            placed->magnitude = hs_larger(terms, placed->magnitude);
        }
        known = placed->magnitude <= list->most_terms;
    }
    for (int k = 0; k < lattice->ndim; k++) {
        placed->terms[k] = hs_axis_terms(lattice, placed->x, k);
        known = known && placed->terms[k] < list->axis[k].farthest;
    }
    return known;
}

HS_ALWAYS_INLINE hs_status
place_in(const hs_dynamic *list, const double *given, hs_placed *placed, hs_failure *failure,
         const int ndim)
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
    if (!list->lattice.aligned && !is_known(list, placed)) {
        return HS_ERR_SHIFT_RANGE;
    }
    for (int k = 0; k < ndim; k++) {
        placed->t[k] = hs_lattice_coordinate(&list->lattice, placed->x, k);
        placed->index[k] = hs_axis_cell(&list->axis[k], placed->t[k]);
    }
    return HS_OK;
}

hs_status
hs_dynamic_place(const hs_dynamic *list, const double *given, hs_placed *placed,
                 hs_failure *failure)
{
    switch (list->lattice.ndim) {
    case 2: return place_in(list, given, placed, failure, 2);
    case 3: return place_in(list, given, placed, failure, 3);
    default: return place_in(list, given, placed, failure, list->lattice.ndim);
    }
}

/* ---- lists as a whole ---- */

#define LEAST_LENGTH 0x1p-300 /* squares of these and of their quotients are ordinary numbers */
#define MOST_LENGTH  0x1p300
#define MOST_IMAGES  0x1p20

static bool
is_length(double x)
{
    return x >= LEAST_LENGTH && x <= MOST_LENGTH;
}

static hs_status
refuse_length(hs_failure *failure, hs_length_column column, double value)
{
    failure->column = column;
    failure->value = value;
    return HS_ERR_CUTOFF;
}

static hs_status
check_options(const hs_dynamic_options *options, hs_failure *failure)
{
    const double  radius = options->max_radius;
    const hs_box *box = options->box;
    const int     d = options->ndim;
    if (d < 1 || d > HS_MAX_DIM || (int)options->storage < 0 ||
        options->storage > HS_STORE_ALL_PAIRS || !(options->grid_bytes >= 0.0) ||
        (box != NULL && box->ndim != d)) {
        return HS_ERR_ARGUMENT;
    }
    if (!is_length(options->cell_size)) {
        return refuse_length(failure, HS_LENGTH_CELL_SIZE, options->cell_size);
    }
    if (radius != 0.0 && !is_length(radius)) {
        return refuse_length(failure, HS_LENGTH_MAX_RADIUS, radius);
    }
    const hs_status status = box != NULL ? hs_box_check(box, failure) : HS_OK;
    for (int l = 0; box != NULL && status == HS_OK && l < d; l++) {
        for (int k = 0; box->periodic[l] && k < d; k++) {
            if (box->rows[l][k] != 0.0 && !is_length(fabs(box->rows[l][k]))) {
                return refuse_length(failure, HS_LENGTH_BOX, box->rows[l][k]);
            }
        }
    }
    return status;
}

/* Sums over the box that bounds of rounding are made of. Returns how many images of a ball a query
 * may have to look at, as far as its centre does not add to them. */
static double
measure_box(hs_dynamic *list)
{
    double least = INFINITY, n_images = 1.0;
    for (int r = 0; r < list->lattice.n_periodic; r++) {
        list->row_error += list->lattice.row_error[r];
        for (int k = 0; k < list->lattice.ndim; k++) {
            list->spread += fabs(list->lattice.rows[r][k]);
        }
    }
    for (int k = 0; k < list->lattice.ndim; k++) {
        const hs_axis *axis = &list->axis[k];
        for (int l = 0; l < list->lattice.n_periodic; l++) {
            list->moves[k] = list->moves[k] || list->lattice.given[l][k] != 0.0;
        }
        if (axis->row >= 0) {
            least = hs_smaller(axis->period, least);
            n_images *= 2.0 * ceil((list->max_radius + axis->leak) / axis->period) + 1.0;
        }
    }
    list->most_terms = 0x1p90 * least;
    return n_images;
}

hs_dynamic_options
hs_dynamic_options_default(void)
{
    return (hs_dynamic_options){.ndim = 3,
                                .storage = HS_STORE_HASH,
                                .cell_size = 1.0,
                                .inclusive = true,
                                .grid_bytes = 1e9};
}

hs_status
hs_dynamic_new(const hs_dynamic_options *options, hs_dynamic **list, hs_failure *failure)
{
    hs_failure ignored;
    failure = hs_failure_or(failure, &ignored);
    if (options == NULL || list == NULL) {
        return HS_ERR_ARGUMENT;
    }
    *list = NULL;
    const hs_fpenv env = hs_fpenv_enter();
    hs_status      status = check_options(options, failure);
    hs_dynamic    *made = status == HS_OK ? hs_alloc(NULL, HS_FOR_CELLS, 1, sizeof *made) : NULL;
    if (status == HS_OK && made == NULL) {
        status = HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        memset(made, 0, sizeof *made);
        made->storage = options->storage;
        made->inclusive = options->inclusive;
        made->max_radius = options->max_radius != 0.0 ? options->max_radius : options->cell_size;
        hs_gate_init(&made->gate);
        hs_lattice_init(options->box, options->ndim, hs_scale_of(0), &made->lattice);
        status = hs_skew_is_left(&made->lattice) ? HS_ERR_BOX_SKEWED : HS_OK;
    }
    if (status == HS_OK) {
        hs_axes_init(made, options->cell_size, options->storage == HS_STORE_ALL_PAIRS);
        hs_stored_init(made, options->storage != HS_STORE_HASH, options->grid_bytes);
        if (!(measure_box(made) <= MOST_IMAGES)) {
            status = refuse_length(failure, HS_LENGTH_MAX_RADIUS, made->max_radius);
        } else if (!hs_offsets_init(made)) {
            status = HS_ERR_MEMORY;
        }
    }
    if (status == HS_OK) {
        *list = made;
    } else {
        hs_free(NULL, made);
    }
    hs_fpenv_leave(env);
    return status;
}

void
hs_dynamic_free(hs_dynamic *list)
{
    if (list != NULL) {
        hs_stored_free(list);
        hs_free(NULL, list->offsets.slot);
        hs_free(NULL, list);
    }
}

void
hs_dynamic_clear(hs_dynamic *list)
{
    if (list != NULL) {
        const hs_dynamic_call call = hs_dynamic_enter(list, true);
        hs_stored_free(list);
        list->changes++;
        hs_dynamic_leave(list, call);
    }
}

int64_t
hs_dynamic_length(const hs_dynamic *list)
{
    return hs_dynamic_look(list).n_points;
}

/* The cursor is the number of a cell, and that of an entry in it: 2^31 of both at most. */
int64_t
hs_dynamic_keys(const hs_dynamic *list, int64_t *cursor, hs_key *keys, int64_t n)
{
    int64_t found = 0;
    if (list == NULL || cursor == NULL || keys == NULL || *cursor < 0) {
        return 0;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    int64_t               c = *cursor >> 32, e = *cursor & UINT32_MAX;
    while (found < n && c < list->cells.n) {
        const hs_cell cell = list->cells.cell[c];
        for (; e < cell.count && found < n; e++) {
            const hs_entry_tail *tail = hs_entry_tail_at(&list->entries, cell.start + (uint32_t)e);
            keys[found++] = (hs_key){tail->id, tail->tag};
        }
        if (e >= cell.count) {
            c++;
            e = 0;
        }
    }
    *cursor = c << 32 | e;
    hs_dynamic_leave(list, call);
    return found;
}

void
hs_dynamic_hold(hs_dynamic *list)
{
    if (list != NULL && hs_gate_hold(&list->gate)) {
        list->held_env = hs_fpenv_enter();
    }
}

void
hs_dynamic_release(hs_dynamic *list)
{
    if (list != NULL && hs_gate_is_mine(&list->gate)) {
        const hs_fpenv env = list->held_env;
        hs_gate_release(&list->gate);
        hs_fpenv_leave(env);
    }
}

void
hs_dynamic_hook(hs_dynamic *list, const hs_dynamic_hooks *hooks)
{
    if (list != NULL) {
        list->hooks = hooks != NULL ? *hooks : (hs_dynamic_hooks){.poll = NULL};
        list->gate.pause = list->hooks.pause;
        list->gate.resume = list->hooks.resume;
    }
}

void
hs_dynamic_count(hs_dynamic *list, hs_dynamic_counters *counters)
{
    if (list != NULL) {
        list->counters = counters;
        if (counters != NULL) {
            *counters = (hs_dynamic_counters){0};
        }
    }
}

/* ---- points are looked up ---- */

bool
hs_dynamic_has(const hs_dynamic *list, hs_key key)
{
    if (list == NULL) {
        return false;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    const bool            has = hs_stored_find(list, key) != HS_NO_PLACE;
    hs_dynamic_leave(list, call);
    return has;
}

hs_status
hs_dynamic_position(const hs_dynamic *list, hs_key key, double *position)
{
    if (list == NULL || position == NULL) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    const uint32_t        place = hs_stored_find(list, key);
    hs_status             status = HS_OK;
    if (place == HS_NO_PLACE) {
        status = HS_ERR_KEY;
    } else if (isnan(hs_entry_at(&list->entries, place)[0])) {
        status = HS_ERR_ARGUMENT;
    } else {
        memcpy(position, hs_entry_given(&list->entries, place),
               (size_t)list->lattice.ndim * sizeof *position);
    }
    hs_dynamic_leave(list, call);
    return status;
}

hs_status
hs_dynamic_cell_of(const hs_dynamic *list, const double *position, int64_t *cell,
                   hs_failure *failure)
{
    hs_failure ignored;
    hs_placed  placed;
    double     own[HS_MAX_DIM];
    failure = hs_failure_or(failure, &ignored);
    if (list == NULL || position == NULL || cell == NULL) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    hs_read_position(list, position, own);
    const hs_status status = hs_dynamic_place(list, own, &placed, failure);
    if (status == HS_OK) {
        memcpy(cell, placed.index, (size_t)list->lattice.ndim * sizeof *cell);
    }
    hs_dynamic_leave(list, call);
    return status;
}

/* Which cell a position is in never changes: the list may, once that is known. */
hs_status
hs_dynamic_cell(const hs_dynamic *list, hs_key key, int64_t *cell)
{
    double          position[HS_MAX_DIM];
    const hs_status status = cell != NULL ? hs_dynamic_position(list, key, position)
                                          : HS_ERR_ARGUMENT;
    return status == HS_OK ? hs_dynamic_cell_of(list, position, cell, NULL) : status;
}
