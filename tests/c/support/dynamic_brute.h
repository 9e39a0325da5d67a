/* SPDX-License-Identifier: BSD-3-Clause */
/* dynamic_brute.h: a list of keys and positions in plain arrays, which every answer of a hs_dynamic
 * is compared with: distances by the exact metric, for each image that can matter. */
#ifndef HS_DYNAMIC_BRUTE_H
#define HS_DYNAMIC_BRUTE_H

#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/exact/metric.h"
#include "../../../csrc/halfshell_dynamic.h"
#include "harness.h"
#include "kept.h"

enum { BRUTE_KEYS = 64, BRUTE_FOUND = 20000 };

typedef struct brute_list {
    int    ndim;
    hs_box box; /* n_rows 0: open */
    int    n_rows;
    int    axis_of_row[HS_MAX_DIM];
    double rows[HS_MAX_DIM][HS_MAX_DIM];
    bool   inclusive;
    int    reach; /* images to each side that can matter */
    bool   has[BRUTE_KEYS];
    double position[BRUTE_KEYS][HS_MAX_DIM];
} brute_list;

/* What a query found: key and S of each. */
typedef struct brute_found {
    int     n;
    int64_t id[BRUTE_FOUND];
    int64_t shift[BRUTE_FOUND][HS_MAX_DIM];
} brute_found;

static inline void
brute_init(brute_list *brute, const hs_dynamic_options *options, int reach)
{
    memset(brute, 0, sizeof *brute);
    brute->ndim = options->ndim;
    brute->inclusive = options->inclusive;
    brute->reach = reach;
    for (int l = 0; options->box != NULL && l < options->ndim; l++) {
        if (options->box->periodic[l]) {
            memcpy(brute->rows[brute->n_rows], options->box->rows[l], sizeof brute->rows[0]);
            brute->axis_of_row[brute->n_rows++] = l;
        }
    }
}

static inline int
brute_length(const brute_list *brute)
{
    int n = 0;
    for (int key = 0; key < BRUTE_KEYS; key++)
        n += brute->has[key];
    return n;
}

/* All (key, S) within the ball. */
static inline void
brute_within(const brute_list *brute, const double *centre, double radius, brute_found *found)
{
    const int      side = 2 * brute->reach + 1;
    const hs_fpenv env = hs_fpenv_enter();
    hs_stages      stages = {0};
    hs_metric      metric;
    int64_t        images = 1;
    hs_metric_init(&metric, brute->ndim, brute->n_rows, brute->rows, radius, brute->inclusive);
    for (int r = 0; r < brute->n_rows; r++)
        images *= side;
    found->n = 0;
    for (int key = 0; key < BRUTE_KEYS; key++) {
        for (int64_t image = 0; brute->has[key] && image < images; image++) {
            int64_t shift[HS_MAX_DIM], rest = image;
            for (int r = 0; r < brute->n_rows; r++) {
                shift[r] = rest % side - brute->reach;
                rest /= side;
            }
            if (hs_metric_within(&metric, centre, brute->position[key], shift, &stages)) {
                memset(found->shift[found->n], 0, sizeof found->shift[0]);
                found->id[found->n] = key;
                for (int r = 0; r < brute->n_rows; r++)
                    found->shift[found->n][brute->axis_of_row[r]] = shift[r];
                found->n++;
            }
        }
    }
    hs_fpenv_leave(env);
}

static inline bool
brute_holds(const brute_found *found, int64_t id, const int64_t *shift)
{
    for (int f = 0; f < found->n; f++)
        if (found->id[f] == id &&
            (shift == NULL || memcmp(found->shift[f], shift, sizeof found->shift[f]) == 0))
            return true;
    return false;
}

static int
take_found(hs_key key, const double *position, const int64_t *shift, void *user)
{
    brute_found *found = user;
    if (found->n < BRUTE_FOUND) {
        memset(found->shift[found->n], 0, sizeof found->shift[0]);
        found->id[found->n] = key.id;
        for (int k = 0; shift != NULL && k < HS_MAX_DIM; k++)
            found->shift[found->n][k] = 0;
        found->n++;
    }
    (void)position;
    return 0;
}

static int brute_ndim; /* of the list whose queries take_shifted gets */

static int
take_shifted(hs_key key, const double *position, const int64_t *shift, void *user)
{
    brute_found *found = user;
    const int    n = found->n;
    (void)take_found(key, position, NULL, user);
    if (found->n > n)
        memcpy(found->shift[n], shift, (size_t)brute_ndim * sizeof *shift);
    return 0;
}

static uint64_t brute_seen = 1; /* a hash of what queries found, in their order */

/* Whether every query of the list at this ball gives what brute force does. */
static inline void
brute_check(const brute_list *brute, const hs_dynamic *list, const double *centre, double radius)
{
    static brute_found expected, found, near;
    bool               any = false;
    brute_ndim = brute->ndim;
    brute_within(brute, centre, radius, &expected);
    found.n = near.n = 0;
    CHECK(hs_dynamic_within(list, centre, radius, true, take_shifted, &found, NULL) == HS_OK);
    CHECK(found.n == expected.n);
    for (int f = 0; f < found.n; f++)
        CHECK(brute_holds(&expected, found.id[f], found.shift[f]));
    for (int f = 0; f < expected.n; f++)
        CHECK(brute_holds(&found, expected.id[f], expected.shift[f]));
    CHECK(hs_dynamic_near(list, centre, radius, take_found, &near, NULL) == HS_OK);
    CHECK(near.n <= brute_length(brute));
    brute_seen = hash_bytes(brute_seen, found.id, (size_t)found.n * sizeof *found.id);
    brute_seen = hash_bytes(brute_seen, near.id, (size_t)near.n * sizeof *near.id);
    for (int f = 0; f < near.n; f++)
        for (int g = 0; g < f; g++)
            CHECK(near.id[f] != near.id[g]);
    for (int f = 0; f < expected.n; f++)
        CHECK(brute_holds(&near, expected.id[f], NULL));
    CHECK(hs_dynamic_any_within(list, centre, radius, NULL, &any, NULL) == HS_OK);
    CHECK(any == (expected.n > 0));
    for (int key = 0; key < BRUTE_KEYS; key += 7) {
        const hs_key    skip = {key, 0};
        const int64_t   none[HS_MAX_DIM] = {0};
        const int       home = brute_holds(&expected, key, none);
        hs_failure      failure;
        const hs_status status = hs_dynamic_any_within(list, centre, radius, &skip, &any, &failure);
        CHECK(status == (brute->has[key] ? HS_OK : HS_ERR_KEY));
        CHECK(status != HS_OK || any == (expected.n > home));
    }
}

#endif
