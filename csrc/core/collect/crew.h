/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * crew.h: the threads of a call at one job. Each has a worker of its own, a struct that the
 * caller's thread opens before the job and closes after it, also when opening a later one has
 * failed. Work that is cut into ranges is handed out one range at a time; what is found is written
 * in their order (in_turn.h).
 */
#ifndef HS_CREW_H
#define HS_CREW_H

#include "../threads/call.h"
#include "in_turn.h"

typedef struct hs_crew {
    hs_call *call;        /* borrowed */
    void    *job;         /* borrowed; what the workers share */
    size_t   worker_size; /* bytes */
    /* The worker is zero before. It is closed also when this fails. */
    hs_status (*open)(void *job, void *worker);
    void (*close)(void *job, void *worker);
    void *workers; /* owned; one for each thread, one behind another */
    int   n_open;  /* so many of them */
    /* For hs_crew_run: */
    int64_t     n_ranges;
    hs_range_fn search;
    hs_output  *output;       /* borrowed; NULL when nothing is committed */
    int64_t     enough, most; /* pairs in the output, for hs_commits_limit; 0: all */
    int64_t     n_written;    /* set at the end: the first ranges, written to their end */
} hs_crew;

/* Opens a worker for each thread. hs_crew_close must follow, also on failure. */
hs_status hs_crew_open(hs_crew *crew);
void      hs_crew_close(hs_crew *crew);

/* Opens workers, each of which begins with a hs_committer and sets its `options` and `pairs`; they
 * take ranges, and are closed. Returns the failure of the earliest range that had one. */
hs_status hs_crew_run(hs_crew *crew, hs_failure *failure);

#endif
