/* SPDX-License-Identifier: BSD-3-Clause */
/* test_os.c: the environment of floats is the core's in a call and the caller's after it. */
#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/exact/metric.h"
#include "../support/among.h"
#include "../support/harness.h"

#include <fenv.h>
#include <math.h>

void test_os(void);

#if defined(__SSE2__)
#include <xmmintrin.h>
#define HS_CAN_FLUSH 1
#elif defined(__aarch64__)
#define HS_CAN_FLUSH 1
#else
#define HS_CAN_FLUSH 0
#endif

static const int roundings[] = {FE_TONEAREST, FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO};

#if defined(__SSE2__)
#define FLUSH_BITS 0x8040u /* of MXCSR: FTZ is bit 15, DAZ bit 6 */
#elif defined(__aarch64__)
#define FLUSH_BITS (UINT64_C(1) << 24) /* of FPCR: FZ */
#endif

/* Flush results and operands. */
static void
set_flushing(bool flush)
{
#if defined(__SSE2__)
    _mm_setcsr((_mm_getcsr() & ~FLUSH_BITS) | (flush ? FLUSH_BITS : 0u));
#elif defined(__aarch64__)
    uint64_t control;
    __asm__ __volatile__("mrs %0, fpcr" : "=r"(control));
    control = (control & ~FLUSH_BITS) | (flush ? FLUSH_BITS : 0);
    __asm__ __volatile__("msr fpcr, %0" : : "r"(control));
#else
    (void)flush;
#endif
}

static bool
is_flushing(void)
{
#if defined(__SSE2__)
    return (_mm_getcsr() & FLUSH_BITS) == FLUSH_BITS;
#elif defined(__aarch64__)
    uint64_t control;
    __asm__ __volatile__("mrs %0, fpcr" : "=r"(control));
    return (control & FLUSH_BITS) == FLUSH_BITS;
#else
    return false;
#endif
}

static bool
rounds_to_nearest_without_flushing(void)
{
    volatile double one = 1.0, half_ulp = 0x1p-53, more = 0x1.8p-53, smallest = 0x1p-1074;
    volatile float  smallest_float = 0x1p-149f;
    return one + half_ulp == 1.0 && one + more > 1.0 && -one - half_ulp == -1.0 &&
           smallest * 2.0 == 0x1p-1073 && smallest != 0.0 && smallest_float * 2.0f == 0x1p-148f;
}

static void
entering_sets_and_leaving_restores(void)
{
    for (int mode = 0; mode < 4; mode++) {
        for (int flush = 0; flush <= HS_CAN_FLUSH; flush++) {
            fesetround(roundings[mode]);
            set_flushing(flush);
            feclearexcept(FE_ALL_EXCEPT);
            feraiseexcept(FE_DIVBYZERO);
            const hs_fpenv saved = hs_fpenv_enter();
            const bool     inside = rounds_to_nearest_without_flushing();
            const bool     nested_inside =
                (hs_fpenv_leave(hs_fpenv_enter()), rounds_to_nearest_without_flushing());
            hs_fpenv_leave(saved);
            const int  mode_after = fegetround();
            const int  flags_after = fetestexcept(FE_ALL_EXCEPT);
            const bool flush_after = is_flushing();
            set_flushing(false);
            fesetround(FE_TONEAREST);
            CHECK(inside && nested_inside);
            CHECK(mode_after == roundings[mode]);
            CHECK(flush_after == (bool)flush);
            CHECK(flags_after == FE_DIVBYZERO);
        }
    }
    feclearexcept(FE_ALL_EXCEPT);
}

/* Decisions and distances are the same whatever the caller had set. */
static void
decisions_ignore_the_callers_environment(void)
{
    harness_random random = {61};
    for (int trial = 0; trial < 3000; trial++) {
        const int     exponent = trial % 3 ? 0 : -1060;
        double        p[3], q[3], rows[1][HS_MAX_DIM] = {{0}};
        const int64_t shift[1] = {trial % 4};
        double        cutoff = 0.0, first = 0.0;
        bool          decided = false;
        for (int k = 0; k < 3; k++) {
            p[k] = ldexp(random_unit(&random), exponent);
            q[k] = ldexp(random_unit(&random), exponent);
            rows[0][k] = ldexp(random_unit(&random), exponent);
            const double component = (q[k] - p[k] + (double)shift[0] * rows[0][k]);
            cutoff = hypot(cutoff, component);
        }
        for (int mode = 0; mode < 4; mode++) {
            for (int flush = 0; flush <= HS_CAN_FLUSH; flush++) {
                hs_metric metric;
                hs_stages stages = {0, 0, 0};
                double    vector[3];
                fesetround(roundings[mode]);
                set_flushing(flush);
                const hs_fpenv saved = hs_fpenv_enter();
                hs_metric_init(&metric, 3, 1, (const double(*)[8])rows, cutoff, true);
                const bool   within = hs_metric_within(&metric, p, q, shift, &stages);
                const double distance = hs_metric_measure(&metric, p, q, shift, vector);
                hs_fpenv_leave(saved);
                set_flushing(false);
                fesetround(FE_TONEAREST);
                if (mode == 0 && !flush) {
                    decided = within;
                    first = distance;
                }
                CHECK(within == decided);
                CHECK(distance == first);
            }
        }
    }
}

/* For the filter alone, and only where it helps. */
static void
flushing_is_switched_on_and_off(void)
{
    volatile float small = 0x1.2468acp-100f, product;
    const hs_fpenv saved = hs_fpenv_enter();
    CHECK(!hs_fpenv_met_subnormal());
    product = small * 0x1.13579cp-40f;
    const bool met = hs_fpenv_met_subnormal();
    CHECK(product > 0.0f);
    hs_fpenv_flush(true);
    product = small * 0x1.13579cp-40f;
    const bool flushed = product == 0.0f;
    hs_fpenv_flush(false);
    CHECK(rounds_to_nearest_without_flushing());
#if defined(__SSE2__)
    CHECK(met && flushed);
#else
    CHECK(!met && !flushed);
#endif
    hs_fpenv_leave(saved);
}

/* Unmasks every trap that this CPU has, or puts back what was there. */
static uint64_t
unmask_traps(void)
{
#if defined(__SSE2__)
    const uint64_t before = _mm_getcsr();
    _mm_setcsr(0);
    return before;
#elif defined(__aarch64__)
    uint64_t before;
    __asm__ __volatile__("mrs %0, fpcr" : "=r"(before));
    __asm__ __volatile__("msr fpcr, %0" : : "r"(UINT64_C(0x9f00)));
    return before;
#else
    return 0;
#endif
}

/* Whether traps were still unmasked and no flag was set. */
static bool
mask_traps(uint64_t before)
{
#if defined(__SSE2__)
    const bool same = _mm_getcsr() == 0;
    _mm_setcsr((unsigned)before);
    return same;
#elif defined(__aarch64__)
    __asm__ __volatile__("msr fpcr, %0" : : "r"(before));
    return true;
#else
    (void)before;
    return true;
#endif
}

enum { N_TRAPPED = 200 };

typedef struct trapped_scene {
    double     x[3 * N_TRAPPED];
    hs_points  points;
    hs_box     box;
    hs_options options;
} trapped_scene;

static void
make_trapped_scene(trapped_scene *s)
{
    harness_random random = {17};
    for (int e = 0; e < 3 * N_TRAPPED; e++)
        s->x[e] = ldexp(floor(random_unit(&random) * 1e6), -1074);
    s->points = (hs_points){s->x, N_TRAPPED, 3, HS_FLOAT64, 3 * sizeof(double), sizeof(double)};
    s->box = (hs_box){.ndim = 3};
    for (int k = 0; k < 3; k++) {
        s->box.rows[k][k] = 0x1p-1054;
        s->box.periodic[k] = k < 2;
    }
    s->options = hs_options_default();
    s->options.cutoff = 0x1p-1056;
    s->options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT;
}

/* One of each family of entries; returns what it found, or -1. */
static int64_t
search_by(int family, const trapped_scene *s, hs_cells *cells, hs_verlet *list)
{
    const double       edges[] = {0.0, 0x1p-1070, 0x1p-1056};
    int64_t            count = -1, bins[3] = {0}, rows[N_TRAPPED];
    hs_pairs          *pairs = NULL;
    hs_status          status = HS_OK;
    hs_layout          layout;
    hs_plan            plan;
    bool               rebuilt;
    const hs_histogram histogram = {
        .n_edges = 3, .edges = edges, .last_inclusive = true, .n_types = 1, .counts = bins};
    switch (family) {
    case 0: status = hs_pairs_find(AMONG(&s->points, &s->box), &s->options, &pairs, NULL); break;
    case 1: status = hs_pairs_count(AMONG(&s->points, &s->box), &s->options, &count, NULL); break;
    case 2:
        status =
            hs_neighbors_find(QUERIED(&s->points, &s->points, &s->box), &s->options, &pairs, NULL);
        break;
    case 3: status = hs_neighbors_count(AMONG(&s->points, &s->box), &s->options, rows, NULL); break;
    case 4:
        status = hs_pairs_histogram(AMONG(&s->points, &s->box), &s->options, &histogram, NULL);
        count = bins[0] + bins[1] + bins[2];
        break;
    case 5:
        status = hs_nearest_find(AMONG(&s->points, &s->box), 3, &s->options, &pairs, NULL);
        break;
    case 6: status = hs_pairs_find(IN_CELLS(cells), &s->options, &pairs, NULL); break;
    case 7:
        status = hs_neighbors_find(QUERIED_CELLS(cells, &s->points), &s->options, &pairs, NULL);
        break;
    case 8:
        status = hs_nearest_find(QUERIED_CELLS(cells, &s->points), 2, &s->options, &pairs, NULL);
        break;
    case 9: status = hs_cells_find(cells, &s->points, rows, NULL); break;
    case 10: status = hs_cells_candidates(cells, NULL, &s->options, &pairs, NULL); break;
    case 11:
        hs_cells_layout(cells, &layout);
        count = layout.n_cells;
        break;
    case 12:
        status = hs_verlet_update(list, &s->points, &s->box, &s->options, 0x1p-1060, true, &rebuilt,
                                  NULL);
        break;
    case 13: status = hs_verlet_find(list, &s->options, &pairs, NULL); break;
    case 14: status = hs_plan_make(AMONG(&s->points, &s->box), &s->options, &plan, NULL); break;
    case 15: status = hs_box_measure(&s->box, NULL, NULL, NULL); break;
    case 16: status = hs_box_wrap(&s->box, &s->points, NULL, NULL, NULL); break;
    default: {
        hs_stream *stream = NULL;
        status = hs_stream_open(AMONG(&s->points, &s->box), &s->options, 50, &stream, NULL);
        if (status == HS_OK)
            status = hs_stream_next(stream, NULL, NULL, &pairs, NULL);
        hs_stream_free(stream);
    }
    }
    count = pairs != NULL ? hs_pairs_length(pairs) : count;
    hs_pairs_free(pairs);
    return status == HS_OK ? count : -2;
}

/* A comparison of subnormal numbers would end the process here. */
static void
no_entry_meets_the_callers_traps(void)
{
    static trapped_scene s;
    hs_cells            *cells = NULL;
    hs_verlet           *list = hs_verlet_new();
    make_trapped_scene(&s);
    CHECK(hs_cells_build(&s.points, &s.box, &s.options, &cells, NULL) == HS_OK);
    for (int threads = 1; threads <= 2; threads++) {
        s.options.threads = threads;
        for (int family = 0; family <= 17; family++) {
            const int64_t  plain = search_by(family, &s, cells, list);
            const uint64_t before = unmask_traps();
            const int64_t  trapped = search_by(family, &s, cells, list);
            const bool     is_left = mask_traps(before);
            CHECK(plain != -2 && trapped == plain);
            CHECK(is_left);
        }
    }
    hs_cells_free(cells);
    hs_verlet_free(list);
}

void
test_os(void)
{
    RUN(no_entry_meets_the_callers_traps);
    RUN(flushing_is_switched_on_and_off);
    RUN(entering_sets_and_leaving_restores);
    RUN(decisions_ignore_the_callers_environment);
}
