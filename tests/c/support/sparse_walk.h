/* SPDX-License-Identifier: BSD-3-Clause */
/* sparse_walk.h: the walk that sparse_rows.h describes, plainly: hands on every pair of points
 * that the sparse cells bring together, with its image. */
#ifndef HS_SPARSE_WALK_H
#define HS_SPARSE_WALK_H

#include "../../../csrc/core/cells/sparse_grid.h"
#include "../../../csrc/core/cells/sparse_rows.h"
#include "../../../csrc/core/cells/stencil.h"
#include "harness.h"
#include "pair_checks.h"

typedef struct sparse_scene {
    hs_account account;
    hs_options options;
    hs_scene   scene;
    hs_grid    dense, grid;
    hs_stencil stencil;
    hs_sparse  sparse;
    hs_bins    bins;
} sparse_scene;

/* image: over the rows of B. */
typedef void (*sparse_visit)(void *context, const sparse_scene *s, int32_t si, int32_t sj,
                             const int64_t *image);

enum { SPARSE_GROUP = 64 };

/* Everything; nothing is held unless HS_OK. */
static inline hs_status
sparse_open(const brute_scene *brute, double width, sparse_scene *s)
{
    const hs_points points = points_of(brute);
    hs_failure      failure;
    s->options = options_of(brute);
    s->options.want = WANT_ALL;
    hs_account_init(&s->account, &s->options);
    hs_status status =
        hs_scene_init(&s->account, NULL, &points, brute->box, &s->options, &s->scene, &failure);
    if (status != HS_OK)
        return status;
    status = hs_grid_init(&s->scene, &s->dense, &failure);
    if (status == HS_OK) {
        hs_sparse_grid(&s->scene, &s->dense, width, &s->grid);
        status =
            hs_stencil_build(&s->account, &s->options, &s->scene, &s->grid, false, &s->stencil);
    }
    if (status != HS_OK) {
        hs_scene_free(&s->account, &s->scene);
        return status;
    }
    status =
        hs_sparse_build(&s->account, NULL, &s->options, &s->scene, &s->grid, &s->sparse, &s->bins);
    if (status != HS_OK)
        hs_stencil_free(&s->account, &s->stencil);
    return status;
}

static inline void
sparse_close(sparse_scene *s)
{
    hs_stencil_free(&s->account, &s->stencil);
    hs_sparse_free(&s->account, &s->sparse);
    hs_bins_free(&s->account, &s->bins);
    CHECK(s->account.held == 0);
}

static inline int64_t
sparse_floor_divide(int64_t a, int64_t b)
{
    return a / b - (a % b != 0 && (a < 0) != (b < 0));
}

/* The row at this offset from another, wrapped; -1 if it is empty. Adds to image. */
static inline int64_t
sparse_neighbour(const sparse_scene *s, int64_t row, const hs_stencil_row *offset, int64_t *hint,
                 int64_t *image)
{
    int64_t target[HS_MAX_DIM] = {0};
    for (int k = 1; k < s->grid.ndim; k++) {
        const int b = s->scene.lattice.row_of_axis[k];
        target[k] = s->sparse.row_index[row * (s->grid.ndim - 1) + k - 1] + offset->offset[k];
        if (b >= 0) {
            image[b] = sparse_floor_divide(target[k], s->grid.shape[k]);
            target[k] -= image[b] * s->grid.shape[k];
        }
    }
    return hs_sparse_find_row(&s->sparse, target, hint);
}

/* The points of one window for the group: `own` if it is in the own row and image. */
static inline int64_t
sparse_scan(const sparse_scene *s, const hs_sparse_group *group, int32_t first, int32_t end,
            bool own, const int64_t *image, sparse_visit visit, void *context)
{
    int64_t candidates = 0;
    for (int32_t si = group->first; si < group->last; si++) {
        const int32_t from = own && first <= si ? si + 1 : first;
        candidates += end > from ? end - from : 0;
        for (int32_t sj = from; visit != NULL && sj < end; sj++)
            visit(context, s, si, sj, image);
    }
    return candidates;
}

static inline int64_t
sparse_scan_link(const sparse_scene *s, const hs_sparse_group *group, int64_t row, bool own_row,
                 const hs_stencil_row *link, hs_sparse_cursor *cursor, int64_t *image,
                 sparse_visit visit, void *context)
{
    const int     b = s->scene.lattice.row_of_axis[0];
    const int64_t n_x = s->grid.shape[0];
    const int64_t low = group->x_first + link->first, high = group->x_last + link->last;
    int64_t       candidates = 0;
    int32_t       first, end;
    if (b < 0) {
        hs_sparse_window(&s->sparse, row, low, high, cursor, &first, &end);
        return sparse_scan(s, group, first, end, own_row, image, visit, context);
    }
    for (int64_t turn = sparse_floor_divide(low, n_x); turn * n_x <= high; turn++) {
        image[b] = turn;
        hs_sparse_window(&s->sparse, row, low - turn * n_x, high - turn * n_x, cursor, &first,
                         &end);
        candidates +=
            sparse_scan(s, group, first, end, own_row && turn == 0, image, visit, context);
    }
    return candidates;
}

/* Returns the number of candidates; visit NULL: only counts. */
static inline int64_t
sparse_walk(const sparse_scene *s, sparse_visit visit, void *context)
{
    const int64_t     n_links = s->stencil.n_rows;
    int64_t          *hints = calloc((size_t)n_links, sizeof *hints);
    hs_sparse_cursor *cursors = calloc((size_t)n_links, sizeof *cursors);
    int64_t          *rows = calloc((size_t)n_links, sizeof *rows);
    int64_t(*images)[HS_MAX_DIM] = calloc((size_t)n_links, sizeof *images);
    int64_t candidates = 0;
    for (int64_t row = 0; row < s->sparse.n_rows; row++) {
        hs_sparse_group group;
        memset(images, 0, (size_t)n_links * sizeof *images);
        for (int64_t l = 0; l < n_links; l++)
            rows[l] = sparse_neighbour(s, row, &s->stencil.rows[l], &hints[l], images[l]);
        CHECK(rows[0] == row);
        hs_sparse_first_group(&s->sparse, row, &group);
        while (hs_sparse_next_group(&s->sparse, row, SPARSE_GROUP, &group)) {
            for (int64_t l = 0; l < n_links; l++) {
                if (rows[l] >= 0)
                    candidates += sparse_scan_link(s, &group, rows[l], l == 0, &s->stencil.rows[l],
                                                   &cursors[l], images[l], visit, context);
            }
        }
    }
    free(hints);
    free(cursors);
    free(rows);
    free(images);
    return candidates;
}

#endif
