/* SPDX-License-Identifier: BSD-3-Clause */
/* node_rows.c: one pass counts, one puts each point where the row goes on. Pairs of one i and j in
 * several images are a group, put from its end for the row in which shifts are negative. */
#include "node_rows.h"

#include "../base/poll.h"
#include "../base/starts.h"

#include <string.h>

/* Pairs between two calls of poll(). */
#define POLL_PAIRS (INT64_C(1) << 20)

typedef struct filling {
    const hs_node_map *map;
    hs_half_columns    half;
    int64_t           *next; /* where each entry goes on, or how long it is */
    int32_t           *index;
    int32_t           *shift; /* NULL: none */
} filling;

/* The entry of a point's row for the list of another one, or -1. */
HS_ALWAYS_INLINE int64_t
entry_of(const hs_node_map *map, int32_t point, int32_t other)
{
    const int32_t row = map->row[point];
    return row < 0 ? -1 : (int64_t)row * map->n_lists + map->list[other];
}

/* How long each entry is, one place further on. */
static hs_status
count(const hs_options *options, const filling *doing)
{
    const hs_half_columns *half = &doing->half;
    int64_t               *counts = doing->next + 1;
    for (int64_t e = 0; e < half->n; e++) {
        const int64_t of_i = entry_of(doing->map, half->i[e], half->j[e]);
        const int64_t of_j = entry_of(doing->map, half->j[e], half->i[e]);
        if (of_i >= 0) {
            counts[of_i]++;
        }
        if (of_j >= 0) {
            counts[of_j]++;
        }
        if (e % POLL_PAIRS == POLL_PAIRS - 1 && hs_poll(options, 1.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

/* Puts `other` into the row of a point, with the shift of pair e, or its opposite. */
HS_ALWAYS_INLINE void
put(const filling *doing, int32_t point, int32_t other, int64_t e, bool is_opposite)
{
    const int64_t entry = entry_of(doing->map, point, other);
    if (entry < 0) {
        return;
    }
    const int64_t at = doing->next[entry]++;
    doing->index[at] = doing->map->node[other];
    if (doing->shift != NULL) {
        const int      d = doing->half.ndim;
        const int32_t *from = doing->half.shift + e * d;
        for (int k = 0; k < d; k++) {
            doing->shift[at * d + k] = is_opposite ? (int32_t)(0u - (uint32_t)from[k]) : from[k];
        }
    }
}

/* The pairs [first, end) of one i and j. A point's own images follow each other by S. */
HS_ALWAYS_INLINE void
put_group(const filling *doing, int64_t first, int64_t end)
{
    const int32_t i = doing->half.i[first], j = doing->half.j[first];
    for (int64_t e = end; i == j && e-- > first;) {
        put(doing, i, i, e, true);
    }
    for (int64_t e = first; e < end; e++) {
        put(doing, i, j, e, false);
    }
    for (int64_t e = end; i != j && e-- > first;) {
        put(doing, j, i, e, true);
    }
}

static hs_status
fill(const hs_options *options, const filling *doing)
{
    const hs_half_columns *half = &doing->half;
    int64_t                polled = 0;
    for (int64_t first = 0, end; first < half->n; first = end) {
        end = first + 1;
        while (half->shift != NULL && end < half->n && half->i[end] == half->i[first] &&
               half->j[end] == half->j[first]) {
            end++;
        }
        put_group(doing, first, end);
        if (end - polled >= POLL_PAIRS) {
            polled = end;
            if (hs_poll(options, 1.0) != HS_OK) {
                return HS_ERR_INTERRUPTED;
            }
        }
    }
    return HS_OK;
}

hs_status
hs_node_rows_fill(hs_call *call, const hs_node_map *map, const hs_output *half, hs_pairs *rows,
                  hs_failure *failure)
{
    filling        doing = {.map = map, .half = hs_half_list_columns(half)};
    const int64_t  n = map->n_rows * map->n_lists + 1;
    const unsigned columns = HS_WANT_J | (half->columns & HS_WANT_SHIFT);
    hs_output     *output = &rows->output;
    hs_status      status = hs_output_check_opposites(half, failure);
    hs_output_init(&call->account, half->ndim, columns, 4, output);
    if (status == HS_OK) {
        status = hs_pairs_open_offsets(&call->account, n, rows, &doing.next);
    }
    if (status == HS_OK) {
        memset(doing.next, 0, (size_t)n * sizeof *doing.next);
        status = count(&call->options, &doing);
    }
    if (status != HS_OK) {
        return status;
    }
    hs_starts_of_lengths(doing.next, n);
    const int64_t n_entries = doing.next[n - 1];
    status = hs_output_reserve(output, n_entries, 0.0);
    if (status != HS_OK) {
        return status;
    }
    output->n_pairs = n_entries;
    doing.index = hs_output_column(output, HS_WANT_J);
    doing.shift = hs_output_column(output, HS_WANT_SHIFT);
    status = fill(&call->options, &doing);
    hs_starts_of_ends(doing.next, n);
    return status;
}
