/* SPDX-License-Identifier: BSD-3-Clause */
/* levels.c: a level as others see it: a set of points by itself. */
#include "levels.h"

static void
free_level_set(hs_account *account, hs_level_set *set)
{
    hs_free(account, set->rows);
    hs_free(account, set->number);
    hs_free(account, set->radii);
    hs_free(account, set->first);
    hs_support_set_free(account, &set->supports);
}

void
hs_levels_renumber(int32_t first, hs_levels *levels)
{
    for (int64_t at = 0; at < levels->points.n; at++) {
        levels->points.number[at] += first;
    }
    levels->points.supports.first += first;
}

void
hs_levels_free(hs_account *account, hs_levels *levels)
{
    free_level_set(account, &levels->points);
    free_level_set(account, &levels->queries);
    hs_free(account, levels->cutoffs);
    *levels = (hs_levels){.n = 0};
}

hs_points
hs_level_points(const hs_level_set *set, hs_slice levels)
{
    const int64_t first = set->first[levels.first];
    return (hs_points){.data = set->rows + first * set->ndim,
                       .n = set->first[levels.end] - first,
                       .ndim = set->ndim,
                       .real = HS_FLOAT64,
                       .row_stride = set->ndim * (ptrdiff_t)sizeof(double),
                       .column_stride = sizeof(double)};
}
