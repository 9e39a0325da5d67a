/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_systems_rows.c: rows, nearest points and histograms of many systems, against one call
 * for each. */
#include "../support/harness.h"

#include "../../../csrc/halfshell.h"

#include <math.h>

void test_api_systems_rows(void);

enum { N_SYSTEMS = 20, MOST = 40, N_EDGES = 4, N_TYPES = 2, CELLS = N_TYPES * N_TYPES * N_EDGES };

static struct {
    double       x[N_SYSTEMS * MOST * 3], q[N_SYSTEMS * MOST * 3];
    double       rows[N_SYSTEMS * 9], cutoffs[N_SYSTEMS], edges[N_EDGES];
    int64_t      first[N_SYSTEMS + 1], first_query[N_SYSTEMS + 1];
    int64_t      groups[N_SYSTEMS * MOST], query_groups[N_SYSTEMS * MOST];
    double       radii[N_SYSTEMS * MOST];
    int32_t      types[N_SYSTEMS * MOST];
    double       weights[N_SYSTEMS * MOST];
    hs_box       box;
    hs_points    points, queries;
    hs_selection selection;
    hs_reach     reach;
    hs_systems   systems;
    hs_options   options;
} s;

static hs_points
points_at(const double *x, const int64_t *first, int64_t n)
{
    return (hs_points){x + 3 * first[n], first[n + 1] - first[n], 3, HS_FLOAT64, 24, 8};
}

static void
make_scene(uint64_t seed)
{
    harness_random random = {seed};
    memset(&s, 0, sizeof s);
    for (int n = 0; n < N_SYSTEMS; n++) {
        const int64_t more = n % 7 == 3 ? 0 : (int64_t)(random_unit(&random) * MOST);
        s.first[n + 1] = s.first[n] + more;
        s.first_query[n + 1] = s.first_query[n] + (int64_t)(random_unit(&random) * 6);
        s.cutoffs[n] = 0.5 + random_unit(&random);
        for (int k = 0; k < 9; k++)
            s.rows[9 * n + k] = (k % 4 == 0 ? 3.0 : 0.0) + 0.5 * random_unit(&random);
    }
    for (int e = 0; e < N_SYSTEMS * MOST * 3; e++) {
        s.x[e] = 2.5 * random_unit(&random);
        s.q[e] = 2.5 * random_unit(&random);
    }
    for (int e = 0; e < N_SYSTEMS * MOST; e++) {
        s.groups[e] = (int64_t)(3.0 * random_unit(&random));
        s.query_groups[e] = (int64_t)(3.0 * random_unit(&random));
        s.radii[e] = random_unit(&random);
        s.types[e] = e % N_TYPES;
        s.weights[e] = random_unit(&random) - 0.25;
    }
    for (int k = 0; k < N_EDGES; k++)
        s.edges[k] = 0.4 * (k + 1);
    s.box = (hs_box){.ndim = 3, .periodic = {true, true, false}};
    s.points = (hs_points){s.x, s.first[N_SYSTEMS], 3, HS_FLOAT64, 24, 8};
    s.queries = (hs_points){s.q, s.first_query[N_SYSTEMS], 3, HS_FLOAT64, 24, 8};
    s.selection = (hs_selection){.groups = s.groups, .query_groups = s.query_groups};
    s.reach = (hs_reach){.radii = s.radii, .query_radii = s.radii};
    s.systems = (hs_systems){.n = N_SYSTEMS,
                             .first = s.first,
                             .box = &s.box,
                             .rows = s.rows,
                             .first_query = s.first_query};
    s.options = hs_options_default();
    s.options.cutoff = 1.0;
    s.options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_SHIFT | HS_WANT_BOTH;
}

/* One system by itself. */
typedef struct single {
    hs_points    points, queries;
    hs_box       box;
    hs_selection selection;
    hs_reach     reach;
    hs_options   options;
    hs_among     among;
} single;

static void
take_single(int n, bool has_queries, single *one)
{
    *one = (single){
        .points = points_at(s.x, s.first, n),
        .queries = points_at(s.q, s.first_query, n),
        .box = s.box,
        .selection = {.groups = s.groups + s.first[n],
                      .query_groups = s.query_groups + s.first_query[n]},
        .reach = {.radii = s.radii + s.first[n], .query_radii = s.radii + s.first_query[n]},
        .options = s.options};
    for (int k = 0; k < 9; k++)
        one->box.rows[k / 3][k % 3] = s.rows[9 * n + k];
    one->options.threads = 1;
    one->options.cutoff = s.systems.cutoffs != NULL ? s.cutoffs[n] : s.options.cutoff;
    one->among =
        (hs_among){.points = &one->points, .box = s.systems.box != NULL ? &one->box : NULL};
    one->among.queries = has_queries ? &one->queries : NULL;
    one->among.reach = s.systems.reach != NULL ? &one->reach : NULL;
    one->among.selection = s.systems.selection != NULL ? &one->selection : NULL;
}

/* Compares pairs [at, at + n) of all with those of one system; k: of the nearest, or 0. */
static void
compare_pairs(const hs_pairs *all, int64_t at, const hs_pairs *own, int n, bool has_queries)
{
    const int64_t  n_pairs = hs_pairs_length(own);
    const int64_t *i = hs_pairs_array(all, HS_WANT_I), *j = hs_pairs_array(all, HS_WANT_J);
    const int64_t *both = hs_pairs_array(all, HS_WANT_BOTH);
    const int64_t *a = hs_pairs_array(own, HS_WANT_I), *b = hs_pairs_array(own, HS_WANT_J);
    const double  *d = hs_pairs_array(all, HS_WANT_DISTANCE);
    const double  *c = hs_pairs_array(own, HS_WANT_DISTANCE);
    const int64_t  first = s.first[n], asking = has_queries ? s.first_query[n] : first;
    CHECK(at + n_pairs <= hs_pairs_length(all));
    for (int64_t p = 0; p < n_pairs; p++) {
        CHECK(j[at + p] == (b[p] < 0 ? -1 : b[p] + first) && d[at + p] == c[p]);
        CHECK(i == NULL || i[at + p] == a[p] + asking);
        CHECK(both == NULL ||
              (both[2 * (at + p)] == a[p] + asking && both[2 * (at + p) + 1] == b[p] + first));
    }
}

static void
check_rows(bool has_queries)
{
    const hs_points *queries = has_queries ? &s.queries : NULL;
    static int64_t   counts[N_SYSTEMS * MOST];
    hs_pairs        *all, *near;
    int64_t          at = 0, row = 0;
    CHECK(hs_systems_neighbors(&s.points, queries, &s.systems, &s.options, &all, NULL) == HS_OK);
    CHECK(hs_systems_coordination(&s.points, queries, &s.systems, &s.options, counts, NULL) ==
          HS_OK);
    const int64_t *offsets = hs_pairs_offsets(all);
    for (int n = 0; n < N_SYSTEMS; n++) {
        single    one;
        hs_pairs *own;
        take_single(n, has_queries, &one);
        CHECK(hs_neighbors_find(&one.among, &one.options, &own, NULL) == HS_OK);
        compare_pairs(all, at, own, n, has_queries);
        at += hs_pairs_length(own);
        const int64_t *ends = hs_pairs_offsets(own), n_rows = hs_pairs_rows(own);
        for (int64_t i = 0; i < n_rows; i++, row++) {
            CHECK(counts[row] == ends[i + 1] - ends[i]);
            CHECK(offsets[row + 1] - offsets[row] == counts[row]);
        }
        hs_pairs_free(own);
    }
    CHECK(at > 10 && at == hs_pairs_length(all) && row == hs_pairs_rows(all) && offsets[0] == 0);
    hs_pairs_free(all);
    if (s.systems.reach != NULL || s.systems.selection != NULL) {
        CHECK(hs_systems_nearest(&s.points, queries, &s.systems, 3, &s.options, &near, NULL) ==
              HS_ERR_ARGUMENT);
        return;
    }
    CHECK(hs_systems_nearest(&s.points, queries, &s.systems, 3, &s.options, &near, NULL) == HS_OK);
    at = 0;
    for (int n = 0; n < N_SYSTEMS; n++) {
        single    one;
        hs_pairs *own;
        take_single(n, has_queries, &one);
        CHECK(hs_nearest_find(&one.among, 3, &one.options, &own, NULL) == HS_OK);
        compare_pairs(near, at, own, n, has_queries);
        at += hs_pairs_length(own);
        hs_pairs_free(own);
    }
    CHECK(at == hs_pairs_length(near) && hs_pairs_offsets(near) == NULL);
    hs_pairs_free(near);
}

static void
rows_are_those_of_single_calls(void)
{
    for (uint64_t seed = 1; seed <= TRIALS(10); seed++) {
        for (int kind = 0; kind < 64; kind++) {
            make_scene(seed);
            s.systems.box = kind & 1 ? &s.box : NULL;
            s.systems.rows = kind & 1 ? s.rows : NULL;
            s.systems.cutoffs = kind & 2 ? s.cutoffs : NULL;
            s.systems.selection = kind & 4 ? &s.selection : NULL;
            s.systems.reach = kind & 8 ? &s.reach : NULL;
            s.options.threads = kind & 16 ? 3 : 1;
            check_rows(kind & 32);
        }
    }
}

/* Numbers of 4 bytes, of which -1 stays. */
static void
numbers_may_be_short(void)
{
    hs_pairs *wide, *narrow;
    make_scene(3);
    s.options.want = HS_WANT_J | HS_WANT_DISTANCE;
    CHECK(hs_systems_nearest(&s.points, NULL, &s.systems, 50, &s.options, &wide, NULL) == HS_OK);
    s.options.index_bytes = 4;
    CHECK(hs_systems_nearest(&s.points, NULL, &s.systems, 50, &s.options, &narrow, NULL) == HS_OK);
    const int64_t *j = hs_pairs_array(wide, HS_WANT_J);
    const int32_t *k = hs_pairs_array(narrow, HS_WANT_J);
    for (int64_t e = 0; e < hs_pairs_length(wide); e++)
        CHECK(j[e] == k[e]);
    hs_pairs_free(wide);
    hs_pairs_free(narrow);
}

/* Into the caller's arrays, which may be too small. */
static void
rows_go_where_the_caller_says(void)
{
    static int64_t i[100000], j[100000];
    hs_pair_arrays out = {.capacity = 100000, .index_bytes = 8, .i = i, .j = j};
    hs_pairs      *rows, *into;
    hs_failure     failure;
    make_scene(4);
    s.options.want = HS_WANT_I | HS_WANT_J;
    for (s.options.threads = 1; s.options.threads <= 2; s.options.threads++) {
        s.options.out = NULL;
        CHECK(hs_systems_neighbors(&s.points, &s.queries, &s.systems, &s.options, &rows, NULL) ==
              HS_OK);
        const int64_t  n = hs_pairs_length(rows);
        const int64_t *a = hs_pairs_array(rows, HS_WANT_I), *b = hs_pairs_array(rows, HS_WANT_J);
        s.options.out = &out;
        CHECK(hs_systems_neighbors(&s.points, &s.queries, &s.systems, &s.options, &into, NULL) ==
              HS_OK);
        CHECK(hs_pairs_length(into) == n && n > 10);
        CHECK(memcmp(a, i, (size_t)n * 8) == 0 && memcmp(b, j, (size_t)n * 8) == 0);
        hs_pairs_free(into);
        out.capacity = n - 1;
        CHECK(hs_systems_neighbors(&s.points, &s.queries, &s.systems, &s.options, &into,
                                   &failure) == HS_ERR_CAPACITY);
        CHECK(failure.expected_pairs == (double)n && into == NULL);
        out.capacity = 100000;
        hs_pairs_free(rows);
    }
}

static void
histograms_are_those_of_single_calls(void)
{
    static int64_t counts[N_SYSTEMS * CELLS], own_counts[CELLS];
    static double  sums[N_SYSTEMS * CELLS], own_sums[CELLS];
    for (int kind = 0; kind < 8; kind++) {
        make_scene(11 + (uint64_t)kind);
        s.options.threads = kind & 1 ? 3 : 1;
        s.systems.selection = kind & 4 ? &s.selection : NULL;
        const hs_points *queries = kind & 2 ? &s.queries : NULL;
        hs_histogram     wanted = {.n_edges = N_EDGES,
                                   .edges = s.edges,
                                   .n_types = N_TYPES,
                                   .of_points = {s.types, s.weights},
                                   .of_queries = {s.types, s.weights},
                                   .counts = counts,
                                   .sums = sums};
        hs_counters      counters;
        int64_t          n_pairs = 0;
        s.options.counters = &counters;
        CHECK(hs_systems_histogram(&s.points, queries, &s.systems, &s.options, &wanted, NULL) ==
              HS_OK);
        const int64_t of_all = counters.pairs;
        for (int n = 0; n < N_SYSTEMS; n++) {
            single one;
            take_single(n, queries != NULL, &one);
            wanted.of_points = (hs_marks){s.types + s.first[n], s.weights + s.first[n]};
            wanted.of_queries =
                (hs_marks){s.types + s.first_query[n], s.weights + s.first_query[n]};
            wanted.counts = own_counts;
            wanted.sums = own_sums;
            CHECK(hs_pairs_histogram(&one.among, &one.options, &wanted, NULL) == HS_OK);
            CHECK(memcmp(counts + n * CELLS, own_counts, sizeof own_counts) == 0);
            CHECK(memcmp(sums + n * CELLS, own_sums, sizeof own_sums) == 0);
            n_pairs += counters.pairs;
        }
        CHECK(n_pairs == of_all && n_pairs > 50);
    }
}

static void
a_histogram_may_have_no_marks(void)
{
    static int64_t counts[N_SYSTEMS * N_EDGES];
    int64_t        n_pairs = 0, n_counted = 0, each[N_SYSTEMS];
    hs_histogram   wanted = {
          .n_edges = N_EDGES, .edges = s.edges, .inclusive = true, .n_types = 1, .counts = counts};
    make_scene(5);
    CHECK(hs_systems_histogram(&s.points, NULL, &s.systems, &s.options, &wanted, NULL) == HS_OK);
    s.options.cutoff = s.edges[N_EDGES - 1];
    CHECK(hs_systems_count(&s.points, &s.systems, &s.options, each, NULL) == HS_OK);
    for (int n = 0; n < N_SYSTEMS; n++)
        n_pairs += each[n];
    for (int e = 0; e < N_SYSTEMS * N_EDGES; e++)
        n_counted += counts[e];
    CHECK(n_pairs == n_counted && n_pairs > 0);
    static double sums[N_SYSTEMS * N_EDGES]; /* without weights they are the counts */
    wanted.counts = NULL;
    wanted.sums = sums;
    CHECK(hs_systems_histogram(&s.points, NULL, &s.systems, &s.options, &wanted, NULL) == HS_OK);
    for (int e = 0; e < N_SYSTEMS * N_EDGES; e++)
        CHECK(sums[e] == (double)counts[e]);
}

static void
what_has_no_meaning_is_refused(void)
{
    static int64_t counts[N_SYSTEMS * N_EDGES];
    hs_histogram   wanted = {.n_edges = N_EDGES, .edges = s.edges, .n_types = 1, .counts = counts};
    hs_failure     failure;
    hs_pairs      *rows;
    make_scene(6);
    CHECK(hs_systems_nearest(&s.points, NULL, &s.systems, 0, &s.options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_systems_nearest(&s.points, NULL, &s.systems, 1, &s.options, &rows, NULL) == HS_OK);
    CHECK(hs_pairs_length(rows) == s.points.n);
    hs_pairs_free(rows);
    s.options.cutoff = -1.0;
    CHECK(hs_systems_nearest(&s.points, NULL, &s.systems, 2, &s.options, &rows, &failure) ==
          HS_ERR_CUTOFF);
    CHECK(failure.value == -1.0);
    s.options.cutoff = INFINITY;
    CHECK(hs_systems_nearest(&s.points, NULL, &s.systems, 2, &s.options, &rows, NULL) == HS_OK);
    hs_pairs_free(rows);
    s.systems.cutoffs = s.cutoffs;
    s.options.cutoff = -1.0; /* is not looked at, and neither by histograms */
    CHECK(hs_systems_nearest(&s.points, NULL, &s.systems, 2, &s.options, &rows, NULL) == HS_OK);
    hs_pairs_free(rows);
    CHECK(hs_systems_histogram(&s.points, NULL, &s.systems, &s.options, &wanted, NULL) == HS_OK);
    s.systems.cutoffs = NULL;
    s.systems.reach = &s.reach;
    CHECK(hs_systems_histogram(&s.points, NULL, &s.systems, &s.options, &wanted, NULL) ==
          HS_ERR_ARGUMENT);
    s.systems.reach = NULL;
    wanted.n_types = INT32_MAX;
    CHECK(hs_systems_histogram(&s.points, NULL, &s.systems, &s.options, &wanted, NULL) ==
          HS_ERR_MEMORY);
    wanted.n_types = 0;
    CHECK(hs_systems_histogram(&s.points, NULL, &s.systems, &s.options, &wanted, NULL) ==
          HS_ERR_ARGUMENT);
}

/* Where there is no system, none of its counts is written, however many there may be of one. */
static void
counts_of_a_system_are_fewer_than_2_to_31(void)
{
    hs_histogram wanted = {.n_edges = 2, .edges = s.edges, .n_types = 32767};
    make_scene(9);
    wanted.counts = s.first;
    s.systems.n = s.points.n = 0;
    CHECK(hs_systems_histogram(&s.points, NULL, &s.systems, &s.options, &wanted, NULL) == HS_OK);
    wanted.n_types++;
    CHECK(hs_systems_histogram(&s.points, NULL, &s.systems, &s.options, &wanted, NULL) ==
          HS_ERR_MEMORY);
}

void
test_api_systems_rows(void)
{
    RUN(rows_are_those_of_single_calls);
    RUN(numbers_may_be_short);
    RUN(rows_go_where_the_caller_says);
    RUN(histograms_are_those_of_single_calls);
    RUN(a_histogram_may_have_no_marks);
    RUN(counts_of_a_system_are_fewer_than_2_to_31);
    RUN(what_has_no_meaning_is_refused);
}
