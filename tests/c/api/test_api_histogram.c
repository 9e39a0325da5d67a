/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_api_histogram.c: pairs by distance, each edge decided as a brute force decides the same
 * cutoff; by types, with weights, of one set and of two, in every kernel.
 */
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

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

/* A group of points so far apart that the squares of what lies between them leave float32. */
static void
squares_may_overflow(void)
{
    static random_scene s;
    static trial        t = {.s = &s};
    harness_random      random = {31};
    int64_t             found = 0;
    for (int far = 0; far < 3; far++) {
        make_scene(&random, SCENE_OPEN, 3, 30, 2.0, 0, &s);
        s.scene.cutoff = 2.0;
        choose_edges(&random, &t);
        choose_marks(&random, &t);
        t.split = far == 1 ? 20 : -1;
        for (int i = 0; i < 10; i++) {
            s.x[3 * i] = ldexp(1.0 + i / 4, far == 2 ? 800 : 70);
        }
        found += compare(&t, 1);
    }
    CHECK(found > 100);
}

/* Edges of which scaling by the largest one loses digits. */
static void
edges_may_be_any_numbers(void)
{
    static random_scene s;
    static trial        t = {.s = &s};
    harness_random      random = {8};
    make_scene(&random, SCENE_OPEN, 2, 12, 1.0, 0, &s);
    for (int i = 1; i < 6; i++) {
        s.x[2 * i] = s.x[0] = 0.0;
        s.x[1] = 0.0;
        s.x[2 * i + 1] = ldexp(1.0 + 0.25 * i, -1060);
    }
    for (int i = 6; i < 12; i++) {
        s.x[2 * i] = ldexp(s.x[2 * i], 900);
    }
    t.n_edges = 8;
    for (int k = 0; k < 7; k++) {
        t.edges[k] = ldexp(1.0 + 0.25 * k, -1060);
    }
    t.edges[7] = ldexp(8.0, 900);
    t.split = -1;
    choose_marks(&random, &t);
    CHECK(compare(&t, 1) == 66);
    CHECK(t.n_types > 1 || t.found[3] > 0);
}

/* The same whatever number of threads counts, with no more memory than histograms take. */
static void
threads_and_kernels_agree(void)
{
    enum { POINTS = 30000, BINS = 64 };
    static double  x[3 * POINTS], weights[POINTS], edges[BINS + 1];
    static int32_t types[POINTS];
    static int64_t counts[9 * (BINS + 1)], first_counts[9 * (BINS + 1)];
    static double  sums[9 * (BINS + 1)], first_sums[9 * (BINS + 1)];
    harness_random random = {99};
    const char    *names[16];
    const int      n_names = hs_kernel_names(names, 16);
    hs_box         box = {.ndim = 3, .periodic = {true, true, true}};
    brute_scene    scene = {.ndim = 3, .n = POINTS, .x = x, .box = &box, .cutoff = 0.1};
    for (int i = 0; i < POINTS; i++) {
        types[i] = random_below(&random, 3);
        weights[i] = random_unit(&random) - 0.5;
        for (int k = 0; k < 3; k++) {
            box.rows[k][k] = 1.0;
            x[3 * i + k] = random_unit(&random);
        }
    }
    for (int k = 0; k <= BINS; k++) {
        edges[k] = 0.1 * k / BINS;
    }
    for (int run = 0; run < 2 * n_names + 2; run++) {
        /* What one thread does is part of what two do: where that is slow, once is enough. */
        if (IS_SLOW && run > 0 && run < 2 * n_names && run % 2 == 0) {
            continue;
        }
        const hs_points points = points_of(&scene);
        hs_options      options = options_of(&scene);
        hs_counters     counters;
        hs_histogram    wanted = {.n_edges = BINS + 1,
                                  .edges = edges,
                                  .last_inclusive = true,
                                  .n_types = 3,
                                  .of_points = {types, weights},
                                  .counts = counts,
                                  .sums = run == 2 * n_names + 1 ? NULL : sums};
        int64_t         count, all = 0;
        options.kernel = run < 2 * n_names ? names[run / 2] : NULL;
        options.threads = run < 2 * n_names ? 1 + run % 2 : 2 + run % 2 * 3;
        options.counters = &counters;
        CHECK(hs_pairs_histogram(AMONG(&points, &box), &options, &wanted, NULL) == HS_OK);
        CHECK(counters.bytes[HS_FOR_INDICES] == 0 && counters.bytes[HS_FOR_DISTANCES] == 0);
        CHECK(counters.bytes_peak < 12 * 1000 * 1000);
        if (run == 0) {
            memcpy(first_counts, counts, sizeof counts);
            memcpy(first_sums, sums, sizeof sums);
            options.inclusive = true;
            CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, NULL) == HS_OK);
            for (int k = 0; k < 9 * (BINS + 1); k++) {
                all += k / (BINS + 1) % 3 >= k / (BINS + 1) / 3 ? counts[k] : 0;
            }
            CHECK(all == count && count > 1000000);
        }
        CHECK(memcmp(counts, first_counts, sizeof counts) == 0);
        CHECK(memcmp(sums, first_sums, sizeof sums) == 0);
    }
}

static void
bad_arguments_are_named(void)
{
    double              x[4] = {0.0, 0.25, 0.5, 0.75}, edges[3] = {0.0, 0.5, 1.0};
    int32_t             types[4] = {0, 1, 2, 1};
    double              weights[4] = {1.0, NAN, 1.0, 1.0};
    int64_t             counts[12];
    double              sums[12];
    brute_scene         scene = {.ndim = 1, .n = 4, .x = x, .inclusive = true, .cutoff = 1.0};
    hs_points           points = points_of(&scene);
    hs_options          options = options_of(&scene);
    hs_failure          failure;
    hs_histogram        wanted = {.n_edges = 3, .edges = edges, .n_types = 2, .counts = counts};
    static const double bad[][2] = {{1, NAN}, {2, INFINITY}, {0, -1.0}, {1, 2.0}};
    CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &wanted, &failure) == HS_ERR_TYPES);
    wanted.of_points.types = types;
    CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &wanted, &failure) == HS_ERR_TYPES);
    CHECK(failure.row == 2 && failure.value == 2.0);
    wanted.n_types = 1;
    wanted.of_points = (hs_marks){NULL, weights};
    wanted.sums = sums;
    CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &wanted, &failure) == HS_ERR_WEIGHTS);
    CHECK(failure.row == 1 && !failure.in_queries);
    wanted.of_points.weights = NULL;
    wanted.of_queries.weights = weights;
    CHECK(hs_pairs_histogram(QUERIED(&points, &points, NULL), &options, &wanted, &failure) ==
          HS_ERR_WEIGHTS);
    CHECK(failure.row == 1 && failure.in_queries);
    wanted.sums = NULL;
    wanted.of_queries.weights = NULL;
    for (int e = 0; e < 4; e++) {
        const double kept = edges[(int)bad[e][0]];
        edges[(int)bad[e][0]] = bad[e][1];
        CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &wanted, &failure) ==
              HS_ERR_EDGES);
        CHECK(failure.row == (e == 3 ? 2 : (int)bad[e][0]));
        edges[(int)bad[e][0]] = kept;
    }
    wanted.n_edges = 0;
    CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &wanted, &failure) == HS_ERR_EDGES);
}

/* Whichever allocation fails, nothing leaks. */
static void
allocations_may_fail(void)
{
    static random_scene s;
    static trial        t = {.s = &s};
    harness_random      random = {60302};
    make_scene(&random, SCENE_TRICLINIC, 3, 100, 4.0, 0, &s);
    s.scene.cutoff = 2.0;
    choose_edges(&random, &t);
    choose_marks(&random, &t);
    t.split = 30;
    t.n_types = 3;
    bool      ended = false;
    int       nth = 0;
    hs_status status = HS_ERR_MEMORY;
    while (!ended && nth < 300) {
        const int64_t before = hs_test_live_blocks();
        hs_test_fail_allocation(++nth);
        status = find_all(&t, false, 2, NULL);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && status == HS_OK && nth > 30);
}

void
test_api_histogram(void)
{
    RUN(histograms_are_those_of_the_brute_force);
    RUN(squares_may_overflow);
    RUN(edges_may_be_any_numbers);
    RUN(threads_and_kernels_agree);
    RUN(bad_arguments_are_named);
    RUN(allocations_may_fail);
}
