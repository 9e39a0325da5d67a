/* SPDX-License-Identifier: BSD-3-Clause */
/* test_tally.c: counts and sums of scenes whose histogram is known: points on a line whose
 * distances are all different, and on a lattice, where every pair is at an edge. */
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/histogram/tally.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/among.h"

#include <math.h>

void test_tally(void);

enum { POINTS = 10, PAIRS = POINTS * (POINTS - 1) / 2, TYPES = 3 };

/* Point i is at 2^i: a pair for each distance. */
typedef struct line {
    double       x[POINTS], weights[POINTS], edges[PAIRS];
    int32_t      types[POINTS];
    int          pair_of[PAIRS]; /* POINTS * i + j */
    int64_t      counts[TYPES * TYPES * PAIRS];
    double       sums[TYPES * TYPES * PAIRS];
    hs_histogram wanted;
} line;

/* Weights of up to `bits` bits more or less than 1. */
static void
make_line(harness_random *random, int bits, line *made)
{
    int n = 0;
    for (int i = 0; i < POINTS; i++) {
        const int exponent = bits > 0 ? (int)(random_bits(random) % (unsigned)(2 * bits)) - bits
                                      : 0;
        made->x[i] = ldexp(1.0, i);
        made->types[i] = (int32_t)(random_bits(random) % TYPES);
        made->weights[i] = ldexp(random_unit(random) - 0.5, exponent);
    }
    for (int j = 1; j < POINTS; j++) { /* ascending: 2^j - 2^i */
        for (int i = j - 1; i >= 0; i--) {
            made->edges[n] = made->x[j] - made->x[i];
            made->pair_of[n++] = POINTS * i + j;
        }
    }
    made->wanted = (hs_histogram){.n_edges = PAIRS,
                                  .edges = made->edges,
                                  .inclusive = true,
                                  .last_inclusive = true,
                                  .n_types = 1,
                                  .counts = made->counts,
                                  .sums = made->sums};
}

/* The first `split` points ask the others; 0: one set. */
static hs_status
find_line(line *made, int split, hs_failure *failure)
{
    const hs_options options = hs_options_default();
    const hs_points  queries = {made->x, split, 1, HS_FLOAT64, 8, 8};
    const hs_points  points = {made->x + split, POINTS - split, 1, HS_FLOAT64, 8, 8};
    const int32_t   *types = made->wanted.of_points.types;
    const double    *weights = made->wanted.of_points.weights;
    made->wanted.of_queries = made->wanted.of_points;
    if (types != NULL) {
        made->wanted.of_points.types += split;
    }
    if (weights != NULL) {
        made->wanted.of_points.weights += split;
    }
    const hs_status status = hs_pairs_histogram(QUERIED(&points, split > 0 ? &queries : NULL, NULL),
                                                &options, &made->wanted, failure);
    made->wanted.of_points = (hs_marks){types, weights};
    return status;
}

/* Each pair is in the bin of its distance, between its types, with the product of its weights. */
static bool
line_is_right(const line *made, int split)
{
    const int n_types = made->wanted.n_types;
    bool      right = true;
    for (int a = 0; a < n_types; a++) {
        for (int b = 0; b < n_types; b++) {
            for (int k = 0; k < PAIRS; k++) {
                const int    i = made->pair_of[k] / POINTS, j = made->pair_of[k] % POINTS;
                const int    at = (a * n_types + b) * PAIRS + k;
                const int    s = n_types > 1 ? made->types[i] : 0;
                const int    t = n_types > 1 ? made->types[j] : 0;
                const bool   meant = (s == a && t == b) || (split == 0 && s == b && t == a);
                const bool   asked = split == 0 || (i < split && j >= split);
                const bool   weighted = made->wanted.of_points.weights != NULL;
                const double product = weighted ? made->weights[i] * made->weights[j] : 1.0;
                right = right &&
                        (made->wanted.counts == NULL || made->counts[at] == (meant && asked));
                right = right && (made->wanted.sums == NULL ||
                                  made->sums[at] == (meant && asked ? product : 0.0));
            }
        }
    }
    return right;
}

/* With and without types, weights, sums and counts; weights of one size and of sizes so far apart
 * that no integer holds both. */
static void
each_pair_is_in_its_bin(void)
{
    static const int spreads[] = {0, 4, 200, 480};
    static line      made;
    harness_random   random = {1597};
    for (int trial = 0; trial < 256; trial++) {
        hs_histogram *wanted = &made.wanted;
        const int     split = trial & 16 ? 1 + trial % (POINTS - 1) : 0;
        make_line(&random, spreads[trial / 64], &made);
        wanted->n_types = trial & 1 ? TYPES : 1;
        wanted->of_points.types = trial & 1 ? made.types : NULL;
        wanted->of_points.weights = trial & 2 ? made.weights : NULL;
        wanted->counts = trial & 4 ? NULL : made.counts;
        wanted->sums = trial & 8 ? NULL : made.sums;
        CHECK(find_line(&made, split, NULL) == HS_OK);
        CHECK(line_is_right(&made, split));
    }
}

/* Where only those that ask, or only those that are asked, have weights far apart. */
static void
either_side_may_have_the_odd_weights(void)
{
    double     x[2] = {0.0, 1.0}, far[2] = {0x1p400, 0x1p-400}, plain[2] = {3.0, 5.0};
    double     edge = 0.5, sum;
    hs_options options = hs_options_default();
    hs_points  points = {x, 2, 1, HS_FLOAT64, 8, 8};
    for (int side = 0; side < 2; side++) {
        hs_histogram wanted = {.n_edges = 1,
                               .edges = &edge,
                               .n_types = 1,
                               .of_points.weights = side ? far : plain,
                               .of_queries.weights = side ? plain : far,
                               .sums = &sum};
        CHECK(hs_pairs_histogram(QUERIED(&points, &points, NULL), &options, &wanted, NULL) ==
              HS_OK);
        CHECK(sum == 0x1.8p401); /* and five times 2^-400, which rounding takes */
    }
}

static void
types_out_of_range_are_named(void)
{
    static const int32_t bad[] = {-1, TYPES, INT32_MIN, INT32_MAX};
    static line          made;
    harness_random       random = {2};
    hs_failure           failure;
    for (int b = 0; b < 4; b++) {
        make_line(&random, 0, &made);
        made.wanted.n_types = TYPES;
        made.wanted.of_points.types = made.types;
        made.types[3] = bad[b];
        CHECK(find_line(&made, 0, &failure) == HS_ERR_TYPES);
        CHECK(failure.row == 3 && failure.value == (double)bad[b] && !failure.in_queries);
        CHECK(find_line(&made, 5, &failure) == HS_ERR_TYPES);
        CHECK(failure.row == 3 && failure.in_queries);
        made.wanted.of_points.types = NULL;
        CHECK(find_line(&made, 5, &failure) == HS_ERR_TYPES);
    }
    hs_options options = hs_options_default();
    hs_points  points = {made.x, POINTS, 1, HS_FLOAT64, 8, 8};
    make_line(&random, 0, &made);
    made.wanted.n_types = TYPES;
    made.wanted.of_points.types = made.types; /* and none for the queries */
    CHECK(hs_pairs_histogram(QUERIED(&points, &points, NULL), &options, &made.wanted, &failure) ==
          HS_ERR_TYPES);
    made.wanted.n_types = 1 << 16; /* more pairs of them than int32 numbers */
    made.wanted.of_queries.types = made.types;
    CHECK(hs_pairs_histogram(QUERIED(&points, &points, NULL), &options, &made.wanted, &failure) ==
          HS_ERR_MEMORY);
    made.wanted.n_edges = INT64_C(1) << 30; /* more than slots can number */
    CHECK(find_line(&made, 0, &failure) == HS_ERR_EDGES);
}

/* All distances of a lattice are edges: no pair is sure, and more wait than are decided
 * together. */
static void
lattice_pairs_are_all_at_an_edge(void)
{
    enum { N = 100, EDGES = 700 };
    static double   x[N], edges[EDGES];
    static int64_t  counts[EDGES];
    hs_options      options = hs_options_default();
    hs_counters     counters;
    const hs_points points = {x, N, 1, HS_FLOAT64, 8, 8};
    options.counters = &counters;
    for (int i = 0; i < N; i++) {
        x[i] = i;
    }
    for (int few = 0; few < 2; few++) { /* N edges have copies, 700 have not */
        const int n_edges = few ? N : EDGES;
        for (int k = 0; k < n_edges; k++) {
            edges[k] = few ? k : k / 7 + 1e-9 * (k % 7);
        }
        for (int inclusive = 0; inclusive < 2; inclusive++) {
            hs_histogram wanted = {.n_edges = n_edges,
                                   .edges = edges,
                                   .inclusive = inclusive,
                                   .last_inclusive = inclusive,
                                   .n_types = 1,
                                   .counts = counts};
            options.threads = 1 + inclusive;
            CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &wanted, NULL) == HS_OK);
            CHECK(counters.ambiguous > 4000);
            for (int k = 0; k < n_edges; k++) { /* N - t pairs at distance t */
                const int     t = few ? k : k / 7, at = few ? 0 : k % 7;
                const int64_t here = at == !inclusive && !few ? N - t : 0;
                const int64_t expected = few ? (k - !inclusive > 0 ? N - k + !inclusive : 0)
                                             : (t > 0 ? here : 0);
                CHECK(counts[k] == expected);
            }
        }
    }
}

/* Two spots, an edge's distance apart: more pairs of a visit are open than are decided together. */
static void
pairs_of_two_spots_are_all_at_the_edge(void)
{
    enum { HERE = 100, THERE = 1100, N = HERE + THERE };
    static double   x[N];
    const double    edges[2] = {0.5, 1.0};
    int64_t         counts[2];
    hs_options      options = hs_options_default();
    const hs_points points = {x, N, 1, HS_FLOAT64, 8, 8};
    const int64_t   close = HERE * (HERE - 1) / 2 + THERE * (THERE - 1) / 2;
    for (int i = 0; i < N; i++) {
        x[i] = i < HERE ? 0.0 : 1.0;
    }
    for (int inclusive = 0; inclusive < 2; inclusive++) {
        const hs_histogram wanted = {.n_edges = 2,
                                     .edges = edges,
                                     .inclusive = inclusive,
                                     .last_inclusive = inclusive,
                                     .n_types = 1,
                                     .counts = counts};
        CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &wanted, NULL) == HS_OK);
        CHECK(counts[0] == close && counts[1] == (inclusive ? HERE * THERE : 0));
    }
}

/* Points on one spot: their extent is nothing. */
static void
points_on_one_spot_are_in_the_first_bin(void)
{
    enum { N = 50 };
    double       x[2 * N], edges[3] = {0.0, 0.25, 1.0};
    int64_t      counts[3];
    hs_options   options = hs_options_default();
    hs_points    points = {x, N, 2, HS_FLOAT64, 16, 8};
    hs_histogram wanted = {.n_edges = 3, .edges = edges, .n_types = 1, .counts = counts};
    for (int e = 0; e < 2 * N; e++) {
        x[e] = 0.7;
    }
    CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &wanted, NULL) == HS_OK);
    CHECK(counts[0] == 0 && counts[1] == N * (N - 1) / 2 && counts[2] == 0);
    wanted.inclusive = true;
    CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &wanted, NULL) == HS_OK);
    CHECK(counts[0] == N * (N - 1) / 2 && counts[1] == 0 && counts[2] == 0);
    hs_tally none = {.plan = NULL};
    hs_tally_free(&none);
}

void
test_tally(void)
{
    RUN(each_pair_is_in_its_bin);
    RUN(either_side_may_have_the_odd_weights);
    RUN(types_out_of_range_are_named);
    RUN(lattice_pairs_are_all_at_an_edge);
    RUN(pairs_of_two_spots_are_all_at_the_edge);
    RUN(points_on_one_spot_are_in_the_first_bin);
}
