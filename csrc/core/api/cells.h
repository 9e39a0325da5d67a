/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_API_CELLS_H
#define HS_API_CELLS_H

#include "../nearest/nearest.h"
#include "../search/search.h"

/*
 * cells.h: cells that are kept between calls: building them, and what the functions that search
 * them need of them.
 */

/* What kept cells are, for the functions of api/ that search them. */

struct hs_cells {
    hs_call   call;   /* that built them; its account holds them */
    hs_search search; /* open, never walked itself: calls borrow from it */
    hs_points points; /* of `copy` */
    hs_box    box;
    bool      has_box;
    double   *copy; /* owned; points as given, for cutoffs and queries that need other cells */
    hs_nearest_kept *trees; /* owned; a search for the nearest needs a tree, not cells */
};

#endif
