/* SPDX-License-Identifier: BSD-3-Clause */
/* api_dynamic_ball.c: the public functions that ask what lies in a ball. */
#include "../../halfshell_dynamic.h"

#include "dynamic_call.h"
#include "../dynamic/ball_walk.h"

/* A ball for a list that has been entered; `own` holds its centre. */
static hs_status
open_ball(const hs_dynamic *list, const double *position, double radius, double *own, hs_ball *ball,
          hs_failure *failure)
{
    hs_read_position(list, position, own);
    return hs_ball_init(ball, list, own, radius, failure);
}

/* For queries that are decided exactly, which every key needs a position for. */
static hs_status
open_exact(const hs_dynamic *list, const double *position, double radius, double *own,
           hs_ball *ball, hs_failure *failure)
{
    const hs_status status = open_ball(list, position, radius, own, ball, failure);
    return status == HS_OK && list->n_without > 0 ? HS_ERR_KEY : status;
}

hs_status
hs_dynamic_near(const hs_dynamic *list, const double *position, double radius, hs_dynamic_fn visit,
                void *user, hs_failure *failure)
{
    const hs_ball_visit each = {.fn = visit, .user = user};
    hs_failure          ignored;
    hs_ball             ball;
    double              own[HS_MAX_DIM];
    failure = hs_failure_or(failure, &ignored);
    if (list == NULL || position == NULL || visit == NULL) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    hs_status             status = open_ball(list, position, radius, own, &ball, failure);
    if (status == HS_OK) {
        hs_ball_near(&ball, &each);
        status = ball.status;
    }
    hs_dynamic_leave(list, call);
    return status;
}

hs_status
hs_dynamic_within(const hs_dynamic *list, const double *position, double radius, bool with_shift,
                  hs_dynamic_fn visit, void *user, hs_failure *failure)
{
    const hs_ball_visit each = {.fn = visit, .user = user, .with_shift = with_shift};
    hs_failure          ignored;
    hs_ball             ball;
    double              own[HS_MAX_DIM];
    failure = hs_failure_or(failure, &ignored);
    if (list == NULL || position == NULL || visit == NULL) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    hs_status             status = open_exact(list, position, radius, own, &ball, failure);
    if (status == HS_OK) {
        (void)hs_ball_within(&ball, &each);
        status = ball.status;
    }
    hs_dynamic_leave(list, call);
    return status;
}

hs_status
hs_dynamic_any_within(const hs_dynamic *list, const double *position, double radius,
                      const hs_key *skip, bool *any, hs_failure *failure)
{
    static const hs_ball_visit first = {.fn = NULL};
    hs_failure                 ignored;
    hs_ball                    ball;
    double                     own[HS_MAX_DIM];
    failure = hs_failure_or(failure, &ignored);
    if (list == NULL || position == NULL || any == NULL) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    hs_status             status = open_exact(list, position, radius, own, &ball, failure);
    if (status == HS_OK && skip != NULL) {
        const uint32_t place = hs_key_map_find(&list->map, &list->entries, *skip);
        if (place != HS_NO_PLACE) {
            ball.skip = place;
        } else {
            status = HS_ERR_KEY;
        }
    }
    if (status == HS_OK) {
        *any = hs_ball_within(&ball, &first);
        status = ball.status;
    }
    hs_dynamic_leave(list, call);
    return status;
}
