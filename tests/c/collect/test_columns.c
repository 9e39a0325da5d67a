/* SPDX-License-Identifier: BSD-3-Clause */
/* test_columns.c: options.out, pairs written into arrays of the caller, and nothing beyond them. */
#include "../../../csrc/core/base/want.h"
#include "../../../csrc/core/collect/columns.h"
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/memory/pool.h"
#include "../support/output_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_columns(void);

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

/* Exactly enough room, some to spare, and too little in several ways. */
static void
check_capacities(const brute_scene *scene, const hs_options *options)
{
    hs_pairs     *pairs = find_anew(scene, options);
    const int64_t n = hs_pairs_length(pairs);
    const int64_t enough[] = {n, n + 1, n + 100}, short_of[] = {0, 1, n / 2, n - 1};
    caller_arrays c;
    hs_failure    failure;
    int64_t       found;
    for (int e = 0; e < 3; e++) {
        CHECK(find_into(scene, *options, enough[e], n + 100, &c, &failure, &found) == HS_OK);
        CHECK(found == n);
        CHECK(same_as_result(&c, pairs, n));
        CHECK(untouched_from(&c, n));
        free_arrays(&c);
    }
    for (int e = 0; e < 4 && n > 2; e++) {
        CHECK(find_into(scene, *options, short_of[e], n, &c, &failure, &found) == HS_ERR_CAPACITY);
        CHECK(failure.expected_pairs == (double)n);
        CHECK(untouched_from(&c, short_of[e]));
        free_arrays(&c);
    }
    hs_pairs_free(pairs);
}

static void
every_quantity_goes_to_the_callers_arrays(void)
{
    for (int sorted = 0; sorted < 2; sorted++) {
        for (unsigned want = 1; want <= HS_WANT_ALL; want++) {
            const brute_scene *scene = scene_of((int)want % SCENE_KINDS, false);
            hs_options         options = options_of(scene);
            options.want = want;
            options.sorted = sorted;
            options.index_bytes = want / 7 % 2 ? 4 : 8;
            check_capacities(scene, &options);
        }
    }
}

static void
many_pairs_go_to_the_callers_arrays(void)
{
    static const unsigned wants[] = {HS_WANT_I | HS_WANT_J, HS_WANT_BOTH, WANT_ALL | HS_WANT_BOTH};
    int64_t               most = 0;
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        for (int variant = 0; variant < 6; variant += IS_SLOW ? 5 : 1) {
            const brute_scene *scene = scene_of(kind, true);
            hs_options         options = options_of(scene);
            options.want = wants[variant / 2];
            options.sorted = variant & 1;
            check_capacities(scene, &options);
            hs_pairs *pairs = find_anew(scene, &options);
            most = hs_pairs_length(pairs) > most ? hs_pairs_length(pairs) : most;
            hs_pairs_free(pairs);
        }
    }
    CHECK(most > 32768); /* a stage holds 16384 of 16 bytes */
}

/* Room for none and no arrays at all: says how many there are. */
static void
no_room_asks_for_the_number(void)
{
    const brute_scene   *scene = scene_of(SCENE_TRICLINIC, true);
    const hs_points      points = points_of(scene);
    const hs_pair_arrays nothing = {.index_bytes = 8};
    hs_options           options = options_of(scene);
    int64_t              count = -1;
    CHECK(hs_pairs_count(AMONG(&points, scene->box), &options, &count, NULL) == HS_OK);
    for (int sorted = 0; sorted < 2; sorted++) {
        hs_pairs  *pairs = (hs_pairs *)&options;
        hs_failure failure;
        options.sorted = sorted;
        options.want = WANT_ALL | HS_WANT_BOTH;
        options.out = &nothing;
        CHECK(hs_pairs_find(AMONG(&points, scene->box), &options, &pairs, &failure) ==
              HS_ERR_CAPACITY);
        CHECK(pairs == NULL);
        CHECK(failure.expected_pairs == (double)count);
        CHECK(hs_pairs_find(AMONG(&points, scene->box), &options, &pairs, NULL) == HS_ERR_CAPACITY);
    }
}

static void
no_pairs_need_no_room(void)
{
    const hs_pair_arrays nothing = {.index_bytes = 4};
    brute_scene         *scene = scene_of(SCENE_OPEN, false);
    for (int trial = 0; trial < 4; trial++) {
        hs_points  points = points_of(scene);
        hs_options options = options_of(scene);
        hs_pairs  *pairs = NULL;
        options.cutoff = 0.0;
        options.inclusive = false;
        options.sorted = trial & 1;
        options.want = WANT_ALL | HS_WANT_BOTH;
        options.out = &nothing;
        points.n = trial & 2 ? 0 : points.n;
        CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &pairs, NULL) == HS_OK);
        CHECK(pairs != NULL && hs_pairs_length(pairs) == 0);
        hs_pairs_free(pairs);
    }
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

/* Pairs of j and D that grow as they come, to the last that the limit allows. */
static void
outputs_grow_to_their_limit(void)
{
    hs_account account;
    hs_options options = hs_options_default();
    hs_output  output;
    int64_t    n = 0;
    options.memory_limit = 1e6;
    hs_account_init(&account, &options);
    hs_output_init(&account, 3, HS_WANT_J | HS_WANT_VECTOR, 8, &output);
    CHECK(hs_output_bytes_per_pair(&output) == 32 && !hs_output_has_room(&output, 0));
    while (hs_output_reserve(&output, 10, 0.0) == HS_OK) {
        double *to = hs_output_next(&output, HS_WANT_VECTOR);
        CHECK(hs_output_has_room(&output, 10));
        for (int e = 0; e < 30; e++) {
            to[e] = (double)(3 * n + e);
        }
        n += 10;
        output.n_pairs = n;
    }
    const double *vector = hs_output_column(&output, HS_WANT_VECTOR);
    bool          kept = true;
    for (int64_t e = 0; e < 3 * n; e++) {
        kept = kept && vector[e] == (double)e;
    }
    CHECK(kept && n <= 31250 && n + 10 > 31250 && account.held == 32 * n);
    CHECK(!hs_output_has_room(&output, 10));
    hs_output_free(&output);
    CHECK(account.held == 0);
}

/* What no memory holds is refused at once; guesses of it are forgotten. */
static void
endless_outputs_are_refused(void)
{
    hs_output output;
    hs_output_init(NULL, 8, HS_WANT_VECTOR | HS_WANT_SHIFT, 8, &output);
    CHECK(!hs_output_has_room(&output, 0));
    hs_output_expect(&output, 1e18);
    CHECK(output.capacity == 1024 && hs_output_has_room(&output, 1024));
    hs_output_expect(&output, INFINITY);
    CHECK(output.capacity == 1024 && !hs_output_has_room(&output, 1025));
    CHECK(hs_output_reserve(&output, INT64_C(1) << 57, 0.0) == HS_ERR_MEMORY);
    CHECK(hs_output_reserve(&output, INT64_C(1) << 60, 0.5) == HS_ERR_MEMORY);
    CHECK(output.capacity == 1024);
    CHECK(hs_output_reserve(&output, 2000, 0.0) == HS_OK && output.capacity >= 2000);
    hs_output_free(&output);
}

/* Memory of a result that was not taken is kept for the next one, and counts as what it is. */
static void
a_result_that_is_freed_is_held_with_all_it_wrote(void)
{
    const brute_scene *scene = scene_of(SCENE_ALIGNED, true);
    hs_options         options = options_of(scene);
    options.cutoff = 12.0;
    const unsigned wants[] = {HS_WANT_DISTANCE, HS_WANT_VECTOR, HS_WANT_SHIFT, HS_WANT_BOTH};
    const size_t   widths[] = {8, 24, 12, 16};
    const size_t   before = hs_pool_limit();
    hs_pool_set_limit((size_t)1 << 30);
    for (int w = 0; w < 4; w++) {
        hs_pool_clear();
        CHECK(hs_pool_held() == 0);
        options.want = wants[w];
        hs_pairs     *pairs = find_anew(scene, &options);
        const int64_t n = hs_pairs_length(pairs);
        CHECK(n > 400000);
        hs_pairs_free(pairs);
        /* Sanitizers watch malloc: nothing is kept from them. */
        CHECK(HS_WATCHED_MALLOC || hs_pool_held() >= (size_t)n * widths[w]);
    }
    hs_pool_clear();
    hs_pool_set_limit(before);
}

/* Where one column cannot grow, the others give back what they got, and have what they had. */
static void
columns_grow_together_or_not_at_all(void)
{
    for (int had = 0; had < 2; had++) {
        enum { MANY = 4000000, LITTLE = 1 << 20 }; /* more than what is there at first, in bytes */
        hs_output output;
        hs_pool_clear();
        hs_output_init(NULL, 2, HS_WANT_I | HS_WANT_J | HS_WANT_VECTOR, 8, &output);
        CHECK(!had || hs_output_reserve(&output, 3000, 0.0) == HS_OK);
        const int64_t capacity = output.capacity;
        for (int64_t e = 0; e < 100 * had; e++) {
            ((int64_t *)hs_output_column(&output, HS_WANT_I))[e] = e;
        }
        output.n_pairs = 100 * had;
        hs_test_fail_allocation(-3); /* the third and all behind it */
        CHECK(hs_output_reserve(&output, MANY, 0.0) == HS_ERR_MEMORY);
        hs_test_fail_allocation(0);
        CHECK(output.capacity == capacity && output.n_pairs == 100 * had);
        for (int k = 0; k < HS_QUANTITIES; k++) {
            const hs_region *column = &output.column[k];
            CHECK((column->data != NULL) == (had && (output.columns >> k & 1u)));
            CHECK(column->capacity <= LITTLE);
        }
        for (int64_t e = 0; e < 100 * had; e++) {
            CHECK(((int64_t *)hs_output_column(&output, HS_WANT_I))[e] == e);
        }
        CHECK(hs_output_reserve(&output, MANY, 0.0) == HS_OK);
        output.n_pairs = 0;
        hs_output_free(&output);
    }
}

static void
opposites_of_shifts_are_numbers(void)
{
    hs_failure failure = {.row = -1};
    for (int with = 0; with <= 1; with++) {
        hs_output output;
        hs_output_init(NULL, 2, HS_WANT_I | HS_WANT_J | (with ? HS_WANT_SHIFT : 0u), 4, &output);
        CHECK(hs_output_reserve(&output, 3, 0.0) == HS_OK);
        output.n_pairs = 3;
        int32_t *shift = hs_output_column(&output, HS_WANT_SHIFT);
        for (int32_t e = 0; e < 3; e++) {
            ((int32_t *)hs_output_column(&output, HS_WANT_J))[e] = 10 + e;
            for (int k = 0; with && k < 2; k++) {
                shift[2 * e + k] = e == 1 ? -INT32_MAX : INT32_MAX;
            }
        }
        CHECK(hs_output_check_opposites(&output, &failure) == HS_OK && failure.row == -1);
        if (with) {
            shift[5] = INT32_MIN;
            CHECK(hs_output_check_opposites(&output, &failure) == HS_ERR_SHIFT_RANGE);
            CHECK(failure.row == 12);
        }
        hs_output_free(&output);
    }
}

void
test_columns(void)
{
    RUN(every_quantity_goes_to_the_callers_arrays);
    RUN(many_pairs_go_to_the_callers_arrays);
    RUN(no_room_asks_for_the_number);
    RUN(no_pairs_need_no_room);
    RUN(the_callers_memory_is_not_counted);
    RUN(outputs_grow_to_their_limit);
    RUN(endless_outputs_are_refused);
    RUN(a_result_that_is_freed_is_held_with_all_it_wrote);
    RUN(columns_grow_together_or_not_at_all);
    RUN(opposites_of_shifts_are_numbers);
}
