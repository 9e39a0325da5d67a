/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_NEAREST_NEAREST_H
#define HS_NEAREST_NEAREST_H

#include "../collect/columns.h"
#include "../search/search.h"
#include "../memory/memory.h"
#include "tree.h"

/*
 * nearest.h: what a search for the nearest points knows, its preparation, and trees that are kept
 * for many searches.
 */

typedef struct hs_nearest {
    hs_search *search;      /* borrowed: scene, bins, call */
    hs_tree    tree;        /* of the points; owned unless the search is borrowed */
    hs_tree    asking_tree; /* owned; of the queries, if there are any */
    int64_t    k;           /* points wanted for each */
    bool       omits_self;  /* without queries: a point is not its own neighbour */
    double     limit;       /* largest distance in the scene's unit; infinity: none */
    hs_metric  within;      /* decides on the largest distance, if there is one */
    double     least;       /* and the least one that counts; 0: none */
    hs_metric  nearer;      /* decides on that */
    hs_metric  order;       /* decides which is nearer */
    double     drift[HS_MAX_DIM][HS_MAX_DIM]; /* [k][r]: how far row r of B moves t_k beyond
                                                   * whole periods */
    double     smallest_period;               /* infinity without one */
    bool       has_layer; /* some axes repeat, others, upright on them, are open: */
    double     layer_lower[HS_MAX_DIM], layer_upper[HS_MAX_DIM]; /* t_k of points along these */
    hs_output *rows;                                             /* borrowed */
    hs_shared *shared; /* owned; for what threads need more of */
} hs_nearest;

/*
 * A scene and trees, made anew or borrowed from cells that keep them: everything of `near` but k,
 * omits_self and rows, which are set already, as is its search but for scene, bins, kernel and
 * threads. sets->trees: NULL, or what keeps a tree of the points. `limit`: the largest
 * distance. Which points count is the call's choice, if it has one. hs_nearest_release in any
 * case.
 */
hs_status hs_nearest_prepare(hs_nearest *near, const hs_sets *sets, const hs_box *box, double limit,
                             hs_failure *failure);
void      hs_nearest_release(hs_nearest *near);

/* Writes all rows, by all threads of the team. HS_ERR_MEMORY, HS_ERR_INTERRUPTED;
 * HS_ERR_SHIFT_RANGE sets failure->row. */
hs_status hs_nearest_search(hs_nearest *near, hs_failure *failure);

/*
 * A tree that is kept with cells. The first search for the nearest points there builds it; others
 * borrow it, any number of them at once. No call waits: one that comes while it is being built
 * makes a tree for itself alone.
 */

#define HS_NEAREST_NOTHING 0
#define HS_NEAREST_BUILT   1 /* and does not change any more */
#define HS_NEAREST_BUILDS  2 /* a thread, after state - HS_NEAREST_BUILDS forks */

typedef struct hs_nearest_kept {
    volatile int64_t state;
    hs_nearest       near;
    hs_search        search; /* its own, as is its call */
    hs_call          call;
} hs_nearest_kept;

/* One without a tree as yet. NULL when memory is short. */
hs_nearest_kept *hs_nearest_kept_new(void);
void             hs_nearest_kept_free(hs_nearest_kept *kept); /* NULL-safe */

#endif
