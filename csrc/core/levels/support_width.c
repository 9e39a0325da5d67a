/* SPDX-License-Identifier: BSD-3-Clause */
/* support_width.c: the largest width of all points, which a few tell where they are round or turned
 * in all ways. */
#include "support_width.h"

#include <math.h>

#include "../base/rule.h"
#include "../exact/support_along.h"

/* Of the points of some levels, which have supports. Ends where it is enough. */
static hs_status
width_of(const hs_support_step *of, const hs_level_set *set, hs_slice levels, const double *normal,
         double enough, double *width)
{
    const int     size_at = hs_support_entries(set->ndim);
    const int64_t first = set->first[levels.first], end = set->first[levels.end];
    *width = 0.0;
    for (int64_t at = first; at < end && *width < enough; at++) {
        const double *numbers = hs_support_set_at(&set->supports, set->ndim, set->number[at]);
        const double  own = hs_support_width(set->ndim, numbers, numbers[size_at],
                                             of->levels->extent, set->radii[at], normal);
        *width = hs_larger(*width, own);
        if ((at + 1 - first) % HS_POLL_SUPPORTS == 0 && hs_poll(of->options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

hs_status
hs_support_step_width(const void *context, const double *normal, double enough, double *width)
{
    const hs_support_step *of = context;
    const hs_level_step   *step = of->step;
    const hs_level_set    *set = hs_levels_asking(of->levels);
    const hs_rule          rule = of->levels->rule;
    hs_status              status = HS_OK;
    double                 asking = 0.0, points = 0.0;
    if (hs_rule_needs_asking(rule)) {
        status = width_of(of, set, step->asking, normal, enough, &asking);
    }
    if (status == HS_OK && hs_rule_needs_other(rule) &&
        !(rule == HS_RULE_MAX && asking >= enough)) {
        status = width_of(of, &of->levels->points, step->points, normal, enough, &points);
    }
    *width = rule == HS_RULE_MIN ? hs_smaller(asking, points) : hs_larger(asking, points);
    return status;
}
