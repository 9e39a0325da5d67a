/* SPDX-License-Identifier: BSD-3-Clause */
#include "limits.h"
#include "../base/status.h"

/* limits.c: what a scan compares with is laid out beside the candidates, so that kernels read it as
 * they read coordinates. */

int32_t
hs_limits_rows(const hs_search *search)
{
    const hs_limits *limits = search->limits;
    if (limits->supports != NULL) {
        return hs_support_numbers(search->scene.ndim);
    }
    return limits->table.n_types > 1 ? limits->table.n_types : 1;
}

/* The number in cell order of candidate c, which was put in order or not. */
HS_ALWAYS_INLINE int32_t
number_of(const hs_scanner *scanner, int32_t c)
{
    const hs_block *block = &scanner->block;
    return block->number[scanner->is_ordered ? block->origin[c] : c];
}

/* The supports of the group and the block. */
static void
set_supports(const hs_scanner *scanner, hs_scan *scan)
{
    const hs_supports *supports = scanner->search->limits->supports;
    const int64_t      first = scanner->group.first;
    const hs_block    *block = &scanner->block;
    const int          n_numbers = hs_support_numbers(scan->ndim);
    const float       *asking = supports->of_asking.near, *points = supports->of_points.near;
    scan->supports = (hs_support_scan){
        .rule = supports->rule,
        .form = scanner->form.limits,
        .of_point = asking != NULL ? asking + first * n_numbers : NULL,
        .of_block = block->radius,
        .pitch = block->pitch,
    };
    if (!supports->is_bounded) {
        scan->direct.in = INFINITY; /* no support reaches that far */
    }
    for (int32_t c = 0; points != NULL && c < block->n; c++) { /* a row for each number */
        const float *numbers = points + (int64_t)number_of(scanner, c) * n_numbers;
        for (int e = 0; e < n_numbers; e++) {
            block->radius[e * block->pitch + c] = numbers[e];
        }
    }
    for (int e = 0; points != NULL && e < n_numbers; e++) {
        hs_pad_lanes(block->radius + e * block->pitch, block->n);
    }
}

void
hs_limits_set(const hs_scanner *scanner, hs_scan *scan)
{
    const hs_limits      *limits = scanner->search->limits;
    const hs_limit_table *table = &limits->table;
    const float          *of_asking = limits->of_asking.near, *of_points = limits->of_points.near;
    const hs_block       *block = &scanner->block;
    const bool            has_table = table->near != NULL;
    if (limits->supports != NULL) {
        set_supports(scanner, scan);
        return;
    }
    scan->limits = (hs_limit_scan){
        .rule = limits->rule,
        .bound = limits->near_bound,
        .form = scanner->form.limits,
        .of_point = of_asking != NULL ? of_asking + scanner->group.first : NULL,
        .of_block = of_points != NULL || has_table ? block->radius : NULL,
        .row = has_table ? table->of_asking + scanner->group.first : NULL,
        .stride = block->pitch,
    };
    for (int32_t row = 0; row < table->n_types; row++) { /* with each type */
        const float *with = table->near + row * table->n_types;
        float       *to = block->radius + row * block->pitch;
        for (int32_t c = 0; c < block->n; c++) {
            to[c] = with[table->of_points[number_of(scanner, c)]];
        }
        hs_pad_lanes(to, block->n);
    }
    if (!has_table && of_points != NULL) {
        for (int32_t c = 0; c < block->n; c++) {
            block->radius[c] = of_points[number_of(scanner, c)];
        }
        hs_pad_lanes(block->radius, block->n);
    }
}

/* One support of a pair often tells without the other, so that integers are the last resort of the
 * pair, not of each. */

/* Supports of other sizes, over their extent, leave no room for float32: nothing is sure of them.
 * Those of common scenes are about 1, or as much larger as they are smaller than the largest. */
#define LARGEST_NEAR 0x1p100

/* Factors below this may have lost digits. */
#define LEAST_FACTOR 0x1p-1000

/* More than float64 and float32 round down. */
#define UPWARDS (1.0 + 0x1p-23)

/* Of the point in this place of the cells, of a side that the rule looks at. */
static const double *
support_of(const hs_support_side *side, int64_t si, int n_entries)
{
    return side->numbers + (side->order[si] - side->first) * (n_entries + 1);
}

/* Those that float32 does not hold are zeros of infinite size, of which thresholds make nothing
 * sure. */
void
hs_supports_lay_out(const hs_support_side *side, int64_t first, int64_t end, int ndim,
                    double extent, double unscale, float *near)
{
    const int    n = hs_support_entries(ndim);
    const double times = unscale / extent;
    for (int64_t si = first; si < end; si++) {
        const double *numbers = support_of(side, si, n);
        const double  size = numbers[n] * times;
        const bool    fits = times >= LEAST_FACTOR && size >= (double)HS_LEAST_NEAR_SIZE &&
                          size <= LARGEST_NEAR; /* not NaN either */
        float *to = near + si * (n + 1);
        for (int e = 0; e < n; e++) {
            to[e] = fits ? (float)(numbers[e] * times) : 0.0f;
        }
        to[n] = fits ? (float)(size * UPWARDS) : INFINITY;
    }
}

/* What two verdicts come to by the rule; a support that it does not look at is neither way. */
static hs_verdict
combine(hs_rule rule, hs_verdict one, hs_verdict other)
{
    const hs_verdict strong = rule == HS_RULE_MIN ? HS_BEYOND : HS_WITHIN;
    if (one == strong || other == strong) {
        return strong;
    }
    return one == HS_UNDECIDED || other == HS_UNDECIDED ? HS_UNDECIDED
           : strong == HS_WITHIN                        ? HS_BEYOND
                                                        : HS_WITHIN;
}

/* One pair, with the supports that the rule looks at or NULL; it counts once, by the stage that it
 * took. Rounded, precision="double" and "single": one comparison of rounded numbers for each. */
static bool
decide_pair(hs_scanner *scanner, const double *const *numbers, const hs_span *span)
{
    const hs_supports *supports = scanner->search->limits->supports;
    const hs_metric   *measure = &scanner->search->scene.metric;
    const hs_rule      rule = supports->rule;
    const bool         is_exact = scanner->options.precision == HS_EXACT;
    const bool         is_single = scanner->options.precision == HS_SINGLE;
    const int          size_at = hs_support_entries(measure->ndim);
    /* Of a support that the rule does not look at, a verdict that changes nothing. */
    const hs_verdict neutral = rule == HS_RULE_MIN ? HS_WITHIN : HS_BEYOND;
    hs_verdict       verdict[2] = {neutral, neutral};
    hs_stages        stages = {0, 0, 0};
    hs_support_span  measured;
    if (is_exact) {
        hs_support_span_of(measure, span, &measured);
    }
    for (int n = 0; n < 2; n++) {
        if (numbers[n] != NULL && is_exact) {
            verdict[n] = hs_support_decide_double(&supports->metric, numbers[n],
                                                  numbers[n][size_at], &measured, &stages);
        } else if (numbers[n] != NULL) {
            verdict[n] =
                hs_support_within_rounded(&supports->metric, numbers[n], measure, span, is_single)
                    ? HS_WITHIN
                    : HS_BEYOND;
        }
    }
    hs_verdict all = combine(rule, verdict[0], verdict[1]);
    if (!is_exact) {
        return all == HS_WITHIN;
    }
    scanner->stages.by_integers += all == HS_UNDECIDED;
    scanner->stages.by_double_word += all != HS_UNDECIDED && stages.by_double_word > 0;
    scanner->stages.by_float64 += all != HS_UNDECIDED && stages.by_double_word == 0;
    for (int n = 0; n < 2 && all == HS_UNDECIDED; n++) {
        if (verdict[n] == HS_UNDECIDED) {
            const int sign = hs_support_compare(&supports->metric, numbers[n], measure, span);
            verdict[n] = sign < 0 || (sign == 0 && supports->metric.limit.inclusive) ? HS_WITHIN
                                                                                     : HS_BEYOND;
            all = combine(rule, verdict[0], verdict[1]);
        }
    }
    return all == HS_WITHIN;
}

/* Whether each pair of the batch is within its supports, and within the cutoff where these reach
 * further. Supports of no extent hold nothing but D = 0. */
static void
decide_by_supports(hs_scanner *scanner, uint8_t *within)
{
    const hs_supports   *supports = scanner->search->limits->supports;
    const hs_pair_batch *pair_batch = &scanner->pair_batch;
    const int            n_entries = hs_support_entries(scanner->search->scene.ndim);
    hs_metric            ball = scanner->search->scene.metric;
    uint8_t              in_ball[HS_BATCH];
    if (supports->metric.limit.cutoff == 0.0) {
        hs_metric_set_cutoff(0.0, &ball);
        hs_decide_pair_batch(scanner, &ball, within);
        return;
    }
    for (int32_t e = 0; e < pair_batch->n; e++) {
        double        p[HS_MAX_DIM], q[HS_MAX_DIM];
        int64_t       shift[HS_MAX_DIM];
        const int32_t si = pair_batch->si[e], sj = scanner->block.number[pair_batch->place[e]];
        const hs_span span = {p, q, hs_pair_batch_pair(pair_batch, e, p, q, shift)};
        const double *numbers[2] = {
            hs_rule_needs_asking(supports->rule) ? support_of(&supports->of_asking, si, n_entries)
                                                 : NULL,
            hs_rule_needs_other(supports->rule) ? support_of(&supports->of_points, sj, n_entries)
                                                : NULL};
        within[e] = decide_pair(scanner, numbers, &span);
    }
    if (supports->is_bounded) {
        const hs_stages counted = scanner->stages;
        hs_decide_pair_batch(scanner, &ball, in_ball);
        scanner->stages = counted; /* a pair counts once */
        for (int32_t e = 0; e < pair_batch->n; e++) {
            within[e] = within[e] && in_ball[e];
        }
    }
}

/* Pairs whose limits are one number, as for points of one size in a crystal, are decided at
 * once. */
void
hs_limits_decide(hs_scanner *scanner, uint8_t *within)
{
    const hs_limits     *of_search = scanner->search->limits;
    const hs_pair_batch *pair_batch = &scanner->pair_batch;
    const hs_precision   precision = scanner->options.precision;
    const int32_t        n = pair_batch->n;
    hs_metric            metric = scanner->search->scene.metric;
    hs_dw                limits[HS_BATCH];
    bool                 is_one = precision != HS_SINGLE;
    if (of_search->supports != NULL) {
        decide_by_supports(scanner, within);
        return;
    }
    for (int32_t e = 0; e < n; e++) {
        limits[e] =
            hs_limit_of(of_search, pair_batch->si[e], scanner->block.number[pair_batch->place[e]]);
        is_one = is_one && limits[e].hi == limits[0].hi && limits[e].hi >= 0.0 &&
                 limits[e].lo == 0.0;
    }
    if (is_one) {
        hs_metric_set_cutoff(limits[0].hi, &metric);
        hs_decide_pair_batch(scanner, &metric, within);
        return;
    }
    for (int32_t e = 0; e < n; e++) {
        double         p[HS_MAX_DIM], q[HS_MAX_DIM];
        int64_t        of_pair[HS_MAX_DIM];
        const int64_t *shift = hs_pair_batch_pair(pair_batch, e, p, q, of_pair);
        if (limits[e].hi < 0.0) {
            within[e] = false;
        } else if (precision == HS_SINGLE) { /* its square is that of the limit */
            within[e] = scanner->options.inclusive;
        } else if (precision == HS_DOUBLE) {
            hs_metric_set_cutoff(limits[e].hi, &metric);
            within[e] = hs_metric_within_double(&metric, p, q, shift);
        } else {
            within[e] = hs_metric_within_sum(&metric, limits[e], p, q, shift, &scanner->stages);
        }
    }
}
