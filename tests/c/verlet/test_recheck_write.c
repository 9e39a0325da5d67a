/* SPDX-License-Identifier: BSD-3-Clause */
/* test_recheck_write.c: when hits of a list are measured while they are written, and what is laid
 * out for that. */
#include "../support/poll_checks.h"
#include "../support/recheck_unit.h"

void test_recheck_write(void);

enum { N = 3, WANT = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR };

static recheck_unit unit;

static void *
zeros(int64_t n, size_t size)
{
    void *to = hs_alloc(&unit.call.account, HS_FOR_WRAPS, n, size);
    CHECK(to != NULL);
    memset(to, 0, (size_t)n * size);
    return to;
}

/* Three points in a box whose vectors repeat, none of which lags. */
static void
open_unit(int d)
{
    static const double x[N * 3] = {0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 3.0, 3.0, 3.0};
    const hs_points     points = {x, N, d, HS_FLOAT64, 24, 8};
    const hs_box        box = {
               .ndim = d, .periodic = {true, true, true}, .rows = {{4.0}, {0.0, 4.0}, {0.0, 0.0, 4.0}}};
    hs_recheck *recheck = &unit.recheck;
    recheck_unit_open(&points, &box, 1.0, WANT, &unit);
    unit.output.fixed = false;
    unit.output.columns = WANT;
    recheck->scene.ndim = d;
    hs_metric_init(&recheck->scene.metric, d, d, box.rows, 1.0, true);
    recheck->lag = zeros((int64_t)N * d, sizeof *recheck->lag);
    recheck->lagging = zeros(N, sizeof *recheck->lagging);
    recheck->image = zeros((int64_t)RECHECK_IMAGES * d, sizeof *recheck->image);
}

static bool
has_writer(void)
{
    return unit.call.kernel->write != NULL;
}

/* Whether hits can be written. Without lags there are no records of them. */
static bool
can_write(void)
{
    const hs_recheck *recheck = &unit.recheck;
    CHECK(hs_recheck_plan_write(&unit.recheck) == HS_OK);
    CHECK(recheck->few == NULL);
    return recheck->writes;
}

enum { ORDINARY, SHARED, EXTREME, ORIGINALS, NO_FLOATS, FIXED, BOTH, OWN_IMAGES, SHORT, ODDITIES };

static void
only_what_is_ordinary_is_written(void)
{
    static const double short_rows[3][HS_MAX_DIM] = {{0.5}, {0.0, 0.5}, {0.0, 0.0, 0.5}};
    for (int d = 1; d <= 3; d++) {
        for (int oddity = 0; oddity < ODDITIES; oddity++) {
            open_unit(d);
            hs_scene *scene = &unit.recheck.scene;
            scene->extreme = oddity == EXTREME;
            scene->keeps_originals = oddity == ORIGINALS;
            scene->metric.floats_usable = oddity != NO_FLOATS;
            unit.output.fixed = oddity == FIXED || oddity == SHARED;
            unit.recheck.shared = oddity == SHARED;
            unit.output.columns |= oddity == BOTH ? HS_WANT_BOTH : 0;
            if (oddity == OWN_IMAGES)
                scene->metric.cutoff = 4.0;
            if (oddity == SHORT)
                hs_metric_init(&scene->metric, d, d, short_rows, 0.75, true);
            CHECK(can_write() == (has_writer() && oddity <= SHARED && d > 1));
            recheck_unit_close(&unit);
        }
    }
}

/* Sums of these must fit into int32, whichever of them are added. */
static void
large_lags_and_images_are_not_written(void)
{
    const int64_t most = INT64_C(1) << 29;
    const int64_t values[] = {most - 1, -most, most, -most - 1, INT64_MAX, INT64_MIN};
    const size_t  n_values = sizeof values / sizeof *values;
    for (size_t v = 0; v < n_values; v++) {
        for (int of_image = 0; of_image < 2; of_image++) {
            for (int last = 0; last < 2; last++) {
                open_unit(2);
                hs_recheck *recheck = &unit.recheck;
                int64_t    *to = of_image ? recheck->image : recheck->lag;
                const int   n = 2 * (of_image ? RECHECK_IMAGES : N);
                to[last ? n - 1 : 0] = values[v];
                CHECK(can_write() == (has_writer() && v < 2));
                recheck_unit_close(&unit);
            }
        }
    }
}

/* Those of all points are laid out as the writer reads them, once one is not zero. */
static void
lags_are_laid_out(void)
{
    for (int d = 2; d <= 3; d++) {
        open_unit(d);
        hs_recheck *recheck = &unit.recheck;
        for (int e = 0; e < d; e++)
            recheck->lag[d + e] = e == 0 ? -7 : 0x10000 * e;
        recheck->lagging[1] = 1;
        CHECK(hs_recheck_plan_write(recheck) == HS_OK && recheck->writes == has_writer());
        CHECK((recheck->few != NULL) == has_writer());
        for (int e = 0; recheck->few != NULL && e < N * HS_RECORD; e++) {
            const int point = e / HS_RECORD, r = e % HS_RECORD;
            CHECK(recheck->few[e] == (r < d ? recheck->lag[point * d + r] : 0));
        }
        recheck_unit_close(&unit);
    }
}

static hs_status
plan_once(void *context)
{
    hs_recheck     *recheck = context;
    const hs_status status = hs_recheck_plan_write(recheck);
    hs_free(&unit.call.account, recheck->few);
    recheck->few = NULL;
    return status;
}

static void
nothing_leaks_when_memory_is_short(void)
{
    open_unit(3);
    unit.recheck.lagging[2] = 1;
    CHECK(fail_each_allocation(plan_once, &unit.recheck, 5) == (has_writer() ? 2 : 1));
    recheck_unit_close(&unit);
}

void
test_recheck_write(void)
{
    RUN(only_what_is_ordinary_is_written);
    RUN(large_lags_and_images_are_not_written);
    RUN(lags_are_laid_out);
    RUN(nothing_leaks_when_memory_is_short);
}
