/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * stencil.h: the forward half of the neighbouring rows of cells. A row is a line of cells along the
 * first grid axis. With the offset of j's cell from i's counted over images, each pair of cells
 * occurs once as a forward offset and once as its opposite, so following the forward ones only
 * visits each pair of points once, in boxes of any size, without comparing indices.
 */
#ifndef HS_STENCIL_H
#define HS_STENCIL_H

#include "grid.h"

/* Neighbouring row; offset[k] for axes k >= 1 (offset[0] unused). Cells from x + first to x + last
 * of that row can hold neighbours of points in cell x. */
typedef struct hs_stencil_row {
    int32_t offset[HS_MAX_DIM];
    int32_t first, last;
} hs_stencil_row;

typedef struct hs_stencil {
    hs_stencil_row *rows; /* owned; rows[0] is the own row, with first = 0 unless full */
    int64_t         n_rows;
} hs_stencil;

/* Polls now and then. HS_ERR_MEMORY or HS_ERR_BOX_SKEWED when the rows do not fit. is_full: the
 * backward half as well, for points that meet all their neighbours. */
hs_status hs_stencil_build(hs_account *account, const hs_options *options, const hs_scene *scene,
                           const hs_grid *grid, bool is_full, hs_stencil *stencil);

/* Number of rows that hs_stencil_build would look at, before it drops those out of reach. */
double hs_stencil_bound(const hs_grid *grid);

/* Bytes that the rows take at least, in boxes along the coordinate axes; elsewhere about so
 * many. */
double hs_stencil_bytes(const hs_grid *grid, bool is_full);

void hs_stencil_free(hs_account *account, hs_stencil *stencil);

#endif
