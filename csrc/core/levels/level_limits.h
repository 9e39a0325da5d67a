/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * level_limits.h: the lengths that the pairs of one step are compared with: by radii, by the types
 * of both points, or by supports, in the order of the cells of an open search.
 */
#ifndef HS_LEVEL_LIMITS_H
#define HS_LEVEL_LIMITS_H

#include "../search/limits.h"
#include "../search/supports.h"

#include "level_plan.h"

/* It must not move: the search has a pointer to its limits. */
typedef struct hs_level_limits {
    hs_limits   limits;
    hs_supports supports;              /* those of limits, if it has any */
    void       *of_asking, *of_points; /* owned: the radii of limits, the types, or the supports */
    void       *table;                 /* owned: that of limits */
} hs_level_limits;

/* What an open search needs to know beforehand; the rest is set once it has cells. */
HS_ALWAYS_INLINE void
hs_level_limits_init(const hs_levels *levels, const hs_level_step *step, hs_level_limits *own)
{
    own->of_asking = own->of_points = own->table = NULL;
    own->limits.table.n_types = step->by_table ? levels->n : 0;
    own->limits.supports = levels->has_supports ? &own->supports : NULL;
}

/*
 * For the cells of this search. With radii and types, the points are numbered by their places in
 * the slices of the step; with supports, as the caller numbers them. HS_ERR_MEMORY, or
 * HS_ERR_INTERRUPTED where the poll says so; in any case to be freed.
 */
hs_status hs_level_limits_set(const hs_levels *levels, const hs_level_step *step, double bound,
                              hs_search *search, hs_level_limits *own);

/* Harmless twice. */
void hs_level_limits_free(hs_account *account, hs_level_limits *own);

#endif
