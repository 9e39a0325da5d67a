/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * lattice.c: a short basis of the box vectors, and a unit normal for each grid axis.
 *
 * Normals and heights need not be accurate, only consistent: whatever unit vector `normal[k]`
 * is, |normal[k] . D| <= |D| holds, and grid.c measures how far a lattice vector moves a grid
 * coordinate that it should not move. A bad normal makes cells wider, never an answer wrong.
 */
#include "lattice.h"

#include "box_check.h"
#include "lattice_reduce.h"

#include <math.h>
#include <string.h>

hs_scale
hs_scale_of(int exponent)
{
    if (exponent == 0) { /* as it nearly always is */
        return (hs_scale){0, 1.0, 1.0};
    }
    const int half = exponent / 2;
    return (hs_scale){exponent, hs_power_of_two(-half), hs_power_of_two(half - exponent)};
}

static int
collect_periodic_rows(const hs_box *box, double rows[][HS_MAX_DIM], int *vector_of_row)
{
    int n_periodic = 0;
    for (int l = 0; l < box->ndim; l++) {
        if (box->periodic[l]) {
            memcpy(rows[n_periodic], box->rows[l], (size_t)box->ndim * sizeof(double));
            vector_of_row[n_periodic++] = l;
        }
    }
    return n_periodic;
}

/* If every row has one nonzero entry, in its own column: column[r] says where. */
static bool
rows_are_aligned(int ndim, int n_rows, const double rows[][HS_MAX_DIM], int *column)
{
    unsigned used = 0;
    for (int r = 0; r < n_rows; r++) {
        column[r] = -1;
        for (int k = 0; k < ndim; k++) {
            if (rows[r][k] != 0.0) {
                if (column[r] >= 0) {
                    return false;
                }
                column[r] = k;
            }
        }
        if (column[r] < 0 || (used >> column[r] & 1u)) {
            return false;
        }
        used |= 1u << column[r];
    }
    return true;
}

hs_status
hs_box_check(const hs_box *box, hs_failure *failure)
{
    double rows[HS_MAX_DIM][HS_MAX_DIM];
    int    vector_of_row[HS_MAX_DIM], column[HS_MAX_DIM];
    if (box == NULL) {
        return HS_OK;
    }
    for (int l = 0; l < box->ndim; l++) {
        for (int k = 0; k < box->ndim; k++) {
            if (!isfinite(box->rows[l][k])) {
                failure->row = l;
                failure->column = k;
                failure->value = box->rows[l][k];
                return HS_ERR_BOX_FINITE;
            }
        }
    }
    const int n_periodic = collect_periodic_rows(box, rows, vector_of_row);
    if (rows_are_aligned(box->ndim, n_periodic, rows, column) ||
        hs_rows_independent(box->ndim, n_periodic, rows)) {
        return HS_OK;
    }
    const int zero = hs_zero_row(box->ndim, n_periodic, rows);
    failure->row = zero < n_periodic ? vector_of_row[zero] : -1;
    return HS_ERR_BOX_DEPENDENT;
}

static double
dot(int ndim, const double *a, const double *b)
{
    double sum = 0.0;
    for (int k = 0; k < ndim; k++) {
        sum += a[k] * b[k];
    }
    return sum;
}

/* Largest entry brought near 1 by a power of two, so that squares neither overflow nor vanish.
 * Returns that power's exponent. */
static int
copy_of_unit_size(int ndim, const double *row, double *copy)
{
    double largest = 0.0;
    int    exponent;
    for (int k = 0; k < ndim; k++) {
        largest = hs_larger(fabs(row[k]), largest);
    }
    (void)frexp(largest, &exponent);
    const hs_scale scale = hs_scale_of(exponent);
    for (int k = 0; k < ndim; k++) {
        copy[k] = hs_scale_apply(scale, row[k]);
    }
    return exponent;
}

/* Remove from v what lies along n_basis orthonormal vectors (twice: the first pass rounds), then
 * scale v to length 1. Returns its length before that. */
static double
orthonormalise(int ndim, int n_basis, double basis[][HS_MAX_DIM], double *v)
{
    for (int pass = 0; pass < 2; pass++) {
        for (int b = 0; b < n_basis; b++) {
            const double along = dot(ndim, v, basis[b]);
            for (int k = 0; k < ndim; k++) {
                v[k] -= along * basis[b][k];
            }
        }
    }
    const double length = sqrt(dot(ndim, v, v));
    for (int k = 0; k < ndim; k++) {
        v[k] = length > 0.0 ? v[k] / length : 0.0;
    }
    return length;
}

static void
start_volume(hs_lattice *lattice)
{
    lattice->volume_mantissa = 1.0;
    lattice->volume_exponent = 0;
}

/* Multiplies the volume by length * 2^exponent. */
static void
multiply_volume(hs_lattice *lattice, double length, int exponent)
{
    int carried;
    lattice->volume_mantissa = frexp(lattice->volume_mantissa * length, &carried);
    lattice->volume_exponent += carried + exponent;
}

double
hs_lattice_volume(const hs_lattice *lattice, int exponent)
{
    const int power = lattice->volume_exponent + lattice->n_periodic * exponent;
    return power == 0 ? lattice->volume_mantissa : ldexp(lattice->volume_mantissa, power);
}

/* The unit vector that is orthogonal to all rows of B but row r. */
static void
set_periodic_normal(hs_lattice *lattice, int r, double *normal)
{
    double    basis[HS_MAX_DIM][HS_MAX_DIM];
    const int ndim = lattice->ndim;
    int       n_basis = 0;
    for (int other = 0; other < lattice->n_periodic; other++) {
        if (other != r) {
            copy_of_unit_size(ndim, lattice->rows[other], basis[n_basis]);
            orthonormalise(ndim, n_basis, basis, basis[n_basis]);
            n_basis++;
        }
    }
    copy_of_unit_size(ndim, lattice->rows[r], normal);
    orthonormalise(ndim, n_basis, basis, normal);
}

/* Orthonormal vectors that are orthogonal to all rows of B, one for each open grid axis. Each
 * starts from the coordinate axis that the vectors so far cover least. */
static void
set_open_normals(hs_lattice *lattice)
{
    double    basis[HS_MAX_DIM][HS_MAX_DIM];
    const int ndim = lattice->ndim;
    int       n_basis = 0;
    start_volume(lattice);
    for (int r = 0; r < lattice->n_periodic; r++) {
        const int    exponent = copy_of_unit_size(ndim, lattice->rows[r], basis[n_basis]);
        const double length = orthonormalise(ndim, n_basis, basis, basis[n_basis]);
        multiply_volume(lattice, length, exponent);
        n_basis++;
    }
    for (int k = 0; k < ndim; k++) {
        if (lattice->row_of_axis[k] >= 0) {
            continue;
        }
        double best_length = -1.0;
        for (int a = 0; a < ndim; a++) {
            double trial[HS_MAX_DIM] = {0};
            trial[a] = 1.0;
            const double length = orthonormalise(ndim, n_basis, basis, trial);
            if (length > best_length) {
                best_length = length;
                memcpy(basis[n_basis], trial, sizeof trial);
            }
        }
        memcpy(lattice->normal[k], basis[n_basis], sizeof basis[n_basis]);
        memcpy(lattice->direction[k], basis[n_basis], sizeof basis[n_basis]);
        n_basis++;
    }
}

static void
set_general_axes(hs_lattice *lattice)
{
    for (int r = 0; r < lattice->n_periodic; r++) {
        lattice->row_of_axis[lattice->vector_of_row[r]] = r;
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        const int k = lattice->vector_of_row[r];
        double   *normal = lattice->normal[k];
        set_periodic_normal(lattice, r, normal);
        double height = dot(lattice->ndim, normal, lattice->rows[r]);
        if (height < 0.0) {
            height = -height;
            for (int c = 0; c < lattice->ndim; c++) {
                normal[c] = -normal[c];
            }
        }
        lattice->period[k] = height;
        for (int c = 0; c < lattice->ndim; c++) {
            lattice->direction[k][c] = height > 0.0 ? lattice->rows[r][c] / height : 0.0;
        }
    }
    set_open_normals(lattice);
}

/* B diagonal: make the entries positive and let the grid axes be the coordinate axes. */
static void
set_aligned_axes(hs_lattice *lattice, const int *column)
{
    start_volume(lattice);
    for (int r = 0; r < lattice->n_periodic; r++) {
        const int c = column[r];
        if (lattice->rows[r][c] < 0.0) {
            lattice->rows[r][c] = -lattice->rows[r][c];
            for (int l = 0; l < lattice->n_periodic; l++) {
                lattice->U[r][l] = -lattice->U[r][l];
            }
        }
        lattice->row_of_axis[c] = r;
        lattice->period[c] = lattice->rows[r][c];
        multiply_volume(lattice, lattice->rows[r][c], 0);
    }
    for (int k = 0; k < lattice->ndim; k++) {
        for (int c = 0; c < lattice->ndim; c++) {
            lattice->normal[k][c] = lattice->direction[k][c] = k == c ? 1.0 : 0.0;
        }
    }
}

/* The given box vectors, scaled; B starts as these. All axes are open as yet. */
static void
take_rows(const hs_box *box, int ndim, hs_scale scale, hs_lattice *lattice)
{
    lattice->ndim = ndim;
    lattice->n_periodic =
        box == NULL ? 0 : collect_periodic_rows(box, lattice->given, lattice->vector_of_row);
    lattice->aligned = lattice->reduced = false;
    for (int k = 0; k < ndim; k++) {
        lattice->row_of_axis[k] = -1;
        lattice->period[k] = 0.0;
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        lattice->row_error[r] = 0.0;
        for (int l = 0; l < lattice->n_periodic; l++) {
            lattice->U[r][l] = r == l;
        }
        for (int k = 0; k < ndim; k++) {
            lattice->scaled[r][k] = hs_scale_apply(scale, lattice->given[r][k]);
            lattice->rows[r][k] = lattice->scaled[r][k];
        }
    }
}

/* Replaces B by a short basis. Returns whether it is then axis-aligned, as it is for a box sheared
 * by whole widths. */
static bool
reduce_rows(hs_lattice *lattice, int *column)
{
    hs_reduction reduction;
    bool         exact = true;
    hs_reduce(lattice->ndim, lattice->n_periodic, lattice->scaled, &reduction);
    lattice->reduced = reduction.changed;
    for (int r = 0; r < lattice->n_periodic; r++) {
        memcpy(lattice->U[r], reduction.U[r], (size_t)lattice->n_periodic * sizeof(int64_t));
        memcpy(lattice->rows[r], reduction.rows[r], (size_t)lattice->ndim * sizeof(double));
        lattice->row_error[r] = reduction.error[r];
        exact = exact && reduction.error[r] == 0.0;
    }
    return exact && rows_are_aligned(lattice->ndim, lattice->n_periodic, lattice->rows, column);
}

void
hs_lattice_init(const hs_box *box, int ndim, hs_scale scale, hs_lattice *lattice)
{
    int column[HS_MAX_DIM];
    take_rows(box, ndim, scale, lattice);
    lattice->aligned = rows_are_aligned(ndim, lattice->n_periodic, lattice->given, column) ||
                       reduce_rows(lattice, column);
    if (lattice->aligned) {
        set_aligned_axes(lattice, column);
    } else {
        set_general_axes(lattice);
    }
}

/*
 * The vector whose product with given box vector l is 1, and 0 with the others: a combination of
 * the dual vectors of the short basis, which are accurate however skewed the box is. Scaled by
 * 2^*exponent to have an ordinary size. False where a height of the short basis has vanished.
 */
static bool
dual_of_given(const hs_lattice *reduced, int l, double *dual, int *exponent)
{
    const int d = reduced->ndim;
    *exponent = -INT32_MAX / 4;
    memset(dual, 0, (size_t)d * sizeof(double));
    for (int k = 0; k < d; k++) {
        const int r = reduced->row_of_axis[k];
        if (r >= 0 && !(reduced->period[k] > 0.0)) {
            return false;
        }
        if (r >= 0 && reduced->U[r][l] != 0) {
            const int e = ilogb((double)reduced->U[r][l]) - ilogb(reduced->period[k]);
            *exponent = e > *exponent ? e : *exponent;
        }
    }
    for (int c = 0; c < d; c++) {
        for (int k = 0; k < d; k++) {
            const int r = reduced->row_of_axis[k];
            if (r >= 0 && reduced->U[r][l] != 0) {
                int          e;
                const double period = frexp(reduced->period[k], &e);
                dual[c] += ldexp((double)reduced->U[r][l] / period * reduced->normal[k][c],
                                 -e - *exponent);
            }
        }
    }
    return true;
}

void
hs_lattice_init_given(const hs_box *box, hs_scale scale, hs_lattice *lattice)
{
    hs_lattice reduced;
    hs_lattice_init(box, box->ndim, scale, &reduced);
    take_rows(box, box->ndim, scale, lattice);
    lattice->volume_mantissa = reduced.volume_mantissa;
    lattice->volume_exponent = reduced.volume_exponent;
    for (int l = 0; l < lattice->n_periodic; l++) {
        const int k = lattice->vector_of_row[l];
        double   *normal = lattice->normal[k];
        int       exponent = 0;
        double    length = 0.0;
        if (dual_of_given(&reduced, l, normal, &exponent)) {
            length = orthonormalise(lattice->ndim, 0, NULL, normal);
        }
        lattice->row_of_axis[k] = l;
        lattice->period[k] = length > 0.0 ? ldexp(1.0 / length, -exponent) : 0.0;
    }
    for (int c = 0; reduced.aligned && !reduced.reduced && c < box->ndim; c++) {
        if (reduced.row_of_axis[c] >= 0) { /* nothing to round */
            lattice->period[lattice->vector_of_row[reduced.row_of_axis[c]]] = reduced.period[c];
        }
    }
}

bool
hs_lattice_shift(const hs_lattice *lattice, const int64_t *reduced, int64_t *given)
{
    for (int l = 0; l < lattice->n_periodic; l++) {
        double   rough = 0.0, size = 0.0; /* the sum, and what its rounding is relative to */
        uint64_t sum = 0;                 /* modulo 2^64: exact once the sum is known to be small */
        for (int r = 0; r < lattice->n_periodic; r++) {
            const double term = (double)reduced[r] * (double)lattice->U[r][l];
            rough += term;
            size += fabs(term);
            sum += (uint64_t)reduced[r] * (uint64_t)lattice->U[r][l];
        }
        if (!(fabs(rough) + 0x1p-48 * size < 0x1p62)) {
            return false;
        }
        given[l] = sum <= INT64_MAX ? (int64_t)sum : -(int64_t)(UINT64_MAX - sum) - 1;
    }
    return true;
}
