/* SPDX-License-Identifier: BSD-3-Clause */
/* test_search_reuse.c: cells that are kept answer as cells of their own do, whatever they were
 * built for. */
#include "../support/output_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_search_reuse(void);

static random_scene shared;

/* Every precision and cutoff of a call, in cells of every precision and cutoff. */
static void
cells_for_another_precision_or_cutoff_serve(void)
{
    static const double factors[] = {1.0, 0.5, 1e-30, 0.0, 1.5};
    harness_random      random = {444};
    int64_t             n_pairs = 0;
    for (int trial = 0; trial < 120; trial++) {
        make_scene(&random, trial % SCENE_KINDS, 1 + trial % 3, 40, 4.0, trial % 7 == 6 ? 1010 : 0,
                   &shared);
        const hs_points points = points_of(&shared.scene);
        hs_options      options = options_of(&shared.scene);
        hs_cells       *cells = NULL;
        options.precision = trial % 2 ? HS_DOUBLE : HS_EXACT;
        CHECK(hs_cells_build(&points, shared.scene.box, &options, &cells, NULL) == HS_OK);
        for (int f = 0; f < 10; f++) {
            hs_pairs *kept = NULL, *own = NULL;
            options.cutoff = shared.scene.cutoff * factors[f / 2];
            options.precision = f % 2 ? HS_DOUBLE : HS_EXACT;
            options.want = HS_WANT_BOTH;
            options.sorted = true;
            const hs_status status =
                hs_pairs_find(AMONG(&points, shared.scene.box), &options, &own, NULL);
            CHECK(hs_pairs_find(IN_CELLS(cells), &options, &kept, NULL) == status);
            CHECK(status != HS_OK || same_array(own, kept, HS_WANT_BOTH, 16));
            n_pairs += status == HS_OK ? hs_pairs_length(own) : 0;
            hs_pairs_free(own);
            hs_pairs_free(kept);
        }
        hs_cells_free(cells);
    }
    CHECK(n_pairs > 20000);
}

static void
bad_options_are_refused_in_cells_too(void)
{
    static const double bad[] = {-1.0, NAN, INFINITY};
    harness_random      random = {4};
    make_scene(&random, SCENE_TRICLINIC, 3, 40, 4.0, 0, &shared);
    const hs_points points = points_of(&shared.scene);
    hs_options      options = options_of(&shared.scene);
    hs_cells       *cells = NULL;
    hs_pairs       *pairs = NULL;
    hs_failure      failure;
    CHECK(hs_cells_build(&points, shared.scene.box, &options, &cells, NULL) == HS_OK);
    for (int b = 0; b < 3; b++) {
        options.cutoff = bad[b];
        CHECK(hs_pairs_find(IN_CELLS(cells), &options, &pairs, &failure) == HS_ERR_CUTOFF);
        CHECK(pairs == NULL && memcmp(&failure.value, &bad[b], sizeof failure.value) == 0);
    }
    options.cutoff = shared.scene.cutoff;
    options.kernel = "none of that name";
    CHECK(hs_pairs_find(IN_CELLS(cells), &options, &pairs, &failure) == HS_ERR_KERNEL &&
          pairs == NULL);
    hs_cells_free(cells);
}

void
test_search_reuse(void)
{
    RUN(cells_for_another_precision_or_cutoff_serve);
    RUN(bad_options_are_refused_in_cells_too);
}
