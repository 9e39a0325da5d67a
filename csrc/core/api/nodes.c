/* SPDX-License-Identifier: BSD-3-Clause */
#include "../connectivity/connectivity.h"
#include "query.h"
#include "../../halfshell_nodes.h"
#include "../scene/points.h"
#include "../threads/call.h"

#include <math.h>
#include <string.h>

/* nodes.c: the public functions of node lists: rows and pairs, of a search or of a half list, and
 * what is made of them. */

/* Begins a call that makes a connectivity, if `has_input`: *failure becomes where the failure goes.
 * connectivity_end must follow. NULL, with *status, where the call has ended. */
static hs_connectivity *
connectivity_begin(bool has_input, const hs_options *options, hs_connectivity **result,
                   hs_failure **failure, hs_status *status)
{
    hs_connectivity *made = NULL;
    if (result != NULL) {
        *result = NULL;
    }
    *status = result != NULL && options != NULL && has_input ? HS_ERR_MEMORY : HS_ERR_ARGUMENT;
    if (*status == HS_ERR_MEMORY) {
        made = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *made);
    }
    if (made == NULL) {
        (void)hs_end_early(*status, options, *failure);
        return NULL;
    }
    memset(made, 0, sizeof *made);
    *failure = hs_call_enter(options, *failure, &made->rows.call);
    *status = hs_check_resources(options);
    return made;
}

/* Leaves the call, unless it has not begun. *result becomes the object, or that is freed. Returns
 * the status. */
static hs_status
connectivity_end(hs_connectivity *made, hs_status status, hs_connectivity **result,
                 hs_failure *failure)
{
    if (made == NULL) {
        return status;
    }
    hs_call *const call = &made->rows.call;
    hs_call_tell_limit(call, status, failure);
    hs_call_leave(call, hs_pairs_length(&made->nodes));
    hs_call_detach(call);
    if (status == HS_OK) {
        *result = made;
    } else {
        hs_connectivity_free(made);
    }
    return status;
}

/* The same for rows. points: NULL, or checked as well. */
static hs_pairs *
rows_begin(bool has_input, const hs_points *points, const hs_options *options, hs_pairs **result,
           hs_failure **failure, hs_status *status)
{
    hs_pairs *made = hs_result_begin(has_input, options, result, failure, status);
    *status = made != NULL ? hs_check_resources(options) : *status;
    if (*status == HS_OK && points != NULL) {
        *status = hs_check_points(points, *failure);
    }
    return made;
}

hs_status
hs_connectivity_link(const hs_half_list *pairs, const hs_node_lists *lists,
                     const hs_options *options, hs_connectivity **result, hs_failure *failure)
{
    hs_status         status;
    hs_node_map       map = {.n = 0};
    hs_output         half = {.n_pairs = 0}, offsets = half, rows = half;
    hs_connectivity  *made = connectivity_begin(pairs != NULL, options, result, &failure, &status);
    hs_account *const account = made != NULL ? &made->rows.call.account : NULL;
    if (status == HS_OK) {
        status = hs_node_map_make(account, lists, -1, &map);
    }
    if (status == HS_OK) {
        status = hs_half_list_copy(account, pairs, map.n, lists->directed, &half, failure);
    }
    if (status == HS_OK) {
        status = hs_output_check_opposites(&half, failure);
    }
    if (status == HS_OK) {
        status =
            hs_half_list_rows(&made->rows.call, &half, map.n, lists->directed, &offsets, &rows);
    }
    if (status == HS_OK) {
        status = hs_connectivity_fill(made, &map, &half, &offsets, &rows);
    }
    hs_output_free(&half);
    hs_output_free(&offsets);
    hs_output_free(&rows);
    hs_node_map_free(account, &map);
    return connectivity_end(made, status, result, failure);
}

hs_status
hs_connectivity_build(const hs_among *among, const hs_node_lists *lists, const hs_options *options,
                      hs_connectivity **result, hs_failure *failure)
{
    hs_pairs   *found = NULL;
    hs_node_map map = {.n = 0};
    if (result != NULL) {
        *result = NULL;
    }
    if (result == NULL || options == NULL || among == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_options    search = *options; /* for all neighbours */
    const hs_box *box = among->cells != NULL ? hs_cells_box(among->cells) : among->box;
    search.want = HS_WANT_J;
    search.index_bytes = 4;
    search.out = NULL;
    for (int l = 0; box != NULL && l < box->ndim && l < HS_MAX_DIM; l++) {
        search.want |= box->periodic[l] ? (unsigned)HS_WANT_SHIFT : 0u;
    }
    /* Only to look at the points; a half list, so that queries are refused. */
    const hs_query query = hs_query_among(among, HS_HALF_LIST, &search);
    hs_status      status = query.among != NULL || query.sets.points == NULL
                                ? HS_ERR_ARGUMENT
                                : hs_node_map_make(NULL, lists, query.sets.points->n, &map);
    if (status != HS_OK) {
        return hs_end_early(status, options, failure);
    }
    status = hs_neighbors_find(among, &search, &found, failure);
    if (status == HS_OK) {
        hs_options linking = *options; /* its counters are those of the search */
        linking.counters = NULL;
        hs_connectivity *made = connectivity_begin(true, &linking, result, &failure, &status);
        hs_output        half = {.n_pairs = 0};
        if (status == HS_OK) { /* the search has ended: its account is closed */
            found->offsets.account = found->output.account = NULL;
            status = hs_connectivity_fill(made, &map, &half, &found->offsets, &found->output);
        }
        hs_output_free(&half);
        status = connectivity_end(made, status, result, failure);
    }
    hs_pairs_free(found);
    hs_node_map_free(NULL, &map);
    return status;
}

hs_status
hs_connectivity_overlap(const hs_points *points, const hs_index_rows *gather,
                        const hs_node_lists *lists, const hs_options *options, hs_pairs **rows,
                        hs_failure *failure)
{
    hs_status  status;
    const bool has_input = points != NULL && gather != NULL && lists != NULL;
    hs_pairs  *made = rows_begin(has_input, points, options, rows, &failure, &status);
    if (status == HS_OK) {
        status = hs_overlap_fill(&made->call, points, gather, lists, made, failure);
    }
    return hs_result_end(made, status, rows, failure);
}

hs_status
hs_connectivity_intersect(const hs_points *points, const hs_box *box, const hs_half_list *pairs,
                          const hs_node_lists *lists, const hs_options *options, hs_pairs **result,
                          hs_failure *failure)
{
    hs_status  status;
    hs_output  half = {.n_pairs = 0};
    const bool has_input = points != NULL && pairs != NULL && lists != NULL && !lists->directed &&
                           (box == NULL) == (pairs->shift == NULL);
    hs_pairs *made = rows_begin(has_input, points, options, result, &failure, &status);
    if (status == HS_OK && box != NULL) {
        status = hs_check_box(box, points->ndim) == HS_OK && pairs->ndim == points->ndim &&
                         points->ndim <= HS_MAX_DIM - 2
                     ? hs_box_check(box, failure)
                     : HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = hs_half_list_copy(&made->call.account, pairs, points->n, false, &half, failure);
    }
    if (status == HS_OK) {
        /* What the shifts multiply; axes that do not repeat have rows of zeros. */
        const int d = points->ndim;
        hs_metric images = {.ndim = d, .n_rows = box != NULL ? d : 0};
        for (int e = 0; e < images.n_rows * d; e++) {
            images.rows[e / d][e % d] = box->periodic[e / d] ? box->rows[e / d][e % d] : 0.0;
        }
        status = hs_intersection_fill(&made->call, points, &images, lists, &half, made, failure);
    }
    hs_output_free(&half);
    return hs_result_end(made, status, result, failure);
}

/* ---- rows and pairs out of others ------------------------------------------------------------ */

hs_status
hs_connectivity_pair(const hs_list_rows *rows, const hs_node_lists *lists,
                     const hs_options *options, hs_connectivity **result, hs_failure *failure)
{
    hs_status        status;
    hs_node_map      map = {.n = 0};
    hs_connectivity *made = connectivity_begin(rows != NULL, options, result, &failure, &status);
    if (status == HS_OK) {
        status = hs_node_map_make(&made->rows.call.account, lists, -1, &map);
    }
    if (status == HS_OK) {
        status = hs_connectivity_fill_pairs(made, &map, rows);
    }
    if (made != NULL) {
        hs_node_map_free(&made->rows.call.account, &map);
    }
    return connectivity_end(made, status, result, failure);
}

hs_status
hs_rows_keep(const hs_list_rows *rows, const hs_node_change *change, const int64_t *source,
             int64_t n, const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    hs_status status;
    hs_pairs *made =
        rows_begin(rows != NULL && change != NULL, NULL, options, result, &failure, &status);
    if (status == HS_OK) {
        status = hs_kept_rows_fill(&made->call, rows, change, source, n, made);
    }
    return hs_result_end(made, status, result, failure);
}

hs_status
hs_rows_without(const hs_list_rows *rows, const hs_list_rows *without, bool ascend,
                const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    hs_status status;
    hs_pairs *made =
        rows_begin(rows != NULL && without != NULL, NULL, options, result, &failure, &status);
    if (status == HS_OK) {
        status = hs_rows_without_fill(&made->call, rows, without, ascend, made);
    }
    return hs_result_end(made, status, result, failure);
}

/* ---- single nodes: points are looked at one by one; nothing is allocated --------------------- */

/* hs_morton_keys, or hs_feet_between with p and q in place of low and high: both are copied, and
 * nothing can change them then. */
static hs_status
of_each_point(const hs_points *points, const double *p, const double *q, uint64_t *keys,
              bool *between, bool finds_keys, hs_failure *failure)
{
    const void *entries = finds_keys ? (const void *)keys : between;
    hs_metric   plain = {.n_rows = 0};
    hs_entry    entry;
    double      two[2][HS_MAX_DIM] = {{0.0}}, x[HS_MAX_DIM];
    failure = hs_enter(failure, &entry);
    hs_status status = hs_check_points(points, failure);
    if (status == HS_OK && (p == NULL || q == NULL || !hs_has_entries(entries, points))) {
        status = HS_ERR_ARGUMENT;
    }
    for (int k = 0; status == HS_OK && k < points->ndim; k++) {
        two[0][k] = p[k];
        two[1][k] = q[k];
        if (!isfinite(two[0][k]) || !isfinite(two[1][k]) || (finds_keys && two[0][k] > two[1][k])) {
            failure->column = k;
            status = finds_keys ? HS_ERR_BOX_FINITE : HS_ERR_ARGUMENT;
        }
    }
    plain.ndim = status == HS_OK ? points->ndim : 0;
    for (int64_t i = 0; status == HS_OK && i < points->n; i++) {
        hs_points one = *points;
        one.data = (const char *)points->data + i * points->row_stride;
        one.n = 1;
        status = hs_points_copy_finite(&one, x, failure);
        for (int k = 0; finds_keys && status == HS_OK && k < points->ndim; k++) {
            status = x[k] < two[0][k] || x[k] > two[1][k] ? HS_ERR_FAR : HS_OK;
        }
        failure->row = status != HS_OK ? i : failure->row;
        if (status == HS_OK && finds_keys) {
            keys[i] = hs_morton_key(x, two[0], two[1], points->ndim);
        } else if (status == HS_OK) {
            between[i] = hs_foot_is_between(&plain, x, NULL, two[0], two[1], NULL);
        }
    }
    hs_leave(&entry);
    return status;
}

hs_status
hs_feet_between(const hs_points *points, const double *p, const double *q, bool *between,
                hs_failure *failure)
{
    return of_each_point(points, p, q, NULL, between, false, failure);
}

hs_status
hs_morton_keys(const hs_points *points, const double *low, const double *high, uint64_t *keys,
               hs_failure *failure)
{
    return of_each_point(points, low, high, keys, NULL, true, failure);
}
