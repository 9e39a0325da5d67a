/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * sort.c: a counting sort by i, then each point's few pairs by (j, S): O(pairs * log(pairs of one
 * point)).
 */
#include "sort.h"

#include <string.h>

/* Pairs between two calls of poll(). */
#define POLL_PAIRS (INT64_C(1) << 18)

static bool
is_before(const hs_pair_block *block, int ndim, int64_t a, int64_t b)
{
    if (block->j[a] != block->j[b]) {
        return block->j[a] < block->j[b];
    }
    for (int k = 0; block->shift != NULL && k < ndim; k++) {
        const int32_t sa = block->shift[a * ndim + k], sb = block->shift[b * ndim + k];
        if (sa != sb) {
            return sa < sb;
        }
    }
    return false;
}

static void
sift_down(const hs_pair_block *block, int ndim, int64_t *heap, int64_t root, int64_t n)
{
    const int64_t moving = heap[root];
    for (int64_t child; (child = 2 * root + 1) < n; root = child) {
        if (child + 1 < n && is_before(block, ndim, heap[child], heap[child + 1])) {
            child++;
        }
        if (!is_before(block, ndim, moving, heap[child])) {
            break;
        }
        heap[root] = heap[child];
    }
    heap[root] = moving;
}

/* Insertion sort for the usual few, heap sort for a crowd. */
static void
sort_row(const hs_pair_block *block, int ndim, int64_t *row, int64_t n)
{
    if (n <= 48) {
        for (int64_t e = 1; e < n; e++) {
            const int64_t moving = row[e];
            int64_t       at = e;
            for (; at > 0 && is_before(block, ndim, moving, row[at - 1]); at--) {
                row[at] = row[at - 1];
            }
            row[at] = moving;
        }
        return;
    }
    for (int64_t root = n / 2; root-- > 0;) {
        sift_down(block, ndim, row, root, n);
    }
    for (int64_t end = n - 1; end > 0; end--) {
        const int64_t largest = row[0];
        row[0] = row[end];
        row[end] = largest;
        sift_down(block, ndim, row, 0, end);
    }
}

hs_status
hs_sort_pairs(hs_search *search, const hs_store *store, int64_t n_points, int64_t **order)
{
    hs_account          *account = &search->account;
    const hs_pair_block *block = store->first;
    hs_status            status = HS_OK;
    int64_t *start = hs_alloc(account, HS_FOR_SORTING, n_points + 1, sizeof(int64_t));
    int64_t *places = hs_alloc(account, HS_FOR_SORTING, store->n_pairs, sizeof(int64_t));
    if (start == NULL || places == NULL) {
        status = HS_ERR_MEMORY;
        goto done;
    }
    memset(start, 0, (size_t)(n_points + 1) * sizeof(int64_t));
    for (int64_t p = 0; p < store->n_pairs; p++) {
        start[block->i[p] + 1]++;
        if (p % POLL_PAIRS == POLL_PAIRS - 1 && hs_search_poll(search) != HS_OK) {
            status = HS_ERR_INTERRUPTED;
            goto done;
        }
    }
    for (int64_t i = 0; i < n_points; i++) {
        start[i + 1] += start[i];
    }
    for (int64_t p = 0; p < store->n_pairs; p++) {
        places[start[block->i[p]]++] = p; /* start[i] runs ahead to the end of row i */
        if (p % POLL_PAIRS == POLL_PAIRS - 1 && hs_search_poll(search) != HS_OK) {
            status = HS_ERR_INTERRUPTED;
            goto done;
        }
    }
    for (int64_t i = 0, first = 0, work = 0; i < n_points && status == HS_OK;
         first = start[i++]) {
        sort_row(block, store->ndim, places + first, start[i] - first);
        work += start[i] - first;
        if (work > POLL_PAIRS) {
            work = 0;
            status = hs_search_poll(search);
        }
    }
done:
    hs_free(account, start);
    if (status != HS_OK) {
        hs_free(account, places);
        return status;
    }
    *order = places;
    return HS_OK;
}
