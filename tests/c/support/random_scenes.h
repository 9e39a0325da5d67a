/* SPDX-License-Identifier: BSD-3-Clause */
/* random_scenes.h: small scenes in every kind of box, many with pairs exactly at the cutoff. */
#ifndef HS_RANDOM_SCENES_H
#define HS_RANDOM_SCENES_H

#include "brute_force.h"
#include "harness.h"

enum { SCENE_POINTS = 400 };

typedef enum scene_kind {
    SCENE_OPEN,
    SCENE_ALIGNED,
    SCENE_TURNED, /* box vectors along other coordinate axes, and against them */
    SCENE_MIXED,  /* some axes do not repeat */
    SCENE_TRICLINIC,
    SCENE_SHEARED, /* a box that another, upright one is equivalent to */
    SCENE_KINDS
} scene_kind;

typedef struct random_scene {
    brute_scene scene; /* points to the rest */
    hs_box      box;
    double      x[SCENE_POINTS * HS_MAX_DIM];
} random_scene;

static inline int
random_below(harness_random *random, int n)
{
    return (int)(random_bits(random) % (unsigned)n);
}

/* 0: any number; 1: quarters; 2: tenths; 3: float32. All within [0, size), size >= 1. */
static inline double
random_entry(harness_random *random, int numbers, double size)
{
    switch (numbers) {
    case 1: return 0.25 * floor(4.0 * size * random_unit(random));
    case 2: return 0.1 * floor(10.0 * size * random_unit(random));
    case 3: return (float)(size * random_unit(random) * 0.999);
    default: return size * random_unit(random);
    }
}

static inline void
random_box(harness_random *random, scene_kind kind, int numbers, double size, hs_box *box)
{
    const int d = box->ndim, turn = kind == SCENE_TURNED ? random_below(random, d) : 0;
    for (int l = 0; l < d; l++) {
        box->periodic[l] = kind != SCENE_MIXED || random_below(random, 2);
        for (int k = 0; k < d; k++)
            box->rows[l][k] = 0.0;
        double length = size * 0.5 + random_entry(random, numbers, size);
        if (kind == SCENE_TURNED && random_below(random, 2))
            length = -length;
        box->rows[l][(l + turn) % d] = length;
    }
    for (int l = 0; l < d; l++) {
        for (int k = 0; (kind == SCENE_TRICLINIC || kind == SCENE_MIXED) && k < d; k++) {
            const double tilt = 0.4 * random_entry(random, numbers, size);
            box->rows[l][k] += tilt * (random_below(random, 3) - 1);
        }
    }
    for (int step = 0; kind == SCENE_SHEARED && d > 1 && step < 2; step++) {
        const int    l = random_below(random, d), other = (l + 1 + random_below(random, d - 1)) % d;
        const double times = random_below(random, 13) - 6;
        for (int k = 0; k < d; k++)
            box->rows[l][k] += times * box->rows[other][k];
    }
}

/* A cutoff that some pair of the scene is at, or a step or two beside. */
static inline double
cutoff_of_some_pair(harness_random *random, const brute_scene *scene)
{
    const double *p = scene->x + scene->ndim * random_below(random, (int)scene->n);
    const double *q = scene->x + scene->ndim * random_below(random, (int)scene->n);
    const bool    shifted = scene->box != NULL && random_below(random, 2);
    const int     l = random_below(random, scene->ndim);
    double        square = 0.0;
    for (int k = 0; k < scene->ndim; k++) {
        double along = q[k] - p[k];
        if (shifted && scene->box->periodic[l])
            along += scene->box->rows[l][k];
        square += along * along;
    }
    double cutoff = sqrt(square);
    for (int steps = random_below(random, 5) - 2; steps != 0; steps += steps < 0 ? 1 : -1)
        cutoff = nextafter(cutoff, steps < 0 ? 0.0 : INFINITY);
    return cutoff;
}

/* Points within `spread` of the origin, which may be many boxes; everything times 2^exponent. */
static inline void
make_scene(harness_random *random, scene_kind kind, int ndim, int n, double spread, int exponent,
           random_scene *out)
{
    const int    numbers = random_below(random, 4);
    const double size = 4.0, largest = ndim <= 2 ? 2.0 : ndim <= 4 ? 1.0 : 0.55;
    brute_scene *scene = &out->scene;
    *scene = (brute_scene){.ndim = ndim, .n = n, .x = out->x, .inclusive = random_below(random, 2)};
    memset(&out->box, 0, sizeof out->box);
    out->box.ndim = ndim;
    random_box(random, kind, numbers, size, &out->box);
    scene->box = kind == SCENE_OPEN ? NULL : &out->box;
    for (int e = 0; e < n * ndim; e++) {
        const double x = random_entry(random, numbers, spread);
        out->x[e] = random_below(random, 2) ? x : -x;
    }
    for (int i = 1; i < n; i++) {
        if (random_below(random, 12) == 0)
            memcpy(out->x + i * ndim, out->x, (size_t)ndim * sizeof(double));
    }
    scene->cutoff = size * largest * random_unit(random);
    for (int tries = 0; n > 0 && random_below(random, 4) && tries < 8; tries++) {
        const double cutoff = cutoff_of_some_pair(random, scene);
        if (cutoff <= size * largest) {
            scene->cutoff = cutoff;
            break;
        }
    }
    for (int e = 0; e < n * ndim; e++)
        out->x[e] = ldexp(out->x[e], exponent);
    for (int l = 0; l < ndim; l++) {
        for (int k = 0; k < ndim; k++)
            out->box.rows[l][k] = ldexp(out->box.rows[l][k], exponent);
    }
    scene->cutoff = ldexp(scene->cutoff, exponent);
}

#endif
