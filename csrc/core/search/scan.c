/* SPDX-License-Identifier: BSD-3-Clause */
/* scan.c: a block is gathered, scanned for some points at a time, and what they hit is decided. */
#include "scan.h"

#include "choice.h"
#include "choose.h"
#include "decide.h"
#include "form.h"
#include "limits.h"
#include "open_scanner.h"
#include "supports.h"
#include "../base/outcome.h"
#include "../base/fpenv.h"
#include "../base/poll.h"

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
    const hs_limits *limits = scanner->search->limits;
    const hs_block  *block = &scanner->block;
    const bool       lists_places = scanner->scans == HS_BLOCK_LISTS_PLACES;
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
    scan->norm = block->norm;
    scan->direct = scanner->form->direct;
    scan->expanded = scanner->form->expanded;
    scan->hits = block->hits;
    if (limits != NULL && limits->supports != NULL) {
        hs_supports_set(scanner, scan);
    } else if (limits != NULL) {
        hs_limits_set(scanner, &scanner->form->limits, &scan->limits);
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

static void
set_flushing(const hs_scanner *scanner, bool on)
{
    if (scanner->flushes) {
        hs_fpenv_flush(on);
    }
}

static int32_t
run_scan(const hs_scanner *scanner, hs_scan *scan, int32_t first)
{
    set_flushing(scanner, true);
    const int32_t next = scanner->form->scan(scan, first);
    set_flushing(scanner, false);
    return next;
}

/* precision="single" is decided by the filter: it must not flush. */
static void
note_subnormals(hs_scanner *scanner)
{
    if (!scanner->flushes && hs_fpenv_met_subnormal()) {
        hs_fpenv_flush(false); /* forgets the flag */
        scanner->flushes = scanner->options.precision != HS_SINGLE &&
                           ++scanner->n_subnormal > FEW_SUBNORMAL;
    }
}

/* Hands the hits of points [first, next) of the group to the visitor. */
static hs_status
visit_hits(hs_scanner *scanner, const hs_scan *scan, int32_t first, int32_t next)
{
    const int32_t si = scanner->group.first + first;
    const hs_hits hits = {.n = next - first,
                          .point = hs_search_asking(scanner->search)->order + si,
                          .end = scan->end + first,
                          .label = scan->hits};
    return scanner->visit(scanner->visit_context, scanner, si, &hits);
}

/* Makes the block ready to be scanned: gathers it, and sorts it where that is wanted. */
static hs_status
fill_block(hs_scanner *scanner)
{
    hs_block *block = &scanner->block;
    scanner->n_blocks++;
    scanner->work_since_poll += WORK_OF_BLOCK + block->n;
    if (!(scanner->group.near.out < INFINITY)) {
        hs_form_prune(scanner);
    }
    set_flushing(scanner, true);
    hs_status status = hs_block_gather(&scanner->search->bins, scanner->search->call->kernel,
                                       &scanner->options, scanner->block_is_first, block,
                                       &scanner->group);
    set_flushing(scanner, false);
    if (status != HS_OK) {
        return status;
    }
    hs_records_reset(&scanner->trace.of);
    hs_form_set(scanner);
    if (!scanner->is_ordered) {
        return HS_OK;
    }
    status = hs_order_block(&scanner->search->scene.lattice, &scanner->options, scanner->scans,
                            block, &scanner->order);
    if (status == HS_ERR_SHIFT_RANGE) {
        scanner->failed_point = hs_search_asking(scanner->search)->order[scanner->group.first];
    }
    return status;
}

static hs_status
poll_sometimes(hs_scanner *scanner)
{
    if (scanner->work_since_poll > POLL_WORK) {
        scanner->work_since_poll = 0;
        return hs_poll(&scanner->options, hs_scanner_fraction(scanner));
    }
    return HS_OK;
}

static void
empty_block(hs_scanner *scanner)
{
    scanner->block.n = 0;
    scanner->block.n_runs = 0;
    scanner->block_is_first = false;
    scanner->blocks++;
}

/* Adds the size of the block to that of the neighbourhood; scans nothing. */
static hs_status
note_size(hs_scanner *scanner)
{
    scanner->of_group.candidates += scanner->block.n;
    scanner->of_group.runs += scanner->block.n_runs;
    scanner->work_since_poll += WORK_OF_RUN * (int64_t)scanner->block.n_runs;
    empty_block(scanner);
    return poll_sometimes(scanner);
}

/* Ends the walk if a limit or the visitor says so; else polls now and then. */
static hs_status
end_block(hs_scanner *scanner)
{
    if (scanner->n_candidates > scanner->candidate_limit || scanner->leaves) {
        return HS_STOPPED;
    }
    return poll_sometimes(scanner);
}

/* Counts what was tested, and empties the block. */
static hs_status
finish_block(hs_scanner *scanner, int64_t n_points)
{
    const hs_block *block = &scanner->block;
    const int64_t   skipped = scanner->block_is_first ? n_points * (n_points + 1) / 2 : 0;
    scanner->n_candidates += n_points * block->n - skipped;
    scanner->work_since_poll += n_points * block->n;
    empty_block(scanner);
    note_subnormals(scanner);
    return end_block(scanner);
}

/* Nothing has been appended or, in a half list, only the one point of the group itself. */
static bool
is_lone(const hs_scanner *scanner)
{
    return scanner->block.n == (scanner->block_is_first ? 1 : 0);
}

/* Decides the unsure hits of points [first, next) of the group. */
static hs_status
decide(hs_scanner *scanner, hs_scan *scan, int32_t first, int32_t next)
{
    hs_status status = HS_OK;
    if (scanner->trace.memory == NULL) {
        status = hs_scanner_open_trace(scanner);
    }
    return status == HS_OK ? hs_decide(scanner, scan, first, next) : status;
}

hs_status
hs_scan_block(hs_scanner *scanner)
{
    int32_t end[HS_GROUP_POINTS];
    hs_scan scan;
    if (scanner->blocks < scanner->blocks_to_skip) {
        empty_block(scanner);
        return HS_OK;
    }
    if (scanner->use == HS_BLOCK_SIZES) {
        return note_size(scanner);
    }
    if (is_lone(scanner)) {
        empty_block(scanner);
        scanner->work_since_poll += WORK_OF_BLOCK;
        return end_block(scanner);
    }
    hs_status status = fill_block(scanner);
    if (status != HS_OK) {
        return status;
    }
    set_scan(scanner, &scan);
    scan.end = end;
    for (int32_t first = 0, next; status == HS_OK && first < scan.n_points; first = next) {
        next = run_scan(scanner, &scan, first);
        if (scan.n_unsure > 0 &&
            (scanner->options.precision != HS_SINGLE || scanner->search->limits != NULL)) {
            status = decide(scanner, &scan, first, next);
        }
        if (HS_UNLIKELY(scanner->chooses) && status == HS_OK) {
            status = hs_choose(scanner, &scan, first, next);
        }
        scanner->n_found += scan.n_hits;
        if (status == HS_OK && scanner->visit != NULL && scan.n_hits > 0) {
            status = visit_hits(scanner, &scan, first, next);
        }
    }
    return status == HS_OK ? finish_block(scanner, scan.n_points) : status;
}

void
hs_scanner_start(hs_scanner *scanner, int32_t first, int32_t last)
{
    const hs_search *search = scanner->search;
    scanner->n_groups += scanner->use != HS_BLOCK_SIZES;
    scanner->blocks = 0;
    scanner->block.n = 0;
    scanner->block.n_runs = 0;
    scanner->block_is_first = !search->is_full;
    scanner->of_group = (hs_neighbourhood){0, 0};
    hs_group_start(hs_search_asking(search), first, last, &scanner->group);
    if ((search->is_full || scanner->blocks_to_skip > 0) && scanner->use != HS_BLOCK_SIZES) {
        hs_group_load(hs_search_asking(search), &scanner->group);
    }
}

hs_status
hs_scanner_append(hs_scanner *scanner, int32_t si, int32_t end, const double *shift,
                  const int32_t *image)
{
    while (si < end) {
        if (hs_block_is_full(&scanner->block)) {
            const hs_status status = hs_scan_block(scanner);
            if (status != HS_OK) {
                return status;
            }
        }
        si += hs_block_append(&scanner->block, si, end, scanner->search->scene.ndim, shift, image,
                              &scanner->group);
        if (scanner->block.n_runs % HS_RUNS_PER_POLL == 0 &&
            hs_poll(&scanner->options, hs_scanner_fraction(scanner)) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

static void
keep_largest(int64_t found, int64_t *largest)
{
    *largest = found > *largest ? found : *largest;
}

hs_status
hs_scanner_finish(hs_scanner *scanner)
{
    const hs_status status = hs_scan_block(scanner);
    scanner->blocks_to_skip = 0;
    keep_largest(scanner->of_group.candidates, &scanner->most.candidates);
    keep_largest(scanner->of_group.runs, &scanner->most.runs);
    return status;
}
