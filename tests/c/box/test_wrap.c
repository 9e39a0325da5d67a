/* SPDX-License-Identifier: BSD-3-Clause */
/* test_wrap.c: wrapped coordinates against big integers: nothing may get lost, however far away. */
#include <float.h>

#include "../../../csrc/core/box/wrap.h"
#include "../support/bigint.h"
#include "../support/harness.h"
#include "../support/random_scenes.h"

void test_wrap(void);

/* Whether a is an integer times b > 0: long division by doubling. */
static bool
is_multiple(big a, big b)
{
    a.sign = a.sign != 0;
    for (int doubled = 32 * (a.n - b.n) + 32; doubled >= 0; doubled--) {
        const big many = big_product(b, big_from_bits(1, doubled, 1));
        if (big_compare_magnitude(&many, &a) <= 0)
            a = big_difference(a, many);
    }
    return a.sign == 0;
}

static bool
is_half_at_most(double x, double length)
{
    const big x2 = big_product(big_from_int(2), big_from_double(x)), l = big_from_double(length);
    return big_compare_magnitude(&x2, &l) <= 0;
}

/* x lies `boxes` lengths out, give or take; some exactly on faces and halves. */
static double
far_coordinate(harness_random *random, double length, double boxes)
{
    const double whole = floor(boxes * random_unit(random));
    double       x = whole * length;
    switch (random_bits(random) % 4) {
    case 0: break;
    case 1: x += 0.5 * length; break;
    default: x += length * random_unit(random);
    }
    for (int step = (int)(random_bits(random) % 5) - 2; step != 0; step += step < 0 ? 1 : -1)
        x = nextafter(x, step < 0 ? -INFINITY : INFINITY);
    return random_bits(random) & 1 ? x : -x;
}

static void
axis_is_exact_up_to_the_limit(void)
{
    harness_random random = {1618};
    for (int trial = 0; trial < 20000; trial++) {
        const int    exponent = (int)(random_bits(&random) % 40) - 20;
        const double length = ldexp(0.5 + 0.5 * random_unit(&random), exponent);
        const double x = far_coordinate(&random, length, ldexp(1.0, trial % 51));
        int64_t      turns;
        const double inside = hs_wrap_axis(x, length, &turns);
        CHECK(turns != HS_WRAP_UNKNOWN);
        const big moved = big_product(big_from_int(turns), big_from_double(length));
        CHECK(big_compare(big_sum(big_from_double(inside), moved), big_from_double(x)) == 0);
        CHECK(is_half_at_most(inside, length));
    }
}

static void
axis_is_exact_beyond_the_limit(void)
{
    harness_random random = {2718};
    for (int trial = 0; trial < 2000; trial++) {
        const int    exponent = (int)(random_bits(&random) % 1500) - 800;
        const int    orders = (int)(random_bits(&random) % 200) + 52;
        const double length = ldexp(0.5 + 0.5 * random_unit(&random), exponent);
        const double most = 1.5 + 0.4 * random_unit(&random);
        const double x = ldexp(random_bits(&random) & 1 ? most : -most, ilogb(length) + orders);
        int64_t      turns;
        const double inside = hs_wrap_axis(x, length, &turns);
        const big    off = big_difference(big_from_double(x), big_from_double(inside));
        CHECK(turns == HS_WRAP_UNKNOWN);
        CHECK(is_half_at_most(inside, length));
        CHECK(is_multiple(off, big_from_double(length)));
    }
}

static void
axis_handles_faces_and_extremes(void)
{
    /* Three times the last but one is more than DBL_MAX, which is 2.6 times it. */
    static const double lengths[] = {
        1.0, 3.0, 0.1, 0x1p-900, 0x1.fffffffffffffp+900, 7e22, DBL_MAX / 2.6, 0x1.23p-1060};
    for (size_t l = 0; l < sizeof lengths / sizeof lengths[0]; l++) {
        const double length = lengths[l], half = 0.5 * length;
        const double at[] = {0.0,
                             -0.0,
                             half,
                             -half,
                             length,
                             -length,
                             1.5 * length,
                             -1.5 * length,
                             nextafter(half, INFINITY),
                             nextafter(-half, -INFINITY),
                             nextafter(length, 0.0),
                             nextafter(1.5 * length, INFINITY),
                             DBL_MAX,
                             -DBL_MAX,
                             0x1p-1074,
                             -0x1p-1074,
                             7.0 * half,
                             1234567.8 * half};
        for (size_t e = 0; e < sizeof at / sizeof at[0]; e++) {
            int64_t turns;
            if (isinf(at[e]))
                continue;
            const double inside = hs_wrap_axis(at[e], length, &turns);
            CHECK(is_half_at_most(inside, length));
            if (turns != HS_WRAP_UNKNOWN) {
                const big moved = big_product(big_from_int(turns), big_from_double(length));
                CHECK(big_compare(big_sum(big_from_double(inside), moved),
                                  big_from_double(at[e])) == 0);
            }
        }
    }
}

/* r - w B, exactly, in units of 2^-1074. */
static big
true_inside(const hs_lattice *lattice, const double *r, const int64_t *turns, int k)
{
    big sum = big_from_double(r[k]);
    for (int b = 0; b < lattice->n_periodic; b++) {
        for (int l = 0; l < lattice->n_periodic; l++) {
            const big times = big_product(big_from_int(turns[b]), big_from_int(lattice->U[b][l]));
            sum = big_difference(sum, big_product(times, big_from_double(lattice->scaled[l][k])));
        }
    }
    return sum;
}

static void
point_is_within_its_error_bound(void)
{
    harness_random      random = {1414};
    static random_scene s;
    int                 wrapped = 0;
    for (int trial = 0; trial < 3000; trial++) {
        const double spread = ldexp(1.0, 2 + trial % 28);
        hs_lattice   lattice;
        make_scene(&random, SCENE_MIXED + trial % 3, 2 + trial % 3, 1, spread, 0, &s);
        for (int k = 0; k < s.scene.ndim; k++)
            s.x[k] = ldexp(s.x[k], random_below(&random, 18));
        if (hs_box_check(&s.box, NULL) != HS_OK)
            continue;
        hs_lattice_init(&s.box, s.scene.ndim, hs_scale_of(0), &lattice);
        double  inside[HS_MAX_DIM], magnitude = 0.0;
        int64_t turns[HS_MAX_DIM];
        CHECK(hs_wrap_point(&lattice, s.x, inside, turns, &magnitude));
        for (int k = 0; k < s.scene.ndim; k++)
            CHECK(magnitude >= fabs(s.x[k]));
        const double terms = 2 * lattice.n_periodic + 2;
        for (int k = 0; k < s.scene.ndim; k++) {
            const double bound = 0x1p-53 * fabs(inside[k]) + terms * terms * 0x1p-104 * magnitude;
            big          off =
                big_difference(true_inside(&lattice, s.x, turns, k), big_from_double(inside[k]));
            big most = big_from_double(bound);
            CHECK(big_compare_magnitude(&off, &most) <= 0);
        }
        for (int k = 0; k < s.scene.ndim; k++) {
            double t = 0.0, sizes = 0.0;
            for (int c = 0; c < s.scene.ndim; c++) {
                t += lattice.normal[k][c] * inside[c];
                sizes += fabs(inside[c]);
            }
            if (lattice.row_of_axis[k] >= 0)
                CHECK(fabs(t) <= 0.5 * lattice.period[k] + 0x1p-45 * (sizes + lattice.period[k]));
        }
        wrapped++;
    }
    CHECK(wrapped > 2000);
}

static void
points_beyond_the_limit_are_told(void)
{
    hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.25}, {0.0, 1.0}}};
    hs_lattice lattice;
    hs_lattice_init(&box, 2, hs_scale_of(0), &lattice);
    for (int exponent = 40; exponent < 1024; exponent++) {
        const double r[2] = {0x1p-2, ldexp(1.1, exponent)};
        double       inside[2], magnitude = 0.0;
        int64_t      turns[2];
        const bool   told = hs_wrap_point(&lattice, r, inside, turns, &magnitude);
        CHECK(exponent > 51 ? !told : exponent < 50 ? told : true);
    }
}

/* A lattice whose period is not that of its row: every pass finds turns anew, and what is left
 * after the last one is the point less as many rows. */
static void
what_does_not_settle_is_as_many_rows_away(void)
{
    hs_lattice lattice;
    memset(&lattice, 0, sizeof lattice);
    lattice.ndim = lattice.n_periodic = 1;
    lattice.scaled[0][0] = lattice.rows[0][0] = lattice.normal[0][0] = 1.0;
    lattice.U[0][0] = 1;
    for (int trial = 0; trial < 2; trial++) {
        const double r = 0.75 + trial;
        double       inside = NAN, magnitude = 0.0;
        int64_t      turns = -1;
        lattice.period[0] = 0.375;
        CHECK(hs_wrap_point(&lattice, &r, &inside, &turns, &magnitude));
        CHECK(turns != 0 && inside == r - (double)turns && fabs(inside) > 0.5);
        CHECK(magnitude >= fabs(r) + fabs((double)turns));
        lattice.period[0] = 1.0;
        CHECK(hs_wrap_point(&lattice, &r, &inside, &turns, &magnitude));
        CHECK(inside == r - (double)turns && fabs(inside) <= 0.5);
    }
}

/* Of parts that are joined in any order, the lowest point that failed. */
static void
the_lowest_failure_is_told(void)
{
    const int64_t failed[4] = {-1, 0, 3, 5};
    for (int a = 0; a < 4; a++) {
        for (int b = 0; b < 4; b++) {
            hs_folded       joined = hs_folded_none();
            const hs_folded none = hs_folded_none();
            hs_folded       parts[2] = {none, none};
            parts[0].failed = failed[a];
            parts[1].failed = failed[b];
            hs_folded_join(&joined, &parts[0]);
            hs_folded_join(&joined, &parts[1]);
            CHECK(joined.failed == (a == 0 || b == 0 ? failed[a + b] : failed[a < b ? a : b]));
        }
    }
}

/* The magnitude is that of all numbers that went in, also of a point that stays where it is. */
static void
points_that_stay_have_a_magnitude(void)
{
    const hs_box box = {.ndim = 2, .rows = {{4.0, 1.0}}, .periodic = {true, false}};
    const double r[2] = {0.5, -300.0};
    double       inside[2], magnitude = 0.0;
    int64_t      turns;
    hs_lattice   lattice;
    hs_lattice_init(&box, 2, hs_scale_of(0), &lattice);
    const double along = r[0] * 4.0 + r[1];
    CHECK(fabs(along) > 8.5); /* so that this one moves */
    CHECK(hs_wrap_point(&lattice, r, inside, &turns, &magnitude) && magnitude >= 300.0);
    const double near_zero[2] = {0.5, 0.25};
    magnitude = 0.0;
    CHECK(hs_wrap_point(&lattice, near_zero, inside, &turns, &magnitude));
    CHECK(turns == 0 && magnitude == 0.5);
}

void
test_wrap(void)
{
    RUN(points_that_stay_have_a_magnitude);
    RUN(the_lowest_failure_is_told);
    RUN(what_does_not_settle_is_as_many_rows_away);
    RUN(axis_is_exact_up_to_the_limit);
    RUN(axis_is_exact_beyond_the_limit);
    RUN(axis_handles_faces_and_extremes);
    RUN(point_is_within_its_error_bound);
    RUN(points_beyond_the_limit_are_told);
}
