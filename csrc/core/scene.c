/* SPDX-License-Identifier: BSD-3-Clause */
/* scene.c: see scene.h. */
#include "scene.h"

#include "poll.h"
#include "wrap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Cutoffs between 2^-20 and 2^20 are left alone: the float32 filter has room for their squares. */
#define ORDINARY_EXPONENT 20
/* Scaled coordinates stay below 2^900, so that sums of a few of them are finite. */
#define LARGEST_EXPONENT 900
/* More than any digit that scaling can lose times any number of turns: 2^-1074 * 2^51 < 2^-1000. */
#define SCALING_LOSS 0x1p-1000
#define UNIT 0x1p-53 /* unit roundoff of float64 */

/* x = m 2^e with 1 <= m < 2: e; for 0 the smallest int there is. */
static int
exponent_of(double x)
{
    return x == 0.0 ? INT32_MIN / 2 : ilogb(x);
}

/* Sizes of the periodic box entries. */
typedef struct magnitudes {
    double largest;
    double smallest;  /* not counting zeros */
    double short_row; /* the least of the rows' largest entries; infinity without rows */
} magnitudes;

static magnitudes
box_magnitudes(const hs_box *box)
{
    magnitudes found = {0.0, INFINITY, INFINITY};
    for (int l = 0; box != NULL && l < box->ndim; l++) {
        double row_largest = 0.0;
        for (int k = 0; box->periodic[l] && k < box->ndim; k++) {
            const double size = fabs(box->rows[l][k]);
            row_largest = fmax(row_largest, size);
            found.smallest = size > 0.0 ? fmin(found.smallest, size) : found.smallest;
        }
        found.largest = fmax(found.largest, row_largest);
        found.short_row = box->periodic[l] ? fmin(found.short_row, row_largest) : found.short_row;
    }
    return found;
}

/* The exponent to scale by, and whether that loses digits. */
static int
choose_exponent(const hs_cloud *cloud, const hs_box *box, double cutoff, bool *extreme)
{
    const magnitudes found = box_magnitudes(box);
    /* With cutoff 0 the scene has another length to go by: its box, or where its points are. */
    const double unit = cutoff > 0.0                   ? cutoff
                        : found.short_row != INFINITY ? found.short_row
                                                      : cloud->largest;
    int exponent = exponent_of(unit);
    if (unit == 0.0 || abs(exponent) <= ORDINARY_EXPONENT) {
        exponent = 0;
    }
    const int largest = exponent_of(fmax(found.largest, cloud->largest));
    if (largest - exponent > LARGEST_EXPONENT) {
        exponent = largest - LARGEST_EXPONENT;
    }
    *extreme = false;
    if (exponent > 0) {
        double smallest = fmin(found.smallest, hs_cloud_smallest(cloud));
        smallest = cutoff > 0.0 ? fmin(smallest, cutoff) : smallest;
        *extreme = smallest != INFINITY && exponent_of(smallest) - exponent < -1022;
    }
    return exponent;
}

static hs_status
wrap_aligned(hs_scene *scene, const hs_options *options, hs_failure *failure)
{
    const hs_lattice *lattice = &scene->lattice;
    for (int64_t i = 0; i < scene->n; i++) {
        double *x = scene->x + i * scene->ndim;
        for (int k = 0; k < scene->ndim; k++) {
            const int row = lattice->row_of_axis[k];
            if (row >= 0) {
                int64_t turns;
                x[k] = hs_wrap_axis(x[k], lattice->period[k], &turns);
                if (scene->turns != NULL) {
                    if (turns == HS_WRAP_UNKNOWN) {
                        failure->row = i;
                        return HS_ERR_SHIFT_RANGE;
                    }
                    scene->turns[i * lattice->n_periodic + row] = turns;
                }
            }
            scene->x_largest[k] = fmax(scene->x_largest[k], fabs(x[k]));
        }
        if (hs_poll_points(options, i + 1) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

static hs_status
wrap_general(hs_scene *scene, const hs_options *options, double *magnitude, hs_failure *failure)
{
    const int m = scene->lattice.n_periodic;
    for (int64_t i = 0; i < scene->n; i++) {
        double *x = scene->x + i * scene->ndim;
        double  inside[HS_MAX_DIM];
        if (!hs_wrap_point(&scene->lattice, x, inside, scene->turns + i * m, magnitude)) {
            failure->row = i;
            return HS_ERR_SHIFT_RANGE;
        }
        for (int k = 0; k < scene->ndim; k++) {
            x[k] = inside[k];
            scene->x_largest[k] = fmax(scene->x_largest[k], fabs(x[k]));
        }
        if (hs_poll_points(options, i + 1) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

/* Range of the grid coordinates: the points' own where open, one period where periodic. */
static void
find_ranges(hs_scene *scene)
{
    for (int k = 0; k < scene->ndim; k++) {
        double lower = INFINITY, upper = -INFINITY;
        if (scene->lattice.aligned && scene->lattice.row_of_axis[k] >= 0) {
            lower = upper = 0.0;
        } else {
            for (int64_t i = 0; i < scene->n; i++) {
                const double *x = scene->x + i * scene->ndim;
                const double  t = hs_lattice_coordinate(&scene->lattice, x, k);
                lower = t < lower ? t : lower;
                upper = t > upper ? t : upper;
            }
        }
        if (scene->n == 0) {
            lower = upper = 0.0;
        }
        if (scene->lattice.row_of_axis[k] >= 0) {
            const double half = 0.5 * scene->lattice.period[k];
            /* Points that rounding left outside are binned on the face: an error of t. */
            scene->t_error[k] += fmax(0.0, fmax(upper - half, -half - lower));
            lower = -half;
            upper = half;
        }
        scene->lower[k] = lower;
        scene->upper[k] = upper;
    }
}

static void
bound_errors(hs_scene *scene, double magnitude)
{
    const hs_lattice *lattice = &scene->lattice;
    double            largest = 0.0;
    for (int k = 0; k < scene->ndim; k++) {
        largest = fmax(largest, scene->x_largest[k]);
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
bound_formula(const hs_scene *scene, const hs_cloud *cloud)
{
    const hs_lattice *lattice = &scene->lattice;
    double            total = 2.0 * hs_scale_apply(scene->scale, cloud->largest);
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

/* What decides: X and B where they hold every digit, else the points and rows as given. */
static void
init_metric(hs_scene *scene, const hs_options *options)
{
    const hs_lattice *lattice = &scene->lattice;
    const double(*rows)[HS_MAX_DIM] = (const double(*)[HS_MAX_DIM])lattice->rows;
    double cutoff = hs_scale_apply(scene->scale, options->cutoff);
    if (scene->extreme) {
        rows = (const double(*)[HS_MAX_DIM])lattice->given;
        cutoff = options->cutoff;
    } else if (scene->originals != NULL) {
        rows = (const double(*)[HS_MAX_DIM])lattice->scaled;
    }
    hs_metric_init(&scene->metric, scene->ndim, lattice->n_periodic, rows, cutoff,
                   options->inclusive);
}

/* The search's copy takes over the loaded one; the originals are kept beside it only if needed. */
static hs_status
take_points(hs_account *account, hs_cloud *cloud, const hs_options *options, hs_scene *scene)
{
    const int     m = scene->lattice.n_periodic;
    const int64_t n_entries = cloud->n * cloud->ndim;
    const bool    keeps_originals =
        scene->extreme ||
        (m > 0 && (!scene->lattice.aligned || options->precision == HS_DOUBLE));
    const size_t n_bytes = (size_t)n_entries * sizeof(double);
    scene->x = cloud->x;
    cloud->x = NULL;
    if (keeps_originals) {
        scene->originals = hs_alloc(account, HS_FOR_ORIGINALS, n_entries, sizeof(double));
        if (scene->originals == NULL) {
            return HS_ERR_MEMORY;
        }
        memcpy(scene->originals, scene->x, n_bytes);
    }
    if (scene->scale.exponent != 0) {
        for (int64_t e = 0; e < n_entries; e++) {
            scene->x[e] = hs_scale_apply(scene->scale, scene->x[e]);
        }
        if (keeps_originals && !scene->extreme) {
            memcpy(scene->originals, scene->x, n_bytes);
        }
    }
    if (m > 0 && (keeps_originals || (options->want & HS_WANT_SHIFT))) {
        scene->turns = hs_alloc(account, HS_FOR_WRAPS, cloud->n * m, sizeof(int64_t));
        if (scene->turns == NULL) {
            return HS_ERR_MEMORY;
        }
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
fill_scene(hs_account *account, hs_cloud *cloud, const hs_options *options, hs_scene *scene,
           hs_failure *failure)
{
    double magnitude = 0.0;
    if (box_is_vanishing(&scene->lattice)) {
        failure->expected_pairs = failure->expected_bytes = INFINITY;
        return HS_ERR_MEMORY;
    }
    hs_status status = take_points(account, cloud, options, scene);
    if (status == HS_OK) {
        status = scene->lattice.aligned ? wrap_aligned(scene, options, failure)
                                        : wrap_general(scene, options, &magnitude, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    bound_errors(scene, magnitude);
    find_ranges(scene);
    init_metric(scene, options);
    return HS_OK;
}

hs_status
hs_scene_init(hs_account *account, const hs_points *points, const hs_box *box,
              const hs_options *options, hs_scene *scene, hs_failure *failure)
{
    hs_cloud cloud;
    *scene = (hs_scene){.ndim = points->ndim, .n = points->n};
    if (!(options->cutoff >= 0.0) || !isfinite(options->cutoff)) {
        failure->value = options->cutoff;
        return HS_ERR_CUTOFF;
    }
    hs_status status = hs_box_check(box, failure);
    if (status == HS_OK) {
        status = hs_cloud_load(account, points, options, &cloud, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    scene->scale = hs_scale_of(choose_exponent(&cloud, box, options->cutoff, &scene->extreme));
    scene->unscale = hs_scale_of(-scene->scale.exponent);
    scene->cutoff = hs_scale_apply(scene->scale, options->cutoff);
    scene->cutoff_low = scene->cutoff;
    if (scene->extreme && options->cutoff > 0.0) {
        /* The scaled cutoff may have been rounded or flushed: take bounds. */
        scene->cutoff_low -= SCALING_LOSS;
        scene->cutoff += SCALING_LOSS;
    }
    /* Without points nothing has an image, however small the box is. */
    hs_lattice_init(points->n > 0 ? box : NULL, points->ndim, scene->scale, &scene->lattice);
    scene->formula_error =
        options->precision == HS_DOUBLE ? bound_formula(scene, &cloud) : 0.0;
    scene->radius = scene->cutoff + scene->formula_error;
    status = fill_scene(account, &cloud, options, scene, failure);
    hs_cloud_free(account, &cloud);
    if (status != HS_OK) {
        hs_scene_free(account, scene);
    }
    return status;
}

void
hs_scene_free(hs_account *account, hs_scene *scene)
{
    hs_free(account, scene->x);
    hs_free(account, scene->originals);
    hs_free(account, scene->turns);
    scene->x = NULL;
    scene->originals = NULL;
    scene->turns = NULL;
}
