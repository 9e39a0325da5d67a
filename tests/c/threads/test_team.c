/* SPDX-License-Identifier: BSD-3-Clause */
/* test_team.c: every task is done once, by as many threads as there are; sorting with a team gives
 * the same bits as sorting without. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <signal.h>
#endif
#include <math.h>

#include "../../../csrc/core/cells/bins.h"
#include "../../../csrc/core/threads/passes.h"
#include "../support/harness.h"

void test_team(void);

#define TASKS 5000

typedef struct tally {
    int  done[TASKS];
    bool rounds_to_nearest[TASKS];
    bool signals_right[TASKS];
#if !defined(_WIN32)
    pthread_t caller;
#endif
} tally;

static volatile double one = 1.0, tiny = 0x1p-60;

static void
do_task(void *context, int64_t task)
{
    tally *counts = context;
    counts->done[task]++;
    counts->rounds_to_nearest[task] = one + tiny == 1.0 && one - tiny == 1.0;
#if !defined(_WIN32)
    sigset_t blocked;
    (void)pthread_sigmask(SIG_BLOCK, NULL, &blocked);
    const bool is_caller = pthread_equal(pthread_self(), counts->caller) != 0;
    counts->signals_right[task] = (sigismember(&blocked, SIGINT) == 1) != is_caller;
#endif
}

static void
every_task_is_done_once(void)
{
    static tally counts;
    for (int n_threads = 0; n_threads <= 9; n_threads++) {
        hs_team *team = hs_team_create(n_threads);
        CHECK(hs_team_size(team) == (n_threads > 1 ? n_threads : 1));
        CHECK((team == NULL) == (n_threads <= 1));
        for (int job = 0; job < 50; job++) {
            const int64_t n_tasks = job % 7 == 0 ? TASKS : job % 5;
            bool          right = true;
            memset(&counts, 0, sizeof counts);
            hs_team_run(team, n_tasks, do_task, &counts);
            for (int64_t task = 0; task < TASKS; task++) {
                right = right && counts.done[task] == (task < n_tasks);
                right = right && (task >= n_tasks || counts.rounds_to_nearest[task]);
            }
            CHECK(right);
        }
        hs_team_free(team);
    }
}

static void
a_team_may_end_without_work(void)
{
    for (int trial = 0; trial < 200; trial++) {
        hs_team_free(hs_team_create(1 + trial % 8));
    }
    hs_team_free(NULL);
}

#if !defined(_WIN32)
/* Tasks of the caller's own thread see its mask; those of the others see every signal blocked. */
static void
signals_go_to_the_caller(void)
{
    static tally counts;
    sigset_t     mine;
    hs_team     *team = hs_team_create(4);
    counts.caller = pthread_self();
    hs_team_run(team, TASKS, do_task, &counts);
    hs_team_free(team);
    (void)pthread_sigmask(SIG_BLOCK, NULL, &mine);
    CHECK(sigismember(&mine, SIGINT) == 0);
    for (int64_t task = 0; task < TASKS; task++) {
        CHECK(counts.done[task] == 1 && counts.signals_right[task]);
    }
}
#endif

typedef struct pass_record {
    int64_t times[HS_SLABS];
    int64_t failing; /* point whose slab fails */
    int64_t seen;    /* points, by one thread */
} pass_record;

static hs_status
record_slab(void *context, int slab, int64_t first, int64_t last)
{
    pass_record *record = context;
    CHECK(slab >= 0 && slab < HS_SLABS && first <= last);
    record->times[slab] += last - first;
    record->seen += last - first;
    return record->failing >= first && record->failing < last ? HS_ERR_SHIFT_RANGE : HS_OK;
}

static bool
count_poll(void *context, double fraction)
{
    (void)fraction;
    return --*(int64_t *)context != 0;
}

static void
passes_cover_all_points_and_poll(void)
{
    static const int64_t sizes[] = {0,
                                    1,
                                    HS_SLAB_POINTS,
                                    HS_POLL_POINTS - 1,
                                    HS_POLL_POINTS,
                                    HS_POLL_POINTS + 1,
                                    5 * HS_POLL_POINTS + 12345};
    for (int s = 0; s < 7; s++) {
        for (int n_strips = 0; n_strips <= 5; n_strips++) {
            const int64_t n = sizes[s];
            int64_t       polls = -1; /* counts down: never 0 */
            hs_options    options = {.poll = count_poll, .poll_context = &polls};
            pass_record   record = {.failing = -1};
            hs_status     status;
            if (n_strips == 0) {
                status = hs_walk_slabs(NULL, &options, n, record_slab, &record);
            } else {
                status = hs_walk_strips(NULL, &options, n, n_strips, record_slab, &record);
            }
            CHECK(status == HS_OK && record.seen == n);
            CHECK(-1 - polls == n / HS_POLL_POINTS);
            polls = 2; /* the second stops */
            record = (pass_record){.failing = -1};
            status = hs_walk_slabs(NULL, &options, n, record_slab, &record);
            CHECK((status == HS_ERR_INTERRUPTED) == (n >= 2 * HS_POLL_POINTS));
            record = (pass_record){.failing = n / 2};
            polls = -1;
            status = hs_walk_slabs(NULL, &options, n, record_slab, &record);
            CHECK(status == (n > 0 ? HS_ERR_SHIFT_RANGE : HS_OK));
        }
    }
}

enum { MANY = 300000 };

typedef struct sorted_scene {
    hs_account account;
    hs_scene   scene;
    hs_grid    grid;
    hs_bins    bins;
} sorted_scene;

static void
sort_many(hs_team *team, const hs_points *points, const hs_box *box, const hs_options *options,
          sorted_scene *s)
{
    hs_failure failure;
    hs_account_init(&s->account, options);
    CHECK(hs_scene_init(&s->account, team, points, box, options, &s->scene, &failure) == HS_OK);
    CHECK(hs_grid_init(&s->scene, &s->grid, &failure) == HS_OK);
    CHECK(hs_bins_build(&s->account, team, options, &s->scene, &s->grid, &s->bins) == HS_OK);
}

static void
check_same(const sorted_scene *a, const sorted_scene *b)
{
    const size_t n = (size_t)a->bins.n;
    CHECK(a->grid.n_cells == b->grid.n_cells && a->grid.n_cells > 1000);
    CHECK(memcmp(a->scene.x_largest, b->scene.x_largest, sizeof a->scene.x_largest) == 0);
    CHECK(memcmp(a->bins.order, b->bins.order, n * sizeof(int32_t)) == 0);
    CHECK(memcmp(a->bins.start, b->bins.start, (size_t)(a->grid.n_cells + 1) * sizeof(int32_t)) ==
          0);
    CHECK(a->bins.keeps_originals == b->bins.keeps_originals);
    CHECK(a->bins.turns.known == b->bins.turns.known);
    for (int k = 0; k < a->bins.ndim; k++) {
        CHECK(memcmp(a->bins.x[k], b->bins.x[k], n * sizeof(double)) == 0);
        CHECK(!a->bins.keeps_originals ||
              memcmp(a->bins.originals[k], b->bins.originals[k], n * sizeof(double)) == 0);
        for (size_t i = 0; a->bins.turns.known && i < n; i += 7) {
            CHECK(hs_turns_get(&a->bins.turns, k, (int64_t)i) ==
                  hs_turns_get(&b->bins.turns, k, (int64_t)i));
        }
    }
}

static void
sorting_does_not_depend_on_the_team(void)
{
    harness_random random = {2357};
    double        *x = malloc(3 * MANY * sizeof *x);
    for (int64_t e = 0; e < 3 * MANY; e++) {
        x[e] = 100.0 * random_unit(&random);
    }
    const hs_points points = {
        .data = x, .n = MANY, .ndim = 3, .real = HS_FLOAT64, .row_stride = 24, .column_stride = 8};
    for (int trial = 0; trial < 4; trial++) {
        hs_box box = {.ndim = 3,
                      .periodic = {true, true, true},
                      .rows = {{100.0}, {0.0, 97.0}, {0.0, 0.0, 61.0}}};
        box.rows[2][0] = trial % 2 ? 31.0 : 0.0;
        hs_options options = hs_options_default();
        options.cutoff = 2.5;
        options.want = trial > 1 ? HS_WANT_SHIFT : HS_WANT_I;
        static sorted_scene alone, together;
        hs_team            *team = hs_team_create(2 + trial);
        sort_many(NULL, &points, &box, &options, &alone);
        sort_many(team, &points, &box, &options, &together);
        check_same(&alone, &together);
        hs_team_free(team);
        CHECK(together.account.total.bytes_peak <=
              (together.bins.keeps_originals ? 76 : 56) * (int64_t)MANY);
        CHECK(alone.account.total.bytes_peak <=
              (alone.bins.keeps_originals ? 74 : 50) * (int64_t)MANY);
        hs_bins_free(&alone.account, &alone.bins);
        hs_bins_free(&together.account, &together.bins);
        CHECK(alone.account.held == 0 && together.account.held == 0);
    }
    free(x);
}

void
test_team(void)
{
    RUN(every_task_is_done_once);
    RUN(a_team_may_end_without_work);
#if !defined(_WIN32)
    RUN(signals_go_to_the_caller);
#endif
    RUN(passes_cover_all_points_and_poll);
    RUN(sorting_does_not_depend_on_the_team);
}
