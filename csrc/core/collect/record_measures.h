/* SPDX-License-Identifier: BSD-3-Clause */
/* record_measures.h: d, D and S of hits, written beside their indices. */
#ifndef HS_RECORD_MEASURES_H
#define HS_RECORD_MEASURES_H

#include "recorder.h"

/* The hits of points from `first` on, which are places in the walker's block, as the next pairs of
 * the output; recorder->ids holds their numbers. HS_ERR_SHIFT_RANGE sets scanner->failed_point. */
hs_status hs_put_measures(hs_recorder *recorder, hs_scanner *scanner, int32_t first,
                          const hs_hits *hits);

#endif
