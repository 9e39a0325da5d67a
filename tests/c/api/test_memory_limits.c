/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_memory_limits.c: every function of halfshell.h, on scenes of several kinds, under one limit
 * of memory after the other: whatever it forbids, the answer is HS_ERR_MEMORY or the right one, and
 * what the call was about stays usable.
 */
#include "../../../csrc/core/memory/account.h"
#include "../support/call_kinds.h"

void test_memory_limits(void);

static const double LEAST = 300.0, MOST = 0x1p26; /* bytes */
static const double STEP = IS_SLOW ? 1.6 : 1.25;

enum { ENOUGH = 4 }; /* limits in a row that a call can do with */

/* One call under a limit. Whether it could do with that. */
static bool
attempt(const call_kind *function, double limit, uint64_t expected)
{
    const int64_t before = hs_test_live_blocks();
    hs_failure    failure;
    call_make_objects(&s.c, function->uses);
    s.c.retries = 0;
    s.options.memory_limit = limit;
    const hs_status status = function->run(&s.c, &failure);
    s.options.memory_limit = INFINITY;
    CHECK(status == HS_OK || status == HS_ERR_MEMORY);
    if (status == HS_ERR_MEMORY) {
        CHECK(failure.row == -1 && failure.column == -1 && failure.limit_bytes == limit);
        CHECK(!(function->uses & (USES_CELLS | USES_LIST)) ||
              function->run(&s.c, &failure) == HS_OK);
    }
    CHECK(status != HS_OK || s.c.answer == expected);
    call_free_objects(&s.c);
    CHECK(hs_test_live_blocks() == before);
    return status == HS_OK;
}

/* Returns how many limits were too low. */
static int
raise_limit(const scene_of_calls *kind, const call_kind *function)
{
    const int before = harness_failures;
    int       refused = 0, served = 0;
    double    limit = LEAST;
    call_make_objects(&s.c, function->uses);
    CHECK(function->run(&s.c, NULL) == HS_OK);
    call_free_objects(&s.c);
    const uint64_t expected = s.c.answer;
    for (; limit < MOST && served < ENOUGH && harness_failures == before; limit *= STEP) {
        const bool serves = attempt(function, limit, expected);
        refused += !serves;
        served = serves ? served + 1 : 0;
    }
    CHECK(limit < MOST);
    if (harness_failures != before)
        fprintf(stderr, "hs_%s of scene %s, %.0f bytes\n", function->name, kind->name, limit);
    return refused;
}

static void
no_limit_leads_to_a_wrong_answer(void)
{
    for (int k = 0; k < KINDS; k++) {
        for (int f = 0; f < CALL_KINDS; f++) {
            const call_kind *function = &call_kinds[f];
            make_call(&kinds[k]);
            /* A stream has the limit that it was opened with. */
            if (((function->uses & NEEDS_BOX) && s.c.box == NULL) || (function->uses & USES_STREAM))
                continue;
            if (function->run == call_cells_candidates && kinds[k].exponent > 0)
                s.c.queries = NULL;
            const int refused = raise_limit(&kinds[k], function);
            CHECK(refused > 0 || !(function->uses & USES_OPTIONS));
        }
    }
}

void
test_memory_limits(void)
{
    RUN(no_limit_leads_to_a_wrong_answer);
}
