/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_reach.c: pairs by reach: radii, types and supports, in every call that takes them. */
#include "../support/block_checks.h"
#include "../support/calls.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"

void test_api_reach(void);

/* Scenes in which each pair has a reach of its own. */

enum { REACH_TYPES = 4, REACH_STYLES = 5 };

typedef struct reach_scene {
    random_scene of; /* the points, and behind them the queries */
    int64_t      n, n_queries;
    bool         has_queries;
    double       radii[SCENE_POINTS];
    int32_t      types[SCENE_POINTS];
    double       table[REACH_TYPES * REACH_TYPES];
    double       bound;
    hs_reach     reach; /* points to the rest, as these do */
    hs_set       points, queries;
    hs_among     among;
} reach_scene;

/* 0: quarters; 1: tenths, whose sums are no float64s; 2: of many orders; 3: all one; 4: what the
 * distance to another point leaves, so that the two just touch, or just do not. */
static double
reach_radius(harness_random *random, int style, int64_t i, const reach_scene *s)
{
    const int64_t other = random_below(random, (int)(s->n + s->n_queries));
    const int     d = s->of.scene.ndim;
    double        square = 0.0;
    switch (style) {
    case 0: return 0.25 * random_below(random, 6);
    case 1: return 0.1 * random_below(random, 12);
    case 2: return ldexp(1.2 * random_unit(random), -random_below(random, 14));
    case 3: return 0.7;
    }
    for (int k = 0; k < d; k++) {
        const double along = s->of.x[i * d + k] - s->of.x[other * d + k];
        square += along * along;
    }
    const double left = sqrt(square) - (other < i ? s->radii[other] : 0.0);
    return left >= 0.0 && left < 2.0 ? left : 0.3;
}

static void
reach_connect(hs_rule rule, bool has_types, reach_scene *s)
{
    const ptrdiff_t row = s->of.scene.ndim * (ptrdiff_t)sizeof(double);
    s->reach = has_types ? (hs_reach){.rule = rule, .n_types = REACH_TYPES, .cutoffs = s->table}
                         : (hs_reach){.rule = rule};
    s->points = (hs_set){.at = {s->of.x, s->n, s->of.scene.ndim, HS_FLOAT64, row, sizeof(double)},
                         .radii = s->radii,
                         .types = s->types};
    s->queries = (hs_set){.at = s->points.at, .radii = s->radii + s->n, .types = s->types + s->n};
    s->queries.at.data = s->of.x + s->n * s->of.scene.ndim;
    s->queries.at.n = s->n_queries;
    s->among = (hs_among){.points = &s->points,
                          .box = s->of.scene.box,
                          .queries = s->has_queries ? &s->queries : NULL,
                          .reach = &s->reach};
}

/* n_queries: -1 for none. The rule HS_RULE_END: types. Everything times 2^exponent. */
static void
reach_make(harness_random *random, scene_kind kind, int ndim, int n, int n_queries, hs_rule rule,
           int exponent, reach_scene *s)
{
    const int    style = random_below(random, REACH_STYLES);
    const bool   has_types = rule == HS_RULE_END;
    const double size = ndim <= 2 ? 1.0 : ndim == 3 ? 0.7 : 0.4;
    s->has_queries = n_queries >= 0;
    s->n = n;
    s->n_queries = s->has_queries ? n_queries : 0;
    make_scene(random, kind, ndim, n + (int)s->n_queries, 4.0, exponent, &s->of);
    for (int e = 0; e < (n + s->n_queries) * ndim; e++)
        s->of.x[e] = ldexp(s->of.x[e], -exponent);
    for (int64_t i = 0; i < n + s->n_queries; i++) {
        s->radii[i] = reach_radius(random, style, i, s) * (style == 4 ? 1.0 : size);
        s->types[i] = random_below(random, REACH_TYPES);
    }
    for (int64_t i = 0; i < n + s->n_queries; i++)
        s->radii[i] = ldexp(s->radii[i], exponent);
    for (int e = 0; e < (n + s->n_queries) * ndim; e++)
        s->of.x[e] = ldexp(s->of.x[e], exponent);
    for (int a = 0; a < REACH_TYPES; a++) {
        for (int b = 0; b <= a; b++) {
            const double cutoff = random_below(random, 5) ? size * 2.0 * random_unit(random) : -0.5;
            const double kept = random_below(random, 3) ? cutoff : 0.25 * random_below(random, 8);
            s->table[a * REACH_TYPES + b] = s->table[b * REACH_TYPES + a] = ldexp(kept, exponent);
        }
    }
    s->bound = has_types ? 0x1p1000 : random_below(random, 3) ? HUGE_VAL : ldexp(0.75, exponent);
    reach_connect(has_types ? HS_RULE_SUM : rule, has_types, s);
}

static hs_options
reach_options(const reach_scene *s)
{
    hs_options options = options_of(&s->of.scene);
    options.cutoff = s->bound;
    return options;
}

/* ---- every function that knows a reach for each pair, behind one signature ---- */

static reach_scene scene_entries; /* the present one */

/* One call of each function; its answer is a hash of what it gave, of the pairs in any order for
 * visits. */
typedef enum entry { FIND, SORTED, COUNT, ROWS, ROW_COUNTS, STREAM, VISIT, ENTRIES } entry;

typedef struct entry_call {
    entry      which;
    hs_among   among;
    hs_options options;
    hs_failure failure;
    uint64_t   answer;
} entry_call;

static hs_status
run_entry(void *context)
{
    entry_call    *e = context;
    const hs_visit visit = {.pair = call_note_pair, .thread_safe = true};
    hs_options     options = e->options;
    call           c = {.options = &options,
                        .has_result = true,
                        .visit = &visit,
                        .max_pairs = 7,
                        .ndim = scene_entries.of.scene.ndim,
                        .index_bytes = 8};
    hs_pairs      *pairs = CALL_NOTHING;
    hs_stream     *stream = CALL_NOTHING;
    int64_t        count = -7, counts[CALL_ROOM] = {0};
    hs_status      status;
    memset(&e->failure, 0x5a, sizeof e->failure);
    options.sorted = e->which == SORTED;
    call_visited = 0;
    switch (e->which) {
    case COUNT:
        status = hs_pairs_count(&e->among, &options, &count, &e->failure);
        status = call_take_count(&c, status, count);
        break;
    case ROWS:
        status = hs_neighbors_find(&e->among, &options, &pairs, &e->failure);
        status = call_take_pairs(&c, status, pairs);
        break;
    case ROW_COUNTS:
        status = hs_neighbors_count(&e->among, &options, counts, &e->failure);
        status = call_take_counts(&c, status, counts, CALL_ROOM);
        break;
    case STREAM:
        status = hs_stream_open(&e->among, &options, c.max_pairs, &stream, &e->failure);
        status = call_take_stream(&c, status, stream, &e->failure);
        break;
    case VISIT:
        status = hs_pairs_visit(&e->among, &options, &visit, &count, &e->failure);
        status = call_take_visits(&c, status, count);
        break;
    default:
        status = hs_pairs_find(&e->among, &options, &pairs, &e->failure);
        status = call_take_pairs(&c, status, pairs);
    }
    e->answer = c.answer;
    return status;
}

/* A call of the present scene, with everything wanted. */
static entry_call
entry_of(entry which)
{
    entry_call e = {
        .which = which, .among = scene_entries.among, .options = reach_options(&scene_entries)};
    e.options.want = WANT_ALL;
    return e;
}

static bool
takes_queries(entry which)
{
    return which == COUNT || which == ROWS || which == ROW_COUNTS;
}

/*
 * ---- by reach ----
 *
 * Streams, visits, cells and threads give the pairs of hs_pairs_find when each pair has a reach of
 * its own.
 */

enum { MANY = 40000 };

static double  many_x[3 * MANY], many_radii[MANY];
static int32_t many_types[MANY];

/* rule: HS_RULE_END for types. */
static hs_among
make_many(hs_rule rule, hs_set *points, hs_reach *reach)
{
    static const double table[] = {0.02, 0.04, 0.04, -1.0};
    harness_random      random = {30303};
    for (int e = 0; e < 3 * MANY; e++)
        many_x[e] = random_unit(&random);
    for (int i = 0; i < MANY; i++) {
        many_radii[i] = ldexp(0.03 * (0.5 + random_unit(&random)), -(i % 8 == 0));
        many_types[i] = i % 2;
    }
    *points = (hs_set){
        .at = {many_x, MANY, 3, HS_FLOAT64, 24, 8}, .radii = many_radii, .types = many_types};
    *reach = (hs_reach){.rule = rule};
    if (rule == HS_RULE_END) {
        *reach = (hs_reach){.n_types = 2, .cutoffs = table};
    }
    return (hs_among){.points = points, .reach = reach};
}

/* Threads divide so many points: the same bits, whatever their number. */
static void
threads_make_no_difference(void)
{
    for (int rule = 0; rule <= HS_RULE_END; rule += IS_SLOW ? 2 : 1) {
        hs_set         points;
        hs_reach       reach;
        const hs_among among = make_many((hs_rule)rule, &points, &reach);
        hs_options     options = hs_options_default();
        hs_pairs      *rows[2] = {NULL, NULL};
        options.cutoff = 1.0;
        options.want = WANT_ALL;
        for (int many = 0; many < 2; many++) {
            options.threads = many ? 4 : 1;
            CHECK(hs_neighbors_find(&among, &options, &rows[many], NULL) == HS_OK);
        }
        CHECK(hs_pairs_length(rows[0]) > MANY / 20);
        CHECK(hs_pairs_length(rows[0]) == hs_pairs_length(rows[1]));
        CHECK(block_matches(rows[0], rows[1], 0, 3));
        hs_pairs_free(rows[0]);
        hs_pairs_free(rows[1]);
    }
}

/* A poll that says no once ends any of them. */
static void
one_refusal_ends_any_entry(void)
{
    hs_set   points;
    hs_reach reach;
    memset(&scene_entries, 0, sizeof scene_entries);
    scene_entries.of.scene.ndim = 3;
    for (int which = 0; which < ENTRIES; which++) {
        refusal    once = {0};
        entry_call e = {.which = (entry)which,
                        .among = make_many(HS_RULE_SUM, &points, &reach),
                        .options = hs_options_default()};
        if (which == ROW_COUNTS || which == STREAM) { /* whose polls come with the blocks */
            continue;
        }
        e.options.cutoff = 1.0;
        e.options.poll = refuse_once;
        e.options.poll_context = &once;
        CHECK(run_entry(&e) == HS_OK);
        const int64_t polls = once.n, step = 1 + polls / (IS_SLOW ? 3 : 6);
        CHECK(polls > 0);
        for (int64_t nth = 1; nth <= polls; nth += step) {
            once = (refusal){.nth = nth};
            CHECK(run_entry(&e) == HS_ERR_INTERRUPTED && once.n == nth);
        }
    }
}

/* Where nothing is rounded, float32 and the formula of float64 find what exact arithmetic does. */
static void
precisions_agree_on_small_integers(void)
{
    static reach_scene s;
    harness_random     random = {20263};
    for (int trial = 0; trial < TRIALS(300); trial++) {
        const hs_rule rule = (hs_rule)(trial % (HS_RULE_END + 1));
        hs_pairs     *exact = NULL;
        reach_make(&random, SCENE_OPEN, 1 + trial % 3, 25, trial % 5 ? -1 : 9, rule, 0, &s);
        for (int e = 0; e < 34 * s.of.scene.ndim; e++)
            s.of.x[e] = (double)random_below(&random, 6);
        for (int i = 0; i < 34; i++)
            s.radii[i] = 0.5 * random_below(&random, 5);
        for (int e = 0; e < REACH_TYPES * REACH_TYPES; e++)
            s.table[e] = (e % REACH_TYPES + e / REACH_TYPES) % 5 - (trial % 2);
        for (int precision = HS_EXACT; precision <= HS_SINGLE; precision++) {
            hs_options options = reach_options(&s);
            hs_pairs  *rows = NULL;
            options.precision = (hs_precision)precision;
            CHECK(hs_neighbors_find(&s.among, &options, &rows, NULL) == HS_OK);
            exact = precision == HS_EXACT ? rows : exact;
            const size_t bytes = 8 * (size_t)hs_pairs_length(exact);
            CHECK(hs_pairs_length(rows) == hs_pairs_length(exact));
            for (unsigned which = HS_WANT_I; which <= HS_WANT_J; which *= 2)
                CHECK(memcmp(hs_pairs_array(rows, which), hs_pairs_array(exact, which), bytes) ==
                      0);
            if (precision != HS_EXACT)
                hs_pairs_free(rows);
        }
        hs_pairs_free(exact);
    }
}

/*
 * ---- reach supports ----
 *
 * Searches by supports through the public functions: all of them find what a plain loop finds,
 * whatever the kernel and the threads are.
 */

static double own[SCENE_POINTS * 9], of_queries[SCENE_POINTS * 9];

/* Whole numbers over 16: nothing is rounded. The points stay those of the scene. */
static void
fill_matrices(harness_random *random, int ndim, double *to)
{
    for (int i = 0; i < SCENE_POINTS; i++) {
        double *m = to + i * ndim * ndim;
        for (int k = 0; k < ndim; k++)
            for (int l = 0; l <= k; l++)
                m[k * ndim + l] = m[l * ndim + k] = k == l ? 2.0 + random_below(random, 5)
                                                           : 0.25 * random_below(random, 4);
    }
}

static void
make(harness_random *random, hs_rule rule, int ndim, int n_queries)
{
    reach_make(random, SCENE_ALIGNED, ndim, 24, n_queries, HS_RULE_MAX, 0, &scene_entries);
    for (int64_t e = 0; e < (scene_entries.n + scene_entries.n_queries) * ndim; e++)
        scene_entries.of.x[e] = ldexp(floor(ldexp(scene_entries.of.x[e], 6)), -6);
    fill_matrices(random, ndim, own);
    fill_matrices(random, ndim, of_queries);
    scene_entries.bound = HUGE_VAL;
    scene_entries.of.scene.inclusive = true;
    scene_entries.points.supports = own;
    scene_entries.queries.supports = of_queries;
    scene_entries.reach = (hs_reach){.rule = rule, .has_supports = true, .extent = 2.0};
}

static void
is_refused(entry which, hs_status expected, int64_t row)
{
    const int64_t before = hs_test_live_blocks();
    entry_call    e = entry_of(which);
    CHECK(run_entry(&e) == expected);
    CHECK(expected == HS_OK || e.failure.row == row);
    if (expected == HS_ERR_EXTENT)
        CHECK(memcmp(&e.failure.value, &scene_entries.reach.extent, sizeof(double)) == 0);
    CHECK(hs_test_live_blocks() == before);
}

static void
all_refuse(hs_status expected, int64_t row)
{
    for (int which = 0; which < ENTRIES; which++)
        is_refused((entry)which, expected, row);
}

static void
bad_supports_are_refused(void)
{
    static const double extents[] = {-1.0, NAN, INFINITY, -5e-324};
    harness_random      random = {4243};
    make(&random, HS_RULE_MAX, 3, -1);
    all_refuse(HS_OK, -1);
    for (int e = 0; e < 4; e++) {
        scene_entries.reach.extent = extents[e];
        all_refuse(HS_ERR_EXTENT, -1);
    }
    scene_entries.reach.extent = 2.0;
    for (int e = 0; e < 9; e++)
        own[6 * 9 + e] *= 0x1p-1040;
    all_refuse(HS_ERR_SUPPORT_REACH, 6);
    own[5 * 9] = 0.0;
    all_refuse(HS_ERR_SUPPORTS, 5);
    own[3 * 9 + 1] += 0.25;
    all_refuse(HS_ERR_SUPPORTS, 3);
    scene_entries.points.supports = NULL;
    all_refuse(HS_ERR_ARGUMENT, -1);
    make(&random, HS_RULE_SUM, 3, -1);
    all_refuse(HS_ERR_ARGUMENT, -1);
    make(&random, HS_RULE_MEAN, 3, -1);
    all_refuse(HS_ERR_ARGUMENT, -1);
    make(&random, HS_RULE_MAX, 3, -1);
    scene_entries.reach.n_types = 1;
    scene_entries.reach.cutoffs = scene_entries.table;
    all_refuse(HS_ERR_ARGUMENT, -1);
    reach_make(&random, SCENE_ALIGNED, 4, 20, -1, HS_RULE_MAX, 0, &scene_entries);
    scene_entries.points.supports = own;
    scene_entries.reach = (hs_reach){.rule = HS_RULE_MAX, .has_supports = true, .extent = 1.0};
    all_refuse(HS_ERR_ARGUMENT, -1);
}

/* ---- what is no reach is refused by every function, whatever the failure held before ---- */

/* This entry refuses the present scene, or does not look at what is wrong. */
static void
refuses(entry which, hs_status expected, int64_t row)
{
    const int64_t before = hs_test_live_blocks();
    entry_call    e = entry_of(which);
    if (scene_entries.has_queries && !takes_queries(which)) {
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
all_refuse_refusals(hs_status expected, int64_t row)
{
    for (int which = 0; which < ENTRIES; which++)
        refuses((entry)which, expected, row);
}

static void
make_plain(hs_rule rule, int n_queries)
{
    harness_random random = {30304};
    reach_make(&random, SCENE_ALIGNED, 3, 20, n_queries, rule, 0, &scene_entries);
    for (int e = 0; e < REACH_TYPES * REACH_TYPES; e++)
        scene_entries.table[e] = 0.75;
}

static void
what_is_no_table_is_refused(void)
{
    make_plain(HS_RULE_END, -1);
    all_refuse_refusals(HS_OK, -1);
    scene_entries.reach.n_types = -1;
    all_refuse_refusals(HS_ERR_ARGUMENT, -1);
    scene_entries.reach.n_types = INT32_MIN;
    all_refuse_refusals(HS_ERR_ARGUMENT, -1);
    make_plain(HS_RULE_END, -1);
    scene_entries.points.types = NULL;
    all_refuse_refusals(HS_ERR_ARGUMENT, -1);
    make_plain(HS_RULE_END, -1);
    scene_entries.reach.cutoffs = NULL;
    all_refuse_refusals(HS_ERR_ARGUMENT, -1);
    make_plain(HS_RULE_END, -1);
    scene_entries.types[7] = REACH_TYPES;
    all_refuse_refusals(HS_ERR_TYPES, 7);
    scene_entries.types[3] = -1;
    all_refuse_refusals(HS_ERR_TYPES, 3);
    make_plain(HS_RULE_END, -1);
    scene_entries.table[1] = 0.5;
    all_refuse_refusals(HS_ERR_CUTOFF, -1);
    scene_entries.table[1] = scene_entries.table[REACH_TYPES] = INFINITY;
    all_refuse_refusals(HS_ERR_CUTOFF, -1);
    make_plain(HS_RULE_END, -1);
    scene_entries.bound = HUGE_VAL; /* types have no use for it */
    all_refuse_refusals(HS_ERR_CUTOFF, -1);
}

/* Types go by no rule, be it one of the two that half lists do not know. */
static void
types_take_any_rule(void)
{
    for (int rule = 0; rule < HS_RULE_END; rule++) {
        make_plain(HS_RULE_END, -1);
        scene_entries.reach.rule = (hs_rule)rule;
        all_refuse_refusals(HS_OK, -1);
    }
}

/* Radii count several times where the limit is that of one point; cutoffs of types do not. */
static void
tables_have_no_extent(void)
{
    make_plain(HS_RULE_END, -1);
    for (int rule = HS_RULE_MAX; rule <= HS_RULE_MIN; rule++) {
        make_plain((hs_rule)rule, -1);
        scene_entries.reach.extent = 2.0;
        all_refuse_refusals(HS_OK, -1);
        make_plain(HS_RULE_END, -1);
        scene_entries.reach.rule = (hs_rule)rule;
        scene_entries.reach.extent = 2.0;
        all_refuse_refusals(HS_ERR_ARGUMENT, -1);
        scene_entries.reach.extent = 0.0;
        all_refuse_refusals(HS_OK, -1);
    }
}

/* A shift of -2^31 fits int32, and that of the same pair the other way round does not: of two
 * levels, whose rows are made of pairs and their mirror images. One more box, and no shift fits. */
static void
shifts_that_do_not_fit_name_the_callers_row(void)
{
    const hs_box   box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    double         x[] = {0.0, 0.25, 0x1p31, 0.5}, radii[] = {0.3, 0.001, 0.3, 0.002};
    const hs_reach reach = {.rule = HS_RULE_SUM};
    hs_points      points = {x, 4, 1, HS_FLOAT64, 8, 8};
    hs_options     options = hs_options_default();
    hs_among       among = {.points = SET(&points, .radii = radii), .box = &box, .reach = &reach};
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
    among.queries = among.points;
    CHECK(hs_neighbors_find(&among, &options, &found, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(found == NULL && failure.row == 0 && failure.in_queries);
}

/* Of many points and of many queries, which are read a hundred thousand at a time. */
static void
bad_rows_are_named_among_many(void)
{
    enum { ROWS_READ = (1 << 17) + 40, BAD = ROWS_READ - 7 };
    double *x = array_of(ROWS_READ, sizeof *x), *radii = array_of(ROWS_READ, sizeof *radii);
    for (int64_t i = 0; i < ROWS_READ; i++) {
        x[i] = i == BAD ? NAN : (double)i;
        radii[i] = 0.25;
    }
    for (int asks = 0; asks < 2; asks++) {
        const hs_points few = {x, 9, 1, HS_FLOAT64, 8, 8}, many = {x, ROWS_READ, 1, 1, 8, 8};
        const hs_reach  reach = {.rule = HS_RULE_SUM};
        const hs_among  among = {.points = SET(asks ? &few : &many, .radii = radii),
                                 .queries = SET(asks ? &many : &few, .radii = radii),
                                 .reach = &reach};
        hs_options      options = hs_options_default();
        hs_failure      failure;
        int64_t         n;
        options.cutoff = 1.0;
        CHECK(hs_pairs_count(&among, &options, &n, &failure) == HS_ERR_NOT_FINITE);
        CHECK(failure.row == BAD && failure.column == 0 && failure.in_queries == (asks == 1));
    }
    free(x);
    free(radii);
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
                scene_entries.points.at.n = empty ? 0 : scene_entries.points.at.n;
                scene_entries.queries.at.n = empty ? 0 : scene_entries.queries.at.n;
                if (lacks & 1) {
                    scene_entries.points.radii = NULL;
                    scene_entries.points.types = NULL;
                }
                if (lacks & 2) {
                    scene_entries.queries.radii = NULL;
                    scene_entries.queries.types = NULL;
                }
                const hs_status status = is_short && !empty ? HS_ERR_ARGUMENT : HS_OK;
                refuses(COUNT, status, -1);
                refuses(ROWS, status, -1);
                refuses(ROW_COUNTS, status, -1);
            }
        }
    }
    make_plain(HS_RULE_GATHER, 9);
    scene_entries.radii[2] = NAN; /* of a point, which is not looked at */
    refuses(ROWS, HS_OK, -1);
    scene_entries.radii[20 + 5] = NAN;
    entry_call e = entry_of(ROWS);
    CHECK(run_entry(&e) == HS_ERR_RADII && e.failure.row == 5 && e.failure.in_queries);
}

/* Also where no two points can be a pair, so that nothing is searched. */
static void
kernel_and_box_are_checked_where_nothing_is_searched(void)
{
    hs_box box;
    make_plain(HS_RULE_END, -1);
    for (int e = 0; e < REACH_TYPES * REACH_TYPES; e++)
        scene_entries.table[e] = -1.0;
    all_refuse_refusals(HS_OK, -1);
    box = *scene_entries.among.box;
    memcpy(box.rows[1], box.rows[0], sizeof box.rows[0]);
    scene_entries.among.box = &box;
    all_refuse_refusals(HS_ERR_BOX_DEPENDENT, -1);
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
    const hs_options options = reach_options(&scene_entries);
    hs_failure       failure;
    hs_pairs        *rows = CALL_NOTHING;
    memset(&failure, 0x5a, sizeof failure);
    CHECK(hs_pairs_histogram(&scene_entries.among, &options, &histogram, &failure) ==
          HS_ERR_ARGUMENT);
    CHECK(failure.row == -1 && failure.column == -1 && failure.system == -1);
    memset(&failure, 0x5a, sizeof failure);
    CHECK(hs_nearest_find(&scene_entries.among, 3, &options, &rows, &failure) == HS_ERR_ARGUMENT);
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
                   (hs_rule)(trial / 2), 0, &scene_entries);
        for (int which = 0; which < ENTRIES; which++) {
            entry_call e = entry_of((entry)which);
            if ((IS_SLOW && (trial / 2 + which) % 2 != 0) || run_entry(&e) != HS_OK) {
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
test_api_reach(void)
{
    RUN(threads_make_no_difference);
    RUN(one_refusal_ends_any_entry);
    RUN(precisions_agree_on_small_integers);
    RUN(bad_supports_are_refused);
    RUN(what_is_no_table_is_refused);
    RUN(types_take_any_rule);
    RUN(tables_have_no_extent);
    RUN(shifts_that_do_not_fit_name_the_callers_row);
    RUN(bad_rows_are_named_among_many);
    RUN(both_sets_need_what_the_rule_looks_at);
    RUN(kernel_and_box_are_checked_where_nothing_is_searched);
    RUN(other_functions_refuse_a_reach);
    RUN(every_entry_fails_cleanly);
}
