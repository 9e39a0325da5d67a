/* SPDX-License-Identifier: BSD-3-Clause */
/* visit_columns.h: hs_pairs_visit for what looks at pairs inside the core. */
#ifndef HS_VISIT_COLUMNS_H
#define HS_VISIT_COLUMNS_H

#include "../../halfshell.h"

/* hs_pairs_visit with options->want and ->index_bytes heeded, by visit->pairs where that leaves a
 * column out; all but `among` is there. */
hs_status hs_visit_columns(const hs_among *among, const hs_options *options, const hs_visit *visit,
                           int64_t *n_visited, hs_failure *failure);

#endif
