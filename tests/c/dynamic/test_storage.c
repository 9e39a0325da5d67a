/* SPDX-License-Identifier: BSD-3-Clause */
/* test_storage.c: entries, keys and cells of a dynamic list. */
#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/dynamic/storage.h"
#include "../../../csrc/core/memory/memory.h"
#include "../support/harness.h"

#include <math.h>
#include <stdlib.h>

void test_storage(void);

/*
 * ---- entries ----
 *
 * Blocks do not overlap, come back by size, and stay where they are while the array grows.
 */

static void
more_than_there_are_numbers_for_is_refused(void)
{
    hs_entries entries;
    hs_entries_init(&entries, 1, false);
    CHECK(!hs_entries_reserve(&entries, INT64_C(1) << 32) && entries.capacity == 0);
    CHECK(hs_entries_take(&entries, 4) == 0 && entries.capacity == 16);
    CHECK(!hs_entries_reserve(&entries, INT64_C(0xFFFFFFF0)) && entries.capacity == 16);
    hs_entries_free(&entries);
}

/* ---- different keys whose hashes have the same 32 bits ---- */

static int
compare_marks(const void *one, const void *other)
{
    const uint64_t a = *(const uint64_t *)one, b = *(const uint64_t *)other;
    return (a > b) - (a < b);
}

/* Among 2^18 keys that differ in their ids, and in the tags of one id. */
static void
each_pair_of_equal_marks(void (*check)(hs_key one, hs_key other))
{
    enum { MANY = 1 << 18 };
    static uint64_t marks[MANY];
    for (int tagged = 0; tagged <= 1; tagged++) {
        int met = 0;
        for (int64_t x = 0; x < MANY; x++) {
            const hs_key key = {tagged ? 0 : x, tagged ? (int32_t)x : 0};
            marks[x] = (uint64_t)hs_key_mark(key) << 32 | (uint64_t)x;
        }
        qsort(marks, MANY, sizeof *marks, compare_marks);
        for (int m = 1; m < MANY; m++) {
            const int64_t one = (int64_t)(marks[m] & UINT32_MAX);
            const int64_t other = (int64_t)(marks[m - 1] & UINT32_MAX);
            if (marks[m] >> 32 == marks[m - 1] >> 32) {
                check((hs_key){tagged ? 0 : one, tagged ? (int32_t)one : 0},
                      (hs_key){tagged ? 0 : other, tagged ? (int32_t)other : 0});
                met++;
            }
        }
        CHECK(met > 0);
    }
}

/* ---- any history of keys, among them many with equal low bits, against an array ---- */

static void
check_apart(hs_key one, hs_key other)
{
    const int64_t ids[2] = {one.id, other.id};
    const int32_t tags[2] = {one.tag, other.tag};
    hs_key_map    map = {0};
    hs_entries    entries;
    hs_entries_init(&entries, 1, false);
    CHECK(hs_entries_take(&entries, 1) == 0 && hs_hash_reserve(&map.hash, 2));
    for (uint32_t place = 0; place < 2; place++) {
        hs_entry_tail_at(&entries, place)->id = ids[place];
        hs_entry_tail_at(&entries, place)->tag = tags[place];
    }
    hs_key_map_add(&map, one, 0);
    CHECK(hs_key_map_find(&map, &entries, one) == 0);
    CHECK(hs_key_map_find(&map, &entries, other) == HS_NO_PLACE);
    hs_key_map_add(&map, other, 1);
    CHECK(hs_key_map_find(&map, &entries, one) == 0 && hs_key_map_find(&map, &entries, other) == 1);
    hs_key_map_free(&map);
    hs_entries_free(&entries);
}

static void
keys_of_equal_marks_are_told_apart(void)
{
    each_pair_of_equal_marks(check_apart);
}

/* ---- keys of any order, of equal hashes, with and without tags ---- */

static void
ascending_keys_are_not_repeated(void)
{
    const int64_t ids[5] = {-7, 0, 0, 0, 9};
    const int32_t tags[5] = {5, -2, 3, 4, 1}, same[5] = {5, -2, 3, 3, 1};
    CHECK(hs_repeated_key(ids, tags, 5) == -1 && hs_repeated_key(ids, tags, 0) == -1);
    CHECK(hs_repeated_key(ids, NULL, 5) == 2 && hs_repeated_key(ids, same, 5) == 3);
    hs_test_fail_allocation(1);
    CHECK(hs_repeated_key(ids, tags, 5) == -1); /* without a table */
    CHECK(hs_repeated_key(ids, same, 5) == -2);
    hs_test_fail_allocation(0);
}

/* Descending, so that it takes a table to see that none is repeated. */
static void
check_not_repeated(hs_key one, hs_key other)
{
    const int64_t ids[2] = {one.id, other.id};
    const int32_t tags[2] = {one.tag, other.tag};
    CHECK(hs_repeated_key(ids, tags, 2) == -1);
    CHECK(one.id == other.id || hs_repeated_key(ids, NULL, 2) == -1);
}

static void
keys_of_equal_marks_are_not_repeated(void)
{
    each_pair_of_equal_marks(check_not_repeated);
}

/*
 * ---- cell axes ----
 *
 * The cells of a ball hold every coordinate within it, and gaps are no larger than distances, at
 * any width, radius and distance from the origin.
 */

static hs_axes
axes_of(double length, double cell_size, double radius)
{
    hs_box     box = {.ndim = 1, .periodic = {length > 0.0}, .rows = {{length}}};
    hs_lattice lattice;
    hs_axes    axes;
    hs_lattice_init(length > 0.0 ? &box : NULL, 1, hs_scale_of(0), &lattice);
    hs_axes_init(&axes, &lattice, cell_size, false, radius);
    return axes;
}

/* A number of ordinary size, often with few digits. */
static double
some_number(harness_random *random)
{
    const double x = ldexp(random_unit(random) - 0.5, (int)(random_bits(random) % 40) - 10);
    return random_bits(random) % 2 == 0 ? x : rint(x * 8.0) / 8.0;
}

static void
open_balls_hold_what_is_within(void)
{
    harness_random random = {7};
    for (int trial = 0; trial < TRIALS(200000); trial++) {
        const double   width = fabs(some_number(&random)) + 0x1p-20;
        const int      times = (int)(random_bits(&random) % 5);
        const double   radius = trial % 2 == 0 ? width * times : width * 5.0 * random_unit(&random);
        const hs_axes  axes = axes_of(0.0, width, radius);
        const hs_axis *axis = &axes.axis[0];
        const double   t = some_number(&random);
        hs_span_of_cells span;
        hs_axis_span(axis, t, hs_axis_cell(axis, t), radius, 0.0, &span);
        for (int side = -1; side <= 1; side += 2) {
            double y = t + side * radius;
            while (fabs(y - t) > radius) /* not beyond, for the numbers as rounded */
                y = nextafter(y, t);
            const int64_t cell = hs_axis_cell(axis, y);
            CHECK(cell >= span.first && cell <= span.last);
            CHECK(sqrt(hs_axis_gap(axis, t, cell, span.centre)) <= fabs(y - t) * (1.0 + 0x1p-50));
        }
        CHECK(span.first <= span.centre && span.centre <= span.last);
    }
}

/* x + image * length, rounded up or down, by exact sums of what is rounded. */
static double
image_of(double x, double image, double length, double towards)
{
    const double shift = image * length, rest = fma(image, length, -shift);
    const double sum = shift + x, back = sum - shift;
    const double error = (shift - (sum - back)) + (x - back) + rest;
    const bool   is_passed = towards > 0.0 ? error > 0.0 : error < 0.0;
    return is_passed ? nextafter(sum, towards) : sum;
}

/* Periods whose multiples are rounded: the end of a ball that is the image of a number next to an
 * edge of its cell still has this cell, on either side. */
static void
ends_in_far_images_are_held(void)
{
    harness_random random = {9};
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const double     length = 0.5 + 8.0 * random_unit(&random);
        const int        n = 2 + (int)(random_bits(&random) % 9);
        const hs_axes    axes = axes_of(length, length / (n + 0.25), 1.0);
        const hs_axis   *axis = &axes.axis[0];
        const int64_t    cell = 1 + (int64_t)(random_bits(&random) % (uint64_t)(n - 1));
        const int64_t    image = (trial % 2 ? 1 : -1) * (2 + trial / 2 % 300);
        const double     step = ldexp(1.0, ilogb(length) - 53); /* no coordinate has finer ones */
        double           x = (double)cell * axis->width - axis->half;
        hs_span_of_cells span;
        for (int n_steps = 0; n_steps < 1000 && hs_axis_cell(axis, x) >= cell; n_steps++)
            x -= step;
        for (int n_steps = 0; n_steps < 1000 && hs_axis_cell(axis, x + step) < cell; n_steps++)
            x += step;
        const double low = image_of(x, (double)image, length, -HUGE_VAL);
        hs_axis_images(axis, low, low + length, 0.0, &span);
        CHECK(axis->n == n && span.first <= hs_axis_cell(axis, x) + image * n);
        x += step;
        const double high = image_of(x, (double)image, length, HUGE_VAL);
        hs_axis_images(axis, high - length, high, 0.0, &span);
        CHECK(span.last >= hs_axis_cell(axis, x) + image * n);
    }
}

/* ---- cells are found under their indices, in either kind of table, after any growth ---- */

static void
start(hs_cell_table *table, hs_entries *entries, bool dense)
{
    hs_axes axes = {.ndim = 2};
    axes.axis[1].n = 5; /* the second axis repeats */
    hs_cell_table_init(table, &axes, dense, 5000.0);
    hs_entries_init(entries, 2, false);
}

/* A cell with these indices. */
static uint32_t
added(hs_cell_table *table, hs_entries *entries, const int64_t *index)
{
    uint32_t   number;
    hs_failure failure;
    CHECK(hs_cell_table_add(table, entries, index, &number, &failure) == HS_OK);
    return number;
}

/* Whether a sparse table has room for so many cells more. */
static bool
room_for(hs_cell_table *table, hs_entries *entries, int64_t more)
{
    return hs_cell_table_reserve(table, entries, NULL, NULL, more, NULL) == HS_OK;
}

/* Gives a cell one entry. */
static void
occupy(hs_cell_table *table, hs_entries *entries, uint32_t cell, int64_t id)
{
    table->cell[cell].start = hs_entries_take(entries, 0);
    table->size[cell] = 0;
    table->cell[cell].count = 1;
    table->n_empty--;
    hs_entry_tail_at(entries, table->cell[cell].start)->id = id;
    hs_entry_tail_at(entries, table->cell[cell].start)->cell = cell;
}

/* An eager extension that would not fit is made as small as it can be; if that does not fit either,
 * its bytes are told. */
static void
dense_tables_have_a_limit(void)
{
    const int64_t first[2] = {0, 0}, last[2] = {99, 4}, more[2] = {104, 4}, far[2] = {200, 0};
    hs_cell_table table;
    hs_entries    entries;
    hs_failure    failure;
    start(&table, &entries, true);
    CHECK(hs_cell_table_reserve(&table, &entries, first, last, 0, &failure) == HS_OK);
    CHECK(table.n == 500);
    CHECK(hs_cell_table_reserve(&table, &entries, more, more, 0, &failure) == HS_OK);
    CHECK(table.n == 525);
    CHECK(hs_cell_table_reserve(&table, &entries, far, far, 0, &failure) == HS_ERR_CAPACITY);
    CHECK(table.n == 525 && failure.expected_bytes == 201 * 5 * 9 && failure.limit_bytes == 5000);
    const int64_t farthest[2] = {INT64_C(1) << 52, 0};
    table.most_bytes = INFINITY;
    CHECK(hs_cell_table_reserve(&table, &entries, farthest, farthest, 0, &failure) ==
          HS_ERR_CAPACITY);
    hs_cell_table_free(&table);
}

static void
cells_outside_are_none(void)
{
    const int64_t first[2] = {3, 0}, last[2] = {9, 4};
    const int64_t outside[][2] = {{2, 1}, {10, 1}, {4, -1}, {4, 5}};
    hs_cell_table table;
    hs_entries    entries;
    hs_failure    failure;
    hs_axes       both = {.ndim = 2};
    start(&table, &entries, true);
    CHECK(hs_cell_table_reserve(&table, &entries, first, last, 0, &failure) == HS_OK);
    for (int o = 0; o < 4; o++) {
        CHECK(hs_cell_table_find(&table, outside[o]) == HS_NO_CELL);
    }
    CHECK(hs_cell_table_find(&table, first) == 0 && hs_cell_table_find(&table, last) == 34);
    hs_cell_table_free(&table);
    both.axis[0].n = both.axis[1].n = 5; /* known from the beginning, but not there yet */
    hs_cell_table_init(&table, &both, true, 0.0);
    CHECK(hs_cell_table_find(&table, (const int64_t[2]){1, 1}) == HS_NO_CELL);
}

/* Cells may be empty and have blocks while many points come at once. */
static void
dropped_cells_give_their_blocks_back(void)
{
    const int64_t index[2] = {7, 2};
    hs_cell_table table;
    hs_entries    entries;
    start(&table, &entries, false);
    const uint32_t cell = added(&table, &entries, index);
    table.cell[cell].start = hs_entries_take(&entries, 3);
    table.size[cell] = 3;
    CHECK(room_for(&table, &entries, table.capacity));
    CHECK(table.n == 0 && hs_cell_table_find(&table, index) == HS_NO_CELL);
    CHECK(entries.spare[3] == 0);
    hs_cell_table_free(&table);
    hs_entries_free(&entries);
}

/* A table that is full and may not grow drops what is empty, however little that is. */
static void
empty_cells_make_room_where_memory_is_refused(void)
{
    hs_cell_table table;
    hs_entries    entries;
    start(&table, &entries, false);
    for (int64_t k = 0; k == 0 || k < table.capacity; k++) {
        const int64_t  index[2] = {k, 0};
        const uint32_t cell = added(&table, &entries, index);
        if (k > 0)
            occupy(&table, &entries, cell, k);
    }
    hs_test_fail_allocation(1);
    CHECK(table.n == table.capacity && room_for(&table, &entries, 1));
    CHECK(table.n == table.capacity - 1 && table.n_empty == 0);
    hs_test_fail_allocation(0);
    hs_cell_table_free(&table);
    hs_entries_free(&entries);
}

/* More than there are numbers for: what is empty is dropped before it is refused. */
static void
too_many_cells_are_refused(void)
{
    hs_cell_table table;
    hs_entries    entries;
    start(&table, &entries, false);
    for (int64_t k = 0; k < 9; k++) {
        const int64_t  index[2] = {k, 0};
        const uint32_t cell = added(&table, &entries, index);
        if (k < 8)
            occupy(&table, &entries, cell, k);
    }
    CHECK(table.n_empty == 1 && table.n == 9);
    CHECK(!room_for(&table, &entries, INT64_C(1) << 33));
    CHECK(table.n == 8 && table.n_empty == 0);
    CHECK(!room_for(&table, &entries, INT64_C(1) << 33));
    for (int64_t k = 0; k < 9; k++) {
        const int64_t index[2] = {k, 0};
        CHECK((hs_cell_table_find(&table, index) != HS_NO_CELL) == (k < 8));
    }
    hs_cell_table_free(&table);
    hs_entries_free(&entries);
}

/* Of 2^18 cells some have the same 32 bits of their hash: they are told by their indices. */
static void
cells_of_equal_marks_are_told_apart(void)
{
    enum { MANY = 1 << 18 };
    static uint64_t marks[MANY];
    int             met = 0;
    for (uint64_t x = 0; x < MANY; x++)
        marks[x] = (uint64_t)hs_cell_mark(hs_cell_part(0, (int64_t)x)) << 32 | x;
    qsort(marks, MANY, sizeof *marks, compare_marks);
    for (int m = 1; m < MANY; m++) {
        if (marks[m] >> 32 == marks[m - 1] >> 32) {
            const int64_t one[2] = {(int64_t)(marks[m] & UINT32_MAX), 0};
            const int64_t other[2] = {(int64_t)(marks[m - 1] & UINT32_MAX), 0};
            hs_cell_table table;
            hs_entries    entries;
            start(&table, &entries, false);
            const uint32_t first = added(&table, &entries, one);
            CHECK(hs_cell_table_find(&table, other) == HS_NO_CELL);
            CHECK(added(&table, &entries, other) != first);
            CHECK(hs_cell_table_find(&table, one) == first);
            hs_cell_table_free(&table);
            met++;
        }
    }
    CHECK(met > 0);
}

void
test_storage(void)
{
    RUN(more_than_there_are_numbers_for_is_refused);
    RUN(keys_of_equal_marks_are_told_apart);
    RUN(ascending_keys_are_not_repeated);
    RUN(keys_of_equal_marks_are_not_repeated);
    const hs_fpenv env = hs_fpenv_enter();
    RUN(open_balls_hold_what_is_within);
    RUN(ends_in_far_images_are_held);
    hs_fpenv_leave(env);
    RUN(dense_tables_have_a_limit);
    RUN(cells_outside_are_none);
    RUN(dropped_cells_give_their_blocks_back);
    RUN(empty_cells_make_room_where_memory_is_refused);
    RUN(too_many_cells_are_refused);
    RUN(cells_of_equal_marks_are_told_apart);
}
