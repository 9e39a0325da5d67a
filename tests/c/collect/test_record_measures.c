/* SPDX-License-Identifier: BSD-3-Clause */
/* test_record_measures.c: d, D and S are those of the pair as it is listed: of i < j, or of a point
 * and its image in positive direction. */
#include "../support/record_unit.h"

void test_record_measures(void);

enum { N = 90 };

static search_unit unit;
static record_unit recorded;

/* D is x_j + S A - x_i, d its length and within the cutoff; S is 0 along open vectors. */
static int64_t
wrong_pairs(const hs_box *box, double cutoff)
{
    const int      d = unit.points.ndim;
    const double  *distance = hs_output_column(&recorded.output, HS_WANT_DISTANCE);
    const double  *vector = hs_output_column(&recorded.output, HS_WANT_VECTOR);
    const int32_t *shift = hs_output_column(&recorded.output, HS_WANT_SHIFT);
    int64_t        wrong = 0;
    for (int64_t e = 0; e < recorded.output.n_pairs; e++) {
        const int64_t  i = recorded_index(&recorded, HS_WANT_I, e);
        const int64_t  j = recorded_index(&recorded, HS_WANT_J, e);
        const int32_t *S = shift + e * d;
        double         square = 0.0, first = 0.0;
        for (int k = 0; k < d; k++) {
            double D = unit.x[j * d + k] - unit.x[i * d + k];
            for (int l = 0; l < d; l++)
                D += S[l] * box->rows[l][k];
            wrong += fabs(D - vector[e * d + k]) > 1e-12;
            wrong += !box->periodic[k] && S[k] != 0;
            first = first == 0.0 ? S[k] : first;
            square += vector[e * d + k] * vector[e * d + k];
        }
        wrong += fabs(sqrt(square) - distance[e]) > 1e-14 || distance[e] > cutoff;
        wrong += i > j || (i == j && first <= 0.0);
    }
    return wrong;
}

/* In one to three dimensions, upright and tilted, with open axes: narrow shifts, and those of
 * points that were kept as given. */
static void
pairs_are_measured_as_they_are_listed(void)
{
    const unsigned columns = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR |
                             HS_WANT_SHIFT;
    for (int trial = 0; trial < 3 * 2 * 3; trial++) {
        const int  d = 1 + trial % 3, open = trial / 6;
        const bool tilted = trial / 3 % 2;
        hs_box     box = {.ndim = d};
        int32_t    failed;
        int64_t    own = 0;
        for (int l = 0; l < d; l++) {
            box.periodic[l] = l != open - 1 || d == 1;
            box.rows[l][l] = 1.0 + 0.125 * l;
            box.rows[l][0] += tilted && l > 0 ? 0.375 : 0.0;
        }
        search_unit_points(120 + (uint64_t)trial, d == 1 ? 20 : N, d, 3.0, &unit);
        search_unit_open(&box, 1.25, false, columns, &unit);
        CHECK(record_all(&unit, columns, 8, &failed, &recorded) == HS_OK);
        CHECK(wrong_pairs(&box, 1.25) == 0 && recorded.output.n_pairs > 100);
        for (int64_t e = 0; e < recorded.output.n_pairs; e++)
            own += recorded_index(&recorded, HS_WANT_I, e) ==
                   recorded_index(&recorded, HS_WANT_J, e);
        CHECK(own > 0);
        record_unit_free(&unit, &recorded);
        search_unit_close(&unit);
    }
}

/* Shifts that pass int32 name the point whose hit it is; without S nothing is wrong. */
static void
shifts_that_do_not_fit_name_their_point(void)
{
    const hs_box box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    const double jumps[] = {0x1p31 - 4.0, 0x1p31 + 4.0, -0x1p31 + 4.0, -0x1p31 - 4.0};
    for (int trial = 0; trial < 4; trial++) {
        int32_t failed;
        unit.x[0] = 0.25;
        unit.x[1] = 0.375 + jumps[trial];
        unit.points = (hs_points){unit.x, 2, 1, HS_FLOAT64, 8, 8};
        search_unit_open(&box, 0.25, false, HS_WANT_SHIFT, &unit);
        const hs_status status = record_all(&unit, HS_WANT_SHIFT, 4, &failed, &recorded);
        CHECK(status == (trial % 2 ? HS_ERR_SHIFT_RANGE : HS_OK));
        CHECK(trial % 2 ? failed == 0 || failed == 1 : failed == -1);
        if (status == HS_OK)
            CHECK(*(int32_t *)hs_output_column(&recorded.output, HS_WANT_SHIFT) ==
                  -(int32_t)jumps[trial]);
        record_unit_free(&unit, &recorded);
        CHECK(record_all(&unit, HS_WANT_DISTANCE, 4, &failed, &recorded) == HS_OK);
        CHECK(*(double *)hs_output_column(&recorded.output, HS_WANT_DISTANCE) == 0.125);
        record_unit_free(&unit, &recorded);
        search_unit_close(&unit);
    }
}

void
test_record_measures(void)
{
    RUN(pairs_are_measured_as_they_are_listed);
    RUN(shifts_that_do_not_fit_name_their_point);
}
