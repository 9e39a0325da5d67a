/* SPDX-License-Identifier: BSD-3-Clause */
/* scan_checks.h: a plain specification of the scans, and scans of a kernel compared with it. */
#ifndef HS_SCAN_CHECKS_H
#define HS_SCAN_CHECKS_H

#include <math.h>

#include "kernel_checks.h"

enum {
    MOST_HITS = 2 * HS_BLOCK_CANDIDATES, /* of a scan here */
    MOST_ROWS = 3                        /* of radii */
};

/* A scan with its arrays, owned by this file and reused. */
static guarded y_pages[HS_MAX_DIM], norm_pages, label_pages, q_pages[HS_MAX_DIM];
static guarded hits_pages, squares_pages, end_pages, unsure_pages;
static guarded point_radius_pages, block_radius_pages, row_pages;

static inline void
guard_scans(void)
{
    const size_t candidates = (HS_BLOCK_CANDIDATES + HS_PADDING) * sizeof(float);
    for (int k = 0; k < HS_MAX_DIM; k++) {
        y_pages[k] = guarded_pages(candidates);
        q_pages[k] = guarded_pages(HS_GROUP_POINTS * sizeof(float));
    }
    norm_pages = guarded_pages(candidates);
    block_radius_pages = guarded_pages(MOST_ROWS * candidates);
    row_pages = guarded_pages(HS_GROUP_POINTS * sizeof(int32_t));
    point_radius_pages = guarded_pages(HS_GROUP_POINTS * sizeof(float));
    label_pages = guarded_pages(candidates);
    hits_pages = guarded_pages((MOST_HITS + HS_PADDING) * sizeof(int32_t));
    squares_pages = guarded_pages((MOST_HITS + HS_PADDING) * sizeof(float));
    end_pages = guarded_pages(HS_GROUP_POINTS * sizeof(int32_t));
    unsure_pages = guarded_pages(HS_BLOCK_CANDIDATES * sizeof(hs_unsure));
}

/* The numbers of a scene; they are copied against the guards. */
typedef struct numbers {
    int           ndim;
    int32_t       n, n_points;
    int32_t       most_hits, most_unsure; /* room for that many */
    bool          triangular;
    float         y[HS_MAX_DIM][HS_BLOCK_CANDIDATES];
    float         norm[HS_BLOCK_CANDIDATES];
    int32_t       label[HS_BLOCK_CANDIDATES];
    float         q[HS_MAX_DIM][HS_GROUP_POINTS];
    hs_thresholds direct;
    hs_expanded   expanded;
    hs_rule       rule;
    float         bound;
    hs_limit_form form;
    bool          has_of_point, has_of_block; /* else NULL */
    float         of_point[HS_GROUP_POINTS], of_block[HS_BLOCK_CANDIDATES];
    int32_t       n_rows; /* of radii of the block; 0: one for all points */
} numbers;

/* The radius of candidate c in this row: some are negative in a row that is one of several. */
static inline float
row_radius(const numbers *s, int32_t row, int32_t c)
{
    return s->n_rows > 0 && (c + row) % 5 == 0 ? -1.0f : s->of_block[(c + 7 * row) % s->n];
}

static inline int32_t
row_of(const numbers *s, int32_t t)
{
    return s->n_rows > 0 ? t * 5 % s->n_rows : 0;
}

/* What lies past the last candidate must never be listed, whatever it is. */
static inline void
place_floats(guarded pages, const float *from, int32_t n, bool at_end, const float **to)
{
    const int32_t room = n + HS_PADDING;
    float        *array = guarded_place(pages, room, sizeof(float), at_end);
    memcpy(array, from, (size_t)n * sizeof(float));
    for (int32_t c = n; c < room; c++) {
        array[c] = c % 3 == 0 ? NAN : c % 3 == 1 ? 0.0f : -INFINITY;
    }
    *to = array;
}

/* Radii against the guards. */
static inline void
place_limits(const numbers *s, bool at_end, hs_limit_scan *limits)
{
    *limits = (hs_limit_scan){.rule = s->rule, .bound = s->bound, .form = s->form};
    if (s->has_of_point) {
        float *radii = guarded_place(point_radius_pages, s->n_points, sizeof(float), at_end);
        memcpy(radii, s->of_point, (size_t)s->n_points * sizeof(float));
        limits->of_point = radii;
    }
    if (s->has_of_block) {
        const int32_t n_rows = s->n_rows > 0 ? s->n_rows : 1, pitch = s->n + HS_PADDING;
        float        *all =
            guarded_place(block_radius_pages, (int64_t)n_rows * pitch, sizeof(float), at_end);
        for (int32_t e = 0; e < n_rows * pitch; e++) {
            all[e] = e % pitch < s->n ? row_radius(s, e / pitch, e % pitch) : NAN;
        }
        limits->of_block = all;
        limits->stride = pitch;
    }
    if (s->has_of_block && s->n_rows > 0) {
        int32_t *row = guarded_place(row_pages, s->n_points, sizeof(int32_t), at_end);
        for (int32_t t = 0; t < s->n_points; t++) {
            row[t] = row_of(s, t);
        }
        limits->row = row;
    }
}

static inline hs_scan
place_scan(const numbers *s, bool at_end)
{
    hs_scan scan = {.ndim = s->ndim,
                    .n = s->n,
                    .n_points = s->n_points,
                    .most_hits = s->most_hits,
                    .most_unsure = s->most_unsure,
                    .triangular = s->triangular,
                    .direct = s->direct,
                    .expanded = s->expanded,
                    .n_unsure = -1,
                    .n_hits = -1};
    for (int k = 0; k < s->ndim; k++) {
        float *q = guarded_place(q_pages[k], s->n_points, sizeof(float), at_end);
        memcpy(q, s->q[k], (size_t)s->n_points * sizeof(float));
        scan.q[k] = q;
        place_floats(y_pages[k], s->y[k], s->n, at_end, &scan.y[k]);
    }
    place_floats(norm_pages, s->norm, s->n, at_end, &scan.norm);
    place_limits(s, at_end, &scan.limits);
    int32_t *label = guarded_place(label_pages, s->n + HS_PADDING, sizeof(int32_t), at_end);
    memcpy(label, s->label, (size_t)s->n * sizeof(int32_t));
    memset(label + s->n, 0xff, HS_PADDING * sizeof(int32_t));
    scan.label = label;
    scan.hits = guarded_place(hits_pages, s->most_hits + HS_PADDING, sizeof(int32_t), at_end);
    scan.squares = guarded_place(squares_pages, s->most_hits + HS_PADDING, sizeof(float), at_end);
    scan.end = guarded_place(end_pages, s->n_points, sizeof(int32_t), at_end);
    scan.unsure = guarded_place(unsure_pages, s->most_unsure, sizeof(hs_unsure), at_end);
    return scan;
}

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

static inline hs_thresholds
thresholds_of(const numbers *s, hs_scan_form form, int32_t t, int32_t c)
{
    double norm = 0.0;
    if (form == HS_SCAN_LIMITS) {
        return limit_thresholds_of(s, t, c);
    }
    for (int k = 0; k < s->ndim; k++) {
        norm += (double)s->q[k][t] * (double)s->q[k][t];
    }
    const hs_thresholds moved = {(float)(s->expanded.in - norm), (float)(s->expanded.out - norm)};
    return form == HS_SCAN_EXPANDED ? moved : s->direct;
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
expect(const numbers *s, hs_scan_form form, bool lists, int32_t first)
{
    int64_t n_hits = 0;
    int32_t n_unsure = 0, t = first;
    for (; t < s->n_points; t++) {
        if ((lists && n_hits + s->n > s->most_hits) || n_unsure + s->n > s->most_unsure) {
            break;
        }
        for (int32_t c = s->triangular ? t + 1 : 0; c < s->n; c++) {
            const hs_thresholds limits = thresholds_of(s, form, t, c);
            const float         square = square_of(s, form, t, c);
            if (square > limits.out) {
                continue;
            }
            if (!(square < limits.in)) {
                expected.unsure[n_unsure++] = (hs_unsure){t, c, (int32_t)n_hits};
            }
            if (lists) {
                expected.hits[n_hits] = s->label[c];
            }
            n_hits++;
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
check_form(hs_scan_fn function, const numbers *s, hs_scan_form form, bool lists, bool at_end)
{
    int     calls = 0;
    bool    same = true;
    hs_scan scan = place_scan(s, at_end);
    for (int32_t first = 0, next; first < s->n_points && same; first = next) {
        fill_with_sevens(&scan);
        expect(s, form, lists, first);
        next = function(&scan, first);
        calls++;
        same = next == expected.next && scan.n_hits == expected.n_hits && same_unsure(&scan, lists);
        same = same && memcmp(scan.end + first, expected.end + first,
                              (size_t)(next - first) * sizeof(int32_t)) == 0;
        if (lists && same) {
            same = memcmp(scan.hits, expected.hits, (size_t)scan.n_hits * sizeof(int32_t)) == 0;
        } else if (same) {
            same = untouched(&scan);
        }
        CHECK(same);
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
        expect(&listed, HS_SCAN_DIRECT, true, first);
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

/* All scans, against the guard before and the one after; only for numbers with which no
 * rounding can differ. */
static inline int
check_exactly(const hs_kernel *kernel, const numbers *s)
{
    int calls = 0;
    for (int variant = 0; variant < 2; variant++) {
        calls += check_form(kernel->list, s, HS_SCAN_EXPANDED, true, variant);
        calls += check_form(kernel->count, s, HS_SCAN_EXPANDED, false, variant);
        calls += check_form(kernel->list_direct, s, HS_SCAN_DIRECT, true, variant);
        calls += check_form(kernel->count_direct, s, HS_SCAN_DIRECT, false, variant);
        calls += check_squares(kernel, s, variant);
    }
    return calls;
}

/* As little room for hits and unsure ones as a scan may have, or more. */
static inline void
choose_room(harness_random *random, numbers *s)
{
    const unsigned hits = (unsigned)(MOST_HITS - s->n);
    const unsigned unsure = (unsigned)(HS_BLOCK_CANDIDATES - s->n);
    const bool     least = random_bits(random) % 2;
    s->most_hits = s->n + (least ? 0 : (int32_t)(random_bits(random) % (hits + 1)));
    s->most_unsure = s->n + (least ? 0 : (int32_t)(random_bits(random) % (unsure + 1)));
}

/* Small integers: all sums are exact however they are formed. */
static inline void
fill_with_integers(harness_random *random, int ndim, int32_t n, int32_t n_points, numbers *s)
{
    s->ndim = ndim;
    s->n = n;
    s->n_points = n_points;
    s->triangular = n >= n_points && random_bits(random) % 2;
    choose_room(random, s);
    for (int32_t c = 0; c < n; c++) {
        s->norm[c] = 0.0f;
        for (int k = 0; k < ndim; k++) {
            s->y[k][c] = (float)(random_bits(random) % 7) - 3.0f;
            s->norm[c] += s->y[k][c] * s->y[k][c];
        }
        s->label[c] = (int32_t)(random_bits(random) >> 33);
    }
    for (int32_t t = 0; t < n_points; t++) {
        for (int k = 0; k < ndim; k++) {
            s->q[k][t] = (float)(random_bits(random) % 5) - 2.0f;
        }
    }
}

/* The same thresholds for both forms, on numbers that occur. */
static inline void
set_limits(numbers *s, float in, float out)
{
    s->direct = (hs_thresholds){in, out};
    s->expanded = (hs_expanded){(double)in, (double)out};
}

#endif
