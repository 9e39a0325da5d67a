/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_metric_hair.c: differences with components so small that their squares underflow, beside one
 * that is the cutoff or a hair less or more: decided as big integers say.
 */
#include "../../../csrc/core/exact/metric.h"
#include "../support/bigint.h"
#include "../support/harness.h"

#include <math.h>

void test_metric_hair(void);

static int
true_sign(const double *p, const double *q, double cutoff)
{
    static const double rows[8][8];
    const big           r = big_from_double(cutoff);
    return big_compare(big_square(2, 0, rows, p, q, (const int64_t[8]){0}), big_product(r, r));
}

static void
hairs_beside_the_cutoff(void)
{
    const double hairs[] = {0.0,     5e-324,  0x1p-1000, 0x1p-600, 0x1p-540, 0x1p-400,
                            0x1p-80, 0x1p-65, 0x1p-64,   0x1p-63,  0x1p-55,  0x1p-30};
    hs_stages    stages = {0};
    int          wrong = 0, signs[3] = {0};
    for (int trial = 0; trial < 12 * 12 * 12 * 3; trial++) {
        const double off = hairs[trial % 12], hair = hairs[trial / 12 % 12];
        const double last = hairs[trial / 144 % 12];
        const double cutoff = trial / 1728 == 2 ? 0x1.8p300 : 1.0;
        const double side = trial / 1728 == 1 ? nextafter(cutoff, 0.0) : cutoff;
        for (int turn = 0; turn < 4; turn++) {
            /* (side -+ off, hair -+ last): what p takes from it need not fit one float64. */
            const double p[2] = {turn & 1 ? off : -off, turn & 2 ? last : -last};
            const double q[2] = {side, hair};
            const int    sign = true_sign(p, q, cutoff);
            for (int inclusive = 0; inclusive < 2; inclusive++) {
                hs_metric metric;
                hs_metric_init(&metric, 2, 0, NULL, cutoff, inclusive);
                wrong += hs_metric_within(&metric, p, q, NULL, &stages) !=
                         (sign < 0 || (sign == 0 && inclusive));
            }
            signs[sign + 1]++;
        }
    }
    CHECK(wrong == 0);
    CHECK(signs[0] > 100 && signs[1] > 10 && signs[2] > 100);
}

/* (1 + 2^-52)^2 = 1^2 + (2^-26)^2 + (2^-26)^2 + (2^-52)^2: less than that by so little that only
 * the hair, or nothing but integers, can tell. */
static void
sums_a_little_below_the_cutoff(void)
{
    const double fourths[] = {0.0,
                              0x1p-52,
                              0x1p-52 * (1.0 - 0x1p-20),
                              0x1p-52 * (1.0 - 0x1p-40),
                              0x1p-52 * (1.0 + 0x1p-40),
                              0x1p-53};
    const double fifths[] = {0.0, 5e-324, 0x1p-600, 0x1p-540, 0x1p-120, 0x1p-70};
    const double cutoff = 1.0 + 0x1p-52;
    hs_stages    stages = {0};
    int          wrong = 0;
    for (int trial = 0; trial < 72; trial++) {
        static const double rows[8][8];
        const double        p[5] = {0.0};
        const double q[5] = {1.0, 0x1p-26, -0x1p-26, fourths[trial / 2 % 6], fifths[trial / 12]};
        const big    r = big_from_double(cutoff);
        const int    sign =
            big_compare(big_square(5, 0, rows, p, q, (const int64_t[8]){0}), big_product(r, r));
        hs_metric metric;
        hs_metric_init(&metric, 5, 0, NULL, cutoff, trial & 1);
        wrong += hs_metric_within(&metric, p, q, NULL, &stages) !=
                 (sign < 0 || (sign == 0 && (trial & 1)));
    }
    CHECK(wrong == 0);
}

/* The fixed formula of precision="double", with and without rows. */
static void
double_takes_one_comparison(void)
{
    static const double rows[8][8] = {{3.0, 0.0}, {0.0, 4.0}};
    const double        p[2] = {0.5, 0.25}, q[2] = {3.5, 4.25};
    const int64_t       back[8] = {-1, -1};
    hs_metric           open, periodic;
    for (int inclusive = 0; inclusive < 2; inclusive++) {
        hs_metric_init(&open, 2, 0, NULL, 5.0, inclusive);
        CHECK(hs_metric_within_double(&open, p, q, NULL) == inclusive);
        CHECK(hs_metric_within_double(&open, p, q, back) == inclusive);
        hs_metric_init(&periodic, 2, 2, rows, 5.0, inclusive);
        CHECK(hs_metric_within_double(&periodic, p, q, NULL) == inclusive);
        CHECK(hs_metric_within_double(&periodic, p, q, back));
    }
}

void
test_metric_hair(void)
{
    RUN(hairs_beside_the_cutoff);
    RUN(sums_a_little_below_the_cutoff);
    RUN(double_takes_one_comparison);
}
