/* SPDX-License-Identifier: BSD-3-Clause */
/* test_new_list.c: copies are lists of their own; memory comes back; refused memory leaves nothing
 * behind. */
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/halfshell_dynamic.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include <math.h>

void test_new_list(void);

static void
copies_are_lists_of_their_own(void)
{
    for (int storage = 0; storage < 3; storage++) {
        hs_dynamic_options options = hs_dynamic_options_default();
        hs_dynamic        *list = NULL, *copy = NULL;
        double             x[3] = {0.5, 1.5, 2.5}, back[3];
        options.storage = (hs_storage)storage;
        CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
        CHECK(hs_dynamic_copy(list, &copy) == HS_OK && hs_dynamic_length(copy) == 0);
        hs_dynamic_free(copy);
        for (int64_t id = 0; id < 40; id++) {
            x[0] = (double)id;
            CHECK(hs_dynamic_insert(list, (hs_key){id, (int32_t)(id % 2)}, x, NULL) == HS_OK);
        }
        CHECK(hs_dynamic_copy(list, &copy) == HS_OK && hs_dynamic_length(copy) == 40);
        CHECK(hs_dynamic_look(copy).bytes <= hs_dynamic_look(list).bytes);
        hs_dynamic_clear(list);
        CHECK(hs_dynamic_length(list) == 0 && hs_dynamic_look(list).n_cells == 0);
        CHECK(hs_dynamic_position(copy, (hs_key){7, 1}, back) == HS_OK && back[0] == 7.0);
        CHECK(hs_dynamic_position(copy, (hs_key){7, 0}, back) == HS_ERR_KEY);
        hs_dynamic_free(list);
        hs_dynamic_free(copy);
    }
}

static void
refused_memory_leaves_nothing_behind(void)
{
    const int64_t            before = hs_test_live_blocks();
    const hs_dynamic_options options = hs_dynamic_options_default();
    for (int nth = 1; nth <= 4; nth++) {
        hs_dynamic *list = NULL;
        hs_test_fail_allocation(nth);
        CHECK(hs_dynamic_new(&options, &list, NULL) == HS_ERR_MEMORY && list == NULL);
        hs_test_fail_allocation(0);
        CHECK(hs_test_live_blocks() == before);
    }
}

static hs_status
copy_once(void *context)
{
    hs_dynamic     *copy = context; /* is set to NULL where there is none */
    const hs_status status = hs_dynamic_copy(context, &copy);
    CHECK((status == HS_OK) == (copy != NULL));
    CHECK(copy == NULL || hs_dynamic_length(copy) == 40);
    hs_dynamic_free(copy);
    return status;
}

static void
copies_are_whole_or_refused(void)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    options.ndim = 2;
    options.cell_size = 1.0;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    for (int64_t id = 0; id < 40; id++) {
        const double x[2] = {(double)id, 0.5 * (double)(id % 7)};
        CHECK(hs_dynamic_insert(list, (hs_key){id, 0}, x, NULL) == HS_OK);
    }
    CHECK(fail_each_allocation(copy_once, list, 400) > 5);
    hs_dynamic_free(list);
}

static void
options_are_checked(void)
{
    const hs_dynamic_options good = hs_dynamic_options_default();
    const hs_box             flat = {.ndim = 2, .periodic = {true, true}, .rows = {{1, 0}, {0, 1}}};
    const hs_box steep = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {0x1p80, 1.0}}};
    hs_dynamic_options bad[7] = {good, good, good, good, good, good, good};
    hs_dynamic        *list = NULL;
    bad[0].ndim = 0;
    bad[1].ndim = 9;
    bad[2].storage = (hs_storage)-1;
    bad[3].storage = (hs_storage)3;
    bad[4].grid_bytes = -1.0;
    bad[5].grid_bytes = NAN;
    bad[6].box = &flat;
    for (int b = 0; b < 7; b++)
        CHECK(hs_dynamic_new(&bad[b], &list, NULL) == HS_ERR_ARGUMENT && list == NULL);
    bad[6].ndim = 2;
    CHECK(hs_dynamic_new(&bad[6], &list, NULL) == HS_OK);
    hs_dynamic_free(list);
    bad[6].box = &steep;
    CHECK(hs_dynamic_new(&bad[6], &list, NULL) == HS_ERR_BOX_SKEWED && list == NULL);
}

void
test_new_list(void)
{
    RUN(copies_are_lists_of_their_own);
    RUN(refused_memory_leaves_nothing_behind);
    RUN(copies_are_whole_or_refused);
    RUN(options_are_checked);
}
