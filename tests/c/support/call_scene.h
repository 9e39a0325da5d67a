/* SPDX-License-Identifier: BSD-3-Clause */
/* call_scene.h: one small scene with good arguments for every function of calls.h, each of them
 * where a test can spoil it. */
#ifndef HS_CALL_SCENE_H
#define HS_CALL_SCENE_H

#include <math.h>

#include "call_table.h"

enum { N_OF_CALL = 12, N_QUERIES_OF_CALL = 5, N_SYSTEMS_OF_CALL = 3, N_EDGES_OF_CALL = 3 };

typedef struct call_scene {
    double         x[N_OF_CALL * 3], q[N_QUERIES_OF_CALL * 3];
    int64_t        first[N_SYSTEMS_OF_CALL + 1], first_query[N_SYSTEMS_OF_CALL + 1];
    double         rows[N_SYSTEMS_OF_CALL * 9], cutoffs[N_SYSTEMS_OF_CALL];
    double         edges[N_EDGES_OF_CALL];
    int32_t        types[N_OF_CALL], query_types[N_QUERIES_OF_CALL];
    double         weights[N_OF_CALL], query_weights[N_QUERIES_OF_CALL];
    double         radii[N_OF_CALL], query_radii[N_QUERIES_OF_CALL];
    int64_t        i[CALL_ROOM], j[CALL_ROOM], counts[CALL_ROOM];
    double         sums[CALL_ROOM];
    hs_points      points, queries;
    hs_box         box;
    hs_pair_arrays out; /* of i and j; options.out is NULL at first */
    hs_counters    counters;
    hs_options     options;
    hs_histogram   histogram;
    hs_systems     systems;
    hs_visit       visit;
    hs_reach       reach;
    call           c;
} call_scene;

/* Numbers without a pattern, so that no two distances are the same. */
static inline void
call_fill_numbers(call_scene *s)
{
    harness_random random = {511};
    for (int e = 0; e < N_OF_CALL * 3; e++)
        s->x[e] = 2.0 * random_unit(&random);
    for (int e = 0; e < N_QUERIES_OF_CALL * 3; e++)
        s->q[e] = 2.0 * random_unit(&random);
    for (int p = 0; p < N_OF_CALL; p++) {
        s->types[p] = p % 2;
        s->weights[p] = random_unit(&random);
        s->radii[p] = p % 2 ? 1.0 : 0.25;
    }
    for (int p = 0; p < N_QUERIES_OF_CALL; p++) {
        s->query_types[p] = p % 2;
        s->query_weights[p] = random_unit(&random);
        s->query_radii[p] = p % 2 ? 1.0 : 0.25;
    }
    for (int n = 0; n <= N_SYSTEMS_OF_CALL; n++) {
        s->first[n] = n * N_OF_CALL / N_SYSTEMS_OF_CALL;
        s->first_query[n] = n * N_QUERIES_OF_CALL / N_SYSTEMS_OF_CALL;
    }
    for (int n = 0; n < N_SYSTEMS_OF_CALL; n++) {
        s->cutoffs[n] = 1.0;
        for (int k = 0; k < 3; k++)
            s->rows[n * 9 + k * 4] = 2.0 + n;
    }
    for (int k = 0; k < N_EDGES_OF_CALL; k++)
        s->edges[k] = 0.5 * (k + 1);
}

/* A box with an open axis. */
static inline void
call_fill_scene(call_scene *s)
{
    memset(s, 0, sizeof *s);
    call_fill_numbers(s);
    s->points = points_in_space(s->x, N_OF_CALL);
    s->queries = points_in_space(s->q, N_QUERIES_OF_CALL);
    s->box = (hs_box){.ndim = 3,
                      .periodic = {true, true, false},
                      .rows = {{2.0, 0.1, 0.0}, {0.3, 2.0, 0.0}, {0.0, 0.0, 2.0}}};
    s->out = (hs_pair_arrays){.capacity = CALL_ROOM, .index_bytes = 8, .i = s->i, .j = s->j};
    s->options = hs_options_default();
    s->options.cutoff = 1.0;
    s->options.counters = &s->counters;
    s->histogram = (hs_histogram){.n_edges = N_EDGES_OF_CALL,
                                  .edges = s->edges,
                                  .n_types = 2,
                                  .of_points = {s->types, s->weights},
                                  .of_queries = {s->query_types, s->query_weights},
                                  .counts = s->counts,
                                  .sums = s->sums};
    s->systems = (hs_systems){
        .n = N_SYSTEMS_OF_CALL, .first = s->first, .box = &s->box, .first_query = s->first_query};
    s->visit = (hs_visit){.pair = call_note_pair};
    s->reach = (hs_reach){.rule = HS_RULE_MAX, .radii = s->radii, .query_radii = s->query_radii};
    s->c = (call){.points = &s->points,
                  .queries = &s->queries,
                  .box = &s->box,
                  .options = &s->options,
                  .histogram = &s->histogram,
                  .systems = &s->systems,
                  .visit = &s->visit,
                  .reach = &s->reach,
                  .k = 3,
                  .max_pairs = 4,
                  .skin = 0.25,
                  .has_result = true,
                  .ndim = 3,
                  .index_bytes = 8,
                  .n_points = N_OF_CALL};
}

#endif
