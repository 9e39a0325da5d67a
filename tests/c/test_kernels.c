/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_kernels.c: every kernel of this CPU against a plain loop, its data against guard pages: a byte
 * read or written beyond the padding ends the test.
 */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include <math.h>
#include <sys/mman.h>
#include <unistd.h>

#include "../../csrc/kernels/kernel.h"
#include "harness.h"

void test_kernels(void);

enum {
    MOST_KERNELS = 16,
    MOST_CANDIDATES = 4 * HS_SCAN_PADDING + 1,
    N_ARRAYS = HS_MAX_DIM + 2 /* coordinates, labels, hits */
};

/* Pages that may be used, between two that may not. */
typedef struct guarded {
    char  *pages;
    size_t bytes;
} guarded;

static guarded arrays[N_ARRAYS];

static void
guard_arrays(void)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    const size_t needed = (MOST_CANDIDATES + HS_SCAN_PADDING) * sizeof(float);
    const size_t bytes = (needed + page - 1) / page * page;
    for (int a = 0; a < N_ARRAYS; a++) {
        char *all = mmap(NULL, bytes + 2 * page, PROT_READ | PROT_WRITE,
                         MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (all == MAP_FAILED || mprotect(all, page, PROT_NONE) != 0 ||
            mprotect(all + page + bytes, page, PROT_NONE) != 0)
            abort();
        arrays[a] = (guarded){all + page, bytes};
    }
}

/* Room for n numbers of 4 bytes that starts after a guard page, or ends before one. */
static void *
place(int array, int32_t n, bool at_end)
{
    return arrays[array].pages + (at_end ? arrays[array].bytes - 4 * (size_t)n : 0);
}

typedef struct scan {
    int           ndim;
    int32_t       first, last;
    float         y[HS_MAX_DIM][MOST_CANDIDATES];
    int32_t       label[MOST_CANDIDATES];
    float         q[HS_MAX_DIM];
    hs_thresholds thresholds;
} scan;

/* s of candidate c: rounded step by step, in the order that kernel.h gives. */
static float
square_of(const scan *s, int32_t c)
{
    volatile float sum = 0.0f;
    for (int k = 0; k < s->ndim; k++) {
        const volatile float along = s->y[k][c] - s->q[k];
        const volatile float square = along * along;
        sum = k == 0 ? square : sum + square;
    }
    return sum;
}

/* Runs one scan function with its data against one of the guards. */
static int32_t
run_guarded(hs_scan_fn function, const scan *s, bool at_end, const int32_t **hits, bool *ambiguous)
{
    hs_candidates candidates;
    const int32_t n = s->last, room = n + HS_SCAN_PADDING;
    memset(&candidates, 0, sizeof candidates);
    for (int k = 0; k < s->ndim; k++) {
        float *y = place(k, room, at_end);
        memcpy(y, s->y[k], (size_t)n * sizeof(float));
        for (int32_t c = n; c < room; c++)
            y[c] = c % 2 ? s->q[k] : NAN; /* what lies past the last must never be listed */
        candidates.y[k] = y;
    }
    int32_t *label = place(HS_MAX_DIM, room, at_end);
    memcpy(label, s->label, (size_t)n * sizeof(int32_t));
    for (int32_t c = n; c < room; c++)
        label[c] = -1;
    candidates.label = label;
    int32_t *listed = place(HS_MAX_DIM + 1, n - s->first + HS_SCAN_PADDING, at_end);
    *hits = listed;
    return function(&candidates, s->first, s->last, s->q, s->thresholds, s->ndim, listed,
                    ambiguous);
}

/* Exactly what the plain loop lists; only for scans where no rounding can differ, or unfused. */
static void
check_exactly(hs_scan_fn function, const scan *s)
{
    for (int variant = 0; variant < 4; variant++) {
        const int32_t *hits;
        bool           ambiguous = variant & 2, unsure = variant & 2, same = true;
        const int32_t  n_hits = run_guarded(function, s, variant & 1, &hits, &ambiguous);
        int32_t        expected = 0;
        for (int32_t c = s->first; c < s->last; c++) {
            const float square = square_of(s, c);
            if (!(square > s->thresholds.out)) {
                same = same && expected < n_hits && hits[expected] == s->label[c];
                expected++;
                unsure = unsure || !(square < s->thresholds.in);
            }
        }
        CHECK(n_hits == expected);
        CHECK(same);
        CHECK(ambiguous == unsure);
    }
}

/* What any order of summation and any fusing must list, and must not. */
static void
check_roughly(hs_scan_fn function, const scan *s)
{
    for (int variant = 0; variant < 2; variant++) {
        const int32_t *hits;
        bool           ambiguous = false, same = true;
        const int32_t  n_hits = run_guarded(function, s, variant & 1, &hits, &ambiguous);
        int32_t        at = 0;
        for (int32_t c = s->first; c < s->last; c++) {
            const double square = square_of(s, c), limit = s->thresholds.out;
            const bool   listed = at < n_hits && hits[at] == s->label[c];
            if (!(square > limit * (1.0 + 1e-6)) || !listed)
                same = same && (listed || square >= limit * (1.0 - 1e-6));
            else
                same = false;
            at += listed;
        }
        CHECK(same);
        CHECK(at == n_hits);
    }
}

static const hs_kernel *
kernel_number(int k)
{
    const char *names[MOST_KERNELS];
    const int   n = hs_kernel_names(names, MOST_KERNELS);
    return k < n ? hs_kernel_select(names[k]) : NULL;
}

/* Small integers: sums of squares are exact however they are formed. */
static void
fill_with_integers(harness_random *random, scan *s)
{
    for (int k = 0; k < s->ndim; k++) {
        s->q[k] = (float)(random_bits(random) % 5) - 2.0f;
        for (int32_t c = 0; c < s->last; c++)
            s->y[k][c] = (float)(random_bits(random) % 7) - 3.0f;
    }
    for (int32_t c = 0; c < s->last; c++)
        s->label[c] = (int32_t)(random_bits(random) >> 33);
}

/* With both thresholds on numbers that occur. */
static void
every_kernel_lists_what_the_plain_loop_lists(void)
{
    harness_random random = {271828};
    static scan    s;
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int32_t n = 0; n <= MOST_CANDIDATES; n++) {
            for (s.ndim = 1; s.ndim <= HS_MAX_DIM; s.ndim++) {
                s.last = n;
                s.first = (int32_t)(random_bits(&random) % 3 ? random_bits(&random) % (n + 1) : 0);
                fill_with_integers(&random, &s);
                s.thresholds.out = (float)(random_bits(&random) % (8u * (unsigned)s.ndim));
                s.thresholds.in = s.thresholds.out - (float)(random_bits(&random) % 4);
                check_exactly(kernel->scan, &s);
                check_exactly(kernel->unfused, &s);
            }
        }
    }
}

static void
infinity_and_nan_are_listed_as_ambiguous(void)
{
    static const float odd[] = {NAN, INFINITY, -INFINITY, 3e38f, -3e38f, 0x1p-149f, -0.0f};
    static const hs_thresholds limits[] = {{-1.0f, INFINITY}, {INFINITY, 4.0f}, {1.0f, 4.0f},
                                           {-1.0f, -1.0f},    {-1.0f, 0.0f},    {3e38f, 3.2e38f}};
    harness_random             random = {314159};
    static scan                s;
    const hs_kernel           *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int trial = 0; trial < 2000; trial++) {
            s.ndim = 1 + trial % HS_MAX_DIM;
            s.last = (int32_t)(random_bits(&random) % (MOST_CANDIDATES + 1));
            s.first = (int32_t)(random_bits(&random) % (unsigned)(s.last + 1));
            fill_with_integers(&random, &s);
            for (int32_t c = 0; c < s.last; c++) {
                const int axis = (int)(random_bits(&random) % (unsigned)s.ndim);
                if (random_bits(&random) % 4 == 0)
                    s.y[axis][c] = odd[random_bits(&random) % 7];
            }
            if (trial % 5 == 0)
                s.q[0] = odd[random_bits(&random) % 5];
            s.thresholds = limits[random_bits(&random) % 6];
            check_exactly(kernel->scan, &s);
            check_exactly(kernel->unfused, &s);
        }
    }
}

static void
rounding_may_only_differ_near_the_threshold(void)
{
    harness_random   random = {161803};
    static scan      s;
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int trial = 0; trial < 2000; trial++) {
            s.ndim = 1 + trial % HS_MAX_DIM;
            s.last = (int32_t)(random_bits(&random) % (MOST_CANDIDATES + 1));
            s.first = 0;
            fill_with_integers(&random, &s);
            for (int32_t c = 0; c < s.last; c++) {
                for (int a = 0; a < s.ndim; a++)
                    s.y[a][c] += (float)random_unit(&random);
                s.label[c] = c;
            }
            s.thresholds.out = s.last > 0 ? square_of(&s, s.last / 2) : 1.0f;
            s.thresholds.in = s.thresholds.out * 0.9f;
            check_roughly(kernel->scan, &s);
            check_exactly(kernel->unfused, &s);
        }
    }
}

static void
kernels_are_known_by_their_names(void)
{
    const char *names[MOST_KERNELS];
    const int   n = hs_kernel_names(names, MOST_KERNELS);
    CHECK(n >= 1 && n <= MOST_KERNELS);
    CHECK(hs_kernel_names(NULL, 0) == n);
    CHECK(hs_kernel_select(NULL) == hs_kernel_select(names[0]));
    CHECK(strcmp(names[n - 1], "scalar") == 0);
    for (int k = 0; k < n; k++)
        CHECK(strcmp(hs_kernel_select(names[k])->name, names[k]) == 0);
    CHECK(hs_kernel_select("") == NULL);
    CHECK(hs_kernel_select("Scalar") == NULL);
    hs_options      options = hs_options_default();
    const double    x = 0.0;
    const hs_points points = {.data = &x, .n = 1, .ndim = 1, .real = HS_FLOAT64};
    int64_t         count = -1;
    options.kernel = "abacus";
    CHECK(hs_pairs_count(&points, NULL, &options, &count, NULL) == HS_ERR_KERNEL);
    CHECK(count == -1);
}

void
test_kernels(void)
{
    guard_arrays();
    RUN(every_kernel_lists_what_the_plain_loop_lists);
    RUN(infinity_and_nan_are_listed_as_ambiguous);
    RUN(rounding_may_only_differ_near_the_threshold);
    RUN(kernels_are_known_by_their_names);
}
