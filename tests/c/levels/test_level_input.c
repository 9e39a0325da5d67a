/* SPDX-License-Identifier: BSD-3-Clause */
/* test_level_input.c: a set is copied as it was given, its wrong rows are named, and a caller that
 * wants to stop is obeyed. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/levels/level_input.h"
#include "../support/harness.h"

#include <math.h>

void test_level_input(void);

enum { N = 3 };

static double rows[N][2] = {{0.0, 1.0}, {2.0, 3.0}, {4.0, 5.0}};

static const hs_points points = {.data = rows,
                                 .n = N,
                                 .ndim = 2,
                                 .real = HS_FLOAT64,
                                 .row_stride = sizeof rows[0],
                                 .column_stride = sizeof rows[0][0]};

/* What reading this set comes to, and what is wrong with it. It is freed. */
static hs_status
read_set(hs_division *by, hs_level_input *set, hs_failure *failure)
{
    hs_account       account;
    const hs_options options = hs_options_default();
    *failure = HS_NO_FAILURE;
    hs_account_init(&account, &options);
    by->account = &account;
    by->options = &options;
    set->points = &points;
    const hs_status status = hs_level_input_read(by, set, failure);
    for (int i = 0; status == HS_OK && i < N; i++) {
        CHECK(set->rows[2 * i] == rows[i][0] && set->rows[2 * i + 1] == rows[i][1]);
    }
    hs_level_input_free(&account, set);
    hs_account_close(&account);
    return status;
}

static hs_status
read_radii(hs_rule rule, double factor, const double *radii, hs_failure *failure)
{
    const hs_reach  reach = {.rule = rule};
    hs_division     by = {.reach = &reach, .factor = factor};
    hs_level_input  set = {.radii = radii, .are_queries = true};
    const hs_status status = read_set(&by, &set, failure);
    CHECK(status != HS_OK || by.largest == (rule == HS_RULE_MEAN ? 0.5 : 1.0) * radii[2]);
    return status;
}

static void
wrong_radii_are_named(void)
{
    const double wrong[] = {-1.0, NAN, INFINITY, 0x1p1023};
    double       radii[N] = {0.0, 1.0, 2.0};
    hs_failure   failure;
    CHECK(read_radii(HS_RULE_MAX, 1.0, radii, &failure) == HS_OK);
    CHECK(read_radii(HS_RULE_MEAN, 1.0, radii, &failure) == HS_OK);
    for (int w = 0; w < 4; w++) {
        radii[1] = wrong[w];
        CHECK(read_radii(HS_RULE_MAX, 1.0, radii, &failure) == HS_ERR_RADII);
        CHECK(failure.row == 1 && failure.in_queries);
        CHECK(failure.value == wrong[w] || isnan(wrong[w]));
    }
    radii[1] = 0x1p-1022; /* half of it is no ordinary number */
    CHECK(read_radii(HS_RULE_MAX, 1.0, radii, &failure) == HS_OK);
    CHECK(read_radii(HS_RULE_MEAN, 1.0, radii, &failure) == HS_ERR_RADII && failure.row == 1);
    radii[1] = 0x1p501;
    CHECK(read_radii(HS_RULE_MAX, 2.0, radii, &failure) == HS_ERR_RADII && failure.row == 1);
}

static void
types_are_counted(void)
{
    int32_t        types[N] = {1, 0, 1};
    int64_t        count[2] = {0, 0};
    const hs_reach reach = {.n_types = 2};
    hs_division    by = {.reach = &reach, .count = count, .factor = 1.0};
    hs_level_input set = {.types = types};
    hs_failure     failure;
    CHECK(read_set(&by, &set, &failure) == HS_OK && count[0] == 1 && count[1] == 2);
    for (int32_t wrong = -1; wrong <= 2; wrong += 3) {
        types[2] = wrong;
        set = (hs_level_input){.types = types};
        CHECK(read_set(&by, &set, &failure) == HS_ERR_TYPES);
        CHECK(failure.row == 2 && failure.value == wrong && !failure.in_queries);
    }
}

static void
points_that_are_not_finite_are_named(void)
{
    const double radii[N] = {1.0, 1.0, 1.0};
    const double before = rows[2][1];
    hs_failure   failure;
    rows[2][1] = NAN;
    CHECK(read_radii(HS_RULE_SUM, 1.0, radii, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == 2 && failure.column == 1 && failure.in_queries);
    rows[2][1] = before;
}

static bool
says_stop(void *context, double fraction)
{
    (void)fraction;
    ++*(int *)context;
    return false;
}

/* No poll before the first points, and one before each that follow. */
static void
passes_end_where_the_caller_stops(void)
{
    int         polls = 0;
    hs_options  options = hs_options_default();
    hs_division by = {.options = &options};
    hs_slice    next = {0, 0};
    hs_status   status = HS_OK;
    options.poll = says_stop;
    options.poll_context = &polls;
    CHECK(!hs_division_go_on(&by, 0, &next, &status) && status == HS_OK && polls == 0);
    CHECK(hs_division_go_on(&by, HS_POLL_POINTS + 5, &next, &status) && polls == 0);
    CHECK(next.first == 0 && next.end == HS_POLL_POINTS);
    CHECK(!hs_division_go_on(&by, HS_POLL_POINTS + 5, &next, &status));
    CHECK(status == HS_ERR_INTERRUPTED && polls == 1);
}

void
test_level_input(void)
{
    RUN(wrong_radii_are_named);
    RUN(types_are_counted);
    RUN(points_that_are_not_finite_are_named);
    RUN(passes_end_where_the_caller_stops);
}
