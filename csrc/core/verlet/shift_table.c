/* SPDX-License-Identifier: BSD-3-Clause */
/* shift_table.c: a hash table with open addressing. */
#include "shift_table.h"

#include "../memory/account.h"

#include <string.h>

#define FIRST_CAPACITY 64 /* the 26 images next to a box, and some room */

void
hs_images_init(int width, hs_images *images)
{
    *images = (hs_images){.width = width};
}

void
hs_images_free(hs_images *images)
{
    hs_free(NULL, images->of);
    hs_free(NULL, images->slots);
    hs_images_init(images->width, images);
}

/* Where the shift is, or the empty slot where it belongs. */
static int64_t
find_slot(const hs_images *images, const int32_t *shift)
{
    const uint64_t mask = 2 * (uint64_t)images->capacity - 1;
    uint64_t       hash = 0;
    for (int k = 0; k < images->width; k++) { /* Fibonacci hashing of one number after the other */
        hash = (hash ^ (uint32_t)shift[k]) * UINT64_C(0x9e3779b97f4a7c15);
        hash ^= hash >> 29;
    }
    const size_t size = (size_t)images->width * sizeof *shift;
    for (uint64_t slot = hash & mask;; slot = (slot + 1) & mask) {
        const int32_t number = images->slots[slot];
        if (number < 0 || memcmp(images->of + (int64_t)number * images->width, shift, size) == 0) {
            return (int64_t)slot;
        }
    }
}

static bool
grow(hs_images *images)
{
    hs_images larger = {.width = images->width, .n = images->n};
    larger.capacity = images->capacity > 0 ? 2 * images->capacity : FIRST_CAPACITY;
    if (larger.capacity > INT32_MAX / 2) {
        return false;
    }
    larger.of = hs_alloc(NULL, HS_FOR_SHIFTS, larger.capacity * larger.width, sizeof(int32_t));
    larger.slots = hs_alloc(NULL, HS_FOR_SHIFTS, 2 * larger.capacity, sizeof(int32_t));
    if (larger.of == NULL || larger.slots == NULL) {
        hs_images_free(&larger);
        return false;
    }
    memset(larger.slots, -1, 2 * (size_t)larger.capacity * sizeof(int32_t));
    for (int64_t number = 0; number < larger.n; number++) {
        const int32_t *shift = images->of + number * images->width;
        memcpy(larger.of + number * larger.width, shift, (size_t)images->width * sizeof(int32_t));
        larger.slots[find_slot(&larger, shift)] = (int32_t)number;
    }
    hs_images_free(images);
    *images = larger;
    return true;
}

int32_t
hs_images_number(hs_images *images, const int32_t *shift)
{
    const size_t size = (size_t)images->width * sizeof *shift;
    if (images->n > 0 &&
        memcmp(images->of + (int64_t)images->last * images->width, shift, size) == 0) {
        return images->last;
    }
    if (images->n == images->capacity && !grow(images)) {
        return -1;
    }
    const int64_t slot = find_slot(images, shift);
    if (images->slots[slot] < 0) {
        memcpy(images->of + images->n * images->width, shift, size);
        images->slots[slot] = (int32_t)images->n++;
    }
    images->last = images->slots[slot];
    return images->last;
}
