/* SPDX-License-Identifier: BSD-3-Clause */
/* kept_calls.h: as calls.h, the functions that make or need objects that are kept: cells and Verlet
 * lists. */
#ifndef HS_KEPT_CALLS_H
#define HS_KEPT_CALLS_H

#include "calls.h"
#include "among.h"

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

#endif
