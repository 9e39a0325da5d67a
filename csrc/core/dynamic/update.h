/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * update.h: points come, go and move. Each function either does all that it is for, or returns a
 * status and leaves the list as it was, but for memory that waits for the next point.
 */
#ifndef HS_UPDATE_H
#define HS_UPDATE_H

#include "dynamic.h"

/* Adds the point or moves it. placed: NULL for a key without a position. */
hs_status hs_update_insert(hs_dynamic *list, hs_key key, const hs_placed *placed,
                           hs_failure *failure);

/* The same for n keys that differ from each other; positions are columns x[k][i], finite. */
hs_status hs_update_insert_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags,
                                int64_t n, double *const *x, hs_failure *failure);

bool hs_update_remove(hs_dynamic *list, hs_key key);

#endif
