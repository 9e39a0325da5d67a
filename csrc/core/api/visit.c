/* SPDX-License-Identifier: BSD-3-Clause */
#include "query.h"

#include <math.h>
#include <string.h>

/* visit.c: pairs that are handed to a function as they are found, or joined to clusters, and
 * stored nowhere. */

/* Work of a call in candidates, for polling: functions take tens of nanoseconds and more. */
#define CALL_WORK 32

/* What the threads share. */
typedef struct visiting {
    const hs_visit *visit;
    unsigned        want; /* columns */
    hs_query_run   *run;  /* of the step; counts the pairs of threads that have ended */
} visiting;

/* What one thread works with. */
typedef struct visitor {
    const hs_visit *visit;    /* borrowed */
    hs_output       part;     /* owned; the pairs that are being visited */
    hs_recorder     recorder; /* owned; of the part */
    int64_t         n_visited;
} visitor;

/* A hs_visit_fn. */
static hs_status
visit_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    visitor        *doing = context;
    const hs_visit *visit = doing->visit;
    hs_output      *part = &doing->part;
    part->n_pairs = 0;
    const hs_status status = hs_record_hits(&doing->recorder, scanner, first, hits);
    if (status != HS_OK) {
        return status;
    }
    const hs_pair_arrays pairs = {.capacity = part->n_pairs,
                                  .index_bytes = part->index_bytes,
                                  .i = hs_output_column(part, HS_WANT_I),
                                  .j = hs_output_column(part, HS_WANT_J),
                                  .distance = hs_output_column(part, HS_WANT_DISTANCE),
                                  .vector = hs_output_column(part, HS_WANT_VECTOR),
                                  .shift = hs_output_column(part, HS_WANT_SHIFT)};
    const int64_t       *i = pairs.i, *j = pairs.j;
    int64_t              n_taken = part->n_pairs;
    int                  stops = 0;
    if (visit->pairs != NULL) {
        stops = visit->pairs(&pairs, part->n_pairs, &n_taken, visit->user);
    }
    for (int64_t e = 0; visit->pairs == NULL && stops == 0 && e < part->n_pairs; e++) {
        const double d = pairs.distance[e];
        stops = visit->pair(i[e], j[e], pairs.shift + e * part->ndim, pairs.vector + e * part->ndim,
                            d * d, visit->user);
        n_taken = e + 1;
    }
    (void)hs_fpenv_enter(); /* the caller's function may have changed it */
    doing->n_visited += n_taken;
    scanner->work_since_poll += CALL_WORK * part->n_pairs;
    return stops != 0 ? HS_ENOUGH : HS_OK;
}

static hs_status
open_visitor(void *context, void *state, const hs_walker *walker)
{
    const visiting *shared = context;
    visitor        *doing = state;
    doing->visit = shared->visit;
    hs_output_init(NULL, walker->search->scene.ndim, shared->want,
                   shared->run->call->options.index_bytes, &doing->part);
    return hs_recorder_init(&shared->run->call->account, &doing->part,
                            walker->scanner.block.most_hits, &doing->recorder);
}

static void
close_visitor(void *context, void *state)
{
    visiting *shared = context;
    visitor  *doing = state;
    shared->run->n_pairs += doing->n_visited;
    hs_recorder_free(&shared->run->call->account, &doing->recorder);
    hs_output_free(&doing->part);
}

/* A hs_use_fn: each thread visits the pairs that it finds. HS_ENOUGH: a function wants no more. */
static hs_status
visit_step(void *context, hs_query_run *run)
{
    visiting         shared = *(const visiting *)context;
    const hs_visitor all = {.use = hs_record_use(shared.want),
                            .visit = visit_hits,
                            .shared = &shared,
                            .state_size = sizeof(visitor),
                            .open = open_visitor,
                            .close = close_visitor};
    shared.run = run;
    if (!shared.visit->thread_safe) { /* other threads only make the search ready */
        hs_call_dismiss(run->call);
    }
    return hs_parallel_visit(run->search, &all, NULL, run->failure);
}

/* For a visit by the caller's thread alone: others only make the search ready. */
static void
spare_threads(hs_query *query)
{
    const double n = (double)(hs_query_asking(query) / HS_POINTS_MADE_READY);
    if (query->options.threads > 1 && hs_call_threads(n, &query->options) == 1) {
        query->options.threads = 1;
    }
}

hs_status
hs_pairs_visit(const hs_among *among, const hs_options *options, const hs_visit *visit,
               int64_t *n_visited, hs_failure *failure)
{
    visiting    shared = {.visit = visit,
                          .want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR |
                                  HS_WANT_SHIFT};
    hs_finder   finder = {.step = visit_step, .context = &shared, .is_numbered = true};
    hs_counters done;
    hs_query    query = hs_query_among(among, HS_HALF_LIST, options);
    query.is_incomplete |= n_visited == NULL || visit == NULL ||
                           (visit->pair == NULL && visit->pairs == NULL);
    hs_query_want_none(&query);
    query.sets.keeps_none = true;
    query.options.want = shared.want;
    query.options.index_bytes = 8;
    if (query.options.counters == NULL) {
        query.options.counters = &done;
    }
    finder.one_thread = !query.is_incomplete && !visit->thread_safe;
    if (finder.one_thread) {
        spare_threads(&query);
    }
    const hs_status status = hs_query_answer(&query, &finder, NULL, failure);
    if (n_visited != NULL) {
        *n_visited = query.options.counters->pairs;
    }
    return status == HS_ENOUGH ? HS_OK : status;
}

/*
 * Clusters of points, joined pair by pair while these are found: a forest in which each tree is a
 * cluster and its root the lowest number (disjoint sets). Ways to the root are halved as they are
 * gone, and a root hangs itself under a lower one. Where windings are wanted, each point also knows
 * in which image of it the way from its root ends: a pair that closes a ring whose ends lie in
 * different images winds around the box. Shifts are added modulo 2^32: a ring that is missed would
 * have to wind 2^32 times around it.
 */

/* What the pairs are for: clusters of all systems, or of one. */
typedef struct clustering {
    int64_t        n;
    int            n_axes;  /* of shifts; 0: windings are not wanted */
    int32_t       *parent;  /* owned, as are the next two, of one; n: of a root, itself */
    uint32_t      *image;   /* n * n_axes: the image of a point that its parent's tree reaches, as a
                            * shift from its parent, modulo 2^32 */
    uint8_t       *winds;   /* n: of a root, a bit for each box vector */
    const uint8_t *core;    /* borrowed, or NULL */
    int64_t       *labels;  /* borrowed */
    uint8_t       *winding; /* borrowed, or NULL */
    int64_t        n_found;
} clustering;

/* The root of a point; *image is where the way from it ends, if shifts are kept. */
static int32_t
root_of(clustering *doing, int32_t p, uint32_t *image)
{
    int32_t  *parent = doing->parent;
    const int n_axes = doing->n_axes;
    for (int l = 0; l < n_axes; l++) {
        image[l] = 0;
    }
    while (parent[p] != p) {
        const int32_t above = parent[p];
        for (int l = 0; l < n_axes; l++) { /* zero where the parent is the root */
            uint32_t *from_parent = &doing->image[(int64_t)p * n_axes + l];
            *from_parent += doing->image[(int64_t)above * n_axes + l];
            image[l] += *from_parent;
        }
        parent[p] = parent[above];
        p = parent[p];
    }
    return p;
}

/* Numbers the clusters by their lowest point, from 0; points that are not core have not been joined
 * to any. */
static void
label(clustering *doing)
{
    uint32_t image[HS_MAX_DIM];
    for (int64_t p = 0; p < doing->n; p++) {
        const int32_t root = root_of(doing, (int32_t)p, image);
        if (doing->core != NULL && doing->core[p] == 0) {
            doing->labels[p] = -1;
        } else if (root < p) {
            doing->labels[p] = doing->labels[root];
        } else {
            if (doing->winding != NULL) {
                doing->winding[doing->n_found] = doing->n_axes > 0 ? doing->winds[p] : 0;
            }
            doing->labels[p] = doing->n_found++;
        }
    }
}

/* A hs_pairs_fn: core points that are a pair belong together. */
static int
join_pairs(const hs_pair_arrays *pairs, int64_t n, int64_t *n_taken, void *user)
{
    clustering *doing = user;
    const int   n_axes = doing->n_axes;
    (void)n_taken;
    for (int64_t e = 0; e < n; e++) {
        const int32_t i = ((const int32_t *)pairs->i)[e], j = ((const int32_t *)pairs->j)[e];
        uint32_t      image_i[HS_MAX_DIM], image_j[HS_MAX_DIM], between[HS_MAX_DIM];
        uint8_t       winds = 0;
        if (doing->core != NULL && (doing->core[i] == 0 || doing->core[j] == 0)) {
            continue;
        }
        const int32_t a = root_of(doing, i, image_i), b = root_of(doing, j, image_j);
        const int32_t root = a < b ? a : b, lower = a < b ? b : a;
        /* From root a to the tree of b: to i, over the pair, and from j back to b. */
        for (int l = 0; l < n_axes; l++) {
            between[l] = image_i[l] + (uint32_t)pairs->shift[e * n_axes + l] - image_j[l];
            winds |= (uint8_t)((between[l] != 0) << l);
        }
        if (n_axes > 0) {
            doing->winds[root] |= a == b ? winds : doing->winds[lower];
        }
        for (int l = 0; l < n_axes && a != b; l++) {
            doing->image[(int64_t)lower * n_axes + l] = a < b ? between[l] : 0u - between[l];
        }
        doing->parent[lower] = root;
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

/* A hs_use_fn; context: the clustering of all systems. */
static hs_status
find_clusters(void *context, hs_query_run *run)
{
    clustering      *all = context, doing = *all;
    hs_account      *account = &run->call->account;
    const hs_visit   all_pairs = {.pairs = join_pairs, .user = &doing};
    const hs_visit   adopt = {.pairs = adopt_points, .user = &doing};
    visiting         shared = {.visit = &all_pairs, .want = HS_WANT_I | HS_WANT_J};
    const hs_points *points = run->query->sets.points;
    const hs_box    *box = run->query->box;
    const int64_t    n = points->n;
    hs_status        status = HS_ERR_MEMORY;
    doing.n = n;
    doing.core = all->core != NULL ? all->core + run->first_point : NULL;
    doing.labels = all->labels + run->first_point;
    doing.winding = all->winding;
    for (int l = 0; doing.winding != NULL && box != NULL && l < box->ndim; l++) {
        doing.n_axes = box->periodic[l] ? points->ndim : doing.n_axes;
    }
    const int n_axes = doing.n_axes;
    shared.want |= n_axes > 0 ? HS_WANT_SHIFT : 0;
    doing.parent = hs_alloc(account, HS_FOR_INDICES, n, sizeof(int32_t));
    doing.image = hs_alloc(account, HS_FOR_SHIFTS, n * n_axes, sizeof(uint32_t));
    doing.winds = hs_alloc(account, HS_FOR_SHIFTS, n_axes > 0 ? n : 0, 1);
    if (doing.parent != NULL && doing.image != NULL && doing.winds != NULL) {
        for (int64_t p = 0; p < n; p++) {
            doing.parent[p] = (int32_t)p;
        }
        memset(doing.image, 0, (size_t)(n * n_axes) * sizeof(uint32_t));
        memset(doing.winds, 0, n_axes > 0 ? (size_t)n : 0);
        status = hs_query_each_step(run, visit_step, &shared);
    }
    if (status == HS_OK) {
        label(&doing);
    }
    hs_free(account, doing.parent);
    hs_free(account, doing.image);
    hs_free(account, doing.winds);
    if (status == HS_OK && doing.core != NULL && n > 0 &&
        memchr(doing.core, 0, (size_t)n) != NULL) {
        /* Some point is near enough to a cluster only. The counters leave this out. */
        const hs_counters done = run->call->done;
        const int64_t     n_pairs = run->n_pairs;
        shared.visit = &adopt;
        shared.want = HS_WANT_I | HS_WANT_J;
        status = hs_query_each_step(run, visit_step, &shared);
        run->call->done = done;
        run->n_pairs = n_pairs;
    }
    all->n_found = status == HS_OK ? doing.n_found : all->n_found;
    return status;
}

hs_status
hs_clusters_find(const hs_among *among, const hs_options *options, const uint8_t *core,
                 int64_t *labels, uint8_t *winding, int64_t *n_clusters, hs_failure *failure)
{
    int64_t    none; /* where there are no points, there may be no labels */
    clustering all = {.core = core, .labels = labels != NULL ? labels : &none, .winding = winding};
    const hs_finder finder = {.find = find_clusters, .context = &all, .one_thread = true};
    hs_query        query = hs_query_among(among, HS_HALF_LIST, options);
    query.is_incomplete |= n_clusters == NULL || !hs_has_entries(labels, query.sets.points);
    hs_query_want_none(&query);
    query.sets.keeps_none = true;
    query.options.want = HS_WANT_I | HS_WANT_J | (winding != NULL ? HS_WANT_SHIFT : 0);
    query.options.index_bytes = 4;
    spare_threads(&query);
    const hs_status status = hs_query_answer(&query, &finder, NULL, failure);
    if (status == HS_OK) {
        *n_clusters = all.n_found;
    }
    return status;
}
