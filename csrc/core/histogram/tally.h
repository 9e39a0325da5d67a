/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * tally.h: what one thread counts for a histogram. Hits come with their float32 squares; a table
 * (edges.h) says which slot each belongs to, and those that it cannot tell are decided exactly,
 * edge by edge.
 */
#ifndef HS_TALLY_H
#define HS_TALLY_H

#include "edges.h"
#include "weights.h"
#include "../search/scanner.h"

/* What all threads count by; only read. */
typedef struct hs_tally_plan {
    hs_account      *account;         /* borrowed */
    hs_edges         edges;           /* owned */
    hs_marked        points;          /* owned */
    hs_marked        queries;         /* owned */
    const hs_marked *asking;          /* one of these two */
    bool             has_types, sums; /* whether types matter; whether weights are summed */
    int32_t          n_types;
    int64_t          n_groups; /* pairs of types that are told apart */
    int32_t         *group;    /* owned; n_types * n_types; when has_types */
} hs_tally_plan;

/* In tally_plan.c. The plan is zero before. hs_tally_plan_close must follow, also on failure: of
 * HS_ERR_MEMORY, HS_ERR_EDGES, HS_ERR_TYPES and HS_ERR_WEIGHTS. */
hs_status hs_tally_plan_open(hs_search *search, const hs_histogram *histogram, hs_tally_plan *plan,
                             hs_failure *failure);
void      hs_tally_plan_close(hs_tally_plan *plan);

#define HS_TALLY_TABLES 4 /* extents that a walk may meet again; each a power of two */
#define HS_TALLY_COPIES 4 /* of small histograms: counting does not wait for the last count */

/* A pair that is decided edge by edge: it reaches at least `low` edges and at most `high`. */
typedef struct hs_tally_open {
    int32_t si, place;
    int32_t low, high;
    int32_t next; /* of those that wait for the same edge, or -1 */
} hs_tally_open;

#define HS_TALLY_OPEN 1024 /* pairs that are decided together, at most */

typedef struct hs_tally {
    const hs_tally_plan *plan;                    /* borrowed */
    hs_edge_table        tables[HS_TALLY_TABLES]; /* owned; place: exponent of the extent */
    int64_t              n_slots;                 /* of one group */
    int                  n_copies;
    int64_t             *counts; /* owned; n_copies * n_groups * n_slots */
    hs_sums              sums;   /* owned; n_groups * (edges + 1) */
    int32_t             *slots;  /* owned; of the hits of a visit */
    int32_t             *type;   /* owned; of each candidate of the block; or NULL */
    int64_t             *value;  /* owned; of each candidate: its weight; or NULL */
    int32_t             *place;  /* owned; of each candidate: the place of its weight; or NULL */
    int64_t              block;  /* number of the block that these are of */
    hs_tally_open       *open;   /* owned; HS_TALLY_OPEN */
    int32_t              n_open;
    int32_t             *waiting; /* owned; for each edge the first open pair, or -1 */
    int32_t             *asked;   /* owned; edges that pairs wait for, HS_TALLY_OPEN */
    int32_t              n_asked;
} hs_tally;

/* block: of the walker that will visit. */
hs_status hs_tally_init(const hs_tally_plan *plan, int32_t block_capacity, int32_t most_hits,
                        hs_tally *tally);
void      hs_tally_free(hs_tally *tally);

/* A hs_visit_fn for HS_BLOCK_LISTS_SQUARES; context: hs_tally. */
hs_status hs_tally_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits);

/* How many pairs of a group reach exactly so many edges. */
int64_t hs_tally_count(const hs_tally *tally, int64_t group, int64_t n_reached);

#endif
