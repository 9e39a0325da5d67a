/* SPDX-License-Identifier: BSD-3-Clause */
#include "metric.h"

#include <string.h>
#include <math.h>

/* metric.c: decides on pairs and measures them: in float64, in double words, and in integers of a
 * fixed, sufficient size where these cannot tell. */

/*
 * Limbs of 64 bits that hold any component of D. In units of the smallest subnormal, 2^-1074, a
 * float64 has at most 2098 bits and a multiple of one by an int64 at most 2161; eight of those and
 * the two points sum to less than 2^2165. Two bits are for the sign and for the sum of 8 squares.
 */
#define MAX_LIMBS 34

/* One axis has two points and up to eight rows. */
#define MAX_TERMS (2 + HS_MAX_DIM)

/* A float64 times an integer: +-(high * 2^64 + low) * 2^exponent. */
typedef struct exact_term {
    uint64_t low, high;
    int      exponent;
    bool     negative;
} exact_term;

/* What is added up along each axis, zeros left out, and what unit and width hold all of it. */
typedef struct exact_sums {
    exact_term terms[HS_MAX_DIM][MAX_TERMS];
    int        n_axes;
    int        n_terms[HS_MAX_DIM];
    int        most_terms; /* of any axis */
    int        lowest;     /* everything is a multiple of 2^lowest */
    int        highest;    /* and every term is below 2^highest */
} exact_sums;

/* A nonzero finite double as an odd significand with sign and exponent. */
HS_ALWAYS_INLINE exact_term
decompose(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    const int      field = (int)(bits >> 52) & 0x7ff;
    const uint64_t fraction = bits & ((UINT64_C(1) << 52) - 1);
    const uint64_t significand = fraction | (uint64_t)(field != 0) << 52;
    const int      zeros = hs_trailing_zeros(significand);
    return (exact_term){.low = significand >> zeros,
                        .high = 0,
                        .exponent = field + (field == 0) - 1075 + zeros,
                        .negative = bits >> 63};
}

/* Sets a term to x * times, which is not zero, and widens the range to hold it. */
HS_ALWAYS_INLINE void
set_term(exact_term *term, double x, int64_t times, exact_sums *sums)
{
    *term = decompose(x);
    term->negative = term->negative != (times < 0);
    if (times != 1 && times != -1) {
        const uint64_t size = times < 0 ? ~(uint64_t)times + 1 : (uint64_t)times;
        term->low = hs_multiply_add(term->low, size, 0, &term->high);
    }
    const int bits = term->high != 0 ? 64 + hs_bit_length(term->high) : hs_bit_length(term->low);
    const int top = term->exponent + bits;
    sums->lowest = term->exponent < sums->lowest ? term->exponent : sums->lowest;
    sums->highest = top > sums->highest ? top : sums->highest;
}

/* q - p + shift * rows along each axis; shift NULL: q - p. */
HS_ALWAYS_INLINE void
set_sums(exact_sums *sums, const hs_metric *metric, const hs_span *span)
{
    const double  *p = span->p, *q = span->q;
    const int64_t *shift = span->shift;
    sums->lowest = INT32_MAX;
    sums->highest = INT32_MIN;
    sums->most_terms = 1;
    sums->n_axes = metric->ndim;
    for (int k = 0; k < metric->ndim; k++) {
        exact_term *next = sums->terms[k];
        if (q[k] != 0.0) {
            set_term(next++, q[k], 1, sums);
        }
        if (p[k] != 0.0) {
            set_term(next++, p[k], -1, sums);
        }
        for (int l = 0; shift != NULL && l < metric->n_rows; l++) {
            if (shift[l] != 0 && metric->rows[l][k] != 0.0) {
                set_term(next++, metric->rows[l][k], shift[l], sums);
            }
        }
        const int n_terms = (int)(next - sums->terms[k]);
        sums->n_terms[k] = n_terms;
        sums->most_terms = n_terms > sums->most_terms ? n_terms : sums->most_terms;
    }
}

/* A limit, the sum of both words, as a vector of one component. */
HS_ALWAYS_INLINE void
set_limit(exact_sums *sums, hs_dw limit)
{
    const double low = -limit.lo;
    hs_metric    axis;
    axis.ndim = 1;
    set_sums(sums, &axis, &(hs_span){&low, &limit.hi, NULL});
}

/* Limbs for a component, and twice as many for the square; 0 when every input is zero. */
static int
count_limbs(const exact_sums *sums)
{
    if (sums->lowest > sums->highest) {
        return 0;
    }
    const int bits = sums->highest - sums->lowest + hs_bit_length((uint64_t)sums->most_terms - 1);
    const int n = (bits + 2 + 63) / 64;
    HS_ASSERT(n >= 1 && n <= MAX_LIMBS);
    return n;
}

/* difference += term, n limbs in two's complement. */
HS_ALWAYS_INLINE void
add_term(uint64_t *difference, const exact_term *term, int lowest, int n)
{
    const int      distance = term->exponent - lowest;
    const int      first = distance / 64, bits = distance % 64;
    const uint64_t sign = term->negative ? UINT64_MAX : 0;
    uint64_t       carry = term->negative; /* -x is ~x + 1 */
    const uint64_t limb[3] = {
        term->low << bits,
        term->high << bits | (bits ? term->low >> (64 - bits) : 0),
        bits ? term->high >> (64 - bits) : 0,
    };
    for (int i = 0; i < n; i++) {
        const int      place = i - first;
        const uint64_t value = place >= 0 && place < 3 ? limb[place] : 0;
        difference[i] = hs_add_carry(difference[i], value ^ sign, &carry);
    }
}

/* |component k of D| in n limbs; returns whether it was negative. */
HS_ALWAYS_INLINE bool
sum_terms(uint64_t *difference, const exact_sums *sums, int k, int n)
{
    for (int i = 0; i < n; i++) {
        difference[i] = 0;
    }
    for (int t = 0; t < sums->n_terms[k]; t++) {
        add_term(difference, &sums->terms[k][t], sums->lowest, n);
    }

    const bool     negative = difference[n - 1] >> 63;
    const uint64_t sign = negative ? UINT64_MAX : 0;
    uint64_t       carry = negative;
    for (int i = 0; i < n; i++) {
        difference[i] = hs_add_carry(difference[i] ^ sign, 0, &carry);
    }
    return negative;
}

/* total += value^2; n and 2 n limbs. */
HS_ALWAYS_INLINE void
add_square(uint64_t *total, const uint64_t *value, int n)
{
    for (int i = 0; i < n; i++) {
        uint64_t carry = 0;
        if (value[i] == 0) {
            continue;
        }
        for (int j = 0; j < n; j++) {
            total[i + j] = hs_multiply_add(value[i], value[j], total[i + j], &carry);
        }
        for (int j = i + n; j < 2 * n && carry != 0; j++) {
            total[j] += carry;
            carry = total[j] < carry;
        }
    }
}

/* Sign of a - b. */
HS_ALWAYS_INLINE int
compare_limbs(const uint64_t *a, const uint64_t *b, int n)
{
    for (int i = n - 1; i >= 0; i--) {
        if (a[i] != b[i]) {
            return a[i] < b[i] ? -1 : 1;
        }
    }
    return 0;
}

/* The square in 2 n limbs; value has n. */
HS_ALWAYS_INLINE void
square_sums(const exact_sums *sums, int n, uint64_t *total, uint64_t *value)
{
    for (int i = 0; i < 2 * n; i++) {
        total[i] = 0;
    }
    for (int k = 0; k < sums->n_axes; k++) {
        sum_terms(value, sums, k, n);
        add_square(total, value, n);
    }
}

static HS_NO_INLINE int
compare_large(const exact_sums *one, const exact_sums *other, int n)
{
    uint64_t first[2 * MAX_LIMBS], second[2 * MAX_LIMBS], value[MAX_LIMBS];
    square_sums(one, n, first, value);
    square_sums(other, n, second, value);
    return compare_limbs(first, second, 2 * n);
}

/* Gives both sums one unit and one width. */
static void
join_units(exact_sums *one, exact_sums *other)
{
    const int lowest = one->lowest < other->lowest ? one->lowest : other->lowest;
    const int highest = one->highest > other->highest ? one->highest : other->highest;
    const int terms = one->most_terms > other->most_terms ? one->most_terms : other->most_terms;
    one->lowest = other->lowest = lowest;
    one->highest = other->highest = highest;
    one->most_terms = other->most_terms = terms;
}

/* Sign of the difference of both squares. Up to 126 bits the compiler can unroll every loop over
 * limbs. */
static int
compare_sums(exact_sums *one, exact_sums *other)
{
    uint64_t first[4], second[4], value[2];
    join_units(one, other);
    const int n = count_limbs(one);
    if (n == 0) {
        return 0;
    }
    if (n > 2) {
        return compare_large(one, other, n);
    }
    square_sums(one, 2, first, value);
    square_sums(other, 2, second, value);
    return compare_limbs(first, second, 4);
}

int
hs_integer_compare(const hs_metric *metric, hs_dw limit, const double *p, const double *q,
                   const int64_t *shift)
{
    exact_sums sums, of_limit;
    set_sums(&sums, metric, &(hs_span){p, q, shift});
    set_limit(&of_limit, limit);
    return compare_sums(&sums, &of_limit);
}

int
hs_integer_compare_two(const hs_metric *metric, const hs_span *one, const hs_span *other)
{
    exact_sums a, b;
    set_sums(&a, metric, one);
    set_sums(&b, metric, other);
    return compare_sums(&a, &b);
}

/* The limbs top, top - 1 and top - 2 as a double-word, in units of the lowest of them. */
static hs_dw
gather_limbs(const uint64_t *value, int top)
{
    hs_dw  sum = {0.0, 0.0};
    double unit = 0x1p160; /* of the upper half of the highest limb */
    for (int i = top; i > top - 3; i--) {
        const uint64_t limb = i >= 0 ? value[i] : 0;
        sum = hs_dw_add(sum, (hs_dw){(double)(limb >> 32) * unit, 0.0});
        sum = hs_dw_add(sum, (hs_dw){(double)(limb & UINT32_MAX) * (unit * 0x1p-32), 0.0});
        unit *= 0x1p-64;
    }
    return sum;
}

void
hs_integer_difference(const hs_metric *metric, const double *p, const double *q,
                      const int64_t *shift, hs_dw *value, int *exponent)
{
    exact_sums sums, limit;
    uint64_t   component[HS_MAX_DIM][MAX_LIMBS];
    bool       negative[HS_MAX_DIM];
    int        top = -1; /* highest limb in use */
    set_sums(&sums, metric, &(hs_span){p, q, shift});
    set_limit(&limit, (hs_dw){metric->cutoff, 0.0});
    join_units(&sums, &limit);
    const int n = count_limbs(&sums);
    for (int k = 0; k < metric->ndim; k++) {
        value[k] = (hs_dw){0.0, 0.0};
        negative[k] = n > 0 && sum_terms(component[k], &sums, k, n);
        for (int i = top + 1; i < n; i++) {
            if (component[k][i] != 0) {
                top = i;
            }
        }
    }
    *exponent = 0;
    if (top < 0) {
        return;
    }
    *exponent = sums.lowest + 64 * (top - 2);
    for (int k = 0; k < metric->ndim; k++) {
        value[k] = gather_limbs(component[k], top);
        if (negative[k]) {
            value[k] = (hs_dw){-value[k].hi, -value[k].lo};
        }
    }
}

/* Whether a pair is within the cutoff, by the cheapest stage that can tell. */

void
hs_metric_init(hs_metric *metric, int ndim, int n_rows, const double rows[][HS_MAX_DIM],
               double cutoff, bool inclusive)
{
    HS_ASSERT(ndim >= 1 && ndim <= HS_MAX_DIM && n_rows >= 0 && n_rows <= HS_MAX_DIM);
    HS_ASSERT(cutoff >= 0.0);
    metric->ndim = ndim;
    metric->n_rows = n_rows;
    metric->inclusive = inclusive;
    metric->cutoff = cutoff;
    metric->floats_usable = hs_is_safe(cutoff);
    for (int l = 0; l < n_rows; l++) {
        for (int k = 0; k < ndim; k++) {
            metric->rows[l][k] = rows[l][k];
            if (rows[l][k] != 0.0 && !hs_is_safe(fabs(rows[l][k]))) {
                metric->floats_usable = false;
            }
        }
    }
    metric->square_hi = metric->square_lo = metric->sure_in = metric->sure_out = 0.0;
    if (!metric->floats_usable) {
        return;
    }

    const hs_dw  square = hs_two_square(cutoff);
    const double roundings = HS_FLOAT64_ROUNDINGS + HS_FLOAT64_ROUNDINGS_PER_AXIS * ndim;
    const hs_dw  width = hs_two_product(roundings * HS_FLOAT64_UNIT, square.hi);
    const hs_dw  in = hs_dw_add(square, (hs_dw){-width.hi, -width.lo});
    const hs_dw  out = hs_dw_add(square, width);
    metric->square_hi = square.hi;
    metric->square_lo = square.lo;
    /* The double itself, or the next one on the safe side. */
    metric->sure_in = in.lo < 0.0 ? hs_next_down(in.hi) : in.hi;
    metric->sure_out = out.lo > 0.0 ? hs_next_up(out.hi) : out.hi;
}

/* The float stages, for a constant ndim where the compiler can be given one. */
HS_ALWAYS_INLINE hs_verdict
decide_in_floats(const hs_metric *metric, const double *p, const double *q, const int64_t *shift,
                 int ndim, hs_stages *stages)
{
    hs_difference difference;
    hs_verdict    verdict;
    if (shift == NULL) {
        hs_difference_plain(&difference, p, q, ndim);
    } else if (!hs_difference_shifted(&difference, metric, p, q, shift, ndim, false)) {
        return HS_UNDECIDED;
    }

    const double square = hs_float64_square(&difference, ndim);
    verdict = hs_float64_verdict(metric, square, difference.error);
    if (verdict != HS_UNDECIDED) {
        stages->by_float64++;
        return verdict;
    }
    if (shift != NULL) {
        (void)hs_difference_shifted(&difference, metric, p, q, shift, ndim, true);
    }
    verdict = hs_double_word_verdict(metric, &difference, ndim);
    stages->by_double_word += verdict != HS_UNDECIDED;
    return verdict;
}

bool
hs_metric_within(const hs_metric *metric, const double *p, const double *q, const int64_t *shift,
                 hs_stages *stages)
{
    if (!hs_is_shifted(metric, shift)) {
        shift = NULL;
    }
    if (metric->floats_usable) {
        hs_verdict verdict;
        switch (metric->ndim) {
        case 2: verdict = decide_in_floats(metric, p, q, shift, 2, stages); break;
        case 3: verdict = decide_in_floats(metric, p, q, shift, 3, stages); break;
        default: verdict = decide_in_floats(metric, p, q, shift, metric->ndim, stages);
        }
        if (verdict != HS_UNDECIDED) {
            return verdict == HS_WITHIN;
        }
    }
    return hs_metric_decide_by_integers(metric, p, q, shift, stages);
}

bool
hs_metric_decide_by_integers(const hs_metric *metric, const double *p, const double *q,
                             const int64_t *shift, hs_stages *stages)
{
    hs_difference difference; /* long integers take ten times as long */
    if (metric->floats_usable && hs_difference_watched(&difference, metric, p, q, shift)) {
        const hs_verdict verdict = hs_hair_verdict(metric, &difference, metric->ndim);
        if (verdict != HS_UNDECIDED) {
            stages->by_double_word++;
            return verdict == HS_WITHIN;
        }
    }
    stages->by_integers++;
    const int sign = hs_integer_compare(metric, (hs_dw){metric->cutoff, 0.0}, p, q, shift);
    return sign < 0 || (sign == 0 && metric->inclusive);
}

bool
hs_metric_within_double(const hs_metric *metric, const double *p, const double *q,
                        const int64_t *shift)
{
    const double limit = metric->cutoff * metric->cutoff;
    double       square = 0.0;
    for (int k = 0; k < metric->ndim; k++) {
        const double difference = hs_rounded_component(metric, &(hs_span){p, q, shift}, k);
        square += difference * difference;
    }
    return metric->inclusive ? square <= limit : square < limit;
}

/* Double-words first, then integers. docs/exactness.md derives the bounds. */

/* Squares in this range are far from overflow, and what their terms lose to underflow, 2^-1074
 * each, is nothing beside 2^-106 of them. */
#define LEAST_SQUARE 0x1p-800
#define MOST_SQUARE  0x1p800

/* How far hs_float64_square may be from |D|^2. */
static double
float64_error(double square, double error, int ndim)
{
    const double roundings = HS_FLOAT64_ROUNDINGS + HS_FLOAT64_ROUNDINGS_PER_AXIS * ndim;
    const double rounding = roundings * HS_FLOAT64_UNIT * square;
    return error > 0.0 ? rounding + 2.001 * error * (sqrt(square) + error) : rounding;
}

static int
sign_of(double x)
{
    return (x > 0.0) - (x < 0.0);
}

/* Compares both differences by their double-word squares; false when these cannot tell. */
static bool
compare_double_words(const hs_difference *one, const hs_difference *other, int ndim, int *sign)
{
    bool         one_exact, other_exact;
    const hs_dw  a = hs_double_word_square_watched(one, ndim, &one_exact);
    const hs_dw  b = hs_double_word_square_watched(other, ndim, &other_exact);
    const hs_dw  excess = hs_dw_add(a, (hs_dw){-b.hi, -b.lo});
    const double bound = hs_double_word_error(a.hi, one->error, ndim) +
                         hs_double_word_error(b.hi, other->error, ndim);
    *sign = sign_of(excess.hi);
    return fabs(excess.hi) > bound || (one_exact && other_exact);
}

int
hs_metric_compare(const hs_metric *metric, const hs_span *one, const hs_span *other,
                  hs_stages *stages)
{
    const int     ndim = metric->ndim;
    hs_difference a, b;
    int           sign;
    if (hs_difference_watched(&a, metric, one->p, one->q, one->shift) &&
        hs_difference_watched(&b, metric, other->p, other->q, other->shift)) {
        const double first = hs_float64_square(&a, ndim), second = hs_float64_square(&b, ndim);
        if (hs_smaller(first, second) >= LEAST_SQUARE && hs_larger(first, second) <= MOST_SQUARE) {
            if (fabs(first - second) >
                float64_error(first, a.error, ndim) + float64_error(second, b.error, ndim)) {
                stages->by_float64++;
                return sign_of(first - second);
            }
            if (compare_double_words(&a, &b, ndim, &sign)) {
                stages->by_double_word++;
                return sign;
            }
        }
    }
    stages->by_integers++;
    return hs_integer_compare_two(metric, one, other);
}

/* The distance and the vector of a pair, to the last place. */

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

/* A sum that is no float64 lies between two neighbouring ones, and so does nearly no distance. */

void
hs_metric_set_cutoff(double cutoff, hs_metric *metric)
{
    hs_metric_init(metric, metric->ndim, metric->n_rows, (const double(*)[HS_MAX_DIM])metric->rows,
                   cutoff, metric->inclusive);
}

bool
hs_metric_within_sum(const hs_metric *metric, hs_dw limit, const double *p, const double *q,
                     const int64_t *shift, hs_stages *stages)
{
    hs_metric side = *metric;
    HS_ASSERT(limit.hi >= 0.0 && limit.hi + limit.lo == limit.hi);
    if (limit.lo == 0.0) {
        hs_metric_set_cutoff(limit.hi, &side);
        return hs_metric_within(&side, p, q, shift, stages);
    }
    hs_stages unused = {0, 0, 0}, first = *stages; /* a pair counts once */
    side.inclusive = true;
    hs_metric_set_cutoff(limit.lo < 0.0 ? hs_next_down(limit.hi) : limit.hi, &side);
    if (hs_metric_within(&side, p, q, shift, &first)) {
        *stages = first;
        return true;
    }
    side.inclusive = false;
    hs_metric_set_cutoff(limit.lo < 0.0 ? limit.hi : hs_next_up(limit.hi), &side);
    if (!hs_metric_within(&side, p, q, shift, &unused)) {
        *stages = first;
        return false;
    }
    stages->by_integers++;
    const int sign = hs_integer_compare(metric, limit, p, q, shift);
    return sign < 0 || (sign == 0 && metric->inclusive);
}

/*
 * The signs of (x - p).(q - p) and (x - q).(p - q), neither of which is negative if the foot lies
 * between p and q: by float64 with an error bound, and else by integers.
 */

/*
 * A component of x - p, images included, has a rounded difference and n <= 6 rounded products, none
 * of which underflows, for whole numbers multiply, and n sums. With A the sum of the sizes of these
 * as it is computed and v = 2^-53, its error is less than (n + 2) v A (1 + 2 (n + 2) v); so is that
 * of q - p with its B, and that of the product less than (2 n + 6) v A B. With the sum of d <= 8
 * terms that is 27 v m, where m is the computed sum of all A B. Products that underflow change it
 * by less than 2^-1071, which is below v m where m is at least 2^-1000.
 */
#define FOOT_ERROR   (30.0 * 0x1p-53)
#define LEAST_SIZE   0x1p-1000
#define LARGEST_SIZE 0x1p1020

/* Sign of (x - p).(q - p) by integers: four times that product is |x + q - 2 p|^2 - |x - q|^2. The
 * first vector is x - p + q - p: q and p are taken for box vectors, with the shift (1, -1), beside
 * those of the images of x and q. */
static HS_NO_INLINE int
sign_by_integers(const hs_metric *images, const double *x, const int64_t *of_x, const double *p,
                 const double *q, const int64_t *of_q)
{
    int64_t   sum[HS_MAX_DIM] = {1, -1}, difference[HS_MAX_DIM] = {0};
    hs_metric metric = {.ndim = images->ndim, .n_rows = 2 + images->n_rows};
    for (int k = 0; k < images->ndim; k++) {
        metric.rows[0][k] = q[k];
        metric.rows[1][k] = p[k];
    }
    for (int l = 0; l < images->n_rows; l++) {
        memcpy(metric.rows[2 + l], images->rows[l], sizeof metric.rows[l]);
        sum[2 + l] = of_x[l] + of_q[l];
        difference[2 + l] = of_x[l] - of_q[l];
    }
    return hs_integer_compare_two(&metric, &(hs_span){p, x, sum}, &(hs_span){q, x, difference});
}

/* Component k of q - p + shift * rows; *size: the sum of the sizes of its terms. */
HS_ALWAYS_INLINE double
component_of(const hs_metric *images, const double *p, const double *q, const int64_t *shift, int k,
             double *size)
{
    double value = q[k] - p[k];
    *size = fabs(value);
    for (int l = 0; l < images->n_rows; l++) {
        const double term = (double)shift[l] * images->rows[l][k];
        value += term;
        *size += fabs(term);
    }
    return value;
}

static bool
is_forward(const hs_metric *images, const double *x, const int64_t *of_x, const double *p,
           const double *q, const int64_t *of_q)
{
    double product = 0.0, size = 0.0;
    for (int k = 0; k < images->ndim; k++) {
        double of_a, of_b;
        product +=
            component_of(images, p, x, of_x, k, &of_a) * component_of(images, p, q, of_q, k, &of_b);
        size += of_a * of_b;
    }
    if (size >= LEAST_SIZE && size <= LARGEST_SIZE && fabs(product) > FOOT_ERROR * size) {
        return product > 0.0;
    }
    return sign_by_integers(images, x, of_x, p, q, of_q) >= 0;
}

bool
hs_foot_is_between(const hs_metric *images, const double *x, const int64_t *of_x, const double *p,
                   const double *q, const int64_t *of_q)
{
    int64_t from_q[HS_MAX_DIM], back[HS_MAX_DIM];
    HS_ASSERT(images->n_rows <= HS_MAX_DIM - 2);
    for (int l = 0; l < images->n_rows; l++) {
        from_q[l] = of_x[l] - of_q[l];
        back[l] = -of_q[l];
    }
    return is_forward(images, x, of_x, p, q, of_q) && is_forward(images, x, from_q, q, p, back);
}
