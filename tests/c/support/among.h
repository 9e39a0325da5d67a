/* SPDX-License-Identifier: BSD-3-Clause */
/* among.h: short forms of arguments: points, sets of them, and hs_among, which last until the end of
 * the block. */
#ifndef HS_AMONG_H
#define HS_AMONG_H

#include "../../../csrc/halfshell.h"

/* Points, as they are now, and what is known of each; NULL for NULL. */
#define SET(p, ...) set_with((p), &(hs_set){.at = {.n = 0}, ##__VA_ARGS__})
#define AMONG(p, b) (&(hs_among){.points = SET(p), .box = (b)})
/* n systems, the first points of each, what each has of its own. */
#define SYSTEMS(p, n, first_of_each, b, own) \
    (&(hs_among){                            \
        .points = SET(p, .n_systems = (n), .first = (first_of_each)), .box = (b), .each = (own)})
#define QUERIED(p, q, b)    (&(hs_among){.points = SET(p), .queries = SET(q), .box = (b)})
#define IN_CELLS(c)         (&(hs_among){.cells = (c)})
#define QUERIED_CELLS(c, q) (&(hs_among){.cells = (c), .queries = SET(q)})

static inline const hs_set *
set_with(const hs_points *points, hs_set *set)
{
    set->at = points != NULL ? *points : set->at;
    return points != NULL ? set : NULL;
}

/* n points, one after the other. */
static inline hs_points
points_in_rows(const void *x, int64_t n, int ndim)
{
    return (hs_points){.data = x,
                       .n = n,
                       .ndim = ndim,
                       .real = HS_FLOAT64,
                       .row_stride = ndim * (ptrdiff_t)sizeof(double),
                       .column_stride = sizeof(double)};
}

#endif
