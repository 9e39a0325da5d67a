/* SPDX-License-Identifier: BSD-3-Clause */
/* test_arguments.c: arguments that are wrong are refused, in every call of the table, and nothing
 * is changed. */
#include "../../../csrc/core/base/status.h"
#include "../../../csrc/core/threads/call.h"
#include "../support/among.h"
#include "../support/call_table.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"

#include <limits.h>
#include <math.h>

void test_arguments(void);

/* ---- what would be read or written out of bounds is refused before anything is read ---- */

static const double numbers[16] = {0.0, 0.0, 0.0, 0.5, 0.5, 0.5};

static hs_points
good_points(void)
{
    return points_in_rows(numbers, 2, 3);
}

/* All that are wanted, of the arrays that the caller brings. */
static void
each_array_that_is_wanted_must_be_there(void)
{
    const hs_points points = good_points();
    for (unsigned bit = 1; bit <= HS_WANT_BOTH; bit *= 2) {
        int64_t        i[1], j[1], both[2];
        int32_t        shift[3];
        double         distance[1], vector[3];
        hs_options     options = hs_options_default();
        hs_pairs      *pairs = NULL;
        hs_pair_arrays out = {.capacity = 1,
                              .index_bytes = 8,
                              .i = i,
                              .j = j,
                              .both = both,
                              .distance = distance,
                              .vector = vector,
                              .shift = shift};
        options.cutoff = 1.0;
        options.out = &out;
        options.want = bit;
        CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &pairs, NULL) == HS_OK);
        CHECK(hs_pairs_length(pairs) == 1);
        hs_pairs_free(pairs);
        switch (bit) {
        case HS_WANT_I: out.i = NULL; break;
        case HS_WANT_J: out.j = NULL; break;
        case HS_WANT_DISTANCE: out.distance = NULL; break;
        case HS_WANT_VECTOR: out.vector = NULL; break;
        case HS_WANT_SHIFT: out.shift = NULL; break;
        default: out.both = NULL;
        }
        CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &pairs, NULL) == HS_ERR_ARGUMENT);
        options.want = HS_WANT_ALL & ~bit;
        CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &pairs, NULL) == HS_OK);
        hs_pairs_free(pairs);
    }
}

/* Where neither what is asked about is there nor room for the answer. */
static void
nothing_at_all_is_refused(void)
{
    const hs_points  points = good_points();
    const hs_options options = hs_options_default();
    CHECK(hs_neighbors_count(AMONG(NULL, NULL), &options, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_pairs_count(AMONG(&points, NULL), &options, NULL, NULL) == HS_ERR_ARGUMENT);
}

/*
 * ---- call scene ----
 *
 * One small scene with good arguments for every function of calls.h, each of them where a test can
 * spoil it.
 */

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
    call_systems   systems;
    hs_visit       visit;
    hs_reach       reach;
    call           c;
} call_scene;

/* Numbers without a pattern, so that no two distances are the same. */
static void
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
static void
call_fill_scene(call_scene *s)
{
    memset(s, 0, sizeof *s);
    call_fill_numbers(s);
    s->points = points_in_rows(s->x, N_OF_CALL, 3);
    s->queries = points_in_rows(s->q, N_QUERIES_OF_CALL, 3);
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
                                  .counts = s->counts,
                                  .sums = s->sums};
    s->systems =
        (call_systems){.n = N_SYSTEMS_OF_CALL, .first = s->first, .first_query = s->first_query};
    s->visit = (hs_visit){.pair = call_note_pair};
    s->reach = (hs_reach){.rule = HS_RULE_MAX};
    s->c = (call){.points = &s->points,
                  .queries = &s->queries,
                  .known = {.types = s->types, .weights = s->weights, .radii = s->radii},
                  .of_queries = {.types = s->query_types,
                                 .weights = s->query_weights,
                                 .radii = s->query_radii},
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

/*
 * ---- bad arguments ----
 *
 * One argument after the other is spoilt, for every function of halfshell.h: those that look at it
 * refuse it before anything happens, with a failure that is filled.
 */

typedef struct fault {
    const char *name;
    void (*spoil)(call_scene *s);
    unsigned  needs; /* which functions notice: those that use all of this */
    hs_status status;
} fault;

/* name, what a function must use to notice, what it says then, how to spoil scene s */
#define FAULTS(F)                                                                                 \
    F(points_null, USES_POINTS, HS_ERR_ARGUMENT, s->c.points = NULL)                              \
    F(points_no_data, USES_POINTS, HS_ERR_ARGUMENT, s->points.data = NULL)                        \
    F(points_n_below, USES_POINTS, HS_ERR_ARGUMENT, s->points.n = -1)                             \
    F(points_n_lowest, USES_POINTS, HS_ERR_ARGUMENT, s->points.n = INT64_MIN)                     \
    F(points_n_above, USES_POINTS, HS_ERR_TOO_MANY, s->points.n = INT64_C(1) << 31)               \
    F(points_n_half, USES_POINTS, HS_ERR_TOO_MANY, s->points.n = INT64_MAX / 2)                   \
    F(points_n_highest, USES_POINTS, HS_ERR_TOO_MANY, s->points.n = INT64_MAX)                    \
    F(points_ndim_0, USES_POINTS, HS_ERR_ARGUMENT, s->points.ndim = 0)                            \
    F(points_ndim_below, USES_POINTS, HS_ERR_ARGUMENT, s->points.ndim = INT_MIN)                  \
    F(points_ndim_above, USES_POINTS, HS_ERR_ARGUMENT, s->points.ndim = HS_MAX_DIM + 1)           \
    F(points_ndim_highest, USES_POINTS, HS_ERR_ARGUMENT, s->points.ndim = INT_MAX)                \
    F(points_flat, USES_POINTS | USES_BOX, HS_ERR_ARGUMENT, s->points.ndim = 2)                   \
    F(points_real, USES_POINTS, HS_ERR_ARGUMENT, s->points.real = (hs_real)2)                     \
    F(points_real_below, USES_POINTS, HS_ERR_ARGUMENT, s->points.real = (hs_real)-1)              \
    F(points_rows_away, USES_POINTS, HS_ERR_ARGUMENT, s->points.row_stride = PTRDIFF_MAX)         \
    F(points_rows_back, USES_POINTS, HS_ERR_ARGUMENT, s->points.row_stride = PTRDIFF_MIN)         \
    F(points_columns_away, USES_POINTS, HS_ERR_ARGUMENT, s->points.column_stride = PTRDIFF_MAX)   \
    F(points_columns_back, USES_POINTS, HS_ERR_ARGUMENT, s->points.column_stride = PTRDIFF_MIN)   \
    F(points_nan, USES_POINTS, HS_ERR_NOT_FINITE, s->x[4] = NAN)                                  \
    F(points_infinite, USES_POINTS, HS_ERR_NOT_FINITE, s->x[N_OF_CALL * 3 - 1] = -INFINITY)       \
    F(queries_null, NEEDS_QUERIES, HS_ERR_ARGUMENT, s->c.queries = NULL)                          \
    F(queries_no_data, USES_QUERIES, HS_ERR_ARGUMENT, s->queries.data = NULL)                     \
    F(queries_ndim_0, USES_QUERIES, HS_ERR_ARGUMENT, s->queries.ndim = 0)                         \
    F(queries_n_below, USES_QUERIES, HS_ERR_ARGUMENT, s->queries.n = INT64_MIN)                   \
    F(queries_n_above, USES_QUERIES, HS_ERR_TOO_MANY, s->queries.n = INT64_C(1) << 31)            \
    F(queries_n_highest, USES_QUERIES, HS_ERR_TOO_MANY, s->queries.n = INT64_MAX)                 \
    F(queries_flat, USES_QUERIES, HS_ERR_ARGUMENT, s->queries.ndim = 2)                           \
    F(queries_ndim_above, USES_QUERIES, HS_ERR_ARGUMENT, s->queries.ndim = INT_MAX)               \
    F(queries_real, USES_QUERIES, HS_ERR_ARGUMENT, s->queries.real = (hs_real)INT_MAX)            \
    F(queries_rows_away, USES_QUERIES, HS_ERR_ARGUMENT, s->queries.row_stride = PTRDIFF_MIN)      \
    F(queries_nan, USES_QUERIES, HS_ERR_NOT_FINITE, s->q[3] = NAN)                                \
    F(box_null, NEEDS_BOX, HS_ERR_ARGUMENT, s->c.box = NULL)                                      \
    F(box_ndim_0, USES_BOX, HS_ERR_ARGUMENT, s->box.ndim = 0)                                     \
    F(box_ndim_below, USES_BOX, HS_ERR_ARGUMENT, s->box.ndim = INT_MIN)                           \
    F(box_ndim_above, USES_BOX, HS_ERR_ARGUMENT, s->box.ndim = HS_MAX_DIM + 1)                    \
    F(box_ndim_highest, USES_BOX, HS_ERR_ARGUMENT, s->box.ndim = INT_MAX)                         \
    F(box_flat, USES_BOX | USES_POINTS, HS_ERR_ARGUMENT, s->box.ndim = 2)                         \
    F(box_nan, USES_BOX, HS_ERR_BOX_FINITE, s->box.rows[1][2] = NAN)                              \
    F(box_infinite, USES_BOX, HS_ERR_BOX_FINITE, s->box.rows[0][0] = INFINITY)                    \
    F(box_open_infinite, USES_BOX, HS_ERR_BOX_FINITE, s->box.rows[2][1] = -INFINITY)              \
    F(box_dependent, USES_BOX, HS_ERR_BOX_DEPENDENT, memset(s->box.rows[0], 0, 24))               \
    F(options_null, USES_OPTIONS, HS_ERR_ARGUMENT, s->c.options = NULL)                           \
    F(threads_lowest, USES_OPTIONS, HS_ERR_ARGUMENT, s->options.threads = INT_MIN)                \
    F(limit_nan, USES_OPTIONS, HS_ERR_ARGUMENT, s->options.memory_limit = NAN)                    \
    F(limit_below, USES_OPTIONS, HS_ERR_ARGUMENT, s->options.memory_limit = -1.0)                 \
    F(limit_0, USES_OPTIONS, HS_ERR_MEMORY, s->options.memory_limit = 0.0)                        \
    F(cutoff_nan, USES_CUTOFF, HS_ERR_CUTOFF, s->options.cutoff = NAN)                            \
    F(cutoff_below, USES_CUTOFF, HS_ERR_CUTOFF, s->options.cutoff = -5e-324)                      \
    F(cutoff_infinite, USES_CUTOFF | NEEDS_FINITE, HS_ERR_CUTOFF, s->options.cutoff = INFINITY)   \
    F(cell_size_nan, USES_CELL_SIZE, HS_ERR_ARGUMENT, s->options.cell_size = NAN)                 \
    F(cell_size_below, USES_CELL_SIZE, HS_ERR_ARGUMENT, s->options.cell_size = -1.0)              \
    F(precision_none, USES_PRECISION, HS_ERR_ARGUMENT, s->options.precision = (hs_precision)3)    \
    F(precision_below, USES_PRECISION, HS_ERR_ARGUMENT, s->options.precision = (hs_precision)-1)  \
    F(algorithm_none, USES_CELL_SIZE, HS_ERR_ARGUMENT, s->options.algorithm = HS_ALGORITHM_END)   \
    F(algorithm_below, USES_CELL_SIZE, HS_ERR_ARGUMENT, s->options.algorithm = (hs_algorithm)-1)  \
    F(want_more, USES_WANT, HS_ERR_ARGUMENT, s->options.want |= 64)                               \
    F(want_all_bits, USES_WANT, HS_ERR_ARGUMENT, s->options.want = UINT_MAX)                      \
    F(index_bytes_0, USES_INDEX_BYTES, HS_ERR_ARGUMENT, s->options.index_bytes = 0)               \
    F(index_bytes_2, USES_INDEX_BYTES, HS_ERR_ARGUMENT, s->options.index_bytes = 2)               \
    F(index_bytes_below, USES_INDEX_BYTES, HS_ERR_ARGUMENT, s->options.index_bytes = -8)          \
    F(index_bytes_more, USES_INDEX_BYTES, HS_ERR_ARGUMENT, s->options.index_bytes = INT_MAX)      \
    F(out_without_j, USES_OUT, HS_ERR_ARGUMENT, s->options.out = &s->out; s->out.j = NULL)        \
    F(out_capacity, USES_OUT, HS_ERR_ARGUMENT, s->options.out = &s->out; s->out.capacity = -1)    \
    F(out_lowest, USES_OUT, HS_ERR_ARGUMENT, s->options.out = &s->out;                            \
      s->out.capacity = INT64_MIN; s->options.want = 0)                                           \
    F(out_index_bytes, USES_OUT, HS_ERR_ARGUMENT, s->options.out = &s->out;                       \
      s->out.index_bytes = 16)                                                                    \
    F(kernel_none, USES_KERNEL, HS_ERR_KERNEL, s->options.kernel = "none")                        \
    F(kernel_empty, USES_KERNEL, HS_ERR_KERNEL, s->options.kernel = "")                           \
    F(histogram_null, USES_HISTOGRAM, HS_ERR_ARGUMENT, s->c.histogram = NULL)                     \
    F(edges_null, USES_HISTOGRAM, HS_ERR_ARGUMENT, s->histogram.edges = NULL)                     \
    F(edges_none, USES_HISTOGRAM, HS_ERR_EDGES, s->histogram.n_edges = 0)                         \
    F(edges_below, USES_HISTOGRAM, HS_ERR_EDGES, s->histogram.n_edges = INT64_MIN)                \
    F(edges_above, USES_HISTOGRAM, HS_ERR_EDGES, s->histogram.n_edges = INT64_C(1) << 30)         \
    F(edges_highest, USES_HISTOGRAM, HS_ERR_EDGES, s->histogram.n_edges = INT64_MAX)              \
    F(edges_descend, USES_HISTOGRAM, HS_ERR_EDGES, s->edges[1] = 0.25)                            \
    F(edges_negative, USES_HISTOGRAM, HS_ERR_EDGES, s->edges[0] = -1.0)                           \
    F(edges_nan, USES_HISTOGRAM, HS_ERR_EDGES, s->edges[0] = NAN)                                 \
    F(edges_infinite, USES_HISTOGRAM, HS_ERR_EDGES, s->edges[2] = INFINITY)                       \
    F(n_types_0, USES_HISTOGRAM, HS_ERR_ARGUMENT, s->histogram.n_types = 0)                       \
    F(n_types_below, USES_HISTOGRAM, HS_ERR_ARGUMENT, s->histogram.n_types = INT32_MIN)           \
    F(n_types_highest, USES_HISTOGRAM, HS_ERR_MEMORY, s->histogram.n_types = INT32_MAX)           \
    F(types_null, USES_HISTOGRAM, HS_ERR_TYPES, s->c.known.types = NULL)                          \
    F(types_below, USES_HISTOGRAM, HS_ERR_TYPES, s->types[3] = -1)                                \
    F(types_above, USES_HISTOGRAM, HS_ERR_TYPES, s->types[3] = INT32_MAX)                         \
    F(query_types_null, USES_HISTOGRAM, HS_ERR_TYPES, s->c.of_queries.types = NULL)               \
    F(query_types, USES_HISTOGRAM, HS_ERR_TYPES, s->query_types[2] = INT32_MIN)                   \
    F(weights_nan, USES_HISTOGRAM, HS_ERR_WEIGHTS, s->weights[3] = NAN)                           \
    F(query_weights_nan, USES_HISTOGRAM, HS_ERR_WEIGHTS, s->query_weights[1] = INFINITY)          \
    F(visit_null, USES_VISIT, HS_ERR_ARGUMENT, s->c.visit = NULL)                                 \
    F(visit_none, USES_VISIT, HS_ERR_ARGUMENT, s->visit.pair = NULL)                              \
    F(reach_no_rule, USES_REACH, HS_ERR_ARGUMENT, s->reach.rule = HS_RULE_END)                    \
    F(reach_no_radii, USES_REACH, HS_ERR_ARGUMENT, s->c.known.radii = NULL)                       \
    F(reach_extent, USES_REACH, HS_ERR_ARGUMENT, s->reach.extent = INFINITY)                      \
    F(radii_nan, USES_REACH, HS_ERR_RADII, s->radii[3] = NAN)                                     \
    F(query_radii, USES_REACH | USES_QUERIES, HS_ERR_RADII, s->query_radii[4] = -1.0)             \
    F(systems_below, USES_SYSTEMS, HS_ERR_ARGUMENT, s->systems.n = INT64_MIN)                     \
    F(systems_above, USES_SYSTEMS, HS_ERR_TOO_MANY, s->systems.n = INT64_C(1) << 31)              \
    F(systems_highest, USES_SYSTEMS, HS_ERR_TOO_MANY, s->systems.n = INT64_MAX)                   \
    F(first_null, USES_SYSTEMS, HS_ERR_ARGUMENT, s->systems.first = NULL)                         \
    F(first_late, USES_SYSTEMS, HS_ERR_ARGUMENT, s->first[0] = 1)                                 \
    F(first_negative, USES_SYSTEMS, HS_ERR_ARGUMENT, s->first[0] = INT64_MIN)                     \
    F(first_descends, USES_SYSTEMS, HS_ERR_ARGUMENT, s->first[1] = s->first[2] + 1)               \
    F(first_away, USES_SYSTEMS, HS_ERR_ARGUMENT, s->first[2] = INT64_MAX)                         \
    F(first_long, USES_SYSTEMS, HS_ERR_ARGUMENT, s->first[3]++)                                   \
    F(first_longest, USES_SYSTEMS, HS_ERR_ARGUMENT, s->first[3] = INT64_MAX)                      \
    F(first_short, USES_SYSTEMS, HS_ERR_ARGUMENT, s->first[3]--)                                  \
    F(first_query_null, USES_SYSTEMS | USES_QUERIES, HS_ERR_ARGUMENT,                             \
      s->systems.first_query = NULL)                                                              \
    F(first_query_descends, USES_SYSTEMS | USES_QUERIES, HS_ERR_ARGUMENT,                         \
      s->first_query[1] = s->first_query[2] + 1)                                                  \
    F(first_query_long, USES_SYSTEMS | USES_QUERIES, HS_ERR_ARGUMENT, s->first_query[3]++)        \
    F(rows_nan, USES_SYSTEMS, HS_ERR_BOX_FINITE, s->systems.each.rows = s->rows;                  \
      s->rows[13] = NAN)                                                                          \
    F(cutoffs_nan, USES_SYSTEMS | USES_CUTOFF, HS_ERR_CUTOFF,                                     \
      s->systems.each.cutoffs = s->cutoffs;                                                       \
      s->cutoffs[2] = NAN)                                                                        \
    F(cells_null, USES_CELLS, HS_ERR_ARGUMENT, hs_cells_free(s->c.cells); s->c.cells = NULL)      \
    F(list_null, USES_LIST, HS_ERR_ARGUMENT, hs_verlet_free(s->c.list); s->c.list = NULL)         \
    F(stream_null, USES_STREAM, HS_ERR_ARGUMENT, hs_stream_free(s->c.stream); s->c.stream = NULL) \
    F(skin_nan, USES_SKIN, HS_ERR_CUTOFF, s->c.skin = NAN)                                        \
    F(skin_below, USES_SKIN, HS_ERR_CUTOFF, s->c.skin = -1.0)                                     \
    F(skin_infinite, USES_SKIN, HS_ERR_CUTOFF, s->c.skin = INFINITY)                              \
    F(k_0, USES_K, HS_ERR_ARGUMENT, s->c.k = 0)                                                   \
    F(k_below, USES_K, HS_ERR_ARGUMENT, s->c.k = INT64_MIN)                                       \
    F(k_half, USES_K, HS_ERR_MEMORY, s->c.k = INT64_MAX / 2)                                      \
    F(k_highest, USES_K, HS_ERR_MEMORY, s->c.k = INT64_MAX)                                       \
    F(max_pairs_0, USES_MAX_PAIRS, HS_ERR_ARGUMENT, s->c.max_pairs = 0)                           \
    F(max_pairs_below, USES_MAX_PAIRS, HS_ERR_ARGUMENT, s->c.max_pairs = INT64_MIN)               \
    F(max_pairs_highest, USES_MAX_PAIRS, HS_OK, s->c.max_pairs = INT64_MAX)                       \
    F(cell_size_infinite, USES_CELL_SIZE, HS_OK, s->options.cell_size = INFINITY)                 \
    F(cell_size_smallest, USES_CELL_SIZE, HS_OK, s->options.cell_size = 5e-324)                   \
    F(limit_infinite, USES_OPTIONS, HS_OK, s->options.memory_limit = INFINITY)                    \
    F(result_null, USES_RESULT, HS_ERR_ARGUMENT, s->c.has_result = false)

#define SPOIL(name, needs, status, statement) \
    static void spoil_##name(call_scene *s)   \
    {                                         \
        statement;                            \
    }
FAULTS(SPOIL)

#define ENTRY(name, needs, status, statement) {#name, spoil_##name, needs, status},
static const fault faults[] = {FAULTS(ENTRY)};

enum { N_FAULTS = sizeof faults / sizeof faults[0], POISON = 0xa5 };

static bool
is_poison(const void *bytes, size_t n)
{
    const unsigned char *byte = bytes;
    bool                 is = n > 0;
    for (size_t b = 0; b < n; b++)
        is = is && byte[b] == POISON;
    return is;
}

#define POISONED(failure, member) is_poison(&(failure)->member, sizeof(failure)->member)

/* Every field says something, and nothing that does not apply. */
static bool
is_filled(hs_status status, const hs_failure *failure)
{
    if (POISONED(failure, row) || POISONED(failure, column) || POISONED(failure, in_queries) ||
        POISONED(failure, system) || POISONED(failure, value) ||
        POISONED(failure, expected_pairs) || POISONED(failure, expected_bytes) ||
        POISONED(failure, search_bytes) || POISONED(failure, limit_bytes))
        return false;
    if (status != HS_ERR_MEMORY && (failure->expected_pairs != 0.0 || failure->limit_bytes != 0.0))
        return false;
    if (status == HS_ERR_ARGUMENT)
        return failure->row == -1 && failure->column == -1 && failure->value == 0.0;
    if (status == HS_ERR_NOT_FINITE || status == HS_ERR_BOX_FINITE)
        return failure->row >= 0 && failure->column >= 0 && !isfinite(failure->value);
    if (status == HS_ERR_TOO_MANY)
        return failure->value >= 0x1p30;
    return failure->row >= -1 && failure->system >= -1;
}

static void
complain(const call_kind *kind, const char *spoilt, const char *what)
{
    fprintf(stderr, "hs_%s, %s: %s\n", kind->name, spoilt, what);
    harness_failures++;
}

/* One function, one fault, with a failure to fill or without. */
static void
call_spoilt(const call_kind *kind, const fault *spoilt, bool has_failure)
{
    static call_scene s;
    hs_failure        failure;
    const bool        notices = (kind->uses & spoilt->needs) == spoilt->needs;
    const hs_status   expected = notices ? spoilt->status : HS_OK;
    call_fill_scene(&s);
    call_make_objects(&s.c, kind->uses);
    spoilt->spoil(&s);
    memset(&failure, POISON, sizeof failure);
    memset(&s.counters, POISON, sizeof s.counters);
    const hs_status status = kind->run(&s.c, has_failure ? &failure : NULL);
    if (status != expected)
        complain(kind, spoilt->name, hs_status_text(status));
    if (has_failure && status != HS_OK && !is_filled(status, &failure))
        complain(kind, spoilt->name, "failure is not filled");
    if ((kind->uses & USES_COUNTERS) && s.c.options != NULL &&
        (s.counters.pairs < 0 || s.counters.bytes[0] < 0 || s.counters.polls < 0))
        complain(kind, spoilt->name, "counters are not filled");
    call_free_objects(&s.c);
}

static void
each_spoilt_argument_is_refused(void)
{
    for (int k = 0; k < CALL_KINDS; k++) {
        for (int f = 0; f < N_FAULTS; f++) {
            call_spoilt(&call_kinds[k], &faults[f], true);
            call_spoilt(&call_kinds[k], &faults[f], false);
        }
    }
}

/* Where no array would be as long as it is said to be: the limits themselves. */
static void
numbers_that_are_only_large_are_fine(void)
{
    static call_scene s;
    for (int k = 0; k < CALL_KINDS; k++) {
        const ptrdiff_t strides[] = {PTRDIFF_MAX, PTRDIFF_MIN, 0, 1, -1};
        for (int t = 0; t < 5; t++) { /* one row has no next one */
            call_fill_scene(&s);
            s.points.n = s.queries.n = s.c.n_points = 1;
            s.points.row_stride = s.queries.row_stride = strides[t];
            s.first[0] = 0;
            s.first[1] = s.first[2] = s.first[3] = 1;
            s.first_query[1] = s.first_query[2] = s.first_query[3] = 1;
            call_make_objects(&s.c, call_kinds[k].uses);
            if (call_kinds[k].run(&s.c, NULL) != HS_OK)
                complain(&call_kinds[k], "one point", "stride");
            call_free_objects(&s.c);
        }
        call_fill_scene(&s);
        s.options.out = &s.out;
        s.out.capacity = INT64_MAX;
        call_make_objects(&s.c, call_kinds[k].uses);
        if (call_kinds[k].run(&s.c, NULL) != HS_OK)
            complain(&call_kinds[k], "out", "capacity");
        call_free_objects(&s.c);
    }
    hs_options options = hs_options_default();
    for (int n = 1; n < INT_MAX / 3; n *= 3) {
        options.threads = n;
        CHECK(hs_call_threads(1, &options) == (n < HS_MOST_THREADS ? n : HS_MOST_THREADS));
        options.threads = -n;
        CHECK(hs_call_threads(1, &options) == 1);
        CHECK(hs_call_threads(0x1p63, &options) == (n < HS_MOST_THREADS ? n : HS_MOST_THREADS));
    }
}

static void
arrays_without_entries_may_be_missing(void)
{
    static call_scene s;
    hs_pairs         *pairs;
    call_fill_scene(&s);
    call_make_objects(&s.c, USES_CELLS);
    const hs_points none = {.ndim = 3};
    const int64_t   zero = 0;
    int64_t         counts;
    CHECK(hs_neighbors_count(AMONG(&none, &s.box), &s.options, NULL, NULL) == HS_OK);
    CHECK(hs_neighbors_count(QUERIED(&s.points, &none, &s.box), &s.options, NULL, NULL) == HS_OK);
    CHECK(hs_neighbors_count(QUERIED(&none, &s.points, &s.box), &s.options, NULL, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_neighbors_count(QUERIED_CELLS(s.c.cells, &none), &s.options, NULL, NULL) == HS_OK);
    CHECK(hs_cells_find(s.c.cells, &none, NULL, NULL) == HS_OK);
    CHECK(hs_box_wrap(&s.box, &none, NULL, NULL, NULL) == HS_OK);
    const hs_among *empty = SYSTEMS(&none, 0, &zero, NULL, NULL);
    CHECK(hs_pairs_count(empty, &s.options, &counts, NULL) == HS_OK);
    CHECK(hs_neighbors_count(empty, &s.options, NULL, NULL) == HS_OK);
    CHECK(hs_pairs_find(empty, &s.options, &pairs, NULL) == HS_OK);
    CHECK(hs_pairs_length(pairs) == 0);
    hs_pairs_free(pairs);
    s.histogram.counts = NULL;
    s.histogram.sums = NULL;
    CHECK(call_histogram(&s.c, NULL) == HS_OK);
    call_free_objects(&s.c);
}

/* Cells and points at once, queries where each pair is found once, or nothing at all. */
static void
what_is_searched_cannot_contradict_itself(void)
{
    static call_scene s;
    hs_pairs         *pairs;
    hs_stream        *stream;
    hs_plan           plan;
    int64_t           n;
    call_fill_scene(&s);
    call_make_objects(&s.c, USES_CELLS);
    const hs_options *options = &s.options;
    const hs_among    bad[] = {{.points = NULL},
                               {.cells = s.c.cells, .points = SET(&s.points)},
                               {.cells = s.c.cells, .box = &s.box},
                               {.cells = s.c.cells, .each = &s.systems.each},
                               {.points = SET(&s.points), .each = &s.systems.each}};
    for (size_t b = 0; b <= sizeof bad / sizeof *bad; b++) {
        const hs_among *among = b < sizeof bad / sizeof *bad ? &bad[b] : NULL;
        CHECK(hs_pairs_find(among, options, &pairs, NULL) == HS_ERR_ARGUMENT && pairs == NULL);
        CHECK(hs_pairs_count(among, options, &n, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_neighbors_find(among, options, &pairs, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_neighbors_count(among, options, &n, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_pairs_histogram(among, options, &s.histogram, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_nearest_find(among, 1, options, &pairs, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_stream_open(among, options, 1, &stream, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_pairs_visit(among, options, &s.visit, &n, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_clusters_find(among, options, NULL, &n, NULL, &n, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_plan_make(among, options, &plan, NULL) == HS_ERR_ARGUMENT);
    }
    const hs_among *queried = QUERIED(&s.points, &s.points, &s.box);
    CHECK(hs_pairs_find(queried, options, &pairs, NULL) == HS_ERR_ARGUMENT && pairs == NULL);
    CHECK(hs_stream_open(queried, options, 1, &stream, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_pairs_visit(queried, options, &s.visit, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_clusters_find(queried, options, NULL, &n, NULL, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_clusters_find(AMONG(&s.points, NULL), options, NULL, NULL, NULL, &n, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_plan_make(queried, options, &plan, NULL) == HS_ERR_ARGUMENT);
    call_free_objects(&s.c);
}

static void
objects_that_are_null_hold_nothing(void)
{
    static call_scene s;
    hs_points         points;
    hs_layout         layout;
    memset(&points, POISON, sizeof points);
    memset(&layout, POISON, sizeof layout);
    hs_cells_points(NULL, &points);
    hs_cells_layout(NULL, &layout);
    hs_cells_indices(NULL, NULL);
    CHECK(points.n == 0 && points.data == NULL && points.ndim == 0);
    CHECK(layout.n_points == 0 && layout.n_cells == 0 && layout.order == NULL);
    CHECK(hs_cells_box(NULL) == NULL);
    CHECK(!hs_verlet_look(NULL).has_list && hs_verlet_look(NULL).n_points == 0);
    CHECK(hs_pairs_length(NULL) == 0 && hs_pairs_rows(NULL) == 0);
    CHECK(hs_pairs_offsets(NULL) == NULL && hs_pairs_take_offsets(NULL) == NULL);
    CHECK(hs_pairs_array(NULL, HS_WANT_I) == NULL && hs_pairs_take(NULL, HS_WANT_I) == NULL);
    hs_array_free(NULL);
    hs_pairs_free(NULL);
    hs_stream_free(NULL);
    hs_cells_free(NULL);
    hs_verlet_free(NULL);
    call_fill_scene(&s);
    call_make_objects(&s.c, USES_CELLS);
    hs_cells_points(s.c.cells, NULL);
    hs_cells_layout(s.c.cells, NULL);
    hs_cells_indices(s.c.cells, NULL);
    call_free_objects(&s.c);
}

static void
only_one_bit_names_an_array(void)
{
    static call_scene s;
    const unsigned    bad[] = {0, 3, 63, 64, 65, HS_WANT_I | 1u << 31, 1u << 31, UINT_MAX};
    hs_pairs         *pairs;
    call_fill_scene(&s);
    s.options.want = 63;
    CHECK(hs_pairs_find(AMONG(&s.points, &s.box), &s.options, &pairs, NULL) == HS_OK);
    for (int b = 0; b < 8; b++) {
        CHECK(hs_pairs_array(pairs, bad[b]) == NULL);
        CHECK(hs_pairs_take(pairs, bad[b]) == NULL);
    }
    for (unsigned bit = 1; bit < 64; bit *= 2) {
        const void *array = hs_pairs_array(pairs, bit);
        void       *taken = hs_pairs_take(pairs, bit);
        CHECK(array != NULL && taken != NULL);
        CHECK(hs_pairs_array(pairs, bit) == NULL && hs_pairs_take(pairs, bit) == NULL);
        hs_array_free(taken);
    }
    hs_pairs_free(pairs);
}

/* ---- a poll that says no once, and yes ever after, ends a search of any kind ---- */

enum { N = 40000, CROWD = 2500 };

/* 0: evenly. 1: one in four points in a second place far away, so that only occupied cells are
 * stored. 2: also a crowd that is more than one block of candidates. */
static void
place(int how, double *x)
{
    harness_random random = {808};
    for (int e = 0; e < 3 * N; e++)
        x[e] = random_unit(&random) + (how == 1 && e / 3 % 4 == 0 ? 1e7 : 0.0);
    for (int e = 0; how == 2 && e < 3 * CROWD; e++)
        x[e] *= 0.02;
}

static hs_status
search(int kind, int how, refusal *once)
{
    static double   x[3 * N];
    static int64_t  counts[N];
    const hs_points points = {x, N, 3, HS_FLOAT64, 24, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *found = NULL;
    hs_status       status;
    int64_t         n;
    place(how, x);
    options.cutoff = 0.02;
    options.want = HS_WANT_I | HS_WANT_J;
    options.poll = refuse_once;
    options.poll_context = once;
    switch (kind) {
    case 0: status = hs_pairs_find(AMONG(&points, NULL), &options, &found, NULL); break;
    case 1: status = hs_pairs_count(AMONG(&points, NULL), &options, &n, NULL); break;
    case 2: status = hs_neighbors_count(AMONG(&points, NULL), &options, counts, NULL); break;
    case 3: status = hs_pairs_count(QUERIED(&points, &points, NULL), &options, &n, NULL); break;
    case 4: status = hs_nearest_find(AMONG(&points, NULL), 5, &options, &found, NULL); break;
    default: status = hs_neighbors_find(AMONG(&points, NULL), &options, &found, NULL);
    }
    CHECK(found == NULL || status == HS_OK);
    hs_pairs_free(found);
    return status;
}

static void
one_refusal_ends_any_search(void)
{
    for (int trial = 0; trial < 18; trial++) {
        refusal once = {.nth = 0, .twice = trial / 3 == 5};
        CHECK(search(trial / 3, trial % 3, &once) == HS_OK);
        const int64_t polls = once.n, step = 1 + polls / (IS_SLOW ? 3 : 8);
        CHECK(polls > 0);
        for (int64_t nth = 1; nth <= polls; nth += step) {
            once = (refusal){.nth = nth, .twice = once.twice};
            CHECK(search(trial / 3, trial % 3, &once) == HS_ERR_INTERRUPTED);
            CHECK(once.n == nth);
        }
    }
}

void
test_arguments(void)
{
    RUN(each_array_that_is_wanted_must_be_there);
    RUN(nothing_at_all_is_refused);
    RUN(each_spoilt_argument_is_refused);
    RUN(numbers_that_are_only_large_are_fine);
    RUN(arrays_without_entries_may_be_missing);
    RUN(what_is_searched_cannot_contradict_itself);
    RUN(objects_that_are_null_hold_nothing);
    RUN(only_one_bit_names_an_array);
    RUN(one_refusal_ends_any_search);
}
