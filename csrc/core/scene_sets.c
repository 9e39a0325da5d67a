/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scene_sets.c: two sets of points in one scene: what is known of one must hold for both. See
 * scene.h.
 */
#include "scene.h"

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
    asking->lattice = scene->lattice;
    asking->cutoff = scene->cutoff;
    asking->cutoff_low = scene->cutoff_low;
    asking->radius = scene->radius;
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
            scene->lower[k] =
                points ? hs_smaller(scene->lower[k], asking->lower[k]) : asking->lower[k];
            scene->upper[k] =
                points ? hs_larger(scene->upper[k], asking->upper[k]) : asking->upper[k];
        }
    }
}
