/* SPDX-License-Identifier: BSD-3-Clause */
/* plan.c: what a search of a scene would do, read off the same structures that would do it. */
#include "../halfshell.h"

#include "estimate.h"
#include "fpenv.h"
#include "poll.h"
#include "search.h"

#include <math.h>

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
                      .stencil_rows = search->stencil.n_rows,
                      .expected_pairs = grid->expected_pairs,
                      .threads = hs_team_size(search->team),
                      .kernel = search->kernel->name};
    for (int k = 0; k < scene->ndim; k++) {
        plan->shape[k] = grid->shape[k];
        plan->cell_size[k] = grid->cell_size[k] * unscale;
        plan->reach[k] = grid->reach[k];
        plan->images[k] = scene->lattice.row_of_axis[k] >= 0
                              ? (grid->reach[k] + grid->shape[k] - 1) / grid->shape[k]
                              : 0;
    }
}

hs_status
hs_plan_make(const hs_points *points, const hs_box *box, const hs_options *options,
             hs_plan *plan, hs_failure *failure)
{
    hs_failure ignored;
    hs_search  search;
    failure = failure != NULL ? failure : &ignored;
    *failure = HS_NO_FAILURE;
    const hs_fpenv saved = hs_fpenv_enter();
    const hs_sets  sets = {.points = points};
    hs_status      status = hs_search_open(&sets, box, options, &search, failure);
    if (status == HS_OK) {
        fill_plan(&search, plan);
        hs_search_close(&search);
    }
    if (status == HS_ERR_MEMORY) {
        hs_shortage_of_search(points, box, &search, failure);
    }
    hs_account_close(&search.account);
    hs_fpenv_leave(saved);
    return status;
}
