/* SPDX-License-Identifier: BSD-3-Clause */
/* test_histogram.c: pairs are counted in the right bin, with their weights. */
#include "../../../csrc/core/memory/memory.h"
#include "../support/among.h"
#include "../support/bigint.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"

#include <float.h>
#include <math.h>

void test_histogram(void);

/*
 * ---- tally ----
 *
 * Counts and sums of scenes whose histogram is known: points on a line whose distances are all
 * different, and on a lattice, where every pair is at an edge.
 */

enum { POINTS = 10, PAIRS = POINTS * (POINTS - 1) / 2, TYPES = 3 };

/* Point i is at 2^i: a pair for each distance. */
typedef struct line {
    double       x[POINTS], weights[POINTS], edges[PAIRS];
    int32_t      types[POINTS];
    int          pair_of[PAIRS]; /* POINTS * i + j */
    int64_t      counts[TYPES * TYPES * PAIRS];
    double       sums[TYPES * TYPES * PAIRS];
    hs_set       known; /* types and weights of all points */
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
    const int32_t   *types = made->known.types;
    const double    *weights = made->known.weights;
    const hs_among   among = {
          .points = SET(&points, .types = types != NULL ? types + split : NULL,
                        .weights = weights != NULL ? weights + split : NULL),
          .queries = SET(split > 0 ? &queries : NULL, .types = types, .weights = weights)};
    return hs_pairs_histogram(&among, &options, &made->wanted, failure);
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
                const bool   weighted = made->known.weights != NULL;
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
        made.known.types = trial & 1 ? made.types : NULL;
        made.known.weights = trial & 2 ? made.weights : NULL;
        wanted->counts = trial & 4 ? NULL : made.counts;
        wanted->sums = trial & 8 ? NULL : made.sums;
        CHECK(find_line(&made, split, NULL) == HS_OK);
        CHECK(line_is_right(&made, split));
    }
}

/* Weights of sizes so far apart take two arrays. */
static void
memory_for_weights_may_be_refused(void)
{
    static line    made;
    harness_random random = {1600};
    hs_status      status = HS_ERR_MEMORY;
    make_line(&random, 480, &made);
    made.known.weights = made.weights;
    for (int refused = 1; status != HS_OK; refused++) {
        hs_test_fail_allocation(refused);
        status = find_line(&made, 0, NULL);
        CHECK(status == HS_ERR_MEMORY || (status == HS_OK && refused > 5));
        hs_test_fail_allocation(0);
    }
    CHECK(line_is_right(&made, 0));
}

/* Weights where nothing is summed, and types where there is one. */
static void
what_is_not_needed_is_not_looked_at(void)
{
    static line    made;
    harness_random random = {1598};
    hs_failure     failure;
    make_line(&random, 4, &made);
    made.known = (hs_set){.types = made.types, .weights = made.weights};
    made.types[1] = -1;
    made.weights[2] = NAN;
    CHECK(find_line(&made, 0, &failure) == HS_ERR_WEIGHTS && failure.row == 2);
    CHECK(isnan(failure.value));
    made.wanted.sums = NULL;
    CHECK(find_line(&made, 0, NULL) == HS_OK && line_is_right(&made, 0));
    made.wanted.n_types = TYPES;
    CHECK(find_line(&made, 0, &failure) == HS_ERR_TYPES);
    CHECK(failure.row == 1 && failure.value == -1.0);
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
        hs_histogram   wanted = {.n_edges = 1, .edges = &edge, .n_types = 1, .sums = &sum};
        const hs_among among = {.points = SET(&points, .weights = side ? far : plain),
                                .queries = SET(&points, .weights = side ? plain : far)};
        CHECK(hs_pairs_histogram(&among, &options, &wanted, NULL) == HS_OK);
        CHECK(sum == 0x1.8p401); /* and five times 2^-400, which rounding takes */
    }
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
    for (int few = 0; few < 2; few++) {
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

/* ---- bins of any edges are those of exact distances ---- */

enum { MOST_EDGES = 3000, CLOUD = 60 };

/* Whether the pair is not below edge k. */
static bool
reaches(const hs_histogram *wanted, int64_t k, const double *p, const double *q)
{
    const double edge = wanted->edges[k];
    long double  square = 0.0L;
    for (int axis = 0; axis < 3; axis++) {
        const long double along = (long double)p[axis] - (long double)q[axis];
        square += along * along;
    }
    const long double limit = (long double)edge * (long double)edge;
    if (fabsl(square - limit) > 1e-12L * limit) { /* far from it, by many roundings */
        return square > limit;
    }
    const int order = big_compare(big_square(3, 0, NULL, p, q, NULL),
                                  big_product(big_from_double(edge), big_from_double(edge)));
    return order > 0 ||
           (order == 0 && !(k == wanted->n_edges - 1 ? wanted->last_inclusive : wanted->inclusive));
}

static void
check_bins(const double (*x)[3], const hs_histogram *wanted)
{
    static int64_t     meant[MOST_EDGES + 1];
    const hs_options   options = hs_options_default();
    const hs_points    points = points_in_rows(x[0], CLOUD, 3);
    const hs_histogram found = *wanted;
    memset(meant, 0, sizeof meant);
    for (int i = 0; i < CLOUD; i++) {
        for (int j = 0; j < i; j++) {
            int64_t low = 0, high = wanted->n_edges;
            while (low < high) {
                const int64_t middle = low + (high - low) / 2;
                const bool    reached = reaches(wanted, middle, x[i], x[j]);
                low = reached ? middle + 1 : low;
                high = reached ? high : middle;
            }
            meant[low]++;
        }
    }
    CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &found, NULL) == HS_OK);
    CHECK(memcmp(meant, found.counts, (size_t)found.n_edges * sizeof *meant) == 0);
}

/* Few and many edges, close together and far apart, some twice and some at zero; of lengths whose
 * squares float64 has, and has not. */
static void
bins_are_those_of_exact_distances(void)
{
    static const int    counts[] = {1, 2, 7, 64, 500, MOST_EDGES};
    static const double sizes[] = {1.0, 1e-300, 1e18, 1e250, 1e-30};
    static double       edges[MOST_EDGES];
    static int64_t      counted[MOST_EDGES];
    harness_random      random = {8128};
    for (int trial = 0; trial < TRIALS(240); trial++) {
        const int    n = counts[trial % 6], kind = trial / 6 % 4;
        const double size = sizes[trial / 24 % 5];
        double       x[CLOUD][3], edge = kind == 1 ? 0.0 : 0.1;
        for (int k = 0; k < n; k++) {
            edges[k] = size * edge;
            edge += kind == 2   ? 1e-6 * random_unit(&random)
                    : kind == 3 ? edge * 40.0 / n * random_unit(&random)
                                : (double)(random_bits(&random) % 5) / n;
        }
        for (int i = 0; i < CLOUD; i++) { /* some at an edge, or nearly so, from the first */
            for (int k = 0; k < 3; k++) {
                x[i][k] = i % 3 == 2 ? size * random_unit(&random) : 0.0;
            }
            if (i % 3 == 1) {
                x[i][i % 2] = edges[random_bits(&random) % (unsigned)n];
                x[i][2] = i % 5 == 0 ? 1e-8 * x[i][i % 2] : 0.0;
            }
        }
        const bool         inclusive = random_bits(&random) % 2;
        const hs_histogram wanted = {.n_edges = n,
                                     .edges = edges,
                                     .inclusive = inclusive,
                                     .last_inclusive = inclusive ^ (trial % 5 == 0),
                                     .n_types = 1,
                                     .counts = counted};
        check_bins((const double(*)[3])x, &wanted);
    }
}

/* ---- sums of products are exact until they are rounded once, whoever adds them ---- */

enum { N_WEIGHTS = 12 };

/* Is `rounded` the float64 nearest to the sum, the even one of two? `exact` is in units of
 * 2^-2148. */
static bool
is_nearest(big exact, double rounded)
{
    const big unit = big_from_double(1.0), two = big_from_int(2);
    const big twice = big_product(exact, two);
    if (isinf(rounded)) {
        const big limit = big_product(big_from_double(DBL_MAX), unit);
        return big_compare_magnitude(&limit, &exact) < 0 && (exact.sign < 0) == (rounded < 0.0);
    }
    const double below = nextafter(rounded, -INFINITY), above = nextafter(rounded, INFINITY);
    uint64_t     bits;
    memcpy(&bits, &rounded, sizeof bits);
    const big self = big_product(big_from_double(rounded), unit);
    int       low = 1, high = -1;
    if (!isinf(below))
        low = big_compare(twice, big_sum(self, big_product(big_from_double(below), unit)));
    if (!isinf(above))
        high = big_compare(twice, big_sum(self, big_product(big_from_double(above), unit)));
    return bits & 1 ? low > 0 && high < 0 : low >= 0 && high <= 0;
}

/* 0: one size; 1: charges; 2: sizes far apart; 3: all there are; 4: few bits, so that ties and
 * cancellation are common; 5: tiny. */
static double
random_weight(harness_random *random, int kind)
{
    const double x = 2.0 * random_unit(random) - 1.0;
    const int    any = (int)(random_bits(random) % 2000);
    switch (kind) {
    case 0: return x;
    case 1: return 0.01 * floor(100.0 * x);
    case 2: return ldexp(x, any % 120 - 60);
    case 3: return ldexp(x, any - 1050);
    case 4: return ldexp(floor(8.0 * x), any % 2 ? 0 : any % 3 ? 53 : -53);
    default: return ldexp(x, -530 - any % 20);
    }
}

/* Queries at 0, and points of which every other one is in the first bin; now and then more pairs than
 * limbs bear without being carried, in tests. */
static void
sums_are_rounded_once(void)
{
    const double   edges[2] = {0.75, 1.5};
    harness_random random = {2718281};
    for (int trial = 0; trial < 3000; trial++) {
        const int    kind = trial % 6, most = trial % 10 ? 5 : N_WEIGHTS;
        const int    n_a = 1 + (int)(random_bits(&random) % (unsigned)most);
        const int    n_b = 1 + (int)(random_bits(&random) % (unsigned)most);
        double       a[N_WEIGHTS], b[N_WEIGHTS], at[N_WEIGHTS], sums[2];
        const double here[N_WEIGHTS] = {0.0};
        big          exact[2] = {big_from_int(0), big_from_int(0)};
        hs_options   options = hs_options_default();
        for (int i = 0; i < N_WEIGHTS; i++) {
            a[i] = random_weight(&random, kind);
            b[i] = trial % 7 ? random_weight(&random, kind) : 1.0;
            at[i] = 0.5 * (1 + i % 2);
        }
        for (int e = 0; e < n_a * n_b; e++) {
            const int j = e % n_b;
            exact[j % 2] = big_sum(exact[j % 2],
                                   big_product(big_from_double(a[e / n_b]), big_from_double(b[j])));
        }
        const hs_points    queries = {here, n_a, 1, HS_FLOAT64, 8, 8};
        const hs_points    points = {at, n_b, 1, HS_FLOAT64, 8, 8};
        const hs_histogram wanted = {.n_edges = 2, .edges = edges, .n_types = 1, .sums = sums};
        const hs_among     among = {.points = SET(&points, .weights = trial % 7 ? b : NULL),
                                    .queries = SET(&queries, .weights = a)};
        options.threads = 1 + trial % 2;
        CHECK(hs_pairs_histogram(&among, &options, &wanted, NULL) == HS_OK);
        CHECK(is_nearest(exact[0], sums[0]) && is_nearest(exact[1], sums[1]));
    }
}

/* What several threads have counted and summed comes to the bits of one. */
static void
threads_add_up_to_the_same(void)
{
    enum { N = 20000, EDGES = 3 };
    static double   x[3 * N], weights[N];
    const double    edges[EDGES] = {0.02, 0.03, 0.05};
    harness_random  random = {1414};
    hs_options      options = hs_options_default();
    const hs_points points = points_in_rows(x, N, 3);
    int64_t         counts[2][EDGES];
    double          sums[2][EDGES];
    for (int e = 0; e < 3 * N; e++) {
        x[e] = random_unit(&random);
        weights[e % N] = random_weight(&random, 2);
    }
    for (int threads = 1; threads <= 4; threads++) {
        const int          t = threads > 1;
        const hs_histogram wanted = {.n_edges = EDGES,
                                     .edges = edges,
                                     .n_types = 1,
                                     .counts = threads == 4 ? NULL : counts[t],
                                     .sums = sums[t]};
        memset(sums[t], 0, sizeof sums[t]);
        const hs_among among = {.points = SET(&points, .weights = weights)};
        options.threads = threads;
        CHECK(hs_pairs_histogram(&among, &options, &wanted, NULL) == HS_OK);
        CHECK(t == 0 || memcmp(counts[0], counts[1], sizeof counts[0]) == 0);
        CHECK(t == 0 || memcmp(sums[0], sums[1], sizeof sums[0]) == 0);
    }
    CHECK(counts[0][EDGES - 1] > 10000);
}

/* Sizes so far apart that no scale holds the edges: bands have the room of both roundings. */
static void
edges_may_be_of_any_size(void)
{
    enum { EDGES = 53 };
    static const double x[] = {0.0, 0x1p-1060, 0x1p1020, 0x1p1022};
    double              edges[EDGES];
    const hs_points     points = points_in_rows(x, 4, 1);
    const hs_options    options = hs_options_default();
    for (int k = 0; k < EDGES - 1; k++)
        edges[k] = ldexp(1.0, 40 * k - 1060);
    edges[EDGES - 2] = 0x1p1020;
    edges[EDGES - 1] = 0x1p1021;
    for (int inclusive = 0; inclusive < 2; inclusive++) {
        int64_t            counts[EDGES];
        const hs_histogram wanted = {.n_edges = EDGES,
                                     .edges = edges,
                                     .inclusive = inclusive,
                                     .n_types = 1,
                                     .counts = counts};
        CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &wanted, NULL) == HS_OK);
        CHECK(counts[0] == inclusive && counts[1] == !inclusive);
        for (int k = 2; k < EDGES - 2; k++)
            CHECK(counts[k] == 0);
        CHECK(counts[EDGES - 2] == 1 + inclusive && counts[EDGES - 1] == !inclusive);
    }
}

/* No distance is below zero, and those that are zero are below the next edge. */
static void
an_edge_at_zero_may_be_exclusive(void)
{
    static const double x[] = {0.0, 0.0, 1.0, 1.0, 3.0}, edges[] = {0.0, 1.0, 3.0};
    static const struct {
        int     n_edges;
        bool    last_inclusive;
        int64_t counts[3];
    } cases[] = {{3, true, {0, 2, 8}}, {3, false, {0, 2, 6}}, {1, true, {2}}, {1, false, {0}}};
    const hs_points  points = points_in_rows(x, 5, 1);
    const hs_options options = hs_options_default();
    for (int k = 0; k < 4; k++) {
        int64_t            counts[3] = {-1, -1, -1};
        const hs_histogram wanted = {.n_edges = cases[k].n_edges,
                                     .edges = edges,
                                     .last_inclusive = cases[k].last_inclusive,
                                     .n_types = 1,
                                     .counts = counts};
        CHECK(hs_pairs_histogram(AMONG(&points, NULL), &options, &wanted, NULL) == HS_OK);
        for (int e = 0; e < cases[k].n_edges; e++)
            CHECK(counts[e] == cases[k].counts[e]);
    }
}

void
test_histogram(void)
{
    RUN(each_pair_is_in_its_bin);
    RUN(memory_for_weights_may_be_refused);
    RUN(what_is_not_needed_is_not_looked_at);
    RUN(either_side_may_have_the_odd_weights);
    RUN(lattice_pairs_are_all_at_an_edge);
    RUN(pairs_of_two_spots_are_all_at_the_edge);
    RUN(bins_are_those_of_exact_distances);
    RUN(sums_are_rounded_once);
    RUN(threads_add_up_to_the_same);
    RUN(edges_may_be_of_any_size);
    RUN(an_edge_at_zero_may_be_exclusive);
}
