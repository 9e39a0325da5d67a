/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_parallel.c: the same answer by any number of threads, to the last bit and in the same order;
 * and whatever goes wrong meanwhile, the call comes to an end and leaves nothing behind.
 */
#include "../../../csrc/core/base/want.h"
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/threads/team.h"
#include "../support/output_checks.h"
#include "../support/random_scenes.h"
#include "../support/thread_limit.h"
#include "../support/among.h"

void test_parallel(void);

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

/* Into arrays of the caller: the room that is needed, or less. */
static void
check_out(hs_options options, const hs_pairs *expected, int64_t room)
{
    const hs_points points = points_of(&scene);
    const int64_t   n = hs_pairs_length(expected);
    hs_pairs       *pairs = NULL;
    hs_failure      failure;
    caller_arrays   c;
    make_arrays(options.want, scene.ndim, options.index_bytes, room, &c);
    options.out = &c.arrays;
    const hs_status status = hs_pairs_find(AMONG(&points, scene.box), &options, &pairs, &failure);
    if (room < n) {
        CHECK(status == HS_ERR_CAPACITY && failure.expected_pairs == (double)n);
        CHECK(untouched_from(&c, room));
    } else {
        CHECK(status == HS_OK && hs_pairs_length(pairs) == n);
        CHECK(same_as_result(&c, expected, n) && untouched_from(&c, n));
    }
    hs_pairs_free(pairs);
    free_arrays(&c);
}

static void
check_crowd(hs_options options)
{
    const hs_points points = points_of(&scene);
    options.threads = 1;
    hs_pairs     *alone = find(&options);
    const int64_t n = hs_pairs_length(alone);
    for (int threads = 2; threads <= MOST_THREADS; threads++) {
        int64_t count = -1;
        options.threads = threads;
        hs_pairs *together = find(&options);
        CHECK(same_pairs(&options, alone, together));
        hs_pairs_free(together);
        check_out(options, alone, n);
        if (n > 0) {
            check_out(options, alone, threads % 2 ? n - 1 : n / 3);
        }
        CHECK(hs_pairs_count(AMONG(&points, scene.box), &options, &count, NULL) == HS_OK &&
              count == n);
    }
    hs_pairs_free(alone);
}

static void
any_number_of_threads_finds_the_same(void)
{
    for (int kind = 0; kind < CROWDS; kind++) {
        hs_options options = options_of(make_crowd(kind));
        for (int variant = 0; variant < 4; variant += IS_SLOW ? 3 : 1) {
            options.sorted = variant & 1;
            options.want = variant & 2 ? WANT_EVERYTHING : HS_WANT_I | HS_WANT_J;
            options.index_bytes = variant == 3 ? 4 : 8;
            check_crowd(options);
        }
    }
}

static void
every_quantity_is_the_same(void)
{
    hs_options options = options_of(make_crowd(CROWD_TRICLINIC));
    for (unsigned want = 0; want <= HS_WANT_ALL; want += IS_SLOW ? 9 : 1) {
        options.want = want;
        options.sorted = want / 5 % 2;
        options.threads = 1;
        hs_pairs *alone = find(&options);
        options.threads = 2 + (int)want % 4;
        hs_pairs *together = find(&options);
        CHECK(same_pairs(&options, alone, together));
        hs_pairs_free(together);
        hs_pairs_free(alone);
    }
}

/* What was done is counted in full, whoever did it. */
static void
counters_do_not_depend_on_threads(void)
{
    for (int kind = 0; kind < CROWDS; kind++) {
        hs_options  options = options_of(make_crowd(kind));
        hs_counters alone, together;
        options.counters = &alone;
        hs_pairs_free(find(&options));
        options.counters = &together;
        options.threads = 4;
        hs_pairs_free(find(&options));
        CHECK(alone.groups == together.groups && alone.candidates == together.candidates);
        CHECK(alone.pairs == together.pairs && alone.ambiguous == together.ambiguous);
        CHECK(alone.by_float64 == together.by_float64);
        CHECK(alone.by_double_word == together.by_double_word);
        CHECK(alone.by_integers == together.by_integers);
    }
}

/* ---- interrupts ---- */

static bool
poll_until(void *context, double fraction)
{
    int64_t *left = context;
    CHECK(fraction >= 0.0 && fraction <= 1.0);
    return --*left > 0;
}

/* Points and candidates enough that the caller is asked a few times, however fast the others. */
static void
an_interrupt_ends_all_threads(void)
{
    const hs_points points = (make_crowd(CROWD_OPEN), points_of(&scene));
    hs_options      options = options_of(&scene);
    int             interrupted = 0;
    options.cutoff = IS_SLOW ? 0.8 : 0.35;
    options.want = HS_WANT_BOTH;
    options.index_bytes = 4;
    options.poll = poll_until;
    for (int trial = 0; trial < 24; trial++) {
        const int64_t before = hs_test_live_blocks();
        int64_t       left = 1 + trial / 3, count = -1;
        hs_pairs     *pairs = NULL;
        options.threads = 1 + trial % MOST_THREADS;
        options.sorted = trial % 3 == 1;
        options.poll_context = &left;
        const hs_status status = trial % 3 == 2
                                     ? hs_pairs_count(AMONG(&points, NULL), &options, &count, NULL)
                                     : hs_pairs_find(AMONG(&points, NULL), &options, &pairs, NULL);
        CHECK(status == (left <= 0 ? HS_ERR_INTERRUPTED : HS_OK) && left >= 0);
        CHECK((pairs != NULL) == (status == HS_OK && trial % 3 != 2));
        CHECK((count == -1) == (status != HS_OK || trial % 3 != 2));
        interrupted += status == HS_ERR_INTERRUPTED;
        hs_pairs_free(pairs);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(interrupted >= (IS_SLOW ? 3 : 6));
}

/* ---- failures ---- */

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
        for (int variant = 0; variant < 4; variant += IS_SLOW ? 3 : 1) {
            caller_arrays c = {.room = 0};
            options.want = variant & 1 ? WANT_EVERYTHING : HS_WANT_I | HS_WANT_J;
            options.sorted = variant & 2;
            options.threads = 3;
            options.out = NULL;
            hs_pairs *expected = find(&options);
            CHECK(fail_each(&options, expected, 1 + variant % 3) > 20);
            make_arrays(options.want, 3, 8, hs_pairs_length(expected), &c);
            options.out = &c.arrays;
            CHECK(fail_each(&options, expected, 1 + (variant + 1) % 3) > 20);
            free_arrays(&c);
            hs_pairs_free(expected);
        }
    }
}

/* A limit that the result passes, when some threads wait for their turn and others write. */
static void
a_memory_limit_ends_all_threads(void)
{
    const hs_points points = (make_crowd(CROWD_UNEVEN), points_of(&scene));
    hs_options      options = options_of(&scene);
    int             refused = 0;
    options.cutoff = 0.2;
    options.want = WANT_EVERYTHING;
    for (int trial = 0; trial < 40; trial += IS_SLOW ? 3 : 1) {
        const int64_t before = hs_test_live_blocks();
        hs_pairs     *pairs = NULL;
        options.threads = 2 + trial % 4;
        options.memory_limit = ldexp(1.0, 14 + trial / 2);
        const hs_status status = hs_pairs_find(AMONG(&points, NULL), &options, &pairs, NULL);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        refused += status == HS_ERR_MEMORY;
        hs_pairs_free(pairs);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(refused > (IS_SLOW ? 3 : 10) && refused < (IS_SLOW ? 14 : 40));
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

void
test_parallel(void)
{
    RUN(any_number_of_threads_finds_the_same);
    RUN(every_quantity_is_the_same);
    RUN(counters_do_not_depend_on_threads);
    RUN(an_interrupt_ends_all_threads);
    RUN(a_failing_allocation_ends_all_threads);
    RUN(a_memory_limit_ends_all_threads);
#if HAS_THREAD_LIMIT
    RUN(fewer_threads_find_the_same);
#endif
}
