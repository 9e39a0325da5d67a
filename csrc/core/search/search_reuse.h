/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * search_reuse.h: another search among points that are in cells already. Cells, points and their
 * scale are those of the first search; cutoff, reach, stencil and queries are its own; account and
 * threads are those of its call.
 */
#ifndef HS_SEARCH_REUSE_H
#define HS_SEARCH_REUSE_H

#include "search.h"

/*
 * A search among the points of another one, which was made to be kept, stays as it is and must
 * outlive this one. The queries of the sets ask, or the points. HS_UNSERVED when it cannot serve
 * them: the cutoff is larger than its own, or its bounds do not hold for the queries. Else any
 * status of hs_search_open.
 */
hs_status hs_search_reuse(const hs_sets *sets, hs_call *call, hs_search *search,
                          hs_failure *failure);

#endif
