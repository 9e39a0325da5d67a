/* SPDX-License-Identifier: BSD-3-Clause */
/* unit.c: see unit.h. */
#include "unit.h"

#include <math.h>
#include <stdlib.h>

/* Cutoffs between 2^-20 and 2^20 are left alone: the float32 filter has room for their squares. */
#define ORDINARY_EXPONENT 20
/* Points of a skewed box may be 2^51 box vectors away; others are refused. */
#define FARTHEST 0x1p52
/* Open axes that are so many times as long leave less than 2^-10 of a coupled box certain: wrapping
 * errs by some 2^-99 of the largest coordinate (wrap.h). */
#define DROWNING 0x1p88
/* A cutoff that is 2^8 times the largest coordinate: two points are less than 2 sqrt(8) times that
 * and a binary order apart. */
#define WHOLE_EXPONENT 8
/* Of zero. */
#define NO_EXPONENT (INT32_MIN / 2)

/* x = m 2^e with 1 <= m < 2: e. */
static int
exponent_of(double x)
{
    return x == 0.0 ? NO_EXPONENT : ilogb(x);
}

static int
entries_of_row(const hs_box *box, int l)
{
    int entries = 0;
    for (int k = 0; k < box->ndim; k++) {
        entries += box->rows[l][k] != 0.0;
    }
    return entries;
}

int
hs_mover_of(const hs_box *box, int column)
{
    int mover = HS_OPEN;
    for (int l = 0; box != NULL && l < box->ndim; l++) {
        if (box->periodic[l] && box->rows[l][column] != 0.0) {
            mover = mover == HS_OPEN && entries_of_row(box, l) == 1 ? l : HS_COUPLED;
        }
    }
    return mover;
}

hs_box_size
hs_box_size_of(const hs_box *box)
{
    hs_box_size found = {0.0, INFINITY, INFINITY, 0, false};
    for (int l = 0; box != NULL && l < box->ndim; l++) {
        double row_largest = 0.0;
        int    entries = 0;
        for (int k = 0; box->periodic[l] && k < box->ndim; k++) {
            const double size = fabs(box->rows[l][k]);
            row_largest = hs_larger(size, row_largest);
            entries += size > 0.0;
            found.is_coupled = found.is_coupled || (size > 0.0 && found.moved >> k & 1u);
            found.moved |= (unsigned)(size > 0.0) << k;
            found.smallest = size > 0.0 ? hs_smaller(size, found.smallest) : found.smallest;
        }
        found.is_coupled = found.is_coupled || entries > 1;
        found.largest = hs_larger(row_largest, found.largest);
        if (box->periodic[l]) {
            found.short_row = hs_smaller(row_largest, found.short_row);
        }
    }
    return found;
}

double
hs_enough_cutoff(const hs_cloud *cloud, const hs_box_size *box, double cutoff)
{
    if (!(cutoff > 64.0 * cloud->largest) || cloud->largest == 0.0 || box->largest > 0.0) {
        return cutoff;
    }
    const int exponent = exponent_of(cloud->largest) + WHOLE_EXPONENT;
    return exponent > 1023 ? cutoff : hs_smaller(ldexp(1.0, exponent), cutoff);
}

int
hs_unit_exponent(const hs_cloud *cloud, const hs_box_size *box, double cutoff)
{
    return exponent_of(cutoff > 0.0                 ? cutoff
                       : box->short_row != INFINITY ? box->short_row
                                                    : cloud->largest);
}

bool
hs_fits_one_scale(const hs_cloud *cloud, const hs_box_size *box, int unit, int powers)
{
    const double largest = hs_larger(box->largest, cloud->largest);
    return exponent_of(largest) - unit <= powers;
}

/* The largest coordinate that wrapping leaves as it is. */
static double
open_reach(const hs_cloud *cloud, const hs_box_size *box)
{
    double reach = 0.0;
    for (int k = 0; k < cloud->ndim; k++) {
        if (!(box->moved >> k & 1u)) {
            reach = hs_larger(hs_larger(-cloud->lower[k], cloud->upper[k]), reach);
        }
    }
    return reach;
}

bool
hs_open_drowns_box(const hs_cloud *cloud, const hs_box_size *box, double cutoff)
{
    return box->is_coupled && open_reach(cloud, box) > DROWNING * hs_larger(box->largest, cutoff);
}

int
hs_choose_exponent(const hs_cloud *cloud, const hs_box_size *box, double cutoff, int unit,
                   int largest, bool *extreme)
{
    int       exponent = unit == NO_EXPONENT || abs(unit) <= ORDINARY_EXPONENT ? 0 : unit;
    const double reach = box->largest > 0.0 ? hs_smaller(FARTHEST * box->largest, cloud->largest)
                                            : cloud->largest;
    const int found = exponent_of(hs_larger(box->largest, reach));
    if (found - exponent > largest) {
        exponent = found - largest;
    }
    const int wide = exponent_of(open_reach(cloud, box)) - HS_LARGEST_WIDE_EXPONENT;
    exponent = exponent < wide ? wide : exponent;
    *extreme = false;
    if (exponent > 0) {
        double smallest = fmin(box->smallest, hs_cloud_smallest(cloud));
        smallest = cutoff > 0.0 ? fmin(smallest, cutoff) : smallest;
        *extreme = smallest != INFINITY && exponent_of(smallest) - exponent < -1022;
    }
    return exponent;
}
