/* SPDX-License-Identifier: BSD-3-Clause */
/* metric_measure.c: the distance and the vector of a pair, to the last place. */
#include "metric.h"

#include "metric_float.h"
#include "metric_integer.h"

/* |D| of a D that is exact as a double-word up to difference->error. */
HS_ALWAYS_INLINE double
distance_of(const hs_difference *difference, int ndim)
{
    return hs_dw_sqrt(hs_double_word_square(difference, ndim));
}

/*
 * In double-words, or false where their error might reach the last place. The final rounding takes
 * half a unit in the last place, of a component or of |D|, which leaves half a unit for the error
 * of D and for the double-word roundings. The former is held to a quarter; the latter are below
 * 1e-14 of a unit.
 */
HS_ALWAYS_INLINE bool
measure_in_floats(const hs_metric *metric, const double *p, const double *q, const int64_t *shift,
                  int ndim, double *vector, double *distance)
{
    hs_difference difference;
    if (shift == NULL || metric->n_rows == 0) {
        hs_difference_plain(&difference, p, q, ndim);
    } else if (!metric->floats_usable ||
               !hs_difference_shifted(&difference, metric, p, q, shift, ndim, false)) {
        return false;
    }

    double largest = 0.0;
    for (int k = 0; k < ndim; k++) {
        const double size = fabs(difference.component[k].hi);
        largest = size > largest ? size : largest;
    }
    if (largest == 0.0 && difference.error == 0.0) {
        *distance = 0.0;
    } else if (!(largest >= 0x1p-400 && largest <= 0x1p400)) {
        return false;
    } else {
        *distance = distance_of(&difference, ndim);
    }
    /* The lower neighbour is the closer one, so this is the stricter side. */
    if (*distance - 2.0 * difference.error != *distance) {
        return false;
    }
    for (int k = 0; vector != NULL && k < ndim; k++) {
        vector[k] = difference.component[k].hi;
    }
    return true;
}

/* By integers: D scaled to where nothing overflows, and scaled back. */
static HS_NO_INLINE double
measure_in_integers(const hs_metric *metric, const double *p, const double *q, const int64_t *shift,
                    double *vector)
{
    hs_difference difference;
    int           exponent;
    double        largest = 0.0;
    hs_integer_difference(metric, p, q, shift, difference.component, &exponent);
    difference.error = 0.0;
    for (int k = 0; k < metric->ndim; k++) {
        const double component = difference.component[k].hi;
        largest = fabs(component) > largest ? fabs(component) : largest;
        if (vector != NULL) {
            vector[k] = ldexp(component, exponent);
        }
    }
    return largest == 0.0 ? 0.0 : ldexp(distance_of(&difference, metric->ndim), exponent);
}

double
hs_metric_measure(const hs_metric *metric, const double *p, const double *q, const int64_t *shift,
                  double *vector)
{
    double distance;
    bool   done;
    switch (metric->ndim) {
    case 2: done = measure_in_floats(metric, p, q, shift, 2, vector, &distance); break;
    case 3: done = measure_in_floats(metric, p, q, shift, 3, vector, &distance); break;
    default: done = measure_in_floats(metric, p, q, shift, metric->ndim, vector, &distance);
    }
    return done ? distance : measure_in_integers(metric, p, q, shift, vector);
}

double
hs_keep_within(double distance, double cutoff, bool inclusive)
{
    if (distance < cutoff) {
        return distance;
    }
    return inclusive ? cutoff : nextafter(cutoff, 0.0);
}
