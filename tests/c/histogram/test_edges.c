/* SPDX-License-Identifier: BSD-3-Clause */
/* test_edges.c: slots and ranges of squares are those that the band of each edge says. */
#include "../../../csrc/core/histogram/edges.h"
#include "../../../csrc/core/exact/filter.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"

#include <float.h>
#include <math.h>

void test_edges(void);

enum { MOST = 3000 };

static double at[MOST], lower[MOST], upper[MOST];

static hs_edges
edges_of(int64_t n, bool inclusive)
{
    return (hs_edges){.n = n,
                      .inclusive = inclusive,
                      .last_inclusive = inclusive,
                      .at = at,
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
        if (at[k] == 0.0 && !hs_edge_is_inclusive(edges, k)) { /* nothing is below zero */
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
    float square = (float)(at[k] * at[k] * (1.0 + (random_unit(random) - 0.5) * 0x1p-20));
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
            at[k] = lower[k] = upper[k] = edge;
            edge += kind == 2   ? 1e-6 * random_unit(&random)
                    : kind == 3 ? edge * 40.0 / n * random_unit(&random)
                                : (double)(random_bits(&random) % 5) / n;
        }
        if (kind == 4) { /* scaling has lost digits */
            for (int k = 0; k < n; k++) {
                lower[k] = at[k] * 0.999 - (k == 0) * at[0];
                upper[k] = at[k] * 1.001;
            }
        }
        const hs_edges edges = edges_of(n, trial % 2 || at[n - 1] == 0.0);
        n_sure += check_edges(&random, &edges, kind == 3 ? 1.0 : 4.0 * at[n - 1] + 1.0);
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
    at[0] = lower[0] = upper[0] = 0.0;
    CHECK(hs_edge_table_build(&edges, 1.0, &table) == HS_OK);
    CHECK(!hs_edge_slots(&table, squares, 1, &slot) && slot == 2);
    hs_edge_table_free(&table);
}

/* Squares may overflow: nothing is sure, and all edges are in question. */
static void
large_extents_have_no_table(void)
{
    static const double extents[] = {0x1p70, 0x1p600, INFINITY, NAN};
    harness_random      random = {3};
    for (int k = 0; k < 9; k++) {
        at[k] = lower[k] = upper[k] = 1.0 + k;
    }
    for (int e = 0; e < 4; e++) {
        const hs_edges edges = edges_of(9, true);
        hs_edge_table  table = {0};
        const float    squares[] = {0.0f, (float)random_unit(&random), FLT_MAX, INFINITY};
        int32_t        slots[4], low = -1, high = -1;
        CHECK(hs_edge_table_build(&edges, extents[e], &table) == HS_OK);
        CHECK(hs_edge_slots(&table, squares, 4, slots));
        for (int s = 0; s < 4; s++) {
            hs_edge_range(&table, &edges, squares[s], &low, &high);
            CHECK(slots[s] == 1 && low == 0 && high == 9);
        }
        hs_edge_table_free(&table);
    }
}

static void
tables_need_memory(void)
{
    const hs_edges edges = edges_of(9, true);
    const int64_t  before = hs_test_live_blocks();
    for (int nth = 1; nth <= 2; nth++) {
        hs_edge_table table = {0};
        hs_test_fail_allocation(nth);
        CHECK(hs_edge_table_build(&edges, 8.0, &table) == HS_ERR_MEMORY);
        hs_test_fail_allocation(0);
        CHECK(table.in == NULL && table.cells == NULL && table.extent == 0.0);
        CHECK(hs_test_live_blocks() == before);
    }
}

/* In a scene whose scaled numbers may be off, an edge lies between bounds around what it scales to;
 * an edge of 0 is 0. */
static void
edges_that_scaling_loses_have_bounds(void)
{
    const double       given[3] = {0.0, 0x1p-1060, 3.0};
    const hs_histogram histogram = {.n_edges = 3, .edges = given, .inclusive = true};
    for (int extreme = 0; extreme < 2; extreme++) {
        hs_edges edges;
        hs_scene scene = {.ndim = 3, .extreme = extreme, .scale = hs_scale_of(-3)};
        CHECK(hs_edges_init(NULL, &scene, 0x1p-30, &histogram, &edges) == HS_OK);
        for (int k = 0; k < 3; k++) {
            const double scaled = hs_scale_apply(scene.scale, given[k]);
            const double loss = extreme && k > 0 ? HS_SCALING_LOSS : 0.0;
            CHECK(edges.at[k] == (extreme ? given[k] : scaled));
            CHECK(edges.lower[k] == scaled - loss && edges.upper[k] == scaled + loss);
        }
        hs_edges_free(NULL, &edges);
    }
}

void
test_edges(void)
{
    RUN(edges_that_scaling_loses_have_bounds);
    RUN(slots_are_those_of_the_bands);
    RUN(nothing_is_below_zero);
    RUN(large_extents_have_no_table);
    RUN(tables_need_memory);
}
