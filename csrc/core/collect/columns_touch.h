/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * columns_touch.h: asks the system for memory before it is written to in no particular order. Each
 * page of new memory is cleared by the system at the first write to it, a huge one in a millisecond
 * or more. Where the first thousand writes go to a thousand pages, the caller could not be asked
 * for seconds.
 */
#ifndef HS_COLUMNS_TOUCH_H
#define HS_COLUMNS_TOUCH_H

#include "columns.h"
#include "../threads/team.h"

/* Writes to every page of the columns' first n_pairs pairs, if they are so large that it matters:
 * what they hold is lost. HS_ERR_INTERRUPTED when the caller says so. */
hs_status hs_touch_output(hs_team *team, const hs_options *options, hs_output *output);

#ifdef HS_TESTING
/* Bytes that one thread touches at a time; columns of less than eight times as many are left alone.
 * Returns what it was before. */
size_t hs_test_touch_parts(size_t bytes);
#endif

#endif
