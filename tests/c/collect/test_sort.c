/* SPDX-License-Identifier: BSD-3-Clause */
/* test_sort.c: pairs and rows in order. */
#include "../../../csrc/core/collect/sort_pairs.h"
#include "../support/search_unit.h"

void test_sort(void);

enum { POINTS = 20, MOST = 3000 };

static search_unit unit;

/* Mostly small, now and then as far away as can be. */
static int32_t
some_shift(harness_random *random)
{
    const uint64_t bits = random_bits(random);
    return bits % 512 == 0 ? INT32_MAX : bits % 512 == 1 ? -INT32_MAX : (int32_t)(bits % 3) - 1;
}

/* Random pairs, many of them several times, with a distance that tells where each was. */
static void
fill_pairs(harness_random *random, int64_t n, int most_j, bool has_shift, hs_output *found)
{
    const unsigned columns = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
    hs_output_init(NULL, 2, has_shift ? columns | HS_WANT_SHIFT : columns, 4, found);
    CHECK(hs_output_reserve(found, n, 0.0) == HS_OK);
    int32_t *i = hs_output_column(found, HS_WANT_I), *j = hs_output_column(found, HS_WANT_J);
    int32_t *shift = hs_output_column(found, HS_WANT_SHIFT);
    double  *d = hs_output_column(found, HS_WANT_DISTANCE);
    for (int64_t p = 0; p < n; p++) {
        i[p] = (int32_t)(random_bits(random) % POINTS);
        j[p] = (int32_t)(random_bits(random) % (uint64_t)most_j);
        d[p] = (double)p;
        for (int k = 0; has_shift && k < 2; k++)
            shift[2 * p + k] = some_shift(random);
    }
    found->n_pairs = n;
}

/* Whether entry p comes before the next one, or is the same. */
static bool
is_in_order(const hs_output *sorted, const int32_t *shift, int64_t p)
{
    const int64_t *i = hs_output_column(sorted, HS_WANT_I);
    const int64_t *j = hs_output_column(sorted, HS_WANT_J);
    const int64_t  keys[4] = {i[p], j[p], shift != NULL ? shift[2 * p] : 0,
                             shift != NULL ? shift[2 * p + 1] : 0};
    const int64_t  next[4] = {i[p + 1], j[p + 1], shift != NULL ? shift[2 * p + 2] : 0,
                             shift != NULL ? shift[2 * p + 3] : 0};
    int            k = 0;
    while (k < 4 && keys[k] == next[k])
        k++;
    return k == 4 || keys[k] < next[k];
}

static void
all_pairs_are_there_in_order(void)
{
    static bool    seen[MOST];
    harness_random random = {365};
    search_unit_points(6, POINTS, 2, 1.0, &unit);
    search_unit_open(NULL, 0.5, false, HS_WANT_I, &unit);
    for (int trial = 0; trial < 24; trial++) {
        const int64_t n = trial < 4 ? trial : 1 + (int64_t)(random_bits(&random) % MOST);
        const bool    has_shift = trial % 2;
        hs_output     found, sorted;
        bool          right = true;
        fill_pairs(&random, n, trial % 3 == 0 ? 2 : 1000, has_shift, &found);
        hs_test_place_bits = trial % 4 < 2 ? 63 : 3; /* too few for j */
        hs_output_init(&unit.call.account, 2, found.columns, 8, &sorted);
        CHECK(hs_sort_pairs(&unit.call, 0, POINTS, &found, false, NULL, &sorted) == HS_OK);
        hs_test_place_bits = 63;
        CHECK(sorted.n_pairs == n);
        const int64_t *i = hs_output_column(&sorted, HS_WANT_I);
        const int64_t *j = hs_output_column(&sorted, HS_WANT_J);
        const int32_t *shift = hs_output_column(&sorted, HS_WANT_SHIFT);
        const int32_t *of_i = hs_output_column(&found, HS_WANT_I);
        const int32_t *of_j = hs_output_column(&found, HS_WANT_J);
        const int32_t *of_shift = hs_output_column(&found, HS_WANT_SHIFT);
        const double  *d = hs_output_column(&sorted, HS_WANT_DISTANCE);
        memset(seen, 0, sizeof seen);
        for (int64_t p = 0; p < n; p++) {
            const int64_t from = (int64_t)d[p];
            right = right && from >= 0 && from < n && !seen[from];
            seen[from] = true;
            right = right && i[p] == of_i[from] && j[p] == of_j[from];
            right = right && (!has_shift || memcmp(shift + 2 * p, of_shift + 2 * from, 8) == 0);
            right = right && (p + 1 == n || is_in_order(&sorted, shift, p));
        }
        CHECK(right);
        hs_output_free(&found);
        hs_output_free(&sorted);
    }
    search_unit_close(&unit);
}

/* Rows of pairs both ways are those of the pairs and of their mirror images, sorted as pairs. */
static void
rows_have_each_pair_both_ways(void)
{
    harness_random random = {366};
    search_unit_points(6, POINTS, 2, 1.0, &unit);
    search_unit_open(NULL, 0.5, false, HS_WANT_I, &unit);
    for (int trial = 0; trial < 24; trial++) {
        const int64_t n = trial < 4 ? trial : 1 + (int64_t)(random_bits(&random) % MOST / 2);
        const bool    has_shift = trial % 2;
        int64_t       offsets[POINTS + 1], pairs_of[POINTS + 1] = {0};
        hs_output     found, twice, rows, sorted;
        fill_pairs(&random, n, POINTS, has_shift, &found);
        fill_pairs(&random, 2 * n, POINTS, has_shift, &twice);
        int32_t *i = hs_output_column(&found, HS_WANT_I), *j = hs_output_column(&found, HS_WANT_J);
        int32_t *shift = hs_output_column(&found, HS_WANT_SHIFT);
        double  *d = hs_output_column(&found, HS_WANT_DISTANCE);
        int32_t *i2 = hs_output_column(&twice, HS_WANT_I),
                *j2 = hs_output_column(&twice, HS_WANT_J);
        int32_t *shift2 = hs_output_column(&twice, HS_WANT_SHIFT);
        double  *d2 = hs_output_column(&twice, HS_WANT_DISTANCE);
        for (int64_t p = 0; p < n; p++) {
            i2[2 * p] = j2[2 * p + 1] = i[p];
            j2[2 * p] = i2[2 * p + 1] = j[p];
            d2[2 * p] = d2[2 * p + 1] = d[p];
            for (int k = 0; has_shift && k < 2; k++) {
                shift2[4 * p + k] = shift[2 * p + k];
                shift2[4 * p + 2 + k] = -shift[2 * p + k];
            }
            pairs_of[i[p] + 1]++;
            pairs_of[j[p] + 1]++;
        }
        hs_test_place_bits = trial % 4 < 2 ? 63 : 3;
        hs_output_init(&unit.call.account, 2, found.columns, 4, &rows);
        hs_output_init(&unit.call.account, 2, found.columns, 4, &sorted);
        CHECK(hs_sort_pairs(&unit.call, 0, POINTS, &found, true, offsets, &rows) == HS_OK);
        hs_test_place_bits = 63;
        CHECK(hs_sort_pairs(&unit.call, 0, POINTS, &twice, false, NULL, &sorted) == HS_OK);
        CHECK(rows.n_pairs == 2 * n && offsets[0] == 0);
        for (int row = 0; row < POINTS; row++) {
            pairs_of[row + 1] += pairs_of[row];
            CHECK(offsets[row + 1] == pairs_of[row + 1]);
        }
        const size_t size = (size_t)n * 2 * sizeof(int32_t);
        CHECK(n == 0 || memcmp(hs_output_column(&rows, HS_WANT_I),
                               hs_output_column(&sorted, HS_WANT_I), size) == 0);
        CHECK(n == 0 || memcmp(hs_output_column(&rows, HS_WANT_J),
                               hs_output_column(&sorted, HS_WANT_J), size) == 0);
        CHECK(n == 0 || !has_shift ||
              memcmp(hs_output_column(&rows, HS_WANT_SHIFT),
                     hs_output_column(&sorted, HS_WANT_SHIFT), 2 * size) == 0);
        hs_output_free(&found);
        hs_output_free(&twice);
        hs_output_free(&rows);
        hs_output_free(&sorted);
    }
    search_unit_close(&unit);
}

/* Sorts by this many threads; returns the most bytes that are held meanwhile, beside the pairs. */
static int64_t
sort_by(int threads, const hs_output *found, hs_output *sorted)
{
    search_unit_open(NULL, 0.5, false, HS_WANT_I, &unit);
    const int64_t held = unit.call.account.held;
    unit.call.team = hs_team_create(threads);
    hs_output_init(NULL, 2, found->columns, 4, sorted);
    CHECK(hs_sort_pairs(&unit.call, 0, POINTS, found, false, NULL, sorted) == HS_OK);
    CHECK(unit.call.account.held == held);
    const int64_t most = unit.call.account.total.bytes_peak - held;
    search_unit_close(&unit);
    return most;
}

/* Where one point has more than its part of the pairs, threads would need room for them each: then
 * one puts them all in order, the same ones. */
static void
one_thread_sorts_a_crowd(void)
{
    enum { N = 100000, HALF = N / 2, OTHERS = 1 << 16, WORD = sizeof(int64_t) };
    harness_random random = {368};
    search_unit_points(6, POINTS, 2, 1.0, &unit);
    for (int64_t crowd = HALF; crowd < N; crowd += N / 4) {
        hs_output found, alone, sorted;
        fill_pairs(&random, N, 1000, true, &found);
        int32_t *i = hs_output_column(&found, HS_WANT_I);
        for (int64_t p = 0; p < N; p++)
            i[p] = p < crowd ? 3 : 4 + (int32_t)(p % (POINTS - 4));
        CHECK(sort_by(1, &found, &alone) < 2 * N * WORD + OTHERS);
        CHECK(sort_by(2, &found, &sorted) < 2 * N * WORD + OTHERS);
        CHECK(sorted.n_pairs == N);
        for (unsigned column = HS_WANT_I; column <= HS_WANT_DISTANCE; column <<= 1) {
            CHECK(!(found.columns & column) ||
                  memcmp(hs_output_column(&alone, column), hs_output_column(&sorted, column),
                         (size_t)N * hs_output_width(&found, column)) == 0);
        }
        hs_output_free(&alone);
        hs_output_free(&sorted);
        hs_output_free(&found);
    }
}

/* Random pairs, and how they are sorted. */
typedef struct sort_case {
    int64_t n;
    int32_t most_j;
    bool    has_shift, both_ways;
    int     threads, place_bits;
} sort_case;

typedef struct entry {
    int32_t i, j, shift[2];
    double  place; /* among the pairs */
} entry;

static int
order_of_entries(const void *a, const void *b)
{
    const entry *p = a, *q = b;
    const double keys[] = {p->i, p->j, p->shift[0], p->shift[1], p->place};
    const double others[] = {q->i, q->j, q->shift[0], q->shift[1], q->place};
    int          k = 0;
    while (k < 4 && keys[k] == others[k])
        k++;
    return (keys[k] > others[k]) - (keys[k] < others[k]);
}

/* What is to come out, in the order in which qsort puts it; to be freed. */
static entry *
entries_in_order(const sort_case *c, const hs_output *found)
{
    const int      ways = 1 + c->both_ways;
    const int32_t *i = hs_output_column(found, HS_WANT_I), *j = hs_output_column(found, HS_WANT_J);
    const int32_t *shift = hs_output_column(found, HS_WANT_SHIFT);
    entry         *entries = calloc((size_t)(c->n * ways), sizeof *entries);
    for (int64_t e = 0; e < c->n * ways; e++) {
        const int64_t p = e / ways;
        const bool    turned = e % ways;
        entries[e] = (entry){turned ? j[p] : i[p], turned ? i[p] : j[p], {0}, (double)p};
        for (int k = 0; c->has_shift && k < 2; k++)
            entries[e].shift[k] = turned ? -shift[2 * p + k] : shift[2 * p + k];
    }
    qsort(entries, (size_t)(c->n * ways), sizeof *entries, order_of_entries);
    return entries;
}

/* Whether these n are what came out, and the offsets of rows are right. */
static bool
are_entries(const entry *entries, int64_t n, int64_t n_rows, const int64_t *offsets,
            const hs_output *sorted)
{
    const int32_t *i = hs_output_column(sorted, HS_WANT_I);
    const int32_t *j = hs_output_column(sorted, HS_WANT_J);
    const int32_t *shift = hs_output_column(sorted, HS_WANT_SHIFT);
    const double  *d = hs_output_column(sorted, HS_WANT_DISTANCE);
    int64_t        row = 0;
    bool           right = sorted->n_pairs == n;
    for (int64_t e = 0; right && e < n; e++) {
        for (; row <= entries[e].i; row++)
            right = right && offsets[row] == e;
        right = right && i[e] == entries[e].i && j[e] == entries[e].j && d[e] == entries[e].place;
        right = right && (shift == NULL || memcmp(shift + 2 * e, entries[e].shift, 8) == 0);
    }
    for (; row <= n_rows; row++)
        right = right && offsets[row] == n;
    return right;
}

/* Row by row where numbers j lie far apart, in strips of several threads, with places that do not
 * fit behind j; and while allocation after allocation is refused, so many of which are spared. */
static void
every_way_of_sorting_agrees(void)
{
    enum { FAR = 100000, MANY = 100000 };
    static const struct {
        sort_case of;
        int       spared;
    } cases[] = {
        {{300, FAR, false, false, 1, 63}, 0}, {{300, FAR, true, false, 1, 63}, 0},
        {{9000, FAR, true, false, 3, 63}, 0}, {{300, FAR, false, true, 1, 63}, 0},
        {{9000, FAR, true, true, 3, 63}, 0},  {{300, FAR, true, true, 1, 3}, 0},
        {{300, 50, true, true, 1, 63}, 2},    {{300, 50, true, false, 1, 3}, 0},
        {{MANY, 50, false, false, 3, 63}, 4}, {{MANY, 50, false, true, 3, 63}, 4},
        {{MANY, 50, false, true, 3, 3}, 2},   {{MANY, FAR, true, false, 3, 3}, 2},
    };
    harness_random random = {369};
    int64_t       *offsets = calloc(FAR + 1, sizeof *offsets);
    search_unit_points(6, POINTS, 2, 1.0, &unit);
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        const sort_case c = cases[k].of;
        const int64_t   n = c.n << c.both_ways, n_rows = c.both_ways ? c.most_j : POINTS;
        int             n_spared = 0;
        bool            is_over = false;
        hs_output       found, sorted;
        hs_test_place_bits = c.place_bits;
        fill_pairs(&random, c.n, c.most_j, c.has_shift, &found);
        entry *entries = entries_in_order(&c, &found);
        for (int64_t refused = 0; !is_over; refused++) { /* none, the first, the second ... */
            search_unit_open(NULL, 0.5, false, HS_WANT_I, &unit);
            unit.call.team = hs_team_create(c.threads);
            hs_output_init(NULL, 2, found.columns, 4, &sorted);
            CHECK(hs_output_reserve(&sorted, n, 1.0) == HS_OK);
            hs_test_fail_allocation(refused);
            const hs_status status =
                hs_sort_pairs(&unit.call, 0, n_rows, &found, c.both_ways, offsets, &sorted);
            is_over = hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(status == HS_OK || (status == HS_ERR_MEMORY && refused > 0 && !is_over));
            CHECK(status != HS_OK || are_entries(entries, n, n_rows, offsets, &sorted));
            n_spared += status == HS_OK && refused > 0 && !is_over;
            hs_output_free(&sorted);
            search_unit_close(&unit);
        }
        free(entries);
        CHECK(n_spared == cases[k].spared);
        hs_test_place_bits = 63;
        hs_output_free(&found);
    }
    free(offsets);
}

void
test_sort(void)
{
    RUN(all_pairs_are_there_in_order);
    RUN(rows_have_each_pair_both_ways);
    RUN(one_thread_sorts_a_crowd);
    RUN(every_way_of_sorting_agrees);
}
