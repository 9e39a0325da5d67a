/* SPDX-License-Identifier: BSD-3-Clause */
/* test_walk_again.c: a walker that is kept for other searches finds what a new one does, in the same
 * order. */
#include "../support/search_unit.h"

#include <math.h>

void test_walk_again(void);

static search_unit unit;

/* Hits, and a number that depends on their labels and on their order. */
typedef struct noted {
    int64_t  n;
    uint64_t in_order;
} noted;

static hs_status
note_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    noted        *to = context;
    const int32_t n = hits->end[hits->n - 1];
    CHECK(hits->point[0] == unit.search.bins.order[first] && scanner->search == &unit.search);
    for (int32_t h = 0; h < n; h++) {
        to->in_order = to->in_order * UINT64_C(6364136223846793005) + (uint64_t)hits->label[h] + 1;
    }
    to->n += n;
    return HS_OK;
}

/* Walks once more with a walker that is kept, and with a new one, which must give the same hits in
 * the same order. */
static void
walk_again(hs_block_use use, hs_walker *kept)
{
    static noted again, once;
    static hs_walker new;
    const int32_t n = (int32_t)unit.points.n;
    const bool    counts = use == HS_BLOCK_COUNTS;
    hs_visit_fn   visit = counts ? NULL : note_hits;
    memset(&again, 0, sizeof again);
    memset(&once, 0, sizeof once);
    CHECK(hs_walker_renew(&unit.search, use, visit, &again, kept) == HS_OK);
    CHECK(hs_walk(kept, 0, n) == HS_OK);
    CHECK(hs_walker_init(&unit.search, use, visit, &once, &new) == HS_OK);
    CHECK(hs_walk(&new, 0, n) == HS_OK);
    CHECK(kept->scanner.n_found == new.scanner.n_found);
    CHECK(counts || new.scanner.n_found == once.n);
    hs_walker_rest(&unit.search, kept);
    hs_walker_close(&unit.search, &new);
    CHECK(again.n == once.n && again.in_order == once.in_order && kept->scanner.n_groups == 0);
}

/* Scenes one after the other, some with a box or sparse cells, with pairs on the cutoff; also in
 * memory of which all but the walkers' is used again. */
static void
walk_in_turn(bool in_arena)
{
    enum { TURNS = 24, USES = 3 };
    static const int64_t      n[] = {30, 20, 50, 50, 200, 30, 1};
    static const hs_block_use uses[USES] = {HS_BLOCK_LISTS_IDS, HS_BLOCK_COUNTS,
                                            HS_BLOCK_LISTS_PLACES};
    static hs_walker          kept[USES];
    const hs_box              cube = {
                     .ndim = 3, .rows = {{2.0}, {0.0, 2.0}, {0.0, 0.0, 2.0}}, .periodic = {true, true, true}};
    const hs_sets sets = {.points = &unit.points};
    int           n_kept = 0;
    hs_test_use_arena(in_arena);
    memset(kept, 0, sizeof kept);
    search_unit_points(1, 30, 3, 1.0, &unit);
    search_unit_open(NULL, 0.5, false, HS_WANT_I, &unit);
    for (int turn = 0; turn < TURNS; turn++) {
        hs_failure  failure = HS_NO_FAILURE;
        const void *memory = kept[0].scanner.block.memory;
        hs_search_close(&unit.search);
        if (in_arena) {
            hs_account_reset(&unit.call.account);
        }
        search_unit_points(100 + (uint64_t)turn, n[turn % 7], 3, 1.0, &unit);
        for (int e = 0; turn % 5 == 2 && e < 3 * unit.points.n; e++) {
            unit.x[e] = 0.125 * rint(8.0 * unit.x[e]); /* pairs on the cutoff */
        }
        unit.call.options.cutoff = turn % 3 == 0 ? 0.25 : 0.625;
        unit.call.options.algorithm = turn % 6 == 5 ? HS_HASH : HS_AUTO;
        CHECK(hs_search_build(&sets, turn % 4 == 3 ? &cube : NULL, &unit.search, &failure) ==
              HS_OK);
        for (int u = 0; u < USES; u++) {
            walk_again(uses[u], &kept[u]);
        }
        n_kept += memory != NULL && memory == kept[0].scanner.block.memory;
    }
    CHECK(n_kept >= 9 && n_kept < TURNS - 4);
    for (int u = 0; u < USES; u++) {
        hs_walker_close(&unit.search, &kept[u]);
    }
    search_unit_close(&unit);
    hs_test_use_arena(false);
}

static void
walkers_are_renewed_for_other_searches(void)
{
    walk_in_turn(false);
    walk_in_turn(true);
}

/* No block is larger than those of crowded searches, which end in the order of pairs. */
static void
blocks_end_at_the_same_candidate(void)
{
    static hs_walker kept;
    const int64_t    n[] = {4060, 4200};
    const hs_sets    sets = {.points = &unit.points};
    memset(&kept, 0, sizeof kept);
    search_unit_points(1, 30, 1, 1.0, &unit);
    search_unit_open(NULL, 2.0, false, HS_WANT_I, &unit);
    for (int turn = 0; turn < 2; turn++) {
        hs_failure failure = HS_NO_FAILURE;
        hs_search_close(&unit.search);
        search_unit_points(7, n[turn], 1, 1.0, &unit);
        CHECK(hs_search_build(&sets, NULL, &unit.search, &failure) == HS_OK);
        walk_again(HS_BLOCK_LISTS_IDS, &kept);
    }
    hs_walker_close(&unit.search, &kept);
    search_unit_close(&unit);
}

void
test_walk_again(void)
{
    RUN(walkers_are_renewed_for_other_searches);
    RUN(blocks_end_at_the_same_candidate);
}
