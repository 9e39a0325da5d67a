/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_BOX_WRAP_H
#define HS_BOX_WRAP_H

#include "lattice.h"
#include "../exact/metric.h"

#include <math.h>

/*
 * wrap.h: X = r - w B, with integers w that bring the point r into the box. Nothing is lost: any w
 * will do, because a pair's shift S is corrected by w_i - w_j, in integers.
 */

#define HS_WRAP_LIMIT   0x1p51    /* turns beyond this are not known exactly */
#define HS_WRAP_UNKNOWN INT64_MIN /* stands for such a number of turns */

/*
 * Along one coordinate axis of an aligned box: returns x - turns * length, exactly, in
 * [-length/2, length/2]. Exact for any finite x; *turns is HS_WRAP_UNKNOWN beyond the limit.
 */
double hs_wrap_axis(double x, double length, int64_t *turns);

/*
 * In any box. r: ndim scaled coordinates. inside: receives X rounded, in the middle period
 * (|t_k| <= period/2) but for rounding. turns: receives n_periodic integers, over B. Returns false
 * beyond the limit. *magnitude: raised to the largest sum of absolute terms; the error of each
 * component of X is at most 2^-53 |X| + (2 n_periodic + 2)^2 2^-104 magnitude.
 */
bool hs_wrap_point(const hs_lattice *lattice, const double *r, double *inside, int64_t *turns,
                   double *magnitude);

/* X = r - turns * B, rounded, for turns over B; without turns r itself. Returns false when a turn
 * over the given box vectors passes 2^62. *magnitude as in hs_wrap_point. */
bool hs_wrap_by(const hs_lattice *lattice, const double *r, const int64_t *turns, double *inside,
                double *magnitude);

/*
 * Wrapping many points at once, to the bits that hs_wrap_axis and hs_wrap_point give one by one.
 * Points are columns here. The quick ways are for points that lie within a few periods of the box,
 * which is all of them nearly always.
 */

/* By how many box vectors each point was wrapped. */
typedef struct hs_turns {
    bool     known;
    int32_t *narrow[HS_MAX_DIM]; /* n each, over row r of B; NULL where they may pass int32: ... */
    int64_t *wide[HS_MAX_DIM];   /* ... then here */
} hs_turns;

HS_ALWAYS_INLINE int64_t
hs_turns_get(const hs_turns *turns, int row, int64_t i)
{
    return turns->narrow[row] != NULL ? turns->narrow[row][i] : turns->wide[row][i];
}

HS_ALWAYS_INLINE void
hs_turns_set(const hs_turns *turns, int row, int64_t i, int64_t value)
{
    if (turns->narrow[row] != NULL) {
        turns->narrow[row][i] = (int32_t)value;
    } else {
        turns->wide[row][i] = value;
    }
}

/* Range of some numbers. */
typedef struct hs_range {
    double lower, upper;
    double poison; /* 0, or NaN once a number was infinite or NaN */
} hs_range;

#define HS_NO_RANGE ((hs_range){INFINITY, -INFINITY, 0.0})

/* Widens the range to n more numbers; those that are NaN change the poison alone. */
void hs_range_widen(const double *x, int64_t n, hs_range *range);

/* What wrapping found out about the points. */
typedef struct hs_wrap_range {
    double  x_largest[HS_MAX_DIM]; /* at least the largest |X_k| */
    double  lower[HS_MAX_DIM];     /* range of t_k of X; not set in aligned lattices */
    double  upper[HS_MAX_DIM];
    double  magnitude; /* the largest sum of absolute terms of any point */
    int64_t failed;    /* lowest point that could not be wrapped, or -1 */
} hs_wrap_range;

/*
 * Along coordinate axis k of an aligned lattice: x[first, last) are wrapped in place. `largest`: at
 * least the largest |x| of the column. turns: NULL if they need not be known. Points beyond
 * HS_WRAP_LIMIT fail only where turns are wanted.
 */
void hs_fold_axis(const hs_lattice *lattice, int k, double *x, int64_t first, int64_t last,
                  double largest, const hs_turns *turns, hs_wrap_range *folded);

/*
 * In any lattice: points [first, last) of the columns r go wrapped to the columns x, which may be
 * r.
 */
void hs_fold_points(const hs_lattice *lattice, double *const *r, int64_t first, int64_t last,
                    double *const *x, const hs_turns *turns, hs_wrap_range *folded);

/* t_k of n points, with the bits of hs_lattice_coordinate: summed in its order. */
void hs_fold_coordinates(const hs_lattice *lattice, int k, const double *const *x, int64_t n,
                         double *t);

/* At least the turns over any row of B that a point with all |x| <= largest needs, and the turns
 * over the given box vectors that these make. */
double hs_fold_turns(const hs_lattice *lattice, double largest);

/*
 * The nearest image of one point to another, decided exactly, in any box. Floats with a bound on
 * their error leave few images over, nearly always one; these are compared for the real numbers
 * that the inputs are. Of images that are equally near the one with the lexicographically least
 * shift over the given box vectors counts.
 */

/* A box made ready; plain values, nothing owned. */
typedef struct hs_image_box {
    hs_metric  metric;     /* of the points and box vectors as given */
    hs_scale   scale;      /* of the lattice; unless that is aligned, its longest entry is from 1 to
                         * 2 */
    hs_lattice lattice;    /* in a short basis */
    int order[HS_MAX_DIM]; /* of the rows of B: the shortest first, unless that is aligned ... */
    /* ... when row order[r] of B is the sum of R[r][k] along[k] over k <= r. */
    double along[HS_MAX_DIM][HS_MAX_DIM]; /* unit vectors at right angles */
    double R[HS_MAX_DIM][HS_MAX_DIM];
    bool   is_spanned[HS_MAX_DIM]; /* some row of B has an entry in this coordinate */
    double rounding;               /* of a product with a unit vector, relative to its terms */
    double row_error;              /* of B, over all rows that an image is made of */
} hs_image_box;

/* box: checked (hs_box_check), or NULL. HS_OK or HS_ERR_BOX_SKEWED. */
hs_status hs_image_box_init(const hs_box *box, int ndim, hs_image_box *to);

/*
 * Sets the shift of the image of q that is nearest to p, over the periodic box vectors as given.
 * HS_ERR_SHIFT_RANGE for points too many periods away, HS_ERR_BOX_SKEWED where too many images are
 * about as near. Needs at least one periodic box vector.
 */
hs_status hs_near_image(const hs_image_box *box, const double *p, const double *q, int64_t *shift);

#endif
