/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * support_width.h: how far pairs of a step can be apart along an axis of the grid, by their
 * supports: cells go by that, so that needles along an axis have few candidates across it.
 */
#ifndef HS_SUPPORT_WIDTH_H
#define HS_SUPPORT_WIDTH_H

#include "../scene/scene.h"

#include "level_plan.h"

/* A step whose pairs are decided by supports; borrowed. */
typedef struct hs_support_step {
    const hs_levels     *levels;
    const hs_level_step *step;
    const hs_options    *options; /* to poll by */
} hs_support_step;

/* The `find` of a hs_narrowing, whose context is a hs_support_step. */
hs_status hs_support_step_width(const void *context, const double *normal, double enough,
                                double *width);

#endif
