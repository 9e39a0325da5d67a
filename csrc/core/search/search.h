/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_SEARCH_SEARCH_H
#define HS_SEARCH_SEARCH_H

#include "../cells/bins.h"

/*
 * search.h: one scene made ready for a call: points in cell order and the neighbouring rows of
 * cells. Walkers (walk.h) read it and leave it as it is.
 */

/*
 * Several cutoffs of one search, and for each but the last the float64 distances that do not tell
 * on which side of it a pair is. The last one is that of the search itself. Cells of equal length
 * tell where among the edges to look for a distance.
 */

/* Shared by all threads. Arrays have n entries and do not descend; behind low and high there is an
 * infinity. */
typedef struct hs_shells {
    int64_t  n;         /* edges: cutoffs but the last; 0 also where shells are not wanted */
    bool     inclusive; /* an edge belongs to the shell below it */
    void    *memory;    /* owned: of all arrays */
    double  *edge;      /* in the caller's unit */
    double  *at;        /* as the scene's metric has it */
    double  *high;      /* a distance above this, as it is returned, is above the edge, ... */
    double  *low;       /* ... and one below this is below it */
    int32_t *start;     /* of each cell: edges that are below all distances in it; last + 1 */
    int64_t  last;
    double   per_length; /* cells of a unit of length */
} hs_shells;

/* Those of the options, of which `memory` is to be freed; HS_OK or HS_ERR_MEMORY. */
hs_status hs_shells_open(hs_account *account, const hs_scene *scene, const hs_options *options,
                         hs_shells *shells);

/* How many edges each of n distances, which are not negative, is surely above; where edges crowd,
 * at least so many. Returns whether one of them may be above more. */
bool hs_shells_find(const hs_shells *shells, const double *distance, int32_t n, int32_t *shell);

/* For a distance that is above *low edges or more: *low that it is surely above, and *high that it
 * may be. */
void hs_shells_range(const hs_shells *shells, double distance, int32_t *low, int32_t *high);

/* A distance as it is returned, of a pair that was decided to be in shell k: on the right side of
 * both edges, and still within 1 ulp, because the true distance is there too. */
double hs_shells_keep(const hs_shells *shells, int64_t k, double distance);

typedef struct hs_search {
    /* Large, and filled before they are read: not cleared at first. */
    hs_scene scene; /* without its arrays: bins has them */
    hs_grid  grid;
    /* From here on all begins as zero. */
    hs_call   *call; /* borrowed: memory, threads, what is wanted and what was done */
    hs_stencil stencil;
    hs_bins    bins;
    bool       is_full;     /* every asking point meets all its neighbours, not the half list */
    bool       is_half;     /* each pair is listed once, the lower number first */
    bool       keeps_none;  /* pairs are handed on and not kept: any number will fit */
    bool       is_borrowed; /* the cells and all of the scene belong to another search */
    bool       has_queries; /* the asking points are queries, in the cells of this grid: */
    hs_bins    query_bins;
    bool       is_sparse;                   /* the grid, so that bins have rows */
    const struct hs_limits *limits;         /* borrowed; NULL: the cutoff is that of all pairs */
    hs_shells               shells;         /* as the options have them */
    int64_t                 n_before;       /* asking points that were searched with before, ... */
    int64_t                 n_in_all;       /* ... of so many: for fractions done */
    double                  pairs_per_half; /* pairs to be found for each pair of the half list */
    double                  filter_error;   /* bound on each component before rounding to float32 */
} hs_search;

/* An empty search; the call must outlive it. */
void hs_search_begin(hs_call *call, hs_search *search);

/* How much of all points lies behind when so many of the asking points do, those before the
 * search's own included: for progress and guesses. */
HS_ALWAYS_INLINE double
hs_search_fraction(const hs_search *search, int64_t n)
{
    return (double)(search->n_before + n) / (double)search->n_in_all;
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

/* Whether a pair of points can occur in several images, so that these are to be told apart. */
bool hs_search_repeats_images(const hs_search *search);

/* Points that the asking points meet as candidates, in all, counted for each that asks. Of crowded
 * cells no fewer than there are. */
double hs_search_candidates(const hs_search *search);

/* How many times as many points there are in a point's cell as in an even scene, itself left out:
 * where points lie at random it finds as many others there as cells have on average. Not of sparse
 * cells. */
double hs_search_crowd(const hs_search *search);

/* From the neighbours of each point to the half list. For a search among one set of points; HS_OK,
 * or a status of hs_stencil_build. */
hs_status hs_search_halve(hs_search *search);

/* Frees what it has; idempotent. The call goes on. */
void hs_search_close(hs_search *search);

/*
 * Everything up to the first group: threads and cells, or what can be reused of sets->built. On
 * failure the search is closed. The points are not needed any more.
 */
hs_status hs_search_open(const hs_sets *sets, const hs_box *box, hs_call *call, hs_search *search,
                         hs_failure *failure);

/* The scene of these points and its cells, in place of those that hs_search_close has freed;
 * options.cutoff may have changed. */
hs_status hs_search_build(const hs_sets *sets, const hs_box *box, hs_search *search,
                          hs_failure *failure);

/*
 * A search among the points of another one, which was made to be kept, stays as it is and must
 * outlive this one. The queries of the sets ask, or the points. Cells, points and their scale are
 * those of the first search; cutoff, reach, stencil and queries are its own; account and threads
 * are those of its call. HS_REBUILD when it cannot serve them: the cutoff is larger than its own,
 * or its bounds do not hold for the queries. Else any status of hs_search_open.
 */
hs_status hs_search_reuse(const hs_sets *sets, hs_call *call, hs_search *search,
                          hs_failure *failure);

/* Will the result fit? Estimated before the search from a sample of points. */

/* What a search that was refused memory would have taken. For HS_ERR_MEMORY only; changes nothing
 * where the failure says it already. */
typedef struct hs_shortage {
    double pairs; /* by the density of the points in the space that they occupy */
    double bytes; /* of the search itself */
} hs_shortage;

/* Adds one search, from the caller's numbers: nothing else need have been read yet. */
void hs_shortage_add(const hs_sets *sets, const hs_box *box, double cutoff, hs_shortage *shortage);
void hs_shortage_tell(const hs_shortage *shortage, const hs_options *options, int ndim,
                      hs_failure *failure);

/*
 * After sorting into cells: HS_OK when a result is expected to fit the account's limit, and always
 * when a cheap bound shows it to be small. HS_ERR_MEMORY fills failure->expected_*. The margin is
 * on the side of searching: a result that turns out too large is refused when it is stored.
 */
hs_status hs_estimate_by_sample(hs_search *search, hs_failure *failure);

/* How many pairs there are, about, from a larger sample: all of them for some hundred points. Where
 * they cannot be counted in some milliseconds, no less than the density of the points says. HS_OK
 * or HS_ERR_MEMORY. */
hs_status hs_estimate_pairs(hs_search *search, double *pairs);

#endif
