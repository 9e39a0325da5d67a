/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scene.h: points, box and cutoff in the form that the search works on: scaled by a power of two so
 * that the cutoff has an ordinary size, wrapped into the box, with a bound on every rounding.
 */
#ifndef HS_SCENE_H
#define HS_SCENE_H

#include "exact.h"
#include "fold.h"
#include "memory.h"
#include "points.h"

typedef struct hs_scene {
    int        ndim;
    int64_t    n;
    hs_scale   scale;
    hs_scale   unscale;       /* the way back */
    hs_scale   pending;       /* scale, but for what condensing the points has done of it */
    hs_lattice lattice;
    double     sought;        /* the caller's cutoff, not scaled; less if no two points are so far
                               * apart */
    double     cutoff;        /* scaled; the true one, or an upper bound when `extreme` */
    double     cutoff_low;    /* at most the true one */
    double     radius;        /* candidates are sought up to here; cutoff, or a little more */
    bool       extreme;       /* scaling lost digits: pairs are decided on the originals */
    hs_metric  metric;        /* decides on X, or on the originals if there are any */
    hs_cloud   cloud;         /* its columns are X, in the caller's order, once that is known */
    bool       keeps_originals; /* X does not hold every digit */
    double    *originals[HS_MAX_DIM]; /* n each: the points as given */
    bool       x_is_beside;   /* the originals stayed in the cloud's block, X is in the other */
    hs_turns   turns;         /* known if shifts or originals need them */
    void      *beside;        /* owned; the columns of originals and turns, one behind another */
    double     lower[HS_MAX_DIM]; /* range of t_k that the grid covers: the points, the period */
    double     upper[HS_MAX_DIM];
    double     x_largest[HS_MAX_DIM]; /* at least the largest |X_k| */
    double     x_error;       /* each component of X is within this of r - w B */
    double     t_error[HS_MAX_DIM]; /* and each computed t_k of the true one, clamping included */
    double     formula_error; /* precision="double": its |D| against the true one */
} hs_scene;

/*
 * Reads the points, checks everything that has a value, wraps. On failure the scene holds nothing
 * and any status but HS_ERR_KERNEL and HS_ERR_INTERRUPTED is possible.
 */
hs_status hs_scene_init(hs_account *account, hs_team *team, const hs_points *points,
                        const hs_box *box, const hs_options *options, hs_scene *scene,
                        hs_failure *failure);

/* Wraps the points into the box; scene_wrap.c. Sets x_largest, the range of t_k of the points in
 * lower and upper, and *magnitude as hs_wrap_point says. */
hs_status hs_scene_wrap(hs_scene *scene, hs_team *team, const hs_options *options,
                        double *magnitude, hs_failure *failure);

/* t_k of point i, as hs_lattice_coordinate. */
HS_ALWAYS_INLINE double
hs_scene_coordinate(const hs_scene *scene, int64_t i, int k)
{
    const hs_lattice *lattice = &scene->lattice;
    if (lattice->aligned) {
        return scene->cloud.x[k][i];
    }
    double t = 0.0;
    for (int c = 0; c < lattice->ndim; c++) {
        t += lattice->normal[k][c] * scene->cloud.x[c][i];
    }
    return t;
}

/* A length that the metric measured, in the caller's unit. */
HS_ALWAYS_INLINE double
hs_scene_restore(const hs_scene *scene, double length)
{
    return scene->extreme ? length : hs_scale_apply(scene->unscale, length);
}

void hs_scene_free(hs_account *account, hs_scene *scene);

#endif
