/* SPDX-License-Identifier: BSD-3-Clause */
/* api_verlet.c: the public functions of a list that is used for many steps; docs/verlet.md. */
#include "../verlet/pair_list.h"
#include "../verlet/recheck.h"

#include "request.h"
#include "../box/lattice.h"
#include "../memory/account.h"
#include "../verlet/motion.h"
#include "../exact/doubleword.h"

#include <math.h>
#include <string.h>

hs_verlet *
hs_verlet_new(void)
{
    hs_verlet *list = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *list);
    if (list != NULL) {
        memset(list, 0, sizeof *list);
        list->jumps_now = -1;
        list->frames[0].points.ndim = 1;
    }
    return list;
}

void
hs_verlet_free(hs_verlet *list)
{
    if (list == NULL) {
        return;
    }
    hs_listing_free(&list->listing);
    for (int f = 0; f < 3; f++) {
        hs_frame_free(&list->frames[f]);
    }
    hs_store_free(&list->jumps[0]);
    hs_store_free(&list->jumps[1]);
    hs_free(NULL, list);
}

hs_verlet_state
hs_verlet_look(const hs_verlet *list)
{
    if (list == NULL) {
        return (hs_verlet_state){.has_list = false};
    }
    return (hs_verlet_state){.has_list = list->has_list,
                             .ndim = list->frames[list->now].points.ndim,
                             .n_points = list->frames[list->now].points.n,
                             .n_listed = list->listing.n_pairs,
                             .cutoff = list->cutoff,
                             .radius = list->listing.radius,
                             .margin = list->margin,
                             .tried = list->tried};
}

static bool
is_length(double x)
{
    return x >= 0.0 && isfinite(x);
}

/* cutoff + skin, rounded up. */
static double
radius_of(double cutoff, double skin)
{
    const hs_dw sum = hs_two_sum(cutoff, skin);
    return sum.lo > 0.0 ? hs_next_up(sum.hi) : sum.hi;
}

/* The frame that is not in use. */
static int
spare_frame(const hs_verlet *list)
{
    int f = 0;
    while (f == list->built || f == list->now) {
        f++;
    }
    return f;
}

/* The list serves the points of frame `next` as well, or *margin is negative. */
static hs_status
try_to_keep(hs_verlet *list, int next, const hs_options *options, double *margin)
{
    const hs_motion motion = {.built = &list->frames[list->built],
                              .now = &list->frames[next],
                              .radius = list->listing.radius,
                              .cutoff = list->cutoff};
    const int       spare = list->jumps_now == 0 ? 1 : 0;
    bool            jumped = false;
    if (!list->has_list || options->cutoff != list->cutoff ||
        !hs_frames_match(motion.built, motion.now)) {
        return HS_OK;
    }
    const hs_status status =
        hs_motion_margin(&motion, options, margin, &jumped, &list->jumps[spare]);
    if (status == HS_OK && *margin >= 0.0) {
        list->now = next;
        list->margin = *margin;
        list->jumps_now = jumped ? spare : -1;
    }
    return status;
}

static hs_status
build(hs_verlet *list, int next, const hs_options *options, double skin, hs_failure *failure)
{
    const double radius = radius_of(options->cutoff, skin);
    if (!is_length(skin) || !is_length(radius)) {
        failure->value = radius;
        return HS_ERR_CUTOFF;
    }
    const hs_status status =
        hs_listing_build(&list->frames[next], options, radius, &list->listing, failure);
    if (status == HS_OK) {
        const double room = radius - options->cutoff;
        list->has_list = true;
        list->built = list->now = next;
        list->jumps_now = -1;
        list->cutoff = options->cutoff;
        list->margin = options->cutoff > 0.0 && room > 0.0 ? hs_next_down(room) : room;
    }
    return status;
}

static hs_status
update(hs_verlet *list, const hs_points *points, const hs_box *box, const hs_options *options,
       double skin, bool rebuild, bool *rebuilt, hs_failure *failure)
{
    const int next = spare_frame(list);
    double    margin = -INFINITY;
    if (!is_length(options->cutoff)) {
        failure->value = options->cutoff;
        return HS_ERR_CUTOFF;
    }
    hs_status status = hs_check_resources(options);
    if (status == HS_OK) {
        status = hs_check_points(points, failure);
    }
    if (status == HS_OK) {
        status = hs_check_box(box, points->ndim);
    }
    if (status == HS_OK) {
        status = hs_box_check(box, failure);
    }
    if (status == HS_OK) {
        status = hs_frame_take(points, box, options, &list->frames[next], failure);
    }
    if (status == HS_OK && !rebuild) {
        status = try_to_keep(list, next, options, &margin);
    }
    const bool needed = status == HS_OK && !(margin >= 0.0);
    if (needed) {
        status = build(list, next, options, skin, failure);
    }
    if (status == HS_OK) {
        *rebuilt = needed;
        list->tried = margin;
    }
    return status;
}

hs_status
hs_verlet_update(hs_verlet *list, const hs_points *points, const hs_box *box,
                 const hs_options *options, double skin, bool rebuild, bool *rebuilt,
                 hs_failure *failure)
{
    hs_entry entry;
    if (list == NULL || options == NULL || rebuilt == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, NULL, failure);
    }
    failure = hs_enter(failure, &entry);
    const hs_status status = update(list, points, box, options, skin, rebuild, rebuilt, failure);
    hs_leave(&entry);
    return status;
}

hs_status
hs_verlet_find(const hs_verlet *list, const hs_options *options, hs_pairs **result,
               hs_failure *failure)
{
    if (!hs_can_return(result, options) || list == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_options of_list = *options;
    of_list.cutoff = list->cutoff;
    of_list.precision = HS_EXACT;
    if (hs_check_options(&of_list) != HS_OK) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_pairs *pairs = hs_pairs_begin(&of_list, &failure);
    if (pairs == NULL) {
        return HS_ERR_MEMORY;
    }
    const hs_status status = hs_recheck_find(list, pairs, failure);
    return hs_pairs_finish(pairs, status, pairs->output.n_pairs, result);
}
