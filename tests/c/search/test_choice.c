/* SPDX-License-Identifier: BSD-3-Clause */
/* test_choice.c: selections: types, labels, groups, and pairs that are left out. */
#include "../support/answers.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"

#include <math.h>
#include <string.h>

void test_choice(void);

/*
 * ---- choice ----
 *
 * Choices of many: crowds that are looked at in parts, points far from the box and in extreme
 * units, many partners of one point.
 */

enum { CROWD = 300 };

static double        crowd_x[CROWD];
static int64_t       crowd_labels[CROWD], excluded_choice[2 * CROWD];
static const hs_box  line = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
static hs_points     crowd_points = {crowd_x, CROWD, 1, HS_FLOAT64, 8, 8};
static hs_selection  crowd_selection;
static hs_options    crowd_options;
static const int64_t PAIRS = (int64_t)CROWD * (CROWD - 1) / 2;

/* All points at one place, some box vectors away or not; pairs at 0 and at 1, 1 of the image. */
static void
make_crowd(double away)
{
    for (int i = 0; i < CROWD; i++) {
        crowd_x[i] = away * (i % 3);
        crowd_labels[i] = 7;
    }
    crowd_selection = (hs_selection){.min_distance = 0.0};
    crowd_options = hs_options_default();
    crowd_options.cutoff = 1.5;
}

static int64_t
count(const hs_box *box)
{
    const hs_among among = {.points =
                                SET(&crowd_points, .groups = crowd_labels, .labels = crowd_labels),
                            .box = box,
                            .selection = &crowd_selection};
    const unsigned wants[] = {HS_WANT_I, HS_WANT_DISTANCE | HS_WANT_J};
    int64_t        counted = -1;
    CHECK(hs_pairs_count(&among, &crowd_options, &counted, NULL) == HS_OK);
    for (int w = 0; w < 2; w++) {
        hs_pairs *pairs = NULL;
        crowd_options.want = wants[w];
        CHECK(hs_pairs_find(&among, &crowd_options, &pairs, NULL) == HS_OK);
        CHECK(hs_pairs_length(pairs) == counted);
        hs_pairs_free(pairs);
    }
    return counted;
}

static int64_t
count_rows(const hs_box *box)
{
    const hs_among among = {.points =
                                SET(&crowd_points, .groups = crowd_labels, .labels = crowd_labels),
                            .box = box,
                            .selection = &crowd_selection};
    int64_t        counted[CROWD], all = 0;
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_OK);
    for (int i = 0; i < CROWD; i++)
        all += counted[i];
    return all;
}

static void
one_point_may_have_many_partners(void)
{
    for (int few = 0; few < 2; few++) {
        make_crowd(0.0);
        crowd_selection.excluded = excluded_choice;
        for (int i = 1; i < CROWD; i++) {
            const int64_t at = few ? i / 64 * 64 : i; /* others have their last bits */
            excluded_choice[2 * i - 2] = i % 2 ? 0 : at;
            excluded_choice[2 * i - 1] = i % 2 ? at : 0;
        }
        crowd_selection.n_excluded = CROWD - 1;
        CHECK(count(NULL) == PAIRS - (few ? CROWD / 64 : CROWD - 1));
        CHECK(count(&line) == 3 * PAIRS + CROWD - (few ? CROWD / 64 : CROWD - 1));
    }
}

/* Numbers so far apart that no unit holds both. */
static void
numbers_may_be_far_apart(void)
{
    make_crowd(0.0);
    const hs_points three = {crowd_x, 3, 1, HS_FLOAT64, 8, 8}, all = crowd_points;
    crowd_points = three;
    crowd_x[1] = 0x1p-1074;
    crowd_x[2] = 0x1p1000;
    crowd_options.cutoff = 0x1p1001;
    crowd_selection.min_distance = 0x1p-1074;
    CHECK(count(NULL) == 3);
    crowd_selection.min_distance = 0x1p-1073;
    CHECK(count(NULL) == 2);
    crowd_points = all;
}

/* Numbers of queries say nothing where there are none. */
static void
numbers_go_with_queries(void)
{
    make_crowd(0.0);
    crowd_selection.query_numbers = crowd_labels;
    crowd_selection.has_groups = true;
    CHECK(count(&line) == 3 * PAIRS + CROWD);
}

/* Distances in float32 need not be as far as the least distance, of which there is none. */
static void
single_precision_chooses_as_well(void)
{
    make_crowd(0.0);
    crowd_selection.has_labels = true;
    crowd_options.precision = HS_SINGLE;
    CHECK(count(&line) == 2 * PAIRS + CROWD && count_rows(&line) == 2 * (2 * PAIRS + CROWD));
}

/* Of several systems as of one, in a box or without. */
static void
systems_choose_as_well(void)
{
    static int64_t counted[CROWD];
    int64_t        first[] = {0, 100, CROWD}, counts[2];
    make_crowd(0.0);
    hs_among among = *SYSTEMS(&crowd_points, 2, first, NULL, NULL);
    hs_set   set = *among.points;
    set.labels = crowd_labels;
    among.points = &set;
    among.selection = &crowd_selection;
    crowd_selection.has_labels = true;
    CHECK(hs_pairs_count(&among, &crowd_options, counts, NULL) == HS_OK);
    CHECK(counts[0] == 0 && counts[1] == 0);
    crowd_selection.has_labels = false;
    crowd_selection.min_distance = 1.0;
    CHECK(hs_pairs_count(&among, &crowd_options, counts, NULL) == HS_OK);
    CHECK(counts[0] == 0 && counts[1] == 0);
    among.box = &line;
    CHECK(hs_pairs_count(&among, &crowd_options, counts, NULL) == HS_OK);
    CHECK(counts[0] == 99 * 100 + 100 && counts[1] == 199 * 200 + 200);
    crowd_selection.min_distance = -1.0;
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_ERR_ARGUMENT);
}

/* Queries of systems that have numbers of points pair as these do. */
static void
numbers_of_queries_hold_in_systems(void)
{
    int64_t       groups[CROWD], numbers[] = {5, 200}, counted[2];
    const int64_t first[] = {0, 100, CROWD}, first_query[] = {0, 1, 2}, excluded[] = {200, 270};
    make_crowd(0.0);
    hs_points queries = crowd_points;
    queries.n = 2;
    for (int i = 0; i < CROWD; i++)
        groups[i] = i >= 150;
    crowd_selection.query_numbers = numbers;
    crowd_selection.has_labels = true;
    const hs_among among = {.points = SET(&crowd_points, .groups = groups, .labels = crowd_labels,
                                          .n_systems = 2, .first = first),
                            .queries = SET(&queries, .n_systems = 2, .first = first_query),
                            .box = &line,
                            .selection = &crowd_selection};
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_OK);
    CHECK(counted[0] == 2 * 99 + 3 && counted[1] == 2 * 199 + 3); /* itself at S = 0 too */
    crowd_selection.has_labels = false;
    crowd_selection.has_groups = true;
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_OK);
    CHECK(counted[0] == 3 * 100 && counted[1] == 3 * 150);
    crowd_selection.n_excluded = 1;
    crowd_selection.excluded = excluded;
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_OK);
    CHECK(counted[0] == 3 * 100 && counted[1] == 3 * 150 - 1);
    numbers[1] = CROWD;
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_ERR_ARGUMENT);
    numbers[1] = 99; /* of the other system */
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_ERR_ARGUMENT);
}

/* Images of excluded pairs are those of each system's box, which is looked at first. */
static void
a_bad_box_of_a_system_is_told(void)
{
    static const double rows[] = {1.0, 0.0};
    const int64_t       first[] = {0, 100, CROWD};
    int64_t             counts[2];
    hs_failure          failure;
    make_crowd(0.0);
    crowd_selection.has_labels = true;
    const hs_each_system each = {.rows = rows};
    const hs_among       among = {
              .points = SET(&crowd_points, .labels = crowd_labels, .n_systems = 2, .first = first),
              .box = &line,
              .selection = &crowd_selection,
              .each = &each};
    CHECK(hs_pairs_count(&among, &crowd_options, counts, &failure) == HS_ERR_BOX_DEPENDENT);
    CHECK(failure.system == 1 && failure.row == 0);
}

/* Where points repeat without end, a group of which there is no point has no nearest one. */
static void
a_group_without_points_has_no_nearest(void)
{
    int64_t of_query[2] = {7, 8};
    make_crowd(0.0);
    crowd_selection.has_groups = true;
    crowd_options.cutoff = INFINITY;
    hs_points queries = crowd_points;
    hs_pairs *rows = NULL;
    queries.n = 2;
    const hs_among among = {.points = SET(&crowd_points, .groups = crowd_labels),
                            .queries = SET(&queries, .groups = of_query),
                            .box = &line,
                            .selection = &crowd_selection};
    CHECK(hs_nearest_find(&among, 1, &crowd_options, &rows, NULL) == HS_OK);
    const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
    CHECK(j[0] == 0 && j[1] == -1);
    hs_pairs_free(rows);
}

/* Scenes of few points, full of ties: pairs, rows, streams, systems, histograms, own queries, and
 * levels of radii. */
static void
searches_leave_out_what_integers_say(void)
{
    static random_scene s;
    harness_random      random = {2718};
    const char         *kernels[16];
    const int           n_kernels = hs_kernel_names(kernels, 16);
    int                 number = 0;
    while (strcmp(answer_checks[number].name, "selection") != 0)
        number++;
    for (int trial = 0; trial < TRIALS(700); trial++) {
        brute_list expected;
        make_scene(&random, trial % SCENE_KINDS, 1 + random_below(&random, 3),
                   random_below(&random, 14), 4.0, 0, &s);
        kernel_to_check = kernels[trial % n_kernels];
        algorithm_to_check = (hs_algorithm)random_below(&random, HS_ALGORITHM_END);
        CHECK(brute_find(&s.scene, 2e5, &expected));
        const char *difference =
            answer_difference(number, &s.scene, &expected, (uint64_t)trial, 1 + expected.n / 50);
        CHECK(difference == NULL);
        if (difference != NULL)
            fprintf(stderr, "  scene %d: %s\n", trial, difference);
        brute_free(&expected);
    }
    kernel_to_check = NULL;
    algorithm_to_check = HS_AUTO;
}

/* Pairs, a stream, and one system, of some of the crowd. */
static hs_status
run_all(void *context)
{
    const int64_t first[] = {0, 20};
    hs_points     points = crowd_points;
    hs_pairs     *pairs = NULL;
    hs_stream    *stream = NULL;
    hs_status     status = HS_OK;
    (void)context;
    points.n = 20;
    for (int has_systems = 0; status == HS_OK && has_systems < 2; has_systems++) {
        const hs_among among = {.points = SET(&points, .groups = crowd_labels,
                                              .labels = crowd_labels, .n_systems = 1,
                                              .first = has_systems ? first : NULL),
                                .box = &line,
                                .selection = &crowd_selection};
        status = hs_pairs_find(&among, &crowd_options, &pairs, NULL);
        hs_pairs_free(pairs);
        if (status == HS_OK) {
            status = hs_stream_open(&among, &crowd_options, 5, &stream, NULL);
            hs_stream_free(stream);
        }
    }
    return status;
}

static void
refused_memory_leaves_nothing(void)
{
    for (int by_labels = 0; by_labels < 2; by_labels++) {
        make_crowd(0.0);
        for (int e = 0; e < 20; e++)
            excluded_choice[e] = (e + 1) / 2;
        crowd_selection = (hs_selection){.has_groups = true,
                                         .has_labels = by_labels,
                                         .n_excluded = by_labels ? 0 : 10,
                                         .excluded = excluded_choice};
        crowd_options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
        CHECK(fail_each_allocation(run_all, NULL, 400) > 10);
    }
}

/* Arrays that are missing, numbers that are none, distances that cannot be. */
static void
bad_selections_are_refused(void)
{
    static const int64_t two[] = {0, 1, 0, 2}, outside[][2] = {{-1, 0}, {2, 0}, {0, -1}, {0, 2}};
    static const double  x[] = {0.0, 1.0};
    const hs_points      points = {x, 2, 1, HS_FLOAT64, 8, 8}, none = {x, 0, 1, HS_FLOAT64, 8, 8};
    const hs_box skewed = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {1e300, 1.0}}};
    hs_selection bad[] = {{.within = -1},
                          {.n_excluded = -1},
                          {.n_excluded = INT64_MAX},
                          {.n_excluded = 1},
                          {.min_distance = -1.0},
                          {.min_distance = NAN},
                          {.min_distance = INFINITY},
                          {.has_groups = true},
                          {.has_labels = true}};
    hs_options   options = hs_options_default();
    hs_pairs    *pairs = NULL;
    hs_failure   failure;
    options.cutoff = 1.0;
    for (size_t b = 0; b < sizeof bad / sizeof *bad; b++) {
        const hs_among among = {.points = SET(&points), .selection = &bad[b]};
        CHECK(hs_pairs_find(&among, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    }
    hs_selection of_points[] = {{.has_groups = true}, {.has_labels = true}};
    for (int s = 0; s < 2; s++) { /* and none for the queries */
        const hs_among queried = {.points = SET(&points, .groups = two, .labels = two),
                                  .queries = SET(&points),
                                  .selection = &of_points[s]};
        CHECK(hs_neighbors_find(&queried, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
        const hs_among without = {.points = SET(&points, .groups = two, .labels = two),
                                  .queries = SET(&none),
                                  .selection = &of_points[s]};
        CHECK(hs_neighbors_find(&without, &options, &pairs, &failure) == HS_OK);
        hs_pairs_free(pairs);
        const hs_among nowhere = {
            .points = SET(&none), .queries = SET(&none), .selection = &of_points[s]};
        CHECK(hs_neighbors_find(&nowhere, &options, &pairs, &failure) == HS_OK);
        hs_pairs_free(pairs);
    }
    for (int e = 0; e < 4; e++) {
        hs_selection   one = {.n_excluded = 1, .excluded = outside[e]};
        const hs_among among = {.points = SET(&points), .selection = &one};
        CHECK(hs_pairs_find(&among, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
        CHECK(failure.row == 0);
        one = (hs_selection){.query_numbers = outside[e] + (e > 1)};
        const hs_points one_query = {x, 1, 1, HS_FLOAT64, 8, 8};
        const hs_among  queried = {
             .points = SET(&points), .queries = SET(&one_query), .selection = &one};
        CHECK(hs_neighbors_find(&queried, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    }
    hs_selection   least = {.min_distance = 0.5};
    const hs_among among = {.points = SET(&points), .selection = &least};
    hs_plan        plan;
    options.precision = HS_SINGLE;
    CHECK(hs_pairs_find(&among, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    options.precision = HS_EXACT;
    CHECK(hs_plan_make(&among, &options, &plan, &failure) == HS_ERR_ARGUMENT);
    least.min_distance = -0.5;
    CHECK(hs_nearest_find(&among, 1, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    const hs_points in_plane = {x, 1, 2, HS_FLOAT64, 16, 8};
    hs_selection    labelled = {.has_labels = true};
    hs_among        in_box = {
               .points = SET(&in_plane, .labels = two), .box = &skewed, .selection = &labelled};
    CHECK(hs_pairs_find(&in_box, &options, &pairs, &failure) == HS_ERR_BOX_SKEWED);
    hs_box dependent = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 1.0}, {2.0, 2.0}}};
    in_box.box = &dependent;
    CHECK(hs_pairs_find(&in_box, &options, &pairs, &failure) == HS_ERR_BOX_DEPENDENT);
}

/*
 * ---- choose far ----
 *
 * Excluded pairs of points that are many periods apart, in a box so skewed that S over its vectors
 * is far larger still: what S says does not depend on that, until it does not fit.
 */

enum { N = 300 }; /* more than are looked up together */

#define SIDE 8.0
#define TILT 0x1p20 /* S is so many times the number of periods */

static const hs_box far_box = {
    .ndim = 2, .periodic = {true, true}, .rows = {{SIDE}, {SIDE * TILT, SIDE}}};

static double  far_x[2 * N];
static int64_t far_labels[N];

/* Points on a fine lattice, all with one label. */
static void
make_far_points(void)
{
    harness_random random = {86};
    for (int e = 0; e < 2 * N; e++)
        far_x[e] = (double)(random_bits(&random) % 128) / 16.0;
    memset(far_labels, 0, sizeof far_labels);
}

/* Moves a point by a vector of the lattice along the second axis: that is exact. */
static void
move(int point, double periods)
{
    far_x[2 * point + 1] += SIDE * periods;
}

/* Pairs whose labels differ, and images other than the nearest of those whose do not; as many as
 * are counted. */
static hs_status
find(double min_distance, hs_pairs **pairs, hs_failure *failure)
{
    const hs_points    points = {far_x, N, 2, HS_FLOAT64, 16, 8};
    const hs_selection selection = {.has_labels = true, .min_distance = min_distance};
    const hs_among     among = {
            .points = SET(&points, .labels = far_labels), .box = &far_box, .selection = &selection};
    hs_options options = hs_options_default();
    options.cutoff = 0.75 * SIDE + 0x1p-13; /* which no pair is so near that S decides */
    int64_t         n = 0;
    const hs_status status = hs_pairs_find(&among, &options, pairs, failure);
    CHECK(hs_pairs_count(&among, &options, &n, NULL) == status);
    CHECK(status != HS_OK || n == hs_pairs_length(*pairs));
    return status;
}

/* Likewise the nearest, far enough that some are other images of excluded pairs. */
static hs_status
find_nearest(const hs_points *queries, const hs_selection *selection, hs_pairs **rows,
             hs_failure *failure)
{
    const hs_points points = {far_x, N, 2, HS_FLOAT64, 16, 8};
    const hs_among  among = {.points = SET(&points, .labels = far_labels),
                             .queries = SET(queries),
                             .box = &far_box,
                             .selection = selection};
    hs_options      options = hs_options_default();
    options.cutoff = INFINITY;
    options.want = HS_WANT_J;
    return hs_nearest_find(&among, 4, &options, rows, failure);
}

static bool
same_pairs(const hs_pairs *one, const hs_pairs *other)
{
    const int64_t n = hs_pairs_length(one);
    const size_t  size = (size_t)n * sizeof(int64_t);
    return n == hs_pairs_length(other) &&
           memcmp(hs_pairs_array(one, HS_WANT_I), hs_pairs_array(other, HS_WANT_I), size) == 0 &&
           memcmp(hs_pairs_array(one, HS_WANT_J), hs_pairs_array(other, HS_WANT_J), size) == 0;
}

/* An S beyond 2^62 is not known: the search ends, unless it need not be known. */
static void
shifts_that_are_not_known_are_told(void)
{
    const hs_selection labelled = {.has_labels = true};
    for (int every = 1; every < N; every *= 7) {
        hs_pairs  *near, *far;
        hs_failure failure;
        make_far_points();
        for (int i = every; i < N; i += 2 * every)
            move(i, 0x1p42);
        CHECK(find(0.0, &far, &failure) == HS_ERR_SHIFT_RANGE && far == NULL);
        CHECK(failure.row >= 0 && failure.row < N);
        CHECK(find_nearest(NULL, &labelled, &far, &failure) == HS_ERR_SHIFT_RANGE);
        CHECK(far == NULL && failure.row >= 0 && failure.row < N);
        for (int i = every; i < N; i += 2 * every)
            far_labels[i] = -i;
        CHECK(find(0.0, &far, NULL) == HS_OK);
        for (int i = every; i < N; i += 2 * every)
            move(i, -0x1p42);
        CHECK(find(0.0, &near, NULL) == HS_OK);
        CHECK(same_pairs(near, far) && hs_pairs_length(near) > N);
        hs_pairs_free(near);
        hs_pairs_free(far);
    }
}

/* Queries that are points find themselves at S = 0 only, however large S is, and others no nearer
 * than the least distance. */
static void
numbered_queries_may_be_far_away(void)
{
    static double      x[2 * N];
    static int64_t     numbers[N];
    const hs_points    queries = {x, N, 2, HS_FLOAT64, 16, 8};
    const hs_selection selection = {.query_numbers = numbers, .min_distance = 1.0 / 16.0};
    hs_pairs          *rows, *moved[2];
    make_far_points();
    memcpy(x, far_x, sizeof x);
    for (int i = 0; i < N; i++)
        numbers[i] = i;
    CHECK(find_nearest(&queries, &selection, &rows, NULL) == HS_OK);
    const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
    for (int i = 0; i < N; i++) /* itself */
        CHECK(j[4 * i] == i);
    hs_pairs_free(rows);
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < N; i++)
            x[2 * i + 1] = far_x[2 * i + 1] + SIDE * (k == 0 ? 1.0 : 0x1p42);
        CHECK(find_nearest(&queries, &selection, &moved[k], NULL) == HS_OK);
    }
    j = hs_pairs_array(moved[0], HS_WANT_J);
    for (int i = 0; i < N; i++) /* itself, but an image that is too near */
        CHECK(j[4 * i] != i);
    CHECK(memcmp(j, hs_pairs_array(moved[1], HS_WANT_J), 4 * N * sizeof *j) == 0);
    hs_pairs_free(moved[0]);
    hs_pairs_free(moved[1]);
}

/* Queries too far for cells that were kept: these are made anew, and the choice stays. */
static void
far_queries_of_cells_choose_as_well(void)
{
    enum { Q = 3 };
    static const double  x[4] = {0.25, 0.5, 1.0, 2.5}, far[Q] = {0.5, -1e3, 1e9};
    static const int64_t groups[4] = {0, 1, 0, 1}, of_queries[Q] = {1, 0, 1};
    const hs_points      points = points_in_rows(x, 4, 1), queries = points_in_rows(far, Q, 1);
    const hs_selection   selection = {.has_groups = true};
    hs_set               known = {.groups = groups};
    hs_options           options = hs_options_default();
    hs_cells            *cells;
    hs_pairs            *of_cells, *rows;
    options.cutoff = 1.0;
    CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_OK);
    hs_among among = {.points = SET(&points, .groups = groups),
                      .queries = SET(&queries, .groups = of_queries),
                      .selection = &selection};
    CHECK(hs_neighbors_find(&among, &options, &rows, NULL) == HS_OK);
    among.cells = cells;
    among.points = &known;
    CHECK(hs_neighbors_find(&among, &options, &of_cells, NULL) == HS_OK);
    CHECK(hs_pairs_length(rows) == 1 && same_pairs(rows, of_cells));
    hs_pairs_free(of_cells);
    hs_pairs_free(rows);
    hs_cells_free(cells);
}

/* Labels at the ends of their range: no difference of two overflows. */
static void
labels_may_be_of_any_size(void)
{
    static const int64_t labels[] = {INT64_MIN, INT64_MIN + 3, -1, 0, 4, INT64_MAX - 5, INT64_MAX};
    static const int64_t withins[] = {0, 3, 4, 5, INT64_MAX - 5, INT64_MAX};
    enum { LABELS = sizeof labels / sizeof *labels };
    const double    x[LABELS] = {0.0};
    const hs_points points = points_in_rows(x, LABELS, 1);
    hs_options      options = hs_options_default();
    options.cutoff = 1.0;
    options.sorted = true;
    for (int k = 0; k < 6; k++) {
        const hs_selection selection = {.has_labels = true, .within = withins[k]};
        const hs_among among = {.points = SET(&points, .labels = labels), .selection = &selection};
        hs_pairs      *pairs = NULL;
        int64_t        n = 0;
        CHECK(hs_pairs_find(&among, &options, &pairs, NULL) == HS_OK);
        const int64_t *i = hs_pairs_array(pairs, HS_WANT_I), *j = hs_pairs_array(pairs, HS_WANT_J);
        for (int a = 0; a < LABELS; a++) {
            for (int b = a + 1; b < LABELS; b++) { /* labels ascend */
                if ((uint64_t)labels[b] - (uint64_t)labels[a] <= (uint64_t)withins[k])
                    continue;
                CHECK(n < hs_pairs_length(pairs) && i[n] == a && j[n] == b);
                n++;
            }
        }
        CHECK(n == hs_pairs_length(pairs));
        hs_pairs_free(pairs);
    }
}

void
test_choice(void)
{
    RUN(one_point_may_have_many_partners);
    RUN(numbers_may_be_far_apart);
    RUN(numbers_go_with_queries);
    RUN(single_precision_chooses_as_well);
    RUN(systems_choose_as_well);
    RUN(numbers_of_queries_hold_in_systems);
    RUN(a_bad_box_of_a_system_is_told);
    RUN(bad_selections_are_refused);
    RUN(a_group_without_points_has_no_nearest);
    RUN(searches_leave_out_what_integers_say);
    RUN(refused_memory_leaves_nothing);
    RUN(shifts_that_are_not_known_are_told);
    RUN(numbered_queries_may_be_far_away);
    RUN(far_queries_of_cells_choose_as_well);
    RUN(labels_may_be_of_any_size);
}
