/* SPDX-License-Identifier: BSD-3-Clause */
/* other_calls.h: as calls.h, the functions that return no pairs of a search: clusters, plans, boxes,
 * and measures of given pairs. */
#ifndef HS_OTHER_CALLS_H
#define HS_OTHER_CALLS_H

#include "calls.h"

#include <float.h>

/* Every third point is none that clusters are made of. */
static inline hs_status
call_clusters(call *c, hs_failure *failure)
{
    const hs_among among = call_among(c, NULL);
    int64_t        labels[CALL_ROOM], n = -7;
    uint8_t        core[CALL_ROOM], winding[CALL_ROOM];
    for (int p = 0; p < CALL_ROOM; p++) {
        core[p] = p % 3 != 0;
    }
    const hs_status status =
        hs_clusters_find(&among, c->options, core, labels, winding, RESULT(n), failure);
    CHECK(status == HS_OK ? n >= 0 : n == -7);
    if (status == HS_OK) {
        c->answer = hash_bytes(hash_bytes(2, labels, (size_t)c->n_points * 8), winding, (size_t)n);
    }
    return status;
}

static inline hs_status
call_plan(call *c, hs_failure *failure)
{
    const hs_among among = call_among(c, NULL);
    hs_plan        plan, untouched;
    memset(&plan, 0x5a, sizeof plan);
    memcpy(&untouched, &plan, sizeof plan);
    const hs_status status = hs_plan_make(&among, c->options, RESULT(plan), failure);
    CHECK(status == HS_OK || memcmp(&plan, &untouched, sizeof plan) == 0);
    c->answer = status == HS_OK ? hash_plan(9, &plan) : c->answer;
    return status;
}

static inline hs_status
call_box_measure(call *c, hs_failure *failure)
{
    double          heights[HS_MAX_DIM] = {-7.0}, volume = -7.0;
    const hs_status status = hs_box_measure(c->box, heights, &volume, failure);
    CHECK((status == HS_OK) == (volume >= 0.0));
    if (status == HS_OK)
        c->answer = hash_bytes(hash_bytes(2, &volume, sizeof volume), heights, sizeof heights);
    return status;
}

static inline hs_status
call_box_places(call *c, hs_failure *failure)
{
    double          places[CALL_ROOM] = {0.0};
    hs_box_axes     axes = {.reach = {-7.0}};
    const double    cutoff = c->options != NULL ? c->options->cutoff : 1.0;
    const hs_status status = hs_box_places(c->box, c->points, cutoff, DBL_MAX, places,
                                           CALL_ROOM / HS_MAX_DIM, &axes, failure);
    CHECK((status == HS_OK) == (axes.reach[0] >= 0.0));
    if (status == HS_OK)
        c->answer = hash_bytes(hash_bytes(4, places, sizeof places), axes.reach, sizeof axes.reach);
    return status;
}

static inline hs_status
call_box_wrap(call *c, hs_failure *failure)
{
    double          wrapped[CALL_ROOM];
    int64_t         shift[CALL_ROOM];
    const hs_status status = hs_box_wrap(c->box, c->points, wrapped, shift, failure);
    if (status == HS_OK) {
        const size_t n = (size_t)(c->points->n * c->points->ndim);
        c->answer = hash_bytes(hash_bytes(4, wrapped, n * 8), shift, n * 8);
    }
    return status;
}

/* Each point and the one seven behind it. */
static inline hs_status
call_measure(call *c, hs_failure *failure)
{
    int64_t   i[CALL_ROOM], j[CALL_ROOM];
    hs_pairs *pairs = CALL_NOTHING;
    for (int64_t e = 0; e < c->n_points; e++) {
        i[e] = e;
        j[e] = (e + 7) % c->n_points;
    }
    const hs_pair_numbers given = {.n = c->n_points, .i = i, .j = j};
    const hs_status       status =
        hs_measure(c->points, c->box, &given, c->options, RESULT(pairs), failure);
    return call_take_pairs(c, status, pairs);
}

static inline hs_status
call_systems_clusters(call *c, hs_failure *failure)
{
    return call_in_systems(c, call_clusters, failure);
}

#endif
