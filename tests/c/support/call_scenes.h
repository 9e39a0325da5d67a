/* SPDX-License-Identifier: BSD-3-Clause */
/* call_scenes.h: scenes with good arguments for every function of calls.h. */
#ifndef HS_CALL_SCENES_H
#define HS_CALL_SCENES_H

#include "call_table.h"
#include "random_scenes.h"

enum {
    MOST_PAIRS = 20000, /* that any of these calls finds */
    N_QUERIES = 25,
    N_SYSTEMS = 3,
    N_EDGES = 4,
    ALL = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT | HS_WANT_BOTH
};

typedef struct scene_of_calls {
    const char *name;
    scene_kind  box;
    int         ndim; /* 0: 3 */
    int         n;
    double      cutoff; /* boxes are some 4 long, points lie within 4 of the origin; 0: that of
                            some pair */
    unsigned    want;
    double      apart;    /* of clusters; 0: there are none */
    int         exponent; /* everything times 2^exponent */
    int         threads;
    bool        sorted, narrow, into;
    bool        one_radius; /* of all points, so that a search by reach is one search */
    bool        grows; /* many more pairs than there seem to be: what is refused is tried again */
    bool        strict;
    int reaches; /* of pairs: radii, the larger counts; 1: radii, their sum; 2: types; 3: supports */
    uint64_t     seed;      /* 0: 2026 */
    double       cell_size; /* in cutoffs */
    hs_algorithm algorithm;
    hs_precision precision;
} scene_of_calls;

/* One of them, and all that calls want beside it. */
static struct {
    random_scene   of, asking;
    float          x[SCENE_POINTS * HS_MAX_DIM], q[N_QUERIES * HS_MAX_DIM];
    hs_points      points, queries;
    hs_options     options;
    hs_pair_arrays out;
    int64_t        i[MOST_PAIRS], j[MOST_PAIRS];
    int32_t        types[SCENE_POINTS];
    double         weights[SCENE_POINTS], edges[N_EDGES];
    double         radii[SCENE_POINTS], supports[SCENE_POINTS * 9], cutoffs[4];
    hs_reach       reach;
    int64_t        counts[CALL_ROOM];
    double         sums[CALL_ROOM];
    hs_histogram   histogram;
    int64_t        first[N_SYSTEMS + 1], first_query[N_SYSTEMS + 1];
    call_systems   systems;
    hs_visit       visit;
    call           c;
} s;

static inline hs_points
make_points(const scene_of_calls *kind, random_scene *of, int n, float *narrow)
{
    const ptrdiff_t size = kind->narrow ? sizeof(float) : sizeof(double);
    const int       d = of->scene.ndim;
    for (int e = 0; e < d * n; e++) {
        of->x[e] += kind->apart * (e / d % 7);
        narrow[e] = (float)of->x[e];
    }
    if (kind->exponent > 0)
        of->x[0] = 0x1p-1070; /* a digit that scaling would lose: originals are kept */
    return (hs_points){.data = kind->narrow ? (const void *)narrow : of->x,
                       .n = n,
                       .ndim = d,
                       .real = kind->narrow ? HS_FLOAT32 : HS_FLOAT64,
                       .row_stride = d * size,
                       .column_stride = size};
}

static inline void
make_histogram(void)
{
    for (int p = 0; p < SCENE_POINTS; p++) {
        s.types[p] = p % 2;
        s.weights[p] = p % 5 - 1.75;
    }
    for (int k = 0; k < N_EDGES; k++)
        s.edges[k] = s.options.cutoff * (k + 1) / N_EDGES;
    s.histogram = (hs_histogram){
        .n_edges = N_EDGES, .edges = s.edges, .n_types = 2, .counts = s.counts, .sums = s.sums};
}

/* Radii: the cutoff for each fifth point and an eighth of it for the others, or for all points. */
static inline void
make_reach(const scene_of_calls *kind)
{
    const int d = s.points.ndim;
    for (int p = 0; p < SCENE_POINTS; p++) {
        const double size = p % 5 == 0 || kind->one_radius ? 1.0 : 0.125;
        s.radii[p] = size * s.options.cutoff;
        for (int r = 0; kind->reaches == 3 && r < d; r++)
            for (int k = 0; k < d; k++)
                s.supports[(p * d + r) * d + k] = r == k ? 1.0 + 0.5 * ((p + r) % 7)
                                                         : 0.125 * (p % 3);
    }
    for (int t = 0; t < 4; t++)
        s.cutoffs[t] = s.options.cutoff * (t == 0 ? 1.0 : t == 3 ? 0.125 : 0.5);
    s.reach = (hs_reach){.rule = kind->reaches == 1 ? HS_RULE_SUM : HS_RULE_MAX};
    if (kind->reaches == 2)
        s.reach = (hs_reach){.n_types = 2, .cutoffs = s.cutoffs};
    if (kind->reaches == 3)
        s.reach = (hs_reach){.rule = HS_RULE_MAX, .has_supports = true, .extent = s.options.cutoff};
}

static inline void
make_call(const scene_of_calls *kind)
{
    harness_random random = {kind->seed != 0 ? kind->seed : 2026};
    const int      d = kind->ndim != 0 ? kind->ndim : 3;
    make_scene(&random, kind->box, d, N_QUERIES, 4.0, kind->exponent, &s.asking);
    make_scene(&random, kind->box, d, kind->n, 4.0, kind->exponent, &s.of);
    s.points = make_points(kind, &s.of, kind->n, s.x);
    s.queries = make_points(kind, &s.asking, N_QUERIES, s.q);
    s.options = hs_options_default();
    s.options.cutoff = kind->cutoff != 0.0 ? ldexp(kind->cutoff, kind->exponent)
                                           : s.of.scene.cutoff;
    make_histogram();
    make_reach(kind);
    s.options.inclusive = !kind->strict;
    s.options.algorithm = kind->algorithm;
    s.options.cell_size = kind->cell_size * s.options.cutoff;
    s.options.want = kind->want;
    s.options.sorted = kind->sorted;
    s.options.threads = kind->threads;
    s.options.precision = kind->precision;
    s.out = (hs_pair_arrays){.capacity = MOST_PAIRS, .index_bytes = 8, .i = s.i, .j = s.j};
    s.options.out = kind->into ? &s.out : NULL;
    for (int n = 0; n <= N_SYSTEMS; n++)
        s.first[n] = n * kind->n / N_SYSTEMS;
    for (int n = 0; n <= N_SYSTEMS; n++)
        s.first_query[n] = n * N_QUERIES / N_SYSTEMS;
    s.systems = (call_systems){.n = N_SYSTEMS, .first = s.first, .first_query = s.first_query};
    s.visit = (hs_visit){.pair = call_note_pair, .thread_safe = true};
    const hs_set known = {
        .radii = s.radii, .supports = s.supports, .weights = s.weights, .types = s.types};
    s.c = (call){.points = &s.points,
                 .queries = &s.queries,
                 .known = known,
                 .of_queries = known,
                 .box = s.of.scene.box,
                 .options = &s.options,
                 .histogram = &s.histogram,
                 .systems = &s.systems,
                 .visit = &s.visit,
                 .reach = &s.reach,
                 .k = 5,
                 .max_pairs = 500,
                 .skin = 0.25 * s.options.cutoff,
                 .has_result = true,
                 .ndim = d,
                 .index_bytes = 8,
                 .n_points = kind->n};
}

/* All points a little further, or so far that the list must be built again. */
static inline void
move_points(const scene_of_calls *kind, double by)
{
    for (int e = 0; e < s.points.ndim * kind->n; e++) {
        s.of.x[e] += ldexp(by * (e % 4), kind->exponent);
        s.x[e] = (float)s.of.x[e];
    }
}

#endif
