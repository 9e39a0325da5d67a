/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_THREADS_CALL_H
#define HS_THREADS_CALL_H

#include "../base/os.h"
#include "../memory/memory.h"
#include "../../kernels/kernel.h"

/*
 * call.h: one call of the library, from its first line to its last: what the caller wants, the
 * memory and the threads that it may use, and what it has done so far. Every function that works
 * for a call gets a pointer to it; only the result outlives it.
 */

/*
 * Threads for one call. A team is made when a call begins that may use several threads, and
 * ends before the call returns: no thread is left behind, none is shared between calls. NULL is the
 * team of the caller alone, who then does every task itself.
 */

typedef struct hs_team hs_team;

/* One of the tasks 0 ... n_tasks - 1. Several run at once, so each writes to places of its own. */
typedef void (*hs_task_fn)(void *context, int64_t task);

/*
 * A team of the caller and up to n_threads - 1 others, to be ended by hs_team_free. With fewer
 * threads than that where the system refuses them; NULL where there are none, or n_threads is 1 or
 * less. The others block all signals, and compute in the floating-point environment of os.h.
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

/* The way into a public function and out of it. */
typedef struct hs_entry {
    hs_failure ignored; /* written to when the caller does not want to know */
    hs_fpenv   saved;   /* the caller's floating-point environment */
} hs_entry;

/* The part of a call's work whose progress polls tell: where it begins, and how much it is. */
typedef struct hs_stretch {
    double from, share;
} hs_stretch;

typedef struct hs_call {
    hs_account        account;
    hs_options        options;      /* the caller's; their poll counts how often it is called */
    const hs_kernel  *kernel;       /* NULL: this CPU has none of that name */
    hs_team          *team;         /* owned; NULL: the caller's thread alone */
    hs_counters       done;         /* by walkers that have finished */
    hs_poll_fn        callers_poll; /* behind options.poll */
    void             *callers_context;
    hs_stretch        part;
    double            told;   /* the fraction that was told last: it never falls */
    struct hs_choice *choice; /* owned, search/choice.h; NULL: all pairs within reach count */
    hs_entry          entry;
} hs_call;

/* Into the library's floating-point environment. Returns where the failure is to be written,
 * cleared: `failure`, unless that is NULL. hs_leave must follow. */
hs_failure *hs_enter(hs_failure *failure, hs_entry *entry);
void        hs_leave(const hs_entry *entry);

/* An account, options and their kernel; no threads yet. The call must not move while its poll is
 * used. */
void hs_call_begin(const hs_options *options, hs_call *call);

/* hs_enter and hs_call_begin, for a public function. hs_call_leave must follow. */
hs_failure *hs_call_enter(const hs_options *options, hs_failure *failure, hs_call *call);

/* Ends the threads, writes the counters if they are wanted, and restores the caller's environment.
 * The account stays open for the result. */
void hs_call_leave(hs_call *call, int64_t n_pairs);

/* What follows is the work from `from` to `to` of the call, or of its present part, which is
 * returned, to be call->part again when that is done. */
hs_stretch hs_call_begin_part(hs_call *call, double from, double to);

/* Calls this in place of the options' poll; NULL: nothing. */
void hs_call_set_poll(hs_poll_fn poll, void *context, hs_call *call);

/* Making so many points ready for a search takes as long as all of a search with one. */
#define HS_POINTS_MADE_READY 4

/* How many threads these options mean for so many points, or for work that takes as long. */
int hs_call_threads(double n_points, const hs_options *options);

/* Starts the threads that so many points are worth, unless they run already. */
void hs_call_gather(hs_call *call, int64_t n_points);

/* The same once it is known about how many pairs these points have; unless what is searched is
 * kept, for options that name a number of threads: the others go by points alone. */
void hs_call_gather_for(hs_call *call, int64_t n_points, double n_pairs, bool are_kept);

#ifdef HS_TESTING
/* From how many points on threads are worth starting that the options name; 0 at first. */
extern double hs_test_worth_threads;
#endif

/* Ends them. Idempotent. */
void hs_call_dismiss(hs_call *call);

/* Adds what a walker, or another call, has done. */
void hs_call_add_counters(hs_call *call, const hs_counters *done);

/* How much memory the call was allowed, if the lack of it is the failure. */
void hs_call_tell_limit(const hs_call *call, hs_status status, hs_failure *failure);

/* Forgets what has been done and held, except polls and the limit that was found. Nothing may be
 * held any more but the choice, whose bytes then still count with all before. */
void hs_call_restart(hs_call *call);

/* Gives up what points to the caller's memory, for a call that is kept inside an object; only the
 * context of find_limit stays. */
void hs_call_detach(hs_call *call);

/* A pass over all points, cut into ranges that a team works on at once. Between its rounds the
 * caller is polled: once in HS_POLL_POINTS points, however many threads there are. */

/* Slabs of a round. Results of a slab can be kept in an array of that many. */
#define HS_SLABS       32
#define HS_SLAB_POINTS (HS_POLL_POINTS / HS_SLABS)

/* Work on points [first, last). `slab` numbers the ranges of one round in ascending order; no two
 * calls with the same number run at once. */
typedef hs_status (*hs_slab_fn)(void *context, int slab, int64_t first, int64_t last);

/*
 * Points 0 ... n - 1 in ascending rounds; or with n_strips > 0, at most HS_SLABS, in so many long
 * ranges, each in ascending order of its points: `slab` is the strip. Ends after a round in which a
 * slab fails, with the status of the lowest that does; HS_ERR_INTERRUPTED when the caller says so.
 */
hs_status hs_walk_points(hs_team *team, const hs_options *options, int64_t n, int n_strips,
                         hs_slab_fn run, void *context);

/* Strips of n points for this team, where each counts in n_counts numbers of its own: with `least`
 * points or more, and no more further numbers than points. */
int hs_strips_for(const hs_team *team, int64_t n, int64_t least, int64_t n_counts);

#endif
