/* SPDX-License-Identifier: BSD-3-Clause */
/* test_nearest_keys.c: keys are sorted stably by any method and picked by any number. */
#include "../../../csrc/core/nearest/nearest_keys.h"
#include "../support/harness.h"

#include <math.h>

void test_nearest_keys(void);

enum { MOST = 700 };

static hs_nearest_key keys[MOST], spare[MOST], given[MOST];

/* Squares up to 1, of so many different values; the place is the number. */
static void
fill_keys(harness_random *random, int64_t n, int values)
{
    for (int64_t e = 0; e < n; e++) {
        const double square = values == 0 ? random_unit(random)
                                          : (double)(random_bits(random) % (uint64_t)values) /
                                                (values > 1 ? values - 1 : 1);
        given[e] = keys[e] = (hs_nearest_key){square, (int32_t)e};
    }
}

static bool
are_sorted(const hs_nearest_key *sorted, int64_t n)
{
    bool right = true;
    for (int64_t e = 0; e < n; e++) {
        const hs_nearest_key *key = &sorted[e];
        right = right && key->place >= 0 && key->place < n;
        right = right && key->square == given[key->place].square;
        if (e > 0)
            right = right && (key->square > key[-1].square ||
                              (key->square == key[-1].square && key->place > key[-1].place));
    }
    return right;
}

static void
equal_keys_keep_their_order(void)
{
    const hs_options options = hs_options_default();
    harness_random   random = {91};
    int              wrong = 0;
    for (int64_t n = 0; n < 300; n++) {
        for (int values = 0; values < 6; values++) {
            hs_nearest_pace pace = {.options = &options};
            hs_nearest_key *sorted = keys, *other = spare;
            fill_keys(&random, n, values);
            hs_nearest_sort(&pace, &sorted, &other, n, values == 5 ? 1e6 : 1.0);
            wrong += !are_sorted(sorted, n);
            wrong += !(sorted == keys && other == spare) && !(sorted == spare && other == keys);
            wrong += pace.status != HS_OK;
        }
    }
    CHECK(wrong == 0);
}

/* A step of such a bound would be infinite. */
static void
bounds_may_be_zero_or_tiny(void)
{
    static const double bounds[] = {0.0, 0x1p-1074, 0x1p-1000, 0x1p-999};
    const hs_options    options = hs_options_default();
    for (int b = 0; b < 4; b++) {
        hs_nearest_pace pace = {.options = &options};
        hs_nearest_key *sorted = keys, *other = spare;
        for (int32_t e = 0; e < 20; e++)
            given[e] = keys[e] = (hs_nearest_key){e % 3 == 0 ? bounds[b] : 0.0, e};
        hs_nearest_sort(&pace, &sorted, &other, 20, bounds[b]);
        CHECK(are_sorted(sorted, 20));
    }
}

/* One more than 64 is merged, and nothing is stepped over. */
static void
few_keys_are_counted_and_many_merged(void)
{
    const hs_options options = hs_options_default();
    harness_random   random = {92};
    hs_nearest_pace  pace = {.options = &options};
    hs_nearest_key  *sorted = keys, *other = spare;
    fill_keys(&random, HS_NEAREST_COUNTED + 1, 0);
    hs_nearest_sort(&pace, &sorted, &other, HS_NEAREST_COUNTED, 1.0);
    CHECK(sorted == spare && pace.steps == 0 && are_sorted(sorted, HS_NEAREST_COUNTED));
    sorted = keys;
    other = spare;
    fill_keys(&random, HS_NEAREST_COUNTED + 1, 0);
    hs_nearest_sort(&pace, &sorted, &other, HS_NEAREST_COUNTED + 1, 1.0);
    CHECK(sorted == keys && pace.steps > 0 && are_sorted(sorted, HS_NEAREST_COUNTED + 1));
}

/* The least come first, in no order. */
static void
the_least_are_selected(void)
{
    harness_random random = {93};
    int            wrong = 0;
    for (int64_t n = 1; n < 120; n += 1 + n / 20) {
        for (int64_t wanted = 1; wanted <= n; wanted += 1 + n / 16) {
            for (int values = 0; values < 4; values++) {
                uint8_t met[MOST] = {0};
                double  largest = -1.0, least = INFINITY;
                fill_keys(&random, n, values);
                hs_nearest_select(keys, n, wanted);
                for (int64_t e = 0; e < n; e++) {
                    wrong += met[keys[e].place]++ || keys[e].square != given[keys[e].place].square;
                    largest = e < wanted ? fmax(largest, keys[e].square) : largest;
                    least = e < wanted ? least : fmin(least, keys[e].square);
                }
                wrong += largest > least;
            }
        }
    }
    CHECK(wrong == 0);
}

static bool
refuse(void *context, double fraction)
{
    (void)fraction;
    ++*(int *)context;
    return false;
}

/* Polls come every so many steps; after one that refuses there is no other. */
static void
steps_are_polled_between(void)
{
    int             polls = 0;
    hs_options      options = hs_options_default();
    hs_nearest_pace pace = {.options = &options};
    CHECK(hs_nearest_goes_on(&pace, HS_NEAREST_POLL_STEPS - 1) &&
          pace.steps == HS_NEAREST_POLL_STEPS - 1);
    CHECK(hs_nearest_goes_on(&pace, 1) && pace.steps == 0);
    options.poll = refuse;
    options.poll_context = &polls;
    CHECK(hs_nearest_goes_on(&pace, HS_NEAREST_POLL_STEPS - 1) && polls == 0);
    CHECK(!hs_nearest_goes_on(&pace, 1) && polls == 1 && pace.status == HS_ERR_INTERRUPTED);
    CHECK(!hs_nearest_goes_on(&pace, 2 * HS_NEAREST_POLL_STEPS) && polls == 1);
}

/* A merge stops wherever it is told to. */
static void
merging_can_be_stopped(void)
{
    harness_random random = {94};
    for (int64_t left = 0; left < 3000; left += 97) {
        int             polls = 0;
        hs_options      options = hs_options_default();
        hs_nearest_pace pace = {.options = &options, .steps = HS_NEAREST_POLL_STEPS - left};
        hs_nearest_key *sorted = keys, *other = spare;
        options.poll = refuse;
        options.poll_context = &polls;
        fill_keys(&random, MOST, 0);
        hs_nearest_sort(&pace, &sorted, &other, MOST, 1.0);
        CHECK(polls == 1 && pace.status == HS_ERR_INTERRUPTED);
    }
}

void
test_nearest_keys(void)
{
    RUN(equal_keys_keep_their_order);
    RUN(bounds_may_be_zero_or_tiny);
    RUN(few_keys_are_counted_and_many_merged);
    RUN(the_least_are_selected);
    RUN(steps_are_polled_between);
    RUN(merging_can_be_stopped);
}
