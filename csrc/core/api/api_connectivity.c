/* SPDX-License-Identifier: BSD-3-Clause */
/* api_connectivity.c: the public functions of node lists: rows and pairs, of a search or of a half
 * list, and what is made of them. */
#include "../../halfshell_nodes.h"

#include "../connectivity/intersection.h"
#include "../connectivity/overlap.h"
#include "../scene/points.h"

#include "node_results.h"

hs_status
hs_connectivity_link(const hs_half_list *pairs, const hs_node_lists *lists,
                     const hs_options *options, hs_connectivity **result, hs_failure *failure)
{
    int64_t   n = 0;
    hs_output half;
    hs_status status = hs_count_nodes(lists, &n);
    if (!hs_can_connect(result, options) || pairs == NULL || status != HS_OK) {
        return hs_end_early(status != HS_OK ? status : HS_ERR_ARGUMENT, options, failure);
    }
    hs_connectivity *made = hs_connectivity_begin(options, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK) {
        status = hs_half_list_copy(&made->call.account, pairs, n, &half, failure);
        if (status == HS_OK) {
            status = hs_connectivity_fill(made, lists, n, &half, failure);
        }
        hs_output_free(&half);
    }
    return hs_connectivity_finish(made, status, result, failure);
}

/* Options of the search for all neighbours. */
static hs_options
options_of_rows(const hs_among *among, const hs_options *options)
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
    hs_status status = hs_count_nodes(lists, &n);
    if (!hs_can_connect(result, options) || among == NULL || status != HS_OK) {
        return hs_end_early(status != HS_OK ? status : HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options search = options_of_rows(among, options);
    const hs_request request = hs_request_among(among, HS_HALF_LIST, &search);
    if (request.sets.points != NULL && request.sets.points->n != n) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    status = hs_neighbors_find(among, &search, &found, failure);
    if (status != HS_OK) {
        return status;
    }
    hs_options linking = *options; /* its counters are those of the search */
    linking.counters = NULL;
    hs_connectivity *made = hs_connectivity_begin(&linking, &failure, &status);
    if (made == NULL) {
        hs_pairs_free(found);
        return status;
    }
    status = hs_connectivity_fill_rows(made, lists, &found);
    hs_pairs_free(found);
    return hs_connectivity_finish(made, status, result, failure);
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
    hs_pairs *made = hs_rows_begin(options, points, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK) {
        status = find_overlap(made, points, gather, lists, failure);
    }
    return hs_rows_finish(made, status, rows, failure);
}

/* Of a half list that is copied, and a map. */
static hs_status
intersect(hs_pairs *made, const hs_points *points, const hs_node_lists *lists,
          const hs_output *half, hs_failure *failure)
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
        status = hs_intersection_fill(&made->call, &map, lists->ghost_pairs, half, rows,
                                      points->ndim, made, failure);
    }
    hs_free(account, rows);
    hs_node_map_free(account, &map);
    return status;
}

hs_status
hs_connectivity_intersect(const hs_points *points, const hs_half_list *pairs,
                          const hs_node_lists *lists, const hs_options *options, hs_pairs **result,
                          hs_failure *failure)
{
    hs_output half;
    if (!hs_can_return(result, options) || points == NULL || pairs == NULL ||
        pairs->shift != NULL || lists == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_status status;
    hs_pairs *made = hs_rows_begin(options, points, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK) {
        status = hs_half_list_copy(&made->call.account, pairs, points->n, &half, failure);
        if (status == HS_OK) {
            status = intersect(made, points, lists, &half, failure);
        }
        hs_output_free(&half);
    }
    return hs_rows_finish(made, status, result, failure);
}
