/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * write.h: the contract of the writers, which turn hits into pairs with what else is wanted of
 * them, i, j, d, D and S, in one pass over the hits.
 *
 * A writer gives the bits of hs_metric_measure (core/exact/metric.h), of hs_keep_within and of
 * hs_scale_apply, or it declines: where points are too far from the origin, the caller's unit is no
 * float64, or many pairs are beyond metric->cutoff or nearer than 2^-16 of it, which a writer must
 * measure one by one. It then has written numbers that do not count, and the caller takes the pairs
 * another way. Must be called with round to nearest and without flushing.
 */
#ifndef HS_WRITE_H
#define HS_WRITE_H

#include "../core/base/base.h"
#include "../core/exact/metric.h"

#define HS_WRITE_MOST_DIM 3 /* and at least 2 */

/* Entries of a record: of what is known of a candidate, one behind another. */
#define HS_RECORD 4

struct hs_hits;

/*
 * What the hits of some points are, and where they go. All arrays are borrowed. Those of candidates
 * have a record for each place of the block, those of points one entry for each point of the hits.
 *
 * S = image - turns of the candidate + turns of the point, over the rows of the metric. D = q - p +
 * shift * rows; there the shift is S, or the image alone.
 */
typedef struct hs_write {
    int  ndim;
    bool is_half;    /* each pair once, the lower number first: others change sign; else the point
                      * is i, whatever the candidate's number is */
    bool is_shifted; /* some shift may not be zero; with q needs metric->floats_usable */
    bool by_S;       /* the metric's shift is S */
    const hs_metric *metric;
    const double    *q;      /* of candidates: coordinates; last, the bits of an int64, the number;
                             * NULL: no d and no D are wanted */
    const int32_t   *number; /* of candidates, one each: needed where q is NULL */
    const int32_t   *image;  /* of candidates, in each row; NULL: zeros */
    const int32_t   *few;    /* of candidates: image less turns; NULL: no turns */
    const double    *p[HS_WRITE_MOST_DIM];      /* of points */
    const int32_t   *turns[HS_WRITE_MOST_DIM];  /* of points, in each row; NULL: zeros */
    int              column[HS_WRITE_MOST_DIM]; /* of S that each row is */
    double           first, second;             /* to the caller's unit: times one, then the other;
                                                 * powers of two */
    double           cutoff, largest;           /* d is largest unless it is below cutoff */
    int              index_bytes;               /* 4 or 8 */
    /* Room for all hits and HS_PADDING more, which may be overwritten; NULL: not wanted. */
    void    *i, *j;
    double  *distance;
    double  *vector; /* ndim numbers a pair */
    int32_t *shift;  /* ndim numbers a pair, zero for open box vectors */
} hs_write;

/* False: declined. */
typedef bool (*hs_write_fn)(const hs_write *write, const struct hs_hits *hits);

/* Records of n points of space: x[0 ... 2] and the number. */
typedef void (*hs_point_records_fn)(const double *const *x, const int32_t *order, int32_t n,
                                    double *to);

/* Records of n points of one image in a box of three box vectors: image less turns. */
typedef void (*hs_shift_records_fn)(const int32_t *image, const int32_t *const *turns, int32_t n,
                                    int32_t *to);

/* Hit h: d and D by hs_metric_measure, where they are wanted. In write_measured.c. */
void hs_write_measured(const hs_write *write, const struct hs_hits *hits, int32_t h);

/* records_avx2.c: x86-64 only. */
void hs_point_records_avx2(const double *const *x, const int32_t *order, int32_t n, double *to);
void hs_shift_records_avx2(const int32_t *image, const int32_t *const *turns, int32_t n,
                           int32_t *to);

/* write_avx2.c, write_avx512.c: x86-64 only. */
bool hs_write_avx2(const hs_write *write, const struct hs_hits *hits);
bool hs_write_avx512(const hs_write *write, const struct hs_hits *hits);

#endif
