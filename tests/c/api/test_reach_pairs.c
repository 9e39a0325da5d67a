/* SPDX-License-Identifier: BSD-3-Clause */
/* test_reach_pairs.c: pairs, rows and counts of searches in which each pair has a reach of its own,
 * against a brute force: every rule, tables of types, all boxes, one set and two. */
#include "../../../csrc/core/levels/level_join.h"
#include "../support/block_checks.h"
#include "../support/reach_brute.h"

void test_reach_pairs(void);

static reach_scene s;
static int64_t     n_pairs; /* that were expected so far */

/* What a rule is for: no half lists by the radius of one of the two. */
static bool
has_half_list(void)
{
    return !s.has_queries && (s.reach.n_types > 0 ||
                              (s.reach.rule != HS_RULE_GATHER && s.reach.rule != HS_RULE_SCATTER));
}

/* Number of pairs that the functions which count find. */
static bool
counts_are(hs_options options, const brute_list *expected, reach_list kind)
{
    static int64_t counts[SCENE_POINTS];
    int64_t        n = -7;
    if (kind == REACH_HALF) {
        return hs_pairs_count(&s.among, &options, &n, NULL) == HS_OK && n == expected->n;
    }
    bool right = hs_neighbors_count(&s.among, &options, counts, NULL) == HS_OK;
    for (int64_t e = 0; e < expected->n; e++)
        counts[expected->pairs[e].i]--;
    for (int64_t i = 0; i < (s.has_queries ? s.n_queries : s.n); i++)
        right = right && counts[i] == 0;
    if (right && s.has_queries) {
        right = hs_pairs_count(&s.among, &options, &n, NULL) == HS_OK && n == expected->n;
    }
    return right;
}

/* Pairs that are found unsorted are the same, and their order is that of any kernel and any number
 * of threads. */
static bool
unsorted_are(hs_options options, const hs_pairs *sorted)
{
    hs_pairs *first = NULL;
    bool      right = hs_pairs_find(&s.among, &options, &first, NULL) == HS_OK;
    right = right && hs_pairs_length(first) == hs_pairs_length(sorted);
    const char *names[16];
    const int   n_kernels = hs_kernel_names(names, 16);
    for (int k = 0; right && k < n_kernels; k++) {
        hs_pairs *again = NULL;
        options.kernel = names[k];
        options.threads = 1 + k % 3;
        right = hs_pairs_find(&s.among, &options, &again, NULL) == HS_OK &&
                hs_pairs_length(again) == hs_pairs_length(first) &&
                block_matches(first, again, 0, s.of.scene.ndim);
        hs_pairs_free(again);
    }
    if (right) { /* sorted, they are the sorted ones */
        const int64_t  n = hs_pairs_length(first);
        uint64_t      *keys = array_of(n, sizeof *keys);
        const int64_t *i = hs_pairs_array(first, HS_WANT_I), *j = hs_pairs_array(first, HS_WANT_J);
        const int64_t *I = hs_pairs_array(sorted, HS_WANT_I);
        const int64_t *J = hs_pairs_array(sorted, HS_WANT_J);
        for (int64_t e = 0; e < n; e++)
            keys[e] = (uint64_t)i[e] << 32 | (uint64_t)j[e];
        qsort(keys, (size_t)n, sizeof *keys, compare_keys);
        for (int64_t e = 0; right && e < n; e++)
            right = keys[e] == ((uint64_t)I[e] << 32 | (uint64_t)J[e]);
        free(keys);
    }
    hs_pairs_free(first);
    return right;
}

static bool
half_list_is_right(int threads)
{
    hs_options options = reach_options(&s);
    brute_list expected;
    hs_pairs  *found = NULL;
    options.want = WANT_ALL;
    options.threads = threads;
    options.sorted = true;
    reach_find(&s, REACH_HALF, &expected);
    bool right = hs_pairs_find(&s.among, &options, &found, NULL) == HS_OK;
    right = right && reach_matches(&s, found, &expected);
    options.sorted = false;
    right = right && unsorted_are(options, found) && counts_are(options, &expected, REACH_HALF);
    hs_pairs_free(found);
    brute_free(&expected);
    return right;
}

static bool
rows_are_right(int threads)
{
    hs_options options = reach_options(&s);
    brute_list expected;
    hs_pairs  *rows = NULL;
    options.want = WANT_ALL;
    options.threads = threads;
    reach_find(&s, REACH_ROWS, &expected);
    bool right = hs_neighbors_find(&s.among, &options, &rows, NULL) == HS_OK;
    right = right && reach_matches(&s, rows, &expected);
    right = right && hs_pairs_rows(rows) == (s.has_queries ? s.n_queries : s.n);
    for (int64_t e = 0; right && e < expected.n; e++) {
        const int64_t *offsets = hs_pairs_offsets(rows), i = expected.pairs[e].i;
        right = offsets[i] <= e && e < offsets[i + 1];
    }
    right = right && hs_pairs_offsets(rows)[hs_pairs_rows(rows)] == expected.n;
    right = right && counts_are(options, &expected, REACH_ROWS);
    hs_pairs_free(rows);
    n_pairs += expected.n;
    brute_free(&expected);
    return right;
}

/* By several searches or, in every other eleven trials, by one. */
static void
check_scene(int trial, const char *what)
{
    const int  threads = trial % 4 == 3 ? 3 : 1;
    const int  before = harness_failures;
    const bool joins = hs_test_join_levels(trial / 11 % 2);
    if (has_half_list()) {
        CHECK(half_list_is_right(threads));
    }
    CHECK(rows_are_right(threads));
    (void)hs_test_join_levels(joins);
    if (harness_failures != before) {
        fprintf(stderr, "%s %d: rule %d, %d types\n", what, trial, (int)s.reach.rule,
                (int)s.reach.n_types);
    }
}

static void
every_rule_finds_what_the_brute_force_finds(void)
{
    harness_random random = {20260};
    for (int trial = 0; trial < TRIALS(1000); trial++) {
        const int ndim = 1 + trial % 3 + (trial % 29 == 0);
        reach_make(&random, (scene_kind)(trial / 7 % SCENE_KINDS), ndim, random_below(&random, 30),
                   -1, (hs_rule)(trial % (HS_RULE_END + 1)), trial % 11 ? 0 : 200, &s);
        check_scene(trial, "one set");
    }
    CHECK(n_pairs > TRIALS(20000));
}

/* More queries than points, fewer, and none of either. */
static void
two_sets_find_what_the_brute_force_finds(void)
{
    static const int sizes[][2] = {{25, 6}, {6, 25}, {15, 15}, {0, 10}, {10, 0}, {1, 40}};
    harness_random   random = {20261};
    for (int trial = 0; trial < TRIALS(1000); trial++) {
        const int *size = sizes[trial / 7 % 6];
        reach_make(&random, (scene_kind)(trial % SCENE_KINDS), 1 + trial % 3, size[0], size[1],
                   (hs_rule)(trial % (HS_RULE_END + 1)), 0, &s);
        check_scene(trial, "two sets");
    }
}

/* Up to the axes that there are, and numbers near the ends of what there is. */
static void
axes_and_exponents_make_no_difference(void)
{
    static const int exponents[] = {1010, -1000, -400, 500};
    harness_random   random = {20262};
    for (int trial = 0; trial < TRIALS(200); trial++) {
        const bool is_far = trial % 2;
        const int  ndim = is_far ? 1 + trial / 2 % 3 : 4 + trial / 2 % 5;
        const int  n_queries = trial % 3 ? -1 : 7;
        const int  kind = ndim > 4 ? SCENE_OPEN : trial / 2 % SCENE_KINDS;
        const int  exponent = is_far ? exponents[trial / 2 % 4] : 0;
        reach_make(&random, (scene_kind)kind, ndim, 12, n_queries,
                   (hs_rule)(trial / 3 % (HS_RULE_END + 1)), exponent, &s);
        if (s.reach.n_types > 0) {
            s.bound = 0x1p1020;
        }
        if (exponent == 1010) {
            s.of.x[0] = 0x1p-1070; /* a digit that scaling would lose: originals are kept */
        }
        check_scene(trial, "axes");
    }
}

/* Limits of zero: of all points, of some, or of each type with itself. */
static void
zero_limits_find_equal_points(void)
{
    harness_random random = {20264};
    for (int trial = 0; trial < 8 * (HS_RULE_END + 1); trial++) {
        const bool all = trial & 1;
        reach_make(&random, trial & 4 ? SCENE_ALIGNED : SCENE_OPEN, 2, 20, trial & 2 ? 9 : -1,
                   (hs_rule)(trial / 8), 0, &s);
        s.of.scene.inclusive = trial % 3;
        for (int e = 0; e < 2 * (int)(s.n + s.n_queries); e++)
            s.of.x[e] = floor(s.of.x[e]);
        for (int i = 0; i < s.n + s.n_queries; i++)
            s.radii[i] = all || i % 2 ? 0.0 : 1.0;
        for (int e = 0; e < REACH_TYPES * REACH_TYPES; e++)
            s.table[e] = all || e % (REACH_TYPES + 1) == 0 ? 0.0 : 1.0;
        check_scene(trial, "zeros");
    }
}

/* Where nothing is rounded, float32 and the formula of float64 find what exact arithmetic does. */
static void
precisions_agree_on_small_integers(void)
{
    harness_random random = {20263};
    for (int trial = 0; trial < TRIALS(300); trial++) {
        const hs_rule rule = (hs_rule)(trial % (HS_RULE_END + 1));
        reach_make(&random, SCENE_OPEN, 1 + trial % 3, 25, trial % 5 ? -1 : 9, rule, 0, &s);
        for (int e = 0; e < 34 * s.of.scene.ndim; e++)
            s.of.x[e] = (double)random_below(&random, 6);
        for (int i = 0; i < 34; i++)
            s.radii[i] = 0.5 * random_below(&random, 5);
        for (int e = 0; e < REACH_TYPES * REACH_TYPES; e++)
            s.table[e] = (e % REACH_TYPES + e / REACH_TYPES) % 5 - (trial % 2);
        brute_list expected;
        reach_find(&s, REACH_ROWS, &expected);
        for (int precision = HS_EXACT; precision <= HS_SINGLE; precision++) {
            hs_options options = reach_options(&s);
            hs_pairs  *rows = NULL;
            options.want = HS_WANT_I | HS_WANT_J;
            options.precision = (hs_precision)precision;
            CHECK(hs_neighbors_find(&s.among, &options, &rows, NULL) == HS_OK);
            CHECK(hs_pairs_length(rows) == expected.n);
            const int64_t *i = hs_pairs_array(rows, HS_WANT_I),
                          *j = hs_pairs_array(rows, HS_WANT_J);
            for (int64_t e = 0; e < expected.n && e < hs_pairs_length(rows); e++)
                CHECK(i[e] == expected.pairs[e].i && j[e] == expected.pairs[e].j);
            CHECK(counts_are(options, &expected, REACH_ROWS));
            hs_pairs_free(rows);
        }
        brute_free(&expected);
    }
}

void
test_reach_pairs(void)
{
    RUN(every_rule_finds_what_the_brute_force_finds);
    RUN(two_sets_find_what_the_brute_force_finds);
    RUN(axes_and_exponents_make_no_difference);
    RUN(zero_limits_find_equal_points);
    RUN(precisions_agree_on_small_integers);
}
