/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * dynamic.h: a list of points that come, go and move, each under a key.
 *
 * Each point is an entry: wrapped position, key and cell side by side, so that a query reads cells
 * only. The entries of a cell lie in one block of a power of two; a block that is full is replaced
 * by one of twice the size. A map leads from keys to entries. Removal moves the last entry of the
 * cell into the gap and tells the map: it takes the same time however crowded the cell is.
 */
#ifndef HS_DYNAMIC_H
#define HS_DYNAMIC_H

#include "../../halfshell_dynamic.h"
#include "../base/fpenv.h"
#include "../box/lattice.h"
#include "cell_axes.h"
#include "cell_table.h"
#include "entries.h"
#include "gate.h"
#include "key_map.h"
#include "offsets.h"

struct hs_dynamic {
    hs_storage storage;
    bool       inclusive;
    hs_fpenv   held_env;     /* hs_dynamic_hold */
    bool       keeps_blocks; /* empty cells keep their blocks: others are about to come */
    double     cell_size, max_radius, grid_bytes;
    bool       has_box;
    hs_box     box; /* as given */
    hs_lattice lattice;
    double     spread;            /* sum of all |entries| of B */
    double     row_error;         /* sum of the errors of B */
    bool       moves[HS_MAX_DIM]; /* whether B does, along each coordinate axis */
    double     most_terms;        /* of wrapping: beyond, X errs by a period or so */
    double     magnitude; /* of wrapping, of all points that were ever here: at most most_terms */
    hs_axes    axes;
    hs_offsets offsets;
    hs_entries entries;
    hs_key_map map;
    hs_cell_table        cells;
    int64_t              n_without; /* entries without a position, whose coordinates are NaN */
    int64_t              changes;
    hs_gate              gate;
    hs_dynamic_hooks     hooks;
    hs_dynamic_counters *counters; /* borrowed, or NULL */
};

/* A position, made ready: place_point.h. */
typedef struct hs_placed hs_placed;

#endif
