/* SPDX-License-Identifier: BSD-3-Clause */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* pthread_sigmask */
#endif
#include "call.h"
#include "../base/os_thread.h"
#include "../base/status.h"

/* call.c: options, memory, threads and counters of a call are in one struct, to which every step
 * adds. Its team works on a job, which is open while its tasks are handed out: threads that wake up
 * too late for it go back to sleep, so the caller never waits for them. */

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
        const int64_t task = hs_atomic_add(&team->next, 1);
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

/* An hs_poll_fn: the caller's, counted, and told of all parts. */
static bool
counted_poll(void *context, double fraction)
{
    hs_call *call = context;
    call->done.polls++;
    call->told = hs_larger(call->part.from + call->part.share * fraction, call->told);
    return call->callers_poll(call->callers_context, call->told);
}

hs_stretch
hs_call_begin_part(hs_call *call, double from, double to)
{
    const hs_stretch outer = call->part;
    call->part.from = outer.from + outer.share * from;
    call->part.share = outer.share * (to - from);
    return outer;
}

void
hs_call_set_poll(hs_poll_fn poll, void *context, hs_call *call)
{
    call->callers_poll = poll;
    call->callers_context = context;
    call->options.poll = poll != NULL ? counted_poll : NULL;
    call->options.poll_context = call;
}

void
hs_call_begin(const hs_options *options, hs_call *call)
{
    call->options = *options;
    call->kernel = hs_kernel_select(options->kernel);
    call->team = NULL;
    call->done = (hs_counters){.pairs = 0};
    call->choice = NULL;
    call->part = (hs_stretch){0.0, 1.0};
    call->told = 0.0;
    hs_call_set_poll(options->poll, options->poll_context, call);
    hs_account_init(&call->account, options);
}

hs_failure *
hs_enter(hs_failure *failure, hs_entry *entry)
{
    failure = failure != NULL ? failure : &entry->ignored;
    *failure = HS_NO_FAILURE;
    entry->saved = hs_fpenv_enter();
    return failure;
}

void
hs_leave(const hs_entry *entry)
{
    hs_fpenv_leave(entry->saved);
}

hs_failure *
hs_call_enter(const hs_options *options, hs_failure *failure, hs_call *call)
{
    failure = hs_enter(failure, &call->entry);
    hs_call_begin(options, call);
    return failure;
}

void
hs_call_leave(hs_call *call, int64_t n_pairs)
{
    hs_call_dismiss(call);
    hs_counters *counters = call->options.counters;
    if (counters != NULL) {
        *counters = call->done;
        memcpy(counters->bytes, call->account.total.bytes, sizeof counters->bytes);
        counters->bytes_peak = call->account.total.bytes_peak;
        counters->pairs = n_pairs;
    }
    hs_fpenv_leave(call->entry.saved);
}

void
hs_call_tell_limit(const hs_call *call, hs_status status, hs_failure *failure)
{
    if (status == HS_ERR_MEMORY) {
        failure->limit_bytes = call->account.limit;
    }
}

/*
 * Work from which on threads are worth starting, in points that have few neighbours: half a
 * millisecond. Two threads take as long as one at 5000 points with 52 neighbours, at 1000 with 419.
 */
#ifdef HS_TESTING
double hs_test_worth_threads = 0.0;
#define WORTH_THREADS hs_test_worth_threads
#else
#define WORTH_THREADS 10000.0
#endif
/* A pair takes as long as so much of such a point, and half as long again for 16 bytes of it. */
#define POINTS_PER_PAIR (1.0 / 45.0)
#define POINTS_PER_BYTE (POINTS_PER_PAIR / 32.0)

int
hs_call_threads(double n_points, const hs_options *options)
{
    const double least = options->threads < 0 ? (double)HS_POINTS_FOR_THREADS : WORTH_THREADS;
    const int    most = options->threads < 0 ? -options->threads : options->threads;
    return n_points < least ? 1 : most < HS_MOST_THREADS ? most : HS_MOST_THREADS;
}

void
hs_call_gather(hs_call *call, int64_t n_points)
{
    if (call->team == NULL && call->options.threads != 1) {
        call->team = hs_team_create(hs_call_threads((double)n_points, &call->options));
    }
}

void
hs_call_gather_for(hs_call *call, int64_t n_points, double n_pairs, bool are_kept)
{
    const hs_options *options = &call->options;
    if (call->team == NULL && (options->threads > 1 || are_kept)) {
        const int64_t bytes = hs_want_bytes(options->want, HS_MAX_DIM / 2, options->index_bytes);
        const double  of_pair = POINTS_PER_PAIR + POINTS_PER_BYTE * (double)bytes;
        call->team = hs_team_create(hs_call_threads((double)n_points + of_pair * n_pairs, options));
    }
}

void
hs_call_dismiss(hs_call *call)
{
    hs_team_free(call->team);
    call->team = NULL;
}

void
hs_call_add_counters(hs_call *call, const hs_counters *done)
{
    hs_counters *sum = &call->done;
    sum->groups += done->groups;
    sum->candidates += done->candidates;
    sum->ambiguous += done->ambiguous;
    sum->by_float64 += done->by_float64;
    sum->by_double_word += done->by_double_word;
    sum->by_integers += done->by_integers;
    sum->polls += done->polls;
}

void
hs_call_restart(hs_call *call)
{
    const hs_account before = call->account;
    if (call->choice == NULL) {
        hs_account_close(&call->account);
        hs_account_init(&call->account, &call->options);
        call->account.limit = before.limit;
        call->account.find_limit = before.find_limit;
    }
    call->done = (hs_counters){.polls = call->done.polls};
}

void
hs_call_detach(hs_call *call)
{
    hs_call_set_poll(NULL, NULL, call);
    call->options.counters = NULL;
    call->options.kernel = NULL;
    call->options.out = NULL;
    call->options.shells = NULL;
}

typedef struct pass {
    hs_slab_fn run;
    void      *context;
    int64_t    n;
    int64_t    round, n_rounds;
    int        n_strips; /* 0: slabs */
    hs_status  status[HS_SLABS];
} pass;

/* A slab; or part `round` of n_rounds nearly equal parts of a strip. The products fit: n * n / 2^17
 * is below 2^63 up to 2^40 pairs, whose i and j take 9 TB. */
static void
do_part(void *context, int64_t slab)
{
    pass   *doing = context;
    int64_t first = doing->round * HS_POLL_POINTS + slab * HS_SLAB_POINTS, end = doing->n;
    if (doing->n_strips > 0) {
        const int64_t begin = doing->n * slab / doing->n_strips;
        const int64_t length = doing->n * (slab + 1) / doing->n_strips - begin;
        first = begin + length * doing->round / doing->n_rounds;
        end = begin + length * (doing->round + 1) / doing->n_rounds;
    } else if (end - first > HS_SLAB_POINTS) {
        end = first + HS_SLAB_POINTS;
    }
    doing->status[slab] = doing->run(doing->context, (int)slab, first, end);
}

hs_status
hs_walk_points(hs_team *team, const hs_options *options, int64_t n, int n_strips, hs_slab_fn run,
               void *context)
{
    HS_ASSERT(n_strips >= 0 && n_strips <= HS_SLABS);
    if (n > 0 && (n_strips == 0 ? n <= HS_SLAB_POINTS : n_strips == 1 && n < HS_POLL_POINTS)) {
        return run(context, 0, 0, n);
    }
    pass doing = {.run = run, .context = context, .n = n, .n_strips = n_strips};
    doing.n_rounds = (n + HS_POLL_POINTS - 1) / HS_POLL_POINTS;
    for (; doing.round < doing.n_rounds; doing.round++) {
        const int64_t left = n - doing.round * HS_POLL_POINTS;
        const int64_t now = left < HS_POLL_POINTS ? left : HS_POLL_POINTS;
        const int64_t n_tasks = n_strips > 0 ? n_strips
                                             : (now + HS_SLAB_POINTS - 1) / HS_SLAB_POINTS;
        hs_team_run(team, n_tasks, do_part, &doing);
        for (int64_t task = 0; task < n_tasks; task++) {
            if (doing.status[task] != HS_OK) {
                return doing.status[task];
            }
        }
        const hs_status status = now == HS_POLL_POINTS ? hs_poll(options, 0.0) : HS_OK;
        if (status != HS_OK) {
            return status;
        }
    }
    return HS_OK;
}

int
hs_strips_for(const hs_team *team, int64_t n, int64_t least, int64_t n_counts)
{
    int n_strips = hs_team_size(team) < HS_SLABS ? hs_team_size(team) : HS_SLABS;
    while (n_strips > 1 && (n < n_strips * least || (n_strips - 1) * n_counts > n)) {
        n_strips--;
    }
    return n_strips;
}
