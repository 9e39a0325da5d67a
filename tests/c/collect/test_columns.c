/* SPDX-License-Identifier: BSD-3-Clause */
/* test_columns.c: columns of results are joined, filled and returned, or written to the caller's
 * arrays. */
#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/collect/columns.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/output_checks.h"
#include "../support/random_scenes.h"

void test_columns(void);

/* ---- options.out, pairs written into arrays of the caller, and nothing beyond them ---- */

static random_scene shared;

/* Boxes of one kind; enough pairs for several stages (256 kB) where `many`. */
static brute_scene *
scene_of(scene_kind kind, bool many)
{
    harness_random random = {8080};
    make_scene(&random, kind, 3, many ? 120 : 40, 6.0, 0, &shared);
    shared.scene.cutoff = many ? 4.5 : 2.0;
    return &shared.scene;
}

/* Finds with arrays of `capacity` pairs, of which there are `room` >= capacity. */
static hs_status
find_into(const brute_scene *scene, hs_options options, int64_t capacity, int64_t room,
          caller_arrays *c, hs_failure *failure, int64_t *n)
{
    const hs_points points = points_of(scene);
    hs_pairs       *pairs = (hs_pairs *)&options;
    make_arrays(options.want, scene->ndim, options.index_bytes, room, c);
    c->arrays.capacity = capacity;
    options.out = &c->arrays;
    const hs_status status = hs_pairs_find(AMONG(&points, scene->box), &options, &pairs, failure);
    CHECK((status == HS_OK) == (pairs != NULL));
    *n = status == HS_OK ? hs_pairs_length(pairs) : -1;
    for (unsigned bit = 1; status == HS_OK && bit < 64; bit <<= 1) {
        CHECK(hs_pairs_array(pairs, bit) == NULL); /* they are the caller's */
        CHECK(hs_pairs_take(pairs, bit) == NULL);
    }
    hs_pairs_free(pairs);
    return status;
}

static hs_pairs *
find_anew(const brute_scene *scene, const hs_options *options)
{
    const hs_points points = points_of(scene);
    hs_pairs       *pairs = NULL;
    CHECK(hs_pairs_find(AMONG(&points, scene->box), options, &pairs, NULL) == HS_OK);
    return pairs;
}

/* The caller's arrays take none of our memory: they are not counted, and no limit refuses them. */
static void
the_callers_memory_is_not_counted(void)
{
    const brute_scene *scene = scene_of(SCENE_ALIGNED, true);
    hs_options         options = options_of(scene);
    hs_counters        counters, with_own;
    caller_arrays      c;
    hs_failure         failure;
    int64_t            n;
    options.want = WANT_ALL | HS_WANT_BOTH;
    options.counters = &with_own;
    hs_pairs *pairs = find_anew(scene, &options);
    n = hs_pairs_length(pairs);
    hs_pairs_free(pairs);
    options.counters = &counters;
    options.memory_limit = 1e6;
    CHECK((double)n * 72.0 > 3.0 * options.memory_limit);
    CHECK(find_into(scene, options, n, n, &c, &failure, &n) == HS_OK);
    free_arrays(&c);
    CHECK(counters.pairs == n);
    CHECK(with_own.bytes[HS_FOR_INDICES] >= n * 32 && counters.bytes[HS_FOR_INDICES] == 0);
    CHECK(with_own.bytes[HS_FOR_DISTANCES] >= n * 8 && counters.bytes[HS_FOR_DISTANCES] == 0);
    CHECK(with_own.bytes[HS_FOR_VECTORS] >= n * 24 && counters.bytes[HS_FOR_VECTORS] == 0);
    CHECK(with_own.bytes[HS_FOR_SHIFTS] >= n * 12 && counters.bytes[HS_FOR_SHIFTS] == 0);
}

/* What no memory holds is refused at once; guesses of it are forgotten. */
static void
endless_outputs_are_refused(void)
{
    hs_output output;
    hs_output_init(NULL, 8, HS_WANT_VECTOR | HS_WANT_SHIFT, 8, &output);
    CHECK(!hs_output_has_room(&output, 0));
    hs_output_reserve_hint(&output, 1e18);
    CHECK(output.capacity == 1024 && hs_output_has_room(&output, 1024));
    hs_output_reserve_hint(&output, INFINITY);
    CHECK(output.capacity == 1024 && !hs_output_has_room(&output, 1025));
    CHECK(hs_output_reserve(&output, INT64_C(1) << 57, 0.0) == HS_ERR_MEMORY);
    CHECK(hs_output_reserve(&output, INT64_C(1) << 60, 0.5) == HS_ERR_MEMORY);
    CHECK(output.capacity == 1024);
    CHECK(hs_output_reserve(&output, 2000, 0.0) == HS_OK && output.capacity >= 2000);
    hs_output_free(&output);
}

/* ---- every page of large columns is written to, and small ones are left alone ---- */

enum { PAGE = 4096, PAIRS = 2200000, TOUCHED = (1 << 26) / 32 };

typedef struct asked {
    int polls, most; /* times that it goes on */
} asked;

static bool
go_on(void *context, double fraction)
{
    asked *counts = context;
    CHECK(fraction >= 0.0 && fraction <= 1.0);
    return ++counts->polls <= counts->most;
}

/* Bytes of a column that are other than 0x5a, if each is the first of its page and these are all
 * that begin in its first n bytes, or a part of them; else -1. */
static int64_t
touched_pages(const hs_output *output, unsigned bit, size_t n, bool is_part)
{
    const unsigned char *bytes = hs_output_column(output, bit);
    const size_t         n_bytes = PAIRS * hs_output_width(output, bit);
    int64_t              touched = 0, at_pages = 0;
    for (size_t b = 0; b < n_bytes; b++) {
        touched += bytes[b] != 0x5a;
    }
    for (size_t b = (size_t)(-(uintptr_t)bytes & (PAGE - 1)); b < n; b += PAGE) {
        at_pages += bytes[b] != 0x5a;
        touched = bytes[b] != 0x5a || is_part ? touched : -1;
    }
    return touched == at_pages ? touched : -1;
}

/* Touches an output of j (8 bytes a pair) and D (24) whose first n pairs count. */
static hs_status
touch(int threads, size_t n, asked *counts, int64_t *of_j, int64_t *of_vector)
{
    hs_options options = hs_options_default();
    hs_output  output;
    hs_team   *team = hs_team_create(threads);
    options.poll = go_on;
    options.poll_context = counts;
    counts->polls = 0;
    hs_output_init(NULL, 3, HS_WANT_J | HS_WANT_VECTOR, 8, &output);
    CHECK(hs_output_reserve(&output, PAIRS, 0.0) == HS_OK);
    memset(hs_output_column(&output, HS_WANT_J), 0x5a, PAIRS * 8);
    memset(hs_output_column(&output, HS_WANT_VECTOR), 0x5a, PAIRS * 24);
    output.n_pairs = (int64_t)n;
    const hs_status status = hs_touch_output(team, &options, &output);
    const bool      is_part = status != HS_OK || n < TOUCHED;
    *of_j = touched_pages(&output, HS_WANT_J, n * 8, is_part);
    *of_vector = touched_pages(&output, HS_WANT_VECTOR, n * 24, is_part);
    hs_output_free(&output);
    hs_team_free(team);
    return status;
}

static void
each_page_is_written_to_once(void)
{
    static const size_t sizes[] = {0, TOUCHED - 1, TOUCHED, PAIRS};
    for (int threads = 1; threads <= (IS_SLOW ? 1 : 3); threads++) {
        for (int s = 0; s < 4; s++) {
            asked   counts = {.most = 1000};
            int64_t of_j, of_vector;
            CHECK(touch(threads, sizes[s], &counts, &of_j, &of_vector) == HS_OK);
            CHECK(sizes[s] >= TOUCHED ? of_j > 0 && of_vector > 0 : of_j == 0 && of_vector == 0);
            CHECK(counts.polls == (sizes[s] >= TOUCHED ? (int)(sizes[s] / HS_POLL_POINTS) : 0));
        }
    }
}

static void
the_caller_may_stop_it(void)
{
    asked   counts = {.most = 2};
    int64_t of_j, of_vector;
    CHECK(touch(1, PAIRS, &counts, &of_j, &of_vector) == HS_ERR_INTERRUPTED);
    CHECK(counts.polls == 3 && of_j > 0 && of_j <= 3 * HS_POLL_POINTS * 8 / PAGE);
}

void
test_columns(void)
{
    RUN(the_callers_memory_is_not_counted);
    RUN(endless_outputs_are_refused);
    RUN(each_page_is_written_to_once);
    RUN(the_caller_may_stop_it);
}
