/* SPDX-License-Identifier: BSD-3-Clause */
/* node_map.c: the lists one after the other give each node a number among all; points are these
 * nodes, in their order or in another. */
#include "node_map.h"

/* Where a list begins, among all nodes and among all rows; copied, so that it cannot change. */
typedef struct list_range {
    int64_t first, end, first_ghost;
    int64_t first_row;
} list_range;

/* The ranges of all lists. False where the counts are not those of n nodes. */
static bool
read_ranges(const hs_node_lists *lists, int64_t n, list_range *ranges, int64_t *n_rows)
{
    int64_t end = 0;
    *n_rows = 0;
    for (int32_t l = 0; l < lists->n_lists; l++) {
        const int64_t count = lists->n_nodes[l];
        const int64_t ghosts = lists->n_ghosts != NULL ? lists->n_ghosts[l] : 0;
        if (count < 0 || count > n - end || ghosts < 0 || ghosts > count) {
            return false;
        }
        ranges[l] = (list_range){.first = end,
                                 .end = end + count,
                                 .first_ghost = end + count - ghosts,
                                 .first_row = *n_rows};
        end += count;
        *n_rows += lists->ghost_rows ? count : count - ghosts;
    }
    return end == n;
}

/* The list of node number `node` of all. */
static int32_t
find_list(const list_range *ranges, int32_t n_lists, int64_t node)
{
    int32_t low = 0, high = n_lists - 1;
    while (low < high) {
        const int32_t middle = low + (high - low) / 2;
        if (node < ranges[middle].end) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    return low;
}

static void
set_point(hs_node_map *map, const list_range *ranges, bool ghost_rows, int64_t point, int64_t node)
{
    const int32_t     l = find_list(ranges, map->n_lists, node);
    const list_range *range = &ranges[l];
    const bool        is_ghost = node >= range->first_ghost;
    const bool        has_row = ghost_rows || !is_ghost;
    map->list[point] = l;
    map->node[point] = (int32_t)(node - range->first);
    map->row[point] = has_row ? (int32_t)(range->first_row + node - range->first) : -1;
    map->is_ghost[point] = is_ghost;
}

/* False unless each node is one point. is_ghost tells meanwhile which nodes have been one. */
static bool
read_numbers(const hs_node_lists *lists, const list_range *ranges, hs_node_map *map)
{
    bool *seen = map->is_ghost;
    memset(seen, 0, (size_t)map->n * sizeof *seen);
    for (int64_t p = 0; p < map->n; p++) {
        const int32_t node = lists->number[p];
        if (node < 0 || node >= map->n || seen[node]) {
            return false;
        }
        seen[node] = true;
        map->node[p] = node;
    }
    for (int64_t p = 0; p < map->n; p++) {
        set_point(map, ranges, lists->ghost_rows, p, map->node[p]);
    }
    return true;
}

static bool
fill(const hs_node_lists *lists, const list_range *ranges, hs_node_map *map)
{
    for (int32_t l = 0; l < map->n_lists; l++) {
        map->end[l] = ranges[l].end;
        map->first_ghost[l] = ranges[l].first_ghost - ranges[l].first;
    }
    if (!map->is_plain) {
        return read_numbers(lists, ranges, map);
    }
    for (int64_t p = 0; p < map->n; p++) {
        set_point(map, ranges, lists->ghost_rows, p, p);
    }
    return true;
}

/* The four arrays of points in one block, and that of the lists. */
static bool
allocate(hs_account *account, hs_node_map *map)
{
    const size_t of_each = 3 * sizeof(int32_t) + sizeof(bool);
    map->list = hs_alloc(account, HS_FOR_ORDER, map->n, of_each);
    map->end = hs_alloc(account, HS_FOR_ORDER, map->n_lists, 2 * sizeof *map->end);
    if (map->list != NULL && map->end != NULL) {
        map->first_ghost = map->end + map->n_lists;
        map->node = map->list + map->n;
        map->row = map->node + map->n;
        map->is_ghost = (bool *)(map->row + map->n);
    }
    return map->list != NULL && map->end != NULL;
}

hs_status
hs_node_map_make(hs_account *account, const hs_node_lists *lists, int64_t n, hs_node_map *map)
{
    *map = (hs_node_map){.n = n, .is_plain = true};
    if (lists == NULL || lists->n_lists < 0 || (lists->n_lists > 0 && lists->n_nodes == NULL)) {
        return HS_ERR_ARGUMENT;
    }
    map->n_lists = lists->n_lists;
    map->is_plain = lists->number == NULL;
    list_range *ranges = hs_alloc(account, HS_FOR_CELLS, map->n_lists, sizeof *ranges);
    hs_status   status = HS_ERR_MEMORY;
    if (ranges != NULL && !read_ranges(lists, n, ranges, &map->n_rows)) {
        status = HS_ERR_ARGUMENT;
    } else if (ranges != NULL && allocate(account, map)) {
        status = fill(lists, ranges, map) ? HS_OK : HS_ERR_ARGUMENT;
    }
    hs_free(account, ranges);
    if (status != HS_OK) {
        hs_node_map_free(account, map);
    }
    return status;
}

void
hs_node_map_free(hs_account *account, hs_node_map *map)
{
    hs_free(account, map->list);
    hs_free(account, map->end);
    *map = (hs_node_map){.n = 0};
}
