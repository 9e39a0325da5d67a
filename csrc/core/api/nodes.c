/* SPDX-License-Identifier: BSD-3-Clause */
#include "../connectivity/connectivity.h"
#include "query.h"
#include "../../halfshell_nodes.h"
#include "../connectivity/overlap.h"
#include "../scene/points.h"
#include "../exact/metric.h"
#include "../threads/call.h"

#include <math.h>

/* nodes.c: the public functions of node lists: rows and pairs, of a search or of a half list, and
 * what is made of them. */

/* How many nodes there are; HS_ERR_TOO_MANY from 2^31 on. */
static hs_status
count_nodes(const hs_node_lists *lists, int64_t *n)
{
    *n = 0;
    if (lists == NULL || lists->n_lists < 0 || (lists->n_lists > 0 && lists->n_nodes == NULL)) {
        return HS_ERR_ARGUMENT;
    }
    for (int32_t l = 0; l < lists->n_lists; l++) {
        const int64_t more = lists->n_nodes[l];
        if (more < 0) {
            return HS_ERR_ARGUMENT;
        }
        if (more > INT32_MAX - *n) {
            return HS_ERR_TOO_MANY;
        }
        *n += more;
    }
    return HS_OK;
}

/* Whether a call that returns a connectivity can begin; *result, unless NULL, is NULL then. */
static bool
can_connect(hs_connectivity **result, const hs_options *options)
{
    if (result != NULL) {
        *result = NULL;
    }
    return hs_can_begin(result, options);
}

/* Leaves the call. *result becomes the object, or that is freed. Returns the status. */
static hs_status
connectivity_finish(hs_connectivity *made, hs_status status, hs_connectivity **result,
                    hs_failure *failure)
{
    hs_call_tell_limit(&made->call, status, failure);
    hs_call_leave(&made->call, hs_pairs_length(made->nodes));
    hs_call_detach(&made->call);
    if (status == HS_OK) {
        *result = made;
    } else {
        hs_connectivity_free(made);
    }
    return status;
}

/* An empty connectivity whose call, with these options, has been entered; *failure becomes where
 * the failure goes, *status that of the resources. connectivity_finish must follow. NULL when
 * memory is short: then the call has ended. */
static hs_connectivity *
connectivity_begin(const hs_options *options, hs_failure **failure, hs_status *status)
{
    hs_connectivity *made = hs_connectivity_new();
    if (made == NULL) {
        *status = hs_end_early(HS_ERR_MEMORY, options, *failure);
        return NULL;
    }
    *failure = hs_call_enter(options, *failure, &made->call);
    *status = hs_check_resources(options);
    return made;
}

/* connectivity_begin for rows, by hs_pairs_begin; rows_finish must follow. points: NULL, or checked
 * as well. */
static hs_pairs *
rows_begin(const hs_options *options, const hs_points *points, hs_failure **failure,
           hs_status *status)
{
    hs_pairs *made = hs_pairs_begin(options, failure);
    if (made == NULL) {
        *status = HS_ERR_MEMORY;
        return NULL;
    }
    *status = hs_check_resources(options);
    if (*status == HS_OK && points != NULL) {
        *status = hs_check_points(points, *failure);
    }
    return made;
}

/* Leaves the call. *result becomes the rows, or these are freed. Returns the status. */
static hs_status
rows_finish(hs_pairs *made, hs_status status, hs_pairs **result, hs_failure *failure)
{
    hs_call_tell_limit(&made->call, status, failure);
    return hs_pairs_finish(made, status, made->output.n_pairs, result);
}

hs_status
hs_connectivity_link(const hs_half_list *pairs, const hs_node_lists *lists,
                     const hs_options *options, hs_connectivity **result, hs_failure *failure)
{
    int64_t   n = 0;
    hs_output half;
    hs_status status = count_nodes(lists, &n);
    if (!can_connect(result, options) || pairs == NULL || status != HS_OK) {
        return hs_end_early(status != HS_OK ? status : HS_ERR_ARGUMENT, options, failure);
    }
    hs_connectivity *made = connectivity_begin(options, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK) {
        status = hs_half_list_copy(&made->call.account, pairs, n, lists->directed, &half, failure);
        if (status == HS_OK) {
            status = hs_connectivity_fill(made, lists, n, &half, failure);
        }
        hs_output_free(&half);
    }
    return connectivity_finish(made, status, result, failure);
}

/* Options of the search for all neighbours. */
static hs_options
options_of_all_neighbours(const hs_among *among, const hs_options *options)
{
    hs_options    search = *options;
    const hs_box *box = among->cells != NULL ? hs_cells_box(among->cells) : among->box;
    search.want = HS_WANT_J;
    search.index_bytes = 4;
    search.out = NULL;
    for (int l = 0; box != NULL && l < box->ndim && l < HS_MAX_DIM; l++) {
        search.want |= box->periodic[l] ? (unsigned)HS_WANT_SHIFT : 0u;
    }
    return search;
}

hs_status
hs_connectivity_build(const hs_among *among, const hs_node_lists *lists, const hs_options *options,
                      hs_connectivity **result, hs_failure *failure)
{
    int64_t   n = 0;
    hs_pairs *found = NULL;
    hs_status status = count_nodes(lists, &n);
    if (!can_connect(result, options) || status != HS_OK || among == NULL) {
        return hs_end_early(status != HS_OK ? status : HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options search = options_of_all_neighbours(among, options);
    /* Only to look at the points; a half list, so that queries are refused. */
    const hs_query query = hs_query_among(among, HS_HALF_LIST, &search);
    if (query.among != NULL || (query.sets.points != NULL && query.sets.points->n != n)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    status = hs_neighbors_find(among, &search, &found, failure);
    if (status != HS_OK) {
        return status;
    }
    hs_options linking = *options; /* its counters are those of the search */
    linking.counters = NULL;
    hs_connectivity *made = connectivity_begin(&linking, &failure, &status);
    if (made == NULL) {
        hs_pairs_free(found);
        return status;
    }
    status = hs_connectivity_fill_rows(made, lists, &found);
    hs_pairs_free(found);
    return connectivity_finish(made, status, result, failure);
}

/* Points of an overlap, which need not be finite. */
static hs_status
find_overlap(hs_pairs *made, const hs_points *points, const hs_index_rows *gather,
             const hs_node_lists *lists, hs_failure *failure)
{
    hs_account   *account = &made->call.account;
    hs_node_lists of_all = *lists;
    hs_node_map   map;
    of_all.ghost_rows = true;
    hs_status status = hs_node_map_make(account, &of_all, points->n, &map);
    if (status != HS_OK) {
        return status;
    }
    double *rows = hs_alloc(account, HS_FOR_POINTS, points->n * points->ndim, sizeof *rows);
    status = rows != NULL ? HS_OK : HS_ERR_MEMORY;
    if (status == HS_OK) {
        hs_points_copy(points, rows);
        status = hs_overlap_fill(&made->call, &map, gather, rows, points->ndim, made, failure);
    }
    hs_free(account, rows);
    hs_node_map_free(account, &map);
    return status;
}

hs_status
hs_connectivity_overlap(const hs_points *points, const hs_index_rows *gather,
                        const hs_node_lists *lists, const hs_options *options, hs_pairs **rows,
                        hs_failure *failure)
{
    if (!hs_can_return(rows, options) || points == NULL || gather == NULL || lists == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_status status;
    hs_pairs *made = rows_begin(options, points, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK) {
        status = find_overlap(made, points, gather, lists, failure);
    }
    return rows_finish(made, status, rows, failure);
}

/* What the shifts of a half list multiply; axes that do not repeat have rows of zeros. False for a
 * box of too many dimensions. */
static bool
read_images(const hs_box *box, int ndim, hs_metric *images)
{
    *images = (hs_metric){.ndim = ndim, .n_rows = box != NULL ? ndim : 0};
    for (int l = 0; l < images->n_rows; l++) {
        for (int k = 0; k < ndim; k++) {
            images->rows[l][k] = box->periodic[l] ? box->rows[l][k] : 0.0;
        }
    }
    return images->n_rows <= HS_MAX_DIM - 2;
}

/* Of a half list that is copied, and a map. */
static hs_status
intersect(hs_pairs *made, const hs_points *points, const hs_metric *images,
          const hs_node_lists *lists, const hs_output *half, hs_failure *failure)
{
    hs_account *account = &made->call.account;
    hs_node_map map;
    hs_status   status = hs_node_map_make(account, lists, points->n, &map);
    if (status != HS_OK) {
        return status;
    }
    double *rows = hs_alloc(account, HS_FOR_POINTS, points->n * points->ndim, sizeof *rows);
    status = rows != NULL ? hs_points_copy_finite(points, rows, failure) : HS_ERR_MEMORY;
    if (status == HS_OK) {
        status = hs_intersection_fill(&made->call, &map, lists->ghost_pairs, half, rows, images,
                                      made, failure);
    }
    hs_free(account, rows);
    hs_node_map_free(account, &map);
    return status;
}

hs_status
hs_connectivity_intersect(const hs_points *points, const hs_box *box, const hs_half_list *pairs,
                          const hs_node_lists *lists, const hs_options *options, hs_pairs **result,
                          hs_failure *failure)
{
    hs_output half;
    hs_metric images;
    if (!hs_can_return(result, options) || points == NULL || pairs == NULL || lists == NULL ||
        lists->directed || (box == NULL) != (pairs->shift == NULL)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_status status;
    hs_pairs *made = rows_begin(options, points, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK && box != NULL &&
        (hs_check_box(box, points->ndim) != HS_OK || pairs->ndim != points->ndim)) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = box != NULL ? hs_box_check(box, failure) : HS_OK;
    }
    if (status == HS_OK && !read_images(box, points->ndim, &images)) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = hs_half_list_copy(&made->call.account, pairs, points->n, false, &half, failure);
        if (status == HS_OK) {
            status = intersect(made, points, &images, lists, &half, failure);
        }
        hs_output_free(&half);
    }
    return rows_finish(made, status, result, failure);
}

/* The public functions that make rows and pairs out of others: pairs of rows,
 * and what is left of rows when nodes or pairs go. */

hs_status
hs_connectivity_pair(const hs_list_rows *rows, const hs_node_lists *lists,
                     const hs_options *options, hs_connectivity **result, hs_failure *failure)
{
    int64_t   n = 0;
    hs_status status = count_nodes(lists, &n);
    if (!can_connect(result, options) || rows == NULL || status != HS_OK) {
        return hs_end_early(status != HS_OK ? status : HS_ERR_ARGUMENT, options, failure);
    }
    hs_connectivity *made = connectivity_begin(options, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK) {
        status = hs_connectivity_fill_pairs(made, lists, n, rows);
    }
    return connectivity_finish(made, status, result, failure);
}

hs_status
hs_rows_keep(const hs_list_rows *rows, const hs_node_change *change, const int64_t *source,
             int64_t n, const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    hs_status status = HS_ERR_ARGUMENT;
    if (!hs_can_return(result, options) || rows == NULL || change == NULL) {
        return hs_end_early(status, options, failure);
    }
    hs_pairs *made = rows_begin(options, NULL, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK) {
        status = hs_kept_rows_fill(&made->call, rows, change, source, n, made);
    }
    return rows_finish(made, status, result, failure);
}

hs_status
hs_rows_without(const hs_list_rows *rows, const hs_list_rows *without, bool ascend,
                const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    hs_status status = HS_ERR_ARGUMENT;
    if (!hs_can_return(result, options) || rows == NULL || without == NULL) {
        return hs_end_early(status, options, failure);
    }
    hs_pairs *made = rows_begin(options, NULL, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK) {
        status = hs_rows_without_fill(&made->call, rows, without, ascend, made);
    }
    return rows_finish(made, status, result, failure);
}

/* The public functions about single nodes: feet on a segment, and places on
 * the Z curve. Points are looked at one by one; nothing is allocated. */

/* Reads point i; HS_ERR_NOT_FINITE where it is no point. */
static hs_status
read_point(const hs_points *points, int64_t i, double *x, hs_failure *failure)
{
    hs_points one = *points;
    one.data = (const char *)points->data + i * points->row_stride;
    one.n = 1;
    const hs_status status = hs_points_copy_finite(&one, x, failure);
    failure->row = status != HS_OK ? i : failure->row;
    return status;
}

static bool
are_finite(const double *x, int ndim)
{
    for (int k = 0; k < ndim; k++) {
        if (!isfinite(x[k])) {
            return false;
        }
    }
    return true;
}

hs_status
hs_feet_between(const hs_points *points, const double *p, const double *q, bool *between,
                hs_failure *failure)
{
    hs_entry entry;
    double   ends[2][HS_MAX_DIM] = {{0.0}}, x[HS_MAX_DIM];
    failure = hs_enter(failure, &entry);
    hs_status status = points != NULL ? hs_check_points(points, failure) : HS_ERR_ARGUMENT;
    if (status == HS_OK && (p == NULL || q == NULL || !hs_has_entries(between, points))) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        memcpy(ends[0], p, (size_t)points->ndim * sizeof *p);
        memcpy(ends[1], q, (size_t)points->ndim * sizeof *q);
        if (!are_finite(ends[0], points->ndim) || !are_finite(ends[1], points->ndim)) {
            status = HS_ERR_ARGUMENT;
        }
    }
    for (int64_t i = 0; status == HS_OK && i < points->n; i++) {
        status = read_point(points, i, x, failure);
        if (status == HS_OK) {
            between[i] = hs_foot_is_between(x, ends[0], ends[1], points->ndim);
        }
    }
    hs_leave(&entry);
    return status;
}

/* The box of the keys. */
typedef struct key_box {
    double low[HS_MAX_DIM], high[HS_MAX_DIM];
} key_box;

static hs_status
read_box(const double *low, const double *high, int ndim, key_box *box, hs_failure *failure)
{
    for (int k = 0; k < ndim; k++) {
        box->low[k] = low[k];
        box->high[k] = high[k];
        if (!isfinite(box->low[k]) || !isfinite(box->high[k]) || box->low[k] > box->high[k]) {
            failure->column = k;
            return HS_ERR_BOX_FINITE;
        }
    }
    return HS_OK;
}

/* The key of a point, or HS_ERR_FAR where it is outside. */
static hs_status
find_key(const key_box *box, const double *x, int ndim, uint64_t *key)
{
    uint64_t slices[HS_MAX_DIM];
    for (int k = 0; k < ndim; k++) {
        if (x[k] < box->low[k] || x[k] > box->high[k]) {
            return HS_ERR_FAR;
        }
        slices[k] = hs_morton_slice(x[k], box->low[k], box->high[k], hs_morton_bits(ndim));
    }
    *key = hs_morton_interleave(slices, ndim);
    return HS_OK;
}

hs_status
hs_morton_keys(const hs_points *points, const double *low, const double *high, uint64_t *keys,
               hs_failure *failure)
{
    hs_entry entry;
    key_box  box;
    double   x[HS_MAX_DIM];
    failure = hs_enter(failure, &entry);
    hs_status status = points != NULL ? hs_check_points(points, failure) : HS_ERR_ARGUMENT;
    if (status == HS_OK && (low == NULL || high == NULL || !hs_has_entries(keys, points))) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = read_box(low, high, points->ndim, &box, failure);
    }
    for (int64_t i = 0; status == HS_OK && i < points->n; i++) {
        status = read_point(points, i, x, failure);
        if (status == HS_OK) {
            status = find_key(&box, x, points->ndim, &keys[i]);
            failure->row = status != HS_OK ? i : failure->row;
        }
    }
    hs_leave(&entry);
    return status;
}
