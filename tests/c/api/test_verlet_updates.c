/* SPDX-License-Identifier: BSD-3-Clause */
/* test_verlet_updates.c: a list is built again where the one there is cannot serve, even if no
 * point has moved; a step that is refused leaves it as it was. */
#include "../support/list_checks.h"

#include <float.h>
#include <math.h>

void test_verlet_updates(void);

enum { N = 80 };

static double x[3 * N];
static float  narrow[3 * N];

static const hs_box box = {
    .ndim = 3, .periodic = {true, true, false}, .rows = {{4.0}, {0.5, 4.0}, {0.0, 0.0, 4.0}}};

static void
fill_points(void)
{
    harness_random random = {4041};
    for (int e = 0; e < 3 * N; e++) {
        narrow[e] = (float)(4.0 * random_unit(&random));
        x[e] = narrow[e];
    }
}

static hs_points
wide_points(int64_t n, int ndim)
{
    return (hs_points){x, n, ndim, HS_FLOAT64, 8 * ndim, 8};
}

static hs_options
options_for(double cutoff)
{
    hs_options options = hs_options_default();
    options.cutoff = cutoff;
    options.want = WANT_ALL;
    options.sorted = true;
    options.threads = 1;
    return options;
}

/* The pairs of the list are those of a search with the options of its last step. */
static void
check_list(const hs_verlet *list, const hs_points *points, const hs_box *in, hs_options options)
{
    hs_pairs *found = NULL, *expected = NULL;
    CHECK(hs_pairs_find(AMONG(points, in), &options, &expected, NULL) == HS_OK);
    CHECK(hs_verlet_find(list, &options, &found, NULL) == HS_OK);
    CHECK(hs_pairs_length(found) > 20);
    CHECK(same_columns(found, expected, WANT_ALL, points->ndim, 8));
    hs_pairs_free(found);
    hs_pairs_free(expected);
}

/* One step; whether it built the list again. The step after it never does. */
static bool
step(hs_verlet *list, const hs_points *points, const hs_box *in, double cutoff)
{
    const hs_options options = options_for(cutoff);
    bool             rebuilt = false, again = true;
    CHECK(hs_verlet_update(list, points, in, &options, 0.25, false, &rebuilt, NULL) == HS_OK);
    CHECK(hs_verlet_update(list, points, in, &options, 0.25, false, &again, NULL) == HS_OK);
    CHECK(!again && hs_verlet_look(list).cutoff == cutoff);
    check_list(list, points, in, options);
    return rebuilt;
}

/* A smaller cutoff too: pairs between both would be missed, or be too many, otherwise. */
static void
another_cutoff_builds_again(void)
{
    const hs_points points = wide_points(N, 3);
    hs_verlet      *list = hs_verlet_new();
    CHECK(step(list, &points, &box, 1.0) && !step(list, &points, &box, 1.0));
    CHECK(step(list, &points, &box, 1.125) && step(list, &points, &box, 0.875));
    CHECK(step(list, &points, &box, nextafter(0.875, 1.0)));
    hs_verlet_free(list);
}

/* Each differs from the one before: in how many points, of which type, with how many coordinates,
 * in a box or not, periodic along which axes. */
static void
points_of_another_kind_build_again(void)
{
    const hs_points narrow_points = {narrow, N, 3, HS_FLOAT32, 12, 4};
    const hs_points all = wide_points(N, 3), fewer = wide_points(N - 1, 3),
                    flat = wide_points(N, 2);
    hs_box     open_too = box, along_y = box;
    hs_verlet *list = hs_verlet_new();
    open_too.periodic[2] = true;
    along_y.periodic[0] = false;
    CHECK(step(list, &all, &box, 1.0));
    CHECK(step(list, &fewer, &box, 1.0));
    CHECK(step(list, &all, &box, 1.0));
    CHECK(step(list, &all, NULL, 1.0));
    CHECK(step(list, &flat, NULL, 1.0));
    CHECK(step(list, &all, &open_too, 1.0));
    CHECK(step(list, &all, &along_y, 1.0));
    (void)step(list, &narrow_points, &along_y, 1.0); /* the same numbers */
    CHECK(hs_verlet_look(list).n_points == N && hs_verlet_look(list).ndim == 3);
    hs_verlet_free(list);
}

/* cutoff + skin passes the largest number: there is no such list, and the one before stays. */
static void
radii_beyond_the_largest_number_are_refused(void)
{
    const hs_points points = wide_points(N, 3);
    hs_verlet      *list = hs_verlet_new();
    hs_options      options = options_for(DBL_MAX);
    hs_failure      failure;
    bool            rebuilt = false;
    CHECK(hs_verlet_update(list, &points, &box, &options, DBL_MAX, false, &rebuilt, &failure) ==
          HS_ERR_CUTOFF);
    CHECK(failure.value == INFINITY && failure.row == -1 && !rebuilt);
    CHECK(!hs_verlet_look(list).has_list);
    CHECK(step(list, &points, &box, 1.0));
    CHECK(hs_verlet_update(list, &points, &box, &options, DBL_MAX, false, &rebuilt, &failure) ==
          HS_ERR_CUTOFF);
    CHECK(failure.value == INFINITY && !rebuilt && hs_verlet_look(list).radius == 1.25);
    check_list(list, &points, &box, options_for(1.0));
    CHECK(!step(list, &points, &box, 1.0));
    hs_verlet_free(list);
}

void
test_verlet_updates(void)
{
    fill_points();
    RUN(another_cutoff_builds_again);
    RUN(points_of_another_kind_build_again);
    RUN(radii_beyond_the_largest_number_are_refused);
}
