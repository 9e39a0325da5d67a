/* SPDX-License-Identifier: BSD-3-Clause */
#include "ball.h"
#include "../box/wrap.h"
#include "../exact/bounds.h"

/*
 * ball.c: thresholds on the float64 square of the distance, and what decides between them.
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

/*
 * What coordinates in general boxes may be wrong by. X and P are rounded, by v of themselves and
 * what wrap.h says of their terms; so is the product with a normal, and the radius by the normal's
 * length. Far points must not matter to other balls: X is that of a point of which an image is
 * within. Across the box it is within R of P then, and along its rows a few of them away at most,
 * so |X_c| <= |P_c| + R + ROWS_AWAY sum_r |B_rc|, the last of which the leak stands for. In
 * directions that the box does not move, X and P are what was given.
 */
static double
coordinate_error(const hs_ball *ball, double wrapping)
{
    const hs_dynamic *list = ball->list;
    double            size = list->spread + ball->radius;
    for (int c = 0; c < list->lattice.ndim; c++) {
        size += list->moves[c] ? fabs(ball->centre.x[c]) : 0.0;
    }
    return 0x1p-48 * size + wrapping;
}

static double
axis_error(const hs_ball *ball, int k, double wrapping)
{
    const double size = 2.0 * ball->centre.terms[k] + HS_MAX_DIM * ball->radius;
    return hs_axis_rounding(ball->list->lattice.ndim) * size + wrapping +
           ball->list->axes.axis[k].leak;
}

/* Radius for cells in place of a smaller one: its square is not 0. */
#define LEAST_BALL 0x1p-400
/* Images that one ball looks at, at most: MOST_IMAGES of dynamic.c, and those that a far centre
 * adds. */
#define MOST_BALL_IMAGES 0x1p24

HS_ALWAYS_INLINE hs_status
init_in(hs_ball *ball, const hs_dynamic *list, const double *position, hs_failure *failure,
        const int ndim)
{
    const hs_status status = hs_dynamic_place_in(list, position, &ball->centre, failure, ndim);
    if (status != HS_OK) {
        return status;
    }
    const double least = hs_larger(ball->radius, LEAST_BALL);
    double       images = 1.0;
    const double wrapping = 0x1p-90 * (list->magnitude + ball->centre.magnitude);
    ball->error = list->lattice.aligned ? 0.0 : coordinate_error(ball, wrapping);
    for (int k = 0; k < ndim; k++) {
        const double error = list->lattice.aligned ? 0.0 : axis_error(ball, k, wrapping);
        hs_axis_span(&list->axes.axis[k], ball->centre.t[k], ball->centre.index[k], least + error,
                     error, &ball->span[k]);
        images *= (double)(ball->span[k].most - ball->span[k].least) + 1.0;
        ball->home.centre[k] = ball->centre.x[k];
        ball->home.image[k] = 0;
    }
    set_thresholds(ball, list->lattice.aligned ? 0.0 : ndim * ball->error, &ball->home);
    return images <= MOST_BALL_IMAGES ? HS_OK : HS_ERR_SHIFT_RANGE;
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

/* S of an entry over the box vectors: ndim integers, 0 where the box does not repeat. False where
 * it passes 2^62: ball->status says so then. */
static bool
ball_shift(hs_ball *ball, const hs_ball_image *image, uint32_t place, int64_t *shift)
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

/* Decides for an entry that the thresholds left open. */
static bool
ball_decide_unsure(hs_ball *ball, const hs_ball_image *image, uint32_t place)
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
    if (!ball_shift(ball, image, place, over_box)) {
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

/* One cell of a ball: whether it is in reach, which image of it is meant, and its entries. */

/* One cell index along one axis: its least distance from the centre of the ball. */
typedef struct part {
    double   gap;    /* square of the distance to it; infinity: out of reach */
    uint64_t number; /* dense: what it adds to the number of a cell; sparse: to its hash */
    int64_t  index;  /* within the period */
    int64_t  image;
} part;

typedef struct ball_walk {
    hs_ball             *ball;
    const hs_ball_visit *visit;
    double               limit;   /* cells with larger gaps are beyond the radius */
    bool                 filters; /* cells may hold entries that are none of the ball's cells */
    unsigned             cut;     /* bit k: each cell in one image, where it is nearest */
    int64_t              work;    /* entries and cells since the last poll */
    bool                 meets_images;
    hs_ball_image        turned; /* the last image but home, if there is one */
    bool                 has_turned;
} ball_walk;

/* At most the square of the distance to cell u along axis k. */
HS_ALWAYS_INLINE double
gap_of(const ball_walk *walk, int k, int64_t u)
{
    const hs_axis *axis = &walk->ball->list->axes.axis[k];
    const double   t = walk->ball->centre.t[k];
    const int64_t  centre = walk->ball->span[k].centre;
    if (!walk->ball->list->lattice.aligned) {
        return 0.0;
    }
    double gap = hs_axis_gap(axis, t, u, centre);
    if (HS_UNLIKELY(walk->cut >> k & 1u)) {
        gap = hs_smaller(hs_axis_gap(axis, t, u - axis->n, centre), gap);
        gap = hs_smaller(hs_axis_gap(axis, t, u + axis->n, centre), gap);
    }
    return gap;
}

HS_ALWAYS_INLINE part
part_of(const ball_walk *walk, int k, int64_t u)
{
    const hs_dynamic *list = walk->ball->list;
    const hs_axis    *axis = &list->axes.axis[k];
    part              p = {.image = hs_axis_image(axis, u)};
    p.index = u - p.image * axis->n;
    p.gap = gap_of(walk, k, u);
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
is_met(const ball_walk *walk, uint32_t place)
{
    const hs_dynamic *list = walk->ball->list;
    const double     *x = hs_entry_at(&list->entries, place);
    double            gap = 0.0;
    for (int k = 0; k < list->lattice.ndim; k++) {
        const hs_axis          *axis = &list->axes.axis[k];
        const hs_span_of_cells *span = &walk->ball->span[k];
        int64_t                 u = hs_axis_cell(axis, hs_lattice_coordinate(&list->lattice, x, k));
        u += axis->n * hs_axis_image(axis, span->first - u + axis->n - 1);
        if (u < span->first || u > span->last) {
            return false;
        }
        gap += gap_of(walk, k, u);
    }
    return gap <= walk->limit;
}

/* Whether to go on, after so much more work. */
HS_ALWAYS_INLINE bool
goes_on(ball_walk *walk, int64_t work)
{
    const hs_dynamic *list = walk->ball->list;
    walk->work += work;
    if (HS_UNLIKELY(walk->work > HS_POLL_POINTS)) {
        walk->work = 0;
        if (list->hooks.poll != NULL && !list->hooks.poll(walk->visit->user, 0.0)) {
            walk->ball->status = HS_ERR_INTERRUPTED;
        }
    }
    return walk->ball->status == HS_OK;
}

HS_ALWAYS_INLINE bool
tell(const ball_walk *walk, const hs_ball_image *image, uint32_t place)
{
    const hs_dynamic    *list = walk->ball->list;
    const hs_entry_tail *tail = hs_entry_tail_at(&list->entries, place);
    const double        *given = hs_entry_given(&list->entries, place);
    int64_t              shift[HS_MAX_DIM];
    if (walk->visit->with_shift && !ball_shift(walk->ball, image, place, shift)) {
        return true;
    }
    return walk->visit->fn((hs_key){tail->id, tail->tag}, isnan(given[0]) ? NULL : given,
                           walk->visit->with_shift ? shift : NULL, walk->visit->user) != 0;
}

/* One entry in one image; whether to stop. Loops over axes are of the do-while form here, as there
 * is always one: compilers that do not know ndim then need no test before the first. */
HS_ALWAYS_INLINE bool
scan_entry(const ball_walk *walk, const hs_ball_image *image, uint32_t place, const int ndim)
{
    hs_ball      *ball = walk->ball;
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
    return walk->visit->fn == NULL || tell(walk, image, place);
}

/* Entries of one cell in one image; whether to stop. */
HS_ALWAYS_INLINE bool
scan_cell(ball_walk *walk, const hs_ball_image *image, hs_cell cell, const int ndim)
{
    for (uint32_t place = cell.start; place < cell.start + cell.count; place++) {
        if (walk->visit->is_near
                ? !(walk->filters && !is_met(walk, place)) && tell(walk, image, place)
                : scan_entry(walk, image, place, ndim)) {
            return true;
        }
    }
    return !goes_on(walk, 1 + (int64_t)cell.count);
}

/* The image of these parts. */
static inline const hs_ball_image *
image_of(ball_walk *walk, const int64_t *along)
{
    const hs_dynamic *list = walk->ball->list;
    int64_t           image[HS_MAX_DIM];
    bool              same = walk->has_turned;
    for (int k = 0; k < list->lattice.ndim; k++) {
        const int r = list->axes.axis[k].row;
        if (r >= 0) {
            image[r] = along[k];
            same = same && walk->turned.image[r] == along[k];
        }
    }
    if (!same) {
        ball_turn(walk->ball, image, &walk->turned);
        walk->has_turned = true;
    }
    return &walk->turned;
}

/* A cell that is in reach, if there is one; whether to stop. number: the sum of its parts. */
HS_ALWAYS_INLINE bool
scan_number(ball_walk *walk, uint64_t number, const int64_t *index, const int64_t *along,
            const int ndim)
{
    const hs_dynamic    *list = walk->ball->list;
    const hs_ball_image *image = &walk->ball->home;
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
        list->counters->candidates += walk->visit->is_near ? 0 : cell.count;
    }
    if (cell.count == 0) {
        return false;
    }
    if (walk->meets_images && !walk->visit->is_near) {
        uint64_t turns = 0;
        int      k = 0;
        do
            turns |= (uint64_t)along[k];
        while (++k < ndim);
        image = turns != 0 ? image_of(walk, along) : image;
    }
    return scan_cell(walk, image, cell, ndim);
}

/*
 * Three ways through the cells of a ball. A ball of a few cells takes them nearest first, from the
 * lists of storage.h; what is needed of each cell is made up of a part for each axis. A larger one
 * takes them by index, and one that meets more cells than there are takes all entries there are, in
 * each image.
 */

#define CROWD         4   /* entries of a cell that are gathered without a branch */
#define MOST_GATHERED 125 /* cells */

/* Cells nearest first. */
HS_ALWAYS_INLINE bool
walk_listed(ball_walk *walk, int reach, part parts[][HS_SLOTS], const int ndim)
{
    int64_t           index[HS_MAX_DIM] = {0}, along[HS_MAX_DIM] = {0};
    const bool        needs_index = !walk->ball->list->cells.dense || walk->meets_images;
    const hs_offsets *offsets = &walk->ball->list->offsets;
    const uint8_t    *end = offsets->slot + offsets->at[reach + 1];
    for (const uint8_t *slot = offsets->slot + offsets->at[reach]; slot < end; slot += ndim) {
        double   gap = 0.0;
        uint64_t number = 0;
        int      k = 0;
        do
            gap += parts[k][slot[k]].gap;
        while (++k < ndim);
        if (gap > walk->limit) {
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
        if (scan_number(walk, number, index, along, ndim)) {
            return true;
        }
    }
    return false;
}

/*
 * The same for few dense cells of few entries in one image: first the places of all entries,
 * without a branch that depends on how many a cell has, then their distances. Mispredicted branches
 * would take most of the time. False: a cell is too full, or there are too many; nothing was done.
 */
HS_ALWAYS_INLINE bool
walk_gathered(ball_walk *walk, int reach, part parts[][HS_SLOTS], bool *stopped, const int ndim)
{
    uint32_t          places[MOST_GATHERED * CROWD];
    const hs_dynamic *list = walk->ball->list;
    const int64_t     n_offsets = list->offsets.n[reach];
    const uint8_t    *slot = list->offsets.slot + list->offsets.at[reach];
    uint32_t          fullest = 0;
    int               n = 0;
    if (!list->cells.dense || walk->meets_images || walk->visit->is_near ||
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
        const uint32_t count = gap <= walk->limit ? cell.count : 0;
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
        *stopped = scan_entry(walk, &walk->ball->home, places[e], ndim);
    }
    return true;
}

/* Takes the parts of all cells up to `reach` to a side; those that the ball does not meet are out
 * of reach, and add nothing to a number. */
HS_ALWAYS_INLINE bool
walk_few(ball_walk *walk, int reach, const int ndim)
{
    part parts[HS_MAX_DIM][HS_SLOTS];
    bool stopped;
    int  k = 0;
    do {
        const hs_span_of_cells *span = &walk->ball->span[k];
        for (int o = -reach; o <= reach; o++) {
            const int64_t u = span->centre + o;
            if (u < span->first || u > span->last) {
                parts[k][o + HS_MOST_REACH] = (part){.gap = INFINITY};
            } else {
                parts[k][o + HS_MOST_REACH] = part_of(walk, k, u);
            }
        }
    } while (++k < ndim);
    return walk_gathered(walk, reach, parts, &stopped, ndim)
               ? stopped
               : walk_listed(walk, reach, parts, ndim);
}

/* Cells by index, the last axis fastest. */
static bool
walk_by_index(ball_walk *walk)
{
    const hs_span_of_cells *span = walk->ball->span;
    const int               d = walk->ball->list->lattice.ndim;
    int64_t                 u[HS_MAX_DIM], index[HS_MAX_DIM] = {0}, along[HS_MAX_DIM] = {0};
    part                    parts[HS_MAX_DIM];
    for (int k = 0; k < d; k++) {
        u[k] = span[k].first;
        parts[k] = part_of(walk, k, u[k]);
    }
    for (;;) {
        double   gap = 0.0;
        uint64_t number = 0;
        for (int k = 0; k < d; k++) {
            gap += parts[k].gap;
            number += parts[k].number;
            index[k] = parts[k].index;
            along[k] = parts[k].image;
        }
        if ((gap <= walk->limit && scan_number(walk, number, index, along, d)) ||
            !goes_on(walk, 1)) {
            return true;
        }
        int k = d - 1;
        while (k >= 0 && u[k] == span[k].last) {
            u[k] = span[k].first;
            parts[k] = part_of(walk, k, u[k]);
            k--;
        }
        if (k < 0) {
            return false;
        }
        u[k]++;
        parts[k] = part_of(walk, k, u[k]);
    }
}

/* All cells there are, in one image. */
static bool
scan_all(ball_walk *walk, const hs_ball_image *image)
{
    const hs_dynamic *list = walk->ball->list;
    for (int64_t c = 0; c < list->cells.n; c++) {
        if (scan_cell(walk, image, list->cells.cell[c], list->lattice.ndim)) {
            return true;
        }
    }
    return false;
}

/* All cells there are, in each image; entries of a near walk once. */
static bool
walk_all(ball_walk *walk)
{
    const hs_span_of_cells *span = walk->ball->span;
    const hs_dynamic       *list = walk->ball->list;
    const int               d = list->lattice.ndim;
    int64_t                 along[HS_MAX_DIM];
    if (walk->visit->is_near) {
        walk->filters = list->storage != HS_STORE_ALL_PAIRS;
        return scan_all(walk, &walk->ball->home);
    }
    for (int k = 0; k < d; k++) {
        along[k] = span[k].least;
    }
    for (;;) {
        uint64_t turns = 0;
        for (int k = 0; k < d; k++) {
            turns |= (uint64_t)along[k];
        }
        if (scan_all(walk, turns != 0 ? image_of(walk, along) : &walk->ball->home)) {
            return true;
        }
        int k = d - 1;
        while (k >= 0 && along[k] == span[k].most) {
            along[k] = span[k].least;
            k--;
        }
        if (k < 0) {
            return false;
        }
        along[k]++;
    }
}

/* Along open axes a dense table ends where its cells do. False: no cell is left. */
static bool
cut_spans(const hs_dynamic *list, hs_span_of_cells *span)
{
    bool some = list->cells.n > 0;
    for (int k = 0; k < list->lattice.ndim; k++) {
        if (list->cells.dense && list->axes.axis[k].n == 0 && some) {
            const int64_t last = list->cells.lowest[k] + list->cells.shape[k] - 1;
            span[k].first = span[k].first < list->cells.lowest[k] ? list->cells.lowest[k]
                                                                  : span[k].first;
            span[k].last = span[k].last > last ? last : span[k].last;
        }
        some = some && span[k].first <= span[k].last;
    }
    return some;
}

/* A ball whose cells are fewer than those of the list, times images. */
static bool
take_cells(ball_walk *walk)
{
    const hs_dynamic       *list = walk->ball->list;
    const hs_span_of_cells *span = walk->ball->span;
    double                  wanted = 1.0, stored = (double)list->cells.n;
    int64_t                 reach = 0;
    for (int k = 0; k < list->lattice.ndim; k++) {
        const int64_t below = span[k].centre - span[k].first, above = span[k].last - span[k].centre;
        wanted *= (double)(span[k].last - span[k].first) + 1.0;
        stored *= walk->visit->is_near ? 1.0 : (double)(span[k].most - span[k].least) + 1.0;
        walk->meets_images = walk->meets_images || span[k].least != 0 || span[k].most != 0;
        reach = below > reach ? below : reach;
        reach = above > reach ? above : reach;
    }
    if (reach > 1 && wanted > stored) {
        return walk_all(walk);
    }
    if (reach > list->offsets.reach || walk->cut != 0) {
        return walk_by_index(walk);
    }
    switch (list->lattice.ndim) {
    case 2: return walk_few(walk, (int)reach, 2);
    case 3: return walk_few(walk, (int)reach, 3);
    default: return walk_few(walk, (int)reach, list->lattice.ndim);
    }
}

bool
hs_ball_walk(hs_ball *ball, const hs_ball_visit *visit)
{
    const hs_dynamic *list = ball->list;
    const double      least = hs_larger(ball->radius, LEAST_BALL);
    /* The limit is above the square of the radius by more than all rounding. */
    ball_walk walk = {.ball = ball, .visit = visit, .limit = least * least * (1.0 + 0x1p-30)};
    if (visit->is_near) {
        bool is_wide = list->cells.is_wide;
        for (int k = 0; k < list->lattice.ndim; k++) {
            const int64_t     n = list->axes.axis[k].n;
            hs_span_of_cells *span = &ball->span[k];
            if (n > 0 && span->last - span->first >= n) { /* each cell once, around the centre's */
                span->first = span->centre - n / 2;
                span->last = span->first + n - 1;
                walk.cut |= 1u << k;
            }
            is_wide = is_wide || span->first < INT32_MIN || span->last > INT32_MAX;
        }
        walk.filters = !list->cells.dense && is_wide;
        if (list->storage == HS_STORE_ALL_PAIRS) {
            return walk_all(&walk);
        }
    }
    return cut_spans(list, ball->span) && take_cells(&walk);
}
