/* SPDX-License-Identifier: BSD-3-Clause */
/* systems_check.h: what is checked, and shared out, before many systems are searched. */
#ifndef HS_SYSTEMS_CHECK_H
#define HS_SYSTEMS_CHECK_H

#include "system_part.h"
#include "../threads/call.h"

/* The arguments of a call that has been entered, and its kernel. What a system has of its own is
 * looked at with it. */
hs_status hs_systems_check(const hs_system_sets *sets, const hs_call *total, hs_failure *failure);

/* After that, where pairs have the cutoff or a reach as their limit, and what all systems share of
 * it; is_full: rules may have a direction. */
hs_status hs_systems_check_limit(const hs_system_sets *sets, bool is_full,
                                 const hs_options *options, hs_failure *failure);

/* Each thread has an account of its own: together they must not pass the limit of the call. */
void hs_share_limit(hs_options *options, int n_threads);

#endif
