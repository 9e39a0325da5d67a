/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_api_neighbors.c: rows of all neighbours, of points and of queries. The half list, which
 * other tests hold against a brute force, says what they must be, to the last bit: each pair both
 * ways, or from one part of the points to the other.
 */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_api_neighbors(void);

/* One entry of a row. */
typedef struct entry {
    int64_t i, j;
    int32_t shift[HS_MAX_DIM];
    double  distance, vector[HS_MAX_DIM];
} entry;

typedef struct entries {
    int64_t n;
    entry  *of;
} entries;

static int dimensions; /* of the entries that are put in order */

static int
entry_order(const void *a, const void *b)
{
    const entry *p = a, *q = b;
    if (p->i != q->i)
        return p->i < q->i ? -1 : 1;
    if (p->j != q->j)
        return p->j < q->j ? -1 : 1;
    for (int l = 0; l < dimensions; l++) {
        if (p->shift[l] != q->shift[l])
            return p->shift[l] < q->shift[l] ? -1 : 1;
    }
    return 0;
}

static entry
entry_of(const found_pairs *found, int64_t e, bool reversed)
{
    entry of = {.i = reversed ? found->j[e] : found->i[e],
                .j = reversed ? found->i[e] : found->j[e],
                .distance = found->distance[e]};
    for (int k = 0; k < dimensions; k++) {
        const int32_t shift = found->shift[e * dimensions + k];
        const double  along = found->vector[e * dimensions + k];
        of.shift[k] = reversed ? -shift : shift;
        of.vector[k] = (reversed ? -along : along) + 0.0;
    }
    return of;
}

/* From the half list: both ways, or with a split from points before it to those from it on. */
static entries
expected_entries(const found_pairs *half, int64_t split)
{
    entries all = {.of = array_of(2 * half->n, sizeof(entry))};
    for (int64_t e = 0; e < half->n; e++) {
        if (split < 0) {
            all.of[all.n++] = entry_of(half, e, false);
            all.of[all.n++] = entry_of(half, e, true);
        } else if (half->i[e] < split && half->j[e] >= split) {
            all.of[all.n] = entry_of(half, e, false);
            all.of[all.n++].j -= split;
        }
    }
    qsort(all.of, (size_t)all.n, sizeof(entry), entry_order);
    return all;
}

static bool
same_entry(const entry *expected, const found_pairs *found, int64_t e)
{
    const entry got = entry_of(found, e, false);
    return entry_order(&got, expected) == 0 && got.distance == expected->distance &&
           memcmp(got.vector, expected->vector, sizeof got.vector) == 0;
}

static bool
same_rows(const entries *expected, const hs_pairs *rows, int64_t n_rows, const found_pairs *found)
{
    const int64_t *offsets = hs_pairs_offsets(rows);
    if (hs_pairs_rows(rows) != n_rows || found->n != expected->n || offsets[0] != 0 ||
        offsets[n_rows] != found->n)
        return false;
    for (int64_t i = 0; i < n_rows; i++) {
        for (int64_t e = offsets[i]; e < offsets[i + 1]; e++) {
            if (found->i[e] != i || !same_entry(&expected->of[e], found, e))
                return false;
        }
    }
    return true;
}

/* The sets of a scene: all points, or those before the split as queries. */
typedef struct sets_of_scene {
    hs_points        points, queries;
    const hs_points *asking; /* NULL: the points */
} sets_of_scene;

static void
split_scene(const brute_scene *scene, int64_t split, sets_of_scene *sets)
{
    sets->points = points_of(scene);
    sets->asking = NULL;
    if (split >= 0) {
        sets->queries = sets->points;
        sets->queries.n = split;
        sets->points.n -= split;
        sets->points.data = scene->x + split * scene->ndim;
        sets->asking = &sets->queries;
    }
}

static void
take_all(hs_pairs *rows, found_pairs *found)
{
    found->n = hs_pairs_length(rows);
    found->i = hs_pairs_take(rows, HS_WANT_I);
    found->j = hs_pairs_take(rows, HS_WANT_J);
    found->distance = hs_pairs_take(rows, HS_WANT_DISTANCE);
    found->vector = hs_pairs_take(rows, HS_WANT_VECTOR);
    found->shift = hs_pairs_take(rows, HS_WANT_SHIFT);
}

/* Numbers alone, int32, and the lengths alone. */
static bool
bare_rows_agree(const sets_of_scene *sets, const brute_scene *scene, hs_options options,
                const entries *expected)
{
    const int64_t n = sets->asking != NULL ? sets->queries.n : sets->points.n;
    int64_t      *counts = array_of(n, sizeof(int64_t)), total = 0;
    hs_pairs     *rows = NULL;
    options.want = HS_WANT_J;
    options.index_bytes = 4;
    bool same = hs_neighbors_find(QUERIED(&sets->points, sets->asking, scene->box), &options, &rows,
                                  NULL) == HS_OK &&
                hs_pairs_length(rows) == expected->n &&
                hs_neighbors_count(QUERIED(&sets->points, sets->asking, scene->box), &options,
                                   counts, NULL) == HS_OK;
    const int32_t *j = same ? hs_pairs_array(rows, HS_WANT_J) : NULL;
    const int64_t *offsets = same ? hs_pairs_offsets(rows) : NULL;
    for (int64_t e = 0; same && e < expected->n; e++)
        same = j[e] == expected->of[e].j;
    for (int64_t i = 0; same && i < n; i++)
        same = counts[i] == offsets[i + 1] - offsets[i];
    if (same && sets->asking != NULL)
        same = hs_pairs_count(QUERIED(&sets->points, sets->asking, scene->box), &options, &total,
                              NULL) == HS_OK &&
               total == expected->n;
    hs_pairs_free(rows);
    free(counts);
    return same;
}

/* Whether rows are what the half list says. split < 0: the points ask. Returns their entries. */
static int64_t
compare_rows(const brute_scene *scene, int64_t split, int threads)
{
    const hs_points all = points_of(scene);
    hs_options      options = options_of(scene);
    found_pairs     half, found = {0};
    sets_of_scene   sets;
    hs_pairs       *rows = NULL;
    dimensions = scene->ndim;
    options.want = WANT_ALL;
    options.threads = threads;
    split_scene(scene, split, &sets);
    if (search_pairs(&all, scene->box, &options, &half, NULL) != HS_OK)
        return 0;
    const entries expected = expected_entries(&half, split);
    CHECK(hs_neighbors_find(QUERIED(&sets.points, sets.asking, scene->box), &options, &rows,
                            NULL) == HS_OK);
    take_all(rows, &found);
    const bool same = same_rows(&expected, rows, split < 0 ? scene->n : split, &found) &&
                      bare_rows_agree(&sets, scene, options, &expected);
    CHECK(same);
    if (!same)
        fprintf(stderr, "  d = %d, n = %d, split %d, cutoff %a: %d entries, %d expected\n",
                scene->ndim, (int)scene->n, (int)split, scene->cutoff, (int)found.n,
                (int)expected.n);
    const int64_t n = found.n;
    hs_pairs_free(rows);
    found_free(&found);
    found_free(&half);
    free(expected.of);
    return n;
}

static void
rows_are_the_half_list_both_ways(void)
{
    harness_random      random = {4242};
    static random_scene s;
    const char         *names[16];
    const int           n_names = hs_kernel_names(names, 16);
    int64_t             found = 0;
    for (int trial = 0; trial < 960; trial += IS_SLOW ? 7 : 1) {
        const int ndim = 1 + trial / SCENE_KINDS % HS_MAX_DIM;
        const int n = random_below(&random, ndim <= 3 ? 60 : ndim <= 5 ? 12 : 6);
        kernel_to_check = names[random_below(&random, n_names)];
        algorithm_to_check = (hs_algorithm)(trial / 3 % HS_ALGORITHM_END);
        make_scene(&random, trial % SCENE_KINDS, ndim, n, trial % 7 ? 4.0 : 400.0,
                   trial % 11 ? 0 : -400, &s);
        found += compare_rows(&s.scene, -1, 1 + trial % 2);
    }
    kernel_to_check = NULL;
    algorithm_to_check = HS_AUTO;
    CHECK(found > (IS_SLOW ? 10000 : 100000));
}

static void
queries_meet_the_points_alone(void)
{
    harness_random      random = {777};
    static random_scene s;
    int64_t             found = 0;
    for (int trial = 0; trial < 960; trial += IS_SLOW ? 7 : 1) {
        const int ndim = 1 + trial / SCENE_KINDS % HS_MAX_DIM;
        const int n = random_below(&random, ndim <= 3 ? 60 : ndim <= 5 ? 12 : 6);
        make_scene(&random, trial % SCENE_KINDS, ndim, n, trial % 7 ? 4.0 : 400.0,
                   trial % 11 ? 0 : 300, &s);
        found += compare_rows(&s.scene, random_below(&random, n + 1), 1 + trial % 2);
    }
    CHECK(found > (IS_SLOW ? 2000 : 20000));
}

/* Neighbourhoods larger than a block of the half list, in one cell and in many. */
static void
crowds_and_distant_clusters(void)
{
    enum { N = 3000 };
    static double  x[3 * N];
    harness_random random = {5};
    brute_scene    scene = {.ndim = 3, .n = N, .x = x, .inclusive = true, .cutoff = 0.2};
    for (int kind = 0; kind < 3; kind++) {
        for (int e = 0; e < 3 * N; e++) {
            const double away = kind == 1 && e / 3 % 2 ? 1e9 : 0.0;
            x[e] = (kind == 2 ? 0.02 : 1.0) * random_unit(&random) + away;
        }
        scene.cutoff = kind == 2 ? 0.005 : 0.1;
        CHECK(compare_rows(&scene, -1, 2) > 1000);
        CHECK(compare_rows(&scene, N / 3, 2) > 1000);
    }
}

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
           memcmp(hs_pairs_offsets(one), hs_pairs_offsets(two),
                  (size_t)(hs_pairs_rows(one) + 1) * sizeof(int64_t)) == 0;
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

static void
a_bad_query_is_named(void)
{
    double      x[3] = {0.0, 1.0, NAN};
    brute_scene scene = {.ndim = 1, .n = 2, .x = x, .inclusive = true, .cutoff = 1.0};
    hs_points   points = points_of(&scene), queries = points;
    hs_options  options = options_of(&scene);
    hs_failure  failure;
    int64_t     count = 7;
    queries.n = 3;
    CHECK(hs_pairs_count(QUERIED(&points, &queries, NULL), &options, &count, &failure) ==
          HS_ERR_NOT_FINITE);
    CHECK(failure.in_queries && failure.row == 2);
    CHECK(hs_pairs_count(QUERIED(&queries, &points, NULL), &options, &count, &failure) ==
          HS_ERR_NOT_FINITE);
    CHECK(!failure.in_queries && failure.row == 2);
}

void
test_api_neighbors(void)
{
    RUN(rows_are_the_half_list_both_ways);
    RUN(queries_meet_the_points_alone);
    RUN(crowds_and_distant_clusters);
    RUN(one_walk_finds_what_two_find);
    RUN(one_walk_gives_way_where_memory_is_short);
    RUN(a_capacity_that_is_too_small_is_named);
    RUN(a_bad_query_is_named);
}
