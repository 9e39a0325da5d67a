/* SPDX-License-Identifier: BSD-3-Clause */
/* search_unit.h: an open search over random points, so that a test can take its parts one by one,
 * and what it should find. */
#ifndef HS_SEARCH_UNIT_H
#define HS_SEARCH_UNIT_H

#include "../../../csrc/core/base/status.h"
#include "../../../csrc/core/search/search.h"
#include "../../../csrc/core/search/walk.h"
#include "harness.h"

typedef struct search_unit {
    hs_call   call;
    hs_search search;
    double    x[3 * 2000];
    hs_points points;
} search_unit;

/* n points in [0, side) along each axis. */
static inline void
search_unit_points(uint64_t seed, int64_t n, int d, double side, search_unit *unit)
{
    harness_random random = {seed};
    for (int64_t e = 0; e < n * d; e++)
        unit->x[e] = side * random_unit(&random);
    unit->points = (hs_points){unit->x, n, d, HS_FLOAT64, d * 8, 8};
}

static inline void
search_unit_open(const hs_box *box, double cutoff, bool is_full, unsigned want, search_unit *unit)
{
    const hs_sets sets = {.points = &unit->points, .is_full = is_full};
    hs_options    options = hs_options_default();
    hs_failure    failure = HS_NO_FAILURE;
    options.cutoff = cutoff;
    options.want = want;
    options.threads = 1;
    hs_call_begin(&options, &unit->call);
    CHECK(hs_search_open(&sets, box, &unit->call, &unit->search, &failure) == HS_OK);
}

static inline void
search_unit_close(search_unit *unit)
{
    hs_search_close(&unit->search);
    hs_call_dismiss(&unit->call);
    hs_account_close(&unit->call.account);
    CHECK(unit->call.account.held == 0);
}

#endif
