/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * offsets.h: the cells around a query's cell, nearest first: ordered by the least distance between
 * points of the two cells, then by the distance of their centres, then by index. One list for each
 * number of cells that a ball reaches to a side; a ball that reaches farther is walked in the order
 * of indices.
 */
#ifndef HS_OFFSETS_H
#define HS_OFFSETS_H

#include "cell_axes.h"

#define HS_MOST_REACH   15   /* cells to a side */
#define HS_MOST_OFFSETS 8192 /* of one list */
#define HS_SLOTS        (2 * HS_MOST_REACH + 1)

typedef struct hs_offset_list {
    int64_t  n;
    uint8_t *slot; /* borrowed from `data`: ndim each, the offset plus HS_MOST_REACH */
} hs_offset_list;

typedef struct hs_offsets {
    int            reach; /* lists 0 to `reach` are there */
    hs_offset_list list[HS_MOST_REACH + 1];
    uint8_t       *data; /* owned */
    int64_t        bytes;
} hs_offsets;

/* Lists for balls up to this radius, as far as they are not too long. False when memory is
 * refused. */
bool hs_offsets_init(hs_offsets *offsets, const hs_axes *axes, const hs_lattice *lattice,
                     double max_radius);
void hs_offsets_free(hs_offsets *offsets);

#endif
