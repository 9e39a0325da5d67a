/* SPDX-License-Identifier: BSD-3-Clause */
/* test_refusals.c: a poll that says no once, and yes ever after, ends a search of any kind. */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"
#include "../support/among.h"

void test_refusals(void);

enum { N = 40000, CROWD = 2500 };

/* 0: evenly. 1: one in four points in a second place far away, so that only occupied cells are
 * stored. 2: also a crowd that is more than one block of candidates. */
static void
place(int how, double *x)
{
    harness_random random = {808};
    for (int e = 0; e < 3 * N; e++)
        x[e] = random_unit(&random) + (how == 1 && e / 3 % 4 == 0 ? 1e7 : 0.0);
    for (int e = 0; how == 2 && e < 3 * CROWD; e++)
        x[e] *= 0.02;
}

static hs_status
search(int kind, int how, refusal *once)
{
    static double   x[3 * N];
    static int64_t  counts[N];
    const hs_points points = {x, N, 3, HS_FLOAT64, 24, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *found = NULL;
    hs_status       status;
    int64_t         n;
    place(how, x);
    options.cutoff = 0.02;
    options.want = HS_WANT_I | HS_WANT_J;
    options.poll = refuse_once;
    options.poll_context = once;
    switch (kind) {
    case 0: status = hs_pairs_find(AMONG(&points, NULL), &options, &found, NULL); break;
    case 1: status = hs_pairs_count(AMONG(&points, NULL), &options, &n, NULL); break;
    case 2: status = hs_neighbors_count(AMONG(&points, NULL), &options, counts, NULL); break;
    case 3: status = hs_pairs_count(QUERIED(&points, &points, NULL), &options, &n, NULL); break;
    case 4: status = hs_nearest_find(AMONG(&points, NULL), 5, &options, &found, NULL); break;
    default: status = hs_neighbors_find(AMONG(&points, NULL), &options, &found, NULL);
    }
    CHECK(found == NULL || status == HS_OK);
    hs_pairs_free(found);
    return status;
}

static void
one_refusal_ends_any_search(void)
{
    for (int trial = 0; trial < 18; trial++) {
        refusal once = {.nth = 0, .twice = trial / 3 == 5};
        CHECK(search(trial / 3, trial % 3, &once) == HS_OK);
        const int64_t polls = once.n, step = 1 + polls / 8;
        CHECK(polls > 0);
        for (int64_t nth = 1; nth <= polls; nth += step) {
            once = (refusal){.nth = nth, .twice = once.twice};
            CHECK(search(trial / 3, trial % 3, &once) == HS_ERR_INTERRUPTED);
            CHECK(once.n == nth);
        }
    }
}

void
test_refusals(void)
{
    RUN(one_refusal_ends_any_search);
}
