/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_dynamic_calls.c: calls that change a list, or ask for one point, refuse what they cannot
 * take, and then have done nothing. */
#include "../../../csrc/core/dynamic/dynamic.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"

#include <math.h>

void test_api_dynamic_calls(void);

static hs_dynamic *
list_with_two(void)
{
    const hs_dynamic_options options = hs_dynamic_options_default();
    const double             x[2][3] = {{0.5, 1.5, -2.5}, {4.0, 0.0, 0.0}};
    hs_dynamic              *list = NULL;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, x[0], NULL) == HS_OK);
    CHECK(hs_dynamic_insert(list, (hs_key){2, 0}, x[1], NULL) == HS_OK);
    return list;
}

static void
no_list_is_an_argument_error(void)
{
    const double    x[3] = {0.0, 0.0, 0.0};
    const int64_t   id = 1;
    const hs_key    key = {1, 0};
    const hs_points points = {.data = x,
                              .n = 1,
                              .ndim = 3,
                              .real = HS_FLOAT64,
                              .row_stride = sizeof x,
                              .column_stride = sizeof *x};
    double          back[3];
    int64_t         cell[3];
    hs_dynamic     *copy;
    CHECK(hs_dynamic_copy(NULL, &copy) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_insert(NULL, key, x, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_move(NULL, key, x, NULL) == HS_ERR_ARGUMENT);
    CHECK(!hs_dynamic_remove(NULL, key) && !hs_dynamic_has(NULL, key));
    CHECK(hs_dynamic_insert_many(NULL, &id, NULL, &points, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_remove_many(NULL, &id, NULL, 1, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_shrink_to_fit(NULL) == HS_ERR_ARGUMENT && hs_dynamic_length(NULL) == 0);
    CHECK(hs_dynamic_position(NULL, key, back) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_cell(NULL, key, cell) == HS_ERR_ARGUMENT);
    hs_dynamic_clear(NULL);
}

static void
missing_arguments_change_nothing(void)
{
    double          x[3] = {0.0, 0.0, 0.0};
    const int64_t   id = 1;
    const hs_key    key = {1, 0};
    const hs_points good = {.data = x,
                            .n = 1,
                            .ndim = 3,
                            .real = HS_FLOAT64,
                            .row_stride = sizeof x,
                            .column_stride = sizeof *x};
    hs_points       flat = good, bad = good;
    hs_failure      failure;
    hs_dynamic     *list = list_with_two();
    const int64_t   changes = hs_dynamic_look(list).changes;
    flat.ndim = 2;
    bad.n = -1;
    CHECK(hs_dynamic_copy(list, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_insert_many(list, &id, NULL, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_insert_many(list, &id, NULL, &flat, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_insert_many(list, NULL, NULL, &good, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_insert_many(list, &id, NULL, &bad, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_remove_many(list, &id, NULL, -1, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_remove_many(list, NULL, NULL, 1, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_position(list, key, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_cell(list, key, NULL) == HS_ERR_ARGUMENT);
    x[2] = NAN;
    CHECK(hs_dynamic_insert_many(list, &id, NULL, &good, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == 0 && failure.column == 2);
    CHECK(hs_dynamic_length(list) == 2 && hs_dynamic_look(list).changes == changes);
    hs_dynamic_free(list);
}

static void
cells_are_those_of_the_coordinates(void)
{
    const hs_box       box = {.ndim = 2, .periodic = {true, false}, .rows = {{6.0, 0}, {0, 1}}};
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = list_with_two();
    int64_t            cell[3] = {9, 9, 9};
    CHECK(hs_dynamic_cell(list, (hs_key){1, 0}, cell) == HS_OK);
    CHECK(cell[0] == 0 && cell[1] == 1 && cell[2] == -3);
    CHECK(hs_dynamic_cell(list, (hs_key){3, 0}, cell) == HS_ERR_KEY);
    hs_dynamic_free(list);
    options.ndim = 2;
    options.box = &box;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    for (int64_t id = 0; id < 12; id++) {
        const double x[2] = {(double)id - 20.0 + 0.25, (double)id - 6.0};
        CHECK(hs_dynamic_insert(list, (hs_key){id, 0}, x, NULL) == HS_OK);
        CHECK(hs_dynamic_cell(list, (hs_key){id, 0}, cell) == HS_OK);
        CHECK(cell[0] == (id + 1) % 6 && cell[1] == id - 6);
    }
    hs_dynamic_free(list);
    options.box = NULL;
    options.storage = HS_STORE_ALL_PAIRS;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, NULL, NULL) == HS_OK);
    CHECK(hs_dynamic_cell(list, (hs_key){1, 0}, cell) == HS_ERR_ARGUMENT); /* it has no position */
    hs_dynamic_free(list);
}

static void
cleared_lists_have_changed(void)
{
    hs_dynamic   *list = list_with_two();
    const int64_t changes = hs_dynamic_look(list).changes;
    hs_dynamic_clear(list);
    CHECK(hs_dynamic_length(list) == 0 && hs_dynamic_look(list).changes == changes + 1);
    CHECK(!hs_dynamic_remove(list, (hs_key){1, 0}));
    CHECK(hs_dynamic_look(list).changes == changes + 1);
    hs_dynamic_free(list);
}

void
test_api_dynamic_calls(void)
{
    RUN(no_list_is_an_argument_error);
    RUN(missing_arguments_change_nothing);
    RUN(cells_are_those_of_the_coordinates);
    RUN(cleared_lists_have_changed);
}
