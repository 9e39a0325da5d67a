/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scan.h: a walker's block against its group: copied, put in order where that is asked for, tested
 * by the kernel, decided, and the hits handed to the visitor.
 */
#ifndef HS_SCAN_H
#define HS_SCAN_H

#include "walk.h"

/* Tests every point of the group against what has been appended to the block, unless it is one to
 * skip, then empties it. HS_STATUS_END past the candidate limit, or when a visitor leaves; what the
 * visitor or the poll say. */
hs_status hs_scan_block(hs_walker *walker);

#endif
