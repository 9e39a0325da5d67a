/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_nearest_kernels.c: what every kernel of this CPU does for the nearest points, between guard
 * pages: gathering candidates, putting squares in order, listing boxes.
 */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include <math.h>

#include "../support/kernel_checks.h"

void test_nearest_kernels(void);

enum { N_POINTS = 300, MOST_RUNS = 60, ROOM = 4096 };

static guarded double_pages[HS_MAX_DIM], float_pages[2][HS_MAX_DIM], norm_pages, integer_pages[2];

static void
guard_all(void)
{
    for (int k = 0; k < HS_MAX_DIM; k++) {
        double_pages[k] = guarded_pages((N_POINTS + HS_PADDING) * sizeof(double));
        float_pages[0][k] = guarded_pages((ROOM + HS_PADDING) * sizeof(float));
        float_pages[1][k] = guarded_pages((ROOM + HS_PADDING) * sizeof(float));
    }
    norm_pages = guarded_pages((ROOM + HS_PADDING) * sizeof(float));
    integer_pages[0] = guarded_pages((ROOM + HS_PADDING) * sizeof(int32_t));
    integer_pages[1] = guarded_pages((ROOM + HS_PADDING) * sizeof(int32_t));
}

static int32_t
below(harness_random *random, int32_t n)
{
    return (int32_t)(random_bits(random) % (unsigned)n);
}

/* ---- gather_relative ---- */

/* Runs of one of two images; returns how many, *n: candidates. */
static int32_t
make_runs(harness_random *random, int32_t n_points, hs_nearest_run *runs, int32_t *n)
{
    const int32_t wanted = 1 + below(random, MOST_RUNS);
    int32_t       r = 0;
    *n = 0;
    for (; r < wanted; r++) {
        const int32_t si = below(random, n_points);
        const int32_t points = 1 + below(random, n_points - si);
        if (*n + points > ROOM) {
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
        double sum = 0.0;
        for (int k = 0; k < g->ndim; k++) {
            const volatile double z = g->x[k][run->si + c] + g->images[run->image].moved[k];
            const volatile double apart = z - g->centre[k];
            const volatile float  y = (float)(apart * g->unit);
            const float           most = (float)g->extent;
            const float           found = g->y[k][run->at + c];
            same = same && found == (y > most ? most : y < -most ? -most : y);
            sum += (double)found * (double)found;
        }
        const double error = fabs((double)g->norm[run->at + c] - sum);
        same = same && error <= g->ndim * 0x1.1p-24 * sum + g->ndim * 0x1p-149;
        same = same && g->number[run->at + c] == run->si + c;
    }
    CHECK(same);
}

static void
relating_rounds_each_step(void)
{
    hs_nearest_run   runs[MOST_RUNS];
    harness_random   random = {271828};
    const hs_kernel *kernel;
    for (int kn = 0; (kernel = kernel_number(kn)) != NULL; kn++) {
        for (int trial = 0; trial < 200; trial++) {
            const int32_t    n_points = 1 + below(&random, trial % 3 ? 20 : N_POINTS);
            int32_t          n;
            const int32_t    n_runs = make_runs(&random, n_points, runs, &n);
            hs_nearest_image images[2] = {{.is_home = true}, {.is_home = false}};
            hs_relative_keys g = {.ndim = 1 + trial % HS_MAX_DIM,
                                  .images = images,
                                  .unit = ldexp(1.0, below(&random, 40) - 20),
                                  .extent = 1.0 + random_unit(&random)};
            g.extent = ldexp(g.extent, below(&random, 40) - 20);
            for (int k = 0; k < g.ndim; k++) {
                double *x =
                    guarded_place(double_pages[k], n_points + HS_PADDING, sizeof *x, trial & 1);
                for (int32_t si = 0; si < n_points + HS_PADDING; si++) {
                    x[si] = si < n_points ? 2.0 * random_unit(&random) - 1.0 : 1e300;
                }
                g.x[k] = x;
                g.y[k] = guarded_place(float_pages[0][k], n + HS_PADDING, sizeof(float), trial & 1);
                images[1].moved[k] = 2.0 * random_unit(&random) - 1.0;
                g.centre[k] = random_unit(&random);
            }
            g.norm = guarded_place(norm_pages, n + HS_PADDING, sizeof(float), trial & 1);
            g.number = guarded_place(integer_pages[0], n + HS_PADDING, sizeof(int32_t), trial & 1);
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
            float        *s = guarded_place(norm_pages, n + HS_PADDING, sizeof *s, trial & 1);
            int32_t      *keys = guarded_place(integer_pages[0], n, sizeof *keys, trial & 1);
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
                float *low = guarded_place(float_pages[0][k], room, sizeof *low, trial & 1);
                float *high = guarded_place(float_pages[1][k], room, sizeof *high, trial & 1);
                for (int32_t c = 0; c < room; c++) {
                    low[c] = (float)(below(&random, 60) - 30);
                    high[c] = low[c] + (float)below(&random, 5);
                }
                b.low[k] = low;
                b.high[k] = high;
                b.from[k] = (float)(below(&random, 20) - 10);
                b.to[k] = b.from[k] + (float)below(&random, 8);
            }
            int32_t *label = guarded_place(integer_pages[0], room, sizeof *label, trial & 1);
            for (int32_t c = 0; c < room; c++) {
                label[c] = below(&random, 1 << 30);
            }
            b.label = label;
            b.hits = guarded_place(integer_pages[1], room, sizeof *b.hits, trial & 1);
            check_boxes(&b, kernel->near_boxes(&b));
        }
    }
}

void
test_nearest_kernels(void)
{
    guard_all();
    RUN(relating_rounds_each_step);
    RUN(keys_ascend);
    RUN(near_boxes_are_listed);
}
