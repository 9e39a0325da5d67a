/* SPDX-License-Identifier: BSD-3-Clause */
/* test_dynamic.c: dynamic lists: room of cells, places of points, filling, rows and changes. */
#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/base/status.h"
#include "../../../csrc/core/dynamic/dynamic.h"
#include "../../../csrc/core/memory/memory.h"
#include "../../../csrc/halfshell_dynamic.h"
#include "../support/among.h"
#include "../support/dynamic_brute.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include <math.h>

void test_dynamic(void);

/* ---- a cell that gets a larger block keeps its entries, and their keys lead there ---- */

/* Five points in one cell of a box, so that positions are kept as given, too. */
static hs_dynamic *
crowded(void)
{
    static const hs_box box = {.ndim = 1, .periodic = {true}, .rows = {{4.0}}};
    hs_dynamic_options  options = hs_dynamic_options_default();
    hs_dynamic         *list = NULL;
    options.ndim = 1;
    options.box = &box;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    for (int64_t id = 0; id < 5; id++) {
        const double x = 8.1 + 0.1 * (double)id;
        CHECK(hs_dynamic_insert(list, (hs_key){id, 3}, &x, NULL) == HS_OK);
    }
    return list;
}

static uint32_t
place_of(const hs_dynamic *list, int64_t id)
{
    return hs_stored_find(list, (hs_key){id, 3});
}

static void
check_points(const hs_dynamic *list, uint32_t number)
{
    const hs_cell cell = list->cells.cell[number];
    CHECK(cell.count == 5);
    for (int64_t id = 0; id < 5; id++) {
        const uint32_t place = place_of(list, id);
        CHECK(place >= cell.start && place < cell.start + cell.count);
        CHECK(hs_entry_tail_at(&list->entries, place)->id == id);
        CHECK(hs_entry_given(&list->entries, place)[0] == 8.1 + 0.1 * (double)id);
    }
}

/* No block is so large, or there are no numbers for more entries. */
static void
refused_room_changes_nothing(void)
{
    hs_dynamic    *list = crowded();
    const uint32_t number = hs_entry_tail_at(&list->entries, place_of(list, 0))->cell;
    const double   x = 8.2;
    const uint32_t n_used = list->entries.n_used;
    list->cells.cell[number].count = UINT32_MAX;
    CHECK(hs_dynamic_insert(list, (hs_key){9, 3}, &x, NULL) == HS_ERR_MEMORY);
    list->cells.cell[number].count = 8;
    list->entries.n_used = list->entries.capacity = UINT32_C(0xFFFFFFF0);
    CHECK(hs_dynamic_insert(list, (hs_key){9, 3}, &x, NULL) == HS_ERR_MEMORY);
    list->cells.cell[number].count = 5;
    list->entries.n_used = list->entries.capacity = n_used;
    CHECK(hs_dynamic_length(list) == 5 && list->cells.size[number] == 3);
    check_points(list, number);
    hs_dynamic_free(list);
}

/* ---- X and turns of a position are those of wrap.h, wherever it lies ---- */

static hs_dynamic *
list_of(const hs_box *box)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    hs_failure         failure;
    options.ndim = 2;
    options.box = box;
    CHECK(hs_dynamic_new(&options, &list, &failure) == HS_OK);
    return list;
}

static void
what_cannot_be_wrapped_is_refused(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{3.0, 0.0}, {0.0, 2.5}}};
    const double far[2] = {0.0, 1e17}, bad[2] = {0.0, -INFINITY};
    hs_dynamic  *list = list_of(&box), *open = list_of(NULL);
    hs_placed    placed;
    hs_failure   failure;
    CHECK(hs_dynamic_place(list, far, &placed, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(hs_dynamic_place(open, far, &placed, &failure) == HS_OK);
    CHECK(hs_dynamic_place(open, bad, &placed, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.column == 1 && failure.value == -INFINITY);
    hs_dynamic_free(list);
    hs_dynamic_free(open);
}

/* Along two axes: the first of them is not forgotten when the second one is wrapped. */
static void
both_axes_may_be_too_far(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{3.0, 0.0}, {0.0, 2.5}}};
    const double far[][2] = {{1e17, 1e17}, {1e17, 9.0}, {9.0, 1e17}};
    hs_dynamic  *list = list_of(&box);
    hs_placed    placed;
    hs_failure   failure;
    for (int f = 0; f < 3; f++)
        CHECK(hs_dynamic_place(list, far[f], &placed, &failure) == HS_ERR_SHIFT_RANGE);
    hs_dynamic_free(list);
}

/* ---- copies are lists of their own ---- */

static hs_status
new_once(void *options)
{
    hs_dynamic     *list = NULL;
    const hs_status status = hs_dynamic_new(options, &list, NULL);
    CHECK((list != NULL) == (status == HS_OK));
    hs_dynamic_free(list);
    return status;
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
    CHECK(fail_each_allocation(new_once, &bad[6], 10) == 4);
    bad[6].box = &steep;
    CHECK(hs_dynamic_new(&bad[6], &list, NULL) == HS_ERR_BOX_SKEWED && list == NULL);
}

/* ---- a list that is filled at once is the one that is filled point by point ---- */

enum { N = 211 };

typedef enum box_kind { OPEN, ALIGNED, SLAB, SKEWED, BOX_KINDS } box_kind;

typedef struct rows_fill {
    int64_t ids[N];
    int32_t tags[N];
    double  columns[HS_MAX_DIM][N];
} rows_fill;

/* Crowded and lone ones, in no order; twice the same id with another tag. */
static void
make_rows(rows_fill *of)
{
    harness_random random = {29};
    for (int i = 0; i < N; i++) {
        of->ids[i] = (i * 77) % N / 2;
        of->tags[i] = (i * 77) % N % 2;
    }
    for (int k = 0; k < HS_MAX_DIM; k++) {
        for (int i = 0; i < N; i++)
            of->columns[k][i] = i < N / 3 ? 0.25 * random_unit(&random)
                                          : 9.0 * random_unit(&random) - 4.5;
    }
}

static hs_status
put_fill(hs_dynamic *list, const rows_fill *of, hs_failure *failure)
{
    const hs_points points = {.data = of->columns,
                              .n = N,
                              .ndim = list->lattice.ndim,
                              .real = HS_FLOAT64,
                              .row_stride = sizeof(double),
                              .column_stride = sizeof of->columns[0]};
    return hs_dynamic_insert_many(list, of->ids, of->tags, &points, failure);
}

static hs_dynamic *
list_of_fill(box_kind kind, int ndim, hs_storage storage)
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
    CHECK(hs_dynamic_new(&options, &list, &failure) == HS_OK);
    return list;
}

static void
check_point(const hs_dynamic *list, const hs_dynamic *other, hs_key key)
{
    const uint32_t place = hs_stored_find(list, key);
    const uint32_t like = hs_stored_find(other, key);
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
    static rows_fill of;
    make_rows(&of);
    for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
        for (int kind = OPEN; kind < BOX_KINDS; kind++) {
            for (int storage = 0; storage < 3; storage++) {
                hs_dynamic *list = list_of_fill((box_kind)kind, ndim, (hs_storage)storage);
                hs_dynamic *single = list_of_fill((box_kind)kind, ndim, (hs_storage)storage);
                hs_failure  failure = HS_NO_FAILURE;
                CHECK(put_fill(list, &of, &failure) == HS_OK);
                for (int64_t i = 0; i < N; i++) {
                    double given[HS_MAX_DIM];
                    for (int k = 0; k < ndim; k++)
                        given[k] = of.columns[k][i];
                    CHECK(hs_dynamic_insert(single, (hs_key){of.ids[i], of.tags[i]}, given,
                                            &failure) == HS_OK);
                }
                CHECK(list->map.n == N && list->n_without == 0);
                CHECK(list->cells.dense || list->cells.n_empty == 0);
                CHECK(list->magnitude == single->magnitude);
                for (int64_t i = 0; i < N; i++)
                    check_point(list, single, (hs_key){of.ids[i], of.tags[i]});
                for (int64_t i = 0; i < N; i++)
                    CHECK(hs_dynamic_remove(list, (hs_key){of.ids[i], of.tags[i]}));
                CHECK(list->map.n == 0);
                hs_dynamic_free(single);
                hs_dynamic_free(list);
            }
        }
    }
}

/* One that held points before and has memory of them. */
static void
what_cannot_be_had_leaves_an_empty_list(void)
{
    static rows_fill of;
    for (int kind = OPEN; kind < BOX_KINDS; kind++) {
        for (int storage = 0; storage < 2; storage++) {
            hs_dynamic *list = list_of_fill((box_kind)kind, 2, (hs_storage)storage);
            hs_failure  failure = HS_NO_FAILURE;
            make_rows(&of);
            CHECK(put_fill(list, &of, &failure) == HS_OK);
            for (int64_t i = 0; i < N; i++)
                CHECK(hs_dynamic_remove(list, (hs_key){of.ids[i], of.tags[i]}));
            of.columns[1][7] = 1e200;
            const hs_status status = put_fill(list, &of, &failure);
            if (kind == OPEN) {
                CHECK(status == (storage == HS_STORE_DENSE ? HS_ERR_CAPACITY : HS_OK));
                CHECK(status == HS_OK || failure.expected_bytes > failure.limit_bytes);
            } else {
                CHECK(status == HS_ERR_SHIFT_RANGE && failure.row == 7);
            }
            CHECK(status == HS_OK || (list->map.n == 0 && list->entries.n_used == 0));
            hs_dynamic_clear(list);
            make_rows(&of);
            CHECK(put_fill(list, &of, &failure) == HS_OK && list->map.n == N);
            hs_dynamic_free(list);
        }
    }
}

static hs_status
fill_once(void *context)
{
    hs_dynamic      *list = context;
    static rows_fill of;
    hs_failure       failure;
    make_rows(&of);
    const hs_status status = put_fill(list, &of, &failure);
    CHECK(list->map.n == (status == HS_OK ? N : 0));
    hs_dynamic_clear(list);
    return status;
}

static void
refused_memory_leaves_an_empty_list(void)
{
    for (int storage = 0; storage < 3; storage++) {
        hs_dynamic *list = list_of_fill(SKEWED, 3, (hs_storage)storage);
        CHECK(fail_each_allocation(fill_once, list, 100) > 4);
        hs_dynamic_free(list);
    }
    hs_dynamic *wide = list_of_fill(OPEN, 2, HS_STORE_HASH); /* whose table grows meanwhile */
    CHECK(fail_each_allocation(fill_once, wide, 100) > 8);
    hs_dynamic_free(wide);
}

/* ---- whatever memory is refused, a call does all or nothing, one point or many ---- */

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
make_rows_update(int64_t *ids, double rows[][2])
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
    const hs_points points = points_in_rows(rows, ROWS, 2);
    return hs_dynamic_insert_many(list, ids, NULL, &points, failure);
}

static void
refused_memory_changes_nothing(void)
{
    static brute_list brute;
    int64_t           ids[ROWS];
    double            rows[ROWS][2];
    const int64_t     before = hs_test_live_blocks();
    make_rows_update(ids, rows);
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
            copy = list;
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
        make_rows_update(ids, rows);
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
        make_rows_update(ids, rows);
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
    double            rows[MANY][2] = {{0.0}};
    hs_points         points = points_in_rows(rows, MANY, 2);
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
    const hs_points   points = points_in_rows(rows, ROWS, 2);
    make_rows_update(ids, rows);
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

/* A coordinate inside, on a face, one period away or many, or next to one of these. */
static double
some_coordinate(harness_random *random, double length)
{
    double x = (random_unit(random) - 0.5) * 4.0 * length;
    switch (random_bits(random) % 4) {
    case 0: x = ldexp(x, (int)(random_bits(random) % 40)); break;
    case 1: x = (double)(int64_t)(random_bits(random) % 9) * 0.5 * length - 2.0 * length; break;
    default: break;
    }
    return random_bits(random) % 3 == 0 ? nextafter(x, 0.0) : x;
}

static void
skewed_positions_are_those_of_wrap_point(void)
{
    const hs_box   box = {.ndim = 2, .periodic = {true, true}, .rows = {{3.0, 0.0}, {1.1, 2.5}}};
    hs_dynamic    *list = list_of(&box);
    harness_random random = {6};
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const double given[2] = {some_coordinate(&random, 3.0), some_coordinate(&random, 3.0)};
        double       inside[2], magnitude = 0.0;
        int64_t      turns[2];
        hs_placed    placed;
        hs_failure   failure;
        CHECK(hs_wrap_point(&list->lattice, given, inside, turns, &magnitude));
        CHECK(hs_dynamic_place(list, given, &placed, &failure) == HS_OK);
        CHECK(memcmp(placed.x, inside, sizeof inside) == 0);
        CHECK(memcmp(placed.turns, turns, sizeof turns) == 0);
        CHECK(hs_dynamic_insert(list, (hs_key){0, 0}, given, &failure) == HS_OK);
        CHECK(list->magnitude >= magnitude);
    }
    hs_dynamic_free(list);
}

void
test_dynamic(void)
{
    const hs_fpenv env = hs_fpenv_enter();
    RUN(refused_room_changes_nothing);
    RUN(what_cannot_be_wrapped_is_refused);
    RUN(both_axes_may_be_too_far);
    RUN(options_are_checked);
    RUN(filled_lists_are_those_of_single_points);
    RUN(what_cannot_be_had_leaves_an_empty_list);
    RUN(refused_memory_leaves_an_empty_list);
    RUN(refused_memory_changes_nothing);
    RUN(single_calls_survive_refused_memory);
    RUN(refused_rows_change_nothing);
    RUN(few_rows_among_many_cells);
    RUN(rows_have_tags);
    RUN(no_rows_are_no_change);
    RUN(skewed_positions_are_those_of_wrap_point);
    hs_fpenv_leave(env);
}
