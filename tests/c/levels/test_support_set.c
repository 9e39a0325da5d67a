/* SPDX-License-Identifier: BSD-3-Clause */
/* test_support_set.c: supports as they are read: the lower triangle, a size, how far each reaches;
 * and the first that is wrong. */
#include "../../../csrc/core/exact/support.h"
#include "../../../csrc/core/levels/support_set.h"
#include "../support/poll_checks.h"

#include <math.h>

void test_support_set(void);

enum { N = 5 };

static double matrices[N * 9], reaches[N];

static hs_account
new_account(void)
{
    const hs_options options = hs_options_default();
    hs_account       account;
    hs_account_init(&account, &options);
    return account;
}

/* Diagonal 1, 2, 4 and beside it 0.25, for each point a power of two of that. */
static void
fill(int ndim)
{
    for (int i = 0; i < N; i++)
        for (int k = 0; k < ndim; k++)
            for (int l = 0; l < ndim; l++)
                matrices[(i * ndim + k) * ndim + l] = ldexp(k == l ? ldexp(1.0, k) : 0.25, i);
}

static void
numbers_are_entries_and_sizes(void)
{
    for (int ndim = 1; ndim <= 3; ndim++) {
        const hs_options options = hs_options_default();
        hs_account       account = new_account();
        hs_failure       failure;
        hs_support_set   set;
        const int        n_entries = hs_support_entries(ndim);
        fill(ndim);
        matrices[0] = 1.0;
        CHECK(hs_support_set_read(&account, &options, matrices, N, ndim, 3.0, &set, reaches,
                                  &failure) == HS_OK);
        for (int i = 0; i < N; i++) {
            const double *own = set.numbers + i * (n_entries + 1);
            double        reach;
            for (int k = 0; k < ndim; k++)
                for (int l = 0; l < ndim; l++)
                    CHECK(own[hs_support_at(k, l)] == matrices[(i * ndim + k) * ndim + l]);
            CHECK(own[n_entries] == hs_support_size(ndim, own));
            CHECK(hs_support_reach(ndim, own, 3.0, &reach) == HS_SUPPORT_FITS);
            CHECK(reaches[i] == reach);
        }
        hs_support_set_free(&account, &set);
        hs_support_set_free(&account, &set);
        CHECK(set.numbers == NULL && account.held == 0);
        hs_account_close(&account);
    }
}

static void
is_refused(hs_status status, int64_t row, double value)
{
    const hs_options options = hs_options_default();
    hs_account       account = new_account();
    hs_failure       failure = {.row = -1};
    hs_support_set   set;
    CHECK(hs_support_set_read(&account, &options, matrices, N, 3, 1.0, &set, reaches, &failure) ==
          status);
    CHECK(failure.row == row && set.numbers == NULL && account.held == 0);
    CHECK(failure.value == value || (isnan(failure.value) && isnan(value)));
    hs_account_close(&account);
}

static void
the_first_that_is_wrong_is_named(void)
{
    static const double wrong[] = {NAN, INFINITY, -INFINITY};
    for (int e = 0; e < 9; e++) {
        for (int w = 0; w < 3; w++) {
            fill(3);
            matrices[2 * 9 + e] = matrices[4 * 9] = wrong[w];
            is_refused(HS_ERR_SUPPORTS, 2, wrong[w]);
        }
        fill(3);
        matrices[3 * 9 + e] += 1.0; /* not symmetric, unless on the diagonal */
        if (e % 4 != 0) {           /* by its upper entry */
            is_refused(HS_ERR_SUPPORTS, 3, e % 3 > e / 3 ? 3.0 : 2.0);
        }
    }
    fill(3);
    matrices[9 + 4] = 0.0625;                    /* singular, or less */
    is_refused(HS_ERR_SUPPORTS, 1, matrices[9]); /* named by its first entry */
    fill(3);
    for (int e = 0; e < 9; e++)
        matrices[4 * 9 + e] *= 0x1p-1050;
    is_refused(HS_ERR_SUPPORT_REACH, 4, 1.0); /* the extent */
}

static hs_status
read_once(void *context)
{
    (void)context;
    const hs_options options = hs_options_default();
    hs_account       account = new_account();
    hs_failure       failure;
    hs_support_set   set;
    const hs_status  status =
        hs_support_set_read(&account, &options, matrices, N, 3, 1.0, &set, reaches, &failure);
    CHECK((status == HS_OK) == (set.numbers != NULL));
    hs_support_set_free(&account, &set);
    CHECK(account.held == 0);
    hs_account_close(&account);
    return status;
}

static void
nothing_leaks_when_memory_is_short(void)
{
    fill(3);
    CHECK(fail_each_allocation(read_once, NULL, 10) >= 1);
}

void
test_support_set(void)
{
    RUN(numbers_are_entries_and_sizes);
    RUN(the_first_that_is_wrong_is_named);
    RUN(nothing_leaks_when_memory_is_short);
}
