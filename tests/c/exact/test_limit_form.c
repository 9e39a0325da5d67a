/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_limit_form.c: the thresholds that kernels compute of two radii, fleft or not, against those
 * of filter.h for the real sum, the larger or the smaller: they must hold it between them, and not
 * by much.
 */
#include "../../../csrc/core/exact/doubleword.h"
#include "../../../csrc/core/exact/filter.h"

#include "../../../csrc/kernels/kernel.h"
#include "../support/harness.h"

#include <float.h>
#include <math.h>

void test_limit_form(void);

static const double u = 0x1p-24;
static const double tiny = 0x1p-126;

/* One limit of a pair, all that it is made of. */
typedef struct limit_case {
    int     ndim;
    hs_rule rule;
    double  a, b, bound, extent, error;
} limit_case;

/* As a kernel that fuses: one rounding for product and sum, by way of float64, which holds the
 * product. */
static hs_thresholds
fleft_thresholds(const hs_limit_scan *limits, float limit)
{
    const hs_limit_form form = limits->form;
    const float         in = fmaf(limit, form.in_factor, -form.in_less);
    const float         out = fmaf(limit, form.out_factor, form.out_more);
    return (hs_thresholds){in > 0.0f ? in * in : 0.0f, out * out};
}

static float
float_limit(const hs_limit_scan *limits, float a, float b)
{
    const float made = limits->rule == HS_RULE_MAX   ? fmaxf(a, b)
                       : limits->rule == HS_RULE_MIN ? fminf(a, b)
                                                     : a + b;
    return fminf(made, limits->bound);
}

/* The real limit, to its float64 neighbours: below it and above it. */
static void
real_limit(const limit_case *c, double *low, double *high)
{
    const bool  is_one = c->rule == HS_RULE_MAX || c->rule == HS_RULE_MIN;
    const hs_dw sum = hs_two_sum(c->a, c->b);
    *low = c->rule == HS_RULE_MAX   ? fmax(c->a, c->b)
           : c->rule == HS_RULE_MIN ? fmin(c->a, c->b)
                                    : sum.hi;
    *high = *low;
    if (!is_one) {
        *low = sum.lo < 0.0 ? nextafter(sum.hi, 0.0) : sum.hi;
        *high = sum.lo > 0.0 ? nextafter(sum.hi, HUGE_VAL) : sum.hi;
    }
    *low = fmin(*low, c->bound);
    *high = fmin(*high, c->bound);
}

/* Whether both thresholds are on the safe side of the exact ones; left: how far off these they are,
 * in units of u, `in` and `out`. */
static bool
holds(const limit_case *c, double left[2])
{
    const hs_limit_scan limits = {.rule = c->rule,
                                  .bound = (float)c->bound,
                                  .form = hs_limit_form_of(c->ndim, c->extent, c->error)};
    const float         a = (float)c->a, b = (float)c->b;
    const hs_thresholds plain = hs_limit_thresholds(&limits, a, b);
    const hs_thresholds fleft = fleft_thresholds(&limits, float_limit(&limits, a, b));
    double              low, high, in, out, unused;
    real_limit(c, &low, &high);
    hs_threshold_bounds(c->ndim, low, c->extent, c->error, u, tiny, &in, &unused);
    hs_threshold_bounds(c->ndim, high, c->extent, c->error, u, tiny, &unused, &out);
    const double largest = fmax(plain.in, fleft.in), least = fmin(plain.out, fleft.out);
    left[0] = (in - largest) / (in * u);
    left[1] = (least - out) / (out * u);
    return least >= out && (largest == 0.0 || largest <= in);
}

/* A radius whose rounding goes to this side, by nearly all that it can: it is a little off the middle
 * between two floats, and near a power of two more often than not. */
static double
beside_a_middle(harness_random *random, int side)
{
    const int64_t first = INT64_C(1) << 23, more = INT64_C(1) << (12 + random_bits(random) % 11);
    const int64_t m = first + (int64_t)(random_bits(random) % (uint64_t)more);
    const int     exponent = (int)(random_bits(random) % 3) - 24;
    return ldexp((double)m + 0.5 + side * 0x1p-12, exponent);
}

static void
limits_of_any_radii_hold(void)
{
    static const hs_rule rules[] = {HS_RULE_SUM, HS_RULE_MAX, HS_RULE_MIN, HS_RULE_MEAN};
    harness_random       random = {1213};
    int                  wrong = 0;
    for (int trial = 0; trial < TRIALS(400000); trial++) {
        const int  side = trial / 4 % 3 - 1;
        limit_case c = {.ndim = 1 + trial % 8,
                        .rule = rules[random_bits(&random) % 4],
                        .a = ldexp(random_unit(&random), (int)(random_bits(&random) % 12) - 6),
                        .b = ldexp(random_unit(&random), (int)(random_bits(&random) % 12) - 6),
                        .bound = HUGE_VAL,
                        .extent = ldexp(random_unit(&random), (int)(random_bits(&random) % 9)),
                        .error = trial % 3 == 0 ? 0x1p-20 * random_unit(&random) : 0.0};
        double     left[2];
        if (side != 0) {
            c.a = beside_a_middle(&random, side);
            c.b = beside_a_middle(&random, side);
        }
        if (trial % 5 == 0)
            c.extent = 0.0;
        if (trial % 7 == 0)
            c.bound = beside_a_middle(&random, trial % 2 ? 1 : -1);
        wrong += !holds(&c, left);
    }
    CHECK(wrong == 0);
}

/* Without an extent, all that there is between both thresholds are roundings. For some of these radii
 * most of them go one way, and little more is left than the roundings of the factors to float32,
 * which take up to 2 u and 4 u of the squares: with half of the bound, thresholds would be wrong. */
static void
bounds_are_nearly_reached(void)
{
    for (int ndim = 1; ndim <= 8; ndim++) {
        harness_random random = {1000 + (uint64_t)ndim};
        double         least[2] = {HUGE_VAL, HUGE_VAL};
        int            wrong = 0;
        for (int trial = 0; trial < TRIALS(400000); trial++) {
            const int        side = trial % 2 ? 1 : -1;
            const limit_case c = {.ndim = ndim,
                                  .rule = HS_RULE_SUM,
                                  .a = beside_a_middle(&random, side),
                                  .b = beside_a_middle(&random, side),
                                  .bound = HUGE_VAL};
            double           left[2];
            wrong += !holds(&c, left);
            least[0] = fmin(least[0], left[0]);
            least[1] = fmin(least[1], left[1]);
        }
        CHECK(wrong == 0);
        CHECK(least[0] >= 0.0 && least[0] < 6.0);
        CHECK(least[1] >= 0.0 && least[1] < 8.0);
    }
}

/* Radii so small that their floats are subnormal, or zero, are not taken for more than they may be. */
static void
what_is_lost_of_small_radii_is_not_sure(void)
{
    harness_random random = {1415};
    int            wrong = 0;
    for (int trial = 0; trial < TRIALS(100000); trial++) {
        const limit_case c = {.ndim = 1 + trial % 8,
                              .rule = HS_RULE_SUM,
                              .a = ldexp(random_unit(&random), -(int)(random_bits(&random) % 200)),
                              .b = ldexp(random_unit(&random), -(int)(random_bits(&random) % 200)),
                              .bound = HUGE_VAL,
                              .extent = trial % 2 ? 0x1p-120 : 0.0};
        double           left[2];
        wrong += !holds(&c, left);
    }
    CHECK(wrong == 0);
}

/* Nothing but equal points, and what may be lost, is within 0; that is not sure either. */
static void
zero_radii_make_nothing_sure(void)
{
    for (int ndim = 1; ndim <= 8; ndim++) {
        for (int rule = 0; rule < HS_RULE_END; rule++) {
            const hs_limit_scan limits = {
                .rule = (hs_rule)rule, .bound = INFINITY, .form = hs_limit_form_of(ndim, 2.0, 0.0)};
            const hs_thresholds none = hs_limit_thresholds(&limits, 0.0f, 0.0f);
            CHECK(none.in == 0.0f && none.out > 0.0f && none.out < 1e-12f);
            const hs_limit_scan bounded = {
                .rule = (hs_rule)rule, .bound = 0.0f, .form = limits.form};
            const hs_thresholds at_most = hs_limit_thresholds(&bounded, 5.0f, 7.0f);
            CHECK(at_most.in == none.in && at_most.out == none.out);
        }
    }
}

/* A radius that no float32 holds is beyond all squares; within a bound, nothing of it is left. */
static void
huge_radii_are_beyond_all(void)
{
    const hs_limit_form form = hs_limit_form_of(3, 64.0, 0x1p-40);
    hs_limit_scan       limits = {.rule = HS_RULE_SUM, .bound = INFINITY, .form = form};
    hs_thresholds       t = hs_limit_thresholds(&limits, INFINITY, 1.0f);
    CHECK(t.in == INFINITY && t.out == INFINITY);
    t = hs_limit_thresholds(&limits, FLT_MAX, FLT_MAX);
    CHECK(t.in == INFINITY && t.out == INFINITY);
    limits.rule = HS_RULE_MIN;
    t = hs_limit_thresholds(&limits, INFINITY, 1.0f);
    CHECK(t.in > 0.99f && t.in < 1.0f && t.out > 1.0f && t.out < 1.01f);
    limits.rule = HS_RULE_MAX;
    limits.bound = 2.0f;
    t = hs_limit_thresholds(&limits, INFINITY, 1.0f);
    CHECK(t.in > 3.99f && t.in < 4.0f && t.out > 4.0f && t.out < 4.01f);
}

/* A negative limit is that of no pair: nothing is sure, and nothing beyond what may be lost is a
 * hit. */
static void
negative_limits_are_of_no_pair(void)
{
    hs_limit_scan limits = {
        .rule = HS_RULE_SCATTER, .bound = INFINITY, .form = hs_limit_form_of(3, 2.0, 0.0)};
    hs_thresholds t = hs_limit_thresholds(&limits, 0.0f, -1.0f);
    CHECK(t.in == 0.0f && t.out == 0.0f);
    limits.form = hs_limit_form_of(3, 0x1p25, 0.0);
    t = hs_limit_thresholds(&limits, 0.0f, -1.0f);
    CHECK(t.in == 0.0f && t.out > 1.0f);
    limits.form = (hs_limit_form){1.0f, 0.0f, 1.0f, 0.0f};
    t = hs_limit_thresholds(&limits, 0.0f, -1.0f);
    CHECK(t.in == 0.0f && t.out == 0.0f);
}

/* Each rule takes the radii that it names, whichever of the two points has them. */
static void
rules_take_their_radii(void)
{
    static const struct {
        hs_rule rule;
        float   a, b, limit;
    } cases[] = {{HS_RULE_SUM, 1.0f, 3.0f, 4.0f},    {HS_RULE_MEAN, 1.0f, 3.0f, 4.0f},
                 {HS_RULE_MAX, 1.0f, 3.0f, 3.0f},    {HS_RULE_MAX, 3.0f, 1.0f, 3.0f},
                 {HS_RULE_MIN, 1.0f, 3.0f, 1.0f},    {HS_RULE_MIN, 3.0f, 1.0f, 1.0f},
                 {HS_RULE_GATHER, 2.0f, 0.0f, 2.0f}, {HS_RULE_SCATTER, 0.0f, 2.0f, 2.0f}};
    for (size_t e = 0; e < sizeof cases / sizeof cases[0]; e++) {
        const hs_limit_scan limits = {
            .rule = cases[e].rule, .bound = INFINITY, .form = {1.0f, 0.0f, 1.0f, 0.0f}};
        const hs_thresholds t = hs_limit_thresholds(&limits, cases[e].a, cases[e].b);
        CHECK(t.in == cases[e].limit * cases[e].limit && t.out == t.in);
    }
}

static void
nothing_is_sure_without_finite_inputs(void)
{
    const double bad[] = {NAN, INFINITY};
    for (int e = 0; e < 4; e++) {
        const hs_limit_scan limits = {
            .rule = HS_RULE_SUM,
            .bound = INFINITY,
            .form = hs_limit_form_of(3, e < 2 ? bad[e] : 1.0, e < 2 ? 0.0 : bad[e - 2])};
        for (int size = 0; size < 3; size++) {
            const float         radius = size == 0 ? 0.0f : size == 1 ? 1.0f : INFINITY;
            const hs_thresholds t = hs_limit_thresholds(&limits, radius, radius);
            CHECK(!(t.in > 0.0f) && t.out == INFINITY);
        }
    }
}

/* A thousandth off the limit everything is sure, or the filter would be of no use. */
static void
thresholds_are_narrow(void)
{
    for (int ndim = 1; ndim <= 8; ndim++) {
        const hs_limit_scan limits = {
            .rule = HS_RULE_SUM, .bound = INFINITY, .form = hs_limit_form_of(ndim, 2.0, 0.0)};
        const hs_thresholds t = hs_limit_thresholds(&limits, 0.25f, 0.75f);
        const double        width = ((double)t.out - (double)t.in) / u;
        CHECK(t.in < 1.0f && t.out > 1.0f);
        CHECK(width < 8.0 * sqrt((double)ndim) + 2.0 * ndim + 40.0);
    }
}

void
test_limit_form(void)
{
    RUN(limits_of_any_radii_hold);
    RUN(bounds_are_nearly_reached);
    RUN(what_is_lost_of_small_radii_is_not_sure);
    RUN(zero_radii_make_nothing_sure);
    RUN(huge_radii_are_beyond_all);
    RUN(negative_limits_are_of_no_pair);
    RUN(rules_take_their_radii);
    RUN(nothing_is_sure_without_finite_inputs);
    RUN(thresholds_are_narrow);
}
