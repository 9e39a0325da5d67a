/* SPDX-License-Identifier: BSD-3-Clause */
/* api_dynamic_list.c: the public functions of a list of points that come and go as a whole: it is
 * made, copied and emptied, held for calls in a row, gone through, and looked at. */
#include "../../halfshell_dynamic.h"

#include "dynamic_call.h"
#include "../dynamic/new_list.h"

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
    hs_status      status = hs_list_check(options, failure);
    if (status == HS_OK) {
        status = hs_list_new(options, list, failure);
    }
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
    state.bytes = (int64_t)sizeof *list + list->offsets.bytes + hs_entries_bytes(&list->entries) +
                  list->map.capacity * (int64_t)sizeof(hs_key_row) +
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
