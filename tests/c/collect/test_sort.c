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
        const int bits = hs_test_sort_place_bits(trial % 4 < 2 ? 63 : 3); /* too few for j */
        hs_output_init(&unit.call.account, 2, found.columns, 8, &sorted);
        CHECK(hs_sort_pairs(&unit.call, 0, POINTS, &found, false, NULL, &sorted) == HS_OK);
        CHECK(hs_test_sort_place_bits(bits) == (trial % 4 < 2 ? 63 : 3));
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
        const int bits = hs_test_sort_place_bits(trial % 4 < 2 ? 63 : 3);
        hs_output_init(&unit.call.account, 2, found.columns, 4, &rows);
        hs_output_init(&unit.call.account, 2, found.columns, 4, &sorted);
        CHECK(hs_sort_pairs(&unit.call, 0, POINTS, &found, true, offsets, &rows) == HS_OK);
        (void)hs_test_sort_place_bits(bits);
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
    for (int64_t crowd = HALF; crowd <= HALF + 1; crowd++) {
        hs_output found, alone, sorted;
        fill_pairs(&random, N, 1000, false, &found);
        int32_t *i = hs_output_column(&found, HS_WANT_I);
        for (int64_t p = 0; p < N; p++)
            i[p] = p < crowd ? 3 : 4 + (int32_t)(p % (POINTS - 4));
        CHECK(sort_by(1, &found, &alone) < (N + crowd) * WORD + OTHERS);
        const int64_t most = sort_by(2, &found, &sorted);
        CHECK(crowd == HALF ? most >= (N + 2 * crowd) * WORD : most < (N + crowd) * WORD + OTHERS);
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

void
test_sort(void)
{
    RUN(all_pairs_are_there_in_order);
    RUN(rows_have_each_pair_both_ways);
    RUN(one_thread_sorts_a_crowd);
}
