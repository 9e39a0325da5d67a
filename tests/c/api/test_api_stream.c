/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_stream.c: streams and visits give the pairs of a search, in blocks. */
#include "../../../csrc/core/threads/call.h"
#include "../support/among.h"
#include "../support/block_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"

#include <fenv.h>

void test_api_stream(void);

/* ---- blocks are the pairs of one search, cut up, whoever looks for them ---- */

static double *
random_points(int64_t n, int ndim, double size)
{
    harness_random random = {77};
    double        *x = array_of(n * ndim, sizeof *x);
    for (int64_t e = 0; e < n * ndim; e++) {
        x[e] = size * random_unit(&random);
    }
    return x;
}

/* A hs_poll_fn: false once its count is down. */
static bool
count_down(void *context, double fraction)
{
    int *left = context;
    CHECK(fraction >= 0.0 && fraction <= 1.0);
    return (*left)-- != 0;
}

/* A call that was interrupted left everything as it was. */
static void
interrupted_calls_can_be_made_again(void)
{
    const int         n = IS_SLOW ? 3200 : 4000;
    double           *x = random_points(n, 2, 1.0);
    const brute_scene scene = {.ndim = 2, .n = n, .x = x, .inclusive = true, .cutoff = 2.0};
    const hs_points   points = points_of(&scene);
    hs_options        options = options_of(&scene);
    hs_pairs         *whole = NULL, *block = NULL;
    hs_stream        *stream = NULL;
    int64_t           at = 0;
    int               interruptions = 0;
    options.want = WANT_ALL;
    options.threads = 2;
    CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &whole, NULL) == HS_OK);
    CHECK(hs_stream_open(AMONG(&points, NULL), &options, 3000000, &stream, NULL) == HS_OK);
    for (int patience = 0;; patience++) {
        int             left = patience % 4 == 3 ? -1 : patience % 4;
        const hs_status status = hs_stream_next(stream, count_down, &left, &block, NULL);
        CHECK(status == HS_OK || (status == HS_ERR_INTERRUPTED && block == NULL));
        interruptions += status == HS_ERR_INTERRUPTED;
        if (status == HS_OK && block == NULL) {
            break;
        }
        if (status == HS_OK) {
            CHECK(block_matches(whole, block, at, 2));
            at += hs_pairs_length(block);
            hs_pairs_free(block);
        }
    }
    CHECK(at == hs_pairs_length(whole) && interruptions > 2);
    hs_stream_free(stream);
    hs_pairs_free(whole);
    free(x);
}

/* ---- a function sees the pairs of one search, each once, and may end it ---- */

/* What a function compares the pairs with that it sees; by one thread. */
typedef struct seen {
    const hs_pairs *whole; /* or NULL */
    int             ndim;
    int64_t         n;
    int64_t         stop_at;   /* ends the search with this pair; 0: never */
    bool            rounds_up; /* sets the rounding of floats */
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
        CHECK(!(square > 0x1p-900 && square < 0x1p1000) || s->rounds_up || sqrt(d2) == d);
    }
    if (s->rounds_up) {
        fesetround(FE_UPWARD);
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
    seen            s = {.ndim = scene->ndim, .rounds_up = threads > 1};
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
    fesetround(FE_TONEAREST);
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
random_points_visit(int64_t n, int ndim)
{
    harness_random random = {78};
    double        *x = array_of(n * ndim, sizeof *x);
    for (int64_t e = 0; e < n * ndim; e++) {
        x[e] = random_unit(&random);
    }
    return x;
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
    lone_visit of = {.among = *AMONG(&points, NULL), .threads = threads};
    return fail_each_allocation(visit_alone, &of, 1000);
}

/* Where one thread calls the function, others make the points ready, if these are many. */
static void
threads_are_started_where_points_are_made_ready(void)
{
    enum { MANY = 200 };
    double           *x = random_points_visit(MANY, 3);
    const brute_scene scene = {.ndim = 3, .n = MANY, .x = x};
    const hs_points   points = points_of(&scene);
    lone_visit        of_none = {.threads = 2};
    hs_test_worth_threads = MANY / HS_POINTS_MADE_READY;
    CHECK(allocations_of(points, MANY - 1, 2) == allocations_of(points, MANY - 1, 1));
    CHECK(allocations_of(points, MANY, 2) == allocations_of(points, MANY, 1) + 1);
    hs_test_worth_threads = 0.0;
    CHECK(visit_alone(&of_none) == HS_ERR_ARGUMENT); /* among nothing */
    free(x);
}

void
test_api_stream(void)
{
    RUN(interrupted_calls_can_be_made_again);
    RUN(a_function_sees_the_pairs_in_their_order);
    RUN(threads_are_started_where_points_are_made_ready);
}
