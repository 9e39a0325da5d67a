/* SPDX-License-Identifier: BSD-3-Clause */
/* test_request.c: what a search of one scene is for, and that each ends its call whatever
 * happens. */
#include "../../../csrc/core/api/api_cells.h"
#include "../../../csrc/core/api/request.h"
#include "../support/among.h"
#include "../support/harness.h"

#include <math.h>

void test_request(void);

static const double    x[6] = {0.0, 0.0, 1.0, 0.0, 0.0, 2.0};
static const hs_points points = {x, 3, 2, HS_FLOAT64, 16, 8},
                       queries = {x, 1, 2, HS_FLOAT64, 16, 8};
static const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{9.0}, {0.0, 9.0}}};

static hs_options
options_for(double cutoff)
{
    hs_options options = hs_options_default();
    options.cutoff = cutoff;
    options.threads = 1;
    return options;
}

/* Lists are full with queries, and half lists have none. */
static void
requests_are_of_points_or_cells(void)
{
    const hs_options options = options_for(1.5);
    hs_cells        *cells = NULL;
    hs_request       request = hs_request_among(AMONG(&points, &box), HS_HALF_LIST, &options);
    CHECK(request.sets.points == &points && request.box == &box && request.options == &options);
    CHECK(!request.sets.is_full && request.sets.queries == NULL && request.sets.built == NULL);
    request = hs_request_among(AMONG(&points, &box), HS_FULL_LIST, &options);
    CHECK(request.sets.is_full);
    request = hs_request_among(AMONG(&points, NULL), HS_HALF_OR_QUERIES, &options);
    CHECK(!request.sets.is_full && request.box == NULL);
    request = hs_request_among(QUERIED(&points, &queries, &box), HS_HALF_OR_QUERIES, &options);
    CHECK(request.sets.is_full && request.sets.queries == &queries);
    request = hs_request_among(QUERIED(&points, &queries, &box), HS_HALF_LIST, &options);
    CHECK(request.sets.points == NULL && request.options == &options);
    CHECK(hs_request_among(NULL, HS_FULL_LIST, &options).sets.points == NULL);
    CHECK(hs_cells_build(&points, &box, &options, &cells, NULL) == HS_OK);
    request = hs_request_among(IN_CELLS(cells), HS_HALF_LIST, &options);
    CHECK(request.sets.points == &cells->points && request.sets.built == &cells->search);
    CHECK(request.sets.trees == cells->trees && request.box == hs_cells_box(cells));
    const hs_among both = {.cells = cells, .points = &points},
                   boxed = {.cells = cells, .box = &box};
    CHECK(hs_request_among(&both, HS_HALF_LIST, &options).sets.points == NULL);
    CHECK(hs_request_among(&boxed, HS_HALF_LIST, &options).sets.points == NULL);
    hs_cells_free(cells);
}

static void
counts_want_no_columns(void)
{
    const hs_pair_arrays out = {.capacity = 1};
    hs_options           options = options_for(1.5);
    options.want = HS_WANT_ALL;
    options.sorted = true;
    options.out = &out;
    const hs_options counting = hs_options_of_count(&options);
    CHECK(counting.want == 0 && !counting.sorted && counting.out == NULL);
    CHECK(counting.cutoff == 1.5 && counting.threads == 1);
}

/* A hs_use_fn; the context is the status that it ends with. */
static hs_status
find_seven(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    CHECK(search->bins.n == 3 && *n_pairs == 0 && failure->row == -1);
    *n_pairs = 7;
    return *(hs_status *)context;
}

/* Pairs are counted, and shortages told: of pairs only where any are kept. */
static void
uses_end_their_call(void)
{
    const hs_status ends[] = {HS_OK, HS_ERR_MEMORY, HS_ERR_INTERRUPTED};
    const int64_t   blocks = hs_test_live_blocks();
    for (int c = 0; c < 6; c++) {
        hs_options  options = options_for(1.5);
        hs_counters counters = {.pairs = -1};
        hs_failure  failure = {.row = 5};
        hs_status   status = ends[c % 3];
        options.counters = &counters;
        options.memory_limit = 1e6;
        hs_request request = hs_request_among(AMONG(&points, &box), HS_HALF_LIST, &options);
        request.sets.keeps_none = c >= 3;
        CHECK(hs_request_use(&request, find_seven, &status, &failure) == ends[c % 3]);
        CHECK(counters.pairs == 7 && counters.bytes[HS_FOR_POINTS] > 0);
        CHECK(failure.row == -1);
        CHECK(failure.limit_bytes == (c % 3 == 1 ? 1e6 : 0.0));
        CHECK((failure.expected_pairs > 0.0) == (c == 1));
        CHECK(hs_request_use(&request, find_seven, &status, NULL) == HS_OK || ends[c % 3] != HS_OK);
    }
    CHECK(hs_test_live_blocks() == blocks);
}

/* What does not open is not used. */
static void
bad_arguments_are_not_used(void)
{
    const hs_options options = options_for(1.5), bad = options_for(NAN);
    hs_status        status = HS_OK;
    hs_failure       failure;
    hs_request       request = hs_request_among(NULL, HS_HALF_LIST, &options);
    CHECK(hs_request_use(&request, find_seven, &status, &failure) == HS_ERR_ARGUMENT);
    request = hs_request_among(AMONG(&points, &box), HS_HALF_LIST, &bad);
    CHECK(hs_request_use(&request, find_seven, &status, &failure) == HS_ERR_CUTOFF);
    CHECK(isnan(failure.value));
}

/* A hs_fill_fn. */
static hs_status
fill_two(hs_search *search, hs_pairs *pairs, hs_failure *failure)
{
    CHECK(search->bins.n == 3 && failure->row == -1);
    const hs_status status = hs_output_reserve(&pairs->output, 2, 0.0);
    pairs->output.n_pairs = 2;
    return status;
}

/* A hs_fill_fn. */
static hs_status
fill_nothing(hs_search *search, hs_pairs *pairs, hs_failure *failure)
{
    (void)search;
    (void)pairs;
    (void)failure;
    return HS_ERR_MEMORY;
}

static void
fills_give_a_result_or_free_it(void)
{
    const int64_t blocks = hs_test_live_blocks();
    hs_options    options = options_for(1.5);
    hs_counters   counters;
    hs_failure    failure;
    hs_pairs     *pairs = NULL;
    options.counters = &counters;
    options.memory_limit = 1e6;
    const hs_request request = hs_request_among(AMONG(&points, &box), HS_HALF_LIST, &options);
    CHECK(hs_request_fill(&request, fill_two, &pairs, &failure) == HS_OK);
    CHECK(hs_pairs_length(pairs) == 2 && counters.pairs == 2);
    hs_pairs_free(pairs);
    pairs = NULL;
    CHECK(hs_request_fill(&request, fill_nothing, &pairs, &failure) == HS_ERR_MEMORY);
    CHECK(pairs == NULL && failure.limit_bytes == 1e6 && failure.expected_pairs > 0.0);
    hs_test_fail_allocation(1);
    CHECK(hs_request_fill(&request, fill_two, &pairs, &failure) == HS_ERR_MEMORY && pairs == NULL);
    hs_test_fail_allocation(0);
    hs_pool_clear();
    CHECK(hs_test_live_blocks() == blocks);
}

void
test_request(void)
{
    RUN(requests_are_of_points_or_cells);
    RUN(counts_want_no_columns);
    RUN(uses_end_their_call);
    RUN(bad_arguments_are_not_used);
    RUN(fills_give_a_result_or_free_it);
}
