/* SPDX-License-Identifier: BSD-3-Clause */
/* levels.c: one pass finds the level of each point, a counting sort puts the levels in order. */
#include "levels.h"

#include "../scene/points.h"

#include <math.h>
#include <string.h>

/* Sizes count the binary orders of a radius below the largest one, and zero as the smallest. */
#define LEAST_EXPONENT (-1074)
#define N_SIZES        (1 - LEAST_EXPONENT)

/* Radii that no sum or half of the rules takes out of float64's range. */
#define LARGEST_RADIUS  0x1p1022
#define SMALLEST_HALVED 0x1p-1021

/* What is divided, and by what. */
typedef struct division {
    hs_account     *account;
    const hs_reach *reach;
    int64_t        *count; /* owned; points of each size or type, in both sets */
    int32_t         n_sizes;
    double          largest; /* of all radii */
} division;

/* A set of points while it is divided. */
typedef struct division_set {
    const hs_points *points;
    const double    *radii;
    const int32_t   *types;
    bool             are_queries;
    double          *rows; /* owned, in the caller's order, as are all of these */
    double          *copy; /* of the radii */
    int32_t         *size; /* of each point */
} division_set;

/* Ascends with the radius: the largest size are radii above half of the largest one, and so on, so
 * that radii which differ little are of one or two sizes. */
static int32_t
size_of(double radius, double largest)
{
    const double part = radius > 0.0 ? radius / largest : 0.0;
    return part == 0.0 ? 0 : part == 1.0 ? N_SIZES - 1 : ilogb(part) - LEAST_EXPONENT + 1;
}

static hs_status
refuse(hs_status status, const division_set *set, int64_t row, double value, hs_failure *failure)
{
    failure->row = row;
    failure->value = value;
    failure->in_queries = set->are_queries;
    return status;
}

static hs_status
read_radii(division *by, division_set *set, hs_failure *failure)
{
    const bool halves = by->reach->rule == HS_RULE_MEAN;
    for (int64_t i = 0; set->radii != NULL && i < set->points->n; i++) {
        const double radius = set->radii[i] + 0.0; /* and no -0 */
        if (!(radius >= 0.0 && radius <= LARGEST_RADIUS) ||
            (halves && radius > 0.0 && radius < SMALLEST_HALVED)) {
            return refuse(HS_ERR_RADII, set, i, radius, failure);
        }
        set->copy[i] = halves ? 0.5 * radius : radius;
        by->largest = hs_larger(by->largest, set->copy[i]);
    }
    return HS_OK;
}

/* Once the largest radius is known. Sets without any are of one size. */
static void
find_sizes(const division *by, division_set *set)
{
    for (int64_t i = 0; i < set->points->n; i++) {
        set->size[i] = set->radii != NULL ? size_of(set->copy[i], by->largest) : 0;
        by->count[set->size[i]]++;
    }
}

static hs_status
read_types(const division *by, division_set *set, hs_failure *failure)
{
    for (int64_t i = 0; i < set->points->n; i++) {
        const int32_t type = set->types[i];
        if (type < 0 || type >= by->reach->n_types) {
            return refuse(HS_ERR_TYPES, set, i, type, failure);
        }
        set->size[i] = type;
        by->count[type]++;
    }
    return HS_OK;
}

static hs_status
read_rows(division_set *set, hs_failure *failure)
{
    const int64_t n = set->points->n;
    const int     d = set->points->ndim;
    hs_points_copy(set->points, set->rows);
    for (int64_t i = 0; i < n * d; i++) {
        if (!isfinite(set->rows[i])) {
            failure->column = i % d;
            return refuse(HS_ERR_NOT_FINITE, set, i / d, set->rows[i], failure);
        }
    }
    return HS_OK;
}

static hs_status
read_set(division *by, division_set *set, hs_failure *failure)
{
    const int64_t n = set->points->n;
    set->rows = hs_alloc(by->account, HS_FOR_POINTS, n * set->points->ndim, sizeof *set->rows);
    set->copy = hs_alloc(by->account, HS_FOR_POINTS, n, sizeof *set->copy);
    set->size = hs_alloc(by->account, HS_FOR_ORDER, n, sizeof *set->size);
    if (set->rows == NULL || set->copy == NULL || set->size == NULL) {
        return HS_ERR_MEMORY;
    }
    const hs_status status = by->reach->n_types > 0 ? read_types(by, set, failure)
                                                    : read_radii(by, set, failure);
    return status == HS_OK ? read_rows(set, failure) : status;
}

static void
free_set(hs_account *account, division_set *set)
{
    hs_free(account, set->rows);
    hs_free(account, set->copy);
    hs_free(account, set->size);
}

/* Gives each size that occurs a level, in count; returns how many there are. */
static int32_t
number_levels(const division *by)
{
    int32_t n = 0;
    for (int32_t s = 0; s < by->n_sizes; s++) {
        by->count[s] = by->count[s] > 0 ? n++ : -1;
    }
    return n;
}

static bool
allocate_set(const division *by, const division_set *from, int32_t n_levels, hs_level_set *to)
{
    const int64_t n = from->points->n;
    to->n = n;
    to->ndim = from->points->ndim;
    to->rows = hs_alloc(by->account, HS_FOR_POINTS, n * to->ndim, sizeof *to->rows);
    to->number = hs_alloc(by->account, HS_FOR_ORDER, n, sizeof *to->number);
    to->first = hs_alloc(by->account, HS_FOR_CELLS, (int64_t)n_levels + 1, sizeof *to->first);
    to->radii = NULL;
    if (from->radii != NULL) {
        to->radii = hs_alloc(by->account, HS_FOR_POINTS, n, sizeof *to->radii);
    }
    return to->rows != NULL && to->number != NULL && to->first != NULL &&
           (to->radii != NULL || from->radii == NULL);
}

/* Puts the points in the order of their levels. */
static hs_status
arrange(const division *by, const division_set *from, int32_t n_levels, hs_level_set *to)
{
    if (!allocate_set(by, from, n_levels, to)) {
        return HS_ERR_MEMORY;
    }
    const size_t bytes = (size_t)to->ndim * sizeof(double);
    int64_t *next = to->first; /* where each level goes on; then, where the one before it ends */
    memset(next, 0, ((size_t)n_levels + 1) * sizeof *next);
    for (int64_t i = 0; i < to->n; i++) {
        next[by->count[from->size[i]] + 1]++;
    }
    for (int32_t l = 0; l < n_levels; l++) {
        next[l + 1] += next[l];
    }
    for (int64_t i = 0; i < to->n; i++) {
        const int64_t at = next[by->count[from->size[i]]]++;
        memcpy(to->rows + at * to->ndim, from->rows + i * to->ndim, bytes);
        to->number[at] = (int32_t)i;
        if (to->radii != NULL) {
            to->radii[at] = from->copy[i];
        }
    }
    for (int32_t l = n_levels; l > 0; l--) {
        next[l] = next[l - 1];
    }
    next[0] = 0;
    return HS_OK;
}

/* The cutoffs of those types that occur, in the order of their levels. */
static hs_status
read_cutoffs(const division *by, hs_levels *levels, hs_failure *failure)
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
divide(division *by, division_set *points, division_set *queries, hs_levels *levels,
       hs_failure *failure)
{
    const bool has_types = by->reach->n_types > 0;
    by->n_sizes = has_types ? by->reach->n_types : N_SIZES;
    by->count = hs_alloc(by->account, HS_FOR_CELLS, by->n_sizes, sizeof *by->count);
    if (by->count == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(by->count, 0, (size_t)by->n_sizes * sizeof *by->count);
    hs_status status = read_set(by, points, failure);
    if (status == HS_OK && queries->points != NULL) {
        status = read_set(by, queries, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    if (!has_types) {
        find_sizes(by, points);
    }
    if (!has_types && queries->points != NULL) {
        find_sizes(by, queries);
    }
    levels->n = number_levels(by);
    status = has_types ? read_cutoffs(by, levels, failure) : HS_OK;
    if (status == HS_OK) {
        status = arrange(by, points, levels->n, &levels->points);
    }
    if (status == HS_OK && queries->points != NULL) {
        status = arrange(by, queries, levels->n, &levels->queries);
    }
    return status;
}

hs_status
hs_levels_divide(hs_account *account, const hs_points *points, const hs_points *queries,
                 const hs_reach *reach, hs_levels *levels, hs_failure *failure)
{
    division     by = {.account = account, .reach = reach};
    const bool   has_types = reach->n_types > 0;
    division_set of_points = {
        .points = points, .radii = has_types ? NULL : reach->radii, .types = reach->types};
    division_set of_queries = {.points = queries,
                               .radii = has_types ? NULL : reach->query_radii,
                               .types = reach->query_types,
                               .are_queries = true};
    *levels = (hs_levels){.rule = reach->rule, .has_queries = queries != NULL};
    const hs_status status = divide(&by, &of_points, &of_queries, levels, failure);
    free_set(account, &of_points);
    free_set(account, &of_queries);
    hs_free(account, by.count);
    if (status != HS_OK) {
        hs_levels_free(account, levels);
    }
    return status;
}

static void
free_level_set(hs_account *account, hs_level_set *set)
{
    hs_free(account, set->rows);
    hs_free(account, set->number);
    hs_free(account, set->radii);
    hs_free(account, set->first);
}

void
hs_levels_free(hs_account *account, hs_levels *levels)
{
    free_level_set(account, &levels->points);
    free_level_set(account, &levels->queries);
    hs_free(account, levels->cutoffs);
    *levels = (hs_levels){.n = 0};
}

hs_points
hs_level_points(const hs_level_set *set, hs_slice levels)
{
    const int64_t first = set->first[levels.first];
    return (hs_points){.data = set->rows + first * set->ndim,
                       .n = set->first[levels.end] - first,
                       .ndim = set->ndim,
                       .real = HS_FLOAT64,
                       .row_stride = set->ndim * (ptrdiff_t)sizeof(double),
                       .column_stride = sizeof(double)};
}
