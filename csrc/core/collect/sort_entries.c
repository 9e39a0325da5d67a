/* SPDX-License-Identifier: BSD-3-Clause */
/* sort_entries.c: by numbers where entries have their j; of these, images of one pair by S, which
 * is one number too as a rule. */
#include "sort_entries.h"

#include "../base/sort_numbers.h"

/* Pairs of two points that insertion sorts in less time than a heap. */
#define FEW 48

static bool
is_before(const hs_sorting *all, uint64_t a, uint64_t b)
{
    const int32_t ja = hs_second_of(all, a), jb = hs_second_of(all, b);
    if (ja != jb) {
        return ja < jb;
    }
    for (int k = 0; all->shift != NULL && k < all->found->ndim; k++) {
        const int32_t sa = hs_shift_of(all, a, k), sb = hs_shift_of(all, b, k);
        if (sa != sb) {
            return sa < sb;
        }
    }
    return false;
}

static void
sift_down(const hs_sorting *all, uint64_t *heap, int64_t root, int64_t n)
{
    const uint64_t moving = heap[root];
    for (int64_t child; (child = 2 * root + 1) < n; root = child) {
        if (child + 1 < n && is_before(all, heap[child], heap[child + 1])) {
            child++;
        }
        if (!is_before(all, moving, heap[child])) {
            break;
        }
        heap[root] = heap[child];
    }
    heap[root] = moving;
}

/* Sorts by (j, S), whatever these are: insertion sort for a few, heap sort for a crowd. */
static void
sort_any(const hs_sorting *all, uint64_t *row, int64_t n)
{
    if (n <= FEW) {
        for (int64_t e = 1; e < n; e++) {
            const uint64_t moving = row[e];
            int64_t        at = e;
            for (; at > 0 && is_before(all, moving, row[at - 1]); at--) {
                row[at] = row[at - 1];
            }
            row[at] = moving;
        }
        return;
    }
    for (int64_t root = n / 2; root-- > 0;) {
        sift_down(all, row, root, n);
    }
    for (int64_t end = n - 1; end > 0; end--) {
        const uint64_t largest = row[0];
        row[0] = row[end];
        row[end] = largest;
        sift_down(all, row, 0, end);
    }
}

/* S as one number that orders images; false where it does not fit. */
static bool
image_key(const hs_sorting *all, uint64_t entry, uint64_t *key)
{
    const int     d = all->found->ndim, width = d > 1 ? 64 / d : 32;
    const int64_t middle = INT64_C(1) << (width - 1);
    *key = 0;
    for (int k = 0; k < d; k++) {
        const int64_t shift = hs_shift_of(all, entry, k) + middle;
        if (shift < 0 || shift >> width != 0) {
            return false;
        }
        *key = *key << width | (uint64_t)shift;
    }
    return true;
}

/* Sorts pairs of two points by S. */
static void
sort_images(const hs_sorting *all, uint64_t *row, int64_t n, uint64_t *keys)
{
    bool fit = n <= FEW;
    for (int64_t e = 0; e < n && fit; e++) {
        fit = image_key(all, row[e], &keys[e]);
    }
    for (int64_t e = 1; e < n && fit; e++) {
        const uint64_t moving = row[e], key = keys[e];
        int64_t        at = e;
        for (; at > 0 && keys[at - 1] > key; at--) {
            row[at] = row[at - 1];
            keys[at] = keys[at - 1];
        }
        row[at] = moving;
        keys[at] = key;
    }
    if (!fit) {
        sort_any(all, row, n);
    }
}

void
hs_sort_row(const hs_sorting *all, uint64_t *row, int64_t n, uint64_t *spare)
{
    if (!all->has_j) {
        sort_any(all, row, n);
        return;
    }
    hs_sort_numbers(row, n, spare);
    for (int64_t first = 0, end; all->shift != NULL && first < n; first = end) {
        const uint64_t j = row[first] >> all->place_bits;
        for (end = first + 1; end < n && row[end] >> all->place_bits == j;) {
            end++;
        }
        if (end - first > 1) {
            sort_images(all, row + first, end - first, spare);
        }
    }
}

int64_t
hs_row_from(const hs_sorting *all, int64_t entry)
{
    int64_t first = 0, end = all->n_points;
    while (first < end) {
        const int64_t middle = first + (end - first) / 2;
        if (hs_row_begin(all, middle) < entry) {
            first = middle + 1;
        } else {
            end = middle;
        }
    }
    return first;
}
