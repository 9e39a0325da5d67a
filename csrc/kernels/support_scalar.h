/* SPDX-License-Identifier: BSD-3-Clause */
/* support_scalar.h: what a pair comes to by its supports, in plain C, for kernel_scalar.c: the
 * specification of list_supports and count_supports. */
#ifndef HS_SUPPORT_SCALAR_H
#define HS_SUPPORT_SCALAR_H

#include "kernel.h"

/* Whether a hit, and whether surely within. */
typedef struct scalar_verdict {
    int32_t near, sure;
} scalar_verdict;

/* The support of a point, if the rule looks at it. */
typedef struct scalar_own {
    const float  *numbers;
    hs_thresholds thresholds;
} scalar_own;

HS_ALWAYS_INLINE scalar_own
own_support(const hs_support_scan *supports, const bool has_supports, int32_t t, const int ndim)
{
    scalar_own own = {NULL, {0.0f, 0.0f}};
    if (has_supports && hs_rule_needs_asking(supports->rule)) {
        own.numbers = supports->of_point + (int64_t)t * hs_support_numbers(ndim);
        own.thresholds =
            hs_support_thresholds(supports->form, own.numbers[hs_support_entries(ndim)]);
    }
    return own;
}

/* |N along|^2 against its thresholds. stride: from one entry of N to the next. */
HS_ALWAYS_INLINE scalar_verdict
meet_support(const float *entries, int64_t stride, hs_thresholds thresholds, const float *along,
             const int ndim)
{
    float s = 0.0f;
    for (int k = 0; k < ndim; k++) {
        float z = entries[hs_support_at(k, 0) * stride] * along[0];
        for (int l = 1; l < ndim; l++) {
            z = z + entries[hs_support_at(k, l) * stride] * along[l];
        }
        s = k == 0 ? z * z : s + z * z;
    }
    return (scalar_verdict){!(s > thresholds.out), s < thresholds.in};
}

HS_ALWAYS_INLINE scalar_verdict
meet_candidate(const hs_support_scan *supports, const float *along, int32_t c, const int ndim)
{
    const float *numbers = supports->of_block + c;
    const float  size = numbers[hs_support_entries(ndim) * supports->pitch];
    return meet_support(numbers, supports->pitch, hs_support_thresholds(supports->form, size),
                        along, ndim);
}

/* Candidate c and the point at `centre`, by the direct form and by both supports, as the rule
 * says. */
HS_ALWAYS_INLINE scalar_verdict
meet_supports(const hs_scan *scan, const float *centre, const scalar_own *own, int32_t c,
              const int ndim)
{
    const hs_support_scan *supports = &scan->supports;
    scalar_verdict         one = {0, 0}, other = {0, 0};
    float                  along[HS_SUPPORT_DIM], s = 0.0f;
    for (int k = 0; k < ndim; k++) {
        along[k] = scan->y[k][c] - centre[k];
        s = k == 0 ? along[k] * along[k] : s + along[k] * along[k];
    }
    const int32_t near = !(s > scan->direct.out), sure = s < scan->direct.in;
    if (hs_rule_needs_asking(supports->rule)) {
        one = meet_support(own->numbers, 1, own->thresholds, along, ndim);
    }
    if (hs_rule_needs_other(supports->rule)) {
        other = meet_candidate(supports, along, c, ndim);
    }
    return supports->rule == HS_RULE_MIN
               ? (scalar_verdict){near & one.near & other.near, sure & one.sure & other.sure}
               : (scalar_verdict){near & (one.near | other.near), sure & (one.sure | other.sure)};
}

/* Whether it is a hit, to *near; returns whether it is an unsure one. */
HS_ALWAYS_INLINE int32_t
note_supports(const hs_scan *scan, const float *centre, const scalar_own *own, int32_t c,
              const int ndim, int32_t *near)
{
    const scalar_verdict found = meet_supports(scan, centre, own, c, ndim);
    *near = found.near;
    return found.near & !found.sure;
}

#endif
