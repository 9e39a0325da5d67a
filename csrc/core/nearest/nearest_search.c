/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * nearest_search.c: threads take ranges of groups.
 *
 * Asking points are taken in groups, subtrees of a few points. What lies within a radius guessed
 * from the local density is gathered once for the group, and each of its points ranks its hits.
 * Points that found too few, and groups for which the guess is of no use, are searched one by one,
 * with a radius that surely suffices: so the cost follows n and k, however unevenly points lie.
 */
#include "../collect/crew.h"
#include "nearest_write.h"
#include "../base/outcome.h"
#include "../base/poll.h"

#include <math.h>
#include <string.h>

/* Points of a group. Measured: from 32 to 64 the time falls by some 10 %,
 * where vectors are wide. */
#define GROUP_POINTS 48
#define AHEAD        8 /* points from prefetching a row to writing it */
/* A thread takes subtrees at a time whose groups share a walk down the tree: at most a so many-th
 * part of all points, so that there is enough for all threads, within these bounds. Measured: with
 * more points the walk is a smaller part of the work. */
#define RANGES       32
#define LEAST_RANGE  640
#define MOST_RANGE   2560
#define RANGE_GROUPS 160 /* groups of one, at most; three times as many as there usually are */
/* Candidates of a group, in points of the group and wanted ones, beyond which the guess was bad:
 * some three times as many as there are where points are evenly spread, ... */
#define MOST_CANDIDATES 24.0
/* ... and so many times more for each axis beyond the third. */
#define MOST_PER_AXIS 3.0

/* Groups, as nodes of the tree of asking points; spots are cut into several. */
typedef struct near_part {
    int32_t first, last;
} near_part;

/* What the threads share. */
typedef struct nearest_job {
    hs_nearest *near;
    near_part  *parts;
    int64_t     n_parts;
    int64_t    *ranges; /* the first part of each, and behind the last one n_parts */
    int64_t     n_ranges;
} nearest_job;

/* What one thread works with; rows are written where they belong, not committed. */
typedef struct nearest_worker {
    hs_committer       committer;
    const nearest_job *job;
    hs_options         options;
    hs_nearest_group   groups[RANGE_GROUPS];
    hs_nearest_leaves  leaves;
    hs_nearest_block   block;
    hs_nearest_bounder bounder;
    hs_nearest_ranker  ranker;
    hs_nearest_writer  writer;
    int64_t            n_groups, n_candidates;
} nearest_worker;

static hs_status
fail_shift(nearest_worker *worker)
{
    worker->committer.failure.row = worker->writer.failed;
    worker->committer.failure.in_queries = worker->job->near->search->has_queries;
    return HS_ERR_SHIFT_RANGE;
}

/* Ranks and writes one point's hits; *done: whether the group's radius sufficed. */
static hs_status
finish_point(nearest_worker *worker, const hs_nearest_group *group, int32_t si, int32_t begin,
             int32_t end, bool *done)
{
    const hs_nearest_block *block = &worker->block;
    const int32_t          *hits = block->hits + begin;
    int64_t                 count;
    hs_status               status = HS_OK;
    if (!block->has_squares || !hs_nearest_rank_fast(&worker->ranker, si, hits,
                                                     block->squares + begin, end - begin, &count)) {
        status = hs_nearest_rank(&worker->ranker, group, si, hits, end - begin, &count);
    }
    *done = count >= 0;
    if (status == HS_OK && *done) {
        status = hs_nearest_write(&worker->writer, &worker->ranker, count);
        status = status == HS_ERR_SHIFT_RANGE ? fail_shift(worker) : status;
    }
    return status;
}

/* Does the points of a filled block; bit t of *left: point t of the group is not done. */
static hs_status
finish_block(nearest_worker *worker, const hs_nearest_group *group, uint64_t *left)
{
    const hs_nearest *near = worker->job->near;
    const int32_t     n_points = group->last - group->first;
    int32_t           end[HS_GROUP_POINTS];
    hs_status         status = HS_OK;
    worker->n_groups++;
    worker->n_candidates += (int64_t)n_points * worker->block.n;
    *left = 0;
    for (int32_t first = 0, next; first < n_points && status == HS_OK; first = next) {
        next = hs_nearest_block_scan(near, group, &worker->block, first, end);
        for (int32_t t = first; t < next && status == HS_OK; t++) {
            const int32_t begin = t > first ? end[t - 1] : 0;
            if (t + AHEAD < n_points) {
                hs_nearest_expect(&worker->writer, group->first + t + AHEAD);
            }
            bool done = false;
            status = finish_point(worker, group, group->first + t, begin, end[t], &done);
            *left |= (uint64_t)!done << t;
        }
    }
    return status;
}

/* Does one point within a radius that surely suffices; a larger one where rounding makes it fall
 * short. */
static hs_status
search_point(nearest_worker *worker, int32_t si, double guess)
{
    const hs_nearest *near = worker->job->near;
    hs_nearest_group  alone;
    uint64_t          left = 1;
    hs_nearest_group_set(near, si, si + 1, &alone);
    alone.radius = guess;
    hs_status status = hs_nearest_bound(near, &worker->options, &worker->bounder, &alone);
    while (status == HS_OK && left != 0) {
        status =
            hs_nearest_block_fill(near, &worker->options, &alone, INFINITY, NULL, &worker->block);
        if (status == HS_OK) {
            status = finish_block(worker, &alone, &left);
        }
        alone.radius *= 1.5;
    }
    return status;
}

static hs_status
search_group(nearest_worker *worker, hs_nearest_group *group)
{
    const hs_nearest *near = worker->job->near;
    const int32_t     n_points = group->last - group->first;
    const double      more = pow(MOST_PER_AXIS, fmax(near->tree.ndim - 3.0, 0.0));
    const double      most = more * MOST_CANDIDATES * ((double)near->k + n_points) + 64.0;
    uint64_t          left = UINT64_MAX;
    hs_status         status = hs_nearest_block_fill(near, &worker->options, group,
                                             n_points == 1 && group->is_complete ? INFINITY : most,
                                                     &worker->leaves, &worker->block);
    if (status == HS_OK) {
        status = finish_block(worker, group, &left);
    } else if (status == HS_TOO_MUCH) {
        status = HS_OK;
    }
    for (int32_t t = 0; t < n_points && status == HS_OK && left != 0; t++) {
        if (left >> t & 1) {
            status = search_point(worker, group->first + t, group->radius);
        }
    }
    return status;
}

/* A hs_range_fn. */
static hs_status
search_range(void *context, int64_t range)
{
    nearest_worker    *worker = context;
    const nearest_job *job = worker->job;
    const int64_t      first = job->ranges[range];
    const int32_t      n = (int32_t)(job->ranges[range + 1] - first);
    hs_status          status = HS_OK;
    for (int32_t g = 0; g < n; g++) {
        const near_part *part = &job->parts[first + g];
        hs_nearest_group_set(job->near, part->first, part->last, &worker->groups[g]);
        hs_nearest_guess(job->near, &worker->groups[g]);
    }
    hs_nearest_leaves_find(job->near, worker->groups, n, &worker->leaves);
    for (int32_t g = 0; g < n && status == HS_OK; g++) {
        status = search_group(worker, &worker->groups[g]);
    }
    if (status == HS_OK) {
        status = hs_poll(&worker->options, (double)first / (double)job->n_parts);
    }
    return status;
}

static hs_status
open_worker(void *context, void *place)
{
    const nearest_job *job = context;
    const hs_nearest  *near = job->near;
    nearest_worker    *worker = place;
    worker->job = job;
    worker->options = near->search->call->options;
    worker->committer.options = &worker->options;
    worker->ranker = (hs_nearest_ranker){
        .near = near, .block = &worker->block, .pace = {.options = &worker->options}};
    hs_nearest_writer_init(near, &worker->writer);
    hs_status status = hs_nearest_bounder_init(near, &worker->bounder);
    if (status == HS_OK) {
        status = hs_nearest_leaves_init(near, &worker->leaves);
    }
    return status == HS_OK ? hs_nearest_block_init(near, &worker->block) : status;
}

static void
close_worker(void *context, void *place)
{
    const nearest_job *job = context;
    nearest_worker    *worker = place;
    const hs_stages   *stages = &worker->ranker.stages;
    const hs_counters  walked = {.groups = worker->n_groups,
                                 .candidates = worker->n_candidates,
                                 .ambiguous = worker->ranker.n_compared,
                                 .by_float64 = stages->by_float64,
                                 .by_double_word = stages->by_double_word,
                                 .by_integers = stages->by_integers};
    hs_nearest_flush(&worker->writer);
    hs_call_note(job->near->search->call, &walked);
    hs_nearest_ranker_free(&worker->ranker);
    hs_nearest_bounder_free(job->near, &worker->bounder);
    hs_nearest_leaves_free(job->near, &worker->leaves);
    hs_nearest_block_free(job->near, &worker->block);
}

/* Adds the points of a node, as one group or several, to the present range and new ones. */
static void
add_parts(nearest_job *job, const hs_tree_node *node)
{
    for (int32_t first = node->first; first < node->end; first += GROUP_POINTS) {
        const int32_t last = node->end - first < GROUP_POINTS ? node->end : first + GROUP_POINTS;
        if (job->n_parts - job->ranges[job->n_ranges - 1] == RANGE_GROUPS) {
            job->ranges[job->n_ranges++] = job->n_parts;
        }
        job->parts[job->n_parts++] = (near_part){first, last};
    }
}

/* Cuts the tree into groups, the largest subtrees of at most GROUP_POINTS, and these into ranges,
 * which are larger subtrees. A larger leaf becomes several groups. */
static void
list_parts(nearest_job *job, const hs_tree *tree, int32_t *stack)
{
    const int32_t n = tree->nodes[0].end;
    const int32_t part = n / RANGES < MOST_RANGE ? n / RANGES : MOST_RANGE;
    const int32_t range_points = part > LEAST_RANGE ? part : LEAST_RANGE;
    int32_t       number = 0, range_end = 0;
    int64_t       n_waiting = 1; /* a node that is not looked at, for the end */
    stack[0] = 0;
    while (n_waiting > 0) {
        const hs_tree_node *node = &tree->nodes[number];
        const int32_t       points = node->end - node->first;
        const bool          is_leaf = node->left == 0;
        if (node->first >= range_end && (points <= range_points || is_leaf)) {
            job->ranges[job->n_ranges++] = job->n_parts;
            range_end = node->end;
        }
        if (points <= GROUP_POINTS || is_leaf) {
            add_parts(job, node);
            number = stack[--n_waiting];
        } else {
            stack[n_waiting++] = node->left + 1;
            number = node->left;
        }
    }
    job->ranges[job->n_ranges] = job->n_parts;
}

static hs_status
search_ranges(nearest_job *job, hs_failure *failure)
{
    hs_crew crew = {.call = job->near->search->call,
                    .job = job,
                    .worker_size = sizeof(nearest_worker),
                    .open = open_worker,
                    .close = close_worker,
                    .n_ranges = job->n_ranges,
                    .search = search_range};
    return hs_crew_run(&crew, failure);
}

hs_status
hs_nearest_search(hs_nearest *near, hs_failure *failure)
{
    hs_search    *search = near->search;
    hs_account   *account = &search->call->account;
    nearest_job   job = {.near = near};
    const int64_t n = hs_search_asking(search)->n;
    for (int64_t row = 0; near->tree.n_nodes == 0 && row < n; row++) {
        hs_nearest_write_nothing(near, row, 0);
    }
    if (near->tree.n_nodes == 0 || near->asking->n_nodes == 0) {
        return HS_OK;
    }
    const int64_t most_parts = near->asking->n_nodes + n / GROUP_POINTS + 1;
    int32_t      *stack = hs_alloc(account, HS_FOR_STENCIL, near->asking->depth + 3, sizeof *stack);
    job.parts = hs_alloc(account, HS_FOR_STENCIL, most_parts, sizeof *job.parts);
    job.ranges = hs_alloc(account, HS_FOR_STENCIL, most_parts + 1, sizeof *job.ranges);
    near->shared = hs_shared_new(account, HS_FOR_CANDIDATES);
    hs_status status = HS_ERR_MEMORY;
    if (stack != NULL && job.parts != NULL && job.ranges != NULL && near->shared != NULL) {
        list_parts(&job, near->asking, stack);
        status = search_ranges(&job, failure);
    }
    hs_shared_free(near->shared);
    hs_free(account, job.ranges);
    hs_free(account, job.parts);
    hs_free(account, stack);
    return status;
}
