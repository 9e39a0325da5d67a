/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * level_search.h: one step of a plan as a search like any other: of two sets of points, or of one,
 * with the caller's numbers, and with limits where pairs have lengths of their own.
 */
#ifndef HS_LEVEL_SEARCH_H
#define HS_LEVEL_SEARCH_H

#include "level_limits.h"

/* An open step; it must not move. */
typedef struct hs_level_search {
    hs_search       search;
    hs_level_limits own; /* where the step has any */
} hs_level_search;

/*
 * Opens step number `step`, for the options of the call but for the cutoff, which is set to that of
 * the step. keeps_none: pairs are not kept. On failure it is closed, and the failure names rows as
 * the caller does.
 */
hs_status hs_level_open(const hs_levels *levels, const hs_level_plan *plan, int64_t step,
                        const hs_box *box, bool keeps_none, hs_call *call, hs_level_search *open,
                        hs_failure *failure);

/* Harmless twice. */
void hs_level_close(hs_level_search *open);

#endif
