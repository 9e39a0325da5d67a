/* SPDX-License-Identifier: BSD-3-Clause */
/* record_write.h: all columns of a visit's hits in one pass, by the kernel's writer (write.h). */
#ifndef HS_RECORD_WRITE_H
#define HS_RECORD_WRITE_H

#include "recorder.h"

/* The hits of points from `first` on, which are places in the walker's block, as the next pairs of
 * the output, but for HS_WANT_BOTH. *written: whether that was possible; if not, nothing is there
 * yet. HS_OK or HS_ERR_INTERRUPTED. */
hs_status hs_write_hits(hs_recorder *recorder, hs_scanner *scanner, int32_t first,
                        const hs_hits *hits, bool *written);

#endif
