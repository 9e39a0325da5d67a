/* SPDX-License-Identifier: BSD-3-Clause */
#include "grid.h"
#include "../exact/arithmetic.h"
#include "../base/status.h"

/*
 * grid.c: how far apart the coordinates of a pair can be, then one cell or several, whichever makes
 * a search cheaper.
 *
 * Why no pair is lost: rounding is monotone, so cell indices are a monotone function of t; `range`
 * bounds how far apart the computed coordinates of a pair can be, every rounding and the whole
 * effect of inexact normals included; and `reach` is that range in cells, rounded up.
 *
 * Where a box is a whole multiple of the cutoff, rounding leaves no room for that many cells, and
 * there is one less. Cells with exact faces would save that one: in crystals and uniform scenes
 * searches with them took 1.00 to 1.04 times the instructions (AVX2).
 */

/* How many cells there are along each axis, unless the caller sets their width: any cells find all
 * pairs, and these make a search quickest. */

/* Cells per axis that int32 windows and doubles tell apart. */
#define CELLS_PER_AXIS 0x1p31
/* Cells of a grid: their ids are uint32. */
#define MOST_CELLS 4294967295.0
/* Points that a cell along the first axis should hold, if that makes it a quarter of the range or
 * more; walks put cells together where these are fewer. */
#define POINTS_PER_CELL 12.0
/* Cells of so much more than a part of the range reach over so many of them. */
#define PART_SLACK (1.0 + 0x1p-20)
/* Where cells are wider than need be, rows of few cells hold so many points at least: there is
 * nothing to put together along them. */
#define FEW_CELLS      4.0
#define POINTS_PER_ROW 8.0
/* Where many cells are wider than need be: how many times shorter they are made along the first
 * axis at most, and along how many rows they then lie at least, on each other axis. Clusters of
 * 300 points gain a quarter with 4 to 30; uniform scenes lose with more than 16. */
#define SHORTER     16.0
#define ROWS_ACROSS 10.0

/* In proportion to the points. */
static double
grid_most_cells(const hs_scene *scene)
{
    return fmin(2.0 * (double)scene->n + HS_GRID_SPARE_CELLS, MOST_CELLS);
}

/* Fewer cells, evenly over the axes, until there are no more than `cap`. Returns whether it had
 * to. */
static bool
cap_counts(int ndim, double cap, double *counts)
{
    for (bool capped = false;;) {
        double product = 1.0;
        int    divided = 0;
        for (int k = 0; k < ndim; k++) {
            product *= counts[k];
            divided += counts[k] > 1.0;
        }
        if (product <= cap) {
            return capped;
        }
        capped = true;
        const double factor = pow(cap / product, 1.0 / divided);
        for (int k = 0; k < ndim; k++) {
            /* Always at least one less, so that this ends. */
            counts[k] = fmax(1.0, floor(fmin(counts[k] * factor, counts[k] - 1.0)));
        }
    }
}

/*
 * For counts that were capped, so that cells are wider than the range: cells become shorter along
 * the first axis, where a walk passes over them one after the other, and wider along the others, in
 * about the same number. Points of a group are then closer together, and meet fewer candidates,
 * where points are in clusters. Not where an axis has hardly more than ROWS_ACROSS.
 */
static void
shorten_cells(const hs_scene *scene, const hs_grid *grid, double *counts)
{
    const double extent = scene->upper[0] - scene->lower[0]; /* not 0: there are several cells */
    const double most = fmin(SHORTER * counts[0], floor(extent / (grid->range[0] * PART_SLACK)));
    double       across = INFINITY, product = counts[0];
    int          n_others = 0;
    for (int k = 1; k < scene->ndim; k++) {
        across = counts[k] > 1.0 ? fmin(across, counts[k]) : across;
        product *= counts[k];
        n_others += counts[k] > 1.0;
    }
    /* Infinite with one axis, or with cutoff 0: then the other bound counts, or there is no
     * other. */
    const double times = fmin(most / counts[0], pow(across / ROWS_ACROSS, (double)n_others));
    if (n_others == 0 || !(times > 1.0)) {
        return;
    }
    for (int k = 1; k < scene->ndim; k++) {
        if (counts[k] > 1.0) {
            counts[k] = fmax(ROWS_ACROSS, floor(counts[k] * pow(times, -1.0 / n_others)));
            product /= counts[k];
        }
    }
    counts[0] = fmin(floor(product), most);
}

#define UNIT  0x1p-53
#define SLACK HS_GRID_SLACK
/* Cost of sorting a point into its cell, in candidates. */
#define SORTING_COST 40.0

double
hs_ball_volume(int ndim, double radius)
{
    double volume = ndim % 2 == 0 ? 1.0 : 2.0 * radius;
    for (int k = 2 + ndim % 2; k <= ndim; k += 2) {
        volume *= 6.283185307179586 / k * radius * radius;
    }
    return volume;
}

hs_status
hs_grid_set_axis(const hs_scene *scene, int k, double count, hs_grid *grid)
{
    const double extent = scene->upper[k] - scene->lower[k];
    const bool   open = scene->lattice.row_of_axis[k] < 0;
    grid->shape[k] = (int64_t)count;
    grid->lower[k] = scene->lower[k];
    grid->cell_size[k] = extent / count;
    /* One cell needs no scale; that of a subnormal extent would be infinite. */
    grid->cells_per_length[k] = count > 1.0 || !open ? count / extent : 0.0;
    const double cells =
        grid->range[k] * grid->cells_per_length[k] * (1.0 + SLACK) + 0x1p-50 * count;
    if (open && !(cells < count - 1.0)) {
        grid->reach[k] = grid->shape[k] - 1;
    } else if (cells < CELLS_PER_AXIS - 2.0) { /* windows of cells are int32 */
        grid->reach[k] = (int64_t)cells + 1;
    } else {
        return HS_ERR_MEMORY;
    }
    return HS_OK;
}

/* So many cells along each axis. HS_ERR_MEMORY when a reach passes its integers. */
static hs_status
set_shape(const hs_scene *scene, const double *counts, hs_grid *grid)
{
    grid->n_cells = 1;
    for (int k = 0; k < scene->ndim; k++) {
        if (hs_grid_set_axis(scene, k, counts[k], grid) != HS_OK) {
            return HS_ERR_MEMORY;
        }
        grid->stride[k] = grid->n_cells;
        grid->n_cells *= grid->shape[k];
    }
    return HS_OK;
}

/*
 * Estimated cost of a search, in candidates per point: tested pairs, plus what a neighbourhood
 * costs to visit, plus sorting unless there is one cell.
 */
static double
cost_per_point(const hs_scene *scene, const hs_grid *grid)
{
    double candidates = 0.5 * (double)scene->n;
    double rows = 0.5;
    for (int k = 0; k < scene->ndim; k++) {
        double cells = 2.0 * (double)grid->reach[k] + 1.0;
        if (scene->lattice.row_of_axis[k] < 0) {
            cells = hs_smaller(cells, (double)grid->shape[k]);
        }
        candidates *= cells / (double)grid->shape[k];
        rows *= k > 0 ? cells : 1.0;
    }
    const double group = hs_smaller(hs_larger((double)scene->n / (double)grid->n_cells, 1.0), 64.0);
    return candidates + 8.0 * (rows + 1.0) / group + (grid->n_cells > 1 ? SORTING_COST : 0.0);
}

/* Sets how far apart the computed coordinates of a pair can be. HS_ERR_MEMORY when they pass more
 * images than can be counted, HS_ERR_BOX_SKEWED when it is rounding that does. */
static hs_status
set_ranges(const hs_scene *scene, hs_grid *grid)
{
    const hs_lattice *lattice = &scene->lattice;
    const int         m = lattice->aligned ? 0 : lattice->n_periodic; /* rows that may be inexact */
    double            drift_of_row[HS_MAX_DIM][HS_MAX_DIM];
    /* The largest number of images per row of B that a pair can be apart, and how far so many rows
     * can move t_k beyond whole periods, because normals are rounded: measured, not assumed. Each
     * of the two depends on the other. */
    double images[HS_MAX_DIM], drift[HS_MAX_DIM] = {0.0};
    for (int k = 0; k < scene->ndim; k++) {
        for (int r = 0; r < m; r++) {
            double along = 0.0, rounding = 0.0;
            for (int c = 0; c < scene->ndim; c++) {
                const double term = lattice->normal[k][c] * lattice->rows[r][c];
                along += term;
                rounding += (scene->ndim + 2) * UNIT * fabs(term) +
                            fabs(lattice->normal[k][c]) * lattice->row_error[r];
            }
            if (lattice->row_of_axis[k] == r) {
                along -= lattice->period[k];
                rounding += UNIT * lattice->period[k];
            }
            drift_of_row[k][r] = fabs(along) + rounding * (1.0 + SLACK);
        }
    }
    for (int pass = 0; pass < (lattice->aligned ? 1 : 3); pass++) {
        for (int k = 0; k < scene->ndim; k++) {
            if (lattice->row_of_axis[k] >= 0) {
                const double along = hs_scene_radius_along(scene, k) * (1.0 + SLACK);
                images[lattice->row_of_axis[k]] =
                    ceil((along + drift[k] + 2.0 * scene->t_error[k]) / lattice->period[k]) + 2.0;
            }
        }
        for (int k = 0; k < scene->ndim; k++) {
            drift[k] = 0.0;
            for (int r = 0; r < m; r++) {
                drift[k] += images[r] * drift_of_row[k][r];
            }
        }
    }
    for (int k = 0; k < scene->ndim; k++) {
        /* Rounding moves points across half a period and more than the cutoff: a box vector is so
         * long that along the short ones every point would meet many images of every other. */
        const double blur = drift[k] + 2.0 * scene->t_error[k];
        if (lattice->row_of_axis[k] >= 0 && blur > scene->radius &&
            !(blur <= 0.5 * lattice->period[k])) {
            return HS_ERR_BOX_SKEWED;
        }
    }
    grid->shift_error = 0.0;
    for (int k = 0; k < scene->ndim; k++) {
        const int    row = lattice->row_of_axis[k];
        const double along = hs_scene_radius_along(scene, k);
        double       moved = 0.0, row_errors = 0.0;
        grid->range[k] = (along + drift[k] + 2.0 * scene->t_error[k]) * (1.0 + SLACK);
        if (row >= 0 && !(grid->range[k] / lattice->period[k] + 1.0 <= images[row])) {
            return hs_skew_or_memory(lattice);
        }
        /* T = shift * B - centre is rounded; coordinates that no row moves subtract exactly enough
         * without it. */
        for (int r = 0; r < lattice->n_periodic; r++) {
            moved += images[r] * fabs(lattice->rows[r][k]);
            row_errors += images[r] * lattice->row_error[r];
        }
        const double error =
            (2 * lattice->n_periodic + 3) * UNIT * (moved + 2.0 * scene->x_largest[k]) + row_errors;
        grid->shift_error = moved > 0.0 ? hs_larger(error, grid->shift_error) : grid->shift_error;
    }
    return HS_OK;
}

/* Ranges, errors and expected pairs, no cells yet; *density: points in a unit of the volume that
 * they are in; *ball: the volume within reach of one. */
static hs_status
grid_begin(const hs_scene *scene, double *density, double *ball, hs_grid *grid, hs_failure *failure)
{
    /* Volume of the periodic axes, times the open extents. */
    double volume = hs_lattice_volume(&scene->lattice, 0);
    *grid = (hs_grid){.ndim = scene->ndim};
    *ball = hs_ball_volume(scene->ndim, scene->cutoff);
    hs_status status = set_ranges(scene, grid);
    for (int k = 0; status == HS_OK && k < scene->ndim; k++) {
        /* Pairs are narrower along some axes. */
        *ball *= scene->less[k] > 0.0 ? hs_scene_radius_along(scene, k) / scene->radius : 1.0;
        volume *= scene->lattice.row_of_axis[k] >= 0
                      ? 1.0
                      : hs_larger(scene->upper[k] - scene->lower[k], grid->range[k]);
    }
    *density = (double)scene->n / volume;
    grid->expected_pairs = 0.5 * (double)scene->n * *density * *ball;
    if (!(volume > 0.0)) { /* points on one spot, cutoff 0 */
        grid->expected_pairs = 0.5 * (double)scene->n * (double)(scene->n - 1);
    }
    if (status == HS_ERR_MEMORY) { /* more pairs than any memory holds */
        failure->expected_pairs = failure->expected_bytes = INFINITY;
    }
    return status;
}

hs_status
hs_grid_init(const hs_scene *scene, hs_grid_kind kind, hs_grid *grid, hs_failure *failure)
{
    double    counts[HS_MAX_DIM], density, ball, single_cost = INFINITY;
    hs_status status = grid_begin(scene, &density, &ball, grid, failure);
    if (status != HS_OK) {
        return status;
    }
    for (int k = 0; k < scene->ndim; k++) {
        counts[k] = 1.0;
    }
    status = set_shape(scene, counts, grid);
    if (status == HS_OK) {
        single_cost = cost_per_point(scene, grid);
    }
    const hs_grid single = *grid;
    /* Several cells cost no less, however good they are. */
    const bool is_single = kind == HS_GRID_SINGLE ||
                           (kind == HS_GRID_ANY && single_cost <= SORTING_COST);
    if (!is_single) {
        const double neighbours = density * ball;
        /* Narrower rows cost more rows to visit, and leave out candidates that else are gathered
         * first (scan.h). */
        const int finer = neighbours < 600.0 ? 1 : neighbours < 3000.0 ? 2 : 3;
        double    area = 1.0; /* of one row's cross-section */
        for (int k = scene->ndim - 1; k >= 0; k--) {
            const double extent = scene->upper[k] - scene->lower[k];
            double       parts = finer; /* of the range: cells */
            if (k == 0 && scene->ndim > 1) {
                /* A whole fraction of the range: otherwise windows are longer than need be. */
                const double points = density * area * grid->range[0];
                parts = fmin(fmax(nearbyint(points / POINTS_PER_CELL), 1.0), 4.0);
            }
            const double pitch = grid->range[k] * PART_SLACK / parts;
            /* Not for a zero extent, also with cutoff 0. */
            counts[k] = extent > pitch ? floor(fmin(extent / pitch, CELLS_PER_AXIS)) : 1.0;
            area *= fmax(extent, grid->range[k]) / counts[k]; /* flat scenes count as this thick */
        }
        const bool capped = cap_counts(scene->ndim, grid_most_cells(scene), counts);
        if (capped && counts[0] < FEW_CELLS) {
            const double rows = fmax((double)scene->n / POINTS_PER_ROW, 1.0);
            (void)cap_counts(scene->ndim, counts[0] * rows, counts);
        } else if (capped) {
            shorten_cells(scene, grid, counts);
        }
        status = set_shape(scene, counts, grid);
        /* Axes with several cells reach a few of them, the others as far as in the single one. */
        HS_ASSERT(status == HS_OK || single_cost == INFINITY);
        if (status == HS_OK && kind == HS_GRID_ANY && single_cost <= cost_per_point(scene, grid)) {
            *grid = single;
        }
    }
    if (status != HS_OK) {
        status = hs_skew_or_memory(&scene->lattice);
        if (status == HS_ERR_MEMORY) {
            failure->expected_pairs = failure->expected_bytes = INFINITY;
        }
    }
    return status;
}

hs_status
hs_grid_narrow(const hs_scene *scene, bool is_sparse, double cutoff_before, hs_grid *grid)
{
    HS_ASSERT(cutoff_before > 0.0 && cutoff_before >= scene->cutoff);
    const double    ratio = scene->cutoff / cutoff_before;
    const hs_status status = set_ranges(scene, grid);
    for (int k = 0; status == HS_OK && k < scene->ndim; k++) {
        if (!is_sparse) { /* no reach becomes longer */
            (void)hs_grid_set_axis(scene, k, (double)grid->shape[k], grid);
        }
        grid->expected_pairs *= ratio;
    }
    return status;
}

/*
 * Counts through the offsets of rows and drops those that are out of reach.
 *
 * How far a neighbour can be along the first axis depends on the row: in a frame in which the
 * directions of the grid axes are lower triangular, the offsets along the later axes bound some
 * components of D from below, and what is left of the radius bounds the first. In aligned boxes
 * this is the circle of cells around a point.
 */

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

/* Gram-Schmidt on the directions, first axis first; checked, not trusted. Those of an aligned
 * lattice are the coordinate axes. */
static void
set_frame(const hs_lattice *lattice, frame *axes)
{
    double    q[HS_MAX_DIM][HS_MAX_DIM];
    const int d = lattice->ndim;
    axes->usable = true;
    axes->diagonal = lattice->aligned;
    for (int a = 0; a < d && !lattice->aligned; a++) {
        for (int b = 0; b < d; b++) { /* is v = sum_k (normal_k . v) direction_k, for every v? */
            double sum = a == b ? -1.0 : 0.0;
            for (int k = 0; k < d; k++) {
                sum += lattice->normal[k][a] * lattice->direction[k][b];
            }
            axes->usable = axes->usable && fabs(sum) <= DUALITY_DEFECT;
        }
    }
    hs_orthogonal_rows((const double(*)[HS_MAX_DIM])lattice->direction, NULL, d, d, q, axes->lower);
    for (int k = 0; k < d; k++) { /* nearly flat: the frame would be all rounding */
        axes->usable = axes->usable && axes->lower[k][k] > 1e-3;
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

/* Finds the range of component c of D; of the first one, what the later axes add to it. */
static void
range_of_component(const frame *axes, const double *low, const double *high, int ndim, int c,
                   double *least, double *most)
{
    const int last = axes->diagonal ? c : ndim - 1;
    *least = *most = 0.0;
    for (int k = c > 0 ? c : 1; k <= last; k++) {
        const double a = axes->lower[k][c] * low[k], b = axes->lower[k][c] * high[k];
        *least += hs_smaller(a, b);
        *most += hs_larger(a, b);
    }
}

/*
 * Cells of the row at `offset` that a pair within the radius can reach. Returns false when there
 * are none.
 */
static bool
reach_along_row(const hs_scene *scene, const hs_grid *grid, const frame *axes, hs_stencil_row *row)
{
    double low = -grid->range[0], high = grid->range[0]; /* of t_0 */
    if (axes->usable && grid->ndim > 1) {
        const double radius = scene->radius * (1.0 + FRAME_SLACK);
        const double unit = radius > 0.0 ? radius : 1.0; /* squares of tiny lengths would vanish */
        double       left = radius > 0.0 ? 1.0 : 0.0; /* of the square, for components still open */
        double       least, most, t_low[HS_MAX_DIM], t_high[HS_MAX_DIM];
        /* Differences of points of these cells, with roundings. */
        for (int k = 1; k < grid->ndim; k++) {
            const double slack = slack_along(scene, grid, k);
            const double along = hs_scene_radius_along(scene, k) * (1.0 + FRAME_SLACK);
            t_low[k] = hs_larger((row->offset[k] - 1) * grid->cell_size[k] - slack, -along - slack);
            t_high[k] =
                hs_smaller((row->offset[k] + 1) * grid->cell_size[k] + slack, along + slack);
        }
        for (int c = grid->ndim - 1; c >= 1; c--) {
            range_of_component(axes, t_low, t_high, grid->ndim, c, &least, &most);
            const double gap = hs_larger(hs_larger(least, -most), 0.0) / unit;
            left -= gap * gap;
            if (left < 0.0) {
                return false;
            }
        }
        range_of_component(axes, t_low, t_high, grid->ndim, 0, &least, &most);
        const double rest = sqrt(left) * unit;
        const double slack = slack_along(scene, grid, 0);
        low = hs_larger((-rest - most) / axes->lower[0][0] - slack, low);
        high = hs_smaller((rest - least) / axes->lower[0][0] + slack, high);
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

/* Number of rows that hs_stencil_build would look at, before it drops those out of reach. */
static double
stencil_bound(const hs_grid *grid)
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

hs_status
hs_stencil_build(hs_account *account, const hs_options *options, const hs_scene *scene,
                 const hs_grid *grid, bool is_full, hs_stencil *stencil)
{
    const double bound = stencil_bound(grid) * (is_full ? 2.0 : 1.0);
    frame        axes;
    axes.usable = false; /* the own row alone needs none */
    *stencil = (hs_stencil){0};
    if (bound > 1.0) {
        set_frame(&scene->lattice, &axes);
    }
    if (bound > (axes.usable ? (double)INT32_MAX : MOST_UNPRUNED)) {
        return hs_skew_or_memory(&scene->lattice);
    }
    if (scene->lattice.aligned && bound > FIRST_CAPACITY &&
        !hs_account_allows(account, hs_stencil_bytes(grid, is_full))) {
        return HS_ERR_MEMORY; /* refused now, not after as much has been written */
    }
    int64_t        capacity = 0;
    hs_stencil_row row = {{0}, 0, 0};
    for (int k = 1; is_full && k < grid->ndim; k++) {
        row.offset[k] = (int32_t)-grid->reach[k];
    }
    /* Counting up from the own row visits exactly the forward half. */
    for (int64_t tried = 1;; tried++) {
        if (tried % POLL_ROWS == 0 && hs_poll(options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
        if (stencil->n_rows == capacity) {
            const int64_t   more = capacity > 0 ? 2 * capacity
                                                : (int64_t)hs_smaller(bound, FIRST_CAPACITY);
            hs_stencil_row *grown = hs_grow(account, HS_FOR_STENCIL, stencil->rows, capacity, more,
                                            sizeof(hs_stencil_row));
            if (grown == NULL) {
                return HS_ERR_MEMORY;
            }
            stencil->rows = grown;
            capacity = more;
        }
        bool is_in_reach = reach_along_row(scene, grid, &axes, &row);
        if (!is_full && tried == 1) { /* in the own row only what lies ahead */
            row.first = 0;
            row.last = row.last > 0 ? row.last : 0;
            is_in_reach = true;
        }
        if (is_in_reach) {
            stencil->rows[stencil->n_rows++] = row;
        }
        int k = 1; /* the next offset in the order of the axes, the last axis slowest */
        for (; k < grid->ndim && row.offset[k] == grid->reach[k]; k++) {
            row.offset[k] = (int32_t)-grid->reach[k];
        }
        if (k == grid->ndim) {
            return HS_OK;
        }
        row.offset[k]++;
    }
}

/* Cells of a width that the caller chooses. Any cells find all pairs, for their reach follows from
 * their width: only layout and speed are the caller's. */

/* Rows around a cell, the forward half of them, at most: each takes room, and a look for each group
 * of points. In eight dimensions the nearest ones alone are half of 3^7 = 2187. */
#define MOST_ROWS 2048.0

hs_status
hs_grid_init_wide(const hs_scene *scene, double width, hs_grid *grid, bool *is_wider,
                  hs_failure *failure)
{
    double          counts[HS_MAX_DIM], density, ball;
    const hs_status status = grid_begin(scene, &density, &ball, grid, failure);
    if (status != HS_OK) {
        return status;
    }
    for (int k = 0; k < scene->ndim; k++) {
        const double extent = scene->upper[k] - scene->lower[k];
        /* Where the range is a whole number of cells it would reach one cell further, for it is a
         * little more than the cutoff: such cells are as much wider. */
        const double parts = fmax(nearbyint(grid->range[k] / width), 1.0);
        const double part = grid->range[k] * PART_SLACK / parts;
        const double pitch = part > width && part <= width * (1.0 + 0x1p-18) ? part : width;
        /* Not for a zero extent, also with a width that scaling brought to zero. */
        counts[k] = extent > pitch ? floor(fmin(extent / pitch, CELLS_PER_AXIS)) : 1.0;
    }
    *is_wider = cap_counts(scene->ndim, grid_most_cells(scene), counts);
    while (set_shape(scene, counts, grid) != HS_OK || stencil_bound(grid) > MOST_ROWS) {
        bool any = false; /* axis had more than one */
        for (int k = 0; k < scene->ndim; k++) {
            any = any || counts[k] > 1.0;
            counts[k] = fmax(floor(0.5 * counts[k]), 1.0);
        }
        *is_wider = true;
        if (!any) {
            return HS_TRY_OTHER;
        }
    }
    return HS_OK;
}
