/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * points_template.h: the loading loop, once per type of coordinate.
 *
 *   REAL     float or double
 *   NAME(x)  x with the suffix of the type
 *
 * Undefines both at its end. Entries may lie at any address: memcpy compiles to one load.
 */
#if !defined(REAL) || !defined(NAME)
#error "define REAL and NAME before including points_template.h"
#endif

/* Copies n rows; returns the bits of the largest |x|, where infinity and NaN are largest of all. */
static uint64_t
NAME(load_rows)(const hs_points *points, double *x)
{
    const char *row = (const char *)points->data;
    uint64_t    largest = 0;
    for (int64_t i = 0; i < points->n; i++, row += points->row_stride) {
        const char *entry = row;
        for (int k = 0; k < points->ndim; k++, entry += points->column_stride) {
            REAL given;
            memcpy(&given, entry, sizeof given);
            const double   value = (double)given;
            const uint64_t magnitude = double_bits(value) & MAGNITUDE_BITS;
            largest = magnitude > largest ? magnitude : largest;
            *x++ = value;
        }
    }
    return largest;
}

#undef REAL
#undef NAME
