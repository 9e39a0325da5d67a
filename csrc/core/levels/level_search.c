/* SPDX-License-Identifier: BSD-3-Clause */
/* level_search.c: opens the search of two slices, then gives its points the caller's numbers and
 * brings their radii into the order of the cells. */
#include "level_search.h"

#include "../search/search_open.h"

#include <string.h>

/* Scaled radii that are larger are beyond all distances: the scale goes by a cutoff that is no
 * larger than these. */
#define BEYOND_ALL 0x1p600

/* The radii of a set's points in the order of the cells, in one block, which is returned; NULL
 * where there are none, or when memory is short. */
static void *
arrange_radii(const hs_search *search, const hs_bins *bins, const double *radii, hs_radii *to)
{
    const bool    in_caller_unit = search->scene.extreme; /* as the metric's then */
    const int64_t size = sizeof(double) + sizeof(float);
    double       *exact = NULL;
    *to = (hs_radii){NULL, NULL};
    if (radii != NULL) {
        exact = hs_alloc(&search->call->account, HS_FOR_POINTS, bins->n + HS_PADDING, size);
    }
    if (exact == NULL) {
        return NULL;
    }
    float *near = (float *)(exact + bins->n + HS_PADDING);
    for (int64_t si = 0; si < bins->n; si++) {
        const double radius = radii[bins->order[si]];
        const double scaled = hs_smaller(hs_scale_apply(search->scene.scale, radius), BEYOND_ALL);
        exact[si] = in_caller_unit ? radius : scaled;
        near[si] = (float)scaled;
    }
    memset(near + bins->n, 0, HS_PADDING * sizeof *near);
    *to = (hs_radii){exact, near};
    return exact;
}

static void
renumber(const int32_t *number, hs_bins *bins)
{
    for (int64_t si = 0; si < bins->n; si++) {
        bins->order[si] = number[bins->order[si]];
    }
}

/* Where the radii and numbers of a slice begin. */
static const double *
radii_of(const hs_level_set *set, hs_slice levels)
{
    return set->radii != NULL ? set->radii + set->first[levels.first] : NULL;
}

static const int32_t *
numbers_of(const hs_level_set *set, hs_slice levels)
{
    return set->number + set->first[levels.first];
}

static hs_status
set_limits(const hs_levels *levels, const hs_level_step *step, double bound, hs_level_search *open)
{
    hs_search          *search = &open->search;
    const hs_scene     *scene = &search->scene;
    const hs_level_set *asking = hs_levels_asking(levels);
    const double       *of_points =
        levels->rule != HS_RULE_GATHER ? radii_of(&levels->points, step->points) : NULL;
    const double *of_asking = levels->rule != HS_RULE_SCATTER ? radii_of(asking, step->asking)
                                                              : NULL;
    const double  near_bound = hs_scale_apply(scene->scale, bound);
    open->limits = (hs_limits){.rule = levels->rule,
                               .bound = scene->extreme ? bound : near_bound,
                               .near_bound = (float)near_bound};
    open->of_points = arrange_radii(search, &search->bins, of_points, &open->limits.of_points);
    open->limits.of_asking = open->limits.of_points;
    if (search->has_queries) {
        open->of_asking =
            arrange_radii(search, &search->query_bins, of_asking, &open->limits.of_asking);
    }
    const bool lacks = (of_points != NULL && open->of_points == NULL) ||
                       (search->has_queries && of_asking != NULL && open->of_asking == NULL);
    return lacks ? HS_ERR_MEMORY : HS_OK;
}

/* Fractions done are those of all asking points of all steps, as far as these are equal. */
static void
set_progress(const hs_levels *levels, const hs_level_plan *plan, int64_t step, hs_search *search)
{
    const int64_t n = hs_search_asking(search)->n;
    (void)levels;
    search->first_point = step * n;
    search->n_in_all = plan->n * n;
}

static void
name_row(const hs_levels *levels, const hs_level_step *step, hs_failure *failure)
{
    const hs_level_set *set = &levels->points;
    hs_slice            slice = step->points;
    if (failure->row < 0) {
        return;
    }
    if (failure->in_queries) {
        set = hs_levels_asking(levels);
        slice = step->asking;
        failure->in_queries = levels->has_queries;
    }
    failure->row = numbers_of(set, slice)[failure->row];
}

hs_status
hs_level_open(const hs_levels *levels, const hs_level_plan *plan, int64_t number, const hs_box *box,
              bool keeps_none, hs_call *call, hs_level_search *open, hs_failure *failure)
{
    const hs_level_step *step = &plan->steps[number];
    const hs_level_set  *asking = hs_levels_asking(levels);
    const hs_points      points = hs_level_points(&levels->points, step->points);
    const hs_points      queries = hs_level_points(asking, step->asking);
    hs_search           *search = &open->search;
    const hs_sets        sets = {.points = &points,
                                 .queries = step->is_own ? NULL : &queries,
                                 .is_full = !step->is_own,
                                 .keeps_none = keeps_none,
                                 .least_cutoff = step->least};
    open->of_asking = open->of_points = NULL;
    call->options.cutoff = step->cutoff;
    hs_search_begin(call, search);
    search->limits = step->has_limits ? &open->limits : NULL;
    hs_status status = hs_search_build(&sets, box, search, failure);
    if (status != HS_OK) {
        name_row(levels, step, failure);
    }
    if (status == HS_OK && step->has_limits) {
        status = set_limits(levels, step, plan->bound, open);
    }
    if (status != HS_OK) {
        hs_level_close(open);
        return status;
    }
    search->is_half = plan->is_half;
    renumber(numbers_of(&levels->points, step->points), &search->bins);
    if (search->has_queries) {
        renumber(numbers_of(asking, step->asking), &search->query_bins);
    }
    set_progress(levels, plan, number, search);
    return HS_OK;
}

void
hs_level_close(hs_level_search *open)
{
    hs_account *account = &open->search.call->account;
    hs_free(account, open->of_asking);
    hs_free(account, open->of_points);
    open->of_asking = open->of_points = NULL;
    hs_search_close(&open->search);
}
