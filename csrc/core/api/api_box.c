/* SPDX-License-Identifier: BSD-3-Clause */
/* api_box.c: the public functions of a box alone: measure and wrap. */
#include "../../halfshell.h"

#include "arguments.h"
#include "../box/lattice.h"
#include "../scene/points.h"
#include "../threads/call.h"
#include "../box/wrap.h"

#include <math.h>
#include <string.h>

#define LARGEST_EXPONENT 1000

/* Only boxes near the end of the range are scaled, to leave room for sums of a few lengths. */
static hs_scale
scale_of_box(const hs_box *box)
{
    double largest = 0.0;
    for (int l = 0; l < box->ndim; l++) {
        for (int k = 0; box->periodic[l] && k < box->ndim; k++) {
            largest = fmax(largest, fabs(box->rows[l][k]));
        }
    }
    const int exponent = largest > 0.0 ? ilogb(largest) : 0;
    return hs_scale_of(exponent > LARGEST_EXPONENT ? exponent - LARGEST_EXPONENT : 0);
}

hs_status
hs_box_measure(const hs_box *box, double *heights, double *volume, hs_failure *failure)
{
    hs_entry   entry;
    hs_lattice lattice;
    failure = hs_enter(failure, &entry);
    hs_status status = box != NULL ? hs_check_box(box, box->ndim) : HS_ERR_ARGUMENT;
    if (status == HS_OK) {
        status = hs_box_check(box, failure);
    }
    if (status == HS_OK) {
        const hs_scale scale = scale_of_box(box);
        const hs_scale back = hs_scale_of(-scale.exponent);
        hs_lattice_init_given(box, scale, &lattice);
        for (int r = 0; heights != NULL && r < lattice.n_periodic; r++) {
            const int l = lattice.vector_of_row[r];
            heights[l] = hs_scale_apply(back, lattice.period[l]);
        }
        if (volume != NULL) {
            *volume = hs_lattice_volume(&lattice, scale.exponent);
        }
    }
    hs_leave(&entry);
    return status;
}

/* The column of the only entry of box vector r, if no other vector has one there, or -1. That
 * coordinate alone then says what is inside along r. */
static int
own_column(const hs_lattice *lattice, int r)
{
    int column = -1;
    for (int k = 0; k < lattice->ndim; k++) {
        if (lattice->rows[r][k] != 0.0) {
            if (column >= 0) {
                return -1;
            }
            column = k;
        }
    }
    for (int other = 0; other < lattice->n_periodic; other++) {
        if (other != r && lattice->rows[other][column] != 0.0) {
            return -1;
        }
    }
    return column;
}

/* A tiny negative coordinate plus the length rounds to the length: keep it inside. */
static void
keep_inside(const hs_lattice *lattice, double *wrapped)
{
    for (int r = 0; r < lattice->n_periodic; r++) {
        const int k = own_column(lattice, r);
        if (k >= 0 && fabs(wrapped[k]) >= fabs(lattice->rows[r][k])) {
            wrapped[k] = nextafter(lattice->rows[r][k], 0.0);
        }
    }
}

/* Moves a point from the middle period to [0, 1): one more vector for each negative fraction.
 * Rounded once, from the point as given, so that points that are inside stay as they are. */
static bool
wrap_row(const hs_lattice *lattice, const double *x, double *wrapped, int64_t *turns)
{
    double middle[HS_MAX_DIM];
    double magnitude = 0.0;
    bool   moved = false;
    if (!hs_wrap_point(lattice, x, middle, turns, &magnitude)) {
        return false;
    }
    for (int k = 0; k < lattice->ndim; k++) {
        const int r = lattice->row_of_axis[k];
        if (r < 0) {
            continue;
        }
        turns[r] -= hs_lattice_coordinate(lattice, middle, k) < 0.0;
        moved = moved || turns[r] != 0;
    }
    if (!moved) {
        memcpy(wrapped, x, (size_t)lattice->ndim * sizeof *x);
        return true;
    }
    if (!hs_wrap_by(lattice, x, turns, wrapped, &magnitude)) {
        return false;
    }
    keep_inside(lattice, wrapped);
    return true;
}

static hs_status
wrap_rows(const hs_lattice *lattice, hs_scale scale, const hs_cloud *cloud, double *wrapped,
          int64_t *shift, hs_failure *failure)
{
    const hs_scale back = hs_scale_of(-scale.exponent);
    const int      d = lattice->ndim;
    for (int64_t i = 0; i < cloud->n; i++) {
        double  x[HS_MAX_DIM], inside[HS_MAX_DIM];
        int64_t turns[HS_MAX_DIM], given[HS_MAX_DIM];
        for (int k = 0; k < d; k++) {
            x[k] = hs_scale_apply(scale, cloud->x[k][i]);
        }
        if (!wrap_row(lattice, x, inside, turns)) {
            failure->row = i;
            return HS_ERR_SHIFT_RANGE;
        }
        (void)hs_lattice_shift(lattice, turns, given); /* these fit: wrap_row has checked it */
        for (int k = 0; wrapped != NULL && k < d; k++) {
            const bool stays = inside[k] == x[k]; /* scaling may have lost its last digits */
            wrapped[i * d + k] = stays ? cloud->x[k][i] : hs_scale_apply(back, inside[k]);
        }
        if (shift != NULL) {
            memset(shift + i * d, 0, (size_t)d * sizeof(int64_t));
            for (int l = 0; l < lattice->n_periodic; l++) {
                shift[i * d + lattice->vector_of_row[l]] = -given[l];
            }
        }
    }
    return HS_OK;
}

hs_status
hs_box_wrap(const hs_box *box, const hs_points *points, double *wrapped, int64_t *shift,
            hs_failure *failure)
{
    const hs_options options = hs_options_default();
    hs_entry         entry;
    hs_lattice       lattice;
    hs_cloud         cloud;
    failure = hs_enter(failure, &entry);
    hs_status status = box != NULL ? hs_check_arguments(points, NULL, box, &options, failure)
                                   : HS_ERR_ARGUMENT;
    if (status == HS_OK) {
        status = hs_box_check(box, failure);
    }
    if (status == HS_OK) {
        status = hs_cloud_load(NULL, NULL, points, &options, &cloud, failure);
    }
    if (status == HS_OK) {
        const hs_scale scale = scale_of_box(box);
        hs_lattice_init_given(box, scale, &lattice);
        /* First without writing, so that a point that cannot be wrapped leaves the outputs as they
         * were. */
        status = wrap_rows(&lattice, scale, &cloud, NULL, NULL, failure);
        if (status == HS_OK) {
            status = wrap_rows(&lattice, scale, &cloud, wrapped, shift, failure);
        }
        hs_cloud_free(NULL, &cloud);
    }
    hs_leave(&entry);
    return status;
}
