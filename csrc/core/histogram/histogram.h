/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_HISTOGRAM_HISTOGRAM_H
#define HS_HISTOGRAM_HISTOGRAM_H

#include "../search/search.h"

/*
 * histogram.h: pairs counted by distance: edges decided exactly, weights summed without rounding.
 */

/*
 * Counts the pairs of an open search, by all threads of its call, and adds their number to
 * *n_pairs. sets: what is known of the points. HS_ERR_MEMORY, HS_ERR_TYPES or HS_ERR_WEIGHTS, or
 * any status of a walk.
 */
hs_status hs_histogram_fill(hs_search *search, const hs_histogram *histogram, const hs_sets *sets,
                            int64_t *n_pairs, hs_failure *failure);

#endif
