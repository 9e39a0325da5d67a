/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scan_forms.h: the nine scans of a kernel, from its scan_points and square_points. Include it
 * after these functions. Defines list, count, list_direct, count_direct, list_limits, count_limits,
 * list_supports, count_supports and squares (hs_scan_fn), each with one loop for 1, 2, 3 and, but
 * for supports, any number of axes, made by inlining with constants.
 */

HS_ALWAYS_INLINE int32_t
scan_dimensions(hs_scan *scan, int32_t first, const hs_scan_form form, const bool lists)
{
    switch (scan->ndim) {
    case 1: return scan_points(scan, first, 1, form, lists);
    case 2: return scan_points(scan, first, 2, form, lists);
    case 3: return scan_points(scan, first, 3, form, lists);
    default: return scan_points(scan, first, scan->ndim, form, lists);
    }
}

static int32_t
list(hs_scan *scan, int32_t first)
{
    return scan_dimensions(scan, first, HS_SCAN_EXPANDED, true);
}

static int32_t
count(hs_scan *scan, int32_t first)
{
    return scan_dimensions(scan, first, HS_SCAN_EXPANDED, false);
}

static int32_t
list_direct(hs_scan *scan, int32_t first)
{
    return scan_dimensions(scan, first, HS_SCAN_DIRECT, true);
}

static int32_t
count_direct(hs_scan *scan, int32_t first)
{
    return scan_dimensions(scan, first, HS_SCAN_DIRECT, false);
}

static int32_t
list_limits(hs_scan *scan, int32_t first)
{
    return scan_dimensions(scan, first, HS_SCAN_LIMITS, true);
}

static int32_t
count_limits(hs_scan *scan, int32_t first)
{
    return scan_dimensions(scan, first, HS_SCAN_LIMITS, false);
}

HS_ALWAYS_INLINE int32_t
scan_supports(hs_scan *scan, int32_t first, const bool lists)
{
    switch (scan->ndim) {
    case 1: return scan_points(scan, first, 1, HS_SCAN_SUPPORTS, lists);
    case 2: return scan_points(scan, first, 2, HS_SCAN_SUPPORTS, lists);
    default: return scan_points(scan, first, 3, HS_SCAN_SUPPORTS, lists);
    }
}

static int32_t
list_supports(hs_scan *scan, int32_t first)
{
    return scan_supports(scan, first, true);
}

static int32_t
count_supports(hs_scan *scan, int32_t first)
{
    return scan_supports(scan, first, false);
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
