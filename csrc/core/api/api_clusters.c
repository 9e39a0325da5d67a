/* SPDX-License-Identifier: BSD-3-Clause */
/* api_clusters.c: clusters of points, joined pair by pair while these are found. */
#include "request.h"
#include "visit_columns.h"

#include "../collect/components.h"

/* What the pairs are for. */
typedef struct gathering {
    hs_components  components; /* owned */
    const uint8_t *core;       /* borrowed, or NULL */
    int64_t       *labels;     /* borrowed */
} gathering;

/* A hs_pairs_fn: core points that are a pair belong together. */
static int
join_pairs(const hs_pair_arrays *pairs, int64_t n, int64_t *n_taken, void *user)
{
    gathering     *doing = user;
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
    const gathering *doing = user;
    const uint8_t   *core = doing->core;
    const int32_t   *i = pairs->i, *j = pairs->j;
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
gather(const hs_among *among, const hs_options *options, gathering *doing, uint8_t *winding,
       int64_t *n_clusters, hs_failure *failure)
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
    gathering        doing = {.core = core, .labels = labels};
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
        status = gather(among, &of_search, &doing, winding, n_clusters, failure);
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
