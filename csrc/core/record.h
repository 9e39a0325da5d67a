/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * record.h: turns the hits of a point into pairs of the half list: i < j, or for a point and its
 * own image the first nonzero component of S positive, with D, d and S of that orientation.
 */
#ifndef HS_RECORD_H
#define HS_RECORD_H

#include "search.h"
#include "store.h"

/* A hs_visit_fn; context is the hs_store that receives the pairs. */
hs_status hs_record_hits(void *store, hs_search *search, int32_t si, int32_t n_hits);

#endif
