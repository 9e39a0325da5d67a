/* SPDX-License-Identifier: BSD-3-Clause */
/* level_divide.c: one pass finds the level of each point, a counting sort puts the levels in
 * order. */
#include "level_input.h"

#include "../base/starts.h"

#include <math.h>
#include <string.h>

/* Sizes count the binary orders of a radius below the largest one, and zero as the smallest. */
#define LEAST_EXPONENT (-1074)
#define N_SIZES        (1 - LEAST_EXPONENT)

/* Ascends with the radius: the largest size are radii above half of the largest one, and so on, so
 * that radii which differ little are of one or two sizes. */
static int32_t
size_of(double radius, double largest)
{
    const double part = radius > 0.0 ? radius / largest : 0.0;
    return part == 0.0 ? 0 : part == 1.0 ? N_SIZES - 1 : ilogb(part) - LEAST_EXPONENT + 1;
}

/* Once the largest radius is known. Sets without any are of one size. */
static hs_status
find_sizes(const hs_division *by, hs_level_input *set)
{
    hs_slice  next = {0, 0};
    hs_status status = HS_OK;
    while (hs_division_go_on(by, set->points->n, &next, &status)) {
        for (int64_t i = next.first; i < next.end; i++) {
            set->size[i] = hs_level_input_has_radii(set) ? size_of(set->copy[i], by->largest) : 0;
            by->count[set->size[i]]++;
        }
    }
    return status;
}

/* Gives each size that occurs a level, in count; returns how many there are. */
static int32_t
number_levels(const hs_division *by)
{
    int32_t n = 0;
    for (int32_t s = 0; s < by->n_sizes; s++) {
        by->count[s] = by->count[s] > 0 ? n++ : -1;
    }
    return n;
}

static bool
allocate_set(const hs_division *by, const hs_level_input *from, int32_t n_levels, hs_level_set *to)
{
    const int64_t n = from->points->n;
    to->n = n;
    to->ndim = from->points->ndim;
    to->rows = hs_alloc(by->account, HS_FOR_POINTS, n * to->ndim, sizeof *to->rows);
    to->number = hs_alloc(by->account, HS_FOR_ORDER, n, sizeof *to->number);
    to->first = hs_alloc(by->account, HS_FOR_CELLS, (int64_t)n_levels + 1, sizeof *to->first);
    to->radii = NULL;
    if (hs_level_input_has_radii(from)) {
        to->radii = hs_alloc(by->account, HS_FOR_POINTS, n, sizeof *to->radii);
    }
    return to->rows != NULL && to->number != NULL && to->first != NULL &&
           (to->radii != NULL || !hs_level_input_has_radii(from));
}

/* Puts the points in the order of their levels. */
static hs_status
arrange(const hs_division *by, hs_level_input *from, int32_t n_levels, hs_level_set *to)
{
    if (!allocate_set(by, from, n_levels, to)) {
        return HS_ERR_MEMORY;
    }
    const size_t bytes = (size_t)to->ndim * sizeof(double);
    hs_slice     part = {0, 0};
    hs_status    status = HS_OK;
    int64_t *next = to->first; /* where each level goes on; then, where the one before it ends */
    memset(next, 0, ((size_t)n_levels + 1) * sizeof *next);
    for (int64_t i = 0; i < to->n; i++) {
        next[by->count[from->size[i]] + 1]++;
    }
    hs_starts_of_lengths(next, (int64_t)n_levels + 1);
    while (hs_division_go_on(by, to->n, &part, &status)) {
        for (int64_t i = part.first; i < part.end; i++) {
            const int64_t at = next[by->count[from->size[i]]]++;
            memcpy(to->rows + at * to->ndim, from->rows + i * to->ndim, bytes);
            to->number[at] = (int32_t)i;
            if (to->radii != NULL) {
                to->radii[at] = from->copy[i];
            }
        }
    }
    hs_starts_of_ends(next, (int64_t)n_levels + 1);
    to->supports = from->read;
    from->read.numbers = NULL;
    return status;
}

/* The cutoffs of those types that occur, in the order of their levels. */
static hs_status
read_cutoffs(const hs_division *by, hs_levels *levels, hs_failure *failure)
{
    const int32_t n_types = by->reach->n_types, n = levels->n;
    levels->cutoffs = hs_alloc(by->account, HS_FOR_CELLS, (int64_t)n * n, sizeof *levels->cutoffs);
    if (levels->cutoffs == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int32_t a = 0; a < n_types; a++) {
        for (int32_t b = 0; b < n_types; b++) {
            const double cutoff = by->reach->cutoffs[(int64_t)a * n_types + b];
            if (!isfinite(cutoff) || cutoff != by->reach->cutoffs[(int64_t)b * n_types + a]) {
                failure->value = cutoff;
                return HS_ERR_CUTOFF;
            }
            if (by->count[a] >= 0 && by->count[b] >= 0) {
                levels->cutoffs[by->count[a] * n + by->count[b]] = cutoff < 0.0 ? -1.0 : cutoff;
            }
        }
    }
    return HS_OK;
}

static hs_status
divide(hs_division *by, hs_level_input *points, hs_level_input *queries, hs_levels *levels,
       hs_failure *failure)
{
    const bool has_types = by->reach->n_types > 0;
    by->n_sizes = has_types ? by->reach->n_types : N_SIZES;
    by->count = hs_alloc(by->account, HS_FOR_CELLS, by->n_sizes, sizeof *by->count);
    if (by->count == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(by->count, 0, (size_t)by->n_sizes * sizeof *by->count);
    hs_status status = hs_level_input_read(by, points, failure);
    if (status == HS_OK && queries->points != NULL) {
        status = hs_level_input_read(by, queries, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    if (!has_types) {
        status = find_sizes(by, points);
    }
    if (status == HS_OK && !has_types && queries->points != NULL) {
        status = find_sizes(by, queries);
    }
    levels->n = number_levels(by);
    if (status == HS_OK && has_types) {
        status = read_cutoffs(by, levels, failure);
    }
    if (status == HS_OK) {
        status = arrange(by, points, levels->n, &levels->points);
    }
    if (status == HS_OK && queries->points != NULL) {
        status = arrange(by, queries, levels->n, &levels->queries);
    }
    return status;
}

hs_status
hs_levels_divide(hs_account *account, const hs_options *options, const hs_points *points,
                 const hs_points *queries, const hs_reach *reach, hs_levels *levels,
                 hs_failure *failure)
{
    const bool     has_supports = reach->has_supports, has_types = reach->n_types > 0;
    const bool     has_own = !has_types && !has_supports; /* radii */
    const double   factor = has_own && reach->extent != 0.0 ? reach->extent : 1.0;
    hs_division    by = {.account = account, .options = options, .reach = reach, .factor = factor};
    hs_level_input of_points = {.points = points,
                                .radii = has_own ? reach->radii : NULL,
                                .types = reach->types,
                                .supports = has_supports ? reach->supports : NULL};
    hs_level_input of_queries = {.points = queries,
                                 .radii = has_own ? reach->query_radii : NULL,
                                 .types = reach->query_types,
                                 .supports = has_supports ? reach->query_supports : NULL,
                                 .are_queries = true};
    *levels = (hs_levels){.rule = reach->rule,
                          .factor = factor,
                          .has_queries = queries != NULL,
                          .has_supports = has_supports,
                          .extent = reach->extent};
    const hs_status status = divide(&by, &of_points, &of_queries, levels, failure);
    hs_level_input_free(account, &of_points);
    hs_level_input_free(account, &of_queries);
    hs_free(account, by.count);
    if (status != HS_OK) {
        hs_levels_free(account, levels);
    }
    return status;
}
