/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_dynamic_list.c: lists as a whole: options, copies, keys in turn, and no list at all. */
#include "../../../csrc/halfshell_dynamic.h"
#include "../support/harness.h"

#include <math.h>

void test_api_dynamic_list(void);

static void
bad_options_are_refused(void)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    hs_failure         failure;
    const double       bad[] = {0.0, -1.0, NAN, INFINITY, 1e-100, 1e100};
    CHECK(hs_dynamic_new(NULL, &list, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_new(&options, NULL, NULL) == HS_ERR_ARGUMENT);
    for (int b = 0; b < 6; b++) {
        options.cell_size = bad[b];
        CHECK(hs_dynamic_new(&options, &list, &failure) == HS_ERR_CUTOFF && list == NULL);
        CHECK(failure.column == HS_LENGTH_CELL_SIZE);
        options.cell_size = 1.0;
        options.max_radius = bad[b];
        CHECK((hs_dynamic_new(&options, &list, &failure) == HS_OK) == (b == 0));
        CHECK(b == 0 || failure.column == HS_LENGTH_MAX_RADIUS);
        hs_dynamic_free(list);
        list = NULL;
        options.max_radius = 0.0;
    }
    options.ndim = 9;
    CHECK(hs_dynamic_new(&options, &list, &failure) == HS_ERR_ARGUMENT);
    hs_box box = {.ndim = 3};
    for (int l = 0; l < 3; l++) {
        box.periodic[l] = true;
        box.rows[l][l] = 4.0;
    }
    options.ndim = 3;
    options.box = &box;
    box.rows[0][0] = 1e-100;
    CHECK(hs_dynamic_new(&options, &list, &failure) == HS_ERR_CUTOFF &&
          failure.column == HS_LENGTH_BOX);
    box.rows[0][0] = 1e-5;
    options.max_radius = 1e3;
    CHECK(hs_dynamic_new(&options, &list, &failure) == HS_ERR_CUTOFF &&
          failure.column == HS_LENGTH_MAX_RADIUS);
    memset(box.rows[0], 0, sizeof box.rows[0]);
    CHECK(hs_dynamic_new(&options, &list, &failure) == HS_ERR_BOX_DEPENDENT);
}

static void
no_list_is_an_argument_to_refuse(void)
{
    hs_dynamic_counters counters;
    hs_dynamic         *list = NULL;
    hs_key              key = {0, 0};
    int64_t             cursor = 0;
    hs_dynamic_free(NULL);
    hs_dynamic_clear(NULL);
    hs_dynamic_hold(NULL);
    hs_dynamic_release(NULL);
    hs_dynamic_count(NULL, &counters);
    CHECK(hs_dynamic_copy(NULL, &list) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_shrink_to_fit(NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_keys(NULL, &cursor, &key, 1) == 0 && hs_dynamic_length(NULL) == 0);
    CHECK(hs_dynamic_look(NULL).n_points == 0 && !hs_dynamic_has(NULL, key));
}

/* Which ids 0, 1, ... of n come when keys are taken so many at a time; each must come once. */
static bool
keys_come_once(const hs_dynamic *list, int64_t n, int64_t at_a_time)
{
    hs_key  keys[8];
    int64_t cursor = 0, found = 0, sum = 0;
    for (int64_t got; (got = hs_dynamic_keys(list, &cursor, keys, at_a_time)) > 0; found += got) {
        for (int64_t k = 0; k < got; k++) {
            sum += keys[k].id;
        }
    }
    return found == n && sum == n * (n - 1) / 2;
}

static void
keys_come_in_turn_and_copies_hold_them(void)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list, *copy;
    hs_key             key = {0, 0};
    int64_t            cursor = -1;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    CHECK(hs_dynamic_keys(list, &cursor, &key, 1) == 0);
    CHECK(hs_dynamic_keys(list, NULL, &key, 1) == 0);
    cursor = 0;
    CHECK(hs_dynamic_keys(list, &cursor, NULL, 1) == 0);
    hs_dynamic_release(list); /* was not held */
    hs_dynamic_hold(list);
    for (key.id = 0; key.id < 20; key.id++) { /* five in each of four cells */
        CHECK(hs_dynamic_insert(list, key, (double[]){(double)(key.id % 4), 0.5, 0.5}, NULL) ==
              HS_OK);
    }
    hs_dynamic_release(list);
    CHECK(hs_dynamic_copy(list, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_copy(list, &copy) == HS_OK);
    for (int64_t n = 1; n <= 8; n++) {
        CHECK(keys_come_once(list, 20, n) && keys_come_once(copy, 20, n));
    }
    hs_dynamic_clear(list);
    CHECK(hs_dynamic_shrink_to_fit(list) == HS_OK && hs_dynamic_length(list) == 0);
    CHECK(hs_dynamic_length(copy) == 20 && hs_dynamic_look(copy).n_cells == 4);
    for (int k = 0; k < 3; k++) {
        CHECK(hs_dynamic_look(list).cell_size[k] == options.cell_size);
    }
    hs_dynamic_free(list);
    hs_dynamic_free(copy);
}

void
test_api_dynamic_list(void)
{
    RUN(bad_options_are_refused);
    RUN(no_list_is_an_argument_to_refuse);
    RUN(keys_come_in_turn_and_copies_hold_them);
}
