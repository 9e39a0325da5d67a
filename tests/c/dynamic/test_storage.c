/* SPDX-License-Identifier: BSD-3-Clause */
/* test_storage.c: keys and cells of a dynamic list, of equal hashes, and where there is no room. */
#include "../../../csrc/core/dynamic/dynamic.h"
#include "../../../csrc/core/memory/memory.h"
#include "../support/harness.h"

#include <math.h>

void test_storage(void);

/* Of 2^18 keys, or cells, some have the same 32 bits of their hash. */
enum { MANY = 1 << 18 };

static hs_dynamic *
list_of(int ndim, hs_storage storage, const hs_box *box, double grid_bytes)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    options.ndim = ndim;
    options.storage = storage;
    options.box = box;
    options.grid_bytes = grid_bytes;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    return list;
}

static hs_status
put(hs_dynamic *list, int64_t id, double x, double y, hs_failure *failure)
{
    return hs_dynamic_insert(list, (hs_key){id, 0}, (const double[2]){x, y}, failure);
}

static int
count(hs_key key, const double *position, const int64_t *shift, void *user)
{
    (void)key, (void)position, (void)shift;
    ++*(int *)user;
    return 0;
}

/* How many points a near query tells. */
static int
near(const hs_dynamic *list, double x, double y)
{
    int n = 0;
    CHECK(hs_dynamic_near(list, (const double[2]){x, y}, 0.0, count, &n, NULL) == HS_OK);
    return n;
}

/* Keys that differ in their ids, or in the tags of one id, come and go one by one and at once; in
 * descending order it takes a table to see that none is repeated. */
static void
keys_of_equal_marks_are_told_apart(void)
{
    static int64_t ids[MANY];
    static int32_t tags[MANY];
    static double  x[MANY];
    static bool    removed[MANY];
    hs_points      points = {x, MANY, 1, HS_FLOAT64, sizeof *x, sizeof *x};
    for (int tagged = 0; tagged < 2; tagged++) {
        hs_dynamic *list = list_of(1, HS_STORE_HASH, NULL, 0.0);
        for (int i = 0; i < MANY; i++) {
            ids[i] = tagged ? 0 : MANY - i;
            tags[i] = tagged ? MANY - i : 0;
            x[i] = (double)(i % 1000);
        }
        for (int i = 0; i < MANY; i += 2)
            CHECK(hs_dynamic_insert(list, (hs_key){ids[i], tags[i]}, &x[i], NULL) == HS_OK);
        CHECK(hs_dynamic_length(list) == MANY / 2);
        for (int i = 0; i < MANY; i++)
            CHECK(hs_dynamic_has(list, (hs_key){ids[i], tags[i]}) == (i % 2 == 0));
        CHECK(hs_dynamic_insert_many(list, ids, tags, &points, NULL) == HS_OK);
        CHECK(hs_dynamic_length(list) == MANY);
        CHECK(hs_dynamic_remove_many(list, ids, tags, MANY / 2, removed, NULL) == HS_OK);
        for (int i = 0; i < MANY; i++)
            CHECK(hs_dynamic_has(list, (hs_key){ids[i], tags[i]}) == (i >= MANY / 2));
        hs_dynamic_free(list);
    }
}

static void
ascending_keys_are_not_repeated(void)
{
    const int64_t ids[5] = {-7, 0, 0, 0, 9};
    const int32_t tags[5] = {5, -2, 3, 4, 1}, same[5] = {5, -2, 3, 3, 1};
    hs_dynamic   *list = list_of(1, HS_STORE_HASH, NULL, 0.0);
    hs_failure    failure;
    CHECK(hs_dynamic_remove_many(list, ids, tags, 5, NULL, &failure) == HS_OK);
    CHECK(hs_dynamic_remove_many(list, ids, NULL, 5, NULL, &failure) == HS_ERR_KEY);
    CHECK(failure.row == 2 && failure.column == HS_KEY_REPEATED);
    CHECK(hs_dynamic_remove_many(list, ids, same, 5, NULL, &failure) == HS_ERR_KEY);
    CHECK(failure.row == 3 && failure.column == HS_KEY_REPEATED);
    hs_test_fail_allocation(1);
    CHECK(hs_dynamic_remove_many(list, ids, tags, 5, NULL, &failure) == HS_OK); /* no table */
    CHECK(hs_dynamic_remove_many(list, ids, same, 5, NULL, &failure) == HS_ERR_MEMORY);
    hs_test_fail_allocation(0);
    hs_dynamic_free(list);
}

static void
cells_of_equal_marks_are_told_apart(void)
{
    hs_dynamic *list = list_of(2, HS_STORE_HASH, NULL, 0.0);
    for (int i = 0; i < MANY; i++)
        CHECK(put(list, i, i + 0.5, 0.5, NULL) == HS_OK);
    CHECK(hs_dynamic_look(list).n_cells == MANY);
    for (int i = 0; i < MANY; i++)
        CHECK(near(list, i + 0.5, 0.5) == 1);
    hs_dynamic_free(list);
}

/* An eager extension that would not fit is made as small as it can be; if that does not fit either,
 * its bytes are told. */
static void
dense_tables_have_a_limit(void)
{
    const hs_box box = {.ndim = 2, .periodic = {false, true}, .rows = {{0.0}, {0.0, 5.0}}};
    hs_dynamic  *list = list_of(2, HS_STORE_DENSE, &box, 5000.0);
    hs_failure   failure;
    CHECK(near(list, 0.5, 0.5) == 0);
    CHECK(put(list, 0, 0.5, 0.5, NULL) == HS_OK && hs_dynamic_look(list).n_cells == 5);
    CHECK(put(list, 1, 99.5, 4.5, NULL) == HS_OK && hs_dynamic_look(list).n_cells == 500);
    CHECK(put(list, 2, 104.5, 4.5, NULL) == HS_OK && hs_dynamic_look(list).n_cells == 525);
    CHECK(put(list, 3, 200.5, 0.5, &failure) == HS_ERR_CAPACITY);
    CHECK(hs_dynamic_look(list).n_cells == 525 && hs_dynamic_length(list) == 3);
    CHECK(failure.expected_bytes == 201 * 5 * 9 && failure.limit_bytes == 5000);
    CHECK(near(list, 0.5, 0.5) == 1 && near(list, 99.5, -0.5) == 1 && near(list, 98.5, 4.5) == 0);
    CHECK(near(list, -1.5, 0.5) == 0 && near(list, 105.5, 0.5) == 0);
    hs_dynamic_free(list);
    list = list_of(2, HS_STORE_DENSE, &box, INFINITY);
    CHECK(put(list, 0, 0.5, 0.5, NULL) == HS_OK);
    CHECK(put(list, 1, 0x1p52, 0.5, &failure) == HS_ERR_CAPACITY);
    hs_dynamic_free(list);
}

/* A table that is full and may not grow drops what is empty, however little that is: where memory
 * is refused, and where there are no numbers for more cells. */
static void
empty_cells_make_room(void)
{
    for (int how = 0; how < 2; how++) {
        hs_dynamic *list = list_of(2, HS_STORE_HASH, NULL, 0.0);
        int64_t     id = 0;
        do
            CHECK(put(list, id, (double)id + 0.5, 0.5, NULL) == HS_OK);
        while (++id < list->cells.capacity);
        CHECK(list->cells.n == list->cells.capacity && list->cells.n_empty == 0);
        if (how == 1) {
            const int64_t n = list->cells.n; /* as if there were so many */
            list->cells.n = list->cells.capacity = INT64_C(0xFFFFFFF0);
            CHECK(put(list, id, -0.5, 0.5, NULL) == HS_ERR_MEMORY);
            list->cells.n = list->cells.capacity = n;
        }
        CHECK(hs_dynamic_remove(list, (hs_key){1, 0}) && list->cells.n_empty == 1);
        hs_test_fail_allocation(how == 0);
        CHECK(put(list, 1, -0.5, 0.5, NULL) == HS_OK);
        CHECK(how == 1 || (list->cells.n == id && list->cells.n_empty == 0));
        hs_test_fail_allocation(0);
        for (int64_t k = 0; k < id; k++)
            CHECK(near(list, (double)k + 0.5, 0.5) == (k != 1));
        CHECK(near(list, -0.5, 0.5) == 1);
        hs_dynamic_free(list);
    }
}

void
test_storage(void)
{
    RUN(keys_of_equal_marks_are_told_apart);
    RUN(ascending_keys_are_not_repeated);
    RUN(cells_of_equal_marks_are_told_apart);
    RUN(dense_tables_have_a_limit);
    RUN(empty_cells_make_room);
}
