/* SPDX-License-Identifier: BSD-3-Clause */
/* test_os.c: the environment of floats is the core's in a call and the caller's after it. */
#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/exact/metric.h"
#include "../support/call_scenes.h"
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

/* A comparison of subnormal numbers would end the process here. */
static void
no_entry_meets_the_callers_traps(void)
{
    for (int f = 0; f < 2 * CALL_KINDS; f++) {
        const call_kind     *function = &call_kinds[f / 2];
        const scene_of_calls kind = {.box = SCENE_ALIGNED,
                                     .n = 200,
                                     .cutoff = 1.0,
                                     .want = ALL,
                                     .exponent = -1060,
                                     .threads = 1 + f % 2};
        hs_status            status[2];
        uint64_t             answer[2];
        bool                 is_left = true;
        for (int trapped = 0; trapped < 2; trapped++) {
            hs_failure failure;
            hs_layout  layout;
            make_call(&kind);
            call_make_objects(&s.c, function->uses);
            const uint64_t before = trapped ? unmask_traps() : 0;
            status[trapped] = function->run(&s.c, &failure);
            hs_cells_layout(s.c.cells, &layout);
            is_left = trapped ? mask_traps(before) : is_left;
            answer[trapped] = s.c.answer;
            call_free_objects(&s.c);
        }
        CHECK(is_left && status[0] == HS_OK && status[1] == HS_OK && answer[0] == answer[1]);
    }
}

void
test_os(void)
{
    RUN(no_entry_meets_the_callers_traps);
    RUN(flushing_is_switched_on_and_off);
    RUN(entering_sets_and_leaving_restores);
    RUN(decisions_ignore_the_callers_environment);
}
