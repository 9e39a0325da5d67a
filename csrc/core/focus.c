/* SPDX-License-Identifier: BSD-3-Clause */
/* focus.c: see focus.h. */
#include "focus.h"

#include <math.h>
#include <stdlib.h>

#define SAMPLES 256
/* Sampled points that are left out at either end: with 256 samples, up to 1.5 % of the points. */
#define LEFT_OUT 4
/* How far to go beyond the sampled range, as a multiple of it: a normal distribution fits whole. */
#define MARGIN 1.0

static bool
needs_focus(const hs_scene *scene)
{
    double cells = 1.0;
    bool   open = false;
    for (int k = 0; k < scene->ndim; k++) {
        const double extent = scene->upper[k] - scene->lower[k];
        cells *= extent > scene->radius ? extent / scene->radius : 1.0;
        open = open || scene->lattice.row_of_axis[k] < 0;
    }
    return open && scene->lattice.aligned && scene->n >= SAMPLES &&
           cells > 2.0 * (double)scene->n;
}

static int
compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

void
hs_focus_ranges(hs_scene *scene)
{
    double sample[SAMPLES];
    if (!needs_focus(scene)) {
        return;
    }
    for (int k = 0; k < scene->ndim; k++) {
        if (scene->lattice.row_of_axis[k] >= 0) {
            continue;
        }
        for (int64_t s = 0; s < SAMPLES; s++) {
            sample[s] = scene->x[s * scene->n / SAMPLES * scene->ndim + k];
        }
        qsort(sample, SAMPLES, sizeof *sample, compare_doubles);
        const double low = sample[LEFT_OUT], high = sample[SAMPLES - 1 - LEFT_OUT];
        const double margin = MARGIN * (high - low) + scene->radius;
        scene->lower[k] = fmax(scene->lower[k], low - margin);
        scene->upper[k] = fmin(scene->upper[k], high + margin);
    }
}
