/* SPDX-License-Identifier: BSD-3-Clause */
/* test_bins_threads.c: points are sorted into the same order by any number of threads, with as much
 * memory as there is, until a poll says no. */
#include "../../../csrc/core/base/poll.h"
#include "../../../csrc/core/cells/bins.h"
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/threads/passes.h"
#include "../support/harness.h"

void test_bins_threads(void);

enum { MANY = 2 * HS_POLL_POINTS + 40000, FEW = 70000 }; /* FEW: of four strips */

typedef struct sorted {
    hs_account account;
    hs_options options;
    hs_scene   scene;
    hs_grid    grid;
    double    *x;
} sorted;

/* Points in [-1, 1)^ndim: some of them are outside the box, if there is one. */
static void
open_scene(int ndim, int64_t n, double cutoff, const hs_box *box, sorted *s)
{
    harness_random random = {4711};
    hs_failure     failure;
    s->x = malloc((size_t)(n * ndim) * sizeof *s->x);
    for (int64_t e = 0; e < n * ndim; e++)
        s->x[e] = 2.0 * random_unit(&random) - 1.0;
    const hs_points points = {.data = s->x,
                              .n = n,
                              .ndim = ndim,
                              .real = HS_FLOAT64,
                              .row_stride = ndim * (ptrdiff_t)sizeof(double),
                              .column_stride = sizeof(double)};
    s->options = hs_options_default();
    s->options.cutoff = cutoff;
    s->options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
    hs_account_init(&s->account, &s->options);
    CHECK(hs_scene_init(&s->account, NULL, &points, box, &s->options, &s->scene, &failure) ==
          HS_OK);
    CHECK(hs_grid_init(&s->scene, &s->grid, &failure) == HS_OK);
}

static void
close_scene(sorted *s)
{
    hs_scene_free(&s->account, &s->scene);
    CHECK(s->account.held == 0);
    hs_account_close(&s->account);
    free(s->x);
}

/* Sorts points of a scene of the same kind, in one go, by so many threads, while allocation nth
 * fails. Whether it was asked for. */
static bool
compare_order(double cutoff, int threads, int nth, const int32_t *expected, int *n_refused)
{
    sorted   s;
    hs_bins  bins;
    hs_team *team = hs_team_create(threads);
    open_scene(2, FEW, cutoff, NULL, &s);
    hs_test_fail_allocation(nth);
    const hs_status status = hs_bins_build(&s.account, team, &s.options, &s.scene, &s.grid, &bins);
    const bool      disturbed = nth > 0 && !hs_test_failure_is_due();
    hs_test_fail_allocation(0);
    CHECK(status == HS_OK || (disturbed && status == HS_ERR_MEMORY));
    *n_refused += status != HS_OK;
    if (status == HS_OK) {
        CHECK(memcmp(bins.order, expected, FEW * sizeof *expected) == 0);
        hs_bins_free(&s.account, &bins);
    }
    close_scene(&s);
    hs_team_free(team);
    return disturbed;
}

/* Few cells, and about as many as points: then threads do not count for themselves. */
static void
any_team_finds_the_same_order(void)
{
    static const double cutoffs[] = {0.02, 0.0001};
    for (int c = 0; c < 2; c++) {
        sorted  s;
        hs_bins bins;
        int     nth = 0, n_refused = 0;
        open_scene(2, FEW, cutoffs[c], NULL, &s);
        CHECK((s.grid.n_cells > FEW / 3) == (c == 1));
        CHECK(hs_bins_build(&s.account, NULL, &s.options, &s.scene, &s.grid, &bins) == HS_OK);
        for (int threads = 2; threads <= HS_SLABS + 1; threads += threads == 2 ? 2 : 29)
            (void)compare_order(cutoffs[c], threads, 0, bins.order, &n_refused);
        CHECK(n_refused == 0);
        while (compare_order(cutoffs[c], 2, ++nth, bins.order, &n_refused) && nth < 50) {
        }
        /* The second one, of a thread that counts for itself, is no need. */
        CHECK(nth == (c == 0 ? 3 : 2) && n_refused == 1);
        hs_bins_free(&s.account, &bins);
        close_scene(&s);
    }
}

typedef struct refusal {
    int64_t n, nth; /* polls so far; the only one that says no */
} refusal;

/* A hs_poll_fn. */
static bool
refuse_once(void *context, double fraction)
{
    refusal *once = context;
    (void)fraction;
    return ++once->n != once->nth;
}

/* Points with turns, and with originals beside them. */
static void
any_poll_ends_it(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {0.3, 1.0}}};
    hs_status    status = HS_ERR_INTERRUPTED;
    int64_t      nth = 0;
    while (status != HS_OK && nth < 100) {
        refusal once = {.nth = ++nth};
        sorted  s;
        hs_bins bins;
        open_scene(2, MANY, 0.01, &box, &s);
        CHECK(s.scene.keeps_originals && s.scene.turns.known);
        s.options.poll = refuse_once;
        s.options.poll_context = &once;
        status = hs_bins_build(&s.account, NULL, &s.options, &s.scene, &s.grid, &bins);
        CHECK(status == (once.n == nth ? HS_ERR_INTERRUPTED : HS_OK));
        if (status == HS_OK)
            hs_bins_free(&s.account, &bins);
        close_scene(&s);
    }
    CHECK(nth > 10 && nth < 100);
}

void
test_bins_threads(void)
{
    RUN(any_team_finds_the_same_order);
    RUN(any_poll_ends_it);
}
