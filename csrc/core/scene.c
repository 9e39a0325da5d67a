/* SPDX-License-Identifier: BSD-3-Clause */
/* scene.c: see scene.h. */
#include "scene.h"

#include "condense.h"
#include "scale.h"
#include "slabs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* More than any digit that scaling can lose times any number of turns: 2^-1074 * 2^51 < 2^-1000. */
#define SCALING_LOSS 0x1p-1000
/* Error of precision="double", in heights of the box, up to which candidates are few. */
#define NOISE 0x1p-6
#define UNIT 0x1p-53 /* unit roundoff of float64 */

/* Range of the grid coordinates: the points' own where open, one period where periodic. */
static void
settle_ranges(hs_scene *scene)
{
    for (int k = 0; k < scene->ndim; k++) {
        if (scene->lattice.row_of_axis[k] >= 0) {
            const double half = 0.5 * scene->lattice.period[k];
            /* Points that rounding left outside are binned on the face: an error of t. */
            scene->t_error[k] += hs_larger(
                hs_larger(scene->upper[k] - half, -half - scene->lower[k]), 0.0);
            scene->lower[k] = -half;
            scene->upper[k] = half;
        }
    }
}

static void
bound_errors(hs_scene *scene, double magnitude)
{
    const hs_lattice *lattice = &scene->lattice;
    double            largest = 0.0;
    for (int k = 0; k < scene->ndim; k++) {
        largest = hs_larger(scene->x_largest[k], largest);
    }
    scene->x_error = scene->extreme ? SCALING_LOSS : 0.0;
    if (!lattice->aligned) {
        const double terms = 2 * lattice->n_periodic + 2;
        scene->x_error += 2.0 * UNIT * largest + terms * terms * 0x1p-104 * magnitude;
    }
    for (int k = 0; k < scene->ndim; k++) {
        /* |normal| is 1 to rounding, so the error of a dot product is at most sqrt(d) x_error, plus
         * its own rounding. */
        scene->t_error[k] = lattice->aligned
                                ? scene->x_error
                                : 3.0 * scene->x_error + 4.0 * (scene->ndim + 2) * UNIT * largest;
    }
}

/*
 * precision="double" computes D in float64 from the points as given: each of its m + 2 terms is
 * rounded to within 2^-53 of the largest partial sum. Candidates must be sought that much further
 * out.
 */
static double
bound_formula(const hs_scene *scene)
{
    const hs_lattice *lattice = &scene->lattice;
    double            total = 2.0 * hs_scale_apply(scene->pending, scene->cloud.largest);
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

/* The first of the points that are farthest from zero along some axis. */
static int64_t
farthest_point(const hs_cloud *cloud)
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
    return farthest;
}

/* Whether the formula's error passes both the cutoff and a small part of the box: then the images
 * that it might call near are too many to try, and its answer is noise. */
static bool
is_drowned(const hs_scene *scene)
{
    double shortest = INFINITY;
    for (int k = 0; k < scene->ndim; k++) {
        if (scene->lattice.row_of_axis[k] >= 0) {
            shortest = hs_smaller(scene->lattice.period[k], shortest);
        }
    }
    return scene->formula_error > scene->cutoff && !(scene->formula_error <= NOISE * shortest);
}

/* What decides: X and B where they hold every digit, else the points and rows as given. */
static void
init_metric(hs_scene *scene, const hs_options *options)
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

/* Columns for the originals and the turns, as far as these are kept, in this order. */
static bool
allocate_beside(hs_account *account, hs_scene *scene)
{
    const int     m = scene->turns.known ? scene->lattice.n_periodic : 0;
    const int     d = scene->keeps_originals ? scene->ndim : 0;
    const bool    narrow = hs_fold_turns(&scene->lattice, scene->cloud.largest) < INT32_MAX;
    const int64_t pitch = hs_column_pitch(scene->n, sizeof(double)) * (int64_t)sizeof(double);
    const int64_t turns_pitch =
        narrow ? hs_column_pitch(scene->n, sizeof(int32_t)) * (int64_t)sizeof(int32_t) : pitch;
    if (d + m == 0) {
        return true;
    }
    scene->beside = hs_alloc(account, HS_FOR_ORIGINALS,
                             d * pitch + m * turns_pitch + HS_COLUMN_PADDING, 1);
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

typedef struct scaling {
    hs_scene *scene;
    bool      copies;        /* to the originals ... */
    bool      copies_scaled; /* ... what has been scaled already */
} scaling;

/* Scales points [first, last), and copies them before or after that. */
static hs_status
scale_slab(void *context, int slab, int64_t first, int64_t last)
{
    const scaling *doing = context;
    hs_scene      *scene = doing->scene;
    const size_t   n_bytes = (size_t)(last - first) * sizeof(double);
    (void)slab;
    for (int k = 0; k < scene->ndim; k++) {
        double *x = scene->cloud.x[k];
        if (doing->copies && !doing->copies_scaled) {
            memcpy(scene->originals[k] + first, x + first, n_bytes);
        }
        for (int64_t i = first; scene->pending.exponent != 0 && i < last; i++) {
            x[i] = hs_scale_apply(scene->pending, x[i]);
        }
        if (doing->copies && doing->copies_scaled) {
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
    for (int k = 0; k < scene->ndim; k++) {
        cloud->lower[k] = hs_scale_apply(scene->pending, cloud->lower[k]);
        cloud->upper[k] = hs_scale_apply(scene->pending, cloud->upper[k]);
    }
    cloud->largest = hs_scale_apply(scene->pending, cloud->largest);
    if (!allocate_beside(account, scene)) {
        return HS_ERR_MEMORY;
    }
    scene->x_is_beside = scene->keeps_originals && !scene->extreme && !scene->lattice.aligned;
    const bool copies = scene->keeps_originals && !scene->x_is_beside;
    if (copies || scene->pending.exponent != 0) {
        scaling          doing = {scene, copies, !scene->extreme};
        const hs_options silent = {.poll = NULL}; /* a copy of what was asked about already */
        (void)hs_walk_slabs(team, &silent, scene->n, scale_slab, &doing);
    }
    for (int k = 0; scene->x_is_beside && k < scene->ndim; k++) {
        double *beside = scene->originals[k]; /* wrapping moves the points there */
        scene->originals[k] = cloud->x[k];
        cloud->x[k] = beside;
    }
    return HS_OK;
}

/* A period that scaling brought to nothing: more images than any memory holds. */
static bool
box_is_vanishing(const hs_lattice *lattice)
{
    for (int k = 0; k < lattice->ndim; k++) {
        if (lattice->row_of_axis[k] >= 0 && !(lattice->period[k] > 0x1p-900)) {
            return true;
        }
    }
    return false;
}

static hs_status
fill_scene(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene,
           hs_failure *failure)
{
    double magnitude = 0.0;
    if (box_is_vanishing(&scene->lattice)) {
        failure->expected_pairs = failure->expected_bytes = INFINITY;
        return HS_ERR_MEMORY;
    }
    hs_status status = prepare_points(account, team, options, scene);
    if (status == HS_OK) {
        status = hs_scene_wrap(scene, team, options, &magnitude, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    bound_errors(scene, magnitude);
    settle_ranges(scene);
    init_metric(scene, options);
    return HS_OK;
}

/* Of points, lengths and the cutoff. */
static void
set_scale(const hs_condensed *condensed, int unit, hs_scene *scene)
{
    const hs_box_size size = hs_box_size_of(condensed->box);
    int               exponent = unit;
    scene->extreme = false;
    if (!condensed->is_scaled) {
        exponent =
            hs_choose_exponent(&scene->cloud, &size, scene->sought, unit, &scene->extreme);
    }
    scene->scale = hs_scale_of(exponent);
    scene->unscale = hs_scale_of(-exponent);
    scene->pending = condensed->is_scaled ? hs_scale_of(0) : scene->scale;
    scene->cutoff = scene->cutoff_low = hs_scale_apply(scene->scale, scene->sought);
    if (scene->extreme && scene->sought > 0.0) {
        /* The scaled cutoff may have been rounded or flushed: take bounds. */
        scene->cutoff_low -= SCALING_LOSS;
        scene->cutoff += SCALING_LOSS;
    }
}

/* The turns that condensing made, added to those that wrapping made after it. */
static void
add_turns(const hs_condensed *condensed, hs_scene *scene)
{
    for (int k = 0; condensed->has_turns && k < scene->ndim; k++) {
        const int64_t *more = condensed->turns[k];
        const int      row = scene->lattice.row_of_axis[k];
        for (int64_t i = 0; more != NULL && i < scene->n; i++) {
            hs_turns_set(&scene->turns, row, i, hs_turns_get(&scene->turns, row, i) + more[i]);
        }
    }
}

/* Chooses the scale of a scene whose points are as given, and fills it. */
static hs_status
scale_scene(hs_account *account, hs_team *team, const hs_options *options, const hs_box *box,
            hs_scene *scene, hs_failure *failure)
{
    hs_condensed      condensed;
    hs_cloud         *cloud = &scene->cloud;
    const hs_box_size size = hs_box_size_of(box);
    scene->sought = hs_enough_cutoff(cloud, &size, options->cutoff);
    const int unit = hs_unit_exponent(cloud, &size, scene->sought);
    hs_status status = hs_condense(account, options, box, unit, cloud, &condensed, failure);
    if (status == HS_OK) {
        set_scale(&condensed, unit, scene);
        if (condensed.has_turns) { /* more than the points themselves tell */
            cloud->largest = INFINITY;
        }
        /* Without points nothing has an image, however small the box is. */
        hs_lattice_init(scene->n > 0 ? condensed.box : NULL, scene->ndim, scene->pending,
                        &scene->lattice);
        scene->formula_error = options->precision == HS_DOUBLE ? bound_formula(scene) : 0.0;
        scene->radius = scene->cutoff + scene->formula_error;
        if (is_drowned(scene)) {
            failure->row = farthest_point(cloud);
            status = HS_ERR_ROUNDING;
        } else {
            status = fill_scene(account, team, options, scene, failure);
        }
    }
    if (status == HS_OK) {
        add_turns(&condensed, scene);
    }
    hs_condensed_free(account, &condensed);
    return status;
}

/* Clears what is added to or freed. The rest is large, and set before it is read. */
static void
start_scene(const hs_points *points, hs_scene *scene)
{
    scene->ndim = points->ndim;
    scene->n = points->n;
    scene->keeps_originals = scene->x_is_beside = false;
    scene->cloud.block = scene->beside = NULL;
    scene->turns = (hs_turns){.known = false};
    memset(scene->x_largest, 0, sizeof scene->x_largest);
}

hs_status
hs_scene_init(hs_account *account, hs_team *team, const hs_points *points, const hs_box *box,
              const hs_options *options, hs_scene *scene, hs_failure *failure)
{
    start_scene(points, scene);
    if (!(options->cutoff >= 0.0) || !isfinite(options->cutoff)) {
        failure->value = options->cutoff;
        return HS_ERR_CUTOFF;
    }
    hs_status status = hs_box_check(box, failure);
    if (status == HS_OK) {
        status = hs_cloud_load(account, team, points, options, &scene->cloud, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    status = scale_scene(account, team, options, box, scene, failure);
    if (status != HS_OK) {
        hs_scene_free(account, scene);
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
