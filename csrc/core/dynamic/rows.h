/* SPDX-License-Identifier: BSD-3-Clause */
/* rows.h: many positions, as columns x[k][i] of finite numbers. */
#ifndef HS_DYNAMIC_ROWS_H
#define HS_DYNAMIC_ROWS_H

#include "../base/poll.h"
#include "place_point.h"

/* Whether to go on before row i, as long as the list is as it was. */
HS_ALWAYS_INLINE bool
hs_rows_go_on(const hs_dynamic *list, int64_t i)
{
    return (i + 1) % HS_POLL_POINTS != 0 || list->hooks.poll == NULL || list->hooks.poll(NULL, 0.0);
}

/* Row i made ready. given: receives its numbers, which `placed` borrows. Statuses of
 * hs_dynamic_place, with failure->row. */
hs_status hs_rows_place(const hs_dynamic *list, double *const *x, int64_t i, double *given,
                        hs_placed *placed, hs_failure *failure);

/* Whether all positions can be had; dense cells are made to reach them. HS_ERR_SHIFT_RANGE;
 * HS_ERR_CAPACITY with the bytes, HS_ERR_MEMORY, HS_ERR_INTERRUPTED. n > 0. */
hs_status hs_rows_reach(hs_dynamic *list, int64_t n, double *const *x, hs_failure *failure);

#endif
