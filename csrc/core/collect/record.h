/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * record.h: turns hits into pairs of the half list: i < j, or for a point and its own image the
 * first nonzero component of S positive, with D, d and S of that orientation.
 */
#ifndef HS_RECORD_H
#define HS_RECORD_H

#include "recorder.h"

/* The hits of points from `first` on, which are places in the walker's block, as the next pairs of
 * the output, which has room for them: at once where that is possible, else in batches.
 * HS_ERR_SHIFT_RANGE sets scanner->failed_point. */
hs_status hs_record_places(hs_recorder *recorder, hs_scanner *scanner, int32_t first,
                           const hs_hits *hits);

/* A hs_visit_fn. */
hs_status hs_record_hits(void *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits);

#endif
