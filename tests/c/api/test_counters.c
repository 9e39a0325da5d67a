/* SPDX-License-Identifier: BSD-3-Clause */
/* test_counters.c: what is not needed is left out, by the search's own account of its bytes. */
#include "../../../csrc/core/base/want.h"
#include "../../../csrc/core/scene/points.h"

#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_counters(void);

static random_scene shared;

static brute_scene *
scene_of(scene_kind kind, int ndim)
{
    harness_random random = {90210};
    make_scene(&random, kind, ndim, 300, 4.0, 0, &shared);
    shared.scene.cutoff = 1.0;
    return &shared.scene;
}

static hs_counters
counters_of(const brute_scene *scene, unsigned want, bool sorted)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    hs_counters     counters;
    hs_pairs       *pairs = NULL;
    memset(&counters, 0x5a, sizeof counters);
    options.want = want;
    options.sorted = sorted;
    options.counters = &counters;
    CHECK(hs_pairs_find(AMONG(&points, scene->box), &options, &pairs, NULL) == HS_OK);
    CHECK(counters.pairs == hs_pairs_length(pairs));
    hs_pairs_free(pairs);
    return counters;
}

/* d numbers for each point, once, for they are sorted where they are; and no z in the plane. */
static void
points_have_as_many_coordinates_as_axes(void)
{
    for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
        const brute_scene *scene = scene_of(SCENE_OPEN, ndim);
        const hs_counters  open = counters_of(scene, HS_WANT_I | HS_WANT_J, false);
        const int64_t      pitch = hs_column_pitch(scene->n, sizeof(double));
        CHECK(open.bytes[HS_FOR_POINTS] == ndim * 8 * pitch + HS_COLUMN_PADDING);
    }
    const hs_counters plane = counters_of(scene_of(SCENE_OPEN, 2), HS_WANT_I, false);
    const hs_counters space = counters_of(scene_of(SCENE_OPEN, 3), HS_WANT_I, false);
    const int64_t     block = 300 + HS_GROUP_POINTS;              /* all points are in reach */
    const int64_t     room = (block + HS_PADDING + 15) / 16 * 16; /* whole cache lines of floats */
    const int64_t     batch = HS_BATCH + HS_BATCH_PADDING;
    /* float32 candidates; for decisions both points of each pair of a batch: records of candidates
     * are of one size */
    const int64_t more =
        space.bytes[HS_FOR_CANDIDATES] - plane.bytes[HS_FOR_CANDIDATES] - 4 * room - 2 * 8 * batch;
    CHECK(more >= 0 && more <= 9 * (int64_t)sizeof(hs_run)); /* runs: one a row of the stencil */
}

static void
open_space_has_no_wraps_and_no_originals(void)
{
    for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
        for (unsigned want = 0; want <= HS_WANT_ALL; want++) {
            const hs_counters c = counters_of(scene_of(SCENE_OPEN, ndim), want, want / 3 % 2);
            CHECK(c.bytes[HS_FOR_WRAPS] == 0);
            CHECK(c.bytes[HS_FOR_ORIGINALS] == 0);
            CHECK((want & HS_WANT_SHIFT) || c.bytes[HS_FOR_SHIFTS] == 0);
        }
    }
}

/* A box that is aligned needs no originals, and turns only where S is asked for. */
static void
aligned_boxes_keep_no_originals(void)
{
    for (unsigned want = 0; want <= HS_WANT_ALL; want++) {
        const hs_counters c = counters_of(scene_of(SCENE_ALIGNED, 3), want, want / 3 % 2);
        CHECK(c.bytes[HS_FOR_ORIGINALS] == 0);
        CHECK((c.bytes[HS_FOR_WRAPS] == 0) == !(want & HS_WANT_SHIFT));
    }
    const hs_counters c = counters_of(scene_of(SCENE_TRICLINIC, 3), HS_WANT_I, false);
    CHECK(c.bytes[HS_FOR_ORIGINALS] > 0 && c.bytes[HS_FOR_WRAPS] > 0);
}

/* Bytes of a quantity: none unless it was asked for, and then at least what it takes. */
static bool
is_counted(const hs_counters *c, hs_purpose purpose, bool wanted, int64_t bytes)
{
    return wanted ? c->bytes[purpose] >= c->pairs * bytes : c->bytes[purpose] == 0;
}

static void
nothing_is_kept_that_nobody_asked_for(void)
{
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        for (unsigned want = 0; want <= HS_WANT_ALL; want++) {
            const hs_counters c = counters_of(scene_of(kind, 2), want, false);
            const bool both = want & HS_WANT_BOTH, i = want & HS_WANT_I, j = want & HS_WANT_J;
            CHECK(is_counted(&c, HS_FOR_INDICES, i || j || both, 8 * (i + j + 2 * both)));
            CHECK(is_counted(&c, HS_FOR_DISTANCES, want & HS_WANT_DISTANCE, 8));
            CHECK(is_counted(&c, HS_FOR_VECTORS, want & HS_WANT_VECTOR, 16));
            CHECK(is_counted(&c, HS_FOR_SHIFTS, want & HS_WANT_SHIFT, 8));
            CHECK(c.bytes[HS_FOR_SORTING] == 0);
            CHECK(c.pairs > 100);
        }
    }
}

/* Sorting may need i and j, and S where a pair has several images, but never d and D. */
static void
sorting_keeps_no_measures_of_its_own(void)
{
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        for (unsigned want = 0; want <= HS_WANT_ALL; want++) {
            const hs_counters c = counters_of(scene_of(kind, 2), want, true);
            CHECK(is_counted(&c, HS_FOR_DISTANCES, want & HS_WANT_DISTANCE, 8));
            CHECK(is_counted(&c, HS_FOR_VECTORS, want & HS_WANT_VECTOR, 16));
            CHECK(c.bytes[HS_FOR_SORTING] >= c.pairs * 8);
        }
    }
}

/* Counting holds no pairs, and no more of the points than i and j would. */
static void
counting_keeps_no_pairs(void)
{
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        const brute_scene *scene = scene_of(kind, 3);
        const hs_points    points = points_of(scene);
        hs_options         options = options_of(scene);
        hs_counters        c;
        int64_t            count = -1;
        options.want = WANT_ALL | HS_WANT_BOTH; /* ignored */
        options.sorted = true;
        options.counters = &c;
        CHECK(hs_pairs_count(AMONG(&points, scene->box), &options, &count, NULL) == HS_OK);
        CHECK(c.pairs == count && count > 100);
        for (int purpose = HS_FOR_INDICES; purpose <= HS_FOR_SORTING; purpose++) {
            CHECK(c.bytes[purpose] == 0);
        }
        const hs_counters found = counters_of(scene, HS_WANT_I | HS_WANT_J, false);
        CHECK(c.bytes[HS_FOR_WRAPS] == found.bytes[HS_FOR_WRAPS]);
        CHECK(c.bytes[HS_FOR_ORIGINALS] == found.bytes[HS_FOR_ORIGINALS]);
        /* In a small scene the room for hits is less than what each thread takes for itself. */
        CHECK(kind == SCENE_OPEN || c.bytes[HS_FOR_CANDIDATES] < found.bytes[HS_FOR_CANDIDATES]);
        CHECK(c.candidates == found.candidates && c.groups == found.groups);
    }
}

/* At any scale of the numbers, with a cutoff that some pairs have as their distance or of zero, and
 * beside a point so far away that squares of differences overflow. */
static void
every_unsure_pair_is_decided_by_one_stage(void)
{
    enum { MANY = 90 };
    static const double sizes[] = {1.0, 0x1p-1000, 0x1p900};
    harness_random      random = {41};
    for (int trial = 0; trial < 72; trial++) {
        double          x[MANY * HS_MAX_DIM];
        const int       d = 1 + trial % 3;
        const bool      is_zero = trial / 3 % 2, is_far = trial / 6 % 2;
        const double    size = sizes[trial / 12 % 3];
        const hs_points points = {x, MANY, d, HS_FLOAT64, 8 * d, 8};
        hs_options      options = hs_options_default();
        hs_counters     c;
        int64_t         count, n = 0;
        for (int e = 0; e < MANY * d; e++)
            x[e] = (double)(random_bits(&random) % 8) / 8.0 * size;
        if (is_far)
            x[0] = 0x1p1000;
        options.cutoff = is_zero ? 0.0 : 0.25 * size;
        options.counters = &c;
        for (int i = 0; i < MANY; i++) {
            for (int j = i + 1; j < MANY; j++) {
                double square = 0.0;
                for (int k = 0; k < d; k++) {
                    const double along = (x[i * d + k] - x[j * d + k]) / size;
                    square += along * along;
                }
                n += square <= (is_zero ? 0.0 : 0.0625);
            }
        }
        CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &count, NULL) == HS_OK);
        CHECK(count == n && c.pairs == n);
        CHECK(c.ambiguous > 0 && c.by_float64 + c.by_double_word + c.by_integers == c.ambiguous);
    }
}

void
test_counters(void)
{
    RUN(every_unsure_pair_is_decided_by_one_stage);
    RUN(points_have_as_many_coordinates_as_axes);
    RUN(open_space_has_no_wraps_and_no_originals);
    RUN(aligned_boxes_keep_no_originals);
    RUN(nothing_is_kept_that_nobody_asked_for);
    RUN(sorting_keeps_no_measures_of_its_own);
    RUN(counting_keeps_no_pairs);
}
