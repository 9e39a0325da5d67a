/* SPDX-License-Identifier: BSD-3-Clause */
/* result.h: what a finished search is, for those who make one. */
#ifndef HS_RESULT_H
#define HS_RESULT_H

#include "columns.h"
#include "../search/search.h"

struct hs_pairs {
    hs_search search;  /* closed: kept for its account, options and scene */
    hs_output output;
    hs_output offsets; /* int64, where the rows of hs_neighbors_find begin; else nothing */
};

/* One that holds nothing yet; hs_search_begin comes first. NULL when memory is short. */
hs_pairs *hs_pairs_new(void);

/* When a search ends with this status: arrays also where there are no pairs; HS_ERR_CAPACITY where
 * those of the caller had no room for all. */
hs_status hs_pairs_conclude(hs_output *output, hs_status status, hs_failure *failure);

#endif
