/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * call.h: one call of the library, from its first line to its last: what the caller wants, the
 * memory and the threads that it may use, and what it has done so far. Every function that works
 * for a call gets a pointer to it; only the result outlives it.
 */
#ifndef HS_CALL_H
#define HS_CALL_H

#include "../base/fpenv.h"
#include "../memory/account.h"
#include "team.h"

#include "../../kernels/kernel.h"

/* The way into a public function and out of it. */
typedef struct hs_entry {
    hs_failure ignored; /* written to when the caller does not want to know */
    hs_fpenv   saved;   /* the caller's floating-point environment */
} hs_entry;

typedef struct hs_call {
    hs_account        account;
    hs_options        options;      /* the caller's; their poll counts how often it is called */
    const hs_kernel  *kernel;       /* NULL: this CPU has none of that name */
    hs_team          *team;         /* owned; NULL: the caller's thread alone */
    hs_counters       done;         /* by walkers that have finished */
    hs_poll_fn        callers_poll; /* behind options.poll */
    void             *callers_context;
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

/* Calls this in place of the options' poll; NULL: nothing. */
void hs_call_set_poll(hs_poll_fn poll, void *context, hs_call *call);

/* Making so many points ready for a search takes as long as all of a search with one. */
#define HS_POINTS_MADE_READY 4

/* How many threads these options mean for so many points, or for work that takes as long. */
int hs_call_threads(double n_points, const hs_options *options);

/* Starts the threads that so many points are worth, unless they run already. */
void hs_call_gather(hs_call *call, int64_t n_points);

/* The same once it is known about how many pairs these points have, for options that name a number
 * of threads: the others go by points alone. */
void hs_call_gather_for(hs_call *call, int64_t n_points, double n_pairs);

#ifdef HS_TESTING
/* From how many points on threads are worth starting that the options name; in tests 0 at first.
 * Returns what it was before. */
double hs_test_worth_threads(double n_points);
#endif

/* Ends them. Harmless twice. */
void hs_call_dismiss(hs_call *call);

/* Adds what a walker, or another call, has done. */
void hs_call_note(hs_call *call, const hs_counters *done);

/* Writes the counters, if the options want them. */
void hs_call_report(const hs_call *call, int64_t n_pairs);

/* How much memory the call was allowed, if the lack of it is the failure. */
void hs_call_tell_limit(const hs_call *call, hs_status status, hs_failure *failure);

/* Forgets what has been done and held, except polls and the limit that was found. Nothing may be
 * held any more. */
void hs_call_restart(hs_call *call);

/* Gives up what points to the caller's memory, for a call that is kept inside an object; only the
 * context of find_limit stays. */
void hs_call_detach(hs_call *call);

#endif
