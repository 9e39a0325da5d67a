/* SPDX-License-Identifier: BSD-3-Clause */
/* test_by_reach.c: streams, visits, cells and threads give the pairs of hs_pairs_find when each pair
 * has a reach of its own. */
#include "../support/block_checks.h"
#include "../support/poll_checks.h"
#include "../support/reach_entries.h"

void test_by_reach(void);

static void
compare_stream(const hs_pairs *whole, int64_t max_pairs, int threads)
{
    entry_call e = entry_of(STREAM);
    hs_stream *stream = NULL;
    hs_pairs  *block = NULL;
    int64_t    at = 0;
    e.options.threads = threads;
    CHECK(hs_stream_open(&e.among, &e.options, max_pairs, &stream, NULL) == HS_OK);
    while (hs_stream_next(stream, NULL, NULL, &block, NULL) == HS_OK && block != NULL) {
        CHECK(block_matches(whole, block, at, scene.of.scene.ndim));
        at += hs_pairs_length(block);
        CHECK(hs_pairs_length(block) == max_pairs || at == hs_pairs_length(whole));
        hs_pairs_free(block);
    }
    CHECK(at == hs_pairs_length(whole));
    hs_stream_free(stream);
}

typedef struct seen {
    const hs_pairs *whole;
    int64_t         n, stop_at;
} seen;

static int
see_pair(int64_t i, int64_t j, const int32_t *S, const double *D, double d2, void *user)
{
    seen        *s = user;
    const size_t d = (size_t)scene.of.scene.ndim;
    CHECK(same_part(s->whole, HS_WANT_I, 8, s->n, &i, 1));
    CHECK(same_part(s->whole, HS_WANT_J, 8, s->n, &j, 1));
    CHECK(same_part(s->whole, HS_WANT_VECTOR, 8 * d, s->n, D, 1));
    CHECK(same_part(s->whole, HS_WANT_SHIFT, 4 * d, s->n, S, 1));
    CHECK(d2 >= 0.0);
    return ++s->n == s->stop_at;
}

/* All of them, in order, then no more than half, although steps would follow. */
static void
compare_visit(const hs_pairs *whole)
{
    entry_call     e = entry_of(VISIT);
    seen           s = {.whole = whole};
    const hs_visit visit = {.pair = see_pair, .user = &s};
    int64_t        n = -1;
    CHECK(hs_pairs_visit(&e.among, &e.options, &visit, &n, NULL) == HS_OK);
    CHECK(n == hs_pairs_length(whole) && s.n == n);
    if (n > 0) {
        s = (seen){.whole = whole, .stop_at = 1 + n / 2};
        CHECK(hs_pairs_visit(&e.among, &e.options, &visit, &n, NULL) == HS_OK);
        CHECK(n == s.stop_at && s.n == n);
    }
}

static void
streams_and_visits_are_the_pairs_in_their_order(void)
{
    static const int64_t sizes[] = {1, 7, 100, INT64_MAX};
    harness_random       random = {30301};
    for (int trial = 0; trial < TRIALS(150); trial++) {
        const hs_rule rule = trial % 5 == 4 ? HS_RULE_END : (hs_rule)(trial % 5);
        hs_pairs     *whole = NULL;
        reach_make(&random, (scene_kind)(trial % SCENE_KINDS), 1 + trial % 3, 30, -1, rule, 0,
                   &scene);
        entry_call e = entry_of(FIND);
        CHECK(hs_pairs_find(&e.among, &e.options, &whole, NULL) == HS_OK);
        compare_stream(whole, sizes[trial % 4], 1 + trial % 3);
        compare_visit(whole);
        hs_pairs_free(whole);
    }
}

/* Cells have the points as they were given, so they serve; so do arrays of the caller. */
static void
cells_and_arrays_of_the_caller_serve(void)
{
    enum { ROOM = 20000 };
    static int64_t i[ROOM], j[ROOM];
    harness_random random = {30302};
    for (int trial = 0; trial < 14; trial++) {
        hs_cells      *cells = NULL;
        hs_pair_arrays out = {.capacity = ROOM, .index_bytes = 8, .i = i, .j = j};
        reach_make(&random, (scene_kind)(trial % SCENE_KINDS), 3, 60, trial % 2 ? 20 : -1,
                   (hs_rule)(trial / 2), 0, &scene);
        hs_options of_cells = hs_options_default();
        of_cells.cutoff = 0.5;
        CHECK(hs_cells_build(&scene.points, scene.among.box, &of_cells, &cells, NULL) == HS_OK);
        for (int which = 0; which < ENTRIES; which++) {
            entry_call      plain = entry_of((entry)which), kept = plain;
            const hs_status status = run_entry(&plain);
            kept.among = (hs_among){
                .cells = cells, .queries = scene.among.queries, .reach = scene.among.reach};
            CHECK(run_entry(&kept) == status);
            CHECK(status != HS_OK || kept.answer == plain.answer);
        }
        entry_call e = entry_of(FIND);
        e.options.want = HS_WANT_I | HS_WANT_J;
        const hs_status status = run_entry(&e);
        const uint64_t  n_and_more = e.answer;
        e.options.out = &out;
        CHECK(run_entry(&e) == status);
        CHECK(status != HS_OK || (n_and_more != 0 && e.answer != 0));
        hs_cells_free(cells);
    }
}

/* However many searches it takes, the counters are of all of them. */
static void
counters_have_all_pairs(void)
{
    static int64_t counts[SCENE_POINTS];
    harness_random random = {30306};
    int64_t        sum = 0;
    for (int trial = 0; trial < TRIALS(120); trial++) {
        const hs_rule rule = (hs_rule)(trial % (HS_RULE_END + 1));
        hs_counters   counters = {.pairs = -1};
        hs_pairs     *rows = NULL, *pairs = NULL;
        int64_t       count = 0, n = 0;
        reach_make(&random, (scene_kind)(trial % SCENE_KINDS), 2, 40, trial % 3 ? -1 : 20, rule, 0,
                   &scene);
        hs_options options = reach_options(&scene);
        options.algorithm = trial % 2 ? HS_HIERARCHY : HS_AUTO;
        options.counters = &counters;
        CHECK(hs_neighbors_count(&scene.among, &options, counts, NULL) == HS_OK);
        for (int64_t i = 0; i < (scene.has_queries ? scene.n_queries : scene.n); i++)
            n += counts[i];
        CHECK(counters.pairs == n);
        CHECK(hs_neighbors_find(&scene.among, &options, &rows, NULL) == HS_OK);
        CHECK(hs_pairs_length(rows) == n && counters.pairs == n);
        if (scene.has_queries) {
            CHECK(hs_pairs_count(&scene.among, &options, &count, NULL) == HS_OK);
            CHECK(count == n && counters.pairs == n);
        } else if (hs_pairs_find(&scene.among, &options, &pairs, NULL) == HS_OK) {
            CHECK(counters.pairs == hs_pairs_length(pairs) && 2 * counters.pairs == n);
        }
        hs_pairs_free(rows);
        hs_pairs_free(pairs);
        sum += n;
    }
    CHECK(sum > TRIALS(1000));
}

/* ---- many points ---- */

enum { MANY = 40000 };

static double  many_x[3 * MANY], many_radii[MANY];
static int32_t many_types[MANY];

/* rule: HS_RULE_END for types. */
static hs_among
make_many(hs_rule rule, hs_points *points, hs_reach *reach)
{
    static const double table[] = {0.02, 0.04, 0.04, -1.0};
    harness_random      random = {30303};
    for (int e = 0; e < 3 * MANY; e++)
        many_x[e] = random_unit(&random);
    for (int i = 0; i < MANY; i++) {
        many_radii[i] = ldexp(0.03 * (0.5 + random_unit(&random)), -(i % 8 == 0));
        many_types[i] = i % 2;
    }
    *points = (hs_points){many_x, MANY, 3, HS_FLOAT64, 24, 8};
    *reach = (hs_reach){.rule = rule, .radii = many_radii};
    if (rule == HS_RULE_END) {
        *reach = (hs_reach){.n_types = 2, .types = many_types, .cutoffs = table};
    }
    return (hs_among){.points = points, .reach = reach};
}

/* Threads divide so many points: the same bits, whatever their number. */
static void
threads_make_no_difference(void)
{
    for (int rule = 0; rule <= HS_RULE_END; rule += IS_SLOW ? 2 : 1) {
        hs_points      points;
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

/* Whatever the limit, a call succeeds or says what it was, and leaves nothing. Tries limits from
 * `first` on, each larger by this factor; returns the first that is enough. */
static double
try_limits(entry_call *e, double first, double factor)
{
    double limit = first;
    for (hs_status status = HS_ERR_MEMORY; status != HS_OK && limit < 1e10; limit *= factor) {
        const int64_t before = hs_test_live_blocks();
        e->options.memory_limit = limit;
        status = run_entry(e);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        CHECK(status == HS_OK || e->failure.limit_bytes == limit);
        CHECK(hs_test_live_blocks() == before);
    }
    return limit / factor;
}

static void
limits_of_memory_are_kept(void)
{
    hs_points      points;
    hs_reach       reach;
    const hs_among among = make_many(HS_RULE_SUM, &points, &reach);
    memset(&scene, 0, sizeof scene);
    scene.of.scene.ndim = 3;
    for (int which = 0; which < ENTRIES; which++) {
        entry_call e = {.which = (entry)which, .among = among, .options = hs_options_default()};
        if (which == ROW_COUNTS) { /* CALL_ROOM is too small for so many */
            continue;
        }
        e.options.cutoff = 1.0;
        const double enough = try_limits(&e, 1e4, IS_SLOW ? 4.0 : 1.2);
        CHECK(enough > 1e5 && enough < 1e9);
    }
}

/* Fractions that a poll is told: they never fall. */
typedef struct told {
    int64_t n;
    double  last;
    bool    fell;
} told;

static bool
note_fraction(void *context, double fraction)
{
    told *t = context;
    t->fell = t->fell || !(fraction >= t->last && fraction <= 1.0);
    t->last = fraction;
    t->n++;
    return true;
}

/* A poll that says no once ends any of them. */
static void
one_refusal_ends_any_entry(void)
{
    hs_points points;
    hs_reach  reach;
    memset(&scene, 0, sizeof scene);
    scene.of.scene.ndim = 3;
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

/* Over all steps together. */
static void
fractions_of_a_stream_never_fall(void)
{
    for (int rule = 0; rule <= HS_RULE_END; rule += HS_RULE_END) {
        hs_points      points;
        hs_reach       reach;
        const hs_among among = make_many((hs_rule)rule, &points, &reach);
        hs_options     options = hs_options_default();
        hs_stream     *stream = NULL;
        hs_pairs      *block = NULL;
        told           t = {0, 0.0, false};
        options.cutoff = 1.0;
        CHECK(hs_stream_open(&among, &options, 1000, &stream, NULL) == HS_OK);
        while (hs_stream_next(stream, note_fraction, &t, &block, NULL) == HS_OK && block != NULL)
            hs_pairs_free(block);
        CHECK(t.n > 0 && !t.fell && t.last == 1.0);
        hs_stream_free(stream);
    }
}

void
test_by_reach(void)
{
    RUN(streams_and_visits_are_the_pairs_in_their_order);
    RUN(cells_and_arrays_of_the_caller_serve);
    RUN(counters_have_all_pairs);
    RUN(threads_make_no_difference);
    RUN(one_refusal_ends_any_entry);
    RUN(limits_of_memory_are_kept);
    RUN(fractions_of_a_stream_never_fall);
}
