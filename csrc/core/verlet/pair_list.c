/* SPDX-License-Identifier: BSD-3-Clause */
#include "pair_list.h"
#include "../collect/parallel.h"

#include <string.h>

/* pair_list.c: finds the pairs of a list, lists them in bundles, and follows the motion of the
 * points: how much of the skin it leaves. */

/*
 * A list is a search whose points are numbered in cell order, so that neighbours lie close together
 * in memory when it is used, and whose shifts are those of the wrapped points, so that few of them
 * are not zero. Several threads find its pieces, each with a walker. Until all are found, images
 * have numbers by where they lie over the rows of B.
 */

#define PIECES_A_THREAD 4 /* so that none waits long for the others */
#define FIRST_BUNDLES   256

/* A search, and what it has found in cell order. */
typedef struct building {
    hs_call    call;
    hs_search  search;
    hs_listing listing; /* owned */
    /* Images over row r of B are from -most to most of it. Number home + sum of image * stride: */
    int64_t most[HS_MAX_DIM], stride[HS_MAX_DIM], home, n_images;
} building;

/* What one thread works with. */
typedef struct worker {
    hs_committer  committer;
    hs_walker     walker;
    hs_list_part *plain, *shifted; /* of the piece that it is working on */
    /* Of the block that was looked at last: */
    int64_t  block; /* candidates tested before it, which tells blocks apart; -1: none */
    bool     has_images;
    int32_t *image; /* owned; number of that of each run */
} worker;

/* n hits of one run to a part: in its last bundle if that is of this point and image, else in a new
 * one. False when memory is refused. */
static bool
add_pairs(worker *me, hs_list_part *part, int32_t si, int32_t image, const int32_t *labels,
          int32_t n)
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
    int32_t *to = (int32_t *)hs_output_column(&part->pairs, HS_WANT_J) + part->pairs.n_pairs;
    for (int32_t h = 0; h < n; h++) {
        to[h] = id[labels[h]];
    }
    part->pairs.n_pairs += n;
    last->end = part->pairs.n_pairs;
    return true;
}

/* The image with this number over the box vectors as given. False beyond int32, also of its
 * opposite. */
static bool
shift_of(const building *built, int64_t number, int32_t *shift)
{
    const hs_lattice *lattice = &built->search.scene.lattice;
    int64_t           image[HS_MAX_DIM], given[HS_MAX_DIM];
    for (int r = 0; r < lattice->n_periodic; r++) {
        image[r] = number / built->stride[r] % (2 * built->most[r] + 1) - built->most[r];
    }
    bool fits = hs_lattice_shift(lattice, image, given);
    for (int r = 0; fits && r < lattice->n_periodic; r++) {
        shift[r] = (int32_t)given[r];
        fits = given[r] <= INT32_MAX && given[r] >= -INT32_MAX;
    }
    return fits;
}

/* Hits of one run that is in another image. A point that is its own neighbour has a first shift
 * that is positive. */
static bool
add_run(worker *me, int32_t si, const int32_t *labels, int32_t n, int32_t image)
{
    const building *built = me->committer.job;
    const int32_t  *id = me->walker.scanner.block.id;
    bool            fits = true;
    for (int32_t h = 0, next; h < n && fits; h = next) {
        int32_t shift[HS_MAX_DIM], number = image, first = 0;
        for (next = h + 1; next < n && id[labels[h]] != si && id[labels[next]] != si; next++) {
        }
        if (id[labels[h]] == si && shift_of(built, image, shift)) {
            for (int r = built->search.scene.lattice.n_periodic - 1; r >= 0; r--) {
                first = shift[r] != 0 ? shift[r] : first;
            }
            number = first < 0 ? (int32_t)(2 * built->home - image) : image;
        }
        fits = add_pairs(me, me->shifted, si, number, labels + h, next - h);
    }
    return fits;
}

/* A hs_visit_fn. Places of a point's hits in the block ascend, as do its runs. */
static hs_status
take_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    worker         *me = context;
    const building *built = me->committer.job;
    const hs_run   *runs = scanner->block.runs;
    const int32_t   n = hits->end[hits->n - 1], home = (int32_t)built->home;
    const int       m = scanner->search->bins.n_periodic;
    const bool      is_new = me->block != scanner->n_candidates;
    /* The images of the runs of a block are found once. */
    me->block = scanner->n_candidates;
    me->has_images = me->has_images && !is_new;
    for (int32_t r = 0; is_new && m > 0 && runs[r].at < scanner->block.n; r++) {
        int64_t number = home;
        for (int k = 0; k < m; k++) {
            number += runs[r].image[k] * built->stride[k];
        }
        me->image[r] = (int32_t)number;
        me->has_images = me->has_images || number != home;
    }
    hs_status status = hs_output_reserve(&me->plain->pairs, n, 0.0);
    if (status == HS_OK && me->has_images) {
        status = hs_output_reserve(&me->shifted->pairs, n, 0.0);
    }
    for (int32_t row = 0, h = 0; status == HS_OK && row < hits->n; row++) {
        const int32_t end = hits->end[row], si = first + row;
        bool          fits = true;
        for (int32_t next = end, r = 0; h < end && fits; h = next, next = end) {
            int32_t image = home;
            if (me->has_images) {
                while (runs[r + 1].at <= hits->label[h]) {
                    r++;
                }
                for (next = h + 1; next < end && hits->label[next] < runs[r + 1].at; next++) {
                }
                image = me->image[r];
            }
            fits = image == home ? add_pairs(me, me->plain, si, 0, hits->label + h, next - h)
                                 : add_run(me, si, hits->label + h, next - h, image);
        }
        status = fits ? HS_OK : HS_ERR_MEMORY;
    }
    return status;
}

/* A hs_range_fn: a piece. */
static hs_status
search_piece(void *context, int64_t number)
{
    worker          *me = context;
    const building  *built = me->committer.job;
    const hs_search *search = &built->search;
    const int64_t    n = search->bins.n, n_pieces = built->listing.n_pieces;
    me->plain = &built->listing.parts[number];
    me->shifted = &built->listing.parts[n_pieces + number];
    hs_output_reserve_hint(&me->plain->pairs, search->grid.expected_pairs / (double)n_pieces);
    return hs_walk(&me->walker, (int32_t)(n * number / n_pieces),
                   (int32_t)(n * (number + 1) / n_pieces), &me->committer.failure);
}

static hs_status
open_worker(void *context, void *place)
{
    building  *built = context;
    hs_search *search = &built->search;
    worker    *me = place;
    me->committer.options = &me->walker.scanner.options;
    me->block = -1;
    const hs_status status =
        hs_walker_init(search, HS_BLOCK_LISTS_PLACES, NULL, take_hits, me, &me->walker);
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
 * place; HS_ERR_MEMORY also where there are more images than numbers. */
static hs_status
find_pieces(building *built, hs_failure *failure)
{
    hs_call          *call = &built->call;
    hs_listing       *listing = &built->listing;
    const hs_grid    *grid = &built->search.grid;
    const hs_lattice *lattice = &built->search.scene.lattice;
    double            n_images = 1.0;
    built->home = 0;
    for (int k = 0; k < lattice->ndim; k++) {
        const int r = lattice->row_of_axis[k];
        if (r >= 0) {
            built->most[r] = grid->reach[k] / grid->shape[k] + 1;
            built->stride[r] = (int64_t)n_images;
            built->home += built->most[r] * built->stride[r];
            n_images *= 2.0 * (double)built->most[r] + 1.0;
            if (n_images > INT32_MAX) {
                return HS_ERR_MEMORY;
            }
        }
    }
    built->n_images = (int64_t)n_images;
    const int64_t n = call->team == NULL ? 1 : PIECES_A_THREAD * hs_team_size(call->team);
    listing->parts = hs_alloc(NULL, HS_FOR_INDICES, 2 * n, sizeof *listing->parts);
    if (listing->parts == NULL) {
        return HS_ERR_MEMORY;
    }
    listing->n_pieces = n;
    for (int64_t p = 0; p < 2 * n; p++) {
        listing->parts[p] = (hs_list_part){.bundles = NULL};
        hs_output_init(NULL, lattice->ndim, HS_WANT_J, 4, &listing->parts[p].pairs);
    }
    hs_crew crew = {.call = call,
                    .job = built,
                    .worker_size = sizeof(worker),
                    .open = open_worker,
                    .close = close_worker,
                    .n_ranges = n,
                    .search = search_piece};
    return hs_crew_run(&crew, failure);
}

void
hs_listing_free(hs_listing *listing)
{
    for (int64_t p = 0; p < 2 * listing->n_pieces; p++) {
        hs_output_free(&listing->parts[p].pairs);
        hs_free(NULL, listing->parts[p].bundles);
    }
    hs_free(NULL, listing->parts);
    hs_free(NULL, listing->images);
    hs_free(NULL, listing->order);
    hs_free(NULL, listing->counts);
    *listing = (hs_listing){0};
}

/* Renumbers the points by their places in cell order, and stores by how many given box vectors each
 * was wrapped: shifts are images alone from here on. */
static hs_status
renumber(hs_search *search, hs_listing *listing, hs_failure *failure)
{
    hs_bins  *bins = &search->bins;
    const int m = bins->n_periodic;
    listing->order = hs_alloc(NULL, HS_FOR_ORDER, bins->n, sizeof *listing->order);
    listing->counts = hs_alloc(NULL, HS_FOR_WRAPS, bins->n * m, sizeof *listing->counts);
    if (listing->order == NULL || listing->counts == NULL) {
        return HS_ERR_MEMORY;
    }
    HS_ASSERT(m == 0 || bins->turns.known);
    for (int64_t si = 0; si < bins->n; si++) {
        int64_t turns[HS_MAX_DIM];
        for (int r = 0; r < m; r++) {
            turns[r] = hs_turns_get(&bins->turns, r, si);
        }
        if (!hs_lattice_shift(&search->scene.lattice, turns, listing->counts + si * m)) {
            failure->row = bins->order[si];
            return HS_ERR_SHIFT_RANGE;
        }
        listing->order[si] = bins->order[si];
        bins->order[si] = (int32_t)si;
    }
    if (!bins->keeps_originals) {
        bins->turns.known = false; /* they are not needed any more */
    }
    return HS_OK;
}

/* Counts pairs and slabs, and gives the images that pairs have their numbers in the listing, in the
 * order in which they first come. HS_ERR_MEMORY; HS_ERR_SHIFT_RANGE sets failure->row, a place. */
static hs_status
count_pairs(building *built, hs_failure *failure)
{
    hs_listing   *listing = &built->listing;
    const int64_t n = listing->n_pieces;
    const int     m = built->search.scene.lattice.n_periodic;
    hs_status     status = HS_ERR_MEMORY;
    int64_t       n_bundles = 0, n_plain = 0;
    for (int64_t p = 0; p < 2 * n; p++) {
        hs_list_part *part = &listing->parts[p];
        part->first_slab = listing->n_slabs;
        n_plain += p < n ? part->n_bundles : 0;
        n_bundles += part->n_bundles;
        listing->n_pairs += part->pairs.n_pairs;
        listing->n_slabs += (part->pairs.n_pairs + HS_SLAB - 1) / HS_SLAB;
        if (part->pairs.n_pairs > 0) { /* what is behind the last one is read, too */
            memset(hs_output_next(&part->pairs, HS_WANT_J), 0, HS_PADDING * sizeof(int32_t));
        }
    }
    const int64_t most = n_bundles - n_plain; /* images that there can be */
    int32_t *number = hs_alloc(NULL, HS_FOR_SHIFTS, most > 0 ? built->n_images : 0, sizeof *number);
    listing->images = hs_alloc(NULL, HS_FOR_SHIFTS,
                               (most < built->n_images ? most : built->n_images) * m,
                               sizeof *listing->images);
    if (number != NULL && listing->images != NULL) {
        status = HS_OK;
        memset(number, -1, most > 0 ? (size_t)built->n_images * sizeof *number : 0);
    }
    for (int64_t p = n; status == HS_OK && p < 2 * n; p++) {
        const hs_list_part *shifted = &listing->parts[p];
        for (int64_t b = 0; status == HS_OK && b < shifted->n_bundles; b++) {
            int32_t *const own = &number[shifted->bundles[b].image];
            if (*own < 0) {
                *own = (int32_t)listing->n_images;
                if (!shift_of(built, shifted->bundles[b].image, listing->images + *own * m)) {
                    failure->row = shifted->bundles[b].point;
                    status = HS_ERR_SHIFT_RANGE;
                }
                listing->n_images++;
            }
            shifted->bundles[b].image = *own;
        }
    }
    hs_free(NULL, number);
    /* What the account is not charged for; half of it may be room. */
    const double bytes = 2.0 * sizeof(int32_t) * (double)listing->n_pairs +
                         2.0 * sizeof(hs_bundle) * (double)n_bundles;
    return status == HS_OK && !hs_account_allows(&built->call.account, bytes) ? HS_ERR_MEMORY
                                                                              : status;
}

hs_status
hs_listing_build(const hs_frame *frame, const hs_options *options, double radius,
                 hs_listing *listing, hs_failure *failure)
{
    int           row[HS_MAX_DIM];
    const hs_sets sets = {.points = &frame->points, .is_plain = true};
    hs_options    searching = *options;
    building     *built = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *built);
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
    searching.want = HS_WANT_I | HS_WANT_J;
    searching.want |= hs_frame_periodic(frame, row) > 0 ? HS_WANT_SHIFT : 0;
    searching.index_bytes = 4;
    built->listing = (hs_listing){.radius = radius};
    hs_call *const call = &built->call;
    hs_call_begin(&searching, call);
    hs_status  status = hs_search_open(&sets, hs_frame_box(frame), call, &built->search, failure);
    const bool opened = status == HS_OK;
    if (status == HS_OK) {
        status = hs_estimate_by_sample(&built->search, failure);
    }
    if (status == HS_OK) {
        status = renumber(&built->search, &built->listing, failure);
    }
    if (status == HS_OK) {
        status = find_pieces(built, failure);
        if (status == HS_OK) {
            status = count_pairs(built, failure);
        }
        if (failure->row >= 0) {
            failure->row = built->listing.order[failure->row];
        }
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = fmax(failure->expected_pairs, (double)built->listing.n_pairs);
    }
    hs_call_tell_limit(call, status, failure);
    if (opened) {
        hs_search_close(&built->search);
    }
    hs_call_dismiss(call);
    hs_account_close(&call->account);
    if (status == HS_OK) {
        const hs_listing before = *listing;
        *listing = built->listing;
        built->listing = before;
    }
    hs_listing_free(&built->listing);
    hs_free(NULL, built);
    return status;
}

/*
 * How far points have moved, a tile at a time: u_i = r_i - r0_i F - c - k_i h, what is left when
 * the deformation of the box, what all points share and whole box vectors are taken away.
 */

#define TILE 64 /* points whose displacements are held at a time; whole chains of a maximum */

typedef struct tracking {
    const hs_frame *built, *now; /* borrowed */
    bool            deformed;
    hs_strain       strain;
    hs_lattice      lattice; /* of the box now */
    int             m;
    double          jump; /* longer displacements are looked at; infinity: none */
    double          drift[HS_MAX_DIM];
    void          **jumps;
    int64_t        *jump_of;   /* in it, m a point; NULL: there is none yet */
    double          square;    /* largest |u|^2 ... */
    double          component; /* ... and |u_k| */
    double          magnitude; /* of the terms of wrapping */
} tracking;

/* u of the points of one tile, one array for each axis. */
typedef struct tile {
    int64_t first, step; /* points first, first + step, ... */
    int     n;
    double  u[HS_MAX_DIM][TILE];
} tile;

/* One loop for each common type and number of dimensions; maxima in several chains, for one would
 * wait for itself. */

#define CHAINS 8

HS_ALWAYS_INLINE void
subtract(const tracking *track, tile *t, const hs_real real, const int d, const bool deformed)
{
    const void   *now = track->now->points.data, *built = track->built->points.data;
    const int64_t first = t->first * d, step = t->step * d;
    for (int p = 0; p < t->n; p++) {
        for (int k = 0; k < d; k++) {
            const int64_t e = first + p * step + k;
            double        before = 0.0;
            for (int c = 0; deformed && c < d; c++) {
                before += hs_frame_entry(built, real, e - k + c) * track->strain.F[c][k];
            }
            before = deformed ? before : hs_frame_entry(built, real, e);
            t->u[k][p] = hs_frame_entry(now, real, e) - before - track->drift[k];
        }
    }
}

/* The longest of the tile to *square and *component. */
HS_ALWAYS_INLINE void
find_longest(tile *t, const int d, double *square, double *component)
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
                const double u = t->u[k][p + c];
                sum[c] += u * u;
                longest[c] = hs_larger(fabs(u), longest[c]);
            }
        }
        for (int c = 0; c < CHAINS; c++) {
            most[c] = hs_larger(sum[c], most[c]);
        }
    }
    *square = *component = 0.0;
    for (int c = 0; c < CHAINS; c++) {
        *square = hs_larger(most[c], *square);
        *component = hs_larger(longest[c], *component);
    }
}

/* find_longest, with constants where that pays. */
static void
measure(tile *t, int d, double *square, double *component)
{
    switch (d) {
    case 2: find_longest(t, 2, square, component); break;
    case 3: find_longest(t, 3, square, component); break;
    default: find_longest(t, d, square, component);
    }
}

/* Takes whole box vectors from the longest of the tile, and if `keeps` says by how many of those
 * given each point has jumped. HS_REBUILD: some point went too far to tell. */
static hs_status
take_jumps(tracking *track, tile *t, bool keeps)
{
    const int d = track->lattice.ndim, m = track->m;
    for (int p = 0; p < t->n; p++) {
        double   u[HS_MAX_DIM], inside[HS_MAX_DIM], longest = 0.0;
        int64_t  turns[HS_MAX_DIM], given[HS_MAX_DIM];
        uint64_t any = 0;
        for (int k = 0; k < d; k++) {
            u[k] = t->u[k][p];
            longest = hs_larger(fabs(u[k]), longest);
        }
        if (longest < track->jump) {
            continue;
        }
        if (!hs_wrap_point(&track->lattice, u, inside, turns, &track->magnitude)) {
            return HS_REBUILD;
        }
        (void)hs_lattice_shift(&track->lattice, turns,
                               given); /* these fit: hs_wrap_point found it */
        for (int k = 0; k < d; k++) {
            t->u[k][p] = inside[k];
        }
        for (int r = 0; keeps && r < m; r++) {
            any |= (uint64_t)given[r];
        }
        if (any != 0 && track->jump_of == NULL) { /* no jumps yet */
            const int64_t n = track->now->points.n * m;
            track->jump_of = hs_reserve(track->jumps, HS_FOR_WRAPS, n, sizeof(int64_t));
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

/* Displacements of up to TILE points from `first` on, with the longest of all so far. Statuses of
 * take_jumps. */
static hs_status
look_at_tile(tracking *track, int64_t first, int64_t step, bool keeps, tile *t)
{
    const hs_points *points = &track->now->points;
    const hs_real    real = points->real;
    const int        d = points->ndim;
    const int64_t    left = (points->n - first + step - 1) / step;
    double           square, component;
    hs_status        status = HS_OK;
    t->first = first;
    t->step = step;
    t->n = left < TILE ? (int)left : TILE;
    switch (8 * (real == HS_FLOAT32) + 4 * track->deformed + (d == 2 || d == 3 ? d : 0)) {
    case 2: subtract(track, t, HS_FLOAT64, 2, false); break; /* constants where that pays */
    case 3: subtract(track, t, HS_FLOAT64, 3, false); break;
    case 7: subtract(track, t, HS_FLOAT64, 3, true); break;
    case 10: subtract(track, t, HS_FLOAT32, 2, false); break;
    case 11: subtract(track, t, HS_FLOAT32, 3, false); break;
    case 15: subtract(track, t, HS_FLOAT32, 3, true); break;
    default: subtract(track, t, real, d, track->deformed);
    }
    measure(t, d, &square, &component);
    if (track->m > 0 && !(component < track->jump)) {
        status = take_jumps(track, t, keeps);
        measure(t, d, &square, &component);
    }
    track->square = hs_larger(square, track->square);
    track->component = hs_larger(component, track->component);
    return status;
}

/*
 * Chooses F, k and c, and finds what the longest displacement leaves of the skin. Any F, k and c
 * are right; good ones make displacements small. c is `drift`.
 */

#define UNIT   0x1p-53
#define GROW   (1.0 + 0x1p-40) /* more than the roundings of any bound here */
#define SAMPLE 1024            /* points that the drift is guessed from */
/* A drift is taken away where the sample gets this much shorter: small ones are not worth it. */
#define WORTHWHILE 0.8
/* A displacement of this share of the box's smallest height may be a jump. */
#define JUMP 0.25

/* The drift of a sample, whose jumps are taken away: the mean, or where the sample is all there is
 * the middle of the range. A second pass finds how much shorter that makes the longest. */
static void
guess_drift(tracking *track)
{
    const int64_t n = track->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    const int     d = track->now->points.ndim;
    double        sum[HS_MAX_DIM] = {0.0}, lower[HS_MAX_DIM] = {0.0}, upper[HS_MAX_DIM] = {0.0};
    double        longest[2], count = 0.0;
    tile          t;
    for (int pass = 0; pass < 2; pass++) {
        for (int64_t i = 0; i < n; i += TILE * step) {
            (void)look_at_tile(track, i, step, false, &t); /* a failure shows again later */
            for (int p = 0; pass == 0 && p < t.n; p++, count++) {
                for (int k = 0; k < d; k++) {
                    const double u = t.u[k][p];
                    sum[k] += u;
                    lower[k] = count == 0.0 ? u : hs_smaller(u, lower[k]);
                    upper[k] = count == 0.0 ? u : hs_larger(u, upper[k]);
                }
            }
        }
        for (int k = 0; pass == 0 && count > 0.0 && k < d; k++) {
            track->drift[k] = n <= SAMPLE ? 0.5 * lower[k] + 0.5 * upper[k] : sum[k] / count;
        }
        longest[pass] = track->square;
        track->square = track->component = 0.0;
    }
    if (!(longest[1] < WORTHWHILE * WORTHWHILE * longest[0])) {
        memset(track->drift, 0, sizeof track->drift);
    }
}

/* How far a computed u may be from the true one. Zero where nothing was rounded. */
static double
bound_rounding(const tracking *track)
{
    const int    d = track->now->points.ndim;
    const double now = track->now->largest, built = track->built->largest;
    double       bound = 0.0;
    for (int k = 0; k < d; k++) {
        bound += 2.0 * UNIT * fabs(track->drift[k]); /* of a u near it, and of the difference */
    }
    const double sizes = now + built * (track->deformed ? track->strain.column_sum : 1.0);
    if (track->deformed) { /* d products, d sums and a difference of these sizes */
        bound += (2 * d + 4) * UNIT * sizes + 0x1p-1050;
    }
    if (track->jump_of != NULL) { /* differences, wrapped: hs_wrap_point bounds its error */
        const double terms = 2 * track->m + 2;
        bound += 2.0 * UNIT * (sizes + track->magnitude) +
                 terms * terms * 0x1p-104 * track->magnitude + 0x1p-1050;
    }
    return 3.0 * bound * GROW; /* of each component; sqrt(d) < 3 */
}

hs_status
hs_motion_margin(const hs_verlet *list, const hs_frame *now, const hs_options *options,
                 double *margin, bool *jumped, void **jumps)
{
    const hs_frame *built = &list->frames[list->built];
    const int64_t   n = now->points.n;
    tracking        track = {.built = built, .now = now, .jumps = jumps, .jump = INFINITY};
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
    guess_drift(&track);
    for (int64_t first = 0; status == HS_OK && first < n; first += TILE) {
        status = look_at_tile(&track, first, 1, true, &t);
        if (status == HS_OK && (first + TILE) % HS_POLL_POINTS == 0) {
            status = hs_poll(options, 0.0);
        }
    }
    if (status != HS_OK) {
        return status == HS_REBUILD ? HS_OK : status;
    }
    /* What is left of the skin. Each step is rounded to the safe side. */
    double reach = list->listing.radius, longest = 0.0;
    if (track.square >= 0x1p-900 && track.square <= 0x1p1000) {
        longest = sqrt(track.square) * (1.0 + 0x1p-47); /* above roundings of square and root */
    } else if (track.component != 0.0) {
        longest = hs_next_up(3.0 * track.component); /* sqrt(8) < 3; squares lost or infinite */
    }
    double used = longest + bound_rounding(&track);
    used = used > 0.0 ? 2.0 * hs_next_up(used) : used; /* nothing is nothing */
    if (track.deformed) {
        /* No two points are farther apart than 2 sqrt(d) times the largest coordinate. */
        const double apart = 6.0 * built->largest;
        reach = hs_next_down(reach * track.strain.shrink);
        used = hs_next_up(used + hs_next_up(track.strain.residual * apart) * GROW);
    }
    const double room = reach - list->cutoff;
    double       left = (room > 0.0 && list->cutoff > 0.0 ? hs_next_down(room) : room) - used;
    left = left > 0.0 && used > 0.0 ? hs_next_down(left) : left;
    *margin = left == left ? left : -INFINITY;
    *jumped = track.jump_of != NULL;
    return HS_OK;
}
