/* SPDX-License-Identifier: BSD-3-Clause */
/* api_histogram.c: the public histogram of all pairs, which stores none of them. */
#include "request.h"
#include "../collect/crew.h"
#include "../collect/parallel.h"
#include "../histogram/tally.h"

/* What the threads share. */
typedef struct counting {
    hs_search          *search;
    const hs_histogram *histogram;
    hs_tally_plan       plan;
} counting;

/* What all threads have counted of one group, to entry `to` and on. Returns their number. */
static int64_t
write_group(const hs_tally *tallies, int n, int64_t group, int64_t to,
            const hs_histogram *histogram)
{
    int64_t all = 0;
    for (int64_t k = 0; k < histogram->n_edges; k++) {
        int64_t count = 0;
        for (int w = 0; w < n; w++) {
            count += hs_tally_count(&tallies[w], group, k);
        }
        if (histogram->counts != NULL) {
            histogram->counts[to + k] = count;
        }
        if (histogram->sums != NULL) {
            histogram->sums[to + k] =
                hs_sums_round(&tallies[0].sums, group * (histogram->n_edges + 1) + k);
        }
        all += count;
    }
    return all;
}

/* Returns the number of pairs. */
static int64_t
write_result(const counting *shared, hs_tally *tallies, int n)
{
    const hs_tally_plan *plan = &shared->plan;
    const hs_histogram  *histogram = shared->histogram;
    const bool           is_symmetric = !shared->search->has_queries;
    const int64_t        n_types = plan->n_types;
    int64_t              n_pairs = 0;
    for (int w = 1; w < n && plan->sums; w++) {
        hs_sums_join(&tallies[0].sums, &tallies[w].sums);
    }
    if (plan->sums) {
        hs_sums_carry(&tallies[0].sums);
    }
    for (int64_t a = 0; a < n_types; a++) {
        for (int64_t b = 0; b < n_types; b++) {
            const int64_t at = a * n_types + b, group = plan->has_types ? plan->group[at] : 0;
            const int64_t found =
                write_group(tallies, n, group, at * histogram->n_edges, histogram);
            n_pairs += is_symmetric && b < a ? 0 : found;
        }
    }
    return n_pairs;
}

static hs_status
open_tally(void *job, void *tally)
{
    const counting *shared = job;
    const int32_t   capacity = hs_walker_capacity(shared->search);
    return hs_tally_init(&shared->plan, capacity, hs_block_most_hits(capacity), tally);
}

static void
close_tally(void *job, void *tally)
{
    (void)job;
    hs_tally_free(tally);
}

/* Each thread counts by itself; then the counts are added up. */
static hs_status
count_pairs(counting *shared, int64_t *n_pairs, hs_failure *failure)
{
    hs_search *search = shared->search;
    hs_crew    crew = {.call = search->call,
                       .job = shared,
                       .worker_size = sizeof(hs_tally),
                       .open = open_tally,
                       .close = close_tally};
    hs_status  status = hs_crew_open(&crew);
    if (status == HS_OK) {
        const hs_visitors visitors = {.use = HS_BLOCK_LISTS_SQUARES,
                                      .visit = hs_tally_hits,
                                      .contexts = crew.workers,
                                      .context_size = crew.worker_size};
        status = hs_parallel_visit(search, &visitors, NULL, failure);
    }
    if (status == HS_OK) {
        *n_pairs = write_result(shared, crew.workers, crew.n_open);
    }
    hs_crew_close(&crew);
    return status;
}

/* The search up to the largest edge. */
static hs_options
options_of(const hs_histogram *histogram, const hs_options *options)
{
    hs_options of_search = hs_options_of_count(options);
    of_search.cutoff = histogram->edges[histogram->n_edges - 1];
    of_search.inclusive = histogram->last_inclusive;
    of_search.precision = HS_EXACT;
    return of_search;
}

/* A hs_use_fn. */
static hs_status
fill_histogram(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    counting  shared = {.search = search, .histogram = context};
    hs_status status = hs_tally_plan_open(search, shared.histogram, &shared.plan, failure);
    if (status == HS_OK) {
        status = count_pairs(&shared, n_pairs, failure);
    }
    hs_tally_plan_close(&shared.plan);
    return status;
}

static hs_status
find_histogram(const hs_among *among, const hs_options *options, const hs_histogram *histogram,
               hs_failure *failure)
{
    const hs_status status = options != NULL ? hs_check_histogram(histogram, failure)
                                             : HS_ERR_ARGUMENT;
    if (status != HS_OK) {
        hs_clear_counters(options);
        return status;
    }
    hs_histogram     filled = *histogram;
    const hs_options of_search = options_of(histogram, options);
    hs_request       request = hs_request_among(among, HS_HALF_OR_QUERIES, &of_search);
    request.sets.is_plain = true;
    request.sets.keeps_none = true;
    request.sets.least_cutoff = hs_least_length(histogram->edges, histogram->n_edges);
    return hs_request_use(&request, fill_histogram, &filled, failure);
}

/* Enters the floating-point environment itself, because edges are compared before the
 * search does. */
hs_status
hs_pairs_histogram(const hs_among *among, const hs_options *options, const hs_histogram *histogram,
                   hs_failure *failure)
{
    hs_entry entry;
    failure = hs_enter(failure, &entry);
    const hs_status status = find_histogram(among, options, histogram, failure);
    hs_leave(&entry);
    return status;
}
