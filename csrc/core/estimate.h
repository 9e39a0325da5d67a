/* SPDX-License-Identifier: BSD-3-Clause */
/* estimate.h: will the result fit? Asked before the search, answered from a sample of points. */
#ifndef HS_ESTIMATE_H
#define HS_ESTIMATE_H

#include "search.h"

/* Bytes that one pair of the result takes at the worst moment: the caller's arrays, and what the
 * search still holds beside them. 0 when nothing is wanted but the count. */
double hs_bytes_per_pair(const hs_options *options, int ndim);

/*
 * Before any work: a box has at least so many pairs as its density along the periodic axes says,
 * less what a cell's diameter and the extent along the open axes can hide. HS_ERR_MEMORY when even
 * these pass the limit, HS_ERR_TOO_MANY when int64 cannot count them.
 */
hs_status hs_estimate_by_density(hs_search *search, hs_failure *failure);

/*
 * After sorting into cells: HS_OK when a result is expected to fit the account's limit, and always
 * when a cheap bound shows it to be small. HS_ERR_MEMORY fills failure->expected_*. The margin is
 * on the side of searching: a result that turns out too large is refused when it is stored.
 */
hs_status hs_estimate_by_sample(hs_search *search, hs_failure *failure);

#endif
