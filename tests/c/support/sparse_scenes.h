/* SPDX-License-Identifier: BSD-3-Clause */
/* sparse_scenes.h: scenes whose points are few and far between, crowded, or both. */
#ifndef HS_SPARSE_SCENES_H
#define HS_SPARSE_SCENES_H

#include "random_scenes.h"

enum { SPARSE_MANY = 20000, SPARSE_MANY_KINDS = 8 };

/* Rows as wide as the range, most of the time. */
static inline double
random_width(harness_random *random)
{
    return random_below(random, 2) ? 1.0 : ldexp(1.0, random_below(random, 6));
}

typedef enum place_kind {
    PLACE_AS_IS,
    PLACE_CLUSTERS,    /* five, a thousand cutoffs apart */
    PLACE_TWO_NEAR,    /* two clusters 1e9 apart */
    PLACE_TWO_FAR,     /* 1e18 apart */
    PLACE_OUTLIERS,    /* some far ones on either side */
    PLACE_EXPONENTIAL, /* every scale from 1e-3 to 1e300 */
    PLACE_COINCIDENT,  /* few places, many points */
    PLACE_LINE,        /* flat scenes */
    PLACE_KINDS
} place_kind;

static inline double
place_coordinate(harness_random *random, place_kind kind, int i, int k, double x)
{
    static const double far[] = {1e10, -1e30, 1e300, -1e300};
    switch (kind) {
    case PLACE_CLUSTERS: return 0.2 * x + 1000.0 * ((i % 5 * (k + 3)) % 5);
    case PLACE_TWO_NEAR: return x + (i & 1 ? 1e9 : 0.0);
    case PLACE_TWO_FAR: return x + (i & 1 ? 1e18 : 0.0);
    case PLACE_OUTLIERS:
        return i % 10 == 3 && random_below(random, 2) ? far[random_below(random, 4)] : x;
    case PLACE_EXPONENTIAL:
        return pow(10.0, -3.0 + 303.0 * random_unit(random)) * (random_below(random, 2) ? 1 : -1);
    case PLACE_COINCIDENT: return i % 7 * (k + 1) * 0.25;
    case PLACE_LINE: return k == i % 2 ? x : 0.5;
    default: return x;
    }
}

/* make_scene with its points moved; wide boxes for points that are far apart. */
static inline void
place_scene(harness_random *random, scene_kind kind, place_kind place, int ndim, int n,
            random_scene *out)
{
    make_scene(random, kind, ndim, n, 4.0, 0, out);
    for (int e = 0; e < n * ndim; e++)
        out->x[e] = place_coordinate(random, place, e / ndim, e % ndim, out->x[e]);
    if (place != PLACE_AS_IS)
        out->scene.cutoff = fmin(out->scene.cutoff, 2.0 * random_unit(random));
    const bool wide = place == PLACE_CLUSTERS || (place != PLACE_AS_IS && random_below(random, 2));
    for (int l = 0; l < ndim; l++) {
        for (int k = 0; wide && k < ndim; k++)
            out->box.rows[l][k] *= 5000.0;
    }
}

/* Normal, from two uniform numbers. */
static inline double
random_normal(harness_random *random)
{
    const double angle = 6.283185307179586 * random_unit(random);
    return sqrt(-2.0 * log(1.0 - random_unit(random))) * cos(angle);
}

/* SPARSE_MANY points in three dimensions, for cutoff 1. */
static inline void
many_points(harness_random *random, int kind, double *many)
{
    const double side = 11.0; /* 15 points per unit of volume, 63 neighbours */
    for (int i = 0; i < SPARSE_MANY; i++) {
        double *x = many + 3 * i, radius = 1.0;
        if (kind == 3) /* lognormal sizes */
            radius = exp(3.0 * random_normal(random));
        else if (kind == 4) /* Plummer */
            radius = 3.0 / sqrt(pow(1.0 - random_unit(random), -2.0 / 3.0) - 1.0 + 1e-12);
        for (int k = 0; k < 3; k++) {
            x[k] = kind < 3 ? side * random_unit(random) : radius * random_normal(random);
            x[k] += kind == 1 && i % 2 ? 1e9 : kind == 2 && i % 2 ? 1e14 : 0.0;
            if (kind == 5)
                x[k] = pow(10.0, -3.0 + 303.0 * random_unit(random));
        }
        if (kind == 6)
            x[1] = x[2] = x[0] * 1e3; /* a line across */
        if (kind == 7 && i % 1000 == 0)
            x[0] = i % 2000 ? 1e300 : -1e300;
        if (kind == 7)
            x[2] = 1e-6 * x[2]; /* a plane */
    }
}

#endif
