/* SPDX-License-Identifier: BSD-3-Clause */
/* row_pairs.c: what is behind a node in its own list, and all of the lists that follow. */
#include "row_pairs.h"

#include "../base/poll.h"
#include "half_list.h"
#include "node_pairs.h"

/* Entries between two calls of poll(). */
#define POLL_ENTRIES (INT64_C(1) << 21)

typedef struct filling {
    const hs_node_map  *map;
    const hs_list_rows *rows;
    bool                ghost_pairs;
    int64_t             n, room;
    hs_node_columns     to;
} filling;

/* The first of the ascending entries [first, last) that is behind this node, or a forward image of
 * the node itself. */
static int64_t
first_behind(const hs_list_rows *rows, int32_t node, int64_t first, int64_t last)
{
    while (first < last && rows->indices[first] < node) {
        first++;
    }
    if (rows->shift != NULL) {
        while (first < last && rows->indices[first] == node &&
               !hs_shift_is_forward(rows->shift + first * rows->ndim, rows->ndim)) {
            first++;
        }
    }
    return first;
}

/* Where the ghosts of a list begin in ascending entries; first_ghost is the number of the first. */
static int64_t
first_ghost_of(const hs_list_rows *rows, int64_t first_ghost, int64_t first, int64_t last)
{
    while (first < last && rows->indices[first] < first_ghost) {
        first++;
    }
    return first;
}

/* Writes the pairs of a node with entries [first, last), of list `other`. */
static bool
put(filling *doing, int32_t node, int32_t list, int32_t other, int64_t first, int64_t last,
    bool turned)
{
    const hs_list_rows *rows = doing->rows;
    const int64_t       n = last - first, at = doing->n;
    const int           d = rows->ndim;
    if (n > doing->room - at) {
        return false;
    }
    int32_t *const own_node = turned ? doing->to.j_node : doing->to.i_node;
    int32_t *const own_list = turned ? doing->to.j_list : doing->to.i_list;
    int32_t *const other_node = turned ? doing->to.i_node : doing->to.j_node;
    int32_t *const other_list = turned ? doing->to.i_list : doing->to.j_list;
    for (int64_t k = 0; k < n; k++) {
        own_node[at + k] = node;
        own_list[at + k] = list;
        other_node[at + k] = rows->indices[first + k];
        other_list[at + k] = other;
    }
    for (int64_t k = 0; doing->to.shift != NULL && k < n * d; k++) {
        const uint32_t component = (uint32_t)rows->shift[first * d + k];
        doing->to.shift[at * d + k] = (int32_t)(turned ? 0u - component : component);
    }
    doing->n += n;
    return true;
}

/* The pairs that point p begins. */
static hs_status
put_row(filling *doing, int64_t p, int64_t *looked)
{
    const hs_node_map  *map = doing->map;
    const hs_list_rows *rows = doing->rows;
    const int32_t       list = map->list[p], node = map->node[p];
    for (int32_t l = list; l < map->n_lists; l++) {
        int64_t       first = rows->offsets[p * rows->n_lists + l];
        const int64_t last = rows->offsets[p * rows->n_lists + l + 1];
        if (first < 0 || first > last || last > rows->n_indices) {
            return HS_ERR_ARGUMENT;
        }
        *looked += last - first;
        if (l == list) {
            first = first_behind(rows, node, first, last);
        }
        /* Of a ghost, pairs with nodes that are none are turned; with ghosts they may not count. */
        const int64_t ghosts =
            map->is_ghost[p] ? first_ghost_of(rows, map->first_ghost[l], first, last) : first;
        if (!put(doing, node, list, l, first, ghosts, true)) {
            return HS_ERR_ARGUMENT;
        }
        if ((!map->is_ghost[p] || doing->ghost_pairs) &&
            !put(doing, node, list, l, ghosts, last, false)) {
            return HS_ERR_ARGUMENT;
        }
    }
    return HS_OK;
}

hs_status
hs_row_pairs_fill(hs_call *call, const hs_node_map *map, bool ghost_pairs, const hs_list_rows *rows,
                  hs_pairs *nodes, hs_pairs *lists)
{
    filling doing = {
        .map = map, .rows = rows, .ghost_pairs = ghost_pairs, .room = rows->n_indices / 2};
    int64_t   looked = 0;
    hs_status status = hs_node_columns_open(call, rows->shift != NULL, rows->ndim, doing.room,
                                            nodes, lists, &doing.to);
    HS_ASSERT(map->is_plain && map->n_rows == map->n);
    for (int64_t p = 0; status == HS_OK && p < map->n; p++) {
        status = put_row(&doing, p, &looked);
        if (status == HS_OK && looked >= POLL_ENTRIES) {
            looked = 0;
            status = hs_poll(&call->options, (double)p / (double)map->n);
        }
    }
    nodes->output.n_pairs = lists->output.n_pairs = status == HS_OK ? doing.n : 0;
    return status;
}
