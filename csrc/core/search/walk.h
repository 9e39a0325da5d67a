/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * walk.h: the walk over groups of points. Rows of cells in order, cells along each row, at most
 * HS_GROUP_POINTS points at a time; each group's neighbourhood is gathered, scanned for every
 * point of the group, decided, and the hits are handed to a visitor. Groups depend on the scene
 * and on whether neighbourhoods are put in order, never on who walks them.
 */
#ifndef HS_WALK_H
#define HS_WALK_H

#include "neighbourhood.h"
#include "neighbourhood_sort.h"
#include "cell_rows.h"
#include "pair_batch.h"

typedef struct hs_walker hs_walker;

/*
 * The decided hits of points [first, first + hits->n) in cell order against the present block, as
 * entries of walker->block: point numbers, or places when walker->use says so; with HS_BLOCK_COUNTS
 * only where they would end. With HS_BLOCK_LISTS_SQUARES they are not decided, and
 * walker->block.squares are theirs. Anything but HS_OK ends the walk with that status.
 */
typedef hs_status (*hs_visit_fn)(void *context, hs_walker *walker, int32_t first,
                                 const hs_hits *hits);

/* Where a walk was left and can be taken up: the group that begins at this point, or the first one
 * behind it, when so many blocks of its candidates have been scanned. */
typedef struct hs_bookmark {
    int64_t point;
    int32_t blocks;
} hs_bookmark;

/* How large the neighbourhood of a group is. */
typedef struct hs_neighbourhood {
    int64_t candidates, runs;
} hs_neighbourhood;

/* One at a time belongs to a thread. */
struct hs_walker {
    const hs_search *search;  /* borrowed, read only */
    hs_options       options; /* the search's, with a poll only for the caller's own thread */
    hs_block         block;
    hs_block_use     use;
    bool             is_ordered; /* as hs_walker_init_ordered says */
    hs_order         order;
    hs_group         group;
    hs_trace         trace;
    int32_t          target;     /* of groups, for hs_row_next */
    hs_row           row;        /* being walked: */
    int64_t          row_number; /* its number, or -1 */
    int32_t          last_first; /* first point of the last group that was taken, or -1 */
    bool             has_next;
    hs_row_group     next;
    hs_link         *links;   /* owned; of the row being walked */
    int64_t          n_links;
    int64_t         *hints;   /* owned; for hs_row_links, NULL unless the grid is sparse */
    hs_visit_fn      visit;   /* not called when counting */
    void            *visit_context;
    hs_scan_fn       scan;     /* these for groups of this extent: */
    hs_thresholds    direct;
    hs_expanded      expanded;
    double           extent;
    int64_t          n_subnormal; /* blocks in which subnormal numbers were met */
    bool             flushes;  /* too many: gathering and scanning, nothing else, go on without */
    bool             block_is_first; /* of its group: candidate t is group point t; half lists */
    hs_neighbourhood of_group, most; /* of the present group, of any so far */
    int64_t          n_found;
    bool             leaves;         /* set by a visitor: HS_STATUS_END once the block is done */
    int32_t          blocks;         /* of the present group, scanned or skipped so far */
    int32_t          blocks_to_skip; /* of the next group; they were scanned before */
    int64_t          candidate_limit; /* the walk ends with HS_STATUS_END when it has tested more */
    int64_t          failed_point;    /* whose shift passed its range, for HS_ERR_SHIFT_RANGE */
    hs_stages        stages;
    int64_t          n_groups, n_blocks, n_candidates, n_ambiguous;
    int64_t          work_since_poll;
};

/* Hits of one visit at most, of walkers that hs_walker_init has opened. */
#define HS_MOST_HITS (HS_HITS_PER_CANDIDATE * (HS_BLOCK_CANDIDATES + HS_GROUP_POINTS))
/* Candidates that a block of hs_walker_init has room for. */
int32_t hs_walker_capacity(const hs_search *search);

/* A bound on the neighbourhood of any group. False where it is larger than one block has room for:
 * then a walk with HS_BLOCK_SIZES can tell. */
bool hs_walker_bound(const hs_search *search, hs_neighbourhood *most);

/* Whether hs_walker_init_ordered has a chance with it; *bytes: what it would take at least. */
bool hs_walker_fits(hs_search *search, const hs_neighbourhood *most, double *bytes);

/* `visit` NULL: hits are only counted, in n_found; with HS_BLOCK_SIZES not even that, but `most` is
 * found, for the groups of hs_walker_init_ordered. */
hs_status hs_walker_init(hs_search *search, hs_block_use use, hs_visit_fn visit, void *context,
                         hs_walker *walker);

/*
 * The same for a full search that lists: each point's hits come in one visit, ascending by the
 * candidate's number and then by S. most: the largest neighbourhood, as a walk with HS_BLOCK_SIZES
 * over all groups has found it.
 */
hs_status hs_walker_init_ordered(hs_search *search, hs_block_use use,
                                 const hs_neighbourhood *most, hs_visit_fn visit, void *context,
                                 hs_walker *walker);

/* Visit the groups whose first point is in [first, end), in cell order. */
hs_status hs_walk(hs_walker *walker, int32_t first, int32_t end);

/* The same; on HS_ERR_SHIFT_RANGE the failure names the point. */
hs_status hs_walk_or_tell(hs_walker *walker, int32_t first, int32_t end, hs_failure *failure);

/* Visit one point, as a group of its own. */
hs_status hs_walk_point(hs_walker *walker, int32_t si);

/* How much of all points lies behind, those before the search's own included: for progress and
 * guesses. */
HS_ALWAYS_INLINE double
hs_walk_fraction(const hs_walker *walker)
{
    const hs_search *search = walker->search;
    return ((double)search->first_point + walker->group.first) / (double)search->n_in_all;
}

/* Adds what was done to search->walked and frees; harmless twice. */
void hs_walker_close(hs_search *search, hs_walker *walker);

#endif
