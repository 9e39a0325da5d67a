/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * bin_columns.h: the columns of the points, from the caller's order to cell order. Each is gathered
 * into the column that is free, and leaves its own place free for the next:
 *
 *     order | spare | x[0] | x[1] | ...   ->   order | x[0] | x[1] | ... | free
 *
 * so that this takes room for one column and no more.
 */
#ifndef HS_BIN_COLUMNS_H
#define HS_BIN_COLUMNS_H

#include "bins.h"
#include "../threads/team.h"

/*
 * Columns of x, originals and turns, as bins->order says, in the order in which they lie behind the
 * free column: the wide ones go before the narrow ones. x_is_beside: as in hs_scene. *end: where
 * the last column ends that is still needed. HS_OK or HS_ERR_INTERRUPTED.
 */
hs_status hs_columns_gather(hs_team *team, const hs_options *options, bool x_is_beside,
                            hs_bins *bins, void *free_column, char **end);

#endif
