/* SPDX-License-Identifier: BSD-3-Clause */
/* test_refused_memory.c: what does not fit a limit is refused for what it is, before the system is
 * asked for it. */
#include "../../../csrc/core/collect/columns.h"
#include "../../../csrc/core/search/neighbourhood.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/among.h"

void test_refused_memory(void);

/* Rows that just miss their limit: the result would not fit, and the search had what it needs. */
static void
rows_that_just_miss_their_limit_say_so(void)
{
    enum { N = 3000 };
    static double   x[3 * N];
    static int64_t  counts[N];
    harness_random  random = {11};
    const hs_points points = {x, N, 3, HS_FLOAT64, 24, 8};
    hs_box          box = {.ndim = 3, .periodic = {true, true, true}};
    hs_options      options = hs_options_default();
    double          n_entries = 0.0;
    int             missed = 0;
    for (int e = 0; e < 3 * N; e++)
        x[e] = 10.0 * random_unit(&random);
    for (int k = 0; k < 3; k++)
        box.rows[k][k] = 10.0;
    options.cutoff = 2.0;
    CHECK(hs_neighbors_count(AMONG(&points, &box), &options, counts, NULL) == HS_OK);
    for (int i = 0; i < N; i++)
        n_entries += (double)counts[i];
    options.want = HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT;
    const double bytes = n_entries * (8 + 8 + 24 + 12);
    for (double part = 0.97; part < 1.0; part += 0.002) {
        hs_pairs  *rows = NULL;
        hs_failure failure;
        options.memory_limit = part * bytes;
        CHECK(hs_neighbors_find(AMONG(&points, &box), &options, &rows, &failure) == HS_ERR_MEMORY);
        CHECK(failure.search_bytes == 0.0 && failure.limit_bytes == options.memory_limit);
        missed += failure.expected_pairs == n_entries && failure.expected_bytes == bytes;
    }
    CHECK(missed > 0); /* not by the estimate alone */
}

/* More neighbours than any memory holds: not one allocation is tried beyond the limit. */
static void
limits_are_heeded_before_anything_is_reserved(void)
{
    const double    x[2] = {0.0, 1.0};
    const hs_points points = {x, 2, 1, HS_FLOAT64, 8, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *rows = NULL;
    hs_failure      failure;
    hs_account      account;
    hs_output       output;
    options.memory_limit = 1e6;
    options.cutoff = INFINITY;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    const hs_status status =
        hs_nearest_find(AMONG(&points, NULL), INT64_C(1) << 41, &options, &rows, &failure);
    CHECK(status == HS_ERR_MEMORY && failure.limit_bytes == 1e6);
    CHECK(failure.expected_pairs == 0x1p42 && failure.expected_bytes == 0x1p46);
    hs_account_init(&account, &options);
    hs_output_init(&account, 1, HS_WANT_J, 8, &output);
    hs_test_fail_allocation(1);
    CHECK(hs_output_reserve(&output, 200000, 0.0) == HS_ERR_MEMORY);
    CHECK(hs_test_failure_is_due()); /* nothing was asked for */
    hs_test_fail_allocation(0);
    CHECK(hs_output_reserve(&output, 100000, 0.0) == HS_OK);
    hs_output_free(&output);
    hs_account_close(&account);
}

/* So many points that only a walk can tell how large neighbourhoods are: whatever fails in it ends
 * the call, and nothing is left. */
static void
rows_of_many_points_survive_each_failure(void)
{
    enum { N = HS_BLOCK_CANDIDATES + 100 };
    double         *x = malloc(N * sizeof *x);
    const hs_points points = {x, N, 1, HS_FLOAT64, 8, 8};
    hs_options      options = hs_options_default();
    const int64_t   before = hs_test_live_blocks();
    bool            ended = false;
    int             nth = 0;
    options.threads = 1;
    options.cutoff = 1.0;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    for (int i = 0; i < N; i++)
        x[i] = 0.75 * i;
    while (!ended && nth < 200) {
        hs_pairs *rows = NULL;
        hs_test_fail_allocation(++nth);
        const hs_status status = hs_neighbors_find(AMONG(&points, NULL), &options, &rows, NULL);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK ? hs_pairs_length(rows) == 2 * (N - 1) : status == HS_ERR_MEMORY);
        hs_pairs_free(rows);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && nth > 10);
    free(x);
}

void
test_refused_memory(void)
{
    RUN(rows_of_many_points_survive_each_failure);
    RUN(rows_that_just_miss_their_limit_say_so);
    RUN(limits_are_heeded_before_anything_is_reserved);
}
