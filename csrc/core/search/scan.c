/* SPDX-License-Identifier: BSD-3-Clause */
#include "scan.h"
#include "../base/sort.h"
#include "limits.h"
#include "choice.h"
#include "../base/status.h"

/* scan.c: a block is gathered, scanned for some points at a time, and what they hit is decided.
 * Candidates are appended as runs of point numbers; then the kernel copies all runs at once. */

/* Runs appended or gathered between two polls. Where there are so many each has few candidates. */
#define RUNS_PER_POLL (1 << 16)

/* Hits held at a time, as a multiple of the candidates: those of a few points at least. Blocks of
 * fewer candidates than a burst have room for one hit each and a burst. */
#define HITS_PER_CANDIDATE 2

/* Room for so many candidates and runs at a time: with numbers of each candidate that its pairs are
 * compared with, and room to sort them in where they are put in order. */
static hs_status
block_init(hs_scanner *scanner, int32_t most, int32_t most_runs)
{
    const hs_search   *search = scanner->search;
    hs_account        *account = &search->call->account;
    const hs_block_use use = scanner->scans;
    const int64_t      capacity = (int64_t)most + HS_PADDING;
    const int64_t      n_radii = search->limits != NULL ? hs_limits_rows(search) : 0;
    const bool         has_squares = use == HS_BLOCK_LISTS_SQUARES;
    hs_block          *block = &scanner->block;
    hs_order          *order = &block->order;
    hs_parts           parts;
    *block = (hs_block){.capacity = most, .most_runs = most_runs, .pitch = capacity};
    block->most_hits = most < HS_BURST ? most + HS_BURST : HITS_PER_CANDIDATE * most;
    const int64_t hits = (int64_t)block->most_hits + HS_PADDING;
    hs_parts_begin(&parts);
    for (int k = 0; k < search->scene.ndim; k++) {
        hs_parts_add(&parts, (void **)&block->y[k], capacity, sizeof(float));
    }
    hs_parts_add(&parts, (void **)&block->id, capacity, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&block->number, capacity, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&block->unsure, scanner->chooses ? hits : capacity,
                 sizeof(hs_unsure));
    hs_parts_add(&parts, (void **)&block->runs, (int64_t)most_runs + 1, sizeof(hs_run));
    if (use != HS_BLOCK_COUNTS) {
        hs_parts_add(&parts, (void **)&block->hits, hits, sizeof(int32_t));
    }
    if (has_squares) {
        hs_parts_add(&parts, (void **)&block->squares, hits, sizeof(float));
    }
    if (has_squares || use == HS_BLOCK_LISTS_PLACES) {
        hs_parts_add(&parts, (void **)&block->place, capacity, sizeof(int32_t));
    }
    if (n_radii > 0) {
        hs_parts_add(&parts, (void **)&block->radius, n_radii * capacity, sizeof(float));
    }
    block->memory = hs_parts_alloc(account, HS_FOR_CANDIDATES, &parts);
    if (block->memory == NULL || !scanner->is_ordered) {
        return block->memory != NULL ? HS_OK : HS_ERR_MEMORY;
    }
    hs_parts_begin(&parts);
    hs_parts_add(&parts, (void **)&order->entries, capacity, sizeof(uint64_t));
    hs_parts_add(&parts, (void **)&order->spare, capacity, sizeof(uint64_t));
    hs_parts_add(&parts, (void **)&order->run, capacity, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&order->column, capacity, sizeof(float));
    hs_parts_add(&parts, (void **)&order->shifts, ((int64_t)most_runs + 1) * HS_MAX_DIM,
                 sizeof(int64_t));
    hs_parts_add(&parts, (void **)&block->origin, capacity, sizeof(int32_t));
    order->memory = hs_parts_alloc(account, HS_FOR_SORTING, &parts);
    if (order->memory == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(block->origin, 0, (size_t)capacity * sizeof(int32_t)); /* padding of labels is read */
    return HS_OK;
}

/* Copies the group's points from where they are, rounded as candidates are: for groups whose
 * neighbourhood does not begin with them. */
static void
group_load(const hs_bins *bins, hs_group *group)
{
    for (int k = 0; k < bins->ndim; k++) {
        const double *x = bins->x[k] + group->first;
        for (int32_t t = 0; t < group->last - group->first; t++) {
            const float    q = (float)(x[t] - group->centre[k]);
            const uint32_t bits = hs_bits_of_float(q) & UINT32_C(0x7fffffff);
            group->q[k][t] = q;
            group->largest = bits > group->largest ? bits : group->largest;
        }
    }
}

/* Sorts the runs by component l of S, stable. What lies in `origin` is lost. */
static hs_status
sort_by_shift(const hs_options *options, int l, hs_block *block)
{
    const hs_order *order = &block->order;
    const int64_t  *shifts = order->shifts + l;
    int64_t         least = INT64_MAX;
    hs_keys         sort = {.keys = (int64_t *)order->entries,
                            .ids = order->run,
                            .spare_keys = (int64_t *)order->spare,
                            .spare_ids = block->origin,
                            .options = options};
    for (int32_t r = 0; r < block->n_runs; r++) {
        const int64_t shift = shifts[(int64_t)r * HS_MAX_DIM];
        least = shift < least ? shift : least;
    }
    for (int32_t e = 0; e < block->n_runs; e++) { /* less than 2^63 apart (hs_lattice_shift) */
        sort.keys[e] = shifts[(int64_t)order->run[e] * HS_MAX_DIM] - least;
    }
    return hs_keys_sort(&sort, 0, block->n_runs);
}

/* Polls between passes over a large block. */
static hs_status
poll_large(const hs_options *options, const hs_block *block)
{
    return block->n > HS_POLL_CANDIDATES ? hs_poll(options, 0.0) : HS_OK;
}

/*
 * Sorts a block that has been gathered: ascending by the caller's number, then, where hits are
 * listed as places and some pair has several images, by S over the box vectors as given.
 * block->origin says where each candidate was; ids follow the new order only where these are
 * listed. HS_ERR_SHIFT_RANGE when an image passes 2^62; HS_ERR_INTERRUPTED, as the poll says, while
 * a large block is sorted.
 */
static hs_status
order_block(hs_scanner *scanner)
{
    const hs_search  *search = scanner->search;
    const hs_options *options = &scanner->options;
    const hs_lattice *lattice = &search->scene.lattice;
    const bool by_shift = scanner->use == HS_BLOCK_LISTS_PLACES && hs_search_repeats_images(search);
    hs_block  *block = &scanner->block;
    const int32_t n = block->n;
    hs_order     *order = &block->order;
    int32_t       descents = 0; /* none in one cell, or where points are numbered as they lie */
    if (poll_large(options, block) != HS_OK) { /* it was gathered */
        return HS_ERR_INTERRUPTED;
    }
    for (int32_t c = 1; c < n; c++) {
        descents += block->id[c] <= block->id[c - 1];
    }
    if (descents == 0) {
        for (int32_t c = 0; c < n; c++) {
            block->origin[c] = c;
        }
        return HS_OK;
    }
    for (int32_t r = 0; r < block->n_runs; r++) {
        order->run[r] = r;
    }
    for (int32_t r = 0; by_shift && r < block->n_runs; r++) { /* S of each run */
        int64_t image[HS_MAX_DIM];
        for (int b = 0; b < lattice->n_periodic; b++) {
            image[b] = block->runs[r].image[b];
        }
        if (!hs_lattice_shift(lattice, image, order->shifts + (int64_t)r * HS_MAX_DIM)) {
            return HS_ERR_SHIFT_RANGE;
        }
    }
    for (int l = lattice->n_periodic - 1; by_shift && l >= 0; l--) {
        if (sort_by_shift(options, l, block) != HS_OK || poll_large(options, block) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    uint64_t *to = order->entries;
    for (int32_t e = 0; e < block->n_runs; e++) { /* each candidate, its number for a key */
        const hs_run *run = &block->runs[order->run[e]];
        const int32_t end = run[1].at;
        for (int32_t c = run->at; c < end; c++) {
            *to++ = (uint64_t)(uint32_t)block->id[c] << 32 | (uint32_t)c;
        }
    }
    hs_sort_numbers(order->entries, n, 32, order->spare);
    const uint64_t      *sorted = order->entries;
    int32_t *HS_RESTRICT origin = block->origin;
    float *HS_RESTRICT   column = order->column;
    for (int32_t c = 0; c < n; c++) {
        origin[c] = (int32_t)(sorted[c] & UINT32_MAX);
    }
    for (int32_t c = 0; scanner->scans == HS_BLOCK_LISTS_IDS && c < n; c++) {
        block->id[c] = (int32_t)(sorted[c] >> 32);
    }
    for (int k = 0; k < lattice->ndim; k++) {
        float *values = block->y[k];
        for (int32_t c = 0; c < n; c++) {
            column[c] = values[origin[c]];
        }
        memcpy(values, column, (size_t)n * sizeof *values);
        if (poll_large(options, block) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

/* Turns and images up to here are few: sums of four of them are int32. */
#define MOST_FEW 0x1p28

/* Whether a point has these turns; m <= HS_WRITE_MOST_DIM. */
HS_ALWAYS_INLINE bool
has_same_turns(int32_t *const *turns, int m, int32_t si, const int32_t *own)
{
    int32_t any = m > 0 ? turns[0][si] ^ own[0] : 0;
    any |= m > 1 ? turns[1][si] ^ own[1] : 0;
    any |= m > 2 ? turns[2][si] ^ own[2] : 0;
    return any == 0;
}

/* Candidates of one run; where they are moved by S, those with the same turns at a time: from one
 * to the next these seldom differ. Returns whether they are fine. */
static bool
load_halved(const hs_scanner *scanner, const hs_run *run, int32_t n, const int32_t *base,
            hs_halving by)
{
    const hs_search  *search = scanner->search;
    const hs_bins    *bins = &search->bins;
    const hs_lattice *lattice = &search->scene.lattice;
    const hs_metric  *metric = &search->scene.metric;
    const int         d = bins->ndim, m = bins->n_periodic, *column = lattice->vector_of_row;
    int32_t *const   *turns = bins->turns.narrow;
    const int32_t    *place = scanner->block.number + run->at;
    bool              are_fine = true;
    hs_candidate_run  part = {.n = n, .by = by};
    for (int k = 0; k < d; k++) {
        part.x[k] = bins->keeps_originals ? bins->originals[k] : bins->x[k];
    }
    for (int32_t from = 0, end = n; from < n; from = end) {
        int32_t shift[HS_WRITE_MOST_DIM] = {0}, own[HS_WRITE_MOST_DIM] = {0};
        for (int r = 0; r < m; r++) {
            shift[r] = run->image[r];
            part.turns[column[r]] = bins->turns.known ? turns[r] : NULL;
        }
        if (bins->keeps_originals) {
            end = from + 1;
            for (int r = 0; r < m; r++) {
                own[r] = turns[r][place[from]];
                shift[r] -= own[r];
                part.turns[column[r]] = NULL;
            }
            while (end < n && has_same_turns(turns, m, place[end], own)) {
                end++;
            }
        }
        if (!scanner->pair_batch.is_plain) {
            hs_lattice_few(lattice, shift, shift);
        }
        for (int r = 0; r < m; r++) {
            part.image[column[r]] = shift[r];
            shift[r] += bins->keeps_originals ? base[r] : 0;
        }
        part.n = end - from;
        part.place = place + from;
        part.number = scanner->block.id + run->at + from;
        (void)hs_write_move(metric, by, shift, &part.moved);
        hs_candidate *to = scanner->block.candidates + run->at + from;
        are_fine &= part.moved.is_fine &
                    (d == HS_WRITE_MOST_DIM ? search->call->kernel->candidates(&part, to)
                                            : hs_candidates_from(&part, 2, 0, to));
    }
    return are_fine;
}

hs_status
hs_scanner_load_candidates(hs_scanner *scanner, const int32_t *base)
{
    const hs_halving by = hs_write_halving(scanner->search->scene.metric.cutoff);
    hs_block        *block = &scanner->block;
    int32_t          unpolled = 0;
    if (block->has_candidates) {
        return HS_OK;
    }
    block->are_fine = true;
    for (const hs_run *run = block->runs; run->at < block->n; run++) {
        const int32_t n = run[1].at - run->at;
        if (n == 0) { /* all of it was left out */
            continue;
        }
        block->are_fine &= load_halved(scanner, run, n, base, by);
        unpolled += n;
        if (unpolled > HS_POLL_CANDIDATES) {
            unpolled = 0;
            if (hs_poll(&scanner->options, 0.0) != HS_OK) {
                return HS_ERR_INTERRUPTED;
            }
        }
    }
    block->has_candidates = true;
    return HS_OK;
}

/* Integers up to here are float64 numbers, and what the batch kernels take. */
#define WIDEST_SHIFT (INT64_C(1) << 53)

/* Whether S of hits is wanted, or else only what the metric needs. */
static bool
needs_shifts(const hs_scanner *scanner)
{
    return scanner->use == HS_BLOCK_LISTS_PLACES ||
           (scanner->chooses &&
            hs_choice_compares(scanner->search->call->choice, scanner->options.cutoff));
}

/* What follows from the search and the block of its scanner: all but the memory. */
static void
pair_batch_begin(const hs_scanner *scanner, hs_pair_batch *pair_batch)
{
    const hs_search  *search = scanner->search;
    const hs_scene   *scene = &search->scene;
    const hs_lattice *lattice = &scene->lattice;
    const bool        as_given = search->bins.keeps_originals;
    double            most = MOST_FEW; /* turns over B, so that those over given vectors are few */
    bool              is_few = true;
    pair_batch->search = search;
    pair_batch->n_rows = lattice->n_periodic;
    pair_batch->needs_given = needs_shifts(scanner) || as_given;
    pair_batch->is_plain = true;
    for (int l = 0; l < lattice->n_periodic; l++) {
        double sum = 0.0;
        for (int r = 0; r < lattice->n_periodic; r++) {
            sum += fabs((double)lattice->U[r][l]);
            pair_batch->is_plain = pair_batch->is_plain && lattice->U[r][l] == (r == l);
        }
        most = hs_smaller(most, MOST_FEW / sum); /* no row of zeros: B is a basis */
    }
    for (int k = 0; k < scene->ndim; k++) {
        const double images = (double)(search->grid.reach[k] / search->grid.shape[k]);
        is_few = is_few && (lattice->row_of_axis[k] < 0 || images < most);
    }
    /* Every S of the scene is the sum of an image and of turns that are known to be few, over B and
     * over the box vectors as given. Where these differ, writers measure by S alone. */
    pair_batch->is_narrow =
        is_few && (pair_batch->is_plain || as_given) &&
        (!search->bins.turns.known || hs_fold_turns(lattice, scene->cloud.largest) < most);
    pair_batch->block = &scanner->block;
    hs_pair_batch_clear(pair_batch);
}

static hs_status
pair_batch_init(hs_scanner *scanner, hs_pair_batch *pair_batch)
{
    const hs_search *search = scanner->search;
    const int        d = search->scene.ndim;
    const int64_t    batch = HS_BATCH + HS_BATCH_PADDING;
    hs_parts         parts;
    pair_batch_begin(scanner, pair_batch);
    hs_parts_begin(&parts);
    hs_parts_add(&parts, (void **)&pair_batch->place, HS_BATCH, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&pair_batch->si, HS_BATCH, sizeof(int32_t));
    for (int k = 0; k < d; k++) {
        hs_parts_add(&parts, (void **)&pair_batch->p[k], batch, sizeof(double));
        hs_parts_add(&parts, (void **)&pair_batch->q[k], batch, sizeof(double));
    }
    for (int r = 0; r < pair_batch->n_rows; r++) {
        hs_parts_add(&parts, (void **)&pair_batch->times[r], batch, sizeof(double));
        hs_parts_add(&parts, (void **)&pair_batch->image[r], HS_BATCH, sizeof(int64_t));
        if (pair_batch->needs_given) {
            hs_parts_add(&parts, (void **)&pair_batch->given[r], HS_BATCH, sizeof(int64_t));
        }
    }
    if (needs_shifts(scanner) && pair_batch->is_narrow && search->call->kernel->write != NULL &&
        d >= 2 && d <= HS_WRITE_MOST_DIM) {
        hs_parts_add(&parts, (void **)&scanner->block.candidates, scanner->block.capacity,
                     sizeof(hs_candidate));
    }
    pair_batch->memory = hs_parts_alloc(&search->call->account, HS_FOR_CANDIDATES, &parts);
    return pair_batch->memory != NULL ? HS_OK : HS_ERR_MEMORY;
}

int32_t
hs_pair_batch_add(hs_pair_batch *pair_batch, int32_t si, const int32_t *places, int32_t n)
{
    const int32_t room = HS_BATCH - pair_batch->n;
    int32_t      *place = pair_batch->place + pair_batch->n, *of = pair_batch->si + pair_batch->n;
    n = n < room ? n : room;
    for (int32_t e = 0; e < n; e++) {
        place[e] = places[e];
        of[e] = si;
    }
    pair_batch->n += n;
    return n;
}

/* The run that a place is in. The number of steps depends on that of runs alone: branches on where
 * the place is would be guessed, half of them wrongly. */
static const hs_run *
run_of(const hs_block *block, int32_t place)
{
    const hs_run *run = block->runs;
    for (int32_t n = block->n_runs, half; n > 1;
         n -= half) { /* it is one of run[0] to run[n - 1] */
        half = n / 2;
        run += run[half].at <= place ? half : 0;
    }
    return run;
}

/* S = image + turns_i - turns_j over B, then over the box vectors as given. Without turns they are
 * all known to cancel or not to be needed. number: of the candidates, in cell order. Returns the
 * first pair whose S passes its range, or their number. */
static int32_t
look_up_given(hs_pair_batch *pair_batch, const int32_t *number)
{
    const hs_search *search = pair_batch->search;
    const hs_turns  *of_i = &hs_search_asking(search)->turns, *of_j = &search->bins.turns;
    const int32_t    n = pair_batch->n;
    for (int r = 0; r < pair_batch->n_rows; r++) {
        int64_t *to = pair_batch->given[r];
        memcpy(to, pair_batch->image[r], (size_t)n * sizeof *to);
        for (int32_t e = 0; of_i->known && e < n; e++) {
            to[e] += hs_turns_get(of_i, r, pair_batch->si[e]);
        }
        for (int32_t e = 0; of_j->known && e < n; e++) {
            to[e] -= hs_turns_get(of_j, r, number[e]);
        }
    }
    for (int32_t e = 0; !pair_batch->is_plain && e < n; e++) {
        int64_t reduced[HS_MAX_DIM], given[HS_MAX_DIM];
        for (int r = 0; r < pair_batch->n_rows; r++) {
            reduced[r] = pair_batch->given[r][e];
        }
        if (!hs_lattice_shift(&search->scene.lattice, reduced, given)) {
            return e;
        }
        for (int r = 0; r < pair_batch->n_rows; r++) {
            pair_batch->given[r][e] = given[r];
        }
    }
    return n;
}

hs_status
hs_pair_batch_look_up(hs_pair_batch *pair_batch, bool metric, int64_t *failed_point)
{
    const hs_block *block = pair_batch->block;
    const hs_bins *bins = &pair_batch->search->bins, *asking = hs_search_asking(pair_batch->search);
    const bool     as_given = bins->keeps_originals;
    const bool     has_images = block->has_images;
    const int32_t  n = pair_batch->n, *place = pair_batch->place, *si = pair_batch->si;
    int32_t        number[HS_BATCH];
    int64_t        any = 0, wide = 0;
    for (int32_t e = 0; e < n; e++) {
        number[e] = block->number[place[e]];
    }
    for (int k = 0; metric && k < bins->ndim; k++) {
        const double *of_p = as_given ? asking->originals[k] : asking->x[k];
        const double *of_q = as_given ? bins->originals[k] : bins->x[k];
        for (int32_t e = 0; e < n; e++) {
            pair_batch->p[k][e] = of_p[si[e]];
            pair_batch->q[k][e] = of_q[number[e]];
        }
    }
    const hs_run *run = block->runs;
    for (int32_t e = 0; has_images && e < n; e++) {
        /* Hits of a point ascend, unless candidates were put in order. */
        if (place[e] < run->at || block->origin != NULL) {
            run = run_of(block, place[e]);
        }
        while (place[e] >= run[1].at) {
            run++;
        }
        for (int r = 0; r < pair_batch->n_rows; r++) {
            pair_batch->image[r][e] = run->image[r];
        }
    }
    for (int r = 0; !has_images && r < pair_batch->n_rows; r++) {
        memset(pair_batch->image[r], 0, (size_t)n * sizeof *pair_batch->image[r]);
    }
    if (pair_batch->needs_given) {
        const int32_t fitting = look_up_given(pair_batch, number);
        if (fitting < n) {
            *failed_point = asking->order[si[fitting]];
            return HS_ERR_SHIFT_RANGE;
        }
    }
    if (has_images || as_given) { /* else the metric's shifts are zeros, which are not read */
        for (int r = 0; r < pair_batch->n_rows; r++) {
            const int64_t *from = as_given ? pair_batch->given[r] : pair_batch->image[r];
            for (int32_t e = 0; e < n; e++) {
                pair_batch->times[r][e] = (double)from[e];
                any |= from[e];
                wide |= from[e] > WIDEST_SHIFT || from[e] < -WIDEST_SHIFT;
            }
        }
    }
    pair_batch->is_shifted = any != 0;
    pair_batch->is_wide = wide != 0;
    return HS_OK;
}

/* Batch kernels read a little beyond the last of n entries, where any finite numbers will do. */
static const double *
end_with_zeros(double *entries, int32_t n)
{
    memset(entries + n, 0, HS_BATCH_PADDING * sizeof *entries);
    return entries;
}

hs_batch
hs_pair_batch_view(hs_pair_batch *pair_batch)
{
    hs_batch batch = {.n = pair_batch->n};
    for (int k = 0; k < pair_batch->search->scene.ndim; k++) {
        batch.p[k] = end_with_zeros(pair_batch->p[k], pair_batch->n);
        batch.q[k] = end_with_zeros(pair_batch->q[k], pair_batch->n);
    }
    for (int r = 0; pair_batch->is_shifted && r < pair_batch->search->scene.lattice.n_periodic;
         r++) {
        batch.shift[r] = end_with_zeros(pair_batch->times[r], pair_batch->n);
    }
    return batch;
}

const int64_t *
hs_pair_batch_pair(const hs_pair_batch *pair_batch, int32_t e, double *p, double *q, int64_t *shift)
{
    const bool as_given = pair_batch->search->bins.keeps_originals;
    for (int k = 0; k < pair_batch->search->scene.ndim; k++) {
        p[k] = pair_batch->p[k][e];
        q[k] = pair_batch->q[k][e];
    }
    if (!pair_batch->is_shifted) {
        return NULL;
    }
    for (int r = 0; r < pair_batch->search->scene.lattice.n_periodic; r++) {
        shift[r] = as_given ? pair_batch->given[r][e] : pair_batch->image[r][e];
    }
    return shift;
}

/* Candidates from which on those are left out that are far from the whole group: with fewer that
 * costs what it saves. Fewer will do for a group whose pairs reach less far than the cutoff. */
#ifdef HS_TESTING
#define WORTH_PRUNING      24 /* so that small scenes have both */
#define WORTH_PRUNING_MORE 8
#else
#define WORTH_PRUNING      300
#define WORTH_PRUNING_MORE 64
#endif
#define SHORTER      0.85 /* of the cutoff: half of its ball, about */
#define EXTENT_SHIFT 18   /* bits of the mantissa that extents do without */

/* The form for |y_k| and |q_k| up to the float >= 0 of these bits, rounded up to the top five bits
 * of its mantissa, which adds 1/32 at most; NaN and infinity remain. So there are few extents, and
 * what a consumer needs of each can be computed once. */
static hs_form
form_of(const hs_scanner *scanner, uint32_t bits)
{
    const hs_scene  *scene = &scanner->search->scene;
    const hs_limits *limits = scanner->search->limits;
    const bool       by_supports = limits != NULL && limits->supports != NULL;
    const uint32_t   mask = (UINT32_C(1) << EXTENT_SHIFT) - 1;
    const uint32_t   rounded = bits < UINT32_C(0x7f800000) ? (bits + mask) & ~mask : bits;
    const double     extent = 2.0 * (double)hs_float_of_bits(rounded);
    const double     error = scanner->search->filter_error;
    const double     low = scene->cutoff_low; /* a scaled cutoff may be known between bounds only */
    const int        d = scene->ndim;
    hs_form          form = {.extent = extent};
    form.kind = by_supports ? HS_SCAN_SUPPORTS : limits != NULL ? HS_SCAN_LIMITS : HS_SCAN_DIRECT;
    /* Supports are decided alike in all precisions: what the filter leaves, by a fixed formula. */
    if (scanner->options.precision == HS_SINGLE && !by_supports) {
        const float square = (float)(scene->cutoff * scene->cutoff);
        form.direct.out = scanner->options.inclusive ? square : nextafterf(square, -1.0f);
        form.direct.in = INFINITY; /* one float32 comparison: no hit is unsure */
        form.limits = (hs_limit_form){1.0f, 0.0f, 1.0f, 0.0f};
        return form;
    }
    form.direct = hs_thresholds_of(d, scene->cutoff, extent, error);
    if (scene->extreme) {
        form.direct.in = low > 0.0 ? hs_thresholds_of(d, low, extent, error).in : -1.0f;
    }
    if (by_supports) {
        form.limits = hs_support_form_of(d, extent, error);
    } else if (limits != NULL) {
        form.limits = hs_limit_form_of(d, extent, error);
    } else if (scanner->scans == HS_BLOCK_LISTS_SQUARES) {
        form.kind = HS_SCAN_SQUARES;
    }
    return form;
}

/* Lets candidates of the present group be left out that are beyond the cutoff of all its points, or
 * their limits, where the block has so many that this is worth it. */
static void
form_prune(hs_scanner *scanner)
{
    const hs_search *search = scanner->search;
    const hs_bins   *bins = hs_search_asking(search);
    const hs_limits *limits = search->limits;
    hs_group        *group = &scanner->group;
    const double     error = search->filter_error;
    double           cutoff = search->scene.cutoff; /* no pair is compared with more than this: */
    float            asking = 0.0f, largest = 0.0f;
    if (limits != NULL && (limits->of_asking.near != NULL || limits->of_points.near != NULL)) {
        /* the limit of the group's radii, where those of all points do not make it as long */
        for (int32_t si = group->first; limits->of_asking.near != NULL && si < group->last; si++) {
            asking = fmaxf(asking, limits->of_asking.near[si]);
        }
        const hs_dw limit = hs_limit_by(limits->rule, 1.0, (double)asking,
                                        (double)limits->of_points.most, (double)limits->near_bound);
        /* More than what float32 and a sum have lost. */
        cutoff = hs_smaller((limit.hi + 0x1p-20 * cutoff) * (1.0 + 0x1p-20), cutoff);
    }
    const bool is_shorter = cutoff < SHORTER * search->scene.cutoff;
    if (scanner->block.n < (is_shorter ? WORTH_PRUNING_MORE : WORTH_PRUNING)) {
        return;
    }
    group_load(bins, group);
    for (int k = 0; k < bins->ndim; k++) {
        float low = group->q[k][0], high = low;
        for (int32_t t = 1; t < group->last - group->first; t++) {
            low = group->q[k][t] < low ? group->q[k][t] : low;
            high = group->q[k][t] > high ? group->q[k][t] : high;
        }
        group->near.low[k] = low;
        group->near.high[k] = high;
        largest = fmaxf(largest, fmaxf(-low, high));
    }
    const double extent = hs_reach_extent(search->scene.cutoff, (double)largest, error);
    const float  half = (float)(0.5 * extent * (1.0 + 0x1p-23)); /* no less, when rounded */
    /* Otherwise y might not be a float. Own points are kept whatever the threshold is. */
    if (half < 0x1p100f) {
        const hs_form form = form_of(scanner, hs_bits_of_float(half));
        float         out = form.direct.out;
        if (is_shorter) {
            out = hs_thresholds_of(search->scene.ndim, cutoff, form.extent, error).out;
        }
        group->near.out = fmaxf(out, 0.0f);
    }
}

/* Sets all but what has memory. What a choice looks at are places. */
static void
begin(hs_search *search, hs_block_use use, bool is_ordered, hs_scanner *scanner)
{
    const hs_choice *choice = use != HS_BLOCK_SIZES ? search->call->choice : NULL;
    memset((char *)scanner + offsetof(hs_scanner, search), 0,
           sizeof *scanner - offsetof(hs_scanner, search));
    scanner->search = search;
    scanner->options = search->call->options;
    scanner->use = scanner->scans = use;
    scanner->chooses = choice != NULL;
    if (choice != NULL && (use == HS_BLOCK_COUNTS || use == HS_BLOCK_LISTS_IDS)) {
        scanner->scans = HS_BLOCK_LISTS_PLACES;
    }
    scanner->is_ordered = is_ordered;
    scanner->gather_limit = INT64_MAX;
}

hs_status
hs_scanner_init(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                bool is_ordered, hs_scanner *scanner)
{
    begin(search, use, is_ordered, scanner);
    scanner->pair_batch.memory = NULL; /* freed also when never set */
    const hs_status status = block_init(scanner, capacity, most_runs);
    return status == HS_OK ? pair_batch_init(scanner, &scanner->pair_batch) : status;
}

bool
hs_scanner_renew(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                 hs_scanner *scanner)
{
    const hs_block *block = &scanner->block;
    hs_pair_batch  *pair_batch = &scanner->pair_batch;
    const int       n_rows = pair_batch->n_rows;
    const bool      has_given = pair_batch->needs_given, was_narrow = pair_batch->is_narrow;
    if (block->memory == NULL || capacity > block->capacity || most_runs > block->most_runs) {
        return false;
    }
    HS_ASSERT(scanner->search == search && scanner->use == use && !scanner->is_ordered &&
              scanner->chooses == (search->call->choice != NULL));
    HS_ASSERT(search->limits == NULL && block->radius == NULL);
    begin(search, use, false, scanner);
    pair_batch_begin(scanner, pair_batch);
    return pair_batch->n_rows == n_rows && pair_batch->needs_given == has_given &&
           pair_batch->is_narrow == was_narrow;
}

void
hs_scanner_flush_counters(hs_search *search, hs_scanner *scanner)
{
    const hs_counters walked = {.groups = scanner->n_groups,
                                .candidates = scanner->n_candidates,
                                .ambiguous = scanner->n_ambiguous,
                                .by_float64 = scanner->stages.by_float64,
                                .by_double_word = scanner->stages.by_double_word,
                                .by_integers = scanner->stages.by_integers};
    hs_call_add_counters(search->call, &walked);
    scanner->n_groups = scanner->n_candidates = scanner->n_ambiguous = 0;
    scanner->stages = (hs_stages){0};
}

/* A batch of pairs at a time by the batch kernel; pairs that it leaves, one by one. */

/* A fraction of the square of the cutoff, far above the rounding of a sum of 8 squares. */
#define SCALED_MARGIN 0x1p-47

/* Takes the first n of scan->unsure from the hits of points [first, next), or where these are not
 * listed from their counts. */
static void
remove_hits(hs_scan *scan, int32_t n, int32_t first, int32_t next, bool are_listed)
{
    int32_t t = first;
    for (int32_t r = 0; r < n; r++) {
        for (; t < scan->unsure[r].t; t++) {
            scan->end[t] -= r;
        }
        if (are_listed) {
            const int32_t from = scan->unsure[r].at + 1;
            const int32_t to = r + 1 < n ? scan->unsure[r + 1].at : (int32_t)scan->n_hits;
            const size_t  between = (size_t)(to - from);
            memmove(scan->hits + from - r - 1, scan->hits + from, between * sizeof *scan->hits);
            if (scan->squares != NULL) {
                memmove(scan->squares + from - r - 1, scan->squares + from,
                        between * sizeof *scan->squares);
            }
        }
    }
    for (; t < next; t++) {
        scan->end[t] -= n;
    }
    scan->n_hits -= n;
}

/*
 * Where squares would leave float64's range: decides by differences that are scaled so that the
 * cutoff is r in [1, 2). Rounding and what scaling loses change the sum of d squares, where it is
 * near r^2, by at most (d + 4) 2^-53 of it. Pairs without a shift only.
 */
static void
decide_scaled(const hs_metric *metric, const hs_pair_batch *pair_batch, uint8_t *verdict,
              hs_stages *stages)
{
    const hs_scale scale = hs_scale_of(metric->cutoff > 0.0 ? ilogb(metric->cutoff) : 0);
    const double   r = hs_scale_apply(scale, metric->cutoff);
    const double   in = r * r * (1.0 - SCALED_MARGIN), out = r * r * (1.0 + SCALED_MARGIN);
    double         square[HS_BATCH] = {0.0}, size[HS_BATCH] = {0.0};
    for (int k = 0; k < metric->ndim; k++) {
        for (int32_t e = 0; e < pair_batch->n; e++) {
            const double component = pair_batch->q[k][e] - pair_batch->p[k][e];
            const double scaled = hs_scale_apply(scale, component);
            square[e] += scaled * scaled;
            size[e] += fabs(component); /* for cutoff 0: 0 only if all are */
        }
    }
    for (int32_t e = 0; e < pair_batch->n; e++) {
        const bool within = r > 0.0 ? square[e] < in : size[e] == 0.0 && metric->inclusive;
        const bool beyond = r > 0.0 ? square[e] > out : !within;
        verdict[e] = within   ? (uint8_t)HS_WITHIN
                     : beyond ? (uint8_t)HS_BEYOND
                              : (uint8_t)HS_UNDECIDED;
        stages->by_float64 += within || beyond;
    }
}

void
hs_decide_pair_batch(hs_scanner *scanner, const hs_metric *metric, uint8_t *within)
{
    hs_pair_batch *pair_batch = &scanner->pair_batch;
    const bool     by_batch = scanner->options.precision != HS_DOUBLE && !pair_batch->is_wide;
    uint8_t        verdict[HS_BATCH + HS_BATCH_PADDING];
    if (by_batch && !metric->floats_usable && !pair_batch->is_shifted) {
        decide_scaled(metric, pair_batch, verdict, &scanner->stages);
    } else if (by_batch) {
        const hs_batch batch = hs_pair_batch_view(pair_batch);
        scanner->search->call->kernel->decide_batch(metric, &batch, verdict, &scanner->stages);
    }
    for (int32_t e = 0; e < pair_batch->n; e++) {
        double         p[HS_MAX_DIM], q[HS_MAX_DIM];
        int64_t        of_pair[HS_MAX_DIM];
        const int64_t *shift;
        if (by_batch && verdict[e] != HS_UNDECIDED) {
            within[e] = verdict[e] == HS_WITHIN;
            continue;
        }
        shift = hs_pair_batch_pair(pair_batch, e, p, q, of_pair);
        within[e] = scanner->options.precision == HS_DOUBLE
                        ? hs_metric_within_double(metric, p, q, shift)
                    : by_batch ? hs_metric_decide_by_integers(metric, p, q, shift, &scanner->stages)
                               : hs_metric_within(metric, p, q, shift, &scanner->stages);
    }
}

/* A hs_decide_fn: whether pairs are within what they are compared with. */
static hs_status
decide_within(hs_scanner *scanner, uint8_t *within)
{
    if (scanner->search->limits != NULL) {
        hs_limits_decide(scanner, within);
    } else {
        hs_decide_pair_batch(scanner, &scanner->search->scene.metric, within);
    }
    return HS_OK;
}

hs_status
hs_scanner_decide(hs_scanner *scanner, hs_scan *scan, int32_t first, int32_t next, hs_decide_fn by)
{
    hs_pair_batch *pair_batch = &scanner->pair_batch;
    int32_t        n_gone = 0;
    uint8_t        stays[HS_BATCH];
    for (int32_t u = 0, end = 0; u < scan->n_unsure; u = end) {
        hs_pair_batch_clear(pair_batch);
        for (; end < scan->n_unsure && pair_batch->n < HS_BATCH; end++) {
            const hs_unsure unsure = scan->unsure[end];
            hs_pair_batch_put(pair_batch, scanner->group.first + unsure.t,
                              scanner->is_ordered ? scanner->block.origin[unsure.place]
                                                  : unsure.place);
        }
        hs_status status = hs_pair_batch_look_up(pair_batch, true, &scanner->failed_point);
        status = status == HS_OK ? by(scanner, stays) : status;
        if (status != HS_OK) {
            return status;
        }
        for (int32_t e = 0; e < end - u; e++) {
            scan->unsure[n_gone] = scan->unsure[u + e]; /* those that go gather in front */
            n_gone += !stays[e];
        }
    }
    if (n_gone > 0) {
        remove_hits(scan, n_gone, first, next, scanner->scans != HS_BLOCK_COUNTS);
    }
    return HS_OK;
}

/* Candidates between two calls of poll(): some milliseconds. */
#define POLL_WORK   (INT64_C(1) << 21)
#define WORK_OF_RUN 32 /* candidates that could be tested while a run of them is found */

/* Work of a block beside that of its candidates, in candidates. */
#define WORK_OF_BLOCK 64

/* Blocks with subnormal numbers before the filter flushes: some lie behind the last candidate. */
#define FEW_SUBNORMAL 16

/* The present block and group as a kernel sees them. */
static void
set_scan(const hs_scanner *scanner, hs_scan *scan)
{
    const hs_block *block = &scanner->block;
    const bool      lists_places = scanner->scans == HS_BLOCK_LISTS_PLACES;
    scan->form = scanner->form.kind;
    scan->counts = scanner->scans == HS_BLOCK_COUNTS;
    scan->ndim = scanner->search->scene.ndim;
    for (int k = 0; k < scan->ndim; k++) {
        scan->y[k] = block->y[k];
        scan->q[k] = scanner->group.q[k];
    }
    scan->label = block->place == NULL                       ? block->id
                  : scanner->is_ordered && !scanner->chooses ? block->origin
                                                             : block->place;
    scan->n = block->n;
    scan->n_points = scanner->group.last - scanner->group.first;
    scan->triangular = scanner->block_is_first;
    scan->direct = scanner->form.direct;
    scan->hits = block->hits;
    if (scanner->search->limits != NULL) {
        hs_limits_set(scanner, scan);
    }
    scan->squares = block->squares;
    scan->unsure = block->unsure;
    scan->n_unsure = 0;
    scan->most_hits = block->most_hits;
    if (!lists_places && block->hits != NULL && scan->most_hits > 2 * HS_BURST) {
        HS_ASSERT(block->n + HS_BURST <= block->most_hits);
        scan->most_hits = block->n + HS_BURST;
    }
    scan->most_unsure = block->capacity;
}

/*
 * Copies what was appended, but for candidates that are not near the group. The first block of a
 * group must begin with the group's own points, in the image 0: they are kept as its q. Polls now
 * and then in a large block.
 */
static hs_status
gather_block(hs_scanner *scanner)
{
    const hs_bins *bins = &scanner->search->bins;
    hs_block      *block = &scanner->block;
    hs_group      *group = &scanner->group;
    hs_gather      gather = {.ndim = bins->ndim,
                             .order = bins->order,
                             .id = block->id,
                             .number = block->number,
                             .near = group->near,
                             .largest = group->largest};
    for (int k = 0; k < bins->ndim; k++) {
        gather.x[k] = bins->x[k];
        gather.y[k] = block->y[k];
    }
    block->runs[block->n_runs].at = block->n;
    for (int32_t first = 0, end; first < block->n_runs; first = end) {
        const int32_t left = block->n_runs - first;
        if (first > 0 && hs_poll(&scanner->options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
        end = first + (left < RUNS_PER_POLL ? left : RUNS_PER_POLL);
        scanner->search->call->kernel->gather(&gather, block->runs + first, end - first);
    }
    group->largest = gather.largest;
    block->n = block->runs[block->n_runs].at = gather.n;
    for (int k = 0; k < bins->ndim; k++) {
        hs_pad_lanes(block->y[k], block->n);
    }
    const int32_t n_places = block->place != NULL ? block->n + HS_PADDING : 0;
    for (; block->n_places < n_places; block->n_places++) {
        block->place[block->n_places] = block->n_places;
    }
    if (scanner->block_is_first) {
        HS_ASSERT(block->runs[0].si == group->first && block->n >= group->last - group->first);
        const size_t bytes = (size_t)(group->last - group->first) * sizeof(float);
        for (int k = 0; k < bins->ndim; k++) {
            memcpy(group->q[k], block->y[k], bytes);
        }
    }
    return HS_OK;
}

/* Empties the block; ends the walk if a limit or the visitor says so, else polls now and then. */
static hs_status
end_block(hs_scanner *scanner)
{
    scanner->block.n = 0;
    scanner->block.n_runs = 0;
    scanner->block.has_images = false;
    scanner->block_is_first = false;
    scanner->blocks++;
    if (scanner->n_gathered > scanner->gather_limit || scanner->leaves) {
        return HS_STOPPED;
    }
    if (scanner->work_since_poll > POLL_WORK) {
        scanner->work_since_poll = 0;
        return hs_poll(&scanner->options,
                       hs_search_fraction(scanner->search, scanner->group.first));
    }
    return HS_OK;
}

hs_status
hs_scanner_scan(hs_scanner *scanner)
{
    const hs_search *search = scanner->search;
    const hs_block  *block = &scanner->block;
    int32_t          end[HS_GROUP_POINTS];
    hs_scan          scan;
    const bool       is_skipped = scanner->blocks < scanner->blocks_to_skip;
    if (!is_skipped && scanner->use == HS_BLOCK_SIZES) { /* its size is all that is wanted */
        hs_neighbourhood *most = &scanner->most, *of = &scanner->of_group;
        of->candidates += block->n;
        of->runs += block->n_runs;
        most->candidates = of->candidates > most->candidates ? of->candidates : most->candidates;
        most->runs = of->runs > most->runs ? of->runs : most->runs;
        scanner->work_since_poll += WORK_OF_RUN * (int64_t)block->n_runs;
        return end_block(scanner);
    }
    if (is_skipped || block->n == (scanner->block_is_first ? 1 : 0)) {
        /* Nothing else has been appended than, in a half list, the one point of the group. */
        scanner->work_since_poll += is_skipped ? 0 : WORK_OF_BLOCK;
        return end_block(scanner);
    }
    scanner->n_blocks++;
    scanner->n_gathered += block->n;
    scanner->work_since_poll += WORK_OF_BLOCK + block->n;
    if (!(scanner->group.near.out < INFINITY)) {
        form_prune(scanner);
    }
    if (scanner->flushes) {
        hs_fpenv_flush(true);
    }
    hs_status status = gather_block(scanner);
    if (scanner->flushes) {
        hs_fpenv_flush(false);
    }
    if (status != HS_OK) {
        return status;
    }
    scanner->block.has_candidates = false;
    scanner->form = form_of(scanner, scanner->group.largest);
    status = scanner->is_ordered ? order_block(scanner) : HS_OK;
    if (status == HS_ERR_SHIFT_RANGE) {
        scanner->failed_point = hs_search_asking(search)->order[scanner->group.first];
    }
    if (status != HS_OK) {
        return status;
    }
    set_scan(scanner, &scan);
    scan.end = end;
    for (int32_t first = 0, next; status == HS_OK && first < scan.n_points; first = next) {
        if (scanner->flushes) {
            hs_fpenv_flush(true);
        }
        next = scanner->search->call->kernel->scan(&scan, first);
        if (scanner->flushes) {
            hs_fpenv_flush(false);
        }
        if (scan.n_unsure > 0 &&
            (scanner->options.precision != HS_SINGLE || search->limits != NULL)) {
            scanner->n_ambiguous += scan.n_unsure;
            status = hs_scanner_decide(scanner, &scan, first, next, decide_within);
        }
        if (HS_UNLIKELY(scanner->chooses) && status == HS_OK) {
            status = hs_choose(scanner, &scan, first, next);
        }
        scanner->n_found += scan.n_hits;
        if (status == HS_OK && scanner->visit != NULL && scan.n_hits > 0) {
            const int32_t si = scanner->group.first + first;
            const hs_hits hits = {.n = next - first,
                                  .point = hs_search_asking(search)->order + si,
                                  .end = scan.end + first,
                                  .label = scan.hits};
            status = scanner->visit(scanner->visit_context, scanner, si, &hits);
        }
    }
    if (status != HS_OK) {
        return status;
    }
    const int64_t n_points = scan.n_points;
    scanner->n_candidates += n_points * block->n;
    scanner->n_candidates -= scanner->block_is_first ? n_points * (n_points + 1) / 2 : 0;
    scanner->work_since_poll += n_points * block->n;
    if (!scanner->flushes && hs_fpenv_met_subnormal()) {
        hs_fpenv_flush(false); /* forgets the flag */
        /* precision="single" is decided by the filter: it must not flush */
        scanner->flushes = scanner->options.precision != HS_SINGLE &&
                           ++scanner->n_subnormal > FEW_SUBNORMAL;
    }
    return end_block(scanner);
}

void
hs_scanner_start(hs_scanner *scanner, int32_t first, int32_t last)
{
    const hs_search *search = scanner->search;
    const hs_bins   *asking = hs_search_asking(search);
    hs_group        *group = &scanner->group;
    scanner->n_groups += scanner->use != HS_BLOCK_SIZES;
    scanner->blocks = 0;
    scanner->block.n = 0;
    scanner->block.n_runs = 0;
    scanner->block.has_images = false;
    scanner->block_is_first = !search->is_full;
    scanner->of_group = (hs_neighbourhood){0, 0};
    group->first = first;
    group->last = last;
    group->largest = 0;
    group->near.out = INFINITY;
    /* Any double will do as a centre; one of the points is near all of them. */
    const int32_t middle = first + (last - first) / 2;
    for (int k = 0; k < asking->ndim; k++) {
        group->centre[k] = asking->x[k][middle];
    }
    if ((search->is_full || scanner->blocks_to_skip > 0) && scanner->use != HS_BLOCK_SIZES) {
        group_load(asking, group);
    }
}

hs_status
hs_scanner_append(hs_scanner *scanner, int32_t si, int32_t end, const double *shift,
                  const int32_t *image)
{
    hs_block *block = &scanner->block;
    while (si < end) {
        if (block->n == block->capacity || block->n_runs == block->most_runs) {
            const hs_status status = hs_scanner_scan(scanner);
            if (status != HS_OK) {
                return status;
            }
        }
        const int32_t room = block->capacity - block->n;
        const int32_t n = end - si < room ? end - si : room;
        hs_run       *run = &block->runs[block->n_runs++];
        run->at = block->n;
        run->si = si;
        memcpy(run->image, image, sizeof run->image);
        for (int r = 0; r < scanner->search->bins.n_periodic; r++) {
            block->has_images |= image[r] != 0;
        }
        for (int k = 0; k < scanner->search->scene.ndim; k++) {
            /* One rounding here and one for the sum: hs_grid.shift_error bounds the first, filter.h
             * counts on the second. */
            run->moved[k] = shift[k] - scanner->group.centre[k];
        }
        block->n += n;
        si += n;
        if (block->n_runs % RUNS_PER_POLL == 0 &&
            hs_poll(&scanner->options, hs_search_fraction(scanner->search, scanner->group.first)) !=
                HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}
