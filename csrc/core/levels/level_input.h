/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * level_input.h: what is to be divided into levels, read once and checked: the coordinates of a set
 * of points, and its radii, types or supports.
 */
#ifndef HS_LEVEL_INPUT_H
#define HS_LEVEL_INPUT_H

#include "levels.h"

/* What is divided, and by what. */
typedef struct hs_division {
    hs_account       *account;
    const hs_options *options; /* to poll by */
    const hs_reach   *reach;
    int64_t          *count; /* owned; points of each size or type, in both sets */
    int32_t           n_sizes;
    double            factor;
    double            largest; /* of all radii */
} hs_division;

/* A set of points while it is divided. */
typedef struct hs_level_input {
    const hs_points *points;
    const double    *radii;
    const int32_t   *types;
    const double    *supports;
    bool             are_queries;
    double          *rows; /* owned, in the caller's order, as are all of these */
    double          *copy; /* of the radii, or how far supports reach */
    int32_t         *size; /* of each point; read where there are types, else to be found */
    hs_support_set   read; /* of the supports */
} hs_level_input;

HS_ALWAYS_INLINE bool
hs_level_input_has_radii(const hs_level_input *set)
{
    return set->radii != NULL || set->supports != NULL;
}

/* Reads a set, and counts its types or finds the largest of its radii. On failure as well, it is to
 * be freed. */
hs_status hs_level_input_read(hs_division *by, hs_level_input *set, hs_failure *failure);
void      hs_level_input_free(hs_account *account, hs_level_input *set);

/* Passes go over HS_POLL_POINTS at a time and poll in between. The next ones of n; false where
 * there are none, after a failure, or where the caller wants to stop, which *status says. */
bool hs_division_go_on(const hs_division *by, int64_t n, hs_slice *next, hs_status *status);

#endif
