/* SPDX-License-Identifier: BSD-3-Clause */
/* test_strain.c: what a change of the box does to lengths is bounded for every whole vector. */
#include "../../../csrc/core/box/strain.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

void test_strain(void);

static const double origin[HS_MAX_DIM];

/* |S now|^2 >= shrink^2 |S before|^2, by integers. */
static bool
is_bounded(const hs_box *before, const hs_box *now, double shrink, const int64_t *shift)
{
    const int d = before->ndim;
    const big factor = big_product(big_from_double(shrink), big_from_double(shrink));
    const big then = big_square(d, d, before->rows, origin, origin, shift);
    const big length = big_square(d, d, now->rows, origin, origin, shift);
    const big one = big_product(big_from_double(1.0), big_from_double(1.0));
    return big_compare(big_product(length, one), big_product(factor, then)) >= 0;
}

/* Boxes of all sizes, changed a little or much, whose axes all repeat. */
static void
no_whole_vector_shrinks_more(void)
{
    static const int exponents[] = {0, 0, 0, 60, -60, 200, -400};
    harness_random   random = {6};
    int              n_found = 0, n_sharp = 0;
    for (int trial = 0; trial < 3000; trial++) {
        const int    d = 1 + trial % 4, exponent = exponents[random_below(&random, 7)];
        const double change = trial % 3 == 0 ? 1.0 : 0.01;
        hs_box       before = {.ndim = d}, now;
        hs_strain    strain;
        random_box(&random, trial % 2 ? SCENE_TRICLINIC : SCENE_SHEARED, 0, 4.0, &before);
        for (int l = 0; l < d; l++) {
            before.periodic[l] = true;
            for (int k = 0; k < d; k++) {
                before.rows[l][k] = ldexp(before.rows[l][k], exponent);
            }
        }
        now = before;
        for (int e = 0; e < d * d; e++) {
            now.rows[e / d][e % d] *= 1.0 + change * (random_unit(&random) - 0.5);
        }
        if (!hs_strain_find(&before, &now, &strain)) {
            continue;
        }
        n_found++;
        CHECK(strain.shrink > 0.0 && strain.shrink <= 1.0 && strain.residual >= 0.0);
        n_sharp += change < 1.0 && strain.shrink > 0.8;
        for (int sample = 0; sample < 8; sample++) {
            int64_t shift[HS_MAX_DIM];
            for (int l = 0; l < d; l++) {
                shift[l] = random_below(&random, 201) - 100;
            }
            CHECK(is_bounded(&before, &now, strain.shrink, shift));
        }
    }
    CHECK(n_found > 2000 && n_sharp > 1000);
}

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

static void
no_stretch_beyond_the_numbers(void)
{
    const double huge[2][HS_MAX_DIM] = {{0x1p460, 0.0}, {0.0, 0x1p460}};
    const double wide[2][HS_MAX_DIM] = {{0x1p1000, 0.0}, {0.0, 1.0}};
    const double tiny[2][HS_MAX_DIM] = {{0x1p-460, 0.0}, {0.0, 1.0}};
    const double large[2][HS_MAX_DIM] = {{0x1p440, 0.0}, {0.0, 0x1p440}};
    CHECK(hs_smallest_stretch(2, huge) == 0.0);
    CHECK(hs_smallest_stretch(2, wide) <= 1.0);
    CHECK(hs_smallest_stretch(2, tiny) <= 0x1p-460);
    const double bound = hs_smallest_stretch(2, large);
    CHECK(bound <= 0x1p440 && bound > 0x1.fffffffp439);
}

void
test_strain(void)
{
    RUN(no_whole_vector_shrinks_more);
    RUN(no_bound_beyond_the_numbers);
    RUN(no_stretch_beyond_the_numbers);
}
