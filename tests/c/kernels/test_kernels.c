/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_kernels.c: the scans of every kernel of this CPU against a plain loop and the scalar kernel,
 * and which kernels there are. test_copies.c has gathering and emitting.
 */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include <math.h>

#include "../support/scan_checks.h"
#include "../support/among.h"

void test_kernels(void);

enum { SHORT_BLOCK = 3 * 32 + 2 }; /* past three times the widest vector */

static numbers scene;

static void
every_kernel_lists_what_the_plain_loop_lists(void)
{
    harness_random   random = {271828};
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int32_t n = 0; n <= SHORT_BLOCK; n++) {
            for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
                const int32_t n_points = 1 + (int32_t)(random_bits(&random) % 5);
                fill_with_integers(&random, ndim, n, n_points, &scene);
                const float out = (float)(random_bits(&random) % (8u * (unsigned)ndim));
                set_limits(&scene, out - (float)(random_bits(&random) % 4), out);
                (void)check_exactly(kernel, &scene);
            }
        }
    }
}

/* Blocks up to capacity, full groups, many hits or many unsure ones, ample room and little: a scan
 * then stops before they might not fit. */
static void
scans_stop_before_hits_might_not_fit(void)
{
    static const int32_t sizes[] = {1,
                                    127,
                                    1000,
                                    MOST_HITS / 3 + 1, /* one too many */
                                    HS_BLOCK_CANDIDATES - 1,
                                    HS_BLOCK_CANDIDATES};
    static const float   limits[][2] = {
          {100.0f, 100.0f}, {-1.0f, 100.0f}, {2.0f, 3.0f}, {-1.0f, 0.0f}};
    harness_random   random = {577215};
    const hs_kernel *kernel;
    int              most = 0, least = 1000;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int trial = 0; trial < 24; trial++) {
            if (IS_SLOW && trial % 5 != 0 && trial != 7) { /* one of each size, and of each d */
                continue;
            }
            const int32_t n = sizes[trial % 6], n_points = n == 1 ? 1 : HS_GROUP_POINTS - trial % 3;
            fill_with_integers(&random, 1 + trial % 3, n, n_points, &scene);
            set_limits(&scene, limits[trial / 6][0], limits[trial / 6][1]);
            scene.triangular = trial >= 12 && n >= n_points;
            if (trial / 3 % 2) {
                scene.most_hits = MOST_HITS; /* what a large scene has */
                scene.most_unsure = HS_BLOCK_CANDIDATES;
            }
            const int calls = check_exactly(kernel, &scene);
            most = calls > most ? calls : most;
            least = calls < least ? calls : least;
        }
    }
    CHECK(least == 10); /* one call of each of the five functions, twice */
    CHECK(most > 8 * HS_GROUP_POINTS / 2);
}

static void
infinity_and_nan_are_listed_as_unsure(void)
{
    static const float odd[] = {NAN, INFINITY, -INFINITY, 0x1p-149f, -0.0f};
    static const float limits[][2] = {
        {-1.0f, INFINITY}, {INFINITY, 4.0f}, {1.0f, 4.0f}, {-1.0f, -1.0f}, {-1.0f, 0.0f}};
    harness_random   random = {314159};
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int trial = 0; trial < 1000; trial++) {
            const int32_t n = (int32_t)(random_bits(&random) % (SHORT_BLOCK + 1));
            const int     ndim = 1 + trial % HS_MAX_DIM, which = (int)(random_bits(&random) % 5);
            fill_with_integers(&random, ndim, n, 3, &scene);
            for (int32_t c = 0; c < n; c++) {
                const int axis = (int)(random_bits(&random) % (unsigned)ndim);
                if (random_bits(&random) % 4 == 0) {
                    scene.y[axis][c] = odd[random_bits(&random) % 5];
                    scene.norm[c] = isfinite(scene.y[axis][c]) ? scene.norm[c] : INFINITY;
                }
            }
            scene.q[0][0] = trial % 5 == 0 ? odd[random_bits(&random) % 4] : scene.q[0][0];
            set_limits(&scene, limits[which][0], limits[which][1]);
            if (which == 0) {
                scene.expanded.in = -INFINITY; /* what hs_expanded_of gives when nothing is sure */
            }
            (void)check_exactly(kernel, &scene);
        }
    }
}

/* A NaN coordinate is a hit and unsure with every threshold, in both forms. */
static void
a_nan_is_never_lost(void)
{
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        const hs_scan_fn functions[] = {kernel->list, kernel->count, kernel->list_direct,
                                        kernel->count_direct};
        for (int f = 0; f < 4; f++) {
            for (int32_t place = 0; place < 40; place++) {
                harness_random random = {1 + (uint64_t)place};
                fill_with_integers(&random, 3, 40, 1, &scene);
                scene.triangular = false;
                scene.y[place % 3][place] = NAN;
                set_limits(&scene, -100.0f, -100.0f); /* nothing else is near */
                hs_scan scan = place_scan(&scene, true);
                CHECK(functions[f](&scan, 0) == 1);
                CHECK(scan.n_hits == 1 && scan.n_unsure == 1);
                CHECK(scan.unsure[0].t == 0 && scan.unsure[0].place == place);
            }
        }
    }
}

/* Any numbers: kernels may differ between the thresholds that filter.h gives, and nowhere else. */
static void
kernels_differ_between_the_thresholds_only(void)
{
    static expectation scalar;
    harness_random     random = {161803};
    const hs_kernel   *kernel;
    int                unsure = 0;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int trial = 0; trial < 3000; trial++) {
            const bool    expanded = trial % 2;
            const int     ndim = 1 + trial / 2 % HS_MAX_DIM;
            const int32_t n = (int32_t)(random_bits(&random) % (SHORT_BLOCK + 1));
            fill_with_integers(&random, ndim, n, 1, &scene);
            for (int a = 0; a < ndim; a++) {
                for (int32_t c = 0; c < n; c++) {
                    scene.y[a][c] += (float)random_unit(&random);
                    scene.norm[c] = (a == 0 ? 0.0f : scene.norm[c]) + scene.y[a][c] * scene.y[a][c];
                }
            }
            double square = 0.0; /* of some pair, so that some are near the cutoff */
            for (int a = 0; a < ndim && n > 0; a++) {
                const double along = (double)scene.y[a][n / 2] - (double)scene.q[a][0];
                square += along * along;
            }
            scene.triangular = false;
            scene.direct = hs_thresholds_of(ndim, sqrt(square), 8.0, 0.0);
            scene.expanded = hs_expanded_of(ndim, sqrt(square), 8.0, 0.0);
            expect(&scene, expanded ? by_expansion : by_cutoff, true, 0);
            scalar = expected;
            hs_scan    scan = place_scan(&scene, trial & 4);
            hs_scan_fn list = expanded ? kernel->list : kernel->list_direct;
            CHECK(list(&scan, 0) == 1);
            /* without the unsure ones, the lists are the same */
            bool    same = scan.n_hits - scan.n_unsure == scalar.n_hits - scalar.n_unsure;
            int32_t u = 0, v = 0, b = 0;
            for (int32_t a = 0; a < scan.n_hits && same; a++) {
                if (u < scan.n_unsure && scan.unsure[u].at == a) {
                    u++;
                    continue;
                }
                while (v < scalar.n_unsure && scalar.unsure[v].at == b) {
                    v++;
                    b++;
                }
                same = scan.hits[a] == scalar.hits[b++];
            }
            CHECK(same);
            CHECK(u == scan.n_unsure);
            CHECK(expanded || scan.n_unsure == scalar.n_unsure); /* the direct form never differs */
            unsure += scan.n_unsure;
        }
    }
    CHECK(unsure > 1000);
}

static void
kernels_are_known_by_their_names(void)
{
    const char *names[MOST_KERNELS];
    const int   n = hs_kernel_names(names, MOST_KERNELS);
    CHECK(n >= 1 && n <= MOST_KERNELS);
    CHECK(hs_kernel_names(NULL, 0) == n);
    CHECK(hs_kernel_select(NULL) == hs_kernel_select(names[0]));
    CHECK(strcmp(names[n - 1], "scalar") == 0);
    for (int k = 0; k < n; k++) {
        CHECK(strcmp(hs_kernel_select(names[k])->name, names[k]) == 0);
    }
    CHECK(hs_kernel_select("") == NULL);
    CHECK(hs_kernel_select("Scalar") == NULL);
    hs_options      options = hs_options_default();
    const double    x = 0.0;
    const hs_points points = {.data = &x, .n = 1, .ndim = 1, .real = HS_FLOAT64};
    int64_t         count = -1;
    options.kernel = "abacus";
    CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &count, NULL) == HS_ERR_KERNEL);
    CHECK(count == -1);
}

void
test_kernels(void)
{
    guard_scans();
    RUN(every_kernel_lists_what_the_plain_loop_lists);
    RUN(scans_stop_before_hits_might_not_fit);
    RUN(infinity_and_nan_are_listed_as_unsure);
    RUN(a_nan_is_never_lost);
    RUN(kernels_differ_between_the_thresholds_only);
    RUN(kernels_are_known_by_their_names);
}
