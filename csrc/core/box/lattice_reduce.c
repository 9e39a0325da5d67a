/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * lattice_reduce.c: reduction that decides in floating point and computes in exact integers.
 *
 * Every step subtracts an integer multiple of one row from another, so U stays unimodular
 * whatever rounding does to the decision to take it. The changed row of B is then formed anew
 * from an exact sum U A: no error is passed on, and shears of 1e9 widths cancel without loss.
 *
 * The decisions are those of Lenstra, Lenstra and Lovasz (1982), row by row as in Nguyen and
 * Stehle (2009): rows before the current one are already nearly orthogonal, so the coefficients
 * are accurate where it matters. In two and three dimensions a descent follows, which subtracts
 * sums of the shorter rows as long as that shortens a row (Lagrange; Semaev 2001); it ends in a
 * basis reduced in the sense of Minkowski.
 *
 * Rows are never exchanged: the algorithm permutes an index instead. A box that is already
 * reduced, in whatever order its rows come, is therefore left as it is.
 */
#include "lattice_reduce.h"

#include <math.h>

#include "../exact/doubleword.h"

#define MAX_COEFFICIENT  (INT64_C(1) << 61)
#define COEFFICIENT_TAIL (INT64_C(1) << 26) /* splits them into 35 and 26 bits, exact as doubles */

#define LOVASZ 0.99 /* the factor that each exchange of rows must gain, so that they end */
/* What a step must gain to count: far above rounding, so that ties are left alone. */
#define NOTABLY_LESS (1.0 - 0x1p-40)

/* Bounds on work: several times what boxes needed where the reduction ended by itself. */
enum { MAX_STEPS = 2000, MAX_SWEEPS = 16, MAX_REFUSED = 100, MAX_PASSES = 8 };

/* x * 2^exponent, where the largest |x[k]| is in [0.5, 1): squares neither overflow nor vanish. */
typedef struct scaled_row {
    double x[HS_MAX_DIM];
    double norm2; /* x . x */
    int    exponent;
} scaled_row;

typedef struct basis {
    int        ndim, n_rows;
    int        n_refused; /* steps that were not taken for their size */
    bool       changed;
    int        order[HS_MAX_DIM]; /* row order[k] is the k-th to the algorithm */
    scaled_row row[HS_MAX_DIM];   /* B = U A, rounded */
    scaled_row star[HS_MAX_DIM];  /* row order[k], less its projection on those before */
    int64_t    U[HS_MAX_DIM][HS_MAX_DIM];
    const double (*given)[HS_MAX_DIM]; /* A; borrowed */
} basis;

static double
dot(int ndim, const double a[], const double b[])
{
    double sum = 0.0;
    for (int c = 0; c < ndim; c++) {
        sum += a[c] * b[c];
    }
    return sum;
}

/* False when the row is zero or not finite; it gets norm 0. */
static bool
set_row(int ndim, const double x[], int exponent, scaled_row *row)
{
    double largest = 0.0, nothing = 0.0;
    int    shift;
    for (int c = 0; c < ndim; c++) {
        largest = fabs(x[c]) > largest ? fabs(x[c]) : largest;
        nothing += x[c] - x[c]; /* NaN from infinity or NaN */
    }
    row->norm2 = 0.0;
    row->exponent = exponent;
    if (largest == 0.0 || nothing != 0.0) {
        memset(row->x, 0, sizeof row->x);
        return false;
    }
    (void)frexp(largest, &shift);
    double first = hs_power_of_two(-(shift / 2)), second = hs_power_of_two(shift / 2 - shift);
    for (int c = 0; c < ndim; c++) {
        row->x[c] = x[c] * first * second; /* 2^1073 is not a double */
    }
    row->norm2 = dot(ndim, row->x, row->x);
    row->exponent += shift;
    return true;
}

/* |a|^2 / |b|^2; may overflow to infinity, or underflow to 0. */
static double
norm_ratio(const scaled_row *a, const scaled_row *b)
{
    double ratio = a->norm2 / b->norm2;
    return a->exponent == b->exponent ? ratio : ldexp(ratio, 2 * (a->exponent - b->exponent));
}

/* Add b to the sum that the m numbers are, without error (Shewchuk 1997). Returns the new m. */
static int
add_exactly(double sum[], int m, double b)
{
    int kept = 0;
    for (int i = 0; i < m; i++) {
        hs_dw s = hs_two_sum(b, sum[i]);
        b = s.hi;
        if (s.lo != 0.0) {
            sum[kept++] = s.lo;
        }
    }
    if (b != 0.0) {
        sum[kept++] = b;
    }
    return kept;
}

/* Entry c of the row with these coefficients; when error is not NULL, a bound on its error. */
static double
combine(const basis *b, const int64_t coefficients[], int c, double *error)
{
    double sum[4 * HS_MAX_DIM + 1], size = 0.0, value = 0.0, lost = 0.0;
    int    m = 0;
    for (int l = 0; l < b->n_rows; l++) {
        size += fabs((double)coefficients[l]) * fabs(b->given[l][c]);
    }
    double scale = size < 0x1p990 ? 1.0 : 0x1p-120;
    for (int l = 0; l < b->n_rows; l++) {
        double given = coefficients[l] != 0 ? b->given[l][c] : 0.0, entry = given * scale;
        if (entry / scale != given) {
            lost = 0x1p-890; /* 8 rows, 2^61 times half of 2^-1074, times 2^120 */
        }
        if (entry != 0.0) {
            /* Exact for subnormal entries too: multiples of the entry's last bit. */
            const int64_t tail = coefficients[l] % COEFFICIENT_TAIL;
            const hs_dw   high = hs_two_product((double)(coefficients[l] - tail), entry);
            const hs_dw   low = hs_two_product((double)tail, entry);
            m = add_exactly(sum, add_exactly(sum, m, low.lo), low.hi);
            m = add_exactly(sum, add_exactly(sum, m, high.lo), high.hi);
        }
    }
    for (int i = 0; i < m; i++) {
        value += sum[i];
    }
    if (error != NULL) {
        double rest = 0.0;
        m = add_exactly(sum, m, -value);
        for (int i = 0; i < m; i++) {
            rest += fabs(sum[i]);
        }
        *error = lost + rest / scale * (1.0 + 0x1p-40);
    }
    return value / scale;
}

/* out = row - multiple * other; false when an entry passes 2^61. */
static bool
subtract_integers(int n, const int64_t row[], int64_t multiple, const int64_t other[],
                  int64_t out[])
{
    for (int i = 0; i < n; i++) {
        double rough = (double)row[i] - (double)multiple * (double)other[i];
        if (fabs(rough) > 2.0 * (double)MAX_COEFFICIENT) {
            return false; /* else the integers below do not overflow */
        }
        out[i] = row[i] - multiple * other[i];
        if (out[i] > MAX_COEFFICIENT || out[i] < -MAX_COEFFICIENT) {
            return false;
        }
    }
    return true;
}

/* Row k less a multiple of row l. False, and nothing done, where numbers would get too large. */
static bool
subtract(basis *b, int k, int l, int64_t multiple)
{
    int64_t    coefficients[HS_MAX_DIM];
    double     entries[HS_MAX_DIM];
    scaled_row row;
    bool       fits = subtract_integers(b->n_rows, b->U[k], multiple, b->U[l], coefficients);
    for (int c = 0; fits && c < b->ndim; c++) {
        entries[c] = combine(b, coefficients, c, NULL);
    }
    if (!fits || !set_row(b->ndim, entries, 0, &row)) {
        b->n_refused++;
        return false;
    }
    memcpy(b->U[k], coefficients, (size_t)b->n_rows * sizeof coefficients[0]);
    b->row[k] = row;
    b->changed = true;
    return true;
}

/* Shortest first; equal ones stay in the order given. */
static void
sort_rows(basis *b)
{
    for (int k = 0; k < b->n_rows; k++) {
        int at = k;
        while (at > 0 && norm_ratio(&b->row[k], &b->row[b->order[at - 1]]) < 1.0) {
            b->order[at] = b->order[at - 1];
            at--;
        }
        b->order[at] = k;
    }
}

static void
project(basis *b, int k)
{
    const scaled_row *row = &b->row[b->order[k]];
    double            x[HS_MAX_DIM];
    memcpy(x, row->x, sizeof x);
    for (int j = 0; j < k; j++) {
        const scaled_row *star = &b->star[j];
        double            along = star->norm2 > 0.0 ? dot(b->ndim, x, star->x) / star->norm2 : 0.0;
        for (int c = 0; c < b->ndim; c++) {
            x[c] -= along * star->x[c];
        }
    }
    (void)set_row(b->ndim, x, row->exponent, &b->star[k]);
}

/* How often star j is contained in the k-th row. */
static double
coefficient(const basis *b, int k, int j)
{
    const scaled_row *row = &b->row[b->order[k]], *star = &b->star[j];
    double            mu = star->norm2 > 0.0 ? dot(b->ndim, row->x, star->x) / star->norm2 : 0.0;
    return ldexp(mu, row->exponent - star->exponent);
}

/*
 * Bring the coefficients of the k-th row to one half or less. One sweep does unless the row is
 * very long: then each takes off what double precision can see, and the next sees more. A
 * coefficient beyond 2^61 is left, and so is one that drowns in the rounding of a long row.
 */
static void
size_reduce(basis *b, int k)
{
    bool again = true;
    for (int sweep = 0; again && sweep < MAX_SWEEPS; sweep++) {
        again = false;
        for (int j = k - 1; j >= 0; j--) {
            int    from = b->order[k], what = b->order[j];
            double mu = coefficient(b, k, j);
            double noise = ldexp(0x1p-45, b->row[from].exponent - b->star[j].exponent);
            if (fabs(mu) > 0.5 + 0x1p-20 + noise && fabs(mu) <= (double)MAX_COEFFICIENT) {
                again = subtract(b, from, what, (int64_t)rint(mu)) || again;
            }
        }
    }
}

static void
reduce_lll(basis *b)
{
    int k = 1;
    project(b, 0);
    for (int step = 0; step < MAX_STEPS && k < b->n_rows && b->n_refused < MAX_REFUSED; step++) {
        size_reduce(b, k);
        project(b, k);
        double mu = coefficient(b, k, k - 1);
        if (!(norm_ratio(&b->star[k], &b->star[k - 1]) < LOVASZ - mu * mu)) {
            k++;
            continue;
        }
        int other = b->order[k];
        b->order[k] = b->order[k - 1];
        b->order[k - 1] = other;
        project(b, 0);
        k = k > 1 ? k - 1 : 1;
    }
}

/*
 * Try to shorten the k-th row by the rows before it, at most two: three rows in order of length
 * none of which this shortens are Minkowski reduced.
 */
static bool
shorten(basis *b, int k)
{
    const scaled_row *row = &b->row[b->order[k]];
    double            added[2][HS_MAX_DIM] = {{0.0}}, best = row->norm2 * NOTABLY_LESS;
    int               choice[2] = {0, 0};
    for (int j = 0; j < k; j++) {
        const scaled_row *shorter = &b->row[b->order[j]];
        double            scale = ldexp(1.0, shorter->exponent - row->exponent);
        for (int c = 0; c < b->ndim; c++) {
            added[j][c] = shorter->x[c] * scale;
        }
    }
    for (int p = -1; p <= 1; p++) {
        for (int q = k > 1 ? -1 : 0; q <= (k > 1); q++) {
            double norm2 = 0.0;
            for (int c = 0; c < b->ndim; c++) {
                double x = row->x[c] - p * added[0][c] - q * added[1][c];
                norm2 += x * x;
            }
            if (norm2 < best) {
                best = norm2;
                choice[0] = p;
                choice[1] = q;
            }
        }
    }
    bool first = choice[0] != 0 && subtract(b, b->order[k], b->order[0], choice[0]);
    bool second = choice[1] != 0 && subtract(b, b->order[k], b->order[1], choice[1]);
    return first || second;
}

static void
descend(basis *b)
{
    int k = 1;
    sort_rows(b);
    for (int step = 0; step < MAX_STEPS && k < b->n_rows; step++) {
        if (shorten(b, k)) {
            sort_rows(b);
            k = 1;
        } else {
            k++;
        }
    }
}

/* Compares the products of the lengths, which bound how flat a basis is. */
static bool
is_shorter(const basis *a, const basis *b)
{
    double ratio = 1.0;
    int    exponent = 0;
    for (int k = 0; k < a->n_rows; k++) {
        ratio *= a->row[k].norm2 / b->row[k].norm2;
        exponent += a->row[k].exponent - b->row[k].exponent;
    }
    return ldexp(ratio, 2 * exponent) < NOTABLY_LESS;
}

/* False when there is nothing to reduce. */
static bool
begin(basis *b, int ndim, int n_rows, const double rows[][HS_MAX_DIM])
{
    b->ndim = ndim;
    b->n_rows = n_rows;
    b->given = rows;
    bool orthogonal = true, usable = true;
    for (int k = 0; k < n_rows; k++) {
        for (int l = 0; l < n_rows; l++) {
            b->U[k][l] = k == l;
        }
        usable = set_row(ndim, rows[k], 0, &b->row[k]) && usable;
        for (int j = 0; j < k; j++) {
            orthogonal = dot(ndim, b->row[k].x, b->row[j].x) == 0.0 && orthogonal;
        }
    }
    return usable && !orthogonal;
}

static void
report(const basis *b, hs_reduction *reduction)
{
    reduction->n_rows = b->n_rows;
    reduction->changed = false;
    for (int k = 0; k < b->n_rows; k++) {
        bool same = true;
        for (int l = 0; l < b->n_rows; l++) {
            reduction->U[k][l] = b->U[k][l];
            same = same && b->U[k][l] == (k == l);
        }
        reduction->changed = reduction->changed || !same;
        reduction->error[k] = 0.0;
        for (int c = 0; c < b->ndim; c++) {
            double error = 0.0;
            reduction->rows[k][c] = same ? b->given[k][c] : combine(b, b->U[k], c, &error);
            reduction->error[k] = hs_larger(error, reduction->error[k]);
        }
    }
}

void
hs_reduce(int ndim, int n_rows, const double rows[][HS_MAX_DIM], hs_reduction *reduction)
{
    basis best, trial;
    bool  promising = begin(&best, ndim, n_rows, rows);
    /* A pass that gains nothing is undone, which leaves reduced boxes alone. Beyond three
     * dimensions what it reaches depends on the order of the rows, and a second may gain more. */
    for (int pass = 0; promising && pass < (n_rows <= 3 ? 1 : MAX_PASSES); pass++) {
        trial = best;
        trial.changed = false;
        trial.n_refused = 0;
        sort_rows(&trial);
        reduce_lll(&trial);
        if (n_rows <= 3) {
            descend(&trial);
        }
        promising = trial.changed && is_shorter(&trial, &best);
        if (promising) {
            best = trial;
        }
    }
    report(&best, reduction);
}
