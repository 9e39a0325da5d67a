/* SPDX-License-Identifier: BSD-3-Clause */
/* test_pair_list_search.c: the pieces hold each pair once, in bundles of one point and one image;
 * what is in another image is apart. */
#include "../../../csrc/core/verlet/pair_list_search.h"
#include "../support/search_unit.h"

void test_pair_list_search(void);

enum { N = 50, IMAGES = 7, MOST = 3 }; /* images -3 ... 3 along each of two axes */

static search_unit unit;
static uint8_t     met[N][N][IMAGES][IMAGES];

/* An open search whose points are told by their places. */
static void
open_search(const hs_box *box, int64_t n, double side, double cutoff, int n_threads)
{
    search_unit_points(55, n, 2, side, &unit);
    search_unit_open(box, cutoff, false, HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT, &unit);
    for (int32_t si = 0; si < n; si++)
        unit.search.bins.order[si] = si;
    unit.call.team = hs_team_create(n_threads);
}

/* Bundles of one part: in order, none empty, of this range of points. */
static int64_t
wrong_bundles(const hs_part *part, int m, int32_t first, int32_t end, bool is_shifted)
{
    const int32_t *b = hs_output_column(&part->pairs, HS_WANT_J);
    int64_t        wrong = 0, begin = 0;
    for (int64_t u = 0; u < part->n_bundles; u++) {
        const hs_bundle *bundle = &part->bundles[u];
        const int32_t   *shift = is_shifted ? part->shift + u * m : NULL;
        const bool       again = u > 0 && bundle->point == bundle[-1].point;
        bool             any = false;
        for (int r = 0; r < m && is_shifted; r++)
            any = any || shift[r] != 0;
        wrong += bundle->end <= begin || any != is_shifted;
        wrong += bundle->point < first || bundle->point >= end;
        wrong += u > 0 && bundle->point < bundle[-1].point;
        wrong += again && !is_shifted;
        wrong += again && is_shifted &&
                 memcmp(shift, part->shift + (u - 1) * m, (size_t)m * sizeof *shift) == 0;
        for (int64_t e = begin; e < bundle->end; e++)
            wrong += b[e] < 0 || b[e] >= unit.search.bins.n;
        begin = bundle->end;
    }
    return wrong + (begin != part->pairs.n_pairs);
}

static int64_t
wrong_pieces(const hs_pieces *pieces)
{
    const int64_t n = unit.search.bins.n;
    const int     m = unit.search.bins.n_periodic;
    int64_t       wrong = 0;
    for (int64_t p = 0; p < pieces->n; p++) {
        /* A group of points begins in the range, and may end behind it. */
        const int32_t first = (int32_t)(n * p / pieces->n);
        wrong += wrong_bundles(&pieces->of[p].plain, m, first, (int32_t)n, false);
        wrong += wrong_bundles(&pieces->of[p].shifted, m, first, (int32_t)n, true);
    }
    return wrong;
}

/* Pairs of a part, each the right way round; of a point and itself, the first shift positive. */
static int64_t
meet(const hs_part *part, bool is_shifted)
{
    const int32_t *b = hs_output_column(&part->pairs, HS_WANT_J);
    int64_t        wrong = 0;
    for (int64_t u = 0, e = 0; u < part->n_bundles; u++) {
        const int32_t *shift = part->shift + 2 * u;
        for (; e < part->bundles[u].end; e++) {
            const int32_t a = part->bundles[u].point;
            const int32_t S[2] = {is_shifted ? shift[0] : 0, is_shifted ? shift[1] : 0};
            const int32_t sign = a <= b[e] ? 1 : -1;
            const int32_t low = a < b[e] ? a : b[e], high = a < b[e] ? b[e] : a;
            wrong += a == b[e] && (S[0] < 0 || (S[0] == 0 && S[1] <= 0));
            wrong += met[low][high][sign * S[0] + MOST][sign * S[1] + MOST]++ > 0;
        }
    }
    return wrong;
}

/* Pairs of points in cell order and of their images, in a box whose rows are those of B. */
static int64_t
missing_pairs(const hs_box *box, double cutoff)
{
    const double unscale = hs_scale_apply(unit.search.scene.unscale, 1.0);
    int64_t      wrong = 0;
    for (int a = 0; a < N; a++) {
        for (int b = a; b < N; b++) {
            for (int image = 0; image < IMAGES * IMAGES; image++) {
                const int S[2] = {image / IMAGES - MOST, image % IMAGES - MOST};
                double    square = 0.0;
                for (int k = 0; k < 2; k++) {
                    const double *const x = unit.search.bins.x[k];
                    const double        D =
                        (x[b] - x[a]) * unscale + S[0] * box->rows[0][k] + S[1] * box->rows[1][k];
                    square += D * D;
                }
                const bool own = a == b && (S[0] < 0 || (S[0] == 0 && S[1] <= 0));
                wrong += met[a][b][S[0] + MOST][S[1] + MOST] != (square <= cutoff * cutoff && !own);
            }
        }
    }
    return wrong;
}

/* Upright, and skewed so that the images found are not those over the box vectors as given; the
 * cutoff reaches beyond the next image. */
static void
each_pair_is_in_one_piece(void)
{
    const hs_box boxes[] = {
        {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.25}}},
        {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.75, 1.0}}},
    };
    for (int trial = 0; trial < 8; trial++) {
        const hs_box *box = &boxes[trial % 2];
        const int     n_threads = 1 + trial / 2 % 2;
        const double  cutoff = trial < 4 ? 0.25 : 1.4;
        hs_failure    failure = HS_NO_FAILURE;
        hs_pieces     pieces;
        int64_t       wrong = 0;
        open_search(box, N, 1.0, cutoff, n_threads);
        const int64_t held = unit.call.account.held;
        CHECK(hs_pieces_find(&unit.search, &pieces, &failure) == HS_OK);
        CHECK(pieces.n == (n_threads > 1 ? 4 * n_threads : 1));
        CHECK(wrong_pieces(&pieces) == 0);
        memset(met, 0, sizeof met);
        for (int64_t p = 0; p < pieces.n; p++)
            wrong += meet(&pieces.of[p].plain, false) + meet(&pieces.of[p].shifted, true);
        CHECK(wrong == 0 && missing_pairs(box, cutoff) == 0);
        hs_pieces_free(&unit.call.account, &pieces);
        CHECK(pieces.n == 0 && pieces.of == NULL && unit.call.account.held == held);
        hs_pieces_free(&unit.call.account, &pieces); /* harmless */
        search_unit_close(&unit);
    }
}

/* More bundles than there is room for at first, with images and without; what was done is noted. */
static void
bundles_grow(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {0.0, 4.0}}};
    hs_pieces    pieces;
    hs_failure   failure = HS_NO_FAILURE;
    int64_t      n_pairs[2] = {0};
    for (int n_threads = 1; n_threads < 3; n_threads++) {
        open_search(&box, 2000, 4.0, 0.9, n_threads);
        CHECK(hs_pieces_find(&unit.search, &pieces, &failure) == HS_OK);
        CHECK(wrong_pieces(&pieces) == 0);
        CHECK(n_threads > 1 ||
              (pieces.of[0].plain.n_bundles > 1024 && pieces.of[0].shifted.n_bundles > 1024));
        for (int64_t p = 0; p < pieces.n; p++) {
            n_pairs[n_threads - 1] +=
                pieces.of[p].plain.pairs.n_pairs + pieces.of[p].shifted.pairs.n_pairs;
        }
        CHECK(unit.call.done.candidates >= n_pairs[n_threads - 1] && unit.call.done.groups > 30);
        hs_pieces_free(&unit.call.account, &pieces);
        search_unit_close(&unit);
    }
    CHECK(n_pairs[0] == n_pairs[1] && n_pairs[0] > 300000);
}

/* Whichever allocation fails: nothing is held, and no pair is left out. */
static void
refused_pieces_hold_nothing(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.25}}};
    open_search(&box, 300, 1.0, 0.3, 1);
    const int64_t held = unit.call.account.held, blocks = hs_test_live_blocks();
    bool          ended = false;
    int64_t       n_pairs = -1; /* of the last that were found */
    int           nth = 0;
    while (!ended && nth < 200) {
        hs_pieces  pieces = {0};
        hs_failure failure = HS_NO_FAILURE;
        hs_test_fail_allocation(++nth);
        const hs_status status = hs_pieces_find(&unit.search, &pieces, &failure);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || (status == HS_ERR_MEMORY && !ended && pieces.of == NULL));
        if (status == HS_OK) { /* also without room that is taken ahead */
            const int64_t found =
                pieces.of[0].plain.pairs.n_pairs + pieces.of[0].shifted.pairs.n_pairs;
            CHECK(wrong_pieces(&pieces) == 0 && (n_pairs < 0 || found == n_pairs));
            n_pairs = found;
        }
        hs_pieces_free(&unit.call.account, &pieces);
        CHECK(unit.call.account.held == held && hs_test_live_blocks() == blocks);
    }
    CHECK(ended && nth > 15);
    search_unit_close(&unit);
}

/* What a part that gets no pair takes: nothing. */
static void
open_space_has_no_shifts(void)
{
    hs_pieces  pieces;
    hs_failure failure = HS_NO_FAILURE;
    open_search(NULL, 400, 2.0, 0.2, 1);
    CHECK(hs_pieces_find(&unit.search, &pieces, &failure) == HS_OK && wrong_pieces(&pieces) == 0);
    CHECK(pieces.of[0].plain.n_bundles > 100 && pieces.of[0].shifted.n_bundles == 0);
    CHECK(pieces.of[0].shifted.pairs.capacity == 0 && pieces.of[0].shifted.bundles == NULL);
    hs_pieces_free(&unit.call.account, &pieces);
    search_unit_close(&unit);
}

/* In a basis that turns axes round, a point and its image in negative direction are listed the
 * other way round. */
static void
own_images_are_in_positive_direction(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    for (int signs = 0; signs < 4; signs++) {
        hs_pieces  pieces;
        hs_failure failure = HS_NO_FAILURE;
        open_search(&box, 10, 1.0, 1.5, 1);
        for (int r = 0; r < 2; r++)
            unit.search.scene.lattice.U[r][r] = signs >> r & 1 ? -1 : 1;
        CHECK(hs_pieces_find(&unit.search, &pieces, &failure) == HS_OK);
        memset(met, 0, sizeof met);
        CHECK(wrong_pieces(&pieces) == 0 && meet(&pieces.of[0].shifted, true) == 0);
        CHECK(met[0][0][MOST][MOST + 1] == 1 && met[0][0][MOST + 1][MOST] == 1);
        CHECK(met[0][0][MOST + 1][MOST + 1] == 1 && met[0][0][MOST + 1][MOST - 1] == 1);
        hs_pieces_free(&unit.call.account, &pieces);
        search_unit_close(&unit);
    }
}

/* Shifts are int32, and so are those in the opposite direction. */
static void
shifts_are_int32_either_way(void)
{
    static const int64_t most[] = {INT32_MAX, -INT32_MAX, INT64_C(1) << 31, -(INT64_C(1) << 31)};
    const hs_box         box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    for (int trial = 0; trial < 8; trial++) {
        const int  r = trial % 2;
        hs_pieces  pieces;
        hs_failure failure = HS_NO_FAILURE;
        unit.x[r] = 0.375;
        unit.x[2 + r] = 0.625; /* wrapped to -0.375 */
        unit.x[1 - r] = unit.x[3 - r] = 0.25;
        unit.points = (hs_points){unit.x, 2, 2, HS_FLOAT64, 16, 8};
        search_unit_open(&box, 0.3, false, HS_WANT_SHIFT, &unit);
        unit.search.bins.order[0] = 0;
        unit.search.bins.order[1] = 1;
        unit.search.scene.lattice.U[r][r] = most[trial / 2];
        const hs_status status = hs_pieces_find(&unit.search, &pieces, &failure);
        CHECK(status == (trial < 4 ? HS_OK : HS_ERR_SHIFT_RANGE));
        if (status == HS_OK) {
            const hs_part *part = &pieces.of[0].shifted;
            CHECK(part->pairs.n_pairs == 1 && part->n_bundles == 1);
            CHECK(llabs(part->shift[r]) == INT32_MAX && part->shift[1 - r] == 0);
            hs_pieces_free(&unit.call.account, &pieces);
        } else {
            CHECK(pieces.of == NULL && (failure.row == 0 || failure.row == 1));
        }
        search_unit_close(&unit);
    }
}

void
test_pair_list_search(void)
{
    RUN(each_pair_is_in_one_piece);
    RUN(bundles_grow);
    RUN(refused_pieces_hold_nothing);
    RUN(open_space_has_no_shifts);
    RUN(own_images_are_in_positive_direction);
    RUN(shifts_are_int32_either_way);
}
