/* SPDX-License-Identifier: BSD-3-Clause */
/* search_open.h: from points, queries, box and options to a search that can be walked. */
#ifndef HS_SEARCH_OPEN_H
#define HS_SEARCH_OPEN_H

#include "search.h"

/*
 * Everything up to the first group: hs_search_begin, the team, hs_search_build; or what can be
 * reused of sets->built. On failure nothing is held but the account, which the caller closes in any
 * case. The options are copied; what they point to is borrowed until hs_search_close; the points
 * are not needed any more.
 */
hs_status hs_search_open(const hs_sets *sets, const hs_box *box, const hs_options *options,
                         hs_search *search, hs_failure *failure);

#endif
