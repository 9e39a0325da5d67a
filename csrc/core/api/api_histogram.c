/* SPDX-License-Identifier: BSD-3-Clause */
/* api_histogram.c: the public histogram of all pairs, which stores none of them. */
#include "request.h"
#include "../base/fpenv.h"
#include "../collect/crew.h"
#include "../base/poll.h"
#include "../histogram/tally.h"

#include <math.h>

#define MOST_EDGES (INT64_C(1) << 30) /* slots are int32 */

static hs_status
check_histogram(const hs_histogram *histogram, hs_failure *failure)
{
    if (histogram == NULL || histogram->edges == NULL || histogram->n_types < 1) {
        return HS_ERR_ARGUMENT;
    }
    if (histogram->n_edges < 1 || histogram->n_edges >= MOST_EDGES) {
        return HS_ERR_EDGES;
    }
    for (int64_t k = 0; k < histogram->n_edges; k++) {
        const double edge = histogram->edges[k];
        if (!isfinite(edge) || edge < 0.0 || (k > 0 && edge < histogram->edges[k - 1])) {
            failure->row = k;
            failure->value = edge;
            return HS_ERR_EDGES;
        }
    }
    return HS_OK;
}

static double
smallest_edge(const hs_histogram *histogram)
{
    for (int64_t k = 0; k < histogram->n_edges; k++) {
        if (histogram->edges[k] > 0.0) {
            return histogram->edges[k];
        }
    }
    return 0.0;
}

/* Which pairs of types are told apart: all, but in the half list (a, b) and (b, a) are one. */
static hs_status
plan_groups(bool has_queries, hs_tally_plan *plan)
{
    const int64_t n = plan->n_types;
    plan->n_groups = has_queries ? n * n : n * (n + 1) / 2;
    if (!plan->has_types) {
        plan->n_groups = 1;
        return HS_OK;
    }
    plan->group = plan->n_groups <= INT32_MAX
                      ? hs_alloc(plan->account, HS_FOR_CANDIDATES, n * n, sizeof(int32_t))
                      : NULL;
    if (plan->group == NULL) {
        return HS_ERR_MEMORY;
    }
    int32_t next = 0;
    for (int64_t a = 0; a < n; a++) {
        for (int64_t b = 0; b < n; b++) {
            const bool again = !has_queries && b < a;
            plan->group[a * n + b] = again ? plan->group[b * n + a] : next;
            next += !again;
        }
    }
    return HS_OK;
}

static hs_status
open_plan(hs_search *search, const hs_histogram *histogram, hs_tally_plan *plan,
          hs_failure *failure)
{
    hs_account *account = &search->call->account;
    plan->account = account;
    plan->has_types = histogram->n_types > 1;
    plan->n_types = histogram->n_types;
    plan->sums = histogram->sums != NULL;
    plan->asking = search->has_queries ? &plan->queries : &plan->points;
    hs_status status =
        hs_edges_init(account, &search->scene, search->filter_error, histogram, &plan->edges);
    if (status == HS_OK) {
        status = hs_marked_init(account, &histogram->of_points, search->bins.order, search->bins.n,
                                plan->n_types, &plan->points, failure);
    }
    if (status == HS_OK && search->has_queries) {
        status = hs_marked_init(account, &histogram->of_queries, search->query_bins.order,
                                search->query_bins.n, plan->n_types, &plan->queries, failure);
        failure->in_queries = status == HS_ERR_TYPES || status == HS_ERR_WEIGHTS;
    }
    if (status == HS_OK && plan->has_types &&
        (plan->points.type == NULL || plan->asking->type == NULL)) {
        status = HS_ERR_TYPES;
    }
    return status == HS_OK ? plan_groups(search->has_queries, plan) : status;
}

static void
close_plan(hs_tally_plan *plan)
{
    hs_edges_free(plan->account, &plan->edges);
    hs_marked_free(plan->account, &plan->points);
    hs_marked_free(plan->account, &plan->queries);
    hs_free(plan->account, plan->group);
}

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
write_result(const hs_tally_plan *plan, hs_tally *tallies, int n, bool is_symmetric,
             const hs_histogram *histogram)
{
    const int64_t n_types = plan->n_types;
    int64_t       n_pairs = 0;
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

/* Each thread counts by itself; then the counts are added up. */
static hs_status
count_pairs(hs_search *search, const hs_tally_plan *plan, const hs_histogram *histogram,
            int64_t *n_pairs, hs_failure *failure)
{
    const int         n = hs_team_size(search->call->team);
    const int32_t     capacity = hs_walker_capacity(search);
    hs_account       *account = &search->call->account;
    hs_tally         *tallies = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(hs_tally));
    hs_status         status = tallies != NULL ? HS_OK : HS_ERR_MEMORY;
    int               opened = 0;
    const hs_visitors visitors = {.use = HS_BLOCK_LISTS_SQUARES,
                                  .visit = hs_tally_hits,
                                  .contexts = tallies,
                                  .context_size = sizeof *tallies};
    while (status == HS_OK && opened < n) {
        status = hs_tally_init(plan, capacity, hs_block_most_hits(capacity), &tallies[opened]);
        opened += status == HS_OK;
    }
    if (status == HS_OK) {
        status = hs_parallel_visit(search, &visitors, NULL, failure);
    }
    if (status == HS_OK) {
        *n_pairs = write_result(plan, tallies, n, !search->has_queries, histogram);
    }
    for (int w = 0; w < opened; w++) {
        hs_tally_free(&tallies[w]);
    }
    hs_free(account, tallies);
    return status;
}

/* The search up to the largest edge. */
static hs_options
options_of(const hs_histogram *histogram, const hs_options *options)
{
    hs_options counting = hs_options_of_count(options);
    counting.cutoff = histogram->edges[histogram->n_edges - 1];
    counting.inclusive = histogram->last_inclusive;
    counting.precision = HS_EXACT;
    return counting;
}

/* A hs_use_fn. */
static hs_status
fill_histogram(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    const hs_histogram *histogram = context;
    hs_tally_plan       plan = {.account = NULL};
    hs_status           status = open_plan(search, histogram, &plan, failure);
    if (status == HS_OK) {
        status = count_pairs(search, &plan, histogram, n_pairs, failure);
    }
    close_plan(&plan);
    return status;
}

static hs_status
find_histogram(const hs_among *among, const hs_options *options, const hs_histogram *histogram,
               hs_failure *failure)
{
    const hs_status status = options != NULL ? check_histogram(histogram, failure)
                                             : HS_ERR_ARGUMENT;
    if (status != HS_OK) {
        hs_clear_counters(options);
        return status;
    }
    hs_histogram     filled = *histogram;
    const hs_options counting = options_of(histogram, options);
    hs_request       request = hs_request_among(among, HS_HALF_OR_QUERIES, &counting);
    request.sets.is_plain = true;
    request.sets.keeps_none = true;
    request.sets.least_cutoff = smallest_edge(histogram);
    return hs_request_use(&request, fill_histogram, &filled, failure);
}

/* Enters the floating-point environment itself, because edges are compared before the
 * search does. */
hs_status
hs_pairs_histogram(const hs_among *among, const hs_options *options, const hs_histogram *histogram,
                   hs_failure *failure)
{
    hs_failure ignored;
    failure = failure != NULL ? failure : &ignored;
    *failure = HS_NO_FAILURE;
    const hs_fpenv  saved = hs_fpenv_enter();
    const hs_status status = find_histogram(among, options, histogram, failure);
    hs_fpenv_leave(saved);
    return status;
}
