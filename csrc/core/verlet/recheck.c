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
sift_slab(const hs_refilter *refilter, hs_sifted *slab)
{
    const hs_listing   *listing = &refilter->list->listing;
    const bool          shifted = slab->first >= listing->n_plain;
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
    slab->n_hits = hs_sift(&pairs, slab->hits, slab->unsure, &slab->n_unsure);
    if (slab->n_unsure > 0) {
        hs_refilter_settle(refilter, slab->n_unsure, slab);
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
    hs_output  *output = refilter->output;
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
                 (refilter->measures ? MEASURE_WORK * (int64_t)slab->n_hits : 0);
    }
    hs_call_note(refilter->call, &done);
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
        hs_team_run(refilter->call->team, doing.n, sift_task, &doing);
        hs_status status = place_hits(refilter, &doing, first, &work, &writes);
        if (status == HS_OK && writes) {
            hs_team_run(refilter->call->team, doing.n, put_task, &doing);
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
            status = hs_poll(&refilter->call->options, (double)first / (double)listing->n_pairs);
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
    hs_account *account = &refilter->call->account;
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
    hs_account *account = &refilter->call->account;
    const int   wanted = SLABS_A_THREAD * hs_team_size(refilter->call->team);
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

/* The hits of a slab as pairs: i, j and S. */

/* S over all box vectors, zero on open ones; where only sorting needs it, the images alone, which
 * sort as S does and always fit. */
static void
put_shifts(const hs_refilter *refilter, hs_sifted *slab)
{
    const hs_listing *listing = &refilter->list->listing;
    const bool        keys_only = !(refilter->call->options.want & HS_WANT_SHIFT);
    const int         d = refilter->d, m = refilter->m;
    int32_t          *to = hs_refilter_column(refilter, HS_WANT_SHIFT, slab->at);
    const bool        plain = slab->first < listing->n_plain;
    memset(to, 0, (size_t)slab->n_hits * (size_t)d * sizeof *to);
    if (plain && (keys_only || refilter->counts == NULL)) {
        return;
    }
    for (int32_t h = 0; h < slab->n_hits; h++) {
        const int64_t  e = slab->first + slab->hits[h];
        const int32_t *image =
            plain ? NULL : listing->images.of + (int64_t)listing->code[e - listing->n_plain] * m;
        int64_t shift[HS_MAX_DIM];
        if (!keys_only) {
            hs_refilter_shift(refilter, e, shift);
        }
        for (int r = 0; r < m; r++) {
            const int64_t value = keys_only ? image[r] : shift[r];
            if (value < INT32_MIN || value > INT32_MAX) {
                slab->status = HS_ERR_SHIFT_RANGE;
                slab->failed_point = listing->order[listing->i[e]];
                return;
            }
            to[(int64_t)h * d + refilter->vector_of_row[r]] = (int32_t)value;
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
hs_refilter_put(const hs_refilter *refilter, hs_sifted *slab)
{
    const hs_listing *listing = &refilter->list->listing;
    const int         bytes = refilter->output->index_bytes;
    const int32_t    *order = listing->order;
    const int32_t    *i = listing->i + slab->first, *j = listing->j + slab->first;
    char             *both = hs_refilter_column(refilter, HS_WANT_BOTH, slab->at);
    put_numbers(i, order, slab, bytes, 1, hs_refilter_column(refilter, HS_WANT_I, slab->at));
    put_numbers(j, order, slab, bytes, 1, hs_refilter_column(refilter, HS_WANT_J, slab->at));
    put_numbers(i, order, slab, bytes, 2, both);
    put_numbers(j, order, slab, bytes, 2, both == NULL ? NULL : both + bytes);
    if (refilter->output->columns & HS_WANT_SHIFT) {
        put_shifts(refilter, slab);
    }
    if (refilter->measures && slab->n_hits > 0) {
        hs_refilter_measure(refilter, slab);
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
fill_open(const hs_refilter *refilter, const hs_sifted *slab, const uint16_t *unsure, int32_t n,
          open_batch *open)
{
    const hs_listing *listing = &refilter->list->listing;
    const hs_frame   *now = refilter->now;
    open->is_shifted = open->is_wide = false;
    for (int32_t b = 0; b < n; b++) {
        const int64_t e = slab->first + slab->hits[unsure[b]];
        hs_refilter_shift(refilter, e, open->shift[b]);
        for (int k = 0; k < refilter->d; k++) {
            const int64_t i = listing->order[listing->i[e]], j = listing->order[listing->j[e]];
            open->p[k][b] = hs_frame_entry(now->rows, now->points.real, i * refilter->d + k);
            open->q[k][b] = hs_frame_entry(now->rows, now->points.real, j * refilter->d + k);
        }
        for (int r = 0; r < refilter->m; r++) {
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
decide_open(const hs_refilter *refilter, const open_batch *open, int32_t n, hs_stages *stages,
            uint8_t *within)
{
    const hs_metric *metric = &refilter->given;
    uint8_t          verdict[HS_BATCH + HS_BATCH_PADDING] = {0};
    hs_batch         batch = {.n = n};
    for (int k = 0; k < refilter->d; k++) {
        batch.p[k] = open->p[k];
        batch.q[k] = open->q[k];
    }
    for (int r = 0; open->is_shifted && r < refilter->m; r++) {
        batch.shift[r] = open->times[r];
    }
    if (!open->is_wide) {
        refilter->call->kernel->judge(metric, &batch, verdict, stages);
    }
    for (int32_t b = 0; b < n; b++) {
        double p[HS_MAX_DIM], q[HS_MAX_DIM];
        if (verdict[b] != HS_UNDECIDED) {
            within[b] = verdict[b] == HS_WITHIN;
            continue;
        }
        for (int k = 0; k < refilter->d; k++) {
            p[k] = open->p[k][b];
            q[k] = open->q[k][b];
        }
        within[b] = open->is_wide ? hs_metric_within(metric, p, q, open->shift[b], stages)
                                  : hs_metric_settle(metric, p, q, open->shift[b], stages);
    }
}

void
hs_refilter_settle(const hs_refilter *refilter, int32_t n_unsure, hs_sifted *slab)
{
    open_batch open;
    int32_t    to = slab->unsure[0], from = to; /* hits before `from` have been moved to `to` */
    memset(&open, 0, sizeof open);              /* kernels read a little beyond the last pair */
    for (int32_t u = 0; u < n_unsure; u += HS_BATCH) {
        const int32_t n = n_unsure - u < HS_BATCH ? n_unsure - u : HS_BATCH;
        uint8_t       within[HS_BATCH];
        fill_open(refilter, slab, slab->unsure + u, n, &open);
        decide_open(refilter, &open, n, &slab->stages, within);
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
