/* SPDX-License-Identifier: BSD-3-Clause */
/* unit.h: the power of two that a scene is scaled by, so that the search has ordinary numbers. */
#ifndef HS_UNIT_H
#define HS_UNIT_H

#include "points.h"

/*
 * How far is far? So many powers of two beyond a length, each for a reason of its own. hs_is_far
 * tells.
 */
/* Beyond so many cutoffs gaps between the points are closed (close_gaps.h): float64 numbers are
 * multiples of four cutoffs there. */
#define HS_FAR_EXPONENT 54
/*
 * Beyond so many largest distances they are in a bounded search for the nearest. Wrapped into a
 * coupled box, coordinates err by 2^-52 of the largest one. The radius that is looked at is 2^10
 * times the error of two at least (nearest_block.c), so it passes the largest distance from here
 * on, and soon spans many images.
 */
#define HS_FAR_BOUNDED_EXPONENT 40
/* Points may be 2^51 box vectors away, where turns are integers that float64 holds; there is one
 * order to spare. What is further away is refused or wrapped before it is scaled. */
#define HS_FAR_TURNS_EXPONENT 52
/*
 * Scaled coordinates and box entries stay below 2^57, so that squares of sums of a few are finite
 * in float32. Closing gaps keeps to that along open and aligned axes; what remains, coupled by a
 * skewed box, is known to within 2^-53 of the largest only, so that a cutoff may well be smaller
 * than 1 then.
 */
#define HS_LARGEST_EXPONENT 56
/* So many vectors of the box in a cutoff have more images than any memory holds. */
#define HS_FAR_IMAGES_EXPONENT 64
/* Open axes that are so many times as long leave less than 2^-10 of a coupled box certain: wrapping
 * errs by some 2^-99 of the largest coordinate (wrap.h). */
#define HS_FAR_DROWNING_EXPONENT 88
/* Where no float32 is made of scaled numbers they stay below 2^901, so that sums of a few are
 * finite. */
#define HS_LARGEST_WIDE_EXPONENT 900

/* x = m 2^e with 1 <= m < 2: e. Of zero a very small number, of infinity a very large one. */
int hs_exponent_of(double x);

/* Whether a size is more than 2^powers times a length of the exponent `unit`, 2^unit. */
bool hs_is_far(double size, int unit, int powers);

/* Sizes of the periodic box entries. */
typedef struct hs_box_size {
    double   largest;    /* 0 without box vectors */
    double   smallest;   /* not counting zeros; infinity without box vectors */
    double   short_row;  /* the least of the vectors' largest entries; infinity without */
    unsigned moved;      /* bit k: some vector has an entry in column k */
    bool     is_coupled; /* a vector has several entries, or a column has */
} hs_box_size;

/* box: NULL for none. */
hs_box_size hs_box_size_of(const hs_box *box);

/* What moves a column of coordinates besides the points' own values. */
#define HS_OPEN    (-1) /* nothing */
#define HS_COUPLED (-2) /* box vectors that have entries in other columns as well */

/* HS_OPEN, HS_COUPLED, or the number of the row (a box vector) that alone has an entry in this
 * column, and no other entry. periodic: the rows that count; NULL: all. */
int hs_mover_among(const double rows[][HS_MAX_DIM], const bool *periodic, int n_rows, int ndim,
                   int column);

/* hs_mover_among for the periodic rows of a box. box: NULL for none. */
int hs_mover_of(const hs_box *box, int column);

/* The cutoff, or a smaller one if that is beyond all distances as well. */
double hs_enough_cutoff(const hs_cloud *cloud, const hs_box_size *box, double cutoff);

/* The exponent of the length that a scene goes by: its cutoff, or with cutoff 0 its box, or where
 * its points are. A very small number if all is 0. */
int hs_unit_exponent(const hs_cloud *cloud, const hs_box_size *box, double cutoff);

/* Whether points of open space with this cutoff are searched as they are: no gap is closed, nothing
 * is scaled, and the cutoff is not shortened. */
bool hs_is_ordinary(const hs_cloud *cloud, double cutoff);

/* Whether all numbers are at most so many powers of two above a length of this exponent. */
bool hs_fits_one_scale(const hs_cloud *cloud, const hs_box_size *box, int unit, int powers);

/* Whether coordinates along open axes are so large that a coupled box is lost in the rounding of
 * what is wrapped into it. */
bool hs_open_drowns_box(const hs_cloud *cloud, const hs_box_size *box, double cutoff);

/* The exponent to scale by, so that no exponent is above `largest`; *extreme: whether that loses
 * digits. unit: from hs_unit_exponent. */
int hs_choose_exponent(const hs_cloud *cloud, const hs_box_size *box, double cutoff, int unit,
                       int largest, bool *extreme);

#endif
