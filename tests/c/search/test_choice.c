/* SPDX-License-Identifier: BSD-3-Clause */
/* test_choice.c: choices of many: crowds that are looked at in parts, points far from the box and
 * in extreme units, many partners of one point. */
#include "../support/among.h"
#include "../support/poll_checks.h"

#include <string.h>

void test_choice(void);

enum { CROWD = 300 };

static double        x[CROWD];
static int64_t       labels[CROWD], excluded[2 * CROWD];
static const hs_box  line = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
static hs_points     points = {x, CROWD, 1, HS_FLOAT64, 8, 8};
static hs_selection  selection;
static hs_options    options;
static const int64_t PAIRS = (int64_t)CROWD * (CROWD - 1) / 2;

/* All points at one place, some box vectors away or not; pairs at 0 and at 1, 1 of the image. */
static void
make_crowd(double away)
{
    for (int i = 0; i < CROWD; i++) {
        x[i] = away * (i % 3);
        labels[i] = 7;
    }
    selection = (hs_selection){.min_distance = 0.0};
    options = hs_options_default();
    options.cutoff = 1.5;
}

static int64_t
count(const hs_box *box)
{
    const hs_among among = {.points = &points, .box = box, .selection = &selection};
    const unsigned wants[] = {HS_WANT_I, HS_WANT_DISTANCE | HS_WANT_J};
    int64_t        counted = -1;
    CHECK(hs_pairs_count(&among, &options, &counted, NULL) == HS_OK);
    for (int w = 0; w < 2; w++) {
        hs_pairs *pairs = NULL;
        options.want = wants[w];
        CHECK(hs_pairs_find(&among, &options, &pairs, NULL) == HS_OK);
        CHECK(hs_pairs_length(pairs) == counted);
        hs_pairs_free(pairs);
    }
    return counted;
}

static int64_t
count_rows(const hs_box *box)
{
    const hs_among among = {.points = &points, .box = box, .selection = &selection};
    int64_t        counted[CROWD], all = 0;
    CHECK(hs_neighbors_count(&among, &options, counted, NULL) == HS_OK);
    for (int i = 0; i < CROWD; i++)
        all += counted[i];
    return all;
}

static void
crowds_lose_their_nearest_images(void)
{
    const double far[] = {0.0, 1.0, 0x1p40};
    for (int a = 0; a < 3; a++) {
        make_crowd(far[a]);
        CHECK(count(&line) == 3 * PAIRS + CROWD);
        selection.labels = labels;
        CHECK(count(&line) == 2 * PAIRS + CROWD);
        CHECK(count_rows(&line) == 2 * (2 * PAIRS + CROWD));
        selection = (hs_selection){.min_distance = 1.0};
        CHECK(count(&line) == 2 * PAIRS + CROWD);
        CHECK(count_rows(&line) == 2 * (2 * PAIRS + CROWD));
        selection.min_distance = 1.25; /* images of a point itself are too near, it stays */
        CHECK(count(&line) == 0 && count_rows(&line) == 0);
    }
}

static void
one_point_may_have_many_partners(void)
{
    for (int few = 0; few < 2; few++) {
        make_crowd(0.0);
        selection.excluded = excluded;
        for (int i = 1; i < CROWD; i++) {
            const int64_t at = few ? i / 64 * 64 : i; /* others have their last bits */
            excluded[2 * i - 2] = i % 2 ? 0 : at;
            excluded[2 * i - 1] = i % 2 ? at : 0;
        }
        selection.n_excluded = CROWD - 1;
        CHECK(count(NULL) == PAIRS - (few ? CROWD / 64 : CROWD - 1));
        CHECK(count(&line) == 3 * PAIRS + CROWD - (few ? CROWD / 64 : CROWD - 1));
    }
}

/* Where coordinates leave the range that squares have. */
static void
units_may_be_extreme(void)
{
    const int powers[] = {-1070, -600, 600, 1015};
    for (int p = 0; p < 4; p++) {
        make_crowd(0.0);
        for (int i = 0; i < CROWD; i++)
            x[i] = ldexp((double)i, powers[p]);
        options.cutoff = ldexp(2.0, powers[p]);
        selection.min_distance = ldexp(2.0, powers[p]);
        CHECK(count(NULL) == CROWD - 2);
        selection.min_distance = ldexp(1.0, powers[p]);
        CHECK(count(NULL) == 2 * CROWD - 3);
        selection.labels = labels;
        CHECK(count(NULL) == 0);
    }
}

/* Numbers so far apart that no unit holds both. */
static void
numbers_may_be_far_apart(void)
{
    make_crowd(0.0);
    const hs_points three = {x, 3, 1, HS_FLOAT64, 8, 8}, all = points;
    points = three;
    x[1] = 0x1p-1074;
    x[2] = 0x1p1000;
    options.cutoff = 0x1p1001;
    selection.min_distance = 0x1p-1074;
    CHECK(count(NULL) == 3);
    selection.min_distance = 0x1p-1073;
    CHECK(count(NULL) == 2);
    points = all;
}

/* Numbers of queries say nothing where there are none. */
static void
numbers_go_with_queries(void)
{
    make_crowd(0.0);
    selection.query_numbers = labels;
    selection.groups = labels;
    CHECK(count(&line) == 3 * PAIRS + CROWD);
}

/* Distances in float32 need not be as far as the least distance, of which there is none. */
static void
single_precision_chooses_as_well(void)
{
    make_crowd(0.0);
    selection.labels = labels;
    options.precision = HS_SINGLE;
    CHECK(count(&line) == 2 * PAIRS + CROWD && count_rows(&line) == 2 * (2 * PAIRS + CROWD));
}

/* Of several systems as of one, in a box or without. */
static void
systems_choose_as_well(void)
{
    static int64_t counted[CROWD];
    int64_t        first[] = {0, 100, CROWD}, counts[2];
    make_crowd(0.0);
    hs_systems systems = {.n = 2, .first = first, .selection = &selection};
    selection.labels = labels;
    CHECK(hs_systems_count(&points, &systems, &options, counts, NULL) == HS_OK);
    CHECK(counts[0] == 0 && counts[1] == 0);
    selection.labels = NULL;
    selection.min_distance = 1.0;
    CHECK(hs_systems_count(&points, &systems, &options, counts, NULL) == HS_OK);
    CHECK(counts[0] == 0 && counts[1] == 0);
    systems.box = &line;
    CHECK(hs_systems_count(&points, &systems, &options, counts, NULL) == HS_OK);
    CHECK(counts[0] == 99 * 100 + 100 && counts[1] == 199 * 200 + 200);
    selection.min_distance = -1.0;
    CHECK(hs_systems_coordination(&points, NULL, &systems, &options, counted, NULL) ==
          HS_ERR_ARGUMENT);
}

/* Queries of systems that have numbers of points pair as these do. */
static void
numbers_of_queries_hold_in_systems(void)
{
    static int64_t numbers[CROWD], counted[CROWD];
    const int64_t  first[] = {0, 100, CROWD}, first_query[] = {0, 1, 2};
    make_crowd(0.0);
    hs_points queries = points;
    queries.n = 2;
    numbers[0] = 5;
    numbers[1] = 100;
    selection.query_numbers = numbers;
    selection.labels = labels;
    const hs_systems systems = {
        .n = 2, .first = first, .box = &line, .selection = &selection, .first_query = first_query};
    CHECK(hs_systems_coordination(&points, &queries, &systems, &options, counted, NULL) == HS_OK);
    CHECK(counted[0] == 2 * 99 + 3 && counted[1] == 2 * 199 + 3); /* itself at S = 0 too */
    numbers[1] = CROWD;
    CHECK(hs_systems_coordination(&points, &queries, &systems, &options, counted, NULL) ==
          HS_ERR_ARGUMENT);
}

/* Images of excluded pairs are those of each system's box, which is looked at first. */
static void
a_bad_box_of_a_system_is_told(void)
{
    static const double rows[] = {1.0, 0.0};
    const int64_t       first[] = {0, 100, CROWD};
    int64_t             counts[2];
    hs_failure          failure;
    make_crowd(0.0);
    selection.labels = labels;
    const hs_systems systems = {
        .n = 2, .first = first, .box = &line, .rows = rows, .selection = &selection};
    CHECK(hs_systems_count(&points, &systems, &options, counts, &failure) == HS_ERR_BOX_DEPENDENT);
    CHECK(failure.system == 1 && failure.row == 0);
}

/* What a stream has been given may change once it is open. */
static void
streams_keep_what_they_choose_by(void)
{
    static int64_t own[CROWD];
    make_crowd(0.0);
    for (int way = 0; way < 2; way++) {
        hs_stream *stream = NULL;
        hs_pairs  *block = NULL;
        int64_t    n = 0;
        memcpy(own, labels, sizeof own);
        own[0] = 8;
        selection = (hs_selection){.groups = way ? own : NULL, .labels = way ? NULL : own};
        const hs_among among = {.points = &points, .selection = &selection};
        const int64_t  counted = count(NULL);
        CHECK(counted == (way ? PAIRS - (CROWD - 1) : CROWD - 1) && counted > 0);
        options.want = HS_WANT_I | HS_WANT_J;
        CHECK(hs_stream_open(&among, &options, 64, &stream, NULL) == HS_OK);
        for (int i = 0; i < CROWD; i++)
            own[i] = i;
        while (hs_stream_next(stream, NULL, NULL, &block, NULL) == HS_OK && block != NULL) {
            n += hs_pairs_length(block);
            hs_pairs_free(block);
        }
        CHECK(n == counted);
        hs_stream_free(stream);
    }
}

void
test_choice(void)
{
    RUN(streams_keep_what_they_choose_by);
    RUN(crowds_lose_their_nearest_images);
    RUN(one_point_may_have_many_partners);
    RUN(units_may_be_extreme);
    RUN(numbers_may_be_far_apart);
    RUN(numbers_go_with_queries);
    RUN(single_precision_chooses_as_well);
    RUN(systems_choose_as_well);
    RUN(numbers_of_queries_hold_in_systems);
    RUN(a_bad_box_of_a_system_is_told);
}
