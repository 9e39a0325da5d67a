/* SPDX-License-Identifier: BSD-3-Clause */
/* decide.h: the exact decision of the hits that float32 could not tell. */
#ifndef HS_DECIDE_H
#define HS_DECIDE_H

#include "scanner.h"

/* Decides scan->unsure, of the points [first, next) of the group, and takes those that are beyond
 * the cutoff from the hits; the order stays. */
hs_status hs_decide(hs_scanner *scanner, hs_scan *scan, int32_t first, int32_t next);

/* Whether each pair of scanner->trace is within the metric's cutoff, which need not be the scene's.
 * within: HS_BATCH of them. */
void hs_decide_traced(hs_scanner *scanner, const hs_metric *metric, uint8_t *within);

#endif
