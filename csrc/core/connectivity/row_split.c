/* SPDX-License-Identifier: BSD-3-Clause */
/* row_split.c: where the lists follow each other in a row, it is cut at their ends; else each entry
 * goes to where its list goes on. */
#include "row_split.h"

#include "half_list.h"
#include "../base/starts.h"

#include <string.h>

/* Where the entries of one row go. offsets[0] is set; offsets[l + 1] becomes the end of list l. */
typedef struct target {
    int64_t *offsets;
    int32_t *index; /* of the whole table, as shift */
    int32_t *shift; /* NULL: none */
} target;

HS_ALWAYS_INLINE void
put(const target *to, int64_t at, int32_t node, const hs_rows_view *from, int64_t e)
{
    to->index[at] = node;
    for (int k = 0; to->shift != NULL && k < from->ndim; k++) {
        to->shift[at * from->ndim + k] = from->shift[e * from->ndim + k];
    }
}

/* Of points in the order of lists and nodes. */
static void
cut(const hs_node_map *map, const hs_rows_view *from, int64_t p, const target *to)
{
    int64_t e = from->first[p];
    for (int32_t l = 0; l < map->n_lists; l++) {
        const int32_t first = l > 0 ? (int32_t)map->end[l - 1] : 0;
        int64_t       at = to->offsets[l];
        for (; e < from->end[p] && from->index[e] < map->end[l]; e++) {
            put(to, at++, from->index[e] - first, from, e);
        }
        to->offsets[l + 1] = at;
    }
}

/* Of points in any order. */
static void
distribute(const hs_node_map *map, const hs_rows_view *from, int64_t p, const target *to)
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
        put(to, offsets[map->list[q]]++, map->node[q], from, e);
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

static hs_status
reserve(hs_call *call, const hs_node_map *map, int64_t n_entries, const hs_rows_view *from,
        hs_pairs *rows)
{
    const int64_t  n = map->n_rows * map->n_lists + 1;
    const unsigned columns = HS_WANT_J | (from->shift != NULL ? (unsigned)HS_WANT_SHIFT : 0u);
    int64_t       *offsets;
    hs_output_init(&call->account, from->ndim, columns, 4, &rows->output);
    hs_status status = hs_pairs_open_offsets(&call->account, n, rows, &offsets);
    if (status == HS_OK) {
        status = hs_output_reserve(&rows->output, n_entries, 0.0);
    }
    if (status == HS_OK) {
        rows->output.n_pairs = n_entries;
    }
    return status;
}

hs_status
hs_row_split_fill(hs_call *call, const hs_node_map *map, const hs_rows_view *from, hs_pairs *rows)
{
    int32_t *point_of_row = hs_alloc(&call->account, HS_FOR_ORDER, map->n, sizeof *point_of_row);
    if (point_of_row == NULL) {
        return HS_ERR_MEMORY;
    }
    const int64_t   n_entries = find_points(map, from, point_of_row);
    const hs_status status = reserve(call, map, n_entries, from, rows);
    if (status == HS_OK) {
        target to = {.offsets = hs_output_column(&rows->offsets, HS_WANT_I),
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

/* Whether entry e of the row of p begins a pair. */
HS_ALWAYS_INLINE bool
is_forward(const hs_rows_view *from, int64_t p, int64_t e)
{
    if (from->shift == NULL || from->index[e] != p) {
        return from->index[e] > p;
    }
    return hs_shift_is_forward(from->shift + e * from->ndim, from->ndim);
}

hs_status
hs_row_split_half(hs_call *call, int64_t n, const hs_rows_view *from, hs_output *half)
{
    const unsigned shift = from->shift != NULL ? HS_WANT_SHIFT : 0;
    const int      d = from->ndim;
    int64_t        n_pairs = 0;
    hs_output_init(&call->account, d, HS_WANT_I | HS_WANT_J | shift, 4, half);
    for (int64_t p = 0; p < n; p++) {
        for (int64_t e = from->first[p]; e < from->end[p]; e++) {
            n_pairs += is_forward(from, p, e);
        }
    }
    const hs_status status = hs_output_reserve(half, n_pairs, 0.0);
    if (status != HS_OK) {
        return status;
    }
    half->n_pairs = n_pairs;
    int32_t *i = hs_output_column(half, HS_WANT_I), *j = hs_output_column(half, HS_WANT_J);
    int32_t *s = hs_output_column(half, HS_WANT_SHIFT);
    for (int64_t p = 0, at = 0; p < n; p++) {
        for (int64_t e = from->first[p]; e < from->end[p]; e++) {
            if (is_forward(from, p, e)) {
                i[at] = (int32_t)p;
                j[at] = from->index[e];
                if (s != NULL) {
                    memcpy(s + at * d, from->shift + e * d, (size_t)d * sizeof *s);
                }
                at++;
            }
        }
    }
    return HS_OK;
}
