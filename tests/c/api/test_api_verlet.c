/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_verlet.c: Verlet lists step by step, boxes that are measured, and points that are
 * wrapped. */
#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/exact/metric.h"
#include "../../../csrc/core/memory/memory.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/list_checks.h"
#include "../support/output_checks.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

#include <fenv.h>
#include <float.h>
#include <math.h>

void test_api_verlet(void);

/* ---- a list that is used for many steps gives what a search of each step gives ---- */

static random_scene shared;

/* The arrays of both, byte for byte: ascending order. */
static bool
same_pairs(const hs_pairs *one, const hs_pairs *other, int ndim)
{
    static const unsigned bits[] = {HS_WANT_I, HS_WANT_J, HS_WANT_DISTANCE, HS_WANT_VECTOR,
                                    HS_WANT_SHIFT};
    const size_t          sizes[] = {8, 8, 8, 8 * (size_t)ndim, 4 * (size_t)ndim};
    const int64_t         n = hs_pairs_length(one);
    bool                  same = n == hs_pairs_length(other);
    for (int k = 0; k < 5 && same; k++) {
        same = memcmp(hs_pairs_array(one, bits[k]), hs_pairs_array(other, bits[k]),
                      (size_t)n * sizes[k]) == 0;
    }
    return same;
}

/* Whether list and search agree; adds the pairs to *n_pairs. */
static bool
agree(const hs_verlet *list, const brute_scene *scene, int threads, int64_t *n_pairs)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    hs_pairs       *found = NULL, *expected = NULL;
    options.want = WANT_ALL;
    options.sorted = true;
    bool same = hs_pairs_find(AMONG(&points, scene->box), &options, &expected, NULL) == HS_OK;
    options.threads = threads;
    same = same && hs_verlet_find(list, &options, &found, NULL) == HS_OK;
    same = same && same_pairs(found, expected, scene->ndim);
    *n_pairs += same ? hs_pairs_length(found) : 0;
    hs_pairs_free(found);
    hs_pairs_free(expected);
    return same;
}

/* A step: everything moves a little, and now and then by whole box vectors or with the box. */
static void
move(harness_random *random, random_scene *scene, double size)
{
    const int d = scene->scene.ndim;
    const int what = random_below(random, 4);
    for (int64_t i = 0; i < scene->scene.n; i++) {
        for (int k = 0; k < d; k++)
            scene->x[i * d + k] += size * (random_unit(random) - 0.5);
        for (int l = 0; what == 1 && scene->scene.box != NULL && l < d; l++) {
            const int times = scene->box.periodic[l] ? random_below(random, 5) - 2 : 0;
            for (int k = 0; k < d; k++)
                scene->x[i * d + k] += times * scene->box.rows[l][k];
        }
    }
    for (int l = 0; what == 2 && l < d; l++) {
        for (int k = 0; k < d; k++)
            scene->box.rows[l][k] *= 1.0 + 0.002 * (random_unit(random) - 0.5);
    }
}

static void
every_step_is_that_of_a_search(void)
{
    harness_random random = {4711};
    int64_t        n_pairs = 0, n_kept = 0;
    for (int trial = 0; trial < THIRD_OF_TRIALS(240); trial++) {
        make_scene(&random, trial % SCENE_KINDS, 1 + trial % 4, 1 + random_below(&random, 60), 4.0,
                   trial % 7 == 6   ? 300
                   : trial % 7 == 5 ? -300
                                    : 0,
                   &shared);
        hs_verlet       *list = hs_verlet_new();
        const hs_points  points = points_of(&shared.scene);
        const hs_options options = options_of(&shared.scene);
        const double     skin = 0.3 * shared.scene.cutoff;
        for (int step = 0; step < 6; step++) {
            bool rebuilt;
            CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, skin, false, &rebuilt,
                                   NULL) == HS_OK);
            CHECK(rebuilt || step > 0);
            const hs_verlet_state state = hs_verlet_look(list);
            CHECK(state.margin >= 0.0 && state.margin <= state.radius - state.cutoff);
            CHECK(state.cutoff == shared.scene.cutoff && state.n_points == shared.scene.n);
            CHECK(agree(list, &shared.scene, 1 + step % 3, &n_pairs));
            n_kept += !rebuilt;
            move(&random, &shared, 0.05 * shared.scene.cutoff);
        }
        hs_verlet_free(list);
    }
    CHECK(n_pairs > THIRD_OF_TRIALS(100000));
    CHECK(n_kept > THIRD_OF_TRIALS(500));
}

static bool
refuse(void *context, double fraction)
{
    (void)fraction;
    ++*(int *)context;
    return false;
}

static void
finding_can_be_interrupted(void)
{
    enum { N = 3000 };
    static double   x[3 * N];
    harness_random  random = {5};
    hs_options      options = hs_options_default();
    const hs_points points = {x, N, 3, HS_FLOAT64, 24, 8};
    int             polls = 0;
    bool            rebuilt;
    hs_pairs       *pairs = NULL;
    hs_verlet      *list = hs_verlet_new();
    for (int e = 0; e < 3 * N; e++)
        x[e] = random_unit(&random);
    options.cutoff = 2.0;
    CHECK(hs_verlet_update(list, &points, NULL, &options, 0.1, false, &rebuilt, NULL) == HS_OK);
    options.poll = refuse;
    options.poll_context = &polls;
    const int64_t before = hs_test_live_blocks();
    CHECK(hs_verlet_find(list, &options, &pairs, NULL) == HS_ERR_INTERRUPTED);
    CHECK(polls == 1 && pairs == NULL);
    CHECK(hs_test_live_blocks() == before);
    CHECK(hs_verlet_update(list, &points, NULL, &options, 0.1, true, &rebuilt, NULL) ==
          HS_ERR_INTERRUPTED);
    hs_verlet_free(list);
}

/*
 * ---- verlet updates ----
 *
 * A list is built again where the one there is cannot serve, even if no point has moved.
 */

enum { N_UPDATES = 80 };

static double x_updates[3 * N_UPDATES];
static float  narrow[3 * N_UPDATES];

static const hs_box box_updates = {
    .ndim = 3, .periodic = {true, true, false}, .rows = {{4.0}, {0.5, 4.0}, {0.0, 0.0, 4.0}}};

static void
fill_points(void)
{
    harness_random random = {4041};
    for (int e = 0; e < 3 * N_UPDATES; e++) {
        narrow[e] = (float)(4.0 * random_unit(&random));
        x_updates[e] = narrow[e];
    }
}

static hs_points
wide_points(int64_t n, int ndim)
{
    return (hs_points){x_updates, n, ndim, HS_FLOAT64, 8 * ndim, 8};
}

static hs_options
options_for(double cutoff)
{
    hs_options options = hs_options_default();
    options.cutoff = cutoff;
    options.want = WANT_ALL;
    options.sorted = true;
    options.threads = 1;
    return options;
}

/* The pairs of the list are those of a search with the options of its last step. */
static void
check_list(const hs_verlet *list, const hs_points *points, const hs_box *in, hs_options options)
{
    hs_pairs *found = NULL, *expected = NULL;
    CHECK(hs_pairs_find(AMONG(points, in), &options, &expected, NULL) == HS_OK);
    CHECK(hs_verlet_find(list, &options, &found, NULL) == HS_OK);
    CHECK(hs_pairs_length(found) > 20);
    CHECK(same_columns(found, expected, WANT_ALL, points->ndim, 8));
    hs_pairs_free(found);
    hs_pairs_free(expected);
}

/* One step; whether it built the list again. The step after it never does. */
static bool
step(hs_verlet *list, const hs_points *points, const hs_box *in, double cutoff)
{
    const hs_options options = options_for(cutoff);
    bool             rebuilt = false, again = true;
    CHECK(hs_verlet_update(list, points, in, &options, 0.25, false, &rebuilt, NULL) == HS_OK);
    CHECK(hs_verlet_update(list, points, in, &options, 0.25, false, &again, NULL) == HS_OK);
    CHECK(!again && hs_verlet_look(list).cutoff == cutoff);
    check_list(list, points, in, options);
    return rebuilt;
}

/* Each differs from the one before: in how many points, of which type, with how many coordinates,
 * in a box or not, periodic along which axes. */
static void
points_of_another_kind_build_again(void)
{
    const hs_points narrow_points = {narrow, N_UPDATES, 3, HS_FLOAT32, 12, 4};
    const hs_points all = wide_points(N_UPDATES, 3), fewer = wide_points(N_UPDATES - 1, 3),
                    flat = wide_points(N_UPDATES, 2);
    hs_box     open_too = box_updates, along_y = box_updates;
    hs_verlet *list = hs_verlet_new();
    open_too.periodic[2] = true;
    along_y.periodic[0] = false;
    CHECK(step(list, &all, &box_updates, 1.0));
    CHECK(step(list, &fewer, &box_updates, 1.0));
    CHECK(step(list, &all, &box_updates, 1.0));
    CHECK(step(list, &all, NULL, 1.0));
    CHECK(step(list, &flat, NULL, 1.0));
    CHECK(step(list, &all, &open_too, 1.0));
    CHECK(step(list, &all, &along_y, 1.0));
    (void)step(list, &narrow_points, &along_y, 1.0); /* the same numbers */
    CHECK(hs_verlet_look(list).n_points == N_UPDATES && hs_verlet_look(list).ndim == 3);
    hs_verlet_free(list);
}

/* cutoff + skin passes the largest number: there is no such list, and the one before stays. */
static void
radii_beyond_the_largest_number_are_refused(void)
{
    const hs_points points = wide_points(N_UPDATES, 3);
    hs_verlet      *list = hs_verlet_new();
    hs_options      options = options_for(DBL_MAX);
    hs_failure      failure;
    bool            rebuilt = false;
    CHECK(hs_verlet_update(list, &points, &box_updates, &options, DBL_MAX, false, &rebuilt,
                           &failure) == HS_ERR_CUTOFF);
    CHECK(failure.value == INFINITY && failure.row == -1 && !rebuilt);
    CHECK(!hs_verlet_look(list).has_list);
    CHECK(step(list, &points, &box_updates, 1.0));
    CHECK(hs_verlet_update(list, &points, &box_updates, &options, DBL_MAX, false, &rebuilt,
                           &failure) == HS_ERR_CUTOFF);
    CHECK(failure.value == INFINITY && !rebuilt && hs_verlet_look(list).radius == 1.25);
    check_list(list, &points, &box_updates, options_for(1.0));
    CHECK(!step(list, &points, &box_updates, 1.0));
    hs_verlet_free(list);
}

/* ---- measuring and wrapping, plans, and what each failure says ---- */

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

/* Box vectors near the end of the numbers, whose sums are beyond it, and as many binary orders
 * below as a product of doubles that is split needs. */
static void
the_largest_boxes_are_measured_and_wrapped_into(void)
{
    hs_box  box = {.ndim = 2, .periodic = {true, true}};
    double  x[4] = {0x1.8p1023, 0x1p1021, -0x1p1022, -0x1.cp1023}, heights[2], wrapped[4], volume;
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
        const hs_box flat = {
            2, {true, true}, {{length}, {0.0, 0x1p-1000}, {NAN}}}; /* of two rows */
        CHECK(hs_box_measure(&flat, NULL, &volume, NULL) == HS_OK && volume == length * 0x1p-1000);
        CHECK(hs_box_wrap(&box, &points, wrapped, shift, NULL) == HS_OK);
        CHECK(wrapped[0] == 0.5 * length && shift[0] == -1);
        CHECK(wrapped[1] == scaled[1] && shift[1] == 0);
        CHECK(wrapped[2] == 0.5 * length && shift[2] == 1);
        CHECK(wrapped[3] == 0.25 * length && shift[3] == 2);
    }
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

/* ---- given pairs against all images around them, and every refusal ---- */

enum { N_PAIRS = 60, MEASURED = HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT };

static int64_t first[N_PAIRS], second[N_PAIRS];

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
    const hs_points points = points_in_rows(x, 2, ndim);
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
    const hs_points both = points_in_rows(apart, 2, 2);
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
    hs_points     points = points_in_rows(x, 2, 2);
    const int64_t numbers[4][2] = {{-1, 0}, {2, 0}, {0, -1}, {0, 2}};
    hs_pairs     *found = NULL;
    hs_options    options = hs_options_default();
    hs_failure    failure;
    mixed.periodic[1] = false;
    CHECK(measure_two(2, x, &box, bad[0], MEASURED, NULL) == HS_ERR_ARGUMENT);
    CHECK(measure_two(2, x, &box, bad[1], MEASURED, NULL) == HS_ERR_ARGUMENT);
    CHECK(measure_two(2, x, &mixed, bad[2], MEASURED, NULL) == HS_ERR_ARGUMENT);
    CHECK(measure_two(2, x, &mixed, bad[3], MEASURED, NULL) == HS_OK);
    mixed.periodic[0] = false;
    mixed.periodic[1] = true;
    CHECK(measure_two(2, x, &mixed, bad[2], MEASURED, NULL) == HS_OK);
    CHECK(measure_two(2, x, &mixed, bad[3], MEASURED, NULL) == HS_ERR_ARGUMENT);
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
    /* nor where one box vector is lost in what another one's turns are rounded by */
    const hs_box    flat = {.ndim = 3,
                            .periodic = {true, true, true},
                            .rows = {{0x1.8p-79, 0x1p-10}, {0, 0x1.8p-71, 1}, {0, 0, 0x1.8p-43}}};
    const hs_points nowhere = {x, 0, 3, HS_FLOAT64, 24, 8};
    CHECK(hs_box_places(&flat, &nowhere, 0x1p40, 0x1p42, NULL, 0, &axes, NULL) == HS_OK);
    CHECK(isinf(axes.reach[0]) && isinf(axes.reach[1]));
    /* of pairs that are surely in one image, and of points on one spot */
    const hs_box even = {.ndim = 2, .periodic = {true, true}, .rows = {{1, 0}, {0.25, 1}}};
    CHECK(hs_box_places(&even, &none, 0.1, 0.05, NULL, 0, &axes, NULL) == HS_OK);
    CHECK(axes.reach[0] < 0.2 && axes.reach[1] < 0.2);
    CHECK(hs_box_places(NULL, &none, 0.0, 0.0, NULL, 0, &axes, NULL) == HS_OK);
    CHECK(axes.reach[0] >= 0.0 && axes.reach[0] < 1e-10);
}

#ifdef FE_UPWARD
static bool
rounds_up(void)
{
    volatile double one = 1.0, little = 0x1p-80;
    return one + little > 1.0;
}
#endif

/* Whatever the caller rounds to, numbers are those of rounding to nearest, and the caller's mode
 * comes back: from calls that do their work, that end early, and that fail in the middle. */
static void
calls_round_to_nearest_and_give_the_mode_back(void)
{
#ifdef FE_UPWARD
    const double    x[2] = {3.1, -5.3}, bad[2] = {0.0, NAN};
    const hs_box    box = {.ndim = 1, .periodic = {true}, .rows = {{0.7}}};
    const hs_points points = {x, 2, 1, HS_FLOAT64, 8, 8}, none = {bad, 2, 1, HS_FLOAT64, 8, 8};
    hs_options      options = hs_options_default();
    hs_verlet      *list = hs_verlet_new();
    double          places[2][2], wrapped[2][2], volume[2];
    for (int up = 0; up < 2; up++) {
        const hs_status ok = HS_OK, no = HS_ERR_NOT_FINITE;
        hs_box_axes     axes;
        hs_pairs       *found = NULL;
        bool            rebuilt;
        const int64_t   i = 0, j = 1;
        hs_pair_numbers pairs = {.n = 1, .i = &i, .j = &j};
        CHECK(fesetround(up ? FE_UPWARD : FE_TONEAREST) == 0);
        const hs_status statuses[][2] = {
            {hs_box_places(&box, &points, 0.3, 6.0, places[up], 2, &axes, NULL), ok},
            {hs_box_places(&box, &points, 0.3, 4.0, places[up], 2, &axes, NULL), HS_ERR_ARGUMENT},
            {hs_box_places(&box, &none, 0.3, 6.0, NULL, 2, &axes, NULL), no},
            {hs_box_places(&box, &points, -1.0, 6.0, NULL, 2, &axes, NULL), HS_ERR_CUTOFF},
            {hs_box_measure(&box, NULL, &volume[up], NULL), ok},
            {hs_box_measure(NULL, NULL, NULL, NULL), HS_ERR_ARGUMENT},
            {hs_box_wrap(&box, &points, wrapped[up], NULL, NULL), ok},
            {hs_box_wrap(&box, &none, NULL, NULL, NULL), no},
            {hs_verlet_update(list, &points, &box, &options, 0.1, true, &rebuilt, NULL), ok},
            {hs_verlet_update(list, &none, &box, &options, 0.1, true, &rebuilt, NULL), no},
            {hs_verlet_update(list, &points, &box, &options, -0.1, true, &rebuilt, NULL),
             HS_ERR_CUTOFF},
            {hs_measure(&points, &box, &pairs, &options, &found, NULL), ok},
        };
        CHECK(rounds_up() == (up == 1));
        CHECK(fesetround(FE_TONEAREST) == 0);
        for (size_t s = 0; s < sizeof statuses / sizeof statuses[0]; s++)
            CHECK(statuses[s][0] == statuses[s][1]);
        hs_pairs_free(found);
    }
    CHECK(memcmp(places[0], places[1], sizeof places[0]) == 0);
    CHECK(memcmp(wrapped[0], wrapped[1], sizeof wrapped[0]) == 0 && volume[0] == volume[1]);
    hs_verlet_free(list);
#endif
}

void
test_api_verlet(void)
{
    RUN(every_step_is_that_of_a_search);
    RUN(finding_can_be_interrupted);
    fill_points();
    RUN(points_of_another_kind_build_again);
    RUN(radii_beyond_the_largest_number_are_refused);
    RUN(wrapped_coordinates_stay_below_the_length);
    RUN(the_largest_boxes_are_measured_and_wrapped_into);
    RUN(turns_of_a_sheared_box_may_be_too_many);
    RUN(nearest_images_are_found);
    RUN(boxes_that_floats_cannot_tell_are_refused);
    RUN(too_many_images_are_refused);
    RUN(what_is_too_far_is_refused);
    RUN(the_first_of_many_that_fails_is_named);
    RUN(arguments_are_checked);
    RUN(it_can_be_stopped);
    RUN(places_of_pairs_are_within_reach);
    RUN(places_need_a_largest_coordinate);
    RUN(calls_round_to_nearest_and_give_the_mode_back);
}
