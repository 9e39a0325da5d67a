/* SPDX-License-Identifier: BSD-3-Clause */
#include "query.h"
#include "../collect/sort_pairs.h"
#include "../rows/table.h"
#include "../histogram/histogram.h"

#include <math.h>
#include <string.h>

/* pairs.c: the public searches of one call: pairs, rows, nearest points, histograms and plans. */

/* ---- the steps of a plan: their pairs recorded, or counted ----------------------------------- */

/* A hs_use_fn: pairs of the step that is open, behind those of an output; NULL: that of the run. */
static hs_status
record_step(void *context, hs_query_run *run)
{
    hs_output      *output = context != NULL ? context : run->output;
    const hs_status status = hs_estimate_by_sample(run->search, run->failure);
    return status == HS_OK ? hs_parallel_record(run->search, run->keeper, output, run->failure)
                           : status;
}

/* A hs_use_fn: the number of pairs, each once; with queries, of all neighbours of each. */
static hs_status
count_step(void *context, hs_query_run *run)
{
    (void)context;
    return hs_parallel_count(run->search, run->keeper, &run->n_pairs, run->failure);
}

/* A hs_use_fn; context: a count of each system. */
static hs_status
count_pairs(void *context, hs_query_run *run)
{
    int64_t        *counts = context;
    const int64_t   before = run->n_pairs;
    const hs_status status = hs_query_each_step(run, count_step, NULL);
    if (status == HS_OK) {
        counts[run->system] = run->n_pairs - before;
    }
    return status;
}

hs_status
hs_pairs_count(const hs_among *among, const hs_options *options, int64_t *count,
               hs_failure *failure)
{
    const hs_finder finder = {.find = count_pairs, .context = count};
    hs_query        query = hs_query_among(among, HS_HALF_OR_QUERIES, options);
    hs_query_want_none(&query);
    query.is_incomplete |= count == NULL;
    return hs_query_answer(&query, &finder, NULL, failure);
}

/* ---- pairs, and rows of all neighbours of each point or query -------------------------------- */

/* A hs_use_fn: the rows of a single step. */
static hs_status
fill_rows(void *context, hs_query_run *run)
{
    (void)context;
    return hs_table_find(run->search, run->output, run->offsets, run->failure);
}

/* A hs_use_fn; counts those of a single step, to an array of all rows. */
static hs_status
count_rows_of_step(void *context, hs_query_run *run)
{
    return hs_table_count(run->search, (int64_t *)context + run->first_asking, run->failure);
}

/* Rows of several steps are made of their pairs in ascending order: where the rule is the same both
 * ways, each pair is in two of them. */

/* Whether a point meets itself: in rows of one set that are not made of a half list. */
static bool
meets_itself(const hs_query_run *run)
{
    return run->has_levels && !run->levels.has_queries && !run->plan.is_half;
}

/* Whether rows are those of a single step. It goes over all points twice: where pairs have limits
 * by radii, whose scans take long, sorting them is quicker. */
static bool
is_single(const hs_query_run *run)
{
    const hs_levels  *levels = &run->levels;
    const hs_options *options = &run->call->options;
    if (!run->has_levels) {
        return true;
    }
    if (!hs_level_plan_is_single(&run->plan) || meets_itself(run)) {
        return false;
    }
    if (!run->plan.steps[0].has_limits || (levels->cutoffs != NULL && levels->has_queries)) {
        return true;
    }
    /* The rows of one search count on each point being within its limit of itself. */
    bool has_selves = options->inclusive && options->precision == HS_EXACT;
    for (int32_t l = 0; levels->cutoffs != NULL && l < levels->n; l++) {
        has_selves = has_selves && levels->cutoffs[l * levels->n + l] >= 0.0;
    }
    return levels->cutoffs != NULL && has_selves;
}

/* Columns that put pairs of several steps in order and have all that is wanted: S where two points
 * may be a pair in several images, or one with itself. Twice the cutoff is shorter than any period
 * where not, by far more than rounding errors. Without a reach there are many systems, and what is
 * kept from one to the next is for the same columns: S for all of them. */
static unsigned
columns_of(const hs_query_run *run)
{
    unsigned columns = (run->call->options.want & ~(unsigned)HS_WANT_BOTH) | HS_WANT_I | HS_WANT_J;
    if (!run->has_levels) {
        return columns | HS_WANT_SHIFT;
    }
    hs_lattice lattice;
    double     cutoff = 0.0;
    for (int64_t s = 0; s < run->plan.n; s++) {
        cutoff = hs_larger(run->plan.steps[s].cutoff, cutoff);
    }
    hs_lattice_init(run->query->box, run->levels.points.ndim, hs_scale_of(0), &lattice);
    for (int k = 0; k < lattice.ndim; k++) {
        if (lattice.row_of_axis[k] >= 0 && !(2.1 * cutoff < lattice.period[k])) {
            columns |= HS_WANT_SHIFT;
        }
    }
    return columns;
}

/* Pairs of all steps, in an output that is opened; without (i, i, S = 0). */
static hs_status
find_all(hs_query_run *run, unsigned columns, hs_output *found)
{
    hs_output_init(&run->call->account, run->query->sets.points->ndim, columns, 4, found);
    const hs_status status = hs_query_each_step(run, record_step, found);
    const int32_t  *i = hs_output_column(found, HS_WANT_I), *j = hs_output_column(found, HS_WANT_J);
    const int32_t  *shift = hs_output_column(found, HS_WANT_SHIFT);
    int64_t         kept = 0;
    if (status != HS_OK || !meets_itself(run)) {
        return status;
    }
    for (int64_t e = 0; e < found->n_pairs; e++) {
        bool is_self = i[e] == j[e];
        for (int k = 0; is_self && shift != NULL && k < found->ndim; k++) {
            is_self = shift[e * found->ndim + k] == 0;
        }
        for (unsigned bit = HS_WANT_I; !is_self && bit <= HS_WANT_SHIFT; bit <<= 1) {
            char        *column = hs_output_column(found, bit);
            const size_t width = column != NULL ? hs_output_width(found, bit) : 0;
            if (column != NULL) {
                memmove(column + (size_t)kept * width, column + (size_t)e * width, width);
            }
        }
        kept += !is_self;
    }
    found->n_pairs = kept;
    return HS_OK;
}

/* Writes the pairs of all steps in ascending order; as rows, in both of its rows a pair that was
 * found once. */
static hs_status
find_in_order(hs_query_run *run)
{
    const int64_t n = hs_query_asking(run->query);
    const bool    has_rows = run->finder->has_rows, both_ways = has_rows && run->plan.is_half;
    int64_t      *offsets = NULL;
    hs_output     found;
    hs_status     status = find_all(run, columns_of(run), &found);
    if (status == HS_OK && both_ways && (run->call->options.want & HS_WANT_SHIFT)) {
        status = hs_output_check_opposites(&found, run->failure);
    }
    if (status == HS_OK && has_rows) {
        status = hs_output_open_offsets(&run->call->account, n + 1, run->offsets, &offsets);
    }
    if (status == HS_OK) {
        /* In rows of systems numbers are added afterwards. */
        const int32_t first = has_rows ? 0 : (int32_t)run->first_point;
        status = hs_sort_pairs(run->call, first, n, &found, both_ways, offsets, run->output);
    }
    if (status == HS_ERR_MEMORY) {
        run->failure->expected_pairs =
            fmax(run->failure->expected_pairs, (both_ways ? 2.0 : 1.0) * (double)found.n_pairs);
    }
    hs_output_free(&found);
    return status;
}

/* A hs_use_fn. */
static hs_status
find_rows(void *context, hs_query_run *run)
{
    if (!is_single(run)) {
        return find_in_order(run);
    }
    run->plan.is_half = false; /* all neighbours of each point */
    return hs_query_each_step(run, fill_rows, context);
}

/* A hs_use_fn. */
static hs_status
find_pairs(void *context, hs_query_run *run)
{
    (void)context;
    if (run->query->sets.is_once) { /* rows that list each pair once, without their beginnings */
        const hs_status status = hs_query_each_step(run, fill_rows, NULL);
        hs_output_free(run->offsets);
        return status;
    }
    return run->call->options.sorted ? find_in_order(run)
                                     : hs_query_each_step(run, record_step, NULL);
}

hs_status
hs_pairs_find(const hs_among *among, const hs_options *options, hs_pairs **result,
              hs_failure *failure)
{
    const hs_finder finder = {.find = find_pairs, .has_result = true, .is_numbered = true};
    hs_query        query = hs_query_among(among, HS_HALF_LIST, options);
    if (query.options.sorted && query.reach == NULL && query.among == NULL) {
        query.sets.is_full = query.sets.is_once = true;
        query.options.sorted = false; /* table rows have an order of their own */
    }
    return hs_query_answer(&query, &finder, result, failure);
}

hs_status
hs_neighbors_find(const hs_among *among, const hs_options *options, hs_pairs **result,
                  hs_failure *failure)
{
    const hs_finder finder = {.find = find_rows, .has_result = true, .has_rows = true};
    hs_query        query = hs_query_among(among, HS_FULL_LIST, options);
    query.options.sorted = false; /* table rows have an order of their own */
    return hs_query_answer(&query, &finder, result, failure);
}

/* A hs_use_fn; context: a count of each row, of all systems. */
static hs_status
count_rows(void *context, hs_query_run *run)
{
    int64_t      *counts = (int64_t *)context + run->first_asking;
    const int64_t n = hs_query_asking(run->query);
    hs_status     status;
    if (is_single(run)) {
        run->plan.is_half = false;
        status = hs_query_each_step(run, count_rows_of_step, context);
    } else {
        hs_output found;
        status = find_all(run, meets_itself(run) ? columns_of(run) : HS_WANT_I | HS_WANT_J, &found);
        const int32_t *i = hs_output_column(&found, HS_WANT_I);
        const int32_t *j = hs_output_column(&found, HS_WANT_J);
        memset(counts, 0, (size_t)n * sizeof *counts);
        for (int64_t e = 0; status == HS_OK && e < found.n_pairs; e++) {
            counts[i[e]]++;
        }
        for (int64_t e = 0; status == HS_OK && run->plan.is_half && e < found.n_pairs; e++) {
            counts[j[e]]++;
        }
        hs_output_free(&found);
    }
    for (int64_t row = 0; status == HS_OK && row < n; row++) {
        run->n_pairs += counts[row];
    }
    return status;
}

hs_status
hs_neighbors_count(const hs_among *among, const hs_options *options, int64_t *counts,
                   hs_failure *failure)
{
    int64_t         none; /* where there are no points, there may be no counts */
    const hs_finder finder = {.find = count_rows, .context = counts != NULL ? counts : &none};
    hs_query        query = hs_query_among(among, HS_FULL_LIST, options);
    const hs_sets  *sets = &query.sets;
    hs_query_want_none(&query);
    query.is_incomplete |=
        !hs_has_entries(counts, sets->queries != NULL ? sets->queries : sets->points);
    return hs_query_answer(&query, &finder, NULL, failure);
}

/* ---- the k nearest points: prepares trees, then searches group by group ---------------------- */

/* A hs_use_fn; context: k. */
static hs_status
find_nearest(void *context, hs_query_run *run)
{
    const int64_t *k = context;
    hs_search     *search = &run->step.search;
    hs_failure    *failure = run->failure;
    hs_sets        sets = run->query->sets;
    const double   limit = run->call->options.cutoff;
    const int64_t  n_asking = hs_query_asking(run->query);
    const double   n = (double)n_asking * (double)*k;
    sets.is_plain = sets.is_wide = true;
    hs_search_begin(run->call, search);
    hs_nearest near = {
        .search = search, .k = *k, .omits_self = sets.queries == NULL, .rows = run->output};
    hs_status status = HS_OK;
    if (n < 0x1p62 && hs_output_reserve(near.rows, n_asking * near.k, 0.0) == HS_OK) {
        near.rows->n_pairs = n_asking * near.k;
    } else {
        failure->expected_pairs = n;
        failure->expected_bytes = n * (double)hs_output_bytes_per_pair(near.rows);
        status = HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        status = hs_nearest_prepare(&near, &sets, run->query->box, limit, failure);
    }
    if (status == HS_OK) { /* rows are written in the order of the tree */
        status = hs_touch_output(run->call->team, &run->call->options, near.rows);
    }
    if (status == HS_OK) {
        status = hs_nearest_search(&near, failure);
    }
    hs_nearest_release(&near);
    hs_search_close(search);
    return status;
}

hs_status
hs_nearest_find(const hs_among *among, int64_t k, const hs_options *options, hs_pairs **result,
                hs_failure *failure)
{
    const hs_finder finder = {
        .find = find_nearest, .context = &k, .has_result = true, .is_nearest = true};
    hs_query query = hs_query_among(among, HS_FULL_LIST, options);
    query.is_incomplete |= k < 1;
    query.options.sorted = false;
    query.options.out = NULL;
    query.options.precision = HS_EXACT;
    query.is_by_length = false;
    query.options.want &= HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT;
    return hs_query_answer(&query, &finder, result, failure);
}

/* ---- the histogram of all pairs, which stores none of them ----------------------------------- */

/* A hs_use_fn; context: the histogram. */
static hs_status
fill_histogram(void *context, hs_query_run *run)
{
    return hs_histogram_fill(run->search, context, &run->query->sets, &run->n_pairs, run->failure);
}

/* A hs_use_fn; context: the histograms of all systems, one behind the other. */
static hs_status
find_histogram(void *context, hs_query_run *run)
{
    hs_histogram  own = *(const hs_histogram *)context;
    const int64_t at = run->system * own.n_edges * own.n_types * own.n_types;
    own.counts = own.counts != NULL ? own.counts + at : NULL;
    own.sums = own.sums != NULL ? own.sums + at : NULL;
    return hs_query_each_step(run, fill_histogram, &own);
}

hs_status
hs_pairs_histogram(const hs_among *among, const hs_options *options, const hs_histogram *histogram,
                   hs_failure *failure)
{
    const hs_finder finder = {.find = find_histogram, .context = (void *)(uintptr_t)histogram};
    hs_query        query = hs_query_among(among, HS_HALF_OR_QUERIES, options);
    if (query.is_incomplete || histogram == NULL || histogram->edges == NULL ||
        histogram->n_types < 1 || query.reach != NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    const double *const edges = histogram->edges;
    const int64_t       n_edges = histogram->n_edges;
    const bool          has_edges = n_edges > 0 && n_edges < HS_MOST_LENGTHS; /* else refused */
    const double        n = (double)histogram->n_types;
    if (query.among != NULL && has_edges && !(n * n * (double)n_edges < 0x1p31)) {
        return hs_end_early(HS_ERR_MEMORY, options, failure); /* counts might pass int64 */
    }
    hs_query_want_none(&query);
    query.sets.keeps_none = true;
    query.is_by_length = true;
    query.options.shells = edges;
    query.options.n_shells = n_edges;
    query.options.cutoff = has_edges ? edges[n_edges - 1] : 0.0;
    query.options.inclusive = histogram->last_inclusive;
    query.options.precision = HS_EXACT;
    return hs_query_answer(&query, &finder, NULL, failure);
}

/* ---- plans: what a search would do, read from the structures that would do it ---------------- */

/* A plan while searches are added to it. */
typedef struct planning {
    hs_plan plan;
    double  largest; /* reach of a search so far */
} planning;

/* A hs_use_fn: adds a search to the plan, which is about the one with the largest reach. */
static hs_status
plan_step(void *context, hs_query_run *run)
{
    planning       *now = context;
    hs_plan        *plan = &now->plan;
    const double    cutoff = run->call->options.cutoff;
    const hs_scene *scene = &run->search->scene;
    const hs_grid  *grid = &run->search->grid;
    const double    unscale = hs_scale_apply(scene->unscale, 1.0);
    double          expected;
    const hs_status status = hs_estimate_pairs(run->search, &expected);
    if (plan->n_searches == 0 || cutoff > now->largest) {
        now->largest = cutoff;
        *plan = (hs_plan){.ndim = scene->ndim,
                          .n_periodic = scene->lattice.n_periodic,
                          .aligned = scene->lattice.aligned,
                          .reduced = scene->lattice.reduced,
                          .keeps_originals = run->search->bins.keeps_originals,
                          .algorithm = run->search->is_sparse ? HS_HASH
                                       : grid->n_cells == 1   ? HS_ALL_PAIRS
                                                              : HS_GRID,
                          .all_pairs = grid->n_cells == 1,
                          .sparse = run->search->is_sparse,
                          .n_cells = grid->n_cells,
                          .stencil_rows = run->search->stencil.n_rows,
                          .threads = hs_team_size(run->call->team),
                          .kernel = run->call->kernel->name,
                          .n_searches = plan->n_searches,
                          .expected_pairs = plan->expected_pairs};
        for (int k = 0; k < scene->ndim; k++) {
            plan->shape[k] = grid->shape[k];
            plan->cell_size[k] = grid->cell_size[k] * unscale;
            plan->reach[k] = grid->reach[k];
            plan->images[k] = scene->lattice.row_of_axis[k] >= 0
                                  ? (grid->reach[k] + grid->shape[k] - 1) / grid->shape[k]
                                  : 0;
        }
    }
    plan->n_searches++;
    plan->expected_pairs += expected;
    return status;
}

hs_status
hs_plan_make(const hs_among *among, const hs_options *options, hs_plan *plan, hs_failure *failure)
{
    planning        now = {.largest = 0.0};
    hs_plan *const  made = &now.plan;
    const hs_finder finder = {.step = plan_step, .context = &now};
    hs_query        query = hs_query_among(among, HS_HALF_LIST, options);
    query.is_incomplete |= plan == NULL || query.selection != NULL || query.among != NULL;
    hs_status status = hs_query_answer(&query, &finder, NULL, failure);
    if (status == HS_OK && made->n_searches == 0) {
        /* Where no two points can be a pair: what the cells would be for a cutoff of 0. */
        query.options.cutoff = 0.0;
        query.reach = NULL;
        status = hs_query_answer(&query, &finder, NULL, failure);
        made->n_searches = 0;
        made->expected_pairs = 0.0;
    }
    if (query.options.algorithm != HS_AUTO) {
        made->algorithm = query.options.algorithm;
    } else if (made->n_searches > 1) {
        made->algorithm = HS_HIERARCHY;
    }
    if (status == HS_OK) {
        *plan = *made;
    }
    return status;
}
