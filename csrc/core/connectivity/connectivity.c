/* SPDX-License-Identifier: BSD-3-Clause */
#include "connectivity.h"
#include "../api/query.h"
#include "../collect/sort_pairs.h"
#include "../base/sort.h"
#include "../base/os.h"

#include <string.h>

/* connectivity.c: which node each point is, half lists, rows of nodes and the pairs in them, of a
 * search or of a half list, and what is left of rows when nodes go. */

/* Entries between two calls of poll(). */
#define POLL_ENTRIES (INT64_C(1) << 21)

/* Copies a shift, or its opposite. A loop of three is no loop. */
HS_ALWAYS_INLINE void
copy_shift(int32_t *to, const int32_t *from, int d, bool turned)
{
    for (int k = 0; k < (d == 3 ? 3 : d); k++) {
        to[k] = turned ? (int32_t)(0u - (uint32_t)from[k]) : from[k];
    }
}

/* ---- which node a point is ------------------------------------------------------------------ */

/* Fills the map, list after list. False where some node is not one point, or ghosts are none. */
static bool
fill_map(hs_node_map *map)
{
    const hs_node_lists *lists = map->lists;
    const int32_t       *number = lists->number;
    int64_t              end = 0;
    for (int32_t k = 0; k < map->n; k++) {
        map->point[k] = number != NULL ? -1 : k;
    }
    for (int32_t p = 0; number != NULL && p < map->n; p++) {
        const int32_t node = number[p];
        if (node < 0 || node >= map->n || map->point[node] >= 0) {
            return false;
        }
        map->point[node] = p;
    }
    for (int32_t l = 0; l < map->n_lists; l++) {
        const int64_t first = end, count = map->end[l];
        const int64_t ghosts = lists->n_ghosts != NULL ? lists->n_ghosts[l] : 0;
        if (ghosts < 0 || ghosts > count) {
            return false;
        }
        map->end[l] = end = first + count;
        for (int64_t k = first; k < end; k++) {
            const int32_t p = map->point[k];
            map->list[p] = l;
            map->node[p] = (int32_t)(k - first);
            map->is_ghost[p] = k >= end - ghosts;
            map->row[p] = map->is_ghost[p] && !lists->ghost_rows ? -1 : (int32_t)map->n_rows++;
        }
    }
    return true;
}

hs_status
hs_node_map_make(hs_account *account, const hs_node_lists *lists, int64_t n, hs_node_map *map)
{
    *map = (hs_node_map){.lists = lists};
    if (lists == NULL || lists->n_lists < 0 || (lists->n_lists > 0 && lists->n_nodes == NULL)) {
        return HS_ERR_ARGUMENT;
    }
    map->n_lists = lists->n_lists;
    map->is_plain = lists->number == NULL;
    map->end = hs_alloc(account, HS_FOR_ORDER, map->n_lists, sizeof *map->end);
    hs_status status = map->end != NULL ? HS_OK : HS_ERR_MEMORY;
    for (int32_t l = 0; l < map->n_lists && status == HS_OK; l++) {
        const int64_t count = map->end[l] = lists->n_nodes[l];
        status = count < 0 ? HS_ERR_ARGUMENT : count > INT32_MAX - map->n ? HS_ERR_TOO_MANY : HS_OK;
        map->n += status == HS_OK ? count : 0;
    }
    if (status == HS_OK && n >= 0 && n != map->n) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        n = map->n;
        map->list = hs_alloc(account, HS_FOR_ORDER, n, 4 * sizeof *map->list + sizeof(bool));
        status = map->list != NULL ? HS_OK : HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        map->node = map->list + n;
        map->row = map->node + n;
        map->point = map->row + n;
        map->is_ghost = (bool *)(map->point + n);
        status = fill_map(map) ? HS_OK : HS_ERR_ARGUMENT;
    }
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

/* ---- half lists ------------------------------------------------------------------------------ */

hs_half_list
hs_half_list_columns(const hs_output *half)
{
    return (hs_half_list){.n = half->n_pairs,
                          .i = hs_output_column(half, HS_WANT_I),
                          .j = hs_output_column(half, HS_WANT_J),
                          .shift = hs_output_column(half, HS_WANT_SHIFT),
                          .ndim = half->ndim};
}

void
hs_links_init(hs_account *account, unsigned columns, bool has_shift, int ndim, hs_output *links)
{
    columns |= has_shift ? (unsigned)HS_WANT_SHIFT : 0u;
    hs_output_init(account, has_shift ? ndim : 1, columns, 4, links);
}

/* Whether pair e is one of n points and comes behind the one before. */
static bool
is_right(const hs_half_list *half, int64_t e, int64_t n, bool directed)
{
    const int32_t  i = half->i[e], j = half->j[e];
    const int32_t *shift = half->shift != NULL ? half->shift + e * half->ndim : NULL;
    if (i < 0 || j < 0 || i >= n || j >= n || (j < i && !directed)) {
        return false;
    }
    if (i == j) {
        const int side = shift != NULL ? hs_compare_shifts(shift, NULL, half->ndim) : 0;
        if (side == 0 || (side < 0 && !directed)) {
            return false;
        }
    }
    if (e == 0 || half->i[e - 1] < i || (half->i[e - 1] == i && half->j[e - 1] < j)) {
        return true;
    }
    return half->i[e - 1] == i && half->j[e - 1] == j && shift != NULL &&
           hs_compare_shifts(shift, shift - half->ndim, half->ndim) > 0;
}

hs_status
hs_half_list_copy(hs_account *account, const hs_half_list *pairs, int64_t n, bool directed,
                  hs_output *copy, hs_failure *failure)
{
    hs_links_init(account, HS_WANT_I | HS_WANT_J, pairs->shift != NULL, pairs->ndim, copy);
    if (pairs->n < 0 || copy->ndim < 1 || copy->ndim > HS_MAX_DIM ||
        (pairs->n > 0 && (pairs->i == NULL || pairs->j == NULL))) {
        return HS_ERR_ARGUMENT;
    }
    if (hs_output_reserve(copy, pairs->n, 0.0) != HS_OK) {
        return HS_ERR_MEMORY;
    }
    copy->n_pairs = pairs->n;
    if (pairs->n > 0) {
        const size_t bytes = (size_t)pairs->n * sizeof(int32_t);
        memcpy(hs_output_column(copy, HS_WANT_I), pairs->i, bytes);
        memcpy(hs_output_column(copy, HS_WANT_J), pairs->j, bytes);
        if (pairs->shift != NULL) {
            memcpy(hs_output_column(copy, HS_WANT_SHIFT), pairs->shift, (size_t)copy->ndim * bytes);
        }
    }
    const hs_half_list half = hs_half_list_columns(copy);
    for (int64_t e = 0; e < half.n; e++) {
        if (!is_right(&half, e, n, directed)) {
            failure->row = e;
            return HS_ERR_ARGUMENT;
        }
    }
    return HS_OK;
}

hs_status
hs_half_list_rows(hs_call *call, const hs_output *half, int64_t n, bool directed,
                  hs_output *offsets, hs_output *rows)
{
    int64_t        *first;
    const hs_status status = hs_output_open_offsets(&call->account, n + 1, offsets, &first);
    hs_output_init(&call->account, half->ndim, half->columns & ~(unsigned)HS_WANT_I, 4, rows);
    return status == HS_OK ? hs_sort_pairs(call, 0, n, half, !directed, first, rows) : status;
}

/* ---- rows of nodes --------------------------------------------------------------------------- */

hs_list_rows
hs_rows_of(const hs_output *offsets, const hs_output *rows)
{
    return (hs_list_rows){.n = offsets->n_pairs - 1,
                          .n_lists = 1,
                          .offsets = hs_output_column(offsets, HS_WANT_I),
                          .n_indices = rows->n_pairs,
                          .indices = hs_output_column(rows, HS_WANT_J),
                          .shift = hs_output_column(rows, HS_WANT_SHIFT),
                          .ndim = rows->ndim};
}

/* Rows that are being written, entry after entry. */
typedef struct new_rows {
    int64_t  n, room;
    int64_t *offsets; /* of the entry that comes next; its own is set */
    int32_t *index, *shift;
    int      ndim;
    int64_t  looked; /* at entries, since the last poll */
} new_rows;

/* Room for n rows of n_lists lists, and for so many entries with shifts as `like` has them, in an
 * empty result. */
static hs_status
open_rows(hs_call *call, int64_t n, int32_t n_lists, int64_t room, const hs_list_rows *like,
          hs_pairs *rows, new_rows *to)
{
    hs_links_init(&call->account, HS_WANT_J, like->shift != NULL, like->ndim, &rows->output);
    *to = (new_rows){.room = room, .ndim = rows->output.ndim};
    hs_status status =
        hs_output_open_offsets(&call->account, n * n_lists + 1, &rows->offsets, &to->offsets);
    if (status == HS_OK) {
        status = hs_output_reserve(&rows->output, room, 0.0);
    }
    if (status == HS_OK) {
        to->index = hs_output_column(&rows->output, HS_WANT_J);
        to->shift = hs_output_column(&rows->output, HS_WANT_SHIFT);
        *to->offsets = 0;
    }
    return status;
}

/* Writes a number with the shift of entry e of `from`. */
HS_ALWAYS_INLINE void
put_entry(const new_rows *to, int64_t at, int32_t number, const hs_list_rows *from, int64_t e)
{
    to->index[at] = number;
    if (to->shift != NULL) {
        copy_shift(to->shift + at * to->ndim, from->shift + e * to->ndim, to->ndim, false);
    }
}

/* The entries [first, last) of a row of points, which are in the order of lists and nodes: it is
 * cut where lists end. To deal these as well takes 1.3 times as long, with the search. */
static void
cut_row(const hs_node_map *map, const hs_list_rows *from, int64_t first, int64_t last, new_rows *to)
{
    for (int32_t l = 0; l < map->n_lists; l++) {
        const int32_t before = l > 0 ? (int32_t)map->end[l - 1] : 0;
        for (; first < last && from->indices[first] < map->end[l]; first++) {
            put_entry(to, to->n++, from->indices[first] - before, from, first);
        }
        *++to->offsets = to->n;
    }
}

/* The same of points in any order: each goes to where its list goes on. */
static void
deal_row(const hs_node_map *map, const hs_list_rows *from, int64_t first, int64_t last,
         new_rows *to)
{
    int64_t *offsets = to->offsets;
    memset(offsets + 1, 0, (size_t)map->n_lists * sizeof *offsets);
    for (int64_t e = first; e < last; e++) {
        offsets[map->list[from->indices[e]] + 1]++;
    }
    hs_starts_of_lengths(offsets, (int64_t)map->n_lists + 1);
    for (int64_t e = first; e < last; e++) {
        const int32_t q = from->indices[e];
        put_entry(to, offsets[map->list[q]]++, map->node[q], from, e);
    }
    hs_starts_of_ends(offsets, (int64_t)map->n_lists + 1);
    offsets[0] = to->n;
    to->n += last - first;
    to->offsets += map->n_lists;
}

hs_status
hs_row_split_fill(hs_call *call, const hs_node_map *map, const hs_list_rows *from,
                  const int32_t *place, hs_pairs *rows)
{
    new_rows to;
    int64_t  n_entries = 0;
    for (int64_t p = 0; p < map->n; p++) {
        const int64_t row = place != NULL ? place[p] : p;
        n_entries += map->row[p] >= 0 ? from->offsets[row + 1] - from->offsets[row] : 0;
    }
    if (open_rows(call, map->n_rows, map->n_lists, n_entries, from, rows, &to) != HS_OK) {
        return HS_ERR_MEMORY;
    }
    for (int64_t node = 0; node < map->n; node++) {
        const int32_t p = map->point[node], row = place != NULL ? place[p] : p;
        if (map->row[p] >= 0) {
            (map->is_plain ? cut_row : deal_row)(map, from, from->offsets[row],
                                                 from->offsets[row + 1], &to);
        }
    }
    rows->output.n_pairs = n_entries;
    return HS_OK;
}

/* ---- pairs of rows --------------------------------------------------------------------------- */

/* Fills an empty output with the pairs of rows of points, or of nodes, in the order of points: each
 * once, in whichever of its two rows begins it, or, of directed lists, all. It ascends where the
 * rows do, unless pairs are turned. HS_ERR_ARGUMENT where offsets or numbers are none, or there are
 * more pairs than rows can have that mirror each other. */
static hs_status
find_pairs(hs_call *call, const hs_node_map *map, const hs_list_rows *rows, bool of_points,
           hs_output *half)
{
    const bool    directed = map->lists->directed;
    const bool    all_mirror = !directed && (of_points || map->n_rows == map->n);
    const int64_t room = all_mirror ? rows->n_indices / 2 : rows->n_indices;
    const int     d = rows->ndim;
    int64_t       looked = 0, at = 0;
    hs_links_init(&call->account, HS_WANT_I | HS_WANT_J, rows->shift != NULL, d, half);
    hs_status      status = hs_output_reserve(half, room, 0.0);
    int32_t *const i = hs_output_column(half, HS_WANT_I);
    int32_t *const j = hs_output_column(half, HS_WANT_J);
    int32_t *const shift = hs_output_column(half, HS_WANT_SHIFT);
    for (int32_t p = 0; status == HS_OK && p < map->n; p++) {
        const int64_t row = of_points ? p : map->row[p];
        for (int32_t l = 0; status == HS_OK && row >= 0 && l < rows->n_lists; l++) {
            const int64_t *ends = rows->offsets + row * rows->n_lists + l;
            const int64_t  base = l > 0 ? map->end[l - 1] : 0;
            const int64_t  n = of_points ? map->n : map->end[l] - base;
            bool           fits = ends[0] >= 0 && ends[0] <= ends[1] && ends[1] <= rows->n_indices;
            for (int64_t e = ends[0]; fits && e < ends[1]; e++) {
                const int32_t node = rows->indices[e];
                if (node < 0 || node >= n) {
                    fits = false;
                    break;
                }
                const int32_t q = of_points       ? node
                                  : map->is_plain ? (int32_t)base + node
                                                  : map->point[base + node];
                const bool    turned = q < p && !directed;
                if (turned ? all_mirror || map->row[q] >= 0
                           : q == p && !directed &&
                                 (shift == NULL ||
                                  hs_compare_shifts(rows->shift + e * d, NULL, d) <= 0)) {
                    continue; /* the other entry of the pair begins it */
                }
                fits = at < room;
                if (fits) {
                    i[at] = turned ? q : p;
                    j[at] = turned ? p : q;
                    if (shift != NULL) {
                        copy_shift(shift + at * d, rows->shift + e * d, d, turned);
                    }
                    at++;
                }
            }
            status = fits ? HS_OK : HS_ERR_ARGUMENT;
            looked += fits ? ends[1] - ends[0] : 0;
        }
        if (status == HS_OK && looked >= POLL_ENTRIES) {
            looked = 0;
            status = hs_poll(&call->options, (double)p / (double)map->n);
        }
    }
    half->n_pairs = at;
    return status;
}

/* Fills columns I, J and, where the half list has shifts, S of the nodes, with it and in its place,
 * and I and J of the lists. Pairs keep their order, but for those that do not count. */
static hs_status
fill_table(const hs_node_map *map, hs_output *half, hs_connectivity *made)
{
    hs_output *const lists = &made->lists.output;
    hs_links_init(&made->rows.call.account, HS_WANT_I | HS_WANT_J, false, 1, lists);
    if (hs_output_reserve(lists, half->n_pairs, 0.0) != HS_OK) {
        return HS_ERR_MEMORY;
    }
    int32_t *const i = hs_output_column(half, HS_WANT_I);
    int32_t *const j = hs_output_column(half, HS_WANT_J);
    int32_t *const shift = hs_output_column(half, HS_WANT_SHIFT);
    int32_t *const i_list = hs_output_column(lists, HS_WANT_I);
    int32_t *const j_list = hs_output_column(lists, HS_WANT_J);
    const int      d = half->ndim;
    int64_t        at = 0;
    for (int64_t e = 0; e < half->n_pairs; e++) {
        bool turned;
        if (hs_node_pair_counts(map, i[e], j[e], &turned)) {
            const int32_t first = turned ? j[e] : i[e], second = turned ? i[e] : j[e];
            i[at] = map->node[first];
            j[at] = map->node[second];
            i_list[at] = map->list[first];
            j_list[at] = map->list[second];
            if (shift != NULL) {
                copy_shift(shift + at * d, shift + e * d, d, turned);
            }
            at++;
        }
    }
    made->nodes.output = *half;
    *half = (hs_output){.n_pairs = 0};
    made->nodes.output.n_pairs = lists->n_pairs = at;
    return HS_OK;
}

/* ---- three results of one call --------------------------------------------------------------- */

hs_status
hs_connectivity_fill(hs_connectivity *made, const hs_node_map *map, hs_output *half,
                     hs_output *offsets, hs_output *rows)
{
    hs_call           *call = &made->rows.call;
    const hs_list_rows found = hs_rows_of(offsets, rows);
    hs_status          status = HS_OK;
    if (!map->lists->rows_only && half->columns == 0) {
        status = find_pairs(call, map, &found, true, half);
    }
    if (!map->lists->rows_only && status == HS_OK) {
        status = fill_table(map, half, made);
    }
    if (status == HS_OK && map->is_plain && map->n_lists == 1 && map->n_rows == map->n) {
        made->rows.offsets = *offsets; /* rows of points are those of nodes */
        made->rows.output = *rows;
        *offsets = *rows = (hs_output){.n_pairs = 0};
    } else if (status == HS_OK) {
        status = hs_row_split_fill(call, map, &found, NULL, &made->rows);
    }
    return status;
}

hs_pairs *
hs_connectivity_rows(hs_connectivity *connectivity)
{
    return connectivity != NULL ? &connectivity->rows : NULL;
}

hs_pairs *
hs_connectivity_pairs(hs_connectivity *connectivity)
{
    return connectivity != NULL ? &connectivity->nodes : NULL;
}

hs_pairs *
hs_connectivity_lists(hs_connectivity *connectivity)
{
    return connectivity != NULL ? &connectivity->lists : NULL;
}

void
hs_connectivity_free(hs_connectivity *connectivity)
{
    if (connectivity == NULL) {
        return;
    }
    hs_output_free(&connectivity->rows.offsets);
    hs_output_free(&connectivity->rows.output);
    hs_output_free(&connectivity->nodes.output);
    hs_output_free(&connectivity->lists.output);
    hs_account_close(&connectivity->rows.call.account);
    hs_free(NULL, connectivity);
}

/* Begins a call that makes a connectivity, if `has_input`: *failure becomes where the failure goes.
 * connectivity_end must follow. NULL, with *status, where the call has ended. */
static hs_connectivity *
connectivity_begin(bool has_input, const hs_options *options, hs_connectivity **result,
                   hs_failure **failure, hs_status *status)
{
    const bool       can_begin = has_input && result != NULL && options != NULL;
    hs_connectivity *made = can_begin ? hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *made) : NULL;
    if (result != NULL) {
        *result = NULL;
    }
    if (made == NULL) {
        *status = hs_end_early(can_begin ? HS_ERR_MEMORY : HS_ERR_ARGUMENT, options, *failure);
        return NULL;
    }
    memset(made, 0, sizeof *made);
    *failure = hs_call_enter(options, *failure, &made->rows.call);
    *status = hs_check_resources(options);
    return made;
}

/* Leaves the call. *result becomes the object, or that is freed. Returns the status. */
static hs_status
connectivity_end(hs_connectivity *made, hs_status status, hs_connectivity **result,
                 hs_failure *failure)
{
    hs_call *const call = &made->rows.call;
    hs_call_tell_limit(call, status, failure);
    hs_call_leave(call, hs_pairs_length(&made->nodes));
    hs_call_detach(call);
    if (status == HS_OK) {
        *result = made;
    } else {
        hs_connectivity_free(made);
    }
    return status;
}

hs_status
hs_connectivity_link(const hs_half_list *pairs, const hs_node_lists *lists,
                     const hs_options *options, hs_connectivity **result, hs_failure *failure)
{
    hs_status        status;
    hs_node_map      map = {.n = 0};
    hs_output        half = {.n_pairs = 0}, offsets = half, rows = half;
    hs_connectivity *made = connectivity_begin(pairs != NULL, options, result, &failure, &status);
    if (made == NULL) {
        return status;
    }
    hs_account *const account = &made->rows.call.account;
    if (status == HS_OK) {
        status = hs_node_map_make(account, lists, -1, &map);
    }
    if (status == HS_OK) {
        status = hs_half_list_copy(account, pairs, map.n, lists->directed, &half, failure);
    }
    if (status == HS_OK) {
        status = hs_output_check_opposites(&half, failure);
    }
    if (status == HS_OK) {
        status =
            hs_half_list_rows(&made->rows.call, &half, map.n, lists->directed, &offsets, &rows);
    }
    if (status == HS_OK) {
        status = hs_connectivity_fill(made, &map, &half, &offsets, &rows);
    }
    hs_output_free(&half);
    hs_output_free(&offsets);
    hs_output_free(&rows);
    hs_node_map_free(account, &map);
    return connectivity_end(made, status, result, failure);
}

hs_status
hs_connectivity_build(const hs_among *among, const hs_node_lists *lists, const hs_options *options,
                      hs_connectivity **result, hs_failure *failure)
{
    hs_pairs   *found = NULL;
    hs_node_map map = {.n = 0};
    if (result != NULL) {
        *result = NULL;
    }
    if (result == NULL || options == NULL || among == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_options    search = *options; /* for all neighbours */
    const hs_box *box = among->cells != NULL ? hs_cells_box(among->cells) : among->box;
    search.want = HS_WANT_J;
    search.index_bytes = 4;
    search.out = NULL;
    for (int l = 0; box != NULL && l < box->ndim && l < HS_MAX_DIM; l++) {
        search.want |= box->periodic[l] ? (unsigned)HS_WANT_SHIFT : 0u;
    }
    /* Only to look at the points; a half list, so that queries are refused. */
    const hs_query query = hs_query_among(among, HS_HALF_LIST, &search);
    hs_status      status = query.among != NULL || query.sets.points == NULL
                                ? HS_ERR_ARGUMENT
                                : hs_node_map_make(NULL, lists, query.sets.points->n, &map);
    if (status != HS_OK) {
        return hs_end_early(status, options, failure);
    }
    status = hs_neighbors_find(among, &search, &found, failure);
    if (status == HS_OK) {
        hs_options linking = *options; /* its counters are those of the search */
        linking.counters = NULL;
        hs_connectivity *made = connectivity_begin(true, &linking, result, &failure, &status);
        hs_output        half = {.n_pairs = 0};
        if (status == HS_OK) { /* the search has ended: its account is closed */
            found->offsets.account = found->output.account = NULL;
            status = hs_connectivity_fill(made, &map, &half, &found->offsets, &found->output);
        }
        hs_output_free(&half);
        status = made != NULL ? connectivity_end(made, status, result, failure) : status;
    }
    hs_pairs_free(found);
    hs_node_map_free(NULL, &map);
    return status;
}

hs_status
hs_connectivity_pair(const hs_list_rows *rows, const hs_node_lists *lists,
                     const hs_options *options, hs_connectivity **result, hs_failure *failure)
{
    hs_status        status;
    hs_node_map      map = {.n = 0};
    hs_output        found = {.n_pairs = 0}, half = found;
    hs_connectivity *made = connectivity_begin(rows != NULL, options, result, &failure, &status);
    if (made == NULL) {
        return status;
    }
    hs_call *call = &made->rows.call;
    if (status == HS_OK) {
        status = hs_node_map_make(&call->account, lists, -1, &map);
    }
    if (status == HS_OK) {
        status = rows->n == map.n_rows && rows->n_lists == map.n_lists
                     ? find_pairs(call, &map, rows, false, &found)
                     : HS_ERR_ARGUMENT;
    }
    const bool ascends = status == HS_OK && map.is_plain &&
                         (lists->directed || map.n_rows == map.n);
    if (status == HS_OK && !ascends) {
        hs_output_init(&call->account, found.ndim, found.columns, 4, &half);
        status = hs_sort_pairs(call, 0, map.n, &found, false, NULL, &half);
    }
    if (status == HS_OK) {
        status = fill_table(&map, ascends ? &found : &half, made);
    }
    hs_output_free(&found);
    hs_output_free(&half);
    hs_node_map_free(&call->account, &map);
    return connectivity_end(made, status, result, failure);
}

hs_pairs *
hs_rows_begin(bool has_input, const hs_points *points, const hs_options *options, hs_pairs **result,
              hs_failure **failure, hs_status *status)
{
    hs_pairs *made = hs_result_begin(has_input, options, result, failure, status);
    *status = made != NULL ? hs_check_resources(options) : *status;
    if (*status == HS_OK && points != NULL) {
        *status = hs_check_points(points, *failure);
    }
    return made;
}

/* ---- what is left of rows: each entry is read once and written where the new row goes on ----- */

static bool
are_rows(const hs_list_rows *rows)
{
    return rows->n >= 0 && rows->n_lists >= 0 && rows->offsets != NULL && rows->n_indices >= 0 &&
           (rows->indices != NULL || rows->n_indices == 0) &&
           (rows->shift == NULL || (rows->ndim >= 1 && rows->ndim <= HS_MAX_DIM));
}

/* Entry k of rows, as a range. False where it is none. */
static bool
read_range(const hs_list_rows *rows, int64_t k, int64_t *first, int64_t *last)
{
    *first = rows->offsets[k];
    *last = rows->offsets[k + 1];
    return *first >= 0 && *first <= *last && *last <= rows->n_indices;
}

/* Ends an entry of the new rows, for which `looked` entries were looked at. */
static hs_status
end_entry(const hs_call *call, int64_t looked, new_rows *to)
{
    *++to->offsets = to->n;
    to->looked += looked;
    if (to->looked < POLL_ENTRIES) {
        return HS_OK;
    }
    to->looked = 0;
    return hs_poll(&call->options, (double)to->n / (double)to->room);
}

/* Where the nodes of lists are, and room to put the nodes of an entry in order. */
typedef struct keeping {
    const hs_list_rows   *rows;
    const hs_node_change *change;
    int64_t              *first;   /* owned; of each list among all nodes, and behind the last */
    uint64_t             *entries; /* owned; place and number, of one entry of a row */
    uint64_t             *spare;   /* part of entries */
} keeping;

static hs_status
open_keeping(hs_account *account, keeping *doing)
{
    const hs_list_rows *rows = doing->rows;
    const int32_t       n_lists = rows->n_lists;
    int64_t             longest = 0, first, last;
    for (int64_t k = 0; doing->change->place != NULL && k < rows->n * n_lists; k++) {
        if (!read_range(rows, k, &first, &last)) {
            return HS_ERR_ARGUMENT;
        }
        longest = last - first > longest ? last - first : longest;
    }
    if (longest > UINT32_MAX) {
        return HS_ERR_TOO_MANY;
    }
    doing->first = hs_alloc(account, HS_FOR_CELLS, n_lists + 1, sizeof *doing->first);
    doing->entries = hs_alloc(account, HS_FOR_SORTING, longest, 2 * sizeof *doing->entries);
    if (doing->first == NULL || doing->entries == NULL) {
        return HS_ERR_MEMORY;
    }
    doing->spare = doing->entries + longest;
    doing->first[0] = 0;
    for (int32_t l = 0; l < n_lists; l++) {
        const int64_t n = doing->change->n_nodes[l];
        if (n < 0) {
            return HS_ERR_ARGUMENT;
        }
        doing->first[l + 1] = doing->first[l] + n;
    }
    return HS_OK;
}

/* Copies entries [first, last) of rows, whose nodes are of list l, by their places where these are
 * given; images of one node stay in their order. False where a node is none. */
static bool
keep_entries(const keeping *doing, int32_t l, int64_t first, int64_t last, new_rows *to)
{
    const hs_list_rows *rows = doing->rows;
    const int64_t       base = doing->first[l], n_nodes = doing->first[l + 1] - base;
    const int32_t      *target = doing->change->target + base, *place = doing->change->place;
    int64_t             n = 0;
    for (int64_t e = first; e < last; e++) {
        const int32_t node = rows->indices[e];
        if (node < 0 || node >= n_nodes) {
            return false;
        }
        const int32_t number = target[node];
        if (place == NULL) {
            put_entry(to, to->n, number, rows, e); /* there is room for one more than stay */
            to->n += number >= 0;
        } else if (number >= 0) {
            doing->entries[n++] = (uint64_t)(uint32_t)place[base + node] << 32 |
                                  (uint64_t)(e - first);
        }
    }
    if (n > 0) {
        hs_sort_numbers(doing->entries, n, 32, doing->spare);
    }
    for (int64_t k = 0; k < n; k++) {
        const int64_t e = first + (int64_t)(doing->entries[k] & UINT32_MAX);
        put_entry(to, to->n++, target[rows->indices[e]], rows, e);
    }
    return true;
}

hs_status
hs_rows_keep(const hs_list_rows *rows, const hs_node_change *change, const int64_t *source,
             int64_t n, const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    keeping   doing = {.rows = rows, .change = change};
    new_rows  to = {.n = 0};
    hs_status status;
    hs_pairs *made =
        hs_rows_begin(rows != NULL && change != NULL, NULL, options, result, &failure, &status);
    if (made == NULL) {
        return status;
    }
    hs_call *call = &made->call;
    if (status == HS_OK) {
        status =
            are_rows(rows) && n >= 0 && n <= rows->n && change->n_lists == rows->n_lists &&
                    (change->n_lists == 0 || (change->n_nodes != NULL && change->target != NULL))
                ? open_keeping(&call->account, &doing)
                : HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = open_rows(call, n, rows->n_lists, rows->n_indices, rows, made, &to);
    }
    for (int64_t k = 0; status == HS_OK && k < n; k++) {
        const int64_t row = source != NULL ? source[k] : k;
        status = row >= 0 && row < rows->n ? HS_OK : HS_ERR_ARGUMENT;
        for (int32_t l = 0; l < rows->n_lists && status == HS_OK; l++) {
            int64_t first, last;
            status = read_range(rows, row * rows->n_lists + l, &first, &last) &&
                             last - first <= to.room - to.n &&
                             keep_entries(&doing, l, first, last, &to)
                         ? end_entry(call, last - first, &to)
                         : HS_ERR_ARGUMENT;
        }
    }
    made->output.n_pairs = status == HS_OK ? to.n : 0;
    hs_free(&call->account, doing.first);
    hs_free(&call->account, doing.entries);
    return hs_result_end(made, status, result, failure);
}

/* The sign of entry e of rows, with its shift, less entry w of those that go. */
HS_ALWAYS_INLINE int64_t
compare_entries(const hs_list_rows *rows, int64_t e, const hs_list_rows *without, int64_t w)
{
    const int     d = rows->ndim;
    const int64_t difference = (int64_t)rows->indices[e] - without->indices[w];
    return difference != 0 || rows->shift == NULL
               ? difference
               : hs_compare_shifts(rows->shift + e * d, without->shift + w * d, d);
}

/* Entry k, the same of both. False where offsets are none, or something goes that is not there. */
static bool
drop_entries(const hs_list_rows *rows, const hs_list_rows *without, bool ascend, int64_t k,
             new_rows *to)
{
    int64_t first, last, w, w_last;
    if (!read_range(rows, k, &first, &last) || !read_range(without, k, &w, &w_last)) {
        return false;
    }
    for (int64_t e = first; e < last; e++) {
        while (ascend && w < w_last && compare_entries(rows, e, without, w) > 0) {
            w++;
        }
        const bool goes = w < w_last && compare_entries(rows, e, without, w) == 0;
        put_entry(to, to->n, rows->indices[e], rows, e);
        to->n += !goes;
        w += goes;
    }
    return ascend || w == w_last;
}

hs_status
hs_rows_without(const hs_list_rows *rows, const hs_list_rows *without, bool ascend,
                const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    new_rows  to = {.n = 0};
    hs_status status;
    hs_pairs *made =
        hs_rows_begin(rows != NULL && without != NULL, NULL, options, result, &failure, &status);
    if (made == NULL) {
        return status;
    }
    hs_call *call = &made->call;
    if (status == HS_OK) {
        status = are_rows(rows) && are_rows(without) && rows->n == without->n &&
                         rows->n_lists == without->n_lists &&
                         (rows->shift == NULL) == (without->shift == NULL) &&
                         (rows->shift == NULL || rows->ndim == without->ndim)
                     ? open_rows(call, rows->n, rows->n_lists, rows->n_indices, rows, made, &to)
                     : HS_ERR_ARGUMENT;
    }
    for (int64_t k = 0; status == HS_OK && k < rows->n * rows->n_lists; k++) {
        status = drop_entries(rows, without, ascend, k, &to)
                     ? end_entry(call, rows->offsets[k + 1] - rows->offsets[k], &to)
                     : HS_ERR_ARGUMENT;
    }
    made->output.n_pairs = status == HS_OK ? to.n : 0;
    return hs_result_end(made, status, result, failure);
}
