/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest.c: the public search for the k nearest points: scene and trees, then near_search.h. */
#include "fpenv.h"
#include "near_search.h"
#include "pairs.h"
#include "poll.h"

#include <math.h>

/* Points of a leaf. Measured: from 8 to 12 the time changes by some 5 %. */
#define LEAF_POINTS 8

/* Which cutoff lets the scene keep every digit: one that leaves ordinary numbers as they are; the
 * box's own size, or the largest distance, where these are too small for that. */
static double
scene_cutoff(const hs_box *box, double limit)
{
    double largest = 0.0, short_row = INFINITY;
    for (int l = 0; box != NULL && l < box->ndim; l++) {
        for (int k = 0; box->periodic[l] && k < box->ndim; k++) {
            largest = hs_larger(fabs(box->rows[l][k]), largest);
        }
        short_row = box->periodic[l] ? hs_smaller(largest, short_row) : short_row;
        largest = 0.0;
    }
    return limit > 0.0 && limit < 0x1p-800 ? limit : short_row < 0x1p-500 ? 0.0 : 1.0;
}

/* Trees of both sets. */
static hs_status
build_trees(hs_near *near, hs_scene *asking, int32_t leaf_points)
{
    hs_search  *search = near->search;
    hs_account *account = &search->account;
    hs_status   status = hs_tree_build(account, search->team, &search->options, &search->scene,
                                       leaf_points, &search->bins, &near->tree);
    near->asking = &near->tree;
    if (status == HS_OK && asking != NULL) {
        search->has_queries = true;
        near->asking = &near->asking_tree;
        status = hs_tree_build(account, search->team, &search->options, asking, LEAF_POINTS,
                               &search->query_bins, &near->asking_tree);
    }
    return status;
}

/* Scene, trees, and what decides. `limit`: the largest distance. */
static hs_status
prepare(hs_near *near, const hs_sets *sets, const hs_box *box, double limit, hs_failure *failure)
{
    hs_search *search = near->search;
    hs_scene   queries, *asking = sets->queries != NULL ? &queries : NULL;
    hs_options options = search->options;
    options.cutoff = scene_cutoff(box, limit);
    search->kernel = hs_kernel_select(options.kernel);
    if (search->kernel == NULL) {
        return HS_ERR_KERNEL;
    }
    const int64_t n_asking = asking != NULL ? sets->queries->n : sets->points->n;
    search->team = hs_team_create(hs_search_threads(sets->points->n + n_asking, &options));
    search->is_full = true;
    hs_status status = hs_scene_init_sets(&search->account, search->team, sets, box, &options,
                                          &search->scene, asking, failure);
    if (status != HS_OK) {
        return status;
    }
    const hs_scene  *scene = &search->scene;
    const hs_metric *metric = &scene->metric;
    near->limit = hs_scale_apply(scene->scale, limit);
    const double of_metric = scene->extreme ? limit : near->limit;
    hs_metric_init(&near->order, scene->ndim, metric->n_rows, metric->rows, 1.0, true);
    hs_metric_init(&near->within, scene->ndim, metric->n_rows, metric->rows,
                   of_metric < INFINITY ? of_metric : 1.0, true);
    hs_near_measure_drift(near);
    status = build_trees(near, asking, near->k < 4 * LEAF_POINTS ? LEAF_POINTS : 2 * LEAF_POINTS);
    if (status == HS_OK) {
        hs_near_measure_layer(near);
    }
    if (asking != NULL) {
        hs_scene_free(&search->account, asking);
    }
    return status;
}

/* Room for k entries for each point that asks. */
static hs_status
make_room(hs_near *near, int64_t n_asking, hs_failure *failure)
{
    const double n = (double)n_asking * (double)near->k;
    if (n < 0x1p62 && hs_output_reserve(near->rows, n_asking * near->k, 0.0) == HS_OK) {
        near->rows->n_pairs = n_asking * near->k;
        return HS_OK;
    }
    failure->expected_pairs = n;
    failure->expected_bytes = n * (double)hs_output_bytes_per_pair(near->rows);
    failure->limit_bytes = near->search->account.limit;
    return HS_ERR_MEMORY;
}

static hs_status
find_nearest(hs_near *near, const hs_sets *sets, const hs_box *box, hs_failure *failure)
{
    hs_search    *search = near->search;
    hs_account   *account = &search->account;
    const int64_t n_asking = sets->queries != NULL ? sets->queries->n : sets->points->n;
    const double  limit = search->options.cutoff;
    hs_status     status = HS_OK;
    if (!(limit >= 0.0)) {
        failure->value = limit;
        return HS_ERR_CUTOFF;
    }
    status = make_room(near, n_asking, failure);
    if (status == HS_OK) {
        status = prepare(near, sets, box, limit, failure);
    }
    if (status == HS_OK) {
        status = hs_near_search(near, failure);
    }
    hs_tree_free(account, &near->tree);
    hs_tree_free(account, &near->asking_tree);
    hs_search_report(search, near->rows->n_pairs);
    hs_search_close(search);
    return status;
}

hs_status
hs_nearest_find(const hs_points *points, const hs_points *queries, const hs_box *box, int64_t k,
                const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    const hs_sets sets = {
        .points = points, .queries = queries, .is_full = true, .is_plain = true, .is_wide = true};
    hs_failure    ignored;
    *result = NULL;
    failure = failure != NULL ? failure : &ignored;
    *failure = HS_NO_FAILURE;
    hs_pairs *rows = hs_pairs_new();
    if (rows == NULL) {
        return HS_ERR_MEMORY;
    }
    HS_ASSERT(k >= 1);
    const hs_fpenv saved = hs_fpenv_enter();
    hs_options     of_rows = *options;
    of_rows.sorted = false;
    of_rows.precision = HS_EXACT;
    of_rows.want &= HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT;
    hs_search_begin(&of_rows, &rows->search);
    hs_output_init(&rows->search.account, points->ndim, of_rows.want, options->index_bytes,
                   &rows->output);
    hs_near near = {.search = &rows->search,
                    .k = k,
                    .of_spot = k < INT32_MAX - 1 ? (int32_t)k + 1 : INT32_MAX,
                    .omits_self = queries == NULL,
                    .rows = &rows->output};
    const hs_status status = find_nearest(&near, &sets, box, failure);
    hs_fpenv_leave(saved);
    if (status != HS_OK) {
        hs_pairs_free(rows);
        return status;
    }
    *result = rows;
    return HS_OK;
}
