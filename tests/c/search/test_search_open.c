/* SPDX-License-Identifier: BSD-3-Clause */
/* test_search_open.c: a search borrows cells that serve, and has its own where these do not; a
 * refusal names the limit. */
#include "../support/search_unit.h"

#include <math.h>

void test_search_open(void);

static search_unit unit, kept;

static hs_status
open_among(const hs_points *points, const hs_points *queries, double cutoff, double limit,
           hs_failure *failure)
{
    const hs_sets sets = {
        .points = points, .queries = queries, .is_full = true, .built = &kept.search};
    hs_options options = hs_options_default();
    options.cutoff = cutoff;
    options.want = HS_WANT_J;
    options.threads = 1;
    options.memory_limit = limit;
    *failure = HS_NO_FAILURE;
    hs_call_begin(&options, &unit.call);
    return hs_search_open(&sets, NULL, &unit.call, &unit.search, failure);
}

/* Cells that are kept for queries to come. */
static void
keep_cells(void)
{
    const hs_sets sets = {.points = &kept.points, .is_kept = true};
    hs_options    options = hs_options_default();
    hs_failure    failure;
    options.cutoff = 0.5;
    options.want = HS_WANT_SHIFT;
    search_unit_points(91, 500, 2, 4.0, &kept);
    hs_call_begin(&options, &kept.call);
    CHECK(hs_search_open(&sets, NULL, &kept.call, &kept.search, &failure) == HS_OK);
}

static void
cells_are_borrowed_where_they_serve(void)
{
    const double    q[4] = {1.0, 1.0, 2.0, 2.5}, far[2] = {1e300, 0.0};
    const hs_points queries = {q, 2, 2, HS_FLOAT64, 16, 8}, beyond = {far, 1, 2, HS_FLOAT64, 16, 8};
    hs_failure      failure;
    keep_cells();
    CHECK(open_among(&kept.points, NULL, 0.5, INFINITY, &failure) == HS_OK);
    CHECK(unit.search.is_borrowed && unit.search.bins.order == kept.search.bins.order);
    search_unit_close(&unit);
    CHECK(open_among(&kept.points, &queries, 0.5, INFINITY, &failure) == HS_OK);
    CHECK(unit.search.is_borrowed && unit.search.query_bins.n == 2);
    search_unit_close(&unit);
    CHECK(open_among(&kept.points, &beyond, 0.5, INFINITY, &failure) == HS_OK);
    CHECK(!unit.search.is_borrowed && unit.search.bins.n == 500 && unit.search.query_bins.n == 1);
    search_unit_close(&unit);
    search_unit_close(&kept);
}

/* In both ways. What was opened is closed by then. */
static void
refusals_name_the_limit(void)
{
    static double   many[2 * 5000];
    const hs_points queries = {many, 5000, 2, HS_FLOAT64, 16, 8};
    hs_failure      failure;
    keep_cells();
    CHECK(open_among(&kept.points, &queries, 0.5, 1000.0, &failure) == HS_ERR_MEMORY);
    CHECK(failure.limit_bytes == 1000.0 && unit.call.account.held == 0);
    hs_call_dismiss(&unit.call);
    many[0] = 1e300;
    CHECK(open_among(&kept.points, &queries, 0.5, 2000.0, &failure) == HS_ERR_MEMORY);
    CHECK(failure.limit_bytes == 2000.0 && unit.call.account.held == 0);
    hs_call_dismiss(&unit.call);
    search_unit_close(&kept);
}

void
test_search_open(void)
{
    RUN(cells_are_borrowed_where_they_serve);
    RUN(refusals_name_the_limit);
}
