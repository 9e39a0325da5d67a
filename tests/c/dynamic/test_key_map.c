/* SPDX-License-Identifier: BSD-3-Clause */
/* test_key_map.c: any history of keys, among them many with equal low bits, against an array. */
#include "../../../csrc/core/dynamic/key_map.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"
#include "equal_marks.h"

void test_key_map(void);

enum { NUMBERS = 300 };

static hs_key
key_of(int number)
{
    return (hs_key){(int64_t)(number / 3) << 40, number % 3 - 1};
}

/* Place n holds key n. */
static void
fill(hs_entries *entries)
{
    hs_entries_init(entries, 1, false);
    CHECK(hs_entries_take(entries, 9) == 0);
    for (int n = 0; n < NUMBERS; n++) {
        hs_entry_tail_at(entries, (uint32_t)n)->id = key_of(n).id;
        hs_entry_tail_at(entries, (uint32_t)n)->tag = key_of(n).tag;
    }
}

static void
keys_are_found_after_any_history(void)
{
    harness_random random = {3};
    hs_entries     entries;
    hs_key_map     map = {0};
    bool           has[NUMBERS] = {false};
    int64_t        n = 0;
    fill(&entries);
    for (int step = 0; step < TRIALS(20000); step++) {
        const int      number = (int)(random_bits(&random) % NUMBERS);
        const uint32_t place = (uint32_t)number;
        CHECK(hs_key_map_find(&map, &entries, key_of(number)) ==
              (has[number] ? place : HS_NO_PLACE));
        if (has[number]) {
            hs_key_map_remove(&map, key_of(number), place);
        } else {
            CHECK(hs_key_map_reserve(&map, n + 1));
            hs_key_map_add(&map, key_of(number), place);
        }
        n += has[number] ? -1 : 1;
        has[number] = !has[number];
        CHECK(map.n == n);
    }
    for (int number = 0; number < NUMBERS; number++)
        CHECK((hs_key_map_find(&map, &entries, key_of(number)) != HS_NO_PLACE) == has[number]);
    hs_key_map_free(&map);
    hs_entries_free(&entries);
}

static void
refused_memory_changes_nothing(void)
{
    hs_entries entries;
    hs_key_map map = {0};
    fill(&entries);
    hs_test_fail_allocation(1);
    CHECK(!hs_key_map_reserve(&map, 1));
    CHECK(hs_key_map_find(&map, &entries, key_of(0)) == HS_NO_PLACE);
    CHECK(hs_key_map_reserve(&map, 1));
    hs_key_map_add(&map, key_of(5), 5);
    hs_test_fail_allocation(1);
    CHECK(!hs_key_map_reserve(&map, 100));
    CHECK(hs_key_map_find(&map, &entries, key_of(5)) == 5);
    hs_test_fail_allocation(0);
    hs_key_map_free(&map);
    hs_entries_free(&entries);
}

static void
check_apart(hs_key one, hs_key other)
{
    const int64_t ids[2] = {one.id, other.id};
    const int32_t tags[2] = {one.tag, other.tag};
    hs_key_map    map = {0};
    hs_entries    entries;
    hs_entries_init(&entries, 1, false);
    CHECK(hs_entries_take(&entries, 1) == 0 && hs_key_map_reserve(&map, 2));
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

void
test_key_map(void)
{
    RUN(keys_are_found_after_any_history);
    RUN(refused_memory_changes_nothing);
    RUN(keys_of_equal_marks_are_told_apart);
}
