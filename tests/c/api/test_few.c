/* SPDX-License-Identifier: BSD-3-Clause */
/* test_few.c: pairs of few points are those of a search, to the last bit, and what is refused. */
#include "../../../csrc/halfshell.h"
#include "../support/harness.h"

#include <math.h>
#include <string.h>

void test_few(void);

enum { MOST = 32 };

typedef struct scene {
    hs_few few;
    double points[MOST * HS_MAX_DIM], queries[MOST * HS_MAX_DIM], period[HS_MAX_DIM];
} scene;

/* On a lattice, or anywhere; queries may lie beside the box. */
static void
fill(harness_random *random, double *x, int n, int steps, double from, double to)
{
    for (int k = 0; k < n; k++) {
        const double unit = random_unit(random);
        x[k] = from + (to - from) * (steps > 0 ? floor(unit * steps) / steps : unit);
    }
}

static scene
make_scene_of_few(harness_random *random, int trial)
{
    const double edge = trial % 5 == 0 ? 0x1p-300 : trial % 5 == 1 ? 3e4 : 1.0;
    const int    d = 1 + trial % HS_MAX_DIM, steps = trial % 3 == 0 ? 0 : 2 + trial % 7;
    scene        s = {.few = {.ndim = d,
                              .n_points = (int64_t)(MOST * random_unit(random)),
                              .n_queries = (int64_t)(MOST * random_unit(random)),
                              .cutoff = 0.499 * edge * random_unit(random)}};
    if (steps > 0) {
        s.few.cutoff = edge / steps * (trial % 2 && steps > 3 ? sqrt(2.0) : 0.999);
        s.few.cutoff = s.few.cutoff < 0.5 * edge ? s.few.cutoff : 0.4 * edge;
    }
    fill(random, s.points, MOST * HS_MAX_DIM, steps, 0.0, edge);
    fill(random, s.queries, MOST * HS_MAX_DIM, steps, -0.25 * edge, 1.25 * edge);
    for (int k = 0; k < d; k++)
        s.period[k] = (trial + k) % 4 == 0 ? 0.0 : edge;
    return s;
}

static hs_points
rows_of_doubles(const double *x, int64_t n, int d)
{
    return (hs_points){.data = x,
                       .n = n,
                       .ndim = d,
                       .real = HS_FLOAT64,
                       .row_stride = d * (ptrdiff_t)sizeof(double),
                       .column_stride = sizeof(double)};
}

/* What a search finds; 0: freed by the caller. */
static hs_pairs *
search_for(const hs_few *few)
{
    const int  d = few->ndim;
    hs_set     points = {.at = rows_of_doubles(few->points, few->n_points, d)};
    hs_set     queries = {.at = rows_of_doubles(few->queries, few->n_queries, d)};
    hs_box     box = {.ndim = d};
    hs_among   among = {.points = &points, .queries = few->queries != NULL ? &queries : NULL};
    hs_options options = hs_options_default();
    hs_pairs  *pairs = NULL;
    for (int k = 0; few->period != NULL && k < d; k++) {
        box.periodic[k] = few->period[k] > 0.0;
        box.rows[k][k] = few->period[k];
        among.box = &box;
    }
    options.cutoff = few->cutoff;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
    options.index_bytes = 4;
    options.sorted = true;
    const hs_status status = few->queries != NULL
                                 ? hs_neighbors_find(&among, &options, &pairs, NULL)
                                 : hs_pairs_find(&among, &options, &pairs, NULL);
    CHECK(status == HS_OK);
    return pairs;
}

static void
few_are_those_of_a_search(void)
{
    static int32_t i[HS_FEW_PAIRS], j[HS_FEW_PAIRS];
    static double  d[HS_FEW_PAIRS];
    harness_random random = {20261128};
    int            n_answered = 0;
    for (int trial = 0; trial < 2000; trial++) {
        scene s = make_scene_of_few(&random, trial);
        s.few.points = s.points;
        s.few.queries = trial % 4 < 2 ? s.queries : NULL;
        s.few.period = trial % 6 < 3 ? s.period : NULL;
        const int n = hs_few_pairs(&s.few, i, j, d);
        if (n < 0)
            continue;
        n_answered++;
        hs_pairs    *pairs = search_for(&s.few);
        const size_t size = (size_t)n;
        CHECK(hs_pairs_length(pairs) == n);
        CHECK(n == 0 || !memcmp(hs_pairs_array(pairs, HS_WANT_I), i, size * sizeof *i));
        CHECK(n == 0 || !memcmp(hs_pairs_array(pairs, HS_WANT_J), j, size * sizeof *j));
        CHECK(n == 0 || !memcmp(hs_pairs_array(pairs, HS_WANT_DISTANCE), d, size * sizeof *d));
        hs_pairs_free(pairs);
        CHECK(hs_few_pairs(&s.few, i, j, NULL) == n);
    }
    CHECK(n_answered > 1900);
}

static void
what_is_for_a_search(void)
{
    static int32_t i[HS_FEW_PAIRS], j[HS_FEW_PAIRS];
    static double  many[HS_FEW_PAIRS + 1];
    double         two[] = {0.0, 1.0}, period[] = {4.0};
    hs_few         few = {.ndim = 1, .n_points = 2, .points = two, .cutoff = 1.0};
    CHECK(hs_few_pairs(&few, i, j, NULL) == 1);
    few.period = period;
    CHECK(hs_few_pairs(&few, i, j, NULL) == 1);
    few.cutoff = 2.0; /* half of the period */
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    few.cutoff = nextafter(2.0, 0.0);
    two[1] = 2.0; /* two images */
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    few.cutoff = 1.0;
    CHECK(hs_few_pairs(&few, i, j, NULL) == 0);
    few.period = NULL;
    two[1] = 0x1p-600; /* whose square is zero */
    CHECK(hs_few_pairs(&few, i, j, many) == 1 && many[0] == two[1]);
    many[0] = 0.0;
    few.period = period;
    two[1] = 6.5;
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    const double strange[] = {NAN, -1.0, INFINITY, 0x1p600, 0x1p-401, 0.0};
    for (int k = 0; k < 6; k++) {
        few.cutoff = strange[k];
        few.period = NULL;
        CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    }
    few.cutoff = 1.0;
    two[1] = 0x1p600; /* whose square is infinite */
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    few.ndim = 2;
    few.n_points = 1;
    few.period = (const double[]){1.0, 4.0}; /* the second one is long enough */
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    few.period = NULL;
    few.ndim = 1;
    few.n_points = 2;
    two[0] = NAN;
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    few.n_points = 1;
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    two[0] = INFINITY;
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    two[0] = 0.0;
    CHECK(hs_few_pairs(&few, i, j, NULL) == 0);
    few.points = many;
    few.queries = two;
    few.n_queries = 1;
    few.n_points = HS_FEW_PAIRS;
    CHECK(hs_few_pairs(&few, i, j, NULL) == HS_FEW_PAIRS);
    few.n_points++;
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    few.n_points = HS_FEW_PAIRS;
    few.queries = many;
    few.n_queries = 2;
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    few.n_points = 1;
    few.n_queries = HS_FEW_PAIRS + 1;
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    few.queries = two; /* without any pair */
    few.n_queries = 2;
    few.n_points = 0;
    CHECK(hs_few_pairs(&few, i, j, NULL) == 0);
    two[1] = NAN;
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    few.points = two;
    few.n_points = 2;
    few.n_queries = 0;
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    two[1] = 1.0;
    CHECK(hs_few_pairs(&few, i, j, NULL) == 0);
    few.cutoff = NAN;
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    few.cutoff = 1.0;
    few.ndim = HS_MAX_DIM + 1;
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
    few.ndim = 0;
    CHECK(hs_few_pairs(&few, i, j, NULL) == -1);
}

void
test_few(void)
{
    RUN(few_are_those_of_a_search);
    RUN(what_is_for_a_search);
}
