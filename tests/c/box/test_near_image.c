/* SPDX-License-Identifier: BSD-3-Clause */
/* test_near_image.c: the nearest image among all, by whole numbers; of images that are equally near
 * the one with the least shift, also where points are far beside the rows that repeat. */
#include "../../../csrc/core/box/box_check.h"
#include "../../../csrc/core/box/near_image.h"
#include "../support/random_scenes.h"

#include <math.h>

void test_near_image(void);

enum { SPACE = 3, FARTHEST = 24 }; /* no nearest image of the boxes here has a larger shift */

/* Whole numbers from -most to most. */
static double
random_whole(harness_random *random, int most)
{
    return random_below(random, 2 * most + 1) - most;
}

/* A box of d small rows, of which some repeat and are independent. */
static hs_box
random_whole_box(harness_random *random, int d)
{
    hs_box box;
    double rows[HS_MAX_DIM][HS_MAX_DIM];
    int    m;
    do {
        m = 0;
        memset(&box, 0, sizeof box);
        box.ndim = d;
        for (int l = 0; l < d; l++) {
            box.periodic[l] = random_below(random, 3) > 0;
            for (int k = 0; k < d; k++)
                box.rows[l][k] = random_whole(random, d < SPACE ? 2 : 1);
            if (box.periodic[l])
                memcpy(rows[m++], box.rows[l], sizeof rows[0]);
        }
    } while (m == 0 || !hs_rows_independent(d, m, (const double(*)[HS_MAX_DIM])rows));
    return box;
}

/* |q + S * box - p|^2, S being over the rows that repeat. */
static double
square_of(const hs_box *box, const double *p, const double *q, const int64_t *shift)
{
    double square = 0.0;
    for (int k = 0; k < box->ndim; k++) {
        double along = q[k] - p[k];
        for (int l = 0, r = 0; l < box->ndim; l++)
            along += box->periodic[l] ? (double)shift[r++] * box->rows[l][k] : 0.0;
        square += along * along;
    }
    return square;
}

/* The least shift of all that give the least distance. */
static void
find_nearest(const hs_box *box, int m, const double *p, const double *q, int64_t *nearest)
{
    int64_t shift[SPACE] = {-FARTHEST, -FARTHEST, -FARTHEST};
    double  least = HUGE_VAL;
    int     r = 0;
    while (r >= 0) {
        const double square = square_of(box, p, q, shift);
        if (square < least) {
            least = square;
            memcpy(nearest, shift, sizeof shift);
        }
        for (r = m - 1; r >= 0 && ++shift[r] > FARTHEST; r--)
            shift[r] = -FARTHEST;
    }
}

/* Of lengths of any size: numbers of the box and of the points times a power of two. */
static void
it_is_the_first_of_the_nearest_images(void)
{
    harness_random random = {51};
    for (int trial = 0; trial < TRIALS(600); trial++) {
        const int    d = trial % 20 ? 1 + trial % 2 : SPACE;
        const double size = ldexp(1.0, 700 * (trial % 3 - 1));
        const hs_box box = random_whole_box(&random, d);
        hs_box       sized = box;
        double       p[SPACE], q[SPACE], sized_p[SPACE], sized_q[SPACE];
        int64_t      shift[SPACE] = {99, 99, 99}, expected[SPACE];
        hs_image_box images;
        for (int k = 0; k < d; k++) {
            p[k] = random_whole(&random, d < SPACE ? 2 : 1);
            q[k] = random_whole(&random, d < SPACE ? 2 : 1);
            sized_p[k] = p[k] * size;
            sized_q[k] = q[k] * size;
            for (int l = 0; l < d; l++)
                sized.rows[l][k] = box.rows[l][k] * size;
        }
        CHECK(hs_image_box_init(&sized, d, &images) == HS_OK);
        const int m = images.lattice.n_periodic;
        CHECK(hs_near_image(&images, sized_p, sized_q, shift) == HS_OK);
        find_nearest(&box, m, p, q, expected);
        CHECK(memcmp(shift, expected, (size_t)m * sizeof *shift) == 0);
    }
}

/* Two images of a point that is half a row away, and far away at a right angle to the row, are
 * equally near: what is rounded is as large as the coordinates, not as the row. */
static void
points_far_beside_a_row_have_two_nearest_images(void)
{
    harness_random random = {52};
    for (int trial = 0; trial < 400; trial++) {
        const double  a = 1 + random_below(&random, 9), b = 1 + random_below(&random, 9);
        const double  far = ldexp(1.0, trial / 10);
        const hs_box  box = {.ndim = 2, .periodic = {true}, .rows = {{a, b}}};
        const double  places[2][2] = {{0.0, 0.0}, {-b * far, a * far}};
        const double *from = places[trial & 1];
        const int     further = trial >> 1 & 1; /* or else at the same of two places */
        const double *to = places[further ? !(trial & 1) : trial & 1];
        const double  half[2] = {to[0] + 0.5 * a, to[1] + 0.5 * b};
        hs_image_box  images;
        int64_t       shift = 99;
        CHECK(hs_image_box_init(&box, 2, &images) == HS_OK);
        CHECK(hs_near_image(&images, from, half, &shift) == HS_OK && shift == -1);
        CHECK(hs_near_image(&images, half, from, &shift) == HS_OK && shift == 0);
    }
}

/* In the middle of a cube that is turned in the plane of each two axes. */
static void
the_middle_of_a_cube_has_as_many_as_it_has_corners(void)
{
    const double p[HS_MAX_DIM] = {0.0};
    double       middle[HS_MAX_DIM] = {0.0};
    hs_box       box = {.ndim = HS_MAX_DIM};
    hs_image_box images;
    int64_t      shift[HS_MAX_DIM];
    for (int l = 0; l < HS_MAX_DIM; l++) {
        box.periodic[l] = true;
        box.rows[l][l] = 4.0;
        box.rows[l][l ^ 1] = l & 1 ? -3.0 : 3.0;
        middle[l] += 2.0;
        middle[l ^ 1] += l & 1 ? -1.5 : 1.5;
    }
    CHECK(hs_image_box_init(&box, HS_MAX_DIM, &images) == HS_OK);
    CHECK(hs_near_image(&images, p, middle, shift) == HS_OK);
    for (int l = 0; l < HS_MAX_DIM; l++)
        CHECK(shift[l] == -1);
    CHECK(hs_near_image(&images, middle, p, shift) == HS_OK);
    for (int l = 0; l < HS_MAX_DIM; l++)
        CHECK(shift[l] == 0);
}

/* The unit is that of the longest component: squares of others do not tell whether these fit. */
static void
rows_may_be_long_along_any_axis(void)
{
    const double p[2] = {0.0, 0.0};
    for (int k = 0; k < 2; k++) {
        hs_box       box = {.ndim = 2, .periodic = {true, false}};
        double       q[2];
        hs_image_box images;
        int64_t      shift = 99;
        box.rows[0][k] = 0x1p1000;
        box.rows[0][1 - k] = 1.0;
        q[k] = 0.75 * 0x1p1000;
        q[1 - k] = 0.75;
        CHECK(hs_image_box_init(&box, 2, &images) == HS_OK);
        CHECK(hs_near_image(&images, p, q, &shift) == HS_OK && shift == -1);
        CHECK(hs_near_image(&images, q, p, &shift) == HS_OK && shift == 1);
    }
}

void
test_near_image(void)
{
    RUN(rows_may_be_long_along_any_axis);
    RUN(it_is_the_first_of_the_nearest_images);
    RUN(points_far_beside_a_row_have_two_nearest_images);
    RUN(the_middle_of_a_cube_has_as_many_as_it_has_corners);
}
