/* SPDX-License-Identifier: BSD-3-Clause */
/* test_parallel.c: the same answer by any number of threads, to the last bit and in the same
 * order; whatever goes wrong, a call comes to an end and leaves nothing. */
#include "../../../csrc/core/collect/parallel.h"
#include "../../../csrc/core/memory/memory.h"
#include "../../../csrc/core/threads/call.h"
#include "../support/among.h"
#include "../support/output_checks.h"
#include "../support/search_unit.h"

#include <math.h>

void test_parallel(void);

/* ---- a system that starts only so many threads ---- */

#if defined(__linux__)
#define HAS_THREAD_LIMIT 1

#include <errno.h>
#include <pthread.h>

int __real_pthread_create(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
int __wrap_pthread_create(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);

static int threads_left = -1;

/* So many more can be started; -1: as many as the system likes. */
static inline void
limit_threads(int n)
{
    threads_left = n;
}

int
__wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *),
                      void *context)
{
    if (threads_left == 0) {
        return EAGAIN;
    }
    threads_left -= threads_left > 0;
    return __real_pthread_create(thread, attributes, run, context);
}

#else
#define HAS_THREAD_LIMIT 0
#endif

/* ---- the same answer by any number of threads, to the last bit and in the same order ---- */

enum {
    MOST_THREADS = IS_SLOW ? 3 : 5,
    MOST_POINTS = IS_SLOW ? 2000 : 6000,
    WANT_EVERYTHING = WANT_ALL | HS_WANT_BOTH
};

/* A range has at least 256 points (parallel.c): these make many ranges. */
typedef enum crowd {
    CROWD_OPEN,
    CROWD_PERIODIC,
    CROWD_TRICLINIC,
    CROWD_SPARSE,   /* clusters a long way apart: cells that are not stored unless occupied */
    CROWD_IMAGES,   /* a cutoff of several periods */
    CROWD_ONE_SPOT, /* all points in one place: no range but the first has pairs to speak of */
    CROWD_UNEVEN,   /* nearly all pairs in one corner */
    CROWD_EMPTY,    /* pairs there are none */
    CROWDS
} crowd;

static double      places[3 * MOST_POINTS];
static hs_box      walls;
static brute_scene scene;

static void
set_crowd(int n, double cutoff, const hs_box *box)
{
    scene = (brute_scene){
        .ndim = 3, .n = n, .x = places, .box = box, .cutoff = cutoff, .inclusive = true};
}

/* Two clusters, 1e9 apart. */
static void
spread_clusters(int n)
{
    for (int e = 0; e < 3 * n; e++) {
        places[e] += e / 3 % 2 ? 1e9 : 0.0;
    }
}

static const brute_scene *
make_crowd(crowd kind)
{
    harness_random random = {4242};
    const int      n = kind == CROWD_IMAGES ? 1500 : kind == CROWD_ONE_SPOT ? 400 : MOST_POINTS;
    for (int e = 0; e < 3 * n; e++) {
        const double u = random_unit(&random);
        places[e] = kind == CROWD_ONE_SPOT ? 0.25 : kind == CROWD_UNEVEN ? u * u * u : u;
    }
    walls = (hs_box){
        .ndim = 3, .periodic = {true, true, true}, .rows = {{1.0}, {0.0, 1.0}, {0.0, 0.0, 1.0}}};
    set_crowd(n, 0.1,
              kind == CROWD_PERIODIC || kind == CROWD_TRICLINIC || kind == CROWD_IMAGES ? &walls
                                                                                        : NULL);
    if (kind == CROWD_TRICLINIC) {
        walls.rows[1][0] = 0.3;
        walls.rows[2][0] = -0.4;
        walls.rows[2][1] = 1.7;
    } else if (kind == CROWD_SPARSE) {
        spread_clusters(n);
    } else if (kind == CROWD_IMAGES) {
        walls.rows[0][0] = walls.rows[1][1] = walls.rows[2][2] = 10.0;
        walls.rows[2][2] = 0.01;
        scene.cutoff = 0.04;
    } else if (kind == CROWD_EMPTY) {
        scene.cutoff = 1e-9;
    }
    return &scene;
}

static hs_pairs *
find(const hs_options *options)
{
    const hs_points points = points_of(&scene);
    hs_pairs       *pairs = NULL;
    CHECK(hs_pairs_find(AMONG(&points, scene.box), options, &pairs, NULL) == HS_OK);
    return pairs;
}

static bool
same_pairs(const hs_options *options, const hs_pairs *a, const hs_pairs *b)
{
    const int64_t n = hs_pairs_length(a);
    bool          same = n == hs_pairs_length(b);
    size_t        width[N_QUANTITIES];
    set_width(options->want, scene.ndim, options->index_bytes, width);
    for (int k = 0; same && k < N_QUANTITIES; k++) {
        same = width[k] == 0 || memcmp(hs_pairs_array(a, 1u << k), hs_pairs_array(b, 1u << k),
                                       (size_t)n * width[k]) == 0;
    }
    return same;
}

/* ---- interrupts and failures ---- */

/* Lets every third allocation fail, from `first` on, which differs from call to call. Which one
 * that is depends on which thread comes first; a search that gets on without it must give the same
 * pairs. */
static int
fail_each(const hs_options *options, const hs_pairs *expected, int first)
{
    const hs_points points = points_of(&scene);
    bool            ended = false;
    int             nth = first;
    while (!ended && nth < 400) {
        const int64_t before = hs_test_live_blocks();
        hs_pairs     *pairs = NULL;
        hs_test_fail_allocation(nth);
        const hs_status status = hs_pairs_find(AMONG(&points, scene.box), options, &pairs, NULL);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || (status == HS_ERR_MEMORY && !ended));
        CHECK((status == HS_OK) == (pairs != NULL));
        CHECK(pairs == NULL || options->out != NULL || same_pairs(options, expected, pairs));
        hs_pairs_free(pairs);
        CHECK(hs_test_live_blocks() == before);
        nth += IS_SLOW ? 5 : 3;
    }
    CHECK(ended);
    return nth;
}

static void
a_failing_allocation_ends_all_threads(void)
{
    for (int kind = 0; kind < CROWDS; kind++) {
        hs_options options = options_of(make_crowd(kind));
        for (int variant = IS_SLOW ? kind % 4 : 0; variant < 4; variant += IS_SLOW ? 4 : 1) {
            caller_arrays c = {.room = 0};
            options.want = variant & 1 ? WANT_EVERYTHING : HS_WANT_I | HS_WANT_J;
            options.sorted = variant & 2;
            options.threads = 3;
            options.out = NULL;
            hs_pairs *expected = find(&options);
            CHECK(fail_each(&options, expected, 1 + variant % 3) > 15);
            make_arrays(options.want, 3, 8, hs_pairs_length(expected), &c);
            options.out = &c.arrays;
            CHECK(fail_each(&options, expected, 1 + (variant + 1) % 3) > 15);
            free_arrays(&c);
            hs_pairs_free(expected);
        }
    }
}

#if HAS_THREAD_LIMIT
/* Where the system refuses threads the others do their work. */
static void
fewer_threads_find_the_same(void)
{
    hs_options options = options_of(make_crowd(CROWD_PERIODIC));
    options.want = WANT_EVERYTHING;
    hs_pairs     *alone = find(&options);
    const int64_t before = hs_test_live_blocks();
    options.threads = MOST_THREADS;
    for (int started = 0; started < MOST_THREADS; started++) {
        limit_threads(started);
        hs_team *team = hs_team_create(MOST_THREADS);
        CHECK(hs_team_size(team) == started + 1 && (team == NULL) == (started == 0));
        hs_team_free(team);
        limit_threads(started);
        hs_pairs *together = find(&options);
        limit_threads(-1);
        CHECK(same_pairs(&options, alone, together));
        hs_pairs_free(together);
        CHECK(hs_test_live_blocks() == before);
    }
    hs_pairs_free(alone);
}

#endif

/*
 * ---- parallel memory ----
 *
 * A search that is left half way needs room to the last pair that it leaves with: with one byte
 * less it fails, and takes nothing with it.
 */

enum { N = 2000, ENOUGH = 200000 };

static search_unit unit;

/* Records some pairs, with so much memory beyond what is held, and returns how many. */
static hs_status
record(double room, int64_t *n_pairs)
{
    hs_search    *search = &unit.search;
    hs_bookmark   bookmark = {.point = 0};
    hs_failure    failure = HS_NO_FAILURE;
    hs_output     pairs;
    const int64_t held = search->call->account.held;
    search->call->account.limit = (double)held + room;
    hs_output_init(&search->call->account, 2, HS_WANT_I | HS_WANT_J, 8, &pairs);
    const hs_status status = hs_parallel_record_on(search, &pairs, ENOUGH, &bookmark, &failure);
    CHECK((bookmark.point > 0 || bookmark.blocks > 0) == (status == HS_OK));
    CHECK(bookmark.point < N);
    *n_pairs = pairs.n_pairs;
    hs_output_free(&pairs);
    CHECK(search->call->account.held == held);
    return status;
}

static void
the_last_pairs_need_their_room(void)
{
    int64_t n_pairs, n_all;
    double  low = 0.0, high = 0x1p30;
    search_unit_points(3, N, 2, 1.0, &unit);
    search_unit_open(NULL, 2.0, false, HS_WANT_I | HS_WANT_J, &unit);
    CHECK(record(high, &n_all) == HS_OK && n_all >= ENOUGH && n_all < N * (N - 1) / 2);
    while (high - low > 1.0) {
        const double    middle = floor(0.5 * (low + high));
        const hs_status status = record(middle, &n_pairs);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        CHECK(status != HS_OK || n_pairs == n_all);
        if (status == HS_OK)
            high = middle;
        else
            low = middle;
    }
    CHECK(high >= 16.0 * (double)n_all);
    CHECK(record(low, &n_pairs) == HS_ERR_MEMORY && n_pairs < n_all && n_pairs > 0);
    search_unit_close(&unit);
}

void
test_parallel(void)
{
    RUN(a_failing_allocation_ends_all_threads);
#if HAS_THREAD_LIMIT
    RUN(fewer_threads_find_the_same);
#endif
    RUN(the_last_pairs_need_their_room);
}
