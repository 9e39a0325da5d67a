/* SPDX-License-Identifier: BSD-3-Clause */
/* test_fill.c: a list that is filled at once is the one that is filled point by point; what cannot be
 * had leaves it empty. */
#include "../../../csrc/core/base/fpenv.h"
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/dynamic/fill.h"
#include "../../../csrc/core/dynamic/new_list.h"
#include "../../../csrc/core/dynamic/rows.h"
#include "../../../csrc/core/dynamic/update.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

void test_fill(void);

enum { N = 211 };

typedef enum box_kind { OPEN, ALIGNED, SLAB, SKEWED, BOX_KINDS } box_kind;

typedef struct rows {
    int64_t ids[N];
    int32_t tags[N];
    double  columns[HS_MAX_DIM][N];
    double *x[HS_MAX_DIM];
} rows;

/* Crowded and lone ones, in no order; twice the same id with another tag. */
static void
make_rows(rows *of)
{
    harness_random random = {29};
    for (int i = 0; i < N; i++) {
        of->ids[i] = (i * 77) % N / 2;
        of->tags[i] = (i * 77) % N % 2;
    }
    for (int k = 0; k < HS_MAX_DIM; k++) {
        of->x[k] = of->columns[k];
        for (int i = 0; i < N; i++)
            of->columns[k][i] = i < N / 3 ? 0.25 * random_unit(&random)
                                          : 9.0 * random_unit(&random) - 4.5;
    }
}

static hs_dynamic *
list_of(box_kind kind, int ndim, hs_storage storage)
{
    hs_box             box = {.ndim = ndim};
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    hs_failure         failure;
    for (int l = 0; l < ndim; l++) {
        box.periodic[l] = kind != SLAB || l > 0 || ndim == 1;
        box.rows[l][l] = 3.0 + 0.5 * l;
        if (kind == SKEWED && l > 0)
            box.rows[l][0] = 1.1;
    }
    options.ndim = ndim;
    options.box = kind == OPEN ? NULL : &box;
    options.storage = storage;
    options.cell_size = ndim > 4 ? 3.0 : 1.0;
    CHECK(hs_list_new(&options, &list, &failure) == HS_OK);
    return list;
}

static void
check_point(const hs_dynamic *list, const hs_dynamic *other, hs_key key)
{
    const uint32_t place = hs_key_map_find(&list->map, &list->entries, key);
    const uint32_t like = hs_key_map_find(&other->map, &other->entries, key);
    const size_t   width = (size_t)list->lattice.ndim * sizeof(double);
    CHECK(place != HS_NO_PLACE && like != HS_NO_PLACE);
    CHECK(memcmp(hs_entry_at(&list->entries, place), hs_entry_at(&other->entries, like), width) ==
          0);
    CHECK(memcmp(hs_entry_given(&list->entries, place), hs_entry_given(&other->entries, like),
                 width) == 0);
    const hs_entry_tail *tail = hs_entry_tail_at(&list->entries, place);
    const hs_cell        cell = list->cells.cell[tail->cell];
    const int64_t        capacity = INT64_C(1) << list->cells.size[tail->cell];
    CHECK(tail->id == key.id && tail->tag == key.tag);
    CHECK(place >= cell.start && place < cell.start + cell.count && cell.count <= capacity);
    CHECK(cell.count > capacity / 2 && cell.start + capacity <= list->entries.n_used);
}

static void
filled_lists_are_those_of_single_points(void)
{
    static rows of;
    make_rows(&of);
    for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
        for (int kind = OPEN; kind < BOX_KINDS; kind++) {
            for (int storage = 0; storage < 3; storage++) {
                hs_dynamic *list = list_of((box_kind)kind, ndim, (hs_storage)storage);
                hs_dynamic *single = list_of((box_kind)kind, ndim, (hs_storage)storage);
                hs_failure  failure = HS_NO_FAILURE;
                CHECK(hs_fill(list, of.ids, of.tags, N, of.x, &failure) == HS_OK);
                for (int64_t i = 0; i < N; i++) {
                    double    given[HS_MAX_DIM];
                    hs_placed placed;
                    CHECK(hs_rows_place(single, of.x, i, given, &placed, &failure) == HS_OK);
                    CHECK(hs_update_insert(single, (hs_key){of.ids[i], of.tags[i]}, &placed,
                                           &failure) == HS_OK);
                }
                CHECK(list->map.n == N && list->n_without == 0);
                CHECK(list->cells.dense || list->cells.n_empty == 0);
                CHECK(list->magnitude == single->magnitude);
                for (int64_t i = 0; i < N; i++)
                    check_point(list, single, (hs_key){of.ids[i], of.tags[i]});
                for (int64_t i = 0; i < N; i++)
                    CHECK(hs_update_remove(list, (hs_key){of.ids[i], of.tags[i]}));
                CHECK(list->map.n == 0);
                hs_list_free(single);
                hs_list_free(list);
            }
        }
    }
}

static void
keys_without_tags_have_tag_0(void)
{
    static rows of;
    hs_dynamic *list = list_of(OPEN, 3, HS_STORE_HASH);
    hs_failure  failure = HS_NO_FAILURE;
    make_rows(&of);
    for (int64_t i = 0; i < N; i++)
        of.ids[i] = -i;
    CHECK(hs_fill(list, of.ids, NULL, N, of.x, &failure) == HS_OK);
    for (int64_t i = 0; i < N; i++)
        CHECK(hs_key_map_find(&list->map, &list->entries, (hs_key){-i, 0}) != HS_NO_PLACE);
    hs_list_free(list);
}

/* One that held points before and has memory of them. */
static void
what_cannot_be_had_leaves_an_empty_list(void)
{
    static rows of;
    for (int kind = OPEN; kind < BOX_KINDS; kind++) {
        for (int storage = 0; storage < 2; storage++) {
            hs_dynamic *list = list_of((box_kind)kind, 2, (hs_storage)storage);
            hs_failure  failure = HS_NO_FAILURE;
            make_rows(&of);
            CHECK(hs_fill(list, of.ids, of.tags, N, of.x, &failure) == HS_OK);
            for (int64_t i = 0; i < N; i++)
                CHECK(hs_update_remove(list, (hs_key){of.ids[i], of.tags[i]}));
            of.columns[1][7] = 1e200;
            const hs_status status = hs_fill(list, of.ids, of.tags, N, of.x, &failure);
            if (kind == OPEN) {
                CHECK(status == (storage == HS_STORE_DENSE ? HS_ERR_CAPACITY : HS_OK));
                CHECK(status == HS_OK || failure.expected_bytes > failure.limit_bytes);
            } else {
                CHECK(status == HS_ERR_SHIFT_RANGE && failure.row == 7);
            }
            CHECK(status == HS_OK || (list->map.n == 0 && list->entries.n_used == 0));
            hs_list_clear(list);
            make_rows(&of);
            CHECK(hs_fill(list, of.ids, of.tags, N, of.x, &failure) == HS_OK && list->map.n == N);
            hs_list_free(list);
        }
    }
}

static hs_status
fill_once(void *context)
{
    hs_dynamic *list = context;
    static rows of;
    hs_failure  failure;
    make_rows(&of);
    const hs_status status = hs_fill(list, of.ids, of.tags, N, of.x, &failure);
    CHECK(list->map.n == (status == HS_OK ? N : 0));
    hs_list_clear(list);
    return status;
}

static void
refused_memory_leaves_an_empty_list(void)
{
    for (int storage = 0; storage < 3; storage++) {
        hs_dynamic *list = list_of(SKEWED, 3, (hs_storage)storage);
        CHECK(fail_each_allocation(fill_once, list, 100) > 4);
        hs_list_free(list);
    }
    hs_dynamic *wide = list_of(OPEN, 2, HS_STORE_HASH); /* whose table grows meanwhile */
    CHECK(fail_each_allocation(fill_once, wide, 100) > 8);
    hs_list_free(wide);
}

void
test_fill(void)
{
    const hs_fpenv env = hs_fpenv_enter();
    RUN(filled_lists_are_those_of_single_points);
    RUN(keys_without_tags_have_tag_0);
    RUN(what_cannot_be_had_leaves_an_empty_list);
    RUN(refused_memory_leaves_an_empty_list);
    hs_fpenv_leave(env);
}
