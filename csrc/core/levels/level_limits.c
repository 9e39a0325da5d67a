/* SPDX-License-Identifier: BSD-3-Clause */
/* level_limits.c: radii, types and supports come in the order of levels, and are laid out in the
 * order of the cells. */
#include "level_limits.h"

#include "../base/rule.h"

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
set_table(const hs_levels *levels, hs_search *search, hs_level_limits *own)
{
    hs_account   *account = &search->call->account;
    const int32_t n = levels->n, size = n * n;
    double       *exact = hs_alloc(account, HS_FOR_CELLS, size, sizeof(double) + sizeof(float));
    own->table = exact;
    own->of_points = arrange_types(account, &search->bins, &levels->points, n);
    if (search->has_queries) {
        own->of_asking = arrange_types(account, &search->query_bins, &levels->queries, n);
    }
    if (exact == NULL || own->of_points == NULL ||
        (search->has_queries && own->of_asking == NULL)) {
        return HS_ERR_MEMORY;
    }
    float *near = (float *)(exact + size);
    scale_table(levels, &search->scene, exact, near);
    own->limits.rule = HS_RULE_SCATTER;
    own->limits.table = (hs_limit_table){
        .n_types = n,
        .of_points = own->of_points,
        .of_asking = search->has_queries ? own->of_asking : own->of_points,
        .exact = exact,
        .near = near,
    };
    return HS_OK;
}

/* Where the radii of a slice begin. */
static const double *
radii_of(const hs_level_set *set, hs_slice levels)
{
    return set->radii != NULL ? set->radii + set->first[levels.first] : NULL;
}

/* As kernels read them, once the points have the caller's numbers; set: NULL where the rule needs
 * none. *owned: what is to be freed, or NULL. */
static hs_status
arrange_supports(const hs_search *search, const hs_bins *bins, const hs_support_set *set,
                 double cutoff, hs_support_side *to, void **owned)
{
    const int    ndim = search->scene.ndim;
    const double unscale = hs_scale_apply(search->scene.unscale, 1.0);
    hs_status    status = HS_OK;
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
        hs_supports_lay_out(to, first, end, ndim, cutoff, unscale, near);
        status = end < bins->n ? hs_poll(&search->call->options, 0.0) : HS_OK;
    }
    return status;
}

static hs_status
set_supports(const hs_levels *levels, const hs_level_step *step, double bound, hs_search *search,
             hs_level_limits *own)
{
    const hs_scene       *scene = &search->scene;
    hs_supports          *supports = &own->supports;
    const double         *cutoff = &supports->metric.limit.cutoff;
    const hs_support_set *of_points = hs_rule_needs_other(levels->rule) ? &levels->points.supports
                                                                        : NULL;
    const hs_support_set *of_asking =
        hs_rule_needs_asking(levels->rule) ? &hs_levels_asking(levels)->supports : NULL;
    const int exponent = scene->extreme ? 0 : -scene->scale.exponent;
    *supports = (hs_supports){.rule = levels->rule, .is_bounded = bound <= step->cutoff};
    hs_support_metric_init(scene->ndim, levels->extent, scene->metric.inclusive, exponent,
                           &supports->metric);
    own->limits = (hs_limits){.rule = levels->rule, .supports = supports};
    HS_ASSERT(search->has_queries || of_points != NULL); /* directed rules ask as queries do */
    hs_status status = arrange_supports(search, &search->bins, of_points, *cutoff,
                                        &supports->of_points, &own->of_points);
    supports->of_asking = supports->of_points;
    if (status == HS_OK && search->has_queries) {
        status = arrange_supports(search, &search->query_bins, of_asking, *cutoff,
                                  &supports->of_asking, &own->of_asking);
    }
    return status;
}

hs_status
hs_level_limits_set(const hs_levels *levels, const hs_level_step *step, double bound,
                    hs_search *search, hs_level_limits *own)
{
    const hs_scene     *scene = &search->scene;
    const hs_level_set *asking = hs_levels_asking(levels);
    const double       *of_points =
        hs_rule_needs_other(levels->rule) ? radii_of(&levels->points, step->points) : NULL;
    const double *of_asking = hs_rule_needs_asking(levels->rule) ? radii_of(asking, step->asking)
                                                                 : NULL;
    const double  near_bound = hs_scale_apply(scene->scale, bound);
    if (levels->has_supports) {
        return set_supports(levels, step, bound, search, own);
    }
    own->limits = (hs_limits){.rule = levels->rule,
                              .factor = levels->factor,
                              .bound = scene->extreme ? bound : near_bound,
                              .near_bound = (float)near_bound};
    if (step->by_table) {
        return set_table(levels, search, own);
    }
    own->of_points = arrange_radii(search, &search->bins, of_points, &own->limits.of_points);
    own->limits.of_asking = own->limits.of_points;
    if (search->has_queries) {
        own->of_asking =
            arrange_radii(search, &search->query_bins, of_asking, &own->limits.of_asking);
    }
    const bool lacks = (of_points != NULL && own->of_points == NULL) ||
                       (search->has_queries && of_asking != NULL && own->of_asking == NULL);
    return lacks ? HS_ERR_MEMORY : HS_OK;
}

void
hs_level_limits_free(hs_account *account, hs_level_limits *own)
{
    hs_free(account, own->of_asking);
    hs_free(account, own->of_points);
    hs_free(account, own->table);
    own->of_asking = own->of_points = own->table = NULL;
}
