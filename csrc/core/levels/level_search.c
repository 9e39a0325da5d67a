/* SPDX-License-Identifier: BSD-3-Clause */
/* level_search.c: opens the search of two slices, has its limits set, and gives its points the
 * caller's numbers. */
#include "level_search.h"

#include "../search/choice.h"
#include "../search/search_open.h"
#include "support_width.h"

static void
renumber(const int32_t *number, hs_bins *bins)
{
    for (int64_t si = 0; si < bins->n; si++) {
        bins->order[si] = number[bins->order[si]];
    }
}

/* Where the numbers of a slice begin. */
static const int32_t *
numbers_of(const hs_level_set *set, hs_slice levels)
{
    return set->number + set->first[levels.first];
}

/* Fractions done are those of all asking points of all steps, as far as these are equal. */
static void
set_progress(const hs_level_plan *plan, int64_t step, hs_search *search)
{
    const int64_t n = hs_search_asking(search)->n;
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

/* Asking points that meet all points of a step sooner than these are sorted into cells. */
#ifdef HS_TESTING
#define FEW_ASKING 4 /* so that small scenes have both */
#else
#define FEW_ASKING 32
#endif

/* What a step is searched by: without cells for few asking points, where the caller leaves that
 * open. */
static hs_algorithm
algorithm_of(const hs_level_plan *plan, const hs_level_step *step, int64_t n_asking)
{
    const bool is_open = plan->algorithm == HS_AUTO || plan->algorithm == HS_HIERARCHY;
    return is_open && !step->is_own && n_asking <= FEW_ASKING ? HS_ALL_PAIRS : plan->algorithm;
}

hs_status
hs_level_open(const hs_levels *levels, const hs_level_plan *plan, int64_t number, const hs_box *box,
              bool keeps_none, hs_call *call, hs_level_search *open, hs_failure *failure)
{
    const hs_level_step  *step = &plan->steps[number];
    const hs_level_set   *asking = hs_levels_asking(levels);
    const hs_points       points = hs_level_points(&levels->points, step->points);
    const hs_points       queries = hs_level_points(asking, step->asking);
    hs_search            *search = &open->search;
    const hs_support_step of_supports = {levels, step, &call->options};
    const hs_narrowing    narrowing = {hs_support_step_width, &of_supports};
    const hs_sets         sets = {.points = &points,
                                  .queries = step->is_own ? NULL : &queries,
                                  .is_full = !step->is_own || !plan->is_half,
                                  .keeps_none = keeps_none,
                                  .least_cutoff = hs_choice_least_length(call->choice, step->least),
                                  .narrowing = levels->has_supports ? &narrowing : NULL};
    hs_level_limits_init(levels, step, &open->own);
    call->options.cutoff = step->cutoff;
    call->options.algorithm = algorithm_of(plan, step, queries.n);
    hs_search_begin(call, search);
    search->limits = step->has_limits ? &open->own.limits : NULL;
    hs_status status = hs_search_build(&sets, box, search, failure);
    if (status != HS_OK) {
        name_row(levels, step, failure);
    }
    if (status == HS_OK && step->has_limits && !levels->has_supports) {
        status = hs_level_limits_set(levels, step, plan->bound, search, &open->own);
    }
    if (status == HS_OK) {
        search->is_half = plan->is_half;
        renumber(numbers_of(&levels->points, step->points), &search->bins);
    }
    if (status == HS_OK && search->has_queries) {
        renumber(numbers_of(asking, step->asking), &search->query_bins);
    }
    if (status == HS_OK && levels->has_supports) {
        status = hs_level_limits_set(levels, step, plan->bound, search, &open->own);
    }
    if (status != HS_OK) {
        hs_level_close(open);
        return status;
    }
    set_progress(plan, number, search);
    return HS_OK;
}

void
hs_level_close(hs_level_search *open)
{
    hs_level_limits_free(&open->search.call->account, &open->own);
    hs_search_close(&open->search);
}
