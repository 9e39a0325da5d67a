/* SPDX-License-Identifier: BSD-3-Clause */
/* test_components.c: components are those of a graph that is walked through, and wind where a walk
 * through it comes back to another image of where it began. */
#include "../../../csrc/core/collect/components.h"
#include "../support/harness.h"

void test_components(void);

enum { N = 40, MOST = 120, AXES = 3 };

typedef struct edge {
    int32_t i, j, shift[AXES];
} edge;

static int
below(harness_random *random, int n)
{
    return (int)(random_unit(random) * n);
}

/* What a walk from each point finds: labels, and which axes each component winds along. */
typedef struct walked {
    int64_t label[N], n;
    uint8_t winds[N];
} walked;

/* One step along an edge from p, in the direction of its shift or against it. */
static bool
go_along(const edge *e, int32_t p, bool back, int32_t image[N][AXES], walked *w, int64_t label)
{
    const int32_t from = back ? e->j : e->i, to = back ? e->i : e->j;
    bool          is_new = w->label[to] < 0;
    if (from != p) {
        return false;
    }
    w->label[to] = label;
    for (int l = 0; l < AXES; l++) {
        const int32_t there = image[p][l] + (back ? -e->shift[l] : e->shift[l]);
        if (is_new) {
            image[to][l] = there;
        } else if (image[to][l] != there) {
            w->winds[label] |= (uint8_t)(1 << l);
        }
    }
    return is_new;
}

static void
walk(const edge *edges, int n_edges, walked *w)
{
    int32_t image[N][AXES] = {{0}}, stack[N];
    w->n = 0;
    memset(w->winds, 0, sizeof w->winds);
    for (int p = 0; p < N; p++) {
        w->label[p] = -1;
    }
    for (int32_t start = 0; start < N; start++) {
        int held = 0;
        if (w->label[start] < 0) {
            w->label[start] = w->n++;
            stack[held++] = start;
        }
        while (held > 0) {
            const int32_t p = stack[--held];
            for (int e = 0; e < 2 * n_edges; e++) {
                const edge *along = &edges[e / 2];
                if (go_along(along, p, e % 2, image, w, w->label[p])) {
                    stack[held++] = e % 2 ? along->i : along->j;
                }
            }
        }
    }
}

static void
components_are_those_of_a_walk(void)
{
    harness_random random = {20261124};
    for (int trial = 0; trial < TRIALS(600); trial++) {
        edge          edges[MOST];
        walked        w;
        hs_components c;
        int64_t       labels[N];
        uint8_t       winding[N];
        const int     n_edges = below(&random, trial % 2 ? MOST : N);
        const int     n_axes = trial % 3 ? AXES : 0;
        for (int e = 0; e < n_edges; e++) {
            edges[e].i = below(&random, N);
            edges[e].j = below(&random, N);
            for (int l = 0; l < AXES; l++) { /* of points that are any number of boxes away */
                edges[e].shift[l] = trial % 5 ? 7 * (edges[e].j - edges[e].i) : 0;
                edges[e].shift[l] += below(&random, 40) == 0 ? below(&random, 3) - 1 : 0;
            }
        }
        walk(edges, n_edges, &w);
        CHECK(hs_components_open(NULL, N, n_axes, &c) == HS_OK);
        for (int e = 0; e < n_edges; e++) {
            hs_components_join(&c, edges[e].i, edges[e].j, n_axes > 0 ? edges[e].shift : NULL);
        }
        CHECK(hs_components_label(&c, NULL, labels, winding) == w.n);
        CHECK(memcmp(labels, w.label, sizeof labels) == 0);
        for (int64_t k = 0; k < w.n; k++) {
            CHECK(winding[k] == (n_axes > 0 ? w.winds[k] : 0));
        }
        CHECK(hs_components_label(&c, NULL, labels, NULL) == w.n);
        hs_components_close(NULL, &c);
        hs_components_close(NULL, &c);
    }
}

static void
points_that_do_not_count_have_none(void)
{
    const uint8_t counts[5] = {0, 1, 1, 0, 1};
    int64_t       labels[5];
    hs_components c;
    CHECK(hs_components_open(NULL, 5, 0, &c) == HS_OK);
    hs_components_join(&c, 4, 1, NULL);
    CHECK(hs_components_label(&c, counts, labels, NULL) == 2);
    const int64_t wanted[5] = {-1, 0, 1, -1, 0};
    CHECK(memcmp(labels, wanted, sizeof labels) == 0);
    hs_components_close(NULL, &c);
    CHECK(hs_components_open(NULL, 0, 2, &c) == HS_OK);
    CHECK(hs_components_label(&c, NULL, labels, NULL) == 0);
    hs_components_close(NULL, &c);
}

/* A sum of shifts may pass what int32 holds: 2^31 - 1 there and back is no winding. */
static void
shifts_add_up_beyond_their_type(void)
{
    const int32_t far = INT32_MAX, home = 0;
    int64_t       labels[4];
    uint8_t       winding[4];
    hs_components c;
    CHECK(hs_components_open(NULL, 4, 1, &c) == HS_OK);
    hs_components_join(&c, 0, 1, &far);
    hs_components_join(&c, 1, 2, &far);
    hs_components_join(&c, 3, 2, &far);
    hs_components_join(&c, 0, 3, &far);
    CHECK(hs_components_label(&c, NULL, labels, winding) == 1 && winding[0] == 0);
    hs_components_join(&c, 0, 3, &home);
    CHECK(hs_components_label(&c, NULL, labels, winding) == 1 && winding[0] == 1);
    hs_components_close(NULL, &c);
}

static void
memory_may_be_refused(void)
{
    hs_components c;
    for (int nth = 1; nth <= 3; nth++) {
        hs_test_fail_allocation(nth);
        CHECK(hs_components_open(NULL, 9, 2, &c) == HS_ERR_MEMORY && c.parent == NULL);
    }
    hs_test_fail_allocation(1);
    CHECK(hs_components_open(NULL, 9, 0, &c) == HS_ERR_MEMORY);
    hs_test_fail_allocation(0);
}

void
test_components(void)
{
    RUN(components_are_those_of_a_walk);
    RUN(points_that_do_not_count_have_none);
    RUN(shifts_add_up_beyond_their_type);
    RUN(memory_may_be_refused);
}
