/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_copies.c: what every kernel of this CPU brings in and puts out, between guard pages:
 * gathering runs of points to float32, as far as they are near a box, emitting hits as pairs; for the
 * nearest points, gathering candidates, putting squares in order, listing boxes.
 */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include <math.h>

#include "../support/kernel_checks.h"

void test_copies(void);

enum {
    N_POINTS = 600,
    MOST_RUNS = 200,
    MOST_NEAREST_RUNS = 60,
    MOST_HITS = 2 * HS_BLOCK_CANDIDATES
};

static guarded x_pages[HS_MAX_DIM], order_pages, y_pages[HS_MAX_DIM], square_pages, id_pages;
static guarded number_pages, hits_pages, i_pages, j_pages, high_pages[HS_MAX_DIM];

static void
guard_copies(void)
{
    const size_t block = HS_BLOCK_CANDIDATES + HS_PADDING, hits = MOST_HITS + HS_PADDING;
    for (int k = 0; k < HS_MAX_DIM; k++) {
        x_pages[k] = guarded_pages((N_POINTS + HS_PADDING) * sizeof(double));
        y_pages[k] = guarded_pages(block * sizeof(float));
        high_pages[k] = guarded_pages(block * sizeof(float));
    }
    order_pages = guarded_pages((N_POINTS + HS_PADDING) * sizeof(int32_t));
    square_pages = guarded_pages(block * sizeof(float));
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
            same = same && g->id[c] == g->order[si] && g->number[c] == si;
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
    const int32_t n = hits->n > 0 ? hits->end[hits->n - 1] : 0;
    void         *i = guarded_place(i_pages, n + HS_PADDING, (size_t)bytes, at_end);
    void         *j = guarded_place(j_pages, n + HS_PADDING, (size_t)bytes, at_end);
    bool          same = true;
    kernel->emit(hits, bytes, which & 1 ? i : NULL, which & 2 ? j : NULL);
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

static int32_t
below(harness_random *random, int32_t n)
{
    return (int32_t)(random_bits(random) % (unsigned)n);
}

/* ---- gather_relative ---- */

/* Runs of one of two images; returns how many, *n: candidates. */
static int32_t
make_nearest_runs(harness_random *random, int32_t n_points, hs_nearest_run *runs, int32_t *n)
{
    const int32_t wanted = 1 + below(random, MOST_NEAREST_RUNS);
    int32_t       r = 0;
    *n = 0;
    for (; r < wanted; r++) {
        const int32_t si = below(random, n_points);
        const int32_t points = 1 + below(random, n_points - si);
        if (*n + points > HS_BLOCK_CANDIDATES) {
            break;
        }
        runs[r] = (hs_nearest_run){*n, points, si, below(random, 2)};
        *n += points;
    }
    return r;
}

static void
check_run(const hs_relative_keys *g, const hs_nearest_run *run)
{
    bool same = true;
    for (int32_t c = 0; c < run->n; c++) {
        for (int k = 0; k < g->ndim; k++) {
            const volatile double z = g->x[k][run->si + c] + g->images[run->image].moved[k];
            const volatile double apart = z - g->centre[k];
            const volatile float  y = (float)(apart * g->unit);
            const float           most = (float)g->extent;
            const float           found = g->y[k][run->at + c];
            same = same && found == (y > most ? most : y < -most ? -most : y);
        }
        same = same && g->number[run->at + c] == run->si + c;
    }
    CHECK(same);
}

static void
relating_rounds_each_step(void)
{
    hs_nearest_run   runs[MOST_NEAREST_RUNS];
    harness_random   random = {271828};
    const hs_kernel *kernel;
    for (int kn = 0; (kernel = kernel_number(kn)) != NULL; kn++) {
        for (int trial = 0; trial < 200; trial++) {
            const int32_t    n_points = 1 + below(&random, trial % 3 ? 20 : N_POINTS);
            int32_t          n;
            const int32_t    n_runs = make_nearest_runs(&random, n_points, runs, &n);
            hs_nearest_image images[2] = {{.is_home = true}, {.is_home = false}};
            hs_relative_keys g = {.ndim = 1 + trial % HS_MAX_DIM,
                                  .images = images,
                                  .unit = ldexp(1.0, below(&random, 40) - 20),
                                  .extent = 1.0 + random_unit(&random)};
            g.extent = ldexp(g.extent, below(&random, 40) - 20);
            for (int k = 0; k < g.ndim; k++) {
                double *x = guarded_place(x_pages[k], n_points + HS_PADDING, sizeof *x, trial & 1);
                for (int32_t si = 0; si < n_points + HS_PADDING; si++) {
                    x[si] = si < n_points ? 2.0 * random_unit(&random) - 1.0 : 1e300;
                }
                g.x[k] = x;
                g.y[k] = guarded_place(y_pages[k], n + HS_PADDING, sizeof(float), trial & 1);
                images[1].moved[k] = 2.0 * random_unit(&random) - 1.0;
                g.centre[k] = random_unit(&random);
            }
            g.number = guarded_place(id_pages, n + HS_PADDING, sizeof(int32_t), trial & 1);
            kernel->gather_relative(&g, runs, n_runs);
            for (int32_t r = 0; r < n_runs; r++) {
                check_run(&g, &runs[r]);
            }
        }
    }
}

/* ---- order ---- */

static void
keys_ascend(void)
{
    harness_random   random = {314159};
    const hs_kernel *kernel;
    for (int kn = 0; (kernel = kernel_number(kn)) != NULL; kn++) {
        for (int trial = 0; trial < 640; trial++) {
            const int32_t n = 1 + trial % HS_ORDER_MOST;
            float        *s = guarded_place(square_pages, n + HS_PADDING, sizeof *s, trial & 1);
            int32_t      *keys = guarded_place(id_pages, n, sizeof *keys, trial & 1);
            bool          same = true;
            for (int32_t e = 0; e < n + HS_PADDING; e++) {
                s[e] = trial % 3 ? (float)random_unit(&random) : (float)below(&random, 4);
                s[e] = e < n ? s[e] : -1.0f; /* of no meaning */
            }
            kernel->order(s, n, keys);
            for (int32_t e = 0; e < n; e++) {
                const int32_t number = keys[e] & (HS_ORDER_MOST - 1);
                int32_t       bits;
                memcpy(&bits, &s[number], sizeof bits);
                same = same && number < n &&
                       (bits | (HS_ORDER_MOST - 1)) == (keys[e] | (HS_ORDER_MOST - 1));
                same = same && (e == 0 || keys[e - 1] < keys[e]) && keys[e] < HS_ORDER_LAST;
            }
            CHECK(same);
        }
    }
}

/* ---- near_boxes ---- */

/* Whether a list is right, for small integers, which squares are exact of. */
static void
check_boxes(const hs_boxes *b, int32_t n_hits)
{
    int32_t at = 0;
    bool    same = true;
    for (int32_t c = 0; c < b->n; c++) {
        double s = 0.0;
        for (int k = 0; k < b->ndim; k++) {
            const double gap = fmax(fmax((double)b->low[k][c] - (double)b->to[k],
                                         (double)b->from[k] - (double)b->high[k][c]),
                                    0.0);
            s += gap * gap;
        }
        if (s <= (double)b->out) {
            same = same && at < n_hits && b->hits[at] == b->label[c];
            at++;
        }
    }
    CHECK(same && at == n_hits);
}

static void
near_boxes_are_listed(void)
{
    harness_random   random = {161803};
    const hs_kernel *kernel;
    for (int kn = 0; (kernel = kernel_number(kn)) != NULL; kn++) {
        for (int trial = 0; trial < 400; trial++) {
            const int32_t n = below(&random, trial % 2 ? 40 : 400), room = n + HS_PADDING;
            hs_boxes      b = {.ndim = 1 + trial % HS_MAX_DIM, .n = n};
            b.out = (float)below(&random, 200 * b.ndim);
            for (int k = 0; k < b.ndim; k++) {
                float *low = guarded_place(y_pages[k], room, sizeof *low, trial & 1);
                float *high = guarded_place(high_pages[k], room, sizeof *high, trial & 1);
                for (int32_t c = 0; c < room; c++) {
                    low[c] = (float)(below(&random, 60) - 30);
                    high[c] = low[c] + (float)below(&random, 5);
                }
                b.low[k] = low;
                b.high[k] = high;
                b.from[k] = (float)(below(&random, 20) - 10);
                b.to[k] = b.from[k] + (float)below(&random, 8);
            }
            int32_t *label = guarded_place(id_pages, room, sizeof *label, trial & 1);
            for (int32_t c = 0; c < room; c++) {
                label[c] = below(&random, 1 << 30);
            }
            b.label = label;
            b.hits = guarded_place(number_pages, room, sizeof *b.hits, trial & 1);
            check_boxes(&b, kernel->near_boxes(&b));
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
    RUN(relating_rounds_each_step);
    RUN(keys_ascend);
    RUN(near_boxes_are_listed);
}
