/* SPDX-License-Identifier: BSD-3-Clause */
/* poll.h: asking the caller whether to go on. */
#ifndef HS_POLL_H
#define HS_POLL_H

#include "../../halfshell.h"
#include "base.h"

/* Points that loading, wrapping and sorting handle between two polls: some milliseconds. */
#define HS_POLL_POINTS (INT64_C(1) << 17)

/* Candidates of one neighbourhood that a pass handles between two polls: some milliseconds. */
#define HS_POLL_CANDIDATES (1 << 18)

/* HS_OK, or HS_ERR_INTERRUPTED when the caller wants to stop. */
HS_ALWAYS_INLINE hs_status
hs_poll(const hs_options *options, double fraction)
{
    return options->poll == NULL || options->poll(options->poll_context, fraction)
               ? HS_OK
               : HS_ERR_INTERRUPTED;
}

#endif
