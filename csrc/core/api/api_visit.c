/* SPDX-License-Identifier: BSD-3-Clause */
/* api_visit.c: pairs handed to a function as they are found, stored nowhere. */
#include "visit_columns.h"

#include "by_reach.h"

#include "../base/outcome.h"
#include "../base/fpenv.h"
#include "../collect/crew.h"
#include "../collect/parallel.h"
#include "../collect/record.h"

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
    int64_t        *n_visited; /* by those that have ended */
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
    const visiting *shared = job;
    visitor        *doing = place;
    *shared->n_visited += doing->n_visited;
    hs_recorder_free(&shared->search->call->account, &doing->recorder);
    hs_output_free(&doing->part);
}

/* A hs_use_fn: each thread visits the pairs that it finds. HS_ENOUGH: a function wants no more. */
static hs_status
visit_pairs(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    visiting     *shared = context;
    hs_crew       crew = {.call = search->call,
                          .job = shared,
                          .worker_size = sizeof(visitor),
                          .open = open_visitor,
                          .close = close_visitor};
    const int64_t before = *shared->n_visited;
    shared->search = search;
    if (!shared->visit->thread_safe) { /* other threads only make the search ready */
        hs_call_dismiss(search->call);
    }
    hs_status status = hs_crew_open(&crew);
    if (status == HS_OK) {
        const hs_visitors all = {.use = hs_record_use(shared->want),
                                 .visit = visit_hits,
                                 .contexts = crew.workers,
                                 .context_size = crew.worker_size};
        status = hs_parallel_visit(search, &all, NULL, failure);
    }
    hs_crew_close(&crew);
    *n_pairs = *shared->n_visited - before;
    return status;
}

hs_status
hs_visit_columns(const hs_among *among, const hs_options *options, const hs_visit *visit,
                 int64_t *n_visited, hs_failure *failure)
{
    visiting   shared = {.visit = visit,
                         .want = options->want,
                         .index_bytes = options->index_bytes,
                         .n_visited = n_visited};
    hs_options of_visit = *options;
    hs_request request = hs_request_among(among, HS_HALF_LIST, &of_visit);
    of_visit.sorted = false;
    of_visit.out = NULL;
    if (!visit->thread_safe && options->threads > 1) { /* others only make the search ready */
        const int64_t n = request.sets.points == NULL ? 0 : request.sets.points->n;
        const int     n_threads = hs_call_threads((double)(n / HS_POINTS_MADE_READY), options);
        of_visit.threads = n_threads > 1 ? options->threads : 1;
    }
    request.sets.keeps_none = true;
    *n_visited = 0;
    const hs_status status = hs_by_reach_use(&request, visit_pairs, &shared, failure);
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
    return hs_visit_columns(among, &of_visit, visit, n_visited, failure);
}
