/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scan_forms.h: the five scans of a kernel, from its scan_points and square_points. Include it
 * after these functions. Defines list, count, list_direct, count_direct and squares (hs_scan_fn),
 * each with one loop for 1, 2, 3 and any number of axes, made by inlining with constants.
 */

HS_ALWAYS_INLINE int32_t
scan_dimensions(hs_scan *scan, int32_t first, const bool expanded, const bool lists)
{
    switch (scan->ndim) {
    case 1: return scan_points(scan, first, 1, expanded, lists);
    case 2: return scan_points(scan, first, 2, expanded, lists);
    case 3: return scan_points(scan, first, 3, expanded, lists);
    default: return scan_points(scan, first, scan->ndim, expanded, lists);
    }
}

static int32_t
list(hs_scan *scan, int32_t first)
{
    return scan_dimensions(scan, first, true, true);
}

static int32_t
count(hs_scan *scan, int32_t first)
{
    return scan_dimensions(scan, first, true, false);
}

static int32_t
list_direct(hs_scan *scan, int32_t first)
{
    return scan_dimensions(scan, first, false, true);
}

static int32_t
count_direct(hs_scan *scan, int32_t first)
{
    return scan_dimensions(scan, first, false, false);
}

static int32_t
squares(hs_scan *scan, int32_t first)
{
    switch (scan->ndim) {
    case 1: return square_points(scan, first, 1);
    case 2: return square_points(scan, first, 2);
    case 3: return square_points(scan, first, 3);
    default: return square_points(scan, first, scan->ndim);
    }
}
