/* SPDX-License-Identifier: BSD-3-Clause */
/* test_nearest_leaves.c: leaves that groups share are all that any of them may need, each group is
 * given those within its radius, and where a list would save nothing there is none. */
#include "../support/nearest_unit.h"

#include <math.h>

void test_nearest_leaves(void);

enum { MOST = 24000, GROUP = 16 };

static nearest_unit      unit;
static hs_nearest_leaves leaves;
static double            x[3 * MOST];

static void
open_points(int64_t n, int d, double side, const hs_box *box, int64_t k)
{
    harness_random random = {515};
    for (int64_t e = 0; e < n * d; e++)
        x[e] = side * random_unit(&random);
    const hs_points points = {x, n, d, HS_FLOAT64, d * 8, 8};
    nearest_unit_open(&points, NULL, box, k, HS_WANT_J, INFINITY, &unit);
    CHECK(hs_nearest_leaves_init(&unit.near, &leaves) == HS_OK);
}

static void
close_points(void)
{
    hs_nearest_leaves_free(&unit.near, &leaves);
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

/* Distance between the group and the range of a leaf's points. */
static double
distance_to(const hs_nearest_group *group, const hs_tree_node *leaf)
{
    const hs_bins *bins = &unit.search.bins;
    double         square = 0.0;
    for (int k = 0; k < bins->ndim; k++) {
        double low = INFINITY, high = -INFINITY;
        for (int32_t si = leaf->first; si < leaf->end; si++) {
            low = fmin(bins->x[k][si], low);
            high = fmax(bins->x[k][si], high);
        }
        const double apart = fmax(fmax(low - group->upper[k], group->lower[k] - high), 0.0);
        square += apart * apart;
    }
    return sqrt(square);
}

/* Whether the leaf is among the first n hits. */
static bool
is_listed(const hs_tree_node *leaf, int32_t n)
{
    int32_t h = 0;
    while (h < n && leaves.runs[leaves.hits[h]].si != leaf->first)
        h++;
    return h < n && leaves.runs[leaves.hits[h]].n == leaf->end - leaf->first;
}

/* Each leaf within the radius is listed, in ascending order, and few others. */
static void
lists_hold_what_is_within_the_radius(void)
{
    for (int d = 1; d <= 3; d++) {
        int64_t n_listed = 0, n_near = 0;
        open_points(2000, d, 4.0, NULL, 4);
        const double radius = d == 1 ? 0.03 : d == 2 ? 0.2 : 0.7;
        for (int32_t first = 0; first + 4 * GROUP <= 2000; first += 4 * GROUP) {
            hs_nearest_group groups[4];
            for (int g = 0; g < 4; g++)
                groups[g] = group_from(first + g * GROUP, GROUP, radius * (1.0 + 0.25 * g));
            hs_nearest_leaves_find(&unit.near, groups, 4, &leaves);
            CHECK(leaves.radius == groups[3].radius && leaves.n_images == 1);
            for (int g = 0; g < 4; g++) {
                const int32_t n =
                    hs_nearest_leaves_list(&unit.near, &groups[g], groups[g].radius, &leaves);
                int32_t at = 0;
                for (int32_t node = 0; node < unit.near.tree.n_nodes; node++)
                    n_near += unit.near.tree.nodes[node].left == 0 &&
                              distance_to(&groups[g], &unit.near.tree.nodes[node]) <=
                                  groups[g].radius;
                for (int32_t h = 0; h < n; h++) {
                    CHECK(leaves.hits[h] >= at && leaves.hits[h] < leaves.n);
                    at = leaves.hits[h] + 1;
                }
                for (int32_t node = 0; node < unit.near.tree.n_nodes; node++) {
                    const hs_tree_node *leaf = &unit.near.tree.nodes[node];
                    if (leaf->left == 0 && distance_to(&groups[g], leaf) <= groups[g].radius)
                        CHECK(is_listed(leaf, n));
                }
                n_listed += n;
            }
        }
        CHECK(n_near > 100 && n_listed < n_near + n_near / 50 + 10);
        close_points();
    }
}

/* Where the groups are so far apart that floats are coarse, against the radius. */
static void
a_leaf_at_the_radius_is_listed(void)
{
    int n_tried = 0;
    for (int d = 1; d <= 3; d++) {
        open_points(2000, d, 100.0, NULL, 4);
        hs_nearest_group groups[2] = {group_from(0, GROUP, 1.0),
                                      group_from(2000 - GROUP, GROUP, 1.0)};
        hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
        CHECK(leaves.radius == 1.0 && leaves.extent > 20.0);
        for (int g = 0; g < 2; g++) {
            for (int32_t node = 0; node < unit.near.tree.n_nodes; node++) {
                const hs_tree_node *leaf = &unit.near.tree.nodes[node];
                const double        radius = distance_to(&groups[g], leaf);
                if (leaf->left != 0 || radius > leaves.radius)
                    continue;
                const int32_t n = hs_nearest_leaves_list(&unit.near, &groups[g], radius, &leaves);
                CHECK(is_listed(leaf, n));
                n_tried += radius > 0.0;
            }
        }
        close_points();
    }
    CHECK(n_tried > 5);
}

/* Images that hold nothing are left out, and leaves say which of the others they lie in. */
static void
leaves_lie_in_images(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {0.5, 4.0}}};
    int          n_several = 0;
    open_points(500, 2, 4.0, &box, 4);
    for (int32_t first = 0; first + 2 * GROUP <= 500; first += GROUP) {
        hs_nearest_group groups[2] = {group_from(first, GROUP, 0.25),
                                      group_from(first + GROUP, GROUP, 0.25)};
        hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
        CHECK(leaves.radius == 0.25 && leaves.n_images >= 1 && leaves.error > 0.0);
        for (int32_t image = 0; image < leaves.n_images; image++) {
            int32_t l = 0;
            while (l < leaves.n && leaves.runs[l].image != image)
                l++;
            CHECK(l < leaves.n);
        }
        n_several += leaves.n_images > 1;
    }
    CHECK(n_several > 3);
    close_points();
}

/* Distance between the group and a leaf of the list in its image. */
static double
distance_in_image(const hs_nearest_group *group, int32_t l)
{
    const hs_nearest_run run = leaves.runs[l];
    const hs_tree_node   leaf = {.first = run.si, .end = run.si + run.n};
    hs_nearest_group     moved = *group;
    for (int k = 0; k < 2; k++) {
        moved.lower[k] -= leaves.images[run.image].moved[k];
        moved.upper[k] -= leaves.images[run.image].moved[k];
    }
    return distance_to(&moved, &leaf);
}

/* On both sides of a face of boxes that are so wide that images are wrong by nearly as much as
 * floats that are shared may be. */
static void
a_leaf_at_the_radius_in_an_image_is_found(void)
{
    int n_tried = 0;
    for (int exponent = 30; exponent < 36; exponent++) {
        const double length = ldexp(1.0, exponent);
        const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{length}, {0.5, length}}};
        harness_random random = {516};
        enum { N = 64 };
        for (int i = 0; i < N; i++) {
            x[2 * i] = (i % 2 ? 0.5 : -0.5) * length - (i % 2 ? 4.0 : -4.0) * random_unit(&random);
            x[2 * i + 1] = 4.0 * random_unit(&random);
        }
        const hs_points points = {x, N, 2, HS_FLOAT64, 16, 8};
        nearest_unit_open(&points, NULL, &box, 4, HS_WANT_J, INFINITY, &unit);
        CHECK(hs_nearest_leaves_init(&unit.near, &leaves) == HS_OK);
        for (int32_t first = 0; first < N; first += GROUP) {
            hs_nearest_group groups[2] = {group_from(first, GROUP, 8.0),
                                          group_from(first, GROUP, 8.0)};
            double           radii[N];
            hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
            const int32_t n = leaves.radius > 0.0 ? leaves.n : 0;
            CHECK(n <= N);
            for (int32_t l = 0; l < n; l++)
                radii[l] = distance_in_image(&groups[0], l);
            for (int32_t l = 0; l < n; l++) {
                bool is_found = false;
                if (radii[l] == 0.0)
                    continue;
                groups[0].radius = groups[1].radius = radii[l];
                hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
                for (int32_t m = 0; m < leaves.n; m++)
                    is_found = is_found || distance_in_image(&groups[0], m) == radii[l];
                CHECK(leaves.radius == 0.0 || is_found);
                n_tried += leaves.radius > 0.0;
            }
        }
        close_points();
    }
    CHECK(n_tried > 10);
}

/* Those that look more than twice as far as the others walk by themselves. */
static void
groups_that_look_far_are_left_out(void)
{
    open_points(2000, 2, 4.0, NULL, 4);
    hs_nearest_group groups[3] = {group_from(0, GROUP, 0.2), group_from(GROUP, GROUP, 0.4),
                                  group_from(2 * GROUP, GROUP, 0.40001)};
    hs_nearest_leaves_find(&unit.near, groups, 3, &leaves);
    CHECK(leaves.radius == 0.4);
    groups[0].radius = 0.3;
    hs_nearest_leaves_find(&unit.near, groups, 3, &leaves);
    CHECK(leaves.radius == 0.40001);
    groups[1].radius = groups[2].radius = 50.0;
    hs_nearest_leaves_find(&unit.near, groups, 3, &leaves);
    CHECK(leaves.radius == 0.3);
    const double far = 0.3 + 0.01 * 4.0; /* and their ranges, too */
    for (int32_t l = 0; l < leaves.n; l++) {
        const hs_tree_node leaf = {.first = leaves.runs[l].si,
                                   .end = leaves.runs[l].si + leaves.runs[l].n};
        CHECK(distance_to(&groups[0], &leaf) <= far);
    }
    close_points();
}

/* One group, one leaf, groups that are far wider than their radius, too many leaves or images. */
static void
where_nothing_is_saved_there_is_no_list(void)
{
    const hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {0.0, 4.0}}};
    hs_nearest_group groups[2];
    open_points(100, 2, 4.0, NULL, 4);
    groups[0] = group_from(0, GROUP, 1.0);
    groups[1] = group_from(GROUP, GROUP, 1.0);
    hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
    CHECK(leaves.radius == 1.0);
    hs_nearest_leaves_find(&unit.near, groups, 1, &leaves);
    CHECK(leaves.radius == 0.0);
    groups[0].radius = groups[1].radius = 1.0;
    groups[1].upper[0] = groups[0].lower[0] + 255.0;
    hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
    CHECK(leaves.radius == 1.0);
    groups[1].upper[0] = groups[0].lower[0] + 256.0;
    hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
    CHECK(leaves.radius == 0.0);
    close_points();
    open_points(8, 2, 4.0, NULL, 4); /* all in one leaf */
    groups[0] = group_from(0, 4, 1.0);
    groups[1] = group_from(4, 4, 1.0);
    hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
    CHECK(leaves.radius == 0.0);
    close_points();
    open_points(MOST, 2, 4.0, NULL, 4);
    groups[0] = group_from(0, GROUP, 8.0);
    groups[1] = group_from(GROUP, GROUP, 8.0);
    hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
    CHECK(leaves.radius == 0.0);
    close_points();
    open_points(10, 2, 4.0, &box, 4);
    groups[0] = group_from(0, 1, 14.0);
    groups[1] = group_from(1, 1, 14.0);
    hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
    CHECK(leaves.radius == 0.0);
    groups[0].radius = groups[1].radius = 6.0;
    hs_nearest_leaves_find(&unit.near, groups, 2, &leaves);
    CHECK(leaves.radius == 6.0);
    close_points();
}

static void
any_allocation_may_be_refused(void)
{
    open_points(10, 2, 4.0, NULL, 4);
    hs_nearest_leaves_free(&unit.near, &leaves);
    const int64_t held = unit.call.account.held;
    hs_status     status = HS_ERR_MEMORY;
    int           nth;
    for (nth = 1; status != HS_OK && nth < 20; nth++) {
        hs_test_fail_allocation(nth);
        status = hs_nearest_leaves_init(&unit.near, &leaves);
        CHECK((status == HS_OK) == hs_test_failure_is_due());
        hs_test_fail_allocation(0);
        hs_nearest_leaves_free(&unit.near, &leaves);
        CHECK(unit.call.account.held == held);
    }
    CHECK(nth == 11); /* four ranges, five others, and none */
    nearest_unit_close(&unit);
}

void
test_nearest_leaves(void)
{
    RUN(lists_hold_what_is_within_the_radius);
    RUN(a_leaf_at_the_radius_is_listed);
    RUN(leaves_lie_in_images);
    RUN(a_leaf_at_the_radius_in_an_image_is_found);
    RUN(groups_that_look_far_are_left_out);
    RUN(where_nothing_is_saved_there_is_no_list);
    RUN(any_allocation_may_be_refused);
}
