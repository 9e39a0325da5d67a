/* SPDX-License-Identifier: BSD-3-Clause */
/* choose.h: takes pairs that do not count from the hits of a scan, before anything is done with
 * them. */
#ifndef HS_CHOOSE_H
#define HS_CHOOSE_H

#include "scanner.h"

/*
 * Takes hits of points [first, next) of the group out that the call's choice leaves out; the order
 * of the others stays. Hits are places, and become point numbers where the scanner lists these. The
 * pair of a point with itself stays where lists are full: table rows count on it. HS_OK, or any
 * status of hs_trace_look_up and hs_near_image; scanner->failed_point is the asking point then.
 */
hs_status hs_choose(hs_scanner *scanner, hs_scan *scan, int32_t first, int32_t next);

#endif
