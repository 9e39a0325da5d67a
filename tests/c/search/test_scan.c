/* SPDX-License-Identifier: BSD-3-Clause */
/* test_scan.c: neighbourhoods of a group, what is scanned of them, and what is decided of the
 * hits. */
#include "../../../csrc/core/collect/parallel.h"
#include "../../../csrc/core/search/scan.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"
#include "../support/search_unit.h"

void test_scan(void);

static search_unit unit;

/*
 * ---- decide ----
 *
 * What the filter lets through is decided, however little the filter can tell: with any error
 * beyond its own the same pairs are found and counted, at any size of the numbers.
 */

static bool
count_polls(void *context, double fraction)
{
    CHECK(fraction >= 0.0 && fraction <= 1.0);
    ++*(int *)context;
    return true;
}

/* One cell with everything: each pair is tested once, and there is a poll for each two millions. */
static void
every_pair_is_tested_once(void)
{
    enum { GROUPS = 31, MANY = 64 * GROUPS, CANDIDATES = MANY * (GROUPS + 1) / 2 };
    static double  x[MANY];
    hs_walker      walker;
    int            polls = 0;
    const hs_sets  sets = {.points = &unit.points};
    hs_options     options = hs_options_default();
    hs_failure     failure;
    harness_random random = {9};
    for (int i = 0; i < MANY; i++)
        x[i] = random_unit(&random);
    unit.points = (hs_points){x, MANY, 1, HS_FLOAT64, 8, 8};
    options.cutoff = 2.0;
    options.threads = 1;
    hs_call_begin(&options, &unit.call);
    CHECK(hs_search_open(&sets, NULL, &unit.call, &unit.search, &failure) == HS_OK);
    CHECK(unit.search.grid.n_cells == 1);
    for (int times = 1; times <= 4; times *= 2) {
        polls = 0;
        CHECK(hs_walker_init(&unit.search, HS_BLOCK_COUNTS, NULL, NULL, NULL, &walker) == HS_OK);
        walker.scanner.options.poll = count_polls;
        walker.scanner.options.poll_context = &polls;
        for (int t = 0; t < times; t++)
            CHECK(hs_walk(&walker, 0, MANY, &(hs_failure){.row = -1}) == HS_OK);
        CHECK(walker.scanner.n_found == (int64_t)times * MANY * (MANY - 1) / 2);
        CHECK(walker.scanner.n_candidates == walker.scanner.n_found);
        CHECK(walker.scanner.n_ambiguous == 0);
        /* Gathering counts as well, and each block. */
        CHECK(polls == times * (65 * CANDIDATES + 64 * GROUPS) / (1 << 21));
        hs_walker_close(&unit.search, &walker);
    }
    search_unit_close(&unit);
}

/*
 * ---- pair batch ----
 *
 * Shifts are kept as short as they are known to be, and those that pass the integers are told,
 * whoever looks them up.
 */

static bool
is_narrow(void)
{
    hs_walker walker;
    CHECK(hs_walker_init(&unit.search, HS_BLOCK_LISTS_PLACES, NULL, NULL, NULL, &walker) == HS_OK);
    const bool narrow = walker.scanner.pair_batch.is_narrow;
    hs_walker_close(&unit.search, &walker);
    return narrow;
}

/* Sums of an image and two turns are int32 where none of them passes 2^28. */
static void
shifts_are_int32_where_they_are_known_to_be_few(void)
{
    hs_box box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    search_unit_points(17, 20, 2, 1.0, &unit);
    search_unit_open(&box, 0.5, false, HS_WANT_SHIFT, &unit);
    hs_search    *search = &unit.search;
    const hs_grid grid = search->grid;
    CHECK(is_narrow());
    search->grid.reach[0] = (INT64_C(1) << 28) * grid.shape[0];
    CHECK(!is_narrow());
    search->grid.reach[0] -= 1;
    CHECK(is_narrow());
    search->grid = grid;
    search->grid.reach[1] = (INT64_C(1) << 28) * grid.shape[1]; /* no image is there */
    CHECK(is_narrow());
    search->grid = grid;
    search->scene.cloud.largest = 0x1p27; /* 2 of it, and some */
    CHECK(!is_narrow());
    search->scene.cloud.largest = 0x1p27 - 3.0;
    CHECK(is_narrow());
    search->scene.lattice.U[0][0] = 2;
    CHECK(!is_narrow());
    search->scene.lattice.U[0][0] = -1;
    CHECK(!is_narrow());
    search_unit_close(&unit);
    box.rows[1][0] = 0.25; /* open: of no meaning */
    search_unit_open(&box, 0.5, false, HS_WANT_SHIFT, &unit);
    CHECK(is_narrow());
    search_unit_close(&unit);
    box.rows[0][1] = 0.25; /* then the points as given are kept */
    search_unit_open(&box, 0.5, false, HS_WANT_SHIFT, &unit);
    CHECK(is_narrow());
    search_unit_close(&unit);
}

/* A basis in which every image passes 2^62: neither the keys that pairs are sorted by nor the
 * shifts of a list hold it. */
static void
shifts_beyond_the_integers_are_told(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.5, 1.0}}};
    for (int beyond = 0; beyond < 2; beyond++) {
        hs_output  pairs;
        hs_failure failure = HS_NO_FAILURE;
        search_unit_points(18, 40, 2, 1.0, &unit);
        search_unit_open(&box, 0.3, false, HS_WANT_I | HS_WANT_J, &unit);
        hs_search *search = &unit.search;
        for (int r = 0; r < 2 && beyond; r++)
            search->scene.lattice.U[r][r] = INT64_MAX;
        hs_output_init(&search->call->account, 2, HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT, 4, &pairs);
        CHECK(hs_parallel_record(search, NULL, &pairs, &failure) ==
              (beyond ? HS_ERR_SHIFT_RANGE : HS_OK));
        CHECK(beyond ? failure.row >= 0 && failure.row < 40 : pairs.n_pairs > 100);
        hs_output_free(&pairs);
        search_unit_close(&unit);
    }
}

/* Two points as given that are neighbours with no shift, while the nearest image of what is wrapped
 * is another: only the key that sorts it is beyond the integers. */
static void
keys_beyond_the_integers_are_told(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.25, 1.0}}};
    for (int beyond = 0; beyond < 2; beyond++) {
        hs_output  pairs;
        hs_failure failure = HS_NO_FAILURE;
        unit.x[0] = 0.45;
        unit.x[2] = 0.55;
        unit.x[1] = unit.x[3] = 0.0;
        unit.points = (hs_points){unit.x, 2, 2, HS_FLOAT64, 16, 8};
        search_unit_open(&box, 0.2, false, HS_WANT_I | HS_WANT_J, &unit);
        hs_search *search = &unit.search;
        for (int r = 0; r < 2 && beyond; r++)
            search->scene.lattice.U[r][r] = INT64_MAX;
        hs_output_init(&unit.call.account, 2, HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT, 4, &pairs);
        CHECK(hs_parallel_record(search, NULL, &pairs, &failure) ==
              (beyond ? HS_ERR_SHIFT_RANGE : HS_OK));
        CHECK(beyond ? failure.row == 0 || failure.row == 1 : pairs.n_pairs == 1);
        hs_output_free(&pairs);
        search_unit_close(&unit);
    }
}

static bool
refuse_at(void *context, double fraction)
{
    (void)fraction;
    return --*(int64_t *)context != 0;
}

/* A hundred thousand images of one point, in the block that its ordered neighbours come from: any
 * poll may end it. */
static void
many_runs_can_be_stopped(void)
{
    const hs_box box = {
        .ndim = 3, .periodic = {true, true, true}, .rows = {{1.0}, {0.0, 1.0}, {0.0, 0.0, 1.0}}};
    const double    x[3] = {0.5, 0.5, 0.5};
    const hs_points points = {x, 1, 3, HS_FLOAT64, 24, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *rows = NULL;
    hs_status       status = HS_ERR_INTERRUPTED;
    int64_t         nth = 0;
    options.cutoff = 30.0;
    options.want = HS_WANT_J;
    options.threads = 1;
    options.poll = refuse_at;
    while (status == HS_ERR_INTERRUPTED && nth < 40) {
        int64_t left = ++nth;
        options.poll_context = &left;
        status = hs_neighbors_find(AMONG(&points, &box), &options, &rows, NULL);
        CHECK((status == HS_OK) == (rows != NULL));
    }
    CHECK(status == HS_OK && nth > 3 && hs_pairs_length(rows) == 113080);
    hs_pairs_free(rows);
}

void
test_scan(void)
{
    RUN(every_pair_is_tested_once);
    RUN(shifts_are_int32_where_they_are_known_to_be_few);
    RUN(shifts_beyond_the_integers_are_told);
    RUN(keys_beyond_the_integers_are_told);
    RUN(many_runs_can_be_stopped);
}
