/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_api_kept.c: all calls, for scenes of every kind: what they return has not changed, nor has the
 * order of what is not sorted, nor the work that was done.
 */
#include "../support/call_scenes.h"

void test_api_kept(void);

enum { SCENES_KEPT = 144 };

/* Everything in turn, and no two periods alike. */
static scene_of_calls
scene_of_trial(int t)
{
    static const double cell_sizes[] = {0.0, 0.0, 0.0, 0.4, 1.5};
    static const int    exponents[] = {0, 0, 0, 0, 300, 0, -400};
    const int           d = 1 + t / SCENE_KINDS % HS_MAX_DIM, exponent = exponents[t % 7];
    return (scene_of_calls){.box = (scene_kind)(t % SCENE_KINDS),
                            .ndim = d,
                            .n = d > 3         ? 1 + t % 30
                                 : t % 11 == 0 ? 300
                                               : 1 + t % 90,
                            .cutoff = d > 3        ? 1.0
                                      : t % 5 == 0 ? 0.25 + t % 17 * 0.125
                                                   : 0.0,
                            .want = ALL,
                            .apart = t % 13 == 5 && exponent == 0 ? 1e5 : 0.0,
                            .exponent = exponent,
                            .narrow = t % 17 == 7 && exponent == 0,
                            .strict = t % 2,
                            .reaches = t % (d > 3 ? 3 : 4),
                            .seed = 1 + (uint64_t)t,
                            .cell_size = cell_sizes[t % 5],
                            .algorithm = (hs_algorithm)(t / 3 % HS_ALGORITHM_END),
                            .precision = t % 23 == 9    ? HS_SINGLE
                                         : t % 23 == 17 ? HS_DOUBLE
                                                        : HS_EXACT};
}

/* Of a scene, as `sorted` or not. */
static uint64_t
hash_call(uint64_t hash, const call_kind *function, int trial, bool sorted)
{
    const scene_of_calls kind = scene_of_trial(trial);
    hs_counters          counters = {0};
    hs_failure           failure = {.row = -1};
    make_call(&kind);
    if ((function->uses & NEEDS_BOX) && s.c.box == NULL)
        return hash;
    s.options.sorted = sorted;
    s.options.counters = sorted ? NULL : &counters;
    s.c.k = 1 + trial % 9;
    s.c.max_pairs = 1 + trial % 40;
    s.c.queries = trial % 2 || (function->uses & NEEDS_QUERIES) ? &s.queries : NULL;
    s.c.answer = 0;
    if (kind.exponent != 0 && function->run == call_cells_candidates)
        s.c.queries = NULL;
    call_make_objects(&s.c, function->uses);
    const hs_status status = function->run(&s.c, &failure);
    hash = hash_bytes(hash, &status, sizeof status);
    hash = hash_bytes(hash, &s.c.answer, sizeof s.c.answer);
    for (int step = 1; function->run == call_verlet_find && step < 5; step++) {
        bool rebuilt;
        move_points(&kind, 0.002 * step);
        CHECK(hs_verlet_update(s.c.list, s.c.points, s.c.box, s.c.options, s.c.skin, false,
                               &rebuilt, NULL) == HS_OK);
        CHECK(function->run(&s.c, &failure) == HS_OK);
        const hs_verlet_state state = hs_verlet_look(s.c.list);
        hash = hash_bytes(hash, &s.c.answer, sizeof s.c.answer);
        hash = hash_bytes(hash, &state.margin, sizeof state.margin);
    }
    call_free_objects(&s.c);
    if (!sorted)
        hash = hash_bytes(hash, counters.bytes, sizeof counters.bytes);
    return hash_counters(hash, &counters);
}

static void
answers_order_and_work_are_what_they_were(void)
{
    for (int f = 0; f < CALL_KINDS; f++) {
        uint64_t answers = 1, work = 1;
        for (int t = 0; t < SCENES_KEPT; t++) {
            answers = hash_call(answers, &call_kinds[f], t, true);
            work = hash_call(work, &call_kinds[f], t, false);
        }
        check_kept(call_kinds[f].name, answers, work);
    }
}

void
test_api_kept(void)
{
    RUN(answers_order_and_work_are_what_they_were);
}
