/* SPDX-License-Identifier: BSD-3-Clause */
/* test_motion.c: a margin is a promise about every pair; the brute force keeps count of them. */
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/verlet/motion.h"
#include "../../../csrc/core/base/poll.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

void test_motion(void);

enum { POINTS = 24 };

/* Two steps of the same points, the list that was built for the first, and what hs_motion_margin
 * says of the second. */
typedef struct two_steps {
    hs_frame  built, now;
    hs_store  jumps;
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
    const hs_motion  motion = {&s->built, &s->now, radius, cutoff};
    s->radius = radius;
    s->cutoff = cutoff;
    s->jumped = true; /* is set in any case */
    s->status = hs_motion_margin(&motion, options != NULL ? options : &plain, &s->margin,
                                 &s->jumped, &s->jumps);
}

static void
free_steps(two_steps *s)
{
    hs_frame_free(&s->built);
    hs_frame_free(&s->now);
    hs_store_free(&s->jumps);
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
        const int64_t *jumps = s->jumps.data;
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

/* What all points share costs nothing: the mean of a sample, where there are many. */
static void
drift_is_taken_away(void)
{
    enum { N = 2500 };
    static double  x[2 * N], y[2 * N];
    harness_random random = {12};
    hs_box         box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0, 0.0}, {0.0, 8.0}}};
    brute_scene    before = {.ndim = 2, .n = N, .x = x}, behind = {.ndim = 2, .n = N, .x = y};
    for (int e = 0; e < 2 * N; e++) {
        x[e] = 8.0 * random_unit(&random);
        y[e] = x[e] + 0.75;
    }
    CHECK(margin_between(&before, &behind, 1.5, 1.0) > 0.4999);
    y[7] += 0.125; /* the others have not moved so far; twice that is gone */
    CHECK(fabs(margin_between(&before, &behind, 1.5, 1.0) - 0.25) < 0.001);
    for (int e = 0; e < 2 * N; e++) {
        y[e] = x[e] + 3.0; /* so far that each alone might have jumped */
    }
    before.box = behind.box = &box;
    CHECK(margin_between(&before, &behind, 1.5, 1.0) > 0.4999);
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

/* Box vectors of which a short sum of whole ones is taken: of the given ones it takes many. */
static void
jumps_need_not_fit_the_given_box_vectors(void)
{
    double      x[6] = {0.25, 0.25, 0.5, 0.5, 0.75, 0.5}, y[6];
    hs_box      box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {0x1p20, 1.0}}};
    brute_scene before = {.ndim = 2, .n = 3, .x = x, .box = &box};
    brute_scene behind = {.ndim = 2, .n = 3, .x = y, .box = &box};
    memcpy(y, x, sizeof y);
    y[1] += 4.0; /* four times the second, less 2^22 of the first */
    CHECK(margin_between(&before, &behind, 1.5, 1.0) > 0.4999);
    y[1] += 0x1p45; /* less 2^65 of them */
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
    const int64_t *jumps = s.jumps.data;
    CHECK(s.status == HS_OK && s.margin > 0.2499 && s.jumped && jumps[5] == 3 && jumps[6] == 0);
    free_steps(&s);
}

void
test_motion(void)
{
    RUN(margins_are_promises);
    RUN(what_does_not_move_uses_nothing);
    RUN(what_goes_with_the_box_uses_little_in_both_types);
    RUN(drift_is_taken_away);
    RUN(nothing_is_promised_beyond_the_numbers);
    RUN(jumps_need_not_fit_the_given_box_vectors);
    RUN(it_stops_when_told_to_or_without_memory);
}
