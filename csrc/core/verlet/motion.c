/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * motion.c: the F, k and c of displacement.h, and what the longest displacement leaves of the skin.
 * Any F, k and c are right; good ones make displacements small. c is `base`, taken away before box
 * vectors are looked for, and `drift`, taken away behind that.
 */
#include "motion.h"

#include "../base/outcome.h"
#include "../base/poll.h"
#include "../exact/doubleword.h"

#include <math.h>
#include <string.h>

#define UNIT   0x1p-53
#define GROW   (1.0 + 0x1p-40) /* more than the roundings of any bound here */
#define SAMPLE 1024            /* points that the drift is guessed from */
/* A drift is taken away where the sample gets this much shorter: small ones are not worth it. */
#define WORTHWHILE 0.8
/* A displacement of this share of the box's smallest height may be a jump. */
#define JUMP 0.25

/* Points that all went far share that, or most of it: the displacement of one of them. */
static void
find_base(hs_tracking *track)
{
    const int64_t n = track->motion->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    int64_t       count = 0, far = 0;
    double        base[HS_MAX_DIM] = {0.0}, square, component;
    hs_tile       t;
    for (int64_t i = 0; track->m > 0 && i < n; i += HS_TILE * step, count += t.n) {
        const bool any = hs_look_at_tile(track, i, step, &t, &square, &component);
        for (int p = 0; any && p < t.n; p++) {
            if (hs_may_be_jump(track, &t, p)) {
                for (int k = 0; far == 0 && k < track->lattice.ndim; k++) {
                    base[k] = t.u[k][p];
                }
                far++;
            }
        }
    }
    if (2 * far > count) {
        track->has_base = true;
        memcpy(track->base, base, sizeof base);
    }
}

/* Displacements of the points of a sample without jumps: their sum and range in the first pass,
 * and the longest less drift. */
typedef struct sample {
    double sum[HS_MAX_DIM], lower[HS_MAX_DIM], upper[HS_MAX_DIM];
    double count, square, component;
} sample;

static void
take_sample(hs_tracking *track, const double *drift, sample *found)
{
    const int64_t n = track->motion->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    const int     d = track->motion->now->points.ndim;
    double        square, component;
    hs_tile       t;
    *found = (sample){.count = 0.0};
    for (int64_t i = 0; i < n; i += HS_TILE * step) {
        const bool any = hs_look_at_tile(track, i, step, &t, &square, &component);
        for (int p = 0; p < t.n; p++) {
            if (any && hs_may_be_jump(track, &t, p)) {
                int64_t given[HS_MAX_DIM];
                (void)hs_take_jump(track, &t, p,
                                   given); /* a failure shows again in the full pass */
            }
            for (int k = 0; k < d; k++) {
                const double u = t.u[k][p];
                found->sum[k] += u;
                found->lower[k] = i + p == 0 ? u : hs_smaller(u, found->lower[k]);
                found->upper[k] = i + p == 0 ? u : hs_larger(u, found->upper[k]);
            }
        }
        found->count += t.n;
        hs_measure_tile(&t, d, drift, &found->square, &found->component);
    }
}

/* The drift of a sample: the mean, or where the sample is all there is the middle of the range. */
static void
guess_drift(hs_tracking *track)
{
    sample    all, rest;
    double    drift[HS_MAX_DIM] = {0.0};
    const int d = track->motion->now->points.ndim;
    take_sample(track, drift, &all);
    for (int k = 0; all.count > 0.0 && k < d; k++) {
        drift[k] = track->motion->now->points.n <= SAMPLE ? 0.5 * all.lower[k] + 0.5 * all.upper[k]
                                                          : all.sum[k] / all.count;
    }
    take_sample(track, drift, &rest);
    if (rest.square < WORTHWHILE * WORTHWHILE * all.square) {
        track->has_drift = true;
        memcpy(track->drift, drift, sizeof drift);
    }
}

/* At least the longest |u| as computed: 2^-47 is more than the roundings of square and root. */
static double
longest_computed(const hs_tracking *track)
{
    if (track->component == 0.0) {
        return 0.0;
    }
    if (track->square >= 0x1p-900 && track->square <= 0x1p1000) {
        return sqrt(track->square) * (1.0 + 0x1p-47);
    }
    return hs_next_up(3.0 * track->component); /* sqrt(8) < 3; squares may be lost or infinite */
}

/* How far a computed u may be from the true one. Zero where nothing was rounded. */
static double
bound_rounding(const hs_tracking *track)
{
    const hs_motion *motion = track->motion;
    const int        d = motion->now->points.ndim;
    const double     now = motion->now->largest, built = motion->built->largest;
    double           bound = 0.0;
    for (int k = 0; k < d; k++) {
        bound += 2.0 * UNIT * fabs(track->drift[k]); /* of a u near it, and of the difference */
    }
    const double sizes = now + built * (track->deformed ? track->strain.column_sum : 1.0);
    if (track->deformed) { /* d products, d sums and a difference of these sizes */
        bound += (2 * d + 4) * UNIT * sizes + 0x1p-1050;
    }
    for (int k = 0; track->has_base && k < d; k++) { /* two differences */
        bound += 2.0 * UNIT * (sizes + fabs(track->base[k]));
    }
    if (track->jump_of != NULL) { /* a difference, wrapped: hs_wrap_point bounds its error */
        const double terms = 2 * track->m + 2;
        bound += 2.0 * UNIT * (sizes + track->magnitude) +
                 terms * terms * 0x1p-104 * track->magnitude + 0x1p-1050;
    }
    return 3.0 * bound * GROW; /* of each component; sqrt(d) < 3 */
}

/* What is left of the skin. Each step is rounded to the safe side. */
static double
find_margin(const hs_tracking *track)
{
    const hs_motion *motion = track->motion;
    double           reach = motion->radius;
    double           used = longest_computed(track) + bound_rounding(track);
    used = used > 0.0 ? 2.0 * hs_next_up(used) : used; /* nothing is nothing */
    if (track->deformed) {
        /* No two points are farther apart than 2 sqrt(d) times the largest coordinate. */
        const double apart = 6.0 * motion->built->largest;
        reach = hs_next_down(reach * track->strain.shrink);
        used = hs_next_up(used + hs_next_up(track->strain.residual * apart) * GROW);
    }
    const double room = reach - motion->cutoff;
    const double margin = (room > 0.0 && motion->cutoff > 0.0 ? hs_next_down(room) : room) - used;
    return margin > 0.0 && used > 0.0 ? hs_next_down(margin) : margin;
}

static hs_status
start(const hs_motion *motion, hs_store *jumps, hs_tracking *track)
{
    int row[HS_MAX_DIM];
    memset(track, 0, sizeof *track);
    track->motion = motion;
    track->jumps = jumps;
    track->m = hs_frame_periodic(motion->now, row);
    track->jump = INFINITY;
    if (track->m == 0) {
        return HS_OK;
    }
    track->deformed = !hs_frames_share_box(motion->built, motion->now);
    if (track->deformed &&
        !hs_strain_find(&motion->built->box, &motion->now->box, &track->strain)) {
        return HS_UNSERVED;
    }
    hs_lattice_init(&motion->now->box, motion->now->points.ndim, hs_scale_of(0), &track->lattice);
    for (int k = 0; k < track->lattice.ndim; k++) {
        if (track->lattice.row_of_axis[k] >= 0) {
            track->jump = hs_smaller(JUMP * track->lattice.period[k], track->jump);
        }
    }
    return track->jump > 0.0 ? HS_OK : HS_UNSERVED;
}

static hs_status
measure_all(hs_tracking *track, const hs_options *options)
{
    const int64_t n = track->motion->now->points.n;
    hs_tile       t;
    for (int64_t first = 0; first < n; first += HS_TILE) {
        double     square, component;
        const bool any = hs_look_at_tile(track, first, 1, &t, &square, &component);
        hs_status  status = any ? hs_take_jumps(track, &t) : HS_OK;
        if (status == HS_OK && (any || track->has_drift)) {
            hs_measure_tile(&t, track->motion->now->points.ndim, track->drift, &track->square,
                            &track->component);
        } else {
            track->square = hs_larger(square, track->square);
            track->component = hs_larger(component, track->component);
        }
        if (status == HS_OK && (first + HS_TILE) % HS_POLL_POINTS == 0) {
            status = hs_poll(options, 0.0);
        }
        if (status != HS_OK) {
            return status;
        }
    }
    return HS_OK;
}

hs_status
hs_motion_margin(const hs_motion *motion, const hs_options *options, double *margin, bool *jumped,
                 hs_store *jumps)
{
    hs_tracking track;
    hs_status   status = start(motion, jumps, &track);
    *margin = -INFINITY;
    *jumped = false;
    if (status == HS_OK) {
        find_base(&track);
        guess_drift(&track);
        status = measure_all(&track, options);
    }
    if (status == HS_OK) {
        const double found = find_margin(&track);
        *margin = found == found ? found : -INFINITY;
        *jumped = track.jump_of != NULL;
    }
    return status == HS_UNSERVED ? HS_OK : status;
}
