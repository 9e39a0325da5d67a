/* SPDX-License-Identifier: BSD-3-Clause */
/* test_key_map.c: any history of keys, among them many with equal low bits, against an array. */
#include "../../../csrc/core/dynamic/key_map.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"

#include <stdlib.h>

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
repeated_keys_are_named(void)
{
    int64_t ids[NUMBERS];
    int32_t tags[NUMBERS];
    for (int n = 0; n < NUMBERS; n++) {
        ids[n] = key_of(n).id;
        tags[n] = key_of(n).tag;
    }
    CHECK(hs_key_map_repeated(ids, tags, NUMBERS) == -1);
    CHECK(hs_key_map_repeated(ids, NULL, NUMBERS) == 1);
    CHECK(hs_key_map_repeated(ids, NULL, 1) == -1 && hs_key_map_repeated(ids, tags, 0) == -1);
    ids[250] = ids[17];
    tags[250] = tags[17];
    CHECK(hs_key_map_repeated(ids, tags, NUMBERS) == 250);
    hs_test_fail_allocation(1);
    CHECK(hs_key_map_repeated(ids, tags, NUMBERS) == -2);
}

/* As key_map.c makes them. */
static uint32_t
mark_of(hs_key key)
{
    uint64_t x = (uint64_t)key.id + (uint64_t)(uint32_t)key.tag * UINT64_C(0x9E3779B97F4A7C15);
    x = (x ^ (x >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    x = (x ^ (x >> 27)) * UINT64_C(0x94D049BB133111EB);
    return (uint32_t)(x >> 32);
}

static int
compare_marks(const void *one, const void *other)
{
    const uint64_t a = *(const uint64_t *)one, b = *(const uint64_t *)other;
    return (a > b) - (a < b);
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
    CHECK(hs_key_map_repeated(ids, tags, 2) == -1);
    if (one.id != other.id)
        CHECK(hs_key_map_repeated(ids, NULL, 2) == -1);
    hs_key_map_free(&map);
    hs_entries_free(&entries);
}

/* Of 2^18 keys some have the same 32 bits of their hash: ids, and tags of one id. Descending, so
 * that it takes a table to see that none is repeated. */
static void
keys_of_equal_marks_are_told_apart(void)
{
    enum { MANY = 1 << 18 };
    static uint64_t marks[MANY];
    for (int tagged = 0; tagged <= 1; tagged++) {
        int met = 0;
        for (int64_t x = 0; x < MANY; x++) {
            const hs_key key = {tagged ? 0 : x, tagged ? (int32_t)x : 0};
            marks[x] = (uint64_t)mark_of(key) << 32 | (uint64_t)x;
        }
        qsort(marks, MANY, sizeof *marks, compare_marks);
        for (int m = 1; m < MANY; m++) {
            const int64_t one = (int64_t)(marks[m] & UINT32_MAX);
            const int64_t other = (int64_t)(marks[m - 1] & UINT32_MAX);
            if (marks[m] >> 32 == marks[m - 1] >> 32) {
                check_apart((hs_key){tagged ? 0 : one, tagged ? (int32_t)one : 0},
                            (hs_key){tagged ? 0 : other, tagged ? (int32_t)other : 0});
                met++;
            }
        }
        CHECK(met > 0);
    }
}

/* The first key that was there before, of any keys; without one there is none. */
static void
any_repeated_key_is_found(void)
{
    enum { MOST = 600 };
    static int64_t ids[MOST];
    static int32_t tags[MOST];
    harness_random random = {91};
    for (int trial = 0; trial < TRIALS(400); trial++) {
        const int n = 2 + (int)(random_bits(&random) % (MOST - 2)), kinds = trial % 3 ? 100000 : 40;
        int64_t   first = -1;
        for (int i = 0; i < n; i++) {
            ids[i] = (int64_t)(random_bits(&random) % (uint64_t)kinds) << (trial % 5 * 8);
            tags[i] = (int32_t)(random_bits(&random) % 3);
        }
        for (int i = 1; i < n && first < 0; i++) {
            for (int j = 0; j < i && first < 0; j++) {
                first = ids[i] == ids[j] && tags[i] == tags[j] ? i : -1;
            }
        }
        CHECK(hs_key_map_repeated(ids, tags, n) == first);
    }
}

static void
ascending_keys_are_not_repeated(void)
{
    const int64_t ids[5] = {-7, 0, 0, 0, 9};
    const int32_t tags[5] = {5, -2, 3, 4, 1}, same[5] = {5, -2, 3, 3, 1};
    CHECK(hs_key_map_repeated(ids, tags, 5) == -1 && hs_key_map_repeated(ids, tags, 0) == -1);
    CHECK(hs_key_map_repeated(ids, NULL, 5) == 2 && hs_key_map_repeated(ids, same, 5) == 3);
    hs_test_fail_allocation(1);
    CHECK(hs_key_map_repeated(ids, tags, 5) == -1); /* without a table */
    CHECK(hs_key_map_repeated(ids, same, 5) == -2);
    hs_test_fail_allocation(0);
}

void
test_key_map(void)
{
    RUN(keys_are_found_after_any_history);
    RUN(refused_memory_changes_nothing);
    RUN(repeated_keys_are_named);
    RUN(keys_of_equal_marks_are_told_apart);
    RUN(any_repeated_key_is_found);
    RUN(ascending_keys_are_not_repeated);
}
