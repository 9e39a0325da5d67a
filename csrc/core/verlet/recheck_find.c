/* SPDX-License-Identifier: BSD-3-Clause */
/* recheck_find.c: the pairs of the last step from a list that is used for many. */
#include "../collect/sort_pairs.h"
#include "recheck.h"

#include <math.h>
#include <string.h>

/* The columns that are found: those wanted, and what putting them in order needs beside them. */
static unsigned
columns_to_sort(const hs_refilter *refilter)
{
    const bool images = refilter->list->listing.images.n > 0;
    return (refilter->search->options.want & ~(unsigned)HS_WANT_BOTH) | HS_WANT_I | HS_WANT_J |
           (images ? HS_WANT_SHIFT : 0);
}

static hs_status
find_sorted(hs_refilter *refilter, hs_output *output, hs_failure *failure)
{
    hs_search *search = refilter->search;
    hs_output  found;
    hs_output_init(&search->account, refilter->d, columns_to_sort(refilter), 4, &found);
    refilter->output = &found;
    hs_status status = hs_refilter_run(refilter, failure);
    if (status == HS_OK) {
        search->scene.n = refilter->now->points.n; /* what sorting asks of a scene */
        status = hs_sort_pairs(search, &found, output);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)found.n_pairs;
    }
    hs_output_free(&found);
    return status;
}

static hs_status
find_pairs(hs_refilter *refilter, hs_output *output, hs_failure *failure)
{
    hs_search *search = refilter->search;
    hs_status  status;
    if (search->options.sorted) {
        status = find_sorted(refilter, output, failure);
    } else {
        refilter->output = output;
        status = hs_refilter_run(refilter, failure);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = fmax(failure->expected_pairs, (double)output->n_pairs);
        failure->limit_bytes = search->account.limit;
    }
    return hs_pairs_conclude(output, status, failure);
}

/* A search that has everything but a scene. */
static hs_status
open_search(const hs_verlet *list, const hs_options *options, hs_search *search)
{
    const hs_points *points = &list->frames[list->now].points;
    hs_search_begin(options, search);
    search->kernel = hs_kernel_select(options->kernel);
    if (search->kernel == NULL) {
        return HS_ERR_KERNEL;
    }
    search->team = hs_team_create(hs_search_threads(points->n, options));
    return HS_OK;
}

static void
set_refilter(const hs_verlet *list, hs_search *search, hs_refilter *refilter)
{
    const hs_frame *now = &list->frames[list->now];
    double          rows[HS_MAX_DIM][HS_MAX_DIM];
    memset(refilter, 0, sizeof *refilter);
    refilter->list = list;
    refilter->now = now;
    refilter->search = search;
    refilter->d = now->points.ndim;
    refilter->m = hs_frame_periodic(now, refilter->vector_of_row);
    refilter->measures = search->options.want & (HS_WANT_DISTANCE | HS_WANT_VECTOR);
    for (int r = 0; r < refilter->m; r++) {
        memcpy(rows[r], now->box.rows[refilter->vector_of_row[r]], sizeof rows[r]);
    }
    hs_metric_init(&refilter->given, refilter->d, refilter->m,
                   (const double(*)[HS_MAX_DIM])rows, list->cutoff, search->options.inclusive);
}

hs_status
hs_recheck_find(const hs_verlet *list, const hs_options *options, hs_pairs *pairs,
                hs_failure *failure)
{
    hs_refilter refilter;
    hs_search  *search = &pairs->search;
    hs_output  *output = &pairs->output;
    hs_status   status = open_search(list, options, search);
    hs_output_init(&search->account, list->frames[list->now].points.ndim, options->want,
                   options->index_bytes, output);
    if (status == HS_OK) {
        set_refilter(list, search, &refilter);
        if (options->out != NULL) {
            hs_output_fix(output, options->out);
        }
        status = find_pairs(&refilter, output, failure);
    }
    hs_search_report(search, output->n_pairs);
    hs_search_close(search);
    return status;
}
