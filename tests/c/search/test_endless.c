/* SPDX-License-Identifier: BSD-3-Clause */
/* test_endless.c: searches with more pairs than can be counted or held end soon, with a status that
 * says so, and may be interrupted before. */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/among.h"

void test_endless(void);

enum { CROWD = 200000 };

/* Cutoffs of many box lengths, to more than can be counted, and more than float64 tells apart. */
static void
too_many_images_are_refused(void)
{
    static const double cutoffs[] = {1e9, 1e10, 1e14, 1e18, 1e100, 1e300};
    const double        x[] = {0.25, 0.5, 0.75, 0.125};
    for (int c = 0; c < 6; c++) {
        for (int trial = 0; trial < 8; trial++) {
            const int       ndim = 1 + trial % 2;
            const bool      skewed = trial / 2 % 2 == 1;
            const hs_box    box = {.ndim = ndim,
                                   .periodic = {true, true},
                                   .rows = {{1.0, 0.0}, {skewed ? 0.3 : 0.0, 1.0}}};
            const hs_points points = {x, 2, ndim, HS_FLOAT64, 8 * ndim, 8};
            hs_options      options = hs_options_default();
            hs_failure      failure;
            hs_pairs       *pairs = NULL;
            options.cutoff = cutoffs[c];
            options.cell_size = trial / 4 * 0.1;
            options.want = HS_WANT_I | HS_WANT_J;
            options.memory_limit = 1e9;
            const hs_status status =
                hs_pairs_find(AMONG(&points, &box), &options, &pairs, &failure);
            CHECK(status == HS_ERR_MEMORY);
            CHECK(pairs == NULL && failure.row == -1);
        }
    }
}

/* A hs_poll_fn. */
static bool
refuse(void *context, double fraction)
{
    (void)fraction;
    return --*(int *)context != 0;
}

/* Points that are all neighbours, of each other or of their images too. */
static void
a_crowd_is_refused_by_a_small_sample(void)
{
    const hs_box box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    double      *x = malloc(CROWD * sizeof *x);
    for (int p = 0; p < CROWD; p++)
        x[p] = p / (double)CROWD;
    for (int images = 0; images < 2; images++) {
        const hs_points points = {x, images ? CROWD / 4 : CROWD, 1, HS_FLOAT64, 8, 8};
        hs_options      options = hs_options_default();
        hs_failure      failure;
        hs_pairs       *pairs = NULL;
        int             polls = 0;
        options.cutoff = images ? 300.0 : 2.0;
        options.want = HS_WANT_I | HS_WANT_J;
        options.memory_limit = 1e8;
        options.poll = refuse;
        options.poll_context = &polls;
        CHECK(hs_pairs_find(AMONG(&points, images ? &box : NULL), &options, &pairs, &failure) ==
              HS_ERR_MEMORY);
        CHECK(pairs == NULL && failure.expected_pairs > 1e9);
        const int most = -polls;
        for (int n = 1; n <= most; n++) {
            polls = n;
            CHECK(hs_pairs_find(AMONG(&points, images ? &box : NULL), &options, &pairs, &failure) ==
                  HS_ERR_INTERRUPTED);
        }
    }
    free(x);
}

void
test_endless(void)
{
    RUN(too_many_images_are_refused);
    RUN(a_crowd_is_refused_by_a_small_sample);
}
