/* SPDX-License-Identifier: BSD-3-Clause */
/* among.h: short forms of arguments: points, and hs_among, which lasts until the end of the block. */
#ifndef HS_AMONG_H
#define HS_AMONG_H

#include "../../../csrc/halfshell.h"

#define AMONG(p, b)         (&(hs_among){.points = (p), .box = (b)})
#define QUERIED(p, q, b)    (&(hs_among){.points = (p), .queries = (q), .box = (b)})
#define IN_CELLS(c)         (&(hs_among){.cells = (c)})
#define QUERIED_CELLS(c, q) (&(hs_among){.cells = (c), .queries = (q)})

/* n points in space, one after the other. */
static inline hs_points
points_in_space(const double *x, int64_t n)
{
    return (hs_points){.data = x,
                       .n = n,
                       .ndim = 3,
                       .real = HS_FLOAT64,
                       .row_stride = 3 * sizeof(double),
                       .column_stride = sizeof(double)};
}

#endif
