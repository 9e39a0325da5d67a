/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * search.h: the walk over all groups of points. Rows of cells in order, cells along each row, at
 * most HS_GROUP_POINTS points at a time; each group's neighbourhood is gathered, scanned for every
 * point of the group, and the decided hits are handed to a visitor.
 */
#ifndef HS_SEARCH_H
#define HS_SEARCH_H

#include "gather.h"
#include "stencil.h"

/* A neighbouring row of the row being walked, with its image settled. */
typedef struct hs_link {
    int64_t base;              /* id of its first cell */
    int32_t first, last;       /* as in hs_stencil_row */
    int32_t image[HS_MAX_DIM]; /* shift over the rows of B */
    double  shift[HS_MAX_DIM]; /* image * B */
} hs_link;

typedef struct hs_search hs_search;

/*
 * The decided hits of point si against the present block: n_hits entries of search->block.hits,
 * which are places in the block when search->lists_places, else point numbers. Anything but HS_OK
 * ends the walk with that status.
 */
typedef hs_status (*hs_visit_fn)(void *context, hs_search *search, int32_t si, int32_t n_hits);

struct hs_search {
    hs_account       account;
    hs_options       options;
    hs_scene         scene;   /* without its arrays: bins has them */
    hs_grid          grid;
    hs_stencil       stencil;
    hs_bins          bins;
    hs_block         block;
    hs_group         group;
    hs_link         *links;   /* owned; of the row being walked */
    int64_t          n_links;
    const hs_kernel *kernel;
    bool             lists_places; /* set before walking where the visitor wants places */
    double           filter_error; /* bound on each component before rounding to float32 */
    hs_visit_fn      visit;
    void            *visit_context;
    int64_t          failed_point;   /* whose shift passed its range, for HS_ERR_SHIFT_RANGE */
    bool             block_is_first; /* of its group: candidate t is group point t */
    hs_stages        stages;
    hs_poll_fn       callers_poll; /* behind options.poll, which counts the calls */
    void            *callers_context;
    int64_t          n_groups, n_candidates, n_ambiguous, n_polls;
    int64_t          work_since_poll;
    double           fraction; /* of the walk that is done */
};

/* Everything up to the first group. On failure nothing is held. The options are copied; what they
 * point to is borrowed until hs_search_close. */
hs_status hs_search_open(const hs_points *points, const hs_box *box, const hs_options *options,
                         hs_search *search, hs_failure *failure);

/* Visit every point. */
hs_status hs_search_walk(hs_search *search, hs_visit_fn visit, void *context);

/* Visit one point, as the walk would but as a group of its own. */
hs_status hs_search_point(hs_search *search, int32_t si, hs_visit_fn visit, void *context);

/* Calls poll() if there is one: HS_OK or HS_ERR_INTERRUPTED. */
hs_status hs_search_poll(hs_search *search);

/* Copies the counts to options.counters, if wanted. */
void hs_search_report(const hs_search *search, int64_t n_pairs);

/* Frees all but what belongs to the account alone; harmless twice. */
void hs_search_close(hs_search *search);

#endif
