/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_systems.c: many systems in one call against one call for each. */
#include "../support/harness.h"
#include "../support/among.h"

#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/halfshell.h"

#include <math.h>

void test_api_systems(void);

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
    const hs_points  points = points_of(made, 0, made->first[N_SYSTEMS]);
    const hs_systems systems = {N_SYSTEMS,
                                made->first,
                                has_box ? &made->box : NULL,
                                has_box ? made->rows : NULL,
                                made->cutoffs,
                                NULL,
                                NULL,
                                NULL,
                                NULL};
    hs_pairs        *pairs = NULL;
    hs_failure       failure;
    int64_t          counts[N_SYSTEMS], at = 0;
    bool             same = true;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
    options.threads = threads;
    if (hs_systems_find(&points, &systems, &options, &pairs, &failure) != HS_OK ||
        hs_systems_count(&points, &systems, &options, counts, &failure) != HS_OK) {
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

static void
failures_name_system_and_point(void)
{
    static batch made;
    hs_options   options = hs_options_default();
    hs_failure   failure;
    int64_t      counts[N_SYSTEMS];
    make_batch(5, &made);
    const hs_points  points = points_of(&made, 0, made.first[N_SYSTEMS]);
    const hs_systems systems = {N_SYSTEMS, made.first, &made.box, made.rows, made.cutoffs,
                                NULL,      NULL,       NULL,      NULL};
    const double     saved = made.rows[9 * 17 + 4];
    made.rows[9 * 17 + 4] = INFINITY;
    CHECK(hs_systems_count(&points, &systems, &options, counts, &failure) == HS_ERR_BOX_FINITE);
    CHECK(failure.system == 17 && failure.row == 1 && failure.column == 1);
    made.rows[9 * 17 + 4] = saved;
    const int64_t row = made.first[20] + 1;
    made.x[3 * row + 2] = NAN;
    CHECK(hs_systems_count(&points, &systems, &options, counts, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == row && failure.column == 2);
}

/* Also where each system has one point, which no search would miss. */
static void
single_points_are_read(void)
{
    enum { SYSTEMS = 5 };
    double           x[SYSTEMS] = {0.0, 1.0, 2.0, 3.0, 4.0};
    const int64_t    first[SYSTEMS + 1] = {0, 1, 2, 3, 4, 5};
    const hs_points  points = {x, SYSTEMS, 1, HS_FLOAT64, 8, 8};
    const hs_systems systems = {.n = SYSTEMS, .first = first};
    const hs_options options = hs_options_default();
    hs_failure       failure;
    int64_t          counts[SYSTEMS];
    CHECK(hs_systems_count(&points, &systems, &options, counts, &failure) == HS_OK);
    x[3] = NAN;
    CHECK(hs_systems_count(&points, &systems, &options, counts, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == 3 && failure.system == 3);
}

static bool
count_poll(void *context, double fraction)
{
    int64_t *calls = context;
    CHECK(fraction >= 0.0 && fraction <= 1.0);
    ++*calls;
    return true;
}

/* Also those that a thread makes while it waits for its turn, and no others. */
static void
polls_are_counted(void)
{
    enum { N = 6, POINTS = 1500 };
    static double  x[N * POINTS];
    harness_random random = {11};
    int64_t        first[N + 1], most = 0;
    for (int e = 0; e < N * POINTS; e++)
        x[e] = random_unit(&random);
    for (int s = 0; s <= N; s++)
        first[s] = s * POINTS;
    const hs_points  points = {x, N * POINTS, 1, HS_FLOAT64, sizeof(double), sizeof(double)};
    const hs_systems systems = {N, first, NULL, NULL, NULL, NULL, NULL, NULL, NULL};
    for (int threads = 1; threads <= 4; threads++) {
        for (int trial = 0; trial < 4; trial++) {
            hs_counters counters;
            int64_t     calls = 0, counts[N];
            hs_options  options = hs_options_default();
            hs_pairs   *pairs = NULL;
            options.cutoff = 2.0;
            options.threads = threads;
            options.poll = count_poll;
            options.poll_context = &calls;
            options.counters = &counters;
            if (trial % 2) {
                CHECK(hs_systems_find(&points, &systems, &options, &pairs, NULL) == HS_OK);
            } else {
                CHECK(hs_systems_count(&points, &systems, &options, counts, NULL) == HS_OK);
            }
            CHECK(counters.polls == calls);
            CHECK(counters.pairs == (int64_t)N * POINTS * (POINTS - 1) / 2);
            most = calls > most ? calls : most;
            hs_pairs_free(pairs);
        }
    }
    CHECK(most > 0);
}

/* The message of a refusal names what was expected, also before anything was read. */
static void
a_shortage_is_told_in_pairs_and_bytes(void)
{
    static batch made;
    hs_failure   failure;
    make_batch(3, &made);
    const hs_points  points = points_of(&made, 0, made.first[N_SYSTEMS]);
    const hs_systems systems = {N_SYSTEMS, made.first, &made.box, made.rows, made.cutoffs,
                                NULL,      NULL,       NULL,      NULL};
    for (int kind = 0; kind < 4; kind++) {
        hs_options options = hs_options_default();
        hs_pairs  *pairs = NULL;
        int64_t    counts[N_SYSTEMS];
        options.memory_limit = 100.0;
        options.cutoff = 1.0;
        options.threads = 1 + kind / 2;
        const hs_status status =
            kind % 2 ? hs_systems_find(&points, &systems, &options, &pairs, &failure)
                     : hs_systems_count(&points, &systems, &options, counts, &failure);
        CHECK(status == HS_ERR_MEMORY && pairs == NULL);
        CHECK(failure.expected_pairs > 100.0 && failure.expected_pairs < 1e6);
        CHECK(failure.expected_bytes == (kind % 2 ? 16.0 : 0.0) * failure.expected_pairs);
        CHECK(failure.search_bytes > 100.0 && failure.limit_bytes <= 100.0);
        CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &pairs, &failure) == HS_ERR_MEMORY);
        CHECK(failure.expected_bytes > 0.0 && failure.limit_bytes == 100.0);
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
    const hs_points  points = points_of(&made, 0, made.first[N_SYSTEMS]);
    const hs_systems systems = {N_SYSTEMS, made.first, &made.box, made.rows, made.cutoffs,
                                NULL,      NULL,       NULL,      NULL};
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
            const hs_status status = hs_systems_find(&points, &systems, &options, &pairs, &failure);
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

/* What all systems share is checked before any is read. */
static void
bad_arguments_are_refused(void)
{
    static batch made;
    hs_options   options = hs_options_default();
    hs_failure   failure;
    hs_pairs    *pairs = NULL;
    int64_t      counts[N_SYSTEMS];
    make_batch(4, &made);
    hs_points           points = points_of(&made, 0, made.first[N_SYSTEMS]);
    hs_systems          systems = {N_SYSTEMS, made.first, NULL, NULL, NULL, NULL, NULL, NULL, NULL};
    static const double bad[] = {NAN, INFINITY, -1.0};
    for (int b = 0; b < 3; b++) {
        options.cutoff = bad[b];
        CHECK(hs_systems_count(&points, &systems, &options, counts, &failure) == HS_ERR_CUTOFF);
        CHECK(memcmp(&failure.value, &bad[b], sizeof failure.value) == 0);
    }
    options.cutoff = 1.0;
    options.kernel = "none of that name";
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_KERNEL);
    options.kernel = NULL;
    points.n = INT64_C(1) << 31;
    points.row_stride = 0; /* one point so many times takes no memory */
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_TOO_MANY);
    CHECK(failure.value == 0x1p31 && pairs == NULL);
    points = points_of(&made, 0, made.first[N_SYSTEMS]);
    options.memory_limit = 100.0; /* of one cutoff for all */
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_MEMORY);
    CHECK(failure.expected_pairs > 0.0 && pairs == NULL);
    options.memory_limit = INFINITY;
    options.want = 1u << 20;
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    options.want = HS_WANT_I;
    points.n = 5;
    systems.n = -1;
    CHECK(hs_systems_count(&points, &systems, &options, counts, &failure) == HS_ERR_ARGUMENT);
    systems.n = 0;
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_OK);
    CHECK(hs_pairs_length(pairs) == 0);
    hs_pairs_free(pairs);
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
            const hs_systems systems = {n,    made.first, &made.box, NULL, NULL,
                                        NULL, NULL,       NULL,      NULL};
            const hs_points  some = points_of(&made, 0, made.first[n]);
            hs_pairs        *own = NULL, *into = NULL;
            options.threads = threads;
            options.out = NULL;
            CHECK(hs_systems_find(&some, &systems, &options, &own, &failure) == HS_OK);
            const int64_t found = hs_pairs_length(own);
            CHECK(found > 50 && found <= ROOM);
            options.out = &out;
            CHECK(hs_systems_find(&some, &systems, &options, &into, &failure) == HS_OK);
            CHECK(hs_pairs_length(into) == found && hs_pairs_array(into, HS_WANT_I) == NULL);
            CHECK(memcmp(i, hs_pairs_array(own, HS_WANT_I), (size_t)found * 8) == 0);
            CHECK(memcmp(j, hs_pairs_array(own, HS_WANT_J), (size_t)found * 8) == 0);
            out.capacity = found - 1;
            hs_pairs_free(into);
            CHECK(hs_systems_find(&some, &systems, &options, &into, &failure) == HS_ERR_CAPACITY);
            CHECK(into == NULL && failure.expected_pairs == (double)found);
            out.capacity = ROOM;
            hs_pairs_free(own);
        }
    }
    CHECK(n_asked > 0 && points.n > 0);
}

/* Many systems without points before those that have some. */
static void
empty_systems_cost_nothing(void)
{
    static batch made;
    make_batch(8, &made);
    for (int s = 1; s <= 25; s++) {
        made.first[s] = 0;
    }
    CHECK(compare(&made, hs_options_default(), true, 1) > 100);
    CHECK(compare(&made, hs_options_default(), false, 3) > 100);
}

/* Points too far away for the shifts or the precision of one system are named among all. */
static void
far_points_are_named_among_all(void)
{
    double        x[8] = {0.0, 0.0, 0.5, 0.5, 0.0, 3.9, 0.0, -3.9};
    const int64_t first[] = {0, 2, 4};
    hs_box        box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0, 0.0}, {0x1p40, 8.0}}};
    const hs_points  points = {x, 4, 2, HS_FLOAT64, 16, 8};
    const hs_systems systems = {2, first, &box, NULL, NULL, NULL, NULL, NULL, NULL};
    hs_options       options = hs_options_default();
    hs_pairs        *pairs = NULL;
    hs_failure       failure;
    int64_t          counts[2];
    options.cutoff = 1.0;
    CHECK(hs_systems_count(&points, &systems, &options, counts, &failure) == HS_OK);
    CHECK(counts[0] == 1 && counts[1] == 1);
    options.want = HS_WANT_SHIFT;
    for (int sorted = 0; sorted < 2; sorted++) {
        options.sorted = sorted;
        CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_SHIFT_RANGE);
        CHECK(pairs == NULL && (failure.row == 2 || failure.row == 3));
    }
    options.sorted = false;
    x[6] = 0x1p60; /* more turns than are counted */
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(failure.row == 3);
    options.precision = HS_DOUBLE;
    options.want = HS_WANT_I;
    const hs_status status = hs_systems_find(&points, &systems, &options, &pairs, &failure);
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
        const hs_systems systems = {N, first, NULL, NULL, NULL, NULL, NULL, NULL, NULL};
        hs_options       options = hs_options_default();
        hs_pairs        *pairs;
        double           told = 0.0;
        options.cutoff = 0.01;
        options.threads = threads;
        options.poll = note_fraction;
        options.poll_context = &told;
        CHECK(hs_systems_find(&points, &systems, &options, &pairs, NULL) == HS_OK);
        CHECK(told > 0.3 || threads > 1); /* how often the caller's thread polls is up to chance */
        hs_pairs_free(pairs);
    }
}

/* A crowd far from a few others takes cells that are stored sparsely, the next system does not. */
static void
cells_of_one_system_are_not_those_of_the_next(void)
{
    enum { CROWD = 1200, FEW = 300 };
    static double    x[(CROWD + FEW) * 3];
    const int64_t    first[] = {0, CROWD, CROWD + FEW};
    const hs_points  points = {x, CROWD + FEW, 3, HS_FLOAT64, 24, 8};
    const hs_systems systems = {2, first, NULL, NULL, NULL, NULL, NULL, NULL, NULL};
    harness_random   random = {23};
    hs_options       options = hs_options_default();
    hs_pairs        *pairs, *alone;
    for (int e = 0; e < 3 * (CROWD + FEW); e++)
        x[e] = random_unit(&random) * (e < 3 * CROWD ? 4.0 : 8.0) + (e < 30 ? 1e5 : 0.0);
    options.cutoff = 1.0;
    options.cell_size = 1.0;
    CHECK(hs_systems_find(&points, &systems, &options, &pairs, NULL) == HS_OK);
    const int64_t *i = hs_pairs_array(pairs, HS_WANT_I), *j = hs_pairs_array(pairs, HS_WANT_J);
    int64_t        at = 0, wrong = 0;
    for (int s = 0; s < 2; s++) {
        const hs_points own = {x + 3 * first[s], first[s + 1] - first[s], 3, HS_FLOAT64, 24, 8};
        CHECK(hs_pairs_find(AMONG(&own, NULL), &options, &alone, NULL) == HS_OK);
        const int64_t *own_i = hs_pairs_array(alone, HS_WANT_I);
        const int64_t *own_j = hs_pairs_array(alone, HS_WANT_J);
        for (int64_t e = 0; e < hs_pairs_length(alone) && at < hs_pairs_length(pairs); e++, at++)
            wrong += i[at] != own_i[e] + first[s] || j[at] != own_j[e] + first[s];
        hs_pairs_free(alone);
    }
    CHECK(wrong == 0 && at == hs_pairs_length(pairs));
    hs_pairs_free(pairs);
}

void
test_api_systems(void)
{
    RUN(progress_goes_on_over_all_systems);
    RUN(cells_of_one_system_are_not_those_of_the_next);
    RUN(the_same_as_single_calls);
    RUN(single_points_are_read);
    RUN(failures_name_system_and_point);
    RUN(polls_are_counted);
    RUN(a_shortage_is_told_in_pairs_and_bytes);
    RUN(nothing_is_lost_when_memory_is_short);
    RUN(bad_arguments_are_refused);
    RUN(results_go_to_the_callers_arrays);
    RUN(empty_systems_cost_nothing);
    RUN(far_points_are_named_among_all);
}
