/* SPDX-License-Identifier: BSD-3-Clause */
/* rows.h: many positions, as columns x[k][i] of finite numbers. */
#ifndef HS_DYNAMIC_ROWS_H
#define HS_DYNAMIC_ROWS_H

#include "place_point.h"

/* Row i made ready. given: receives its numbers, which `placed` borrows. Statuses of
 * hs_dynamic_place, with failure->row. */
hs_status hs_rows_place(const hs_dynamic *list, double *const *x, int64_t i, double *given,
                        hs_placed *placed, hs_failure *failure);

/* Whether all positions can be had; dense cells are made to reach them. HS_ERR_SHIFT_RANGE;
 * HS_ERR_CAPACITY with the bytes, HS_ERR_MEMORY. n > 0. */
hs_status hs_rows_reach(hs_dynamic *list, int64_t n, double *const *x, hs_failure *failure);

#endif
