/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * systems_thread.h: the threads that search many systems. Each searches one after the other with
 * the same account and arena; what they find is written in the order of the systems (in_turn.h).
 */
#ifndef HS_SYSTEMS_THREAD_H
#define HS_SYSTEMS_THREAD_H

#include "../collect/columns.h"
#include "../threads/call.h"

/* What the threads share. */
typedef struct hs_systems_job {
    const hs_points  *points;
    const hs_systems *systems;
    hs_call          *total;  /* has the account of the output, and sums up what was done */
    hs_output        *output; /* NULL: only counting, into ... */
    int64_t          *counts;
    int64_t           in_range;  /* systems of a range; set by hs_systems_search */
    bool              is_direct; /* the one thread writes to the output itself; set there, too */
} hs_systems_job;

/* Searches all systems, by the team of `total`. */
hs_status hs_systems_search(hs_systems_job *job, hs_failure *failure);

#endif
