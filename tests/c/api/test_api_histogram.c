/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_histogram.c: histograms of pairs count what the brute force counts. */
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

void test_api_histogram(void);

enum { MOST_EDGES = 40, N_TYPES = 3 };

/* A histogram of a scene with what it is given and what it finds. */
typedef struct trial {
    random_scene *s;
    int           n_edges;
    double        edges[MOST_EDGES];
    bool          inclusive, last_inclusive;
    int32_t       types[SCENE_POINTS];
    double        weights[SCENE_POINTS]; /* small integers */
    int           n_types;
    int64_t       split; /* points before it ask those from it on; -1: one set */
    int64_t       expected[N_TYPES * N_TYPES * MOST_EDGES], found[N_TYPES * N_TYPES * MOST_EDGES];
    double        expected_sums[N_TYPES * N_TYPES * MOST_EDGES];
    double        sums[N_TYPES * N_TYPES * MOST_EDGES];
    int           n_built; /* times that cells were made */
} trial;

static int
compare_doubles(const void *a, const void *b)
{
    const double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

/* Edges at distances of the scene, or a step beside, and anywhere; some twice, some at zero. */
static void
choose_edges(harness_random *random, trial *t)
{
    const brute_scene *scene = &t->s->scene;
    const double       most = scene->cutoff;
    t->n_edges = 1 + random_below(random, MOST_EDGES);
    for (int k = 0; k < t->n_edges; k++) {
        double edge = most * random_unit(random);
        if (scene->n > 0 && random_below(random, 3)) {
            edge = cutoff_of_some_pair(random, scene);
        }
        if (k > 0 && random_below(random, 8) == 0) {
            edge = t->edges[k - 1];
        }
        if (edge > most) {
            edge = random_below(random, 3) ? most * random_unit(random) : 0.0;
        }
        t->edges[k] = edge;
    }
    if (random_below(random, 6) == 0) { /* so close that their bands overlap */
        for (int k = 1; k < t->n_edges; k++) {
            t->edges[k] = t->edges[k - 1] * (1.0 + 1e-7 * random_unit(random));
        }
    }
    qsort(t->edges, (size_t)t->n_edges, sizeof(double), compare_doubles);
    t->inclusive = random_below(random, 2);
    t->last_inclusive = t->inclusive || random_below(random, 2);
}

static void
choose_marks(harness_random *random, trial *t)
{
    t->n_types = 1 + random_below(random, N_TYPES);
    for (int i = 0; i < SCENE_POINTS; i++) {
        t->types[i] = random_below(random, t->n_types);
        t->weights[i] = random_below(random, 9) - 4;
    }
}

static void
scale_scene(trial *t, int exponent)
{
    brute_scene *scene = &t->s->scene;
    for (int64_t e = 0; e < scene->n * scene->ndim; e++) {
        t->s->x[e] = ldexp(t->s->x[e], exponent);
    }
    for (int l = 0; l < scene->ndim; l++) {
        for (int k = 0; k < scene->ndim; k++) {
            t->s->box.rows[l][k] = ldexp(t->s->box.rows[l][k], exponent);
        }
    }
    for (int k = 0; k < t->n_edges; k++) {
        t->edges[k] = ldexp(t->edges[k], exponent);
    }
}

/* Adds a pair that is below edge k, and not below the one before, by `sign`. */
static void
expect(trial *t, const brute_pair *pair, int k, int sign)
{
    const int    a = t->n_types > 1 ? t->types[pair->i] : 0;
    const int    b = t->n_types > 1 ? t->types[pair->j] : 0;
    const int    ways = t->split < 0 && a != b ? 2 : 1;
    const double weight = sign * t->weights[pair->i] * t->weights[pair->j];
    for (int way = 0; way < ways; way++) {
        const int at = (way ? b * t->n_types + a : a * t->n_types + b) * t->n_edges + k;
        t->expected[at] += sign;
        t->expected_sums[at] += weight;
    }
}

/* False where the brute force gives up. */
static bool
expect_all(trial *t)
{
    brute_scene scene = t->s->scene;
    memset(t->expected, 0, sizeof t->expected);
    memset(t->expected_sums, 0, sizeof t->expected_sums);
    for (int k = 0; k < t->n_edges; k++) {
        brute_list list;
        scene.cutoff = t->edges[k];
        scene.inclusive = k == t->n_edges - 1 ? t->last_inclusive : t->inclusive;
        if (!brute_find(&scene, 2e5, &list)) {
            return false;
        }
        for (int64_t e = 0; e < list.n; e++) {
            const brute_pair *pair = &list.pairs[e];
            if (t->split < 0 || (pair->i < t->split && pair->j >= t->split)) {
                expect(t, pair, k, 1);
                if (k + 1 < t->n_edges) {
                    expect(t, pair, k + 1, -1);
                }
            }
        }
        brute_free(&list);
    }
    return true;
}

/* The same histogram of cells that were made for another cutoff: as large, larger, smaller. */
static hs_status
find_in_cells(trial *t, const hs_points *points, const hs_points *queries,
              const hs_options *options, const hs_histogram *wanted)
{
    static const double factors[] = {1.0, 1.75, 0x1p40, 0.5};
    hs_options          building = *options;
    hs_cells           *cells = NULL;
    building.cutoff = t->edges[t->n_edges - 1] * factors[t->n_built++ % 4];
    building.counters = NULL;
    hs_status status = isfinite(building.cutoff)
                           ? hs_cells_build(points, t->s->scene.box, &building, &cells, NULL)
                           : HS_ERR_MEMORY;
    if (status != HS_OK) { /* a box of so many images that no cells are made for them */
        CHECK(status == HS_ERR_MEMORY);
        return hs_pairs_histogram(QUERIED(points, queries, t->s->scene.box), options, wanted, NULL);
    }
    status = hs_pairs_histogram(QUERIED_CELLS(cells, queries), options, wanted, NULL);
    hs_cells_free(cells);
    return status;
}

static hs_status
find_all(trial *t, bool in_cells, int threads, hs_counters *counters)
{
    const brute_scene *scene = &t->s->scene;
    const int64_t      first = t->split < 0 ? 0 : t->split;
    hs_points          points = points_of(scene), queries = points;
    hs_options         options = options_of(scene);
    hs_histogram       wanted = {.n_edges = t->n_edges,
                                 .edges = t->edges,
                                 .inclusive = t->inclusive,
                                 .last_inclusive = t->last_inclusive,
                                 .n_types = t->n_types,
                                 .of_points = {t->types + first, t->weights + first},
                                 .of_queries = {t->types, t->weights},
                                 .counts = t->found,
                                 .sums = t->sums};
    options.threads = threads;
    options.counters = counters;
    queries.n = first;
    points.n -= first;
    points.data = scene->x + first * scene->ndim;
    if (in_cells) {
        return find_in_cells(t, &points, t->split < 0 ? NULL : &queries, &options, &wanted);
    }
    return hs_pairs_histogram(QUERIED(&points, t->split < 0 ? NULL : &queries, scene->box),
                              &options, &wanted, NULL);
}

/* Returns the pairs that were found. */
static int64_t
compare_once(trial *t, bool in_cells, int threads)
{
    const size_t n = (size_t)(t->n_types * t->n_types * t->n_edges);
    hs_counters  counters;
    memset(t->found, 0xff, sizeof t->found);
    CHECK(find_all(t, in_cells, threads, &counters) == HS_OK);
    const bool same = memcmp(t->found, t->expected, n * sizeof(int64_t)) == 0;
    bool       same_sums = true;
    for (size_t k = 0; k < n; k++) {
        same_sums = same_sums && t->sums[k] == t->expected_sums[k];
    }
    CHECK(same && same_sums);
    if (!same || !same_sums) {
        fprintf(stderr, "  d = %d, n = %d, %d edges to %a, %d types, split %d%s\n",
                t->s->scene.ndim, (int)t->s->scene.n, t->n_edges, t->edges[t->n_edges - 1],
                t->n_types, (int)t->split, in_cells ? ", in cells" : "");
    }
    return counters.pairs;
}

/* The same, also in cells that are kept. */
static int64_t
compare(trial *t, int threads)
{
    if (!expect_all(t)) {
        return 0;
    }
    const int64_t found = compare_once(t, false, threads);
    CHECK(compare_once(t, true, threads) == found);
    return found;
}

static void
histograms_are_those_of_the_brute_force(void)
{
    static random_scene s;
    static trial        t = {.s = &s};
    harness_random      random = {16180};
    const char         *names[16];
    const int           n_names = hs_kernel_names(names, 16);
    static const int    exponents[] = {0, 0, 0, -400, 400, -1000, 60};
    int64_t             found = 0;
    for (int trial_number = 0; trial_number < TRIALS(900); trial_number++) {
        const int ndim = 1 + trial_number / SCENE_KINDS % 5;
        const int n = random_below(&random, ndim <= 3 ? 30 : 8);
        kernel_to_check = names[random_below(&random, n_names)];
        algorithm_to_check = (hs_algorithm)(trial_number / 3 % HS_ALGORITHM_END);
        make_scene(&random, trial_number % SCENE_KINDS, ndim, n, trial_number % 7 ? 4.0 : 400.0, 0,
                   &s);
        choose_edges(&random, &t);
        choose_marks(&random, &t);
        t.split = trial_number % 3 ? -1 : random_below(&random, n + 1);
        scale_scene(&t, exponents[random_below(&random, 7)]);
        found += compare(&t, 1 + trial_number % 2);
    }
    kernel_to_check = NULL;
    algorithm_to_check = HS_AUTO;
    CHECK(found > TRIALS(20000));
}

void
test_api_histogram(void)
{
    RUN(histograms_are_those_of_the_brute_force);
}
