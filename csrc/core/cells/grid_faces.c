/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * grid_faces.c: boxes are often whole multiples of the cutoff. There is no room for rounding then,
 * so points are told apart by the faces between cells, which are numbers: two points with `part`
 * whole cells between their cells are more than the radius apart, also across a periodic face
 * unless one lies on it.
 */
#include "grid.h"

#include "../exact/doubleword.h"

/* Is every cell along axis k at least `least` wide, in the real numbers that its faces are? */
static bool
faces_hold(const hs_scene *scene, const hs_grid *grid, int k, double least)
{
    double from = scene->lower[k]; /* where cell 0 begins */
    for (int64_t cell = 0; cell < grid->shape[k]; cell++) {
        const double to = cell + 1 < grid->shape[k] ? hs_grid_face(grid, k, (double)(cell + 1))
                                                    : scene->upper[k];
        const hs_dw  width = hs_two_difference(to, from);
        if (!(width.hi > least || (width.hi == least && width.lo >= 0.0))) {
            return false;
        }
        from = to;
    }
    return true;
}

/* Does a point lie on the far face? There the last cell is closed, not half open. */
static bool
touches_end(const hs_scene *scene, int k)
{
    const double *x = scene->cloud.x[k], end = scene->upper[k];
    int           any = 0;
    for (int64_t i = 0; i < scene->n; i++) {
        any |= x[i] >= end;
    }
    return any != 0;
}

void
hs_grid_cut_by_faces(const hs_scene *scene, const double *parts, double cap, hs_grid *grid)
{
    double cells = (double)grid->n_cells;
    for (int k = 0; k < scene->ndim; k++) {
        const double extent = scene->upper[k] - scene->lower[k];
        const double along = hs_scene_radius_along(scene, k);
        const double part = along / parts[k]; /* exact but for thirds */
        const double least = parts[k] == 3.0 ? hs_next_up(part) : part;
        const double count = (double)grid->shape[k] + 1.0;
        const double reach = hs_larger(fabs(scene->lower[k]), fabs(scene->upper[k]));
        if (scene->t_error[k] != 0.0 || reach > 16.0 * extent || count < 4.0 || !(least > 0.0) ||
            !(least * count <= extent * (1.0 + HS_GRID_SLACK)) || count > HS_GRID_CELLS_PER_AXIS) {
            continue;
        }
        const double  more = cells / (count - 1.0) * count;
        const hs_grid before = *grid;
        grid->shape[k] = (int64_t)count;
        grid->cell_size[k] = extent / count;
        grid->cells_per_length[k] = count / extent;
        grid->reach[k] = (int64_t)parts[k];
        grid->by_faces[k] = more <= cap && faces_hold(scene, grid, k, least) &&
                            (scene->lattice.row_of_axis[k] < 0 || !touches_end(scene, k));
        if (grid->by_faces[k]) {
            cells = more;
        } else {
            *grid = before;
        }
    }
    grid->n_cells = 1;
    for (int k = 0; k < scene->ndim; k++) {
        grid->stride[k] = grid->n_cells;
        grid->n_cells *= grid->shape[k];
    }
}
