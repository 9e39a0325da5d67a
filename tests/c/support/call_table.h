/* SPDX-License-Identifier: BSD-3-Clause */
/* call_table.h: the table of all calls, with what each of them uses and refuses; calls.h has those
 * that search for pairs. */
#ifndef HS_CALL_TABLE_H
#define HS_CALL_TABLE_H

#include <float.h>

#include "among.h"
#include "calls.h"

/* ---- functions that make or need objects that are kept: cells and Verlet lists ---- */

static inline hs_status
call_cells_build(call *c, hs_failure *failure)
{
    hs_cells       *cells = CALL_NOTHING;
    const hs_status status = hs_cells_build(c->points, c->box, c->options, RESULT(cells), failure);
    if (!c->has_result) {
        CHECK(status != HS_OK && cells == CALL_NOTHING);
        return status;
    }
    CHECK((status == HS_OK) == (cells != NULL) && cells != CALL_NOTHING);
    if (status == HS_OK) {
        hs_layout layout;
        hs_points points;
        hs_cells_layout(cells, &layout);
        hs_cells_points(cells, &points);
        CHECK((hs_cells_box(cells) != NULL) == (c->box != NULL) && points.n == c->points->n);
        c->answer = hash_bytes(6, layout.order, (size_t)layout.n_points * sizeof(int32_t));
        hs_cells_free(cells);
    }
    return status;
}

static inline hs_status
call_cells_find(call *c, hs_failure *failure)
{
    int64_t         cell[CALL_ROOM];
    const hs_status status = hs_cells_find(c->cells, c->queries, RESULT(cell[0]), failure);
    return call_take_counts(c, status, cell, status == HS_OK ? c->queries->n : 0);
}

static inline hs_status
call_cells_candidates(call *c, hs_failure *failure)
{
    hs_pairs       *ranges = CALL_NOTHING;
    const hs_status status =
        hs_cells_candidates(c->cells, c->queries, c->options, RESULT(ranges), failure);
    if (status == HS_OK) {
        const int64_t n = hs_pairs_length(ranges);
        CHECK(hs_pairs_rows(ranges) == (c->queries != NULL ? c->queries->n : c->n_points));
        c->answer = hash_bytes((uint64_t)n, hs_pairs_array(ranges, HS_WANT_J), (size_t)n * 8);
        hs_pairs_free(ranges);
    } else {
        CHECK(ranges == (c->has_result ? NULL : CALL_NOTHING));
    }
    return status;
}

/* A step that needs a new list, whose pairs the next call finds. */
static inline hs_status
call_verlet_update(call *c, hs_failure *failure)
{
    bool            rebuilt = false;
    const hs_status status = hs_verlet_update(c->list, c->points, c->box, c->options, c->skin, true,
                                              RESULT(rebuilt), failure);
    CHECK(rebuilt == (status == HS_OK));
    c->answer = status == HS_OK ? (uint64_t)hs_verlet_look(c->list).n_listed : c->answer;
    return status;
}

static inline hs_status
call_verlet_find(call *c, hs_failure *failure)
{
    hs_pairs       *pairs = CALL_NOTHING;
    const hs_status status = hs_verlet_find(c->list, c->options, RESULT(pairs), failure);
    return call_take_pairs(c, status, pairs);
}

/* What a function works on: those of cells, a stream and a list that it uses, from arguments that
 * are good. A list has a step behind it, unless the function takes the first one. */
static inline void
call_make_objects(call *c, unsigned uses)
{
    bool rebuilt;
    c->in_cells = uses & USES_CELLS;
    c->by_reach = uses & USES_REACH;
    c->in_systems = uses & USES_SYSTEMS;
    if (uses & USES_CELLS)
        CHECK(hs_cells_build(c->points, c->box, c->options, &c->cells, NULL) == HS_OK);
    if (uses & USES_STREAM)
        CHECK(hs_stream_open(AMONG(c->points, c->box), c->options, c->max_pairs, &c->stream,
                             NULL) == HS_OK);
    if (uses & USES_LIST)
        c->list = hs_verlet_new();
    if ((uses & USES_LIST) && !(uses & USES_SKIN))
        CHECK(hs_verlet_update(c->list, c->points, c->box, c->options, c->skin, false, &rebuilt,
                               NULL) == HS_OK);
}

static inline void
call_free_objects(call *c)
{
    hs_stream_free(c->stream);
    hs_cells_free(c->cells);
    hs_verlet_free(c->list);
    c->stream = NULL;
    c->cells = NULL;
    c->list = NULL;
}

/* ---- functions that return no pairs of a search: clusters, plans, boxes, measures ---- */

/* Every third point is none that clusters are made of. */
static inline hs_status
call_clusters(call *c, hs_failure *failure)
{
    const hs_among among = call_among(c, NULL);
    int64_t        labels[CALL_ROOM], n = -7;
    uint8_t        core[CALL_ROOM], winding[CALL_ROOM];
    for (int p = 0; p < CALL_ROOM; p++) {
        core[p] = p % 3 != 0;
    }
    const hs_status status =
        hs_clusters_find(&among, c->options, core, labels, winding, RESULT(n), failure);
    CHECK(status == HS_OK ? n >= 0 : n == -7);
    if (status == HS_OK) {
        c->answer = hash_bytes(hash_bytes(2, labels, (size_t)c->n_points * 8), winding, (size_t)n);
    }
    return status;
}

static inline hs_status
call_plan(call *c, hs_failure *failure)
{
    const hs_among among = call_among(c, NULL);
    hs_plan        plan, untouched;
    memset(&plan, 0x5a, sizeof plan);
    memcpy(&untouched, &plan, sizeof plan);
    const hs_status status = hs_plan_make(&among, c->options, RESULT(plan), failure);
    CHECK(status == HS_OK || memcmp(&plan, &untouched, sizeof plan) == 0);
    c->answer = status == HS_OK ? hash_plan(9, &plan) : c->answer;
    return status;
}

static inline hs_status
call_box_measure(call *c, hs_failure *failure)
{
    double          heights[HS_MAX_DIM] = {-7.0}, volume = -7.0;
    const hs_status status = hs_box_measure(c->box, heights, &volume, failure);
    CHECK((status == HS_OK) == (volume >= 0.0));
    if (status == HS_OK)
        c->answer = hash_bytes(hash_bytes(2, &volume, sizeof volume), heights, sizeof heights);
    return status;
}

static inline hs_status
call_box_places(call *c, hs_failure *failure)
{
    double          places[CALL_ROOM] = {0.0};
    hs_box_axes     axes = {.reach = {-7.0}};
    const double    cutoff = c->options != NULL ? c->options->cutoff : 1.0;
    const hs_status status = hs_box_places(c->box, c->points, cutoff, DBL_MAX, places,
                                           CALL_ROOM / HS_MAX_DIM, &axes, failure);
    CHECK((status == HS_OK) == (axes.reach[0] >= 0.0));
    if (status == HS_OK)
        c->answer = hash_bytes(hash_bytes(4, places, sizeof places), axes.reach, sizeof axes.reach);
    return status;
}

static inline hs_status
call_box_wrap(call *c, hs_failure *failure)
{
    double          wrapped[CALL_ROOM];
    int64_t         shift[CALL_ROOM];
    const hs_status status = hs_box_wrap(c->box, c->points, wrapped, shift, failure);
    if (status == HS_OK) {
        const size_t n = (size_t)(c->points->n * c->points->ndim);
        c->answer = hash_bytes(hash_bytes(4, wrapped, n * 8), shift, n * 8);
    }
    return status;
}

/* Each point and the one seven behind it. */
static inline hs_status
call_measure(call *c, hs_failure *failure)
{
    int64_t   i[CALL_ROOM], j[CALL_ROOM];
    hs_pairs *pairs = CALL_NOTHING;
    for (int64_t e = 0; e < c->n_points; e++) {
        i[e] = e;
        j[e] = (e + 7) % c->n_points;
    }
    const hs_pair_numbers given = {.n = c->n_points, .i = i, .j = j};
    const hs_status       status =
        hs_measure(c->points, c->box, &given, c->options, RESULT(pairs), failure);
    return call_take_pairs(c, status, pairs);
}

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
    {"systems_find", call_find, OF_SCENE | USES_SYSTEMS | OF_SEARCH | OF_ARRAYS},
    {"systems_count", call_count, OF_SCENE | USES_SYSTEMS | OF_SEARCH},
    {"systems_neighbors", call_neighbors,
     OF_SCENE | USES_SYSTEMS | USES_QUERIES | OF_SEARCH | OF_ARRAYS},
    {"systems_coordination", call_neighbors_count,
     OF_SCENE | USES_SYSTEMS | USES_QUERIES | OF_SEARCH},
    {"systems_nearest", call_nearest,
     OF_SCENE | USES_SYSTEMS | USES_QUERIES | (OF_SEARCH & ~(NEEDS_FINITE | USES_PRECISION)) |
         USES_INDEX_BYTES | USES_K},
    {"systems_histogram", call_histogram,
     OF_SCENE | USES_SYSTEMS | USES_QUERIES | USES_OPTIONS | USES_CELL_SIZE | USES_KERNEL |
         USES_COUNTERS | USES_HISTOGRAM},
    {"systems_stream", call_stream,
     OF_SCENE | USES_SYSTEMS | (OF_SEARCH & ~USES_COUNTERS) | USES_WANT | USES_INDEX_BYTES |
         USES_MAX_PAIRS},
    {"systems_visit", call_visit, OF_SCENE | USES_SYSTEMS | OF_SEARCH | USES_VISIT},
    {"systems_clusters", call_clusters, OF_SCENE | USES_SYSTEMS | OF_SEARCH},
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
