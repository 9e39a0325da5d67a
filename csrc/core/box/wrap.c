/* SPDX-License-Identifier: BSD-3-Clause */
#include "wrap.h"
#include "../exact/arithmetic.h"

/* wrap.c: one point in any box, and columns of points along coordinate axes. Remainders are exact
 * or computed by compensated sums. */

#define TURNS_TAIL  (INT64_C(1) << 26) /* splits 62 bits into 36 and 26, both exact as doubles */
#define WRAP_PASSES 4 /* each pass gains 50 bits; from 2^51 turns two are enough, two are spare */

/* Numbers beyond this are taken smaller, exactly, before they are split into halves: splitting
 * multiplies by 2^27 + 1 (arithmetic.h), and sums of a few products must be finite too. */
#define LARGE 0x1p900
/* Coordinates by so much: those that are large stay above 2^800, so that no digit of the length,
 * which is at least 2^-52 of them, is lost. */
#define REDUCE 0x1p-100
/* Entries of a box by so much, and their products back again: what is below 2^1024 comes below
 * 2^960, and stays above 2^836, far from the smallest numbers. */
#define SHRINK 0x1p-64
#define GROW   0x1p64

/*
 * x - n * length, which must be a double, for an integer 1 <= |n| < 2^52 within 3/4 of x / length.
 * By a product of two words, because some C libraries round twice in fma(). The first difference is
 * exact by Sterbenz's lemma, the second because its result is a double. Nothing underflows: all are
 * multiples of the last digit of `length`. Nothing overflows: large numbers are scaled.
 */
static double
rest(double x, double n, double length)
{
    const double scale = fabs(x) > LARGE ? REDUCE : 1.0;
    const hs_dw  product = hs_two_product(-n, scale * length);
    return ((scale * x + product.hi) + product.lo) / scale;
}

double
hs_wrap_axis(double x, double length, int64_t *turns)
{
    const double half = 0.5 * length;
    *turns = 0;
    if (x >= -half && x <= half) {
        return x;
    }
    double n = rint(x / length);
    double inside;
    if (fabs(n) <= 1.0) {
        inside = x - n * length; /* n * length is exact, the difference by Sterbenz's lemma */
    } else if (fabs(n) < HS_WRAP_LIMIT) {
        /* The quotient was rounded, so n may be one off; either way x - n * length is a double. */
        inside = rest(x, n, length);
        if (fabs(inside) > half) {
            n += inside > half ? 1.0 : -1.0;
            inside = rest(x, n, length);
        }
    } else {
        *turns = HS_WRAP_UNKNOWN;
        return remainder(x, length); /* exact by IEEE 754 for any quotient */
    }
    *turns = (int64_t)n;
    return inside;
}

/* sum + low -= factor * entry, by a compensated step (Ogita, Rump and Oishi 2005, Dot2). A factor
 * that is split must be below 2^996: large entries are taken smaller, exactly. */
HS_ALWAYS_INLINE void
subtract_product(double factor, double entry, double *sum, double *low, double *absolute)
{
    const bool   is_large = fabs(entry) > LARGE;
    const double shrink = is_large ? SHRINK : 1.0, grow = is_large ? GROW : 1.0;
    const hs_dw  scaled = hs_two_product(-factor, entry * shrink);
    const hs_dw  product = {scaled.hi * grow, scaled.lo * grow};
    const hs_dw  partial = hs_two_sum(*sum, product.hi);
    *sum = partial.hi;
    *low += partial.lo + product.lo;
    *absolute += fabs(product.hi);
}

bool
hs_wrap_by(const hs_lattice *lattice, const double *r, const int64_t *turns, double *inside,
           double *magnitude)
{
    int64_t given[HS_MAX_DIM];
    if (!hs_lattice_shift(lattice, turns, given)) {
        return false;
    }
    for (int k = 0; k < lattice->ndim; k++) {
        double sum = r[k];
        double low = 0.0;
        double absolute = fabs(r[k]);
        for (int l = 0; l < lattice->n_periodic; l++) {
            /* Turns of more than 52 bits are split into two doubles. */
            const double  entry = lattice->scaled[l][k];
            const int64_t tail = given[l] % TURNS_TAIL;
            subtract_product((double)(given[l] - tail), entry, &sum, &low, &absolute);
            subtract_product((double)tail, entry, &sum, &low, &absolute);
        }
        inside[k] = sum + low;
        *magnitude = hs_larger(absolute, *magnitude);
    }
    return true;
}

bool
hs_wrap_point(const hs_lattice *lattice, const double *r, double *inside, int64_t *turns,
              double *magnitude)
{
    for (int k = 0; k < lattice->ndim; k++) {
        inside[k] = r[k];
        *magnitude = hs_larger(fabs(r[k]), *magnitude);
    }
    for (int row = 0; row < lattice->n_periodic; row++) {
        turns[row] = 0;
    }
    for (int pass = 0; pass < WRAP_PASSES; pass++) {
        bool moved = false;
        for (int k = 0; k < lattice->ndim; k++) {
            const int row = lattice->row_of_axis[k];
            if (row < 0) {
                continue;
            }
            const double t = hs_lattice_coordinate(lattice, inside, k);
            const double n = rint(t / lattice->period[k]);
            if (!(fabs(n) + fabs((double)turns[row]) < HS_WRAP_LIMIT)) {
                return false;
            }
            turns[row] += (int64_t)n;
            moved = moved || n != 0.0;
        }
        if (!moved) {
            return true;
        }
        if (!hs_wrap_by(lattice, r, turns, inside, magnitude)) {
            return false;
        }
    }
    return true;
}

/*
 * Columns of points along coordinate axes, hs_fold_axis.
 *
 * Why the bits are those of hs_wrap_axis: for |x| <= 1.25 L the rounded quotient x / L rounds to 0
 * exactly where |x| <= L/2 (the next double beyond L/2 is more than half a unit in the last place
 * of 0.5 too large), and to +-1 beyond; x - n L is the expression there.
 */

#define TILE  256 /* points at a time: they, and all work arrays, stay in the nearest cache */
#define LANES 4   /* extremes kept side by side: one chain would wait for itself */
/* Up to here, in periods, x is wrapped by one turn at most; below 1.5 with room for rounding. */
#define ONE_TURN 1.25

void
hs_range_widen(const double *x, int64_t n, hs_range *range)
{
    double  lower[LANES], upper[LANES], poison[LANES];
    int64_t i = 0;
    for (int l = 0; l < LANES; l++) {
        lower[l] = INFINITY;
        upper[l] = -INFINITY;
        poison[l] = 0.0;
    }
    for (; i + LANES <= n; i += LANES) {
        for (int l = 0; l < LANES; l++) {
            const double entry = x[i + l];
            lower[l] = hs_smaller(entry, lower[l]);
            upper[l] = hs_larger(entry, upper[l]);
            poison[l] += entry - entry;
        }
    }
    for (; i < n; i++) {
        lower[0] = hs_smaller(x[i], lower[0]);
        upper[0] = hs_larger(x[i], upper[0]);
        poison[0] += x[i] - x[i];
    }
    for (int l = 0; l < LANES; l++) {
        range->lower = hs_smaller(lower[l], range->lower);
        range->upper = hs_larger(upper[l], range->upper);
        range->poison += poison[l];
    }
}

/* At most one turn each way, counted in turns unless that is NULL. Written so that compilers
 * vectorise it: 1 and 0 for true and false, and n * length instead of a branch. */
static void
fold_once(double *HS_RESTRICT x, int64_t n, double length, int32_t *HS_RESTRICT turns)
{
    const double half = 0.5 * length;
    for (int64_t i = 0; turns != NULL && i < n; i++) {
        const double above = x[i] > half ? 1.0 : 0.0;
        const double below = x[i] < -half ? 1.0 : 0.0;
        turns[i] = (int32_t)(above - below);
    }
    for (int64_t i = 0; i < n; i++) {
        const double above = x[i] > half ? 1.0 : 0.0;
        const double below = x[i] < -half ? 1.0 : 0.0;
        x[i] -= (above - below) * length;
    }
}

void
hs_fold_axis(const hs_lattice *lattice, int k, double *x, int64_t first, int64_t last,
             double largest, const hs_turns *turns, hs_wrap_range *folded)
{
    const double length = lattice->period[k];
    const int    row = lattice->row_of_axis[k];
    const bool   once = largest <= ONE_TURN * length;
    for (int64_t begin = first; begin < last; begin += TILE) {
        const int64_t n = last - begin < TILE ? last - begin : TILE;
        if (once && (turns == NULL || turns->narrow[row] != NULL)) {
            fold_once(x + begin, n, length, turns != NULL ? turns->narrow[row] + begin : NULL);
        } else {
            for (int64_t i = begin; i < begin + n; i++) {
                int64_t turned;
                x[i] = hs_wrap_axis(x[i], length, &turned);
                if (turns != NULL && turned == HS_WRAP_UNKNOWN) {
                    folded->failed = folded->failed < 0 || i < folded->failed ? i : folded->failed;
                } else if (turns != NULL) {
                    hs_turns_set(turns, row, i, turned);
                }
            }
        }
    }
}

double
hs_fold_turns(const hs_lattice *lattice, double largest)
{
    double most = 0.0, given = 0.0;
    for (int k = 0; k < lattice->ndim; k++) {
        if (lattice->row_of_axis[k] >= 0) {
            /* |t_k| <= |x|, and a turn or two for roundings and the lattice's other rows. */
            most = fmax(most, lattice->ndim * largest / lattice->period[k] + 4.0);
        }
    }
    for (int l = 0; l < lattice->n_periodic; l++) {
        double sum = 0.0;
        for (int r = 0; r < lattice->n_periodic; r++) {
            sum += most * fabs((double)lattice->U[r][l]);
        }
        given = fmax(given, sum);
    }
    return fmax(most, given);
}

/* The first three terms at once: most scenes have no more dimensions. */
void
hs_fold_coordinates(const hs_lattice *lattice, int k, const double *const *x, int64_t n,
                    double *HS_RESTRICT t)
{
    const double *normal = lattice->normal[k];
    if (lattice->ndim >= 3) {
        const double              a = normal[0], b = normal[1], c = normal[2];
        const double *HS_RESTRICT x0 = x[0], *HS_RESTRICT x1 = x[1], *HS_RESTRICT x2 = x[2];
        for (int64_t i = 0; i < n; i++) {
            t[i] = 0.0 + a * x0[i] + b * x1[i] + c * x2[i];
        }
    } else {
        const double              a = normal[0], b = lattice->ndim > 1 ? normal[1] : 0.0;
        const double *HS_RESTRICT x0 = x[0], *HS_RESTRICT x1 = x[lattice->ndim - 1];
        for (int64_t i = 0; i < n; i++) {
            t[i] = 0.0 + a * x0[i] + b * x1[i];
        }
    }
    for (int c = 3; c < lattice->ndim; c++) {
        const double *HS_RESTRICT from = x[c];
        const double              factor = normal[c];
        for (int64_t i = 0; i < n; i++) {
            t[i] += factor * from[i];
        }
    }
}

/*
 * Columns of points into a box of any shape, hs_fold_points. A tile of points at a time, without
 * branches.
 *
 * Why the bits are those of hs_wrap_point: the steps are those of its first pass. With so few turns
 * the products by the leading part of the turns vanish, and the splitting of the turns is trivial;
 * a vanishing product changes nothing but the sign of a zero, which adding `low`, never -0, takes
 * away again. A tile with a point that may need a second pass goes through hs_wrap_point.
 */

/* Adding and subtracting this rounds any |x| < 2^51 to an integer, ties to even, as rint() does. */
#define ROUNDER 0x1.8p52
/* Turns over a given box vector up to which the products are exact, with much room. */
#define FEW_TURNS 0x1p20

/* Work arrays of one tile. */
typedef struct tile {
    int    n;
    double inside[HS_MAX_DIM][TILE];
    double given[HS_MAX_DIM][TILE];  /* turns over the given box vectors, as doubles */
    double turned[HS_MAX_DIM][TILE]; /* turns over B */
    double moved[TILE];              /* 0 where no turn is needed */
    double t[TILE], sum[TILE], low[TILE], absolute[TILE];
} tile;

static void
count_turns(const hs_lattice *lattice, const double *const *x, tile *work)
{
    double *HS_RESTRICT moved = work->moved;
    for (int i = 0; i < work->n; i++) {
        moved[i] = 0.0;
    }
    for (int k = 0; k < lattice->ndim; k++) {
        const int row = lattice->row_of_axis[k];
        if (row < 0) {
            continue;
        }
        double *HS_RESTRICT turned = work->turned[row];
        const double        period = lattice->period[k];
        hs_fold_coordinates(lattice, k, x, work->n, work->t);
        for (int i = 0; i < work->n; i++) {
            turned[i] = (work->t[i] / period + ROUNDER) - ROUNDER;
            moved[i] += fabs(turned[i]);
        }
    }
    for (int l = 0; l < lattice->n_periodic; l++) {
        double *HS_RESTRICT given = work->given[l];
        for (int i = 0; i < work->n; i++) {
            given[i] = 0.0;
        }
        for (int r = 0; r < lattice->n_periodic; r++) {
            const double factor = (double)lattice->U[r][l];
            for (int i = 0; factor != 0.0 && i < work->n; i++) {
                given[i] += factor * work->turned[r][i];
            }
        }
    }
}

/* By the steps of hs_wrap_by. With less than 2^26 turns products with Veltkamp's halves of an entry
 * are exact. */
static void
move_inside(const hs_lattice *lattice, int k, const double *HS_RESTRICT x, tile *work,
            hs_wrap_range *folded)
{
    double *HS_RESTRICT inside = work->inside[k], *HS_RESTRICT sum = work->sum;
    double *HS_RESTRICT low = work->low, *HS_RESTRICT absolute = work->absolute;
    for (int i = 0; i < work->n; i++) {
        sum[i] = x[i];
        low[i] = 0.0;
        absolute[i] = fabs(x[i]);
    }
    for (int l = 0; l < lattice->n_periodic; l++) {
        const double *HS_RESTRICT given = work->given[l];
        const double              entry = lattice->scaled[l][k], scaled = 0x1.0000002p27 * entry;
        const double high_part = scaled - (scaled - entry), low_part = entry - high_part;
        for (int i = 0; entry != 0.0 && i < work->n; i++) {
            const double factor = -given[i], product = factor * entry;
            const double error = (factor * high_part - product) + factor * low_part;
            const hs_dw  partial = hs_two_sum(sum[i], product);
            sum[i] = partial.hi;
            low[i] += partial.lo + error;
            absolute[i] += fabs(product);
        }
    }
    for (int i = 0; i < work->n; i++) {
        inside[i] = sum[i] + low[i];
    }
    for (int i = 0; i < work->n; i++) { /* a point that stays keeps its -0; no branch this way */
        const double given = x[i], moved = inside[i];
        inside[i] = work->moved[i] != 0.0 ? moved : given;
    }
    hs_range range = HS_NO_RANGE;
    hs_range_widen(absolute, work->n, &range);
    folded->magnitude = hs_larger(range.upper, folded->magnitude);
}

/* Ranges of the coordinates t_k of the points inside, joined to *folded. Returns whether along any
 * periodic axis one of them is beyond its faces. */
static bool
find_ranges(const hs_lattice *lattice, tile *work, hs_wrap_range *folded)
{
    const double *inside[HS_MAX_DIM];
    bool          beyond = false;
    for (int k = 0; k < lattice->ndim; k++) {
        inside[k] = work->inside[k];
    }
    for (int k = 0; k < lattice->ndim; k++) {
        hs_range t = HS_NO_RANGE, x = HS_NO_RANGE;
        hs_fold_coordinates(lattice, k, inside, work->n, work->t);
        hs_range_widen(work->t, work->n, &t);
        hs_range_widen(inside[k], work->n, &x);
        folded->lower[k] = hs_smaller(t.lower, folded->lower[k]);
        folded->upper[k] = hs_larger(t.upper, folded->upper[k]);
        folded->x_largest[k] = hs_larger(hs_larger(-x.lower, x.upper), folded->x_largest[k]);
        const double half = 0.5 * lattice->period[k];
        beyond = beyond || (lattice->row_of_axis[k] >= 0 && !(t.lower >= -half && t.upper <= half));
    }
    return beyond;
}

void
hs_fold_points(const hs_lattice *lattice, double *const *r, int64_t first, int64_t last,
               double *const *x, const hs_turns *turns, hs_wrap_range *folded)
{
    tile   work;
    double largest = 1.0; /* of U: one turn over B makes at most so many over a given vector */
    for (int row = 0; row < lattice->n_periodic; row++) {
        for (int l = 0; l < lattice->n_periodic; l++) {
            largest = fmax(largest, fabs((double)lattice->U[row][l]));
        }
    }
    const double most = FEW_TURNS / largest;
    for (int64_t begin = first; begin < last; begin += TILE) {
        const double *from[HS_MAX_DIM];
        hs_wrap_range found = *folded;
        work.n = (int)(last - begin < TILE ? last - begin : TILE);
        for (int k = 0; k < lattice->ndim; k++) {
            from[k] = r[k] + begin;
        }
        count_turns(lattice, from, &work);
        int many = 0; /* turns of a point, over all rows of B together */
        for (int i = 0; i < work.n; i++) {
            many |= !(work.moved[i] <= most); /* also where overflow has left no number */
        }
        for (int k = 0; !many && k < lattice->ndim; k++) {
            move_inside(lattice, k, from[k], &work, &found);
        }
        const bool one_by_one = many || find_ranges(lattice, &work, &found);
        for (int i = 0; one_by_one && i < work.n; i++) {
            double  point[HS_MAX_DIM], inside[HS_MAX_DIM];
            int64_t turned[HS_MAX_DIM];
            for (int k = 0; k < lattice->ndim; k++) {
                point[k] = from[k][i];
            }
            if (!hs_wrap_point(lattice, point, inside, turned, &folded->magnitude)) {
                folded->failed = begin + i;
                return;
            }
            for (int k = 0; k < lattice->ndim; k++) {
                work.inside[k][i] = inside[k];
            }
            for (int row = 0; row < lattice->n_periodic; row++) {
                hs_turns_set(turns, row, begin + i, turned[row]);
            }
        }
        if (one_by_one) {
            (void)find_ranges(lattice, &work, folded);
        } else {
            *folded = found;
        }
        for (int row = 0; row < lattice->n_periodic && !one_by_one; row++) {
            for (int i = 0; i < work.n; i++) {
                hs_turns_set(turns, row, begin + i, (int64_t)work.turned[row][i]);
            }
        }
        for (int k = 0; k < lattice->ndim; k++) {
            memcpy(x[k] + begin, work.inside[k], (size_t)work.n * sizeof(double));
        }
    }
}

/* Along coordinate axes each axis by itself; else all images within the distance of one that is
 * near, coordinate by coordinate (Fincke and Pohst, Math. Comp. 44 (1985) 463). */

#define UNIT 0x1p-53
/* Fractions of a period this close to a half are compared exactly; they are known to 2^-50. */
#define HALF_SLACK 0x1p-40
/* 2^8 images are equally near in 8 dimensions; others are within rounding of these. */
#define MOST_IMAGES 1024
/* Milliseconds; a pair takes one or two microseconds in three dimensions, some twenty at worst in
 * eight, which is why none is polled for. */
#define MOST_STEPS 0x100000
/* Coordinates beyond this are too many periods away in any box that is not refused. */
#define MOST_SCALED 0x1p500
/* Squares of shorter rows, the longest being 1, would be lost. */
#define LEAST_ROW 0x1p-400
/* Of wrapping, relative to its terms: hs_wrap_point. */
#define WRAP_ERROR 0x1p-94
/* More than the rows that make an image of a wrapped point, in number of times of each. */
#define MOST_TIMES 0x1p10

/* Images that may be the nearest, as shifts over B between the wrapped points. */
typedef struct image_list {
    const hs_image_box *box;
    double              y[HS_MAX_DIM]; /* from p to q, wrapped, along the unit vectors */
    double              slack;         /* twice the error of a length */
    double              limit;         /* lengths beyond this are not the least */
    int64_t             steps;
    int                 n;
    bool                is_kept; /* images are listed: the limit is known */
    bool                is_full;
    int8_t              shift[MOST_IMAGES][HS_MAX_DIM];
} image_list;

hs_status
hs_image_box_init(const hs_box *box, int ndim, hs_image_box *to)
{
    const hs_lattice *lattice = &to->lattice;
    double            largest = 0.0;
    memset(to, 0, sizeof *to);
    for (int r = 0; r < HS_MAX_DIM; r++) {
        to->order[r] = r;
    }
    for (int l = 0; box != NULL && l < ndim; l++) {
        for (int k = 0; box->periodic[l] && k < ndim; k++) {
            largest = hs_larger(fabs(box->rows[l][k]), largest);
        }
    }
    /* Along coordinate axes nothing overflows, and no digit may be lost. */
    to->scale = hs_scale_of(0);
    hs_lattice_init(box, ndim, to->scale, &to->lattice);
    if (!lattice->aligned) {
        to->scale = hs_scale_of(ilogb(largest));
        hs_lattice_init(box, ndim, to->scale, &to->lattice);
    }
    hs_metric_init(&to->metric, ndim, lattice->n_periodic,
                   (const double(*)[HS_MAX_DIM])lattice->given, 1.0, true);
    if (lattice->aligned) {
        return HS_OK;
    }
    if (hs_skew_is_left(lattice)) {
        return HS_ERR_BOX_SKEWED;
    }
    /* Unit vectors along the rows, the longest last: images are listed along long rows first, for
     * along short ones few are then left. */
    const int m = lattice->n_periodic;
    double    least = 1.0, whole[HS_MAX_DIM];
    for (int r = 0; r < m; r++) {
        double square = 0.0;
        int    at = r;
        for (int c = 0; c < ndim; c++) {
            square += lattice->rows[r][c] * lattice->rows[r][c];
        }
        whole[r] = sqrt(square);
        for (; at > 0 && whole[to->order[at - 1]] > whole[r]; at--) {
            to->order[at] = to->order[at - 1];
        }
        to->order[at] = r;
    }
    hs_orthogonal_rows((const double(*)[HS_MAX_DIM])lattice->rows, to->order, m, ndim, to->along,
                       to->R);
    for (int r = 0; r < m; r++) {
        const int row = to->order[r];
        if (!(whole[row] >= LEAST_ROW)) {
            return HS_ERR_BOX_SKEWED;
        }
        least = hs_smaller(to->R[r][r] / whole[row], least);
        for (int c = 0; c < ndim; c++) {
            to->is_spanned[c] = to->is_spanned[c] || lattice->rows[row][c] != 0.0;
        }
        to->row_error += MOST_TIMES * ndim * lattice->row_error[r];
    }
    to->rounding = 16.0 * UNIT * ndim * m / least;
    return HS_OK;
}

/* Shifts along rows r, r - 1, ..., 0, for those along the others; `square` is that of the parts
 * along unit vectors beyond r. */
static void
list_images(image_list *list, int r, int8_t *shift, double square)
{
    const hs_image_box *box = list->box;
    const int           m = box->lattice.n_periodic;
    double              part = list->y[r];
    for (int l = r + 1; l < m; l++) {
        part += shift[l] * box->R[l][r];
    }
    const double height = box->R[r][r];
    const double centre = -part / height, middle = rint(centre);
    const double side = centre < middle ? -1.0 : 1.0;
    /* The nearest first, then on alternating sides: distances ascend. */
    for (int step = 0;; step++) {
        const double turn = step % 2 ? side * ((step + 1) / 2) : -side * (step / 2);
        const double times = middle + turn;
        const double z = part + times * height;
        const double length = sqrt(square + z * z);
        if (!(length <= list->limit) || list->is_full) {
            return;
        }
        if (!(fabs(times) <= INT8_MAX) || ++list->steps > MOST_STEPS) {
            list->is_full = true;
            return;
        }
        shift[r] = (int8_t)times;
        if (r > 0) {
            list_images(list, r - 1, shift, square + z * z);
        } else if (!list->is_kept) {
            list->limit = hs_smaller(length + list->slack, list->limit);
        } else if (list->n < MOST_IMAGES) {
            memcpy(list->shift[list->n++], shift, sizeof list->shift[0]);
        } else {
            list->is_full = true;
        }
    }
}

/* Images of wrapped points that may be the nearest. magnitude: of wrapping both. */
static hs_status
find_images(image_list *list, const double *p, const double *q, double magnitude)
{
    const hs_image_box *box = list->box;
    const int           d = box->lattice.ndim, m = box->lattice.n_periodic;
    int8_t              shift[HS_MAX_DIM] = {0};
    double              terms = 0.0;
    memset(list->y, 0, sizeof list->y);
    for (int c = 0; c < d; c++) {
        if (box->is_spanned[c]) { /* others are at right angles to all rows */
            terms += fabs(p[c]) + fabs(q[c]);
            for (int k = 0; k < m; k++) {
                list->y[k] += box->along[k][c] * (q[c] - p[c]);
            }
        }
    }
    const double longest = HS_MAX_DIM * 2.0 * MOST_TIMES * UNIT; /* what is added to y */
    /* INT8_MAX: of a row, as R has it, as many times as an image may have it */
    list->slack = 2.0 * HS_MAX_DIM *
                  (box->rounding * (terms + INT8_MAX) + longest + box->row_error +
                   2.0 * WRAP_ERROR * magnitude);
    list->limit = INFINITY;
    list->n = 0;
    list->steps = 0;
    list->is_full = false;
    for (int pass = 0; pass < 2; pass++) { /* how near is the nearest? which are as near? */
        list->is_kept = pass == 1;
        list_images(list, m - 1, shift, 0.0);
    }
    return list->is_full ? HS_ERR_BOX_SKEWED : HS_OK;
}

/* In an aligned lattice: each axis has one image, or two. */
static void
find_along_axes(image_list *list, const double *p, const double *q)
{
    const hs_lattice *lattice = &list->box->lattice;
    memset(list->shift[0], 0, sizeof list->shift[0]);
    list->n = 1;
    for (int k = 0; k < lattice->ndim; k++) {
        const int r = lattice->row_of_axis[k];
        if (r < 0) {
            continue;
        }
        const double t = (p[k] - q[k]) / lattice->period[k];
        const double whole = rint(t), rest = t - whole;
        const int    n = list->n;
        for (int e = 0; e < n; e++) {
            list->shift[e][r] = (int8_t)whole;
            if (fabs(rest) > 0.5 - HALF_SLACK) {
                memcpy(list->shift[list->n], list->shift[e], sizeof list->shift[e]);
                list->shift[list->n++][r] = (int8_t)(whole + (rest < 0.0 ? -1.0 : 1.0));
            }
        }
    }
}

/* Wraps a point as given; turns over B. Coordinates at right angles to all rows are left out. */
static bool
wrap(const hs_image_box *box, const double *x, double *inside, int64_t *turns, double *magnitude)
{
    const hs_lattice *lattice = &box->lattice;
    double            scaled[HS_MAX_DIM];
    for (int k = 0; k < lattice->ndim; k++) {
        const int r = lattice->row_of_axis[k];
        scaled[k] = hs_scale_apply(box->scale, x[k]);
        if (lattice->aligned && r >= 0) {
            inside[k] = hs_wrap_axis(scaled[k], lattice->period[k], &turns[r]);
            if (turns[r] == HS_WRAP_UNKNOWN) {
                return false;
            }
        }
        scaled[k] = box->is_spanned[k] ? scaled[k] : 0.0;
        if (!(fabs(scaled[k]) <= MOST_SCALED)) {
            return false;
        }
    }
    return lattice->aligned || hs_wrap_point(lattice, scaled, inside, turns, magnitude);
}

hs_status
hs_near_image(const hs_image_box *box, const double *p, const double *q, int64_t *shift)
{
    const int  m = box->lattice.n_periodic;
    image_list list;
    double     inside[2][HS_MAX_DIM], magnitude = 0.0;
    int64_t    turns[2][HS_MAX_DIM];
    list.box = box;
    if (!wrap(box, p, inside[0], turns[0], &magnitude) ||
        !wrap(box, q, inside[1], turns[1], &magnitude)) {
        return HS_ERR_SHIFT_RANGE;
    }
    hs_status status = HS_OK;
    if (box->lattice.aligned) {
        find_along_axes(&list, inside[0], inside[1]);
    } else {
        status = find_images(&list, inside[0], inside[1], magnitude);
    }
    for (int r = 0; r < m; r++) {
        turns[0][r] -= turns[1][r];
    }
    for (int e = 0; status == HS_OK && e < list.n; e++) {
        int64_t   over[HS_MAX_DIM], other[HS_MAX_DIM]; /* S of the image, over B and as given */
        hs_stages stages = {0};
        for (int r = 0; r < m; r++) {
            over[box->order[r]] = turns[0][box->order[r]] + list.shift[e][r];
        }
        if (!hs_lattice_shift(&box->lattice, over, other)) {
            return HS_ERR_SHIFT_RANGE;
        }
        const hs_span spans[2] = {{p, q, shift}, {p, q, other}};
        const int sign = e > 0 ? hs_metric_compare(&box->metric, &spans[0], &spans[1], &stages) : 1;
        int       l = 0; /* where two that are equally near differ */
        while (sign == 0 && l < m - 1 && other[l] == shift[l]) {
            l++;
        }
        if (sign > 0 || (sign == 0 && other[l] < shift[l])) {
            memcpy(shift, other, (size_t)m * sizeof *shift);
        }
    }
    return status;
}
