/* SPDX-License-Identifier: BSD-3-Clause */
#include "choice.h"
#include "../base/sort.h"

/* choice.c: what the caller selects is checked; points, box and labels are kept where they are
 * needed. */

/*
 * Excluded partners of each asking point, in CSR form: each way round, or from queries to points
 * alone. HS_ERR_ARGUMENT for numbers that are no point's (failure->row), or HS_ERR_MEMORY. To be
 * freed on failure as well.
 */
static hs_status
partners_open(const hs_selection *selection, int64_t n_asking, int64_t n_points, bool has_queries,
              hs_account *account, hs_partners *partners, hs_failure *failure)
{
    const int64_t  n_pairs = selection->n_excluded, n = n_pairs * (has_queries ? 1 : 2);
    const int64_t *excluded = selection->excluded;
    uint64_t      *others = hs_alloc(account, HS_FOR_CANDIDATES, 2 * n, sizeof *others);
    int64_t       *first = hs_alloc(account, HS_FOR_CANDIDATES, n_asking + 1, sizeof *first);
    int32_t       *number = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof *number);
    hs_status      status = HS_OK;
    *partners = (hs_partners){first, number};
    if (others == NULL || first == NULL || number == NULL) {
        status = HS_ERR_MEMORY;
    } else {
        memset(first, 0, (size_t)(n_asking + 1) * sizeof *first);
    }
    for (int64_t e = 0; status == HS_OK && e < n_pairs; e++) {
        const int64_t i = excluded[2 * e], j = excluded[2 * e + 1];
        if (i < 0 || i >= n_asking || j < 0 || j >= n_points) {
            failure->row = e;
            status = HS_ERR_ARGUMENT;
        } else {
            first[i + 1]++;
            if (!has_queries) {
                first[j + 1]++;
            }
        }
    }
    if (status == HS_OK) {
        hs_starts_of_lengths(first, n_asking + 1);
        for (int64_t e = 0; e < n_pairs; e++) {
            const int64_t i = excluded[2 * e], j = excluded[2 * e + 1];
            others[first[i]++] = (uint64_t)j;
            if (!has_queries) {
                others[first[j]++] = (uint64_t)i;
            }
        }
        hs_starts_of_ends(first, n_asking + 1);
        for (int64_t r = 0; r < n_asking; r++) {
            hs_sort_numbers(others + first[r], first[r + 1] - first[r], 0, others + n);
        }
        for (int64_t e = 0; e < n; e++) {
            number[e] = (int32_t)others[e];
        }
    }
    hs_free(account, others);
    return status;
}

hs_status
hs_choice_set_box(const hs_box *box, int ndim, hs_choice *choice, hs_failure *failure)
{
    const hs_lattice *lattice = &choice->images.lattice;
    double            shortest = INFINITY;
    hs_status         status = hs_box_check(box, failure);
    status = status == HS_OK ? hs_image_box_init(box, ndim, &choice->images) : status;
    if (status != HS_OK) {
        return status;
    }
    for (int k = 0; lattice->aligned && k < ndim; k++) {
        shortest = lattice->row_of_axis[k] >= 0 ? hs_smaller(lattice->period[k], shortest)
                                                : shortest;
    }
    /* A vector of the lattice is at least as long as the shortest part of its rows that is at right
     * angles to those before. */
    for (int r = 0; !lattice->aligned && r < lattice->n_periodic; r++) {
        shortest = hs_smaller(choice->images.R[r][r], shortest);
    }
    choice->shortest = hs_scale_apply(hs_scale_of(-choice->images.scale.exponent), shortest);
    return HS_OK;
}

hs_status
hs_choice_keep_points(const hs_sets *sets, hs_call *call, hs_failure *failure)
{
    hs_choice *choice = call->choice;
    hs_status  status = hs_cloud_load(&call->account, call->team, sets->points, &call->options,
                                      &choice->cloud, failure);
    if (status == HS_OK && choice->has_queries) {
        status = hs_cloud_load(&call->account, call->team, sets->queries, &call->options,
                               &choice->asking_cloud, failure);
        failure->in_queries = status != HS_OK;
    }
    return status;
}

hs_status
hs_choice_keep_labels(const hs_sets *sets, hs_call *call)
{
    hs_choice    *choice = call->choice;
    const int64_t n = sets->points->n;
    HS_ASSERT(sets->queries == NULL);
    if (choice == NULL) {
        return HS_OK;
    }
    choice->copies = hs_alloc(&call->account, HS_FOR_POINTS, 2 * n, sizeof *choice->copies);
    if (choice->copies == NULL) {
        return HS_ERR_MEMORY;
    }
    const int64_t **kept[] = {&choice->group, &choice->label};
    for (int64_t k = 0; k < 2; k++) {
        if (*kept[k] != NULL) {
            *kept[k] = memcpy(choice->copies + k * n, *kept[k], (size_t)n * sizeof **kept[k]);
        }
    }
    choice->asking_group = choice->group;
    choice->asking_label = choice->label;
    return HS_OK;
}

hs_status
hs_choice_set_scene(const hs_sets *sets, const hs_box *box, double cutoff, hs_call *call,
                    hs_failure *failure)
{
    hs_choice *choice = call->choice;
    if (!hs_choice_excludes(choice)) {
        return HS_OK;
    }
    const hs_status status = hs_choice_set_box(box, sets->points->ndim, choice, failure);
    return status == HS_OK && hs_choice_compares(choice, cutoff)
               ? hs_choice_keep_points(sets, call, failure)
               : status;
}

/* Whether a set has what labels are needed of it; it may be NULL, or have no points. */
static bool
has_labels(const hs_selection *selection, const hs_points *points, const hs_set *known)
{
    const hs_set set = hs_set_with(points, known);
    return set.at.n == 0 || ((set.groups != NULL || !selection->has_groups) &&
                             (set.labels != NULL || !selection->has_labels));
}

static bool
is_sound(const hs_selection *selection, const hs_sets *sets, const hs_options *options)
{
    const int64_t n = selection->n_excluded, *numbers = selection->query_numbers;
    const int64_t n_queries = sets->queries != NULL ? sets->queries->n : 0;
    int64_t       outside = 0; /* queries that are points, but have no point's number */
    for (int64_t t = 0; numbers != NULL && t < n_queries; t++) {
        outside += numbers[t] < 0 || numbers[t] >= sets->points->n;
    }
    return selection->within >= 0 && n >= 0 && n <= INT64_MAX / 1024 &&
           (n == 0 || selection->excluded != NULL) && selection->min_distance >= 0.0 &&
           isfinite(selection->min_distance) &&
           (selection->min_distance == 0.0 || options->precision != HS_SINGLE) && outside == 0 &&
           has_labels(selection, sets->points, sets->of_points) &&
           (numbers != NULL || sets->queries == NULL ||
            has_labels(selection, sets->queries, sets->of_queries));
}

hs_status
hs_choice_open(const hs_selection *selection, const hs_sets *sets, hs_call *call,
               hs_failure *failure)
{
    if (!is_sound(selection, sets, &call->options)) {
        return HS_ERR_ARGUMENT;
    }
    const bool has_queries = sets->queries != NULL && selection->query_numbers == NULL;
    hs_choice *choice = hs_alloc(&call->account, HS_FOR_CANDIDATES, 1, sizeof *choice);
    if (choice == NULL) {
        return HS_ERR_MEMORY;
    }
    const hs_set points = hs_set_with(sets->points, sets->of_points);
    const hs_set asking = has_queries ? hs_set_with(sets->queries, sets->of_queries) : points;
    *choice = (hs_choice){
        .group = selection->has_groups ? points.groups : NULL,
        .asking_group = selection->has_groups ? asking.groups : NULL,
        .label = selection->has_labels ? points.labels : NULL,
        .asking_label = selection->has_labels ? asking.labels : NULL,
        .number = selection->query_numbers,
        .within = (uint64_t)selection->within,
        .min_distance = selection->min_distance,
        .has_queries = has_queries,
        .shortest = INFINITY,
    };
    call->choice = choice;
    hs_status status = HS_OK;
    if (selection->n_excluded > 0) {
        status = partners_open(selection, has_queries ? sets->queries->n : sets->points->n,
                               sets->points->n, has_queries, &call->account, &choice->partners,
                               failure);
    }
    if (status != HS_OK) {
        hs_choice_close(call);
    }
    return status;
}

void
hs_choice_close(hs_call *call)
{
    hs_account *account = &call->account;
    hs_choice  *choice = call->choice;
    if (choice == NULL) {
        return;
    }
    hs_cloud_free(account, &choice->asking_cloud);
    hs_cloud_free(account, &choice->cloud);
    hs_free(account, choice->copies);
    hs_free(account, choice->partners.first);
    hs_free(account, choice->partners.number);
    hs_free(account, choice);
    call->choice = NULL;
}

/* Columns of points from `first` on, if there are any. */
static void
cut_cloud(int64_t first, hs_cloud *cloud)
{
    for (int k = 0; k < cloud->ndim && cloud->n > 0; k++) {
        cloud->x[k] += first;
    }
}

void
hs_choice_cut(const hs_choice *all, int64_t first_point, int64_t first_query, hs_choice *part)
{
    const int64_t first_asking = all->has_queries ? first_query : first_point;
    *part = *all;
    part->origin = first_point;
    part->group = all->group != NULL ? all->group + first_point : NULL;
    part->asking_group = all->group != NULL ? all->asking_group + first_asking : NULL;
    part->label = all->label != NULL ? all->label + first_point : NULL;
    part->asking_label = all->label != NULL ? all->asking_label + first_asking : NULL;
    part->number = all->number != NULL ? all->number + first_query : NULL;
    part->partners.first = all->partners.first != NULL ? all->partners.first + first_asking : NULL;
    cut_cloud(first_asking, &part->asking_cloud);
    cut_cloud(first_point, &part->cloud);
}

HS_ALWAYS_INLINE bool
is_left_out(const hs_asking *asking, int32_t id)
{
    if (asking->label != NULL) {
        const uint64_t more = (uint64_t)asking->label[id] - asking->least;
        return (more <= asking->width) & (id != asking->itself);
    }
    const int32_t number = id + asking->origin, *partner = asking->partner;
    int64_t       first = 0, n = asking->n_partners;
    if (!(asking->bits >> (number & 63) & 1) || id == asking->itself) {
        return false;
    }
    while (n > 1) { /* it is at first or behind it, if at all */
        const int64_t half = n / 2;
        first += partner[first + half] <= number ? half : 0;
        n -= half;
    }
    return partner[first] == number;
}

void
hs_chooser_set(const hs_choice *choice, int32_t asking, hs_chooser *chooser)
{
    const int32_t point =
        choice->number != NULL ? (int32_t)(choice->number[asking] - choice->origin) : asking;
    *chooser = (hs_chooser){.choice = choice, .point = point};
    chooser->excluding.itself = choice->has_queries ? -1 : point;
    if (choice->group != NULL) {
        const uint64_t own = (uint64_t)choice->asking_group[point];
        chooser->of_group.itself = -1;
        chooser->of_group.label = choice->group;
        chooser->of_group.least = own + 1; /* and all others */
        chooser->of_group.width = UINT64_MAX - 1;
    }
    if (choice->label != NULL) {
        const int64_t own = choice->asking_label[point], within = (int64_t)choice->within;
        const int64_t least = own < INT64_MIN + within ? INT64_MIN : own - within;
        const int64_t most = own > INT64_MAX - within ? INT64_MAX : own + within;
        chooser->excluding.label = choice->label;
        chooser->excluding.least = (uint64_t)least;
        chooser->excluding.width = (uint64_t)most - (uint64_t)least;
        chooser->excludes = true;
    } else if (choice->partners.first != NULL) {
        const int64_t *first = choice->partners.first + point;
        hs_asking     *by = &chooser->excluding;
        by->partner = choice->partners.number + first[0];
        by->n_partners = first[1] - first[0];
        by->origin = (int32_t)choice->origin;
        for (int64_t p = 0; p < by->n_partners && by->bits != UINT64_MAX; p++) {
            by->bits |= UINT64_C(1) << (by->partner[p] & 63);
        }
        chooser->excludes = by->n_partners > 0;
    }
}

bool
hs_chooser_is_of_group(const hs_chooser *chooser, int32_t number)
{
    return chooser->of_group.label == NULL || !is_left_out(&chooser->of_group, number);
}

bool
hs_chooser_excludes(const hs_chooser *chooser, int32_t number)
{
    return chooser->excludes && is_left_out(&chooser->excluding, number);
}

/* The number of a hit in the caller's order. */
HS_ALWAYS_INLINE int32_t
number_of(const hs_scanner *scanner, int32_t hit)
{
    const hs_block *block = &scanner->block;
    return block->id[scanner->is_ordered ? block->origin[hit] : hit];
}

/* Moves hits [from, end) that are not left out to `to`, which is not behind them; returns where
 * they end. Writes each hit, and goes on behind those that stay. */
static int32_t
keep_by_label(const hs_scanner *scanner, hs_scan *scan, const hs_asking *asking, int32_t from,
              int32_t end, int32_t to)
{
    const hs_asking by = *asking; /* which no store to hits changes */
    int32_t        *hits = scan->hits;
    float          *squares = scan->squares;
    for (int32_t h = from; h < end; h++) {
        const int32_t hit = hits[h];
        hits[to] = hit;
        if (squares != NULL) {
            squares[to] = squares[h];
        }
        to += !is_left_out(&by, number_of(scanner, hit));
    }
    return to;
}

/* Labels are compared for all hits, one point after the other. Where that leaves images or
 * distances open, these hits are decided: of distances, those that float32 cannot tell. */

/* Candidates that could be tested while the nearest image of a pair is found: a microsecond, some
 * of them in many dimensions. */
#define WORK_OF_IMAGE 1024

static void
point_of(const hs_cloud *cloud, int32_t point, double *x)
{
    for (int k = 0; k < cloud->ndim; k++) {
        x[k] = cloud->x[k][point];
    }
}

hs_status
hs_choice_is_nearest(const hs_choice *choice, int32_t point, int32_t number, int64_t *shift,
                     bool *nearest)
{
    const int       m = choice->images.lattice.n_periodic;
    const bool      turns = !choice->has_queries && number < point;
    const hs_cloud *asking = choice->has_queries ? &choice->asking_cloud : &choice->cloud;
    double          p[HS_MAX_DIM], q[HS_MAX_DIM];
    int64_t         near[HS_MAX_DIM];
    point_of(asking, point, turns ? q : p);
    point_of(&choice->cloud, number, turns ? p : q);
    for (int r = 0; turns && r < m; r++) {
        shift[r] = -shift[r];
    }
    const hs_status status = hs_near_image(&choice->images, p, q, near);
    *nearest = status == HS_OK && memcmp(shift, near, (size_t)m * sizeof *near) == 0;
    return status;
}

/* The asking point of pair e of the scanner's batch, and the other one, as the choice numbers
 * them. */
static int32_t
asking_of(const hs_scanner *scanner, int32_t e)
{
    const hs_choice *choice = scanner->search->call->choice;
    const int32_t    asking = hs_search_asking(scanner->search)->order[scanner->pair_batch.si[e]];
    return choice->number != NULL ? (int32_t)(choice->number[asking] - choice->origin) : asking;
}

static int32_t
other_of(const hs_scanner *scanner, int32_t e)
{
    return scanner->block.id[scanner->pair_batch.place[e]];
}

/* A hs_decide_fn: excluded pairs stay unless they are in their nearest image. */
static hs_status
decide_images(hs_scanner *scanner, uint8_t *stays)
{
    const hs_pair_batch *pairs = &scanner->pair_batch;
    hs_status            status = HS_OK;
    scanner->work_since_poll += WORK_OF_IMAGE * (int64_t)pairs->n;
    for (int32_t e = 0; status == HS_OK && e < pairs->n; e++) {
        int64_t shift[HS_MAX_DIM];
        bool    nearest;
        for (int r = 0; r < pairs->n_rows; r++) {
            shift[r] = pairs->given[r][e];
        }
        status = hs_choice_is_nearest(scanner->search->call->choice, asking_of(scanner, e),
                                      other_of(scanner, e), shift, &nearest);
        if (status != HS_OK) {
            scanner->failed_point = hs_search_asking(scanner->search)->order[pairs->si[e]];
        }
        stays[e] = !nearest;
    }
    return status;
}

/* A hs_decide_fn: pairs stay that are not nearer than the least distance, and the point itself. */
static hs_status
decide_nearness(hs_scanner *scanner, uint8_t *stays)
{
    const hs_scene      *scene = &scanner->search->scene;
    const hs_choice     *choice = scanner->search->call->choice;
    const hs_pair_batch *pairs = &scanner->pair_batch;
    hs_metric            nearer;
    hs_metric_init(&nearer, scene->metric.ndim, scene->metric.n_rows,
                   (const double(*)[HS_MAX_DIM])scene->metric.rows, hs_choice_least(choice, scene),
                   false);
    hs_decide_pair_batch(scanner, &nearer, stays);
    for (int32_t e = 0; e < pairs->n; e++) {
        bool is_itself = !choice->has_queries && other_of(scanner, e) == asking_of(scanner, e);
        for (int r = 0; r < pairs->n_rows && pairs->is_shifted; r++) {
            is_itself = is_itself && pairs->times[r][e] == 0.0;
        }
        stays[e] = !stays[e] || is_itself;
    }
    return HS_OK;
}

/* Which hits of a point, from `from` on, are to be decided: with `excluding` those that it leaves
 * out, whose images are compared; without it those whose float32 squares are not beyond `out`. */
static void
look_for_open(const hs_scanner *scanner, const hs_asking *excluding, float out, int32_t from,
              int32_t t, hs_scan *scan)
{
    for (int32_t h = from; h < scan->end[t]; h++) {
        const int32_t hit = scan->hits[h];
        float         square = 0.0f;
        for (int k = 0; excluding == NULL && k < scan->ndim; k++) {
            const float along = scan->y[k][hit] - scan->q[k][t];
            square += along * along;
        }
        if (excluding != NULL ? is_left_out(excluding, number_of(scanner, hit)) : !(square > out)) {
            scan->unsure[scan->n_unsure++] = (hs_unsure){t, hit, h};
        }
    }
}

hs_status
hs_choose(hs_scanner *scanner, hs_scan *scan, int32_t first, int32_t next)
{
    const hs_search *search = scanner->search;
    const hs_choice *choice = search->call->choice;
    const bool       compares = hs_choice_compares(choice, scanner->options.cutoff);
    int32_t          kept = 0, from = 0;
    scan->n_unsure = 0;
    for (int32_t t = first, end; t < next; t++, from = end) {
        int32_t    at = from, left = end = scan->end[t]; /* its hits, before they are moved */
        hs_chooser chooser;
        hs_chooser_set(choice, hs_search_asking(search)->order[scanner->group.first + t], &chooser);
        if (chooser.of_group.label != NULL) {
            left = keep_by_label(scanner, scan, &chooser.of_group, at, left, kept);
            at = kept;
        }
        if (chooser.excludes && !compares) {
            left = keep_by_label(scanner, scan, &chooser.excluding, at, left, kept);
            at = kept;
        }
        if (at > kept) {
            const size_t n = (size_t)(left - at);
            memmove(scan->hits + kept, scan->hits + at, n * sizeof *scan->hits);
            if (scan->squares != NULL) {
                memmove(scan->squares + kept, scan->squares + at, n * sizeof *scan->squares);
            }
        }
        scan->end[t] = kept + left - at;
        if (chooser.excludes && compares) {
            look_for_open(scanner, &chooser.excluding, 0.0f, kept, t, scan);
        }
        kept = scan->end[t];
    }
    scan->n_hits = kept;
    hs_status status = hs_scanner_decide(scanner, scan, first, next, decide_images);
    if (status == HS_OK && choice->min_distance > 0.0) {
        float out = INFINITY; /* squares beyond this are at least the least distance apart */
        if (!search->scene.extreme) {
            out = hs_thresholds_of(search->scene.ndim, hs_choice_least(choice, &search->scene),
                                   scanner->form.extent, search->filter_error)
                      .out;
        }
        scan->n_unsure = 0;
        for (int32_t t = first; t < next; t++) {
            look_for_open(scanner, NULL, out, t > first ? scan->end[t - 1] : 0, t, scan);
        }
        status = hs_scanner_decide(scanner, scan, first, next, decide_nearness);
    }
    /* Hits as the visitor gets them. */
    for (int32_t h = 0; scanner->use == HS_BLOCK_LISTS_IDS && h < scan->n_hits; h++) {
        scan->hits[h] = number_of(scanner, scan->hits[h]);
    }
    if (scanner->use == HS_BLOCK_LISTS_PLACES && scanner->is_ordered) {
        for (int32_t h = 0; h < scan->n_hits; h++) {
            scan->hits[h] = scanner->block.origin[scan->hits[h]];
        }
    }
    return status;
}
