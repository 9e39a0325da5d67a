/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_box.c: measuring and wrapping, plans, and what each failure says. */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_api_box(void);

static random_scene shared;

static void
upright_boxes_have_their_own_lengths(void)
{
    for (int trial = 0; trial < 40; trial++) {
        const double scale = ldexp(1.0, trial % 5 * 200 - 400);
        hs_box       box = {.ndim = 4, .periodic = {true, true, trial % 2, true}};
        double       heights[4] = {-1.0, -1.0, -1.0, -1.0}, volume = -1.0;
        box.rows[0][0] = 3.0 * scale;
        box.rows[1][2] = -0.1;
        box.rows[2][3] = 7.0;
        box.rows[3][1] = 0.3;
        CHECK(hs_box_measure(&box, heights, &volume, NULL) == HS_OK);
        CHECK(heights[0] == 3.0 * scale && heights[1] == 0.1 && heights[3] == 0.3);
        CHECK(heights[2] == (trial % 2 ? 7.0 : -1.0));
        const double expected = 3.0 * scale * 0.1 * 0.3 * (trial % 2 ? 7.0 : 1.0);
        CHECK(fabs(volume - expected) <= 1e-14 * expected);
        CHECK(hs_box_measure(&box, NULL, NULL, NULL) == HS_OK);
    }
}

/* Heights are the inverse lengths of the duals; their product with the rest is the volume. */
static void
heights_are_inverse_duals(void)
{
    harness_random random = {11235};
    for (int trial = 0; trial < 500; trial++) {
        brute_rows r;
        double     heights[HS_MAX_DIM], volume, again;
        make_scene(&random, trial % 2 ? SCENE_TRICLINIC : SCENE_MIXED, 1 + trial % 8, 1, 4.0,
                   trial % 3 ? 0 : random_below(&random, 240) - 120, &shared);
        if (!brute_prepare(&shared.scene, &r) || r.uncertainty > 1e-12L)
            continue;
        CHECK(hs_box_measure(&shared.box, heights, &volume, NULL) == HS_OK);
        for (int l = 0; l < r.m; l++)
            CHECK(fabsl(heights[r.axis[l]] * r.dual_length[l] - 1.0L) < 1e-11L);
        CHECK(volume > 0.0 || r.m == 0);
        if (r.m > 0) { /* without one vector the volume is less by that vector's height */
            const int last = r.axis[r.m - 1];
            shared.box.periodic[last] = false;
            CHECK(hs_box_measure(&shared.box, NULL, &again, NULL) == HS_OK);
            CHECK(fabs(again * heights[last] / volume - 1.0) < 1e-9);
        }
    }
}

/* Rows of very different length must not be scaled to nothing. */
static void
heights_of_very_different_size_are_told(void)
{
    hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1e300}, {0.0, 1e-300}}};
    double heights[2], volume;
    CHECK(hs_box_measure(&box, heights, &volume, NULL) == HS_OK);
    CHECK(heights[0] == 1e300);
    CHECK(heights[1] == 1e-300);
    CHECK(fabs(volume - 1.0) < 1e-12);
}

/* Exactly independent, but flatter than any float64: heights may round to 0, and no more than
 * that. */
static void
nearly_dependent_boxes_are_measured(void)
{
    const double long_x = -0x1.9999999999998p-4, long_y = -0x1.999999999999cp-4;
    hs_box       box = {.ndim = 2, .periodic = {true, true}, .rows = {{long_x, long_y}}};
    double       heights[2], volume;
    box.rows[1][0] = box.rows[1][1] = -0x1p-1073;
    CHECK(hs_box_measure(&box, heights, &volume, NULL) == HS_OK);
    CHECK(heights[0] >= 0.0 && heights[0] <= 0x1p-53);
    CHECK(heights[1] >= 0.0 && heights[1] <= 0x1p-1074);
    CHECK(volume >= 0.0 && volume <= 0x1p-1074);
}

/* |wrapped - (point + shift * box)| against 1 ulp of the largest of all these, in big integers. */
static bool
wrapped_is_the_point_moved(const hs_box *box, const double *x, const double *wrapped,
                           const int64_t *shift)
{
    for (int k = 0; k < box->ndim; k++) {
        big    sum = big_difference(big_from_double(x[k]), big_from_double(wrapped[k]));
        double largest = fmax(fabs(x[k]), fabs(wrapped[k]));
        for (int l = 0; l < box->ndim; l++) {
            if (box->periodic[l]) {
                sum = big_sum(
                    sum, big_product(big_from_int(shift[l]), big_from_double(box->rows[l][k])));
                largest = fmax(largest, fabs((double)shift[l] * box->rows[l][k]));
            } else if (shift[l] != 0) {
                return false;
            }
        }
        big ulp = big_from_double(nextafter(largest, INFINITY) - largest);
        if (big_compare_magnitude(&sum, &ulp) > 0)
            return false;
    }
    return true;
}

static void
wrapped_points_are_moved_by_their_shift(void)
{
    harness_random random = {5772};
    for (int trial = 0; trial < 1200; trial++) {
        double       wrapped[8 * HS_MAX_DIM];
        int64_t      shift[8 * HS_MAX_DIM];
        const double spread = trial % 4 == 0 ? 1e8 : trial % 4 == 1 ? 1e5 : 8.0;
        const int    kind = SCENE_ALIGNED + trial % (SCENE_KINDS - 1);
        brute_rows   r;
        make_scene(&random, kind, 1 + trial % 5, 8, spread, trial % 6 ? 0 : 300, &shared);
        if (!brute_prepare(&shared.scene, &r))
            continue;
        const hs_points points = points_of(&shared.scene);
        CHECK(hs_box_wrap(&shared.box, &points, wrapped, shift, NULL) == HS_OK);
        const int d = shared.scene.ndim;
        for (int i = 0; i < 8; i++) {
            CHECK(wrapped_is_the_point_moved(&shared.box, shared.x + i * d, wrapped + i * d,
                                             shift + i * d));
            for (int l = 0; l < r.m; l++) {
                long double fraction = 0.0L, sizes = 0.0L;
                for (int k = 0; k < d; k++) {
                    fraction += r.dual[l][k] * wrapped[i * d + k];
                    sizes += fabsl(r.dual[l][k] * wrapped[i * d + k]);
                }
                const long double slack = 0x1p-48L * (1.0L + sizes);
                CHECK(fraction > -slack && fraction < 1.0L + slack);
            }
        }
        CHECK(hs_box_wrap(&shared.box, &points, NULL, NULL, NULL) == HS_OK);
    }
}

static void
wrapped_coordinates_stay_below_the_length(void)
{
    static const double lengths[] = {1.0, -3.0, 0.1, 0x1p-500, 1e300};
    static const double tiny[] = {0.0, 0x1p-60, 0x1p-53, 0.25, 0.5, 1.0, 1.5, 7.0, 1e6};
    for (int trial = 0; trial < 5 * 9 * 2 * 5; trial++) {
        const double length = lengths[trial % 5];
        double       x = tiny[trial / 5 % 9] * length * (trial / 45 % 2 ? 1.0 : -1.0), wrapped;
        hs_box       box = {.ndim = 1, .periodic = {true}, .rows = {{length}}};
        int64_t      shift;
        for (int step = trial / 90 - 2; step != 0; step += step < 0 ? 1 : -1)
            x = nextafter(x, step < 0 ? -INFINITY : INFINITY);
        const hs_points points = {.data = &x, .n = 1, .ndim = 1, .real = HS_FLOAT64};
        CHECK(hs_box_wrap(&box, &points, &wrapped, &shift, NULL) == HS_OK);
        CHECK(wrapped == 0.0 || (wrapped < 0.0) == (length < 0.0));
        CHECK(fabs(wrapped) < fabs(length));
        CHECK(wrapped_is_the_point_moved(&box, &x, &wrapped, &shift));
    }
}

static void
a_point_too_far_to_wrap_leaves_the_outputs_alone(void)
{
    hs_box          box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    const double    x[3] = {0.5, 1.5, 0x1p60};
    double          wrapped[3] = {-7.0, -7.0, -7.0};
    int64_t         shift[3] = {-7, -7, -7};
    hs_failure      failure;
    const hs_points points = {
        .data = x, .n = 3, .ndim = 1, .real = HS_FLOAT64, .row_stride = 8, .column_stride = 8};
    CHECK(hs_box_wrap(&box, &points, wrapped, shift, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(failure.row == 2);
    for (int i = 0; i < 3; i++)
        CHECK(wrapped[i] == -7.0 && shift[i] == -7);
}

static hs_status
find_status(const hs_options *options, hs_failure *failure)
{
    const hs_points points = points_of(&shared.scene);
    hs_pairs       *pairs = (hs_pairs *)failure;
    const hs_status status =
        hs_pairs_find(AMONG(&points, shared.scene.box), options, &pairs, failure);
    CHECK((pairs == NULL) == (status != HS_OK));
    hs_pairs_free(pairs);
    return status;
}

static void
failures_name_the_row_and_column(void)
{
    static const double odd[] = {NAN, INFINITY, -INFINITY};
    harness_random      random = {9};
    hs_failure          failure;
    make_scene(&random, SCENE_TRICLINIC, 3, 10, 4.0, 0, &shared);
    shared.scene.cutoff = 1.0;
    hs_options options = options_of(&shared.scene);
    for (int trial = 0; trial < 90; trial++) {
        const int    e = trial % 30;
        const double kept = shared.x[e], last = shared.x[29];
        shared.x[29] = shared.x[e] = odd[trial / 30]; /* the first one counts */
        CHECK(find_status(&options, &failure) == HS_ERR_NOT_FINITE);
        CHECK(failure.row == e / 3 && failure.column == e % 3);
        CHECK(!isfinite(failure.value));
        shared.x[29] = last;
        shared.x[e] = kept;
    }
    for (int trial = 0; trial < 27; trial++) {
        double      *entry = &shared.box.rows[trial % 9 / 3][trial % 3];
        const double kept = *entry;
        *entry = odd[trial / 9];
        CHECK(find_status(&options, &failure) == HS_ERR_BOX_FINITE);
        CHECK(failure.row == trial % 9 / 3 && failure.column == trial % 3);
        CHECK(hs_box_measure(&shared.box, NULL, NULL, &failure) == HS_ERR_BOX_FINITE);
        CHECK(failure.row == trial % 9 / 3 && failure.column == trial % 3);
        shared.box.periodic[trial % 9 / 3] = false; /* it is a mistake even so */
        CHECK(find_status(&options, &failure) == HS_ERR_BOX_FINITE);
        CHECK(failure.row == trial % 9 / 3 && failure.column == trial % 3);
        shared.box.periodic[trial % 9 / 3] = true;
        *entry = kept;
    }
    const double bad[] = {-1.0, -0x1p-1074, NAN, INFINITY};
    for (int trial = 0; trial < 4; trial++) {
        options.cutoff = bad[trial];
        CHECK(find_status(&options, &failure) == HS_ERR_CUTOFF);
        CHECK(memcmp(&failure.value, &bad[trial], 8) == 0);
        CHECK(failure.row == -1 && failure.column == -1);
    }
    options.cutoff = -0.0;
    CHECK(find_status(&options, &failure) == HS_OK);
    memcpy(shared.box.rows[2], shared.box.rows[0], sizeof shared.box.rows[0]);
    CHECK(find_status(&options, &failure) == HS_ERR_BOX_DEPENDENT && failure.row == -1);
    memset(shared.box.rows[1], 0, sizeof shared.box.rows[1]);
    CHECK(find_status(&options, &failure) == HS_ERR_BOX_DEPENDENT && failure.row == 1);
    options.kernel = "no such kernel";
    CHECK(find_status(&options, &failure) == HS_ERR_KERNEL);
    for (int status = HS_OK; status < HS_STATUS_END; status++)
        CHECK(strlen(hs_status_text((hs_status)status)) > 1);
}

static void
too_many_points_are_refused_unread(void)
{
    const hs_points  points = {.n = INT64_C(1) << 31, .ndim = 1, .real = HS_FLOAT64};
    const hs_options options = hs_options_default();
    int64_t          count = -1;
    hs_failure       failure;
    CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &count, &failure) == HS_ERR_TOO_MANY);
    CHECK(count == -1 && failure.value == 0x1p31);
}

/* Pairs whose shift passes int32: told with the point, but only when shifts are wanted. */
static void
shifts_too_wide_name_their_point(void)
{
    for (int trial = 0; trial < 6; trial++) {
        hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
        double     x[4] = {0.25, 0.25, 0.25 + 0x1p40, 0.25};
        hs_failure failure;
        box.rows[1][0] = trial % 2 ? 0.3 : 0.0;
        shared.scene = (brute_scene){.ndim = 2, .n = 2, .x = x, .box = &box, .cutoff = 1.25};
        hs_options options = options_of(&shared.scene);
        options.sorted = trial / 2 == 1;
        if (trial / 2 == 2) {
            options.want = WANT_ALL;
            CHECK(find_status(&options, &failure) == HS_ERR_SHIFT_RANGE);
            CHECK(failure.row == 0 || failure.row == 1);
        } else {
            CHECK(find_status(&options, &failure) == HS_OK);
        }
    }
}

static void
no_points_are_no_pairs_whatever_the_cutoff(void)
{
    hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.5, 1.0}}};
    for (double cutoff = 1.0; cutoff < 1e300; cutoff *= 1e10) {
        const hs_points points = {.n = 0, .ndim = 2, .real = HS_FLOAT64};
        hs_options      options = hs_options_default();
        int64_t         count = -1;
        options.cutoff = cutoff;
        options.memory_limit = 1e6;
        CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, NULL) == HS_OK);
        CHECK(count == 0);
    }
}

/* Box vectors near the end of the numbers, whose sums are beyond it, and as many binary orders
 * below as a product of doubles that is split needs. */
static void
the_largest_boxes_are_measured_and_wrapped_into(void)
{
    hs_box  box = {.ndim = 2, .periodic = {true, true}};
    double  x[4] = {0x1.8p1023, 0x1p1021, -0x1p1022, -0x1.cp1023}, heights[2], wrapped[4];
    int64_t shift[4];
    for (int exponent = 0; exponent > -80; exponent--) {
        double scaled[4];
        for (int e = 0; e < 4; e++) {
            scaled[e] = ldexp(x[e], exponent);
        }
        const hs_points points = {scaled, 2, 2, HS_FLOAT64, 16, 8};
        const double    length = ldexp(0x1p1023, exponent);
        box.rows[0][0] = box.rows[1][1] = length;
        CHECK(hs_box_measure(&box, heights, NULL, NULL) == HS_OK);
        CHECK(heights[0] == length && heights[1] == length);
        CHECK(hs_box_wrap(&box, &points, wrapped, shift, NULL) == HS_OK);
        CHECK(wrapped[0] == 0.5 * length && shift[0] == -1);
        CHECK(wrapped[1] == scaled[1] && shift[1] == 0);
        CHECK(wrapped[2] == 0.5 * length && shift[2] == 1);
        CHECK(wrapped[3] == 0.25 * length && shift[3] == 2);
    }
}

/* Integers times a power of two: sums of them are exact, also where they are subnormal. */
static void
the_smallest_boxes_are_measured_and_wrapped_into(void)
{
    const double whole[3][2] = {{-3.0, 7.0}, {8.0, -1.0}, {2.0, 1.0}};
    hs_box       box = {.ndim = 2, .periodic = {true, true}, .rows = {{4, 0}, {2, 4}}};
    double       heights[2], wrapped[6], of_whole[6];
    int64_t      shift[6], shift_of_whole[6];
    hs_points    points = {whole, 3, 2, HS_FLOAT64, 16, 8};
    CHECK(hs_box_wrap(&box, &points, of_whole, shift_of_whole, NULL) == HS_OK);
    for (int exponent = -1000; exponent >= -1074; exponent -= 37) {
        double scaled[3][2];
        for (int e = 0; e < 6; e++) {
            scaled[e / 2][e % 2] = ldexp(whole[e / 2][e % 2], exponent);
        }
        points.data = scaled;
        box.rows[0][0] = box.rows[1][1] = ldexp(4.0, exponent);
        box.rows[1][0] = ldexp(2.0, exponent);
        CHECK(hs_box_measure(&box, heights, NULL, NULL) == HS_OK);
        const double expected = ldexp(16.0 / sqrt(20.0), exponent);
        CHECK(fabs(heights[0] - expected) <= fmax(1e-15 * expected, 0x1p-1074));
        CHECK(heights[1] == ldexp(4.0, exponent));
        CHECK(hs_box_wrap(&box, &points, wrapped, shift, NULL) == HS_OK);
        for (int e = 0; e < 6; e++) {
            CHECK(wrapped[e] == ldexp(of_whole[e], exponent) && shift[e] == shift_of_whole[e]);
        }
    }
}

/* Whether places of axis k are near enough for a pair. */
static bool
are_near(const hs_box_axes *axes, int k, double a, double b)
{
    const double apart = fabs(a - b);
    return apart <= axes->reach[k] || (axes->repeats[k] && 1.0 - apart <= axes->reach[k]);
}

/* In boxes and units of all kinds; and most points that are no pair are told apart. */
static void
places_of_pairs_are_within_reach(void)
{
    harness_random random = {271828};
    int64_t        n_pairs = 0, n_told = 0, n_all = 0;
    for (int trial = 0; trial < 600; trial++) {
        enum { N = 24 };
        double      places[HS_MAX_DIM * N], part[HS_MAX_DIM];
        const int   exponent = trial % 3 == 0 ? random_below(&random, 1800) - 900 : 0;
        hs_options  options = hs_options_default();
        hs_pairs   *pairs = NULL;
        hs_box_axes axes, again;
        make_scene(&random, trial % SCENE_KINDS, 1 + trial % 5, N, 8.0, exponent, &shared);
        const hs_points points = points_of(&shared.scene);
        options.cutoff = ldexp(0.75, exponent);
        options.want = HS_WANT_I | HS_WANT_J;
        if (hs_pairs_find(AMONG(&points, shared.scene.box), &options, &pairs, NULL) != HS_OK)
            continue;
        const int    d = points.ndim;
        const double largest = ldexp(1024.0, exponent);
        CHECK(hs_box_places(shared.scene.box, &points, options.cutoff, largest, places, N, &axes,
                            NULL) == HS_OK);
        const int64_t *i_of = hs_pairs_array(pairs, HS_WANT_I);
        const int64_t *j_of = hs_pairs_array(pairs, HS_WANT_J);
        for (int64_t p = 0; p < hs_pairs_length(pairs); p++) {
            for (int k = 0; k < d; k++)
                CHECK(are_near(&axes, k, places[k * N + i_of[p]], places[k * N + j_of[p]]));
        }
        n_pairs += hs_pairs_length(pairs);
        hs_pairs_free(pairs);
        for (int i = 0; i < N; i++) { /* those of each point are the same alone */
            hs_points one = points;
            one.data = (const char *)points.data + i * points.row_stride;
            one.n = 1;
            CHECK(hs_box_places(shared.scene.box, &one, options.cutoff, largest, part, 1, &again,
                                NULL) == HS_OK);
            for (int k = 0; k < d; k++)
                CHECK(part[k] == places[k * N + i] && again.reach[k] == axes.reach[k]);
            for (int j = 0; j < i; j++) {
                bool near = true;
                for (int k = 0; k < d; k++)
                    near = near && are_near(&axes, k, places[k * N + i], places[k * N + j]);
                n_told += !near;
                n_all++;
            }
        }
    }
    CHECK(n_pairs > 1000 && n_told > n_all / 4);
}

static void
places_need_a_largest_coordinate(void)
{
    const double    x[2] = {3.0, -5.0};
    const hs_points points = {x, 2, 1, HS_FLOAT64, 8, 8};
    hs_box_axes     axes;
    double          places[2];
    CHECK(hs_box_places(NULL, &points, 1.0, 5.0, NULL, 0, &axes, NULL) == HS_OK);
    CHECK(!axes.repeats[0] && axes.reach[0] > 0.0);
    CHECK(hs_box_places(NULL, &points, 1.0, 4.0, NULL, 0, &axes, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_box_places(NULL, &points, 1.0, NAN, NULL, 0, &axes, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_box_places(NULL, &points, 1.0, 5.0, places, 2, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_box_places(NULL, &points, -1.0, 5.0, places, 2, &axes, NULL) == HS_ERR_CUTOFF);
    /* entries of one box that are not scaled together without loss: nothing is known */
    const hs_box    box = {.ndim = 2, .periodic = {true, true}, .rows = {{1, 0x1p-1070}, {0, 1}}};
    const hs_points none = {x, 0, 2, HS_FLOAT64, 16, 8};
    CHECK(hs_box_places(&box, &none, 1.0, 5.0, NULL, 0, &axes, NULL) == HS_OK);
    CHECK(isinf(axes.reach[0]) && isinf(axes.reach[1]));
}

/* Few heights, but many widths. */
static void
turns_of_a_sheared_box_may_be_too_many(void)
{
    const hs_box    box = {.ndim = 2, .periodic = {true, true}, .rows = {{1, 0}, {0x1p40, 1}}};
    double          x[4] = {0.5, 0.5, 0.5, 2.5}, wrapped[4];
    int64_t         shift[4];
    hs_failure      failure;
    const hs_points points = {x, 2, 2, HS_FLOAT64, 16, 8};
    CHECK(hs_box_wrap(&box, &points, wrapped, shift, &failure) == HS_OK);
    CHECK(shift[2] == INT64_C(5) << 39 && shift[3] == -2);
    CHECK(wrapped[2] == 0x1p39 + 0.5 && wrapped[3] == 0.5);
    x[3] = 0x1p20;
    CHECK(hs_box_wrap(&box, &points, wrapped, shift, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(failure.row == 1);
}

void
test_api_box(void)
{
    RUN(upright_boxes_have_their_own_lengths);
    RUN(heights_are_inverse_duals);
    RUN(heights_of_very_different_size_are_told);
    RUN(nearly_dependent_boxes_are_measured);
    RUN(wrapped_points_are_moved_by_their_shift);
    RUN(wrapped_coordinates_stay_below_the_length);
    RUN(a_point_too_far_to_wrap_leaves_the_outputs_alone);
    RUN(failures_name_the_row_and_column);
    RUN(too_many_points_are_refused_unread);
    RUN(shifts_too_wide_name_their_point);
    RUN(no_points_are_no_pairs_whatever_the_cutoff);
    RUN(the_largest_boxes_are_measured_and_wrapped_into);
    RUN(the_smallest_boxes_are_measured_and_wrapped_into);
    RUN(turns_of_a_sheared_box_may_be_too_many);
    RUN(places_of_pairs_are_within_reach);
    RUN(places_need_a_largest_coordinate);
}
