/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_API_SYSTEMS_H
#define HS_API_SYSTEMS_H

#include "../collect/columns.h"
#include "../threads/call.h"
#include "../../halfshell.h"
#include "../memory/memory.h"

/*
 * systems.h: one search in each of many systems: half lists in one loop that reuses scene and
 * walker, all else by one call for each system.
 */

/*
 * The threads that search many systems. Each searches one after the other with
 * the same account and arena; what they find is written in the order of the systems (parallel.h).
 */

/* What the threads share. */
typedef struct hs_systems_job {
    const hs_points  *points;
    const hs_systems *systems;
    hs_call          *total;  /* has the account of the output, and sums up what was done */
    hs_output        *output; /* NULL: only counting, into ... */
    int64_t          *counts;
    int64_t           in_range;  /* systems of a range; set by hs_systems_search */
    bool              is_direct; /* the one thread writes to the output itself; set there, too */
} hs_systems_job;

/* Searches all systems, by the team of `total`. */
hs_status hs_systems_search(hs_systems_job *job, hs_failure *failure);

/*
 * One of many systems, cut from the arrays that hold those of all. Nothing is
 * copied but boxes, and the pairs that a selection excludes, which are sorted by system before.
 */

/* All systems, borrowed. */
typedef struct hs_system_sets {
    const hs_points  *points;
    const hs_points  *queries; /* where neighbours are looked for; NULL: at each of the points */
    const hs_systems *systems;
} hs_system_sets;

/* Excluded pairs by system: those of s from first[s] to first[s + 1], with numbers of the system.
 * NULL where no pairs are excluded by their numbers. */
typedef struct hs_excluded_parts {
    int64_t *first; /* owned */
    int64_t *pairs; /* owned */
} hs_excluded_parts;

/* One system. It borrows from itself: it cannot be moved. */
typedef struct hs_system_part {
    int64_t      system;
    int64_t      first_point, first_asking; /* how many points, or queries, come before its own */
    int64_t      n_asking;
    hs_points    points, queries;
    hs_box       own_box;
    hs_reach     reach;
    hs_selection selection;
    hs_among     among; /* of what is above, as far as all systems have it */
} hs_system_part;

/* Whether each system has something of a box of its own. */
HS_ALWAYS_INLINE bool
hs_systems_have_boxes(const hs_systems *systems)
{
    return systems->rows != NULL || systems->periodic != NULL;
}

/* The box of system s of points in so many dimensions: that of all, or own_box, which is set. */
const hs_box *hs_box_of_system(const hs_systems *systems, int ndim, int64_t s, hs_box *own_box);

/* How far pairs of system s may be apart: its own cutoff, or else that of all. */
HS_ALWAYS_INLINE double
hs_cutoff_of_system(const hs_systems *systems, int64_t s, double of_all)
{
    return systems->cutoffs != NULL ? systems->cutoffs[s] : of_all;
}

/* Sorts the excluded pairs of the selection, if any, which has been checked; pairs of two systems
 * are left out. HS_OK or HS_ERR_MEMORY; parts can be freed either way. */
hs_status hs_excluded_parts_open(const hs_system_sets *sets, hs_account *account,
                                 hs_excluded_parts *parts);
void      hs_excluded_parts_free(hs_account *account, hs_excluded_parts *parts);

/* System s with all that it has. */
void hs_system_part_cut(const hs_system_sets *sets, const hs_excluded_parts *excluded, int64_t s,
                        hs_system_part *part);

/*
 * One call of a public search for each of many systems. Threads take ranges of
 * them; each call has one thread, what it finds goes behind what those before it found, with
 * numbers among the points of all. Half lists have a loop of their own, which
 * keeps the search of one system for the next.
 */

/* Searches a system. *pairs, NULL before, receives what goes to the output, to be freed. */
typedef hs_status (*hs_system_fn)(void *context, const hs_system_part *part,
                                  const hs_options *options, hs_pairs **pairs, hs_failure *failure);

/* What to do, all borrowed. */
typedef struct hs_systems_each {
    hs_system_sets sets;
    hs_system_fn   search;
    void          *context;
    bool           has_limit; /* the cutoff, or a reach, is the limit of pairs */
    hs_output     *output;    /* where pairs go, with the columns that the options want; or NULL */
} hs_systems_each;

#endif
