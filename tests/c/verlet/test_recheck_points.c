/* SPDX-License-Identifier: BSD-3-Clause */
/* test_recheck_points.c: listed points become floats around their middle, their jumps counted off,
 * and thresholds have room for all that is rounded on the way. */
#include "../support/recheck_unit.h"

#include <math.h>

void test_recheck_points(void);

enum { N = RECHECK_POINTS };

static recheck_unit unit;

static hs_points
points_in(const double *x, int ndim)
{
    return (hs_points){x, N, ndim, HS_FLOAT64, ndim * 8, 8};
}

/* In the order of the list, from the middle of all, in steps of 4 and 8 floats, of which the last
 * has the bits of the number. */
static void
points_are_floats_around_their_middle(void)
{
    for (int d = 1; d <= 6; d++) {
        const int stride = hs_sift_stride(d);
        double    x[N * 6];
        for (int e = 0; e < N * d; e++)
            x[e] = 1000.0 + e + (double)(e % d) * 100.0;
        const hs_points points = points_in(x, d);
        recheck_unit_open(&points, NULL, 1.0, HS_WANT_J, &unit);
        CHECK(hs_recheck_prepare(&unit.recheck) == HS_OK && unit.recheck.counts == NULL);
        for (int a = 0; a < N; a++) {
            const int32_t number = N - 1 - a;
            const int     last = hs_sift_has_numbers(d) ? stride - 1 : stride;
            CHECK(last == stride ||
                  memcmp(&unit.recheck.y[a * stride + last], &number, sizeof number) == 0);
            for (int k = 0; k < last; k++) {
                const double centre = k < d ? 0.5 * (x[k] + x[(N - 1) * d + k]) : 0.0;
                const double at = k < d ? x[(N - 1 - a) * d + k] : 0.0;
                CHECK(unit.recheck.y[a * stride + k] == (float)(at - centre));
            }
        }
        const hs_thresholds exact = hs_thresholds_of(d, 1.0, (N - 1) * d, 0x1p-100);
        CHECK(unit.recheck.plain.in == exact.in && unit.recheck.plain.out == exact.out);
        recheck_unit_close(&unit);
    }
}

/* Only cutoffs far from 1 are. */
static void
tiny_and_huge_cutoffs_are_scaled(void)
{
    const int exponents[] = {-21, -20, 20, 21, 400, -400}, scaled[] = {-21, 0, 0, 21, 400, -400};
    for (int e = 0; e < 6; e++) {
        const double x[N] = {0.0, ldexp(2.0, exponents[e])}, cutoff = ldexp(1.5, exponents[e]);
        hs_points    points = points_in(x, 1);
        points.n = 2;
        recheck_unit_open(&points, NULL, cutoff, HS_WANT_J, &unit);
        CHECK(hs_recheck_prepare(&unit.recheck) == HS_OK);
        CHECK(unit.recheck.y[4] == (float)ldexp(-1.0, exponents[e] - scaled[e]));
        CHECK(unit.recheck.y[0] == (float)ldexp(1.0, exponents[e] - scaled[e]));
        const double limit =
            ldexp(1.5, exponents[e] - scaled[e]) * ldexp(1.5, exponents[e] - scaled[e]);
        CHECK(unit.recheck.plain.in < limit && unit.recheck.plain.out > limit);
        CHECK(unit.recheck.plain.in > 0.99 * limit && unit.recheck.plain.out < 1.01 * limit);
        recheck_unit_close(&unit);
    }
}

/* Counts of the list and jumps since are taken off together. */
static void
jumps_are_counted_off(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {1.0, 8.0}}};
    double       x[2 * N] = {0.0};
    for (int kind = 0; kind < 4; kind++) {
        int64_t expected[N * 2], most = 0;
        for (int i = 0; i < N; i++) {
            x[2 * i] = 0.25 * i;
            x[2 * i + 1] = 0.5 * i;
        }
        hs_points points = points_in(x, 2);
        recheck_unit_open(&points, &box, 1.0, HS_WANT_J, &unit);
        unit.list.listing.counts = kind & 1 ? unit.counts : NULL;
        unit.list.jumps_now = kind & 2 ? 1 : -1;
        unit.list.jumps[1].data = unit.jumps;
        for (int e = 0; e < N * 2; e++) {
            unit.counts[e] = 7 * e - 30;
            unit.jumps[e] = -5 * e;
        }
        for (int a = 0; a < N; a++) {
            for (int r = 0; r < 2; r++) {
                const int64_t count = (kind & 1 ? unit.counts[a * 2 + r] : 0) +
                                      (kind & 2 ? unit.jumps[(N - 1 - a) * 2 + r] : 0);
                expected[a * 2 + r] = count;
                most = count > most ? count : -count > most ? -count : most;
            }
        }
        CHECK(hs_recheck_prepare(&unit.recheck) == HS_OK);
        CHECK((unit.recheck.counts != NULL) == (kind > 0));
        CHECK(unit.recheck.most_counts == (double)most);
        for (int a = 0; kind > 0 && a < N; a++) {
            const int64_t *count = &expected[a * 2], *last = &expected[(N - 1) * 2];
            const float   *y = &unit.recheck.y[a * 4], *from = &unit.recheck.y[(N - 1) * 4];
            const double   off = (double)(count[0] - last[0]), other = (double)(count[1] - last[1]);
            CHECK(memcmp(&unit.recheck.counts[a * 2], count, 2 * sizeof *count) == 0);
            CHECK(y[0] - from[0] == (float)(x[2 * (N - 1 - a)] - 4.0 * off - other));
            CHECK(y[1] - from[1] == (float)(x[2 * (N - 1 - a) + 1] - 8.0 * other));
        }
        recheck_unit_close(&unit);
    }
}

/* Thresholds for numbers that are this large and this uncertain, as the derivation has it. */
static void
check_thresholds(double largest, double offset, double size, double error)
{
    const hs_recheck *of = &unit.recheck;
    const double      cutoff = of->given.cutoff, roundings = (2 * of->m + 2) * 0x1p-53;
    const double      more = 0x1p-24 * (largest + offset) + roundings * size;
    for (int slack = 0; slack < 2; slack++) { /* no narrower, and not much wider */
        const double        factor = slack ? 1.25 : 1.0;
        const hs_thresholds plain = hs_thresholds_of(of->d, cutoff, 2.0 * largest, factor * error);
        const hs_thresholds shifted =
            hs_thresholds_of(of->d, cutoff, 2.0 * largest + offset, factor * (error + more));
        const float sign = slack ? -1.0f : 1.0f;
        CHECK(sign * of->plain.out >= sign * plain.out && sign * of->plain.in <= sign * plain.in);
        CHECK(sign * of->shifted.out >= sign * shifted.out);
        CHECK(sign * of->shifted.in <= sign * shifted.in);
    }
}

/* Images are sums that may nearly cancel: their rounding is that of the terms. */
static void
thresholds_have_room_for_images(void)
{
    const double big = 0x1p40;
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{big, 1.0}, {-big, 3.0}}};
    const double x[2 * N] = {0.5, 0.0, -0.5, 0.0, 0.0, 0.0, 0.25, 0.5, 0.0, -0.5, 0.0, 0.25};
    hs_points    points = points_in(x, 2);
    recheck_unit_open(&points, &box, 0.75, HS_WANT_J, &unit);
    unit.images[2] = unit.images[3] = 1; /* (0, 4) */
    unit.images[4] = unit.images[5] = -2;
    CHECK(hs_recheck_prepare(&unit.recheck) == HS_OK);
    CHECK(unit.recheck.offset[0] == 0.0f && unit.recheck.offset[1] == 0.0f);
    CHECK(unit.recheck.offset[4] == 0.0f && unit.recheck.offset[5] == 4.0f);
    CHECK(unit.recheck.offset[8] == 0.0f && unit.recheck.offset[9] == -8.0f);
    CHECK(unit.recheck.offset[6] == 0.0f && unit.recheck.offset[7] == 0.0f);
    check_thresholds(0.5, 8.0, 4.0 * big, 0.0);
    recheck_unit_close(&unit);
}

/* The same for lengths of any size: coordinates are scaled, with what is counted off. */
static void
thresholds_do_not_depend_on_the_unit(void)
{
    hs_thresholds plain[2], shifted[2];
    for (int s = 0; s < 2; s++) {
        const double unit_length = s == 0 ? 1.0 : 0x1p-300;
        hs_box       box = {.ndim = 2, .periodic = {true, true}};
        double       x[2 * N];
        box.rows[0][0] = 4.0 * unit_length;
        box.rows[1][0] = unit_length;
        box.rows[1][1] = 8.0 * unit_length;
        for (int e = 0; e < 2 * N; e++)
            x[e] = 0.25 * e * unit_length;
        hs_points points = points_in(x, 2);
        recheck_unit_open(&points, &box, unit_length, HS_WANT_J, &unit);
        unit.list.listing.counts = unit.counts;
        unit.counts[0] = 3;
        unit.images[2] = 1;
        CHECK(hs_recheck_prepare(&unit.recheck) == HS_OK);
        plain[s] = unit.recheck.plain;
        shifted[s] = unit.recheck.shifted;
        recheck_unit_close(&unit);
    }
    CHECK(plain[0].in > 0.5f && shifted[0].in > 0.5f);
    CHECK(memcmp(&plain[0], &plain[1], sizeof plain[0]) == 0);
    CHECK(memcmp(&shifted[0], &shifted[1], sizeof shifted[0]) == 0);
}

/* Images so long that a float holds them to a few cutoffs: no threshold is a hair too narrow. */
static void
thresholds_have_room_for_long_images(void)
{
    const double row = 0x1.8p24;
    const hs_box box = {.ndim = 1, .periodic = {true}, .rows = {{row}}};
    const double x[N] = {0.5, -0.5, 0.25, 0.0, -0.25, 0.125};
    hs_points    points = points_in(x, 1);
    recheck_unit_open(&points, &box, 2.0, HS_WANT_J, &unit);
    unit.images[1] = 1;
    CHECK(hs_recheck_prepare(&unit.recheck) == HS_OK);
    check_thresholds(0.5, row, row, 0.0);
    recheck_unit_close(&unit);
}

/* So are counts that are taken off: of the points as they are, and of the longest entry of each box
 * vector. */
static void
thresholds_have_room_for_counts(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0, -2.0}, {0.0, 8.0}}};
    double       x[2 * N];
    for (int i = 0; i < N; i++) { /* some 2^30 of the first box vector away, all the same */
        x[2 * i] = 0x1p32 + 0.125 * i;
        x[2 * i + 1] = -0x1p31;
    }
    hs_points points = points_in(x, 2);
    recheck_unit_open(&points, &box, 0.75, HS_WANT_J, &unit);
    unit.list.listing.counts = unit.counts;
    for (int a = 0; a < N; a++)
        unit.counts[2 * a] = 1 << 30;
    CHECK(hs_recheck_prepare(&unit.recheck) == HS_OK);
    CHECK(unit.recheck.y[0] == 0.3125f && unit.recheck.y[1] == 0.0f);
    check_thresholds(0.3125, 0.0, 0.0, 8.0 * 0x1p-53 * (0x1p32 + 0x1p30 * 12.0));
    recheck_unit_close(&unit);
}

/* Points that no float holds leave nothing sure. */
static void
numbers_beyond_floats_are_never_sure(void)
{
    const double x[N] = {0x1p200, -0x1p200, 0.0, 0.0, 0.0, 1.0};
    hs_points    points = points_in(x, 1);
    recheck_unit_open(&points, NULL, 1.0, HS_WANT_J, &unit);
    CHECK(hs_recheck_prepare(&unit.recheck) == HS_OK);
    CHECK(unit.recheck.plain.in == -1.0f && unit.recheck.plain.out == INFINITY);
    CHECK(unit.recheck.shifted.in == -1.0f && unit.recheck.shifted.out == INFINITY);
    recheck_unit_close(&unit);
}

static void
any_allocation_may_be_refused(void)
{
    const hs_box box = {.ndim = 1, .periodic = {true}, .rows = {{4.0}}};
    const double x[N] = {0.0};
    for (int nth = 1; nth <= 4; nth++) {
        hs_points points = points_in(x, 1);
        recheck_unit_open(&points, &box, 1.0, HS_WANT_J, &unit);
        unit.list.listing.counts = unit.counts;
        hs_test_fail_allocation(nth);
        const hs_status status = hs_recheck_prepare(&unit.recheck);
        hs_test_fail_allocation(0);
        CHECK(status == (nth <= 3 ? HS_ERR_MEMORY : HS_OK));
        recheck_unit_close(&unit);
    }
}

void
test_recheck_points(void)
{
    RUN(points_are_floats_around_their_middle);
    RUN(tiny_and_huge_cutoffs_are_scaled);
    RUN(jumps_are_counted_off);
    RUN(thresholds_have_room_for_images);
    RUN(thresholds_do_not_depend_on_the_unit);
    RUN(thresholds_have_room_for_long_images);
    RUN(thresholds_have_room_for_counts);
    RUN(numbers_beyond_floats_are_never_sure);
    RUN(any_allocation_may_be_refused);
}
