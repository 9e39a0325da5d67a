/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_api_nearest.c: rows of the nearest, against all neighbours within a cutoff, put in order by
 * integers that share no code with the library.
 */
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"
#include "../support/nearest_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_api_nearest(void);

static void
rows_are_the_neighbours_in_order(void)
{
    harness_random      random = {31415};
    static random_scene s;
    const char         *names[16];
    const int           n_names = hs_kernel_names(names, 16);
    int64_t             found = 0;
    for (int trial = 0; trial < TRIALS(700); trial++) {
        const int ndim = 1 + trial / SCENE_KINDS % HS_MAX_DIM;
        const int n = random_below(&random, ndim <= 3 ? 50 : ndim <= 5 ? 10 : 5);
        kernel_to_check = names[random_below(&random, n_names)];
        make_scene(&random, trial % SCENE_KINDS, ndim, n, trial % 7 ? 4.0 : 400.0,
                   trial % 11  ? 0
                   : trial % 2 ? -400
                               : 300,
                   &s);
        s.scene.cutoff *= ndim > 5 ? 0.5 : 1.0;
        found += compare_rows(&s.scene, trial % 3 ? -1 : random_below(&random, n + 1),
                              1 + random_below(&random, 40), 1 + trial % 2);
    }
    kernel_to_check = NULL;
    CHECK(found > TRIALS(30000));
}

static void
whichever_allocation_fails_nothing_is_left(void)
{
    harness_random      random = {2};
    static random_scene s;
    bool                ended = false;
    int                 nth = 0;
    make_scene(&random, SCENE_TRICLINIC, 3, 60, 4.0, 0, &s);
    const hs_points points = points_of(&s.scene);
    hs_options      options = options_of(&s.scene);
    options.cutoff = INFINITY;
    options.want = WANT_ALL;
    while (!ended && nth < 300) {
        const int64_t before = hs_test_live_blocks();
        hs_pairs     *rows = NULL;
        hs_test_fail_allocation(++nth);
        const hs_status status =
            hs_nearest_find(AMONG(&points, s.scene.box), 100, &options, &rows, NULL);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        hs_pairs_free(rows);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && nth > 10);
}

static bool
stop_at_once(void *context, double fraction)
{
    (void)context;
    (void)fraction;
    return false;
}

static void
it_can_be_stopped(void)
{
    harness_random      random = {3};
    static random_scene s;
    hs_pairs           *rows = NULL;
    make_scene(&random, SCENE_OPEN, 3, 60, 4.0, 0, &s);
    const hs_points points = points_of(&s.scene);
    hs_options      options = options_of(&s.scene);
    options.cutoff = INFINITY;
    options.want = HS_WANT_J;
    options.poll = stop_at_once;
    CHECK(hs_nearest_find(AMONG(&points, NULL), 3, &options, &rows, NULL) == HS_ERR_INTERRUPTED);
    CHECK(rows == NULL);
    options.cutoff = -1.0;
    CHECK(hs_nearest_find(AMONG(&points, NULL), 3, &options, &rows, NULL) == HS_ERR_CUTOFF);
}

/* ---- as many as you like, all equally far ---- */

#define ORDERS 5040 /* of 7 numbers */

/* All orders of the numbers from 1 to 7: each is as far from the origin as any other. */
static void
list_orders(double (*to)[7])
{
    for (int n = 0; n < ORDERS; n++) {
        int left[7] = {1, 2, 3, 4, 5, 6, 7}, rest = n;
        for (int k = 0; k < 7; k++) {
            const int at = rest % (7 - k);
            rest /= 7 - k;
            to[n][k] = left[at];
            memmove(left + at, left + at + 1, (size_t)(6 - k - at) * sizeof *left);
        }
    }
}

static hs_status
find_ties(int64_t k, int64_t polls, hs_counters *counters, int64_t *wrong)
{
    static double   orders[ORDERS][7];
    const double    origin_of_all[7] = {0.0};
    const hs_points points = {&orders[0][0], ORDERS, 7, HS_FLOAT64, sizeof orders[0], 8};
    const hs_points query = {origin_of_all, 1, 7, HS_FLOAT64, sizeof origin_of_all, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *rows = NULL;
    list_orders(orders);
    options.cutoff = INFINITY;
    options.want = HS_WANT_J;
    options.poll = stop_after;
    options.poll_context = &polls;
    options.counters = counters;
    const hs_status status =
        hs_nearest_find(QUERIED(&points, &query, NULL), k, &options, &rows, NULL);
    *wrong = status != HS_OK && rows != NULL;
    for (int64_t e = 0; status == HS_OK && e < k; e++)
        *wrong += ((const int64_t *)hs_pairs_array(rows, HS_WANT_J))[e] != e;
    hs_pairs_free(rows);
    return status;
}

static void
ties_take_no_more_than_sorting(void)
{
    hs_counters   counters;
    int64_t       wrong;
    const int64_t numbers[] = {1, 64, 65, 1000, ORDERS / 4 - 1, ORDERS};
    for (int t = 0; t < 6; t++) {
        CHECK(find_ties(numbers[t], INT32_MAX, &counters, &wrong) == HS_OK && wrong == 0);
        CHECK(counters.ambiguous < 65 * (int64_t)ORDERS);
        CHECK(numbers[t] <= 64 || counters.ambiguous < 14 * (int64_t)ORDERS);
    }
}

static void
one_row_can_be_stopped_anywhere(void)
{
    hs_counters counters;
    int64_t     wrong;
    CHECK(find_ties(ORDERS, INT32_MAX, &counters, &wrong) == HS_OK);
    const int64_t polls = counters.polls;
    CHECK(polls > 1); /* more than there are groups */
    for (int n = 0; n < polls; n++)
        CHECK(find_ties(ORDERS, n, &counters, &wrong) == HS_ERR_INTERRUPTED && wrong == 0);
}

void
test_api_nearest(void)
{
    RUN(ties_take_no_more_than_sorting);
    RUN(one_row_can_be_stopped_anywhere);
    RUN(rows_are_the_neighbours_in_order);
    RUN(whichever_allocation_fails_nothing_is_left);
    RUN(it_can_be_stopped);
}
