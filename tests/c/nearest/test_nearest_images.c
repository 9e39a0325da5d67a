/* SPDX-License-Identifier: BSD-3-Clause */
/* test_nearest_images.c: each image that can be near a group is met once, and whatever is within
 * the radius lies in one of them. */
#include "../support/nearest_unit.h"

#include <math.h>

void test_nearest_images(void);

enum { N = 12, WIDE = 9 };

static nearest_unit unit;

static hs_points
points_in(const double *x, int64_t n, int ndim)
{
    return (hs_points){x, n, ndim, HS_FLOAT64, ndim * 8, 8};
}

/* Distance from some point that asks to point j in an image, the least there is. */
static double
least_distance(const double *moved, int32_t sj)
{
    const hs_bins *bins = &unit.search.bins;
    double         least = INFINITY;
    for (int64_t si = 0; si < bins->n; si++) {
        double square = 0.0;
        for (int k = 0; k < bins->ndim; k++) {
            const double along = bins->x[k][sj] + moved[k] - bins->x[k][si];
            square += along * along;
        }
        least = fmin(least, sqrt(square));
    }
    return least;
}

/* Every shift of up to WIDE rows, against those that were met. Returns how many are near. */
static int
compare_with_all(const hs_nearest_group *group, const uint8_t *met)
{
    const hs_lattice *lattice = &unit.search.scene.lattice;
    const int         m = lattice->n_periodic;
    int               shift[3] = {-WIDE, -WIDE, -WIDE}, n_near = 0, r = 0;
    while (r < m) {
        double moved[HS_MAX_DIM] = {0.0};
        int    at = 0;
        bool   is_near = false;
        for (int row = 0; row < m; row++) {
            at = at * (2 * WIDE + 1) + shift[row] + WIDE;
            for (int c = 0; c < lattice->ndim; c++)
                moved[c] += shift[row] * lattice->rows[row][c];
        }
        for (int32_t sj = 0; sj < N && !is_near; sj++)
            is_near = least_distance(moved, sj) <= group->radius;
        CHECK(met[at] <= 1 && (!is_near || met[at] == 1));
        n_near += is_near;
        for (r = 0; r < m && shift[r] == WIDE; r++)
            shift[r] = -WIDE;
        if (r < m)
            shift[r]++;
    }
    return n_near;
}

static void
images_in_reach_are_met_once(void)
{
    static uint8_t met[(2 * WIDE + 1) * (2 * WIDE + 1) * (2 * WIDE + 1)];
    harness_random random = {2718};
    int64_t        n_near = 0, n_met = 0;
    for (int trial = 0; trial < 60; trial++) {
        const int         d = 1 + trial % 3;
        double            x[3 * N];
        hs_box            box = {.ndim = d};
        hs_nearest_images images;
        double            moved[HS_MAX_DIM];
        for (int l = 0; l < d; l++) {
            box.periodic[l] = l == trial / 3 % d || trial % 4 < 2;
            for (int k = 0; k < d; k++)
                box.rows[l][k] = k == l      ? 1.0
                                 : trial % 2 ? 0.6 * (random_unit(&random) - 0.5)
                                             : 0.0;
        }
        for (int e = 0; e < d * N; e++)
            x[e] = 3.0 * random_unit(&random) - 1.5;
        const hs_points points = points_in(x, N, d);
        nearest_unit_open(&points, NULL, &box, 3, HS_WANT_J, INFINITY, &unit);
        const hs_nearest_group group = nearest_unit_group(&unit, 0.02 + 0.7 * random_unit(&random));
        memset(met, 0, sizeof met);
        CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
        CHECK(images.error >= 0.0 && images.error < 1e-12);
        int64_t n = 0;
        for (; hs_nearest_images_next(&images); n++) {
            int at = 0;
            memset(moved, 0, sizeof moved);
            for (int r = 0; r < unit.search.scene.lattice.n_periodic; r++) {
                CHECK(abs(images.shift[r]) <= WIDE);
                at = at * (2 * WIDE + 1) + images.shift[r] + WIDE;
                for (int c = 0; c < d; c++)
                    moved[c] += images.shift[r] * unit.search.scene.lattice.rows[r][c];
            }
            CHECK(memcmp(moved, images.moved, (size_t)d * sizeof *moved) == 0);
            met[at]++;
        }
        CHECK((double)n == images.count);
        n_near += compare_with_all(&group, met);
        n_met += n;
        nearest_unit_close(&unit);
    }
    CHECK(n_near > 200 && n_met < 4 * n_near);
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
    CHECK(images.count == 1.0 && hs_nearest_images_next(&images) && images.shift[0] == 0);
    group.radius = 0.625;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK && images.count == 2.0);
    nearest_unit_close(&unit);
}

/* So far off, a quotient may err by more than the room that is left near the box. */
static void
room_grows_with_the_number_of_the_image(void)
{
    const double      x[2] = {0.0, 0.0};
    const hs_box      box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    const hs_points   points = points_in(x, 1, 2);
    hs_nearest_images images;
    nearest_unit_open(&points, NULL, &box, 1, HS_WANT_J, INFINITY, &unit);
    hs_nearest_group group = nearest_unit_group(&unit, 0.375 - 0x1p-12);
    unit.search.scene.lower[0] = unit.search.scene.upper[0] = 0.0;
    for (int sign = -1; sign <= 1; sign += 2) {
        group.t_lower[0] = group.t_upper[0] = sign * (0x1p29 - 0.375);
        CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
        CHECK(images.count == 1.0 && images.low[0] == sign * (INT64_C(1) << 29));
        group.t_lower[0] = group.t_upper[0] = sign * (0x1p29 + 0.375);
        CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
        CHECK(images.count == 1.0 && images.low[0] == sign * (INT64_C(1) << 29));
        group.t_lower[0] = group.t_upper[0] = sign * 0.375;
        CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK && images.count == 0.0);
    }
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
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_ERR_MEMORY);
    group.t_upper[0] = 0.0;
    group.t_lower[0] = -0x1p30;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_ERR_MEMORY);
    group.t_lower[0] = group.t_upper[0] = 0x1p30 - 4.0;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK && images.count <= 4.0);
    group = nearest_unit_group(&unit, 0x1p23 - 2.0); /* 2^24 are too many */
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
    group.radius = 0x1p23;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_ERR_MEMORY);
    unit.near.k = 1 << 15; /* but for so many neighbours */
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
    group.radius = 0x1p24;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_ERR_MEMORY);
    nearest_unit_close(&unit);
}

/* Each image may be 0.3 of a period off, so that there are more of them, which are further off. */
static void
images_that_drift_make_more_images(void)
{
    const double      x[1] = {0.0};
    const hs_box      box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    const hs_points   points = points_in(x, 1, 1);
    hs_nearest_images images;
    nearest_unit_open(&points, NULL, &box, 1, HS_WANT_J, INFINITY, &unit);
    const hs_nearest_group group = nearest_unit_group(&unit, 100.0);
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK && images.high[0] == 100);
    unit.search.scene.lattice.aligned = false;
    unit.near.drift[0][0] = 0.3;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
    CHECK(images.high[0] >= 100 + 0.3 * 130 && images.high[0] <= 100 + 0.3 * 145);
    CHECK(images.low[0] == -images.high[0]);
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
    hs_nearest_measure_layer(&unit.near);
    CHECK(unit.near.has_layer);
    CHECK(unit.near.layer_lower[1] == -1.0 && unit.near.layer_upper[1] == 2.0);
    lattice->normal[1][0] = 0x1p-39;
    hs_nearest_measure_layer(&unit.near);
    CHECK(!unit.near.has_layer);
    lattice->normal[1][0] = 0x1p-41;
    hs_nearest_measure_layer(&unit.near);
    CHECK(unit.near.has_layer);
    nearest_unit_close(&unit);
}

/* Box vectors that are rounded err by as much for each image. */
static void
errors_of_box_vectors_add_up(void)
{
    const double      x[4] = {0.0, 0.0, 0.5, 0.5};
    const hs_box      box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    const hs_points   points = points_in(x, 2, 2);
    hs_nearest_images images;
    nearest_unit_open(&points, NULL, &box, 1, HS_WANT_J, INFINITY, &unit);
    const hs_nearest_group group = nearest_unit_group(&unit, 3.0);
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
    const double most[2] = {fmax(-(double)images.low[0], (double)images.high[0]),
                            fmax(-(double)images.low[1], (double)images.high[1])};
    const double exact = images.error;
    CHECK(most[0] >= 3.0 && most[1] >= 3.0 && exact > 0.0 && exact < 0x1p-40);
    unit.search.scene.lattice.row_error[0] = 0x1p-20;
    unit.search.scene.lattice.row_error[1] = 0x1p-22;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
    CHECK(images.error == exact + (most[0] * 0x1p-20 + most[1] * 0x1p-22));
    unit.search.scene.x_error = 0x1p-10;
    CHECK(hs_nearest_images_start(&unit.near, &group, &images) == HS_OK);
    CHECK(images.error >= 0x1p-9 + exact && images.error < 0x1.1p-9);
    nearest_unit_close(&unit);
}

void
test_nearest_images(void)
{
    RUN(errors_of_box_vectors_add_up);
    RUN(images_in_reach_are_met_once);
    RUN(there_may_be_no_image_in_reach);
    RUN(room_grows_with_the_number_of_the_image);
    RUN(more_images_than_can_be_counted_are_refused);
    RUN(images_that_drift_make_more_images);
    RUN(layers_are_upright);
}
