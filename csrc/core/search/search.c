/* SPDX-License-Identifier: BSD-3-Clause */
/* search.c: begins a search, settles what follows from its parts, and frees them. */
#include "search.h"

#include <stddef.h>
#include <string.h>

void
hs_search_set_asking(const hs_sets *sets, hs_search *search)
{
    const int64_t n = sets->points->n;
    search->has_queries = sets->queries != NULL;
    search->keeps_none = sets->keeps_none;
    HS_ASSERT(sets->is_full || !search->has_queries);
    search->is_full = sets->is_full;
    search->is_half = !sets->is_full;
    search->n_in_all = search->has_queries ? sets->queries->n : n;
    search->pairs_per_half = !search->is_full ? 1.0
                             : n == 0         ? 0.0
                                              : 2.0 * (double)search->n_in_all / (double)n;
}

void
hs_search_settle(hs_search *search)
{
    search->filter_error =
        search->scene.x_error + search->grid.shift_error + search->scene.formula_error;
}

void
hs_search_renumber(int64_t first_point, int64_t n_points_in_all, hs_search *search)
{
    search->first_point = first_point;
    search->n_in_all = n_points_in_all;
    for (int64_t si = 0; si < search->bins.n; si++) {
        search->bins.order[si] += (int32_t)first_point;
    }
}

void
hs_search_begin(hs_call *call, hs_search *search)
{
    memset((char *)search + offsetof(hs_search, call), 0,
           sizeof *search - offsetof(hs_search, call));
    search->scene.cloud.block = search->scene.beside = NULL; /* freed also when never set */
    search->call = call;
}

void
hs_search_close(hs_search *search)
{
    hs_account *account = &search->call->account;
    hs_stencil_free(account, &search->stencil);
    hs_shells_free(account, &search->shells);
    if (!search->is_borrowed) {
        hs_scene_free(account, &search->scene);
        hs_bins_free(account, &search->bins);
        hs_sparse_free(account, &search->sparse);
    }
    if (search->has_queries) {
        hs_bins_free(account, &search->query_bins);
        hs_sparse_free(account, &search->query_sparse);
    }
}
