/* SPDX-License-Identifier: BSD-3-Clause */
/* api_node_changes.c: the public functions that make rows and pairs out of others: pairs of rows,
 * and what is left of both when nodes or pairs go. */
#include "../../halfshell_nodes.h"

#include "../connectivity/kept_pairs.h"
#include "../connectivity/kept_rows.h"

#include "node_results.h"

hs_status
hs_connectivity_pair(const hs_list_rows *rows, const hs_node_lists *lists,
                     const hs_options *options, hs_connectivity **result, hs_failure *failure)
{
    int64_t   n = 0;
    hs_status status = hs_count_nodes(lists, &n);
    if (!hs_can_connect(result, options) || rows == NULL || status != HS_OK) {
        return hs_end_early(status != HS_OK ? status : HS_ERR_ARGUMENT, options, failure);
    }
    hs_connectivity *made = hs_connectivity_begin(options, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK) {
        status = hs_connectivity_fill_pairs(made, lists, n, rows);
    }
    return hs_connectivity_finish(made, status, result, failure);
}

hs_status
hs_node_pairs_keep(const hs_node_pairs *pairs, const hs_node_change *change, const bool *keep,
                   const hs_options *options, hs_connectivity **result, hs_failure *failure)
{
    hs_status status = HS_ERR_ARGUMENT;
    if (!hs_can_connect(result, options) || pairs == NULL) {
        return hs_end_early(status, options, failure);
    }
    hs_connectivity *made = hs_connectivity_begin(options, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK) {
        status = hs_kept_pairs_fill(&made->call, pairs, change, keep, made->nodes, made->lists);
    }
    return hs_connectivity_finish(made, status, result, failure);
}

hs_status
hs_rows_keep(const hs_list_rows *rows, const hs_node_change *change, const int64_t *source,
             int64_t n, const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    hs_status status = HS_ERR_ARGUMENT;
    if (!hs_can_return(result, options) || rows == NULL || change == NULL) {
        return hs_end_early(status, options, failure);
    }
    hs_pairs *made = hs_rows_begin(options, NULL, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK) {
        status = hs_kept_rows_fill(&made->call, rows, change, source, n, made);
    }
    return hs_rows_finish(made, status, result, failure);
}

hs_status
hs_rows_without(const hs_list_rows *rows, const hs_list_rows *without, bool ascend,
                const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    hs_status status = HS_ERR_ARGUMENT;
    if (!hs_can_return(result, options) || rows == NULL || without == NULL) {
        return hs_end_early(status, options, failure);
    }
    hs_pairs *made = hs_rows_begin(options, NULL, &failure, &status);
    if (made == NULL) {
        return status;
    }
    if (status == HS_OK) {
        status = hs_rows_without_fill(&made->call, rows, without, ascend, made);
    }
    return hs_rows_finish(made, status, result, failure);
}
