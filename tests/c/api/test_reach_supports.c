/* SPDX-License-Identifier: BSD-3-Clause */
/* test_reach_supports.c: searches by supports through the public functions: all of them find what a
 * plain loop finds, whatever the kernel and the threads are; bad ones are refused, and a search that
 * fails or is ended leaves nothing. */
#include "../support/poll_checks.h"
#include "../support/reach_entries.h"

#include <limits.h>

void test_reach_supports(void);

static double own[SCENE_POINTS * 9], of_queries[SCENE_POINTS * 9];

/* Whole numbers over 16: nothing is rounded. The points stay those of the scene. */
static void
fill_matrices(harness_random *random, int ndim, double *to)
{
    for (int i = 0; i < SCENE_POINTS; i++) {
        double *m = to + i * ndim * ndim;
        for (int k = 0; k < ndim; k++)
            for (int l = 0; l <= k; l++)
                m[k * ndim + l] = m[l * ndim + k] = k == l ? 2.0 + random_below(random, 5)
                                                           : 0.25 * random_below(random, 4);
    }
}

static void
make(harness_random *random, hs_rule rule, int ndim, int n_queries)
{
    reach_make(random, SCENE_ALIGNED, ndim, 24, n_queries, HS_RULE_MAX, 0, &scene);
    for (int64_t e = 0; e < (scene.n + scene.n_queries) * ndim; e++)
        scene.of.x[e] = ldexp(floor(ldexp(scene.of.x[e], 6)), -6);
    fill_matrices(random, ndim, own);
    fill_matrices(random, ndim, of_queries);
    scene.bound = HUGE_VAL;
    scene.of.scene.inclusive = true;
    scene.reach = (hs_reach){.rule = rule,
                             .has_supports = true,
                             .extent = 2.0,
                             .supports = own,
                             .query_supports = of_queries};
}

static bool
is_within(const double *m, const double *d)
{
    const int ndim = scene.of.scene.ndim;
    double    square = 0.0;
    for (int k = 0; k < ndim; k++) {
        double z = 0.0;
        for (int l = 0; l < ndim; l++)
            z += m[k * ndim + l] * d[l];
        square += z * z;
    }
    return square <= 4.0;
}

/* All pairs of open space, (i, j) for both orders where rows are wanted. */
static int64_t
expect(bool rows)
{
    const int     ndim = scene.of.scene.ndim;
    const int64_t n = scene.has_queries ? scene.n_queries : scene.n;
    int64_t       found = 0;
    for (int64_t i = 0; i < n; i++) {
        const double *p = scene.of.x + ((scene.has_queries ? scene.n : 0) + i) * ndim;
        const double *asking = (scene.has_queries ? of_queries : own) + i * ndim * ndim;
        for (int64_t j = 0; j < scene.n; j++) {
            double d[3];
            for (int k = 0; k < ndim; k++)
                d[k] = scene.of.x[j * ndim + k] - p[k];
            const bool a = is_within(asking, d), b = is_within(own + j * ndim * ndim, d);
            const bool within = scene.reach.rule == HS_RULE_MAX      ? a || b
                                : scene.reach.rule == HS_RULE_MIN    ? a && b
                                : scene.reach.rule == HS_RULE_GATHER ? a
                                                                     : b;
            found += within && (scene.has_queries || (rows ? i != j : i < j));
        }
    }
    return found;
}

static void
every_function_finds_them(void)
{
    harness_random random = {4242};
    int64_t        all = 0;
    for (int trial = 0; trial < 96; trial++) {
        static const hs_rule rules[] = {HS_RULE_MAX, HS_RULE_MIN, HS_RULE_GATHER, HS_RULE_SCATTER};
        const bool           has_queries = trial / 4 % 2;
        make(&random, rules[trial % 4], 1 + trial / 8 % 3, has_queries ? 17 : -1);
        scene.among.box = NULL;
        if (rules[trial % 4] == HS_RULE_GATHER && has_queries)
            scene.reach.supports = NULL;
        if (rules[trial % 4] == HS_RULE_SCATTER)
            scene.reach.query_supports = NULL;
        hs_options  options = reach_options(&scene);
        const char *names[16];
        const int   n_kernels = hs_kernel_names(names, 16);
        hs_pairs   *first = NULL;
        for (int k = 0; k < n_kernels; k++) {
            hs_pairs *rows = NULL, *pairs = NULL;
            int64_t   count = -1, counts[SCENE_POINTS], sum = 0;
            options.kernel = names[k];
            options.threads = 1 + k;
            options.want = HS_WANT_I | HS_WANT_J;
            CHECK(hs_neighbors_find(&scene.among, &options, &rows, NULL) == HS_OK);
            CHECK(hs_pairs_length(rows) == expect(true));
            CHECK(hs_neighbors_count(&scene.among, &options, counts, NULL) == HS_OK);
            for (int64_t i = 0; i < hs_pairs_rows(rows); i++)
                sum += counts[i];
            CHECK(sum == expect(true));
            all += sum;
            hs_pairs_free(rows);
            if (!has_queries && trial % 4 < 2) {
                CHECK(hs_pairs_find(&scene.among, &options, &pairs, NULL) == HS_OK);
                CHECK(hs_pairs_count(&scene.among, &options, &count, NULL) == HS_OK);
                CHECK(hs_pairs_length(pairs) == expect(false) && count == expect(false));
                first = first == NULL ? pairs : first;
                CHECK(memcmp(hs_pairs_array(first, HS_WANT_I), hs_pairs_array(pairs, HS_WANT_I),
                             (size_t)count * sizeof(int64_t)) == 0);
            }
            if (pairs != first)
                hs_pairs_free(pairs);
        }
        hs_pairs_free(first);
    }
    CHECK(all > 1000);
}

static void
is_refused(entry which, hs_status expected, int64_t row)
{
    const int64_t before = hs_test_live_blocks();
    entry_call    e = entry_of(which);
    CHECK(run_entry(&e) == expected);
    CHECK(expected == HS_OK || e.failure.row == row);
    if (expected == HS_ERR_EXTENT)
        CHECK(memcmp(&e.failure.value, &scene.reach.extent, sizeof(double)) == 0);
    CHECK(hs_test_live_blocks() == before);
}

static void
all_refuse(hs_status expected, int64_t row)
{
    for (int which = 0; which < ENTRIES; which++)
        is_refused((entry)which, expected, row);
}

static void
bad_supports_are_refused(void)
{
    static const double extents[] = {-1.0, NAN, INFINITY, -5e-324};
    harness_random      random = {4243};
    make(&random, HS_RULE_MAX, 3, -1);
    all_refuse(HS_OK, -1);
    for (int e = 0; e < 4; e++) {
        scene.reach.extent = extents[e];
        all_refuse(HS_ERR_EXTENT, -1);
    }
    scene.reach.extent = 2.0;
    for (int e = 0; e < 9; e++)
        own[6 * 9 + e] *= 0x1p-1040;
    all_refuse(HS_ERR_SUPPORT_REACH, 6);
    own[5 * 9] = 0.0;
    all_refuse(HS_ERR_SUPPORTS, 5);
    own[3 * 9 + 1] += 0.25;
    all_refuse(HS_ERR_SUPPORTS, 3);
    scene.reach.supports = NULL;
    all_refuse(HS_ERR_ARGUMENT, -1);
    make(&random, HS_RULE_SUM, 3, -1);
    all_refuse(HS_ERR_ARGUMENT, -1);
    make(&random, HS_RULE_MEAN, 3, -1);
    all_refuse(HS_ERR_ARGUMENT, -1);
    make(&random, HS_RULE_MAX, 3, -1);
    scene.reach.n_types = 1;
    scene.reach.types = scene.types;
    scene.reach.cutoffs = scene.table;
    all_refuse(HS_ERR_ARGUMENT, -1);
    reach_make(&random, SCENE_ALIGNED, 4, 20, -1, HS_RULE_MAX, 0, &scene);
    scene.reach =
        (hs_reach){.rule = HS_RULE_MAX, .has_supports = true, .extent = 1.0, .supports = own};
    all_refuse(HS_ERR_ARGUMENT, -1);
}

static void
supports_of_queries_are_refused_as_theirs(void)
{
    harness_random random = {4244};
    make(&random, HS_RULE_MAX, 2, 9);
    of_queries[4 * 4] = -1.0;
    entry_call e = entry_of(ROWS);
    CHECK(run_entry(&e) == HS_ERR_SUPPORTS && e.failure.row == 4 && e.failure.in_queries);
    own[2 * 4] = -1.0;
    e = entry_of(ROWS);
    CHECK(run_entry(&e) == HS_ERR_SUPPORTS && e.failure.row == 2 && !e.failure.in_queries);
}

static hs_status
run_rows(void *context)
{
    return run_entry(context);
}

static void
nothing_leaks_when_memory_is_short(void)
{
    harness_random random = {4245};
    for (int which = 0; which < ENTRIES; which++) {
        const int64_t before = hs_test_live_blocks();
        make(&random, HS_RULE_MAX, 3, -1);
        entry_call e = entry_of((entry)which);
        CHECK(fail_each_allocation(run_rows, &e, 400) > 10);
        check_arena(run_rows, &e);
        CHECK(hs_test_live_blocks() == before);
    }
}

/* Supports are accounted for, and a scene without any has none. */
static void
only_scenes_with_supports_pay_for_them(void)
{
    harness_random random = {4246};
    make(&random, HS_RULE_MAX, 3, -1);
    hs_options  options = reach_options(&scene);
    hs_counters counters;
    int64_t     count;
    options.counters = &counters;
    CHECK(hs_pairs_count(&scene.among, &options, &count, NULL) == HS_OK);
    CHECK(counters.bytes[HS_FOR_SUPPORTS] >=
          scene.n * 7 * (int64_t)(sizeof(double) + sizeof(float)));
    scene.reach = (hs_reach){.rule = HS_RULE_MAX, .radii = scene.radii};
    CHECK(hs_pairs_count(&scene.among, &options, &count, NULL) == HS_OK);
    CHECK(counters.bytes[HS_FOR_SUPPORTS] == 0);
}

void
test_reach_supports(void)
{
    RUN(every_function_finds_them);
    RUN(bad_supports_are_refused);
    RUN(supports_of_queries_are_refused_as_theirs);
    RUN(nothing_leaks_when_memory_is_short);
    RUN(only_scenes_with_supports_pay_for_them);
}
