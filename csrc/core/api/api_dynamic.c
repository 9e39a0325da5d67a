/* SPDX-License-Identifier: BSD-3-Clause */
/* api_dynamic.c: the public functions of single points, and many, that come, go and move;
 * docs/dynamic.md. */
#include "../../halfshell_dynamic.h"

#include "arguments.h"
#include "dynamic_call.h"
#include "../dynamic/place_point.h"
#include "../dynamic/repeated_key.h"
#include "../dynamic/update.h"
#include "../scene/points.h"

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
    if (must_be_there && hs_key_map_find(&list->map, &list->entries, key) == HS_NO_PLACE) {
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
        if (hs_key_map_find(&list->map, &list->entries, key) == HS_NO_PLACE) {
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

/* The entry of a key, for a visit. */
static uint32_t
find(const hs_dynamic *list, hs_key key)
{
    return hs_key_map_find(&list->map, &list->entries, key);
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

hs_status
hs_dynamic_cell(const hs_dynamic *list, hs_key key, int64_t *cell)
{
    const double *given;
    hs_placed     placed;
    hs_failure    ignored;
    if (list == NULL || cell == NULL) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    hs_status             status = look_up(list, key, &given);
    if (status == HS_OK) {
        status = hs_dynamic_place(list, given, &placed, &ignored);
    }
    if (status == HS_OK) {
        memcpy(cell, placed.index, (size_t)list->lattice.ndim * sizeof *cell);
    }
    hs_dynamic_leave(list, call);
    return status;
}
