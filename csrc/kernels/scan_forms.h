/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scan_forms.h: the scan of a kernel (hs_scan_fn), scan_any, from its scan_points: one loop for
 * each form, for 1, 2, 3 and, but for supports, any number of axes, made by inlining with
 * constants. Include it after scan_points.
 */

HS_ALWAYS_INLINE int32_t
scan_dimensions(hs_scan *scan, int32_t first, const hs_scan_form form, const bool lists)
{
    switch (scan->ndim) {
    case 1: return scan_points(scan, first, 1, form, lists);
    case 2: return scan_points(scan, first, 2, form, lists);
    case 3: return scan_points(scan, first, 3, form, lists);
    default:
        return form == HS_SCAN_SUPPORTS ? scan->n_points
                                        : scan_points(scan, first, scan->ndim, form, lists);
    }
}

HS_ALWAYS_INLINE int32_t
scan_form(hs_scan *scan, int32_t first, const hs_scan_form form)
{
    return scan->counts ? scan_dimensions(scan, first, form, false)
                        : scan_dimensions(scan, first, form, true);
}

/* Each form is a function by itself: loops in one of them share its registers. */

static HS_NO_INLINE int32_t
scan_direct(hs_scan *scan, int32_t first)
{
    return scan_form(scan, first, HS_SCAN_DIRECT);
}

static HS_NO_INLINE int32_t
scan_limits(hs_scan *scan, int32_t first)
{
    return scan_form(scan, first, HS_SCAN_LIMITS);
}

static HS_NO_INLINE int32_t
scan_supports(hs_scan *scan, int32_t first)
{
    return scan_form(scan, first, HS_SCAN_SUPPORTS);
}

static HS_NO_INLINE int32_t
scan_squares(hs_scan *scan, int32_t first)
{
    return scan_dimensions(scan, first, HS_SCAN_SQUARES, true);
}

static int32_t
scan_any(hs_scan *scan, int32_t first)
{
    switch (scan->form) {
    case HS_SCAN_LIMITS: return scan_limits(scan, first);
    case HS_SCAN_SUPPORTS: return scan_supports(scan, first);
    case HS_SCAN_SQUARES: return scan_squares(scan, first);
    default: return scan_direct(scan, first);
    }
}
