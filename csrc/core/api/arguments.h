/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * arguments.h: checks of what a program of C may get wrong about the arguments of halfshell.h, so
 * that no memory is read or written out of bounds. The binding checks Python's arguments before.
 * Coordinates, boxes and cutoffs are checked when the scene is made (scene.h). Any pointer may be
 * NULL, except the options and the failure that are given to a function hs_check_*.
 */
#ifndef HS_ARGUMENTS_H
#define HS_ARGUMENTS_H

#include "../../halfshell.h"
#include "../base/base.h"

/* The counters, if any, of a call that ends before its search begins. */
void hs_clear_counters(const hs_options *options);

/* Ends such a call: returns the status. *failure, unless NULL, has no details. */
hs_status hs_end_early(hs_status status, const hs_options *options, hs_failure *failure);

/* Whether a call that returns an object has these two, without which it cannot begin. *result,
 * unless NULL, is NULL afterwards. */
bool hs_can_return(hs_pairs **result, const hs_options *options);

/* hs_can_return for objects of other types, once their pointer, unless NULL, has been cleared. */
bool hs_can_begin(const void *result, const hs_options *options);

/* Whether an array is there that has one entry for each of these points, if there are any. */
bool hs_has_entries(const void *array, const hs_points *points);

/* HS_OK, HS_ERR_ARGUMENT, or HS_ERR_TOO_MANY for points and systems from 2^31 on. */
hs_status hs_check_points(const hs_points *points, hs_failure *failure);

/* first and n of systems that share out so many points; what it reads is first alone. */
hs_status hs_check_systems(const hs_systems *systems, int64_t n_points, hs_failure *failure);

/* HS_OK or HS_ERR_ARGUMENT. The box may be NULL; ndim is that of the points. */
hs_status hs_check_box(const hs_box *box, int ndim);

/* Checks the options that every function uses: threads and the memory limit. */
hs_status hs_check_resources(const hs_options *options);

hs_status hs_check_options(const hs_options *options);

/* Most lengths that distances are sorted by: twice as many are int32. */
#define HS_MOST_LENGTHS (INT64_C(1) << 30)

/* HS_OK, or HS_ERR_EDGES unless there are some, finite, not negative and not descending. */
hs_status hs_check_lengths(const double *lengths, int64_t n, hs_failure *failure);

/* HS_OK, HS_ERR_ARGUMENT, or HS_ERR_EDGES. */
hs_status hs_check_histogram(const hs_histogram *histogram, hs_failure *failure);

/* The first of such lengths that is above 0, or 0. */
double hs_least_length(const double *lengths, int64_t n);

/* Checks all of the above but systems; failure->in_queries tells queries from points. */
hs_status hs_check_arguments(const hs_points *points, const hs_points *queries, const hs_box *box,
                             const hs_options *options, hs_failure *failure);

/* The same for half lists, which may have shells. */
hs_status hs_check_half_list(const hs_points *points, const hs_box *box, const hs_options *options,
                             hs_failure *failure);

#endif
