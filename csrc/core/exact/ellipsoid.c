/* SPDX-License-Identifier: BSD-3-Clause */
#include "ellipsoid.h"
#include "arithmetic.h"

#include <math.h>
#include <stdlib.h>

/* ellipsoid.c: how far a support reaches, and whether a pair lies in the sum of two: in float64
 * with bounds, then exactly. */

/*
 * H reaches extent / e, e its smallest eigenvalue, and e >= x if H - x I is positive
 * definite. An x just below e is estimated, and what is left of H is confirmed to be: by
 * elimination in float64, with bounds on both sides of each step, or else by its leading minors
 * (Sylvester's criterion) as exact numbers.
 */

/* Bits that two float64 numbers may differ in when taken as integers if the larger one is to be
 * the smaller one times at most 1 + 2^-6. */
#define NEAR_BITS (UINT64_C(1) << 46)

/* Largest entries up to here, or from its inverse on, are not scaled: cubes of products of two are
 * neither too large nor too small. */
#define ORDINARY 0x1p100

/* H times a power of two, so that its largest entry is in [1, 2), or H if that is ordinary. */
typedef struct scaled_support {
    int    ndim, exponent; /* the entries times 2^exponent are those of H */
    double entries[HS_SUPPORT_ENTRIES];
    bool   is_exact;
} scaled_support;

static void
scale(int ndim, const double *entries, scaled_support *to)
{
    double largest = 0.0;
    for (int e = 0; e < hs_support_entries(ndim); e++) {
        largest = hs_larger(largest, fabs(entries[e]));
    }
    to->ndim = ndim;
    const bool is_ordinary = largest >= 1.0 / ORDINARY && largest <= ORDINARY;
    to->exponent = largest > 0.0 && !is_ordinary ? ilogb(largest) : 0;
    to->is_exact = true;
    for (int e = 0; e < hs_support_entries(ndim); e++) {
        to->entries[e] = to->exponent == 0 ? entries[e] : ldexp(entries[e], -to->exponent);
        to->is_exact = to->is_exact &&
                       (entries[e] == 0.0 || fabs(to->entries[e]) >= HS_SMALLEST_SCALED);
    }
}

/* ---- in float64 ---- */

/* Whether two rows are surely positive definite, for lower bounds of the diagonal and an upper one
 * of the size of what is beside it. */
static bool
is_pair_definite(double first, double second, double beside)
{
    return hs_multiply_down(first, second) > hs_multiply_up(beside, beside);
}

/* A number that is known between bounds >= 0. */
typedef struct size_range {
    double low, high;
} size_range;

/* |a b| / p. */
static size_range
quotient_of(double a, double b, size_range p)
{
    const double x = fabs(a), y = fabs(b);
    return (size_range){hs_next_down(hs_multiply_down(x, y) / p.high),
                        hs_next_up(hs_multiply_up(x, y) / p.low)};
}

/*
 * Three rows, by elimination of the one with the largest entry on the diagonal, p: what is left are
 * two rows with the entries h_kl - h_kp h_lp / h_pp, all between bounds. With a large p little is
 * lost, however small the other two eigenvalues are.
 */
static bool
is_triple_definite(const double *entries, const size_range *diagonal)
{
    int p = 0;
    for (int k = 1; k < 3; k++) {
        p = diagonal[k].low > diagonal[p].low ? k : p;
    }
    const int    k = (p + 1) % 3, l = (p + 2) % 3;
    const double kp = entries[hs_support_at(k, p)], lp = entries[hs_support_at(l, p)];
    const double beside = entries[hs_support_at(k, l)],
                 sign = (kp < 0.0) == (lp < 0.0) ? 1.0 : -1.0;
    const size_range pivot = diagonal[p];
    HS_ASSERT(pivot.low > 0.0); /* differences of what is not below HS_SMALLEST_SCALED */
    const size_range cross = quotient_of(kp, lp, pivot);
    const double     first = diagonal[k].low - quotient_of(kp, kp, pivot).high;
    const double     second = diagonal[l].low - quotient_of(lp, lp, pivot).high;
    const double one = fabs(beside - sign * cross.low), other = fabs(beside - sign * cross.high);
    return first > 0.0 && second > 0.0 &&
           is_pair_definite(hs_next_down(first), hs_next_down(second),
                            hs_next_up(hs_larger(one, other)));
}

/* Whether H - x I is surely positive definite. */
static bool
is_surely_definite(const scaled_support *h, double x)
{
    size_range diagonal[HS_SUPPORT_DIM];
    for (int k = 0; k < h->ndim; k++) {
        const double left = h->entries[hs_support_at(k, k)] - x;
        if (!(left > 0.0)) {
            return false;
        }
        diagonal[k] = (size_range){hs_next_down(left), hs_next_up(left)};
    }
    return h->ndim == 2 ? is_pair_definite(diagonal[0].low, diagonal[1].low, fabs(h->entries[1]))
                        : is_triple_definite(h->entries, diagonal);
}

/* About the entries of the cofactors of three rows, in float64; returns about the determinant. */
static double
support_cofactors(const double *h, double *c)
{
    c[hs_support_at(0, 0)] = h[2] * h[5] - h[4] * h[4];
    c[hs_support_at(1, 0)] = h[3] * h[4] - h[1] * h[5];
    c[hs_support_at(1, 1)] = h[0] * h[5] - h[3] * h[3];
    c[hs_support_at(2, 0)] = h[1] * h[4] - h[3] * h[2];
    c[hs_support_at(2, 1)] = h[1] * h[3] - h[0] * h[4];
    c[hs_support_at(2, 2)] = h[0] * h[2] - h[1] * h[1];
    return h[0] * c[0] + h[1] * c[1] + h[3] * c[3];
}

/* About the smallest eigenvalue of two rows: the determinant over the larger one. */
static double
estimate_two(const double *h)
{
    const double half = 0.5 * (h[0] - h[2]);
    const double larger = 0.5 * (h[0] + h[2]) + sqrt(half * half + h[1] * h[1]);
    return (h[0] * h[2] - h[1] * h[1]) / larger;
}

/*
 * About the smallest eigenvalue of three rows: the determinant over the largest one of the matrix
 * of cofactors, which follows from the roots of a cubic as cosines (O. K. Smith, Commun. ACM 4
 * (1961) 168).
 */
static double
estimate_three(const double *h)
{
    double       c[HS_SUPPORT_ENTRIES];
    const double determinant = support_cofactors(h, c);
    const double xx = c[0], yx = c[1], yy = c[2], zx = c[3], zy = c[4], zz = c[5];
    const double mean = (xx + yy + zz) / 3.0;
    const double x = xx - mean, y = yy - mean, z = zz - mean;
    const double aside = yx * yx + zx * zx + zy * zy;
    const double spread = sqrt((x * x + y * y + z * z + 2.0 * aside) / 6.0);
    if (!(spread > 0.0)) {
        return determinant / mean;
    }
    const double rest = x * (y * z - zy * zy) - yx * (yx * z - zy * zx) + zx * (yx * zy - y * zx);
    const double cosine = rest / (2.0 * spread * spread * spread);
    const double angle = acos(hs_larger(hs_smaller(cosine, 1.0), -1.0)) / 3.0;
    return determinant / (mean + 2.0 * spread * cos(angle));
}

/* A lower bound of the smallest eigenvalue near to it, or 0 if none was found. */
static double
find_bound(const scaled_support *h)
{
    static const double parts[] = {1.0 - 0x1p-40, 1.0 - 0x1p-22, 1.0 - 0x1p-7};
    const double        estimate = h->ndim == 1   ? h->entries[0]
                                   : h->ndim == 2 ? estimate_two(h->entries)
                                                  : estimate_three(h->entries);
    if (h->ndim == 1) {
        return estimate;
    }
    for (int p = 0; h->is_exact && estimate > 0.0 && p < 3; p++) {
        if (is_surely_definite(h, estimate * parts[p])) {
            return estimate * parts[p];
        }
    }
    return 0.0;
}

/* ---- exactly ---- */

/* What exact minors are made of. */
typedef struct exact_rows {
    hs_dyadic entries[HS_SUPPORT_ENTRIES]; /* of H - x I */
    hs_dyadic minor, product, sum;
} exact_rows;

/* minor = [0][0] [1][1] - [1][0]^2 */
static int
sign_of_two(exact_rows *rows)
{
    hs_dyadic *h = rows->entries;
    hs_dyadic_multiply(&h[0], &h[2], &rows->product);
    hs_dyadic_multiply(&h[1], &h[1], &rows->sum);
    hs_dyadic_add(&rows->product, &rows->sum, true, &rows->minor);
    return hs_dyadic_sign(&rows->minor);
}

/* Adds a (b c - d e) to what `sum` holds. */
static void
add_cofactor(exact_rows *rows, int a, int b, int c, int d, int e, hs_dyadic *sum)
{
    hs_dyadic  one, other;
    hs_dyadic *h = rows->entries;
    hs_dyadic_multiply(&h[b], &h[c], &one);
    hs_dyadic_multiply(&h[d], &h[e], &other);
    hs_dyadic_add(&one, &other, true, &rows->product);
    hs_dyadic_multiply(&h[a], &rows->product, &one);
    hs_dyadic_add_to(sum, &one);
}

static int
sign_of_three(exact_rows *rows)
{
    hs_dyadic_set(0.0, 0, &rows->sum);
    add_cofactor(rows, 0, 2, 5, 4, 4, &rows->sum);
    add_cofactor(rows, 1, 3, 4, 1, 5, &rows->sum);
    add_cofactor(rows, 3, 1, 4, 3, 2, &rows->sum);
    return hs_dyadic_sign(&rows->sum);
}

/* Whether H - x 2^exponent I is positive definite, for x below the first entry; of two or three
 * rows. */
static bool
is_definite(int ndim, const double *entries, double x, int exponent)
{
    exact_rows rows;
    hs_dyadic_set(x, exponent, &rows.product);
    for (int k = 0; k < ndim; k++) {
        for (int l = 0; l < k; l++) {
            hs_dyadic_set(entries[hs_support_at(k, l)], 0, &rows.entries[hs_support_at(k, l)]);
        }
        hs_dyadic_set(entries[hs_support_at(k, k)], 0, &rows.sum);
        hs_dyadic_add(&rows.sum, &rows.product, true, &rows.entries[hs_support_at(k, k)]);
    }
    HS_ASSERT(ndim > 1 && hs_dyadic_sign(&rows.entries[0]) > 0);
    return sign_of_two(&rows) > 0 && (ndim < 3 || sign_of_three(&rows) > 0);
}

/* The bound for a matrix that is positive definite, by halving the range of floats that it is in;
 * 0 if it is below all of them. */
static double
search_bound(const double *entries, const scaled_support *h)
{
    double least = h->entries[0];
    for (int k = 1; k < h->ndim; k++) {
        least = hs_smaller(least, h->entries[hs_support_at(k, k)]);
    }
    uint64_t low = 0, high = hs_bits_of_double(least);
    while (high - low > (low > 0 ? NEAR_BITS : 1)) {
        const uint64_t middle = low + (high - low) / 2;
        if (is_definite(h->ndim, entries, hs_double_of_bits(middle), h->exponent)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return hs_double_of_bits(low);
}

/* ---- both ---- */

hs_support_state
hs_support_reach(int ndim, const double *entries, double extent, double *reach)
{
    scaled_support h;
    *reach = 0.0;
    scale(ndim, entries, &h);
    for (int k = 0; k < ndim; k++) {
        if (!(entries[hs_support_at(k, k)] > 0.0)) {
            return HS_SUPPORT_NOT_DEFINITE;
        }
    }
    double bound = find_bound(&h);
    if (!(bound > 0.0)) {
        if (!is_definite(ndim, entries, 0.0, 0)) {
            return HS_SUPPORT_NOT_DEFINITE;
        }
        bound = search_bound(entries, &h);
    }
    if (!(bound > 0.0)) {
        return HS_SUPPORT_TOO_LONG;
    }
    if (extent == 0.0) {
        return HS_SUPPORT_FITS;
    }
    int          of_extent, of_bound;
    const double quotient = hs_next_up(frexp(extent, &of_extent) / frexp(bound, &of_bound));
    const int    power = of_extent - of_bound - h.exponent;
    *reach = power > 1100 ? HUGE_VAL : hs_next_up(ldexp(quotient, power));
    return *reach <= HS_LONGEST_SUPPORT ? HS_SUPPORT_FITS : HS_SUPPORT_TOO_LONG;
}

double
hs_support_size(int ndim, const double *entries)
{
    scaled_support h;
    double         sum = 0.0;
    scale(ndim, entries, &h);
    for (int k = 0; k < ndim; k++) {
        for (int l = 0; l < ndim; l++) {
            const double entry = h.entries[hs_support_at(k, l)];
            sum = hs_next_up(sum + hs_multiply_up(entry, entry));
        }
    }
    const double root = hs_next_up(sqrt(sum));
    return h.exponent == 0 ? root : hs_next_up(ldexp(root, h.exponent));
}

/* A bound that holds for any solution, and is near for one that is about right. */

/* Numbers of these sizes neither overflow nor underflow where they are multiplied here. */
static bool
is_moderate(double x)
{
    return x >= 0x1p-200 && x <= 0x1p200;
}

/* About the solution of H y = normal, by cofactors. */
static void
solve(int ndim, const double *h, const double *normal, double *y)
{
    if (ndim == 1) {
        y[0] = normal[0] / h[0];
        return;
    }
    if (ndim == 2) {
        const double determinant = h[0] * h[2] - h[1] * h[1];
        y[0] = (h[2] * normal[0] - h[1] * normal[1]) / determinant;
        y[1] = (h[0] * normal[1] - h[1] * normal[0]) / determinant;
        return;
    }
    double       c[HS_SUPPORT_ENTRIES];
    const double determinant = support_cofactors(h, c);
    y[0] = (c[0] * normal[0] + c[1] * normal[1] + c[3] * normal[2]) / determinant;
    y[1] = (c[1] * normal[0] + c[2] * normal[1] + c[4] * normal[2]) / determinant;
    y[2] = (c[3] * normal[0] + c[4] * normal[1] + c[5] * normal[2]) / determinant;
}

/* Not below the length of normal - H y: in double-words, with all that they lose. */
static double
residual(int ndim, const double *h, const double *normal, const double *y)
{
    double sum = 0.0;
    for (int k = 0; k < ndim; k++) {
        hs_dw  left = {normal[k], 0.0};
        double lost = 0.0;
        for (int l = 0; l < ndim; l++) {
            const hs_dw term = hs_two_product(-h[hs_support_at(k, l)], y[l]);
            left = hs_dw_add_watched(left, term, &lost);
        }
        sum += fabs(left.hi) + fabs(left.lo) + lost;
    }
    return sum;
}

/*
 * normal . D = (H^-1 normal) . (H D), which is at most |H^-1 normal| times the extent. With any y,
 * H^-1 normal = y + H^-1 (normal - H y), and the extent times H^-1 makes no vector longer than by
 * the reach. Rounding changes neither product by more than 2^-48 of it; what underflows in the
 * residual is below 2^-1000.
 */
double
hs_support_width(int ndim, const double *entries, double size, double extent, double reach,
                 const double *normal)
{
    double y[HS_SUPPORT_DIM], length = 0.0, square = 0.0;
    for (int k = 0; k < ndim; k++) {
        square += normal[k] * normal[k];
    }
    const double ball = reach * sqrt(square) * (1.0 + 0x1p-48);
    solve(ndim, entries, normal, y);
    for (int k = 0; k < ndim; k++) {
        length += y[k] * y[k];
    }
    length = sqrt(length);
    if (!is_moderate(size) || !is_moderate(length) || !is_moderate(extent) || !is_moderate(reach)) {
        return ball;
    }
    const double rest = residual(ndim, entries, normal, y) + 0x1p-1000;
    return hs_smaller((extent * length + reach * rest) * (1.0 + 0x1p-48), ball);
}

/* Supports are brought to the unit of D by a power of two, so that the extent is the number that
 * was given. */

/* Powers of two that supports are multiplied by in floats. */
#define MOST_SCALED 900

void
hs_support_metric_init(int ndim, double extent, bool inclusive, int exponent,
                       hs_support_metric *metric)
{
    hs_metric_init(&metric->limit, ndim, 0, NULL, extent, inclusive);
    metric->exponent = exponent;
    metric->unscale = abs(exponent) <= MOST_SCALED ? ldexp(1.0, -exponent) : 0.0;
}

void
hs_support_span_of(const hs_metric *metric, const hs_span *span, hs_support_span *of)
{
    of->usable = hs_difference_watched(&of->difference, metric, span->p, span->q, span->shift);
    of->size = 0.0;
    for (int k = 0; of->usable && k < metric->ndim; k++) {
        of->size += fabs(of->difference.component[k].hi);
    }
}

/* The entries in the unit of D. False where digits were lost. */
HS_ALWAYS_INLINE bool
scale_entries(const hs_support_metric *metric, const double *entries, double *to)
{
    bool is_exact = true;
    for (int e = 0; e < hs_support_entries(metric->limit.ndim); e++) {
        to[e] = entries[e] * metric->unscale;
        is_exact = is_exact && (entries[e] == 0.0 || fabs(to[e]) >= HS_SMALLEST_SCALED);
    }
    return is_exact;
}

HS_ALWAYS_INLINE hs_verdict
decide_span(const hs_support_metric *metric, const double *h, double size,
            const hs_support_span *of, const int ndim, hs_stages *stages)
{
    double       z[HS_SUPPORT_DIM];
    const double error = hs_support_product(h, size, of, ndim, z);
    double       square = z[0] * z[0];
    for (int k = 1; k < ndim; k++) {
        square += z[k] * z[k];
    }
    hs_verdict verdict = hs_float64_verdict(&metric->limit, square, error);
    if (verdict != HS_UNDECIDED) {
        stages->by_float64++;
        return verdict;
    }
    hs_difference wide;
    hs_support_wide_product(h, size, of, ndim, &wide);
    verdict = hs_double_word_verdict(&metric->limit, &wide, ndim);
    stages->by_double_word += verdict != HS_UNDECIDED;
    return verdict;
}

hs_verdict
hs_support_decide_double(const hs_support_metric *metric, const double *entries, double size,
                         const hs_support_span *of, hs_stages *stages)
{
    const int    ndim = metric->limit.ndim;
    const double scaled = size * metric->unscale;
    double       h[HS_SUPPORT_ENTRIES];
    if (!of->usable || !metric->limit.floats_usable || !hs_is_safe(scaled * of->size) ||
        !scale_entries(metric, entries, h)) {
        return HS_UNDECIDED;
    }
    switch (ndim) {
    case 1: return decide_span(metric, h, scaled, of, 1, stages);
    case 2: return decide_span(metric, h, scaled, of, 2, stages);
    default: return decide_span(metric, h, scaled, of, 3, stages);
    }
}

/* D, exactly, component by component. */
static void
find_difference(const hs_metric *measure, const hs_span *span, hs_dyadic *d)
{
    hs_dyadic one, other, product;
    for (int k = 0; k < measure->ndim; k++) {
        hs_dyadic_set(span->q[k], 0, &one);
        hs_dyadic_set(span->p[k], 0, &other);
        hs_dyadic_add(&one, &other, true, &d[k]);
        for (int l = 0; span->shift != NULL && l < measure->n_rows; l++) {
            hs_dyadic_set_integer(span->shift[l], &one);
            hs_dyadic_set(measure->rows[l][k], 0, &other);
            hs_dyadic_multiply(&one, &other, &product);
            hs_dyadic_add_to(&d[k], &product);
        }
    }
}

int
hs_support_compare(const hs_support_metric *metric, const double *entries, const hs_metric *measure,
                   const hs_span *span)
{
    hs_dyadic d[HS_SUPPORT_DIM], entry, term, z, square;
    find_difference(measure, span, d);
    hs_dyadic_set(0.0, 0, &square);
    for (int k = 0; k < measure->ndim; k++) {
        hs_dyadic_set(0.0, 0, &z);
        for (int l = 0; l < measure->ndim; l++) {
            hs_dyadic_set(entries[hs_support_at(k, l)], 0, &entry);
            hs_dyadic_multiply(&entry, &d[l], &term);
            hs_dyadic_add_to(&z, &term);
        }
        hs_dyadic_multiply(&z, &z, &term);
        hs_dyadic_add_to(&square, &term);
    }
    hs_dyadic_set(metric->limit.cutoff, metric->exponent, &entry);
    hs_dyadic_multiply(&entry, &entry, &term);
    return hs_dyadic_compare_sizes(&square, &term);
}

/* x, or what float32 makes of it. */
HS_ALWAYS_INLINE double
as_real(double x, const bool is_single)
{
    return is_single ? (double)(float)x : x;
}

/* Sums and products of two float32 numbers in float64, rounded to float32, are those of float32: 53
 * bits are more than twice 24 and two. */
HS_ALWAYS_INLINE bool
compare_rounded(const hs_support_metric *metric, const double *entries, const double *d,
                const bool is_single)
{
    const int    ndim = metric->limit.ndim;
    const double extent = as_real(metric->limit.cutoff, is_single);
    const double limit = as_real(extent * extent, is_single);
    double       square = 0.0;
    for (int k = 0; k < ndim; k++) {
        double z = 0.0;
        for (int l = 0; l < ndim; l++) {
            const double scaled = ldexp(entries[hs_support_at(k, l)], -metric->exponent);
            const double entry = as_real(scaled, is_single);
            z = as_real(z + as_real(entry * as_real(d[l], is_single), is_single), is_single);
        }
        square = as_real(square + as_real(z * z, is_single), is_single);
    }
    return metric->limit.inclusive ? square <= limit : square < limit;
}

bool
hs_support_within_rounded(const hs_support_metric *metric, const double *entries,
                          const hs_metric *measure, const hs_span *span, bool is_single)
{
    double d[HS_SUPPORT_DIM];
    for (int k = 0; k < measure->ndim; k++) {
        d[k] = hs_rounded_component(measure, span, k);
    }
    return is_single ? compare_rounded(metric, entries, d, true)
                     : compare_rounded(metric, entries, d, false);
}
