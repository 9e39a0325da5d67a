/* SPDX-License-Identifier: BSD-3-Clause */
/* test_dynamic_threads.c: queries of many threads while others change the list: points that stay are
 * always found, and each thread's own are where it put them. A thread that holds the list is alone,
 * and polls end long queries. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#endif
#include "../../../csrc/core/base/os_thread.h"
#include "../../../csrc/core/dynamic/dynamic.h"
#include "../support/harness.h"

void test_dynamic_threads(void);

enum { LASTING = 100, ROUNDS = 400, THREADS = 4 };

typedef struct task {
    hs_dynamic *list;
    int64_t     first; /* key of its own points */
    int         failures;
} task;

static void
fixed_position(int64_t id, double *x)
{
    x[0] = (double)(id % 10);
    x[1] = (double)(id / 10);
}

static int
count_fixed(hs_key key, const double *position, const int64_t *shift, void *user)
{
    (void)position, (void)shift;
    *(int *)user += key.id < LASTING;
    return 0;
}

static hs_thread_result HS_THREAD_CALL
ask_and_change(void *context)
{
    task          *of = context;
    harness_random random = {(uint64_t)of->first};
    for (int round = 0; round < ROUNDS; round++) {
        const hs_key own = {of->first + round % 7, 0};
        double       x[2] = {10.0 * random_unit(&random), 10.0 * random_unit(&random)}, back[2];
        int          n = 0;
        of->failures += hs_dynamic_insert(of->list, own, x, NULL) != HS_OK;
        of->failures += hs_dynamic_position(of->list, own, back) != HS_OK || back[0] != x[0];
        fixed_position((int64_t)(random_bits(&random) % LASTING), x);
        of->failures +=
            hs_dynamic_within(of->list, x, 1.0, false, count_fixed, &n, NULL) != HS_OK || n != 5;
        if (round % 3 == 0)
            of->failures += !hs_dynamic_remove(of->list, own);
        if (round % 100 == 99)
            of->failures += hs_dynamic_shrink_to_fit(of->list) != HS_OK;
    }
    return (hs_thread_result)0;
}

static void
queries_and_changes_take_turns(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{10, 0}, {0, 10}}};
    for (int storage = 0; storage < 3; storage++) {
        hs_dynamic_options options = hs_dynamic_options_default();
        task               tasks[THREADS];
        hs_thread          threads[THREADS];
        hs_dynamic        *list = NULL;
        options.ndim = 2;
        options.box = &box;
        options.storage = (hs_storage)storage;
        CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
        for (int64_t id = 0; id < LASTING; id++) {
            double x[2];
            fixed_position(id, x);
            CHECK(hs_dynamic_insert(list, (hs_key){id, 0}, x, NULL) == HS_OK);
        }
        for (int t = 0; t < THREADS; t++) {
            tasks[t] = (task){.list = list, .first = 1000 * (t + 1)};
            CHECK(hs_thread_start(&threads[t], ask_and_change, &tasks[t]));
        }
        for (int t = 0; t < THREADS; t++) {
            hs_thread_join(threads[t]);
            CHECK(tasks[t].failures == 0);
        }
        hs_dynamic_free(list);
    }
}

static hs_thread_result HS_THREAD_CALL
insert_one(void *context)
{
    hs_dynamic *list = context;
    hs_dynamic_release(list); /* not held by this thread: nothing happens */
    CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, (double[]){1.0, 1.0, 1.0}, NULL) == HS_OK);
    return (hs_thread_result)0;
}

/* The holder changes and asks meanwhile; what another thread does comes after all of it. */
static void
who_holds_a_list_keeps_others_out(void)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    hs_thread          other;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    hs_dynamic_hold(list);
    hs_dynamic_hold(list); /* once is enough */
    CHECK(hs_thread_start(&other, insert_one, list));
    while (hs_atomic_load(&hs_n_waiting) == 0)
        hs_nap();
    for (int64_t id = 2; id < 40; id++) {
        CHECK(hs_dynamic_insert(list, (hs_key){id, 0}, (double[]){0.0, 0.0, 0.0}, NULL) == HS_OK);
        CHECK(hs_dynamic_length(list) == id - 1 && !hs_dynamic_has(list, (hs_key){1, 0}));
    }
    hs_dynamic_release(list);
    hs_thread_join(other);
    CHECK(hs_dynamic_has(list, (hs_key){1, 0}) && list->gate.state == hs_n_forks << 32);
    hs_dynamic_free(list);
}

static bool
never(void *user, double fraction)
{
    int *polls = user;
    CHECK(fraction == 0.0);
    ++*polls;
    return false;
}

static int
go_on(hs_key key, const double *position, const int64_t *shift, void *user)
{
    (void)key;
    (void)position;
    (void)shift;
    (void)user;
    return 0;
}

/* Through images, through cells, and through the points of one cell. */
static void
polls_end_long_queries(void)
{
    const hs_box           box = {.ndim = 2, .periodic = {true}, .rows = {{1.0, 0.0}, {0.0, 1.0}}};
    const double           centre[2] = {0.5, 0.5};
    const hs_dynamic_hooks hooks = {.poll = never};
    for (int storage = 0; storage < 3; storage++) {
        hs_dynamic_options options = hs_dynamic_options_default();
        hs_dynamic        *list = NULL;
        int                polls = 0;
        options.ndim = 2;
        options.box = &box;
        options.storage = (hs_storage)storage;
        options.max_radius = 200000.0;
        CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
        CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, centre, NULL) == HS_OK);
        hs_dynamic_hook(list, &hooks);
        CHECK(hs_dynamic_within(list, centre, 200000.0, false, go_on, &polls, NULL) ==
              HS_ERR_INTERRUPTED);
        CHECK(polls == 1);
        CHECK(hs_dynamic_near(list, centre, 200000.0, go_on, &polls, NULL) == HS_OK && polls == 1);
        hs_dynamic_hook(list, NULL);
        CHECK(hs_dynamic_within(list, centre, 200000.0, false, go_on, &polls, NULL) == HS_OK);
        CHECK(polls == 1);
        hs_dynamic_free(list);
    }
    hs_dynamic_hook(NULL, &hooks);
}

void
test_dynamic_threads(void)
{
    RUN(who_holds_a_list_keeps_others_out);
    RUN(polls_end_long_queries);
    RUN(queries_and_changes_take_turns);
}
