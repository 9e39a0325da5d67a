/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * once.h: a large table of i and j by one walk, not two. The rows are found in cell order, as
 * int32, and wait in memory that the result needs anyway: that of i, whose turn comes last. Then j
 * is written from them in the order of the table, and i over them.
 */
#ifndef HS_ONCE_H
#define HS_ONCE_H

#include "table_rows.h"

/* Whether to try: i and j, nothing else, in columns of the search's own, by one thread. */
bool hs_once_applies(const hs_table *table);

/* After hs_table_prepare: finds offsets and entries. HS_TOO_MUCH when memory is short: nothing is
 * kept then, and two walks, the first of which only counts, can do with less or tell how much it
 * takes. */
hs_status hs_once_find(hs_table *table, hs_failure *failure);

#endif
