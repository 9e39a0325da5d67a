/* SPDX-License-Identifier: BSD-3-Clause */
/* scene_wrap.c: the pass over all points that wraps them into the box, axis by axis where
 * it can. */
#include "scene.h"

#include "../threads/passes.h"
#include "../box/wrap.h"
#include "unit.h"

#include <math.h>
#include <string.h>

typedef struct wrapping {
    hs_scene *scene;
    bool      few_turns;
    int       n_slabs; /* that so many points have; the others are not set */
    hs_folded folded[HS_SLABS];
} wrapping;

/* Whether the points lie in the middle period along axis k, all of them: then none is touched. */
static bool
is_inside(const hs_scene *scene, int k)
{
    const double half = 0.5 * scene->lattice.period[k];
    return scene->cloud.lower[k] >= -half && scene->cloud.upper[k] <= half;
}

/* The length that the given numbers of column k repeat after; 0 where that is not known. */
static double
given_length(const hs_scene *scene, int k)
{
    const hs_lattice *lattice = &scene->lattice;
    const int         own = hs_mover_among((const double(*)[HS_MAX_DIM])lattice->given, NULL,
                                           lattice->n_periodic, lattice->ndim, k);
    if (own >= 0) {
        return fabs(lattice->given[own][k]);
    }
    return lattice->aligned && !scene->extreme && lattice->row_of_axis[k] >= 0
               ? hs_scale_apply(scene->unscale, lattice->period[k])
               : 0.0;
}

void
hs_scene_fold_far(hs_scene *scene)
{
    hs_cloud *cloud = &scene->cloud;
    for (int k = 0; k < scene->ndim; k++) {
        const double reach = hs_larger(-cloud->lower[k], cloud->upper[k]);
        const bool   overflows = !(hs_scale_apply(scene->pending, reach) < INFINITY);
        if (!overflows && !scene->keeps_originals) {
            continue;
        }
        const double length = given_length(scene, k);
        if (!(length > 0.0) || !(overflows || reach / length >= HS_WRAP_LIMIT)) {
            continue;
        }
        for (int64_t i = 0; i < cloud->n; i++) {
            int64_t turned;
            cloud->x[k][i] = hs_wrap_axis(cloud->x[k][i], length, &turned);
        }
        cloud->lower[k] = -0.5 * length;
        cloud->upper[k] = 0.5 * length;
    }
}

static void
clear_turns(const hs_turns *turns, int row, int64_t first, int64_t last)
{
    if (turns->narrow[row] != NULL) {
        memset(turns->narrow[row] + first, 0, (size_t)(last - first) * sizeof(int32_t));
    } else {
        memset(turns->wide[row] + first, 0, (size_t)(last - first) * sizeof(int64_t));
    }
}

static hs_status
wrap_slab(void *context, int slab, int64_t first, int64_t last)
{
    wrapping         *wrap = context;
    hs_scene         *scene = wrap->scene;
    const hs_lattice *lattice = &scene->lattice;
    const hs_turns   *turns = scene->turns.known ? &scene->turns : NULL;
    hs_folded        *folded = &wrap->folded[slab];
    if (!lattice->aligned) {
        double *const *r = scene->x_is_beside ? scene->originals : scene->cloud.x;
        hs_fold_points(lattice, wrap->few_turns, r, first, last, scene->cloud.x, turns, folded);
    }
    for (int k = 0; lattice->aligned && k < scene->ndim; k++) {
        const int row = lattice->row_of_axis[k];
        if (row >= 0 && !is_inside(scene, k)) {
            const double largest = fmax(-scene->cloud.lower[k], scene->cloud.upper[k]);
            hs_fold_axis(lattice, k, scene->cloud.x[k], first, last, largest, turns, folded);
        } else if (row >= 0 && turns != NULL) {
            clear_turns(turns, row, first, last);
        }
    }
    return folded->failed < 0 ? HS_OK : HS_ERR_SHIFT_RANGE;
}

/* What wrapping found in all slabs together, and on the axes that were left alone. */
static hs_folded
join_slabs(const wrapping *wrap)
{
    const hs_scene *scene = wrap->scene;
    hs_folded       folded = hs_folded_none();
    for (int slab = 0; slab < wrap->n_slabs; slab++) {
        hs_folded_join(&folded, &wrap->folded[slab]);
    }
    for (int k = 0; scene->lattice.aligned && k < scene->ndim; k++) {
        const bool open = scene->lattice.row_of_axis[k] < 0;
        if (scene->n > 0 && (open || is_inside(scene, k))) {
            folded.x_largest[k] = fmax(-scene->cloud.lower[k], scene->cloud.upper[k]);
        }
        folded.lower[k] = open ? scene->cloud.lower[k] : 0.0;
        folded.upper[k] = open ? scene->cloud.upper[k] : 0.0;
    }
    return folded;
}

/* No point moves, and coordinates are those along the axes. */
static void
stay(hs_scene *scene)
{
    const hs_cloud *cloud = &scene->cloud;
    for (int k = 0; k < scene->ndim; k++) {
        scene->x_largest[k] = scene->n > 0 ? hs_larger(-cloud->lower[k], cloud->upper[k]) : 0.0;
        scene->lower[k] = scene->n > 0 ? cloud->lower[k] : 0.0;
        scene->upper[k] = scene->n > 0 ? cloud->upper[k] : 0.0;
    }
}

hs_status
hs_scene_wrap(hs_scene *scene, hs_team *team, const hs_options *options, double *magnitude,
              hs_failure *failure)
{
    wrapping wrap;
    *magnitude = 0.0;
    if (scene->lattice.n_periodic == 0) {
        stay(scene);
        return HS_OK;
    }
    wrap.scene = scene;
    wrap.few_turns = hs_fold_turns(&scene->lattice, scene->cloud.largest) <= HS_FOLD_TURNS;
    wrap.n_slabs = scene->n < HS_SLABS * HS_SLAB_POINTS
                       ? (int)((scene->n + HS_SLAB_POINTS - 1) / HS_SLAB_POINTS)
                       : HS_SLABS;
    for (int slab = 0; slab < wrap.n_slabs; slab++) {
        wrap.folded[slab] = hs_folded_none();
    }
    hs_status       status = hs_walk_slabs(team, options, scene->n, wrap_slab, &wrap);
    const hs_folded folded = join_slabs(&wrap);
    if (status == HS_ERR_SHIFT_RANGE) {
        failure->row = folded.failed;
        status = hs_skew_is_left(&scene->lattice) ? HS_ERR_BOX_SKEWED : status;
    }
    *magnitude = folded.magnitude;
    for (int k = 0; k < scene->ndim; k++) {
        scene->x_largest[k] = folded.x_largest[k];
        scene->lower[k] = scene->n > 0 ? folded.lower[k] : 0.0;
        scene->upper[k] = scene->n > 0 ? folded.upper[k] : 0.0;
    }
    return status;
}
