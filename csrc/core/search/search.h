/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * search.h: one scene made ready for a call: points in cell order and the neighbouring rows of
 * cells. Walkers (walk.h) read it and leave it as it is.
 */
#ifndef HS_SEARCH_H
#define HS_SEARCH_H

#include "../cells/sparse_rows.h"
#include "../cells/stencil.h"
#include "../threads/call.h"
#include "shells.h"

typedef struct hs_search {
    /* Large, and filled before they are read: not cleared at first. */
    hs_scene scene; /* without its arrays: bins has them */
    hs_grid  grid;
    /* From here on all begins as zero. */
    hs_call   *call; /* borrowed: memory, threads, what is wanted and what was done */
    hs_stencil stencil;
    hs_bins    bins;
    hs_sparse  sparse;      /* when is_sparse: the rows and cells that bins follows */
    bool       is_full;     /* every asking point meets all its neighbours, not the half list */
    bool       is_half;     /* each pair is listed once, the lower number first */
    bool       keeps_none;  /* pairs are handed on and not kept: any number will fit */
    bool       is_borrowed; /* the cells and all of the scene belong to another search */
    bool       has_queries; /* the asking points are queries, in the cells of this grid: */
    hs_bins    query_bins;
    hs_sparse  query_sparse;
    bool       is_sparse;
    const struct hs_limits *limits;      /* borrowed; NULL: the cutoff is that of all pairs */
    hs_shells               shells;      /* as the options have them */
    int64_t                 first_point; /* number of the first point */
    int64_t n_in_all;       /* asking points, of which these may be a part: for fractions done */
    double  pairs_per_half; /* pairs to be found for each pair of the half list */
    double  filter_error;   /* bound on each component before rounding to float32 */
} hs_search;

/* An empty search; the call must outlive it. */
void hs_search_begin(hs_call *call, hs_search *search);

/* Points that are part of more: their numbers begin at first_point, of n_points_in_all. */
void hs_search_renumber(int64_t first_point, int64_t n_points_in_all, hs_search *search);

/* How much of all points lies behind when so many of the asking points do, those before the
 * search's own included: for progress and guesses. */
HS_ALWAYS_INLINE double
hs_search_fraction(const hs_search *search, int64_t n)
{
    return (double)(search->first_point + n) / (double)search->n_in_all;
}

/* Whether a walker of this search may serve another one: it has no arrays for limits or hints for
 * sparse cells. */
HS_ALWAYS_INLINE bool
hs_search_keeps_walker(const hs_search *search)
{
    return search->limits == NULL && !search->is_sparse;
}

/* The asking points, in cell order. */
HS_ALWAYS_INLINE const hs_bins *
hs_search_asking(const hs_search *search)
{
    return search->has_queries ? &search->query_bins : &search->bins;
}

/* Sets, from the sets, which points ask and whether lists are full. */
void hs_search_set_asking(const hs_sets *sets, hs_search *search);

/* Sets what follows from scene and grid. */
void hs_search_settle(hs_search *search);

/* Frees what it has; harmless twice. The call goes on. */
void hs_search_close(hs_search *search);

#endif
