/* SPDX-License-Identifier: BSD-3-Clause */
/* scene_bounds.c: how far what the search computes with can be from the numbers that were given,
 * and what decides then. */
#include "scene.h"

#include <math.h>
#include <string.h>

#include "../exact/doubleword.h"

/* Part of the radius above which the width of pairs along an axis counts as that of a ball. */
#define WORTH_NARROWING 0.8
/* Far more than the roundings of the difference of radius and width. */
#define NARROWING_SLACK 0x1p-40
#define UNIT            0x1p-53 /* unit roundoff of float64 */
/* Error of precision="double", in heights of the box, up to which candidates are few. */
#define NOISE 0x1p-6

void
hs_scene_settle_ranges(hs_scene *scene)
{
    for (int k = 0; k < scene->ndim; k++) {
        if (scene->lattice.row_of_axis[k] >= 0) {
            const double half = 0.5 * scene->lattice.period[k];
            /* Points that rounding left outside are binned on the face: an error of t. */
            scene->t_error[k] +=
                hs_larger(hs_larger(scene->upper[k] - half, -half - scene->lower[k]), 0.0);
            scene->lower[k] = -half;
            scene->upper[k] = half;
        }
    }
}

/* Component by component, because those of a long box vector may be known far less well than those
 * of a short one. */
void
hs_scene_bound_errors(hs_scene *scene, double magnitude)
{
    const hs_lattice *lattice = &scene->lattice;
    const double      lost = scene->extreme ? HS_SCALING_LOSS : 0.0;
    const double      terms = 2 * lattice->n_periodic + 2;
    double            error[HS_MAX_DIM];
    scene->x_error = lost;
    for (int c = 0; c < scene->ndim; c++) {
        error[c] = lattice->aligned ? lost
                                    : lost + 2.0 * UNIT * scene->x_largest[c] +
                                          terms * terms * 0x1p-104 * magnitude;
        scene->x_error = hs_larger(error[c], scene->x_error);
    }
    for (int k = 0; k < scene->ndim; k++) {
        double along = 0.0; /* what the dot product carries on, and its own rounding */
        for (int c = 0; c < scene->ndim && !lattice->aligned; c++) {
            along += fabs(lattice->normal[k][c]) *
                     (error[c] + (scene->ndim + 2) * UNIT * scene->x_largest[c]);
        }
        scene->t_error[k] = lattice->aligned ? lost : along * (1.0 + 0x1p-40);
    }
}

/*
 * precision="double" computes D in float64 from the points as given: each of its m + 2 terms is
 * rounded to within 2^-53 of the largest partial sum. Candidates must be sought that much further
 * out.
 */
static double
bound_formula(const hs_scene *scene, double farthest)
{
    const hs_lattice *lattice = &scene->lattice;
    double            total = 2.0 * farthest;
    if (lattice->n_periodic == 0) {
        /* Differences of floats have a relative error only. */
        return 4.0 * UNIT * scene->cutoff * scene->ndim;
    }
    double turns[HS_MAX_DIM]; /* bound on |shift| over row b of B of any pair in reach */
    for (int k = 0; k < scene->ndim; k++) {
        const int b = lattice->row_of_axis[k];
        if (b >= 0) {
            turns[b] = (2.0 * scene->ndim * total + scene->cutoff) / lattice->period[k] + 4.0;
        }
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        double given_turns = 0.0, largest = 0.0;
        for (int b = 0; b < lattice->n_periodic; b++) {
            given_turns += turns[b] * fabs((double)lattice->U[b][r]);
        }
        for (int c = 0; c < scene->ndim; c++) {
            largest = fmax(largest, fabs(lattice->scaled[r][c]));
        }
        total += given_turns * largest;
    }
    return (lattice->n_periodic + 4) * scene->ndim * UNIT * (total + scene->cutoff);
}

void
hs_scene_set_radius(hs_scene *scene, const hs_options *options, double largest)
{
    scene->formula_error = options->precision == HS_DOUBLE ? bound_formula(scene, largest) : 0.0;
    scene->radius = scene->cutoff + scene->formula_error;
    memset(scene->less, 0, sizeof scene->less);
}

hs_status
hs_scene_narrow(hs_scene *scene, const hs_narrowing *narrowing)
{
    /* Less than this is not worth it. */
    const double enough = WORTH_NARROWING * hs_scale_apply(scene->unscale, scene->radius);
    for (int k = 0; narrowing != NULL && k < scene->ndim; k++) {
        double          width;
        const hs_status status =
            narrowing->find(narrowing->context, scene->lattice.normal[k], enough, &width);
        if (status != HS_OK) {
            return status;
        }
        const double near = hs_next_up(hs_scale_apply(scene->scale, width)) + scene->formula_error;
        const double less = (scene->radius - near) * (1.0 - NARROWING_SLACK);
        scene->less[k] = width < enough && less > 0.0 ? less : 0.0;
    }
    return HS_OK;
}

double
hs_scene_volume(const hs_scene *scene, double ball)
{
    for (int k = 0; k < scene->ndim; k++) {
        ball *= scene->less[k] > 0.0 ? hs_scene_radius_along(scene, k) / scene->radius : 1.0;
    }
    return ball;
}

void
hs_scene_init_metric(hs_scene *scene, const hs_options *options)
{
    const hs_lattice *lattice = &scene->lattice;
    const double(*rows)[HS_MAX_DIM] = (const double(*)[HS_MAX_DIM])lattice->rows;
    double cutoff = hs_scale_apply(scene->scale, scene->sought);
    if (scene->extreme) {
        rows = (const double(*)[HS_MAX_DIM])lattice->given;
        cutoff = scene->sought;
    } else if (scene->keeps_originals) {
        rows = (const double(*)[HS_MAX_DIM])lattice->scaled;
    }
    hs_metric_init(&scene->metric, scene->ndim, lattice->n_periodic, rows, cutoff,
                   options->inclusive);
}

void
hs_scene_set_cutoff(hs_scene *scene, const hs_options *options)
{
    HS_ASSERT(!scene->extreme);
    scene->sought = options->cutoff;
    scene->cutoff = scene->cutoff_low = hs_scale_apply(scene->scale, options->cutoff);
    hs_scene_set_radius(scene, options, scene->cloud.largest);
    hs_scene_init_metric(scene, options);
}

/* The first of the points that are farthest from zero along some axis; *far: how far. */
static int64_t
farthest_point(const hs_cloud *cloud, double *far)
{
    int64_t farthest = 0;
    double  largest = -1.0;
    for (int k = 0; k < cloud->ndim; k++) {
        for (int64_t i = 0; i < cloud->n; i++) {
            const double size = fabs(cloud->x[k][i]);
            if (size > largest || (size == largest && i < farthest)) {
                largest = size;
                farthest = i;
            }
        }
    }
    *far = largest;
    return farthest;
}

void
hs_scene_name_farthest(const hs_scene *scene, const hs_scene *asking, hs_failure *failure)
{
    double of_points, of_queries;
    failure->row = farthest_point(&scene->cloud, &of_points);
    if (asking != NULL) {
        const int64_t query = farthest_point(&asking->cloud, &of_queries);
        failure->in_queries = of_queries > of_points;
        failure->row = failure->in_queries ? query : failure->row;
    }
}

bool
hs_scene_is_drowned(const hs_scene *scene)
{
    double shortest = INFINITY;
    for (int k = 0; k < scene->ndim; k++) {
        if (scene->lattice.row_of_axis[k] >= 0) {
            shortest = hs_smaller(scene->lattice.period[k], shortest);
        }
    }
    return scene->formula_error > scene->cutoff && !(scene->formula_error <= NOISE * shortest);
}
