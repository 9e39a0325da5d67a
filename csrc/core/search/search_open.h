/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * search_open.h: from points, queries, box and options to a search that can be walked: with cells
 * of its own (search_build.c), or with those of another one (search_reuse.c).
 */
#ifndef HS_SEARCH_OPEN_H
#define HS_SEARCH_OPEN_H

#include "search.h"

/*
 * Everything up to the first group: threads and cells, or what can be reused of sets->built. On
 * failure the search is closed. The points are not needed any more.
 */
hs_status hs_search_open(const hs_sets *sets, const hs_box *box, hs_call *call, hs_search *search,
                         hs_failure *failure);

/* The scene of these points and its cells, in place of those that hs_search_close has freed;
 * options.cutoff may have changed. */
hs_status hs_search_build(const hs_sets *sets, const hs_box *box, hs_search *search,
                          hs_failure *failure);

/* The queries into the cells that are there; their scene gives up its arrays. */
hs_status hs_search_bin_queries(hs_search *search, hs_scene *asking);

/*
 * A search among the points of another one, which was made to be kept, stays as it is and must
 * outlive this one. The queries of the sets ask, or the points. Cells, points and their scale are
 * those of the first search; cutoff, reach, stencil and queries are its own; account and threads
 * are those of its call. HS_UNSERVED when it cannot serve them: the cutoff is larger than its own,
 * or its bounds do not hold for the queries. Else any status of hs_search_open.
 */
hs_status hs_search_reuse(const hs_sets *sets, hs_call *call, hs_search *search,
                          hs_failure *failure);

#endif
