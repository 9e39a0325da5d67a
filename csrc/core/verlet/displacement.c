/* SPDX-License-Identifier: BSD-3-Clause */
/* displacement.c: one loop for each common type and number of dimensions; maxima in several chains,
 * for one would wait for itself. */
#include "displacement.h"

#include "../base/outcome.h"

#include <string.h>

#define CHAINS 8

HS_ALWAYS_INLINE void
subtract(const hs_tracking *track, hs_tile *t, const hs_real real, const int d, const bool deformed)
{
    const void   *now = track->motion->now->rows, *built = track->motion->built->rows;
    const int64_t first = t->first * d, step = t->step * d;
    for (int p = 0; p < t->n; p++) {
        for (int k = 0; k < d; k++) {
            const int64_t e = first + p * step + k;
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
find_displacements(const hs_tracking *track, hs_tile *t)
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

bool
hs_take_jump(hs_tracking *track, hs_tile *t, int p, int64_t *given)
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
start_jumps(hs_tracking *track)
{
    const int64_t n = track->motion->now->points.n * track->m;
    track->jump_of = hs_store_reserve(track->jumps, HS_FOR_WRAPS, n, sizeof *track->jump_of);
    if (track->jump_of != NULL) {
        memset(track->jump_of, 0, (size_t)n * sizeof *track->jump_of);
    }
    return track->jump_of != NULL;
}

/* The longest of the tile, less drift, to *square and *component. */
HS_ALWAYS_INLINE void
find_longest(hs_tile *t, const int d, const double *drift, double *square, double *component)
{
    double most[CHAINS] = {0.0}, longest[CHAINS] = {0.0};
    for (int p = t->n; p % CHAINS != 0; p++) { /* the last one again */
        for (int k = 0; k < d; k++) {
            t->u[k][p] = t->u[k][t->n - 1];
        }
    }
    for (int p = 0; p < t->n; p += CHAINS) {
        double sum[CHAINS] = {0.0};
        for (int k = 0; k < d; k++) {
            for (int c = 0; c < CHAINS; c++) {
                const double u = t->u[k][p + c] - drift[k];
                sum[c] += u * u;
                longest[c] = hs_larger(fabs(u), longest[c]);
            }
        }
        for (int c = 0; c < CHAINS; c++) {
            most[c] = hs_larger(sum[c], most[c]);
        }
    }
    for (int c = 0; c < CHAINS; c++) {
        *square = hs_larger(most[c], *square);
        *component = hs_larger(longest[c], *component);
    }
}

void
hs_measure_tile(hs_tile *t, int d, const double *drift, double *square, double *component)
{
    switch (d) {
    case 2: find_longest(t, 2, drift, square, component); break;
    case 3: find_longest(t, 3, drift, square, component); break;
    default: find_longest(t, d, drift, square, component);
    }
}

bool
hs_look_at_tile(const hs_tracking *track, int64_t first, int64_t step, hs_tile *t, double *square,
                double *component)
{
    const double  none[HS_MAX_DIM] = {0.0};
    const int64_t left = (track->motion->now->points.n - first + step - 1) / step;
    t->first = first;
    t->step = step;
    t->n = left < HS_TILE ? (int)left : HS_TILE;
    *square = *component = 0.0;
    find_displacements(track, t);
    hs_measure_tile(t, track->motion->now->points.ndim, none, square, component);
    return track->m > 0 && !(*component < track->jump);
}

hs_status
hs_take_jumps(hs_tracking *track, hs_tile *t)
{
    const int m = track->m;
    for (int p = 0; p < t->n; p++) {
        int64_t  given[HS_MAX_DIM];
        uint64_t any = 0;
        if (!hs_may_be_jump(track, t, p)) {
            continue;
        }
        if (!hs_take_jump(track, t, p, given)) {
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
