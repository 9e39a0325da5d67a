/* SPDX-License-Identifier: BSD-3-Clause */
/* test_search.c: which points ask, how points that are part of more are numbered, and that what is
 * closed is freed once. */
#include "../support/search_unit.h"

void test_search(void);

static search_unit unit;

/* Full lists have each pair twice, and queries as many pairs as there are more of them. */
static void
asking_points_tell_how_many_pairs_there_are(void)
{
    const double    x[4] = {0.0, 1.0, 2.0, 3.0};
    const hs_points points = {x, 4, 1, HS_FLOAT64, 8, 8}, queries = {x, 3, 1, HS_FLOAT64, 8, 8};
    const hs_points none = {x, 0, 1, HS_FLOAT64, 8, 8};
    hs_search       search;
    hs_search_set_asking(&(hs_sets){.points = &points}, &search);
    CHECK(!search.has_queries && !search.is_full && !search.keeps_none);
    CHECK(search.n_in_all == 4 && search.pairs_per_half == 1.0);
    hs_search_set_asking(&(hs_sets){.points = &points, .is_full = true, .keeps_none = true},
                         &search);
    CHECK(search.is_full && search.keeps_none && search.pairs_per_half == 2.0);
    hs_search_set_asking(&(hs_sets){.points = &points, .queries = &queries, .is_full = true},
                         &search);
    CHECK(search.has_queries && search.n_in_all == 3 && search.pairs_per_half == 1.5);
    hs_search_set_asking(&(hs_sets){.points = &none, .queries = &queries, .is_full = true},
                         &search);
    CHECK(search.n_in_all == 3 && search.pairs_per_half == 0.0);
}

static void
points_that_are_part_of_more_keep_their_numbers(void)
{
    search_unit_points(71, 50, 2, 4.0, &unit);
    search_unit_open(NULL, 1.0, false, HS_WANT_J, &unit);
    int32_t sum = 0;
    hs_search_renumber(1000, 5000, &unit.search);
    CHECK(unit.search.first_point == 1000 && unit.search.n_in_all == 5000);
    for (int si = 0; si < 50; si++) {
        CHECK(unit.search.bins.order[si] >= 1000 && unit.search.bins.order[si] < 1050);
        sum += unit.search.bins.order[si] - 1000;
    }
    CHECK(sum == 50 * 49 / 2);
    search_unit_close(&unit);
}

/* Errors of wrapping, of images and of the formula of precision="double" add up. */
static void
the_filter_has_room_for_all_errors(void)
{
    hs_search search;
    hs_call   call;
    memset(&search, 0, sizeof search);
    hs_search_begin(&call, &search);
    search.scene.x_error = 1.0;
    search.grid.shift_error = 2.0;
    search.scene.formula_error = 4.0;
    hs_search_settle(&search);
    CHECK(search.filter_error == 7.0 && search.call == &call && !search.is_sparse);
}

/* Also twice, and of a search that never had anything. */
static void
closing_frees_once(void)
{
    search_unit_points(72, 50, 2, 4.0, &unit);
    search_unit_open(NULL, 1.0, false, HS_WANT_J, &unit);
    CHECK(unit.call.account.held > 0);
    hs_search_close(&unit.search);
    CHECK(unit.call.account.held == 0);
    hs_search_close(&unit.search);
    hs_search_begin(&unit.call, &unit.search);
    search_unit_close(&unit);
}

void
test_search(void)
{
    RUN(asking_points_tell_how_many_pairs_there_are);
    RUN(points_that_are_part_of_more_keep_their_numbers);
    RUN(the_filter_has_room_for_all_errors);
    RUN(closing_frees_once);
}
