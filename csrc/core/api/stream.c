/* SPDX-License-Identifier: BSD-3-Clause */
#include "query.h"
#include "../search/choice.h"
#include "../base/os.h"
#include "../base/status.h"
#include "../collect/components.h"

#include <math.h>
#include <string.h>

/* stream.c: pairs that are never stored all at once: in blocks, shown to a function, or joined to
 * clusters. A stream holds a search that is ready to be walked, a bookmark of how
 * far that has come, and the pairs that were found and not yet handed out. */

/* Pairs that are looked for at a time, at least: less would not pay for walkers and threads. */
#define LEAST_FILL (INT64_C(1) << 16)

/* Pairs that room is reserved for before any is found, at most; larger blocks grow. */
#define MOST_EXPECTED 0x1p24

struct hs_stream {
    hs_call      call;  /* that opened it; it has threads only while it looks for pairs */
    hs_query     query; /* with nothing of the caller's but */
    hs_box       box;   /* where it has any */
    hs_query_run run;
    int64_t      n_steps; /* that have been opened */
    int          ndim;
    hs_output    held; /* pairs from `begin` on wait to be handed out */
    int64_t      begin;
    int64_t      max_pairs;
    hs_bookmark  next; /* where to go on looking */
    double       told; /* the largest fraction that poll has been called with */
    hs_poll_fn   poll; /* of the caller, during hs_stream_next */
    void        *context;
};

static int64_t
waiting(const hs_stream *stream)
{
    return stream->held.n_pairs - stream->begin;
}

/* Whether the present search has found all that it can. */
static bool
is_over(const hs_stream *stream)
{
    const hs_search *search = stream->run.search;
    return search == NULL || stream->next.point == hs_search_asking(search)->n;
}

static bool
is_all_found(const hs_stream *stream)
{
    return is_over(stream) && stream->n_steps == stream->run.plan.n;
}

/* An empty output, columns as the options say. */
static void
open_output(const hs_stream *stream, hs_account *account, hs_output *output)
{
    const hs_options *options = &stream->call.options;
    hs_output_init(account, stream->ndim, options->want, options->index_bytes, output);
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

static int64_t
fill_of(const hs_stream *stream)
{
    return stream->max_pairs > LEAST_FILL ? stream->max_pairs : LEAST_FILL;
}

/* The pairs from `first` on in an output of their own, with room for what comes. */
static hs_status
move_waiting(hs_stream *stream, int64_t first, hs_output *moved)
{
    const double expected = fmin((double)fill_of(stream), stream->run.search->grid.expected_pairs);
    open_output(stream, &stream->call.account, moved);
    hs_output_reserve_hint(moved, fmin(expected, MOST_EXPECTED));
    const hs_status status = copy_waiting(stream, first, stream->held.n_pairs - first, moved);
    if (status != HS_OK) {
        hs_output_free(moved);
    }
    return status;
}

/* Looks for as many pairs as a block has. What an unfinished attempt has found is dropped. */
static hs_status
fill(hs_stream *stream, hs_failure *failure)
{
    hs_search *search = stream->run.search;
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
        hs_parallel_record_on(search, &stream->held, fill_of(stream), &stream->next, failure);
    hs_call_dismiss(search->call);
    if (status != HS_OK) {
        stream->held.n_pairs = before;
        return status;
    }
    return hs_poll(&search->call->options, hs_search_fraction(search, stream->next.point));
}

/* The next search, once the one before is over. */
static hs_status
open_step(hs_stream *stream, hs_failure *failure)
{
    stream->run.failure = failure;
    hs_query_close_step(&stream->run);
    const hs_status status = hs_query_open_step(&stream->run, stream->n_steps);
    if (status == HS_OK) {
        stream->next = (hs_bookmark){.point = 0};
        stream->n_steps++;
    }
    return status;
}

/* Hands out the first n pairs that wait: the held columns become theirs, the rest is copied. */
static hs_status
give_away(hs_stream *stream, int64_t n, hs_output *given)
{
    hs_output       rest;
    const hs_status status = move_waiting(stream, n, &rest);
    if (status == HS_OK) {
        *given = stream->held;
        hs_account_give(given->account, given->charged * hs_output_bytes_per_pair(given));
        given->account = NULL;
        given->charged = 0;
        given->n_pairs = n;
        stream->held = rest;
    }
    return status;
}

/* Hands out a copy of the first n pairs that wait; without the memory for it, an empty one. */
static hs_status
copy_out(hs_stream *stream, int64_t n, hs_output *copy)
{
    open_output(stream, NULL, copy);
    const hs_status status = copy_waiting(stream, stream->begin, n, copy);
    if (status == HS_OK) {
        stream->begin += n;
    }
    return status;
}

static hs_status
take_block(hs_stream *stream, hs_pairs **result)
{
    const int64_t n = waiting(stream) < stream->max_pairs ? waiting(stream) : stream->max_pairs;
    hs_pairs     *block = hs_pairs_new();
    if (block == NULL) {
        return HS_ERR_MEMORY;
    }
    block->call.account = (hs_account){.arena = NULL}; /* what is held is not charged to it */
    /* What is held becomes the block where that leaves less to be copied. */
    const bool      gives = stream->begin == 0 && waiting(stream) - n < n;
    const hs_status status = gives ? give_away(stream, n, &block->output)
                                   : copy_out(stream, n, &block->output);
    if (status != HS_OK) {
        hs_free(NULL, block);
        return status;
    }
    *result = block;
    return HS_OK;
}

/* A hs_poll_fn: the fraction does not fall where pairs are sought a second time, because they did
 * not fit a block or the caller stopped. */
static bool
tell(void *context, double fraction)
{
    hs_stream *stream = context;
    stream->told = hs_larger(stream->told, fraction);
    return stream->poll(stream->context, stream->told);
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
    stream->poll = poll;
    stream->context = context;
    hs_call_set_poll(poll != NULL ? tell : NULL, stream, &stream->call);
    while (status == HS_OK && waiting(stream) < stream->max_pairs && !is_all_found(stream)) {
        status = is_over(stream) ? open_step(stream, failure) : fill(stream, failure);
    }
    if (status == HS_OK && waiting(stream) > 0) {
        status = take_block(stream, block);
    }
    hs_call_tell_limit(&stream->call, status, failure);
    hs_call_set_poll(NULL, NULL, &stream->call);
    hs_leave(entry);
    return status;
}

/* The options of the stream's search: what the caller lends for one call is left out. */
static hs_options
options_of_stream(const hs_options *options)
{
    hs_options of_stream = *options;
    of_stream.sorted = false;
    of_stream.out = NULL;
    of_stream.counters = NULL;
    return of_stream;
}

/* Opens what the caller's arrays are needed for: the one search, or what all steps of a reach are
 * made of. Labels last until hs_stream_open returns. */
static hs_status
open_search(hs_stream *stream, hs_failure *failure)
{
    static const hs_finder of_stream = {.find = NULL};
    hs_query              *query = &stream->query;
    hs_query_run          *run = &stream->run;
    hs_status              status = hs_query_open(query, &of_stream, &stream->call, run, failure);
    if (status == HS_OK) {
        status = !run->has_levels ? open_step(stream, failure) : HS_OK;
        status = status == HS_OK ? hs_choice_keep_labels(&query->sets, &stream->call) : status;
        if (status != HS_OK) {
            hs_query_close(run);
        }
    }
    if (query->box != NULL) {
        stream->box = *query->box;
        query->box = &stream->box;
    }
    hs_call_tell_limit(&stream->call, status, failure);
    return status;
}

hs_status
hs_stream_open(const hs_among *among, const hs_options *options, int64_t max_pairs,
               hs_stream **result, hs_failure *failure)
{
    if (result != NULL) {
        *result = NULL;
    }
    if (!hs_can_begin(result, options) || max_pairs < 1) {
        return hs_end_early(HS_ERR_ARGUMENT, NULL, failure);
    }
    const hs_options of_stream = options_of_stream(options);
    hs_stream       *stream = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *stream);
    if (stream == NULL) {
        return hs_end_early(HS_ERR_MEMORY, NULL, failure);
    }
    hs_call *call = &stream->call;
    failure = hs_call_enter(&of_stream, failure, call);
    stream->query = hs_query_among(among, HS_HALF_LIST, &of_stream);
    stream->query.sets.keeps_none = true;
    stream->n_steps = 0;
    const hs_status status = open_search(stream, failure);
    hs_call_leave(call, 0);
    hs_call_detach(call);
    if (status != HS_OK) {
        hs_account_close(&call->account);
        hs_free(NULL, stream);
        return status;
    }
    stream->ndim = stream->query.sets.points->ndim;
    open_output(stream, &call->account, &stream->held);
    stream->begin = 0;
    stream->max_pairs = max_pairs;
    stream->next = (hs_bookmark){.point = 0};
    stream->told = 0.0;
    *result = stream;
    return HS_OK;
}

void
hs_stream_free(hs_stream *stream)
{
    if (stream == NULL) {
        return;
    }
    hs_output_free(&stream->held);
    hs_query_close(&stream->run);
    hs_account_close(&stream->call.account);
    hs_free(NULL, stream);
}

/* Pairs handed to a function as they are found, stored nowhere. */

#define WANTED (HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT)

/* Work of a call in candidates, for polling: functions take tens of nanoseconds and more. */
#define CALL_WORK 32

/* What one thread works with. */
typedef struct visitor {
    const hs_visit *visit;    /* borrowed */
    hs_output       part;     /* owned; the pairs that are being visited */
    hs_recorder     recorder; /* owned; of the part */
    int64_t         n_visited;
} visitor;

static int
call_each(const hs_visit *visit, const hs_pair_arrays *pairs, int ndim, int64_t *n_taken)
{
    const int64_t *i = pairs->i, *j = pairs->j;
    for (int64_t e = 0; e < pairs->capacity; e++) {
        const double d = pairs->distance[e];
        if (visit->pair(i[e], j[e], pairs->shift + e * ndim, pairs->vector + e * ndim, d * d,
                        visit->user) != 0) {
            *n_taken = e + 1;
            return 1;
        }
    }
    return 0;
}

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
    int64_t              n_taken = part->n_pairs;
    const int            stops = visit->pairs != NULL
                                     ? visit->pairs(&pairs, part->n_pairs, &n_taken, visit->user)
                                     : call_each(visit, &pairs, part->ndim, &n_taken);
    (void)hs_fpenv_enter(); /* the caller's function may have changed it */
    doing->n_visited += n_taken;
    scanner->work_since_poll += CALL_WORK * part->n_pairs;
    return stops != 0 ? HS_ENOUGH : HS_OK;
}

/* What the threads share. */
typedef struct visiting {
    const hs_visit *visit;
    unsigned        want; /* columns, with indices of so many bytes */
    int             index_bytes;
    hs_search      *search;
    int64_t         n_visited; /* by those that have ended */
} visiting;

static hs_status
open_visitor(void *job, void *place)
{
    const visiting *shared = job;
    visitor        *doing = place;
    doing->visit = shared->visit;
    hs_output_init(NULL, shared->search->scene.ndim, shared->want, shared->index_bytes,
                   &doing->part);
    return hs_recorder_init(&shared->search->call->account, &doing->part, HS_MOST_HITS,
                            &doing->recorder);
}

static void
close_visitor(void *job, void *place)
{
    visiting *shared = job;
    visitor  *doing = place;
    shared->n_visited += doing->n_visited;
    hs_recorder_free(&shared->search->call->account, &doing->recorder);
    hs_output_free(&doing->part);
}

/* A hs_use_fn: each thread visits the pairs that it finds. HS_ENOUGH: a function wants no more. */
static hs_status
visit_step(void *context, hs_query_run *run)
{
    visiting shared = *(const visiting *)context;
    hs_crew  crew = {.call = run->call,
                     .job = &shared,
                     .worker_size = sizeof(visitor),
                     .open = open_visitor,
                     .close = close_visitor};
    shared.search = run->search;
    if (!shared.visit->thread_safe) { /* other threads only make the search ready */
        hs_call_dismiss(run->call);
    }
    hs_status status = hs_crew_open(&crew);
    if (status == HS_OK) {
        const hs_visitors all = {.use = hs_record_use(shared.want),
                                 .visit = visit_hits,
                                 .contexts = crew.workers,
                                 .context_size = crew.worker_size};
        status = hs_parallel_visit(run->search, &all, NULL, run->failure);
    }
    hs_crew_close(&crew);
    run->n_pairs += shared.n_visited;
    return status;
}

/* A hs_use_fn. */
static hs_status
visit_pairs(void *context, hs_query_run *run)
{
    return hs_query_each_step(run, visit_step, context);
}

/* hs_pairs_visit with options->want and ->index_bytes heeded, by visit->pairs where that leaves a
 * column out; all but `among` is there. */
static hs_status
visit_columns(const hs_among *among, const hs_options *options, const hs_visit *visit,
              int64_t *n_visited, hs_failure *failure)
{
    visiting shared = {.visit = visit, .want = options->want, .index_bytes = options->index_bytes};
    const hs_finder finder = {.find = visit_pairs,
                              .context = &shared,
                              .is_numbered = true,
                              .one_thread = !visit->thread_safe};
    hs_counters     done;
    hs_options      of_visit = *options;
    hs_query        query = hs_query_among(among, HS_HALF_LIST, &of_visit);
    of_visit.sorted = false;
    of_visit.out = NULL;
    of_visit.counters = options->counters != NULL ? options->counters : &done;
    if (!visit->thread_safe && options->threads > 1) { /* others only make the search ready */
        const double n = (double)(hs_query_asking(&query) / HS_POINTS_MADE_READY);
        of_visit.threads = hs_call_threads(n, options) > 1 ? options->threads : 1;
    }
    query.sets.keeps_none = true;
    const hs_status status = hs_query_answer(&query, &finder, NULL, failure);
    *n_visited = of_visit.counters->pairs;
    return status == HS_ENOUGH ? HS_OK : status;
}

hs_status
hs_pairs_visit(const hs_among *among, const hs_options *options, const hs_visit *visit,
               int64_t *n_visited, hs_failure *failure)
{
    if (n_visited != NULL) {
        *n_visited = 0;
    }
    if (n_visited == NULL || options == NULL || visit == NULL ||
        (visit->pair == NULL && visit->pairs == NULL)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_options of_visit = *options;
    of_visit.want = WANTED;
    of_visit.index_bytes = 8;
    return visit_columns(among, &of_visit, visit, n_visited, failure);
}

/* Clusters of points, joined pair by pair while these are found. */

/* What the pairs are for. */
typedef struct clustering {
    hs_components  components; /* owned */
    const uint8_t *core;       /* borrowed, or NULL */
    int64_t       *labels;     /* borrowed */
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

/* Whether some point is near enough to a cluster only. */
static bool
has_others(const uint8_t *core, int64_t n)
{
    return core != NULL && n > 0 && memchr(core, 0, (size_t)n) != NULL;
}

/* Whether anything repeats, in any system. */
static bool
is_periodic(const hs_query *query)
{
    const hs_box         *box = query->box;
    const hs_each_system *each = query->among != NULL ? query->among->each : NULL;
    bool                  any = false;
    if (box == NULL || each == NULL || each->periodic == NULL) {
        for (int l = 0; box != NULL && l < box->ndim; l++) {
            any = any || box->periodic[l];
        }
        return any;
    }
    for (int64_t s = 0; s < query->among->points->n_systems; s++) {
        any = any || each->periodic[s] != 0;
    }
    return any;
}

/* The pairs, once or twice; the options' memory limit is what the search may take. */
static hs_status
join_all_pairs(const hs_among *among, const hs_options *options, clustering *doing,
               uint8_t *winding, int64_t *n_clusters, hs_failure *failure)
{
    hs_visit      visit = {.pairs = join_pairs, .user = doing};
    hs_options    of_visit = *options;
    int64_t       n_pairs;
    const int64_t n = doing->components.n;
    of_visit.want = HS_WANT_I | HS_WANT_J | (doing->components.n_axes > 0 ? HS_WANT_SHIFT : 0);
    hs_status status = visit_columns(among, &of_visit, &visit, &n_pairs, failure);
    if (status != HS_OK) {
        return status;
    }
    const int64_t found =
        hs_components_label(&doing->components, doing->core, doing->labels, winding);
    if (has_others(doing->core, n)) {
        visit.pairs = adopt_points;
        of_visit.want = HS_WANT_I | HS_WANT_J;
        of_visit.counters = NULL;
        status = visit_columns(among, &of_visit, &visit, &n_pairs, failure);
    }
    if (status == HS_OK) {
        *n_clusters = found;
    }
    return status;
}

static hs_status
find_clusters(const hs_among *among, const hs_options *options, const uint8_t *core,
              int64_t *labels, uint8_t *winding, int64_t *n_clusters, hs_failure *failure)
{
    const hs_query   query = hs_query_among(among, HS_HALF_LIST, options);
    const hs_points *points = query.sets.points;
    clustering       doing = {.core = core, .labels = labels};
    hs_account       account;
    hs_clear_counters(options);
    hs_status status = hs_check_arguments(points, NULL, query.box, options, failure);
    if (status != HS_OK) {
        return status;
    }
    const int n_axes = winding != NULL && is_periodic(&query) ? points->ndim : 0;
    hs_account_init(&account, options);
    status = hs_components_open(&account, points->n, n_axes, &doing.components);
    if (status == HS_OK) {
        hs_options of_search = *options;
        of_search.memory_limit -= (double)account.held;
        status = join_all_pairs(among, &of_search, &doing, winding, n_clusters, failure);
        failure->limit_bytes += status == HS_ERR_MEMORY ? (double)account.held : 0.0;
    } else {
        failure->limit_bytes = account.limit;
    }
    hs_components_close(&account, &doing.components);
    hs_account_close(&account);
    return status;
}

hs_status
hs_clusters_find(const hs_among *among, const hs_options *options, const uint8_t *core,
                 int64_t *labels, uint8_t *winding, int64_t *n_clusters, hs_failure *failure)
{
    const hs_query query = hs_query_among(among, HS_HALF_LIST, options);
    if (options == NULL || n_clusters == NULL || !hs_has_entries(labels, query.sets.points)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_entry   entry;
    hs_options of_search = hs_options_of_count(options);
    of_search.index_bytes = 4;
    failure = hs_enter(failure, &entry);
    const hs_status status =
        find_clusters(among, &of_search, core, labels, winding, n_clusters, failure);
    hs_leave(&entry);
    return status;
}
