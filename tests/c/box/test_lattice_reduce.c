/* SPDX-License-Identifier: BSD-3-Clause */
/* test_lattice_reduce.c: reduced bases are bases of the same lattice, exactly, and they are
 * short. */
#include "../../../csrc/core/box/lattice_reduce.h"
#include "../support/basis_checks.h"
#include "../support/harness.h"

void test_lattice_reduce(void);

/* What is promised of every result, however odd the rows are. */
static hs_reduction
reduce_and_check(int ndim, int n, matrix a)
{
    hs_reduction r;
    bool         identity = true;
    memset(&r, 0xff, sizeof r);
    hs_reduce(ndim, n, as_const(a), &r);
    CHECK(r.n_rows == n);
    for (int k = 0; k < n; k++) {
        for (int l = 0; l < n; l++) {
            CHECK(r.U[k][l] <= INT64_C(1) << 61 && r.U[k][l] >= -(INT64_C(1) << 61));
            identity = identity && r.U[k][l] == (k == l);
        }
        CHECK(r.error[k] >= 0.0);
        for (int c = 0; c < ndim; c++) {
            CHECK(isfinite(r.rows[k][c]));
            CHECK(is_within_error(&r, a, k, c));
        }
    }
    CHECK(r.changed == !identity);
    CHECK(is_unimodular(&r));
    return r;
}

/* ... and of every lattice that needs no coefficient beyond 2^61. */
static hs_reduction
reduce_well(int ndim, int n, matrix a)
{
    /* Lagrange and Gauss: volume at least sqrt(3/4) and sqrt(1/2) of the product of the minima;
     * Lenstra, Lenstra and Lovasz with factor 0.99: each step at most 1 / (0.99 - 1/4). */
    static const double largest[HS_MAX_DIM + 1] = {1.0,  1.0,  1.1548, 1.4143, 2.48,
                                                   4.52, 9.56, 23.6,   67.8};
    hs_reduction        r = reduce_and_check(ndim, n, a);
    CHECK(defect_of(ndim, n, r.rows) <= largest[n]);
    for (int k = 0; k < n; k++) {
        double length = 0.0;
        for (int c = 0; c < ndim; c++) {
            length = fmax(length, fabs(r.rows[k][c]));
        }
        CHECK(r.error[k] <= length * 0x1p-52);
    }
    return r;
}

static bool
is_untouched(int ndim, int n, matrix a)
{
    hs_reduction r = reduce_and_check(ndim, n, a);
    bool         same = !r.changed;
    for (int k = 0; k < n; k++) {
        same = same && r.error[k] == 0.0 && memcmp(r.rows[k], a[k], (size_t)ndim * 8) == 0;
    }
    return same;
}

static double
random_between(harness_random *random, double low, double high)
{
    return low + (high - low) * random_unit(random);
}

static void
fill_random(harness_random *random, int ndim, int n, matrix a)
{
    for (int k = 0; k < n; k++) {
        for (int c = 0; c < ndim; c++) {
            a[k][c] = random_between(random, -1.0, 1.0);
        }
    }
}

/* Rows of the box with three angles, in degrees. */
static void
fill_cell(double b, double c, double alpha, double beta, double gamma, matrix a)
{
    const double degree = 3.14159265358979323846 / 180.0;
    double       x = c * cos(beta * degree);
    double       y =
        c * (cos(alpha * degree) - cos(beta * degree) * cos(gamma * degree)) / sin(gamma * degree);
    memset(a, 0, sizeof(matrix));
    a[0][0] = 1.0;
    a[1][0] = b * cos(gamma * degree);
    a[1][1] = b * sin(gamma * degree);
    a[2][0] = x;
    a[2][1] = y;
    a[2][2] = sqrt(c * c - x * x - y * y);
}

static void
aligned_boxes_are_untouched(void)
{
    static const double lengths[] = {1.0, 1e12, 1e-12, -3.0, 0.1, 1e300, -1e-300, 5e-324};
    harness_random      random = {1};
    for (int repeat = 0; repeat < 300; repeat++) {
        int    ndim = 1 + repeat % HS_MAX_DIM;
        int    n = (int)(random_bits(&random) % (unsigned)(ndim + 1));
        matrix a = {{0.0}};
        int    turn = (int)(random_bits(&random) % 8);
        for (int k = 0; k < n; k++) {
            a[k][(k + turn) % ndim] = lengths[random_bits(&random) % 8];
        }
        CHECK(is_untouched(ndim, n, a));
    }
}

static void
reduced_boxes_are_untouched(void)
{
    static const double cells[][3][3] = {
        {{0, 1, 1}, {1, 0, 1}, {1, 1, 0}},                       /* face-centred */
        {{-1, 1, 1}, {1, -1, 1}, {1, 1, -1}},                    /* body-centred */
        {{1, 0, 0}, {-0.5, 0.8660254037844386, 0}, {0, 0, 1.6}}, /* hexagonal */
        {{0, 0, -1.6}, {0.5, 0.8660254037844386, 0}, {1, 0, 0}}, /* left-handed */
        {{3, 0.2, 0}, {0.1, 1, 0}, {-0.1, 0.2, 200}},
    };
    harness_random random = {2};
    for (int repeat = 0; repeat < 400; repeat++) {
        matrix a = {{0.0}}, turn = {{0.0}};
        double cosine = cos(repeat * 0.1), sine = sin(repeat * 0.1);
        double scale = repeat % 8 == 0 ? 1.0 : random_between(&random, 0.1, 9.0);
        int    x = repeat % 3, y = (repeat + 1 + repeat % 2) % 3;
        for (int c = 0; c < 3; c++) {
            turn[c][c] = scale;
        }
        turn[x][x] = turn[y][y] = scale * cosine;
        turn[x][y] = scale * sine;
        turn[y][x] = -scale * sine;
        for (int k = 0; k < 9; k++) {
            for (int l = 0; l < 3; l++) {
                a[k / 3][k % 3] += cells[repeat % 5][k / 3][l] * turn[l][k % 3];
            }
        }
        CHECK(is_untouched(3, 3, a));
    }
}

/* The third row is 0.6 times along the second, less what the first explains; taking the second
 * off makes it longer. */
static void
no_row_gets_longer(void)
{
    for (int ndim = 3; ndim <= HS_MAX_DIM; ndim++) {
        matrix a = {{1.0}, {0.5, 1.0}, {0.0, 0.6, 1.0}};
        for (int k = 3; k < ndim; k++) {
            a[k][k] = k;
        }
        CHECK(is_untouched(ndim, ndim, a));
    }
}

/* Integer rows, so that results are exact and can be reduced once more. */
static void
reducing_twice_is_reducing_once(void)
{
    harness_random random = {3};
    for (int repeat = 0; repeat < 2000; repeat++) {
        int    ndim = 1 + repeat % HS_MAX_DIM, n = ndim - (int)(random_bits(&random) % 2);
        matrix a = {{0.0}};
        for (int k = 0; k < n; k++) {
            for (int c = 0; c < ndim; c++) {
                a[k][c] = rint(random_between(&random, -1e6, 1e6));
            }
        }
        hs_reduction r = reduce_well(ndim, n, a);
        CHECK(is_untouched(ndim, n, r.rows));
    }
}

/* By up to 1e9 widths of one other row, or by 1e6 of both, one after the other. */
static void
sheared_boxes_are_straightened(void)
{
    harness_random random = {4};
    for (int repeat = 0; repeat < 1000; repeat++) {
        int    ndim = 2 + repeat % 2, n_shears = 1 + repeat / 2 % 2;
        double widest = pow(10.0, random_between(&random, 0.0, n_shears == 1 ? 9.0 : 6.0));
        double ratio = pow(10.0, random_between(&random, -3.0, 3.0));
        matrix a = {{0.0}};
        for (int k = 0; k < ndim; k++) {
            a[k][k] = rint(random_between(&random, 1.0, 1000.0)) * (k == 1 ? ratio : 1.0);
        }
        for (int step = 0; step < n_shears; step++) {
            int    k = (int)(random_bits(&random) % (unsigned)ndim), l = (k + 1) % ndim;
            double widths = rint(random_between(&random, -widest, widest));
            for (int c = 0; c < ndim; c++) {
                a[k][c] += widths * a[l][c];
            }
        }
        reduce_well(ndim, ndim, a);
    }
}

/* A whole shear leaves the box itself, without error. */
static void
whole_shears_come_back_exactly(void)
{
    for (double shear = 1.0; shear <= 1e9; shear *= 10.0) {
        double       second = fmin(shear, 1e6);
        matrix       a = {{3.0}, {3.0 * shear, 5.0}, {-6.0 * second, 5.0 * second, 0.7}};
        hs_reduction r = reduce_well(3, 3, a);
        CHECK(r.rows[0][0] == 3.0 && r.rows[1][0] == 0.0 && r.rows[2][0] == 0.0);
        CHECK(r.rows[1][1] == 5.0 && r.rows[2][1] == 0.0 && r.rows[2][2] == 0.7);
        CHECK(r.error[0] == 0.0 && r.error[1] == 0.0 && r.error[2] == 0.0);
    }
}

static void
sharp_angles_are_opened(void)
{
    static const double angles[] = {90, 60, 30, 5, 1, 0.01, 1e-4, 1e-6};
    matrix              a;
    for (int k = 0; k < 8; k++) {
        fill_cell(1.0, 1.0, angles[k], angles[k], angles[k], a);
        reduce_well(3, 3, a);
        fill_cell(1.3, 20.0, angles[k], angles[k], 1.5 * angles[k], a);
        reduce_well(3, 3, a);
        fill_cell(1e3, 1.1e6, 90, 90, angles[k], a);
        reduce_well(3, 3, a);
        fill_cell(1.0, 0.37, 180 - angles[k], angles[k], 180 - angles[k] / 2, a);
        if (isfinite(a[2][2]) && a[2][2] > 0.0) {
            reduce_well(3, 3, a);
        }
    }
}

/* Independent by no more than the rounding of their entries: what the first leaves of the second is
 * zero for float64, in the course of the reduction. */
static void
nearly_parallel_rows_are_opened(void)
{
    matrix a = {{0x1.999c2fd441ccp-1, 0x1.6185046a604p-4},
                {0x1.0e230f2d44573p-1, 0x1.d24a701dcb5e9p-5}};
    reduce_well(2, 2, a);
}

static void
random_cells_are_reduced(void)
{
    harness_random random = {5};
    for (int repeat = 0; repeat < 1000; repeat++) {
        int    ndim = 1 + repeat % HS_MAX_DIM;
        int    n = (int)(random_bits(&random) % (unsigned)(ndim + 1));
        matrix a = {{0.0}};
        double flat = pow(10.0, random_between(&random, -6.0, 0.0));
        fill_random(&random, ndim, n, a);
        for (int k = 1; repeat % 2 == 1 && k < n; k++) { /* rows close to the first */
            for (int c = 0; c < ndim; c++) {
                a[k][c] = a[0][c] + flat * a[k][c];
            }
        }
        reduce_well(ndim, n, a);
    }
}

/* No combination of three rows with coefficients of at most 2 is shorter than the row it
 * could replace. */
static void
three_rows_are_minkowski_reduced(void)
{
    harness_random random = {6};
    for (int repeat = 0; repeat < 300; repeat++) {
        matrix a = {{0.0}};
        double length2[3];
        fill_random(&random, 3, 3, a);
        hs_reduction r = reduce_well(3, 3, a);
        for (int code = 0; code < 125; code++) {
            int    s[3] = {code % 5 - 2, code / 5 % 5 - 2, code / 25 - 2};
            double sum2 = 0.0;
            for (int c = 0; c < 3; c++) {
                double x = s[0] * r.rows[0][c] + s[1] * r.rows[1][c] + s[2] * r.rows[2][c];
                sum2 += x * x;
            }
            for (int k = 0; k < 3; k++) {
                length2[k] = 0.0;
                for (int c = 0; c < 3; c++) {
                    length2[k] += r.rows[k][c] * r.rows[k][c];
                }
                CHECK(abs(s[k]) != 1 || sum2 >= length2[k] * (1.0 - 1e-11));
            }
        }
    }
}

static void
scaling_changes_nothing(void)
{
    harness_random random = {7};
    for (int repeat = 0; repeat < 200; repeat++) {
        int    ndim = 2 + repeat % 4;
        matrix a = {{0.0}}, scaled = {{0.0}};
        double scale = repeat % 2 == 0 ? 0x1p996 : 0x1p-996; /* 1e300, 1e-300 */
        fill_random(&random, ndim, ndim, a);
        for (int k = 0; k < ndim; k++) {
            for (int c = 0; c < ndim; c++) {
                a[k][c] = 0x1p-30 * rint(a[k][c] * 1e9) + (k == 0 ? 0.0 : 1e3 * a[0][c]);
                scaled[k][c] = a[k][c] * scale;
            }
        }
        hs_reduction r = reduce_well(ndim, ndim, a), s = reduce_well(ndim, ndim, scaled);
        CHECK(memcmp(r.U, s.U, sizeof r.U) == 0);
        for (int k = 0; k < ndim; k++) {
            CHECK(s.error[k] == r.error[k] * scale);
            for (int c = 0; c < ndim; c++) {
                CHECK(s.rows[k][c] == r.rows[k][c] * scale);
            }
        }
    }
}

/* Whatever the lengths are, the result is a basis, and its error is bounded. */
static void
mixed_lengths_stay_exact(void)
{
    harness_random random = {8};
    for (int repeat = 0; repeat < 1000; repeat++) {
        int    ndim = 1 + repeat % HS_MAX_DIM, range = repeat % 3 == 0 ? 50 : 1000;
        matrix a = {{0.0}};
        for (int k = 0; k < ndim; k++) {
            int exponent = (int)(random_bits(&random) % (unsigned)(2 * range)) - range;
            for (int c = 0; c < ndim; c++) {
                int entry = repeat % 2 == 0 ? exponent : (int)(random_bits(&random) % 2090) - 1070;
                a[k][c] = ldexp(random_between(&random, -1.0, 1.0), entry);
            }
        }
        reduce_and_check(ndim, ndim, a);
    }
}

static void
extreme_rows_are_survived(void)
{
    static const double cells[][3][3] = {
        {{1e300, 0, 0}, {1e308, 1e300, 0}, {0, 1e-300, 1e-300}},
        {{1.7e308, 1.7e308, 0}, {1.7e308, -1.7e308, 0}, {1.7e308, 1.6e308, 1.7e308}},
        {{1.7e308, 1.7e308, 0}, {1.7e308, 1.6e308, 1e-310}, {1.6e308, 1.7e308, 1.7e308}},
        {{5e-324, 0, 0}, {5e-322, 5e-324, 0}, {1e-318, 3e-320, 1e-323}},
        {{1, 0, 0}, {1, 1e-300, 0}, {1, 1e-300, 5e-324}},
        {{1e-300, 0, 0}, {1, 1, 0}, {1e9, 1000000001, 1}},
        {{1.7e308, 0, 1.7e308}, {1.7e308, 1, 0}, {5e-324, 0, 1.7e308}},
        {{0, 0, 0}, {1, 1e-300, 0}, {1, 1, 0}}, /* against the rules: dependent ... */
        {{1, 2, 3}, {3, 2, 1}, {4, 4, 4}},
    };
    for (int k = 0; k < 9; k++) {
        matrix a = {{0.0}};
        for (int c = 0; c < 9; c++) {
            a[c / 3][c % 3] = cells[k][c / 3][c % 3];
        }
        hs_reduction r = reduce_and_check(3, 3, a);
        CHECK(k < 3 || k > 4 || defect_of(3, 3, r.rows) < 1.4143);
        CHECK(k != 4 || (r.rows[1][1] == 1e-300 && r.rows[2][2] == 5e-324));
    }
    matrix       a = {{1.0, INFINITY}, {NAN, 1.0}}; /* ... and not finite */
    hs_reduction r;
    hs_reduce(2, 2, as_const(a), &r);
    CHECK(!r.changed && r.U[0][0] == 1 && r.U[1][1] == 1 && r.U[0][1] == 0 && r.U[1][0] == 0);
}

/* Four rows of a unit box, the second with so much of the first. */
static hs_reduction
reduce_leaning(double much)
{
    matrix a = {{0.0}};
    for (int k = 0; k < 4; k++)
        a[k][k] = 1.0;
    a[1][0] = much;
    return reduce_and_check(4, 4, a);
}

/* A little more than half is left, so that rounding undoes nothing; and the largest coefficient
 * that there may be is taken off. */
static void
coefficients_are_taken_off_from_half_to_the_largest(void)
{
    static const double left[] = {0.5, 0.5 + 0x1p-21, 0.5 + 0x1p-20};
    static const double taken[] = {0.5 + 0x1p-20 + 0x1p-43, 0.5 + 0x1p-19, 1.0, 0x1p61};
    for (int sign = -1; sign <= 1; sign += 2) {
        for (int e = 0; e < 3; e++) {
            const hs_reduction r = reduce_leaning(sign * left[e]);
            CHECK(!r.changed);
        }
        for (int e = 0; e < 4; e++) {
            const hs_reduction r = reduce_leaning(sign * taken[e]);
            const double       whole = fmax(1.0, floor(taken[e]));
            CHECK(r.changed && r.rows[1][0] == sign * (taken[e] - whole) && r.rows[1][1] == 1.0);
            CHECK(r.U[1][0] == -sign * (int64_t)whole);
        }
        CHECK(!reduce_leaning(sign * 0x1.0000000000001p61).changed);
    }
}

void
test_lattice_reduce(void)
{
    RUN(aligned_boxes_are_untouched);
    RUN(reduced_boxes_are_untouched);
    RUN(no_row_gets_longer);
    RUN(reducing_twice_is_reducing_once);
    RUN(sheared_boxes_are_straightened);
    RUN(whole_shears_come_back_exactly);
    RUN(sharp_angles_are_opened);
    RUN(nearly_parallel_rows_are_opened);
    RUN(random_cells_are_reduced);
    RUN(three_rows_are_minkowski_reduced);
    RUN(scaling_changes_nothing);
    RUN(mixed_lengths_stay_exact);
    RUN(extreme_rows_are_survived);
    RUN(coefficients_are_taken_off_from_half_to_the_largest);
}
