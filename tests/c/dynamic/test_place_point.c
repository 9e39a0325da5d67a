/* SPDX-License-Identifier: BSD-3-Clause */
/* test_place_point.c: X and turns of a position are those of wrap.h, wherever it lies; what cannot be
 * wrapped is refused. */
#include "../../../csrc/core/base/fpenv.h"
#include "../../../csrc/core/dynamic/new_list.h"
#include "../../../csrc/core/dynamic/place_point.h"
#include "../../../csrc/core/dynamic/update.h"
#include "../support/harness.h"

void test_place_point(void);

static hs_dynamic *
list_of(const hs_box *box)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    hs_failure         failure;
    options.ndim = 2;
    options.box = box;
    CHECK(hs_list_new(&options, &list, &failure) == HS_OK);
    return list;
}

/* A coordinate inside, on a face, one period away or many, or next to one of these. */
static double
some_coordinate(harness_random *random, double length)
{
    double x = (random_unit(random) - 0.5) * 4.0 * length;
    switch (random_bits(random) % 4) {
    case 0: x = ldexp(x, (int)(random_bits(random) % 40)); break;
    case 1: x = (double)(int64_t)(random_bits(random) % 9) * 0.5 * length - 2.0 * length; break;
    default: break;
    }
    return random_bits(random) % 3 == 0 ? nextafter(x, 0.0) : x;
}

static void
aligned_positions_are_wrapped_exactly(void)
{
    const hs_box   box = {.ndim = 2, .periodic = {true, false}, .rows = {{3.3, 0.0}, {0.0, 1.0}}};
    hs_dynamic    *list = list_of(&box);
    harness_random random = {5};
    for (int trial = 0; trial < TRIALS(100000); trial++) {
        const double given[2] = {some_coordinate(&random, 3.3), some_coordinate(&random, 1e6)};
        hs_placed    placed;
        hs_failure   failure;
        int64_t      turns;
        const double inside = hs_wrap_axis(given[0], 3.3, &turns);
        CHECK(hs_dynamic_place(list, given, &placed, &failure) == HS_OK);
        CHECK(placed.x[0] == inside && placed.turns[0] == turns);
        CHECK(placed.x[1] == given[1] && placed.given == given);
        CHECK(placed.index[0] >= 0 && placed.index[0] < list->axes.axis[0].n);
    }
    hs_list_free(list);
}

static void
skewed_positions_are_those_of_wrap_point(void)
{
    const hs_box   box = {.ndim = 2, .periodic = {true, true}, .rows = {{3.0, 0.0}, {1.1, 2.5}}};
    hs_dynamic    *list = list_of(&box);
    harness_random random = {6};
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const double given[2] = {some_coordinate(&random, 3.0), some_coordinate(&random, 3.0)};
        double       inside[2], magnitude = 0.0;
        int64_t      turns[2];
        hs_placed    placed;
        hs_failure   failure;
        CHECK(hs_wrap_point(&list->lattice, given, inside, turns, &magnitude));
        CHECK(hs_dynamic_place(list, given, &placed, &failure) == HS_OK);
        CHECK(memcmp(placed.x, inside, sizeof inside) == 0);
        CHECK(memcmp(placed.turns, turns, sizeof turns) == 0);
        CHECK(hs_update_insert(list, (hs_key){0, 0}, &placed, &failure) == HS_OK);
        CHECK(list->magnitude >= magnitude);
    }
    hs_list_free(list);
}

static void
what_cannot_be_wrapped_is_refused(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{3.0, 0.0}, {0.0, 2.5}}};
    const double far[2] = {0.0, 1e17}, bad[2] = {0.0, -INFINITY};
    hs_dynamic  *list = list_of(&box), *open = list_of(NULL);
    hs_placed    placed;
    hs_failure   failure;
    CHECK(hs_dynamic_place(list, far, &placed, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(hs_dynamic_place(open, far, &placed, &failure) == HS_OK);
    CHECK(hs_dynamic_place(open, bad, &placed, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.column == 1 && failure.value == -INFINITY);
    hs_list_free(list);
    hs_list_free(open);
}

/* Along two axes: the first of them is not forgotten when the second one is wrapped. */
static void
both_axes_may_be_too_far(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{3.0, 0.0}, {0.0, 2.5}}};
    const double far[][2] = {{1e17, 1e17}, {1e17, 9.0}, {9.0, 1e17}};
    hs_dynamic  *list = list_of(&box);
    hs_placed    placed;
    hs_failure   failure;
    for (int f = 0; f < 3; f++)
        CHECK(hs_dynamic_place(list, far[f], &placed, &failure) == HS_ERR_SHIFT_RANGE);
    hs_list_free(list);
}

static void
keys_without_a_position_have_nan(void)
{
    const double given[2] = {1.0, 2.0};
    hs_dynamic  *list = list_of(NULL);
    hs_placed    placed;
    hs_failure   failure;
    CHECK(hs_dynamic_place(list, given, &placed, &failure) == HS_OK);
    CHECK(hs_update_insert(list, (hs_key){0, 0}, &placed, &failure) == HS_OK);
    const uint32_t place = hs_key_map_find(&list->map, &list->entries, (hs_key){0, 0});
    hs_dynamic_write(list, place, NULL);
    CHECK(isnan(hs_entry_at(&list->entries, place)[0]));
    hs_dynamic_write(list, place, &placed);
    CHECK(memcmp(hs_entry_at(&list->entries, place), given, sizeof given) == 0);
    hs_list_free(list);
}

void
test_place_point(void)
{
    const hs_fpenv env = hs_fpenv_enter();
    RUN(aligned_positions_are_wrapped_exactly);
    RUN(skewed_positions_are_those_of_wrap_point);
    RUN(what_cannot_be_wrapped_is_refused);
    RUN(both_axes_may_be_too_far);
    RUN(keys_without_a_position_have_nan);
    hs_fpenv_leave(env);
}
