/* SPDX-License-Identifier: BSD-3-Clause */
/* sort_deal.h: the counting sort of pairs into rows. */
#ifndef HS_SORT_DEAL_H
#define HS_SORT_DEAL_H

#include "sort_entries.h"

/* Sets end, n, longest, has_j, place_bits and entries, which the caller frees, also on failure: the
 * entries of each row together, in no order yet. i, j and what describes the pairs are there
 * already. */
hs_status hs_deal_out(hs_sorting *all);

#ifdef HS_TESTING
/* How many bits a place may have at most. Returns what it was before. */
int hs_test_sort_place_bits(int bits);
#endif

#endif
