/* SPDX-License-Identifier: BSD-3-Clause */
/* test_passes.c: a pass meets every point once, in rounds between which there is a poll, and ends
 * with the round that fails. */
#include "../../../csrc/core/threads/passes.h"
#include "../support/harness.h"

void test_passes(void);

enum { MOST = 3 * HS_POLL_POINTS };

static uint8_t met[MOST];

typedef struct walked {
    int64_t  n, calls, failing; /* the slab that fails first, counted over all rounds; -1: none */
    int64_t  last_of[HS_SLABS]; /* where the last range of each slab or strip ended */
    unsigned used;              /* bit s: slab s was met */
    int64_t  polls, stops_at;
} walked;

static hs_status
note_range(void *context, int slab, int64_t first, int64_t last)
{
    walked *of = context;
    CHECK(slab >= 0 && slab < HS_SLABS && first <= last && first >= 0 && last <= of->n);
    CHECK(first >= of->last_of[slab]);
    of->last_of[slab] = last;
    of->used |= 1u << slab;
    for (int64_t i = first; i < last; i++)
        met[i]++;
    const int64_t call = of->calls++;
    return of->failing >= 0 && call >= of->failing
               ? (hs_status)(call == of->failing ? HS_ERR_MEMORY : HS_ERR_FAR)
               : HS_OK;
}

static bool
note_poll(void *context, double fraction)
{
    walked *of = context;
    (void)fraction;
    return ++of->polls != of->stops_at;
}

/* n_strips: 0 for slabs. */
static hs_status
walk_points(int64_t n, int n_strips, int64_t failing, int64_t stops_at, walked *of)
{
    hs_options options = hs_options_default();
    memset(met, 0, sizeof met);
    *of = (walked){.n = n, .failing = failing, .stops_at = stops_at};
    options.poll = note_poll;
    options.poll_context = of;
    return n_strips == 0 ? hs_walk_slabs(NULL, &options, n, note_range, of)
                         : hs_walk_strips(NULL, &options, n, n_strips, note_range, of);
}

static bool
all_are_met_once(int64_t n)
{
    bool once = true;
    for (int64_t i = 0; i < MOST; i++)
        once = once && met[i] == (i < n);
    return once;
}

static void
every_point_is_met_once(void)
{
    static const int64_t numbers[] = {0,
                                      1,
                                      2,
                                      5,
                                      HS_SLAB_POINTS - 1,
                                      HS_SLAB_POINTS,
                                      HS_SLAB_POINTS + 1,
                                      HS_POLL_POINTS - 1,
                                      HS_POLL_POINTS,
                                      HS_POLL_POINTS + 1,
                                      2 * HS_POLL_POINTS + 12345,
                                      MOST};
    for (int c = 0; c < 12; c++) {
        const int64_t n = numbers[c];
        walked        of;
        CHECK(walk_points(n, 0, -1, 0, &of) == HS_OK && all_are_met_once(n));
        CHECK(of.calls == (n + HS_SLAB_POINTS - 1) / HS_SLAB_POINTS);
        CHECK(of.polls == n / HS_POLL_POINTS);
        for (int strips = 1; strips <= HS_SLABS; strips += strips < 4 ? 1 : 14) {
            const int64_t rounds = (n + HS_POLL_POINTS - 1) / HS_POLL_POINTS;
            CHECK(walk_points(n, strips, -1, 0, &of) == HS_OK && all_are_met_once(n));
            CHECK(of.calls == strips * rounds && of.polls == n / HS_POLL_POINTS);
            CHECK(n == 0 || of.used == (strips == 32 ? ~0u : (1u << strips) - 1));
            for (int s = 0; s < strips && n > 0; s++)
                CHECK(of.last_of[s] == n * (s + 1) / strips);
        }
    }
}

/* The lowest slab that fails gives the status; its round is the last, and is not polled after. */
static void
the_first_failure_ends_a_pass(void)
{
    walked of;
    CHECK(walk_points(MOST, 0, 5, 0, &of) == HS_ERR_MEMORY);
    CHECK(of.calls == HS_SLABS && of.polls == 0);
    CHECK(walk_points(MOST, 0, HS_SLABS + 1, 0, &of) == HS_ERR_MEMORY);
    CHECK(of.calls == 2 * HS_SLABS && of.polls == 1);
    CHECK(walk_points(MOST, 3, 2, 0, &of) == HS_ERR_MEMORY && of.calls == 3);
}

static void
a_poll_ends_a_pass(void)
{
    walked of;
    CHECK(walk_points(MOST, 0, -1, 1, &of) == HS_ERR_INTERRUPTED && of.calls == HS_SLABS);
    CHECK(walk_points(MOST, 0, -1, 2, &of) == HS_ERR_INTERRUPTED && of.polls == 2);
    CHECK(walk_points(MOST, 7, -1, 3, &of) == HS_ERR_INTERRUPTED && of.calls == 21);
    CHECK(walk_points(HS_POLL_POINTS - 1, 0, -1, 1, &of) == HS_OK && of.polls == 0);
}

void
test_passes(void)
{
    RUN(every_point_is_met_once);
    RUN(the_first_failure_ends_a_pass);
    RUN(a_poll_ends_a_pass);
}
