/* SPDX-License-Identifier: BSD-3-Clause */
/* connectivity.h: rows and pairs of node lists, which the functions of api/ make and give out. */
#ifndef HS_CONNECTIVITY_H
#define HS_CONNECTIVITY_H

#include "../collect/result.h"

#include "node_map.h"

/* All parts are charged to the call, which has ended when the caller gets the object. */
struct hs_connectivity {
    hs_call   call;
    hs_pairs *rows;          /* owned; offsets, J and S */
    hs_pairs *nodes, *lists; /* owned; of the pairs: I, J and S; I and J. Empty without a table */
};

/* An empty object, whose call must be begun next. NULL when memory is short. */
hs_connectivity *hs_connectivity_new(void);

/* Fills the rows, and the pairs unless rows alone are wanted, from a half list of n points. */
hs_status hs_connectivity_fill(hs_connectivity *connectivity, const hs_node_lists *lists, int64_t n,
                               const hs_output *half, hs_failure *failure);

/* The same of rows of all points, which become those of the object where they need no change. */
hs_status hs_connectivity_fill_rows(hs_connectivity *connectivity, const hs_node_lists *lists,
                                    hs_pairs **found);

/* Fills the pairs alone, from rows of all n nodes, in the order of lists and nodes, which are
 * given. HS_ERR_ARGUMENT where that is not so. */
hs_status hs_connectivity_fill_pairs(hs_connectivity *connectivity, const hs_node_lists *lists,
                                     int64_t n, const hs_list_rows *rows);

#endif
