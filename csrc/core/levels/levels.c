/* SPDX-License-Identifier: BSD-3-Clause */
/* levels.c: one pass finds the level of each point, a counting sort puts the levels in order. */
#include "levels.h"

#include "../base/starts.h"
#include "../scene/points.h"

#include <math.h>
#include <string.h>

/* Sizes count the binary orders of a radius below the largest one, and zero as the smallest. */
#define LEAST_EXPONENT (-1074)
#define N_SIZES        (1 - LEAST_EXPONENT)

/* Radii that no sum or half of the rules takes out of float64's range. */
#define LARGEST_RADIUS  0x1p1022
#define SMALLEST_HALVED 0x1p-1021

/* Radii that have an extent, where they are not 0: the two words of the product are float64s, and
 * no two radii are so different that they could not be told apart by their size. */
#define SMALLEST_EXTENDED 0x1p-500
#define LARGEST_EXTENDED  0x1p500

/* What is divided, and by what. */
typedef struct division {
    hs_account       *account;
    const hs_options *options; /* to poll by */
    const hs_reach   *reach;
    int64_t          *count; /* owned; points of each size or type, in both sets */
    int32_t           n_sizes;
    double            factor;
    double            largest; /* of all radii */
} division;

/* A set of points while it is divided. */
typedef struct division_set {
    const hs_points *points;
    const double    *radii;
    const int32_t   *types;
    const double    *supports;
    bool             are_queries;
    double          *rows; /* owned, in the caller's order, as are all of these */
    double          *copy; /* of the radii, or how far supports reach */
    int32_t         *size; /* of each point */
    hs_support_set   read; /* of the supports */
} division_set;

static bool
has_radii(const division_set *set)
{
    return set->radii != NULL || set->supports != NULL;
}

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

/* Passes go over HS_POLL_POINTS at a time and poll in between. The next ones of n; false where
 * there are none, after a failure, or where the caller wants to stop, which *status says. */
static bool
go_on(const division *by, int64_t n, hs_slice *next, hs_status *status)
{
    if (*status == HS_OK && next->end > 0 && next->end < n) {
        *status = hs_poll(by->options, 0.0);
    }
    next->first = next->end;
    next->end = n - next->first < HS_POLL_POINTS ? n : next->first + HS_POLL_POINTS;
    return *status == HS_OK && next->first < n;
}

static hs_status
read_radii(division *by, division_set *set, hs_failure *failure)
{
    const bool    halves = by->reach->rule == HS_RULE_MEAN, extends = by->factor != 1.0;
    const double  largest = extends ? LARGEST_EXTENDED : LARGEST_RADIUS;
    const double  smallest = extends ? SMALLEST_EXTENDED : halves ? SMALLEST_HALVED : 0.0;
    const int64_t n = set->radii != NULL ? set->points->n : 0;
    hs_slice      next = {0, 0};
    hs_status     status = HS_OK;
    while (go_on(by, n, &next, &status)) {
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
read_supports(division *by, division_set *set, hs_failure *failure)
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

/* Once the largest radius is known. Sets without any are of one size. */
static hs_status
find_sizes(const division *by, division_set *set)
{
    hs_slice  next = {0, 0};
    hs_status status = HS_OK;
    while (go_on(by, set->points->n, &next, &status)) {
        for (int64_t i = next.first; i < next.end; i++) {
            set->size[i] = has_radii(set) ? size_of(set->copy[i], by->largest) : 0;
            by->count[set->size[i]]++;
        }
    }
    return status;
}

static hs_status
read_types(const division *by, division_set *set, hs_failure *failure)
{
    hs_slice  next = {0, 0};
    hs_status status = HS_OK;
    while (go_on(by, set->points->n, &next, &status)) {
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
read_rows(const division *by, division_set *set, hs_failure *failure)
{
    hs_slice  next = {0, 0};
    hs_status status = HS_OK;
    while (go_on(by, set->points->n, &next, &status)) {
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
    const hs_status status = by->reach->has_supports  ? read_supports(by, set, failure)
                             : by->reach->n_types > 0 ? read_types(by, set, failure)
                                                      : read_radii(by, set, failure);
    return status == HS_OK ? read_rows(by, set, failure) : status;
}

static void
free_set(hs_account *account, division_set *set)
{
    hs_free(account, set->rows);
    hs_free(account, set->copy);
    hs_free(account, set->size);
    hs_support_set_free(account, &set->read);
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
    if (has_radii(from)) {
        to->radii = hs_alloc(by->account, HS_FOR_POINTS, n, sizeof *to->radii);
    }
    return to->rows != NULL && to->number != NULL && to->first != NULL &&
           (to->radii != NULL || !has_radii(from));
}

/* Puts the points in the order of their levels. */
static hs_status
arrange(const division *by, division_set *from, int32_t n_levels, hs_level_set *to)
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
    while (go_on(by, to->n, &part, &status)) {
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
    const bool   has_supports = reach->has_supports, has_types = reach->n_types > 0;
    const bool   has_own = !has_types && !has_supports; /* radii */
    const double factor = has_own && reach->extent != 0.0 ? reach->extent : 1.0;
    division     by = {.account = account, .options = options, .reach = reach, .factor = factor};
    division_set of_points = {.points = points,
                              .radii = has_own ? reach->radii : NULL,
                              .types = reach->types,
                              .supports = has_supports ? reach->supports : NULL};
    division_set of_queries = {.points = queries,
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
    hs_support_set_free(account, &set->supports);
}

void
hs_levels_renumber(int32_t first, hs_levels *levels)
{
    for (int64_t at = 0; at < levels->points.n; at++) {
        levels->points.number[at] += first;
    }
    levels->points.supports.first += first;
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
