/* SPDX-License-Identifier: BSD-3-Clause */
/* search.c: see search.h. */
#include "search.h"

#include <stddef.h>
#include <string.h>

/* An hs_poll_fn: the caller's, counted. */
static bool
counted_poll(void *context, double fraction)
{
    hs_search *search = context;
    search->walked.polls++;
    return search->callers_poll(search->callers_context, fraction);
}

int
hs_search_threads(int64_t n_points, const hs_options *options)
{
    const int n = options->threads;
    const int most = n < 0 ? (n_points >= HS_POINTS_FOR_THREADS ? -n : 1) : n;
    return most < HS_MOST_THREADS ? most : HS_MOST_THREADS;
}

void
hs_search_set_asking(const hs_sets *sets, hs_search *search)
{
    const int64_t n = sets->points->n;
    search->has_queries = sets->queries != NULL;
    search->keeps_none = sets->keeps_none;
    HS_ASSERT(sets->is_full || !search->has_queries);
    search->is_full = sets->is_full;
    search->n_in_all = search->has_queries ? sets->queries->n : n;
    search->pairs_per_half = !search->is_full ? 1.0
                             : n == 0         ? 0.0
                                              : 2.0 * (double)search->n_in_all / (double)n;
}

void
hs_search_settle(hs_search *search)
{
    search->filter_error = search->scene.x_error + search->grid.shift_error +
                           search->scene.formula_error;
}

void
hs_search_renumber(int64_t first_point, int64_t n_points_in_all, hs_search *search)
{
    search->first_point = (int32_t)first_point;
    search->n_in_all = n_points_in_all;
    for (int64_t si = 0; si < search->bins.n; si++) {
        search->bins.order[si] += (int32_t)first_point;
    }
}

void
hs_search_set_poll(hs_poll_fn poll, void *context, hs_search *search)
{
    search->callers_poll = poll;
    search->callers_context = context;
    search->options.poll = poll != NULL ? counted_poll : NULL;
    search->options.poll_context = search;
}

void
hs_search_begin(const hs_options *options, hs_search *search)
{
    memset((char *)search + offsetof(hs_search, account), 0,
           sizeof *search - offsetof(hs_search, account));
    search->scene.cloud.block = search->scene.beside = NULL; /* freed also when never set */
    search->options = *options;
    hs_search_set_poll(options->poll, options->poll_context, search);
    hs_account_init(&search->account, options);
}

void
hs_search_note(hs_search *search, const hs_counters *walked)
{
    hs_counters *sum = &search->walked;
    sum->groups += walked->groups;
    sum->candidates += walked->candidates;
    sum->ambiguous += walked->ambiguous;
    sum->by_float64 += walked->by_float64;
    sum->by_double_word += walked->by_double_word;
    sum->by_integers += walked->by_integers;
    sum->polls += walked->polls;
}

void
hs_search_report(const hs_search *search, int64_t n_pairs)
{
    hs_counters *counters = search->options.counters;
    if (counters == NULL) {
        return;
    }
    *counters = search->walked;
    memcpy(counters->bytes, search->account.total.bytes, sizeof counters->bytes);
    counters->bytes_peak = search->account.total.bytes_peak;
    counters->pairs = n_pairs;
}

void
hs_search_close(hs_search *search)
{
    hs_account *account = &search->account;
    hs_stencil_free(account, &search->stencil);
    if (!search->is_borrowed) {
        hs_scene_free(account, &search->scene);
        hs_bins_free(account, &search->bins);
        hs_sparse_free(account, &search->sparse);
    }
    if (search->has_queries) {
        hs_bins_free(account, &search->query_bins);
        hs_sparse_free(account, &search->query_sparse);
    }
    hs_team_free(search->team);
    search->team = NULL;
}
