/* SPDX-License-Identifier: BSD-3-Clause */
/* marks.h: what the caller knows of each point beside its place: types and weights, copied once. */
#ifndef HS_MARKS_H
#define HS_MARKS_H

#include "weights.h"

/* Types and weights of one set of points, in cell order. */
typedef struct hs_marked {
    int32_t   *type;  /* owned; NULL: all 0 */
    hs_weights weights;
} hs_marked;

/* Point i of the set has the caller's number order[i]. HS_ERR_TYPES or HS_ERR_WEIGHTS set
 * failure->row. */
hs_status hs_marked_init(hs_account *account, const hs_marks *marks, const int32_t *order,
                         int64_t n, int32_t n_types, hs_marked *marked, hs_failure *failure);
void      hs_marked_free(hs_account *account, hs_marked *marked);

#endif
