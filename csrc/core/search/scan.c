/* SPDX-License-Identifier: BSD-3-Clause */
/* scan.c: see scan.h. */
#include "scan.h"

#include "decide.h"
#include "../base/fpenv.h"
#include "../base/poll.h"

#include <math.h>

/* Candidates between two calls of poll(): some milliseconds. */
#define POLL_WORK (INT64_C(1) << 21)
#define WORK_OF_RUN 32 /* candidates that could be tested while a run of them is found */

/* Of a group that meets nobody, in candidates. */
#define LONE_GROUP 64

/* Blocks with subnormal numbers before the filter flushes: some lie behind the last candidate. */
#define FEW_SUBNORMAL 16

/*
 * Hits after which a scan stops, so that they can be written out. Measured: the stores of a short
 * burst drain to memory while the next one is scanned; with bursts of thousands the two take turns,
 * which costs up to 0.9 ns a pair.
 */
#define BURST 128

/* By one float32 comparison: nothing is decided again. */
static void
set_single(hs_walker *walker)
{
    const double cutoff = walker->search->scene.cutoff;
    const float  square = (float)(cutoff * cutoff);
    walker->direct.out = walker->options.inclusive ? square : nextafterf(square, -1.0f);
    walker->direct.in = INFINITY;
}

/* Thresholds for the present extent. A scaled cutoff may be known between bounds only. */
static void
set_thresholds(hs_walker *walker)
{
    const hs_scene *scene = &walker->search->scene;
    const double    extent = walker->extent, error = walker->search->filter_error;
    walker->direct = hs_thresholds_of(scene->ndim, scene->cutoff, extent, error);
    walker->expanded = hs_expanded_of(scene->ndim, scene->cutoff, extent, error);
    if (scene->extreme) {
        const double low = scene->cutoff_low;
        walker->direct.in =
            low > 0.0 ? hs_thresholds_of(scene->ndim, low, extent, error).in : -1.0f;
        walker->expanded.in =
            low > 0.0 ? hs_expanded_of(scene->ndim, low, extent, error).in : -INFINITY;
    }
}

/* Thresholds and form of the scan, by the size of the present group and block. */
static void
set_form(hs_walker *walker)
{
    const hs_kernel *kernel = walker->search->kernel;
    const bool       counts = walker->use == HS_BLOCK_COUNTS;
    const double     extent = hs_group_extent(&walker->group);
    if (extent == walker->extent) {
        return;
    }
    walker->extent = extent;
    walker->scan = counts ? kernel->count_direct : kernel->list_direct;
    if (walker->options.precision == HS_SINGLE) {
        set_single(walker);
        return;
    }
    set_thresholds(walker);
    if (walker->use == HS_BLOCK_LISTS_SQUARES) {
        walker->scan = kernel->squares;
    } else if (hs_expanded_pays(walker->search->scene.cutoff, extent)) {
        walker->scan = counts ? kernel->count : kernel->list;
    }
}

/* The present block and group as a kernel sees them. */
static void
set_scan(const hs_walker *walker, hs_scan *scan)
{
    const hs_block *block = &walker->block;
    const bool      lists_places = walker->use == HS_BLOCK_LISTS_PLACES;
    scan->ndim = walker->search->scene.ndim;
    for (int k = 0; k < scan->ndim; k++) {
        scan->y[k] = block->y[k];
        scan->q[k] = walker->group.q[k];
    }
    scan->label = block->place == NULL ? block->id
                  : walker->is_ordered ? block->origin
                                       : block->place;
    scan->n = block->n;
    scan->n_points = walker->group.last - walker->group.first;
    scan->triangular = walker->block_is_first;
    scan->norm = block->norm;
    scan->direct = walker->direct;
    scan->expanded = walker->expanded;
    scan->hits = block->hits;
    scan->squares = block->squares;
    scan->unsure = block->unsure;
    scan->n_unsure = 0;
    scan->most_hits = block->most_hits;
    if (!lists_places && block->hits != NULL && block->n + BURST < scan->most_hits) {
        scan->most_hits = block->n + BURST;
    }
    scan->most_unsure = block->capacity;
}

static void
set_flushing(const hs_walker *walker, bool on)
{
    if (walker->flushes) {
        hs_fpenv_flush(on);
    }
}

static int32_t
run_scan(const hs_walker *walker, hs_scan *scan, int32_t first)
{
    set_flushing(walker, true);
    const int32_t next = walker->scan(scan, first);
    set_flushing(walker, false);
    return next;
}

/* precision="single" is decided by the filter: it must not flush. */
static void
note_subnormals(hs_walker *walker)
{
    if (!walker->flushes && hs_fpenv_met_subnormal()) {
        hs_fpenv_flush(false); /* forgets it */
        walker->flushes = walker->options.precision != HS_SINGLE &&
                          ++walker->n_subnormal > FEW_SUBNORMAL;
    }
}

/* Hands the hits of points [first, next) of the group to the visitor. */
static hs_status
visit_hits(hs_walker *walker, const hs_scan *scan, int32_t first, int32_t next)
{
    const int32_t si = walker->group.first + first;
    const hs_hits hits = {.n = next - first,
                          .point = hs_search_asking(walker->search)->order + si,
                          .end = scan->end + first,
                          .label = scan->hits};
    return walker->visit(walker->visit_context, walker, si, &hits);
}

/* The block as it was appended, ready to be scanned. */
static hs_status
fill_block(hs_walker *walker)
{
    hs_block *block = &walker->block;
    walker->n_blocks++;
    set_flushing(walker, true);
    hs_block_gather(&walker->search->bins, walker->search->kernel, walker->block_is_first, block,
                    &walker->group);
    set_flushing(walker, false);
    hs_trace_reset(&walker->trace);
    set_form(walker);
    if (!walker->is_ordered) {
        return HS_OK;
    }
    const hs_status status = hs_order_block(&walker->search->scene.lattice, &walker->options,
                                            walker->use, block, &walker->order);
    if (status == HS_ERR_SHIFT_RANGE) {
        walker->failed_point = hs_search_asking(walker->search)->order[walker->group.first];
    }
    return status;
}

static hs_status
poll_sometimes(hs_walker *walker)
{
    if (walker->work_since_poll > POLL_WORK) {
        walker->work_since_poll = 0;
        return hs_poll(&walker->options, hs_walk_fraction(walker));
    }
    return HS_OK;
}

static void
empty_block(hs_walker *walker)
{
    walker->block.n = 0;
    walker->block.n_runs = 0;
    walker->block_is_first = false;
    walker->blocks++;
}

/* Of the block alone. */
static hs_status
note_size(hs_walker *walker)
{
    walker->of_group.candidates += walker->block.n;
    walker->of_group.runs += walker->block.n_runs;
    walker->work_since_poll += WORK_OF_RUN * (int64_t)walker->block.n_runs;
    empty_block(walker);
    return poll_sometimes(walker);
}

/* Whether to go on. */
static hs_status
end_block(hs_walker *walker)
{
    if (walker->n_candidates > walker->candidate_limit || walker->leaves) {
        return HS_STATUS_END;
    }
    return poll_sometimes(walker);
}

/* What was tested. */
static hs_status
finish_block(hs_walker *walker, int64_t n_points)
{
    const hs_block *block = &walker->block;
    const int64_t   skipped = walker->block_is_first ? n_points * (n_points + 1) / 2 : 0;
    walker->n_candidates += n_points * block->n - skipped;
    walker->work_since_poll += n_points * block->n;
    empty_block(walker);
    note_subnormals(walker);
    return end_block(walker);
}

/* Nobody has been appended but the one point of the group itself, if that. */
static bool
is_lone(const hs_walker *walker)
{
    return walker->block.n == (walker->block_is_first ? 1 : 0);
}

hs_status
hs_scan_block(hs_walker *walker)
{
    int32_t   end[HS_GROUP_POINTS];
    hs_scan   scan;
    if (walker->blocks < walker->blocks_to_skip) {
        empty_block(walker);
        return HS_OK;
    }
    if (walker->use == HS_BLOCK_SIZES) {
        return note_size(walker);
    }
    if (is_lone(walker)) {
        empty_block(walker);
        walker->work_since_poll += LONE_GROUP;
        return end_block(walker);
    }
    hs_status status = fill_block(walker);
    set_scan(walker, &scan);
    scan.end = end;
    for (int32_t first = 0, next; status == HS_OK && first < scan.n_points; first = next) {
        next = run_scan(walker, &scan, first);
        if (scan.n_unsure > 0 && walker->options.precision != HS_SINGLE) {
            status = hs_decide(walker, &scan, first, next);
        }
        walker->n_found += scan.n_hits;
        if (status == HS_OK && walker->visit != NULL && scan.n_hits > 0) {
            status = visit_hits(walker, &scan, first, next);
        }
    }
    return status == HS_OK ? finish_block(walker, scan.n_points) : status;
}
