/* SPDX-License-Identifier: BSD-3-Clause */
/* test_connectivity.c: lists of nodes and the pairs between them: half lists, rows, and what is
 * kept of them. */
#include "../../../csrc/core/connectivity/connectivity.h"
#include "../support/among.h"
#include "../support/node_scenes.h"
#include "../support/poll_checks.h"

void test_connectivity(void);

/* Node map: each point is the node that its number says, and what is no map is refused. */

static node_scene scene;

static hs_status
make(const hs_node_lists *lists, int64_t n, hs_node_map *map)
{
    hs_account       account;
    const hs_options options = hs_options_default();
    hs_account_init(&account, &options);
    const hs_status status = hs_node_map_make(&account, lists, n, map);
    if (status == HS_OK) {
        for (int32_t p = 0; p < scene.n; p++) {
            const int64_t row =
                node_rows_before(&scene, scene.list[p], lists->ghost_rows) + scene.node[p];
            const bool has_row = lists->ghost_rows || !scene.is_ghost[p];
            CHECK(map->list[p] == scene.list[p] && map->node[p] == scene.node[p]);
            CHECK(map->is_ghost[p] == scene.is_ghost[p]);
            CHECK(map->row[p] == (has_row ? row : -1));
        }
        CHECK(map->n_rows == node_rows_before(&scene, scene.n_lists, lists->ghost_rows));
    }
    hs_node_map_free(&account, map);
    hs_node_map_free(&account, map);
    CHECK(account.held == 0);
    hs_account_close(&account);
    return status;
}

static void
what_is_no_map_is_refused(void)
{
    hs_node_map         map;
    const int64_t       counts[2] = {2, 1}, too_many[2] = {2, 2}, ghosts[2] = {3, 0};
    const int64_t       negative[2] = {-1, 4};
    const int32_t       twice[3] = {0, 1, 1}, outside[3] = {0, 1, 3}, below[3] = {0, -1, 2};
    const hs_node_lists wrong[] = {
        {.n_lists = -1},
        {.n_lists = 2},
        {.n_lists = 1, .n_nodes = counts},
        {.n_lists = 2, .n_nodes = too_many},
        {.n_lists = 2, .n_nodes = negative},
        {.n_lists = 2, .n_nodes = counts, .n_ghosts = ghosts},
        {.n_lists = 2, .n_nodes = counts, .n_ghosts = negative},
        {.n_lists = 2, .n_nodes = counts, .number = twice},
        {.n_lists = 2, .n_nodes = counts, .number = outside},
        {.n_lists = 2, .n_nodes = counts, .number = below},
    };
    scene.n = 0;
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++)
        CHECK(make(&wrong[k], 3, &map) == HS_ERR_ARGUMENT);
    CHECK(hs_node_map_make(NULL, NULL, 0, &map) == HS_ERR_ARGUMENT);
}

/* Half lists, and directed ones, of which pairs may be turned and are both there: they are copied as
 * they are, or the first pair that is wrong is named. */

static void
what_is_no_list_is_refused(void)
{
    static const int32_t i[4] = {0, 0, 1, 2}, j[4] = {1, 3, 2, 3}, turned[4] = {0, 3, 1, 2};
    static const int32_t unsorted[4] = {0, 1, 0, 2}, below[4] = {-1, 0, 1, 2}, twice[4] = {1, 1};
    static const int32_t lower[4] = {1, 0, 2, 3}, falling[4] = {3, 1, 2, 3}, far[4] = {0, 4, 5, 6};
    static const int32_t a[4] = {0, 0, 0, 1}, b[4] = {0, 1, 1, 1}; /* in images, by their shifts */
    static const int32_t good[8] = {0, 1, -1, 4, -1, 5, 2, -7};
    static const int32_t equal[8] = {0, 1, -1, 4, -1, 4, 2, -7};
    static const int32_t back[8] = {0, 1, -1, 4, -1, 3, 2, -7};
    static const int32_t self[8] = {0, 0, -1, 4, -1, 5, 2, -7};
    static const int32_t behind[8] = {0, 1, -1, 4, -1, 5, -2, 7};
    static const int32_t from[4] = {0, 1, 1, 1}, to[4] = {1, 0, 1, 1}, shift[4] = {3, -3, -2, 2};
    static const int32_t zero[4] = {3, -3, 0, 2}, one_way[4] = {3, 3, 2, 1};
    static const struct {
        hs_half_list list;
        int64_t      n_points, row; /* -1: none is wrong */
        bool         directed;
    } cases[] = {
        {{4, i, j, NULL, 0}, 4, -1, false},      {{4, i, j, NULL, 0}, 3, 1, false},
        {{4, turned, j, NULL, 0}, 4, 1, false},  {{4, unsorted, j, NULL, 0}, 4, 2, false},
        {{4, i, falling, NULL, 0}, 4, 1, false}, {{4, unsorted, lower, NULL, 0}, 4, 1, false},
        {{4, below, j, NULL, 0}, 4, 0, false},   {{2, i, twice, NULL, 0}, 4, 1, false},
        {{4, i, below, NULL, 0}, 4, 0, false},   {{4, far, j, NULL, 0}, 4, 1, false},
        {{4, a, b, good, 2}, 2, -1, false},      {{4, a, b, equal, 2}, 2, 2, false},
        {{4, a, b, back, 2}, 2, 2, false},       {{4, a, b, self, 2}, 2, 0, false},
        {{4, a, b, behind, 2}, 2, 3, false},     {{4, a, b, NULL, 2}, 2, 0, false},
        {{4, from, to, shift, 1}, 2, -1, true},  {{4, from, to, zero, 1}, 2, 2, true},
        {{4, from, to, one_way, 1}, 2, 3, true}, {{4, from, to, NULL, 1}, 2, 2, true},
        {{4, from, to, shift, 1}, 1, 0, true},
    };
    hs_output copy;
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const hs_half_list *list = &cases[k].list;
        hs_failure          failure = {.row = -1};
        const hs_status     status =
            hs_half_list_copy(NULL, list, cases[k].n_points, cases[k].directed, &copy, &failure);
        CHECK(status == (cases[k].row < 0 ? HS_OK : HS_ERR_ARGUMENT));
        CHECK(failure.row == cases[k].row);
        if (status == HS_OK) {
            const hs_half_list columns = hs_half_list_columns(&copy);
            const size_t       bytes = (size_t)list->n * sizeof(int32_t);
            CHECK(columns.n == list->n && (columns.shift != NULL) == (list->shift != NULL));
            CHECK(memcmp(columns.i, list->i, bytes) == 0 && memcmp(columns.j, list->j, bytes) == 0);
            CHECK(list->shift == NULL ||
                  memcmp(columns.shift, list->shift, bytes * (size_t)list->ndim) == 0);
        }
        hs_output_free(&copy);
    }
    const hs_half_list wrong[] = {
        {.n = -1, .i = i, .j = j},
        {.n = 1, .j = j},
        {.n = 1, .i = i},
        {.n = 1, .i = i, .j = j, .shift = j, .ndim = 0},
        {.n = 1, .i = i, .j = j, .shift = j, .ndim = HS_MAX_DIM + 1},
    };
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        CHECK(hs_half_list_copy(NULL, &wrong[k], 4, false, &copy, NULL) == HS_ERR_ARGUMENT);
        hs_output_free(&copy);
    }
    hs_account account;
    hs_options options = hs_options_default();
    options.memory_limit = 1.0;
    hs_account_init(&account, &options);
    CHECK(hs_half_list_copy(&account, &cases[0].list, 4, false, &copy, NULL) == HS_ERR_MEMORY);
    hs_output_free(&copy);
    hs_account_close(&account);
}

/* Pairs of rows: of all nodes or of those that are no ghosts, in any order, with and without
 * images, both ways or one: what a link made beside the rows. */

static int32_t i_images[4 * NODE_PAIRS], j_images[4 * NODE_PAIRS], s_images[4 * NODE_PAIRS];

/* Pairs of a matrix, of which some have several images, and some points one of their own. */
static hs_half_list
images_of(harness_random *random, bool directed, bool has_shift)
{
    int64_t n = 0;
    for (int32_t i = 0; i < scene.n; i++) {
        for (int32_t j = directed ? 0 : i; j < scene.n; j++) {
            const bool    is_near = i == j ? has_shift : scene.near[i][j];
            const int32_t first = directed || i != j ? -1 : 1;
            for (int32_t s = first; is_near && s <= (has_shift ? 2 : first); s++) {
                if ((i == j && s == 0) || random_unit(random) < 0.5)
                    continue;
                i_images[n] = i;
                j_images[n] = j;
                s_images[n++] = s;
            }
        }
    }
    return (hs_half_list){
        .n = n, .i = i_images, .j = j_images, .shift = has_shift ? s_images : NULL, .ndim = 1};
}

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

static void
pairs_of_rows_are_those_of_links(void)
{
    harness_random random = {71};
    int64_t        n = 0;
    for (int trial = 0; trial < TRIALS(320); trial++) {
        const bool shuffled = trial & 1, ghost_rows = trial & 2, has_shift = trial & 4;
        const bool ghost_pairs = ghost_rows && (trial & 8), directed = trial & 16;
        node_scene_fill(&random, shuffled, &scene);
        const hs_half_list half = images_of(&random, directed, has_shift);
        hs_node_lists      lists = node_lists_of(&scene, shuffled, ghost_rows, ghost_pairs);
        const hs_options   options = hs_options_default();
        hs_connectivity   *made, *paired;
        lists.directed = directed;
        CHECK(hs_connectivity_link(&half, &lists, &options, &made, NULL) == HS_OK);
        const hs_list_rows rows = rows_of(made, scene.n_lists, 1);
        CHECK(hs_connectivity_pair(&rows, &lists, &options, &paired, NULL) == HS_OK);
        CHECK(same(hs_connectivity_pairs(made), hs_connectivity_pairs(paired), 1));
        CHECK(same(hs_connectivity_lists(made), hs_connectivity_lists(paired), 1));
        CHECK(!directed || !ghost_pairs ||
              (rows.n_indices == half.n && hs_pairs_length(hs_connectivity_pairs(made)) == half.n));
        n += hs_pairs_length(hs_connectivity_pairs(made));
        hs_connectivity_free(made);
        hs_connectivity_free(paired);
    }
    CHECK(n > TRIALS(320) * 50);
}

/* One internal node and one ghost, in rows of the first alone. */
static hs_status
pair_with_a_ghost(void *context)
{
    static const int64_t counts[2] = {1, 1}, ghosts[2] = {1, 0}, offsets[3] = {0, 2, 2};
    static const int32_t indices[2] = {0, 0}, images[2] = {-4, 3};
    const hs_node_lists  lists = {.n_lists = 2, .n_nodes = counts, .n_ghosts = ghosts};
    const hs_list_rows   rows = {1, 2, offsets, 2, indices, images, 1};
    hs_options           options = hs_options_default();
    hs_connectivity     *made;
    options.memory_limit = *(double *)context;
    const hs_status status = hs_connectivity_pair(&rows, &lists, &options, &made, NULL);
    if (status == HS_OK) {
        const hs_pairs *pairs = hs_connectivity_pairs(made), *of = hs_connectivity_lists(made);
        const int32_t  *s = hs_pairs_array(pairs, HS_WANT_SHIFT);
        CHECK(hs_pairs_length(pairs) == 2 && s[0] == 3 && s[1] == -4); /* by those of the ghost */
        CHECK(((const int32_t *)hs_pairs_array(of, HS_WANT_I))[0] == 1);
    }
    CHECK((made != NULL) == (status == HS_OK));
    hs_connectivity_free(made);
    return status;
}

static void
pairs_of_rows_that_are_none_are_refused(void)
{
    static const int64_t counts[1] = {2}, good[3] = {0, 1, 2};
    static const int64_t low[3] = {-1, 1, 2}, back[3] = {0, 2, 1}, far[3] = {0, 1, 3};
    static const int32_t number[2] = {1, 0}, indices[3] = {1, 0, 0}, none[2] = {-1, 0};
    static const int32_t beyond[2] = {2, 0}, own[2] = {0, 1};
    const hs_node_lists  lists = {
         .n_lists = 1, .n_nodes = counts, .number = number, .ghost_rows = true};
    const hs_list_rows wrong[] = {
        {2, 1, low, 2, indices, NULL, 1},  {2, 1, back, 2, indices, NULL, 1},
        {2, 1, far, 2, indices, NULL, 1},  {2, 1, good, 2, none, NULL, 1},
        {2, 1, good, 2, beyond, NULL, 1},  {1, 1, good, 2, indices, NULL, 1},
        {2, 2, good, 2, indices, NULL, 1},
    };
    const hs_list_rows selves = {2, 1, good, 2, own, NULL, 1};
    const hs_options   options = hs_options_default();
    hs_connectivity   *made;
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++)
        CHECK(hs_connectivity_pair(&wrong[k], &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_pair(&selves, &lists, &options, &made, NULL) == HS_OK);
    CHECK(hs_pairs_length(hs_connectivity_pairs(made)) == 0); /* which are no pairs without S */
    hs_connectivity_free(made);
    double limit_of_pairs = HUGE_VAL;
    CHECK(pair_with_a_ghost(&limit_of_pairs) == HS_OK);
    CHECK(fail_each_allocation(pair_with_a_ghost, &limit_of_pairs, 200) > 8);
    check_arena(pair_with_a_ghost, &limit_of_pairs);
    CHECK(raise_memory_limit(pair_with_a_ghost, &limit_of_pairs, &limit_of_pairs) > 5);
}

/* Node rows: rows and pairs of many pairs ask the caller, and leave nothing when they end early. */

enum { MANY = 1500, MANY_PAIRS = MANY * (MANY - 1) / 2 };

static int32_t i_node_rows[MANY_PAIRS], j_node_rows[MANY_PAIRS];
static double  limit = HUGE_VAL;

static hs_status
link_many(int64_t polls, bool rows_only, hs_connectivity **made)
{
    static const int64_t counts[2] = {MANY - 1, 1};
    const hs_half_list   half = {.n = MANY_PAIRS, .i = i_node_rows, .j = j_node_rows};
    const hs_node_lists  lists = {.n_lists = 2, .n_nodes = counts, .rows_only = rows_only};
    hs_options           options = hs_options_default();
    options.poll = stop_after;
    options.poll_context = &polls;
    return hs_connectivity_link(&half, &lists, &options, made, NULL);
}

static void
many_pairs_ask_the_caller(void)
{
    hs_connectivity *made;
    int64_t          e = 0;
    for (int32_t a = 0; a < MANY; a++) {
        for (int32_t b = a + 1; b < MANY; b++) {
            i_node_rows[e] = a;
            j_node_rows[e++] = b;
        }
    }
    for (int64_t polls = 0; polls < 8; polls++) {
        CHECK(link_many(polls, false, &made) == HS_ERR_INTERRUPTED);
        CHECK(made == NULL);
    }
    for (int rows_only = 0; rows_only < 2; rows_only++) {
        CHECK(link_many(1000, rows_only, &made) == HS_OK);
        CHECK(hs_pairs_length(hs_connectivity_rows(made)) == 2 * (int64_t)MANY_PAIRS);
        CHECK(hs_pairs_length(hs_connectivity_pairs(made)) == (rows_only ? 0 : MANY_PAIRS));
        const int64_t *offsets = hs_pairs_offsets(hs_connectivity_rows(made));
        for (int32_t row = 0; row < MANY; row++)
            CHECK(offsets[2 * row + 1] - offsets[2 * row] == MANY - 1 - (row < MANY - 1));
        hs_connectivity_free(made);
    }
}

static hs_status
link_scene(void *context)
{
    const hs_half_list  half = node_half_of(&scene);
    const hs_node_lists lists = node_lists_of(&scene, true, true, true);
    hs_options          options = hs_options_default();
    hs_connectivity    *made = NULL;
    (void)context;
    options.memory_limit = limit;
    const hs_status status = hs_connectivity_link(&half, &lists, &options, &made, NULL);
    CHECK((made != NULL) == (status == HS_OK));
    hs_connectivity_free(made);
    return status;
}

static void
no_limit_of_memory_leaves_anything(void)
{
    harness_random random = {31};
    do {
        node_scene_fill(&random, true, &scene);
    } while (scene.n_pairs < 40);
    CHECK(raise_memory_limit(link_scene, NULL, &limit) > 10);
}

/* Row pairs: rows give the pairs that the half list gives, with their shifts. */

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
    static const int64_t two[1] = {2}, one[1] = {1}, none[1] = {0}, three[2] = {2, 1};
    static const int64_t ghosts[2] = {2, 0}, good[3] = {0, 1, 2}, descending[3] = {1, 0, 2};
    static const int64_t late[3] = {0, 1, 3}, below[3] = {-1, 1, 2}, one_row[2] = {0, 2};
    static const int64_t ends[7] = {0, 0, 1, 2, 2, 2, 2}, more_ends[7] = {0, 0, 1, 1, 2, 2, 2};
    static const int32_t index[2] = {1, 0}, high[2] = {1, 5}, zeros[2] = {0, 0};
    const hs_node_lists  all = {.n_lists = 1, .n_nodes = two, .ghost_rows = true};
    const hs_node_lists  with_pairs = {
         .n_lists = 1, .n_nodes = two, .n_ghosts = two, .ghost_rows = true, .ghost_pairs = true};
    const hs_node_lists of_two = {
        .n_lists = 2, .n_nodes = three, .n_ghosts = ghosts, .ghost_rows = true};
    const hs_node_lists half = {.n_lists = 1, .n_nodes = two, .n_ghosts = one};
    const hs_node_lists plain = {.n_lists = 1, .n_nodes = two};
    const hs_node_lists empty = {.n_lists = 1, .n_nodes = none};
    const struct {
        hs_list_rows         rows;
        const hs_node_lists *lists;
        int64_t              n_pairs; /* -1: they are refused */
    } cases[] = {
        {{2, 1, good, 2, index, NULL, 1}, &all, 1},
        {{2, 1, descending, 2, index, NULL, 1}, &all, -1},
        {{2, 1, late, 2, index, NULL, 1}, &all, -1},
        {{2, 1, below, 2, index, NULL, 1}, &all, -1},
        {{2, 1, good, 2, high, NULL, 1}, &all, -1},        /* two pairs of two entries */
        {{2, 1, good, 2, high, NULL, 1}, &with_pairs, -1}, /* and of ghosts */
        {{3, 2, ends, 2, zeros, NULL, 1}, &of_two, 1},
        {{3, 2, more_ends, 2, zeros, NULL, 1}, &of_two, -1},
        {{2, 1, good, 2, index, NULL, 1}, &half, -1},
        {{1, 1, one_row, 2, index, NULL, 1}, &plain, -1},
        {{2, 2, ends, 2, index, NULL, 1}, &plain, -1},
        {{2, 1, good, 2, index, NULL, 1}, &empty, -1},
    };
    const hs_options options = hs_options_default();
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        hs_connectivity *made;
        const hs_status  status =
            hs_connectivity_pair(&cases[k].rows, cases[k].lists, &options, &made, NULL);
        CHECK(status == (cases[k].n_pairs < 0 ? HS_ERR_ARGUMENT : HS_OK));
        CHECK(made == NULL ? cases[k].n_pairs < 0
                           : hs_pairs_length(hs_connectivity_pairs(made)) == cases[k].n_pairs);
        hs_connectivity_free(made);
    }
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

/* Connectivity: rows and pairs of a half list are those of its matrix. */

static void
shifts_are_opposite_in_the_other_row(void)
{
    static const int32_t i[4] = {0, 0, 0, 1}, j[4] = {0, 1, 1, 1};
    static const int32_t shift[8] = {0, 1, -1, 4, 3, 5, 2, -7};
    static const int32_t of_rows[] = {0,  -1, 0, 1,  -1, 4, 3, 5, /* node 0: itself twice, 1 */
                                      -3, -5, 1, -4, -2, 7, 2, -7};
    static const int32_t of_pairs[] = {0, 1, 1, -4, -3, -5, 2, -7}; /* node 0 is a ghost */
    static const int64_t counts[1] = {2}, two_lists[2] = {1, 1}, ghosts[2] = {1, 0};
    const hs_half_list   half = {.n = 4, .i = i, .j = j, .shift = shift, .ndim = 2};
    hs_node_lists        lists = {.n_lists = 1, .n_nodes = counts};
    const hs_options     options = hs_options_default();
    hs_connectivity     *made;
    hs_failure           failure;
    CHECK(hs_connectivity_link(&half, &lists, &options, &made, NULL) == HS_OK);
    const hs_pairs *rows = hs_connectivity_rows(made);
    CHECK(hs_pairs_length(rows) == 8 && hs_pairs_rows(rows) == 2);
    CHECK(memcmp(hs_pairs_array(rows, HS_WANT_SHIFT), of_rows, sizeof of_rows) == 0);
    hs_connectivity_free(made);
    lists = (hs_node_lists){
        .n_lists = 2, .n_nodes = two_lists, .n_ghosts = ghosts, .ghost_pairs = true};
    CHECK(hs_connectivity_link(&half, &lists, &options, &made, NULL) == HS_OK);
    const hs_pairs *pairs = hs_connectivity_pairs(made);
    CHECK(hs_pairs_length(pairs) == 4);
    CHECK(memcmp(hs_pairs_array(pairs, HS_WANT_SHIFT), of_pairs, sizeof of_pairs) == 0);
    hs_connectivity_free(made);
    static const int32_t least[2] = {0, INT32_MIN};
    static const int32_t zero[1] = {0}, one[1] = {1};
    const hs_half_list   far = {.n = 1, .i = zero, .j = one, .shift = least, .ndim = 2};
    CHECK(hs_connectivity_link(&far, &lists, &options, &made, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(made == NULL && failure.row == 1);
    /* Three axes: the nodes of a pair exchange their numbers. */
    static const int32_t turn[3] = {3, -2, 1}, both[6] = {-3, 2, -1, 3, -2, 1};
    static const int32_t exchanged[2] = {1, 0};
    static const int64_t two[1] = {2}, from[2] = {1, 0};
    const hs_half_list   one_pair = {.n = 1, .i = zero, .j = one, .shift = turn, .ndim = 3};
    lists = (hs_node_lists){.n_lists = 1, .n_nodes = two};
    CHECK(hs_connectivity_link(&one_pair, &lists, &options, &made, NULL) == HS_OK);
    const hs_list_rows   given = rows_of(made, 1, 3);
    const hs_node_change change = {.n_lists = 1, .n_nodes = two, .target = exchanged};
    hs_pairs            *kept;
    CHECK(hs_rows_keep(&given, &change, from, 2, &options, &kept, NULL) == HS_OK);
    CHECK(hs_pairs_length(kept) == 2);
    CHECK(memcmp(hs_pairs_array(kept, HS_WANT_SHIFT), both, sizeof both) == 0);
    hs_pairs_free(kept);
    hs_connectivity_free(made);
}

/* One list, or rows alone, of all points or of those that are no ghosts. */
static void
searches_give_what_links_give(void)
{
    static const int64_t all[1] = {60}, ghosts[1] = {20}, none[1] = {0}, two[2] = {40, 20};
    static double        x[120];
    static int32_t       number[60];
    harness_random       random = {44};
    hs_options           options = hs_options_default();
    const hs_points      points = {x, 60, 2, HS_FLOAT64, 2 * sizeof *x, sizeof *x};
    const hs_among       among = {.points = SET(&points)};
    const hs_node_lists  kinds[] = {
         {.n_lists = 1, .n_nodes = all, .n_ghosts = none},
         {.n_lists = 1, .n_nodes = all, .n_ghosts = ghosts},
         {.n_lists = 1, .n_nodes = all, .n_ghosts = ghosts, .ghost_rows = true},
         {.n_lists = 1, .n_nodes = all, .number = number},
         {.n_lists = 2, .n_nodes = two},
         {.n_lists = 2, .n_nodes = two, .n_ghosts = two, .ghost_rows = true},
    };
    for (int k = 0; k < 120; k++)
        x[k] = random_unit(&random);
    for (int32_t p = 0; p < 60; p++)
        number[p] = 59 - p;
    options.cutoff = 0.2;
    options.index_bytes = 4;
    options.sorted = true;
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        hs_pairs        *pairs;
        hs_connectivity *linked, *built;
        CHECK(hs_pairs_find(&among, &options, &pairs, NULL) == HS_OK);
        const hs_half_list half = {.n = hs_pairs_length(pairs),
                                   .i = hs_pairs_array(pairs, HS_WANT_I),
                                   .j = hs_pairs_array(pairs, HS_WANT_J)};
        for (int rows_only = 0; rows_only < 2; rows_only++) {
            hs_node_lists lists = kinds[k];
            lists.rows_only = rows_only;
            CHECK(hs_connectivity_link(&half, &lists, &options, &linked, NULL) == HS_OK);
            CHECK(hs_connectivity_build(&among, &lists, &options, &built, NULL) == HS_OK);
            const hs_pairs *one = hs_connectivity_rows(linked),
                           *other = hs_connectivity_rows(built);
            const int64_t n = hs_pairs_length(one);
            CHECK(hs_pairs_rows(one) == hs_pairs_rows(other) && n == hs_pairs_length(other));
            CHECK(memcmp(hs_pairs_offsets(one), hs_pairs_offsets(other),
                         (size_t)(hs_pairs_rows(one) + 1) * 8) == 0);
            CHECK(memcmp(hs_pairs_array(one, HS_WANT_J), hs_pairs_array(other, HS_WANT_J),
                         (size_t)n * 4) == 0);
            one = hs_connectivity_pairs(linked);
            other = hs_connectivity_pairs(built);
            CHECK(hs_pairs_length(one) == hs_pairs_length(other));
            CHECK(rows_only ||
                  memcmp(hs_pairs_array(one, HS_WANT_I), hs_pairs_array(other, HS_WANT_I),
                         (size_t)hs_pairs_length(one) * 4) == 0);
            hs_connectivity_free(linked);
            hs_connectivity_free(built);
        }
        hs_pairs_free(pairs);
    }
}

/* Of a search that had all the memory it wanted. */
static hs_status
fill_found(void *context)
{
    static double        x[60];
    static const int64_t counts[2] = {20, 10};
    harness_random       random = {45};
    hs_options           options = hs_options_default();
    const hs_points      points = {x, 30, 2, HS_FLOAT64, 2 * sizeof *x, sizeof *x};
    const hs_among       among = {.points = SET(&points)};
    const hs_node_lists  lists = {.n_lists = 2, .n_nodes = counts, .n_ghosts = context};
    hs_pairs            *found = NULL;
    hs_connectivity     *made = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *made);
    hs_node_map          map;
    hs_output            half = {.n_pairs = 0};
    for (int k = 0; k < 60; k++)
        x[k] = random_unit(&random);
    options.cutoff = 0.4;
    options.want = HS_WANT_J;
    options.index_bytes = 4;
    CHECK(hs_neighbors_find(&among, &options, &found, NULL) == HS_OK);
    options.memory_limit = limit;
    memset(made, 0, sizeof *made);
    (void)hs_call_enter(&options, NULL, &made->rows.call);
    hs_status status = hs_node_map_make(&made->rows.call.account, &lists, 30, &map);
    if (status == HS_OK)
        status = hs_connectivity_fill(made, &map, &half, &found->offsets, &found->output);
    hs_output_free(&half);
    hs_node_map_free(&made->rows.call.account, &map);
    hs_call_leave(&made->rows.call, 0);
    hs_connectivity_free(made);
    hs_pairs_free(found);
    return status;
}

static void
rows_that_are_found_may_be_too_many(void)
{
    static int64_t ghosts[2] = {5, 3};
    CHECK(raise_memory_limit(fill_found, NULL, &limit) > 5);
    CHECK(raise_memory_limit(fill_found, ghosts, &limit) > 5);
    const hs_points     points = {NULL, 0, 2, HS_FLOAT64, 16, 8};
    const hs_among      among = {.points = SET(&points)};
    const hs_node_lists none = {.n_lists = 0};
    hs_options          options = hs_options_default();
    hs_connectivity    *made;
    options.cutoff = 1.0;
    CHECK(hs_connectivity_build(&among, &none, &options, &made, NULL) == HS_OK);
    CHECK(hs_pairs_length(hs_connectivity_pairs(made)) == 0);
    CHECK(hs_pairs_rows(hs_connectivity_rows(made)) == 0);
    hs_connectivity_free(made);
}

static void
no_allocation_that_fails_leaves_anything(void)
{
    harness_random random = {9};
    node_scene_fill(&random, true, &scene);
    CHECK(fail_each_allocation(link_scene, NULL, 200) > 5);
    check_arena(link_scene, NULL);
    hs_connectivity_free(NULL);
    CHECK(hs_connectivity_rows(NULL) == NULL && hs_connectivity_pairs(NULL) == NULL);
    CHECK(hs_connectivity_lists(NULL) == NULL);
}

/* Kept rows: rows without nodes, in their order or in another, and without entries. */

enum { ROWS = NODE_POINTS * NODE_LISTS + 1 };
static int64_t offsets_kept_rows[ROWS], fewer_offsets[ROWS], source[NODE_POINTS];
static int32_t indices[2 * NODE_PAIRS], fewer_indices[2 * NODE_PAIRS];
static int32_t shift_kept_rows[4 * NODE_PAIRS], fewer_shift[4 * NODE_PAIRS];
static int32_t target[NODE_POINTS], place[NODE_POINTS];
static bool    gone[NODE_POINTS][NODE_POINTS];

static hs_list_rows
rows_given(bool has_shift)
{
    const int64_t n =
        node_rows_fill(&scene, scene.near, offsets_kept_rows, indices, shift_kept_rows);
    return (hs_list_rows){.n = scene.n_lists > 0 ? scene.n : 0,
                          .n_lists = scene.n_lists,
                          .offsets = offsets_kept_rows,
                          .n_indices = n,
                          .indices = indices,
                          .shift = has_shift ? shift_kept_rows : NULL,
                          .ndim = 2};
}

/* Numbers from 0 on in a random order. */
static void
shuffle(harness_random *random, int32_t *numbers, int32_t n)
{
    for (int32_t k = 0; k < n; k++) {
        const int32_t other = (int32_t)(random_bits(random) % (uint64_t)(k + 1));
        numbers[k] = numbers[other];
        numbers[other] = k;
    }
}

/* New numbers of some nodes of each list, and which rows these have. Returns how many. */
static int64_t
choose(harness_random *random, bool in_order)
{
    int64_t n_rows = 0, first = 0;
    for (int32_t l = 0; l < scene.n_lists; l++) {
        int32_t numbers[NODE_POINTS], kept = 0;
        for (int64_t k = 0; k < scene.n_nodes[l]; k++) {
            target[first + k] = random_bits(random) % 3 > 0 ? kept : -1;
            kept += target[first + k] >= 0;
        }
        shuffle(random, numbers, kept);
        for (int64_t k = 0; k < scene.n_nodes[l]; k++) {
            int32_t *own = &target[first + k];
            *own = *own < 0 || in_order ? *own : numbers[*own];
            if (*own >= 0)
                source[n_rows + *own] = first + k;
        }
        n_rows += kept;
        first += scene.n_nodes[l];
    }
    shuffle(random, place, scene.n);
    return n_rows;
}

static hs_node_change
change_given(bool in_order)
{
    return (hs_node_change){.n_lists = scene.n_lists,
                            .n_nodes = scene.n_nodes,
                            .target = target,
                            .place = in_order ? NULL : place};
}

/* Whether entries of one row and list are what stays of entries [first, last), whose nodes begin at
 * `base`. */
static bool
entry_is(const hs_pairs *kept, int64_t at, int64_t end, int64_t first, int64_t last, int64_t base,
         bool in_order)
{
    const int32_t *index = hs_pairs_array(kept, HS_WANT_J);
    const int32_t *moved = hs_pairs_array(kept, HS_WANT_SHIFT);
    int64_t        n = 0;
    bool           right = true;
    for (int64_t e = first; e < last; e++) {
        int64_t before = n; /* how many of those that stay come before this one */
        if (target[base + indices[e]] < 0)
            continue;
        if (!in_order) {
            before = 0;
            for (int64_t other = first; other < last; other++)
                before += target[base + indices[other]] >= 0 &&
                          place[base + indices[other]] < place[base + indices[e]];
        }
        right = right && at + before < end && index[at + before] == target[base + indices[e]] &&
                (moved == NULL ||
                 (moved[2 * (at + before)] == e && moved[2 * (at + before) + 1] == -3));
        n++;
    }
    return right && at + n == end;
}

static hs_status
keep(const hs_list_rows *rows, const hs_node_change *change, int64_t n, hs_pairs **kept)
{
    hs_options options = hs_options_default();
    options.memory_limit = limit;
    return hs_rows_keep(rows, change, source, n, &options, kept, NULL);
}

static void
rows_have_the_nodes_that_stay(void)
{
    harness_random random = {77};
    for (int trial = 0; trial < TRIALS(300); trial++) {
        const bool in_order = trial & 1, has_shift = trial & 2;
        hs_pairs  *kept;
        node_scene_fill(&random, trial & 4, &scene);
        const int64_t        n = choose(&random, in_order);
        const hs_list_rows   rows = rows_given(has_shift);
        const hs_node_change change = change_given(in_order);
        CHECK(keep(&rows, &change, n, &kept) == HS_OK);
        const int64_t *ends = hs_pairs_offsets(kept);
        CHECK(hs_pairs_rows(kept) == n * scene.n_lists);
        CHECK((hs_pairs_array(kept, HS_WANT_SHIFT) != NULL) == has_shift);
        for (int64_t k = 0; k < n; k++) {
            int64_t base = 0;
            for (int32_t l = 0; l < scene.n_lists; l++) {
                const int64_t e = k * scene.n_lists + l, old = source[k] * scene.n_lists + l;
                CHECK(entry_is(kept, ends[e], ends[e + 1], offsets_kept_rows[old],
                               offsets_kept_rows[old + 1], base, in_order));
                base += scene.n_nodes[l];
            }
        }
        CHECK(hs_pairs_length(kept) == ends[n * scene.n_lists]);
        hs_pairs_free(kept);
    }
}

/* ---- entries that go ----------------------------------------------------------------------- */

/* Some of the entries, or pairs that are none besides; with those of `rows`, whose shifts are the
 * numbers of their entries. */
static hs_list_rows
fewer_given(harness_random *random, const hs_list_rows *rows, bool with_others)
{
    static bool has[NODE_POINTS][NODE_POINTS];
    int64_t     at = 0;
    memset(has, 0, sizeof has);
    memset(gone, 0, sizeof gone);
    for (int32_t p = 0; p < scene.n; p++) {
        for (int32_t q = 0; q < scene.n; q++) {
            gone[p][q] = scene.near[p][q] && random_bits(random) % 3 == 0;
            has[p][q] = gone[p][q] || (with_others && random_bits(random) % 4 == 0);
        }
    }
    if (with_others || rows->shift == NULL) {
        at = node_rows_fill(&scene, has, fewer_offsets, fewer_indices, NULL);
    } else { /* every third entry, with its shift */
        for (int64_t k = 0; k < rows->n * rows->n_lists; k++) {
            fewer_offsets[k] = at;
            for (int64_t e = offsets_kept_rows[k]; e < offsets_kept_rows[k + 1]; e++) {
                if (e % 3 == 0) {
                    fewer_indices[at] = indices[e];
                    fewer_shift[2 * at] = shift_kept_rows[2 * e];
                    fewer_shift[2 * at++ + 1] = shift_kept_rows[2 * e + 1];
                }
            }
        }
        fewer_offsets[rows->n * rows->n_lists] = at;
    }
    hs_list_rows fewer = *rows;
    fewer.offsets = fewer_offsets;
    fewer.indices = fewer_indices;
    fewer.n_indices = at;
    fewer.shift = rows->shift != NULL ? fewer_shift : NULL;
    return fewer;
}

static void
rows_lose_the_entries_that_go(void)
{
    static bool      left[NODE_POINTS][NODE_POINTS];
    harness_random   random = {79};
    const hs_options options = hs_options_default();
    for (int trial = 0; trial < TRIALS(300); trial++) {
        const bool shuffled = trial & 1, ascend = !shuffled, with_others = ascend && trial & 2;
        hs_pairs  *kept;
        node_scene_fill(&random, shuffled, &scene);
        const hs_list_rows rows = rows_given(false);
        const hs_list_rows fewer = fewer_given(&random, &rows, with_others);
        CHECK(hs_rows_without(&rows, &fewer, ascend, &options, &kept, NULL) == HS_OK);
        for (int32_t p = 0; p < scene.n; p++) {
            for (int32_t q = 0; q < scene.n; q++)
                left[p][q] = scene.near[p][q] && !gone[p][q];
        }
        if (with_others) { /* what was added is in the rows now and then */
            for (int32_t p = 0; p < scene.n; p++) {
                const int64_t row = node_rows_before(&scene, scene.list[p], true) + scene.node[p];
                for (int32_t q = 0; q < scene.n; q++) {
                    const int64_t entry = row * scene.n_lists + scene.list[q];
                    for (int64_t e = fewer_offsets[entry]; e < fewer_offsets[entry + 1]; e++)
                        left[p][q] = left[p][q] && fewer_indices[e] != scene.node[q];
                }
            }
        }
        CHECK(node_rows_are(&scene, true, left, hs_pairs_offsets(kept),
                            hs_pairs_array(kept, HS_WANT_J)));
        hs_pairs_free(kept);
    }
}

static void
images_go_by_their_shifts(void)
{
    static const int64_t ends[2] = {0, 5}, fewer_ends[2] = {0, 2}, other_ends[2] = {0, 3};
    static const int64_t one_end[2] = {0, 1};
    static const int32_t node[5] = {0, 0, 1, 1, 1};
    static const int32_t images[10] = {0, -1, 0, 1, -2, 0, 0, 0, 0, 3};
    static const int32_t some[2] = {0, 1}, of_some[4] = {0, 1, 0, 0};
    static const int32_t more[3] = {0, 1, 1}, of_more[6] = {0, 0, -2, 0, 0, 9};
    const hs_list_rows   rows = {1, 1, ends, 5, node, images, 2};
    hs_list_rows         fewer = {1, 1, fewer_ends, 2, some, of_some, 2};
    const hs_options     options = hs_options_default();
    hs_pairs            *kept;
    for (int ascend = 0; ascend < 2; ascend++) {
        static const int32_t left[6] = {0, -1, -2, 0, 0, 3};
        CHECK(hs_rows_without(&rows, &fewer, ascend, &options, &kept, NULL) == HS_OK);
        CHECK(hs_pairs_length(kept) == 3);
        CHECK(memcmp(hs_pairs_array(kept, HS_WANT_SHIFT), left, sizeof left) == 0);
        hs_pairs_free(kept);
    }
    fewer = (hs_list_rows){1, 1, other_ends, 3, more, of_more, 2};
    CHECK(hs_rows_without(&rows, &fewer, true, &options, &kept, NULL) == HS_OK);
    CHECK(hs_pairs_length(kept) == 4); /* two of these three are no entries */
    hs_pairs_free(kept);
    fewer = (hs_list_rows){1, 1, one_end, 1, more, of_more, 2}; /* before some, and none itself */
    CHECK(hs_rows_without(&rows, &fewer, true, &options, &kept, NULL) == HS_OK);
    CHECK(hs_pairs_length(kept) == 5);
    hs_pairs_free(kept);
    fewer = (hs_list_rows){1, 1, other_ends, 3, more, of_more, 2};
    CHECK(hs_rows_without(&rows, &fewer, false, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    harness_random random = {80};
    node_scene_fill(&random, false, &scene);
    const hs_list_rows all = rows_given(true), third = fewer_given(&random, &all, false);
    CHECK(hs_rows_without(&all, &third, true, &options, &kept, NULL) == HS_OK);
    CHECK(hs_pairs_length(kept) == all.n_indices - third.n_indices && third.n_indices > 0);
    const int32_t *own = hs_pairs_array(kept, HS_WANT_SHIFT);
    for (int64_t e = 0; e < hs_pairs_length(kept); e++)
        CHECK(own[2 * e] % 3 != 0 && own[2 * e + 1] == -3);
    hs_pairs_free(kept);
}

/* ---- what is refused ----------------------------------------------------------------------- */

static void
what_are_no_rows_is_refused(void)
{
    static const int64_t good[5] = {0, 1, 1, 2, 2}, descending[5] = {0, 1, 0, 2, 2};
    static const int64_t late[5] = {0, 1, 1, 2, 3}, below[5] = {-1, 1, 1, 2, 2};
    static const int64_t huge[5] = {0, INT64_C(1) << 33, INT64_C(1) << 33, INT64_C(1) << 33,
                                    INT64_C(1) << 33};
    static const int32_t one[3] = {0, 0, 0}, far[2] = {1, 0}, negative[2] = {-1, 0};
    static const int64_t counts[2] = {1, 1}, short_of[2] = {-1, 1};
    const hs_options     options = hs_options_default();
    const hs_list_rows   rows = {2, 2, good, 2, one, NULL, 1};
    hs_pairs            *kept;
    for (int order = 0; order < 2; order++) {
        static const int32_t same[2] = {0, 0}, places[2] = {0, 1};
        hs_node_change       change = {2, counts, same, order ? places : NULL};
        static const int64_t first[3] = {0, 1, 0}, outside[1] = {2}, before[1] = {-1};
        const hs_list_rows   wrong[] = {
              {-1, 2, good, 2, one, NULL, 1},
              {2, -1, good, 2, one, NULL, 1},
              {2, 2, NULL, 2, one, NULL, 1},
              {2, 2, good, -1, one, NULL, 1},
              {2, 2, good, 2, NULL, NULL, 1},
              {2, 2, good, 2, one, one, 0},
              {2, 2, good, 2, one, one, HS_MAX_DIM + 1},
              {2, 2, descending, 2, one, NULL, 1},
              {2, 2, late, 2, one, NULL, 1},
              {2, 2, below, 2, one, NULL, 1},
              {2, 2, good, 2, far, NULL, 1},
              {2, 2, good, 2, negative, NULL, 1},
        };
        for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
            CHECK(hs_rows_keep(&wrong[k], &change, NULL, 2, &options, &kept, NULL) ==
                  HS_ERR_ARGUMENT);
            CHECK(kept == NULL);
            if (k < 10) {
                CHECK(hs_rows_without(&wrong[k], &rows, true, &options, &kept, NULL) ==
                      HS_ERR_ARGUMENT);
                CHECK(hs_rows_without(&rows, &wrong[k], true, &options, &kept, NULL) ==
                      HS_ERR_ARGUMENT);
            }
        }
        CHECK(hs_rows_keep(&rows, &change, first, 2, &options, &kept, NULL) == HS_OK);
        hs_pairs_free(kept);
        CHECK(hs_rows_keep(&rows, &change, first, 3, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_rows_keep(&rows, &change, first, -1, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_rows_keep(&rows, &change, outside, 1, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_rows_keep(&rows, &change, before, 1, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        change.n_nodes = short_of;
        CHECK(hs_rows_keep(&rows, &change, NULL, 2, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        change.n_nodes = NULL;
        CHECK(hs_rows_keep(&rows, &change, NULL, 2, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        change = (hs_node_change){2, counts, NULL, NULL};
        CHECK(hs_rows_keep(&rows, &change, NULL, 2, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        change = (hs_node_change){1, counts, same, NULL};
        CHECK(hs_rows_keep(&rows, &change, NULL, 2, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        change = (hs_node_change){2, counts, same, places};
        const hs_list_rows long_one = {2, 2, huge, INT64_C(1) << 33, one, NULL, 1};
        CHECK(hs_rows_keep(&long_one, &change, NULL, 2, &options, &kept, NULL) == HS_ERR_TOO_MANY);
    }
    /* A row that is taken twice has no room. */
    static const int64_t both[2] = {0, 2}, twice[2] = {0, 0}, pair_ends[3] = {0, 2, 2};
    static const int32_t pair[2] = {0, 1}, stay[2] = {0, 1};
    const hs_list_rows   single = {2, 1, pair_ends, 2, pair, NULL, 1};
    const hs_node_change two = {1, &both[1], stay, NULL};
    CHECK(hs_rows_keep(&single, &two, twice, 2, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    hs_list_rows other = rows;
    other.n = 1;
    CHECK(hs_rows_without(&rows, &other, true, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    other = (hs_list_rows){2, 1, pair_ends, 2, pair, NULL, 1};
    CHECK(hs_rows_without(&rows, &other, true, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    other = rows;
    other.shift = one;
    CHECK(hs_rows_without(&rows, &other, true, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    hs_list_rows shifted = other;
    shifted.ndim = 2;
    shifted.shift = indices;
    CHECK(hs_rows_without(&shifted, &other, true, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    static const int64_t twice_ends[5] = {0, 2, 2, 2, 2};
    const hs_list_rows   repeated = {2, 2, twice_ends, 2, one, NULL, 1};
    CHECK(hs_rows_without(&rows, &repeated, false, &options, &kept, NULL) == HS_ERR_ARGUMENT);
}

static hs_status
keep_once(void *context)
{
    const bool           in_order = *(bool *)context;
    const hs_list_rows   rows = rows_given(true);
    const hs_node_change change = change_given(in_order);
    hs_pairs            *kept = NULL;
    hs_status            status = keep(&rows, &change, scene.n_lists > 0 ? rows.n : 0, &kept);
    CHECK((kept != NULL) == (status == HS_OK));
    hs_pairs_free(kept);
    if (status == HS_OK) {
        hs_options options = hs_options_default();
        options.memory_limit = limit;
        status = hs_rows_without(&rows, &rows, true, &options, &kept, NULL);
        CHECK(status != HS_OK || hs_pairs_length(kept) == 0);
        hs_pairs_free(kept);
    }
    return status;
}

static void
failures_leave_nothing_kept_rows(void)
{
    harness_random random = {81};
    do {
        node_scene_fill(&random, true, &scene);
    } while (scene.n_pairs < 40);
    for (int order = 0; order < 2; order++) {
        bool in_order = order;
        for (int32_t p = 0; p < scene.n; p++) {
            source[p] = p;
            target[p] = place[p] = p;
        }
        CHECK(fail_each_allocation(keep_once, &in_order, 100) > 5);
        check_arena(keep_once, &in_order);
        CHECK(raise_memory_limit(keep_once, &in_order, &limit) > 5);
    }
}

static void
long_rows_ask_the_caller(void)
{
    enum { LONG = 1 << 21 };
    static int32_t       many[LONG];
    static const int64_t ends[5] = {0, LONG / 4, LONG / 2, LONG / 4 * 3, LONG}, count[1] = {1};
    static const int32_t stays[1] = {0};
    const hs_list_rows   rows = {4, 1, ends, LONG, many, NULL, 1};
    const hs_node_change change = {1, count, stays, NULL};
    hs_options           options = hs_options_default();
    int64_t              left = 0;
    hs_pairs            *kept;
    options.poll = stop_after;
    options.poll_context = &left;
    CHECK(hs_rows_keep(&rows, &change, NULL, 4, &options, &kept, NULL) == HS_ERR_INTERRUPTED);
    left = 0;
    CHECK(hs_rows_without(&rows, &rows, true, &options, &kept, NULL) == HS_ERR_INTERRUPTED);
    left = 1; /* once only */
    CHECK(hs_rows_keep(&rows, &change, NULL, 4, &options, &kept, NULL) == HS_OK && left == 0);
    hs_pairs_free(kept);
    left = 1;
    CHECK(hs_rows_without(&rows, &rows, true, &options, &kept, NULL) == HS_OK && left == 0);
    hs_pairs_free(kept);
}

void
test_connectivity(void)
{
    RUN(what_is_no_map_is_refused);
    RUN(what_is_no_list_is_refused);
    RUN(pairs_of_rows_are_those_of_links);
    RUN(pairs_of_rows_that_are_none_are_refused);
    RUN(many_pairs_ask_the_caller);
    RUN(no_limit_of_memory_leaves_anything);
    RUN(images_keep_their_shifts);
    RUN(what_are_no_rows_of_all_is_refused);
    RUN(failures_leave_nothing);
    RUN(shifts_are_opposite_in_the_other_row);
    RUN(searches_give_what_links_give);
    RUN(rows_that_are_found_may_be_too_many);
    RUN(no_allocation_that_fails_leaves_anything);
    RUN(rows_have_the_nodes_that_stay);
    RUN(rows_lose_the_entries_that_go);
    RUN(images_go_by_their_shifts);
    RUN(what_are_no_rows_is_refused);
    RUN(failures_leave_nothing_kept_rows);
    RUN(long_rows_ask_the_caller);
}
