/* SPDX-License-Identifier: BSD-3-Clause */
/* test_cell_room.c: a cell that gets a larger block keeps its entries, and their keys lead there. */
#include "../../../csrc/core/base/fpenv.h"
#include "../../../csrc/core/dynamic/cell_room.h"
#include "../../../csrc/core/dynamic/new_list.h"
#include "../../../csrc/core/dynamic/update.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/dynamic_brute.h"

void test_cell_room(void);

static void
sizes_are_the_least(void)
{
    CHECK(hs_block_size(0) == 0 && hs_block_size(1) == 0 && hs_block_size(2) == 1);
    for (int size = 1; size < 40; size++) {
        CHECK(hs_block_size(INT64_C(1) << size) == size);
        CHECK(hs_block_size((INT64_C(1) << size) + 1) == size + 1);
    }
}

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
    return hs_key_map_find(&list->map, &list->entries, (hs_key){id, 3});
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

static void
entries_move_to_the_larger_block(void)
{
    hs_dynamic    *list = crowded();
    const uint32_t number = hs_entry_tail_at(&list->entries, place_of(list, 0))->cell;
    const uint32_t before = list->cells.cell[number].start;
    CHECK(list->cells.size[number] == 3 && hs_cell_reserve(list, number, 8));
    CHECK(list->cells.cell[number].start == before); /* it has room for 8 */
    CHECK(hs_cell_reserve(list, number, 9) && list->cells.size[number] == 4);
    CHECK(list->cells.cell[number].start != before && list->entries.spare[3] == before);
    check_points(list, number);
    hs_dynamic_free(list);
}

static void
refused_room_changes_nothing(void)
{
    hs_dynamic    *list = crowded();
    const uint32_t number = hs_entry_tail_at(&list->entries, place_of(list, 0))->cell;
    CHECK(!hs_cell_reserve(list, number, INT64_C(1) << 33)); /* no block is so large */
    for (int nth = 1; nth <= 2; nth++) {
        hs_test_fail_allocation(nth);
        CHECK(!hs_cell_reserve(list, number, 1000));
        hs_test_fail_allocation(0);
        CHECK(list->cells.size[number] == 3);
        check_points(list, number);
    }
    hs_dynamic_free(list);
}

/* A cell that never had one gets a block without an old one to give back. */
static void
empty_cells_get_their_first_block(void)
{
    const int64_t  index = 0;
    hs_dynamic    *list = crowded();
    const uint32_t number = hs_cell_table_add(&list->cells, &list->entries, &index);
    CHECK(number != HS_NO_CELL && list->cells.size[number] == HS_NO_BLOCK);
    CHECK(hs_cell_reserve(list, number, 1) && list->cells.size[number] == 0);
    CHECK(list->cells.cell[number].count == 0);
    hs_dynamic_free(list);
}

void
test_cell_room(void)
{
    const hs_fpenv env = hs_fpenv_enter();
    RUN(sizes_are_the_least);
    RUN(entries_move_to_the_larger_block);
    RUN(refused_room_changes_nothing);
    RUN(empty_cells_get_their_first_block);
    hs_fpenv_leave(env);
}
