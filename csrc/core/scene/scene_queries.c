/* SPDX-License-Identifier: BSD-3-Clause */
/* scene_queries.c: points and queries in one scene, at once or one after the other: bounds must
 * hold for both. */
#include "scene.h"

#include <math.h>
#include <string.h>

/* How much further from the box than the points queries may be that come later, and how many box
 * vectors at least, before they need bounds of their own. Bounds that are so much wider cost next
 * to nothing: they are some units in the last place. */
#define FURTHER     4.0
#define BOX_VECTORS 1024.0
/* Along coordinate axes cells are found for any number, as long as sums of a few are finite. */
#define MOST_FOR_CELLS 0x1p900

void
hs_scene_join_clouds(hs_scene *scene, hs_scene *asking)
{
    hs_cloud *a = &scene->cloud, *b = &asking->cloud;
    /* The range of no points is empty: infinity to -infinity. */
    for (int k = 0; k < scene->ndim; k++) {
        a->lower[k] = b->lower[k] = hs_smaller(a->lower[k], b->lower[k]);
        a->upper[k] = b->upper[k] = hs_larger(a->upper[k], b->upper[k]);
    }
    a->largest = b->largest = hs_larger(a->largest, b->largest);
}

void
hs_scene_share(const hs_scene *scene, hs_scene *asking)
{
    asking->scale = scene->scale;
    asking->unscale = scene->unscale;
    asking->pending = scene->pending;
    asking->sought = scene->sought;
    asking->lattice = scene->lattice;
    asking->cutoff = scene->cutoff;
    asking->cutoff_low = scene->cutoff_low;
    asking->radius = scene->radius;
    memcpy(asking->less, scene->less, sizeof asking->less);
    asking->extreme = scene->extreme;
    asking->formula_error = scene->formula_error;
}

void
hs_scene_join_wrapped(hs_scene *scene, const hs_scene *asking)
{
    const bool points = scene->n > 0, queries = asking->n > 0;
    scene->is_asked = true;
    for (int k = 0; k < scene->ndim; k++) {
        scene->x_largest[k] = hs_larger(scene->x_largest[k], asking->x_largest[k]);
        if (queries) { /* otherwise its range is that of nothing */
            scene->lower[k] = points ? hs_smaller(scene->lower[k], asking->lower[k])
                                     : asking->lower[k];
            scene->upper[k] = points ? hs_larger(scene->upper[k], asking->upper[k])
                                     : asking->upper[k];
        }
    }
}

void
hs_scene_put_in_one_cell(hs_scene *scene)
{
    hs_cloud *cloud = &scene->cloud;
    for (int k = 0; k < scene->ndim; k++) {
        memset(cloud->x[k], 0, (size_t)cloud->n * sizeof(double));
        cloud->lower[k] = cloud->upper[k] = 0.0;
    }
    cloud->largest = 0.0;
    scene->scale = scene->unscale = scene->pending = hs_scale_of(0);
    scene->cutoff = scene->cutoff_low = scene->radius = 1.0;
    scene->formula_error = 0.0;
    memset(scene->less, 0, sizeof scene->less);
    scene->extreme = false;
    scene->in_one_cell = true;
    hs_lattice_init(NULL, scene->ndim, scene->pending, &scene->lattice);
}

static double
largest_entry(const hs_lattice *lattice)
{
    double largest = 0.0;
    for (int r = 0; r < lattice->n_periodic; r++) {
        for (int k = 0; k < lattice->ndim; k++) {
            largest = hs_larger(largest, fabs(lattice->rows[r][k]));
        }
    }
    return largest;
}

void
hs_scene_make_room(hs_scene *scene, double *magnitude)
{
    const hs_lattice *lattice = &scene->lattice;
    const double      away = BOX_VECTORS * largest_entry(lattice);
    scene->cloud.largest = hs_larger(FURTHER * scene->cloud.largest, away);
    *magnitude = hs_larger(FURTHER * *magnitude, away);
    for (int k = 0; k < scene->ndim; k++) {
        double across = 0.0; /* what is wrapped lies within half of each row of B */
        for (int r = 0; r < lattice->n_periodic; r++) {
            across += 0.5 * fabs(lattice->rows[r][k]);
        }
        scene->x_largest[k] = 2.0 * hs_larger(scene->x_largest[k], across);
        if (across == 0.0) { /* queries stay wherever they are along this axis */
            scene->x_largest[k] = hs_larger(2.0 * scene->x_largest[k], away);
        }
    }
}

void
hs_scene_widen_errors(hs_scene *scene)
{
    for (int k = 0; k < scene->ndim; k++) {
        scene->t_error[k] *= 2.0; /* queries may be rounded to beyond another face */
    }
}

/* The largest scaled coordinate of queries that come later. */
static double
most_taken(const hs_scene *kept, bool is_untested)
{
    return is_untested && kept->lattice.aligned ? MOST_FOR_CELLS : kept->cloud.largest;
}

bool
hs_scene_takes(const hs_scene *kept, const hs_cloud *cloud)
{
    const hs_scale scale = kept->scale;
    if (kept->n == 0) { /* no point is found, wherever queries are, but they need a place */
        return hs_scale_apply(scale, cloud->largest) < INFINITY;
    }
    const double most = most_taken(kept, kept->is_untested);
    if (kept->in_one_cell || !(hs_scale_apply(scale, cloud->largest) <= most)) {
        return false;
    }
    if (kept->is_untested) { /* digits that are lost are less than the room between cells */
        return true;
    }
    if (kept->extreme) {
        return false;
    }
    /* Scaling down must not reach the subnormal numbers. */
    return scale.exponent == 0 || cloud->largest == 0.0 ||
           hs_scale_apply(scale, hs_cloud_smallest(cloud)) >= 0x1p-1022;
}

bool
hs_scene_covers(const hs_scene *kept, const hs_scene *asking)
{
    const bool is_tested = kept->n > 0 && !kept->is_untested;
    bool       covers = !is_tested || asking->x_error <= kept->x_error;
    for (int k = 0; kept->n > 0 && k < kept->ndim; k++) {
        covers = covers && asking->t_error[k] <= kept->t_error[k] &&
                 (!is_tested || asking->x_largest[k] <= kept->x_largest[k]);
    }
    return covers;
}

void
hs_scene_name_refused(const hs_scene *kept, const hs_points *queries, hs_failure *failure)
{
    const hs_options options = hs_options_default();
    const double     most = most_taken(kept, true);
    double           largest = -1.0;
    hs_cloud         cloud;
    if (kept->in_one_cell ||
        hs_cloud_load(NULL, NULL, queries, &options, &cloud, failure) != HS_OK) {
        return;
    }
    for (int64_t i = 0; i < cloud.n; i++) {
        for (int k = 0; k < cloud.ndim; k++) {
            const double size = hs_scale_apply(kept->scale, fabs(cloud.x[k][i]));
            if (largest <= most && size > largest) {
                largest = size;
                failure->row = i;
                failure->column = k;
                failure->value = cloud.x[k][i];
                failure->in_queries = true;
            }
        }
    }
    hs_cloud_free(NULL, &cloud);
}
