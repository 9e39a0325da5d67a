/* SPDX-License-Identifier: BSD-3-Clause */
/* test_nearest_bound.c: the search for a radius that surely suffices ends when it is told to. */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"
#include "../support/among.h"

#include <math.h>

void test_nearest_bound(void);

enum { N = 6000, QUERIES = 400, K = 10 };

/* Points on a sphere, and queries about its centre: no density says how far the nearest are, and to
 * find out takes a walk over nearly all of them for each. */
static hs_status
find_hollow(refusal *once, hs_pairs **rows)
{
    static double   x[3 * N], q[3 * QUERIES];
    harness_random  random = {61};
    const hs_points points = {x, N, 3, HS_FLOAT64, 24, 8};
    const hs_points queries = {q, QUERIES, 3, HS_FLOAT64, 24, 8};
    hs_options      options = hs_options_default();
    for (int i = 0; i < N; i++) {
        double square = 0.0;
        for (int k = 0; k < 3; k++) {
            x[3 * i + k] = random_unit(&random) - 0.5;
            square += x[3 * i + k] * x[3 * i + k];
        }
        for (int k = 0; k < 3; k++)
            x[3 * i + k] /= sqrt(square);
    }
    for (int e = 0; e < 3 * QUERIES; e++)
        q[e] = 0.01 * random_unit(&random);
    options.cutoff = INFINITY;
    options.want = HS_WANT_J;
    options.poll = refuse_once;
    options.poll_context = once;
    return hs_nearest_find(QUERIED(&points, &queries, NULL), K, &options, rows, NULL);
}

static void
one_refusal_ends_the_search(void)
{
    refusal   once = {0, 0};
    hs_pairs *rows = NULL;
    CHECK(find_hollow(&once, &rows) == HS_OK);
    CHECK(hs_pairs_length(rows) == QUERIES * K);
    hs_pairs_free(rows);
    const int64_t polls = once.n;
    CHECK(polls > 2);
    for (int64_t nth = 1; nth <= polls; nth++) {
        once = (refusal){0, nth};
        CHECK(find_hollow(&once, &rows) == HS_ERR_INTERRUPTED);
        CHECK(rows == NULL && once.n == nth); /* there is no further question */
    }
}

void
test_nearest_bound(void)
{
    RUN(one_refusal_ends_the_search);
}
