/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_dynamic.c: dynamic lists, through the public interface, against plain arrays. */
#include "../../../csrc/core/dynamic/dynamic.h"
#include "../../../csrc/halfshell_dynamic.h"
#include "../support/among.h"
#include "../support/dynamic_brute.h"
#include "../support/harness.h"

#include <math.h>

void test_api_dynamic(void);

/* ---- after any history, in any box and storage, a list answers as brute force ---- */

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

static int polls_left;

/* What cannot be counted or told: places along oblique directions in
 * which the box does not repeat, and shifts between points that are each near enough. */
static void
what_cannot_be_counted_is_refused(void)
{
    const hs_box steep = {
        .ndim = 2, .periodic = {true, true}, .rows = {{1, 0.25}, {0x1p28, 0x1p26 + 1}}};
    const hs_box       oblique = {.ndim = 3, .periodic = {true}, .rows = {{1.0, 0.5, 0.0}}};
    const double       below[2] = {0.25, 0.5 - 0x1.8p33}, above[2] = {0.25, 0x1.8p33};
    const double       along[][3] = {{-1e13, 2e13, 3.0}, {-1e17, 2e17, 0.0}, {-2e300, 4e300, 1.0}};
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list;
    bool               any;
    options.ndim = 2;
    options.box = &steep;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, above, NULL) == HS_OK);
    for (int with_shift = 0; with_shift < 2; with_shift++) {
        brute_found     found = {.n = 0};
        const hs_status status =
            hs_dynamic_within(list, below, 0.75, with_shift, take_found, &found, NULL);
        CHECK(status == (with_shift ? HS_ERR_SHIFT_RANGE : HS_OK));
        CHECK((found.n > 0) == !with_shift);
    }
    CHECK(hs_dynamic_any_within(list, below, 0.5, NULL, &any, NULL) == HS_ERR_SHIFT_RANGE);
    hs_dynamic_free(list);
    options.ndim = 3;
    options.box = &oblique;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    for (int f = 0; f < 3; f++)
        CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, along[f], NULL) ==
              (f == 0 ? HS_OK : HS_ERR_SHIFT_RANGE));
    hs_dynamic_free(list);
}

/* What rounding moves a point by, far along a long box vector, may be a short one: the least period
 * says how far is too far. */
static void
the_least_period_bounds_what_is_wrapped(void)
{
    for (int turned = 0; turned < 2; turned++) {
        const double       length = 0x1p40, tilt = 0.25;
        const hs_box       box = {.ndim = 2,
                                  .periodic = {true, true},
                                  .rows = {{turned ? length : 1.0, turned ? tilt : 0.0},
                                           {turned ? 0.0 : tilt, turned ? 1.0 : length}}};
        hs_dynamic_options options = hs_dynamic_options_default();
        hs_dynamic        *list;
        double             x[2] = {0.5, 0.5};
        options.ndim = 2;
        options.box = &box;
        CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
        x[!turned] = 0x1p88;
        CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, x, NULL) == HS_OK);
        x[!turned] = 0x1.8p89;
        CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, x, NULL) == HS_ERR_SHIFT_RANGE);
        hs_dynamic_free(list);
    }
}

/* Cells of open space are told apart also where their indices are beyond 2^31. */
static void
cells_far_away_are_no_others(void)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list;
    options.ndim = 2;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    const double origin[2] = {0.5, 0.5}, far[2] = {0x1p32 + 0.5, 0x1p32 + 0.5};
    CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, origin, NULL) == HS_OK);
    brute_found found = {.n = 0};
    CHECK(hs_dynamic_near(list, far, 1.0, take_found, &found, NULL) == HS_OK && found.n == 0);
    CHECK(hs_dynamic_near(list, origin, 1.0, take_found, &found, NULL) == HS_OK && found.n == 1);
    hs_dynamic_free(list);
}

static bool
count_polls(void *user, double fraction)
{
    (void)user, (void)fraction;
    return --polls_left >= 0;
}

/* As long as it has changed nothing. */
static void
filling_can_be_interrupted(void)
{
    enum { N = (1 << 17) + 1 };
    static double          x[N];
    static int64_t         ids[N];
    const hs_points        points = {x, N, 1, HS_FLOAT64, 8, 8};
    const hs_dynamic_hooks hooks = {.poll = count_polls};
    for (int64_t i = 0; i < N; i++) {
        ids[i] = i;
        x[i] = (double)(i % 1000);
    }
    for (int trial = 0; trial < 4; trial++) {
        hs_status status = HS_ERR_INTERRUPTED;
        for (int polls = 0; status == HS_ERR_INTERRUPTED; polls++) {
            hs_dynamic_options options = hs_dynamic_options_default();
            hs_dynamic        *list;
            options.ndim = 1;
            options.storage = trial % 2 ? HS_STORE_DENSE : HS_STORE_HASH;
            CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
            if (trial % 2) /* rows that others are there before */
                CHECK(hs_dynamic_insert(list, (hs_key){-1, 0}, x, NULL) == HS_OK);
            hs_dynamic_hook(list, trial < 2 ? NULL : &hooks);
            polls_left = polls;
            status = hs_dynamic_insert_many(list, ids, NULL, &points, NULL);
            CHECK(status == HS_OK || (status == HS_ERR_INTERRUPTED && trial >= 2));
            CHECK(hs_dynamic_length(list) == trial % 2 + (status == HS_OK ? N : 0));
            CHECK(status != HS_OK || (polls > 0) == (trial >= 2));
            hs_dynamic_free(list);
        }
    }
}

/*
 * ---- api dynamic calls ----
 *
 * Calls that change a list, or ask for one point, refuse what they cannot take, and then have done
 * nothing.
 */

static hs_dynamic *
list_with_two(void)
{
    const hs_dynamic_options options = hs_dynamic_options_default();
    const double             x[2][3] = {{0.5, 1.5, -2.5}, {4.0, 0.0, 0.0}};
    hs_dynamic              *list = NULL;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, x[0], NULL) == HS_OK);
    CHECK(hs_dynamic_insert(list, (hs_key){2, 0}, x[1], NULL) == HS_OK);
    return list;
}

static void
no_list_is_an_argument_error(void)
{
    const double    x[3] = {0.0, 0.0, 0.0};
    const int64_t   id = 1;
    const hs_key    key = {1, 0};
    const hs_points points = points_in_rows(x, 1, 3);
    double          back[3];
    int64_t         cell[3], cursor = 0;
    hs_dynamic     *copy;
    hs_key          found;

    hs_dynamic_counters counters;
    CHECK(hs_dynamic_copy(NULL, &copy) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_insert(NULL, key, x, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_move(NULL, key, x, NULL) == HS_ERR_ARGUMENT);
    CHECK(!hs_dynamic_remove(NULL, key) && !hs_dynamic_has(NULL, key));
    CHECK(hs_dynamic_insert_many(NULL, &id, NULL, &points, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_remove_many(NULL, &id, NULL, 1, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_shrink_to_fit(NULL) == HS_ERR_ARGUMENT && hs_dynamic_length(NULL) == 0);
    CHECK(hs_dynamic_position(NULL, key, back) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_cell(NULL, key, cell) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_keys(NULL, &cursor, &found, 1) == 0 && hs_dynamic_look(NULL).n_points == 0);
    hs_dynamic_clear(NULL);
    hs_dynamic_free(NULL);
    hs_dynamic_hold(NULL);
    hs_dynamic_release(NULL);
    hs_dynamic_count(NULL, &counters);
}

static void
missing_arguments_change_nothing(void)
{
    double          x[3] = {0.0, 0.0, 0.0};
    const int64_t   id = 1;
    const hs_key    key = {1, 0};
    const hs_points good = points_in_rows(x, 1, 3);
    hs_points       flat = good, bad = good;
    hs_failure      failure;
    hs_dynamic     *list = list_with_two();
    const int64_t   changes = hs_dynamic_look(list).changes;
    flat.ndim = 2;
    bad.n = -1;
    CHECK(hs_dynamic_copy(list, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_insert_many(list, &id, NULL, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_insert_many(list, &id, NULL, &flat, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_insert_many(list, NULL, NULL, &good, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_insert_many(list, &id, NULL, &bad, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_remove_many(list, &id, NULL, -1, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_remove_many(list, NULL, NULL, 1, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_position(list, key, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_cell(list, key, NULL) == HS_ERR_ARGUMENT);
    x[2] = NAN;
    CHECK(hs_dynamic_insert_many(list, &id, NULL, &good, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == 0 && failure.column == 2);
    CHECK(hs_dynamic_length(list) == 2 && hs_dynamic_look(list).changes == changes);
    hs_dynamic_free(list);
}

static void
cells_are_those_of_the_coordinates(void)
{
    const hs_box       box = {.ndim = 2, .periodic = {true, false}, .rows = {{6.0, 0}, {0, 1}}};
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = list_with_two();
    int64_t            cell[3] = {9, 9, 9};
    CHECK(hs_dynamic_cell(list, (hs_key){1, 0}, cell) == HS_OK);
    CHECK(cell[0] == 0 && cell[1] == 1 && cell[2] == -3);
    const double far[3] = {7.5, -0.25, 1e300}, bad[3] = {0.0, NAN, 0.0};
    hs_failure   failure;
    CHECK(hs_dynamic_cell_of(list, (double[3]){7.5, -0.25, 3.0}, cell, NULL) == HS_OK);
    CHECK(cell[0] == 7 && cell[1] == -1 && cell[2] == 3 && hs_dynamic_length(list) == 2);
    CHECK(hs_dynamic_cell_of(list, bad, cell, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.column == 1 && cell[0] == 7);
    CHECK(hs_dynamic_cell_of(NULL, far, cell, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_cell_of(list, NULL, cell, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_cell_of(list, far, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_cell(list, (hs_key){3, 0}, cell) == HS_ERR_KEY);
    hs_dynamic_free(list);
    options.ndim = 2;
    options.box = &box;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    for (int64_t id = 0; id < 12; id++) {
        const double x[2] = {(double)id - 20.0 + 0.25, (double)id - 6.0};
        CHECK(hs_dynamic_insert(list, (hs_key){id, 0}, x, NULL) == HS_OK);
        CHECK(hs_dynamic_cell(list, (hs_key){id, 0}, cell) == HS_OK);
        CHECK(cell[0] == (id + 1) % 6 && cell[1] == id - 6);
        CHECK(hs_dynamic_cell_of(list, (const double[2]){x[0] + 60.0, 3.5}, cell, NULL) == HS_OK);
        CHECK(cell[0] == (id + 1) % 6 && cell[1] == 3);
    }
    hs_dynamic_free(list);
    options.box = NULL;
    options.storage = HS_STORE_ALL_PAIRS;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, NULL, NULL) == HS_OK);
    CHECK(hs_dynamic_cell(list, (hs_key){1, 0}, cell) == HS_ERR_ARGUMENT); /* it has no position */
    hs_dynamic_free(list);
}

/* ---- queries, keys in turn and calls in a row refuse what they cannot take ---- */

static int
count_keys_ball(hs_key key, const double *position, const int64_t *shift, void *user)
{
    (void)key, (void)position, (void)shift;
    ++*(int *)user;
    return 0;
}

static hs_dynamic *
line_of(int64_t n)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    options.ndim = 1;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    for (int64_t id = 0; id < n; id++) {
        const double x = 0.3 * (double)id;
        CHECK(hs_dynamic_insert(list, (hs_key){id, 0}, &x, NULL) == HS_OK);
    }
    return list;
}

static void
missing_arguments_are_refused(void)
{
    const double x = 0.0;
    hs_dynamic  *list = line_of(3);
    int          n = 0;
    bool         any = true;
    CHECK(hs_dynamic_near(NULL, &x, 1.0, count_keys_ball, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_near(list, NULL, 1.0, count_keys_ball, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_near(list, &x, 1.0, NULL, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_within(NULL, &x, 1.0, false, count_keys_ball, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_within(list, NULL, 1.0, false, count_keys_ball, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_within(list, &x, 1.0, false, NULL, &n, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_any_within(NULL, &x, 1.0, NULL, &any, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_any_within(list, NULL, 1.0, NULL, &any, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_any_within(list, &x, 1.0, NULL, NULL, NULL) == HS_ERR_ARGUMENT);
    CHECK(n == 0 && any);
    hs_dynamic_free(list);
}

static void
bad_balls_visit_nothing(void)
{
    const double x = 0.0, bad = NAN;
    const double radii[] = {-1.0, NAN, INFINITY, 1.0000001};
    hs_dynamic  *list = line_of(3);
    int          n = 0;
    bool         any = true;
    for (int r = 0; r < 4; r++) {
        hs_failure failure;
        CHECK(hs_dynamic_near(list, &x, radii[r], count_keys_ball, &n, &failure) == HS_ERR_CUTOFF);
        CHECK(failure.value == radii[r] || isnan(radii[r]));
        CHECK(hs_dynamic_within(list, &x, radii[r], true, count_keys_ball, &n, NULL) ==
              HS_ERR_CUTOFF);
        CHECK(hs_dynamic_any_within(list, &x, radii[r], NULL, &any, NULL) == HS_ERR_CUTOFF);
    }
    CHECK(hs_dynamic_near(list, &bad, 0.5, count_keys_ball, &n, NULL) == HS_ERR_NOT_FINITE);
    CHECK(n == 0 && any);
    hs_dynamic_free(list);
}

static void
what_is_not_held_need_not_be_released(void)
{
    hs_dynamic *list = line_of(3);
    hs_dynamic_release(list);
    CHECK(hs_dynamic_length(list) == 3);
    hs_dynamic_hold(list);
    CHECK(hs_dynamic_length(list) == 3 && hs_gate_is_mine(&list->gate));
    hs_dynamic_release(list);
    hs_dynamic_release(list);
    CHECK(!hs_gate_is_mine(&list->gate));
    hs_dynamic_free(list);
}

static void
counters_begin_at_zero(void)
{
    const double        x = 0.1;
    hs_dynamic         *list = line_of(9);
    hs_dynamic_counters counters = {.wraps = 7, .cells = 7, .candidates = 7, .exact = 7};
    int                 n = 0;
    hs_dynamic_count(NULL, &counters);
    CHECK(counters.cells == 7);
    hs_dynamic_count(list, &counters);
    CHECK(counters.cells == 0 && counters.wraps == 0);
    CHECK(hs_dynamic_within(list, &x, 1.0, false, count_keys_ball, &n, NULL) == HS_OK);
    CHECK(counters.candidates >= n && n == 4);
    hs_dynamic_count(list, NULL);
    const int64_t before = counters.cells;
    CHECK(hs_dynamic_within(list, &x, 1.0, false, count_keys_ball, &n, NULL) == HS_OK);
    CHECK(counters.cells == before);
    hs_dynamic_free(list);
}

/* ---- lists as a whole: options, copies, keys in turn, and no list at all ---- */

static void
bad_options_are_refused(void)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    hs_failure         failure;
    const double       bad[] = {0.0, -1.0, NAN, INFINITY, 1e-100, 1e100};
    CHECK(hs_dynamic_new(NULL, &list, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_new(&options, NULL, NULL) == HS_ERR_ARGUMENT);
    for (int b = 0; b < 6; b++) {
        options.cell_size = bad[b];
        CHECK(hs_dynamic_new(&options, &list, &failure) == HS_ERR_CUTOFF && list == NULL);
        CHECK(failure.column == HS_LENGTH_CELL_SIZE);
        options.cell_size = 1.0;
        options.max_radius = bad[b];
        CHECK((hs_dynamic_new(&options, &list, &failure) == HS_OK) == (b == 0));
        CHECK(b == 0 || failure.column == HS_LENGTH_MAX_RADIUS);
        hs_dynamic_free(list);
        list = NULL;
        options.max_radius = 0.0;
    }
    options.ndim = 9;
    CHECK(hs_dynamic_new(&options, &list, &failure) == HS_ERR_ARGUMENT);
    hs_box box = {.ndim = 3};
    for (int l = 0; l < 3; l++) {
        box.periodic[l] = true;
        box.rows[l][l] = 4.0;
    }
    options.ndim = 3;
    options.box = &box;
    box.rows[0][0] = 1e-100;
    CHECK(hs_dynamic_new(&options, &list, &failure) == HS_ERR_CUTOFF &&
          failure.column == HS_LENGTH_BOX);
    box.rows[0][0] = 1e-5;
    options.max_radius = 1e3;
    CHECK(hs_dynamic_new(&options, &list, &failure) == HS_ERR_CUTOFF &&
          failure.column == HS_LENGTH_MAX_RADIUS);
    memset(box.rows[0], 0, sizeof box.rows[0]);
    CHECK(hs_dynamic_new(&options, &list, &failure) == HS_ERR_BOX_DEPENDENT);
}

/* Which ids 0, 1, ... of n come when keys are taken so many at a time; each must come once. */
static bool
keys_come_once(const hs_dynamic *list, int64_t n, int64_t at_a_time)
{
    hs_key  keys[8];
    int64_t cursor = 0, found = 0, sum = 0;
    for (int64_t got; (got = hs_dynamic_keys(list, &cursor, keys, at_a_time)) > 0; found += got) {
        for (int64_t k = 0; k < got; k++) {
            sum += keys[k].id;
        }
    }
    return found == n && sum == n * (n - 1) / 2;
}

static void
keys_come_in_turn_and_copies_hold_them(void)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list, *copy;
    hs_key             key = {0, 0};
    int64_t            cursor = -1;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    CHECK(hs_dynamic_keys(list, &cursor, &key, 1) == 0);
    CHECK(hs_dynamic_keys(list, NULL, &key, 1) == 0);
    cursor = 0;
    CHECK(hs_dynamic_keys(list, &cursor, NULL, 1) == 0);
    hs_dynamic_release(list); /* was not held */
    hs_dynamic_hold(list);
    for (key.id = 0; key.id < 20; key.id++) { /* five in each of four cells */
        CHECK(hs_dynamic_insert(list, key, (double[]){(double)(key.id % 4), 0.5, 0.5}, NULL) ==
              HS_OK);
    }
    hs_dynamic_release(list);
    CHECK(hs_dynamic_copy(list, NULL) == HS_ERR_ARGUMENT);
    CHECK(hs_dynamic_copy(list, &copy) == HS_OK);
    for (int64_t n = 1; n <= 8; n++) {
        CHECK(keys_come_once(list, 20, n) && keys_come_once(copy, 20, n));
    }
    hs_dynamic_clear(list);
    CHECK(hs_dynamic_shrink_to_fit(list) == HS_OK && hs_dynamic_length(list) == 0);
    CHECK(hs_dynamic_length(copy) == 20 && hs_dynamic_look(copy).n_cells == 4);
    for (int k = 0; k < 3; k++) {
        CHECK(hs_dynamic_look(list).cell_size[k] == options.cell_size);
    }
    hs_dynamic_free(list);
    hs_dynamic_free(copy);
}

void
test_api_dynamic(void)
{
    RUN(answers_are_those_of_brute_force);
    RUN(far_points_are_found);
    RUN(keys_need_no_position_in_all_pairs);
    RUN(bad_points_change_nothing);
    RUN(what_cannot_be_counted_is_refused);
    RUN(the_least_period_bounds_what_is_wrapped);
    RUN(cells_far_away_are_no_others);
    RUN(filling_can_be_interrupted);
    RUN(no_list_is_an_argument_error);
    RUN(missing_arguments_change_nothing);
    RUN(cells_are_those_of_the_coordinates);
    RUN(missing_arguments_are_refused);
    RUN(bad_balls_visit_nothing);
    RUN(what_is_not_held_need_not_be_released);
    RUN(counters_begin_at_zero);
    RUN(bad_options_are_refused);
    RUN(keys_come_in_turn_and_copies_hold_them);
}
