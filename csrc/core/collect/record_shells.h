/* SPDX-License-Identifier: BSD-3-Clause */
/* record_shells.h: which shell each pair is in (shells.h). */
#ifndef HS_RECORD_SHELLS_H
#define HS_RECORD_SHELLS_H

#include "recorder.h"

/* The shells of the hits of points from `first` on, places in the walker's block whose distances
 * have been written, as the next of the column; nothing where they are not wanted. Distances that
 * rounding has moved across an edge are put right. HS_OK, HS_ERR_SHIFT_RANGE, which sets
 * scanner->failed_point, or HS_ERR_INTERRUPTED. */
hs_status hs_put_shells(const hs_recorder *recorder, hs_scanner *scanner, int32_t first,
                        const hs_hits *hits);

#endif
