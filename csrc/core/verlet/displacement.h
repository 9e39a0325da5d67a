/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * displacement.h: how far points have moved, a tile at a time: u_i = r_i - r0_i F - k_i h - c, what
 * is left when the deformation of the box, whole box vectors and what all points share are taken
 * away.
 */
#ifndef HS_DISPLACEMENT_H
#define HS_DISPLACEMENT_H

#include "../box/strain.h"
#include "../box/wrap.h"
#include "../scene/snapshot.h"

#include <math.h>

#define HS_TILE 64 /* points whose displacements are held at a time; whole chains of a maximum */

/* What is compared; all borrowed. */
typedef struct hs_motion {
    const hs_frame *built;  /* the step that the list was built for */
    const hs_frame *now;    /* hs_frames_match */
    double          radius; /* the list has every pair up to here */
    double          cutoff;
} hs_motion;

typedef struct hs_tracking {
    const hs_motion *motion;
    bool             deformed;
    hs_strain        strain;
    hs_lattice       lattice; /* of the box now */
    int              m;
    double           jump; /* longer displacements are looked at; infinity: none */
    bool             has_base;
    double           base[HS_MAX_DIM];
    bool             has_drift;
    double           drift[HS_MAX_DIM];
    hs_store        *jumps;
    int64_t         *jump_of;   /* in it, m a point; NULL: there is none yet */
    double           square;    /* largest |u|^2 ... */
    double           component; /* ... and |u_k| */
    double           magnitude; /* of the terms of wrapping */
} hs_tracking;

/* u of the points of one tile, one array for each axis, without drift. */
typedef struct hs_tile {
    int64_t first, step; /* points first, first + step, ... */
    int     n;
    double  u[HS_MAX_DIM][HS_TILE];
} hs_tile;

/* Displacements of up to HS_TILE points from `first` on; their longest to *square and *component.
 * Returns whether some point may have jumped. */
bool hs_look_at_tile(const hs_tracking *track, int64_t first, int64_t step, hs_tile *t,
                     double *square, double *component);

/* Whether a displacement is so long that it may be a jump. */
HS_ALWAYS_INLINE bool
hs_may_be_jump(const hs_tracking *track, const hs_tile *t, int p)
{
    double longest = 0.0;
    for (int k = 0; k < track->lattice.ndim; k++) {
        longest = hs_larger(fabs(t->u[k][p]), longest);
    }
    return !(longest < track->jump);
}

/* Takes whole box vectors from u of point p. Returns whether that is known to have worked; sets
 * `given`, over the box vectors as given. */
bool hs_take_jump(hs_tracking *track, hs_tile *t, int p, int64_t *given);

/* Takes and keeps the jumps of the points of a tile. HS_UNSERVED: some point went too far to
 * tell. */
hs_status hs_take_jumps(hs_tracking *track, hs_tile *t);

/* The longest of the tile, less drift, to *square and *component, which are not lowered. */
void hs_measure_tile(hs_tile *t, int d, const double *drift, double *square, double *component);

#endif
