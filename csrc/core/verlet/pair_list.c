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

/* A hash table with open addressing. */

#define FIRST_CAPACITY 64 /* the 26 images next to a box, and some room */

/* Idempotent. */
static void
images_free(hs_images *images)
{
    hs_free(NULL, images->of);
    hs_free(NULL, images->slots);
    *images = (hs_images){.width = images->width};
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
 * The pairs of a search in pieces, one for each range of its points, by several threads. Which
 * pieces there are depends on the number of threads, what follows from one to the next does not.
 * Points are told by their places in cell order. Few pairs have a shift, those that are in
 * different images once the points are wrapped, and each piece keeps them apart. Each thread has a
 * walker; shifts are looked up once for each run of a block.
 */

#define PIECES_A_THREAD 4 /* so that none waits long for the others */
#define FIRST_BUNDLES   256

/* Some pairs of a piece, as in a hs_listing. */
typedef struct some_pairs {
    hs_output  pairs;   /* b of each, in its column j; counted by no account */
    hs_bundle *bundles; /* owned; ends are places in this part, images those of the piece */
    int64_t    n_bundles, capacity;
    int64_t    first_pair, first_bundle; /* of it, in the listing */
} some_pairs;

typedef struct piece {
    some_pairs plain, shifted;
    hs_images  images; /* over the box vectors that repeat, as given */
} piece;

/* A search, and what it has found in cell order. */
typedef struct building {
    hs_call     call;
    hs_search   search;
    int64_t     n;       /* pieces */
    piece      *pieces;  /* owned */
    hs_listing *listing; /* borrowed: what it becomes; its stores are those of the list in use */
} building;

/* What one thread works with. */
typedef struct worker {
    hs_committer committer;
    building    *built; /* borrowed */
    hs_walker    walker;
    piece       *piece; /* that it is working on */
    /* Of the block that was looked at last: */
    int64_t  block; /* candidates tested before it, which tells blocks apart; -1: none */
    bool     has_images;
    int32_t *image; /* owned; number in the piece of that of each run; -1: none */
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

/* Finds the images of the runs of a block, once. HS_ERR_SHIFT_RANGE, HS_ERR_MEMORY. */
static hs_status
look_at_block(worker *me)
{
    const hs_scanner *scanner = &me->walker.scanner;
    const hs_block   *block = &scanner->block;
    const int         m = scanner->search->bins.n_periodic;
    if (me->block == scanner->n_candidates) {
        return HS_OK;
    }
    me->block = scanner->n_candidates;
    me->has_images = false;
    for (int32_t r = 0; m > 0 && block->runs[r].at < block->n; r++) {
        int32_t shift[HS_MAX_DIM], any = 0;
        for (int k = 0; k < m; k++) {
            any |= block->runs[r].image[k];
        }
        me->image[r] = -1;
        if (any != 0) {
            if (!shift_of_run(scanner->search, &block->runs[r], shift)) {
                return HS_ERR_SHIFT_RANGE;
            }
            me->has_images = true;
            me->image[r] = hs_images_number(&me->piece->images, shift);
            if (me->image[r] < 0) {
                return HS_ERR_MEMORY;
            }
        }
    }
    return HS_OK;
}

/* n hits of one run to a part: in its last bundle if that is of this point and image, else in a new
 * one. False when memory is refused. */
static bool
add_pairs(worker *me, some_pairs *part, int32_t si, int32_t image, const int32_t *labels, int32_t n)
{
    const int32_t *id = me->walker.scanner.block.id;
    hs_bundle     *last = part->n_bundles > 0 ? &part->bundles[part->n_bundles - 1] : NULL;
    if (last == NULL || last->point != si || last->image != image) {
        if (part->n_bundles == part->capacity) {
            const int64_t capacity = part->capacity > 0 ? 2 * part->capacity : FIRST_BUNDLES;
            hs_bundle    *more = hs_grow(NULL, HS_FOR_INDICES, part->bundles, part->n_bundles,
                                         capacity, sizeof *more);
            if (more == NULL) {
                return false;
            }
            part->bundles = more;
            part->capacity = capacity;
        }
        last = &part->bundles[part->n_bundles++];
        *last = (hs_bundle){.point = si, .image = image};
    }
    int32_t *to = hs_output_next(&part->pairs, HS_WANT_J);
    for (int32_t h = 0; h < n; h++) {
        to[h] = id[labels[h]];
    }
    part->pairs.n_pairs += n;
    last->end = part->pairs.n_pairs;
    return true;
}

/* Hits of one run that is in another image. A point that is its own neighbour has a first shift
 * that is positive. */
static bool
add_run(worker *me, int32_t si, const int32_t *labels, int32_t n, int32_t image)
{
    hs_images     *images = &me->piece->images;
    const int32_t *id = me->walker.scanner.block.id;
    const int32_t *shift = images->of + (int64_t)image * images->width;
    int32_t        opposite[HS_MAX_DIM], first = 0;
    for (int r = images->width - 1; r >= 0; r--) {
        opposite[r] = -shift[r];
        first = shift[r] != 0 ? shift[r] : first;
    }
    for (int32_t h = 0, next; h < n; h = next) {
        const bool    turned = first < 0 && id[labels[h]] == si;
        const int32_t number = turned ? hs_images_number(images, opposite) : image;
        for (next = h + 1; next < n && (first < 0 && id[labels[next]] == si) == turned; next++) {
        }
        if (number < 0 || !add_pairs(me, &me->piece->shifted, si, number, labels + h, next - h)) {
            return false;
        }
    }
    return true;
}

/* The hits of one point, whose places in the block ascend, as do its runs. */
static bool
add_row(worker *me, int32_t si, const int32_t *labels, int32_t n)
{
    const hs_run *runs = me->walker.scanner.block.runs;
    bool          fits = true;
    if (!me->has_images) {
        return n == 0 || add_pairs(me, &me->piece->plain, si, 0, labels, n);
    }
    for (int32_t h = 0, next, r = 0; h < n && fits; h = next) {
        while (runs[r + 1].at <= labels[h]) {
            r++;
        }
        for (next = h + 1; next < n && labels[next] < runs[r + 1].at; next++) {
        }
        fits = me->image[r] < 0 ? add_pairs(me, &me->piece->plain, si, 0, labels + h, next - h)
                                : add_run(me, si, labels + h, next - h, me->image[r]);
    }
    return fits;
}

/* A hs_visit_fn. */
static hs_status
take_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    worker       *me = context;
    const int32_t n = hits->end[hits->n - 1];
    hs_status     status = look_at_block(me);
    if (status == HS_ERR_SHIFT_RANGE) {
        scanner->failed_point = first;
    }
    if (status == HS_OK) {
        status = hs_output_reserve(&me->piece->plain.pairs, n, 0.0);
    }
    if (status == HS_OK && me->has_images) {
        status = hs_output_reserve(&me->piece->shifted.pairs, n, 0.0);
    }
    for (int32_t row = 0, begin = 0; status == HS_OK && row < hits->n; begin = hits->end[row++]) {
        if (!add_row(me, first + row, hits->label + begin, hits->end[row] - begin)) {
            status = HS_ERR_MEMORY;
        }
    }
    return status;
}

/* A hs_range_fn: a piece. */
static hs_status
search_piece(void *context, int64_t number)
{
    worker          *me = context;
    const hs_search *search = &me->built->search;
    const int64_t    n = search->bins.n, n_pieces = me->built->n;
    me->piece = &me->built->pieces[number];
    me->block = -1; /* its images have other numbers */
    hs_output_reserve_hint(&me->piece->plain.pairs, search->grid.expected_pairs / (double)n_pieces);
    return hs_walk_or_tell(&me->walker, (int32_t)(n * number / n_pieces),
                           (int32_t)(n * (number + 1) / n_pieces), &me->committer.failure);
}

static hs_status
open_worker(void *context, void *place)
{
    building  *built = context;
    hs_search *search = &built->search;
    worker    *me = place;
    me->committer.options = &me->walker.scanner.options;
    me->built = built;
    const hs_status status =
        hs_walker_init(search, HS_BLOCK_LISTS_PLACES, take_hits, me, &me->walker);
    if (status != HS_OK) {
        return status;
    }
    const int64_t n_runs = me->walker.scanner.block.most_runs + 1;
    me->image = hs_alloc(&search->call->account, HS_FOR_CANDIDATES, n_runs, sizeof *me->image);
    return me->image != NULL ? HS_OK : HS_ERR_MEMORY;
}

static void
close_worker(void *context, void *place)
{
    hs_search *search = &((building *)context)->search;
    worker    *me = place;
    hs_walker_close(search, &me->walker);
    hs_free(&search->call->account, me->image);
}

/* All pairs. search->bins.order must be 0, 1, 2, ... HS_ERR_SHIFT_RANGE sets failure->row, a
 * place. */
static hs_status
find_pieces(building *built, hs_failure *failure)
{
    hs_call  *call = &built->call;
    const int d = built->search.scene.ndim, m = built->search.scene.lattice.n_periodic;
    built->n = call->team == NULL ? 1 : PIECES_A_THREAD * hs_team_size(call->team);
    built->pieces = hs_alloc(&call->account, HS_FOR_CANDIDATES, built->n, sizeof *built->pieces);
    if (built->pieces == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(built->pieces, 0, (size_t)built->n * sizeof *built->pieces);
    for (int64_t p = 0; p < built->n; p++) {
        hs_output_init(NULL, d, HS_WANT_J, 4, &built->pieces[p].plain.pairs);
        hs_output_init(NULL, d, HS_WANT_J, 4, &built->pieces[p].shifted.pairs);
        built->pieces[p].images.width = m;
    }
    hs_crew crew = {.call = call,
                    .job = built,
                    .worker_size = sizeof(worker),
                    .open = open_worker,
                    .close = close_worker,
                    .n_ranges = built->n,
                    .search = search_piece};
    return hs_crew_run(&crew, failure);
}

static void
free_part(some_pairs *part)
{
    hs_output_free(&part->pairs);
    hs_free(NULL, part->bundles);
}

/*
 * The list of one step. It is a search whose points are numbered in cell order, so that neighbours
 * lie close together in memory when the list is used, and whose shifts are those of the wrapped
 * points, so that few of them are not zero.
 */

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

/* Renumbers the points by their places in cell order, and stores by how many given box vectors each
 * was wrapped, or nothing where none was: shifts are images alone from here on. */
static hs_status
renumber(hs_search *search, hs_listing *listing, hs_failure *failure)
{
    hs_bins  *bins = &search->bins;
    const int m = bins->n_periodic;
    int64_t   any = 0;
    listing->order = hs_store_reserve(&listing->for_order[listing->turn], HS_FOR_ORDER, bins->n,
                                      sizeof *listing->order);
    if (m > 0) {
        HS_ASSERT(bins->turns.known);
        listing->counts = hs_store_reserve(&listing->for_counts[listing->turn], HS_FOR_WRAPS,
                                           bins->n * m, sizeof *listing->counts);
    }
    if (listing->order == NULL || (m > 0 && listing->counts == NULL)) {
        return HS_ERR_MEMORY;
    }
    for (int64_t si = 0; si < bins->n; si++) {
        int64_t turns[HS_MAX_DIM], *counts = m > 0 ? listing->counts + si * m : NULL;
        for (int r = 0; r < m; r++) {
            turns[r] = hs_turns_get(&bins->turns, r, si);
        }
        if (m > 0 && !hs_lattice_shift(&search->scene.lattice, turns, counts)) {
            failure->row = bins->order[si];
            return HS_ERR_SHIFT_RANGE;
        }
        for (int r = 0; r < m; r++) {
            any |= counts[r];
        }
        listing->order[si] = bins->order[si];
        bins->order[si] = (int32_t)si;
    }
    listing->counts = any != 0 ? listing->counts : NULL;
    if (!bins->keeps_originals) {
        bins->turns.known = false; /* they are not needed any more */
    }
    return HS_OK;
}

static void
place_part(const some_pairs *part, hs_listing *listing)
{
    if (part->pairs.n_pairs == 0) {
        return;
    }
    memcpy(listing->j + part->first_pair, hs_output_column(&part->pairs, HS_WANT_J),
           (size_t)part->pairs.n_pairs * sizeof *listing->j);
    for (int64_t b = 0; b < part->n_bundles; b++) {
        listing->bundles[part->first_bundle + b] = part->bundles[b];
        listing->bundles[part->first_bundle + b].end += part->first_pair;
    }
}

/* A hs_task_fn: the pairs of one piece to the listing. */
static void
place_piece(void *context, int64_t p)
{
    const building *built = context;
    place_part(&built->pieces[p].plain, built->listing);
    place_part(&built->pieces[p].shifted, built->listing);
}

/* Where a part goes, behind what has been counted so far. */
static void
count_part(some_pairs *part, hs_listing *listing)
{
    part->first_pair = listing->n_pairs;
    part->first_bundle = listing->n_bundles;
    listing->n_pairs += part->pairs.n_pairs;
    listing->n_bundles += part->n_bundles;
}

/* Counts pairs and bundles, those with an image behind all others, and gives the images their
 * numbers in the listing. */
static bool
count_pairs(building *built)
{
    hs_listing *listing = built->listing;
    listing->n_pairs = listing->n_bundles = 0;
    for (int64_t p = 0; p < built->n; p++) {
        count_part(&built->pieces[p].plain, listing);
    }
    listing->n_plain = listing->n_pairs;
    for (int64_t p = 0; p < built->n; p++) {
        const hs_images *images = &built->pieces[p].images;
        some_pairs      *shifted = &built->pieces[p].shifted;
        count_part(shifted, listing);
        for (int64_t b = 0; b < shifted->n_bundles; b++) {
            const int32_t *shift = images->of + (int64_t)shifted->bundles[b].image * images->width;
            shifted->bundles[b].image = hs_images_number(&listing->images, shift);
            if (shifted->bundles[b].image < 0) {
                return false;
            }
        }
    }
    /* The pieces, which the account is not charged for, and the listing. */
    return hs_account_allows(&built->call.account,
                             (double)(2 * sizeof *listing->j) * (double)listing->n_pairs +
                                 (double)(3 * sizeof *listing->bundles) *
                                     (double)listing->n_bundles);
}

/* Writes what was found to the listing. */
static hs_status
write_listing(building *built)
{
    hs_listing *listing = built->listing;
    hs_store    larger = {0}; /* in place of listing->for_j, if that is too small */
    listing->images.width = built->search.scene.lattice.n_periodic;
    if (!count_pairs(built)) {
        return HS_ERR_MEMORY;
    }
    /* The list in use keeps its arrays until the last step that can fail. */
    const int64_t n_j = listing->n_pairs + HS_PADDING;
    const bool    fits = listing->for_j.data != NULL &&
                      n_j * (int64_t)sizeof *listing->j <= listing->for_j.capacity;
    if ((!fits && hs_store_reserve(&larger, HS_FOR_INDICES, n_j, sizeof *listing->j) == NULL) ||
        hs_store_reserve(&listing->for_bundles, HS_FOR_INDICES, listing->n_bundles,
                         sizeof *listing->bundles) == NULL) {
        hs_store_free(&larger);
        return HS_ERR_MEMORY;
    }
    if (!fits) {
        hs_store_free(&listing->for_j);
        listing->for_j = larger;
    }
    listing->j = listing->for_j.data;
    listing->bundles = listing->for_bundles.data;
    memset(listing->j + listing->n_pairs, 0, HS_PADDING * sizeof *listing->j);
    hs_team_run(built->call.team, built->n, place_piece, built);
    return HS_OK;
}

static hs_status
build(const hs_frame *frame, building *built, hs_failure *failure)
{
    hs_call      *call = &built->call;
    hs_listing   *listing = built->listing;
    const hs_sets sets = {.points = &frame->points, .is_plain = true};
    hs_status  status = hs_search_open(&sets, hs_frame_box(frame), call, &built->search, failure);
    const bool opened = status == HS_OK;
    if (status == HS_OK) {
        status = hs_estimate_by_sample(&built->search, failure);
    }
    if (status == HS_OK) {
        status = renumber(&built->search, listing, failure);
    }
    if (status == HS_OK) {
        status = find_pieces(built, failure);
        if (failure->row >= 0) {
            failure->row = listing->order[failure->row];
        }
    }
    if (status == HS_OK) {
        status = write_listing(built);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = fmax(failure->expected_pairs, (double)listing->n_pairs);
    }
    hs_call_tell_limit(call, status, failure);
    for (int64_t p = 0; built->pieces != NULL && p < built->n; p++) {
        free_part(&built->pieces[p].plain);
        free_part(&built->pieces[p].shifted);
        images_free(&built->pieces[p].images);
    }
    hs_free(&call->account, built->pieces);
    if (opened) {
        hs_search_close(&built->search);
    }
    return status;
}

hs_status
hs_listing_build(const hs_frame *frame, const hs_options *options, double radius,
                 hs_listing *listing, hs_failure *failure)
{
    int        row[HS_MAX_DIM];
    hs_options searching = *options;
    hs_listing next = *listing; /* with its stores */
    building  *built = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *built);
    if (built == NULL) {
        return HS_ERR_MEMORY;
    }
    searching.cutoff = radius;
    searching.inclusive = true;
    searching.precision = HS_EXACT;
    searching.sorted = false;
    searching.cell_size = 0.0;
    searching.algorithm = HS_AUTO;
    searching.out = NULL;
    searching.counters = NULL;
    searching.want = HS_WANT_I | HS_WANT_J;
    searching.want |= hs_frame_periodic(frame, row) > 0 ? HS_WANT_SHIFT : 0;
    searching.index_bytes = 4;
    next.n_pairs = 0; /* not known */
    next.radius = radius;
    next.counts = NULL;
    next.images = (hs_images){.width = 0};
    next.turn = 1 - listing->turn;
    built->listing = &next;
    built->pieces = NULL;
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

/*
 * How far points have moved, a tile at a time: u_i = r_i - r0_i F - k_i h - c, what is left when
 * the deformation of the box, whole box vectors and what all points share are taken away.
 */

#define TILE 64 /* points whose displacements are held at a time; whole chains of a maximum */

typedef struct tracking {
    const hs_motion *motion;
    bool             deformed;
    hs_strain        strain;
    hs_lattice       lattice; /* of the box now */
    int              m;
    double           jump; /* longer displacements are looked at; infinity: none */
    bool             has_base;
    double           base[HS_MAX_DIM];
    bool             has_drift;
    double           drift[HS_MAX_DIM];
    hs_store        *jumps;
    int64_t         *jump_of;   /* in it, m a point; NULL: there is none yet */
    double           square;    /* largest |u|^2 ... */
    double           component; /* ... and |u_k| */
    double           magnitude; /* of the terms of wrapping */
} tracking;

/* u of the points of one tile, one array for each axis, without drift. */
typedef struct tile {
    int64_t first, step; /* points first, first + step, ... */
    int     n;
    double  u[HS_MAX_DIM][TILE];
} tile;

/* Whether a displacement is so long that it may be a jump. */
static bool
may_be_jump(const tracking *track, const tile *t, int p)
{
    double longest = 0.0;
    for (int k = 0; k < track->lattice.ndim; k++) {
        longest = hs_larger(fabs(t->u[k][p]), longest);
    }
    return !(longest < track->jump);
}

/* One loop for each common type and number of dimensions; maxima in several chains, for one would
 * wait for itself. */

#define CHAINS 8

HS_ALWAYS_INLINE void
subtract(const tracking *track, tile *t, const hs_real real, const int d, const bool deformed)
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
find_displacements(const tracking *track, tile *t)
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
take_jump(tracking *track, tile *t, int p, int64_t *given)
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

/* The longest of the tile, less drift, to *square and *component. */
HS_ALWAYS_INLINE void
find_longest(tile *t, const int d, const double *drift, double *square, double *component)
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
measure_tile(tile *t, int d, const double *drift, double *square, double *component)
{
    switch (d) {
    case 2: find_longest(t, 2, drift, square, component); break;
    case 3: find_longest(t, 3, drift, square, component); break;
    default: find_longest(t, d, drift, square, component);
    }
}

/* Displacements of up to TILE points from `first` on; their longest to *square and *component.
 * Returns whether some point may have jumped. */
static bool
look_at_tile(const tracking *track, int64_t first, int64_t step, tile *t, double *square,
             double *component)
{
    const double  none[HS_MAX_DIM] = {0.0};
    const int64_t left = (track->motion->now->points.n - first + step - 1) / step;
    t->first = first;
    t->step = step;
    t->n = left < TILE ? (int)left : TILE;
    *square = *component = 0.0;
    find_displacements(track, t);
    measure_tile(t, track->motion->now->points.ndim, none, square, component);
    return track->m > 0 && !(*component < track->jump);
}

/* Takes and keeps the jumps of the points of a tile. HS_REBUILD: some point went too far to
 * tell. */
static hs_status
take_jumps(tracking *track, tile *t)
{
    const int m = track->m;
    for (int p = 0; p < t->n; p++) {
        int64_t  given[HS_MAX_DIM];
        uint64_t any = 0;
        if (!may_be_jump(track, t, p)) {
            continue;
        }
        if (!take_jump(track, t, p, given)) {
            return HS_REBUILD;
        }
        for (int r = 0; r < m; r++) {
            any |= (uint64_t)given[r];
        }
        if (any != 0 && track->jump_of == NULL) { /* no jumps yet */
            const int64_t n = track->motion->now->points.n * m;
            track->jump_of = hs_store_reserve(track->jumps, HS_FOR_WRAPS, n, sizeof(int64_t));
            if (track->jump_of == NULL) {
                return HS_ERR_MEMORY;
            }
            memset(track->jump_of, 0, (size_t)n * sizeof(int64_t));
        }
        for (int r = 0; any != 0 && r < m; r++) {
            track->jump_of[(t->first + p) * m + r] = given[r];
        }
    }
    return HS_OK;
}

/*
 * Chooses F, k and c, and finds what the longest displacement leaves of the skin. Any F, k and c
 * are right; good ones make displacements small. c is `base`, taken away before box vectors are
 * looked for, and `drift`, taken away behind that.
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
find_base(tracking *track)
{
    const int64_t n = track->motion->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    int64_t       count = 0, far = 0;
    double        base[HS_MAX_DIM] = {0.0}, square, component;
    tile          t;
    for (int64_t i = 0; track->m > 0 && i < n; i += TILE * step, count += t.n) {
        const bool any = look_at_tile(track, i, step, &t, &square, &component);
        for (int p = 0; any && p < t.n; p++) {
            if (may_be_jump(track, &t, p)) {
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
take_sample(tracking *track, const double *drift, sample *found)
{
    const int64_t n = track->motion->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    const int     d = track->motion->now->points.ndim;
    double        square, component;
    tile          t;
    *found = (sample){.count = 0.0};
    for (int64_t i = 0; i < n; i += TILE * step) {
        const bool any = look_at_tile(track, i, step, &t, &square, &component);
        for (int p = 0; p < t.n; p++) {
            if (any && may_be_jump(track, &t, p)) {
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
guess_drift(tracking *track)
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
longest_computed(const tracking *track)
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
bound_rounding(const tracking *track)
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
find_margin(const tracking *track)
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

hs_status
hs_motion_margin(const hs_motion *motion, const hs_options *options, double *margin, bool *jumped,
                 hs_store *jumps)
{
    const hs_frame *built = motion->built, *now = motion->now;
    const int64_t   n = now->points.n;
    tracking        track = {.motion = motion, .jumps = jumps, .jump = INFINITY};
    tile            t;
    int             row[HS_MAX_DIM];
    hs_status       status = HS_OK;
    *margin = -INFINITY;
    *jumped = false;
    track.m = hs_frame_periodic(now, row);
    if (track.m > 0) {
        track.deformed = !hs_frames_share_box(built, now);
        if (track.deformed && !hs_strain_find(&built->box, &now->box, &track.strain)) {
            return HS_OK;
        }
        hs_lattice_init(&now->box, now->points.ndim, hs_scale_of(0), &track.lattice);
        for (int k = 0; k < track.lattice.ndim; k++) {
            if (track.lattice.row_of_axis[k] >= 0) {
                track.jump = hs_smaller(JUMP * track.lattice.period[k], track.jump);
            }
        }
        if (!(track.jump > 0.0)) {
            return HS_OK;
        }
    }
    find_base(&track);
    guess_drift(&track);
    for (int64_t first = 0; status == HS_OK && first < n; first += TILE) {
        double     square, component;
        const bool any = look_at_tile(&track, first, 1, &t, &square, &component);
        status = any ? take_jumps(&track, &t) : HS_OK;
        if (status == HS_OK && (any || track.has_drift)) {
            measure_tile(&t, now->points.ndim, track.drift, &track.square, &track.component);
        } else {
            track.square = hs_larger(square, track.square);
            track.component = hs_larger(component, track.component);
        }
        if (status == HS_OK && (first + TILE) % HS_POLL_POINTS == 0) {
            status = hs_poll(options, 0.0);
        }
    }
    if (status == HS_OK) {
        const double found = find_margin(&track);
        *margin = found == found ? found : -INFINITY;
        *jumped = track.jump_of != NULL;
    }
    return status == HS_REBUILD ? HS_OK : status;
}
