/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_SEARCH_LIMITS_H
#define HS_SEARCH_LIMITS_H

#include "../exact/metric.h"
#include "scan.h"
#include "../exact/ellipsoid.h"

/*
 * limits.h: pairs that are compared with a length of their own, the sum of two radii for example,
 * and not with the cutoff of the search, which is the largest of these lengths. Scans compare
 * float32 squares with thresholds for each pair; what they cannot tell is decided for the real
 * numbers. A search without limits pays for none of it.
 */

/* The radii of a set in the order of its cells; borrowed. */
typedef struct hs_radii {
    const double *exact; /* in the unit of the scene's metric; NULL where the rule needs none */
    const float  *near;  /* times the factor, in the unit that is scanned in, rounded; HS_PADDING
                          * more can be read */
    float         most;  /* the largest of these */
} hs_radii;

/* Most types of a table whose limits are laid out for the candidates of each block. */
#define HS_TABLE_TYPES 8

/* Limits by the types of both points, in place of radii; borrowed. */
typedef struct hs_limit_table {
    int32_t        n_types;
    const int32_t *of_asking, *of_points; /* types, in the order of the cells */
    const double  *exact; /* n_types * n_types; -1: no pairs. In the unit of the scene's metric */
    const float   *near;  /* as many, in the unit that is scanned in; NULL: there is no table */
} hs_limit_table;

typedef struct hs_limits {
    hs_rule        rule;
    double         factor;     /* radii count so many times */
    double         bound;      /* no pair is further apart than this; infinity: there is no bound */
    float          near_bound; /* in the unit that is scanned in */
    hs_radii       of_asking, of_points;
    hs_limit_table table;
    const struct hs_supports *supports; /* borrowed, in place of all this; or NULL */
} hs_limits;

/* Numbers that scans need of each candidate, for a search that has limits. */
int32_t hs_limits_rows(const hs_search *search);

/* The radii or supports of the present group and block, or what a table has in their place, for a
 * scan. */
void hs_limits_set(const hs_scanner *scanner, hs_scan *scan);

/* Whether each pair of the scanner's batch is within what it is compared with. within: HS_BATCH of
 * them. */
void hs_limits_decide(hs_scanner *scanner, uint8_t *within);

/* The length that a pair is compared with, for the radii of the asking point and of the other one:
 * exactly, hi being the nearest float64. With HS_RULE_MEAN radii are halved already; rules of sums
 * have the factor 1. Levels see to it that the product with another one neither over- nor
 * underflows. */
HS_ALWAYS_INLINE hs_dw
hs_limit_by(hs_rule rule, double factor, double asking, double other, double bound)
{
    hs_dw limit = {0.0, 0.0};
    switch (rule) {
    case HS_RULE_MAX: limit.hi = hs_larger(asking, other); break;
    case HS_RULE_MIN: limit.hi = hs_smaller(asking, other); break;
    case HS_RULE_GATHER: limit.hi = asking; break;
    case HS_RULE_SCATTER: limit.hi = other; break;
    default: limit = hs_two_sum(asking, other);
    }
    if (factor != 1.0) {
        limit = hs_two_product(factor, limit.hi);
    }
    return limit.hi > bound || (limit.hi == bound && limit.lo > 0.0) ? (hs_dw){bound, 0.0} : limit;
}

/* That of asking point si and point sj, in cell order; negative where they are no pair. */
HS_ALWAYS_INLINE hs_dw
hs_limit_of(const hs_limits *limits, int32_t si, int32_t sj)
{
    const double *asking = limits->of_asking.exact, *points = limits->of_points.exact;
    if (limits->table.near != NULL) {
        const hs_limit_table *table = &limits->table;
        const int32_t         row = table->of_asking[si], column = table->of_points[sj];
        return (hs_dw){hs_smaller(table->exact[row * table->n_types + column], limits->bound), 0.0};
    }
    return hs_limit_by(limits->rule, limits->factor, asking != NULL ? asking[si] : 0.0,
                       points != NULL ? points[sj] : 0.0, limits->bound);
}

/*
 * Pairs that are decided by the supports of their points (ellipsoid.h), and not by a length. The
 * search is one for the longest distance that supports reach, and scans compare in float32 with a
 * bound for each pair; hits that these cannot tell are decided for the real numbers.
 */

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

#endif
