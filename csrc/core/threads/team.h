/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * team.h: threads for one call. A team is made when a call begins that may use several threads, and
 * ends before the call returns: no thread is left behind, none is shared between calls. NULL is the
 * team of the caller alone, who then does every task itself.
 */
#ifndef HS_TEAM_H
#define HS_TEAM_H

#include "../base/base.h"

typedef struct hs_team hs_team;

/* One of the tasks 0 ... n_tasks - 1. Several run at once, so each writes to places of its own. */
typedef void (*hs_task_fn)(void *context, int64_t task);

/*
 * A team of the caller and up to n_threads - 1 others, to be ended by hs_team_free. With fewer
 * threads than that where the system refuses them; NULL where there are none, or n_threads is 1 or
 * less. The others block all signals, and compute in the floating-point environment of fpenv.h.
 */
hs_team *hs_team_create(int n_threads);

/* Threads that work for the team, the caller among them: at least 1, also of NULL. */
int hs_team_size(const hs_team *team);

/* Runs every task and returns when all are done. Tasks are handed out in ascending order;
 * which thread gets which is left to chance. Called by the thread that made the team, never
 * from a task. */
void hs_team_run(hs_team *team, int64_t n_tasks, hs_task_fn run, void *context);

/* Ends the threads and waits for them. NULL-safe. */
void hs_team_free(hs_team *team);

#endif
