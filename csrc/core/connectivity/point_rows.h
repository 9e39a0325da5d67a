/* SPDX-License-Identifier: BSD-3-Clause */
/* point_rows.h: rows over the numbers of points, as scratch: of a caller's, of the opposite
 * direction, or of both ends of a half list. */
#ifndef HS_POINT_ROWS_H
#define HS_POINT_ROWS_H

#include "../memory/account.h"

#include "half_list.h"

/* Row i is index[first[i]] ... index[first[i + 1] - 1], ascending. Both are owned. */
typedef struct hs_point_rows {
    int64_t  n;
    int64_t *first;
    int32_t *index;
} hs_point_rows;

/*
 * A copy of n rows that a caller gives, each with its own number added. HS_ERR_ARGUMENT where
 * offsets descend, or a row is not ascending, has its own number or one that is no point. On
 * failure holds nothing, as all of these.
 */
hs_status hs_point_rows_copy(hs_account *account, const hs_index_rows *given, hs_point_rows *rows);

/* The opposite direction, with all points under other numbers: row place[j] has the places of all i
 * in whose rows j is; order[place[i]] is i. */
hs_status hs_point_rows_turn(hs_account *account, const hs_point_rows *from, const int32_t *order,
                             const int32_t *place, hs_point_rows *rows);

/* All neighbours of each of n points. */
hs_status hs_point_rows_of(hs_account *account, const hs_output *half, int64_t n,
                           hs_point_rows *rows);

/* Harmless twice. */
void hs_point_rows_free(hs_account *account, hs_point_rows *rows);

#endif
