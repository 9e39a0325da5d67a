/* SPDX-License-Identifier: BSD-3-Clause */
/* test_kept_rows.c: rows without nodes, in their order or in another, and without entries; what are
 * no rows is refused, and nothing is left when memory is short or the caller stops. */
#include "../../../csrc/core/connectivity/kept_rows.h"
#include "../support/node_scenes.h"
#include "../support/poll_checks.h"

void test_kept_rows(void);

enum { ROWS = NODE_POINTS * NODE_LISTS + 1 };

static node_scene scene;
static int64_t    offsets[ROWS], fewer_offsets[ROWS], source[NODE_POINTS];
static int32_t    indices[2 * NODE_PAIRS], fewer_indices[2 * NODE_PAIRS];
static int32_t    shift[4 * NODE_PAIRS], fewer_shift[4 * NODE_PAIRS];
static int32_t    target[NODE_POINTS], place[NODE_POINTS];
static bool       gone[NODE_POINTS][NODE_POINTS];
static double     limit = HUGE_VAL;

static hs_list_rows
rows_given(bool has_shift)
{
    const int64_t n = node_rows_fill(&scene, scene.near, offsets, indices, shift);
    return (hs_list_rows){.n = scene.n_lists > 0 ? scene.n : 0,
                          .n_lists = scene.n_lists,
                          .offsets = offsets,
                          .n_indices = n,
                          .indices = indices,
                          .shift = has_shift ? shift : NULL,
                          .ndim = 2};
}

/* Numbers from 0 on in a random order. */
static void
shuffle(harness_random *random, int32_t *numbers, int32_t n)
{
    for (int32_t k = 0; k < n; k++) {
        const int32_t other = (int32_t)(random_bits(random) % (uint64_t)(k + 1));
        numbers[k] = numbers[other];
        numbers[other] = k;
    }
}

/* New numbers of some nodes of each list, and which rows these have. Returns how many. */
static int64_t
choose(harness_random *random, bool in_order)
{
    int64_t n_rows = 0, first = 0;
    for (int32_t l = 0; l < scene.n_lists; l++) {
        int32_t numbers[NODE_POINTS], kept = 0;
        for (int64_t k = 0; k < scene.n_nodes[l]; k++) {
            target[first + k] = random_bits(random) % 3 > 0 ? kept : -1;
            kept += target[first + k] >= 0;
        }
        shuffle(random, numbers, kept);
        for (int64_t k = 0; k < scene.n_nodes[l]; k++) {
            int32_t *own = &target[first + k];
            *own = *own < 0 || in_order ? *own : numbers[*own];
            if (*own >= 0)
                source[n_rows + *own] = first + k;
        }
        n_rows += kept;
        first += scene.n_nodes[l];
    }
    shuffle(random, place, scene.n);
    return n_rows;
}

static hs_node_change
change_given(bool in_order)
{
    return (hs_node_change){.n_lists = scene.n_lists,
                            .n_nodes = scene.n_nodes,
                            .target = target,
                            .place = in_order ? NULL : place};
}

/* Whether entries of one row and list are what stays of entries [first, last), whose nodes begin at
 * `base`. */
static bool
entry_is(const hs_pairs *kept, int64_t at, int64_t end, int64_t first, int64_t last, int64_t base,
         bool in_order)
{
    const int32_t *index = hs_pairs_array(kept, HS_WANT_J);
    const int32_t *moved = hs_pairs_array(kept, HS_WANT_SHIFT);
    int64_t        n = 0;
    bool           right = true;
    for (int64_t e = first; e < last; e++) {
        int64_t before = n; /* how many of those that stay come before this one */
        if (target[base + indices[e]] < 0)
            continue;
        if (!in_order) {
            before = 0;
            for (int64_t other = first; other < last; other++)
                before += target[base + indices[other]] >= 0 &&
                          place[base + indices[other]] < place[base + indices[e]];
        }
        right = right && at + before < end && index[at + before] == target[base + indices[e]] &&
                (moved == NULL ||
                 (moved[2 * (at + before)] == e && moved[2 * (at + before) + 1] == -3));
        n++;
    }
    return right && at + n == end;
}

static hs_status
keep(const hs_list_rows *rows, const hs_node_change *change, int64_t n, hs_pairs **kept)
{
    hs_options options = hs_options_default();
    options.memory_limit = limit;
    return hs_rows_keep(rows, change, source, n, &options, kept, NULL);
}

static void
rows_have_the_nodes_that_stay(void)
{
    harness_random random = {77};
    for (int trial = 0; trial < TRIALS(300); trial++) {
        const bool in_order = trial & 1, has_shift = trial & 2;
        hs_pairs  *kept;
        node_scene_fill(&random, trial & 4, &scene);
        const int64_t        n = choose(&random, in_order);
        const hs_list_rows   rows = rows_given(has_shift);
        const hs_node_change change = change_given(in_order);
        CHECK(keep(&rows, &change, n, &kept) == HS_OK);
        const int64_t *ends = hs_pairs_offsets(kept);
        CHECK(hs_pairs_rows(kept) == n * scene.n_lists);
        CHECK((hs_pairs_array(kept, HS_WANT_SHIFT) != NULL) == has_shift);
        for (int64_t k = 0; k < n; k++) {
            int64_t base = 0;
            for (int32_t l = 0; l < scene.n_lists; l++) {
                const int64_t e = k * scene.n_lists + l, old = source[k] * scene.n_lists + l;
                CHECK(entry_is(kept, ends[e], ends[e + 1], offsets[old], offsets[old + 1], base,
                               in_order));
                base += scene.n_nodes[l];
            }
        }
        CHECK(hs_pairs_length(kept) == ends[n * scene.n_lists]);
        hs_pairs_free(kept);
    }
}

static void
all_rows_stay_without_a_choice(void)
{
    harness_random   random = {78};
    const hs_options options = hs_options_default();
    hs_pairs        *kept;
    do {
        node_scene_fill(&random, false, &scene);
    } while (scene.n_pairs == 0);
    for (int32_t l = 0, k = 0; l < scene.n_lists; l++) {
        for (int32_t node = 0; node < scene.n_nodes[l]; node++)
            target[k++] = node;
    }
    const hs_list_rows   rows = rows_given(false);
    const hs_node_change change = change_given(true);
    CHECK(hs_rows_keep(&rows, &change, NULL, rows.n, &options, &kept, NULL) == HS_OK);
    CHECK(hs_pairs_length(kept) == rows.n_indices && rows.n_indices > 0);
    CHECK(memcmp(hs_pairs_array(kept, HS_WANT_J), indices, (size_t)rows.n_indices * 4) == 0);
    CHECK(memcmp(hs_pairs_offsets(kept), offsets, (size_t)(rows.n * rows.n_lists + 1) * 8) == 0);
    hs_pairs_free(kept);
}

/* ---- entries that go ----------------------------------------------------------------------- */

/* Some of the entries, or pairs that are none besides; with those of `rows`, whose shifts are the
 * numbers of their entries. */
static hs_list_rows
fewer_given(harness_random *random, const hs_list_rows *rows, bool with_others)
{
    static bool has[NODE_POINTS][NODE_POINTS];
    int64_t     at = 0;
    memset(has, 0, sizeof has);
    memset(gone, 0, sizeof gone);
    for (int32_t p = 0; p < scene.n; p++) {
        for (int32_t q = 0; q < scene.n; q++) {
            gone[p][q] = scene.near[p][q] && random_bits(random) % 3 == 0;
            has[p][q] = gone[p][q] || (with_others && random_bits(random) % 4 == 0);
        }
    }
    if (with_others || rows->shift == NULL) {
        at = node_rows_fill(&scene, has, fewer_offsets, fewer_indices, NULL);
    } else { /* every third entry, with its shift */
        for (int64_t k = 0; k < rows->n * rows->n_lists; k++) {
            fewer_offsets[k] = at;
            for (int64_t e = offsets[k]; e < offsets[k + 1]; e++) {
                if (e % 3 == 0) {
                    fewer_indices[at] = indices[e];
                    fewer_shift[2 * at] = shift[2 * e];
                    fewer_shift[2 * at++ + 1] = shift[2 * e + 1];
                }
            }
        }
        fewer_offsets[rows->n * rows->n_lists] = at;
    }
    hs_list_rows fewer = *rows;
    fewer.offsets = fewer_offsets;
    fewer.indices = fewer_indices;
    fewer.n_indices = at;
    fewer.shift = rows->shift != NULL ? fewer_shift : NULL;
    return fewer;
}

static void
rows_lose_the_entries_that_go(void)
{
    static bool      left[NODE_POINTS][NODE_POINTS];
    harness_random   random = {79};
    const hs_options options = hs_options_default();
    for (int trial = 0; trial < TRIALS(300); trial++) {
        const bool shuffled = trial & 1, ascend = !shuffled, with_others = ascend && trial & 2;
        hs_pairs  *kept;
        node_scene_fill(&random, shuffled, &scene);
        const hs_list_rows rows = rows_given(false);
        const hs_list_rows fewer = fewer_given(&random, &rows, with_others);
        CHECK(hs_rows_without(&rows, &fewer, ascend, &options, &kept, NULL) == HS_OK);
        for (int32_t p = 0; p < scene.n; p++) {
            for (int32_t q = 0; q < scene.n; q++)
                left[p][q] = scene.near[p][q] && !gone[p][q];
        }
        if (with_others) { /* what was added is in the rows now and then */
            for (int32_t p = 0; p < scene.n; p++) {
                const int64_t row = node_rows_before(&scene, scene.list[p], true) + scene.node[p];
                for (int32_t q = 0; q < scene.n; q++) {
                    const int64_t entry = row * scene.n_lists + scene.list[q];
                    for (int64_t e = fewer_offsets[entry]; e < fewer_offsets[entry + 1]; e++)
                        left[p][q] = left[p][q] && fewer_indices[e] != scene.node[q];
                }
            }
        }
        CHECK(node_rows_are(&scene, true, left, hs_pairs_offsets(kept),
                            hs_pairs_array(kept, HS_WANT_J)));
        hs_pairs_free(kept);
    }
}

static void
images_go_by_their_shifts(void)
{
    static const int64_t ends[2] = {0, 5}, fewer_ends[2] = {0, 2}, other_ends[2] = {0, 3};
    static const int64_t one_end[2] = {0, 1};
    static const int32_t node[5] = {0, 0, 1, 1, 1};
    static const int32_t images[10] = {0, -1, 0, 1, -2, 0, 0, 0, 0, 3};
    static const int32_t some[2] = {0, 1}, of_some[4] = {0, 1, 0, 0};
    static const int32_t more[3] = {0, 1, 1}, of_more[6] = {0, 0, -2, 0, 0, 9};
    const hs_list_rows   rows = {1, 1, ends, 5, node, images, 2};
    hs_list_rows         fewer = {1, 1, fewer_ends, 2, some, of_some, 2};
    const hs_options     options = hs_options_default();
    hs_pairs            *kept;
    for (int ascend = 0; ascend < 2; ascend++) {
        static const int32_t left[6] = {0, -1, -2, 0, 0, 3};
        CHECK(hs_rows_without(&rows, &fewer, ascend, &options, &kept, NULL) == HS_OK);
        CHECK(hs_pairs_length(kept) == 3);
        CHECK(memcmp(hs_pairs_array(kept, HS_WANT_SHIFT), left, sizeof left) == 0);
        hs_pairs_free(kept);
    }
    fewer = (hs_list_rows){1, 1, other_ends, 3, more, of_more, 2};
    CHECK(hs_rows_without(&rows, &fewer, true, &options, &kept, NULL) == HS_OK);
    CHECK(hs_pairs_length(kept) == 4); /* two of these three are no entries */
    hs_pairs_free(kept);
    fewer = (hs_list_rows){1, 1, one_end, 1, more, of_more, 2}; /* before some, and none itself */
    CHECK(hs_rows_without(&rows, &fewer, true, &options, &kept, NULL) == HS_OK);
    CHECK(hs_pairs_length(kept) == 5);
    hs_pairs_free(kept);
    fewer = (hs_list_rows){1, 1, other_ends, 3, more, of_more, 2};
    CHECK(hs_rows_without(&rows, &fewer, false, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    harness_random random = {80};
    node_scene_fill(&random, false, &scene);
    const hs_list_rows all = rows_given(true), third = fewer_given(&random, &all, false);
    CHECK(hs_rows_without(&all, &third, true, &options, &kept, NULL) == HS_OK);
    CHECK(hs_pairs_length(kept) == all.n_indices - third.n_indices && third.n_indices > 0);
    const int32_t *own = hs_pairs_array(kept, HS_WANT_SHIFT);
    for (int64_t e = 0; e < hs_pairs_length(kept); e++)
        CHECK(own[2 * e] % 3 != 0 && own[2 * e + 1] == -3);
    hs_pairs_free(kept);
}

/* ---- what is refused ----------------------------------------------------------------------- */

static void
what_are_no_rows_is_refused(void)
{
    static const int64_t good[5] = {0, 1, 1, 2, 2}, descending[5] = {0, 1, 0, 2, 2};
    static const int64_t late[5] = {0, 1, 1, 2, 3}, below[5] = {-1, 1, 1, 2, 2};
    static const int64_t huge[5] = {0, INT64_C(1) << 33, INT64_C(1) << 33, INT64_C(1) << 33,
                                    INT64_C(1) << 33};
    static const int32_t one[3] = {0, 0, 0}, far[2] = {1, 0}, negative[2] = {-1, 0};
    static const int64_t counts[2] = {1, 1}, short_of[2] = {-1, 1};
    const hs_options     options = hs_options_default();
    const hs_list_rows   rows = {2, 2, good, 2, one, NULL, 1};
    hs_pairs            *kept;
    for (int order = 0; order < 2; order++) {
        static const int32_t same[2] = {0, 0}, places[2] = {0, 1};
        hs_node_change       change = {2, counts, same, order ? places : NULL};
        static const int64_t first[3] = {0, 1, 0}, outside[1] = {2}, before[1] = {-1};
        const hs_list_rows   wrong[] = {
              {-1, 2, good, 2, one, NULL, 1},
              {2, -1, good, 2, one, NULL, 1},
              {2, 2, NULL, 2, one, NULL, 1},
              {2, 2, good, -1, one, NULL, 1},
              {2, 2, good, 2, NULL, NULL, 1},
              {2, 2, good, 2, one, one, 0},
              {2, 2, good, 2, one, one, HS_MAX_DIM + 1},
              {2, 2, descending, 2, one, NULL, 1},
              {2, 2, late, 2, one, NULL, 1},
              {2, 2, below, 2, one, NULL, 1},
              {2, 2, good, 2, far, NULL, 1},
              {2, 2, good, 2, negative, NULL, 1},
        };
        for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
            CHECK(hs_rows_keep(&wrong[k], &change, NULL, 2, &options, &kept, NULL) ==
                  HS_ERR_ARGUMENT);
            CHECK(kept == NULL);
            if (k < 10) {
                CHECK(hs_rows_without(&wrong[k], &rows, true, &options, &kept, NULL) ==
                      HS_ERR_ARGUMENT);
                CHECK(hs_rows_without(&rows, &wrong[k], true, &options, &kept, NULL) ==
                      HS_ERR_ARGUMENT);
            }
        }
        CHECK(hs_rows_keep(&rows, &change, first, 2, &options, &kept, NULL) == HS_OK);
        hs_pairs_free(kept);
        CHECK(hs_rows_keep(&rows, &change, first, 3, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_rows_keep(&rows, &change, first, -1, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_rows_keep(&rows, &change, outside, 1, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        CHECK(hs_rows_keep(&rows, &change, before, 1, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        change.n_nodes = short_of;
        CHECK(hs_rows_keep(&rows, &change, NULL, 2, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        change.n_nodes = NULL;
        CHECK(hs_rows_keep(&rows, &change, NULL, 2, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        change = (hs_node_change){2, counts, NULL, NULL};
        CHECK(hs_rows_keep(&rows, &change, NULL, 2, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        change = (hs_node_change){1, counts, same, NULL};
        CHECK(hs_rows_keep(&rows, &change, NULL, 2, &options, &kept, NULL) == HS_ERR_ARGUMENT);
        change = (hs_node_change){2, counts, same, places};
        const hs_list_rows long_one = {2, 2, huge, INT64_C(1) << 33, one, NULL, 1};
        CHECK(hs_rows_keep(&long_one, &change, NULL, 2, &options, &kept, NULL) == HS_ERR_TOO_MANY);
    }
    /* A row that is taken twice has no room. */
    static const int64_t both[2] = {0, 2}, twice[2] = {0, 0}, pair_ends[3] = {0, 2, 2};
    static const int32_t pair[2] = {0, 1}, stay[2] = {0, 1};
    const hs_list_rows   single = {2, 1, pair_ends, 2, pair, NULL, 1};
    const hs_node_change two = {1, &both[1], stay, NULL};
    CHECK(hs_rows_keep(&single, &two, twice, 2, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    hs_list_rows other = rows;
    other.n = 1;
    CHECK(hs_rows_without(&rows, &other, true, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    other = (hs_list_rows){2, 1, pair_ends, 2, pair, NULL, 1};
    CHECK(hs_rows_without(&rows, &other, true, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    other = rows;
    other.shift = one;
    CHECK(hs_rows_without(&rows, &other, true, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    hs_list_rows shifted = other;
    shifted.ndim = 2;
    shifted.shift = indices;
    CHECK(hs_rows_without(&shifted, &other, true, &options, &kept, NULL) == HS_ERR_ARGUMENT);
    static const int64_t twice_ends[5] = {0, 2, 2, 2, 2};
    const hs_list_rows   repeated = {2, 2, twice_ends, 2, one, NULL, 1};
    CHECK(hs_rows_without(&rows, &repeated, false, &options, &kept, NULL) == HS_ERR_ARGUMENT);
}

static hs_status
keep_once(void *context)
{
    const bool           in_order = *(bool *)context;
    const hs_list_rows   rows = rows_given(true);
    const hs_node_change change = change_given(in_order);
    hs_pairs            *kept = NULL;
    hs_status            status = keep(&rows, &change, scene.n_lists > 0 ? rows.n : 0, &kept);
    CHECK((kept != NULL) == (status == HS_OK));
    hs_pairs_free(kept);
    if (status == HS_OK) {
        hs_options options = hs_options_default();
        options.memory_limit = limit;
        status = hs_rows_without(&rows, &rows, true, &options, &kept, NULL);
        CHECK(status != HS_OK || hs_pairs_length(kept) == 0);
        hs_pairs_free(kept);
    }
    return status;
}

static void
failures_leave_nothing(void)
{
    harness_random random = {81};
    do {
        node_scene_fill(&random, true, &scene);
    } while (scene.n_pairs < 40);
    for (int order = 0; order < 2; order++) {
        bool in_order = order;
        for (int32_t p = 0; p < scene.n; p++) {
            source[p] = p;
            target[p] = place[p] = p;
        }
        CHECK(fail_each_allocation(keep_once, &in_order, 100) > 5);
        check_arena(keep_once, &in_order);
        CHECK(raise_memory_limit(keep_once, &in_order, &limit) > 5);
    }
}

static void
long_rows_ask_the_caller(void)
{
    enum { LONG = 1 << 21 };
    static int32_t       many[LONG];
    static const int64_t ends[5] = {0, LONG / 4, LONG / 2, LONG / 4 * 3, LONG}, count[1] = {1};
    static const int32_t stays[1] = {0};
    const hs_list_rows   rows = {4, 1, ends, LONG, many, NULL, 1};
    const hs_node_change change = {1, count, stays, NULL};
    hs_options           options = hs_options_default();
    int64_t              left = 0;
    hs_pairs            *kept;
    options.poll = stop_after;
    options.poll_context = &left;
    CHECK(hs_rows_keep(&rows, &change, NULL, 4, &options, &kept, NULL) == HS_ERR_INTERRUPTED);
    left = 0;
    CHECK(hs_rows_without(&rows, &rows, true, &options, &kept, NULL) == HS_ERR_INTERRUPTED);
    left = 1; /* once only */
    CHECK(hs_rows_keep(&rows, &change, NULL, 4, &options, &kept, NULL) == HS_OK && left == 0);
    hs_pairs_free(kept);
    left = 1;
    CHECK(hs_rows_without(&rows, &rows, true, &options, &kept, NULL) == HS_OK && left == 0);
    hs_pairs_free(kept);
}

void
test_kept_rows(void)
{
    RUN(rows_have_the_nodes_that_stay);
    RUN(all_rows_stay_without_a_choice);
    RUN(rows_lose_the_entries_that_go);
    RUN(images_go_by_their_shifts);
    RUN(what_are_no_rows_is_refused);
    RUN(failures_leave_nothing);
    RUN(long_rows_ask_the_caller);
}
