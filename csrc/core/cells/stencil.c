/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * stencil.c: counts through the offsets of rows and drops those that are out of reach.
 *
 * How far a neighbour can be along the first axis depends on the row: in a frame in which the
 * directions of the grid axes are lower triangular, the offsets along the later axes bound some
 * components of D from below, and what is left of the radius bounds the first. In aligned boxes
 * this is the circle of cells around a point.
 */
#include "stencil.h"

#include "../base/poll.h"

#include <math.h>
#include <string.h>

#define DUALITY_DEFECT 1e-9   /* normals and directions further from dual than this are not used */
#define FIRST_CAPACITY 1024   /* rows; doubled as needed: of many, most are out of reach */
#define MOST_UNPRUNED  0x1p22 /* rows, in a box too flat to tell which of them are out of reach */
#define POLL_ROWS      (1 << 16)
#define FRAME_SLACK    1e-6 /* relative; covers the defect in 8 dimensions many times */

typedef struct frame {
    bool   usable;
    bool   diagonal;                      /* no entry but lower[k][k] differs from zero */
    double lower[HS_MAX_DIM][HS_MAX_DIM]; /* direction k = sum_{c <= k} lower[k][c] q_c */
} frame;

/* What add_rows needs beside the stencil. */
typedef struct scope {
    const hs_scene *scene;
    const hs_grid  *grid;
    frame           axes;
} scope;

/* Is v = sum_k (normal_k . v) direction_k, for every v? */
static bool
axes_are_dual(const hs_lattice *lattice)
{
    for (int a = 0; a < lattice->ndim; a++) {
        for (int b = 0; b < lattice->ndim; b++) {
            double sum = a == b ? -1.0 : 0.0;
            for (int k = 0; k < lattice->ndim; k++) {
                sum += lattice->normal[k][a] * lattice->direction[k][b];
            }
            if (!(fabs(sum) <= DUALITY_DEFECT)) {
                return false;
            }
        }
    }
    return true;
}

/* The frame of an aligned lattice: its directions are the coordinate axes. */
static void
set_unit_frame(int ndim, frame *axes)
{
    axes->usable = axes->diagonal = true;
    for (int k = 0; k < ndim; k++) {
        for (int c = 0; c <= k; c++) {
            axes->lower[k][c] = k == c ? 1.0 : 0.0;
        }
    }
}

/* Gram-Schmidt on the directions, first axis first; checked, not trusted. */
static void
set_triangular_frame(const hs_lattice *lattice, frame *axes)
{
    double    q[HS_MAX_DIM][HS_MAX_DIM];
    const int d = lattice->ndim;
    axes->usable = axes_are_dual(lattice);
    axes->diagonal = false;
    for (int k = 0; k < d; k++) {
        memcpy(q[k], lattice->direction[k], sizeof q[k]);
        memset(axes->lower[k], 0, (size_t)d * sizeof(double));
        for (int pass = 0; pass < 2; pass++) {
            for (int c = 0; c < k; c++) {
                double along = 0.0;
                for (int a = 0; a < d; a++) {
                    along += q[k][a] * q[c][a];
                }
                for (int a = 0; a < d; a++) {
                    q[k][a] -= along * q[c][a];
                }
                axes->lower[k][c] += along;
            }
        }
        double square = 0.0;
        for (int a = 0; a < d; a++) {
            square += q[k][a] * q[k][a];
        }
        axes->lower[k][k] = sqrt(square);
        if (!(axes->lower[k][k] > 1e-3)) {
            axes->usable = false; /* nearly flat: the frame would be all rounding */
            return;
        }
        for (int a = 0; a < d; a++) {
            q[k][a] /= axes->lower[k][k];
        }
    }
}

/* How far the difference of two cell indices, as a length, can be from that of the true t. */
static double
slack_along(const hs_scene *scene, const hs_grid *grid, int k)
{
    const double extent = grid->cell_size[k] * (double)grid->shape[k];
    return (grid->range[k] - hs_scene_radius_along(scene, k)) + FRAME_SLACK * scene->radius +
           0x1p-50 * extent;
}

/* Differences of t_k along the later axes, as far as the radius lets them go. */
typedef struct spans {
    double low[HS_MAX_DIM], high[HS_MAX_DIM];
} spans;

/* Sets the differences that points of the cells at `offset` can have, rounding included. */
static void
set_spans(const hs_scene *scene, const hs_grid *grid, const int32_t *offset, spans *t)
{
    for (int k = 1; k < grid->ndim; k++) {
        const double slack = slack_along(scene, grid, k);
        const double radius = hs_scene_radius_along(scene, k) * (1.0 + FRAME_SLACK);
        t->low[k] = hs_larger((offset[k] - 1) * grid->cell_size[k] - slack, -radius - slack);
        t->high[k] = hs_smaller((offset[k] + 1) * grid->cell_size[k] + slack, radius + slack);
    }
}

/* Finds the range of component c of D; of the first one, what the later axes add to it. */
static void
range_of_component(const frame *axes, const spans *t, int ndim, int c, double *least, double *most)
{
    const int last = axes->diagonal ? c : ndim - 1;
    *least = *most = 0.0;
    for (int k = c > 0 ? c : 1; k <= last; k++) {
        const double a = axes->lower[k][c] * t->low[k], b = axes->lower[k][c] * t->high[k];
        *least += hs_smaller(a, b);
        *most += hs_larger(a, b);
    }
}

/* Narrows the range of t_0 in which points of the row at `offset` can be within the radius. Returns
 * false when none can. */
static bool
narrow_by_frame(const hs_scene *scene, const hs_grid *grid, const frame *axes,
                const int32_t *offset, double *low, double *high)
{
    const double radius = scene->radius * (1.0 + FRAME_SLACK);
    const double unit = radius > 0.0 ? radius : 1.0; /* squares of tiny lengths would vanish */
    double       left = radius > 0.0 ? 1.0 : 0.0; /* of the square, for the components still open */
    double       least, most;
    spans        t;
    set_spans(scene, grid, offset, &t);
    for (int c = grid->ndim - 1; c >= 1; c--) {
        range_of_component(axes, &t, grid->ndim, c, &least, &most);
        const double gap = hs_larger(hs_larger(least, -most), 0.0) / unit;
        left -= gap * gap;
        if (left < 0.0) {
            return false;
        }
    }
    range_of_component(axes, &t, grid->ndim, 0, &least, &most);
    const double rest = sqrt(left) * unit;
    const double slack = slack_along(scene, grid, 0);
    *low = hs_larger((-rest - most) / axes->lower[0][0] - slack, *low);
    *high = hs_smaller((rest - least) / axes->lower[0][0] + slack, *high);
    return true;
}

/*
 * Cells of the row at `offset` that a pair within the radius can reach. Returns false when there
 * are none.
 */
static bool
reach_along_row(const hs_scene *scene, const hs_grid *grid, const frame *axes, hs_stencil_row *row)
{
    double low = -grid->range[0], high = grid->range[0];
    if (axes->usable && grid->ndim > 1 &&
        !narrow_by_frame(scene, grid, axes, row->offset, &low, &high)) {
        return false;
    }
    const double cells = grid->cells_per_length[0];
    const double reach = (double)grid->reach[0];
    const double first = hs_larger(ceil(low * cells - 1.0 - 1e-5), -reach);
    const double last = hs_smaller(floor(high * cells + 1.0 + 1e-5), reach);
    if (!(first <= last)) { /* they may be beyond any integer */
        return false;
    }
    row->first = (int32_t)first;
    row->last = (int32_t)last;
    return true;
}

/* The next offset in the order of the axes, the last axis slowest; false after the last one. */
static bool
advance(const hs_grid *grid, int32_t *offset)
{
    for (int k = 1; k < grid->ndim; k++) {
        if (offset[k] < grid->reach[k]) {
            offset[k]++;
            return true;
        }
        offset[k] = (int32_t)-grid->reach[k];
    }
    return false;
}

double
hs_stencil_bound(const hs_grid *grid)
{
    double rows = 1.0;
    for (int k = 1; k < grid->ndim; k++) {
        rows *= 2.0 * (double)grid->reach[k] + 1.0;
    }
    return 0.5 * (rows + 1.0);
}

double
hs_stencil_bytes(const hs_grid *grid, bool is_full)
{
    /* Along axes on which only the next cells are in reach these always are; in the space of the
     * others rows in reach fill a ball, or an ellipsoid, of which this is the share of the box. */
    static const double share[HS_MAX_DIM] = {1.0, 1.0, 0.785, 0.523, 0.308, 0.164, 0.080, 0.036};
    double              rows = is_full ? 1.0 : 0.5;
    int                 m = 0;
    for (int k = 1; k < grid->ndim; k++) {
        const double reach = (double)grid->reach[k];
        rows *= reach > 1.0 ? 2.0 * reach : 2.0 * reach + 1.0;
        m += reach > 1.0;
    }
    return 0.9 * share[m] * rows * (double)sizeof(hs_stencil_row); /* balls of cells are uneven */
}

/* Twice the room; on failure the stencil is freed. */
static bool
grow(hs_account *account, int64_t *capacity, hs_stencil *stencil)
{
    hs_stencil_row *more = hs_grow(account, HS_FOR_STENCIL, stencil->rows, stencil->n_rows,
                                   2 * *capacity, sizeof(hs_stencil_row));
    if (more == NULL) {
        hs_stencil_free(account, stencil);
        return false;
    }
    stencil->rows = more;
    *capacity *= 2;
    return true;
}

/* Adds the rows from this one to the last in the order of the axes, as far as they are in reach. */
static hs_status
add_rows(hs_account *account, const hs_options *options, const scope *of, hs_stencil_row *row,
         hs_stencil *stencil, int64_t capacity)
{
    int64_t tried = 0;
    do {
        if (++tried % POLL_ROWS == 0 && hs_poll(options, 0.0) != HS_OK) {
            hs_stencil_free(account, stencil);
            return HS_ERR_INTERRUPTED;
        }
        if (stencil->n_rows == capacity && !grow(account, &capacity, stencil)) {
            return HS_ERR_MEMORY;
        }
        if (reach_along_row(of->scene, of->grid, &of->axes, row)) {
            stencil->rows[stencil->n_rows++] = *row;
        }
    } while (advance(of->grid, row->offset));
    return HS_OK;
}

hs_status
hs_stencil_build(hs_account *account, const hs_options *options, const hs_scene *scene,
                 const hs_grid *grid, bool is_full, hs_stencil *stencil)
{
    const double bound = hs_stencil_bound(grid) * (is_full ? 2.0 : 1.0);
    scope        of;
    of.scene = scene;
    of.grid = grid;
    of.axes.usable = false; /* the own row alone needs none */
    *stencil = (hs_stencil){0};
    if (bound > 1.0 && scene->lattice.aligned) {
        set_unit_frame(grid->ndim, &of.axes);
    } else if (bound > 1.0) {
        set_triangular_frame(&scene->lattice, &of.axes);
    }
    if (bound > (of.axes.usable ? (double)INT32_MAX : MOST_UNPRUNED)) {
        return hs_skew_or_memory(&scene->lattice);
    }
    if (scene->lattice.aligned && bound > FIRST_CAPACITY &&
        !hs_account_allows(account, hs_stencil_bytes(grid, is_full))) {
        return HS_ERR_MEMORY; /* refused now, not after as much has been written */
    }
    const int64_t capacity = (int64_t)hs_smaller(bound, FIRST_CAPACITY);
    stencil->rows = hs_alloc(account, HS_FOR_STENCIL, capacity, sizeof(hs_stencil_row));
    if (stencil->rows == NULL) {
        return HS_ERR_MEMORY;
    }
    hs_stencil_row row = {{0}, 0, 0};
    if (is_full) {
        for (int k = 1; k < grid->ndim; k++) {
            row.offset[k] = (int32_t)-grid->reach[k];
        }
        return add_rows(account, options, &of, &row, stencil, capacity);
    }
    (void)reach_along_row(scene, grid, &of.axes, &row);
    row.first = 0; /* in the own row only what lies ahead */
    row.last = row.last > 0 ? row.last : 0;
    stencil->rows[stencil->n_rows++] = row;
    /* From the zero offset on, counting up visits exactly the forward half. */
    return advance(grid, row.offset) ? add_rows(account, options, &of, &row, stencil, capacity)
                                     : HS_OK;
}

void
hs_stencil_free(hs_account *account, hs_stencil *stencil)
{
    hs_free(account, stencil->rows);
    stencil->rows = NULL;
}
