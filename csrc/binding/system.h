/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_SYSTEM_H
#define HS_SYSTEM_H

/* The first number of OMP_NUM_THREADS if that is set to one, else the cores that this process may
 * run on; at least 1. */
int hs_default_threads(void);

/* More of them make nothing quicker, and would keep the caller's own thread from the processor,
 * which is the one that sees Ctrl-C. */
#define HS_THREADS_PER_CORE 4

/* What more of them would only make slower: a few for each core. */
int hs_most_threads(void);

/*
 * Bytes: the least that this process's group and any group above it still allows, in both versions
 * of control groups, as far as they are mounted here. Infinity where there is no limit, and on
 * other systems. `root` stands in for "/": "" for the machine itself, a folder for tests.
 */
double hs_group_memory(const char *root);

/*
 * Bytes: the least of what the machine has free or could free without swapping, what the control
 * group allows, and what RLIMIT_AS leaves. Infinity where nothing is known. Needs no GIL; the
 * argument is ignored (the signature is hs_limit_fn's).
 */
double hs_available_memory(void *ignored);

/*
 * HALFSHELL_KERNEL, which names the kernel of every search that names none; for tests and timing of
 * programs that cannot be changed. It is read once, when the module is imported.
 */
void hs_environment_read(void);

/* A name that need not be that of any kernel, or NULL; static storage. */
const char *hs_environment_kernel(void);

#endif
