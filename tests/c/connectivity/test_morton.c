/* SPDX-License-Identifier: BSD-3-Clause */
/* test_morton.c: slices never descend, bits come in turns, and points are put in order by them. */
#include "../../../csrc/core/connectivity/morton.h"
#include "../../../csrc/core/connectivity/space_order.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include <math.h>

void test_morton(void);

static void
slices_never_descend(void)
{
    static const double ranges[][2] = {
        {0.0, 1.0}, {-3.0, 5.0}, {-0x1.8p1023, 0x1.8p1023}, {1.0, 1.0 + 0x1p-40}, {0.0, 5e-324}};
    harness_random random = {6};
    for (int r = 0; r < 5; r++) {
        const double low = ranges[r][0], high = ranges[r][1];
        for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
            const int      bits = hs_morton_bits(ndim);
            const uint64_t last = (UINT64_C(1) << bits) - 1;
            CHECK(hs_morton_slice(low, low, high, bits) == 0);
            CHECK(hs_morton_slice(high, low, high, bits) == last);
            for (int trial = 0; trial < 100; trial++) {
                const double part = random_unit(&random);
                const double x = fmin(low * (1.0 - part) + high * part, high);
                const double y = nextafter(x, high);
                CHECK(hs_morton_slice(x, low, high, bits) <= hs_morton_slice(y, low, high, bits));
                CHECK(hs_morton_slice(y, low, high, bits) <= last);
            }
        }
    }
    CHECK(hs_morton_slice(2.0, 2.0, 2.0, 21) == 0);
    CHECK(hs_morton_slice(0.25, 0.0, 1.0, 2) == 1 && hs_morton_slice(0.75, 0.0, 1.0, 2) == 3);
}

static void
bits_come_in_turns(void)
{
    const uint64_t slices[3] = {5, 0, 2}; /* 101, 000, 010 */
    CHECK(hs_morton_interleave(slices, 3) == (1u | 1u << 6 | 1u << 5));
    CHECK(hs_morton_interleave(slices, 1) == 5);
    for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
        uint64_t all[HS_MAX_DIM], seen = 0;
        for (int k = 0; k < ndim; k++) {
            for (int b = 0; b < hs_morton_bits(ndim); b++) {
                memset(all, 0, sizeof all);
                all[k] = UINT64_C(1) << b;
                const uint64_t key = hs_morton_interleave(all, ndim);
                CHECK(key != 0 && (key & (key - 1)) == 0 && (seen & key) == 0);
                seen |= key;
            }
        }
        CHECK(seen >> 63 == 0);
    }
}

enum { POINTS = 200 };

static double x[POINTS * 3];

/* The place on the curve of a point whose coordinates are from 0 to 1, if it is finite. */
static uint64_t
key_of(const double *point)
{
    uint64_t slices[3];
    for (int k = 0; k < 3; k++)
        slices[k] = hs_morton_slice(point[k], 0.0, 1.0, hs_morton_bits(3));
    return hs_morton_interleave(slices, 3);
}

static hs_status
make_order(void *context)
{
    const hs_options options = hs_options_default();
    hs_space_order   order;
    hs_call          call;
    bool             seen[POINTS] = {false};
    uint64_t         before = 0;
    (void)context;
    (void)hs_call_enter(&options, NULL, &call);
    const hs_status status = hs_space_order_make(&call, x, POINTS, 3, &order);
    for (int p = 0; status == HS_OK && p < POINTS; p++) {
        const int32_t own = order.order[p];
        CHECK(own >= 0 && own < POINTS && !seen[own] && order.place[own] == p);
        seen[own] = true;
        if (isfinite(x[3 * own]) && isfinite(x[3 * own + 1]) && isfinite(x[3 * own + 2])) {
            CHECK(key_of(x + 3 * own) >= before);
            before = key_of(x + 3 * own);
        }
    }
    hs_space_order_free(&call.account, &order);
    CHECK(call.account.held == 0);
    hs_call_leave(&call, 0);
    hs_account_close(&call.account);
    return status;
}

static void
points_are_in_the_order_of_the_curve(void)
{
    harness_random random = {12};
    for (int k = 0; k < POINTS * 3; k++)
        x[k] = k % 17 == 0 ? 0.5 : random_unit(&random);
    for (int k = 0; k < 3; k++) { /* the corners of the box */
        x[3 * 50 + k] = 0.0;
        x[3 * 60 + k] = 1.0;
    }
    x[4] = NAN;
    x[7] = -HUGE_VAL;
    CHECK(make_order(NULL) == HS_OK);
    CHECK(fail_each_allocation(make_order, NULL, 20) == 4);
}

void
test_morton(void)
{
    RUN(slices_never_descend);
    RUN(bits_come_in_turns);
    RUN(points_are_in_the_order_of_the_curve);
}
