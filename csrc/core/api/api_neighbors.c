/* SPDX-License-Identifier: BSD-3-Clause */
/* api_neighbors.c: the public searches for all neighbours of each point, or of each query. */
#include "reach_pairs.h"
#include "request.h"
#include "../base/outcome.h"
#include "../search/estimate.h"
#include "../search/walk.h"
#include "../rows/once.h"
#include "../rows/table.h"
#include "../collect/columns.h"

/* The caller's options, unsorted: table rows have an order of their own. */
static hs_options
options_of_rows(const hs_options *options)
{
    hs_options of_rows = *options;
    of_rows.sorted = false;
    return of_rows;
}

/* Room for all entries, or what is needed for them. */
static hs_status
make_room(hs_pairs *rows, int64_t n_entries, hs_failure *failure)
{
    hs_output *output = &rows->output;
    if (output->fixed && n_entries > output->capacity) {
        failure->expected_pairs = (double)n_entries;
        return HS_ERR_CAPACITY;
    }
    if (!output->fixed && hs_output_reserve(output, n_entries, 0.0) != HS_OK) {
        failure->expected_pairs = (double)n_entries;
        failure->expected_bytes =
            failure->expected_pairs * (double)hs_output_bytes_per_pair(output);
        return HS_ERR_MEMORY;
    }
    output->n_pairs = n_entries;
    return HS_OK;
}

/* Offsets and entries of a table that is prepared. */
static hs_status
find_entries(hs_pairs *rows, hs_table *table, hs_failure *failure)
{
    hs_search *search = table->search;
    hs_status  status = hs_once_applies(table) ? hs_once_find(table, failure) : HS_TOO_MUCH;
    if (status != HS_TOO_MUCH) {
        return status;
    }
    status = hs_table_measure(table, failure);
    if (status == HS_OK) {
        status = make_room(rows, table->offsets[hs_search_asking(search)->n], failure);
    }
    if (status == HS_OK) {
        status = hs_touch_output(search->call->team, &search->call->options, &rows->output);
    }
    return status == HS_OK ? hs_table_fill(table, failure) : status;
}

/* A hs_fill_fn. */
static hs_status
find_rows(hs_search *search, hs_pairs *rows, hs_failure *failure)
{
    const int64_t n = hs_search_asking(search)->n;
    hs_table      table = {.search = search, .entries = &rows->output};
    hs_output_init(&search->call->account, search->scene.ndim, HS_WANT_I, 8, &rows->offsets);
    hs_status status = hs_estimate_by_sample(search, failure);
    if (status == HS_OK) {
        status = hs_output_reserve(&rows->offsets, n + 1, 0.0);
    }
    if (status == HS_OK) {
        rows->offsets.n_pairs = n + 1;
        table.offsets = hs_output_column(&rows->offsets, HS_WANT_I);
        status = hs_table_prepare(&table, failure);
    }
    if (status == HS_OK && !hs_walker_fits(search, &table.most, &failure->search_bytes)) {
        status = HS_ERR_MEMORY; /* refused before anything is counted */
    }
    if (status == HS_OK) {
        status = find_entries(rows, &table, failure);
    }
    hs_table_free(&table);
    return status;
}

hs_status
hs_neighbors_find(const hs_among *among, const hs_options *options, hs_pairs **result,
                  hs_failure *failure)
{
    if (!hs_can_return(result, options)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options of_rows = options_of_rows(options);
    const hs_request request = hs_request_among(among, HS_FULL_LIST, &of_rows);
    return request.reach != NULL ? hs_by_reach_rows(&request, find_rows, result, failure)
                                 : hs_request_fill(&request, find_rows, result, failure);
}

/* A hs_use_fn. */
static hs_status
count_rows(void *context, hs_search *search, int64_t *n_entries, hs_failure *failure)
{
    const int64_t   n = hs_search_asking(search)->n;
    const int64_t  *counts = context;
    const hs_status status = hs_table_count(search, context, failure);
    for (int64_t i = 0; status == HS_OK && i < n; i++) {
        *n_entries += counts[i];
    }
    return status;
}

hs_status
hs_neighbors_count(const hs_among *among, const hs_options *options, int64_t *counts,
                   hs_failure *failure)
{
    hs_request       request = hs_request_among(among, HS_FULL_LIST, options);
    const hs_sets   *sets = &request.sets;
    const hs_points *asking = sets->queries != NULL ? sets->queries : sets->points;
    if (options == NULL || !hs_has_entries(counts, asking)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options counting = hs_options_of_count(options);
    request.options = &counting;
    return request.reach != NULL ? hs_by_reach_count_rows(&request, count_rows, counts, failure)
                                 : hs_request_use(&request, count_rows, counts, failure);
}
