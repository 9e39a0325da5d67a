/* SPDX-License-Identifier: BSD-3-Clause */
/* node_pairs.c: pairs are counted, so that no array is longer than the table, then put. */
#include "node_pairs.h"

int64_t
hs_node_pairs_count(const hs_node_map *map, bool ghost_pairs, const hs_output *half)
{
    const hs_half_columns pairs = hs_half_list_columns(half);
    int64_t               n = 0;
    for (int64_t e = 0; e < pairs.n; e++) {
        bool turned;
        n += hs_node_pair_counts(map, ghost_pairs, pairs.i[e], pairs.j[e], &turned);
    }
    return n;
}

hs_status
hs_node_columns_open(hs_call *call, bool has_shift, int ndim, int64_t room, hs_pairs *nodes,
                     hs_pairs *lists, hs_node_columns *to)
{
    const unsigned shift = has_shift ? (unsigned)HS_WANT_SHIFT : 0u;
    const int      d = has_shift ? ndim : 1;
    hs_output_init(&call->account, d, HS_WANT_I | HS_WANT_J | shift, 4, &nodes->output);
    hs_output_init(&call->account, d, HS_WANT_I | HS_WANT_J, 4, &lists->output);
    hs_status status = hs_output_reserve(&nodes->output, room, 0.0);
    if (status == HS_OK) {
        status = hs_output_reserve(&lists->output, room, 0.0);
    }
    if (status == HS_OK) {
        *to = (hs_node_columns){.i_node = hs_output_column(&nodes->output, HS_WANT_I),
                                .j_node = hs_output_column(&nodes->output, HS_WANT_J),
                                .i_list = hs_output_column(&lists->output, HS_WANT_I),
                                .j_list = hs_output_column(&lists->output, HS_WANT_J),
                                .shift = hs_output_column(&nodes->output, HS_WANT_SHIFT)};
    }
    return status;
}

/* Writes pair e of the half list as pair `at` of the table. */
HS_ALWAYS_INLINE void
put(const hs_node_columns *to, int64_t at, const hs_node_map *map, const hs_half_columns *half,
    int64_t e, bool turned)
{
    const int32_t first = turned ? half->j[e] : half->i[e];
    const int32_t second = turned ? half->i[e] : half->j[e];
    const int     d = half->ndim;
    to->i_node[at] = map->node[first];
    to->i_list[at] = map->list[first];
    to->j_node[at] = map->node[second];
    to->j_list[at] = map->list[second];
    for (int k = 0; to->shift != NULL && k < d; k++) {
        const uint32_t component = (uint32_t)half->shift[e * d + k];
        to->shift[at * d + k] = (int32_t)(turned ? 0u - component : component);
    }
}

hs_status
hs_node_pairs_fill(hs_call *call, const hs_node_map *map, bool ghost_pairs, const hs_output *half,
                   hs_pairs *nodes, hs_pairs *lists)
{
    const hs_half_columns pairs = hs_half_list_columns(half);
    const int64_t         n = hs_node_pairs_count(map, ghost_pairs, half);
    hs_node_columns       to;
    const hs_status       status = hs_node_columns_open(call, (half->columns & HS_WANT_SHIFT) != 0,
                                                        half->ndim, n, nodes, lists, &to);
    if (status != HS_OK) {
        return status;
    }
    nodes->output.n_pairs = lists->output.n_pairs = n;
    for (int64_t e = 0, at = 0; e < pairs.n; e++) {
        bool turned;
        if (hs_node_pair_counts(map, ghost_pairs, pairs.i[e], pairs.j[e], &turned)) {
            put(&to, at++, map, &pairs, e, turned);
        }
    }
    return HS_OK;
}
