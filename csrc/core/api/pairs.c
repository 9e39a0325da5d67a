/* SPDX-License-Identifier: BSD-3-Clause */
#include "request.h"
#include "../base/status.h"
#include "by_reach.h"
#include "../collect/parallel.h"
#include "../collect/sort_pairs.h"
#include "../search/walk.h"
#include "../rows/table.h"
#include "../nearest/nearest.h"
#include "../search/choice.h"
#include "../histogram/histogram.h"
#include "stream.h"
#include "systems.h"
#include "../collect/components.h"

#include <math.h>

/* pairs.c: the public searches of one call: pairs, rows, nearest points, histograms, clusters and
 * plans. */

/* The public searches: find and count. */

hs_options
hs_options_default(void)
{
    return (hs_options){.inclusive = true,
                        .want = HS_WANT_I | HS_WANT_J,
                        .index_bytes = 8,
                        .threads = 1,
                        .memory_limit = INFINITY};
}

/* Writes all pairs sorted. They are found in an output of their own, with the columns that sorting
 * needs besides. */
static hs_status
sort_pairs(hs_search *search, hs_output *output, hs_failure *failure)
{
    hs_output found;
    hs_output_init(&search->call->account, search->scene.ndim, hs_sort_columns(search), 4, &found);
    hs_status status = hs_parallel_record_all(search, &found, failure);
    if (status == HS_OK) {
        status = hs_sort_pairs(search->call, search->first_point, search->scene.n, &found, output);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)found.n_pairs;
    }
    hs_output_free(&found);
    return status;
}

/* A hs_fill_fn. */
static hs_status
fill_pairs(hs_search *search, hs_pairs *pairs, hs_failure *failure)
{
    hs_output *output = &pairs->output;
    hs_status  status = hs_estimate_by_sample(search, failure);
    if (status != HS_OK) {
        return status;
    }
    if (search->call->options.sorted) {
        status = sort_pairs(search, output, failure);
    } else {
        status = hs_parallel_record_all(search, output, failure);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = fmax(failure->expected_pairs, (double)output->n_pairs);
    }
    return hs_pairs_conclude(output, status, failure);
}

hs_status
hs_pairs_find(const hs_among *among, const hs_options *options, hs_pairs **result,
              hs_failure *failure)
{
    const hs_request request = hs_request_among(among, HS_HALF_LIST, options);
    if (!hs_can_return(result, options)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    if (hs_has_systems(among)) {
        return hs_systems_pairs(among, options, result, failure);
    }
    return request.reach != NULL ? hs_by_reach_pairs(&request, result, failure)
                                 : hs_request_fill(&request, fill_pairs, result, failure);
}

/* A hs_use_fn: adds the number of pairs, each once; with queries, of all neighbours of each. */
static hs_status
count_pairs(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    const hs_status status = hs_parallel_count(search, n_pairs, failure);
    if (status == HS_OK) {
        *(int64_t *)context += *n_pairs;
    }
    return status;
}

hs_status
hs_pairs_count(const hs_among *among, const hs_options *options, int64_t *count,
               hs_failure *failure)
{
    if (count == NULL || options == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options counting = hs_options_of_count(options);
    if (hs_has_systems(among)) {
        return hs_systems_count(among, &counting, count, failure);
    }
    const hs_request request = hs_request_among(among, HS_HALF_OR_QUERIES, &counting);
    int64_t          n_pairs = 0;
    const hs_status  status = hs_by_reach_each_step(&request, count_pairs, &n_pairs, failure);
    *count = status == HS_OK ? n_pairs : *count;
    return status;
}

/* The public searches for all neighbours of each point, or of each query. */

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
make_rows_room(hs_pairs *rows, int64_t n_entries, hs_failure *failure)
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
    hs_status  status = hs_table_takes_one_walk(table) ? hs_table_find_in_one_walk(table, failure)
                                                       : HS_TRY_OTHER;
    if (status != HS_TRY_OTHER) {
        return status;
    }
    status = hs_table_measure(table, failure);
    if (status == HS_OK) {
        status = make_rows_room(rows, table->offsets[hs_search_asking(search)->n], failure);
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
    if (hs_has_systems(among)) {
        return hs_systems_neighbors(among, &of_rows, result, failure);
    }
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
    if (options == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options counting = hs_options_of_count(options);
    if (hs_has_systems(among)) {
        return hs_systems_neighbors_count(among, &counting, counts, failure);
    }
    const hs_request request = hs_request_among(among, HS_FULL_LIST, &counting);
    const hs_sets   *sets = &request.sets;
    if (!hs_has_entries(counts, sets->queries != NULL ? sets->queries : sets->points)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    return request.reach != NULL ? hs_by_reach_count_rows(&request, count_rows, counts, failure)
                                 : hs_request_use(&request, count_rows, counts, failure);
}

/* The public search for the k nearest points: prepares trees, then searches group by
 * group. */

/* Room for k entries for each asking point. */
static hs_status
make_nearest_room(hs_nearest *near, int64_t n_asking, hs_failure *failure)
{
    const double n = (double)n_asking * (double)near->k;
    if (n < 0x1p62 && hs_output_reserve(near->rows, n_asking * near->k, 0.0) == HS_OK) {
        near->rows->n_pairs = n_asking * near->k;
        return HS_OK;
    }
    failure->expected_pairs = n;
    failure->expected_bytes = n * (double)hs_output_bytes_per_pair(near->rows);
    failure->limit_bytes = near->search->call->account.limit;
    return HS_ERR_MEMORY;
}

static hs_status
find_nearest(hs_nearest *near, const hs_request *request, hs_failure *failure)
{
    const hs_sets *sets = &request->sets;
    hs_search     *search = near->search;
    const int64_t  n_asking = sets->queries != NULL ? sets->queries->n : sets->points->n;
    const double   limit = search->call->options.cutoff;
    hs_status      status = make_nearest_room(near, n_asking, failure);
    if (status == HS_OK) {
        status = hs_choice_of_request(request, limit, search->call, failure);
    }
    if (status == HS_OK) {
        status = hs_nearest_prepare(near, sets, request->box, limit, failure);
    }
    if (status == HS_OK) { /* rows are written in the order of the tree */
        status = hs_touch_output(search->call->team, &search->call->options, near->rows);
    }
    if (status == HS_OK) {
        status = hs_nearest_search(near, failure);
    }
    hs_call_tell_limit(search->call, status, failure);
    hs_nearest_release(near);
    hs_search_close(search);
    hs_choice_close(search->call);
    return status;
}

static hs_status
check_nearest(const hs_sets *sets, const hs_box *box, int64_t k, const hs_options *options,
              hs_failure *failure)
{
    const hs_status status = hs_check_arguments(sets->points, sets->queries, box, options, failure);
    if (status != HS_OK || k < 1) {
        return status != HS_OK ? status : HS_ERR_ARGUMENT;
    }
    if (!(options->cutoff >= 0.0)) {
        failure->value = options->cutoff;
        return HS_ERR_CUTOFF;
    }
    return HS_OK;
}

hs_status
hs_nearest_find(const hs_among *among, int64_t k, const hs_options *options, hs_pairs **result,
                hs_failure *failure)
{
    hs_search  search;
    hs_request request = hs_request_among(among, HS_FULL_LIST, options);
    hs_sets   *sets = &request.sets;
    if (!hs_can_return(result, options)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options of_rows = hs_options_of_nearest(options);
    if (hs_has_systems(among)) {
        return hs_systems_nearest(among, k, &of_rows, result, failure);
    }
    sets->is_plain = sets->is_wide = true;
    hs_pairs *rows = hs_pairs_begin(&of_rows, &failure);
    if (rows == NULL) {
        return HS_ERR_MEMORY;
    }
    hs_search_begin(&rows->call, &search);
    hs_nearest near = {.search = &search,
                       .k = k,
                       .of_spot = k < INT32_MAX - 1 && request.selection == NULL ? (int32_t)k + 1
                                                                                 : INT32_MAX,
                       .omits_self = sets->queries == NULL,
                       .rows = &rows->output};
    hs_status  status = request.reach == NULL
                            ? check_nearest(sets, request.box, k, &of_rows, failure)
                            : HS_ERR_ARGUMENT; /* which this search does not know */
    if (status == HS_OK) {
        hs_pairs_open(rows, sets->points->ndim);
        status = find_nearest(&near, &request, failure);
    }
    return hs_pairs_finish(rows, status, rows->output.n_pairs, result);
}

/* The public histogram of all pairs, which stores none of them. */

/* What the threads share. */
typedef struct counting {
    hs_search          *search;
    const hs_histogram *histogram;
    const hs_sets      *sets;
    hs_tally_plan       plan;
} counting;

/* What all threads have counted of one group, to entry `to` and on. Returns their number. */
static int64_t
write_group(const hs_tally *tallies, int n, int64_t group, int64_t to,
            const hs_histogram *histogram)
{
    int64_t all = 0;
    for (int64_t k = 0; k < histogram->n_edges; k++) {
        int64_t count = 0;
        for (int w = 0; w < n; w++) {
            count += hs_tally_count(&tallies[w], group, k);
        }
        if (histogram->counts != NULL) {
            histogram->counts[to + k] = count;
        }
        if (histogram->sums != NULL) {
            histogram->sums[to + k] =
                hs_sums_round(&tallies[0].sums, group * (histogram->n_edges + 1) + k);
        }
        all += count;
    }
    return all;
}

/* Returns the number of pairs. */
static int64_t
write_histogram(const counting *shared, hs_tally *tallies, int n)
{
    const hs_tally_plan *plan = &shared->plan;
    const hs_histogram  *histogram = shared->histogram;
    const bool           is_symmetric = !shared->search->has_queries;
    const int64_t        n_types = plan->n_types;
    int64_t              n_pairs = 0;
    for (int w = 1; w < n && plan->sums; w++) {
        hs_sums_join(&tallies[0].sums, &tallies[w].sums);
    }
    if (plan->sums) {
        hs_sums_carry(&tallies[0].sums);
    }
    for (int64_t a = 0; a < n_types; a++) {
        for (int64_t b = 0; b < n_types; b++) {
            const int64_t at = a * n_types + b, group = plan->has_types ? plan->group[at] : 0;
            const int64_t found =
                write_group(tallies, n, group, at * histogram->n_edges, histogram);
            n_pairs += is_symmetric && b < a ? 0 : found;
        }
    }
    return n_pairs;
}

static hs_status
open_tally(void *job, void *tally)
{
    const counting *shared = job;
    const int32_t   capacity = hs_walker_capacity(shared->search);
    return hs_tally_init(&shared->plan, capacity, hs_block_most_hits(capacity), tally);
}

static void
close_tally(void *job, void *tally)
{
    (void)job;
    hs_tally_free(tally);
}

/* Each thread counts by itself; then the counts are added up. */
static hs_status
tally_pairs(counting *shared, int64_t *n_pairs, hs_failure *failure)
{
    hs_search *search = shared->search;
    hs_crew    crew = {.call = search->call,
                       .job = shared,
                       .worker_size = sizeof(hs_tally),
                       .open = open_tally,
                       .close = close_tally};
    hs_status  status = hs_crew_open(&crew);
    if (status == HS_OK) {
        const hs_visitors visitors = {.use = HS_BLOCK_LISTS_SQUARES,
                                      .visit = hs_tally_hits,
                                      .contexts = crew.workers,
                                      .context_size = crew.worker_size};
        status = hs_parallel_visit(search, &visitors, NULL, failure);
    }
    if (status == HS_OK) {
        *n_pairs = write_histogram(shared, crew.workers, crew.n_open);
    }
    hs_crew_close(&crew);
    return status;
}

/* The search up to the largest edge. */
static hs_options
options_of_histogram(const hs_histogram *histogram, const hs_options *options)
{
    hs_options of_search = hs_options_of_count(options);
    of_search.cutoff = histogram->edges[histogram->n_edges - 1];
    of_search.inclusive = histogram->last_inclusive;
    of_search.precision = HS_EXACT;
    return of_search;
}

/* A hs_use_fn. */
static hs_status
fill_histogram(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    counting *shared = context;
    shared->search = search;
    hs_status status =
        hs_tally_plan_open(search, shared->histogram, shared->sets, &shared->plan, failure);
    if (status == HS_OK) {
        status = tally_pairs(shared, n_pairs, failure);
    }
    hs_tally_plan_close(&shared->plan);
    return status;
}

static hs_status
find_histogram(const hs_among *among, const hs_options *options, const hs_histogram *histogram,
               hs_failure *failure)
{
    const hs_status status = options != NULL ? hs_check_histogram(histogram, failure)
                                             : HS_ERR_ARGUMENT;
    if (status != HS_OK) {
        hs_clear_counters(options);
        return status;
    }
    const hs_options of_search = options_of_histogram(histogram, options);
    hs_request       request = hs_request_among(among, HS_HALF_OR_QUERIES, &of_search);
    request.sets.is_plain = true;
    request.sets.keeps_none = true;
    request.sets.least_cutoff = hs_least_length(histogram->edges, histogram->n_edges);
    counting shared = {.histogram = histogram, .sets = &request.sets};
    return hs_request_use(&request, fill_histogram, &shared, failure);
}

/* Enters the floating-point environment itself, because edges are compared before the
 * search does. */
hs_status
hs_pairs_histogram(const hs_among *among, const hs_options *options, const hs_histogram *histogram,
                   hs_failure *failure)
{
    hs_entry entry;
    if (options != NULL && hs_has_systems(among)) {
        return hs_systems_histogram(among, options, histogram, failure);
    }
    failure = hs_enter(failure, &entry);
    const hs_status status = find_histogram(among, options, histogram, failure);
    hs_leave(&entry);
    return status;
}

/* Clusters of points, joined pair by pair while these are found. */

/* What the pairs are for. */
typedef struct clustering {
    hs_components  components; /* owned */
    const uint8_t *core;       /* borrowed, or NULL */
    int64_t       *labels;     /* borrowed */
} clustering;

/* A hs_pairs_fn: core points that are a pair belong together. */
static int
join_pairs(const hs_pair_arrays *pairs, int64_t n, int64_t *n_taken, void *user)
{
    clustering    *doing = user;
    const int32_t *i = pairs->i, *j = pairs->j;
    const int      n_axes = doing->components.n_axes;
    (void)n_taken;
    for (int64_t e = 0; e < n; e++) {
        if (doing->core == NULL || (doing->core[i[e]] != 0 && doing->core[j[e]] != 0)) {
            hs_components_join(&doing->components, i[e], j[e],
                               n_axes > 0 ? pairs->shift + e * n_axes : NULL);
        }
    }
    return 0;
}

/* A hs_pairs_fn: any other point belongs to the first cluster that has a core point near it. */
static int
adopt_points(const hs_pair_arrays *pairs, int64_t n, int64_t *n_taken, void *user)
{
    const clustering *doing = user;
    const uint8_t    *core = doing->core;
    const int32_t    *i = pairs->i, *j = pairs->j;
    (void)n_taken;
    for (int64_t e = 0; e < n; e++) {
        if ((core[i[e]] != 0) != (core[j[e]] != 0)) {
            int64_t      *label = &doing->labels[core[i[e]] != 0 ? j[e] : i[e]];
            const int64_t near = doing->labels[core[i[e]] != 0 ? i[e] : j[e]];
            *label = *label < 0 || near < *label ? near : *label;
        }
    }
    return 0;
}

/* Whether some point is near enough to a cluster only. */
static bool
has_others(const uint8_t *core, int64_t n)
{
    return core != NULL && n > 0 && memchr(core, 0, (size_t)n) != NULL;
}

static bool
is_periodic(const hs_box *box)
{
    bool any = false;
    for (int l = 0; box != NULL && l < box->ndim; l++) {
        any = any || box->periodic[l];
    }
    return any;
}

/* The pairs, once or twice; the options' memory limit is what the search may take. */
static hs_status
join_all_pairs(const hs_among *among, const hs_options *options, clustering *doing,
               uint8_t *winding, int64_t *n_clusters, hs_failure *failure)
{
    hs_visit      visit = {.pairs = join_pairs, .user = doing};
    hs_options    of_visit = *options;
    int64_t       n_pairs;
    const int64_t n = doing->components.n;
    of_visit.want = HS_WANT_I | HS_WANT_J | (doing->components.n_axes > 0 ? HS_WANT_SHIFT : 0);
    hs_status status = hs_visit_columns(among, &of_visit, &visit, &n_pairs, failure);
    if (status != HS_OK) {
        return status;
    }
    const int64_t found =
        hs_components_label(&doing->components, doing->core, doing->labels, winding);
    if (has_others(doing->core, n)) {
        visit.pairs = adopt_points;
        of_visit.want = HS_WANT_I | HS_WANT_J;
        of_visit.counters = NULL;
        status = hs_visit_columns(among, &of_visit, &visit, &n_pairs, failure);
    }
    if (status == HS_OK) {
        *n_clusters = found;
    }
    return status;
}

static hs_status
find_clusters(const hs_among *among, const hs_options *options, const uint8_t *core,
              int64_t *labels, uint8_t *winding, int64_t *n_clusters, hs_failure *failure)
{
    const hs_request request = hs_request_among(among, HS_HALF_LIST, options);
    const hs_points *points = request.sets.points;
    clustering       doing = {.core = core, .labels = labels};
    hs_account       account;
    hs_clear_counters(options);
    hs_status status = hs_check_arguments(points, NULL, request.box, options, failure);
    if (status != HS_OK) {
        return status;
    }
    const int n_axes = winding != NULL && is_periodic(request.box) ? points->ndim : 0;
    hs_account_init(&account, options);
    status = hs_components_open(&account, points->n, n_axes, &doing.components);
    if (status == HS_OK) {
        hs_options of_search = *options;
        of_search.memory_limit -= (double)account.held;
        status = join_all_pairs(among, &of_search, &doing, winding, n_clusters, failure);
        failure->limit_bytes += status == HS_ERR_MEMORY ? (double)account.held : 0.0;
    } else {
        failure->limit_bytes = account.limit;
    }
    hs_components_close(&account, &doing.components);
    hs_account_close(&account);
    return status;
}

hs_status
hs_clusters_find(const hs_among *among, const hs_options *options, const uint8_t *core,
                 int64_t *labels, uint8_t *winding, int64_t *n_clusters, hs_failure *failure)
{
    const hs_points *points = hs_request_among(among, HS_HALF_LIST, options).sets.points;
    if (options == NULL || n_clusters == NULL || !hs_has_entries(labels, points)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_entry   entry;
    hs_options of_search = hs_options_of_count(options);
    of_search.index_bytes = 4;
    failure = hs_enter(failure, &entry);
    const hs_status status =
        find_clusters(among, &of_search, core, labels, winding, n_clusters, failure);
    hs_leave(&entry);
    return status;
}

/* What a search of a scene would do, read from the structures that would do it. */

/* What was chosen. */
static hs_algorithm
algorithm_of(const hs_search *search)
{
    return search->is_sparse ? HS_HASH : search->grid.n_cells == 1 ? HS_ALL_PAIRS : HS_GRID;
}

static void
fill_plan(const hs_search *search, hs_plan *plan)
{
    const hs_scene *scene = &search->scene;
    const hs_grid  *grid = &search->grid;
    const double    unscale = hs_scale_apply(scene->unscale, 1.0);
    *plan = (hs_plan){.ndim = scene->ndim,
                      .n_periodic = scene->lattice.n_periodic,
                      .aligned = scene->lattice.aligned,
                      .reduced = scene->lattice.reduced,
                      .keeps_originals = search->bins.keeps_originals,
                      .algorithm = algorithm_of(search),
                      .all_pairs = grid->n_cells == 1,
                      .sparse = search->is_sparse,
                      .n_cells = grid->n_cells,
                      .stencil_rows = search->stencil.n_rows,
                      .threads = hs_team_size(search->call->team),
                      .kernel = search->call->kernel->name};
    for (int k = 0; k < scene->ndim; k++) {
        plan->shape[k] = grid->shape[k];
        plan->cell_size[k] = grid->cell_size[k] * unscale;
        plan->reach[k] = grid->reach[k];
        plan->images[k] = scene->lattice.row_of_axis[k] >= 0
                              ? (grid->reach[k] + grid->shape[k] - 1) / grid->shape[k]
                              : 0;
    }
}

/* A plan while searches are added to it. */
typedef struct planning {
    hs_plan     *plan;
    double       largest; /* reach of a search so far */
    hs_algorithm wanted;  /* by the caller */
} planning;

/* A hs_use_fn: adds a search to the plan, which is about the one with the largest reach. */
static hs_status
use_search(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    planning       *now = context;
    hs_plan        *plan = now->plan;
    const int64_t   n_before = plan->n_searches;
    const double    expected_before = plan->expected_pairs;
    double          expected;
    const hs_status status = hs_estimate_pairs(search, &expected);
    (void)n_pairs;
    (void)failure;
    if (n_before == 0 || search->call->options.cutoff > now->largest) {
        now->largest = search->call->options.cutoff;
        fill_plan(search, plan);
    }
    plan->n_searches = n_before + 1;
    plan->expected_pairs = expected_before + expected;
    if (now->wanted != HS_AUTO) {
        plan->algorithm = now->wanted;
    } else if (plan->n_searches > 1) {
        plan->algorithm = HS_HIERARCHY;
    }
    return status;
}

/* Where no two points can be a pair: what the cells would be for a cutoff of 0. */
static hs_status
plan_nothing(const hs_request *request, planning *now, hs_failure *failure)
{
    hs_options options = *request->options;
    hs_request without = *request;
    options.cutoff = 0.0;
    without.options = &options;
    without.reach = NULL;
    const hs_status status = hs_request_use(&without, use_search, now, failure);
    now->plan->n_searches = 0;
    now->plan->expected_pairs = 0.0;
    return status;
}

hs_status
hs_plan_make(const hs_among *among, const hs_options *options, hs_plan *plan, hs_failure *failure)
{
    const hs_request request = hs_request_among(among, HS_HALF_LIST, options);
    if (options == NULL || plan == NULL || request.selection != NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_plan   made = {.ndim = 0};
    planning  now = {.plan = &made, .wanted = options->algorithm};
    hs_status status = hs_by_reach_each_step(&request, use_search, &now, failure);
    if (status == HS_OK && made.n_searches == 0) {
        status = plan_nothing(&request, &now, failure);
    }
    *plan = status == HS_OK ? made : *plan;
    return status;
}
