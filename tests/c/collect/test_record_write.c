/* SPDX-License-Identifier: BSD-3-Clause */
/* test_record_write.c: what is written at once is what is recorded in batches; what cannot be is
 * left alone. */
#include "../../../csrc/core/base/poll.h"
#include "../../../csrc/core/collect/record_write.h"
#include "../support/poll_checks.h"
#include "../support/record_unit.h"

void test_record_write(void);

enum { N = 200, ALL = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT };

static search_unit unit;
static record_unit at_once, in_batches;

static int n_visits, n_written;

/* What is not ordinary while it is asked whether hits can be written. */
enum { ORDINARY, EXTREME, NO_FLOATS, WIDE };
static int oddity;

static hs_status
write_oddly(hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits,
            bool *written)
{
    hs_scene      *scene = &unit.search.scene;
    const hs_scene kept = *scene;
    const bool     is_narrow = scanner->trace.of.is_narrow;
    scene->extreme = kept.extreme || oddity == EXTREME;
    scene->metric.floats_usable = kept.metric.floats_usable && oddity != NO_FLOATS;
    scanner->trace.of.is_narrow = is_narrow && oddity != WIDE;
    const hs_status status = hs_write_hits(recorder, scanner, first, hits, written);
    *scene = kept;
    scanner->trace.of.is_narrow = is_narrow;
    return status;
}

/* Writes if that is possible, and notes whether it was; else records. */
static hs_status
write_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_recorder  *recorder = context;
    const int32_t n = hits->end[hits->n - 1];
    bool          written = true;
    CHECK(hs_output_reserve(recorder->output, n, 0.0) == HS_OK);
    CHECK(write_oddly(recorder, scanner, first, hits, &written) == HS_OK);
    n_visits++;
    n_written += written;
    if (written) {
        recorder->output->n_pairs += n;
        return HS_OK;
    }
    return hs_record_hits(context, scanner, first, hits);
}

/* How many visits of how many were written. */
static void
write_all(unsigned columns, int index_bytes)
{
    hs_walker walker;
    n_visits = n_written = 0;
    hs_output_init(&unit.call.account, unit.points.ndim, columns, index_bytes, &at_once.output);
    CHECK(hs_walker_init(&unit.search, HS_BLOCK_LISTS_PLACES, write_hits, &at_once.recorder,
                         &walker) == HS_OK);
    CHECK(hs_recorder_init(&unit.call.account, &at_once.output, walker.scanner.block.most_hits,
                           &at_once.recorder) == HS_OK);
    CHECK(hs_walk(&walker, 0, (int32_t)unit.search.bins.n) == HS_OK);
    hs_walker_close(&unit.search, &walker);
}

/* Columns of both, bit by bit. */
static bool
same_columns(unsigned columns)
{
    const hs_output *a = &at_once.output, *b = &in_batches.output;
    bool             same = a->n_pairs == b->n_pairs;
    for (unsigned bit = HS_WANT_I; same && bit <= HS_WANT_SHIFT; bit <<= 1) {
        if (columns & bit) {
            same = memcmp(hs_output_column(a, bit), hs_output_column(b, bit),
                          (size_t)a->n_pairs * hs_output_width(a, bit)) == 0;
        }
    }
    return same;
}

static void
compare(unsigned columns, int index_bytes)
{
    const hs_kernel *best = unit.call.kernel;
    int32_t          failed;
    write_all(columns, index_bytes);
    unit.call.kernel = &hs_kernel_scalar; /* which has no writer */
    CHECK(record_all(&unit, columns, index_bytes, &failed, &in_batches) == HS_OK);
    unit.call.kernel = best;
    CHECK(same_columns(columns) && at_once.output.n_pairs > 50 && n_visits > 0);
    record_unit_free(&unit, &at_once);
    record_unit_free(&unit, &in_batches);
}

/* Open, upright, and tilted so that the points are kept as given; with turns and without; half
 * lists and full ones, whose i and j the writer leaves to others: it puts the lower one first. */
static void
what_is_written_is_what_is_recorded(void)
{
    for (int trial = 0; trial < 4 * 2 * 2 * 3; trial++) {
        const int  d = 1 + trial % 4, kind = trial / 16;
        const bool is_full = trial / 4 % 2, turned = trial / 8 % 2;
        hs_box     box = {.ndim = d};
        for (int l = 0; l < d; l++) {
            box.periodic[l] = true;
            box.rows[l][l] = 1.5;
            box.rows[l][0] += kind == 2 && l > 0 ? 0.375 : 0.0;
        }
        search_unit_points(300 + (uint64_t)trial, N, d, turned ? 6.0 : 1.5, &unit);
        search_unit_open(kind == 0 ? NULL : &box, turned && kind == 0 ? 1.5 : 0.6, is_full, ALL,
                         &unit);
        const bool has_writer = unit.call.kernel->write != NULL && d >= 2 && d <= HS_WRITE_MOST_DIM;
        static const unsigned wants[] = {ALL,
                                         HS_WANT_DISTANCE,
                                         HS_WANT_VECTOR | HS_WANT_J,
                                         ALL & ~(unsigned)HS_WANT_I,
                                         HS_WANT_SHIFT,
                                         HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT};
        for (int w = 0; w < 6; w++) {
            compare(wants[w], w % 2 ? 4 : 8);
            const bool is_directed = is_full && (wants[w] & (HS_WANT_I | HS_WANT_J));
            CHECK(n_written == (has_writer && !is_directed ? n_visits : 0));
        }
        search_unit_close(&unit);
    }
}

/* i and j side by side; numbers that are not ordinary, unless nothing is measured; shifts that are
 * not. */
static void
what_cannot_be_written_is_left_alone(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.5}, {0.0, 1.5}}};
    for (int trial = 0; trial < 8; trial++) {
        const bool     is_measured = trial < 4;
        const unsigned columns = (is_measured ? ALL : HS_WANT_J | HS_WANT_SHIFT) |
                                 (trial % 4 == ORDINARY ? HS_WANT_BOTH : 0);
        search_unit_points(40, N, 2, 1.5, &unit);
        search_unit_open(&box, 0.5, false, columns, &unit);
        oddity = trial % 4;
        write_all(columns, 8);
        const bool is_written = unit.call.kernel->write != NULL && !is_measured &&
                                (oddity == EXTREME || oddity == NO_FLOATS);
        CHECK(n_visits > 0 && n_written == (is_written ? n_visits : 0));
        CHECK(at_once.output.n_pairs > 50);
        record_unit_free(&unit, &at_once);
        search_unit_close(&unit);
    }
    oddity = ORDINARY;
}

/* Records a visit whose block is so large that the caller is asked while it is laid out, and says
 * no. */
static hs_status
record_unwanted(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_recorder      *recorder = context;
    const hs_options *polls = scanner->trace.of.polls;
    refusal           once = {.nth = 1};
    hs_options        refusing = *polls;
    refusing.poll = refuse_once;
    refusing.poll_context = &once;
    CHECK(scanner->block.n > HS_POLL_CANDIDATES);
    CHECK(hs_output_reserve(recorder->output, hits->end[hits->n - 1], 0.0) == HS_OK);
    scanner->trace.of.polls = &refusing;
    hs_records_reset(&scanner->trace.of); /* as if float32 had told all pairs */
    const hs_status status = hs_record_places(recorder, scanner, first, hits);
    scanner->trace.of.polls = polls;
    CHECK(status == HS_ERR_INTERRUPTED && once.n == 1 && recorder->output->n_pairs == 0);
    n_visits++;
    return HS_ERR_INTERRUPTED;
}

/* Whole neighbourhoods of many images. */
static void
large_blocks_can_be_stopped(void)
{
    const hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    hs_neighbourhood most;
    hs_walker        walker;
    n_visits = 0;
    search_unit_points(41, N, 2, 1.0, &unit);
    search_unit_open(&box, 22.0, true, HS_WANT_DISTANCE, &unit);
    CHECK(hs_walker_init(&unit.search, HS_BLOCK_SIZES, NULL, NULL, &walker) == HS_OK);
    CHECK(hs_walk(&walker, 0, N) == HS_OK);
    most = walker.scanner.most;
    hs_walker_close(&unit.search, &walker);
    CHECK(most.candidates > HS_POLL_CANDIDATES);
    hs_output_init(&unit.call.account, 2, HS_WANT_DISTANCE, 8, &at_once.output);
    CHECK(hs_walker_init_ordered(&unit.search, HS_BLOCK_LISTS_PLACES, &most, record_unwanted,
                                 &at_once.recorder, &walker) == HS_OK);
    CHECK(hs_recorder_init(&unit.call.account, &at_once.output, walker.scanner.block.most_hits,
                           &at_once.recorder) == HS_OK);
    CHECK(hs_walk(&walker, 0, N) == HS_ERR_INTERRUPTED && n_visits == 1);
    hs_walker_close(&unit.search, &walker);
    record_unit_free(&unit, &at_once);
    search_unit_close(&unit);
}

void
test_record_write(void)
{
    RUN(what_is_written_is_what_is_recorded);
    RUN(what_cannot_be_written_is_left_alone);
    RUN(large_blocks_can_be_stopped);
}
