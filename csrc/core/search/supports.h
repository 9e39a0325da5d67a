/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * supports.h: pairs that are decided by the supports of their points (support.h), and not by a
 * length. The search is one for the longest distance that supports reach, and scans compare in
 * float32 with a bound for each pair; hits that these cannot tell are decided for the real numbers.
 */
#ifndef HS_SUPPORTS_H
#define HS_SUPPORTS_H

#include "../exact/metric_support.h"

#include "scanner.h"

/* The supports of a set; borrowed. */
typedef struct hs_support_side {
    const double  *numbers; /* of all points, in the caller's order (hs_support_numbers); NULL where
                             * the rule needs none */
    int64_t        first;   /* the caller's number of the first of them */
    const int32_t *order;   /* the caller's numbers, in the order of the cells */
    const float   *near;    /* over the extent, for the unit that is scanned in: as kernels read
                             * them, in the order of the cells */
} hs_support_side;

typedef struct hs_supports {
    hs_rule           rule;
    bool              is_bounded; /* pairs must be within the cutoff as well, and may not be */
    hs_support_metric metric;
    hs_support_side   of_asking, of_points;
} hs_supports;

/* The numbers that kernels read of the supports first ... end - 1 of a side, in the order of the
 * cells; its own `near` is not looked at. near: end * hs_support_numbers(ndim). */
void hs_supports_lay_out(const hs_support_side *side, int64_t first, int64_t end, int ndim,
                         double extent, double unscale, float *near);

/* The supports of the group and the block, for a scan. */
void hs_supports_set(const hs_scanner *scanner, hs_scan *scan);

/* Whether each pair of scanner->trace is within the supports, by the rule, however far apart it is;
 * not for an extent of 0. within: HS_BATCH of them. */
void hs_supports_decide(hs_scanner *scanner, uint8_t *within);

#endif
