/* SPDX-License-Identifier: BSD-3-Clause */
/* test_search_reuse.c: cells that are kept answer as cells of their own do, whatever they were
 * built for. */
#include "../support/output_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"
#include "../support/search_unit.h"

#include "../../../csrc/core/search/search_open.h"

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

/* Cells in a lattice whose normals miss the periods by nearly half: ranges have no end, and the
 * search is refused as one without cells is. */
static void
cells_that_cannot_be_narrowed_are_refused(void)
{
    static search_unit built;
    const hs_box       box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    const hs_sets      sets = {.points = &built.points, .built = &built.search};
    hs_call            call;
    hs_search          search;
    hs_failure         failure = HS_NO_FAILURE;
    hs_options         options = hs_options_default();
    search_unit_points(12, 4, 2, 1.0, &built);
    search_unit_open(&box, 21.0, false, HS_WANT_I, &built);
    options.cutoff = 20.0;
    options.threads = 1;
    for (int bad = 0; bad < 2; bad++) {
        if (bad) {
            const double normals[2][2] = {{0.55, 0.0}, {0.0, 1.0}};
            built.search.scene.lattice.aligned = false;
            for (int k = 0; k < 2; k++)
                memcpy(built.search.scene.lattice.normal[k], normals[k], sizeof normals[k]);
        }
        hs_call_begin(&options, &call);
        CHECK(hs_search_reuse(&sets, &call, &search, &failure) == (bad ? HS_ERR_MEMORY : HS_OK));
        if (!bad)
            hs_search_close(&search);
        hs_call_dismiss(&call);
        CHECK(call.account.held == 0);
        hs_account_close(&call.account);
    }
    search_unit_close(&built);
}

void
test_search_reuse(void)
{
    RUN(cells_that_cannot_be_narrowed_are_refused);
    RUN(cells_for_another_precision_or_cutoff_serve);
    RUN(bad_options_are_refused_in_cells_too);
}
