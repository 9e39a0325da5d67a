/* SPDX-License-Identifier: BSD-3-Clause */
/* call_kinds.h: scenes of several kinds, with good arguments for every function of calls.h: each
 * takes another way through the search. */
#ifndef HS_CALL_KINDS_H
#define HS_CALL_KINDS_H

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
    const char  *name;
    scene_kind   box;
    int          n;
    double       cutoff; /* boxes are some 4 long, points lie within 4 of the origin */
    unsigned     want;
    double       apart;    /* of clusters; 0: there are none */
    int          exponent; /* everything times 2^exponent */
    int          threads;
    bool         sorted, narrow, into;
    bool         one_radius; /* of all points, so that a search by reach is one search */
    bool         grows; /* many more pairs than there seem to be: what is refused is tried again */
    hs_precision precision;
} scene_of_calls;

static const scene_of_calls kinds[] = {
    {.name = "dense", .box = SCENE_OPEN, .n = 150, .cutoff = 1.0, .want = HS_WANT_I | HS_WANT_J},
    {.name = "sparse",
     .box = SCENE_OPEN,
     .n = 120,
     .cutoff = 0.6,
     .apart = 3e5,
     .want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE},
    {.name = "images",
     .box = SCENE_TRICLINIC,
     .n = 20,
     .cutoff = 4.0,
     .one_radius = true,
     .want = ALL},
    {.name = "float32",
     .box = SCENE_ALIGNED,
     .n = 100,
     .cutoff = 1.0,
     .narrow = true,
     .want = HS_WANT_J | HS_WANT_VECTOR},
    {.name = "sorted", .box = SCENE_MIXED, .n = 60, .cutoff = 1.5, .sorted = true, .want = ALL},
    {.name = "threads",
     .box = SCENE_ALIGNED,
     .n = 330,
     .cutoff = 0.7,
     .threads = 2,
     .one_radius = true,
     .want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT},
    {.name = "into",
     .box = SCENE_SHEARED,
     .n = 60,
     .cutoff = 1.2,
     .into = true,
     .want = HS_WANT_I | HS_WANT_J},
    {.name = "double",
     .box = SCENE_TURNED,
     .n = 60,
     .cutoff = 1.2,
     .precision = HS_DOUBLE,
     .want = HS_WANT_BOTH},
    {.name = "extreme", .box = SCENE_OPEN, .n = 60, .cutoff = 1.2, .exponent = 1010, .want = ALL},
    {.name = "crowds",
     .box = SCENE_OPEN,
     .n = 210,
     .cutoff = 9.0,
     .apart = 3e5,
     .grows = true,
     .want = ALL},
    {.name = "crowds, threads",
     .box = SCENE_OPEN,
     .n = 210,
     .cutoff = 9.0,
     .apart = 3e5,
     .grows = true,
     .threads = 2,
     .want = HS_WANT_J | HS_WANT_DISTANCE},
};

enum { KINDS = sizeof kinds / sizeof kinds[0] };

/* One of them, and all that calls want beside it. */
static struct {
    random_scene   of, asking;
    float          x[SCENE_POINTS * 3], q[N_QUERIES * 3];
    hs_points      points, queries;
    hs_options     options;
    hs_pair_arrays out;
    int64_t        i[MOST_PAIRS], j[MOST_PAIRS];
    int32_t        types[SCENE_POINTS];
    double         weights[SCENE_POINTS], edges[N_EDGES];
    double         radii[SCENE_POINTS];
    hs_reach       reach;
    int64_t        counts[CALL_ROOM];
    double         sums[CALL_ROOM];
    hs_histogram   histogram;
    int64_t        first[N_SYSTEMS + 1], first_query[N_SYSTEMS + 1];
    hs_systems     systems;
    hs_visit       visit;
    call           c;
} s;

static inline hs_points
make_points(const scene_of_calls *kind, random_scene *of, int n, float *narrow)
{
    const ptrdiff_t size = kind->narrow ? sizeof(float) : sizeof(double);
    for (int e = 0; e < 3 * n; e++) {
        of->x[e] += kind->apart * (e / 3 % 7);
        narrow[e] = (float)of->x[e];
    }
    if (kind->exponent > 0)
        of->x[0] = 0x1p-1070; /* a digit that scaling would lose: originals are kept */
    return (hs_points){.data = kind->narrow ? (const void *)narrow : of->x,
                       .n = n,
                       .ndim = 3,
                       .real = kind->narrow ? HS_FLOAT32 : HS_FLOAT64,
                       .row_stride = 3 * size,
                       .column_stride = size};
}

static inline void
make_histogram(const scene_of_calls *kind)
{
    for (int p = 0; p < SCENE_POINTS; p++) {
        s.types[p] = p % 2;
        s.weights[p] = p % 5 - 1.75;
    }
    for (int k = 0; k < N_EDGES; k++)
        s.edges[k] = ldexp(kind->cutoff * (k + 1) / N_EDGES, kind->exponent);
    s.histogram = (hs_histogram){.n_edges = N_EDGES,
                                 .edges = s.edges,
                                 .n_types = 2,
                                 .of_points = {s.types, s.weights},
                                 .of_queries = {s.types, s.weights},
                                 .counts = s.counts,
                                 .sums = s.sums};
}

/* Radii: the cutoff for each fifth point and an eighth of it for the others, or for all points. */
static inline void
make_reach(const scene_of_calls *kind)
{
    for (int p = 0; p < SCENE_POINTS; p++) {
        const double size = p % 5 == 0 || kind->one_radius ? 1.0 : 0.125;
        s.radii[p] = ldexp(size * kind->cutoff, kind->exponent);
    }
    s.reach = (hs_reach){.rule = HS_RULE_MAX, .radii = s.radii, .query_radii = s.radii};
}

static inline void
make_call(const scene_of_calls *kind)
{
    harness_random random = {2026};
    make_scene(&random, kind->box, 3, N_QUERIES, 4.0, kind->exponent, &s.asking);
    make_scene(&random, kind->box, 3, kind->n, 4.0, kind->exponent, &s.of);
    s.points = make_points(kind, &s.of, kind->n, s.x);
    s.queries = make_points(kind, &s.asking, N_QUERIES, s.q);
    make_histogram(kind);
    make_reach(kind);
    s.options = hs_options_default();
    s.options.cutoff = ldexp(kind->cutoff, kind->exponent);
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
    s.systems = (hs_systems){
        .n = N_SYSTEMS, .first = s.first, .box = s.of.scene.box, .first_query = s.first_query};
    s.visit = (hs_visit){.pair = call_note_pair, .thread_safe = true};
    s.c = (call){.points = &s.points,
                 .queries = &s.queries,
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
                 .ndim = 3,
                 .index_bytes = 8,
                 .n_points = kind->n};
}

#endif
