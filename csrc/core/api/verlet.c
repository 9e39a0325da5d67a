/* SPDX-License-Identifier: BSD-3-Clause */
#include "../verlet/pair_list.h"
#include "query.h"

#include <math.h>
#include <string.h>

/* verlet.c: the public functions of a list that is used for many steps; docs/verlet.md. */

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
    hs_free(NULL, list->jumps[0]);
    hs_free(NULL, list->jumps[1]);
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

hs_status
hs_verlet_update(hs_verlet *list, const hs_points *points, const hs_box *box,
                 const hs_options *options, double skin, bool rebuild, bool *rebuilt,
                 hs_failure *failure)
{
    hs_entry entry;
    double   margin = -INFINITY;
    int      next = 0; /* the frame that is not in use */
    if (list == NULL || options == NULL || rebuilt == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, NULL, failure);
    }
    while (next == list->built || next == list->now) {
        next++;
    }
    failure = hs_enter(failure, &entry);
    hs_status status = hs_check_resources(options);
    if (!hs_is_length(options->cutoff)) {
        failure->value = options->cutoff;
        status = HS_ERR_CUTOFF;
    }
    if (status == HS_OK) {
        status = hs_check_sets(points, NULL, box, failure);
        status = status == HS_OK ? hs_box_check(box, failure) : status;
    }
    if (status == HS_OK) {
        status = hs_frame_take(points, box, options, &list->frames[next], failure);
    }
    const hs_frame *now = &list->frames[next];
    const int       spare = list->jumps_now == 0 ? 1 : 0;
    bool            jumped = false;
    if (status == HS_OK && !rebuild && list->has_list && options->cutoff == list->cutoff &&
        hs_frames_match(&list->frames[list->built], now)) {
        status = hs_motion_margin(list, now, options, &margin, &jumped, &list->jumps[spare]);
    }
    const bool needed = status == HS_OK && !(margin >= 0.0);
    if (needed) {
        const hs_dw  sum = hs_two_sum(options->cutoff, skin);
        const double radius = sum.lo > 0.0 ? hs_next_up(sum.hi) : sum.hi; /* rounded up */
        const double room = radius - options->cutoff;
        if (hs_is_length(skin) && hs_is_length(radius)) {
            status = hs_listing_build(now, options, radius, &list->listing, failure);
        } else {
            failure->value = radius;
            status = HS_ERR_CUTOFF;
        }
        if (status == HS_OK) {
            list->has_list = true;
            list->built = list->now = next;
            list->jumps_now = -1;
            list->cutoff = options->cutoff;
            list->margin = options->cutoff > 0.0 && room > 0.0 ? hs_next_down(room) : room;
        }
    } else if (status == HS_OK) {
        list->now = next;
        list->margin = margin;
        list->jumps_now = jumped ? spare : -1;
    }
    if (status == HS_OK) {
        *rebuilt = needed;
        list->tried = margin;
    }
    hs_leave(&entry);
    return status;
}

hs_status
hs_verlet_find(const hs_verlet *list, const hs_options *options, hs_pairs **result,
               hs_failure *failure)
{
    hs_status status;
    hs_pairs *pairs = hs_result_begin(list != NULL, options, result, &failure, &status);
    if (pairs != NULL) {
        pairs->call.options.cutoff = list->cutoff;
        pairs->call.options.precision = HS_EXACT;
        status = hs_check_options(&pairs->call.options, HS_WANT_ALL);
    }
    if (status == HS_OK) {
        status = hs_recheck_find(list, pairs, failure);
    }
    return hs_result_end(pairs, status, result, failure);
}
