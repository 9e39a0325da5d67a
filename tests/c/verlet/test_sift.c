/* SPDX-License-Identifier: BSD-3-Clause */
/* test_sift.c: the pairs of a slab that may be within, and which of them float32 cannot tell, in
 * every number of pairs, stride and shape. */
#include "../../../csrc/core/verlet/sift.h"
#include "../support/harness.h"

#include <math.h>

void test_sift(void);

enum { POINTS = 40, IMAGES = 5 };

/* Small whole numbers: squares are exact. */
static float
small_number(harness_random *random)
{
    return (float)(int)(random_bits(random) % 7) - 3.0f;
}

static void
every_pair_is_told_where_it_is(void)
{
    static float   y[POINTS * 8], offset[IMAGES * 8];
    static int32_t i[HS_SIFT + 64], j[HS_SIFT + 64], code[HS_SIFT + 64];
    harness_random random = {44};
    int64_t        n_all = 0, n_unsure_all = 0;
    for (int trial = 0; trial < 200; trial++) {
        const int32_t n = trial < 40 ? trial : trial % 8 == 7 ? HS_SIFT : 40 + trial;
        const int     stride = trial % 2 ? 4 : 8;
        const bool    shifted = trial / 2 % 2;
        uint16_t      hits[HS_SIFT + 4], unsure[HS_SIFT + 4];
        int32_t       n_unsure = -1, at = 0, at_unsure = 0;
        bool          right = true;
        for (int e = 0; e < POINTS * 8; e++)
            y[e] = small_number(&random);
        for (int e = 0; e < IMAGES * 8; e++)
            offset[e] = small_number(&random);
        for (int32_t e = 0; e < n; e++) {
            i[e] = (int32_t)(random_bits(&random) % POINTS);
            j[e] = (int32_t)(random_bits(&random) % POINTS);
            code[e] = (int32_t)(random_bits(&random) % IMAGES);
        }
        const hs_sift_pairs pairs = {.n = n,
                                     .stride = stride,
                                     .i = i,
                                     .j = j,
                                     .code = shifted ? code : NULL,
                                     .y = y,
                                     .offset = offset,
                                     .limit = {.in = 20.0f, .out = 30.0f}};
        const int32_t       n_hits = hs_sift(&pairs, hits, unsure, &n_unsure);
        for (int32_t e = 0; e < n; e++) {
            float square = 0.0f;
            for (int k = 0; k < stride; k++) {
                const float along = y[j[e] * stride + k] - y[i[e] * stride + k] +
                                    (shifted ? offset[code[e] * stride + k] : 0.0f);
                square += along * along;
            }
            if (square > 30.0f)
                continue;
            right = right && at < n_hits && hits[at] == e;
            if (square >= 20.0f) {
                right = right && at_unsure < n_unsure && unsure[at_unsure] == at;
                at_unsure++;
            }
            at++;
        }
        CHECK(right && at == n_hits && at_unsure == n_unsure);
        n_all += n_hits;
        n_unsure_all += n_unsure;
    }
    CHECK(n_all > 4000 && n_unsure_all > 500);
}

void
test_sift(void)
{
    RUN(every_pair_is_told_where_it_is);
}
