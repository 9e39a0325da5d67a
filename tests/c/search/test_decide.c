/* SPDX-License-Identifier: BSD-3-Clause */
/* test_decide.c: what the filter lets through is decided, however little the filter can tell: with
 * any error beyond its own the same pairs are found and counted, at any size of the numbers. */
#include "../support/search_unit.h"

#include <math.h>

void test_decide(void);

enum { N = 160 };

static search_unit unit;

/* A matrix of who has met whom, and how often. */
typedef struct met {
    uint8_t times[N][N];
    int64_t n;
    bool    by_place;
} met;

static hs_status
note_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    met *to = context;
    (void)first;
    for (int32_t t = 0, h = 0; t < hits->n; t++) {
        for (; h < hits->end[t]; h++, to->n++) {
            const int32_t label = hits->label[h];
            to->times[hits->point[t]][to->by_place ? scanner->block.id[label] : label]++;
        }
    }
    return HS_OK;
}

/* All hits, with this error added to the filter's own. */
static void
walk_with(double error, hs_block_use use, met *to, hs_scanner *done)
{
    hs_walker walker;
    memset(to, 0, sizeof *to);
    to->by_place = use == HS_BLOCK_LISTS_PLACES;
    unit.search.filter_error += error;
    CHECK(hs_walker_init(&unit.search, use, use == HS_BLOCK_COUNTS ? NULL : note_hits, to,
                         &walker) == HS_OK);
    CHECK(hs_walk(&walker, 0, N) == HS_OK);
    *done = walker.scanner;
    hs_walker_close(&unit.search, &walker);
    unit.search.filter_error -= error;
}

/* Two points of a lattice of 2^-6, in the nearest image: exact. */
static bool
are_within(const hs_box *box, int i, int j, double cutoff)
{
    double square = 0.0;
    for (int k = 0; k < unit.points.ndim; k++) {
        double along = fabs(unit.x[i * unit.points.ndim + k] - unit.x[j * unit.points.ndim + k]);
        along = box != NULL && box->periodic[k] ? fmin(along, box->rows[k][k] - along) : along;
        square += along * along;
    }
    return square <= cutoff * cutoff;
}

static void
compare(const hs_box *box, double cutoff, double scale, const met *found, bool is_full)
{
    const int d = unit.points.ndim;
    int64_t   wrong = 0, n = 0;
    double    exact[3 * N];
    memcpy(exact, unit.x, (size_t)(N * d) * sizeof *exact);
    for (int e = 0; e < N * d; e++)
        unit.x[e] /= scale;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            const int back = is_full ? 0 : found->times[j][i], times = found->times[i][j] + back;
            const int expected = are_within(box, i, j, cutoff) && (is_full || i != j);
            wrong += times != expected;
            n += expected;
        }
    }
    memcpy(unit.x, exact, (size_t)(N * d) * sizeof *exact);
    CHECK(wrong == 0 && n > 2 * N && found->n == (is_full ? n : n / 2));
}

/* Distances on a lattice: many are the cutoff itself. */
static void
pairs_do_not_depend_on_the_filter(void)
{
    static met          all;
    static const double errors[] = {0.0, 0.002, 0.06, 3.0};
    static const int    exponents[] = {0, 1010, -1010};
    int64_t             n_unsure = 0, n_certain = 0;
    for (int trial = 0; trial < 36; trial++) {
        const int    d = 1 + trial % 3;
        const bool   is_full = trial / 3 % 2, has_box = trial / 6 % 2;
        const double cutoff = d == 1 ? 0.25 : 0.3125, scale = ldexp(1.0, exponents[trial / 12]);
        hs_box       box = {.ndim = d, .periodic = {true, trial % 4 < 2, true}}, sized = box;
        search_unit_points(2000 + (uint64_t)trial, N, d, 1.0, &unit);
        for (int e = 0; e < N * d; e++)
            unit.x[e] = floor(unit.x[e] * 64.0) / 64.0 * scale;
        for (int k = 0; k < d; k++) {
            box.rows[k][k] = 1.0;
            sized.rows[k][k] = scale;
        }
        search_unit_open(has_box ? &sized : NULL, cutoff * scale, is_full, HS_WANT_I, &unit);
        for (int e = 0; e < 4; e++) {
            hs_scanner   done;
            const double error = errors[e] * unit.search.scene.cutoff / cutoff;
            for (int use = HS_BLOCK_COUNTS; use <= HS_BLOCK_LISTS_PLACES; use++) {
                walk_with(error, (hs_block_use)use, &all, &done);
                if (use == HS_BLOCK_COUNTS) {
                    CHECK(done.n_found > 2 * N);
                } else {
                    compare(has_box ? &box : NULL, cutoff, scale, &all, is_full);
                    CHECK(done.n_found == all.n);
                }
            }
            n_unsure += done.n_ambiguous;
            n_certain += done.n_candidates - done.n_ambiguous;
            const int64_t decided =
                done.stages.by_float64 + done.stages.by_double_word + done.stages.by_integers;
            CHECK(decided == done.n_ambiguous);
            CHECK(errors[e] < 1.0 || done.n_ambiguous > all.n);
        }
        search_unit_close(&unit);
    }
    CHECK(n_unsure > 50000 && n_certain > 50000);
}

/* The counts of a walk that only counts are those of one that lists. */
static void
counting_decides_as_listing_does(void)
{
    static met all;
    search_unit_points(77, N, 3, 1.0, &unit);
    for (int e = 0; e < 3 * N; e++)
        unit.x[e] = floor(unit.x[e] * 16.0) / 16.0;
    search_unit_open(NULL, 0.375, true, HS_WANT_I, &unit);
    for (int e = 0; e < 5; e++) {
        hs_scanner listed, counted;
        walk_with(0.04 * e, HS_BLOCK_LISTS_IDS, &all, &listed);
        const int64_t n = all.n;
        walk_with(0.04 * e, HS_BLOCK_COUNTS, &all, &counted);
        CHECK(counted.n_found == n && listed.n_found == n);
        CHECK(counted.n_ambiguous == listed.n_ambiguous && counted.n_ambiguous > 0);
        CHECK(counted.n_candidates == listed.n_candidates);
    }
    search_unit_close(&unit);
}

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

void
test_decide(void)
{
    RUN(pairs_do_not_depend_on_the_filter);
    RUN(counting_decides_as_listing_does);
    RUN(every_pair_is_tested_once);
}
