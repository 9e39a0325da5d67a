/* SPDX-License-Identifier: BSD-3-Clause */
/* test_systems_thread.c: when a thread that searches many systems asks whether to go on. */
#include "../../../csrc/core/api/systems_thread.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"

#include <math.h>

void test_systems_thread(void);

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

/* Systems without a pair take time as well: some thousand of them between two polls. */
static void
small_systems_are_polled_between_now_and_then(void)
{
    enum { N = 10000 };
    static double   many[N];
    static int64_t  first[N + 1], counts[N];
    const hs_points points = {many, N, 1, HS_FLOAT64, 8, 8};
    for (int s = 0; s <= N; s++)
        first[s] = s;
    const hs_systems systems = {N, first, NULL, NULL, NULL, NULL, NULL, NULL, NULL};
    hs_options       options = hs_options_default();
    polls            noted = {0, 0.0};
    options.cutoff = 1.0;
    options.threads = 1;
    options.poll = note_poll;
    options.poll_context = &noted;
    CHECK(hs_systems_count(&points, &systems, &options, counts, NULL) == HS_OK);
    CHECK(noted.n >= 3 && noted.n <= 12 && noted.last > 0.75);
}

/* What each thread has done is done by the call. */
static void
work_of_all_threads_is_added_up(void)
{
    enum { N = 64, POINTS = 200 };
    static double   many[N * POINTS];
    static int64_t  first[N + 1], counts[N];
    const hs_points points = {many, N * POINTS, 1, HS_FLOAT64, 8, 8};
    harness_random  random = {5};
    hs_counters     one, two;
    for (int s = 0; s <= N; s++)
        first[s] = s * POINTS;
    for (int e = 0; e < N * POINTS; e++)
        many[e] = random_unit(&random);
    const hs_systems systems = {N, first, NULL, NULL, NULL, NULL, NULL, NULL, NULL};
    hs_options       options = hs_options_default();
    options.cutoff = 0.125;
    options.threads = 1;
    options.counters = &one;
    CHECK(hs_systems_count(&points, &systems, &options, counts, NULL) == HS_OK);
    options.threads = 2;
    options.counters = &two;
    CHECK(hs_systems_count(&points, &systems, &options, counts, NULL) == HS_OK);
    CHECK(one.candidates > N * POINTS && one.candidates == two.candidates &&
          one.pairs == two.pairs);
    CHECK(one.bytes[HS_FOR_POINTS] > 0 && two.bytes[HS_FOR_POINTS] >= one.bytes[HS_FOR_POINTS]);
    CHECK(two.bytes_peak >= one.bytes_peak);
}

/* Where memory does not suffice to sort the pairs of a system, all of them have been found. */
static void
pairs_that_cannot_be_sorted_are_told(void)
{
    enum { N = 2000 };
    static double    many[N];
    const int64_t    first[2] = {0, N};
    const hs_points  points = {many, N, 1, HS_FLOAT64, 8, 8};
    const hs_systems systems = {.n = 1, .first = first};
    hs_options       options = hs_options_default();
    int64_t          count, n_told = 0;
    bool             ended = false;
    options.threads = 1;
    options.sorted = true;
    options.cutoff = 1.0 / 64;
    for (int e = 0; e < N; e++)
        many[e] = (double)((e * 77) % 1024) / 1024; /* more pairs than their density tells */
    CHECK(hs_systems_count(&points, &systems, &options, &count, NULL) == HS_OK);
    for (int64_t nth = 1; !ended && nth < 1000; nth++) {
        hs_pairs  *pairs = NULL;
        hs_failure failure;
        hs_pool_clear(); /* the same allocations each time, whatever was kept before */
        hs_test_fail_allocation(nth);
        const hs_status status = hs_systems_find(&points, &systems, &options, &pairs, &failure);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        n_told += status == HS_ERR_MEMORY && failure.expected_pairs == (double)count;
        hs_pairs_free(pairs);
    }
    CHECK(ended && n_told >= 3);
}

/* A crowd that no sample of the points meets: where its pairs do not fit, those are told that had
 * been found until then. */
static void
pairs_that_do_not_fit_are_told(void)
{
    enum { N = 8000, CROWD = 200 };
    static double   many[N], radii[N];
    const int64_t   first[2] = {0, N};
    const hs_points points = {many, N, 1, HS_FLOAT64, 8, 8};
    const hs_reach  reach = {.radii = radii};
    for (int e = 0; e < N; e++) {
        many[e] = e < N - CROWD ? e : 2345.0 + 0.4 * (e - N) / CROWD;
        radii[e] = 0.25;
    }
    for (int by_reach = 0; by_reach < 2; by_reach++) {
        const hs_systems systems = {.n = 1, .first = first, .reach = by_reach ? &reach : NULL};
        hs_options       options = hs_options_default();
        hs_status        status = HS_ERR_MEMORY;
        int64_t          count;
        double           told = 0.0;
        int              n_told = 0;
        options.threads = 1;
        options.sorted = true;
        options.cutoff = by_reach ? HUGE_VAL : 0.5;
        CHECK(hs_systems_count(&points, &systems, &options, &count, NULL) == HS_OK);
        CHECK(count > CROWD * (CROWD - 1) / 2);
        for (double limit = 1e5; status == HS_ERR_MEMORY; limit *= 1.02) {
            hs_pairs  *pairs = NULL;
            hs_failure failure;
            options.memory_limit = limit;
            status = hs_systems_find(&points, &systems, &options, &pairs, &failure);
            if (status != HS_OK) {
                CHECK(failure.expected_pairs >= told && failure.limit_bytes == limit);
                told = failure.expected_pairs;
                n_told += told > 0.3 * (double)count && told < (double)count;
            }
            hs_pairs_free(pairs);
        }
        CHECK(status == HS_OK && told <= (double)count && n_told > 0);
    }
}

void
test_systems_thread(void)
{
    RUN(small_systems_are_polled_between_now_and_then);
    RUN(work_of_all_threads_is_added_up);
    RUN(pairs_that_cannot_be_sorted_are_told);
    RUN(pairs_that_do_not_fit_are_told);
}
