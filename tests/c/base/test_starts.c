/* SPDX-License-Identifier: BSD-3-Clause */
/* test_starts.c: parts of any lengths, filled in any order, begin where the ones before end. */
#include "../../../csrc/core/base/starts.h"
#include "../support/harness.h"

void test_starts(void);

static void
parts_begin_where_others_end(void)
{
    int64_t       starts[] = {0, 2, 0, 3, 1};
    const int64_t expected[] = {0, 2, 2, 5, 6};
    const int     part[] = {2, 0, 3, 2, 0, 2}; /* of each entry, in the order that they come */
    int           entry[6];
    hs_starts_of_lengths(starts, 5);
    CHECK(memcmp(starts, expected, sizeof starts) == 0);
    for (int e = 0; e < 6; e++)
        entry[starts[part[e]]++] = e;
    hs_starts_of_ends(starts, 5);
    CHECK(memcmp(starts, expected, sizeof starts) == 0);
    CHECK(memcmp(entry, (int[]){1, 4, 0, 3, 5, 2}, sizeof entry) == 0);
}

static void
no_parts_have_one_end(void)
{
    int64_t starts[] = {0};
    hs_starts_of_lengths(starts, 1);
    hs_starts_of_ends(starts, 1);
    CHECK(starts[0] == 0);
}

void
test_starts(void)
{
    RUN(parts_begin_where_others_end);
    RUN(no_parts_have_one_end);
}
