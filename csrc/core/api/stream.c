/* SPDX-License-Identifier: BSD-3-Clause */
#include "query.h"
#include "../base/os.h"
#include "../base/status.h"
#include "../collect/components.h"

#include <math.h>
#include <string.h>

/* stream.c: pairs that are never stored all at once: in blocks, shown to a function, or joined to
 * clusters. A stream holds a search of each system that is ready to be walked, a bookmark of how
 * far that has come, and the pairs that were found and not yet handed out. */

/* Pairs that are looked for at a time, at least: less would not pay for walkers and threads. */
#define LEAST_FILL (INT64_C(1) << 16)

/* Pairs that room is reserved for before any is found, at most; larger blocks grow. */
#define MOST_EXPECTED 0x1p24

/* One system. What it has points to nothing of the caller's. */
typedef struct source {
    hs_system    system;
    hs_query_run run;
    int64_t      n_steps; /* that have been opened */
} source;

struct hs_stream {
    hs_call     call;      /* that opened it; it has threads only while it looks for pairs */
    source      own;       /* of a stream of one system */
    source     *sources;   /* that one, or owned */
    int64_t     n_sources; /* the first ones, which have been opened */
    int64_t     at;        /* the present one */
    hs_choice  *choice;    /* owned: of all, where there are several; or NULL */
    hs_output   held;      /* pairs from `begin` on wait to be handed out */
    int64_t     begin;
    int64_t     max_pairs, enough; /* pairs of a block; that are looked for at a time */
    hs_bookmark next;              /* where to go on looking */
};

static int64_t
waiting(const hs_stream *stream)
{
    return stream->held.n_pairs - stream->begin;
}

static source *
present(const hs_stream *stream)
{
    return &stream->sources[stream->at];
}

/* Appends the first n pairs that wait. */
static hs_status
copy_waiting(const hs_stream *stream, int64_t first, int64_t n, hs_output *to)
{
    const hs_status status = hs_output_reserve(to, n, 0.0);
    if (status == HS_OK) {
        hs_output_copy(to, to->n_pairs, &stream->held, first, first + n);
        to->n_pairs += n;
    }
    return status;
}

/* The pairs from `first` on in an output of their own, with room for what comes. */
static hs_status
move_waiting(hs_stream *stream, int64_t first, hs_output *moved)
{
    const hs_search *search = present(stream)->run.search; /* or none is left */
    const hs_output *held = &stream->held;
    const double     all = search != NULL ? search->grid.expected_pairs : 0.0;
    hs_output_init(&stream->call.account, held->ndim, held->columns, held->index_bytes, moved);
    hs_output_reserve_hint(moved, fmin(fmin((double)stream->enough, all), MOST_EXPECTED));
    const hs_status status = copy_waiting(stream, first, held->n_pairs - first, moved);
    if (status != HS_OK) {
        hs_output_free(moved);
    }
    return status;
}

/* Looks for as many pairs as a block has. What an unfinished attempt has found is dropped. */
static hs_status
fill(hs_stream *stream, hs_failure *failure)
{
    hs_search *search = present(stream)->run.search;
    hs_output  moved;
    if (stream->begin > 0 || stream->held.capacity == 0) {
        const hs_status status = move_waiting(stream, stream->begin, &moved);
        if (status != HS_OK) {
            return status;
        }
        hs_output_free(&stream->held);
        stream->held = moved;
        stream->begin = 0;
    }
    const int64_t before = stream->held.n_pairs;
    hs_call_gather(search->call, search->bins.n);
    const hs_status status =
        hs_parallel_record_on(search, &stream->held, stream->enough, &stream->next, failure);
    hs_call_dismiss(search->call);
    if (status != HS_OK) {
        stream->held.n_pairs = before;
        return status;
    }
    return hs_poll(&search->call->options, hs_search_fraction(search, stream->next.point));
}

static hs_status
open_step(source *one)
{
    hs_query_close_step(&one->run);
    const hs_status status = hs_query_open_step(&one->run, one->n_steps);
    one->n_steps += status == HS_OK;
    return status;
}

/* From here on pairs are those of this system, in the way that is its own. */
static void
take_up(hs_stream *stream, int64_t at)
{
    source *one = &stream->sources[at];
    stream->at = at;
    stream->call.options.cutoff = one->system.query.options.cutoff;
    if (stream->choice != NULL) {
        stream->call.choice = &one->system.choice;
    }
}

/* Hands out the first n pairs that wait; without the memory for it, nothing. What is held becomes
 * the block where that leaves less to be copied. */
static hs_status
take_block(hs_stream *stream, hs_pairs **result)
{
    const int64_t n = waiting(stream) < stream->max_pairs ? waiting(stream) : stream->max_pairs;
    hs_pairs     *block = hs_pairs_new();
    hs_output     rest, *given;
    hs_status     status;
    if (block == NULL) {
        return HS_ERR_MEMORY;
    }
    given = &block->output;
    block->call.account = (hs_account){.arena = NULL}; /* what is held is not charged to it */
    if (stream->begin == 0 && waiting(stream) - n < n) {
        status = move_waiting(stream, n, &rest);
        if (status == HS_OK) {
            *given = stream->held;
            hs_account_give(given->account, given->charged * hs_output_bytes_per_pair(given));
            given->account = NULL;
            given->charged = 0;
            given->n_pairs = n;
            stream->held = rest;
        }
    } else {
        hs_output_init(NULL, stream->held.ndim, stream->held.columns, stream->held.index_bytes,
                       given);
        status = copy_waiting(stream, stream->begin, n, given);
        stream->begin += status == HS_OK ? n : 0;
    }
    if (status != HS_OK) {
        hs_free(NULL, block);
        return status;
    }
    *result = block;
    return HS_OK;
}

hs_status
hs_stream_next(hs_stream *stream, hs_poll_fn poll, void *context, hs_pairs **block,
               hs_failure *failure)
{
    if (block != NULL) {
        *block = NULL;
    }
    if (stream == NULL || block == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, NULL, failure);
    }
    hs_entry *entry = &stream->call.entry;
    hs_status status = HS_OK;
    failure = hs_enter(failure, entry);
    hs_call_set_poll(poll, context, &stream->call);
    while (status == HS_OK && waiting(stream) < stream->max_pairs && stream->n_sources > 0) {
        source          *one = present(stream);
        const hs_search *search = one->run.search;
        one->run.failure = failure;
        if (search != NULL && stream->next.point < hs_search_asking(search)->n) {
            status = fill(stream, failure);
            continue;
        }
        if (one->n_steps < one->run.plan.n) {
            status = open_step(one);
        } else if (stream->at < stream->n_sources - 1) { /* whose search may be open already */
            hs_query_close(&one->run);
            take_up(stream, stream->at + 1);
        } else {
            break; /* all is found */
        }
        stream->next = status == HS_OK ? (hs_bookmark){.point = 0} : stream->next;
    }
    if (status == HS_OK && waiting(stream) > 0) {
        status = take_block(stream, block);
    }
    hs_call_tell_limit(&stream->call, status, failure);
    hs_call_set_poll(NULL, NULL, &stream->call);
    hs_leave(entry);
    return status;
}

/* Opens what the caller's arrays are needed for, of a run whose query is its system's: the one
 * search, or what all steps of a reach are made of. */
static hs_status
open_source(source *one)
{
    hs_system      *system = &one->system;
    const hs_status status = one->run.has_levels ? HS_OK : open_step(one);
    if (system->query.box != NULL) {
        system->own_box = *system->query.box;
        system->query.box = &system->own_box;
    }
    return status;
}

/* Labels last until hs_stream_open returns. */
static hs_status
open_alone(hs_stream *stream, const hs_query *query, const hs_finder *finder, hs_failure *failure)
{
    source *one = stream->sources = &stream->own;
    one->system.query = *query;
    hs_status status = hs_query_open(&one->system.query, finder, &stream->call, &one->run, failure);
    stream->n_sources = 1;
    if (status == HS_OK) {
        status = hs_choice_keep_labels(&query->sets, &stream->call);
    }
    return status == HS_OK ? open_source(one) : status;
}

static hs_status
open_systems(hs_stream *stream, const hs_query *all, const hs_finder *finder, hs_failure *failure)
{
    const int64_t n = all->among->points != NULL ? all->among->points->n_systems : 0;
    hs_call      *call = &stream->call;
    hs_query_run  of_all;
    hs_status     status = hs_query_open(all, finder, call, &of_all, failure);
    if (status == HS_OK) {
        status = hs_choice_keep_labels(&all->sets, call);
    }
    stream->choice = call->choice;
    if (status == HS_OK) {
        stream->sources = hs_alloc(&call->account, HS_FOR_INDICES, n, sizeof(source));
        status = stream->sources != NULL ? HS_OK : HS_ERR_MEMORY;
    }
    for (int64_t s = 0; status == HS_OK && s < n; s++) {
        source *one = &stream->sources[stream->n_sources++];
        one->n_steps = 0;
        hs_system_begin(all, finder, call, failure, &one->system, &one->run);
        status = hs_system_open(all, s, stream->choice, &one->system, &one->run);
        status = status == HS_OK ? open_source(one) : status;
        failure->system = status == HS_OK ? -1 : s;
    }
    if (status == HS_OK && stream->n_sources > 0) {
        take_up(stream, 0);
    }
    return status;
}

hs_status
hs_stream_open(const hs_among *among, const hs_options *options, int64_t max_pairs,
               hs_stream **result, hs_failure *failure)
{
    static const hs_finder of_pairs = {.is_numbered = true};
    if (result != NULL) {
        *result = NULL;
    }
    if (result == NULL || options == NULL || max_pairs < 1) {
        return hs_end_early(HS_ERR_ARGUMENT, NULL, failure);
    }
    hs_stream *stream = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *stream);
    if (stream == NULL) {
        return hs_end_early(HS_ERR_MEMORY, NULL, failure);
    }
    hs_call *call = &stream->call;
    hs_query query = hs_query_among(among, HS_HALF_LIST, options);
    query.sets.keeps_none = true;
    query.options.sorted = false; /* nor has it what the caller lends for one call */
    query.options.out = NULL;
    query.options.counters = NULL;
    memset(stream, 0, sizeof *stream);
    failure = hs_call_enter(&query.options, failure, call);
    stream->max_pairs = max_pairs;
    stream->enough = max_pairs > LEAST_FILL ? max_pairs : LEAST_FILL;
    const hs_status status = query.among != NULL ? open_systems(stream, &query, &of_pairs, failure)
                                                 : open_alone(stream, &query, &of_pairs, failure);
    hs_call_tell_limit(call, status, failure);
    hs_call_leave(call, 0);
    hs_call_detach(call);
    if (status == HS_OK) {
        hs_output_init(&call->account, query.sets.points->ndim, query.options.want,
                       query.options.index_bytes, &stream->held);
        *result = stream;
    } else {
        hs_stream_free(stream);
    }
    return status;
}

void
hs_stream_free(hs_stream *stream)
{
    if (stream == NULL) {
        return;
    }
    hs_call *call = &stream->call;
    hs_output_free(&stream->held);
    for (int64_t s = 0; s < stream->n_sources; s++) {
        hs_query_close(&stream->sources[s].run);
    }
    if (stream->choice != NULL) {
        call->choice = stream->choice;
        hs_choice_close(call);
    }
    if (stream->sources != &stream->own) {
        hs_free(&call->account, stream->sources);
    }
    hs_account_close(&call->account);
    hs_free(NULL, stream);
}

/* Pairs handed to a function as they are found, stored nowhere. */

/* Work of a call in candidates, for polling: functions take tens of nanoseconds and more. */
#define CALL_WORK 32

/* What the threads share. */
typedef struct visiting {
    const hs_visit *visit;
    unsigned        want; /* columns, with indices of so many bytes */
    int             index_bytes;
    hs_query_run   *run; /* of the step; counts the pairs of threads that have ended */
} visiting;

/* What one thread works with. */
typedef struct visitor {
    const hs_visit *visit;    /* borrowed */
    hs_output       part;     /* owned; the pairs that are being visited */
    hs_recorder     recorder; /* owned; of the part */
    int64_t         n_visited;
} visitor;

/* A hs_visit_fn. */
static hs_status
visit_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    visitor        *doing = context;
    const hs_visit *visit = doing->visit;
    hs_output      *part = &doing->part;
    part->n_pairs = 0;
    const hs_status status = hs_record_hits(&doing->recorder, scanner, first, hits);
    if (status != HS_OK) {
        return status;
    }
    const hs_pair_arrays pairs = {.capacity = part->n_pairs,
                                  .index_bytes = part->index_bytes,
                                  .i = hs_output_column(part, HS_WANT_I),
                                  .j = hs_output_column(part, HS_WANT_J),
                                  .distance = hs_output_column(part, HS_WANT_DISTANCE),
                                  .vector = hs_output_column(part, HS_WANT_VECTOR),
                                  .shift = hs_output_column(part, HS_WANT_SHIFT)};
    const int64_t       *i = pairs.i, *j = pairs.j;
    int64_t              n_taken = part->n_pairs;
    int                  stops = 0;
    if (visit->pairs != NULL) {
        stops = visit->pairs(&pairs, part->n_pairs, &n_taken, visit->user);
    }
    for (int64_t e = 0; visit->pairs == NULL && stops == 0 && e < part->n_pairs; e++) {
        const double d = pairs.distance[e];
        stops = visit->pair(i[e], j[e], pairs.shift + e * part->ndim, pairs.vector + e * part->ndim,
                            d * d, visit->user);
        n_taken = e + 1;
    }
    (void)hs_fpenv_enter(); /* the caller's function may have changed it */
    doing->n_visited += n_taken;
    scanner->work_since_poll += CALL_WORK * part->n_pairs;
    return stops != 0 ? HS_ENOUGH : HS_OK;
}

static hs_status
open_visitor(void *context, void *state, const hs_walker *walker)
{
    const visiting *shared = context;
    visitor        *doing = state;
    doing->visit = shared->visit;
    hs_output_init(NULL, walker->search->scene.ndim, shared->want, shared->index_bytes,
                   &doing->part);
    return hs_recorder_init(&shared->run->call->account, &doing->part,
                            walker->scanner.block.most_hits, &doing->recorder);
}

static void
close_visitor(void *context, void *state)
{
    visiting *shared = context;
    visitor  *doing = state;
    shared->run->n_pairs += doing->n_visited;
    hs_recorder_free(&shared->run->call->account, &doing->recorder);
    hs_output_free(&doing->part);
}

/* A hs_use_fn: each thread visits the pairs that it finds. HS_ENOUGH: a function wants no more. */
static hs_status
visit_step(void *context, hs_query_run *run)
{
    visiting         shared = *(const visiting *)context;
    const hs_visitor all = {.use = hs_record_use(shared.want),
                            .visit = visit_hits,
                            .shared = &shared,
                            .state_size = sizeof(visitor),
                            .open = open_visitor,
                            .close = close_visitor};
    shared.run = run;
    if (!shared.visit->thread_safe) { /* other threads only make the search ready */
        hs_call_dismiss(run->call);
    }
    return hs_parallel_visit(run->search, &all, NULL, run->failure);
}

/* For a visit by the caller's thread alone: others only make the search ready. */
static void
spare_threads(hs_query *query)
{
    const double n = (double)(hs_query_asking(query) / HS_POINTS_MADE_READY);
    if (query->options.threads > 1 && hs_call_threads(n, &query->options) == 1) {
        query->options.threads = 1;
    }
}

hs_status
hs_pairs_visit(const hs_among *among, const hs_options *options, const hs_visit *visit,
               int64_t *n_visited, hs_failure *failure)
{
    visiting    shared = {.visit = visit,
                          .want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR |
                                  HS_WANT_SHIFT,
                          .index_bytes = 8};
    hs_finder   finder = {.step = visit_step, .context = &shared, .is_numbered = true};
    hs_counters done;
    hs_query    query = hs_query_among(among, HS_HALF_LIST, options);
    query.is_incomplete |= n_visited == NULL || visit == NULL ||
                           (visit->pair == NULL && visit->pairs == NULL);
    hs_query_want_none(&query);
    query.sets.keeps_none = true;
    query.options.want = shared.want;
    query.options.index_bytes = shared.index_bytes;
    if (query.options.counters == NULL) {
        query.options.counters = &done;
    }
    finder.one_thread = !query.is_incomplete && !visit->thread_safe;
    if (finder.one_thread) {
        spare_threads(&query);
    }
    const hs_status status = hs_query_answer(&query, &finder, NULL, failure);
    if (n_visited != NULL) {
        *n_visited = query.options.counters->pairs;
    }
    return status == HS_ENOUGH ? HS_OK : status;
}

/* Clusters of points, joined pair by pair while these are found. */

/* What the pairs are for: clusters of all systems, or of one. */
typedef struct clustering {
    hs_components  components; /* owned; of one */
    const uint8_t *core;       /* borrowed, or NULL */
    int64_t       *labels;     /* borrowed */
    uint8_t       *winding;    /* borrowed, or NULL */
    int64_t        n_found;
} clustering;

/* A hs_pairs_fn: core points that are a pair belong together. */
static int
join_pairs(const hs_pair_arrays *pairs, int64_t n, int64_t *n_taken, void *user)
{
    clustering    *doing = user;
    const int32_t *i = pairs->i, *j = pairs->j;
    const int      n_axes = doing->components.n_axes;
    (void)n_taken;
    for (int64_t e = 0; e < n; e++) {
        if (doing->core == NULL || (doing->core[i[e]] != 0 && doing->core[j[e]] != 0)) {
            hs_components_join(&doing->components, i[e], j[e],
                               n_axes > 0 ? pairs->shift + e * n_axes : NULL);
        }
    }
    return 0;
}

/* A hs_pairs_fn: any other point belongs to the first cluster that has a core point near it. */
static int
adopt_points(const hs_pair_arrays *pairs, int64_t n, int64_t *n_taken, void *user)
{
    const clustering *doing = user;
    const uint8_t    *core = doing->core;
    const int32_t    *i = pairs->i, *j = pairs->j;
    (void)n_taken;
    for (int64_t e = 0; e < n; e++) {
        if ((core[i[e]] != 0) != (core[j[e]] != 0)) {
            int64_t      *label = &doing->labels[core[i[e]] != 0 ? j[e] : i[e]];
            const int64_t near = doing->labels[core[i[e]] != 0 ? i[e] : j[e]];
            *label = *label < 0 || near < *label ? near : *label;
        }
    }
    return 0;
}

/* A hs_use_fn; context: the clustering of all systems. */
static hs_status
find_clusters(void *context, hs_query_run *run)
{
    clustering      *all = context, doing = *all;
    hs_account      *account = &run->call->account;
    const hs_visit   join = {.pairs = join_pairs, .user = &doing};
    const hs_visit   adopt = {.pairs = adopt_points, .user = &doing};
    visiting         shared = {.visit = &join, .want = HS_WANT_I | HS_WANT_J, .index_bytes = 4};
    const hs_points *points = run->query->sets.points;
    const hs_box    *box = run->query->box;
    int              n_axes = 0;
    doing.core = all->core != NULL ? all->core + run->first_point : NULL;
    doing.labels = all->labels + run->first_point;
    doing.winding = all->winding != NULL ? all->winding + all->n_found : NULL;
    for (int l = 0; doing.winding != NULL && box != NULL && l < box->ndim; l++) {
        n_axes = box->periodic[l] ? points->ndim : n_axes;
    }
    shared.want |= n_axes > 0 ? HS_WANT_SHIFT : 0;
    hs_status status = hs_components_open(account, points->n, n_axes, &doing.components);
    if (status == HS_OK) {
        status = hs_query_each_step(run, visit_step, &shared);
    }
    if (status == HS_OK) {
        doing.n_found =
            hs_components_label(&doing.components, doing.core, doing.labels, doing.winding);
    }
    hs_components_close(account, &doing.components);
    if (status == HS_OK && doing.core != NULL && points->n > 0 &&
        memchr(doing.core, 0, (size_t)points->n) != NULL) {
        /* Some point is near enough to a cluster only. The counters leave this out. */
        const hs_counters done = run->call->done;
        const int64_t     n_pairs = run->n_pairs;
        shared.visit = &adopt;
        shared.want = HS_WANT_I | HS_WANT_J;
        status = hs_query_each_step(run, visit_step, &shared);
        run->call->done = done;
        run->n_pairs = n_pairs;
    }
    for (int64_t i = 0; status == HS_OK && all->n_found > 0 && i < points->n; i++) {
        doing.labels[i] += doing.labels[i] >= 0 ? all->n_found : 0;
    }
    all->n_found += status == HS_OK ? doing.n_found : 0;
    return status;
}

hs_status
hs_clusters_find(const hs_among *among, const hs_options *options, const uint8_t *core,
                 int64_t *labels, uint8_t *winding, int64_t *n_clusters, hs_failure *failure)
{
    int64_t    none; /* where there are no points, there may be no labels */
    clustering all = {.core = core, .labels = labels != NULL ? labels : &none, .winding = winding};
    const hs_finder finder = {.find = find_clusters, .context = &all, .one_thread = true};
    hs_query        query = hs_query_among(among, HS_HALF_LIST, options);
    query.is_incomplete |= n_clusters == NULL || !hs_has_entries(labels, query.sets.points);
    hs_query_want_none(&query);
    query.sets.keeps_none = true;
    query.options.want = HS_WANT_I | HS_WANT_J | (winding != NULL ? HS_WANT_SHIFT : 0);
    query.options.index_bytes = 4;
    spare_threads(&query);
    const hs_status status = hs_query_answer(&query, &finder, NULL, failure);
    if (status == HS_OK) {
        *n_clusters = all.n_found;
    }
    return status;
}
