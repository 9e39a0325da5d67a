/* SPDX-License-Identifier: BSD-3-Clause */
/* test_estimate.c: what cannot fit is refused before it is searched, with a number near the truth;
 * what fits is never refused. */
#include "../../../csrc/core/search/estimate.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/among.h"
#include "../support/random_scenes.h"
#include "../support/search_unit.h"

void test_estimate(void);

/* Points in a box, or in a clump that is a tenth of it along each axis. */
static void
scatter(harness_random *random, double size, int64_t n, double *x)
{
    for (int64_t e = 0; e < 3 * n; e++) {
        x[e] = size * random_unit(random);
    }
}

/* Every limit: a refusal expects about as many pairs as there are, and what is found is all. */
static void
expectations_are_near_the_truth(void)
{
    enum { N = 6000 };
    static double  x[3 * N];
    harness_random random = {20};
    for (int kind = 0; kind < 4; kind++) {
        hs_box          box = {.ndim = 3};
        brute_scene     scene = {.ndim = 3, .n = N, .x = x, .inclusive = true, .cutoff = 2.0};
        const hs_points points = points_of(&scene);
        hs_options      options = options_of(&scene);
        hs_status       status = HS_ERR_MEMORY;
        int64_t         count;
        for (int k = 0; k < 3; k++) {
            box.periodic[k] = true;
            box.rows[k][k] = 10.0;
        }
        scatter(&random, 10.0, N, x);
        if (kind >= 2) {
            scatter(&random, 1.0, N / 3, x);
        }
        scene.box = kind % 2 ? &box : NULL;
        CHECK(hs_pairs_count(AMONG(&points, scene.box), &options, &count, NULL) == HS_OK);
        for (double limit = 1e5; status != HS_OK && limit < 1e9; limit *= 1.3) {
            hs_pairs  *pairs = NULL;
            hs_failure failure;
            options.memory_limit = limit;
            status = hs_pairs_find(AMONG(&points, scene.box), &options, &pairs, &failure);
            CHECK(status == HS_OK || status == HS_ERR_MEMORY);
            CHECK(status == HS_OK || limit < 16.0 * (double)count + 4e6);
            if (status != HS_OK) {
                CHECK(failure.limit_bytes == limit && failure.expected_pairs > 0.1 * (double)count);
                CHECK(failure.expected_pairs < 2.0 * (double)count);
                CHECK(failure.expected_bytes == 16.0 * failure.expected_pairs);
            } else {
                CHECK(hs_pairs_length(pairs) == count && limit > 16.0 * (double)count);
            }
            hs_pairs_free(pairs);
        }
        CHECK(status == HS_OK);
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

/* More work than a sample may cost: all points are candidates of each other. */
static void
samples_end_early_in_a_crowd(void)
{
    enum { N = 100000 };
    static double   x[3 * N];
    harness_random  random = {4};
    const hs_points points = {x, N, 3, HS_FLOAT64, 24, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *pairs = NULL;
    hs_failure      failure;
    const double    all = 0.5 * N * (N - 1.0);
    scatter(&random, 1.0, N, x);
    options.cutoff = 2.0;
    options.memory_limit = 1e8;
    CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &pairs, &failure) == HS_ERR_MEMORY);
    CHECK(pairs == NULL && failure.expected_pairs > 0.01 * all);
    CHECK(failure.expected_pairs < 1.01 * all);
}

/* Pairs beyond int64 are refused before they are counted; no points have none, in any box. */
static void
endless_pairs_are_not_counted(void)
{
    double      x[9] = {0.0};
    hs_box      box = {.ndim = 3, .periodic = {true, true, true}};
    brute_scene scene = {.ndim = 3, .n = 3, .x = x, .box = &box, .cutoff = 1.0};
    hs_options  options = options_of(&scene);
    hs_points   points = points_of(&scene);
    hs_failure  failure;
    hs_pairs   *pairs;
    int64_t     count = -5;
    for (int k = 0; k < 3; k++) {
        box.rows[k][k] = 1e-7;
    }
    CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, &failure) == HS_ERR_TOO_MANY);
    CHECK(count == -5 && failure.value > 0x1p62);
    CHECK(hs_pairs_find(AMONG(&points, &box), &options, &pairs, &failure) == HS_ERR_MEMORY ||
          hs_pairs_find(AMONG(&points, &box), &options, &pairs, &failure) == HS_ERR_TOO_MANY);
    points.n = 0;
    CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, &failure) == HS_OK && count == 0);
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
    hs_shortage_add(&none, &box, 1.0, &shortage);
    hs_shortage_add(&points, &box, NAN, &shortage);
    hs_shortage_add(&points, &box, -1.0, &shortage);
    hs_shortage_add(&points, &flat, 1.0, &shortage);
    CHECK(shortage.pairs == 0.0 && shortage.bytes == 0.0);
    hs_shortage_add(&points, &box, 1.0, &shortage); /* half of 9 points in a disk, of 8 */
    CHECK(fabs(shortage.pairs - 4.5 * 3.14159265358979 / 8.0) < 1e-9 && shortage.bytes > 0.0);
    const double before = shortage.pairs;
    hs_shortage_add(&points, NULL, 100.0, &shortage); /* all three */
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

/* Each point of a crystal has as many neighbours as any other: a sample of them is sure. */
static void
samples_of_a_crystal_are_sure(void)
{
    static search_unit unit;
    enum { SIDE = 44, N = SIDE * SIDE, AROUND = 441 };
    hs_failure   failure = HS_NO_FAILURE;
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{SIDE, 0.0}, {0.0, SIDE}}};
    search_unit_points(21, N, 2, 1.0, &unit);
    for (int p = 0; p < N; p++) {
        unit.x[2 * p] = p % SIDE;
        unit.x[2 * p + 1] = p / SIDE;
    }
    search_unit_open(&box, 12.0, true, HS_WANT_DISTANCE, &unit);
    hs_account  *account = &unit.call.account;
    const double needed = (double)N * AROUND * sizeof(double);
    account->limit = (double)account->held + 1.001 * needed;
    CHECK(hs_estimate_by_sample(&unit.search, &failure) == HS_OK);
    account->limit -= 0.002 * needed;
    CHECK(hs_estimate_by_sample(&unit.search, &failure) == HS_ERR_MEMORY);
    CHECK(failure.expected_pairs == (double)N * AROUND);
    search_unit_close(&unit);
}

/* Many images of each point: the box tells how many there must be, wherever along it they are. */
static void
many_images_are_known_by_the_box(void)
{
    static search_unit unit;
    enum { N = 400 };
    for (int open = 0; open < 2; open++) {
        const hs_box box = {
            .ndim = 2, .periodic = {true, open == 0}, .rows = {{1.0, 0.0}, {0.0, 1.0}}};
        hs_failure failure = HS_NO_FAILURE;
        search_unit_points(22, N, 2, 1.0, &unit);
        search_unit_open(&box, 100.0, false, HS_WANT_DISTANCE, &unit);
        const double half = 0.5 * N * N; /* points, and those about each within a unit of area */
        const double pairs = half * (open == 0 ? 3.14159265358979 * 99.0 * 99.0 : 2.0 * 98.9);
        unit.call.account.limit = (double)unit.call.account.held + 0.95 * pairs * sizeof(double);
        CHECK(hs_estimate_by_density(&unit.search, &failure) == HS_ERR_MEMORY);
        unit.call.account.limit += 0.1 * pairs * sizeof(double);
        CHECK(hs_estimate_by_density(&unit.search, &failure) == HS_OK);
        search_unit_close(&unit);
    }
}

static void
no_points_have_no_pairs(void)
{
    static search_unit unit;
    double             pairs = -1.0;
    search_unit_points(23, 0, 3, 1.0, &unit);
    search_unit_open(NULL, 0.5, false, HS_WANT_DISTANCE, &unit);
    CHECK(hs_estimate_pairs(&unit.search, &pairs) == HS_OK && pairs == 0.0);
    search_unit_close(&unit);
}

void
test_estimate(void)
{
    RUN(samples_of_a_crystal_are_sure);
    RUN(many_images_are_known_by_the_box);
    RUN(small_scenes_are_known_exactly);
    RUN(expectations_are_near_the_truth);
    RUN(what_is_left_is_asked_for_if_it_matters);
    RUN(samples_end_early_in_a_crowd);
    RUN(endless_pairs_are_not_counted);
    RUN(shortages_leave_out_what_cannot_be_searched);
    RUN(no_points_have_no_pairs);
}
