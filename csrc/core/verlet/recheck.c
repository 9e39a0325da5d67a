/* SPDX-License-Identifier: BSD-3-Clause */
/* recheck.c: rounds of slabs of the list, worked on by the team; each round's pairs are written at
 * its end. */
#include "recheck.h"

#include <string.h>

#include "../base/poll.h"
#include "../exact/metric_float.h"

/* Slabs of a round for each thread: enough that none waits long for the others, and their pairs
 * still lie in the second-level cache when they are written. */
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
    const hs_listing   *listing = &recheck->list->listing;
    const bool          shifted = slab->first >= listing->n_plain;
    const hs_sift_pairs pairs = {
        .y = recheck->y,
        .stride = hs_sift_stride(recheck->d),
        .i = listing->i + slab->first,
        .j = listing->j + slab->first,
        .code = shifted ? listing->code + (slab->first - listing->n_plain) : NULL,
        .offset = recheck->offset,
        .n = slab->n,
        .limit = shifted ? recheck->shifted : recheck->plain,
    };
    slab->n_hits = hs_sift(&pairs, slab->hits, slab->unsure, &slab->n_unsure);
    if (slab->n_unsure > 0) {
        hs_recheck_settle(recheck, slab->n_unsure, slab);
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
        done.ambiguous += slab->n_unsure;
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
    for (int64_t first = 0; first < listing->n_pairs;) {
        bool writes;
        first = cut_slabs(listing, first, most, &doing);
        hs_team_run(recheck->call->team, doing.n, sift_task, &doing);
        hs_status status = place_hits(recheck, &doing, first, &work, &writes);
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
            status = hs_poll(&recheck->call->options, (double)first / (double)listing->n_pairs);
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
    hs_account *account = &recheck->call->account;
    const int   wanted = SLABS_A_THREAD * hs_team_size(recheck->call->team);
    const int   most = wanted < MOST_SLABS ? wanted : MOST_SLABS;
    hs_sifted  *slabs = hs_alloc(account, HS_FOR_CANDIDATES, most, sizeof *slabs);
    hs_status   status = slabs == NULL ? HS_ERR_MEMORY : hs_recheck_prepare(recheck);
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

/* The hits of a slab as pairs: i, j and S. */

/* S over all box vectors, zero on open ones; where only sorting needs it, the images alone, which
 * sort as S does and always fit. */
static void
put_shifts(const hs_recheck *recheck, hs_sifted *slab)
{
    const hs_listing *listing = &recheck->list->listing;
    const bool        keys_only = !(recheck->call->options.want & HS_WANT_SHIFT);
    const int         d = recheck->d, m = recheck->m;
    int32_t          *to = hs_recheck_column(recheck, HS_WANT_SHIFT, slab->at);
    const bool        plain = slab->first < listing->n_plain;
    memset(to, 0, (size_t)slab->n_hits * (size_t)d * sizeof *to);
    if (plain && (keys_only || recheck->counts == NULL)) {
        return;
    }
    for (int32_t h = 0; h < slab->n_hits; h++) {
        const int64_t  e = slab->first + slab->hits[h];
        const int32_t *image =
            plain ? NULL : listing->images.of + (int64_t)listing->code[e - listing->n_plain] * m;
        int64_t shift[HS_MAX_DIM];
        if (!keys_only) {
            hs_recheck_shift(recheck, e, shift);
        }
        for (int r = 0; r < m; r++) {
            const int64_t value = keys_only ? image[r] : shift[r];
            if (value < INT32_MIN || value > INT32_MAX) {
                slab->status = HS_ERR_SHIFT_RANGE;
                slab->failed_point = listing->order[listing->i[e]];
                return;
            }
            to[(int64_t)h * d + recheck->vector_of_row[r]] = (int32_t)value;
        }
    }
}

/* The caller's number of each hit's point, to every `step`-th index. */
HS_ALWAYS_INLINE void
put_numbers(const int32_t *places, const int32_t *order, const hs_sifted *slab, int index_bytes,
            const int step, void *to)
{
    const uint16_t *hits = slab->hits;
    if (to == NULL) {
        return;
    }
    if (index_bytes == 8) {
        int64_t *wide = to;
        for (int32_t h = 0; h < slab->n_hits; h++) {
            wide[(int64_t)h * step] = order[places[hits[h]]];
        }
    } else {
        int32_t *narrow = to;
        for (int32_t h = 0; h < slab->n_hits; h++) {
            narrow[(int64_t)h * step] = order[places[hits[h]]];
        }
    }
}

void
hs_recheck_put(const hs_recheck *recheck, hs_sifted *slab)
{
    const hs_listing *listing = &recheck->list->listing;
    const int         bytes = recheck->output->index_bytes;
    const int32_t    *order = listing->order;
    const int32_t    *i = listing->i + slab->first, *j = listing->j + slab->first;
    char             *both = hs_recheck_column(recheck, HS_WANT_BOTH, slab->at);
    put_numbers(i, order, slab, bytes, 1, hs_recheck_column(recheck, HS_WANT_I, slab->at));
    put_numbers(j, order, slab, bytes, 1, hs_recheck_column(recheck, HS_WANT_J, slab->at));
    put_numbers(i, order, slab, bytes, 2, both);
    put_numbers(j, order, slab, bytes, 2, both == NULL ? NULL : both + bytes);
    if (recheck->output->columns & HS_WANT_SHIFT) {
        put_shifts(recheck, slab);
    }
    if (recheck->measures && slab->n_hits > 0) {
        hs_recheck_measure(recheck, slab);
    }
}

/* The exact decision of the listed pairs that float32 cannot tell. */

/* Pairs of a batch that are to be decided, as the kernels take them. */
typedef struct open_batch {
    double  p[HS_MAX_DIM][HS_BATCH + HS_BATCH_PADDING];
    double  q[HS_MAX_DIM][HS_BATCH + HS_BATCH_PADDING];
    double  times[HS_MAX_DIM][HS_BATCH + HS_BATCH_PADDING];
    int64_t shift[HS_BATCH][HS_MAX_DIM];
    bool    is_shifted, is_wide;
} open_batch;

static void
fill_open(const hs_recheck *recheck, const hs_sifted *slab, const uint16_t *unsure, int32_t n,
          open_batch *open)
{
    const hs_listing *listing = &recheck->list->listing;
    const hs_frame   *now = recheck->now;
    open->is_shifted = open->is_wide = false;
    for (int32_t b = 0; b < n; b++) {
        const int64_t e = slab->first + slab->hits[unsure[b]];
        hs_recheck_shift(recheck, e, open->shift[b]);
        for (int k = 0; k < recheck->d; k++) {
            const int64_t i = listing->order[listing->i[e]], j = listing->order[listing->j[e]];
            open->p[k][b] = hs_frame_entry(now->rows, now->points.real, i * recheck->d + k);
            open->q[k][b] = hs_frame_entry(now->rows, now->points.real, j * recheck->d + k);
        }
        for (int r = 0; r < recheck->m; r++) {
            const int64_t shift = open->shift[b][r];
            open->times[r][b] = (double)shift;
            open->is_shifted = open->is_shifted || shift != 0;
            open->is_wide = open->is_wide || shift > INT64_C(1) << 53 ||
                            shift < -(INT64_C(1) << 53);
        }
    }
}

/* Whether each of n pairs is within the cutoff: by the kernel, and what that leaves one by one. */
static void
decide_open(const hs_recheck *recheck, const open_batch *open, int32_t n, hs_stages *stages,
            uint8_t *within)
{
    const hs_metric *metric = &recheck->given;
    uint8_t          verdict[HS_BATCH + HS_BATCH_PADDING] = {0};
    hs_batch         batch = {.n = n};
    for (int k = 0; k < recheck->d; k++) {
        batch.p[k] = open->p[k];
        batch.q[k] = open->q[k];
    }
    for (int r = 0; open->is_shifted && r < recheck->m; r++) {
        batch.shift[r] = open->times[r];
    }
    if (!open->is_wide) {
        recheck->call->kernel->judge(metric, &batch, verdict, stages);
    }
    for (int32_t b = 0; b < n; b++) {
        double p[HS_MAX_DIM], q[HS_MAX_DIM];
        if (verdict[b] != HS_UNDECIDED) {
            within[b] = verdict[b] == HS_WITHIN;
            continue;
        }
        for (int k = 0; k < recheck->d; k++) {
            p[k] = open->p[k][b];
            q[k] = open->q[k][b];
        }
        within[b] = open->is_wide ? hs_metric_within(metric, p, q, open->shift[b], stages)
                                  : hs_metric_settle(metric, p, q, open->shift[b], stages);
    }
}

void
hs_recheck_settle(const hs_recheck *recheck, int32_t n_unsure, hs_sifted *slab)
{
    open_batch open;
    int32_t    to = slab->unsure[0], from = to; /* hits before `from` have been moved to `to` */
    memset(&open, 0, sizeof open);              /* kernels read a little beyond the last pair */
    for (int32_t u = 0; u < n_unsure; u += HS_BATCH) {
        const int32_t n = n_unsure - u < HS_BATCH ? n_unsure - u : HS_BATCH;
        uint8_t       within[HS_BATCH];
        fill_open(recheck, slab, slab->unsure + u, n, &open);
        decide_open(recheck, &open, n, &slab->stages, within);
        for (int32_t b = 0; b < n; b++) {
            const int32_t at = slab->unsure[u + b];
            memmove(slab->hits + to, slab->hits + from, (size_t)(at - from) * sizeof *slab->hits);
            to += at - from;
            slab->hits[to] = slab->hits[at];
            to += within[b];
            from = at + 1;
        }
    }
    memmove(slab->hits + to, slab->hits + from, (size_t)(slab->n_hits - from) * sizeof *slab->hits);
    slab->n_hits -= from - to;
}
