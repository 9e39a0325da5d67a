/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_API_SYSTEMS_H
#define HS_API_SYSTEMS_H

#include "../../halfshell.h"
#include "../base/base.h"
#include "../memory/memory.h"

/*
 * systems.h: one search in each of several systems: half lists in one loop that reuses scene and
 * walker, all else by one call for each system.
 */

/*
 * What the public functions of these names do with sets of several systems, whose options, and
 * where the result goes, are there: options are those that their searches of one system have.
 */
hs_status hs_systems_pairs(const hs_among *among, const hs_options *options, hs_pairs **result,
                           hs_failure *failure);
hs_status hs_systems_count(const hs_among *among, const hs_options *options, int64_t *counts,
                           hs_failure *failure);
hs_status hs_systems_neighbors(const hs_among *among, const hs_options *options, hs_pairs **result,
                               hs_failure *failure);
hs_status hs_systems_neighbors_count(const hs_among *among, const hs_options *options,
                                     int64_t *counts, hs_failure *failure);
hs_status hs_systems_nearest(const hs_among *among, int64_t k, const hs_options *options,
                             hs_pairs **result, hs_failure *failure);
hs_status hs_systems_histogram(const hs_among *among, const hs_options *options,
                               const hs_histogram *histogram, hs_failure *failure);

/*
 * One of several systems, cut from the arrays that hold those of all. Nothing is
 * copied but boxes, and the pairs that a selection excludes, which are sorted by system before.
 */

/* The numbers of a selection, in each system: excluded pairs of s from first[s] to first[s + 1],
 * and those of queries that are points. NULL where there are none. */
typedef struct hs_selected_parts {
    int64_t *first;         /* owned */
    int64_t *pairs;         /* owned */
    int64_t *query_numbers; /* owned */
} hs_selected_parts;

/* One system. It borrows from itself: it cannot be moved. */
typedef struct hs_system_part {
    int64_t      system;
    int64_t      first_point, first_asking; /* how many points, or queries, come before its own */
    int64_t      n_asking;
    hs_set       points, queries;
    hs_box       own_box;
    hs_selection selection;
    hs_among     among; /* of what is above, as far as all systems have it */
} hs_system_part;

/* The box of system s: that of all, or own_box, which is set. */
const hs_box *hs_box_of_system(const hs_among *among, int64_t s, hs_box *own_box);

/* How far pairs of system s may be apart: its own cutoff, or else that of all. */
HS_ALWAYS_INLINE double
hs_cutoff_of_system(const hs_among *among, int64_t s, double of_all)
{
    return among->each != NULL && among->each->cutoffs != NULL ? among->each->cutoffs[s] : of_all;
}

/* Sorts the numbers of the selection, if any, which has been checked; excluded pairs of two systems
 * are left out. HS_OK or HS_ERR_MEMORY; parts can be freed either way. */
hs_status hs_selected_parts_open(const hs_among *among, hs_account *account,
                                 hs_selected_parts *parts);
void      hs_selected_parts_free(hs_account *account, hs_selected_parts *parts);

/* System s with all that it has. */
void hs_system_part_cut(const hs_among *among, const hs_selected_parts *selected, int64_t s,
                        hs_system_part *part);

#endif
