/* SPDX-License-Identifier: BSD-3-Clause */
#include "../../halfshell_dynamic.h"
#include "query.h"
#include "../base/os.h"
#include "../base/status.h"
#include "../dynamic/storage.h"
#include "../scene/points.h"
#include "../dynamic/ball.h"

/* dynamic_lists.c: the functions of halfshell_dynamic.h, for single points, and many, that come, go
 * and move (docs/dynamic.md): arguments are checked and the list is held here, the work is done in
 * dynamic/. */

/* What each public function of a hs_dynamic does first and last. */

typedef struct hs_dynamic_call {
    hs_fpenv env;
    bool     writes;
    bool     went_in; /* false: this thread holds the list */
} hs_dynamic_call;

/* Waits until the list may be used, and sets the rounding mode. */
HS_ALWAYS_INLINE hs_dynamic_call
hs_dynamic_enter(const hs_dynamic *list, bool writes)
{
    hs_gate        *gate = &((hs_dynamic *)list)->gate; /* it changes, the list does not */
    hs_dynamic_call call = {.writes = writes};
    call.went_in = writes ? hs_gate_write(gate) : hs_gate_read(gate);
    if (call.went_in) {
        call.env = hs_fpenv_enter();
    }
    return call;
}

HS_ALWAYS_INLINE void
hs_dynamic_leave(const hs_dynamic *list, hs_dynamic_call call)
{
    hs_gate *gate = &((hs_dynamic *)list)->gate;
    if (call.went_in) {
        hs_fpenv_leave(call.env);
        if (call.writes) {
            hs_gate_write_end(gate);
        } else {
            hs_gate_read_end(gate);
        }
    }
}

/* Where a failure goes. */
HS_ALWAYS_INLINE hs_failure *
hs_failure_or(hs_failure *failure, hs_failure *ignored)
{
    failure = failure != NULL ? failure : ignored;
    *failure = HS_NO_FAILURE;
    return failure;
}

/* The caller's numbers, each read once. */
HS_ALWAYS_INLINE void
hs_read_position(const hs_dynamic *list, const double *position, double *own)
{
    for (int k = 0; k < list->lattice.ndim; k++) {
        own[k] = ((const volatile double *)position)[k];
    }
}

/* The place of a key's entry, or HS_NO_PLACE. */
static uint32_t
find(const hs_dynamic *list, hs_key key)
{
    return hs_key_map_find(&list->map, &list->entries, key);
}

/* hs_dynamic_insert and hs_dynamic_move. */
static hs_status
put(hs_dynamic *list, hs_key key, const double *position, bool must_be_there, hs_failure *failure)
{
    hs_failure ignored;
    hs_placed  placed;
    double     own[HS_MAX_DIM];
    hs_status  status = HS_OK;
    failure = hs_failure_or(failure, &ignored);
    if (list == NULL || (position == NULL && list->storage != HS_STORE_ALL_PAIRS)) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, true);
    if (must_be_there && find(list, key) == HS_NO_PLACE) {
        status = HS_ERR_KEY;
    }
    if (status == HS_OK && position != NULL) {
        hs_read_position(list, position, own);
        status = hs_dynamic_place(list, own, &placed, failure);
    }
    if (status == HS_OK) {
        status = hs_update_insert(list, key, position != NULL ? &placed : NULL, failure);
    }
    hs_dynamic_leave(list, call);
    return status;
}

hs_status
hs_dynamic_insert(hs_dynamic *list, hs_key key, const double *position, hs_failure *failure)
{
    return put(list, key, position, false, failure);
}

hs_status
hs_dynamic_move(hs_dynamic *list, hs_key key, const double *position, hs_failure *failure)
{
    return put(list, key, position, true, failure);
}

bool
hs_dynamic_remove(hs_dynamic *list, hs_key key)
{
    if (list == NULL) {
        return false;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, true);
    const bool            was_there = hs_update_remove(list, key);
    hs_dynamic_leave(list, call);
    return was_there;
}

/* HS_ERR_KEY for a key that comes twice, or must be there and is not. */
static hs_status
check_keys(const hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t n,
           bool must_be_there, hs_failure *failure)
{
    const int64_t repeated = hs_repeated_key(ids, tags, n);
    if (repeated != -1) {
        failure->row = repeated >= 0 ? repeated : -1;
        failure->column = repeated >= 0 ? HS_KEY_REPEATED : -1;
        return repeated >= 0 ? HS_ERR_KEY : HS_ERR_MEMORY;
    }
    for (int64_t i = 0; must_be_there && i < n; i++) {
        const hs_key key = {ids[i], tags != NULL ? tags[i] : 0};
        if (find(list, key) == HS_NO_PLACE) {
            failure->row = i;
            failure->column = HS_KEY_ABSENT;
            return HS_ERR_KEY;
        }
    }
    return HS_OK;
}

static hs_status
put_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags, const hs_points *positions,
         bool must_be_there, hs_failure *failure)
{
    const hs_options options = hs_options_default();
    hs_failure       ignored;
    hs_cloud         cloud;
    failure = hs_failure_or(failure, &ignored);
    if (list == NULL || positions == NULL || positions->ndim != list->lattice.ndim ||
        (ids == NULL && positions->n != 0)) {
        return HS_ERR_ARGUMENT;
    }
    hs_status status = hs_check_points(positions, failure);
    if (status != HS_OK) {
        return status;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, true);
    status = check_keys(list, ids, tags, positions->n, must_be_there, failure);
    if (status == HS_OK) {
        status = hs_cloud_load(NULL, NULL, positions, &options, &cloud, failure);
        if (status == HS_OK) {
            status = hs_update_insert_many(list, ids, tags, positions->n, cloud.x, failure);
            hs_cloud_free(NULL, &cloud);
        }
    }
    hs_dynamic_leave(list, call);
    return status;
}

hs_status
hs_dynamic_insert_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags,
                       const hs_points *positions, hs_failure *failure)
{
    return put_many(list, ids, tags, positions, false, failure);
}

hs_status
hs_dynamic_move_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags,
                     const hs_points *positions, hs_failure *failure)
{
    return put_many(list, ids, tags, positions, true, failure);
}

hs_status
hs_dynamic_remove_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t n,
                       bool *removed, hs_failure *failure)
{
    hs_failure ignored;
    failure = hs_failure_or(failure, &ignored);
    if (list == NULL || n < 0 || (ids == NULL && n > 0)) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, true);
    const hs_status       status = check_keys(list, ids, tags, n, false, failure);
    for (int64_t i = 0; status == HS_OK && i < n; i++) {
        const hs_key key = {ids[i], tags != NULL ? tags[i] : 0};
        const bool   was_there = hs_update_remove(list, key);
        if (removed != NULL) {
            removed[i] = was_there;
        }
    }
    hs_dynamic_leave(list, call);
    return status;
}

bool
hs_dynamic_has(const hs_dynamic *list, hs_key key)
{
    if (list == NULL) {
        return false;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    const bool            has = find(list, key) != HS_NO_PLACE;
    hs_dynamic_leave(list, call);
    return has;
}

/* The position of a key: borrowed until the list changes. */
static hs_status
look_up(const hs_dynamic *list, hs_key key, const double **given)
{
    const uint32_t place = find(list, key);
    if (place == HS_NO_PLACE) {
        return HS_ERR_KEY;
    }
    *given = hs_entry_given(&list->entries, place);
    return isnan(hs_entry_at(&list->entries, place)[0]) ? HS_ERR_ARGUMENT : HS_OK;
}

hs_status
hs_dynamic_position(const hs_dynamic *list, hs_key key, double *position)
{
    const double *given;
    if (list == NULL || position == NULL) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    const hs_status       status = look_up(list, key, &given);
    if (status == HS_OK) {
        memcpy(position, given, (size_t)list->lattice.ndim * sizeof *given);
    }
    hs_dynamic_leave(list, call);
    return status;
}

/* The cell of a position of the caller's, or where that is NULL of a key. */
static hs_status
cell_at(const hs_dynamic *list, const hs_key *key, const double *position, int64_t *cell,
        hs_failure *failure)
{
    double        own[HS_MAX_DIM];
    const double *given = own;
    hs_placed     placed;
    hs_status     status = HS_OK;
    if (list == NULL || (key == NULL && position == NULL) || cell == NULL) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    if (key != NULL) {
        status = look_up(list, *key, &given);
    } else {
        hs_read_position(list, position, own);
    }
    if (status == HS_OK) {
        status = hs_dynamic_place(list, given, &placed, failure);
    }
    if (status == HS_OK) {
        memcpy(cell, placed.index, (size_t)list->lattice.ndim * sizeof *cell);
    }
    hs_dynamic_leave(list, call);
    return status;
}

hs_status
hs_dynamic_cell(const hs_dynamic *list, hs_key key, int64_t *cell)
{
    hs_failure ignored;
    return cell_at(list, &key, NULL, cell, &ignored);
}

hs_status
hs_dynamic_cell_of(const hs_dynamic *list, const double *position, int64_t *cell,
                   hs_failure *failure)
{
    hs_failure ignored;
    return cell_at(list, NULL, position, cell, hs_failure_or(failure, &ignored));
}

/* Visits the points that a query finds: those near the ball, or exactly within it, for which every
 * key needs a position. any: receives whether there is one; NULL: each is visited. skip: or
 * NULL. */
static hs_status
ask(const hs_dynamic *list, const double *position, double radius, const hs_ball_visit *visit,
    const hs_key *skip, bool *any, hs_failure *failure)
{
    hs_failure ignored;
    hs_ball    ball;
    double     own[HS_MAX_DIM];
    failure = hs_failure_or(failure, &ignored);
    if (list == NULL || position == NULL || (visit->fn == NULL && any == NULL)) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    hs_read_position(list, position, own);
    hs_status status = hs_ball_init(&ball, list, own, radius, failure);
    if (status == HS_OK && list->n_without > 0 && !visit->is_near) {
        status = HS_ERR_KEY;
    }
    if (status == HS_OK && skip != NULL) {
        ball.skip = find(list, *skip);
        status = ball.skip != HS_NO_PLACE ? HS_OK : HS_ERR_KEY;
    }
    if (status == HS_OK) {
        const bool found = hs_ball_walk(&ball, visit);
        if (any != NULL) {
            *any = found;
        }
        status = ball.status;
    }
    hs_dynamic_leave(list, call);
    return status;
}

hs_status
hs_dynamic_near(const hs_dynamic *list, const double *position, double radius, hs_dynamic_fn visit,
                void *user, hs_failure *failure)
{
    const hs_ball_visit each = {.fn = visit, .user = user, .is_near = true};
    return ask(list, position, radius, &each, NULL, NULL, failure);
}

hs_status
hs_dynamic_within(const hs_dynamic *list, const double *position, double radius, bool with_shift,
                  hs_dynamic_fn visit, void *user, hs_failure *failure)
{
    const hs_ball_visit each = {.fn = visit, .user = user, .with_shift = with_shift};
    return ask(list, position, radius, &each, NULL, NULL, failure);
}

hs_status
hs_dynamic_any_within(const hs_dynamic *list, const double *position, double radius,
                      const hs_key *skip, bool *any, hs_failure *failure)
{
    static const hs_ball_visit first = {.fn = NULL};
    return ask(list, position, radius, &first, skip, any, failure); /* refused where any is NULL */
}

/* The public functions of a list of points that come and go as a whole: it is made, copied and
 * emptied, held for calls in a row, gone through, and looked at. */

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
    const hs_fpenv  env = hs_fpenv_enter();
    const hs_status status = hs_list_new(options, list, failure);
    hs_fpenv_leave(env);
    return status;
}

void
hs_dynamic_free(hs_dynamic *list)
{
    if (list != NULL) {
        hs_list_free(list);
    }
}

hs_status
hs_dynamic_copy(const hs_dynamic *list, hs_dynamic **copy)
{
    if (list == NULL || copy == NULL) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    const hs_status       status = hs_list_copy(list, copy);
    hs_dynamic_leave(list, call);
    return status;
}

void
hs_dynamic_clear(hs_dynamic *list)
{
    if (list != NULL) {
        const hs_dynamic_call call = hs_dynamic_enter(list, true);
        hs_list_clear(list);
        list->changes++;
        hs_dynamic_leave(list, call);
    }
}

hs_status
hs_dynamic_shrink_to_fit(hs_dynamic *list)
{
    if (list == NULL) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, true);
    const hs_status       status = hs_list_shrink(list);
    hs_dynamic_leave(list, call);
    return status;
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

hs_dynamic_state
hs_dynamic_look(const hs_dynamic *list)
{
    hs_dynamic_state state = {.ndim = 0};
    if (list == NULL) {
        return state;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    state.ndim = list->lattice.ndim;
    state.n_points = list->map.n;
    state.n_without = list->n_without;
    state.n_cells = list->cells.n;
    state.n_empty = list->cells.dense ? 0 : list->cells.n_empty;
    state.bytes = (int64_t)sizeof *list + list->offsets.at[list->offsets.reach + 1] +
                  hs_entries_bytes(&list->entries) + hs_hash_bytes(&list->map.hash) +
                  hs_cell_table_bytes(&list->cells);
    state.changes = list->changes;
    state.max_radius = list->max_radius;
    for (int k = 0; k < state.ndim; k++) {
        state.cell_size[k] = list->axes.axis[k].width;
    }
    hs_dynamic_leave(list, call);
    return state;
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
