/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_COLLECT_RECORD_H
#define HS_COLLECT_RECORD_H

#include "columns.h"
#include "../search/scan.h"

/*
 * record.h: turns hits into pairs of the half list: i < j, or for a point and its own image the
 * first nonzero component of S positive, with D, d and S of that orientation.
 */

/* Where a walker's hits go, and room to prepare them in: arrays, NULL when not needed. */
typedef struct hs_recorder {
    void      *memory;             /* owned: of all arrays */
    hs_output *output;             /* borrowed; not fixed */
    unsigned   columns;            /* HS_WANT_ bits of the output */
    int32_t    most_hits;          /* of a visit */
    int32_t   *ids;                /* point numbers of hits that are places */
    int32_t   *ends[2];            /* i and j for HS_WANT_BOTH */
    double    *distance;           /* of a batch */
    double    *vector[HS_MAX_DIM]; /* of a batch */
    double    *all_distances;      /* of the hits of one visit, where shells need them alone */
} hs_recorder;

/* Columns that need the distance. */
#define HS_MEASURED (HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHELL)

/* Where the distances of the next hits are written: the column, or memory of the recorder's own;
 * NULL where they are not needed. */
HS_ALWAYS_INLINE double *
hs_recorder_distances(const hs_recorder *recorder)
{
    double *column = hs_output_next(recorder->output, HS_WANT_DISTANCE);
    return column != NULL ? column : recorder->all_distances;
}

/* What a walker's block must list for these columns. */
hs_block_use hs_record_use(unsigned columns);

/* For a walker that lists at most most_hits hits at a time. */
hs_status hs_recorder_init(hs_account *account, hs_output *output, int32_t most_hits,
                           hs_recorder *recorder);
void      hs_recorder_free(hs_account *account, hs_recorder *recorder);

/* A hs_visit_fn: the hits as the next pairs of the output. HS_ERR_SHIFT_RANGE sets
 * scanner->failed_point. */
hs_status hs_record_hits(void *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits);

/* A pair that is beyond `low` edges, at most `high`, of the shells or of a histogram. */
typedef struct hs_edge_pair {
    int32_t hit;       /* for the caller */
    int32_t si, place; /* of the asking point and of the candidate */
    int32_t low, high;
} hs_edge_pair;

#define HS_EDGE_PAIRS 1024 /* that are decided together, at most */

typedef struct hs_edge_pairs {
    int32_t      n;
    hs_edge_pair pair[HS_EDGE_PAIRS];
} hs_edge_pairs;

/* Decides exactly which edges the pairs are beyond: low and high agree afterwards. Edges are those
 * of the search's shells, and the cutoff. HS_ERR_SHIFT_RANGE sets scanner->failed_point;
 * HS_ERR_INTERRUPTED. */
hs_status hs_decide_edges(hs_scanner *scanner, hs_edge_pairs *open);

/*
 * d and D of a batch of pairs, with the same bits wherever pairs come from: a walk, the
 * nearest points, a list that is decided anew. The batch kernels measure nearly all pairs, the
 * functions of metric.h what these leave.
 */

enum { HS_IN_BATCH = HS_BATCH + HS_BATCH_PADDING };

/* A batch of pairs with room of its own, for callers that have no hs_pair_batch. */
typedef struct hs_measured {
    int32_t n;
    bool    is_shifted; /* some shift is not zero; or `times` and `shift` are not looked at */
    bool    is_wide;    /* some shift is too large for the batch kernels */
    double  p[HS_MAX_DIM][HS_IN_BATCH], q[HS_MAX_DIM][HS_IN_BATCH]; /* measured between these */
    double  times[HS_MAX_DIM][HS_IN_BATCH];                         /* the metric's shifts */
    int64_t shift[HS_MAX_DIM][HS_IN_BATCH];                         /* these numbers as integers */
    double  distance[HS_IN_BATCH], vector[HS_MAX_DIM][HS_IN_BATCH];
} hs_measured;

/* Sets the shift of pair e along row r. */
HS_ALWAYS_INLINE void
hs_measured_shift(hs_measured *pairs, int32_t e, int r, int64_t shift)
{
    const int64_t widest = INT64_C(1) << 53; /* what the batch kernels take */
    pairs->times[r][e] = (double)shift;
    pairs->shift[r][e] = shift;
    pairs->is_shifted = pairs->is_shifted || shift != 0;
    pairs->is_wide = pairs->is_wide || shift > widest || shift < -widest;
}

/* Sets distance and, if `vectors`, vector, in the unit of the metric. */
void hs_measured_find(const hs_kernel *kernel, const hs_metric *metric, bool vectors,
                      hs_measured *pairs);

/* Sets within[e], HS_IN_BATCH of them, to whether pair e is within the cutoff of the metric. */
void hs_measured_decide(const hs_kernel *kernel, const hs_metric *metric, hs_measured *pairs,
                        uint8_t *within, hs_stages *stages);

/* From the unit of the scene's metric to the caller's. */
hs_scale hs_measures_unscale(const hs_scene *scene);

/* What a writer is told of the caller's unit, and of the limit that distances of an exact search do
 * not pass. */
void hs_measures_tell(const hs_scene *scene, const hs_options *options, hs_write *write);

/* Each of n distances in the caller's unit, none beyond the cutoff: hs_keep_within. */
void hs_restore_distances(double *distance, int32_t n, hs_scale unscale);
void hs_keep_all_within(double *distance, int32_t n, double cutoff, bool inclusive);

/* Writes n vectors, one behind another: in the caller's unit, times sign[e], which is 1 or -1. */
void hs_restore_vectors(double *HS_RESTRICT to, double *const *vector, const double *sign,
                        int32_t n, int ndim, hs_scale unscale);

#endif
