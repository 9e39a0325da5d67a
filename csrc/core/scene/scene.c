/* SPDX-License-Identifier: BSD-3-Clause */
#include "scene.h"
#include "../exact/arithmetic.h"
#include "../base/sort.h"
#include "../base/status.h"

#include <stdlib.h>

/* scene.c: reads the points, closes gaps, scales, wraps, and sets bounds, in this order: how far
 * what the search computes with can be from the numbers that were given, and what decides then. */

/* Part of the radius above which the width of pairs along an axis counts as that of a ball. */
#define WORTH_NARROWING 0.8
/* Far more than the roundings of the difference of radius and width. */
#define NARROWING_SLACK 0x1p-40
#define UNIT            0x1p-53 /* unit roundoff of float64 */
/* So many times as far away as a box is long, points and not the box drown its short vectors in
 * their rounding. */
#define OUTLIER 0x1p20
/* Error of precision="double", in heights of the box, up to which candidates are few. */
#define NOISE 0x1p-6

/* Sets x_error and t_error, from x_largest and the magnitude of wrapping: component by component,
 * because those of a long box vector may be known far less well than those of a short one. The
 * range of the grid coordinates, the points' own where the axis is open, becomes one period. */
static void
scene_set_bounds(hs_scene *scene, double magnitude)
{
    const hs_lattice *lattice = &scene->lattice;
    const double      lost = scene->extreme ? HS_SCALING_LOSS : 0.0;
    const double      terms = 2 * lattice->n_periodic + 2;
    double            error[HS_MAX_DIM];
    scene->x_error = lost;
    for (int c = 0; c < scene->ndim && !lattice->aligned; c++) {
        error[c] = lost + 2.0 * UNIT * scene->x_largest[c] + terms * terms * 0x1p-104 * magnitude;
        scene->x_error = hs_larger(error[c], scene->x_error);
    }
    for (int k = 0; k < scene->ndim; k++) {
        double along = 0.0; /* what the dot product carries on, and its own rounding */
        for (int c = 0; c < scene->ndim && !lattice->aligned; c++) {
            along += fabs(lattice->normal[k][c]) *
                     (error[c] + (scene->ndim + 2) * UNIT * scene->x_largest[c]);
        }
        scene->t_error[k] = lattice->aligned ? lost : along * (1.0 + 0x1p-40);
        if (lattice->row_of_axis[k] >= 0) {
            const double half = 0.5 * lattice->period[k];
            /* Points that rounding left outside are binned on the face: an error of t. */
            scene->t_error[k] +=
                hs_larger(hs_larger(scene->upper[k] - half, -half - scene->lower[k]), 0.0);
            scene->lower[k] = -half;
            scene->upper[k] = half;
        } else if (scene->lower[k] > scene->upper[k]) { /* no points */
            scene->lower[k] = scene->upper[k] = 0.0;
        }
    }
}

/*
 * Sets formula_error and radius, from the cutoff, the lattice and the largest |x|, scaled.
 *
 * precision="double" computes D in float64 from the points as given: each of its m + 2 terms is
 * rounded to within 2^-53 of the largest partial sum. Candidates must be sought that much further
 * out.
 */
static void
scene_set_radius(hs_scene *scene, const hs_options *options, double farthest)
{
    const hs_lattice *lattice = &scene->lattice;
    scene->formula_error = 0.0;
    if (options->precision == HS_DOUBLE && lattice->n_periodic == 0) {
        /* Differences of floats have a relative error only. */
        scene->formula_error = 4.0 * UNIT * scene->cutoff * scene->ndim;
    } else if (options->precision == HS_DOUBLE) {
        double total = 2.0 * farthest;
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
        scene->formula_error =
            (lattice->n_periodic + 4) * scene->ndim * UNIT * (total + scene->cutoff);
    }
    scene->radius = scene->cutoff + scene->formula_error;
    memset(scene->less, 0, sizeof scene->less);
}

hs_status
hs_scene_narrow(hs_scene *scene, const hs_narrowing *narrowing)
{
    /* Less than this is not worth it. */
    const double enough = WORTH_NARROWING * hs_scale_apply(scene->unscale, scene->radius);
    for (int k = 0; k < scene->ndim; k++) {
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
}

/* Names the first scaled coordinate beyond `most`, or else the largest, and returns its size; -1
 * without points, when nothing is named. */
static double
name_farthest(const hs_cloud *cloud, hs_scale scale, double most, hs_failure *failure)
{
    double largest = -1.0;
    for (int64_t i = 0; i < cloud->n; i++) {
        for (int k = 0; k < cloud->ndim; k++) {
            const double size = hs_scale_apply(scale, fabs(cloud->x[k][i]));
            if (largest <= most && size > largest) {
                largest = size;
                failure->row = i;
                failure->column = k;
                failure->value = cloud->x[k][i];
            }
        }
    }
    return largest;
}

/* Which point or query is to blame for noise; asking: NULL without queries. */
static void
scene_name_farthest(const hs_scene *scene, const hs_scene *asking, hs_failure *failure)
{
    hs_failure   of_queries = *failure;
    const double largest = name_farthest(&scene->cloud, hs_scale_of(0), INFINITY, failure);
    if (asking != NULL &&
        name_farthest(&asking->cloud, hs_scale_of(0), INFINITY, &of_queries) > largest) {
        *failure = of_queries;
        failure->in_queries = true;
    }
}

void
hs_scene_name_outlier(const hs_scene *scene, const hs_scene *asking, hs_failure *failure)
{
    double of_box = 0.0, of_points = 0.0;
    for (int k = 0; k < scene->ndim; k++) {
        of_points = hs_larger(scene->x_largest[k], of_points);
        for (int r = 0; r < scene->lattice.n_periodic; r++) {
            of_box = hs_larger(fabs(scene->lattice.rows[r][k]), of_box);
        }
    }
    if (of_points > OUTLIER * of_box) {
        scene_name_farthest(scene, asking, failure);
    }
}

/* Queries that come later share the bounds of the points up to so many times their distance from
 * the box, and so many box vectors at least. Bounds that are so much wider cost next to nothing:
 * they are some units in the last place, and in open space no bound depends on it. */
#define FURTHER               4.0
#define FURTHER_IN_OPEN_SPACE 1024.0
#define BOX_VECTORS           1024.0
/* Along coordinate axes cells are found for any number, as long as sums of a few are finite. */
#define MOST_FOR_CELLS 0x1p900

/* Widens ranges to what is in others; the range of no points is infinity to -infinity. */
static void
join_ranges(int ndim, const double *lower, const double *upper, double *to_lower, double *to_upper)
{
    for (int k = 0; k < ndim; k++) {
        to_lower[k] = hs_smaller(lower[k], to_lower[k]);
        to_upper[k] = hs_larger(upper[k], to_upper[k]);
    }
}

/* Clears what is added to or freed, and what is a scene's own. The rest is large, and set before it
 * is read. */
static void
start_scene(int ndim, int64_t n, hs_scene *scene)
{
    scene->ndim = ndim;
    scene->n = n;
    scene->keeps_originals = scene->is_kept = scene->is_ordinary = false;
    scene->in_one_cell = scene->is_untested = false;
    scene->cloud.block = scene->beside = NULL;
    scene->turns = (hs_turns){.known = false};
}

/* What was decided for the points holds for the queries, whose scene has been loaded. */
static void
scene_share(const hs_scene *scene, hs_scene *asking)
{
    const hs_cloud cloud = asking->cloud;
    *asking = *scene;
    start_scene(cloud.ndim, cloud.n, asking);
    asking->cloud = cloud;
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
    scene->scale = scene->unscale = hs_scale_of(0);
    scene->cutoff = scene->cutoff_low = scene->radius = 1.0;
    scene->formula_error = 0.0;
    memset(scene->less, 0, sizeof scene->less);
    scene->extreme = false;
    scene->in_one_cell = true;
    hs_lattice_init(NULL, scene->ndim, scene->scale, &scene->lattice);
}

static void
scene_make_room(hs_scene *scene, double *magnitude)
{
    const hs_lattice *lattice = &scene->lattice;
    const double      further = lattice->n_periodic > 0 ? FURTHER : FURTHER_IN_OPEN_SPACE;
    double            away = 0.0;
    for (int r = 0; r < lattice->n_periodic; r++) {
        for (int k = 0; k < lattice->ndim; k++) {
            away = hs_larger(BOX_VECTORS * fabs(lattice->rows[r][k]), away);
        }
    }
    scene->cloud.largest = hs_larger(further * scene->cloud.largest, away);
    *magnitude = hs_larger(further * *magnitude, away);
    for (int k = 0; k < scene->ndim; k++) {
        double across = 0.0; /* what is wrapped lies within half of each row of B */
        for (int r = 0; r < lattice->n_periodic; r++) {
            across += 0.5 * fabs(lattice->rows[r][k]);
        }
        scene->x_largest[k] = 2.0 * hs_larger(scene->x_largest[k], across);
        if (across == 0.0) { /* queries stay wherever they are along this axis */
            scene->x_largest[k] = hs_larger(further * scene->x_largest[k], away);
        }
    }
}

/* The largest scaled coordinate of queries that come later. */
static double
most_taken(const hs_scene *kept, bool is_untested)
{
    return is_untested && kept->lattice.aligned ? MOST_FOR_CELLS : kept->cloud.largest;
}

/* Whether a scene that was kept can take this cloud as it was loaded: no larger numbers, none that
 * its scale would round unless only cells are wanted. */
static bool
scene_takes(const hs_scene *kept, const hs_cloud *cloud)
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

void
hs_scene_name_refused(const hs_scene *kept, const hs_points *queries, hs_failure *failure)
{
    const hs_options options = hs_options_default();
    hs_cloud         cloud;
    if (!kept->in_one_cell &&
        hs_cloud_load(NULL, NULL, queries, &options, &cloud, failure) == HS_OK) {
        failure->in_queries = name_farthest(&cloud, kept->scale, most_taken(kept, true), failure) >=
                              0.0;
        hs_cloud_free(NULL, &cloud);
    }
}

/* Compares exponents, which are integers: no ratio of lengths can overflow. */

/*
 * How far is far? So many powers of two beyond a length, each for a reason of its own. hs_is_far
 * tells.
 */
/* Beyond so many cutoffs gaps between the points are closed: float64 numbers are multiples of four
 * cutoffs there. */
#define FAR_EXPONENT 54
/* Points may be 2^51 box vectors away, where turns are integers that float64 holds; there is one
 * order to spare. What is further away is refused or wrapped before it is scaled. */
#define FAR_TURNS_EXPONENT 52
/*
 * Scaled coordinates and box entries stay below 2^57, so that squares of sums of a few are finite
 * in float32. Closing gaps keeps to that along open and aligned axes; what remains, coupled by a
 * skewed box, is known to within 2^-53 of the largest only, so that a cutoff may well be smaller
 * than 1 then.
 */
#define LARGEST_EXPONENT 56
/* So many vectors of the box in a cutoff have more images than any memory holds. */
#define FAR_IMAGES_EXPONENT 64
/* Open axes that are so many times as long leave less than 2^-10 of a coupled box certain: wrapping
 * errs by some 2^-99 of the largest coordinate (wrap.h). */
#define FAR_DROWNING_EXPONENT 88
/* Where no float32 is made of scaled numbers they stay below 2^901, so that sums of a few are
 * finite. */
#define LARGEST_WIDE_EXPONENT 900
/* With lengths up to 2^400, and down to 2^-400, squares of distances are ordinary numbers. */
#define WIDE_ORDINARY_EXPONENT 400

/* Cutoffs between 2^-20 and 2^20 are left alone: the float32 filter has room for their squares. */
#define ORDINARY_EXPONENT 20
#define LEAST_ORDINARY    0x1p-20
#define MOST_ORDINARY     0x1p20
/* Numbers up to here are not far from any such cutoff (FAR_EXPONENT); nor, where the vectors of
 * the box are no shorter than the second number, more of them away than turns can tell. */
#define LARGEST_ORDINARY  0x1p33
#define SHORTEST_ORDINARY 0x1p-17
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
            mover = mover == OPEN ? l : COUPLED;
            for (int k = 0; k < ndim; k++) {
                mover = k != column && rows[l][k] != 0.0 ? COUPLED : mover;
            }
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
        int    in_row = 0; /* entries that are not zero */
        for (int k = 0; box->periodic[l] && k < box->ndim; k++) {
            const double size = fabs(box->rows[l][k]);
            if (size > 0.0) {
                in_row++;
                found.is_coupled = found.is_coupled || in_row > 1 || (found.moved >> k & 1u);
                found.moved |= 1u << k;
                found.smallest = hs_smaller(size, found.smallest);
                row_largest = hs_larger(size, row_largest);
            }
        }
        found.largest = hs_larger(row_largest, found.largest);
        found.short_row = box->periodic[l] ? hs_smaller(row_largest, found.short_row)
                                           : found.short_row;
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
                     FAR_DROWNING_EXPONENT);
}

/*
 * Closes the gaps between coordinates that are far from zero. Where two different float64 numbers
 * are more than a cutoff apart, all that matters is which are equal, so smaller numbers can take
 * their place. No scale holds both a cutoff of 1e-300 and an outlier at 1e300; once gaps are
 * closed, one does. No pair changes, nor a bit of d and D, and S by the turns alone.
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
 * With S wanted, the points are also kept as they were given: they tell the turns that were made
 * here. Where scaling loses digits, pairs are decided on them and on the box as given; else, and
 * where S is not wanted, closed gaps will do, since differences are what they were.
 */

/* Extent of one axis after closing, per point, where all points are apart. */
#define UNITS_PER_POINT 8.0

/* Stands for half a box vector among the keys. Points are numbers from 0 on, queries from -2 on
 * downwards. */
#define HALF (-1)

/* From here on half a box entry is exact: its last place is at least twice the smallest number. */
#define LEAST_HALF 0x1p-1022

/* Points, queries. */
#define CLOSED_SETS 2

/* What a scene is made of where numbers are far. */
typedef struct far_numbers {
    hs_box_size   size;      /* of the caller's box */
    const hs_box *box;       /* the caller's, or in its place: borrowed, or `closed` */
    const hs_box *given_box; /* the caller's */
    hs_box        closed;
    double        far;                /* gaps are closed from here on, in the caller's unit */
    double       *given[CLOSED_SETS]; /* owned; NULL, or the columns of points and of queries as
                                       * given, one behind another */
} far_numbers;

/* What one call of close_gaps works with. */
typedef struct closing {
    hs_cloud *of[CLOSED_SETS]; /* points, and queries if there are any */
    int       n_sets;
    hs_scale  to_units, from_units;
    double    coarse; /* 2^54 u, in the caller's unit */
    hs_keys   keys;   /* room for all points and queries, and one more */
} closing;

/* Closes the gaps of a column between magnitudes beyond `from`, among them *half, which is 0 along
 * an open axis, and sets its range: each cloud gets that of both. */
static hs_status
close_column(closing *doing, int k, double from, double *half)
{
    hs_keys *keys = &doing->keys;
    int64_t  found = 0;
    /* In units: the magnitude before, where it went, and, unless it is beyond 2^54 u, by what. */
    double last = 0.0, place, moved = 0.0, placed = 0.0;
    double lower = INFINITY, upper = -INFINITY;
    for (int set = 0; set < doing->n_sets; set++) {
        for (int64_t i = 0; i < doing->of[set]->n; i++) {
            const double size = fabs(doing->of[set]->x[k][i]);
            if (size > from) {
                keys->keys[found] = (int64_t)hs_bits_of_double(size);
                keys->ids[found++] = (int32_t)(set == 0 ? i : HALF - 1 - i);
            } else {
                last = hs_larger(size, last);
            }
        }
    }
    if (*half > from) {
        keys->keys[found] = (int64_t)hs_bits_of_double(*half);
        keys->ids[found++] = HALF;
    }
    const hs_status status = hs_keys_sort(keys, 0, found);
    last = place = hs_scale_apply(doing->to_units, last);
    for (int64_t e = 0; e < found && status == HS_OK; e++) {
        const int64_t id = keys->ids[e];
        if (e == 0 || keys->keys[e] != keys->keys[e - 1]) {
            const double size = hs_double_of_bits((uint64_t)keys->keys[e]);
            const double x = hs_scale_apply(doing->to_units, size);
            const double after = 4.0 * (ceil(0.25 * place) + 1.0);
            if (size > doing->coarse) {
                place = after;
            } else {
                moved = x - last > 8.0 ? 4.0 * floor(0.25 * (x - after)) : moved;
                place = x - moved;
                last = x;
            }
            placed = hs_scale_apply(doing->from_units, place);
        }
        if (id == HALF) {
            *half = placed;
        } else {
            double *x = id >= 0 ? &doing->of[0]->x[k][id] : &doing->of[1]->x[k][HALF - 1 - id];
            *x = copysign(placed, *x);
        }
    }
    for (int set = 0; set < doing->n_sets; set++) {
        for (int64_t i = 0; i < doing->of[set]->n; i++) {
            lower = hs_smaller(doing->of[set]->x[k][i], lower);
            upper = hs_larger(doing->of[set]->x[k][i], upper);
        }
    }
    for (int set = 0; set < doing->n_sets; set++) {
        doing->of[set]->lower[k] = lower;
        doing->of[set]->upper[k] = upper;
    }
    return status;
}

/* Wraps the far numbers of a column into the box. HS_ERR_SHIFT_RANGE, with the row, where turns
 * are to be known and cannot be. */
static hs_status
wrap_far(hs_cloud *cloud, int k, double far, double length, bool counts, hs_failure *failure)
{
    for (int64_t i = 0; i < cloud->n; i++) {
        int64_t turned = 0;
        if (fabs(cloud->x[k][i]) > far) {
            cloud->x[k][i] = hs_wrap_axis(cloud->x[k][i], length, &turned);
        }
        if (counts && turned == HS_WRAP_UNKNOWN) {
            failure->row = i;
            return HS_ERR_SHIFT_RANGE;
        }
    }
    return HS_OK;
}

/*
 * Closes the gaps of all columns that have any, one after the other: between numbers that are more
 * than 2^powers units from zero, FAR_EXPONENT at most. unit: the exponent of the cutoff,
 * 2^unit <= cutoff < 2^(unit + 1); with cutoff 0 any other. asking: NULL, or queries, whose range
 * and that of the points have been joined. Whatever the status, far->given is to be freed.
 */
static hs_status
close_gaps(hs_account *account, const hs_options *options, int unit, int powers, hs_cloud *cloud,
           hs_cloud *asking, far_numbers *far, hs_failure *failure)
{
    closing       doing = {.of = {cloud, asking},
                           .n_sets = asking != NULL ? 2 : 1,
                           .to_units = hs_scale_of(unit),
                           .from_units = hs_scale_of(-unit),
                           .coarse = ldexp(1.0, unit + FAR_EXPONENT)};
    const int64_t n = cloud->n + (asking != NULL ? asking->n : 0);
    /* What is dense enough already is left alone, so that one outlier costs no sorting. */
    const double dense = hs_scale_apply(doing.from_units, UNITS_PER_POINT * (double)n);
    /* Box vectors are left alone where closing would change a decision on the points as given: in
     * coupled boxes, and for precision="double". */
    const bool changes_rows = far->box != NULL && !far->size.is_coupled &&
                              options->precision != HS_DOUBLE;
    const bool counts = changes_rows && (options->want & HS_WANT_SHIFT);
    double     largest = 0.0;
    far->far = ldexp(1.0, unit + powers);
    int64_t *keys = hs_alloc(account, HS_FOR_ORDER, n + 1, 2 * (sizeof(int64_t) + sizeof(int32_t)));
    hs_status status = keys != NULL ? HS_OK : HS_ERR_MEMORY;
    if (status == HS_OK) {
        int32_t *ids = (int32_t *)(void *)(keys + 2 * (n + 1));
        doing.keys = (hs_keys){.options = options,
                               .keys = keys,
                               .spare_keys = keys + n + 1,
                               .ids = ids,
                               .spare_ids = ids + n + 1};
    }
    for (int set = 0; status == HS_OK && counts && set < doing.n_sets; set++) {
        const hs_cloud *of = doing.of[set];
        double         *copy = hs_alloc(account, HS_FOR_ORIGINALS, of->n * of->ndim, sizeof *copy);
        for (int k = 0; copy != NULL && k < of->ndim; k++) {
            memcpy(copy + k * of->n, of->x[k], (size_t)of->n * sizeof *copy);
        }
        far->given[set] = copy;
        status = copy != NULL ? HS_OK : HS_ERR_MEMORY;
    }
    if (changes_rows) {
        far->closed = *far->box;
        far->box = &far->closed;
    }
    for (int k = 0; status == HS_OK && k < cloud->ndim; k++) {
        const int    row = mover_of(far->given_box, k);
        double      *entry = row >= 0 && changes_rows ? &far->closed.rows[row][k] : NULL;
        double       half = entry != NULL ? 0.5 * fabs(*entry) : 0.0;
        const double reach = hs_larger(-cloud->lower[k], cloud->upper[k]);
        if ((row == OPEN || entry != NULL) && hs_larger(reach, half) > far->far) {
            for (int set = 0; entry != NULL && status == HS_OK && set < doing.n_sets; set++) {
                status = wrap_far(doing.of[set], k, far->far, fabs(*entry), counts, failure);
                failure->in_queries = status != HS_OK && set > 0;
            }
            const bool closes = entry == NULL || half > hs_larger(far->far, LEAST_HALF);
            if (status == HS_OK) {
                status =
                    close_column(&doing, k, closes ? hs_smaller(dense, far->far) : INFINITY, &half);
            }
            if (entry != NULL && closes) {
                *entry = copysign(2.0 * half, *entry);
            }
        }
        largest = hs_larger(hs_larger(-cloud->lower[k], cloud->upper[k]), largest);
    }
    for (int set = 0; set < doing.n_sets; set++) {
        doing.of[set]->largest = largest;
    }
    hs_free(account, keys);
    return status;
}

/* The turns that closing gaps made, added to those that wrapping made after it. With all of them
 * the originals are the columns as given. */
static void
add_turns(const far_numbers *far, int set, hs_scene *scene)
{
    for (int k = 0; k < scene->ndim; k++) {
        const double *given = far->given[set] + k * scene->n;
        const int     mover = mover_of(far->given_box, k), row = scene->lattice.row_of_axis[k];
        for (int64_t i = 0; mover >= 0 && i < scene->n; i++) {
            int64_t turned = 0;
            if (fabs(given[i]) > far->far) {
                (void)hs_wrap_axis(given[i], fabs(far->given_box->rows[mover][k]), &turned);
            }
            hs_turns_set(&scene->turns, row, i, hs_turns_get(&scene->turns, row, i) + turned);
        }
        if (scene->extreme) {
            memcpy(scene->originals[k], given, (size_t)scene->n * sizeof *given);
        }
    }
}

/* Sets cutoff and scale of a scene with far numbers, and closes their gaps where that is to be
 * done. asking: NULL, or the queries' scene. */
static hs_status
bring_near(hs_account *account, const hs_options *options, const hs_sets *sets, hs_scene *scene,
           hs_scene *asking, far_numbers *far, hs_failure *failure)
{
    hs_cloud    *cloud = &scene->cloud, *queries = asking != NULL ? &asking->cloud : NULL;
    hs_status    status = HS_OK;
    const double largest = hs_larger(far->size.largest, cloud->largest);
    const bool   is_bounded =
        sets->within > 0.0 &&
        hs_is_far(largest, unit_exponent(cloud, &far->size, sets->within), HS_FAR_BOUNDED_EXPONENT);
    /* A scene without a length of its own is scaled by its box or its points, beside which squares
     * of distances are no ordinary numbers. Lengths that pairs are compared with must
     * not vanish. */
    const int  own = unit_exponent(cloud, &far->size, 0.0);
    const bool goes_by_itself = sets->is_wide &&
                                abs(hs_exponent_of(scene->sought)) <= ORDINARY_EXPONENT &&
                                (own < -WIDE_ORDINARY_EXPONENT ||
                                 (own > WIDE_ORDINARY_EXPONENT && sets->least_cutoff == 0.0));
    if (is_bounded) {
        scene->sought = sets->within;
    } else if (goes_by_itself) {
        scene->sought = 0.0;
    } else if (!sets->is_kept && !sets->is_plain && cloud->largest > 0.0 &&
               far->size.largest == 0.0 && options->cutoff > ENOUGH_CUTOFF * cloud->largest) {
        /* A smaller one that is beyond all distances as well. */
        const int exponent = hs_exponent_of(cloud->largest) + WHOLE_EXPONENT;
        scene->sought = exponent > 1023 ? options->cutoff
                                        : hs_smaller(ldexp(1.0, exponent), options->cutoff);
    }
    const int unit = unit_exponent(cloud, &far->size, scene->sought);
    const int powers = sets->is_wide ? HS_FAR_BOUNDED_EXPONENT : FAR_EXPONENT;
    /* Queries that come later may lie in a gap, and the k nearest may be at any distance. Where one
     * scale holds everything, cells of queries and of lists that last are those of the points as
     * given. */
    const bool may_close = !sets->is_kept && (!sets->is_wide || is_bounded) &&
                           (sets->is_wide || (asking == NULL && !sets->is_plain) ||
                            open_drowns_box(cloud, &far->size, scene->sought) ||
                            hs_is_far(largest, unit, LARGEST_WIDE_EXPONENT));
    if (may_close && scene->n > 0 && (asking == NULL || asking->n > 0) &&
        hs_is_far(hs_larger(0.5 * far->size.largest, cloud->largest), unit, powers)) {
        status = close_gaps(account, options, unit, powers, cloud, queries, far, failure);
    }
    /* The exponent to scale by: no number is to have one above `most`, however far it is. */
    const hs_box_size size = hs_box_size_of(far->box);
    const int         most = sets->is_wide ? LARGEST_WIDE_EXPONENT : LARGEST_EXPONENT;
    const double      turned = ldexp(size.largest, FAR_TURNS_EXPONENT);
    const double      reach = turned > 0.0 ? hs_smaller(turned, cloud->largest) : cloud->largest;
    int               exponent = unit == NO_EXPONENT || abs(unit) <= ORDINARY_EXPONENT ? 0 : unit;
    if (hs_exponent_of(hs_larger(size.largest, reach)) - exponent > most) {
        exponent = hs_exponent_of(hs_larger(size.largest, reach)) - most;
    }
    const int wide = hs_exponent_of(open_reach(cloud, &size)) - LARGEST_WIDE_EXPONENT;
    exponent = exponent < wide ? wide : exponent;
    if (exponent > 0) { /* whether that loses digits, of the lengths of pairs, too */
        double smallest = hs_smaller(hs_cloud_smallest(cloud), size.smallest);
        if (queries != NULL) {
            smallest = hs_smaller(hs_cloud_smallest(queries), smallest);
        }
        smallest = scene->sought > 0.0 ? hs_smaller(scene->sought, smallest) : smallest;
        smallest = sets->least_cutoff > 0.0 ? hs_smaller(sets->least_cutoff, smallest) : smallest;
        scene->extreme = smallest != INFINITY && hs_exponent_of(smallest) - exponent < -1022;
    }
    scene->scale = hs_scale_of(exponent);
    scene->unscale = hs_scale_of(-exponent);
    scene->cutoff = scene->cutoff_low = hs_scale_apply(scene->scale, scene->sought);
    if (scene->extreme && scene->sought > 0.0) {
        /* The scaled cutoff may have been rounded or flushed: take bounds. */
        scene->cutoff_low -= HS_SCALING_LOSS;
        scene->cutoff += HS_SCALING_LOSS;
    }
    return status;
}

typedef struct wrapping {
    hs_scene     *scene;
    hs_wrap_range folded[HS_SLABS];
} wrapping;

/* Whether all points lie in the middle period along axis k of an aligned lattice, or it is open:
 * then none is touched. */
static bool
is_inside(const hs_scene *scene, int k)
{
    const double half = 0.5 * scene->lattice.period[k];
    return scene->lattice.row_of_axis[k] < 0 ||
           (scene->cloud.lower[k] >= -half && scene->cloud.upper[k] <= half);
}

/* Wraps columns that scaling would make infinite, or whose originals lie more box vectors away than
 * turns can tell, in the caller's unit. For scenes whose S is not wanted, before they are
 * scaled. */
static void
fold_far(hs_scene *scene)
{
    const hs_lattice *lattice = &scene->lattice;
    hs_cloud         *cloud = &scene->cloud;
    for (int k = 0; k < scene->ndim; k++) {
        const double reach = hs_larger(-cloud->lower[k], cloud->upper[k]);
        const bool   overflows = !(hs_scale_apply(scene->scale, reach) < INFINITY);
        const int    own = mover_among((const double(*)[HS_MAX_DIM])lattice->given, NULL,
                                       lattice->n_periodic, lattice->ndim, k);
        double       length = 0.0; /* that the given numbers repeat after; 0 where not known */
        if (own >= 0) {
            length = fabs(lattice->given[own][k]);
        } else if (lattice->aligned && !scene->extreme && lattice->row_of_axis[k] >= 0) {
            length = hs_scale_apply(scene->unscale, lattice->period[k]);
        }
        if (length > 0.0 &&
            (overflows || (scene->keeps_originals && reach / length >= HS_WRAP_LIMIT))) {
            (void)wrap_far(cloud, k, 0.0, length, false, NULL);
            cloud->lower[k] = -0.5 * length;
            cloud->upper[k] = 0.5 * length;
        }
    }
}

/* Scales points [first, last), beside what is kept of them, and wraps them. */
static hs_status
move_slab(void *context, int slab, int64_t first, int64_t last)
{
    wrapping         *wrap = context;
    hs_scene         *scene = wrap->scene;
    const hs_lattice *lattice = &scene->lattice;
    const hs_turns   *turns = scene->turns.known ? &scene->turns : NULL;
    hs_wrap_range    *folded = &wrap->folded[slab];
    /* Originals are scaled too, unless that loses digits. */
    double *const *from = scene->keeps_originals ? scene->originals : scene->cloud.x;
    double *const *scaled = scene->extreme ? scene->cloud.x : from;
    for (int k = 0; k < scene->ndim; k++) {
        double *x = scene->cloud.x[k];
        for (int64_t i = first; scene->scale.exponent != 0 && i < last; i++) {
            scaled[k][i] = hs_scale_apply(scene->scale, from[k][i]);
        }
        if (lattice->aligned && scaled[k] != x) {
            memcpy(x + first, scaled[k] + first, (size_t)(last - first) * sizeof *x);
        }
    }
    if (!lattice->aligned) {
        hs_fold_points(lattice, scaled, first, last, scene->cloud.x, turns, folded);
    }
    for (int k = 0; lattice->aligned && k < scene->ndim; k++) {
        const int row = lattice->row_of_axis[k];
        if (!is_inside(scene, k)) {
            const double largest = hs_larger(-scene->cloud.lower[k], scene->cloud.upper[k]);
            hs_fold_axis(lattice, k, scene->cloud.x[k], first, last, largest, turns, folded);
        } else if (row >= 0 && turns != NULL && turns->narrow[row] != NULL) {
            memset(turns->narrow[row] + first, 0, (size_t)(last - first) * sizeof(int32_t));
        } else if (row >= 0 && turns != NULL) {
            memset(turns->wide[row] + first, 0, (size_t)(last - first) * sizeof(int64_t));
        }
    }
    return folded->failed < 0 ? HS_OK : HS_ERR_SHIFT_RANGE;
}

/* Allocates columns for X, where the originals stay where they are, and for the turns, and sets
 * which columns are which. */
static bool
allocate_beside(hs_account *account, hs_scene *scene)
{
    const int     m = scene->turns.known ? scene->lattice.n_periodic : 0;
    const int     d = scene->keeps_originals ? scene->ndim : 0;
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
        scene->originals[k] = scene->cloud.x[k];
        scene->cloud.x[k] = (double *)(void *)column;
    }
    for (int r = 0; r < m; r++, column += turns_pitch) {
        scene->turns.narrow[r] = narrow ? (int32_t *)(void *)column : NULL;
        scene->turns.wide[r] = narrow ? NULL : (int64_t *)(void *)column;
    }
    return true;
}

/* Scales the points and wraps them into the box. Sets x_largest, the range of t_k of the points in
 * lower and upper, and *magnitude, the largest sum of absolute terms. */
static hs_status
wrap_points(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene,
            double *magnitude, hs_failure *failure)
{
    const hs_lattice *lattice = &scene->lattice;
    hs_cloud         *cloud = &scene->cloud;
    const bool        is_periodic = lattice->n_periodic > 0;
    hs_status         status = HS_OK;
    wrapping          wrap;
    hs_wrap_range     folded = {.failed = -1};
    scene->keeps_originals = /* beside the search's copy, only if needed */
        scene->extreme || (is_periodic && (!lattice->aligned || options->precision == HS_DOUBLE));
    scene->turns.known = is_periodic && (scene->keeps_originals || (options->want & HS_WANT_SHIFT));
    if (is_periodic && !scene->is_ordinary && !(options->want & HS_WANT_SHIFT) &&
        options->precision != HS_DOUBLE) {
        fold_far(scene);
    }
    for (int k = 0; k < scene->ndim; k++) {
        folded.lower[k] = INFINITY;
        folded.upper[k] = -INFINITY;
    }
    for (int k = 0; scene->scale.exponent != 0 && k < scene->ndim; k++) {
        cloud->lower[k] = hs_scale_apply(scene->scale, cloud->lower[k]);
        cloud->upper[k] = hs_scale_apply(scene->scale, cloud->upper[k]);
    }
    cloud->largest = hs_scale_apply(scene->scale, cloud->largest);
    if ((scene->keeps_originals || scene->turns.known) && !allocate_beside(account, scene)) {
        return HS_ERR_MEMORY;
    }
    if (is_periodic || scene->scale.exponent != 0) {
        wrap.scene = scene;
        const int64_t n_slabs = (scene->n + HS_SLAB_POINTS - 1) / HS_SLAB_POINTS;
        for (int64_t slab = 0; slab < n_slabs && slab < HS_SLABS; slab++) {
            wrap.folded[slab] = folded;
        }
        status = hs_walk_points(team, options, scene->n, 0, move_slab, &wrap);
        for (int64_t slab = 0; slab < n_slabs && slab < HS_SLABS; slab++) {
            const hs_wrap_range *of = &wrap.folded[slab];
            join_ranges(scene->ndim, of->lower, of->upper, folded.lower, folded.upper);
            for (int k = 0; k < scene->ndim; k++) {
                folded.x_largest[k] = hs_larger(of->x_largest[k], folded.x_largest[k]);
            }
            folded.magnitude = hs_larger(of->magnitude, folded.magnitude);
            folded.failed = folded.failed < 0 ? of->failed : folded.failed; /* the lowest */
        }
    }
    if (status == HS_ERR_SHIFT_RANGE && hs_skew_is_left(lattice)) {
        status = HS_ERR_BOX_SKEWED;
    } else if (status == HS_ERR_SHIFT_RANGE) {
        failure->row = folded.failed;
    }
    *magnitude = folded.magnitude;
    for (int k = 0; k < scene->ndim; k++) {
        const bool is_left_alone = lattice->aligned && is_inside(scene, k);
        scene->x_largest[k] = folded.x_largest[k];
        scene->lower[k] = folded.lower[k];
        scene->upper[k] = folded.upper[k];
        if (scene->n == 0) {
            scene->x_largest[k] = 0.0;
            scene->lower[k] = INFINITY;
            scene->upper[k] = -INFINITY;
        } else if (is_left_alone) {
            scene->x_largest[k] = hs_larger(-cloud->lower[k], cloud->upper[k]);
            scene->lower[k] = cloud->lower[k];
            scene->upper[k] = cloud->upper[k];
        } else if (lattice->aligned) {
            scene->x_largest[k] = scene->upper[k] = 0.5 * lattice->period[k];
            scene->lower[k] = -scene->upper[k];
        }
    }
    return status;
}

hs_status
hs_scene_from_kept(hs_account *account, hs_team *team, const hs_scene *kept,
                   const hs_points *queries, const hs_options *options, bool for_cells,
                   hs_scene *asking, hs_failure *failure)
{
    double     magnitude = 0.0;
    hs_options as_kept = *options;
    start_scene(queries->ndim, queries->n, asking);
    if (for_cells || kept->is_untested) { /* however many turns that are */
        as_kept.want &= ~(unsigned)HS_WANT_SHIFT;
    } else if (kept->turns.known) {
        as_kept.want |= HS_WANT_SHIFT;
    }
    hs_status status = hs_cloud_load(account, team, queries, options, &asking->cloud, failure);
    if (status == HS_OK && !for_cells && !scene_takes(kept, &asking->cloud)) {
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
        const bool is_tested = kept->n > 0 && !kept->is_untested;
        scene_set_bounds(asking, magnitude);
        bool covers = !is_tested || asking->x_error <= kept->x_error;
        for (int k = 0; kept->n > 0 && k < kept->ndim; k++) {
            covers = covers && asking->t_error[k] <= kept->t_error[k] &&
                     (!is_tested || asking->x_largest[k] <= kept->x_largest[k]);
        }
        status = covers ? HS_OK : HS_REBUILD;
    }
    if (status != HS_OK) {
        hs_scene_free(account, asking);
    }
    return status;
}

/* Sets lattice and radius, wraps the points, and sets the bounds. asking: NULL, or the queries'
 * scene, which is wrapped too; the bounds of `scene` hold for both. keeps_box: no box, and the
 * lattice, the bounds and the metric are set already. */
static hs_status
fill_scene(hs_account *account, hs_team *team, const hs_options *options, const far_numbers *far,
           bool keeps_box, hs_scene *scene, hs_scene *asking, hs_failure *failure)
{
    /* Without points nothing has an image, however small the box is. */
    const bool  empty = scene->n == 0 || (asking != NULL && asking->n == 0);
    hs_lattice *lattice = &scene->lattice;
    if (far->given[0] != NULL) { /* more turns than the points themselves tell */
        scene->cloud.largest = INFINITY;
        if (asking != NULL) {
            asking->cloud.largest = INFINITY;
        }
    }
    if (!keeps_box) {
        hs_lattice_init(empty ? NULL : far->box, scene->ndim, scene->scale, lattice);
    }
    for (int r = 0; far->given[0] != NULL && r < lattice->n_periodic; r++) {
        memcpy(lattice->given[r], far->given_box->rows[lattice->vector_of_row[r]],
               sizeof lattice->given[r]);
    }
    double shortest = INFINITY;
    bool   vanishes = false; /* one of the scaled periods has become zero */
    for (int k = 0; k < scene->ndim; k++) {
        if (lattice->row_of_axis[k] >= 0) {
            vanishes = vanishes || !(lattice->period[k] > 0x1p-900);
            shortest = hs_smaller(lattice->period[k], shortest);
        }
    }
    /* Whether the cutoff has more images than any memory holds. */
    const bool is_endless =
        !scene->is_ordinary &&
        hs_is_far(scene->sought, hs_exponent_of(far->size.short_row), FAR_IMAGES_EXPONENT);
    if (scene->is_kept && !empty && !is_endless &&
        (vanishes || open_drowns_box(&scene->cloud, &far->size, scene->sought))) {
        scene_put_in_one_cell(scene); /* open axes leave nothing of the box */
        vanishes = false;
        shortest = INFINITY;
    }
    scene_set_radius(scene, options, hs_scale_apply(scene->scale, scene->cloud.largest));
    if (scene->formula_error > scene->cutoff && !(scene->formula_error <= NOISE * shortest)) {
        /* It passes both the cutoff and a small part of the box: too many images might be called
         * near, and the answer is noise. */
        scene_name_farthest(scene, asking, failure);
        return HS_ERR_ROUNDING;
    }
    if (vanishes && !lattice->aligned && !is_endless) {
        return HS_ERR_BOX_SKEWED;
    }
    if (vanishes) {
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
    for (int k = 0; asking != NULL && k < scene->ndim; k++) {
        scene->x_largest[k] = hs_larger(scene->x_largest[k], asking->x_largest[k]);
    }
    if (asking != NULL) {
        join_ranges(scene->ndim, asking->lower, asking->upper, scene->lower, scene->upper);
    }
    if (scene->is_kept) {
        scene_make_room(scene, &magnitude);
    }
    if (!keeps_box) {
        scene_set_bounds(scene, magnitude);
        hs_scene_init_metric(scene, options);
    }
    for (int k = 0; scene->is_kept && k < scene->ndim; k++) {
        scene->t_error[k] *= 2.0; /* queries may be rounded to beyond another face */
    }
    return HS_OK;
}

hs_status
hs_scene_make(hs_account *account, hs_team *team, const hs_sets *sets, const hs_box *box,
              const hs_options *options, hs_scene *scene, hs_scene *asking, hs_failure *failure)
{
    const bool follows = sets->follows && scene->is_ordinary && scene->sought == options->cutoff &&
                         scene->lattice.n_periodic == 0 && box == NULL;
    far_numbers far; /* large, and seldom used: `closed` is not cleared */
    start_scene(sets->points->ndim, sets->points->n, scene);
    scene->is_kept = sets->is_kept;
    far.box = far.given_box = box;
    far.given[0] = far.given[1] = NULL;
    if (asking != NULL) {
        start_scene(sets->queries->ndim, sets->queries->n, asking);
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
    /* The range of the points reaches as far as a domain: as if queries lay at its ends. */
    for (int k = 0; status == HS_OK && sets->domain != NULL && scene->n > 0 && k < scene->ndim;
         k++) {
        const double low = sets->domain[k], high = sets->domain[scene->ndim + k];
        hs_cloud    *cloud = &scene->cloud;
        if (low <= high) {
            cloud->lower[k] = hs_smaller(low, cloud->lower[k]);
            cloud->upper[k] = hs_larger(high, cloud->upper[k]);
            cloud->largest = hs_larger(hs_larger(-low, high), cloud->largest);
        }
    }
    if (status == HS_OK && asking != NULL) { /* both clouds get the range of both */
        hs_cloud *a = &scene->cloud, *b = &asking->cloud;
        join_ranges(scene->ndim, b->lower, b->upper, a->lower, a->upper);
        join_ranges(scene->ndim, a->lower, a->upper, b->lower, b->upper);
        a->largest = b->largest = hs_larger(a->largest, b->largest);
    }
    if (status == HS_OK) {
        far.size = hs_box_size_of(box);
        const double largest = scene->cloud.largest, cutoff = options->cutoff;
        /* Searched as it was given: the cutoff is not shortened, nothing is scaled, no gap is
         * closed, and no point lies so many box vectors away that turns could not tell. */
        scene->is_ordinary = (box != NULL || cutoff <= ENOUGH_CUTOFF * largest) &&
                             cutoff >= LEAST_ORDINARY && cutoff <= MOST_ORDINARY &&
                             !(sets->within > 0.0) &&
                             hs_larger(far.size.largest, largest) <= LARGEST_ORDINARY &&
                             far.size.short_row >= SHORTEST_ORDINARY;
        scene->scale = scene->unscale = hs_scale_of(0);
        scene->sought = scene->cutoff = scene->cutoff_low = options->cutoff;
        scene->extreme = false;
    }
    if (status == HS_OK && !scene->is_ordinary) {
        status = bring_near(account, options, sets, scene, asking, &far, failure);
    }
    if (status == HS_OK) {
        status = fill_scene(account, team, options, &far, follows && scene->is_ordinary, scene,
                            asking, failure);
    }
    for (int set = 0; set < CLOSED_SETS; set++) {
        if (status == HS_OK && far.given[set] != NULL) {
            add_turns(&far, set, set == 0 ? scene : asking);
        }
        hs_free(account, far.given[set]);
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

hs_status
hs_frame_take(const hs_points *points, const hs_box *box, const hs_options *options,
              hs_frame *frame, hs_failure *failure)
{
    const size_t size = points->real == HS_FLOAT32 ? sizeof(float) : sizeof(double);
    const size_t row_size = size * (size_t)points->ndim;
    void *const  rows = hs_reserve(&frame->rows, HS_FOR_POINTS, points->n, row_size);
    if (rows == NULL) {
        frame->points.n = 0;
        return HS_ERR_MEMORY;
    }
    frame->points = (hs_points){.data = rows,
                                .n = points->n,
                                .ndim = points->ndim,
                                .real = points->real,
                                .row_stride = (ptrdiff_t)row_size,
                                .column_stride = (ptrdiff_t)size};
    frame->has_box = box != NULL;
    frame->box = box != NULL ? *box : (hs_box){.ndim = points->ndim};
    enum { TILE = 512 };
    const int64_t d = points->ndim;
    const bool    packed = (points->column_stride == (ptrdiff_t)size || d == 1) &&
                        points->row_stride == (ptrdiff_t)row_size;
    hs_range range = HS_NO_RANGE;
    for (int64_t first = 0; first < points->n; first += HS_POLL_POINTS) {
        const int64_t left = points->n - first;
        const int64_t last = first + (left < HS_POLL_POINTS ? left : HS_POLL_POINTS);
        const char   *from = (const char *)points->data + first * points->row_stride;
        char         *to = (char *)rows + (size_t)first * row_size;
        if (packed) {
            memcpy(to, from, (size_t)(last - first) * row_size);
        }
        for (int64_t i = 0; !packed && i < last - first; i++) {
            for (int k = 0; k < d; k++, to += size) {
                memcpy(to, from + i * points->row_stride + k * points->column_stride, size);
            }
        }
        if (points->real == HS_FLOAT64) {
            hs_range_widen((const double *)rows + first * d, (last - first) * d, &range);
        }
        for (int64_t e = first * d; points->real == HS_FLOAT32 && e < last * d; e += TILE) {
            double    wide[TILE];
            const int n = last * d - e < TILE ? (int)(last * d - e) : TILE;
            for (int at = 0; at < n; at++) {
                wide[at] = (double)((const float *)rows)[e + at];
            }
            hs_range_widen(wide, n, &range);
        }
        if (range.poison != 0.0) {
            return hs_points_check_finite(&frame->points, failure);
        }
        if (left > HS_POLL_POINTS && hs_poll(options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    frame->largest = hs_larger(hs_larger(-range.lower, range.upper), 0.0);
    return HS_OK;
}

bool
hs_frames_match(const hs_frame *one, const hs_frame *other)
{
    bool match = one->points.n == other->points.n && one->points.ndim == other->points.ndim &&
                 one->points.real == other->points.real;
    for (int l = 0; l < one->points.ndim; l++) {
        match = match && one->box.periodic[l] == other->box.periodic[l];
    }
    return match;
}

bool
hs_frames_share_box(const hs_frame *one, const hs_frame *other)
{
    for (int l = 0; l < one->points.ndim; l++) {
        for (int k = 0; one->box.periodic[l] && k < one->points.ndim; k++) {
            if (one->box.rows[l][k] != other->box.rows[l][k]) {
                return false;
            }
        }
    }
    return true;
}

void
hs_frame_free(hs_frame *frame)
{
    hs_free(NULL, frame->rows);
    frame->rows = NULL;
    frame->points.data = NULL;
}
