/* SPDX-License-Identifier: BSD-3-Clause */
/* test_lattice.c: a lattice has the box's points, unit normals, heights and its volume, in a short
 * basis or in the box vectors as given. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/box/lattice.h"
#include "../support/harness.h"

#include <float.h>
#include <math.h>

void test_lattice(void);

/* Two steps, for 2^1074 is no double. */
static void
scales_are_powers_of_two(void)
{
    for (int exponent = -1100; exponent <= 1074; exponent += 7) {
        const hs_scale scale = hs_scale_of(exponent);
        const double   size = exponent >= 0 ? 0x1p1000 : 0x1p-70;
        CHECK(scale.exponent == exponent);
        CHECK(hs_scale_apply(scale, size) == ldexp(size, -exponent));
    }
    CHECK(hs_scale_of(0).first == 1.0 && hs_scale_of(0).second == 1.0);
    CHECK(hs_scale_apply(hs_scale_of(-1074), 0x1p-1074) == 1.0);
    CHECK(hs_scale_apply(hs_scale_of(1073), 0x1p1023) == 0x1p-50);
}

/* A box of two dimensions has two rows of two numbers: what lies beyond is of no meaning. */
static void
numbers_beyond_the_dimension_are_not_read(void)
{
    hs_failure failure;
    for (int l = 0; l < 3; l++) {
        for (int k = 0; k < 3; k++) {
            hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.5, 1.0}}};
            box.rows[l][k] = NAN;
            const bool is_read = l < 2 && k < 2;
            CHECK(hs_box_check(&box, &failure) == (is_read ? HS_ERR_BOX_FINITE : HS_OK));
            CHECK(!is_read || (failure.row == l && failure.column == k && isnan(failure.value)));
        }
    }
    CHECK(hs_box_check(NULL, &failure) == HS_OK);
}

/* Zero vectors, vectors in one column and dependent ones are refused; open ones may be anything. */
static void
periodic_vectors_must_be_independent(void)
{
    hs_failure failure = HS_NO_FAILURE;
    hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 2.0}, {2.0, 4.0}}};
    CHECK(hs_box_check(&box, &failure) == HS_ERR_BOX_DEPENDENT && failure.row == -1);
    box.periodic[0] = false;
    CHECK(hs_box_check(&box, &failure) == HS_OK);
    box.rows[1][0] = box.rows[1][1] = 0.0;
    CHECK(hs_box_check(&box, &failure) == HS_ERR_BOX_DEPENDENT);
    box.periodic[1] = false;
    CHECK(hs_box_check(&box, &failure) == HS_OK);
    box = (hs_box){.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {-3.0, 0.0}}};
    CHECK(hs_box_check(&box, &failure) == HS_ERR_BOX_DEPENDENT);
    box.rows[1][1] = 0x1p-1074;
    CHECK(hs_box_check(&box, &failure) == HS_OK);
}

/* Nothing is reduced or rounded. A negative entry is turned round, and U with it; a column may be
 * any row's. */
static void
aligned_boxes_keep_their_axes(void)
{
    const hs_box box = {.ndim = 3,
                        .periodic = {true, false, true},
                        .rows = {{0.0, 0.0, -3.0}, {9.0, 9.0, 9.0}, {0.7, 0.0, 0.0}}};
    hs_lattice   lattice;
    memset(&lattice, 0x5a, sizeof lattice);
    hs_lattice_init(&box, 3, hs_scale_of(0), &lattice);
    CHECK(lattice.ndim == 3 && lattice.n_periodic == 2 && lattice.aligned && !lattice.reduced);
    CHECK(lattice.vector_of_row[0] == 0 && lattice.vector_of_row[1] == 2);
    CHECK(lattice.row_of_axis[0] == 1 && lattice.row_of_axis[1] == -1);
    CHECK(lattice.row_of_axis[2] == 0 && lattice.period[1] == 0.0);
    CHECK(lattice.period[0] == 0.7 && lattice.period[2] == 3.0);
    CHECK(lattice.rows[0][2] == 3.0 && lattice.scaled[0][2] == -3.0 && lattice.given[0][2] == -3.0);
    CHECK(lattice.U[0][0] == -1 && lattice.U[0][1] == 0 && lattice.U[1][0] == 0);
    CHECK(lattice.U[1][1] == 1 && lattice.row_error[0] == 0.0 && lattice.row_error[1] == 0.0);
    for (int k = 0; k < 3; k++) {
        for (int c = 0; c < 3; c++)
            CHECK(lattice.normal[k][c] == (k == c) && lattice.direction[k][c] == (k == c));
    }
    CHECK(fabs(hs_lattice_volume(&lattice, 0) - 2.1) < 1e-15);
    CHECK(fabs(hs_lattice_volume(&lattice, -3) - 2.1 / 64.0) < 1e-17);
}

static void
without_a_box_all_is_open(void)
{
    hs_lattice lattice;
    memset(&lattice, 0x5a, sizeof lattice);
    hs_lattice_init(NULL, 2, hs_scale_of(5), &lattice);
    CHECK(lattice.aligned && !lattice.reduced && lattice.n_periodic == 0 && lattice.ndim == 2);
    CHECK(lattice.row_of_axis[0] == -1 && lattice.row_of_axis[1] == -1);
    CHECK(lattice.period[0] == 0.0 && hs_lattice_volume(&lattice, 7) == 1.0);
    CHECK(lattice.normal[1][0] == 0.0 && lattice.normal[1][1] == 1.0);
}

/* A box that is sheared by whole widths is aligned. */
static void
sheared_boxes_may_be_upright(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0, 0.0}, {12.0, 2.0}}};
    hs_lattice   lattice;
    hs_lattice_init(&box, 2, hs_scale_of(1), &lattice);
    CHECK(lattice.aligned && lattice.reduced && lattice.given[1][0] == 12.0);
    CHECK(lattice.scaled[1][0] == 6.0);
    CHECK(lattice.period[0] == 2.0 && lattice.period[1] == 1.0);
    for (int r = 0; r < 2; r++) {
        for (int k = 0; k < 2; k++)
            CHECK(lattice.rows[r][k] == (double)lattice.U[r][0] * lattice.scaled[0][k] +
                                            (double)lattice.U[r][1] * lattice.scaled[1][k]);
    }
    CHECK(hs_lattice_volume(&lattice, 0) == 2.0 && hs_lattice_volume(&lattice, 1) == 8.0);
}

static void
make_box(harness_random *random, int ndim, bool has_open, hs_box *box)
{
    *box = (hs_box){.ndim = ndim};
    for (int l = 0; l < ndim; l++) {
        box->periodic[l] = !has_open || random_bits(random) % 3 != 0;
        for (int k = 0; k < ndim; k++)
            box->rows[l][k] = (l == k) * 3.0 + 2.0 * random_unit(random) - 1.0;
    }
}

static double
product(int ndim, const double *a, const double *b)
{
    double sum = 0.0;
    for (int k = 0; k < ndim; k++)
        sum += a[k] * b[k];
    return sum;
}

/* Unit normals, upright on all other rows; the directions are their inverse. */
static void
normals_are_upright_unit_vectors(void)
{
    harness_random random = {881};
    for (int trial = 0; trial < 400; trial++) {
        const int  ndim = 1 + trial % HS_MAX_DIM;
        hs_box     box;
        hs_lattice of;
        make_box(&random, ndim, trial % 2, &box);
        hs_lattice_init(&box, ndim, hs_scale_of(0), &of);
        bool right = true;
        for (int k = 0; k < ndim; k++) {
            right = right && fabs(product(ndim, of.normal[k], of.normal[k]) - 1.0) < 1e-14;
            for (int r = 0; r < of.n_periodic; r++) {
                const double along = product(ndim, of.normal[k], of.rows[r]);
                right = right && (of.row_of_axis[k] == r ? along == of.period[k] && along > 0.0
                                                         : fabs(along) < 1e-14);
            }
            for (int l = 0; l < ndim; l++)
                right = right &&
                        fabs(product(ndim, of.normal[k], of.direction[l]) - (k == l)) < 1e-12;
            right = right && (of.row_of_axis[k] >= 0) == box.periodic[k];
        }
        CHECK(right);
    }
}

/* In the box vectors as given each axis is its vector's; heights and volume are those of the
 * box. */
static void
given_vectors_keep_their_axes(void)
{
    harness_random random = {882};
    for (int trial = 0; trial < 400; trial++) {
        const int  ndim = 1 + trial % HS_MAX_DIM;
        hs_box     box;
        hs_lattice of, reduced;
        make_box(&random, ndim, trial % 2, &box);
        if (trial % 5 == 0) { /* far from short */
            for (int k = 0; k < ndim; k++)
                box.rows[ndim - 1][k] += 40.0 * box.rows[0][k] * (ndim > 1 && box.periodic[0]);
        }
        hs_lattice_init_given(&box, hs_scale_of(0), &of);
        hs_lattice_init(&box, ndim, hs_scale_of(0), &reduced);
        bool right = hs_lattice_volume(&of, 0) == hs_lattice_volume(&reduced, 0);
        for (int k = 0; k < ndim; k++) {
            const int l = of.row_of_axis[k];
            right = right && (l >= 0) == box.periodic[k];
            if (l < 0)
                continue;
            right = right && of.vector_of_row[l] == k &&
                    memcmp(of.rows[l], box.rows[k], (size_t)ndim * sizeof(double)) == 0;
            right = right && fabs(product(ndim, of.normal[k], of.normal[k]) - 1.0) < 1e-14;
            for (int r = 0; r < of.n_periodic; r++) {
                const double along = product(ndim, of.normal[k], of.rows[r]);
                right = right && fabs(along - (r == l ? of.period[k] : 0.0)) < 1e-11;
            }
        }
        CHECK(right);
    }
}

/* Upright boxes have their own lengths, to the last bit. */
static void
upright_heights_are_not_rounded(void)
{
    const hs_box box = {.ndim = 3,
                        .periodic = {true, true, false},
                        .rows = {{0.0, -0.7}, {1e300}, {1.0, 1.0, 1.0}}};
    hs_lattice   of;
    hs_lattice_init_given(&box, hs_scale_of(0), &of);
    CHECK(of.period[0] == 0.7 && of.period[1] == 1e300);
    CHECK(of.row_of_axis[0] == 0 && of.row_of_axis[1] == 1 && of.row_of_axis[2] == -1);
    CHECK(fabs(of.normal[0][1]) == 1.0 && of.normal[0][0] == 0.0);
}

/* Lengths whose product no double holds, and rows of very different size. */
static void
volumes_pass_the_range_of_numbers(void)
{
    hs_box     box = {.ndim = 8};
    hs_lattice of;
    for (int tilted = 0; tilted < 2; tilted++) {
        for (int l = 0; l < 8; l++) {
            box.periodic[l] = true;
            box.rows[l][l] = 0x1.8p1000;
            if (tilted && l > 0)
                box.rows[l][l - 1] = 0x1p999;
        }
        hs_lattice_init(&box, 8, hs_scale_of(0), &of);
        CHECK(of.aligned == !tilted && hs_lattice_volume(&of, 0) == INFINITY);
        const double volume = hs_lattice_volume(&of, -1000), expected = pow(1.5, 8.0);
        CHECK(fabs(volume - expected) < 1e-12 * expected);
        CHECK(fabs(of.volume_mantissa) >= 0.5 && of.volume_mantissa < 1.0);
    }
}

/* S = s U, or false where that passes 2^62. */
static void
shifts_are_those_over_the_given_vectors(void)
{
    const int64_t most = INT64_C(1) << 61;
    hs_lattice    lattice = {.ndim = 2, .n_periodic = 2, .U = {{1, -3}, {0, 2}}};
    int64_t       given[HS_MAX_DIM] = {7, 7, 7};
    CHECK(hs_lattice_shift(&lattice, (const int64_t[]){5, -4}, given));
    CHECK(given[0] == 5 && given[1] == -23 && given[2] == 7);
    CHECK(hs_lattice_shift(&lattice, (const int64_t[]){0, 0}, given));
    CHECK(given[0] == 0 && given[1] == 0);
    CHECK(hs_lattice_shift(&lattice, (const int64_t[]){-most / 4, 1}, given));
    CHECK(given[0] == -most / 4 && given[1] == 3 * (most / 4) + 2);
    CHECK(!hs_lattice_shift(&lattice, (const int64_t[]){most, 0}, given));
    lattice.U[0][1] = 2;
    CHECK(!hs_lattice_shift(&lattice, (const int64_t[]){most, 0}, given)); /* 2^62 itself */
    CHECK(!hs_lattice_shift(&lattice, (const int64_t[]){-most, 0}, given));
    CHECK(hs_lattice_shift(&lattice, (const int64_t[]){most - (1 << 20), 0}, given));
    CHECK(given[1] == 2 * (most - (1 << 20)));
    /* Terms that cancel leave a small sum, which they are too large to tell. */
    lattice.U[0][0] = lattice.U[1][0] = INT64_C(1) << 40;
    CHECK(!hs_lattice_shift(&lattice, (const int64_t[]){INT64_C(1) << 62, -(INT64_C(1) << 62)},
                            given) ||
          given[0] == 0);
}

void
test_lattice(void)
{
    RUN(scales_are_powers_of_two);
    RUN(numbers_beyond_the_dimension_are_not_read);
    RUN(periodic_vectors_must_be_independent);
    RUN(aligned_boxes_keep_their_axes);
    RUN(without_a_box_all_is_open);
    RUN(sheared_boxes_may_be_upright);
    RUN(normals_are_upright_unit_vectors);
    RUN(given_vectors_keep_their_axes);
    RUN(upright_heights_are_not_rounded);
    RUN(volumes_pass_the_range_of_numbers);
    RUN(shifts_are_those_over_the_given_vectors);
}
