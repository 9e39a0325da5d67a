/* SPDX-License-Identifier: BSD-3-Clause */
/* node_results.c: results of one kind and of the other, made alike. */
#include "node_results.h"

hs_status
hs_count_nodes(const hs_node_lists *lists, int64_t *n)
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

bool
hs_can_connect(hs_connectivity **result, const hs_options *options)
{
    if (result != NULL) {
        *result = NULL;
    }
    return hs_can_begin(result, options);
}

hs_connectivity *
hs_connectivity_begin(const hs_options *options, hs_failure **failure, hs_status *status)
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

hs_status
hs_connectivity_finish(hs_connectivity *made, hs_status status, hs_connectivity **result,
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

hs_pairs *
hs_rows_begin(const hs_options *options, const hs_points *points, hs_failure **failure,
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

hs_status
hs_rows_finish(hs_pairs *made, hs_status status, hs_pairs **result, hs_failure *failure)
{
    hs_call_tell_limit(&made->call, status, failure);
    return hs_pairs_finish(made, status, made->output.n_pairs, result);
}
