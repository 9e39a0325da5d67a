/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * verlet.c: Verlet lists, boxes and measured pairs: the functions of halfshell.h that search
 * nothing themselves.
 */
#include "../verlet/pair_list.h"
#include "query.h"
#include "../box/lattice.h"
#include "../memory/memory.h"
#include "../exact/arithmetic.h"
#include "../../halfshell.h"
#include "../scene/points.h"
#include "../scene/scene.h"
#include "../threads/call.h"
#include "../box/wrap.h"
#include "../collect/components.h"

#include <math.h>
#include <string.h>

/* The public functions of a list that is used for many steps; docs/verlet.md. */

hs_verlet *
hs_verlet_new(void)
{
    hs_verlet *list = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *list);
    if (list != NULL) {
        memset(list, 0, sizeof *list);
        list->jumps_now = -1;
        list->frames[0].points.ndim = 1;
    }
    return list;
}

void
hs_verlet_free(hs_verlet *list)
{
    if (list == NULL) {
        return;
    }
    hs_listing_free(&list->listing);
    for (int f = 0; f < 3; f++) {
        hs_frame_free(&list->frames[f]);
    }
    hs_store_free(&list->jumps[0]);
    hs_store_free(&list->jumps[1]);
    hs_free(NULL, list);
}

hs_verlet_state
hs_verlet_look(const hs_verlet *list)
{
    if (list == NULL) {
        return (hs_verlet_state){.has_list = false};
    }
    return (hs_verlet_state){.has_list = list->has_list,
                             .ndim = list->frames[list->now].points.ndim,
                             .n_points = list->frames[list->now].points.n,
                             .n_listed = list->listing.n_pairs,
                             .cutoff = list->cutoff,
                             .radius = list->listing.radius,
                             .margin = list->margin,
                             .tried = list->tried};
}

static bool
is_length(double x)
{
    return x >= 0.0 && isfinite(x);
}

/* Points and a box, and then the coordinates, which are the caller's to free. */
static hs_status
load(const hs_points *points, const hs_box *box, const hs_options *options, hs_cloud *cloud,
     hs_failure *failure)
{
    hs_status status = hs_check_arguments(points, NULL, box, options, failure);
    if (status == HS_OK) {
        status = hs_box_check(box, failure);
    }
    return status == HS_OK ? hs_cloud_load(NULL, NULL, points, options, cloud, failure) : status;
}

hs_status
hs_verlet_update(hs_verlet *list, const hs_points *points, const hs_box *box,
                 const hs_options *options, double skin, bool rebuild, bool *rebuilt,
                 hs_failure *failure)
{
    const hs_options plain = hs_options_default(); /* what is wanted is not looked at here */
    hs_entry         entry;
    double           margin = -INFINITY;
    int              next = 0; /* the frame that is not in use */
    if (list == NULL || options == NULL || rebuilt == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, NULL, failure);
    }
    while (next == list->built || next == list->now) {
        next++;
    }
    failure = hs_enter(failure, &entry);
    hs_status status = hs_check_resources(options);
    if (!is_length(options->cutoff)) {
        failure->value = options->cutoff;
        status = HS_ERR_CUTOFF;
    }
    if (status == HS_OK) {
        status = hs_check_arguments(points, NULL, box, &plain, failure);
    }
    if (status == HS_OK) {
        status = hs_box_check(box, failure);
    }
    if (status == HS_OK) {
        status = hs_frame_take(points, box, options, &list->frames[next], failure);
    }
    const hs_motion motion = {.built = &list->frames[list->built],
                              .now = &list->frames[next],
                              .radius = list->listing.radius,
                              .cutoff = list->cutoff};
    const int       spare = list->jumps_now == 0 ? 1 : 0;
    bool            jumped = false;
    if (status == HS_OK && !rebuild && list->has_list && options->cutoff == list->cutoff &&
        hs_frames_match(motion.built, motion.now)) {
        status = hs_motion_margin(&motion, options, &margin, &jumped, &list->jumps[spare]);
    }
    const bool needed = status == HS_OK && !(margin >= 0.0);
    if (needed) {
        const hs_dw  sum = hs_two_sum(options->cutoff, skin);
        const double radius = sum.lo > 0.0 ? hs_next_up(sum.hi) : sum.hi; /* rounded up */
        const double room = radius - options->cutoff;
        if (is_length(skin) && is_length(radius)) {
            status = hs_listing_build(motion.now, options, radius, &list->listing, failure);
        } else {
            failure->value = radius;
            status = HS_ERR_CUTOFF;
        }
        if (status == HS_OK) {
            list->has_list = true;
            list->built = list->now = next;
            list->jumps_now = -1;
            list->cutoff = options->cutoff;
            list->margin = options->cutoff > 0.0 && room > 0.0 ? hs_next_down(room) : room;
        }
    } else if (status == HS_OK) {
        list->now = next;
        list->margin = margin;
        list->jumps_now = jumped ? spare : -1;
    }
    if (status == HS_OK) {
        *rebuilt = needed;
        list->tried = margin;
    }
    hs_leave(&entry);
    return status;
}

hs_status
hs_verlet_find(const hs_verlet *list, const hs_options *options, hs_pairs **result,
               hs_failure *failure)
{
    hs_status status;
    hs_pairs *pairs = hs_result_begin(list != NULL, options, result, &failure, &status);
    if (pairs != NULL) {
        pairs->call.options.cutoff = list->cutoff;
        pairs->call.options.precision = HS_EXACT;
        status = hs_check_options(&pairs->call.options, HS_WANT_ALL);
    }
    if (status == HS_OK) {
        status = hs_recheck_find(list, pairs, failure);
    }
    return hs_result_end(pairs, status, result, failure);
}

/* The public functions of a box alone: measure, wrap and places. */

#define LARGEST_EXPONENT 1000

/* Only boxes near the end of the range are scaled, to leave room for sums of a few lengths. */
static hs_scale
scale_of_box(const hs_box *box)
{
    const double largest = hs_box_size_of(box).largest;
    const int    exponent = largest > 0.0 ? ilogb(largest) : 0;
    return hs_scale_of(exponent > LARGEST_EXPONENT ? exponent - LARGEST_EXPONENT : 0);
}

hs_status
hs_box_measure(const hs_box *box, double *heights, double *volume, hs_failure *failure)
{
    hs_entry   entry;
    hs_lattice lattice;
    failure = hs_enter(failure, &entry);
    hs_status status = box != NULL ? hs_check_box(box, box->ndim) : HS_ERR_ARGUMENT;
    if (status == HS_OK) {
        status = hs_box_check(box, failure);
    }
    if (status == HS_OK) {
        const hs_scale scale = scale_of_box(box);
        const hs_scale back = hs_scale_of(-scale.exponent);
        hs_lattice_init_given(box, scale, &lattice);
        for (int r = 0; heights != NULL && r < lattice.n_periodic; r++) {
            const int l = lattice.vector_of_row[r];
            heights[l] = hs_scale_apply(back, lattice.period[l]);
        }
        if (volume != NULL) {
            *volume = hs_lattice_volume(&lattice, scale.exponent);
        }
    }
    hs_leave(&entry);
    return status;
}

/* A tiny negative coordinate plus the length rounds to the length: keep it inside. Along a box
 * vector with one entry, in a column where no other has any, that coordinate alone says what is. */
static void
keep_inside(const hs_lattice *lattice, double *wrapped)
{
    for (int r = 0; r < lattice->n_periodic; r++) {
        for (int k = 0; k < lattice->ndim; k++) {
            const double length = lattice->rows[r][k];
            bool         is_alone = length != 0.0;
            for (int c = 0; c < lattice->ndim; c++) {
                is_alone = is_alone && (c == k || lattice->rows[r][c] == 0.0);
            }
            for (int other = 0; other < lattice->n_periodic; other++) {
                is_alone = is_alone && (other == r || lattice->rows[other][k] == 0.0);
            }
            if (is_alone && fabs(wrapped[k]) >= fabs(length)) {
                wrapped[k] = nextafter(length, 0.0);
            }
        }
    }
}

/* Moves a point from the middle period to [0, 1): one more vector for each negative fraction.
 * Rounded once, from the point as given, so that points that are inside stay as they are. */
static bool
wrap_row(const hs_lattice *lattice, const double *x, double *wrapped, int64_t *turns)
{
    double middle[HS_MAX_DIM];
    double magnitude = 0.0;
    bool   moved = false;
    if (!hs_wrap_point(lattice, x, middle, turns, &magnitude)) {
        return false;
    }
    for (int k = 0; k < lattice->ndim; k++) {
        const int r = lattice->row_of_axis[k];
        if (r < 0) {
            continue;
        }
        turns[r] -= hs_lattice_coordinate(lattice, middle, k) < 0.0;
        moved = moved || turns[r] != 0;
    }
    if (!moved) {
        memcpy(wrapped, x, (size_t)lattice->ndim * sizeof *x);
        return true;
    }
    if (!hs_wrap_by(lattice, x, turns, wrapped, &magnitude)) {
        return false;
    }
    keep_inside(lattice, wrapped);
    return true;
}

static hs_status
wrap_rows(const hs_lattice *lattice, hs_scale scale, const hs_cloud *cloud, double *wrapped,
          int64_t *shift, hs_failure *failure)
{
    const hs_scale back = hs_scale_of(-scale.exponent);
    const int      d = lattice->ndim;
    for (int64_t i = 0; i < cloud->n; i++) {
        double  x[HS_MAX_DIM], inside[HS_MAX_DIM];
        int64_t turns[HS_MAX_DIM], given[HS_MAX_DIM];
        for (int k = 0; k < d; k++) {
            x[k] = hs_scale_apply(scale, cloud->x[k][i]);
        }
        if (!wrap_row(lattice, x, inside, turns)) {
            failure->row = i;
            return HS_ERR_SHIFT_RANGE;
        }
        (void)hs_lattice_shift(lattice, turns, given); /* these fit: wrap_row has checked it */
        for (int k = 0; wrapped != NULL && k < d; k++) {
            const bool stays = inside[k] == x[k]; /* scaling may have lost its last digits */
            wrapped[i * d + k] = stays ? cloud->x[k][i] : hs_scale_apply(back, inside[k]);
        }
        if (shift != NULL) {
            memset(shift + i * d, 0, (size_t)d * sizeof(int64_t));
            for (int l = 0; l < lattice->n_periodic; l++) {
                shift[i * d + lattice->vector_of_row[l]] = -given[l];
            }
        }
    }
    return HS_OK;
}

hs_status
hs_box_wrap(const hs_box *box, const hs_points *points, double *wrapped, int64_t *shift,
            hs_failure *failure)
{
    const hs_options options = hs_options_default();
    hs_entry         entry;
    hs_lattice       lattice;
    hs_cloud         cloud;
    failure = hs_enter(failure, &entry);
    hs_status status = box != NULL ? load(points, box, &options, &cloud, failure) : HS_ERR_ARGUMENT;
    if (status == HS_OK) {
        const hs_scale scale = scale_of_box(box);
        hs_lattice_init_given(box, scale, &lattice);
        /* First without writing, so that a point that cannot be wrapped leaves the outputs as they
         * were. */
        status = wrap_rows(&lattice, scale, &cloud, NULL, NULL, failure);
        if (status == HS_OK) {
            status = wrap_rows(&lattice, scale, &cloud, wrapped, shift, failure);
        }
        hs_cloud_free(NULL, &cloud);
    }
    hs_leave(&entry);
    return status;
}

/* Places are computed with an error of less than this part of their terms, at most nine products.
 * So are sums of a place and a reach. */
#define PLACE_ERROR 0x1p-46
/* More than what is lost where products vanish. */
#define PLACE_LOSS 0x1p-1000
/* Entries of a box that lie further apart are not scaled together without loss. */
#define SCALED_TOGETHER 1000
/* Widths only say which side is longer. */
#define LARGEST_WIDTH 0x1p900

/* Along grid axis k a point is at the fractional part of `along[k]` . point, or, on an open axis,
 * at that product itself. An aligned lattice divides, which loses nothing far from the box. */
typedef struct place_axes {
    const hs_lattice *lattice;
    hs_scale          scale[HS_MAX_DIM]; /* of points, for each axis */
    double            along[HS_MAX_DIM][HS_MAX_DIM];
    double            size[HS_MAX_DIM];   /* the sum of the |along[k][c]| */
    double            length[HS_MAX_DIM]; /* not scaled; aligned lattices only */
} place_axes;

/*
 * How far shifts may move the places of a pair, in the unit of box vectors, because along[k] is
 * rounded: the sum over rows r of |S_r| rest(k, r), a bound on |along[k] . B_r|, which is 0 but for
 * rounding, or on its difference from 1. For D = x_j - x_i + sum_r S_r B_r with
 * |D| <= cutoff and |x| <= largest, |S_r| <= a_r + sum_m rest(r, m) |S_m| with
 * a_r = size_r (cutoff + 2 largest). Where the sum over m of rest(r, m) 2 a_m is at most a_r, as is
 * checked, |S_r| <= 2 a_r follows.
 */
static void
bound_drifts(const place_axes *axes, double cutoff, double largest, double *drift)
{
    const hs_lattice *lattice = axes->lattice;
    double            turns[HS_MAX_DIM] = {0}; /* 2 a_r; less than 1 turn is none */
    bool              holds = true;
    for (int k = 0; k < lattice->ndim; k++) {
        if (lattice->row_of_axis[k] >= 0) {
            turns[lattice->row_of_axis[k]] = 2.0 * axes->size[k] * (cutoff + 2.0 * largest);
        }
    }
    for (int k = 0; k < lattice->ndim; k++) {
        double of_all = 0.0;
        drift[k] = 0.0;
        for (int r = 0; r < lattice->n_periodic; r++) {
            double sum = lattice->row_of_axis[k] == r ? -1.0 : 0.0, terms = fabs(sum);
            for (int c = 0; c < lattice->ndim; c++) {
                const double term = axes->along[k][c] * lattice->rows[r][c];
                sum += term;
                terms += fabs(term);
            }
            const double rest = fabs(sum) + PLACE_ERROR * terms +
                                axes->size[k] * lattice->row_error[r] + PLACE_LOSS;
            const double moved = rest * turns[r];
            of_all += moved;
            drift[k] += turns[r] < 0.5 ? 0.0 : moved;
        }
        holds = holds &&
                (lattice->row_of_axis[k] < 0 || of_all <= 0.25 * turns[lattice->row_of_axis[k]]);
    }
    for (int k = 0; k < lattice->ndim; k++) {
        drift[k] = holds ? drift[k] : INFINITY;
    }
}

/* box_exponent, unit: lengths of the lattice and of open axes are scaled by these. */
static void
set_place_axes(const hs_lattice *lattice, int box_exponent, int unit, double cutoff, double largest,
               place_axes *axes, hs_box_axes *found)
{
    const hs_scale to_box = hs_scale_of(box_exponent), to_unit = hs_scale_of(unit);
    double         drift[HS_MAX_DIM] = {0};
    axes->lattice = lattice;
    for (int k = 0; k < lattice->ndim; k++) {
        const bool   repeats = lattice->row_of_axis[k] >= 0;
        const double over = repeats ? lattice->period[k] : 1.0;
        axes->scale[k] = repeats ? to_box : to_unit;
        axes->length[k] = hs_scale_apply(hs_scale_of(-box_exponent), lattice->period[k]);
        axes->size[k] = 0.0;
        for (int c = 0; c < lattice->ndim; c++) {
            axes->along[k][c] = lattice->normal[k][c] / over;
            axes->size[k] += fabs(axes->along[k][c]);
        }
    }
    if (!lattice->aligned) {
        bound_drifts(axes, hs_scale_apply(to_box, cutoff), hs_scale_apply(to_box, largest), drift);
    }
    for (int k = 0; k < lattice->ndim; k++) {
        const bool   repeats = lattice->row_of_axis[k] >= 0;
        const double far = hs_scale_apply(axes->scale[k], largest) * axes->size[k];
        const double terms = repeats && lattice->aligned ? 1.0 : far + 1.0;
        double       reach = hs_scale_apply(axes->scale[k], cutoff), square = 0.0;
        for (int c = 0; c < lattice->ndim; c++) {
            square += lattice->normal[k][c] * lattice->normal[k][c];
        }
        if (repeats && lattice->aligned) {
            reach = cutoff / axes->length[k];
        } else {
            reach *= sqrt(square);
            reach /= repeats ? lattice->period[k] : 1.0;
        }
        reach = reach * (1.0 + PLACE_ERROR) + PLACE_ERROR * terms;
        reach += repeats ? drift[k] : ldexp(drift[k], box_exponent - unit);
        found->repeats[k] = repeats;
        found->reach[k] = isfinite(reach) ? reach : INFINITY;
        found->width[k] = repeats ? ldexp(lattice->period[k], box_exponent - unit) : 1.0;
        found->width[k] = fmin(fmax(found->width[k], 1.0 / LARGEST_WIDTH), LARGEST_WIDTH);
    }
}

static void
set_places(const place_axes *axes, const hs_cloud *cloud, int k, double *places)
{
    const hs_lattice *lattice = axes->lattice;
    const bool        repeats = lattice->row_of_axis[k] >= 0;
    const double      length = axes->length[k];
    for (int64_t i = 0; i < cloud->n; i++) {
        double place = 0.0;
        if (repeats && lattice->aligned) {
            const double x = cloud->x[k][i];
            place = (fabs(x) < length ? x : fmod(x, length)) / length;
        } else {
            for (int c = 0; c < lattice->ndim; c++) {
                place += axes->along[k][c] * hs_scale_apply(axes->scale[k], cloud->x[c][i]);
            }
        }
        places[i] = repeats && !(place >= 0.0 && place < 1.0) ? place - floor(place) : place;
    }
}

hs_status
hs_box_places(const hs_box *box, const hs_points *points, double cutoff, double largest,
              double *places, int64_t stride, hs_box_axes *found, hs_failure *failure)
{
    hs_options options = hs_options_default();
    hs_entry   entry;
    hs_lattice lattice;
    hs_cloud   cloud;
    place_axes axes;
    options.cutoff = cutoff;
    failure = hs_enter(failure, &entry);
    hs_status status = found != NULL && is_length(largest) ? HS_OK : HS_ERR_ARGUMENT;
    if (status == HS_OK && !is_length(cutoff)) {
        failure->value = cutoff;
        status = HS_ERR_CUTOFF;
    }
    if (status == HS_OK) {
        status = load(points, box, &options, &cloud, failure);
    }
    const bool is_loaded = status == HS_OK;
    if (is_loaded && cloud.largest > largest) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        const hs_box_size size = hs_box_size_of(box);
        const double      longest = largest > 0.0 ? largest : cutoff;
        const int         exponent = size.is_coupled ? hs_exponent_of(size.largest) : 0;
        const int         unit = longest > 0.0 ? hs_exponent_of(longest) : 0;
        const bool        is_lost = size.is_coupled &&
                             exponent - hs_exponent_of(size.smallest) > SCALED_TOGETHER;
        hs_lattice_init(is_lost ? NULL : box, points->ndim, hs_scale_of(exponent), &lattice);
        set_place_axes(&lattice, exponent, unit, cutoff, largest, &axes, found);
        for (int k = 0; k < points->ndim; k++) {
            found->reach[k] = is_lost ? INFINITY : found->reach[k];
            if (places != NULL && isfinite(found->reach[k])) {
                set_places(&axes, &cloud, k, places + k * stride);
            } else if (places != NULL) {
                memset(places + k * stride, 0, (size_t)cloud.n * sizeof *places);
            }
        }
    }
    if (is_loaded) {
        hs_cloud_free(NULL, &cloud);
    }
    hs_leave(&entry);
    return status;
}

/* The public function that measures pairs which the caller has. */

/* Pairs that take about as long as a point of a search with few neighbours. */
#define PAIRS_A_POINT 8

hs_status
hs_measure(const hs_points *points, const hs_box *box, const hs_pair_numbers *pairs,
           const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    hs_status status;
    hs_pairs *measured = hs_result_begin(true, options, result, &failure, &status);
    if (measured == NULL) {
        return status;
    }
    hs_call     *call = &measured->call;
    hs_options  *of_pairs = &call->options;
    hs_cloud     cloud;
    hs_image_box images;
    of_pairs->cutoff = 0.0;
    of_pairs->cell_size = 0.0;
    of_pairs->sorted = false;
    of_pairs->out = NULL;
    of_pairs->precision = HS_EXACT;
    of_pairs->algorithm = HS_AUTO;
    of_pairs->index_bytes = 8;
    of_pairs->want &= HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT;
    status = hs_check_arguments(points, NULL, box, of_pairs, failure);
    if (status == HS_OK && (pairs == NULL || pairs->n < 0 || pairs->n > INT64_MAX / 1024 ||
                            (pairs->n > 0 && (pairs->i == NULL || pairs->j == NULL)))) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = hs_box_check(box, failure);
    }
    if (status == HS_OK) {
        hs_pairs_open(measured, points->ndim);
        status = hs_image_box_init(box, points->ndim, &images);
        if (status == HS_ERR_BOX_SKEWED && pairs->shift != NULL) {
            status = HS_OK; /* no image is looked for */
        }
    }
    if (status == HS_OK && call->kernel == NULL) {
        status = HS_ERR_KERNEL;
    }
    if (status == HS_OK) {
        hs_call_gather(call, points->n + pairs->n / PAIRS_A_POINT);
        status = hs_cloud_load(&call->account, call->team, points, of_pairs, &cloud, failure);
    }
    if (status == HS_OK) {
        const hs_given_pairs given = {pairs, &cloud, &images, &measured->output};
        status = hs_output_reserve(&measured->output, pairs->n, 0.0);
        if (status == HS_OK) {
            measured->output.n_pairs = pairs->n;
            status = hs_given_pairs_measure(&given, call, failure);
        } else {
            failure->expected_pairs = (double)pairs->n;
            failure->expected_bytes =
                (double)pairs->n * (double)hs_output_bytes_per_pair(&measured->output);
        }
        hs_cloud_free(&call->account, &cloud);
    }
    return hs_result_end(measured, status, result, failure);
}
