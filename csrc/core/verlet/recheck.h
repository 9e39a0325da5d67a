/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_VERLET_RECHECK_H
#define HS_VERLET_RECHECK_H

#include "../collect/columns.h"
#include "pair_list.h"

/*
 * recheck.h: the pairs of a list that are within the cutoff now, decided as a search decides them:
 * in float32 (kernels/slab.h), and by the exact metric where float32 cannot tell. A slab of the
 * list at a time; threads work on one each, and what they find is written in the order of the list.
 */

/* The pairs of the last step, into a result whose call has begun. Its options are checked and have
 * the cutoff of the list. Any status of hs_verlet_find. */
hs_status hs_recheck_find(const hs_verlet *list, hs_pairs *pairs, hs_failure *failure);

#endif
