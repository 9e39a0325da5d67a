/* SPDX-License-Identifier: BSD-3-Clause */
/* scene_ordinary.c: scenes without a box whose numbers need no scale are filled in one go. */
#include "scene.h"

#include "unit.h"

bool
hs_scene_stays(const hs_sets *sets, const hs_box *box, const hs_options *options,
               const hs_scene *scene)
{
    return box == NULL && sets->queries == NULL && !sets->is_kept && !sets->is_wide &&
           options->precision != HS_DOUBLE && hs_is_ordinary(&scene->cloud, options->cutoff);
}

hs_status
hs_scene_fill_ordinary(const hs_options *options, bool follows, hs_scene *scene,
                       hs_failure *failure)
{
    double magnitude;
    if (!follows) {
        scene->scale = scene->unscale = scene->pending = hs_scale_of(0);
        scene->sought = scene->cutoff = scene->cutoff_low = options->cutoff;
        scene->extreme = false;
        hs_lattice_init(NULL, scene->ndim, scene->scale, &scene->lattice);
        hs_scene_bound_errors(scene, 0.0);
        hs_scene_init_metric(scene, options);
    }
    hs_scene_set_radius(scene, options, scene->cloud.largest);
    return hs_scene_wrap(scene, NULL, options, &magnitude, failure);
}
