/* SPDX-License-Identifier: BSD-3-Clause */
/* test_candidates.c: candidates of a group: images, leaves and runs of them. */
#include "../support/nearest_unit.h"

#include <math.h>

void test_candidates(void);

/*
 * ---- nearest images ----
 *
 * Each image that can be near a group is met once, and whatever is within the radius lies in one of
 * them.
 */

static nearest_unit unit;

static hs_points
points_in(const double *x, int64_t n, int ndim)
{
    return (hs_points){x, n, ndim, HS_FLOAT64, ndim * 8, 8};
}

/* Points on one line across the box, and a group between its images that looks less far. */
static void
there_may_be_no_image_in_reach(void)
{
    const double      x[2] = {0.0, 0.0};
    const hs_box      box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    const hs_points   points = points_in(x, 1, 2);
    hs_nearest_images images;
    nearest_unit_open(&points, NULL, &box, 1, HS_WANT_J, INFINITY, &unit);
    hs_nearest_group group = nearest_unit_group(&unit, 0.25);
    unit.search.scene.lower[0] = unit.search.scene.upper[0] = 0.0;
    group.t_lower[0] = group.t_upper[0] = 0.375;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
    CHECK(images.count == 0.0 && !hs_nearest_images_next(&images));
    group.radius = 0.375;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
    CHECK(images.count == 1.0 && hs_nearest_images_next(&images) && images.next.shift[0] == 0);
    group.radius = 0.625;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK && images.count == 2.0);
    nearest_unit_close(&unit);
}

static void
more_images_than_can_be_counted_are_refused(void)
{
    const double      x[2] = {0.0, 0.0};
    const hs_box      box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    const hs_points   points = points_in(x, 1, 2);
    hs_nearest_images images;
    nearest_unit_open(&points, NULL, &box, 1, HS_WANT_J, INFINITY, &unit);
    hs_nearest_group group = nearest_unit_group(&unit, 1.0);
    group.t_upper[0] = 0x1p30; /* the first image can be counted to, the last one not */
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_TRY_OTHER);
    group.t_upper[0] = 0.0;
    group.t_lower[0] = -0x1p30;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_TRY_OTHER);
    group.t_lower[0] = group.t_upper[0] = 0x1p30 - 4.0;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK && images.count <= 4.0);
    group = nearest_unit_group(&unit, 0x1p23 - 2.0); /* 2^24 are too many */
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
    group.radius = 0x1p23;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_TRY_OTHER);
    unit.near.k = 1 << 15; /* but for so many neighbours */
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
    group.radius = 0x1p24;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_TRY_OTHER);
    nearest_unit_close(&unit);
}

/* Only where the open axes are at right angles to what repeats does the way to the points along
 * them leave less for the rest. */
static void
layers_are_upright(void)
{
    const double    x[6] = {0.25, -1.0, 0.5, 2.0, 0.75, 0.5};
    const hs_box    box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    const hs_points points = points_in(x, 3, 2);
    nearest_unit_open(&points, NULL, &box, 1, HS_WANT_J, INFINITY, &unit);
    hs_lattice *lattice = &unit.search.scene.lattice;
    CHECK(unit.near.has_layer);
    CHECK(unit.near.layer_lower[1] == -1.0 && unit.near.layer_upper[1] == 2.0);
    const double normals[2][2] = {{1.0, 0.0}, {0.0, 1.0}};
    lattice->aligned = false;
    memcpy(lattice->normal[0], normals[0], sizeof normals[0]);
    memcpy(lattice->normal[1], normals[1], sizeof normals[1]);
    hs_nearest_measure(&unit.near);
    CHECK(unit.near.has_layer);
    CHECK(unit.near.layer_lower[1] == -1.0 && unit.near.layer_upper[1] == 2.0);
    lattice->normal[1][0] = 0x1p-39;
    hs_nearest_measure(&unit.near);
    CHECK(!unit.near.has_layer);
    lattice->normal[1][0] = 0x1p-41;
    hs_nearest_measure(&unit.near);
    CHECK(unit.near.has_layer);
    nearest_unit_close(&unit);
}

/*
 * ---- nearest leaves ----
 *
 * Leaves that groups share are all that any of them may need, each group is given those within its
 * radius, and where a list would save nothing there is none.
 */

enum { MOST = 24000, GROUP = 16 };
static hs_nearest_leaves leaves;
static hs_nearest_block  block;
static double            x_leaves[3 * MOST];

static void
open_points(int64_t n, int d, double side, const hs_box *box, int64_t k)
{
    harness_random random = {515};
    for (int64_t e = 0; e < n * d; e++)
        x_leaves[e] = side * random_unit(&random);
    const hs_points points = {x_leaves, n, d, HS_FLOAT64, d * 8, 8};
    nearest_unit_open(&points, NULL, box, k, HS_WANT_J, INFINITY, &unit);
}

static void
close_points(void)
{
    nearest_unit_clear(&unit, &leaves, &block);
    nearest_unit_close(&unit);
}

static hs_nearest_group
group_from(int32_t first, int32_t n, double radius)
{
    hs_nearest_group group;
    hs_nearest_group_set(&unit.near, first, first + n, &group);
    group.radius = radius;
    return group;
}

/* The radius up to which leaves serve that are found for points around a group. */
static double
served(const hs_nearest_group *group)
{
    CHECK(hs_nearest_leaves_find(&unit.near, group, INFINITY, &leaves) == HS_OK);
    return leaves.radius;
}

/* Groups that are far wider than their radius, too many leaves, points or images. */
static void
where_nothing_is_saved_there_is_no_list(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {0.0, 4.0}}};
    open_points(100, 2, 4.0, NULL, 4);
    hs_nearest_group group = group_from(0, 2 * GROUP, 1.0);
    CHECK(served(&group) == 1.0 && !hs_nearest_is_scattered(&unit.near, &group));
    const int64_t n_points = leaves.n_points;
    CHECK(hs_nearest_leaves_find(&unit.near, &group, n_points - 9.0, &leaves) == HS_OK);
    CHECK(leaves.radius == 0.0);
    group.upper[0] = group.lower[0] + 127.0;
    CHECK(served(&group) == 1.0 && hs_nearest_is_scattered(&unit.near, &group));
    group.upper[0] = group.lower[0] + 128.01;
    CHECK(served(&group) == 0.0);
    close_points();
    open_points(8, 2, 4.0, NULL, 4); /* all in one leaf */
    group = group_from(0, 8, 1.0);
    CHECK(served(&group) == 1.0 && leaves.n == 1);
    close_points();
    open_points(MOST * 3 / 2, 2, 4.0, NULL, 4);
    group = group_from(0, GROUP, 8.0);
    CHECK(served(&group) == 0.0);
    close_points();
    open_points(10, 2, 4.0, &box, 4);
    group = group_from(0, 2, 48.0);
    CHECK(served(&group) == 0.0);
    group.radius = 6.0;
    CHECK(served(&group) == 6.0);
    close_points();
}

/* The guess is scaled, and ends where all points are within the radius. */
static void
guesses_follow_the_density(void)
{
    open_points(10000, 2, 100.0, NULL, 4); /* one in a square of 1 */
    hs_nearest_group group = group_from(5000, GROUP, 0.0);
    hs_nearest_guess(&unit.near, 1.0, &group);
    const double radius = group.radius;
    CHECK(radius > 1.5 && radius < 3.0 && !group.is_complete);
    hs_nearest_guess(&unit.near, 2.0, &group);
    CHECK(group.radius == 2.0 * radius && !group.is_complete);
    hs_nearest_guess(&unit.near, 1000.0, &group);
    CHECK(group.radius < 210.0 && group.is_complete);
    close_points();
    open_points(5, 2, 4.0, NULL, 4); /* all of them are wanted */
    group = group_from(0, 5, 0.0);
    hs_nearest_guess(&unit.near, 0x1p-10, &group);
    CHECK(group.radius > 4.0 && group.is_complete);
    close_points();
}

/*
 * ---- nearest block ----
 *
 * What a group may be near to is gathered whole, whether it comes from leaves that groups share or
 * from those of its own, and what cannot be gathered is told.
 */

enum { N = 400, GROUP_BLOCK = 16 };
static double x_block[3 * N];

static void
open_scene(harness_random *random, int d, const hs_box *box)
{
    for (int e = 0; e < d * N; e++)
        x_block[e] = 4.0 * random_unit(random);
    const hs_points points = {x_block, N, d, HS_FLOAT64, d * 8, 8};
    nearest_unit_open(&points, NULL, box, 4, HS_WANT_J, INFINITY, &unit);
}

static void
close_scene(void)
{
    nearest_unit_clear(&unit, &leaves, &block);
    nearest_unit_close(&unit);
}

static hs_nearest_group
group_from_block(int32_t first, double radius)
{
    hs_nearest_group group;
    hs_nearest_group_set(&unit.near, first, first + GROUP_BLOCK, &group);
    group.radius = radius;
    return group;
}

static hs_status
fill(const hs_nearest_group *group, double most)
{
    return hs_nearest_block_fill(&unit.near, &unit.call.options, group, most, &leaves, &block);
}

/* Whether the block has point j in the image with this displacement. */
static bool
block_has(int32_t sj, const double *moved)
{
    const int d = unit.near.tree.ndim;
    for (int32_t c = 0; c < block.n; c++) {
        bool same = block.number[c] == sj;
        for (int k = 0; k < d; k++)
            same = same && block.images[block.image_of[c]].moved[k] == moved[k];
        if (same)
            return true;
    }
    return false;
}

/* Candidates are where they say, in units from the centre. */
static bool
places_are_right(const hs_nearest_group *group)
{
    const hs_bins *bins = &unit.search.bins;
    bool           right = true;
    for (int32_t c = 0; c < block.n; c++) {
        for (int k = 0; k < bins->ndim; k++) {
            const double centre = group->lower[k] + 0.5 * (group->upper[k] - group->lower[k]);
            const double y =
                (bins->x[k][block.number[c]] + block.images[block.image_of[c]].moved[k] - centre) *
                block.frame.unit;
            right = right && fabs(fmax(fmin(y, block.extent), -block.extent) -
                                  (double)block.y[k][c]) <= 1e-5;
        }
    }
    return right;
}

/* All within the radius of a point of the group, in the nearest images along each axis. */
static int64_t
check_block(const hs_nearest_group *group)
{
    const hs_lattice *lattice = &unit.search.scene.lattice;
    const hs_bins    *bins = &unit.search.bins;
    const int         d = bins->ndim, m = lattice->n_periodic;
    int               images = 1;
    int64_t           n_near = 0, missing = 0;
    for (int r = 0; r < m; r++)
        images *= 5;
    for (int image = 0; image < images; image++) {
        double moved[3] = {0.0};
        for (int r = 0, rest = image; r < m; r++, rest /= 5)
            for (int k = 0; k < d; k++)
                moved[k] += (rest % 5 - 2) * lattice->rows[r][k];
        for (int32_t sj = 0; sj < N; sj++) {
            bool is_near = false;
            for (int32_t si = group->first; si < group->last && !is_near; si++) {
                double square = 0.0;
                for (int k = 0; k < d; k++) {
                    const double along = bins->x[k][sj] + moved[k] - bins->x[k][si];
                    square += along * along;
                }
                is_near = square <= group->radius * group->radius;
            }
            n_near += is_near;
            missing += is_near && !block_has(sj, moved);
        }
    }
    CHECK(missing == 0 && places_are_right(group));
    return n_near;
}

static void
leaves_that_are_shared_hold_all_that_is_near(void)
{
    harness_random random = {577};
    int64_t        n_near = 0, n_shared = 0, n_candidates = 0;
    for (int trial = 0; trial < 24; trial++) {
        const int d = 1 + trial % 3;
        hs_box    box = {.ndim = d};
        for (int l = 0; l < d; l++) {
            box.periodic[l] = trial % 4 == 0 || l == trial % d;
            for (int k = 0; k < d; k++)
                box.rows[l][k] = k == l ? 4.0 : trial % 2 ? random_unit(&random) - 0.5 : 0.0;
        }
        open_scene(&random, d, trial % 5 ? &box : NULL);
        const int32_t    first = (int32_t)(random_unit(&random) * (N - 3 * GROUP_BLOCK));
        const double     radius = d == 1 ? 0.05 : d == 2 ? 0.3 : 0.8;
        hs_nearest_group all;
        hs_nearest_group_set(&unit.near, first, first + 3 * GROUP_BLOCK, &all);
        all.radius = 1.6 * radius;
        for (int g = 0; g < 6; g++) { /* leaves of all, and of one of the groups */
            const hs_nearest_group of_block =
                group_from_block(first + g / 2 * GROUP_BLOCK, radius * (1.0 + 0.6 * (g / 2)));
            const hs_nearest_group *group = &of_block;
            CHECK(served(g % 2 ? group : &all) == (g % 2 ? group->radius : all.radius));
            if (group->radius > leaves.radius) {
                CHECK(fill(group, 1e9) == HS_TRY_OTHER);
                continue;
            }
            n_shared += g % 2 == 0;
            CHECK(fill(group, 1e9) == HS_OK);
            n_near += check_block(group);
            n_candidates += block.n;
            const int32_t n = block.n;
            CHECK(fill(group, n) == HS_OK && block.n == n);
            CHECK(fill(group, n - 1) == HS_TRY_OTHER);
        }
        close_scene();
    }
    CHECK(n_shared > 30 && n_near > 500 && n_candidates < 12 * n_near);
}

/* Leaves in coordinates that are far less certain than the radius of a group are of no use to
 * it. */
static void
uncertain_leaves_are_not_taken(void)
{
    harness_random random = {31};
    open_scene(&random, 2, NULL);
    const hs_nearest_group group = group_from_block(0, 0.5);
    CHECK(served(&group) == 0.5 && leaves.n > 0);
    CHECK(fill(&group, 1e9) == HS_OK && block.n >= GROUP_BLOCK);
    check_block(&group);
    leaves.error = 0.5 / 1024.0;
    CHECK(fill(&group, 1e9) == HS_OK);
    leaves.error = nextafter(0.5 / 1024.0, 1.0);
    CHECK(fill(&group, 1e9) == HS_TRY_OTHER);
    unit.search.scene.x_error = 0x1p-20; /* 2^-19 of a difference, 2^-18 in units of 1/2 */
    CHECK(served(&group) == 0.5 && leaves.error == 0x1p-19);
    unit.search.scene.x_error = 0x1.001p-20;
    CHECK(served(&group) == 0.0);
    close_scene();
}

void
test_candidates(void)
{
    RUN(there_may_be_no_image_in_reach);
    RUN(more_images_than_can_be_counted_are_refused);
    RUN(layers_are_upright);
    RUN(where_nothing_is_saved_there_is_no_list);
    RUN(guesses_follow_the_density);
    RUN(leaves_that_are_shared_hold_all_that_is_near);
    RUN(uncertain_leaves_are_not_taken);
}
