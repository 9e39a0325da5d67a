/* SPDX-License-Identifier: BSD-3-Clause */
/* test_scene.c: points and boxes become a scene: scaled, wrapped, bounded, or refused with the
 * point that is to blame. */
#include "../../../csrc/core/base/status.h"
#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/memory/memory.h"
#include "../../../csrc/core/scene/scene.h"
#include "../../../csrc/core/threads/call.h"
#include "../../../csrc/halfshell.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include <float.h>
#include <math.h>

void test_scene(void);

/* ---- what a scene keeps of its points, what it refuses, and that nothing is left then ---- */

enum { N_POINTS = 5 };

static hs_account account;
static hs_scene   one_scene;

static hs_points
points_in(const double *x, int64_t n, int ndim)
{
    return (hs_points){x, n, ndim, HS_FLOAT64, ndim * 8, 8};
}

static hs_options
options_for(double cutoff, unsigned want, hs_precision precision)
{
    hs_options options = hs_options_default();
    options.cutoff = cutoff;
    options.want = want;
    options.precision = precision;
    return options;
}

static void
finish(void)
{
    hs_scene_free(&account, &one_scene);
    CHECK(account.held == 0);
}

/* Where scaling loses digits the originals are those that were given. */
static void
lost_digits_are_kept(void)
{
    const double tiny[2 * N_POINTS] = {0x1.8p-1070, 1.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0};
    const hs_options options = options_for(0x1p40, HS_WANT_J, HS_EXACT);
    hs_failure       failure;
    const hs_points  points = points_in(tiny, N_POINTS, 2);
    const hs_sets    sets = {.points = &points, .is_plain = true};
    hs_account_init(&account, &options);
    CHECK(hs_scene_make(&account, NULL, &sets, NULL, &options, &one_scene, NULL, &failure) ==
          HS_OK);
    CHECK(one_scene.extreme && one_scene.keeps_originals &&
          one_scene.originals[0][0] == 0x1.8p-1070);
    CHECK(one_scene.cloud.x[0][4] == 3.0 * 0x1p-40 && one_scene.originals[0][4] == 3.0);
    CHECK(one_scene.metric.cutoff == 0x1p40 && !one_scene.turns.known);
    finish();
}

/* The first subnormal number loses a digit, which tells these points' distance from the cutoff. */
static void
digits_are_lost_from_the_subnormal_numbers_on(void)
{
    for (int below = 0; below < 4; below++) {
        const double    least = ldexp(1.0, -722 - below), ulp = ldexp(least, -52);
        const double    x[2 * 2] = {0.0, least + ulp, 0x1p300, least};
        const hs_points points = points_in(x, 2, 2);
        hs_options      options = options_for(0x1p300, HS_WANT_J, HS_EXACT);
        int64_t         n = -1;
        options.inclusive = true;
        CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &n, NULL) == HS_OK && n == 0);
    }
}

/* Coordinates of a skewed box are wrong by some units in the last place, and no more. */
static void
errors_are_bounded_and_small(void)
{
    const hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0, 1.0}, {0.0, 4.0}}};
    const double     x[4] = {1.9, 0.3, -1.7, 1.1};
    const hs_options options = options_for(0.5, HS_WANT_J, HS_EXACT);
    hs_failure       failure;
    const hs_points  points = points_in(x, 2, 2);
    const hs_sets    sets = {.points = &points};
    hs_account_init(&account, &options);
    CHECK(hs_scene_make(&account, NULL, &sets, &box, &options, &one_scene, NULL, &failure) ==
          HS_OK);
    for (int k = 0; k < 2; k++) {
        CHECK(one_scene.t_error[k] >= 4.0 * 0x1p-53 * 1.7 && one_scene.t_error[k] < 0x1p-48);
        CHECK(one_scene.x_error >= 2.0 * 0x1p-53 * 1.7 && one_scene.x_error < 0x1p-48);
        CHECK(one_scene.upper[k] == 0.5 * one_scene.lattice.period[k]);
        CHECK(one_scene.lower[k] == -one_scene.upper[k]);
    }
    finish();
}

/*
 * ---- scene queries ----
 *
 * Points and queries get one scale and bounds that hold for both, also where queries come later:
 * which of these a scene that was kept takes, step by step.
 */

static hs_scene kept;

/* A scene for queries to come, which knows the turns. */
static void
keep(const double *x, int64_t n, const hs_box *box)
{
    const hs_points points = points_in(x, n, box->ndim);
    const hs_sets   sets = {
          .points = &points, .is_kept = true, .is_full = true, .is_plain = true, .is_wide = true};
    hs_options options = hs_options_default();
    hs_failure failure;
    options.cutoff = 1.0;
    options.want = HS_WANT_SHIFT;
    hs_account_init(&account, &options);
    CHECK(hs_scene_make(&account, NULL, &sets, box, &options, &kept, NULL, &failure) == HS_OK);
}

static hs_status
ask(const double *q, int64_t n, unsigned want, hs_failure *failure)
{
    const hs_points queries = points_in(q, n, kept.ndim);
    hs_options      options = hs_options_default();
    hs_scene        asking;
    options.cutoff = 1.0;
    options.want = want;
    *failure = HS_NO_FAILURE;
    const hs_status status =
        hs_scene_from_kept(&account, NULL, &kept, &queries, &options, false, &asking, failure);
    if (status == HS_OK)
        hs_scene_free(&account, &asking);
    return status;
}

/* Queries may be four times as far away as the points. Where these are 2^50 box vectors away their
 * turns cannot be counted then: an error if they are wanted, else the queries need a scene of their
 * own that does without. */
static void
queries_too_far_to_count_get_another_scene(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    const double x[4] = {0.25, 0.5, 0x1p50, 0.5}, near[2] = {-0x1p50, 0.25};
    const double far[4] = {0.5, 0.5, 0x1.8p51, 0.25}, farther[2] = {0x1.8p52, 0.0};
    hs_failure   failure;
    keep(x, 2, &box);
    const int64_t held = account.held;
    CHECK(kept.turns.known);
    CHECK(ask(near, 1, HS_WANT_J, &failure) == HS_OK && !failure.in_queries);
    CHECK(ask(near, 1, HS_WANT_SHIFT, &failure) == HS_OK);
    CHECK(ask(far, 2, HS_WANT_J, &failure) == HS_REBUILD && !failure.in_queries);
    CHECK(ask(far, 2, HS_WANT_SHIFT, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(failure.in_queries && failure.row == 1);
    CHECK(ask(farther, 1, HS_WANT_SHIFT, &failure) == HS_REBUILD); /* not even tried */
    CHECK(account.held == held);
    hs_scene_free(&account, &kept);
    CHECK(account.held == 0);
}

/* Scenes that no scale holds, and scenes whose scale has lost digits, take no query. */
static void
scenes_that_hold_nothing_take_nothing(void)
{
    const hs_box box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    const double x[2] = {0.25, 0.5};
    hs_failure   failure;
    keep(x, 2, &box);
    CHECK(ask(x, 2, HS_WANT_J, &failure) == HS_OK);
    kept.extreme = true;
    CHECK(ask(x, 2, HS_WANT_J, &failure) == HS_REBUILD);
    kept.extreme = false;
    kept.in_one_cell = true;
    CHECK(ask(x, 2, HS_WANT_J, &failure) == HS_REBUILD);
    kept.in_one_cell = false;
    kept.x_error = kept.t_error[0] = 0.0; /* of an aligned box: these hold for all */
    CHECK(ask(x, 2, HS_WANT_J, &failure) == HS_OK);
    kept.x_largest[0] = 0.25; /* queries lie beyond */
    CHECK(ask(x, 2, HS_WANT_J, &failure) == HS_REBUILD);
    hs_scene_free(&account, &kept);
}

/* Of queries for cells the farthest number, or the first that no kept scene takes. */
static void
what_is_refused_is_named(void)
{
    const hs_box    box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    const double    x[4] = {0.25, 0.5, 0.75, 0.5}, q[6] = {1.0, -2.0, 3.0, -4.0, 2.0, 0.0};
    const double    far[6] = {1.0, 0x1p1000, 0x1p1020, 0.0, 0.0, 0.0};
    const hs_points queries = points_in(q, 3, 2), too_far = points_in(far, 3, 2);
    hs_failure      failure = HS_NO_FAILURE;
    keep(x, 2, &box);
    hs_scene_name_refused(&kept, &queries, &failure);
    CHECK(failure.in_queries && failure.row == 1 && failure.column == 1 && failure.value == -4.0);
    hs_scene_name_refused(&kept, &too_far, &failure);
    CHECK(failure.in_queries && failure.row == 0 && failure.column == 1);
    CHECK(failure.value == 0x1p1000);
    failure = HS_NO_FAILURE;
    hs_test_fail_allocation(1);
    hs_scene_name_refused(&kept, &queries, &failure);
    hs_test_fail_allocation(0);
    CHECK(!failure.in_queries && failure.row == -1);
    kept.in_one_cell = true;
    hs_scene_name_refused(&kept, &queries, &failure);
    CHECK(!failure.in_queries && failure.row == -1);
    hs_scene_free(&account, &kept);
}

/* What is larger, or what scaling would round, is not taken; for cells alone it is. */
static void
queries_that_fit_are_taken(void)
{
    const hs_box aligned = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    const hs_box skewed = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {0.25, 1.0}}};
    const struct {
        int    exponent; /* of the scale */
        bool   is_untested, is_skewed, is_empty, taken;
        double small, large; /* coordinates of the query */
    } cases[] = {{0, false, false, false, true, 0x1p-1000, 1024.0},
                 {0, false, false, false, false, 0x1p-1000, 0x1.0000000000001p10},
                 {22, false, false, false, true, 0x1p-1000, 2.0}, /* the least normal number */
                 {23, false, false, false, false, 0x1p-1000, 2.0},
                 {23, false, false, false, true, 0.0, 0.0}, /* nothing to lose */
                 {23, true, false, false, true, 0x1p-1000, 2.0},
                 {0, true, false, false, true, 0.0, 0x1p900},
                 {0, true, false, false, false, 0.0, 0x1.1p900},
                 {0, true, true, false, false, 0.0, 2048.0},
                 {0, false, true, true, true, 0.0, 2048.0},
                 {-2000, false, true, true, false, 0.0, 0x1p1000}};
    const double x[4] = {0.25, 0.5, 0.25, 0.5};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        const double q[2] = {cases[c].small, cases[c].large};
        hs_failure   failure;
        keep(x, cases[c].is_empty ? 0 : 2, cases[c].is_skewed ? &skewed : &aligned);
        kept.scale = hs_scale_of(cases[c].exponent);
        kept.is_untested = cases[c].is_untested;
        CHECK(ask(q, 1, HS_WANT_J, &failure) == (cases[c].taken ? HS_OK : HS_REBUILD));
        hs_scene_free(&account, &kept);
    }
}

/*
 * ---- scene scale ----
 *
 * Whether gaps are closed, which cutoff and scale a scene goes by, and why some boxes have none.
 */

/* A box that vanishes beside the cutoff has no scale: it is too skewed, unless it lies along the
 * coordinate axes or its vectors themselves are so short that their images have no end. */
static void
endless_images_are_refused_for_their_number(void)
{
    const double    x[6] = {0.0, 0.0, 0.0, 0.25, 0.0, 0.25};
    const hs_points points = points_in(x, 2, 3);
    for (int tilted = 0; tilted < 2; tilted++) {
        for (int is_short = 0; is_short < 2; is_short++) {
            const double     least = is_short ? 0x1p-950 : 1.0;
            const hs_box     box = {.ndim = 3,
                                    .periodic = {true, true, true},
                                    .rows = {{least}, {least, 0x1p-950}, {tilted * 0.375, 0.0, 1.0}}};
            const hs_options options = options_for(1.0, HS_WANT_J, HS_EXACT);
            hs_failure       failure = HS_NO_FAILURE;
            int64_t          n = -1;
            const hs_status  status = hs_pairs_count(AMONG(&points, &box), &options, &n, &failure);
            const bool       is_skewed = tilted && !is_short;
            CHECK(status == (is_skewed ? HS_ERR_BOX_SKEWED : HS_ERR_MEMORY));
            CHECK(failure.expected_pairs == (is_skewed ? 0.0 : INFINITY));
            CHECK(failure.expected_bytes == (is_skewed ? 0.0 : INFINITY));
        }
    }
}

/* ---- how far what is computed with may be from the numbers that were given ---- */

/* Two dimensions, the first of them periodic with a period of 4. */
static void
put_scene(hs_scene *scene)
{
    const hs_box box = {.ndim = 2, .periodic = {true, false}, .rows = {{4.0}, {0.0, 1.0}}};
    memset(scene, 0, sizeof *scene);
    scene->ndim = 2;
    scene->scale = scene->unscale = hs_scale_of(0);
    hs_lattice_init(&box, 2, hs_scale_of(0), &scene->lattice);
}

static double widths[2], asked_enough;

static hs_status
width_along(const void *context, const double *normal, double enough, double *width)
{
    CHECK(context == widths && normal[0] + normal[1] == 1.0);
    asked_enough = enough;
    *width = widths[normal[1] > 0.5];
    return *width == HUGE_VAL ? HS_ERR_INTERRUPTED : HS_OK;
}

/* Where pairs are surely narrower, by a fifth at least: in the scene's unit, which is half of the
 * caller's, and less of what the formula may err by. */
static void
scenes_are_narrowed_by_what_is_sure(void)
{
    static const struct {
        double formula_error, width[2], less[2];
    } cases[] = {{0.0, {0.1, 0.45}, {0.8, 0.0}},
                 {0.5, {0.3, 0.1}, {0.0, 0.3}},
                 {0.0, {0.39, 0.4}, {0.22, 0.0}},
                 {0.0, {0.0, 1.0}, {1.0, 0.0}}};
    const hs_narrowing narrowing = {width_along, widths};
    hs_scene           scene;
    put_scene(&scene);
    scene.radius = 1.0;
    scene.scale = hs_scale_of(-1);
    scene.unscale = hs_scale_of(1);
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        scene.formula_error = cases[c].formula_error;
        memcpy(widths, cases[c].width, sizeof widths);
        CHECK(hs_scene_narrow(&scene, &narrowing) == HS_OK);
        CHECK(asked_enough == 0.8 * 0.5);
        for (int k = 0; k < 2; k++) {
            const double less = cases[c].less[k];
            CHECK(less == 0.0 ? scene.less[k] == 0.0
                              : scene.less[k] < less && scene.less[k] > less - 1e-9);
            CHECK(hs_scene_radius_along(&scene, k) == 1.0 - scene.less[k]);
        }
    }
    CHECK(scene.less[0] > 0.9);
    widths[1] = HUGE_VAL;
    CHECK(hs_scene_narrow(&scene, &narrowing) == HS_ERR_INTERRUPTED);
}

/*
 * ---- scene wrap ----
 *
 * Points too far away for their turns to be counted, or to be scaled, are wrapped first where S is
 * not wanted, if it is known what their coordinates repeat after; S they cannot have.
 */

static void
far_points_are_wrapped_where_their_period_is_known(void)
{
    const struct {
        hs_box    box;
        double    x, y, cutoff; /* of the first point; the second one is at 0.5, 0.25 cutoffs */
        hs_status status;
    } cases[] = {
        /* Three columns, of which one is by itself: its turns pass 2^51. */
        {{3, {true, true, true}, {{1.0, 0.0, 0.0}, {0.25, 1.0, 0.0}, {0.0, 0.0, 1.0}}},
         0x1p52 + 0.0,
         0.25,
         0.5,
         HS_OK},
        {{3, {true, true, true}, {{1.0, 0.0, 0.0}, {0.25, 1.0, 0.0}, {0.0, 0.0, 1.0}}},
         -0x1p70,
         0.25,
         0.5,
         HS_OK},
        /* Sheared by whole widths: the short basis is aligned, and tells the period. */
        {{3, {true, true, true}, {{0.0, 0.0, 0x1p-200}, {0.0, 0x1p-200, 0x1p-200}, {0x1p-200}}},
         0x1p1000,
         0x1p-202,
         0x1p-201,
         HS_OK},
        /* A column that two box vectors move, and no period that is known. */
        {{3, {true, true, true}, {{1.0, 0.0, 0.25}, {0.25, 1.0, 0.0}, {0.0, 0.0, 1.0}}},
         0x1p70,
         0.25,
         0.5,
         HS_ERR_SHIFT_RANGE},
    };
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        const double    near = cases[c].y;
        const double    x[6] = {0.0, near, cases[c].x, 0.0, near, 0.0};
        const hs_points points = points_in(x, 2, 3);
        hs_options      options = options_for(cases[c].cutoff, HS_WANT_J, HS_EXACT);
        int64_t         n = -1, folded = -2;
        hs_pairs       *pairs = NULL;
        hs_failure      failure = HS_NO_FAILURE;
        CHECK(hs_pairs_count(AMONG(&points, &cases[c].box), &options, &n, &failure) ==
              cases[c].status);
        if (cases[c].status == HS_OK) { /* a whole number of periods away */
            const double    same[6] = {0.0, near, 0.0, 0.0, near, 0.0};
            const hs_points at_home = {same, 2, 3, HS_FLOAT64, 24, 8};
            CHECK(hs_pairs_count(AMONG(&at_home, &cases[c].box), &options, &folded, NULL) == HS_OK);
            CHECK(n == folded && n > 0);
        }
        options.want |= HS_WANT_SHIFT;
        CHECK(hs_pairs_find(AMONG(&points, &cases[c].box), &options, &pairs, &failure) ==
              HS_ERR_SHIFT_RANGE);
        CHECK(failure.row == 0);
    }
}

/* Points are wrapped slab by slab: of those that cannot be the first is named. */
static void
the_first_that_cannot_be_wrapped_is_named(void)
{
    enum { SOME = 2 * HS_SLAB_POINTS + 100 };
    const hs_box    box = {1, {true}, {{1.0}}};
    const int64_t   far[3] = {HS_SLAB_POINTS + 7, 2 * HS_SLAB_POINTS + 3, 40};
    static double   x[SOME];
    const hs_points points = {x, SOME, 1, HS_FLOAT64, 8, 8};
    const hs_sets   sets = {.points = &points, .is_plain = true};
    for (int i = 0; i < SOME; i++)
        x[i] = 0.25;
    for (int k = 0; k < 3; k++) {
        const hs_options options = options_for(0.25, HS_WANT_SHIFT, HS_EXACT);
        hs_failure       failure = HS_NO_FAILURE;
        x[far[k]] = 0x1p52;
        hs_account_init(&account, &options);
        CHECK(hs_scene_make(&account, NULL, &sets, &box, &options, &one_scene, NULL, &failure) ==
              HS_ERR_SHIFT_RANGE);
        CHECK(failure.row == far[k == 2 ? 2 : 0]);
        finish();
    }
}

/* ---- the power of two that a scene is scaled by, and how far far is ---- */

/* The cutoff that a scene of points at these two places goes by. */
static double
cutoff_of(double low, double high, const hs_box *box, double cutoff)
{
    const double     x[2] = {low, high};
    const hs_points  points = {x, 2, 1, HS_FLOAT64, 8, 8};
    const hs_sets    sets = {.points = &points};
    const hs_options options = options_for(cutoff, HS_WANT_J, HS_EXACT);
    hs_failure       failure;
    hs_account_init(&account, &options);
    CHECK(hs_scene_make(&account, NULL, &sets, box, &options, &one_scene, NULL, &failure) == HS_OK);
    finish();
    return one_scene.sought;
}

/* A cutoff far beyond all distances is as good as one that is 2^8 times the largest coordinate. */
static void
cutoffs_beyond_everything_become_smaller(void)
{
    const hs_box box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    CHECK(cutoff_of(-3.0, 1.0, NULL, 192.0) == 192.0); /* 64 times as much is not enough */
    CHECK(cutoff_of(-3.0, 1.0, NULL, 256.0) == 256.0);
    CHECK(cutoff_of(-3.0, 1.0, NULL, 512.0) == 512.0);
    CHECK(cutoff_of(-3.0, 1.0, NULL, 513.0) == 512.0);
    CHECK(cutoff_of(-3.0, 1.0, NULL, DBL_MAX) == 512.0);
    CHECK(cutoff_of(-3.0, 1.0, &box, 513.0) == 513.0); /* images are at any distance */
    CHECK(cutoff_of(0.0, 0.0, NULL, 513.0) == 513.0);
    CHECK(cutoff_of(0.0, 0x1p1015, NULL, DBL_MAX) == 0x1p1023);
    CHECK(cutoff_of(0.0, 0x1p1016, NULL, DBL_MAX) == DBL_MAX);
}

/*
 * ---- snapshot ----
 *
 * The copy of one step's points: every type and layout, the first number that is not finite, and
 * which frames a list can go from to which.
 */

static hs_status
take(const hs_points *points, hs_frame *frame, hs_failure *failure)
{
    const hs_options options = hs_options_default();
    *failure = HS_NO_FAILURE;
    return hs_frame_take(points, NULL, &options, frame, failure);
}

/* Row-major with gaps, column-major, reversed, one row for all: the copy has no gaps. */
static void
any_layout_is_copied(void)
{
    enum { N = 37, D = 3 };
    static float  f[2 * N * D + 8];
    static double x[2 * N * D + 8];
    for (int e = 0; e < 2 * N * D + 8; e++) {
        f[e] = (float)(e * 0.5 - 20.0);
        x[e] = -e * 0.1;
    }
    const struct {
        ptrdiff_t row, column; /* in entries */
        int64_t   first;
        int       ndim;
    } layouts[] = {{D, 1, 0, D},     {2 * D, 1, 0, D}, {1, N, 0, D}, {-D, 1, (N - 1) * D, D},
                   {0, 1, 5, D},     {2 * D, 2, 0, D}, {1, 7, 0, 1}, {2, 7, 0, 1},
                   {D, -1, D - 1, D}};
    hs_frame frame = {0};
    for (int l = 0; l < 18; l++) {
        const bool    narrow = l >= 9;
        const int     d = layouts[l % 9].ndim;
        const int64_t size = narrow ? sizeof(float) : sizeof(double), first = layouts[l % 9].first;
        double        largest = 0.0;
        hs_failure    failure;
        hs_points     points = {.n = N, .ndim = d, .real = narrow ? HS_FLOAT32 : HS_FLOAT64};
        points.data = narrow ? (const void *)(f + first) : (const void *)(x + first);
        points.row_stride = layouts[l % 9].row * size;
        points.column_stride = layouts[l % 9].column * size;
        CHECK(take(&points, &frame, &failure) == HS_OK);
        CHECK(frame.points.row_stride == d * size && frame.points.column_stride == size);
        for (int64_t i = 0; i < N; i++) {
            for (int k = 0; k < d; k++) {
                const int64_t from = first + i * layouts[l % 9].row + k * layouts[l % 9].column;
                const double  expected = narrow ? f[from] : x[from];
                CHECK(hs_frame_entry(frame.points.data, points.real, i * d + k) == expected);
                largest = fmax(largest, fabs(expected));
            }
        }
        CHECK(frame.largest == largest);
    }
    hs_frame_free(&frame);
    hs_frame_free(&frame);
}

static void
the_first_that_is_not_finite_is_named(void)
{
    enum { N = 50 };
    float        f[2 * N];
    double       x[2 * N];
    const double bad[] = {NAN, INFINITY, -INFINITY};
    hs_frame     frame = {0};
    hs_failure   failure;
    for (int trial = 0; trial < 4 * N; trial++) {
        const int at = trial / 2;
        for (int e = 0; e < 2 * N; e++) {
            f[e] = (float)e;
            x[e] = e % 2 ? DBL_MAX : -DBL_MAX; /* sums of these would not be finite */
        }
        f[at] = (float)bad[at % 3];
        x[at] = bad[at % 3];
        if (trial % 2) /* alone, or not the only one */
            f[2 * N - 1] = (float)(x[2 * N - 1] = NAN);
        const hs_points narrow = {f, N, 2, HS_FLOAT32, 8, 4}, wide = {x, N, 2, HS_FLOAT64, 16, 8};
        for (int w = 0; w < 2; w++) {
            CHECK(take(w ? &wide : &narrow, &frame, &failure) == HS_ERR_NOT_FINITE);
            CHECK(failure.row == at / 2 && failure.column == at % 2);
            CHECK(!isfinite(failure.value));
        }
    }
    for (int e = 0; e < 2 * N; e++)
        x[e] = e % 2 ? DBL_MAX : -DBL_MAX;
    const hs_points all = {x, N, 2, HS_FLOAT64, 16, 8};
    CHECK(take(&all, &frame, &failure) == HS_OK && frame.largest == DBL_MAX);
    hs_frame_free(&frame);
}

/* One number for all points takes no memory to give, and some to copy. */
static void
large_frames_can_be_stopped(void)
{
    const int64_t   n = 2 * HS_POLL_POINTS + 5;
    const float     x = -2.5f;
    const hs_points points = {&x, n, 1, HS_FLOAT32, 0, 0};
    hs_options      options = hs_options_default();
    hs_frame        frame = {0};
    hs_failure      failure = HS_NO_FAILURE;
    int64_t         polls = 0;
    options.poll = stop_after;
    options.poll_context = &polls;
    CHECK(hs_frame_take(&points, NULL, &options, &frame, &failure) == HS_ERR_INTERRUPTED);
    polls = 1;
    CHECK(hs_frame_take(&points, NULL, &options, &frame, &failure) == HS_ERR_INTERRUPTED);
    polls = 2;
    CHECK(hs_frame_take(&points, NULL, &options, &frame, &failure) == HS_OK && polls == 0);
    CHECK(frame.largest == 2.5 && hs_frame_entry(frame.points.data, HS_FLOAT32, n - 1) == -2.5);
    hs_frame_free(&frame);
}

/* As many, of one type and dimension, in boxes that repeat along the same axes. */
static void
frames_match_or_do_not(void)
{
    const double     x[12] = {0.0};
    const hs_options options = hs_options_default();
    hs_box           box = {.ndim = 2, .periodic = {true, false}, .rows = {{1, 0}, {0, 1}}};
    const hs_box     longer = {.ndim = 2, .periodic = {true, false}, .rows = {{1, 0.5}, {0, 7}}};
    const hs_box     wide = {.ndim = 2, .periodic = {true, false}, .rows = {{1, 0}, {9, 9}}};
    const hs_box     other = {.ndim = 2, .periodic = {false, true}, .rows = {{1, 0}, {0, 1}}};
    const hs_box     both = {.ndim = 2, .periodic = {true, true}, .rows = {{1, 0}, {0, 1}}};
    const hs_points  one = {x, 5, 2, HS_FLOAT64, 16, 8}, fewer = {x, 4, 2, HS_FLOAT64, 16, 8};
    const hs_points  narrow = {x, 5, 2, HS_FLOAT32, 8, 4}, flat = {x, 5, 1, HS_FLOAT64, 8, 8};
    const struct {
        const hs_points *points;
        const hs_box    *box;
        bool             matches;
    } cases[] = {{&one, &box, true},    {&one, &longer, true}, {&one, &wide, true},
                 {&fewer, &box, false}, {&flat, NULL, false},  {&narrow, &box, false},
                 {&one, &both, false},  {&one, &other, false}, {&one, NULL, false}};
    hs_frame   base = {0}, frame = {0};
    hs_failure failure = HS_NO_FAILURE;
    CHECK(hs_frame_take(&one, &box, &options, &base, &failure) == HS_OK);
    for (int c = 0; c < 9; c++) {
        CHECK(hs_frame_take(cases[c].points, cases[c].box, &options, &frame, &failure) == HS_OK);
        CHECK(hs_frames_match(&base, &frame) == cases[c].matches);
        CHECK(hs_frames_match(&frame, &base) == cases[c].matches);
        if (cases[c].matches)
            CHECK(hs_frames_share_box(&base, &frame) == (c != 1));
    }
    hs_frame_free(&base);
    hs_frame_free(&frame);
}

/* ---- while far points are drawn together, allocations may fail and polls may say no ---- */

enum { FAR = HS_POLL_POINTS + 1000 };

/* Many cutoffs lie between any two points, but for images of the same. */
static void
check_each_allocation(double scale)
{
    double          x[] = {0.25, 0.0, 4096.25, 0.0, 0.0, 1e200, -1e9, 1e200};
    const hs_points points = {x, 4, 2, HS_FLOAT64, 16, 8};
    const hs_box    box = {.ndim = 2, .periodic = {true, false}, .rows = {{scale, 0.0}}};
    hs_options      options = hs_options_default();
    hs_status       status = HS_ERR_MEMORY;
    bool            ended = false;
    int             nth = 0, n_failed = 0;
    for (int e = 0; e < 8; e++)
        x[e] *= scale;
    options.cutoff = 1e-60 * scale;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
    options.sorted = true;
    while (!ended && nth < 200) {
        const int64_t before = hs_test_live_blocks();
        hs_pairs     *pairs = NULL;
        hs_test_fail_allocation(++nth);
        status = hs_pairs_find(AMONG(&points, &box), &options, &pairs, NULL);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || (status == HS_ERR_MEMORY && pairs == NULL));
        n_failed += status != HS_OK;
        if (status == HS_OK) {
            const int32_t *shift = hs_pairs_array(pairs, HS_WANT_SHIFT);
            CHECK(hs_pairs_length(pairs) == 2);
            CHECK(hs_pairs_length(pairs) == 2 && shift[0] == -4096 && shift[2] == 1000000000);
        }
        hs_pairs_free(pairs);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && status == HS_OK && n_failed > 8);
}

/* Where the cutoff is scaled up, and where it is scaled down, so that digits may be lost. */
static void
any_allocation_may_fail(void)
{
    check_each_allocation(1.0);
    check_each_allocation(0x1p300);
}

/* So many far points that putting them in order takes a while. */
static void
any_poll_may_end_it(void)
{
    const int64_t   before = hs_test_live_blocks();
    double         *x = malloc(FAR * sizeof *x);
    const hs_points points = {x, FAR, 1, HS_FLOAT64, 8, 8};
    hs_options      options = hs_options_default();
    hs_status       status = HS_ERR_INTERRUPTED;
    int64_t         nth = 0, count = -1;
    for (int64_t p = 0; p < FAR; p++) /* but for 0, 1 and 2 each is alone */
        x[p] = p < 3 ? (double)p : 1e200 * (double)((p * 7919) % FAR + 1);
    options.cutoff = 1.0;
    options.poll_context = NULL;
    while (status != HS_OK && nth < 50) {
        refusal once = {.nth = ++nth};
        options.poll = refuse_once;
        options.poll_context = &once;
        status = hs_pairs_count(AMONG(&points, NULL), &options, &count, NULL);
        CHECK(status == (once.n >= nth ? HS_ERR_INTERRUPTED : HS_OK));
    }
    CHECK(nth > 2 && nth < 50 && count == 2);
    free(x);
    CHECK(hs_test_live_blocks() == before);
}

void
test_scene(void)
{
    RUN(lost_digits_are_kept);
    RUN(digits_are_lost_from_the_subnormal_numbers_on);
    RUN(errors_are_bounded_and_small);
    RUN(queries_that_fit_are_taken);
    RUN(what_is_refused_is_named);
    RUN(queries_too_far_to_count_get_another_scene);
    RUN(scenes_that_hold_nothing_take_nothing);
    RUN(endless_images_are_refused_for_their_number);
    RUN(scenes_are_narrowed_by_what_is_sure);
    RUN(far_points_are_wrapped_where_their_period_is_known);
    RUN(the_first_that_cannot_be_wrapped_is_named);
    RUN(cutoffs_beyond_everything_become_smaller);
    RUN(any_layout_is_copied);
    RUN(the_first_that_is_not_finite_is_named);
    RUN(large_frames_can_be_stopped);
    RUN(frames_match_or_do_not);
    RUN(any_allocation_may_fail);
    RUN(any_poll_may_end_it);
}
