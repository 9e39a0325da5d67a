/* SPDX-License-Identifier: BSD-3-Clause */
/* test_neighbourhood.c: a block has room for what its header promises; groups know their extent;
 * runs are gathered as far as there is room, as they are near, and polled for. */
#include "../../../csrc/core/search/neighbourhood.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include <math.h>

void test_neighbourhood(void);

enum { N = 300, D = 3 };

static double  x[D][N + HS_PADDING];
static int32_t order[N + HS_PADDING];

static hs_bins
some_bins(uint64_t seed, int ndim)
{
    harness_random random = {seed};
    hs_bins        bins = {.n = N, .ndim = ndim, .order = order};
    for (int i = 0; i < N + HS_PADDING; i++) {
        order[i] = 7 * i;
        for (int k = 0; k < ndim; k++)
            x[k][i] = i < N ? 8.0 * random_unit(&random) - 3.0 : NAN;
    }
    for (int k = 0; k < ndim; k++)
        bins.x[k] = x[k];
    return bins;
}

static void
hits_are_twice_the_candidates_where_int32_holds_that(void)
{
    const int32_t half = INT32_MAX / 2;
    CHECK(hs_block_most_hits(1) == 1 + HS_BURST);
    CHECK(hs_block_most_hits(HS_BURST) == 2 * HS_BURST &&
          hs_block_most_hits(half - 1) == 2 * (half - 1));
    CHECK(hs_block_most_hits(half) == half && hs_block_most_hits(INT32_MAX) == INT32_MAX);
}

/* Arrays, filled to their ends with numbers of their own: `length` of `size` bytes. */
static void
fill(void *array, int64_t length, size_t size, int mark)
{
    memset(array, mark, (size_t)length * size);
}

static bool
is_filled(const void *array, int64_t length, size_t size, int mark)
{
    const unsigned char *bytes = array;
    for (int64_t b = 0; b < length * (int64_t)size; b++) {
        if (bytes[b] != mark)
            return false;
    }
    return true;
}

/* All of a block's arrays are filled, or compared with what they were filled with. */
static bool
each_array(const hs_block *block, int ndim, bool fills)
{
    const int64_t n = block->capacity + HS_PADDING, hits = block->most_hits + HS_PADDING;
    const struct {
        void   *array;
        int64_t length;
        size_t  size;
    } arrays[] = {{block->norm, n, sizeof(float)},
                  {block->id, n, sizeof(int32_t)},
                  {block->number, n, sizeof(int32_t)},
                  {block->hits, hits, sizeof(int32_t)},
                  {block->squares, hits, sizeof(float)},
                  {block->unsure, block->capacity, sizeof(hs_unsure)},
                  {block->runs, block->most_runs + 1, sizeof(hs_run)},
                  {block->y[0], n, sizeof(float)},
                  {ndim > 1 ? block->y[1] : NULL, n, sizeof(float)},
                  {ndim > 2 ? block->y[2] : NULL, n, sizeof(float)},
                  {block->place, n, sizeof(int32_t)}};
    bool right = true;
    for (int a = 0; a < 11; a++) {
        if (arrays[a].array == NULL)
            continue;
        if (fills)
            fill(arrays[a].array, arrays[a].length, arrays[a].size, 17 + a);
        right = right && is_filled(arrays[a].array, arrays[a].length, arrays[a].size, 17 + a);
    }
    return right;
}

static void
blocks_have_room_for_what_they_say(void)
{
    for (int trial = 0; trial < 5 * 40; trial++) {
        const hs_block_use use = (hs_block_use)(trial % 5);
        const int32_t      capacity = 1 + trial / 5, most_runs = 1 + trial % 7;
        const int          ndim = 1 + trial % D;
        const bool         squares = use == HS_BLOCK_LISTS_SQUARES;
        hs_options         options = hs_options_default();
        hs_account         account;
        hs_block           block;
        hs_account_init(&account, &options);
        CHECK(hs_block_init(&account, ndim, use, capacity, most_runs, &block) == HS_OK);
        CHECK(block.capacity == capacity && block.most_runs == most_runs);
        CHECK(block.n == 0 && block.n_runs == 0 && !hs_block_is_full(&block));
        CHECK((block.hits != NULL) == (use != HS_BLOCK_COUNTS));
        CHECK((block.squares != NULL) == squares && block.origin == NULL);
        CHECK((block.place != NULL) == (squares || use == HS_BLOCK_LISTS_PLACES));
        CHECK(each_array(&block, ndim, true) && each_array(&block, ndim, false));
        for (int k = 0; k < ndim; k++)
            CHECK((uintptr_t)block.y[k] % HS_ALIGNMENT == 0);
        hs_block_free(&account, &block);
        hs_block_free(&account, &block);
        CHECK(account.held == 0);
        for (int nth = 1, refused = 1; refused; nth++) {
            hs_test_fail_allocation(nth);
            refused = hs_block_init(&account, ndim, use, capacity, most_runs, &block) != HS_OK;
            hs_test_fail_allocation(0);
            CHECK(refused ? account.held == 0 : nth == 2); /* all arrays are one block */
            hs_block_free(&account, &block);
        }
        CHECK(account.held == 0);
    }
}

/* The middle point is the centre; the largest number is that of any axis and sign. */
static void
groups_know_their_extent(void)
{
    static hs_group group;
    for (int trial = 0; trial < 60; trial++) {
        const int     ndim = 1 + trial % D;
        const int32_t first = trial, last = first + 1 + trial * 7 % HS_GROUP_POINTS;
        hs_bins       bins = some_bins(40 + (uint64_t)trial, ndim);
        float         largest = 0.0f;
        group.near.out = 1.0f;
        hs_group_start(&bins, first, last, &group);
        CHECK(group.first == first && group.last == last && group.largest == 0);
        CHECK(group.near.out == INFINITY);
        CHECK(hs_group_bound(&bins, &group) >= 0.0f);
        for (int k = 0; k < ndim; k++) {
            float low = INFINITY, high = -INFINITY;
            CHECK(group.centre[k] == x[k][(first + last) / 2]);
            for (int32_t t = 0; t < last - first; t++) {
                const float q = (float)(x[k][first + t] - group.centre[k]);
                CHECK(group.q[k][t] == q);
                low = fminf(low, q);
                high = fmaxf(high, q);
            }
            CHECK(group.near.low[k] == low && group.near.high[k] == high);
            largest = fmaxf(largest, fmaxf(-low, high));
        }
        CHECK(hs_group_bound(&bins, &group) == largest);
        CHECK(group.largest == hs_bits_of_float(largest + 0.0f)); /* 0 has no sign then */
    }
}

/* Runs of `counts` points, in images of their own: as many as there is room for. */
static void
runs_are_appended_as_far_as_there_is_room(void)
{
    static hs_group group;
    hs_bins         bins = some_bins(3, 2);
    const double    shift[2] = {10.0, -20.0};
    const int32_t   image[HS_MAX_DIM] = {3, -4};
    hs_block        block;
    CHECK(hs_block_init(NULL, 2, HS_BLOCK_COUNTS, 100, 4, &block) == HS_OK);
    hs_group_start(&bins, 10, 20, &group);
    CHECK(hs_block_append(&block, 30, 90, 2, shift, image, &group) == 60);
    CHECK(block.n == 60 && block.n_runs == 1 && !hs_block_is_full(&block));
    CHECK(hs_block_append(&block, 95, 135, 2, shift, image, &group) == 40);
    CHECK(block.n == 100 && block.n_runs == 2 && hs_block_is_full(&block));
    block.n = 99;
    CHECK(!hs_block_is_full(&block));
    CHECK(hs_block_append(&block, 200, 260, 2, shift, image, &group) == 1);
    CHECK(block.n == 100 && block.n_runs == 3);
    static const int32_t ats[] = {0, 60, 99}, sis[] = {30, 95, 200};
    for (int r = 0; r < 3; r++) {
        const hs_run *run = &block.runs[r];
        CHECK(run->at == ats[r] && run->si == sis[r]);
        CHECK(run->image[0] == 3 && run->image[1] == -4);
        CHECK(run->moved[0] == 10.0 - group.centre[0] && run->moved[1] == -20.0 - group.centre[1]);
    }
    block.n = 5;
    CHECK(hs_block_append(&block, 7, 8, 2, shift, image, &group) == 1);
    CHECK(block.n_runs == 4 && hs_block_is_full(&block)); /* of runs */
    hs_block_free(NULL, &block);
}

/* The group itself and all points in another image, near or far. */
static void
what_is_near_is_gathered(void)
{
    static hs_group  group;
    const hs_options options = hs_options_default();
    const double     none[2] = {0.0}, moved[2] = {2.0, 0.25};
    const int32_t    home[HS_MAX_DIM] = {0}, image[HS_MAX_DIM] = {1};
    hs_bins          bins = some_bins(4, 2);
    for (int trial = 0; trial < 4; trial++) {
        const bool is_first = trial & 1, prunes = trial & 2;
        hs_block   block;
        float      largest = 0.0f;
        int32_t    n = 0;
        CHECK(hs_block_init(NULL, 2, HS_BLOCK_LISTS_PLACES, 2 * N, 5, &block) == HS_OK);
        hs_group_start(&bins, 20, 50, &group);
        if (prunes) {
            (void)hs_group_bound(&bins, &group);
            for (int k = 0; k < 2; k++) { /* near the first point of the group */
                group.near.low[k] = group.near.high[k] = (float)(x[k][20] - group.centre[k]);
            }
            group.near.out = 4.0f;
        }
        group.largest = 0;
        const int32_t first = is_first ? 20 : 0;
        if (is_first) {
            group.near.out = INFINITY;
        }
        CHECK(hs_block_append(&block, first, N, 2, none, home, &group) == N - first);
        CHECK(hs_block_append(&block, 0, N, 2, moved, image, &group) == N);
        memset(group.q, 0, sizeof group.q);
        CHECK(hs_block_gather(&bins, &hs_kernel_scalar, &options, is_first, &block, &group) ==
              HS_OK);
        for (int32_t c = first; c < N + N; c++) {
            const int32_t si = c < N ? c : c - N;
            float         y[2], square = 0.0f;
            for (int k = 0; k < 2; k++) {
                const double shift = c < N ? 0.0 : moved[k];
                y[k] = (float)(x[k][si] + (shift - group.centre[k]));
                const float past =
                    fmaxf(fmaxf(group.near.low[k] - y[k], y[k] - group.near.high[k]), 0.0f);
                square += past * past;
            }
            CHECK(c != N || block.runs[1].at == n);
            if (group.near.out < INFINITY && square > group.near.out)
                continue;
            CHECK(block.y[0][n] == y[0] && block.y[1][n] == y[1]);
            CHECK(fabsf(block.norm[n] - (y[0] * y[0] + y[1] * y[1])) < 1e-4f);
            CHECK(block.id[n] == 7 * si && block.number[n] == si);
            CHECK(!is_first || n >= 30 || (group.q[0][n] == y[0] && group.q[1][n] == y[1]));
            largest = fmaxf(largest, fmaxf(fabsf(y[0]), fabsf(y[1])));
            n++;
        }
        CHECK(is_first || group.q[0][0] == 0.0f);
        CHECK(group.q[0][30] == 0.0f && group.q[1][30] == 0.0f);
        CHECK(n == block.n && block.runs[0].at == 0 && block.runs[2].at == n);
        CHECK((prunes && !is_first) == (n < N - first + N) && n > 30);
        CHECK(group.largest == hs_bits_of_float(largest));
        for (int32_t c = 0; c < n + HS_PADDING; c++)
            CHECK(block.place[c] == c);
        for (int p = 0; p < HS_PADDING; p++)
            CHECK(block.y[0][n + p] == 0.0f && block.y[1][n + p] == 0.0f &&
                  block.norm[n + p] == 0.0f);
        hs_block_free(NULL, &block);
    }
}

/* Runs of one point each: the caller is asked between parts of them, and may end it. */
static void
gathering_many_runs_is_polled(void)
{
    static hs_group group;
    const double    none[1] = {0.0};
    const int32_t   home[HS_MAX_DIM] = {0};
    hs_bins         bins = some_bins(5, 1);
    for (int parts = 1; parts <= 3; parts++) {
        for (int more = 0; more < 2; more++) {
            for (int stop = 0; stop < 2; stop++) {
                const int32_t n = parts * HS_RUNS_PER_POLL + more;
                const int     polls = parts - 1 + more; /* not before the first part */
                refusal       counter = {.nth = stop ? polls : 0};
                hs_options    options = hs_options_default();
                hs_block      block;
                options.poll = refuse_once;
                options.poll_context = &counter;
                CHECK(hs_block_init(NULL, 1, HS_BLOCK_COUNTS, n, n, &block) == HS_OK);
                hs_group_start(&bins, 0, 1, &group);
                for (int32_t r = 0; r < n; r++)
                    (void)hs_block_append(&block, r % N, r % N + 1, 1, none, home, &group);
                CHECK(hs_block_gather(&bins, &hs_kernel_scalar, &options, false, &block, &group) ==
                      (stop && polls > 0 ? HS_ERR_INTERRUPTED : HS_OK));
                CHECK(counter.n == polls);
                CHECK((stop && polls > 0) ||
                      (block.n == n && block.number[n - 1] == (n - 1) % N &&
                       block.number[HS_RUNS_PER_POLL - 1] == (HS_RUNS_PER_POLL - 1) % N));
                hs_block_free(NULL, &block);
            }
        }
    }
}

void
test_neighbourhood(void)
{
    RUN(hits_are_twice_the_candidates_where_int32_holds_that);
    RUN(blocks_have_room_for_what_they_say);
    RUN(groups_know_their_extent);
    RUN(runs_are_appended_as_far_as_there_is_room);
    RUN(what_is_near_is_gathered);
    RUN(gathering_many_runs_is_polled);
}
