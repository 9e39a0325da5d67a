/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_memory.c: memory that is refused, allocation by allocation, in every call of the table. */
#include "../../../csrc/core/memory/memory.h"
#include "../support/among.h"
#include "../support/call_scenes.h"

void test_api_memory(void);

/* ---- scenes of several kinds, each of which takes another way through the search ---- */

static const scene_of_calls kinds[] = {
    {.name = "dense", .box = SCENE_OPEN, .n = 150, .cutoff = 1.0, .want = HS_WANT_I | HS_WANT_J},
    {.name = "sparse",
     .box = SCENE_OPEN,
     .n = 120,
     .cutoff = 0.6,
     .apart = 3e5,
     .want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE},
    {.name = "images",
     .box = SCENE_TRICLINIC,
     .n = 20,
     .cutoff = 4.0,
     .one_radius = true,
     .want = ALL},
    {.name = "float32",
     .box = SCENE_ALIGNED,
     .n = 100,
     .cutoff = 1.0,
     .narrow = true,
     .want = HS_WANT_J | HS_WANT_VECTOR},
    {.name = "sorted", .box = SCENE_MIXED, .n = 60, .cutoff = 1.5, .sorted = true, .want = ALL},
    {.name = "threads",
     .box = SCENE_ALIGNED,
     .n = 330,
     .cutoff = 0.7,
     .threads = 2,
     .one_radius = true,
     .want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT},
    {.name = "into",
     .box = SCENE_SHEARED,
     .n = 60,
     .cutoff = 1.2,
     .into = true,
     .want = HS_WANT_I | HS_WANT_J},
    {.name = "double",
     .box = SCENE_TURNED,
     .n = 60,
     .cutoff = 1.2,
     .precision = HS_DOUBLE,
     .want = HS_WANT_BOTH},
    {.name = "extreme", .box = SCENE_OPEN, .n = 60, .cutoff = 1.2, .exponent = 1010, .want = ALL},
    {.name = "crowds",
     .box = SCENE_OPEN,
     .n = 210,
     .cutoff = 9.0,
     .apart = 3e5,
     .grows = true,
     .want = ALL},
    {.name = "crowds, threads",
     .box = SCENE_OPEN,
     .n = 210,
     .cutoff = 9.0,
     .apart = 3e5,
     .grows = true,
     .threads = 2,
     .want = HS_WANT_J | HS_WANT_DISTANCE},
};

enum { KINDS = sizeof kinds / sizeof kinds[0] };

/*
 * ---- alloc calls ----
 *
 * Every function of halfshell.h, on scenes of several kinds, while allocation 1, 2, 3, ... is
 * refused.
 */

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
            if ((IS_SLOW && (k + f) % 3 != 0) || !make_call_of(&kinds[k], function))
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
    const hs_points points = points_in_rows(x, N, 3);
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

/*
 * ---- memory limits ----
 *
 * Every function of halfshell.h, on scenes of several kinds, under one limit of memory after the
 * other: whatever it forbids, the answer is HS_ERR_MEMORY or the right one, and what the call was
 * about stays usable.
 */

static const double LEAST = 300.0, MOST = 0x1p26; /* bytes */
static const double STEP = IS_SLOW ? 1.6 : 1.25;

enum { ENOUGH = 4 }; /* limits in a row that a call can do with */

/* One call under a limit. Whether it could do with that. */
static bool
attempt_limits(const call_kind *function, double limit, uint64_t expected)
{
    const int64_t before = hs_test_live_blocks();
    hs_failure    failure;
    call_make_objects(&s.c, function->uses);
    s.c.retries = 0;
    s.options.memory_limit = limit;
    const hs_status status = function->run(&s.c, &failure);
    s.options.memory_limit = INFINITY;
    CHECK(status == HS_OK || status == HS_ERR_MEMORY);
    if (status == HS_ERR_MEMORY) {
        CHECK(failure.row == -1 && failure.column == -1 && failure.limit_bytes == limit);
        CHECK(!(function->uses & (USES_CELLS | USES_LIST)) ||
              function->run(&s.c, &failure) == HS_OK);
    }
    CHECK(status != HS_OK || s.c.answer == expected);
    call_free_objects(&s.c);
    CHECK(hs_test_live_blocks() == before);
    return status == HS_OK;
}

/* Returns how many limits were too low. */
static int
raise_limit(const scene_of_calls *kind, const call_kind *function)
{
    const int before = harness_failures;
    int       refused = 0, served = 0;
    double    limit = LEAST;
    call_make_objects(&s.c, function->uses);
    CHECK(function->run(&s.c, NULL) == HS_OK);
    call_free_objects(&s.c);
    const uint64_t expected = s.c.answer;
    for (; limit < MOST && served < ENOUGH && harness_failures == before; limit *= STEP) {
        const bool serves = attempt_limits(function, limit, expected);
        refused += !serves;
        served = serves ? served + 1 : 0;
    }
    CHECK(limit < MOST);
    if (harness_failures != before)
        fprintf(stderr, "hs_%s of scene %s, %.0f bytes\n", function->name, kind->name, limit);
    return refused;
}

static void
no_limit_leads_to_a_wrong_answer(void)
{
    for (int k = 0; k < KINDS; k++) {
        for (int f = 0; f < CALL_KINDS; f++) {
            const call_kind *function = &call_kinds[f];
            if (IS_SLOW && (k + f) % 3 != 0)
                continue;
            make_call(&kinds[k]);
            /* A stream has the limit that it was opened with. */
            if (((function->uses & NEEDS_BOX) && s.c.box == NULL) || (function->uses & USES_STREAM))
                continue;
            if (function->run == call_cells_candidates && kinds[k].exponent > 0)
                s.c.queries = NULL;
            const int refused = raise_limit(&kinds[k], function);
            CHECK(refused > 0 || !(function->uses & USES_OPTIONS));
        }
    }
}

void
test_api_memory(void)
{
    RUN(large_tables_fail_cleanly);
    RUN(lists_stay_as_they_were);
    RUN(every_function_fails_cleanly);
    RUN(no_limit_leads_to_a_wrong_answer);
}
