/* SPDX-License-Identifier: BSD-3-Clause */
/* pairs.h: what a finished search is, for those who make one. */
#ifndef HS_PAIRS_H
#define HS_PAIRS_H

#include "output.h"
#include "search.h"

struct hs_pairs {
    hs_search search;  /* closed: kept for its account, options and scene */
    hs_output output;
    hs_output offsets; /* int64, where the rows of hs_neighbors_find begin; else nothing */
};

/* One that holds nothing yet; hs_search_begin comes first. NULL when memory is short. */
hs_pairs *hs_pairs_new(void);

#endif
