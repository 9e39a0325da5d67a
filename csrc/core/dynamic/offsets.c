/* SPDX-License-Identifier: BSD-3-Clause */
/* offsets.c: the cube of offsets, sorted once when the list is made. */
#include "offsets.h"

#include <stdlib.h>

#include "../memory/account.h"

/* An offset and what it is sorted by. */
typedef struct item {
    double  least, centre;
    uint8_t slot[HS_MAX_DIM];
} item;

static int
compare(const void *one, const void *other)
{
    const item *a = one, *b = other;
    if (a->least != b->least) {
        return a->least < b->least ? -1 : 1;
    }
    if (a->centre != b->centre) {
        return a->centre < b->centre ? -1 : 1;
    }
    return memcmp(a->slot, b->slot, HS_MAX_DIM);
}

/* Cells to a side that a ball of this radius may reach, and one more for rounding. */
static double
reach_of(const hs_axes *axes, double max_radius)
{
    double reach = 0.0;
    for (int k = 0; k < axes->ndim; k++) {
        const hs_axis *axis = &axes->axis[k];
        if (isfinite(axis->width)) {
            reach = hs_larger(ceil(max_radius / axis->width) + 1.0, reach);
        }
    }
    return reach;
}

static double
count_of(int reach, int ndim)
{
    double n = 1.0;
    for (int k = 0; k < ndim; k++) {
        n *= 2 * reach + 1;
    }
    return n;
}

/* Distances in units of the widest cell, so that their squares are ordinary numbers. In skewed
 * boxes the least distance is the sum of squares of those between faces: an order, not a bound. */
static void
measure(const hs_axes *axes, const hs_lattice *lattice, double unit, item *of)
{
    double centre[HS_MAX_DIM] = {0};
    of->least = of->centre = 0.0;
    for (int k = 0; k < axes->ndim; k++) {
        const int    offset = of->slot[k] - HS_MOST_REACH;
        const int    between = offset > 1 ? offset - 1 : offset < -1 ? -offset - 1 : 0;
        const double width = isfinite(axes->axis[k].width) ? axes->axis[k].width / unit : 0.0;
        of->least += between * width * (between * width);
        for (int c = 0; c < axes->ndim; c++) {
            centre[c] += offset * width * lattice->direction[k][c];
        }
    }
    for (int c = 0; c < axes->ndim; c++) {
        of->centre += centre[c] * centre[c];
    }
}

static void
fill(const hs_axes *axes, const hs_lattice *lattice, int reach, item *items, hs_offset_list *list)
{
    const int d = axes->ndim, side = 2 * reach + 1;
    double    unit = 0.0;
    for (int k = 0; k < d; k++) {
        unit = hs_larger(isfinite(axes->axis[k].width) ? axes->axis[k].width : 0.0, unit);
    }
    for (int64_t n = 0; n < list->n; n++) {
        int64_t rest = n;
        memset(items[n].slot, 0, sizeof items[n].slot);
        for (int k = d - 1; k >= 0; k--) {
            items[n].slot[k] = (uint8_t)(rest % side + HS_MOST_REACH - reach);
            rest /= side;
        }
        measure(axes, lattice, unit > 0.0 ? unit : 1.0, &items[n]);
    }
    qsort(items, (size_t)list->n, sizeof *items, compare);
    for (int64_t n = 0; n < list->n; n++) {
        memcpy(list->slot + n * d, items[n].slot, (size_t)d);
    }
}

bool
hs_offsets_init(hs_offsets *offsets, const hs_axes *axes, const hs_lattice *lattice,
                double max_radius)
{
    const double needed = reach_of(axes, max_radius);
    int64_t      total = 0;
    memset(offsets, 0, sizeof *offsets);
    for (int r = 0; r <= HS_MOST_REACH && r <= needed; r++) {
        const double n = count_of(r, axes->ndim);
        if (n > HS_MOST_OFFSETS) {
            break;
        }
        offsets->reach = r;
        offsets->list[r].n = (int64_t)n;
        total += (int64_t)n * axes->ndim;
    }
    offsets->data = hs_alloc(NULL, HS_FOR_STENCIL, total, 1);
    item *items = hs_alloc(NULL, HS_FOR_STENCIL, offsets->list[offsets->reach].n, sizeof *items);
    if (offsets->data == NULL || items == NULL) {
        hs_free(NULL, items);
        hs_offsets_free(offsets);
        return false;
    }
    offsets->bytes = total;
    total = 0;
    for (int r = 0; r <= offsets->reach; r++) {
        offsets->list[r].slot = offsets->data + total;
        fill(axes, lattice, r, items, &offsets->list[r]);
        total += offsets->list[r].n * axes->ndim;
    }
    hs_free(NULL, items);
    return true;
}

void
hs_offsets_free(hs_offsets *offsets)
{
    hs_free(NULL, offsets->data);
    offsets->data = NULL;
}
