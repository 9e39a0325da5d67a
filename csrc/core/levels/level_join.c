/* SPDX-License-Identifier: BSD-3-Clause */
/* level_join.c: points are taken to be spread evenly over the box of their level. Where they are
 * not, both plans test more than that, and the one with fewer tests is favoured too little. */
#include "level_join.h"

#include "../base/poll.h"
#include "../cells/grid.h"

#include <math.h>
#include <string.h>

#ifdef HS_TESTING
static bool joins = false;

bool
hs_test_join_levels(bool on)
{
    const bool before = joins;
    joins = on;
    return before;
}
#else
enum { joins = true };
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

/* How long the box of each level's points is along the coordinate axes. */
typedef struct spread {
    double asking[MOST_JOINED][HS_MAX_DIM], points[MOST_JOINED][HS_MAX_DIM];
} spread;

static hs_status
find_extents(const hs_options *options, const hs_level_set *set, int32_t level,
             const double *longest, double *extent)
{
    const int d = set->ndim;
    double    low[HS_MAX_DIM], high[HS_MAX_DIM];
    for (int k = 0; k < d; k++) {
        low[k] = HUGE_VAL;
        high[k] = -HUGE_VAL;
    }
    for (int64_t i = set->first[level]; i < set->first[level + 1]; i++) {
        for (int k = 0; k < d; k++) {
            low[k] = hs_smaller(set->rows[i * d + k], low[k]);
            high[k] = hs_larger(set->rows[i * d + k], high[k]);
        }
        if ((i + 1) % HS_POLL_POINTS == 0 && hs_poll(options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    for (int k = 0; k < d; k++) {
        extent[k] = hs_smaller(high[k] - low[k], longest[k]);
    }
    return HS_OK;
}

/* Points of a box that repeats along all its vectors are wrapped into it. */
static hs_status
find_spread(const hs_options *options, const hs_levels *levels, const hs_box *box, spread *of)
{
    hs_status status = HS_OK;
    double    longest[HS_MAX_DIM];
    for (int k = 0; k < levels->points.ndim; k++) {
        longest[k] = box != NULL ? 0.0 : HUGE_VAL;
        for (int l = 0; box != NULL && l < box->ndim; l++) {
            longest[k] += box->periodic[l] ? fabs(box->rows[l][k]) : HUGE_VAL;
        }
    }
    for (int32_t l = 0; status == HS_OK && l < levels->n; l++) {
        status = find_extents(options, &levels->points, l, longest, of->points[l]);
        if (status == HS_OK && levels->has_queries) {
            status = find_extents(options, &levels->queries, l, longest, of->asking[l]);
        } else {
            memcpy(of->asking[l], of->points[l], sizeof of->asking[l]);
        }
    }
    return status;
}

/* The part of all pairs of two levels' points that is within the side of a cube, for boxes one of
 * which lies in the other. */
static double
part_within(const double *extent, const double *other, int ndim, double side)
{
    double part = 1.0;
    for (int k = 0; k < ndim; k++) {
        const double longer = hs_larger(extent[k], other[k]);
        part *= side < longer ? side / longer : 1.0;
    }
    return part;
}

/* In tests of one candidate. Levels with themselves are half lists. */
static double
cost_of_step(const hs_levels *levels, const spread *of, const hs_level_step *step)
{
    const hs_level_set *points = &levels->points;
    const hs_level_set *asking = step->is_own ? points : hs_levels_asking(levels);
    const hs_slice      asked = step->is_own ? step->points : step->asking;
    const int           d = points->ndim;
    /* of a cube as large as the ball of the cutoff */
    const double side = step->cutoff * pow(hs_ball_volume(d, 1.0), 1.0 / d);
    double       pairs = 0.0;
    for (int64_t a = asked.first; a < asked.end; a++) {
        for (int64_t b = step->points.first; b < step->points.end; b++) {
            const double *extent = step->is_own ? of->points[a] : of->asking[a];
            pairs += hs_level_count(asking, (hs_slice){a, a + 1}) *
                     hs_level_count(points, (hs_slice){b, b + 1}) *
                     part_within(extent, of->points[b], d, side);
        }
    }
    return TESTS_PER_POINT * (hs_level_count(asking, asked) +
                              (step->is_own ? 0.0 : hs_level_count(points, step->points))) +
           TESTS_PER_PAIR * (step->has_limits ? TEST_OF_LIMITS : 1.0) * (step->is_own ? 0.5 : 1.0) *
               pairs;
}

static hs_status
join(const hs_options *options, const hs_levels *levels, const hs_box *box, hs_level_plan *plan)
{
    spread of;
    double cost = 0.0;
    if (!joins || plan->algorithm != HS_AUTO || levels->cutoffs != NULL || plan->n < 2 ||
        levels->n > MOST_JOINED) {
        return HS_OK;
    }
    const hs_level_step all = hs_level_plan_all(levels, plan);
    const hs_status     status = find_spread(options, levels, box, &of);
    if (status != HS_OK) {
        return status;
    }
    for (int64_t s = 0; s < plan->n; s++) {
        cost += cost_of_step(levels, &of, &plan->steps[s]);
    }
    if (cost_of_step(levels, &of, &all) < cost) {
        plan->steps[0] = all;
        plan->n = 1;
    }
    return HS_OK;
}

hs_status
hs_level_plan_choose(hs_account *account, const hs_options *options, const hs_levels *levels,
                     const hs_box *box, double bound, hs_algorithm algorithm, hs_level_plan *plan)
{
    hs_status status = hs_level_plan_make(account, levels, bound, algorithm, plan);
    if (status == HS_OK) {
        status = join(options, levels, box, plan);
    }
    if (status != HS_OK) {
        hs_level_plan_free(account, plan);
    }
    return status;
}
