/* SPDX-License-Identifier: BSD-3-Clause */
/* shift_table.h: the distinct shifts among many, numbered in the order in which they first come. */
#ifndef HS_SHIFT_TABLE_H
#define HS_SHIFT_TABLE_H

#include "../base/base.h"

typedef struct hs_images {
    int      width; /* numbers of a shift */
    int32_t *of;    /* owned; n shifts of `width` numbers */
    int64_t  n;
    int64_t  capacity; /* shifts */
    int32_t *slots;    /* owned; -1, or the number of a shift; twice the capacity, a power of two */
    int32_t  last;     /* number of the last shift: most often the next has it, too */
} hs_images;

/* An empty table. */
void hs_images_init(int width, hs_images *images);

/* The number of this shift, a new one if it was not there. -1: out of memory. */
int32_t hs_images_number(hs_images *images, const int32_t *shift);

/* Harmless twice. */
void hs_images_free(hs_images *images);

#endif
