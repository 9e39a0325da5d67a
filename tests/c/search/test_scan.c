/* SPDX-License-Identifier: BSD-3-Clause */
/* test_scan.c: neighbourhoods of a group, what is scanned of them, and what is decided of the
 * hits. */
#include "../../../csrc/core/collect/parallel.h"
#include "../../../csrc/core/search/scan.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"
#include "../support/search_unit.h"

#include <math.h>

void test_scan(void);

/* ---- a block has room for what its header promises ---- */

enum { N = 300, D = 3 };

static double  group_x[D][N + HS_PADDING];
static int32_t order[N + HS_PADDING];

static hs_bins
some_bins(uint64_t seed, int ndim)
{
    harness_random random = {seed};
    hs_bins        bins = {.n = N, .ndim = ndim, .order = order};
    for (int i = 0; i < N + HS_PADDING; i++) {
        order[i] = 7 * i;
        for (int k = 0; k < ndim; k++)
            group_x[k][i] = i < N ? 8.0 * random_unit(&random) - 3.0 : NAN;
    }
    for (int k = 0; k < ndim; k++)
        bins.x[k] = group_x[k];
    return bins;
}

static void
hits_are_twice_the_candidates_where_int32_holds_that(void)
{
    const int32_t half = INT32_MAX / 2;
    CHECK(hs_block_most_hits(1) == 1 + HS_BURST);
    CHECK(hs_block_most_hits(HS_BURST) == 2 * HS_BURST &&
          hs_block_most_hits(half - 1) == 2 * (half - 1));
    CHECK(hs_block_most_hits(half) == half && hs_block_most_hits(INT32_MAX) == INT32_MAX);
}

/* The middle point is the centre; the largest number is that of any axis and sign. */
static void
groups_know_their_extent(void)
{
    static hs_group group;
    for (int trial = 0; trial < 60; trial++) {
        const int     ndim = 1 + trial % D;
        const int32_t first = trial, last = first + 1 + trial * 7 % HS_GROUP_POINTS;
        hs_bins       bins = some_bins(40 + (uint64_t)trial, ndim);
        float         largest = 0.0f;
        group.near.out = 1.0f;
        hs_group_start(&bins, first, last, &group);
        CHECK(group.first == first && group.last == last && group.largest == 0);
        CHECK(group.near.out == INFINITY);
        CHECK(hs_group_bound(&bins, &group) >= 0.0f);
        for (int k = 0; k < ndim; k++) {
            float low = INFINITY, high = -INFINITY;
            CHECK(group.centre[k] == group_x[k][(first + last) / 2]);
            for (int32_t t = 0; t < last - first; t++) {
                const float q = (float)(group_x[k][first + t] - group.centre[k]);
                CHECK(group.q[k][t] == q);
                low = fminf(low, q);
                high = fmaxf(high, q);
            }
            CHECK(group.near.low[k] == low && group.near.high[k] == high);
            largest = fmaxf(largest, fmaxf(-low, high));
        }
        CHECK(hs_group_bound(&bins, &group) == largest);
        CHECK(group.largest == hs_bits_of_float(largest + 0.0f)); /* 0 has no sign then */
    }
}

/* ---- thresholds that were kept are those of the extent that asks ---- */

static search_unit unit;

static void
open_walker(double side, double cutoff, hs_walker *walker)
{
    search_unit_points(271828, 1500, 3, side, &unit);
    search_unit_open(NULL, cutoff, false, HS_WANT_I, &unit);
    CHECK(hs_walker_init(&unit.search, HS_BLOCK_COUNTS, NULL, NULL, walker) == HS_OK);
}

static void
close_walker(hs_walker *walker)
{
    hs_walker_close(&unit.search, walker);
    search_unit_close(&unit);
}

/* What a walker has found out serves the next search, of the same cutoff and errors only. */
static void
thresholds_are_kept_for_the_next_search(void)
{
    hs_walker walker;
    open_walker(8.0, 1.0, &walker);
    hs_scene *scene = &unit.search.scene;
    walker.scanner.group.largest = hs_bits_of_float(1.5f);
    hs_form_set(&walker.scanner);
    hs_form *form = &walker.scanner.forms[walker.scanner.form - walker.scanner.forms];
    for (int turn = 0; turn < 5; turn++) {
        form->direct.in = 0.5f; /* it is left like that */
        scene->cutoff = turn == 1 ? 1.25 : scene->cutoff;
        unit.search.filter_error += turn == 2 ? 1e-9 : 0.0;
        scene->extreme = turn >= 3;
        scene->cutoff_low = turn == 4 ? 1.0 : scene->cutoff; /* the same cutoff, known less well */
        hs_form_set(&walker.scanner);
        const double        cutoff = scene->cutoff, error = unit.search.filter_error;
        const hs_thresholds direct = hs_thresholds_of(3, cutoff, form->extent, error);
        const hs_thresholds low = hs_thresholds_of(3, scene->cutoff_low, form->extent, error);
        CHECK(walker.scanner.form == form && form->direct.out == direct.out);
        CHECK(form->direct.in == (turn == 0 ? 0.5f : low.in));
        CHECK(hs_expanded_pays(cutoff, form->extent));
        CHECK(form->expanded.out == hs_expanded_of(3, cutoff, form->extent, error).out);
        CHECK(form->expanded.in == hs_expanded_of(3, scene->cutoff_low, form->extent, error).in);
    }
    scene->extreme = false;
    close_walker(&walker);
}

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
        CHECK(hs_walker_init(&unit.search, HS_BLOCK_COUNTS, NULL, NULL, &walker) == HS_OK);
        walker.scanner.options.poll = count_polls;
        walker.scanner.options.poll_context = &polls;
        for (int t = 0; t < times; t++)
            CHECK(hs_walk(&walker, 0, MANY) == HS_OK);
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
    hs_walker     walker;
    hs_pair_batch pair_batch;
    CHECK(hs_walker_init(&unit.search, HS_BLOCK_COUNTS, NULL, NULL, &walker) == HS_OK);
    CHECK(hs_pair_batch_init(&unit.search, &walker.scanner.block, &walker.scanner.options, true,
                             &pair_batch) == HS_OK);
    const bool narrow = pair_batch.of.is_narrow;
    hs_pair_batch_free(&unit.call.account, &pair_batch);
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
    RUN(hits_are_twice_the_candidates_where_int32_holds_that);
    RUN(groups_know_their_extent);
    RUN(thresholds_are_kept_for_the_next_search);
    RUN(every_pair_is_tested_once);
    RUN(shifts_are_int32_where_they_are_known_to_be_few);
    RUN(shifts_beyond_the_integers_are_told);
    RUN(keys_beyond_the_integers_are_told);
    RUN(many_runs_can_be_stopped);
}
