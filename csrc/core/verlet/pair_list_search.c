/* SPDX-License-Identifier: BSD-3-Clause */
/* pair_list_search.c: each thread has a walker; shifts are looked up once for each run of a
 * block. */
#include "pair_list_search.h"

#include "../collect/crew.h"
#include "../search/walk.h"

#include <string.h>

#define PIECES_A_THREAD 4 /* so that none waits long for the others */
#define FIRST_SHIFTED   256

/* What one thread works with. */
typedef struct worker {
    hs_committer committer;
    hs_search   *search; /* borrowed */
    hs_pieces   *pieces; /* borrowed */
    hs_walker    walker;
    hs_piece    *piece; /* that it is working on */
    int32_t     *ids;   /* owned; places in cell order of hits */
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

static bool
make_room(hs_piece *piece, int m)
{
    if (piece->n_shifted < piece->capacity) {
        return true;
    }
    const int64_t capacity = piece->capacity > 0 ? 2 * piece->capacity : FIRST_SHIFTED;
    int64_t *at = hs_grow(NULL, HS_FOR_SHIFTS, piece->at, piece->n_shifted, capacity, sizeof *at);
    if (at == NULL) {
        return false;
    }
    piece->at = at;
    int32_t *shift = hs_grow(NULL, HS_FOR_SHIFTS, piece->shift, piece->n_shifted * m, capacity * m,
                             sizeof *shift);
    if (shift == NULL) {
        return false;
    }
    piece->shift = shift;
    piece->capacity = capacity;
    return true;
}

/* Pair `at` of the piece, of a point and a hit with this shift. The pair goes from the lower place
 * to the higher, or has a first shift that is positive. */
static bool
note_shift(hs_piece *piece, int m, int64_t at, bool turned, const int32_t *shift)
{
    if (!make_room(piece, m)) {
        return false;
    }
    int32_t *to = piece->shift + piece->n_shifted * m;
    for (int r = 0; r < m; r++) {
        to[r] = turned ? -shift[r] : shift[r];
    }
    piece->at[piece->n_shifted++] = at;
    return true;
}

static bool
is_negative(const int32_t *shift, int m)
{
    int r = 0;
    while (r < m - 1 && shift[r] == 0) {
        r++;
    }
    return shift[r] < 0;
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

/* The hits of one point, whose places in the block ascend, as do its runs. */
static bool
note_row(worker *me, int32_t si, int32_t first, int32_t end, const hs_hits *hits)
{
    const int     m = me->walker.scanner.search->bins.n_periodic;
    const hs_run *runs = me->walker.scanner.block.runs;
    int32_t       r = 0;
    for (int32_t h = first; h < end; h++) {
        while (runs[r + 1].at <= hits->label[h]) {
            r++;
        }
        if (!me->is_shifted[r]) {
            continue;
        }
        const int32_t *shift = me->shift + (int64_t)r * m;
        const bool     turned = me->ids[h] < si || (me->ids[h] == si && is_negative(shift, m));
        if (!note_shift(me->piece, m, me->piece->pairs.n_pairs + h, turned, shift)) {
            return false;
        }
    }
    return true;
}

static hs_status
note_shifts(worker *me, int32_t first, const hs_hits *hits)
{
    if (!look_at_block(me)) {
        me->walker.scanner.failed_point = first;
        return HS_ERR_SHIFT_RANGE;
    }
    for (int32_t row = 0; me->has_images && row < hits->n; row++) {
        const int32_t begin = row > 0 ? hits->end[row - 1] : 0;
        if (!note_row(me, first + row, begin, hits->end[row], hits)) {
            return HS_ERR_MEMORY;
        }
    }
    return HS_OK;
}

/* A hs_visit_fn. */
static hs_status
take_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    worker       *me = context;
    hs_output    *pairs = &me->piece->pairs;
    const int32_t n = hits->end[hits->n - 1];
    hs_hits       by_id = *hits;
    hs_status     status = hs_output_reserve(pairs, n, 0.0);
    if (status != HS_OK) {
        return status;
    }
    for (int32_t h = 0; h < n; h++) {
        me->ids[h] = scanner->block.id[hits->label[h]];
    }
    by_id.label = me->ids;
    scanner->search->call->kernel->emit_int32(&by_id, hs_output_next(pairs, HS_WANT_I),
                                              hs_output_next(pairs, HS_WANT_J));
    status = note_shifts(me, first, hits);
    pairs->n_pairs += n;
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
    hs_output_expect(&me->piece->pairs, search->grid.expected_pairs / (double)n_pieces);
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
    me->ids = hs_alloc(account, HS_FOR_CANDIDATES, block->most_hits + HS_PADDING, sizeof *me->ids);
    me->is_shifted = hs_alloc(account, HS_FOR_CANDIDATES, n_runs, sizeof *me->is_shifted);
    me->shift = hs_alloc(account, HS_FOR_CANDIDATES, n_runs * m, sizeof *me->shift);
    const bool complete = me->ids != NULL && me->is_shifted != NULL && me->shift != NULL;
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
    hs_free(account, me->ids);
}

void
hs_pieces_free(hs_account *account, hs_pieces *pieces)
{
    for (int64_t p = 0; pieces->of != NULL && p < pieces->n; p++) {
        hs_output_free(&pieces->of[p].pairs);
        hs_free(NULL, pieces->of[p].at);
        hs_free(NULL, pieces->of[p].shift);
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
        hs_output_init(NULL, search->scene.ndim, HS_WANT_I | HS_WANT_J, 4, &pieces->of[p].pairs);
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
