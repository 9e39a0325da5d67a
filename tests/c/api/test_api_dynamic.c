/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_dynamic.c: after any history, in any box and storage, a list answers as brute force. */
#include "../../../csrc/core/memory/account.h"
#include "../support/dynamic_brute.h"

#include <math.h>

void test_api_dynamic(void);

typedef enum box_kind { OPEN, CUBE, SLAB, SKEWED, SMALL, SKEWED_WIRE, BOX_KINDS } box_kind;

static hs_box
box_of(box_kind kind, int ndim)
{
    hs_box box = {.ndim = ndim};
    for (int l = 0; l < ndim; l++) {
        box.periodic[l] = true;
        box.rows[l][l] = kind == SMALL ? 1.25 : 4.0 + 0.5 * l;
        if ((kind == SKEWED || kind == SKEWED_WIRE) && l > 0)
            box.rows[l][0] = 1.7;
    }
    if (kind == SLAB || kind == SKEWED_WIRE)
        box.periodic[ndim - 1] = ndim == 1;
    return box;
}

/* Positions on a fine grid, so that distances tie with radii, and some far away. */
static void
random_position(harness_random *random, int ndim, double *x)
{
    for (int k = 0; k < ndim; k++) {
        const uint64_t kind = random_bits(random) % 8;
        x[k] = kind < 5 ? (double)(random_bits(random) % 65) / 8.0 - 2.0
                        : 8.0 * random_unit(random) - 2.0;
    }
}

static void
change(harness_random *random, hs_dynamic *list, brute_list *brute)
{
    const int    key = (int)(random_bits(random) % BRUTE_KEYS);
    const hs_key name = {key, 0};
    double       x[HS_MAX_DIM] = {0};
    random_position(random, brute->ndim, x);
    switch (random_bits(random) % 5) {
    case 0:
        CHECK(hs_dynamic_remove(list, name) == brute->has[key]);
        brute->has[key] = false;
        return;
    case 1:
        CHECK(hs_dynamic_move(list, name, x, NULL) == (brute->has[key] ? HS_OK : HS_ERR_KEY));
        break;
    default: CHECK(hs_dynamic_insert(list, name, x, NULL) == HS_OK); brute->has[key] = true;
    }
    if (brute->has[key])
        memcpy(brute->position[key], x, sizeof x);
}

static void
check_points(const hs_dynamic *list, const brute_list *brute)
{
    hs_key  keys[BRUTE_KEYS + 1];
    int64_t cursor = 0, n = 0, more;
    CHECK(hs_dynamic_length(list) == brute_length(brute));
    while ((more = hs_dynamic_keys(list, &cursor, keys + n, 5)) > 0 && n < BRUTE_KEYS - 4)
        n += more;
    for (int key = 0; key < BRUTE_KEYS; key++) {
        double          x[HS_MAX_DIM];
        const hs_key    name = {key, 0}, other = {key, 1};
        const hs_status status = hs_dynamic_position(list, name, x);
        CHECK(hs_dynamic_has(list, name) == brute->has[key] && !hs_dynamic_has(list, other));
        CHECK(status == (brute->has[key] ? HS_OK : HS_ERR_KEY));
        CHECK(status != HS_OK ||
              memcmp(x, brute->position[key], (size_t)brute->ndim * sizeof *x) == 0);
    }
}

static void
check_all(harness_random *random, const hs_dynamic *list, const brute_list *brute)
{
    static const double radii[] = {0.0, 0.125, 0.5, 0x1.fffffffffffffp-2, 1.0, 1.25, 1.5};
    check_points(list, brute);
    for (int trial = 0; trial < 6; trial++) {
        double centre[HS_MAX_DIM];
        random_position(random, brute->ndim, centre);
        brute_check(brute, list, centre, radii[random_bits(random) % 7]);
    }
}

static void
run_history(int ndim, box_kind kind, hs_storage storage, double cell_size, uint64_t seed)
{
    static brute_list  brute;
    harness_random     random = {seed};
    const hs_box       box = box_of(kind, ndim);
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list, *copy;
    options.ndim = ndim;
    options.box = kind == OPEN ? NULL : &box;
    options.storage = storage;
    options.cell_size = cell_size;
    options.max_radius = 1.5;
    options.inclusive = seed % 2 == 0;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    brute_init(&brute, &options, kind == SMALL ? 7 : 4);
    for (int round = 0; round < (IS_SLOW ? 2 : 3); round++) {
        for (int step = 0; step < 150; step++)
            change(&random, list, &brute);
        check_all(&random, list, &brute);
        CHECK(hs_dynamic_copy(list, &copy) == HS_OK);
        check_all(&random, copy, &brute);
        hs_dynamic_free(copy);
        CHECK(hs_dynamic_shrink_to_fit(list) == HS_OK);
        CHECK(hs_dynamic_look(list).n_empty == 0);
        check_all(&random, list, &brute);
    }
    hs_dynamic_clear(list);
    memset(brute.has, 0, sizeof brute.has);
    check_all(&random, list, &brute);
    change(&random, list, &brute);
    check_all(&random, list, &brute);
    hs_dynamic_free(list);
}

static void
answers_are_those_of_brute_force(void)
{
    uint64_t seed = 1;
    for (int ndim = 1; ndim <= 3; ndim++)
        for (int kind = OPEN; kind < BOX_KINDS; kind++)
            for (int storage = HS_STORE_HASH; storage <= HS_STORE_ALL_PAIRS; storage++)
                for (int width = 0; width < (IS_SLOW || (kind == SMALL && ndim == 3) ? 1 : 3);
                     width++)
                    run_history(ndim, kind, storage,
                                width == 0   ? 0.5
                                : width == 1 ? 1.5
                                             : 0.11,
                                seed++);
}

/* x = 1 - 2^-54 and x + 1 = 2: two cells apart, and at distance 1 as computed in float64. */
static void
a_pair_across_two_cells_is_not_lost(void)
{
    const double       first = 0x1.fffffffffffffp-1, second = 0x1.fffffffffffffp0;
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list;
    bool               any;
    options.ndim = 1;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, &second, NULL) == HS_OK);
    CHECK(hs_dynamic_any_within(list, &first, 1.0, NULL, &any, NULL) == HS_OK && any);
    const double two = 2.0;
    CHECK(hs_dynamic_move(list, (hs_key){1, 0}, &two, NULL) == HS_OK);
    CHECK(hs_dynamic_any_within(list, &first, 1.0, NULL, &any, NULL) == HS_OK && !any);
    hs_dynamic_free(list);
}

/* Cells 2^32 apart share what the table knows of them, and those beyond 2^52 are one. */
static void
far_points_are_found(void)
{
    static const double places[] = {0.0, 0x1p32, -0x1p32, 0x1p40, 1e15, 1e16, 1e300, -1e308};
    hs_dynamic_options  options = hs_dynamic_options_default();
    static brute_list   brute;
    hs_dynamic         *list;
    options.ndim = 2;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    brute_init(&brute, &options, 0);
    for (int key = 0; key < BRUTE_KEYS; key++) {
        brute.has[key] = true;
        brute.position[key][0] = places[key % 8];
        brute.position[key][1] = places[key / 8];
        CHECK(hs_dynamic_insert(list, (hs_key){key, 0}, brute.position[key], NULL) == HS_OK);
    }
    for (int key = 0; key < BRUTE_KEYS; key++) {
        brute_check(&brute, list, brute.position[key], 1.0);
        brute_check(&brute, list, brute.position[key], 0.0);
    }
    hs_dynamic_free(list);
}

static int
count_keys(hs_key key, const double *position, const int64_t *shift, void *user)
{
    (void)key, (void)position, (void)shift;
    return ++*(int *)user == 3;
}

/* A visitor that has seen enough ends the visit; keys without positions are near everything. */
static void
keys_need_no_position_in_all_pairs(void)
{
    const double       x[3] = {0.0, 0.0, 0.0};
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list;
    hs_failure         failure;
    int                n = 0;
    double             back[3];
    options.storage = HS_STORE_ALL_PAIRS;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    for (int64_t id = 0; id < 5; id++)
        CHECK(hs_dynamic_insert(list, (hs_key){id, 0}, id < 2 ? NULL : x, &failure) == HS_OK);
    CHECK(hs_dynamic_near(list, x, 0.5, count_keys, &n, &failure) == HS_OK && n == 3);
    n = -10;
    CHECK(hs_dynamic_near(list, x, 0.5, count_keys, &n, &failure) == HS_OK && n == -5);
    CHECK(hs_dynamic_within(list, x, 0.5, false, count_keys, &n, &failure) == HS_ERR_KEY);
    CHECK(hs_dynamic_position(list, (hs_key){1, 0}, back) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_look(list).n_without == 2);
    CHECK(hs_dynamic_insert(list, (hs_key){0, 0}, x, &failure) == HS_OK);
    CHECK(hs_dynamic_remove(list, (hs_key){1, 0}));
    n = -10;
    CHECK(hs_dynamic_within(list, x, 0.5, false, count_keys, &n, &failure) == HS_OK && n == -6);
    hs_dynamic_free(list);
}

static void
bad_points_change_nothing(void)
{
    const hs_box       box = box_of(CUBE, 3);
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list;
    hs_failure         failure;
    double             x[3] = {0.5, NAN, 0.5}, back[3];
    const hs_key       key = {7, 0};
    bool               any;
    options.box = &box;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    CHECK(hs_dynamic_insert(list, key, x, &failure) == HS_ERR_NOT_FINITE && failure.column == 1);
    x[1] = 1e300;
    CHECK(hs_dynamic_insert(list, key, x, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(hs_dynamic_insert(list, key, NULL, &failure) == HS_ERR_ARGUMENT);
    x[1] = 1.5;
    CHECK(hs_dynamic_insert(list, key, x, &failure) == HS_OK);
    x[1] = INFINITY;
    CHECK(hs_dynamic_move(list, key, x, &failure) == HS_ERR_NOT_FINITE);
    CHECK(hs_dynamic_position(list, key, back) == HS_OK && back[1] == 1.5);
    CHECK(hs_dynamic_any_within(list, x, 0.5, NULL, &any, &failure) == HS_ERR_NOT_FINITE);
    CHECK(hs_dynamic_any_within(list, back, 1.0000001, NULL, &any, &failure) == HS_ERR_CUTOFF);
    CHECK(hs_dynamic_any_within(list, back, -0.5, NULL, &any, &failure) == HS_ERR_CUTOFF);
    CHECK(hs_dynamic_any_within(list, back, NAN, NULL, &any, &failure) == HS_ERR_CUTOFF);
    CHECK(hs_dynamic_length(list) == 1 && hs_dynamic_look(list).changes == 1);
    hs_dynamic_free(list);
}

void
test_api_dynamic(void)
{
    RUN(answers_are_those_of_brute_force);
    RUN(a_pair_across_two_cells_is_not_lost);
    RUN(far_points_are_found);
    RUN(keys_need_no_position_in_all_pairs);
    RUN(bad_points_change_nothing);
}
