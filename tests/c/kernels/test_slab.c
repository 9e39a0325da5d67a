/* SPDX-License-Identifier: BSD-3-Clause */
/* test_slab.c: the listed pairs that may be within, and which of them float32 cannot tell, by every
 * kernel of this CPU and in plain C, in every number of dimensions and shape of bundles. */
#include <math.h>
#include <string.h>

#include "../../../csrc/kernels/kernel.h"
#include "../support/harness.h"

void test_slab(void);

enum { POINTS = 40, IMAGES = 5, BEFORE = 3 };

static float        y[POINTS * 8], offset[IMAGES * 8];
static int32_t      number[POINTS], j[HS_SLAB + BEFORE + HS_PADDING + 64];
static hs_bundle    bundles[HS_SLAB + 64];
static int32_t      hits[HS_SLAB + HS_PADDING], point[HS_SLAB], hits_end[HS_SLAB];
static hs_open_pair open_pairs[HS_SLAB + 1];

/* Small whole numbers, so that squares are exact, and now and then none. */
static float
small_number(harness_random *random, bool odd)
{
    static const float odds[] = {NAN, INFINITY, -INFINITY};
    if (odd && random_bits(random) % 60 == 0) {
        return odds[random_bits(random) % 3];
    }
    return (float)(int)(random_bits(random) % 7) - 3.0f;
}

static void
make_points(harness_random *random, int ndim, bool odd)
{
    const int stride = hs_slab_stride(ndim);
    memset(y, 0, sizeof y);
    memset(offset, 0, sizeof offset);
    for (int p = 0; p < POINTS; p++) {
        for (int k = 0; k < ndim; k++) {
            y[p * stride + k] = small_number(random, odd);
        }
        number[p] = (int32_t)(random_bits(random) >> 1);
        if (hs_slab_has_numbers(ndim)) {
            memcpy(y + p * stride + stride - 1, &number[p], sizeof *number);
        }
    }
    for (int image = 0; image < IMAGES; image++) {
        for (int k = 0; k < ndim; k++) {
            offset[image * stride + k] = small_number(random, false);
        }
    }
}

/* Pairs BEFORE to BEFORE + n of a list, in bundles of up to `most`; the first begins before them,
 * and the last may end behind them. */
static void
make_bundles(harness_random *random, int32_t n, int32_t most)
{
    int64_t end = 0;
    for (size_t e = 0; e < sizeof j / sizeof *j; e++) {
        j[e] = (int32_t)(random_bits(random) % POINTS);
    }
    for (int b = 0; end < BEFORE + n; b++) {
        end += (b == 0 ? BEFORE : 0) + 1 + (int64_t)(random_bits(random) % (unsigned)most);
        bundles[b] = (hs_bundle){end, (int32_t)(random_bits(random) % POINTS),
                                 (int32_t)(random_bits(random) % IMAGES)};
    }
}

static float
square_of(int ndim, bool shifted, const hs_bundle *bundle, int64_t e)
{
    const int stride = hs_slab_stride(ndim);
    float     square = 0.0f;
    for (int k = 0; k < ndim; k++) {
        const float q = shifted ? y[bundle->point * stride + k] - offset[bundle->image * stride + k]
                                : y[bundle->point * stride + k];
        const float along = y[j[e] * stride + k] - q;
        square += along * along;
    }
    return square;
}

/* Whether what a kernel has told is right. */
static bool
is_right(const hs_slab *slab, bool shifted)
{
    const int d = slab->ndim;
    int32_t   at = 0, open = 0, b = 0;
    for (int64_t e = slab->first; e < slab->end; e++) {
        for (; bundles[b].end <= e; b++) {
            if (hits_end[b] != at) {
                return false;
            }
        }
        const float   square = square_of(d, shifted, &bundles[b], e);
        const int32_t pair = (int32_t)(e - slab->first);
        if (square > 30.0f) {
            continue;
        }
        if (at >= slab->n_hits || hits[at] != (slab->numbers ? number[j[e]] : j[e])) {
            return false;
        }
        if (!(square < 20.0f)) {
            const hs_open_pair *noted = &open_pairs[open++];
            if (open > slab->n_open || noted->bundle != b || noted->pair != pair ||
                noted->at != at) {
                return false;
            }
        }
        at++;
    }
    for (int32_t t = 0; t <= b && slab->numbers; t++) {
        if (point[t] != number[bundles[t].point]) {
            return false;
        }
    }
    return at == slab->n_hits && open == slab->n_open && b + 1 == slab->n_bundles &&
           hits_end[b] == at;
}

static void
try_all(hs_recheck_fn slab, int64_t *n_hits, int64_t *n_open)
{
    harness_random random = {44};
    for (int trial = 0; trial < 600; trial++) {
        const int     d = 1 + trial % HS_MAX_DIM;
        const int32_t n = trial < 80 ? 1 + trial : trial % 16 == 7 ? HS_SLAB : 40 + trial;
        const bool    shifted = trial / 2 % 2;
        make_points(&random, d, trial % 3 == 0);
        make_bundles(&random, n, trial % 5 == 0 ? 1 : trial % 5 == 1 ? 5000 : 60);
        hs_slab pairs = {.ndim = d,
                         .y = y,
                         .offset = shifted ? offset : NULL,
                         .j = j,
                         .bundles = bundles,
                         .first = BEFORE,
                         .end = BEFORE + n,
                         .numbers = trial % 4 != 0 && hs_slab_has_numbers(d),
                         .limit = {.in = 20.0f, .out = 30.0f},
                         .hits = hits,
                         .point = point,
                         .hits_end = hits_end,
                         .open = open_pairs};
        slab(&pairs);
        CHECK(is_right(&pairs, shifted));
        *n_hits += pairs.n_hits;
        *n_open += pairs.n_open;
    }
}

static void
every_pair_is_told_where_it_is(void)
{
    const char *names[16];
    const int   n_names = hs_kernel_names(names, 16);
    for (int k = 0; k <= n_names; k++) {
        int64_t n_hits = 0, n_open = 0;
        try_all(k < n_names ? hs_kernel_select(names[k])->recheck : hs_recheck_scalar, &n_hits,
                &n_open);
        CHECK(n_hits > 40000 && n_open > 5000);
    }
}

void
test_slab(void)
{
    RUN(every_pair_is_told_where_it_is);
}
