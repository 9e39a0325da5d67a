/* SPDX-License-Identifier: BSD-3-Clause */
/* api_systems_rows.c: the public searches of many systems whose results are rows, counts of rows,
 * and histograms. */
#include "systems_each.h"

#include "request.h"
#include "systems_check.h"
#include "../base/starts.h"

/* Where what is found goes besides the pairs. */
typedef struct rows_job {
    int64_t             k;       /* of the nearest; 0: all neighbours */
    int64_t            *offsets; /* of all rows; each length goes to the entry behind it */
    int64_t            *counts;  /* of all rows; NULL: there is a histogram */
    const hs_histogram *histogram;
} rows_job;

/* A hs_system_fn. */
static hs_status
find_neighbors(void *context, const hs_system_part *part, const hs_options *options,
               hs_pairs **pairs, hs_failure *failure)
{
    const rows_job *job = context;
    const hs_status status = hs_neighbors_find(&part->among, options, pairs, failure);
    if (status == HS_OK) {
        const int64_t *offsets = hs_pairs_offsets(*pairs), n = hs_pairs_rows(*pairs);
        for (int64_t i = 0; i < n; i++) {
            job->offsets[part->first_asking + i + 1] = offsets[i + 1] - offsets[i];
        }
    }
    return status;
}

/* A hs_system_fn. */
static hs_status
count_neighbors(void *context, const hs_system_part *part, const hs_options *options,
                hs_pairs **pairs, hs_failure *failure)
{
    const rows_job *job = context;
    (void)pairs;
    return hs_neighbors_count(&part->among, options, job->counts + part->first_asking, failure);
}

/* A hs_system_fn. */
static hs_status
find_nearest(void *context, const hs_system_part *part, const hs_options *options, hs_pairs **pairs,
             hs_failure *failure)
{
    const rows_job *job = context;
    return hs_nearest_find(&part->among, job->k, options, pairs, failure);
}

static hs_marks
marks_from(hs_marks marks, int64_t first)
{
    marks.types = marks.types != NULL ? marks.types + first : NULL;
    marks.weights = marks.weights != NULL ? marks.weights + first : NULL;
    return marks;
}

/* A hs_system_fn. */
static hs_status
count_by_distance(void *context, const hs_system_part *part, const hs_options *options,
                  hs_pairs **pairs, hs_failure *failure)
{
    const rows_job     *job = context;
    const hs_histogram *all = job->histogram;
    const int64_t       at = part->system * all->n_edges * all->n_types * all->n_types;
    hs_histogram        own = *all;
    (void)pairs;
    own.of_points = marks_from(own.of_points, part->first_point);
    own.of_queries = marks_from(own.of_queries, part->first_asking);
    own.counts = own.counts != NULL ? own.counts + at : NULL;
    own.sums = own.sums != NULL ? own.sums + at : NULL;
    return hs_pairs_histogram(&part->among, options, &own, failure);
}

static int64_t
number_asking(const hs_system_sets *sets)
{
    return sets->queries != NULL ? sets->queries->n : sets->points->n;
}

/* The largest distance of nearest points, which may be infinite. */
static hs_status
check_radius(const hs_system_sets *sets, const hs_options *options, hs_failure *failure)
{
    if (sets->systems->cutoffs != NULL || options->cutoff >= 0.0) {
        return HS_OK;
    }
    failure->value = options->cutoff;
    return HS_ERR_CUTOFF;
}

/* What a search that keeps pairs returns, from the check that it can to the end. */
static hs_status
find_rows(const hs_system_sets *sets, hs_system_fn search, int64_t k, const hs_options *options,
          hs_pairs **result, hs_failure *failure)
{
    hs_pairs *rows = hs_pairs_begin(options, &failure);
    if (rows == NULL) {
        return HS_ERR_MEMORY;
    }
    rows_job        job = {.k = k};
    hs_systems_each each = {.sets = *sets,
                            .search = search,
                            .context = &job,
                            .has_limit = k == 0,
                            .output = &rows->output};
    hs_status       status = hs_systems_check(sets, &rows->call, failure);
    if (status == HS_OK) {
        hs_pairs_open(rows, sets->points->ndim);
        status = k > 0 ? check_radius(sets, options, failure)
                       : hs_pairs_open_offsets(&rows->call.account, number_asking(sets) + 1, rows,
                                               &job.offsets);
    }
    if (status == HS_OK) {
        status = hs_systems_do_each(&each, &rows->call, failure);
    }
    if (status == HS_OK && k == 0) {
        job.offsets[0] = 0;
        hs_starts_of_lengths(job.offsets, number_asking(sets) + 1);
    }
    status = hs_pairs_conclude(&rows->output, status, failure);
    return hs_pairs_finish(rows, status, rows->output.n_pairs, result);
}

hs_status
hs_systems_neighbors(const hs_points *points, const hs_points *queries, const hs_systems *systems,
                     const hs_options *options, hs_pairs **rows, hs_failure *failure)
{
    const hs_system_sets sets = {points, queries, systems};
    if (!hs_can_return(rows, options)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_options of_rows = *options;
    of_rows.sorted = false;
    return find_rows(&sets, find_neighbors, 0, &of_rows, rows, failure);
}

/* What the nearest points are not found among: those within a reach, or of a selection. */
static bool
is_selective(const hs_systems *systems)
{
    return systems != NULL && (systems->reach != NULL || systems->selection != NULL);
}

hs_status
hs_systems_nearest(const hs_points *points, const hs_points *queries, const hs_systems *systems,
                   int64_t k, const hs_options *options, hs_pairs **rows, hs_failure *failure)
{
    const hs_system_sets sets = {points, queries, systems};
    if (!hs_can_return(rows, options) || k < 1 || is_selective(systems)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options of_rows = hs_options_of_nearest(options);
    return find_rows(&sets, find_nearest, k, &of_rows, rows, failure);
}

/* The histogram of each system; with 2^31 entries the counts of all might pass int64. */
static hs_status
check_histogram(const hs_histogram *histogram, hs_failure *failure)
{
    const hs_status status = hs_check_histogram(histogram, failure);
    if (status != HS_OK) {
        return status;
    }
    const double n = (double)histogram->n_types;
    return n * n * (double)histogram->n_edges < 0x1p31 ? HS_OK : HS_ERR_MEMORY;
}

/* A search that keeps none. */
static hs_status
count_rows(const hs_systems_each *each, const hs_options *options, hs_failure *failure)
{
    const rows_job  *job = each->context;
    hs_call          call;
    hs_status        status = HS_OK;
    const hs_options counting = hs_options_of_count(options);
    failure = hs_call_enter(&counting, failure, &call);
    if (job->counts == NULL) {
        status = check_histogram(job->histogram, failure);
    }
    if (status == HS_OK) {
        status = hs_systems_do_each(each, &call, failure);
    }
    hs_call_leave(&call, call.done.pairs);
    hs_account_close(&call.account);
    return status;
}

hs_status
hs_systems_coordination(const hs_points *points, const hs_points *queries,
                        const hs_systems *systems, const hs_options *options, int64_t *counts,
                        hs_failure *failure)
{
    int64_t         none; /* where there are no points, there may be no counts */
    rows_job        job = {.counts = counts != NULL ? counts : &none};
    hs_systems_each each = {.sets = {points, queries, systems},
                            .search = count_neighbors,
                            .context = &job,
                            .has_limit = true};
    if (options == NULL || !hs_has_entries(counts, queries != NULL ? queries : points)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    return count_rows(&each, options, failure);
}

hs_status
hs_systems_histogram(const hs_points *points, const hs_points *queries, const hs_systems *systems,
                     const hs_options *options, const hs_histogram *histogram, hs_failure *failure)
{
    rows_job        job = {.histogram = histogram};
    hs_systems_each each = {
        .sets = {points, queries, systems}, .search = count_by_distance, .context = &job};
    if (options == NULL || (systems != NULL && systems->reach != NULL)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_options of_search = *options;
    of_search.precision = HS_EXACT;
    return count_rows(&each, &of_search, failure);
}
