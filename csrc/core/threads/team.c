/* SPDX-License-Identifier: BSD-3-Clause */
/* team.c: a job is open while its tasks are handed out. Threads that wake up too late for it go
 * back to sleep, so the caller never waits for them. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* pthread_sigmask */
#endif
#include "team.h"

#include "../base/fpenv.h"
#include "../memory/account.h"
#include "../base/os_thread.h"

typedef struct job {
    hs_task_fn run;
    void      *context;
    int64_t    n_tasks;
} job;

struct hs_team {
    hs_mutex         mutex;  /* guards all but `next` */
    hs_condition     opened; /* a job is there, or the team ends */
    hs_condition     left;   /* no thread works on the job any more */
    job              job;
    int64_t          job_number;
    bool             is_open;
    bool             ends;
    int              n_working; /* threads on the job, the caller not among them */
    int              n_others;
    volatile int64_t next; /* task to be handed out; atomic */
    hs_thread        others[];
};

static void
do_tasks(hs_team *team, const job *doing)
{
    for (;;) {
        const int64_t task = hs_fetch_increment(&team->next);
        if (task >= doing->n_tasks) {
            return;
        }
        doing->run(doing->context, task);
    }
}

/* What each thread but the caller's runs. */
static hs_thread_result HS_THREAD_CALL
work(void *context)
{
    hs_team *team = context;
    int64_t  seen = 0; /* number of the last job that this thread worked on */
    (void)hs_fpenv_enter();
    hs_mutex_lock(&team->mutex);
    for (;;) {
        while (!team->ends && !(team->is_open && team->job_number != seen)) {
            hs_condition_wait(&team->opened, &team->mutex);
        }
        if (team->ends) {
            break;
        }
        const job doing = team->job;
        seen = team->job_number;
        team->n_working++;
        hs_mutex_unlock(&team->mutex);
        do_tasks(team, &doing);
        hs_mutex_lock(&team->mutex);
        if (--team->n_working == 0) {
            hs_condition_wake(&team->left);
        }
    }
    hs_mutex_unlock(&team->mutex);
    return 0;
}

hs_team *
hs_team_create(int n_threads)
{
    if (n_threads <= 1) {
        return NULL;
    }
    const int64_t n_others = n_threads - 1;
    const size_t  size = sizeof(hs_team) + (size_t)n_others * sizeof(hs_thread);
    hs_team      *team = hs_alloc(NULL, HS_FOR_STENCIL, 1, size);
    if (team == NULL) {
        return NULL;
    }
    *team = (hs_team){.n_others = 0};
    hs_mutex_init(&team->mutex);
    hs_condition_init(&team->opened);
    hs_condition_init(&team->left);
    hs_signals saved;
    hs_signals_block(&saved);
    while (team->n_others < n_others &&
           hs_thread_start(&team->others[team->n_others], work, team)) {
        team->n_others++;
    }
    hs_signals_restore(&saved);
    if (team->n_others == 0) {
        hs_team_free(team);
        return NULL;
    }
    return team;
}

int
hs_team_size(const hs_team *team)
{
    return team == NULL ? 1 : team->n_others + 1;
}

void
hs_team_run(hs_team *team, int64_t n_tasks, hs_task_fn run, void *context)
{
    if (team == NULL || n_tasks <= 1) {
        for (int64_t task = 0; task < n_tasks; task++) {
            run(context, task);
        }
        return;
    }
    const job doing = {run, context, n_tasks};
    hs_mutex_lock(&team->mutex);
    team->job = doing;
    team->job_number++;
    team->next = 0; /* no thread takes tasks now: the last job is closed and left */
    team->is_open = true;
    hs_condition_wake(&team->opened);
    hs_mutex_unlock(&team->mutex);
    do_tasks(team, &doing);
    hs_mutex_lock(&team->mutex);
    team->is_open = false;
    while (team->n_working > 0) {
        hs_condition_wait(&team->left, &team->mutex);
    }
    hs_mutex_unlock(&team->mutex);
}

void
hs_team_free(hs_team *team)
{
    if (team == NULL) {
        return;
    }
    hs_mutex_lock(&team->mutex);
    team->ends = true;
    hs_condition_wake(&team->opened);
    hs_mutex_unlock(&team->mutex);
    for (int t = 0; t < team->n_others; t++) {
        hs_thread_join(team->others[t]);
    }
    hs_condition_destroy(&team->left);
    hs_condition_destroy(&team->opened);
    hs_mutex_destroy(&team->mutex);
    hs_free(NULL, team);
}
