/* SPDX-License-Identifier: BSD-3-Clause */
/* test_lattice.c: boxes are reduced, checked and measured, however skewed they are. */
#include "../../../csrc/core/box/lattice.h"
#include "../support/among.h"
#include "../support/bigint.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

void test_lattice(void);

/* ---- exact comparisons, exact determinants and a measure of shape ---- */

typedef double matrix[HS_MAX_DIM][HS_MAX_DIM];

/* Whether entry c of row k is as close to that of U A as it is said to be. Exact. */
static bool
is_within_error(const hs_lattice *r, matrix a, int k, int c)
{
    big difference = big_negated(big_from_double(r->rows[k][c]));
    for (int l = 0; l < r->n_periodic; l++) {
        if (r->U[k][l] != 0 && a[l][c] != 0.0) {
            difference = big_sum(difference,
                                 big_product(big_from_int(r->U[k][l]), big_from_double(a[l][c])));
        }
    }
    big error = big_from_double(r->row_error[k]);
    return big_compare_magnitude(&difference, &error) <= 0;
}

/* Whether the determinant is 1 or -1, by minors of the first rows in all sets of columns. */
static bool
is_unimodular(const hs_lattice *r)
{
    static big minors[1 << HS_MAX_DIM];
    const int  n = r->n_periodic;
    const big  one = big_from_int(1);
    minors[0] = one;
    for (unsigned columns = 1; columns < 1u << n; columns++) {
        int row = -1, sign = 1;
        for (int c = 0; c < n; c++)
            row += columns >> c & 1;
        minors[columns] = big_from_int(0);
        for (int c = n - 1; c >= 0; c--) {
            if (columns >> c & 1) {
                const big entry = big_from_int(sign * r->U[row][c]);
                const big term = big_product(entry, minors[columns & ~(1u << c)]);
                minors[columns] = big_sum(minors[columns], term);
                sign = -sign;
            }
        }
    }
    return big_compare_magnitude(&minors[(1u << n) - 1], &one) == 0;
}

/* Product of the lengths over the volume: 1 when orthogonal. */
static double
defect_of(int ndim, int n, matrix rows)
{
    matrix star;
    double defect = 1.0;
    for (int k = 0; k < n; k++) {
        double length2 = 0.0, height2 = 0.0, largest = 0.0;
        for (int c = 0; c < ndim; c++) {
            largest = fmax(largest, fabs(rows[k][c]));
        }
        for (int c = 0; c < ndim; c++) {
            star[k][c] = rows[k][c] / largest;
            length2 += star[k][c] * star[k][c];
        }
        for (int j = 0; j < 2 * k; j++) { /* twice is enough (Kahan) */
            double along = 0.0;
            for (int c = 0; c < ndim; c++) {
                along += star[k][c] * star[j % k][c];
            }
            for (int c = 0; c < ndim; c++) {
                star[k][c] -= along * star[j % k][c];
            }
        }
        for (int c = 0; c < ndim; c++) {
            height2 += star[k][c] * star[k][c];
        }
        for (int c = 0; c < ndim; c++) {
            star[k][c] /= sqrt(height2);
        }
        defect *= sqrt(length2 / height2);
    }
    return defect;
}

/* ---- reduced bases are bases of the same lattice, exactly, and they are short ---- */

/* n periodic rows of ndim. */
static hs_box
box_of(int ndim, int n, matrix a)
{
    hs_box box = {.ndim = ndim};
    for (int l = 0; l < n; l++) {
        box.periodic[l] = true;
        memcpy(box.rows[l], a[l], sizeof box.rows[l]);
    }
    return box;
}

/* What is promised of every result, however odd the rows are. */
static hs_lattice
reduce_and_check(int ndim, int n, matrix a)
{
    const hs_box box = box_of(ndim, n, a);
    hs_lattice   r;
    bool         identity = true;
    memset(&r, 0xff, sizeof r);
    hs_lattice_init(&box, ndim, hs_scale_of(0), &r);
    CHECK(r.n_periodic == n);
    for (int k = 0; k < n; k++) {
        for (int l = 0; l < n; l++) {
            CHECK(r.U[k][l] <= INT64_C(1) << 61 && r.U[k][l] >= -(INT64_C(1) << 61));
            identity = identity && (r.U[k][l] == (k == l) || r.U[k][l] == -(k == l));
        }
        CHECK(r.row_error[k] >= 0.0);
        for (int c = 0; c < ndim; c++) {
            CHECK(isfinite(r.rows[k][c]));
            CHECK(is_within_error(&r, a, k, c));
        }
    }
    CHECK(r.reduced == !identity);
    CHECK(is_unimodular(&r));
    return r;
}

static double
random_between(harness_random *random, double low, double high)
{
    return low + (high - low) * random_unit(random);
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
        {{0, 0, 0}, {1, 1e-300, 0}, {1, 1, 0}}, /* against the rules: dependent */
        {{1, 2, 3}, {3, 2, 1}, {4, 4, 4}},
    };
    for (int k = 0; k < 9; k++) {
        matrix a = {{0.0}};
        for (int c = 0; c < 9; c++) {
            a[c / 3][c % 3] = cells[k][c / 3][c % 3];
        }
        hs_lattice r = reduce_and_check(3, 3, a);
        CHECK(k < 3 || k > 4 || defect_of(3, 3, r.rows) < 1.4143);
        CHECK(k != 4 || (r.rows[1][1] == 1e-300 && r.rows[2][2] == 5e-324));
    }
}

/* Four rows of a unit box, the second with so much of the first. */
static hs_lattice
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
            const hs_lattice r = reduce_leaning(sign * left[e]);
            CHECK(!r.reduced);
        }
        for (int e = 0; e < 4; e++) {
            const hs_lattice r = reduce_leaning(sign * taken[e]);
            const double     whole = fmax(1.0, floor(taken[e]));
            CHECK(r.reduced && r.rows[1][0] == sign * (taken[e] - whole) && r.rows[1][1] == 1.0);
            CHECK(r.U[1][0] == -sign * (int64_t)whole);
        }
        CHECK(!reduce_leaning(sign * 0x1.0000000000001p61).reduced);
    }
}

/* ---- independence is decided for the numbers given, not for rounded determinants ---- */

static bool
independent(int ndim, int n, matrix a)
{
    const hs_box box = box_of(ndim, n, a);
    hs_failure   failure;
    return hs_box_check(&box, &failure) == HS_OK;
}

/* The last row is the sum of the others, and entries of a row differ by up to 2^1007. */
static void
sums_of_far_magnitudes_are_dependent(void)
{
    for (int exponent = 0; exponent < 1000; exponent += IS_SLOW ? 7 : 1) {
        const double one = ldexp(1.0, exponent), other = ldexp(256.0, exponent);
        matrix       a = {{1.0, other, 1.0}, {1.0, one, 3.0}, {2.0, one + other, 4.0}};
        CHECK(!independent(3, 3, a));
        a[2][1] = nextafter(a[2][1], INFINITY);
        CHECK(independent(3, 3, a));
    }
}

/* Multiples of the first prime, which are zero modulo it, of either sign. */
static void
multiples_of_a_prime_are_no_zeros(void)
{
    for (int sign = -1; sign <= 1; sign += 2) {
        const double p = sign * 0x7fffffffp0;
        CHECK(independent(2, 2, (matrix){{p, 1.0}, {0.0, 1.0}}));
        CHECK(!independent(2, 2, (matrix){{p, 2.0 * p}, {1.0, 2.0}}));
    }
}

/*
 * ---- box skew ----
 *
 * Boxes that are equivalent to an upright one, by so many of its vectors that shifts over the
 * vectors as given pass int32, 2^53 and int64: the same pairs, or a status that says so.
 */

enum { N = 12 };

/* Rows (1, 0) and (times + tilt, 1), which is a combination of (1, 0) and (tilt, 1). */
static hs_box
skewed(double times, double tilt)
{
    return (hs_box){.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {times + tilt, 1.0}}};
}

static void
make_points(harness_random *random, double *x)
{
    for (int e = 0; e < 2 * N; e++)
        x[e] = random_unit(random) - 0.5;
}

static bool
is_refusal(hs_status status)
{
    return status == HS_ERR_SHIFT_RANGE || status == HS_ERR_BOX_SKEWED;
}

/* Sorted by (i, j); within an ulp or two, for the vectors are those of other numbers. */
static bool
same_pairs(const found_pairs *a, const found_pairs *b)
{
    bool same = a->n == b->n;
    for (int64_t e = 0; same && e < a->n; e++)
        same = a->i[e] == b->i[e] && a->j[e] == b->j[e];
    return same;
}

/* What needs no S is found; S is right where it fits. */
static void
check_pairs(const brute_scene *scene, const hs_box *upright, double times, bool sorted)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    found_pairs     found = {0}, expected = {0};
    hs_failure      failure;
    int64_t         count = -1, expected_count = -2;
    CHECK(hs_pairs_count(AMONG(&points, upright), &options, &expected_count, NULL) == HS_OK);
    const hs_status counted =
        hs_pairs_count(AMONG(&points, scene->box), &options, &count, &failure);
    CHECK(counted == HS_OK ? count == expected_count : is_refusal(counted));
    options.sorted = sorted;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR;
    hs_status status = search_pairs(&points, scene->box, &options, &found, &failure);
    CHECK(status == HS_OK || is_refusal(status));
    CHECK(search_pairs(&points, upright, &options, &expected, NULL) == HS_OK);
    CHECK(status != HS_OK || found.n == expected.n);
    CHECK(status != HS_OK || !sorted || same_pairs(&found, &expected));
    found_free(&found);
    found_free(&expected);
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
    options.sorted = true;
    status = search_pairs(&points, scene->box, &options, &found, &failure);
    CHECK(search_pairs(&points, upright, &options, &expected, NULL) == HS_OK);
    bool fits = true, right = true;
    for (int64_t e = 0; e < expected.n; e++) {
        const double first = expected.shift[2 * e] - times * expected.shift[2 * e + 1];
        fits = fits && first >= INT32_MIN && first <= INT32_MAX;
    }
    CHECK(fits ? status == HS_OK || is_refusal(status) : is_refusal(status));
    CHECK(status != HS_OK || found.n == expected.n);
    for (int64_t e = 0; status == HS_OK && e < found.n; e++)
        right = right && fabs(found.shift[2 * e] + times * found.shift[2 * e + 1]) < 64.0;
    CHECK(right);
    found_free(&found);
    found_free(&expected);
}

static void
check_rows(const brute_scene *scene, const hs_box *upright)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    hs_pairs       *rows = NULL, *expected = NULL;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    for (int queries = 0; queries < 2; queries++) {
        const hs_points *asking = queries ? &points : NULL;
        hs_status        status =
            hs_neighbors_find(QUERIED(&points, asking, scene->box), &options, &rows, NULL);
        CHECK(status == HS_OK || is_refusal(status));
        if (status == HS_OK) {
            CHECK(hs_neighbors_find(QUERIED(&points, asking, upright), &options, &expected, NULL) ==
                  HS_OK);
            CHECK(same_array(rows, expected, HS_WANT_J, 8));
            hs_pairs_free(expected);
        }
        hs_pairs_free(rows);
        status = hs_nearest_find(QUERIED(&points, asking, scene->box), 70, &options, &rows, NULL);
        CHECK(status == HS_OK || is_refusal(status));
        if (status == HS_OK) {
            CHECK(hs_nearest_find(QUERIED(&points, asking, upright), 70, &options, &expected,
                                  NULL) == HS_OK);
            CHECK(same_array(rows, expected, HS_WANT_J, 8));
            hs_pairs_free(expected);
        }
        hs_pairs_free(rows);
    }
}

static void
equivalent_boxes_have_the_same_pairs(void)
{
    harness_random random = {1};
    double         x[2 * N];
    for (int trial = 0; trial < 4; trial++) {
        const double tilt = trial % 2 ? 0.375 : 0.0;
        const hs_box upright = skewed(0.0, tilt);
        make_points(&random, x);
        for (int i = 0; i < N && trial & 1; i++) /* turned by up to 20 vectors */
            x[2 * i + 1] += random_below(&random, 41) - 20.0;
        for (int exponent = 1; exponent <= 62; exponent += exponent < 48 ? 5 : 1) {
            const double times = ldexp(trial < 2 ? 1.0 : -1.0, exponent);
            const hs_box box = skewed(times, tilt);
            if (box.rows[1][0] - times != tilt)
                continue;
            brute_scene scene = {.ndim = 2, .n = N, .x = x, .box = &box, .inclusive = true};
            scene.cutoff = trial % 3 ? 1.25 : 4.5;
            check_pairs(&scene, &upright, times, trial & 1);
            check_rows(&scene, &upright);
        }
    }
}

/* Each is within a unit in the last place of the same number. */
static bool
same_distances(const hs_pairs *a, const hs_pairs *b)
{
    const double *one = hs_pairs_array(a, HS_WANT_DISTANCE);
    const double *other = hs_pairs_array(b, HS_WANT_DISTANCE);
    bool          same = hs_pairs_length(a) == hs_pairs_length(b);
    for (int64_t e = 0; same && e < hs_pairs_length(a); e++)
        same = one[e] == other[e] ||
               fabs(one[e] - other[e]) <= 2.0 * (nextafter(one[e], INFINITY) - one[e]);
    return same;
}

/* Shifts beyond 2^53, which batch kernels do not take: points that are so many vectors apart. */
static void
shifts_beyond_float64(void)
{
    enum { MANY = 60 };
    harness_random random = {7};
    double         x[2 * MANY];
    for (int trial = 0; trial < 12; trial++) {
        const double    tilt = 0.125, times = trial % 2 ? 0x1p49 : -0x1p49;
        const hs_box    box = skewed(times, tilt), upright = skewed(0.0, tilt);
        brute_scene     scene = {.ndim = 2, .n = MANY, .x = x, .box = &box, .inclusive = true};
        const hs_points points = points_of(&scene);
        scene.cutoff = trial % 3 ? 1.25 : 0.25;
        for (int i = 0; i < MANY; i++) {
            x[2 * i] = 0.25 * random_below(&random, 8);
            x[2 * i + 1] = 0.25 * random_below(&random, 8) + 1000.0 * (i % 3 - 1);
        }
        for (int full = 0; full < 2; full++) {
            hs_options options = options_of(&scene);
            hs_pairs  *skew = NULL, *expected = NULL;
            options.want = HS_WANT_J | HS_WANT_DISTANCE;
            for (int of = 0; of < 2; of++) {
                const hs_box   *in = of ? &box : &upright;
                hs_pairs      **rows = of ? &skew : &expected;
                const hs_status status =
                    full ? hs_neighbors_find(AMONG(&points, in), &options, rows, NULL)
                         : hs_nearest_find(AMONG(&points, in), 25, &options, rows, NULL);
                CHECK(status == HS_OK);
            }
            CHECK(same_array(skew, expected, HS_WANT_J, 8));
            /* Images of one point are in the order of their shifts, which are others. */
            CHECK(full || same_distances(skew, expected));
            hs_pairs_free(skew);
            hs_pairs_free(expected);
        }
    }
}

/* Each point is within the range, and their difference is not. */
static void
differences_pass_the_range(void)
{
    double x[8] = {0.0, 0x1.8p16, 0.0, -0x1.8p16, 0.25, 0x1.8p16, 0.25, -0x1.8p16};
    for (int trial = 0; trial < 3; trial++) {
        const hs_box    box = skewed(0x1p45, trial == 2 ? 0.0 : 0.125);
        brute_scene     scene = {.ndim = 2, .n = 4, .x = x, .box = &box, .cutoff = 0.75};
        const hs_points points = points_of(&scene);
        hs_options      options = options_of(&scene);
        hs_pairs       *rows = NULL;
        hs_failure      failure;
        int64_t         count = -1;
        options.cutoff = trial == 1 ? 0.25 : 0.75; /* 1: some pairs are exactly as far */
        options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
        hs_status status = hs_pairs_find(AMONG(&points, &box), &options, &rows, &failure);
        CHECK(status == HS_OK ? hs_pairs_length(rows) == 6 : is_refusal(status));
        hs_pairs_free(rows);
        status = hs_pairs_count(AMONG(&points, &box), &options, &count, &failure);
        CHECK(status == HS_OK ? count == 6 : is_refusal(status));
        for (int64_t k = 1; k < 200; k = 3 * k + 1) {
            options.cutoff = k == 4 ? 0.25 : INFINITY;
            options.want = HS_WANT_J | HS_WANT_DISTANCE;
            status = hs_nearest_find(AMONG(&points, &box), k, &options, &rows, &failure);
            CHECK(status == HS_OK || is_refusal(status));
            CHECK(trial == 2 || status != HS_OK);
            hs_pairs_free(rows);
        }
    }
}

/* Independent vectors whose heights are nothing beside their lengths, which no reduction helps. */
static void
nearly_flat_boxes(void)
{
    harness_random random = {3};
    double         x[3 * N];
    for (int trial = 0; trial < 200; trial += IS_SLOW ? 5 : 1) { /* 5: all kinds */
        const int   e = random_below(&random, 110), f = random_below(&random, 110);
        hs_box      box = {.ndim = 3, .periodic = {true, true, trial % 3 != 0}};
        brute_scene scene = {.ndim = 3, .n = 6, .x = x, .box = &box, .inclusive = true};
        brute_list  expected;
        for (int l = 0; l < 3; l++) {
            for (int k = 0; k < 3; k++)
                box.rows[l][k] = l == k               ? ldexp(1.0, l == 0   ? 0
                                                                   : l == 1 ? -e
                                                                            : -f)
                                 : k < l || trial % 2 ? random_unit(&random)
                                                      : 0.0;
        }
        for (int k = 0; k < 3 * 6; k++)
            x[k] = random_unit(&random);
        scene.cutoff = 0.5;
        const hs_points points = points_of(&scene);
        hs_options      options = options_of(&scene);
        int64_t         count = -1;
        options.memory_limit = 1e8;
        if (!brute_find(&scene, 1e5, &expected)) {
            hs_plan plan; /* more pairs than are counted here: not refused, or for a reason */
            (void)hs_plan_make(AMONG(&points, &box), &options, &plan, NULL);
            continue;
        }
        const hs_status status = hs_pairs_count(AMONG(&points, &box), &options, &count, NULL);
        CHECK(status == HS_OK ? count == expected.n
                              : status == HS_ERR_BOX_SKEWED || status == HS_ERR_BOX_DEPENDENT);
        brute_free(&expected);
    }
}

/* ---- what a change of the box does to lengths is bounded for every whole vector ---- */

static bool
has_bound(double a, double b, double c, double d, double scale)
{
    const hs_box before = {.ndim = 2, .periodic = {true, true}, .rows = {{a, b}, {c, d}}};
    hs_box       now = before;
    hs_strain    strain;
    for (int e = 0; e < 4; e++) {
        now.rows[e / 2][e % 2] *= scale;
    }
    return hs_strain_find(&before, &now, &strain);
}

/* Nothing is said where a bound would be lost among roundings, or passes the numbers. */
static void
no_bound_beyond_the_numbers(void)
{
    CHECK(has_bound(1.0, 0.0, 0.5, 1.0, 1.5));
    CHECK(has_bound(1.0, 0.0, 0x1p20, 1.0, 1.0));
    CHECK(!has_bound(1.0, 0.0, 0x1p60, 1.0, 1.0));       /* no inverse in float64 */
    CHECK(!has_bound(1.0, 0.0, 0x1p600, 0x1p-600, 1.0)); /* of no height */
    CHECK(!has_bound(0x1p-1074, 0.0, 0.0, 0x1p-1074, 0.0));
    CHECK(!has_bound(0x1p-1000, 0.0, 0.0, 0x1p-1000, 0x1p500));
    CHECK(!has_bound(0x1p-600, 0.0, 0x1p-600, 0x1p-600, 0x1p1000));
    CHECK(!has_bound(0x1p-1000, 0x1p-1000, 0x1p-1000, -0x1p-1000, 0x1p1023));
}

void
test_lattice(void)
{
    RUN(mixed_lengths_stay_exact);
    RUN(extreme_rows_are_survived);
    RUN(coefficients_are_taken_off_from_half_to_the_largest);
    RUN(sums_of_far_magnitudes_are_dependent);
    RUN(multiples_of_a_prime_are_no_zeros);
    RUN(equivalent_boxes_have_the_same_pairs);
    RUN(shifts_beyond_float64);
    RUN(differences_pass_the_range);
    RUN(nearly_flat_boxes);
    RUN(no_bound_beyond_the_numbers);
}
