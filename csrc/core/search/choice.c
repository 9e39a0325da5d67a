/* SPDX-License-Identifier: BSD-3-Clause */
/* choice.c: what the caller selects is checked; points, box and labels are kept where they are
 * needed. */
#include "choice.h"

#include <math.h>
#include <string.h>

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

hs_status
hs_selection_check(const hs_selection *selection, const hs_sets *sets, const hs_options *options,
                   hs_failure *failure)
{
    const bool has_queries = sets->queries != NULL && selection->query_numbers == NULL;
    return is_sound(selection, sets, options)
               ? hs_partners_check(selection, has_queries ? sets->queries->n : sets->points->n,
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
    if (!is_sound(selection, sets, &call->options)) {
        return HS_ERR_ARGUMENT;
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
    hs_status status = HS_OK;
    if (selection->n_excluded > 0) {
        status = hs_partners_open(selection, has_queries ? sets->queries->n : sets->points->n,
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
    hs_partners_free(account, &choice->partners);
    hs_free(account, choice);
    call->choice = NULL;
}
