/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_images.c: which images of the points can be near a group, by the range of its t_k along
 * each periodic axis. */
#include "nearest.h"

#include <math.h>
#include <string.h>

#define UNIT 0x1p-53
/* In periods: far more than the rounding of a quotient of ordinary size, ... */
#define SLACK 0x1p-20
/* ... and of the quotient itself where it is large. */
#define RELATIVE_SLACK 0x1p-40
/* Products of unit vectors at right angles, and the room that this takes beside squares. */
#define UPRIGHT     0x1p-40
#define LAYER_ROOM  0x1p-36
#define MOST_SHIFTS 0x1p30 /* they are int32, with room for sums of two */
/* More images than these take minutes: they are refused, unless k is so large that all neighbours
 * may be images of one point. A box around a ball in 8 dimensions is 63 times as large. */
#define MOST_IMAGES        0x1p24
#define IMAGES_A_NEIGHBOUR 1024.0

void
hs_nearest_measure_drift(hs_nearest *near)
{
    const hs_lattice *lattice = &near->search->scene.lattice;
    const int         d = lattice->ndim;
    near->smallest_period = INFINITY;
    for (int k = 0; k < d; k++) {
        if (lattice->row_of_axis[k] >= 0) {
            near->smallest_period = hs_smaller(lattice->period[k], near->smallest_period);
        }
        for (int r = 0; r < lattice->n_periodic; r++) {
            double along = 0.0, largest = 0.0;
            for (int c = 0; !lattice->aligned && c < d; c++) {
                along += lattice->normal[k][c] * lattice->rows[r][c];
                largest = hs_larger(fabs(lattice->rows[r][c]), largest);
            }
            if (!lattice->aligned && lattice->row_of_axis[k] == r) {
                along -= lattice->period[k];
            }
            near->drift[k][r] = lattice->aligned ? 0.0
                                                 : fabs(along) + (d + 2) * d * UNIT * largest +
                                                       d * lattice->row_error[r];
        }
    }
}

/* Whether unit normals of axes that repeat are at right angles to those of open ones, as nearly as
 * rounding lets them. */
static bool
is_upright(const hs_lattice *lattice)
{
    for (int k = 0; k < lattice->ndim; k++) {
        for (int open = 0; !lattice->aligned && open < lattice->ndim; open++) {
            double product = 0.0;
            for (int c = 0; c < lattice->ndim; c++) {
                product += lattice->normal[k][c] * lattice->normal[open][c];
            }
            if (lattice->row_of_axis[k] >= 0 && lattice->row_of_axis[open] < 0 &&
                fabs(product) > UPRIGHT) {
                return false;
            }
        }
    }
    return lattice->n_periodic > 0 && lattice->n_periodic < lattice->ndim;
}

void
hs_nearest_measure_layer(hs_nearest *near)
{
    const hs_lattice *lattice = &near->search->scene.lattice;
    const hs_bins    *bins = &near->search->bins;
    near->has_layer = bins->n > 0 && is_upright(lattice);
    for (int k = 0; near->has_layer && k < lattice->ndim; k++) {
        double low = INFINITY, high = -INFINITY;
        for (int64_t si = 0; lattice->row_of_axis[k] < 0 && si < bins->n; si++) {
            double x[HS_MAX_DIM];
            for (int c = 0; c < bins->ndim; c++) {
                x[c] = bins->x[c][si];
            }
            const double t = hs_lattice_coordinate(lattice, x, k);
            low = hs_smaller(t, low);
            high = hs_larger(t, high);
        }
        near->layer_lower[k] = low;
        near->layer_upper[k] = high;
    }
}

/* How far the group looks along axes that repeat: what the distance to the layer leaves of the
 * radius. */
static double
reach_along(const hs_nearest_group *group)
{
    const double ratio = hs_smaller(group->away / group->radius, 1.0); /* squares overflow */
    return group->radius * (sqrt((1.0 - ratio) * (1.0 + ratio) + LAYER_ROOM) + UPRIGHT);
}

/* Shifts along the row of B of axis k, at most most[r] of them; false when too many. */
static bool
set_range(const hs_nearest *near, const hs_nearest_group *group, int k, const double *most,
          hs_nearest_images *images)
{
    const hs_scene   *scene = &near->search->scene;
    const hs_lattice *lattice = &scene->lattice;
    const double      period = lattice->period[k];
    double            reach = reach_along(group) * (1.0 + RELATIVE_SLACK) + 2.0 * scene->t_error[k];
    for (int r = 0; r < lattice->n_periodic; r++) {
        reach += (most[r] + 1.0) * near->drift[k][r];
    }
    const double low = (group->t_lower[k] - scene->upper[k] - reach) / period;
    const double high = (group->t_upper[k] - scene->lower[k] + reach) / period;
    const double first = ceil(low - SLACK - RELATIVE_SLACK * fabs(low));
    const double last = floor(high + SLACK + RELATIVE_SLACK * fabs(high));
    if (!(fabs(first) < MOST_SHIFTS && fabs(last) < MOST_SHIFTS)) {
        return false;
    }
    const int row = lattice->row_of_axis[k];
    images->low[row] = (int64_t)first;
    images->high[row] = (int64_t)last;
    return true;
}

/* Bound on the error of X_j + moved, by the rule of docs/exactness.md for gathered candidates. */
static double
bound_error(const hs_scene *scene, const double *most)
{
    const hs_lattice *lattice = &scene->lattice;
    double            error = 0.0;
    for (int c = 0; c < scene->ndim; c++) {
        double moved = 0.0, row_errors = 0.0;
        for (int r = 0; r < lattice->n_periodic; r++) {
            moved += most[r] * fabs(lattice->rows[r][c]);
            row_errors += most[r] * lattice->row_error[r];
        }
        if (moved > 0.0) {
            const double roundings = 2 * lattice->n_periodic + 4;
            error = hs_larger(roundings * UNIT * (moved + 2.0 * scene->x_largest[c]) + row_errors,
                              error);
        }
    }
    return error + 2.0 * scene->x_error;
}

hs_status
hs_nearest_images_start(const hs_nearest *near, const hs_nearest_group *group,
                        hs_nearest_images *images)
{
    const hs_lattice *lattice = &near->search->scene.lattice;
    double            most[HS_MAX_DIM] = {0.0};
    *images = (hs_nearest_images){.near = near, .count = 1.0, .is_first = true};
    /* The drift depends on the largest shifts, and these a little on the drift. */
    for (int pass = 0; pass < 3; pass++) {
        for (int k = 0; k < lattice->ndim; k++) {
            if (lattice->row_of_axis[k] >= 0 && !set_range(near, group, k, most, images)) {
                return HS_ERR_MEMORY;
            }
        }
        for (int r = 0; r < lattice->n_periodic; r++) {
            most[r] = hs_larger(fabs((double)images->low[r]), fabs((double)images->high[r]));
        }
        pass += lattice->aligned ? 2 : 0;
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        images->shift[r] = (int32_t)images->low[r];
        images->count *= hs_larger((double)(images->high[r] - images->low[r] + 1), 0.0);
    }
    images->error = bound_error(&near->search->scene, most);
    return images->count < fmax(MOST_IMAGES, IMAGES_A_NEIGHBOUR * (double)near->k) ? HS_OK
                                                                                   : HS_ERR_MEMORY;
}

bool
hs_nearest_images_next(hs_nearest_images *images)
{
    const hs_lattice *lattice = &images->near->search->scene.lattice;
    const int         m = lattice->n_periodic;
    if (images->is_first) {
        images->is_first = false;
        if (images->count == 0.0) {
            return false;
        }
    } else {
        int r = 0;
        while (r < m && images->shift[r] == images->high[r]) {
            images->shift[r] = (int32_t)images->low[r];
            r++;
        }
        if (r == m) {
            return false;
        }
        images->shift[r]++;
    }
    for (int c = 0; c < lattice->ndim; c++) {
        double moved = 0.0;
        for (int r = 0; r < m; r++) {
            moved += images->shift[r] * lattice->rows[r][c];
        }
        images->moved[c] = moved;
    }
    return true;
}

void
hs_nearest_image_set(const hs_nearest *near, const hs_nearest_images *images,
                     hs_nearest_image *image)
{
    memcpy(image->shift, images->shift, sizeof image->shift);
    memcpy(image->moved, images->moved, sizeof image->moved);
    image->is_home = true;
    for (int r = 0; r < near->search->bins.n_periodic; r++) {
        image->is_home = image->is_home && image->shift[r] == 0;
    }
}
