/* SPDX-License-Identifier: BSD-3-Clause */
/* unit.c: compares exponents, which are integers: no ratio of lengths can overflow. */
#include "unit.h"

#include <math.h>
#include <stdlib.h>

/* Cutoffs between 2^-20 and 2^20 are left alone: the float32 filter has room for their squares. */
#define ORDINARY_EXPONENT 20
/* A cutoff that is 2^8 times the largest coordinate: two points are less than 2 sqrt(8) times that
 * and a binary order apart. */
#define WHOLE_EXPONENT 8
/* Cutoffs up to so many times the largest coordinate are never shortened. */
#define ENOUGH_CUTOFF 64.0
/* Exponent of zero; that of infinity is its opposite. Sums with other exponents do not overflow. */
#define NO_EXPONENT (INT32_MIN / 2)

int
hs_exponent_of(double x)
{
    return x == 0.0 ? NO_EXPONENT : isinf(x) ? -NO_EXPONENT : ilogb(x);
}

bool
hs_is_far(double size, int unit, int powers)
{
    return size > ldexp(1.0, unit + powers); /* infinity, or 0, where that passes the range */
}

static int
entries_of_row(const double *row, int ndim)
{
    int entries = 0;
    for (int k = 0; k < ndim; k++) {
        entries += row[k] != 0.0;
    }
    return entries;
}

int
hs_mover_among(const double rows[][HS_MAX_DIM], const bool *periodic, int n_rows, int ndim,
               int column)
{
    int mover = HS_OPEN;
    for (int l = 0; l < n_rows; l++) {
        if ((periodic == NULL || periodic[l]) && rows[l][column] != 0.0) {
            mover = mover == HS_OPEN && entries_of_row(rows[l], ndim) == 1 ? l : HS_COUPLED;
        }
    }
    return mover;
}

int
hs_mover_of(const hs_box *box, int column)
{
    return box == NULL ? HS_OPEN
                       : hs_mover_among((const double(*)[HS_MAX_DIM])box->rows, box->periodic,
                                        box->ndim, box->ndim, column);
}

hs_box_size
hs_box_size_of(const hs_box *box)
{
    hs_box_size found = {0.0, INFINITY, INFINITY, 0, false};
    for (int l = 0; box != NULL && l < box->ndim; l++) {
        double row_largest = 0.0;
        for (int k = 0; box->periodic[l] && k < box->ndim; k++) {
            const double size = fabs(box->rows[l][k]);
            row_largest = hs_larger(size, row_largest);
            found.smallest = size > 0.0 ? hs_smaller(size, found.smallest) : found.smallest;
        }
        found.largest = hs_larger(row_largest, found.largest);
        if (box->periodic[l]) {
            found.short_row = hs_smaller(row_largest, found.short_row);
        }
    }
    for (int k = 0; box != NULL && k < box->ndim; k++) {
        const int mover = hs_mover_of(box, k);
        found.moved |= (unsigned)(mover != HS_OPEN) << k;
        found.is_coupled = found.is_coupled || mover == HS_COUPLED;
    }
    return found;
}

double
hs_enough_cutoff(const hs_cloud *cloud, const hs_box_size *box, double cutoff)
{
    if (!(cutoff > ENOUGH_CUTOFF * cloud->largest) || cloud->largest == 0.0 || box->largest > 0.0) {
        return cutoff;
    }
    const int exponent = hs_exponent_of(cloud->largest) + WHOLE_EXPONENT;
    return exponent > 1023 ? cutoff : hs_smaller(ldexp(1.0, exponent), cutoff);
}

bool
hs_is_ordinary(const hs_cloud *cloud, double cutoff)
{
    const double far = ldexp(1.0, HS_FAR_EXPONENT - 1 - ORDINARY_EXPONENT);
    return cutoff >= ldexp(1.0, -ORDINARY_EXPONENT) && cutoff <= ldexp(1.0, ORDINARY_EXPONENT) &&
           cutoff <= ENOUGH_CUTOFF * cloud->largest && cloud->largest <= far;
}

int
hs_unit_exponent(const hs_cloud *cloud, const hs_box_size *box, double cutoff)
{
    return hs_exponent_of(cutoff > 0.0                 ? cutoff
                          : box->short_row != INFINITY ? box->short_row
                                                       : cloud->largest);
}

bool
hs_fits_one_scale(const hs_cloud *cloud, const hs_box_size *box, int unit, int powers)
{
    const double largest = hs_larger(box->largest, cloud->largest);
    return !hs_is_far(largest, unit, powers);
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
    return box->is_coupled &&
           hs_is_far(open_reach(cloud, box), hs_exponent_of(hs_larger(box->largest, cutoff)),
                     HS_FAR_DROWNING_EXPONENT);
}

int
hs_choose_exponent(const hs_cloud *cloud, const hs_box_size *box, double cutoff, int unit,
                   int largest, bool *extreme)
{
    int          exponent = unit == NO_EXPONENT || abs(unit) <= ORDINARY_EXPONENT ? 0 : unit;
    const double turned = ldexp(box->largest, HS_FAR_TURNS_EXPONENT);
    const double reach = turned > 0.0 ? hs_smaller(turned, cloud->largest) : cloud->largest;
    const int    found = hs_exponent_of(hs_larger(box->largest, reach));
    if (found - exponent > largest) {
        exponent = found - largest;
    }
    const int wide = hs_exponent_of(open_reach(cloud, box)) - HS_LARGEST_WIDE_EXPONENT;
    exponent = exponent < wide ? wide : exponent;
    *extreme = false;
    if (exponent > 0) {
        double smallest = fmin(box->smallest, hs_cloud_smallest(cloud));
        smallest = cutoff > 0.0 ? fmin(smallest, cutoff) : smallest;
        *extreme = smallest != INFINITY && hs_exponent_of(smallest) - exponent < -1022;
    }
    return exponent;
}
