/* SPDX-License-Identifier: BSD-3-Clause */
/* range_checks.h: ranges of cells against rows of neighbours. */
#ifndef HS_RANGE_CHECKS_H
#define HS_RANGE_CHECKS_H

#include "../../../csrc/halfshell.h"

/* Every neighbour of a query is in one of its ranges. */
static inline bool
ranges_hold_rows(const hs_layout *layout, const hs_pairs *ranges, const hs_pairs *rows)
{
    const int64_t *range_of = hs_pairs_offsets(ranges), *row_of = hs_pairs_offsets(rows);
    const int64_t *first = hs_pairs_array(ranges, HS_WANT_I);
    const int64_t *end = hs_pairs_array(ranges, HS_WANT_J);
    const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
    for (int64_t q = 0; q < hs_pairs_rows(rows); q++) {
        for (int64_t e = row_of[q]; e < row_of[q + 1]; e++) {
            bool found = false;
            for (int64_t r = range_of[q]; r < range_of[q + 1]; r++) {
                for (int64_t si = first[r]; si < end[r]; si++)
                    found = found || layout->order[si] == j[e];
            }
            if (!found)
                return false;
        }
    }
    return true;
}

#endif
