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

/* A candidate as writers take it, one line of the cache. Coordinates are in halves, with the shift
 * of the candidate added to them (hs_write_move); NaN where that cannot be. S, over the box
 * vectors, is of the candidate alone: its image less its turns. */
typedef struct hs_candidate {
    double  large[HS_WRITE_MOST_DIM];
    int32_t number, S_first;
    double  small[HS_WRITE_MOST_DIM];
    int32_t S_rest[HS_WRITE_MOST_DIM - 1];
} hs_candidate;

struct hs_hits;

/* Coordinates as two: a multiple of g = 2^(E - 26), where 2^(E - 1) <= cutoff < 2^E, and what is
 * left of them, at most g / 2. Most are multiples of 2^(E - 72), and so are all sums of their
 * halves. */
typedef struct hs_halving {
    double grid;     /* sums with it are multiples of g */
    double fine;     /* sums with it are multiples of 2^(E - 72) */
    double farthest; /* numbers up to here are split so; 2^(E + 23) */
} hs_halving;

#define HS_WRITE_MOST_TURNS 31.0 /* along all rows together, of what is added in halves */

hs_halving hs_write_halving(double cutoff);

/* What is added to the halves of a point. */
typedef struct hs_moved {
    double large[HS_WRITE_MOST_DIM], small[HS_WRITE_MOST_DIM];
    bool   is_fine; /* they are multiples of 2^(E - 72) */
} hs_moved;

/* That of shift * rows. False where it is too much: then it has a NaN. */
bool hs_write_move(const hs_metric *metric, hs_halving by, const int32_t *shift, hs_moved *moved);

/* Returns whether q has multiples of 2^(E - 72). */
HS_ALWAYS_INLINE bool
hs_candidate_set(hs_candidate *to, const double *q, hs_halving by, const hs_moved *moved,
                 int32_t number, const int32_t *S)
{
    int is_fine = 1;
    for (int k = 0; k < HS_WRITE_MOST_DIM; k++) {
        const double large = (q[k] + by.grid) - by.grid, small = q[k] - large;
        is_fine &= (small + by.fine) - by.fine == small;
        to->large[k] = large + moved->large[k];
        to->small[k] = small + moved->small[k];
    }
    to->number = number;
    to->S_first = S[0];
    to->S_rest[0] = S[1];
    to->S_rest[1] = S[2];
    return is_fine;
}

/* Candidates of space in one image. */
typedef struct hs_candidate_run {
    const double  *x[3];     /* of all points */
    const int32_t *turns[3]; /* of all points, for each box vector; NULL: zeros */
    const int32_t *place;    /* of the candidates among these, ascending */
    const int32_t *number;   /* of the candidates */
    int32_t        image[3], n;
    hs_halving     by;
    hs_moved       moved;
} hs_candidate_run;

/* hs_candidate_set for those from `first` on, S being image - turns. Returns whether they are
 * fine. */
HS_ALWAYS_INLINE bool
hs_candidates_from(const hs_candidate_run *run, const int ndim, int32_t first, hs_candidate *to)
{
    bool are_fine = true;
    for (int32_t c = first; c < run->n; c++) {
        const int32_t place = run->place[c];
        double        q[HS_WRITE_MOST_DIM];
        int32_t       S[HS_WRITE_MOST_DIM];
        for (int k = 0; k < HS_WRITE_MOST_DIM; k++) {
            q[k] = k < ndim ? run->x[k][place] : 0.0;
            S[k] = k < ndim ? run->image[k] : 0;
            S[k] -= k < ndim && run->turns[k] != NULL ? run->turns[k][place] : 0;
        }
        are_fine &= hs_candidate_set(&to[c], q, run->by, &run->moved, run->number[c], S);
    }
    return are_fine;
}

/* The same for all of them, in three dimensions. */
typedef bool (*hs_candidates_fn)(const hs_candidate_run *run, hs_candidate *to);

/*
 * What the hits of some points are, and where they go. All arrays are borrowed. Those of candidates
 * have an entry, or a record, for each place of the block, those of points one for each point of
 * the hits, those of all points one for each point in cell order.
 *
 * S = image - turns of the candidate + turns of the point, over the rows of the metric. D = q - p +
 * shift * rows; there the shift is S, or the image alone.
 */
typedef struct hs_write {
    int  ndim;
    bool is_half;     /* each pair once, the lower number first: others change sign; else the point
                       * is i, whatever the candidate's number is */
    bool is_measured; /* d or D is wanted */
    bool is_shifted;  /* some shift may not be zero; if measured needs metric->floats_usable */
    bool by_S;        /* the metric's shift is S */
    bool is_fine;     /* halves of all candidates are multiples of 2^(E - 72) */
    const hs_metric    *metric;
    const hs_candidate *candidates; /* moved by the image, or where by_S by their S and base */
    int32_t             base[HS_WRITE_MOST_DIM]; /* points are moved by this less their turns */
    const int32_t      *place; /* of candidates, in cell order; NULL: as they are in the block */
    const double       *x[HS_WRITE_MOST_DIM]; /* of all points, before they are moved; each ... */
    int64_t             x_width;              /* ... so many numbers behind the one before */
    const int32_t      *turned[HS_WRITE_MOST_DIM]; /* of all points, in each row; NULL: zeros */
    const double       *p[HS_WRITE_MOST_DIM];      /* of points */
    const int32_t      *turns[HS_WRITE_MOST_DIM];  /* of points, in each row; NULL: zeros */
    int                 column[HS_WRITE_MOST_DIM]; /* of S that each row is; they ascend */
    double              first, second;   /* to the caller's unit: times one, then the other;
                                                 * powers of two */
    double              cutoff, largest; /* d is largest unless it is below cutoff */
    int                 index_bytes;     /* 4 or 8 */
    /* Room for all hits and HS_PADDING more, which may be overwritten; NULL: not wanted. */
    void    *i, *j;
    double  *distance;
    double  *vector; /* ndim numbers a pair */
    int32_t *shift;  /* ndim numbers a pair, zero for open box vectors */
} hs_write;

/* Number of the candidate at a place among all points. */
HS_ALWAYS_INLINE int64_t
hs_write_number(const hs_write *write, int32_t place)
{
    return write->place != NULL ? write->place[place] : place;
}

/* Coordinate k of it, before it is moved. */
HS_ALWAYS_INLINE double
hs_write_coordinate(const hs_write *write, int32_t place, int k)
{
    return write->x[k][hs_write_number(write, place) * write->x_width];
}

/* S of it and of point t, along row r. */
HS_ALWAYS_INLINE int64_t
hs_write_S(const hs_write *write, int32_t t, int32_t place, int r)
{
    const hs_candidate *of = &write->candidates[place];
    const int           k = write->column[r];
    const int64_t       S = k == 0 ? of->S_first : of->S_rest[k - 1];
    return S + (write->turns[r] != NULL ? write->turns[r][t] : 0);
}

/* The metric's shift of the two, along row r. */
HS_ALWAYS_INLINE int64_t
hs_write_shift(const hs_write *write, int32_t t, int32_t place, int r)
{
    const int64_t S = hs_write_S(write, t, place, r);
    if (write->by_S) {
        return S;
    }
    const int64_t turned =
        write->turned[r] != NULL ? write->turned[r][hs_write_number(write, place)] : 0;
    return S + turned - (write->turns[r] != NULL ? write->turns[r][t] : 0);
}

/* False: declined. */
typedef bool (*hs_write_fn)(const hs_write *write, const struct hs_hits *hits);

/* Hit h: d and D by hs_metric_measure, where they are wanted. In write_measured.c. */
void hs_write_measured(const hs_write *write, const struct hs_hits *hits, int32_t h);

/* candidates_avx2.c: x86-64 only. */
bool hs_candidates_avx2(const hs_candidate_run *run, hs_candidate *to);

/* wide_avx2.c, wide_avx512.c: x86-64 only. */
bool hs_write_avx2(const hs_write *write, const struct hs_hits *hits);
bool hs_write_avx512(const hs_write *write, const struct hs_hits *hits);

#endif
