/* SPDX-License-Identifier: BSD-3-Clause */
/* test_large_blocks.c: one point with so many candidates that a search asks between its passes over
 * them whether to go on: any of these polls ends it, and the last answer is right. */
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"
#include "../support/among.h"

#include "../../../csrc/halfshell.h"

void test_large_blocks(void);

enum { SPOTS = 1024, N = 180 * SPOTS }; /* more than 2^18 candidates within 1.5 box lengths */

enum { WITHIN = SPOTS + SPOTS / 2 + 1 }; /* 1.5 box lengths: every spot, half of them twice, ends */

static const int64_t      labels[N];
static const hs_selection but_nearest = {.labels = labels, .query_labels = labels};
static const hs_selection but_near = {.min_distance = 0.5};

/* Rows with the points' numbers, or in a plane with distances alone, which are written at once; all
 * pairs, or those in a further image, or far enough apart. */
static const struct {
    hs_box              box;
    unsigned            want;
    const hs_selection *selection;
    int64_t             found; /* at each spot */
} kinds[] = {
    {{.ndim = 1, .periodic = {true}, .rows = {{1.0}}},
     HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_SHIFT,
     NULL,
     WITHIN},
    {{.ndim = 2, .periodic = {true}, .rows = {{1.0, 0.0}, {0.0, 1.0}}},
     HS_WANT_DISTANCE,
     NULL,
     WITHIN},
    {{.ndim = 1, .periodic = {true}, .rows = {{1.0}}}, HS_WANT_J, &but_nearest, WITHIN - SPOTS},
    {{.ndim = 1, .periodic = {true}, .rows = {{1.0}}},
     HS_WANT_J | HS_WANT_DISTANCE,
     &but_near,
     WITHIN - SPOTS + 1},
};

typedef struct refusal {
    int64_t n, nth; /* polls so far; the only one that says no */
} refusal;

/* A hs_poll_fn. */
static bool
refuse_once(void *context, double fraction)
{
    refusal *once = context;
    (void)fraction;
    return ++once->n != once->nth;
}

static hs_status
search(int kind, bool sorted, int threads, refusal *once, int64_t *found)
{
    static double       x[2 * N];
    static const double at[2] = {0.5, 0.0};
    const hs_box       *box = &kinds[kind].box;
    const hs_points     points = {x, N, box->ndim, HS_FLOAT64, 16, 8};
    const hs_points     query = {at, 1, box->ndim, HS_FLOAT64, 16, 8};
    const hs_among      among = {
             .points = &points, .box = box, .queries = &query, .selection = kinds[kind].selection};
    hs_options options = hs_options_default();
    hs_pairs  *rows = NULL;
    for (int p = 0; p < N; p++)
        x[2 * p] = (p * 77 % SPOTS) / (double)SPOTS;
    options.cutoff = 0.75;
    options.want = kinds[kind].want;
    options.sorted = sorted;
    options.threads = threads;
    options.poll = refuse_once;
    options.poll_context = once;
    const hs_status status = hs_neighbors_find(&among, &options, &rows, NULL);
    CHECK((status == HS_OK) == (rows != NULL));
    *found = status == HS_OK ? hs_pairs_length(rows) : 0;
    hs_pairs_free(rows);
    return status;
}

static void
any_poll_ends_a_search_of_many_candidates(void)
{
    const int64_t before = hs_test_live_blocks();
    for (int trial = 0; trial < 16; trial += IS_SLOW ? 3 : 1) { /* 3: all kinds, all else */
        const int  kind = trial / 4, threads = 1 + trial % 2;
        const bool sorted = trial / 2 % 2;
        hs_status  status = HS_ERR_INTERRUPTED;
        int64_t    found = 0, nth = 0;
        while (status != HS_OK && nth < 200) {
            refusal once = {.nth = ++nth};
            status = search(kind, sorted, threads, &once, &found);
            CHECK(status == (once.n >= nth ? HS_ERR_INTERRUPTED : HS_OK));
        }
        /* Of two threads the other one, which does not poll, may do the work. */
        CHECK((nth > 2 || threads > 1) && nth < 200);
        CHECK(found == N / SPOTS * kinds[kind].found);
    }
    CHECK(hs_test_live_blocks() == before);
}

void
test_large_blocks(void)
{
    RUN(any_poll_ends_a_search_of_many_candidates);
}
