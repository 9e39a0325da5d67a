/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * calls.h: every function of halfshell.h that can fail, behind one signature, so that a test can
 * put the same question to all of them. Each call checks that outputs are what the header promises
 * and condenses an answer to one number.
 */
#ifndef HS_CALLS_H
#define HS_CALLS_H

#include <stdatomic.h>

#include "../../../csrc/halfshell.h"
#include "harness.h"
#include "among.h"
#include "kept.h"

enum { CALL_ROOM = 1024 }; /* entries of counts, and of what histograms write */

/* Which arguments a function looks at. */
enum {
    USES_POINTS = 1 << 0,
    USES_QUERIES = 1 << 1,  /* when they are not NULL */
    NEEDS_QUERIES = 1 << 2, /* which may not be NULL */
    USES_BOX = 1 << 3,      /* when it is not NULL */
    NEEDS_BOX = 1 << 4,     /* which may not be NULL */
    USES_OPTIONS = 1 << 5,  /* at least threads and the limit of memory */
    USES_CUTOFF = 1 << 6,
    NEEDS_FINITE = 1 << 7, /* cutoffs */
    USES_CELL_SIZE = 1 << 8,
    USES_PRECISION = 1 << 9,
    USES_WANT = 1 << 10,
    USES_INDEX_BYTES = 1 << 11,
    USES_OUT = 1 << 12,
    USES_KERNEL = 1 << 13,
    USES_COUNTERS = 1 << 14,
    USES_RESULT = 1 << 15,
    USES_HISTOGRAM = 1 << 16,
    USES_VISIT = 1 << 17,
    USES_SYSTEMS = 1 << 18,
    USES_CELLS = 1 << 19,
    USES_LIST = 1 << 20,
    USES_SKIN = 1 << 21,
    USES_STREAM = 1 << 22,
    USES_K = 1 << 23,
    USES_MAX_PAIRS = 1 << 24,
    USES_REACH = 1 << 25,

    /* What most searches look at. */
    OF_SEARCH = USES_OPTIONS | USES_CUTOFF | NEEDS_FINITE | USES_CELL_SIZE | USES_PRECISION |
                USES_KERNEL | USES_COUNTERS | USES_RESULT,
    OF_REACH = USES_REACH | (OF_SEARCH & ~NEEDS_FINITE), /* the cutoff is a further limit */
    OF_ARRAYS = USES_WANT | USES_INDEX_BYTES | USES_OUT,
    OF_SCENE = USES_POINTS | USES_BOX
};

/* Where several systems begin, and what each has of its own. */
typedef struct call_systems {
    int64_t        n;
    const int64_t *first, *first_query;
    hs_each_system each;
} call_systems;

/* All arguments that there are. All but `answer` borrowed. */
typedef struct call {
    const hs_points    *points, *queries;
    hs_set              known, of_queries; /* what is known of them */
    hs_set              sets[2];           /* both, for a call */
    const hs_box       *box;
    const hs_options   *options;
    const hs_histogram *histogram;
    const call_systems *systems;
    bool                in_systems; /* these are searched */
    const hs_visit     *visit;      /* of call_note_pair */
    const hs_reach     *reach;
    bool                by_reach; /* each pair has a reach of its own, that of `reach` */
    hs_cells           *cells;
    bool                in_cells; /* these are searched, not the points */
    hs_verlet          *list;
    hs_stream          *stream;
    int64_t             k, max_pairs;
    double              skin;
    bool                has_result;        /* false: NULL in place of where the answer goes */
    int                 retries;           /* so often a stream that lacked memory is asked again */
    int                 ndim, index_bytes; /* of results, whatever the arguments are spoilt to */
    int64_t             n_points;
    uint64_t            answer; /* of the last call that succeeded */
} call;

typedef struct call_kind {
    const char *name;
    hs_status (*run)(call *c, hs_failure *failure);
    unsigned uses;
} call_kind;

static _Atomic uint64_t call_visited; /* the sum of what was visited, in whatever order */

/* A hs_pair_fn. */
static inline int
call_note_pair(int64_t i, int64_t j, const int32_t *S, const double *D, double d2, void *user)
{
    uint64_t hash = hash_bytes(1, &i, sizeof i);
    hash = hash_bytes(hash, &j, sizeof j);
    hash = hash_bytes(hash, S, sizeof *S);
    hash = hash_bytes(hash, D, sizeof *D);
    call_visited += hash_bytes(hash, &d2, sizeof d2);
    (void)user;
    return 0;
}

static inline size_t
call_width(const call *c, unsigned bit)
{
    const size_t index = (size_t)c->index_bytes, d = (size_t)c->ndim;
    return bit == HS_WANT_DISTANCE ? 8
           : bit == HS_WANT_VECTOR ? 8 * d
           : bit == HS_WANT_SHIFT  ? 4 * d
           : bit == HS_WANT_BOTH   ? 2 * index
                                   : index;
}

/* Length, rows and arrays, also those of the caller. */
static inline uint64_t
call_hash_pairs(const call *c, const hs_pairs *pairs)
{
    const int64_t n = hs_pairs_length(pairs), rows = hs_pairs_rows(pairs);
    uint64_t      hash = hash_bytes(hash_bytes(7, &n, sizeof n), &rows, sizeof rows);
    if (rows > 0) {
        hash = hash_bytes(hash, hs_pairs_offsets(pairs), (size_t)(rows + 1) * sizeof(int64_t));
    }
    for (unsigned bit = 1; bit <= HS_WANT_BOTH; bit *= 2) {
        const void *array = hs_pairs_array(pairs, bit);
        if (array != NULL) {
            hash = hash_bytes(hash, array, (size_t)n * call_width(c, bit));
        }
    }
    if (c->options != NULL && c->options->out != NULL && c->options->want & HS_WANT_I &&
        hs_pairs_array(pairs, HS_WANT_I) == NULL) {
        hash = hash_bytes(hash, c->options->out->i, (size_t)n * call_width(c, HS_WANT_I));
    }
    return hash;
}

/* What no function returns: whether it has written there can be seen. */
static int call_mark;
#define CALL_NOTHING ((void *)&call_mark)

/* Ends a call that returns pairs. */
static inline hs_status
call_take_pairs(call *c, hs_status status, hs_pairs *pairs)
{
    if (!c->has_result) {
        CHECK(status != HS_OK && pairs == CALL_NOTHING);
        return status;
    }
    CHECK((status == HS_OK) == (pairs != NULL) && pairs != CALL_NOTHING);
    if (status == HS_OK && pairs != NULL) {
        c->answer = call_hash_pairs(c, pairs);
        hs_pairs_free(pairs);
    }
    return status;
}

/* Ends one that counts: what was -7 stays so on failure. */
static inline hs_status
call_take_count(call *c, hs_status status, int64_t count)
{
    CHECK(status == HS_OK ? count >= 0 : count == -7);
    c->answer = status == HS_OK ? (uint64_t)count : c->answer;
    return status;
}

/* Ends one that writes counts of points, or of systems. */
static inline hs_status
call_take_counts(call *c, hs_status status, const int64_t *counts, int64_t n)
{
    if (status == HS_OK) {
        c->answer = hash_bytes(3, counts, (size_t)n * sizeof *counts);
    }
    return status;
}

#define RESULT(result) (c->has_result ? &(result) : NULL)

/* Among what the call searches, with these queries. */
static inline hs_among
call_among(call *c, const hs_points *queries)
{
    hs_among among = {.reach = c->by_reach ? c->reach : NULL};
    c->sets[0] = c->known;
    c->sets[1] = c->of_queries;
    among.queries = set_with(queries, &c->sets[1]);
    if (c->in_cells) {
        among.cells = c->cells;
        among.points = &c->sets[0];
    } else {
        among.points = set_with(c->points, &c->sets[0]);
        among.box = c->box;
    }
    if (c->in_systems) {
        c->sets[0].n_systems = c->sets[1].n_systems = c->systems->n;
        c->sets[0].first = c->systems->first;
        c->sets[1].first = c->systems->first_query;
        among.each = &c->systems->each;
    }
    return among;
}

static inline hs_status
call_find(call *c, hs_failure *failure)
{
    const hs_among  among = call_among(c, NULL);
    hs_pairs       *pairs = CALL_NOTHING;
    const hs_status status = hs_pairs_find(&among, c->options, RESULT(pairs), failure);
    return call_take_pairs(c, status, pairs);
}

/* One number, or one for each system. */
static inline hs_status
call_count(call *c, hs_failure *failure)
{
    const hs_among  among = call_among(c, c->in_systems ? NULL : c->queries);
    int64_t         counts[CALL_ROOM] = {-7};
    const hs_status status = hs_pairs_count(&among, c->options, RESULT(counts[0]), failure);
    return c->in_systems ? call_take_counts(c, status, counts, status == HS_OK ? c->systems->n : 0)
                         : call_take_count(c, status, counts[0]);
}

static inline hs_status
call_neighbors(call *c, hs_failure *failure)
{
    const hs_among  among = call_among(c, c->queries);
    hs_pairs       *rows = CALL_NOTHING;
    const hs_status status = hs_neighbors_find(&among, c->options, RESULT(rows), failure);
    return call_take_pairs(c, status, rows);
}

static inline hs_status
call_neighbors_count(call *c, hs_failure *failure)
{
    const hs_among  among = call_among(c, c->queries);
    int64_t         counts[CALL_ROOM];
    const hs_status status = hs_neighbors_count(&among, c->options, RESULT(counts[0]), failure);
    return call_take_counts(c, status, counts, c->queries != NULL ? c->queries->n : c->n_points);
}

/* Of a histogram whose arrays have CALL_ROOM entries, or are NULL; of systems, the first one. */
static inline hs_status
call_take_histogram(call *c, hs_status status)
{
    const hs_histogram *histogram = c->histogram;
    if (status == HS_OK) {
        const size_t n = (size_t)(histogram->n_edges * histogram->n_types * histogram->n_types);
        c->answer = histogram->counts != NULL ? hash_bytes(5, histogram->counts, 8 * n) : 0;
        c->answer = histogram->sums != NULL ? hash_bytes(c->answer, histogram->sums, 8 * n)
                                            : c->answer;
    }
    return status;
}

static inline hs_status
call_histogram(call *c, hs_failure *failure)
{
    const hs_among among = call_among(c, c->queries);
    return call_take_histogram(c, hs_pairs_histogram(&among, c->options, c->histogram, failure));
}

static inline hs_status
call_nearest(call *c, hs_failure *failure)
{
    const hs_among  among = call_among(c, c->queries);
    hs_pairs       *rows = CALL_NOTHING;
    const hs_status status = hs_nearest_find(&among, c->k, c->options, RESULT(rows), failure);
    return call_take_pairs(c, status, rows);
}

/* All blocks that are left. */
static inline hs_status
call_drain(call *c, hs_stream *stream, hs_failure *failure)
{
    hs_status status = HS_OK;
    uint64_t  answer = 0;
    bool      over = false;
    while (status == HS_OK && !over) {
        hs_pairs *block = CALL_NOTHING;
        status = hs_stream_next(stream, NULL, NULL, RESULT(block), failure);
        over = status == HS_OK && block == NULL;
        if (status == HS_ERR_MEMORY && c->retries > 0) {
            CHECK(block == NULL);
            c->retries--;
            status = HS_OK;
        } else if (status == HS_OK && block != NULL) {
            CHECK(block != CALL_NOTHING && hs_pairs_length(block) > 0);
            answer = answer * 31 + call_hash_pairs(c, block);
            hs_pairs_free(block);
        } else {
            CHECK(block == (c->has_result ? NULL : CALL_NOTHING));
        }
    }
    c->answer = over ? answer : c->answer;
    return status;
}

/* Opens and reads it. */
static inline hs_status
call_take_stream(call *c, hs_status status, hs_stream *stream, hs_failure *failure)
{
    if (!c->has_result) {
        CHECK(status != HS_OK && stream == CALL_NOTHING);
        return status;
    }
    CHECK((status == HS_OK) == (stream != NULL) && stream != CALL_NOTHING);
    if (status == HS_OK) {
        status = call_drain(c, stream, failure);
        hs_stream_free(stream);
    }
    return status;
}

static inline hs_status
call_stream(call *c, hs_failure *failure)
{
    const hs_among  among = call_among(c, NULL);
    hs_stream      *stream = CALL_NOTHING;
    const hs_status status =
        hs_stream_open(&among, c->options, c->max_pairs, RESULT(stream), failure);
    return call_take_stream(c, status, stream, failure);
}

/* A stream that may be at its end. */
static inline hs_status
call_stream_next(call *c, hs_failure *failure)
{
    return call_drain(c, c->stream, failure);
}

static inline hs_status
call_take_visits(call *c, hs_status status, int64_t n_visited)
{
    CHECK(n_visited >= (c->has_result ? 0 : -7));
    c->answer = status == HS_OK ? call_visited + (uint64_t)n_visited : c->answer;
    return status;
}

static inline hs_status
call_visit(call *c, hs_failure *failure)
{
    const hs_among among = call_among(c, NULL);
    int64_t        n_visited = -7;
    call_visited = 0;
    const hs_status status =
        hs_pairs_visit(&among, c->options, c->visit, RESULT(n_visited), failure);
    return call_take_visits(c, status, n_visited);
}

#endif
