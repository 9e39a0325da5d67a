/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * systems_thread.h: one of the threads that search many systems. It searches one after the other
 * with the same account and arena, and writes in their order (in_turn.h).
 */
#ifndef HS_SYSTEMS_THREAD_H
#define HS_SYSTEMS_THREAD_H

#include "../collect/crew.h"
#include "../search/search.h"

typedef struct hs_systems_crew hs_systems_crew;

/* What one thread works with. */
typedef struct hs_systems_worker {
    hs_systems_crew *crew;
    hs_call          call; /* with this thread's poll */
    hs_committer     committer;
    hs_search        search; /* of one system after the other */
    hs_box           box;    /* of the present system, where each has its own */
    hs_output       *target; /* the crew's output, or the backlog's */
    hs_backlog       backlog;
    hs_output        found; /* pairs of one system before they are sorted */
    hs_failure       failure;
    int64_t          work; /* since the last poll */
} hs_systems_worker;

struct hs_systems_crew {
    const hs_points   *points;
    const hs_systems  *systems;
    hs_systems_worker *workers;
    hs_commits        *commits;
    hs_output         *output; /* NULL: only counting, into ... */
    int64_t           *counts;
    int64_t            in_range;  /* systems of a range */
    bool               is_direct; /* the one thread writes to the output itself */
};

/* The points of system s and its box: own_box, if each has its own. */
const hs_box *hs_systems_take(const hs_systems_crew *crew, int64_t s, hs_points *points,
                              hs_box *own_box);

/* Cannot fail: memory is taken as it is needed. */
void hs_systems_open_worker(hs_systems_crew *crew, const hs_options *options,
                            hs_systems_worker *worker);

/* A hs_task_fn of a crew: the worker of this number searches ranges, as long as there are any. */
void hs_systems_work(void *crew, int64_t worker);

/* Adds what the worker did to `total`, and frees what it has. */
void hs_systems_close_worker(hs_systems_worker *worker, hs_call *total);

#endif
