/* SPDX-License-Identifier: BSD-3-Clause */
/* test_pair_list.c: lists with a skin: how far points may move, and what is built anew. */
#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/memory/memory.h"
#include "../../../csrc/core/verlet/pair_list.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"
#include "../support/list_checks.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

#include <math.h>

void test_pair_list(void);

/* ---- a margin is a promise about every pair ---- */

enum { POINTS = 24 };

/* Two steps of the same points, the list that was built for the first, and what hs_motion_margin
 * says of the second. */
typedef struct two_steps {
    hs_frame  built, now;
    void     *jumps;
    hs_status status;
    double    radius, cutoff, margin;
    bool      jumped;
} two_steps;

/* The points of a scene as a frame; float32 where all coordinates are such numbers. */
static void
take_frame(const brute_scene *scene, hs_real real, hs_frame *frame)
{
    const int64_t    n = scene->n * scene->ndim;
    const hs_options options = hs_options_default();
    float           *narrow = array_of(n, sizeof *narrow);
    hs_points        points = points_of(scene);
    hs_failure       failure;
    for (int64_t e = 0; e < n && real == HS_FLOAT32; e++) {
        narrow[e] = (float)scene->x[e];
        CHECK((double)narrow[e] == scene->x[e]);
    }
    if (real == HS_FLOAT32) {
        points.data = narrow;
        points.real = real;
        points.row_stride = scene->ndim * (ptrdiff_t)sizeof(float);
        points.column_stride = sizeof(float);
    }
    CHECK(hs_frame_take(&points, scene->box, &options, frame, &failure) == HS_OK);
    free(narrow);
}

static void
find_margin(two_steps *s, double radius, double cutoff, const hs_options *options)
{
    const hs_options plain = hs_options_default();
    const hs_verlet  list = {.frames = {s->built}, .listing = {.radius = radius}, .cutoff = cutoff};
    s->radius = radius;
    s->cutoff = cutoff;
    s->jumped = true; /* is set in any case */
    s->status = hs_motion_margin(&list, &s->now, options != NULL ? options : &plain, &s->margin,
                                 &s->jumped, &s->jumps);
}

static void
free_steps(two_steps *s)
{
    hs_frame_free(&s->built);
    hs_frame_free(&s->now);
    hs_free(NULL, s->jumps);
}

/* The margin between two scenes, frames and all. */
static double
margin_between(const brute_scene *before, const brute_scene *behind, double radius, double cutoff)
{
    two_steps s = {.margin = 0.0};
    take_frame(before, HS_FLOAT64, &s.built);
    take_frame(behind, HS_FLOAT64, &s.now);
    find_margin(&s, radius, cutoff, NULL);
    CHECK(s.status == HS_OK);
    free_steps(&s);
    return s.margin;
}

/* Whether every pair within cutoff + margin now was within the radius then, in the image that the
 * jumps of its points say. Returns the pairs looked at, -1 if one was not, 0 without an answer. */
static int64_t
keeps_promise(const two_steps *s, brute_scene before, brute_scene behind)
{
    int        row[HS_MAX_DIM];
    brute_list then, now;
    bool       kept = true;
    const int  m = hs_frame_periodic(&s->now, row);
    before.cutoff = s->radius;
    behind.cutoff = s->margin > 0.0 ? nextafter(s->cutoff + s->margin, 0.0) : s->cutoff;
    before.inclusive = behind.inclusive = true;
    if (!brute_find(&before, 4e5, &then) || !brute_find(&behind, 4e5, &now)) {
        return 0;
    }
    for (int64_t e = 0; e < now.n; e++) {
        brute_pair     pair = now.pairs[e];
        const int64_t *jumps = s->jumps;
        for (int r = 0; s->jumped && r < m; r++) {
            pair.shift[row[r]] += jumps[(int64_t)pair.j * m + r] - jumps[(int64_t)pair.i * m + r];
        }
        kept = kept && then.n > 0 &&
               bsearch(&pair, then.pairs, (size_t)then.n, sizeof pair, brute_order) != NULL;
    }
    const int64_t n = now.n;
    brute_free(&then);
    brute_free(&now);
    return kept ? n : -1;
}

/* Everything moves a little, sometimes all together, by whole box vectors, or with the box. */
static void
move(harness_random *random, double size, bool narrow, random_scene *scene)
{
    const int d = scene->scene.ndim, what = random_below(random, 6);
    double    together[HS_MAX_DIM] = {0.0};
    for (int k = 0; k < d; k++) {
        together[k] = what == 3 ? 40.0 * size * random_unit(random) : 0.0;
    }
    for (int64_t i = 0; i < scene->scene.n; i++) {
        double *x = scene->x + i * d;
        for (int k = 0; k < d; k++) {
            x[k] += together[k] + size * (random_unit(random) - 0.5);
        }
        for (int l = 0; what == 1 && scene->scene.box != NULL && l < d; l++) {
            const int times = scene->box.periodic[l] ? random_below(random, 5) - 2 : 0;
            for (int k = 0; k < d; k++) {
                x[k] += times * scene->box.rows[l][k];
            }
        }
        for (int k = 0; narrow && k < d; k++) {
            x[k] = (float)x[k];
        }
    }
    for (int e = 0; what == 2 && e < d * d; e++) {
        scene->box.rows[e / d][e % d] *= 1.0 + 0.004 * (random_unit(random) - 0.5);
    }
}

static void
margins_are_promises(void)
{
    static random_scene before, behind;
    static const int    exponents[] = {0, 0, 0, 0, 300, -300, 500, -480};
    harness_random      random = {2718};
    int64_t             n_pairs = 0, n_useful = 0, n_jumped = 0;
    for (int trial = 0; trial < 1200; trial++) {
        const hs_real real = trial % 2 ? HS_FLOAT32 : HS_FLOAT64;
        const int     d = 1 + trial / 2 % 4, exponent = exponents[random_below(&random, 8)];
        two_steps     s = {.margin = 0.0};
        make_scene(&random, trial % SCENE_KINDS, d, random_below(&random, POINTS), 4.0,
                   real == HS_FLOAT32 ? 0 : exponent, &before);
        for (int e = 0; e < POINTS * d && real == HS_FLOAT32; e++) {
            before.x[e] = (float)before.x[e];
        }
        const double cutoff = trial % 11 == 0 ? 0.0 : 0.7 * before.scene.cutoff;
        const double radius = before.scene.cutoff;
        behind = before;
        behind.scene.x = behind.x;
        behind.scene.box = before.scene.box == NULL ? NULL : &behind.box;
        move(&random, 0.06 * radius, real == HS_FLOAT32, &behind);
        take_frame(&before.scene, real, &s.built);
        take_frame(&behind.scene, real, &s.now);
        find_margin(&s, radius, cutoff, NULL);
        CHECK(s.status == HS_OK && s.margin <= radius - cutoff);
        if (s.margin >= 0.0) {
            const int64_t n = keeps_promise(&s, before.scene, behind.scene);
            CHECK(n >= 0);
            n_pairs += n;
            n_useful++;
            n_jumped += s.jumped;
        }
        free_steps(&s);
    }
    CHECK(n_pairs > 5000 && n_useful > 600 && n_jumped > 40);
}

/* Points that go with a box that is stretched, the same numbers as float32 and as float64: most of
 * the skin is left, and as much of it. */
static void
what_goes_with_the_box_uses_little_in_both_types(void)
{
    harness_random random = {41};
    hs_box         box = {.ndim = 3,
                          .periodic = {true, true, true},
                          .rows = {{8.0, 0.0, 0.0}, {1.0, 8.0, 0.0}, {0.0, 1.0, 8.0}}};
    hs_box         stretched = box;
    double         x[3 * POINTS], y[3 * POINTS], margin[2];
    for (int k = 0; k < 9; k++)
        stretched.rows[k / 3][k % 3] *= 1.0625;
    for (int e = 0; e < 3 * POINTS; e++) {
        x[e] = floor(random_unit(&random) * 512.0) / 64.0;
        y[e] = 1.0625 * x[e];
    }
    const brute_scene before = {.ndim = 3, .n = POINTS, .x = x, .box = &box};
    const brute_scene after = {.ndim = 3, .n = POINTS, .x = y, .box = &stretched};
    for (int real = 0; real < 2; real++) {
        two_steps s = {.margin = 0.0};
        take_frame(&before, real ? HS_FLOAT32 : HS_FLOAT64, &s.built);
        take_frame(&after, real ? HS_FLOAT32 : HS_FLOAT64, &s.now);
        find_margin(&s, 2.0, 1.5, NULL);
        CHECK(s.status == HS_OK && s.margin > 0.25);
        margin[real] = s.margin;
        free_steps(&s);
    }
    CHECK(margin[0] == margin[1]);
}

/* What all points share uses no more than roundings of the skin, however far that is. */
static void
a_common_displacement_uses_next_to_nothing(void)
{
    static const double shares[] = {0.125, 0.375, -0.4375, 0.75, 3.25, -1000.3125};
    harness_random      random = {43};
    const hs_box        box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0}, {3.0, 8.0}}};
    double              x[2 * POINTS], y[2 * POINTS];
    brute_scene         before = {.ndim = 2, .n = POINTS, .x = x}, behind = before;
    behind.x = y;
    for (int trial = 0; trial < 12; trial++) {
        before.box = behind.box = trial % 2 ? &box : NULL;
        for (int e = 0; e < 2 * POINTS; e++) {
            x[e] = 8.0 * random_unit(&random);
            y[e] = x[e] + 8.0 * shares[trial / 2];
        }
        const double margin = margin_between(&before, &behind, 2.0, 1.5);
        CHECK(margin < 0.5 && margin > 0.5 - 1e-10);
    }
}

/* Too far, too large, too small or too flat to tell: nothing is promised. */
static void
nothing_is_promised_beyond_the_numbers(void)
{
    double      x[4] = {0.1, 0.2, 0.3, 0.4}, y[4] = {0.1, 0.2, 0.3, 0.4};
    hs_box      box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {0.0, 1.0}}};
    hs_box      flat = box;
    brute_scene before = {.ndim = 2, .n = 2, .x = x, .box = &box};
    brute_scene behind = {.ndim = 2, .n = 2, .x = y, .box = &box};
    y[3] = 0x1p60; /* more box vectors than are counted */
    CHECK(margin_between(&before, &behind, 1.5, 1.0) == -INFINITY);
    y[3] = x[3];
    flat.rows[1][1] = 0x1p-1000;
    behind.box = &flat;
    CHECK(margin_between(&before, &behind, 1.5, 1.0) == -INFINITY);
    before.box = &flat;
    flat.rows[1][1] = 0x1p-1074; /* a quarter of it is nothing */
    CHECK(margin_between(&before, &behind, 1.5, 1.0) == -INFINITY);
    before.box = behind.box = NULL;
    for (int e = 0; e < 4; e++) { /* from one end of the numbers to the other */
        x[e] = e / 2 == 0 ? 0x1.8p1023 : -0x1.8p1023;
        y[e] = -x[e];
    }
    CHECK(margin_between(&before, &behind, 1.5, 1.0) == -INFINITY);
}

static bool
refuse(void *context, double fraction)
{
    (void)fraction;
    ++*(int *)context;
    return false;
}

static void
it_stops_when_told_to_or_without_memory(void)
{
    enum { N = (int)HS_POLL_POINTS + 100 };
    static double x[N], y[N];
    hs_box        box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    brute_scene   before = {.ndim = 1, .n = N, .x = x, .box = &box};
    brute_scene   behind = {.ndim = 1, .n = N, .x = y, .box = &box};
    hs_options    options = hs_options_default();
    two_steps     s = {.margin = 0.0};
    int           polls = 0;
    y[5] = 3.0;
    take_frame(&before, HS_FLOAT64, &s.built);
    take_frame(&behind, HS_FLOAT64, &s.now);
    hs_test_fail_allocation(1);
    find_margin(&s, 0.5, 0.25, &options);
    hs_test_fail_allocation(0);
    CHECK(s.status == HS_ERR_MEMORY && s.margin == -INFINITY && !s.jumped);
    options.poll = refuse;
    options.poll_context = &polls;
    find_margin(&s, 0.5, 0.25, &options);
    CHECK(s.status == HS_ERR_INTERRUPTED && s.margin == -INFINITY && !s.jumped && polls == 1);
    options.poll = NULL;
    find_margin(&s, 0.5, 0.25, &options);
    const int64_t *jumps = s.jumps;
    CHECK(s.status == HS_OK && s.margin > 0.2499 && s.jumped && jumps[5] == 3 && jumps[6] == 0);
    free_steps(&s);
}

/*
 * ---- motion margin ----
 *
 * Every rounding on the way from coordinates to a margin is taken off it, with room, and not much
 * more than that.
 */

#define UNIT 0x1p-53

enum { N_MOTION_MARGIN = 6 };

static hs_frame frame_before, frame_now;
static void    *motion_jumps;

static void
take(const double *x, int64_t n, int d, const hs_box *box, hs_frame *frame)
{
    const hs_points  points = {x, n, d, HS_FLOAT64, d * 8, 8};
    const hs_options options = hs_options_default();
    hs_failure       failure;
    CHECK(hs_frame_take(&points, box, &options, frame, &failure) == HS_OK);
}

static double
margin_of(double radius, double cutoff, bool *jumped)
{
    const hs_options options = hs_options_default();
    const hs_verlet  list = {
         .frames = {frame_before}, .listing = {.radius = radius}, .cutoff = cutoff};
    double margin = NAN;
    CHECK(hs_motion_margin(&list, &frame_now, &options, &margin, jumped, &motion_jumps) == HS_OK);
    return margin;
}

static void
free_all(void)
{
    hs_frame_free(&frame_before);
    hs_frame_free(&frame_now);
    hs_free(NULL, motion_jumps);
}

/* What is gone of a skin though nothing has moved but by what all share, between `least`, which the
 * roundings need, and a few times that. */
static void
check_used(double used, double least)
{
    CHECK(used >= least && used <= 6.0 * least);
}

/* One of them jumps. */
static void
a_jump_of_one_costs_a_difference_and_its_wrapping(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    const double cutoff = 0x1p-31, radius = 0x1p-30;
    double       x[2 * N_MOTION_MARGIN], y[2 * N_MOTION_MARGIN];
    bool         jumped;
    for (int e = 0; e < 2 * N_MOTION_MARGIN; e++)
        x[e] = y[e] = 0x1p-8 * e;
    y[4] += 0x1p20;
    take(x, N_MOTION_MARGIN, 2, &box, &frame_before);
    take(y, N_MOTION_MARGIN, 2, &box, &frame_now);
    const double used = radius - cutoff - margin_of(radius, cutoff, &jumped);
    CHECK(jumped && ((const int64_t *)motion_jumps)[4] == INT64_C(1) << 20);
    check_used(used, 2.0 * sqrt(2.0) * UNIT * (0x1p20 + 0x1p21));
    free_all();
}

/* ---- images of the listed pairs have numbers, in the order in which they first come ---- */

/* Numbers are int32. */
static void
more_images_than_numbers_are_refused(void)
{
    const double x[3] = {0.25, 0.25, 0.25};
    const hs_box box = {
        .ndim = 3, .periodic = {true, true, true}, .rows = {{1.0}, {0.0, 1.0}, {0.0, 0.0, 1.0}}};
    const hs_points points = {x, 1, 3, HS_FLOAT64, 24, 8};
    hs_options      options = hs_options_default();
    hs_verlet      *list = hs_verlet_new();
    bool            rebuilt;
    options.cutoff = 645.0; /* 2 * 645 + 1 to the third power are more than 2^31 */
    CHECK(hs_verlet_update(list, &points, &box, &options, 0.0, false, &rebuilt, NULL) ==
          HS_ERR_MEMORY);
    CHECK(!hs_verlet_look(list).has_list);
    options.cutoff = 1.25;
    CHECK(hs_verlet_update(list, &points, &box, &options, 0.0, false, &rebuilt, NULL) == HS_OK);
    CHECK(hs_verlet_look(list).n_listed == 3);
    hs_verlet_free(list);
}

/* A point and its own images, in a box whose vector points down: half of them are numbered where
 * they are met, the others where each is turned to be positive. */
static hs_status
list_own_images(void *context)
{
    const double    x = 0.25;
    const hs_box    box = {.ndim = 1, .periodic = {true}, .rows = {{-1.0}}};
    const hs_points points = {&x, 1, 1, HS_FLOAT64, 8, 8};
    hs_options      options = hs_options_default();
    hs_verlet      *list = hs_verlet_new();
    bool            rebuilt;
    (void)context;
    options.cutoff = 40.0;
    const hs_status status =
        list == NULL ? HS_ERR_MEMORY
                     : hs_verlet_update(list, &points, &box, &options, 0.25, false, &rebuilt, NULL);
    CHECK(status != HS_OK || hs_verlet_look(list).n_listed == 40);
    hs_verlet_free(list);
    return status;
}

static void
memory_of_images_may_be_refused(void)
{
    CHECK(fail_each_allocation(list_own_images, NULL, 100) > 10);
}

/* ---- when a list is built again, and that it stays as it was when that fails ---- */

static random_scene shared;

static brute_scene *
scene_of(scene_kind kind, int n)
{
    harness_random random = {31337};
    make_scene(&random, kind, 3, n, 4.0, 0, &shared);
    shared.scene.cutoff = 1.0;
    return &shared.scene;
}

static hs_status
update(hs_verlet *list, const brute_scene *scene, double skin, bool *rebuilt, hs_failure *failure)
{
    const hs_points  points = points_of(scene);
    const hs_options options = options_of(scene);
    return hs_verlet_update(list, &points, scene->box, &options, skin, false, rebuilt, failure);
}

/* Whether the list has the pairs of the scene. */
static bool
has_pairs_of(const hs_verlet *list, const brute_scene *scene)
{
    const hs_points points = points_of(scene);
    int64_t         n_pairs = 0;
    return list_difference(list, &points, scene->box, options_of(scene), &n_pairs) == NULL &&
           n_pairs > 0;
}

/* Another cutoff, number or type of points, or other axes that repeat. */
static void
other_scenes_get_lists_of_their_own(void)
{
    brute_scene *scene = scene_of(SCENE_ALIGNED, 60);
    hs_verlet   *list = hs_verlet_new();
    bool         rebuilt;
    scene->n = 30; /* more points than there is room for will come */
    CHECK(update(list, scene, 0.25, &rebuilt, NULL) == HS_OK && rebuilt);
    CHECK(update(list, scene, 0.25, &rebuilt, NULL) == HS_OK && !rebuilt);
    for (int what = 0; what < 6; what++) {
        switch (what) {
        case 0: scene->cutoff = 1.125; break;
        case 1: scene->cutoff = 0.75; break;
        case 2: scene->n = 40; break;
        case 3: shared.box.periodic[1] = false; break;
        case 4: scene->box = NULL; break;
        default: scene->n = 60; break;
        }
        CHECK(update(list, scene, 0.25, &rebuilt, NULL) == HS_OK && rebuilt);
        CHECK(hs_verlet_look(list).tried == -INFINITY && has_pairs_of(list, scene));
        CHECK(update(list, scene, 0.25, &rebuilt, NULL) == HS_OK && !rebuilt);
    }
    float narrow[180];
    for (int e = 0; e < 180; e++) {
        narrow[e] = (float)shared.x[e];
    }
    const hs_points  points = {narrow, 60, 3, HS_FLOAT32, 12, 4};
    const hs_options options = options_of(scene);
    int64_t          n_pairs = 0;
    CHECK(hs_verlet_update(list, &points, NULL, &options, 0.25, false, &rebuilt, NULL) == HS_OK);
    CHECK(rebuilt && list_difference(list, &points, NULL, options, &n_pairs) == NULL);
    hs_verlet_free(list);
}

/* Whatever the limit: the list is built, or the refusal says how many pairs there would be. */
static void
limits_leave_the_list_as_it_was(void)
{
    brute_scene few = *scene_of(SCENE_TRICLINIC, 200), many = few;
    hs_verlet  *list = hs_verlet_new();
    hs_options  options = options_of(&few);
    hs_status   status = HS_ERR_MEMORY;
    int         n_refused = 0, n_late = 0;
    bool        rebuilt;
    few.cutoff = 0.7;
    many.cutoff = options.cutoff = 4.0;
    const hs_points points = points_of(&few);
    CHECK(update(list, &few, 0.1, &rebuilt, NULL) == HS_OK);
    for (double limit = 1000.0; status != HS_OK && limit < 1e8; limit *= IS_SLOW ? 1.2 : 1.02) {
        hs_failure failure;
        options.memory_limit = limit;
        status = hs_verlet_update(list, &points, few.box, &options, 0.3, false, &rebuilt, &failure);
        if (status != HS_OK) {
            CHECK(status == HS_ERR_MEMORY && failure.limit_bytes == limit);
            CHECK(n_refused % 16 != 0 || has_pairs_of(list, &few));
            n_late += failure.expected_pairs > 0.0;
            n_refused++;
        }
    }
    CHECK(status == HS_OK && n_refused > TRIALS(100) && n_late > TRIALS(10) &&
          has_pairs_of(list, &many));
    hs_verlet_free(list);
}

/* Images whose shifts over the box vectors as given pass int32, and turns that pass int64. */
static void
shifts_that_do_not_fit_name_a_point(void)
{
    static const double tilts[] = {0x1p31 + 2.0, -0x1p31 - 2.0, 0x1p40, -0x1p50, 0x1p60, 0x1p60};
    for (int t = 0; t < 6; t++) {
        double      x[6] = {0.0, 0.0, 3.5, 3.75, -3.5, -3.75};
        hs_box      box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0, 0.0}, {0.0, 8.0}}};
        brute_scene scene = {.ndim = 2, .n = 3, .x = x, .box = &box, .cutoff = 1.25};
        hs_verlet  *list = hs_verlet_new();
        hs_failure  failure;
        bool        rebuilt;
        scene.cutoff = t == 5 ? 50.0 : 1.25; /* six times the second: more than 2^62 of the first */
        CHECK(update(list, &scene, 0.25, &rebuilt, NULL) == HS_OK && has_pairs_of(list, &scene));
        box.rows[1][0] = 8.0 * tilts[t];
        CHECK(update(list, &scene, 0.25, &rebuilt, &failure) == HS_ERR_SHIFT_RANGE);
        CHECK(failure.row >= 0 && failure.row < 3);
        box.rows[1][0] = 8.0;
        CHECK(update(list, &scene, 0.25, &rebuilt, NULL) == HS_OK && has_pairs_of(list, &scene));
        box.rows[1][0] = 0x1p23; /* 2^20 of the first */
        x[3] = 0x1p48;           /* 2^45 of the second: 2^65 */
        CHECK(update(list, &scene, 0.25, &rebuilt, &failure) == HS_ERR_SHIFT_RANGE);
        CHECK(failure.row == 1);
        hs_verlet_free(list);
    }
}

/* Points that stay have all of the skin left, but for its rounding. */
static void
what_does_not_move_uses_nothing(void)
{
    double      x[6] = {0.0, 0.1, 0.2, 3.0, 4.0, 5.0};
    brute_scene scene = {.ndim = 3, .n = 2, .x = x};
    for (int n = 0; n <= 2; n++) {
        scene.n = n;
        CHECK(margin_between(&scene, &scene, 1.5, 1.0) == nextafter(0.5, 0.0));
        CHECK(margin_between(&scene, &scene, 1.5, 0.0) == 1.5);
        CHECK(margin_between(&scene, &scene, 1.0, 1.0) == 0.0);
    }
}

void
test_pair_list(void)
{
    RUN(margins_are_promises);
    RUN(what_goes_with_the_box_uses_little_in_both_types);
    RUN(a_common_displacement_uses_next_to_nothing);
    RUN(nothing_is_promised_beyond_the_numbers);
    RUN(it_stops_when_told_to_or_without_memory);
    RUN(a_jump_of_one_costs_a_difference_and_its_wrapping);
    RUN(more_images_than_numbers_are_refused);
    RUN(memory_of_images_may_be_refused);
    RUN(other_scenes_get_lists_of_their_own);
    RUN(limits_leave_the_list_as_it_was);
    RUN(shifts_that_do_not_fit_name_a_point);
    RUN(what_does_not_move_uses_nothing);
}
