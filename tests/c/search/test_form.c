/* SPDX-License-Identifier: BSD-3-Clause */
/* test_form.c: thresholds that were kept are those of the extent that asks; candidates far from a
 * group are left out, and none that a point of it needs. */
#include "../../../csrc/core/search/form.h"
#include "../../../csrc/core/search/scan.h"
#include "../support/search_unit.h"

#include <math.h>

void test_form(void);

static search_unit unit;

static void
open_walker(double side, double cutoff, hs_walker *walker)
{
    search_unit_points(271828, 1500, 3, side, &unit);
    search_unit_open(NULL, cutoff, false, HS_WANT_I, &unit);
    CHECK(hs_walker_init(&unit.search, HS_BLOCK_COUNTS, NULL, NULL, walker) == HS_OK);
}

static void
close_walker(hs_walker *walker)
{
    hs_walker_close(&unit.search, walker);
    search_unit_close(&unit);
}

/* Sizes of more orders than are kept, again and again: forms take each other's places. */
static void
forms_are_those_of_their_extent(void)
{
    harness_random random = {31415};
    hs_walker      walker;
    open_walker(8.0, 1.0, &walker);
    hs_scanner *scanner = &walker.scanner;
    for (int trial = 0; trial < 2000; trial++) {
        const float size = (float)ldexp(1.0 + random_unit(&random), trial % 5 - 1);
        scanner->group.largest = hs_bits_of_float(size);
        hs_form_set(scanner);
        const hs_form      *form = scanner->form;
        const double        extent = form->extent, error = unit.search.filter_error;
        const double        cutoff = unit.search.scene.cutoff;
        const hs_thresholds direct = hs_thresholds_of(3, cutoff, extent, error);
        const hs_expanded   expanded = hs_expanded_of(3, cutoff, extent, error);
        CHECK(extent >= 2.0 * (double)size && extent <= 2.0 * (double)size * (1.0 + 1.0 / 32.0));
        CHECK(form->direct.in == direct.in && form->direct.out == direct.out);
        CHECK(form->expanded.in == expanded.in && form->expanded.out == expanded.out);
        CHECK(form->scan == (hs_expanded_pays(cutoff, extent) ? unit.call.kernel->count
                                                              : unit.call.kernel->count_direct));
    }
    scanner->group.largest = UINT32_C(0x7fc00000);
    hs_form_set(scanner);
    CHECK(scanner->form->direct.in == -1.0f && scanner->form->direct.out == INFINITY);
    close_walker(&walker);
}

/* The box is that of the points, and a candidate is near if it is within the cutoff of one. */
static void
groups_know_what_is_near(void)
{
    hs_walker walker;
    open_walker(8.0, 1.0, &walker);
    hs_scanner   *scanner = &walker.scanner;
    hs_group     *group = &scanner->group;
    const int32_t last = 20;
    hs_group_start(&unit.search.bins, 0, last, group);
    CHECK(group->near.out == INFINITY);
    hs_form_prune(scanner);
    const double cutoff = unit.search.scene.cutoff;
    CHECK((double)group->near.out > cutoff * cutoff);
    CHECK((double)group->near.out < cutoff * cutoff * (1.0 + 1e-5));
    for (int k = 0; k < 3; k++) {
        bool is_low = false, is_high = false;
        for (int32_t t = 0; t < last; t++) {
            CHECK(group->q[k][t] >= group->near.low[k] && group->q[k][t] <= group->near.high[k]);
            is_low = is_low || group->q[k][t] == group->near.low[k];
            is_high = is_high || group->q[k][t] == group->near.high[k];
        }
        CHECK(is_low && is_high);
    }
    close_walker(&walker);
}

/* All points are candidates of a group: those left out are tested no more, and no pair is lost. */
static void
far_candidates_are_not_tested(void)
{
    static const double cutoffs[] = {0.0, 0.3, 1.0, 20.0};
    hs_walker           walker;
    for (int c = 0; c < 4; c++) {
        open_walker(8.0, cutoffs[c], &walker);
        const int32_t n = (int32_t)unit.points.n;
        const int32_t image[HS_MAX_DIM] = {0};
        const double  shift[HS_MAX_DIM] = {0.0};
        int64_t       within = 0;
        for (int32_t first = 0; first < n; first += 20) {
            hs_scanner_start(&walker.scanner, first, first + 20);
            CHECK(hs_scanner_append(&walker.scanner, first, n, shift, image) == HS_OK);
            CHECK(hs_scanner_finish(&walker.scanner) == HS_OK);
        }
        for (int i = 0; i < n; i++) {
            for (int j = 0; j < i; j++) {
                double square = 0.0;
                for (int k = 0; k < 3; k++) {
                    const double along = unit.x[3 * i + k] - unit.x[3 * j + k];
                    square += along * along;
                }
                within += square <= cutoffs[c] * cutoffs[c];
            }
        }
        const int64_t all = (int64_t)n * (n - 1) / 2;
        CHECK(walker.scanner.n_found == within);
        CHECK(c == 3 ? walker.scanner.n_candidates == all : walker.scanner.n_candidates < all / 2);
        close_walker(&walker);
    }
}

void
test_form(void)
{
    RUN(forms_are_those_of_their_extent);
    RUN(groups_know_what_is_near);
    RUN(far_candidates_are_not_tested);
}
