/* SPDX-License-Identifier: BSD-3-Clause */
/* test_scan.c: each point of a group meets each candidate once, however many blocks that takes; what
 * was done is counted and polled for, and a scan ends where it is told to. */
#include "../../../csrc/core/base/fpenv.h"
#include "../../../csrc/core/search/open_scanner.h"
#include "../../../csrc/core/search/scan.h"
#include "../support/poll_checks.h"
#include "../support/search_unit.h"

#include <math.h>

void test_scan(void);

enum { N = 400, FIRST = 100, LAST = 140, OF_GROUP = LAST - FIRST };

static search_unit unit;
static uint8_t     met[N][N];

typedef struct visits {
    int64_t   n, n_hits, largest; /* visits, hits of all, of one */
    int64_t   leave_at;           /* visit that leaves; 0: none */
    int64_t   fail_at;            /* that fails */
    hs_status status;             /* with this */
} visits;

static hs_status
note_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    visits       *to = context;
    const int32_t n = hits->end[hits->n - 1];
    int64_t       wrong = n < 1;
    for (int32_t t = 0, h = 0; t < hits->n; t++) {
        wrong += hits->point[t] != unit.search.bins.order[first + t];
        for (; h < hits->end[t]; h++) {
            const int32_t label = hits->label[h];
            met[hits->point[t]]
               [scanner->use == HS_BLOCK_LISTS_IDS ? label : scanner->block.id[label]]++;
        }
    }
    CHECK(wrong == 0);
    to->n_hits += n;
    to->largest = n > to->largest ? n : to->largest;
    to->n++;
    scanner->leaves = scanner->leaves || to->n == to->leave_at;
    return to->n == to->fail_at ? to->status : HS_OK;
}

/* `extent`: of the points, in cutoffs; below 0.5 all are neighbours. */
static void
open_search(bool is_full, double extent)
{
    search_unit_points(91, N, 2, extent, &unit);
    search_unit_open(NULL, 1.0, is_full, HS_WANT_I, &unit);
}

static void
open_scanner(hs_block_use use, int32_t capacity, visits *to, hs_scanner *scanner)
{
    CHECK(hs_scanner_init(&unit.search, use, capacity, 8, false, scanner) == HS_OK);
    *to = (visits){0};
    if (use > HS_BLOCK_COUNTS) {
        scanner->visit = note_hits;
        scanner->visit_context = to;
    }
}

/* The group against all points up to this one, or all of them behind its first. */
static hs_status
scan_up_to(int32_t end, hs_scanner *scanner)
{
    static const double  none[HS_MAX_DIM];
    static const int32_t home[HS_MAX_DIM];
    hs_scanner_start(scanner, FIRST, LAST);
    const hs_status status =
        hs_scanner_append(scanner, unit.search.is_full ? 0 : FIRST, end, none, home);
    return status == HS_OK ? hs_scanner_finish(scanner) : status;
}

static hs_status
scan_group(hs_scanner *scanner)
{
    return scan_up_to(N, scanner);
}

/* Pairs that are not met as often as they should be: once or not at all. */
static int64_t
wrong_pairs(void)
{
    const int32_t *order = unit.search.bins.order;
    int64_t        wrong = 0;
    for (int32_t si = FIRST; si < LAST; si++) {
        for (int32_t sj = 0; sj < N; sj++) {
            const double *a = unit.x + 2 * order[si], *b = unit.x + 2 * order[sj];
            const bool    within = hypot(a[0] - b[0], a[1] - b[1]) <= 1.0;
            wrong += met[order[si]][order[sj]] != (within && (unit.search.is_full || sj > si));
        }
    }
    return wrong;
}

static void
each_pair_is_met_once(void)
{
    static const int32_t capacities[] = {OF_GROUP, OF_GROUP + 1, 150, N - 1, N, 1000};
    for (int trial = 0; trial < 2 * 4 * 6; trial++) {
        const hs_block_use use = (hs_block_use)(HS_BLOCK_COUNTS + trial / 2 % 4);
        const bool         is_full = trial % 2;
        hs_scanner         scanner;
        visits             to;
        open_search(is_full, 4.0);
        const int64_t held = unit.call.account.held;
        open_scanner(use, capacities[trial / 8], &to, &scanner);
        memset(met, 0, sizeof met);
        CHECK(scan_group(&scanner) == HS_OK);
        if (use == HS_BLOCK_LISTS_IDS || use == HS_BLOCK_LISTS_PLACES)
            CHECK(wrong_pairs() == 0);
        CHECK(use == HS_BLOCK_COUNTS ? to.n == 0 : to.n > 0 && to.n_hits == scanner.n_found);
        CHECK(scanner.n_found > 500 && scanner.n_groups == 1 && scanner.block.n == 0);
        CHECK(scanner.n_candidates < (int64_t)OF_GROUP * N); /* some are not near */
        hs_scanner_close(&unit.search, &scanner);
        hs_scanner_close(&unit.search, &scanner);
        CHECK(unit.call.account.held == held && unit.call.done.groups == 1);
        search_unit_close(&unit);
    }
}

/* Where all are near: tests are counted to the last one, and so is the work between polls. */
static void
what_is_done_is_counted(void)
{
    for (int trial = 0; trial < 2 * 3; trial++) {
        const bool    is_full = trial % 2;
        const int32_t n = is_full ? N : N - FIRST, capacity = trial < 2 ? 50 : trial < 4 ? 75 : N;
        const int64_t own = is_full ? 0 : OF_GROUP * (OF_GROUP + 1) / 2;
        const int     n_blocks = (n + capacity - 1) / capacity;
        hs_scanner    scanner;
        visits        to;
        open_search(is_full, 0.25);
        open_scanner(HS_BLOCK_LISTS_IDS, capacity, &to, &scanner);
        for (int round = 1; round <= 2; round++) {
            CHECK(scan_group(&scanner) == HS_OK);
            CHECK(scanner.n_groups == round && scanner.n_blocks == round * n_blocks);
            CHECK(scanner.blocks == n_blocks && scanner.n_ambiguous == 0);
            CHECK(scanner.n_candidates == round * (OF_GROUP * (int64_t)n - own));
            CHECK(scanner.n_found == scanner.n_candidates && to.n_hits == scanner.n_found);
            CHECK(scanner.work_since_poll ==
                  round * (64 * (int64_t)n_blocks + (1 + OF_GROUP) * (int64_t)n));
        }
        CHECK(to.largest <= capacity + 256); /* short bursts */
        hs_scanner_close(&unit.search, &scanner);
        CHECK(unit.call.done.groups == 2 && scanner.n_groups == 0);
        CHECK(unit.call.done.candidates == 2 * (OF_GROUP * (int64_t)n - own));
        search_unit_close(&unit);
    }
}

/* Hits that are looked up again come as many at a time as the block holds. */
static void
places_come_in_large_visits(void)
{
    hs_scanner scanner;
    visits     to;
    open_search(true, 0.25);
    open_scanner(HS_BLOCK_LISTS_PLACES, N, &to, &scanner);
    CHECK(scan_group(&scanner) == HS_OK);
    CHECK(to.largest == hs_block_most_hits(N) && to.n == OF_GROUP / 2);
    hs_scanner_close(&unit.search, &scanner);
    search_unit_close(&unit);
}

/* Nothing is tested: candidates and runs of a group are counted, and the most of any group. */
static void
sizes_are_those_of_the_largest_group(void)
{
    static const double  none[HS_MAX_DIM];
    static const int32_t home[HS_MAX_DIM], counts[] = {10, 300, 20}, runs[] = {1, 3, 20};
    hs_scanner           scanner;
    visits               to;
    int64_t              work = 0;
    open_search(true, 4.0);
    open_scanner(HS_BLOCK_SIZES, 100, &to, &scanner);
    for (int g = 0; g < 3; g++) {
        const int32_t of_run = counts[g] / runs[g];
        hs_scanner_start(&scanner, FIRST, LAST);
        for (int32_t r = 0; r < runs[g]; r++)
            CHECK(hs_scanner_append(&scanner, r, r + of_run, none, home) == HS_OK);
        CHECK(hs_scanner_finish(&scanner) == HS_OK);
        CHECK(scanner.of_group.candidates == counts[g] && scanner.of_group.runs == runs[g]);
        CHECK(scanner.most.candidates == (g > 0 ? 300 : 10));
        CHECK(scanner.most.runs == (g < 2 ? runs[g] : 20));
        work += 32 * runs[g];
        CHECK(scanner.work_since_poll == work);
    }
    CHECK(scanner.n_found == 0 && scanner.n_groups == 0 && scanner.n_candidates == 0);
    hs_scanner_close(&unit.search, &scanner);
    search_unit_close(&unit);
}

/* Blocks that were scanned before are skipped once; a visitor or a limit ends the scan, after the
 * block. */
static void
scans_go_on_and_end_where_they_are_told(void)
{
    for (int is_full = 0; is_full < 2; is_full++) {
        const int32_t n = is_full ? N : N - FIRST, capacity = 75;
        const int64_t own = is_full ? 0 : OF_GROUP * (OF_GROUP + 1) / 2;
        const int64_t of_first = OF_GROUP * capacity - own;
        hs_scanner    scanner;
        visits        to;
        open_search(is_full, 0.25);
        open_scanner(HS_BLOCK_LISTS_IDS, capacity, &to, &scanner);
        scanner.blocks_to_skip = 2;
        CHECK(scan_group(&scanner) == HS_OK && scanner.blocks_to_skip == 0);
        CHECK(scanner.n_found == OF_GROUP * (int64_t)(n - 2 * capacity));
        CHECK(scanner.blocks == (n + capacity - 1) / capacity);
        scanner.n_found = scanner.n_candidates = 0;
        CHECK(scan_group(&scanner) == HS_OK);
        CHECK(scanner.n_found == OF_GROUP * (int64_t)n - own);
        scanner.n_found = scanner.n_candidates = 0;
        scanner.candidate_limit = of_first;
        CHECK(scan_group(&scanner) == HS_STOPPED && scanner.blocks == 2);
        scanner.n_found = scanner.n_candidates = 0;
        scanner.candidate_limit = of_first - 1;
        CHECK(scan_group(&scanner) == HS_STOPPED && scanner.blocks == 1);
        CHECK(scanner.n_found == of_first && scanner.block.n == 0);
        scanner.candidate_limit = INT64_MAX;
        scanner.n_found = 0;
        to = (visits){.leave_at = 1};
        CHECK(scan_group(&scanner) == HS_STOPPED && scanner.blocks == 1);
        CHECK(scanner.n_found == of_first && to.n > 1 && to.n_hits == of_first);
        scanner.leaves = false;
        to = (visits){.fail_at = 2, .status = HS_ERR_SHIFT_RANGE};
        CHECK(scan_group(&scanner) == HS_ERR_SHIFT_RANGE && to.n == 2);
        hs_scanner_close(&unit.search, &scanner);
        search_unit_close(&unit);
    }
}

/* A point alone in a half list has nothing to be tested against. */
static void
lone_points_are_passed_over(void)
{
    static const double  none[HS_MAX_DIM];
    static const int32_t home[HS_MAX_DIM];
    for (int is_full = 0; is_full < 2; is_full++) {
        hs_scanner scanner;
        visits     to;
        open_search(is_full, 0.25);
        open_scanner(HS_BLOCK_LISTS_IDS, 10, &to, &scanner);
        hs_scanner_start(&scanner, 5, 6);
        CHECK(is_full || hs_scanner_append(&scanner, 5, 6, none, home) == HS_OK);
        CHECK(hs_scanner_finish(&scanner) == HS_OK);
        CHECK(scanner.n_blocks == 0 && scanner.blocks == 1 && to.n == 0);
        CHECK(scanner.block.n == 0 && scanner.block.n_runs == 0);
        CHECK(scanner.work_since_poll == 64 && scanner.n_candidates == 0);
        hs_scanner_start(&scanner, 5, 6);
        CHECK(hs_scanner_append(&scanner, 5, is_full ? 6 : 7, none, home) == HS_OK);
        CHECK(hs_scanner_finish(&scanner) == HS_OK);
        CHECK(scanner.n_blocks == 1 && to.n == 1 && to.n_hits == 1);
        hs_scanner_close(&unit.search, &scanner);
        search_unit_close(&unit);
    }
}

/* Once there is more work than that since the last poll, not before. */
static void
work_is_polled_for(void)
{
    enum { POLL_WORK = 1 << 21 };
    for (int trial = 0; trial < 3 * 2; trial++) {
        const hs_block_use use = trial % 3 == 0   ? HS_BLOCK_SIZES
                                 : trial % 3 == 1 ? HS_BLOCK_COUNTS
                                                  : HS_BLOCK_LISTS_IDS;
        const int64_t      work = use == HS_BLOCK_SIZES ? 32 : 64 + (1 + OF_GROUP) * (int64_t)N;
        const int          stop = trial / 3;
        hs_scanner         scanner;
        refusal            once = {.nth = stop};
        visits             to;
        open_search(true, 0.25);
        open_scanner(use, N, &to, &scanner);
        scanner.options.poll = refuse_once;
        scanner.options.poll_context = &once;
        scanner.work_since_poll = POLL_WORK - work;
        CHECK(scan_group(&scanner) == HS_OK && once.n == 0);
        CHECK(scanner.work_since_poll == POLL_WORK);
        scanner.work_since_poll = POLL_WORK - work + 1;
        CHECK(scan_group(&scanner) == (stop ? HS_ERR_INTERRUPTED : HS_OK) && once.n == 1);
        CHECK(scanner.work_since_poll == 0);
        hs_scanner_close(&unit.search, &scanner);
        search_unit_close(&unit);
    }
}

static volatile float tiny = 0x1p-140f;

/* Subnormal numbers count, and nothing is flushed when a scan has ended. Where the CPU says that
 * they were met, the filter flushes from the seventeenth block on, but never where it decides. */
static void
subnormal_blocks_are_flushed_once_they_are_many(void)
{
    enum { END = N - HS_PADDING }; /* what lies behind the last point is not looked at */
    for (int trial = 0; trial < 2; trial++) {
        const hs_fpenv saved = hs_fpenv_enter();
        hs_scanner     scanner;
        visits         to;
        int            begun = 0; /* blocks before it flushed */
        open_search(true, 0.25);
        for (int64_t si = 0; si < N; si++) {
            for (int k = 0; k < 2; k++)
                unit.search.bins.x[k][si] *= 0x1p-140;
        }
        open_scanner(HS_BLOCK_LISTS_IDS, N, &to, &scanner);
        scanner.options.precision = trial == 1 ? HS_SINGLE : HS_EXACT;
        tiny = tiny * 0.5f;
        tiny = tiny * 2.0f;
        const bool is_told = hs_fpenv_met_subnormal();
        hs_fpenv_flush(false);
        CHECK(!hs_fpenv_met_subnormal());
        for (int round = 1; round <= 20; round++) {
            CHECK(scan_up_to(END, &scanner) == HS_OK && tiny * 0.5f == 0x1p-141f);
            hs_fpenv_flush(false);
            CHECK(scanner.n_found == round * (int64_t)OF_GROUP * END);
            begun += !scanner.flushes;
        }
        CHECK(begun == (is_told && trial == 0 ? 16 : 20));
        CHECK(scanner.n_subnormal == (is_told && trial == 0 ? 17 : 0));
        hs_scanner_close(&unit.search, &scanner);
        search_unit_close(&unit);
        hs_fpenv_leave(saved);
    }
}

void
test_scan(void)
{
    RUN(each_pair_is_met_once);
    RUN(what_is_done_is_counted);
    RUN(places_come_in_large_visits);
    RUN(sizes_are_those_of_the_largest_group);
    RUN(scans_go_on_and_end_where_they_are_told);
    RUN(lone_points_are_passed_over);
    RUN(work_is_polled_for);
    RUN(subnormal_blocks_are_flushed_once_they_are_many);
}
