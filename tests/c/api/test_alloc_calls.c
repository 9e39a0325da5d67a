/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_alloc_calls.c: every function of halfshell.h, on scenes of several kinds, while allocation
 * 1, 2, 3, ... fails, alone or with all behind it, until one call is undisturbed. Each failure is
 * HS_ERR_MEMORY and leaves nothing behind; what the call was about stays usable, and answers as if
 * nothing had been.
 */
#include "../../../csrc/core/memory/account.h"
#include "../support/call_kinds.h"
#include "../support/among.h"

void test_alloc_calls(void);

enum { MOST_ALLOCATIONS = 1000 }; /* of one call here */

/* One call whose nth allocation fails, or from -nth on all of them; 0: none. Whether that was asked
 * for at all. */
static bool
attempt(const call_kind *function, int nth, uint64_t expected, int *n_failed)
{
    const int64_t before = hs_test_live_blocks();
    hs_failure    failure;
    call_make_objects(&s.c, function->uses);
    s.c.retries = 1;
    hs_test_fail_allocation(nth);
    hs_status  status = function->run(&s.c, &failure);
    const bool disturbed = nth != 0 && !hs_test_failure_is_due();
    hs_test_fail_allocation(0);
    *n_failed += status == HS_ERR_MEMORY || s.c.retries == 0;
    CHECK(status == HS_OK || (disturbed && status == HS_ERR_MEMORY));
    if (status == HS_ERR_MEMORY) {
        CHECK(failure.row == -1 && failure.column == -1 && failure.limit_bytes >= 0.0);
        status = function->run(&s.c, &failure);
        CHECK(status == HS_OK);
    }
    CHECK(nth == 0 || s.c.answer == expected);
    call_free_objects(&s.c);
    CHECK(hs_test_live_blocks() == before);
    return disturbed;
}

/* Returns how many allocations made the call fail: it can do without others. */
static int
fail_each(const scene_of_calls *kind, const call_kind *function)
{
    const int before = harness_failures;
    int       n_failed = 0, nth = 0;
    (void)attempt(function, 0, 0, &n_failed);
    CHECK(n_failed == 0);
    const uint64_t expected = s.c.answer;
    while (attempt(function, ++nth, expected, &n_failed) && nth < MOST_ALLOCATIONS &&
           harness_failures == before) {
    }
    /* Not of a stream that is kept: blocks before the failure are gone. */
    const int step = IS_SLOW ? 4 : 1;
    for (int from = 1; kind->grows && !(function->uses & USES_STREAM) && from < nth; from += step)
        (void)attempt(function, -from, expected, &n_failed);
    CHECK(nth < MOST_ALLOCATIONS);
    if (harness_failures != before)
        fprintf(stderr, "hs_%s of scene %s, allocation %d\n", function->name, kind->name, nth);
    return n_failed;
}

/* A scene for the function; false: it has no call of this kind. */
static bool
make_call_of(const scene_of_calls *kind, const call_kind *function)
{
    make_call(kind);
    /* Cells of such numbers keep no bounds for queries that come later. */
    if (function->run == call_cells_candidates && kind->exponent > 0)
        s.c.queries = NULL;
    return !(function->uses & NEEDS_BOX) || s.c.box != NULL;
}

static void
every_function_fails_cleanly(void)
{
    for (int k = 0; k < KINDS; k++) {
        for (int f = 0; f < CALL_KINDS; f++) {
            const call_kind *function = &call_kinds[f];
            if (!make_call_of(&kinds[k], function))
                continue;
            const int n_failed = fail_each(&kinds[k], function);
            if (kinds[k].grows && function->run == call_stream) { /* two blocks in all */
                s.c.max_pairs = 2000;
                CHECK(fail_each(&kinds[k], function) > 0);
            }
            const bool allocates = function->run != call_box_measure;
            CHECK(allocates == (n_failed > 0));
            if (s.c.queries != NULL && (function->uses & USES_QUERIES) &&
                !(function->uses & NEEDS_QUERIES)) {
                s.c.queries = NULL;
                CHECK(fail_each(&kinds[k], function) > 0);
            }
        }
    }
}

/* Small blocks cut from an arena, which each call and each of its threads has: the same answers, and
 * all arenas are given back, also when the call is ended early. */
static void
arenas_are_given_back(void)
{
    for (int k = 0; k < KINDS; k++) {
        for (int f = 0; f < CALL_KINDS; f++) {
            int n_failed = 0;
            if (!make_call_of(&kinds[k], &call_kinds[f]))
                continue;
            (void)attempt(&call_kinds[f], 0, 0, &n_failed);
            const uint64_t expected = s.c.answer;
            hs_test_use_arena(true);
            s.c.answer = ~expected;
            for (int nth = 0; nth < 12; nth += 3) /* at first none fails */
                (void)attempt(&call_kinds[f], nth, expected, &n_failed);
            hs_test_use_arena(false);
            CHECK(s.c.answer == expected);
        }
    }
}

/* All points a little further, or so far that the list must be built again. */
static void
move_points(const scene_of_calls *kind, double by)
{
    for (int e = 0; e < 3 * kind->n; e++) {
        s.of.x[e] += ldexp(by * (e % 4), kind->exponent);
        s.x[e] = (float)s.of.x[e];
    }
}

static uint64_t
pairs_of_list(void)
{
    CHECK(call_verlet_find(&s.c, NULL) == HS_OK);
    return s.c.answer;
}

/* A list with one step, and the next one with an allocation that fails. */
static bool
attempt_step(const scene_of_calls *kind, double by, int nth, uint64_t *after, int *n_failed)
{
    const int64_t before = hs_test_live_blocks();
    bool          rebuilt;
    make_call(kind);
    call_make_objects(&s.c, USES_LIST);
    const uint64_t was = pairs_of_list();
    move_points(kind, by);
    hs_test_fail_allocation(nth);
    hs_status status = hs_verlet_update(s.c.list, s.c.points, s.c.box, s.c.options, s.c.skin, false,
                                        &rebuilt, NULL);
    const bool disturbed = nth > 0 && !hs_test_failure_is_due();
    hs_test_fail_allocation(0);
    CHECK(status == HS_OK || (disturbed && status == HS_ERR_MEMORY));
    if (status == HS_ERR_MEMORY) {
        ++*n_failed;
        CHECK(pairs_of_list() == was);
        status = hs_verlet_update(s.c.list, s.c.points, s.c.box, s.c.options, s.c.skin, false,
                                  &rebuilt, NULL);
        CHECK(status == HS_OK);
    }
    *after = nth == 0 ? pairs_of_list() : *after;
    CHECK(pairs_of_list() == *after && *after != was);
    call_free_objects(&s.c);
    CHECK(hs_test_live_blocks() == before);
    return disturbed;
}

static void
lists_stay_as_they_were(void)
{
    for (int k = 0; k < KINDS; k++) {
        for (int far = 0; far < 2; far++) {
            const double by = far ? 0.7 : 0.01;
            uint64_t     after = 0;
            int          n_failed = 0, nth = 0;
            (void)attempt_step(&kinds[k], by, 0, &after, &n_failed);
            while (attempt_step(&kinds[k], by, ++nth, &after, &n_failed) &&
                   nth < MOST_ALLOCATIONS) {
            }
            CHECK(nth < MOST_ALLOCATIONS && n_failed > (far ? 8 : 0));
        }
    }
    hs_test_fail_allocation(1);
    CHECK(hs_verlet_new() == NULL);
    hs_test_fail_allocation(0);
    hs_test_fail_allocation(-2);
    hs_verlet *list = hs_verlet_new();
    CHECK(list != NULL && !hs_test_failure_is_due());
    CHECK(hs_verlet_new() == NULL && hs_verlet_new() == NULL);
    hs_test_fail_allocation(-3);
    CHECK(hs_test_failure_is_due());
    hs_test_fail_allocation(0);
    hs_verlet_free(list);
}

/* So many entries that their rows are found by one walk, in memory that is kept for them. */
static void
large_tables_fail_cleanly(void)
{
    enum { N = 1100 };
    static double   x[3 * N];
    harness_random  random = {77};
    hs_options      options = hs_options_default();
    const hs_points points = {.data = x,
                              .n = N,
                              .ndim = 3,
                              .real = HS_FLOAT64,
                              .row_stride = 3 * sizeof(double),
                              .column_stride = sizeof(double)};
    bool            disturbed = true;
    int             n_failed = 0, nth = 0;
    for (int e = 0; e < 3 * N; e++)
        x[e] = random_unit(&random);
    options.cutoff = 2.0;
    while (disturbed && nth < MOST_ALLOCATIONS) {
        const int64_t before = hs_test_live_blocks();
        hs_pairs     *rows = CALL_NOTHING;
        hs_test_fail_allocation(++nth);
        const hs_status status = hs_neighbors_find(AMONG(&points, NULL), &options, &rows, NULL);
        disturbed = !hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || (disturbed && status == HS_ERR_MEMORY));
        CHECK((status == HS_OK) == (rows != NULL));
        n_failed += status != HS_OK;
        for (int64_t i = 0; status == HS_OK && i < N; i++) { /* all others, each once */
            const int32_t last = i < N - 1 ? N - 1 : N - 2;
            CHECK(hs_pairs_offsets(rows)[i + 1] == (i + 1) * (N - 1));
            CHECK(((const int64_t *)hs_pairs_array(rows, HS_WANT_J))[(i + 1) * (N - 1) - 1] ==
                  last);
        }
        hs_pairs_free(rows);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(nth < MOST_ALLOCATIONS && n_failed > 2 && nth > 10); /* it can find them twice instead */
}

void
test_alloc_calls(void)
{
    RUN(large_tables_fail_cleanly);
    RUN(lists_stay_as_they_were);
    RUN(arenas_are_given_back);
    RUN(every_function_fails_cleanly);
}
