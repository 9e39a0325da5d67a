/* SPDX-License-Identifier: BSD-3-Clause */
/* test_form.c: thresholds that were kept are those of the extent that asks; candidates far from a
 * group are left out, and none that a point of it needs. */
#include "../../../csrc/core/search/form.h"
#include "../../../csrc/core/search/scan.h"
#include "../../../csrc/core/search/limits.h"
#include "../support/search_unit.h"

#include <math.h>

void test_form(void);

/* Candidates that are worth leaving some out, and fewer that are where limits are short. */
enum { MANY = 300, FEWER = 64 };

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
        const bool pays = hs_expanded_pays(cutoff, extent);
        CHECK(form->expanded.in == (pays ? expanded.in : 0.0));
        CHECK(form->expanded.out == (pays ? expanded.out : 0.0));
        CHECK(form->scan == (pays ? unit.call.kernel->count : unit.call.kernel->count_direct));
    }
    scanner->group.largest = UINT32_C(0x7fc00000);
    hs_form_set(scanner);
    CHECK(scanner->form->direct.in == -1.0f && scanner->form->direct.out == INFINITY);
    close_walker(&walker);
}

/* In a scene whose scaled numbers may be off, only what is within a shorter cutoff is surely in. */
static void
what_is_surely_in_is_so_for_the_low_cutoff(void)
{
    hs_walker walker;
    int       n_expanded = 0;
    open_walker(8.0, 1.0, &walker);
    hs_scanner *scanner = &walker.scanner;
    hs_scene   *scene = &unit.search.scene;
    scene->extreme = true;
    for (int trial = 0; trial < 8; trial++) {
        const double low = trial % 2 ? 0.75 : 0.0, error = unit.search.filter_error;
        const double cutoff = scene->cutoff;
        scene->cutoff_low = low;
        scanner->group.largest = hs_bits_of_float(ldexpf(1.5f, trial - 3));
        hs_form_set(scanner);
        const hs_form *form = scanner->form;
        const double   extent = form->extent;
        CHECK(form->direct.out == hs_thresholds_of(3, cutoff, extent, error).out);
        CHECK(form->direct.in == (low > 0.0 ? hs_thresholds_of(3, low, extent, error).in : -1.0f));
        if (hs_expanded_pays(cutoff, extent)) {
            const hs_expanded of_low = hs_expanded_of(3, low, extent, error);
            CHECK(form->expanded.out == hs_expanded_of(3, cutoff, extent, error).out);
            CHECK(form->expanded.in == (low > 0.0 ? of_low.in : -INFINITY));
            n_expanded++;
        }
    }
    CHECK(n_expanded >= 2);
    close_walker(&walker);
}

/* What a walker has found out serves the next search, of the same cutoff and errors only. */
static void
thresholds_are_kept_for_the_next_search(void)
{
    hs_walker walker;
    open_walker(8.0, 1.0, &walker);
    hs_scene *scene = &unit.search.scene;
    walker.scanner.group.largest = hs_bits_of_float(1.5f);
    hs_form_set(&walker.scanner);
    hs_form *form = &walker.scanner.forms[walker.scanner.form - walker.scanner.forms];
    for (int turn = 0; turn < 5; turn++) {
        form->direct.in = 0.5f; /* it is left like that */
        scene->cutoff = turn == 1 ? 1.25 : scene->cutoff;
        unit.search.filter_error += turn == 2 ? 1e-9 : 0.0;
        scene->extreme = turn >= 3;
        scene->cutoff_low = turn == 4 ? 1.0 : scene->cutoff; /* the same cutoff, known less well */
        hs_form_set(&walker.scanner);
        const double        cutoff = scene->cutoff, error = unit.search.filter_error;
        const hs_thresholds direct = hs_thresholds_of(3, cutoff, form->extent, error);
        const hs_thresholds low = hs_thresholds_of(3, scene->cutoff_low, form->extent, error);
        CHECK(walker.scanner.form == form && form->direct.out == direct.out);
        CHECK(form->direct.in == (turn == 0 ? 0.5f : low.in));
        CHECK(hs_expanded_pays(cutoff, form->extent));
        CHECK(form->expanded.out == hs_expanded_of(3, cutoff, form->extent, error).out);
        CHECK(form->expanded.in == hs_expanded_of(3, scene->cutoff_low, form->extent, error).in);
    }
    scene->extreme = false;
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
    hs_form_prune(scanner); /* few candidates are not worth it */
    CHECK(group->near.out == INFINITY);
    scanner->block.n = MANY;
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

/* With radii, within what the group's largest makes of the largest of all; no further than the
 * cutoff, and for fewer candidates where that is much shorter. */
static void
groups_of_small_radii_reach_less_far(void)
{
    static float radii[100];
    hs_walker    walker;
    open_walker(8.0, 1.0, &walker);
    const double cutoff = unit.search.scene.cutoff;
    for (int trial = 0; trial < 6 * 8; trial++) {
        const hs_rule rule = (hs_rule)(trial % 6);
        const double  asking = cutoff * (1 + trial / 6) / 8.0, most = 0.25 * cutoff;
        const double  sum = asking + most, larger = fmax(asking, most);
        const double  limits_are[] = {
             [HS_RULE_SUM] = sum,       [HS_RULE_MAX] = larger,   [HS_RULE_MIN] = fmin(asking, most),
             [HS_RULE_GATHER] = asking, [HS_RULE_SCATTER] = most, [HS_RULE_MEAN] = sum};
        const double limit = fmin(limits_are[rule], cutoff);
        hs_limits    limits = {.rule = rule,
                               .bound = HUGE_VAL,
                               .near_bound = INFINITY,
                               .of_asking = {.near = radii},
                               .of_points = {.near = radii, .most = (float)most}};
        hs_group    *group = &walker.scanner.group;
        for (int i = 0; i < 100; i++)
            radii[i] = (float)(i == 5 ? asking : i < 20 ? 0.5 * asking : cutoff);
        unit.search.limits = &limits;
        hs_group_start(&unit.search.bins, 0, 20, group);
        walker.scanner.block.n = limit < 0.8 * cutoff ? FEWER : MANY;
        hs_form_prune(&walker.scanner);
        CHECK((double)group->near.out > limit * limit);
        CHECK((double)group->near.out <
              (limit < 0.8 * cutoff ? limit * limit : cutoff * cutoff) * (1.0 + 1e-4) +
                  1e-4 * cutoff * cutoff);
    }
    unit.search.limits = NULL;
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
    RUN(what_is_surely_in_is_so_for_the_low_cutoff);
    RUN(thresholds_are_kept_for_the_next_search);
    RUN(groups_know_what_is_near);
    RUN(groups_of_small_radii_reach_less_far);
    RUN(far_candidates_are_not_tested);
}
