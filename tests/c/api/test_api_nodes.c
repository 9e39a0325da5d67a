/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_nodes.c: connectivity of lists of nodes, and its changes. */
#include "../../../csrc/halfshell_nodes.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"
#include "../support/reach_sets.h"

#include <math.h>

void test_api_nodes(void);

/* ---- a build is the half list of a search, linked ---- */

static reach_set set;
static double    limit = HUGE_VAL;

static const int64_t       counts[3] = {40, 0, 60}, ghosts[3] = {10, 0, 5};
static const hs_node_lists lists = {
    .n_lists = 3, .n_nodes = counts, .n_ghosts = ghosts, .ghost_rows = true, .ghost_pairs = true};

static hs_reach
supports(void)
{
    return (hs_reach){.rule = HS_RULE_MAX, .extent = 1.1};
}

static bool
same_array(const hs_pairs *one, const hs_pairs *other, unsigned which, size_t width)
{
    const void *a = hs_pairs_array(one, which), *b = hs_pairs_array(other, which);
    return (a == NULL) == (b == NULL) && hs_pairs_length(one) == hs_pairs_length(other) &&
           (a == NULL || memcmp(a, b, (size_t)hs_pairs_length(one) * width) == 0);
}

static hs_status
build(void *context)
{
    const hs_points points = reach_points(&set);
    const hs_reach  reach = supports();
    const hs_among  among = {
         .points = SET(&points, .radii = set.radii), .box = context, .reach = &reach};
    hs_options       options = hs_options_default();
    hs_connectivity *made = NULL, *linked = NULL;
    hs_pairs        *half = NULL;
    options.cutoff = HUGE_VAL;
    options.memory_limit = limit;
    const hs_status status = hs_connectivity_build(&among, &lists, &options, &made, NULL);
    CHECK((made != NULL) == (status == HS_OK));
    if (status != HS_OK)
        return status;
    options.sorted = true;
    options.index_bytes = 4;
    options.want |= context != NULL ? (unsigned)HS_WANT_SHIFT : 0u;
    if (hs_pairs_find(&among, &options, &half, NULL) == HS_OK) {
        const hs_half_list given = {.n = hs_pairs_length(half),
                                    .i = hs_pairs_array(half, HS_WANT_I),
                                    .j = hs_pairs_array(half, HS_WANT_J),
                                    .shift = hs_pairs_array(half, HS_WANT_SHIFT),
                                    .ndim = 2};
        if (hs_connectivity_link(&given, &lists, &options, &linked, NULL) == HS_OK) {
            CHECK(hs_pairs_length(hs_connectivity_pairs(made)) == given.n && given.n > 0);
            for (int part = 0; part < 3; part++) {
                hs_pairs *(*const parts[])(hs_connectivity *) = {
                    hs_connectivity_rows, hs_connectivity_pairs, hs_connectivity_lists};
                const hs_pairs *own = parts[part](made), *other = parts[part](linked);
                CHECK(same_array(own, other, HS_WANT_I, 4) && same_array(own, other, HS_WANT_J, 4));
                CHECK(same_array(own, other, HS_WANT_SHIFT, 8));
                CHECK(hs_pairs_rows(own) == hs_pairs_rows(other));
            }
        }
    }
    hs_pairs_free(half);
    hs_connectivity_free(made);
    hs_connectivity_free(linked);
    return status;
}

static void
a_build_is_a_search_that_is_linked(void)
{
    harness_random random = {7};
    hs_box         box = {.ndim = 2, .periodic = {true, false}, .rows = {{3.0, 0.0}, {0.0, 4.0}}};
    reach_fill(&random, 100, 2, 4.0, 2, 0.6, &set);
    CHECK(build(NULL) == HS_OK);
    CHECK(build(&box) == HS_OK);
    CHECK(fail_each_allocation(build, NULL, 2000) > 20);
    check_arena(build, NULL);
    CHECK(raise_memory_limit(build, &box, &limit) > 20);
}

/* Of cells, and of points in any order: then pairs are those of half lists, turned. */
static hs_status
build_in_cells(void *context)
{
    static int32_t   number[100];
    const hs_points  points = reach_points(&set);
    hs_options       options = hs_options_default();
    hs_cells        *cells = NULL;
    hs_connectivity *made = NULL, *other = NULL;
    options.cutoff = 0.5;
    if (hs_cells_build(&points, context, &options, &cells, NULL) != HS_OK)
        return HS_ERR_MEMORY;
    for (int32_t p = 0; p < 100; p++)
        number[p] = 99 - p;
    hs_node_lists turned = lists;
    turned.number = number;
    options.memory_limit = limit;
    const hs_among  among = {.cells = cells}, same = {.points = SET(&points), .box = context};
    const hs_status status = hs_connectivity_build(&among, &turned, &options, &made, NULL);
    if (status == HS_OK && limit == HUGE_VAL) {
        CHECK(hs_connectivity_build(&same, &turned, &options, &other, NULL) == HS_OK);
        const hs_pairs *own = hs_connectivity_rows(made), *rows = hs_connectivity_rows(other);
        CHECK(same_array(own, rows, HS_WANT_J, 4) && same_array(own, rows, HS_WANT_SHIFT, 8));
        CHECK(hs_pairs_length(own) > 0);
        own = hs_connectivity_pairs(made);
        CHECK(same_array(own, hs_connectivity_pairs(other), HS_WANT_SHIFT, 8));
    }
    CHECK((made != NULL) == (status == HS_OK));
    hs_connectivity_free(made);
    hs_connectivity_free(other);
    hs_cells_free(cells);
    return status;
}

static void
cells_are_searched_as_points_are(void)
{
    harness_random random = {8};
    hs_box         box = {.ndim = 2, .periodic = {true, false}, .rows = {{3.0, 0.0}, {0.5, 4.0}}};
    reach_fill(&random, 100, 2, 4.0, 0, 0.6, &set);
    CHECK(build_in_cells(&box) == HS_OK);
    CHECK(build_in_cells(NULL) == HS_OK);
    CHECK(raise_memory_limit(build_in_cells, &box, &limit) > 20);
}

static void
arguments_that_do_not_fit_are_refused(void)
{
    const hs_points      points = reach_points(&set);
    const hs_reach       reach = supports();
    hs_among             among = {.points = SET(&points, .radii = set.radii), .reach = &reach};
    hs_options           options = hs_options_default();
    static const int64_t few[3] = {40, 0, 59}, many[3] = {INT32_MAX, 1, 0}, below[3] = {-1, 0, 1};
    hs_node_lists        wrong = lists;
    const hs_half_list   none = {.n = 0};
    hs_connectivity     *made;
    hs_pairs            *rows;
    options.cutoff = HUGE_VAL;
    CHECK(hs_connectivity_build(NULL, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_build(&among, NULL, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_build(&among, &lists, NULL, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_build(&among, &lists, &options, NULL, NULL) == HS_ERR_ARGUMENT);
    const int64_t first[] = {0, 50, 100};
    CHECK(hs_connectivity_build(SYSTEMS(&points, 2, first, NULL, NULL), &lists, &options, &made,
                                NULL) == HS_ERR_ARGUMENT);
    wrong.n_nodes = few;
    CHECK(hs_connectivity_build(&among, &wrong, &options, &made, NULL) == HS_ERR_ARGUMENT);
    wrong.n_nodes = many;
    CHECK(hs_connectivity_link(&none, &wrong, &options, &made, NULL) == HS_ERR_TOO_MANY);
    wrong.n_nodes = below;
    CHECK(hs_connectivity_link(&none, &wrong, &options, &made, NULL) == HS_ERR_ARGUMENT);
    wrong = (hs_node_lists){.n_lists = 1};
    CHECK(hs_connectivity_link(&none, &wrong, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_link(NULL, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_link(&none, &lists, &options, NULL, NULL) == HS_ERR_ARGUMENT);
    const hs_index_rows no_rows = {.n = 0};
    const int32_t       shift[1] = {0};
    const hs_half_list  shifted = {.n = 0, .shift = shift, .ndim = 1};
    CHECK(hs_connectivity_overlap(&points, &no_rows, NULL, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_overlap(&points, NULL, &lists, &options, &rows, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_overlap(&points, &no_rows, &lists, NULL, &rows, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_overlap(&points, &no_rows, &lists, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_intersect(&points, NULL, &none, NULL, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_intersect(&points, NULL, NULL, &lists, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_intersect(&points, NULL, &none, &lists, NULL, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_intersect(&points, NULL, &shifted, &lists, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    hs_points too_many_axes = points;
    too_many_axes.ndim = HS_MAX_DIM + 1;
    CHECK(hs_connectivity_overlap(&too_many_axes, &no_rows, &lists, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_intersect(&too_many_axes, NULL, &none, &lists, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    const hs_box       plane = {.ndim = 2, .periodic = {true}, .rows = {{1.0, 0.0}}};
    const hs_box       skewed = {.ndim = 2, .periodic = {true}};
    const hs_box       solid = {.ndim = 3, .periodic = {true}, .rows = {{1.0, 0.0, 0.0}}};
    const hs_half_list two = {.n = 0, .shift = shift, .ndim = 2};
    const struct {
        const hs_box       *box;
        const hs_half_list *pairs;
    } images[] = {{&plane, &none}, {&plane, &shifted}, {&solid, &two}, {&skewed, &two}};
    for (size_t k = 0; k < sizeof images / sizeof *images; k++) {
        CHECK(hs_connectivity_intersect(&points, images[k].box, images[k].pairs, &lists, &options,
                                        &rows, NULL) != HS_OK);
        CHECK(rows == NULL);
    }
    CHECK(hs_connectivity_intersect(&points, &plane, &two, &lists, &options, &rows, NULL) == HS_OK);
    hs_pairs_free(rows);
    wrong = lists;
    wrong.directed = true;
    CHECK(hs_connectivity_intersect(&points, NULL, &none, &wrong, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    static const double  origin[7] = {0.0};
    static const int64_t one_node[1] = {1};
    const hs_points      seven = {origin, 1, 7, HS_FLOAT64, 56, 8};
    const hs_box         seven_axes = {.ndim = 7};
    const hs_half_list   seven_shifts = {.n = 0, .shift = shift, .ndim = 7};
    const hs_node_lists  of_one = {.n_lists = 1, .n_nodes = one_node};
    CHECK(hs_connectivity_intersect(&seven, &seven_axes, &seven_shifts, &of_one, &options, &rows,
                                    NULL) == HS_ERR_ARGUMENT);
    const hs_box flat = {.ndim = HS_MAX_DIM + 1};
    among.box = &flat;
    CHECK(hs_connectivity_build(&among, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    among.box = NULL;
    wrong = lists;
    wrong.n_lists = -1;
    CHECK(hs_connectivity_build(&among, &wrong, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_overlap(NULL, &no_rows, &lists, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_overlap(&points, &no_rows, &lists, &options, NULL, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_intersect(NULL, NULL, &none, &lists, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    options.memory_limit = NAN;
    CHECK(hs_connectivity_overlap(&points, &no_rows, &lists, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_intersect(&points, NULL, &none, &lists, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    wrong = (hs_node_lists){.n_lists = 0};
    CHECK(hs_connectivity_link(&none, &wrong, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_link(&none, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
    options.memory_limit = HUGE_VAL;
    among.queries = among.points;
    CHECK(hs_connectivity_build(&among, &lists, &options, &made, NULL) == HS_ERR_ARGUMENT);
}

static void
extents_that_none_can_have_are_refused(void)
{
    static const double bad[] = {-1.0, 0x1p-65, 0x1p65, NAN, HUGE_VAL};
    harness_random      random = {9};
    reach_fill(&random, 100, 2, 4.0, 0, 0.6, &set);
    const hs_points  points = reach_points(&set);
    const hs_options options = {.cutoff = HUGE_VAL,
                                .want = 3,
                                .index_bytes = 8,
                                .memory_limit = HUGE_VAL,
                                .inclusive = true};
    hs_pairs        *pairs;
    hs_reach         reach = supports();
    hs_among         among = {.points = SET(&points, .radii = set.radii), .reach = &reach};
    for (int k = 0; k < 5; k++) {
        reach.extent = bad[k];
        CHECK(hs_pairs_find(&among, &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    }
    reach = (hs_reach){.rule = HS_RULE_SUM, .extent = 2.0};
    CHECK(hs_pairs_find(&among, &options, &pairs, NULL) == HS_ERR_ARGUMENT);
    reach = supports();
    const double held = set.radii[3];
    set.radii[3] = 0x1p-501;
    CHECK(hs_pairs_find(&among, &options, &pairs, NULL) == HS_ERR_RADII);
    set.radii[3] = 0x1p501;
    CHECK(hs_pairs_find(&among, &options, &pairs, NULL) == HS_ERR_RADII);
    set.radii[3] = held;
}

static void
keys_and_feet_are_checked(void)
{
    double       x[4] = {0.0, 0.5, 1.0, NAN};
    const double low[2] = {0.0, 0.0}, high[2] = {1.0, 1.0}, turned[2] = {2.0, 0.0};
    hs_points    points = {x, 2, 1, HS_FLOAT64, sizeof *x, sizeof *x};
    uint64_t     keys[4];
    bool         between[4];
    hs_failure   failure;
    CHECK(hs_morton_keys(&points, low, high, keys, NULL) == HS_OK);
    CHECK(keys[0] == 0 && keys[1] == UINT64_C(1) << 62);
    CHECK(hs_morton_keys(&points, turned, high, keys, &failure) == HS_ERR_BOX_FINITE);
    CHECK(failure.column == 0);
    CHECK(hs_morton_keys(&points, &x[3], high, keys, NULL) == HS_ERR_BOX_FINITE);
    CHECK(hs_morton_keys(&points, &x[1], high, keys, &failure) == HS_ERR_FAR && failure.row == 0);
    CHECK(hs_morton_keys(NULL, low, high, keys, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_morton_keys(&points, NULL, high, keys, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_morton_keys(&points, low, NULL, keys, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_morton_keys(&points, low, high, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_feet_between(&points, low, &x[1], between, NULL) == HS_OK);
    CHECK(between[0] && between[1]);
    CHECK(hs_feet_between(&points, &x[1], high, between, NULL) == HS_OK);
    CHECK(!between[0] && between[1]);
    CHECK(hs_feet_between(&points, &x[3], high, between, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_feet_between(&points, low, &x[3], between, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_morton_keys(&points, low, &x[3], keys, NULL) == HS_ERR_BOX_FINITE);
    CHECK(hs_morton_keys(&points, low, &(double){0.25}, keys, &failure) == HS_ERR_FAR);
    CHECK(failure.row == 1);
    CHECK(hs_feet_between(NULL, low, high, between, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_feet_between(&points, NULL, high, between, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_feet_between(&points, low, NULL, between, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_feet_between(&points, low, high, NULL, NULL) == HS_ERR_ARGUMENT);
    points.n = 4;
    CHECK(hs_feet_between(&points, low, high, between, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == 3 && failure.column == 0);
    CHECK(hs_morton_keys(&points, low, high, keys, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == 3);
}

/* ---- what the functions that change rows and pairs refuse before they look at these ---- */

static const int64_t        ends[2] = {0, 0}, count[1] = {1};
static const int32_t        zero[1] = {0};
static const hs_list_rows   rows_node_changes = {1, 1, ends, 0, NULL, NULL, 1};
static const hs_node_lists  lists_node_changes = {.n_lists = 1, .n_nodes = count};
static const hs_node_change change = {1, count, zero, NULL};

static void
what_is_missing_is_refused(void)
{
    const hs_options options = hs_options_default();
    hs_node_lists    negative = lists_node_changes;
    hs_connectivity *made = (hs_connectivity *)&negative;
    hs_pairs        *kept = (hs_pairs *)&negative;
    negative.n_lists = -1;
    CHECK(hs_connectivity_pair(NULL, &lists_node_changes, &options, &made, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(made == NULL);
    CHECK(hs_connectivity_pair(&rows_node_changes, NULL, &options, &made, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_pair(&rows_node_changes, &negative, &options, &made, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_pair(&rows_node_changes, &lists_node_changes, NULL, &made, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_connectivity_pair(&rows_node_changes, &lists_node_changes, &options, NULL, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_rows_keep(NULL, &change, NULL, 1, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    CHECK(kept == NULL);
    CHECK(hs_rows_keep(&rows_node_changes, NULL, NULL, 1, &options, &kept, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_rows_keep(&rows_node_changes, &change, NULL, 1, NULL, &kept, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_rows_keep(&rows_node_changes, &change, NULL, 1, &options, NULL, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_rows_without(NULL, &rows_node_changes, true, &options, &kept, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_rows_without(&rows_node_changes, NULL, true, &options, &kept, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_rows_without(&rows_node_changes, &rows_node_changes, true, NULL, &kept, NULL) ==
          HS_ERR_ARGUMENT);
}

static void
resources_are_checked(void)
{
    hs_options       options = hs_options_default();
    hs_connectivity *made;
    hs_pairs        *kept;
    options.memory_limit = NAN;
    CHECK(hs_connectivity_pair(&rows_node_changes, &lists_node_changes, &options, &made, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_rows_keep(&rows_node_changes, &change, NULL, 1, &options, &kept, NULL) ==
          HS_ERR_ARGUMENT);
    CHECK(hs_rows_without(&rows_node_changes, &rows_node_changes, true, &options, &kept, NULL) ==
          HS_ERR_ARGUMENT);
    hs_failure failure;
    options.memory_limit = 1.0;
    CHECK(hs_rows_keep(&rows_node_changes, &change, NULL, 1, &options, &kept, &failure) ==
          HS_ERR_MEMORY);
    CHECK(failure.limit_bytes == 1.0 && kept == NULL);
    CHECK(hs_connectivity_pair(&rows_node_changes, &lists_node_changes, &options, &made,
                               &failure) == HS_ERR_MEMORY);
    CHECK(failure.limit_bytes == 1.0 && made == NULL);
}

void
test_api_nodes(void)
{
    RUN(a_build_is_a_search_that_is_linked);
    RUN(cells_are_searched_as_points_are);
    RUN(arguments_that_do_not_fit_are_refused);
    RUN(extents_that_none_can_have_are_refused);
    RUN(keys_and_feet_are_checked);
    RUN(what_is_missing_is_refused);
    RUN(resources_are_checked);
}
