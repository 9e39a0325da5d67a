/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_search.h: the search itself, by all threads of a team, once scene and trees are there. */
#ifndef HS_NEAREST_SEARCH_H
#define HS_NEAREST_SEARCH_H

#include "nearest.h"

/* Writes all rows. HS_ERR_MEMORY, HS_ERR_INTERRUPTED; HS_ERR_SHIFT_RANGE sets failure->row. */
hs_status hs_near_search(hs_near *near, hs_failure *failure);

#endif
