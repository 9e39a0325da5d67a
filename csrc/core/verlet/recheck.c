/* SPDX-License-Identifier: BSD-3-Clause */
/* recheck.c: slabs of the list, one after the other by one thread, or several at once by threads
 * that write what they find in turn. */
#include "recheck.h"

#include "../base/outcome.h"
#include "../base/poll.h"
#include "../collect/crew.h"

/* Work between two polls, in pairs: a few milliseconds. */
#define POLL_WORK (INT64_C(1) << 20)
/* A decision by integers takes as long as so many pairs, and d or D of a pair as so many. */
#define INTEGER_WORK 1000
#define MEASURE_WORK 8

/* What the threads share. */
typedef struct recheck_job {
    hs_recheck *recheck;
    int64_t     n_plain, n_slabs; /* slabs: each ends where images begin, or is full */
    int64_t     in_range;         /* of them */
} recheck_job;

/* What one thread works with. */
typedef struct worker {
    hs_committer committer;
    recheck_job *job;
    hs_options   options; /* with this thread's poll */
    hs_recheck   recheck; /* the job's, with this thread's output */
    hs_sifted   *slab;    /* owned */
    hs_output    found;   /* owned; pairs that wait for their turn */
    int64_t      work;    /* since the last poll */
    hs_counters  done;
} worker;

/* Finds the hits of a slab. */
static void
sift_slab(const hs_recheck *recheck, hs_sifted *slab)
{
    const bool shifted = hs_sifted_has_images(recheck, slab);
    hs_sift    sift = {
           .ndim = recheck->d,
           .y = recheck->y,
           .offset = shifted ? recheck->offset : NULL,
           .j = recheck->list->listing.j,
           .bundles = slab->bundles,
           .first = slab->first,
           .end = slab->first + slab->n,
           .numbers = recheck->numbers,
           .limit = shifted ? recheck->shifted : recheck->plain,
           .hits = slab->hits,
           .point = slab->point,
           .hits_end = slab->hits_end,
           .open = slab->open,
    };
    recheck->call->kernel->sift(&sift);
    slab->n_bundles = sift.n_bundles;
    slab->n_hits = sift.n_hits;
    slab->n_open = sift.n_open;
    if (slab->n_open > 0) {
        hs_recheck_settle(recheck, slab);
    }
}

/* The first bundle that ends behind a pair of the list. */
static int64_t
bundle_of(const hs_listing *listing, int64_t pair)
{
    int64_t first = 0, end = listing->n_bundles;
    while (first < end) {
        const int64_t middle = first + (end - first) / 2;
        if (listing->bundles[middle].end <= pair) {
            first = middle + 1;
        } else {
            end = middle;
        }
    }
    return first;
}

static int64_t
slabs_of(int64_t n_pairs)
{
    return (n_pairs + HS_SIFT - 1) / HS_SIFT;
}

/* Pairs of slab s. */
static void
cut_slab(const recheck_job *job, int64_t s, hs_sifted *slab)
{
    const hs_listing *listing = &job->recheck->list->listing;
    const bool        plain = s < job->n_plain;
    const int64_t     end = plain ? listing->n_plain : listing->n_pairs;
    slab->first = plain ? s * HS_SIFT : listing->n_plain + (s - job->n_plain) * HS_SIFT;
    slab->n = (int32_t)(end - slab->first < HS_SIFT ? end - slab->first : HS_SIFT);
    slab->bundles = listing->bundles + bundle_of(listing, slab->first);
    slab->status = HS_OK;
    slab->stages = (hs_stages){0};
}

static void
note_slab(worker *me)
{
    const hs_sifted *slab = me->slab;
    me->done.candidates += slab->n;
    me->done.ambiguous += slab->n_open;
    me->done.by_float64 += slab->stages.by_float64;
    me->done.by_double_word += slab->stages.by_double_word;
    me->done.by_integers += slab->stages.by_integers;
    me->work += slab->n + INTEGER_WORK * slab->stages.by_integers +
                (me->recheck.measures ? MEASURE_WORK * (int64_t)slab->n_hits : 0);
}

/* Adds the hits of slab s to the thread's output. */
static hs_status
do_slab(worker *me, int64_t s)
{
    const hs_listing *listing = &me->job->recheck->list->listing;
    hs_output        *output = me->recheck.output;
    hs_sifted        *slab = me->slab;
    cut_slab(me->job, s, slab);
    sift_slab(&me->recheck, slab);
    note_slab(me);
    const double done = (double)(slab->first + slab->n) / (double)listing->n_pairs;
    hs_status    status = HS_OK;
    slab->at = output->n_pairs;
    if (!output->fixed) {
        status = hs_output_reserve(output, slab->n_hits, output == &me->found ? 0.0 : done);
    }
    if (status == HS_OK && (!output->fixed || slab->at + slab->n_hits <= output->capacity)) {
        hs_recheck_put(&me->recheck, slab);
        status = slab->status;
    }
    if (status == HS_OK) {
        output->n_pairs += slab->n_hits;
    } else if (status == HS_ERR_SHIFT_RANGE) {
        me->committer.failure.row = slab->failed_point;
    }
    if (status == HS_OK && me->work > POLL_WORK) {
        me->work = 0;
        status = hs_poll(&me->options, done);
    }
    return status;
}

/* A hs_range_fn. */
static hs_status
do_range(void *context, int64_t range)
{
    worker            *me = context;
    const recheck_job *job = me->job;
    const int64_t      first = range * job->in_range, left = job->n_slabs - first;
    const int64_t      end = first + (left < job->in_range ? left : job->in_range);
    hs_status          status = HS_OK;
    for (int64_t s = first; s < end && status == HS_OK; s++) {
        status = do_slab(me, s);
    }
    return status == HS_OK ? hs_commit(&me->committer, (double)end / (double)job->n_slabs, true)
                           : status;
}

/* A worker that writes to the output itself. */
static hs_status
open_alone(recheck_job *job, worker *me)
{
    hs_call *call = job->recheck->call;
    me->job = job;
    me->options = call->options;
    me->recheck = *job->recheck;
    me->slab = hs_alloc(&call->account, HS_FOR_CANDIDATES, 1, sizeof *me->slab);
    if (me->recheck.writes) {
        me->recheck.of_a = hs_alloc(&call->account, HS_FOR_CANDIDATES, 1, sizeof *me->recheck.of_a);
    }
    return me->slab == NULL || (me->recheck.writes && me->recheck.of_a == NULL) ? HS_ERR_MEMORY
                                                                                : HS_OK;
}

static void
free_scratch(worker *me)
{
    hs_account *account = &me->job->recheck->call->account;
    hs_free(account, me->recheck.of_a);
    hs_free(account, me->slab);
}

static hs_status
open_worker(void *context, void *place)
{
    recheck_job     *job = context;
    worker          *me = place;
    hs_recheck      *own = &me->recheck;
    const hs_status  status = open_alone(job, me);
    const hs_output *target = job->recheck->output;
    hs_output_init(NULL, target->ndim, target->columns, target->index_bytes, &me->found);
    me->committer.options = &me->options;
    me->committer.pairs = &me->found;
    own->output = &me->found;
    return status;
}

static void
close_worker(void *context, void *place)
{
    worker  *me = place;
    hs_call *call = ((recheck_job *)context)->recheck->call;
    hs_call_note(call, &me->done);
    hs_output_free(&me->found);
    free_scratch(me);
}

static hs_status
run_together(recheck_job *job, hs_failure *failure)
{
    hs_crew crew = {.call = job->recheck->call,
                    .job = job,
                    .worker_size = sizeof(worker),
                    .open = open_worker,
                    .close = close_worker,
                    .n_ranges = (job->n_slabs + job->in_range - 1) / job->in_range,
                    .search = do_range,
                    .output = job->recheck->output};
    return hs_crew_run(&crew, failure);
}

static hs_status
run_alone(recheck_job *job, hs_failure *failure)
{
    hs_call  *call = job->recheck->call;
    worker    me = {.committer.failure = HS_NO_FAILURE};
    hs_status status = open_alone(job, &me);
    for (int64_t s = 0; s < job->n_slabs && status == HS_OK; s++) {
        status = do_slab(&me, s);
    }
    if (status == HS_ERR_SHIFT_RANGE) {
        failure->row = me.committer.failure.row;
    }
    hs_call_note(call, &me.done);
    free_scratch(&me);
    return status;
}

static void
free_recheck(hs_recheck *recheck)
{
    hs_account *account = &recheck->call->account;
    hs_free(account, recheck->few);
    hs_free(account, recheck->lagging);
    hs_free(account, recheck->lag);
    hs_free(account, recheck->image);
    hs_free(account, recheck->x);
    hs_free(account, recheck->counts);
    hs_free(account, recheck->offset);
    hs_free(account, recheck->y);
}

hs_status
hs_recheck_run(hs_recheck *recheck, hs_failure *failure)
{
    const hs_listing *listing = &recheck->list->listing;
    const bool        more = recheck->measures || (recheck->output->columns & HS_WANT_SHIFT);
    recheck_job       job = {.recheck = recheck, .n_plain = slabs_of(listing->n_plain)};
    job.n_slabs = job.n_plain + slabs_of(listing->n_pairs - listing->n_plain);
    job.in_range = 1 + HS_RANGE_BYTES / (1 + HS_SIFT * hs_output_bytes_per_pair(recheck->output));
    recheck->shared = recheck->call->team != NULL && job.n_slabs > job.in_range;
    recheck->numbers = !more && hs_sift_has_numbers(recheck->d);
    hs_status status = hs_recheck_prepare(recheck);
    if (status == HS_OK && recheck->measures) {
        status = hs_recheck_open_scene(recheck, failure);
    }
    if (status == HS_OK && !(recheck->given.cutoff == 0.0 && !recheck->given.inclusive)) {
        status = recheck->shared ? run_together(&job, failure) : run_alone(&job, failure);
    }
    free_recheck(recheck);
    return status;
}
