/* SPDX-License-Identifier: BSD-3-Clause */
/* tally_plan.c: edges, types and weights in the order of the cells, before any thread counts. */
#include "tally.h"

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

hs_status
hs_tally_plan_open(hs_search *search, const hs_histogram *histogram, hs_tally_plan *plan,
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

void
hs_tally_plan_close(hs_tally_plan *plan)
{
    hs_edges_free(plan->account, &plan->edges);
    hs_marked_free(plan->account, &plan->points);
    hs_marked_free(plan->account, &plan->queries);
    hs_free(plan->account, plan->group);
}
