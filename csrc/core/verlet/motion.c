/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * motion.c: the displacement of point i is u_i = r_i - r0_i F - k_i h - c: what is left when the
 * deformation of the box, whole box vectors and what all points share are taken away. Any F, k and
 * c are right; good ones make it small. c is `base`, taken away before box vectors are looked for,
 * and `drift`, taken away behind that.
 */
#include "motion.h"

#include "../base/outcome.h"
#include "../base/poll.h"
#include "../exact/doubleword.h"
#include "../box/strain.h"
#include "../box/wrap.h"

#include <math.h>
#include <string.h>

#define UNIT   0x1p-53
#define GROW   (1.0 + 0x1p-40) /* more than the roundings of any bound here */
#define TILE   64              /* points whose displacements are held at a time */
#define SAMPLE 1024            /* points that the drift is guessed from */
/* A drift is taken away where the sample gets this much shorter: small ones are not worth it. */
#define WORTHWHILE 0.8
/* A displacement of this share of the box's smallest height may be a jump. */
#define JUMP 0.25

typedef struct tracking {
    const hs_motion *motion;
    bool             deformed;
    hs_strain        strain;
    hs_lattice       lattice; /* of the box now */
    int              m;
    double           jump; /* longer displacements are looked at; infinity: none */
    bool             has_base;
    double           base[HS_MAX_DIM];
    double           drift[HS_MAX_DIM];
    hs_store        *jumps;
    int64_t         *jump_of;   /* in it, m a point; NULL: there is none yet */
    double           square;    /* largest |u|^2 ... */
    double           component; /* ... and |u_k| */
    double           magnitude; /* of the terms of wrapping */
} tracking;

/* u of the points of one tile, one array for each axis, without drift. */
typedef struct tile {
    int64_t first;
    int     n;
    double  u[HS_MAX_DIM][TILE];
} tile;

HS_ALWAYS_INLINE void
subtract(const tracking *track, tile *t, const hs_real real, const int d, const bool deformed)
{
    const void   *now = track->motion->now->rows, *built = track->motion->built->rows;
    const int64_t first = t->first * d;
    for (int p = 0; p < t->n; p++) {
        for (int k = 0; k < d; k++) {
            const int64_t e = first + p * d + k;
            double        before = 0.0;
            for (int c = 0; deformed && c < d; c++) {
                before += hs_frame_entry(built, real, e - k + c) * track->strain.F[c][k];
            }
            before = deformed ? before : hs_frame_entry(built, real, e);
            t->u[k][p] = hs_frame_entry(now, real, e) - before;
        }
    }
}

/* subtract, with constants where that pays. */
static void
find_displacements(const tracking *track, tile *t)
{
    const hs_real real = track->motion->now->points.real;
    const int     d = track->motion->now->points.ndim;
    switch (8 * (real == HS_FLOAT32) + 4 * track->deformed + (d == 2 || d == 3 ? d : 0)) {
    case 2: subtract(track, t, HS_FLOAT64, 2, false); break;
    case 3: subtract(track, t, HS_FLOAT64, 3, false); break;
    case 7: subtract(track, t, HS_FLOAT64, 3, true); break;
    case 10: subtract(track, t, HS_FLOAT32, 2, false); break;
    case 11: subtract(track, t, HS_FLOAT32, 3, false); break;
    case 15: subtract(track, t, HS_FLOAT32, 3, true); break;
    default: subtract(track, t, real, d, track->deformed);
    }
    for (int k = 0; track->has_base && k < d; k++) {
        for (int p = 0; p < t->n; p++) {
            t->u[k][p] -= track->base[k];
        }
    }
}

/* Takes whole box vectors from u of point p. Returns whether that is known to have worked; sets
 * `given`, over the box vectors as given. */
static bool
take_jump(tracking *track, tile *t, int p, int64_t *given)
{
    double  u[HS_MAX_DIM], inside[HS_MAX_DIM];
    int64_t turns[HS_MAX_DIM];
    for (int k = 0; k < track->lattice.ndim; k++) {
        u[k] = t->u[k][p];
    }
    if (!hs_wrap_point(&track->lattice, u, inside, turns, &track->magnitude)) {
        return false;
    }
    (void)hs_lattice_shift(&track->lattice, turns, given); /* these fit: hs_wrap_point found it */
    for (int k = 0; k < track->lattice.ndim; k++) {
        t->u[k][p] = inside[k];
    }
    return true;
}

/* No jumps yet. */
static bool
start_jumps(tracking *track)
{
    const int64_t n = track->motion->now->points.n * track->m;
    track->jump_of = hs_store_reserve(track->jumps, HS_FOR_WRAPS, n, sizeof *track->jump_of);
    if (track->jump_of != NULL) {
        memset(track->jump_of, 0, (size_t)n * sizeof *track->jump_of);
    }
    return track->jump_of != NULL;
}

/* Looks for jumps among the points of a tile. HS_UNSERVED: some point went too far to tell. */
static hs_status
take_jumps(tracking *track, tile *t)
{
    const int d = track->lattice.ndim, m = track->m;
    for (int p = 0; p < t->n; p++) {
        int64_t  given[HS_MAX_DIM];
        uint64_t any = 0;
        double   longest = 0.0;
        for (int k = 0; k < d; k++) {
            longest = hs_larger(fabs(t->u[k][p]), longest);
        }
        if (longest < track->jump) {
            continue;
        }
        if (!take_jump(track, t, p, given)) {
            return HS_UNSERVED;
        }
        for (int r = 0; r < m; r++) {
            any |= (uint64_t)given[r];
        }
        if (any != 0 && track->jump_of == NULL && !start_jumps(track)) {
            return HS_ERR_MEMORY;
        }
        for (int r = 0; any != 0 && r < m; r++) {
            track->jump_of[(t->first + p) * m + r] = given[r];
        }
    }
    return HS_OK;
}

/* The longest of the tile, less drift, to *square and *component. */
HS_ALWAYS_INLINE void
find_longest(const tile *t, const int d, const double *drift, double *square, double *component)
{
    double most = *square, longest = *component;
    for (int p = 0; p < t->n; p++) {
        double sum = 0.0;
        for (int k = 0; k < d; k++) {
            const double u = t->u[k][p] - drift[k];
            sum += u * u;
            longest = hs_larger(fabs(u), longest);
        }
        most = hs_larger(sum, most);
    }
    *square = most;
    *component = longest;
}

static void
measure_tile(const tile *t, int d, const double *drift, double *square, double *component)
{
    switch (d) {
    case 2: find_longest(t, 2, drift, square, component); break;
    case 3: find_longest(t, 3, drift, square, component); break;
    default: find_longest(t, d, drift, square, component);
    }
}

/* Whether some point of the tile may have jumped. */
static bool
may_have_jumped(const tracking *track, const tile *t)
{
    const double none[HS_MAX_DIM] = {0.0};
    double       square = 0.0, component = 0.0;
    if (track->m == 0) {
        return false;
    }
    measure_tile(t, track->lattice.ndim, none, &square, &component);
    return !(component < track->jump);
}

/* Points that all went far share that, or most of it: the displacement of one of them. */
static void
find_base(tracking *track)
{
    const int64_t n = track->motion->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    int64_t       count = 0, far = 0;
    double        base[HS_MAX_DIM] = {0.0};
    tile          t = {.n = 1};
    for (int64_t i = 0; track->m > 0 && i < n; i += step, count++) {
        t.first = i;
        find_displacements(track, &t);
        if (may_have_jumped(track, &t)) {
            for (int k = 0; far == 0 && k < track->lattice.ndim; k++) {
                base[k] = t.u[k][0];
            }
            far++;
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
take_sample(tracking *track, const double *drift, sample *found)
{
    const int64_t n = track->motion->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    const int     d = track->motion->now->points.ndim;
    tile          t = {.n = 1};
    *found = (sample){.count = 0.0};
    for (int64_t i = 0; i < n; i += step) {
        t.first = i;
        find_displacements(track, &t);
        if (may_have_jumped(track, &t)) {
            int64_t given[HS_MAX_DIM];
            (void)take_jump(track, &t, 0, given); /* a failure shows again in the full pass */
        }
        for (int k = 0; k < d; k++) {
            const double u = t.u[k][0];
            found->sum[k] += u;
            found->lower[k] = i == 0 ? u : hs_smaller(u, found->lower[k]);
            found->upper[k] = i == 0 ? u : hs_larger(u, found->upper[k]);
        }
        found->count += 1.0;
        measure_tile(&t, d, drift, &found->square, &found->component);
    }
}

/* The drift of a sample: the mean, or where the sample is all there is the middle of the range. */
static void
guess_drift(tracking *track)
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
        memcpy(track->drift, drift, sizeof drift);
    }
}

/* At least the longest |u| as computed: 2^-47 is more than the roundings of square and root. */
static double
longest_computed(const tracking *track)
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
bound_rounding(const tracking *track)
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
find_margin(const tracking *track)
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
start(const hs_motion *motion, hs_store *jumps, tracking *track)
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
measure_all(tracking *track, const hs_options *options)
{
    const int64_t n = track->motion->now->points.n;
    tile          t;
    for (t.first = 0; t.first < n; t.first += TILE) {
        t.n = n - t.first < TILE ? (int)(n - t.first) : TILE;
        find_displacements(track, &t);
        hs_status status = may_have_jumped(track, &t) ? take_jumps(track, &t) : HS_OK;
        if (status == HS_OK) {
            measure_tile(&t, track->motion->now->points.ndim, track->drift, &track->square,
                         &track->component);
            status = (t.first + TILE) % HS_POLL_POINTS == 0 ? hs_poll(options, 0.0) : HS_OK;
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
    tracking  track;
    hs_status status = start(motion, jumps, &track);
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
