/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_support_scans.c: the scans of every kernel of this CPU that compare |N D|, against a plain
 * loop, with small integers, which no rounding changes: the same hits, and the same unsure ones.
 * What is not a number makes an unsure hit.
 */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include <math.h>

#include "../support/scan_checks.h"

void test_support_scans(void);

enum { SHORT_BLOCK = 3 * 32 + 2, NUMBERS = HS_SUPPORT_ENTRIES + 1 };

static numbers scene;

/* The supports of a scene; those past the last candidate are NaN. */
typedef struct scan_supports {
    hs_rule       rule;
    hs_limit_form form;
    float         of_point[HS_GROUP_POINTS * NUMBERS];
    float         of_block[NUMBERS][HS_BLOCK_CANDIDATES + HS_PADDING];
} scan_supports;

static scan_supports supports;

static const hs_rule rules[] = {HS_RULE_MAX, HS_RULE_MIN, HS_RULE_GATHER, HS_RULE_SCATTER};

/* Thresholds are (size - 1)^2 and (size + 1)^2, of whole numbers. */
static void
fill_supports(harness_random *random, hs_rule rule, bool odd)
{
    const int n_entries = hs_support_entries(scene.ndim);
    supports.rule = rule;
    supports.form = (hs_limit_form){1.0f, 1.0f, 1.0f, 1.0f};
    for (int32_t t = 0; t < scene.n_points; t++) {
        float *one = supports.of_point + t * (n_entries + 1);
        for (int e = 0; e < n_entries; e++)
            one[e] = (float)(random_bits(random) % 5) - 2.0f;
        one[n_entries] = (float)(random_bits(random) % 12);
    }
    for (int32_t c = 0; c < HS_BLOCK_CANDIDATES + HS_PADDING; c++) {
        for (int e = 0; e < n_entries; e++)
            supports.of_block[e][c] = c < scene.n ? (float)(random_bits(random) % 5) - 2.0f : NAN;
        supports.of_block[n_entries][c] = c < scene.n ? (float)(random_bits(random) % 12) : NAN;
        if (odd && c < scene.n && random_bits(random) % 8 == 0)
            supports.of_block[random_bits(random) % (uint64_t)(n_entries + 1)][c] =
                random_bits(random) % 2 ? INFINITY : NAN;
    }
}

/* |N D|^2 against its thresholds: whether near, and whether sure. */
static void
meet(const float *n, int64_t stride, const float *along, bool *near, bool *sure)
{
    const float size = n[hs_support_entries(scene.ndim) * stride];
    float       s = 0.0f;
    for (int k = 0; k < scene.ndim; k++) {
        float z = 0.0f;
        for (int l = 0; l < scene.ndim; l++)
            z += n[hs_support_at(k, l) * stride] * along[l];
        s += z * z;
    }
    const float in = size < 1.0f ? 0.0f : size - 1.0f;
    const float out = size + 1.0f; /* NaN where a size is: no number is greater, or less */
    *near = !(s > out * out);
    *sure = s < in * in;
}

/* Also within the cutoff of the scene. */
static pair_verdict
by_supports(const numbers *s, int32_t t, int32_t c)
{
    float along[3], square = 0.0f;
    bool  own[2] = {false, false}, other[2] = {false, false};
    for (int k = 0; k < s->ndim; k++) {
        along[k] = s->y[k][c] - s->q[k][t];
        square += along[k] * along[k];
    }
    meet(supports.of_point + t * hs_support_numbers(s->ndim), 1, along, &own[0], &own[1]);
    meet(supports.of_block[0] + c, HS_BLOCK_CANDIDATES + HS_PADDING, along, &other[0], &other[1]);
    for (int v = 0; v < 2; v++) {
        switch (supports.rule) {
        case HS_RULE_MAX: own[v] = own[v] || other[v]; break;
        case HS_RULE_MIN: own[v] = own[v] && other[v]; break;
        case HS_RULE_SCATTER: own[v] = other[v]; break;
        default: break;
        }
    }
    return !own[0] || square > s->direct.out ? PAIR_BEYOND
           : own[1] && square < s->direct.in ? PAIR_SURE
                                             : PAIR_UNSURE;
}

static int
check_supports(const hs_kernel *kernel, const numbers *s)
{
    const hs_support_scan scan = {
        .rule = supports.rule,
        .form = supports.form,
        .of_point = supports.rule != HS_RULE_SCATTER ? supports.of_point : NULL,
        .of_block = supports.rule != HS_RULE_GATHER ? supports.of_block[0] : NULL,
        .pitch = HS_BLOCK_CANDIDATES + HS_PADDING,
    };
    return check_both((scan_pair){kernel->list_supports, kernel->count_supports, by_supports}, s,
                      &scan);
}

static void
every_kernel_lists_what_the_plain_loop_lists(void)
{
    harness_random   random = {141422};
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int32_t n = 0; n <= SHORT_BLOCK; n++) {
            for (int e = 0; e < 12; e++) {
                const int32_t n_points = 1 + (int32_t)(random_bits(&random) % 5);
                fill_with_integers(&random, 1 + e % 3, n, n_points, &scene);
                set_limits(&scene, e % 5 ? (float)(random_bits(&random) % 20) : INFINITY,
                           20.0f + (float)(random_bits(&random) % 20));
                fill_supports(&random, rules[e / 3], n % 7 == 6);
                (void)check_supports(kernel, &scene);
            }
        }
    }
}

static void
fill_for_room(harness_random *random, int trial, numbers *s)
{
    set_limits(s, 10.0f, 30.0f);
    fill_supports(random, rules[trial % 4], false);
}

static void
scans_stop_before_hits_might_not_fit(void)
{
    check_room(223607, fill_for_room, check_supports, &scene);
}

void
test_support_scans(void)
{
    guard_scans();
    RUN(every_kernel_lists_what_the_plain_loop_lists);
    RUN(scans_stop_before_hits_might_not_fit);
}
