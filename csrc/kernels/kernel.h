/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * kernel.h: the contract of the kernels, the inner loops of a search, and the table of them.
 *
 *   gather   copies runs of points to float32, relative to a centre, as far as they are near a box
 *   scan     compares the points of a group with gathered candidates in float32 and lists those
 *            that are not surely beyond the cutoff, or counts them
 *   emit     writes listed hits as pairs, i < j, int32 or int64
 *   write    does so with all that is measured of them
 *   gather_relative   gathers candidates of a search for the nearest
 *   order    puts the squares of a few hits in order
 *   near_boxes  lists boxes within a distance of another one
 *
 * All kernels list the same candidates in the same order, except that they may differ on those
 * between the two thresholds of filter.h; every such hit is decided again by the caller, so results
 * do not depend on the kernel.
 *
 * What is compared is s = (...((y_0 - q_0)^2 + (y_1 - q_1)^2) + ...), each operation rounded once.
 * The expanded form, |y|^2 - 2 q y with fused operations, has fewer of them, but thresholds for
 * each point: lists took 1.04 to 1.23 times as long with it, counts 0.92 to 1.07 (AVX2, AVX-512).
 */
#ifndef HS_KERNEL_H
#define HS_KERNEL_H

#include "../core/base/base.h"
#include "../core/base/status.h"
#include "../core/exact/filter.h"
#include "../core/exact/ellipsoid.h"
#include "../halfshell.h"
#include "batch.h"
#include "slab.h"
#include "write.h"

#include <math.h>

/* Kernels may read this many entries past the last one of their inputs, and write as many past the
 * last one of their outputs: twice the widest vector. */
#define HS_PADDING 32

#define HS_GROUP_POINTS     64   /* points tested against one neighbourhood, at most */
#define HS_BLOCK_CANDIDATES 4096 /* candidates held at a time, at most: 80 kB in 3-D */

/* Zeros where scans read behind the last of n candidates. What is there does not count, but takes a
 * hundred times as long where it reads as subnormal numbers. */
HS_ALWAYS_INLINE void
hs_pad_lanes(float *y, int32_t n)
{
    memset(y + n, 0, HS_PADDING * sizeof(float));
}

/* Bytes from a pair to where memory is prefetched for later ones, so that their stores find it in
 * the cache; and bytes that are fetched at once. */
#define HS_PREFETCH_AHEAD 1024
#define HS_PREFETCH_LINE  64

/* As many bytes are about to be written there: prefetches those of later pairs, which may lie
 * behind the column. */
HS_ALWAYS_INLINE void
hs_prefetch_later(const void *to, size_t bytes)
{
    const uintptr_t ahead = (uintptr_t)to + HS_PREFETCH_AHEAD;
    for (size_t line = 0; line < bytes; line += HS_PREFETCH_LINE) {
        HS_PREFETCH_WRITE((void *)(ahead + line));
    }
}

/* A hit between the thresholds. */
typedef struct hs_unsure {
    int32_t t;     /* point of the group */
    int32_t place; /* candidate */
    int32_t at;    /* its entry of hits; of no meaning when counting */
} hs_unsure;

/* What a scan compares with what. */
typedef enum hs_scan_form {
    HS_SCAN_DIRECT,
    /* The thresholds of each pair are from scan->limits. */
    HS_SCAN_LIMITS,
    /* Candidates must not be surely beyond by the rule and the supports either, of which
     * s = z_0^2 + z_1^2 + ..., z_k = N_k0 (y_0 - q_0) + ..., fused or not, is compared with
     * thresholds of its own. Unsure are those that are not surely within by both. Up to
     * HS_SUPPORT_DIM axes only. */
    HS_SCAN_SUPPORTS,
    /* Lists, and writes s of each hit, fused or not. Does not look at `in`, and notes none as
     * unsure. */
    HS_SCAN_SQUARES
} hs_scan_form;

/* How the radii of a pair make its limit, for the scans that compare each pair with its own. */
typedef struct hs_limit_scan {
    hs_rule        rule;
    float          bound; /* limits are no larger; infinity: none is bounded */
    hs_limit_form  form;
    const float   *of_point; /* radii, not negative: of the group; NULL: zeros */
    const float   *of_block; /* of the candidates, n + HS_PADDING; NULL: zeros. Negative where a
                             * pair has no limit */
    const int32_t *row;      /* of of_block, for each point of the group; NULL: there is one */
    int64_t        stride;   /* from one row to the next */
} hs_limit_scan;

/* The radii of the candidates that this point meets; NULL: zeros. */
HS_ALWAYS_INLINE const float *
hs_limit_row(const hs_limit_scan *limits, int32_t t)
{
    return limits->row != NULL ? limits->of_block + limits->row[t] * limits->stride
                               : limits->of_block;
}

/* The thresholds of a pair of these radii. */
HS_ALWAYS_INLINE hs_thresholds
hs_limit_thresholds(const hs_limit_scan *limits, float of_point, float of_other)
{
    const hs_limit_form form = limits->form;
    const bool          is_max = limits->rule == HS_RULE_MAX, is_min = limits->rule == HS_RULE_MIN;
    const bool          takes_point = is_max ? of_point > of_other : of_point < of_other;
    const float         sum = of_point + of_other, one = takes_point ? of_point : of_other;
    const float         made = is_max || is_min ? one : sum;
    const float         limit = made < limits->bound ? made : limits->bound;
    const float         in = limit * form.in_factor - form.in_less;
    const float         out = limit * form.out_factor + form.out_more;
    return (hs_thresholds){in > 0.0f ? in * in : 0.0f, out > 0.0f ? out * out : 0.0f};
}

/*
 * Supports over their extent (filter.h), for the scans that compare |N (y - q)| of a point's or a
 * candidate's N, each as so many numbers (hs_support_numbers).
 */
typedef struct hs_support_scan {
    hs_rule rule; /* HS_RULE_MAX: within one of the two; HS_RULE_MIN: within both; HS_RULE_GATHER:
                   * within that of the point; HS_RULE_SCATTER: within that of the candidate */
    hs_limit_form form;
    const float  *of_point; /* all numbers of one point of the group after those of the other */
    const float  *of_block; /* of the candidates, a row for each number; n + HS_PADDING */
    int64_t       pitch;    /* from one row to the next */
} hs_support_scan;

/* The thresholds of a support of this size; NaN if the size is NaN. */
HS_ALWAYS_INLINE hs_thresholds
hs_support_thresholds(hs_limit_form form, float size)
{
    const float in = size * form.in_factor - form.in_less;
    const float out = size * form.out_factor + form.out_more;
    return (hs_thresholds){in < 0.0f ? 0.0f : in * in, out < 0.0f ? 0.0f : out * out};
}

/* Points of a group against a block of candidates; all arrays borrowed. */
typedef struct hs_scan {
    hs_scan_form    form;
    bool            counts; /* and lists none; not of HS_SCAN_SQUARES */
    int             ndim;
    const float    *y[HS_MAX_DIM]; /* candidates, n + HS_PADDING each, those past n of any value */
    const int32_t  *label;         /* what a hit is listed as; n + HS_PADDING */
    int32_t         n;             /* candidates */
    const float    *q[HS_MAX_DIM]; /* points, n_points each */
    int32_t         n_points;      /* at most HS_GROUP_POINTS */
    bool            triangular;    /* point t meets only the candidates after place t */
    hs_thresholds   direct;        /* of s */
    hs_limit_scan   limits;        /* for HS_SCAN_LIMITS only */
    hs_support_scan supports;      /* for HS_SCAN_SUPPORTS only */
    int32_t        *hits;          /* receives labels; most_hits + HS_PADDING */
    int32_t        *end;           /* receives, for each point, where its hits end; n_points */
    float          *squares;       /* receives s of each hit, of HS_SCAN_SQUARES alone; as hits */
    hs_unsure      *unsure;        /* receives hits with !(s < in); most_unsure */
    int32_t         most_hits;     /* at least n */
    int32_t         most_unsure;   /* at least n */
    int32_t         n_unsure;      /* set by the scan */
    int64_t         n_hits;        /* set by the scan: their number, unsure ones included */
} hs_scan;

/*
 * Scans points t = first, first + 1, ... and returns the point to go on with: n_points, or the
 * first for which the hits or unsure ones might not have fitted. For each point, lists
 * label[c] for every candidate c with !(s > out), ascending. hits begin at entry 0 with those
 * of point `first`; unsure ones, with !(s < in), are ascending too. NaN counts as a hit and unsure.
 * Counting leaves hits alone; end is as in listing.
 */
typedef int32_t (*hs_scan_fn)(hs_scan *scan, int32_t first);

/* Consecutive candidates that ascend in cell order, in one image. */
typedef struct hs_run {
    int32_t at;                /* place of the first in the block; it ends where the next begins */
    int32_t si;                /* in cell order, the first point that it was made of */
    int32_t image[HS_MAX_DIM]; /* shift over the rows of B */
    double  moved[HS_MAX_DIM]; /* what is added to its coordinates */
} hs_run;

/* A box that candidates must be near to. */
typedef struct hs_nearest_box {
    float low[HS_MAX_DIM], high[HS_MAX_DIM];
    float out; /* largest square of the distance; with infinity all are near */
} hs_nearest_box;

/* Where gathered candidates come from and go to; all arrays borrowed. */
typedef struct hs_gather {
    int            ndim;
    const double  *x[HS_MAX_DIM]; /* points in cell order; HS_PADDING more may be read */
    const int32_t *order;         /* their numbers; HS_PADDING more may be read */
    float         *y[HS_MAX_DIM]; /* room for all candidates and HS_PADDING more */
    int32_t       *id;            /* room for all candidates and HS_PADDING more */
    int32_t       *number;        /* in cell order; room as in id */
    hs_nearest_box near;          /* candidates that are not near it are left out */
    int32_t        n;             /* candidates so far */
    uint32_t       largest;       /* bits of the largest |y| so far; infinity and NaN are largest */
} hs_gather;

/*
 * Appends n runs, points runs[0].at to runs[n].at of all that are to be gathered: y_k = (float)(x_k
 * + moved_k), each operation rounded once, and id = order.
 * Points with s > near.out are left out, s = sum of max(low_k - y_k, y_k - high_k, 0)^2 with each
 * operation rounded once; those with NaN are not. `at` of each run becomes the place of its first
 * candidate, or of the next. Entries past the last may be overwritten.
 */
typedef void (*hs_gather_fn)(hs_gather *gather, hs_run *runs, int32_t n);

/* Candidates that are consecutive points in tree order, in one image. */
typedef struct hs_nearest_run {
    int32_t at, n; /* place of the first, and how many */
    int32_t si;    /* its number in tree order */
    int32_t image;
} hs_nearest_run;

typedef struct hs_nearest_image {
    int32_t shift[HS_MAX_DIM]; /* over the rows of B */
    double  moved[HS_MAX_DIM]; /* what it adds to X */
    bool    is_home;           /* no shift */
} hs_nearest_image;

/* Where candidates for the nearest come from and go to; all arrays borrowed. */
typedef struct hs_relative_keys {
    int                     ndim;
    const double           *x[HS_MAX_DIM]; /* points in tree order; HS_PADDING more may be read */
    const hs_nearest_image *images;
    double                  centre[HS_MAX_DIM];
    double                  unit; /* a power of two: lengths times this */
    double                  extent;
    float                  *y[HS_MAX_DIM]; /* room for all candidates and HS_PADDING more */
    int32_t                *number;        /* room for all candidates and HS_PADDING more */
} hs_relative_keys;

/* Copies n runs, each of at least one point: y_k = (float)(((x_k + moved_k) - centre_k) * unit),
 * but no further from 0 than extent, each operation rounded once; number = that in tree order.
 * Entries past the last may be overwritten. */
typedef void (*hs_gather_relative_fn)(const hs_relative_keys *keys, const hs_nearest_run *runs,
                                      int32_t n);

/* Boxes, and the one that they are near to; all arrays borrowed. */
typedef struct hs_boxes {
    int            ndim;
    const float   *low[HS_MAX_DIM];  /* n + HS_PADDING each */
    const float   *high[HS_MAX_DIM]; /* n + HS_PADDING each */
    float          from[HS_MAX_DIM], to[HS_MAX_DIM];
    float          out;   /* largest square of the distance */
    const int32_t *label; /* n + HS_PADDING */
    int32_t        n;
    int32_t       *hits; /* receives labels; n + HS_PADDING */
} hs_boxes;

/* Lists label[c] for every box c with !(s > out), ascending, and returns their number:
 * s = sum of max(low_k - to_k, from_k - high_k, 0)^2, fused or not. */
typedef int32_t (*hs_boxes_fn)(const hs_boxes *boxes);

#define HS_ORDER_MOST 64 /* squares that are put in order together, at most; a power of two */

/* Keys, ascending, of n squares >= 0 below 2^126, at most HS_ORDER_MOST: the bits of the float32,
 * but for the last ones, which are the square's number. squares: HS_PADDING more may be read. */
typedef void (*hs_order_fn)(const float *squares, int32_t n, int32_t *keys);

/* A key beyond those of all squares. */
#define HS_ORDER_LAST INT32_C(0x7f000000)

/* The hits of some points; all arrays borrowed. */
typedef struct hs_hits {
    int32_t        n;     /* points */
    const int32_t *point; /* their numbers */
    const int32_t *end;   /* where their hits end; the first one's begin at 0 */
    const int32_t *label; /* what the hits are listed as; HS_PADDING more may be read */
} hs_hits;

/* For hits that are listed as point numbers: the lower of the two numbers of each to i, the higher
 * to j, of 4 or 8 bytes each. Either may be NULL; each has room for all hits and HS_PADDING more,
 * which may be overwritten. */
typedef void (*hs_emit_fn)(const hs_hits *hits, int index_bytes, void *i, void *j);

typedef struct hs_kernel {
    const char *name;
    bool (*supported)(void); /* by this CPU, and compiled as it must be */
    hs_gather_fn          gather;
    hs_scan_fn            scan;
    hs_emit_fn            emit;
    hs_gather_relative_fn gather_relative;
    hs_order_fn           order;
    hs_boxes_fn           near_boxes;
    hs_recheck_fn         recheck;      /* slab.h */
    hs_decide_batch_fn    decide_batch; /* batch.h */
    hs_measure_fn         measure;
    hs_write_fn           write; /* write.h; or both NULL */
    hs_candidates_fn      candidates;
} hs_kernel;

/* The fields that each kernel's file fills with its own functions of these names. */
#define HS_KERNEL_LOOPS                                                                   \
    .gather = gather, .scan = scan_any, .emit = emit, .gather_relative = gather_relative, \
    .order = order, .near_boxes = near_boxes

extern const hs_kernel hs_kernel_scalar; /* plain C, any CPU; the specification of the others */
extern const hs_kernel hs_kernel_avx2;   /* x86-64 only */
extern const hs_kernel hs_kernel_avx512; /* x86-64 only */
extern const hs_kernel hs_kernel_neon;   /* AArch64 only */

/* The best kernel of this CPU, or the one of that name; NULL if it is unknown or cannot run
 * here. */
const hs_kernel *hs_kernel_select(const char *name);

#endif
