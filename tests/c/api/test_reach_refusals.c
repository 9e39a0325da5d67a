/* SPDX-License-Identifier: BSD-3-Clause */
/* test_reach_refusals.c: what is no reach is refused by every function, whatever the failure held
 * before; a search by reach that fails or is ended leaves nothing. */
#include "../support/poll_checks.h"
#include "../support/reach_entries.h"

#include <limits.h>

void test_reach_refusals(void);

/* This entry refuses the present scene, or does not look at what is wrong. */
static void
refuses(entry which, hs_status expected, int64_t row)
{
    const int64_t before = hs_test_live_blocks();
    entry_call    e = entry_of(which);
    if (scene.has_queries && !takes_queries(which)) {
        e.among.queries = NULL;
    }
    const hs_status status = run_entry(&e);
    CHECK(status == expected);
    CHECK(status == HS_OK || e.failure.row == row);
    CHECK(status == HS_OK || e.failure.column == -1);
    CHECK(hs_test_live_blocks() == before);
    if (status != expected)
        fprintf(stderr, "entry %d gives %d\n", (int)which, (int)status);
}

static void
all_refuse(hs_status expected, int64_t row)
{
    for (int which = 0; which < ENTRIES; which++)
        refuses((entry)which, expected, row);
}

static void
make_plain(hs_rule rule, int n_queries)
{
    harness_random random = {30304};
    reach_make(&random, SCENE_ALIGNED, 3, 20, n_queries, rule, 0, &scene);
    for (int e = 0; e < REACH_TYPES * REACH_TYPES; e++)
        scene.table[e] = 0.75;
}

static void
what_is_no_reach_is_refused(void)
{
    make_plain(HS_RULE_SUM, -1);
    all_refuse(HS_OK, -1);
    scene.reach.rule = HS_RULE_END;
    all_refuse(HS_ERR_ARGUMENT, -1);
    scene.reach.rule = (hs_rule)-1;
    all_refuse(HS_ERR_ARGUMENT, -1);
    scene.reach.rule = (hs_rule)INT_MAX;
    all_refuse(HS_ERR_ARGUMENT, -1);
    make_plain(HS_RULE_SUM, -1);
    scene.reach.radii = NULL;
    all_refuse(HS_ERR_ARGUMENT, -1);
    make_plain(HS_RULE_SUM, -1);
    scene.radii[13] = NAN;
    all_refuse(HS_ERR_RADII, 13);
    scene.radii[4] = -1.0;
    all_refuse(HS_ERR_RADII, 4);
    make_plain(HS_RULE_SUM, -1);
    scene.bound = NAN;
    all_refuse(HS_ERR_CUTOFF, -1);
    scene.bound = -1.0;
    all_refuse(HS_ERR_CUTOFF, -1);
    for (int rule = HS_RULE_GATHER; rule <= HS_RULE_SCATTER; rule++) {
        make_plain((hs_rule)rule, -1);
        for (int which = 0; which < ENTRIES; which++)
            refuses((entry)which, which == ROWS || which == ROW_COUNTS ? HS_OK : HS_ERR_ARGUMENT,
                    -1);
    }
}

static void
what_is_no_table_is_refused(void)
{
    make_plain(HS_RULE_END, -1);
    all_refuse(HS_OK, -1);
    scene.reach.n_types = -1;
    all_refuse(HS_ERR_ARGUMENT, -1);
    scene.reach.n_types = INT32_MIN;
    all_refuse(HS_ERR_ARGUMENT, -1);
    make_plain(HS_RULE_END, -1);
    scene.reach.types = NULL;
    all_refuse(HS_ERR_ARGUMENT, -1);
    make_plain(HS_RULE_END, -1);
    scene.reach.cutoffs = NULL;
    all_refuse(HS_ERR_ARGUMENT, -1);
    make_plain(HS_RULE_END, -1);
    scene.types[7] = REACH_TYPES;
    all_refuse(HS_ERR_TYPES, 7);
    scene.types[3] = -1;
    all_refuse(HS_ERR_TYPES, 3);
    make_plain(HS_RULE_END, -1);
    scene.table[1] = 0.5;
    all_refuse(HS_ERR_CUTOFF, -1);
    scene.table[1] = scene.table[REACH_TYPES] = INFINITY;
    all_refuse(HS_ERR_CUTOFF, -1);
    make_plain(HS_RULE_END, -1);
    scene.bound = HUGE_VAL; /* types have no use for it */
    all_refuse(HS_ERR_CUTOFF, -1);
}

/* Types go by no rule, be it one of the two that half lists do not know. */
static void
types_take_any_rule(void)
{
    for (int rule = 0; rule < HS_RULE_END; rule++) {
        make_plain(HS_RULE_END, -1);
        scene.reach.rule = (hs_rule)rule;
        all_refuse(HS_OK, -1);
    }
}

/* Radii count several times where the limit is that of one point; cutoffs of types do not. */
static void
tables_have_no_extent(void)
{
    make_plain(HS_RULE_END, -1);
    for (int rule = HS_RULE_MAX; rule <= HS_RULE_MIN; rule++) {
        make_plain((hs_rule)rule, -1);
        scene.reach.extent = 2.0;
        all_refuse(HS_OK, -1);
        make_plain(HS_RULE_END, -1);
        scene.reach.rule = (hs_rule)rule;
        scene.reach.extent = 2.0;
        all_refuse(HS_ERR_ARGUMENT, -1);
        scene.reach.extent = 0.0;
        all_refuse(HS_OK, -1);
    }
}

/* A shift of -2^31 fits int32, and that of the same pair the other way round does not: of two
 * levels, whose rows are made of pairs and their mirror images. One more box, and no shift fits. */
static void
shifts_that_do_not_fit_name_the_callers_row(void)
{
    const hs_box   box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    double         x[] = {0.0, 0.25, 0x1p31, 0.5}, radii[] = {0.3, 0.001, 0.3, 0.002};
    const hs_reach reach = {.rule = HS_RULE_SUM, .radii = radii, .query_radii = radii};
    hs_points      points = {x, 4, 1, HS_FLOAT64, 8, 8}, queries = points;
    hs_options     options = hs_options_default();
    hs_among       among = {.points = &points, .box = &box, .reach = &reach};
    options.cutoff = 1.0;
    options.algorithm = HS_HIERARCHY;
    for (int further = 0; further < 2; further++) {
        x[2] = 0x1p31 + further;
        for (int wants = 0; wants < 2; wants++) {
            hs_failure failure;
            hs_pairs  *found = NULL;
            options.want = HS_WANT_I | HS_WANT_J | (wants ? HS_WANT_SHIFT : 0);
            memset(&failure, 0x5a, sizeof failure);
            hs_status status = hs_pairs_find(&among, &options, &found, &failure);
            CHECK(status == (wants && further ? HS_ERR_SHIFT_RANGE : HS_OK));
            hs_pairs_free(found);
            status = hs_neighbors_find(&among, &options, &found, &failure);
            CHECK(status == (wants ? HS_ERR_SHIFT_RANGE : HS_OK));
            CHECK(!wants || failure.row == (further ? 0 : 2)); /* as without a reach */
            CHECK(!failure.in_queries || !wants);
            hs_pairs_free(found);
        }
    }
    hs_failure failure;
    hs_pairs  *found = NULL;
    options.want = HS_WANT_SHIFT;
    radii[0] = 0.001; /* now each such pair is one of two levels, of which one asks the other */
    CHECK(hs_pairs_find(&among, &options, &found, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(found == NULL && !failure.in_queries && (failure.row == 0 || failure.row == 2));
    radii[0] = 0.3;
    among.queries = &queries;
    CHECK(hs_neighbors_find(&among, &options, &found, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(found == NULL && failure.row == 0 && failure.in_queries);
}

/* Each set needs the radii that the rule looks at, and no more; sets without points need none. */
static void
both_sets_need_what_the_rule_looks_at(void)
{
    for (int rule = 0; rule <= HS_RULE_END; rule++) {
        for (int lacks = 1; lacks < 4; lacks++) {
            const bool needs_points = rule != HS_RULE_GATHER,
                       needs_queries = rule != HS_RULE_SCATTER;
            const bool is_short = (lacks & 1 && needs_points) || (lacks & 2 && needs_queries);
            for (int empty = 0; empty < 2; empty++) {
                make_plain((hs_rule)rule, 9);
                scene.points.n = empty ? 0 : scene.points.n;
                scene.queries.n = empty ? 0 : scene.queries.n;
                if (lacks & 1) {
                    scene.reach.radii = NULL;
                    scene.reach.types = NULL;
                }
                if (lacks & 2) {
                    scene.reach.query_radii = NULL;
                    scene.reach.query_types = NULL;
                }
                const hs_status status = is_short && !empty ? HS_ERR_ARGUMENT : HS_OK;
                refuses(COUNT, status, -1);
                refuses(ROWS, status, -1);
                refuses(ROW_COUNTS, status, -1);
            }
        }
    }
    make_plain(HS_RULE_GATHER, 9);
    scene.radii[2] = NAN; /* of a point, which is not looked at */
    refuses(ROWS, HS_OK, -1);
    scene.radii[20 + 5] = NAN;
    entry_call e = entry_of(ROWS);
    CHECK(run_entry(&e) == HS_ERR_RADII && e.failure.row == 5 && e.failure.in_queries);
}

/* Other arguments are looked at first, and what they lead to is not. */
static void
other_arguments_are_checked_first(void)
{
    hs_box box;
    make_plain(HS_RULE_GATHER, 9);
    for (int trial = 0; trial < 6; trial++) {
        make_plain(HS_RULE_GATHER, trial < 3 ? 9 : -1);
        box = *scene.among.box;
        scene.among.box = &box;
        switch (trial % 3) {
        case 0: box.ndim = INT_MAX; break;
        case 1: scene.points.ndim = INT_MAX; break;
        default: scene.among.points = NULL;
        }
        all_refuse(HS_ERR_ARGUMENT, -1);
    }
    make_plain(HS_RULE_SUM, -1);
    scene.points.n = INT64_C(1) << 31;
    all_refuse(HS_ERR_TOO_MANY, -1);
    make_plain(HS_RULE_SUM, -1);
    entry_call e = entry_of(FIND);
    e.options.kernel = "abacus";
    CHECK(run_entry(&e) == HS_ERR_KERNEL);
    box = *scene.among.box;
    memcpy(box.rows[1], box.rows[0], sizeof box.rows[0]);
    scene.among.box = &box;
    all_refuse(HS_ERR_BOX_DEPENDENT, -1);
}

/* Also where no two points can be a pair, so that nothing is searched. */
static void
kernel_and_box_are_checked_where_nothing_is_searched(void)
{
    hs_box box;
    make_plain(HS_RULE_END, -1);
    for (int e = 0; e < REACH_TYPES * REACH_TYPES; e++)
        scene.table[e] = -1.0;
    all_refuse(HS_OK, -1);
    box = *scene.among.box;
    memcpy(box.rows[1], box.rows[0], sizeof box.rows[0]);
    scene.among.box = &box;
    all_refuse(HS_ERR_BOX_DEPENDENT, -1);
    for (int which = 0; which < ENTRIES; which++) {
        entry_call e = entry_of((entry)which);
        e.options.kernel = "abacus";
        CHECK(run_entry(&e) == HS_ERR_KERNEL && e.failure.row == -1);
    }
}

/* Functions that go by one cutoff do not overlook a reach. */
static void
other_functions_refuse_a_reach(void)
{
    double             edge = 0.5;
    int64_t            counts[1];
    const hs_histogram histogram = {.n_edges = 1, .edges = &edge, .n_types = 1, .counts = counts};
    make_plain(HS_RULE_SUM, -1);
    const hs_options options = reach_options(&scene);
    hs_failure       failure;
    hs_pairs        *rows = CALL_NOTHING;
    memset(&failure, 0x5a, sizeof failure);
    CHECK(hs_pairs_histogram(&scene.among, &options, &histogram, &failure) == HS_ERR_ARGUMENT);
    CHECK(failure.row == -1 && failure.column == -1 && failure.system == -1);
    memset(&failure, 0x5a, sizeof failure);
    CHECK(hs_nearest_find(&scene.among, 3, &options, &rows, &failure) == HS_ERR_ARGUMENT);
    CHECK(rows == NULL && failure.row == -1);
}

typedef struct expectation {
    entry_call call;
    uint64_t   answer;
} expectation;

/* A call that says it succeeded has the answer. */
static hs_status
run_and_compare(void *context)
{
    expectation    *expected = context;
    const hs_status status = run_entry(&expected->call);
    CHECK(status != HS_OK || expected->call.answer == expected->answer);
    return status;
}

/* Whichever allocation fails: nothing leaks, and the next call finds all again. */
static void
every_entry_fails_cleanly(void)
{
    harness_random random = {30305};
    for (int trial = 0; trial < 2 * (HS_RULE_END + 1); trial++) {
        reach_make(&random, (scene_kind)(trial % SCENE_KINDS), 2, 40, trial % 2 ? 15 : -1,
                   (hs_rule)(trial / 2), 0, &scene);
        for (int which = 0; which < ENTRIES; which++) {
            entry_call e = entry_of((entry)which);
            if (run_entry(&e) != HS_OK) {
                continue;
            }
            expectation again = {entry_of((entry)which), e.answer};
            CHECK(fail_each_allocation(run_and_compare, &again, 4000) > 10);
            check_arena(run_and_compare, &again);
            CHECK(run_and_compare(&again) == HS_OK);
        }
    }
}

void
test_reach_refusals(void)
{
    RUN(what_is_no_reach_is_refused);
    RUN(what_is_no_table_is_refused);
    RUN(types_take_any_rule);
    RUN(tables_have_no_extent);
    RUN(shifts_that_do_not_fit_name_the_callers_row);
    RUN(both_sets_need_what_the_rule_looks_at);
    RUN(other_arguments_are_checked_first);
    RUN(kernel_and_box_are_checked_where_nothing_is_searched);
    RUN(other_functions_refuse_a_reach);
    RUN(every_entry_fails_cleanly);
}
