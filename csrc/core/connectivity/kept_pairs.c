/* SPDX-License-Identifier: BSD-3-Clause */
/* kept_pairs.c: each pair is read once, and written where the new table goes on. */
#include "kept_pairs.h"

#include "../base/poll.h"
#include "node_pairs.h"

/* Pairs between two calls of poll(). */
#define POLL_PAIRS (INT64_C(1) << 20)

typedef struct filling {
    const hs_node_pairs *pairs;
    const int32_t      **targets; /* owned; of the nodes of each list. NULL: numbers stay */
    const int64_t       *n_nodes; /* of each list */
    int32_t              n_lists;
    int64_t              n;
    hs_node_columns      to;
} filling;

static hs_status
find_targets(hs_account *account, const hs_node_change *change, filling *doing)
{
    if (change == NULL) {
        return HS_OK;
    }
    doing->targets = hs_alloc(account, HS_FOR_CELLS, change->n_lists, sizeof *doing->targets);
    if (doing->targets == NULL) {
        return HS_ERR_MEMORY;
    }
    const int32_t *target = change->target;
    for (int32_t l = 0; l < change->n_lists; l++) {
        if (change->n_nodes[l] < 0) {
            return HS_ERR_ARGUMENT;
        }
        doing->targets[l] = target;
        target += change->n_nodes[l];
    }
    doing->n_lists = change->n_lists;
    doing->n_nodes = change->n_nodes;
    return HS_OK;
}

/* The new number of a node, or -1 where it goes. False where there is no such node. */
HS_ALWAYS_INLINE bool
look_up(const filling *doing, int32_t list, int32_t node, int32_t *number)
{
    if (doing->targets == NULL) {
        *number = node;
        return true;
    }
    if (list < 0 || list >= doing->n_lists || node < 0 || node >= doing->n_nodes[list]) {
        return false;
    }
    *number = doing->targets[list][node];
    return true;
}

/* Writes pair e, which counts only if it stays: there is room for all. */
HS_ALWAYS_INLINE bool
put(filling *doing, int64_t e, bool stays)
{
    const hs_node_pairs *pairs = doing->pairs;
    const int64_t        at = doing->n;
    const int32_t        i_list = pairs->i_list[e], j_list = pairs->j_list[e];
    const int            d = pairs->ndim;
    int32_t              i, j;
    if (!look_up(doing, i_list, pairs->i_node[e], &i) ||
        !look_up(doing, j_list, pairs->j_node[e], &j)) {
        return false;
    }
    doing->to.i_node[at] = i;
    doing->to.j_node[at] = j;
    doing->to.i_list[at] = i_list;
    doing->to.j_list[at] = j_list;
    for (int k = 0; doing->to.shift != NULL && k < d; k++) {
        doing->to.shift[at * d + k] = pairs->shift[e * d + k];
    }
    doing->n += stays & (i >= 0) & (j >= 0);
    return true;
}

static bool
are_pairs(const hs_node_pairs *pairs)
{
    return pairs->n >= 0 &&
           (pairs->n == 0 || (pairs->i_node != NULL && pairs->i_list != NULL &&
                              pairs->j_node != NULL && pairs->j_list != NULL)) &&
           (pairs->shift == NULL || (pairs->ndim >= 1 && pairs->ndim <= HS_MAX_DIM));
}

static bool
is_change(const hs_node_change *change)
{
    return change->n_lists >= 0 &&
           (change->n_lists == 0 || (change->n_nodes != NULL && change->target != NULL));
}

hs_status
hs_kept_pairs_fill(hs_call *call, const hs_node_pairs *pairs, const hs_node_change *change,
                   const bool *keep, hs_pairs *nodes, hs_pairs *lists)
{
    filling   doing = {.pairs = pairs};
    hs_status status = HS_ERR_ARGUMENT;
    if (are_pairs(pairs) && (change == NULL || is_change(change))) {
        status = find_targets(&call->account, change, &doing);
    }
    if (status == HS_OK) {
        status = hs_node_columns_open(call, pairs->shift != NULL, pairs->ndim, pairs->n, nodes,
                                      lists, &doing.to);
    }
    for (int64_t e = 0; status == HS_OK && e < pairs->n; e++) {
        status = put(&doing, e, keep == NULL || keep[e]) ? HS_OK : HS_ERR_ARGUMENT;
        if (status == HS_OK && e % POLL_PAIRS == POLL_PAIRS - 1) {
            status = hs_poll(&call->options, (double)e / (double)pairs->n);
        }
    }
    nodes->output.n_pairs = lists->output.n_pairs = status == HS_OK ? doing.n : 0;
    hs_free(&call->account, doing.targets);
    return status;
}
