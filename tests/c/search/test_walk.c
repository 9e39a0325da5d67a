/* SPDX-License-Identifier: BSD-3-Clause */
/* test_walk.c: rows and groups of cells are walked, each pair of points once. */
#include "../../../csrc/core/memory/memory.h"
#include "../../../csrc/core/search/walk.h"
#include "../../../csrc/halfshell.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/search_unit.h"

void test_walk(void);

/*
 * ---- walk ----
 *
 * A walk visits the groups of any range of points, in any order of ranges and as often as it is
 * told to.
 */

static search_unit unit;

/* Hits of each point in the caller's order, and where each group began. */
typedef struct found_walk {
    int64_t n, hits[2000];
    int32_t last_first, n_blocks;
    bool    ascends;
} found_walk;

static hs_status
count_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    found_walk *to = context;
    to->ascends = to->ascends && scanner->group.first >= to->last_first;
    to->last_first = scanner->group.first;
    to->n_blocks++;
    for (int32_t t = 0; t < hits->n; t++) {
        const int32_t n = hits->end[t] - (t > 0 ? hits->end[t - 1] : 0);
        CHECK(hits->point[t] == unit.search.bins.order[first + t]);
        to->hits[hits->point[t]] += n;
        to->n += n;
    }
    return HS_OK;
}

/* Blocks of 2^28 candidates are refused before any memory is taken. */
static void
neighbourhoods_without_end_are_refused(void)
{
    const hs_neighbourhood vast = {.candidates = INT64_C(1) << 40, .runs = 1};
    hs_walker              walker;
    search_unit_points(1, 3, 1, 1.0, &unit);
    search_unit_open(NULL, 0.5, true, HS_WANT_I, &unit);
    const int64_t held = unit.call.account.held;
    CHECK(hs_walker_init(&unit.search, HS_BLOCK_LISTS_IDS, &vast, count_hits, NULL, &walker) ==
          HS_ERR_MEMORY);
    CHECK(unit.call.account.held == held);
    hs_walker_close(&unit.search, &walker);
    search_unit_close(&unit);
}

/* ---- the points of a row that a window of cells holds, wherever the window lies ---- */

enum { CELLS = 4 };

static void
windows_are_cut_to_the_row(void)
{
    int32_t   start[2 * CELLS + 1] = {0, 1, 2, 3, 10, 12, 12, 17, 20};
    hs_search search = {.grid = {.shape = {CELLS}}, .bins = {.start = start}};
    hs_link   link = {.base = CELLS}; /* the second row: 2, 0, 5 and 3 points from 10 on */
    for (int low = -3; low < CELLS + 3; low++) {
        for (int high = low; high < CELLS + 3; high++) {
            int32_t first = -1, end = -1, least = 20, most = 10;
            for (int cell = 0; cell < CELLS; cell++) {
                if (cell >= low && cell <= high) {
                    least = start[CELLS + cell] < least ? start[CELLS + cell] : least;
                    most = start[CELLS + cell + 1];
                }
            }
            hs_link_window(&search, &link, low, high, &first, &end);
            CHECK(least < most ? first == least && end == most : first >= end);
            CHECK(first >= 10 && end >= 10 && first <= 20 && end <= 20);
        }
    }
}

/*
 * ---- large blocks ----
 *
 * One point with so many candidates that a search asks between its passes over them whether to go
 * on: any of these polls ends it, and the last answer is right.
 */

enum { SPOTS = 1024, N = 180 * SPOTS }; /* more than 2^18 candidates within 1.5 box lengths */

enum { WITHIN = SPOTS + SPOTS / 2 + 1 }; /* 1.5 box lengths: every spot, half of them twice, ends */

static const int64_t      labels[N];
static const hs_selection but_nearest = {.has_labels = true};
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
    const hs_among      among = {.points = SET(&points, .labels = labels),
                                 .box = box,
                                 .queries = SET(&query, .labels = labels),
                                 .selection = kinds[kind].selection};
    hs_options          options = hs_options_default();
    hs_pairs           *rows = NULL;
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
            nth += IS_SLOW && nth > 2 ? 3 : 1;
            refusal once = {.nth = nth};
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
test_walk(void)
{
    RUN(neighbourhoods_without_end_are_refused);
    RUN(windows_are_cut_to_the_row);
    RUN(any_poll_ends_a_search_of_many_candidates);
}
