/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * focus.h: where most of the points are. A grid stretched to a few far outliers would put all the
 * others into one cell. Points beyond the grid count as on its faces, which brings no two points
 * further apart, so a grid may cover any part of space without losing a pair.
 */
#ifndef HS_FOCUS_H
#define HS_FOCUS_H

#include "scene.h"

/*
 * Narrows scene->lower and ->upper of open axes to where a sample of the points says that nearly
 * all are, if a grid over the whole range would have more cells than points. Costs some
 * microseconds then, nothing otherwise. Leaves scenes alone whose grid axes are not coordinate
 * axes.
 */
void hs_focus_ranges(hs_scene *scene);

#endif
