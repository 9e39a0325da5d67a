/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * fuzz_dynamic.c: bytes become a list and what is done to it, one operation after another; each
 * answer must be that of plain arrays and brute force, also after memory was refused. Coordinates are
 * steps of a grid, so that distances tie with radii, or a hair from there. Aborts on any difference.
 */
#include "../../../csrc/core/memory/memory.h"
#include "../support/dynamic_brute.h"

#include <math.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#if !defined(LLVMFuzzerTestOneInput) /* which stands for another name among the tests */
int         harness_failures;
int         harness_tests;
const char *harness_filter;
bool        harness_times;
#endif

enum { KEYS = 20, MANY = 6, MOST_QUERIES = 8 };

typedef struct input {
    const uint8_t *at, *end;
} input;

typedef struct state {
    input       in;
    hs_dynamic *list;
    brute_list  brute;
    hs_storage  storage;
    bool        is_far[HS_MAX_DIM]; /* coordinates that may be: the box does not move them */
    int         queries;
} state;

/* Zeros after the end. */
static int
take(input *in)
{
    return in->at < in->end ? *in->at++ : 0;
}

static void
must(bool holds, const char *what)
{
    if (!holds) {
        fprintf(stderr, "fuzz_dynamic: %s\n", what);
        abort();
    }
}

/* Eighths from -4 to 4, some moved by the last bits, some very large. */
static void
take_position(state *of, double *x)
{
    for (int k = 0; k < of->brute.ndim; k++) {
        const int byte = take(&of->in);
        x[k] = (byte % 65 - 32) / 8.0;
        if (byte > 200)
            x[k] = nextafter(x[k], byte % 2 == 0 ? 9.0 : -9.0);
        if (byte == 199 && of->is_far[k])
            x[k] = ldexp(x[k], 4 * take(&of->in));
    }
}

/* reach: images to each side that can matter. Points and centres are up to 8 apart, and balls 1.5
 * large; rows are at least 1 or 4 long, and each step along the second row of a small box can be
 * almost one back along the first. */
static hs_box
take_box(input *in, int ndim, int *reach)
{
    hs_box    box = {.ndim = ndim};
    const int kind = take(in), small = ndim < 3 && kind & 1;
    *reach = !small ? 4 : kind & 2 ? 18 : 10;
    for (int l = 0; l < ndim; l++) {
        box.periodic[l] = (kind >> (2 + l) & 1) == 0;
        box.rows[l][l] = (small ? 1.0 : 4.0) + 0.125 * (take(in) % 8);
        if (l > 0 && kind & 2)
            box.rows[l][0] = 0.125 * (take(in) % 8);
    }
    return box;
}

static hs_dynamic_counters counted; /* of the list that was made last */

static void
begin(state *of)
{
    static const double widths[] = {0.5, 1.0, 1.5, 0.11};
    const int           first = take(&of->in), second = take(&of->in);
    hs_dynamic_options  options = hs_dynamic_options_default();
    hs_box              box;
    int                 reach = 0;
    options.ndim = 1 + first % 3;
    options.storage = of->storage = (hs_storage)(first / 3 % 3);
    options.inclusive = second & 1;
    options.cell_size = widths[second >> 1 & 3];
    options.max_radius = 1.5;
    if (second & 8) {
        box = take_box(&of->in, options.ndim, &reach);
        options.box = &box;
    }
    for (int k = 0; k < options.ndim; k++) { /* dense cells would have to reach there */
        of->is_far[k] = of->storage != HS_STORE_DENSE;
        for (int l = 0; options.box != NULL && l < options.ndim; l++)
            of->is_far[k] = of->is_far[k] && !(box.periodic[l] && box.rows[l][k] != 0.0);
    }
    must(hs_dynamic_new(&options, &of->list, NULL) == HS_OK, "no list");
    hs_dynamic_count(of->list, &counted);
    brute_init(&of->brute, &options, reach);
}

static void
put_one(state *of, bool must_be_there)
{
    const int    key = take(&of->in) % KEYS;
    const hs_key name = {key, 0};
    const bool   was = of->brute.has[key];
    double       x[HS_MAX_DIM] = {0};
    take_position(of, x);
    const hs_status status = must_be_there ? hs_dynamic_move(of->list, name, x, NULL)
                                           : hs_dynamic_insert(of->list, name, x, NULL);
    must(status == HS_OK || status == HS_ERR_MEMORY || (must_be_there && !was), "a point refused");
    must(status != HS_ERR_KEY || !was, "a key is not found");
    if (status == HS_OK) {
        must(was || !must_be_there, "a key is there that was not put");
        of->brute.has[key] = true;
        memcpy(of->brute.position[key], x, sizeof x);
    }
}

/* Rows of keys that differ, but for one in a while. */
static void
put_many(state *of, bool must_be_there)
{
    const int n = take(&of->in) % (MANY + 1), first = take(&of->in), step = 1 + first / 32 % 3;
    int64_t   ids[MANY] = {0};
    double    x[MANY][HS_MAX_DIM] = {{0}};
    bool      are_there = true, differ = true;
    for (int r = 0; r < n; r++) {
        ids[r] = (first + r * step) % KEYS;
        take_position(of, x[r]);
        are_there = are_there && of->brute.has[ids[r]];
        for (int q = 0; q < r; q++)
            differ = differ && ids[q] != ids[r];
    }
    const hs_points points = {.data = x,
                              .n = n,
                              .ndim = of->brute.ndim,
                              .real = HS_FLOAT64,
                              .row_stride = sizeof x[0],
                              .column_stride = sizeof(double)};
    const hs_status status = must_be_there
                                 ? hs_dynamic_move_many(of->list, ids, NULL, &points, NULL)
                                 : hs_dynamic_insert_many(of->list, ids, NULL, &points, NULL);
    const bool      can = differ && (are_there || !must_be_there);
    must(status == HS_ERR_MEMORY || status == (can ? HS_OK : HS_ERR_KEY), "rows");
    for (int r = 0; status == HS_OK && r < n; r++) {
        of->brute.has[ids[r]] = true;
        memcpy(of->brute.position[ids[r]], x[r], sizeof x[r]);
    }
}

static void
remove_many(state *of)
{
    const int n = take(&of->in) % (MANY + 1), first = take(&of->in);
    int64_t   ids[MANY] = {0};
    bool      removed[MANY] = {false};
    for (int r = 0; r < n; r++)
        ids[r] = (first + 3 * (n - r)) % KEYS; /* descending: a table of them is needed */
    const hs_status status = hs_dynamic_remove_many(of->list, ids, NULL, n, removed, NULL);
    must(status == HS_OK || status == HS_ERR_MEMORY, "rows to be removed");
    for (int r = 0; status == HS_OK && r < n; r++) {
        must(removed[r] == of->brute.has[ids[r]], "whether a row was there");
        of->brute.has[ids[r]] = false;
    }
}

static void
remove_one(state *of)
{
    const int key = take(&of->in) % KEYS;
    must(hs_dynamic_remove(of->list, (hs_key){key, 0}) == of->brute.has[key],
         "whether it was there");
    of->brute.has[key] = false;
}

static void
change_whole(state *of, int how)
{
    hs_dynamic *copy = NULL;
    hs_dynamic_release(of->list);
    if (how == 0) {
        hs_dynamic_clear(of->list);
        memset(of->brute.has, 0, sizeof of->brute.has);
    } else if (how == 1) {
        const hs_status status = hs_dynamic_shrink_to_fit(of->list);
        must(status == HS_OK || status == HS_ERR_MEMORY, "shrinking");
    } else if (hs_dynamic_copy(of->list, &copy) == HS_OK) {
        hs_dynamic_free(of->list);
        of->list = copy;
    }
}

static void
check_points(const state *of)
{
    must(hs_dynamic_length(of->list) == brute_length(&of->brute), "number of points");
    for (int key = 0; key < KEYS; key++) {
        double          x[HS_MAX_DIM];
        const hs_status status = hs_dynamic_position(of->list, (hs_key){key, 0}, x);
        must(status == (of->brute.has[key] ? HS_OK : HS_ERR_KEY), "which keys there are");
        must(status != HS_OK ||
                 memcmp(x, of->brute.position[key], (size_t)of->brute.ndim * sizeof *x) == 0,
             "a position");
    }
}

static void
query(state *of)
{
    static const double radii[] = {0.0, 0.125, 0.5, 0x1.fffffffffffffp-2, 1.0, 1.25, 1.5, 0.75};
    const double        radius = radii[take(&of->in) % 8];
    const int           failures = harness_failures;
    double              centre[HS_MAX_DIM] = {0};
    take_position(of, centre);
    if (++of->queries <= MOST_QUERIES) {
        brute_check(&of->brute, of->list, centre, radius);
        must(harness_failures == failures, "a query");
    }
}

static void
step(state *of)
{
    const int what = take(&of->in);
    switch (what % 16) {
    case 0: put_many(of, false); break;
    case 1: put_many(of, true); break;
    case 2: remove_many(of); break;
    case 3: change_whole(of, what / 16 % 3); break;
    case 4:
    case 5: remove_one(of); break;
    case 6: put_one(of, true); break;
    case 7: hs_test_fail_allocation(1 + what / 16 % 8); break; /* of what comes next */
    case 8:
        hs_dynamic_release(of->list);
        hs_dynamic_hold(of->list); /* for what comes next */
        break;
    case 9:
    case 10:
    case 11: query(of); break;
    default: put_one(of, false);
    }
    if (what % 16 != 7)
        hs_test_fail_allocation(0);
    if (what % 16 != 8)
        hs_dynamic_release(of->list);
}

int
LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static state  of;
    const int64_t before = hs_test_live_blocks();
    of.in = (input){data, data + size};
    of.queries = 0;
    begin(&of);
    while (of.in.at < of.in.end) {
        step(&of);
    }
    hs_test_fail_allocation(0);
    hs_dynamic_release(of.list);
    check_points(&of);
    of.queries = 0;
    query(&of);
    const hs_dynamic_state look = hs_dynamic_look(of.list);
    const int64_t          numbers[] = {look.n_cells, look.n_empty, look.changes};
    brute_seen = hash_bytes(brute_seen, numbers, sizeof numbers);
    brute_seen = hash_bytes(brute_seen, &counted, sizeof counted);
    hs_dynamic_free(of.list);
    must(hs_test_live_blocks() == before, "memory is left");
    return 0;
}
