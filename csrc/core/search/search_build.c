/* SPDX-License-Identifier: BSD-3-Clause */
/* search_build.c: the scene first, then the grid, its stencil, and the points sorted into its
 * cells. */
#include "search_open.h"

#include "../base/outcome.h"
#include "../cells/sparse_grid.h"

#include "choice.h"
#include "estimate.h"

/* Stores occupied cells only, in place of the grid that was chosen; nothing for a width of 0. */
static void
make_sparse(hs_search *search, double width)
{
    search->is_sparse = width > 0.0;
    if (search->is_sparse) {
        const hs_grid dense = search->grid;
        hs_sparse_grid(&search->scene, &dense, width, &search->grid);
    }
}

/* The grid of an algorithm of the caller's choice. */
static hs_status
choose_single_or_sparse(hs_search *search, bool is_sparse, hs_failure *failure)
{
    const hs_status status =
        hs_grid_init_kind(&search->scene, HS_GRID_SINGLE, &search->grid, failure);
    if (status == HS_OK && is_sparse) {
        make_sparse(search, hs_sparse_width(&search->scene, &search->grid));
    }
    return status;
}

/* Chooses the dense grid, with cells as wide as the caller wants them or as is quickest. Where
 * points crowd in few of its cells, one that stores occupied cells only, unless the dense one has
 * the caller's width, or the caller wants all cells. */
static hs_status
choose_grid(hs_search *search, hs_failure *failure)
{
    const hs_options  *options = &search->call->options;
    const hs_algorithm algorithm = options->algorithm;
    const bool         is_dense = algorithm == HS_GRID;
    hs_status          status = HS_TOO_MUCH;
    bool               may_be_sparse = true;
    search->is_sparse = false; /* another system may have been searched before */
    if (algorithm == HS_ALL_PAIRS || algorithm == HS_HASH) {
        return choose_single_or_sparse(search, algorithm == HS_HASH, failure);
    }
    if (options->cell_size > 0.0) {
        const double width = hs_scale_apply(search->scene.scale, options->cell_size);
        status = hs_grid_init_wide(&search->scene, width, &search->grid, &may_be_sparse, failure);
    }
    if (status == HS_TOO_MUCH) {
        status = hs_grid_init_kind(&search->scene, is_dense ? HS_GRID_CELLS : HS_GRID_ANY,
                                   &search->grid, failure);
    }
    if (status == HS_OK && may_be_sparse && !is_dense) {
        make_sparse(search, hs_sparse_choose(&search->scene, &search->grid));
    }
    return status;
}

/* Sorts the points into the cells of the grid. */
static hs_status
build_bins(hs_search *search, hs_scene *scene, hs_grid *grid, hs_sparse *sparse, hs_bins *bins)
{
    hs_account *account = &search->call->account;
    return search->is_sparse ? hs_sparse_build(account, search->call->team, &search->call->options,
                                               scene, grid, sparse, bins)
                             : hs_bins_build(account, search->call->team, &search->call->options,
                                             scene, grid, bins);
}

hs_status
hs_search_bin_queries(hs_search *search, hs_scene *asking)
{
    hs_grid grid = search->grid; /* of which occupied cells are counted anew */
    return build_bins(search, asking, &grid, &search->query_sparse, &search->query_bins);
}

/* Grid, stencil and bins. */
static hs_status
build_cells(hs_search *search, hs_scene *asking, hs_failure *failure)
{
    hs_scene *scene = &search->scene;
    hs_status status = choose_grid(search, failure);
    if (status == HS_OK) {
        status = hs_estimate_by_density(search, failure);
    }
    if (status == HS_OK) {
        status = hs_stencil_build(&search->call->account, &search->call->options, scene,
                                  &search->grid, search->is_full, &search->stencil);
        if (status == HS_ERR_MEMORY) {
            failure->search_bytes = hs_stencil_bytes(&search->grid, search->is_full);
        }
    }
    if (status == HS_OK) {
        status = build_bins(search, scene, &search->grid, &search->sparse, &search->bins);
    }
    if (status == HS_OK && asking != NULL) {
        status = hs_search_bin_queries(search, asking);
    }
    return status;
}

/* The call's options for its scene; `others`: room for some. Where images are compared, S is needed
 * of all pairs. */
static const hs_options *
options_of_scene(const hs_call *call, hs_options *others)
{
    if (call->choice == NULL || !hs_choice_compares(call->choice, call->options.cutoff)) {
        return &call->options;
    }
    *others = call->options;
    others->want |= HS_WANT_SHIFT;
    return others;
}

hs_status
hs_search_build(const hs_sets *sets, const hs_box *box, hs_search *search, hs_failure *failure)
{
    hs_options others;
    hs_scene   queries, *asking = sets->queries != NULL ? &queries : NULL;
    if (search->call->kernel == NULL) {
        return HS_ERR_KERNEL;
    }
    hs_search_set_asking(sets, search);
    hs_status status = hs_scene_init_sets(&search->call->account, search->call->team, sets, box,
                                          options_of_scene(search->call, &others), &search->scene,
                                          asking, failure);
    if (status == HS_OK) {
        status = hs_scene_narrow(&search->scene, sets->narrowing);
        status = status == HS_OK ? build_cells(search, asking, failure) : status;
        if (asking != NULL) {
            hs_scene_free(&search->call->account, asking);
        }
    }
    if (status == HS_OK) {
        hs_search_settle(search);
    }
    return status;
}
