/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_HISTOGRAM_HISTOGRAM_H
#define HS_HISTOGRAM_HISTOGRAM_H

#include "../scene/scene.h"
#include "../exact/arithmetic.h"
#include "../memory/memory.h"
#include "../search/scan.h"

/*
 * histogram.h: pairs counted by distance: edges decided exactly, weights summed without rounding.
 */

/*
 * From float32 squares to bins. Around each edge there is a band of squares that cannot tell on
 * which side of it a pair is (filter.h); between two bands the bin is sure. A table, indexed by the
 * leading bits of the square, knows for each of its cells which bands reach into it.
 *
 * A slot is 2 k for "k edges are reached, surely", and odd for pairs that must be decided exactly.
 */

/* The edges of a histogram; shared by all threads. */
typedef struct hs_edges {
    int64_t n;
    bool    inclusive, last_inclusive; /* edges, the last edge, belong to the bin below */
    double *at;                        /* owned; as the scene's metric takes them; n */
    double *lower;                     /* at most, ... */
    double *upper; /* ... and at least the scaled edge; in the memory of `lower`, or `at` itself */
    int     ndim;
    double  filter_error; /* of the search: bound on each component before rounding to float32 */
} hs_edges;

/* Squares of one cell of the table: with s < in `slot`, with s > out two more, else one more. in
 * and out are the bits of floats, which order like these. */
typedef struct hs_edge_cell {
    int32_t in, out;
    int32_t slot;
    int32_t n_bands; /* that reach into it; of several, in and out leave all to be looked at */
} hs_edge_cell;

/* The table for neighbourhoods up to some extent; belongs to one thread. */
typedef struct hs_edge_table {
    double        extent; /* 0 when there is no table yet */
    float        *in;     /* owned, n: the band of each edge; ascending */
    float        *out;    /* in the memory of `in` */
    hs_edge_cell *cells;  /* owned; NULL where squares may overflow: then nothing is sure */
    int           shift;  /* bits of a square that do not choose the cell */
    int32_t       first;  /* leading bits of the squares of cell 0 */
    int32_t       last;   /* number of the last cell */
} hs_edge_table;

/* Whether a pair at exactly edge k is below it. */
HS_ALWAYS_INLINE bool
hs_edge_is_inclusive(const hs_edges *edges, int64_t k)
{
    return k == edges->n - 1 ? edges->last_inclusive : edges->inclusive;
}

/* Replaces the table by one for this extent (the sum of the largest |y_k| and |q_k|). Called by
 * threads as they go, so no account is charged for its memory: at most 8 bytes an edge, and a
 * megabyte. */
hs_status hs_edge_table_build(const hs_edges *edges, double extent, hs_edge_table *table);
void      hs_edge_table_free(hs_edge_table *table);

/* The slots of n squares, all of them from neighbourhoods up to the table's extent and !(s > out)
 * for the last edge there. Returns whether any is odd. */
bool hs_edge_slots(const hs_edge_table *table, const float *squares, int32_t n, int32_t *slots);

/* For a square whose slot is odd: at least *low edges are reached, and at most *high. */
void hs_edge_range(const hs_edge_table *table, const hs_edges *edges, float square, int32_t *low,
                   int32_t *high);

/*
 * Exact sums of products of two floats, rounded once at the end, so that neither the order of the
 * terms nor the threads that add them can change a bit.
 *
 * A weight is an integer times a power of two. Each sum is a long integer in steps of 32 bits, kept
 * in limbs of 64: what is carried stays where it arose until 2^30 products have been added.
 */

/* The weights of a set of points: value[i] * 2^(place[i] + exponent). */
typedef struct hs_weights {
    int64_t *value; /* owned, n; below 2^62 in size. NULL: all weights are 1 */
    int32_t *place; /* owned, n; from 0 on. NULL: all 0 */
    int      exponent;
    int      bits;       /* at least the number of bits of every value, ... */
    int      most_place; /* ... and the largest place */
} hs_weights;

/* Weight order[i] of the caller, finite or HS_ERR_WEIGHTS, becomes number i. NULL: all are 1. */
hs_status hs_weights_init(hs_account *account, const double *weights, const int32_t *order,
                          int64_t n, hs_weights *taken, hs_failure *failure);
void      hs_weights_free(hs_account *account, hs_weights *weights);

/* n sums; owned by one thread. */
typedef struct hs_sums {
    int64_t  n;
    int32_t  n_limbs;
    int      exponent; /* of their lowest bit */
    int64_t *limbs;    /* owned; n_limbs of each, lowest first */
    int64_t  n_added;  /* products added since carries were last passed on */
} hs_sums;

/* Zeros, for products of these two. */
hs_status hs_sums_init(hs_account *account, int64_t n, const hs_weights *a, const hs_weights *b,
                       hs_sums *sums);
void      hs_sums_free(hs_account *account, hs_sums *sums);

/* Adds *more, of the same form, to *sums. */
void hs_sums_join(hs_sums *sums, hs_sums *more);

/* Sum k, rounded to nearest, ties to even; infinite beyond the range of float64. Call hs_sums_carry
 * first. */
double hs_sums_round(const hs_sums *sums, int64_t k);

/* Passes on what was carried in every sum. */
void hs_sums_carry(hs_sums *sums);

#define HS_SUMS_MOST_ADDED (INT64_C(1) << 30)

/* Call before n products are added: passes on carries in time. */
HS_ALWAYS_INLINE void
hs_sums_expect(hs_sums *sums, int64_t n)
{
    if (HS_UNLIKELY(sums->n_added + n > HS_SUMS_MOST_ADDED)) {
        hs_sums_carry(sums);
    }
    sums->n_added += n;
}

/* Adds a * b * 2^place to a sum, given by its limbs; below 2^62 in size each. */
HS_ALWAYS_INLINE void
hs_sums_add(int64_t *limbs, int64_t a, int64_t b, const int32_t place)
{
    const int64_t  sign = (a ^ b) >> 63; /* 0 or -1 */
    const uint64_t size_a = a < 0 ? 0 - (uint64_t)a : (uint64_t)a;
    const uint64_t size_b = b < 0 ? 0 - (uint64_t)b : (uint64_t)b;
    const int      shift = place & 31;
    uint64_t       high = 0;
    const uint64_t low = hs_multiply_add(size_a, size_b, 0, &high);
    const uint64_t lowest = low << shift, middle = high << shift | (low >> 1) >> (63 - shift);
    const uint64_t highest = (high >> 1) >> (63 - shift);
    limbs += place >> 5;
    limbs[0] += ((int64_t)(lowest & UINT32_MAX) ^ sign) - sign;
    limbs[1] += ((int64_t)(lowest >> 32) ^ sign) - sign;
    limbs[2] += ((int64_t)(middle & UINT32_MAX) ^ sign) - sign;
    limbs[3] += ((int64_t)(middle >> 32) ^ sign) - sign;
    if (place > 0) {
        limbs[4] += ((int64_t)highest ^ sign) - sign;
    }
}

/*
 * Counts the pairs of an open search, by all threads of its call, and adds their number to
 * *n_pairs. sets: what is known of the points. HS_ERR_MEMORY, HS_ERR_TYPES or HS_ERR_WEIGHTS, or
 * any status of a walk.
 */
hs_status hs_histogram_fill(hs_search *search, const hs_histogram *histogram, const hs_sets *sets,
                            int64_t *n_pairs, hs_failure *failure);

#endif
