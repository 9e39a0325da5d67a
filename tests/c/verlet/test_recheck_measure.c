/* SPDX-License-Identifier: BSD-3-Clause */
/* test_recheck_measure.c: listed pairs are measured between points as the scene has them: with
 * their shift over its rows, whatever they were wrapped by and have jumped since. */
#include "../support/recheck_unit.h"

#include <math.h>

void test_recheck_measure(void);

enum { N = RECHECK_POINTS, IMAGES = RECHECK_IMAGES };

static recheck_unit unit;

/* D of places i and j in an image, of the points as given. */
static void
given_vector(const double *x, const hs_box *box, int i, int j, int image, double *D)
{
    const int m = unit.recheck.m, d = unit.recheck.d;
    for (int k = 0; k < d; k++) {
        D[k] = x[unit.order[j] * d + k] - x[unit.order[i] * d + k];
        for (int r = 0; r < m; r++) {
            const int64_t S =
                unit.images[image * m + r] + unit.counts[i * m + r] - unit.counts[j * m + r];
            D[k] += (double)S * box->rows[unit.recheck.vector_of_row[r]][k];
        }
    }
}

/* All of them, in every image: numbers are such that nothing is rounded. Returns how many points
 * lag. */
static int
check_vectors(const double *x, const hs_box *box)
{
    const hs_recheck *of = &unit.recheck;
    const int         m = of->m, d = of->d;
    int               wrong = 0, lagging = 0;
    for (int i = 0; i < N; i++) {
        bool lags = false;
        for (int r = 0; r < m; r++)
            lags = lags || of->lag[i * m + r] != 0;
        CHECK(of->lagging[i] == lags);
        lagging += lags;
        for (int j = 0; j < N; j++) {
            for (int image = 0; image < IMAGES; image++) {
                double expected[3];
                given_vector(x, box, i, j, image, expected);
                for (int k = 0; k < d; k++) {
                    double D = of->x[j * of->width + k] - of->x[i * of->width + k];
                    for (int r = 0; r < m; r++)
                        D += (double)(of->image[image * m + r] + of->lag[j * m + r] -
                                      of->lag[i * m + r]) *
                             of->scene.metric.rows[r][k];
                    wrong += D != expected[k];
                }
            }
        }
    }
    CHECK(wrong == 0);
    return lagging;
}

/* Upright boxes, as given or sheared by whole widths, and one that stays skewed. */
static void
vectors_are_those_of_the_points_as_given(void)
{
    static const hs_box boxes[] = {
        {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {0.0, 8.0}}},
        {.ndim = 2, .periodic = {false, true}, .rows = {{4.0}, {-8.0, 0.0}}},
        {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {12.0, 8.0}}},
        {.ndim = 2, .periodic = {true, true}, .rows = {{-20.0, 8.0}, {-4.0, 0.0}}},
        {.ndim = 2, .periodic = {true, true}, .rows = {{4.0, 1.0}, {1.0, 8.0}}},
        {.ndim = 3, .periodic = {true, true, true}, .rows = {{4.0}, {4.0, 4.0}, {8.0, -4.0, 2.0}}},
    };
    harness_random random = {66};
    int            lagging = 0;
    for (int trial = 0; trial < 60; trial++) {
        const hs_box *box = &boxes[trial % 6];
        double        x[3 * N];
        hs_failure    failure;
        hs_points     points = {x, N, box->ndim, HS_FLOAT64, box->ndim * 8, 8};
        for (int e = 0; e < 3 * N; e++)
            x[e] = (double)(random_bits(&random) % 256) * 0.125 - 16.0;
        recheck_unit_open(&points, box, 1.0, HS_WANT_DISTANCE | HS_WANT_VECTOR, &unit);
        for (int e = 0; e < N * 3; e++)
            unit.counts[e] = trial % 3 ? (int64_t)(random_bits(&random) % 9) - 4 : 0;
        for (int e = 0; e < IMAGES * 3; e++)
            unit.images[e] = (int32_t)(random_bits(&random) % 7) - 3;
        if (trial % 3) {
            unit.recheck.counts = hs_alloc(&unit.call.account, HS_FOR_WRAPS, N * 3, 8);
            memcpy(unit.recheck.counts, unit.counts, N * 3 * sizeof(int64_t));
        }
        CHECK(hs_recheck_open_scene(&unit.recheck, &failure) == HS_OK);
        lagging += check_vectors(x, box);
        recheck_unit_close(&unit);
    }
    CHECK(lagging > 100 && lagging < 60 * N);
}

/* Nothing repeats: no lag, no image. */
static void
open_points_have_no_lag(void)
{
    const double    x[N] = {0.0, 1.0, 2.0, 3.0, 4.0, 5.0};
    const hs_points points = {x, N, 1, HS_FLOAT64, 8, 8};
    hs_failure      failure;
    recheck_unit_open(&points, NULL, 1.0, HS_WANT_DISTANCE, &unit);
    CHECK(hs_recheck_open_scene(&unit.recheck, &failure) == HS_OK);
    for (int a = 0; a < N; a++)
        CHECK(unit.recheck.x[a * unit.recheck.width] == x[N - 1 - a]);
    recheck_unit_close(&unit);
}

/* Bundles of a slab that has more hits than a batch: each point with all others but the one that is
 * left out, in each image. Returns their number. */
static int32_t
make_bundles(bool plain, hs_bundle *bundles, hs_sifted *slab)
{
    enum { ROUNDS = 2 };
    int32_t n = 0;
    memset(slab, 0, sizeof *slab);
    for (; n < ROUNDS * N * IMAGES; n++) {
        const int32_t a = n % N;
        for (int32_t p = 1; p < N; p++) {
            if (p != 1 + n % 4)
                slab->hits[slab->n_hits++] = (a + p) % N;
        }
        bundles[n] = (hs_bundle){.end = (n + 1) * (N - 1), .point = a, .image = n / N % IMAGES};
        bundles[n].image = plain ? 0 : bundles[n].image;
        slab->hits_end[n] = slab->n_hits;
    }
    slab->n = n * (N - 1);
    slab->bundles = bundles;
    slab->n_bundles = n;
    return n;
}

/* D of hit h of a bundle, from the lower number to the higher. */
static void
vector_of_hit(const double *x, const hs_box *box, const hs_bundle *bundle, int32_t b, double *D)
{
    const int32_t a = bundle->point;
    given_vector(x, box, a, b, bundle->image, D);
    for (int k = 0; k < unit.recheck.d && unit.order[b] < unit.order[a]; k++)
        D[k] = -D[k];
}

/* Distances and vectors of hits, one behind another, from the place that the slab has in the
 * output. */
static void
hits_are_measured_in_their_order(void)
{
    enum { AT = 5 };
    static hs_sifted slab;
    static hs_bundle bundles[2 * N * IMAGES];
    const hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{16.0}, {0.0, 16.0}}};
    const double     x[2 * N] = {0.0, 0.0, 1.0, 0.5, 2.0, 17.0, 3.0, 1.5, 20.0, 2.0, 5.0, -2.5};
    const hs_points  points = {x, N, 2, HS_FLOAT64, 16, 8};
    for (int plain = 0; plain < 2; plain++) {
        hs_failure failure;
        hs_output  output;
        recheck_unit_open(&points, &box, 100.0, HS_WANT_DISTANCE | HS_WANT_VECTOR, &unit);
        unit.images[2] = unit.images[5] = 1;
        unit.images[7] = -1;
        hs_output_init(&unit.call.account, 2, HS_WANT_DISTANCE | HS_WANT_VECTOR, 4, &output);
        unit.recheck.output = &output;
        const int32_t n = make_bundles(plain, bundles, &slab);
        CHECK(hs_output_reserve(&output, slab.n_hits + AT, 0.0) == HS_OK);
        unit.list.listing.n_plain = plain ? slab.n : 0;
        slab.at = AT;
        CHECK(hs_recheck_open_scene(&unit.recheck, &failure) == HS_OK);
        hs_recheck_measure(&unit.recheck, &slab);
        const double *distance = hs_recheck_column(&unit.recheck, HS_WANT_DISTANCE, AT);
        const double *vector = hs_recheck_column(&unit.recheck, HS_WANT_VECTOR, AT);
        int           wrong = 0;
        for (int32_t of = 0, h = 0; of < n; of++) {
            for (; h < slab.hits_end[of]; h++) {
                double D[3];
                vector_of_hit(x, &box, &bundles[of], slab.hits[h], D);
                wrong += vector[2 * h] != D[0] || vector[2 * h + 1] != D[1];
                wrong += fabs(distance[h] - hypot(D[0], D[1])) > 1e-14 * distance[h];
            }
        }
        CHECK(wrong == 0 && slab.n_hits > HS_BATCH);
        hs_output_free(&output);
        recheck_unit_close(&unit);
    }
}

/* Along one axis, and along two, where points that lag are laid out for the writer as well. */
static void
any_allocation_may_be_refused(void)
{
    const double x[2 * N] = {0.0, 5.0, 2.0, 3.0, 4.0, 1.0, 9.0, 8.0, 6.0, 1.0, 7.0, 0.0};
    for (int d = 1; d <= 2; d++) {
        const hs_box    box = {.ndim = d, .periodic = {true, d > 1}, .rows = {{4.0}, {0.0, 4.0}}};
        const hs_points points = {x, N, d, HS_FLOAT64, 16, 8};
        hs_status       status = HS_ERR_MEMORY;
        hs_failure      failure;
        int             nth;
        for (nth = 1; status != HS_OK && nth < 20; nth++) {
            recheck_unit_open(&points, &box, 1.0, HS_WANT_DISTANCE, &unit);
            const bool writes = d > 1 && unit.call.kernel->write != NULL;
            unit.output.fixed = false;
            hs_test_fail_allocation(nth);
            status = hs_recheck_open_scene(&unit.recheck, &failure);
            CHECK(status == (hs_test_failure_is_due() ? HS_OK : HS_ERR_MEMORY));
            hs_test_fail_allocation(0);
            CHECK(status != HS_OK || (unit.recheck.few != NULL) == writes);
            recheck_unit_close(&unit);
        }
        CHECK(nth > 6 && nth < 20);
    }
}

void
test_recheck_measure(void)
{
    RUN(vectors_are_those_of_the_points_as_given);
    RUN(open_points_have_no_lag);
    RUN(hits_are_measured_in_their_order);
    RUN(any_allocation_may_be_refused);
}
