/* SPDX-License-Identifier: BSD-3-Clause */
/* fill.h: many points into a list that holds none: no key has to be looked up, and each cell has
 * its block from the beginning. */
#ifndef HS_FILL_H
#define HS_FILL_H

#include "dynamic.h"

/* list: empty. ids: n that differ from each other, n > 0; positions are columns x[k][i], finite.
 * Statuses of hs_update_insert_many; on failure the list holds no points. */
hs_status hs_fill(hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t n,
                  double *const *x, hs_failure *failure);

#endif
