/* SPDX-License-Identifier: BSD-3-Clause */
#include "scene.h"
#include "../exact/arithmetic.h"
#include "../threads/call.h"
#include "../base/sort.h"
#include "../base/status.h"
#include "../base/os.h"

#include <math.h>
#include <string.h>
#include <stdlib.h>

/* scene.c: reads the points, closes gaps, scales, wraps, and sets bounds, in this order: how far
 * what the search computes with can be from the numbers that were given, and what decides then. */

/* Part of the radius above which the width of pairs along an axis counts as that of a ball. */
#define WORTH_NARROWING 0.8
/* Far more than the roundings of the difference of radius and width. */
#define NARROWING_SLACK 0x1p-40
#define UNIT            0x1p-53 /* unit roundoff of float64 */
/* Error of precision="double", in heights of the box, up to which candidates are few. */
#define NOISE 0x1p-6

void
hs_scene_scale_ranges(hs_scene *scene)
{
    for (int k = 0; k < scene->ndim; k++) {
        if (scene->lattice.row_of_axis[k] >= 0) {
            const double half = 0.5 * scene->lattice.period[k];
            /* Points that rounding left outside are binned on the face: an error of t. */
            scene->t_error[k] +=
                hs_larger(hs_larger(scene->upper[k] - half, -half - scene->lower[k]), 0.0);
            scene->lower[k] = -half;
            scene->upper[k] = half;
        }
    }
}

/* Sets x_error and t_error, from x_largest and the magnitude of wrapping: component by component,
 * because those of a long box vector may be known far less well than those of a short one. */
static void
scene_bound_errors(hs_scene *scene, double magnitude)
{
    const hs_lattice *lattice = &scene->lattice;
    const double      lost = scene->extreme ? HS_SCALING_LOSS : 0.0;
    const double      terms = 2 * lattice->n_periodic + 2;
    double            error[HS_MAX_DIM];
    scene->x_error = lost;
    for (int c = 0; c < scene->ndim; c++) {
        error[c] = lattice->aligned ? lost
                                    : lost + 2.0 * UNIT * scene->x_largest[c] +
                                          terms * terms * 0x1p-104 * magnitude;
        scene->x_error = hs_larger(error[c], scene->x_error);
    }
    for (int k = 0; k < scene->ndim; k++) {
        double along = 0.0; /* what the dot product carries on, and its own rounding */
        for (int c = 0; c < scene->ndim && !lattice->aligned; c++) {
            along += fabs(lattice->normal[k][c]) *
                     (error[c] + (scene->ndim + 2) * UNIT * scene->x_largest[c]);
        }
        scene->t_error[k] = lattice->aligned ? lost : along * (1.0 + 0x1p-40);
    }
}

/*
 * precision="double" computes D in float64 from the points as given: each of its m + 2 terms is
 * rounded to within 2^-53 of the largest partial sum. Candidates must be sought that much further
 * out.
 */
static double
bound_formula(const hs_scene *scene, double farthest)
{
    const hs_lattice *lattice = &scene->lattice;
    double            total = 2.0 * farthest;
    if (lattice->n_periodic == 0) {
        /* Differences of floats have a relative error only. */
        return 4.0 * UNIT * scene->cutoff * scene->ndim;
    }
    double turns[HS_MAX_DIM]; /* bound on |shift| over row b of B of any pair in reach */
    for (int k = 0; k < scene->ndim; k++) {
        const int b = lattice->row_of_axis[k];
        if (b >= 0) {
            turns[b] = (2.0 * scene->ndim * total + scene->cutoff) / lattice->period[k] + 4.0;
        }
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        double given_turns = 0.0, largest = 0.0;
        for (int b = 0; b < lattice->n_periodic; b++) {
            given_turns += turns[b] * fabs((double)lattice->U[b][r]);
        }
        for (int c = 0; c < scene->ndim; c++) {
            largest = fmax(largest, fabs(lattice->scaled[r][c]));
        }
        total += given_turns * largest;
    }
    return (lattice->n_periodic + 4) * scene->ndim * UNIT * (total + scene->cutoff);
}

/* Sets formula_error and radius, from the cutoff, the lattice and the largest |x|, scaled. */
static void
scene_set_radius(hs_scene *scene, const hs_options *options, double largest)
{
    scene->formula_error = options->precision == HS_DOUBLE ? bound_formula(scene, largest) : 0.0;
    scene->radius = scene->cutoff + scene->formula_error;
    memset(scene->less, 0, sizeof scene->less);
}

hs_status
hs_scene_narrow(hs_scene *scene, const hs_narrowing *narrowing)
{
    /* Less than this is not worth it. */
    const double enough = WORTH_NARROWING * hs_scale_apply(scene->unscale, scene->radius);
    for (int k = 0; narrowing != NULL && k < scene->ndim; k++) {
        double          width;
        const hs_status status =
            narrowing->find(narrowing->context, scene->lattice.normal[k], enough, &width);
        if (status != HS_OK) {
            return status;
        }
        const double near = hs_next_up(hs_scale_apply(scene->scale, width)) + scene->formula_error;
        const double less = (scene->radius - near) * (1.0 - NARROWING_SLACK);
        scene->less[k] = width < enough && less > 0.0 ? less : 0.0;
    }
    return HS_OK;
}

double
hs_scene_volume(const hs_scene *scene, double ball)
{
    for (int k = 0; k < scene->ndim; k++) {
        ball *= scene->less[k] > 0.0 ? hs_scene_radius_along(scene, k) / scene->radius : 1.0;
    }
    return ball;
}

void
hs_scene_init_metric(hs_scene *scene, const hs_options *options)
{
    const hs_lattice *lattice = &scene->lattice;
    const double(*rows)[HS_MAX_DIM] = (const double(*)[HS_MAX_DIM])lattice->rows;
    double cutoff = hs_scale_apply(scene->scale, scene->sought);
    if (scene->extreme) {
        rows = (const double(*)[HS_MAX_DIM])lattice->given;
        cutoff = scene->sought;
    } else if (scene->keeps_originals) {
        rows = (const double(*)[HS_MAX_DIM])lattice->scaled;
    }
    hs_metric_init(&scene->metric, scene->ndim, lattice->n_periodic, rows, cutoff,
                   options->inclusive);
}

void
hs_scene_set_cutoff(hs_scene *scene, const hs_options *options)
{
    HS_ASSERT(!scene->extreme);
    scene->sought = options->cutoff;
    scene->cutoff = scene->cutoff_low = hs_scale_apply(scene->scale, options->cutoff);
    scene_set_radius(scene, options, scene->cloud.largest);
    hs_scene_init_metric(scene, options);
}

/* The first of the points that are farthest from zero along some axis; *far: how far. */
static int64_t
farthest_point(const hs_cloud *cloud, double *far)
{
    int64_t farthest = 0;
    double  largest = -1.0;
    for (int k = 0; k < cloud->ndim; k++) {
        for (int64_t i = 0; i < cloud->n; i++) {
            const double size = fabs(cloud->x[k][i]);
            if (size > largest || (size == largest && i < farthest)) {
                largest = size;
                farthest = i;
            }
        }
    }
    *far = largest;
    return farthest;
}

/* Which point or query is to blame for noise; asking: NULL without queries. */
static void
scene_name_farthest(const hs_scene *scene, const hs_scene *asking, hs_failure *failure)
{
    double of_points, of_queries;
    failure->row = farthest_point(&scene->cloud, &of_points);
    if (asking != NULL) {
        const int64_t query = farthest_point(&asking->cloud, &of_queries);
        failure->in_queries = of_queries > of_points;
        failure->row = failure->in_queries ? query : failure->row;
    }
}

/* Points and queries in one scene, at once or one after the other: bounds must hold for both. */

/* How much further from the box than the points queries may be that come later, and how many box
 * vectors at least, before they need bounds of their own. Bounds that are so much wider cost next
 * to nothing: they are some units in the last place. */
#define FURTHER     4.0
#define BOX_VECTORS 1024.0
/* Along coordinate axes cells are found for any number, as long as sums of a few are finite. */
#define MOST_FOR_CELLS 0x1p900

/* Gives both clouds the range of both. */
static void
scene_join_clouds(hs_scene *scene, hs_scene *asking)
{
    hs_cloud *a = &scene->cloud, *b = &asking->cloud;
    /* The range of no points is empty: infinity to -infinity. */
    for (int k = 0; k < scene->ndim; k++) {
        a->lower[k] = b->lower[k] = hs_smaller(a->lower[k], b->lower[k]);
        a->upper[k] = b->upper[k] = hs_larger(a->upper[k], b->upper[k]);
    }
    a->largest = b->largest = hs_larger(a->largest, b->largest);
}

/* What was decided for the points holds for the queries. */
static void
scene_share(const hs_scene *scene, hs_scene *asking)
{
    asking->scale = scene->scale;
    asking->unscale = scene->unscale;
    asking->pending = scene->pending;
    asking->sought = scene->sought;
    asking->lattice = scene->lattice;
    asking->cutoff = scene->cutoff;
    asking->cutoff_low = scene->cutoff_low;
    asking->radius = scene->radius;
    memcpy(asking->less, scene->less, sizeof asking->less);
    asking->extreme = scene->extreme;
    asking->formula_error = scene->formula_error;
}

/* The scene's x_largest, lower and upper cover what wrapping found in both. */
static void
scene_join_wrapped(hs_scene *scene, const hs_scene *asking)
{
    const bool points = scene->n > 0, queries = asking->n > 0;
    for (int k = 0; k < scene->ndim; k++) {
        scene->x_largest[k] = hs_larger(scene->x_largest[k], asking->x_largest[k]);
        if (queries) { /* otherwise its range is that of nothing */
            scene->lower[k] = points ? hs_smaller(scene->lower[k], asking->lower[k])
                                     : asking->lower[k];
            scene->upper[k] = points ? hs_larger(scene->upper[k], asking->upper[k])
                                     : asking->upper[k];
        }
    }
}

/*
 * A scene that is kept for numbers that no scale holds: all points on one spot of open space, which
 * gives one cell with everything. No search can use it: each reads the points again and makes a
 * scene of its own. It is there because what keeps cells owns the points, which those searches
 * read, and its layout is public: it must be a sound one that holds each point once.
 */
static void
scene_put_in_one_cell(hs_scene *scene)
{
    hs_cloud *cloud = &scene->cloud;
    for (int k = 0; k < scene->ndim; k++) {
        memset(cloud->x[k], 0, (size_t)cloud->n * sizeof(double));
        cloud->lower[k] = cloud->upper[k] = 0.0;
    }
    cloud->largest = 0.0;
    scene->scale = scene->unscale = scene->pending = hs_scale_of(0);
    scene->cutoff = scene->cutoff_low = scene->radius = 1.0;
    scene->formula_error = 0.0;
    memset(scene->less, 0, sizeof scene->less);
    scene->extreme = false;
    scene->in_one_cell = true;
    hs_lattice_init(NULL, scene->ndim, scene->pending, &scene->lattice);
}

static double
largest_entry(const hs_lattice *lattice)
{
    double largest = 0.0;
    for (int r = 0; r < lattice->n_periodic; r++) {
        for (int k = 0; k < lattice->ndim; k++) {
            largest = hs_larger(largest, fabs(lattice->rows[r][k]));
        }
    }
    return largest;
}

static void
scene_make_room(hs_scene *scene, double *magnitude)
{
    const hs_lattice *lattice = &scene->lattice;
    const double      away = BOX_VECTORS * largest_entry(lattice);
    scene->cloud.largest = hs_larger(FURTHER * scene->cloud.largest, away);
    *magnitude = hs_larger(FURTHER * *magnitude, away);
    for (int k = 0; k < scene->ndim; k++) {
        double across = 0.0; /* what is wrapped lies within half of each row of B */
        for (int r = 0; r < lattice->n_periodic; r++) {
            across += 0.5 * fabs(lattice->rows[r][k]);
        }
        scene->x_largest[k] = 2.0 * hs_larger(scene->x_largest[k], across);
        if (across == 0.0) { /* queries stay wherever they are along this axis */
            scene->x_largest[k] = hs_larger(2.0 * scene->x_largest[k], away);
        }
    }
}

/* The largest scaled coordinate of queries that come later. */
static double
most_taken(const hs_scene *kept, bool is_untested)
{
    return is_untested && kept->lattice.aligned ? MOST_FOR_CELLS : kept->cloud.largest;
}

bool
hs_scene_takes(const hs_scene *kept, const hs_cloud *cloud)
{
    const hs_scale scale = kept->scale;
    if (kept->n == 0) { /* no point is found, wherever queries are, but they need a place */
        return hs_scale_apply(scale, cloud->largest) < INFINITY;
    }
    const double most = most_taken(kept, kept->is_untested);
    if (kept->in_one_cell || !(hs_scale_apply(scale, cloud->largest) <= most)) {
        return false;
    }
    if (kept->is_untested) { /* digits that are lost are less than the room between cells */
        return true;
    }
    if (kept->extreme) {
        return false;
    }
    /* Scaling down must not reach the subnormal numbers. */
    return scale.exponent == 0 || cloud->largest == 0.0 ||
           hs_scale_apply(scale, hs_cloud_smallest(cloud)) >= 0x1p-1022;
}

/* Whether the bounds of a scene that was kept hold for queries that have been wrapped. */
static bool
scene_covers(const hs_scene *kept, const hs_scene *asking)
{
    const bool is_tested = kept->n > 0 && !kept->is_untested;
    bool       covers = !is_tested || asking->x_error <= kept->x_error;
    for (int k = 0; kept->n > 0 && k < kept->ndim; k++) {
        covers = covers && asking->t_error[k] <= kept->t_error[k] &&
                 (!is_tested || asking->x_largest[k] <= kept->x_largest[k]);
    }
    return covers;
}

void
hs_scene_name_refused(const hs_scene *kept, const hs_points *queries, hs_failure *failure)
{
    const hs_options options = hs_options_default();
    const double     most = most_taken(kept, true);
    double           largest = -1.0;
    hs_cloud         cloud;
    if (kept->in_one_cell ||
        hs_cloud_load(NULL, NULL, queries, &options, &cloud, failure) != HS_OK) {
        return;
    }
    for (int64_t i = 0; i < cloud.n; i++) {
        for (int k = 0; k < cloud.ndim; k++) {
            const double size = hs_scale_apply(kept->scale, fabs(cloud.x[k][i]));
            if (largest <= most && size > largest) {
                largest = size;
                failure->row = i;
                failure->column = k;
                failure->value = cloud.x[k][i];
                failure->in_queries = true;
            }
        }
    }
    hs_cloud_free(NULL, &cloud);
}

/* Compares exponents, which are integers: no ratio of lengths can overflow. */

/* Cutoffs between 2^-20 and 2^20 are left alone: the float32 filter has room for their squares. */
#define ORDINARY_EXPONENT 20
/* A cutoff that is 2^8 times the largest coordinate: two points are less than 2 sqrt(8) times that
 * and a binary order apart. */
#define WHOLE_EXPONENT 8
/* Cutoffs up to so many times the largest coordinate are never shortened. */
#define ENOUGH_CUTOFF 64.0
/* Exponent of zero; that of infinity is its opposite. Sums with other exponents do not overflow. */
#define NO_EXPONENT (INT32_MIN / 2)

int
hs_exponent_of(double x)
{
    return x == 0.0 ? NO_EXPONENT : isinf(x) ? -NO_EXPONENT : ilogb(x);
}

bool
hs_is_far(double size, int unit, int powers)
{
    return size > ldexp(1.0, unit + powers); /* infinity, or 0, where that passes the range */
}

static int
entries_of_row(const double *row, int ndim)
{
    int entries = 0;
    for (int k = 0; k < ndim; k++) {
        entries += row[k] != 0.0;
    }
    return entries;
}

/* What moves a column of coordinates besides the points' own values. */
#define OPEN    (-1) /* nothing */
#define COUPLED (-2) /* box vectors that have entries in other columns as well */

/* OPEN, COUPLED, or the number of the row (a box vector) that alone has an entry in this
 * column, and no other entry. periodic: the rows that count; NULL: all. */
static int
mover_among(const double rows[][HS_MAX_DIM], const bool *periodic, int n_rows, int ndim, int column)
{
    int mover = OPEN;
    for (int l = 0; l < n_rows; l++) {
        if ((periodic == NULL || periodic[l]) && rows[l][column] != 0.0) {
            mover = mover == OPEN && entries_of_row(rows[l], ndim) == 1 ? l : COUPLED;
        }
    }
    return mover;
}

/* mover_among for the periodic rows of a box. box: NULL for none. */
static int
mover_of(const hs_box *box, int column)
{
    return box == NULL ? OPEN
                       : mover_among((const double(*)[HS_MAX_DIM])box->rows, box->periodic,
                                     box->ndim, box->ndim, column);
}

hs_box_size
hs_box_size_of(const hs_box *box)
{
    hs_box_size found = {0.0, INFINITY, INFINITY, 0, false};
    for (int l = 0; box != NULL && l < box->ndim; l++) {
        double row_largest = 0.0;
        for (int k = 0; box->periodic[l] && k < box->ndim; k++) {
            const double size = fabs(box->rows[l][k]);
            row_largest = hs_larger(size, row_largest);
            found.smallest = size > 0.0 ? hs_smaller(size, found.smallest) : found.smallest;
        }
        found.largest = hs_larger(row_largest, found.largest);
        if (box->periodic[l]) {
            found.short_row = hs_smaller(row_largest, found.short_row);
        }
    }
    for (int k = 0; box != NULL && k < box->ndim; k++) {
        const int mover = mover_of(box, k);
        found.moved |= (unsigned)(mover != OPEN) << k;
        found.is_coupled = found.is_coupled || mover == COUPLED;
    }
    return found;
}

/* The exponent of the length that a scene goes by: its cutoff, or with cutoff 0 its box, or where
 * its points are. A very small number if all is 0. */
static int
unit_exponent(const hs_cloud *cloud, const hs_box_size *box, double cutoff)
{
    return hs_exponent_of(cutoff > 0.0                 ? cutoff
                          : box->short_row != INFINITY ? box->short_row
                                                       : cloud->largest);
}

/* Whether all numbers are at most so many powers of two above a length of this exponent. */
static bool
fits_one_scale(const hs_cloud *cloud, const hs_box_size *box, int unit, int powers)
{
    const double largest = hs_larger(box->largest, cloud->largest);
    return !hs_is_far(largest, unit, powers);
}

/* The largest coordinate that wrapping leaves as it is. */
static double
open_reach(const hs_cloud *cloud, const hs_box_size *box)
{
    double reach = 0.0;
    for (int k = 0; k < cloud->ndim; k++) {
        if (!(box->moved >> k & 1u)) {
            reach = hs_larger(hs_larger(-cloud->lower[k], cloud->upper[k]), reach);
        }
    }
    return reach;
}

/* Whether coordinates along open axes are so large that a coupled box is lost in the rounding of
 * what is wrapped into it. */
static bool
open_drowns_box(const hs_cloud *cloud, const hs_box_size *box, double cutoff)
{
    return box->is_coupled &&
           hs_is_far(open_reach(cloud, box), hs_exponent_of(hs_larger(box->largest, cutoff)),
                     HS_FAR_DROWNING_EXPONENT);
}

/* The exponent to scale by, so that no exponent is above `largest`; *extreme: whether that loses
 * digits. unit: from unit_exponent. */
static int
choose_exponent(const hs_cloud *cloud, const hs_box_size *box, double cutoff, int unit, int largest,
                bool *extreme)
{
    int          exponent = unit == NO_EXPONENT || abs(unit) <= ORDINARY_EXPONENT ? 0 : unit;
    const double turned = ldexp(box->largest, HS_FAR_TURNS_EXPONENT);
    const double reach = turned > 0.0 ? hs_smaller(turned, cloud->largest) : cloud->largest;
    const int    found = hs_exponent_of(hs_larger(box->largest, reach));
    if (found - exponent > largest) {
        exponent = found - largest;
    }
    const int wide = hs_exponent_of(open_reach(cloud, box)) - HS_LARGEST_WIDE_EXPONENT;
    exponent = exponent < wide ? wide : exponent;
    *extreme = false;
    if (exponent > 0) {
        double smallest = fmin(box->smallest, hs_cloud_smallest(cloud));
        smallest = cutoff > 0.0 ? fmin(smallest, cutoff) : smallest;
        *extreme = smallest != INFINITY && hs_exponent_of(smallest) - exponent < -1022;
    }
    return exponent;
}

/* Which power of two a scene is scaled by, and whether gaps between its points are closed before
 * that. */

/* Whether gaps between far points and queries are closed. Queries that come later may lie in such a
 * gap, and the k nearest may be at any distance. Where one scale holds everything, cells of queries
 * and of lists that last are those of the points as given. */
static bool
scene_may_condense(const hs_scene *scene, const hs_scene *asking, const hs_box_size *size, int unit)
{
    const bool is_bounded = scene->within > 0.0 && scene->sought == scene->within;
    if (scene->is_kept || (scene->is_wide && !is_bounded)) {
        return false;
    }
    return scene->is_wide || (asking == NULL && !scene->is_plain) ||
           open_drowns_box(&scene->cloud, size, scene->sought) ||
           !fits_one_scale(&scene->cloud, size, unit, HS_LARGEST_WIDE_EXPONENT);
}

/* The scale of points, lengths and the cutoff. asking: NULL, or the queries' scene. is_scaled:
 * closing gaps has brought the points and this box to units. */
static void
scene_set_scale(const hs_box *box, bool is_scaled, int unit, hs_scene *scene,
                const hs_scene *asking)
{
    const hs_box_size size = hs_box_size_of(box);
    int               exponent = unit;
    bool              also_extreme = false;
    /* The smallest length that pairs are compared with. */
    const double least = scene->least_cutoff > 0.0 ? hs_smaller(scene->least_cutoff, scene->sought)
                                                   : scene->sought;
    scene->extreme = false;
    if (!is_scaled) {
        const int largest = scene->is_wide ? HS_LARGEST_WIDE_EXPONENT : HS_LARGEST_EXPONENT;
        exponent = choose_exponent(&scene->cloud, &size, least, unit, largest, &scene->extreme);
        if (asking != NULL) { /* the same exponent: the clouds' ranges are joined */
            (void)choose_exponent(&asking->cloud, &size, least, unit, largest, &also_extreme);
        }
    }
    scene->extreme = scene->extreme || also_extreme;
    scene->scale = hs_scale_of(exponent);
    scene->unscale = hs_scale_of(-exponent);
    scene->pending = is_scaled ? hs_scale_of(0) : scene->scale;
    scene->cutoff = scene->cutoff_low = hs_scale_apply(scene->scale, scene->sought);
    if (scene->extreme && scene->sought > 0.0) {
        /* The scaled cutoff may have been rounded or flushed: take bounds. */
        scene->cutoff_low -= HS_SCALING_LOSS;
        scene->cutoff += HS_SCALING_LOSS;
    }
}

/*
 * Closes the gaps between coordinates that are far from zero. Where two different float64 numbers
 * are more than a cutoff apart, all that matters is which are equal, so smaller numbers can take
 * their place. No scale holds both a cutoff of 1e-300 and an outlier at 1e300; once gaps are
 * closed, one does. No pair changes, nor a bit of d and D, and S by the turns alone.
 */

/* Points, queries. */
#define CONDENSED_SETS 2

typedef struct condensed_set {
    const hs_box *box;       /* in place of the caller's: borrowed, or `rows` */
    const hs_box *given_box; /* the caller's */
    hs_box        rows;
    bool          is_scaled; /* points and box vectors are in units of 2^unit now */
    bool          has_turns; /* something was wrapped into the box, and S is wanted: */
    /* Both set where has_turns says so. Owned, of points and of queries; n each for a column where
     * some were, else NULL. */
    int64_t *turns[CONDENSED_SETS][HS_MAX_DIM];
    /* Owned; where scaling may lose digits: the columns that have turns, of both sets, as they were
     * given. S with all its turns belongs to these numbers and to the box as given. */
    double *given[CONDENSED_SETS][HS_MAX_DIM];
} condensed_set;

/* Once the box is scaled: whether one of its periods has become zero. */
static bool
box_vanishes(const hs_scene *scene)
{
    const hs_lattice *lattice = &scene->lattice;
    for (int k = 0; k < lattice->ndim; k++) {
        if (lattice->row_of_axis[k] >= 0 && !(lattice->period[k] > 0x1p-900)) {
            return true;
        }
    }
    return false;
}

/* The pass over all points that wraps them into the box, axis by axis where
 * it can. */

typedef struct wrapping {
    hs_scene     *scene;
    bool          few_turns;
    int           n_slabs; /* that so many points have; the others are not set */
    hs_wrap_range folded[HS_SLABS];
} wrapping;

/* Whether the points lie in the middle period along axis k, all of them: then none is touched. */
static bool
is_inside(const hs_scene *scene, int k)
{
    const double half = 0.5 * scene->lattice.period[k];
    return scene->cloud.lower[k] >= -half && scene->cloud.upper[k] <= half;
}

/* The length that the given numbers of column k repeat after; 0 where that is not known. */
static double
given_length(const hs_scene *scene, int k)
{
    const hs_lattice *lattice = &scene->lattice;
    const int         own = mover_among((const double(*)[HS_MAX_DIM])lattice->given, NULL,
                                        lattice->n_periodic, lattice->ndim, k);
    if (own >= 0) {
        return fabs(lattice->given[own][k]);
    }
    return lattice->aligned && !scene->extreme && lattice->row_of_axis[k] >= 0
               ? hs_scale_apply(scene->unscale, lattice->period[k])
               : 0.0;
}

void
hs_scene_fold_far(hs_scene *scene)
{
    hs_cloud *cloud = &scene->cloud;
    for (int k = 0; k < scene->ndim; k++) {
        const double reach = hs_larger(-cloud->lower[k], cloud->upper[k]);
        const bool   overflows = !(hs_scale_apply(scene->pending, reach) < INFINITY);
        if (!overflows && !scene->keeps_originals) {
            continue;
        }
        const double length = given_length(scene, k);
        if (!(length > 0.0) || !(overflows || reach / length >= HS_WRAP_LIMIT)) {
            continue;
        }
        for (int64_t i = 0; i < cloud->n; i++) {
            int64_t turned;
            cloud->x[k][i] = hs_wrap_axis(cloud->x[k][i], length, &turned);
        }
        cloud->lower[k] = -0.5 * length;
        cloud->upper[k] = 0.5 * length;
    }
}

static void
clear_turns(const hs_turns *turns, int row, int64_t first, int64_t last)
{
    if (turns->narrow[row] != NULL) {
        memset(turns->narrow[row] + first, 0, (size_t)(last - first) * sizeof(int32_t));
    } else {
        memset(turns->wide[row] + first, 0, (size_t)(last - first) * sizeof(int64_t));
    }
}

static hs_status
wrap_slab(void *context, int slab, int64_t first, int64_t last)
{
    wrapping         *wrap = context;
    hs_scene         *scene = wrap->scene;
    const hs_lattice *lattice = &scene->lattice;
    const hs_turns   *turns = scene->turns.known ? &scene->turns : NULL;
    hs_wrap_range    *folded = &wrap->folded[slab];
    if (!lattice->aligned) {
        double *const *r = scene->x_is_beside ? scene->originals : scene->cloud.x;
        hs_fold_points(lattice, wrap->few_turns, r, first, last, scene->cloud.x, turns, folded);
    }
    for (int k = 0; lattice->aligned && k < scene->ndim; k++) {
        const int row = lattice->row_of_axis[k];
        if (row >= 0 && !is_inside(scene, k)) {
            const double largest = fmax(-scene->cloud.lower[k], scene->cloud.upper[k]);
            hs_fold_axis(lattice, k, scene->cloud.x[k], first, last, largest, turns, folded);
        } else if (row >= 0 && turns != NULL) {
            clear_turns(turns, row, first, last);
        }
    }
    return folded->failed < 0 ? HS_OK : HS_ERR_SHIFT_RANGE;
}

/* No point moves, and coordinates are those along the axes. */
static void
stay(hs_scene *scene)
{
    const hs_cloud *cloud = &scene->cloud;
    for (int k = 0; k < scene->ndim; k++) {
        scene->x_largest[k] = scene->n > 0 ? hs_larger(-cloud->lower[k], cloud->upper[k]) : 0.0;
        scene->lower[k] = scene->n > 0 ? cloud->lower[k] : 0.0;
        scene->upper[k] = scene->n > 0 ? cloud->upper[k] : 0.0;
    }
}

/* Scenes without a box whose numbers need no scale are filled in one go: else a call of 30 points
 * takes 1.27 times the instructions, and 2000 systems of 30 points 1.18 times as long. */

/* Whether a scene, once its points have been read, stays as it was given: there is no box, no
 * gap is closed, nothing is scaled, and the cutoff is not shortened. Then scene_fill_ordinary
 * fills it. */
static bool
scene_needs_no_scaling(const hs_sets *sets, const hs_box *box, const hs_options *options,
                       const hs_scene *scene)
{
    const double cutoff = options->cutoff, largest = scene->cloud.largest;
    return box == NULL && sets->queries == NULL && !sets->is_kept && !sets->is_wide &&
           options->precision != HS_DOUBLE && cutoff >= hs_power_of_two(-ORDINARY_EXPONENT) &&
           cutoff <= hs_power_of_two(ORDINARY_EXPONENT) && cutoff <= ENOUGH_CUTOFF * largest &&
           largest <= hs_power_of_two(HS_FAR_EXPONENT - 1 - ORDINARY_EXPONENT);
}

/* follows: it has filled the scene before, with this cutoff and as many axes. */
static void
scene_fill_ordinary(const hs_options *options, bool follows, hs_scene *scene)
{
    if (!follows) {
        scene->scale = scene->unscale = scene->pending = hs_scale_of(0);
        scene->sought = scene->cutoff = scene->cutoff_low = options->cutoff;
        scene->extreme = false;
        hs_lattice_init(NULL, scene->ndim, scene->scale, &scene->lattice);
        scene_bound_errors(scene, 0.0);
        hs_scene_init_metric(scene, options);
    }
    scene_set_radius(scene, options, scene->cloud.largest);
    stay(scene);
}

/*
 * Sorts the far magnitudes of each column and moves them closer to zero.
 *
 * Why pairs stay what they are. Let u be the unit, so that the cutoff is below 2 u. The magnitudes
 * of a column are taken in ascending order. One that is more than 8 u beyond the one before it
 * moves to some 4 u to 12 u from it, and all that follow move with it. Numbers up to 2^54 u move by
 * multiples of 4 u: they are multiples of a unit in their last place, which is at most 2 u, and
 * become smaller, so that nothing is rounded. Larger numbers are multiples of 4 u, so each is 4 u
 * or more from all others: only which are equal matters, and each follows at the next multiple. So
 * every difference of two coordinates stays what it is to the last bit, or was more than 2 u and is
 * so still. None becomes larger, so all are float64 numbers, wherever closing begins.
 *
 * Along a periodic axis of length L, all x lie in [-L/2, L/2] first, and L/2 takes part as one more
 * number. Across the face, the difference of two points is the sum of L/2 - |x| and L/2 - |y|, and
 * each of these stays as it is, or stays more than the cutoff. Queries take part as if they were
 * points: the differences that count are between both.
 *
 * Where scaling loses digits, pairs are decided on coordinates and box vectors that are not scaled.
 * Those with closed gaps will do: differences are what they were. But S also counts the turns that
 * were made here, so a column with such turns is decided on as it was given, and so is its box
 * vector.
 */

/* Extent of one axis after closing, per point, where all points are apart. */
#define UNITS_PER_POINT 8.0

/* Stands for half a box vector among the keys. Points are numbers from 0 on, queries from -2 on
 * downwards. */
#define HALF (-1)

/* From here on half a box entry is exact: its last place is at least twice the smallest number. */
#define LEAST_HALF 0x1p-1022

/* What one call of condense works with. */
typedef struct condensing {
    hs_account       *account;
    const hs_options *options;
    hs_cloud         *of[CONDENSED_SETS]; /* points, and queries if there are any */
    int               n_sets;
    int64_t           n; /* of both together */
    condensed_set    *condensed;
    bool              changes_rows; /* gaps of box vectors may be closed, too */
    bool              keeps_given;  /* columns that are wrapped, as they were before */
    hs_scale          to_units, from_units;
    double            far;    /* gaps are closed from here on, in the caller's unit */
    double            coarse; /* 2^54 u, in the caller's unit */
    hs_keys           keys;   /* room for n + 1 */
} condensing;

/* Copies the column of both sets before any number in it is wrapped. */
static hs_status
keep_given(const condensing *doing, int k)
{
    for (int set = 0; set < doing->n_sets; set++) {
        const hs_cloud *cloud = doing->of[set];
        double        **given = &doing->condensed->given[set][k];
        *given = hs_alloc(doing->account, HS_FOR_ORIGINALS, cloud->n, sizeof **given);
        if (*given == NULL) {
            return HS_ERR_MEMORY;
        }
        memcpy(*given, cloud->x[k], (size_t)cloud->n * sizeof **given);
    }
    return HS_OK;
}

/* Makes room for the turns of a column, all zero. */
static hs_status
begin_turns(const condensing *doing, int set, int k)
{
    condensed_set *condensed = doing->condensed;
    const int64_t  n = doing->of[set]->n;
    int64_t       *turns = hs_alloc(doing->account, HS_FOR_WRAPS, n, sizeof *turns);
    condensed->turns[set][k] = turns;
    if (turns == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(turns, 0, (size_t)n * sizeof *turns);
    condensed->has_turns = true;
    return doing->keeps_given && condensed->given[0][k] == NULL ? keep_given(doing, k) : HS_OK;
}

/* Wraps what is far into the box; turns are counted where S is wanted. */
static hs_status
wrap_far(const condensing *doing, int set, int k, double length, hs_failure *failure)
{
    double *x = doing->of[set]->x[k];
    for (int64_t i = 0; i < doing->of[set]->n; i++) {
        int64_t turned = 0;
        if (!(fabs(x[i]) > doing->far)) {
            continue;
        }
        const double wrapped = hs_wrap_axis(x[i], length, &turned);
        if ((doing->options->want & HS_WANT_SHIFT) && turned != 0) {
            if (turned == HS_WRAP_UNKNOWN) {
                failure->row = i;
                failure->in_queries = set > 0;
                return HS_ERR_SHIFT_RANGE;
            }
            int64_t *const *turns = &doing->condensed->turns[set][k];
            if (*turns == NULL && begin_turns(doing, set, k) != HS_OK) {
                return HS_ERR_MEMORY;
            }
            (*turns)[i] = turned;
        }
        x[i] = wrapped;
    }
    return HS_OK;
}

/* Of the magnitude, which orders like the number. */
static int64_t
bits_of(double x)
{
    return (int64_t)hs_bits_of_double(fabs(x));
}

/* The magnitudes of a column, ascending, in units. */
typedef struct places {
    double last;  /* the last one, */
    double place; /* where it went, */
    double moved; /* and, unless it is beyond 2^54 u, by what */
} places;

/* Where the next magnitude goes, and all that are equal to it. */
static double
next_place(places *at, double x, bool is_coarse)
{
    const double after = 4.0 * (ceil(0.25 * at->place) + 1.0);
    if (is_coarse) {
        at->place = after;
    } else {
        if (x - at->last > 8.0) {
            at->moved = 4.0 * floor(0.25 * (x - after));
        }
        at->place = x - at->moved;
    }
    at->last = x;
    return at->place;
}

/* A place as a coordinate of the scene. */
static double
placed(const condensing *doing, double place)
{
    return doing->condensed->is_scaled ? place : hs_scale_apply(doing->from_units, place);
}

/* Lists the magnitudes beyond `from`, `half` among them if it is one; returns how many. The
 * largest of the others is where places begin. */
static int64_t
collect(condensing *doing, int k, double from, double half, places *at)
{
    hs_keys *keys = &doing->keys;
    int64_t  found = 0;
    double   largest = 0.0;
    for (int set = 0; set < doing->n_sets; set++) {
        double *x = doing->of[set]->x[k];
        for (int64_t i = 0; i < doing->of[set]->n; i++) {
            if (fabs(x[i]) > from) {
                keys->keys[found] = bits_of(x[i]);
                keys->ids[found++] = (int32_t)(set == 0 ? i : HALF - 1 - i);
                continue;
            }
            largest = hs_larger(fabs(x[i]), largest);
            if (doing->condensed->is_scaled) {
                x[i] = hs_scale_apply(doing->to_units, x[i]);
            }
        }
    }
    if (half > from) {
        keys->keys[found] = bits_of(half);
        keys->ids[found++] = HALF;
    }
    at->last = at->place = hs_scale_apply(doing->to_units, largest);
    at->moved = 0.0;
    return found;
}

/* Closes the gaps of a column from `from` on, and *half, which is 0 along an open axis. */
static hs_status
condense_numbers(condensing *doing, int k, double from, double *half)
{
    const hs_keys  *keys = &doing->keys;
    places          at;
    const int64_t   found = collect(doing, k, from, *half, &at);
    const hs_status status = hs_keys_sort(&doing->keys, 0, found);
    double          place = 0.0;
    *half = placed(doing, hs_scale_apply(doing->to_units, *half)); /* unless it is far */
    for (int64_t e = 0; e < found && status == HS_OK; e++) {
        if (e == 0 || keys->keys[e] != keys->keys[e - 1]) {
            const double size = hs_double_of_bits((uint64_t)keys->keys[e]);
            const bool   is_coarse = size > doing->coarse;
            const double x_units = is_coarse ? at.last : hs_scale_apply(doing->to_units, size);
            place = placed(doing, next_place(&at, x_units, is_coarse));
        }
        if (keys->ids[e] == HALF) {
            *half = place;
        } else {
            const int64_t id = keys->ids[e];
            double *x = id >= 0 ? &doing->of[0]->x[k][id] : &doing->of[1]->x[k][HALF - 1 - id];
            *x = copysign(place, *x);
        }
    }
    return status;
}

/* Sets the range of a column: each cloud gets that of both. */
static void
measure_column(const condensing *doing, int k)
{
    double lower = INFINITY, upper = -INFINITY;
    for (int set = 0; set < doing->n_sets; set++) {
        const hs_cloud *cloud = doing->of[set];
        for (int64_t i = 0; i < cloud->n; i++) {
            lower = hs_smaller(cloud->x[k][i], lower);
            upper = hs_larger(cloud->x[k][i], upper);
        }
    }
    for (int set = 0; set < doing->n_sets; set++) {
        doing->of[set]->lower[k] = lower;
        doing->of[set]->upper[k] = upper;
    }
}

static hs_status
condense_column(condensing *doing, int k, hs_failure *failure)
{
    const hs_cloud *cloud = doing->of[0]; /* its range is that of both */
    condensed_set  *condensed = doing->condensed;
    const double    far = doing->far;
    const int       row = mover_of(condensed->box, k);
    double         *entry = row >= 0 ? &condensed->rows.rows[row][k] : NULL;
    double          half = row >= 0 ? 0.5 * fabs(*entry) : 0.0;
    const bool      is_far = hs_larger(-cloud->lower[k], cloud->upper[k]) > far || half > far;
    if (!is_far && !condensed->is_scaled) {
        return HS_OK;
    }
    for (int set = 0; is_far && row >= 0 && set < doing->n_sets; set++) {
        const hs_status status = wrap_far(doing, set, k, fabs(*entry), failure);
        if (status != HS_OK) {
            return status;
        }
    }
    const bool condenses = is_far && (row < 0 || half > hs_larger(far, LEAST_HALF));
    /* What is dense enough already is left alone, so that one outlier costs no sorting. */
    const double    dense = hs_scale_apply(doing->from_units, UNITS_PER_POINT * (double)doing->n);
    const double    from = condenses ? hs_smaller(dense, far) : INFINITY;
    const hs_status status = condense_numbers(doing, k, from, &half);
    if (row >= 0 && condenses) {
        *entry = copysign(2.0 * half, *entry);
    } else if (row >= 0 && condensed->is_scaled) {
        *entry = hs_scale_apply(doing->to_units, *entry);
    }
    measure_column(doing, k);
    return status;
}

/* Closes the gaps of all columns that have any, one after the other. */
static hs_status
condense_columns(condensing *doing, hs_failure *failure)
{
    const hs_cloud *cloud = doing->of[0];
    double          largest = 0.0;
    for (int k = 0; k < cloud->ndim; k++) {
        const int mover = mover_of(doing->condensed->box, k);
        if (mover == OPEN || (mover >= 0 && doing->changes_rows)) {
            const hs_status status = condense_column(doing, k, failure);
            if (status != HS_OK) {
                return status;
            }
        }
        largest = hs_larger(hs_larger(-cloud->lower[k], cloud->upper[k]), largest);
    }
    for (int set = 0; set < doing->n_sets; set++) {
        doing->of[set]->largest = largest;
    }
    return HS_OK;
}

/*
 * unit: the exponent of the cutoff, 2^unit <= cutoff < 2^(unit + 1); with cutoff 0 any other.
 * powers: what is far is so beyond 2^powers units, HS_FAR_EXPONENT at most. Does nothing
 * but look at ranges where nothing is far. size: of the box. asking: NULL, or queries, whose
 * range and that of the points have been joined. HS_ERR_SHIFT_RANGE only where S is wanted.
 * condensed_free in any case.
 */
static hs_status
condense(hs_account *account, const hs_options *options, const hs_box_size *size, int unit,
         int powers, hs_cloud *cloud, hs_cloud *asking, condensed_set *condensed,
         hs_failure *failure)
{
    const hs_box *box = condensed->given_box;
    if (cloud->n == 0 || (asking != NULL && asking->n == 0) ||
        !hs_is_far(hs_larger(0.5 * size->largest, cloud->largest), unit, powers)) {
        return HS_OK;
    }
    memset(condensed->turns, 0, sizeof condensed->turns);
    memset(condensed->given, 0, sizeof condensed->given);
    condensing doing = {.account = account,
                        .options = options,
                        .of = {cloud, asking},
                        .n_sets = asking != NULL ? 2 : 1,
                        .keeps_given = unit > 0, /* scaling down may lose digits */
                        .n = cloud->n + (asking != NULL ? asking->n : 0),
                        .condensed = condensed,
                        .to_units = hs_scale_of(unit),
                        .from_units = hs_scale_of(-unit),
                        .far = ldexp(1.0, unit + powers),
                        .coarse = ldexp(1.0, unit + HS_FAR_EXPONENT)};
    /* Box vectors are left alone where closing would change a decision on the points as given: in
     * coupled boxes, and for precision="double". */
    doing.changes_rows = box == NULL || (!size->is_coupled && options->precision != HS_DOUBLE);
    if (doing.changes_rows) {
        condensed->is_scaled = unit < 0;
        if (box != NULL) {
            condensed->rows = *box;
            condensed->box = &condensed->rows;
        }
    }
    const int64_t n = doing.n + 1; /* of all four arrays, which are one memory block */
    int64_t *keys = hs_alloc(account, HS_FOR_ORDER, n, 2 * (sizeof(int64_t) + sizeof(int32_t)));
    if (keys == NULL) {
        return HS_ERR_MEMORY;
    }
    int32_t *ids = (int32_t *)(void *)(keys + 2 * n);
    doing.keys = (hs_keys){
        .options = options, .keys = keys, .spare_keys = keys + n, .ids = ids, .spare_ids = ids + n};
    const hs_status status = condense_columns(&doing, failure);
    hs_free(account, keys);
    return status;
}

static void
condensed_free(hs_account *account, condensed_set *condensed)
{
    for (int set = 0; condensed->has_turns && set < CONDENSED_SETS; set++) {
        for (int k = 0; k < HS_MAX_DIM; k++) {
            hs_free(account, condensed->turns[set][k]);
            hs_free(account, condensed->given[set][k]);
            condensed->turns[set][k] = NULL;
            condensed->given[set][k] = NULL;
        }
    }
}

/* Allocates columns for the originals and the turns, in this order, where they are kept. */
static bool
allocate_beside(hs_account *account, hs_scene *scene)
{
    const int m = scene->turns.known ? scene->lattice.n_periodic : 0;
    const int d = scene->keeps_originals ? scene->ndim : 0;
    if (d + m == 0) {
        return true;
    }
    const bool    narrow = hs_fold_turns(&scene->lattice, scene->cloud.largest) < INT32_MAX;
    const int64_t pitch = hs_column_pitch(scene->n, sizeof(double)) * (int64_t)sizeof(double);
    const int64_t turns_pitch =
        narrow ? hs_column_pitch(scene->n, sizeof(int32_t)) * (int64_t)sizeof(int32_t) : pitch;
    scene->beside =
        hs_alloc(account, HS_FOR_ORIGINALS, d * pitch + m * turns_pitch + HS_COLUMN_PADDING, 1);
    if (scene->beside == NULL) {
        return false;
    }
    hs_account_reassign(account, HS_FOR_ORIGINALS, HS_FOR_WRAPS,
                        m * turns_pitch + (d == 0 ? HS_COLUMN_PADDING : 0));
    char *column = scene->beside;
    for (int k = 0; k < d; k++, column += pitch) {
        scene->originals[k] = (double *)(void *)column;
    }
    for (int r = 0; r < m; r++, column += turns_pitch) {
        scene->turns.narrow[r] = narrow ? (int32_t *)(void *)column : NULL;
        scene->turns.wide[r] = narrow ? NULL : (int64_t *)(void *)column;
    }
    return true;
}

/* Scales points [first, last), and copies them to the originals before or after that. */
static hs_status
scale_slab(void *context, int slab, int64_t first, int64_t last)
{
    hs_scene    *scene = context;
    const size_t n_bytes = (size_t)(last - first) * sizeof(double);
    const bool   copies = scene->keeps_originals && !scene->x_is_beside;
    (void)slab;
    for (int k = 0; k < scene->ndim; k++) {
        double *x = scene->cloud.x[k];
        if (copies && scene->extreme) {
            memcpy(scene->originals[k] + first, x + first, n_bytes);
        }
        for (int64_t i = first; scene->pending.exponent != 0 && i < last; i++) {
            x[i] = hs_scale_apply(scene->pending, x[i]);
        }
        if (copies && !scene->extreme) {
            memcpy(scene->originals[k] + first, x + first, n_bytes);
        }
    }
    return HS_OK;
}

/* The originals are kept beside the search's copy only if needed. */
static hs_status
prepare_points(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene)
{
    const int m = scene->lattice.n_periodic;
    hs_cloud *cloud = &scene->cloud;
    scene->keeps_originals =
        scene->extreme || (m > 0 && (!scene->lattice.aligned || options->precision == HS_DOUBLE));
    scene->turns.known = m > 0 && (scene->keeps_originals || (options->want & HS_WANT_SHIFT));
    if (m > 0 && !(options->want & HS_WANT_SHIFT) && options->precision != HS_DOUBLE) {
        hs_scene_fold_far(scene);
    }
    for (int k = 0; k < scene->ndim; k++) {
        cloud->lower[k] = hs_scale_apply(scene->pending, cloud->lower[k]);
        cloud->upper[k] = hs_scale_apply(scene->pending, cloud->upper[k]);
    }
    cloud->largest = hs_scale_apply(scene->pending, cloud->largest);
    if (!allocate_beside(account, scene)) {
        return HS_ERR_MEMORY;
    }
    scene->x_is_beside = scene->keeps_originals && !scene->extreme && !scene->lattice.aligned;
    if ((scene->keeps_originals && !scene->x_is_beside) || scene->pending.exponent != 0) {
        const hs_options silent = {.poll = NULL}; /* the caller was polled when this was copied */
        (void)hs_walk_slabs(team, &silent, scene->n, scale_slab, scene);
    }
    for (int k = 0; scene->x_is_beside && k < scene->ndim; k++) {
        double *beside = scene->originals[k]; /* wrapping moves the points there */
        scene->originals[k] = cloud->x[k];
        cloud->x[k] = beside;
    }
    return HS_OK;
}

/* Wraps the points into the box. Sets x_largest, the range of t_k of the points in lower and upper,
 * and *magnitude, the largest sum of absolute terms. */
static hs_status
wrap_points(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene,
            double *magnitude, hs_failure *failure)
{
    wrapping wrap;
    *magnitude = 0.0;
    if (prepare_points(account, team, options, scene) != HS_OK) {
        return HS_ERR_MEMORY;
    }
    if (scene->lattice.n_periodic == 0) {
        stay(scene);
        return HS_OK;
    }
    wrap.scene = scene;
    wrap.few_turns = hs_fold_turns(&scene->lattice, scene->cloud.largest) <= HS_FOLD_TURNS;
    wrap.n_slabs = scene->n < HS_SLABS * HS_SLAB_POINTS
                       ? (int)((scene->n + HS_SLAB_POINTS - 1) / HS_SLAB_POINTS)
                       : HS_SLABS;
    for (int slab = 0; slab < wrap.n_slabs; slab++) {
        wrap.folded[slab] = hs_wrap_range_none();
    }
    hs_status     status = hs_walk_slabs(team, options, scene->n, wrap_slab, &wrap);
    hs_wrap_range folded = hs_wrap_range_none();
    for (int slab = 0; slab < wrap.n_slabs; slab++) {
        hs_wrap_range_join(&folded, &wrap.folded[slab]);
    }
    if (status == HS_ERR_SHIFT_RANGE) {
        failure->row = folded.failed;
        status = hs_skew_is_left(&scene->lattice) ? HS_ERR_BOX_SKEWED : status;
    }
    *magnitude = folded.magnitude;
    for (int k = 0; k < scene->ndim; k++) {
        const bool open = scene->lattice.row_of_axis[k] < 0;
        scene->x_largest[k] = folded.x_largest[k];
        scene->lower[k] = scene->upper[k] = 0.0;
        if (scene->n > 0 && scene->lattice.aligned && (open || is_inside(scene, k))) {
            scene->x_largest[k] = fmax(-scene->cloud.lower[k], scene->cloud.upper[k]);
        }
        if (scene->n > 0 && (open || !scene->lattice.aligned)) {
            const bool of_cloud = scene->lattice.aligned; /* the axis was left alone */
            scene->lower[k] = of_cloud ? scene->cloud.lower[k] : folded.lower[k];
            scene->upper[k] = of_cloud ? scene->cloud.upper[k] : folded.upper[k];
        }
    }
    return status;
}

/* Clears what is added to or freed. The rest is large, and set before it is read. */
static void
start_scene(const hs_points *points, hs_scene *scene)
{
    scene->ndim = points->ndim;
    scene->n = points->n;
    scene->keeps_originals = scene->x_is_beside = scene->is_kept = false;
    scene->in_one_cell = scene->is_untested = false;
    scene->cloud.block = scene->beside = NULL;
    scene->turns = (hs_turns){.known = false};
    memset(scene->x_largest, 0, sizeof scene->x_largest);
}

hs_status
hs_scene_from_kept(hs_account *account, hs_team *team, const hs_scene *kept,
                   const hs_points *queries, const hs_options *options, bool for_cells,
                   hs_scene *asking, hs_failure *failure)
{
    double     magnitude = 0.0;
    hs_options as_kept = *options;
    start_scene(queries, asking);
    if (for_cells || kept->is_untested) { /* however many turns that are */
        as_kept.want &= ~(unsigned)HS_WANT_SHIFT;
    } else if (kept->turns.known) {
        as_kept.want |= HS_WANT_SHIFT;
    }
    hs_status status = hs_cloud_load(account, team, queries, options, &asking->cloud, failure);
    if (status == HS_OK && !for_cells && !hs_scene_takes(kept, &asking->cloud)) {
        status = HS_REBUILD;
    }
    if (status == HS_OK) {
        scene_share(kept, asking);
        status = wrap_points(account, team, &as_kept, asking, &magnitude, failure);
    }
    if (status == HS_ERR_SHIFT_RANGE && !for_cells && !(options->want & HS_WANT_SHIFT)) {
        status = HS_REBUILD; /* a scene without turns will do */
    }
    failure->in_queries = !for_cells && status != HS_OK && status != HS_REBUILD;
    if (status == HS_OK && !for_cells) {
        scene_bound_errors(asking, magnitude);
        hs_scene_scale_ranges(asking);
        status = scene_covers(kept, asking) ? HS_OK : HS_REBUILD;
    }
    if (status != HS_OK) {
        hs_scene_free(account, asking);
    }
    return status;
}

/* The range of the points becomes that of a domain, or reaches further: as if queries lay at its
 * ends. */
static void
widen_cloud(const double *domain, hs_cloud *cloud)
{
    for (int k = 0; k < cloud->ndim && cloud->n > 0; k++) {
        const double low = domain[k], high = domain[cloud->ndim + k];
        if (low <= high) {
            cloud->lower[k] = hs_smaller(low, cloud->lower[k]);
            cloud->upper[k] = hs_larger(high, cloud->upper[k]);
            cloud->largest = hs_larger(hs_larger(-low, high), cloud->largest);
        }
    }
}

/* The turns that closing gaps made, added to those that wrapping made after it. With all of them
 * the originals are the columns as given. */
static void
add_turns(const condensed_set *condensed, int set, hs_scene *scene)
{
    for (int k = 0; condensed->has_turns && k < scene->ndim; k++) {
        const int64_t *more = condensed->turns[set][k];
        const double  *given = condensed->given[set][k];
        const int      row = scene->lattice.row_of_axis[k];
        for (int64_t i = 0; more != NULL && i < scene->n; i++) {
            hs_turns_set(&scene->turns, row, i, hs_turns_get(&scene->turns, row, i) + more[i]);
        }
        if (scene->extreme && given != NULL) {
            memcpy(scene->originals[k], given, (size_t)scene->n * sizeof *given);
        }
    }
}

/* Sets the box vectors as given in columns that are decided on as they were given. */
static void
restore_rows(const condensed_set *condensed, hs_lattice *lattice)
{
    for (int r = 0; condensed->has_turns && r < lattice->n_periodic; r++) {
        for (int k = 0; k < lattice->ndim; k++) {
            if (condensed->given[0][k] != NULL) {
                lattice->given[r][k] = condensed->given_box->rows[lattice->vector_of_row[r]][k];
            }
        }
    }
}

/* Sets lattice and radius, wraps the points, and sets the bounds. asking: NULL, or the queries'
 * scene, which is wrapped too; the bounds of `scene` hold for both. */
static hs_status
fill_scaled(hs_account *account, hs_team *team, const hs_options *options,
            const condensed_set *condensed, hs_scene *scene, hs_scene *asking, hs_failure *failure)
{
    /* Without points nothing has an image, however small the box is. */
    const bool empty = scene->n == 0 || (asking != NULL && asking->n == 0);
    if (condensed->has_turns) { /* more than the points themselves tell */
        scene->cloud.largest = INFINITY;
        if (asking != NULL) {
            asking->cloud.largest = INFINITY;
        }
    }
    const hs_box *box = empty ? NULL : condensed->box;
    hs_lattice_init(box, scene->ndim, scene->pending, &scene->lattice);
    if (scene->extreme) {
        restore_rows(condensed, &scene->lattice);
    }
    /* Whether the cutoff has more images than any memory holds: in boxes that no closing has
     * scaled. */
    const hs_box_size size = hs_box_size_of(condensed->box);
    const bool        is_endless =
        hs_is_far(scene->sought, hs_exponent_of(size.short_row), HS_FAR_IMAGES_EXPONENT);
    if (scene->is_kept && !empty && !is_endless &&
        (box_vanishes(scene) || open_drowns_box(&scene->cloud, &size, scene->sought))) {
        scene_put_in_one_cell(scene); /* open axes leave nothing of the box */
    }
    scene_set_radius(scene, options, hs_scale_apply(scene->pending, scene->cloud.largest));
    double shortest = INFINITY;
    for (int k = 0; k < scene->ndim; k++) {
        const bool is_open = scene->lattice.row_of_axis[k] < 0;
        shortest = is_open ? shortest : hs_smaller(scene->lattice.period[k], shortest);
    }
    if (scene->formula_error > scene->cutoff && !(scene->formula_error <= NOISE * shortest)) {
        /* It passes both the cutoff and a small part of the box: too many images might be called
         * near, and the answer is noise. */
        scene_name_farthest(scene, asking, failure);
        return HS_ERR_ROUNDING;
    }
    if (box_vanishes(scene)) {
        if (!scene->lattice.aligned && !is_endless) {
            return HS_ERR_BOX_SKEWED;
        }
        failure->expected_pairs = failure->expected_bytes = INFINITY; /* of images */
        return HS_ERR_MEMORY;
    }
    double    magnitude = 0.0, of_asking = 0.0;
    hs_status status = wrap_points(account, team, options, scene, &magnitude, failure);
    if (status == HS_OK && asking != NULL) {
        scene_share(scene, asking);
        status = wrap_points(account, team, options, asking, &of_asking, failure);
        failure->in_queries = status == HS_ERR_SHIFT_RANGE;
    }
    if (status != HS_OK) {
        return status;
    }
    magnitude = hs_larger(magnitude, of_asking);
    if (asking != NULL) {
        scene_join_wrapped(scene, asking);
    }
    if (scene->is_kept) {
        scene_make_room(scene, &magnitude);
    }
    scene_bound_errors(scene, magnitude);
    hs_scene_scale_ranges(scene);
    for (int k = 0; scene->is_kept && k < scene->ndim; k++) {
        scene->t_error[k] *= 2.0; /* queries may be rounded to beyond another face */
    }
    hs_scene_init_metric(scene, options);
    return HS_OK;
}

/* Chooses the scale of a scene whose points are as given, and fills it. */
static hs_status
scale_scene(hs_account *account, hs_team *team, const hs_options *options, const hs_box *box,
            hs_scene *scene, hs_scene *asking, hs_failure *failure)
{
    condensed_set     condensed; /* large, and seldom used: not cleared */
    hs_cloud         *cloud = &scene->cloud;
    const hs_box_size size = hs_box_size_of(box);
    hs_status         status = HS_OK;
    condensed.box = condensed.given_box = box;
    condensed.is_scaled = condensed.has_turns = false;
    scene->sought = options->cutoff;
    if (scene->within > 0.0 &&
        !fits_one_scale(cloud, &size, unit_exponent(cloud, &size, scene->within),
                        HS_FAR_BOUNDED_EXPONENT)) {
        scene->sought = scene->within;
    } else if (!scene->is_kept && !scene->is_plain && cloud->largest > 0.0 && size.largest == 0.0 &&
               options->cutoff > ENOUGH_CUTOFF * cloud->largest) {
        /* A smaller one that is beyond all distances as well. */
        const int exponent = hs_exponent_of(cloud->largest) + WHOLE_EXPONENT;
        scene->sought = exponent > 1023 ? options->cutoff
                                        : hs_smaller(ldexp(1.0, exponent), options->cutoff);
    }
    const int unit = unit_exponent(cloud, &size, scene->sought);
    if (scene_may_condense(scene, asking, &size, unit)) {
        const int powers = scene->is_wide ? HS_FAR_BOUNDED_EXPONENT : HS_FAR_EXPONENT;
        status = condense(account, options, &size, unit, powers, cloud,
                          asking != NULL ? &asking->cloud : NULL, &condensed, failure);
    }
    if (status == HS_OK) {
        scene_set_scale(condensed.box, condensed.is_scaled, unit, scene, asking);
        status = fill_scaled(account, team, options, &condensed, scene, asking, failure);
    }
    if (status == HS_OK) {
        add_turns(&condensed, 0, scene);
        if (asking != NULL) {
            add_turns(&condensed, 1, asking);
        }
    }
    condensed_free(account, &condensed);
    return status;
}

hs_status
hs_scene_make(hs_account *account, hs_team *team, const hs_sets *sets, const hs_box *box,
              const hs_options *options, hs_scene *scene, hs_scene *asking, hs_failure *failure)
{
    const bool follows = sets->follows && scene->is_ordinary && scene->sought == options->cutoff;
    start_scene(sets->points, scene);
    scene->is_ordinary = false;
    scene->is_kept = sets->is_kept;
    scene->is_plain = sets->is_plain;
    scene->is_wide = sets->is_wide;
    scene->least_cutoff = sets->least_cutoff;
    scene->within = sets->within;
    if (asking != NULL) {
        start_scene(sets->queries, asking);
    }
    if (!(options->cutoff >= 0.0) || !isfinite(options->cutoff)) {
        failure->value = options->cutoff;
        return HS_ERR_CUTOFF;
    }
    hs_status status = hs_box_check(box, failure);
    if (status == HS_OK) {
        status = hs_cloud_load(account, team, sets->points, options, &scene->cloud, failure);
    }
    if (status == HS_OK && asking != NULL) {
        status = hs_cloud_load(account, team, sets->queries, options, &asking->cloud, failure);
        failure->in_queries = status != HS_OK;
    }
    if (status == HS_OK && sets->domain != NULL) {
        widen_cloud(sets->domain, &scene->cloud);
    }
    if (status == HS_OK && asking != NULL) {
        scene_join_clouds(scene, asking);
    }
    scene->is_ordinary = status == HS_OK && scene_needs_no_scaling(sets, box, options, scene);
    if (scene->is_ordinary) {
        scene_fill_ordinary(options, follows, scene);
    } else if (status == HS_OK) {
        status = scale_scene(account, team, options, box, scene, asking, failure);
    }
    if (status != HS_OK) {
        hs_scene_free(account, scene);
        if (asking != NULL) {
            hs_scene_free(account, asking);
        }
    }
    return status;
}

void
hs_scene_free(hs_account *account, hs_scene *scene)
{
    hs_cloud_free(account, &scene->cloud);
    hs_free(account, scene->beside);
    scene->beside = NULL;
}

/* One pass that copies each point, then finds the largest coordinate in the copy. */

/* Independent chains of the loop over all entries: one would wait for itself. */
#define CHAINS 4

/* Points [first, last), one behind another. */
static void
copy_rows(const hs_points *points, int64_t first, int64_t last, char *to)
{
    const size_t size = points->real == HS_FLOAT32 ? sizeof(float) : sizeof(double);
    const size_t row_size = size * (size_t)points->ndim;
    const bool   packed = points->column_stride == (ptrdiff_t)size || points->ndim == 1;
    to += (size_t)first * row_size;
    if (packed && points->row_stride == (ptrdiff_t)row_size) {
        memcpy(to, (const char *)points->data + first * points->row_stride,
               (size_t)(last - first) * row_size);
        return;
    }
    for (int64_t i = first; i < last; i++) { /* no address behind the last point: it may overflow */
        const char *row = (const char *)points->data + i * points->row_stride;
        for (int k = 0; k < points->ndim; k++, to += size) {
            memcpy(to, row + k * points->column_stride, size);
        }
    }
}

/* Largest |x| of entries [first, last), or NaN if one is not finite. */
HS_ALWAYS_INLINE double
find_largest(const void *rows, const hs_real real, int64_t first, int64_t last)
{
    double  largest[CHAINS] = {0.0}, poison[CHAINS] = {0.0};
    int64_t e = first;
    for (; e + CHAINS <= last; e += CHAINS) {
        for (int c = 0; c < CHAINS; c++) {
            const double x = hs_frame_entry(rows, real, e + c);
            largest[c] = hs_larger(fabs(x), largest[c]);
            poison[c] += x - x;
        }
    }
    for (; e < last; e++) {
        const double x = hs_frame_entry(rows, real, e);
        largest[0] = hs_larger(fabs(x), largest[0]);
        poison[0] += x - x;
    }
    return hs_larger(hs_larger(largest[0], largest[1]), hs_larger(largest[2], largest[3])) +
           (poison[0] + poison[1] + poison[2] + poison[3]);
}

hs_status
hs_frame_take(const hs_points *points, const hs_box *box, const hs_options *options,
              hs_frame *frame, hs_failure *failure)
{
    const size_t size = points->real == HS_FLOAT32 ? sizeof(float) : sizeof(double);
    const size_t row_size = size * (size_t)points->ndim;
    frame->rows = hs_store_reserve(&frame->store, HS_FOR_POINTS, points->n, row_size);
    if (frame->rows == NULL) {
        frame->points.n = 0;
        return HS_ERR_MEMORY;
    }
    frame->points = (hs_points){.data = frame->rows,
                                .n = points->n,
                                .ndim = points->ndim,
                                .real = points->real,
                                .row_stride = (ptrdiff_t)row_size,
                                .column_stride = (ptrdiff_t)size};
    frame->has_box = box != NULL;
    if (box != NULL) {
        frame->box = *box;
    }
    const int64_t d = points->ndim;
    frame->largest = 0.0;
    for (int64_t first = 0; first < points->n; first += HS_POLL_POINTS) {
        const int64_t left = points->n - first;
        const int64_t last = first + (left < HS_POLL_POINTS ? left : HS_POLL_POINTS);
        copy_rows(points, first, last, frame->rows);
        const double largest = points->real == HS_FLOAT32
                                   ? find_largest(frame->rows, HS_FLOAT32, first * d, last * d)
                                   : find_largest(frame->rows, HS_FLOAT64, first * d, last * d);
        if (!isfinite(largest)) {
            return hs_points_check_finite(&frame->points, failure);
        }
        frame->largest = hs_larger(largest, frame->largest);
        if (left > HS_POLL_POINTS && hs_poll(options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

bool
hs_frames_match(const hs_frame *one, const hs_frame *other)
{
    int       rows[HS_MAX_DIM], others[HS_MAX_DIM];
    const int m = hs_frame_periodic(one, rows);
    return one->points.n == other->points.n && one->points.ndim == other->points.ndim &&
           one->points.real == other->points.real && m == hs_frame_periodic(other, others) &&
           memcmp(rows, others, (size_t)m * sizeof *rows) == 0;
}

bool
hs_frames_share_box(const hs_frame *one, const hs_frame *other)
{
    int       rows[HS_MAX_DIM];
    const int m = hs_frame_periodic(one, rows);
    for (int r = 0; r < m; r++) {
        for (int k = 0; k < one->points.ndim; k++) {
            if (one->box.rows[rows[r]][k] != other->box.rows[rows[r]][k]) {
                return false;
            }
        }
    }
    return true;
}

void
hs_frame_free(hs_frame *frame)
{
    hs_store_free(&frame->store);
    frame->rows = NULL;
}
