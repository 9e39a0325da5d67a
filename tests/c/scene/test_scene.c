/* SPDX-License-Identifier: BSD-3-Clause */
/* test_scene.c: what a scene keeps of its points, what it refuses, and that nothing is left
 * then. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/scene/scene.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include <math.h>

void test_scene(void);

enum { N = 5 };

static hs_account   account;
static hs_scene     scene, asking;
static const hs_box upright = {.ndim = 2, .periodic = {true, false}, .rows = {{4.0}, {0.0, 1.0}}};
static const hs_box tilted = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {1.0, 4.0}}};
static const double x[2 * N] = {0.5, 1.0, 5.0, 2.0, -3.0, 0.25, 1.0, 1.0, 9.5, -1.5};

static hs_points
points_in(const double *data, int64_t n)
{
    return (hs_points){data, n, 2, HS_FLOAT64, 16, 8};
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

static hs_status
start(const double *data, const hs_box *box, const hs_options *options, hs_failure *failure)
{
    const hs_points points = points_in(data, N);
    *failure = HS_NO_FAILURE;
    hs_account_init(&account, options);
    return hs_scene_init(&account, NULL, &points, box, options, &scene, failure);
}

static void
finish(void)
{
    hs_scene_free(&account, &scene);
    CHECK(account.held == 0);
}

/* A cutoff that is no length; a number that is none, of points and of queries. */
static void
what_is_no_number_is_refused(void)
{
    const double cutoffs[] = {-1.0, -0x1p-1074, INFINITY, NAN};
    hs_failure   failure;
    hs_options   options = options_for(0.0, HS_WANT_J, HS_EXACT);
    double       bad[2 * N];
    for (int c = 0; c < 4; c++) {
        options.cutoff = cutoffs[c];
        CHECK(start(x, NULL, &options, &failure) == HS_ERR_CUTOFF);
        CHECK(memcmp(&failure.value, &cutoffs[c], sizeof(double)) == 0 && account.held == 0);
    }
    options.cutoff = 0.0;
    CHECK(start(x, NULL, &options, &failure) == HS_OK);
    finish();
    memcpy(bad, x, sizeof bad);
    bad[5] = INFINITY;
    CHECK(start(bad, NULL, &options, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == 2 && failure.column == 1 && !failure.in_queries && account.held == 0);
    const hs_points points = points_in(x, N), queries = points_in(bad, N);
    const hs_sets   sets = {.points = &points, .queries = &queries, .is_full = true};
    CHECK(hs_scene_init_sets(&account, NULL, &sets, NULL, &options, &scene, &asking, &failure) ==
          HS_ERR_NOT_FINITE);
    CHECK(failure.row == 2 && failure.in_queries && account.held == 0);
    const hs_box flat = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {2.0}}};
    CHECK(start(x, &flat, &options, &failure) == HS_ERR_BOX_DEPENDENT && account.held == 0);
}

/* Points and queries have one scale and bounds for both, and arrays of their own. */
static void
points_and_queries_share_a_scale(void)
{
    const double     q[4] = {-20.0, 3.0, 7.0, 0x1p52};
    const hs_points  points = points_in(x, N), queries = points_in(q, 2);
    const hs_sets    sets = {.points = &points, .queries = &queries, .is_full = true};
    const hs_options options = options_for(0x1p30, HS_WANT_SHIFT, HS_EXACT);
    hs_failure       failure = HS_NO_FAILURE;
    hs_account_init(&account, &options);
    CHECK(hs_scene_init_sets(&account, NULL, &sets, &upright, &options, &scene, &asking,
                             &failure) == HS_OK);
    CHECK(scene.scale.exponent == 30 && asking.scale.exponent == 30 && scene.is_asked);
    CHECK(scene.n == N && asking.n == 2 && asking.cloud.x[0] != scene.cloud.x[0]);
    CHECK(scene.upper[1] >= 0x1p22 && scene.x_largest[1] >= 0x1p22);
    CHECK(asking.cloud.x[1][1] == 0x1p22 && asking.cloud.x[0][0] == 0.0);
    CHECK(hs_turns_get(&asking.turns, 0, 0) == -5 && hs_turns_get(&asking.turns, 0, 1) == 2);
    CHECK(hs_turns_get(&scene.turns, 0, 1) == 1 && hs_turns_get(&scene.turns, 0, 0) == 0);
    hs_scene_free(&account, &asking);
    finish();
}

/* Originals are kept where X is rounded or precision="double" computes with what was given; turns
 * where originals or shifts need them. */
static void
only_what_is_needed_is_kept(void)
{
    const struct {
        const hs_box *box;
        unsigned      want;
        hs_precision  precision;
        bool          originals, turns, beside;
    } cases[] = {{NULL, HS_WANT_SHIFT, HS_EXACT, false, false, false},
                 {NULL, HS_WANT_SHIFT, HS_DOUBLE, false, false, false},
                 {&upright, HS_WANT_J, HS_EXACT, false, false, false},
                 {&upright, HS_WANT_SHIFT, HS_EXACT, false, true, false},
                 {&upright, HS_WANT_J, HS_DOUBLE, true, true, false},
                 {&tilted, HS_WANT_J, HS_EXACT, true, true, true},
                 {&tilted, HS_WANT_J, HS_DOUBLE, true, true, true}};
    for (int c = 0; c < 7; c++) {
        for (int scaled = 0; scaled < 2; scaled++) {
            const hs_options options =
                options_for(scaled ? 0x1p-30 : 1.0, cases[c].want, cases[c].precision);
            hs_failure failure;
            CHECK(start(x, cases[c].box, &options, &failure) == HS_OK);
            CHECK(scene.keeps_originals == cases[c].originals);
            CHECK(scene.turns.known == cases[c].turns && scene.x_is_beside == cases[c].beside);
            CHECK((scene.beside != NULL) == (cases[c].originals || cases[c].turns));
            for (int i = 0; scene.keeps_originals && i < N; i++) {
                CHECK(scene.originals[0][i] == ldexp(x[2 * i], 30 * scaled));
                CHECK(scene.originals[1][i] == ldexp(x[2 * i + 1], 30 * scaled));
            }
            for (int i = 0; i < N; i++) {
                double X = ldexp(x[2 * i], 30 * scaled), Y = ldexp(x[2 * i + 1], 30 * scaled);
                for (int r = 0; r < scene.lattice.n_periodic && scene.turns.known; r++) {
                    X -= (double)hs_turns_get(&scene.turns, r, i) * scene.lattice.rows[r][0];
                    Y -= (double)hs_turns_get(&scene.turns, r, i) * scene.lattice.rows[r][1];
                }
                if (scene.turns.known || cases[c].box == NULL)
                    CHECK(scene.cloud.x[0][i] == X && scene.cloud.x[1][i] == Y);
            }
            finish();
        }
    }
}

/* Where scaling loses digits the originals are those that were given. */
static void
lost_digits_are_kept(void)
{
    const double     tiny[2 * N] = {0x1.8p-1070, 1.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0};
    const hs_options options = options_for(0x1p40, HS_WANT_J, HS_EXACT);
    hs_failure       failure;
    const hs_points  points = points_in(tiny, N);
    const hs_sets    sets = {.points = &points, .is_plain = true};
    hs_account_init(&account, &options);
    CHECK(hs_scene_init_sets(&account, NULL, &sets, NULL, &options, &scene, NULL, &failure) ==
          HS_OK);
    CHECK(scene.extreme && scene.keeps_originals && scene.originals[0][0] == 0x1.8p-1070);
    CHECK(scene.cloud.x[0][4] == 3.0 * 0x1p-40 && scene.originals[0][4] == 3.0);
    CHECK(scene.metric.cutoff == 0x1p40 && !scene.turns.known);
    finish();
}

/* Turns are 32 bits wide as long as all fit. */
static void
turns_are_as_wide_as_need_be(void)
{
    const hs_options options = options_for(1.0, HS_WANT_SHIFT, HS_EXACT);
    hs_failure       failure;
    double           far[2 * N];
    memcpy(far, x, sizeof far);
    CHECK(start(x, &upright, &options, &failure) == HS_OK);
    CHECK(scene.turns.narrow[0] != NULL && scene.turns.wide[0] == NULL);
    finish();
    far[4] = 0x1p34; /* 2^32 turns */
    CHECK(start(far, &upright, &options, &failure) == HS_OK);
    CHECK(hs_turns_get(&scene.turns, 0, 1) == 1 && scene.cloud.x[0][1] == 1.0);
    finish();
    const hs_points points = points_in(far, N);
    const hs_sets   sets = {.points = &points, .is_plain = true};
    CHECK(hs_scene_init_sets(&account, NULL, &sets, &upright, &options, &scene, NULL, &failure) ==
          HS_OK);
    CHECK(scene.turns.narrow[0] == NULL && hs_turns_get(&scene.turns, 0, 2) == INT64_C(1) << 32);
    finish();
    far[4] = 0x1p60;
    CHECK(hs_scene_init_sets(&account, NULL, &sets, &upright, &options, &scene, NULL, &failure) ==
          HS_ERR_SHIFT_RANGE);
    CHECK(failure.row == 2 && account.held == 0);
}

/* The same wrapping, for points that are of the scene themselves. */
static void
points_are_wrapped_like_a_kept_scene(void)
{
    const hs_options options = options_for(1.0, HS_WANT_SHIFT, HS_EXACT);
    const hs_points  points = points_in(x, N);
    double           bad[2 * N];
    hs_failure       failure;
    CHECK(start(x, &tilted, &options, &failure) == HS_OK);
    CHECK(hs_scene_wrapped_like(&account, &scene, &points, &options, &asking, &failure) == HS_OK);
    for (int k = 0; k < 2; k++) {
        CHECK(memcmp(asking.cloud.x[k], scene.cloud.x[k], N * sizeof(double)) == 0);
        for (int i = 0; i < N; i++)
            CHECK(hs_turns_get(&asking.turns, k, i) == hs_turns_get(&scene.turns, k, i));
    }
    hs_scene_free(&account, &asking);
    const int64_t held = account.held;
    memcpy(bad, x, sizeof bad);
    bad[3] = NAN;
    const hs_points spoilt = points_in(bad, N);
    CHECK(hs_scene_wrapped_like(&account, &scene, &spoilt, &options, &asking, &failure) ==
          HS_ERR_NOT_FINITE);
    CHECK(failure.row == 1 && failure.column == 1 && account.held == held);
    finish();
}

static hs_status
make_and_free(void *context)
{
    const hs_options options = options_for(1.0, HS_WANT_SHIFT, HS_EXACT);
    const hs_points  points = points_in(x, N), queries = points_in(x, N);
    const hs_sets    sets = {.points = &points, .queries = &queries, .is_full = true};
    hs_failure       failure;
    (void)context;
    hs_account_init(&account, &options);
    const hs_status status =
        hs_scene_init_sets(&account, NULL, &sets, &tilted, &options, &scene, &asking, &failure);
    if (status == HS_OK) {
        hs_scene_free(&account, &asking);
        hs_scene_free(&account, &scene);
    }
    CHECK(account.held == 0);
    hs_account_close(&account);
    return status;
}

static void
any_allocation_may_be_refused(void)
{
    CHECK(fail_each_allocation(make_and_free, NULL, 40) > 4);
}

void
test_scene(void)
{
    RUN(what_is_no_number_is_refused);
    RUN(points_and_queries_share_a_scale);
    RUN(only_what_is_needed_is_kept);
    RUN(lost_digits_are_kept);
    RUN(turns_are_as_wide_as_need_be);
    RUN(points_are_wrapped_like_a_kept_scene);
    RUN(any_allocation_may_be_refused);
}
