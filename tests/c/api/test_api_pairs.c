/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_pairs.c: pairs, rows, clusters and plans are those of the brute force. */
#include "../../../csrc/core/levels/levels.h"
#include "../support/among.h"
#include "../support/block_checks.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

#include <math.h>

void test_api_pairs(void);

/* ---- the set of pairs, and what is returned with them, against the brute force ---- */

/* Compares by any kernel of this CPU, and names the scene if it differs. Returns the number of
 * pairs, -1 if not compared. */
static int64_t
compare_scene(const brute_scene *scene, double budget, int64_t stride)
{
    static harness_random turn = {97};
    const char           *names[16];
    brute_list            expected;
    kernel_to_check = names[random_below(&turn, hs_kernel_names(names, 16))];
    algorithm_to_check = (hs_algorithm)random_below(&turn, HS_ALGORITHM_END);
    if (!brute_find(scene, budget, &expected))
        return -1;
    const char   *difference = pairs_difference(scene, &expected, stride);
    const int64_t n = expected.n;
    CHECK(difference == NULL);
    if (difference != NULL)
        fprintf(stderr,
                "  %s: d = %d, n = %d, cutoff %a, %d pairs expected, kernel %s, algorithm %d\n",
                difference, scene->ndim, (int)scene->n, scene->cutoff, (int)n, kernel_to_check,
                (int)algorithm_to_check);
    brute_free(&expected);
    kernel_to_check = NULL;
    algorithm_to_check = HS_AUTO;
    return n;
}

static void
points_far_outside_the_box(void)
{
    harness_random      random = {31337};
    static random_scene s;
    int64_t             pairs = 0;
    for (int trial = 0; trial < TRIALS(300); trial++) {
        const double spread = trial % 3 == 0 ? 40.0 : trial % 3 == 1 ? 1e5 : 1e8;
        make_scene(&random, trial % SCENE_KINDS, 1 + trial / SCENE_KINDS % 3, 8, spread, 0, &s);
        if (spread > 1e7) { /* keep S within int32 in sheared boxes, too */
            for (int e = 0; e < 8 * s.scene.ndim; e++)
                s.x[e] *= 0.1;
        }
        const int64_t found = compare_scene(&s.scene, 20000.0, 1);
        pairs += found > 0 ? found : 0;
    }
    CHECK(pairs > TRIALS(1000));
}

/* Coordinates that float32 cannot tell apart, and a cutoff that some of their distances are at. */
static void
clusters_far_from_the_origin(void)
{
    harness_random      random = {60221};
    static random_scene s;
    int64_t             pairs = 0;
    for (int trial = 0; trial < TRIALS(120); trial++) {
        const int ndim = 1 + trial % 4;
        make_scene(&random, trial % 2 ? SCENE_OPEN : SCENE_MIXED, ndim, 120, 4.0, 0, &s);
        for (int e = 0; e < 120 * ndim; e++)
            s.x[e] += ldexp(1.25, trial % 32) * (e % ndim == 0 ? 1.0 : -3.0);
        s.scene.cutoff = 0.0;
        while (s.scene.cutoff == 0.0 || s.scene.cutoff > 4.0)
            s.scene.cutoff = cutoff_of_some_pair(&random, &s.scene);
        const int64_t found = compare_scene(&s.scene, 200000.0, 11);
        pairs += found > 0 ? found : 0;
    }
    CHECK(pairs > TRIALS(20000));
}

/* ---- rows of all neighbours, of points and of queries ---- */

/* So many that one walk finds them all, in memory of i, and two walks with a second thread. */
enum { MANY = 24000, ASKING = 9000 };

static hs_status
find_many(int index_bytes, int threads, bool asks, double limit, hs_pairs **rows)
{
    static double   x[3 * MANY];
    harness_random  random = {88};
    hs_box          box = {.ndim = 3, .periodic = {true, false, true}};
    const hs_points points = {
        .data = x, .n = MANY, .ndim = 3, .real = HS_FLOAT64, .row_stride = 24, .column_stride = 8};
    hs_points  queries = points;
    hs_options options = hs_options_default();
    for (int e = 0; e < 3 * MANY; e++)
        x[e] = random_unit(&random);
    for (int k = 0; k < 3; k++)
        box.rows[k][k] = 1.0;
    queries.n = ASKING;
    options.cutoff = asks ? 0.12 : 0.09;
    options.index_bytes = index_bytes;
    options.threads = threads;
    options.memory_limit = limit;
    return hs_neighbors_find(QUERIED(&points, asks ? &queries : NULL, &box), &options, rows, NULL);
}

static bool
same_numbers(const hs_pairs *one, const hs_pairs *two, int index_bytes)
{
    const size_t bytes = (size_t)hs_pairs_length(one) * (size_t)index_bytes;
    return hs_pairs_length(one) == hs_pairs_length(two) &&
           memcmp(hs_pairs_array(one, HS_WANT_I), hs_pairs_array(two, HS_WANT_I), bytes) == 0 &&
           memcmp(hs_pairs_array(one, HS_WANT_J), hs_pairs_array(two, HS_WANT_J), bytes) == 0 &&
           (hs_pairs_rows(one) == 0 ||
            memcmp(hs_pairs_offsets(one), hs_pairs_offsets(two),
                   (size_t)(hs_pairs_rows(one) + 1) * sizeof(int64_t)) == 0);
}

static void
one_walk_finds_what_two_find(void)
{
    for (int form = 0; form < 4; form++) {
        const int  index_bytes = form % 2 ? 4 : 8;
        const bool asks = form / 2;
        hs_pairs  *one = NULL, *two = NULL;
        CHECK(find_many(index_bytes, 1, asks, INFINITY, &one) == HS_OK);
        CHECK(find_many(index_bytes, 2, asks, INFINITY, &two) == HS_OK);
        CHECK(hs_pairs_length(one) > 1 << 20);
        CHECK(same_numbers(one, two, index_bytes));
        hs_pairs_free(one);
        hs_pairs_free(two);
    }
}

/* A hs_poll_fn: the largest fraction so far. */
static bool
keep_largest(void *context, double fraction)
{
    *(double *)context = fmax(*(double *)context, fraction);
    return true;
}

/* The caller's thread tells how far the work is, if it has any share of it. */
static void
threads_tell_how_far_they_are(void)
{
    static double   x[60000];
    harness_random  random = {34};
    const hs_points points = {x, 20000, 3, HS_FLOAT64, 24, 8};
    hs_options      options = hs_options_default();
    double          largest = 0.0;
    int64_t         n;
    for (int e = 0; e < 60000; e++)
        x[e] = random_unit(&random);
    options.cutoff = 0.1;
    options.threads = 2;
    options.poll = keep_largest;
    options.poll_context = &largest;
    for (int trial = 0; trial < 50 && largest == 0.0; trial++)
        CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &n, NULL) == HS_OK);
    CHECK(largest > 0.0 && largest <= 1.0);
}

/* More threads than pairs are dealt to, and more points than there are pairs. */
static void
any_number_of_threads_sorts_the_same(void)
{
    enum { N = 150000 };
    double         *x = array_of(N, sizeof *x);
    const hs_points points = {x, N, 1, HS_FLOAT64, 8, 8};
    harness_random  random = {33};
    for (int few = 0; few < 2; few++) {
        hs_options options = hs_options_default();
        hs_pairs  *pairs[2] = {NULL, NULL};
        options.sorted = true;
        options.cutoff = few ? 0.7 : 9.0;
        for (int i = 0; i < N; i++)
            x[i] = N * random_unit(&random);
        for (int many = 0; many < 2; many++) {
            options.threads = !many ? 1 : few ? 3 : 33;
            CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &pairs[many], NULL) == HS_OK);
        }
        CHECK(hs_pairs_length(pairs[0]) > (few ? 1 << 16 : 1 << 20));
        CHECK(hs_pairs_length(pairs[0]) < (few ? N : 1 << 21));
        CHECK(same_numbers(pairs[0], pairs[1], 8));
        hs_pairs_free(pairs[0]);
        hs_pairs_free(pairs[1]);
    }
    free(x);
}

static void
one_walk_gives_way_where_memory_is_short(void)
{
    hs_pairs *all = NULL;
    int       n_found = 0, n_refused = 0;
    CHECK(find_many(8, 1, true, INFINITY, &all) == HS_OK);
    const double bytes = 16.0 * (double)hs_pairs_length(all);
    for (double beyond = 16.0; beyond > -1.0; beyond -= 1.0) { /* hundredths of the result */
        hs_pairs       *rows = NULL;
        const hs_status status = find_many(8, 1, true, bytes * (1.0 + 0.01 * beyond), &rows);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        CHECK((status == HS_OK) == (rows != NULL));
        CHECK(rows == NULL || same_numbers(all, rows, 8));
        n_found += status == HS_OK;
        n_refused += status != HS_OK;
        hs_pairs_free(rows);
    }
    CHECK(n_found > 0 && n_refused > 0);
    hs_pairs_free(all);
}

static void
a_capacity_that_is_too_small_is_named(void)
{
    double         x[4] = {0.0, 0.25, 0.5, 0.75};
    int64_t        j[12] = {0};
    hs_pair_arrays arrays = {.capacity = 11, .index_bytes = 8, .j = j};
    brute_scene    scene = {.ndim = 1, .n = 4, .x = x, .inclusive = true, .cutoff = 1.0};
    hs_points      points = points_of(&scene);
    hs_options     options = options_of(&scene);
    hs_failure     failure;
    hs_pairs      *rows = NULL;
    options.want = HS_WANT_J;
    options.out = &arrays;
    CHECK(hs_neighbors_find(AMONG(&points, NULL), &options, &rows, &failure) == HS_ERR_CAPACITY);
    CHECK(failure.expected_pairs == 12.0 && rows == NULL);
    arrays.capacity = 12;
    CHECK(hs_neighbors_find(AMONG(&points, NULL), &options, &rows, &failure) == HS_OK);
    CHECK(hs_pairs_length(rows) == 12 && j[0] == 1 && j[3] == 0 && j[11] == 2);
    hs_pairs_free(rows);
}

/* ---- a plan tells what a search of a scene would do ---- */

/* Lengths are the caller's, whatever the search scales by; occupied cells and threads are told. */
static void
plans_are_in_the_callers_unit(void)
{
    enum { N = 8000 };
    static double   x[2 * N];
    harness_random  random = {21};
    hs_options      options = hs_options_default();
    hs_plan         plan;
    const hs_points points = {x, N, 2, HS_FLOAT64, 16, 8};
    for (int e = 0; e < 2 * N; e++)
        x[e] = 0x1p40 * random_unit(&random);
    options.cutoff = 0x1p36;
    options.threads = 1;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK);
    CHECK(!plan.sparse && plan.threads == 1 && plan.ndim == 2 && plan.expected_pairs > 1000.0);
    CHECK(plan.cell_size[1] * (double)plan.shape[1] > 0.95 * 0x1p40);
    CHECK(plan.cell_size[1] * (double)plan.shape[1] < 1.05 * 0x1p40);
    options.cutoff = 0.01;
    for (int along = 0; along < 2; along++) { /* two crowds, far apart */
        for (int e = 0; e < 2 * N; e++)
            x[e] = random_unit(&random) + (e / 2 % 2 && e % 2 == along ? 1e6 : 0.0);
        CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK && plan.sparse);
    }
    const hs_points on_line = {x, 2 * N, 1, HS_FLOAT64, 8, 8};
    options.cutoff = 0.001;
    CHECK(hs_plan_make(AMONG(&on_line, NULL), &options, &plan, NULL) == HS_OK && plan.sparse);
}

/* Cells that cannot be as small as the cutoff are about two for each point, and long rows of them. */
static void
cells_of_clusters_are_no_more_than_points_need(void)
{
    enum { N = 8000 };
    static double   x[3 * N];
    harness_random  random = {22};
    hs_options      options = hs_options_default();
    hs_plan         plan;
    const hs_points points = {x, N, 3, HS_FLOAT64, 24, 8};
    for (int e = 0; e < 3 * N; e++)
        x[e] = (e / 3 % 2 ? 1e6 : 1.0) * random_unit(&random);
    options.cutoff = 0.01;
    options.algorithm = HS_GRID;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK);
    CHECK(plan.n_cells > N && plan.n_cells < 2.1 * N && plan.shape[0] > 10 * plan.shape[1]);
}

/* Several searches, or none: of points without a pair there is nothing to say but what they are. */
static void
plans_know_a_reach(void)
{
    static double   x[1000], radii[1000];
    const double    none[1] = {-1.0}, x_none[1] = {0.0};
    const int32_t   type[1000] = {0};
    harness_random  random = {23};
    hs_options      options = hs_options_default();
    hs_plan         plan;
    int64_t         count = 0;
    const hs_points points = {x, 1000, 1, HS_FLOAT64, 8, 8}, empty = {x_none, 0, 1, 1, 8, 8};
    hs_reach        reach = {.rule = HS_RULE_MAX};
    for (int i = 0; i < 1000; i++) {
        x[i] = 1000.0 * random_unit(&random);
        radii[i] = i % 20 == 0 ? 1.5 : ldexp(1.5, -4 * (1 + i % 2));
    }
    hs_among among = {.points = SET(&points, .radii = radii, .types = type), .reach = &reach};
    options.cutoff = INFINITY;
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK);
    CHECK(hs_pairs_count(&among, &options, &count, NULL) == HS_OK);
    CHECK(plan.algorithm == HS_HIERARCHY && plan.n_searches == 5);
    CHECK(fabs(plan.expected_pairs / (double)count - 1.0) < 1e-9); /* all are counted */
    CHECK(plan.all_pairs || plan.cell_size[0] * (double)plan.reach[0] >= 1.5);
    options.algorithm = HS_GRID;
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK);
    CHECK(plan.algorithm == HS_GRID && plan.n_searches == 1);
    CHECK(plan.expected_pairs == (double)count);
    reach = (hs_reach){.n_types = 1, .cutoffs = none};
    options.cutoff = 1.0;
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK);
    CHECK(plan.n_searches == 0 && plan.expected_pairs == 0.0 && plan.ndim == 1);
    among.points = SET(&empty);
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK && plan.n_searches == 0);
}

/* What a plan has of the cells where nothing is searched is that of a cutoff of 0, whatever the bound
 * is, even none. */
static void
plans_of_nothing_have_the_cells_of_no_cutoff(void)
{
    static double   x[1000];
    const double    none[1] = {-1.0};
    const int32_t   type[1000] = {0};
    hs_options      options = hs_options_default();
    hs_plan         plan, of_none, of_bound;
    const hs_points points = {x, 1000, 1, HS_FLOAT64, 8, 8}, empty = {x, 0, 1, HS_FLOAT64, 8, 8};
    const hs_reach  by_type = {.n_types = 1, .cutoffs = none};
    const hs_reach  by_radii = {.rule = HS_RULE_SUM};
    for (int i = 0; i < 1000; i++)
        x[i] = 0.125 * i;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &of_none, NULL) == HS_OK);
    options.cutoff = 30.0;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &of_bound, NULL) == HS_OK);
    hs_among among = {.points = SET(&points, .types = type), .reach = &by_type};
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK && plan.n_searches == 0);
    CHECK(plan.n_cells == of_none.n_cells && plan.cell_size[0] == of_none.cell_size[0]);
    CHECK(plan.n_cells != of_bound.n_cells);
    options.cutoff = INFINITY;
    among = (hs_among){.points = SET(&empty), .reach = &by_radii};
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK);
    CHECK(plan.n_searches == 0 && plan.expected_pairs == 0.0);
}

/* Where levels of radii are so alike that one search with limits takes less time than several. */
static void
plans_join_levels_unless_told_otherwise(void)
{
    enum { FEW = 100, N = 3000 };
    static double  x[3 * N], radii[N];
    harness_random random = {24};
    hs_options     options = hs_options_default();
    hs_plan        plan;
    hs_set         points = {.at = {x, FEW, 3, HS_FLOAT64, 24, 8}, .radii = radii};
    const hs_reach reach = {.rule = HS_RULE_SUM};
    const hs_among among = {.points = &points, .reach = &reach};
    for (int e = 0; e < 3 * N; e++)
        x[e] = 4.0 * random_unit(&random);
    for (int i = 0; i < N; i++)
        radii[i] = i % 2 ? 0.5 : 0.2;
    options.cutoff = INFINITY;
    const bool joins = hs_test_joins_levels;
    hs_test_joins_levels = true;
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK && plan.n_searches == 1);
    const double expected = plan.expected_pairs;
    options.algorithm = HS_HIERARCHY;
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK && plan.n_searches > 1);
    CHECK(plan.expected_pairs == expected);
    for (int i = 0; i < N; i++) /* one that is far larger than many */
        radii[i] = i == 0 ? 2.0 : 0x1p-8;
    points.at.n = N;
    options.algorithm = HS_AUTO;
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK && plan.n_searches > 1);
    hs_test_joins_levels = joins;
}

/*
 * ---- precision ----
 *
 * Precision "single" and "double" on numbers that they hold exactly, where their answers are those
 * of the real numbers.
 */

/* All pairs, with S, against the brute force. */
static bool
is_like_brute_force(const brute_scene *scene, hs_precision precision, const char *kernel)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    found_pairs     found;
    brute_list      expected;
    int64_t         count = -1;
    CHECK(brute_find(scene, 1e7, &expected));
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
    options.sorted = true;
    options.precision = precision;
    options.kernel = kernel;
    bool right = search_pairs(&points, scene->box, &options, &found, NULL) == HS_OK &&
                 found.n == expected.n;
    for (int64_t e = 0; right && e < found.n; e++)
        right = pair_matches(scene, &expected.pairs[e], &found, e);
    right = right && hs_pairs_count(AMONG(&points, scene->box), &options, &count, NULL) == HS_OK &&
            count == expected.n;
    found_free(&found);
    brute_free(&expected);
    return right;
}

/* Differences whose squares are subnormal float32, again and again: flushed to zero they would be
 * beyond no cutoff, and here each of them decides. */
static void
single_does_not_flush(void)
{
    enum { CLUSTERS = 60, EACH = 12, N = CLUSTERS * EACH };
    static double  x[2 * N];
    harness_random random = {3};
    for (int fine = 0; fine < 2; fine++) {
        brute_scene scene = {.ndim = 2, .n = N, .x = x, .inclusive = true};
        scene.cutoff = 1.0;
        for (int i = 0; i < N; i++) {
            for (int k = 0; k < 2; k++)
                x[2 * i + k] = 0x1p-66 * random_below(&random, 8);
            x[2 * i] += fine ? 0.0 : 16.0 * (i / EACH);
        }
        CHECK(is_like_brute_force(&scene, HS_SINGLE, NULL));
        CHECK(is_like_brute_force(&scene, HS_EXACT, NULL));
    }
}

/* Points so far away that float64 cannot tell one image from the next: the farthest is named. */
static void
double_names_the_farthest(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {0.0, 1.0}}};
    double       x[8] = {0.5, 0.5, 0.25, 0x1p60, 0x1p60, 0.0, 0.0, 0.0};
    double       q[4] = {0.0, 0.0, -0x1p61, 0.0};
    hs_points    points = {x, 4, 2, HS_FLOAT64, 16, 8}, queries = {q, 2, 2, HS_FLOAT64, 16, 8};
    hs_options   options = hs_options_default();
    hs_failure   failure;
    int64_t      count = -1;
    options.cutoff = 0.25;
    options.precision = HS_DOUBLE;
    CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, &failure) == HS_ERR_ROUNDING);
    CHECK(failure.row == 1 && !failure.in_queries && count == -1);
    CHECK(hs_pairs_count(QUERIED(&points, &queries, &box), &options, &count, &failure) ==
          HS_ERR_ROUNDING);
    CHECK(failure.row == 1 && failure.in_queries);
    q[2] = 1.0;
    CHECK(hs_pairs_count(QUERIED(&points, &queries, &box), &options, &count, &failure) ==
          HS_ERR_ROUNDING);
    CHECK(failure.row == 1 && !failure.in_queries);
    x[0] = 0x1p60; /* as far as the next two: the first is named */
    CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, &failure) == HS_ERR_ROUNDING);
    CHECK(failure.row == 0);
    x[0] = 0.5;
    options.precision = HS_EXACT;
    CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, &failure) == HS_OK && count == 3);
}

void
test_api_pairs(void)
{
    RUN(points_far_outside_the_box);
    RUN(clusters_far_from_the_origin);
    RUN(one_walk_finds_what_two_find);
    RUN(threads_tell_how_far_they_are);
    RUN(any_number_of_threads_sorts_the_same);
    RUN(one_walk_gives_way_where_memory_is_short);
    RUN(a_capacity_that_is_too_small_is_named);
    RUN(plans_are_in_the_callers_unit);
    RUN(cells_of_clusters_are_no_more_than_points_need);
    RUN(plans_know_a_reach);
    RUN(plans_of_nothing_have_the_cells_of_no_cutoff);
    RUN(plans_join_levels_unless_told_otherwise);
    RUN(single_does_not_flush);
    RUN(double_names_the_farthest);
}
