/* SPDX-License-Identifier: BSD-3-Clause */
/* reach_entries.h: every function that knows a reach for each pair, behind one signature. */
#ifndef HS_REACH_ENTRIES_H
#define HS_REACH_ENTRIES_H

#include "calls.h"
#include "reach_brute.h"

static reach_scene scene; /* the present one */

/* One call of each function; its answer is a hash of what it gave, of the pairs in any order for
 * visits. */
typedef enum entry { FIND, SORTED, COUNT, ROWS, ROW_COUNTS, STREAM, VISIT, ENTRIES } entry;

typedef struct entry_call {
    entry      which;
    hs_among   among;
    hs_options options;
    hs_failure failure;
    uint64_t   answer;
} entry_call;

static inline hs_status
run_entry(void *context)
{
    entry_call    *e = context;
    const hs_visit visit = {.pair = call_note_pair, .thread_safe = true};
    hs_options     options = e->options;
    call           c = {.options = &options,
                        .has_result = true,
                        .visit = &visit,
                        .max_pairs = 7,
                        .ndim = scene.of.scene.ndim,
                        .index_bytes = 8};
    hs_pairs      *pairs = CALL_NOTHING;
    hs_stream     *stream = CALL_NOTHING;
    int64_t        count = -7, counts[CALL_ROOM] = {0};
    hs_status      status;
    memset(&e->failure, 0x5a, sizeof e->failure);
    options.sorted = e->which == SORTED;
    call_visited = 0;
    switch (e->which) {
    case COUNT:
        status = hs_pairs_count(&e->among, &options, &count, &e->failure);
        status = call_take_count(&c, status, count);
        break;
    case ROWS:
        status = hs_neighbors_find(&e->among, &options, &pairs, &e->failure);
        status = call_take_pairs(&c, status, pairs);
        break;
    case ROW_COUNTS:
        status = hs_neighbors_count(&e->among, &options, counts, &e->failure);
        status = call_take_counts(&c, status, counts, CALL_ROOM);
        break;
    case STREAM:
        status = hs_stream_open(&e->among, &options, c.max_pairs, &stream, &e->failure);
        status = call_take_stream(&c, status, stream, &e->failure);
        break;
    case VISIT:
        status = hs_pairs_visit(&e->among, &options, &visit, &count, &e->failure);
        status = call_take_visits(&c, status, count);
        break;
    default:
        status = hs_pairs_find(&e->among, &options, &pairs, &e->failure);
        status = call_take_pairs(&c, status, pairs);
    }
    e->answer = c.answer;
    return status;
}

/* A call of the present scene, with everything wanted. */
static inline entry_call
entry_of(entry which)
{
    entry_call e = {.which = which, .among = scene.among, .options = reach_options(&scene)};
    e.options.want = WANT_ALL;
    return e;
}

static inline bool
takes_queries(entry which)
{
    return which == COUNT || which == ROWS || which == ROW_COUNTS;
}

#endif
