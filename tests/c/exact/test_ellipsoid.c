/* SPDX-License-Identifier: BSD-3-Clause */
/* test_ellipsoid.c: supports of points: ellipsoids that contain one another or not, decided
 * exactly. */
#include "../../../csrc/core/exact/ellipsoid.h"
#include "../support/bigint.h"
#include "../support/harness.h"

#include <math.h>

void test_ellipsoid(void);

/* The three stages one after the other. */
static bool
is_within_support(const hs_support_metric *metric, const double *entries, double size,
                  const hs_metric *measure, const hs_span *span, hs_stages *stages)
{
    hs_support_span of;
    hs_support_span_of(measure, span, &of);
    const hs_verdict verdict = hs_support_decide_double(metric, entries, size, &of, stages);
    if (verdict != HS_UNDECIDED) {
        return verdict == HS_WITHIN;
    }
    stages->by_integers++;
    const int sign = hs_support_compare(metric, entries, measure, span);
    return sign < 0 || (sign == 0 && metric->limit.inclusive);
}

/*
 * ---- support ----
 *
 * Which matrices are positive definite and how far their ellipsoids reach, against leading minors
 * as integers: certain for every float64, and nearly as short as can be.
 */

/* Scaled, so that three of them fit bigint.h, of whose unit 2^-1074 they are multiples. */
static big
entry(const double *h, double less, int k, int l)
{
    const big own = big_from_double(ldexp(h[hs_support_at(k, l)], -700));
    return k == l ? big_difference(own, big_from_double(ldexp(less, -700))) : own;
}

static big
minor_of(const double *h, double less, int a, int b, int c, int d)
{
    return big_difference(big_product(entry(h, less, a, c), entry(h, less, b, d)),
                          big_product(entry(h, less, a, d), entry(h, less, b, c)));
}

/* Whether H - less I is positive definite. */
static bool
is_definite(int ndim, const double *h, double less)
{
    const big one = entry(h, less, 0, 0);
    if (one.sign <= 0 || (ndim > 1 && minor_of(h, less, 0, 1, 0, 1).sign <= 0)) {
        return false;
    }
    if (ndim < 3) {
        return true;
    }
    const big first = big_product(one, minor_of(h, less, 1, 2, 1, 2));
    const big second = big_product(entry(h, less, 0, 1), minor_of(h, less, 1, 2, 0, 2));
    const big third = big_product(entry(h, less, 0, 2), minor_of(h, less, 1, 2, 0, 1));
    return big_sum(big_difference(first, second), third).sign > 0;
}

/* The sum of d - 1 or more squares of small integer vectors: singular with d - 1. */
static void
fill(harness_random *random, int ndim, int n_vectors, double *h)
{
    for (int e = 0; e < HS_SUPPORT_ENTRIES; e++)
        h[e] = 0.0;
    for (int v = 0; v < n_vectors; v++) {
        double x[3];
        for (int k = 0; k < ndim; k++)
            x[k] = (double)(random_bits(random) % 64) - 32.0;
        for (int k = 0; k < ndim; k++)
            for (int l = 0; l <= k; l++)
                h[hs_support_at(k, l)] += x[k] * x[l];
    }
}

/* Indefinite ones, singular ones and those a hair beside, at any scale. */
static void
definite_is_decided_exactly(void)
{
    harness_random random = {601};
    int            wrong = 0, count[2] = {0, 0};
    for (int trial = 0; trial < TRIALS(30000); trial++) {
        const int ndim = 1 + trial % 3;
        double    h[HS_SUPPORT_ENTRIES], scaled[HS_SUPPORT_ENTRIES], reach;
        const int scale = (int)(random_bits(&random) % 1600) - 800;
        fill(&random, ndim, ndim - (trial / 3 % 2), h);
        if (trial / 6 % 3 > 0) {
            const int k = (int)(random_bits(&random) % (uint64_t)ndim);
            const int hair = (int)(random_bits(&random) % 30);
            h[hs_support_at(k, k)] += ldexp(trial / 18 % 2 ? 1.0 : -1.0, -hair);
        }
        for (int e = 0; e < HS_SUPPORT_ENTRIES; e++)
            scaled[e] = ldexp(h[e], scale);
        const bool             expected = is_definite(ndim, h, 0.0);
        const hs_support_state state = hs_support_reach(ndim, scaled, ldexp(1.0, scale), &reach);
        wrong += (state == HS_SUPPORT_FITS) != expected || state == HS_SUPPORT_TOO_LONG;
        count[expected]++;
    }
    CHECK(wrong == 0 && count[0] > TRIALS(30000) / 4 && count[1] > TRIALS(30000) / 4);
}

/* extent / reach is below all eigenvalues, and 1.02 of it is not. */
static void
reaches_are_bounds_and_not_far_off(void)
{
    harness_random random = {602};
    int            wrong = 0, far = 0, seen = 0;
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const int    ndim = 1 + trial % 3;
        const double extent = ldexp(1.0, (int)(random_bits(&random) % 20));
        double       h[HS_SUPPORT_ENTRIES], reach;
        fill(&random, ndim, ndim + 1 - trial / 3 % 2, h);
        if (trial % 5 == 0) /* a needle, or what is nearly singular */
            h[0] += ldexp(1.0, (int)(random_bits(&random) % 40) - 10);
        if (hs_support_reach(ndim, h, extent, &reach) != HS_SUPPORT_FITS)
            continue;
        seen++;
        /* Rounded the other way, so that the tests are strict. */
        wrong += !is_definite(ndim, h, nextafter(extent / reach, 0.0) * (1.0 - 0x1p-50));
        far += is_definite(ndim, h, 1.02 * (extent / reach));
    }
    CHECK(wrong == 0 && far == 0 && seen > TRIALS(20000) / 2);
}

/* Where the axes differ by less than a factor of 100, by less than a millionth. */
static void
reaches_of_round_supports_are_near(void)
{
    harness_random random = {603};
    int            far = 0;
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const int ndim = 1 + trial % 3;
        double    h[HS_SUPPORT_ENTRIES], reach;
        fill(&random, ndim, ndim, h);
        for (int k = 0; k < ndim; k++)
            h[hs_support_at(k, k)] += 1024.0 * 64.0 / 60.0; /* the largest one is below 3 * 2^15 */
        CHECK(hs_support_reach(ndim, h, 1.0, &reach) == HS_SUPPORT_FITS);
        far += is_definite(ndim, h, (1.0 + 1e-6) / reach);
    }
    CHECK(far == 0);
}

/* Diagonal ones, whose eigenvalues are known, of all sizes; the identity is no needle. */
static void
extremes_fit_or_are_refused(void)
{
    const double thin[] = {0x1p-1000, 0.0, 0x1p60, 0.0, 0.0, 1.0};
    const double tiny[] = {0x1p-1074, 0.0, 1.0, 0.0, 0.0, 1.0};
    const double flat[] = {1.0, 0.0, 0x1p1000, 0.0, 0.0, 0x1p1000};
    const double huge[] = {0x1p-600, 0.0, 0x1p600, 0.0, 0.0, 1.0};
    const double one[] = {1.0, 0.0, 1.0, 0.0, 0.0, 1.0};
    double       reach = -1.0;
    CHECK(hs_support_reach(3, one, 0.0, &reach) == HS_SUPPORT_FITS && reach == 0.0);
    CHECK(hs_support_reach(3, one, 0x1p1021, &reach) == HS_SUPPORT_FITS && reach >= 0x1p1021);
    CHECK(hs_support_reach(3, one, 0x1p1023, &reach) == HS_SUPPORT_TOO_LONG);
    CHECK(hs_support_reach(1, one, 5e-324, &reach) == HS_SUPPORT_FITS && reach >= 5e-324);
    CHECK(hs_support_reach(3, flat, 3.0, &reach) == HS_SUPPORT_FITS);
    CHECK(reach >= 3.0 && reach < 3.05);
    CHECK(hs_support_reach(3, huge, 1.0, &reach) == HS_SUPPORT_TOO_LONG);
    CHECK(hs_support_reach(2, huge, 1.0, &reach) == HS_SUPPORT_TOO_LONG);
    CHECK(hs_support_reach(3, tiny, 1.0, &reach) == HS_SUPPORT_TOO_LONG);
    CHECK(hs_support_reach(3, tiny, 0x1p-100, &reach) == HS_SUPPORT_TOO_LONG);
    CHECK(hs_support_reach(3, thin, 0x1p-30, &reach) == HS_SUPPORT_FITS);
    CHECK(reach >= 0x1p970 && reach < 0x1.05p970);
    CHECK(hs_support_reach(3, thin, 0x1p200, &reach) == HS_SUPPORT_TOO_LONG);
    CHECK(hs_support_reach(1, tiny, 0x1p-1074, &reach) == HS_SUPPORT_FITS);
    CHECK(reach >= 1.0 && reach < 1.001);
}

/* Two negative eigenvalues and a positive one, which lies above the diagonal, and a determinant that
 * is positive: what passes for the smallest eigenvalue is the largest. */
static void
two_negative_eigenvalues_are_none_positive(void)
{
    for (int beside = 2; beside < 1000;
         beside++) { /* eigenvalues 1 - beside, twice, 1 + 2 beside */
        const double of = beside, h[] = {1.0, of, 1.0, of, of, 1.0};
        double       reach;
        CHECK(!is_definite(3, h, 0.0));
        CHECK(hs_support_reach(3, h, 1.0, &reach) == HS_SUPPORT_NOT_DEFINITE && reach == 0.0);
    }
}

/* No smaller than the root of the sum of all squares, which for these is a whole number. */
static void
sizes_are_bounds(void)
{
    const double h[] = {1.0, 2.0, 4.0, 2.0, -2.0, 8.0}; /* 1 + 16 + 64 + 2 * 12 = 105 */
    const double plane[] = {1.0, 2.0, 4.0};             /* 25 */
    for (int scale = -1060; scale <= 1018; scale += 20) {
        double scaled[6];
        for (int e = 0; e < 6; e++)
            scaled[e] = ldexp(h[e], scale);
        const double size = hs_support_size(3, scaled);
        CHECK(size >= ldexp(sqrt(105.0), scale) * (1.0 - 0x1p-52));
        CHECK(scale < -1000 || size <= ldexp(sqrt(105.0), scale) * (1.0 + 0x1p-46));
    }
    CHECK(hs_support_size(2, plane) >= 5.0 && hs_support_size(2, plane) < 5.0 + 1e-12);
    CHECK(hs_support_size(1, plane) >= 1.0 && hs_support_size(1, plane) < 1.0 + 1e-12);
    const double largest[] = {0x1.fffffffffffffp1023, 0.0, 0x1.fffffffffffffp1023};
    CHECK(hs_support_size(2, largest) == HUGE_VAL);
}

/*
 * ---- metric support ----
 *
 * |H D| against an extent, held against integers: ties, hairs beside them, H D that cancels, any
 * scale.
 */

typedef struct scene {
    int     ndim, n_rows;
    double  p[3], q[3], rows[8][8], h[HS_SUPPORT_ENTRIES];
    int64_t shift[3];
    double  extent;
} scene;

/* Coordinates and entries are small enough for squares of products in bigint.h, whose unit is
 * 2^-1074: they are scaled so that what counts is about 2^-800. */
static big
scaled(double x)
{
    return big_from_double(ldexp(x, -800));
}

/* (H D)_k in units of 2^-1074 2^-1074 times 2^1600. */
static big
component(const scene *s, int k)
{
    big sum = big_from_int(0);
    for (int l = 0; l < s->ndim; l++) {
        big d = big_difference(scaled(s->q[l]), scaled(s->p[l]));
        for (int r = 0; r < s->n_rows; r++)
            d = big_sum(d, big_product(big_from_int(s->shift[r]), scaled(s->rows[r][l])));
        sum = big_sum(sum, big_product(scaled(s->h[hs_support_at(k, l)]), d));
    }
    return sum;
}

/* Sign of |H D|^2 - extent^2. */
static int
true_sign(const scene *s)
{
    big       sum = big_from_int(0);
    const big limit = big_product(scaled(s->extent), scaled(1.0));
    for (int k = 0; k < s->ndim; k++) {
        const big z = component(s, k);
        sum = big_sum(sum, big_product(z, z));
    }
    return big_compare(sum, big_product(limit, limit));
}

static int64_t
decided(const hs_stages *stages)
{
    return stages->by_float64 + stages->by_double_word + stages->by_integers;
}

/* The decision and its last stage alone, strict and inclusive, both ways round, in units of D that
 * are powers of two apart. */
static bool
decides_like(const scene *s, int sign, hs_stages *stages)
{
    static const int exponents[] = {0, 3, -40, 300};
    const double     size = hs_support_size(s->ndim, s->h);
    bool             right = true;
    for (int e = 0; e < 4; e++) {
        double  p[3], q[3], rows[8][8] = {{0.0}};
        int64_t back[3];
        for (int k = 0; k < s->ndim; k++) {
            p[k] = ldexp(s->p[k], exponents[e]);
            q[k] = ldexp(s->q[k], exponents[e]);
            back[k] = -s->shift[k];
            for (int r = 0; r < s->n_rows; r++)
                rows[r][k] = ldexp(s->rows[r][k], exponents[e]);
        }
        for (int inclusive = 0; inclusive < 2; inclusive++) {
            const bool        within = sign < 0 || (sign == 0 && inclusive);
            const int64_t     before = decided(stages);
            hs_metric         measure;
            hs_support_metric metric;
            const hs_span     span = {p, q, s->n_rows > 0 ? s->shift : NULL};
            const hs_span     other = {q, p, s->n_rows > 0 ? back : NULL};
            hs_metric_init(&measure, s->ndim, s->n_rows, (const double(*)[8])rows, 1.0, inclusive);
            hs_support_metric_init(s->ndim, s->extent, inclusive, exponents[e], &metric);
            right = right &&
                    is_within_support(&metric, s->h, size, &measure, &span, stages) == within &&
                    is_within_support(&metric, s->h, size, &measure, &other, stages) == within &&
                    hs_support_compare(&metric, s->h, &measure, &span) == sign &&
                    decided(stages) == before + 2;
        }
    }
    return right;
}

/* Entries and coordinates that are small integers over a power of two; the extent is whole. */
static void
ties_of_integers_are_ties(void)
{
    harness_random random = {701};
    hs_stages      stages = {0, 0, 0};
    int            wrong = 0, ties = 0, hairs = 0;
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        scene s = {.ndim = 1 + trial % 3, .n_rows = trial / 3 % 3};
        s.n_rows = s.n_rows > s.ndim ? 0 : s.n_rows;
        for (int k = 0; k < s.ndim; k++) {
            s.p[k] = (double)(random_bits(&random) % 16);
            s.q[k] = (double)(random_bits(&random) % 16);
            s.shift[k] = (int64_t)(random_bits(&random) % 5) - 2;
            for (int r = 0; r < s.n_rows; r++)
                s.rows[r][k] = (double)(random_bits(&random) % 8);
            for (int l = 0; l <= k; l++)
                s.h[hs_support_at(k, l)] =
                    ldexp((double)(random_bits(&random) % 8) - (k == l ? 0.0 : 3.0), -1);
        }
        double square = 0.0;
        for (int k = 0; k < s.ndim; k++) {
            const big    z = component(&s, k);
            const double value = big_to_double(&z, 1600 - 2148);
            square += value * value;
        }
        s.extent = sqrt(square);
        if (trial / 9 % 4 == 1)
            s.q[0] = s.q[0] == 0.0 ? 0x1p-70 : nextafter(s.q[0], HUGE_VAL);
        if (trial / 9 % 4 == 2 && s.extent > 0.0)
            s.extent = nextafter(s.extent, HUGE_VAL);
        const int sign = true_sign(&s);
        wrong += !decides_like(&s, sign, &stages);
        ties += sign == 0;
        hairs += trial / 9 % 4 == 1;
    }
    CHECK(wrong == 0 && ties > TRIALS(20000) / 20 && hairs > 0);
    CHECK(stages.by_float64 > 0 && stages.by_double_word > 0 && stages.by_integers > 0);
}

/* The extent is what H D comes to, or some float64 beside that. */
static void
random_ones_are_decided_as_integers_say(void)
{
    harness_random random = {702};
    hs_stages      stages = {0, 0, 0};
    int            wrong = 0, signs[3] = {0, 0, 0};
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const int spread = trial % 4 == 0 ? 60 : trial % 4 == 1 ? 20 : 2;
        scene     s = {.ndim = 1 + trial % 3, .n_rows = trial / 3 % 2};
        double    square = 0.0;
        for (int k = 0; k < s.ndim; k++) {
            s.p[k] = random_size(&random, spread);
            s.q[k] = random_size(&random, spread);
            s.shift[k] = (int64_t)(random_bits(&random) % 7) - 3;
            s.rows[0][k] = random_size(&random, spread);
            for (int l = 0; l <= k; l++)
                s.h[hs_support_at(k, l)] = random_size(&random, spread);
        }
        for (int k = 0; k < s.ndim; k++) {
            const big    z = component(&s, k);
            const double value = big_to_double(&z, 1600 - 2148);
            square += value * value;
        }
        s.extent = sqrt(square);
        for (int step = (int)(random_bits(&random) % 3); step > 0 && s.extent > 0.0; step--)
            s.extent = nextafter(s.extent, trial & 8 ? 0.0 : HUGE_VAL);
        const int sign = true_sign(&s);
        signs[sign + 1]++;
        wrong += !decides_like(&s, sign, &stages);
    }
    CHECK(wrong == 0 && signs[0] > TRIALS(1000) && signs[1] > TRIALS(10) &&
          signs[2] > TRIALS(1000));
    CHECK(stages.by_double_word > TRIALS(1000) && stages.by_integers > TRIALS(1000));
}

/* Sizes that no float stage takes: by integers alone, whatever they are. */
static void
extremes_are_decided_too(void)
{
    const double sizes[] = {0x1p-1074, 0x1p-1022, 0x1p-500, 0x1p500, 0x1.fffffffffffffp1023};
    hs_stages    stages = {0, 0, 0};
    for (int a = 0; a < 5; a++) {
        for (int b = 0; b < 5; b++) {
            const double      p[3] = {0.0}, q[3] = {sizes[a], -sizes[a], 0.0};
            const double      h[6] = {sizes[b], 0.0, sizes[b], 0.0, 0.0, sizes[b]};
            const double      product = sizes[a] * sizes[b]; /* |H D| is 1.41 of it */
            const hs_span     span = {p, q, NULL};
            hs_metric         measure;
            hs_support_metric below, above;
            hs_metric_init(&measure, 3, 0, NULL, 1.0, true);
            if (!(product >= 0x1p-1000 && product <= 0x1p1000))
                continue;
            hs_support_metric_init(3, 1.41 * product, true, 0, &below);
            hs_support_metric_init(3, 1.42 * product, true, 0, &above);
            const double size = hs_support_size(3, h);
            CHECK(!is_within_support(&below, h, size, &measure, &span, &stages));
            CHECK(is_within_support(&above, h, size, &measure, &span, &stages));
        }
    }
    CHECK(stages.by_integers > 0);
}

/* What a float stage must leave: shifts, rows, units, entries or products that it does not hold. */
static void
what_floats_do_not_hold_is_left_to_integers(void)
{
    static const struct {
        double  q[2], row[2];
        int64_t shift;
        double  h[3], extent; /* [0][0], [1][0], [1][1] */
        int     exponent, sign;
    } cases[] = {
        {{-0x1p53, 0.0}, {1.0, 0.0}, (INT64_C(1) << 53) + 1, {1.0, 0.0, 1.0}, 1.0, 0, 0},
        {{-0x1p53, 0.0}, {1.0, 0.0}, (INT64_C(1) << 53) + 2, {1.0, 0.0, 1.0}, 1.0, 0, 1},
        {{1.0, 0.0}, {0x1p-450, 0.0}, 1, {1.0, 0.0, 1.0}, 1.0, 0, 1},
        {{1.0, 0.0}, {0x1p-450, 0.0}, -1, {1.0, 0.0, 1.0}, 1.0, 0, -1},
        {{0x1p950, 0.0}, {0.0}, 0, {1.0, 0.0, 1.0}, 1.0, 950, 0},
        {{0x1p-950, 0.0}, {0.0}, 0, {1.0, 0.0, 1.0}, 1.0, -950, 0},
        {{0x1p950, 0.0}, {0.0}, 0, {1.0, 0.0, 1.0}, 1.0 - 0x1p-53, 950, 1},
        {{0x1p-200, 0.0}, {0.0}, 0, {0x1p-250, 0.0, 0x1p-250}, 1.0, 0, -1},
        {{1.0, 1.0}, {0.0}, 0, {1.0, 0.0, 0x1p-950}, 1.0, 0, 1},
        {{1.0, 0.0}, {0.0}, 0, {1.0, 0.0, 0x1p-950}, 1.0, 0, 0},
        {{1.0, 0.0}, {0.0}, 0, {1.0, 0x1p-950, 0x1p-950}, 1.0, 0, 1},
        {{1.0, -0x1p-150}, {0.0}, 0, {1.0, 0x1p-300, 0x1p-150}, 1.0, 0, -1},
        {{1.0, 0x1p-150}, {0.0}, 0, {1.0, 0x1p-300, 0.0}, 1.0, 0, 1},
    };
    static const double p[2] = {0.0, 0.0};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        const double  rows[1][8] = {{cases[c].row[0], cases[c].row[1]}};
        const double  size = hs_support_size(2, cases[c].h);
        const hs_span span = {p, cases[c].q, cases[c].shift != 0 ? &cases[c].shift : NULL};
        for (int inclusive = 0; inclusive < 2; inclusive++) {
            const bool        within = cases[c].sign < 0 || (cases[c].sign == 0 && inclusive);
            hs_stages         stages = {0, 0, 0};
            hs_metric         measure;
            hs_support_metric metric;
            hs_metric_init(&measure, 2, 1, rows, 1.0, inclusive);
            hs_support_metric_init(2, cases[c].extent, inclusive, cases[c].exponent, &metric);
            CHECK(is_within_support(&metric, cases[c].h, size, &measure, &span, &stages) == within);
            CHECK(stages.by_integers == 1 && decided(&stages) == 1);
            CHECK(hs_support_compare(&metric, cases[c].h, &measure, &span) == cases[c].sign);
        }
    }
}

/* One axis: an entry and a D, of which the low word is nearly half a unit, so that all roundings go
 * one way, as far as they can. Relative to the bound; least: 1 where it is broken. */
static double
of_bound(double h, hs_dw d, bool wide)
{
    hs_support_span of = {.usable = true, .size = d.hi};
    hs_difference   z;
    double          plain, error, found_lo = 0.0;
    of.difference.component[0] = d;
    of.difference.error = of.difference.lost = 0.0;
    /* h is its own size; hs_support_size is a unit or two above it. */
    if (wide) {
        hs_support_wide_product(&h, h, &of, 1, &z);
        plain = z.component[0].hi;
        found_lo = z.component[0].lo;
        error = z.error;
    } else {
        error = hs_support_product(&h, h, &of, 1, &plain);
    }
    const big real = big_product(big_sum(scaled(d.hi), scaled(d.lo)), scaled(h));
    const big found = big_product(big_sum(scaled(plain), scaled(found_lo)), scaled(1.0));
    const big off = big_difference(real, found);
    return fabs(big_to_double(&off, 1600 - 2148)) / error;
}

/* Also where a span was used before. */
static void
the_size_of_D_is_that_of_its_components(void)
{
    static const double p[3] = {1.0, 2.0, 3.0}, q[3] = {1.5, 2.0, -1.0};
    static const double rows[3][8] = {{16.0}, {1.0, 16.0}, {0.0, 0.0, 16.0}};
    hs_metric           metric;
    hs_support_span     of;
    memset(&of, 0x11, sizeof of);
    hs_metric_init(&metric, 3, 3, rows, 1.0, true);
    for (int pass = 0; pass < 2; pass++) {
        hs_support_span_of(&metric, &(hs_span){p, q, NULL}, &of);
        CHECK(of.usable && of.size == 0.5 + 4.0);
        hs_support_span_of(&metric, &(hs_span){p, q, (const int64_t[]){1, -1, 0}}, &of);
        CHECK(of.usable && of.size == 15.5 + 16.0 + 4.0);
    }
}

static void
bounds_hold_and_are_nearly_reached(void)
{
    harness_random random = {703};
    double         most = 0.0, most_wide = 0.0;
    for (int trial = 0; trial < 400000; trial++) {
        /* Just above powers of two, where units are largest beside the number; and with a product
         * a little below the middle between two floats, and of the low word above its own. */
        const uint64_t bits = random_bits(&random), j = (1 << 26) + bits % (1 << 30);
        const double   middle = ((double)(bits >> 58) + 0.5) * 0x1p52;
        const double   i = trial % 2 ? floor(middle / (double)j) : (double)(bits >> 36);
        const double   below = ldexp(random_unit(&random), -27);
        const hs_dw    d = {1.0 + ldexp(i, -52), ldexp(1.0 - below, -53)};
        const double   h = 1.0 + ldexp((double)j, -52);
        most = fmax(most, of_bound(h, d, false));
        most_wide = fmax(most_wide, of_bound(h, d, true));
    }
    CHECK(most <= 1.0 && most > 0.8);
    CHECK(most_wide <= 1.0 && most_wide > 0.6);
}

/* precision="double" and "single" are these formulas. */
static void
rounded_formulas_are_fixed(void)
{
    harness_random random = {704};
    int            wrong = 0, within = 0;
    for (int trial = 0; trial < 4000; trial++) {
        scene s = {.ndim = 3, .n_rows = trial / 2 % 4};
        for (int k = 0; k < 3; k++) {
            s.p[k] = random_unit(&random);
            s.q[k] = random_unit(&random);
            s.shift[k] = (int64_t)(random_bits(&random) % 5) - 2;
            for (int r = 0; r < s.n_rows; r++)
                s.rows[r][k] = 0.3 * random_unit(&random);
        }
        for (int e = 0; e < HS_SUPPORT_ENTRIES; e++)
            s.h[e] = random_unit(&random);
        s.extent = random_unit(&random);
        volatile double square = 0.0;
        volatile float  small = 0.0f;
        for (int k = 0; k < 3; k++) {
            volatile double z = 0.0;
            volatile float  y = 0.0f;
            for (int l = 0; l < 3; l++) {
                const volatile double h = s.h[hs_support_at(k, l)];
                volatile double       offset = 0.0, d = s.q[l] - s.p[l];
                for (int r = 0; r < s.n_rows; r++) {
                    const volatile double part = (double)s.shift[r] * s.rows[r][l];
                    offset = offset + part;
                }
                d = d + (trial & 8 ? offset : 0.0);
                const volatile double term = h * d;
                const volatile float  product = (float)h * (float)d;
                z = z + term;
                y = y + product;
            }
            const volatile double one = z * z;
            const volatile float  other = y * y;
            square = square + one;
            small = small + other;
        }
        hs_metric         measure;
        hs_support_metric metric;
        const hs_span     span = {s.p, s.q, trial & 8 ? s.shift : NULL};
        const float       extent = (float)s.extent;
        hs_metric_init(&measure, 3, s.n_rows, (const double(*)[8])s.rows, 1.0, true);
        hs_support_metric_init(3, s.extent, trial & 1, 0, &metric);
        const bool in = trial & 1 ? square <= s.extent * s.extent : square < s.extent * s.extent;
        const bool in_small = trial & 1 ? small <= extent * extent : small < extent * extent;
        wrong += hs_support_within_rounded(&metric, s.h, &measure, &span, false) != in;
        wrong += hs_support_within_rounded(&metric, s.h, &measure, &span, true) != in_small;
        within += in;
    }
    CHECK(wrong == 0 && within > 100);
}

/* ---- how wide supports are along a normal, against cofactors as integers ---- */

static big
whole(double x)
{
    return big_from_double(ldexp(x, -700));
}

/* The cofactor of an entry of three rows. */
static big
cofactor(const double *h, int k, int l)
{
    const int a = k == 0, b = k == 2 ? 1 : 2, c = l == 0, d = l == 2 ? 1 : 2;
    const big plus = big_product(whole(h[hs_support_at(a, c)]), whole(h[hs_support_at(b, d)]));
    const big minus = big_product(whole(h[hs_support_at(a, d)]), whole(h[hs_support_at(b, c)]));
    const big difference = big_difference(plus, minus);
    return (k + l) % 2 ? big_negated(difference) : difference;
}

/* Sign of |H^-1 normal| - width, for three rows and an extent of 1. */
static int
compare_width(const double *h, const double *normal, double width)
{
    big sum = big_from_int(0), determinant = big_from_int(0);
    for (int k = 0; k < 3; k++) {
        big y = big_from_int(0);
        for (int l = 0; l < 3; l++)
            y = big_sum(y, big_product(cofactor(h, k, l), whole(normal[l])));
        sum = big_sum(sum, big_product(y, y));
        determinant =
            big_sum(determinant, big_product(whole(h[hs_support_at(0, k)]), cofactor(h, 0, k)));
    }
    /* y is cofactor times normal: as many factors as the determinant; the width is one more. */
    const big one = whole(1.0), limit = big_product(determinant, whole(width));
    return big_compare(big_product(sum, big_product(one, one)), big_product(limit, limit));
}

static void
fill_support_along(harness_random *random, double needle, double *h)
{
    double v[3][3];
    for (int e = 0; e < HS_SUPPORT_ENTRIES; e++)
        h[e] = 0.0;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            v[i][k] = (double)(random_bits(random) % 64) - 32.0;
            for (int l = 0; l <= k; l++)
                h[hs_support_at(k, l)] += v[i][k] * v[i][l];
        }
    }
    for (int k = 0; k < 3; k++)
        h[hs_support_at(k, k)] += needle;
}

static void
widths_are_bounds_and_near(void)
{
    harness_random random = {901};
    int            wrong = 0, far = 0, seen = 0;
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        double       h[HS_SUPPORT_ENTRIES], reach;
        const double normals[4][3] = {
            {1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.6, 0.8}, {-0.48, 0.36, 0.8}};
        const double *normal = normals[trial % 4];
        fill_support_along(&random, ldexp(1.0, -(trial / 4 % 30)), h);
        if (hs_support_reach(3, h, 1.0, &reach) != HS_SUPPORT_FITS)
            continue;
        const double width = hs_support_width(3, h, hs_support_size(3, h), 1.0, reach, normal);
        wrong += compare_width(h, normal, width) > 0 || !(width <= reach * 1.0001);
        far += compare_width(h, normal, 0.99 * width) < 0;
        seen++;
    }
    CHECK(wrong == 0 && far == 0 && seen > TRIALS(20000) / 2);
}

/* Beside diagonal ones, and of what float64 hardly holds. */
static void
widths_of_any_dimension_and_size(void)
{
    const double h[] = {2.0, 0.0, 8.0, 0.0, 0.0, 0.5}, x[] = {1.0, 0.0, 0.0}, y[] = {0.0, 1.0, 0.0};
    for (int ndim = 1; ndim <= 3; ndim++) {
        const double reach = ndim < 3 ? 1.0 : 4.0, size = hs_support_size(ndim, h);
        const double along = hs_support_width(ndim, h, size, 2.0, reach, x);
        CHECK(along >= 1.0 && along < 1.0 + 1e-12);
        if (ndim > 1) {
            const double across = hs_support_width(ndim, h, size, 2.0, reach, y);
            CHECK(across >= 0.25 && across < 0.25 + 1e-12);
        }
    }
    /* What is not moderate, the solution, the extent or the reach: as wide as a ball, and little more. */
    const double thin[] = {1.0, 0.0, 0x1p-210}, needle[] = {1.0, 0.0, 0x1p-150};
    const double round[] = {1.0, 0.0, 1.0};
    const struct {
        const double *h, *normal;
        double        extent, reach;
    } balls[] = {{thin, y, 0x1p-30, 0x1p180},
                 {round, x, 0x1p-300, 0x1p-300},
                 {round, x, 0x1p300, 0x1p300},
                 {needle, x, 0x1p100, 0x1p250}};
    for (size_t b = 0; b < sizeof balls / sizeof *balls; b++) {
        const double size = hs_support_size(2, balls[b].h), reach = balls[b].reach;
        const double width =
            hs_support_width(2, balls[b].h, size, balls[b].extent, reach, balls[b].normal);
        CHECK(width >= reach && width <= reach * (1.0 + 0x1p-47));
    }
    const double large[] = {0x1p600, 0.0, 0x1p602}, tiny[] = {0x1p-600, 0.0, 0x1p-598};
    CHECK(hs_support_width(2, large, hs_support_size(2, large), 1.0, 0x1p-600, y) >= 0x1p-600);
    CHECK(hs_support_width(2, tiny, hs_support_size(2, tiny), 1.0, 0x1p600, y) >= 0x1p600);
}

void
test_ellipsoid(void)
{
    RUN(definite_is_decided_exactly);
    RUN(reaches_are_bounds_and_not_far_off);
    RUN(reaches_of_round_supports_are_near);
    RUN(extremes_fit_or_are_refused);
    RUN(two_negative_eigenvalues_are_none_positive);
    RUN(sizes_are_bounds);
    RUN(ties_of_integers_are_ties);
    RUN(random_ones_are_decided_as_integers_say);
    RUN(extremes_are_decided_too);
    RUN(what_floats_do_not_hold_is_left_to_integers);
    RUN(the_size_of_D_is_that_of_its_components);
    RUN(bounds_hold_and_are_nearly_reached);
    RUN(rounded_formulas_are_fixed);
    RUN(widths_are_bounds_and_near);
    RUN(widths_of_any_dimension_and_size);
}
