/* SPDX-License-Identifier: BSD-3-Clause */
/* test_pair_batch.c: shifts are kept as short as they are known to be, and those that pass the
 * integers are told, whoever looks them up. */
#include "../../../csrc/core/collect/parallel.h"
#include "../../../csrc/core/verlet/pair_list_search.h"
#include "../support/among.h"
#include "../support/search_unit.h"

#include <math.h>

void test_pair_batch(void);

static search_unit unit;

static bool
is_narrow(void)
{
    hs_walker walker;
    hs_trace  trace;
    CHECK(hs_walker_init(&unit.search, HS_BLOCK_COUNTS, NULL, NULL, &walker) == HS_OK);
    CHECK(hs_trace_init(&unit.search, &walker.scanner.block, &walker.scanner.options, true,
                        &trace) == HS_OK);
    const bool narrow = trace.of.is_narrow;
    hs_trace_free(&unit.call.account, &trace);
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
        hs_pieces  pieces;
        hs_failure failure = HS_NO_FAILURE;
        search_unit_points(18, 40, 2, 1.0, &unit);
        search_unit_open(&box, 0.3, false, HS_WANT_I | HS_WANT_J, &unit);
        hs_search *search = &unit.search;
        for (int r = 0; r < 2 && beyond; r++)
            search->scene.lattice.U[r][r] = INT64_MAX;
        hs_output_init(&search->call->account, 2, HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT, 4, &pairs);
        CHECK(hs_parallel_record(search, &pairs, &failure) ==
              (beyond ? HS_ERR_SHIFT_RANGE : HS_OK));
        CHECK(beyond ? failure.row >= 0 && failure.row < 40 : pairs.n_pairs > 100);
        hs_output_free(&pairs);
        for (int32_t si = 0; si < 40; si++)
            search->bins.order[si] = si;
        failure.row = -1;
        CHECK(hs_pieces_find(search, &pieces, &failure) == (beyond ? HS_ERR_SHIFT_RANGE : HS_OK));
        CHECK(beyond ? failure.row >= 0 && failure.row < 40
                     : pieces.n == 1 && pieces.of[0].shifted.pairs.n_pairs > 10);
        if (!beyond)
            hs_pieces_free(&search->call->account, &pieces);
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
        CHECK(hs_parallel_record(search, &pairs, &failure) ==
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

/* Pairs of the visit's first point with its first hits, looked up. */
static void
look_up_some(hs_trace *trace, int32_t first, const hs_hits *hits)
{
    int64_t       failed;
    const int32_t n = hits->end[0] < 4 ? hits->end[0] : 4;
    hs_trace_clear(trace);
    CHECK(hs_trace_add(trace, first, hits->label, n) == n);
    CHECK(hs_trace_look_up(trace, true, &failed) == HS_OK);
}

/* Whether a look-up by itself and one of the loaded block agree; counts those by itself. */
static hs_status
compare_look_ups(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    static double  p[3][4], q[3][4];
    static int64_t shift[3][4];
    hs_trace      *trace = &scanner->trace;
    hs_records_reset(&trace->of);
    look_up_some(trace, first, hits);
    *(int *)context += !trace->of.has_metric && trace->n > 0;
    const int32_t n = trace->n;
    const bool    is_shifted = trace->is_shifted;
    for (int32_t e = 0; e < n; e++) {
        double         of_p[3], of_q[3];
        int64_t        image[3] = {0};
        const int64_t *any = hs_trace_pair(trace, e, of_p, of_q, image);
        for (int k = 0; k < 3; k++) {
            p[k][e] = of_p[k];
            q[k][e] = of_q[k];
            shift[k][e] = any != NULL ? any[k] : 0;
        }
    }
    CHECK(hs_records_load(&trace->of, true) == HS_OK);
    look_up_some(trace, first, hits);
    CHECK(trace->of.has_metric && trace->n == n && trace->is_shifted == is_shifted);
    for (int32_t e = 0; e < n; e++) {
        for (int k = 0; k < 3; k++) {
            CHECK(trace->p[k][e] == p[k][e] && trace->q[k][e] == q[k][e]);
            CHECK(!is_shifted || trace->image[k][e] == shift[k][e]);
            CHECK(!is_shifted || trace->times[k][e] == (double)shift[k][e]);
        }
    }
    return HS_OK;
}

/* Few pairs are looked up by themselves, to the same numbers as by the records of the block. */
static void
few_pairs_are_looked_up_as_many_are(void)
{
    hs_box box = {
        .ndim = 3, .periodic = {true, true, true}, .rows = {{4.0}, {0.0, 4.0}, {0.0, 0.0, 4.0}}};
    for (int periodic = 0; periodic < 2; periodic++) {
        int       few = 0;
        hs_walker walker;
        search_unit_points(1618, 900, 3, 4.0, &unit);
        search_unit_open(periodic ? &box : NULL, 1.0, false, HS_WANT_I, &unit);
        CHECK(hs_walker_init(&unit.search, HS_BLOCK_LISTS_SQUARES, compare_look_ups, &few,
                             &walker) == HS_OK);
        CHECK(hs_walk(&walker, 0, 900) == HS_OK);
        CHECK(few > 20);
        hs_walker_close(&unit.search, &walker);
        search_unit_close(&unit);
    }
}

void
test_pair_batch(void)
{
    RUN(few_pairs_are_looked_up_as_many_are);
    RUN(shifts_are_int32_where_they_are_known_to_be_few);
    RUN(shifts_beyond_the_integers_are_told);
    RUN(keys_beyond_the_integers_are_told);
    RUN(many_runs_can_be_stopped);
}
