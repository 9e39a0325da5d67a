/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_stream.c: blocks are the pairs of one search, cut up, whoever looks for them. */
#include "../support/block_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

#include "../../../csrc/core/memory/account.h"

void test_api_stream(void);

/* All blocks of the stream, against the pairs of one search. */
static void
check_blocks(hs_stream *stream, const hs_pairs *whole, int64_t max_pairs, int ndim)
{
    const int64_t m = hs_pairs_length(whole);
    int64_t       at = 0;
    hs_pairs     *block = NULL;
    while (hs_stream_next(stream, NULL, NULL, &block, NULL) == HS_OK && block != NULL) {
        const int64_t n = hs_pairs_length(block), left = m - at;
        CHECK(n == (left < max_pairs ? left : max_pairs) && n > 0);
        CHECK(block_matches(whole, block, at, ndim));
        at += n;
        hs_pairs_free(block);
    }
    CHECK(at == m && block == NULL);
    CHECK(hs_stream_next(stream, NULL, NULL, &block, NULL) == HS_OK && block == NULL);
}

static void
compare_stream(const brute_scene *scene, int64_t max_pairs, int threads)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    hs_pairs       *whole = NULL;
    hs_stream      *stream = NULL;
    options.want = WANT_ALL;
    CHECK(hs_pairs_find(AMONG(&points, scene->box), &options, &whole, NULL) == HS_OK);
    options.threads = threads;
    options.sorted = true; /* ignored */
    CHECK(hs_stream_open(AMONG(&points, scene->box), &options, max_pairs, &stream, NULL) == HS_OK);
    check_blocks(stream, whole, max_pairs, scene->ndim);
    hs_stream_free(stream);
    hs_pairs_free(whole);
}

static void
blocks_are_the_pairs_in_their_order(void)
{
    static const int64_t sizes[] = {1, 2, 7, 101, 1 << 20, INT64_MAX};
    harness_random       random = {20261122};
    static random_scene  s;
    for (int trial = 0; trial < TRIALS(360); trial++) {
        const int ndim = 1 + trial / SCENE_KINDS % 5;
        const int n = random_below(&random, ndim <= 3 ? 50 : 10);
        make_scene(&random, trial % SCENE_KINDS, ndim, n, 4.0, trial % 13 ? 0 : 200, &s);
        compare_stream(&s.scene, sizes[random_below(&random, 6)], 1 + trial % 3);
    }
}

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

/* Many times as many pairs as are looked for at a time, and groups that have more than that: they
 * are left and taken up again. */
static void
large_results_are_left_and_taken_up(void)
{
    static const int64_t sizes[] = {1 << 16, 100003, 300000, 4000000};
    const int            n = IS_SLOW ? 1500 : 3000;
    double              *x = random_points(n, 2, 1.0);
    for (int c = 0; c < 3; c++) {
        const brute_scene scene = {.ndim = 2,
                                   .n = n,
                                   .x = x,
                                   .inclusive = true,
                                   .cutoff = c == 0   ? 2.0
                                             : c == 1 ? 0.3
                                                      : 0.1};
        for (int s = 0; s < 4; s++) {
            compare_stream(&scene, sizes[s], 1 + (s + c) % 4);
        }
    }
    free(x);
}

/* Of which only the number is wanted. */
static void
blocks_without_columns_count_the_pairs(void)
{
    double           *x = random_points(3000, 2, 1.0);
    const brute_scene scene = {.ndim = 2, .n = 3000, .x = x, .inclusive = true, .cutoff = 0.2};
    const hs_points   points = points_of(&scene);
    hs_options        options = options_of(&scene);
    int64_t           count = 0, all = 0;
    CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &count, NULL) == HS_OK);
    options.want = 0;
    for (int threads = 1; threads <= 3; threads += 2) {
        hs_stream *stream = NULL;
        hs_pairs  *block = NULL;
        hs_failure failure;
        options.threads = threads;
        all = 0;
        CHECK(hs_stream_open(AMONG(&points, NULL), &options, 10007, &stream, &failure) == HS_OK);
        do {
            hs_pairs_free(block);
            CHECK(hs_stream_next(stream, NULL, NULL, &block, &failure) == HS_OK);
            all += block != NULL ? hs_pairs_length(block) : 0;
            CHECK(block == NULL || hs_pairs_length(block) == 10007 || all == count);
        } while (block != NULL);
        CHECK(all == count && count > 100000);
        hs_stream_free(stream);
    }
    free(x);
}

/* The same in a box that is smaller than the cutoff: blocks of several images. */
static void
images_are_left_and_taken_up(void)
{
    const hs_box      box = {.ndim = 2, .periodic = {true, true}, .rows = {{1, 0}, {0.3, 1}}};
    double           *x = random_points(300, 2, 1.0);
    const brute_scene scene = {
        .ndim = 2, .n = 300, .x = x, .box = &box, .inclusive = true, .cutoff = 3.0};
    for (int threads = 1; threads <= 3; threads++) {
        compare_stream(&scene, 70001, threads);
    }
    free(x);
}

static void
points_may_change_after_the_call(void)
{
    double      x[4] = {0.0, 0.25, 0.5, 0.75};
    brute_scene scene = {.ndim = 1, .n = 4, .x = x, .inclusive = true, .cutoff = 0.25};
    hs_points   points = points_of(&scene);
    hs_options  options = options_of(&scene);
    hs_stream  *stream = NULL;
    hs_pairs   *block = NULL;
    int64_t     n = 0;
    CHECK(hs_stream_open(AMONG(&points, NULL), &options, 2, &stream, NULL) == HS_OK);
    x[0] = x[1] = NAN;
    while (hs_stream_next(stream, NULL, NULL, &block, NULL) == HS_OK && block != NULL) {
        n += hs_pairs_length(block);
        hs_pairs_free(block);
    }
    CHECK(n == 3);
    hs_stream_free(stream);
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

/* What a stream holds does not grow with what it has found. */
static void
memory_is_bounded(void)
{
    const int         n = IS_SLOW ? 3000 : 20000;
    double           *x = random_points(n, 2, 1.0);
    const brute_scene scene = {.ndim = 2, .n = n, .x = x, .inclusive = true, .cutoff = 2.0};
    const hs_points   points = points_of(&scene);
    hs_options        options = options_of(&scene);
    hs_stream        *stream = NULL;
    hs_pairs         *block = NULL;
    int64_t           found = 0;
    options.threads = 2;
    options.memory_limit = 32e6; /* the pairs take 3.2 GB */
    CHECK(hs_stream_open(AMONG(&points, NULL), &options, 100000, &stream, NULL) == HS_OK);
    while (hs_stream_next(stream, NULL, NULL, &block, NULL) == HS_OK && block != NULL) {
        found += hs_pairs_length(block);
        hs_pairs_free(block);
    }
    CHECK(found == (int64_t)n * (n - 1) / 2);
    hs_stream_free(stream);
    free(x);
}

/* A box that must have more pairs than fit the limit is refused by a search that keeps them all. */
static void
boxes_of_more_pairs_than_fit_are_streamed(void)
{
    const hs_box      box = {.ndim = 2, .periodic = {true, true}, .rows = {{1, 0}, {0, 1}}};
    double           *x = random_points(20, 2, 1.0);
    const brute_scene scene = {
        .ndim = 2, .n = 20, .x = x, .box = &box, .inclusive = true, .cutoff = 40.0};
    const hs_points points = points_of(&scene);
    hs_options      options = options_of(&scene);
    hs_pairs       *block = NULL;
    hs_stream      *stream = NULL;
    hs_failure      failure;
    int64_t         count = 0, found = 0;
    CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, NULL) == HS_OK);
    options.memory_limit = 8.0 * (double)count; /* half of what they take */
    CHECK(hs_pairs_find(AMONG(&points, &box), &options, &block, &failure) == HS_ERR_MEMORY);
    CHECK(failure.expected_pairs > 0.9 * (double)count && failure.search_bytes == 0.0);
    CHECK(hs_stream_open(AMONG(&points, &box), &options, 10000, &stream, &failure) == HS_OK);
    while (hs_stream_next(stream, NULL, NULL, &block, NULL) == HS_OK && block != NULL) {
        found += hs_pairs_length(block);
        hs_pairs_free(block);
    }
    CHECK(found == count && count > 900000);
    hs_stream_free(stream);
    free(x);
}

static void
failures_are_told_and_leave_nothing(void)
{
    double          x[4] = {0.0, NAN, 0.5, 0.75};
    brute_scene     scene = {.ndim = 1, .n = 4, .x = x, .inclusive = true, .cutoff = 0.25};
    const hs_points points = points_of(&scene);
    hs_options      options = options_of(&scene);
    const int64_t   before = hs_test_live_blocks();
    hs_stream      *stream = (hs_stream *)&scene;
    hs_failure      failure;
    CHECK(hs_stream_open(AMONG(&points, NULL), &options, 2, &stream, &failure) ==
          HS_ERR_NOT_FINITE);
    CHECK(stream == NULL && failure.row == 1);
    options.kernel = "none";
    CHECK(hs_stream_open(AMONG(&points, NULL), &options, 2, &stream, NULL) == HS_ERR_KERNEL);
    CHECK(stream == NULL);
    hs_stream_free(NULL);
    CHECK(hs_test_live_blocks() == before);
}

/* Each allocation of a stream fails once; what did not fail goes on. */
static void
any_allocation_may_fail(void)
{
    const int         n = 700;
    double           *x = random_points(n, 2, 1.0);
    const brute_scene scene = {.ndim = 2, .n = n, .x = x, .inclusive = true, .cutoff = 2.0};
    const hs_points   points = points_of(&scene);
    hs_options        options = options_of(&scene);
    hs_pairs         *whole = NULL;
    bool              ended = false;
    int               failed = 0;
    options.want = WANT_ALL;
    CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &whole, NULL) == HS_OK);
    const int64_t before = hs_test_live_blocks();
    for (int64_t nth = 1; !ended && nth < 1000; nth++) {
        hs_stream *stream = NULL;
        hs_pairs  *block = NULL;
        int64_t    at = 0;
        options.threads = 1 + (int)(nth % 2);
        hs_test_fail_allocation(nth);
        hs_status status = hs_stream_open(AMONG(&points, NULL), &options, 90000, &stream, NULL);
        CHECK(status == HS_OK || (status == HS_ERR_MEMORY && stream == NULL));
        for (bool more = stream != NULL; more;) {
            status = hs_stream_next(stream, NULL, NULL, &block, NULL);
            CHECK(status == HS_OK || (status == HS_ERR_MEMORY && block == NULL));
            failed += status == HS_ERR_MEMORY;
            more = status == HS_ERR_MEMORY || block != NULL;
            if (block != NULL) {
                CHECK(block_matches(whole, block, at, 2));
                at += hs_pairs_length(block);
                hs_pairs_free(block);
            }
        }
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(stream == NULL || at == hs_pairs_length(whole));
        hs_stream_free(stream);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && failed > 10);
    hs_pairs_free(whole);
    free(x);
}

static void
cells_stream_too(void)
{
    static random_scene s;
    harness_random      random = {41};
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        hs_cells  *cells = NULL;
        hs_stream *stream = NULL;
        hs_pairs  *whole = NULL;
        make_scene(&random, kind, 3, 60, 4.0, 0, &s);
        const hs_points points = points_of(&s.scene);
        hs_options      options = options_of(&s.scene);
        CHECK(hs_cells_build(&points, s.scene.box, &options, &cells, NULL) == HS_OK);
        options.want = WANT_ALL;
        options.cutoff *= kind % 2 ? 0.5 : 1.2;
        CHECK(hs_pairs_find(IN_CELLS(cells), &options, &whole, NULL) == HS_OK);
        CHECK(hs_stream_open(IN_CELLS(cells), &options, 11, &stream, NULL) == HS_OK);
        check_blocks(stream, whole, 11, 3);
        hs_stream_free(stream);
        hs_pairs_free(whole);
        hs_cells_free(cells);
    }
}

typedef struct told_fractions {
    double last;
    int    n;
    bool   rises;
} told_fractions;

static bool
note_fraction(void *context, double fraction)
{
    told_fractions *told = context;
    told->rises = told->rises && fraction >= told->last && fraction <= 1.0;
    told->last = fraction;
    told->n++;
    return true;
}

static void
fractions_never_fall(void)
{
    const int         n = 8000;
    double           *x = random_points(n, 3, 1.0);
    const brute_scene scene = {.ndim = 3, .n = n, .x = x, .inclusive = true, .cutoff = 0.15};
    const hs_points   points = points_of(&scene);
    for (int threads = 1; threads <= 4; threads++) {
        hs_options options = options_of(&scene);
        hs_stream *stream = NULL;
        hs_pairs  *block = NULL;
        options.threads = threads;
        told_fractions told = {.rises = true};
        CHECK(hs_stream_open(AMONG(&points, NULL), &options, 70000, &stream, NULL) == HS_OK);
        do {
            hs_pairs_free(block);
            CHECK(hs_stream_next(stream, note_fraction, &told, &block, NULL) == HS_OK);
        } while (block != NULL);
        CHECK(told.rises && told.last == 1.0 && told.n > 2);
        hs_stream_free(stream);
    }
    free(x);
}

void
test_api_stream(void)
{
    RUN(blocks_are_the_pairs_in_their_order);
    RUN(large_results_are_left_and_taken_up);
    RUN(blocks_without_columns_count_the_pairs);
    RUN(images_are_left_and_taken_up);
    RUN(points_may_change_after_the_call);
    RUN(interrupted_calls_can_be_made_again);
    RUN(memory_is_bounded);
    RUN(boxes_of_more_pairs_than_fit_are_streamed);
    RUN(failures_are_told_and_leave_nothing);
    RUN(any_allocation_may_fail);
    RUN(cells_stream_too);
    RUN(fractions_never_fall);
}
