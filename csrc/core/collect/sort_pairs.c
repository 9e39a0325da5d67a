/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * sort_pairs.c: a counting sort by i, then each point's few pairs by (j, S). A pair is one number
 * while it is sorted, j before its place, so that nothing is looked up but the S of images of one
 * pair.
 */
#include "sort_pairs.h"

#include "../base/poll.h"
#include "../base/sort_numbers.h"
#include "sort_entries.h"

#include <string.h>

/* Pairs between two calls of poll(). */
#define POLL_PAIRS (INT64_C(1) << 18)

/* Pairs that are written at a time. */
#define PUT 256

#ifdef HS_TESTING
static int most_place_bits = 63;

int
hs_test_sort_place_bits(int bits)
{
    const int before = most_place_bits;
    most_place_bits = bits;
    return before;
}
#else
enum { most_place_bits = 63 };
#endif

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

static hs_status
poll_for(const hs_sorting *all, int64_t pair)
{
    const bool is_due = pair % POLL_PAIRS == POLL_PAIRS - 1;
    return is_due ? hs_poll(&all->call->options, 1.0) : HS_OK;
}

/* Counts the pairs of each i, and settles where each row begins, which is in `end` for now. */
static hs_status
count_rows(hs_sorting *all)
{
    int64_t *begin = all->end;
    int32_t  any = 0;
    memset(begin, 0, (size_t)(all->n_points + 1) * sizeof *begin);
    for (int64_t p = 0; p < all->found->n_pairs; p++) {
        begin[all->i[p] - all->first_point + 1]++;
        any |= all->j[p];
        if (all->both_ways) {
            begin[all->j[p] - all->first_point + 1]++;
            any |= all->i[p];
        }
        if (poll_for(all, p) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    for (int64_t row = 0; row < all->n_points; row++) {
        all->longest = begin[row + 1] > all->longest ? begin[row + 1] : all->longest;
        begin[row + 1] += begin[row];
    }
    all->n = begin[all->n_points];
    all->place_bits = 64 - hs_count_bits((uint64_t)any | 1);
    all->has_j =
        all->n >> (all->place_bits < most_place_bits ? all->place_bits : most_place_bits) == 0;
    return HS_OK;
}

/* Puts the entries in rows. */
static hs_status
deal_out(const hs_sorting *all)
{
    int64_t *next = all->end;
    for (int64_t p = 0; p < all->found->n_pairs; p++) {
        const int32_t i = all->i[p], j = all->j[p];
        if (all->both_ways) {
            all->entries[next[i - all->first_point]++] = hs_entry_of(all, j, 2 * p);
            all->entries[next[j - all->first_point]++] = hs_entry_of(all, i, 2 * p + 1);
        } else {
            all->entries[next[i - all->first_point]++] = hs_entry_of(all, j, p);
        }
        if (poll_for(all, p) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

static hs_status
sort_rows(const hs_sorting *all, uint64_t *spare)
{
    hs_status status = HS_OK;
    for (int64_t row = 0, first = 0, work = 0; row < all->n_points && status == HS_OK;
         first = all->end[row++]) {
        const int64_t n = all->end[row] - first;
        hs_sort_row(all, all->entries + first, n, spare);
        work += n;
        if (work > POLL_PAIRS) {
            work = 0;
            status = hs_poll(&all->call->options, 1.0);
        }
    }
    return status;
}

/* n indices to every `stride`-th element. */
static void
put_indices(void *to, int index_bytes, int64_t stride, const int32_t *from, int64_t n)
{
    for (int64_t e = 0; e < n && to != NULL; e++) {
        if (index_bytes == 8) {
            ((int64_t *)to)[e * stride] = from[e];
        } else {
            ((int32_t *)to)[e * stride] = from[e];
        }
    }
}

/* The other quantities of n entries, at most PUT. */
static void
put_measures(const hs_sorting *all, const uint64_t *entries, int64_t n, hs_output *sorted)
{
    const int      d = all->found->ndim;
    const double  *distances = hs_output_column(all->found, HS_WANT_DISTANCE);
    const double  *vectors = hs_output_column(all->found, HS_WANT_VECTOR);
    double        *distance = hs_output_next(sorted, HS_WANT_DISTANCE);
    double        *vector = hs_output_next(sorted, HS_WANT_VECTOR);
    int32_t       *shift = hs_output_next(sorted, HS_WANT_SHIFT);
    int32_t       *shell = hs_output_next(sorted, HS_WANT_SHELL);
    const int32_t *shells = hs_output_column(all->found, HS_WANT_SHELL);
    for (int64_t e = 0; e < n && distance != NULL; e++) {
        distance[e] = distances[hs_pair_of(all, entries[e])];
    }
    for (int64_t e = 0; e < n && shell != NULL; e++) {
        shell[e] = shells[hs_pair_of(all, entries[e])];
    }
    for (int64_t e = 0; e < n && vector != NULL; e++) {
        const double *from = vectors + hs_pair_of(all, entries[e]) * d;
        const bool    turned = hs_is_turned(all, entries[e]);
        for (int k = 0; k < d; k++) {
            *vector++ = turned ? -from[k] + 0.0 : from[k]; /* a zero has no sign */
        }
    }
    for (int64_t e = 0; e < n && shift != NULL; e++) {
        for (int k = 0; k < d; k++) {
            *shift++ = hs_shift_of(all, entries[e], k);
        }
    }
}

/* The next n entries, of row *row and those behind it. */
static void
put_some(const hs_sorting *all, int64_t first, int64_t n, int64_t *row, hs_output *sorted)
{
    const uint64_t *entries = all->entries + first;
    const int       bytes = sorted->index_bytes;
    char           *both = hs_output_next(sorted, HS_WANT_BOTH);
    int32_t         i[PUT], j[PUT];
    for (int64_t e = 0; e < n; e++) {
        while (all->end[*row] <= first + e) {
            ++*row;
        }
        i[e] = all->first_point + (int32_t)*row;
        j[e] = hs_second_of(all, entries[e]);
    }
    put_indices(hs_output_next(sorted, HS_WANT_I), bytes, 1, i, n);
    put_indices(hs_output_next(sorted, HS_WANT_J), bytes, 1, j, n);
    put_indices(both, bytes, 2, i, n);
    put_indices(both == NULL ? NULL : both + bytes, bytes, 2, j, n);
    put_measures(all, entries, n, sorted);
    sorted->n_pairs += n;
}

static hs_status
put_all(const hs_sorting *all, hs_output *sorted)
{
    int64_t row = 0;
    if (sorted->fixed && all->n > sorted->capacity) {
        sorted->n_pairs = all->n; /* tells hs_pairs_conclude that they do not fit */
        return HS_OK;
    }
    hs_status status = sorted->fixed ? HS_OK : hs_output_reserve(sorted, all->n, 1.0);
    for (int64_t first = 0; first < all->n && status == HS_OK; first += PUT) {
        const int64_t n = all->n - first < PUT ? all->n - first : PUT;
        put_some(all, first, n, &row, sorted);
        status = poll_for(all, first + n - 1);
    }
    return status;
}

/* Once the rows are counted. */
static hs_status
sort_and_put(hs_sorting *all, hs_output *sorted)
{
    hs_account *account = &all->call->account;
    uint64_t   *spare = hs_alloc(account, HS_FOR_SORTING, all->longest, sizeof *spare);
    all->entries = hs_alloc(account, HS_FOR_SORTING, all->n, sizeof *all->entries);
    hs_status status = all->entries != NULL && spare != NULL ? deal_out(all) : HS_ERR_MEMORY;
    if (status == HS_OK) {
        status = sort_rows(all, spare);
    }
    if (status == HS_OK) {
        status = put_all(all, sorted);
    }
    hs_free(account, all->entries);
    hs_free(account, spare);
    return status;
}

static hs_status
sort(hs_sorting *all, hs_output *sorted)
{
    all->i = hs_output_column(all->found, HS_WANT_I);
    all->j = hs_output_column(all->found, HS_WANT_J);
    all->shift = hs_output_column(all->found, HS_WANT_SHIFT);
    const hs_status status = count_rows(all);
    return status == HS_OK ? sort_and_put(all, sorted) : status;
}

hs_status
hs_sort_pairs(hs_call *call, int32_t first_point, int64_t n_points, const hs_output *found,
              hs_output *sorted)
{
    hs_sorting all = {
        .call = call, .first_point = first_point, .n_points = n_points, .found = found};
    all.end = hs_alloc(&call->account, HS_FOR_SORTING, n_points + 1, sizeof *all.end);
    const hs_status status = all.end != NULL ? sort(&all, sorted) : HS_ERR_MEMORY;
    hs_free(&call->account, all.end);
    return status;
}

hs_status
hs_sort_rows(hs_call *call, int64_t n_rows, const hs_output *found, bool both_ways,
             int64_t *offsets, hs_output *sorted)
{
    hs_sorting all = {
        .call = call, .n_points = n_rows, .found = found, .both_ways = both_ways, .end = offsets};
    const hs_status status = sort(&all, sorted);
    memmove(offsets + 1, offsets, (size_t)n_rows * sizeof *offsets);
    offsets[0] = 0;
    return status;
}
