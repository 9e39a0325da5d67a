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
    hs_store_free(&listing->for_i);
    hs_store_free(&listing->for_j);
    hs_store_free(&listing->for_code);
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

/* Where a piece's pairs go, and its first pair with an image among all of these. */
typedef struct placing {
    const building *built;
    int64_t        *plain, *shifted; /* owned, one for each piece */
} placing;

/* Writes a pair with i < j in the caller's numbers. Half of them must be turned, without any
 * pattern: a branch would be mispredicted. */
HS_ALWAYS_INLINE void
put_pair(const int32_t *order, int32_t a, int32_t b, hs_listing *listing, int64_t to)
{
    const int32_t change = (a ^ b) & -(int32_t)(order[a] > order[b]);
    listing->i[to] = a ^ change;
    listing->j[to] = b ^ change;
}

/* A hs_task_fn: the pairs of one piece to the listing, those with an image behind all others. */
static void
place_piece(void *context, int64_t p)
{
    const placing  *place = context;
    const hs_piece *piece = &place->built->pieces.of[p];
    hs_listing     *listing = place->built->listing;
    const int32_t  *i = hs_output_column(&piece->pairs, HS_WANT_I);
    const int32_t  *j = hs_output_column(&piece->pairs, HS_WANT_J);
    int64_t         plain = place->plain[p], e = 0;
    for (int64_t s = 0; s <= piece->n_shifted; s++) {
        const int64_t end = s < piece->n_shifted ? piece->at[s] : piece->pairs.n_pairs;
        for (; e < end; e++) {
            put_pair(listing->order, i[e], j[e], listing, plain++);
        }
        if (s < piece->n_shifted) {
            const int64_t to = place->shifted[p] + s;
            put_pair(listing->order, i[e], j[e], listing, listing->n_plain + to);
            listing->code[to] = piece->shift[s];
            e++;
        }
    }
}

/* Shifts of one piece, of m numbers each, to numbers of images, one each, in the same array. */
static bool
number_images(hs_piece *piece, hs_listing *listing)
{
    const int      m = listing->images.width;
    const int32_t *i = hs_output_column(&piece->pairs, HS_WANT_I);
    const int32_t *j = hs_output_column(&piece->pairs, HS_WANT_J);
    for (int64_t s = 0; s < piece->n_shifted; s++) {
        const int64_t e = piece->at[s];
        const bool    turned = listing->order[i[e]] > listing->order[j[e]];
        int32_t       image[HS_MAX_DIM];
        for (int r = 0; r < m; r++) {
            image[r] = turned ? -piece->shift[s * m + r] : piece->shift[s * m + r];
        }
        piece->shift[s] = hs_images_number(&listing->images, image);
        if (piece->shift[s] < 0) {
            return false;
        }
    }
    return true;
}

/* A larger store in *renewed, if the present one is too small for n numbers. */
static bool
renew(const hs_store *store, int64_t n, hs_store *renewed)
{
    return (store->data != NULL && n * (int64_t)sizeof(int32_t) <= store->capacity) ||
           hs_store_reserve(renewed, HS_FOR_INDICES, n, sizeof(int32_t)) != NULL;
}

/* The renewed store in place of the other, if there is one. */
static int32_t *
take(hs_store *store, hs_store *renewed)
{
    if (renewed->data != NULL) {
        hs_store_free(store);
        *store = *renewed;
    }
    return store->data;
}

/* Counts the pairs, and how many come before each piece. */
static bool
count_pairs(building *built, placing *place)
{
    hs_account *account = &built->call.account;
    hs_listing *listing = built->listing;
    int64_t     n_shifted = 0;
    place->plain = hs_alloc(account, HS_FOR_SORTING, built->pieces.n, sizeof(int64_t));
    place->shifted = hs_alloc(account, HS_FOR_SORTING, built->pieces.n, sizeof(int64_t));
    if (place->plain == NULL || place->shifted == NULL) {
        return false;
    }
    for (int64_t p = 0; p < built->pieces.n; p++) {
        const hs_piece *piece = &built->pieces.of[p];
        place->plain[p] = listing->n_pairs - n_shifted;
        place->shifted[p] = n_shifted;
        listing->n_pairs += piece->pairs.n_pairs;
        n_shifted += piece->n_shifted;
    }
    listing->n_plain = listing->n_pairs - n_shifted;
    /* The pieces, which are on no account, and the listing. */
    if (!hs_account_allows(account, 16.0 * (double)listing->n_pairs + 32.0 * (double)n_shifted)) {
        return false;
    }
    return true;
}

/* Makes room for the pairs, which may be that of the list in use: so this is the last step that can
 * fail, ... */
static bool
make_room(hs_listing *listing)
{
    const int64_t n = listing->n_pairs;
    hs_store      i = {0}, j = {0}, code = {0};
    /* ... which must lose none of its arrays if another one cannot be had. */
    bool complete = renew(&listing->for_i, n, &i);
    complete = complete && renew(&listing->for_j, n, &j);
    complete = complete && renew(&listing->for_code, n - listing->n_plain, &code);
    if (!complete) {
        hs_store_free(&i);
        hs_store_free(&j);
        return false;
    }
    listing->i = take(&listing->for_i, &i);
    listing->j = take(&listing->for_j, &j);
    listing->code = take(&listing->for_code, &code);
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
        complete = number_images(&built->pieces.of[p], built->listing);
    }
    complete = complete && make_room(built->listing);
    if (complete) {
        hs_team_run(search->call->team, built->pieces.n, place_piece, &place);
    }
    hs_free(&search->call->account, place.shifted);
    hs_free(&search->call->account, place.plain);
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
        failure->limit_bytes = call->account.limit;
    }
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
    next.n_pairs = next.n_plain = 0;
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
