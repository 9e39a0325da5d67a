/* SPDX-License-Identifier: BSD-3-Clause */
/* marks.c: see marks.h. */
#include "marks.h"

hs_status
hs_marked_init(hs_account *account, const hs_marks *marks, const int32_t *order, int64_t n,
               int32_t n_types, hs_marked *marked, hs_failure *failure)
{
    *marked = (hs_marked){.type = NULL};
    hs_status status = hs_weights_init(account, marks->weights, order, n, &marked->weights,
                                       failure);
    if (status != HS_OK || marks->types == NULL) {
        return status;
    }
    marked->type = hs_alloc(account, HS_FOR_POINTS, n, sizeof(int32_t));
    if (marked->type == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t i = 0; i < n; i++) {
        marked->type[i] = marks->types[order[i]];
        if (marked->type[i] < 0 || marked->type[i] >= n_types) {
            failure->row = order[i];
            failure->value = marked->type[i];
            return HS_ERR_TYPES;
        }
    }
    return HS_OK;
}

void
hs_marked_free(hs_account *account, hs_marked *marked)
{
    hs_free(account, marked->type);
    marked->type = NULL;
    hs_weights_free(account, &marked->weights);
}
