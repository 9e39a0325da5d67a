/* SPDX-License-Identifier: BSD-3-Clause */
/* available.h: how much memory this process may still take. */
#ifndef HS_AVAILABLE_H
#define HS_AVAILABLE_H

/*
 * Bytes: the least of what the machine has free or could free without swapping, what the control
 * group allows, and what RLIMIT_AS leaves. Infinity where nothing is known. Needs no GIL; the
 * argument is ignored (the signature is hs_limit_fn's).
 */
double hs_available_memory(void *ignored);

#endif
