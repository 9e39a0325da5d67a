/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * points_template.h: the loading loops, once per type of coordinate.
 *
 *   REAL     float or double
 *   NAME(x)  x with the suffix of the type
 *
 * Undefines both at its end. Entries may lie at any address: memcpy compiles to one load.
 */
#if !defined(REAL) || !defined(NAME)
#error "define REAL and NAME before including points_template.h"
#endif

/* Copies points [first, last). Inlined with constants for ndim and column_stride. */
HS_ALWAYS_INLINE void
NAME(copy_rows)(const hs_points *points, int ndim, ptrdiff_t column_stride, int64_t first,
                int64_t last, double *const *x)
{
    double *to[HS_MAX_DIM];
    for (int k = 0; k < ndim; k++) {
        to[k] = x[k];
    }
    for (int64_t i = first; i < last; i++) { /* no address behind the last point: it may overflow */
        const char *row = (const char *)points->data + i * points->row_stride;
        for (int k = 0; k < ndim; k++) {
            REAL given;
            memcpy(&given, row + k * column_stride, sizeof given);
            to[k][i] = (double)given;
        }
    }
}

/* The common shapes apart, so that their loops have no inner loop. */
static void
NAME(load_rows)(const hs_points *points, int64_t first, int64_t last, double *const *x)
{
    const ptrdiff_t size = (ptrdiff_t)sizeof(REAL);
    if (points->ndim == 3 && points->column_stride == size) {
        NAME(copy_rows)(points, 3, size, first, last, x);
    } else if (points->ndim == 2 && points->column_stride == size) {
        NAME(copy_rows)(points, 2, size, first, last, x);
    } else {
        NAME(copy_rows)(points, points->ndim, points->column_stride, first, last, x);
    }
}

#undef REAL
#undef NAME
