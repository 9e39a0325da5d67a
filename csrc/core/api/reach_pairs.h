/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * reach_pairs.h: what hs_pairs_find, hs_neighbors_find and hs_neighbors_count do for a request that
 * has a reach. fill, count: what does it for one search, which is taken where there is but one.
 */
#ifndef HS_REACH_PAIRS_H
#define HS_REACH_PAIRS_H

#include "by_reach.h"

hs_status hs_by_reach_pairs(const hs_request *request, hs_pairs **result, hs_failure *failure);
hs_status hs_by_reach_rows(const hs_request *request, hs_fill_fn fill, hs_pairs **result,
                           hs_failure *failure);
hs_status hs_by_reach_count_rows(const hs_request *request, hs_use_fn count, int64_t *counts,
                                 hs_failure *failure);

#endif
