/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_systems.c: many systems in one call have the pairs that each has alone. */
#include "../../../csrc/core/memory/memory.h"
#include "../../../csrc/halfshell.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include <math.h>

void test_api_systems(void);

/* ---- many systems in one call against one call for each ---- */

enum { N_SYSTEMS = 40, MOST_POINTS = 90 };

/* Systems of 0 to MOST_POINTS - 1 points in boxes of their own. */
typedef struct batch {
    int64_t first[N_SYSTEMS + 1];
    double  x[N_SYSTEMS * MOST_POINTS * 3];
    double  rows[N_SYSTEMS * 9];
    double  cutoffs[N_SYSTEMS];
    hs_box  box;
} batch;

static void
make_batch(uint64_t seed, batch *made)
{
    harness_random random = {seed};
    memset(made, 0, sizeof *made);
    made->box.ndim = 3;
    for (int s = 0; s < N_SYSTEMS; s++) {
        const int n = s % 7 == 3 ? 0 : (int)(random_unit(&random) * MOST_POINTS);
        made->first[s + 1] = made->first[s] + n;
        made->cutoffs[s] = 0.3 + 1.2 * random_unit(&random);
        for (int k = 0; k < 9; k++) {
            made->rows[9 * s + k] = (k % 4 == 0 ? 3.0 : 0.0) + random_unit(&random);
        }
    }
    for (int64_t e = 0; e < 3 * made->first[N_SYSTEMS]; e++) {
        made->x[e] = 4.0 * random_unit(&random);
    }
    for (int k = 0; k < 3; k++) {
        made->box.periodic[k] = true;
    }
}

static hs_points
points_of(const batch *made, int64_t first, int64_t end)
{
    return (hs_points){made->x + 3 * first, end - first,        3,
                       HS_FLOAT64,          3 * sizeof(double), sizeof(double)};
}

/* Compares with single calls; returns the number of pairs, -1 when something differs. */
static int64_t
compare(const batch *made, hs_options options, bool has_box, int threads)
{
    const hs_points      points = points_of(made, 0, made->first[N_SYSTEMS]);
    const hs_each_system each = {.rows = has_box ? made->rows : NULL, .cutoffs = made->cutoffs};
    const hs_among      *systems =
        SYSTEMS(&points, N_SYSTEMS, made->first, has_box ? &made->box : NULL, &each);
    hs_pairs  *pairs = NULL;
    hs_failure failure;
    int64_t    counts[N_SYSTEMS], at = 0;
    bool       same = true;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
    options.threads = threads;
    if (hs_pairs_find(systems, &options, &pairs, &failure) != HS_OK ||
        hs_pairs_count(systems, &options, counts, &failure) != HS_OK) {
        hs_pairs_free(pairs);
        return -1;
    }
    const int64_t *i = hs_pairs_array(pairs, HS_WANT_I), *j = hs_pairs_array(pairs, HS_WANT_J);
    const double  *d = hs_pairs_array(pairs, HS_WANT_DISTANCE);
    options.threads = 1;
    for (int s = 0; s < N_SYSTEMS; s++) {
        const int64_t   first = made->first[s];
        const hs_points own = points_of(made, first, made->first[s + 1]);
        hs_box          box = made->box;
        hs_pairs       *expected;
        for (int k = 0; k < 9; k++) {
            box.rows[k / 3][k % 3] = made->rows[9 * s + k];
        }
        options.cutoff = made->cutoffs[s];
        if (hs_pairs_find(AMONG(&own, has_box ? &box : NULL), &options, &expected, &failure) !=
            HS_OK) {
            hs_pairs_free(pairs);
            return -1;
        }
        const int64_t  n = hs_pairs_length(expected);
        const int64_t *a = hs_pairs_array(expected, HS_WANT_I);
        const int64_t *b = hs_pairs_array(expected, HS_WANT_J);
        const double  *c = hs_pairs_array(expected, HS_WANT_DISTANCE);
        same = same && counts[s] == n && at + n <= hs_pairs_length(pairs);
        for (int64_t p = 0; p < n && same; p++, at++) {
            same = i[at] == a[p] + first && j[at] == b[p] + first && d[at] == c[p];
        }
        hs_pairs_free(expected);
    }
    same = same && at == hs_pairs_length(pairs);
    hs_pairs_free(pairs);
    return same ? at : -1;
}

static void
the_same_as_single_calls(void)
{
    static batch made;
    for (uint64_t seed = 1; seed <= TRIALS(20); seed++) {
        make_batch(seed, &made);
        for (int kind = 0; kind < 8; kind++) {
            hs_options options = hs_options_default();
            options.sorted = kind % 2 == 1;
            CHECK(compare(&made, options, kind & 2, kind & 4 ? 3 : 1) > 100);
        }
    }
}

/* Every allocation fails once: an error, or what there would be otherwise; nothing is left
 * behind. */
static void
nothing_is_lost_when_memory_is_short(void)
{
    static batch  made;
    const int64_t before = hs_test_live_blocks();
    make_batch(9, &made);
    const hs_points      points = points_of(&made, 0, made.first[N_SYSTEMS]);
    const hs_each_system each = {.rows = made.rows, .cutoffs = made.cutoffs};
    const hs_among      *systems = SYSTEMS(&points, N_SYSTEMS, made.first, &made.box, &each);
    for (int kind = 0; kind < 4; kind++) {
        int64_t expected = -1;
        bool    ended = false;
        for (int64_t nth = 0; !ended && nth < 100000; nth += nth < TRIALS(200) ? 1 : 37) {
            hs_options options = hs_options_default();
            hs_pairs  *pairs = NULL;
            hs_failure failure;
            options.sorted = kind & 1;
            options.threads = kind & 2 ? 2 : 1;
            options.want = HS_WANT_BOTH | HS_WANT_VECTOR | HS_WANT_SHIFT;
            hs_test_fail_allocation(nth);
            const hs_status status = hs_pairs_find(systems, &options, &pairs, &failure);
            ended = nth > 0 && hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(status == HS_OK || (status == HS_ERR_MEMORY && pairs == NULL && !ended));
            expected = nth == 0 ? hs_pairs_length(pairs) : expected;
            CHECK(status != HS_OK || hs_pairs_length(pairs) == expected);
            hs_pairs_free(pairs);
        }
        CHECK(ended && expected > 1000);
    }
    hs_pool_clear();
    CHECK(hs_test_live_blocks() == before);
}

static double
some_limit(void *context)
{
    ++*(int *)context;
    return 1e9;
}

/* Into arrays of the caller, by one thread or more than there are systems; all in one box. */
static void
results_go_to_the_callers_arrays(void)
{
    enum { ROOM = 20000 };
    static batch   made;
    static int64_t i[ROOM], j[ROOM];
    hs_pair_arrays out = {.capacity = ROOM, .index_bytes = 8, .i = i, .j = j};
    hs_options     options = hs_options_default();
    hs_failure     failure;
    int            n_asked = 0;
    make_batch(6, &made);
    made.first[1] = made.first[2] = 0; /* the first systems are empty */
    const hs_points points = points_of(&made, 0, made.first[N_SYSTEMS]);
    for (int k = 0; k < 3; k++) {
        made.box.rows[k][k] = 4.0;
    }
    options.cutoff = 0.7;
    options.find_limit = some_limit;
    options.find_context = &n_asked;
    for (int threads = 1; threads <= 4; threads += 3) {
        for (int n = 3; n <= N_SYSTEMS; n += N_SYSTEMS - 3) {
            const hs_points some = points_of(&made, 0, made.first[n]);
            const hs_among *systems = SYSTEMS(&some, n, made.first, &made.box, NULL);
            hs_pairs       *own = NULL, *into = NULL;
            options.threads = threads;
            options.out = NULL;
            CHECK(hs_pairs_find(systems, &options, &own, &failure) == HS_OK);
            const int64_t found = hs_pairs_length(own);
            CHECK(found > 50 && found <= ROOM);
            options.out = &out;
            CHECK(hs_pairs_find(systems, &options, &into, &failure) == HS_OK);
            CHECK(hs_pairs_length(into) == found && hs_pairs_array(into, HS_WANT_I) == NULL);
            CHECK(memcmp(i, hs_pairs_array(own, HS_WANT_I), (size_t)found * 8) == 0);
            CHECK(memcmp(j, hs_pairs_array(own, HS_WANT_J), (size_t)found * 8) == 0);
            out.capacity = found - 1;
            hs_pairs_free(into);
            CHECK(hs_pairs_find(systems, &options, &into, &failure) == HS_ERR_CAPACITY);
            CHECK(into == NULL && failure.expected_pairs == (double)found);
            out.capacity = ROOM;
            hs_pairs_free(own);
        }
    }
    CHECK(n_asked > 0 && points.n > 0);
}

/* Points too far away for the shifts or the precision of one system are named among all. */
static void
far_points_are_named_among_all(void)
{
    double        x[8] = {0.0, 0.0, 0.5, 0.5, 0.0, 3.9, 0.0, -3.9};
    const int64_t first[] = {0, 2, 4};
    hs_box        box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0, 0.0}, {0x1p40, 8.0}}};
    const hs_points points = {x, 4, 2, HS_FLOAT64, 16, 8};
    const hs_among *systems = SYSTEMS(&points, 2, first, &box, NULL);
    hs_options      options = hs_options_default();
    hs_pairs       *pairs = NULL;
    hs_failure      failure;
    int64_t         counts[2];
    options.cutoff = 1.0;
    CHECK(hs_pairs_count(systems, &options, counts, &failure) == HS_OK);
    CHECK(counts[0] == 1 && counts[1] == 1);
    options.want = HS_WANT_SHIFT;
    for (int sorted = 0; sorted < 2; sorted++) {
        options.sorted = sorted;
        CHECK(hs_pairs_find(systems, &options, &pairs, &failure) == HS_ERR_SHIFT_RANGE);
        CHECK(pairs == NULL && (failure.row == 2 || failure.row == 3));
    }
    options.sorted = false;
    x[6] = 0x1p60; /* more turns than are counted */
    CHECK(hs_pairs_find(systems, &options, &pairs, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(failure.row == 3);
    options.precision = HS_DOUBLE;
    options.want = HS_WANT_I;
    const hs_status status = hs_pairs_find(systems, &options, &pairs, &failure);
    CHECK(status == HS_ERR_ROUNDING || status == HS_ERR_SHIFT_RANGE);
    CHECK(failure.row == 3);
}

/* An hs_poll_fn: never less than before. */
static bool
note_fraction(void *context, double fraction)
{
    double *told = context;
    CHECK(fraction >= *told && fraction <= 1.0);
    *told = fraction;
    return true;
}

/* By one thread, which writes pairs where they belong, and by several. */
static void
progress_goes_on_over_all_systems(void)
{
    enum { N = 400, POINTS = 400 };
    static double   x[N * POINTS];
    static int64_t  first[N + 1];
    harness_random  random = {29};
    const hs_points points = {x, N * POINTS, 1, HS_FLOAT64, 8, 8};
    for (int e = 0; e < N * POINTS; e++)
        x[e] = random_unit(&random);
    for (int s = 0; s <= N; s++)
        first[s] = s * POINTS;
    for (int threads = 1; threads <= 2; threads++) {
        const hs_among *systems = SYSTEMS(&points, N, first, NULL, NULL);
        hs_options      options = hs_options_default();
        hs_pairs       *pairs;
        double          told = 0.0;
        options.cutoff = 0.01;
        options.threads = threads;
        options.poll = note_fraction;
        options.poll_context = &told;
        CHECK(hs_pairs_find(systems, &options, &pairs, NULL) == HS_OK);
        CHECK(told > 0.3 || threads > 1); /* how often the caller's thread polls is up to chance */
        hs_pairs_free(pairs);
    }
}

/* ---- many systems whose pairs have a reach of their own, against one call for each ---- */

enum { N_SYSTEMS_REACH = 30, MOST_POINTS_REACH = 60, N_TYPES = 3 };

typedef struct batch_reach {
    int64_t first[N_SYSTEMS_REACH + 1];
    double  x[N_SYSTEMS_REACH * MOST_POINTS_REACH * 3];
    double  rows[N_SYSTEMS_REACH * 9];
    double  cutoffs[N_SYSTEMS_REACH];
    double  radii[N_SYSTEMS_REACH * MOST_POINTS_REACH];
    int32_t types[N_SYSTEMS_REACH * MOST_POINTS_REACH];
    double  supports[N_SYSTEMS_REACH * MOST_POINTS_REACH * 9];
    double  table[N_TYPES * N_TYPES];
    hs_box  box;
} batch_reach;

/* decades: over how many the radii of a system spread. */
static void
make_batch_reach(uint64_t seed, double decades, batch_reach *made_reach)
{
    harness_random random = {seed};
    memset(made_reach, 0, sizeof *made_reach);
    made_reach->box.ndim = 3;
    for (int s = 0; s < N_SYSTEMS_REACH; s++) {
        const int n = s % 7 == 3 ? 0 : 1 + (int)(random_unit(&random) * (MOST_POINTS_REACH - 1));
        made_reach->first[s + 1] = made_reach->first[s] + n;
        made_reach->cutoffs[s] = 0.3 + 1.2 * random_unit(&random);
        for (int k = 0; k < 9; k++)
            made_reach->rows[9 * s + k] = (k % 4 == 0 ? 3.0 : 0.0) + random_unit(&random);
    }
    for (int64_t e = 0; e < 3 * made_reach->first[N_SYSTEMS_REACH]; e++)
        made_reach->x[e] = 4.0 * random_unit(&random);
    for (int64_t i = 0; i < made_reach->first[N_SYSTEMS_REACH]; i++) {
        made_reach->radii[i] = 0.8 * pow(10.0, -decades * random_unit(&random));
        made_reach->types[i] = (int32_t)(N_TYPES * random_unit(&random));
        for (int e = 0; e < 9; e++) /* reaches 2 at most */
            made_reach->supports[9 * i + e] = e % 4 == 0 ? 1.0 / made_reach->radii[i] : 0.25;
    }
    for (int a = 0; a < N_TYPES; a++) {
        for (int b = 0; b <= a; b++) {
            const double cutoff = a + b == 0 ? -1.0 : decades > 1.0 ? 0.2 * (a + b) : 1.0;
            made_reach->table[a * N_TYPES + b] = made_reach->table[b * N_TYPES + a] = cutoff;
        }
    }
    for (int k = 0; k < 3; k++)
        made_reach->box.periodic[k] = true;
}

static hs_points
points_of_reach(const batch_reach *made_reach, int64_t first, int64_t end)
{
    return (hs_points){made_reach->x + 3 * first, end - first,   3, HS_FLOAT64,
                       3 * sizeof(double),        sizeof(double)};
}

typedef enum marks { RADII, TYPES, SUPPORTS } marks;

static hs_reach
reach_of(const batch_reach *made_reach, hs_rule rule, marks by)
{
    return by == TYPES      ? (hs_reach){.n_types = N_TYPES, .cutoffs = made_reach->table}
           : by == SUPPORTS ? (hs_reach){.rule = rule, .has_supports = true, .extent = 0.9}
                            : (hs_reach){.rule = rule};
}

/* Points from the first on, with all that is known of them. */
static hs_set
set_of_reach(const batch_reach *made_reach, int64_t first, int64_t end)
{
    return (hs_set){.at = points_of_reach(made_reach, first, end),
                    .radii = made_reach->radii + first,
                    .supports = made_reach->supports + 9 * first,
                    .types = made_reach->types + first};
}

/* Those of the first n systems. */
static hs_set
systems_of_reach(const batch_reach *made_reach, int64_t n)
{
    hs_set set = set_of_reach(made_reach, 0, made_reach->first[n]);
    set.n_systems = n;
    set.first = made_reach->first;
    return set;
}

/* Compares with single calls; returns the number of pairs, -1 when something differs. */
static int64_t
compare_reach(const batch_reach *made_reach, const hs_reach *reach, bool has_box, bool has_cutoffs,
              hs_options options, int threads)
{
    const hs_set         set = systems_of_reach(made_reach, N_SYSTEMS_REACH);
    const hs_each_system each = {.rows = has_box ? made_reach->rows : NULL,
                                 .cutoffs = has_cutoffs ? made_reach->cutoffs : NULL};
    const hs_among       systems = {
              .points = &set, .box = has_box ? &made_reach->box : NULL, .reach = reach, .each = &each};
    hs_pairs *pairs = NULL;
    int64_t   counts[N_SYSTEMS_REACH], at = 0;
    bool      same = true;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_SHIFT;
    options.threads = threads;
    if (hs_pairs_find(&systems, &options, &pairs, NULL) != HS_OK ||
        hs_pairs_count(&systems, &options, counts, NULL) != HS_OK) {
        hs_pairs_free(pairs);
        return -1;
    }
    const int64_t *i = hs_pairs_array(pairs, HS_WANT_I), *j = hs_pairs_array(pairs, HS_WANT_J);
    const double  *d = hs_pairs_array(pairs, HS_WANT_DISTANCE);
    const int32_t *shift = hs_pairs_array(pairs, HS_WANT_SHIFT);
    options.threads = 1;
    for (int s = 0; s < N_SYSTEMS_REACH; s++) {
        const int64_t first = made_reach->first[s];
        const hs_set  own = set_of_reach(made_reach, first, made_reach->first[s + 1]);
        hs_box        box = made_reach->box;
        hs_pairs     *expected = NULL;
        for (int k = 0; k < 9; k++)
            box.rows[k / 3][k % 3] = made_reach->rows[9 * s + k];
        options.cutoff = has_cutoffs ? made_reach->cutoffs[s] : options.cutoff;
        const hs_among among = {.points = &own, .box = has_box ? &box : NULL, .reach = reach};
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

static batch_reach made_reach;

/* In the order of these calls, too. */
static void
the_same_as_single_calls_reach(void)
{
    for (uint64_t seed = 1; seed <= TRIALS(8); seed++) {
        make_batch_reach(seed, seed % 2 == 1 ? 0.5 : 3.0, &made_reach);
        for (int kind = 0; kind < 16; kind++) {
            hs_options options = hs_options_default();
            options.cutoff = INFINITY;
            options.sorted = kind % 2 == 1;
            for (hs_rule rule = HS_RULE_SUM; rule <= HS_RULE_MIN; rule++) {
                const hs_reach reach = reach_of(&made_reach, rule, RADII);
                CHECK(compare_reach(&made_reach, &reach, kind & 2, kind & 8, options,
                                    kind & 4 ? 3 : 1) >= 0);
            }
            for (hs_rule rule = HS_RULE_MAX; rule <= HS_RULE_MIN; rule++) {
                const hs_reach reach = reach_of(&made_reach, rule, SUPPORTS);
                CHECK(compare_reach(&made_reach, &reach, kind & 2, kind & 8, options,
                                    kind & 4 ? 3 : 1) >= 0);
            }
            const hs_reach by_types = reach_of(&made_reach, HS_RULE_SUM, TYPES);
            options.cutoff = 0.7;
            CHECK(compare_reach(&made_reach, &by_types, kind & 2, kind & 8, options,
                                kind & 4 ? 3 : 1) > 30);
        }
    }
}

static void
every_algorithm_is_the_same_as_single_calls(void)
{
    make_batch_reach(31, 2.0, &made_reach);
    const hs_reach reach = reach_of(&made_reach, HS_RULE_SUM, RADII);
    const hs_reach of_supports = reach_of(&made_reach, HS_RULE_MAX, SUPPORTS);
    for (hs_algorithm a = HS_AUTO; a < HS_ALGORITHM_END; a++) {
        hs_options options = hs_options_default();
        options.cutoff = INFINITY;
        options.algorithm = a;
        CHECK(compare_reach(&made_reach, &reach, true, false, options, 1) > 100);
        CHECK(compare_reach(&made_reach, &of_supports, true, false, options, 1) > 10);
    }
}

/* Rows are counted through all systems. */
static void
failures_name_system_and_point(void)
{
    hs_failure failure;
    hs_pairs  *pairs = NULL;
    hs_options options = hs_options_default();
    make_batch_reach(32, 1.0, &made_reach);
    const int64_t  row = made_reach.first[20] + 1;
    const hs_reach reach = reach_of(&made_reach, HS_RULE_SUM, RADII);
    const hs_reach by_types = reach_of(&made_reach, HS_RULE_SUM, TYPES);
    const hs_reach of_supports = reach_of(&made_reach, HS_RULE_MIN, SUPPORTS);
    const hs_reach sums = reach_of(&made_reach, HS_RULE_SUM, SUPPORTS);
    const hs_reach directed = {.rule = HS_RULE_GATHER};
    hs_set         set = systems_of_reach(&made_reach, N_SYSTEMS_REACH);
    hs_each_system each = {.rows = NULL};
    hs_among       systems = {.points = &set, .reach = &reach, .each = &each};
    const double   radius = made_reach.radii[row], x = made_reach.x[3 * row];
    const int32_t  type = made_reach.types[row];
    options.cutoff = INFINITY;
    made_reach.radii[row] = -1.0;
    CHECK(hs_pairs_find(&systems, &options, &pairs, &failure) == HS_ERR_RADII);
    CHECK(failure.row == row && failure.value == -1.0 && failure.system == 20 && pairs == NULL);
    made_reach.radii[row] = radius;
    made_reach.x[3 * row] = NAN;
    CHECK(hs_pairs_find(&systems, &options, &pairs, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == row && failure.column == 0 && failure.system == 20);
    made_reach.x[3 * row] = x;
    each.cutoffs = made_reach.cutoffs;
    made_reach.cutoffs[20] = -2.0;
    CHECK(hs_pairs_find(&systems, &options, &pairs, &failure) == HS_ERR_CUTOFF);
    CHECK(failure.value == -2.0 && failure.system == 20);
    each.cutoffs = NULL;
    systems.reach = &by_types;
    CHECK(hs_pairs_find(&systems, &options, &pairs, &failure) == HS_ERR_CUTOFF);
    options.cutoff = 1.0;
    made_reach.types[row] = N_TYPES;
    CHECK(hs_pairs_find(&systems, &options, &pairs, &failure) == HS_ERR_TYPES);
    CHECK(failure.row == row && failure.value == N_TYPES);
    made_reach.types[row] = type;
    made_reach.types[row] = type;
    systems.reach = &of_supports;
    options.cutoff = INFINITY;
    made_reach.supports[9 * row + 1] = INFINITY;
    CHECK(hs_pairs_find(&systems, &options, &pairs, &failure) == HS_ERR_SUPPORTS);
    CHECK(failure.row == row && failure.system == 20);
    made_reach.supports[9 * row + 1] = 0.25;
    systems.reach = &sums;
    CHECK(hs_pairs_find(&systems, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    systems.reach = &directed;
    CHECK(hs_pairs_find(&systems, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    systems.reach = &reach;
    set.radii = NULL;
    CHECK(hs_pairs_find(&systems, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    set.radii = made_reach.radii;
    systems.box = &made_reach.box;
    each.rows = made_reach.rows;
    memset(made_reach.rows + 9 * 3, 0, 9 * sizeof(double)); /* of a system without points */
    CHECK(hs_pairs_find(&systems, &options, &pairs, &failure) == HS_ERR_BOX_DEPENDENT);
    CHECK(failure.system == 3);
}

/* Neither supports of which there are none, nor a table without a bound for it. */
static void
reaches_that_systems_cannot_have_are_refused(void)
{
    static const int bad[] = {7, 0, N_SYSTEMS_REACH - 1};
    int64_t          counts[N_SYSTEMS_REACH];
    hs_options       options = hs_options_default();
    hs_failure       failure;
    make_batch_reach(35, 1.0, &made_reach);
    const hs_reach by_types = reach_of(&made_reach, HS_RULE_SUM, TYPES);
    const hs_reach by_supports = {.rule = HS_RULE_MAX, .has_supports = true, .extent = 1.0};
    hs_set         set = systems_of_reach(&made_reach, N_SYSTEMS_REACH);
    hs_each_system each = {.rows = NULL};
    hs_among       systems = {.points = &set, .reach = &by_supports, .each = &each};
    set.supports = NULL;
    options.cutoff = INFINITY;
    memset(&failure, 0x5a, sizeof failure);
    CHECK(hs_pairs_count(&systems, &options, counts, &failure) == HS_ERR_ARGUMENT);
    CHECK(failure.row == -1 && failure.system == -1);
    systems.reach = &by_types;
    each.cutoffs = made_reach.cutoffs;
    for (int b = 0; b < 3; b++) { /* the first of them is named */
        hs_pairs *pairs = (hs_pairs *)&set;
        made_reach.cutoffs[bad[b]] = INFINITY;
        const int first = b == 0 ? bad[0] : 0;
        CHECK(hs_pairs_find(&systems, &options, &pairs, &failure) == HS_ERR_CUTOFF);
        CHECK(pairs == NULL && failure.value == INFINITY && failure.system == first);
        CHECK(hs_pairs_count(&systems, &options, counts, &failure) == HS_ERR_CUTOFF);
        CHECK(failure.value == INFINITY && failure.system == first);
    }
    for (int b = 0; b < 3; b++)
        made_reach.cutoffs[bad[b]] = 1.0;
    CHECK(hs_pairs_count(&systems, &options, counts, &failure) == HS_OK);
}

static hs_status
find_all(void *context)
{
    const hs_among *systems = context;
    hs_options      options = hs_options_default();
    hs_pairs       *pairs = NULL;
    options.cutoff = INFINITY;
    options.sorted = systems->box == NULL;
    const hs_status status = hs_pairs_find(systems, &options, &pairs, NULL);
    hs_pairs_free(pairs);
    return status;
}

static void
nothing_leaks_when_memory_is_short(void)
{
    make_batch_reach(33, 2.0, &made_reach);
    const hs_reach reach = reach_of(&made_reach, HS_RULE_SUM, RADII);
    const hs_set   set = systems_of_reach(&made_reach, 5);
    hs_each_system each = {.rows = NULL};
    hs_among       systems = {.points = &set, .reach = &reach, .each = &each};
    CHECK(fail_each_allocation(find_all, &systems, 20000) > 5);
    check_arena(find_all, &systems);
    systems.box = &made_reach.box;
    each.rows = made_reach.rows;
    CHECK(fail_each_allocation(find_all, &systems, 20000) > 5);
    check_arena(find_all, &systems);
    const hs_reach of_supports = reach_of(&made_reach, HS_RULE_MAX, SUPPORTS);
    systems.reach = &of_supports;
    CHECK(fail_each_allocation(find_all, &systems, 20000) > 5);
    check_arena(find_all, &systems);
}

/* Small reaches have one image of a pair and large ones several: pairs of both are sorted. */
static void
steps_with_and_without_images_are_sorted_together(void)
{
    enum { N = 200 };
    static double x[3 * N], radii[N];
    const int64_t first[] = {0, N};
    const hs_box  box = {
         .ndim = 3, .periodic = {true, true, true}, .rows = {{4.0}, {0.0, 4.0}, {0.0, 0.0, 4.0}}};
    const hs_reach reach = {.rule = HS_RULE_MAX};
    hs_set         set = {
                .at = {x, N, 3, HS_FLOAT64, 24, 8}, .radii = radii, .n_systems = 1, .first = first};
    hs_among       systems = {.points = &set, .box = &box, .reach = &reach};
    hs_options     options = hs_options_default();
    harness_random random = {62};
    hs_pairs      *many, *one;
    for (int e = 0; e < 3 * N; e++)
        x[e] = 4.0 * random_unit(&random);
    for (int i = 0; i < N; i++)
        radii[i] = i < N - 5 ? 0.4 : 2.2;
    options.cutoff = INFINITY;
    options.sorted = true;
    options.algorithm = HS_HIERARCHY;
    CHECK(hs_pairs_find(&systems, &options, &many, NULL) == HS_OK);
    set.first = NULL;
    CHECK(hs_pairs_find(&systems, &options, &one, NULL) == HS_OK);
    const size_t n = (size_t)hs_pairs_length(one);
    CHECK(n > N && hs_pairs_length(many) == (int64_t)n);
    CHECK(memcmp(hs_pairs_array(many, HS_WANT_I), hs_pairs_array(one, HS_WANT_I), 8 * n) == 0);
    CHECK(memcmp(hs_pairs_array(many, HS_WANT_J), hs_pairs_array(one, HS_WANT_J), 8 * n) == 0);
    hs_pairs_free(many);
    hs_pairs_free(one);
}

/* ---- what one of many systems has of the arrays of all ---- */

enum { OF_ALL = 24, Q_OF_ALL = 12, PARTS = 5 };

/* What is asked of many systems, or of one of them: queries are every second point. */
typedef struct chosen {
    double       x[OF_ALL * 2], q[Q_OF_ALL * 2];
    int64_t      groups[OF_ALL], labels[OF_ALL], q_groups[Q_OF_ALL], q_labels[Q_OF_ALL];
    int64_t      numbers[Q_OF_ALL], excluded[2 * OF_ALL];
    hs_points    at, q_at;
    hs_set       points, queries;
    hs_selection selection;
    hs_among     among;
} chosen;

static const int64_t part_first[] = {0, 0, 10, 14, 24, 24}, part_query[] = {0, 0, 5, 7, 12, 12};
static const double  part_rows[PARTS * 4] = {9.0, 0.0, 0.0,  9.0, 1.5, 0.0, 0.5, 1.25, 4.0, 0.0,
                                             0.0, 4.0, 1.25, 0.0, 0.0, 1.0, 9.0, 0.0,  0.0, 9.0};
static const uint8_t part_periodic[PARTS] = {3, 3, 2, 1, 3};

/* Points, and the same numbered from `first` on. */
static void
make_chosen(chosen *c, int s, bool has_queries, bool has_numbers, const hs_selection *selection)
{
    const int64_t  first = s < 0 ? 0 : part_first[s], end = s < 0 ? OF_ALL : part_first[s + 1];
    const int64_t  first_query = first / 2, of_asking = has_queries && !has_numbers ? 2 : 1;
    harness_random random = {5};
    memset(c, 0, sizeof *c);
    for (int64_t i = 0; i < OF_ALL; i++) {
        const double  x = 1.5 * random_unit(&random), y = 1.5 * random_unit(&random);
        const int64_t j = (i * 7 + 3) % OF_ALL, at = c->selection.n_excluded;
        if (i < first || i >= end)
            continue;
        const int64_t own = i - first;
        c->x[2 * own] = c->q[own - own % 2] = x;
        c->x[2 * own + 1] = c->q[own - own % 2 + 1] = y;
        c->groups[own] = c->q_groups[own / 2] = i % 3;
        c->labels[own] = c->q_labels[own / 2] = i / 3;
        c->numbers[own / 2] = own - own % 2;
        if (i % of_asking == 0 && j >= first && j < end) { /* pairs of two systems are none */
            c->excluded[2 * at] = i / of_asking - (of_asking == 2 ? first_query : first);
            c->excluded[2 * at + 1] = j - first;
            c->selection.n_excluded++;
        }
    }
    const int64_t n_excluded = c->selection.n_excluded, n = end - first;
    c->selection = *selection;
    c->selection.n_excluded = selection->n_excluded != 0 ? n_excluded : 0;
    c->selection.excluded = c->excluded;
    c->selection.query_numbers = has_numbers ? c->numbers : NULL;
    c->at = (hs_points){c->x, n, 2, HS_FLOAT64, 16, 8};
    c->q_at = (hs_points){c->q, n / 2, 2, HS_FLOAT64, 16, 8};
    c->points = (hs_set){.at = c->at, .groups = c->groups, .labels = c->labels};
    c->queries = (hs_set){.at = c->q_at, .groups = c->q_groups, .labels = c->q_labels};
    c->among = (hs_among){.points = &c->points,
                          .queries = has_queries ? &c->queries : NULL,
                          .selection = &c->selection};
}

/* Pairs, rows or nearest points. */
static hs_pairs *
find_chosen(const chosen *c, int what, const hs_options *options)
{
    hs_pairs       *pairs = NULL;
    const hs_status status = what == 0   ? hs_pairs_find(&c->among, options, &pairs, NULL)
                             : what == 1 ? hs_neighbors_find(&c->among, options, &pairs, NULL)
                                         : hs_nearest_find(&c->among, 3, options, &pairs, NULL);
    CHECK(status == HS_OK);
    return pairs;
}

/* Each system has its pairs, with its box, its labels, and the pairs that it excludes. */
static int64_t
compare_chosen(int what, bool has_queries, bool has_numbers, const hs_selection *selection,
               int threads)
{
    static chosen        all, one;
    hs_box               box = {.ndim = 2};
    const hs_each_system each = {.rows = part_rows, .periodic = part_periodic};
    hs_options           options = hs_options_default();
    int64_t              at = 0;
    options.cutoff = 0.9;
    options.sorted = true;
    options.threads = threads;
    options.want = HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_SHIFT;
    make_chosen(&all, -1, has_queries, has_numbers, selection);
    all.points.n_systems = all.queries.n_systems = PARTS;
    all.points.first = part_first;
    all.queries.first = part_query;
    all.among.box = &box;
    all.among.each = &each;
    hs_pairs      *of_all = find_chosen(&all, what, &options);
    const int64_t *j = hs_pairs_array(of_all, HS_WANT_J);
    const double  *d = hs_pairs_array(of_all, HS_WANT_DISTANCE);
    const int32_t *shift = hs_pairs_array(of_all, HS_WANT_SHIFT);
    for (int s = 0; s < PARTS; s++) {
        make_chosen(&one, s, has_queries, has_numbers, selection);
        memcpy(box.rows[0], part_rows + 4 * s, 2 * sizeof(double));
        memcpy(box.rows[1], part_rows + 4 * s + 2, 2 * sizeof(double));
        box.periodic[0] = part_periodic[s] & 1;
        box.periodic[1] = part_periodic[s] & 2;
        one.among.box = &box;
        hs_pairs      *own = find_chosen(&one, what, &options);
        const int64_t  n = hs_pairs_length(own);
        const int64_t *own_j = hs_pairs_array(own, HS_WANT_J);
        CHECK(at + n <= hs_pairs_length(of_all));
        for (int64_t e = 0; e < n; e++)
            CHECK(j[at + e] == (own_j[e] < 0 ? -1 : own_j[e] + part_first[s]));
        const size_t m = (size_t)n;
        CHECK(m == 0 || memcmp(d + at, hs_pairs_array(own, HS_WANT_DISTANCE), 8 * m) == 0);
        CHECK(m == 0 || memcmp(shift + 2 * at, hs_pairs_array(own, HS_WANT_SHIFT), 8 * m) == 0);
        at += n;
        hs_pairs_free(own);
    }
    CHECK(at == hs_pairs_length(of_all));
    hs_pairs_free(of_all);
    return at;
}

static void
each_system_has_its_box_and_selection(void)
{
    const hs_selection selections[] = {
        {.has_groups = true},
        {.has_labels = true},
        {.has_labels = true, .within = 1, .has_groups = true},
        {.n_excluded = 1},
        {.n_excluded = 1, .min_distance = 0.2},
    };
    int64_t before = 0;
    for (size_t k = 0; k < sizeof selections / sizeof *selections; k++) {
        for (int kind = 0; kind < 14; kind++) { /* half lists have no queries */
            const int what = kind < 2 ? 0 : 1 + (kind - 2) / 6,
                      queried = kind < 2 ? 0 : kind / 2 % 3;
            CHECK(compare_chosen(what, queried > 0, queried > 1, &selections[k], 1 + kind % 2) > 5);
        }
        before = compare_chosen(1, false, false, &selections[k], 1);
    }
    CHECK(before < compare_chosen(1, false, false, &(hs_selection){.within = 0}, 1));
}

typedef struct noted_pairs {
    const int64_t *i, *j;
    int64_t        n, most;
} noted_pairs;

/* A hs_pairs_fn: compares them with those that were found. */
static int
compare_visited(const hs_pair_arrays *pairs, int64_t n, int64_t *n_taken, void *user)
{
    noted_pairs   *noted = user;
    const int64_t *i = pairs->i, *j = pairs->j;
    for (int64_t e = 0; e < n && noted->n < noted->most; e++, noted->n++) {
        CHECK(i[e] == noted->i[noted->n] && j[e] == noted->j[noted->n]);
        *n_taken = e + 1;
    }
    return noted->n == noted->most;
}

/* Visits come in the order of pairs, and may end in any system; clusters are those of all pairs. */
static void
visits_and_clusters_go_over_all_systems(void)
{
    static chosen        all;
    const hs_box         box = {.ndim = 2};
    const hs_each_system each = {.rows = part_rows, .periodic = part_periodic};
    const hs_selection   selection = {.has_labels = true};
    hs_options           options = hs_options_default();
    int64_t              labels[OF_ALL], own_labels[OF_ALL], n_clusters, n, n_found;
    uint8_t              winding[OF_ALL], own_winding[OF_ALL];
    hs_pairs            *pairs;
    options.cutoff = 0.6;
    for (options.threads = 1; options.threads <= 2; options.threads++) {
        make_chosen(&all, -1, false, false, &selection);
        all.points.n_systems = PARTS;
        all.points.first = part_first;
        all.among.box = &box;
        all.among.each = &each;
        CHECK(hs_pairs_find(&all.among, &options, &pairs, NULL) == HS_OK);
        n_found = hs_pairs_length(pairs);
        for (int part = 1; part <= 3; part++) {
            noted_pairs noted = {hs_pairs_array(pairs, HS_WANT_I), hs_pairs_array(pairs, HS_WANT_J),
                                 0, n_found * part / 3};
            const hs_visit visit = {.pairs = compare_visited, .user = &noted};
            CHECK(hs_pairs_visit(&all.among, &options, &visit, &n, NULL) == HS_OK);
            CHECK(n == noted.most && noted.n == n);
        }
        hs_pairs_free(pairs);
        CHECK(hs_clusters_find(&all.among, &options, NULL, labels, winding, &n_clusters, NULL) ==
              HS_OK);
        int64_t before = 0;
        for (int s = 0; s < PARTS; s++) {
            hs_box own_box = box;
            make_chosen(&all, s, false, false, &selection);
            memcpy(own_box.rows[0], part_rows + 4 * s, 2 * sizeof(double));
            memcpy(own_box.rows[1], part_rows + 4 * s + 2, 2 * sizeof(double));
            own_box.periodic[0] = part_periodic[s] & 1;
            own_box.periodic[1] = part_periodic[s] & 2;
            all.among.box = &own_box;
            CHECK(hs_clusters_find(&all.among, &options, NULL, own_labels, own_winding, &n, NULL) ==
                  HS_OK);
            for (int64_t i = 0; i < all.at.n; i++)
                CHECK(labels[part_first[s] + i] == own_labels[i] + before);
            CHECK(memcmp(winding + before, own_winding, (size_t)n) == 0);
            before += n;
        }
        CHECK(before == n_clusters);
    }
}

/* Systems that share the vectors of a box and not which of them repeat, if any does. */
static void
what_repeats_may_be_of_each_system(void)
{
    const double         x[] = {0.1, 0.9, 0.1, 0.9};
    const int64_t        first[] = {0, 2, 4};
    const uint8_t        bits[] = {0, 1}, none[] = {0, 0};
    const hs_set         set = {.at = {x, 4, 1, HS_FLOAT64, 8, 8}, .n_systems = 2, .first = first};
    const hs_box         box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    const hs_each_system each = {.periodic = bits}, open = {.periodic = none};
    hs_among             systems = {.points = &set, .box = &box, .each = &each};
    hs_options           options = hs_options_default();
    int64_t              labels[4], n, counts[2];
    uint8_t              winding[4];
    options.cutoff = 0.3;
    CHECK(hs_pairs_count(&systems, &options, counts, NULL) == HS_OK);
    CHECK(counts[0] == 0 && counts[1] == 1);
    CHECK(hs_clusters_find(&systems, &options, NULL, labels, winding, &n, NULL) == HS_OK);
    CHECK(n == 3 && labels[1] == 1 && labels[3] == 2);
    systems.each = &open;
    CHECK(hs_clusters_find(&systems, &options, NULL, labels, winding, &n, NULL) == HS_OK);
    CHECK(n == 4 && winding[3] == 0);
}

/* Queries that are points are those of their own system. */
static void
numbers_of_another_system_are_refused(void)
{
    static chosen      all;
    const hs_selection selection = {.has_labels = true};
    const hs_options   options = hs_options_default();
    hs_pairs          *pairs = NULL;
    hs_failure         failure;
    make_chosen(&all, -1, true, true, &selection);
    all.points.n_systems = all.queries.n_systems = PARTS;
    all.points.first = part_first;
    all.queries.first = part_query;
    all.numbers[6] = 14;
    CHECK(hs_neighbors_find(&all.among, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    CHECK(failure.system == 2 && pairs == NULL);
    all.numbers[6] = 9;
    CHECK(hs_nearest_find(&all.among, 1, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    CHECK(failure.system == 2 && pairs == NULL);
}

/* ---- one call for each of many systems: polls, threads, and what failures say ---- */

enum {
    N_SYSTEMS_EACH = 50,
    POINTS_EACH = 60,
    N_EACH = N_SYSTEMS_EACH * POINTS_EACH,
    N_QUERIES = 2 * N_SYSTEMS_EACH
};

static struct {
    double     x[N_EACH * 3], q[N_QUERIES * 3];
    int64_t    first[N_SYSTEMS_EACH + 1], first_query[N_SYSTEMS_EACH + 1], counts[N_EACH];
    hs_set     points, queries;
    hs_among   systems;
    hs_options options;
} s_each;

static void
make_scene(void)
{
    harness_random random = {77};
    for (int e = 0; e < N_EACH * 3; e++)
        s_each.x[e] = random_unit(&random);
    for (int e = 0; e < N_QUERIES * 3; e++)
        s_each.q[e] = random_unit(&random);
    for (int n = 0; n <= N_SYSTEMS_EACH; n++) {
        s_each.first[n] = n * POINTS_EACH;
        s_each.first_query[n] = 2 * n;
    }
    s_each.points = (hs_set){.at = {s_each.x, N_EACH, 3, HS_FLOAT64, 24, 8},
                             .n_systems = N_SYSTEMS_EACH,
                             .first = s_each.first};
    s_each.queries = (hs_set){.at = {s_each.q, N_QUERIES, 3, HS_FLOAT64, 24, 8},
                              .n_systems = N_SYSTEMS_EACH,
                              .first = s_each.first_query};
    s_each.systems = (hs_among){.points = &s_each.points};
    s_each.options = hs_options_default();
    s_each.options.cutoff = 0.4;
    s_each.options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
}

static hs_status
find_rows(void *context)
{
    hs_pairs  *rows;
    hs_failure failure;
    s_each.systems.queries = context;
    const hs_status status = hs_neighbors_find(&s_each.systems, &s_each.options, &rows, &failure);
    hs_pairs_free(rows);
    return status;
}

static void
memory_may_be_short(void)
{
    static const int64_t pair[] = {0, 1};
    const hs_selection   one_excluded = {.n_excluded = 1, .excluded = pair};
    make_scene();
    s_each.points.n_systems = s_each.queries.n_systems = 6;
    s_each.points.at.n = s_each.first[6];
    s_each.queries.at.n = s_each.first_query[6];
    for (s_each.options.threads = 1; s_each.options.threads <= 2; s_each.options.threads++) {
        CHECK(fail_each_allocation(find_rows, NULL, 2000) > 10);
        check_arena(find_rows, NULL);
        CHECK(fail_each_allocation(find_rows, &s_each.queries, 2000) > 10);
        check_arena(find_rows, &s_each.queries);
        CHECK(raise_memory_limit(find_rows, NULL, &s_each.options.memory_limit) > 3);
        s_each.systems.selection = &one_excluded;
        CHECK(fail_each_allocation(find_rows, NULL, 2000) > 10);
        check_arena(find_rows, NULL);
        s_each.systems.selection = NULL;
    }
}

/* The row of a box is not that of a point. */
static void
rows_of_boxes_stay(void)
{
    static double boxes[N_SYSTEMS_EACH * 9];
    const hs_box  box = {.ndim = 3, .periodic = {true, true, true}};
    hs_failure    failure;
    make_scene();
    for (int n = 0; n < N_SYSTEMS_EACH; n++) {
        for (int k = 0; k < 3; k++)
            boxes[9 * n + 4 * k] = 3.0;
    }
    s_each.systems.box = &box;
    s_each.systems.each = &(hs_each_system){.rows = boxes};
    boxes[9 * 7 + 8] = 0.0;
    CHECK(hs_neighbors_count(&s_each.systems, &s_each.options, s_each.counts, &failure) ==
          HS_ERR_BOX_DEPENDENT);
    CHECK(failure.row == 2 && failure.system == 7);
    boxes[9 * 7 + 8] = INFINITY;
    CHECK(hs_neighbors_count(&s_each.systems, &s_each.options, s_each.counts, &failure) ==
          HS_ERR_BOX_FINITE);
    CHECK(failure.row == 2 && failure.column == 2 && failure.system == 7);
}

/* What all systems share is looked at where there are none. */
static void
without_systems_all_else_is_checked(void)
{
    const hs_selection numbered = {.n_excluded = 1, .excluded = (const int64_t[]){0, 0}};
    const hs_reach     reach = {.rule = HS_RULE_END};
    hs_counters        counters = {.pairs = 7};
    make_scene();
    s_each.points.n_systems = s_each.points.at.n = 0;
    s_each.options.counters = &counters;
    CHECK(find_rows(NULL) == HS_OK && counters.pairs == 0);
    s_each.options.cutoff = -1.0;
    CHECK(find_rows(NULL) == HS_ERR_CUTOFF);
    s_each.options.cutoff = 1.0;
    s_each.systems.selection = &numbered;
    CHECK(find_rows(NULL) == HS_ERR_ARGUMENT);
    s_each.systems.selection = NULL;
    s_each.systems.reach = &reach;
    CHECK(find_rows(NULL) == HS_ERR_ARGUMENT);
    s_each.systems.reach = NULL;
    s_each.options.kernel = "none";
    CHECK(find_rows(NULL) == HS_ERR_KERNEL);
}

/* Numbers of a call that are sums of those of others. */
static void
add_work(const hs_counters *more, hs_counters *sum)
{
    sum->pairs += more->pairs;
    sum->groups += more->groups;
    sum->candidates += more->candidates;
    sum->ambiguous += more->ambiguous;
    sum->by_float64 += more->by_float64;
    sum->by_double_word += more->by_double_word;
    sum->by_integers += more->by_integers;
}

static bool
is_same_work(const hs_counters *one, const hs_counters *other)
{
    return one->pairs == other->pairs && one->groups == other->groups &&
           one->candidates == other->candidates && one->ambiguous == other->ambiguous &&
           one->by_float64 == other->by_float64 && one->by_double_word == other->by_double_word &&
           one->by_integers == other->by_integers;
}

/* What is done is what calls for each of the systems do, by however many threads: of lattice points
 * many are at the cutoff, some but for 2^-30, for a rounding, or for the square of 2^-60. */
static void
work_of_all_systems_is_added_up(void)
{
    harness_random random = {78};
    hs_counters    single = {.pairs = 0}, sum = {.pairs = 0}, all;
    int64_t        most_bytes = 0;
    make_scene();
    for (int e = 0; e < N_EACH * 3; e++) {
        const double at = (double)(random_bits(&random) % 6) / (e < N_EACH ? 3.0 : 2.0);
        s_each.x[e] = at > 0.0 ? at + (double)(e % 7 == 0) * 0x1p-30 : (double)(e % 2) * 0x1p-60;
    }
    s_each.options.cutoff = 1.0;
    s_each.options.counters = &single;
    for (int n = 0; n < N_SYSTEMS_EACH; n++) {
        hs_pairs       *rows;
        const hs_points own = {s_each.x + s_each.first[n] * 3, POINTS_EACH, 3, HS_FLOAT64, 24, 8};
        const hs_among  among = {.points = SET(&own)};
        CHECK(hs_neighbors_find(&among, &s_each.options, &rows, NULL) == HS_OK);
        hs_pairs_free(rows);
        add_work(&single, &sum);
        most_bytes = single.bytes_peak > most_bytes ? single.bytes_peak : most_bytes;
    }
    CHECK(sum.ambiguous > 0 && sum.by_float64 > 0 && sum.by_double_word > 0 && sum.by_integers > 0);
    s_each.options.counters = &all;
    for (s_each.options.threads = 1; s_each.options.threads <= 2; s_each.options.threads++) {
        CHECK(find_rows(NULL) == HS_OK);
        CHECK(is_same_work(&all, &sum));
        CHECK(all.bytes[HS_FOR_POINTS] > 0 && all.bytes_peak >= most_bytes);
    }
}

/* More threads than systems, and systems that are a range of their own. */
static void
few_large_systems(void)
{
    const int64_t ends[] = {0, N_EACH / 2, N_EACH}, of_queries[] = {0, 1, 2};
    hs_pairs     *one, *many;
    make_scene();
    s_each.options.cutoff = 0.1;
    s_each.queries.at.n = 2;
    s_each.points.n_systems = s_each.queries.n_systems = 2;
    s_each.points.first = ends;
    s_each.queries.first = of_queries;
    CHECK(hs_neighbors_find(&s_each.systems, &s_each.options, &one, NULL) == HS_OK);
    s_each.options.threads = 4;
    CHECK(hs_neighbors_find(&s_each.systems, &s_each.options, &many, NULL) == HS_OK);
    CHECK(hs_pairs_length(one) > N_EACH && hs_pairs_length(one) == hs_pairs_length(many));
    CHECK(memcmp(hs_pairs_array(one, HS_WANT_J), hs_pairs_array(many, HS_WANT_J),
                 (size_t)hs_pairs_length(one) * 8) == 0);
    hs_pairs_free(one);
    hs_pairs_free(many);
    CHECK(find_rows(&s_each.queries) == HS_OK);
}

/* ---- rows, nearest points and histograms of many systems, against one call for each ---- */

enum {
    N_SYSTEMS_ROWS = 20,
    MOST = 40,
    N_EDGES = 4,
    N_TYPES_ROWS = 2,
    CELLS = N_TYPES_ROWS * N_TYPES_ROWS * N_EDGES
};

static struct {
    double         x[N_SYSTEMS_ROWS * MOST * 3], q[N_SYSTEMS_ROWS * MOST * 3];
    double         rows[N_SYSTEMS_ROWS * 9], cutoffs[N_SYSTEMS_ROWS], edges[N_EDGES];
    int64_t        first[N_SYSTEMS_ROWS + 1], first_query[N_SYSTEMS_ROWS + 1];
    int64_t        groups[N_SYSTEMS_ROWS * MOST], query_groups[N_SYSTEMS_ROWS * MOST];
    double         radii[N_SYSTEMS_ROWS * MOST];
    int32_t        types[N_SYSTEMS_ROWS * MOST];
    double         weights[N_SYSTEMS_ROWS * MOST];
    hs_box         box;
    hs_set         points, queries;
    hs_selection   selection;
    hs_reach       reach;
    hs_each_system each;
    hs_among       systems;
    hs_options     options;
} s_rows;

static hs_points
points_at(const double *x, const int64_t *first, int64_t n)
{
    return (hs_points){x + 3 * first[n], first[n + 1] - first[n], 3, HS_FLOAT64, 24, 8};
}

static void
make_scene_rows(uint64_t seed)
{
    harness_random random = {seed};
    memset(&s_rows, 0, sizeof s_rows);
    for (int n = 0; n < N_SYSTEMS_ROWS; n++) {
        const int64_t more = n % 7 == 3 ? 0 : (int64_t)(random_unit(&random) * MOST);
        s_rows.first[n + 1] = s_rows.first[n] + more;
        s_rows.first_query[n + 1] = s_rows.first_query[n] + (int64_t)(random_unit(&random) * 6);
        s_rows.cutoffs[n] = 0.5 + random_unit(&random);
        for (int k = 0; k < 9; k++)
            s_rows.rows[9 * n + k] = (k % 4 == 0 ? 3.0 : 0.0) + 0.5 * random_unit(&random);
    }
    for (int e = 0; e < N_SYSTEMS_ROWS * MOST * 3; e++) {
        s_rows.x[e] = 2.5 * random_unit(&random);
        s_rows.q[e] = 2.5 * random_unit(&random);
    }
    for (int e = 0; e < N_SYSTEMS_ROWS * MOST; e++) {
        s_rows.groups[e] = (int64_t)(3.0 * random_unit(&random));
        s_rows.query_groups[e] = (int64_t)(3.0 * random_unit(&random));
        s_rows.radii[e] = random_unit(&random);
        s_rows.types[e] = e % N_TYPES_ROWS;
        s_rows.weights[e] = random_unit(&random) - 0.25;
    }
    for (int k = 0; k < N_EDGES; k++)
        s_rows.edges[k] = 0.4 * (k + 1);
    s_rows.box = (hs_box){.ndim = 3, .periodic = {true, true, false}};
    s_rows.points = (hs_set){.at = {s_rows.x, s_rows.first[N_SYSTEMS_ROWS], 3, HS_FLOAT64, 24, 8},
                             .radii = s_rows.radii,
                             .weights = s_rows.weights,
                             .types = s_rows.types,
                             .groups = s_rows.groups,
                             .n_systems = N_SYSTEMS_ROWS,
                             .first = s_rows.first};
    s_rows.queries = s_rows.points;
    s_rows.queries.at.data = s_rows.q;
    s_rows.queries.at.n = s_rows.first_query[N_SYSTEMS_ROWS];
    s_rows.queries.groups = s_rows.query_groups;
    s_rows.queries.first = s_rows.first_query;
    s_rows.selection = (hs_selection){.has_groups = true};
    s_rows.reach = (hs_reach){.rule = HS_RULE_SUM};
    s_rows.each = (hs_each_system){.rows = s_rows.rows};
    s_rows.systems = (hs_among){.points = &s_rows.points, .box = &s_rows.box, .each = &s_rows.each};
    s_rows.options = hs_options_default();
    s_rows.options.cutoff = 1.0;
    s_rows.options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_SHIFT | HS_WANT_BOTH;
}

/* One system by itself. */
typedef struct single_rows {
    hs_set     points, queries;
    hs_box     box;
    hs_options options;
    hs_among   among;
} single_rows;

/* The points of one system, with what is known of them. */
static hs_set
set_at(const hs_set *all, const double *x, int n)
{
    const int64_t first = all->first[n];
    return (hs_set){.at = points_at(x, all->first, n),
                    .radii = all->radii + first,
                    .weights = all->weights + first,
                    .types = all->types + first,
                    .groups = all->groups + first};
}

static void
take_single(int n, bool has_queries, single_rows *one)
{
    *one = (single_rows){.points = set_at(&s_rows.points, s_rows.x, n),
                         .queries = set_at(&s_rows.queries, s_rows.q, n),
                         .box = s_rows.box,
                         .options = s_rows.options};
    for (int k = 0; k < 9; k++)
        one->box.rows[k / 3][k % 3] = s_rows.rows[9 * n + k];
    one->options.threads = 1;
    one->options.cutoff = s_rows.each.cutoffs != NULL ? s_rows.cutoffs[n] : s_rows.options.cutoff;
    one->among = (hs_among){.points = &one->points,
                            .box = s_rows.systems.box != NULL ? &one->box : NULL,
                            .queries = has_queries ? &one->queries : NULL,
                            .reach = s_rows.systems.reach,
                            .selection = s_rows.systems.selection};
}

/* Compares pairs [at, at + n) of all with those of one system; k: of the nearest, or 0. */
static void
compare_pairs(const hs_pairs *all, int64_t at, const hs_pairs *own, int n, bool has_queries)
{
    const int64_t  n_pairs = hs_pairs_length(own);
    const int64_t *i = hs_pairs_array(all, HS_WANT_I), *j = hs_pairs_array(all, HS_WANT_J);
    const int64_t *both = hs_pairs_array(all, HS_WANT_BOTH);
    const int64_t *a = hs_pairs_array(own, HS_WANT_I), *b = hs_pairs_array(own, HS_WANT_J);
    const double  *d = hs_pairs_array(all, HS_WANT_DISTANCE);
    const double  *c = hs_pairs_array(own, HS_WANT_DISTANCE);
    const int64_t  first = s_rows.first[n], asking = has_queries ? s_rows.first_query[n] : first;
    CHECK(at + n_pairs <= hs_pairs_length(all));
    for (int64_t p = 0; p < n_pairs; p++) {
        CHECK(j[at + p] == (b[p] < 0 ? -1 : b[p] + first) && d[at + p] == c[p]);
        CHECK(i == NULL || i[at + p] == a[p] + asking);
        CHECK(both == NULL ||
              (both[2 * (at + p)] == a[p] + asking && both[2 * (at + p) + 1] == b[p] + first));
    }
}

static void
check_rows(bool has_queries)
{
    static int64_t counts[N_SYSTEMS_ROWS * MOST];
    hs_pairs      *all, *near;
    int64_t        at = 0, row = 0, of_systems[N_SYSTEMS_ROWS];
    s_rows.systems.queries = has_queries ? &s_rows.queries : NULL;
    CHECK(hs_neighbors_find(&s_rows.systems, &s_rows.options, &all, NULL) == HS_OK);
    CHECK(hs_neighbors_count(&s_rows.systems, &s_rows.options, counts, NULL) == HS_OK);
    if (has_queries) { /* of each system, those of its queries */
        CHECK(hs_pairs_count(&s_rows.systems, &s_rows.options, of_systems, NULL) == HS_OK);
        for (int n = 0; n < N_SYSTEMS_ROWS; n++) {
            for (int64_t q = s_rows.first_query[n]; q < s_rows.first_query[n + 1]; q++)
                of_systems[n] -= counts[q];
            CHECK(of_systems[n] == 0);
        }
    }
    const int64_t *offsets = hs_pairs_offsets(all);
    for (int n = 0; n < N_SYSTEMS_ROWS; n++) {
        single_rows one;
        hs_pairs   *own;
        take_single(n, has_queries, &one);
        CHECK(hs_neighbors_find(&one.among, &one.options, &own, NULL) == HS_OK);
        compare_pairs(all, at, own, n, has_queries);
        at += hs_pairs_length(own);
        const int64_t *ends = hs_pairs_offsets(own), n_rows = hs_pairs_rows(own);
        for (int64_t i = 0; i < n_rows; i++, row++) {
            CHECK(counts[row] == ends[i + 1] - ends[i]);
            CHECK(offsets[row + 1] - offsets[row] == counts[row]);
        }
        hs_pairs_free(own);
    }
    CHECK(at > 10 && at == hs_pairs_length(all) && row == hs_pairs_rows(all) && offsets[0] == 0);
    hs_pairs_free(all);
    if (s_rows.systems.reach != NULL) {
        CHECK(hs_nearest_find(&s_rows.systems, 3, &s_rows.options, &near, NULL) == HS_ERR_ARGUMENT);
        return;
    }
    CHECK(hs_nearest_find(&s_rows.systems, 3, &s_rows.options, &near, NULL) == HS_OK);
    at = 0;
    for (int n = 0; n < N_SYSTEMS_ROWS; n++) {
        single_rows one;
        hs_pairs   *own;
        take_single(n, has_queries, &one);
        CHECK(hs_nearest_find(&one.among, 3, &one.options, &own, NULL) == HS_OK);
        compare_pairs(near, at, own, n, has_queries);
        at += hs_pairs_length(own);
        hs_pairs_free(own);
    }
    CHECK(at == hs_pairs_length(near) && hs_pairs_offsets(near) == NULL);
    hs_pairs_free(near);
}

static void
rows_are_those_of_single_calls(void)
{
    for (uint64_t seed = 1; seed <= TRIALS(10); seed++) {
        for (int kind = 0; kind < 64; kind++) {
            make_scene_rows(seed);
            s_rows.systems.box = kind & 1 ? &s_rows.box : NULL;
            s_rows.each.rows = kind & 1 ? s_rows.rows : NULL;
            s_rows.each.cutoffs = kind & 2 ? s_rows.cutoffs : NULL;
            s_rows.systems.selection = kind & 4 ? &s_rows.selection : NULL;
            s_rows.systems.reach = kind & 8 ? &s_rows.reach : NULL;
            s_rows.options.threads = kind & 16 ? 3 : 1;
            check_rows(kind & 32);
        }
    }
}

/* Numbers of 4 bytes, of which -1 stays. */
static void
numbers_may_be_short(void)
{
    hs_pairs *wide, *narrow;
    make_scene_rows(3);
    s_rows.options.want = HS_WANT_J | HS_WANT_DISTANCE;
    CHECK(hs_nearest_find(&s_rows.systems, 50, &s_rows.options, &wide, NULL) == HS_OK);
    s_rows.options.index_bytes = 4;
    CHECK(hs_nearest_find(&s_rows.systems, 50, &s_rows.options, &narrow, NULL) == HS_OK);
    const int64_t *j = hs_pairs_array(wide, HS_WANT_J);
    const int32_t *k = hs_pairs_array(narrow, HS_WANT_J);
    for (int64_t e = 0; e < hs_pairs_length(wide); e++)
        CHECK(j[e] == k[e]);
    hs_pairs_free(wide);
    hs_pairs_free(narrow);
}

static void
histograms_are_those_of_single_calls(void)
{
    static int64_t counts[N_SYSTEMS_ROWS * CELLS], own_counts[CELLS];
    static double  sums[N_SYSTEMS_ROWS * CELLS], own_sums[CELLS];
    for (int kind = 0; kind < 8; kind++) {
        make_scene_rows(11 + (uint64_t)kind);
        s_rows.options.threads = kind & 1 ? 3 : 1;
        s_rows.systems.selection = kind & 4 ? &s_rows.selection : NULL;
        s_rows.systems.queries = kind & 2 ? &s_rows.queries : NULL;
        hs_histogram wanted = {.n_edges = N_EDGES,
                               .edges = s_rows.edges,
                               .n_types = N_TYPES_ROWS,
                               .counts = counts,
                               .sums = sums};
        hs_counters  counters;
        int64_t      n_pairs = 0;
        s_rows.options.counters = &counters;
        CHECK(hs_pairs_histogram(&s_rows.systems, &s_rows.options, &wanted, NULL) == HS_OK);
        const int64_t of_all = counters.pairs;
        for (int n = 0; n < N_SYSTEMS_ROWS; n++) {
            single_rows one;
            take_single(n, kind & 2, &one);
            wanted.counts = own_counts;
            wanted.sums = own_sums;
            CHECK(hs_pairs_histogram(&one.among, &one.options, &wanted, NULL) == HS_OK);
            CHECK(memcmp(counts + n * CELLS, own_counts, sizeof own_counts) == 0);
            CHECK(memcmp(sums + n * CELLS, own_sums, sizeof own_sums) == 0);
            n_pairs += counters.pairs;
        }
        CHECK(n_pairs == of_all && n_pairs > 50);
    }
}

static void
a_histogram_may_have_no_marks(void)
{
    static int64_t counts[N_SYSTEMS_ROWS * N_EDGES];
    int64_t        n_pairs = 0, n_counted = 0, each[N_SYSTEMS_ROWS];
    hs_histogram   wanted = {.n_edges = N_EDGES,
                             .edges = s_rows.edges,
                             .inclusive = true,
                             .n_types = 1,
                             .counts = counts};
    make_scene_rows(5);
    s_rows.points.weights = NULL;
    CHECK(hs_pairs_histogram(&s_rows.systems, &s_rows.options, &wanted, NULL) == HS_OK);
    s_rows.options.cutoff = s_rows.edges[N_EDGES - 1];
    CHECK(hs_pairs_count(&s_rows.systems, &s_rows.options, each, NULL) == HS_OK);
    for (int n = 0; n < N_SYSTEMS_ROWS; n++)
        n_pairs += each[n];
    for (int e = 0; e < N_SYSTEMS_ROWS * N_EDGES; e++)
        n_counted += counts[e];
    CHECK(n_pairs == n_counted && n_pairs > 0);
    static double sums[N_SYSTEMS_ROWS * N_EDGES]; /* without weights they are the counts */
    wanted.counts = NULL;
    wanted.sums = sums;
    CHECK(hs_pairs_histogram(&s_rows.systems, &s_rows.options, &wanted, NULL) == HS_OK);
    for (int e = 0; e < N_SYSTEMS_ROWS * N_EDGES; e++)
        CHECK(sums[e] == (double)counts[e]);
}

static void
what_has_no_meaning_is_refused(void)
{
    static int64_t counts[N_SYSTEMS_ROWS * N_EDGES];
    hs_histogram   wanted = {
          .n_edges = N_EDGES, .edges = s_rows.edges, .n_types = 1, .counts = counts};
    hs_failure failure;
    hs_pairs  *rows;
    make_scene_rows(6);
    CHECK(hs_nearest_find(&s_rows.systems, 0, &s_rows.options, &rows, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_nearest_find(&s_rows.systems, 1, &s_rows.options, &rows, NULL) == HS_OK);
    CHECK(hs_pairs_length(rows) == s_rows.points.at.n);
    hs_pairs_free(rows);
    s_rows.options.cutoff = -1.0;
    CHECK(hs_nearest_find(&s_rows.systems, 2, &s_rows.options, &rows, &failure) == HS_ERR_CUTOFF);
    CHECK(failure.value == -1.0);
    s_rows.options.cutoff = INFINITY;
    CHECK(hs_nearest_find(&s_rows.systems, 2, &s_rows.options, &rows, NULL) == HS_OK);
    hs_pairs_free(rows);
    s_rows.each.cutoffs = s_rows.cutoffs;
    s_rows.options.cutoff = -1.0; /* is not looked at, and neither by histograms */
    CHECK(hs_nearest_find(&s_rows.systems, 2, &s_rows.options, &rows, NULL) == HS_OK);
    hs_pairs_free(rows);
    CHECK(hs_pairs_histogram(&s_rows.systems, &s_rows.options, &wanted, NULL) == HS_OK);
    s_rows.each.cutoffs = NULL;
    s_rows.systems.reach = &s_rows.reach;
    CHECK(hs_pairs_histogram(&s_rows.systems, &s_rows.options, &wanted, NULL) == HS_ERR_ARGUMENT);
    s_rows.systems.reach = NULL;
    s_rows.systems.queries = &s_rows.queries; /* which half lists do not have */
    CHECK(hs_pairs_find(&s_rows.systems, &s_rows.options, &rows, NULL) == HS_ERR_ARGUMENT);
    s_rows.queries.n_systems--;
    CHECK(hs_neighbors_find(&s_rows.systems, &s_rows.options, &rows, &failure) == HS_ERR_ARGUMENT);
    CHECK(failure.in_queries);
    s_rows.systems.queries = NULL;
    s_rows.options.cutoff = 1.0;
    hs_selection numbered = {.query_numbers = s_rows.groups}; /* and no queries */
    s_rows.systems.selection = &numbered;
    CHECK(hs_neighbors_find(&s_rows.systems, &s_rows.options, &rows, NULL) == HS_OK);
    hs_pairs_free(rows);
    s_rows.systems.selection = NULL;
    hs_cells *cells = NULL;
    CHECK(hs_cells_build(&s_rows.points.at, NULL, &s_rows.options, &cells, NULL) == HS_OK);
    hs_among in_cells = {.cells = cells, .points = &s_rows.points};
    CHECK(hs_neighbors_find(&in_cells, &s_rows.options, &rows, NULL) == HS_ERR_ARGUMENT);
    hs_cells_free(cells);
    wanted.n_types = INT32_MAX;
    CHECK(hs_pairs_histogram(&s_rows.systems, &s_rows.options, &wanted, NULL) == HS_ERR_MEMORY);
    wanted.n_types = 0;
    CHECK(hs_pairs_histogram(&s_rows.systems, &s_rows.options, &wanted, NULL) == HS_ERR_ARGUMENT);
}

void
test_api_systems(void)
{
    RUN(progress_goes_on_over_all_systems);
    RUN(the_same_as_single_calls);
    RUN(nothing_is_lost_when_memory_is_short);
    RUN(results_go_to_the_callers_arrays);
    RUN(far_points_are_named_among_all);
    RUN(the_same_as_single_calls_reach);
    RUN(every_algorithm_is_the_same_as_single_calls);
    RUN(failures_name_system_and_point);
    RUN(reaches_that_systems_cannot_have_are_refused);
    RUN(nothing_leaks_when_memory_is_short);
    RUN(steps_with_and_without_images_are_sorted_together);
    RUN(each_system_has_its_box_and_selection);
    RUN(visits_and_clusters_go_over_all_systems);
    RUN(what_repeats_may_be_of_each_system);
    RUN(numbers_of_another_system_are_refused);
    RUN(memory_may_be_short);
    RUN(rows_of_boxes_stay);
    RUN(without_systems_all_else_is_checked);
    RUN(work_of_all_systems_is_added_up);
    RUN(few_large_systems);
    RUN(rows_are_those_of_single_calls);
    RUN(numbers_may_be_short);
    RUN(histograms_are_those_of_single_calls);
    RUN(a_histogram_may_have_no_marks);
    RUN(what_has_no_meaning_is_refused);
}
