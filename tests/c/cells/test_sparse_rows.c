/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_sparse_rows.c: sparse cells bring every pair within the cutoff together exactly once,
 * wherever points are, and few others.
 */
#include "../support/sparse_walk.h"
#include "../support/sparse_scenes.h"

void test_sparse_rows(void);

static random_scene shared;
static double       many[3 * SPARSE_MANY];

typedef struct met {
    const brute_list *expected;
    int              *times;
} met;

/* Counts how often each expected pair is met. */
static void
count_pair(void *context, const sparse_scene *s, int32_t si, int32_t sj, const int64_t *image)
{
    const met *counts = context;
    const int  m = s->bins.n_periodic;
    int64_t    reduced[HS_MAX_DIM] = {0}, given[HS_MAX_DIM] = {0};
    int32_t    i = s->bins.order[si], j = s->bins.order[sj];
    brute_pair pair = {.i = i < j ? i : j, .j = i < j ? j : i};
    bool       negate = j < i;
    for (int r = 0; r < m; r++) {
        reduced[r] = image[r];
        if (s->bins.turns.known)
            reduced[r] += hs_turns_get(&s->bins.turns, r, si) - hs_turns_get(&s->bins.turns, r, sj);
    }
    if (!hs_lattice_shift(&s->scene.lattice, reduced, given))
        return;
    for (int r = 0, settled = i != j; r < m && !settled; r++) {
        negate = given[r] < 0;
        settled = given[r] != 0;
    }
    for (int r = 0; r < m; r++)
        pair.shift[s->scene.lattice.vector_of_row[r]] = negate ? -given[r] : given[r];
    const brute_pair *found = bsearch(&pair, counts->expected->pairs, (size_t)counts->expected->n,
                                      sizeof pair, brute_order);
    if (found != NULL)
        counts->times[found - counts->expected->pairs]++;
}

/* Returns the number of pairs, or -1 where the scene is refused or too much for the brute force. */
static int64_t
check_pairs(double width)
{
    brute_list   expected;
    sparse_scene s;
    if (!brute_find(&shared.scene, 3e5, &expected))
        return -1;
    if (sparse_open(&shared.scene, width, &s) != HS_OK) {
        brute_free(&expected);
        return -1;
    }
    met counts = {&expected, calloc((size_t)expected.n + 1, sizeof(int))};
    if (expected.n > 0)
        sparse_walk(&s, count_pair, &counts);
    bool once = true;
    for (int64_t p = 0; p < expected.n; p++)
        once = once && counts.times[p] == 1;
    CHECK(once);
    const int64_t n = expected.n;
    free(counts.times);
    brute_free(&expected);
    sparse_close(&s);
    return n;
}

static void
every_pair_is_met_exactly_once(void)
{
    harness_random random = {65537};
    int            checked[SCENE_KINDS][PLACE_KINDS] = {{0}};
    int64_t        pairs[PLACE_KINDS] = {0};
    for (int trial = 0; trial < (IS_SLOW ? 2 : 12) * SCENE_KINDS * PLACE_KINDS; trial++) {
        const int kind = trial % SCENE_KINDS, place = trial / SCENE_KINDS % PLACE_KINDS;
        const int ndim = 1 + random_below(&random, 4);
        place_scene(&random, kind, place, ndim, 20 + random_below(&random, 70), &shared);
        const int64_t n = check_pairs(random_width(&random));
        checked[kind][place] += n >= 0;
        pairs[place] += n > 0 ? n : 0;
    }
    for (int place = 0; place < PLACE_KINDS; place++) {
        CHECK(checked[SCENE_OPEN][place] >= (IS_SLOW ? 1 : 8));
        CHECK(place == PLACE_EXPONENTIAL || pairs[place] > TRIALS(500));
    }
    for (int kind = 0; kind < SCENE_KINDS; kind++)
        CHECK(checked[kind][PLACE_AS_IS] + checked[kind][PLACE_CLUSTERS] >= (IS_SLOW ? 1 : 8));
}

static void
many_dimensions_are_met_exactly_once(void)
{
    harness_random random = {8128};
    int            checked = 0;
    for (int trial = 0; trial < 60; trial += IS_SLOW ? 7 : 1) {
        place_scene(&random, trial % SCENE_KINDS, trial % PLACE_KINDS, 5 + trial % 4, 20, &shared);
        shared.scene.cutoff = fmin(shared.scene.cutoff, 1.5);
        checked += check_pairs(random_width(&random)) >= 0;
    }
    CHECK(checked > (IS_SLOW ? 2 : 20));
}

/* Cutoffs at the ends of float64, where scaling may lose digits. */
static void
any_unit_of_length_will_do(void)
{
    harness_random random = {496};
    int            checked = 0;
    for (int trial = 0; trial < 200; trial++) {
        static const int exponents[] = {-1000, -300, 300, 1000};
        make_scene(&random, trial % SCENE_KINDS, 1 + trial % 3, 60, 4.0, exponents[trial % 4],
                   &shared);
        if (random_below(&random, 3) == 0)
            shared.scene.cutoff = 0.0;
        if (random_below(&random, 3) == 0)
            shared.x[0] = -1e308;
        checked += check_pairs(random_width(&random)) >= 0;
    }
    CHECK(checked > 100);
}

/* ---- structure ---- */

static bool
rows_ascend(const hs_sparse *sparse, int64_t row)
{
    const int64_t *a = sparse->row_index + (row - 1) * (sparse->ndim - 1);
    const int64_t *b = a + (sparse->ndim - 1);
    for (int k = sparse->ndim - 2; k >= 0; k--) {
        if (a[k] != b[k])
            return a[k] < b[k];
    }
    return false;
}

static bool
point_is_in_place(const sparse_scene *s, int64_t row, int32_t cell, int32_t si)
{
    double x[HS_MAX_DIM];
    for (int k = 0; k < s->bins.ndim; k++)
        x[k] = s->bins.x[k][si];
    for (int k = 0; k < s->bins.ndim; k++) {
        const double  t = hs_lattice_coordinate(&s->scene.lattice, x, k);
        const int64_t own = k == 0 ? s->sparse.cell_x[cell]
                                   : s->sparse.row_index[row * (s->bins.ndim - 1) + k - 1];
        if (hs_sparse_index(&s->grid, k, t) != own)
            return false;
    }
    return true;
}

static void
every_point_is_once_in_its_own_cell(void)
{
    harness_random random = {28};
    int            opened = 0;
    for (int trial = 0; trial < 300; trial++) {
        sparse_scene s;
        bool         seen[SCENE_POINTS] = {false}, right = true;
        const int    n = random_below(&random, trial % 4 ? 60 : SCENE_POINTS + 1);
        place_scene(&random, trial % SCENE_KINDS, trial % PLACE_KINDS,
                    1 + random_below(&random, HS_MAX_DIM), n, &shared);
        shared.scene.cutoff = random_unit(&random);
        if (sparse_open(&shared.scene, random_width(&random), &s) != HS_OK)
            continue;
        opened++;
        int32_t        next = 0;
        const int32_t *start = s.sparse.cell_start;
        CHECK(s.sparse.row_cell[0] == 0 && s.sparse.row_cell[s.sparse.n_rows] == s.sparse.n_cells);
        CHECK(start[s.sparse.n_cells] == n && s.grid.n_cells == s.sparse.n_cells);
        for (int64_t row = 0; row < s.sparse.n_rows; row++) {
            right = right && s.sparse.row_cell[row] < s.sparse.row_cell[row + 1];
            right = right && (row == 0 || rows_ascend(&s.sparse, row));
            for (int32_t c = s.sparse.row_cell[row]; c < s.sparse.row_cell[row + 1]; c++) {
                right = right && start[c] == next && start[c + 1] > next;
                right = right && (c == s.sparse.row_cell[row] ||
                                  s.sparse.cell_x[c - 1] < s.sparse.cell_x[c]);
                for (; next < start[c + 1]; next++) {
                    const int32_t i = s.bins.order[next];
                    right = right && i >= 0 && i < n && !seen[i] && (seen[i] = true);
                    right = right && (next == start[c] || s.bins.order[next - 1] < i);
                    right = right && point_is_in_place(&s, row, c, next);
                }
            }
        }
        CHECK(right && next == n);
        sparse_close(&s);
    }
    CHECK(opened > 150);
}

/* Whatever the hint or cursor, what is found is what a look at every row or cell finds. */
static void
any_hint_finds_the_same(void)
{
    harness_random random = {6};
    for (int trial = 0; trial < 100; trial++) {
        sparse_scene s;
        place_scene(&random, SCENE_OPEN, trial % PLACE_KINDS, 1 + trial % 4, 200, &shared);
        shared.scene.cutoff = 0.3 * random_unit(&random);
        if (sparse_open(&shared.scene, random_width(&random), &s) != HS_OK)
            continue;
        const hs_sparse *sparse = &s.sparse;
        hs_sparse_cursor cursor = {0, 0};
        for (int query = 0; query < 100; query++) {
            int64_t       index[HS_MAX_DIM], hint = random_below(&random, (int)sparse->n_rows + 1);
            const int64_t row = random_below(&random, (int)sparse->n_rows);
            bool          exact = true;
            for (int k = 1; k < sparse->ndim; k++) {
                const int off = random_below(&random, 8) ? 0 : random_below(&random, 3) - 1;
                index[k] = sparse->row_index[row * (sparse->ndim - 1) + k - 1] + off;
                exact = exact && off == 0;
            }
            const int64_t found = hs_sparse_find_row(sparse, index, &hint);
            CHECK(!exact || found == row);
            for (int k = 1; found >= 0 && k < sparse->ndim; k++)
                CHECK(sparse->row_index[found * (sparse->ndim - 1) + k - 1] == index[k]);
            CHECK(hint >= 0 && hint <= sparse->n_rows);

            const int32_t low = sparse->row_cell[row], high = sparse->row_cell[row + 1];
            const int64_t x = sparse->cell_x[low + random_below(&random, high - low)];
            const int64_t x_first = x - random_below(&random, 6), x_last = x_first + 9;
            int32_t       first, end, count = 0;
            if (random_below(&random, 3) == 0)
                cursor = (hs_sparse_cursor){random_below(&random, 300), random_below(&random, 300)};
            hs_sparse_window(sparse, row, x_first, x_last, &cursor, &first, &end);
            for (int32_t c = low; c < high; c++) {
                if (sparse->cell_x[c] < x_first || sparse->cell_x[c] > x_last)
                    continue;
                CHECK(sparse->cell_start[c] >= first && sparse->cell_start[c + 1] <= end);
                count += sparse->cell_start[c + 1] - sparse->cell_start[c];
            }
            CHECK(count == end - first);
        }
        sparse_close(&s);
    }
}

static void
groups_are_whole_rows_in_short_pieces(void)
{
    harness_random random = {2718};
    for (int trial = 0; trial < 100; trial++) {
        sparse_scene s;
        place_scene(&random, trial % SCENE_KINDS, trial % PLACE_KINDS, 1 + trial % 3, 300, &shared);
        const int32_t most = 1 + random_below(&random, 20);
        if (sparse_open(&shared.scene, random_width(&random), &s) != HS_OK)
            continue;
        int32_t next = 0;
        for (int64_t row = 0; row < s.sparse.n_rows; row++) {
            hs_sparse_group group;
            hs_sparse_first_group(&s.sparse, row, &group);
            while (hs_sparse_next_group(&s.sparse, row, most, &group)) {
                CHECK(group.first == next && group.last > next && group.last - next <= most);
                CHECK(group.x_last - group.x_first < HS_SPARSE_SPLIT);
                CHECK(point_is_in_place(&s, row, group.cell, group.last - 1));
                CHECK(s.sparse.cell_x[group.cell] == group.x_last);
                /* Full, or the row ends, or its next cell is too far on. */
                CHECK(group.last - next == most || group.cell + 1 == s.sparse.row_cell[row + 1] ||
                      s.sparse.cell_x[group.cell + 1] >= group.x_first + HS_SPARSE_SPLIT);
                next = group.last;
            }
            CHECK(next == s.sparse.cell_start[s.sparse.row_cell[row + 1]]);
        }
        CHECK(next == s.bins.n);
        sparse_close(&s);
    }
}

/* ---- cost ---- */

static void
count_within(void *context, const sparse_scene *s, int32_t si, int32_t sj, const int64_t *image)
{
    double square = 0.0;
    (void)image;
    for (int k = 0; k < s->bins.ndim; k++) {
        const double along = s->bins.x[k][sj] - s->bins.x[k][si];
        square += along * along;
    }
    *(int64_t *)context += square <= s->scene.cutoff * s->scene.cutoff;
}

/* Candidates follow points and pairs: at most the ratio of a block of cells to a ball. */
static void
candidates_follow_points_and_pairs(void)
{
    harness_random random = {1618};
    for (int kind = 0; kind < SPARSE_MANY_KINDS; kind += IS_SLOW ? 3 : 1) {
        const brute_scene scene = {
            .ndim = 3, .n = SPARSE_MANY, .x = many, .cutoff = 1.0, .inclusive = true};
        sparse_scene s;
        int64_t      pairs = 0;
        many_points(&random, kind, many);
        CHECK(sparse_open(&scene, 1.0, &s) == HS_OK);
        const int64_t candidates = sparse_walk(&s, count_within, &pairs);
        CHECK(candidates >= pairs);
        CHECK((double)candidates < 9.0 * (double)(SPARSE_MANY + pairs));
        CHECK(s.account.total.bytes_peak < 90 * SPARSE_MANY);
        sparse_close(&s);
    }
}

static void
allocation_failures_leave_nothing(void)
{
    harness_random random = {577};
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        int       nth = 0;
        hs_status status = HS_ERR_MEMORY;
        bool      ended = false;
        place_scene(&random, kind, PLACE_CLUSTERS, 3, 300, &shared);
        while (!ended && nth < 100) {
            const int64_t before = hs_test_live_blocks();
            sparse_scene  s;
            hs_test_fail_allocation(++nth);
            status = sparse_open(&shared.scene, 1.0, &s);
            ended = hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(status == HS_OK || status == HS_ERR_MEMORY);
            if (status == HS_OK)
                sparse_close(&s);
            CHECK(hs_test_live_blocks() == before && s.account.held == 0);
        }
        CHECK(ended && status == HS_OK && nth > 7);
    }
}

static bool
stop_at_third(void *context, double fraction)
{
    (void)fraction;
    return ++*(int *)context < 3;
}

static void
an_interrupt_leaves_nothing(void)
{
    enum { POINTS = 3 << 17 };
    double      *x = malloc(POINTS * sizeof *x);
    int          polls = 0;
    hs_points    points = {.data = x,
                           .n = POINTS,
                           .ndim = 1,
                           .real = HS_FLOAT64,
                           .row_stride = sizeof *x,
                           .column_stride = sizeof *x};
    hs_options   options = hs_options_default();
    sparse_scene s;
    hs_failure   failure;
    options.cutoff = 1.0;
    for (int i = 0; i < POINTS; i++)
        x[i] = (double)(i * INT64_C(7919) % POINTS);
    hs_account_init(&s.account, &options);
    CHECK(hs_scene_init(&s.account, NULL, &points, NULL, &options, &s.scene, &failure) == HS_OK);
    CHECK(hs_grid_init(&s.scene, &s.dense, &failure) == HS_OK);
    hs_sparse_grid(&s.scene, &s.dense, 1.0, &s.grid);
    options.poll = stop_at_third;
    options.poll_context = &polls;
    CHECK(hs_sparse_build(&s.account, NULL, &options, &s.scene, &s.grid, &s.sparse, &s.bins) ==
          HS_ERR_INTERRUPTED);
    CHECK(polls == 3 && s.account.held == 0);
    free(x);
}

void
test_sparse_rows(void)
{
    RUN(every_pair_is_met_exactly_once);
    RUN(many_dimensions_are_met_exactly_once);
    RUN(any_unit_of_length_will_do);
    RUN(every_point_is_once_in_its_own_cell);
    RUN(any_hint_finds_the_same);
    RUN(groups_are_whole_rows_in_short_pieces);
    RUN(candidates_follow_points_and_pairs);
    RUN(allocation_failures_leave_nothing);
    RUN(an_interrupt_leaves_nothing);
}
