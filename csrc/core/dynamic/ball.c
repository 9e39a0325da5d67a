/* SPDX-License-Identifier: BSD-3-Clause */
#include "ball.h"
#include "../exact/bounds.h"
#include "../exact/metric.h"
#include "../memory/memory.h"

#include <stdlib.h>

/* ball.c: the grid axes of a list, the cells around a cell, and queries: the ball of each, its
 * cells, and the points that are in it. */

/* Cells of at least the width that was given; periods hold a whole number of them. */

#define MOST_CELLS 0x1p30 /* in a period: their numbers and images are int32 and int64 */

/* Wrapped points are so many rows away at most, where they are far along open axes. */
#define ROWS_AWAY 16

/*
 * By how much the images of a ball may miss whole periods along axis k: a row of B that should not
 * move along it does so by normal . row, as rounded, and by the roundings of these; the row that
 * should moves by its height as rounded. So often as a query can meet the row: R and what
 * coordinates are wrong by, in heights. Points that are ROWS_AWAY are rounded besides.
 */
static double
leak_of(const hs_dynamic *list, int k, const double *so_far)
{
    const hs_lattice *lattice = &list->lattice;
    double            leak = 0.0;
    for (int j = 0; j < lattice->ndim; j++) {
        const int r = lattice->row_of_axis[j];
        double    along = 0.0, size = 0.0;
        if (r < 0) {
            continue;
        }
        for (int c = 0; c < lattice->ndim; c++) {
            along += lattice->normal[k][c] * lattice->rows[r][c];
            size += fabs(lattice->rows[r][c]);
        }
        const double miss =
            (j == k ? 0.0 : fabs(along)) + 0x1p-44 * size + lattice->ndim * lattice->row_error[r];
        leak += ((list->max_radius + so_far[j]) / lattice->period[j] + ROWS_AWAY) * miss;
        leak += hs_axis_rounding(lattice->ndim) * ROWS_AWAY *
                hs_axis_terms(lattice, lattice->rows[r], k);
    }
    return leak;
}

void
hs_axes_init(hs_dynamic *list, double cell_size, bool one_cell)
{
    const hs_lattice *lattice = &list->lattice;
    for (int k = 0; k < lattice->ndim; k++) {
        hs_axis *axis = &list->axis[k];
        *axis = (hs_axis){.row = lattice->row_of_axis[k]};
        if (axis->row >= 0) {
            const double fitting = one_cell ? 1.0 : floor(lattice->period[k] / cell_size);
            axis->period = lattice->period[k];
            axis->half = 0.5 * axis->period;
            axis->n = (int64_t)hs_larger(hs_smaller(fitting, MOST_CELLS), 1.0);
        }
        if (axis->n == 1 || (axis->n == 0 && one_cell)) {
            axis->width = axis->n == 1 ? axis->period : INFINITY;
            axis->inverse = 0.0;
        } else {
            axis->width = axis->n > 0 ? axis->period / (double)axis->n : cell_size;
            axis->inverse = 1.0 / axis->width;
        }
        const double farthest = one_cell ? 0.0 : HS_FARTHEST_CELL;
        axis->lowest = axis->n > 0 ? 0.0 : -farthest;
        axis->highest = axis->n > 0 ? (double)(axis->n - 1) : farthest;
    }
    /* Leaks twice: those along one axis lead to more images along others. */
    for (int pass = 0; pass < 2 && !lattice->aligned; pass++) {
        double so_far[HS_MAX_DIM];
        for (int k = 0; k < lattice->ndim; k++) {
            so_far[k] = list->axis[k].leak;
        }
        for (int k = 0; k < lattice->ndim; k++) {
            list->axis[k].leak = leak_of(list, k, so_far);
        }
    }
    for (int k = 0; k < lattice->ndim; k++) {
        hs_axis *axis = &list->axis[k];
        axis->farthest = axis->row >= 0 ? HS_WRAP_LIMIT * axis->period : INFINITY;
        for (int r = 0; r < lattice->n_periodic; r++) {
            axis->farthest += hs_axis_terms(lattice, lattice->rows[r], k);
        }
    }
}

/* The number of periods times their length; beyond one it may be rounded, by less than `*slack`. */
static double
shift_of(const hs_axis *axis, int64_t image, double *slack)
{
    const double shift = (double)image * axis->period;
    *slack = image < -1 || image > 1 ? 0x1p-50 * fabs(shift) : 0.0;
    return shift;
}

void
hs_axis_images(const hs_axis *axis, double low, double high, double error, hs_span_of_cells *span)
{
    /* Image m has points from m L - L/2 to m L + L/2, wider by the error; the quotients are rounded
     * by less than the 2^-40 that is added: one image too many is no fault. */
    const double least = floor((low - error) / axis->period + 0.5 - 0x1p-40);
    const double most = floor((high + error) / axis->period + 0.5 + 0x1p-40);
    double       slack;
    HS_ASSERT(least > -0x1p30 && most < 0x1p30); /* hs_dynamic_new, hs_dynamic_place */
    span->least = (int64_t)least - (fabs(least) > 0x1p8);
    span->most = (int64_t)most + (fabs(most) > 0x1p8);
    const double first = hs_below(low, shift_of(axis, span->least, &slack));
    span->first = span->least * axis->n + hs_axis_cell(axis, first - slack);
    const double last = hs_above(high, -shift_of(axis, span->most, &slack));
    span->last = span->most * axis->n + hs_axis_cell(axis, last + slack);
}

/* The cube of offsets, sorted once when the list is made. */

/* An offset and what it is sorted by. */
typedef struct item {
    double  least, centre;
    uint8_t slot[HS_MAX_DIM];
} item;

static int
compare(const void *one, const void *other)
{
    const item *a = one, *b = other;
    if (a->least != b->least) {
        return a->least < b->least ? -1 : 1;
    }
    if (a->centre != b->centre) {
        return a->centre < b->centre ? -1 : 1;
    }
    return memcmp(a->slot, b->slot, HS_MAX_DIM);
}

/* The offsets of the list of this reach, in order, from distances in units of the widest cell, so
 * that their squares are ordinary numbers. In skewed boxes the least distance is the sum of squares
 * of those between faces: an order, not a bound. */
static void
fill(const hs_dynamic *list, double unit, int reach, item *items)
{
    const hs_offsets *offsets = &list->offsets;
    const int         d = list->lattice.ndim, side = 2 * reach + 1;
    const int64_t     n = offsets->n[reach];
    for (int64_t i = 0; i < n; i++) {
        double  centre[HS_MAX_DIM] = {0};
        int64_t rest = i;
        items[i] = (item){.least = 0.0};
        for (int k = d - 1; k >= 0; k--) {
            items[i].slot[k] = (uint8_t)(rest % side + HS_MOST_REACH - reach);
            rest /= side;
        }
        for (int k = 0; k < d; k++) {
            const int    offset = items[i].slot[k] - HS_MOST_REACH;
            const int    between = offset > 1 ? offset - 1 : offset < -1 ? -offset - 1 : 0;
            const double width = isfinite(list->axis[k].width) ? list->axis[k].width / unit : 0.0;
            items[i].least += between * width * (between * width);
            for (int c = 0; c < d; c++) {
                centre[c] += offset * width * list->lattice.direction[k][c];
            }
        }
        for (int c = 0; c < d; c++) {
            items[i].centre += centre[c] * centre[c];
        }
    }
    qsort(items, (size_t)n, sizeof *items, compare);
    for (int64_t i = 0; i < n; i++) {
        memcpy(offsets->slot + offsets->at[reach] + i * d, items[i].slot, (size_t)d);
    }
}

bool
hs_offsets_init(hs_dynamic *list)
{
    hs_offsets *offsets = &list->offsets;
    const int   d = list->lattice.ndim;
    double needed = 0.0, unit = 0.0; /* cells to a side, and one more for rounding; widest cell */
    memset(offsets, 0, sizeof *offsets);
    for (int k = 0; k < d; k++) {
        if (isfinite(list->axis[k].width)) {
            needed = hs_larger(ceil(list->max_radius / list->axis[k].width) + 1.0, needed);
            unit = hs_larger(list->axis[k].width, unit);
        }
    }
    for (int r = 0; r <= HS_MOST_REACH && r <= needed; r++) {
        double n = 1.0;
        for (int k = 0; k < d; k++) {
            n *= 2 * r + 1;
        }
        if (n > HS_MOST_OFFSETS) {
            break;
        }
        offsets->reach = r;
        offsets->n[r] = (int64_t)n;
        offsets->at[r + 1] = offsets->at[r] + (int64_t)n * d;
    }
    const int last = offsets->reach;
    offsets->slot = hs_alloc(NULL, HS_FOR_STENCIL, offsets->at[last + 1], 1);
    item *items = hs_alloc(NULL, HS_FOR_STENCIL, offsets->n[last], sizeof *items);
    for (int r = 0; r <= last && offsets->slot != NULL && items != NULL; r++) {
        fill(list, unit > 0.0 ? unit : 1.0, r, items);
    }
    hs_free(NULL, items);
    if (items == NULL) {
        hs_free(NULL, offsets->slot);
        offsets->slot = NULL;
    }
    return offsets->slot != NULL;
}

/*
 * Thresholds on the float64 square of the distance, and what decides between them.
 *
 * An entry X and the centre P in image m: D = X - (P - m B). In open and aligned boxes X and P are
 * exact, so without an image each component is rounded once, and the square has the relative error
 * of the float64 stage (bounds.h). Otherwise the rounded centre, and in general boxes X and P too,
 * are wrong by at most `error` a component, D by a = sqrt(d) error, and the thresholds are those of
 * (R - a)^2 and (R + a)^2.
 */

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

/* Radius for cells in place of a smaller one: its square is not 0. */
#define LEAST_BALL 0x1p-400
/* Images that one ball looks at, at most: MOST_IMAGES of dynamic.c, and those that a far centre
 * adds. */
#define MOST_BALL_IMAGES 0x1p24

/*
 * Coordinates in general boxes: X and P are rounded, by v of themselves and what wrap.h says of
 * their terms; so is the product with a normal, and the radius by the normal's length. Far points
 * must not matter to other balls: X is that of a point of which an image is within. Across the box
 * it is within R of P then, and along its rows a few of them away at most, so |X_c| <= |P_c| + R +
 * ROWS_AWAY sum_r |B_rc|, the last of which the leak stands for. In directions that the box does
 * not move, X and P are what was given.
 */
hs_status
hs_ball_init(hs_ball *ball, const hs_dynamic *list, const double *position, double radius,
             hs_failure *failure)
{
    const int    d = list->lattice.ndim;
    const double least = hs_larger(radius, LEAST_BALL);
    ball->list = list;
    ball->radius = radius;
    ball->limit = least * least * (1.0 + 0x1p-30); /* above the square by more than all rounding */
    ball->skip = HS_NO_PLACE;
    ball->status = HS_OK;
    ball->cut = 0;
    ball->has_turned = ball->meets_images = ball->filters = false;
    ball->work = 0;
    if (!(radius >= 0.0 && radius <= list->max_radius)) {
        failure->value = radius;
        return HS_ERR_CUTOFF;
    }
    const hs_status status = hs_dynamic_place(list, position, &ball->centre, failure);
    if (status != HS_OK) {
        return status;
    }
    const double wrapping = 0x1p-90 * (list->magnitude + ball->centre.magnitude);
    double       images = 1.0, size = list->spread + radius;
    for (int k = 0; k < d && !list->lattice.aligned; k++) {
        size += list->moves[k] ? fabs(ball->centre.x[k]) : 0.0;
    }
    ball->error = list->lattice.aligned ? 0.0 : 0x1p-48 * size + wrapping;
    for (int k = 0; k < d; k++) {
        const double error =
            list->lattice.aligned
                ? 0.0
                : hs_axis_rounding(d) * (2.0 * ball->centre.terms[k] + HS_MAX_DIM * radius) +
                      wrapping + list->axis[k].leak;
        hs_axis_span(&list->axis[k], ball->centre.t[k], least + error, error, &ball->span[k]);
        images *= (double)(ball->span[k].most - ball->span[k].least) + 1.0;
        ball->home.centre[k] = ball->centre.x[k];
        ball->home.image[k] = 0;
    }
    set_thresholds(ball, list->lattice.aligned ? 0.0 : d * ball->error, &ball->home);
    return images <= MOST_BALL_IMAGES ? HS_OK : HS_ERR_SHIFT_RANGE;
}

/* By how many rows the position of an entry was wrapped. */
static void
turns_of(const hs_dynamic *list, uint32_t place, int64_t *turns)
{
    double x[HS_MAX_DIM], magnitude = 0.0;
    (void)hs_dynamic_wrap(list, hs_entry_given(&list->entries, place), x, turns, &magnitude,
                          list->lattice.ndim);
}

/* Whether this is the image S = 0 of the entry that is skipped: the one that does not count. S =
 * image + turns of the centre - turns of the entry is 0 over the rows of B as over the box
 * vectors. */
static bool
ball_skips(const hs_ball *ball, const hs_ball_image *image)
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

/* The centre for another image. */
static void
ball_turn(const hs_ball *ball, const int64_t *image, hs_ball_image *turned)
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

/* S of an entry over the box vectors that repeat, as given. False where it passes 2^62:
 * ball->status says so then. */
static bool
find_shift(hs_ball *ball, const hs_ball_image *image, uint32_t place, int64_t *given)
{
    const hs_lattice *lattice = &ball->list->lattice;
    int64_t           reduced[HS_MAX_DIM];
    if (lattice->n_periodic > 0) {
        turns_of(ball->list, place, reduced);
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        reduced[r] = image->image[r] + ball->centre.turns[r] - reduced[r];
    }
    if (!hs_lattice_shift(lattice, reduced, given)) {
        ball->status = HS_ERR_SHIFT_RANGE;
    }
    return ball->status == HS_OK;
}

/* Decides for an entry that the thresholds left open. */
static bool
ball_decide_unsure(hs_ball *ball, const hs_ball_image *image, uint32_t place)
{
    const hs_dynamic *list = ball->list;
    const hs_lattice *lattice = &list->lattice;
    const bool        exact = lattice->aligned; /* X and P are */
    const int64_t    *shift = image->image;
    int64_t           given[HS_MAX_DIM];
    hs_stages         stages = {0};
    hs_metric         metric;
    if (list->counters != NULL) {
        list->counters->exact++;
    }
    if (!exact) {
        if (!find_shift(ball, image, place, given)) {
            return false;
        }
        shift = given;
    }
    hs_metric_init(&metric, lattice->ndim, lattice->n_periodic,
                   exact ? lattice->rows : lattice->given, ball->radius, list->inclusive);
    return hs_metric_within(&metric, exact ? ball->centre.x : ball->centre.given,
                            exact ? hs_entry_at(&list->entries, place)
                                  : hs_entry_given(&list->entries, place),
                            shift, &stages);
}

/* One cell of a ball: whether it is in reach, which image of it is meant, and its entries. */

/* One cell index along one axis: its least distance from the centre of the ball. */
typedef struct part {
    double   gap;    /* square of the distance to it; infinity: out of reach */
    uint64_t number; /* dense: what it adds to the number of a cell; sparse: to its hash */
    int64_t  index;  /* within the period */
    int64_t  image;
} part;

/* At most the square of the distance to cell u along axis k. */
HS_ALWAYS_INLINE double
gap_of(const hs_ball *ball, int k, int64_t u)
{
    const hs_axis *axis = &ball->list->axis[k];
    const double   t = ball->centre.t[k];
    const int64_t  centre = ball->centre.index[k];
    if (!ball->list->lattice.aligned) {
        return 0.0;
    }
    double gap = hs_axis_gap(axis, t, u, centre);
    if (HS_UNLIKELY(ball->cut >> k & 1u)) {
        gap = hs_smaller(hs_axis_gap(axis, t, u - axis->n, centre), gap);
        gap = hs_smaller(hs_axis_gap(axis, t, u + axis->n, centre), gap);
    }
    return gap;
}

HS_ALWAYS_INLINE part
part_of(const hs_ball *ball, int k, int64_t u)
{
    const hs_dynamic *list = ball->list;
    const hs_axis    *axis = &list->axis[k];
    part              p = {.image = hs_axis_image(axis, u)};
    p.index = u - p.image * axis->n;
    p.gap = gap_of(ball, k, u);
    if (!list->cells.dense) {
        p.number = hs_cell_part(k, p.index);
    } else { /* the span of the ball has been cut to the table's */
        p.number = (uint64_t)((p.index - list->cells.lowest[k]) * list->cells.stride[k]);
    }
    return p;
}

/* Whether the cell of an entry is one that the ball meets: sparse cells may hold those of others,
 * whose indices are the same modulo 2^32. */
static bool
is_met(const hs_ball *ball, uint32_t place)
{
    const hs_dynamic *list = ball->list;
    const double     *x = hs_entry_at(&list->entries, place);
    double            gap = 0.0;
    for (int k = 0; k < list->lattice.ndim; k++) {
        const hs_axis          *axis = &list->axis[k];
        const hs_span_of_cells *span = &ball->span[k];
        int64_t                 u = hs_axis_cell(axis, hs_lattice_coordinate(&list->lattice, x, k));
        u += axis->n * hs_axis_image(axis, span->first - u + axis->n - 1);
        if (u < span->first || u > span->last) {
            return false;
        }
        gap += gap_of(ball, k, u);
    }
    return gap <= ball->limit;
}

/* Whether to go on, after so much more work. */
HS_ALWAYS_INLINE bool
goes_on(hs_ball *ball, int64_t work)
{
    const hs_dynamic *list = ball->list;
    ball->work += work;
    if (HS_UNLIKELY(ball->work > HS_POLL_POINTS)) {
        ball->work = 0;
        if (list->hooks.poll != NULL && !list->hooks.poll(ball->visit->user, 0.0)) {
            ball->status = HS_ERR_INTERRUPTED;
        }
    }
    return ball->status == HS_OK;
}

HS_ALWAYS_INLINE bool
tell(hs_ball *ball, const hs_ball_image *image, uint32_t place)
{
    const hs_dynamic    *list = ball->list;
    const hs_entry_tail *tail = hs_entry_tail_at(&list->entries, place);
    const double        *given = hs_entry_given(&list->entries, place);
    const hs_lattice    *lattice = &list->lattice;
    int64_t              over_rows[HS_MAX_DIM], shift[HS_MAX_DIM] = {0};
    if (ball->visit->with_shift) {
        if (!find_shift(ball, image, place, over_rows)) {
            return true;
        }
        for (int l = 0; l < lattice->n_periodic; l++) {
            shift[lattice->vector_of_row[l]] = over_rows[l];
        }
    }
    return ball->visit->fn((hs_key){tail->id, tail->tag}, isnan(given[0]) ? NULL : given,
                           ball->visit->with_shift ? shift : NULL, ball->visit->user) != 0;
}

/* One entry in one image; whether to stop. Loops over axes are of the do-while form here, as there
 * is always one: compilers that do not know ndim then need no test before the first. */
HS_ALWAYS_INLINE bool
scan_entry(hs_ball *ball, const hs_ball_image *image, uint32_t place, const int ndim)
{
    const double *x = hs_entry_at(&ball->list->entries, place);
    double        square = 0.0;
    int           k = 0;
    do {
        const double difference = x[k] - image->centre[k];
        square += difference * difference;
    } while (++k < ndim);
    if (square > image->out) {
        return false;
    }
    if (place == ball->skip && ball_skips(ball, image)) {
        return false;
    }
    if (!(square < image->in) && !ball_decide_unsure(ball, image, place)) {
        return ball->status != HS_OK;
    }
    return ball->visit->fn == NULL || tell(ball, image, place);
}

/* Entries of one cell in one image; whether to stop. */
HS_ALWAYS_INLINE bool
scan_cell(hs_ball *ball, const hs_ball_image *image, hs_cell cell, const int ndim)
{
    for (uint32_t place = cell.start; place < cell.start + cell.count; place++) {
        if (ball->visit->is_near
                ? !(ball->filters && !is_met(ball, place)) && tell(ball, image, place)
                : scan_entry(ball, image, place, ndim)) {
            return true;
        }
    }
    return !goes_on(ball, 1 + (int64_t)cell.count);
}

/* The image of these parts. */
HS_ALWAYS_INLINE const hs_ball_image *
image_of(hs_ball *ball, const int64_t *along, const int ndim)
{
    int64_t  image[HS_MAX_DIM];
    uint64_t turns = 0;
    bool     same = ball->has_turned;
    int      k = 0;
    do
        turns |= (uint64_t)along[k];
    while (++k < ndim);
    if (turns == 0) {
        return &ball->home;
    }
    for (k = 0; k < ndim; k++) {
        const int r = ball->list->axis[k].row;
        if (r >= 0) {
            image[r] = along[k];
            same = same && ball->turned.image[r] == along[k];
        }
    }
    if (!same) {
        ball_turn(ball, image, &ball->turned);
        ball->has_turned = true;
    }
    return &ball->turned;
}

/* A cell that is in reach, if there is one; whether to stop. number: the sum of its parts. */
HS_ALWAYS_INLINE bool
scan_number(hs_ball *ball, uint64_t number, const int64_t *index, const int64_t *along,
            const int ndim)
{
    const hs_dynamic    *list = ball->list;
    const hs_ball_image *image = &ball->home;
    if (!list->cells.dense) {
        number = hs_cell_table_probe(&list->cells, index, hs_cell_mark(number));
        if (number == HS_NO_CELL) {
            return false;
        }
    }
    const hs_cell cell = list->cells.cell[number];
    if (HS_UNLIKELY(list->counters != NULL)) {
        list->counters->cells++;
        list->counters->lookups += !list->cells.dense;
        list->counters->candidates += ball->visit->is_near ? 0 : cell.count;
    }
    if (cell.count == 0) {
        return false;
    }
    if (ball->meets_images && !ball->visit->is_near) {
        image = image_of(ball, along, ndim);
    }
    return scan_cell(ball, image, cell, ndim);
}

/*
 * Three ways through the cells of a ball. A ball of a few cells takes them nearest first, from the
 * lists of offsets; what is needed of each cell is made up of a part for each axis. A larger one
 * takes them by index, and one that meets more cells than there are takes all entries there are, in
 * each image.
 */

#define CROWD         4   /* entries of a cell that are gathered without a branch */
#define MOST_GATHERED 125 /* cells */

/* Cells nearest first. */
HS_ALWAYS_INLINE bool
walk_listed(hs_ball *ball, int reach, part parts[][HS_SLOTS], const int ndim)
{
    int64_t           index[HS_MAX_DIM] = {0}, along[HS_MAX_DIM] = {0};
    const bool        needs_index = !ball->list->cells.dense || ball->meets_images;
    const hs_offsets *offsets = &ball->list->offsets;
    const uint8_t    *end = offsets->slot + offsets->at[reach + 1];
    for (const uint8_t *slot = offsets->slot + offsets->at[reach]; slot < end; slot += ndim) {
        double   gap = 0.0;
        uint64_t number = 0;
        int      k = 0;
        do
            gap += parts[k][slot[k]].gap;
        while (++k < ndim);
        if (gap > ball->limit) {
            continue;
        }
        k = 0;
        do {
            const part *of = &parts[k][slot[k]];
            number += of->number;
            if (needs_index) {
                index[k] = of->index;
                along[k] = of->image;
            }
        } while (++k < ndim);
        if (scan_number(ball, number, index, along, ndim)) {
            return true;
        }
    }
    return false;
}

/*
 * The same for few dense cells of few entries in one image: first the places of all entries,
 * without a branch that depends on how many a cell has, then their distances. Mispredicted branches
 * would take most of the time: calls of `within` from Python are 1.04 to 1.17 times as long without
 * this. False: a cell is too full, or there are too many; nothing was done.
 */
HS_ALWAYS_INLINE bool
walk_gathered(hs_ball *ball, int reach, part parts[][HS_SLOTS], bool *stopped, const int ndim)
{
    uint32_t          places[MOST_GATHERED * CROWD];
    const hs_dynamic *list = ball->list;
    const int64_t     n_offsets = list->offsets.n[reach];
    const uint8_t    *slot = list->offsets.slot + list->offsets.at[reach];
    uint32_t          fullest = 0;
    int               n = 0;
    if (!list->cells.dense || ball->meets_images || ball->visit->is_near ||
        n_offsets > MOST_GATHERED || list->counters != NULL) {
        return false;
    }
    for (int64_t o = 0; o < n_offsets; o++, slot += ndim) {
        double   gap = parts[0][slot[0]].gap;
        uint64_t number = parts[0][slot[0]].number;
        for (int k = 1; k < ndim; k++) {
            gap += parts[k][slot[k]].gap;
            number += parts[k][slot[k]].number;
        }
        const hs_cell  cell = list->cells.cell[number];
        const uint32_t count = gap <= ball->limit ? cell.count : 0;
        fullest = count > fullest ? count : fullest;
        for (uint32_t e = 0; e < CROWD; e++) {
            places[n + (int)e] = cell.start + e;
        }
        n += (int)(count < CROWD ? count : CROWD);
    }
    if (fullest > CROWD) {
        return false;
    }
    *stopped = false;
    for (int e = 0; e < n && !*stopped; e++) {
        *stopped = scan_entry(ball, &ball->home, places[e], ndim);
    }
    return true;
}

/* Takes the parts of all cells up to `reach` to a side; those that the ball does not meet are out
 * of reach, and add nothing to a number. */
HS_ALWAYS_INLINE bool
walk_few(hs_ball *ball, int reach, const int ndim)
{
    part parts[HS_MAX_DIM][HS_SLOTS];
    bool stopped;
    int  k = 0;
    do {
        const hs_span_of_cells *span = &ball->span[k];
        for (int o = -reach; o <= reach; o++) {
            const int64_t u = ball->centre.index[k] + o;
            if (u < span->first || u > span->last) {
                parts[k][o + HS_MOST_REACH] = (part){.gap = INFINITY};
            } else {
                parts[k][o + HS_MOST_REACH] = part_of(ball, k, u);
            }
        }
    } while (++k < ndim);
    return walk_gathered(ball, reach, parts, &stopped, ndim)
               ? stopped
               : walk_listed(ball, reach, parts, ndim);
}

/* Moves to the next of all cells, or images, of a ball, the last axis fastest. Returns the first
 * axis that it was moved along, or -1 after the last one. */
static int
go_to_next(const hs_span_of_cells *span, int ndim, bool is_image, int64_t *u)
{
    int k = ndim - 1;
    for (; k >= 0 && u[k] == (is_image ? span[k].most : span[k].last); k--) {
        u[k] = is_image ? span[k].least : span[k].first;
    }
    if (k >= 0) {
        u[k]++;
    }
    return k;
}

/* Cells by index. */
static bool
walk_by_index(hs_ball *ball)
{
    const hs_span_of_cells *span = ball->span;
    const int               d = ball->list->lattice.ndim;
    int64_t                 u[HS_MAX_DIM], index[HS_MAX_DIM] = {0}, along[HS_MAX_DIM] = {0};
    part                    parts[HS_MAX_DIM];
    for (int k = 0; k < d; k++) {
        u[k] = span[k].first;
    }
    for (int moved = 0; moved >= 0; moved = go_to_next(span, d, false, u)) {
        double   gap = 0.0;
        uint64_t number = 0;
        for (int k = 0; k < d; k++) {
            parts[k] = k >= moved ? part_of(ball, k, u[k]) : parts[k];
            gap += parts[k].gap;
            number += parts[k].number;
            index[k] = parts[k].index;
            along[k] = parts[k].image;
        }
        if ((gap <= ball->limit && scan_number(ball, number, index, along, d)) ||
            !goes_on(ball, 1)) {
            return true;
        }
    }
    return false;
}

/* All cells there are, in each image; of a near walk once. */
static bool
walk_all(hs_ball *ball)
{
    const hs_span_of_cells *span = ball->span;
    const hs_dynamic       *list = ball->list;
    const int               d = list->lattice.ndim;
    int64_t                 along[HS_MAX_DIM];
    ball->filters = list->storage != HS_STORE_ALL_PAIRS;
    for (int k = 0; k < d; k++) {
        along[k] = span[k].least;
    }
    do {
        const hs_ball_image *image = ball->visit->is_near ? &ball->home : image_of(ball, along, d);
        for (int64_t c = 0; c < list->cells.n; c++) {
            if (scan_cell(ball, image, list->cells.cell[c], d)) {
                return true;
            }
        }
    } while (!ball->visit->is_near && go_to_next(span, d, true, along) >= 0);
    return false;
}

/* Entries within the ball, in each image, or near it; whether it was left early. The spans of the
 * ball may be cut. */
static bool
walk_ball(hs_ball *ball, const hs_ball_visit *visit)
{
    const hs_dynamic *list = ball->list;
    hs_span_of_cells *span = ball->span;
    double            wanted = 1.0, stored = (double)list->cells.n;
    int64_t           reach = 0;
    ball->visit = visit;
    if (visit->is_near) {
        bool is_wide = list->cells.is_wide;
        for (int k = 0; k < list->lattice.ndim; k++) {
            const int64_t n = list->axis[k].n;
            if (n > 0 && span[k].last - span[k].first >= n) {
                span[k].first = ball->centre.index[k] - n / 2; /* each once, around the centre's */
                span[k].last = span[k].first + n - 1;
                ball->cut |= 1u << k;
            }
            is_wide = is_wide || span[k].first < INT32_MIN || span[k].last > INT32_MAX;
        }
        ball->filters = !list->cells.dense && is_wide;
        if (list->storage == HS_STORE_ALL_PAIRS) {
            return walk_all(ball);
        }
    }
    /* The cells that there are: those of an open dense table end where it does. */
    for (int k = 0; k < list->lattice.ndim; k++, span++) {
        if (list->cells.dense && list->axis[k].n == 0) {
            const int64_t first = list->cells.lowest[k], last = first + list->cells.shape[k] - 1;
            span->first = span->first < first ? first : span->first;
            span->last = span->last > last ? last : span->last;
        }
        if (list->cells.n == 0 || span->first > span->last) {
            return false;
        }
        const int64_t centre = ball->centre.index[k];
        const int64_t below = centre - span->first, above = span->last - centre;
        wanted *= (double)(span->last - span->first) + 1.0;
        stored *= ball->visit->is_near ? 1.0 : (double)(span->most - span->least) + 1.0;
        ball->meets_images = ball->meets_images || span->least != 0 || span->most != 0;
        reach = below > reach ? below : reach;
        reach = above > reach ? above : reach;
    }
    if (reach > 1 && wanted > stored) {
        return walk_all(ball);
    }
    if (reach > list->offsets.reach || ball->cut != 0) {
        return walk_by_index(ball);
    }
    switch (list->lattice.ndim) {
    case 2: return walk_few(ball, (int)reach, 2);
    case 3: return walk_few(ball, (int)reach, 3);
    default: return walk_few(ball, (int)reach, list->lattice.ndim);
    }
}

/* Visits the points that a query finds: those near the ball, or exactly within it, for which every
 * key needs a position. any: receives whether there is one; NULL: each is visited. skip: or
 * NULL. */
static hs_status
ask(const hs_dynamic *list, const double *position, double radius, const hs_ball_visit *visit,
    const hs_key *skip, bool *any, hs_failure *failure)
{
    hs_failure ignored;
    hs_ball    ball;
    double     own[HS_MAX_DIM];
    failure = hs_failure_or(failure, &ignored);
    if (list == NULL || position == NULL || (visit->fn == NULL && any == NULL)) {
        return HS_ERR_ARGUMENT;
    }
    const hs_dynamic_call call = hs_dynamic_enter(list, false);
    hs_read_position(list, position, own);
    hs_status status = hs_ball_init(&ball, list, own, radius, failure);
    if (status == HS_OK && list->n_without > 0 && !visit->is_near) {
        status = HS_ERR_KEY;
    }
    if (status == HS_OK && skip != NULL) {
        ball.skip = hs_stored_find(list, *skip);
        status = ball.skip != HS_NO_PLACE ? HS_OK : HS_ERR_KEY;
    }
    if (status == HS_OK) {
        const bool found = walk_ball(&ball, visit);
        if (any != NULL) {
            *any = found;
        }
        status = ball.status;
    }
    hs_dynamic_leave(list, call);
    return status;
}

hs_status
hs_dynamic_near(const hs_dynamic *list, const double *position, double radius, hs_dynamic_fn visit,
                void *user, hs_failure *failure)
{
    const hs_ball_visit each = {.fn = visit, .user = user, .is_near = true};
    return ask(list, position, radius, &each, NULL, NULL, failure);
}

hs_status
hs_dynamic_within(const hs_dynamic *list, const double *position, double radius, bool with_shift,
                  hs_dynamic_fn visit, void *user, hs_failure *failure)
{
    const hs_ball_visit each = {.fn = visit, .user = user, .with_shift = with_shift};
    return ask(list, position, radius, &each, NULL, NULL, failure);
}

hs_status
hs_dynamic_any_within(const hs_dynamic *list, const double *position, double radius,
                      const hs_key *skip, bool *any, hs_failure *failure)
{
    static const hs_ball_visit first = {.fn = NULL};
    return ask(list, position, radius, &first, skip, any, failure); /* refused where any is NULL */
}
