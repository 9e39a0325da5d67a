/* SPDX-License-Identifier: BSD-3-Clause */
/* search_open.h: from points, queries, box and options to a search that can be walked. */
#ifndef HS_SEARCH_OPEN_H
#define HS_SEARCH_OPEN_H

#include "search.h"

/*
 * Everything up to the first group: threads and cells, or what can be reused of sets->built. On
 * failure the search is closed. The points are not needed any more.
 */
hs_status hs_search_open(const hs_sets *sets, const hs_box *box, hs_call *call, hs_search *search,
                         hs_failure *failure);

#endif
