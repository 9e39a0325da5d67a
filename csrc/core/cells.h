/* SPDX-License-Identifier: BSD-3-Clause */
/* cells.h: what kept cells are, for those who ask them. */
#ifndef HS_CELLS_H
#define HS_CELLS_H

#include "pairs.h"

struct hs_cells {
    hs_search search; /* open, never walked itself: calls borrow from it */
    hs_points points; /* of `copy` */
    hs_box    box;
    bool      has_box;
    double   *copy;   /* owned; points as given, for cutoffs and queries that need other cells */
};

/* Queries, or NULL, among the points of the cells. */
hs_sets hs_cells_sets(const hs_cells *cells, const hs_points *queries, bool is_full);

#endif
