/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * verlet_build.c: the list of one step. It is a search whose points are numbered in cell order, so
 * that neighbours lie close together in memory when the list is used, and whose shifts are those of
 * the wrapped points, so that few of them are not zero.
 */
#include "verlet.h"

#include "estimate.h"
#include "lattice.h"
#include "parallel.h"
#include "poll.h"
#include "record.h"

#include <math.h>
#include <string.h>

/* Pairs between two questions to the caller: a few milliseconds. */
#define POLL_PAIRS (INT64_C(1) << 20)

/* A search and what it finds: i and j in cell order, and images over all box vectors. */
typedef struct building {
    hs_search search;
    hs_output output;
    int32_t  *i, *j, *image; /* owned: hs_array_free; image is NULL where nothing repeats */
} building;

void
hs_listing_free(hs_listing *listing)
{
    hs_array_free(listing->i);
    hs_array_free(listing->j);
    hs_free(NULL, listing->order);
    hs_free(NULL, listing->counts);
    hs_free(NULL, listing->code);
    hs_images_free(&listing->images);
    *listing = (hs_listing){0};
}

static hs_options
options_of_build(const hs_options *options, double radius, int m)
{
    hs_options searching = *options;
    searching.cutoff = radius;
    searching.inclusive = true;
    searching.precision = HS_EXACT;
    searching.sorted = false;
    searching.out = NULL;
    searching.counters = NULL;
    searching.want = HS_WANT_I | HS_WANT_J | (m > 0 ? HS_WANT_SHIFT : 0);
    searching.index_bytes = 4;
    return searching;
}

/* By how many given box vectors each point was wrapped; none are stored where none was. */
static hs_status
take_counts(const hs_search *search, hs_listing *listing, hs_failure *failure)
{
    const hs_bins *bins = &search->bins;
    const int      m = bins->n_periodic;
    int64_t        any = 0;
    if (m == 0) {
        return HS_OK;
    }
    HS_ASSERT(bins->turns.known);
    listing->counts = hs_alloc(NULL, HS_FOR_WRAPS, bins->n * m, sizeof *listing->counts);
    if (listing->counts == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t si = 0; si < bins->n; si++) {
        int64_t turns[HS_MAX_DIM];
        for (int r = 0; r < m; r++) {
            turns[r] = hs_turns_get(&bins->turns, r, si);
        }
        if (!hs_lattice_shift(&search->scene.lattice, turns, listing->counts + si * m)) {
            failure->row = bins->order[si];
            return HS_ERR_SHIFT_RANGE;
        }
        for (int r = 0; r < m; r++) {
            any |= listing->counts[si * m + r];
        }
    }
    if (any == 0) {
        hs_free(NULL, listing->counts);
        listing->counts = NULL;
    }
    return HS_OK;
}

/* From here on the search speaks of points by their places in cell order, and of images alone. */
static hs_status
renumber(hs_search *search, hs_listing *listing)
{
    hs_bins *bins = &search->bins;
    listing->order = hs_alloc(NULL, HS_FOR_ORDER, bins->n, sizeof *listing->order);
    if (listing->order == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t si = 0; si < bins->n; si++) {
        listing->order[si] = bins->order[si];
        bins->order[si] = (int32_t)si;
    }
    search->options.want &= ~(unsigned)HS_WANT_SHIFT; /* shifts are kept as keys: images */
    if (!bins->keeps_originals) {
        bins->turns.known = false; /* nobody needs them any more */
    }
    return HS_OK;
}

static hs_status
record(building *built, hs_failure *failure)
{
    hs_search  *search = &built->search;
    hs_recorder recorder = {0};
    hs_walker   walker;
    if (search->team != NULL) {
        return hs_parallel_record(search, &built->output, failure);
    }
    hs_status status = hs_walker_init(search, hs_record_use(built->output.columns),
                                      hs_record_hits, &recorder, &walker);
    if (status == HS_OK) {
        status = hs_recorder_init(&search->account, &built->output, walker.block.most_hits,
                                  &recorder);
    }
    if (status == HS_OK) {
        status = hs_walk(&walker, 0, (int32_t)search->bins.n);
    }
    if (status == HS_ERR_SHIFT_RANGE) {
        failure->row = walker.failed_point;
    }
    hs_recorder_free(&search->account, &recorder);
    hs_walker_close(search, &walker);
    return status;
}

/* All pairs within the radius; the search stays open. */
static hs_status
find(building *built, hs_listing *listing, hs_failure *failure)
{
    hs_search *search = &built->search;
    const bool has_images = search->bins.n_periodic > 0;
    hs_output_init(&search->account, search->scene.ndim,
                   HS_WANT_I | HS_WANT_J | (has_images ? HS_WANT_SHIFT : 0), 4, &built->output);
    hs_status status = hs_estimate_by_sample(search, failure);
    if (status == HS_OK) {
        status = take_counts(search, listing, failure);
    }
    if (status == HS_OK) {
        status = renumber(search, listing);
    }
    if (status == HS_OK) {
        hs_output_expect(&built->output, search->grid.expected_pairs);
        status = record(built, failure);
        if (failure->row >= 0) {
            failure->row = listing->order[failure->row];
        }
    }
    if (status == HS_OK) {
        status = hs_output_reserve(&built->output, 0, 1.0); /* arrays also without pairs */
    }
    return status;
}

/* Pair e the way the caller's numbers have it: i < j. Returns whether its image, over the box
 * vectors that repeat, is not zero. */
HS_ALWAYS_INLINE bool
turn_pair(const building *built, const int32_t *order, int64_t e, int32_t *i, int32_t *j,
          int32_t *image)
{
    const hs_lattice *lattice = &built->search.scene.lattice;
    const int32_t     a = built->i[e], b = built->j[e];
    const bool        turned = order[a] > order[b];
    uint32_t          any = 0;
    *i = turned ? b : a;
    *j = turned ? a : b;
    for (int r = 0; r < lattice->n_periodic; r++) {
        const int32_t shift = built->image[e * lattice->ndim + lattice->vector_of_row[r]];
        image[r] = turned ? -shift : shift; /* not INT32_MIN: recording has refused it */
        any |= (uint32_t)image[r];
    }
    return any != 0;
}

static int64_t
count_shifted(const building *built, int64_t n_pairs)
{
    const int64_t d = built->search.scene.ndim;
    int64_t       n = 0;
    for (int64_t e = 0; built->image != NULL && e < n_pairs; e++) {
        int32_t any = 0;
        for (int64_t k = 0; k < d; k++) {
            any |= built->image[e * d + k];
        }
        n += any != 0;
    }
    return n;
}

/* Turns all pairs, and moves those with an image behind the others, each kind in the order in which
 * it was, through `aside`, which has room for their i and j; listing->code for their images. */
static hs_status
part_pairs(building *built, int64_t n_shifted, int32_t *aside, hs_listing *listing)
{
    const int64_t n_pairs = listing->n_pairs;
    int64_t       n_plain = 0, n = 0;
    for (int64_t e = 0; e < n_pairs; e++) {
        int32_t i, j, image[HS_MAX_DIM];
        if (!turn_pair(built, listing->order, e, &i, &j, image)) {
            built->i[n_plain] = i;
            built->j[n_plain++] = j;
        } else {
            aside[n] = i;
            aside[n_shifted + n] = j;
            listing->code[n] = hs_images_number(&listing->images, image);
            if (listing->code[n++] < 0) {
                return HS_ERR_MEMORY;
            }
        }
        if (e % POLL_PAIRS == POLL_PAIRS - 1 &&
            hs_poll(&built->search.options, 1.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    HS_ASSERT(n == n_shifted && n_plain + n == n_pairs);
    memcpy(built->i + n_plain, aside, (size_t)n * sizeof *aside);
    memcpy(built->j + n_plain, aside + n, (size_t)n * sizeof *aside);
    listing->n_plain = n_plain;
    return HS_OK;
}

/* From what was found to the listing's arrays. */
static hs_status
settle_pairs(building *built, hs_listing *listing)
{
    hs_account   *account = &built->search.account;
    hs_output    *output = &built->output;
    hs_status     status = HS_ERR_MEMORY;
    const int64_t n = output->n_pairs;
    listing->n_pairs = n;
    built->i = hs_output_take(output, HS_WANT_I);
    built->j = hs_output_take(output, HS_WANT_J);
    built->image = hs_output_take(output, HS_WANT_SHIFT);
    const int64_t n_shifted = count_shifted(built, n);
    int32_t *aside = hs_alloc(account, HS_FOR_SORTING, 2 * n_shifted, sizeof(int32_t));
    hs_images_init(built->search.scene.lattice.n_periodic, &listing->images);
    if (hs_account_allows(account, (double)n_shifted * sizeof(int32_t))) {
        listing->code = hs_alloc(NULL, HS_FOR_SHIFTS, n_shifted, sizeof(int32_t));
    }
    if (aside != NULL && listing->code != NULL) {
        status = part_pairs(built, n_shifted, aside, listing);
    }
    hs_free(account, aside);
    return status;
}

static hs_status
build(const hs_frame *frame, building *built, hs_listing *listing, const hs_options *options,
      hs_failure *failure)
{
    hs_search *search = &built->search;
    hs_status  status =
        hs_search_open(&frame->points, hs_frame_box(frame), options, search, failure);
    if (status != HS_OK) {
        return status;
    }
    status = find(built, listing, failure);
    if (status == HS_OK) {
        status = settle_pairs(built, listing);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs =
            fmax(failure->expected_pairs, (double)built->output.n_pairs);
        failure->limit_bytes = search->account.limit;
    }
    hs_output_free(&built->output);
    hs_search_close(search);
    return status;
}

hs_status
hs_listing_build(const hs_frame *frame, const hs_options *options, double radius,
                 hs_listing *listing, hs_failure *failure)
{
    int              row[HS_MAX_DIM];
    const hs_options building_options =
        options_of_build(options, radius, hs_frame_periodic(frame, row));
    hs_listing listing_built = {.radius = radius};
    building  *built = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *built);
    if (built == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(&built->output, 0, sizeof built->output);
    built->i = built->j = built->image = NULL;
    const hs_status status =
        build(frame, built, &listing_built, &building_options, failure);
    hs_account_close(&built->search.account);
    hs_array_free(built->image);
    if (status == HS_OK) {
        listing_built.i = built->i;
        listing_built.j = built->j;
        hs_listing_free(listing);
        *listing = listing_built;
    } else {
        hs_array_free(built->i);
        hs_array_free(built->j);
        hs_listing_free(&listing_built);
    }
    hs_free(NULL, built);
    return status;
}
