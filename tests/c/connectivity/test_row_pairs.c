/* SPDX-License-Identifier: BSD-3-Clause */
/* test_row_pairs.c: rows give the pairs that the half list gives, with their shifts. */
#include "../../../csrc/core/connectivity/connectivity.h"
#include "../../../csrc/core/connectivity/row_pairs.h"
#include "../support/node_scenes.h"
#include "../support/poll_checks.h"

void test_row_pairs(void);

static node_scene scene;
static double     limit = HUGE_VAL;

/* Rows of a connectivity, as given to another one. */
static hs_list_rows
rows_of(hs_connectivity *made, int32_t n_lists, int ndim)
{
    const hs_pairs *rows = hs_connectivity_rows(made);
    return (hs_list_rows){.n = n_lists > 0 ? hs_pairs_rows(rows) / n_lists : 0,
                          .n_lists = n_lists,
                          .offsets = hs_pairs_offsets(rows),
                          .n_indices = hs_pairs_length(rows),
                          .indices = hs_pairs_array(rows, HS_WANT_J),
                          .shift = hs_pairs_array(rows, HS_WANT_SHIFT),
                          .ndim = ndim};
}

static bool
same(const hs_pairs *one, const hs_pairs *other, int ndim)
{
    static const unsigned columns[] = {HS_WANT_I, HS_WANT_J, HS_WANT_SHIFT};
    bool                  right = hs_pairs_length(one) == hs_pairs_length(other);
    for (int c = 0; right && c < 3; c++) {
        const void  *a = hs_pairs_array(one, columns[c]), *b = hs_pairs_array(other, columns[c]);
        const size_t width = c < 2 ? 4 : 4 * (size_t)ndim;
        right = (a == NULL) == (b == NULL) &&
                (a == NULL || memcmp(a, b, (size_t)hs_pairs_length(one) * width) == 0);
    }
    return right;
}

/* Whether the pairs of a half list are those of its rows. */
static void
check_pairs(const hs_half_list *half, const hs_node_lists *lists)
{
    const hs_options options = hs_options_default();
    hs_connectivity *linked, *made;
    CHECK(hs_connectivity_link(half, lists, &options, &linked, NULL) == HS_OK);
    const hs_list_rows rows = rows_of(linked, lists->n_lists, half->ndim);
    CHECK(hs_connectivity_pair(&rows, lists, &options, &made, NULL) == HS_OK);
    CHECK(same(hs_connectivity_pairs(made), hs_connectivity_pairs(linked), half->ndim));
    CHECK(same(hs_connectivity_lists(made), hs_connectivity_lists(linked), half->ndim));
    hs_connectivity_free(made);
    hs_connectivity_free(linked);
}

static void
pairs_are_those_of_the_half_list(void)
{
    harness_random random = {61};
    for (int trial = 0; trial < TRIALS(300); trial++) {
        node_scene_fill(&random, false, &scene);
        const hs_half_list  half = node_half_of(&scene);
        const hs_node_lists lists = node_lists_of(&scene, false, true, trial & 1);
        check_pairs(&half, &lists);
    }
}

/* Up to three images of each pair, and of points with themselves. */
static void
images_keep_their_shifts(void)
{
    static int32_t i[NODE_PAIRS * 3], j[NODE_PAIRS * 3], shift[NODE_PAIRS * 6];
    harness_random random = {62};
    for (int trial = 0; trial < TRIALS(200); trial++) {
        int64_t n = 0;
        node_scene_fill(&random, false, &scene);
        for (int32_t p = 0; p < scene.n; p++) {
            for (int32_t q = p; q < scene.n; q++) {
                const int32_t own = p == q;
                for (int32_t s = 0; s < 3 && (own || scene.near[p][q]); s++) {
                    if (random_bits(&random) % 2 == 0)
                        continue;
                    i[n] = p;
                    j[n] = q;
                    shift[2 * n] = own ? s / 2 : s - 1;
                    shift[2 * n++ + 1] = own && s < 2 ? 1 + s : -s;
                }
            }
        }
        const hs_half_list  half = {n, i, j, shift, 2};
        const hs_node_lists lists = node_lists_of(&scene, false, true, trial & 1);
        check_pairs(&half, &lists);
    }
}

static void
what_are_no_rows_of_all_is_refused(void)
{
    static const int64_t counts[1] = {2}, good[3] = {0, 1, 2}, descending[3] = {1, 0, 2};
    static const int64_t late[3] = {0, 1, 3}, below[3] = {-1, 1, 2}, one_row[2] = {0, 2};
    static const int64_t ghosts[1] = {1};
    static const int32_t index[2] = {1, 0}, high[2] = {1, 5}, number[2] = {1, 0};
    const hs_options     options = hs_options_default();
    hs_node_lists        lists = {.n_lists = 1, .n_nodes = counts, .ghost_rows = true};
    hs_list_rows         rows = {2, 1, good, 2, index, NULL, 1};
    hs_connectivity     *made;
    CHECK(hs_connectivity_pair(&rows, &lists, &options, &made, NULL) == HS_OK);
    CHECK(hs_pairs_length(hs_connectivity_pairs(made)) == 1);
    hs_connectivity_free(made);
    const int64_t *const wrong[] = {descending, late, below};
    for (int k = 0; k < 3; k++) {
        rows.offsets = wrong[k];
        CHECK(hs_connectivity_pair(&rows, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
        CHECK(made == NULL);
    }
    rows.offsets = good;
    rows.indices = high; /* two pairs of two entries */
    CHECK(hs_connectivity_pair(&rows, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    lists.n_ghosts = counts; /* as pairs of two ghosts, and of a ghost and an internal node */
    lists.ghost_pairs = true;
    CHECK(hs_connectivity_pair(&rows, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    static const int64_t ends[7] = {0, 0, 1, 2, 2, 2, 2};
    static const int32_t zeros[2] = {0, 0};
    static const int64_t two_counts[2] = {2, 1}, two_ghosts[2] = {2, 0};
    const hs_node_lists  two = {
         .n_lists = 2, .n_nodes = two_counts, .n_ghosts = two_ghosts, .ghost_rows = true};
    const hs_list_rows turned = {3, 2, ends, 2, zeros, NULL, 1};
    CHECK(hs_connectivity_pair(&turned, &two, &options, &made, NULL) == HS_OK);
    hs_connectivity_free(made);
    static const int64_t more_ends[7] = {0, 0, 1, 1, 2, 2, 2};
    const hs_list_rows   unmatched = {3, 2, more_ends, 2, zeros, NULL, 1};
    CHECK(hs_connectivity_pair(&unmatched, &two, &options, &made, NULL) == HS_ERR_ARGUMENT);
    lists = (hs_node_lists){.n_lists = 1, .n_nodes = counts, .n_ghosts = ghosts};
    rows.indices = index;
    CHECK(hs_connectivity_pair(&rows, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    lists = (hs_node_lists){.n_lists = 1, .n_nodes = counts, .number = number};
    CHECK(hs_connectivity_pair(&rows, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    lists = (hs_node_lists){.n_lists = 1, .n_nodes = counts};
    const hs_list_rows few = {1, 1, one_row, 2, index, NULL, 1};
    CHECK(hs_connectivity_pair(&few, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    const hs_list_rows halves = {2, 2, ends, 2, index, NULL, 1};
    CHECK(hs_connectivity_pair(&halves, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    lists.n_nodes = good; /* no node */
    CHECK(hs_connectivity_pair(&rows, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
}

static hs_status
pair_scene(void *context)
{
    hs_connectivity *linked = context, *made = NULL;
    hs_options       options = hs_options_default();
    options.memory_limit = limit;
    const hs_list_rows  rows = rows_of(linked, scene.n_lists, 1);
    const hs_node_lists lists = node_lists_of(&scene, false, true, true);
    const hs_status     status = hs_connectivity_pair(&rows, &lists, &options, &made, NULL);
    CHECK((made != NULL) == (status == HS_OK));
    hs_connectivity_free(made);
    return status;
}

static void
failures_leave_nothing(void)
{
    enum { LONG = 1 << 21 };
    static int32_t       many[LONG];
    static const int64_t ends[3] = {0, LONG / 2, LONG}, counts[1] = {2};
    harness_random       random = {63};
    hs_options           options = hs_options_default();
    int64_t              left = 0;
    hs_connectivity     *linked, *made;
    do {
        node_scene_fill(&random, false, &scene);
    } while (scene.n_pairs < 20);
    const hs_half_list  half = node_half_of(&scene);
    const hs_node_lists of_scene = node_lists_of(&scene, false, true, true);
    CHECK(hs_connectivity_link(&half, &of_scene, &options, &linked, NULL) == HS_OK);
    CHECK(fail_each_allocation(pair_scene, linked, 100) > 5);
    check_arena(pair_scene, linked);
    CHECK(raise_memory_limit(pair_scene, linked, &limit) > 5);
    hs_connectivity_free(linked);
    for (int64_t e = 0; e < LONG / 2; e++)
        many[e] = 1;
    const hs_list_rows  rows = {2, 1, ends, LONG, many, NULL, 1};
    const hs_node_lists lists = {.n_lists = 1, .n_nodes = counts};
    options.poll = stop_after;
    options.poll_context = &left;
    CHECK(hs_connectivity_pair(&rows, &lists, &options, &made, NULL) == HS_ERR_INTERRUPTED);
    left = 1;
    CHECK(hs_connectivity_pair(&rows, &lists, &options, &made, NULL) == HS_OK && left == 0);
    CHECK(hs_pairs_length(hs_connectivity_pairs(made)) == LONG / 2);
    hs_connectivity_free(made);
}

void
test_row_pairs(void)
{
    RUN(pairs_are_those_of_the_half_list);
    RUN(images_keep_their_shifts);
    RUN(what_are_no_rows_of_all_is_refused);
    RUN(failures_leave_nothing);
}
