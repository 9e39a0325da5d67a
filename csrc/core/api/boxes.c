/* SPDX-License-Identifier: BSD-3-Clause */
#include "query.h"

#include <math.h>
#include <string.h>

/* boxes.c: the public functions of a box alone, measure, wrap and places, and of pairs that the
 * caller has. */

/* Checks points that are not searched, with their box, and loads them. The caller frees the
 * cloud. */
static hs_status
load(const hs_points *points, const hs_box *box, const hs_options *options, hs_cloud *cloud,
     hs_failure *failure)
{
    hs_status status = hs_check_sets(points, NULL, box, failure);
    status = status == HS_OK ? hs_box_check(box, failure) : status;
    return status == HS_OK ? hs_cloud_load(NULL, NULL, points, options, cloud, failure) : status;
}

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
    hs_status status = found != NULL && hs_is_length(largest) ? HS_OK : HS_ERR_ARGUMENT;
    if (status == HS_OK && !hs_is_length(cutoff)) {
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

/*
 * The public function that measures pairs which the caller has, in their order: a batch at a time,
 * between the points as given, by the kernels that measure pairs of searches. Far from the box,
 * where their error could reach the last place, by integers.
 */

/* Pairs that take about as long as a point of a search with few neighbours. */
#define PAIRS_A_POINT 8
#define MOST_SHIFT    (INT64_C(1) << 62)
/* Distances below this part of the terms that they are made of: double-words leave an error of
 * 2^-26 units in the last place otherwise, which rounding nearly never shows. */
#define CANCELLED 0x1p-24

/* What is done, and what went wrong in each slab of a round. */
typedef struct measuring {
    const hs_pair_numbers *pairs; /* borrowed */
    hs_cloud               cloud; /* owned; what they are measured between */
    hs_image_box           box;
    const hs_output       *output; /* borrowed; columns of d, D and S */
    const hs_kernel       *kernel;
    hs_metric              slow;    /* by integers alone */
    double                 longest; /* entry of a row of the box */
    int64_t                failed[HS_SLABS];
} measuring;

/* Takes pair `at` into the batch as number e. HS_ERR_ARGUMENT for a number that is no point's, or a
 * shift along an axis that does not repeat or beyond 2^62; HS_ERR_SHIFT_RANGE and HS_ERR_BOX_SKEWED
 * as hs_near_image, the former also for an S that does not fit its column. */
static hs_status
take_pair(const measuring *doing, int64_t at, int32_t e, int32_t *S, hs_measured *batch)
{
    const hs_cloud   *cloud = &doing->cloud;
    const hs_lattice *lattice = &doing->box.lattice;
    const int         d = cloud->ndim;
    const int64_t     i = doing->pairs->i[at], j = doing->pairs->j[at];
    const int64_t    *known = doing->pairs->shift; /* S over all box vectors; NULL: to be found */
    double            p[HS_MAX_DIM], q[HS_MAX_DIM];
    int64_t           shift[HS_MAX_DIM]; /* over those that repeat */
    if (i < 0 || i >= cloud->n || j < 0 || j >= cloud->n) {
        return HS_ERR_ARGUMENT;
    }
    for (int k = 0; k < d; k++) {
        batch->p[k][e] = p[k] = cloud->x[k][i];
        batch->q[k][e] = q[k] = cloud->x[k][j];
    }
    if (known == NULL && lattice->n_periodic > 0) {
        const hs_status status = hs_near_image(&doing->box, p, q, shift);
        if (status != HS_OK) {
            return status;
        }
    }
    for (int r = 0; known != NULL && r < lattice->n_periodic; r++) {
        shift[r] = known[at * d + lattice->vector_of_row[r]];
        if (shift[r] >= MOST_SHIFT || shift[r] <= -MOST_SHIFT) {
            return HS_ERR_ARGUMENT;
        }
    }
    for (int l = 0, r = 0; known != NULL && l < d; l++) {
        const bool repeats = r < lattice->n_periodic && lattice->vector_of_row[r] == l;
        if (!repeats && known[at * d + l] != 0) {
            return HS_ERR_ARGUMENT;
        }
        r += repeats;
    }
    if (S != NULL) { /* over all box vectors */
        memset(S + at * d, 0, (size_t)d * sizeof *S);
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        hs_measured_shift(batch, e, r, shift[r]);
        if (S != NULL && (shift[r] < INT32_MIN || shift[r] > INT32_MAX)) {
            return HS_ERR_SHIFT_RANGE;
        }
        if (S != NULL) {
            S[at * d + lattice->vector_of_row[r]] = (int32_t)shift[r];
        }
    }
    return HS_OK;
}

/* Measures the batch, and writes it to the place of its first pair. Returns the first whose vector
 * is not finite, or -1. */
static int32_t
put_batch(const measuring *doing, int64_t first, hs_measured *batch)
{
    const hs_output *output = doing->output;
    const hs_scale   same = {.exponent = 0, .first = 1.0, .second = 1.0};
    const double     largest = 2.0 * doing->cloud.largest;
    const int        d = output->ndim, m = doing->slow.n_rows;
    double          *distance = hs_output_column(output, HS_WANT_DISTANCE);
    double          *vectors = hs_output_column(output, HS_WANT_VECTOR);
    double          *vector[HS_MAX_DIM], sign[HS_BATCH];
    int32_t          failed = -1;
    hs_measured_find(doing->kernel, &doing->box.metric, vectors != NULL, batch);
    for (int32_t e = 0; e < batch->n; e++) {
        double  p[HS_MAX_DIM], q[HS_MAX_DIM], along[HS_MAX_DIM], terms = largest;
        int64_t shift[HS_MAX_DIM];
        sign[e] = 1.0;
        for (int r = 0; batch->is_shifted && r < m; r++) {
            shift[r] = batch->shift[r][e];
            terms += fabs((double)shift[r]) * doing->longest;
        }
        if (batch->is_shifted && !(batch->distance[e] >= CANCELLED * terms)) { /* measured anew */
            for (int k = 0; k < d; k++) {
                p[k] = batch->p[k][e];
                q[k] = batch->q[k][e];
            }
            batch->distance[e] = hs_metric_measure(&doing->slow, p, q, shift, along);
            for (int k = 0; k < d; k++) {
                batch->vector[k][e] = along[k];
            }
        }
        if (failed < 0 && !(batch->distance[e] < INFINITY)) {
            failed = e;
        }
    }
    if (distance != NULL) {
        memcpy(distance + first, batch->distance, (size_t)batch->n * sizeof *distance);
    }
    if (vectors != NULL) {
        for (int k = 0; k < d; k++) {
            vector[k] = batch->vector[k];
        }
        hs_restore_vectors(vectors + first * d, vector, sign, batch->n, d, same);
    }
    return failed;
}

/* A hs_slab_fn. HS_ERR_FAR for a vector that float64 does not hold. */
static hs_status
measure_slab(void *context, int slab, int64_t first, int64_t last)
{
    measuring  *doing = context;
    int32_t    *S = hs_output_column(doing->output, HS_WANT_SHIFT);
    const bool  measures = doing->output->columns & (HS_WANT_DISTANCE | HS_WANT_VECTOR);
    hs_measured batch;
    memset(&batch, 0, sizeof batch); /* kernels read a little beyond the last pair */
    for (; first < last; first += batch.n) {
        batch.n = (int32_t)(last - first < HS_BATCH ? last - first : HS_BATCH);
        batch.is_shifted = batch.is_wide = false;
        for (int32_t e = 0; e < batch.n; e++) {
            const hs_status status = take_pair(doing, first + e, e, S, &batch);
            if (status != HS_OK) {
                doing->failed[slab] = first + e;
                return status;
            }
        }
        const int32_t failed = measures ? put_batch(doing, first, &batch) : -1;
        if (failed >= 0) {
            doing->failed[slab] = first + failed;
            return HS_ERR_FAR;
        }
    }
    return HS_OK;
}

hs_status
hs_measure(const hs_points *points, const hs_box *box, const hs_pair_numbers *pairs,
           const hs_options *options, hs_pairs **result, hs_failure *failure)
{
    hs_status status;
    hs_pairs *measured = hs_result_begin(true, options, result, &failure, &status);
    if (measured == NULL) {
        return status;
    }
    hs_call    *call = &measured->call;
    hs_options *of_pairs = &call->options;
    measuring   doing = {.pairs = pairs, .output = &measured->output, .kernel = call->kernel};
    of_pairs->out = NULL;
    of_pairs->want &= HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT;
    status = hs_check_sets(points, NULL, box, failure);
    if (status == HS_OK) {
        status = hs_check_resources(of_pairs);
    }
    if (status == HS_OK && (pairs == NULL || pairs->n < 0 || pairs->n > INT64_MAX / 1024 ||
                            (pairs->n > 0 && (pairs->i == NULL || pairs->j == NULL)))) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = hs_box_check(box, failure);
    }
    if (status == HS_OK) {
        hs_pairs_open(measured, points->ndim);
        status = hs_image_box_init(box, points->ndim, &doing.box);
        if (status == HS_ERR_BOX_SKEWED && pairs->shift != NULL) {
            status = HS_OK; /* no image is looked for */
        }
    }
    if (status == HS_OK && call->kernel == NULL) {
        status = HS_ERR_KERNEL;
    }
    if (status == HS_OK) {
        hs_call_gather(call, points->n + pairs->n / PAIRS_A_POINT);
        status = hs_cloud_load(&call->account, call->team, points, of_pairs, &doing.cloud, failure);
    }
    if (status == HS_OK) {
        status = hs_output_reserve(&measured->output, pairs->n, 0.0);
        if (status == HS_OK) {
            measured->output.n_pairs = pairs->n;
            doing.slow = doing.box.metric;
            doing.slow.floats_usable = false;
            for (int r = 0; r < doing.slow.n_rows; r++) {
                for (int k = 0; k < doing.slow.ndim; k++) {
                    doing.longest = hs_larger(fabs(doing.slow.rows[r][k]), doing.longest);
                }
            }
            memset(doing.failed, -1, sizeof doing.failed);
            status = hs_walk_points(call->team, of_pairs, pairs->n, 0, measure_slab, &doing);
            for (int slab = 0; status != HS_OK && slab < HS_SLABS && failure->row < 0; slab++) {
                failure->row = doing.failed[slab];
            }
        } else {
            failure->expected_pairs = (double)pairs->n;
            failure->expected_bytes =
                (double)pairs->n * (double)hs_output_bytes_per_pair(&measured->output);
        }
        hs_cloud_free(&call->account, &doing.cloud);
    }
    return hs_result_end(measured, status, result, failure);
}
