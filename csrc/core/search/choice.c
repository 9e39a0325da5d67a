/* SPDX-License-Identifier: BSD-3-Clause */
#include "choice.h"
#include "../base/sort.h"

#include <string.h>

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
hs_choice_set_box(const hs_box *box, int ndim, hs_choice *choice)
{
    const hs_status   status = hs_image_box_init(box, ndim, &choice->images);
    const hs_lattice *lattice = &choice->images.lattice;
    double            shortest = INFINITY;
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
    if (choice == NULL || !hs_choice_excludes(choice)) {
        return HS_OK;
    }
    hs_status status = hs_box_check(box, failure);
    if (status == HS_OK) {
        status = hs_choice_set_box(box, sets->points->ndim, choice);
    }
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
    if (selection == NULL) {
        return HS_OK;
    }
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

/* One loop without branches for each test; it writes each hit, and goes on behind those that
 * stay. */

HS_ALWAYS_INLINE bool
is_left_out(const hs_asking *asking, int32_t id, const hs_label_test test)
{
    const int64_t one = test != HS_OF_PARTNER ? asking->label[id] : 0, own = asking->own;
    if (test == HS_OF_OTHER_GROUP) {
        return one != own;
    }
    if (test == HS_OF_EQUAL_LABEL) {
        return one == own && id != asking->itself;
    }
    if (test == HS_OF_NEAR_LABEL) { /* their difference may pass int64 */
        const uint64_t more = one > own ? (uint64_t)one - (uint64_t)own
                                        : (uint64_t)own - (uint64_t)one;
        return more <= asking->within && id != asking->itself;
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
    *chooser = (hs_chooser){.choice = choice, .point = point, .test = HS_OF_PARTNER};
    chooser->excluding.itself = choice->has_queries ? -1 : point;
    if (choice->group != NULL) {
        chooser->of_group.label = choice->group;
        chooser->of_group.own = choice->asking_group[point];
    }
    if (choice->label != NULL) {
        chooser->excluding.label = choice->label;
        chooser->excluding.own = choice->asking_label[point];
        chooser->excluding.within = choice->within;
        chooser->test = choice->within == 0 ? HS_OF_EQUAL_LABEL : HS_OF_NEAR_LABEL;
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

HS_ALWAYS_INLINE int32_t
keep_chosen(const hs_scanner *scanner, hs_scan *scan, const hs_asking *asking, int32_t from,
            int32_t end, int32_t to, const hs_label_test test)
{
    int32_t *hits = scan->hits;
    float   *squares = scan->squares;
    for (int32_t h = from; h < end; h++) {
        const int32_t hit = hits[h];
        hits[to] = hit;
        if (squares != NULL) {
            squares[to] = squares[h];
        }
        to += !is_left_out(asking, hs_hit_number(scanner, hit), test);
    }
    return to;
}

bool
hs_chooser_is_of_group(const hs_chooser *chooser, int32_t number)
{
    return chooser->of_group.label == NULL ||
           !is_left_out(&chooser->of_group, number, HS_OF_OTHER_GROUP);
}

bool
hs_chooser_excludes(const hs_chooser *chooser, int32_t number)
{
    const hs_asking *asking = &chooser->excluding;
    if (!chooser->excludes) {
        return false;
    }
    switch (chooser->test) {
    case HS_OF_EQUAL_LABEL: return is_left_out(asking, number, HS_OF_EQUAL_LABEL);
    case HS_OF_NEAR_LABEL: return is_left_out(asking, number, HS_OF_NEAR_LABEL);
    default: return is_left_out(asking, number, HS_OF_PARTNER);
    }
}

/* Moves hits [from, end) that the test does not leave out to `to`, which is not behind them;
 * returns where they end. */
static int32_t
keep_by_label(const hs_scanner *scanner, hs_scan *scan, const hs_asking *asking, int32_t from,
              int32_t end, int32_t to, hs_label_test test)
{
    switch (test) {
    case HS_OF_OTHER_GROUP:
        return keep_chosen(scanner, scan, asking, from, end, to, HS_OF_OTHER_GROUP);
    case HS_OF_EQUAL_LABEL:
        return keep_chosen(scanner, scan, asking, from, end, to, HS_OF_EQUAL_LABEL);
    case HS_OF_NEAR_LABEL:
        return keep_chosen(scanner, scan, asking, from, end, to, HS_OF_NEAR_LABEL);
    default: return keep_chosen(scanner, scan, asking, from, end, to, HS_OF_PARTNER);
    }
}

/* Labels are compared for all hits, one point after the other. Where that leaves images or
 * distances open, a batch of hits is looked up: of distances, those that float32 cannot tell. */

/* Candidates that could be tested while the nearest image of a pair is found: a microsecond, some
 * of them in many dimensions. */
#define WORK_OF_IMAGE 1024

/* Hits of one point that are looked up together. */
typedef struct hit_batch {
    hs_scanner *scanner;
    int32_t     t, point; /* the asking point: of the group, and as the caller numbers it */
    int32_t     n;
    int32_t     hit[HS_BATCH];   /* where among the scan's hits */
    int32_t     place[HS_BATCH]; /* of the candidates */
    int32_t     id[HS_BATCH];    /* and their numbers */
    uint8_t     drop[HS_BATCH];  /* 0 or 1 */
} hit_batch;

/* Looks up the pairs of the batch. */
static hs_status
look_up_batch(hit_batch *batch, bool metric)
{
    hs_scanner *scanner = batch->scanner;
    hs_pair_batch_clear(&scanner->pair_batch);
    (void)hs_pair_batch_add(&scanner->pair_batch, scanner->group.first + batch->t, batch->place,
                            batch->n);
    return hs_pair_batch_look_up(&scanner->pair_batch, metric, &scanner->failed_point);
}

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

/* Drops the pairs of the batch, which are excluded, that are in their nearest image. */
static hs_status
drop_nearest(const hs_choice *choice, hit_batch *batch)
{
    hs_scanner *scanner = batch->scanner;
    int64_t     shift[HS_MAX_DIM];
    hs_status   status = look_up_batch(batch, false);
    scanner->work_since_poll += WORK_OF_IMAGE * (int64_t)batch->n;
    for (int32_t e = 0; status == HS_OK && e < batch->n; e++) {
        bool nearest;
        for (int r = 0; r < scanner->pair_batch.n_rows; r++) {
            shift[r] = scanner->pair_batch.given[r][e];
        }
        status = hs_choice_is_nearest(choice, batch->point, batch->id[e], shift, &nearest);
        if (status != HS_OK) {
            scanner->failed_point = batch->point;
        }
        batch->drop[e] = nearest;
    }
    return status;
}

/* Drops the pairs of the batch that are nearer than the least distance. */
static hs_status
drop_near(const hs_choice *choice, hit_batch *batch)
{
    hs_scanner     *scanner = batch->scanner;
    const hs_scene *scene = &scanner->search->scene;
    const hs_status status = look_up_batch(batch, true);
    hs_metric       nearer;
    if (status != HS_OK) {
        return status;
    }
    hs_metric_init(&nearer, scene->metric.ndim, scene->metric.n_rows,
                   (const double(*)[HS_MAX_DIM])scene->metric.rows, hs_choice_least(choice, scene),
                   false);
    hs_decide_pair_batch(scanner, &nearer, batch->drop);
    for (int32_t e = 0; e < batch->n; e++) {
        const hs_pair_batch *pairs = &scanner->pair_batch;
        bool                 is_itself = !choice->has_queries && batch->id[e] == batch->point;
        for (int r = 0; r < pairs->n_rows && pairs->is_shifted; r++) {
            is_itself = is_itself && pairs->times[r][e] == 0.0;
        }
        batch->drop[e] = batch->drop[e] && !is_itself;
    }
    return HS_OK;
}

#define DROPPED (-1) /* in place of a hit */

/* Drops those of hits [from, end) of a point that are excluded and in their nearest image,
 * by_image, or nearer than the least distance: float32 squares beyond `out` are not. *left: where
 * the others end. */
static hs_status
drop_hits(const hs_chooser *chooser, bool by_image, float out, int32_t from, int32_t end,
          hit_batch *batch, hs_scan *scan, int32_t *left)
{
    const hs_scanner *scanner = batch->scanner;
    hs_status         status = HS_OK;
    batch->n = 0;
    for (int32_t h = from; status == HS_OK && h < end; h++) {
        const int32_t hit = scan->hits[h], id = hs_hit_number(scanner, hit);
        float         square = 0.0f;
        for (int k = 0; !by_image && k < scanner->search->scene.ndim; k++) {
            const float along = scanner->block.y[k][hit] - scanner->group.q[k][batch->t];
            square += along * along;
        }
        if (by_image ? hs_chooser_excludes(chooser, id) : !(square > out)) {
            batch->hit[batch->n] = h;
            batch->place[batch->n] = hs_hit_place(scanner, hit);
            batch->id[batch->n++] = id;
        }
        if (batch->n == 0 || (batch->n < HS_BATCH && h + 1 < end)) {
            continue;
        }
        status = by_image ? drop_nearest(chooser->choice, batch)
                          : drop_near(chooser->choice, batch);
        for (int32_t e = 0; status == HS_OK && e < batch->n; e++) {
            if (batch->drop[e]) {
                scan->hits[batch->hit[e]] = DROPPED;
            }
        }
        batch->n = 0;
    }
    *left = from;
    for (int32_t h = from; h < end; h++) {
        const int32_t hit = scan->hits[h];
        scan->hits[*left] = hit;
        if (scan->squares != NULL) {
            scan->squares[*left] = scan->squares[h];
        }
        *left += hit != DROPPED;
    }
    return status;
}

/* Chooses among hits [from, scan->end[t]) of a point, and moves those that count to `to`; *end:
 * where they end. */
static hs_status
choose_of_point(const hs_chooser *chooser, hit_batch *batch, hs_scan *scan, float out, int32_t from,
                int32_t to, int32_t *end)
{
    const hs_scanner *scanner = batch->scanner;
    const hs_choice  *choice = chooser->choice;
    const size_t      n = (size_t)(scan->end[batch->t] - from);
    hs_status         status = HS_OK;
    *end = to + (int32_t)n;
    if (chooser->of_group.label != NULL) {
        *end = keep_by_label(scanner, scan, &chooser->of_group, from, scan->end[batch->t], to,
                             HS_OF_OTHER_GROUP);
    } else if (to < from) { /* without groups all are moved */
        memmove(scan->hits + to, scan->hits + from, n * sizeof *scan->hits);
        if (scan->squares != NULL) {
            memmove(scan->squares + to, scan->squares + from, n * sizeof *scan->squares);
        }
    }
    const bool compares = hs_choice_compares(choice, scanner->options.cutoff);
    if (chooser->excludes && !compares) {
        *end = keep_by_label(scanner, scan, &chooser->excluding, to, *end, to, chooser->test);
    } else if (chooser->excludes) {
        status = drop_hits(chooser, true, out, to, *end, batch, scan, end);
    }
    if (status == HS_OK && choice->min_distance > 0.0) {
        status = drop_hits(chooser, false, out, to, *end, batch, scan, end);
    }
    return status;
}

hs_status
hs_choose(hs_scanner *scanner, hs_scan *scan, int32_t first, int32_t next)
{
    const hs_search *search = scanner->search;
    const hs_choice *choice = search->call->choice;
    const hs_bins   *asking = hs_search_asking(search);
    hit_batch        batch = {.scanner = scanner};
    int32_t          kept = 0, from = 0;
    hs_status        status = HS_OK;
    float            out = INFINITY; /* squares beyond this are at least the least distance apart */
    if (choice->min_distance > 0.0 && !search->scene.extreme) {
        out = hs_thresholds_of(search->scene.ndim, hs_choice_least(choice, &search->scene),
                               scanner->form->extent, search->filter_error)
                  .out;
    }
    for (int32_t t = first; status == HS_OK && t < next; t++) {
        const int32_t end = scan->end[t];
        hs_chooser    chooser;
        hs_chooser_set(choice, asking->order[scanner->group.first + t], &chooser);
        batch.t = t;
        batch.point = chooser.point;
        status = choose_of_point(&chooser, &batch, scan, out, from, kept, &kept);
        from = end;
        scan->end[t] = kept;
    }
    scan->n_hits = kept;
    /* Hits as the visitor gets them. */
    for (int32_t h = 0; scanner->use == HS_BLOCK_LISTS_IDS && h < kept; h++) {
        scan->hits[h] = hs_hit_number(scanner, scan->hits[h]);
    }
    for (int32_t h = 0; scanner->use == HS_BLOCK_LISTS_PLACES && scanner->is_ordered && h < kept;
         h++) {
        scan->hits[h] = hs_hit_place(scanner, scan->hits[h]);
    }
    return status;
}
