/* SPDX-License-Identifier: BSD-3-Clause */
/* api_cells.c: the public functions of cells: points that are copied, sorted once and searched many
 * times. */
#include "arguments.h"
#include "api_cells.h"
#include "../scene/points.h"
#include "../search/search_open.h"

/* The points in memory of the cells: the caller cannot change them between searches. */
static hs_status
keep_points(const hs_points *points, hs_cells *cells)
{
    const int64_t width = points->ndim * (int64_t)sizeof(double);
    cells->copy = hs_alloc(&cells->call.account, HS_FOR_ORIGINALS, points->n, (size_t)width);
    if (cells->copy == NULL) {
        return HS_ERR_MEMORY;
    }
    hs_points_copy(points, cells->copy);
    cells->points = (hs_points){.data = cells->copy,
                                .n = points->n,
                                .ndim = points->ndim,
                                .real = HS_FLOAT64,
                                .row_stride = (ptrdiff_t)width,
                                .column_stride = sizeof(double)};
    return HS_OK;
}

/* The options that cells are built with: they keep all that a later search may want. */
static hs_options
options_of_cells(const hs_options *options)
{
    hs_options of_cells = *options;
    of_cells.want = HS_WANT_SHIFT;
    of_cells.out = NULL;
    return of_cells;
}

static hs_status
build_cells(const hs_points *points, const hs_options *options, hs_cells *cells,
            hs_failure *failure)
{
    const hs_options of_cells = options_of_cells(options);
    hs_call         *call = &cells->call;
    failure = hs_call_enter(&of_cells, failure, call);
    call->account.is_kept = true;
    hs_search_begin(call, &cells->search);
    hs_status status =
        hs_check_arguments(points, NULL, cells->has_box ? &cells->box : NULL, &of_cells, failure);
    if (status == HS_OK) {
        status = keep_points(points, cells);
    }
    if (status == HS_OK) {
        /* keeps_none: no pairs are kept by this call */
        const hs_sets sets = {.points = &cells->points, .is_kept = true, .keeps_none = true};
        hs_call_gather(call, points->n / HS_POINTS_MADE_READY);
        status =
            hs_search_build(&sets, cells->has_box ? &cells->box : NULL, &cells->search, failure);
    }
    if (status == HS_OK && cells->trees == NULL) {
        status = HS_ERR_MEMORY;
    }
    hs_call_tell_limit(call, status, failure);
    hs_call_leave(call, 0);
    hs_call_detach(call);
    return status;
}

hs_status
hs_cells_build(const hs_points *points, const hs_box *box, const hs_options *options,
               hs_cells **result, hs_failure *failure)
{
    if (result != NULL) {
        *result = NULL;
    }
    if (!hs_can_begin(result, options)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_cells *cells = hs_alloc(NULL, HS_FOR_CELLS, 1, sizeof *cells);
    if (cells == NULL) {
        return hs_end_early(HS_ERR_MEMORY, options, failure);
    }
    cells->copy = NULL;
    cells->trees = hs_nearest_kept_new();
    cells->has_box = box != NULL;
    if (box != NULL) {
        cells->box = *box;
    }
    const hs_status status = build_cells(points, options, cells, failure);
    if (status != HS_OK) {
        hs_cells_free(cells);
        return status;
    }
    *result = cells;
    return HS_OK;
}

void
hs_cells_free(hs_cells *cells)
{
    if (cells == NULL) {
        return;
    }
    hs_search_close(&cells->search);
    hs_free(&cells->call.account, cells->copy);
    hs_account_close(&cells->call.account);
    hs_nearest_kept_free(cells->trees);
    hs_free(NULL, cells);
}

void
hs_cells_points(const hs_cells *cells, hs_points *points)
{
    if (points != NULL) {
        *points = cells != NULL ? cells->points : (hs_points){.data = NULL};
    }
}

const hs_box *
hs_cells_box(const hs_cells *cells)
{
    return cells != NULL && cells->has_box ? &cells->box : NULL;
}
