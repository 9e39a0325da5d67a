/* SPDX-License-Identifier: BSD-3-Clause */
/* pair_list_search.c: each thread has a walker; shifts are looked up once for each run of a
 * block. */
#include "pair_list_search.h"

#include "../collect/crew.h"
#include "../search/walk.h"

#include <string.h>

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
    hs_output_expect(&me->piece->plain.pairs, search->grid.expected_pairs / (double)n_pieces);
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
