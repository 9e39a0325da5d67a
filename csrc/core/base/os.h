/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_BASE_OS_H
#define HS_BASE_OS_H

#include "../../halfshell.h"
#include "base.h"

/*
 * os.h: the floating-point environment of a call, and the polls that let its caller stop it.
 */

/*
 * The floating-point environment that the exact stages need: round to nearest, no flushing of
 * subnormal numbers, no trap. Every entry into the core enters it before it touches a float, and
 * leaves it; threads of a team live in it.
 */

#if !defined(__SSE2__) && !defined(_M_X64) && !defined(__aarch64__) && !defined(_M_ARM64)
#include <fenv.h>
#define HS_FPENV_STANDARD 1
#endif

typedef struct hs_fpenv {
#if defined(HS_FPENV_STANDARD)
    fenv_t standard;
#else
    uint64_t control; /* the control register as it was, and the flags */
#endif
} hs_fpenv;

/* Save the control register, then set the defaults. */
hs_fpenv hs_fpenv_enter(void);

/* Put back what hs_fpenv_enter found. Exception flags are put back too. */
void hs_fpenv_leave(hs_fpenv saved);

/*
 * Subnormal numbers take a hundred times as long as others on some CPUs. The float32 filter allows
 * for flushing (bounds.h), so it may run with it; nothing else may. Between hs_fpenv_enter and
 * hs_fpenv_leave, for the thread that calls. Does nothing on CPUs where it would not help.
 */
void hs_fpenv_flush(bool on);

/* Whether this thread has met a subnormal number since it last entered or set flushing, on or off;
 * false where that is not known. */
bool hs_fpenv_met_subnormal(void);

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
