/* SPDX-License-Identifier: BSD-3-Clause */
/* test_record.c: pairs are recorded in blocks, and measured as they are written. */
#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/collect/record.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/list_checks.h"
#include "../support/poll_checks.h"
#include "../support/search_unit.h"

#include <math.h>

void test_record(void);

/* ---- all pairs of an open search, recorded by one walk, and whether each is what it says ---- */

typedef struct record_unit {
    hs_recorder recorder;
    hs_output   output;
} record_unit;

/* Records; record_unit_free in any case. *failed_point: where a status is about one. */
static hs_status
record_all(search_unit *unit, unsigned columns, int index_bytes, int32_t *failed_point,
           record_unit *recorded)
{
    hs_search  *search = &unit->search;
    hs_account *account = &unit->call.account;
    hs_walker   walker;
    hs_output_init(account, unit->points.ndim, columns, index_bytes, &recorded->output);
    hs_status status = hs_walker_init(search, hs_record_use(columns), NULL, hs_record_hits,
                                      &recorded->recorder, &walker);
    CHECK(status == HS_OK);
    CHECK(hs_recorder_init(account, &recorded->output, walker.scanner.block.most_hits,
                           &recorded->recorder) == HS_OK);
    status = hs_walk(&walker, 0, (int32_t)search->bins.n, &(hs_failure){.row = -1});
    *failed_point = status == HS_ERR_SHIFT_RANGE ? (int32_t)walker.scanner.failed_point : -1;
    hs_walker_close(search, &walker);
    return status;
}

static void
record_unit_free(search_unit *unit, record_unit *recorded)
{
    hs_recorder_free(&unit->call.account, &recorded->recorder);
    hs_output_free(&recorded->output);
}

/* i or j of pair e. */
static int64_t
recorded_index(const record_unit *recorded, unsigned bit, int64_t e)
{
    const void *column = hs_output_column(&recorded->output, bit);
    return recorded->output.index_bytes == 8 ? ((const int64_t *)column)[e]
                                             : ((const int32_t *)column)[e];
}

/* ---- each hit becomes a pair once, with i and j in columns of any shape ---- */

enum { N = 300 };

static search_unit unit_record;
static record_unit recorded_record;

static int64_t
count_pairs(double cutoff)
{
    int64_t n = 0;
    for (int i = 0; i < N; i++) {
        for (int j = i + 1; j < N; j++)
            n += hypot(unit_record.x[2 * i] - unit_record.x[2 * j],
                       unit_record.x[2 * i + 1] - unit_record.x[2 * j + 1]) <= cutoff;
    }
    return n;
}

/* Each pair once, both being i and j side by side, whichever other columns there are: i < j, or all
 * that the asking point i meets, itself too. */
static void
check_shape(int shape, bool is_full)
{
    static uint8_t met[N][N];
    const unsigned columns = HS_WANT_I | HS_WANT_J | HS_WANT_BOTH |
                             (shape & 1 ? HS_WANT_DISTANCE : 0);
    const int index_bytes = shape & 2 ? 8 : 4;
    int32_t   failed;
    int64_t   wrong = 0;
    memset(met, 0, sizeof met);
    search_unit_open(NULL, 0.5, is_full, columns, &unit_record);
    CHECK(record_all(&unit_record, columns, index_bytes, &failed, &recorded_record) == HS_OK);
    CHECK(recorded_record.output.n_pairs ==
          (is_full ? 2 * count_pairs(0.5) + N : count_pairs(0.5)));
    const char *both = hs_output_column(&recorded_record.output, HS_WANT_BOTH);
    for (int64_t e = 0; e < recorded_record.output.n_pairs; e++) {
        const int64_t i = recorded_index(&recorded_record, HS_WANT_I, e);
        const int64_t j = recorded_index(&recorded_record, HS_WANT_J, e);
        int64_t       pair[2];
        memcpy(pair, both + e * 2 * index_bytes, 2 * (size_t)index_bytes);
        if (index_bytes == 4) {
            int32_t narrow[2];
            memcpy(narrow, pair, sizeof narrow);
            pair[0] = narrow[0];
            pair[1] = narrow[1];
        }
        wrong += i < 0 || i >= N || j < 0 || j >= N || (!is_full && i >= j);
        wrong += pair[0] != i || pair[1] != j || met[i][j]++;
    }
    CHECK(wrong == 0);
    record_unit_free(&unit_record, &recorded_record);
    search_unit_close(&unit_record);
}

static void
pairs_come_once_in_every_shape(void)
{
    search_unit_points(111, N, 2, 4.0, &unit_record);
    for (int shape = 0; shape < 8; shape++)
        check_shape(shape, shape & 4);
}

/* Numbers so far apart that no scale holds all of their digits, without a box. */
static void
indices_need_no_scale(void)
{
    const double    x[6] = {0.0, 0.0, 0x1p-1074, 0.0, 0x1p1000, 0.0};
    const hs_points points = {x, 3, 2, HS_FLOAT64, 16, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *pairs;
    options.cutoff = 0x1p900;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
    CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &pairs, NULL) == HS_OK);
    CHECK(hs_pairs_length(pairs) == 1);
    CHECK(((const int64_t *)hs_pairs_array(pairs, HS_WANT_I))[0] == 0 &&
          ((const int64_t *)hs_pairs_array(pairs, HS_WANT_J))[0] == 1);
    hs_pairs_free(pairs);
}

/* Rows of distances alone, in more dimensions than are written at once. */
static void
distances_need_no_indices(void)
{
    search_unit_points(112, N, 4, 2.0, &unit_record);
    const hs_points points = {unit_record.x, N, 4, HS_FLOAT64, 32, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *all, *alone;
    options.cutoff = 1.0;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    CHECK(hs_neighbors_find(AMONG(&points, NULL), &options, &all, NULL) == HS_OK);
    options.want = HS_WANT_DISTANCE;
    CHECK(hs_neighbors_find(AMONG(&points, NULL), &options, &alone, NULL) == HS_OK);
    const int64_t n = hs_pairs_length(all);
    CHECK(n > N && hs_pairs_length(alone) == n && hs_pairs_array(alone, HS_WANT_J) == NULL);
    CHECK(memcmp(hs_pairs_array(all, HS_WANT_DISTANCE), hs_pairs_array(alone, HS_WANT_DISTANCE),
                 (size_t)n * sizeof(double)) == 0);
    hs_pairs_free(all);
    hs_pairs_free(alone);
}

/* ---- what is written at once is what is recorded in batches ---- */

enum {
    N_WRITE = 200,
    ALL = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT
};
static record_unit at_once;

static int n_visits;

/* Records a visit whose block is so large that the caller is asked while it is laid out, and says
 * no. */
static hs_status
record_unwanted(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_recorder     *recorder = context;
    const hs_options polls = scanner->options;
    refusal          once = {.nth = 1};
    CHECK(scanner->block.n > HS_POLL_CANDIDATES);
    scanner->options.poll = refuse_once;
    scanner->options.poll_context = &once;
    scanner->block.has_candidates = false; /* as if float32 had told all pairs */
    const hs_status status = hs_record_hits(recorder, scanner, first, hits);
    scanner->options = polls;
    CHECK(status == HS_ERR_INTERRUPTED && once.n == 1 && recorder->output->n_pairs == 0);
    n_visits++;
    return HS_ERR_INTERRUPTED;
}

/* Whole neighbourhoods of many images. */
static void
large_blocks_can_be_stopped(void)
{
    const hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    hs_neighbourhood most;
    hs_walker        walker;
    n_visits = 0;
    search_unit_points(41, N_WRITE, 2, 1.0, &unit_record);
    search_unit_open(&box, 22.0, true, HS_WANT_DISTANCE, &unit_record);
    CHECK(hs_walker_init(&unit_record.search, HS_BLOCK_SIZES, NULL, NULL, NULL, &walker) == HS_OK);
    CHECK(hs_walk(&walker, 0, N_WRITE, &(hs_failure){.row = -1}) == HS_OK);
    most = walker.scanner.most;
    hs_walker_close(&unit_record.search, &walker);
    CHECK(most.candidates > HS_POLL_CANDIDATES);
    hs_output_init(&unit_record.call.account, 2, HS_WANT_DISTANCE, 8, &at_once.output);
    CHECK(hs_walker_init(&unit_record.search, HS_BLOCK_LISTS_PLACES, &most, record_unwanted,
                         &at_once.recorder, &walker) == HS_OK);
    CHECK(hs_recorder_init(&unit_record.call.account, &at_once.output,
                           walker.scanner.block.most_hits, &at_once.recorder) == HS_OK);
    CHECK(hs_walk(&walker, 0, N_WRITE, &(hs_failure){.row = -1}) == HS_ERR_INTERRUPTED &&
          n_visits == 1);
    hs_walker_close(&unit_record.search, &walker);
    record_unit_free(&unit_record, &at_once);
    search_unit_close(&unit_record);
}

/* ---- the shell of each pair, on edges and off them ---- */

enum { SIDE = 9, N_SHELLS = SIDE * SIDE * SIDE };

static double        x[3 * N_SHELLS];
static const double  cutoffs[] = {0.0, 1.0, 1.0, 1.5, 2.0, 2.25, 3.0};
static hs_points     points;
static const hs_box *box_shells;
static hs_options    options;

/* A cubic lattice: all distances are roots of integers, half of them edges. */
static void
make_lattice(void)
{
    static hs_box cube = {.ndim = 3, .periodic = {true, true, true}};
    for (int e = 0; e < N_SHELLS; e++) {
        x[3 * e] = e % SIDE;
        x[3 * e + 1] = e / SIDE % SIDE;
        x[3 * e + 2] = e / SIDE / SIDE;
    }
    for (int l = 0; l < 3; l++)
        cube.rows[l][l] = SIDE;
    points = (hs_points){x, N_SHELLS, 3, HS_FLOAT64, 24, 8};
    box_shells = &cube;
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
        CHECK(hs_pairs_find(AMONG(&points, box_shells), &options, &pairs, NULL) == HS_OK);
        options.want = HS_WANT_DISTANCE;
        CHECK(hs_pairs_find(AMONG(&points, box_shells), &options, &measured, NULL) == HS_OK);
        const int32_t *shell = hs_pairs_array(pairs, HS_WANT_SHELL);
        const double  *distance = hs_pairs_array(measured, HS_WANT_DISTANCE);
        CHECK(hs_pairs_length(pairs) == hs_pairs_length(measured));
        for (int64_t e = 0; e < hs_pairs_length(pairs); e++) {
            const double square = nearbyint(distance[e] * distance[e]);
            wrong += shell[e] != shell_of(square, options.inclusive);
        }
        CHECK(wrong == 0 && hs_pairs_length(pairs) > 40 * N_SHELLS);
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
    CHECK(hs_pairs_find(AMONG(&points, box_shells), &options, &pairs, NULL) == HS_OK);
    const int32_t *shell = hs_pairs_array(pairs, HS_WANT_SHELL);
    int64_t        inner = 0;
    for (int64_t e = 0; e < hs_pairs_length(pairs); e++)
        inner += shell[e] == 0;
    CHECK(inner == 3 * N_SHELLS && counters.ambiguous == 0);
    hs_pairs_free(pairs);
}

/* All pairs are: more of a group than are decided together. */
static void
every_pair_is_at_an_edge(void)
{
    const double at[] = {0.0, 1.0};
    make_lattice();
    points.n = 300;
    for (int64_t e = 0; e < points.n; e++) {
        x[3 * e] = (double)(e % 2);
        x[3 * e + 1] = x[3 * e + 2] = 0.0;
    }
    options.want = HS_WANT_SHELL | HS_WANT_BOTH;
    options.cutoff = 1.0;
    options.n_shells = 2;
    options.shells = at;
    hs_pairs *pairs;
    CHECK(hs_pairs_find(AMONG(&points, NULL), &options, &pairs, NULL) == HS_OK);
    const int32_t *shell = hs_pairs_array(pairs, HS_WANT_SHELL);
    const int64_t *both = hs_pairs_array(pairs, HS_WANT_BOTH);
    int64_t        wrong = 0;
    for (int64_t e = 0; e < hs_pairs_length(pairs); e++)
        wrong += shell[e] != (both[2 * e] + both[2 * e + 1]) % 2;
    CHECK(hs_pairs_length(pairs) == 300 * 299 / 2 && wrong == 0);
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
    const hs_reach reach = {.rule = HS_RULE_SUM};
    make_lattice();
    options.want = HS_WANT_SHELL;
    hs_among of_reach = {.points = SET(&points, .radii = x), .box = box_shells, .reach = &reach};
    CHECK(hs_pairs_find(&of_reach, &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_neighbors_find(&of_reach, &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    for (int t = 0; t < 3; t++) {
        options.shells = bad[t];
        options.n_shells = 2;
        CHECK(hs_pairs_find(AMONG(&points, box_shells), &options, &pairs, &failure) ==
              HS_ERR_EDGES);
        CHECK(failure.row == row[t]);
    }
    options.shells = cutoffs;
    options.n_shells = 0;
    CHECK(hs_pairs_find(AMONG(&points, box_shells), &options, &pairs, &failure) == HS_ERR_EDGES);
    options.n_shells = INT64_C(1) << 30;
    CHECK(hs_pairs_find(AMONG(&points, box_shells), &options, &pairs, &failure) == HS_ERR_EDGES);
    options.n_shells = 6; /* up to 2.25, which is not the cutoff */
    CHECK(hs_pairs_find(AMONG(&points, box_shells), &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_stream_open(AMONG(&points, box_shells), &options, 9, &stream, NULL) ==
          HS_ERR_ARGUMENT);
    options.n_shells = 7;
    options.precision = HS_DOUBLE;
    CHECK(hs_pairs_find(AMONG(&points, box_shells), &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    options.precision = HS_EXACT;
    options.shells = NULL;
    CHECK(hs_pairs_find(AMONG(&points, box_shells), &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    options.want = HS_WANT_I;
    CHECK(hs_pairs_find(AMONG(&points, box_shells), &options, &pairs, NULL) == HS_OK);
    hs_pairs_free(pairs);
}

static hs_status
find_and_free(void *context)
{
    hs_pairs       *pairs;
    const hs_status status = hs_pairs_find(AMONG(&points, box_shells), &options, &pairs, NULL);
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

/*
 * ---- measures ----
 *
 * Each pair of a batch is measured with the bits of hs_metric_measure, by every kernel, whatever
 * its shift.
 */

static hs_measured pairs_measures;

/* Pairs in 3-D; shift_of[r] is the largest shift along row r, of either sign. */
static void
make_pairs(int32_t n, const double *shift_of, harness_random *random)
{
    memset(&pairs_measures, 0, sizeof pairs_measures);
    pairs_measures.n = n;
    for (int32_t e = 0; e < n; e++) {
        for (int k = 0; k < 3; k++) {
            pairs_measures.p[k][e] = random_unit(random) - 0.5;
            pairs_measures.q[k][e] = random_unit(random) - 0.5;
        }
        for (int r = 0; r < 3; r++) {
            const double shift = shift_of[r] * (2.0 * random_unit(random) - 1.0);
            hs_measured_shift(&pairs_measures, e, r, (int64_t)nearbyint(shift));
        }
    }
}

static bool
is_measured_as_one(const hs_metric *metric, int32_t e, bool vectors)
{
    double  p[3], q[3], vector[3];
    int64_t shift[3];
    for (int k = 0; k < 3; k++) {
        p[k] = pairs_measures.p[k][e];
        q[k] = pairs_measures.q[k][e];
        shift[k] = pairs_measures.shift[k][e];
    }
    bool same = pairs_measures.distance[e] == hs_metric_measure(metric, p, q, shift, vector);
    for (int k = 0; vectors && k < 3; k++)
        same = same && pairs_measures.vector[k][e] == vector[k];
    return same;
}

static void
batches_have_the_bits_of_single_pairs(void)
{
    static const double rows[3][HS_MAX_DIM] = {{1.0}, {0.3, 1.1}, {-0.4, 0.2, 0.9}};
    static const double shifts[][3] = {
        {0.0, 0.0, 0.0}, {1.0, 0.0, 2.0}, {3.0, 1e6, 5.0}, {0x1p52, 1.0, 1.0}, {1.0, 0x1p60, 0.0}};
    const char    *names[8];
    const int      n_kernels = hs_kernel_names(names, 8);
    harness_random random = {7};
    hs_metric      metric;
    hs_metric_init(&metric, 3, 3, rows, 1.0, true);
    for (int s = 0; s < 5; s++) {
        for (int32_t n = 0; n <= HS_BATCH; n += n < 18 ? 1 : 55) {
            make_pairs(n, shifts[s], &random);
            CHECK(pairs_measures.is_wide == (s == 4 && n > 0));
            for (int kernel = 0; kernel < 2 * n_kernels; kernel++) {
                const bool vectors = kernel % 2 == 1;
                int        wrong = 0;
                hs_measured_find(hs_kernel_select(names[kernel / 2]), &metric, vectors,
                                 &pairs_measures);
                for (int32_t e = 0; e < n; e++)
                    wrong += !is_measured_as_one(&metric, e, vectors);
                CHECK(wrong == 0);
            }
        }
    }
}

void
test_record(void)
{
    RUN(pairs_come_once_in_every_shape);
    RUN(distances_need_no_indices);
    RUN(indices_need_no_scale);
    RUN(large_blocks_can_be_stopped);
    RUN(pairs_are_in_the_innermost_shell);
    RUN(few_edges_decide_nothing);
    RUN(every_pair_is_at_an_edge);
    RUN(shells_go_where_the_caller_says);
    RUN(bad_shells_are_refused);
    RUN(refused_memory_leaves_nothing);
    RUN(batches_have_the_bits_of_single_pairs);
}
