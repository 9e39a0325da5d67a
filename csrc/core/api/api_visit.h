/* SPDX-License-Identifier: BSD-3-Clause */
/* api_visit.h: pairs handed to a function as they are found, stored nowhere. See halfshell.h. */
#ifndef HS_API_VISIT_H
#define HS_API_VISIT_H

#include "../scene/scene.h"

/* hs_pairs_visit for sets of points. */
hs_status hs_pairs_visit_in(const hs_sets *sets, const hs_box *box, const hs_options *options,
                            const hs_visit *visit, int64_t *n_visited, hs_failure *failure);

#endif
