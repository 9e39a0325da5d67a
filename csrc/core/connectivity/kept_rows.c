/* SPDX-License-Identifier: BSD-3-Clause */
/* kept_rows.c: each entry is read once and written where the new row goes on. */
#include "kept_rows.h"

#include "../base/poll.h"
#include "../base/sort_numbers.h"

#include <string.h>

/* Entries between two calls of poll(). */
#define POLL_ENTRIES (INT64_C(1) << 21)

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
    const int      ndim = rows->shift != NULL ? rows->ndim : 1;
    const unsigned columns = HS_WANT_J | (rows->shift != NULL ? (unsigned)HS_WANT_SHIFT : 0u);
    const int64_t  n_offsets = n * rows->n_lists + 1;
    int64_t       *offsets = NULL;
    hs_output_init(&call->account, ndim, columns, 4, &result->output);
    hs_status status = hs_pairs_open_offsets(&call->account, n_offsets, result, &offsets);
    if (status == HS_OK) {
        status = hs_output_reserve(&result->output, rows->n_indices, 0.0);
    }
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
    if (to->polled < POLL_ENTRIES) {
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
