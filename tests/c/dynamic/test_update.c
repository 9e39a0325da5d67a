/* SPDX-License-Identifier: BSD-3-Clause */
/* test_update.c: whatever memory is refused, a call does all or nothing, one point or many. */
#include "../../../csrc/core/memory/account.h"
#include "../support/dynamic_brute.h"

#include <math.h>

void test_update(void);

enum { ROWS = 24 };

static hs_dynamic *
new_list(hs_storage storage, bool periodic, brute_list *brute)
{
    static hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{6.0, 0.0}, {0.0, 6.0}}};
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    options.ndim = 2;
    options.storage = storage;
    options.box = periodic ? &box : NULL;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    brute_init(brute, &options, 9);
    return list;
}

static void
set(hs_dynamic *list, brute_list *brute, int key, double x, double y)
{
    const double position[2] = {x, y};
    CHECK(hs_dynamic_insert(list, (hs_key){key, 0}, position, NULL) == HS_OK);
    brute->has[key] = true;
    memcpy(brute->position[key], position, sizeof position);
}

static void
check_same(const hs_dynamic *list, const brute_list *brute)
{
    CHECK(hs_dynamic_length(list) == brute_length(brute));
    for (int key = 0; key < BRUTE_KEYS; key++) {
        double x[2];
        if (brute->has[key]) {
            CHECK(hs_dynamic_position(list, (hs_key){key, 0}, x) == HS_OK);
            CHECK(memcmp(x, brute->position[key], sizeof x) == 0);
            brute_check(brute, list, x, 1.0);
        }
    }
}

/* Points 0 to 19; then rows that move half of them and add others, all to other cells. */
static void
make_rows(int64_t *ids, double rows[][2])
{
    for (int r = 0; r < ROWS; r++) {
        ids[r] = 10 + r;
        rows[r][0] = 0.37 * r - 3.0;
        rows[r][1] = r % 3 == 0 ? 2.5 : 0.21 * r;
    }
}

static hs_status
put_rows(hs_dynamic *list, const int64_t *ids, double rows[][2], hs_failure *failure)
{
    const hs_points points = {.data = rows,
                              .n = ROWS,
                              .ndim = 2,
                              .real = HS_FLOAT64,
                              .row_stride = 2 * sizeof(double),
                              .column_stride = sizeof(double)};
    return hs_dynamic_insert_many(list, ids, NULL, &points, failure);
}

static void
refused_memory_changes_nothing(void)
{
    static brute_list brute;
    int64_t           ids[ROWS];
    double            rows[ROWS][2];
    const int64_t     before = hs_test_live_blocks();
    make_rows(ids, rows);
    for (int kind = 0; kind < 6; kind++) {
        for (int64_t nth = 1;; nth++) {
            hs_dynamic *list = new_list((hs_storage)(kind % 3), kind >= 3, &brute);
            for (int key = 0; key < 20; key++)
                set(list, &brute, key, 0.4 * key, 1.0 + 0.1 * key);
            hs_test_fail_allocation(nth);
            const hs_status status = put_rows(list, ids, rows, NULL);
            const bool      came = !hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(status == (came ? HS_ERR_MEMORY : HS_OK));
            if (status == HS_ERR_MEMORY) {
                check_same(list, &brute);
                CHECK(put_rows(list, ids, rows, NULL) == HS_OK);
            }
            for (int r = 0; r < ROWS; r++) {
                brute.has[ids[r]] = true;
                memcpy(brute.position[ids[r]], rows[r], sizeof rows[r]);
            }
            check_same(list, &brute);
            hs_dynamic_free(list);
            if (!came)
                break;
            CHECK(nth < 100);
        }
    }
    CHECK(hs_test_live_blocks() == before);
}

/* Each allocation of a history of single calls, once: the call that meets it is made again. */
static void
single_calls_survive_refused_memory(void)
{
    static brute_list brute;
    for (int kind = 0; kind < 6; kind++) {
        for (int64_t nth = 1;; nth++) {
            hs_dynamic *list = new_list((hs_storage)(kind % 3), kind >= 3, &brute);
            hs_dynamic *copy = NULL;
            bool        came = false;
            hs_test_fail_allocation(nth);
            for (int step = 0; step < 60; step++) {
                const int    key = step * 7 % 40;
                const double x[2] = {0.71 * step - 20.0, step % 5};
                hs_status    status = hs_dynamic_insert(list, (hs_key){key, 0}, x, NULL);
                if (status != HS_OK) {
                    CHECK(status == HS_ERR_MEMORY);
                    CHECK(hs_dynamic_has(list, (hs_key){key, 0}) == brute.has[key]);
                    status = hs_dynamic_insert(list, (hs_key){key, 0}, x, NULL);
                    CHECK(status == HS_OK);
                }
                brute.has[key] = true;
                memcpy(brute.position[key], x, sizeof x);
            }
            if (hs_dynamic_copy(list, &copy) != HS_OK)
                CHECK(copy == NULL && hs_dynamic_copy(list, &copy) == HS_OK);
            if (hs_dynamic_shrink_to_fit(list) != HS_OK)
                CHECK(hs_dynamic_shrink_to_fit(list) == HS_OK);
            came = !hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            if (nth % 8 == 1 || !came) {
                check_same(list, &brute);
                check_same(copy, &brute);
            }
            hs_dynamic_free(copy);
            hs_dynamic_free(list);
            if (!came)
                break;
            CHECK(nth < 1000);
        }
    }
}

/* Crowds that come and go, each in a cell where none was before: the memory of one is that of the
 * next, whether its points are moved, or removed and put in again. */
static void
cells_that_are_left_lend_their_memory(void)
{
    enum { CROWD = 64, CELLS = 40 };
    static brute_list brute;
    for (int moves = 0; moves < 2; moves++) {
        hs_dynamic *list = new_list(HS_STORE_HASH, false, &brute);
        int64_t     bytes = 0;
        for (int c = 0; c < CELLS; c++) {
            for (int key = 0; key < CROWD; key++) {
                const double at[2] = {4.0 * c, 0.5};
                if (!moves)
                    CHECK(hs_dynamic_remove(list, (hs_key){key, 0}) == (c > 0));
                CHECK(hs_dynamic_insert(list, (hs_key){key, 0}, at, NULL) == HS_OK);
            }
            const int64_t now = hs_dynamic_look(list).bytes;
            bytes = c == 4 ? now : bytes;
            /* cells are remembered; a crowd takes some 2 kB more */
            CHECK(c < 4 || now - bytes < CELLS * 128);
        }
        CHECK(hs_dynamic_length(list) == CROWD && bytes > CROWD * 24);
        hs_dynamic_free(list);
    }
}

static void
refused_rows_change_nothing(void)
{
    static brute_list brute;
    int64_t           ids[ROWS];
    double            rows[ROWS][2];
    hs_failure        failure;
    bool              removed[ROWS];
    for (int storage = 0; storage < 2; storage++) {
        hs_dynamic *list = new_list((hs_storage)storage, false, &brute);
        set(list, &brute, 12, 1.0, 1.0);
        make_rows(ids, rows);
        rows[20][1] = NAN;
        CHECK(put_rows(list, ids, rows, &failure) == HS_ERR_NOT_FINITE);
        CHECK(failure.row == 20 && failure.column == 1);
        rows[20][1] = storage == HS_STORE_DENSE ? 1e12 : 1.0;
        if (storage == HS_STORE_DENSE)
            CHECK(put_rows(list, ids, rows, &failure) == HS_ERR_CAPACITY &&
                  failure.expected_bytes > failure.limit_bytes);
        rows[20][1] = 1.0;
        ids[9] = ids[4];
        CHECK(put_rows(list, ids, rows, &failure) == HS_ERR_KEY && failure.row == 9);
        CHECK(hs_dynamic_remove_many(list, ids, NULL, ROWS, removed, &failure) == HS_ERR_KEY);
        check_same(list, &brute);
        make_rows(ids, rows);
        CHECK(hs_dynamic_remove_many(list, ids, NULL, ROWS, removed, &failure) == HS_OK);
        for (int r = 0; r < ROWS; r++)
            CHECK(removed[r] == (ids[r] == 12));
        CHECK(hs_dynamic_length(list) == 0);
        hs_dynamic_free(list);
    }
}

/* Few rows among many cells: as all of them, and all or nothing. */
static void
few_rows_among_many_cells(void)
{
    enum { SOME = 6, MANY = 400 };
    static brute_list brute;
    int64_t           ids[MANY];
    double            rows[MANY][2];
    hs_points         points = {.data = rows,
                                .n = MANY,
                                .ndim = 2,
                                .real = HS_FLOAT64,
                                .row_stride = 2 * sizeof(double),
                                .column_stride = sizeof(double)};
    for (int storage = 0; storage < 2; storage++) {
        for (int64_t nth = 1;; nth++) {
            hs_dynamic *list = new_list((hs_storage)storage, false, &brute);
            points.n = MANY;
            for (int r = 0; r < MANY; r++) {
                ids[r] = 1000 + r;
                rows[r][0] = r % 20 * 1.5 + 100.0;
                rows[r][1] = 1.5 * (r / 20);
            }
            CHECK(hs_dynamic_insert_many(list, ids, NULL, &points, NULL) == HS_OK);
            points.n = SOME;
            for (int r = 0; r < SOME; r++) {
                ids[r] = 60 - r;
                rows[r][0] = r < 4 ? 110.0 + 0.01 * r : 100.0 + r; /* four in one cell */
                rows[r][1] = 10.0;
            }
            hs_test_fail_allocation(nth);
            const hs_status status = hs_dynamic_move_many(list, ids, NULL, &points, NULL);
            CHECK(status == HS_ERR_KEY || status == HS_ERR_MEMORY);
            const hs_status put = hs_dynamic_insert_many(list, ids, NULL, &points, NULL);
            const bool      came = !hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(put == HS_OK || put == HS_ERR_MEMORY);
            CHECK(hs_dynamic_length(list) == MANY + (put == HS_OK ? SOME : 0));
            CHECK(hs_dynamic_insert_many(list, ids, NULL, &points, NULL) == HS_OK);
            for (int r = 0; r < SOME; r++) {
                double x[2];
                CHECK(hs_dynamic_position(list, (hs_key){ids[r], 0}, x) == HS_OK);
                CHECK(memcmp(x, rows[r], sizeof x) == 0);
            }
            CHECK(hs_dynamic_length(list) == MANY + SOME);
            hs_dynamic_free(list);
            if (!came)
                break;
            CHECK(nth < 100);
        }
    }
}

static void
rows_have_tags(void)
{
    static brute_list brute;
    int64_t           ids[ROWS];
    int32_t           tags[ROWS];
    double            rows[ROWS][2], x[2];
    bool              removed[ROWS];
    hs_failure        failure;
    hs_dynamic       *list = new_list(HS_STORE_HASH, true, &brute);
    const hs_points   points = {.data = rows,
                                .n = ROWS,
                                .ndim = 2,
                                .real = HS_FLOAT64,
                                .row_stride = 2 * sizeof(double),
                                .column_stride = sizeof(double)};
    make_rows(ids, rows);
    for (int r = 0; r < ROWS; r++) {
        tags[r] = r % 2 == 0 ? 7 : -7;
        ids[r] = -(r / 2);
    }
    for (int round = 0; round < 2; round++) { /* into an empty list, and over what is there */
        CHECK(hs_dynamic_insert_many(list, ids, tags, &points, &failure) == HS_OK);
        CHECK(hs_dynamic_length(list) == ROWS);
        for (int r = 0; r < ROWS; r++) {
            CHECK(hs_dynamic_position(list, (hs_key){ids[r], tags[r]}, x) == HS_OK);
            CHECK(memcmp(x, rows[r], sizeof x) == 0);
            rows[r][1] += 0.75;
        }
    }
    CHECK(hs_dynamic_move_many(list, ids, tags, &points, &failure) == HS_OK);
    tags[5] = 1;
    CHECK(hs_dynamic_move_many(list, ids, tags, &points, &failure) == HS_ERR_KEY);
    CHECK(failure.row == 5 && failure.column == 1);
    rows[9][0] = 1e200;
    tags[5] = -7;
    CHECK(hs_dynamic_move_many(list, ids, tags, &points, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(failure.row == 9);
    CHECK(hs_dynamic_remove_many(list, ids, tags, ROWS, NULL, &failure) == HS_OK);
    CHECK(hs_dynamic_length(list) == 0);
    CHECK(hs_dynamic_remove_many(list, ids, tags, ROWS, removed, &failure) == HS_OK);
    CHECK(!removed[0] && !removed[ROWS - 1]);
    hs_dynamic_free(list);
}

static void
no_rows_are_no_change(void)
{
    static brute_list brute;
    hs_dynamic       *list = new_list(HS_STORE_DENSE, false, &brute);
    const hs_points   none = {.data = NULL, .n = 0, .ndim = 2, .real = HS_FLOAT64};
    CHECK(hs_dynamic_insert_many(list, NULL, NULL, &none, NULL) == HS_OK);
    CHECK(hs_dynamic_move_many(list, NULL, NULL, &none, NULL) == HS_OK);
    CHECK(hs_dynamic_remove_many(list, NULL, NULL, 0, NULL, NULL) == HS_OK);
    CHECK(hs_dynamic_length(list) == 0);
    hs_dynamic_free(list);
}

void
test_update(void)
{
    RUN(refused_memory_changes_nothing);
    RUN(single_calls_survive_refused_memory);
    RUN(cells_that_are_left_lend_their_memory);
    RUN(refused_rows_change_nothing);
    RUN(few_rows_among_many_cells);
    RUN(rows_have_tags);
    RUN(no_rows_are_no_change);
}
