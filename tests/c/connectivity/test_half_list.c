/* SPDX-License-Identifier: BSD-3-Clause */
/* test_half_list.c: pairs are copied as they are; those that are no half list are refused with the
 * first that is wrong. */
#include "../../../csrc/core/connectivity/half_list.h"
#include "../support/node_scenes.h"

void test_half_list(void);

static node_scene scene;

/* The row of the failure, -1 for none. */
static int64_t
first_wrong(const hs_half_list *pairs, int64_t n)
{
    hs_failure      failure = {.row = -1};
    hs_output       copy;
    const hs_status status = hs_half_list_copy(NULL, pairs, n, &copy, &failure);
    if (status == HS_OK) {
        const hs_half_columns columns = hs_half_list_columns(&copy);
        const size_t          bytes = (size_t)pairs->n * sizeof(int32_t);
        CHECK(columns.n == pairs->n && (columns.shift != NULL) == (pairs->shift != NULL));
        CHECK(bytes == 0 ||
              (memcmp(columns.i, pairs->i, bytes) == 0 && memcmp(columns.j, pairs->j, bytes) == 0));
        CHECK(pairs->shift == NULL ||
              memcmp(columns.shift, pairs->shift, bytes * (size_t)pairs->ndim) == 0);
    }
    hs_output_free(&copy);
    CHECK((status == HS_OK) == (failure.row < 0));
    return failure.row;
}

static void
half_lists_are_copied(void)
{
    harness_random random = {5};
    for (int trial = 0; trial < 60; trial++) {
        node_scene_fill(&random, false, &scene);
        const hs_half_list half = node_half_of(&scene);
        CHECK(first_wrong(&half, scene.n) == -1);
    }
}

static void
pairs_in_images_ascend_by_shift(void)
{
    static const int32_t i[4] = {0, 0, 0, 1}, j[4] = {0, 1, 1, 1};
    static const int32_t good[8] = {0, 1, -1, 4, -1, 5, 2, -7};
    static const int32_t equal[8] = {0, 1, -1, 4, -1, 4, 2, -7};
    static const int32_t back[8] = {0, 1, -1, 4, -1, 3, 2, -7};
    static const int32_t self[8] = {0, 0, -1, 4, -1, 5, 2, -7};
    static const int32_t behind[8] = {0, 1, -1, 4, -1, 5, -2, 7};
    hs_half_list         half = {.n = 4, .i = i, .j = j, .shift = good, .ndim = 2};
    CHECK(first_wrong(&half, 2) == -1);
    half.shift = equal;
    CHECK(first_wrong(&half, 2) == 2);
    half.shift = back;
    CHECK(first_wrong(&half, 2) == 2);
    half.shift = self;
    CHECK(first_wrong(&half, 2) == 0);
    half.shift = behind;
    CHECK(first_wrong(&half, 2) == 3);
    half.shift = NULL;
    CHECK(first_wrong(&half, 2) == 0);
}

static void
what_is_no_half_list_is_refused(void)
{
    static const int32_t i[4] = {0, 0, 1, 2}, j[4] = {1, 3, 2, 3};
    hs_half_list         half = {.n = 4, .i = i, .j = j};
    CHECK(first_wrong(&half, 4) == -1);
    CHECK(first_wrong(&half, 3) == 1);
    static const int32_t turned[4] = {0, 3, 1, 2}, unsorted[4] = {0, 1, 0, 2}, twice[4] = {1, 1};
    static const int32_t below[4] = {-1, 0, 1, 2};
    half.i = turned;
    CHECK(first_wrong(&half, 4) == 1);
    half.i = unsorted;
    CHECK(first_wrong(&half, 4) == 2);
    static const int32_t lower[4] = {1, 0, 2, 3}, falling[4] = {3, 1, 2, 3};
    half.j = lower;
    CHECK(first_wrong(&half, 4) == 1);
    half.i = i;
    half.j = falling;
    CHECK(first_wrong(&half, 4) == 1);
    half.j = j;
    half.i = below;
    CHECK(first_wrong(&half, 4) == 0);
    half = (hs_half_list){.n = 2, .i = i, .j = twice};
    CHECK(first_wrong(&half, 4) == 1);
    hs_failure         failure;
    hs_output          copy;
    hs_account         account;
    hs_options         options = hs_options_default();
    const hs_half_list good = {.n = 4, .i = i, .j = j};
    options.memory_limit = 1.0;
    hs_account_init(&account, &options);
    CHECK(hs_half_list_copy(&account, &good, 4, &copy, &failure) == HS_ERR_MEMORY);
    hs_output_free(&copy);
    hs_account_close(&account);
    const hs_half_list wrong[] = {
        {.n = -1, .i = i, .j = j},
        {.n = 1, .j = j},
        {.n = 1, .i = i},
        {.n = 1, .i = i, .j = j, .shift = j, .ndim = 0},
        {.n = 1, .i = i, .j = j, .shift = j, .ndim = HS_MAX_DIM + 1},
    };
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        CHECK(hs_half_list_copy(NULL, &wrong[k], 4, &copy, &failure) == HS_ERR_ARGUMENT);
        hs_output_free(&copy);
    }
}

void
test_half_list(void)
{
    RUN(half_lists_are_copied);
    RUN(pairs_in_images_ascend_by_shift);
    RUN(what_is_no_half_list_is_refused);
}
