/* SPDX-License-Identifier: BSD-3-Clause */
/* test_nearest_bound.c: the search for a radius that surely suffices ends when it is told to. */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/nearest_unit.h"
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
    refusal   once = {.nth = 0};
    hs_pairs *rows = NULL;
    CHECK(find_hollow(&once, &rows) == HS_OK);
    CHECK(hs_pairs_length(rows) == QUERIES * K);
    hs_pairs_free(rows);
    const int64_t polls = once.n;
    CHECK(polls > 2);
    for (int64_t nth = 1; nth <= polls; nth++) {
        once = (refusal){.nth = nth};
        CHECK(find_hollow(&once, &rows) == HS_ERR_INTERRUPTED);
        CHECK(rows == NULL && once.n == nth); /* there is no further question */
    }
}

/* The distance from a query to its k-th nearest, by looking at all of them. */
static double
kth_distance(const double *x, int n, const double *q, int k)
{
    double least[64];
    int    kept = 0;
    for (int i = 0; i < n; i++) {
        const double distance = hypot(x[2 * i] - q[0], x[2 * i + 1] - q[1]);
        int          at = kept < k ? kept++ : k;
        for (; at > 0 && least[at - 1] > distance; at--)
            if (at < k)
                least[at] = least[at - 1];
        if (at < k)
            least[at] = distance;
    }
    return least[k - 1];
}

/* The radius holds as many as are wanted, and hardly a point more, whatever the first guess. */
static void
bounds_are_the_distances_themselves(void)
{
    enum { POINTS = 300 };
    static double        x[2 * POINTS];
    static nearest_unit  unit;
    const hs_options     options = hs_options_default();
    static const int64_t wanted[] = {1, 2, 3, 7, 20, 63};
    harness_random       random = {62};
    for (int e = 0; e < 2 * POINTS; e++)
        x[e] = random_unit(&random);
    for (int trial = 0; trial < 60; trial++) {
        const int64_t      k = wanted[trial % 6];
        const double       q[2] = {2.0 * random_unit(&random) - 0.5, random_unit(&random)};
        const hs_points    points = {x, POINTS, 2, HS_FLOAT64, 16, 8};
        const hs_points    query = {q, 1, 2, HS_FLOAT64, 16, 8};
        hs_nearest_bounder bounder;
        nearest_unit_open(&points, &query, NULL, k, HS_WANT_J, INFINITY, &unit);
        hs_nearest_group group = nearest_unit_group(&unit, ldexp(1.0, trial % 9 - 8));
        CHECK(hs_nearest_bounder_init(&unit.near, &bounder) == HS_OK);
        CHECK(hs_nearest_bound(&unit.near, &options, &bounder, &group) == HS_OK);
        const double distance =
            hs_scale_apply(unit.search.scene.scale, kth_distance(x, POINTS, q, (int)k));
        const double radius = group.radius;
        CHECK(!group.is_complete);
        CHECK(radius >= distance && radius <= distance * (1.0 + 1e-6));
        hs_nearest_bounder_free(&unit.near, &bounder);
        nearest_unit_close(&unit);
    }
}

void
test_nearest_bound(void)
{
    RUN(one_refusal_ends_the_search);
    RUN(bounds_are_the_distances_themselves);
}
