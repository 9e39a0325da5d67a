/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * system_part.h: one of many systems, cut from the arrays that hold those of all. Nothing is
 * copied but boxes, and the pairs that a selection excludes, which are sorted by system before.
 */
#ifndef HS_SYSTEM_PART_H
#define HS_SYSTEM_PART_H

#include "../../halfshell.h"
#include "../memory/account.h"

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

/* Points first[s] to first[s + 1] of all. */
hs_points hs_points_of_system(const hs_points *all, const int64_t *first, int64_t s);

/* Whether each system has something of a box of its own. */
HS_ALWAYS_INLINE bool
hs_systems_have_boxes(const hs_systems *systems)
{
    return systems->rows != NULL || systems->periodic != NULL;
}

/* The box of system s of points in so many dimensions: that of all, or own_box, which is set. */
const hs_box *hs_box_of_system(const hs_systems *systems, int ndim, int64_t s, hs_box *own_box);

/* What pairs of system s have as their reach, where systems->reach is there. */
hs_reach hs_reach_of_system(const hs_systems *systems, int ndim, int64_t s);

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

#endif
