/* SPDX-License-Identifier: BSD-3-Clause */
/* test_batch.c: the batch kernels of this CPU against the functions for one pair, bit by bit. */
#include <float.h>
#include <math.h>

#include "../../../csrc/core/exact/metric.h"
#include "../../../csrc/kernels/kernel.h"
#include "../support/harness.h"

void test_batch(void);

enum { ROOM = 10 * HS_BATCH_PADDING, MOST_KERNELS = 16 };

/* What the numbers of a scene are like. */
typedef enum kind { EVERYDAY, DYADIC, DECIMAL, MEDIUM, EVERY_EXPONENT, EXTREME, SUBNORMAL } kind;

typedef struct scene {
    int     ndim, n_rows;
    int32_t n;
    bool    shifted;
    double  rows[HS_MAX_DIM][HS_MAX_DIM];
    double  p[HS_MAX_DIM][ROOM], q[HS_MAX_DIM][ROOM], times[HS_MAX_DIM][ROOM];
    double  cutoff;
} scene;

/* One pair of a scene, as the functions for one pair take it. */
typedef struct one_pair {
    double  p[HS_MAX_DIM], q[HS_MAX_DIM];
    int64_t turns[HS_MAX_DIM];
} one_pair;

static one_pair
pair_of(const scene *s, int32_t e)
{
    one_pair pair = {.p = {0.0}};
    for (int k = 0; k < s->ndim; k++) {
        pair.p[k] = s->p[k][e];
        pair.q[k] = s->q[k][e];
        pair.turns[k] = s->shifted && k < s->n_rows ? (int64_t)s->times[k][e] : 0;
    }
    return pair;
}

static hs_batch
batch_of(const scene *s)
{
    hs_batch batch = {.n = s->n};
    for (int k = 0; k < s->ndim; k++) {
        batch.p[k] = s->p[k];
        batch.q[k] = s->q[k];
        batch.shift[k] = s->shifted && k < s->n_rows ? s->times[k] : NULL;
    }
    return batch;
}

/* Verdicts and stages of one kernel, with what settles the rest. Adds the pairs that it left to
 * that to *n_open. */
static void
check_judged(const hs_kernel *kernel, const hs_metric *metric, const scene *s, int *n_open)
{
    uint8_t        verdict[ROOM];
    hs_stages      stages = {0, 0, 0}, expected = {0, 0, 0};
    const hs_batch batch = batch_of(s);
    bool           same = true;
    memset(verdict, 99, sizeof verdict);
    kernel->decide_batch(metric, &batch, verdict, &stages);
    CHECK(stages.by_integers == 0);
    for (int32_t e = 0; e < s->n; e++) {
        const one_pair pair = pair_of(s, e);
        const int64_t *shift = s->shifted ? pair.turns : NULL;
        const bool     within = hs_metric_within(metric, pair.p, pair.q, shift, &expected);
        const bool     is_open = verdict[e] == HS_UNDECIDED;
        same = same && within == (is_open ? hs_metric_decide_by_integers(metric, pair.p, pair.q,
                                                                         shift, &stages)
                                          : verdict[e] == HS_WITHIN);
        *n_open += is_open;
    }
    CHECK(same);
    CHECK(stages.by_float64 == expected.by_float64);
    CHECK(stages.by_double_word == expected.by_double_word);
    CHECK(stages.by_integers == expected.by_integers);
    for (int32_t e = s->n + HS_BATCH_PADDING; e < ROOM; e++) {
        CHECK(verdict[e] == 99);
    }
}

/* Distances and vectors of one kernel. Adds the pairs that it could not do to *n_left. */
static void
check_measured(const hs_kernel *kernel, const hs_metric *metric, const scene *s, int *n_left)
{
    static double  distance[ROOM], along[HS_MAX_DIM][ROOM];
    uint8_t        done[ROOM];
    double        *vector[HS_MAX_DIM];
    const hs_batch batch = batch_of(s);
    bool           same = true;
    memset(done, 99, sizeof done);
    for (int k = 0; k < s->ndim; k++) {
        vector[k] = along[k];
    }
    kernel->measure(metric, &batch, distance, vector, done);
    for (int32_t e = 0; e < s->n; e++) {
        const one_pair pair = pair_of(s, e);
        int64_t        any = 0;
        for (int k = 0; k < s->ndim; k++) {
            any |= pair.turns[k];
        }
        same = same && done[e] <= 1;
        *n_left += done[e] == 0;
        /* No shift may also be said with NULL. */
        for (int null = !s->shifted; done[e] && null <= (any == 0); null++) {
            double       right[HS_MAX_DIM];
            const double length =
                hs_metric_measure(metric, pair.p, pair.q, null ? NULL : pair.turns, right);
            same = same && same_bits(distance[e], length);
            for (int k = 0; k < s->ndim; k++) {
                same = same && same_bits(along[k][e], right[k]);
            }
        }
    }
    CHECK(same);
    for (int32_t e = s->n + HS_BATCH_PADDING; e < ROOM; e++) {
        CHECK(done[e] == 99);
    }
    static double alone[ROOM];
    kernel->measure(metric, &batch, alone, NULL, done);
    CHECK(memcmp(alone, distance, (size_t)s->n * sizeof(double)) == 0);
}

static void
check_scene(const scene *s, int *n_open, int *n_left)
{
    const char *names[MOST_KERNELS];
    const int   n_kernels = hs_kernel_names(names, MOST_KERNELS);
    for (int inclusive = 0; inclusive < 2; inclusive++) {
        hs_metric metric;
        hs_metric_init(&metric, s->ndim, s->n_rows, (const double(*)[HS_MAX_DIM])s->rows, s->cutoff,
                       inclusive);
        for (int k = 0; k < n_kernels; k++) {
            const hs_kernel *kernel = hs_kernel_select(names[k]);
            check_judged(kernel, &metric, s, n_open);
            check_measured(kernel, &metric, s, n_left);
        }
    }
}

static double
random_number(harness_random *random, kind of)
{
    static const double extremes[] = {0.0,      0x1p-1074,    DBL_MIN, DBL_MAX,   1.0,     0x1p1023,
                                      0x1p-400, 0x1.fffp-401, 0x1p400, 0x1.1p400, 0x1p-512};
    const double        unit = 2.0 * random_unit(random) - 1.0;
    const double        sign = random_bits(random) & 1 ? 1.0 : -1.0;
    switch (of) {
    case DYADIC: return sign * 0.25 * (double)(random_bits(random) % 9);
    case DECIMAL: return ((double)(random_bits(random) % 17) - 8.0) * 0.1;
    case MEDIUM: return ldexp(unit, (int)(random_bits(random) % 120) - 60);
    case EVERY_EXPONENT: return ldexp(unit, (int)(random_bits(random) % 2098) - 1074);
    case EXTREME: return sign * extremes[random_bits(random) % 11];
    case SUBNORMAL: return sign * ldexp((double)(random_bits(random) % 40), -1074);
    default: return 3.0 * unit;
    }
}

/* Shifts: mostly none, a few turns, or as many as float64 counts. */
static double
random_turns(harness_random *random)
{
    switch (random_bits(random) % 8) {
    case 0: return ldexp(random_bits(random) & 1 ? 1.0 : -1.0, 53);
    case 1: return (double)(int64_t)(random_bits(random) >> 11) - 0x1p52;
    case 2:
    case 3:
    case 4: return (double)(random_bits(random) % 5) - 2.0;
    default: return 0.0;
    }
}

/* rows: 0 a general box, 1 an aligned one, 2 no shifts. */
static void
fill_scene(harness_random *random, scene *s, kind of, int rows)
{
    s->n_rows = rows == 2 && random_bits(random) & 1
                    ? 0
                    : 1 + (int)(random_bits(random) % (unsigned)s->ndim);
    s->shifted = rows != 2;
    for (int l = 0; l < s->n_rows; l++) {
        for (int k = 0; k < s->ndim; k++) {
            const double entry = random_number(random, random_bits(random) % 8 ? of : EVERYDAY);
            s->rows[l][k] = rows == 1 && k != l ? 0.0 : entry;
        }
    }
    for (int32_t e = 0; e < ROOM; e++) {
        const bool resting = random_bits(random) % 4 == 0 || (e & 16);
        for (int k = 0; k < s->ndim; k++) {
            const kind here = random_bits(random) % 12 ? of : (kind)(random_bits(random) % 7);
            s->p[k][e] = random_bits(random) % 9 ? random_number(random, of) : 0.0;
            s->q[k][e] = random_bits(random) % 6 ? random_number(random, here) : s->p[k][e];
            s->q[k][e] = random_bits(random) % 9 ? s->q[k][e] : -0.0;
            s->times[k][e] = resting ? 0.0 : random_turns(random);
        }
    }
}

/* The distance of a pair or a float64 beside it, so that pairs are near ties; or any number. */
static void
choose_cutoff(harness_random *random, scene *s, kind of)
{
    hs_metric metric;
    s->cutoff = fabs(random_number(random, of));
    hs_metric_init(&metric, s->ndim, s->n_rows, (const double(*)[HS_MAX_DIM])s->rows, 1.0, true);
    if (s->n > 0 && random_bits(random) % 6) {
        const one_pair pair = pair_of(s, (int32_t)(random_bits(random) % (unsigned)s->n));
        const double   distance =
            hs_metric_measure(&metric, pair.p, pair.q, s->shifted ? pair.turns : NULL, NULL);
        const double beside[] = {distance, distance, nextafter(distance, 0.0),
                                 nextafter(distance, DBL_MAX)};
        s->cutoff = beside[random_bits(random) % 4];
        s->cutoff = s->cutoff <= DBL_MAX ? s->cutoff : DBL_MAX;
    }
}

static void
batches_do_what_is_done_for_one_pair(void)
{
    harness_random random = {6021};
    static scene   s;
    int            n_open = 0, n_left = 0, n_pairs = 0;
    for (int trial = 0; trial < THIRD_OF_TRIALS(2400); trial++) {
        const kind of = (kind)(trial % 7);
        s.ndim = 1 + trial / 7 % (trial % 3 ? 3 : HS_MAX_DIM);
        s.n = (int32_t)(random_bits(&random) % (ROOM - HS_BATCH_PADDING + 1));
        fill_scene(&random, &s, of, trial / 21 % 3);
        choose_cutoff(&random, &s, of);
        check_scene(&s, &n_open, &n_left);
        n_pairs += s.n;
    }
    CHECK(n_open > n_pairs / 100);
    CHECK(n_left > n_pairs / 100);
}

/* Copies of one pair with every other axis moved by a unit in the last place here and there. */
static void
nearest_ties_are_judged_alike(void)
{
    harness_random random = {6022};
    static scene   s;
    int            n_open = 0, n_left = 0;
    for (int trial = 0; trial < 600; trial++) {
        const kind of = (kind)(trial % 4);
        s.ndim = 1 + trial % HS_MAX_DIM;
        s.n = ROOM - HS_BATCH_PADDING;
        fill_scene(&random, &s, of, trial / 8 % 3);
        for (int32_t e = 0; e < s.n; e++) {
            for (int k = 0; k < s.ndim; k++) {
                const double away = random_bits(&random) & 1 ? DBL_MAX : -DBL_MAX;
                s.p[k][e] = s.p[k][0];
                s.q[k][e] = random_bits(&random) % 8 ? s.q[k][0] : nextafter(s.q[k][0], away);
                s.times[k][e] = s.times[k][0];
            }
        }
        choose_cutoff(&random, &s, of);
        check_scene(&s, &n_open, &n_left);
    }
}

/* Pairs that only what a sum has lost tells from ties; exact/test_metric.c,
 * ties_of_full_width_are_told_from_near_ties, says how they are made. */
static void
what_sums_lose_is_noticed_in_every_lane(void)
{
    harness_random random = {6024};
    static scene   s;
    int            n_open = 0, n_left = 0;
    for (int trial = 0; trial < 400; trial++) {
        const double x = floor(ldexp(1.0 + random_unit(&random), 52)) - 1.0;
        const double small = 94906265.0 - 2.0 * trial, large = (small * small - 1.0) / 2.0;
        s = (scene){.ndim = 3, .n_rows = 3, .n = 37, .shifted = trial % 2};
        s.cutoff = trial % 3 == 0 ? x + 1.0 : trial % 3 == 1 ? large + 1.0 : 2.0 + 0x1p-51;
        s.rows[0][0] = 3002399751580331.0 * 0x1p-53;
        s.rows[1][1] = s.rows[2][2] = 1.0;
        for (int32_t e = 0; e < s.n; e++) {
            const double away = random_bits(&random) & 1 ? DBL_MAX : -DBL_MAX;
            if (trial % 3 == 2) {
                s.p[0][e] = -0x1p-53 + (e % 2 ? 0x1p-105 : 0.0);
                s.q[0][e] = e % 5 ? 1.0 + 0x1p-52 : 1.0;
                s.times[0][e] = 3.0;
            } else {
                s.q[e % 3][e] = trial % 3 == 0 ? x : small;
                s.q[(e + 1) % 3][e] = trial % 3 == 0 ? sqrt(2.0 * x + 1.0) : large;
                s.q[(e + 2) % 3][e] = e % 4 ? 0.0 : e % 8 ? 0x1p-20 : 0x1p-600;
            }
            if (e % 7 == 0) {
                s.q[e % 3][e] = nextafter(s.q[e % 3][e], away);
            }
        }
        check_scene(&s, &n_open, &n_left);
    }
    CHECK(n_open > 0);
}

/* A cubic crystal of spacing a with its cutoff on a shell, pairs across the faces shifted back. */
static void
crystal_ties_need_no_integers(void)
{
    static const double spacings[] = {1.0, 2.5, 0.1, 4.05, 3.3};
    static scene        s;
    for (int trial = 0; trial < 10; trial++) {
        const double a = spacings[trial % 5];
        int          n_open = 0, n_left = 0;
        s = (scene){.ndim = 3, .n_rows = 3, .n = 60, .shifted = trial >= 5, .cutoff = a};
        for (int32_t e = 0; e < s.n; e++) {
            for (int k = 0; k < 3; k++) {
                const int steps = e % 3 == k ? (e % 2 ? 1 : -1) : 0;
                s.rows[k][k] = 8.0 * a;
                s.p[k][e] = (double)(e % 8) * a;
                s.times[k][e] = s.shifted ? (double)(steps * (e % 5 == 0)) : 0.0;
                s.q[k][e] = (e % 8 + steps) * a - s.times[k][e] * s.rows[k][k];
            }
        }
        check_scene(&s, &n_open, &n_left);
        CHECK(n_open == 0);
        CHECK(n_left == 0);
    }
}

static void
everyday_pairs_are_all_done(void)
{
    harness_random random = {6023};
    static scene   s;
    int            n_open = 0, n_left = 0;
    for (int trial = 0; trial < 300; trial++) {
        s = (scene){.ndim = 1 + trial % HS_MAX_DIM, .n_rows = 1, .n = ROOM - HS_BATCH_PADDING};
        s.shifted = trial % 2;
        s.n_rows = s.ndim;
        for (int k = 0; k < s.ndim; k++) {
            s.rows[k][k] = 10.0 + random_unit(&random);
            s.rows[k][0] = trial % 4 == 3 ? 3.0 : s.rows[k][0];
            for (int32_t e = 0; e < s.n; e++) {
                s.p[k][e] = 10.0 * random_unit(&random);
                s.q[k][e] = e % 16 ? 10.0 * random_unit(&random) : s.p[k][e];
                s.times[k][e] = e % 16 ? (double)(random_bits(&random) % 3) - 1.0 : 0.0;
            }
        }
        s.cutoff = 5.0;
        check_scene(&s, &n_open, &n_left);
    }
    CHECK(n_open == 0);
    CHECK(n_left == 0);
}

void
test_batch(void)
{
    RUN(batches_do_what_is_done_for_one_pair);
    RUN(nearest_ties_are_judged_alike);
    RUN(what_sums_lose_is_noticed_in_every_lane);
    RUN(crystal_ties_need_no_integers);
    RUN(everyday_pairs_are_all_done);
}
