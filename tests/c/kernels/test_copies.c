/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_copies.c: what every kernel of this CPU brings in and puts out, between guard pages:
 * gathering runs of points to float32, as far as they are near a box, emitting hits as pairs.
 */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include <math.h>

#include "../support/kernel_checks.h"

void test_copies(void);

enum { N_POINTS = 600, MOST_RUNS = 200, MOST_HITS = 2 * HS_BLOCK_CANDIDATES };

static guarded x_pages[HS_MAX_DIM], order_pages, y_pages[HS_MAX_DIM], norm_pages, id_pages;
static guarded number_pages, hits_pages, i_pages, j_pages;

static void
guard_copies(void)
{
    const size_t block = HS_BLOCK_CANDIDATES + HS_PADDING, hits = MOST_HITS + HS_PADDING;
    for (int k = 0; k < HS_MAX_DIM; k++) {
        x_pages[k] = guarded_pages((N_POINTS + HS_PADDING) * sizeof(double));
        y_pages[k] = guarded_pages(block * sizeof(float));
    }
    order_pages = guarded_pages((N_POINTS + HS_PADDING) * sizeof(int32_t));
    norm_pages = guarded_pages(block * sizeof(float));
    id_pages = guarded_pages(block * sizeof(int32_t));
    number_pages = guarded_pages(block * sizeof(int32_t));
    hits_pages = guarded_pages(hits * sizeof(int32_t));
    i_pages = guarded_pages(hits * sizeof(int64_t));
    j_pages = guarded_pages(hits * sizeof(int64_t));
}

/* ---- gather ---- */

/* Numbers of every size, now and then odd ones. */
static double
some_coordinate(harness_random *random, bool odd)
{
    static const double odds[] = {NAN, INFINITY, -INFINITY, 3e38, -1e-40, 0x1p-149, -0.0};
    if (odd && random_bits(random) % 50 == 0) {
        return odds[random_bits(random) % 7];
    }
    const double x = 2.0 * random_unit(random) - 1.0;
    return ldexp(x, odd ? (int)(random_bits(random) % 60) - 30 : 2);
}

/* Runs of up to `most` points, and their end; returns how many. */
static int32_t
make_runs(harness_random *random, int ndim, int32_t n_points, int32_t most, hs_run *runs)
{
    const int32_t wanted = 1 + (int32_t)(random_bits(random) % (MOST_RUNS - 1));
    int32_t       at = 0, r = 0;
    for (; r < wanted; r++) {
        const int32_t si = (int32_t)(random_bits(random) % (unsigned)n_points);
        const int32_t left = n_points - si < most ? n_points - si : most;
        const int32_t n = 1 + (int32_t)(random_bits(random) % (unsigned)left);
        if (at + n > HS_BLOCK_CANDIDATES) {
            break;
        }
        runs[r] = (hs_run){.at = at, .si = si};
        for (int k = 0; k < ndim; k++) {
            runs[r].moved[k] = random_bits(random) % 4 ? some_coordinate(random, false) : 0.0;
        }
        at += n;
    }
    runs[r].at = at;
    return r;
}

/* Points against a guard, and room for n candidates against another. */
static hs_gather
place_gather(harness_random *random, int ndim, int32_t n_points, int32_t n, bool odd, bool at_end)
{
    hs_gather g = {.ndim = ndim};
    for (int k = 0; k < ndim; k++) {
        double *x = guarded_place(x_pages[k], n_points + HS_PADDING, sizeof(double), at_end);
        for (int32_t si = 0; si < n_points + HS_PADDING; si++) {
            x[si] = si < n_points ? some_coordinate(random, odd) : 1e300;
        }
        g.x[k] = x;
        g.y[k] = guarded_place(y_pages[k], n + HS_PADDING, sizeof(float), at_end);
    }
    int32_t *order = guarded_place(order_pages, n_points + HS_PADDING, sizeof(int32_t), at_end);
    for (int32_t si = 0; si < n_points + HS_PADDING; si++) {
        order[si] = (int32_t)(random_bits(random) >> 33);
    }
    g.order = order;
    g.norm = guarded_place(norm_pages, n + HS_PADDING, sizeof(float), at_end);
    g.id = guarded_place(id_pages, n + HS_PADDING, sizeof(int32_t), at_end);
    g.number = guarded_place(number_pages, n + HS_PADDING, sizeof(int32_t), at_end);
    g.near.out = INFINITY;
    return g;
}

static uint32_t
bits_of(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* d roundings of the sum of squares, fused or not. */
static bool
norm_is_near(const hs_gather *g, int32_t c)
{
    const double unit = 0x1p-24;
    double       sum = 0.0;
    for (int k = 0; k < g->ndim; k++) {
        sum += (double)g->y[k][c] * (double)g->y[k][c];
    }
    const double norm = (double)g->norm[c], d = g->ndim;
    if (!(sum < 3e38)) {
        return !(norm < 2e38); /* overflow, or NaN */
    }
    return fabs(norm - sum) <= d * unit * 1.000001 * sum + d * 0x1p-149;
}

/* y_k of point si of a run. */
static float
gathered_place(const hs_gather *g, const hs_run *run, int32_t si, int k)
{
    const volatile double moved = g->x[k][si] + run->moved[k];
    const volatile float  y = (float)moved;
    return y;
}

/* Whether point si of a run is to be kept, each operation rounded once. */
static bool
is_to_be_kept(const hs_gather *g, const hs_run *run, int32_t si)
{
    volatile float s = 0.0f;
    bool           has_nan = false;
    for (int k = 0; k < g->ndim; k++) {
        const float          y = gathered_place(g, run, si, k);
        const volatile float below = g->near.low[k] - y, above = y - g->near.high[k];
        const volatile float gap = fmaxf(fmaxf(below, above), 0.0f), square = gap * gap;
        s = s + square;
        has_nan = has_nan || isnan(y);
    }
    return has_nan || !(s > g->near.out);
}

/* The largest bits of all that was gathered, or 0 when something else is wrong. given: the runs
 * before. */
static uint32_t
check_gathered(const hs_gather *g, const hs_run *given, const hs_run *runs, int32_t n_runs)
{
    bool     same = true;
    uint32_t largest = 0;
    int32_t  c = 0;
    for (int32_t r = 0; r < n_runs; r++) {
        same = same && runs[r].at == c && runs[r].si == given[r].si;
        for (int32_t si = given[r].si; si < given[r].si + given[r + 1].at - given[r].at; si++) {
            if (!is_to_be_kept(g, &given[r], si))
                continue;
            for (int k = 0; k < g->ndim; k++) {
                const float y = gathered_place(g, &given[r], si, k);
                same = same && (isnan(y) ? isnan(g->y[k][c]) : bits_of(y) == bits_of(g->y[k][c]));
                const uint32_t size = bits_of(g->y[k][c]) & UINT32_C(0x7fffffff);
                largest = size > largest ? size : largest;
            }
            same = same && g->id[c] == g->order[si] && g->number[c] == si && norm_is_near(g, c);
            c++;
        }
    }
    CHECK(same && g->n == c);
    return same ? largest : 0;
}

/* A box of any size, about as far from the points as it is large, and how near is near. */
static void
place_box(harness_random *random, hs_gather *g)
{
    for (int k = 0; k < g->ndim; k++) {
        g->near.low[k] = (float)(8.0 * random_unit(random) - 6.0);
        g->near.high[k] = g->near.low[k] + (float)(4.0 * random_unit(random));
    }
    g->near.out = (float)(random_bits(random) % 4 * g->ndim * random_unit(random));
}

static void
gathering_copies_what_is_near(void)
{
    static hs_run    given[MOST_RUNS + 1], runs[MOST_RUNS + 1];
    harness_random   random = {112358};
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int trial = 0; trial < 400; trial++) {
            static const int32_t most[] = {1, 3, 15, 16, 17, 70, N_POINTS};
            const int            ndim = 1 + trial % HS_MAX_DIM;
            const int32_t        n_points = 1 + (int32_t)(random_bits(&random) % N_POINTS);
            const int32_t n_runs = make_runs(&random, ndim, n_points, most[trial % 7], given);
            hs_gather     g =
                place_gather(&random, ndim, n_points, given[n_runs].at, trial & 1, trial & 2);
            const uint32_t before = trial % 5 ? 0 : bits_of((float)(trial + 1));
            const int32_t  half = trial % 3 == 0 ? n_runs / 2 : 0; /* in two parts */
            g.largest = before;
            memcpy(runs, given, sizeof runs);
            if (trial & 4)
                place_box(&random, &g);
            kernel->gather(&g, runs, half);
            kernel->gather(&g, runs + half, n_runs - half);
            const uint32_t largest = check_gathered(&g, given, runs, n_runs);
            CHECK(g.largest == (largest > before ? largest : before));
        }
    }
}

/* Infinity and NaN are larger than every number, wherever in a vector they are. */
static void
largest_finds_what_is_not_finite(void)
{
    harness_random   random = {132134};
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int32_t at = 0; at < 40; at++) {
            for (int32_t n = at + 1; n <= 41; n++) {
                hs_run    runs[2] = {{.at = 0, .si = 0}, {.at = n}};
                hs_gather g = place_gather(&random, 2, n, n, false, true);
                double   *x = (double *)g.x[at % 2];
                x[at] = at % 3 == 0 ? NAN : at % 3 == 1 ? -INFINITY : -100.0;
                kernel->gather(&g, runs, 1);
                CHECK(at % 3 == 0   ? g.largest > bits_of(INFINITY)
                      : at % 3 == 1 ? g.largest == bits_of(INFINITY)
                                    : g.largest == bits_of(100.0f));
            }
        }
    }
}

/* ---- emit ---- */

static int64_t
element(const void *array, int bytes, int32_t h)
{
    return bytes == 8 ? ((const int64_t *)array)[h] : ((const int32_t *)array)[h];
}

static void
check_emit(const hs_kernel *kernel, const hs_hits *hits, int bytes, int which, bool at_end)
{
    const hs_emit_fn emit = bytes == 8 ? kernel->emit_int64 : kernel->emit_int32;
    const int32_t    n = hits->n > 0 ? hits->end[hits->n - 1] : 0;
    void            *i = guarded_place(i_pages, n + HS_PADDING, (size_t)bytes, at_end);
    void            *j = guarded_place(j_pages, n + HS_PADDING, (size_t)bytes, at_end);
    bool             same = true;
    emit(hits, which & 1 ? i : NULL, which & 2 ? j : NULL);
    for (int32_t t = 0, h = 0; t < hits->n; t++) {
        for (; h < hits->end[t]; h++) {
            const int32_t a = hits->point[t], b = hits->label[h];
            same = same && (!(which & 1) || element(i, bytes, h) == (a < b ? a : b));
            same = same && (!(which & 2) || element(j, bytes, h) == (a < b ? b : a));
        }
    }
    CHECK(same);
}

static void
emitting_puts_the_lower_number_first(void)
{
    harness_random   random = {24601};
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int trial = 0; trial < 400; trial++) {
            int32_t   point[HS_GROUP_POINTS], end[HS_GROUP_POINTS];
            hs_hits   hits = {.point = point, .end = end};
            const int most = trial % 4 == 0 ? 2 : trial % 4 == 1 ? 20 : 128;
            int32_t   n = 0;
            hits.n = (int32_t)(random_bits(&random) % (HS_GROUP_POINTS + 1));
            for (int32_t t = 0; t < hits.n; t++) {
                n += (int32_t)(random_bits(&random) % (unsigned)(most + 1)); /* or none */
                end[t] = n;
                point[t] = trial % 2 ? (int32_t)(random_bits(&random) >> 33) : t;
            }
            int32_t *label = guarded_place(hits_pages, n + HS_PADDING, sizeof(int32_t), trial & 8);
            for (int32_t h = 0; h < n + HS_PADDING; h++) {
                label[h] = trial % 2 ? (int32_t)(random_bits(&random) >> 33) : h % 64;
            }
            hits.label = label;
            for (int which = 0; which < 4; which++) { /* neither, i, j, both */
                check_emit(kernel, &hits, 4, which, trial & 8);
                check_emit(kernel, &hits, 8, which, trial & 8);
            }
        }
    }
}

/* What is not asked for stays as it was, padding included. */
static void
nothing_else_is_written(void)
{
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        const int32_t point = 7, end = 5;
        int32_t       label[5 + HS_PADDING] = {9, 3, 7, 1, 8};
        const hs_hits hits = {.n = 1, .point = &point, .end = &end, .label = label};
        int64_t       array[5 + HS_PADDING + 8];
        memset(array, 0x5a, sizeof array);
        kernel->emit_int64(&hits, array, NULL);
        CHECK(array[0] == 7 && array[1] == 3 && array[2] == 7 && array[3] == 1 && array[4] == 7);
        for (int e = 5 + HS_PADDING; e < 5 + HS_PADDING + 8; e++) {
            CHECK(array[e] == INT64_C(0x5a5a5a5a5a5a5a5a));
        }
    }
}

void
test_copies(void)
{
    guard_copies();
    RUN(gathering_copies_what_is_near);
    RUN(largest_finds_what_is_not_finite);
    RUN(emitting_puts_the_lower_number_first);
    RUN(nothing_else_is_written);
}
