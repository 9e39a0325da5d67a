/* SPDX-License-Identifier: BSD-3-Clause */
/* scan_checks.h: a plain specification of the scans, and scans of a kernel compared with it. */
#ifndef HS_SCAN_CHECKS_H
#define HS_SCAN_CHECKS_H

#include "scan_scenes.h"

/* ---- the specification ---- */

/* s of candidate c and point t, rounded step by step in the order that kernel.h gives. */
static inline float
square_of(const numbers *s, hs_scan_form form, int32_t t, int32_t c)
{
    volatile float sum = form == HS_SCAN_EXPANDED ? s->norm[c] : 0.0f;
    for (int k = 0; k < s->ndim; k++) {
        if (form == HS_SCAN_EXPANDED) {
            const volatile float product = -2.0f * s->q[k][t] * s->y[k][c];
            sum = sum + product;
        } else {
            const volatile float along = s->y[k][c] - s->q[k][t];
            const volatile float square = along * along;
            sum = k == 0 ? square : sum + square;
        }
    }
    return sum;
}

/* Those of one pair, each step rounded. */
static inline hs_thresholds
limit_thresholds_of(const numbers *s, int32_t t, int32_t c)
{
    const float    a = s->has_of_point ? s->of_point[t] : 0.0f;
    const float    b = s->has_of_block ? row_radius(s, row_of(s, t), c) : 0.0f;
    const float    larger = a > b ? a : b, smaller = a > b ? b : a;
    volatile float limit = s->rule == HS_RULE_MAX   ? larger
                           : s->rule == HS_RULE_MIN ? smaller
                                                    : a + b;
    limit = limit > s->bound ? s->bound : limit;
    volatile float in = limit * s->form.in_factor, out = limit * s->form.out_factor;
    in = in - s->form.in_less;
    out = out + s->form.out_more;
    const volatile float in_square = in > 0.0f ? in * in : 0.0f;
    const volatile float out_square = out > 0.0f ? out * out : 0.0f;
    return (hs_thresholds){in_square, out_square};
}

/* What a scan makes of one pair. */
typedef enum pair_verdict { PAIR_BEYOND, PAIR_UNSURE, PAIR_SURE } pair_verdict;

typedef pair_verdict (*pair_rule)(const numbers *s, int32_t t, int32_t c);

static inline pair_verdict
verdict_between(float square, hs_thresholds limits)
{
    return square > limits.out ? PAIR_BEYOND : square < limits.in ? PAIR_SURE : PAIR_UNSURE;
}

static inline pair_verdict
by_cutoff(const numbers *s, int32_t t, int32_t c)
{
    return verdict_between(square_of(s, HS_SCAN_DIRECT, t, c), s->direct);
}

static inline pair_verdict
by_expansion(const numbers *s, int32_t t, int32_t c)
{
    double norm = 0.0;
    for (int k = 0; k < s->ndim; k++) {
        norm += (double)s->q[k][t] * (double)s->q[k][t];
    }
    const hs_thresholds moved = {(float)(s->expanded.in - norm), (float)(s->expanded.out - norm)};
    return verdict_between(square_of(s, HS_SCAN_EXPANDED, t, c), moved);
}

static inline pair_verdict
by_limits(const numbers *s, int32_t t, int32_t c)
{
    return verdict_between(square_of(s, HS_SCAN_LIMITS, t, c), limit_thresholds_of(s, t, c));
}

/* What points [first, next) must give, in arrays of the test. */
typedef struct expectation {
    int32_t   next;
    int64_t   n_hits;
    int32_t   n_unsure;
    int32_t   end[HS_GROUP_POINTS];
    int32_t   hits[MOST_HITS];
    hs_unsure unsure[HS_BLOCK_CANDIDATES];
} expectation;

static expectation expected;

static inline void
expect(const numbers *s, pair_rule rule, bool lists, int32_t first)
{
    int64_t n_hits = 0;
    int32_t n_unsure = 0, t = first;
    for (; t < s->n_points; t++) {
        if ((lists && n_hits + s->n > s->most_hits) || n_unsure + s->n > s->most_unsure) {
            break;
        }
        for (int32_t c = s->triangular ? t + 1 : 0; c < s->n; c++) {
            const pair_verdict verdict = rule(s, t, c);
            if (verdict == PAIR_UNSURE) {
                expected.unsure[n_unsure++] = (hs_unsure){t, c, (int32_t)n_hits};
            }
            if (verdict != PAIR_BEYOND && lists) {
                expected.hits[n_hits] = s->label[c];
            }
            n_hits += verdict != PAIR_BEYOND;
        }
        expected.end[t] = (int32_t)n_hits;
    }
    expected.next = t;
    expected.n_hits = n_hits;
    expected.n_unsure = n_unsure;
}

/* ---- comparisons ---- */

static inline bool
same_unsure(const hs_scan *scan, bool lists)
{
    bool same = scan->n_unsure == expected.n_unsure;
    for (int32_t u = 0; same && u < scan->n_unsure; u++) {
        const hs_unsure *a = &scan->unsure[u], *b = &expected.unsure[u];
        same = a->t == b->t && a->place == b->place && (!lists || a->at == b->at);
    }
    return same;
}

/* Counting leaves hits alone. */
static inline bool
untouched(const hs_scan *scan)
{
    bool same = true;
    for (int32_t h = 0; h < scan->most_hits + HS_PADDING; h++) {
        same = same && scan->hits[h] == -7;
    }
    return same;
}

static inline void
fill_with_sevens(const hs_scan *scan)
{
    for (int32_t h = 0; h < scan->most_hits + HS_PADDING; h++) {
        scan->hits[h] = -7;
    }
    for (int32_t t = 0; t < scan->n_points; t++) {
        scan->end[t] = -7;
    }
}

/* All points, however many calls that takes, exactly as the plain loop; returns the calls. */
static inline int
check_scan(hs_scan_fn function, hs_scan *scan, const numbers *s, pair_rule rule, bool lists)
{
    int  calls = 0;
    bool same = true;
    for (int32_t first = 0, next; first < s->n_points && same; first = next) {
        fill_with_sevens(scan);
        expect(s, rule, lists, first);
        next = function(scan, first);
        calls++;
        same = next == expected.next && scan->n_hits == expected.n_hits && same_unsure(scan, lists);
        same = same && memcmp(scan->end + first, expected.end + first,
                              (size_t)(next - first) * sizeof(int32_t)) == 0;
        if (lists && same) {
            same = memcmp(scan->hits, expected.hits, (size_t)scan->n_hits * sizeof(int32_t)) == 0;
        } else if (same) {
            same = untouched(scan);
        }
        CHECK(same);
    }
    return calls;
}

/* What a kernel has for one form of scans. */
typedef struct scan_pair {
    hs_scan_fn list, count;
    pair_rule  rule;
} scan_pair;

/* Both of them, against the guard before and the one after; supports: NULL for none. Only for
 * numbers with which no rounding can differ. */
static inline int
check_both(scan_pair of, const numbers *s, const hs_support_scan *supports)
{
    int calls = 0;
    for (int variant = 0; variant < 2; variant++) {
        for (int lists = 0; lists < 2; lists++) {
            hs_scan scan = place_scan(s, variant);
            if (supports != NULL) {
                scan.supports = *supports;
            }
            calls += check_scan(lists ? of.list : of.count, &scan, s, of.rule, lists);
        }
    }
    return calls;
}

/* The hits of the direct form, each with its square; nothing else is written. */
static inline int
check_squares(const hs_kernel *kernel, const numbers *s, bool at_end)
{
    int     calls = 0;
    bool    same = true;
    hs_scan scan = place_scan(s, at_end);
    for (int32_t first = 0, next; first < s->n_points && same; first = next) {
        numbers listed = *s;
        listed.most_unsure = INT32_MAX / 2; /* none is noted, so none stops the scan */
        listed.direct.in = INFINITY;
        expect(&listed, by_cutoff, true, first);
        next = kernel->squares(&scan, first);
        calls++;
        same = next == expected.next && scan.n_hits == expected.n_hits && scan.n_unsure == -1 &&
               memcmp(scan.hits, expected.hits, (size_t)scan.n_hits * sizeof(int32_t)) == 0 &&
               memcmp(scan.end + first, expected.end + first,
                      (size_t)(next - first) * sizeof(int32_t)) == 0;
        for (int32_t t = first, h = 0; same && t < next; t++) {
            for (int32_t c = s->triangular ? t + 1 : 0; same && c < s->n; c++) {
                const float square = square_of(s, HS_SCAN_DIRECT, t, c);
                if (!(square > s->direct.out)) {
                    same = isnan(square) ? isnan(scan.squares[h]) : scan.squares[h] == square;
                    h++;
                }
            }
        }
        CHECK(same);
    }
    return calls;
}

/* All scans with one cutoff. */
static inline int
check_exactly(const hs_kernel *kernel, const numbers *s)
{
    const scan_pair expanded = {kernel->list, kernel->count, by_expansion};
    const scan_pair direct = {kernel->list_direct, kernel->count_direct, by_cutoff};
    int             calls = check_both(expanded, s, NULL) + check_both(direct, s, NULL);
    for (int variant = 0; variant < 2; variant++) {
        calls += check_squares(kernel, s, variant);
    }
    return calls;
}

/* Sets what decides the pairs of a scene. */
typedef void (*scan_filling)(harness_random *random, int trial, numbers *s);

/* Blocks up to capacity, full groups, many hits or many unsure ones, ample room and little: scans
 * stop before hits might not fit. `check` returns the calls of two functions, twice each. */
static inline void
check_room(uint64_t seed, scan_filling fill, int (*check)(const hs_kernel *, const numbers *),
           numbers *s)
{
    static const int32_t sizes[] = {1, 127, 1000, HS_BLOCK_CANDIDATES - 1, HS_BLOCK_CANDIDATES};
    harness_random       random = {seed};
    const hs_kernel     *kernel;
    int                  most = 0, least = 1000;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int trial = 0; trial < 20; trial += IS_SLOW ? 4 : 1) { /* all sizes, each d */
            const int32_t n = sizes[trial % 5], n_points = n == 1 ? 1 : HS_GROUP_POINTS - trial % 3;
            fill_with_integers(&random, 1 + trial % 3, n, n_points, s);
            fill(&random, trial, s);
            s->triangular = trial >= 10 && n >= n_points;
            if (trial / 5 % 2) {
                s->most_hits = MOST_HITS; /* what a large scene has */
                s->most_unsure = HS_BLOCK_CANDIDATES;
            }
            const int calls = check(kernel, s);
            most = calls > most ? calls : most;
            least = calls < least ? calls : least;
        }
    }
    CHECK(least == 4); /* one call of each */
    CHECK(most > HS_GROUP_POINTS);
}

#endif
