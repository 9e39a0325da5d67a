/* SPDX-License-Identifier: BSD-3-Clause */
/* test_systems_each.c: one call for each of many systems: polls, threads, and what failures say. */
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include "../../../csrc/halfshell.h"

void test_systems_each(void);

enum { N_SYSTEMS = 50, POINTS = 60, N = N_SYSTEMS * POINTS, N_QUERIES = 2 * N_SYSTEMS };

static struct {
    double     x[N * 3], q[N_QUERIES * 3];
    int64_t    first[N_SYSTEMS + 1], first_query[N_SYSTEMS + 1], counts[N];
    hs_points  points, queries;
    hs_systems systems;
    hs_options options;
} s;

static void
make_scene(void)
{
    harness_random random = {77};
    for (int e = 0; e < N * 3; e++)
        s.x[e] = random_unit(&random);
    for (int e = 0; e < N_QUERIES * 3; e++)
        s.q[e] = random_unit(&random);
    for (int n = 0; n <= N_SYSTEMS; n++) {
        s.first[n] = n * POINTS;
        s.first_query[n] = 2 * n;
    }
    s.points = (hs_points){s.x, N, 3, HS_FLOAT64, 24, 8};
    s.queries = (hs_points){s.q, N_QUERIES, 3, HS_FLOAT64, 24, 8};
    s.systems = (hs_systems){.n = N_SYSTEMS, .first = s.first, .first_query = s.first_query};
    s.options = hs_options_default();
    s.options.cutoff = 0.4;
    s.options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
}

typedef struct polls {
    int64_t n;
    double  last;
} polls;

static bool
note_poll(void *context, double fraction)
{
    polls *noted = context;
    CHECK(fraction >= noted->last && fraction <= 1.0);
    noted->last = fraction;
    noted->n++;
    return true;
}

/* The fraction is that of all systems, and never falls. */
static void
polls_tell_how_far_it_is(void)
{
    for (int threads = 1; threads <= 3; threads++) {
        polls noted = {0, 0.0};
        make_scene();
        s.options.threads = threads;
        s.options.poll = note_poll;
        s.options.poll_context = &noted;
        CHECK(hs_systems_coordination(&s.points, NULL, &s.systems, &s.options, s.counts, NULL) ==
              HS_OK);
        /* Only the caller's thread asks, which may have come too late for any. */
        CHECK(threads > 1 || (noted.n >= 3 && noted.last > 0.7));
    }
}

/* None of the points asks: nothing is found, and the fraction is a number even so. */
static void
systems_without_queries_are_polled(void)
{
    for (int has_queries = 0; has_queries <= 1; has_queries++) {
        polls   noted = {0, 0.0};
        int64_t none[N_SYSTEMS + 1] = {0};
        make_scene();
        s.options.poll = note_poll;
        s.options.poll_context = &noted;
        s.queries.n = 0;
        s.systems.first_query = none;
        if (!has_queries) {
            s.points.n = 0;
            s.systems.first = none;
        }
        CHECK(hs_systems_coordination(&s.points, has_queries ? &s.queries : NULL, &s.systems,
                                      &s.options, s.counts, NULL) == HS_OK);
        CHECK(noted.n >= 1);
    }
}

static hs_status
find_rows(void *context)
{
    hs_pairs       *rows;
    hs_failure      failure;
    const hs_status status =
        hs_systems_neighbors(&s.points, context, &s.systems, &s.options, &rows, &failure);
    hs_pairs_free(rows);
    return status;
}

static void
a_poll_may_stop_it(void)
{
    for (int threads = 1; threads <= 2; threads++) {
        for (int64_t nth = 0; nth < 4; nth++) {
            int64_t left = nth;
            make_scene();
            s.options.threads = threads;
            s.options.poll = stop_after;
            s.options.poll_context = &left;
            const hs_status status = find_rows(NULL);
            /* Another thread may have all systems before the caller's has asked so often. */
            CHECK(status == (left < 0 ? HS_ERR_INTERRUPTED : HS_OK));
            CHECK(threads > 1 || left < 0);
        }
    }
}

static void
memory_may_be_short(void)
{
    static const int64_t pair[] = {0, 1};
    const hs_selection   one_excluded = {.n_excluded = 1, .excluded = pair};
    make_scene();
    s.systems.n = 6;
    s.points.n = s.first[6];
    s.queries.n = s.first_query[6];
    for (s.options.threads = 1; s.options.threads <= 2; s.options.threads++) {
        CHECK(fail_each_allocation(find_rows, NULL, 2000) > 10);
        check_arena(find_rows, NULL);
        CHECK(fail_each_allocation(find_rows, &s.queries, 2000) > 10);
        check_arena(find_rows, &s.queries);
        CHECK(raise_memory_limit(find_rows, NULL, &s.options.memory_limit) > 3);
        s.systems.selection = &one_excluded;
        CHECK(fail_each_allocation(find_rows, NULL, 2000) > 10);
        check_arena(find_rows, NULL);
        s.systems.selection = NULL;
    }
}

/* What a system is refused for names it, and the row among all: its first one, too. */
static void
failures_name_the_row_among_all(void)
{
    static const int bad[] = {17 * POINTS, 17 * POINTS + 5, 18 * POINTS - 1};
    hs_failure       failure;
    hs_pairs        *rows;
    for (int trial = 0; trial < 6; trial++) {
        const int row = bad[trial / 2], query = 40 + trial / 2 % 2;
        make_scene();
        s.options.threads = 1 + trial % 2;
        s.x[3 * row + 1] = NAN;
        CHECK(hs_systems_neighbors(&s.points, NULL, &s.systems, &s.options, &rows, &failure) ==
              HS_ERR_NOT_FINITE);
        CHECK(rows == NULL && failure.row == row && failure.column == 1 && !failure.in_queries);
        CHECK(failure.system == 17);
        make_scene();
        s.options.threads = 1 + trial % 2;
        s.q[3 * query + 2] = INFINITY;
        CHECK(hs_systems_neighbors(&s.points, &s.queries, &s.systems, &s.options, &rows,
                                   &failure) == HS_ERR_NOT_FINITE);
        CHECK(failure.row == query && failure.in_queries && failure.system == 20);
    }
}

/* The row of a box is not that of a point. */
static void
rows_of_boxes_stay(void)
{
    static double boxes[N_SYSTEMS * 9];
    const hs_box  box = {.ndim = 3, .periodic = {true, true, true}};
    hs_failure    failure;
    make_scene();
    for (int n = 0; n < N_SYSTEMS; n++) {
        for (int k = 0; k < 3; k++)
            boxes[9 * n + 4 * k] = 3.0;
    }
    s.systems.box = &box;
    s.systems.rows = boxes;
    boxes[9 * 7 + 8] = 0.0;
    CHECK(hs_systems_coordination(&s.points, NULL, &s.systems, &s.options, s.counts, &failure) ==
          HS_ERR_BOX_DEPENDENT);
    CHECK(failure.row == 2 && failure.system == 7);
    boxes[9 * 7 + 8] = INFINITY;
    CHECK(hs_systems_coordination(&s.points, NULL, &s.systems, &s.options, s.counts, &failure) ==
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
    s.systems.n = s.points.n = 0;
    s.options.counters = &counters;
    CHECK(find_rows(NULL) == HS_OK && counters.pairs == 0);
    s.options.cutoff = -1.0;
    CHECK(find_rows(NULL) == HS_ERR_CUTOFF);
    s.options.cutoff = 1.0;
    s.systems.selection = &numbered;
    CHECK(find_rows(NULL) == HS_ERR_ARGUMENT);
    s.systems.selection = NULL;
    s.systems.reach = &reach;
    CHECK(find_rows(NULL) == HS_ERR_ARGUMENT);
    s.systems.reach = NULL;
    s.options.kernel = "none";
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
    for (int e = 0; e < N * 3; e++) {
        const double at = (double)(random_bits(&random) % 6) / (e < N ? 3.0 : 2.0);
        s.x[e] = at > 0.0 ? at + (double)(e % 7 == 0) * 0x1p-30 : (double)(e % 2) * 0x1p-60;
    }
    s.options.cutoff = 1.0;
    s.options.counters = &single;
    for (int n = 0; n < N_SYSTEMS; n++) {
        hs_pairs       *rows;
        const hs_points own = {s.x + s.first[n] * 3, POINTS, 3, HS_FLOAT64, 24, 8};
        const hs_among  among = {.points = &own};
        CHECK(hs_neighbors_find(&among, &s.options, &rows, NULL) == HS_OK);
        hs_pairs_free(rows);
        add_work(&single, &sum);
        most_bytes = single.bytes_peak > most_bytes ? single.bytes_peak : most_bytes;
    }
    CHECK(sum.ambiguous > 0 && sum.by_float64 > 0 && sum.by_double_word > 0 && sum.by_integers > 0);
    s.options.counters = &all;
    for (s.options.threads = 1; s.options.threads <= 2; s.options.threads++) {
        CHECK(find_rows(NULL) == HS_OK);
        CHECK(is_same_work(&all, &sum));
        CHECK(all.bytes[HS_FOR_POINTS] > 0 && all.bytes_peak >= most_bytes);
    }
}

static double limit_of_all;

static double
find_limit(void *context)
{
    ++*(int *)context;
    return limit_of_all;
}

/* The machine is asked once for all threads, which share what it has. */
static void
threads_share_the_limit(void)
{
    int n_asked = 0;
    make_scene();
    s.options.threads = 2;
    s.options.find_limit = find_limit;
    s.options.find_context = &n_asked;
    limit_of_all = 1e9;
    CHECK(find_rows(NULL) == HS_OK && n_asked == 1);
    limit_of_all = 100.0;
    CHECK(find_rows(NULL) == HS_ERR_MEMORY && n_asked == 2);
}

/* More threads than systems, and systems that are a range of their own. */
static void
few_large_systems(void)
{
    const int64_t ends[] = {0, N / 2, N}, of_queries[] = {0, 1, 2};
    hs_pairs     *one, *many;
    make_scene();
    s.options.cutoff = 0.1;
    s.queries.n = 2;
    s.systems = (hs_systems){.n = 2, .first = ends, .first_query = of_queries};
    CHECK(hs_systems_neighbors(&s.points, NULL, &s.systems, &s.options, &one, NULL) == HS_OK);
    s.options.threads = 4;
    CHECK(hs_systems_neighbors(&s.points, NULL, &s.systems, &s.options, &many, NULL) == HS_OK);
    CHECK(hs_pairs_length(one) > N && hs_pairs_length(one) == hs_pairs_length(many));
    CHECK(memcmp(hs_pairs_array(one, HS_WANT_J), hs_pairs_array(many, HS_WANT_J),
                 (size_t)hs_pairs_length(one) * 8) == 0);
    hs_pairs_free(one);
    hs_pairs_free(many);
    CHECK(find_rows(&s.queries) == HS_OK);
}

void
test_systems_each(void)
{
    RUN(polls_tell_how_far_it_is);
    RUN(systems_without_queries_are_polled);
    RUN(a_poll_may_stop_it);
    RUN(memory_may_be_short);
    RUN(failures_name_the_row_among_all);
    RUN(rows_of_boxes_stay);
    RUN(without_systems_all_else_is_checked);
    RUN(work_of_all_systems_is_added_up);
    RUN(threads_share_the_limit);
    RUN(few_large_systems);
}
