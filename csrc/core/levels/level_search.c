/* SPDX-License-Identifier: BSD-3-Clause */
/* level_search.c: opens the search of two slices, then gives its points the caller's numbers and
 * brings their radii into the order of the cells. */
#include "level_search.h"

#include "../base/rule.h"
#include "../search/choice.h"
#include "../search/search_open.h"
#include "support_width.h"

#include <string.h>

/* Scaled radii that are larger are beyond all distances: the scale goes by a cutoff that is no
 * larger than these. */
#define BEYOND_ALL 0x1p600

/* The radii of a set's points in the order of the cells, in one block, which is returned; NULL
 * where there are none, or when memory is short. */
static void *
arrange_radii(const hs_search *search, const hs_bins *bins, const double *radii, hs_radii *to)
{
    const double  factor = search->limits->factor;
    const bool    in_caller_unit = search->scene.extreme; /* as the metric's then */
    const int64_t size = sizeof(double) + sizeof(float);
    double       *exact = NULL;
    *to = (hs_radii){.exact = NULL};
    if (radii != NULL) {
        exact = hs_alloc(&search->call->account, HS_FOR_POINTS, bins->n + HS_PADDING, size);
    }
    if (exact == NULL) {
        return NULL;
    }
    float *near = (float *)(exact + bins->n + HS_PADDING), most = 0.0f;
    for (int64_t si = 0; si < bins->n; si++) {
        const double radius = radii[bins->order[si]];
        const double scaled = hs_smaller(hs_scale_apply(search->scene.scale, radius), BEYOND_ALL);
        exact[si] = in_caller_unit ? radius : scaled;
        near[si] = (float)hs_smaller(factor * scaled, BEYOND_ALL);
        most = near[si] > most ? near[si] : most;
    }
    memset(near + bins->n, 0, HS_PADDING * sizeof *near);
    *to = (hs_radii){exact, near, most};
    return exact;
}

/* The types of a set's points, which are their levels, in the order of the cells; NULL when memory
 * is short. */
static int32_t *
arrange_types(hs_account *account, const hs_bins *bins, const hs_level_set *set, int32_t n_levels)
{
    int32_t *to = hs_alloc(account, HS_FOR_POINTS, bins->n, sizeof *to);
    for (int64_t si = 0; to != NULL && si < bins->n; si++) {
        int32_t level = 0;
        while (level < n_levels - 1 && set->first[level + 1] <= bins->order[si]) {
            level++;
        }
        to[si] = level;
    }
    return to;
}

/* The cutoffs of all types, exactly and as they are scanned with. */
static void
scale_table(const hs_levels *levels, const hs_scene *scene, double *exact, float *near)
{
    for (int32_t e = 0; e < levels->n * levels->n; e++) {
        const double cutoff = levels->cutoffs[e];
        const double scaled = hs_smaller(hs_scale_apply(scene->scale, cutoff), BEYOND_ALL);
        exact[e] = cutoff < 0.0 ? -1.0 : scene->extreme ? cutoff : scaled;
        near[e] = cutoff < 0.0 ? -1.0f : (float)scaled;
    }
}

/* Limits by the types of both points, for a search of all of them. */
static hs_status
set_table(const hs_levels *levels, hs_level_search *open)
{
    hs_search    *search = &open->search;
    hs_account   *account = &search->call->account;
    const int32_t n = levels->n, size = n * n;
    double       *exact = hs_alloc(account, HS_FOR_CELLS, size, sizeof(double) + sizeof(float));
    open->table = exact;
    open->of_points = arrange_types(account, &search->bins, &levels->points, n);
    if (search->has_queries) {
        open->of_asking = arrange_types(account, &search->query_bins, &levels->queries, n);
    }
    if (exact == NULL || open->of_points == NULL ||
        (search->has_queries && open->of_asking == NULL)) {
        return HS_ERR_MEMORY;
    }
    float *near = (float *)(exact + size);
    scale_table(levels, &search->scene, exact, near);
    open->limits.rule = HS_RULE_SCATTER;
    open->limits.table = (hs_limit_table){
        .n_types = n,
        .of_points = open->of_points,
        .of_asking = search->has_queries ? open->of_asking : open->of_points,
        .exact = exact,
        .near = near,
    };
    return HS_OK;
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

/* As kernels read them, once the points have the caller's numbers; set: NULL where the rule needs
 * none. *owned: what is to be freed, or NULL. */
static hs_status
arrange_supports(const hs_level_search *open, const hs_bins *bins, const hs_support_set *set,
                 hs_support_side *to, void **owned)
{
    const hs_search *search = &open->search;
    const int        ndim = search->scene.ndim;
    const double     unscale = hs_scale_apply(search->scene.unscale, 1.0);
    hs_status        status = HS_OK;
    *to = (hs_support_side){.numbers = NULL};
    if (set == NULL) {
        return HS_OK;
    }
    float *near = hs_alloc(&search->call->account, HS_FOR_SUPPORTS,
                           bins->n * hs_support_numbers(ndim), sizeof *near);
    *owned = near;
    *to = (hs_support_side){
        .numbers = set->numbers, .first = set->first, .order = bins->order, .near = near};
    if (near == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t first = 0; status == HS_OK && first < bins->n; first += HS_POLL_SUPPORTS) {
        const int64_t end = first + HS_POLL_SUPPORTS < bins->n ? first + HS_POLL_SUPPORTS : bins->n;
        hs_supports_lay_out(to, first, end, ndim, open->supports.metric.limit.cutoff, unscale,
                            near);
        status = end < bins->n ? hs_poll(&search->call->options, 0.0) : HS_OK;
    }
    return status;
}

static hs_status
set_supports(const hs_levels *levels, const hs_level_step *step, double bound,
             hs_level_search *open)
{
    const hs_search      *search = &open->search;
    const hs_scene       *scene = &search->scene;
    hs_supports          *supports = &open->supports;
    const hs_support_set *of_points = hs_rule_needs_other(levels->rule) ? &levels->points.supports
                                                                        : NULL;
    const hs_support_set *of_asking =
        hs_rule_needs_asking(levels->rule) ? &hs_levels_asking(levels)->supports : NULL;
    const int exponent = scene->extreme ? 0 : -scene->scale.exponent;
    *supports = (hs_supports){.rule = levels->rule, .is_bounded = bound <= step->cutoff};
    hs_support_metric_init(scene->ndim, levels->extent, scene->metric.inclusive, exponent,
                           &supports->metric);
    open->limits = (hs_limits){.rule = levels->rule, .supports = supports};
    if (!search->has_queries) {
        HS_ASSERT(of_points != NULL); /* rules with a direction ask as queries do */
        const hs_status status = arrange_supports(open, &search->bins, of_points,
                                                  &supports->of_points, &open->of_points);
        supports->of_asking = supports->of_points;
        return status;
    }
    const hs_status status =
        arrange_supports(open, &search->bins, of_points, &supports->of_points, &open->of_points);
    return status != HS_OK ? status
                           : arrange_supports(open, &search->query_bins, of_asking,
                                              &supports->of_asking, &open->of_asking);
}

static hs_status
set_limits(const hs_levels *levels, const hs_level_step *step, double bound, hs_level_search *open)
{
    hs_search          *search = &open->search;
    const hs_scene     *scene = &search->scene;
    const hs_level_set *asking = hs_levels_asking(levels);
    const double       *of_points =
        hs_rule_needs_other(levels->rule) ? radii_of(&levels->points, step->points) : NULL;
    const double *of_asking = hs_rule_needs_asking(levels->rule) ? radii_of(asking, step->asking)
                                                                 : NULL;
    const double  near_bound = hs_scale_apply(scene->scale, bound);
    open->limits = (hs_limits){.rule = levels->rule,
                               .factor = levels->factor,
                               .bound = scene->extreme ? bound : near_bound,
                               .near_bound = (float)near_bound};
    if (step->by_table) {
        return set_table(levels, open);
    }
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
    open->of_asking = open->of_points = open->table = NULL;
    open->limits.table.n_types = step->by_table ? levels->n : 0;
    open->limits.supports = levels->has_supports ? &open->supports : NULL;
    call->options.cutoff = step->cutoff;
    call->options.algorithm = algorithm_of(plan, step, queries.n);
    hs_search_begin(call, search);
    search->limits = step->has_limits ? &open->limits : NULL;
    hs_status status = hs_search_build(&sets, box, search, failure);
    if (status != HS_OK) {
        name_row(levels, step, failure);
    }
    if (status == HS_OK && step->has_limits && !levels->has_supports) {
        status = set_limits(levels, step, plan->bound, open);
    }
    if (status == HS_OK) {
        search->is_half = plan->is_half;
        renumber(numbers_of(&levels->points, step->points), &search->bins);
    }
    if (status == HS_OK && search->has_queries) {
        renumber(numbers_of(asking, step->asking), &search->query_bins);
    }
    if (status == HS_OK && levels->has_supports) {
        status = set_supports(levels, step, plan->bound, open);
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
    hs_account *account = &open->search.call->account;
    hs_free(account, open->of_asking);
    hs_free(account, open->of_points);
    hs_free(account, open->table);
    open->of_asking = open->of_points = open->table = NULL;
    hs_search_close(&open->search);
}
