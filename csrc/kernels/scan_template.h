/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scan_template.h: the vector scans, once for each instruction set. Include it after a vocabulary
 * (simd_<isa>.h), inside that instruction set's target region. Defines scan_points and, by
 * scan_forms.h, scan_any (hs_scan_fn).
 */

/* Notes the lanes of m as unsure hits, listed from entry `at` on. They are rare, so one bit at a
 * time; in crystals they are common. */
static HS_NO_INLINE void
note_unsure(hs_scan *scan, int32_t t, int32_t c, unsigned near, unsigned m, int32_t at)
{
    for (; m != 0; m &= m - 1) {
        const unsigned below = (m & (0u - m)) - 1;
        scan->unsure[scan->n_unsure++] =
            (hs_unsure){t, c + (int32_t)popcount(below), at + (int32_t)popcount(near & below)};
    }
}

/* Vectors as wide as a cache line are taken where lines begin: others would lie across two, and
 * lists take 1.04 to 1.09 times as long. The first one of a point may then begin with lanes that
 * do not count. */
#define FILLS_LINE (LANES * sizeof(float) == 64)

/* What scan_points keeps in registers. */
typedef struct vector_scan {
    const float *y[HS_MAX_DIM];
    floats       centre[HS_MAX_DIM];
    floats       in, out;
    floats       radius;                      /* and, for limits: of the point ... */
    const float *others;                      /* ... and of the candidates */
    floats       support[HS_SUPPORT_ENTRIES]; /* of the point, and thresholds */
    floats       support_in, support_out;
} vector_scan;

/* Sets what depends on the point. */
HS_ALWAYS_INLINE void
set_point(const hs_scan *scan, int32_t t, const int ndim, const hs_scan_form form, vector_scan *v)
{
    for (int k = 0; k < ndim; k++) {
        v->centre[k] = broadcast(scan->q[k][t]);
    }
    v->in = broadcast(scan->direct.in);
    v->out = broadcast(scan->direct.out);
    if (form == HS_SCAN_LIMITS) {
        const float *radii = scan->limits.of_point;
        v->radius = broadcast(radii != NULL ? radii[t] : 0.0f);
        v->others = hs_limit_row(&scan->limits, t);
    }
    if (form == HS_SCAN_SUPPORTS) { /* zeros where the rule does not look at that of the point */
        const hs_support_scan *supports = &scan->supports;
        const float            none[HS_SUPPORT_ENTRIES + 1] = {0.0f};
        const int              n = hs_support_entries(ndim);
        const int64_t          at = (int64_t)t * hs_support_numbers(ndim);
        const float        *numbers = hs_rule_needs_asking(supports->rule) ? supports->of_point + at
                                                                           : none;
        const hs_thresholds thresholds = hs_support_thresholds(supports->form, numbers[n]);
        for (int e = 0; e < n; e++) {
            v->support[e] = broadcast(numbers[e]);
        }
        v->support_in = broadcast(thresholds.in);
        v->support_out = broadcast(thresholds.out);
    }
}

/* Thresholds of LANES candidates from c on, for HS_SCAN_LIMITS. */
HS_ALWAYS_INLINE void
set_limits(const hs_scan *scan, const hs_rule rule, int32_t c, vector_scan *v)
{
    const hs_limit_form form = scan->limits.form;
    const floats        other = v->others != NULL ? load(v->others + c) : broadcast(0.0f);
    const floats        made = rule == HS_RULE_MAX   ? larger_of(v->radius, other)
                               : rule == HS_RULE_MIN ? smaller_of(v->radius, other)
                                                     : add(v->radius, other);
    const floats        limit = smaller_of(made, broadcast(scan->limits.bound));
    const floats        less = broadcast(-form.in_less), more = broadcast(form.out_more);
    const floats        in =
        larger_of(multiply_add(limit, broadcast(form.in_factor), less), broadcast(0.0f));
    const floats out =
        larger_of(multiply_add(limit, broadcast(form.out_factor), more), broadcast(0.0f));
    v->in = multiply(in, in);
    v->out = multiply(out, out);
}

/* s of LANES candidates from c on. Squares are fused where that is quicker: only the caller sees
 * them, and the bounds of filter.h hold either way. */
HS_ALWAYS_INLINE floats
sums_of(const vector_scan *v, int32_t c, const int ndim, const hs_scan_form form)
{
    const floats first = subtract(load(v->y[0] + c), v->centre[0]);
    floats       s = multiply(first, first);
    for (int k = 1; k < ndim; k++) {
        const floats along = subtract(load(v->y[k] + c), v->centre[k]);
        s = form == HS_SCAN_SQUARES ? multiply_add(along, along, s)
                                    : add(s, multiply(along, along));
    }
    return s;
}

/* |N along|^2 for the entries of N. */
HS_ALWAYS_INLINE floats
square_within(const floats *entries, const floats *along, const int ndim)
{
    floats s = broadcast(0.0f);
    for (int k = 0; k < ndim; k++) {
        floats z = multiply(entries[hs_support_at(k, 0)], along[0]);
        for (int l = 1; l < ndim; l++) {
            z = multiply_add(entries[hs_support_at(k, l)], along[l], z);
        }
        s = k == 0 ? multiply(z, z) : multiply_add(z, z, s);
    }
    return s;
}

/* Lanes that are not surely beyond, and of these, those that are not surely within. */
typedef struct lanes_near {
    mask near, maybe;
} lanes_near;

/* By the candidates' own supports. */
HS_ALWAYS_INLINE lanes_near
meet_candidates(const hs_support_scan *supports, const floats *along, int32_t c, const int ndim)
{
    const hs_limit_form form = supports->form;
    const int           n = hs_support_entries(ndim);
    const floats        zero = broadcast(0.0f);
    floats              entries[HS_SUPPORT_ENTRIES];
    for (int e = 0; e < n; e++) {
        entries[e] = load(supports->of_block + e * supports->pitch + c);
    }
    const floats size = load(supports->of_block + n * supports->pitch + c);
    /* Zero comes first: then a size of NaN makes thresholds of NaN, and an unsure hit. */
    const floats in =
        larger_of(zero, multiply_add(size, broadcast(form.in_factor), broadcast(-form.in_less)));
    const floats out =
        larger_of(zero, multiply_add(size, broadcast(form.out_factor), broadcast(form.out_more)));
    const floats s = square_within(entries, along, ndim);
    const mask   near = not_greater(s, multiply(out, out));
    return (lanes_near){near, and_not_less(near, s, multiply(in, in))};
}

/* The same by both supports, as the rule says. */
HS_ALWAYS_INLINE lanes_near
meet_supports(const hs_support_scan *supports, const vector_scan *v, const floats *along, int32_t c,
              const int ndim)
{
    if (!hs_rule_needs_asking(supports->rule)) {
        return meet_candidates(supports, along, c, ndim);
    }
    const floats s = square_within(v->support, along, ndim);
    const mask   near = not_greater(s, v->support_out);
    const mask   maybe = and_not_less(near, s, v->support_in);
    if (!hs_rule_needs_other(supports->rule)) {
        return (lanes_near){near, maybe};
    }
    const lanes_near other = meet_candidates(supports, along, c, ndim);
    if (supports->rule == HS_RULE_MIN) {
        const mask both = (mask)(near & other.near);
        return (lanes_near){both, (mask)(both & (maybe | other.maybe))};
    }
    const mask sure = (mask)((near & ~maybe) | (other.near & ~other.maybe));
    const mask either = (mask)(near | other.near);
    return (lanes_near){either, (mask)(either & ~sure)};
}

/* LANES candidates from c on, by the cutoff and their supports. */
HS_ALWAYS_INLINE lanes_near
test_supports(const hs_scan *scan, const vector_scan *v, int32_t c, const int ndim)
{
    floats along[HS_SUPPORT_DIM];
    for (int k = 0; k < ndim; k++) {
        along[k] = subtract(load(v->y[k] + c), v->centre[k]);
    }
    const floats     s = sums_of(v, c, ndim, HS_SCAN_DIRECT);
    const mask       in_ball = not_greater(s, v->out);
    const mask       maybe = and_not_less(in_ball, s, v->in);
    const lanes_near found = meet_supports(&scan->supports, v, along, c, ndim);
    const mask       near = (mask)(in_ball & found.near);
    return (lanes_near){near, (mask)(near & (maybe | found.maybe))};
}

HS_ALWAYS_INLINE int32_t
scan_ruled(hs_scan *scan, int32_t first, const int ndim, const hs_scan_form form,
           const hs_rule rule, const bool lists)
{
    const int32_t *label = scan->label;
    const int32_t  n = scan->n;
    int32_t *const hits = scan->hits, *hit = hits;
    float *const   squares = scan->squares;
    int64_t        count = 0;
    int32_t        t = first;
    vector_scan    v;
    for (int k = 0; k < ndim; k++) {
        v.y[k] = scan->y[k];
    }
    scan->n_unsure = 0;
    for (; t < scan->n_points; t++) {
        if ((lists && hit - hits + n > scan->most_hits) || scan->n_unsure + n > scan->most_unsure) {
            break;
        }
        set_point(scan, t, ndim, form, &v);
        const int32_t from = scan->triangular ? t + 1 : 0;
        for (int32_t c = FILLS_LINE ? from & ~(LANES - 1) : from; c < n; c += LANES) {
            lanes_near found = {0, 0};
            floats     sum = v.in;
            if (form == HS_SCAN_SUPPORTS) {
                found = test_supports(scan, &v, c, ndim);
            } else {
                sum = sums_of(&v, c, ndim, form);
            }
            if (form == HS_SCAN_LIMITS) {
                set_limits(scan, rule, c, &v);
            }
            mask near = form == HS_SCAN_SUPPORTS ? found.near : not_greater(sum, v.out);
            /* No mask is kept from one vector to the next, which would wait for it. */
            if (FILLS_LINE && HS_UNLIKELY(c < from)) {
                near = (mask)(near & (~0u << (from - c)));
            }
            if (HS_UNLIKELY(n - c < LANES)) {
                near = (mask)(near & first_lanes(n - c));
            }
            const mask maybe = form == HS_SCAN_SUPPORTS  ? (mask)(near & found.maybe)
                               : form == HS_SCAN_SQUARES ? 0
                                                         : and_not_less(near, sum, v.in);
            if (HS_UNLIKELY(maybe != 0)) {
                note_unsure(scan, t, c, near, maybe, (int32_t)(hit - hits));
            }
            if (form == HS_SCAN_SQUARES) {
                append_floats(squares + (hit - hits), sum, near);
            }
            if (lists) {
                hit += append(hit, load_integers(label + c), near);
            } else {
                count += popcount(near);
            }
        }
        scan->end[t] = (int32_t)(lists ? hit - hits : count);
    }
    scan->n_hits = lists ? hit - hits : count;
    return t;
}

/* The rule of limits is a constant of each loop: lists by radii take 1.02 to 1.05 times as long
 * where it is not. */
HS_ALWAYS_INLINE int32_t
scan_points(hs_scan *scan, int32_t first, const int ndim, const hs_scan_form form, const bool lists)
{
    if (form == HS_SCAN_LIMITS && scan->limits.rule == HS_RULE_MAX) {
        return scan_ruled(scan, first, ndim, form, HS_RULE_MAX, lists);
    }
    if (form == HS_SCAN_LIMITS && scan->limits.rule == HS_RULE_MIN) {
        return scan_ruled(scan, first, ndim, form, HS_RULE_MIN, lists);
    }
    return scan_ruled(scan, first, ndim, form, HS_RULE_SUM, lists);
}

#include "scan_forms.h"
