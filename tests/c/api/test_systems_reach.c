/* SPDX-License-Identifier: BSD-3-Clause */
/* test_systems_reach.c: many systems whose pairs have a reach of their own, against one call for
 * each. */
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/halfshell.h"

#include <math.h>

void test_systems_reach(void);

enum { N_SYSTEMS = 30, MOST_POINTS = 60, N_TYPES = 3 };

typedef struct batch {
    int64_t first[N_SYSTEMS + 1];
    double  x[N_SYSTEMS * MOST_POINTS * 3];
    double  rows[N_SYSTEMS * 9];
    double  cutoffs[N_SYSTEMS];
    double  radii[N_SYSTEMS * MOST_POINTS];
    int32_t types[N_SYSTEMS * MOST_POINTS];
    double  supports[N_SYSTEMS * MOST_POINTS * 9];
    double  table[N_TYPES * N_TYPES];
    hs_box  box;
} batch;

/* decades: over how many the radii of a system spread. */
static void
make_batch(uint64_t seed, double decades, batch *made)
{
    harness_random random = {seed};
    memset(made, 0, sizeof *made);
    made->box.ndim = 3;
    for (int s = 0; s < N_SYSTEMS; s++) {
        const int n = s % 7 == 3 ? 0 : 1 + (int)(random_unit(&random) * (MOST_POINTS - 1));
        made->first[s + 1] = made->first[s] + n;
        made->cutoffs[s] = 0.3 + 1.2 * random_unit(&random);
        for (int k = 0; k < 9; k++)
            made->rows[9 * s + k] = (k % 4 == 0 ? 3.0 : 0.0) + random_unit(&random);
    }
    for (int64_t e = 0; e < 3 * made->first[N_SYSTEMS]; e++)
        made->x[e] = 4.0 * random_unit(&random);
    for (int64_t i = 0; i < made->first[N_SYSTEMS]; i++) {
        made->radii[i] = 0.8 * pow(10.0, -decades * random_unit(&random));
        made->types[i] = (int32_t)(N_TYPES * random_unit(&random));
        for (int e = 0; e < 9; e++) /* reaches 2 at most */
            made->supports[9 * i + e] = e % 4 == 0 ? 1.0 / made->radii[i] : 0.25;
    }
    for (int a = 0; a < N_TYPES; a++) {
        for (int b = 0; b <= a; b++) {
            const double cutoff = a + b == 0 ? -1.0 : decades > 1.0 ? 0.2 * (a + b) : 1.0;
            made->table[a * N_TYPES + b] = made->table[b * N_TYPES + a] = cutoff;
        }
    }
    for (int k = 0; k < 3; k++)
        made->box.periodic[k] = true;
}

static hs_points
points_of(const batch *made, int64_t first, int64_t end)
{
    return (hs_points){made->x + 3 * first, end - first,        3,
                       HS_FLOAT64,          3 * sizeof(double), sizeof(double)};
}

typedef enum marks { RADII, TYPES, SUPPORTS } marks;

static hs_reach
reach_of(const batch *made, hs_rule rule, marks by, int64_t first)
{
    if (by == TYPES) {
        return (hs_reach){.n_types = N_TYPES, .types = made->types + first, .cutoffs = made->table};
    }
    if (by == SUPPORTS) {
        return (hs_reach){.rule = rule,
                          .has_supports = true,
                          .extent = 0.9,
                          .supports = made->supports + 9 * first};
    }
    return (hs_reach){.rule = rule, .radii = made->radii + first};
}

/* Compares with single calls; returns the number of pairs, -1 when something differs. */
static int64_t
compare(const batch *made, const hs_reach *reach, bool has_box, bool has_cutoffs,
        hs_options options, int threads)
{
    const hs_points  points = points_of(made, 0, made->first[N_SYSTEMS]);
    const hs_systems systems = {.n = N_SYSTEMS,
                                .first = made->first,
                                .box = has_box ? &made->box : NULL,
                                .rows = has_box ? made->rows : NULL,
                                .cutoffs = has_cutoffs ? made->cutoffs : NULL,
                                .reach = reach};
    hs_pairs        *pairs = NULL;
    int64_t          counts[N_SYSTEMS], at = 0;
    bool             same = true;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_SHIFT;
    options.threads = threads;
    if (hs_systems_find(&points, &systems, &options, &pairs, NULL) != HS_OK ||
        hs_systems_count(&points, &systems, &options, counts, NULL) != HS_OK) {
        hs_pairs_free(pairs);
        return -1;
    }
    const int64_t *i = hs_pairs_array(pairs, HS_WANT_I), *j = hs_pairs_array(pairs, HS_WANT_J);
    const double  *d = hs_pairs_array(pairs, HS_WANT_DISTANCE);
    const int32_t *shift = hs_pairs_array(pairs, HS_WANT_SHIFT);
    options.threads = 1;
    for (int s = 0; s < N_SYSTEMS; s++) {
        const int64_t   first = made->first[s];
        const hs_points own = points_of(made, first, made->first[s + 1]);
        const marks     by = reach->has_supports ? SUPPORTS : reach->n_types > 0 ? TYPES : RADII;
        const hs_reach  of_own = reach_of(made, reach->rule, by, first);
        hs_box          box = made->box;
        hs_pairs       *expected = NULL;
        for (int k = 0; k < 9; k++)
            box.rows[k / 3][k % 3] = made->rows[9 * s + k];
        options.cutoff = has_cutoffs ? made->cutoffs[s] : options.cutoff;
        const hs_among among = {.points = &own, .box = has_box ? &box : NULL, .reach = &of_own};
        same = same && hs_pairs_find(&among, &options, &expected, NULL) == HS_OK;
        const int64_t  n = hs_pairs_length(expected);
        const int64_t *a = hs_pairs_array(expected, HS_WANT_I);
        const int64_t *b = hs_pairs_array(expected, HS_WANT_J);
        const double  *c = hs_pairs_array(expected, HS_WANT_DISTANCE);
        const int32_t *t = hs_pairs_array(expected, HS_WANT_SHIFT);
        same = same && counts[s] == n && at + n <= hs_pairs_length(pairs);
        for (int64_t p = 0; p < n && same; p++, at++) {
            same = i[at] == a[p] + first && j[at] == b[p] + first && d[at] == c[p] &&
                   memcmp(shift + 3 * at, t + 3 * p, 12) == 0;
        }
        hs_pairs_free(expected);
    }
    same = same && at == hs_pairs_length(pairs);
    hs_pairs_free(pairs);
    return same ? at : -1;
}

static batch made;

/* In the order of these calls, too. */
static void
the_same_as_single_calls(void)
{
    for (uint64_t seed = 1; seed <= TRIALS(8); seed++) {
        make_batch(seed, seed % 2 == 1 ? 0.5 : 3.0, &made);
        for (int kind = 0; kind < 16; kind++) {
            hs_options options = hs_options_default();
            options.cutoff = INFINITY;
            options.sorted = kind % 2 == 1;
            for (hs_rule rule = HS_RULE_SUM; rule <= HS_RULE_MIN; rule++) {
                const hs_reach reach = reach_of(&made, rule, RADII, 0);
                CHECK(compare(&made, &reach, kind & 2, kind & 8, options, kind & 4 ? 3 : 1) >= 0);
            }
            for (hs_rule rule = HS_RULE_MAX; rule <= HS_RULE_MIN; rule++) {
                const hs_reach reach = reach_of(&made, rule, SUPPORTS, 0);
                CHECK(compare(&made, &reach, kind & 2, kind & 8, options, kind & 4 ? 3 : 1) >= 0);
            }
            const hs_reach by_types = reach_of(&made, HS_RULE_SUM, TYPES, 0);
            options.cutoff = 0.7;
            CHECK(compare(&made, &by_types, kind & 2, kind & 8, options, kind & 4 ? 3 : 1) > 30);
        }
    }
}

static void
every_algorithm_is_the_same_as_single_calls(void)
{
    make_batch(31, 2.0, &made);
    const hs_reach reach = reach_of(&made, HS_RULE_SUM, RADII, 0);
    const hs_reach of_supports = reach_of(&made, HS_RULE_MAX, SUPPORTS, 0);
    for (hs_algorithm a = HS_AUTO; a < HS_ALGORITHM_END; a++) {
        hs_options options = hs_options_default();
        options.cutoff = INFINITY;
        options.algorithm = a;
        CHECK(compare(&made, &reach, true, false, options, 1) > 100);
        CHECK(compare(&made, &of_supports, true, false, options, 1) > 10);
    }
}

/* Rows are counted through all systems. */
static void
failures_name_system_and_point(void)
{
    hs_failure failure;
    hs_pairs  *pairs = NULL;
    hs_options options = hs_options_default();
    make_batch(32, 1.0, &made);
    const int64_t   n = made.first[N_SYSTEMS], row = made.first[20] + 1;
    const hs_points points = points_of(&made, 0, n);
    const hs_reach  reach = reach_of(&made, HS_RULE_SUM, RADII, 0);
    const hs_reach  by_types = reach_of(&made, HS_RULE_SUM, TYPES, 0);
    const hs_reach  of_supports = reach_of(&made, HS_RULE_MIN, SUPPORTS, 0);
    const hs_reach  sums = reach_of(&made, HS_RULE_SUM, SUPPORTS, 0);
    const hs_reach  directed = {.rule = HS_RULE_GATHER, .radii = made.radii};
    const hs_reach  without = {.rule = HS_RULE_SUM};
    hs_systems      systems = {.n = N_SYSTEMS, .first = made.first, .reach = &reach};
    const double    radius = made.radii[row], x = made.x[3 * row];
    const int32_t   type = made.types[row];
    options.cutoff = INFINITY;
    made.radii[row] = -1.0;
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_RADII);
    CHECK(failure.row == row && failure.value == -1.0 && failure.system == 20 && pairs == NULL);
    made.radii[row] = radius;
    made.x[3 * row] = NAN;
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == row && failure.column == 0 && failure.system == 20);
    made.x[3 * row] = x;
    systems.cutoffs = made.cutoffs;
    made.cutoffs[20] = -2.0;
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_CUTOFF);
    CHECK(failure.value == -2.0 && failure.system == 20);
    systems.cutoffs = NULL;
    systems.reach = &by_types;
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_CUTOFF);
    options.cutoff = 1.0;
    made.types[row] = N_TYPES;
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_TYPES);
    CHECK(failure.row == row && failure.value == N_TYPES);
    made.types[row] = type;
    made.types[row] = type;
    systems.reach = &of_supports;
    options.cutoff = INFINITY;
    made.supports[9 * row + 1] = INFINITY;
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_SUPPORTS);
    CHECK(failure.row == row && failure.system == 20);
    made.supports[9 * row + 1] = 0.25;
    systems.reach = &sums;
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    systems.reach = &directed;
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    systems.reach = &without;
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    systems.reach = &reach;
    systems.box = &made.box;
    systems.rows = made.rows;
    memset(made.rows + 9 * 3, 0, 9 * sizeof(double)); /* of a system without points */
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_BOX_DEPENDENT);
    CHECK(failure.system == 3);
}

/* Neither supports of which there are none, nor a table without a bound for it. */
static void
reaches_that_systems_cannot_have_are_refused(void)
{
    static const int bad[] = {7, 0, N_SYSTEMS - 1};
    int64_t          counts[N_SYSTEMS];
    hs_options       options = hs_options_default();
    hs_failure       failure;
    make_batch(35, 1.0, &made);
    const hs_points points = points_of(&made, 0, made.first[N_SYSTEMS]);
    const hs_reach  by_types = reach_of(&made, HS_RULE_SUM, true, 0);
    const hs_reach  by_supports = {.rule = HS_RULE_MAX, .has_supports = true, .extent = 1.0};
    hs_systems      systems = {.n = N_SYSTEMS, .first = made.first, .reach = &by_supports};
    options.cutoff = INFINITY;
    memset(&failure, 0x5a, sizeof failure);
    CHECK(hs_systems_count(&points, &systems, &options, counts, &failure) == HS_ERR_ARGUMENT);
    CHECK(failure.row == -1 && failure.system == -1);
    systems.reach = &by_types;
    systems.cutoffs = made.cutoffs;
    for (int b = 0; b < 3; b++) { /* the first of them is named */
        hs_pairs *pairs = (hs_pairs *)&points;
        made.cutoffs[bad[b]] = INFINITY;
        const int first = b == 0 ? bad[0] : 0;
        CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_CUTOFF);
        CHECK(pairs == NULL && failure.value == INFINITY && failure.system == first);
        CHECK(hs_systems_count(&points, &systems, &options, counts, &failure) == HS_ERR_CUTOFF);
        CHECK(failure.value == INFINITY && failure.system == first);
    }
    for (int b = 0; b < 3; b++)
        made.cutoffs[bad[b]] = 1.0;
    CHECK(hs_systems_count(&points, &systems, &options, counts, &failure) == HS_OK);
}

static hs_status
find_all(void *context)
{
    const hs_systems *systems = context;
    const hs_points   points = points_of(&made, 0, made.first[systems->n]);
    hs_options        options = hs_options_default();
    hs_pairs         *pairs = NULL;
    options.cutoff = INFINITY;
    options.sorted = systems->box == NULL;
    const hs_status status = hs_systems_find(&points, systems, &options, &pairs, NULL);
    hs_pairs_free(pairs);
    return status;
}

static void
nothing_leaks_when_memory_is_short(void)
{
    make_batch(33, 2.0, &made);
    const hs_reach reach = reach_of(&made, HS_RULE_SUM, RADII, 0);
    hs_systems     systems = {.n = 5, .first = made.first, .reach = &reach};
    CHECK(fail_each_allocation(find_all, &systems, 20000) > 5);
    check_arena(find_all, &systems);
    systems.box = &made.box;
    systems.rows = made.rows;
    CHECK(fail_each_allocation(find_all, &systems, 20000) > 5);
    check_arena(find_all, &systems);
    const hs_reach of_supports = reach_of(&made, HS_RULE_MAX, SUPPORTS, 0);
    systems.reach = &of_supports;
    CHECK(fail_each_allocation(find_all, &systems, 20000) > 5);
    check_arena(find_all, &systems);
}

static void
a_limit_is_told(void)
{
    int64_t    counts[N_SYSTEMS];
    hs_failure failure;
    hs_options options = hs_options_default();
    make_batch(34, 1.0, &made);
    const hs_points  points = points_of(&made, 0, made.first[N_SYSTEMS]);
    const hs_reach   reach = reach_of(&made, HS_RULE_SUM, RADII, 0);
    const hs_systems systems = {.n = N_SYSTEMS, .first = made.first, .reach = &reach};
    options.cutoff = INFINITY;
    options.memory_limit = 100.0;
    CHECK(hs_systems_count(&points, &systems, &options, counts, &failure) == HS_ERR_MEMORY);
    CHECK(failure.limit_bytes == 100.0);
}

void
test_systems_reach(void)
{
    RUN(the_same_as_single_calls);
    RUN(every_algorithm_is_the_same_as_single_calls);
    RUN(failures_name_system_and_point);
    RUN(reaches_that_systems_cannot_have_are_refused);
    RUN(nothing_leaks_when_memory_is_short);
    RUN(a_limit_is_told);
}
