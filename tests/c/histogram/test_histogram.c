/* SPDX-License-Identifier: BSD-3-Clause */
/* test_histogram.c: pairs are counted in the right bin, with their weights. */
#include "../../../csrc/core/exact/filter.h"
#include "../../../csrc/core/histogram/histogram.h"
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

/* Weights where nothing is summed, and types where there is one. */
static void
what_is_not_needed_is_not_looked_at(void)
{
    static line    made;
    harness_random random = {1598};
    make_line(&random, 4, &made);
    made.known = (hs_set){.types = made.types, .weights = made.weights};
    made.types[1] = -1;
    made.weights[2] = NAN;
    CHECK(find_line(&made, 0, NULL) == HS_ERR_WEIGHTS);
    made.wanted.sums = NULL;
    CHECK(find_line(&made, 0, NULL) == HS_OK && line_is_right(&made, 0));
    made.wanted.n_types = TYPES;
    CHECK(find_line(&made, 0, NULL) == HS_ERR_TYPES);
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

/* ---- slots and ranges of squares are those that the band of each edge says ---- */

enum { MOST = 3000 };

static double at_edges[MOST], lower[MOST], upper[MOST];

static hs_edges
edges_of(int64_t n, bool inclusive)
{
    return (hs_edges){.n = n,
                      .inclusive = inclusive,
                      .last_inclusive = inclusive,
                      .at = at_edges,
                      .lower = lower,
                      .upper = upper,
                      .ndim = 3,
                      .filter_error = 0x1p-30};
}

/* How many edges are surely reached by a square, and how many perhaps. */
static void
count_edges(const hs_edges *edges, double extent, float square, int32_t *sure, int32_t *perhaps)
{
    *sure = *perhaps = 0;
    for (int64_t k = 0; k < edges->n; k++) {
        if (at_edges[k] == 0.0 && !hs_edge_is_inclusive(edges, k)) { /* nothing is below zero */
            ++*sure;
            ++*perhaps;
            continue;
        }
        const hs_thresholds far = hs_thresholds_of(3, upper[k], extent, edges->filter_error);
        const hs_thresholds near = hs_thresholds_of(3, lower[k], extent, edges->filter_error);
        const bool          none = lower[k] != upper[k] && !(lower[k] > 0.0);
        *sure += square > far.out;
        *perhaps += none || !(square < near.in);
    }
}

/* The largest square that belongs to the table, or any smaller one. */
static float
some_square(harness_random *random, const hs_edges *edges, double extent)
{
    const int64_t       k = (int64_t)(random_unit(random) * (double)edges->n);
    const hs_thresholds last =
        hs_thresholds_of(3, upper[edges->n - 1], extent, edges->filter_error);
    float square =
        (float)(at_edges[k] * at_edges[k] * (1.0 + (random_unit(random) - 0.5) * 0x1p-20));
    if (random_bits(random) % 2) {
        square = (float)(last.out * random_unit(random));
    } else if (random_bits(random) % 8 == 0) {
        square = random_bits(random) % 2 ? 0.0f : last.out;
    }
    return fminf(square, last.out);
}

/* Returns how many squares were sure. */
static int
check_edges(harness_random *random, const hs_edges *edges, double extent)
{
    enum { N = 200 };
    hs_edge_table table = {0};
    float         squares[N];
    int32_t       slots[N + 1];
    bool          odd = false;
    int           n_sure = 0;
    CHECK(hs_edge_table_build(edges, extent, &table) == HS_OK && table.extent == extent);
    for (int s = 0; s < N; s++) {
        squares[s] = some_square(random, edges, extent);
    }
    slots[N] = -77;
    const bool said = hs_edge_slots(&table, squares, N, slots);
    CHECK(slots[N] == -77);
    for (int s = 0; s < N; s++) {
        int32_t sure, perhaps, low = -1, high = -1;
        count_edges(edges, extent, squares[s], &sure, &perhaps);
        odd = odd || slots[s] % 2 == 1;
        if (slots[s] % 2 == 0) {
            CHECK(sure == perhaps && slots[s] == 2 * sure);
            n_sure++;
            continue;
        }
        hs_edge_range(&table, edges, squares[s], &low, &high);
        if (table.cells != NULL) {
            CHECK(low == sure && high == perhaps);
            /* Of one band alone each square is known to be below it, in it or above. */
            const int32_t cell =
                (int32_t)(hs_bits_of_float(squares[s]) >> table.shift) - table.first;
            CHECK(low < high || table.cells[cell < 0 ? 0 : cell].n_bands > 1);
        } else {
            CHECK(low == 0 && high == edges->n);
        }
    }
    CHECK(said == odd);
    hs_edge_table_free(&table);
    hs_edge_table_free(&table);
    return n_sure;
}

/* Few and many edges, close together and far apart, some twice and some at zero. */
static void
slots_are_those_of_the_bands(void)
{
    static const int counts[] = {1, 2, 7, 64, 500, 3000};
    harness_random   random = {8128};
    int              n_sure = 0;
    for (int trial = 0; trial < TRIALS(240); trial++) {
        const int n = counts[trial % 6], kind = trial / 6 % 5;
        double    edge = kind == 1 ? 0.0 : 0.1;
        for (int k = 0; k < n; k++) {
            at_edges[k] = lower[k] = upper[k] = edge;
            edge += kind == 2   ? 1e-6 * random_unit(&random)
                    : kind == 3 ? edge * 40.0 / n * random_unit(&random)
                                : (double)(random_bits(&random) % 5) / n;
        }
        if (kind == 4) { /* scaling has lost digits */
            for (int k = 0; k < n; k++) {
                lower[k] = at_edges[k] * 0.999 - (k == 0) * at_edges[0];
                upper[k] = at_edges[k] * 1.001;
            }
        }
        const hs_edges edges = edges_of(n, trial % 2 || at_edges[n - 1] == 0.0);
        n_sure += check_edges(&random, &edges, kind == 3 ? 1.0 : 4.0 * at_edges[n - 1] + 1.0);
    }
    CHECK(n_sure > TRIALS(5000));
}

/* An edge that no distance is below, alone. */
static void
nothing_is_below_zero(void)
{
    const float    squares[] = {0.0f};
    int32_t        slot;
    hs_edge_table  table = {0};
    const hs_edges edges = edges_of(1, false);
    at_edges[0] = lower[0] = upper[0] = 0.0;
    CHECK(hs_edge_table_build(&edges, 1.0, &table) == HS_OK);
    CHECK(!hs_edge_slots(&table, squares, 1, &slot) && slot == 2);
    hs_edge_table_free(&table);
}

/* ---- sums of products are exact until they are rounded once, whoever adds them ---- */

enum { N_WEIGHTS = 40 };

static const int32_t identity[N_WEIGHTS] = {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11, 12, 13,
                                            14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27,
                                            28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39};

static hs_weights
weights_of(const double *weights, int64_t n)
{
    hs_weights taken;
    hs_failure failure;
    CHECK(hs_weights_init(NULL, weights, identity, n, &taken, &failure) == HS_OK);
    return taken;
}

static void
add(hs_sums *sums, int64_t k, const hs_weights *a, int i, const hs_weights *b, int j)
{
    const int32_t place =
        (a->place != NULL ? a->place[i] : 0) + (b->place != NULL ? b->place[j] : 0);
    hs_sums_expect(sums, 1);
    hs_sums_add(sums->limbs + k * sums->n_limbs, a->value != NULL ? a->value[i] : 1,
                b->value != NULL ? b->value[j] : 1, place);
}

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

static void
sums_are_rounded_once(void)
{
    harness_random random = {2718281};
    for (int trial = 0; trial < 3000; trial++) {
        const int kind = trial % 6, n = 1 + (int)(random_bits(&random) % N_WEIGHTS);
        double    a[N_WEIGHTS], b[N_WEIGHTS];
        for (int i = 0; i < N_WEIGHTS; i++) {
            a[i] = random_weight(&random, kind);
            b[i] = trial % 7 ? random_weight(&random, kind) : 1.0;
        }
        hs_weights of_a = weights_of(a, N_WEIGHTS);
        hs_weights of_b = weights_of(trial % 7 ? b : NULL, N_WEIGHTS);
        hs_sums    sums, others;
        CHECK(hs_sums_init(NULL, 2, &of_a, &of_b, &sums) == HS_OK);
        CHECK(hs_sums_init(NULL, 2, &of_a, &of_b, &others) == HS_OK);
        big exact = big_from_int(0);
        for (int e = 0; e < n; e++) {
            const int i = (int)(random_bits(&random) % N_WEIGHTS),
                      j = (int)(random_bits(&random) % N_WEIGHTS);
            exact = big_sum(exact, big_product(big_from_double(a[i]), big_from_double(b[j])));
            add(e % 3 ? &sums : &others, 1, &of_a, i, &of_b, j);
        }
        hs_sums_join(&sums, &others);
        const double rounded = hs_sums_round(&sums, 1);
        CHECK(is_nearest(exact, rounded));
        CHECK(hs_sums_round(&sums, 0) == 0.0);
        hs_sums_free(NULL, &sums);
        hs_sums_free(NULL, &others);
        hs_weights_free(NULL, &of_a);
        hs_weights_free(NULL, &of_b);
    }
}

/* Weights with places of their own need two arrays; more sums than can be counted are refused. */
/* As often as limbs bear without being carried, and again after that. */
static void
limbs_do_not_overflow(void)
{
    const double weight = ldexp(1.0, 53) - 1.0;
    hs_weights   of = weights_of(&weight, 1);
    hs_sums      sums;
    CHECK(hs_sums_init(NULL, 1, &of, &of, &sums) == HS_OK);
    for (int round = 0; round < 3; round++) {
        sums.n_added = HS_SUMS_MOST_ADDED;
        for (int e = 0; e < sums.n_limbs - 1; e++) {
            sums.limbs[e] += UINT32_MAX * (HS_SUMS_MOST_ADDED - 1);
        }
        hs_sums_expect(&sums, 1);
        CHECK(sums.n_added == 1);
        for (int e = 0; e < sums.n_limbs - 1; e++) {
            CHECK(sums.limbs[e] >= 0 && sums.limbs[e] <= UINT32_MAX);
            sums.limbs[e] = 0;
        }
        sums.limbs[sums.n_limbs - 1] = 0;
        hs_sums_add(sums.limbs, of.value[0], -of.value[0], 0);
        hs_sums_carry(&sums);
        CHECK(hs_sums_round(&sums, 0) == -(weight * weight));
        memset(sums.limbs, 0, (size_t)sums.n_limbs * sizeof *sums.limbs);
    }
    hs_sums_free(NULL, &sums);
    hs_weights_free(NULL, &of);
}

static void
sums_need_memory(void)
{
    const double  weights[] = {0x1p400, 0x1p-400};
    const int64_t before = hs_test_live_blocks();
    hs_weights    taken;
    hs_failure    failure;
    hs_sums       sums;
    for (int nth = 1; nth <= 2; nth++) {
        hs_test_fail_allocation(nth);
        CHECK(hs_weights_init(NULL, weights, identity, 2, &taken, &failure) == HS_ERR_MEMORY);
        hs_test_fail_allocation(0);
        CHECK(taken.value == NULL && taken.place == NULL && hs_test_live_blocks() == before);
    }
    CHECK(hs_weights_init(NULL, weights, identity, 2, &taken, &failure) == HS_OK);
    CHECK(hs_sums_init(NULL, INT64_MAX / 2, &taken, &taken, &sums) == HS_ERR_MEMORY);
    CHECK(hs_sums_init(NULL, 2, &taken, &taken, &sums) == HS_OK);
    hs_sums_free(NULL, &sums);
    hs_weights_free(NULL, &taken);
    CHECK(hs_test_live_blocks() == before);
}

void
test_histogram(void)
{
    RUN(each_pair_is_in_its_bin);
    RUN(what_is_not_needed_is_not_looked_at);
    RUN(either_side_may_have_the_odd_weights);
    RUN(lattice_pairs_are_all_at_an_edge);
    RUN(pairs_of_two_spots_are_all_at_the_edge);
    RUN(slots_are_those_of_the_bands);
    RUN(nothing_is_below_zero);
    RUN(sums_are_rounded_once);
    RUN(limbs_do_not_overflow);
    RUN(sums_need_memory);
}
