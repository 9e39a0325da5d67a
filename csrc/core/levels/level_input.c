/* SPDX-License-Identifier: BSD-3-Clause */
/* level_input.c: each number of the caller is read once, into a copy that is then worked on. */
#include "level_input.h"

#include "../scene/points.h"

/* Radii that no sum or half of the rules takes out of float64's range. */
#define LARGEST_RADIUS  0x1p1022
#define SMALLEST_HALVED 0x1p-1021

/* Radii that have an extent, where they are not 0: the two words of the product are float64s, and
 * no two radii are so different that they could not be told apart by their size. */
#define SMALLEST_EXTENDED 0x1p-500
#define LARGEST_EXTENDED  0x1p500

static hs_status
refuse(hs_status status, const hs_level_input *set, int64_t row, double value, hs_failure *failure)
{
    failure->row = row;
    failure->value = value;
    failure->in_queries = set->are_queries;
    return status;
}

bool
hs_division_go_on(const hs_division *by, int64_t n, hs_slice *next, hs_status *status)
{
    if (*status == HS_OK && next->end > 0 && next->end < n) {
        *status = hs_poll(by->options, 0.0);
    }
    next->first = next->end;
    next->end = n - next->first < HS_POLL_POINTS ? n : next->first + HS_POLL_POINTS;
    return *status == HS_OK && next->first < n;
}

static hs_status
read_radii(hs_division *by, hs_level_input *set, hs_failure *failure)
{
    const bool    halves = by->reach->rule == HS_RULE_MEAN, extends = by->factor != 1.0;
    const double  largest = extends ? LARGEST_EXTENDED : LARGEST_RADIUS;
    const double  smallest = extends ? SMALLEST_EXTENDED : halves ? SMALLEST_HALVED : 0.0;
    const int64_t n = set->radii != NULL ? set->points->n : 0;
    hs_slice      next = {0, 0};
    hs_status     status = HS_OK;
    while (hs_division_go_on(by, n, &next, &status)) {
        for (int64_t i = next.first; i < next.end; i++) {
            const double radius = set->radii[i] + 0.0; /* and no -0 */
            if (!(radius >= 0.0 && radius <= largest) || (radius > 0.0 && radius < smallest)) {
                return refuse(HS_ERR_RADII, set, i, radius, failure);
            }
            set->copy[i] = halves ? 0.5 * radius : radius;
            by->largest = hs_larger(by->largest, set->copy[i]);
        }
    }
    return status;
}

static hs_status
read_supports(hs_division *by, hs_level_input *set, hs_failure *failure)
{
    const int64_t n = set->points->n;
    hs_status     status = HS_OK;
    if (set->supports != NULL) {
        status = hs_support_set_read(by->account, by->options, set->supports, n, set->points->ndim,
                                     by->reach->extent, &set->read, set->copy, failure);
        failure->in_queries = set->are_queries;
    }
    for (int64_t i = 0; status == HS_OK && set->supports != NULL && i < n; i++) {
        by->largest = hs_larger(by->largest, set->copy[i]);
    }
    return status;
}

static hs_status
read_types(const hs_division *by, hs_level_input *set, hs_failure *failure)
{
    hs_slice  next = {0, 0};
    hs_status status = HS_OK;
    while (hs_division_go_on(by, set->points->n, &next, &status)) {
        for (int64_t i = next.first; i < next.end; i++) {
            const int32_t type = set->types[i];
            if (type < 0 || type >= by->reach->n_types) {
                return refuse(HS_ERR_TYPES, set, i, type, failure);
            }
            set->size[i] = type;
            by->count[type]++;
        }
    }
    return status;
}

static hs_status
read_rows(const hs_division *by, hs_level_input *set, hs_failure *failure)
{
    hs_slice  next = {0, 0};
    hs_status status = HS_OK;
    while (hs_division_go_on(by, set->points->n, &next, &status)) {
        hs_points part = *set->points;
        part.data = (const char *)part.data + next.first * part.row_stride;
        part.n = next.end - next.first;
        status = hs_points_copy_finite(&part, set->rows + next.first * part.ndim, failure);
        if (status != HS_OK) {
            failure->row += next.first;
            failure->in_queries = set->are_queries;
        }
    }
    return status;
}

hs_status
hs_level_input_read(hs_division *by, hs_level_input *set, hs_failure *failure)
{
    const int64_t n = set->points->n;
    set->rows = hs_alloc(by->account, HS_FOR_POINTS, n * set->points->ndim, sizeof *set->rows);
    set->copy = hs_alloc(by->account, HS_FOR_POINTS, n, sizeof *set->copy);
    set->size = hs_alloc(by->account, HS_FOR_ORDER, n, sizeof *set->size);
    if (set->rows == NULL || set->copy == NULL || set->size == NULL) {
        return HS_ERR_MEMORY;
    }
    const hs_status status = by->reach->has_supports  ? read_supports(by, set, failure)
                             : by->reach->n_types > 0 ? read_types(by, set, failure)
                                                      : read_radii(by, set, failure);
    return status == HS_OK ? read_rows(by, set, failure) : status;
}

void
hs_level_input_free(hs_account *account, hs_level_input *set)
{
    hs_free(account, set->rows);
    hs_free(account, set->copy);
    hs_free(account, set->size);
    hs_support_set_free(account, &set->read);
}
