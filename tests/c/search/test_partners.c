/* SPDX-License-Identifier: BSD-3-Clause */
/* test_partners.c: each point has its partners in ascending order, those given twice twice;
 * whatever memory is refused, nothing is left. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/search/partners.h"
#include "../support/harness.h"

void test_partners(void);

static const int64_t      pairs[] = {3, 0, 1, 3, 0, 1, 2, 2, 1, 3};
static const hs_selection selection = {.excluded = pairs, .n_excluded = 5};

/* Whether row r holds these n numbers. */
static bool
holds(const hs_partners *partners, int64_t r, int64_t n, const int32_t *numbers)
{
    const int64_t first = partners->first[r];
    bool          same = partners->first[r + 1] - first == n;
    for (int64_t p = 0; same && p < n; p++) {
        same = partners->number[first + p] == numbers[p];
    }
    return same;
}

static void
pairs_of_points_count_both_ways(void)
{
    const int32_t    row0[] = {1, 3}, row1[] = {0, 3, 3}, row2[] = {2, 2}, row3[] = {0, 1, 1};
    const hs_options options = hs_options_default();
    hs_account       account;
    hs_partners      partners;
    hs_failure       failure = HS_NO_FAILURE;
    hs_account_init(&account, &options);
    CHECK(hs_partners_open(&selection, 4, 4, false, &account, &partners, &failure) == HS_OK);
    CHECK(holds(&partners, 0, 2, row0) && holds(&partners, 1, 3, row1));
    CHECK(holds(&partners, 2, 2, row2) && holds(&partners, 3, 3, row3));
    hs_partners_free(&account, &partners);
    hs_partners_free(&account, &partners);
    hs_account_close(&account);
}

static void
pairs_of_queries_count_from_these(void)
{
    const int32_t    row0[] = {1}, row1[] = {3, 3}, row2[] = {2}, row3[] = {0};
    const hs_options options = hs_options_default();
    hs_account       account;
    hs_partners      partners;
    hs_failure       failure = HS_NO_FAILURE;
    hs_account_init(&account, &options);
    CHECK(hs_partners_open(&selection, 5, 4, true, &account, &partners, &failure) == HS_OK);
    CHECK(holds(&partners, 0, 1, row0) && holds(&partners, 1, 2, row1));
    CHECK(holds(&partners, 2, 1, row2) && holds(&partners, 3, 1, row3));
    CHECK(holds(&partners, 4, 0, NULL));
    hs_partners_free(&account, &partners);
    hs_account_close(&account);
}

static void
numbers_of_no_point_are_refused(void)
{
    const int64_t    wrong[][2] = {{-1, 0}, {4, 0}, {0, -1}, {0, 4}};
    const hs_options options = hs_options_default();
    hs_account       account;
    hs_account_init(&account, &options);
    for (int w = 0; w < 4; w++) {
        const int64_t      two[] = {0, 1, wrong[w][0], wrong[w][1]};
        const hs_selection of = {.excluded = two, .n_excluded = 2};
        hs_partners        partners = {NULL, NULL};
        hs_failure         failure = HS_NO_FAILURE;
        CHECK(hs_partners_open(&of, 4, 4, false, &account, &partners, &failure) == HS_ERR_ARGUMENT);
        CHECK(failure.row == 1 && partners.first == NULL);
    }
    hs_account_close(&account);
}

static void
refused_memory_leaves_nothing(void)
{
    const hs_options options = hs_options_default();
    hs_account       account;
    hs_failure       failure = HS_NO_FAILURE;
    hs_account_init(&account, &options);
    for (int nth = 1; nth <= 4; nth++) {
        hs_partners partners = {NULL, NULL};
        hs_test_fail_allocation(nth);
        CHECK(hs_partners_open(&selection, 4, 4, false, &account, &partners, &failure) ==
              HS_ERR_MEMORY);
        hs_test_fail_allocation(0);
        hs_partners_free(&account, &partners);
    }
    hs_account_close(&account);
}

void
test_partners(void)
{
    RUN(pairs_of_points_count_both_ways);
    RUN(pairs_of_queries_count_from_these);
    RUN(numbers_of_no_point_are_refused);
    RUN(refused_memory_leaves_nothing);
}
