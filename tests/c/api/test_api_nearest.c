/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_api_nearest.c: which of two is nearer, against integers that share no code with it; and rows
 * of the nearest, against all neighbours within a cutoff, put in order by such integers.
 */
#include "../../../csrc/core/exact/metric_integer.h"
#include "../../../csrc/core/exact/metric.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"
#include "../support/near_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_api_nearest(void);

/* ---- which is nearer ---- */

typedef struct spans {
    int     ndim, n_rows;
    double  p[8], q[2][8], rows[8][8];
    int64_t shift[2][8];
} spans;

static int
true_order(const spans *s)
{
    const double(*rows)[8] = (const double(*)[8])s->rows;
    return big_compare(big_square(s->ndim, s->n_rows, rows, s->p, s->q[0], s->shift[0]),
                       big_square(s->ndim, s->n_rows, rows, s->p, s->q[1], s->shift[1]));
}

static bool
orders_like(const spans *s, int sign, hs_stages *stages)
{
    const hs_span one = {s->p, s->q[0], s->shift[0]}, other = {s->p, s->q[1], s->shift[1]};
    hs_metric     metric;
    hs_metric_init(&metric, s->ndim, s->n_rows, (const double(*)[8])s->rows, 1.0, true);
    return hs_metric_compare(&metric, &one, &other, stages) == sign &&
           hs_metric_compare(&metric, &other, &one, stages) == -sign &&
           hs_metric_compare(&metric, &one, &one, stages) == 0 &&
           hs_integer_compare_two(&metric, &one, &other) == sign;
}

/* The second is the first, mirrored or turned, and then moved by a few last places or not. */
static void
make_spans(harness_random *random, spans *s)
{
    const int exponent = random_below(random, 8) ? 0 : random_below(random, 1200) - 600;
    const int numbers = random_below(random, 4), ndim = 1 + random_below(random, HS_MAX_DIM);
    memset(s, 0, sizeof *s);
    s->ndim = ndim;
    s->n_rows = random_below(random, ndim + 1);
    for (int k = 0; k < ndim; k++) {
        s->p[k] = ldexp(random_entry(random, numbers, 4.0), exponent);
        s->q[0][k] = ldexp(random_entry(random, numbers, 4.0), exponent);
        for (int l = 0; l < s->n_rows; l++)
            s->rows[l][k] = ldexp(random_entry(random, numbers, 2.0) - 1.0, exponent);
    }
    const int turn = random_below(random, ndim);
    for (int k = 0; k < ndim; k++) {
        const int other = (k + turn) % ndim;
        s->q[1][k] = random_below(random, 2) ? s->p[k] + (s->q[0][other] - s->p[other])
                                             : s->p[k] - (s->q[0][other] - s->p[other]);
    }
    for (int steps = random_below(random, 4); steps > 0; steps--)
        s->q[1][turn] = nextafter(s->q[1][turn], random_below(random, 2) ? -8.0 : 8.0);
    for (int l = 0; l < s->n_rows; l++) {
        s->shift[0][l] = random_below(random, 5) - 2;
        s->shift[1][l] = random_below(random, 3) ? s->shift[0][l] : -s->shift[0][l];
    }
    if (s->n_rows > 0 && random_below(random, 50) == 0)
        s->shift[1][0] = s->shift[0][0] = INT64_MAX - random_below(random, 3);
}

static void
order_is_that_of_real_numbers(void)
{
    harness_random random = {99};
    hs_stages      stages = {0};
    int            ties = 0, wrong = 0;
    for (int trial = 0; trial < 40000; trial++) {
        spans s;
        make_spans(&random, &s);
        const int sign = true_order(&s);
        ties += sign == 0;
        wrong += !orders_like(&s, sign, &stages);
    }
    CHECK(wrong == 0);
    CHECK(ties > 3000);
    CHECK(stages.by_float64 > 1000 && stages.by_double_word > 1000 && stages.by_integers > 1000);
}

static void
order_at_the_ends_of_the_range(void)
{
    const double ends[] = {0.0, 5e-324,  -5e-324, 1e-310,  0x1p-400, 0x1p-399,
                           1.0, 0x1p400, 0x1p401, DBL_MAX, -DBL_MAX};
    enum { ENDS = sizeof ends / sizeof ends[0] };
    hs_stages stages = {0};
    int       wrong = 0;
    for (int e = 0; e < ENDS * ENDS * ENDS; e++) {
        spans s = {.ndim = 2, .n_rows = 1};
        s.p[0] = ends[e % ENDS];
        s.q[0][0] = ends[e / ENDS % ENDS];
        s.q[1][1] = ends[e / ENDS / ENDS];
        s.rows[0][0] = ends[(e + 3) % ENDS];
        s.shift[0][0] = e % 3 - 1;
        wrong += !orders_like(&s, true_order(&s), &stages);
    }
    CHECK(wrong == 0);
}

/* ---- rows ---- */

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
    RUN(order_is_that_of_real_numbers);
    RUN(order_at_the_ends_of_the_range);
    RUN(rows_are_the_neighbours_in_order);
    RUN(whichever_allocation_fails_nothing_is_left);
    RUN(it_can_be_stopped);
}
