/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_prepare.c: chooses a cutoff that scales the scene without loss, then builds the trees or
 * borrows the kept one. */
#include "nearest.h"

#include "nearest_kept.h"
#include "tree_build.h"
#include "../base/outcome.h"
#include "../scene/unit.h"

#include <math.h>

/* Points of a leaf. Measured: from 8 to 12 the time changes by some 5 %. */
#define LEAF_POINTS 8
/* The nearest of a point take as long as so many pairs of a search with a cutoff, for which it is
 * known how many threads they are worth. */
#define PAIRS_PER_POINT 200.0
/* Largest distances below this scale the scene by themselves. */
#define SMALL_LIMIT 0x1p-800
/* Periods below this do. */
#define SMALL_BOX 0x1p-500

static bool
limit_is_small(double limit)
{
    return limit > 0.0 && limit < SMALL_LIMIT;
}

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
    return limit_is_small(limit) ? limit : short_row < SMALL_BOX ? 0.0 : 1.0;
}

/* Sets the largest distance, in the scene's unit and for the metric. */
static void
set_limit(hs_nearest *near, double limit)
{
    const hs_scene  *scene = &near->search->scene;
    const hs_metric *metric = &scene->metric;
    near->limit = hs_scale_apply(scene->scale, limit);
    const double of_metric = scene->extreme ? limit : near->limit;
    hs_metric_init(&near->within, scene->ndim, metric->n_rows, metric->rows,
                   of_metric < INFINITY ? of_metric : 1.0, true);
}

/* Builds the tree of the points and measures them: all that searches with other k and other queries
 * can share. */
static hs_status
build_tree(hs_nearest *near, int32_t leaf_points)
{
    hs_search       *search = near->search;
    hs_scene        *scene = &search->scene;
    const hs_metric *metric = &scene->metric;
    hs_metric_init(&near->order, scene->ndim, metric->n_rows, metric->rows, 1.0, true);
    hs_nearest_measure_drift(near);
    const hs_status status = hs_tree_build(&search->call->account, search->call->team,
                                           &search->call->options, scene, leaf_points,
                                           &search->bins, &near->tree);
    if (status == HS_OK) {
        hs_nearest_measure_layer(near);
    }
    return status;
}

/* Builds the tree of the queries, and frees their scene. */
static hs_status
build_asking_tree(hs_nearest *near, hs_scene *asking)
{
    hs_search *search = near->search;
    search->has_queries = true;
    near->asking = &near->asking_tree;
    const hs_status status = hs_tree_build(&search->call->account, search->call->team,
                                           &search->call->options, asking, LEAF_POINTS,
                                           &search->query_bins, &near->asking_tree);
    hs_scene_free(&search->call->account, asking);
    return status;
}

static hs_status
prepare_anew(hs_nearest *near, const hs_sets *sets, const hs_box *box, double limit,
             hs_failure *failure)
{
    hs_search    *search = near->search;
    hs_scene      queries, *asking = sets->queries != NULL ? &queries : NULL;
    hs_options    options = search->call->options;
    const int32_t leaf_points = near->k < 4 * LEAF_POINTS ? LEAF_POINTS : 2 * LEAF_POINTS;
    hs_sets       bounded = *sets;
    bounded.within = limit < INFINITY ? limit : 0.0;
    options.cutoff = scene_cutoff(box, limit);
    near->asking = &near->tree;
    hs_status status = hs_scene_init_sets(&search->call->account, search->call->team, &bounded, box,
                                          &options, &search->scene, asking, failure);
    if (status != HS_OK) {
        return status;
    }
    set_limit(near, limit);
    status = build_tree(near, leaf_points);
    if (asking != NULL && status == HS_OK) {
        status = build_asking_tree(near, asking);
    } else if (asking != NULL) {
        hs_scene_free(&search->call->account, asking);
    }
    return status;
}

/* Builds a tree that any later call can use: for any k, largest distance and quantities. */
static hs_status
build_kept(const hs_nearest *near, const hs_sets *sets, const hs_box *box, hs_nearest *room,
           hs_failure *failure)
{
    hs_search    *search = room->search;
    hs_options    options = near->search->call->options;
    const hs_sets kept = {.points = sets->points,
                          .is_kept = true,
                          .is_full = true,
                          .is_plain = sets->is_plain,
                          .is_wide = sets->is_wide};
    options.cutoff = scene_cutoff(box, INFINITY);
    options.want = HS_WANT_SHIFT;
    options.counters = NULL;
    hs_call *call = search->call;
    hs_call_begin(&options, call);
    call->account.is_kept = true;
    hs_search_begin(call, search);
    call->team = near->search->call->team;
    hs_status status = hs_scene_init_sets(&search->call->account, search->call->team, &kept, box,
                                          &options, &search->scene, NULL, failure);
    if (status == HS_OK) {
        status = build_tree(room, LEAF_POINTS);
    }
    call->team = NULL;
    hs_call_detach(call);
    if (status != HS_OK) {
        hs_tree_free(&search->call->account, &room->tree);
        hs_search_close(search);
        hs_account_close(&call->account);
    }
    return status;
}

/* Takes what is shared as the new search's own, and marks as borrowed what it must not free. */
static void
borrow(const hs_nearest *kept, hs_nearest *near)
{
    hs_search *search = near->search;
    search->scene = kept->search->scene;
    search->bins = kept->search->bins;
    search->is_borrowed = true;
    near->tree = kept->tree;
    near->asking = &near->tree;
    near->order = kept->order;
    memcpy(near->drift, kept->drift, sizeof near->drift);
    near->smallest_period = kept->smallest_period;
    near->has_layer = kept->has_layer;
    memcpy(near->layer_lower, kept->layer_lower, sizeof near->layer_lower);
    memcpy(near->layer_upper, kept->layer_upper, sizeof near->layer_upper);
}

/* HS_UNSERVED when what is kept does not serve: bounds that do not hold for the queries, a scale
 * that would lose digits of the largest distance; or another thread is building it. */
static hs_status
prepare_from_kept(hs_nearest *near, const hs_sets *sets, const hs_box *box, double limit,
                  hs_failure *failure)
{
    hs_search  *search = near->search;
    hs_nearest *room;
    hs_scene    asking;
    hs_status   status = HS_OK;
    if (limit_is_small(limit)) {
        return HS_UNSERVED;
    }
    const hs_nearest *kept = hs_nearest_kept_get(sets->trees, &room);
    if (room != NULL) {
        status = build_kept(near, sets, box, room, failure);
        hs_nearest_kept_end(sets->trees, status == HS_OK);
        kept = room;
    }
    if (kept == NULL || status != HS_OK) {
        return kept == NULL ? HS_UNSERVED : status;
    }
    const hs_scene *scene = &kept->search->scene;
    const int       unit = hs_exponent_of(hs_scale_apply(scene->scale, limit));
    /* Far points need closed gaps, which a tree that is kept does not have. */
    if (scene->in_one_cell || hs_is_far(scene->cloud.largest, unit, HS_FAR_BOUNDED_EXPONENT)) {
        return HS_UNSERVED;
    }
    if (sets->queries != NULL) {
        status = hs_scene_like(&search->call->account, search->call->team, &kept->search->scene,
                               sets->queries, &search->call->options, &asking, failure);
        if (status != HS_OK) {
            failure->in_queries = status != HS_UNSERVED;
            return status;
        }
    }
    borrow(kept, near);
    set_limit(near, limit);
    return sets->queries != NULL ? build_asking_tree(near, &asking) : HS_OK;
}

hs_status
hs_nearest_prepare(hs_nearest *near, const hs_sets *sets, const hs_box *box, double limit,
                   hs_failure *failure)
{
    hs_search    *search = near->search;
    const int64_t n_queries = sets->queries != NULL ? sets->queries->n : 0;
    const int64_t n_asking = sets->queries != NULL ? n_queries : sets->points->n;
    if (search->call->kernel == NULL) {
        return HS_ERR_KERNEL;
    }
    hs_call_gather(search->call, sets->points->n + n_queries);
    hs_call_gather_for(search->call, n_asking, PAIRS_PER_POINT * (double)n_asking);
    search->is_full = true;
    hs_status status = HS_UNSERVED;
    if (sets->trees != NULL) {
        status = prepare_from_kept(near, sets, box, limit, failure);
    }
    return status == HS_UNSERVED ? prepare_anew(near, sets, box, limit, failure) : status;
}

void
hs_nearest_release(hs_nearest *near)
{
    hs_account *account = &near->search->call->account;
    if (!near->search->is_borrowed) {
        hs_tree_free(account, &near->tree);
    }
    hs_tree_free(account, &near->asking_tree);
}
