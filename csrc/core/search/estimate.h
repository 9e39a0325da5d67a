/* SPDX-License-Identifier: BSD-3-Clause */
/* estimate.h: will the result fit? Estimated before the search from a sample of points. */
#ifndef HS_ESTIMATE_H
#define HS_ESTIMATE_H

#include "search.h"

/* What a search that was refused memory would have taken. For HS_ERR_MEMORY only; changes nothing
 * where the failure says it already. */
typedef struct hs_shortage {
    double pairs; /* by the density of the points in the space that they occupy */
    double bytes; /* of the search itself */
} hs_shortage;

/* Adds one system, from the caller's numbers: nothing else need have been read yet. */
void hs_shortage_add(const hs_points *points, const hs_box *box, double cutoff,
                     hs_shortage *shortage);
void hs_shortage_tell(const hs_shortage *shortage, const hs_options *options, int ndim,
                      double limit, hs_failure *failure);

/* Pairs and bytes of one search. */
void hs_shortage_of_search(const hs_points *points, const hs_box *box, const hs_search *search,
                           hs_failure *failure);

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

/* How many pairs there are, about, from a larger sample: all of them for some hundred points. Where
 * they cannot be counted in some milliseconds, no less than the density of the points says. HS_OK
 * or HS_ERR_MEMORY. */
hs_status hs_estimate_pairs(hs_search *search, double *pairs);

#endif
