/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * pair_list_build.c: the list of one step. It is a search whose points are numbered in cell order,
 * so that neighbours lie close together in memory when the list is used, and whose shifts are those
 * of the wrapped points, so that few of them are not zero.
 */
#include "pair_list.h"

#include "../search/estimate.h"
#include "../box/lattice.h"
#include "pair_list_search.h"
#include "../search/search_open.h"

#include <math.h>
#include <string.h>

/* A search, and what it has found in cell order. */
typedef struct building {
    hs_call     call;
    hs_search   search;
    hs_pieces   pieces;
    hs_listing *listing; /* borrowed: what it becomes; its stores are those of the list in use */
} building;

void
hs_listing_free(hs_listing *listing)
{
    hs_store_free(&listing->for_j);
    hs_store_free(&listing->for_bundles);
    for (int turn = 0; turn < 2; turn++) {
        hs_store_free(&listing->for_order[turn]);
        hs_store_free(&listing->for_counts[turn]);
    }
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
    searching.cell_size = 0.0;
    searching.algorithm = HS_AUTO;
    searching.out = NULL;
    searching.counters = NULL;
    searching.want = HS_WANT_I | HS_WANT_J | (m > 0 ? HS_WANT_SHIFT : 0);
    searching.index_bytes = 4;
    return searching;
}

/* Stores by how many given box vectors each point was wrapped; nothing where none was. */
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
    listing->counts = hs_store_reserve(&listing->for_counts[listing->turn], HS_FOR_WRAPS,
                                       bins->n * m, sizeof *listing->counts);
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
        listing->counts = NULL;
    }
    return HS_OK;
}

/* Renumbers the points by their places in cell order; shifts are images alone from here on. */
static hs_status
renumber(hs_search *search, hs_listing *listing)
{
    hs_bins *bins = &search->bins;
    listing->order = hs_store_reserve(&listing->for_order[listing->turn], HS_FOR_ORDER, bins->n,
                                      sizeof *listing->order);
    if (listing->order == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t si = 0; si < bins->n; si++) {
        listing->order[si] = bins->order[si];
        bins->order[si] = (int32_t)si;
    }
    if (!bins->keeps_originals) {
        bins->turns.known = false; /* they are not needed any more */
    }
    return HS_OK;
}

/* Finds all pairs within the radius; the search stays open. */
static hs_status
find(building *built, hs_failure *failure)
{
    hs_search  *search = &built->search;
    hs_listing *listing = built->listing;
    hs_status   status = hs_estimate_by_sample(search, failure);
    if (status == HS_OK) {
        status = take_counts(search, listing, failure);
    }
    if (status == HS_OK) {
        status = renumber(search, listing);
    }
    if (status == HS_OK) {
        status = hs_pieces_find(search, &built->pieces, failure);
        if (failure->row >= 0) {
            failure->row = listing->order[failure->row];
        }
    }
    return status;
}

/* Where the parts of a piece go: its first pair and bundle of each kind. */
typedef struct places {
    int64_t plain_pair, shifted_pair, plain_bundle, shifted_bundle;
} places;

typedef struct placing {
    const building *built;
    places         *of; /* owned, one for each piece */
} placing;

static void
place_part(const hs_part *part, int64_t first_pair, int64_t first_bundle, hs_listing *listing)
{
    if (part->pairs.n_pairs == 0) {
        return;
    }
    memcpy(listing->j + first_pair, hs_output_column(&part->pairs, HS_WANT_J),
           (size_t)part->pairs.n_pairs * sizeof *listing->j);
    for (int64_t b = 0; b < part->n_bundles; b++) {
        listing->bundles[first_bundle + b] = part->bundles[b];
        listing->bundles[first_bundle + b].end += first_pair;
    }
}

/* A hs_task_fn: the pairs of one piece to the listing, those with an image behind all others. */
static void
place_piece(void *context, int64_t p)
{
    const placing  *place = context;
    const hs_piece *piece = &place->built->pieces.of[p];
    const places   *to = &place->of[p];
    hs_listing     *listing = place->built->listing;
    place_part(&piece->plain, to->plain_pair, to->plain_bundle, listing);
    place_part(&piece->shifted, listing->n_plain + to->shifted_pair,
               listing->n_plain_bundles + to->shifted_bundle, listing);
}

/* Gives each bundle with a shift the number of its image. */
static bool
number_images(hs_part *part, hs_listing *listing)
{
    const int m = listing->images.width;
    for (int64_t b = 0; b < part->n_bundles; b++) {
        part->bundles[b].image = hs_images_number(&listing->images, part->shift + b * m);
        if (part->bundles[b].image < 0) {
            return false;
        }
    }
    return true;
}

/* A larger store in *renewed, if the present one is too small. */
static bool
renew(const hs_store *store, hs_purpose purpose, int64_t n, size_t size, hs_store *renewed)
{
    return (store->data != NULL && n * (int64_t)size <= store->capacity) ||
           hs_store_reserve(renewed, purpose, n, size) != NULL;
}

/* The renewed store in place of the other, if there is one. */
static void *
take(hs_store *store, hs_store *renewed)
{
    if (renewed->data != NULL) {
        hs_store_free(store);
        *store = *renewed;
    }
    return store->data;
}

/* Counts pairs and bundles, and how many come before each piece. */
static bool
count_pairs(building *built, placing *place)
{
    hs_account *account = &built->call.account;
    hs_listing *listing = built->listing;
    places      sum = {0};
    place->of = hs_alloc(account, HS_FOR_SORTING, built->pieces.n, sizeof *place->of);
    if (place->of == NULL) {
        return false;
    }
    for (int64_t p = 0; p < built->pieces.n; p++) {
        const hs_piece *piece = &built->pieces.of[p];
        place->of[p] = sum;
        sum.plain_pair += piece->plain.pairs.n_pairs;
        sum.plain_bundle += piece->plain.n_bundles;
        sum.shifted_pair += piece->shifted.pairs.n_pairs;
        sum.shifted_bundle += piece->shifted.n_bundles;
    }
    listing->n_plain = sum.plain_pair;
    listing->n_pairs = sum.plain_pair + sum.shifted_pair;
    listing->n_plain_bundles = sum.plain_bundle;
    listing->n_bundles = sum.plain_bundle + sum.shifted_bundle;
    /* The pieces, which are on no account, and the listing. */
    return hs_account_allows(account, (double)(2 * sizeof *listing->j) * (double)listing->n_pairs +
                                          (double)(3 * sizeof *listing->bundles) *
                                              (double)listing->n_bundles);
}

/* Makes room for the pairs, which may be that of the list in use: so this is the last step that can
 * fail, ... */
static bool
make_room(hs_listing *listing)
{
    hs_store j = {0}, bundles = {0};
    /* ... which must lose none of its arrays if another one cannot be had. */
    if (!renew(&listing->for_j, HS_FOR_INDICES, listing->n_pairs + HS_PADDING, sizeof(int32_t),
               &j) ||
        !renew(&listing->for_bundles, HS_FOR_INDICES, listing->n_bundles, sizeof(hs_bundle),
               &bundles)) {
        hs_store_free(&j);
        return false;
    }
    listing->j = take(&listing->for_j, &j);
    listing->bundles = take(&listing->for_bundles, &bundles);
    memset(listing->j + listing->n_pairs, 0, HS_PADDING * sizeof *listing->j);
    return true;
}

/* Writes what was found to the listing. */
static hs_status
settle_pairs(building *built)
{
    hs_search *search = &built->search;
    placing    place = {.built = built};
    hs_images_init(search->scene.lattice.n_periodic, &built->listing->images);
    bool complete = count_pairs(built, &place);
    for (int64_t p = 0; p < built->pieces.n && complete; p++) {
        complete = number_images(&built->pieces.of[p].shifted, built->listing);
    }
    complete = complete && make_room(built->listing);
    if (complete) {
        hs_team_run(search->call->team, built->pieces.n, place_piece, &place);
    }
    hs_free(&search->call->account, place.of);
    return complete ? HS_OK : HS_ERR_MEMORY;
}

static hs_status
build(const hs_frame *frame, building *built, hs_failure *failure)
{
    hs_call      *call = &built->call;
    const hs_sets sets = {.points = &frame->points, .is_plain = true};
    hs_status  status = hs_search_open(&sets, hs_frame_box(frame), call, &built->search, failure);
    const bool opened = status == HS_OK;
    if (status == HS_OK) {
        status = find(built, failure);
    }
    if (status == HS_OK) {
        status = settle_pairs(built);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = fmax(failure->expected_pairs, (double)built->listing->n_pairs);
    }
    hs_call_tell_limit(call, status, failure);
    if (opened) {
        hs_pieces_free(&call->account, &built->pieces);
        hs_search_close(&built->search);
    }
    return status;
}

hs_status
hs_listing_build(const hs_frame *frame, const hs_options *options, double radius,
                 hs_listing *listing, hs_failure *failure)
{
    int              row[HS_MAX_DIM];
    const hs_options searching = options_of_build(options, radius, hs_frame_periodic(frame, row));
    hs_listing       next = *listing; /* with its stores */
    building        *built = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *built);
    if (built == NULL) {
        return HS_ERR_MEMORY;
    }
    next.n_pairs = 0; /* not known */
    next.radius = radius;
    next.counts = NULL;
    hs_images_init(0, &next.images);
    next.turn = 1 - listing->turn;
    built->listing = &next;
    built->pieces = (hs_pieces){0};
    hs_call_begin(&searching, &built->call);
    const hs_status status = build(frame, built, failure);
    hs_call_dismiss(&built->call);
    hs_account_close(&built->call.account);
    hs_free(NULL, built);
    if (status == HS_OK) {
        hs_images_free(&listing->images);
        *listing = next;
    } else { /* stores that are not in use may have grown */
        hs_images_free(&next.images);
        listing->for_order[next.turn] = next.for_order[next.turn];
        listing->for_counts[next.turn] = next.for_counts[next.turn];
    }
    return status;
}
