/* SPDX-License-Identifier: BSD-3-Clause */
/* test_shift_table.c: shifts are numbered in the order in which they first come, however many there
 * are, and stay so when memory is refused. */
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/verlet/shift_table.h"
#include "../support/harness.h"

void test_shift_table(void);

enum { SIDE = 40 };

/* Each of SIDE^2 shifts three times: in order, again at once, and all of them backwards. */
static void
each_shift_keeps_its_number(void)
{
    hs_images images;
    hs_images_init(2, &images);
    for (int e = 0; e < SIDE * SIDE; e++) {
        const int32_t shift[2] = {e % SIDE - SIDE / 2, 1000 * (e / SIDE)};
        CHECK(hs_images_number(&images, shift) == e && images.n == e + 1);
        CHECK(hs_images_number(&images, shift) == e && images.n == e + 1);
    }
    for (int e = SIDE * SIDE - 1; e >= 0; e--) {
        const int32_t shift[2] = {e % SIDE - SIDE / 2, 1000 * (e / SIDE)};
        CHECK(hs_images_number(&images, shift) == e);
        CHECK(memcmp(images.of + 2 * e, shift, sizeof shift) == 0);
    }
    CHECK(images.n == SIDE * SIDE && images.capacity >= images.n);
    hs_images_free(&images);
    hs_images_free(&images);
    CHECK(images.n == 0);
}

/* Whatever is refused when it has to grow: those that are there stay. */
static void
refused_memory_changes_nothing(void)
{
    const int64_t before = hs_test_live_blocks();
    int           refused = 0;
    for (int64_t nth = 1; nth <= 2; nth++) {
        hs_images images;
        hs_images_init(1, &images);
        for (int32_t e = 0; e < 100; e++) {
            hs_test_fail_allocation(nth);
            const int32_t number = hs_images_number(&images, &e);
            hs_test_fail_allocation(0);
            CHECK(number == e || number == -1);
            refused += number == -1;
            CHECK(hs_images_number(&images, &e) == e);
        }
        for (int32_t e = 0; e < 100; e++)
            CHECK(hs_images_number(&images, &e) == e && images.n == 100);
        hs_images_free(&images);
    }
    CHECK(refused >= 4 && hs_test_live_blocks() == before);
}

/* Numbers are int32. */
static void
no_more_shifts_are_numbered_than_can_be(void)
{
    int32_t   of[2] = {1, 2}, slots[4] = {-1, -1, -1, -1};
    hs_images images = {.width = 1, .of = of, .slots = slots};
    images.n = images.capacity = INT32_MAX / 2 + 1;
    CHECK(hs_images_number(&images, of) == 0);
    CHECK(hs_images_number(&images, of + 1) == -1);
    CHECK(images.n == INT32_MAX / 2 + 1 && images.of == of);
}

void
test_shift_table(void)
{
    RUN(no_more_shifts_are_numbered_than_can_be);
    RUN(each_shift_keeps_its_number);
    RUN(refused_memory_changes_nothing);
}
