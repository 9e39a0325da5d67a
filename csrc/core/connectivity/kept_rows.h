/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * kept_rows.h: rows of nodes after a change that only takes away: nodes that go, with the numbers
 * that the others get, or entries that go. What stays is copied in one pass; nothing is searched,
 * and rows are sorted only where their nodes come in another order.
 */
#ifndef HS_KEPT_ROWS_H
#define HS_KEPT_ROWS_H

#include "../../halfshell_nodes.h"
#include "../collect/result.h"

/*
 * Each of these fills offsets and column J and, where `rows` has shifts, S of `result`, empty, laid
 * out as the rows that it is given. HS_ERR_ARGUMENT where these are no rows: offsets that descend
 * or end elsewhere, numbers of nodes that there are not.
 */

/* Row k is row source[k], each of them at most once: those of its nodes that stay, under their new
 * numbers. source: NULL for all rows, n of them, in their order. */
hs_status hs_kept_rows_fill(hs_call *call, const hs_list_rows *rows, const hs_node_change *change,
                            const int64_t *source, int64_t n, hs_pairs *result);

/* All rows, without the entries that are in `without`, which has as many rows and lists. `ascend`:
 * rows of both ascend, and those of `without` may have what `rows` have not; else they must have
 * them, in the same order: HS_ERR_ARGUMENT. */
hs_status hs_rows_without_fill(hs_call *call, const hs_list_rows *rows, const hs_list_rows *without,
                               bool ascend, hs_pairs *result);

#endif
