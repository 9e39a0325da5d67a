/* SPDX-License-Identifier: BSD-3-Clause */
/* test_nearest_kept.c: one of those that come at once builds the tree that is kept, the others do
 * with one of their own; rows end at the largest distance; radii at both ends of the numbers. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#endif
#include "../../../csrc/core/base/os_thread.h"
#include "../../../csrc/core/nearest/nearest_kept.h"
#include "../../../csrc/core/nearest/nearest_write.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/nearest_unit.h"

#include <math.h>

void test_nearest_kept(void);

static nearest_unit unit;

/* The four numbers 0, 0.5, 1 and 1.2, or so many others. */
static const double line[4] = {0.0, 0.5, 1.0, 1.2};

static hs_points
points_on_line(const double *x, int64_t n)
{
    return (hs_points){x, n, 1, HS_FLOAT64, 8, 8};
}

/* Prepares a search that may use what is kept; whether it does. */
static bool
borrows(hs_nearest_kept *kept, double limit)
{
    const hs_points points = points_on_line(line, 4);
    const hs_sets   sets = {
          .points = &points, .is_full = true, .is_plain = true, .is_wide = true, .trees = kept};
    hs_options options = hs_options_default();
    hs_failure failure;
    options.cutoff = limit;
    options.want = HS_WANT_J;
    hs_call_begin(&options, &unit.call);
    hs_search_begin(&unit.call, &unit.search);
    unit.call.team = hs_team_create(2);
    unit.near = (hs_nearest){.search = &unit.search, .k = 1, .of_spot = 2, .omits_self = true};
    CHECK(hs_nearest_prepare(&unit.near, &sets, NULL, limit, &failure) == HS_OK);
    CHECK(unit.near.tree.n_nodes == 1 && unit.near.limit > 0.0);
    const bool borrowed = unit.search.is_borrowed;
    hs_nearest_release(&unit.near);
    hs_search_close(&unit.search);
    hs_call_dismiss(&unit.call);
    hs_account_close(&unit.call.account);
    return borrowed;
}

static void
whoever_comes_while_it_is_built_does_without(void)
{
    const int64_t    blocks = hs_test_live_blocks();
    hs_nearest_kept *kept = hs_nearest_kept_new();
    hs_nearest      *room = NULL, *other = NULL;
    CHECK(hs_nearest_kept_get(kept, &room) == NULL && room != NULL);
    CHECK(hs_nearest_kept_get(kept, &other) == NULL && other == NULL);
    CHECK(!borrows(kept, INFINITY));
    hs_nearest_kept_end(kept, false); /* it could not be built: the next one tries */
    CHECK(hs_nearest_kept_get(kept, &room) == NULL && room != NULL);
    hs_test_fork(); /* a thread of the parent built it */
    CHECK(hs_nearest_kept_get(kept, &room) == NULL && room != NULL);
    CHECK(hs_nearest_kept_get(kept, &other) == NULL && other == NULL);
    hs_nearest_kept_end(kept, false);
    CHECK(borrows(kept, INFINITY));
    CHECK(borrows(kept, 1.0));
    CHECK(!borrows(kept, 0x1p-900)); /* has a scale of its own */
    const hs_nearest *built = hs_nearest_kept_get(kept, &room);
    CHECK(built != NULL && room == NULL && built->tree.n_nodes == 1);
    CHECK(built->search->call->team == NULL); /* it was the call's that built it */
    CHECK(hs_nearest_kept_get(kept, &other) == built && other == NULL);
    hs_nearest_kept_free(kept);
    hs_nearest_kept_free(NULL);
    CHECK(hs_test_live_blocks() == blocks);
}

/* Points that a radius beyond the largest distance has let in. */
static void
rows_end_at_the_largest_distance(void)
{
    const hs_points          points = points_on_line(line, 4);
    static hs_nearest_block  block;
    static hs_nearest_writer writer;
    static const double      limits[] = {0.25, 0.5, 0.75, 1.0, 1.125, 1.25};
    static const int         within[] = {0, 1, 1, 2, 2, 3};
    hs_options               options = hs_options_default();
    for (int l = 0; l < 6; l++) {
        nearest_unit_open(&points, NULL, NULL, 3, HS_WANT_J | HS_WANT_DISTANCE, limits[l], &unit);
        hs_nearest_ranker ranker = {
            .near = &unit.near, .block = &block, .pace = {.options = &options}};
        hs_nearest_group group = nearest_unit_group(&unit, 1.5);
        int32_t          hits[4] = {0, 1, 2, 3}, si = 0;
        int64_t          count;
        CHECK(hs_output_reserve(&unit.rows, 12, 0.0) == HS_OK);
        unit.rows.n_pairs = 12;
        CHECK(hs_nearest_block_init(&unit.near, &block) == HS_OK);
        CHECK(hs_nearest_block_fill(&unit.near, &unit.call.options, &group, 1e9, NULL, &block) ==
              HS_OK);
        while (unit.search.bins.order[si] != 0)
            si++;
        CHECK(hs_nearest_rank(&ranker, &group, si, hits, 4, &count) == HS_OK && count == 3);
        hs_nearest_writer_init(&unit.near, &writer);
        CHECK(hs_nearest_write(&writer, &ranker, count) == HS_OK);
        hs_nearest_flush(&writer);
        const int64_t *j = hs_output_column(&unit.rows, HS_WANT_J);
        const double  *d = hs_output_column(&unit.rows, HS_WANT_DISTANCE);
        for (int e = 0; e < 3; e++) {
            CHECK(j[e] == (e < within[l] ? e + 1 : -1));
            CHECK(d[e] == (e < within[l] ? line[e + 1] : INFINITY));
        }
        hs_nearest_ranker_free(&ranker);
        hs_nearest_block_free(&unit.near, &block);
        nearest_unit_close(&unit);
    }
}

/* Squares of what is far beyond the first guess would overflow, those of what is far below it would
 * vanish: the unit changes, up and down to the last that there is. */
static void
check_radii(const double *x)
{
    const hs_points  points = points_on_line(x, 2);
    const hs_options options = hs_options_default();
    static const int exponents[] = {-1000, -300, 0, 300, 600, 601, 602, 900};
    for (int e = 0; e < 8; e++) {
        hs_nearest_bounder bounder;
        nearest_unit_open(&points, NULL, NULL, 1, HS_WANT_J, INFINITY, &unit);
        const double apart = fabs(unit.search.bins.x[0][0] - unit.search.bins.x[0][1]);
        CHECK(apart > 0.0 && apart < INFINITY);
        CHECK(hs_nearest_bounder_init(&unit.near, &bounder) == HS_OK);
        hs_nearest_group group;
        hs_nearest_group_set(&unit.near, 0, 1, &group);
        group.radius = ldexp(1.0, exponents[e]);
        CHECK(hs_nearest_bound(&unit.near, &options, &bounder, &group) == HS_OK);
        CHECK(group.radius >= apart && group.radius <= 1.001 * apart);
        hs_nearest_bounder_free(&unit.near, &bounder);
        nearest_unit_close(&unit);
    }
}

static void
radii_are_found_far_from_a_guess(void)
{
    check_radii((const double[2]){-0x1.fp900, 0x1.fp900});
    check_radii((const double[2]){0.0, 0x1.fp-900});
    check_radii((const double[2]){-0x1p-500, 0x1.fp-470});
    check_radii((const double[2]){0x1p500, 0x1.fp470});
}

/* So far away along an open axis that more images than can be looked at are about as near. */
static void
images_without_end_are_refused(void)
{
    const double     x[2] = {0.25, 0.0};
    const hs_box     box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    const hs_points  points = {x, 1, 2, HS_FLOAT64, 16, 8};
    const hs_options options = hs_options_default();
    for (int e = 0; e < 2; e++) {
        hs_nearest_bounder bounder;
        nearest_unit_open(&points, NULL, &box, 1, HS_WANT_J, INFINITY, &unit);
        CHECK(hs_nearest_bounder_init(&unit.near, &bounder) == HS_OK);
        hs_nearest_group group;
        hs_nearest_group_set(&unit.near, 0, 1, &group);
        group.radius = 0.5;
        group.away = e ? 0x1p60 : 0.0;
        CHECK(hs_nearest_bound(&unit.near, &options, &bounder, &group) ==
              (e ? HS_ERR_MEMORY : HS_OK));
        CHECK(e || (group.radius >= 1.0 && group.radius < 1.001));
        hs_nearest_bounder_free(&unit.near, &bounder);
        nearest_unit_close(&unit);
    }
}

void
test_nearest_kept(void)
{
    RUN(images_without_end_are_refused);
    RUN(whoever_comes_while_it_is_built_does_without);
    RUN(rows_end_at_the_largest_distance);
    RUN(radii_are_found_far_from_a_guess);
}
