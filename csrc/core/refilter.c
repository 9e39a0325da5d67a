/* SPDX-License-Identifier: BSD-3-Clause */
/* refilter.c: see refilter.h. The points as floats, the slabs, and who works on them. */
#include "refilter.h"

#include "exact_float.h"
#include "fpenv.h"
#include "pairs.h"
#include "poll.h"
#include "sort.h"

#include <math.h>
#include <string.h>

#define UNIT 0x1p-53
/* Slabs of a round for each thread: enough that none waits long for the others, and their pairs
 * still lie in the second-level cache when they are written. */
#define SLABS_A_THREAD 8
#define MOST_SLABS 64
/* Work between two questions to the caller, in pairs: a few milliseconds. */
#define POLL_WORK (INT64_C(1) << 20)
/* A decision by integers takes as long as so many pairs. */
#define INTEGER_WORK 1000
/* Points that the middle of all is guessed from. */
#define SAMPLE 1024
/* Cutoffs between 2^-20 and 2^20 are left alone, as in scene.c. */
#define ORDINARY_EXPONENT 20

/* A point in the frame that images are relative to, in float64: r - counts h. */
HS_ALWAYS_INLINE void
place_of(const hs_refilter *refilter, const hs_real real, int64_t i, const int d, double *z)
{
    for (int k = 0; k < d; k++) {
        z[k] = hs_frame_entry(refilter->now->rows, real, i * d + k);
    }
    for (int r = 0; refilter->counts != NULL && r < refilter->m; r++) {
        const double count = (double)refilter->counts[i * refilter->m + r];
        for (int k = 0; count != 0.0 && k < d; k++) {
            z[k] -= count * refilter->given.rows[r][k];
        }
    }
}

/* The middle of some points: floats lose least around it. */
static void
find_centre(const hs_refilter *refilter, double *centre)
{
    const int64_t n = refilter->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    double        lower[HS_MAX_DIM], upper[HS_MAX_DIM], z[HS_MAX_DIM];
    for (int k = 0; k < refilter->d; k++) {
        lower[k] = upper[k] = 0.0;
    }
    for (int64_t i = 0; i < n; i += step) {
        place_of(refilter, refilter->now->points.real, i, refilter->d, z);
        for (int k = 0; k < refilter->d; k++) {
            lower[k] = i == 0 ? z[k] : hs_smaller(z[k], lower[k]);
            upper[k] = i == 0 ? z[k] : hs_larger(z[k], upper[k]);
        }
    }
    for (int k = 0; k < refilter->d; k++) {
        centre[k] = 0.5 * lower[k] + 0.5 * upper[k];
    }
}

/* Rows of floats; returns the largest, infinity or NaN included. */
HS_ALWAYS_INLINE double
put_floats(const hs_refilter *refilter, hs_scale scale, const double *centre, const hs_real real,
           const int d)
{
    const int stride = hs_sift_stride(d);
    double    largest = 0.0, poison = 0.0;
    for (int64_t i = 0; i < refilter->now->points.n; i++) {
        double z[HS_MAX_DIM];
        float *y = refilter->y + i * stride;
        place_of(refilter, real, i, d, z);
        for (int k = 0; k < stride; k++) {
            const float entry =
                k < d ? (float)hs_scale_apply(scale, z[k] - centre[k]) : 0.0f;
            y[k] = entry;
            largest = hs_larger(fabs((double)entry), largest);
            poison += (double)(entry - entry);
        }
    }
    return largest + poison;
}

static double
put_points(const hs_refilter *refilter, hs_scale scale, const double *centre)
{
    const hs_real real = refilter->now->points.real;
    switch (4 * (real == HS_FLOAT32) + (refilter->d == 2 || refilter->d == 3 ? refilter->d : 0)) {
    case 2: return put_floats(refilter, scale, centre, HS_FLOAT64, 2);
    case 3: return put_floats(refilter, scale, centre, HS_FLOAT64, 3);
    case 6: return put_floats(refilter, scale, centre, HS_FLOAT32, 2);
    case 7: return put_floats(refilter, scale, centre, HS_FLOAT32, 3);
    default: return put_floats(refilter, scale, centre, real, refilter->d);
    }
}

/* Images as floats. *largest: their largest component; *size: at least the sum of absolute terms of
 * any. Both unscaled are at most infinite, never NaN. */
static void
put_offsets(const hs_refilter *refilter, hs_scale scale, double *largest, double *size)
{
    const hs_images *images = &refilter->list->listing.images;
    const int        stride = hs_sift_stride(refilter->d);
    *largest = *size = 0.0;
    for (int64_t image = 0; image < images->n; image++) {
        for (int k = 0; k < stride; k++) {
            double sum = 0.0, terms = 0.0;
            for (int r = 0; k < refilter->d && r < refilter->m; r++) {
                const double term =
                    images->of[image * refilter->m + r] *
                    hs_scale_apply(scale, refilter->given.rows[r][k]);
                sum += term;
                terms += fabs(term);
            }
            const float offset = (float)sum;
            refilter->offset[image * stride + k] = offset;
            *largest = hs_larger(fabs((double)offset), *largest);
            *size = hs_larger(terms, *size);
        }
    }
}

/* How far the counted-off coordinates may be from the true ones: m products and sums. */
static double
bound_counts(const hs_refilter *refilter, hs_scale scale)
{
    double most = 0.0, size = 0.0;
    if (refilter->counts == NULL) {
        return 0.0;
    }
    for (int64_t e = 0; e < refilter->now->points.n * refilter->m; e++) {
        most = hs_larger(fabs((double)refilter->counts[e]), most);
    }
    for (int r = 0; r < refilter->m; r++) {
        double longest = 0.0;
        for (int k = 0; k < refilter->d; k++) {
            longest = hs_larger(fabs(refilter->given.rows[r][k]), longest);
        }
        size += longest;
    }
    return (2 * refilter->m + 4) * UNIT *
           (hs_scale_apply(scale, refilter->now->largest) + most * hs_scale_apply(scale, size));
}

/*
 * Thresholds of filter.h, whose direct form has a candidate y = y_j + offset and a point q = y_i.
 * Beside what it knows of: y_j - y_i is rounded before the offset is added (u of twice the
 * largest), the offset is rounded to a float (u of it), and was summed in float64.
 */
static void
set_thresholds(hs_refilter *refilter, hs_scale scale, double largest, double error)
{
    const double cutoff = hs_scale_apply(scale, refilter->given.cutoff);
    const double u = 0x1p-24, tiny = 0x1p-100; /* more than scaling and flushing lose */
    double       offset, size;
    refilter->plain = hs_thresholds_of(refilter->d, cutoff, 2.0 * largest, error + tiny);
    put_offsets(refilter, scale, &offset, &size);
    const double more = u * (2.0 * largest + offset) * (1.0 + 0x1p-20) +
                        (2 * refilter->m + 2) * UNIT * size;
    refilter->shifted = hs_thresholds_of(refilter->d, cutoff, 2.0 * largest + offset,
                                         error + tiny + more);
}

hs_status
hs_refilter_prepare(hs_refilter *refilter)
{
    hs_account   *account = &refilter->search->account;
    const int     stride = hs_sift_stride(refilter->d);
    const double  cutoff = refilter->given.cutoff;
    const int     exponent = cutoff > 0.0 ? ilogb(cutoff) : 0;
    const bool    ordinary = exponent >= -ORDINARY_EXPONENT && exponent <= ORDINARY_EXPONENT;
    const hs_scale scale = hs_scale_of(ordinary ? 0 : exponent);
    double        centre[HS_MAX_DIM];
    refilter->y = hs_alloc(account, HS_FOR_POINTS, refilter->now->points.n * stride, sizeof(float));
    refilter->offset = hs_alloc(account, HS_FOR_STENCIL,
                                refilter->list->listing.images.n * stride, sizeof(float));
    if (refilter->y == NULL || refilter->offset == NULL) {
        return HS_ERR_MEMORY;
    }
    find_centre(refilter, centre);
    const double largest = put_points(refilter, scale, centre);
    set_thresholds(refilter, scale, largest, bound_counts(refilter, scale));
    return HS_OK;
}

void
hs_refilter_free(hs_refilter *refilter)
{
    hs_free(&refilter->search->account, refilter->offset);
    hs_free(&refilter->search->account, refilter->y);
    refilter->y = refilter->offset = NULL;
}

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
            const int64_t i = listing->i[e], j = listing->j[e];
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
        refilter->search->kernel->judge(metric, &batch, verdict, stages);
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

/* Decides the unsure hits of a slab, and takes those that are beyond the cutoff from the hits. */
static HS_NO_INLINE void
settle(const hs_refilter *refilter, int32_t n_unsure, hs_sifted *slab)
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
    memmove(slab->hits + to, slab->hits + from,
            (size_t)(slab->n_hits - from) * sizeof *slab->hits);
    slab->n_hits -= from - to;
}

void
hs_refilter_sift(const hs_refilter *refilter, hs_sifted *slab)
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
        settle(refilter, n_unsure, slab);
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
    hs_refilter_sift(doing->refilter, &doing->slabs[task]);
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
                 (refilter->measures ? 8 * (int64_t)slab->n_hits : 0); /* as long as so many */
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

hs_status
hs_refilter_run(hs_refilter *refilter, hs_failure *failure)
{
    hs_account *account = &refilter->search->account;
    const int   wanted = SLABS_A_THREAD * hs_team_size(refilter->search->team);
    const int   most = wanted < MOST_SLABS ? wanted : MOST_SLABS;
    hs_sifted  *slabs = hs_alloc(account, HS_FOR_CANDIDATES, most, sizeof *slabs);
    hs_status   status = slabs == NULL ? HS_ERR_MEMORY : hs_refilter_prepare(refilter);
    if (status == HS_OK && !(refilter->given.cutoff == 0.0 && !refilter->given.inclusive)) {
        status = run_rounds(refilter, slabs, most, failure);
    }
    hs_refilter_free(refilter);
    hs_free(account, slabs);
    return status;
}
