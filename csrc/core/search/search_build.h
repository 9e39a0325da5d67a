/* SPDX-License-Identifier: BSD-3-Clause */
/* search_build.h: a scene and its cells for an open search: grid, stencil, points sorted into
 * cells. */
#ifndef HS_SEARCH_BUILD_H
#define HS_SEARCH_BUILD_H

#include "search.h"

/*
 * The scene of these points, in place of one that hs_search_close has freed; options.cutoff may
 * have changed.
 */
hs_status hs_search_build(const hs_sets *sets, const hs_box *box, hs_search *search,
                          hs_failure *failure);

/* The queries into the cells that are there; their scene gives up its arrays. */
hs_status hs_search_bin_queries(hs_search *search, hs_scene *asking);

#endif
