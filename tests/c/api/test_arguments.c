/* SPDX-License-Identifier: BSD-3-Clause */
/* test_arguments.c: what would be read or written out of bounds is refused by every function that
 * could, before anything is read. */
#include "../support/harness.h"
#include "../support/among.h"

#include "../../../csrc/core/api/arguments.h"
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/base/want.h"

#include <limits.h>
#include <math.h>

void test_arguments(void);

static const double numbers[16] = {0.0, 0.0, 0.0, 0.5, 0.5, 0.5};

static hs_points
good_points(void)
{
    return (hs_points){.data = numbers,
                       .n = 2,
                       .ndim = 3,
                       .real = HS_FLOAT64,
                       .row_stride = 3 * sizeof(double),
                       .column_stride = sizeof(double)};
}

static int
ignore_pair(int64_t i, int64_t j, const int32_t *S, const double *D, double d2, void *user)
{
    (void)i, (void)j, (void)S, (void)D, (void)d2, (void)user;
    return 0;
}

/* Whether the functions that take points, queries, a box and options all say the same; that of the
 * queries is not looked at where there are none. */
static hs_status
status_of_all(const hs_points *points, const hs_points *queries, const hs_box *box,
              const hs_options *options)
{
    const double       edges[2] = {0.0, 1.0};
    int64_t            counts[4] = {0}, count = -7, visited;
    hs_pairs          *pairs = NULL;
    hs_stream         *stream = NULL;
    hs_cells          *cells = NULL;
    hs_plan            plan;
    const hs_histogram histogram = {.n_edges = 2, .edges = edges, .n_types = 1, .counts = counts};
    const hs_visit     visit = {.pair = ignore_pair};
    const hs_status    status =
        hs_neighbors_find(QUERIED(points, queries, box), options, &pairs, NULL);
    hs_pairs_free(pairs);
    CHECK(hs_neighbors_count(QUERIED(points, queries, box), options, counts, NULL) == status);
    CHECK(hs_pairs_histogram(QUERIED(points, queries, box), options, &histogram, NULL) == status);
    CHECK(hs_nearest_find(QUERIED(points, queries, box), 1, options, &pairs, NULL) == status);
    hs_pairs_free(pairs);
    CHECK(hs_nearest_find(QUERIED(points, queries, box), 0, options, &pairs, NULL) ==
          HS_ERR_ARGUMENT);
    if (queries != NULL) {
        CHECK(hs_pairs_count(QUERIED(points, queries, box), options, &count, NULL) == status);
        return status;
    }
    CHECK(hs_pairs_count(AMONG(points, box), options, &count, NULL) == status);
    CHECK((count == -7) == (status != HS_OK));
    CHECK(hs_pairs_find(AMONG(points, box), options, &pairs, NULL) == status);
    CHECK((pairs == NULL) == (status != HS_OK));
    hs_pairs_free(pairs);
    CHECK(hs_stream_open(AMONG(points, box), options, 1, &stream, NULL) == status);
    hs_stream_free(stream);
    CHECK(hs_pairs_visit(AMONG(points, box), options, &visit, &visited, NULL) == status);
    CHECK(hs_cells_build(points, box, options, &cells, NULL) == status);
    hs_cells_free(cells);
    CHECK(hs_plan_make(AMONG(points, box), options, &plan, NULL) == status);
    return status;
}

static hs_options
good_options(void)
{
    hs_options options = hs_options_default();
    options.cutoff = 1.0;
    return options;
}

static void
bad_points_and_queries_are_refused(void)
{
    const hs_options options = good_options();
    const hs_points  good = good_points();
    hs_points        bad[] = {good, good, good, good, good, good};
    bad[0].ndim = 0;
    bad[1].ndim = HS_MAX_DIM + 1;
    bad[2].ndim = -1;
    bad[3].n = -1;
    bad[4].data = NULL;
    bad[5].real = (hs_real)2;
    CHECK(status_of_all(&good, NULL, NULL, &options) == HS_OK);
    CHECK(status_of_all(&good, &good, NULL, &options) == HS_OK);
    for (int b = 0; b < 6; b++) {
        CHECK(status_of_all(&bad[b], NULL, NULL, &options) == HS_ERR_ARGUMENT);
        CHECK(status_of_all(&good, &bad[b], NULL, &options) == HS_ERR_ARGUMENT);
    }
    hs_points flat = good;
    flat.ndim = 2;
    CHECK(status_of_all(&good, &flat, NULL, &options) == HS_ERR_ARGUMENT);
    const hs_points none = {.n = 0, .ndim = 3, .real = HS_FLOAT32};
    CHECK(status_of_all(&none, NULL, NULL, &options) == HS_OK);
    CHECK(status_of_all(&good, &none, NULL, &options) == HS_OK);
}

static void
boxes_of_another_dimension_are_refused(void)
{
    const hs_options options = good_options();
    const hs_points  points = good_points();
    double           wrapped[6];
    for (int ndim = -1; ndim <= HS_MAX_DIM + 1; ndim++) {
        const hs_box    box = {.ndim = ndim};
        const hs_status expected = ndim == 3 ? HS_OK : HS_ERR_ARGUMENT;
        const bool      is_box = ndim >= 1 && ndim <= HS_MAX_DIM;
        CHECK(status_of_all(&points, NULL, &box, &options) == expected);
        CHECK(hs_box_wrap(&box, &points, wrapped, NULL, NULL) == expected);
        CHECK(hs_box_measure(&box, NULL, NULL, NULL) == (is_box ? HS_OK : HS_ERR_ARGUMENT));
    }
}

static void
bad_options_are_refused(void)
{
    const hs_points  points = good_points();
    hs_pairs        *pairs;
    int64_t          i[1];
    hs_pair_arrays   out = {.capacity = 1, .index_bytes = 8, .i = i};
    const hs_options good = good_options();
    hs_options       bad[] = {good, good, good, good, good, good, good, good};
    bad[0].index_bytes = 2;
    bad[1].want = 64;
    bad[2].out = &out; /* and j is missing */
    bad[3].precision = (hs_precision)3;
    bad[4].threads = INT_MIN;
    bad[5].cell_size = NAN;
    bad[6].cell_size = -1.0;
    bad[7].memory_limit = NAN;
    for (int b = 0; b < 8; b++) {
        CHECK(hs_pairs_find(AMONG(&points, NULL), &bad[b], &pairs, NULL) == HS_ERR_ARGUMENT);
        CHECK(pairs == NULL);
    }
    bad[2].want = HS_WANT_I;
    CHECK(hs_pairs_find(AMONG(&points, NULL), &bad[2], &pairs, NULL) == HS_OK);
    hs_pairs_free(pairs);
    out.index_bytes = 1;
    CHECK(hs_pairs_find(AMONG(&points, NULL), &bad[2], &pairs, NULL) == HS_ERR_ARGUMENT);
    out.index_bytes = 8;
    out.capacity = -1;
    CHECK(hs_pairs_find(AMONG(&points, NULL), &bad[2], &pairs, NULL) == HS_ERR_ARGUMENT);
}

/* What single functions have beside these. */
static void
other_arguments_are_refused(void)
{
    const hs_options options = good_options();
    const hs_points  points = good_points();
    const double     edges[1] = {1.0};
    int64_t          counts[1], visited = -1;
    hs_stream       *stream;
    const hs_visit   nothing = {.pair = NULL};
    hs_histogram     histogram = {.n_edges = 1, .edges = edges, .counts = counts};
    CHECK(hs_stream_open(AMONG(&points, NULL), &options, 0, &stream, NULL) == HS_ERR_ARGUMENT);
    CHECK(stream == NULL);
    CHECK(hs_pairs_visit(AMONG(&points, NULL), &options, &nothing, &visited, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(visited == 0);
    CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &histogram, NULL) == HS_ERR_ARGUMENT);
    const hs_systems systems = {.n = -1};
    CHECK(hs_systems_count(&points, &systems, &options, counts, NULL) == HS_ERR_ARGUMENT);
}

/* Cells have a dimension, and so have lists. */
static void
cells_and_lists_are_asked_the_right_way(void)
{
    const hs_options options = good_options();
    const hs_points  points = good_points();
    hs_points        flat = points;
    hs_options       wide = options;
    hs_cells        *cells;
    hs_pairs        *pairs;
    int64_t          cell[2];
    bool             rebuilt;
    flat.ndim = 2;
    wide.index_bytes = 16;
    CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_OK);
    CHECK(hs_neighbors_find(QUERIED_CELLS(cells, &flat), &options, &pairs, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_cells_candidates(cells, &flat, &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_cells_find(cells, &flat, cell, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_pairs_find(IN_CELLS(cells), &wide, &pairs, NULL) == HS_ERR_ARGUMENT);
    hs_cells_free(cells);
    hs_verlet *list = hs_verlet_new();
    flat.ndim = 9;
    CHECK(hs_verlet_update(list, &flat, NULL, &options, 0.1, false, &rebuilt, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_verlet_update(list, &points, NULL, &options, 0.1, false, &rebuilt, NULL) == HS_OK);
    CHECK(hs_verlet_find(list, &wide, &pairs, NULL) == HS_ERR_ARGUMENT);
    hs_verlet_free(list);
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
        hs_options     options = good_options();
        hs_pairs      *pairs = NULL;
        hs_pair_arrays out = {.capacity = 1,
                              .index_bytes = 8,
                              .i = i,
                              .j = j,
                              .both = both,
                              .distance = distance,
                              .vector = vector,
                              .shift = shift};
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
    const hs_options options = good_options();
    CHECK(hs_neighbors_count(AMONG(NULL, NULL), &options, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_systems_count(&points, NULL, &options, NULL, NULL) == HS_ERR_ARGUMENT);
}

/* Strides that lead to no entry may be any; others reach no further than addresses. */
static void
entries_are_within_the_addresses(void)
{
    static double   x[4];
    hs_failure      failure;
    const ptrdiff_t far = (ptrdiff_t)(0.985 * (double)PTRDIFF_MAX); /* 0.99 of it are allowed */
    for (int sign = -1; sign <= 1; sign += 2) {
        const struct {
            int64_t   n;
            int       ndim;
            ptrdiff_t rows, columns;
            bool      fits;
        } cases[] = {
            {1, 1, PTRDIFF_MAX, PTRDIFF_MAX, true},
            {2, 1, far, PTRDIFF_MAX, true},
            {1, 2, PTRDIFF_MAX, far, true},
            {2, 1, PTRDIFF_MAX, 8, false},
            {1, 2, 8, PTRDIFF_MAX, false},
            {3, 1, far / 2, 8, true},
            {3, 1, far, 8, false},
            {1, 3, 8, far / 2, true},
            {1, 3, 8, far, false},
            {2, 2, far / 2, far / 2, true},
            {2, 2, far, far / 50, false},
            {2, 2, far / 50, far, false},
            {0, 3, PTRDIFF_MAX, PTRDIFF_MAX, true},
        };
        for (int c = 0; c < 13; c++) {
            const hs_points points = {x,          cases[c].n,           cases[c].ndim,
                                      HS_FLOAT64, sign * cases[c].rows, cases[c].columns};
            CHECK(hs_check_points(&points, &failure) == (cases[c].fits ? HS_OK : HS_ERR_ARGUMENT));
        }
    }
}

/* As many as int32 counts, and no more: then they are read, up to the first that descends. */
static void
systems_are_as_many_as_can_be_counted(void)
{
    const int64_t first[2] = {0, -1};
    hs_systems    systems = {.n = INT32_MAX, .first = first};
    hs_failure    failure = HS_NO_FAILURE;
    CHECK(hs_check_systems(&systems, 3, &failure) == HS_ERR_ARGUMENT);
    CHECK(failure.system == 0 && failure.value == 0.0);
    systems.n++;
    failure = HS_NO_FAILURE;
    CHECK(hs_check_systems(&systems, 3, &failure) == HS_ERR_TOO_MANY);
    CHECK(failure.system == -1 && failure.value == 0x1p31);
}

void
test_arguments(void)
{
    RUN(systems_are_as_many_as_can_be_counted);
    RUN(each_array_that_is_wanted_must_be_there);
    RUN(nothing_at_all_is_refused);
    RUN(entries_are_within_the_addresses);
    bad_points_and_queries_are_refused();
    boxes_of_another_dimension_are_refused();
    bad_options_are_refused();
    other_arguments_are_refused();
    cells_and_lists_are_asked_the_right_way();
}
