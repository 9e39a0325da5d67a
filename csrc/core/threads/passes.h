/* SPDX-License-Identifier: BSD-3-Clause */
/* passes.h: a pass over all points, cut into ranges that a team works on at once. Between its
 * rounds the caller is polled: once in HS_POLL_POINTS points, however many threads there are. */
#ifndef HS_PASSES_H
#define HS_PASSES_H

#include "../base/poll.h"
#include "team.h"

/* Slabs of a round. Results of a slab can be kept in an array of that many. */
#define HS_SLABS       32
#define HS_SLAB_POINTS (HS_POLL_POINTS / HS_SLABS)

/* Work on points [first, last). `slab` numbers the ranges of one round in ascending order; no two
 * calls with the same number run at once. */
typedef hs_status (*hs_slab_fn)(void *context, int slab, int64_t first, int64_t last);

/* Points 0 ... n - 1 in ascending rounds. Ends after a round in which a slab fails, with the status
 * of the lowest that does; HS_ERR_INTERRUPTED when the caller says so. */
hs_status hs_walk_slabs(hs_team *team, const hs_options *options, int64_t n, hs_slab_fn run,
                        void *context);

/* Points 0 ... n - 1 in n_strips long ranges, at most HS_SLABS, each in ascending order of its
 * points: `slab` is the strip. Ends as hs_walk_slabs does. */
hs_status hs_walk_strips(hs_team *team, const hs_options *options, int64_t n, int n_strips,
                         hs_slab_fn run, void *context);

#endif
