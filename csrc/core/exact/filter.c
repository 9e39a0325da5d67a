/* SPDX-License-Identifier: BSD-3-Clause */
#include "filter.h"
#include "bounds.h"
#include "arithmetic.h"

#include <float.h>
#include <math.h>

/* filter.c: the float32 thresholds, every step of their computation rounded to the safe side. */

/* Sums of numbers >= 0, rounded up. */
static double
add_up(double a, double b)
{
    return hs_next_up(a + b);
}

/* Roundings of y and of q, in units of their size. */
static double
input_rounding(double unit)
{
    return hs_multiply_up(HS_FILTER_INPUT_ROUNDINGS + HS_FILTER_SLACK, unit);
}

/* What else may be wrong with a component of y - q: what the caller knows of errors before y and q
 * were rounded to floats, and numbers flushed to zero. */
static double
other_error(double error, double tiny)
{
    return add_up(hs_multiply_up(HS_FILTER_ERRORS, error), hs_multiply_up(HS_FILTER_FLUSHES, tiny));
}

/* How far the vector y - q that the kernel subtracts may be from D, Euclidean. */
static double
input_error(int ndim, double extent, double error, double unit, double tiny)
{
    const double component =
        add_up(hs_multiply_up(input_rounding(unit), extent), other_error(error, tiny));
    return hs_multiply_up(hs_next_up(sqrt((double)ndim)), component);
}

double
hs_reach_bound(double cutoff, double largest, double error, double unit, double tiny)
{
    const double rounding = input_rounding(unit);
    const double apart = add_up(cutoff, other_error(error, tiny));
    const double sum = add_up(hs_multiply_up(2.0, largest), apart);
    return rounding < 0.5 ? hs_next_up(sum / hs_next_down(1.0 - rounding)) : HUGE_VAL;
}

double
hs_reach_extent(double cutoff, double largest, double error)
{
    return hs_reach_bound(cutoff, largest, error, HS_FILTER_UNIT, HS_FILTER_TINY);
}

void
hs_threshold_bounds(int ndim, double cutoff, double extent, double error, double unit, double tiny,
                    double *in, double *out)
{
    const double a = input_error(ndim, extent, error, unit, tiny);
    const double difference = hs_multiply_up(HS_FILTER_DIFFERENCE_ROUNDINGS, unit);
    const double roundings = hs_multiply_up(HS_FILTER_SQUARE_ROUNDINGS * ndim, unit);
    const double lost = hs_multiply_up(HS_FILTER_SQUARE_FLUSHES * ndim, tiny);
    *in = -1.0;
    *out = HUGE_VAL;
    if (!(a <= DBL_MAX) || !(roundings < 0.5)) { /* not for infinity and NaN either */
        return;
    }

    /* n successive roundings change a number by at most the factor 1 +- gamma. */
    const double gamma = hs_next_up(roundings / hs_next_down(1.0 - roundings));

    const double far_root = hs_multiply_up(hs_next_up(1.0 + difference), add_up(cutoff, a));
    *out =
        add_up(hs_multiply_up(hs_multiply_up(far_root, far_root), hs_next_up(1.0 + gamma)), lost);

    if (cutoff <= a) {
        return;
    }
    const double near_root =
        hs_multiply_down(hs_next_down(1.0 - difference), hs_next_down(cutoff - a));
    const double near_square =
        hs_multiply_down(hs_multiply_down(near_root, near_root), hs_next_down(1.0 - gamma));
    if (near_square > lost) {
        *in = hs_next_down(near_square - lost);
    }
}

/* Rounded outwards: s < in and s > out keep their meaning for every float s. */
static float
float_below(double x)
{
    const float rounded = x > FLT_MAX ? FLT_MAX : (float)x;
    return (double)rounded > x ? nextafterf(rounded, -INFINITY) : rounded;
}

static float
float_above(double x)
{
    const float rounded = x > FLT_MAX ? INFINITY : (float)x;
    return (double)rounded < x ? nextafterf(rounded, INFINITY) : rounded;
}

hs_limit_form
hs_limit_form_of(int ndim, double extent, double error)
{
    const double unit = HS_FILTER_UNIT, tiny = HS_FILTER_TINY;
    const double a = input_error(ndim, extent, error, unit, tiny);
    const double difference = hs_multiply_up(HS_FILTER_DIFFERENCE_ROUNDINGS, unit);
    const double roundings = hs_multiply_up(HS_FILTER_SQUARE_ROUNDINGS * ndim, unit);
    const double gamma = hs_next_up(roundings / hs_next_down(1.0 - roundings));
    const double own = hs_multiply_up(HS_FILTER_LIMIT_ROUNDINGS, unit);
    /* What is lost of the squares, and of both radii; (x + y)^2 is at least x^2 + y^2. */
    const double lost =
        add_up(hs_next_up(sqrt(hs_multiply_up(HS_FILTER_SQUARE_FLUSHES * ndim, tiny))), 4.0 * tiny);
    const double far = hs_multiply_up(hs_next_up(1.0 + difference), hs_next_up(sqrt(1.0 + gamma)));
    const double near =
        hs_multiply_down(hs_next_down(1.0 - difference), sqrt(1.0 - gamma) - unit * unit);
    const double more = hs_next_up(1.0 + own);
    if (!(a <= DBL_MAX)) { /* not for NaN either */
        return (hs_limit_form){1.0f, INFINITY, 1.0f, INFINITY};
    }
    return (hs_limit_form){
        .in_factor = float_below(hs_multiply_down(near, hs_next_down(1.0 - own))),
        .in_less = float_above(hs_multiply_up(add_up(a, lost), more)),
        .out_factor = float_above(hs_multiply_up(far, more)),
        .out_more = float_above(hs_multiply_up(add_up(hs_multiply_up(a, far), lost), more))};
}

double
hs_support_roundings(int ndim, double unit)
{
    return hs_multiply_up(HS_SUPPORT_FILTER_ROUNDINGS + HS_SUPPORT_FILTER_ROUNDINGS_PER_AXIS * ndim,
                          unit);
}

hs_limit_form
hs_support_form_of(int ndim, double extent, double error)
{
    const double unit = HS_FILTER_UNIT, tiny = HS_FILTER_TINY, axes = ndim;
    const double largest = hs_multiply_up(hs_next_up(sqrt(axes)), extent); /* |y - q| */
    const double moved = add_up(input_error(ndim, extent, error, unit, tiny),
                                hs_multiply_up(hs_support_roundings(ndim, unit), largest));
    const double roundings = hs_multiply_up(HS_FILTER_SQUARE_ROUNDINGS * axes, unit);
    const double gamma = hs_next_up(roundings / hs_next_down(1.0 - roundings));
    const double own = hs_multiply_up(HS_FILTER_LIMIT_ROUNDINGS, unit);
    const double more = hs_next_up(1.0 + own), less = hs_next_down(1.0 - own);
    /* Flushed to zero: entries, products and sums of each component, and then squares. */
    const double flushed = hs_multiply_up(hs_multiply_up(axes * axes, tiny), add_up(extent, 2.0));
    const double lost = hs_next_up(sqrt(hs_multiply_up(HS_FILTER_SQUARE_FLUSHES * axes, tiny)));
    const double far = hs_next_up(sqrt(1.0 + gamma)), near = sqrt(1.0 - gamma) - unit * unit;
    if (!(moved <= FLT_MAX) || !(flushed < 0.5)) { /* not for NaN either */
        return (hs_limit_form){1.0f, INFINITY, 1.0f, INFINITY};
    }
    const double in = hs_multiply_down(near, hs_next_down(1.0 - flushed)) - lost;
    const double out = add_up(hs_multiply_up(far, add_up(1.0, flushed)), lost);
    return (hs_limit_form){.in_factor = -float_above(hs_multiply_up(moved, more)),
                           .in_less = -float_below(hs_multiply_down(hs_next_down(in), less)),
                           .out_factor =
                               float_above(hs_multiply_up(hs_multiply_up(far, moved), more)),
                           .out_more = float_above(hs_multiply_up(out, more))};
}

hs_thresholds
hs_thresholds_of(int ndim, double cutoff, double extent, double error)
{
    double in, out;
    hs_threshold_bounds(ndim, cutoff, extent, error, HS_FILTER_UNIT, HS_FILTER_TINY, &in, &out);
    return (hs_thresholds){float_below(in), float_above(out)};
}
