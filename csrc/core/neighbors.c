/* SPDX-License-Identifier: BSD-3-Clause */
/* neighbors.c: the public searches for all neighbours of each point, or of each query. */
#include "estimate.h"
#include "fpenv.h"
#include "pairs.h"
#include "parallel.h"
#include "poll.h"
#include "table.h"

#include <math.h>

/* Rows have an order of their own. */
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
        failure->expected_bytes = failure->expected_pairs *
                                  (double)hs_output_bytes_per_pair(output);
        return HS_ERR_MEMORY;
    }
    output->n_pairs = n_entries;
    return HS_OK;
}

static hs_status
find_rows(hs_pairs *rows, hs_failure *failure)
{
    hs_search    *search = &rows->search;
    const int64_t n = hs_search_asking(search)->n;
    hs_table      table = {.search = search, .entries = &rows->output};
    hs_status     status = hs_estimate_by_sample(search, failure);
    if (status == HS_OK) {
        status = hs_output_reserve(&rows->offsets, n + 1, 0.0);
    }
    if (status == HS_OK) {
        rows->offsets.n_pairs = n + 1;
        table.offsets = hs_output_column(&rows->offsets, HS_WANT_I);
        status = hs_table_prepare(&table, failure);
    }
    if (status == HS_OK) {
        status = hs_table_measure(&table, failure);
    }
    if (status == HS_OK) {
        status = make_room(rows, table.offsets[n], failure);
    }
    if (status == HS_OK) {
        status = hs_table_fill(&table, failure);
    }
    hs_table_free(&table);
    return status;
}

hs_status
hs_neighbors_find(const hs_points *points, const hs_points *queries, const hs_box *box,
                  const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    const hs_sets sets = {.points = points, .queries = queries, .is_full = true};
    return hs_neighbors_find_in(&sets, box, options, result, failure);
}

hs_status
hs_neighbors_find_in(const hs_sets *sets, const hs_box *box, const hs_options *options,
                     hs_pairs **result, hs_failure *failure)
{
    const hs_options of_rows = options_of_rows(options);
    hs_failure       ignored;
    *result = NULL;
    failure = failure != NULL ? failure : &ignored;
    *failure = HS_NO_FAILURE;
    hs_pairs *rows = hs_pairs_new();
    if (rows == NULL) {
        return HS_ERR_MEMORY;
    }
    hs_search     *search = &rows->search;
    const hs_fpenv saved = hs_fpenv_enter();
    hs_status      status = hs_search_open(sets, box, &of_rows, search, failure);
    if (status == HS_OK) {
        hs_output_init(&search->account, sets->points->ndim, options->want, options->index_bytes,
                       &rows->output);
        hs_output_init(&search->account, sets->points->ndim, HS_WANT_I, 8, &rows->offsets);
        if (options->out != NULL) {
            hs_output_fix(&rows->output, options->out);
        }
        status = find_rows(rows, failure);
        hs_search_report(search, rows->output.n_pairs);
        hs_search_close(search);
    }
    if (status == HS_ERR_MEMORY) {
        hs_shortage_of_search(sets->points, box, search, failure);
    }
    hs_fpenv_leave(saved);
    if (status != HS_OK) {
        hs_pairs_free(rows);
        return status;
    }
    *result = rows;
    return HS_OK;
}

/* A search that only counts; what it does is up to `count`. */
typedef hs_status (*count_fn)(hs_search *search, int64_t *counts, hs_failure *failure);

static hs_status
count_with(const hs_sets *sets, const hs_box *box, const hs_options *options, count_fn count,
           int64_t *counts, hs_failure *failure)
{
    hs_failure ignored;
    hs_options counting = options_of_rows(options);
    hs_search  search;
    failure = failure != NULL ? failure : &ignored;
    *failure = HS_NO_FAILURE;
    counting.want = 0;
    const hs_fpenv saved = hs_fpenv_enter();
    hs_status      status = hs_search_open(sets, box, &counting, &search, failure);
    if (status == HS_OK) {
        status = count(&search, counts, failure);
        hs_search_report(&search, search.walked.pairs);
        hs_search_close(&search);
    }
    if (status == HS_ERR_MEMORY) {
        hs_shortage_of_search(sets->points, box, &search, failure);
    }
    hs_account_close(&search.account);
    hs_fpenv_leave(saved);
    return status;
}

static hs_status
count_rows(hs_search *search, int64_t *counts, hs_failure *failure)
{
    return hs_table_count(search, counts, failure);
}

hs_status
hs_neighbors_count(const hs_points *points, const hs_points *queries, const hs_box *box,
                   const hs_options *options, int64_t *counts, hs_failure *failure)
{
    const hs_sets sets = {.points = points, .queries = queries, .is_full = true};
    return hs_neighbors_count_in(&sets, box, options, counts, failure);
}

hs_status
hs_neighbors_count_in(const hs_sets *sets, const hs_box *box, const hs_options *options,
                      int64_t *counts, hs_failure *failure)
{
    return count_with(sets, box, options, count_rows, counts, failure);
}

hs_status
hs_between_count(const hs_points *points, const hs_points *queries, const hs_box *box,
                 const hs_options *options, int64_t *count, hs_failure *failure)
{
    const hs_sets sets = {.points = points, .queries = queries, .is_full = true};
    return hs_between_count_in(&sets, box, options, count, failure);
}

hs_status
hs_between_count_in(const hs_sets *sets, const hs_box *box, const hs_options *options,
                    int64_t *count, hs_failure *failure)
{
    return count_with(sets, box, options, hs_parallel_count, count, failure);
}

int64_t
hs_pairs_rows(const hs_pairs *pairs)
{
    return pairs->offsets.columns != 0 ? pairs->offsets.n_pairs - 1 : 0;
}

const int64_t *
hs_pairs_offsets(const hs_pairs *pairs)
{
    return hs_output_column(&pairs->offsets, HS_WANT_I);
}

int64_t *
hs_pairs_take_offsets(hs_pairs *pairs)
{
    return hs_output_take(&pairs->offsets, HS_WANT_I);
}
