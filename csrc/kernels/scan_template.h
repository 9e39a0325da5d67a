/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scan_template.h: the vector scans, once for each instruction set. Include it after a vocabulary
 * (simd_<isa>.h), inside that instruction set's target region. Defines scan_points, square_points
 * and, by scan_forms.h, list, count, list_direct, count_direct and squares (hs_scan_fn).
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

/* Vectors as wide as a cache line are taken where lines begin: others would lie across two. The
 * first one of a point may then begin with lanes that do not count. */
#define FILLS_LINE (LANES * sizeof(float) == 64)

/* What scan_points keeps in registers. */
typedef struct vector_scan {
    const float *y[HS_MAX_DIM];
    const float *norm;
    floats       centre[HS_MAX_DIM]; /* q_k, or -2 q_k for the expanded form */
    floats       in, out;
    floats       radius; /* and, for limits: of the point ... */
    const float *others; /* ... and of the candidates */
} vector_scan;

/* Sets what depends on the point. */
HS_ALWAYS_INLINE void
set_point(const hs_scan *scan, int32_t t, const int ndim, const hs_scan_form form, vector_scan *v)
{
    float         centre[HS_MAX_DIM];
    hs_thresholds thresholds = scan->direct;
    for (int k = 0; k < ndim; k++) {
        centre[k] = scan->q[k][t];
        v->centre[k] = broadcast(form == HS_SCAN_EXPANDED ? -2.0f * centre[k] : centre[k]);
    }
    if (form == HS_SCAN_EXPANDED) {
        thresholds = hs_expanded_thresholds(scan->expanded, centre, ndim);
    }
    v->in = broadcast(thresholds.in);
    v->out = broadcast(thresholds.out);
    if (form == HS_SCAN_LIMITS) {
        const float *radii = scan->limits.of_point;
        v->radius = broadcast(radii != NULL ? radii[t] : 0.0f);
        v->others = hs_limit_row(&scan->limits, t);
    }
}

/* The limits of LANES candidates from c on, as floats. */
HS_ALWAYS_INLINE floats
limits_of(const hs_limit_scan *limits, floats radius, const float *others, int32_t c)
{
    const floats other = others != NULL ? load(others + c) : broadcast(0.0f);
    const floats limit = limits->rule == HS_RULE_MAX   ? larger_of(radius, other)
                         : limits->rule == HS_RULE_MIN ? smaller_of(radius, other)
                                                       : add(radius, other);
    return smaller_of(limit, broadcast(limits->bound));
}

/* Thresholds of these candidates, for HS_SCAN_LIMITS. */
HS_ALWAYS_INLINE void
set_limits(const hs_scan *scan, int32_t c, vector_scan *v)
{
    const hs_limit_form form = scan->limits.form;
    const floats        limit = limits_of(&scan->limits, v->radius, v->others, c);
    const floats        less = broadcast(-form.in_less), more = broadcast(form.out_more);
    const floats        in =
        larger_of(multiply_add(limit, broadcast(form.in_factor), less), broadcast(0.0f));
    const floats out =
        larger_of(multiply_add(limit, broadcast(form.out_factor), more), broadcast(0.0f));
    v->in = multiply(in, in);
    v->out = multiply(out, out);
}

/* s of LANES candidates from c on. */
HS_ALWAYS_INLINE floats
sums_of(const vector_scan *v, int32_t c, const int ndim, const hs_scan_form form)
{
    if (form == HS_SCAN_EXPANDED) {
        floats s = load(v->norm + c);
        for (int k = 0; k < ndim; k++) {
            s = multiply_add(v->centre[k], load(v->y[k] + c), s);
        }
        return s;
    }
    const floats first = subtract(load(v->y[0] + c), v->centre[0]);
    floats       s = multiply(first, first);
    for (int k = 1; k < ndim; k++) {
        const floats along = subtract(load(v->y[k] + c), v->centre[k]);
        s = add(s, multiply(along, along));
    }
    return s;
}

HS_ALWAYS_INLINE int32_t
scan_points(hs_scan *scan, int32_t first, const int ndim, const hs_scan_form form, const bool lists)
{
    const int32_t *label = scan->label;
    const int32_t  n = scan->n;
    int32_t       *hit = scan->hits;
    int64_t        count = 0;
    int32_t        t = first;
    vector_scan    v;
    v.norm = scan->norm;
    for (int k = 0; k < ndim; k++) {
        v.y[k] = scan->y[k];
    }
    scan->n_unsure = 0;
    for (; t < scan->n_points; t++) {
        if ((lists && hit - scan->hits + n > scan->most_hits) ||
            scan->n_unsure + n > scan->most_unsure) {
            break;
        }
        set_point(scan, t, ndim, form, &v);
        const int32_t from = scan->triangular ? t + 1 : 0;
        mask          keep = (mask)(~0u << from % LANES);
        for (int32_t c = FILLS_LINE ? from & ~(LANES - 1) : from; c < n; c += LANES) {
            const floats s = sums_of(&v, c, ndim, form);
            if (form == HS_SCAN_LIMITS) {
                set_limits(scan, c, &v);
            }
            mask near = not_greater(s, v.out);
            if (FILLS_LINE) {
                near = (mask)(near & keep);
                keep = (mask)~0u;
            }
            if (HS_UNLIKELY(n - c < LANES)) {
                near = (mask)(near & first_lanes(n - c));
            }
            const mask maybe = and_not_less(near, s, v.in);
            if (HS_UNLIKELY(maybe != 0)) {
                note_unsure(scan, t, c, near, maybe, (int32_t)(hit - scan->hits));
            }
            if (lists) {
                hit += append(hit, load_integers(label + c), near);
            } else {
                count += popcount(near);
            }
        }
        scan->end[t] = (int32_t)(lists ? hit - scan->hits : count);
    }
    scan->n_hits = lists ? hit - scan->hits : count;
    return t;
}

/* Unlike the direct form above, fused where that is quicker: only the caller sees s, and the bounds
 * of filter.h hold either way. */
HS_ALWAYS_INLINE int32_t
square_points(hs_scan *scan, int32_t first, const int ndim)
{
    const int32_t *label = scan->label;
    const int32_t  n = scan->n;
    const floats   out = broadcast(scan->direct.out);
    const float   *y[HS_MAX_DIM];
    int32_t       *hits = scan->hits;
    float         *found = scan->squares;
    int32_t        at = 0, t = first;
    for (int k = 0; k < ndim; k++) {
        y[k] = scan->y[k];
    }
    for (; t < scan->n_points && at + n <= scan->most_hits; t++) {
        floats q[HS_MAX_DIM];
        for (int k = 0; k < ndim; k++) {
            q[k] = broadcast(scan->q[k][t]);
        }
        for (int32_t c = scan->triangular ? t + 1 : 0; c < n; c += LANES) {
            const floats along = subtract(load(y[0] + c), q[0]);
            floats       s = multiply(along, along);
            for (int k = 1; k < ndim; k++) {
                const floats other = subtract(load(y[k] + c), q[k]);
                s = multiply_add(other, other, s);
            }
            mask near = not_greater(s, out);
            if (HS_UNLIKELY(n - c < LANES)) {
                near = (mask)(near & first_lanes(n - c));
            }
            append_floats(found + at, s, near);
            at += append(hits + at, load_integers(label + c), near);
        }
        scan->end[t] = at;
    }
    scan->n_hits = at;
    return t;
}

#include "scan_forms.h"
