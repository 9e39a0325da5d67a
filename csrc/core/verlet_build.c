/* SPDX-License-Identifier: BSD-3-Clause */
/* verlet_build.c: the list of one step: a search, and its shifts brought to few numbers. */
#include "verlet.h"

#include "memory.h"
#include "poll.h"
#include "wrap.h"

#include <math.h>
#include <string.h>

/* Pairs between two questions to the caller: a few milliseconds. */
#define POLL_PAIRS (INT64_C(1) << 20)

/*
 * Shifts up to here are images as they are: points lie within some boxes of each other, and counts
 * are zero. A box that the radius spans many times has more; so do points that were never wrapped
 * for long, for which counts bring them together again.
 */
#define MOST_PLAIN 64

/* Pairs as the search found them, over the d box vectors. */
typedef struct found {
    int64_t  n;
    int      d, m;
    int      row[HS_MAX_DIM];
    int32_t *i, *j, *shift; /* owned: hs_array_free; shift is NULL where nothing repeats */
} found;

static void
free_found(found *pairs)
{
    hs_array_free(pairs->i);
    hs_array_free(pairs->j);
    hs_array_free(pairs->shift);
}

void
hs_listing_free(hs_listing *listing)
{
    hs_array_free(listing->i);
    hs_array_free(listing->j);
    hs_free(NULL, listing->code);
    hs_images_free(&listing->images);
    hs_counts_free(&listing->counts);
    *listing = (hs_listing){0};
}

static hs_status
search(const hs_frame *frame, const hs_options *options, double radius, found *pairs,
       hs_failure *failure)
{
    hs_options searching = *options;
    hs_pairs  *result;
    *pairs = (found){.d = frame->points.ndim};
    pairs->m = hs_frame_periodic(frame, pairs->row);
    searching.cutoff = radius;
    searching.inclusive = true;
    searching.precision = HS_EXACT;
    searching.sorted = false;
    searching.out = NULL;
    searching.want = HS_WANT_I | HS_WANT_J | (pairs->m > 0 ? HS_WANT_SHIFT : 0);
    searching.index_bytes = 4;
    const hs_status status =
        hs_pairs_find(&frame->points, hs_frame_box(frame), &searching, &result, failure);
    if (status == HS_OK) {
        pairs->n = hs_pairs_length(result);
        pairs->i = hs_pairs_take(result, HS_WANT_I);
        pairs->j = hs_pairs_take(result, HS_WANT_J);
        pairs->shift = hs_pairs_take(result, HS_WANT_SHIFT);
        hs_pairs_free(result);
    }
    return status;
}

/* Whether all shifts are small enough to be images. */
static bool
shifts_are_few(const found *pairs)
{
    uint32_t      any = 0;
    const int64_t n = pairs->n * pairs->d;
    for (int64_t e = 0; e < n; e++) {
        const uint32_t shift = (uint32_t)pairs->shift[e];
        any |= shift ^ (0u - (shift >> 31)); /* of a negative number: one less than its size */
    }
    return any < MOST_PLAIN;
}

/* By how many box vectors each point is away from the box. */
static hs_status
count_turns(const hs_frame *frame, int m, const hs_options *options, hs_counts *counts,
            hs_failure *failure)
{
    const int  d = frame->points.ndim;
    hs_lattice lattice;
    hs_lattice_init(&frame->box, d, hs_scale_of(0), &lattice);
    if (!hs_counts_make_room(counts, frame->points.n * m)) {
        return HS_ERR_MEMORY;
    }
    for (int64_t i = 0; i < frame->points.n; i++) {
        double  x[HS_MAX_DIM], inside[HS_MAX_DIM], magnitude = 0.0;
        int64_t turns[HS_MAX_DIM];
        for (int k = 0; k < d; k++) {
            x[k] = hs_frame_entry(frame->rows, frame->points.real, i * d + k);
        }
        if (!hs_wrap_point(&lattice, x, inside, turns, &magnitude) ||
            !hs_lattice_shift(&lattice, turns, counts->of + i * m)) {
            failure->row = i;
            return HS_ERR_SHIFT_RANGE;
        }
        if (hs_poll_points(options, i + 1) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

/* The image of pair e, one number for each box vector that repeats. Whether it is not zero, or -1
 * if it does not fit. */
HS_ALWAYS_INLINE int
image_of(const found *pairs, const int64_t *counts, int64_t e, int32_t *image)
{
    uint32_t any = 0;
    for (int r = 0; r < pairs->m; r++) {
        int64_t value = pairs->shift[e * pairs->d + pairs->row[r]];
        if (counts != NULL) {
            /* Modulo 2^64: exact, for the sum is small. */
            value = (int64_t)((uint64_t)value +
                              (uint64_t)counts[(int64_t)pairs->j[e] * pairs->m + r] -
                              (uint64_t)counts[(int64_t)pairs->i[e] * pairs->m + r]);
            if (value < INT32_MIN || value > INT32_MAX) {
                return -1;
            }
        }
        image[r] = (int32_t)value;
        any |= (uint32_t)image[r];
    }
    return any != 0;
}

static hs_status
count_shifted(const found *pairs, const int64_t *counts, const hs_options *options,
              int64_t *n_shifted, hs_failure *failure)
{
    *n_shifted = 0;
    for (int64_t e = 0; e < pairs->n; e++) {
        int32_t   image[HS_MAX_DIM];
        const int shifted = image_of(pairs, counts, e, image);
        if (shifted < 0) {
            failure->row = pairs->i[e];
            return HS_ERR_SHIFT_RANGE;
        }
        *n_shifted += shifted;
        if (e % POLL_PAIRS == POLL_PAIRS - 1 && hs_poll(options, 1.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

/* Moves pairs with an image behind the others, each kind in the order in which it was, through
 * `aside`, which has room for their i and j; listing->code for their images. */
static hs_status
part_shifted(found *pairs, int64_t n_shifted, const hs_options *options, int32_t *aside,
             hs_listing *listing)
{
    int64_t n_plain = 0, n = 0;
    for (int64_t e = 0; e < pairs->n; e++) {
        int32_t       image[HS_MAX_DIM];
        const int32_t i = pairs->i[e], j = pairs->j[e];
        if (image_of(pairs, listing->counts.of, e, image) == 0) {
            pairs->i[n_plain] = i;
            pairs->j[n_plain++] = j;
        } else {
            aside[n] = i;
            aside[n_shifted + n] = j;
            listing->code[n] = hs_images_number(&listing->images, image);
            if (listing->code[n++] < 0) {
                return HS_ERR_MEMORY;
            }
        }
        if (e % POLL_PAIRS == POLL_PAIRS - 1 && hs_poll(options, 1.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    HS_ASSERT(n == n_shifted && n_plain + n == pairs->n);
    if (n > 0) {
        memcpy(pairs->i + n_plain, aside, (size_t)n * sizeof *aside);
        memcpy(pairs->j + n_plain, aside + n, (size_t)n * sizeof *aside);
    }
    listing->n_plain = n_plain;
    return HS_OK;
}

/* Shifts to images, in an otherwise empty listing. */
static hs_status
number_images(found *pairs, const hs_frame *frame, const hs_options *options,
              hs_listing *listing, hs_failure *failure)
{
    hs_account account;
    hs_status  status = HS_OK;
    int64_t    n_shifted = 0;
    int32_t   *aside = NULL;
    hs_account_init(&account, options);
    hs_images_init(pairs->m, &listing->images);
    if (!shifts_are_few(pairs)) {
        status = count_turns(frame, pairs->m, options, &listing->counts, failure);
    }
    if (status == HS_OK) {
        status = count_shifted(pairs, listing->counts.of, options, &n_shifted, failure);
    }
    if (status == HS_OK) {
        /* The list and what sorts it out: the search has given back what it took. */
        const double bytes = 8.0 * (double)pairs->n + 12.0 * (double)n_shifted;
        if (hs_account_allows(&account, bytes)) {
            listing->code = hs_alloc(NULL, HS_FOR_SHIFTS, n_shifted, sizeof(int32_t));
            aside = hs_alloc(&account, HS_FOR_SORTING, 2 * n_shifted, sizeof(int32_t));
        }
        status = listing->code != NULL && aside != NULL
                     ? part_shifted(pairs, n_shifted, options, aside, listing)
                     : HS_ERR_MEMORY;
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)pairs->n;
        failure->limit_bytes = account.limit;
    }
    hs_free(&account, aside);
    hs_account_close(&account);
    return status;
}

hs_status
hs_listing_build(const hs_frame *frame, const hs_options *options, double radius,
                 hs_listing *listing, hs_failure *failure)
{
    hs_listing built = {.radius = radius};
    found      pairs;
    hs_status  status = search(frame, options, radius, &pairs, failure);
    if (status != HS_OK) {
        return status;
    }
    built.n_pairs = built.n_plain = pairs.n;
    if (pairs.m > 0) {
        status = number_images(&pairs, frame, options, &built, failure);
    }
    if (status != HS_OK) {
        free_found(&pairs);
        hs_listing_free(&built);
        return status;
    }
    built.i = pairs.i;
    built.j = pairs.j;
    hs_array_free(pairs.shift);
    hs_listing_free(listing);
    *listing = built;
    return HS_OK;
}
