/* SPDX-License-Identifier: BSD-3-Clause */
#include "connectivity.h"
#include "../collect/sort_pairs.h"
#include "../base/sort.h"
#include "../base/os.h"

#include <string.h>

/* The lists one after the other give each node a number among all; points are these
 * nodes, in their order or in another. */

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
fill_map(const hs_node_lists *lists, const list_range *ranges, hs_node_map *map)
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
    map->directed = lists->directed;
    list_range *ranges = hs_alloc(account, HS_FOR_CELLS, map->n_lists, sizeof *ranges);
    hs_status   status = HS_ERR_MEMORY;
    if (ranges != NULL && !read_ranges(lists, n, ranges, &map->n_rows)) {
        status = HS_ERR_ARGUMENT;
    } else if (ranges != NULL && allocate(account, map)) {
        status = fill_map(lists, ranges, map) ? HS_OK : HS_ERR_ARGUMENT;
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

/* One pass copies, a second one compares each pair with the one before. */

hs_half_columns
hs_half_list_columns(const hs_output *half)
{
    return (hs_half_columns){.n = half->n_pairs,
                             .ndim = half->ndim,
                             .i = hs_output_column(half, HS_WANT_I),
                             .j = hs_output_column(half, HS_WANT_J),
                             .shift = hs_output_column(half, HS_WANT_SHIFT)};
}

/* Sign of the first component that differs from that of `other`, or from 0. */
static int
compare_shifts(const int32_t *shift, const int32_t *other, int ndim)
{
    for (int k = 0; k < ndim; k++) {
        const int32_t with = other != NULL ? other[k] : 0;
        if (shift[k] != with) {
            return shift[k] < with ? -1 : 1;
        }
    }
    return 0;
}

/* Whether pair e is one of n points and comes behind the one before. */
static bool
is_right(const hs_half_columns *half, int64_t e, int64_t n, bool directed)
{
    const int32_t  i = half->i[e], j = half->j[e];
    const int32_t *shift = half->shift != NULL ? half->shift + e * half->ndim : NULL;
    if (i < 0 || j < 0 || i >= n || j >= n || (j < i && !directed)) {
        return false;
    }
    if (i == j) {
        const int side = shift != NULL ? compare_shifts(shift, NULL, half->ndim) : 0;
        if (side == 0 || (side < 0 && !directed)) {
            return false;
        }
    }
    if (e == 0 || half->i[e - 1] < i || (half->i[e - 1] == i && half->j[e - 1] < j)) {
        return true;
    }
    return half->i[e - 1] == i && half->j[e - 1] == j && shift != NULL &&
           compare_shifts(shift, shift - half->ndim, half->ndim) > 0;
}

static hs_status
check(const hs_half_columns *half, int64_t n, bool directed, hs_failure *failure)
{
    for (int64_t e = 0; e < half->n; e++) {
        if (!is_right(half, e, n, directed)) {
            failure->row = e;
            return HS_ERR_ARGUMENT;
        }
    }
    return HS_OK;
}

hs_status
hs_half_list_copy(hs_account *account, const hs_half_list *pairs, int64_t n, bool directed,
                  hs_output *copy, hs_failure *failure)
{
    const unsigned shift = pairs->shift != NULL ? HS_WANT_SHIFT : 0;
    const int      ndim = pairs->shift != NULL ? pairs->ndim : 1;
    hs_output_init(account, ndim, HS_WANT_I | HS_WANT_J | shift, 4, copy);
    if (pairs->n < 0 || ndim < 1 || ndim > HS_MAX_DIM ||
        (pairs->n > 0 && (pairs->i == NULL || pairs->j == NULL))) {
        return HS_ERR_ARGUMENT;
    }
    const hs_status status = hs_output_reserve(copy, pairs->n, 0.0);
    if (status != HS_OK) {
        return status;
    }
    copy->n_pairs = pairs->n;
    if (pairs->n > 0) {
        const size_t bytes = (size_t)pairs->n * sizeof(int32_t);
        memcpy(hs_output_column(copy, HS_WANT_I), pairs->i, bytes);
        memcpy(hs_output_column(copy, HS_WANT_J), pairs->j, bytes);
        if (shift != 0) {
            memcpy(hs_output_column(copy, HS_WANT_SHIFT), pairs->shift, (size_t)ndim * bytes);
        }
    }
    const hs_half_columns half = hs_half_list_columns(copy);
    return check(&half, n, directed, failure);
}

hs_status
hs_half_list_rows(hs_call *call, const hs_output *half, int64_t n, bool directed,
                  hs_output *offsets, hs_output *rows)
{
    int64_t        *first;
    const hs_status status = hs_output_open_offsets(&call->account, n + 1, offsets, &first);
    hs_output_init(&call->account, half->ndim, half->columns & ~(unsigned)HS_WANT_I, 4, rows);
    return status == HS_OK ? hs_sort_rows(call, n, half, !directed, first, rows) : status;
}

/* Where the lists follow each other in a row, it is cut at their ends; else each entry
 * goes to where its list goes on. */

/* Where the entries of one row go. offsets[0] is set; offsets[l + 1] becomes the end of list l. */
typedef struct split_target {
    int64_t *offsets;
    int32_t *index; /* of the whole table, as shift */
    int32_t *shift; /* NULL: none */
} split_target;

HS_ALWAYS_INLINE void
put_split_entry(const split_target *to, int64_t at, int32_t node, const hs_rows_view *from,
                int64_t e)
{
    to->index[at] = node;
    for (int k = 0; to->shift != NULL && k < from->ndim; k++) {
        to->shift[at * from->ndim + k] = from->shift[e * from->ndim + k];
    }
}

/* Of points in the order of lists and nodes. */
static void
cut(const hs_node_map *map, const hs_rows_view *from, int64_t p, const split_target *to)
{
    int64_t e = from->first[p];
    for (int32_t l = 0; l < map->n_lists; l++) {
        const int32_t first = l > 0 ? (int32_t)map->end[l - 1] : 0;
        int64_t       at = to->offsets[l];
        for (; e < from->end[p] && from->index[e] < map->end[l]; e++) {
            put_split_entry(to, at++, from->index[e] - first, from, e);
        }
        to->offsets[l + 1] = at;
    }
}

/* Of points in any order. */
static void
distribute(const hs_node_map *map, const hs_rows_view *from, int64_t p, const split_target *to)
{
    int64_t      *offsets = to->offsets;
    const int64_t base = offsets[0], n = (int64_t)map->n_lists + 1;
    memset(offsets + 1, 0, (size_t)map->n_lists * sizeof *offsets);
    for (int64_t e = from->first[p]; e < from->end[p]; e++) {
        offsets[map->list[from->index[e]] + 1]++;
    }
    hs_starts_of_lengths(offsets, n);
    for (int64_t e = from->first[p]; e < from->end[p]; e++) {
        const int32_t q = from->index[e];
        put_split_entry(to, offsets[map->list[q]]++, map->node[q], from, e);
    }
    hs_starts_of_ends(offsets, n);
    offsets[0] = base;
}

/* The point of each row, and how many entries all rows have. */
static int64_t
find_points(const hs_node_map *map, const hs_rows_view *from, int32_t *point_of_row)
{
    int64_t n_entries = 0;
    for (int64_t p = 0; p < map->n; p++) {
        if (map->row[p] >= 0) {
            point_of_row[map->row[p]] = (int32_t)p;
            n_entries += from->end[p] - from->first[p];
        }
    }
    return n_entries;
}

/* Offsets, which are not set, and room for the entries, in an empty result. */
static hs_status
open_rows(hs_call *call, int64_t n_offsets, int64_t n_entries, bool has_shift, int ndim,
          hs_pairs *rows, int64_t **offsets)
{
    const unsigned shift = has_shift ? (unsigned)HS_WANT_SHIFT : 0u;
    hs_output_init(&call->account, has_shift ? ndim : 1, HS_WANT_J | shift, 4, &rows->output);
    const hs_status status =
        hs_output_open_offsets(&call->account, n_offsets, &rows->offsets, offsets);
    return status == HS_OK ? hs_output_reserve(&rows->output, n_entries, 0.0) : status;
}

hs_status
hs_row_split_fill(hs_call *call, const hs_node_map *map, const hs_rows_view *from, hs_pairs *rows)
{
    int32_t *point_of_row = hs_alloc(&call->account, HS_FOR_ORDER, map->n, sizeof *point_of_row);
    if (point_of_row == NULL) {
        return HS_ERR_MEMORY;
    }
    int64_t        *offsets;
    const int64_t   n_entries = find_points(map, from, point_of_row);
    const hs_status status = open_rows(call, map->n_rows * map->n_lists + 1, n_entries,
                                       from->shift != NULL, from->ndim, rows, &offsets);
    if (status == HS_OK) {
        rows->output.n_pairs = n_entries;
        split_target to = {.offsets = offsets,
                           .index = hs_output_column(&rows->output, HS_WANT_J),
                           .shift = hs_output_column(&rows->output, HS_WANT_SHIFT)};
        to.offsets[0] = 0;
        for (int64_t r = 0; r < map->n_rows; r++, to.offsets += map->n_lists) {
            if (map->is_plain) {
                cut(map, from, point_of_row[r], &to);
            } else {
                distribute(map, from, point_of_row[r], &to);
            }
        }
    }
    hs_free(&call->account, point_of_row);
    return status;
}

/* Pairs are counted, so that no array is longer than the table, then put. */

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

/* Room for so many pairs: numbers, and shifts of ndim components where there are any, in `nodes`,
 * and lists in `lists`, both empty, whose n_pairs stay 0. HS_OK or HS_ERR_MEMORY. */
static hs_status
node_columns_open(hs_call *call, bool has_shift, int ndim, int64_t room, hs_pairs *nodes,
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
put_node_pair(const hs_node_columns *to, int64_t at, const hs_node_map *map,
              const hs_half_columns *half, int64_t e, bool turned)
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

/* Fills columns I, J and, where the half list has shifts, S of `nodes`, and I and J of `lists`,
 * both empty: numbers of nodes in their lists, and the lists. Pairs keep their order. */
static hs_status
hs_node_pairs_fill(hs_call *call, const hs_node_map *map, bool ghost_pairs, const hs_output *half,
                   hs_pairs *nodes, hs_pairs *lists)
{
    const hs_half_columns pairs = hs_half_list_columns(half);
    const int64_t         n = hs_node_pairs_count(map, ghost_pairs, half);
    hs_node_columns       to;
    const hs_status       status = node_columns_open(call, (half->columns & HS_WANT_SHIFT) != 0,
                                                     half->ndim, n, nodes, lists, &to);
    if (status != HS_OK) {
        return status;
    }
    nodes->output.n_pairs = lists->output.n_pairs = n;
    for (int64_t e = 0, at = 0; e < pairs.n; e++) {
        bool turned;
        if (hs_node_pair_counts(map, ghost_pairs, pairs.i[e], pairs.j[e], &turned)) {
            put_node_pair(&to, at++, map, &pairs, e, turned);
        }
    }
    return HS_OK;
}

/* What is behind a node in its own list, and all of the lists that follow. */

/* Entries between two calls of poll(). */
#define POLL_ROW_ENTRIES (INT64_C(1) << 21)

typedef struct pairs_filling {
    const hs_node_map  *map;
    const hs_list_rows *rows;
    bool                ghost_pairs;
    int64_t             n, room;
    hs_node_columns     to;
} pairs_filling;

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
put_row_pair(pairs_filling *doing, int32_t node, int32_t list, int32_t other, int64_t first,
             int64_t last, bool turned)
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
put_row(pairs_filling *doing, int64_t p, int64_t *looked)
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
        if (!put_row_pair(doing, node, list, l, first, ghosts, true)) {
            return HS_ERR_ARGUMENT;
        }
        if ((!map->is_ghost[p] || doing->ghost_pairs) &&
            !put_row_pair(doing, node, list, l, ghosts, last, false)) {
            return HS_ERR_ARGUMENT;
        }
    }
    return HS_OK;
}

/* Fills columns I, J and S of `nodes`, and I and J of `lists`, as hs_node_pairs_fill does. The map
 * is plain, and all of its nodes have rows. HS_ERR_ARGUMENT where offsets are none, or there are
 * more pairs than rows can have that mirror each other. */
static hs_status
row_pairs_fill(hs_call *call, const hs_node_map *map, bool ghost_pairs, const hs_list_rows *rows,
               hs_pairs *nodes, hs_pairs *lists)
{
    pairs_filling doing = {
        .map = map, .rows = rows, .ghost_pairs = ghost_pairs, .room = rows->n_indices / 2};
    int64_t   looked = 0;
    hs_status status = node_columns_open(call, rows->shift != NULL, rows->ndim, doing.room, nodes,
                                         lists, &doing.to);
    HS_ASSERT(map->is_plain && map->n_rows == map->n);
    for (int64_t p = 0; status == HS_OK && p < map->n; p++) {
        status = put_row(&doing, p, &looked);
        if (status == HS_OK && looked >= POLL_ROW_ENTRIES) {
            looked = 0;
            status = hs_poll(&call->options, (double)p / (double)map->n);
        }
    }
    nodes->output.n_pairs = lists->output.n_pairs = status == HS_OK ? doing.n : 0;
    return status;
}

/* Pairs of rows in any order, or of which ghosts have none: entries that begin a pair are put in
 * order. */

typedef struct pair_sorting {
    const hs_node_map  *map;
    const hs_list_rows *rows;
    int32_t            *point_of_node; /* owned */
    hs_output           found;         /* pairs as entries come */
} pair_sorting;

/* Whether entry e of the row of p, which is q, begins a pair; *turned: with q. */
HS_ALWAYS_INLINE bool
begins(const pair_sorting *doing, int32_t p, int32_t q, int64_t e, bool *turned)
{
    const hs_list_rows *rows = doing->rows;
    *turned = false;
    if (doing->map->directed) {
        return true;
    }
    if (q < p) {
        *turned = doing->map->row[q] < 0;
        return *turned;
    }
    return q > p ||
           (rows->shift != NULL && hs_shift_is_forward(rows->shift + e * rows->ndim, rows->ndim));
}

/* Writes entry e of the row of p, with q, as a pair. */
HS_ALWAYS_INLINE void
put_found(pair_sorting *doing, int32_t p, int32_t q, int64_t e, bool turned)
{
    const hs_list_rows *rows = doing->rows;
    hs_output          *found = &doing->found;
    const int64_t       at = found->n_pairs++;
    int32_t            *shift = hs_output_column(found, HS_WANT_SHIFT);
    ((int32_t *)hs_output_column(found, HS_WANT_I))[at] = turned ? q : p;
    ((int32_t *)hs_output_column(found, HS_WANT_J))[at] = turned ? p : q;
    for (int k = 0; shift != NULL && k < rows->ndim; k++) {
        const uint32_t component = (uint32_t)rows->shift[e * rows->ndim + k];
        shift[at * rows->ndim + k] = (int32_t)(turned ? 0u - component : component);
    }
}

/* The pairs of entries [first, last) of the row of p, of list l. False where a node is none. */
static bool
put_entries(pair_sorting *doing, int32_t p, int32_t l, int64_t first, int64_t last)
{
    const int32_t *indices = doing->rows->indices;
    const int64_t  before = l > 0 ? doing->map->end[l - 1] : 0;
    for (int64_t e = first; e < last; e++) {
        const int32_t node = indices[e];
        bool          turned;
        if (node < 0 || node >= doing->map->end[l] - before) {
            return false;
        }
        const int32_t q = doing->point_of_node[before + node];
        if (begins(doing, p, q, e, &turned)) {
            put_found(doing, p, q, e, turned);
        }
    }
    return true;
}

static hs_status
find_pairs(hs_call *call, pair_sorting *doing)
{
    const hs_node_map  *map = doing->map;
    const hs_list_rows *rows = doing->rows;
    hs_status           status = hs_output_reserve(&doing->found, rows->n_indices, 0.0);
    int64_t             room = rows->n_indices, looked = 0;
    for (int64_t p = 0; status == HS_OK && p < map->n; p++) {
        for (int32_t l = 0; status == HS_OK && map->row[p] >= 0 && l < map->n_lists; l++) {
            const int64_t *at = rows->offsets + (int64_t)map->row[p] * map->n_lists + l;
            if (at[0] < 0 || at[0] > at[1] || at[1] > rows->n_indices || at[1] - at[0] > room ||
                !put_entries(doing, (int32_t)p, l, at[0], at[1])) {
                status = HS_ERR_ARGUMENT;
            } else {
                room -= at[1] - at[0];
                looked += at[1] - at[0];
            }
        }
        if (status == HS_OK && looked >= POLL_ROW_ENTRIES) {
            looked = 0;
            status = hs_poll(&call->options, (double)p / (double)map->n);
        }
    }
    return status;
}

/* As row_pairs_fill, of any map. */
static hs_status
sorted_pairs_fill(hs_call *call, const hs_node_map *map, bool ghost_pairs, const hs_list_rows *rows,
                  hs_pairs *nodes, hs_pairs *lists)
{
    hs_account    *account = &call->account;
    hs_output      half;
    pair_sorting   doing = {.map = map, .rows = rows};
    const int      d = rows->shift != NULL ? rows->ndim : 1;
    const unsigned columns = HS_WANT_I | HS_WANT_J |
                             (rows->shift != NULL ? (unsigned)HS_WANT_SHIFT : 0u);
    hs_status status = HS_ERR_MEMORY;
    hs_output_init(account, d, columns, 4, &doing.found);
    hs_output_init(account, d, columns, 4, &half);
    doing.point_of_node = hs_alloc(account, HS_FOR_ORDER, map->n, sizeof *doing.point_of_node);
    if (doing.point_of_node != NULL) {
        for (int64_t p = 0; p < map->n; p++) {
            const int32_t l = map->list[p];
            doing.point_of_node[(l > 0 ? map->end[l - 1] : 0) + map->node[p]] = (int32_t)p;
        }
        status = find_pairs(call, &doing);
    }
    if (status == HS_OK) {
        status = hs_sort_pairs(call, 0, map->n, &doing.found, &half);
    }
    if (status == HS_OK) {
        status = hs_node_pairs_fill(call, map, ghost_pairs, &half, nodes, lists);
    }
    hs_output_free(&doing.found);
    hs_output_free(&half);
    hs_free(account, doing.point_of_node);
    return status;
}

/* connectivity.c: three results of one call. */

hs_connectivity *
hs_connectivity_new(void)
{
    hs_connectivity *made = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *made);
    if (made == NULL) {
        return NULL;
    }
    memset(made, 0, sizeof *made);
    hs_pairs **parts[] = {&made->rows, &made->nodes, &made->lists};
    for (int k = 0; k < 3; k++) {
        hs_pairs *part = hs_pairs_new();
        if (part == NULL) {
            hs_connectivity_free(made);
            return NULL;
        }
        memset(&part->call, 0, sizeof part->call);
        *parts[k] = part;
    }
    return made;
}

/* Whether rows of points are those of nodes: of one list, all of which have rows. */
static bool
needs_no_split(const hs_node_map *map)
{
    return map->is_plain && map->n_lists == 1 && map->n_rows == map->n;
}

/* Rows of points become those of nodes. */
static hs_status
split_rows(hs_connectivity *made, const hs_node_map *map, const hs_output *offsets,
           const hs_output *rows)
{
    const int64_t     *first = hs_output_column(offsets, HS_WANT_I);
    const hs_rows_view view = {.first = first,
                               .end = first + 1,
                               .index = hs_output_column(rows, HS_WANT_J),
                               .shift = hs_output_column(rows, HS_WANT_SHIFT),
                               .ndim = rows->ndim};
    return hs_row_split_fill(&made->call, map, &view, made->rows);
}

hs_status
hs_connectivity_fill(hs_connectivity *made, const hs_node_lists *lists, int64_t n,
                     const hs_output *half, hs_failure *failure)
{
    hs_node_map map;
    hs_call    *call = &made->call;
    hs_output   offsets = {.n_pairs = 0}, rows = {.n_pairs = 0};
    hs_status   status = hs_node_map_make(&call->account, lists, n, &map);
    if (status != HS_OK) {
        return status;
    }
    status = hs_output_check_opposites(half, failure);
    if (status == HS_OK && needs_no_split(&map)) {
        status = hs_half_list_rows(call, half, n, map.directed, &made->rows->offsets,
                                   &made->rows->output);
    } else if (status == HS_OK) {
        status = hs_half_list_rows(call, half, n, map.directed, &offsets, &rows);
        status = status == HS_OK ? split_rows(made, &map, &offsets, &rows) : status;
    }
    hs_output_free(&offsets);
    hs_output_free(&rows);
    if (status == HS_OK && !lists->rows_only) {
        status = hs_node_pairs_fill(call, &map, lists->ghost_pairs, half, made->nodes, made->lists);
    }
    hs_node_map_free(&call->account, &map);
    return status;
}

/* The rows that have been filled, as a caller would give them. */
static hs_list_rows
rows_of(const hs_pairs *rows, int32_t n_lists)
{
    return (hs_list_rows){.n = n_lists > 0 ? hs_pairs_rows(rows) / n_lists : 0,
                          .n_lists = n_lists,
                          .offsets = hs_pairs_offsets(rows),
                          .n_indices = hs_pairs_length(rows),
                          .indices = hs_output_column(&rows->output, HS_WANT_J),
                          .shift = hs_output_column(&rows->output, HS_WANT_SHIFT),
                          .ndim = rows->output.ndim};
}

static hs_status
fill_pairs(hs_connectivity *made, const hs_node_map *map, bool ghost_pairs,
           const hs_list_rows *rows)
{
    const bool begin_rows = map->is_plain && map->n_rows == map->n && !map->directed;
    return (begin_rows ? row_pairs_fill : sorted_pairs_fill)(&made->call, map, ghost_pairs, rows,
                                                             made->nodes, made->lists);
}

hs_status
hs_connectivity_fill_rows(hs_connectivity *made, const hs_node_lists *lists, hs_pairs **found)
{
    hs_node_map map;
    hs_account *account = &made->call.account;
    hs_status   status = hs_node_map_make(account, lists, hs_pairs_rows(*found), &map);
    if (status != HS_OK) {
        return status;
    }
    if (needs_no_split(&map)) {
        hs_pairs_free(made->rows);
        made->rows = *found;
        *found = NULL;
    } else {
        status = split_rows(made, &map, &(*found)->offsets, &(*found)->output);
    }
    if (status == HS_OK && !lists->rows_only) {
        const hs_list_rows rows = rows_of(made->rows, map.n_lists);
        status = fill_pairs(made, &map, lists->ghost_pairs, &rows);
    }
    hs_node_map_free(account, &map);
    return status;
}

hs_status
hs_connectivity_fill_pairs(hs_connectivity *made, const hs_node_lists *lists, int64_t n,
                           const hs_list_rows *rows)
{
    hs_node_map map;
    hs_account *account = &made->call.account;
    hs_status   status = hs_node_map_make(account, lists, n, &map);
    if (status == HS_OK) {
        status = rows->n == map.n_rows && rows->n_lists == map.n_lists
                     ? fill_pairs(made, &map, lists->ghost_pairs, rows)
                     : HS_ERR_ARGUMENT;
        hs_node_map_free(account, &map);
    }
    return status;
}

hs_pairs *
hs_connectivity_rows(hs_connectivity *connectivity)
{
    return connectivity != NULL ? connectivity->rows : NULL;
}

hs_pairs *
hs_connectivity_pairs(hs_connectivity *connectivity)
{
    return connectivity != NULL ? connectivity->nodes : NULL;
}

hs_pairs *
hs_connectivity_lists(hs_connectivity *connectivity)
{
    return connectivity != NULL ? connectivity->lists : NULL;
}

void
hs_connectivity_free(hs_connectivity *connectivity)
{
    if (connectivity == NULL) {
        return;
    }
    hs_pairs_free(connectivity->rows);
    hs_pairs_free(connectivity->nodes);
    hs_pairs_free(connectivity->lists);
    hs_account_close(&connectivity->call.account);
    hs_free(NULL, connectivity);
}

/* Each entry is read once and written where the new row goes on. */

/* Entries between two calls of poll(). */
#define POLL_KEPT_ENTRIES (INT64_C(1) << 21)

/* Where entries go. */
typedef struct new_rows {
    int64_t  n, room;
    int64_t *offsets; /* of the entry that comes next */
    int32_t *index, *shift;
    int64_t  polled;
} new_rows;

/* Whether there is a range [first, end) of entries. */
static bool
is_range(const hs_list_rows *rows, int64_t first, int64_t end)
{
    return first >= 0 && first <= end && end <= rows->n_indices;
}

static bool
are_rows(const hs_list_rows *rows)
{
    return rows->n >= 0 && rows->n_lists >= 0 && rows->offsets != NULL && rows->n_indices >= 0 &&
           (rows->indices != NULL || rows->n_indices == 0) &&
           (rows->shift == NULL || (rows->ndim >= 1 && rows->ndim <= HS_MAX_DIM));
}

/* Room for n rows with as many entries as there are. */
static hs_status
begin(hs_call *call, const hs_list_rows *rows, int64_t n, hs_pairs *result, new_rows *to)
{
    int64_t        *offsets;
    const hs_status status = open_rows(call, n * rows->n_lists + 1, rows->n_indices,
                                       rows->shift != NULL, rows->ndim, result, &offsets);
    if (status != HS_OK) {
        return status;
    }
    *to = (new_rows){.room = rows->n_indices,
                     .offsets = offsets,
                     .index = hs_output_column(&result->output, HS_WANT_J),
                     .shift = hs_output_column(&result->output, HS_WANT_SHIFT)};
    *to->offsets = 0;
    return HS_OK;
}

HS_ALWAYS_INLINE void
copy_shift(const hs_list_rows *rows, int64_t e, const new_rows *to)
{
    const int d = rows->ndim;
    for (int k = 0; to->shift != NULL && k < d; k++) {
        to->shift[to->n * d + k] = rows->shift[e * d + k];
    }
}

/* Ends an entry of the new rows, for which `looked` entries were looked at. */
static hs_status
step(const hs_call *call, int64_t looked, new_rows *to)
{
    *++to->offsets = to->n;
    to->polled += looked;
    if (to->polled < POLL_KEPT_ENTRIES) {
        return HS_OK;
    }
    to->polled = 0;
    return hs_poll(&call->options, (double)to->n / (double)to->room);
}

/* ---- nodes that stay ------------------------------------------------------------------------ */

/* Where the nodes of a list are, among all. */
typedef struct nodes_of_list {
    int64_t        n;
    const int32_t *target;
    const int32_t *place; /* NULL: order stays */
} nodes_of_list;

typedef struct keeping {
    const hs_list_rows *rows;
    nodes_of_list      *lists;   /* owned */
    uint64_t           *entries; /* owned; place and number, of one entry of a row */
    uint64_t           *spare;   /* part of entries */
} keeping;

/* The longest entry; -1 where these are no rows. */
static int64_t
longest_entry(const hs_list_rows *rows)
{
    const int64_t n = rows->n * rows->n_lists;
    int64_t       longest = 0;
    for (int64_t k = 0; k < n; k++) {
        if (!is_range(rows, rows->offsets[k], rows->offsets[k + 1])) {
            return -1;
        }
        const int64_t length = rows->offsets[k + 1] - rows->offsets[k];
        longest = length > longest ? length : longest;
    }
    return longest;
}

static hs_status
open_keeping(hs_account *account, const hs_node_change *change, keeping *doing)
{
    const int32_t *target = change->target, *place = change->place;
    const int64_t  longest = place != NULL ? longest_entry(doing->rows) : 0;
    if (longest < 0 || longest > UINT32_MAX) {
        return longest < 0 ? HS_ERR_ARGUMENT : HS_ERR_TOO_MANY;
    }
    doing->lists = hs_alloc(account, HS_FOR_CELLS, change->n_lists, sizeof *doing->lists);
    doing->entries = hs_alloc(account, HS_FOR_SORTING, longest, 2 * sizeof *doing->entries);
    if (doing->lists == NULL || doing->entries == NULL) {
        return HS_ERR_MEMORY;
    }
    doing->spare = doing->entries + longest;
    for (int32_t l = 0; l < change->n_lists; l++) {
        const int64_t n = change->n_nodes[l];
        if (n < 0) {
            return HS_ERR_ARGUMENT;
        }
        doing->lists[l] = (nodes_of_list){.n = n, .target = target, .place = place};
        target += n;
        place = place != NULL ? place + n : NULL;
    }
    return HS_OK;
}

/* Copies entries [first, last) of rows, whose nodes are of this list. */
HS_ALWAYS_INLINE bool
keep_entry(const hs_list_rows *rows, const nodes_of_list *list, int64_t first, int64_t last,
           new_rows *to)
{
    for (int64_t e = first; e < last; e++) {
        const int32_t node = rows->indices[e];
        if (node < 0 || node >= list->n) {
            return false;
        }
        const int32_t number = list->target[node];
        to->index[to->n] = number; /* there is room for one more than stay */
        copy_shift(rows, e, to);
        to->n += number >= 0;
    }
    return true;
}

/* The same where nodes come in another order. Images of one node stay in theirs. */
static bool
keep_sorted(const keeping *doing, const nodes_of_list *list, int64_t first, int64_t last,
            new_rows *to)
{
    const hs_list_rows *rows = doing->rows;
    int64_t             n = 0;
    for (int64_t e = first; e < last; e++) {
        const int32_t node = rows->indices[e];
        if (node < 0 || node >= list->n) {
            return false;
        }
        if (list->target[node] >= 0) {
            doing->entries[n++] = (uint64_t)(uint32_t)list->place[node] << 32 |
                                  (uint64_t)(e - first);
        }
    }
    hs_sort_numbers(doing->entries, n, doing->spare);
    for (int64_t k = 0; k < n; k++) {
        const int64_t e = first + (int64_t)(doing->entries[k] & UINT32_MAX);
        to->index[to->n] = list->target[rows->indices[e]];
        copy_shift(rows, e, to);
        to->n++;
    }
    return true;
}

static hs_status
keep_row(const hs_call *call, const keeping *doing, int64_t row, new_rows *to)
{
    const hs_list_rows *rows = doing->rows;
    for (int32_t l = 0; l < rows->n_lists; l++) {
        const nodes_of_list *list = &doing->lists[l];
        const int64_t        first = rows->offsets[row * rows->n_lists + l];
        const int64_t        last = rows->offsets[row * rows->n_lists + l + 1];
        if (!is_range(rows, first, last) || last - first > to->room - to->n) {
            return HS_ERR_ARGUMENT;
        }
        if (!(list->place == NULL ? keep_entry(rows, list, first, last, to)
                                  : keep_sorted(doing, list, first, last, to))) {
            return HS_ERR_ARGUMENT;
        }
        const hs_status status = step(call, last - first, to);
        if (status != HS_OK) {
            return status;
        }
    }
    return HS_OK;
}

hs_status
hs_kept_rows_fill(hs_call *call, const hs_list_rows *rows, const hs_node_change *change,
                  const int64_t *source, int64_t n, hs_pairs *result)
{
    keeping   doing = {.rows = rows};
    new_rows  to = {.n = 0};
    hs_status status = HS_ERR_ARGUMENT;
    if (are_rows(rows) && n >= 0 && n <= rows->n && change->n_lists == rows->n_lists &&
        (change->n_lists == 0 || (change->n_nodes != NULL && change->target != NULL))) {
        status = open_keeping(&call->account, change, &doing);
    }
    if (status == HS_OK) {
        status = begin(call, rows, n, result, &to);
    }
    for (int64_t k = 0; status == HS_OK && k < n; k++) {
        const int64_t row = source != NULL ? source[k] : k;
        status = row >= 0 && row < rows->n ? keep_row(call, &doing, row, &to) : HS_ERR_ARGUMENT;
    }
    result->output.n_pairs = status == HS_OK ? to.n : 0;
    hs_free(&call->account, doing.lists);
    hs_free(&call->account, doing.entries);
    return status;
}

/* ---- entries that go ------------------------------------------------------------------------- */

typedef struct dropping {
    const hs_list_rows *rows, *without;
    bool                ascend;
} dropping;

/* How entry e of the rows, with its shift, compares with entry w of those that go: 0 where they are
 * the same. */
HS_ALWAYS_INLINE int
compare(const dropping *doing, int64_t e, int64_t w)
{
    const hs_list_rows *rows = doing->rows, *without = doing->without;
    const int           d = rows->ndim;
    if (rows->indices[e] != without->indices[w]) {
        return rows->indices[e] < without->indices[w] ? -1 : 1;
    }
    for (int k = 0; k < d; k++) {
        if (rows->shift[e * d + k] != without->shift[w * d + k]) {
            return rows->shift[e * d + k] < without->shift[w * d + k] ? -1 : 1;
        }
    }
    return 0;
}

/* Entries [first, last) without [w, w_last). Returns which of these comes next. */
static int64_t
drop_images(const dropping *doing, int64_t first, int64_t last, int64_t w, int64_t w_last,
            new_rows *to)
{
    for (int64_t e = first; e < last; e++) {
        int order = w < w_last ? compare(doing, e, w) : -1;
        while (doing->ascend && order > 0) {
            order = ++w < w_last ? compare(doing, e, w) : -1;
        }
        to->index[to->n] = doing->rows->indices[e];
        copy_shift(doing->rows, e, to);
        to->n += order != 0;
        w += order == 0;
    }
    return w;
}

/* The same without shifts, and without a branch that depends on what goes. */
static int64_t
drop_nodes(const dropping *doing, int64_t first, int64_t last, int64_t w, int64_t w_last,
           new_rows *to)
{
    const int32_t *index = doing->rows->indices, *gone = doing->without->indices;
    int32_t       *next = to->index + to->n;
    for (int64_t e = first; e < last; e++) {
        while (doing->ascend && w < w_last && gone[w] < index[e]) {
            w++;
        }
        const bool goes = w < w_last && gone[w] == index[e];
        *next = index[e];
        next += !goes;
        w += goes;
    }
    to->n = next - to->index;
    return w;
}

/* Entry k, the same of both. */
static hs_status
drop_from(const dropping *doing, int64_t k, new_rows *to)
{
    const hs_list_rows *rows = doing->rows, *without = doing->without;
    const int64_t       first = rows->offsets[k], last = rows->offsets[k + 1];
    const int64_t       w = without->offsets[k], w_last = without->offsets[k + 1];
    if (!is_range(rows, first, last) || !is_range(without, w, w_last)) {
        return HS_ERR_ARGUMENT;
    }
    const int64_t end = rows->shift != NULL ? drop_images(doing, first, last, w, w_last, to)
                                            : drop_nodes(doing, first, last, w, w_last, to);
    return doing->ascend || end == w_last ? HS_OK : HS_ERR_ARGUMENT;
}

hs_status
hs_rows_without_fill(hs_call *call, const hs_list_rows *rows, const hs_list_rows *without,
                     bool ascend, hs_pairs *result)
{
    const dropping doing = {rows, without, ascend};
    new_rows       to = {.n = 0};
    hs_status      status = HS_ERR_ARGUMENT;
    if (are_rows(rows) && are_rows(without) && rows->n == without->n &&
        rows->n_lists == without->n_lists && (rows->shift == NULL) == (without->shift == NULL) &&
        (rows->shift == NULL || rows->ndim == without->ndim)) {
        status = begin(call, rows, rows->n, result, &to);
    }
    for (int64_t k = 0; status == HS_OK && k < rows->n * rows->n_lists; k++) {
        status = drop_from(&doing, k, &to);
        if (status == HS_OK) {
            status = step(call, rows->offsets[k + 1] - rows->offsets[k], &to);
        }
    }
    result->output.n_pairs = status == HS_OK ? to.n : 0;
    return status;
}
