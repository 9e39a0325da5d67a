/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_DYNAMIC_BALL_H
#define HS_DYNAMIC_BALL_H

#include "dynamic.h"
#include "../exact/metric.h"
#include "../base/os.h"

/*
 * ball.h: the ball of a query, and the test whether an entry lies in it. Exact: a float64 square
 * with a proven bound first, then the stages of metric.h on the positions that were given.
 */

/* Radius for cells in place of a smaller one: its square is not 0. */
#define HS_LEAST_BALL 0x1p-400

/* Images that one ball looks at, at most: MOST_IMAGES of dynamic.c, and those that a far centre
 * adds. */
#define HS_MOST_BALL_IMAGES 0x1p24

/* The centre as entries see it that have been moved by `image`: centre - image * B. */
typedef struct hs_ball_image {
    double  centre[HS_MAX_DIM];
    int64_t image[HS_MAX_DIM]; /* over the rows of B */
    double  in, out; /* a square below `in` is surely within, one above `out` surely not */
} hs_ball_image;

typedef struct hs_ball {
    const hs_dynamic *list;
    double            radius;
    hs_placed         centre;
    double            error;  /* of each coordinate of X and P together; 0 in aligned boxes */
    uint32_t          skip;   /* place of an entry, or HS_NO_PLACE */
    hs_status         status; /* of the walk: HS_ERR_SHIFT_RANGE, HS_ERR_INTERRUPTED */
    hs_span_of_cells  span[HS_MAX_DIM];
    hs_ball_image     home; /* no image */
} hs_ball;

/* What to do with each entry. */
typedef struct hs_ball_visit {
    hs_dynamic_fn fn; /* NULL: the first one is enough */
    void         *user;
    bool          with_shift;
} hs_ball_visit;

/* position: borrowed while the ball is in use. HS_ERR_CUTOFF, HS_ERR_NOT_FINITE,
 * HS_ERR_SHIFT_RANGE. */
hs_status hs_ball_init(hs_ball *ball, const hs_dynamic *list, const double *position, double radius,
                       hs_failure *failure);

/* Whether this is the image S = 0 of the entry that is skipped: the one that does not count. */
bool hs_ball_skips(const hs_ball *ball, const hs_ball_image *image);

/* The centre for another image. */
void hs_ball_turn(const hs_ball *ball, const int64_t *image, hs_ball_image *turned);

/* Decides for an entry that the thresholds left open. */
bool hs_ball_decide_unsure(hs_ball *ball, const hs_ball_image *image, uint32_t place);

/* S of an entry over the box vectors: ndim integers, 0 where the box does not repeat. False where
 * it passes 2^62: ball->status says so then. */
bool hs_ball_shift(hs_ball *ball, const hs_ball_image *image, uint32_t place, int64_t *shift);

/* One cell of a ball: whether it is in reach, which image of it is meant, and its
 * entries. For ball.c, which knows the dimension where that is 2 or 3. */

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
    bool                 is_near; /* no distances: each entry once */
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
    if (walk->visit->with_shift && !hs_ball_shift(walk->ball, image, place, shift)) {
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
    if (place == ball->skip && hs_ball_skips(ball, image)) {
        return false;
    }
    if (!(square < image->in) && !hs_ball_decide_unsure(ball, image, place)) {
        return ball->status != HS_OK;
    }
    return walk->visit->fn == NULL || tell(walk, image, place);
}

/* Entries of one cell in one image; whether to stop. */
HS_ALWAYS_INLINE bool
scan_cell(ball_walk *walk, const hs_ball_image *image, hs_cell cell, const int ndim)
{
    for (uint32_t place = cell.start; place < cell.start + cell.count; place++) {
        if (walk->is_near ? !(walk->filters && !is_met(walk, place)) && tell(walk, image, place)
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
        hs_ball_turn(walk->ball, image, &walk->turned);
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
        list->counters->candidates += walk->is_near ? 0 : cell.count;
    }
    if (cell.count == 0) {
        return false;
    }
    if (walk->meets_images && !walk->is_near) {
        uint64_t turns = 0;
        int      k = 0;
        do
            turns |= (uint64_t)along[k];
        while (++k < ndim);
        image = turns != 0 ? image_of(walk, along) : image;
    }
    return scan_cell(walk, image, cell, ndim);
}

/* The entries in the cells that a ball meets. */

/* Entries within the ball, in each image; whether it was left early. */
bool hs_ball_within(hs_ball *ball, const hs_ball_visit *visit);

/* Entries of all these cells, each once. The spans of the ball may be cut. */
void hs_ball_near(hs_ball *ball, const hs_ball_visit *visit);

#endif
