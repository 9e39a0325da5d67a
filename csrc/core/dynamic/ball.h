/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * ball.h: the ball of a query, and the test whether an entry lies in it. Exact: a float64 square
 * with a proven bound first, then the stages of metric.h on the positions that were given.
 */
#ifndef HS_BALL_H
#define HS_BALL_H

#include "place_point.h"
#include "../exact/metric.h"

/* Radius for cells in place of a smaller one: its square is not 0. */
#define HS_LEAST_BALL 0x1p-400

/* That one ball looks at: those of new_list.c, and the images that a far centre adds. */
#define HS_MOST_BALL_IMAGES 0x1p24

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
} hs_ball_visit;

/* position: borrowed while the ball is in use. HS_ERR_CUTOFF, HS_ERR_NOT_FINITE,
 * HS_ERR_SHIFT_RANGE. */
hs_status hs_ball_init(hs_ball *ball, const hs_dynamic *list, const double *position, double radius,
                       hs_failure *failure);

/* Whether this is the image S = 0 of the entry that is skipped: the one that does not count. */
bool hs_ball_skips(const hs_ball *ball, const hs_ball_image *image);

/* The centre for another image. */
void hs_ball_turn(const hs_ball *ball, const int64_t *image, hs_ball_image *turned);

/* Decides for an entry that the thresholds left open. */
bool hs_ball_settle(hs_ball *ball, const hs_ball_image *image, uint32_t place);

/* S of an entry over the box vectors: ndim integers, 0 where the box does not repeat. False where
 * it passes 2^62: ball->status says so then. */
bool hs_ball_shift(hs_ball *ball, const hs_ball_image *image, uint32_t place, int64_t *shift);

#endif
