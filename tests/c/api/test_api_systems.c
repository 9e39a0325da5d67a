/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_systems.c: many systems in one call have the pairs that each has alone. */
#include "../../../csrc/core/memory/memory.h"
#include "../../../csrc/halfshell.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include <math.h>

void test_api_systems(void);

/* ---- the scene of most tests: systems with all that may be known of their points ---- */

enum {
    N_SYSTEMS = 24,
    MOST = 50,
    N_ALL = N_SYSTEMS * MOST,
    N_TYPES = 3,
    N_EDGES = 4,
    CELLS = N_TYPES * N_TYPES * N_EDGES
};

static struct {
    double         x[N_ALL * 3], q[N_ALL * 3], rows[N_SYSTEMS * 9], cutoffs[N_SYSTEMS];
    double         radii[N_ALL], weights[N_ALL], supports[N_ALL * 9];
    double         edges[N_EDGES], table[N_TYPES * N_TYPES];
    int32_t        types[N_ALL];
    int64_t        groups[N_ALL], query_groups[N_ALL], counts[N_ALL];
    int64_t        first[N_SYSTEMS + 1], first_query[N_SYSTEMS + 1];
    hs_box         box;
    hs_set         points, queries;
    hs_selection   selection;
    hs_each_system each;
    hs_among       systems;
    hs_options     options;
} batch;

/* Systems of 0 to MOST - 1 points and of 0 to 5 queries, in boxes of their own; decades: over how
 * many the radii spread. */
static void
make_scene(uint64_t seed, double decades)
{
    harness_random random = {seed};
    memset(&batch, 0, sizeof batch);
    for (int n = 0; n < N_SYSTEMS; n++) {
        const int64_t more = n % 7 == 3 ? 0 : 1 + (int64_t)(random_unit(&random) * (MOST - 1));
        batch.first[n + 1] = batch.first[n] + more;
        batch.first_query[n + 1] = batch.first_query[n] + (int64_t)(random_unit(&random) * 6);
        batch.cutoffs[n] = 0.3 + 1.2 * random_unit(&random);
        for (int k = 0; k < 9; k++)
            batch.rows[9 * n + k] = (k % 4 == 0 ? 3.0 : 0.0) + random_unit(&random);
    }
    for (int e = 0; e < N_ALL * 3; e++) {
        batch.x[e] = 3.5 * random_unit(&random);
        batch.q[e] = 3.5 * random_unit(&random);
    }
    for (int i = 0; i < N_ALL; i++) {
        batch.groups[i] = (int64_t)(3.0 * random_unit(&random));
        batch.query_groups[i] = (int64_t)(3.0 * random_unit(&random));
        batch.types[i] = (int32_t)(N_TYPES * random_unit(&random));
        batch.weights[i] = random_unit(&random) - 0.25;
        batch.radii[i] = 0.8 * pow(10.0, -decades * random_unit(&random));
        for (int e = 0; e < 9; e++) /* reaches 2 at most */
            batch.supports[9 * i + e] = e % 4 == 0 ? 1.0 / batch.radii[i] : 0.25;
    }
    for (int e = 0; e < N_TYPES * N_TYPES; e++) {
        const int sum = e / N_TYPES + e % N_TYPES;
        batch.table[e] = sum == 0 ? -1.0 : decades > 1.0 ? 0.2 * sum : 1.0;
    }
    for (int k = 0; k < N_EDGES; k++)
        batch.edges[k] = 0.4 * (k + 1);
    batch.box = (hs_box){.ndim = 3, .periodic = {true, true, true}};
    batch.points = (hs_set){.at = {batch.x, batch.first[N_SYSTEMS], 3, HS_FLOAT64, 24, 8},
                            .radii = batch.radii,
                            .supports = batch.supports,
                            .weights = batch.weights,
                            .types = batch.types,
                            .groups = batch.groups,
                            .n_systems = N_SYSTEMS,
                            .first = batch.first};
    batch.queries = batch.points;
    batch.queries.at.data = batch.q;
    batch.queries.at.n = batch.first_query[N_SYSTEMS];
    batch.queries.groups = batch.query_groups;
    batch.queries.first = batch.first_query;
    batch.selection = (hs_selection){.has_groups = true};
    batch.each = (hs_each_system){.rows = batch.rows};
    batch.systems = (hs_among){.points = &batch.points, .box = &batch.box, .each = &batch.each};
    batch.options = hs_options_default();
    batch.options.cutoff = 1.0;
    batch.options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_SHIFT;
}

/* The first n systems alone. */
static void
keep_first(int n)
{
    batch.points.n_systems = batch.queries.n_systems = n;
    batch.points.at.n = batch.first[n];
    batch.queries.at.n = batch.first_query[n];
}

/* Without a box. */
static void
open_up(void)
{
    batch.systems.box = NULL;
    batch.each.rows = NULL;
}

/* One system by itself. */
typedef struct single {
    hs_set     points, queries;
    hs_box     box;
    hs_options options;
    hs_among   among;
} single;

/* The points of one system, with what is known of them. */
static hs_set
set_at(const hs_set *all, const double *x, int n)
{
    const int64_t first = all->first[n];
    return (hs_set){.at = {x + 3 * first, all->first[n + 1] - first, 3, HS_FLOAT64, 24, 8},
                    .radii = all->radii + first,
                    .supports = all->supports + 9 * first,
                    .weights = all->weights + first,
                    .types = all->types + first,
                    .groups = all->groups + first};
}

static void
take_single(int n, bool has_queries, single *one)
{
    *one = (single){.points = set_at(&batch.points, batch.x, n),
                    .queries = set_at(&batch.queries, batch.q, n),
                    .box = batch.box,
                    .options = batch.options};
    for (int k = 0; k < 9; k++)
        one->box.rows[k / 3][k % 3] = batch.rows[9 * n + k];
    one->options.threads = 1;
    one->options.cutoff = batch.each.cutoffs != NULL ? batch.cutoffs[n] : batch.options.cutoff;
    one->among = (hs_among){.points = &one->points,
                            .box = batch.systems.box != NULL ? &one->box : NULL,
                            .queries = has_queries ? &one->queries : NULL,
                            .reach = batch.systems.reach,
                            .selection = batch.systems.selection};
}

/* Compares pairs from `at` on of all with those of one system. Returns how many these are. */
static int64_t
compare_pairs(const hs_pairs *all, int64_t at, const hs_pairs *own, int n, bool has_queries)
{
    const int64_t  n_pairs = hs_pairs_length(own);
    const int64_t *i = hs_pairs_array(all, HS_WANT_I), *j = hs_pairs_array(all, HS_WANT_J);
    const int64_t *both = hs_pairs_array(all, HS_WANT_BOTH);
    const int64_t *a = hs_pairs_array(own, HS_WANT_I), *b = hs_pairs_array(own, HS_WANT_J);
    const double  *d = hs_pairs_array(all, HS_WANT_DISTANCE);
    const double  *c = hs_pairs_array(own, HS_WANT_DISTANCE);
    const int32_t *shift = hs_pairs_array(all, HS_WANT_SHIFT);
    const int32_t *t = hs_pairs_array(own, HS_WANT_SHIFT);
    const int64_t  first = batch.first[n], asking = has_queries ? batch.first_query[n] : first;
    CHECK(at + n_pairs <= hs_pairs_length(all));
    for (int64_t p = 0; p < n_pairs; p++) {
        CHECK(j[at + p] == (b[p] < 0 ? -1 : b[p] + first) && d[at + p] == c[p]);
        CHECK(memcmp(shift + 3 * (at + p), t + 3 * p, 3 * sizeof *t) == 0);
        CHECK(i == NULL || i[at + p] == a[p] + asking);
        CHECK(both == NULL ||
              (both[2 * (at + p)] == a[p] + asking && both[2 * (at + p) + 1] == b[p] + first));
    }
    return n_pairs;
}

/* ---- pairs, in the order of one call for each ---- */

static int64_t
check_pairs(void)
{
    hs_pairs *all;
    int64_t   at = 0;
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &all, NULL) == HS_OK);
    CHECK(hs_pairs_count(&batch.systems, &batch.options, batch.counts, NULL) == HS_OK);
    for (int n = 0; n < N_SYSTEMS; n++) {
        single    one;
        hs_pairs *own;
        take_single(n, false, &one);
        CHECK(hs_pairs_find(&one.among, &one.options, &own, NULL) == HS_OK);
        CHECK(batch.counts[n] == hs_pairs_length(own));
        at += compare_pairs(all, at, own, n, false);
        hs_pairs_free(own);
    }
    CHECK(at == hs_pairs_length(all));
    hs_pairs_free(all);
    return at;
}

/* What a reach goes by: all cutoffs alike, then radii and supports by each rule that half lists
 * have, then types. */
enum { OF_RADII = 1, OF_SUPPORTS = 5, OF_TYPES = 7, N_REACHES };

static const hs_reach reaches[N_REACHES] = {
    [OF_RADII] = {.rule = HS_RULE_SUM},
    {.rule = HS_RULE_MEAN},
    {.rule = HS_RULE_MAX},
    {.rule = HS_RULE_MIN},
    [OF_SUPPORTS] = {.rule = HS_RULE_MAX, .has_supports = true, .extent = 0.9},
    {.rule = HS_RULE_MIN, .has_supports = true, .extent = 0.9},
    [OF_TYPES] = {.n_types = N_TYPES, .cutoffs = batch.table},
};

static void
set_reach(int k)
{
    batch.systems.reach = k > 0 ? &reaches[k] : NULL;
    batch.options.cutoff = k == 0 ? 1.0 : k == OF_TYPES ? 0.7 : INFINITY;
}

static void
the_same_as_single_calls(void)
{
    for (uint64_t seed = 1; seed <= TRIALS(4); seed++) {
        for (int kind = 0; kind < 32 * N_REACHES; kind++) {
            const int parity = kind ^ kind >> 1 ^ kind >> 2 ^ kind >> 3 ^ kind >> 4;
            if (IS_SLOW && (parity & 1) != 0) /* half of them, with any four of the five */
                continue;
            make_scene(seed, seed % 2 == 1 ? 0.5 : 3.0);
            set_reach(kind / 32);
            batch.options.sorted = kind & 1;
            batch.options.threads = kind & 2 ? 3 : 1;
            batch.each.cutoffs = kind & 4 ? batch.cutoffs : NULL;
            batch.options.want |= kind & 8 ? HS_WANT_BOTH : 0;
            if (kind & 16)
                open_up();
            const int64_t n = check_pairs();
            CHECK(n > (batch.systems.reach == NULL ? 100 : kind / 32 == OF_TYPES ? 30 : -1));
        }
    }
}

static void
every_algorithm_is_the_same_as_single_calls(void)
{
    for (int k = OF_RADII; k <= OF_SUPPORTS; k += OF_SUPPORTS - OF_RADII) {
        make_scene(31, 2.0);
        set_reach(k);
        for (batch.options.algorithm = HS_AUTO; batch.options.algorithm < HS_ALGORITHM_END;
             batch.options.algorithm++)
            CHECK(check_pairs() > (k == OF_RADII ? 100 : 10));
    }
}

/* ---- every allocation fails once: an error, or what there would be otherwise ---- */

static int64_t n_expected; /* -1: not known */

/* context: queries, or NULL. Pairs where `want` has I, else rows. */
static hs_status
find(void *context)
{
    hs_pairs *found = NULL;
    batch.systems.queries = context;
    const hs_status status = batch.options.want & HS_WANT_I
                                 ? hs_pairs_find(&batch.systems, &batch.options, &found, NULL)
                                 : hs_neighbors_find(&batch.systems, &batch.options, &found, NULL);
    CHECK((status == HS_OK) == (found != NULL));
    if (status == HS_OK) {
        CHECK(n_expected < 0 || hs_pairs_length(found) == n_expected);
        n_expected = hs_pairs_length(found);
    }
    hs_pairs_free(found);
    return status;
}

static void
nothing_is_lost_when_memory_is_short(void)
{
    static const int64_t pair[] = {0, 1};
    const hs_selection   one_excluded = {.n_excluded = 1, .excluded = pair};
    for (int kind = 0; kind < 4 * (N_REACHES + 2); kind++) { /* all reaches, queries, a selection */
        const int  of = kind / 4;
        const bool has_rows = kind & 2 || of == N_REACHES;
        if (IS_SLOW && (kind + kind / 2 + of) % 2 != 0) /* rows with one thread, pairs with two */
            continue;
        make_scene(33, 0.5);
        keep_first(IS_SLOW ? 4 : 6);
        set_reach(of < N_REACHES ? of : 0);
        batch.systems.selection = of > N_REACHES ? &one_excluded : NULL;
        batch.options.threads = kind & 1 ? 2 : 1;
        batch.options.sorted = of % 3 == 0;
        batch.options.want = HS_WANT_J | HS_WANT_SHIFT;
        batch.options.want |= has_rows ? 0 : HS_WANT_I | HS_WANT_BOTH | HS_WANT_VECTOR;
        if (of > 0 && of % 2 == 0)
            open_up();
        hs_set *queries = of == N_REACHES ? &batch.queries : NULL;
        n_expected = -1;
        CHECK(find(queries) == HS_OK && n_expected > 0);
        CHECK(fail_each_allocation(find, queries, 20000) > 5);
        check_arena(find, queries);
        if (kind % 4 == 2)
            CHECK(raise_memory_limit(find, queries, &batch.options.memory_limit) > 3);
    }
    hs_pool_clear();
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
    static int64_t i[ROOM], j[ROOM];
    hs_pair_arrays out = {.capacity = ROOM, .index_bytes = 8, .i = i, .j = j};
    hs_failure     failure;
    int            n_asked = 0;
    make_scene(6, 1.0);
    batch.first[1] = batch.first[2] = 0; /* the first systems are empty */
    for (int k = 0; k < 3; k++)
        batch.box.rows[k][k] = 4.0;
    batch.systems.each = NULL;
    batch.options.want = HS_WANT_I | HS_WANT_J;
    batch.options.find_limit = some_limit;
    batch.options.find_context = &n_asked;
    for (batch.options.threads = 1; batch.options.threads <= 4; batch.options.threads += 3) {
        for (int n = 3; n <= N_SYSTEMS; n += N_SYSTEMS - 3) {
            hs_pairs *own = NULL, *into = NULL;
            keep_first(n);
            batch.options.out = NULL;
            CHECK(hs_pairs_find(&batch.systems, &batch.options, &own, &failure) == HS_OK);
            const int64_t found = hs_pairs_length(own);
            CHECK(found > 10 && found <= ROOM);
            batch.options.out = &out;
            CHECK(hs_pairs_find(&batch.systems, &batch.options, &into, &failure) == HS_OK);
            CHECK(hs_pairs_length(into) == found && hs_pairs_array(into, HS_WANT_I) == NULL);
            CHECK(memcmp(i, hs_pairs_array(own, HS_WANT_I), (size_t)found * 8) == 0);
            CHECK(memcmp(j, hs_pairs_array(own, HS_WANT_J), (size_t)found * 8) == 0);
            out.capacity = found - 1;
            hs_pairs_free(into);
            CHECK(hs_pairs_find(&batch.systems, &batch.options, &into, &failure) ==
                  HS_ERR_CAPACITY);
            CHECK(into == NULL && failure.expected_pairs == (double)found);
            out.capacity = ROOM;
            hs_pairs_free(own);
        }
    }
    CHECK(n_asked > 0);
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

/* Of two systems the first needs S to tell images of a pair apart, and the second does not. */
static void
columns_change_from_system_to_system(void)
{
    make_scene(63, 0.5);
    keep_first(2);
    set_reach(OF_RADII);
    memset(batch.rows, 0, sizeof batch.rows);
    for (int k = 0; k < 3; k++) {
        batch.rows[4 * k] = 2.0;
        batch.rows[9 + 4 * k] = 40.0;
    }
    batch.options.sorted = true;
    for (int s = 0; s < 2; s++) {
        batch.options.want = HS_WANT_I | HS_WANT_J | (s > 0 ? HS_WANT_SHIFT : 0);
        hs_pairs *all, *own;
        int64_t   at = 0;
        CHECK(hs_pairs_find(&batch.systems, &batch.options, &all, NULL) == HS_OK);
        const int64_t *i = hs_pairs_array(all, HS_WANT_I), *j = hs_pairs_array(all, HS_WANT_J);
        for (int n = 0; n < 2; n++) {
            single one;
            take_single(n, false, &one);
            CHECK(hs_pairs_find(&one.among, &one.options, &own, NULL) == HS_OK);
            const int64_t *a = hs_pairs_array(own, HS_WANT_I), *b = hs_pairs_array(own, HS_WANT_J);
            const int64_t  n_own = hs_pairs_length(own);
            CHECK(n_own > 0 && at + n_own <= hs_pairs_length(all));
            for (int64_t p = 0; p < n_own; p++, at++)
                CHECK(i[at] == a[p] + batch.first[n] && j[at] == b[p] + batch.first[n]);
            hs_pairs_free(own);
        }
        CHECK(at == hs_pairs_length(all));
        hs_pairs_free(all);
    }
}

/* The last system has none, and its search is not even opened. */
static void
a_block_is_taken_behind_the_last_search(void)
{
    hs_stream *stream;
    hs_pairs  *all, *block;
    make_scene(64, 3.0);
    keep_first(2);
    set_reach(OF_TYPES);
    for (int64_t i = batch.first[1]; i < batch.first[2]; i++)
        batch.types[i] = 0; /* no pair of two of these is within reach */
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &all, NULL) == HS_OK);
    const size_t n = (size_t)hs_pairs_length(all);
    CHECK(n > 0);
    CHECK(hs_stream_open(&batch.systems, &batch.options, 1000000, &stream, NULL) == HS_OK);
    CHECK(hs_stream_next(stream, NULL, NULL, &block, NULL) == HS_OK);
    CHECK((size_t)hs_pairs_length(block) == n);
    CHECK(memcmp(hs_pairs_array(block, HS_WANT_I), hs_pairs_array(all, HS_WANT_I), 8 * n) == 0);
    CHECK(memcmp(hs_pairs_array(block, HS_WANT_J), hs_pairs_array(all, HS_WANT_J), 8 * n) == 0);
    hs_pairs_free(block);
    CHECK(hs_stream_next(stream, NULL, NULL, &block, NULL) == HS_OK && block == NULL);
    hs_stream_free(stream);
    hs_pairs_free(all);
}

/* ---- what failures say ---- */

/* Rows are counted through all systems. */
static void
failures_name_system_and_point(void)
{
    hs_failure     failure;
    hs_pairs      *pairs = NULL;
    const hs_reach sums = {.rule = HS_RULE_SUM, .has_supports = true, .extent = 0.9};
    const hs_reach directed = {.rule = HS_RULE_GATHER};
    make_scene(32, 1.0);
    const int64_t row = batch.first[20];
    const double  radius = batch.radii[row], x = batch.x[3 * row];
    open_up();
    set_reach(OF_RADII);
    batch.radii[row] = -1.0;
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &pairs, &failure) == HS_ERR_RADII);
    CHECK(failure.row == row && failure.value == -1.0 && failure.system == 20 && pairs == NULL);
    batch.radii[row] = radius;
    batch.x[3 * row] = NAN;
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &pairs, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == row && failure.column == 0 && failure.system == 20);
    batch.x[3 * row] = x;
    batch.each.cutoffs = batch.cutoffs;
    batch.cutoffs[20] = -2.0;
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &pairs, &failure) == HS_ERR_CUTOFF);
    CHECK(failure.value == -2.0 && failure.system == 20);
    batch.each.cutoffs = NULL;
    set_reach(OF_TYPES);
    batch.options.cutoff = INFINITY;
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &pairs, &failure) == HS_ERR_CUTOFF);
    batch.options.cutoff = 1.0;
    batch.types[row] = N_TYPES;
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &pairs, &failure) == HS_ERR_TYPES);
    CHECK(failure.row == row && failure.value == N_TYPES);
    set_reach(OF_SUPPORTS);
    batch.supports[9 * row + 1] = INFINITY;
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &pairs, &failure) == HS_ERR_SUPPORTS);
    CHECK(failure.row == row && failure.system == 20);
    batch.systems.reach = &sums;
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &pairs, &failure) == HS_ERR_ARGUMENT);
    batch.systems.reach = &directed;
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &pairs, &failure) == HS_ERR_ARGUMENT);
    set_reach(OF_RADII);
    batch.points.radii = NULL;
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &pairs, &failure) == HS_ERR_ARGUMENT);
    batch.points.radii = batch.radii;
    batch.systems.box = &batch.box;
    batch.each.rows = batch.rows;
    memset(batch.rows + 9 * 3, 0, 9 * sizeof(double)); /* of a system without points */
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &pairs, &failure) == HS_ERR_BOX_DEPENDENT);
    CHECK(failure.system == 3);
}

/* Neither supports of which there are none, nor a table without a bound for it. */
static void
reaches_that_systems_cannot_have_are_refused(void)
{
    static const int bad[] = {7, 0, N_SYSTEMS - 1};
    hs_failure       failure;
    make_scene(35, 1.0);
    open_up();
    set_reach(OF_SUPPORTS);
    batch.points.supports = NULL;
    memset(&failure, 0x5a, sizeof failure);
    CHECK(hs_pairs_count(&batch.systems, &batch.options, batch.counts, &failure) ==
          HS_ERR_ARGUMENT);
    CHECK(failure.row == -1 && failure.system == -1);
    set_reach(OF_TYPES);
    batch.each.cutoffs = batch.cutoffs;
    for (int b = 0; b < 3; b++) { /* the first of them is named */
        hs_pairs *pairs = (hs_pairs *)&batch;
        batch.cutoffs[bad[b]] = INFINITY;
        const int first = b == 0 ? bad[0] : 0;
        CHECK(hs_pairs_find(&batch.systems, &batch.options, &pairs, &failure) == HS_ERR_CUTOFF);
        CHECK(pairs == NULL && failure.value == INFINITY && failure.system == first);
        CHECK(hs_pairs_count(&batch.systems, &batch.options, batch.counts, &failure) ==
              HS_ERR_CUTOFF);
        CHECK(failure.value == INFINITY && failure.system == first);
    }
    for (int b = 0; b < 3; b++)
        batch.cutoffs[bad[b]] = 1.0;
    CHECK(hs_pairs_count(&batch.systems, &batch.options, batch.counts, &failure) == HS_OK);
}

/* The row of a box is not that of a point. */
static void
rows_of_boxes_stay(void)
{
    hs_failure failure;
    make_scene(36, 1.0);
    memset(batch.rows, 0, sizeof batch.rows);
    for (int e = 0; e < N_SYSTEMS * 9; e++)
        batch.rows[e] = e % 9 % 4 == 0 ? 3.0 : 0.0;
    batch.rows[9 * 7 + 8] = 0.0;
    CHECK(hs_neighbors_count(&batch.systems, &batch.options, batch.counts, &failure) ==
          HS_ERR_BOX_DEPENDENT);
    CHECK(failure.row == 2 && failure.system == 7);
    batch.rows[9 * 7 + 8] = INFINITY;
    CHECK(hs_neighbors_count(&batch.systems, &batch.options, batch.counts, &failure) ==
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
    make_scene(37, 1.0);
    keep_first(0);
    open_up();
    n_expected = 0;
    batch.options.want = HS_WANT_J;
    batch.options.counters = &counters;
    CHECK(find(NULL) == HS_OK && counters.pairs == 0);
    hs_stream *stream;
    hs_pairs  *block;
    CHECK(hs_stream_open(&batch.systems, &batch.options, 1, &stream, NULL) == HS_OK);
    CHECK(hs_stream_next(stream, NULL, NULL, &block, NULL) == HS_OK && block == NULL);
    hs_stream_free(stream);
    batch.options.cutoff = -1.0;
    CHECK(find(NULL) == HS_ERR_CUTOFF);
    batch.options.cutoff = 1.0;
    batch.systems.selection = &numbered;
    CHECK(find(NULL) == HS_ERR_ARGUMENT);
    batch.systems.selection = NULL;
    batch.systems.reach = &reach;
    CHECK(find(NULL) == HS_ERR_ARGUMENT);
    batch.systems.reach = NULL;
    batch.options.kernel = "none";
    CHECK(find(NULL) == HS_ERR_KERNEL);
}

/* ---- what is done is what calls for each of the systems do ---- */

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

/* By however many threads: of lattice points many are at the cutoff, some but for 2^-30, for a
 * rounding, or for the square of 2^-60. */
static void
work_of_all_systems_is_added_up(void)
{
    hs_counters single_call = {.pairs = 0}, sum = {.pairs = 0}, all;
    int64_t     most_bytes = 0;
    make_scene(78, 1.0);
    open_up();
    for (int e = 0; e < N_ALL * 3; e++) {
        const double at = floor(6.0 / 3.5 * batch.x[e]) / (e < N_ALL ? 3.0 : 2.0);
        batch.x[e] = at > 0.0 ? at + (double)(e % 7 == 0) * 0x1p-30 : (double)(e % 2) * 0x1p-60;
    }
    batch.options.want = HS_WANT_J | HS_WANT_SHIFT;
    batch.options.counters = &single_call;
    for (int n = 0; n < N_SYSTEMS; n++) {
        hs_pairs *rows;
        single    one;
        take_single(n, false, &one);
        CHECK(hs_neighbors_find(&one.among, &one.options, &rows, NULL) == HS_OK);
        hs_pairs_free(rows);
        add_work(&single_call, &sum);
        most_bytes = single_call.bytes_peak > most_bytes ? single_call.bytes_peak : most_bytes;
    }
    CHECK(sum.ambiguous > 0 && sum.by_float64 > 0 && sum.by_double_word > 0 && sum.by_integers > 0);
    batch.options.counters = &all;
    n_expected = -1;
    for (batch.options.threads = 1; batch.options.threads <= 2; batch.options.threads++) {
        CHECK(find(NULL) == HS_OK);
        CHECK(is_same_work(&all, &sum));
        CHECK(all.bytes[HS_FOR_POINTS] > 0 && all.bytes_peak >= most_bytes);
    }
}

/* More threads than systems, and systems that are a range of their own. */
static void
few_large_systems(void)
{
    const int64_t ends[] = {0, N_ALL / 2, N_ALL}, of_queries[] = {0, 1, 2};
    hs_pairs     *one, *many;
    make_scene(79, 1.0);
    open_up();
    batch.queries.at.n = 2;
    batch.points.at.n = N_ALL;
    batch.points.n_systems = batch.queries.n_systems = 2;
    batch.points.first = ends;
    batch.queries.first = of_queries;
    CHECK(hs_neighbors_find(&batch.systems, &batch.options, &one, NULL) == HS_OK);
    batch.options.threads = 4;
    CHECK(hs_neighbors_find(&batch.systems, &batch.options, &many, NULL) == HS_OK);
    CHECK(hs_pairs_length(one) > N_ALL && hs_pairs_length(one) == hs_pairs_length(many));
    CHECK(memcmp(hs_pairs_array(one, HS_WANT_J), hs_pairs_array(many, HS_WANT_J),
                 (size_t)hs_pairs_length(one) * 8) == 0);
    hs_pairs_free(one);
    hs_pairs_free(many);
    n_expected = -1;
    batch.options.want = HS_WANT_J;
    CHECK(find(&batch.queries) == HS_OK);
}

/* ---- rows, nearest points and histograms, against one call for each ---- */

static void
check_rows(bool has_queries)
{
    hs_pairs *all, *near;
    int64_t   at = 0, row = 0, of_systems[N_SYSTEMS];
    batch.systems.queries = has_queries ? &batch.queries : NULL;
    CHECK(hs_neighbors_find(&batch.systems, &batch.options, &all, NULL) == HS_OK);
    CHECK(hs_neighbors_count(&batch.systems, &batch.options, batch.counts, NULL) == HS_OK);
    if (has_queries) { /* of each system, those of its queries */
        CHECK(hs_pairs_count(&batch.systems, &batch.options, of_systems, NULL) == HS_OK);
        for (int n = 0; n < N_SYSTEMS; n++) {
            for (int64_t q = batch.first_query[n]; q < batch.first_query[n + 1]; q++)
                of_systems[n] -= batch.counts[q];
            CHECK(of_systems[n] == 0);
        }
    }
    const int64_t *offsets = hs_pairs_offsets(all);
    for (int n = 0; n < N_SYSTEMS; n++) {
        single    one;
        hs_pairs *own;
        take_single(n, has_queries, &one);
        CHECK(hs_neighbors_find(&one.among, &one.options, &own, NULL) == HS_OK);
        at += compare_pairs(all, at, own, n, has_queries);
        const int64_t *ends = hs_pairs_offsets(own), n_rows = hs_pairs_rows(own);
        for (int64_t i = 0; i < n_rows; i++, row++) {
            CHECK(batch.counts[row] == ends[i + 1] - ends[i]);
            CHECK(offsets[row + 1] - offsets[row] == batch.counts[row]);
        }
        hs_pairs_free(own);
    }
    CHECK(at > 5 && at == hs_pairs_length(all) && row == hs_pairs_rows(all) && offsets[0] == 0);
    hs_pairs_free(all);
    if (batch.systems.reach != NULL) {
        CHECK(hs_nearest_find(&batch.systems, 3, &batch.options, &near, NULL) == HS_ERR_ARGUMENT);
        return;
    }
    CHECK(hs_nearest_find(&batch.systems, 3, &batch.options, &near, NULL) == HS_OK);
    at = 0;
    for (int n = 0; n < N_SYSTEMS; n++) {
        single    one;
        hs_pairs *own;
        take_single(n, has_queries, &one);
        CHECK(hs_nearest_find(&one.among, 3, &one.options, &own, NULL) == HS_OK);
        at += compare_pairs(near, at, own, n, has_queries);
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
            make_scene(seed, 0.3);
            set_reach(kind & 8 ? OF_RADII : 0);
            if (!(kind & 1))
                open_up();
            batch.box.periodic[2] = seed % 2;
            batch.each.cutoffs = kind & 2 ? batch.cutoffs : NULL;
            batch.systems.selection = kind & 4 ? &batch.selection : NULL;
            batch.options.threads = kind & 16 ? 3 : 1;
            batch.options.want |= HS_WANT_BOTH;
            check_rows(kind & 32);
        }
    }
}

/* Numbers of 4 bytes, of which -1 stays. */
static void
numbers_may_be_short(void)
{
    hs_pairs *wide, *narrow;
    make_scene(3, 1.0);
    batch.options.want = HS_WANT_J | HS_WANT_DISTANCE;
    CHECK(hs_nearest_find(&batch.systems, 50, &batch.options, &wide, NULL) == HS_OK);
    batch.options.index_bytes = 4;
    CHECK(hs_nearest_find(&batch.systems, 50, &batch.options, &narrow, NULL) == HS_OK);
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
    static int64_t counts[N_SYSTEMS * CELLS], own_counts[CELLS];
    static double  sums[N_SYSTEMS * CELLS], own_sums[CELLS];
    for (int kind = 0; kind < 8; kind++) {
        make_scene(11 + (uint64_t)kind, 1.0);
        batch.options.threads = kind & 1 ? 3 : 1;
        batch.systems.selection = kind & 4 ? &batch.selection : NULL;
        batch.systems.queries = kind & 2 ? &batch.queries : NULL;
        hs_histogram wanted = {.n_edges = N_EDGES,
                               .edges = batch.edges,
                               .n_types = N_TYPES,
                               .counts = counts,
                               .sums = sums};
        hs_counters  counters;
        int64_t      n_pairs = 0;
        batch.options.counters = &counters;
        CHECK(hs_pairs_histogram(&batch.systems, &batch.options, &wanted, NULL) == HS_OK);
        const int64_t of_all = counters.pairs;
        for (int n = 0; n < N_SYSTEMS; n++) {
            single one;
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
    static int64_t counts[N_SYSTEMS * N_EDGES];
    int64_t        n_pairs = 0, n_counted = 0, each[N_SYSTEMS];
    hs_histogram   wanted = {.n_edges = N_EDGES,
                             .edges = batch.edges,
                             .inclusive = true,
                             .n_types = 1,
                             .counts = counts};
    make_scene(5, 1.0);
    batch.points.weights = NULL;
    CHECK(hs_pairs_histogram(&batch.systems, &batch.options, &wanted, NULL) == HS_OK);
    batch.options.cutoff = batch.edges[N_EDGES - 1];
    CHECK(hs_pairs_count(&batch.systems, &batch.options, each, NULL) == HS_OK);
    for (int n = 0; n < N_SYSTEMS; n++)
        n_pairs += each[n];
    for (int e = 0; e < N_SYSTEMS * N_EDGES; e++)
        n_counted += counts[e];
    CHECK(n_pairs == n_counted && n_pairs > 0);
    static double sums[N_SYSTEMS * N_EDGES]; /* without weights they are the counts */
    wanted.counts = NULL;
    wanted.sums = sums;
    CHECK(hs_pairs_histogram(&batch.systems, &batch.options, &wanted, NULL) == HS_OK);
    for (int e = 0; e < N_SYSTEMS * N_EDGES; e++)
        CHECK(sums[e] == (double)counts[e]);
}

static void
what_has_no_meaning_is_refused(void)
{
    static int64_t counts[N_SYSTEMS * N_EDGES];
    hs_histogram   wanted = {
          .n_edges = N_EDGES, .edges = batch.edges, .n_types = 1, .counts = counts};
    hs_failure failure;
    hs_pairs  *rows;
    make_scene(6, 1.0);
    CHECK(hs_nearest_find(&batch.systems, 0, &batch.options, &rows, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_nearest_find(&batch.systems, 1, &batch.options, &rows, NULL) == HS_OK);
    CHECK(hs_pairs_length(rows) == batch.points.at.n);
    hs_pairs_free(rows);
    batch.options.cutoff = -1.0;
    CHECK(hs_nearest_find(&batch.systems, 2, &batch.options, &rows, &failure) == HS_ERR_CUTOFF);
    CHECK(failure.value == -1.0);
    batch.options.cutoff = INFINITY;
    CHECK(hs_nearest_find(&batch.systems, 2, &batch.options, &rows, NULL) == HS_OK);
    hs_pairs_free(rows);
    batch.each.cutoffs = batch.cutoffs;
    batch.options.cutoff = -1.0; /* is not looked at, and neither by histograms */
    CHECK(hs_nearest_find(&batch.systems, 2, &batch.options, &rows, NULL) == HS_OK);
    hs_pairs_free(rows);
    CHECK(hs_pairs_histogram(&batch.systems, &batch.options, &wanted, NULL) == HS_OK);
    batch.each.cutoffs = NULL;
    batch.systems.reach = &reaches[OF_RADII];
    CHECK(hs_pairs_histogram(&batch.systems, &batch.options, &wanted, NULL) == HS_ERR_ARGUMENT);
    batch.systems.reach = NULL;
    batch.systems.queries = &batch.queries; /* which half lists do not have */
    CHECK(hs_pairs_find(&batch.systems, &batch.options, &rows, NULL) == HS_ERR_ARGUMENT);
    batch.queries.n_systems--;
    CHECK(hs_neighbors_find(&batch.systems, &batch.options, &rows, &failure) == HS_ERR_ARGUMENT);
    CHECK(failure.in_queries);
    batch.systems.queries = NULL;
    batch.options.cutoff = 1.0;
    hs_selection numbered = {.query_numbers = batch.groups}; /* and no queries */
    batch.systems.selection = &numbered;
    CHECK(hs_neighbors_find(&batch.systems, &batch.options, &rows, NULL) == HS_OK);
    hs_pairs_free(rows);
    batch.systems.selection = NULL;
    hs_cells *cells = NULL;
    CHECK(hs_cells_build(&batch.points.at, NULL, &batch.options, &cells, NULL) == HS_OK);
    hs_among in_cells = {.cells = cells, .points = &batch.points};
    CHECK(hs_neighbors_find(&in_cells, &batch.options, &rows, NULL) == HS_ERR_ARGUMENT);
    hs_cells_free(cells);
    wanted.n_types = INT32_MAX;
    CHECK(hs_pairs_histogram(&batch.systems, &batch.options, &wanted, NULL) == HS_ERR_MEMORY);
    wanted.n_types = 0;
    CHECK(hs_pairs_histogram(&batch.systems, &batch.options, &wanted, NULL) == HS_ERR_ARGUMENT);
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

void
test_api_systems(void)
{
    RUN(the_same_as_single_calls);
    RUN(every_algorithm_is_the_same_as_single_calls);
    RUN(nothing_is_lost_when_memory_is_short);
    RUN(results_go_to_the_callers_arrays);
    RUN(far_points_are_named_among_all);
    RUN(progress_goes_on_over_all_systems);
    RUN(steps_with_and_without_images_are_sorted_together);
    RUN(columns_change_from_system_to_system);
    RUN(a_block_is_taken_behind_the_last_search);
    RUN(failures_name_system_and_point);
    RUN(reaches_that_systems_cannot_have_are_refused);
    RUN(rows_of_boxes_stay);
    RUN(without_systems_all_else_is_checked);
    RUN(work_of_all_systems_is_added_up);
    RUN(few_large_systems);
    RUN(rows_are_those_of_single_calls);
    RUN(numbers_may_be_short);
    RUN(histograms_are_those_of_single_calls);
    RUN(a_histogram_may_have_no_marks);
    RUN(what_has_no_meaning_is_refused);
    RUN(each_system_has_its_box_and_selection);
    RUN(visits_and_clusters_go_over_all_systems);
    RUN(what_repeats_may_be_of_each_system);
    RUN(numbers_of_another_system_are_refused);
}
