/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_DYNAMIC_BALL_H
#define HS_DYNAMIC_BALL_H

#include "dynamic.h"

/*
 * ball.h: the ball of a query, and the test whether an entry lies in it. Exact: a float64 square
 * with a proven bound first, then the stages of metric.h on the positions that were given.
 */

/* The grid axes of a list, which has its lattice and largest radius. cell_size: least width, where
 * `one_cell` is false. */
void hs_axes_init(hs_dynamic *list, double cell_size, bool one_cell);

/* Offsets for balls up to that radius, as far as they are not too many. False when memory is
 * refused. */
bool hs_offsets_init(hs_dynamic *list);

/* Cells that a ball meets along one axis. */
typedef struct hs_span_of_cells {
    int64_t first, last; /* u of cells; last < first: none */
    int64_t least, most; /* images */
} hs_span_of_cells;

/* A double at most x - y, and one at least x + y. Where they are subnormal, the sum was exact. */
HS_ALWAYS_INLINE double
hs_below(double x, double y)
{
    const double sum = x - y;
    return sum - fabs(sum) * 0x1p-52;
}

HS_ALWAYS_INLINE double
hs_above(double x, double y)
{
    const double sum = x + y;
    return sum + fabs(sum) * 0x1p-52;
}

/* The cells of a ball that meets other images: less than 2^30 of them. low, high: its ends, rounded
 * outwards; error: what coordinates may be wrong by. */
void hs_axis_images(const hs_axis *axis, double low, double high, double error,
                    hs_span_of_cells *span);

/* The cells of a ball. t: its centre, in the middle period but for rounding; radius: with the
 * error. */
HS_ALWAYS_INLINE void
hs_axis_span(const hs_axis *axis, double t, double radius, double error, hs_span_of_cells *span)
{
    const double low = hs_below(t, radius), high = hs_above(t, radius);
    if (axis->n == 0 || (low >= -axis->half + error && high <= axis->half - error)) {
        span->first = hs_axis_cell(axis, low);
        span->last = hs_axis_cell(axis, high);
        span->least = span->most = 0;
    } else {
        hs_axis_images(axis, low, high, error, span);
    }
}

/* Cell and image of u. */
HS_ALWAYS_INLINE int64_t
hs_axis_image(const hs_axis *axis, int64_t u)
{
    if (axis->n == 0 || (uint64_t)u < (uint64_t)axis->n) {
        return 0;
    }
    return u >= 0 ? u / axis->n : -((-u - 1) / axis->n) - 1;
}

/*
 * At most the square of the distance along the axis from t to the points of cell u; 0 where that is
 * not known to be more. An edge at u * width - half is computed with three roundings, and an index
 * with three more: 2^-44 of all that goes into them is a hundred times as much.
 */
HS_ALWAYS_INLINE double
hs_axis_gap(const hs_axis *axis, double t, int64_t u, int64_t centre)
{
    if (u == centre || axis->inverse == 0.0) {
        return 0.0;
    }
    const double edge = (double)(u + (u < centre)) * axis->width;
    const double distance = u > centre ? (edge - axis->half) - t : t - (edge - axis->half);
    const double gap = distance - 0x1p-44 * (fabs(edge) + fabs(t) + axis->half + axis->width);
    return gap > 0.0 ? gap * gap : 0.0;
}

/* The centre as entries see it that have been moved by `image`: centre - image * B. */
typedef struct hs_ball_image {
    double  centre[HS_MAX_DIM];
    int64_t image[HS_MAX_DIM]; /* over the rows of B */
    double  in, out; /* a square below `in` is surely within, one above `out` surely not */
} hs_ball_image;

/* What to do with each entry. */
typedef struct hs_ball_visit {
    hs_dynamic_fn fn; /* NULL: the first one is enough */
    void         *user;
    bool          with_shift;
    bool          is_near; /* no distances: entries of all cells of the ball, each once */
} hs_ball_visit;

typedef struct hs_ball {
    const hs_dynamic    *list;
    const hs_ball_visit *visit; /* borrowed; set before the walk */
    double               radius;
    double               limit; /* cells with larger gaps are beyond the radius */
    hs_placed            centre;
    double               error;  /* of each coordinate of X and P together; 0 in aligned boxes */
    uint32_t             skip;   /* place of an entry, or HS_NO_PLACE */
    hs_status            status; /* of the walk: HS_ERR_SHIFT_RANGE, HS_ERR_INTERRUPTED */
    hs_span_of_cells     span[HS_MAX_DIM];
    unsigned             cut;    /* bit k: each cell in one image, where it is nearest */
    hs_ball_image        home;   /* no image */
    hs_ball_image        turned; /* the last image but home, if there is one */
    bool                 has_turned, meets_images;
    bool                 filters; /* cells may hold entries that are none of the ball's cells */
    int64_t              work;    /* entries and cells since the last poll */
} hs_ball;

/* position: borrowed while the ball is in use. HS_ERR_CUTOFF, HS_ERR_NOT_FINITE,
 * HS_ERR_SHIFT_RANGE. */
hs_status hs_ball_init(hs_ball *ball, const hs_dynamic *list, const double *position, double radius,
                       hs_failure *failure);

#endif
