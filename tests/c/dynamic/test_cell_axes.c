/* SPDX-License-Identifier: BSD-3-Clause */
/* test_cell_axes.c: the cells of a ball hold every coordinate within it, and gaps are no larger than
 * distances, at any width, radius and distance from the origin. */
#include "../../../csrc/core/base/fpenv.h"
#include "../../../csrc/core/dynamic/cell_axes.h"
#include "../support/harness.h"

void test_cell_axes(void);

static hs_axes
axes_of(double length, double cell_size, double radius)
{
    hs_box     box = {.ndim = 1, .periodic = {length > 0.0}, .rows = {{length}}};
    hs_lattice lattice;
    hs_axes    axes;
    hs_lattice_init(length > 0.0 ? &box : NULL, 1, hs_scale_of(0), &lattice);
    hs_axes_init(&axes, &lattice, cell_size, false, radius);
    return axes;
}

/* A number of ordinary size, often with few digits. */
static double
some_number(harness_random *random)
{
    const double x = ldexp(random_unit(random) - 0.5, (int)(random_bits(random) % 40) - 10);
    return random_bits(random) % 2 == 0 ? x : rint(x * 8.0) / 8.0;
}

static void
open_balls_hold_what_is_within(void)
{
    harness_random random = {7};
    for (int trial = 0; trial < TRIALS(200000); trial++) {
        const double   width = fabs(some_number(&random)) + 0x1p-20;
        const int      times = (int)(random_bits(&random) % 5);
        const double   radius = trial % 2 == 0 ? width * times : width * 5.0 * random_unit(&random);
        const hs_axes  axes = axes_of(0.0, width, radius);
        const hs_axis *axis = &axes.axis[0];
        const double   t = some_number(&random);
        hs_span_of_cells span;
        hs_axis_span(axis, t, hs_axis_cell(axis, t), radius, 0.0, &span);
        for (int side = -1; side <= 1; side += 2) {
            double y = t + side * radius;
            while (fabs(y - t) > radius) /* not beyond, for the numbers as rounded */
                y = nextafter(y, t);
            const int64_t cell = hs_axis_cell(axis, y);
            CHECK(cell >= span.first && cell <= span.last);
            CHECK(sqrt(hs_axis_gap(axis, t, cell, span.centre)) <= fabs(y - t) * (1.0 + 0x1p-50));
        }
        CHECK(span.first <= span.centre && span.centre <= span.last);
    }
}

/* Every image of a point within the radius has its u in the span, and the gap of u is no more. */
static void
periodic_balls_hold_what_is_within(void)
{
    harness_random random = {8};
    for (int trial = 0; trial < TRIALS(100000); trial++) {
        const double     length = 0.5 + 8.0 * random_unit(&random);
        const double     width = length / (0.5 + 9.0 * random_unit(&random));
        const double     radius = 3.0 * length * random_unit(&random);
        const hs_axes    axes = axes_of(length, width, radius);
        const hs_axis   *axis = &axes.axis[0];
        const double     t = (random_unit(&random) - 0.5) * length;
        const double     x = (random_unit(&random) - 0.5) * length;
        hs_span_of_cells span;
        hs_axis_span(axis, t, hs_axis_cell(axis, t), radius, 0.0, &span);
        CHECK(axis->width >= width * (1.0 - 0x1p-50) || axis->n == 1);
        for (int image = -5; image <= 5; image++) {
            const double  y = x + image * length;
            const int64_t u = hs_axis_cell(axis, x) + image * axis->n;
            CHECK(hs_axis_image(axis, u) == image);
            if (fabs(y - t) <= radius * (1.0 - 0x1p-40)) {
                CHECK(u >= span.first && u <= span.last);
                CHECK(image >= span.least && image <= span.most);
                CHECK(hs_axis_gap(axis, t, u, span.centre) <= (y - t) * (y - t) + 0x1p-40);
            }
        }
    }
}

/* What is well inside an image meets that image and no other. */
static void
balls_meet_no_more_images_than_they_must(void)
{
    const hs_axes axes = axes_of(4.0, 0.5, 9.0);
    for (int image = -3; image <= 3; image++) {
        for (int further = 0; further <= 2; further++) {
            hs_span_of_cells span;
            hs_axis_images(&axes.axis[0], 4.0 * image - 1.9, 4.0 * (image + further) + 1.9, 0.01,
                           &span);
            CHECK(span.least == image && span.most == image + further);
        }
    }
}

/* x + image * length, rounded up or down, by exact sums of what is rounded. */
static double
image_of(double x, double image, double length, double towards)
{
    const double shift = image * length, rest = fma(image, length, -shift);
    const double sum = shift + x, back = sum - shift;
    const double error = (shift - (sum - back)) + (x - back) + rest;
    const bool   is_passed = towards > 0.0 ? error > 0.0 : error < 0.0;
    return is_passed ? nextafter(sum, towards) : sum;
}

/* Periods whose multiples are rounded: the end of a ball that is the image of a number next to an
 * edge of its cell still has this cell, on either side. */
static void
ends_in_far_images_are_held(void)
{
    harness_random random = {9};
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const double     length = 0.5 + 8.0 * random_unit(&random);
        const int        n = 2 + (int)(random_bits(&random) % 9);
        const hs_axes    axes = axes_of(length, length / (n + 0.25), 1.0);
        const hs_axis   *axis = &axes.axis[0];
        const int64_t    cell = 1 + (int64_t)(random_bits(&random) % (uint64_t)(n - 1));
        const int64_t    image = (trial % 2 ? 1 : -1) * (2 + trial / 2 % 300);
        const double     step = ldexp(1.0, ilogb(length) - 53); /* no coordinate has finer ones */
        double           x = (double)cell * axis->width - axis->half;
        hs_span_of_cells span;
        for (int n_steps = 0; n_steps < 1000 && hs_axis_cell(axis, x) >= cell; n_steps++)
            x -= step;
        for (int n_steps = 0; n_steps < 1000 && hs_axis_cell(axis, x + step) < cell; n_steps++)
            x += step;
        const double low = image_of(x, (double)image, length, -HUGE_VAL);
        hs_axis_images(axis, low, low + length, 0.0, &span);
        CHECK(axis->n == n && span.first <= hs_axis_cell(axis, x) + image * n);
        x += step;
        const double high = image_of(x, (double)image, length, HUGE_VAL);
        hs_axis_images(axis, high - length, high, 0.0, &span);
        CHECK(span.last >= hs_axis_cell(axis, x) + image * n);
    }
}

/* A period is divided into as many cells as fit, each of which has its middle. */
static void
cells_divide_the_period(void)
{
    for (int n = 1; n <= 9; n++) {
        const double   length = 4.0, wanted = length / (n + 0.5);
        const hs_axes  axes = axes_of(length, wanted, 1.0);
        const hs_axis *axis = &axes.axis[0];
        CHECK(axis->n == n && axis->width == length / n);
        CHECK(axis->inverse == (n > 1 ? 1.0 / axis->width : 0.0));
        for (int cell = 0; cell < n; cell++)
            CHECK(hs_axis_cell(axis, (cell + 0.5) * length / n - 0.5 * length) == cell);
    }
}

static void
far_cells_are_one(void)
{
    const hs_axes axes = axes_of(0.0, 1.0, 1.0);
    CHECK(hs_axis_cell(&axes.axis[0], 1e300) == (int64_t)HS_FARTHEST_CELL);
    CHECK(hs_axis_cell(&axes.axis[0], -1e300) == -(int64_t)HS_FARTHEST_CELL);
    CHECK(hs_axis_cell(&axes.axis[0], -0.5) == -1 && hs_axis_cell(&axes.axis[0], -1.0) == -1);
    CHECK(hs_axis_image(&axes.axis[0], -7) == 0);
}

/* By how much a move along B, times that of an image, differs from whole periods along axis k. */
static long double
miss_of(const hs_lattice *lattice, int j, int k)
{
    const int   r = lattice->row_of_axis[j];
    long double along = j == k ? -(long double)lattice->period[k] : 0.0L;
    for (int c = 0; r >= 0 && c < lattice->ndim; c++) {
        long double entry = 0.0L;
        for (int l = 0; l < lattice->n_periodic; l++)
            entry += (long double)lattice->U[r][l] * lattice->scaled[l][c];
        along += lattice->normal[k][c] * entry;
    }
    return fabsl(along);
}

/* Of rows of very different lengths, some of them open. */
static void
fill_skewed_box(harness_random *random, int trial, hs_box *box)
{
    for (int l = 0; l < box->ndim; l++) {
        const double length = ldexp(1.0 + random_unit(random), (int)(random_bits(random) % 3) * 10);
        box->periodic[l] = trial % 7 != 0 || l > 0;
        box->rows[l][l] = length;
        for (int c = 0; trial % 5 != 0 && c < l; c++)
            box->rows[l][c] = length * 9.0 * (random_unit(random) - 0.5);
    }
}

/* The images are those that a ball of the radius meets, and one more on either side. */
static void
leaks_are_bounds_of_what_images_miss_periods_by(void)
{
    harness_random random = {10};
    int            n_aligned = 0, n_open = 0;
    for (int trial = 0; trial < TRIALS(4000); trial++) {
        const int    d = 2 + trial % 3;
        const double radius = ldexp(1.0 + random_unit(&random), trial / 12 % 12 - 4);
        hs_box       box = {.ndim = d};
        hs_lattice   lattice;
        hs_axes      axes;
        fill_skewed_box(&random, trial, &box);
        hs_lattice_init(&box, d, hs_scale_of(0), &lattice);
        hs_axes_init(&axes, &lattice, 0.5, trial % 2 == 0, radius);
        for (int k = 0; k < d; k++) {
            long double least = 0.0L, most = 0.0L;
            for (int j = 0; j < d; j++) {
                const bool        is_open = lattice.row_of_axis[j] < 0;
                const long double n_images = is_open ? 0.0L : ceill(radius / lattice.period[j]) + 1;
                least += n_images * miss_of(&lattice, j, k);
                most += (n_images + (is_open ? 0.0L : 32.0L)) * 0x1p-12L;
            }
            CHECK(axes.axis[k].leak >= least && axes.axis[k].leak <= most);
            CHECK(axes.axis[k].leak == 0.0 || !lattice.aligned);
            n_open += lattice.row_of_axis[k] < 0;
        }
        n_aligned += lattice.aligned;
    }
    CHECK(n_aligned > TRIALS(500) && n_open > TRIALS(200));
}

static void
leaks_are_scaled_with_the_lengths(void)
{
    hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{3.0}, {1.0, 2.0}}};
    hs_lattice lattice, scaled;
    hs_axes    axes, of_scaled;
    hs_lattice_init(&box, 2, hs_scale_of(0), &lattice);
    hs_axes_init(&axes, &lattice, 0.5, false, 7.0);
    hs_lattice_init(&box, 2, hs_scale_of(200), &scaled);
    hs_axes_init(&of_scaled, &scaled, ldexp(0.5, -200), false, ldexp(7.0, -200));
    for (int k = 0; k < 2; k++) {
        CHECK(axes.axis[k].leak > 0.0 && axes.axis[k].n == of_scaled.axis[k].n);
        CHECK(of_scaled.axis[k].leak == ldexp(axes.axis[k].leak, -200));
    }
}

void
test_cell_axes(void)
{
    const hs_fpenv env = hs_fpenv_enter();
    RUN(open_balls_hold_what_is_within);
    RUN(periodic_balls_hold_what_is_within);
    RUN(balls_meet_no_more_images_than_they_must);
    RUN(ends_in_far_images_are_held);
    RUN(leaks_are_bounds_of_what_images_miss_periods_by);
    RUN(leaks_are_scaled_with_the_lengths);
    RUN(cells_divide_the_period);
    RUN(far_cells_are_one);
    hs_fpenv_leave(env);
}
