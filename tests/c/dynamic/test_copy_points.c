/* SPDX-License-Identifier: BSD-3-Clause */
/* test_copy_points.c: a copy has the points of the original, in the same order, and no empty cell. */
#include "../../../csrc/core/base/fpenv.h"
#include "../../../csrc/core/dynamic/copy_points.h"
#include "../../../csrc/core/dynamic/new_list.h"
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/halfshell_dynamic.h"
#include "../support/harness.h"

void test_copy_points(void);

static hs_dynamic *
new_list(hs_storage storage, bool skewed, int ndim)
{
    hs_box             box = {.ndim = ndim};
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    for (int l = 0; l < ndim; l++) {
        box.periodic[l] = true;
        box.rows[l][l] = 5.0;
        box.rows[l][0] += l > 0 ? 1.25 : 0.0;
    }
    options.ndim = ndim;
    options.storage = storage;
    options.box = skewed ? &box : NULL;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    return list;
}

/* Points that have wandered: cells are empty, blocks are too large. */
static void
let_wander(hs_dynamic *list, int ndim)
{
    harness_random random = {41};
    for (int step = 0; step < 400; step++) {
        double x[HS_MAX_DIM];
        for (int k = 0; k < ndim; k++)
            x[k] = 12.0 * random_unit(&random) - 6.0;
        const hs_key key = {(int64_t)(random_bits(&random) % 50), step % 2};
        CHECK(hs_dynamic_insert(list, key, x, NULL) == HS_OK);
        if (step % 3 == 0)
            (void)hs_dynamic_remove(list, (hs_key){(step * 7) % 50, 0});
    }
}

static void
check_equal(const hs_dynamic *list, const hs_dynamic *copy)
{
    const size_t  width = (size_t)list->lattice.ndim * sizeof(double);
    hs_key        keys[100], copied[100];
    int64_t       from = 0, to = 0;
    const int64_t n = hs_dynamic_keys(list, &from, keys, 100);
    CHECK(n > 30 && hs_dynamic_keys(copy, &to, copied, 100) == n);
    for (int64_t i = 0; i < n; i++) {
        CHECK(keys[i].id == copied[i].id && keys[i].tag == copied[i].tag);
        const uint32_t one = hs_key_map_find(&list->map, &list->entries, keys[i]);
        const uint32_t two = hs_key_map_find(&copy->map, &copy->entries, keys[i]);
        CHECK(memcmp(hs_entry_at(&list->entries, one), hs_entry_at(&copy->entries, two), width) ==
              0);
        CHECK(memcmp(hs_entry_given(&list->entries, one), hs_entry_given(&copy->entries, two),
                     width) == 0);
    }
    CHECK(copy->n_without == list->n_without);
    CHECK(copy->magnitude == list->magnitude && copy->entries.capacity <= list->entries.capacity);
}

static void
copies_are_equal_and_small(void)
{
    for (int ndim = 1; ndim <= 4; ndim++) {
        for (int kind = 0; kind < 6; kind++) {
            const hs_storage storage = (hs_storage)(kind % 3);
            hs_dynamic      *list = new_list(storage, kind >= 3, ndim);
            hs_dynamic      *copy = new_list(storage, kind >= 3, ndim);
            let_wander(list, ndim);
            if (storage == HS_STORE_ALL_PAIRS)
                CHECK(hs_dynamic_insert(list, (hs_key){99, 0}, NULL, NULL) == HS_OK);
            CHECK(hs_copy_points(list, copy) == HS_OK);
            check_equal(list, copy);
            CHECK(copy->cells.dense || copy->cells.n_empty == 0);
            CHECK(copy->cells.n <= list->cells.n);
            hs_dynamic_free(copy);
            hs_dynamic_free(list);
        }
    }
}

static void
nothing_is_copied_from_empty_lists(void)
{
    for (int storage = 0; storage < 3; storage++) {
        hs_dynamic   *list = new_list((hs_storage)storage, true, 2);
        hs_dynamic   *copy = new_list((hs_storage)storage, true, 2);
        const int64_t before = hs_test_live_blocks();
        CHECK(hs_copy_points(list, copy) == HS_OK && copy->map.n == 0);
        CHECK(hs_test_live_blocks() == before);
        let_wander(list, 2);
        int64_t cursor = 0;
        hs_key  key;
        while (cursor = 0, hs_dynamic_keys(list, &cursor, &key, 1) > 0)
            CHECK(hs_dynamic_remove(list, key));
        CHECK(hs_copy_points(list, copy) == HS_OK && copy->cells.n == 0);
        hs_dynamic_free(copy);
        hs_dynamic_free(list);
    }
}

static void
refused_memory_copies_no_points(void)
{
    for (int kind = 0; kind < 6; kind++) {
        hs_dynamic *list = new_list((hs_storage)(kind % 3), kind >= 3, 2);
        let_wander(list, 2);
        for (int nth = 1;; nth++) {
            hs_dynamic *copy = new_list((hs_storage)(kind % 3), kind >= 3, 2);
            hs_test_fail_allocation(nth);
            const hs_status status = hs_copy_points(list, copy);
            const bool      came = !hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(status == (came ? HS_ERR_MEMORY : HS_OK));
            CHECK(copy->map.n == (came ? 0 : list->map.n));
            hs_dynamic_free(copy);
            if (!came)
                break;
            CHECK(nth < 20);
        }
        hs_dynamic_free(list);
    }
}

void
test_copy_points(void)
{
    const hs_fpenv env = hs_fpenv_enter();
    RUN(copies_are_equal_and_small);
    RUN(nothing_is_copied_from_empty_lists);
    RUN(refused_memory_copies_no_points);
    hs_fpenv_leave(env);
}
