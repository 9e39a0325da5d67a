/* SPDX-License-Identifier: BSD-3-Clause */
/* test_choice.c: selections: types, labels, groups, and pairs that are left out. */
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include <math.h>
#include <string.h>

void test_choice(void);

/*
 * ---- choice ----
 *
 * Choices of many: crowds that are looked at in parts, points far from the box and in extreme
 * units, many partners of one point.
 */

enum { CROWD = 300 };

static double        crowd_x[CROWD];
static int64_t       crowd_labels[CROWD], excluded_choice[2 * CROWD];
static const hs_box  line = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
static hs_points     crowd_points = {crowd_x, CROWD, 1, HS_FLOAT64, 8, 8};
static hs_selection  crowd_selection;
static hs_options    crowd_options;
static const int64_t PAIRS = (int64_t)CROWD * (CROWD - 1) / 2;

/* All points at one place, some box vectors away or not; pairs at 0 and at 1, 1 of the image. */
static void
make_crowd(double away)
{
    for (int i = 0; i < CROWD; i++) {
        crowd_x[i] = away * (i % 3);
        crowd_labels[i] = 7;
    }
    crowd_selection = (hs_selection){.min_distance = 0.0};
    crowd_options = hs_options_default();
    crowd_options.cutoff = 1.5;
}

static int64_t
count(const hs_box *box)
{
    const hs_among among = {.points =
                                SET(&crowd_points, .groups = crowd_labels, .labels = crowd_labels),
                            .box = box,
                            .selection = &crowd_selection};
    const unsigned wants[] = {HS_WANT_I, HS_WANT_DISTANCE | HS_WANT_J};
    int64_t        counted = -1;
    CHECK(hs_pairs_count(&among, &crowd_options, &counted, NULL) == HS_OK);
    for (int w = 0; w < 2; w++) {
        hs_pairs *pairs = NULL;
        crowd_options.want = wants[w];
        CHECK(hs_pairs_find(&among, &crowd_options, &pairs, NULL) == HS_OK);
        CHECK(hs_pairs_length(pairs) == counted);
        hs_pairs_free(pairs);
    }
    return counted;
}

static int64_t
count_rows(const hs_box *box)
{
    const hs_among among = {.points =
                                SET(&crowd_points, .groups = crowd_labels, .labels = crowd_labels),
                            .box = box,
                            .selection = &crowd_selection};
    int64_t        counted[CROWD], all = 0;
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_OK);
    for (int i = 0; i < CROWD; i++)
        all += counted[i];
    return all;
}

static void
one_point_may_have_many_partners(void)
{
    for (int few = 0; few < 2; few++) {
        make_crowd(0.0);
        crowd_selection.excluded = excluded_choice;
        for (int i = 1; i < CROWD; i++) {
            const int64_t at = few ? i / 64 * 64 : i; /* others have their last bits */
            excluded_choice[2 * i - 2] = i % 2 ? 0 : at;
            excluded_choice[2 * i - 1] = i % 2 ? at : 0;
        }
        crowd_selection.n_excluded = CROWD - 1;
        CHECK(count(NULL) == PAIRS - (few ? CROWD / 64 : CROWD - 1));
        CHECK(count(&line) == 3 * PAIRS + CROWD - (few ? CROWD / 64 : CROWD - 1));
    }
}

/* Numbers so far apart that no unit holds both. */
static void
numbers_may_be_far_apart(void)
{
    make_crowd(0.0);
    const hs_points three = {crowd_x, 3, 1, HS_FLOAT64, 8, 8}, all = crowd_points;
    crowd_points = three;
    crowd_x[1] = 0x1p-1074;
    crowd_x[2] = 0x1p1000;
    crowd_options.cutoff = 0x1p1001;
    crowd_selection.min_distance = 0x1p-1074;
    CHECK(count(NULL) == 3);
    crowd_selection.min_distance = 0x1p-1073;
    CHECK(count(NULL) == 2);
    crowd_points = all;
}

/* Numbers of queries say nothing where there are none. */
static void
numbers_go_with_queries(void)
{
    make_crowd(0.0);
    crowd_selection.query_numbers = crowd_labels;
    crowd_selection.has_groups = true;
    CHECK(count(&line) == 3 * PAIRS + CROWD);
}

/* Distances in float32 need not be as far as the least distance, of which there is none. */
static void
single_precision_chooses_as_well(void)
{
    make_crowd(0.0);
    crowd_selection.has_labels = true;
    crowd_options.precision = HS_SINGLE;
    CHECK(count(&line) == 2 * PAIRS + CROWD && count_rows(&line) == 2 * (2 * PAIRS + CROWD));
}

/* Of several systems as of one, in a box or without. */
static void
systems_choose_as_well(void)
{
    static int64_t counted[CROWD];
    int64_t        first[] = {0, 100, CROWD}, counts[2];
    make_crowd(0.0);
    hs_among among = *SYSTEMS(&crowd_points, 2, first, NULL, NULL);
    hs_set   set = *among.points;
    set.labels = crowd_labels;
    among.points = &set;
    among.selection = &crowd_selection;
    crowd_selection.has_labels = true;
    CHECK(hs_pairs_count(&among, &crowd_options, counts, NULL) == HS_OK);
    CHECK(counts[0] == 0 && counts[1] == 0);
    crowd_selection.has_labels = false;
    crowd_selection.min_distance = 1.0;
    CHECK(hs_pairs_count(&among, &crowd_options, counts, NULL) == HS_OK);
    CHECK(counts[0] == 0 && counts[1] == 0);
    among.box = &line;
    CHECK(hs_pairs_count(&among, &crowd_options, counts, NULL) == HS_OK);
    CHECK(counts[0] == 99 * 100 + 100 && counts[1] == 199 * 200 + 200);
    crowd_selection.min_distance = -1.0;
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_ERR_ARGUMENT);
}

/* Queries of systems that have numbers of points pair as these do. */
static void
numbers_of_queries_hold_in_systems(void)
{
    int64_t       groups[CROWD], numbers[] = {5, 200}, counted[2];
    const int64_t first[] = {0, 100, CROWD}, first_query[] = {0, 1, 2}, excluded[] = {200, 270};
    make_crowd(0.0);
    hs_points queries = crowd_points;
    queries.n = 2;
    for (int i = 0; i < CROWD; i++)
        groups[i] = i >= 150;
    crowd_selection.query_numbers = numbers;
    crowd_selection.has_labels = true;
    const hs_among among = {.points = SET(&crowd_points, .groups = groups, .labels = crowd_labels,
                                          .n_systems = 2, .first = first),
                            .queries = SET(&queries, .n_systems = 2, .first = first_query),
                            .box = &line,
                            .selection = &crowd_selection};
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_OK);
    CHECK(counted[0] == 2 * 99 + 3 && counted[1] == 2 * 199 + 3); /* itself at S = 0 too */
    crowd_selection.has_labels = false;
    crowd_selection.has_groups = true;
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_OK);
    CHECK(counted[0] == 3 * 100 && counted[1] == 3 * 150);
    crowd_selection.n_excluded = 1;
    crowd_selection.excluded = excluded;
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_OK);
    CHECK(counted[0] == 3 * 100 && counted[1] == 3 * 150 - 1);
    numbers[1] = CROWD;
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_ERR_ARGUMENT);
    numbers[1] = 99; /* of the other system */
    CHECK(hs_neighbors_count(&among, &crowd_options, counted, NULL) == HS_ERR_ARGUMENT);
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
    crowd_selection.has_labels = true;
    const hs_each_system each = {.rows = rows};
    const hs_among       among = {
              .points = SET(&crowd_points, .labels = crowd_labels, .n_systems = 2, .first = first),
              .box = &line,
              .selection = &crowd_selection,
              .each = &each};
    CHECK(hs_pairs_count(&among, &crowd_options, counts, &failure) == HS_ERR_BOX_DEPENDENT);
    CHECK(failure.system == 1 && failure.row == 0);
}

/*
 * ---- choose ----
 *
 * Lattice points in boxes of whole numbers, where every distance is exact: what each public search
 * leaves out is what integers say.
 */

enum { MOST = 60, MOST_EXCLUDED = 150, WINDOW = 4 };

/* A scene, and what may be wanted of it. */
typedef struct selected {
    int          d, n, n_queries;
    double       x[3 * MOST], queries[3 * MOST];
    hs_box       box;
    int64_t      groups[MOST], query_groups[MOST], labels[MOST], query_labels[MOST];
    int64_t      numbers[MOST]; /* of queries that are points */
    int64_t      excluded[2 * MOST_EXCLUDED];
    hs_selection selection;
    hs_options   options;
    double       cutoff;
} selected;

static selected made;

/* What a selection may go by. */
#define OF_MADE(points) SET(points, .groups = made.groups, .labels = made.labels)

static int
below(harness_random *random, int n)
{
    return (int)(random_bits(random) % (unsigned)n);
}

/* Coordinates are whole, in and around a box with edges of 4 and whole shears. */
static void
make_points(harness_random *random, bool crowds)
{
    const int d = made.d = 1 + below(random, 3);
    made.n = crowds ? MOST : below(random, 14);
    made.n_queries = below(random, 8);
    for (int e = 0; e < d * made.n; e++)
        made.x[e] = below(random, crowds ? 2 : 7) - 1;
    for (int e = 0; e < d * made.n_queries; e++)
        made.queries[e] = below(random, 7) - 1;
    made.box = (hs_box){.ndim = d};
    const bool is_skewed = below(random, 2);
    for (int l = 0; l < d; l++) {
        made.box.periodic[l] = below(random, 4) > 0;
        made.box.rows[l][l] = 4.0;
        for (int k = 0; k < l; k++)
            made.box.rows[l][k] = is_skewed ? below(random, 3) - 1 : 0.0;
    }
}

static void
make_selection(harness_random *random)
{
    hs_selection *of = &made.selection;
    const int     asking = made.n_queries;
    *of = (hs_selection){.min_distance = below(random, 3) ? 0.0 : sqrt(below(random, 6))};
    of->min_distance = floor(of->min_distance * 2.0) / 2.0;
    for (int i = 0; i < made.n; i++) {
        made.groups[i] = below(random, 3) == 0 ? INT64_MIN : 5;
        made.labels[i] = below(random, 9) == 0 ? INT64_MIN : below(random, 5);
    }
    for (int t = 0; t < asking; t++) {
        made.query_groups[t] = below(random, 3) == 0 ? INT64_MIN : 5;
        made.query_labels[t] = below(random, 9) == 0 ? INT64_MAX : below(random, 5);
        made.numbers[t] = made.n > 0 ? below(random, made.n) : 0;
    }
    of->has_groups = below(random, 2);
    const int how = below(random, 3);
    if (how == 1) {
        of->has_labels = true;
        of->within = below(random, 3);
    } else if (how == 2 && made.n > 0 && asking > 0) {
        of->n_excluded = below(random, MOST_EXCLUDED);
        const int from = made.n < asking ? made.n : asking; /* good for queries, too */
        for (int e = 0; e < of->n_excluded; e++) {
            made.excluded[2 * e] = below(random, from);
            made.excluded[2 * e + 1] = below(random, made.n);
        }
        of->excluded = made.excluded;
    }
}

/* The square of |D|. */
static double
square_of(const double *p, const double *q, const int *S)
{
    double sum = 0.0;
    for (int k = 0; k < made.d; k++) {
        double along = q[k] - p[k];
        for (int l = 0; l < made.d; l++)
            along += S[l] * made.box.rows[l][k];
        sum += along * along;
    }
    return sum;
}

/* The next image of the window, in lexicographic order; false after the last. */
static bool
next_image(int *S)
{
    for (int l = made.d - 1; l >= 0; l--) {
        if (made.box.periodic[l] && S[l]++ < WINDOW)
            return true;
        S[l] = made.box.periodic[l] ? -WINDOW : 0;
    }
    return false;
}

static void
first_image(int *S)
{
    for (int l = 0; l < 3; l++)
        S[l] = l < made.d && made.box.periodic[l] ? -WINDOW : 0;
}

static void
find_nearest(const double *p, const double *q, int *nearest)
{
    int    S[3];
    double least = INFINITY;
    first_image(S);
    do {
        if (square_of(p, q, S) < least) {
            least = square_of(p, q, S);
            memcpy(nearest, S, sizeof S);
        }
    } while (next_image(S));
}

static bool
is_excluded(int64_t i, int64_t j, bool queried)
{
    const hs_selection *of = &made.selection;
    for (int64_t e = 0; e < of->n_excluded; e++) {
        const int64_t a = of->excluded[2 * e], b = of->excluded[2 * e + 1];
        if ((a == i && b == j) || (!queried && a == j && b == i))
            return true;
    }
    if (!of->has_labels)
        return false;
    const double one = (double)(queried ? made.query_labels[i] : made.labels[i]);
    return fabs(one - (double)made.labels[j]) <= (double)of->within;
}

/* Whether the image is that which an exclusion leaves out. */
static bool
is_nearest(int64_t i, int64_t j, const double *p, const double *q, const int *S, bool queried)
{
    int nearest[3], turned[3] = {-S[0], -S[1], -S[2]};
    if (!queried && j < i) {
        find_nearest(q, p, nearest);
        return memcmp(nearest, turned, sizeof nearest) == 0;
    }
    find_nearest(p, q, nearest);
    return (queried || i != j) && memcmp(nearest, S, sizeof nearest) == 0;
}

/* Whether (i, j, S) is an entry of the rows of points or of queries. */
static bool
counts(int64_t i, int64_t j, const int *S, bool queried)
{
    const hs_selection *of = &made.selection;
    const double       *p = (queried ? made.queries : made.x) + made.d * i;
    const double       *q = made.x + made.d * j;
    const double        square = square_of(p, q, S), most = made.cutoff * made.cutoff;
    if (!queried && i == j && S[0] == 0 && S[1] == 0 && S[2] == 0)
        return false;
    if (square > most || (square == most && !made.options.inclusive) ||
        square < of->min_distance * of->min_distance)
        return false;
    if (of->has_groups && made.groups[j] != (queried ? made.query_groups : made.groups)[i])
        return false;
    return !is_excluded(i, j, queried) || !is_nearest(i, j, p, q, S, queried);
}

static int64_t
count_all(bool queried, int64_t *of_rows)
{
    int64_t   all = 0;
    const int asking = queried ? made.n_queries : made.n;
    for (int i = 0; i < asking; i++) {
        int64_t in_row = 0;
        for (int j = 0; j < made.n; j++) {
            int S[3];
            first_image(S);
            do
                in_row += counts(i, j, S, queried);
            while (next_image(S));
        }
        of_rows[i] = in_row;
        all += in_row;
    }
    return all;
}

/* Whether each entry counts; of a half list in its order of numbers. */
static bool
all_count(const hs_pairs *pairs, bool queried)
{
    const int64_t *i = hs_pairs_array(pairs, HS_WANT_I), *j = hs_pairs_array(pairs, HS_WANT_J);
    const int32_t *shift = hs_pairs_array(pairs, HS_WANT_SHIFT);
    const double  *distance = hs_pairs_array(pairs, HS_WANT_DISTANCE);
    bool           all = true;
    for (int64_t e = 0; e < hs_pairs_length(pairs); e++) {
        int S[3] = {0, 0, 0};
        for (int l = 0; l < made.d; l++)
            S[l] = shift[e * made.d + l];
        all = all && counts(i[e], j[e], S, queried) &&
              (distance == NULL || distance[e] >= made.selection.min_distance);
    }
    return all;
}

static void
check_half_list(const hs_among *among, int64_t n_expected)
{
    const unsigned shift = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
    const unsigned wants[] = {HS_WANT_I | HS_WANT_J, HS_WANT_BOTH, shift,
                              shift | HS_WANT_DISTANCE | HS_WANT_VECTOR};
    hs_options    *options = &made.options;
    int64_t        counted = -1;
    for (int w = 0; w < 4; w++) {
        hs_pairs *pairs = NULL;
        options->want = wants[w];
        options->sorted = w == 1;
        CHECK(hs_pairs_find(among, options, &pairs, NULL) == HS_OK);
        CHECK(hs_pairs_length(pairs) == n_expected);
        CHECK(w < 2 || all_count(pairs, false));
        hs_pairs_free(pairs);
    }
    options->sorted = false;
    CHECK(hs_pairs_count(among, options, &counted, NULL) == HS_OK && counted == n_expected);
}

static void
check_rows(const hs_among *among, bool queried)
{
    int64_t       of_rows[MOST], counted[MOST];
    const int64_t all = count_all(queried, of_rows), n = queried ? made.n_queries : made.n;
    hs_options   *options = &made.options;
    for (int w = 0; w < 2; w++) {
        hs_pairs *rows = NULL;
        options->want = HS_WANT_I | HS_WANT_J | (w ? HS_WANT_SHIFT | HS_WANT_DISTANCE : 0u);
        CHECK(hs_neighbors_find(among, options, &rows, NULL) == HS_OK);
        CHECK(hs_pairs_length(rows) == all && (w == 0 || all_count(rows, queried)));
        hs_pairs_free(rows);
    }
    CHECK(hs_neighbors_count(among, options, counted, NULL) == HS_OK);
    CHECK(memcmp(counted, of_rows, (size_t)n * sizeof *counted) == 0);
}

static void
check_histogram(const hs_among *among, int64_t n_expected)
{
    const double edges[] = {0.0, 1.0, made.cutoff < 1.0 ? 1.0 : made.cutoff};
    int64_t      bins[4] = {0};
    hs_histogram histogram = {.edges = edges,
                              .n_edges = 3,
                              .inclusive = true,
                              .last_inclusive = made.options.inclusive,
                              .n_types = 1,
                              .counts = bins};
    if (made.cutoff < 1.0)
        return;
    CHECK(hs_pairs_histogram(among, &made.options, &histogram, NULL) == HS_OK);
    CHECK(bins[0] + bins[1] + bins[2] == n_expected);
}

static void
check_stream(const hs_among *among, int64_t n_expected)
{
    hs_stream *stream = NULL;
    hs_pairs  *block = NULL;
    int64_t    n = 0;
    made.options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
    CHECK(hs_stream_open(among, &made.options, 7, &stream, NULL) == HS_OK);
    while (hs_stream_next(stream, NULL, NULL, &block, NULL) == HS_OK && block != NULL) {
        n += hs_pairs_length(block);
        CHECK(all_count(block, false));
        hs_pairs_free(block);
    }
    hs_stream_free(stream);
    CHECK(n == n_expected);
}

/* Of two systems, each point has its pairs in the first or in the second. */
static void
check_systems(const hs_among *one, int64_t n_in_one)
{
    const int64_t first[] = {0, made.n, made.n};
    double        rows[2 * 9] = {0.0};
    for (int s = 0; s < 2; s++)
        for (int l = 0; l < made.d; l++)
            for (int k = 0; k < made.d; k++)
                rows[(s * made.d + l) * made.d + k] = made.box.rows[l][k];
    for (int own = 0; own < 2; own++) {
        const hs_each_system each = {.rows = own ? rows : NULL};
        hs_set               set = *one->points;
        hs_among             among = *one;
        hs_pairs            *pairs = NULL;
        int64_t              counted[2] = {-1, -1};
        set.n_systems = 2;
        set.first = first;
        among.points = &set;
        among.each = &each;
        made.options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
        CHECK(hs_pairs_find(&among, &made.options, &pairs, NULL) == HS_OK);
        CHECK(hs_pairs_length(pairs) == n_in_one && all_count(pairs, false));
        hs_pairs_free(pairs);
        CHECK(hs_pairs_count(&among, &made.options, counted, NULL) == HS_OK);
        CHECK(counted[0] == n_in_one && counted[1] == 0);
    }
}

/* Queries that are points pair as these do. */
static void
check_own_queries(const hs_points *points)
{
    double          own[3 * MOST];
    int64_t         of_rows[MOST];
    hs_selection    selection = made.selection;
    const hs_points queries = {own, made.n > 0 ? made.n_queries : 0, made.d, HS_FLOAT64, 8 * made.d,
                               8};
    const hs_among  among = {.points = OF_MADE(points),
                             .box = &made.box,
                             .queries = SET(&queries),
                             .selection = &selection};
    hs_pairs       *rows = NULL;
    int64_t         n = 0;
    selection.query_numbers = made.numbers;
    (void)count_all(false, of_rows);
    for (int64_t t = 0; t < queries.n; t++) {
        memcpy(own + made.d * t, made.x + made.d * made.numbers[t], (size_t)made.d * sizeof *own);
        n += of_rows[made.numbers[t]] + (made.cutoff > 0.0 || made.options.inclusive);
    }
    made.options.want = HS_WANT_J;
    CHECK(hs_neighbors_find(&among, &made.options, &rows, NULL) == HS_OK);
    CHECK(hs_pairs_length(rows) == n); /* each itself besides */
    hs_pairs_free(rows);
}

static void
check_scene(harness_random *random)
{
    static const double      cutoffs[] = {0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.5};
    static const char *const no_kernel = NULL;
    int64_t                  of_rows[MOST];
    const hs_points          points = {made.x, made.n, made.d, HS_FLOAT64, 8 * made.d, 8};
    const hs_points queries = {made.queries, made.n_queries, made.d, HS_FLOAT64, 8 * made.d, 8};
    made.cutoff = cutoffs[below(random, 7)];
    made.options = hs_options_default();
    made.options.cutoff = made.cutoff;
    made.options.inclusive = below(random, 2);
    made.options.kernel = below(random, 2) ? "scalar" : no_kernel;
    made.options.algorithm = (hs_algorithm)below(random, HS_ALGORITHM_END);
    made.options.threads = 1 + below(random, 2);
    const hs_among among = {
        .points = OF_MADE(&points), .box = &made.box, .selection = &made.selection};
    const hs_among queried = {
        .points = OF_MADE(&points),
        .box = &made.box,
        .queries = SET(&queries, .groups = made.query_groups, .labels = made.query_labels),
        .selection = &made.selection};
    const int64_t all = count_all(false, of_rows);
    CHECK(all % 2 == 0);
    check_half_list(&among, all / 2);
    check_rows(&among, false);
    check_rows(&queried, true);
    check_histogram(&among, all / 2);
    check_stream(&among, all / 2);
    check_systems(&among, all / 2);
    check_own_queries(&points);
}

static void
searches_leave_out_what_integers_say(void)
{
    harness_random random = {2718};
    for (int trial = 0; trial < TRIALS(700); trial++) {
        make_points(&random, false);
        make_selection(&random);
        check_scene(&random);
    }
}

/* The same with radii, whose levels are searched one by one. */
static void
levels_choose_as_well(void)
{
    harness_random random = {97};
    double         radii[MOST];
    for (int trial = 0; trial < TRIALS(60); trial++) {
        make_points(&random, false);
        make_selection(&random);
        made.options = hs_options_default();
        made.options.cutoff = INFINITY;
        made.cutoff = 2.0;
        for (int i = 0; i < made.n; i++)
            radii[i] = i % 2 ? 2.0 : 0.0625; /* of two levels; the larger one counts */
        int64_t         n = 0, rows[MOST];
        const hs_reach  reach = {.rule = HS_RULE_MAX};
        const hs_points points = {made.x, made.n, made.d, HS_FLOAT64, 8 * made.d, 8};
        const hs_among  among = {
             .points = SET(&points, .radii = radii, .groups = made.groups, .labels = made.labels),
             .box = &made.box,
             .reach = &reach,
             .selection = &made.selection};
        hs_pairs  *pairs = NULL;
        hs_stream *stream = NULL;
        made.options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
        CHECK(hs_pairs_find(&among, &made.options, &pairs, NULL) == HS_OK);
        const int64_t *i = hs_pairs_array(pairs, HS_WANT_I), *j = hs_pairs_array(pairs, HS_WANT_J);
        CHECK(all_count(pairs, false));
        for (int a = 0; a < made.n; a++) /* pairs with a point of the larger radius */
            for (int b = a; b < made.n; b++) {
                int S[3];
                first_image(S);
                do
                    n += (a % 2 || b % 2) && counts(a, b, S, false);
                while (next_image(S));
            }
        int64_t found = 0;
        for (int64_t e = 0; e < hs_pairs_length(pairs); e++)
            if (i[e] % 2 || j[e] % 2)
                found += i[e] == j[e] ? 2 : 1;
        CHECK(found == n);
        hs_pairs_free(pairs);
        CHECK(hs_stream_open(&among, &made.options, 7, &stream, NULL) == HS_OK);
        hs_stream_free(stream);
        CHECK(hs_neighbors_count(&among, &made.options, rows, NULL) == HS_OK);
    }
}

static hs_status
run_all(void *context)
{
    const hs_among *among = context;
    hs_pairs       *pairs = NULL;
    hs_stream      *stream = NULL;
    const int64_t   first[] = {0, made.n};
    hs_set          set = *among->points;
    hs_among        systems = *among;
    set.n_systems = 1;
    set.first = first;
    systems.points = &set;
    made.options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
    hs_status status = hs_pairs_find(among, &made.options, &pairs, NULL);
    hs_pairs_free(pairs);
    if (status == HS_OK) {
        status = hs_stream_open(among, &made.options, 5, &stream, NULL);
        hs_stream_free(stream);
    }
    if (status == HS_OK) {
        status = hs_pairs_find(&systems, &made.options, &pairs, NULL);
        hs_pairs_free(pairs);
    }
    return status;
}

static void
refused_memory_leaves_nothing(void)
{
    harness_random random = {5};
    for (int how = 0; how < 2; how++) {
        do {
            make_points(&random, false);
            make_selection(&random);
        } while (made.n < 5 || (how ? made.selection.n_excluded < 5 : !made.selection.has_labels) ||
                 !made.selection.has_groups);
        const hs_points points = {made.x, made.n, made.d, HS_FLOAT64, 8 * made.d, 8};
        const hs_among  among = {
             .points = OF_MADE(&points), .box = &made.box, .selection = &made.selection};
        made.options = hs_options_default();
        made.options.cutoff = 3.0;
        CHECK(fail_each_allocation(run_all, (void *)&among, 400) > 10);
    }
}

/* Arrays that are missing, numbers that are none, distances that cannot be. */
static void
bad_selections_are_refused(void)
{
    static const int64_t two[] = {0, 1, 0, 2}, outside[][2] = {{-1, 0}, {2, 0}, {0, -1}, {0, 2}};
    static const double  x[] = {0.0, 1.0};
    const hs_points      points = {x, 2, 1, HS_FLOAT64, 8, 8}, none = {x, 0, 1, HS_FLOAT64, 8, 8};
    const hs_box skewed = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {1e300, 1.0}}};
    hs_selection bad[] = {{.within = -1},
                          {.n_excluded = -1},
                          {.n_excluded = INT64_MAX},
                          {.n_excluded = 1},
                          {.min_distance = -1.0},
                          {.min_distance = NAN},
                          {.min_distance = INFINITY},
                          {.has_groups = true},
                          {.has_labels = true}};
    hs_options   options = hs_options_default();
    hs_pairs    *pairs = NULL;
    hs_failure   failure;
    options.cutoff = 1.0;
    for (size_t b = 0; b < sizeof bad / sizeof *bad; b++) {
        const hs_among among = {.points = SET(&points), .selection = &bad[b]};
        CHECK(hs_pairs_find(&among, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    }
    hs_selection of_points[] = {{.has_groups = true}, {.has_labels = true}};
    for (int s = 0; s < 2; s++) { /* and none for the queries */
        const hs_among queried = {.points = SET(&points, .groups = two, .labels = two),
                                  .queries = SET(&points),
                                  .selection = &of_points[s]};
        CHECK(hs_neighbors_find(&queried, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
        const hs_among without = {.points = SET(&points, .groups = two, .labels = two),
                                  .queries = SET(&none),
                                  .selection = &of_points[s]};
        CHECK(hs_neighbors_find(&without, &options, &pairs, &failure) == HS_OK);
        hs_pairs_free(pairs);
        const hs_among nowhere = {
            .points = SET(&none), .queries = SET(&none), .selection = &of_points[s]};
        CHECK(hs_neighbors_find(&nowhere, &options, &pairs, &failure) == HS_OK);
        hs_pairs_free(pairs);
    }
    for (int e = 0; e < 4; e++) {
        hs_selection   one = {.n_excluded = 1, .excluded = outside[e]};
        const hs_among among = {.points = SET(&points), .selection = &one};
        CHECK(hs_pairs_find(&among, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
        CHECK(failure.row == 0);
        one = (hs_selection){.query_numbers = outside[e] + (e > 1)};
        const hs_points one_query = {x, 1, 1, HS_FLOAT64, 8, 8};
        const hs_among  queried = {
             .points = SET(&points), .queries = SET(&one_query), .selection = &one};
        CHECK(hs_neighbors_find(&queried, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    }
    hs_selection   least = {.min_distance = 0.5};
    const hs_among among = {.points = SET(&points), .selection = &least};
    hs_plan        plan;
    options.precision = HS_SINGLE;
    CHECK(hs_pairs_find(&among, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    options.precision = HS_EXACT;
    CHECK(hs_plan_make(&among, &options, &plan, &failure) == HS_ERR_ARGUMENT);
    least.min_distance = -0.5;
    CHECK(hs_nearest_find(&among, 1, &options, &pairs, &failure) == HS_ERR_ARGUMENT);
    const hs_points in_plane = {x, 1, 2, HS_FLOAT64, 16, 8};
    hs_selection    labelled = {.has_labels = true};
    hs_among        in_box = {
               .points = SET(&in_plane, .labels = two), .box = &skewed, .selection = &labelled};
    CHECK(hs_pairs_find(&in_box, &options, &pairs, &failure) == HS_ERR_BOX_SKEWED);
    hs_box dependent = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 1.0}, {2.0, 2.0}}};
    in_box.box = &dependent;
    CHECK(hs_pairs_find(&in_box, &options, &pairs, &failure) == HS_ERR_BOX_DEPENDENT);
}

/*
 * ---- choose far ----
 *
 * Excluded pairs of points that are many periods apart, in a box so skewed that S over its vectors
 * is far larger still: what S says does not depend on that, until it does not fit.
 */

enum { N = 300 }; /* more than are looked up together */

#define SIDE 8.0
#define TILT 0x1p20 /* S is so many times the number of periods */

static const hs_box far_box = {
    .ndim = 2, .periodic = {true, true}, .rows = {{SIDE}, {SIDE * TILT, SIDE}}};

static double  far_x[2 * N];
static int64_t far_labels[N];

/* Points on a fine lattice, all with one label. */
static void
make_far_points(void)
{
    harness_random random = {86};
    for (int e = 0; e < 2 * N; e++)
        far_x[e] = (double)(random_bits(&random) % 128) / 16.0;
    memset(far_labels, 0, sizeof far_labels);
}

/* Moves a point by a vector of the lattice along the second axis: that is exact. */
static void
move(int point, double periods)
{
    far_x[2 * point + 1] += SIDE * periods;
}

/* Pairs whose labels differ, and images other than the nearest of those whose do not; as many as
 * are counted. */
static hs_status
find(double min_distance, hs_pairs **pairs, hs_failure *failure)
{
    const hs_points    points = {far_x, N, 2, HS_FLOAT64, 16, 8};
    const hs_selection selection = {.has_labels = true, .min_distance = min_distance};
    const hs_among     among = {
            .points = SET(&points, .labels = far_labels), .box = &far_box, .selection = &selection};
    hs_options options = hs_options_default();
    options.cutoff = 0.75 * SIDE + 0x1p-13; /* which no pair is so near that S decides */
    int64_t         n = 0;
    const hs_status status = hs_pairs_find(&among, &options, pairs, failure);
    CHECK(hs_pairs_count(&among, &options, &n, NULL) == status);
    CHECK(status != HS_OK || n == hs_pairs_length(*pairs));
    return status;
}

static bool
same_pairs(const hs_pairs *one, const hs_pairs *other)
{
    const int64_t n = hs_pairs_length(one);
    const size_t  size = (size_t)n * sizeof(int64_t);
    return n == hs_pairs_length(other) &&
           memcmp(hs_pairs_array(one, HS_WANT_I), hs_pairs_array(other, HS_WANT_I), size) == 0 &&
           memcmp(hs_pairs_array(one, HS_WANT_J), hs_pairs_array(other, HS_WANT_J), size) == 0;
}

/* An S beyond 2^62 is not known: the search ends, unless it need not be known. */
static void
shifts_that_are_not_known_are_told(void)
{
    for (int every = 1; every < N; every *= 7) {
        hs_pairs  *near, *far;
        hs_failure failure;
        make_far_points();
        for (int i = every; i < N; i += 2 * every)
            move(i, 0x1p42);
        CHECK(find(0.0, &far, &failure) == HS_ERR_SHIFT_RANGE && far == NULL);
        CHECK(failure.row >= 0 && failure.row < N);
        for (int i = every; i < N; i += 2 * every)
            far_labels[i] = -i;
        CHECK(find(0.0, &far, NULL) == HS_OK);
        for (int i = every; i < N; i += 2 * every)
            move(i, -0x1p42);
        CHECK(find(0.0, &near, NULL) == HS_OK);
        CHECK(same_pairs(near, far) && hs_pairs_length(near) > N);
        hs_pairs_free(near);
        hs_pairs_free(far);
    }
}

void
test_choice(void)
{
    RUN(one_point_may_have_many_partners);
    RUN(numbers_may_be_far_apart);
    RUN(numbers_go_with_queries);
    RUN(single_precision_chooses_as_well);
    RUN(systems_choose_as_well);
    RUN(numbers_of_queries_hold_in_systems);
    RUN(a_bad_box_of_a_system_is_told);
    RUN(bad_selections_are_refused);
    RUN(searches_leave_out_what_integers_say);
    RUN(levels_choose_as_well);
    RUN(refused_memory_leaves_nothing);
    RUN(shifts_that_are_not_known_are_told);
}
