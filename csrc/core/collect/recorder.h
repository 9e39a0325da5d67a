/* SPDX-License-Identifier: BSD-3-Clause */
/* recorder.h: where the hits of one scanner go, and what they are prepared in. */
#ifndef HS_RECORDER_H
#define HS_RECORDER_H

#include "columns.h"
#include "../search/scanner.h"

/* Where a walker's hits go, and room to prepare them in: owned arrays, NULL when not needed. */
typedef struct hs_recorder {
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

#endif
