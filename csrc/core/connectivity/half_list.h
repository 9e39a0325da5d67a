/* SPDX-License-Identifier: BSD-3-Clause */
/* half_list.h: pairs that a caller gives, each once and in ascending order, copied so that nothing
 * can change them, and looked at so that nothing can be wrong with them. */
#ifndef HS_HALF_LIST_H
#define HS_HALF_LIST_H

#include "../../halfshell_nodes.h"
#include "../collect/columns.h"

/* A half list is an output of i, j and, in a box, S, of 4 bytes each: ascending by (i, j, S), with
 * i < j, or i == j and the first nonzero component of S positive. */

/* A copy of these pairs of n points. HS_ERR_ARGUMENT where they are no half list: failure->row is
 * the first pair that is wrong. On failure *copy can still be freed. */
hs_status hs_half_list_copy(hs_account *account, const hs_half_list *pairs, int64_t n,
                            hs_output *copy, hs_failure *failure);

/* Its columns; shift is NULL where there is none. */
typedef struct hs_half_columns {
    int64_t        n;
    int            ndim;
    const int32_t *i, *j, *shift;
} hs_half_columns;

hs_half_columns hs_half_list_columns(const hs_output *half);

/* Whether the first component of S that is not 0 is positive; S is not 0. */
HS_ALWAYS_INLINE bool
hs_shift_is_forward(const int32_t *shift, int ndim)
{
    int k = 0;
    while (k < ndim - 1 && shift[k] == 0) {
        k++;
    }
    return shift[k] > 0;
}

#endif
