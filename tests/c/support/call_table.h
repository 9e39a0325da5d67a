/* SPDX-License-Identifier: BSD-3-Clause */
/* call_table.h: the table of all calls, with what each of them uses and refuses. */
#ifndef HS_CALL_TABLE_H
#define HS_CALL_TABLE_H

#include "kept_calls.h"
#include "other_calls.h"

#define OF_VERLET \
    (OF_SCENE | USES_OPTIONS | USES_CUTOFF | NEEDS_FINITE | USES_KERNEL | USES_RESULT | USES_LIST)

static const call_kind call_kinds[] = {
    {"pairs_find", call_find, OF_SCENE | OF_SEARCH | OF_ARRAYS},
    {"pairs_count", call_count, OF_SCENE | USES_QUERIES | OF_SEARCH},
    {"neighbors_find", call_neighbors, OF_SCENE | USES_QUERIES | OF_SEARCH | OF_ARRAYS},
    {"neighbors_count", call_neighbors_count, OF_SCENE | USES_QUERIES | OF_SEARCH},
    {"pairs_histogram", call_histogram,
     OF_SCENE | USES_QUERIES | USES_OPTIONS | USES_CELL_SIZE | USES_KERNEL | USES_COUNTERS |
         USES_HISTOGRAM},
    {"nearest_find", call_nearest,
     OF_SCENE | USES_QUERIES | (OF_SEARCH & ~(NEEDS_FINITE | USES_PRECISION)) | USES_INDEX_BYTES |
         USES_K},
    {"stream_open", call_stream,
     OF_SCENE | (OF_SEARCH & ~USES_COUNTERS) | USES_WANT | USES_INDEX_BYTES | USES_MAX_PAIRS},
    {"stream_next", call_stream_next, USES_STREAM | USES_RESULT},
    {"pairs_visit", call_visit, OF_SCENE | OF_SEARCH | USES_VISIT},
    {"clusters_find", call_clusters, OF_SCENE | OF_SEARCH},
    {"clusters_find in cells", call_clusters, USES_CELLS | OF_SEARCH},
    {"pairs_find by reach", call_find, OF_SCENE | OF_REACH | OF_ARRAYS},
    {"pairs_count by reach", call_count, OF_SCENE | USES_QUERIES | OF_REACH},
    {"neighbors_find by reach", call_neighbors, OF_SCENE | USES_QUERIES | OF_REACH | OF_ARRAYS},
    {"neighbors_count by reach", call_neighbors_count, OF_SCENE | USES_QUERIES | OF_REACH},
    {"stream_open by reach", call_stream,
     OF_SCENE | (OF_REACH & ~USES_COUNTERS) | USES_WANT | USES_INDEX_BYTES | USES_MAX_PAIRS},
    {"pairs_visit by reach", call_visit, OF_SCENE | OF_REACH | USES_VISIT},
    {"clusters_find by reach", call_clusters, OF_SCENE | OF_REACH},
    {"plan_make by reach", call_plan, OF_SCENE | OF_REACH | OF_ARRAYS},
    {"neighbors_count by reach in cells", call_neighbors_count,
     USES_CELLS | USES_QUERIES | OF_REACH},
    {"cells_build", call_cells_build, OF_SCENE | OF_SEARCH | USES_INDEX_BYTES},
    {"pairs_find in cells", call_find, USES_CELLS | OF_SEARCH | OF_ARRAYS},
    {"pairs_count in cells", call_count, USES_CELLS | USES_QUERIES | OF_SEARCH},
    {"neighbors_find in cells", call_neighbors, USES_CELLS | USES_QUERIES | OF_SEARCH | OF_ARRAYS},
    {"neighbors_count in cells", call_neighbors_count, USES_CELLS | USES_QUERIES | OF_SEARCH},
    {"pairs_histogram in cells", call_histogram,
     USES_CELLS | USES_QUERIES | USES_OPTIONS | USES_CELL_SIZE | USES_KERNEL | USES_COUNTERS |
         USES_HISTOGRAM},
    {"nearest_find in cells", call_nearest,
     USES_CELLS | USES_QUERIES | (OF_SEARCH & ~(NEEDS_FINITE | USES_PRECISION)) | USES_INDEX_BYTES |
         USES_K},
    {"stream_open in cells", call_stream,
     USES_CELLS | (OF_SEARCH & ~USES_COUNTERS) | USES_WANT | USES_INDEX_BYTES | USES_MAX_PAIRS},
    {"pairs_visit in cells", call_visit, USES_CELLS | OF_SEARCH | USES_VISIT},
    {"cells_find", call_cells_find, USES_CELLS | USES_QUERIES | NEEDS_QUERIES | USES_RESULT},
    {"cells_candidates", call_cells_candidates, USES_CELLS | USES_QUERIES | OF_SEARCH | OF_ARRAYS},
    {"systems_find", call_systems_find, OF_SCENE | USES_SYSTEMS | OF_SEARCH | OF_ARRAYS},
    {"systems_count", call_systems_count, OF_SCENE | USES_SYSTEMS | OF_SEARCH},
    {"systems_neighbors", call_systems_neighbors,
     OF_SCENE | USES_SYSTEMS | USES_QUERIES | OF_SEARCH | OF_ARRAYS},
    {"systems_coordination", call_systems_coordination,
     OF_SCENE | USES_SYSTEMS | USES_QUERIES | OF_SEARCH},
    {"systems_nearest", call_systems_nearest,
     OF_SCENE | USES_SYSTEMS | USES_QUERIES | (OF_SEARCH & ~(NEEDS_FINITE | USES_PRECISION)) |
         USES_INDEX_BYTES | USES_K},
    {"systems_histogram", call_systems_histogram,
     OF_SCENE | USES_SYSTEMS | USES_QUERIES | USES_OPTIONS | USES_CELL_SIZE | USES_KERNEL |
         USES_COUNTERS | USES_HISTOGRAM},
    {"systems_stream", call_systems_stream,
     OF_SCENE | USES_SYSTEMS | (OF_SEARCH & ~USES_COUNTERS) | USES_WANT | USES_INDEX_BYTES |
         USES_MAX_PAIRS},
    {"systems_visit", call_systems_visit, OF_SCENE | USES_SYSTEMS | OF_SEARCH | USES_VISIT},
    {"systems_clusters", call_systems_clusters, OF_SCENE | USES_SYSTEMS | OF_SEARCH},
    {"verlet_update", call_verlet_update, OF_VERLET | USES_SKIN},
    {"verlet_find", call_verlet_find,
     USES_LIST | USES_OPTIONS | USES_CELL_SIZE | OF_ARRAYS | USES_KERNEL | USES_COUNTERS |
         USES_RESULT},
    {"plan_make", call_plan, OF_SCENE | OF_SEARCH | OF_ARRAYS},
    {"measure", call_measure, OF_SCENE | USES_OPTIONS | USES_KERNEL | USES_COUNTERS | USES_RESULT},
    {"box_measure", call_box_measure, USES_BOX | NEEDS_BOX},
    {"box_wrap", call_box_wrap, OF_SCENE | NEEDS_BOX},
    {"box_places", call_box_places, OF_SCENE | USES_CUTOFF | NEEDS_FINITE},
};

enum { CALL_KINDS = sizeof call_kinds / sizeof call_kinds[0] };

#endif
