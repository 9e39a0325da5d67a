/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * ball.c: thresholds on the float64 square of the distance, and what decides between them.
 *
 * An entry X and the centre P in image m: D = X - (P - m B). In open and aligned boxes X and P are
 * exact, so without an image each component is rounded once, and the square has the relative error
 * of the float64 stage (bounds.h). Otherwise the rounded centre, and in general boxes X and P too,
 * are wrong by at most `error` a component, D by a = sqrt(d) error, and the thresholds are those of
 * (R - a)^2 and (R + a)^2.
 */
#include "ball.h"

#include "../box/wrap.h"
#include "../exact/bounds.h"

#define SAFE 0x1p300 /* squares of such radii, and of 1 / SAFE, are ordinary numbers */

/* Roundings of the thresholds themselves: R^2, the factor, the product, and one to spare. */
#define OWN_ROUNDINGS 4.0

static void
set_thresholds(const hs_ball *ball, double a, hs_ball_image *image)
{
    const double width =
        (HS_FLOAT64_ROUNDINGS + HS_FLOAT64_ROUNDINGS_PER_AXIS * ball->list->lattice.ndim +
         OWN_ROUNDINGS) *
        HS_FLOAT64_UNIT;
    const double low = ball->radius - a, high = ball->radius + a;
    image->in = -1.0;
    image->out = INFINITY;
    if (ball->radius >= 1.0 / SAFE && high <= SAFE) {
        const double wider = a > 0.0 ? 4.0 * HS_FLOAT64_UNIT : 0.0; /* low and high are rounded */
        image->in = low > 0.0 ? low * low * (1.0 - width - wider) : -1.0;
        image->out = high * high * (1.0 + width + wider);
    }
}

/*
 * What coordinates in general boxes may be wrong by. X and P are rounded, by v of themselves and
 * what wrap.h says of their terms; so is the product with a normal, and the radius by the normal's
 * length. Far points must not matter to other balls: X is that of a point of which an image is
 * within. Across the box it is within R of P then, and along its rows a few of them away at most,
 * so |X_c| <= |P_c| + R + ROWS_AWAY sum_r |B_rc|, the last of which the leak stands for. In
 * directions that the box does not move, X and P are what was given.
 */
static double
wrapping_error(const hs_ball *ball)
{
    return 0x1p-90 * (ball->list->magnitude + ball->centre.magnitude);
}

static double
coordinate_error(const hs_ball *ball)
{
    const hs_dynamic *list = ball->list;
    double            size = list->spread + ball->radius;
    for (int c = 0; c < list->lattice.ndim; c++) {
        size += list->moves[c] ? fabs(ball->centre.x[c]) : 0.0;
    }
    return 0x1p-48 * size + wrapping_error(ball);
}

static double
axis_error(const hs_ball *ball, int k)
{
    const double size = 2.0 * ball->centre.terms[k] + HS_MAX_DIM * ball->radius;
    return hs_axis_rounding(ball->list->lattice.ndim) * size + wrapping_error(ball) +
           ball->list->axes.axis[k].leak;
}

HS_ALWAYS_INLINE hs_status
init_in(hs_ball *ball, const hs_dynamic *list, const double *position, hs_failure *failure,
        const int ndim)
{
    const hs_status status = hs_dynamic_place_in(list, position, &ball->centre, failure, ndim);
    if (status != HS_OK) {
        return status;
    }
    const double least = hs_larger(ball->radius, HS_LEAST_BALL);
    double       images = 1.0;
    ball->error = list->lattice.aligned ? 0.0 : coordinate_error(ball);
    for (int k = 0; k < ndim; k++) {
        const double error = list->lattice.aligned ? 0.0 : axis_error(ball, k);
        hs_axis_span(&list->axes.axis[k], ball->centre.t[k], ball->centre.index[k], least + error,
                     error, &ball->span[k]);
        images *= (double)(ball->span[k].most - ball->span[k].least) + 1.0;
        ball->home.centre[k] = ball->centre.x[k];
        ball->home.image[k] = 0;
    }
    set_thresholds(ball, list->lattice.aligned ? 0.0 : ndim * ball->error, &ball->home);
    return images <= HS_MOST_BALL_IMAGES ? HS_OK : HS_ERR_SHIFT_RANGE;
}

hs_status
hs_ball_init(hs_ball *ball, const hs_dynamic *list, const double *position, double radius,
             hs_failure *failure)
{
    ball->list = list;
    ball->radius = radius;
    ball->skip = HS_NO_PLACE;
    ball->status = HS_OK;
    if (!(radius >= 0.0 && radius <= list->max_radius)) {
        failure->value = radius;
        return HS_ERR_CUTOFF;
    }
    switch (list->lattice.ndim) {
    case 2: return init_in(ball, list, position, failure, 2);
    case 3: return init_in(ball, list, position, failure, 3);
    default: return init_in(ball, list, position, failure, list->lattice.ndim);
    }
}

/* By how many rows the position of an entry was wrapped. */
static void
turns_of(const hs_dynamic *list, uint32_t place, int64_t *turns)
{
    double x[HS_MAX_DIM], magnitude = 0.0;
    (void)hs_dynamic_wrap(list, hs_entry_given(&list->entries, place), x, turns, &magnitude,
                          list->lattice.ndim);
}

/* S = image + turns of the centre - turns of the entry is 0 over the rows of B as over the box
 * vectors. */
bool
hs_ball_skips(const hs_ball *ball, const hs_ball_image *image)
{
    const int n_rows = ball->list->lattice.n_periodic;
    int64_t   turns[HS_MAX_DIM];
    bool      is_home = true;
    if (n_rows > 0) {
        turns_of(ball->list, ball->skip, turns);
    }
    for (int r = 0; r < n_rows; r++) {
        is_home = is_home && image->image[r] + ball->centre.turns[r] == turns[r];
    }
    return is_home;
}

void
hs_ball_turn(const hs_ball *ball, const int64_t *image, hs_ball_image *turned)
{
    const hs_dynamic *list = ball->list;
    const int         d = list->lattice.ndim, n_rows = list->lattice.n_periodic;
    double            size = 0.0, times = 0.0;
    for (int r = 0; r < n_rows; r++) {
        turned->image[r] = image[r];
        times += fabs((double)image[r]);
    }
    for (int k = 0; k < d; k++) {
        double sum = ball->centre.x[k];
        double terms = fabs(sum);
        for (int r = 0; r < n_rows; r++) {
            const double term = (double)image[r] * list->lattice.rows[r][k];
            sum -= term;
            terms += fabs(term);
        }
        turned->centre[k] = sum;
        size = list->moves[k] ? hs_larger(terms, size) : size;
    }
    /* Up to 2 d roundings of partial sums and products, each at most v of the terms. */
    const double error = 0x1p-48 * size + ball->error + times * list->row_error;
    set_thresholds(ball, d * error, turned);
}

bool
hs_ball_shift(hs_ball *ball, const hs_ball_image *image, uint32_t place, int64_t *shift)
{
    const hs_lattice *lattice = &ball->list->lattice;
    int64_t           reduced[HS_MAX_DIM], given[HS_MAX_DIM];
    memset(shift, 0, (size_t)lattice->ndim * sizeof *shift);
    if (lattice->n_periodic == 0) {
        return true;
    }
    turns_of(ball->list, place, reduced);
    for (int r = 0; r < lattice->n_periodic; r++) {
        reduced[r] = image->image[r] + ball->centre.turns[r] - reduced[r];
    }
    if (!hs_lattice_shift(lattice, reduced, given)) {
        ball->status = HS_ERR_SHIFT_RANGE;
        return false;
    }
    for (int l = 0; l < lattice->n_periodic; l++) {
        shift[lattice->vector_of_row[l]] = given[l];
    }
    return true;
}

bool
hs_ball_settle(hs_ball *ball, const hs_ball_image *image, uint32_t place)
{
    const hs_dynamic *list = ball->list;
    const hs_lattice *lattice = &list->lattice;
    hs_stages         stages = {0};
    hs_metric         metric;
    if (list->counters != NULL) {
        list->counters->exact++;
    }
    if (lattice->aligned) { /* X and P are exact */
        hs_metric_init(&metric, lattice->ndim, lattice->n_periodic, lattice->rows, ball->radius,
                       list->inclusive);
        return hs_metric_within(&metric, ball->centre.x, hs_entry_at(&list->entries, place),
                                image->image, &stages);
    }
    int64_t over_box[HS_MAX_DIM], shift[HS_MAX_DIM];
    if (!hs_ball_shift(ball, image, place, over_box)) {
        return false;
    }
    for (int l = 0; l < lattice->n_periodic; l++) {
        shift[l] = over_box[lattice->vector_of_row[l]];
    }
    hs_metric_init(&metric, lattice->ndim, lattice->n_periodic, lattice->given, ball->radius,
                   list->inclusive);
    return hs_metric_within(&metric, ball->centre.given, hs_entry_given(&list->entries, place),
                            shift, &stages);
}
