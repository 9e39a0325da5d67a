/* SPDX-License-Identifier: BSD-3-Clause */
/* test_levels.c: each point is in one level, in the caller's order there, and levels ascend; what is
 * no radius, type or table is refused with its first row, and nothing is left. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/base/poll.h"
#include "../../../csrc/core/levels/levels.h"
#include "../support/poll_checks.h"
#include "../support/reach_sets.h"

void test_levels(void);

static reach_set points, queries;

static hs_account
new_account(void)
{
    const hs_options options = hs_options_default();
    hs_account       account;
    hs_account_init(&account, &options);
    return account;
}

static void
close_account(hs_account *account)
{
    CHECK(account->held == 0);
    hs_account_close(account);
}

/* Each point of `of` once, with its coordinates; ascending numbers in each level. */
static bool
has_each_point(const hs_level_set *set, int32_t n_levels, const reach_set *of)
{
    bool seen[REACH_POINTS] = {false};
    bool right = set->n == of->n && set->ndim == of->ndim && set->first[0] == 0 &&
                 set->first[n_levels] == of->n;
    for (int32_t l = 0; right && l < n_levels; l++) {
        right = set->first[l] <= set->first[l + 1];
        for (int64_t at = set->first[l]; right && at < set->first[l + 1]; at++) {
            const int32_t i = set->number[at];
            right = i >= 0 && i < of->n && !seen[i] &&
                    (at == set->first[l] || set->number[at - 1] < i) &&
                    memcmp(set->rows + at * of->ndim, of->x + (int64_t)i * of->ndim,
                           (size_t)of->ndim * sizeof(double)) == 0;
            seen[right ? i : 0] = true;
        }
    }
    return right;
}

/* Radii as given, or halved; those of a level are larger than all of the one before. */
static bool
radii_ascend(const hs_level_set *set, int32_t n_levels, const reach_set *of, bool halved)
{
    bool   right = set->radii != NULL;
    double before = -1.0;
    for (int32_t l = 0; right && l < n_levels; l++) {
        double largest = before;
        for (int64_t at = set->first[l]; right && at < set->first[l + 1]; at++) {
            const double radius = of->radii[set->number[at]];
            right = set->radii[at] == (halved ? 0.5 * radius : radius) && set->radii[at] > before &&
                    !signbit(set->radii[at]);
            largest = fmax(largest, set->radii[at]);
        }
        before = largest;
    }
    return right;
}

static hs_status
divide(const hs_reach *reach, bool has_queries, hs_account *account, hs_levels *levels,
       hs_failure *failure)
{
    const hs_points  p = reach_points(&points), q = reach_points(&queries);
    const hs_options options = hs_options_default();
    *failure = HS_NO_FAILURE;
    return hs_levels_divide(account, &options, &p, has_queries ? &q : NULL, reach, levels, failure);
}

static void
points_are_divided_by_their_radii(void)
{
    harness_random random = {31};
    int            most = 0;
    for (int trial = 0; trial < 200; trial++) {
        const bool has_queries = trial & 1, halves = trial % 3 == 0;
        reach_fill(&random, trial % 4 ? 1 + trial : 0, 1 + trial % 8, 3.0, trial % 5, 0.7, &points);
        reach_fill(&random, trial % 7 ? 200 - trial : 0, 1 + trial % 8, 3.0, 2, 0.7, &queries);
        if (points.n > 1)
            points.radii[0] = -0.0;
        const hs_reach reach = {.rule = halves ? HS_RULE_MEAN : HS_RULE_MAX,
                                .radii = points.radii,
                                .query_radii = queries.radii};
        hs_account     account = new_account();
        hs_levels      levels;
        hs_failure     failure;
        CHECK(divide(&reach, has_queries, &account, &levels, &failure) == HS_OK);
        CHECK(levels.has_queries == has_queries && levels.cutoffs == NULL);
        CHECK(has_each_point(&levels.points, levels.n, &points));
        CHECK(radii_ascend(&levels.points, levels.n, &points, halves));
        CHECK(hs_levels_asking(&levels) == (has_queries ? &levels.queries : &levels.points));
        if (has_queries) {
            CHECK(has_each_point(&levels.queries, levels.n, &queries));
            CHECK(radii_ascend(&levels.queries, levels.n, &queries, halves));
        }
        for (int32_t l = 0; l < levels.n; l++) { /* none is empty */
            const bool some = has_queries && levels.queries.first[l] < levels.queries.first[l + 1];
            CHECK(some || levels.points.first[l] < levels.points.first[l + 1]);
        }
        most = levels.n > most ? levels.n : most;
        hs_levels_free(&account, &levels);
        hs_levels_free(&account, &levels);
        close_account(&account);
    }
    CHECK(most > 8);
}

/* Of which the rule needs no radii, all are of the smallest size. */
static void
sets_without_radii_are_of_one_level(void)
{
    const hs_reach reach = {.rule = HS_RULE_GATHER, .query_radii = queries.radii};
    hs_account     account = new_account();
    hs_levels      levels;
    hs_failure     failure;
    harness_random random = {39};
    reach_fill(&random, 70, 2, 3.0, 0, 0.7, &points);
    reach_fill(&random, 50, 2, 3.0, 2, 0.7, &queries);
    CHECK(divide(&reach, true, &account, &levels, &failure) == HS_OK && levels.n > 3);
    CHECK(levels.points.radii == NULL && levels.points.first[1] == 70);
    CHECK(has_each_point(&levels.points, levels.n, &points));
    CHECK(radii_ascend(&levels.queries, levels.n, &queries, false));
    hs_levels_renumber(1000, &levels);
    for (int i = 0; i < 70; i++)
        CHECK(levels.points.number[i] == 1000 + i);
    CHECK(levels.queries.number[0] < 50);
    hs_levels_free(&account, &levels);
    close_account(&account);
}

/* All of one order are in two levels at most; the largest and the smallest numbers are in order. */
static void
levels_are_binary_orders(void)
{
    static const double ladder[] = {0.0, 5e-324, 0x1p-1030, 0x1p-1021, 1e-300,  0x1p-3,
                                    0.2, 0.9,    1.0,       0x1.8p900, 0x1p1022};
    const hs_reach      reach = {.rule = HS_RULE_SUM, .radii = points.radii};
    hs_account          account = new_account();
    hs_levels           levels;
    hs_failure          failure;
    harness_random      random = {32};
    reach_fill(&random, 11, 2, 1.0, 0, 1.0, &points);
    for (int i = 0; i < 11; i++)
        points.radii[(i * 4) % 11] = ladder[i];
    CHECK(divide(&reach, false, &account, &levels, &failure) == HS_OK);
    CHECK(radii_ascend(&levels.points, levels.n, &points, false) && levels.n >= 6);
    hs_levels_free(&account, &levels);
    for (int i = 0; i < 11; i++)
        points.radii[i] = 0x1p-1040 * (16 + i);
    CHECK(divide(&reach, false, &account, &levels, &failure) == HS_OK);
    CHECK(levels.n <= 2 && radii_ascend(&levels.points, levels.n, &points, false));
    hs_levels_free(&account, &levels);
    close_account(&account);
}

/* Types 1 and 4 of six have no point: there are levels, and cutoffs, of the others. */
static void
points_are_divided_by_their_types(void)
{
    double               table[REACH_TYPES * REACH_TYPES];
    hs_account           account = new_account();
    hs_levels            levels;
    hs_failure           failure;
    harness_random       random = {33};
    static const int32_t present[] = {0, 2, 3, 5};
    reach_fill(&random, 300, 3, 1.0, 1, 1.0, &points);
    reach_fill(&random, 20, 3, 1.0, 1, 1.0, &queries);
    for (int a = 0; a < REACH_TYPES; a++) {
        for (int b = 0; b < REACH_TYPES; b++)
            table[a * REACH_TYPES + b] = a == b && a == 3 ? -7.5 : 0.1 * (a + b);
    }
    for (int i = 0; i < 300; i++)
        points.types[i] = i % 2 ? 0 : i % 3 ? 5 : 3;
    for (int i = 0; i < 20; i++)
        queries.types[i] = i % 2 ? 2 : 5;
    const hs_reach reach = {.rule = HS_RULE_GATHER, /* plays no part, nor do radii */
                            .radii = points.radii,
                            .query_radii = queries.radii,
                            .n_types = REACH_TYPES,
                            .types = points.types,
                            .query_types = queries.types,
                            .cutoffs = table};
    CHECK(divide(&reach, true, &account, &levels, &failure) == HS_OK);
    CHECK(levels.n == 4 && levels.points.radii == NULL && levels.queries.radii == NULL);
    CHECK(has_each_point(&levels.points, 4, &points));
    CHECK(has_each_point(&levels.queries, 4, &queries));
    for (int32_t a = 0; a < 4; a++) {
        for (int64_t at = levels.points.first[a]; at < levels.points.first[a + 1]; at++)
            CHECK(points.types[levels.points.number[at]] == present[a]);
        for (int32_t b = 0; b < 4; b++) {
            const double cutoff = table[present[a] * REACH_TYPES + present[b]];
            CHECK(levels.cutoffs[a * 4 + b] == (cutoff < 0.0 ? -1.0 : cutoff));
        }
    }
    hs_levels_free(&account, &levels);
    close_account(&account);
}

/* What a refusal must say: nothing is held, and the first bad row is named. */
static void
is_refused(const hs_reach *reach, hs_status status, int64_t row, bool in_queries)
{
    hs_account account = new_account();
    hs_levels  levels;
    hs_failure failure;
    CHECK(divide(reach, true, &account, &levels, &failure) == status);
    CHECK(failure.row == row && failure.in_queries == in_queries);
    CHECK(levels.points.rows == NULL && levels.queries.rows == NULL && levels.cutoffs == NULL);
    hs_levels_free(&account, &levels);
    close_account(&account);
}

static void
bad_numbers_are_refused(void)
{
    static const double bad[] = {-1.0, NAN, INFINITY, -INFINITY, 0x1.0000000000001p1022, -5e-324};
    harness_random      random = {34};
    reach_fill(&random, 50, 2, 1.0, 1, 1.0, &points);
    reach_fill(&random, 30, 2, 1.0, 1, 1.0, &queries);
    hs_reach reach = {.rule = HS_RULE_SUM, .radii = points.radii, .query_radii = queries.radii};
    for (int e = 0; e < 6; e++) {
        queries.radii[7] = queries.radii[9] = bad[e];
        is_refused(&reach, HS_ERR_RADII, 7, true);
        points.radii[31] = points.radii[49] = bad[e];
        is_refused(&reach, HS_ERR_RADII, 31, false);
        points.radii[31] = points.radii[49] = queries.radii[7] = queries.radii[9] = 1.0;
    }
    reach.rule = HS_RULE_MEAN; /* half of it would lose a digit */
    points.radii[3] = 0x1p-1022;
    is_refused(&reach, HS_ERR_RADII, 3, false);
    points.radii[3] = 0x1p-1021;
    queries.x[2 * 11 + 1] = INFINITY;
    is_refused(&reach, HS_ERR_NOT_FINITE, 11, true);
    points.x[0] = NAN;
    is_refused(&reach, HS_ERR_NOT_FINITE, 0, false);
}

/* With an extent, which is the factor then, the bounds of radii are narrower; 0 is none. */
static void
radii_that_have_an_extent_are_moderate(void)
{
    static const double fits[] = {0.0, 0x1p-500, 0x1p500}, bad[] = {0x1p-501, 0x1.8p500, 5e-324};
    harness_random      random = {38};
    hs_account          account = new_account();
    hs_levels           levels;
    hs_failure          failure;
    reach_fill(&random, 50, 2, 1.0, 1, 1.0, &points);
    reach_fill(&random, 30, 2, 1.0, 1, 1.0, &queries);
    hs_reach reach = {
        .rule = HS_RULE_MAX, .radii = points.radii, .query_radii = queries.radii, .extent = 0.625};
    for (int e = 0; e < 3; e++) {
        points.radii[9] = fits[e];
        CHECK(divide(&reach, true, &account, &levels, &failure) == HS_OK);
        CHECK(levels.factor == 0.625 && radii_ascend(&levels.points, levels.n, &points, false));
        hs_levels_free(&account, &levels);
    }
    for (int e = 0; e < 3; e++) {
        points.radii[9] = bad[e];
        reach.extent = 0.625;
        is_refused(&reach, HS_ERR_RADII, 9, false);
        reach.extent = e; /* 0 is as 1, which bounds nothing; 2 does */
        if (e == 2) {
            is_refused(&reach, HS_ERR_RADII, 9, false);
        } else {
            CHECK(divide(&reach, true, &account, &levels, &failure) == HS_OK);
            CHECK(levels.factor == 1.0);
            hs_levels_free(&account, &levels);
        }
    }
    close_account(&account);
}

static void
bad_types_and_tables_are_refused(void)
{
    double         table[4] = {1.0, 2.0, 2.0, 3.0};
    harness_random random = {35};
    reach_fill(&random, 50, 2, 1.0, 1, 1.0, &points);
    reach_fill(&random, 30, 2, 1.0, 1, 1.0, &queries);
    const hs_reach reach = {
        .n_types = 2, .types = points.types, .query_types = queries.types, .cutoffs = table};
    for (int i = 0; i < 50; i++)
        points.types[i] = queries.types[i] = i % 2;
    queries.types[29] = 2;
    is_refused(&reach, HS_ERR_TYPES, 29, true);
    points.types[1] = INT32_MIN;
    is_refused(&reach, HS_ERR_TYPES, 1, false);
    points.types[1] = queries.types[29] = 1;
    for (int e = 0; e < 4; e++) {
        static const double wrong[] = {NAN, INFINITY, -INFINITY, 2.5};
        table[2] = wrong[e];
        is_refused(&reach, HS_ERR_CUTOFF, -1, false);
    }
    table[2] = 2.0;
    table[3] = NAN; /* no point need be of such types */
    is_refused(&reach, HS_ERR_CUTOFF, -1, false);
}

static hs_status
divide_once(void *context)
{
    hs_account      account = new_account();
    hs_levels       levels;
    hs_failure      failure;
    const hs_status status = divide(context, true, &account, &levels, &failure);
    CHECK(status == HS_OK || levels.points.rows == NULL);
    hs_levels_free(&account, &levels);
    close_account(&account);
    return status;
}

static void
nothing_leaks_when_memory_is_short(void)
{
    double         table[REACH_TYPES * REACH_TYPES] = {0.0};
    harness_random random = {36};
    reach_fill(&random, 50, 2, 1.0, 2, 1.0, &points);
    reach_fill(&random, 30, 2, 1.0, 2, 1.0, &queries);
    hs_reach reach = {.rule = HS_RULE_SUM, .radii = points.radii, .query_radii = queries.radii};
    CHECK(fail_each_allocation(divide_once, &reach, 100) > 12);
    reach = (hs_reach){.n_types = REACH_TYPES,
                       .types = points.types,
                       .query_types = queries.types,
                       .cutoffs = table};
    CHECK(fail_each_allocation(divide_once, &reach, 100) > 12);
}

/* Points of a slice are those of its levels, where they are. */
static void
slices_are_points_in_place(void)
{
    const hs_reach reach = {.rule = HS_RULE_MIN, .radii = points.radii};
    hs_account     account = new_account();
    hs_levels      levels;
    hs_failure     failure;
    harness_random random = {37};
    reach_fill(&random, 200, 3, 1.0, 2, 1.0, &points);
    CHECK(divide(&reach, false, &account, &levels, &failure) == HS_OK);
    for (int64_t first = 0; first < levels.n; first++) {
        for (int64_t end = first; end <= levels.n; end++) {
            const hs_points slice = hs_level_points(&levels.points, (hs_slice){first, end});
            CHECK(slice.n == levels.points.first[end] - levels.points.first[first]);
            CHECK(slice.data == levels.points.rows + 3 * levels.points.first[first]);
            CHECK(slice.ndim == 3 && slice.real == HS_FLOAT64);
            CHECK(slice.row_stride == 24 && slice.column_stride == 8);
        }
    }
    hs_levels_free(&account, &levels);
    close_account(&account);
}

/* Every poll of a division of many points: the one that says no ends it, and nothing is left. */
static void
a_division_can_be_stopped(void)
{
    enum { MANY = 2 * HS_POLL_POINTS + 9 };
    static double   x[MANY], numbers[MANY];
    static int32_t  types[MANY];
    const double    cutoff = 1.0;
    const hs_points p = {x, MANY, 1, HS_FLOAT64, sizeof *x, sizeof *x};
    const hs_reach  reaches[] = {
         {.rule = HS_RULE_SUM, .radii = numbers, .query_radii = numbers},
         {.n_types = 1, .types = types, .query_types = types, .cutoffs = &cutoff},
         {.rule = HS_RULE_MAX,
          .has_supports = true,
          .extent = 1.0,
          .supports = numbers,
          .query_supports = numbers},
    };
    for (int64_t i = 0; i < MANY; i++) {
        x[i] = (double)i;
        numbers[i] = 1.0;
    }
    for (int kind = 0; kind < 3; kind++) {
        refusal    once = {.nth = 0};
        hs_options options = hs_options_default();
        hs_levels  levels;
        options.poll = refuse_once;
        options.poll_context = &once;
        for (int has_queries = 0; has_queries < 2; has_queries++) {
            hs_account account = new_account();
            hs_failure failure = HS_NO_FAILURE;
            once = (refusal){.nth = 0};
            CHECK(hs_levels_divide(&account, &options, &p, has_queries ? &p : NULL, &reaches[kind],
                                   &levels, &failure) == HS_OK);
            hs_levels_free(&account, &levels);
            const int64_t n = once.n;
            CHECK(n >= (kind == 1 ? 6 : 8) * (has_queries + 1));
            for (int64_t nth = 1; nth <= n; nth += n > 40 && nth > 2 && nth < n - 12 ? 9 : 1) {
                once = (refusal){.nth = nth};
                CHECK(hs_levels_divide(&account, &options, &p, has_queries ? &p : NULL,
                                       &reaches[kind], &levels, &failure) == HS_ERR_INTERRUPTED);
                CHECK(once.n == nth && account.held == 0 && levels.n == 0);
            }
            close_account(&account);
        }
    }
}

void
test_levels(void)
{
    RUN(a_division_can_be_stopped);
    RUN(points_are_divided_by_their_radii);
    RUN(sets_without_radii_are_of_one_level);
    RUN(levels_are_binary_orders);
    RUN(points_are_divided_by_their_types);
    RUN(bad_numbers_are_refused);
    RUN(radii_that_have_an_extent_are_moderate);
    RUN(bad_types_and_tables_are_refused);
    RUN(nothing_leaks_when_memory_is_short);
    RUN(slices_are_points_in_place);
}
