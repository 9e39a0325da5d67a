/* SPDX-License-Identifier: BSD-3-Clause */
/* test_walk.c: a walk visits the groups of any range of points, in any order of ranges and as often
 * as it is told to; and what it says of neighbourhoods before it has seen them holds. */
#include "../support/search_unit.h"

#include <math.h>

void test_walk(void);

static search_unit unit;

/* Hits of each point in the caller's order, and where each group began. */
typedef struct found {
    int64_t n, hits[2000];
    int32_t last_first, n_blocks;
    bool    ascends;
} found;

static hs_status
count_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    found *to = context;
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

static void
open_walker(hs_walker *walker, found *to)
{
    memset(to, 0, sizeof *to);
    to->ascends = true;
    CHECK(hs_walker_init(&unit.search, HS_BLOCK_LISTS_IDS, count_hits, to, walker) == HS_OK);
}

/* Within the cutoff of point i in the 3^d next images, itself too. The box is a cube or none. */
static int64_t
neighbours_of(int i, const hs_box *box, double cutoff)
{
    const int d = unit.points.ndim;
    int64_t   n = 0;
    for (int j = 0; j < unit.points.n; j++) {
        for (int image = 0; image < (d == 1 ? 3 : d == 2 ? 9 : 27); image++) {
            double square = 0.0;
            bool   exists = true;
            for (int k = 0, rest = image; k < d; k++, rest /= 3) {
                const double side = box != NULL && box->periodic[k] ? box->rows[k][k] : 0.0;
                const double along = unit.x[j * d + k] - unit.x[i * d + k] + (rest % 3 - 1) * side;
                exists = exists && (side > 0.0 || rest % 3 == 1);
                square += along * along;
            }
            n += exists && square <= cutoff * cutoff;
        }
    }
    return n;
}

/* Ranges in any order, and again: each of its points is met as often as its range is. */
static void
ranges_come_in_any_order(void)
{
    static found all, some;
    for (int trial = 0; trial < 6; trial++) {
        const int    d = 1 + trial % 3, n = 600;
        hs_box       box = {.ndim = d, .periodic = {trial % 2, true, true}};
        hs_walker    walker;
        const double cutoff = 0.3;
        for (int k = 0; k < d; k++)
            box.rows[k][k] = k == 0 || d == 1 ? 4.0 : 1.0;
        search_unit_points(900 + (uint64_t)trial, n, d, 1.0, &unit);
        for (int i = 0; i < n; i++)
            unit.x[i * d] *= 4.0;
        search_unit_open(&box, cutoff, true, HS_WANT_I, &unit);
        open_walker(&walker, &all);
        CHECK(hs_walk(&walker, 0, n) == HS_OK && all.ascends);
        const int32_t n_blocks = all.n_blocks;
        for (int i = 0; i < n; i += 13)
            CHECK(all.hits[i] == neighbours_of(i, &box, cutoff));
        all.last_first = 0;
        CHECK(hs_walk(&walker, 0, n) == HS_OK && all.n_blocks == 2 * n_blocks);
        hs_walker_close(&unit.search, &walker);
        open_walker(&walker, &some);
        const int32_t cuts[] = {0, 1, 64, 65, 200, 201, 599, n};
        for (int part = 6; part >= 0; part--) /* the last ones first */
            CHECK(hs_walk(&walker, cuts[part], cuts[part + 1]) == HS_OK);
        CHECK(!some.ascends && some.n_blocks == n_blocks && 2 * some.n == all.n);
        for (int i = 0; i < n; i++)
            CHECK(2 * some.hits[i] == all.hits[i]);
        CHECK(hs_walk(&walker, 5, 5) == HS_OK && hs_walk(&walker, n, n) == HS_OK);
        CHECK(some.n_blocks == n_blocks);
        hs_walker_close(&unit.search, &walker);
        hs_walker_close(&unit.search, &walker); /* harmless */
        search_unit_close(&unit);
    }
}

/* One point as a group of its own, between walks over ranges. */
static void
single_points_find_the_same(void)
{
    static found all, own;
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{2.0}, {0.0, 2.0}}};
    const int    n = 500;
    hs_walker    walker;
    search_unit_points(4711, n, 2, 2.0, &unit);
    search_unit_open(&box, 0.25, true, HS_WANT_I, &unit);
    open_walker(&walker, &all);
    CHECK(hs_walk(&walker, 0, n) == HS_OK);
    hs_walker_close(&unit.search, &walker);
    open_walker(&walker, &own);
    CHECK(hs_walk(&walker, 0, 100) == HS_OK);
    for (int32_t si = n - 1; si >= 0; si--) {
        memset(own.hits, 0, sizeof own.hits);
        CHECK(hs_walk_point(&walker, si) == HS_OK);
        const int32_t i = unit.search.bins.order[si];
        CHECK(own.hits[i] == all.hits[i] && own.last_first == si);
    }
    own.n = 0; /* links of the walk over rows are found anew */
    CHECK(hs_walk(&walker, 100, n) == HS_OK && hs_walk(&walker, 0, 100) == HS_OK);
    CHECK(own.n == all.n);
    hs_walker_close(&unit.search, &walker);
    search_unit_close(&unit);
}

/* No distance is below zero, so that no group is visited. */
static void
no_distance_is_below_zero(void)
{
    static found all;
    hs_walker    walker;
    search_unit_points(5, 30, 2, 1.0, &unit);
    for (int inclusive = 0; inclusive < 2; inclusive++) {
        search_unit_open(NULL, 0.0, true, HS_WANT_I, &unit);
        open_walker(&walker, &all);
        walker.scanner.options.inclusive = inclusive;
        CHECK(hs_walk(&walker, 0, 30) == HS_OK && all.n == (inclusive ? 30 : 0));
        CHECK(all.n_blocks == 0 || inclusive);
        hs_walker_close(&unit.search, &walker);
        search_unit_close(&unit);
    }
}

/* Candidates and runs of the largest neighbourhood, against what was said before. */
static void
neighbourhoods_are_bounded(void)
{
    int n_known = 0;
    for (int trial = 0; trial < 24; trial++) {
        const int        d = 1 + trial % 3;
        hs_box           box = {.ndim = d};
        hs_neighbourhood bound, most;
        hs_walker        walker;
        double           bytes = 0.0;
        const double     cutoff = trial % 2 ? 2.6 : 0.35;
        for (int k = 0; k < d; k++) {
            box.periodic[k] = trial / 3 % (k + 2) == 0;
            box.rows[k][k] = 1.0;
        }
        search_unit_points(70 + (uint64_t)trial, trial % 5 ? 40 : 200, d, 1.0, &unit);
        search_unit_open(&box, cutoff, true, HS_WANT_I, &unit);
        hs_search *search = &unit.search;
        const bool known = hs_walker_bound(search, &bound);
        CHECK(hs_walker_init(search, HS_BLOCK_SIZES, NULL, NULL, &walker) == HS_OK);
        CHECK(hs_walk(&walker, 0, (int32_t)unit.points.n) == HS_OK);
        most = walker.scanner.most;
        CHECK(most.candidates >= 1 && most.runs >= 1 && most.runs <= most.candidates);
        CHECK(!known || (most.candidates <= bound.candidates && most.runs <= bound.runs));
        CHECK(!known || bound.candidates < HS_BLOCK_CANDIDATES);
        CHECK(known || bound.candidates == 0);
        CHECK(bound.candidates == 0 || bound.candidates >= unit.points.n);
        CHECK(hs_walker_capacity(search) <= HS_BLOCK_CANDIDATES);
        CHECK(!known || hs_walker_capacity(search) >= bound.candidates + HS_GROUP_POINTS);
        n_known += known;
        hs_walker_close(search, &walker);
        /* Some ninety bytes for each candidate, more where there are more axes. */
        CHECK(hs_walker_fits(search, &most, &bytes) && bytes == 0.0);
        search->call->account.limit =
            (double)search->call->account.held + 40.0 * (double)most.candidates;
        CHECK(!hs_walker_fits(search, &most, &bytes));
        CHECK(bytes > 40.0 * (double)most.candidates && bytes < 200.0 * (double)most.candidates);
        search->call->account.limit = (double)search->call->account.held + bytes;
        CHECK(hs_walker_fits(search, &most, &bytes));
        search_unit_close(&unit);
    }
    CHECK(n_known > 12);
}

/* A block for whole neighbourhoods: each point's hits come at once. */
static void
ordered_walks_visit_each_group_once(void)
{
    static found     all;
    const hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    hs_neighbourhood bound;
    hs_walker        walker;
    search_unit_points(8, 150, 2, 1.0, &unit);
    search_unit_open(&box, 0.6, true, HS_WANT_I, &unit);
    CHECK(hs_walker_bound(&unit.search, &bound));
    memset(&all, 0, sizeof all);
    all.ascends = true;
    CHECK(hs_walker_init_ordered(&unit.search, HS_BLOCK_LISTS_IDS, &bound, count_hits, &all,
                                 &walker) == HS_OK);
    CHECK(hs_walk(&walker, 0, 150) == HS_OK);
    CHECK(walker.scanner.n_blocks == walker.scanner.n_groups && walker.scanner.n_groups > 2);
    for (int i = 0; i < 150; i += 7)
        CHECK(all.hits[i] == neighbours_of(i, &box, 0.6));
    hs_walker_close(&unit.search, &walker);
    search_unit_close(&unit);
}

/* Blocks of 2^28 candidates are refused before any memory is taken. */
static void
neighbourhoods_without_end_are_refused(void)
{
    const hs_neighbourhood vast = {.candidates = INT64_C(1) << 40, .runs = 1};
    hs_walker              walker;
    double                 bytes = 0.0;
    search_unit_points(1, 3, 1, 1.0, &unit);
    search_unit_open(NULL, 0.5, true, HS_WANT_I, &unit);
    const int64_t held = unit.call.account.held;
    CHECK(!hs_walker_fits(&unit.search, &vast, &bytes) && bytes > 0x1p40);
    CHECK(hs_walker_init_ordered(&unit.search, HS_BLOCK_LISTS_IDS, &vast, count_hits, NULL,
                                 &walker) == HS_ERR_MEMORY);
    CHECK(unit.call.account.held == held);
    hs_walker_close(&unit.search, &walker);
    search_unit_close(&unit);
}

/* What a walker of whole neighbourhoods takes at least, before it is opened. */
static void
room_for_a_neighbourhood_is_known(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    for (int trial = 0; trial < 2; trial++) {
        const hs_neighbourhood most = {.candidates = trial ? 300000 : 200000, .runs = 1};
        hs_walker              walker;
        double                 bytes = 0.0;
        search_unit_points(4, 30, 2, 1.0, &unit);
        search_unit_open(&box, 0.5, true, HS_WANT_SHIFT | HS_WANT_DISTANCE, &unit);
        hs_account *account = &unit.call.account;
        account->limit = 0.0;
        CHECK(!hs_walker_fits(&unit.search, &most, &bytes));
        account->limit = INFINITY;
        const double held = (double)account->held;
        CHECK(hs_walker_init_ordered(&unit.search, HS_BLOCK_LISTS_PLACES, &most, count_hits, NULL,
                                     &walker) == HS_OK);
        const double taken = (double)account->held - held;
        CHECK(taken >= bytes && taken < 1.6 * bytes);
        hs_walker_close(&unit.search, &walker);
        search_unit_close(&unit);
    }
}

/* A walk that has tested more than it may ends with the block in which it did. */
static void
walks_end_where_enough_is_tested(void)
{
    static found all;
    hs_walker    walker;
    search_unit_points(2, 400, 2, 1.0, &unit);
    search_unit_open(NULL, 0.2, true, HS_WANT_I, &unit);
    open_walker(&walker, &all);
    CHECK(hs_walk(&walker, 0, 400) == HS_OK);
    const int64_t n_candidates = walker.scanner.n_candidates;
    hs_walker_close(&unit.search, &walker);
    open_walker(&walker, &all);
    walker.scanner.candidate_limit = n_candidates;
    CHECK(hs_walk(&walker, 0, 400) == HS_OK);
    hs_walker_close(&unit.search, &walker);
    open_walker(&walker, &all);
    walker.scanner.candidate_limit = n_candidates - 1;
    CHECK(hs_walk(&walker, 0, 400) == HS_STOPPED);
    CHECK(walker.scanner.n_candidates == n_candidates);
    hs_walker_close(&unit.search, &walker);
    open_walker(&walker, &all);
    walker.scanner.candidate_limit = n_candidates / 2;
    CHECK(hs_walk(&walker, 0, 400) == HS_STOPPED);
    CHECK(walker.scanner.n_candidates > n_candidates / 2);
    CHECK(walker.scanner.n_candidates < n_candidates);
    hs_walker_close(&unit.search, &walker);
    search_unit_close(&unit);
}

void
test_walk(void)
{
    RUN(neighbourhoods_without_end_are_refused);
    RUN(room_for_a_neighbourhood_is_known);
    RUN(walks_end_where_enough_is_tested);
    RUN(ranges_come_in_any_order);
    RUN(single_points_find_the_same);
    RUN(no_distance_is_below_zero);
    RUN(neighbourhoods_are_bounded);
    RUN(ordered_walks_visit_each_group_once);
}
