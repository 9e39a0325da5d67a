/* SPDX-License-Identifier: BSD-3-Clause */
#include "query.h"

#include <math.h>
#include <string.h>

/* stream.c: pairs in blocks. A stream holds a search of each system that is ready to be walked, a
 * bookmark of how far that has come, and the pairs that were found and not yet handed out. */

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
    source      own;       /* of a stream of one system; else only its query */
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

/* Opens the one system of a query, or each of several. Labels last until hs_stream_open returns. */
static hs_status
open_sources(hs_stream *stream, const hs_query *query, hs_failure *failure)
{
    static const hs_finder of_pairs = {.is_numbered = true};
    hs_call               *call = &stream->call;
    source                *own = &stream->own;
    own->system.query = *query;
    hs_status status = hs_query_open(&own->system.query, &of_pairs, call, &own->run, failure);
    if (status == HS_OK) {
        status = hs_choice_keep_labels(&query->sets, call);
    }
    if (query->among == NULL) {
        stream->sources = own;
        stream->n_sources = 1;
        return status == HS_OK ? open_source(own) : status;
    }
    const int64_t n = status == HS_OK ? query->among->points->n_systems : 0;
    stream->choice = call->choice;
    if (status == HS_OK) {
        stream->sources = hs_alloc(&call->account, HS_FOR_INDICES, n, sizeof(source));
        status = stream->sources != NULL ? HS_OK : HS_ERR_MEMORY;
    }
    for (int64_t s = 0; status == HS_OK && s < n; s++) {
        source *one = &stream->sources[stream->n_sources++];
        one->n_steps = 0;
        hs_system_begin(query, &of_pairs, call, failure, &one->system, &one->run);
        status = hs_system_open(query, s, stream->choice, &one->system, &one->run);
        status = status == HS_OK ? open_source(one) : status;
        failure->system = status == HS_OK ? -1 : s;
    }
    if (status == HS_OK && n > 0) {
        take_up(stream, 0);
    }
    return status;
}

hs_status
hs_stream_open(const hs_among *among, const hs_options *options, int64_t max_pairs,
               hs_stream **result, hs_failure *failure)
{
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
    const hs_status status = open_sources(stream, &query, failure);
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
