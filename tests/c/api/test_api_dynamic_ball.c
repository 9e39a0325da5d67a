/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_dynamic_ball.c: queries, keys in turn and calls in a row refuse what they cannot take. */
#include "../../../csrc/core/dynamic/dynamic.h"
#include "../support/harness.h"

#include <math.h>

void test_api_dynamic_ball(void);

static int
count_keys(hs_key key, const double *position, const int64_t *shift, void *user)
{
    (void)key, (void)position, (void)shift;
    ++*(int *)user;
    return 0;
}

static hs_dynamic *
line_of(int64_t n)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    options.ndim = 1;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    for (int64_t id = 0; id < n; id++) {
        const double x = 0.3 * (double)id;
        CHECK(hs_dynamic_insert(list, (hs_key){id, 0}, &x, NULL) == HS_OK);
    }
    return list;
}

static void
missing_arguments_are_refused(void)
{
    const double x = 0.0;
    hs_dynamic  *list = line_of(3);
    int          n = 0;
    bool         any = true;
    CHECK(hs_dynamic_near(NULL, &x, 1.0, count_keys, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_near(list, NULL, 1.0, count_keys, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_near(list, &x, 1.0, NULL, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_within(NULL, &x, 1.0, false, count_keys, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_within(list, NULL, 1.0, false, count_keys, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_within(list, &x, 1.0, false, NULL, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_any_within(NULL, &x, 1.0, NULL, &any, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_any_within(list, NULL, 1.0, NULL, &any, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_any_within(list, &x, 1.0, NULL, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(n == 0 && any);
    hs_dynamic_free(list);
}

static void
bad_balls_visit_nothing(void)
{
    const double x = 0.0, bad = NAN;
    const double radii[] = {-1.0, NAN, INFINITY, 1.0000001};
    hs_dynamic  *list = line_of(3);
    int          n = 0;
    bool         any = true;
    for (int r = 0; r < 4; r++) {
        hs_failure failure;
        CHECK(hs_dynamic_near(list, &x, radii[r], count_keys, &n, &failure) == HS_ERR_CUTOFF);
        CHECK(failure.value == radii[r] || isnan(radii[r]));
        CHECK(hs_dynamic_within(list, &x, radii[r], true, count_keys, &n, NULL) == HS_ERR_CUTOFF);
        CHECK(hs_dynamic_any_within(list, &x, radii[r], NULL, &any, NULL) == HS_ERR_CUTOFF);
    }
    CHECK(hs_dynamic_near(list, &bad, 0.5, count_keys, &n, NULL) == HS_ERR_NOT_FINITE);
    CHECK(n == 0 && any);
    hs_dynamic_free(list);
}

static void
keys_come_in_pieces_of_any_size(void)
{
    hs_dynamic *list = line_of(40);
    hs_key      keys[64];
    for (int64_t size = 1; size <= 41; size++) {
        bool    seen[40] = {false};
        int64_t cursor = 0, total = 0, n;
        while ((n = hs_dynamic_keys(list, &cursor, keys, size)) > 0) {
            CHECK(n <= size);
            for (int64_t k = 0; k < n; k++) {
                CHECK(!seen[keys[k].id]);
                seen[keys[k].id] = true;
            }
            total += n;
        }
        CHECK(total == 40 && hs_dynamic_keys(list, &cursor, keys, size) == 0);
    }
    int64_t       cursor = 0;
    const int64_t none = 0;
    int64_t       negative = -1;
    CHECK(hs_dynamic_keys(NULL, &cursor, keys, 1) == none);
    CHECK(hs_dynamic_keys(list, NULL, keys, 1) == none);
    CHECK(hs_dynamic_keys(list, &cursor, NULL, 1) == none && cursor == 0);
    CHECK(hs_dynamic_keys(list, &negative, keys, 1) == none);
    hs_dynamic_free(list);
}

static void
what_is_not_held_need_not_be_released(void)
{
    hs_dynamic *list = line_of(3);
    hs_dynamic_release(list);
    CHECK(hs_dynamic_length(list) == 3);
    hs_dynamic_hold(list);
    CHECK(hs_dynamic_length(list) == 3 && list->gate.state == -1);
    hs_dynamic_release(list);
    hs_dynamic_release(list);
    CHECK(list->gate.state == 0);
    hs_dynamic_free(list);
}

static void
counters_begin_at_zero(void)
{
    const double        x = 0.1;
    hs_dynamic         *list = line_of(9);
    hs_dynamic_counters counters = {.wraps = 7, .cells = 7, .candidates = 7, .exact = 7};
    int                 n = 0;
    hs_dynamic_count(NULL, &counters);
    CHECK(counters.cells == 7);
    hs_dynamic_count(list, &counters);
    CHECK(counters.cells == 0 && counters.wraps == 0);
    CHECK(hs_dynamic_within(list, &x, 1.0, false, count_keys, &n, NULL) == HS_OK);
    CHECK(counters.candidates >= n && n == 4);
    hs_dynamic_count(list, NULL);
    const int64_t before = counters.cells;
    CHECK(hs_dynamic_within(list, &x, 1.0, false, count_keys, &n, NULL) == HS_OK);
    CHECK(counters.cells == before);
    hs_dynamic_free(list);
}

void
test_api_dynamic_ball(void)
{
    RUN(missing_arguments_are_refused);
    RUN(bad_balls_visit_nothing);
    RUN(keys_come_in_pieces_of_any_size);
    RUN(what_is_not_held_need_not_be_released);
    RUN(counters_begin_at_zero);
}
