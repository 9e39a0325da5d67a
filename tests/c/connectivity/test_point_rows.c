/* SPDX-License-Identifier: BSD-3-Clause */
/* test_point_rows.c: rows that are given are copied with their own numbers, turned under others,
 * and made of half lists; what are none is refused. */
#include "../../../csrc/core/connectivity/point_rows.h"
#include "../support/node_scenes.h"
#include "../support/poll_checks.h"

void test_point_rows(void);

static node_scene scene;
static int64_t    offsets[NODE_POINTS + 1];
static int32_t    indices[NODE_PAIRS];

/* Each direction of a pair with a probability of its own. */
static void
fill(harness_random *random)
{
    int64_t at = 0;
    node_scene_fill(random, true, &scene);
    for (int32_t p = 0; p < scene.n; p++) {
        offsets[p] = at;
        for (int32_t q = 0; q < scene.n; q++) {
            if (scene.near[p][q] && random_bits(random) % 2 == 0)
                indices[at++] = q;
        }
    }
    offsets[scene.n] = at;
}

static bool
has(const hs_point_rows *rows, int32_t row, int32_t number)
{
    for (int64_t e = rows->first[row]; e < rows->first[row + 1]; e++) {
        if (rows->index[e] == number)
            return true;
    }
    return false;
}

static bool
ascend(const hs_point_rows *rows)
{
    for (int64_t row = 0; row < rows->n; row++) {
        for (int64_t e = rows->first[row] + 1; e < rows->first[row + 1]; e++) {
            if (rows->index[e - 1] >= rows->index[e])
                return false;
        }
    }
    return rows->first[0] == 0;
}

static void
rows_are_copied_and_turned(void)
{
    harness_random random = {41};
    for (int trial = 0; trial < TRIALS(60); trial++) {
        int32_t       place[NODE_POINTS];
        hs_point_rows copy, turned;
        fill(&random);
        const hs_index_rows given = {scene.n, offsets, offsets[scene.n], indices};
        CHECK(hs_point_rows_copy(NULL, &given, &copy) == HS_OK);
        for (int32_t p = 0; p < scene.n; p++)
            place[scene.number[p]] = p;
        CHECK(hs_point_rows_turn(NULL, &copy, scene.number, place, &turned) == HS_OK);
        CHECK(ascend(&copy) && ascend(&turned));
        CHECK(copy.first[scene.n] == offsets[scene.n] + scene.n);
        CHECK(turned.first[scene.n] == copy.first[scene.n]);
        for (int32_t p = 0; p < scene.n; p++) {
            CHECK(has(&copy, p, p));
            for (int64_t e = offsets[p]; e < offsets[p + 1]; e++) {
                CHECK(has(&copy, p, indices[e]));
                CHECK(has(&turned, place[indices[e]], place[p]));
            }
        }
        hs_point_rows_free(NULL, &copy);
        hs_point_rows_free(NULL, &turned);
        hs_point_rows_free(NULL, &turned);
    }
}

static void
what_are_no_rows_is_refused(void)
{
    static const int64_t ends[3] = {0, 1, 1}, none[3] = {0, 0, 0};
    static const int32_t one[1] = {1};
    hs_point_rows        rows;
    const hs_index_rows  wrong[] = {{-1, ends, 1, one},
                                    {INT64_C(1) << 31, ends, 1, one},
                                    {2, NULL, 1, one},
                                    {2, ends, 1, NULL},
                                    {2, ends, 0, NULL}};
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        CHECK(hs_point_rows_copy(NULL, &wrong[k], &rows) == HS_ERR_ARGUMENT);
        CHECK(rows.first == NULL && rows.index == NULL);
    }
    const hs_index_rows empty = {2, none, 0, NULL};
    CHECK(hs_point_rows_copy(NULL, &empty, &rows) == HS_OK && rows.first[2] == 2);
    hs_point_rows_free(NULL, &rows);
}

void
test_point_rows(void)
{
    RUN(rows_are_copied_and_turned);
    RUN(what_are_no_rows_is_refused);
}
