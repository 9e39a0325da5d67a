/* SPDX-License-Identifier: BSD-3-Clause */
#include "levels.h"
#include "../base/status.h"
#include "../base/sort.h"
#include "../search/choice.h"

/* levels.c: supports are read and checked, points divided into levels, and steps planned between
 * these; a level as others see it is a set of points by itself. */

/* How far pairs of a step can be apart along an axis of the grid, by their supports: cells go by
 * that, so that needles along an axis have few candidates across it. The largest width of all
 * points is told by a few where they are round or turned in all ways. */

/* A step whose pairs are decided by supports; borrowed. */
typedef struct support_step {
    const hs_levels     *levels;
    const hs_level_step *step;
    const hs_options    *options; /* to poll by */
} support_step;

/* Of the points of some levels, which have supports. Ends where it is enough. */
static hs_status
width_of(const support_step *of, const hs_level_set *set, hs_slice levels, const double *normal,
         double enough, double *width)
{
    const int     size_at = hs_support_entries(set->ndim);
    const int64_t first = set->first[levels.first], end = set->first[levels.end];
    *width = 0.0;
    for (int64_t at = first; at < end && *width < enough; at++) {
        const double *numbers = set->supports.numbers + (set->number[at] - set->supports.first) *
                                                            hs_support_numbers(set->ndim);
        const double own = hs_support_width(set->ndim, numbers, numbers[size_at],
                                            of->levels->extent, set->radii[at], normal);
        *width = hs_larger(*width, own);
        if ((at + 1 - first) % HS_POLL_LEVELS == 0 && hs_poll(of->options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

/* The `find` of a hs_narrowing, whose context is a support_step. */
static hs_status
support_step_width(const void *context, const double *normal, double enough, double *width)
{
    const support_step  *of = context;
    const hs_level_step *step = of->step;
    const hs_level_set  *set = hs_levels_asking(of->levels);
    const hs_rule        rule = of->levels->rule;
    hs_status            status = HS_OK;
    double               asking = 0.0, points = 0.0;
    if (hs_rule_needs_asking(rule)) {
        status = width_of(of, set, step->asking, normal, enough, &asking);
    }
    if (status == HS_OK && hs_rule_needs_other(rule) &&
        !(rule == HS_RULE_MAX && asking >= enough)) {
        status = width_of(of, &of->levels->points, step->points, normal, enough, &points);
    }
    *width = rule == HS_RULE_MIN ? hs_smaller(asking, points) : hs_larger(asking, points);
    return status;
}

static void
free_level_set(hs_account *account, hs_level_set *set)
{
    hs_free(account, set->rows);
    hs_free(account, set->number);
    hs_free(account, set->radii);
    hs_free(account, set->range);
    hs_free(account, set->first);
    hs_free(account, set->supports.numbers);
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

/* The points of these levels, borrowed. */
static hs_points
level_points(const hs_level_set *set, hs_slice levels)
{
    const int64_t first = set->first[levels.first];
    return (hs_points){.data = set->rows + first * set->ndim,
                       .n = set->first[levels.end] - first,
                       .ndim = set->ndim,
                       .real = HS_FLOAT64,
                       .row_stride = set->ndim * (ptrdiff_t)sizeof(double),
                       .column_stride = sizeof(double)};
}

/* Each number of the caller is read once, into a copy that is then worked on. */

/* Radii that no sum or half of the rules takes out of float64's range. */
#define LARGEST_RADIUS  0x1p1022
#define SMALLEST_HALVED 0x1p-1021

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

/* A set of points while it is divided; no points: there is no such set. */
typedef struct level_input {
    const hs_points *points;
    const double    *radii;
    const int32_t   *types;
    const double    *supports;
    bool             are_queries;
    double        *copy; /* owned, in the caller's order, as are all of these; of the radii, or how
                            * far supports reach */
    int32_t       *size; /* of each point; read where there are types, else to be found */
    hs_support_set read; /* of the supports */
} level_input;

static bool
has_radii(const level_input *set)
{
    return set->radii != NULL || set->supports != NULL;
}

/* Radii that have an extent, where they are not 0: the two words of the product are float64s, and
 * no two radii are so different that they could not be told apart by their size. */
#define SMALLEST_EXTENDED 0x1p-500
#define LARGEST_EXTENDED  0x1p500

static hs_status
refuse_input(hs_status status, const level_input *set, int64_t row, double value,
             hs_failure *failure)
{
    failure->row = row;
    failure->value = value;
    failure->in_queries = set->are_queries;
    return status;
}

/* Passes go over HS_POLL_LEVELS at a time and poll in between. The next ones of n; false where
 * there are none, after a failure, or where the caller wants to stop, which *status says. */
static bool
division_go_on(const division *by, int64_t n, hs_slice *next, hs_status *status)
{
    if (*status == HS_OK && next->end > 0 && next->end < n) {
        *status = hs_poll(by->options, 0.0);
    }
    next->first = next->end;
    next->end = n - next->first < HS_POLL_LEVELS ? n : next->first + HS_POLL_LEVELS;
    return *status == HS_OK && next->first < n;
}

/* Support `row`: the lower triangle, each number of the matrix read once, and how far it reaches.
 * Numbers must be finite and equal to their mirror image, of which NaN differs. */
static hs_status
read_support(division *by, level_input *set, int64_t row, hs_failure *failure)
{
    const int     ndim = set->points->ndim;
    const double *matrix = set->supports + row * ndim * ndim;
    double       *numbers = set->read.numbers + row * hs_support_numbers(ndim);
    for (int k = 0; k < ndim; k++) {
        for (int l = 0; l <= k; l++) {
            const double lower = matrix[k * ndim + l] + 0.0; /* and no -0 */
            const double upper = l < k ? matrix[l * ndim + k] : lower;
            numbers[hs_support_at(k, l)] = lower;
            if (!isfinite(lower) || lower != upper) {
                return refuse_input(HS_ERR_SUPPORTS, set, row, isfinite(lower) ? upper : lower,
                                    failure);
            }
        }
    }
    numbers[hs_support_entries(ndim)] = hs_support_size(ndim, numbers);
    switch (hs_support_reach(ndim, numbers, by->reach->extent, &set->copy[row])) {
    case HS_SUPPORT_FITS: by->largest = hs_larger(by->largest, set->copy[row]); return HS_OK;
    case HS_SUPPORT_NOT_DEFINITE:
        return refuse_input(HS_ERR_SUPPORTS, set, row, numbers[0], failure);
    default: return refuse_input(HS_ERR_SUPPORT_REACH, set, row, by->reach->extent, failure);
    }
}

/* Reads what the reach of a set goes by; counts its types, or finds the largest of its radii. On
 * failure as well, it is to be freed. */
static hs_status
read_input(division *by, level_input *set, hs_failure *failure)
{
    const int64_t n = set->points->n;
    const bool    halves = by->reach->rule == HS_RULE_MEAN, extends = by->factor != 1.0;
    const double  largest = extends ? LARGEST_EXTENDED : LARGEST_RADIUS;
    const double  smallest = extends ? SMALLEST_EXTENDED : halves ? SMALLEST_HALVED : 0.0;
    hs_slice      next = {0, 0};
    hs_status     status = HS_OK;
    set->copy = hs_alloc(by->account, HS_FOR_POINTS, n, sizeof *set->copy);
    set->size = hs_alloc(by->account, HS_FOR_ORDER, n, sizeof *set->size);
    if (set->supports != NULL) {
        set->read.numbers = hs_alloc(by->account, HS_FOR_SUPPORTS,
                                     n * hs_support_numbers(set->points->ndim), sizeof(double));
    }
    if (set->copy == NULL || set->size == NULL ||
        (set->supports != NULL && set->read.numbers == NULL)) {
        return HS_ERR_MEMORY;
    }
    while (division_go_on(by, n, &next, &status)) {
        for (int64_t i = next.first; status == HS_OK && i < next.end; i++) {
            if (set->supports != NULL) {
                status = read_support(by, set, i, failure);
            } else if (by->reach->n_types > 0) {
                const int32_t type = set->types[i];
                if (type < 0 || type >= by->reach->n_types) {
                    return refuse_input(HS_ERR_TYPES, set, i, type, failure);
                }
                set->size[i] = type;
                by->count[type]++;
            } else if (set->radii != NULL) {
                const double radius = set->radii[i] + 0.0; /* and no -0 */
                if (!(radius >= 0.0 && radius <= largest) || (radius > 0.0 && radius < smallest)) {
                    return refuse_input(HS_ERR_RADII, set, i, radius, failure);
                }
                set->copy[i] = halves ? 0.5 * radius : radius;
                by->largest = hs_larger(by->largest, set->copy[i]);
            }
        }
    }
    return status;
}

/* Sizes count the binary orders of a radius below the largest one, and zero as the smallest. */
#define LEAST_EXPONENT (-1074)
#define N_SIZES        (1 - LEAST_EXPONENT)

/* Once the largest radius is known: the largest size are radii above half of it, and so on, so that
 * radii which differ little are of one or two sizes. Sets without any are of one size. */
static hs_status
find_sizes(const division *by, level_input *set)
{
    hs_slice  next = {0, 0};
    hs_status status = HS_OK;
    while (division_go_on(by, set->points->n, &next, &status)) {
        for (int64_t i = next.first; i < next.end; i++) {
            const double radius = has_radii(set) ? set->copy[i] : 0.0;
            const double part = radius > 0.0 ? radius / by->largest : 0.0;
            set->size[i] = part == 0.0   ? 0
                           : part == 1.0 ? N_SIZES - 1
                                         : ilogb(part) - LEAST_EXPONENT + 1;
            by->count[set->size[i]]++;
        }
    }
    return status;
}

/* Reads the points in the order of their levels. */
static hs_status
arrange(const division *by, level_input *from, int32_t n_levels, hs_level_set *to,
        hs_failure *failure)
{
    const int64_t n = from->points->n;
    hs_points     one = *from->points;
    one.n = 1;
    to->n = n;
    to->ndim = one.ndim;
    to->rows = hs_alloc(by->account, HS_FOR_POINTS, n * to->ndim, sizeof *to->rows);
    to->number = hs_alloc(by->account, HS_FOR_ORDER, n, sizeof *to->number);
    to->first = hs_alloc(by->account, HS_FOR_CELLS, (int64_t)n_levels + 1, sizeof *to->first);
    if (has_radii(from)) {
        to->radii = hs_alloc(by->account, HS_FOR_POINTS, n, sizeof *to->radii);
        to->range = hs_alloc(by->account, HS_FOR_CELLS, n_levels, sizeof *to->range);
    }
    if (to->rows == NULL || to->number == NULL || to->first == NULL ||
        (has_radii(from) && (to->radii == NULL || to->range == NULL))) {
        return HS_ERR_MEMORY;
    }
    for (int32_t l = 0; to->range != NULL && l < n_levels; l++) {
        to->range[l] = (hs_radii_range){HUGE_VAL, 0.0, HUGE_VAL};
    }
    for (int k = 0; k < to->ndim; k++) {
        to->lower[k] = HUGE_VAL;
        to->upper[k] = -HUGE_VAL;
    }
    hs_slice  part = {0, 0};
    hs_status status = HS_OK;
    int64_t  *next = to->first; /* where each level goes on; then, where the one before it ends */
    memset(next, 0, ((size_t)n_levels + 1) * sizeof *next);
    for (int64_t i = 0; i < to->n; i++) {
        next[by->count[from->size[i]] + 1]++;
    }
    hs_starts_of_lengths(next, (int64_t)n_levels + 1);
    while (division_go_on(by, to->n, &part, &status)) {
        for (int64_t i = part.first; status == HS_OK && i < part.end; i++) {
            const int64_t level = by->count[from->size[i]], at = next[level]++;
            double       *row = to->rows + at * to->ndim;
            one.data = (const char *)from->points->data + i * one.row_stride;
            status = hs_points_copy_finite(&one, row, failure);
            failure->row = status == HS_OK ? failure->row : i;
            failure->in_queries = from->are_queries && status != HS_OK;
            for (int k = 0; k < to->ndim && status == HS_OK; k++) {
                to->lower[k] = hs_smaller(row[k], to->lower[k]);
                to->upper[k] = hs_larger(row[k], to->upper[k]);
            }
            to->number[at] = (int32_t)i;
            if (to->radii != NULL) {
                hs_radii_range *range = &to->range[level];
                const double    radius = to->radii[at] = from->copy[i];
                range->smallest = hs_smaller(range->smallest, radius);
                range->largest = hs_larger(range->largest, radius);
                range->least = radius > 0.0 ? hs_smaller(range->least, radius) : range->least;
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

/* inputs: points, and queries, which may be none. */
static hs_status
divide(division *by, level_input *inputs, hs_levels *levels, hs_failure *failure)
{
    hs_level_set *to[] = {&levels->points, &levels->queries};
    const int     n = inputs[1].points != NULL ? 2 : 1;
    const bool    has_types = by->reach->n_types > 0;
    hs_status     status = HS_OK;
    by->n_sizes = has_types ? by->reach->n_types : N_SIZES;
    by->count = hs_alloc(by->account, HS_FOR_CELLS, by->n_sizes, sizeof *by->count);
    if (by->count == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(by->count, 0, (size_t)by->n_sizes * sizeof *by->count);
    for (int s = 0; s < n && status == HS_OK; s++) {
        status = read_input(by, &inputs[s], failure);
    }
    for (int s = 0; s < n && status == HS_OK && !has_types; s++) {
        status = find_sizes(by, &inputs[s]);
    }
    for (int32_t s = 0; s < by->n_sizes; s++) { /* each size that occurs becomes a level */
        by->count[s] = by->count[s] > 0 ? levels->n++ : -1;
    }
    if (status == HS_OK && has_types) {
        status = read_cutoffs(by, levels, failure);
    }
    for (int s = 0; s < n && status == HS_OK; s++) {
        status = arrange(by, &inputs[s], levels->n, to[s], failure);
    }
    return status;
}

hs_status
hs_levels_divide(hs_account *account, const hs_options *options, const hs_set *points,
                 const hs_set *queries, const hs_reach *reach, hs_levels *levels,
                 hs_failure *failure)
{
    const bool   has_own = reach->n_types == 0 && !reach->has_supports; /* radii */
    const double factor = has_own && reach->extent != 0.0 ? reach->extent : 1.0;
    division     by = {.account = account, .options = options, .reach = reach, .factor = factor};
    level_input  inputs[2] = {{.are_queries = false}, {.are_queries = true}};
    for (int n = 0; n < 2; n++) { /* as far as the reach goes by it */
        const hs_set *set = n == 0 ? points : queries;
        if (set != NULL) {
            inputs[n].points = &set->at;
            inputs[n].radii = has_own ? set->radii : NULL;
            inputs[n].types = reach->n_types > 0 ? set->types : NULL;
            inputs[n].supports = reach->has_supports ? set->supports : NULL;
        }
    }
    *levels = (hs_levels){.rule = reach->rule,
                          .factor = factor,
                          .has_queries = queries != NULL,
                          .has_supports = reach->has_supports,
                          .extent = reach->extent};
    const hs_status status = divide(&by, inputs, levels, failure);
    for (int n = 0; n < 2; n++) {
        hs_free(account, inputs[n].copy);
        hs_free(account, inputs[n].size);
        hs_free(account, inputs[n].read.numbers);
    }
    hs_free(account, by.count);
    if (status != HS_OK) {
        hs_levels_free(account, levels);
    }
    return status;
}

/*
 * The steps by rule. With a sum, the larger of two points decides nearly alone once the other one
 * is an eighth of it: only the two levels below a level are searched by themselves.
 */

/* Levels below another that are searched one by one for a sum of radii. */
#define APART 2

/* Steps that a level begins, at most: with itself, with those below it, and these with it. */
#define MOST_STEPS (1 + 2 * (APART + 1))

/* Times a product of two float64s, less than what its low word is a multiple of. */
#define LOW_WORD 0x1p-110

/* Of a slice that has a point; least 0 where all are. */
static hs_radii_range
range_of(const hs_level_set *set, hs_slice levels)
{
    hs_radii_range all = {HUGE_VAL, 0.0, HUGE_VAL};
    for (int64_t l = levels.first; set->range != NULL && l < levels.end; l++) {
        all.smallest = hs_smaller(all.smallest, set->range[l].smallest);
        all.largest = hs_larger(all.largest, set->range[l].largest);
        all.least = hs_smaller(all.least, set->range[l].least);
    }
    all.smallest = set->range != NULL ? all.smallest : 0.0;
    all.least = all.least < HUGE_VAL ? all.least : 0.0;
    return all;
}

static bool
is_empty(const hs_level_set *set, hs_slice levels)
{
    return levels.first >= levels.end || set->first[levels.first] == set->first[levels.end];
}

static void
add_step(hs_level_plan *plan, hs_slice asking, hs_slice points, bool is_own)
{
    const hs_levels    *levels = plan->levels;
    const hs_level_set *askers = hs_levels_asking(levels);
    if (is_empty(askers, asking) || is_empty(&levels->points, points)) {
        return;
    }
    hs_level_step step = {.asking = asking, .points = points, .is_own = is_own};
    if (levels->cutoffs != NULL) {
        step.cutoff = levels->cutoffs[asking.first * levels->n + points.first];
        if (step.cutoff < 0.0) {
            return;
        }
        step.cutoff = hs_smaller(step.cutoff, plan->bound);
        plan->steps[plan->n++] = step;
        return;
    }
    const hs_radii_range a = range_of(askers, asking), b = range_of(&levels->points, points);
    const hs_rule        rule = levels->rule;
    const hs_dw low = hs_limit_by(rule, levels->factor, a.smallest, b.smallest, plan->bound);
    const hs_dw high = hs_limit_by(rule, levels->factor, a.largest, b.largest, plan->bound);
    step.cutoff = high.lo > 0.0 ? hs_next_up(high.hi) : high.hi;
    step.least = a.least > 0.0 && !(b.least > 0.0 && b.least < a.least) ? a.least : b.least;
    if (levels->factor != 1.0) { /* where lengths are scaled, the low words of products count */
        step.least *= levels->factor * LOW_WORD;
    }
    step.has_limits = levels->has_supports || low.hi != high.hi || low.lo != 0.0 || high.lo != 0.0;
    plan->steps[plan->n++] = step;
}

/* Level l with itself and with all below it, those far below together; with queries, both ways. */
static void
add_below(hs_level_plan *plan, int32_t l, int32_t apart)
{
    const hs_slice own = {l, l + 1};
    const bool     is_half = plan->is_half;
    add_step(plan, own, own, is_half);
    for (int32_t below = l - 1; below >= 0 && below >= l - apart; below--) {
        const hs_slice other = {below, below + 1};
        add_step(plan, own, other, false);
        if (!is_half) {
            add_step(plan, other, own, false);
        }
    }
    const hs_slice rest = {0, l - apart};
    add_step(plan, own, rest, false);
    if (!is_half) {
        add_step(plan, rest, own, false);
    }
}

/*
 * Whether all types are searched at once, with the largest cutoff, and not in pairs. These test
 * fewer candidates, in proportion to the volumes of their cutoffs, but sort every type into cells
 * for every other: with three types that costs two or three times as much.
 */
#define SHARE_OF_PAIRED 0.3

/* How many points these levels have. */
static double
count_of(const hs_level_set *set, hs_slice levels)
{
    return (double)(set->first[levels.end] - set->first[levels.first]);
}

/* Whether there is one search, as far as that does not depend on where the points are. */
static bool
takes_all(const hs_level_plan *plan)
{
    const hs_levels    *levels = plan->levels;
    const hs_level_set *asking = hs_levels_asking(levels), *points = &levels->points;
    const bool          has_types = levels->cutoffs != NULL;
    const int32_t       n = levels->n;
    double              largest = 0.0, share = 0.0;
    if (n < 2 || plan->algorithm == HS_HIERARCHY || (has_types && n > HS_TABLE_TYPES)) {
        return false;
    }
    if (plan->algorithm != HS_AUTO || !has_types) {
        return plan->algorithm != HS_AUTO;
    }
    /* By how much the candidates of all pairs of types are fewer than those of all at once. */
    for (int32_t e = 0; e < n * n; e++) {
        largest = hs_larger(largest, levels->cutoffs[e]);
    }
    const double all = (double)asking->n * (double)points->n;
    for (int32_t e = 0; e < n * n && largest > 0.0 && all > 0.0; e++) {
        const double   volume = pow(hs_larger(levels->cutoffs[e], 0.0) / largest, points->ndim);
        const hs_slice a = {e / n, e / n + 1}, b = {e % n, e % n + 1};
        share += count_of(asking, a) * count_of(points, b) / all * volume;
    }
    return share > SHARE_OF_PAIRED;
}

bool
hs_level_plan_is_single(const hs_level_plan *plan)
{
    const hs_level_step *step = plan->steps;
    const int32_t        n = plan->levels->n;
    return plan->n == 1 && step->points.first == 0 && step->points.end == n &&
           step->asking.first == 0 && step->asking.end == n;
}

void
hs_level_plan_free(hs_account *account, hs_level_plan *plan)
{
    hs_free(account, plan->steps);
    *plan = (hs_level_plan){.n = 0};
}

/* Points are taken to be spread evenly over the box of all. Where they are not, both plans test
 * more than that, and the one with fewer tests is favoured too little. */

#ifdef HS_TESTING
bool hs_test_joins_levels;
#else
enum { hs_test_joins_levels = true };
#endif

/* More levels than this are hardly ever better searched at once. */
#define MOST_JOINED 16

/* A point of a search costs as much as so many tests, in cells and in the walk. Measured: 60 ns
 * with next to no neighbours, 0.25 ns a test. */
#define TESTS_PER_POINT 240.0
/* Candidates for each point within the cutoff: cells are cubes, and three of them wide. */
#define TESTS_PER_PAIR 7.7
/* A test with a limit of its own, over one with the cutoff. */
#define TEST_OF_LIMITS 1.3

/* In tests of one candidate. Levels with themselves are half lists. A box that repeats along all
 * its vectors wraps its points into it. */
static double
cost_of_step(const hs_levels *levels, const hs_box *box, const hs_level_step *step)
{
    const hs_level_set *points = &levels->points, *asking = hs_levels_asking(levels);
    const int           d = points->ndim;
    /* of a cube as large as the ball of the cutoff */
    const double side = step->cutoff * pow(hs_ball_volume(d, 1.0), 1.0 / d);
    const double n_asking = count_of(asking, step->asking);
    const double n_points = step->is_own ? 0.0 : count_of(points, step->points);
    double       pairs = n_asking * (step->is_own ? 0.5 * n_asking : n_points); /* within it */
    for (int k = 0; k < d; k++) {
        double longest = box != NULL ? 0.0 : HUGE_VAL;
        for (int l = 0; box != NULL && l < d; l++) {
            longest += box->periodic[l] ? fabs(box->rows[l][k]) : HUGE_VAL;
        }
        const double extent =
            hs_larger(points->upper[k] - points->lower[k], asking->upper[k] - asking->lower[k]);
        longest = hs_smaller(extent, longest);
        pairs *= side < longest ? side / longest : 1.0;
    }
    return TESTS_PER_POINT * (n_asking + n_points) +
           TESTS_PER_PAIR * (step->has_limits ? TEST_OF_LIMITS : 1.0) * pairs;
}

hs_status
hs_level_plan_make(hs_account *account, const hs_levels *levels, const hs_box *box, double bound,
                   hs_algorithm algorithm, hs_level_plan *plan)
{
    const int64_t  n = levels->n, most = levels->cutoffs != NULL ? 2 * n : MOST_STEPS;
    const bool     is_directed = levels->cutoffs == NULL && hs_rule_is_directed(levels->rule);
    const hs_slice each = {0, n};
    double         cost = 0.0;
    hs_level_step  all = {.cutoff = 0.0};
    *plan = (hs_level_plan){.levels = levels,
                            .is_half = !levels->has_queries && !is_directed,
                            .bound = bound,
                            .algorithm = algorithm};
    plan->steps = hs_alloc(account, HS_FOR_CELLS, n * most, sizeof *plan->steps);
    if (plan->steps == NULL) {
        return HS_ERR_MEMORY;
    }
    const bool is_one = takes_all(plan);
    if (is_one && levels->cutoffs == NULL) {
        add_step(plan, each, each, plan->is_half);
        return HS_OK;
    }
    if (is_one) {
        all = (hs_level_step){.asking = each,
                              .points = each,
                              .is_own = plan->is_half,
                              .by_table = true,
                              .has_limits = true};
        for (int64_t e = 0; e < n * n; e++) {
            const double cutoff = levels->cutoffs[e];
            all.cutoff = hs_larger(all.cutoff, cutoff);
            all.least = cutoff > 0.0 && !(all.least > 0.0 && all.least <= cutoff) ? cutoff
                                                                                  : all.least;
        }
        all.cutoff = hs_smaller(all.cutoff, bound);
        plan->steps[plan->n++] = all;
        return HS_OK;
    }
    for (int32_t l = 0; l < n; l++) {
        const hs_slice own = {l, l + 1}, above = {l + 1, n};
        const int32_t apart = levels->cutoffs != NULL ? l : levels->rule == HS_RULE_MAX ? 0 : APART;
        const hs_rule rule = levels->cutoffs != NULL ? HS_RULE_SUM : levels->rule;
        if (rule == HS_RULE_GATHER) {
            add_step(plan, own, each, false);
        } else if (rule == HS_RULE_SCATTER) {
            add_step(plan, each, own, false);
        } else if (rule != HS_RULE_MIN) {
            add_below(plan, l, apart);
        } else { /* with itself and with all above it, which look among its points */
            add_step(plan, own, own, plan->is_half);
            add_step(plan, above, own, false);
            if (!plan->is_half) {
                add_step(plan, own, above, false);
            }
        }
    }
    HS_ASSERT(plan->n <= n * most);
    if (!hs_test_joins_levels || algorithm != HS_AUTO || levels->cutoffs != NULL || plan->n < 2 ||
        n > MOST_JOINED) {
        return HS_OK;
    }
    hs_level_plan one = {.levels = levels, .steps = &all, .is_half = plan->is_half, .bound = bound};
    add_step(&one, each, each, plan->is_half);
    HS_ASSERT(one.n == 1);
    for (int64_t s = 0; s < plan->n; s++) {
        cost += cost_of_step(levels, box, &plan->steps[s]);
    }
    if (cost_of_step(levels, box, &all) < cost) {
        plan->steps[0] = all;
        plan->n = 1;
    }
    return HS_OK;
}

/* Scaled radii that are larger are beyond all distances: the scale goes by a cutoff that is no
 * larger than these. */
#define BEYOND_ALL 0x1p600

/* The radii of a slice in the order of the cells, in one block, which is *owned; nothing where set
 * is NULL. */
static hs_status
arrange_radii(const hs_search *search, const hs_bins *bins, const hs_level_set *set, hs_slice slice,
              hs_radii *to, void **owned)
{
    const double  factor = search->limits->factor;
    const bool    in_caller_unit = search->scene.extreme; /* as the metric's then */
    const int64_t size = sizeof(double) + sizeof(float);
    float         most = 0.0f;
    *to = (hs_radii){.exact = NULL};
    if (set == NULL) {
        return HS_OK;
    }
    const double *radii = set->radii + set->first[slice.first];
    double *exact = hs_alloc(&search->call->account, HS_FOR_POINTS, bins->n + HS_PADDING, size);
    *owned = exact;
    if (exact == NULL) {
        return HS_ERR_MEMORY;
    }
    float *near = (float *)(exact + bins->n + HS_PADDING);
    for (int64_t si = 0; si < bins->n; si++) {
        const double radius = radii[bins->order[si]];
        const double scaled = hs_smaller(hs_scale_apply(search->scene.scale, radius), BEYOND_ALL);
        exact[si] = in_caller_unit ? radius : scaled;
        near[si] = (float)hs_smaller(factor * scaled, BEYOND_ALL);
        most = near[si] > most ? near[si] : most;
    }
    memset(near + bins->n, 0, HS_PADDING * sizeof *near);
    *to = (hs_radii){exact, near, most};
    return HS_OK;
}

/* The types of a set's points, which are their levels, in the order of the cells; NULL when memory
 * is short. */
static int32_t *
arrange_types(hs_account *account, const hs_bins *bins, const hs_level_set *set, int32_t n_levels)
{
    int32_t *to = hs_alloc(account, HS_FOR_POINTS, bins->n, sizeof *to);
    for (int64_t si = 0; to != NULL && si < bins->n; si++) {
        int32_t level = 0;
        while (level < n_levels - 1 && set->first[level + 1] <= bins->order[si]) {
            level++;
        }
        to[si] = level;
    }
    return to;
}

/* Limits by the types of both points, for a search of all of them. */
static hs_status
set_table(const hs_levels *levels, hs_level_search *own)
{
    const hs_search *search = &own->search;
    hs_account      *account = &search->call->account;
    const int32_t    n = levels->n, size = n * n;
    double          *exact = hs_alloc(account, HS_FOR_CELLS, size, sizeof(double) + sizeof(float));
    own->table = exact;
    own->of_points = arrange_types(account, &search->bins, &levels->points, n);
    if (search->has_queries) {
        own->of_asking = arrange_types(account, &search->query_bins, &levels->queries, n);
    }
    const int32_t *of_asking = search->has_queries ? own->of_asking : own->of_points;
    if (exact == NULL || own->of_points == NULL || of_asking == NULL) {
        return HS_ERR_MEMORY;
    }
    float *near = (float *)(exact + size);
    for (int32_t e = 0; e < size; e++) { /* exactly, and as they are scanned with */
        const double cutoff = levels->cutoffs[e];
        const double scaled = hs_smaller(hs_scale_apply(search->scene.scale, cutoff), BEYOND_ALL);
        exact[e] = cutoff < 0.0 ? -1.0 : search->scene.extreme ? cutoff : scaled;
        near[e] = cutoff < 0.0 ? -1.0f : (float)scaled;
    }
    own->limits.rule = HS_RULE_SCATTER;
    own->limits.table = (hs_limit_table){n, of_asking, own->of_points, exact, near};
    return HS_OK;
}

/* The supports of a set as kernels read them, once the points have the caller's numbers; nothing
 * where set is NULL. *owned: what is to be freed. */
static hs_status
arrange_supports(const hs_search *search, const hs_bins *bins, const hs_level_set *set,
                 double cutoff, hs_support_side *to, void **owned)
{
    const int    ndim = search->scene.ndim;
    const double unscale = hs_scale_apply(search->scene.unscale, 1.0);
    hs_status    status = HS_OK;
    *to = (hs_support_side){.numbers = NULL};
    if (set == NULL) {
        return HS_OK;
    }
    float *near = hs_alloc(&search->call->account, HS_FOR_SUPPORTS,
                           bins->n * hs_support_numbers(ndim), sizeof *near);
    *owned = near;
    *to = (hs_support_side){.numbers = set->supports.numbers,
                            .first = set->supports.first,
                            .order = bins->order,
                            .near = near};
    if (near == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t first = 0; status == HS_OK && first < bins->n; first += HS_POLL_LEVELS) {
        const int64_t end = first + HS_POLL_LEVELS < bins->n ? first + HS_POLL_LEVELS : bins->n;
        hs_supports_lay_out(to, first, end, ndim, cutoff, unscale, near);
        status = end < bins->n ? hs_poll(&search->call->options, 0.0) : HS_OK;
    }
    return status;
}

/*
 * For the cells of this search. With radii and types, the points are numbered by their places in
 * the slices of the step; with supports, as the caller numbers them. HS_ERR_MEMORY, or
 * HS_ERR_INTERRUPTED where the poll says so; in any case to be freed.
 */
static hs_status
level_limits_set(const hs_levels *levels, const hs_level_step *step, double bound,
                 hs_level_search *own)
{
    const hs_search    *search = &own->search;
    const hs_scene     *scene = &search->scene;
    const hs_rule       rule = levels->rule; /* NULL: it looks at nothing of these */
    const hs_level_set *points = hs_rule_needs_other(rule) ? &levels->points : NULL;
    const hs_level_set *asking = hs_rule_needs_asking(rule) ? hs_levels_asking(levels) : NULL;
    const double        near_bound = hs_scale_apply(scene->scale, bound);
    hs_supports        *supports = &own->supports;
    hs_status           status;
    if (!levels->has_supports) {
        own->limits = (hs_limits){.rule = levels->rule,
                                  .factor = levels->factor,
                                  .bound = scene->extreme ? bound : near_bound,
                                  .near_bound = (float)near_bound};
        if (step->by_table) {
            return set_table(levels, own);
        }
        status = arrange_radii(search, &search->bins, points, step->points, &own->limits.of_points,
                               &own->of_points);
        own->limits.of_asking = own->limits.of_points;
        if (status == HS_OK && search->has_queries) {
            status = arrange_radii(search, &search->query_bins, asking, step->asking,
                                   &own->limits.of_asking, &own->of_asking);
        }
        return status;
    }
    const double *cutoff = &supports->metric.limit.cutoff;
    *supports = (hs_supports){.rule = levels->rule, .is_bounded = bound <= step->cutoff};
    hs_support_metric_init(scene->ndim, levels->extent, scene->metric.inclusive,
                           scene->extreme ? 0 : -scene->scale.exponent, &supports->metric);
    own->limits = (hs_limits){.rule = levels->rule, .supports = supports};
    status = arrange_supports(search, &search->bins, points, *cutoff, &supports->of_points,
                              &own->of_points);
    supports->of_asking = supports->of_points;
    if (status == HS_OK && search->has_queries) {
        status = arrange_supports(search, &search->query_bins, asking, *cutoff,
                                  &supports->of_asking, &own->of_asking);
    }
    return status;
}

static void
renumber(const int32_t *number, hs_bins *bins)
{
    for (int64_t si = 0; si < bins->n; si++) {
        bins->order[si] = number[bins->order[si]];
    }
}

/* Where the numbers of a slice begin. */
static const int32_t *
numbers_of(const hs_level_set *set, hs_slice levels)
{
    return set->number + set->first[levels.first];
}

/* Asking points that meet all points of a step sooner than these are sorted into cells. */
#ifdef HS_TESTING
#define FEW_ASKING 4 /* so that small scenes have both */
#else
#define FEW_ASKING 32
#endif

#define PAIRS_SAMPLED 64

hs_status
hs_level_open(const hs_level_plan *plan, int64_t number, const hs_box *box, bool keeps_none,
              hs_call *call, hs_level_search *open, hs_failure *failure)
{
    const hs_levels     *levels = plan->levels;
    const hs_level_step *step = &plan->steps[number];
    const hs_level_set  *asking = hs_levels_asking(levels);
    const hs_points      points = level_points(&levels->points, step->points);
    const hs_points      queries = level_points(asking, step->asking);
    hs_search           *search = &open->search;
    const support_step   of_supports = {levels, step, &call->options};
    const hs_narrowing   narrowing = {support_step_width, &of_supports};
    const hs_sets        sets = {.points = &points,
                                 .queries = step->is_own ? NULL : &queries,
                                 .is_full = !step->is_own || !plan->is_half,
                                 .keeps_none = keeps_none,
                                 .least_cutoff = hs_choice_least_length(call->choice, step->least),
                                 .narrowing = levels->has_supports ? &narrowing : NULL};
    open->of_asking = open->of_points = open->table = NULL;
    open->limits.table.n_types = step->by_table ? levels->n : 0;
    open->limits.supports = levels->has_supports ? &open->supports : NULL;
    call->options.cutoff = step->cutoff;
    call->options.algorithm = plan->algorithm;
    /* Without cells, where the caller leaves that open: */
    if ((plan->algorithm == HS_AUTO || plan->algorithm == HS_HIERARCHY) && !step->is_own &&
        queries.n <= FEW_ASKING) {
        call->options.algorithm = HS_ALL_PAIRS;
    }
    hs_search_begin(call, search);
    search->limits = step->has_limits ? &open->limits : NULL;
    hs_status status = hs_search_build(&sets, box, search, failure);
    if (status != HS_OK && failure->row >= 0) {
        failure->row = failure->in_queries
                           ? numbers_of(asking, step->asking)[failure->row]
                           : numbers_of(&levels->points, step->points)[failure->row];
        failure->in_queries = failure->in_queries && levels->has_queries;
    }
    if (status == HS_OK && step->has_limits && !levels->has_supports) {
        status = level_limits_set(levels, step, plan->bound, open);
    }
    if (status == HS_OK) {
        search->is_half = plan->is_half;
        renumber(numbers_of(&levels->points, step->points), &search->bins);
    }
    if (status == HS_OK && search->has_queries) {
        renumber(numbers_of(asking, step->asking), &search->query_bins);
    }
    if (status == HS_OK && levels->has_supports) {
        status = level_limits_set(levels, step, plan->bound, open);
    }
    if (status != HS_OK) {
        hs_level_close(open);
        return status;
    }
    if (search->limits != NULL && !levels->has_supports) {
        /* The part of the pairs within the cutoff that are within their own length, about: from
         * pairs of arbitrary points, each weighed by the ball of its length over that of the
         * cutoff. 64 tell it to some per cent, and it only foresees memory. 37 is odd: sj takes all
         * 64 places, mixed. */
        const int64_t n_asking = hs_search_asking(search)->n, n = search->bins.n;
        double        sum = 0.0;
        for (int64_t e = 0; e < PAIRS_SAMPLED && n_asking > 0 && n > 0; e++) {
            const int32_t si = (int32_t)(e * n_asking / PAIRS_SAMPLED);
            const int32_t sj = (int32_t)(e * 37 % PAIRS_SAMPLED * n / PAIRS_SAMPLED);
            const double  limit = hs_limit_of(search->limits, si, sj).hi;
            const double  length = limit / search->scene.metric.cutoff;
            sum += length > 0.0 ? pow(hs_smaller(length, 1.0), search->scene.ndim) : 0.0;
        }
        search->grid.expected_pairs *= sum / PAIRS_SAMPLED;
    }
    /* Fractions done are those of all asking points of all steps, as far as these are equal. */
    search->n_before = number * hs_search_asking(search)->n;
    search->n_in_all = plan->n * hs_search_asking(search)->n;
    return HS_OK;
}

void
hs_level_close(hs_level_search *open)
{
    hs_account *account = &open->search.call->account;
    hs_free(account, open->of_asking);
    hs_free(account, open->of_points);
    hs_free(account, open->table);
    open->of_asking = open->of_points = open->table = NULL;
    hs_search_close(&open->search);
}
