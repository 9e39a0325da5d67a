/* SPDX-License-Identifier: BSD-3-Clause */
/* place_point.h: a position as a list stores it: brought into the middle period, and its cell. */
#ifndef HS_PLACE_POINT_H
#define HS_PLACE_POINT_H

#include "dynamic.h"
#include "../box/wrap.h"

/* A position, made ready. */
struct hs_placed {
    const double *given;             /* borrowed; ndim finite numbers */
    double        x[HS_MAX_DIM];     /* X, in the middle period; not rounded in aligned boxes */
    double        t[HS_MAX_DIM];     /* coordinates along the grid axes */
    double        terms[HS_MAX_DIM]; /* sums of absolute products in them; not in aligned boxes */
    int64_t       turns[HS_MAX_DIM]; /* over the rows of B */
    int64_t       index[HS_MAX_DIM]; /* of the cell */
    double        magnitude; /* as hs_wrap_point raises it, of the coordinates that the box moves;
                              * not in aligned boxes */
};

/*
 * X and turns of finite numbers; false beyond HS_WRAP_LIMIT. *magnitude as in hs_wrap_point.
 * Aligned boxes wrap each coordinate exactly, others by compensated sums. Most points are inside
 * or one period away, where the difference is exact, as wrap.c says of its columns.
 */
HS_ALWAYS_INLINE bool
hs_dynamic_wrap(const hs_dynamic *list, const double *given, double *wrapped, int64_t *turns,
                double *magnitude, const int ndim)
{
    bool fits = true;
    if (!list->lattice.aligned) {
        return hs_wrap_point(&list->lattice, given, wrapped, turns, magnitude);
    }
    for (int k = 0; k < ndim; k++) {
        const hs_axis *axis = &list->axes.axis[k];
        const double   x = given[k], size = fabs(x);
        wrapped[k] = x;
        if (axis->row < 0) {
            continue;
        }
        if (size <= 1.25 * axis->period) {
            /* No branch: which half of the box a point is in cannot be predicted. */
            const double turn = (double)((x > axis->half) - (x < -axis->half));
            wrapped[k] = x - turn * axis->period;
            turns[axis->row] = (int64_t)turn;
        } else {
            wrapped[k] = hs_wrap_axis(x, axis->period, &turns[axis->row]);
            fits = fits && turns[axis->row] != HS_WRAP_UNKNOWN;
        }
    }
    return fits;
}

/* In general boxes: whether X and its coordinates are known to within a few periods, so that a ball
 * meets few images. Sets the magnitude and the terms. */
bool hs_dynamic_is_known(const hs_dynamic *list, hs_placed *placed);

/* HS_OK, HS_ERR_NOT_FINITE with column and value, HS_ERR_SHIFT_RANGE. ndim: that of the list, for
 * callers that let the compiler unroll loops. */
HS_ALWAYS_INLINE hs_status
hs_dynamic_place_in(const hs_dynamic *list, const double *given, hs_placed *placed,
                    hs_failure *failure, const int ndim)
{
    placed->given = given;
    placed->magnitude = 0.0;
    for (int k = 0; k < ndim; k++) {
        if (!isfinite(given[k])) {
            failure->column = k;
            failure->value = given[k];
            return HS_ERR_NOT_FINITE;
        }
    }
    if (HS_UNLIKELY(list->counters != NULL) && list->lattice.n_periodic > 0) {
        list->counters->wraps++;
    }
    if (!hs_dynamic_wrap(list, given, placed->x, placed->turns, &placed->magnitude, ndim)) {
        return HS_ERR_SHIFT_RANGE;
    }
    if (!list->lattice.aligned && !hs_dynamic_is_known(list, placed)) {
        return HS_ERR_SHIFT_RANGE;
    }
    for (int k = 0; k < ndim; k++) {
        placed->t[k] = hs_lattice_coordinate(&list->lattice, placed->x, k);
        placed->index[k] = hs_axis_cell(&list->axes.axis[k], placed->t[k]);
    }
    return HS_OK;
}

hs_status hs_dynamic_place(const hs_dynamic *list, const double *given, hs_placed *placed,
                           hs_failure *failure);

/* The position of an entry. placed: NULL for a key without one. */
void hs_dynamic_write(hs_dynamic *list, uint32_t place, const hs_placed *placed);

#endif
