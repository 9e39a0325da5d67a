/* SPDX-License-Identifier: BSD-3-Clause */
/* recheck.c: rounds of slabs of the list, worked on by the team; each round's pairs are written at
 * its end. */
#include "recheck.h"

#include "../base/poll.h"

/* Slabs of a round for each of several threads: enough that none waits long for the others, and
 * their pairs still lie in the second-level cache when they are written. One thread alone takes one
 * slab after the other. */
#define SLABS_A_THREAD 8
#define MOST_SLABS     64
/* Work between two polls, in pairs: a few milliseconds. */
#define POLL_WORK (INT64_C(1) << 20)
/* A decision by integers takes as long as so many pairs, and d or D of a pair as so many. */
#define INTEGER_WORK 1000
#define MEASURE_WORK 8

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

/* One round of slabs. */
typedef struct round_of_slabs {
    const hs_recheck *recheck;
    hs_sifted        *slabs;
    int               n;
} round_of_slabs;

static void
sift_task(void *context, int64_t task)
{
    const round_of_slabs *doing = context;
    sift_slab(doing->recheck, &doing->slabs[task]);
}

static void
put_task(void *context, int64_t task)
{
    const round_of_slabs *doing = context;
    hs_recheck_put(doing->recheck, &doing->slabs[task]);
}

/* How far the list has been cut into slabs. */
typedef struct cut {
    int64_t pair, bundle;
} cut;

static void
cut_slabs(const hs_listing *listing, int most, cut *at, round_of_slabs *doing)
{
    for (doing->n = 0; doing->n < most && at->pair < listing->n_pairs; doing->n++) {
        const int64_t end = at->pair < listing->n_plain ? listing->n_plain : listing->n_pairs;
        hs_sifted    *slab = &doing->slabs[doing->n];
        slab->first = at->pair;
        slab->n = (int32_t)(end - at->pair < HS_SIFT ? end - at->pair : HS_SIFT);
        slab->bundles = listing->bundles + at->bundle;
        slab->status = HS_OK;
        slab->stages = (hs_stages){0};
        at->pair += slab->n;
        while (at->bundle < listing->n_bundles && listing->bundles[at->bundle].end <= at->pair) {
            at->bundle++;
        }
    }
}

/* Room for the hits of a round and places for them; *writes: they are to be written. */
static hs_status
place_hits(const hs_recheck *recheck, round_of_slabs *doing, int64_t end, int64_t *work,
           bool *writes)
{
    hs_output  *output = recheck->output;
    hs_counters done = {.pairs = 0};
    int64_t     n = 0;
    for (int s = 0; s < doing->n; s++) {
        hs_sifted *slab = &doing->slabs[s];
        slab->at = output->n_pairs + n;
        n += slab->n_hits;
        done.candidates += slab->n;
        done.ambiguous += slab->n_open;
        done.by_float64 += slab->stages.by_float64;
        done.by_double_word += slab->stages.by_double_word;
        done.by_integers += slab->stages.by_integers;
        *work += slab->n + INTEGER_WORK * slab->stages.by_integers +
                 (recheck->measures ? MEASURE_WORK * (int64_t)slab->n_hits : 0);
    }
    hs_call_note(recheck->call, &done);
    *writes = true;
    if (output->fixed) {
        *writes = output->n_pairs + n <= output->capacity;
        return HS_OK;
    }
    return hs_output_reserve(output, n, (double)end / (double)recheck->list->listing.n_pairs);
}

static hs_status
run_rounds(hs_recheck *recheck, hs_sifted *slabs, int most, hs_failure *failure)
{
    const hs_listing *listing = &recheck->list->listing;
    hs_output        *output = recheck->output;
    round_of_slabs    doing = {.recheck = recheck, .slabs = slabs};
    int64_t           work = 0;
    cut               at = {0};
    while (at.pair < listing->n_pairs) {
        bool writes;
        cut_slabs(listing, most, &at, &doing);
        hs_team_run(recheck->call->team, doing.n, sift_task, &doing);
        hs_status status = place_hits(recheck, &doing, at.pair, &work, &writes);
        if (status == HS_OK && writes) {
            hs_team_run(recheck->call->team, doing.n, put_task, &doing);
        }
        for (int s = 0; s < doing.n; s++) {
            if (status == HS_OK && doing.slabs[s].status != HS_OK) {
                status = doing.slabs[s].status;
                failure->row = doing.slabs[s].failed_point;
            }
            output->n_pairs += doing.slabs[s].n_hits;
        }
        if (status == HS_OK && work > POLL_WORK) {
            work = 0;
            status = hs_poll(&recheck->call->options, (double)at.pair / (double)listing->n_pairs);
        }
        if (status != HS_OK) {
            return status;
        }
    }
    return HS_OK;
}

static void
free_recheck(hs_recheck *recheck)
{
    hs_account *account = &recheck->call->account;
    hs_free(account, recheck->of_a);
    hs_free(account, recheck->few);
    hs_free(account, recheck->lagging);
    hs_free(account, recheck->lag);
    hs_free(account, recheck->image);
    hs_free(account, recheck->x);
    hs_free(account, recheck->counts);
    hs_free(account, recheck->offset);
    hs_free(account, recheck->y);
}

static int
slabs_of_a_round(const hs_recheck *recheck)
{
    const int64_t in_all =
        recheck->list->listing.n_pairs / HS_SIFT + 2; /* a slab ends at n_plain */
    const int     threads = hs_team_size(recheck->call->team);
    const int64_t wanted = threads > 1 ? (int64_t)SLABS_A_THREAD * threads : 1;
    return (int)(wanted < MOST_SLABS ? (wanted < in_all ? wanted : in_all) : MOST_SLABS);
}

hs_status
hs_recheck_run(hs_recheck *recheck, hs_failure *failure)
{
    hs_account *account = &recheck->call->account;
    const int   most = slabs_of_a_round(recheck);
    hs_sifted  *slabs = hs_alloc(account, HS_FOR_CANDIDATES, most, sizeof *slabs);
    const bool  more = recheck->measures || (recheck->output->columns & HS_WANT_SHIFT);
    recheck->numbers = !more && hs_sift_has_numbers(recheck->d);
    hs_status status = slabs == NULL ? HS_ERR_MEMORY : hs_recheck_prepare(recheck);
    if (status == HS_OK && recheck->measures) {
        status = hs_recheck_open_scene(recheck, failure);
    }
    if (status == HS_OK && !(recheck->given.cutoff == 0.0 && !recheck->given.inclusive)) {
        status = run_rounds(recheck, slabs, most, failure);
    }
    free_recheck(recheck);
    hs_free(account, slabs);
    return status;
}
