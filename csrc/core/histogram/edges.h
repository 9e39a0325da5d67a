/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * edges.h: from float32 squares to bins. Around each edge there is a band of squares that cannot
 * tell on which side of it a pair is (filter.h); between two bands the bin is sure. A table,
 * indexed by the leading bits of the square, knows for each of its cells which bands reach into it.
 *
 * A slot is 2 k for "k edges are reached, surely", and odd for pairs that must be decided exactly.
 */
#ifndef HS_EDGES_H
#define HS_EDGES_H

#include "../scene/scene.h"

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

/* Edges of the histogram in the unit of the scene. */
hs_status hs_edges_init(hs_account *account, const hs_scene *scene, double filter_error,
                        const hs_histogram *histogram, hs_edges *edges);
void      hs_edges_free(hs_account *account, hs_edges *edges);

/* Whether a pair at exactly edge k is below it. */
HS_ALWAYS_INLINE bool
hs_edge_is_inclusive(const hs_edges *edges, int64_t k)
{
    return k == edges->n - 1 ? edges->last_inclusive : edges->inclusive;
}

/* Replaces the table by one for this extent (the sum of the largest |y_k| and |q_k|). Called by
 * threads as they go, so its memory, at most 8 bytes an edge and a megabyte, is on no account. */
hs_status hs_edge_table_build(const hs_edges *edges, double extent, hs_edge_table *table);
void      hs_edge_table_free(hs_edge_table *table);

/* The slots of n squares, all of them from neighbourhoods up to the table's extent and !(s > out)
 * for the last edge there. Returns whether any is odd. */
bool hs_edge_slots(const hs_edge_table *table, const float *squares, int32_t n, int32_t *slots);

/* For a square whose slot is odd: at least *low edges are reached, and at most *high. */
void hs_edge_range(const hs_edge_table *table, const hs_edges *edges, float square, int32_t *low,
                   int32_t *high);

#endif
