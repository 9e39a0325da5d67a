/* SPDX-License-Identifier: BSD-3-Clause */
/* api_plan.c: what a search of a scene would do, read from the structures that would do it. */
#include "../../halfshell.h"

#include "by_reach.h"
#include "../search/estimate.h"

/* What was chosen. */
static hs_algorithm
algorithm_of(const hs_search *search)
{
    return search->is_sparse ? HS_HASH : search->grid.n_cells == 1 ? HS_ALL_PAIRS : HS_GRID;
}

static void
fill_plan(const hs_search *search, hs_plan *plan)
{
    const hs_scene *scene = &search->scene;
    const hs_grid  *grid = &search->grid;
    const double    unscale = hs_scale_apply(scene->unscale, 1.0);
    *plan = (hs_plan){.ndim = scene->ndim,
                      .n_periodic = scene->lattice.n_periodic,
                      .aligned = scene->lattice.aligned,
                      .reduced = scene->lattice.reduced,
                      .keeps_originals = search->bins.keeps_originals,
                      .algorithm = algorithm_of(search),
                      .all_pairs = grid->n_cells == 1,
                      .sparse = search->is_sparse,
                      .n_cells = grid->n_cells,
                      .stencil_rows = search->stencil.n_rows,
                      .threads = hs_team_size(search->call->team),
                      .kernel = search->call->kernel->name};
    for (int k = 0; k < scene->ndim; k++) {
        plan->shape[k] = grid->shape[k];
        plan->cell_size[k] = grid->cell_size[k] * unscale;
        plan->reach[k] = grid->reach[k];
        plan->images[k] = scene->lattice.row_of_axis[k] >= 0
                              ? (grid->reach[k] + grid->shape[k] - 1) / grid->shape[k]
                              : 0;
    }
}

/* A plan while searches are added to it. */
typedef struct planning {
    hs_plan     *plan;
    double       largest; /* reach of a search so far */
    hs_algorithm wanted;  /* by the caller */
} planning;

/* A hs_use_fn: adds a search to the plan, which is about the one with the largest reach. */
static hs_status
use_search(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    planning       *now = context;
    hs_plan        *plan = now->plan;
    const int64_t   n_before = plan->n_searches;
    const double    expected_before = plan->expected_pairs;
    double          expected;
    const hs_status status = hs_estimate_pairs(search, &expected);
    (void)n_pairs;
    (void)failure;
    if (n_before == 0 || search->call->options.cutoff > now->largest) {
        now->largest = search->call->options.cutoff;
        fill_plan(search, plan);
    }
    plan->n_searches = n_before + 1;
    plan->expected_pairs = expected_before + expected;
    if (now->wanted != HS_AUTO) {
        plan->algorithm = now->wanted;
    } else if (plan->n_searches > 1) {
        plan->algorithm = HS_HIERARCHY;
    }
    return status;
}

/* Where no two points can be a pair: what the cells would be for a cutoff of 0. */
static hs_status
plan_nothing(const hs_request *request, planning *now, hs_failure *failure)
{
    hs_options options = *request->options;
    hs_request without = *request;
    options.cutoff = 0.0;
    without.options = &options;
    without.reach = NULL;
    const hs_status status = hs_request_use(&without, use_search, now, failure);
    now->plan->n_searches = 0;
    now->plan->expected_pairs = 0.0;
    return status;
}

hs_status
hs_plan_make(const hs_among *among, const hs_options *options, hs_plan *plan, hs_failure *failure)
{
    const hs_request request = hs_request_among(among, HS_HALF_LIST, options);
    if (options == NULL || plan == NULL || request.selection != NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_plan   made = {.ndim = 0};
    planning  now = {.plan = &made, .wanted = options->algorithm};
    hs_status status = hs_by_reach_use(&request, use_search, &now, failure);
    if (status == HS_OK && made.n_searches == 0) {
        status = plan_nothing(&request, &now, failure);
    }
    *plan = status == HS_OK ? made : *plan;
    return status;
}
