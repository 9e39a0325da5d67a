/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scan.h: a scanner's block against its group: candidates appended, copied, put in order where that
 * is wanted, tested by the kernel, decided, and the hits handed to the visitor.
 */
#ifndef HS_SCAN_H
#define HS_SCAN_H

#include "scanner.h"

/* Points [first, last) in cell order are the group from here on, with an empty block. */
void hs_scanner_start(hs_scanner *scanner, int32_t first, int32_t last);

/*
 * Appends points [si, end) of one image to the neighbourhood; a full block is tested first. shift:
 * the image's displacement, ndim doubles; image: that displacement over the rows of B. Any status
 * of hs_scan_block.
 */
hs_status hs_scanner_append(hs_scanner *scanner, int32_t si, int32_t end, const double *shift,
                            const int32_t *image);

/*
 * Tests every point of the group against what has been appended to the block, unless it is one to
 * skip, then empties it. HS_STOPPED past the candidate limit, or when a visitor leaves; what the
 * visitor or the poll say.
 */
hs_status hs_scan_block(hs_scanner *scanner);

/* The last block of the group, and what is known of the group then. */
hs_status hs_scanner_finish(hs_scanner *scanner);

#endif
