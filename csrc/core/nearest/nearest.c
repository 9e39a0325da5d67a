/* SPDX-License-Identifier: BSD-3-Clause */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "nearest.h"
#include "../base/os_thread.h"
#include "../base/status.h"
#include "../scene/scene.h"
#include "../base/os.h"
#include "../collect/parallel.h"
#include "rank.h"

#include <math.h>

/* nearest.c: trees that are built once for many calls, how a search gets its own, and the search of
 * groups by threads. */

hs_nearest_kept *
hs_nearest_kept_new(void)
{
    hs_nearest_kept *kept = hs_alloc(NULL, HS_FOR_CELLS, 1, sizeof *kept);
    if (kept != NULL) {
        kept->state = HS_NEAREST_NOTHING;
    }
    return kept;
}

void
hs_nearest_kept_free(hs_nearest_kept *kept)
{
    if (kept == NULL) {
        return;
    }
    if (hs_atomic_load(&kept->state) == HS_NEAREST_BUILT) {
        hs_tree_free(&kept->call.account, &kept->near.tree);
        hs_search_close(&kept->search);
        hs_account_close(&kept->call.account);
    }
    hs_free(NULL, kept);
}

/* Chooses a cutoff that scales the scene without loss, then builds the trees or borrows the kept
 * one. */

/* Points of a leaf. Measured: from 8 to 12 the time changes by some 5 %. */
#define LEAF_POINTS 8
/* The nearest of a point take as long as so many pairs of a search with a cutoff, for which it is
 * known how many threads they are worth. */
#define PAIRS_PER_POINT 200.0
/* Lengths that distances are compared with scale the scene by themselves below this. */
#define SMALL_LIMIT 0x1p-800
/* A cutoff that leaves ordinary numbers as they are. */
#define SCENE_CUTOFF 1.0

/* Sets the largest and the least distance, in the scene's unit and for the metrics. */
static void
set_limit(hs_nearest *near, double limit)
{
    const hs_scene  *scene = &near->search->scene;
    const hs_metric *metric = &scene->metric;
    const hs_choice *choice = near->search->call->choice;
    near->limit = hs_scale_apply(scene->scale, limit);
    const double of_metric = scene->extreme ? limit : near->limit;
    hs_metric_init(&near->within, scene->ndim, metric->n_rows, metric->rows,
                   of_metric < INFINITY ? of_metric : 1.0, near->search->call->options.inclusive);
    if (choice != NULL && choice->min_distance > 0.0) {
        near->least = hs_scale_apply(scene->scale, choice->min_distance);
        hs_metric_init(&near->nearer, scene->ndim, metric->n_rows, metric->rows,
                       hs_choice_least(choice, scene), false);
    }
}

/* The call's options for its scene. Where images are compared, S is needed of all pairs. */
static hs_options
options_of_scene(const hs_nearest *near, double limit)
{
    const hs_call *call = near->search->call;
    hs_options     options = call->options;
    if (call->choice != NULL && hs_choice_needs_places(call->choice, limit)) {
        options.want |= HS_WANT_SHIFT;
    }
    return options;
}

/* Builds the tree of the points and measures them: all that searches with other k and other queries
 * can share. */
static hs_status
build_tree(hs_nearest *near, int32_t leaf_points)
{
    hs_search       *search = near->search;
    hs_scene        *scene = &search->scene;
    const hs_metric *metric = &scene->metric;
    hs_metric_init(&near->order, scene->ndim, metric->n_rows, metric->rows, 1.0, true);
    const hs_status status =
        hs_tree_build(search->call, scene, leaf_points, &search->bins, &near->tree);
    if (status == HS_OK) {
        hs_nearest_measure(near);
    }
    return status;
}

/* Builds the tree of the queries, and frees their scene. */
static hs_status
build_asking_tree(hs_nearest *near, hs_scene *asking)
{
    hs_search *search = near->search;
    search->has_queries = true;
    const hs_status status =
        hs_tree_build(search->call, asking, LEAF_POINTS, &search->query_bins, &near->asking_tree);
    hs_scene_free(&search->call->account, asking);
    return status;
}

/* Builds a tree that any later call can use: for any k, largest distance and quantities. */
static hs_status
build_kept(const hs_nearest *near, const hs_sets *sets, const hs_box *box, hs_nearest_kept *kept,
           hs_failure *failure)
{
    hs_call      *call = &kept->call;
    hs_search    *search = &kept->search;
    hs_options    options = near->search->call->options;
    const hs_sets of_kept = {.points = sets->points,
                             .is_kept = true,
                             .is_full = true,
                             .is_plain = sets->is_plain,
                             .is_wide = sets->is_wide};
    options.cutoff = SCENE_CUTOFF;
    options.want = HS_WANT_SHIFT;
    options.counters = NULL;
    kept->near = (hs_nearest){.search = search};
    hs_call_begin(&options, call);
    call->account.is_kept = true;
    hs_search_begin(call, search);
    call->team = near->search->call->team;
    hs_status status = hs_scene_make(&call->account, call->team, &of_kept, box, &options,
                                     &search->scene, NULL, failure);
    if (status == HS_OK) {
        status = build_tree(&kept->near, LEAF_POINTS);
    }
    call->team = NULL;
    hs_call_detach(call);
    if (status != HS_OK) {
        hs_tree_free(&call->account, &kept->near.tree);
        hs_search_close(search);
        hs_account_close(&call->account);
    }
    return status;
}

/* HS_REBUILD when what is kept does not serve: bounds that do not hold for the queries, a scale
 * that would lose digits of the largest distance; or another thread is building it. */
static hs_status
prepare_from_kept(hs_nearest *near, const hs_sets *sets, const hs_box *box, double limit,
                  hs_failure *failure)
{
    hs_search       *search = near->search;
    hs_nearest_kept *kept = sets->trees;
    const hs_nearest own = *near;
    hs_scene         asking;
    hs_status        status = HS_OK;
    /* Who builds is decided by one compare-and-swap. What a thread that does not exist in this
     * process has begun is lost, and built anew. */
    const int64_t state = hs_atomic_load(&kept->state);
    const int64_t now = HS_NEAREST_BUILDS + hs_atomic_load(&hs_n_forks);
    if (state != HS_NEAREST_BUILT) {
        if (state == now || !hs_atomic_swap_if(&kept->state, state, now)) {
            return HS_REBUILD;
        }
        hs_call_gather(search->call, sets->points->n);
        status = build_kept(near, sets, box, kept, failure);
        hs_atomic_store(&kept->state, status == HS_OK ? HS_NEAREST_BUILT : HS_NEAREST_NOTHING);
        if (status != HS_OK) {
            return status;
        }
    }
    const hs_scene *scene = &kept->search.scene;
    const int       unit = hs_exponent_of(hs_scale_apply(scene->scale, limit));
    /* Far points need closed gaps, which a tree that is kept does not have. */
    if (scene->in_one_cell || hs_is_far(scene->cloud.largest, unit, HS_FAR_BOUNDED_EXPONENT)) {
        return HS_REBUILD;
    }
    if (sets->queries != NULL) {
        const hs_options options = options_of_scene(near, limit);
        status = hs_scene_from_kept(&search->call->account, search->call->team, scene,
                                    sets->queries, &options, false, &asking, failure);
        if (status != HS_OK) {
            return status;
        }
    }
    *near = kept->near; /* with what it must not free marked as borrowed */
    near->search = search;
    near->k = own.k;
    near->omits_self = own.omits_self;
    near->rows = own.rows;
    search->scene = *scene;
    search->bins = kept->search.bins;
    search->is_borrowed = true;
    set_limit(near, limit);
    return sets->queries != NULL ? build_asking_tree(near, &asking) : HS_OK;
}

hs_status
hs_nearest_prepare(hs_nearest *near, const hs_sets *sets, const hs_box *box, double limit,
                   hs_failure *failure)
{
    hs_search    *search = near->search;
    const int64_t n_asking = sets->queries != NULL ? sets->queries->n : sets->points->n;
    hs_call_gather_for(search->call, n_asking, PAIRS_PER_POINT * (double)n_asking,
                       sets->trees != NULL);
    search->is_full = true;
    /* What distances are compared with scales the scene where it is very small. */
    const double least = hs_choice_least_length(search->call->choice, limit);
    const bool   is_small = least > 0.0 && least < SMALL_LIMIT;
    hs_status    status = HS_REBUILD;
    if (sets->trees != NULL && !is_small) {
        status = prepare_from_kept(near, sets, box, limit, failure);
    }
    if (status != HS_REBUILD) {
        return status;
    }
    hs_scene      queries, *asking = sets->queries != NULL ? &queries : NULL;
    hs_options    options = options_of_scene(near, limit);
    const int32_t leaf_points = near->k < 4 * LEAF_POINTS ? LEAF_POINTS : 2 * LEAF_POINTS;
    hs_sets       bounded = *sets;
    bounded.within = limit < INFINITY ? limit : 0.0;
    bounded.least_cutoff = hs_choice_least_length(search->call->choice, bounded.within);
    options.cutoff = is_small ? least : SCENE_CUTOFF;
    hs_call_gather(search->call, sets->points->n + (asking != NULL ? n_asking : 0));
    status = hs_scene_make(&search->call->account, search->call->team, &bounded, box, &options,
                           &search->scene, asking, failure);
    if (status != HS_OK) {
        return status;
    }
    set_limit(near, limit);
    status = build_tree(near, leaf_points);
    if (asking != NULL && status == HS_OK) {
        status = build_asking_tree(near, asking);
    } else if (asking != NULL) {
        hs_scene_free(&search->call->account, asking);
    }
    return status;
}

void
hs_nearest_release(hs_nearest *near)
{
    hs_account *account = &near->search->call->account;
    if (!near->search->is_borrowed) {
        hs_tree_free(account, &near->tree);
    }
    hs_tree_free(account, &near->asking_tree);
}

/*
 * Asking points are taken in groups, subtrees of a few points. What lies within a radius guessed
 * from the local density is gathered once for the group, and each of its points ranks its hits.
 * Points that found too few, and those of groups for which the guess is of no use, are searched one
 * by one: so the cost follows n and k, however unevenly points lie. Threads take ranges of groups.
 */

/* Points of a group. Measured: from 32 to 64 the time falls by some 10 % where vectors are wide. */
#define GROUP_POINTS 48
/* Where the guess was of no use to most points of a group, or the nearest of all of them were
 * within this part of it, later guesses in the range are scaled so that they would have been this
 * part, ... */
#define TOO_FAR   0.5
#define WELL_SEEN 0.9
/* ... but not to less than the density says, by which points may coincide. */
#define MOST_SCALE 0x1p20
/* Groups share the leaves of their range unless they look so many times as far as is expected in
 * it. */
#define FARTHEST 1.25
#define AHEAD    8 /* points from prefetching a row to writing it */
/* Candidates of a group, in points of the group and wanted ones, beyond which the guess was bad:
 * some three times as many as there are where points are evenly spread, ... */
#define MOST_CANDIDATES 24.0
/* ... and so many times more for each axis beyond the third. */
#define MOST_PER_AXIS 3.0
/* A point with more hits than so many for each wanted one, and a few, walks down the tree by
 * itself, which is quicker: from far away, nearly all points may be within the radius. */
#define HITS_PER_WANTED 32.0
#define FEW_HITS        256.0
/* A thread takes subtrees at a time whose groups share a walk down the tree: at most a so many-th
 * part of all points, so that there is enough for all threads, within these bounds. Measured: with
 * more points the walk is a smaller part of the work. */
#define RANGES       32
#define LEAST_RANGE  640
#define MOST_RANGE   2560
#define RANGE_GROUPS 160 /* of a leaf that is larger than a range */

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
    hs_nearest_leaves  shared, own; /* leaves of a range, and of one of its groups */
    hs_nearest_block   block;
    hs_nearest_ranker  ranker;
    hs_nearest_writer  writer;
    double             scale;   /* of the next guess */
    double             longest; /* distance of a k-th nearest in this group; 0: none */
    hs_counters        done;
} nearest_worker;

/* Writes the row of the ranker's point, unless something failed, and names the point where that is
 * how far it is: its shift is too long, or it is near too many images. */
static hs_status
write_row(nearest_worker *worker, int64_t count, hs_status status)
{
    const hs_nearest        *near = worker->job->near;
    const hs_search         *search = near->search;
    const hs_nearest_ranker *ranker = &worker->ranker;
    if (status == HS_OK && count == near->k) {
        const double distance = sqrt(ranker->keys[count - 1].square) / ranker->frame.unit;
        worker->longest = hs_larger(distance, worker->longest);
    }
    if (status == HS_OK) {
        status = hs_nearest_write(&worker->writer, &worker->ranker, count);
    }
    if (status == HS_ERR_SHIFT_RANGE || status == HS_TRY_OTHER) {
        hs_failure *failure = &worker->committer.failure;
        failure->row = hs_search_asking(search)->order[ranker->si];
        failure->in_queries = search->has_queries;
        failure->expected_bytes = status == HS_TRY_OTHER ? INFINITY : 0.0;
    }
    return status == HS_TRY_OTHER ? HS_ERR_MEMORY : status;
}

static hs_status
search_point(nearest_worker *worker, int32_t si)
{
    const hs_nearest  *near = worker->job->near;
    const hs_search   *search = near->search;
    const hs_choice   *choice = search->call->choice;
    hs_nearest_ranker *ranker = &worker->ranker;
    const int64_t      n_met = ranker->n_met;
    int64_t            count = 0;
    hs_status          status = HS_OK;
    hs_nearest_ranker_set(ranker, si);
    /* Do points repeat without end, and none of them is of the asking one's group? */
    bool is_endless = choice != NULL && choice->group != NULL &&
                      search->scene.lattice.n_periodic > 0 && !(near->limit < INFINITY);
    for (int64_t j = 0; is_endless && j < search->bins.n; j++) {
        is_endless = !hs_chooser_is_of_group(&ranker->chooser, (int32_t)j);
    }
    if (!is_endless) {
        status = hs_nearest_walk(ranker, &count);
    }
    worker->done.groups++;
    worker->done.candidates += ranker->n_met - n_met;
    return write_row(worker, count, status);
}

/* Ranks the hits of the group's points in its block. Sets bit t of *left where point t is to walk
 * by itself: its hits do not suffice, or are too many. */
static hs_status
search_block(nearest_worker *worker, const hs_nearest_group *group, uint64_t *left)
{
    const hs_nearest *near = worker->job->near;
    hs_nearest_block *block = &worker->block;
    const int32_t     n_points = group->last - group->first;
    const double      wanted = near->search->call->choice == NULL ? (double)near->k : INFINITY;
    int32_t           end[HS_GROUP_POINTS], n_many = 0;
    hs_status         status = HS_OK;
    worker->done.groups++;
    worker->done.candidates += (int64_t)n_points * block->n;
    for (int32_t first = 0, next; first < n_points && status == HS_OK; first = next) {
        if (first > 0 && n_many == first) { /* all so far: the others, too, probably */
            *left = UINT64_MAX;
            break;
        }
        next = hs_nearest_block_scan(near, group, block, first, end);
        for (int32_t t = first; t < next && status == HS_OK; t++) {
            const int32_t begin = t > first ? end[t - 1] : 0;
            int64_t       count;
            if (end[t] - begin > HITS_PER_WANTED * wanted + FEW_HITS) {
                *left |= UINT64_C(1) << t;
                n_many++;
                continue;
            }
            if (t + AHEAD < n_points) {
                hs_nearest_prefetch(&worker->writer, group->first + t + AHEAD);
            }
            hs_nearest_ranker_set(&worker->ranker, group->first + t);
            status = hs_nearest_rank(&worker->ranker, block, block->hits + begin,
                                     block->has_squares ? block->squares + begin : NULL,
                                     end[t] - begin, group->is_complete, &count);
            *left |= (uint64_t)(count < 0) << t;
            if (count >= 0 || status != HS_OK) {
                status = write_row(worker, count, status);
            }
        }
    }
    return status;
}

/* Does the points of a part, those that lie apart or do not find enough within the radius by
 * themselves. */
static hs_status
search_part(nearest_worker *worker, const near_part *part)
{
    const hs_nearest  *near = worker->job->near;
    hs_nearest_leaves *leaves = &worker->shared;
    const int32_t      n_points = part->last - part->first;
    hs_nearest_group   group;
    uint64_t           left = 0;
    int32_t            n_left = 0;
    if (n_points == 1) {
        return search_point(worker, part->first);
    }
    worker->longest = 0.0;
    hs_nearest_group_set(near, part->first, part->last, &group);
    hs_nearest_guess(near, worker->scale, &group);
    hs_status status = HS_TRY_OTHER;
    if (!hs_nearest_is_scattered(near, &group)) {
        const double more = pow(MOST_PER_AXIS, fmax(near->tree.ndim - 3.0, 0.0));
        const double most =
            more * MOST_CANDIDATES * ((double)near->k + group.more + n_points) + 64.0;
        status = HS_OK;
        if (group.radius > leaves->radius) {
            leaves = &worker->own;
            status = hs_nearest_leaves_find(near, &group, most, leaves);
        }
        if (status == HS_OK) {
            status = hs_nearest_block_fill(near, worker->committer.options, &group, most, leaves,
                                           &worker->block);
        }
    }
    if (status == HS_OK) {
        status = search_block(worker, &group, &left);
    } else if (status == HS_TRY_OTHER) {
        left = UINT64_MAX;
        status = HS_OK;
    }
    for (int32_t t = 0; t < n_points && status == HS_OK && left != 0; t++) {
        if (left >> t & 1) {
            n_left++;
            status = search_point(worker, part->first + t);
        }
    }
    const double seen = worker->longest / group.radius;
    if (seen > 0.0 && (n_left > n_points / 2 || seen < TOO_FAR)) {
        const double scale = worker->scale * (seen / WELL_SEEN);
        worker->scale = hs_smaller(hs_larger(scale, 1.0), MOST_SCALE);
    }
    return status;
}

/* A hs_range_fn. */
static hs_status
search_range(void *context, int64_t range)
{
    nearest_worker    *worker = context;
    const nearest_job *job = worker->job;
    const near_part   *part = &job->parts[job->ranges[range]];
    const near_part   *end = &job->parts[job->ranges[range + 1]];
    hs_status          status = HS_OK;
    worker->scale = 1.0;
    worker->shared.radius = 0.0;
    if (end - part > 1) {
        hs_nearest_group all;
        hs_nearest_group_set(job->near, part->first, end[-1].last, &all);
        hs_nearest_guess(job->near, FARTHEST, &all);
        if (!hs_nearest_is_scattered(job->near, &all)) {
            status = hs_nearest_leaves_find(job->near, &all, INFINITY, &worker->shared);
        }
    }
    for (; part < end && status == HS_OK; part++) {
        status = search_part(worker, part);
    }
    if (status == HS_OK) {
        status =
            hs_poll(worker->committer.options, (double)job->ranges[range] / (double)job->n_parts);
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
    worker->ranker.near = near;
    worker->ranker.options = worker->committer.options;
    hs_nearest_writer_init(near, &worker->writer);
    return HS_OK;
}

static void
close_worker(void *context, void *place)
{
    const nearest_job *job = context;
    nearest_worker    *worker = place;
    const hs_stages   *stages = &worker->ranker.stages;
    worker->done.ambiguous = worker->ranker.n_compared;
    worker->done.by_float64 = stages->by_float64;
    worker->done.by_double_word = stages->by_double_word;
    worker->done.by_integers = stages->by_integers;
    hs_nearest_flush(&worker->writer);
    hs_call_add_counters(job->near->search->call, &worker->done);
    hs_nearest_ranker_free(&worker->ranker);
    hs_shared_release(job->near->shared, &worker->shared.memory);
    hs_shared_release(job->near->shared, &worker->own.memory);
    hs_shared_release(job->near->shared, &worker->block.memory);
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
        if (points > GROUP_POINTS && !is_leaf) {
            stack[n_waiting++] = node->left + 1;
            number = node->left;
            continue;
        }
        for (int32_t first = node->first, last; first < node->end; first = last) {
            last = node->end - first < GROUP_POINTS ? node->end : first + GROUP_POINTS;
            if (job->n_parts - job->ranges[job->n_ranges - 1] == RANGE_GROUPS) {
                job->ranges[job->n_ranges++] = job->n_parts;
            }
            job->parts[job->n_parts++] = (near_part){first, last};
        }
        number = stack[--n_waiting];
    }
    job->ranges[job->n_ranges] = job->n_parts;
}

hs_status
hs_nearest_search(hs_nearest *near, hs_failure *failure)
{
    hs_search     *search = near->search;
    hs_account    *account = &search->call->account;
    const hs_tree *asking = search->has_queries ? &near->asking_tree : &near->tree;
    nearest_job    job = {.near = near};
    const int64_t  n = hs_search_asking(search)->n;
    if (near->tree.n_nodes == 0) {
        hs_nearest_writer writer;
        hs_nearest_writer_init(near, &writer);
        for (int64_t row = 0; row < n; row++) {
            hs_nearest_write_nothing(&writer, row, 0);
        }
    }
    if (near->tree.n_nodes == 0 || asking->n_nodes == 0) {
        return HS_OK;
    }
    const int64_t most_parts = asking->n_nodes + n / GROUP_POINTS + 1;
    int32_t      *stack = hs_alloc(account, HS_FOR_STENCIL, asking->depth + 3, sizeof *stack);
    job.parts = hs_alloc(account, HS_FOR_STENCIL, most_parts, sizeof *job.parts);
    job.ranges = hs_alloc(account, HS_FOR_STENCIL, most_parts + 1, sizeof *job.ranges);
    near->shared = hs_shared_new(account, HS_FOR_CANDIDATES);
    hs_status status = HS_ERR_MEMORY;
    if (stack != NULL && job.parts != NULL && job.ranges != NULL && near->shared != NULL) {
        list_parts(&job, asking, stack);
        hs_crew crew = {.call = search->call,
                        .job = &job,
                        .worker_size = sizeof(nearest_worker),
                        .open = open_worker,
                        .close = close_worker,
                        .n_ranges = job.n_ranges,
                        .search = search_range};
        status = hs_crew_run(&crew, failure);
    }
    hs_shared_free(near->shared);
    hs_free(account, job.ranges);
    hs_free(account, job.parts);
    hs_free(account, stack);
    return status;
}
