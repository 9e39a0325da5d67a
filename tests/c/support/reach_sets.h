/* SPDX-License-Identifier: BSD-3-Clause */
/* reach_sets.h: points with radii or types of many kinds, for the searches in which each pair has a
 * reach of its own. */
#ifndef HS_REACH_SETS_H
#define HS_REACH_SETS_H

#include <math.h>

#include "../../../csrc/halfshell.h"
#include "among.h"
#include "harness.h"

enum { REACH_POINTS = 400, REACH_TYPES = 6 };

/* One set: points, radii and types. */
typedef struct reach_set {
    int64_t n;
    int     ndim;
    double  x[REACH_POINTS * HS_MAX_DIM];
    double  radii[REACH_POINTS];
    int32_t types[REACH_POINTS];
} reach_set;

/* 0: all one; 1: over two binary orders; 2: over many; 3: many are zero; 4: tenths, which are no
 * float64s; 5: subnormal ones too. */
enum { REACH_SPREADS = 6 };

static inline double
reach_radius(harness_random *random, int spread, double size)
{
    const int order = (int)(random_bits(random) % 12);
    switch (spread) {
    case 0: return size;
    case 1: return size * (0.25 + 0.75 * random_unit(random));
    case 2: return ldexp(size * (0.5 + random_unit(random)), -order);
    case 3: return order < 6 ? 0.0 : size * random_unit(random);
    case 4: return 0.1 * floor(10.0 * size * random_unit(random));
    default: return order == 0 ? 5e-324 : order == 1 ? 0.0 : ldexp(size, -90 * (order % 3));
    }
}

/* n points within 0 ... side along each axis, some of them the same. */
static inline void
reach_fill(harness_random *random, int64_t n, int ndim, double side, int spread, double size,
           reach_set *set)
{
    set->n = n;
    set->ndim = ndim;
    for (int64_t i = 0; i < n; i++) {
        set->radii[i] = reach_radius(random, spread, size);
        set->types[i] = (int32_t)(random_bits(random) % REACH_TYPES);
        for (int k = 0; k < ndim; k++) {
            const double x = side * random_unit(random);
            set->x[i * ndim + k] = spread == 4 ? 0.1 * floor(10.0 * x) : x;
        }
    }
}

static inline hs_points
reach_points(const reach_set *set)
{
    return points_in_rows(set->x, set->n, set->ndim);
}

/* With all that is known of them. */
static inline hs_set
reach_set_of(const reach_set *set)
{
    return (hs_set){.at = reach_points(set), .radii = set->radii, .types = set->types};
}

#endif
