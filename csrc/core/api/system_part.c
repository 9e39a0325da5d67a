/* SPDX-License-Identifier: BSD-3-Clause */
/* system_part.c: arrays of a system begin where those of the systems before it end. */
#include "system_part.h"

#include "../base/starts.h"

#include <string.h>

hs_points
hs_points_of_system(const hs_points *all, const int64_t *first, int64_t s)
{
    hs_points points = *all;
    points.n = first[s + 1] - first[s];
    if (points.n > 0) { /* without points there is no first row */
        points.data = (const char *)points.data + first[s] * points.row_stride;
    }
    return points;
}

const hs_box *
hs_box_of_system(const hs_systems *systems, int ndim, int64_t s, hs_box *own_box)
{
    if (systems->box == NULL || !hs_systems_have_boxes(systems)) {
        return systems->box;
    }
    const double *rows = systems->rows;
    *own_box = *systems->box;
    for (int l = 0; l < ndim; l++) {
        if (rows != NULL) {
            memcpy(own_box->rows[l], rows + (s * ndim + l) * ndim, (size_t)ndim * sizeof(double));
        }
        if (systems->periodic != NULL) {
            own_box->periodic[l] = systems->periodic[s] >> l & 1;
        }
    }
    return own_box;
}

static const double *
numbers_from(const double *numbers, int64_t first)
{
    return numbers != NULL ? numbers + first : NULL;
}

static const int32_t *
types_from(const int32_t *types, int64_t first)
{
    return types != NULL ? types + first : NULL;
}

static const int64_t *
labels_from(const int64_t *labels, int64_t first)
{
    return labels != NULL ? labels + first : NULL;
}

hs_reach
hs_reach_of_system(const hs_systems *systems, int ndim, int64_t s)
{
    const int64_t first = systems->first[s];
    const int64_t query = systems->first_query != NULL ? systems->first_query[s] : 0;
    const int64_t entries = (int64_t)ndim * ndim;
    hs_reach      reach = *systems->reach;
    reach.radii = numbers_from(reach.radii, first);
    reach.query_radii = numbers_from(reach.query_radii, query);
    reach.types = types_from(reach.types, first);
    reach.query_types = types_from(reach.query_types, query);
    reach.supports = numbers_from(reach.supports, first * entries);
    reach.query_supports = numbers_from(reach.query_supports, query * entries);
    return reach;
}

/* How many points, or queries, come before those of system s. */
static int64_t
first_asking(const hs_system_sets *sets, int64_t s)
{
    return sets->queries != NULL ? sets->systems->first_query[s] : sets->systems->first[s];
}

/* The system that has the point of this number, by where each of n systems begins. */
static int64_t
system_of(const int64_t *first, int64_t n, int64_t number)
{
    int64_t low = 0, high = n; /* first[low] <= number < first[high] */
    while (high - low > 1) {
        const int64_t middle = low + (high - low) / 2;
        if (first[middle] <= number) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

/* The system of both points of an excluded pair, or -1 for those of two systems. */
static int64_t
system_of_pair(const hs_system_sets *sets, const int64_t *pair)
{
    const hs_systems *systems = sets->systems;
    const int64_t    *first = sets->queries != NULL ? systems->first_query : systems->first;
    const int64_t     s = system_of(first, systems->n, pair[0]);
    return pair[1] >= systems->first[s] && pair[1] < systems->first[s + 1] ? s : -1;
}

hs_status
hs_excluded_parts_open(const hs_system_sets *sets, hs_account *account, hs_excluded_parts *parts)
{
    const hs_systems   *systems = sets->systems;
    const hs_selection *selection = systems->selection;
    const int64_t       n = systems->n;
    *parts = (hs_excluded_parts){NULL, NULL};
    if (selection == NULL || selection->n_excluded == 0) {
        return HS_OK;
    }
    parts->first = hs_alloc(account, HS_FOR_CANDIDATES, n + 2, sizeof *parts->first);
    parts->pairs =
        hs_alloc(account, HS_FOR_CANDIDATES, 2 * selection->n_excluded, sizeof *parts->pairs);
    if (parts->first == NULL || parts->pairs == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(parts->first, 0, (size_t)(n + 2) * sizeof *parts->first);
    for (int64_t e = 0; e < selection->n_excluded; e++) {
        const int64_t s = system_of_pair(sets, selection->excluded + 2 * e);
        parts->first[s + 2] += s >= 0; /* of pairs of two systems none is added */
    }
    hs_starts_of_lengths(parts->first + 1, n + 1);
    for (int64_t e = 0; e < selection->n_excluded; e++) {
        const int64_t *pair = selection->excluded + 2 * e;
        const int64_t  s = system_of_pair(sets, pair);
        if (s >= 0) {
            const int64_t at = parts->first[s + 1]++;
            parts->pairs[2 * at] = pair[0] - first_asking(sets, s);
            parts->pairs[2 * at + 1] = pair[1] - systems->first[s];
        }
    }
    return HS_OK;
}

void
hs_excluded_parts_free(hs_account *account, hs_excluded_parts *parts)
{
    hs_free(account, parts->first);
    hs_free(account, parts->pairs);
    *parts = (hs_excluded_parts){NULL, NULL};
}

static hs_selection
selection_of(const hs_system_sets *sets, const hs_excluded_parts *excluded, int64_t s)
{
    hs_selection  selection = *sets->systems->selection;
    const int64_t first = sets->systems->first[s];
    const int64_t query = first_asking(sets, s);
    selection.groups = labels_from(selection.groups, first);
    selection.query_groups = labels_from(selection.query_groups, query);
    selection.labels = labels_from(selection.labels, first);
    selection.query_labels = labels_from(selection.query_labels, query);
    if (excluded->first != NULL) {
        selection.n_excluded = excluded->first[s + 1] - excluded->first[s];
        selection.excluded = excluded->pairs + 2 * excluded->first[s];
    }
    return selection;
}

void
hs_system_part_cut(const hs_system_sets *sets, const hs_excluded_parts *excluded, int64_t s,
                   hs_system_part *part)
{
    const hs_systems *systems = sets->systems;
    const int         ndim = sets->points->ndim;
    part->system = s;
    part->first_point = systems->first[s];
    part->first_asking = first_asking(sets, s);
    part->points = hs_points_of_system(sets->points, systems->first, s);
    part->n_asking = part->points.n;
    part->among = (hs_among){.points = &part->points};
    part->among.box = hs_box_of_system(systems, ndim, s, &part->own_box);
    if (sets->queries != NULL) {
        part->queries = hs_points_of_system(sets->queries, systems->first_query, s);
        part->n_asking = part->queries.n;
        part->among.queries = &part->queries;
    }
    if (systems->reach != NULL) {
        part->reach = hs_reach_of_system(systems, ndim, s);
        part->among.reach = &part->reach;
    }
    if (systems->selection != NULL) {
        part->selection = selection_of(sets, excluded, s);
        part->among.selection = &part->selection;
    }
}
