/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * parallel.h: the walk over all points by several threads. Points are handed out in ranges; what a
 * thread finds in one waits in a backlog of its own until all earlier ranges have been written, so
 * that the result is the same for any number of threads.
 */
#ifndef HS_PARALLEL_H
#define HS_PARALLEL_H

#include "output.h"
#include "search.h"

/* Records all pairs in the output, by search->team. HS_ERR_SHIFT_RANGE sets failure->row. */
hs_status hs_parallel_record(hs_search *search, hs_output *output, hs_failure *failure);

/* Counts them. */
hs_status hs_parallel_count(hs_search *search, int64_t *count, hs_failure *failure);

#endif
