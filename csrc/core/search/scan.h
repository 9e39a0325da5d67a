/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scan.h: a scanner's block against its group: candidates appended, copied, put in order where that
 * is wanted, tested by the kernel, decided, and the hits handed to the visitor.
 */
#ifndef HS_SCAN_H
#define HS_SCAN_H

#include "scanner.h"

/*
 * A scanner for blocks of so many candidates and runs; no visitor yet. is_ordered: each point's
 * hits come in one visit, ascending by the candidate's number and then by S, for which the whole
 * neighbourhood must fit the block. On failure it may be closed.
 */
hs_status hs_scanner_init(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                          bool is_ordered, hs_scanner *scanner);

/* Adds what was done to that of the call and frees; harmless twice. */
void hs_scanner_close(hs_search *search, hs_scanner *scanner);

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
