/* SPDX-License-Identifier: BSD-3-Clause */
/* test_limits.c: limits of each pair by radii, types or supports. */
#include "../../../csrc/core/levels/levels.h"
#include "../../../csrc/core/search/limits.h"
#include "../../../csrc/core/search/walk.h"
#include "../support/harness.h"

#include <math.h>

void test_limits(void);

enum { N = 120 };

/* Points and their supports; side 1: queries. */
static double x[2][N * 3], matrices[2][N * 9];

/* What is asked of them. */
typedef struct question {
    int          ndim;
    hs_rule      rule;
    double       unit; /* of the points; the supports are over it */
    double       extent, bound;
    bool         is_strict, has_queries, is_ordered;
    hs_precision precision;
    double       error; /* beyond the filter's own */
} question;

static void
fill(harness_random *random, int ndim, int bits, double unit)
{
    const unsigned steps = 1u << bits;
    for (int side = 0; side < 2; side++) {
        for (int e = 0; e < N * ndim; e++)
            x[side][e] = ldexp((double)(random_bits(random) % steps), -bits) * unit;
        for (int i = 0; i < N; i++) {
            double *own = matrices[side] + i * ndim * ndim;
            for (int k = 0; k < ndim; k++) {
                for (int l = 0; l < k; l++)
                    own[k * ndim + l] = own[l * ndim + k] =
                        (0.5 * (double)(random_bits(random) % 3) - 0.5) / unit;
                own[k * ndim + k] = (4.0 + (double)(random_bits(random) % 4)) / unit;
            }
        }
    }
}

/* |D| and |H D| against the bound and the extent in float64, which these small numbers do not
 * round. */
static bool
is_within(const question *ask, const double *matrix, const double *p, const double *q)
{
    double       square = 0.0, distance = 0.0;
    const int    ndim = ask->ndim;
    const double limit = ask->extent * ask->extent, bound = ask->bound / ask->unit;
    for (int k = 0; k < ndim; k++) {
        double       z = 0.0;
        const double along = (q[k] - p[k]) / ask->unit;
        for (int l = 0; l < ndim; l++)
            z += matrix[k * ndim + l] * ask->unit * ((q[l] - p[l]) / ask->unit);
        square += z * z;
        distance += along * along;
    }
    return ask->is_strict ? square < limit && distance < bound * bound
                          : square <= limit && distance <= bound * bound;
}

static int64_t
expect(const question *ask)
{
    const int asking = ask->has_queries, d = ask->ndim;
    int64_t   n = 0;
    for (int i = 0; i < N; i++) {
        for (int j = asking ? 0 : i + 1; j < N; j++) {
            const double *p = x[asking] + i * d, *q = x[0] + j * d;
            const bool    a = is_within(ask, matrices[asking] + i * d * d, p, q);
            const bool    b = is_within(ask, matrices[0] + j * d * d, p, q);
            n += ask->rule == HS_RULE_MAX      ? a || b
                 : ask->rule == HS_RULE_MIN    ? a && b
                 : ask->rule == HS_RULE_GATHER ? a
                                               : b;
        }
    }
    return n;
}

/* Lanes behind the last candidate are zeros, which no kernel takes long for. */
static void
check_lanes(const hs_scanner *scanner)
{
    const hs_block *block = &scanner->block;
    const int       n_numbers = hs_support_numbers(scanner->search->scene.ndim);
    int             wrong = 0;
    for (int e = 0; e < n_numbers; e++) {
        const float *row = block->radius + e * block->pitch;
        for (int32_t c = block->n; c < block->n + HS_PADDING; c++)
            wrong += row[c] != 0.0f;
    }
    CHECK(wrong == 0);
}

static hs_status
count_pairs(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    (void)first;
    if (scanner->search->limits->supports->of_points.near != NULL)
        check_lanes(scanner);
    *(int64_t *)context += hits->end[hits->n - 1];
    return HS_OK;
}

static void
add_stages(const hs_stages *more, hs_stages *stages)
{
    stages->by_float64 += more->by_float64;
    stages->by_double_word += more->by_double_word;
    stages->by_integers += more->by_integers;
}

/* The pairs of one open step: counted, or listed from whole neighbourhoods. */
static int64_t
count_step(const question *ask, hs_search *search, hs_stages *stages)
{
    const int32_t    n = (int32_t)hs_search_asking(search)->n;
    int64_t          found = 0;
    hs_walker        walker;
    hs_neighbourhood most;
    search->filter_error += ask->error;
    if (ask->is_ordered) {
        CHECK(hs_walker_bound(search, &most));
        CHECK(hs_walker_init(search, HS_BLOCK_LISTS_PLACES, &most, count_pairs, &found, &walker) ==
              HS_OK);
    } else {
        CHECK(hs_walker_init(search, HS_BLOCK_COUNTS, NULL, NULL, NULL, &walker) == HS_OK);
    }
    CHECK(hs_walk(&walker, 0, n, &(hs_failure){.row = -1}) == HS_OK);
    CHECK(!ask->is_ordered || walker.scanner.n_found == found);
    found = walker.scanner.n_found;
    add_stages(&walker.scanner.stages, stages);
    hs_walker_close(search, &walker);
    return found;
}

static hs_points
points_of(int side, int ndim)
{
    return (hs_points){x[side],       N, ndim, HS_FLOAT64, ndim * (ptrdiff_t)sizeof(double),
                       sizeof(double)};
}

static int64_t
count_with(const question *ask, hs_stages *stages)
{
    const hs_reach  reach = {.rule = ask->rule, .has_supports = true, .extent = ask->extent};
    const hs_set    points = {.at = points_of(0, ask->ndim),
                              .supports = ask->rule == HS_RULE_GATHER ? NULL : matrices[0]};
    const hs_set    queries = {.at = points_of(1, ask->ndim),
                               .supports = ask->rule == HS_RULE_SCATTER ? NULL : matrices[1]};
    hs_options      options = hs_options_default();
    hs_failure      failure;
    hs_call         call;
    hs_levels       levels;
    hs_level_plan   plan;
    hs_level_search open;
    int64_t         n = 0;
    options.cutoff = ask->bound;
    options.inclusive = !ask->is_strict;
    options.precision = ask->precision;
    hs_call_begin(&options, &call);
    CHECK(hs_levels_divide(&call.account, &options, &points, ask->has_queries ? &queries : NULL,
                           &reach, &levels, &failure) == HS_OK);
    CHECK(hs_level_plan_make(&call.account, &levels, NULL, ask->bound, HS_AUTO, &plan) == HS_OK);
    plan.is_half = plan.is_half && !ask->is_ordered;
    for (int64_t s = 0; s < plan.n; s++) {
        CHECK(hs_level_open(&plan, s, NULL, false, &call, &open, &failure) == HS_OK);
        CHECK(open.search.limits != NULL && open.search.limits->supports == &open.supports);
        n += count_step(ask, &open.search, stages);
        hs_level_close(&open);
    }
    hs_level_plan_free(&call.account, &plan);
    hs_levels_free(&call.account, &levels);
    hs_call_dismiss(&call);
    CHECK(call.account.held == 0);
    hs_account_close(&call.account);
    return n;
}

static int64_t
decided(const hs_stages *stages)
{
    return stages->by_float64 + stages->by_double_word + stages->by_integers;
}

static const double errors[] = {0.0, 1e-3, 0.5, HUGE_VAL};

static void
what_the_filter_leaves_is_decided(void)
{
    static const int units[] = {0, 40, -300, 900, -900};
    harness_random   random = {1501};
    for (int trial = 0; trial < 30; trial++) {
        question ask = {.ndim = 1 + trial % 3,
                        .rule = trial % 2 ? HS_RULE_MAX : HS_RULE_MIN,
                        .unit = ldexp(1.0, units[trial / 3 % 5]),
                        .extent = 1.0,
                        .bound = HUGE_VAL};
        fill(&random, ask.ndim, 6, ask.unit);
        const int64_t expected = expect(&ask);
        int64_t       least = INT64_MAX, most = 0;
        CHECK(expected > 0);
        for (int e = 0; e < 4; e++) {
            hs_stages stages = {0, 0, 0};
            ask.error = errors[e];
            CHECK(count_with(&ask, &stages) == expected);
            const int64_t all = decided(&stages);
            least = all < least ? all : least;
            most = all > most ? all : most;
        }
        /* Without an error beyond its own, the filter leaves next to none. */
        CHECK(most >= expected && 32 * least <= expected);
    }
}

/* On coarse coordinates, where many pairs lie on the surface of a support, or at the cutoff; also in
 * the precisions that round, which do not round these; and from blocks that are put in order. Each
 * unsure pair is decided by one stage. */
static void
every_question_has_its_answer(void)
{
    static const hs_rule      rules[] = {HS_RULE_MAX, HS_RULE_MIN, HS_RULE_GATHER, HS_RULE_SCATTER};
    static const hs_precision precisions[] = {HS_EXACT, HS_DOUBLE, HS_SINGLE};
    harness_random            random = {1502};
    int                       bounded = 0, differ = 0;
    for (int trial = 0; trial < 240; trial++) {
        question ask = {.ndim = 1 + trial % 3,
                        .rule = rules[trial / 3 % 4],
                        .unit = trial % 5 == 4 ? 0x1p900 : 1.0,
                        .extent = 1.0,
                        .is_strict = trial & 1,
                        .precision = trial % 5 == 4 ? HS_EXACT : precisions[trial / 12 % 3],
                        .error = errors[trial / 7 % 4]};
        ask.has_queries = trial / 36 % 2 || trial / 3 % 4 > 1;
        ask.is_ordered = ask.has_queries && trial / 8 % 2;
        ask.bound = trial % 4 == 2 ? 0.125 * ask.unit : HUGE_VAL;
        hs_stages stages = {0, 0, 0};
        fill(&random, ask.ndim, 4, ask.unit);
        const int64_t expected = expect(&ask);
        CHECK(count_with(&ask, &stages) == expected);
        CHECK(ask.precision == HS_EXACT || decided(&stages) == 0);
        question other = ask;
        other.is_strict = !ask.is_strict;
        differ += expect(&other) != expected;
        other = ask;
        other.bound = HUGE_VAL;
        bounded += expect(&other) != expected;
    }
    CHECK(differ > 100 && bounded > 40);
}

/* Digits of an entry this small are lost in the unit of the search, so that floats tell nothing. */
static void
ties_of_entries_far_apart_are_decided_by_integers(void)
{
    harness_random random = {1504};
    for (int strict = 0; strict < 2; strict++) {
        const question ask = {.ndim = 2,
                              .rule = HS_RULE_MAX,
                              .unit = 1.0,
                              .extent = 1.0,
                              .bound = 5.0,
                              .is_strict = strict};
        hs_stages      stages = {0, 0, 0};
        fill(&random, 2, 2, 1.0);
        for (int i = 0; i < N; i++) {
            const double matrix[] = {1.0, 0.0, 0.0, 0x1.8p-1010};
            memcpy(matrices[0] + 4 * i, matrix, sizeof matrix);
            x[0][2 * i] = i == 1 ? 1.0 : 10.0 * i;
            x[0][2 * i + 1] = 0.0;
        }
        CHECK(count_with(&ask, &stages) == !strict);
        CHECK(stages.by_integers == 1);
    }
}

/* With no extent, only what lies on one spot; strictly, nothing. */
static void
no_extent_holds_nothing_but_zero(void)
{
    harness_random random = {1503};
    for (int trial = 0; trial < 12; trial++) {
        question  ask = {.ndim = 1 + trial % 3,
                         .rule = trial % 2 ? HS_RULE_MAX : HS_RULE_MIN,
                         .unit = 1.0,
                         .bound = trial & 4 ? 0.5 : HUGE_VAL,
                         .is_strict = trial >= 6,
                         .error = trial & 1 ? 0.5 : 0.0};
        hs_stages stages = {0, 0, 0};
        fill(&random, ask.ndim, 2, 1.0);
        CHECK(count_with(&ask, &stages) == expect(&ask));
        CHECK((expect(&ask) > 0) == !ask.is_strict);
    }
}

/* Over the extent, in the unit of the search, in the order of the cells; sizes are rounded up. */
static void
kernels_read_what_float32_holds(void)
{
    const double    numbers[] = {1.0 / 3.0, 0.0, 0.25, 0.45, /* 2-D: entries, and a size */
                                 1e29,      0.0, 1e29, 2e29, /* as large as can be */
                                 0x1p-90,   0.0, 1.0,  1.01};
    const int32_t   order[] = {2, 0, 1, 0};
    float           near[16];
    hs_support_side side = {.numbers = numbers, .order = order};
    hs_supports_lay_out(&side, 0, 4, 2, 2.0, 4.0, near);
    CHECK(near[0] == 0x1p-89f && near[1] == 0.0f && near[2] == 2.0f);
    CHECK(near[3] >= 2.02f && near[3] < 2.03f);
    for (int at = 4; at <= 12; at += 8) {
        CHECK(near[at] == (float)(2.0 / 3.0) && near[at + 1] == 0.0f && near[at + 2] == 0.5f);
        CHECK((double)near[at + 3] >= 0.9 && near[at + 3] < 0.91f);
    }
    CHECK(near[8] == 2e29f && near[10] == 2e29f && near[11] >= 4e29f);
    hs_supports_lay_out(&side, 0, 4, 2, 0.0, 4.0, near);
    for (int e = 0; e < 16; e++)
        CHECK(e % 4 == 3 ? near[e] == INFINITY : near[e] == 0.0f);
    hs_supports_lay_out(&side, 0, 4, 2, 1.0, 0x1p300, near);
    for (int e = 0; e < 16; e++)
        CHECK(e % 4 == 3 ? near[e] == INFINITY : near[e] == 0.0f);
    hs_supports_lay_out(&side, 0, 4, 2, 0x1p900, 1.0, near);
    for (int e = 0; e < 16; e++)
        CHECK(e % 4 == 3 ? near[e] == INFINITY : near[e] == 0.0f);
    /* A factor that may have lost digits, which would make these ordinary. */
    const double vast[] = {0x1p1015, 0.0, 0x1p1015, 0x1p1016};
    side = (hs_support_side){.numbers = vast, .order = (int32_t[]){0}};
    hs_supports_lay_out(&side, 0, 1, 2, 0x1p1000, 0x1p-20, near);
    CHECK(near[0] == 0.0f && near[2] == 0.0f && near[3] == INFINITY);
}

void
test_limits(void)
{
    RUN(what_the_filter_leaves_is_decided);
    RUN(every_question_has_its_answer);
    RUN(ties_of_entries_far_apart_are_decided_by_integers);
    RUN(no_extent_holds_nothing_but_zero);
    RUN(kernels_read_what_float32_holds);
}
