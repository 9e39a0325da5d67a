/* SPDX-License-Identifier: BSD-3-Clause */
/* test_record_shells.c: the shell of each pair, on edges and off them; a walk that is stopped while
 * it decides, and refused memory. */
#include "../support/among.h"
#include "../support/list_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"

void test_record_shells(void);

enum { SIDE = 9, N = SIDE * SIDE * SIDE };

static double        x[3 * N];
static const double  cutoffs[] = {0.0, 1.0, 1.0, 1.5, 2.0, 2.25, 3.0};
static hs_points     points;
static const hs_box *box;
static hs_options    options;

/* A cubic lattice: all distances are roots of integers, half of them edges. */
static void
make_lattice(void)
{
    static hs_box cube = {.ndim = 3, .periodic = {true, true, true}};
    for (int e = 0; e < N; e++) {
        x[3 * e] = e % SIDE;
        x[3 * e + 1] = e / SIDE % SIDE;
        x[3 * e + 2] = e / SIDE / SIDE;
    }
    for (int l = 0; l < 3; l++)
        cube.rows[l][l] = SIDE;
    points = (hs_points){x, N, 3, HS_FLOAT64, 24, 8};
    box = &cube;
    options = hs_options_default();
    options.cutoff = 3.0;
    options.n_shells = 7;
    options.shells = cutoffs;
}

static int32_t
shell_of(double square, bool inclusive)
{
    int32_t k = 0;
    while (k < 6 &&
           (inclusive ? square > cutoffs[k] * cutoffs[k] : square >= cutoffs[k] * cutoffs[k]))
        k++;
    return k;
}

/* With and without columns that are measured, so by each way that pairs are written. */
static void
pairs_are_in_the_innermost_shell(void)
{
    const unsigned beside[] = {0, HS_WANT_DISTANCE, HS_WANT_BOTH, HS_WANT_VECTOR | HS_WANT_SHIFT};
    make_lattice();
    for (int trial = 0; trial < 16; trial++) {
        hs_pairs *pairs, *measured;
        int64_t   wrong = 0;
        options.inclusive = trial & 1;
        options.sorted = trial & 2;
        options.want = HS_WANT_SHELL | beside[trial / 4];
        CHECK(hs_pairs_find(AMONG(&points, box), &options, &pairs, NULL) == HS_OK);
        options.want = HS_WANT_DISTANCE;
        CHECK(hs_pairs_find(AMONG(&points, box), &options, &measured, NULL) == HS_OK);
        const int32_t *shell = hs_pairs_array(pairs, HS_WANT_SHELL);
        const double  *distance = hs_pairs_array(measured, HS_WANT_DISTANCE);
        CHECK(hs_pairs_length(pairs) == hs_pairs_length(measured));
        for (int64_t e = 0; e < hs_pairs_length(pairs); e++) {
            const double square = nearbyint(distance[e] * distance[e]);
            wrong += shell[e] != shell_of(square, options.inclusive);
        }
        CHECK(wrong == 0 && hs_pairs_length(pairs) > 40 * N);
        hs_pairs_free(pairs);
        hs_pairs_free(measured);
    }
    options.inclusive = true;
    options.sorted = false;
}

/* No distance is near an edge: none is looked at again. */
static void
few_edges_decide_nothing(void)
{
    const double apart[] = {1.2, 2.5};
    hs_pairs    *pairs;
    hs_counters  counters;
    make_lattice();
    options.want = HS_WANT_SHELL;
    options.cutoff = 2.5;
    options.n_shells = 2;
    options.shells = apart;
    options.counters = &counters;
    CHECK(hs_pairs_find(AMONG(&points, box), &options, &pairs, NULL) == HS_OK);
    const int32_t *shell = hs_pairs_array(pairs, HS_WANT_SHELL);
    int64_t        inner = 0;
    for (int64_t e = 0; e < hs_pairs_length(pairs); e++)
        inner += shell[e] == 0;
    CHECK(inner == 3 * N && counters.ambiguous == 0);
    hs_pairs_free(pairs);
}

/* Into arrays of the caller's. */
static void
shells_go_where_the_caller_says(void)
{
    int32_t        shell[2] = {-1, -1};
    hs_pair_arrays out = {.capacity = 2, .index_bytes = 8, .shell = shell};
    hs_pairs      *pairs = NULL;
    make_lattice();
    points.n = 3;
    options.want = HS_WANT_SHELL;
    options.cutoff = 2.0;
    options.n_shells = 5;
    options.out = &out;
    CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &pairs, NULL) == HS_ERR_CAPACITY);
    points.n = 2;
    CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &pairs, NULL) == HS_OK);
    CHECK(hs_pairs_length(pairs) == 1 && shell[0] == 1);
    hs_pairs_free(pairs);
    out.shell = NULL;
    CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &pairs, NULL) == HS_ERR_ARGUMENT);
}

/* What cannot be is refused before anything is read. */
static void
bad_shells_are_refused(void)
{
    const double   descending[] = {2.0, 1.0}, negative[] = {-1.0, 1.0}, endless[] = {1.0, HUGE_VAL};
    const double  *bad[] = {descending, negative, endless};
    const int      row[] = {1, 0, 1};
    hs_pairs      *pairs;
    hs_stream     *stream;
    hs_failure     failure;
    const hs_reach reach = {.radii = x};
    make_lattice();
    options.want = HS_WANT_SHELL;
    hs_among of_reach = {.points = &points, .box = box, .reach = &reach};
    CHECK(hs_pairs_find(&of_reach, &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_neighbors_find(AMONG(&points, box), &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    for (int t = 0; t < 3; t++) {
        options.shells = bad[t];
        options.n_shells = 2;
        CHECK(hs_pairs_find(AMONG(&points, box), &options, &pairs, &failure) == HS_ERR_EDGES);
        CHECK(failure.row == row[t]);
    }
    options.shells = cutoffs;
    options.n_shells = 0;
    CHECK(hs_pairs_find(AMONG(&points, box), &options, &pairs, &failure) == HS_ERR_EDGES);
    options.n_shells = INT64_C(1) << 30;
    CHECK(hs_pairs_find(AMONG(&points, box), &options, &pairs, &failure) == HS_ERR_EDGES);
    options.n_shells = 6; /* up to 2.25, which is not the cutoff */
    CHECK(hs_pairs_find(AMONG(&points, box), &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_stream_open(AMONG(&points, box), &options, 9, &stream, NULL) == HS_ERR_ARGUMENT);
    options.n_shells = 7;
    options.precision = HS_DOUBLE;
    CHECK(hs_pairs_find(AMONG(&points, box), &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    options.precision = HS_EXACT;
    options.shells = NULL;
    CHECK(hs_pairs_find(AMONG(&points, box), &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    options.want = HS_WANT_I;
    CHECK(hs_pairs_find(AMONG(&points, box), &options, &pairs, NULL) == HS_OK);
    hs_pairs_free(pairs);
}

static hs_status
find_and_free(void *context)
{
    hs_pairs       *pairs;
    const hs_status status = hs_pairs_find(AMONG(&points, box), &options, &pairs, NULL);
    (void)context;
    hs_pairs_free(pairs);
    return status;
}

static void
refused_memory_leaves_nothing(void)
{
    make_lattice();
    for (int t = 0; t < 4; t++) {
        options.want = HS_WANT_SHELL | (t & 1 ? HS_WANT_DISTANCE : 0);
        options.sorted = t & 2;
        CHECK(fail_each_allocation(find_and_free, NULL, 400) > 0);
    }
}

/* Each poll in turn says no, also those of the batches that are decided. */
static void
a_search_that_is_stopped_leaves_nothing(void)
{
    hs_pairs *pairs;
    hs_status status = HS_ERR_INTERRUPTED;
    make_lattice();
    options.want = HS_WANT_SHELL;
    options.poll = stop_after;
    for (int64_t allowed = 0; status == HS_ERR_INTERRUPTED; allowed++) {
        int64_t left = allowed;
        options.poll_context = &left;
        status = hs_pairs_find(AMONG(&points, box), &options, &pairs, NULL);
        CHECK(status == HS_OK || (status == HS_ERR_INTERRUPTED && pairs == NULL));
    }
    CHECK(status == HS_OK);
    hs_pairs_free(pairs);
}

void
test_record_shells(void)
{
    RUN(pairs_are_in_the_innermost_shell);
    RUN(few_edges_decide_nothing);
    RUN(shells_go_where_the_caller_says);
    RUN(bad_shells_are_refused);
    RUN(refused_memory_leaves_nothing);
    RUN(a_search_that_is_stopped_leaves_nothing);
}
