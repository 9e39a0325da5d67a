/* SPDX-License-Identifier: BSD-3-Clause */
/* recheck.c: see recheck.h. The list in slabs, rounds of them, and who works on them. */
#include "recheck.h"

#include "../base/poll.h"

/* Slabs of a round for each thread: enough that none waits long for the others, and their pairs
 * still lie in the second-level cache when they are written. */
#define SLABS_A_THREAD 8
#define MOST_SLABS 64
/* Work between two questions to the caller, in pairs: a few milliseconds. */
#define POLL_WORK (INT64_C(1) << 20)
/* A decision by integers takes as long as so many pairs, and d or D of a pair as so many. */
#define INTEGER_WORK 1000
#define MEASURE_WORK 8

/* Finds the hits of a slab. */
static void
sift_slab(const hs_refilter *refilter, hs_sifted *slab)
{
    const hs_listing *listing = &refilter->list->listing;
    const bool        shifted = slab->first >= listing->n_plain;
    const hs_sift_pairs pairs = {
        .y = refilter->y,
        .stride = hs_sift_stride(refilter->d),
        .i = listing->i + slab->first,
        .j = listing->j + slab->first,
        .code = shifted ? listing->code + (slab->first - listing->n_plain) : NULL,
        .offset = refilter->offset,
        .n = slab->n,
        .limit = shifted ? refilter->shifted : refilter->plain,
    };
    int32_t n_unsure;
    slab->n_hits = hs_sift(&pairs, slab->hits, slab->unsure, &n_unsure);
    if (n_unsure > 0) {
        hs_refilter_settle(refilter, n_unsure, slab);
    }
}

/* One round of slabs. */
typedef struct round_of_slabs {
    const hs_refilter *refilter;
    hs_sifted         *slabs;
    int                n;
} round_of_slabs;

static void
sift_task(void *context, int64_t task)
{
    const round_of_slabs *doing = context;
    sift_slab(doing->refilter, &doing->slabs[task]);
}

static void
put_task(void *context, int64_t task)
{
    const round_of_slabs *doing = context;
    hs_refilter_put(doing->refilter, &doing->slabs[task]);
}

/* Cuts the list from `first` on into slabs; returns where they end. */
static int64_t
cut_slabs(const hs_listing *listing, int64_t first, int most, round_of_slabs *doing)
{
    for (doing->n = 0; doing->n < most && first < listing->n_pairs; doing->n++) {
        const int64_t end = first < listing->n_plain ? listing->n_plain : listing->n_pairs;
        hs_sifted    *slab = &doing->slabs[doing->n];
        slab->first = first;
        slab->n = (int32_t)(end - first < HS_SIFT ? end - first : HS_SIFT);
        slab->status = HS_OK;
        slab->stages = (hs_stages){0};
        first += slab->n;
    }
    return first;
}

/* Room for the hits of a round and places for them; *writes: they are to be written. */
static hs_status
place_hits(const hs_refilter *refilter, round_of_slabs *doing, int64_t end, int64_t *work,
           bool *writes)
{
    hs_output   *output = refilter->output;
    hs_counters *walked = &refilter->search->walked;
    int64_t      n = 0;
    for (int s = 0; s < doing->n; s++) {
        hs_sifted *slab = &doing->slabs[s];
        slab->at = output->n_pairs + n;
        n += slab->n_hits;
        walked->candidates += slab->n;
        walked->by_float64 += slab->stages.by_float64;
        walked->by_double_word += slab->stages.by_double_word;
        walked->by_integers += slab->stages.by_integers;
        *work += slab->n + INTEGER_WORK * slab->stages.by_integers +
                 (refilter->measures ? MEASURE_WORK * (int64_t)slab->n_hits : 0);
    }
    *writes = true;
    if (output->fixed) {
        *writes = output->n_pairs + n <= output->capacity;
        return HS_OK;
    }
    return hs_output_reserve(output, n, (double)end / (double)refilter->list->listing.n_pairs);
}

static hs_status
run_rounds(hs_refilter *refilter, hs_sifted *slabs, int most, hs_failure *failure)
{
    const hs_listing *listing = &refilter->list->listing;
    hs_output        *output = refilter->output;
    round_of_slabs    doing = {.refilter = refilter, .slabs = slabs};
    int64_t           work = 0;
    for (int64_t first = 0; first < listing->n_pairs;) {
        bool writes;
        first = cut_slabs(listing, first, most, &doing);
        hs_team_run(refilter->search->team, doing.n, sift_task, &doing);
        hs_status status = place_hits(refilter, &doing, first, &work, &writes);
        if (status == HS_OK && writes) {
            hs_team_run(refilter->search->team, doing.n, put_task, &doing);
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
            status = hs_poll(&refilter->search->options,
                             (double)first / (double)listing->n_pairs);
        }
        if (status != HS_OK) {
            return status;
        }
    }
    return HS_OK;
}

static void
free_refilter(hs_refilter *refilter)
{
    hs_account *account = &refilter->search->account;
    hs_free(account, refilter->lagging);
    hs_free(account, refilter->lag);
    hs_free(account, refilter->image);
    hs_free(account, refilter->x);
    hs_free(account, refilter->counts);
    hs_free(account, refilter->offset);
    hs_free(account, refilter->y);
}

hs_status
hs_refilter_run(hs_refilter *refilter, hs_failure *failure)
{
    hs_account *account = &refilter->search->account;
    const int   wanted = SLABS_A_THREAD * hs_team_size(refilter->search->team);
    const int   most = wanted < MOST_SLABS ? wanted : MOST_SLABS;
    hs_sifted  *slabs = hs_alloc(account, HS_FOR_CANDIDATES, most, sizeof *slabs);
    hs_status   status = slabs == NULL ? HS_ERR_MEMORY : hs_refilter_prepare(refilter);
    if (status == HS_OK && refilter->measures) {
        status = hs_refilter_open_scene(refilter, failure);
    }
    if (status == HS_OK && !(refilter->given.cutoff == 0.0 && !refilter->given.inclusive)) {
        status = run_rounds(refilter, slabs, most, failure);
    }
    free_refilter(refilter);
    hs_free(account, slabs);
    return status;
}
