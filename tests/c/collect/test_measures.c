/* SPDX-License-Identifier: BSD-3-Clause */
/* test_measures.c: each pair of a batch is measured with the bits of hs_metric_measure, by every
 * kernel, whatever its shift; and comes to the caller's unit as it should. */
#include "../../../csrc/core/collect/measures.h"
#include "../support/harness.h"

#include <math.h>

void test_measures(void);

static hs_measured pairs;

/* Pairs in 3-D; shift_of[r] is the largest shift along row r, of either sign. */
static void
make_pairs(int32_t n, const double *shift_of, harness_random *random)
{
    memset(&pairs, 0, sizeof pairs);
    pairs.n = n;
    for (int32_t e = 0; e < n; e++) {
        for (int k = 0; k < 3; k++) {
            pairs.p[k][e] = random_unit(random) - 0.5;
            pairs.q[k][e] = random_unit(random) - 0.5;
        }
        for (int r = 0; r < 3; r++) {
            const double shift = shift_of[r] * (2.0 * random_unit(random) - 1.0);
            hs_measured_shift(&pairs, e, r, (int64_t)nearbyint(shift));
        }
    }
}

static bool
is_measured_as_one(const hs_metric *metric, int32_t e, bool vectors)
{
    double  p[3], q[3], vector[3];
    int64_t shift[3];
    for (int k = 0; k < 3; k++) {
        p[k] = pairs.p[k][e];
        q[k] = pairs.q[k][e];
        shift[k] = pairs.shift[k][e];
    }
    bool same = pairs.distance[e] == hs_metric_measure(metric, p, q, shift, vector);
    for (int k = 0; vectors && k < 3; k++)
        same = same && pairs.vector[k][e] == vector[k];
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
            CHECK(pairs.is_wide == (s == 4 && n > 0));
            for (int kernel = 0; kernel < 2 * n_kernels; kernel++) {
                const bool vectors = kernel % 2 == 1;
                int        wrong = 0;
                hs_measured_find(hs_kernel_select(names[kernel / 2]), &metric, vectors, &pairs);
                for (int32_t e = 0; e < n; e++)
                    wrong += !is_measured_as_one(&metric, e, vectors);
                CHECK(wrong == 0);
            }
        }
    }
}

static void
measures_come_to_the_callers_unit(void)
{
    const hs_scale same = hs_scale_of(0), larger = hs_scale_of(-3);
    double         d[4] = {0.5, 1.0, nextafter(1.0, 2.0), 0.25};
    hs_restore_distances(d, 3, same);
    CHECK(d[0] == 0.5 && d[1] == 1.0 && d[2] > 1.0);
    hs_keep_all_within(d, 3, 1.0, true);
    CHECK(d[0] == 0.5 && d[1] == 1.0 && d[2] == 1.0);
    hs_keep_all_within(d, 3, 1.0, false);
    CHECK(d[1] == nextafter(1.0, 0.0) && d[2] == nextafter(1.0, 0.0));
    hs_restore_distances(d, 1, larger);
    CHECK(d[0] == 4.0 && d[3] == 0.25);
    for (int ndim = 1; ndim <= 5; ndim++) { /* 1 to 3 have loops of their own */
        double x[5][2], *vector[5], to[11], sign[2] = {1.0, -1.0};
        for (int k = 0; k < ndim; k++) {
            x[k][0] = 1.0 + k;
            x[k][1] = k == 0 ? 0.0 : 10.0 + k;
            vector[k] = x[k];
        }
        to[2 * ndim] = -1.0;
        hs_restore_vectors(to, vector, sign, 2, ndim, larger);
        for (int k = 0; k < ndim; k++) {
            CHECK(to[k] == 8.0 * (1.0 + k));
            CHECK(to[ndim + k] == (k == 0 ? 0.0 : -8.0 * (10.0 + k)));
        }
        CHECK(!signbit(to[ndim])); /* a zero has no sign */
        CHECK(to[2 * ndim] == -1.0);
    }
}

void
test_measures(void)
{
    RUN(batches_have_the_bits_of_single_pairs);
    RUN(measures_come_to_the_callers_unit);
}
