/* SPDX-License-Identifier: BSD-3-Clause */
/* rows.c: rows are placed one at a time: to store what comes of it would cost more than to do it
 * again. */
#include "rows.h"

hs_status
hs_rows_place(const hs_dynamic *list, double *const *x, int64_t i, double *given, hs_placed *placed,
              hs_failure *failure)
{
    for (int k = 0; k < list->lattice.ndim; k++) {
        given[k] = x[k][i];
    }
    const hs_status status = hs_dynamic_place(list, given, placed, failure);
    failure->row = status == HS_OK ? failure->row : i;
    return status;
}

hs_status
hs_rows_reach(hs_dynamic *list, int64_t n, double *const *x, hs_failure *failure)
{
    int64_t   first[HS_MAX_DIM], last[HS_MAX_DIM];
    double    given[HS_MAX_DIM], bytes = 0.0;
    hs_placed placed;
    for (int64_t i = 0; i < n; i++) {
        if (!hs_rows_go_on(list, i)) {
            return HS_ERR_INTERRUPTED;
        }
        const hs_status status = hs_rows_place(list, x, i, given, &placed, failure);
        if (status != HS_OK) {
            return status;
        }
        for (int k = 0; k < list->lattice.ndim; k++) {
            const int64_t u = placed.index[k];
            first[k] = i == 0 || u < first[k] ? u : first[k];
            last[k] = i == 0 || u > last[k] ? u : last[k];
        }
    }
    if (!list->cells.dense) {
        return HS_OK;
    }
    const hs_status status =
        hs_cell_table_extend(&list->cells, &list->entries, first, last, list->grid_bytes, &bytes);
    failure->expected_bytes = bytes;
    failure->limit_bytes = list->grid_bytes;
    return status;
}
