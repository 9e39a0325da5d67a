/* SPDX-License-Identifier: BSD-3-Clause */
#include "pair_list.h"
#include "../collect/parallel.h"
#include "../search/walk.h"
#include "../memory/memory.h"
#include "../base/status.h"
#include "../base/os.h"
#include "../exact/arithmetic.h"

#include <string.h>

/* pair_list.c: finds the pairs of a list, lists them in bundles, and follows the motion of the
 * points: how much of the skin it leaves. */

/* Each thread has a walker; shifts are looked up once for each run of a
 * block. */

#define PIECES_A_THREAD 4 /* so that none waits long for the others */
#define FIRST_BUNDLES   256

/* What one thread works with. */
typedef struct worker {
    hs_committer committer;
    hs_search   *search; /* borrowed */
    hs_pieces   *pieces; /* borrowed */
    hs_walker    walker;
    hs_piece    *piece; /* that it is working on */
    /* Of the block that was looked at last: */
    int64_t  block; /* candidates tested before it, which tells blocks apart; -1: none */
    bool     has_images;
    bool    *is_shifted; /* owned; whether a run is in another image ... */
    int32_t *shift;      /* owned; ... and which, over the given box vectors: m numbers */
} worker;

/* The shift of a run over the box vectors as given. */
static bool
shift_of_run(const hs_search *search, const hs_run *run, int32_t *shift)
{
    const hs_lattice *lattice = &search->scene.lattice;
    int64_t           reduced[HS_MAX_DIM], given[HS_MAX_DIM];
    for (int r = 0; r < lattice->n_periodic; r++) {
        reduced[r] = run->image[r];
    }
    if (!hs_lattice_shift(lattice, reduced, given)) {
        return false;
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        shift[r] = (int32_t)given[r];
        if (given[r] > INT32_MAX || given[r] < -INT32_MAX) { /* so that it can be negated */
            return false;
        }
    }
    return true;
}

static bool
has_shift(const hs_run *run, int m)
{
    uint32_t any = 0;
    for (int r = 0; r < m; r++) {
        any |= (uint32_t)run->image[r];
    }
    return any != 0;
}

/* A new bundle at the end of a part, of no pairs; NULL: out of memory. m: numbers of its shift, 0
 * in a plain part. */
static hs_bundle *
add_bundle(hs_part *part, int32_t point, int m)
{
    if (part->n_bundles == part->capacity) {
        const int64_t capacity = part->capacity > 0 ? 2 * part->capacity : FIRST_BUNDLES;
        hs_bundle    *bundles = hs_alloc(NULL, HS_FOR_INDICES, capacity, sizeof *bundles);
        int32_t      *shift = hs_alloc(NULL, HS_FOR_SHIFTS, capacity * m, sizeof *shift);
        if (bundles == NULL || shift == NULL) {
            hs_free(NULL, bundles);
            hs_free(NULL, shift);
            return NULL;
        }
        if (part->n_bundles > 0) {
            memcpy(bundles, part->bundles, (size_t)part->n_bundles * sizeof *bundles);
            memcpy(shift, part->shift, (size_t)(part->n_bundles * m) * sizeof *shift);
        }
        hs_free(NULL, part->bundles);
        hs_free(NULL, part->shift);
        part->bundles = bundles;
        part->shift = shift;
        part->capacity = capacity;
    }
    hs_bundle *bundle = &part->bundles[part->n_bundles++];
    *bundle = (hs_bundle){.end = part->pairs.n_pairs, .point = point};
    return bundle;
}

/* Whether the first entry that is not zero is negative. */
static bool
is_negative(const int32_t *shift, int m)
{
    for (int r = 0; r < m; r++) {
        if (shift[r] != 0) {
            return shift[r] < 0;
        }
    }
    return false;
}

/* Finds the shifts of the runs of a block, once. */
static bool
look_at_block(worker *me)
{
    const hs_scanner *scanner = &me->walker.scanner;
    const hs_block   *block = &scanner->block;
    const int         m = scanner->search->bins.n_periodic;
    if (me->block == scanner->n_candidates) {
        return true;
    }
    me->block = scanner->n_candidates;
    me->has_images = false;
    for (int32_t r = 0; m > 0 && block->runs[r].at < block->n; r++) {
        me->is_shifted[r] = has_shift(&block->runs[r], m);
        me->has_images = me->has_images || me->is_shifted[r];
        if (me->is_shifted[r] &&
            !shift_of_run(scanner->search, &block->runs[r], me->shift + (int64_t)r * m)) {
            return false;
        }
    }
    return true;
}

/* n hits of one run to a part: as many pairs of its last bundle. */
static void
add_pairs(worker *me, hs_part *part, const int32_t *labels, int32_t n)
{
    const int32_t *id = me->walker.scanner.block.id;
    int32_t       *to = hs_output_next(&part->pairs, HS_WANT_J);
    for (int32_t h = 0; h < n; h++) {
        to[h] = id[labels[h]];
    }
    part->pairs.n_pairs += n;
    part->bundles[part->n_bundles - 1].end = part->pairs.n_pairs;
}

/* Hits of one run with this shift, or the opposite one; in the last bundle if that has it, too. */
static bool
add_shifted(worker *me, int32_t si, const int32_t *labels, int32_t n, const int32_t *shift,
            bool turned)
{
    const int m = me->walker.scanner.search->bins.n_periodic;
    hs_part  *part = &me->piece->shifted;
    int32_t   own[HS_MAX_DIM];
    for (int r = 0; r < m; r++) {
        own[r] = turned ? -shift[r] : shift[r];
    }
    const int64_t last = part->n_bundles - 1;
    const size_t  size = (size_t)m * sizeof *own;
    if (last < 0 || part->bundles[last].point != si ||
        memcmp(part->shift + last * m, own, size) != 0) {
        if (add_bundle(part, si, m) == NULL) {
            return false;
        }
        memcpy(part->shift + (part->n_bundles - 1) * m, own, size);
    }
    add_pairs(me, part, labels, n);
    return true;
}

/* Hits of one run that is in another image. A point that is its own neighbour has a first shift
 * that is positive. */
static bool
add_run(worker *me, int32_t si, const int32_t *labels, int32_t n, const int32_t *shift)
{
    const int32_t *id = me->walker.scanner.block.id;
    if (!is_negative(shift, me->walker.scanner.search->bins.n_periodic)) {
        return add_shifted(me, si, labels, n, shift, false);
    }
    for (int32_t h = 0, next; h < n; h = next) {
        const bool own = id[labels[h]] == si;
        for (next = h + 1; next < n && (id[labels[next]] == si) == own; next++) {
        }
        if (!add_shifted(me, si, labels + h, next - h, shift, own)) {
            return false;
        }
    }
    return true;
}

/* The hits of one point, whose places in the block ascend, as do its runs. */
static bool
add_row(worker *me, int32_t si, const int32_t *labels, int32_t n)
{
    const int     m = me->walker.scanner.search->bins.n_periodic;
    const hs_run *runs = me->walker.scanner.block.runs;
    bool          is_open = false; /* its bundle without an image */
    for (int32_t h = 0, next, r = 0; h < n; h = next) {
        while (runs[r + 1].at <= labels[h]) {
            r++;
        }
        for (next = h + 1; next < n && labels[next] < runs[r + 1].at; next++) {
        }
        if (me->is_shifted[r]) {
            if (!add_run(me, si, labels + h, next - h, me->shift + (int64_t)r * m)) {
                return false;
            }
            continue;
        }
        if (!is_open && add_bundle(&me->piece->plain, si, 0) == NULL) {
            return false;
        }
        is_open = true;
        add_pairs(me, &me->piece->plain, labels + h, next - h);
    }
    return true;
}

/* The hits of one point where the whole block is in its image. */
static bool
add_plain_row(worker *me, int32_t si, const int32_t *labels, int32_t n)
{
    if (n > 0) {
        if (add_bundle(&me->piece->plain, si, 0) == NULL) {
            return false;
        }
        add_pairs(me, &me->piece->plain, labels, n);
    }
    return true;
}

/* A hs_visit_fn. */
static hs_status
take_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    worker       *me = context;
    const int32_t n = hits->end[hits->n - 1];
    if (!look_at_block(me)) {
        scanner->failed_point = first;
        return HS_ERR_SHIFT_RANGE;
    }
    hs_status status = hs_output_reserve(&me->piece->plain.pairs, n, 0.0);
    if (status == HS_OK && me->has_images) {
        status = hs_output_reserve(&me->piece->shifted.pairs, n, 0.0);
    }
    for (int32_t row = 0, begin = 0; status == HS_OK && row < hits->n; row++) {
        const int32_t *labels = hits->label + begin, of_row = hits->end[row] - begin;
        if (!(me->has_images ? add_row(me, first + row, labels, of_row)
                             : add_plain_row(me, first + row, labels, of_row))) {
            status = HS_ERR_MEMORY;
        }
        begin = hits->end[row];
    }
    return status;
}

/* A hs_range_fn: a piece. */
static hs_status
search_piece(void *context, int64_t piece)
{
    worker          *me = context;
    const hs_search *search = me->search;
    const int64_t    n = search->bins.n, n_pieces = me->pieces->n;
    me->piece = &me->pieces->of[piece];
    hs_output_reserve_hint(&me->piece->plain.pairs, search->grid.expected_pairs / (double)n_pieces);
    return hs_walk_or_tell(&me->walker, (int32_t)(n * piece / n_pieces),
                           (int32_t)(n * (piece + 1) / n_pieces), &me->committer.failure);
}

/* What the threads share. */
typedef struct piece_job {
    hs_search *search;
    hs_pieces *pieces;
} piece_job;

static hs_status
open_worker(void *context, void *place)
{
    const piece_job *job = context;
    hs_search       *search = job->search;
    worker          *me = place;
    me->committer.options = &me->walker.scanner.options;
    me->search = search;
    me->pieces = job->pieces;
    me->block = -1;
    const hs_status status =
        hs_walker_init(search, HS_BLOCK_LISTS_PLACES, take_hits, me, &me->walker);
    if (status != HS_OK) {
        return status;
    }
    hs_account     *account = &search->call->account;
    const hs_block *block = &me->walker.scanner.block;
    const int64_t   n_runs = block->most_runs + 1, m = search->bins.n_periodic;
    me->is_shifted = hs_alloc(account, HS_FOR_CANDIDATES, n_runs, sizeof *me->is_shifted);
    me->shift = hs_alloc(account, HS_FOR_CANDIDATES, n_runs * m, sizeof *me->shift);
    const bool complete = me->is_shifted != NULL && me->shift != NULL;
    return complete ? HS_OK : HS_ERR_MEMORY;
}

static void
close_worker(void *context, void *place)
{
    const piece_job *job = context;
    hs_account      *account = &job->search->call->account;
    worker          *me = place;
    hs_walker_close(job->search, &me->walker);
    hs_free(account, me->shift);
    hs_free(account, me->is_shifted);
}

static void
free_part(hs_part *part)
{
    hs_output_free(&part->pairs);
    hs_free(NULL, part->bundles);
    hs_free(NULL, part->shift);
}

void
hs_pieces_free(hs_account *account, hs_pieces *pieces)
{
    for (int64_t p = 0; pieces->of != NULL && p < pieces->n; p++) {
        free_part(&pieces->of[p].plain);
        free_part(&pieces->of[p].shifted);
    }
    hs_free(account, pieces->of);
    *pieces = (hs_pieces){0};
}

hs_status
hs_pieces_find(hs_search *search, hs_pieces *pieces, hs_failure *failure)
{
    pieces->n = search->call->team == NULL ? 1 : PIECES_A_THREAD * hs_team_size(search->call->team);
    pieces->of = hs_alloc(&search->call->account, HS_FOR_CANDIDATES, pieces->n, sizeof *pieces->of);
    if (pieces->of == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(pieces->of, 0, (size_t)pieces->n * sizeof *pieces->of);
    for (int64_t p = 0; p < pieces->n; p++) {
        hs_output_init(NULL, search->scene.ndim, HS_WANT_J, 4, &pieces->of[p].plain.pairs);
        hs_output_init(NULL, search->scene.ndim, HS_WANT_J, 4, &pieces->of[p].shifted.pairs);
    }
    piece_job       job = {.search = search, .pieces = pieces};
    hs_crew         crew = {.call = search->call,
                            .job = &job,
                            .worker_size = sizeof(worker),
                            .open = open_worker,
                            .close = close_worker,
                            .n_ranges = pieces->n,
                            .search = search_piece};
    const hs_status status = hs_crew_run(&crew, failure);
    if (status != HS_OK) {
        hs_pieces_free(&search->call->account, pieces);
    }
    return status;
}

/* A hash table with open addressing. */

#define FIRST_CAPACITY 64 /* the 26 images next to a box, and some room */

/* An empty table. */
static void
images_init(int width, hs_images *images)
{
    *images = (hs_images){.width = width};
}

/* Idempotent. */
static void
images_free(hs_images *images)
{
    hs_free(NULL, images->of);
    hs_free(NULL, images->slots);
    images_init(images->width, images);
}

/* Where the shift is, or the empty slot where it belongs. */
static int64_t
find_slot(const hs_images *images, const int32_t *shift)
{
    const uint64_t mask = 2 * (uint64_t)images->capacity - 1;
    uint64_t       hash = 0;
    for (int k = 0; k < images->width; k++) { /* Fibonacci hashing of one number after the other */
        hash = (hash ^ (uint32_t)shift[k]) * UINT64_C(0x9e3779b97f4a7c15);
        hash ^= hash >> 29;
    }
    const size_t size = (size_t)images->width * sizeof *shift;
    for (uint64_t slot = hash & mask;; slot = (slot + 1) & mask) {
        const int32_t number = images->slots[slot];
        if (number < 0 || memcmp(images->of + (int64_t)number * images->width, shift, size) == 0) {
            return (int64_t)slot;
        }
    }
}

static bool
grow(hs_images *images)
{
    hs_images larger = {.width = images->width, .n = images->n};
    larger.capacity = images->capacity > 0 ? 2 * images->capacity : FIRST_CAPACITY;
    if (larger.capacity > INT32_MAX / 2) {
        return false;
    }
    larger.of = hs_alloc(NULL, HS_FOR_SHIFTS, larger.capacity * larger.width, sizeof(int32_t));
    larger.slots = hs_alloc(NULL, HS_FOR_SHIFTS, 2 * larger.capacity, sizeof(int32_t));
    if (larger.of == NULL || larger.slots == NULL) {
        images_free(&larger);
        return false;
    }
    memset(larger.slots, -1, 2 * (size_t)larger.capacity * sizeof(int32_t));
    for (int64_t number = 0; number < larger.n; number++) {
        const int32_t *shift = images->of + number * images->width;
        memcpy(larger.of + number * larger.width, shift, (size_t)images->width * sizeof(int32_t));
        larger.slots[find_slot(&larger, shift)] = (int32_t)number;
    }
    images_free(images);
    *images = larger;
    return true;
}

int32_t
hs_images_number(hs_images *images, const int32_t *shift)
{
    const size_t size = (size_t)images->width * sizeof *shift;
    if (images->n > 0 &&
        memcmp(images->of + (int64_t)images->last * images->width, shift, size) == 0) {
        return images->last;
    }
    if (images->n == images->capacity && !grow(images)) {
        return -1;
    }
    const int64_t slot = find_slot(images, shift);
    if (images->slots[slot] < 0) {
        memcpy(images->of + images->n * images->width, shift, size);
        images->slots[slot] = (int32_t)images->n++;
    }
    images->last = images->slots[slot];
    return images->last;
}

/*
 * The list of one step. It is a search whose points are numbered in cell order,
 * so that neighbours lie close together in memory when the list is used, and whose shifts are those
 * of the wrapped points, so that few of them are not zero.
 */

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
    images_free(&listing->images);
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
    /* The pieces, which the account is not charged for, and the listing. */
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
write_listing(building *built)
{
    hs_search *search = &built->search;
    placing    place = {.built = built};
    images_init(search->scene.lattice.n_periodic, &built->listing->images);
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
        status = write_listing(built);
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
    images_init(0, &next.images);
    next.turn = 1 - listing->turn;
    built->listing = &next;
    built->pieces = (hs_pieces){0};
    hs_call_begin(&searching, &built->call);
    const hs_status status = build(frame, built, failure);
    hs_call_dismiss(&built->call);
    hs_account_close(&built->call.account);
    hs_free(NULL, built);
    if (status == HS_OK) {
        images_free(&listing->images);
        *listing = next;
    } else { /* stores that are not in use may have grown */
        images_free(&next.images);
        listing->for_order[next.turn] = next.for_order[next.turn];
        listing->for_counts[next.turn] = next.for_counts[next.turn];
    }
    return status;
}

/* One loop for each common type and number of dimensions; maxima in several chains,
 * for one would wait for itself. */

#define CHAINS 8

HS_ALWAYS_INLINE void
subtract(const hs_tracking *track, hs_tile *t, const hs_real real, const int d, const bool deformed)
{
    const void   *now = track->motion->now->rows, *built = track->motion->built->rows;
    const int64_t first = t->first * d, step = t->step * d;
    for (int p = 0; p < t->n; p++) {
        for (int k = 0; k < d; k++) {
            const int64_t e = first + p * step + k;
            double        before = 0.0;
            for (int c = 0; deformed && c < d; c++) {
                before += hs_frame_entry(built, real, e - k + c) * track->strain.F[c][k];
            }
            before = deformed ? before : hs_frame_entry(built, real, e);
            t->u[k][p] = hs_frame_entry(now, real, e) - before;
        }
    }
}

/* subtract, with constants where that pays. */
static void
find_displacements(const hs_tracking *track, hs_tile *t)
{
    const hs_real real = track->motion->now->points.real;
    const int     d = track->motion->now->points.ndim;
    switch (8 * (real == HS_FLOAT32) + 4 * track->deformed + (d == 2 || d == 3 ? d : 0)) {
    case 2: subtract(track, t, HS_FLOAT64, 2, false); break;
    case 3: subtract(track, t, HS_FLOAT64, 3, false); break;
    case 7: subtract(track, t, HS_FLOAT64, 3, true); break;
    case 10: subtract(track, t, HS_FLOAT32, 2, false); break;
    case 11: subtract(track, t, HS_FLOAT32, 3, false); break;
    case 15: subtract(track, t, HS_FLOAT32, 3, true); break;
    default: subtract(track, t, real, d, track->deformed);
    }
    for (int k = 0; track->has_base && k < d; k++) {
        for (int p = 0; p < t->n; p++) {
            t->u[k][p] -= track->base[k];
        }
    }
}

/* Takes whole box vectors from u of point p. Returns whether that is known to have worked; sets
 * `given`, over the box vectors as given. */
static bool
take_jump(hs_tracking *track, hs_tile *t, int p, int64_t *given)
{
    double  u[HS_MAX_DIM], inside[HS_MAX_DIM];
    int64_t turns[HS_MAX_DIM];
    for (int k = 0; k < track->lattice.ndim; k++) {
        u[k] = t->u[k][p];
    }
    if (!hs_wrap_point(&track->lattice, u, inside, turns, &track->magnitude)) {
        return false;
    }
    (void)hs_lattice_shift(&track->lattice, turns, given); /* these fit: hs_wrap_point found it */
    for (int k = 0; k < track->lattice.ndim; k++) {
        t->u[k][p] = inside[k];
    }
    return true;
}

/* No jumps yet. */
static bool
start_jumps(hs_tracking *track)
{
    const int64_t n = track->motion->now->points.n * track->m;
    track->jump_of = hs_store_reserve(track->jumps, HS_FOR_WRAPS, n, sizeof *track->jump_of);
    if (track->jump_of != NULL) {
        memset(track->jump_of, 0, (size_t)n * sizeof *track->jump_of);
    }
    return track->jump_of != NULL;
}

/* The longest of the tile, less drift, to *square and *component. */
HS_ALWAYS_INLINE void
find_longest(hs_tile *t, const int d, const double *drift, double *square, double *component)
{
    double most[CHAINS] = {0.0}, longest[CHAINS] = {0.0};
    for (int p = t->n; p % CHAINS != 0; p++) { /* the last one again */
        for (int k = 0; k < d; k++) {
            t->u[k][p] = t->u[k][t->n - 1];
        }
    }
    for (int p = 0; p < t->n; p += CHAINS) {
        double sum[CHAINS] = {0.0};
        for (int k = 0; k < d; k++) {
            for (int c = 0; c < CHAINS; c++) {
                const double u = t->u[k][p + c] - drift[k];
                sum[c] += u * u;
                longest[c] = hs_larger(fabs(u), longest[c]);
            }
        }
        for (int c = 0; c < CHAINS; c++) {
            most[c] = hs_larger(sum[c], most[c]);
        }
    }
    for (int c = 0; c < CHAINS; c++) {
        *square = hs_larger(most[c], *square);
        *component = hs_larger(longest[c], *component);
    }
}

/* The longest of the tile, less drift, to *square and *component, which are not lowered. */
static void
measure_tile(hs_tile *t, int d, const double *drift, double *square, double *component)
{
    switch (d) {
    case 2: find_longest(t, 2, drift, square, component); break;
    case 3: find_longest(t, 3, drift, square, component); break;
    default: find_longest(t, d, drift, square, component);
    }
}

/* Displacements of up to HS_TILE points from `first` on; their longest to *square and *component.
 * Returns whether some point may have jumped. */
static bool
look_at_tile(const hs_tracking *track, int64_t first, int64_t step, hs_tile *t, double *square,
             double *component)
{
    const double  none[HS_MAX_DIM] = {0.0};
    const int64_t left = (track->motion->now->points.n - first + step - 1) / step;
    t->first = first;
    t->step = step;
    t->n = left < HS_TILE ? (int)left : HS_TILE;
    *square = *component = 0.0;
    find_displacements(track, t);
    measure_tile(t, track->motion->now->points.ndim, none, square, component);
    return track->m > 0 && !(*component < track->jump);
}

/* Takes and keeps the jumps of the points of a tile. HS_REBUILD: some point went too far to
 * tell. */
static hs_status
take_jumps(hs_tracking *track, hs_tile *t)
{
    const int m = track->m;
    for (int p = 0; p < t->n; p++) {
        int64_t  given[HS_MAX_DIM];
        uint64_t any = 0;
        if (!hs_may_be_jump(track, t, p)) {
            continue;
        }
        if (!take_jump(track, t, p, given)) {
            return HS_REBUILD;
        }
        for (int r = 0; r < m; r++) {
            any |= (uint64_t)given[r];
        }
        if (any != 0 && track->jump_of == NULL && !start_jumps(track)) {
            return HS_ERR_MEMORY;
        }
        for (int r = 0; any != 0 && r < m; r++) {
            track->jump_of[(t->first + p) * m + r] = given[r];
        }
    }
    return HS_OK;
}

/*
 * Chooses F, k and c (pair_list.h), and what the longest displacement leaves of the skin.
 * Any F, k and c are right; good ones make displacements small. c is `base`, taken away before box
 * vectors are looked for, and `drift`, taken away behind that.
 */

#define UNIT   0x1p-53
#define GROW   (1.0 + 0x1p-40) /* more than the roundings of any bound here */
#define SAMPLE 1024            /* points that the drift is guessed from */
/* A drift is taken away where the sample gets this much shorter: small ones are not worth it. */
#define WORTHWHILE 0.8
/* A displacement of this share of the box's smallest height may be a jump. */
#define JUMP 0.25

/* Points that all went far share that, or most of it: the displacement of one of them. */
static void
find_base(hs_tracking *track)
{
    const int64_t n = track->motion->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    int64_t       count = 0, far = 0;
    double        base[HS_MAX_DIM] = {0.0}, square, component;
    hs_tile       t;
    for (int64_t i = 0; track->m > 0 && i < n; i += HS_TILE * step, count += t.n) {
        const bool any = look_at_tile(track, i, step, &t, &square, &component);
        for (int p = 0; any && p < t.n; p++) {
            if (hs_may_be_jump(track, &t, p)) {
                for (int k = 0; far == 0 && k < track->lattice.ndim; k++) {
                    base[k] = t.u[k][p];
                }
                far++;
            }
        }
    }
    if (2 * far > count) {
        track->has_base = true;
        memcpy(track->base, base, sizeof base);
    }
}

/* Displacements of the points of a sample without jumps: their sum and range in the first pass,
 * and the longest less drift. */
typedef struct sample {
    double sum[HS_MAX_DIM], lower[HS_MAX_DIM], upper[HS_MAX_DIM];
    double count, square, component;
} sample;

static void
take_sample(hs_tracking *track, const double *drift, sample *found)
{
    const int64_t n = track->motion->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    const int     d = track->motion->now->points.ndim;
    double        square, component;
    hs_tile       t;
    *found = (sample){.count = 0.0};
    for (int64_t i = 0; i < n; i += HS_TILE * step) {
        const bool any = look_at_tile(track, i, step, &t, &square, &component);
        for (int p = 0; p < t.n; p++) {
            if (any && hs_may_be_jump(track, &t, p)) {
                int64_t given[HS_MAX_DIM];
                (void)take_jump(track, &t, p, given); /* a failure shows again in the full pass */
            }
            for (int k = 0; k < d; k++) {
                const double u = t.u[k][p];
                found->sum[k] += u;
                found->lower[k] = i + p == 0 ? u : hs_smaller(u, found->lower[k]);
                found->upper[k] = i + p == 0 ? u : hs_larger(u, found->upper[k]);
            }
        }
        found->count += t.n;
        measure_tile(&t, d, drift, &found->square, &found->component);
    }
}

/* The drift of a sample: the mean, or where the sample is all there is the middle of the range. */
static void
guess_drift(hs_tracking *track)
{
    sample    all, rest;
    double    drift[HS_MAX_DIM] = {0.0};
    const int d = track->motion->now->points.ndim;
    take_sample(track, drift, &all);
    for (int k = 0; all.count > 0.0 && k < d; k++) {
        drift[k] = track->motion->now->points.n <= SAMPLE ? 0.5 * all.lower[k] + 0.5 * all.upper[k]
                                                          : all.sum[k] / all.count;
    }
    take_sample(track, drift, &rest);
    if (rest.square < WORTHWHILE * WORTHWHILE * all.square) {
        track->has_drift = true;
        memcpy(track->drift, drift, sizeof drift);
    }
}

/* At least the longest |u| as computed: 2^-47 is more than the roundings of square and root. */
static double
longest_computed(const hs_tracking *track)
{
    if (track->component == 0.0) {
        return 0.0;
    }
    if (track->square >= 0x1p-900 && track->square <= 0x1p1000) {
        return sqrt(track->square) * (1.0 + 0x1p-47);
    }
    return hs_next_up(3.0 * track->component); /* sqrt(8) < 3; squares may be lost or infinite */
}

/* How far a computed u may be from the true one. Zero where nothing was rounded. */
static double
bound_rounding(const hs_tracking *track)
{
    const hs_motion *motion = track->motion;
    const int        d = motion->now->points.ndim;
    const double     now = motion->now->largest, built = motion->built->largest;
    double           bound = 0.0;
    for (int k = 0; k < d; k++) {
        bound += 2.0 * UNIT * fabs(track->drift[k]); /* of a u near it, and of the difference */
    }
    const double sizes = now + built * (track->deformed ? track->strain.column_sum : 1.0);
    if (track->deformed) { /* d products, d sums and a difference of these sizes */
        bound += (2 * d + 4) * UNIT * sizes + 0x1p-1050;
    }
    for (int k = 0; track->has_base && k < d; k++) { /* two differences */
        bound += 2.0 * UNIT * (sizes + fabs(track->base[k]));
    }
    if (track->jump_of != NULL) { /* a difference, wrapped: hs_wrap_point bounds its error */
        const double terms = 2 * track->m + 2;
        bound += 2.0 * UNIT * (sizes + track->magnitude) +
                 terms * terms * 0x1p-104 * track->magnitude + 0x1p-1050;
    }
    return 3.0 * bound * GROW; /* of each component; sqrt(d) < 3 */
}

/* What is left of the skin. Each step is rounded to the safe side. */
static double
find_margin(const hs_tracking *track)
{
    const hs_motion *motion = track->motion;
    double           reach = motion->radius;
    double           used = longest_computed(track) + bound_rounding(track);
    used = used > 0.0 ? 2.0 * hs_next_up(used) : used; /* nothing is nothing */
    if (track->deformed) {
        /* No two points are farther apart than 2 sqrt(d) times the largest coordinate. */
        const double apart = 6.0 * motion->built->largest;
        reach = hs_next_down(reach * track->strain.shrink);
        used = hs_next_up(used + hs_next_up(track->strain.residual * apart) * GROW);
    }
    const double room = reach - motion->cutoff;
    const double margin = (room > 0.0 && motion->cutoff > 0.0 ? hs_next_down(room) : room) - used;
    return margin > 0.0 && used > 0.0 ? hs_next_down(margin) : margin;
}

static hs_status
start(const hs_motion *motion, hs_store *jumps, hs_tracking *track)
{
    int row[HS_MAX_DIM];
    memset(track, 0, sizeof *track);
    track->motion = motion;
    track->jumps = jumps;
    track->m = hs_frame_periodic(motion->now, row);
    track->jump = INFINITY;
    if (track->m == 0) {
        return HS_OK;
    }
    track->deformed = !hs_frames_share_box(motion->built, motion->now);
    if (track->deformed &&
        !hs_strain_find(&motion->built->box, &motion->now->box, &track->strain)) {
        return HS_REBUILD;
    }
    hs_lattice_init(&motion->now->box, motion->now->points.ndim, hs_scale_of(0), &track->lattice);
    for (int k = 0; k < track->lattice.ndim; k++) {
        if (track->lattice.row_of_axis[k] >= 0) {
            track->jump = hs_smaller(JUMP * track->lattice.period[k], track->jump);
        }
    }
    return track->jump > 0.0 ? HS_OK : HS_REBUILD;
}

static hs_status
measure_all(hs_tracking *track, const hs_options *options)
{
    const int64_t n = track->motion->now->points.n;
    hs_tile       t;
    for (int64_t first = 0; first < n; first += HS_TILE) {
        double     square, component;
        const bool any = look_at_tile(track, first, 1, &t, &square, &component);
        hs_status  status = any ? take_jumps(track, &t) : HS_OK;
        if (status == HS_OK && (any || track->has_drift)) {
            measure_tile(&t, track->motion->now->points.ndim, track->drift, &track->square,
                         &track->component);
        } else {
            track->square = hs_larger(square, track->square);
            track->component = hs_larger(component, track->component);
        }
        if (status == HS_OK && (first + HS_TILE) % HS_POLL_POINTS == 0) {
            status = hs_poll(options, 0.0);
        }
        if (status != HS_OK) {
            return status;
        }
    }
    return HS_OK;
}

hs_status
hs_motion_margin(const hs_motion *motion, const hs_options *options, double *margin, bool *jumped,
                 hs_store *jumps)
{
    hs_tracking track;
    hs_status   status = start(motion, jumps, &track);
    *margin = -INFINITY;
    *jumped = false;
    if (status == HS_OK) {
        find_base(&track);
        guess_drift(&track);
        status = measure_all(&track, options);
    }
    if (status == HS_OK) {
        const double found = find_margin(&track);
        *margin = found == found ? found : -INFINITY;
        *jumped = track.jump_of != NULL;
    }
    return status == HS_REBUILD ? HS_OK : status;
}
