/* SPDX-License-Identifier: BSD-3-Clause */
/* test_kept_pairs.c: a table has the pairs that stay, in its order and with their shifts. */
#include "../../../csrc/core/connectivity/connectivity.h"
#include "../../../csrc/core/connectivity/kept_pairs.h"
#include "../support/node_scenes.h"
#include "../support/poll_checks.h"

void test_kept_pairs(void);

static node_scene scene;
static int32_t    i_node[NODE_PAIRS], i_list[NODE_PAIRS], j_node[NODE_PAIRS], j_list[NODE_PAIRS];
static int32_t    shift[2 * NODE_PAIRS], target[NODE_POINTS];
static bool       keep[NODE_PAIRS];
static double     limit = HUGE_VAL;

static hs_node_pairs
pairs_given(bool has_shift)
{
    for (int64_t e = 0; e < scene.n_pairs; e++) {
        i_node[e] = scene.node[scene.i[e]];
        i_list[e] = scene.list[scene.i[e]];
        j_node[e] = scene.node[scene.j[e]];
        j_list[e] = scene.list[scene.j[e]];
        shift[2 * e] = (int32_t)e;
        shift[2 * e + 1] = INT32_MIN;
    }
    return (hs_node_pairs){.n = scene.n_pairs,
                           .i_node = i_node,
                           .i_list = i_list,
                           .j_node = j_node,
                           .j_list = j_list,
                           .shift = has_shift ? shift : NULL,
                           .ndim = 2};
}

static hs_node_change
change_given(void)
{
    return (hs_node_change){.n_lists = scene.n_lists, .n_nodes = scene.n_nodes, .target = target};
}

static void
fill(harness_random *random)
{
    node_scene_fill(random, true, &scene);
    for (int32_t p = 0; p < scene.n; p++)
        target[p] = random_bits(random) % 3 > 0 ? (int32_t)(random_bits(random) % 1000) : -1;
    for (int64_t e = 0; e < scene.n_pairs; e++)
        keep[e] = random_bits(random) % 2 > 0;
}

static int32_t
target_of(int32_t point, bool has_change)
{
    return has_change ? target[scene.number[point]] : scene.node[point];
}

static void
pairs_stay_with_both_of_their_nodes(void)
{
    harness_random   random = {51};
    const hs_options options = hs_options_default();
    for (int trial = 0; trial < TRIALS(200); trial++) {
        const bool has_shift = trial & 1, has_change = trial & 2, has_keep = trial & 4;
        fill(&random);
        const hs_node_pairs  pairs = pairs_given(has_shift);
        const hs_node_change change = change_given();
        hs_connectivity     *made;
        CHECK(hs_node_pairs_keep(&pairs, has_change ? &change : NULL, has_keep ? keep : NULL,
                                 &options, &made, NULL) == HS_OK);
        const hs_pairs *nodes = hs_connectivity_pairs(made), *lists = hs_connectivity_lists(made);
        const int32_t  *i = hs_pairs_array(nodes, HS_WANT_I), *j = hs_pairs_array(nodes, HS_WANT_J);
        const int32_t  *a = hs_pairs_array(lists, HS_WANT_I), *b = hs_pairs_array(lists, HS_WANT_J);
        const int32_t  *s = hs_pairs_array(nodes, HS_WANT_SHIFT);
        int64_t         n = 0;
        CHECK((s != NULL) == has_shift && hs_pairs_rows(hs_connectivity_rows(made)) == 0);
        for (int64_t e = 0; e < scene.n_pairs; e++) {
            const int32_t p = target_of(scene.i[e], has_change);
            const int32_t q = target_of(scene.j[e], has_change);
            if (p < 0 || q < 0 || (has_keep && !keep[e]))
                continue;
            CHECK(n < hs_pairs_length(nodes) && i[n] == p && j[n] == q);
            CHECK(a[n] == i_list[e] && b[n] == j_list[e]);
            CHECK(s == NULL || (s[2 * n] == e && s[2 * n + 1] == INT32_MIN));
            n++;
        }
        CHECK(n == hs_pairs_length(nodes) && n == hs_pairs_length(lists));
        hs_connectivity_free(made);
    }
}

static void
what_are_no_pairs_is_refused(void)
{
    static const int32_t zero[1] = {0}, one[1] = {1}, below[1] = {-1};
    static const int64_t count[1] = {1}, negative[1] = {-1};
    const hs_options     options = hs_options_default();
    const hs_node_change change = {1, count, zero, NULL};
    hs_connectivity     *made;
    const hs_node_pairs  wrong[] = {
         {-1, zero, zero, zero, zero, NULL, 1},
         {1, NULL, zero, zero, zero, NULL, 1},
         {1, zero, NULL, zero, zero, NULL, 1},
         {1, zero, zero, NULL, zero, NULL, 1},
         {1, zero, zero, zero, NULL, NULL, 1},
         {1, zero, zero, zero, zero, zero, 0},
         {1, zero, zero, zero, zero, zero, HS_MAX_DIM + 1},
         {1, one, zero, zero, zero, NULL, 1},
         {1, below, zero, zero, zero, NULL, 1},
         {1, zero, one, zero, zero, NULL, 1},
         {1, zero, below, zero, zero, NULL, 1},
         {1, zero, zero, one, zero, NULL, 1},
    };
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        CHECK(hs_node_pairs_keep(&wrong[k], &change, NULL, &options, &made, NULL) ==
              HS_ERR_ARGUMENT);
        CHECK(made == NULL);
    }
    const hs_node_pairs  none = {0, NULL, NULL, NULL, NULL, NULL, 1};
    const hs_node_change bad[] = {{-1, count, zero, NULL},
                                  {1, NULL, zero, NULL},
                                  {1, count, NULL, NULL},
                                  {1, negative, zero, NULL}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++)
        CHECK(hs_node_pairs_keep(&none, &bad[k], NULL, &options, &made, NULL) == HS_ERR_ARGUMENT);
    const hs_node_change empty = {0, NULL, NULL, NULL};
    CHECK(hs_node_pairs_keep(&none, &empty, NULL, &options, &made, NULL) == HS_OK);
    hs_connectivity_free(made);
}

/* Pairs that keep both nodes and are kept themselves. */
static int64_t
count_kept(void)
{
    int64_t n = 0;
    for (int64_t e = 0; e < scene.n_pairs; e++)
        n += keep[e] && target_of(scene.i[e], true) >= 0 && target_of(scene.j[e], true) >= 0;
    return n;
}

static hs_status
keep_once(void *context)
{
    const hs_node_pairs  pairs = pairs_given(true);
    const hs_node_change change = change_given();
    hs_options           options = hs_options_default();
    hs_connectivity     *made = NULL;
    (void)context;
    options.memory_limit = limit;
    const hs_status status = hs_node_pairs_keep(&pairs, &change, keep, &options, &made, NULL);
    CHECK((made != NULL) == (status == HS_OK));
    if (status == HS_OK) {
        const int64_t n = count_kept();
        CHECK(n > 0 && n < scene.n_pairs);
        CHECK(hs_pairs_length(hs_connectivity_pairs(made)) == n);
    }
    hs_connectivity_free(made);
    return status;
}

static void
failures_leave_nothing(void)
{
    enum { LONG = 1 << 20 };
    static int32_t      many[LONG];
    const hs_node_pairs pairs = {LONG, many, many, many, many, NULL, 1};
    harness_random      random = {52};
    hs_options          options = hs_options_default();
    int64_t             left = 0;
    hs_connectivity    *made;
    do {
        fill(&random);
    } while (scene.n_pairs < 20);
    CHECK(fail_each_allocation(keep_once, NULL, 100) > 5);
    check_arena(keep_once, NULL);
    CHECK(raise_memory_limit(keep_once, NULL, &limit) > 5);
    options.poll = stop_after;
    options.poll_context = &left;
    CHECK(hs_node_pairs_keep(&pairs, NULL, NULL, &options, &made, NULL) == HS_ERR_INTERRUPTED);
    left = 1;
    CHECK(hs_node_pairs_keep(&pairs, NULL, NULL, &options, &made, NULL) == HS_OK && left == 0);
    hs_connectivity_free(made);
}

void
test_kept_pairs(void)
{
    RUN(pairs_stay_with_both_of_their_nodes);
    RUN(what_are_no_pairs_is_refused);
    RUN(failures_leave_nothing);
}
