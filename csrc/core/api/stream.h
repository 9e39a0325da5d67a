/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_API_STREAM_H
#define HS_API_STREAM_H

#include "../../halfshell.h"

/*
 * stream.h: pairs in blocks, and pairs that are shown to a callback.
 */

/* hs_pairs_visit for what looks at pairs inside the core. */

/* hs_pairs_visit with options->want and ->index_bytes heeded, by visit->pairs where that leaves a
 * column out; all but `among` is there. */
hs_status hs_visit_columns(const hs_among *among, const hs_options *options, const hs_visit *visit,
                           int64_t *n_visited, hs_failure *failure);

#endif
