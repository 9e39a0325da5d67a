/* SPDX-License-Identifier: BSD-3-Clause */
/* threads.h: how many threads a search may use when the caller does not say. */
#ifndef HS_THREADS_H
#define HS_THREADS_H

/* The first number of OMP_NUM_THREADS if that is set to one, else the cores that this process may
 * run on; at least 1. */
int hs_default_threads(void);

/* More of them make nothing quicker, and would keep the caller's own thread from the processor,
 * which is the one that sees Ctrl-C. */
#define HS_THREADS_PER_CORE 4

/* What more of them would only make slower: a few for each core. */
int hs_most_threads(void);

#endif
