/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_visit.c: a function sees the pairs of one search, each once, and may end it. */
#include "../support/block_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

#include "../../../csrc/core/threads/call.h"
#include "../support/poll_checks.h"

#include <fenv.h>

void test_api_visit(void);

/* What a function compares the pairs with that it sees; by one thread. */
typedef struct seen {
    const hs_pairs *whole; /* or NULL */
    int             ndim;
    int64_t         n;
    int64_t         stop_at; /* ends the search with this pair; 0: never */
} seen;

static int
see_pair(int64_t i, int64_t j, const int32_t *S, const double *D, double d2, void *user)
{
    seen *s = user;
    if (s->whole != NULL) {
        const double d = ((const double *)hs_pairs_array(s->whole, HS_WANT_DISTANCE))[s->n];
        const double square = d * d;
        CHECK(s->n < hs_pairs_length(s->whole));
        CHECK(same_part(s->whole, HS_WANT_I, 8, s->n, &i, 1));
        CHECK(same_part(s->whole, HS_WANT_J, 8, s->n, &j, 1));
        CHECK(same_part(s->whole, HS_WANT_VECTOR, 8 * (size_t)s->ndim, s->n, D, 1));
        CHECK(same_part(s->whole, HS_WANT_SHIFT, 4 * (size_t)s->ndim, s->n, S, 1));
        CHECK(d2 == square);
        CHECK(!(square > 0x1p-900 && square < 0x1p1000) || sqrt(d2) == d);
    }
    return ++s->n == s->stop_at;
}

/* The same of many at a time. */
static int
see_pairs(const hs_pair_arrays *pairs, int64_t n, int64_t *n_taken, void *user)
{
    const int64_t *i = pairs->i, *j = pairs->j;
    const int      ndim = ((const seen *)user)->ndim;
    CHECK(pairs->capacity == n && pairs->index_bytes == 8);
    for (int64_t e = 0; e < n; e++) {
        const double d = pairs->distance[e];
        if (see_pair(i[e], j[e], pairs->shift + e * ndim, pairs->vector + e * ndim, d * d, user)) {
            *n_taken = e + 1;
            return 1;
        }
    }
    return 0;
}

/* Every pair, then only the first ones. */
static void
compare_visit(const brute_scene *scene, int threads, bool many)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    seen            s = {.ndim = scene->ndim};
    hs_visit visit = {.pair = many ? NULL : see_pair, .pairs = many ? see_pairs : NULL, .user = &s};
    hs_pairs *whole = NULL;
    int64_t   n = -1;
    options.want = WANT_ALL;
    options.threads = threads;
    CHECK(hs_pairs_find(AMONG(&points, scene->box), &options, &whole, NULL) == HS_OK);
    s.whole = whole;
    options.want = 0;
    options.sorted = true; /* both ignored */
    CHECK(hs_pairs_visit(AMONG(&points, scene->box), &options, &visit, &n, NULL) == HS_OK);
    CHECK(n == hs_pairs_length(whole) && s.n == n);
    if (n > 0) {
        s.stop_at = 1 + n / 2;
        s.n = 0;
        CHECK(hs_pairs_visit(AMONG(&points, scene->box), &options, &visit, &n, NULL) == HS_OK);
        CHECK(n == s.stop_at && s.n == n);
    }
    hs_pairs_free(whole);
}

static void
a_function_sees_the_pairs_in_their_order(void)
{
    harness_random      random = {20261123};
    static random_scene s;
    for (int trial = 0; trial < 360; trial++) {
        const int ndim = 1 + trial / SCENE_KINDS % 5;
        const int n = random_below(&random, ndim <= 3 ? 50 : 10);
        make_scene(&random, trial % SCENE_KINDS, ndim, n, 4.0, trial % 13 ? 0 : 200, &s);
        compare_visit(&s.scene, 1 + trial % 3, trial % 2);
    }
}

static double *
random_points(int64_t n, int ndim)
{
    harness_random random = {78};
    double        *x = array_of(n * ndim, sizeof *x);
    for (int64_t e = 0; e < n * ndim; e++) {
        x[e] = random_unit(&random);
    }
    return x;
}

/* One place for each point, written by whoever sees it as the lower number: no two threads do. */
typedef struct tally {
    int64_t *of;         /* all sums are of j, so that order does not matter */
    int      stop_point; /* ends the search, or -1 */
} tally;

static int
add_up(int64_t i, int64_t j, const int32_t *S, const double *D, double d2, void *user)
{
    tally *t = user;
    (void)S;
    (void)D;
    (void)d2;
    __atomic_fetch_add(&t->of[i], j, __ATOMIC_RELAXED);
    return i == t->stop_point || j == t->stop_point;
}

static void
threads_see_each_pair_once(void)
{
    enum { N = 6000 };
    double           *x = random_points(N, 3);
    const brute_scene scene = {.ndim = 3, .n = N, .x = x, .inclusive = true, .cutoff = 0.2};
    const hs_points   points = points_of(&scene);
    hs_options        options = options_of(&scene);
    int64_t          *sums = array_of(N, sizeof *sums), *again = array_of(N, sizeof *again);
    int64_t           n = 0, m = 0;
    tally             t = {.of = sums, .stop_point = -1};
    hs_visit          visit = {.pair = add_up, .user = &t, .thread_safe = true};
    memset(sums, 0, N * sizeof *sums);
    memset(again, 0, N * sizeof *again);
    CHECK(hs_pairs_visit(AMONG(&points, NULL), &options, &visit, &n, NULL) == HS_OK);
    t.of = again;
    options.threads = 4;
    CHECK(hs_pairs_visit(AMONG(&points, NULL), &options, &visit, &m, NULL) == HS_OK);
    CHECK(n == m && n > 100000 && memcmp(sums, again, N * sizeof *sums) == 0);
    t.stop_point = 17;
    CHECK(hs_pairs_visit(AMONG(&points, NULL), &options, &visit, &m, NULL) == HS_OK);
    CHECK(m > 0 && m < n);
    free(x);
    free(sums);
    free(again);
}

/* Of the arithmetic that is used: fegetround may speak of another one. */
static bool
rounds_to_nearest(void)
{
    const volatile double one = 1.0, tiny = 0x1p-70;
    return one + tiny == one && one - tiny == one;
}

/* What a function searches that is called for pairs of the same. */
typedef struct inner_search {
    const brute_scene *scene;
    int64_t            n_calls;
} inner_search;

/* A function that searches itself, and leaves the rounding as it should not. */
static int
search_again(int64_t i, int64_t j, const int32_t *S, const double *D, double d2, void *user)
{
    inner_search    *inner = user;
    const hs_points  points = points_of(inner->scene);
    const hs_options options = options_of(inner->scene);
    hs_pairs        *pairs = NULL;
    (void)S;
    (void)D;
    (void)d2;
    CHECK(i < j && (inner->n_calls++ > 0 || rounds_to_nearest()));
    CHECK(hs_pairs_find(AMONG(&points, inner->scene->box), &options, &pairs, NULL) == HS_OK);
    CHECK(hs_pairs_length(pairs) > 0);
    hs_pairs_free(pairs);
    fesetround(FE_UPWARD);
    return 0;
}

static void
a_function_may_search_itself(void)
{
    double           *x = random_points(40, 3);
    const brute_scene scene = {.ndim = 3, .n = 40, .x = x, .inclusive = true, .cutoff = 0.5};
    const hs_points   points = points_of(&scene);
    const hs_options  options = options_of(&scene);
    inner_search      inner = {.scene = &scene};
    const hs_visit    visit = {.pair = search_again, .user = &inner};
    int64_t           n = 0, count = 0;
    fesetround(FE_DOWNWARD);
    (void)hs_pairs_visit(AMONG(&points, NULL), &options, &visit, &n, NULL);
    CHECK(!rounds_to_nearest());
    fesetround(FE_TONEAREST);
    CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &count, NULL) == HS_OK && n == count &&
          n > 0);
    free(x);
}

/* A hs_poll_fn. */
static bool
say_no(void *context, double fraction)
{
    (void)fraction;
    ++*(int *)context;
    return false;
}

static void
it_can_be_interrupted(void)
{
    enum { N = 2000 };
    double           *x = random_points(N, 2);
    const brute_scene scene = {.ndim = 2, .n = N, .x = x, .inclusive = true, .cutoff = 2.0};
    const hs_points   points = points_of(&scene);
    hs_options        options = options_of(&scene);
    seen              s = {.ndim = 2};
    const hs_visit    visit = {.pair = see_pair, .user = &s};
    int64_t           n = -1;
    int               polls = 0;
    options.poll = say_no;
    options.poll_context = &polls;
    CHECK(hs_pairs_visit(AMONG(&points, NULL), &options, &visit, &n, NULL) == HS_ERR_INTERRUPTED);
    CHECK(polls == 1 && n == s.n && n > 0 && n < 200000);
    free(x);
}

static void
any_allocation_may_fail(void)
{
    double           *x = random_points(200, 3);
    const brute_scene scene = {.ndim = 3, .n = 200, .x = x, .inclusive = true, .cutoff = 0.5};
    const hs_points   points = points_of(&scene);
    hs_options        options = options_of(&scene);
    const int64_t     before = hs_test_live_blocks();
    bool              ended = false;
    int               failed = 0;
    for (int64_t nth = 1; !ended && nth < 1000; nth++) {
        seen           s = {.ndim = 3};
        const hs_visit visit = {.pair = see_pair, .user = &s};
        int64_t        n = -1;
        options.threads = 1 + (int)(nth % 2);
        hs_test_fail_allocation(nth);
        const hs_status status = hs_pairs_visit(AMONG(&points, NULL), &options, &visit, &n, NULL);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        CHECK(n == s.n);
        failed += status != HS_OK;
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && failed > 10);
    free(x);
}

/* A visit by one thread, whose allocations are counted: a team is one. */
typedef struct lone_visit {
    hs_among among;
    int      threads;
} lone_visit;

static hs_status
visit_alone(void *context)
{
    const lone_visit *of = context;
    seen              s = {.ndim = 3};
    const hs_visit    visit = {.pair = see_pair, .user = &s};
    hs_options        options = hs_options_default();
    int64_t           n = -1;
    options.cutoff = 0.3;
    options.threads = of->threads;
    const hs_status status = hs_pairs_visit(&of->among, &options, &visit, &n, NULL);
    CHECK(n == s.n && (n > 0 || status != HS_OK));
    return status;
}

static int
allocations_of(hs_points points, int64_t n, int threads)
{
    points.n = n;
    lone_visit of = {.among = {.points = &points}, .threads = threads};
    return fail_each_allocation(visit_alone, &of, 1000);
}

/* Where one thread calls the function, others make the points ready, if these are many. */
static void
threads_are_started_where_points_are_made_ready(void)
{
    enum { MANY = 200 };
    double           *x = random_points(MANY, 3);
    const brute_scene scene = {.ndim = 3, .n = MANY, .x = x};
    const hs_points   points = points_of(&scene);
    lone_visit        of_none = {.threads = 2};
    const double      worth = hs_test_worth_threads(MANY / HS_POINTS_MADE_READY);
    CHECK(allocations_of(points, MANY - 1, 2) == allocations_of(points, MANY - 1, 1));
    CHECK(allocations_of(points, MANY, 2) == allocations_of(points, MANY, 1) + 1);
    CHECK(hs_test_worth_threads(worth) == MANY / HS_POINTS_MADE_READY);
    CHECK(visit_alone(&of_none) == HS_ERR_ARGUMENT); /* among nothing */
    free(x);
}

static void
cells_are_visited_too(void)
{
    static random_scene s;
    harness_random      random = {43};
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        hs_cells *cells = NULL;
        hs_pairs *whole = NULL;
        int64_t   n = -1;
        make_scene(&random, kind, 3, 60, 4.0, 0, &s);
        const hs_points points = points_of(&s.scene);
        hs_options      options = options_of(&s.scene);
        CHECK(hs_cells_build(&points, s.scene.box, &options, &cells, NULL) == HS_OK);
        options.want = WANT_ALL;
        options.cutoff *= kind % 2 ? 0.5 : 1.2;
        CHECK(hs_pairs_find(IN_CELLS(cells), &options, &whole, NULL) == HS_OK);
        seen           by = {.ndim = 3, .whole = whole};
        const hs_visit visit = {.pair = see_pair, .user = &by};
        CHECK(hs_pairs_visit(IN_CELLS(cells), &options, &visit, &n, NULL) == HS_OK);
        CHECK(n == hs_pairs_length(whole));
        hs_pairs_free(whole);
        hs_cells_free(cells);
    }
}

void
test_api_visit(void)
{
    RUN(a_function_sees_the_pairs_in_their_order);
    RUN(threads_see_each_pair_once);
    RUN(a_function_may_search_itself);
    RUN(it_can_be_interrupted);
    RUN(any_allocation_may_fail);
    RUN(threads_are_started_where_points_are_made_ready);
    RUN(cells_are_visited_too);
}
