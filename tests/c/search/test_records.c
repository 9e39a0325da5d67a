/* SPDX-License-Identifier: BSD-3-Clause */
/* test_records.c: the record of a candidate is what was given of its point, in the image of its
 * run; records are written once for each block, and only those that are wanted. */
#include "../../../csrc/core/base/poll.h"
#include "../../../csrc/core/search/records.h"
#include "../support/poll_checks.h"
#include "../support/search_unit.h"

void test_records(void);

enum { N = 60, RUNS = 6, GARBAGE = 0x3b };

static search_unit unit;

/* Runs of `of_run` consecutive points, or of every other one; one of them is empty, and all are in
 * images of their own unless they are at home. */
static void
fill_block(int32_t of_run, bool is_home, hs_block *block)
{
    const int m = unit.search.bins.n_periodic;
    block->n = block->n_runs = 0;
    for (int32_t r = 0; r < RUNS; r++) {
        hs_run       *run = &block->runs[block->n_runs++];
        const int32_t step = r % 2 ? 2 : 1, first = r;
        *run = (hs_run){.at = block->n, .si = first};
        for (int k = 0; k < m && !is_home; k++)
            run->image[k] = k == r % 3 ? 3 - r : r == RUNS - 1;
        for (int32_t c = 0; c < of_run && r != 2; c++)
            block->number[block->n++] = (first + c * step) % N;
    }
    block->runs[block->n_runs].at = block->n;
}

/* Entries of the block that are not as they should be. */
static int64_t
wrong_records(const hs_records *records, bool metric, bool given)
{
    const hs_bins  *bins = &unit.search.bins;
    const hs_block *block = records->block;
    const int       d = bins->ndim, m = bins->n_periodic, width = records->width;
    int64_t         wrong = 0;
    for (int32_t r = 0; r < block->n_runs; r++) {
        for (int32_t c = block->runs[r].at; c < block->runs[r + 1].at; c++) {
            const int32_t si = block->number[c];
            const double *q = records->q + (int64_t)c * width;
            int64_t       id;
            memcpy(&id, q + HS_RECORD - 1, sizeof id);
            for (int k = 0; k < d && metric; k++)
                wrong += q[k] != (bins->keeps_originals ? bins->originals : bins->x)[k][si];
            wrong += metric && d < HS_RECORD && id != bins->order[si];
            for (int k = 0; k < m; k++) {
                const int32_t image = block->runs[r].image[k];
                const int64_t at = (int64_t)c * width + k;
                const int64_t turns = bins->turns.known ? hs_turns_get(&bins->turns, k, si) : 0;
                wrong += records->has_images && records->image[at] != image;
                wrong += given && records->few != NULL && records->few[at] != image - turns;
                wrong += given && records->turned != NULL && records->turned[at] != image - turns;
            }
        }
    }
    return wrong;
}

static void
spoil(hs_records *records)
{
    const size_t n = (size_t)records->block->n * (size_t)records->width;
    memset(records->q, GARBAGE, n * sizeof *records->q);
    if (records->few != NULL)
        memset(records->few, GARBAGE, n * sizeof *records->few);
    if (records->turned != NULL)
        memset(records->turned, GARBAGE, n * sizeof *records->turned);
}

static bool
is_spoilt(const void *array, size_t n)
{
    const unsigned char *bytes = array;
    return array == NULL || (bytes[0] == GARBAGE && memcmp(bytes, bytes + 1, n - 1) == 0);
}

/* Points of d dimensions: open, wrapped, or tilted so that they are kept as given; in the box or
 * turns away. `wide`: shifts that may pass int32. */
static void
open_points(int d, int kind, bool is_away, bool is_wide)
{
    hs_box box = {.ndim = d};
    for (int l = 0; l < d; l++) {
        box.periodic[l] = l != 1;
        box.rows[l][l] = 2.0;
        box.rows[l][0] += kind == 2 && l > 0 ? 0.5 : 0.0;
    }
    search_unit_points(70 + (uint64_t)d, N, d, is_away ? 9.0 : 0.9, &unit);
    search_unit_open(kind == 0 ? NULL : &box, 0.25, false, HS_WANT_SHIFT, &unit);
    if (is_wide)
        unit.search.grid.reach[0] = (INT64_C(1) << 28) * unit.search.grid.shape[0];
}

static void
check_records(bool needs_given, bool is_wide)
{
    const hs_options options = hs_options_default();
    hs_search       *search = &unit.search;
    const int64_t    held = unit.call.account.held;
    const bool       has_rows = search->bins.n_periodic > 0;
    const bool       given = needs_given || search->bins.keeps_originals;
    hs_block         block;
    hs_records       records;
    CHECK(hs_block_init(&unit.call.account, 1, HS_BLOCK_COUNTS, RUNS * N / 2, RUNS, &block) ==
          HS_OK);
    CHECK(hs_records_init(search, &block, &options, needs_given, &records) == HS_OK);
    CHECK(records.is_narrow == !(is_wide && has_rows) && records.needs_given == given);
    CHECK(records.width == (search->scene.ndim <= 4 ? 4 : 8));
    CHECK((records.image != NULL) == has_rows);
    CHECK((records.few != NULL) == (has_rows && given && records.is_narrow));
    CHECK((records.turned != NULL) == (has_rows && given && !records.is_narrow));
    const bool loads = given && has_rows && (search->bins.turns.known || !records.is_narrow);
    for (int home = 0; home < 2; home++) {
        fill_block(N / 2 - 3 - home, home, &block);
        const size_t n = (size_t)block.n * (size_t)records.width;
        spoil(&records);
        hs_records_reset(&records);
        CHECK(hs_records_load(&records, false) == HS_OK && !records.has_metric);
        CHECK(is_spoilt(records.q, n * sizeof *records.q));
        CHECK(!given || records.has_images == (has_rows && !home));
        CHECK(!given || wrong_records(&records, false, loads) == 0);
        CHECK(hs_records_load(&records, true) == HS_OK && records.has_metric);
        CHECK(records.has_images == (has_rows && !home));
        CHECK(wrong_records(&records, true, loads) == 0);
        spoil(&records);
        CHECK(hs_records_load(&records, true) == HS_OK); /* it is done */
        CHECK(is_spoilt(records.q, n * sizeof *records.q));
        CHECK(is_spoilt(records.few, n * sizeof *records.few));
        CHECK(is_spoilt(records.turned, n * sizeof *records.turned));
        hs_records_reset(&records);
        CHECK(hs_records_load(&records, true) == HS_OK);
        CHECK(wrong_records(&records, true, loads) == 0);
    }
    hs_records_free(&unit.call.account, &records);
    hs_records_free(&unit.call.account, &records);
    hs_block_free(&unit.call.account, &block);
    CHECK(unit.call.account.held == held);
}

static void
records_are_what_was_given(void)
{
    for (int trial = 0; trial < 6 * 3 * 2 * 2 * 2; trial++) {
        const int  d = 1 + trial % 6, kind = trial / 6 % 3;
        const bool is_away = trial / 18 % 2, is_wide = trial / 36 % 2, scalar = trial / 72;
        open_points(d, kind, is_away, is_wide);
        if (scalar)
            unit.call.kernel = &hs_kernel_scalar;
        check_records(false, is_wide);
        check_records(true, is_wide);
        search_unit_close(&unit);
    }
}

/* The caller is asked whenever so many more have been looked up; and what is not done is not taken
 * for done. */
static void
large_blocks_are_polled_for(void)
{
    enum { OF_RUN = HS_POLL_CANDIDATES / 4 };
    for (int stop = 0; stop < 2; stop++) {
        refusal    once = {.nth = stop};
        hs_options options = hs_options_default();
        hs_block   block;
        hs_records records;
        options.poll = refuse_once;
        options.poll_context = &once;
        open_points(2, 1, true, false);
        CHECK(hs_block_init(NULL, 1, HS_BLOCK_COUNTS, RUNS * OF_RUN, RUNS, &block) == HS_OK);
        CHECK(hs_records_init(&unit.search, &block, &options, true, &records) == HS_OK);
        fill_block(OF_RUN, false, &block); /* five runs: one more than need no poll */
        CHECK(hs_records_load(&records, true) == (stop ? HS_ERR_INTERRUPTED : HS_OK));
        CHECK(once.n == 1 && records.has_metric == !stop && records.has_given == !stop);
        once = (refusal){.nth = 0};
        hs_records_reset(&records);
        fill_block(OF_RUN - 1, false, &block);
        block.n = block.runs[--block.n_runs].at; /* four runs */
        CHECK(hs_records_load(&records, true) == HS_OK && once.n == 0);
        CHECK(records.has_metric && wrong_records(&records, true, true) == 0);
        hs_records_free(&unit.call.account, &records);
        hs_block_free(NULL, &block);
        search_unit_close(&unit);
    }
}

static void
refused_records_hold_nothing(void)
{
    const hs_options options = hs_options_default();
    for (int wide = 0; wide < 2; wide++) {
        hs_block   block;
        hs_records records;
        open_points(3, 1, true, wide);
        CHECK(hs_block_init(NULL, 1, HS_BLOCK_COUNTS, 10, 1, &block) == HS_OK);
        const int64_t held = unit.call.account.held;
        for (int nth = 1; nth <= 4; nth++) {
            hs_test_fail_allocation(nth);
            CHECK(hs_records_init(&unit.search, &block, &options, true, &records) ==
                  (nth <= 1 ? HS_ERR_MEMORY : HS_OK));
            hs_test_fail_allocation(0);
            CHECK((unit.call.account.held == held) == (nth <= 1));
            hs_records_free(&unit.call.account, &records);
        }
        hs_block_free(NULL, &block);
        search_unit_close(&unit);
    }
}

void
test_records(void)
{
    RUN(records_are_what_was_given);
    RUN(large_blocks_are_polled_for);
    RUN(refused_records_hold_nothing);
}
