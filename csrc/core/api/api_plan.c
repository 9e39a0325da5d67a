/* SPDX-License-Identifier: BSD-3-Clause */
/* api_plan.c: what a search of a scene would do, read from the structures that would do it. */
#include "../../halfshell.h"

#include "request.h"

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
                      .all_pairs = grid->n_cells == 1,
                      .sparse = search->is_sparse,
                      .stencil_rows = search->stencil.n_rows,
                      .expected_pairs = grid->expected_pairs,
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

/* A hs_use_fn. */
static hs_status
use_search(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    (void)n_pairs;
    (void)failure;
    fill_plan(search, context);
    return HS_OK;
}

hs_status
hs_plan_make(const hs_among *among, const hs_options *options, hs_plan *plan, hs_failure *failure)
{
    const hs_request request = hs_request_among(among, HS_HALF_LIST, options);
    if (options == NULL || plan == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    return hs_request_use(&request, use_search, plan, failure);
}
