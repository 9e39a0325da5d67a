/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_DYNAMIC_BALL_H
#define HS_DYNAMIC_BALL_H

#include "dynamic.h"
#include "../exact/metric.h"
#include "../base/os.h"

/*
 * ball.h: the ball of a query, and the test whether an entry lies in it. Exact: a float64 square
 * with a proven bound first, then the stages of metric.h on the positions that were given.
 */

/* The centre as entries see it that have been moved by `image`: centre - image * B. */
typedef struct hs_ball_image {
    double  centre[HS_MAX_DIM];
    int64_t image[HS_MAX_DIM]; /* over the rows of B */
    double  in, out; /* a square below `in` is surely within, one above `out` surely not */
} hs_ball_image;

typedef struct hs_ball {
    const hs_dynamic *list;
    double            radius;
    hs_placed         centre;
    double            error;  /* of each coordinate of X and P together; 0 in aligned boxes */
    uint32_t          skip;   /* place of an entry, or HS_NO_PLACE */
    hs_status         status; /* of the walk: HS_ERR_SHIFT_RANGE, HS_ERR_INTERRUPTED */
    hs_span_of_cells  span[HS_MAX_DIM];
    hs_ball_image     home; /* no image */
} hs_ball;

/* What to do with each entry. */
typedef struct hs_ball_visit {
    hs_dynamic_fn fn; /* NULL: the first one is enough */
    void         *user;
    bool          with_shift;
    bool          is_near; /* no distances: entries of all cells of the ball, each once */
} hs_ball_visit;

/* position: borrowed while the ball is in use. HS_ERR_CUTOFF, HS_ERR_NOT_FINITE,
 * HS_ERR_SHIFT_RANGE. */
hs_status hs_ball_init(hs_ball *ball, const hs_dynamic *list, const double *position, double radius,
                       hs_failure *failure);

/* Entries within the ball, in each image, or near it; whether it was left early. The spans of the
 * ball may be cut. */
bool hs_ball_walk(hs_ball *ball, const hs_ball_visit *visit);

#endif
