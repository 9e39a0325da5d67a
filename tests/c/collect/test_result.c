/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_result.c: how points come in and pairs go out: strides, wants, widths, order, polls,
 * refusals.
 */
#include "../../../csrc/core/base/want.h"
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/collect/result.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_result(void);

static random_scene shared;

/* About 60 points in a triclinic box; some thousand pairs. */
static brute_scene *
ordinary_scene(void)
{
    harness_random random = {1234567};
    make_scene(&random, SCENE_TRICLINIC, 3, 60, 6.0, 0, &shared);
    shared.scene.cutoff = 4.5;
    return &shared.scene;
}

static bool
same_found(const found_pairs *a, const found_pairs *b, int ndim)
{
    const size_t n = (size_t)a->n, d = (size_t)ndim;
    return a->n == b->n && memcmp(a->i, b->i, n * 8) == 0 && memcmp(a->j, b->j, n * 8) == 0 &&
           memcmp(a->distance, b->distance, n * 8) == 0 &&
           memcmp(a->vector, b->vector, n * d * 8) == 0 &&
           memcmp(a->shift, b->shift, n * d * 4) == 0;
}

static void
any_strides_and_alignment_read_the_same_points(void)
{
    brute_scene  *scene = ordinary_scene();
    unsigned char buffer[60 * 3 * 16 + 64];
    found_pairs   expected, found;
    hs_points     points = points_of(scene);
    hs_options    options = options_of(scene);
    options.want = WANT_ALL;
    for (int e = 0; e < 180; e++)
        shared.x[e] = (float)shared.x[e]; /* so that both types can hold them */
    CHECK(search_pairs(&points, scene->box, &options, &expected, NULL) == HS_OK);
    CHECK(expected.n > 1000);
    for (int trial = 0; trial < 32; trial++) {
        const bool      is_float = trial & 1, backward = trial & 2, columns_first = trial & 4;
        const ptrdiff_t size = is_float ? 4 : 8;
        const ptrdiff_t pitch = size + (trial & 8 ? 3 : 0); /* odd: never aligned */
        ptrdiff_t       row = columns_first ? pitch : 3 * pitch;
        ptrdiff_t       column = columns_first ? 60 * pitch : pitch;
        unsigned char  *first = buffer + (trial & 16 ? 1 : 0);
        if (backward) {
            first += 59 * row + 2 * column;
            row = -row;
            column = -column;
        }
        for (int e = 0; e < 180; e++) {
            const float narrow = (float)shared.x[e];
            memcpy(first + e / 3 * row + e % 3 * column,
                   is_float ? (const void *)&narrow : (const void *)&shared.x[e], (size_t)size);
        }
        points.data = first;
        points.real = is_float ? HS_FLOAT32 : HS_FLOAT64;
        points.row_stride = row;
        points.column_stride = column;
        CHECK(search_pairs(&points, scene->box, &options, &found, NULL) == HS_OK);
        CHECK(same_found(&expected, &found, 3));
        found_free(&found);
    }
    found_free(&expected);
}

static void
zero_strides_repeat_a_number(void)
{
    const double x[3] = {0.5, 1.5, 2.5};
    hs_options   options = hs_options_default();
    int64_t      count = -1;
    hs_points    points = {.data = x, .n = 50, .ndim = 3, .real = HS_FLOAT64, .column_stride = 8};
    CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &count, NULL) == HS_OK);
    CHECK(count == 50 * 49 / 2);
    points = (hs_points){.data = x, .n = 3, .ndim = 4, .real = HS_FLOAT64, .row_stride = 8};
    options.cutoff = 2.0; /* steps of (1, 1, 1, 1) */
    CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &count, NULL) == HS_OK);
    CHECK(count == 2);
}

/* The array of one HS_WANT_ bit holds these numbers, or is not there. */
static void
check_array(hs_pairs *pairs, const hs_options *options, unsigned bit, const void *expected,
            size_t bytes)
{
    const void *borrowed = hs_pairs_array(pairs, bit);
    CHECK((borrowed != NULL) == ((options->want & bit) != 0));
    CHECK(borrowed == NULL || memcmp(borrowed, expected, bytes) == 0);
    void *taken = hs_pairs_take(pairs, bit);
    CHECK((taken != NULL) == ((options->want & bit) != 0));
    CHECK(hs_pairs_array(pairs, bit) == NULL && hs_pairs_take(pairs, bit) == NULL);
    if (bit != HS_WANT_J) {
        CHECK(taken == NULL || memcmp(taken, expected, bytes) == 0);
        hs_array_free(taken);
    } else if (taken != NULL) { /* it outlives the result */
        hs_pairs_free(pairs);
        CHECK(memcmp(taken, expected, bytes) == 0);
        hs_array_free(taken);
    } else {
        hs_pairs_free(pairs);
    }
}

/* All pairs as int32 or int64: i, j, and both side by side. */
static void
narrow_indices(const found_pairs *all, int bytes, char *i, char *j, char *both)
{
    const size_t size = (size_t)bytes;
    for (size_t e = 0; e < (size_t)all->n; e++) {
        const int32_t narrow[2] = {(int32_t)all->i[e], (int32_t)all->j[e]};
        const int64_t wide[2] = {all->i[e], all->j[e]};
        const char   *right = bytes == 4 ? (const char *)narrow : (const char *)wide;
        memcpy(i + e * size, right, size);
        memcpy(j + e * size, right + size, size);
        memcpy(both + 2 * e * size, right, 2 * size);
    }
}

/* Every combination of wants, sorted and not, in both widths. */
static void
each_want_returns_the_same_numbers(void)
{
    const brute_scene *scene = ordinary_scene();
    const hs_points    points = points_of(scene);
    for (int sorted = 0; sorted < 2; sorted++) {
        hs_options  options = options_of(scene);
        found_pairs all;
        options.sorted = sorted;
        options.want = WANT_ALL;
        CHECK(search_pairs(&points, scene->box, &options, &all, NULL) == HS_OK);
        const size_t n = (size_t)all.n;
        char        *i = array_of(all.n, 8), *j = array_of(all.n, 8), *both = array_of(all.n, 16);
        for (unsigned want = 0; want <= HS_WANT_ALL; want++) {
            hs_pairs *pairs;
            options.index_bytes = want % 3 ? 4 : 8;
            options.want = want;
            const size_t size = (size_t)options.index_bytes;
            narrow_indices(&all, options.index_bytes, i, j, both);
            CHECK(hs_pairs_find(AMONG(&points, scene->box), &options, &pairs, NULL) == HS_OK);
            CHECK(hs_pairs_length(pairs) == all.n);
            check_array(pairs, &options, HS_WANT_I, i, n * size);
            check_array(pairs, &options, HS_WANT_BOTH, both, n * 2 * size);
            check_array(pairs, &options, HS_WANT_DISTANCE, all.distance, n * 8);
            check_array(pairs, &options, HS_WANT_VECTOR, all.vector, n * 24);
            check_array(pairs, &options, HS_WANT_SHIFT, all.shift, n * 12);
            check_array(pairs, &options, HS_WANT_J, j, n * size); /* frees the result */
        }
        free(i);
        free(j);
        free(both);
        found_free(&all);
    }
}

/* No pairs, yet arrays that can be taken. */
static void
empty_results_have_arrays(void)
{
    const double    x[2] = {0.0, 5.0};
    const hs_points points = {.data = x, .n = 2, .ndim = 1, .real = HS_FLOAT64, .row_stride = 8};
    for (int trial = 0; trial < 4; trial++) {
        hs_options options = hs_options_default();
        hs_pairs  *pairs;
        hs_points  some = points;
        some.n = trial & 2 ? 0 : 2;
        options.cutoff = 1.0;
        options.sorted = trial & 1;
        options.want = WANT_ALL | HS_WANT_BOTH;
        CHECK(hs_pairs_find(AMONG(&some, NULL), &options, &pairs, NULL) == HS_OK);
        CHECK(hs_pairs_length(pairs) == 0);
        for (unsigned bit = 1; bit < 64; bit <<= 1) {
            void *taken = hs_pairs_take(pairs, bit);
            CHECK(taken != NULL);
            hs_array_free(taken);
        }
        hs_pairs_free(pairs);
    }
    hs_array_free(NULL);
    hs_pairs_free(NULL);
}

/* One crowded point has more pairs than are sorted by insertion. */
static void
sorted_pairs_ascend_strictly(void)
{
    harness_random      random = {99};
    static random_scene s;
    for (int trial = 0; trial < 60; trial++) {
        found_pairs found;
        make_scene(&random, trial % SCENE_KINDS, 1 + trial % 3, 300, 4.0, 0, &s);
        s.scene.cutoff = trial % 2 ? 0.4 : trial % 3 ? 1.0 : 4.5;
        hs_options      options = options_of(&s.scene);
        const hs_points points = points_of(&s.scene);
        options.sorted = true;
        options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
        CHECK(search_pairs(&points, s.scene.box, &options, &found, NULL) == HS_OK);
        brute_pair before = {.i = -1};
        bool       ascends = true;
        for (int64_t e = 0; e < found.n; e++) {
            brute_pair pair = {.i = (int32_t)found.i[e], .j = (int32_t)found.j[e]};
            for (int k = 0; k < s.scene.ndim; k++)
                pair.shift[k] = found.shift[e * s.scene.ndim + k];
            ascends = ascends && brute_order(&before, &pair) < 0;
            before = pair;
        }
        CHECK(ascends);
        found_free(&found);
    }
}

/* Stops at poll number `stop_at`; counts, and checks what it is told. */
typedef struct poll_state {
    int64_t calls, stop_at;
    double  fraction;
    bool    orderly;
} poll_state;

static bool
poll(void *context, double fraction)
{
    poll_state *state = context;
    state->orderly = state->orderly && fraction >= state->fraction && fraction <= 1.0;
    state->fraction = fraction;
    return ++state->calls != state->stop_at;
}

static hs_status
polled_search(const brute_scene *scene, bool sorted, poll_state *state, hs_counters *counters)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    hs_pairs       *pairs = NULL;
    hs_failure      failure;
    options.sorted = sorted;
    options.want = HS_WANT_I | HS_WANT_J;
    options.poll = poll;
    options.poll_context = state;
    options.counters = counters;
    const hs_status status = hs_pairs_find(AMONG(&points, scene->box), &options, &pairs, &failure);
    CHECK((status == HS_OK) == (pairs != NULL));
    CHECK(counters->polls == state->calls);
    CHECK(status != HS_OK || counters->pairs == hs_pairs_length(pairs));
    hs_pairs_free(pairs);
    return status;
}

/* Runs to the end once, then stops at each of its polls in turn; where that is slow, at some. */
static void
stop_at_every_poll(const brute_scene *scene, bool sorted, int64_t least)
{
    hs_counters counters;
    poll_state  state = {.orderly = true};
    CHECK(polled_search(scene, sorted, &state, &counters) == HS_OK);
    CHECK(state.orderly);
    CHECK(state.calls >= least);
    const int64_t calls = state.calls, step = IS_SLOW ? 1 + calls / 6 : 1;
    for (int64_t stop_at = 1; stop_at <= calls; stop_at += step) {
        state = (poll_state){.stop_at = stop_at, .orderly = true};
        CHECK(polled_search(scene, sorted, &state, &counters) == HS_ERR_INTERRUPTED);
        CHECK(state.calls == stop_at);
    }
}

static void
poll_stops_the_search_whenever_it_says_so(void)
{
    const int      n = 280000;
    double        *x = array_of(n, sizeof *x);
    harness_random random = {5150};
    hs_box         box = {.ndim = 1, .periodic = {true}, .rows = {{0.75}}};
    for (int e = 0; e < n; e++)
        x[e] = random_unit(&random);
    brute_scene many = {.ndim = 1, .n = n, .x = x, .box = &box, .cutoff = 1e-8};
    stop_at_every_poll(&many, false, 2); /* many points to read, wrap and sort */
    brute_scene wide = {.ndim = 8, .n = 16000, .x = x, .cutoff = 0.3};
    stop_at_every_poll(&wide, true, 2); /* many candidates */
    brute_scene lonely = {.ndim = 3, .n = 90000, .x = x, .cutoff = 1e-3};
    stop_at_every_poll(&lonely, false, 1); /* many groups that meet nobody */
    brute_scene dense = {.ndim = 1, .n = 1500, .x = x, .cutoff = 0.6};
    stop_at_every_poll(&dense, true, 3); /* many pairs to sort and write */
    stop_at_every_poll(&dense, false, 0);
    free(x);
}

typedef struct limit_state {
    int    calls;
    double bytes;
} limit_state;

static double
find_limit(void *context)
{
    limit_state *state = context;
    state->calls++;
    return state->bytes;
}

static void
memory_limit_refuses_or_is_kept(void)
{
    const brute_scene *scene = ordinary_scene();
    const hs_points    points = points_of(scene);
    int                refused = 0, granted = 0;
    for (double limit = 0.0; limit < 3e6; limit = limit * 1.3 + 64.0) {
        hs_options  options = options_of(scene);
        hs_counters counters = {.pairs = -1};
        hs_failure  failure;
        found_pairs found;
        options.want = WANT_ALL;
        options.sorted = true;
        options.memory_limit = limit;
        options.counters = &counters;
        const hs_status status = search_pairs(&points, scene->box, &options, &found, &failure);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        CHECK((double)counters.bytes_peak <= limit);
        CHECK(status == HS_OK || failure.limit_bytes == limit || failure.limit_bytes == 0.0);
        refused += status != HS_OK;
        granted += status == HS_OK;
        found_free(&found);
    }
    CHECK(refused > 3 && granted > 0);
}

/* A slab in whose plane the cutoff spans 1e5 boxes: neither the rows of the stencil nor a sample of
 * the candidates are needed to know better. */
static void
a_slab_with_too_many_images_is_refused_at_once(void)
{
    double x[6] = {0.0, 0.0, 0.0, 0.5, 0.25, 7.0};
    hs_box box = {
        .ndim = 3, .periodic = {true, false, true}, .rows = {{1.0}, {0.0}, {0.5, 0.0, 1.0}}};
    brute_scene     scene = {.ndim = 3, .n = 2, .x = x, .box = &box, .cutoff = 1e5};
    hs_options      options = options_of(&scene);
    limit_state     state = {.bytes = 1e9};
    hs_failure      failure;
    hs_pairs       *pairs = NULL;
    hs_plan         plan;
    const hs_points points = points_of(&scene);
    options.find_limit = find_limit; /* 2 * pi * 1e10 pairs */
    options.find_context = &state;
    CHECK(hs_pairs_find(AMONG(&points, &box), &options, &pairs, &failure) == HS_ERR_MEMORY);
    CHECK(failure.expected_pairs > 6.2e10 && failure.expected_pairs < 6.3e10);
    CHECK(failure.limit_bytes > 0.9e9 && failure.limit_bytes < 1.1e9);
    CHECK(hs_plan_make(AMONG(&points, &box), &options, &plan, &failure) == HS_ERR_MEMORY);
    options.cutoff = 30.0; /* few images, and the points span a part of the radius */
    CHECK(hs_pairs_find(AMONG(&points, &box), &options, &pairs, &failure) == HS_OK);
    hs_pairs_free(pairs);
}

static void
a_result_too_large_is_refused_before_it_is_found(void)
{
    double          x[2] = {0.0, 0.0};
    hs_box          box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    brute_scene     scene = {.ndim = 2, .n = 1, .x = x, .box = &box, .cutoff = 1e5};
    hs_options      options = options_of(&scene);
    limit_state     state = {.bytes = 1e9};
    hs_failure      failure;
    hs_pairs       *pairs = (hs_pairs *)&state;
    const hs_points points = points_of(&scene);
    options.find_limit = find_limit; /* 1.6e10 pairs */
    options.find_context = &state;
    CHECK(hs_pairs_find(AMONG(&points, &box), &options, &pairs, &failure) == HS_ERR_MEMORY);
    CHECK(pairs == NULL);
    CHECK(state.calls == 1);
    CHECK(failure.expected_pairs > 1e10 && failure.expected_pairs < 2e10);
    CHECK(failure.expected_bytes >= 16.0 * failure.expected_pairs);
    CHECK(failure.limit_bytes > 0.9e9 && failure.limit_bytes < 1.1e9);
    options.cutoff = 10.0; /* small: nobody asks */
    CHECK(hs_pairs_find(AMONG(&points, &box), &options, &pairs, &failure) == HS_OK);
    CHECK(state.calls == 1);
    hs_pairs_free(pairs);
    hs_pairs_free(NULL);
}

/* Of nothing, of what is no one quantity, and of what has been taken. */
static void
what_a_result_does_not_have_is_null(void)
{
    const brute_scene *scene = ordinary_scene();
    const hs_points    points = points_of(scene);
    hs_options         options = options_of(scene);
    hs_pairs          *pairs = NULL;
    CHECK(hs_pairs_length(NULL) == 0 && hs_pairs_rows(NULL) == 0);
    CHECK(hs_pairs_array(NULL, HS_WANT_I) == NULL && hs_pairs_take(NULL, HS_WANT_I) == NULL);
    CHECK(hs_pairs_offsets(NULL) == NULL && hs_pairs_take_offsets(NULL) == NULL);
    options.want = HS_WANT_I | HS_WANT_J;
    CHECK(hs_pairs_find(AMONG(&points, scene->box), &options, &pairs, NULL) == HS_OK);
    CHECK(hs_pairs_rows(pairs) == 0 && hs_pairs_offsets(pairs) == NULL);
    CHECK(hs_pairs_array(pairs, 0) == NULL && hs_pairs_array(pairs, 1u << 6) == NULL);
    CHECK(hs_pairs_array(pairs, HS_WANT_I | HS_WANT_J) == NULL);
    CHECK(hs_pairs_take(pairs, HS_WANT_I | HS_WANT_J) == NULL);
    CHECK(hs_pairs_array(pairs, HS_WANT_DISTANCE) == NULL);
    CHECK(hs_pairs_take(pairs, HS_WANT_DISTANCE) == NULL);
    const void *i = hs_pairs_array(pairs, HS_WANT_I);
    void       *taken = hs_pairs_take(pairs, HS_WANT_I);
    CHECK(i != NULL && taken != NULL && hs_pairs_array(pairs, HS_WANT_I) == NULL);
    CHECK(hs_pairs_take(pairs, HS_WANT_I) == NULL && hs_pairs_length(pairs) > 0);
    hs_pairs_free(pairs);
    hs_array_free(taken);
    CHECK(hs_neighbors_find(AMONG(&points, scene->box), &options, &pairs, NULL) == HS_OK);
    CHECK(hs_pairs_rows(pairs) == scene->n && hs_pairs_offsets(pairs)[0] == 0);
    int64_t *offsets = hs_pairs_take_offsets(pairs);
    CHECK(offsets[scene->n] == hs_pairs_length(pairs) && hs_pairs_offsets(pairs) == NULL);
    hs_array_free(offsets);
    hs_pairs_free(pairs);
}

/* Other statuses stay; arrays of the caller must have held all, others are there also if empty. */
static void
searches_conclude_with_arrays_that_hold_all(void)
{
    static int64_t       i[8], j[8];
    const hs_pair_arrays arrays = {.capacity = 8, .index_bytes = 8, .i = i, .j = j};
    hs_failure           failure = HS_NO_FAILURE;
    hs_account           account;
    hs_options           options = hs_options_default();
    hs_output            output;
    hs_account_init(&account, &options);
    hs_output_init(&account, 2, HS_WANT_I | HS_WANT_J, 8, &output);
    CHECK(hs_pairs_conclude(&output, HS_ERR_INTERRUPTED, &failure) == HS_ERR_INTERRUPTED);
    CHECK(hs_output_column(&output, HS_WANT_I) == NULL);
    CHECK(hs_pairs_conclude(&output, HS_OK, &failure) == HS_OK);
    CHECK(hs_output_column(&output, HS_WANT_I) != NULL);
    const int64_t capacity = output.n_pairs = output.capacity; /* what is full need not grow */
    CHECK(hs_pairs_conclude(&output, HS_OK, &failure) == HS_OK && output.capacity == capacity);
    output.n_pairs = 0;
    hs_output_free(&output);
    hs_output_init(&account, 2, HS_WANT_I | HS_WANT_J, 8, &output);
    hs_output_fix(&output, &arrays);
    output.n_pairs = 8;
    CHECK(hs_pairs_conclude(&output, HS_OK, &failure) == HS_OK && failure.expected_pairs == 0.0);
    output.n_pairs = 9;
    CHECK(hs_pairs_conclude(&output, HS_OK, &failure) == HS_ERR_CAPACITY);
    CHECK(failure.expected_pairs == 9.0);
    hs_output_free(&output);
    hs_account_close(&account);
}

void
test_result(void)
{
    RUN(what_a_result_does_not_have_is_null);
    RUN(searches_conclude_with_arrays_that_hold_all);
    RUN(any_strides_and_alignment_read_the_same_points);
    RUN(zero_strides_repeat_a_number);
    RUN(each_want_returns_the_same_numbers);
    RUN(empty_results_have_arrays);
    RUN(sorted_pairs_ascend_strictly);
    RUN(poll_stops_the_search_whenever_it_says_so);
    RUN(memory_limit_refuses_or_is_kept);
    RUN(a_slab_with_too_many_images_is_refused_at_once);
    RUN(a_result_too_large_is_refused_before_it_is_found);
}
