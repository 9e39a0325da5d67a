/* SPDX-License-Identifier: BSD-3-Clause */
/* scene_scale.c: which power of two a scene is scaled by (unit.h), and whether gaps between its
 * points are closed before that (close_gaps.h). */
#include "scene.h"

#include "close_gaps.h"
#include "unit.h"

#include <math.h>

bool
hs_scene_may_condense(const hs_scene *scene, const hs_scene *asking, const hs_box_size *size,
                      int unit)
{
    const bool is_bounded = scene->within > 0.0 && scene->sought == scene->within;
    if (scene->is_kept || (scene->is_wide && !is_bounded)) {
        return false;
    }
    return scene->is_wide || (asking == NULL && !scene->is_plain) ||
           hs_open_drowns_box(&scene->cloud, size, scene->sought) ||
           !hs_fits_one_scale(&scene->cloud, size, unit, HS_LARGEST_WIDE_EXPONENT);
}

double
hs_scene_settle_cutoff(const hs_scene *scene, const hs_box_size *size, double cutoff)
{
    const hs_cloud *cloud = &scene->cloud;
    if (scene->within > 0.0 &&
        !hs_fits_one_scale(cloud, size, hs_unit_exponent(cloud, size, scene->within),
                           HS_FAR_BOUNDED_EXPONENT)) {
        return scene->within;
    }
    return scene->is_kept || scene->is_plain ? cutoff : hs_enough_cutoff(cloud, size, cutoff);
}

void
hs_scene_set_scale(const hs_box *box, bool is_scaled, int unit, hs_scene *scene,
                   const hs_scene *asking)
{
    const hs_box_size size = hs_box_size_of(box);
    int               exponent = unit;
    bool              also_extreme = false;
    /* The smallest length that pairs are compared with. */
    const double least = scene->least_cutoff > 0.0 ? hs_smaller(scene->least_cutoff, scene->sought)
                                                   : scene->sought;
    scene->extreme = false;
    if (!is_scaled) {
        const int largest = scene->is_wide ? HS_LARGEST_WIDE_EXPONENT : HS_LARGEST_EXPONENT;
        exponent = hs_choose_exponent(&scene->cloud, &size, least, unit, largest, &scene->extreme);
        if (asking != NULL) { /* the same exponent: the clouds' ranges are joined */
            (void)hs_choose_exponent(&asking->cloud, &size, least, unit, largest, &also_extreme);
        }
    }
    scene->extreme = scene->extreme || also_extreme;
    scene->scale = hs_scale_of(exponent);
    scene->unscale = hs_scale_of(-exponent);
    scene->pending = is_scaled ? hs_scale_of(0) : scene->scale;
    scene->cutoff = scene->cutoff_low = hs_scale_apply(scene->scale, scene->sought);
    if (scene->extreme && scene->sought > 0.0) {
        /* The scaled cutoff may have been rounded or flushed: take bounds. */
        scene->cutoff_low -= HS_SCALING_LOSS;
        scene->cutoff += HS_SCALING_LOSS;
    }
}

bool
hs_scene_box_vanishes(const hs_scene *scene)
{
    const hs_lattice *lattice = &scene->lattice;
    for (int k = 0; k < lattice->ndim; k++) {
        if (lattice->row_of_axis[k] >= 0 && !(lattice->period[k] > 0x1p-900)) {
            return true;
        }
    }
    return false;
}

/* Whether a cutoff has more images than any memory holds. */
static bool
has_endless_images(const hs_scene *scene, const hs_condensed *condensed)
{
    const hs_box_size size = hs_box_size_of(condensed->box);
    const double      cutoff = condensed->is_scaled ? scene->cutoff : scene->sought;
    return hs_is_far(cutoff, hs_exponent_of(size.short_row), HS_FAR_IMAGES_EXPONENT);
}

bool
hs_scene_has_no_scale(const hs_scene *scene, const hs_condensed *condensed)
{
    const hs_box_size size = hs_box_size_of(condensed->box);
    return (hs_scene_box_vanishes(scene) ||
            hs_open_drowns_box(&scene->cloud, &size, scene->sought)) &&
           !has_endless_images(scene, condensed);
}

hs_status
hs_scene_refuse_vanishing(const hs_scene *scene, const hs_condensed *condensed, hs_failure *failure)
{
    if (!scene->lattice.aligned && !has_endless_images(scene, condensed)) {
        return HS_ERR_BOX_SKEWED;
    }
    failure->expected_pairs = failure->expected_bytes = INFINITY; /* of images */
    return HS_ERR_MEMORY;
}
