/* SPDX-License-Identifier: BSD-3-Clause */
/* tiny_floats.h: floating-point systems so small that every number can be tried, in double. */
#ifndef HS_TINY_FLOATS_H
#define HS_TINY_FLOATS_H

#include <float.h>
#include <math.h>
#include <stdbool.h>

typedef struct tiny_system {
    int    digits; /* bits of a significand: unit roundoff 2^-digits */
    int    lowest; /* smallest normal number: 2^lowest */
    bool   flush;  /* numbers below it become zero */
    bool   fused;  /* sums of squares use a fused multiply-add */
    double unit, tiny;
} tiny_system;

static inline tiny_system
make_system(int digits, int lowest, bool flush, bool fused)
{
    return (tiny_system){digits, lowest, flush, fused, ldexp(1.0, -digits), ldexp(1.0, lowest)};
}

/* x rounded to the system; exact in double because its significands are so short. */
static inline double
round_to(const tiny_system *system, double x)
{
    int exponent;
    if (x == 0.0)
        return 0.0;
    (void)frexp(x, &exponent); /* |x| in [2^(exponent - 1), 2^exponent) */
    if (exponent - 1 < system->lowest)
        exponent = system->lowest + 1;
    const double spacing = ldexp(1.0, exponent - system->digits);
    const double rounded = nearbyint(x / spacing) * spacing;
    return system->flush && fabs(rounded) < system->tiny ? 0.0 : rounded;
}

/* How far the real number may lie on either side of a float: half the gap, or all of a flush. */
static inline void
real_interval(const tiny_system *system, double y, double *low, double *high)
{
    const double size = fabs(y);
    int          exponent;
    if (size == 0.0 && system->flush) {
        *low = -system->tiny;
        *high = system->tiny;
        return;
    }
    (void)frexp(size, &exponent);
    if (size == 0.0 || exponent - 1 < system->lowest)
        exponent = system->lowest + 1;
    const double spacing = ldexp(1.0, exponent - system->digits);
    const bool   power = size == ldexp(0.5, exponent) && exponent - 1 > system->lowest;
    const double far = size + 0.5 * spacing;
    const double near = size - (power ? 0.25 : 0.5) * spacing;
    *low = y < 0.0 ? -far : near;
    *high = y < 0.0 ? -near : far;
}

/* Every nonnegative number below 2^(lowest + binades); returns how many. */
static inline int
list_numbers(const tiny_system *system, int binades, double *numbers)
{
    int       n = 0;
    const int per_binade = 1 << (system->digits - 1);
    for (int i = 0; i < per_binade; i++)
        if (i == 0 || !system->flush)
            numbers[n++] = ldexp((double)i, system->lowest - system->digits + 1);
    for (int binade = 0; binade < binades; binade++)
        for (int i = 0; i < per_binade; i++)
            numbers[n++] =
                ldexp((double)(per_binade + i), system->lowest + binade - system->digits + 1);
    return n;
}

/* Smallest and largest |Y - Q| over the reals that y and q may stand for, each wrong by `error`
 * and by 2^-18 of a rounding more. */
static inline void
distance_interval(const tiny_system *system, double y, double q, double error, double *low,
                  double *high)
{
    double       y_low, y_high, q_low, q_high;
    const double more = 2.0 * error + 0x1p-18 * system->unit * (fabs(y) + fabs(q));
    real_interval(system, y, &y_low, &y_high);
    real_interval(system, q, &q_low, &q_high);
    const double from = y_low - q_high - more, to = y_high - q_low + more;
    *high = fabs(from) > fabs(to) ? fabs(from) : fabs(to);
    *low = from <= 0.0 && to >= 0.0 ? 0.0 : fabs(from) < fabs(to) ? fabs(from) : fabs(to);
}

#endif
