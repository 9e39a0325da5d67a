/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_clusters.c: clusters are what the pairs of hs_pairs_find say, core points or not, for any
 * number of threads; what else there is to ignore or to refuse. */
#include "../../../csrc/core/collect/components.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/among.h"
#include "../support/block_checks.h"
#include "../support/random_scenes.h"

void test_api_clusters(void);

enum { MOST = SCENE_POINTS };

typedef struct found {
    int64_t labels[MOST], n;
    uint8_t winding[MOST];
} found;

/* From a whole list of pairs. */
static void
from_pairs(const hs_pairs *pairs, const brute_scene *scene, const uint8_t *core, found *f)
{
    const int64_t *i = hs_pairs_array(pairs, HS_WANT_I), *j = hs_pairs_array(pairs, HS_WANT_J);
    const int32_t *S = hs_pairs_array(pairs, HS_WANT_SHIFT);
    hs_components  c;
    CHECK(hs_components_open(NULL, scene->n, scene->ndim, &c) == HS_OK);
    for (int64_t e = 0; e < hs_pairs_length(pairs); e++) {
        if (core == NULL || (core[i[e]] && core[j[e]])) {
            hs_components_join(&c, (int32_t)i[e], (int32_t)j[e], S + e * scene->ndim);
        }
    }
    f->n = hs_components_label(&c, core, f->labels, f->winding);
    hs_components_close(NULL, &c);
    for (int64_t e = 0; core != NULL && e < hs_pairs_length(pairs); e++) {
        const int64_t in = core[i[e]] ? i[e] : j[e], out = core[i[e]] ? j[e] : i[e];
        if (core[in] && !core[out] && (f->labels[out] < 0 || f->labels[in] < f->labels[out])) {
            f->labels[out] = f->labels[in];
        }
    }
}

static void
compare(const brute_scene *scene, const uint8_t *core, int threads)
{
    static found    wanted, got;
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    hs_pairs       *pairs = NULL;
    hs_counters     counters;
    options.want = WANT_ALL;
    options.threads = threads;
    CHECK(hs_pairs_find(AMONG(&points, scene->box), &options, &pairs, NULL) == HS_OK);
    from_pairs(pairs, scene, core, &wanted);
    options.want = ~0u; /* ignored, as the next two */
    options.index_bytes = 3;
    options.sorted = true;
    options.counters = &counters;
    CHECK(hs_clusters_find(AMONG(&points, scene->box), &options, core, got.labels, got.winding,
                           &got.n, NULL) == HS_OK);
    CHECK(got.n == wanted.n && counters.pairs == hs_pairs_length(pairs));
    CHECK(memcmp(got.labels, wanted.labels, (size_t)scene->n * 8) == 0);
    CHECK(memcmp(got.winding, wanted.winding, (size_t)got.n) == 0);
    CHECK(hs_clusters_find(AMONG(&points, scene->box), &options, core, got.labels, NULL, &got.n,
                           NULL) == HS_OK);
    CHECK(got.n == wanted.n && memcmp(got.labels, wanted.labels, (size_t)scene->n * 8) == 0);
    hs_pairs_free(pairs);
}

static void
clusters_are_those_of_the_pairs(void)
{
    harness_random      random = {20261125};
    static random_scene s;
    for (int trial = 0; trial < 240; trial++) {
        const int ndim = 1 + trial / SCENE_KINDS % 4;
        const int n = random_below(&random, ndim <= 3 ? 50 : 10);
        uint8_t   core[64];
        make_scene(&random, trial % SCENE_KINDS, ndim, n, 4.0, 0, &s);
        for (int p = 0; p < n; p++) {
            core[p] = (uint8_t)(random_below(&random, 3) * 100);
        }
        compare(&s.scene, trial % 2 ? core : NULL, 1 + trial % 3);
    }
}

static void
without_points_there_are_none(void)
{
    const hs_points  points = {.ndim = 3, .real = HS_FLOAT64};
    const hs_options options = hs_options_default();
    const uint8_t    core = 1;
    int64_t          n = -7;
    CHECK(hs_clusters_find(AMONG(&points, NULL), &options, &core, NULL, NULL, &n, NULL) == HS_OK);
    CHECK(n == 0);
}

/* What points take beyond the search is within the limit, and what is left is the search's. */
static void
memory_is_limited(void)
{
    enum { MANY = 1000 };
    static double   x[MANY];
    static int64_t  labels[MANY];
    static uint8_t  winding[MANY];
    const hs_points points = {
        .data = x, .n = MANY, .ndim = 1, .real = HS_FLOAT64, .row_stride = 8, .column_stride = 8};
    const hs_box box = {.ndim = 1, .periodic = {true}, .rows = {{2.0 * MANY}}};
    hs_options   options = hs_options_default();
    hs_failure   failure;
    int64_t      n = -7;
    for (int p = 0; p < MANY; p++) {
        x[p] = p;
    }
    options.cutoff = 1.0;
    options.memory_limit = 3000.0; /* less than 4 bytes a point */
    CHECK(hs_clusters_find(AMONG(&points, &box), &options, NULL, labels, winding, &n, &failure) ==
          HS_ERR_MEMORY);
    CHECK(n == -7 && failure.limit_bytes == 3000.0);
    options.memory_limit = 12000.0; /* 9 bytes a point, and nothing for the search */
    CHECK(hs_clusters_find(AMONG(&points, &box), &options, NULL, labels, winding, &n, &failure) ==
          HS_ERR_MEMORY);
    CHECK(n == -7 && failure.limit_bytes == 12000.0);
    options.memory_limit = 4e6;
    CHECK(hs_clusters_find(AMONG(&points, &box), &options, NULL, labels, winding, &n, &failure) ==
          HS_OK);
    CHECK(n == 1 && winding[0] == 0);
}

/* Counts polls, and stops at one of them. */
typedef struct counted {
    int polls, stop_at;
} counted;

static bool
count_polls(void *context, double fraction)
{
    counted *c = context;
    (void)fraction;
    return ++c->polls != c->stop_at;
}

static void
either_search_may_be_stopped(void)
{
    enum { MANY = 20000 };
    double         *x = array_of(MANY, sizeof *x);
    uint8_t        *core = array_of(MANY, 1);
    int64_t        *labels = array_of(MANY, sizeof *labels);
    const hs_points points = {
        .data = x, .n = MANY, .ndim = 1, .real = HS_FLOAT64, .row_stride = 8, .column_stride = 8};
    counted    c = {0};
    hs_options options = hs_options_default();
    int64_t    n = -7;
    for (int p = 0; p < MANY; p++) {
        x[p] = p;
        core[p] = 1;
    }
    options.cutoff = 600.0;
    options.poll = count_polls;
    options.poll_context = &c;
    CHECK(hs_clusters_find(AMONG(&points, NULL), &options, core, labels, NULL, &n, NULL) == HS_OK);
    CHECK(n == 1 && c.polls > 0);
    const int of_first = c.polls;
    core[0] = 0; /* there is a second search now */
    for (int part = 0; part < 2; part++) {
        c = (counted){.stop_at = part * of_first + 1};
        n = -7;
        CHECK(hs_clusters_find(AMONG(&points, NULL), &options, core, labels, NULL, &n, NULL) ==
              HS_ERR_INTERRUPTED);
        CHECK(n == -7 && c.polls == c.stop_at);
    }
    free(labels);
    free(core);
    free(x);
}

void
test_api_clusters(void)
{
    RUN(clusters_are_those_of_the_pairs);
    RUN(without_points_there_are_none);
    RUN(memory_is_limited);
    RUN(either_search_may_be_stopped);
}
