/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * sort_pairs.c: a counting sort by i, then each point's few pairs by (j, S): O(pairs * log(pairs of
 * one point)).
 */
#include "sort_pairs.h"

#include "../base/poll.h"

#include <string.h>

/* Pairs between two calls of poll(). */
#define POLL_PAIRS (INT64_C(1) << 18)

/* The columns that order pairs; shift is NULL where it is not kept. */
typedef struct keys {
    const int32_t *i, *j, *shift;
} keys;

static bool
is_before(const keys *key, int ndim, int64_t a, int64_t b)
{
    if (key->j[a] != key->j[b]) {
        return key->j[a] < key->j[b];
    }
    for (int k = 0; key->shift != NULL && k < ndim; k++) {
        const int32_t sa = key->shift[a * ndim + k], sb = key->shift[b * ndim + k];
        if (sa != sb) {
            return sa < sb;
        }
    }
    return false;
}

static void
sift_down(const keys *key, int ndim, int64_t *heap, int64_t root, int64_t n)
{
    const int64_t moving = heap[root];
    for (int64_t child; (child = 2 * root + 1) < n; root = child) {
        if (child + 1 < n && is_before(key, ndim, heap[child], heap[child + 1])) {
            child++;
        }
        if (!is_before(key, ndim, moving, heap[child])) {
            break;
        }
        heap[root] = heap[child];
    }
    heap[root] = moving;
}

/* Insertion sort for the usual few, heap sort for a crowd. */
static void
sort_row(const keys *key, int ndim, int64_t *row, int64_t n)
{
    if (n <= 48) {
        for (int64_t e = 1; e < n; e++) {
            const int64_t moving = row[e];
            int64_t       at = e;
            for (; at > 0 && is_before(key, ndim, moving, row[at - 1]); at--) {
                row[at] = row[at - 1];
            }
            row[at] = moving;
        }
        return;
    }
    for (int64_t root = n / 2; root-- > 0;) {
        sift_down(key, ndim, row, root, n);
    }
    for (int64_t end = n - 1; end > 0; end--) {
        const int64_t largest = row[0];
        row[0] = row[end];
        row[end] = largest;
        sift_down(key, ndim, row, 0, end);
    }
}

/* A pair of points can occur in several images, so that sorting needs to tell these apart. */
static bool
images_repeat(const hs_search *search)
{
    const hs_lattice *lattice = &search->scene.lattice;
    for (int k = 0; k < lattice->ndim; k++) {
        if (lattice->row_of_axis[k] >= 0 && 2.0 * search->grid.range[k] >= lattice->period[k]) {
            return true;
        }
    }
    return false;
}

unsigned
hs_sort_columns(const hs_search *search)
{
    const unsigned wanted = search->call->options.want & ~(unsigned)HS_WANT_BOTH;
    return wanted | HS_WANT_I | HS_WANT_J | (images_repeat(search) ? HS_WANT_SHIFT : 0);
}

/* What is put in order. */
typedef struct sorting {
    hs_call         *call;
    int32_t          first_point;
    int64_t          n_points;
    const hs_output *found;
    int64_t         *start; /* n_points + 1; start[i - first_point] ends up where row i ends */
    int64_t         *order; /* places of the pairs, ascending in the end */
} sorting;

/* order[]: the pairs by ascending i. */
static hs_status
sort_by_first(const sorting *all, const int32_t *i)
{
    const hs_options *options = &all->call->options;
    const int64_t     n_points = all->n_points, n_pairs = all->found->n_pairs;
    const int32_t     first = all->first_point;
    int64_t          *start = all->start;
    memset(start, 0, (size_t)(n_points + 1) * sizeof(int64_t));
    for (int64_t p = 0; p < n_pairs; p++) {
        start[i[p] - first + 1]++;
        if (p % POLL_PAIRS == POLL_PAIRS - 1 && hs_poll(options, 1.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    for (int64_t k = 0; k < n_points; k++) {
        start[k + 1] += start[k];
    }
    for (int64_t p = 0; p < n_pairs; p++) {
        all->order[start[i[p] - first]++] = p;
        if (p % POLL_PAIRS == POLL_PAIRS - 1 && hs_poll(options, 1.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

static hs_status
find_order(const sorting *all)
{
    const hs_output *found = all->found;
    const keys       key = {hs_output_column(found, HS_WANT_I), hs_output_column(found, HS_WANT_J),
                            hs_output_column(found, HS_WANT_SHIFT)};
    hs_status        status = sort_by_first(all, key.i);
    for (int64_t i = 0, first = 0, work = 0; i < all->n_points && status == HS_OK;
         first = all->start[i++]) {
        const int64_t n = all->start[i] - first;
        sort_row(&key, found->ndim, all->order + first, n);
        work += n;
        if (work > POLL_PAIRS) {
            work = 0;
            status = hs_poll(&all->call->options, 1.0);
        }
    }
    return status;
}

/* n indices in the given order, to every `stride`-th element. */
static void
put_indices(void *to, int index_bytes, int64_t stride, const int32_t *from, const int64_t *order,
            int64_t n)
{
    for (int64_t p = 0; p < n && to != NULL; p++) {
        if (index_bytes == 8) {
            ((int64_t *)to)[p * stride] = from[order[p]];
        } else {
            ((int32_t *)to)[p * stride] = from[order[p]];
        }
    }
}

static void
put_rows(const hs_output *found, hs_output *sorted, unsigned bit, const int64_t *order, int64_t n)
{
    const size_t size = hs_output_width(sorted, bit);
    const char  *from = hs_output_column(found, bit);
    char        *to = hs_output_next(sorted, bit);
    for (int64_t p = 0; p < n && to != NULL; p++) {
        memcpy(to + (size_t)p * size, from + (size_t)order[p] * size, size);
    }
}

/* The next n pairs. */
static void
put_pairs(const hs_output *found, const int64_t *order, int64_t n, hs_output *sorted)
{
    const int      bytes = sorted->index_bytes;
    const int32_t *i = hs_output_column(found, HS_WANT_I), *j = hs_output_column(found, HS_WANT_J);
    char          *both = hs_output_next(sorted, HS_WANT_BOTH);
    put_indices(hs_output_next(sorted, HS_WANT_I), bytes, 1, i, order, n);
    put_indices(hs_output_next(sorted, HS_WANT_J), bytes, 1, j, order, n);
    put_indices(both, bytes, 2, i, order, n);
    put_indices(both == NULL ? NULL : both + bytes, bytes, 2, j, order, n);
    put_rows(found, sorted, HS_WANT_DISTANCE, order, n);
    put_rows(found, sorted, HS_WANT_VECTOR, order, n);
    put_rows(found, sorted, HS_WANT_SHIFT, order, n);
}

static hs_status
put_all(const hs_options *options, const hs_output *found, const int64_t *order, hs_output *sorted)
{
    const int64_t n = found->n_pairs;
    if (sorted->fixed && n > sorted->capacity) {
        sorted->n_pairs = n; /* tells hs_pairs_conclude that they do not fit */
        return HS_OK;
    }
    hs_status status = sorted->fixed ? HS_OK : hs_output_reserve(sorted, n, 1.0);
    for (int64_t first = 0; first < n && status == HS_OK; first += POLL_PAIRS) {
        const int64_t part = n - first < POLL_PAIRS ? n - first : POLL_PAIRS;
        put_pairs(found, order + first, part, sorted);
        sorted->n_pairs += part;
        status = part == POLL_PAIRS ? hs_poll(options, 1.0) : HS_OK;
    }
    return status;
}

hs_status
hs_sort_pairs(hs_call *call, int32_t first_point, int64_t n_points, const hs_output *found,
              hs_output *sorted)
{
    hs_account *account = &call->account;
    hs_status   status = HS_ERR_MEMORY;
    sorting all = {.call = call, .first_point = first_point, .n_points = n_points, .found = found};
    all.start = hs_alloc(account, HS_FOR_SORTING, n_points + 1, sizeof *all.start);
    all.order = hs_alloc(account, HS_FOR_SORTING, found->n_pairs, sizeof *all.order);
    if (all.start != NULL && all.order != NULL) {
        status = found->n_pairs > 0 ? find_order(&all) : HS_OK;
        hs_free(account, all.start);
        all.start = NULL;
        if (status == HS_OK) {
            status = put_all(&call->options, found, all.order, sorted);
        }
    }
    hs_free(account, all.start);
    hs_free(account, all.order);
    return status;
}
