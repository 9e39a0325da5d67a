/* SPDX-License-Identifier: BSD-3-Clause */
/* near_image.c: along coordinate axes each axis by itself; else all images within the distance of
 * one that is near, coordinate by coordinate (Fincke and Pohst, Math. Comp. 44 (1985) 463). */
#include "near_image.h"

#include "wrap.h"

#include <math.h>
#include <string.h>

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

static double
length_of(const double *x, int n)
{
    double square = 0.0;
    for (int k = 0; k < n; k++) {
        square += x[k] * x[k];
    }
    return sqrt(square);
}

/* Images are listed along long rows first: along short ones few are then left. */
static void
sort_rows(hs_image_box *to)
{
    const hs_lattice *lattice = &to->lattice;
    for (int r = 1; r < lattice->n_periodic; r++) {
        const int    row = to->order[r];
        const double length = length_of(lattice->rows[row], lattice->ndim);
        int          at = r;
        while (at > 0 && length_of(lattice->rows[to->order[at - 1]], lattice->ndim) > length) {
            to->order[at] = to->order[at - 1];
            at--;
        }
        to->order[at] = row;
    }
}

/* Gram and Schmidt, twice, so that the unit vectors are at right angles to rounding. */
static hs_status
set_unit_vectors(hs_image_box *to)
{
    const hs_lattice *lattice = &to->lattice;
    const int         d = lattice->ndim, m = lattice->n_periodic;
    double            least = 1.0;
    sort_rows(to);
    for (int r = 0; r < m; r++) {
        double       *unit = to->along[r];
        const double *row = lattice->rows[to->order[r]];
        const double  whole = length_of(row, d);
        memcpy(unit, row, (size_t)d * sizeof *row);
        for (int pass = 0; pass < 2; pass++) {
            for (int k = 0; k < r; k++) {
                double part = 0.0;
                for (int c = 0; c < d; c++) {
                    part += unit[c] * to->along[k][c];
                }
                to->R[r][k] += part;
                for (int c = 0; c < d; c++) {
                    unit[c] -= part * to->along[k][c];
                }
            }
        }
        const double height = length_of(unit, d);
        to->R[r][r] = height;
        if (!(whole >= LEAST_ROW)) {
            return HS_ERR_BOX_SKEWED;
        }
        least = hs_smaller(height / whole, least);
        for (int c = 0; c < d; c++) {
            unit[c] /= height;
            to->is_spanned[c] = to->is_spanned[c] || row[c] != 0.0;
        }
        to->row_error += MOST_TIMES * d * lattice->row_error[r];
    }
    to->rounding = 16.0 * UNIT * d * m / least;
    return HS_OK;
}

/* Whether scaling has lost nothing. */
static bool
keeps_digits(const hs_lattice *lattice, hs_scale scale)
{
    const hs_scale back = hs_scale_of(-scale.exponent);
    bool           same = true;
    for (int r = 0; r < lattice->n_periodic; r++) {
        for (int k = 0; k < lattice->ndim; k++) {
            same = same && hs_scale_apply(back, lattice->scaled[r][k]) == lattice->given[r][k];
        }
    }
    return same;
}

hs_status
hs_image_box_init(const hs_box *box, int ndim, hs_image_box *to)
{
    double largest = 0.0;
    memset(to, 0, sizeof *to);
    for (int r = 0; r < HS_MAX_DIM; r++) {
        to->order[r] = r;
    }
    for (int l = 0; box != NULL && l < ndim; l++) {
        for (int k = 0; box->periodic[l] && k < ndim; k++) {
            largest = hs_larger(fabs(box->rows[l][k]), largest);
        }
    }
    /* Along coordinate axes as they are given nothing overflows, and no digit may be lost. */
    to->scale = hs_scale_of(0);
    hs_lattice_init(box, ndim, to->scale, &to->lattice);
    if (!to->lattice.aligned || to->lattice.reduced) {
        to->scale = hs_scale_of(ilogb(largest));
        hs_lattice_init(box, ndim, to->scale, &to->lattice);
    }
    hs_metric_init(&to->metric, ndim, to->lattice.n_periodic,
                   (const double(*)[HS_MAX_DIM])to->lattice.given, 1.0, true);
    if (to->lattice.aligned) {
        return keeps_digits(&to->lattice, to->scale) ? HS_OK : HS_ERR_BOX_SKEWED;
    }
    return hs_skew_is_left(&to->lattice) ? HS_ERR_BOX_SKEWED : set_unit_vectors(to);
}

static void
add_image(image_list *list, const int8_t *shift, double length)
{
    if (!list->is_kept) {
        list->limit = hs_smaller(length + list->slack, list->limit);
    } else if (list->n < MOST_IMAGES) {
        memcpy(list->shift[list->n++], shift, sizeof list->shift[0]);
    } else {
        list->is_full = true;
    }
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
        } else {
            add_image(list, shift, length);
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

static bool
is_less(const int64_t *one, const int64_t *other, int n)
{
    int l = 0;
    while (l < n - 1 && one[l] == other[l]) {
        l++;
    }
    return one[l] < other[l];
}

/* S of image e; false when it passes 2^62. */
static bool
shift_of(const image_list *list, int e, const int64_t *from, int64_t *shift)
{
    const hs_lattice *lattice = &list->box->lattice;
    int64_t           over[HS_MAX_DIM];
    for (int r = 0; r < lattice->n_periodic; r++) {
        const int row = list->box->order[r];
        over[row] = from[row] + list->shift[e][r];
    }
    return hs_lattice_shift(lattice, over, shift);
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
        int64_t   other[HS_MAX_DIM];
        hs_stages stages = {0};
        if (!shift_of(&list, e, turns[0], other)) {
            return HS_ERR_SHIFT_RANGE;
        }
        const hs_span spans[2] = {{p, q, shift}, {p, q, other}};
        const int sign = e > 0 ? hs_metric_compare(&box->metric, &spans[0], &spans[1], &stages) : 1;
        if (sign > 0 || (sign == 0 && is_less(other, shift, m))) {
            memcpy(shift, other, (size_t)m * sizeof *shift);
        }
    }
    return status;
}
