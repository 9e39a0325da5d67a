/* SPDX-License-Identifier: BSD-3-Clause */
#include "lattice.h"
#include "../exact/arithmetic.h"

#include <math.h>

/*
 * lattice.c: a short basis of the box vectors, and a unit normal for each grid axis.
 *
 * Normals and heights need not be accurate, only consistent: whatever unit vector `normal[k]`
 * is, |normal[k] . D| <= |D| holds, and grid.c measures how far a lattice vector moves a grid
 * coordinate that it should not move. A bad normal makes cells wider, never an answer wrong.
 */

/*
 * Reduction that decides in floating point and computes in exact integers.
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

typedef struct short_basis {
    int        ndim, n_rows;
    int        n_refused; /* steps that were not taken for their size */
    bool       changed;
    int        order[HS_MAX_DIM]; /* row order[k] is the k-th to the algorithm */
    scaled_row row[HS_MAX_DIM];   /* B = U A, rounded */
    scaled_row star[HS_MAX_DIM];  /* row order[k], less its projection on those before */
    int64_t    U[HS_MAX_DIM][HS_MAX_DIM];
    const double (*given)[HS_MAX_DIM]; /* A; borrowed */
} short_basis;

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
combine(const short_basis *b, const int64_t coefficients[], int c, double *error)
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

/* Row k less a multiple of row l. False, and nothing done, where numbers would get too large: a
 * coefficient passes 2^61, or an entry the range. */
static bool
subtract(short_basis *b, int k, int l, int64_t multiple)
{
    int64_t    coefficients[HS_MAX_DIM];
    double     entries[HS_MAX_DIM];
    scaled_row row;
    bool       fits = true;
    for (int i = 0; fits && i < b->n_rows; i++) {
        const double rough = (double)b->U[k][i] - (double)multiple * (double)b->U[l][i];
        fits = fabs(rough) <= 2.0 * (double)MAX_COEFFICIENT;
        if (fits) { /* then the integers do not overflow */
            coefficients[i] = b->U[k][i] - multiple * b->U[l][i];
            fits = coefficients[i] <= MAX_COEFFICIENT && coefficients[i] >= -MAX_COEFFICIENT;
        }
    }
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
sort_rows(short_basis *b)
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
project(short_basis *b, int k)
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
coefficient(const short_basis *b, int k, int j)
{
    const scaled_row *row = &b->row[b->order[k]], *star = &b->star[j];
    double            mu = star->norm2 > 0.0 ? dot(b->ndim, row->x, star->x) / star->norm2 : 0.0;
    return ldexp(mu, row->exponent - star->exponent);
}

static void
reduce_lll(short_basis *b)
{
    int k = 1;
    project(b, 0);
    for (int step = 0; step < MAX_STEPS && k < b->n_rows && b->n_refused < MAX_REFUSED; step++) {
        /* Bring the coefficients of the k-th row to one half or less. One sweep does unless the row
         * is very long: then each takes off what double precision can see, and the next sees more.
         * A coefficient beyond 2^61 is left, and so is one that drowns in the rounding of a long
         * row. */
        bool again = true;
        for (int sweep = 0; again && sweep < MAX_SWEEPS; sweep++) {
            again = false;
            for (int j = k - 1; j >= 0; j--) {
                const int    from = b->order[k], what = b->order[j];
                const double mu = coefficient(b, k, j);
                const double noise = ldexp(0x1p-45, b->row[from].exponent - b->star[j].exponent);
                if (fabs(mu) > 0.5 + 0x1p-20 + noise && fabs(mu) <= (double)MAX_COEFFICIENT) {
                    again = subtract(b, from, what, (int64_t)rint(mu)) || again;
                }
            }
        }
        project(b, k);
        const double mu = coefficient(b, k, k - 1);
        if (!(norm_ratio(&b->star[k], &b->star[k - 1]) < LOVASZ - mu * mu)) {
            k++;
            continue;
        }
        const int other = b->order[k];
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
shorten(short_basis *b, int k)
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

/*
 * B from the scaled box vectors, which are linearly independent, finite, of any scale, 1e-300 to
 * 1e300, and of very different length. U has determinant +1 or -1, so that both span the same
 * lattice. Where a row would need a coefficient beyond 2^61, this stops early: the result is always
 * a valid basis, at worst the given one.
 */
static void
reduce(hs_lattice *lattice)
{
    const int   ndim = lattice->ndim, n_rows = lattice->n_periodic;
    short_basis best, trial;
    bool        orthogonal = true, usable = true;
    best.ndim = ndim;
    best.n_rows = n_rows;
    best.given = (const double(*)[HS_MAX_DIM])lattice->scaled;
    for (int k = 0; k < n_rows; k++) {
        for (int l = 0; l < n_rows; l++) {
            best.U[k][l] = k == l;
        }
        usable = set_row(ndim, best.given[k], 0, &best.row[k]) && usable;
        for (int j = 0; j < k; j++) {
            orthogonal = dot(ndim, best.row[k].x, best.row[j].x) == 0.0 && orthogonal;
        }
    }
    bool promising = usable && !orthogonal;
    /* A pass that gains nothing is undone, which leaves reduced boxes alone. Beyond three
     * dimensions what it reaches depends on the order of the rows, and a second may gain more. */
    for (int pass = 0; promising && pass < (n_rows <= 3 ? 1 : MAX_PASSES); pass++) {
        trial = best;
        trial.changed = false;
        trial.n_refused = 0;
        sort_rows(&trial);
        reduce_lll(&trial);
        if (n_rows <= 3) {
            sort_rows(&trial);
        }
        for (int step = 0, k = 1; n_rows <= 3 && step < MAX_STEPS && k < n_rows; step++) {
            if (shorten(&trial, k)) {
                sort_rows(&trial);
                k = 1;
            } else {
                k++;
            }
        }
        double ratio = 1.0; /* of the products of the lengths, which bound how flat a basis is */
        int    exponent = 0;
        for (int k = 0; k < n_rows; k++) {
            ratio *= trial.row[k].norm2 / best.row[k].norm2;
            exponent += trial.row[k].exponent - best.row[k].exponent;
        }
        promising = trial.changed && ldexp(ratio, 2 * exponent) < NOTABLY_LESS;
        if (promising) {
            best = trial;
        }
    }
    for (int k = 0; k < n_rows; k++) {
        bool same = true;
        for (int l = 0; l < n_rows; l++) {
            lattice->U[k][l] = best.U[k][l];
            same = same && best.U[k][l] == (k == l);
        }
        lattice->reduced = lattice->reduced || !same;
        for (int c = 0; c < ndim && !same; c++) {
            double error = 0.0;
            lattice->rows[k][c] = combine(&best, best.U[k], c, &error);
            lattice->row_error[k] = hs_larger(error, lattice->row_error[k]);
        }
    }
}

/*
 * Exact linear independence, by elimination modulo primes just below 2^31.
 *
 * Multiplying a row by a power of two keeps the rank, so the rows may be taken as integers. If
 * they are independent, some n x n minor is a nonzero integer, at most B by Hadamard's
 * inequality. A prime modulo which the rank is deficient divides every minor. Therefore
 *   - full rank modulo one prime proves independence: some minor is nonzero modulo it;
 *   - deficient rank modulo primes whose product exceeds B proves dependence: their product
 *     divides every minor, and zero is the only multiple of it that small.
 * The first prime settles practically every independent box; only dependent rows and rows made
 * for the purpose go further.
 */

#define LARGEST_PRIME UINT64_C(0x7fffffff) /* 2^31 - 1: products of residues fit 64 bits */
#define PRIME_BITS    30                   /* of a number that each prime used here passes */

/*
 * The rows as integers, times 2^-least, modulo p. Elimination without division: what is left of a
 * row is multiplied by the pivot instead. For the rank a row's factor is of no account.
 */
static bool
full_rank(uint64_t p, int ndim, int n_rows, const double rows[][HS_MAX_DIM], int least)
{
    uint64_t a[HS_MAX_DIM][HS_MAX_DIM];
    for (int r = 0; r < n_rows; r++) {
        for (int k = 0; k < ndim; k++) {
            int exponent;
            a[r][k] = (uint64_t)ldexp(frexp(fabs(rows[r][k]), &exponent), 53) % p;
            for (int left = a[r][k] > 0 ? exponent - least : 0; left > 0; left -= 32) {
                a[r][k] = (a[r][k] << (left < 32 ? left : 32)) % p;
            }
            a[r][k] = rows[r][k] < 0.0 && a[r][k] > 0 ? p - a[r][k] : a[r][k];
        }
    }
    for (int k = 0; k < n_rows; k++) {
        int column = 0;
        while (column < ndim && a[k][column] == 0) {
            column++;
        }
        if (column == ndim) {
            return false;
        }
        const uint64_t pivot = a[k][column];
        for (int i = k + 1; i < n_rows; i++) {
            const uint64_t factor = p - a[i][column];
            for (int c = 0; c < ndim; c++) {
                a[i][c] = (pivot * a[i][c] % p + factor * a[k][c] % p) % p;
            }
        }
    }
    return true;
}

hs_scale
hs_scale_of(int exponent)
{
    const int half = exponent / 2;
    return (hs_scale){exponent, hs_power_of_two(-half), hs_power_of_two(half - exponent)};
}

static int
collect_periodic_rows(const hs_box *box, double rows[][HS_MAX_DIM], int *vector_of_row)
{
    int n_periodic = 0;
    for (int l = 0; l < box->ndim; l++) {
        if (box->periodic[l]) {
            memcpy(rows[n_periodic], box->rows[l], (size_t)box->ndim * sizeof(double));
            vector_of_row[n_periodic++] = l;
        }
    }
    return n_periodic;
}

/* If every row has one nonzero entry, in its own column: column[r] says where. */
static bool
rows_are_aligned(int ndim, int n_rows, const double rows[][HS_MAX_DIM], int *column)
{
    unsigned used = 0;
    for (int r = 0; r < n_rows; r++) {
        column[r] = -1;
        for (int k = 0; k < ndim; k++) {
            if (rows[r][k] != 0.0) {
                if (column[r] >= 0) {
                    return false;
                }
                column[r] = k;
            }
        }
        if (column[r] < 0 || (used >> column[r] & 1u)) {
            return false;
        }
        used |= 1u << column[r];
    }
    return true;
}

hs_status
hs_box_check(const hs_box *box, hs_failure *failure)
{
    double rows[HS_MAX_DIM][HS_MAX_DIM];
    int    vector_of_row[HS_MAX_DIM], column[HS_MAX_DIM];
    if (box == NULL) {
        return HS_OK;
    }
    for (int l = 0; l < box->ndim; l++) {
        for (int k = 0; k < box->ndim; k++) {
            if (!isfinite(box->rows[l][k])) {
                failure->row = l;
                failure->column = k;
                failure->value = box->rows[l][k];
                return HS_ERR_BOX_FINITE;
            }
        }
    }
    const int n_periodic = collect_periodic_rows(box, rows, vector_of_row);
    int       least = INT32_MAX, most = INT32_MIN; /* exponents of all entries */
    if (rows_are_aligned(box->ndim, n_periodic, rows, column)) {
        return HS_OK;
    }
    failure->row = -1; /* unless one of them is zero */
    for (int r = n_periodic - 1; r >= 0; r--) {
        bool is_zero = true;
        for (int k = 0; k < box->ndim; k++) {
            if (rows[r][k] != 0.0) {
                int exponent;
                (void)frexp(rows[r][k], &exponent);
                least = exponent < least ? exponent : least;
                most = exponent > most ? exponent : most;
                is_zero = false;
            }
        }
        failure->row = is_zero ? vector_of_row[r] : failure->row;
    }
    /* A minor's row is no longer than sqrt(8) times its largest integer: 8 * 2154 bits at most. */
    const int64_t bound_bits = n_periodic * ((int64_t)most - least + 53 + 2);
    uint64_t      p = LARGEST_PRIME;
    for (int64_t bits = 0; failure->row < 0 && bits <= bound_bits; bits += PRIME_BITS) {
        if (full_rank(p, box->ndim, n_periodic, rows, least)) {
            return HS_OK;
        }
        uint64_t divisor = 1;
        while (divisor * divisor <= p) { /* the next prime below: they are some twenty apart */
            p -= 2;
            for (divisor = 3; divisor * divisor <= p && p % divisor != 0; divisor += 2) {
            }
        }
    }
    return HS_ERR_BOX_DEPENDENT;
}

/* Removes from v what lies along n_basis orthonormal vectors (twice: the first pass rounds), then
 * scales v to length 1. Returns its length before that. parts: NULL, or what lay along each is
 * added to these. */
static double
orthonormalise(int ndim, int n_basis, double basis[][HS_MAX_DIM], double *v, double *parts)
{
    for (int pass = 0; pass < 2; pass++) {
        for (int b = 0; b < n_basis; b++) {
            const double along = dot(ndim, v, basis[b]);
            for (int k = 0; k < ndim; k++) {
                v[k] -= along * basis[b][k];
            }
            if (parts != NULL) {
                parts[b] += along;
            }
        }
    }
    const double length = sqrt(dot(ndim, v, v));
    for (int k = 0; k < ndim; k++) {
        v[k] = length > 0.0 ? v[k] / length : 0.0;
    }
    return length;
}

void
hs_orthogonal_rows(const double rows[][HS_MAX_DIM], const int *order, int n, int ndim,
                   double unit[][HS_MAX_DIM], double parts[][HS_MAX_DIM])
{
    for (int r = 0; r < n; r++) {
        memcpy(unit[r], rows[order != NULL ? order[r] : r], (size_t)ndim * sizeof(double));
        memset(parts[r], 0, (size_t)n * sizeof(double));
        parts[r][r] = orthonormalise(ndim, r, unit, unit[r], parts[r]);
    }
}

/* Multiplies the volume by length * 2^exponent. */
static void
multiply_volume(hs_lattice *lattice, double length, int exponent)
{
    int carried;
    lattice->volume_mantissa = frexp(lattice->volume_mantissa * length, &carried);
    lattice->volume_exponent += carried + exponent;
}

double
hs_lattice_volume(const hs_lattice *lattice, int exponent)
{
    const int power = lattice->volume_exponent + lattice->n_periodic * exponent;
    return power == 0 ? lattice->volume_mantissa : ldexp(lattice->volume_mantissa, power);
}

/* Sets v to the part of row r of B that is orthogonal to n_basis vectors, with length 1. Returns
 * its length before that, times 2^-*exponent. */
static double
orthonormal_row(const hs_lattice *lattice, int r, int n_basis, double basis[][HS_MAX_DIM],
                double *v, int *exponent)
{
    scaled_row row;
    (void)set_row(lattice->ndim, lattice->rows[r], 0, &row);
    memcpy(v, row.x, (size_t)lattice->ndim * sizeof *v);
    *exponent = row.exponent;
    return orthonormalise(lattice->ndim, n_basis, basis, v, NULL);
}

/* Along each row of B the unit vector that is orthogonal to all others; for each open grid axis one
 * that is orthogonal to all rows and to those before it, from the coordinate axis that these cover
 * least. */
static void
set_general_axes(hs_lattice *lattice)
{
    double    basis[HS_MAX_DIM][HS_MAX_DIM];
    const int ndim = lattice->ndim, m = lattice->n_periodic;
    int       n_basis = m, exponent;
    for (int r = 0; r < m; r++) {
        const int k = lattice->vector_of_row[r];
        double   *normal = lattice->normal[k];
        int       n_others = 0;
        for (int other = 0; other < m; other++) {
            if (other != r) {
                (void)orthonormal_row(lattice, other, n_others, basis, basis[n_others], &exponent);
                n_others++;
            }
        }
        (void)orthonormal_row(lattice, r, n_others, basis, normal, &exponent);
        const double height = dot(ndim, normal, lattice->rows[r]);
        for (int c = 0; c < ndim; c++) {
            normal[c] = height < 0.0 ? -normal[c] : normal[c];
            lattice->direction[k][c] = fabs(height) > 0.0 ? lattice->rows[r][c] / fabs(height)
                                                          : 0.0;
        }
        lattice->row_of_axis[k] = r;
        lattice->period[k] = fabs(height);
    }
    for (int r = 0; r < m; r++) {
        const double length = orthonormal_row(lattice, r, r, basis, basis[r], &exponent);
        multiply_volume(lattice, length, exponent);
    }
    for (int k = 0; k < ndim; k++) {
        double best_length = -1.0;
        for (int a = 0; lattice->row_of_axis[k] < 0 && a < ndim; a++) {
            double trial[HS_MAX_DIM] = {0};
            trial[a] = 1.0;
            const double length = orthonormalise(ndim, n_basis, basis, trial, NULL);
            if (length > best_length) {
                best_length = length;
                memcpy(lattice->normal[k], trial, sizeof trial);
                memcpy(lattice->direction[k], trial, sizeof trial);
            }
        }
        if (lattice->row_of_axis[k] < 0) {
            memcpy(basis[n_basis++], lattice->normal[k], sizeof basis[0]);
        }
    }
}

/* The given box vectors, scaled; B starts as these. All axes are open as yet, the volume is 1. */
static void
take_rows(const hs_box *box, int ndim, hs_scale scale, hs_lattice *lattice)
{
    lattice->ndim = ndim;
    lattice->n_periodic =
        box == NULL ? 0 : collect_periodic_rows(box, lattice->given, lattice->vector_of_row);
    lattice->aligned = lattice->reduced = false;
    lattice->volume_mantissa = 1.0;
    lattice->volume_exponent = 0;
    for (int k = 0; k < ndim; k++) {
        lattice->row_of_axis[k] = -1;
        lattice->period[k] = 0.0;
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        lattice->row_error[r] = 0.0;
        for (int l = 0; l < lattice->n_periodic; l++) {
            lattice->U[r][l] = r == l;
        }
        for (int k = 0; k < ndim; k++) {
            lattice->scaled[r][k] = hs_scale_apply(scale, lattice->given[r][k]);
            lattice->rows[r][k] = lattice->scaled[r][k];
        }
    }
}

void
hs_lattice_init(const hs_box *box, int ndim, hs_scale scale, hs_lattice *lattice)
{
    int column[HS_MAX_DIM];
    take_rows(box, ndim, scale, lattice);
    lattice->aligned = rows_are_aligned(ndim, lattice->n_periodic, lattice->given, column);
    if (!lattice->aligned) { /* a short basis: of a box sheared by whole widths it is aligned */
        bool exact = true;
        reduce(lattice);
        for (int r = 0; r < lattice->n_periodic; r++) {
            exact = exact && lattice->row_error[r] == 0.0;
        }
        lattice->aligned = exact &&
                           rows_are_aligned(ndim, lattice->n_periodic, lattice->rows, column);
    }
    if (!lattice->aligned) {
        set_general_axes(lattice);
        return;
    }
    for (int r = 0; r < lattice->n_periodic; r++) { /* entries become positive */
        const int c = column[r];
        if (lattice->rows[r][c] < 0.0) {
            lattice->rows[r][c] = -lattice->rows[r][c];
            for (int l = 0; l < lattice->n_periodic; l++) {
                lattice->U[r][l] = -lattice->U[r][l];
            }
        }
        lattice->row_of_axis[c] = r;
        lattice->period[c] = lattice->rows[r][c];
        multiply_volume(lattice, lattice->rows[r][c], 0);
    }
    for (int k = 0; k < ndim; k++) {
        for (int c = 0; c < ndim; c++) {
            lattice->normal[k][c] = lattice->direction[k][c] = k == c ? 1.0 : 0.0;
        }
    }
}

/*
 * The height of given box vector l over the others, and the unit vector along it. The vector whose
 * product with that box vector is 1, and 0 with the others, is a combination of the dual vectors of
 * the short basis, which are accurate however skewed the box is. 0 where a height of the short
 * basis has vanished.
 */
static double
height_of_given(const hs_lattice *reduced, int l, double *normal)
{
    const int d = reduced->ndim;
    double    shortest = INFINITY;
    memset(normal, 0, (size_t)d * sizeof(double));
    for (int k = 0; k < d; k++) {
        const int r = reduced->row_of_axis[k];
        if (r >= 0 && !(reduced->period[k] > 0.0)) {
            return 0.0;
        }
        shortest = r >= 0 && reduced->U[r][l] != 0 ? hs_smaller(reduced->period[k], shortest)
                                                   : shortest;
    }
    const int      exponent = ilogb(shortest);
    const hs_scale scale = hs_scale_of(exponent);
    for (int c = 0; c < d; c++) {
        for (int k = 0; k < d; k++) {
            const int r = reduced->row_of_axis[k];
            if (r >= 0 && reduced->U[r][l] != 0) {
                normal[c] += (double)reduced->U[r][l] / hs_scale_apply(scale, reduced->period[k]) *
                             reduced->normal[k][c];
            }
        }
    }
    const double length = orthonormalise(d, 0, NULL, normal, NULL);
    return length > 0.0 ? ldexp(1.0 / length, exponent) : 0.0;
}

void
hs_lattice_init_given(const hs_box *box, hs_scale scale, hs_lattice *lattice)
{
    hs_lattice reduced;
    hs_lattice_init(box, box->ndim, scale, &reduced);
    take_rows(box, box->ndim, scale, lattice);
    lattice->volume_mantissa = reduced.volume_mantissa;
    lattice->volume_exponent = reduced.volume_exponent;
    for (int l = 0; l < lattice->n_periodic; l++) {
        const int k = lattice->vector_of_row[l];
        lattice->row_of_axis[k] = l;
        lattice->period[k] = height_of_given(&reduced, l, lattice->normal[k]);
    }
    for (int c = 0; reduced.aligned && !reduced.reduced && c < box->ndim; c++) {
        if (reduced.row_of_axis[c] >= 0) { /* nothing to round */
            lattice->period[lattice->vector_of_row[reduced.row_of_axis[c]]] = reduced.period[c];
        }
    }
}

bool
hs_lattice_shift(const hs_lattice *lattice, const int64_t *reduced, int64_t *given)
{
    for (int l = 0; l < lattice->n_periodic; l++) {
        double   rough = 0.0, size = 0.0; /* the sum, and what its rounding is relative to */
        uint64_t sum = 0;                 /* modulo 2^64: exact once the sum is known to be small */
        for (int r = 0; r < lattice->n_periodic; r++) {
            const double term = (double)reduced[r] * (double)lattice->U[r][l];
            rough += term;
            size += fabs(term);
            sum += (uint64_t)reduced[r] * (uint64_t)lattice->U[r][l];
        }
        if (!(fabs(rough) + 0x1p-48 * size < 0x1p62)) {
            return false;
        }
        given[l] = sum <= INT64_MAX ? (int64_t)sum : -(int64_t)(UINT64_MAX - sum) - 1;
    }
    return true;
}

/* Least height of a reduced basis in its row, with much room: 8 rows may have 2^-4. */
#define LEAST_HEIGHT 0x1p-20
/* More than an int32 component of S holds. */
#define MOST_OF_A_ROW 0x1p32

bool
hs_skew_is_left(const hs_lattice *lattice)
{
    for (int k = 0; k < lattice->ndim && !lattice->aligned; k++) {
        const int r = lattice->row_of_axis[k];
        double    largest = 0.0;
        for (int c = 0; r >= 0 && c < lattice->ndim; c++) {
            largest = hs_larger(fabs(lattice->rows[r][c]), largest);
        }
        for (int l = 0; r >= 0 && l < lattice->n_periodic; l++) {
            if (fabs((double)lattice->U[r][l]) >= MOST_OF_A_ROW) {
                return true;
            }
        }
        if (r >= 0 && !(lattice->period[k] >= LEAST_HEIGHT * largest)) {
            return true;
        }
    }
    return false;
}

hs_status
hs_skew_or_memory(const hs_lattice *lattice)
{
    return hs_skew_is_left(lattice) ? HS_ERR_BOX_SKEWED : HS_ERR_MEMORY;
}

/*
 * A first guess of F, then bounds on how wrong it is. Sums of non-negative numbers are
 * rounded up by a factor GROW at the end: no sum here has more than 200 operations, each of a
 * relative error of at most 2^-53.
 */

#define UNIT 0x1p-53
#define GROW (1.0 + 0x1p-40)
/* More than all underflows of a sum of products lose. */
#define LOST 0x1p-1060

/* c = a b; returns how far, at most, an entry may be from that of the exact product. */
static double
multiply_matrices(int rows, int inner, int columns, const double a[][HS_MAX_DIM],
                  const double b[][HS_MAX_DIM], double c[][HS_MAX_DIM])
{
    double worst = 0.0;
    for (int r = 0; r < rows; r++) {
        for (int k = 0; k < columns; k++) {
            double sum = 0.0, size = 0.0;
            for (int l = 0; l < inner; l++) {
                sum += a[r][l] * b[l][k];
                size += fabs(a[r][l]) * fabs(b[l][k]);
            }
            c[r][k] = sum;
            worst = hs_larger((inner + 1) * UNIT * size, worst);
        }
    }
    return worst * GROW + LOST;
}

/* At most the smallest singular value of F (d rows of d), by Gershgorin's circles of F F^T; 0 where
 * it may vanish. */
static double
smallest_stretch(int d, const double F[][HS_MAX_DIM])
{
    double least = INFINITY;
    for (int a = 0; a < d; a++) {
        double radius = 0.0, centre = 0.0;
        for (int b = 0; b < d; b++) {
            double dot = 0.0, size = 0.0;
            for (int k = 0; k < d; k++) {
                dot += F[a][k] * F[b][k];
                size += fabs(F[a][k]) * fabs(F[b][k]);
            }
            radius += (b == a ? 0.0 : fabs(dot)) + (d + 1) * UNIT * size + LOST;
            centre = b == a ? dot : centre;
        }
        /* The sum and its rounding, to the safe side. */
        const double end = centre - (radius * GROW + fabs(centre) * 0x1p-50);
        if (!(end > 0x1p-900) || !(end < 0x1p900)) {
            return 0.0;
        }
        least = hs_smaller(end, least);
    }
    return sqrt(least) * (1.0 - 0x1p-48); /* more than its rounding */
}

bool
hs_strain_find(const hs_box *before, const hs_box *now, hs_strain *strain)
{
    const int  d = before->ndim;
    hs_lattice lattice;
    double     dual[HS_MAX_DIM][HS_MAX_DIM]; /* a right inverse of h0, rounded */
    double     product[HS_MAX_DIM][HS_MAX_DIM], inverse = 0.0, error = 0.0, residual = 0.0;
    hs_lattice_init_given(before, hs_scale_of(0), &lattice);
    const int m = lattice.n_periodic;
    for (int c = 0; c < d; c++) {
        for (int k = 0; k < d; k++) {
            strain->F[c][k] = c == k;
        }
    }
    /* F = 1 + sum_r g_r^T (h_r - h0_r), g_r being the vectors dual to h0: a first guess. */
    for (int r = 0; r < m; r++) {
        const int axis = lattice.vector_of_row[r];
        if (!(lattice.period[axis] > 0.0)) {
            return false;
        }
        for (int c = 0; c < d; c++) {
            dual[c][r] = lattice.normal[axis][c] / lattice.period[axis];
            inverse += fabs(dual[c][r]);
            for (int k = 0; k < d; k++) {
                strain->F[c][k] += dual[c][r] * (now->rows[axis][k] - lattice.given[r][k]);
            }
        }
    }
    strain->column_sum = 0.0;
    for (int k = 0; k < d; k++) {
        double sum = 0.0;
        for (int c = 0; c < d; c++) {
            sum += fabs(strain->F[c][k]);
        }
        strain->column_sum = hs_larger(sum * GROW, strain->column_sum);
    }
    /* |g| (Frobenius) of an exact right inverse of h0, by how far the rounded one is from one. */
    double off = multiply_matrices(m, d, m, (const double(*)[HS_MAX_DIM])lattice.given,
                                   (const double(*)[HS_MAX_DIM])dual, product);
    for (int r = 0; r < m; r++) {
        for (int s = 0; s < m; s++) {
            error += fabs(product[r][s] - (r == s)) * (1.0 + 0x1p-52) + off;
        }
    }
    error *= GROW;
    inverse = error < 0.5 ? inverse / (1.0 - error) * GROW : INFINITY;
    /* |h0 F - h|, the sum over all entries. */
    off = multiply_matrices(m, d, d, (const double(*)[HS_MAX_DIM])lattice.given,
                            (const double(*)[HS_MAX_DIM])strain->F, product);
    for (int r = 0; r < m; r++) {
        for (int k = 0; k < d; k++) {
            residual +=
                fabs(product[r][k] - now->rows[lattice.vector_of_row[r]][k]) * (1.0 + 0x1p-52) +
                off;
        }
    }
    strain->residual = inverse * (residual * GROW) * GROW;
    strain->shrink = smallest_stretch(d, (const double(*)[HS_MAX_DIM])strain->F) - strain->residual;
    /* The difference is rounded by at most 2^-53 of itself, and so is the next one. */
    strain->shrink -= 0x1p-52 * fabs(strain->shrink);
    strain->shrink = hs_smaller(strain->shrink, 1.0);
    return strain->shrink > 0.0 && strain->residual < INFINITY;
}
