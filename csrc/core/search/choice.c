/* SPDX-License-Identifier: BSD-3-Clause */
/* choice.c: rows of partners are made by transposing them twice, which leaves them ascending. */
#include "choice.h"

#include <math.h>
#include <string.h>

/* Numbers in rows: those of row r are number[first[r]] to number[first[r + 1]]. */
typedef struct row_list {
    int64_t *first;
    int32_t *number;
} row_list;

/* Room for rows of so many numbers, all of them empty. */
static bool
open_rows(hs_account *account, int64_t n_rows, int64_t n_numbers, row_list *rows)
{
    rows->first = hs_alloc(account, HS_FOR_CANDIDATES, n_rows + 2, sizeof *rows->first);
    rows->number = hs_alloc(account, HS_FOR_CANDIDATES, n_numbers, sizeof *rows->number);
    if (rows->first == NULL || rows->number == NULL) {
        return false;
    }
    memset(rows->first, 0, (size_t)(n_rows + 2) * sizeof *rows->first);
    return true;
}

static void
free_rows(hs_account *account, row_list *rows)
{
    hs_free(account, rows->first);
    hs_free(account, rows->number);
    *rows = (row_list){NULL, NULL};
}

/* Turns lengths, which are at first[r + 2], into where row r is to be filled: first[r + 1]. Once
 * each row is full, that is where the next one begins. */
static void
add_up(int64_t n_rows, int64_t *first)
{
    for (int64_t r = 0; r < n_rows; r++) {
        first[r + 2] += first[r + 1];
    }
}

/* One of both points of an excluded pair: the asking one, or the other. */
HS_ALWAYS_INLINE int64_t
number_in(const hs_selection *selection, int64_t pair, int which)
{
    return selection->excluded[2 * pair + which];
}

/* Pairs by their second point: each way round, but for those with queries. */
static void
fill_by_second(const hs_selection *selection, int n_ways, int64_t n_rows, row_list *rows)
{
    for (int64_t e = 0; e < selection->n_excluded; e++) {
        for (int way = 0; way < n_ways; way++) {
            rows->first[number_in(selection, e, 1 - way) + 2]++;
        }
    }
    add_up(n_rows, rows->first);
    for (int64_t e = 0; e < selection->n_excluded; e++) {
        for (int way = 0; way < n_ways; way++) {
            const int64_t at = rows->first[number_in(selection, e, 1 - way) + 1]++;
            rows->number[at] = (int32_t)number_in(selection, e, way);
        }
    }
}

static void
transpose(const row_list *from, int64_t n_from, int64_t n_to, row_list *to)
{
    for (int64_t p = 0; p < from->first[n_from]; p++) {
        to->first[from->number[p] + 2]++;
    }
    add_up(n_to, to->first);
    for (int64_t r = 0; r < n_from; r++) {
        for (int64_t p = from->first[r]; p < from->first[r + 1]; p++) {
            to->number[to->first[from->number[p] + 1]++] = (int32_t)r;
        }
    }
}

static hs_status
open_partners(const hs_selection *selection, const hs_sets *sets, hs_call *call, hs_choice *choice)
{
    const int64_t n_points = sets->points->n;
    const int64_t n_asking = choice->has_queries ? sets->queries->n : n_points;
    hs_account   *account = &call->account;
    const int     n_ways = choice->has_queries ? 1 : 2;
    const int64_t n_numbers = selection->n_excluded * n_ways;
    row_list      by_second = {NULL, NULL}, rows = {NULL, NULL};
    const bool    is_open = open_rows(account, n_asking, n_numbers, &rows) &&
                         open_rows(account, n_points, n_numbers, &by_second);
    if (is_open) {
        fill_by_second(selection, n_ways, n_points, &by_second);
        transpose(&by_second, n_points, n_asking, &rows);
    }
    free_rows(account, &by_second);
    choice->first = rows.first;
    choice->partner = rows.number;
    return is_open ? HS_OK : HS_ERR_MEMORY;
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

/* Copies an array, if it is there, to `*to`, which moves on by its length. */
static void
copy_labels(const int64_t **labels, int64_t n, int64_t **to)
{
    if (*labels != NULL) {
        memcpy(*to, *labels, (size_t)n * sizeof **labels);
        *labels = *to;
        *to += n;
    }
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
    int64_t *to = choice->copies;
    copy_labels(&choice->group, n, &to);
    copy_labels(&choice->label, n, &to);
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

/* Whether an array of labels is there for each set that has points, if there is one at all. */
static bool
has_both(const int64_t *of_points, const int64_t *of_queries, const hs_sets *sets, bool are_points)
{
    const bool is_there = of_points != NULL || of_queries != NULL;
    const bool has_queries = sets->queries != NULL && sets->queries->n > 0 && !are_points;
    return !is_there ||
           ((of_points != NULL || sets->points->n == 0) && (of_queries != NULL || !has_queries));
}

/* Whether all queries have the number of a point, if they have one at all. */
static bool
are_numbers(const int64_t *numbers, const hs_sets *sets)
{
    const int64_t n = numbers != NULL && sets->queries != NULL ? sets->queries->n : 0;
    int64_t       outside = 0;
    for (int64_t t = 0; t < n; t++) {
        outside += numbers[t] < 0 || numbers[t] >= sets->points->n;
    }
    return outside == 0;
}

static bool
is_sound(const hs_selection *selection, const hs_sets *sets, const hs_options *options)
{
    const int64_t n = selection->n_excluded;
    const bool    are_points = selection->query_numbers != NULL;
    return selection->within >= 0 && n >= 0 && n <= INT64_MAX / 1024 &&
           (n == 0 || selection->excluded != NULL) && selection->min_distance >= 0.0 &&
           isfinite(selection->min_distance) &&
           (selection->min_distance == 0.0 || options->precision != HS_SINGLE) &&
           are_numbers(selection->query_numbers, sets) &&
           has_both(selection->groups, selection->query_groups, sets, are_points) &&
           has_both(selection->labels, selection->query_labels, sets, are_points);
}

static hs_status
check_excluded(const hs_selection *selection, int64_t n_asking, int64_t n_points,
               hs_failure *failure)
{
    for (int64_t e = 0; e < selection->n_excluded; e++) {
        const int64_t i = number_in(selection, e, 0), j = number_in(selection, e, 1);
        if (i < 0 || i >= n_asking || j < 0 || j >= n_points) {
            failure->row = e;
            return HS_ERR_ARGUMENT;
        }
    }
    return HS_OK;
}

hs_status
hs_selection_check(const hs_selection *selection, const hs_sets *sets, const hs_options *options,
                   hs_failure *failure)
{
    const bool has_queries = sets->queries != NULL && selection->query_numbers == NULL;
    return is_sound(selection, sets, options)
               ? check_excluded(selection, has_queries ? sets->queries->n : sets->points->n,
                                sets->points->n, failure)
               : HS_ERR_ARGUMENT;
}

hs_status
hs_choice_open(const hs_selection *selection, const hs_sets *sets, hs_call *call,
               hs_failure *failure)
{
    if (selection == NULL) {
        return HS_OK;
    }
    hs_status status = hs_selection_check(selection, sets, &call->options, failure);
    if (status != HS_OK) {
        return status;
    }
    const bool has_queries = sets->queries != NULL && selection->query_numbers == NULL;
    hs_choice *choice = hs_alloc(&call->account, HS_FOR_CANDIDATES, 1, sizeof *choice);
    if (choice == NULL) {
        return HS_ERR_MEMORY;
    }
    *choice = (hs_choice){
        .group = selection->groups,
        .asking_group = has_queries ? selection->query_groups : selection->groups,
        .label = selection->labels,
        .asking_label = has_queries ? selection->query_labels : selection->labels,
        .number = selection->query_numbers,
        .within = (uint64_t)selection->within,
        .min_distance = selection->min_distance,
        .has_queries = has_queries,
        .shortest = INFINITY,
    };
    call->choice = choice;
    status = selection->n_excluded > 0 ? open_partners(selection, sets, call, choice) : HS_OK;
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
    hs_free(account, choice->first);
    hs_free(account, choice->partner);
    hs_free(account, choice);
    call->choice = NULL;
}
