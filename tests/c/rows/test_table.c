/* SPDX-License-Identifier: BSD-3-Clause */
/* test_table.c: rows of neighbours, both ways, from one list. */
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/output_checks.h"
#include "../support/random_scenes.h"

void test_table(void);

static random_scene shared;

static int64_t
number_at(const void *numbers, int index_bytes, int64_t e)
{
    return index_bytes == 8 ? ((const int64_t *)numbers)[e] : ((const int32_t *)numbers)[e];
}

/* Whether i, j and both say the same, and i is the row. */
static bool
rows_are_consistent(const hs_pairs *rows, int index_bytes)
{
    const int64_t *offsets = hs_pairs_offsets(rows);
    const void    *i = hs_pairs_array(rows, HS_WANT_I), *j = hs_pairs_array(rows, HS_WANT_J);
    const void    *both = hs_pairs_array(rows, HS_WANT_BOTH);
    bool           right = offsets[hs_pairs_rows(rows)] == hs_pairs_length(rows);
    for (int64_t row = 0; row < hs_pairs_rows(rows); row++) {
        for (int64_t e = offsets[row]; e < offsets[row + 1]; e++) {
            right = right && number_at(i, index_bytes, e) == row;
            right = right && number_at(both, index_bytes, 2 * e) == row;
            right = right &&
                    number_at(both, index_bytes, 2 * e + 1) == number_at(j, index_bytes, e);
        }
    }
    return right;
}

/* i and j of 4 and 8 bytes, alone and side by side, with and without measures: the same rows. */
static void
every_shape_of_columns_has_the_same_rows(void)
{
    static const unsigned wants[] = {HS_WANT_I | HS_WANT_J | HS_WANT_BOTH, WANT_ALL | HS_WANT_BOTH};
    harness_random        random = {606};
    int64_t               n_entries = 0;
    for (int trial = 0; trial < THIRD_OF_TRIALS(200); trial++) {
        make_scene(&random, trial % SCENE_KINDS, 1 + trial % 4, random_below(&random, 80), 4.0, 0,
                   &shared);
        const hs_points points = points_of(&shared.scene);
        const hs_points queries = {points.data, points.n / 2,      points.ndim,
                                   HS_FLOAT64,  points.row_stride, points.column_stride};
        hs_options      options = options_of(&shared.scene);
        for (int shape = 0; shape < 8; shape++) {
            const hs_points *asking = shape & 4 ? &queries : NULL;
            hs_pairs        *rows = NULL, *full = NULL;
            caller_arrays    c;
            options.want = wants[shape & 1];
            options.index_bytes = shape & 2 ? 4 : 8;
            options.threads = 1 + trial % 2;
            options.out = NULL;
            CHECK(hs_neighbors_find(QUERIED(&points, asking, shared.scene.box), &options, &rows,
                                    NULL) == HS_OK);
            const int64_t n = hs_pairs_length(rows);
            CHECK(hs_pairs_rows(rows) == (asking != NULL ? queries.n : points.n));
            CHECK(rows_are_consistent(rows, options.index_bytes));
            make_arrays(options.want, points.ndim, options.index_bytes, n, &c);
            options.out = &c.arrays;
            CHECK(hs_neighbors_find(QUERIED(&points, asking, shared.scene.box), &options, &full,
                                    NULL) == HS_OK);
            CHECK(same_as_result(&c, rows, n) && untouched_from(&c, n));
            hs_array_free(hs_pairs_take_offsets(rows));
            CHECK(hs_pairs_rows(rows) == 0 && hs_pairs_offsets(rows) == NULL);
            free_arrays(&c);
            hs_pairs_free(full);
            hs_pairs_free(rows);
            n_entries += n;
        }
    }
    CHECK(n_entries > THIRD_OF_TRIALS(100000));
}

static bool
go_on_until(void *context, double fraction)
{
    int *left = context;
    (void)fraction;
    return (*left)-- > 0;
}

/* Over a million entries in long rows: kept by one walk, or written to the caller's arrays at once;
 * the caller may stop either at any time. */
static void
long_rows_are_the_same_by_one_walk(void)
{
    enum { N = 2500 };
    static double  x[3 * N];
    harness_random random = {15};
    for (int e = 0; e < 3 * N; e++) {
        x[e] = random_unit(&random);
    }
    const hs_points points = {x, N, 3, HS_FLOAT64, 24, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *rows = NULL, *into = NULL;
    hs_status       status = HS_ERR_INTERRUPTED;
    caller_arrays   c;
    int             n_stopped = 0;
    options.cutoff = 0.45;
    options.want = HS_WANT_I | HS_WANT_J;
    options.poll = go_on_until;
    for (int polls = 0; status != HS_OK && polls < 1000; polls += 1 + polls / 4) {
        int left = polls;
        options.poll_context = &left;
        status = hs_neighbors_find(AMONG(&points, NULL), &options, &rows, NULL);
        CHECK(status == HS_OK || (status == HS_ERR_INTERRUPTED && rows == NULL));
        n_stopped += status != HS_OK;
    }
    CHECK(status == HS_OK && n_stopped > 0 && hs_pairs_length(rows) > 1 << 20);
    options.poll = NULL;
    make_arrays(options.want, 3, 8, hs_pairs_length(rows), &c);
    options.out = &c.arrays;
    CHECK(hs_neighbors_find(AMONG(&points, NULL), &options, &into, NULL) == HS_OK);
    CHECK(same_as_result(&c, rows, hs_pairs_length(rows)));
    free_arrays(&c);
    hs_pairs_free(into);
    hs_pairs_free(rows);
}

void
test_table(void)
{
    RUN(every_shape_of_columns_has_the_same_rows);
    RUN(long_rows_are_the_same_by_one_walk);
}
