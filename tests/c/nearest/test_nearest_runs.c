/* SPDX-License-Identifier: BSD-3-Clause */
/* test_nearest_runs.c: what is within reach becomes the fewest runs of points, each point once in
 * each image, whether the leaves come from a walk or from a list. */
#include "../support/nearest_unit.h"

#include <math.h>

void test_nearest_runs(void);

enum { N = 300, GROUP = 16 };

static nearest_unit      unit;
static hs_nearest_leaves leaves;
static hs_nearest_block  block;
static double            x[2 * N];
static const hs_box square = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {0.0, 4.0}}};

static void
open_points(const hs_box *box)
{
    harness_random random = {4242};
    for (int e = 0; e < 2 * N; e++)
        x[e] = 4.0 * random_unit(&random);
    const hs_points points = {x, N, 2, HS_FLOAT64, 16, 8};
    nearest_unit_open(&points, NULL, box, 3, HS_WANT_J, INFINITY, &unit);
    CHECK(hs_nearest_leaves_init(&unit.near, &leaves) == HS_OK);
    CHECK(hs_nearest_block_init(&unit.near, &block) == HS_OK);
    block.unit = block.reach = 1.0;
    block.error = 0.0;
}

static void
close_points(void)
{
    hs_nearest_block_free(&unit.near, &block);
    hs_nearest_leaves_free(&unit.near, &leaves);
    nearest_unit_close(&unit);
}

static hs_nearest_group
group_from(int32_t first, double radius)
{
    hs_nearest_group group;
    hs_nearest_group_set(&unit.near, first, first + GROUP, &group);
    group.radius = block.reach = radius;
    return group;
}

static hs_status
walk(const hs_nearest_group *group, double most)
{
    hs_nearest_images images;
    CHECK(hs_nearest_images_start(&unit.near, group, &images) == HS_OK);
    return hs_nearest_runs_find(&unit.near, &unit.call.options, group, most, &images, &block);
}

/* Each run begins where the one before ends, none could be part of that one, and their images are
 * in order. */
static void
check_runs(void)
{
    int32_t n = 0;
    for (int32_t r = 0; r < block.n_runs; r++) {
        const hs_nearest_run *run = &block.runs[r];
        CHECK(run->at == n && run->n > 0 && run->si >= 0 && run->si + run->n <= N);
        CHECK(run->image >= 0 && run->image < block.n_images);
        if (r > 0) {
            const hs_nearest_run *last = run - 1;
            CHECK(last->image == run->image ? last->si + last->n < run->si
                                            : last->image < run->image);
        }
        n += run->n;
    }
    CHECK(n == block.n);
}

static void
all_points_in_reach_are_one_run(void)
{
    open_points(NULL);
    const hs_nearest_group group = group_from(0, 8.0);
    CHECK(walk(&group, INFINITY) == HS_OK);
    CHECK(unit.near.tree.n_nodes > 40 && block.n_runs == 1 && block.n_images == 1);
    CHECK(block.runs[0].si == 0 && block.runs[0].n == N && block.n == N);
    CHECK(walk(&group, N) == HS_OK);
    CHECK(walk(&group, N - 1) == HS_TOO_MUCH);
    close_points();
}

/* Of each image, all; what lies too far away leaves no image behind. */
static void
each_image_has_runs_of_its_own(void)
{
    open_points(&square);
    hs_nearest_group group = group_from(0, 4.0);
    CHECK(walk(&group, INFINITY) == HS_OK);
    check_runs();
    CHECK(block.n_images > 4 && block.n_runs > block.n_images && block.n > 2 * N);
    group = group_from(0, 0.25);
    CHECK(walk(&group, INFINITY) == HS_OK);
    check_runs();
    CHECK(block.n >= GROUP && block.n < N / 2);
    for (int32_t image = 0; image < block.n_images; image++) {
        int32_t r = 0;
        while (r < block.n_runs && block.runs[r].image != image)
            r++;
        CHECK(r < block.n_runs);
    }
    close_points();
}

/* The same points in the same images as a walk finds, and perhaps a few leaves at the rim: these
 * are told apart in float32. */
static void
a_list_of_leaves_gives_the_runs_of_a_walk(void)
{
    int n_one = 0, n_several = 0;
    open_points(&square);
    for (int32_t first = 0; first + 2 * GROUP <= N; first += GROUP) {
        hs_nearest_group groups[2] = {group_from(first, 0.125), group_from(first + GROUP, 0.125)};
        hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
        CHECK(leaves.radius == 0.125);
        CHECK(walk(&groups[0], INFINITY) == HS_OK);
        const int32_t n = block.n, n_runs = block.n_runs, n_images = block.n_images;
        CHECK(hs_nearest_runs_take(&unit.near, &groups[0], n, &leaves, &block) == HS_OK);
        check_runs();
        CHECK(block.n == n && block.n_runs == n_runs);
        CHECK(n_images == 1 ? block.n_images == 1 : block.n_images == leaves.n_images);
        n_one += n_images == 1;
        n_several += n_images > 1;
        const double         *moved = block.images[block.runs[0].image].moved;
        const hs_nearest_run *run = &block.runs[0];
        CHECK(unit.search.bins.x[0][run->si] + moved[0] > groups[0].lower[0] - 1.0);
        CHECK(unit.search.bins.x[0][run->si] + moved[0] < groups[0].upper[0] + 1.0);
        CHECK(hs_nearest_runs_take(&unit.near, &groups[0], n - 1, &leaves, &block) == HS_TOO_MUCH);
    }
    CHECK(n_one > 2 && n_several > 2);
    close_points();
}

/* A list without leaves has no run, and all its images. */
static void
an_empty_list_has_no_run(void)
{
    open_points(&square);
    hs_nearest_group groups[2] = {group_from(0, 0.5), group_from(GROUP, 0.5)};
    hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
    leaves.n = 0;
    CHECK(hs_nearest_runs_take(&unit.near, &groups[0], 0.0, &leaves, &block) == HS_OK);
    CHECK(block.n == 0 && block.n_runs == 0);
    close_points();
}

void
test_nearest_runs(void)
{
    RUN(all_points_in_reach_are_one_run);
    RUN(each_image_has_runs_of_its_own);
    RUN(a_list_of_leaves_gives_the_runs_of_a_walk);
    RUN(an_empty_list_has_no_run);
}
