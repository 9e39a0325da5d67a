/* SPDX-License-Identifier: BSD-3-Clause */
/* scene.c: see scene.h. */
#include "scene.h"

#include "slabs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Cutoffs between 2^-20 and 2^20 are left alone: the float32 filter has room for their squares. */
#define ORDINARY_EXPONENT 20
/* Scaled coordinates stay below 2^900, so that sums of a few of them are finite. */
#define LARGEST_EXPONENT 900
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
            row_largest = hs_larger(size, row_largest);
            found.smallest = size > 0.0 ? hs_smaller(size, found.smallest) : found.smallest;
        }
        found.largest = hs_larger(row_largest, found.largest);
        if (box->periodic[l]) {
            found.short_row = hs_smaller(row_largest, found.short_row);
        }
    }
    return found;
}

/* The exponent to scale by, and whether that loses digits. asking: the other cloud, or NULL. least:
 * as hs_sets.least_cutoff. */
static int
choose_exponent(const hs_cloud *cloud, const hs_cloud *asking, const hs_box *box, double cutoff,
                double least, bool *extreme)
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
    const int largest = exponent_of(hs_larger(found.largest, cloud->largest));
    if (largest - exponent > LARGEST_EXPONENT) {
        exponent = largest - LARGEST_EXPONENT;
    }
    *extreme = false;
    if (exponent > 0) {
        double smallest = fmin(found.smallest, hs_cloud_smallest(cloud));
        smallest = asking != NULL ? fmin(smallest, hs_cloud_smallest(asking)) : smallest;
        smallest = cutoff > 0.0 ? fmin(smallest, cutoff) : smallest;
        smallest = least > 0.0 ? fmin(smallest, least) : smallest;
        *extreme = smallest != INFINITY && exponent_of(smallest) - exponent < -1022;
    }
    return exponent;
}

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
    scene->x_error = scene->extreme ? HS_SCALING_LOSS : 0.0;
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
    double            total = 2.0 * hs_scale_apply(scene->scale, scene->cloud.largest);
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
        for (int64_t i = first; scene->scale.exponent != 0 && i < last; i++) {
            x[i] = hs_scale_apply(scene->scale, x[i]);
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
        cloud->lower[k] = hs_scale_apply(scene->scale, cloud->lower[k]);
        cloud->upper[k] = hs_scale_apply(scene->scale, cloud->upper[k]);
    }
    cloud->largest = hs_scale_apply(scene->scale, cloud->largest);
    if (!allocate_beside(account, scene)) {
        return HS_ERR_MEMORY;
    }
    scene->x_is_beside = scene->keeps_originals && !scene->extreme && !scene->lattice.aligned;
    const bool copies = scene->keeps_originals && !scene->x_is_beside;
    if (copies || scene->scale.exponent != 0) {
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
wrap_points(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene,
            double *magnitude, hs_failure *failure)
{
    const hs_status status = prepare_points(account, team, options, scene);
    return status == HS_OK ? hs_scene_wrap(scene, team, options, magnitude, failure) : status;
}

/* asking: NULL, or wrapped as well, and left with the same bounds. */
static hs_status
fill_scene(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene,
           hs_scene *asking, hs_failure *failure)
{
    double magnitude = 0.0, of_asking = 0.0;
    if (box_is_vanishing(&scene->lattice)) {
        failure->expected_pairs = failure->expected_bytes = INFINITY;
        return HS_ERR_MEMORY;
    }
    hs_status status = wrap_points(account, team, options, scene, &magnitude, failure);
    if (status == HS_OK && asking != NULL) {
        status = wrap_points(account, team, options, asking, &of_asking, failure);
        failure->in_queries = status == HS_ERR_SHIFT_RANGE;
    }
    if (status != HS_OK) {
        return status;
    }
    if (asking != NULL) {
        hs_scene_join_wrapped(scene, asking);
    }
    bound_errors(scene, hs_larger(magnitude, of_asking));
    settle_ranges(scene);
    init_metric(scene, options);
    return HS_OK;
}

/* Clears what is added to or freed. The rest is large, and set before it is read. */
static void
start_scene(const hs_points *points, hs_scene *scene)
{
    scene->ndim = points->ndim;
    scene->n = points->n;
    scene->keeps_originals = scene->x_is_beside = scene->is_asked = false;
    scene->cloud.block = scene->beside = NULL;
    scene->turns = (hs_turns){.known = false};
    memset(scene->x_largest, 0, sizeof scene->x_largest);
}

/* Reads both clouds, the other one if there is one. */
static hs_status
load_clouds(hs_account *account, hs_team *team, const hs_sets *sets, const hs_options *options,
            hs_scene *scene, hs_scene *asking, hs_failure *failure)
{
    hs_status status =
        hs_cloud_load(account, team, sets->points, options, &scene->cloud, failure);
    if (status == HS_OK && asking != NULL) {
        status = hs_cloud_load(account, team, sets->queries, options, &asking->cloud, failure);
        failure->in_queries = status != HS_OK;
    }
    if (status == HS_OK && asking != NULL) {
        hs_scene_join_clouds(scene, asking);
    }
    return status;
}

/* Scale, cutoff and lattice. */
static void
settle_unit(const hs_sets *sets, const hs_box *box, const hs_options *options, hs_scene *scene,
            const hs_scene *asking)
{
    const int exponent = choose_exponent(&scene->cloud, asking != NULL ? &asking->cloud : NULL,
                                         box, options->cutoff, sets->least_cutoff,
                                         &scene->extreme);
    scene->scale = hs_scale_of(exponent);
    scene->unscale = hs_scale_of(-scene->scale.exponent);
    scene->cutoff = hs_scale_apply(scene->scale, options->cutoff);
    scene->cutoff_low = scene->cutoff;
    if (scene->extreme && options->cutoff > 0.0) {
        /* The scaled cutoff may have been rounded or flushed: take bounds. */
        scene->cutoff_low -= HS_SCALING_LOSS;
        scene->cutoff += HS_SCALING_LOSS;
    }
    /* Without points nothing has an image, however small the box is. */
    const bool empty = scene->n == 0 || (asking != NULL && asking->n == 0);
    hs_lattice_init(empty ? NULL : box, scene->ndim, scene->scale, &scene->lattice);
    scene->formula_error =
        options->precision == HS_DOUBLE ? bound_formula(scene) : 0.0;
    scene->radius = scene->cutoff + scene->formula_error;
}

hs_status
hs_scene_init_sets(hs_account *account, hs_team *team, const hs_sets *sets, const hs_box *box,
                   const hs_options *options, hs_scene *scene, hs_scene *asking,
                   hs_failure *failure)
{
    start_scene(sets->points, scene);
    if (asking != NULL) {
        start_scene(sets->queries, asking);
    }
    if (!(options->cutoff >= 0.0) || !isfinite(options->cutoff)) {
        failure->value = options->cutoff;
        return HS_ERR_CUTOFF;
    }
    hs_status status = hs_box_check(box, failure);
    if (status == HS_OK) {
        status = load_clouds(account, team, sets, options, scene, asking, failure);
    }
    if (status == HS_OK) {
        settle_unit(sets, box, options, scene, asking);
        if (asking != NULL) {
            hs_scene_share(scene, asking);
        }
        status = fill_scene(account, team, options, scene, asking, failure);
    }
    if (status != HS_OK) {
        hs_scene_free(account, scene);
        if (asking != NULL) {
            hs_scene_free(account, asking);
        }
    }
    return status;
}

hs_status
hs_scene_init(hs_account *account, hs_team *team, const hs_points *points, const hs_box *box,
              const hs_options *options, hs_scene *scene, hs_failure *failure)
{
    const hs_sets alone = {.points = points};
    return hs_scene_init_sets(account, team, &alone, box, options, scene, NULL, failure);
}

void
hs_scene_free(hs_account *account, hs_scene *scene)
{
    hs_cloud_free(account, &scene->cloud);
    hs_free(account, scene->beside);
    scene->beside = NULL;
}
