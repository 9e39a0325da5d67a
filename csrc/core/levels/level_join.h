/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * level_join.h: one search of all levels in place of several, where that is quicker. Searches of
 * a few levels each sort their points and walk over them again; one search tests more candidates,
 * each with a limit of its own. Points of few sizes, all of them common, are better searched at
 * once.
 */
#ifndef HS_LEVEL_JOIN_H
#define HS_LEVEL_JOIN_H

#include "level_plan.h"

/* As hs_level_plan_make, but of radii and supports it is a single step, if that is expected to cost
 * less and the caller has not chosen an algorithm. box: of the points, borrowed, or NULL. options:
 * to poll by. HS_ERR_INTERRUPTED too, without a plan. */
hs_status hs_level_plan_choose(hs_account *account, const hs_options *options,
                               const hs_levels *levels, const hs_box *box, double bound,
                               hs_algorithm algorithm, hs_level_plan *plan);

#ifdef HS_TESTING
/* Whether plans are replaced; off at first, so that few points have several searches. Returns what
 * it was before. */
bool hs_test_join_levels(bool on);
#endif

#endif
