/* SPDX-License-Identifier: BSD-3-Clause */
/* test_search.c: searches are opened, built, kept for more of the same kind, and estimated. */
#include "../../../csrc/core/search/search.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"
#include "../support/search_unit.h"

#include <math.h>
#include <string.h>

void test_search(void);

/* ---- cells that are kept answer as cells of their own do, whatever they were built for ---- */

/* Cells in a lattice whose normals miss the periods by nearly half: ranges have no end, and the
 * search is refused as one without cells is. */
static void
cells_that_cannot_be_narrowed_are_refused(void)
{
    static search_unit built;
    const hs_box       box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    const hs_sets      sets = {.points = &built.points, .built = &built.search};
    hs_call            call;
    hs_search          search;
    hs_failure         failure = HS_NO_FAILURE;
    hs_options         options = hs_options_default();
    search_unit_points(12, 4, 2, 1.0, &built);
    search_unit_open(&box, 21.0, false, HS_WANT_I, &built);
    options.cutoff = 20.0;
    options.threads = 1;
    for (int bad = 0; bad < 2; bad++) {
        if (bad) {
            const double normals[2][2] = {{0.55, 0.0}, {0.0, 1.0}};
            built.search.scene.lattice.aligned = false;
            for (int k = 0; k < 2; k++)
                memcpy(built.search.scene.lattice.normal[k], normals[k], sizeof normals[k]);
        }
        hs_call_begin(&options, &call);
        CHECK(hs_search_reuse(&sets, &call, &search, &failure) == (bad ? HS_ERR_MEMORY : HS_OK));
        if (!bad)
            hs_search_close(&search);
        hs_call_dismiss(&call);
        CHECK(call.account.held == 0);
        hs_account_close(&call.account);
    }
    search_unit_close(&built);
}

/* ---- what cannot fit is refused before it is searched, with a number near the truth ---- */

/* Points in a box, or in a clump that is a tenth of it along each axis. */
static void
scatter(harness_random *random, double size, int64_t n, double *x)
{
    for (int64_t e = 0; e < 3 * n; e++) {
        x[e] = size * random_unit(random);
    }
}

/* A hs_limit_fn: little is left; counts how often it is asked. */
static double
little_left(void *context)
{
    *(int *)context += 1;
    return 1e6;
}

/* What memory is left is not asked where the density and a sample say that the pairs are few,
 * however many there might be: those of even points, of points in a clump, of more neighbours. */
static void
what_is_left_is_asked_for_if_it_matters(void)
{
    enum { N = 8000 };
    static double       x[3 * N];
    static const double sizes[] = {10.0, 1.0, 10.0}, cutoffs[] = {2.0, 2.0, 6.0};
    harness_random      random = {23};
    const hs_points     points = {x, N, 3, HS_FLOAT64, 24, 8};
    hs_box              box = {.ndim = 3, .periodic = {true, true, true}};
    for (int k = 0; k < 3; k++) {
        box.rows[k][k] = 10.0;
    }
    for (int kind = 0; kind < 3; kind++) {
        hs_options options = hs_options_default();
        hs_pairs  *pairs = NULL;
        hs_failure failure;
        int        n_asked = 0;
        options.cutoff = cutoffs[kind];
        options.find_limit = little_left;
        options.find_context = &n_asked;
        scatter(&random, sizes[kind], N, x);
        const hs_status status = hs_pairs_find(AMONG(&points, &box), &options, &pairs, &failure);
        CHECK(status == (kind == 0 ? HS_OK : HS_ERR_MEMORY) && n_asked == (kind > 0));
        CHECK(kind == 0 || failure.expected_pairs > 2e7);
        hs_pairs_free(pairs);
    }
}

/* A shortage is that of the systems that can be searched at all. */
static void
shortages_leave_out_what_cannot_be_searched(void)
{
    const double    x[6] = {0.0, 0.0, 1.0, 0.0, 0.0, 1.0};
    const hs_points points = {x, 3, 2, HS_FLOAT64, 16, 8}, none = {x, 0, 2, HS_FLOAT64, 16, 8};
    hs_box          box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0, 0.0}, {0.0, 2.0}}};
    hs_box          flat = box;
    hs_shortage     shortage = {0.0, 0.0};
    flat.rows[1][1] = 0.0;
    hs_shortage_add(&(hs_sets){.points = &none}, &box, 1.0, &shortage);
    hs_shortage_add(&(hs_sets){.points = &points}, &box, NAN, &shortage);
    hs_shortage_add(&(hs_sets){.points = &points}, &box, -1.0, &shortage);
    hs_shortage_add(&(hs_sets){.points = &points}, &flat, 1.0, &shortage);
    CHECK(shortage.pairs == 0.0 && shortage.bytes == 0.0);
    hs_shortage_add(&(hs_sets){.points = &points}, &box, 1.0,
                    &shortage); /* half of 9 points in a disk, of 8 */
    CHECK(fabs(shortage.pairs - 4.5 * 3.14159265358979 / 8.0) < 1e-9 && shortage.bytes > 0.0);
    const double before = shortage.pairs;
    hs_shortage_add(&(hs_sets){.points = &points}, NULL, 100.0, &shortage); /* all three */
    CHECK(shortage.pairs == before + 3.0);
}

/* Where all points are counted the number of pairs is known: a byte decides. */
static void
small_scenes_are_known_exactly(void)
{
    static search_unit unit;
    enum { FEW = 60, BYTES = 8 + 8 + 24 + 12 };
    hs_failure failure = HS_NO_FAILURE;
    search_unit_points(21, FEW, 3, 1.0, &unit);
    search_unit_open(NULL, 2.0, true, HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT,
                     &unit);
    hs_account *account = &unit.call.account;
    account->limit = (double)account->held + FEW * FEW * BYTES;
    CHECK(hs_estimate_by_sample(&unit.search, &failure) == HS_OK);
    CHECK(failure.expected_pairs == 0.0);
    account->limit -= 1.0;
    CHECK(hs_estimate_by_sample(&unit.search, &failure) == HS_ERR_MEMORY);
    CHECK(failure.expected_pairs == FEW * FEW && failure.expected_bytes == FEW * FEW * BYTES);
    CHECK(failure.limit_bytes == account->limit);
    CHECK(unit.call.done.groups == FEW && unit.call.done.candidates == FEW * FEW);
    unit.search.keeps_none = true; /* pairs that are handed on take nothing */
    CHECK(hs_estimate_by_sample(&unit.search, &failure) == HS_OK);
    search_unit_close(&unit);
}

/* ---- the table tells which edges a distance is above, or that it is too near to one ---- */

enum { MOST = 2000 };

static hs_scene  scene;
static hs_shells shells;
static double    cutoffs_shells[MOST];

/* Shells of the first n cutoffs. */
static hs_status
open_shells(int64_t n)
{
    hs_options options = hs_options_default();
    scene.scale = hs_scale_of(0);
    options.want = HS_WANT_SHELL;
    options.n_shells = n;
    options.shells = cutoffs_shells;
    options.cutoff = cutoffs_shells[n - 1];
    return hs_shells_open(NULL, &scene, &options, &shells);
}

/* What is found for one distance is what comparing it with all bands says. */
static void
check_distance(double distance)
{
    int32_t below = 0, maybe = 0, shell, low, high;
    for (int64_t k = 0; k < shells.n; k++) {
        below += shells.high[k] < distance;
        maybe += shells.low[k] <= distance;
    }
    const bool is_open = hs_shells_find(&shells, &distance, 1, &shell);
    CHECK(is_open || (shell == below && maybe == below));
    CHECK(shell <= below && shell >= 0);
    low = shell;
    hs_shells_range(&shells, distance, &low, &high);
    CHECK(low == below && high == maybe);
}

static void
check_shells(int64_t n, uint64_t seed)
{
    harness_random random = {seed};
    CHECK(open_shells(n) == HS_OK && shells.n == n - 1);
    for (int64_t k = 0; k < n; k++) {
        double at = cutoffs_shells[k];
        for (int step = 0; step < 12; step++, at = nextafter(at, 0.0))
            check_distance(at);
        at = cutoffs_shells[k];
        for (int step = 0; k < n - 1 && step < 12 && at < cutoffs_shells[n - 1]; step++) {
            at = nextafter(at, INFINITY);
            check_distance(at);
        }
    }
    for (int t = 0; t < 200; t++)
        check_distance(cutoffs_shells[n - 1] * random_unit(&random));
    hs_free(NULL, shells.memory);
}

/* Few, on the limits of cells, crowded, from zero on, over the whole range of numbers. */
static void
distances_are_placed_between_edges(void)
{
    for (int64_t n = 2; n <= 8; n++) {
        for (int64_t k = 0; k < n; k++)
            cutoffs_shells[k] = 0.5 * (double)(k + 1);
        check_shells(n, (uint64_t)n);
    }
    for (int64_t k = 0; k < MOST; k++)
        cutoffs_shells[k] = 1.0 + 1e-4 * (double)k;
    check_shells(MOST, 1);
    for (int64_t k = 0; k < 5; k++)
        cutoffs_shells[k] = k < 3 ? 0.0 : 0.25 * (double)k;
    check_shells(5, 2);
    for (int64_t k = 0; k < 3; k++)
        cutoffs_shells[k] = 0.0;
    check_shells(3, 3);
    for (int64_t k = 0; k < 601; k++)
        cutoffs_shells[k] = ldexp(1.0, (int)(3.4 * (double)k) - 1074);
    check_shells(601, 4);
    cutoffs_shells[0] = 0x1p-1074;
    cutoffs_shells[1] = 1.0;
    cutoffs_shells[2] = cutoffs_shells[3] = 1.0 + 0x1p-52;
    cutoffs_shells[4] = HUGE_VAL / 2 > 1e308 ? 1.7976931348623157e308 : 1e308;
    check_shells(5, 5);
    check_shells(1, 6);
}

/* A scene that lost digits compares in the caller's unit. */
static void
edges_are_those_of_the_metric(void)
{
    cutoffs_shells[0] = 3.0;
    cutoffs_shells[1] = 5.0;
    hs_options options = hs_options_default();
    options.want = HS_WANT_SHELL;
    options.n_shells = 2;
    options.shells = cutoffs_shells;
    options.cutoff = 5.0;
    scene.scale = hs_scale_of(4);
    for (int lost = 0; lost < 2; lost++) {
        scene.extreme = lost;
        CHECK(hs_shells_open(NULL, &scene, &options, &shells) == HS_OK);
        CHECK(shells.edge[0] == 3.0 &&
              shells.at[0] == (lost ? 3.0 : hs_scale_apply(scene.scale, 3.0)));
        hs_free(NULL, shells.memory);
    }
    scene.extreme = false;
}

/* On the right side of both edges, and no further than that. */
static void
distances_are_kept_between_edges(void)
{
    cutoffs_shells[0] = 1.0;
    cutoffs_shells[1] = 2.0;
    cutoffs_shells[2] = 3.0;
    CHECK(open_shells(3) == HS_OK);
    for (int inclusive = 0; inclusive < 2; inclusive++) {
        shells.inclusive = inclusive;
        const double above = inclusive ? nextafter(1.0, 2.0) : 1.0;
        const double below = inclusive ? 2.0 : nextafter(2.0, 1.0);
        CHECK(hs_shells_keep(&shells, 0, 0.5) == 0.5);
        CHECK(hs_shells_keep(&shells, 0, 1.5) == (inclusive ? 1.0 : nextafter(1.0, 0.0)));
        CHECK(hs_shells_keep(&shells, 1, nextafter(1.0, 0.0)) == above);
        CHECK(hs_shells_keep(&shells, 1, 1.5) == 1.5);
        CHECK(hs_shells_keep(&shells, 1, nextafter(2.0, 3.0)) == below);
        CHECK(hs_shells_keep(&shells, 2, nextafter(2.0, 0.0)) ==
              (inclusive ? nextafter(2.0, 3.0) : 2.0));
        CHECK(hs_shells_keep(&shells, 2, 3.0) == 3.0);
    }
    hs_free(NULL, shells.memory);
}

/* A cutoff of so many boxes that a neighbourhood has tens of thousands of rows: where these are
 * gone through a caller can stop, and a few points are a sample. */
static void
neighbourhoods_of_many_rows_can_be_stopped(void)
{
    hs_box          box = {5, {true, true, true, true}, {{1}, {0, 1}, {0, 0, 1}, {0, 0, 0, 1}}};
    static double   x[5 * 16];
    hs_options      options = hs_options_default();
    hs_pairs       *pairs = NULL;
    int64_t         left, n, count = -1;
    const hs_points one = {x, 1, 4, HS_FLOAT64, 40, 8}, many = {x, 16, 5, HS_FLOAT64, 40, 8};
    for (int i = 1; i < 16; i += 2)
        x[5 * i + 4] = 40.0; /* so far apart that density tells nothing */
    options.cutoff = IS_SLOW ? 24.0 : 34.0;
    options.poll = stop_after;
    options.poll_context = &left;
    options.threads = 1;
    for (int limited = 0; limited < 2; limited++) { /* found with an estimate, or counted */
        hs_status status = HS_ERR_INTERRUPTED;
        options.memory_limit = limited ? 1e9 : INFINITY;
        box.ndim = limited ? 5 : 4;
        int64_t polls = 0; /* each of the first few, then fewer, of the walk over rows */
        for (n = 0; status == HS_ERR_INTERRUPTED; n++) {
            left = polls;
            polls = polls < 6 ? polls + 1 : 4 * polls;
            status = limited ? hs_pairs_find(AMONG(&many, &box), &options, &pairs, NULL)
                             : hs_pairs_count(AMONG(&one, &box), &options, &count, NULL);
        }
        CHECK(n > 2 && status == (limited ? HS_ERR_MEMORY : HS_OK) && pairs == NULL);
    }
    box.ndim = 4;
    options.poll = NULL;
    options.memory_limit = INFINITY;
    options.cell_size = 0.25; /* cells are made wider where neighbourhoods have so many rows */
    CHECK(hs_pairs_count(AMONG(&one, &box), &options, &n, NULL) == HS_OK && n == count);
}

void
test_search(void)
{
    RUN(neighbourhoods_of_many_rows_can_be_stopped);
    RUN(cells_that_cannot_be_narrowed_are_refused);
    RUN(small_scenes_are_known_exactly);
    RUN(what_is_left_is_asked_for_if_it_matters);
    RUN(shortages_leave_out_what_cannot_be_searched);
    RUN(distances_are_placed_between_edges);
    RUN(edges_are_those_of_the_metric);
    RUN(distances_are_kept_between_edges);
}
