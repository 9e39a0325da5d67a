/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_API_NODES_H
#define HS_API_NODES_H

#include "../connectivity/connectivity.h"
#include "pairs.h"

/*
 * nodes.h: the functions of halfshell_nodes.h: connectivity of node lists, its changes and its
 * geometry.
 */

/* How the functions of node lists begin and end. */

/* How many nodes there are; HS_ERR_TOO_MANY from 2^31 on. */
hs_status hs_count_nodes(const hs_node_lists *lists, int64_t *n);

/* Whether a call that returns a connectivity can begin; *result, unless NULL, is NULL then. */
bool hs_can_connect(hs_connectivity **result, const hs_options *options);

/* An empty connectivity whose call, with these options, has been entered; *failure becomes where
 * the failure goes, *status that of the resources. hs_connectivity_finish must follow. NULL when
 * memory is short: then the call has ended. */
hs_connectivity *hs_connectivity_begin(const hs_options *options, hs_failure **failure,
                                       hs_status *status);

/* Leaves the call. *result becomes the object, or that is freed. Returns the status. */
hs_status hs_connectivity_finish(hs_connectivity *made, hs_status status, hs_connectivity **result,
                                 hs_failure *failure);

/* The same for rows, by hs_pairs_begin and hs_pairs_finish. points: NULL, or checked as well. */
hs_pairs *hs_rows_begin(const hs_options *options, const hs_points *points, hs_failure **failure,
                        hs_status *status);
hs_status hs_rows_finish(hs_pairs *made, hs_status status, hs_pairs **result, hs_failure *failure);

#endif
