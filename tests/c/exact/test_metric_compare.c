/* SPDX-License-Identifier: BSD-3-Clause */
/* test_metric_compare.c: which of two is nearer, against integers that share no code with it. */
#include "../../../csrc/core/exact/metric.h"
#include "../../../csrc/core/exact/metric_integer.h"
#include "../support/bigint.h"
#include "../support/harness.h"
#include "../support/random_scenes.h"

#include <float.h>

void test_metric_compare(void);

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

/* Each stage tells two distances apart that it can tell, and leaves the others to the next; equal
 * ones are so for the first that loses nothing. */
static void
the_first_stage_that_can_tell_which_is_nearer_does(void)
{
    const double p[2] = {0.0, 0.0}, rows[1][8] = {{0.0}};
    const double odd = 1.0 + 0x1p-52; /* with a hair beside it more than two words hold */
    const struct {
        double        q[2];
        const double *to;
        int           sign;
        int64_t       stages[3];
    } cases[] = {
        {{1.0, 0.5}, (const double[2]){1.0, 0.25}, 1, {1, 0, 0}},
        {{1.0, 0x1p-30}, (const double[2]){1.0, 0.0}, 1, {0, 1, 0}},
        {{1.0, 0x1p-30}, (const double[2]){1.0, 0x1.8p-30}, -1, {0, 1, 0}},
        {{1.0, 0.5}, (const double[2]){-0.5, 1.0}, 0, {0, 1, 0}},
        {{odd, 0x1p-80}, (const double[2]){0x1p-80, odd}, 0, {0, 0, 1}},
        {{odd, 0x1.8p-80}, (const double[2]){odd, 0x1p-80}, 1, {0, 0, 1}},
    };
    hs_metric metric;
    hs_metric_init(&metric, 2, 0, rows, 1.0, true);
    for (int c = 0; c < 6; c++) {
        hs_stages     stages = {0};
        const hs_span one = {p, cases[c].q, NULL}, other = {p, cases[c].to, NULL};
        CHECK(hs_metric_compare(&metric, &one, &other, &stages) == cases[c].sign);
        CHECK(stages.by_float64 == cases[c].stages[0]);
        CHECK(stages.by_double_word == cases[c].stages[1]);
        CHECK(stages.by_integers == cases[c].stages[2]);
        CHECK(hs_metric_compare(&metric, &other, &one, &stages) == -cases[c].sign);
    }
}

void
test_metric_compare(void)
{
    RUN(order_is_that_of_real_numbers);
    RUN(order_at_the_ends_of_the_range);
    RUN(the_first_stage_that_can_tell_which_is_nearer_does);
}
