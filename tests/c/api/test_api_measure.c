/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_measure.c: given pairs against all images around them, and every refusal. */
#include "../../../csrc/core/base/poll.h"
#include "../../../csrc/core/exact/metric.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

void test_api_measure(void);

enum { N_PAIRS = 60, MEASURED = HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT };

static int64_t      first[N_PAIRS], second[N_PAIRS];
static random_scene shared;

static hs_status
measure(const hs_points *points, const hs_box *box, int64_t n, const int64_t *shift, unsigned want,
        hs_pairs **result, hs_failure *failure)
{
    hs_options            options = hs_options_default();
    const hs_pair_numbers pairs = {.n = n, .i = first, .j = second, .shift = shift};
    options.want = want;
    options.kernel = kernel_to_check;
    return hs_measure(points, box, &pairs, &options, result, failure);
}

/* Whether no shift that differs by at most one along each axis is nearer, or as near and less. */
static bool
is_least(const hs_metric *metric, const double *p, const double *q, const int64_t *shift)
{
    const int m = metric->n_rows;
    int       n = 1;
    for (int l = 0; l < m; l++)
        n *= 3;
    for (int trial = 0; trial < n; trial++) {
        int64_t   other[HS_MAX_DIM];
        hs_stages stages = {0};
        int       rest = trial, order = 0;
        for (int l = 0; l < m; l++, rest /= 3) {
            other[l] = shift[l] + rest % 3 - 1;
            order = order != 0 ? order : rest % 3 - 1;
        }
        const hs_span found = {p, q, shift}, beside = {p, q, other};
        const int     sign = hs_metric_compare(metric, &found, &beside, &stages);
        if (sign > 0 || (sign == 0 && order < 0))
            return false;
    }
    return true;
}

static void
check_measured(const brute_scene *scene, const hs_pairs *found)
{
    const int32_t *S = hs_pairs_array(found, HS_WANT_SHIFT);
    const double  *d = hs_pairs_array(found, HS_WANT_DISTANCE);
    const double  *D = hs_pairs_array(found, HS_WANT_VECTOR);
    hs_metric      metric;
    double         rows[HS_MAX_DIM][HS_MAX_DIM];
    int            m = 0, axis[HS_MAX_DIM];
    for (int l = 0; scene->box != NULL && l < scene->ndim; l++) {
        if (scene->box->periodic[l]) {
            memcpy(rows[m], scene->box->rows[l], sizeof rows[m]);
            axis[m++] = l;
        }
    }
    hs_metric_init(&metric, scene->ndim, m, (const double(*)[HS_MAX_DIM])rows, 1.0, true);
    for (int e = 0; e < N_PAIRS; e++) {
        const double *p = scene->x + first[e] * scene->ndim,
                     *q = scene->x + second[e] * scene->ndim;
        int64_t shift[HS_MAX_DIM];
        double  vector[HS_MAX_DIM];
        for (int l = 0; l < m; l++)
            shift[l] = S[e * scene->ndim + axis[l]];
        CHECK(is_least(&metric, p, q, shift));
        const double distance = hs_metric_measure(&metric, p, q, shift, vector);
        CHECK(d[e] == distance);
        for (int k = 0; k < scene->ndim; k++)
            CHECK(D[e * scene->ndim + k] == vector[k]);
    }
}

static void
nearest_images_are_found(void)
{
    harness_random random = {77};
    for (int trial = 0; trial < TRIALS(200); trial++) {
        hs_pairs *found = NULL, *again = NULL;
        int64_t   shift[N_PAIRS * HS_MAX_DIM];
        make_scene(&random, trial % SCENE_KINDS, 1 + trial / SCENE_KINDS % 4, 20, 4.0,
                   trial % 5 ? 0 : 300, &shared);
        const hs_points points = points_of(&shared.scene);
        for (int e = 0; e < N_PAIRS; e++) {
            first[e] = random_below(&random, 20);
            second[e] = random_below(&random, 20);
        }
        CHECK(measure(&points, shared.scene.box, N_PAIRS, NULL, MEASURED, &found, NULL) == HS_OK);
        check_measured(&shared.scene, found);
        const int32_t *S = hs_pairs_array(found, HS_WANT_SHIFT);
        for (int e = 0; e < N_PAIRS * points.ndim; e++)
            shift[e] = S[e];
        CHECK(measure(&points, shared.scene.box, N_PAIRS, shift, MEASURED, &again, NULL) == HS_OK);
        CHECK(same_array(found, again, HS_WANT_DISTANCE, 8));
        CHECK(same_array(found, again, HS_WANT_VECTOR, 8 * (size_t)points.ndim));
        hs_pairs_free(again);
        hs_pairs_free(found);
    }
}

/* Of two points, from 0 to 1. */
static hs_status
measure_two(int ndim, const double *x, const hs_box *box, const int64_t *shift, unsigned want,
            hs_failure *failure)
{
    const hs_points points = {.data = x,
                              .n = 2,
                              .ndim = ndim,
                              .real = HS_FLOAT64,
                              .row_stride = ndim * (ptrdiff_t)sizeof(double),
                              .column_stride = sizeof(double)};
    hs_pairs       *found = NULL;
    first[0] = 0;
    second[0] = 1;
    const hs_status status = measure(&points, box, 1, shift, want, &found, failure);
    CHECK((status == HS_OK) == (found != NULL));
    hs_pairs_free(found);
    return status;
}

static hs_box
box_of(int ndim, double a, double b, double c, double d)
{
    hs_box box = {.ndim = ndim, .periodic = {true, true}};
    box.rows[0][0] = a;
    box.rows[0][1] = b;
    box.rows[1][0] = c;
    box.rows[1][1] = d;
    return box;
}

static void
boxes_that_floats_cannot_tell_are_refused(void)
{
    const double  x[8] = {0.0}, y[4] = {0.0, 0.0, 0.3, 0.4};
    const int64_t none[2] = {0, 0};
    const double  thin[4] = {1e-200, 1e-16, 1e-14, 0.5};
    for (int k = 0; k < 3; k++) {
        const hs_box box = box_of(2, 1.0, 1.0, thin[k], -3.0 * thin[k]);
        CHECK(measure_two(2, y, &box, NULL, MEASURED, NULL) == HS_ERR_BOX_SKEWED || k == 2);
        CHECK(measure_two(2, y, &box, none, MEASURED, NULL) == HS_OK);
    }
    hs_box box = box_of(2, 0x1p1000, 0x1.0000000000001p-70, 0x1p1000, 0.0);
    CHECK(measure_two(2, x, &box, NULL, MEASURED, NULL) == HS_ERR_BOX_SKEWED);
    box = box_of(2, 0x1p60, 0.0, 1.0, 0x1p-60);
    CHECK(measure_two(2, x, &box, NULL, MEASURED, NULL) == HS_ERR_BOX_SKEWED);
    box = box_of(2, 1.0, 2.0, 2.0, 4.0);
    CHECK(measure_two(2, x, &box, NULL, MEASURED, NULL) == HS_ERR_BOX_DEPENDENT);
}

/* So many box vectors are short that no list holds the images, or no time. */
static void
too_many_images_are_refused(void)
{
    int n_refused = 0;
    for (int trial = 0; trial < 45; trial++) {
        const int    n = 2 * (trial % 3) + 1;
        const double length = ldexp(1e-9, trial / 3);
        double       x[16] = {0.0};
        hs_box       box = {.ndim = 8};
        for (int l = 0; l <= n; l++) { /* all at right angles, none along an axis */
            box.periodic[l] = true;
            box.rows[l][l - l % 2] = l == 0 ? 1.0 : length;
            box.rows[l][l - l % 2 + 1] = l == 0 ? 1.0 : l % 2 ? -length : length;
        }
        x[8] = x[9] = 0.3;
        const hs_status status = measure_two(8, x, &box, NULL, MEASURED, NULL);
        CHECK(status == HS_ERR_BOX_SKEWED || status == HS_OK);
        n_refused += status == HS_ERR_BOX_SKEWED;
    }
    CHECK(n_refused > 5 && n_refused < 45);
}

static void
what_is_too_far_is_refused(void)
{
    hs_failure   failure;
    const hs_box upright = box_of(2, 1.0, 0.0, 0.0, 1.0), skewed = box_of(2, 1.0, 0.2, 0.3, 1.0);
    const hs_box sheared = box_of(2, 1.0, 0.0, 0x1p30, 1.0);
    const double far[3][4] = {
        {0.0, 0.0, 1e300, 0.0}, {0.0, 0.0, 1e17, 0.0}, {1e300, 0.0, 0.0, 0.0}};
    for (int k = 0; k < 3; k++) {
        CHECK(measure_two(2, far[k], &upright, NULL, MEASURED, &failure) == HS_ERR_SHIFT_RANGE);
        CHECK(failure.row == 0);
        CHECK(measure_two(2, far[k], &skewed, NULL, MEASURED, NULL) == HS_ERR_SHIFT_RANGE);
    }
    const double high[4] = {0.0, 0.0, 0.0, 0x1p49}, low[4] = {0.0, 0.0, 0.0, -0x1p49};
    CHECK(measure_two(2, high, &sheared, NULL, HS_WANT_DISTANCE, NULL) == HS_ERR_SHIFT_RANGE);
    CHECK(measure_two(2, high, &upright, NULL, MEASURED, NULL) == HS_ERR_SHIFT_RANGE);
    CHECK(measure_two(2, low, &upright, NULL, MEASURED, NULL) == HS_ERR_SHIFT_RANGE);
    CHECK(measure_two(2, low, &upright, NULL, HS_WANT_DISTANCE, NULL) == HS_OK);
    const double apart[4] = {-1.7e308, 0.0, 1.7e308, 0.0};
    CHECK(measure_two(2, apart, NULL, NULL, HS_WANT_DISTANCE, &failure) == HS_ERR_FAR);
    CHECK(failure.row == 0);
    CHECK(measure_two(2, apart, NULL, NULL, HS_WANT_SHIFT, NULL) == HS_OK);
    const hs_points both = {.data = apart,
                            .n = 2,
                            .ndim = 2,
                            .real = HS_FLOAT64,
                            .row_stride = 2 * sizeof(double),
                            .column_stride = sizeof(double)};
    hs_pairs       *found = NULL;
    first[0] = second[0] = first[1] = second[2] = 0; /* pairs 1 and 2 */
    second[1] = first[2] = 1;
    CHECK(measure(&both, NULL, 3, NULL, HS_WANT_DISTANCE, &found, &failure) == HS_ERR_FAR);
    CHECK(failure.row == 1);
    CHECK(measure_two(2, apart, NULL, NULL, HS_WANT_VECTOR, NULL) == HS_ERR_FAR);
}

/* Pairs are measured in parts of some thousand: the first that fails may be in a later one. */
static void
the_first_of_many_that_fails_is_named(void)
{
    enum { MANY = 20000, WRONG = 9000 };
    static int64_t        i[MANY], j[MANY];
    const double          x[3] = {-1.7e308, 1.0, 1.7e308};
    const hs_points       points = {x, 3, 1, HS_FLOAT64, sizeof(double), sizeof(double)};
    const hs_pair_numbers pairs = {.n = MANY, .i = i, .j = j};
    hs_options            options = hs_options_default();
    hs_pairs             *found = NULL;
    options.want = HS_WANT_DISTANCE;
    for (int64_t e = 0; e < MANY; e++) {
        i[e] = 0;
        j[e] = e == WRONG || e > 2 * WRONG ? 2 : 1;
    }
    for (int threads = 1; threads <= 3; threads++) {
        hs_failure failure;
        options.threads = threads;
        CHECK(hs_measure(&points, NULL, &pairs, &options, &found, &failure) == HS_ERR_FAR);
        CHECK(failure.row == WRONG && found == NULL);
    }
}

static void
arguments_are_checked(void)
{
    const double  x[4] = {0.0, 0.0, 0.5, 0.5};
    const hs_box  box = box_of(2, 1.0, 0.0, 0.0, 1.0);
    const int64_t large = INT64_C(1) << 62;
    const int64_t bad[4][2] = {{large, 0}, {0, -large}, {0, 1}, {1, 0}};
    hs_box        mixed = box;
    hs_points     points = {.data = x,
                            .n = 2,
                            .ndim = 2,
                            .real = HS_FLOAT64,
                            .row_stride = 2 * sizeof(double),
                            .column_stride = sizeof(double)};
    const int64_t numbers[4][2] = {{-1, 0}, {2, 0}, {0, -1}, {0, 2}};
    hs_pairs     *found = NULL;
    hs_options    options = hs_options_default();
    hs_failure    failure;
    mixed.periodic[1] = false;
    CHECK(measure_two(2, x, &box, bad[0], MEASURED, NULL) == HS_ERR_ARGUMENT);
    CHECK(measure_two(2, x, &box, bad[1], MEASURED, NULL) == HS_ERR_ARGUMENT);
    CHECK(measure_two(2, x, &mixed, bad[2], MEASURED, NULL) == HS_ERR_ARGUMENT);
    CHECK(measure_two(2, x, &mixed, bad[3], MEASURED, NULL) == HS_OK);
    for (int k = 0; k < 4; k++) {
        first[0] = numbers[k][0];
        second[0] = numbers[k][1];
        CHECK(measure(&points, NULL, 1, NULL, MEASURED, &found, &failure) == HS_ERR_ARGUMENT);
        CHECK(failure.row == 0 && found == NULL);
    }
    const hs_pair_numbers odd[4] = {{.n = -1},
                                    {.n = INT64_MAX / 2, .i = first, .j = first},
                                    {.n = 1, .j = first},
                                    {.n = 1, .i = first}};
    for (int k = 0; k < 4; k++)
        CHECK(hs_measure(&points, NULL, &odd[k], &options, &found, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_measure(&points, NULL, NULL, &options, &found, NULL) == HS_ERR_ARGUMENT);
    const hs_pair_numbers none = {.n = 0};
    CHECK(hs_measure(&points, NULL, &none, &options, &found, NULL) == HS_OK);
    CHECK(hs_pairs_length(found) == 0);
    hs_pairs_free(found);
    CHECK(hs_measure(NULL, NULL, &odd[0], &options, &found, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_measure(&points, NULL, &odd[0], NULL, &found, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_measure(&points, NULL, &odd[0], &options, NULL, NULL) == HS_ERR_ARGUMENT);
    const double nan[4] = {0.0, 0.0, NAN, 0.0};
    CHECK(measure_two(2, nan, &box, NULL, MEASURED, NULL) == HS_ERR_NOT_FINITE);
    kernel_to_check = "none";
    CHECK(measure_two(2, x, &box, NULL, MEASURED, NULL) == HS_ERR_KERNEL);
    kernel_to_check = NULL;
    options.memory_limit = 4096.0;
    options.want = MEASURED;
    const hs_pair_numbers many = {.n = 1 << 20, .i = first, .j = first};
    CHECK(hs_measure(&points, NULL, &many, &options, &found, &failure) == HS_ERR_MEMORY);
    CHECK(failure.expected_pairs == 1 << 20 && failure.limit_bytes == 4096.0);
}

static bool
stop_at_once(void *context, double fraction)
{
    (void)context;
    (void)fraction;
    return false;
}

static void
it_can_be_stopped(void)
{
    const double    x[2] = {0.0, 0.0};
    const hs_points points = {
        .data = x, .n = 1, .ndim = 2, .real = HS_FLOAT64, .row_stride = 16, .column_stride = 8};
    int64_t              *zeros = calloc(HS_POLL_POINTS, sizeof *zeros);
    hs_options            options = hs_options_default();
    hs_pairs             *found = NULL;
    const hs_pair_numbers pairs = {.n = HS_POLL_POINTS, .i = zeros, .j = zeros};
    options.want = HS_WANT_DISTANCE;
    options.poll = stop_at_once;
    CHECK(zeros != NULL);
    CHECK(hs_measure(&points, NULL, &pairs, &options, &found, NULL) == HS_ERR_INTERRUPTED);
    CHECK(found == NULL);
    free(zeros);
}

static void
whichever_allocation_fails_nothing_is_left(void)
{
    harness_random random = {5};
    bool           ended = false;
    int            nth = 0;
    make_scene(&random, SCENE_TRICLINIC, 3, 20, 4.0, 0, &shared);
    const hs_points points = points_of(&shared.scene);
    memset(first, 0, sizeof first);
    while (!ended && nth < 100) {
        const int64_t before = hs_test_live_blocks();
        hs_pairs     *found = NULL;
        hs_test_fail_allocation(++nth);
        const hs_status status =
            measure(&points, shared.scene.box, N_PAIRS, NULL, MEASURED, &found, NULL);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        hs_pairs_free(found);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && nth > 4);
}

void
test_api_measure(void)
{
    RUN(nearest_images_are_found);
    RUN(boxes_that_floats_cannot_tell_are_refused);
    RUN(too_many_images_are_refused);
    RUN(what_is_too_far_is_refused);
    RUN(the_first_of_many_that_fails_is_named);
    RUN(arguments_are_checked);
    RUN(it_can_be_stopped);
    RUN(whichever_allocation_fails_nothing_is_left);
}
