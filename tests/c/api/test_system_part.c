/* SPDX-License-Identifier: BSD-3-Clause */
/* test_system_part.c: what one of many systems has of the arrays of all. */
#include "../../../csrc/core/api/system_part.h"
#include "../support/harness.h"

void test_system_part(void);

static const double x[5] = {0.0, 1.0, 2.0, 3.0, 4.0};

static void
systems_are_ranges_of_the_points(void)
{
    const int64_t   first[] = {0, 2, 2, 5};
    const hs_points points = {x, 5, 1, HS_FLOAT64, 8, 8}, none = {NULL, 0, 1, HS_FLOAT64, 8, 8};
    hs_points       own = hs_points_of_system(&points, first, 0);
    CHECK(own.data == x && own.n == 2);
    own = hs_points_of_system(&points, first, 1);
    CHECK(own.n == 0);
    own = hs_points_of_system(&points, first, 2);
    CHECK(own.data == x + 2 && own.n == 3 && own.ndim == 1 && own.row_stride == 8);
    own = hs_points_of_system(&none, first, 1); /* no number is added to NULL */
    CHECK(own.data == NULL && own.n == 0);
}

/* One box for all, or rows for each, of which it says what repeats. */
static void
each_system_has_its_box(void)
{
    const int64_t first[] = {0, 1, 2};
    const double  rows[] = {1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0};
    const hs_box  box = {.ndim = 2, .periodic = {true, false}, .rows = {{9.0}, {0.0, 9.0}}};
    hs_systems    systems = {.n = 2, .first = first, .box = &box};
    hs_box        own_box;
    CHECK(hs_box_of_system(&systems, 2, 1, &own_box) == &box);
    systems.rows = rows;
    for (int s = 0; s < 2; s++) {
        CHECK(hs_box_of_system(&systems, 2, s, &own_box) == &own_box && own_box.ndim == 2);
        CHECK(own_box.periodic[0] && !own_box.periodic[1]);
        CHECK(own_box.rows[0][0] == 1.0 + 4 * s && own_box.rows[0][1] == 2.0 + 4 * s);
        CHECK(own_box.rows[1][0] == 3.0 + 4 * s && own_box.rows[1][1] == 4.0 + 4 * s);
    }
    const uint8_t bits[] = {2, 1}; /* which axes repeat may be of each as well, or that alone */
    systems.periodic = bits;
    CHECK(hs_box_of_system(&systems, 2, 0, &own_box) == &own_box);
    CHECK(!own_box.periodic[0] && own_box.periodic[1] && own_box.rows[1][1] == 4.0);
    systems.rows = NULL;
    CHECK(hs_box_of_system(&systems, 2, 1, &own_box) == &own_box && own_box.ndim == 2);
    CHECK(own_box.periodic[0] && !own_box.periodic[1]);
    CHECK(own_box.rows[0][0] == 9.0 && own_box.rows[1][1] == 9.0);
    systems.box = NULL;
    CHECK(hs_box_of_system(&systems, 2, 1, &own_box) == NULL);
    CHECK(hs_cutoff_of_system(&systems, 1, 0.5) == 0.5);
    systems.cutoffs = rows;
    CHECK(hs_cutoff_of_system(&systems, 1, 0.5) == 2.0);
}

enum { N = 6, Q = 4, D = 2 };

static void
arrays_begin_where_the_system_does(void)
{
    const int64_t   first[] = {0, 2, 5, 6}, first_query[] = {0, 3, 4, 4};
    const double    numbers[N * D * D] = {0.0};
    const int32_t   types[N] = {0};
    const int64_t   labels[N] = {0};
    const hs_points points = {numbers, N, D, HS_FLOAT64, 16, 8},
                    queries = {numbers, Q, D, HS_FLOAT64, 16, 8};
    hs_reach                reach = {.radii = numbers,
                                     .query_radii = numbers,
                                     .types = types,
                                     .query_types = types,
                                     .supports = numbers,
                                     .query_supports = numbers,
                                     .extent = 3.0};
    const hs_selection      selection = {.groups = labels,
                                         .query_groups = labels,
                                         .labels = labels,
                                         .query_labels = labels,
                                         .within = 7,
                                         .min_distance = 0.5};
    hs_systems              systems = {.n = 3, .first = first, .first_query = first_query};
    const hs_system_sets    sets = {&points, &queries, &systems}, alone = {&points, NULL, &systems};
    const hs_excluded_parts none = {NULL, NULL};
    hs_system_part          part;
    hs_system_part_cut(&alone, &none, 1, &part);
    CHECK(part.among.points == &part.points && part.among.queries == NULL);
    CHECK(part.among.reach == NULL && part.among.selection == NULL && part.among.box == NULL);
    CHECK(part.system == 1 && part.first_point == 2 && part.first_asking == 2);
    CHECK(part.n_asking == 3 && part.points.n == 3);
    systems.reach = &reach;
    systems.selection = &selection;
    hs_system_part_cut(&sets, &none, 1, &part);
    CHECK(part.among.queries == &part.queries && part.first_asking == 3 && part.n_asking == 1);
    CHECK(part.queries.data == numbers + 3 * D && part.points.data == numbers + 2 * D);
    CHECK(part.among.reach == &part.reach && part.reach.extent == 3.0);
    CHECK(part.reach.radii == numbers + 2 && part.reach.query_radii == numbers + 3);
    CHECK(part.reach.types == types + 2 && part.reach.query_types == types + 3);
    CHECK(part.reach.supports == numbers + 2 * D * D);
    CHECK(part.reach.query_supports == numbers + 3 * D * D);
    CHECK(part.among.selection == &part.selection && part.selection.within == 7);
    CHECK(part.selection.groups == labels + 2 && part.selection.query_groups == labels + 3);
    CHECK(part.selection.labels == labels + 2 && part.selection.query_labels == labels + 3);
    CHECK(part.selection.n_excluded == 0 && part.selection.min_distance == 0.5);
    reach = (hs_reach){.rule = HS_RULE_MAX};
    systems.first_query = NULL;
    hs_system_part_cut(&alone, &none, 1, &part);
    CHECK(part.reach.radii == NULL && part.reach.query_radii == NULL && part.reach.types == NULL);
    CHECK(part.reach.supports == NULL && part.reach.query_supports == NULL);
    CHECK(part.selection.query_labels == labels + 2); /* which no one looks at without queries */
}

/* The excluded pairs of a system, with numbers of its own; pairs of two systems are none. */
static void
excluded_pairs_are_sorted_by_system(void)
{
    const int64_t        first[] = {0, 0, 3, 3, 5, 6}, excluded[] = {4, 3, 0, 2, 5, 0, 1, 1, 3, 5};
    const double         numbers[N] = {0.0};
    const hs_points      points = {numbers, N, 1, HS_FLOAT64, 8, 8};
    const hs_selection   selection = {.n_excluded = 5, .excluded = excluded};
    const hs_systems     systems = {.n = 5, .first = first, .selection = &selection};
    const hs_system_sets sets = {&points, NULL, &systems};
    const int64_t        expected[] = {0, 2, 1, 1, 1, 0}, ends[] = {0, 0, 2, 2, 3, 3};
    const hs_options     options = hs_options_default();
    hs_excluded_parts    parts;
    hs_system_part       part;
    hs_account           account;
    hs_account_init(&account, &options);
    CHECK(hs_excluded_parts_open(&sets, &account, &parts) == HS_OK);
    CHECK(memcmp(parts.first, ends, sizeof ends) == 0);
    CHECK(memcmp(parts.pairs, expected, sizeof expected) == 0);
    hs_system_part_cut(&sets, &parts, 3, &part);
    CHECK(part.selection.n_excluded == 1 && part.selection.excluded == parts.pairs + 4);
    hs_system_part_cut(&sets, &parts, 2, &part);
    CHECK(part.selection.n_excluded == 0);
    hs_excluded_parts_free(&account, &parts);
    hs_excluded_parts_free(&account, &parts);
    for (int nth = 1; nth <= 2; nth++) {
        hs_test_fail_allocation(nth);
        CHECK(hs_excluded_parts_open(&sets, &account, &parts) == HS_ERR_MEMORY);
        hs_excluded_parts_free(&account, &parts);
    }
    hs_test_fail_allocation(0);
    CHECK(account.held == 0);
    hs_account_close(&account);
}

/* With queries the first number is that of a query. */
static void
excluded_pairs_of_queries_have_numbers_of_both(void)
{
    const int64_t   first[] = {0, 2, 5}, first_query[] = {0, 1, 3};
    const int64_t   excluded[] = {2, 4, 0, 4, 1, 2}, expected[] = {1, 2, 0, 0};
    const double    numbers[N] = {0.0};
    const hs_points points = {numbers, 5, 1, HS_FLOAT64, 8, 8},
                    queries = {numbers, 3, 1, HS_FLOAT64, 8, 8};
    const hs_selection selection = {.n_excluded = 3, .excluded = excluded};
    const hs_systems   systems = {
          .n = 2, .first = first, .first_query = first_query, .selection = &selection};
    const hs_system_sets sets = {&points, &queries, &systems};
    const hs_options     options = hs_options_default();
    hs_excluded_parts    parts;
    hs_account           account;
    hs_account_init(&account, &options);
    CHECK(hs_excluded_parts_open(&sets, &account, &parts) == HS_OK);
    CHECK(parts.first[1] == 0 && parts.first[2] == 2);
    CHECK(memcmp(parts.pairs, expected, sizeof expected) == 0);
    hs_excluded_parts_free(&account, &parts);
    hs_account_close(&account);
}

void
test_system_part(void)
{
    RUN(systems_are_ranges_of_the_points);
    RUN(each_system_has_its_box);
    RUN(arrays_begin_where_the_system_does);
    RUN(excluded_pairs_are_sorted_by_system);
    RUN(excluded_pairs_of_queries_have_numbers_of_both);
}
