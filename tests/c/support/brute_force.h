/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * brute_force.h: every pair within the cutoff, the plain way: each pair of points in each image
 * that could be near. Plain numbers settle what is far from the cutoff by millions of roundings,
 * big integers the rest. Shares nothing with the library but the types of halfshell.h.
 */
#ifndef HS_BRUTE_FORCE_H
#define HS_BRUTE_FORCE_H

#include <float.h>
#include <stdbool.h>
#include <stdlib.h>

#include "../../../csrc/halfshell.h"
#include "bigint.h"

typedef struct brute_scene {
    int           ndim;
    int64_t       n;
    const double *x;   /* n * ndim, row-major */
    const hs_box *box; /* NULL: open space */
    double        cutoff;
    bool          inclusive;
} brute_scene;

typedef struct brute_pair {
    int32_t i, j;
    int64_t shift[HS_MAX_DIM]; /* one per box vector, 0 where it does not repeat */
} brute_pair;

typedef struct brute_list {
    brute_pair *pairs; /* ascending by (i, j, S); free with brute_free */
    int64_t     n, capacity;
    double      farthest; /* largest |S| of the images that were looked at */
} brute_list;

/* The periodic rows, and the dual vectors that say which images can be near. */
typedef struct brute_rows {
    int         m;
    int         axis[HS_MAX_DIM];
    double      rows[HS_MAX_DIM][HS_MAX_DIM];
    long double dual[HS_MAX_DIM][HS_MAX_DIM];
    long double dual_length[HS_MAX_DIM];
    long double uncertainty; /* relative, of the dual vectors */
} brute_rows;

TRUTH long double
brute_dot(int ndim, const long double *a, const long double *b)
{
    long double sum = 0.0L;
    for (int k = 0; k < ndim; k++)
        sum += a[k] * b[k];
    return sum;
}

/* Remove the directions of n orthonormal vectors from v; returns what is left of its length. */
TRUTH long double
brute_project(int ndim, int n, long double basis[][HS_MAX_DIM], long double *v)
{
    for (int pass = 0; pass < 2; pass++) {
        for (int b = 0; b < n; b++) {
            const long double along = brute_dot(ndim, v, basis[b]);
            for (int k = 0; k < ndim; k++)
                v[k] -= along * basis[b][k];
        }
    }
    return sqrtl(brute_dot(ndim, v, v));
}

/* v = row * 2^-exponent, with a largest entry of about 1. */
TRUTH int
brute_unit_row(int ndim, const double *row, long double *v)
{
    double largest = 0.0;
    int    exponent;
    for (int k = 0; k < ndim; k++)
        largest = fmax(largest, fabs(row[k]));
    (void)frexp(largest, &exponent);
    for (int k = 0; k < ndim; k++)
        v[k] = ldexpl((long double)row[k], -exponent);
    return exponent;
}

/* False where plain numbers cannot tell the duals: rows that are dependent or nearly so. */
TRUTH bool
brute_prepare(const brute_scene *scene, brute_rows *r)
{
    const int   d = scene->ndim;
    long double worst = 1.0L;
    r->m = 0;
    for (int l = 0; scene->box != NULL && l < d; l++) {
        if (scene->box->periodic[l]) {
            memcpy(r->rows[r->m], scene->box->rows[l], sizeof r->rows[0]);
            r->axis[r->m++] = l;
        }
    }
    for (int l = 0; l < r->m; l++) {
        long double basis[HS_MAX_DIM][HS_MAX_DIM];
        int         n = 0, exponent = 0;
        /* Row l comes last: what the others leave of it is its dual's direction. */
        for (int turn = 0; turn < r->m; turn++) {
            exponent = brute_unit_row(d, r->rows[(l + 1 + turn) % r->m], basis[n]);
            const long double left = brute_project(d, n, basis, basis[n]);
            worst = left < worst ? left : worst;
            if (!(left > 1e-9L))
                return false;
            for (int k = 0; k < d; k++)
                basis[n][k] /= left;
            if (++n == r->m) {
                r->dual_length[l] = ldexpl(1.0L / left, -exponent);
                for (int k = 0; k < d; k++)
                    r->dual[l][k] = basis[n - 1][k] * r->dual_length[l];
            }
        }
        if (!(r->dual_length[l] < LDBL_MAX))
            return false;
    }
    r->uncertainty = 1024.0L * LDBL_EPSILON / (worst * worst);
    return true;
}

/* Sign of |D|^2 - cutoff^2. */
TRUTH int
brute_sign_exact(const brute_scene *scene, const brute_rows *r, const double *p, const double *q,
                 const int64_t *shift)
{
    const big cutoff = big_from_double(scene->cutoff);
    const big square = big_square(scene->ndim, r->m, (const double(*)[8])r->rows, p, q, shift);
    return big_compare(square, big_product(cutoff, cutoff));
}

/* The same, where it can in plain numbers: then D is not within 2^-40 of a tie. */
TRUTH int
brute_sign(const brute_scene *scene, const brute_rows *r, const double *p, const double *q,
           const int64_t *shift)
{
    const long double limit = (long double)scene->cutoff * scene->cutoff;
    long double       square = 0.0L, sizes = limit;
    for (int k = 0; k < scene->ndim; k++) {
        long double along = (long double)q[k] - p[k], size = fabsl((long double)q[k]) + fabs(p[k]);
        for (int l = 0; l < r->m; l++) {
            const long double moved = (long double)shift[l] * r->rows[l][k];
            along += moved;
            size += fabsl(moved);
        }
        square += along * along;
        sizes += size * size;
    }
    const long double slack = 0x1p-40L * sizes;
    if (slack > LDBL_MIN * 0x1p100L && slack < LDBL_MAX) {
        if (square - limit > slack)
            return 1;
        if (limit - square > slack)
            return -1;
    }
    return brute_sign_exact(scene, r, p, q, shift);
}

TRUTH void
brute_add(brute_list *list, const brute_rows *r, int32_t i, int32_t j, const int64_t *shift)
{
    if (list->n == list->capacity) {
        list->capacity = list->capacity == 0 ? 64 : 2 * list->capacity;
        list->pairs = realloc(list->pairs, (size_t)list->capacity * sizeof *list->pairs);
        if (list->pairs == NULL)
            abort();
    }
    brute_pair *pair = &list->pairs[list->n++];
    memset(pair, 0, sizeof *pair);
    pair->i = i;
    pair->j = j;
    for (int l = 0; l < r->m; l++)
        pair->shift[r->axis[l]] = shift[l];
}

/* Images of j that can be near i. False when plain numbers cannot count them within the budget. */
TRUTH bool
brute_range(const brute_scene *scene, const brute_rows *r, const double *p, const double *q,
            int64_t *low, int64_t *high, double *images)
{
    long double delta[HS_MAX_DIM];
    for (int k = 0; k < scene->ndim; k++)
        delta[k] = (long double)q[k] - p[k];
    const long double apart = sqrtl(brute_dot(scene->ndim, delta, delta));
    *images = 1.0;
    for (int l = 0; l < r->m; l++) {
        const long double centre = -brute_dot(scene->ndim, r->dual[l], delta);
        const long double most = (apart + scene->cutoff) * r->dual_length[l];
        const long double half = scene->cutoff * r->dual_length[l] + 1e-6L + r->uncertainty * most;
        if (!(most < 0x1p60L))
            return false;
        low[l] = (int64_t)ceill(centre - half);
        high[l] = (int64_t)floorl(centre + half);
        *images *= high[l] < low[l] ? 0.0 : (double)(high[l] - low[l]) + 1.0;
    }
    return true;
}

/* The half list: (i, j, S) and not also (j, i, -S). */
TRUTH bool
brute_is_forward(int32_t i, int32_t j, int m, const int64_t *shift)
{
    for (int l = 0; i == j && l < m; l++) {
        if (shift[l] != 0)
            return shift[l] > 0;
    }
    return i < j;
}

TRUTH void
brute_images(const brute_scene *scene, const brute_rows *r, int32_t i, int32_t j,
             const int64_t *low, const int64_t *high, brute_list *list)
{
    const double *p = scene->x + (int64_t)i * scene->ndim, *q = scene->x + (int64_t)j * scene->ndim;
    int64_t       shift[HS_MAX_DIM];
    memcpy(shift, low, sizeof shift);
    for (int l = 0; l < r->m; l++)
        list->farthest = fmax(list->farthest, fmax(fabs((double)low[l]), fabs((double)high[l])));
    for (;;) {
        if (brute_is_forward(i, j, r->m, shift)) {
            const int sign = brute_sign(scene, r, p, q, shift);
            if (sign < 0 || (sign == 0 && scene->inclusive))
                brute_add(list, r, i, j, shift);
        }
        int l = r->m - 1;
        while (l >= 0 && shift[l] == high[l]) {
            shift[l] = low[l];
            l--;
        }
        if (l < 0)
            return;
        shift[l]++;
    }
}

TRUTH int
brute_order(const void *a, const void *b)
{
    const brute_pair *p = a, *q = b;
    if (p->i != q->i)
        return p->i < q->i ? -1 : 1;
    if (p->j != q->j)
        return p->j < q->j ? -1 : 1;
    for (int l = 0; l < HS_MAX_DIM; l++) {
        if (p->shift[l] != q->shift[l])
            return p->shift[l] < q->shift[l] ? -1 : 1;
    }
    return 0;
}

TRUTH void
brute_free(brute_list *list)
{
    free(list->pairs);
    memset(list, 0, sizeof *list);
}

/*
 * All pairs, ascending. False, with an empty list, when that would take more than `budget` tests,
 * or when plain numbers cannot tell which images to test.
 */
TRUTH bool
brute_find(const brute_scene *scene, double budget, brute_list *list)
{
    brute_rows r;
    double     work = 0.0;
    memset(list, 0, sizeof *list);
    if (!brute_prepare(scene, &r))
        return false;
    for (int64_t i = 0; i < scene->n; i++) {
        for (int64_t j = i; j < scene->n; j++) {
            int64_t       low[HS_MAX_DIM] = {0}, high[HS_MAX_DIM] = {0};
            double        images;
            const double *p = scene->x + i * scene->ndim, *q = scene->x + j * scene->ndim;
            if (!brute_range(scene, &r, p, q, low, high, &images) ||
                (work += images + 1.0) > budget) {
                brute_free(list);
                return false;
            }
            if (images > 0.0)
                brute_images(scene, &r, (int32_t)i, (int32_t)j, low, high, list);
        }
    }
    if (list->n > 1)
        qsort(list->pairs, (size_t)list->n, sizeof *list->pairs, brute_order);
    return true;
}

#endif
