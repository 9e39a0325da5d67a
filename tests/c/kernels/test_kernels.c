/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_kernels.c: the scans of every kernel of this CPU against a plain loop, with their arrays
 * between guard pages, and which kernels there are. test_copies.c has gathering and emitting.
 */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include <math.h>

#include "../support/among.h"
#include "../support/kernel_checks.h"

void test_kernels(void);

enum {
    SHORT_BLOCK = 3 * 32 + 2,                 /* past three times the widest vector */
    MOST_HITS = 2 * HS_BLOCK_CANDIDATES,      /* of a scan here */
    MOST_ROWS = 3,                            /* of radii */
    PITCH = HS_BLOCK_CANDIDATES + HS_PADDING, /* of supports */
    N_FORMS = HS_SCAN_SQUARES + 1
};

/* A scan with its arrays, owned by this file and reused. */
static guarded y_pages[HS_MAX_DIM], label_pages, q_pages[HS_MAX_DIM];
static guarded hits_pages, squares_pages, end_pages, unsure_pages;
static guarded point_radius_pages, block_radius_pages, row_pages;

static void
guard_scans(void)
{
    const size_t candidates = (HS_BLOCK_CANDIDATES + HS_PADDING) * sizeof(float);
    for (int k = 0; k < HS_MAX_DIM; k++) {
        y_pages[k] = guarded_pages(candidates);
        q_pages[k] = guarded_pages(HS_GROUP_POINTS * sizeof(float));
    }
    block_radius_pages = guarded_pages(MOST_ROWS * candidates);
    row_pages = guarded_pages(HS_GROUP_POINTS * sizeof(int32_t));
    point_radius_pages = guarded_pages(HS_GROUP_POINTS * sizeof(float));
    label_pages = guarded_pages(candidates);
    hits_pages = guarded_pages((MOST_HITS + HS_PADDING) * sizeof(int32_t));
    squares_pages = guarded_pages((MOST_HITS + HS_PADDING) * sizeof(float));
    end_pages = guarded_pages(HS_GROUP_POINTS * sizeof(int32_t));
    unsure_pages = guarded_pages(HS_BLOCK_CANDIDATES * sizeof(hs_unsure));
}

/* The numbers of a scene; they are copied against the guards. */
typedef struct numbers {
    int           ndim;
    int32_t       n, n_points;
    int32_t       most_hits, most_unsure; /* room for that many */
    bool          triangular;
    float         y[HS_MAX_DIM][HS_BLOCK_CANDIDATES];
    int32_t       label[HS_BLOCK_CANDIDATES];
    float         q[HS_MAX_DIM][HS_GROUP_POINTS];
    hs_thresholds direct;
    hs_rule       rule;
    float         bound;
    hs_limit_form form;
    bool          has_of_point, has_of_block; /* else NULL */
    float         of_point[HS_GROUP_POINTS], of_block[HS_BLOCK_CANDIDATES];
    int32_t       n_rows; /* of radii of the block; 0: one for all points */
    /* Supports; their thresholds are (size - 1)^2 and (size + 1)^2. */
    hs_rule support_rule;
    float   support_of_point[HS_GROUP_POINTS * (HS_SUPPORT_ENTRIES + 1)];
    float   support_of_block[HS_SUPPORT_ENTRIES + 1][PITCH];
} numbers;

static numbers scene;

/* The radius of candidate c in this row: some are negative in a row that is one of several. */
static float
row_radius(const numbers *s, int32_t row, int32_t c)
{
    return s->n_rows > 0 && (c + row) % 5 == 0 ? -1.0f : s->of_block[(c + 7 * row) % s->n];
}

static int32_t
row_of(const numbers *s, int32_t t)
{
    return s->n_rows > 0 ? t * 5 % s->n_rows : 0;
}

/* What lies past the last candidate must never be listed, whatever it is. */
static void
place_floats(guarded pages, const float *from, int32_t n, bool at_end, const float **to)
{
    const int32_t room = n + HS_PADDING;
    float        *array = guarded_place(pages, room, sizeof(float), at_end);
    memcpy(array, from, (size_t)n * sizeof(float));
    for (int32_t c = n; c < room; c++) {
        array[c] = c % 3 == 0 ? NAN : c % 3 == 1 ? 0.0f : -INFINITY;
    }
    *to = array;
}

/* Radii against the guards. */
static void
place_limits(const numbers *s, bool at_end, hs_limit_scan *limits)
{
    *limits = (hs_limit_scan){.rule = s->rule, .bound = s->bound, .form = s->form};
    if (s->has_of_point) {
        float *radii = guarded_place(point_radius_pages, s->n_points, sizeof(float), at_end);
        memcpy(radii, s->of_point, (size_t)s->n_points * sizeof(float));
        limits->of_point = radii;
    }
    if (s->has_of_block) {
        const int32_t n_rows = s->n_rows > 0 ? s->n_rows : 1, pitch = s->n + HS_PADDING;
        float        *all =
            guarded_place(block_radius_pages, (int64_t)n_rows * pitch, sizeof(float), at_end);
        for (int32_t e = 0; e < n_rows * pitch; e++) {
            all[e] = e % pitch < s->n ? row_radius(s, e / pitch, e % pitch) : NAN;
        }
        limits->of_block = all;
        limits->stride = pitch;
    }
    if (s->has_of_block && s->n_rows > 0) {
        int32_t *row = guarded_place(row_pages, s->n_points, sizeof(int32_t), at_end);
        for (int32_t t = 0; t < s->n_points; t++) {
            row[t] = row_of(s, t);
        }
        limits->row = row;
    }
}

static hs_scan
place_scan(const numbers *s, hs_scan_form form, bool counts, bool at_end)
{
    const hs_rule rule = s->support_rule;
    hs_scan       scan = {.form = form,
                          .counts = counts,
                          .ndim = s->ndim,
                          .n = s->n,
                          .n_points = s->n_points,
                          .most_hits = s->most_hits,
                          .most_unsure = s->most_unsure,
                          .triangular = s->triangular,
                          .direct = s->direct,
                          .n_unsure = -1,
                          .n_hits = -1};
    for (int k = 0; k < s->ndim; k++) {
        float *q = guarded_place(q_pages[k], s->n_points, sizeof(float), at_end);
        memcpy(q, s->q[k], (size_t)s->n_points * sizeof(float));
        scan.q[k] = q;
        place_floats(y_pages[k], s->y[k], s->n, at_end, &scan.y[k]);
    }
    place_limits(s, at_end, &scan.limits);
    scan.supports = (hs_support_scan){
        .rule = rule,
        .form = {1.0f, 1.0f, 1.0f, 1.0f},
        .of_point = rule != HS_RULE_SCATTER ? s->support_of_point : NULL,
        .of_block = rule != HS_RULE_GATHER ? s->support_of_block[0] : NULL,
        .pitch = PITCH,
    };
    int32_t *label = guarded_place(label_pages, s->n + HS_PADDING, sizeof(int32_t), at_end);
    memcpy(label, s->label, (size_t)s->n * sizeof(int32_t));
    memset(label + s->n, 0xff, HS_PADDING * sizeof(int32_t));
    scan.label = label;
    scan.hits = guarded_place(hits_pages, s->most_hits + HS_PADDING, sizeof(int32_t), at_end);
    scan.squares = guarded_place(squares_pages, s->most_hits + HS_PADDING, sizeof(float), at_end);
    scan.end = guarded_place(end_pages, s->n_points, sizeof(int32_t), at_end);
    scan.unsure = guarded_place(unsure_pages, s->most_unsure, sizeof(hs_unsure), at_end);
    return scan;
}

/* ---- scenes ---- */

/* As little room for hits and unsure ones as a scan may have, or more. */
static void
choose_room(harness_random *random, numbers *s)
{
    const unsigned hits = (unsigned)(MOST_HITS - s->n);
    const unsigned unsure = (unsigned)(HS_BLOCK_CANDIDATES - s->n);
    const bool     least = random_bits(random) % 2;
    s->most_hits = s->n + (least ? 0 : (int32_t)(random_bits(random) % (hits + 1)));
    s->most_unsure = s->n + (least ? 0 : (int32_t)(random_bits(random) % (unsure + 1)));
}

/* Small integers: all sums are exact however they are formed. */
static void
fill_with_integers(harness_random *random, int ndim, int32_t n, int32_t n_points, numbers *s)
{
    s->ndim = ndim;
    s->n = n;
    s->n_points = n_points;
    s->triangular = n >= n_points && random_bits(random) % 2;
    choose_room(random, s);
    for (int32_t c = 0; c < n; c++) {
        for (int k = 0; k < ndim; k++) {
            s->y[k][c] = (float)(random_bits(random) % 7) - 3.0f;
        }
        s->label[c] = (int32_t)(random_bits(random) >> 33);
    }
    for (int32_t t = 0; t < n_points; t++) {
        for (int k = 0; k < ndim; k++) {
            s->q[k][t] = (float)(random_bits(random) % 5) - 2.0f;
        }
    }
}

/* Forms with which thresholds of small integers are exact, fused or not. */
static const hs_limit_form exact_forms[] = {{1.0f, 0.0f, 1.0f, 0.0f},
                                            {1.0f, 1.0f, 1.0f, 1.0f},
                                            {0.5f, 0.5f, 2.0f, 0.25f},
                                            {1.0f, INFINITY, 1.0f, INFINITY}};

/* Small integers as radii, or none, of points or candidates, in a row or several; infinity, too, where
 * that is odd. */
static void
fill_radii(harness_random *random, bool odd, numbers *s)
{
    s->rule = (hs_rule)(random_bits(random) % HS_RULE_END);
    s->bound = random_bits(random) % 2 ? INFINITY : (float)(random_bits(random) % 5);
    s->form = exact_forms[random_bits(random) % (odd ? 4 : 3)];
    s->has_of_point = random_bits(random) % 8 != 0;
    s->has_of_block = random_bits(random) % 8 != 0;
    s->n_rows = random_bits(random) % 2 ? 0 : 1 + (int32_t)(random_bits(random) % MOST_ROWS);
    for (int32_t t = 0; t < s->n_points; t++) {
        s->of_point[t] = (float)(random_bits(random) % 5);
    }
    for (int32_t c = 0; c < s->n; c++) {
        s->of_block[c] = (float)(random_bits(random) % 4);
        if (odd && random_bits(random) % 8 == 0) {
            s->of_block[c] = INFINITY;
        }
    }
}

/* Whole numbers; with `odd`, some that are none. Those past the last candidate are NaN. */
static void
fill_supports(harness_random *random, bool odd, numbers *s)
{
    static const hs_rule rules[] = {HS_RULE_MAX, HS_RULE_MIN, HS_RULE_GATHER, HS_RULE_SCATTER};
    const int            n_entries = s->ndim <= HS_SUPPORT_DIM ? hs_support_entries(s->ndim) : 0;
    s->support_rule = rules[random_bits(random) % 4];
    for (int32_t t = 0; t < s->n_points; t++) {
        float *one = s->support_of_point + t * (n_entries + 1);
        for (int e = 0; e <= n_entries; e++) {
            one[e] = e < n_entries ? (float)(random_bits(random) % 5) - 2.0f
                                   : (float)(random_bits(random) % 12);
        }
    }
    for (int32_t c = 0; c < s->n + HS_PADDING; c++) {
        for (int e = 0; e <= n_entries; e++) {
            s->support_of_block[e][c] = c >= s->n       ? NAN
                                        : e < n_entries ? (float)(random_bits(random) % 5) - 2.0f
                                                        : (float)(random_bits(random) % 12);
        }
        if (odd && c < s->n && random_bits(random) % 8 == 0) {
            s->support_of_block[random_bits(random) % (uint64_t)(n_entries + 1)][c] =
                random_bits(random) % 2 ? INFINITY : NAN;
        }
    }
}

/* A scene of integers for every form of scans; `odd`: with infinity and NaN, here and there, and
 * thresholds that make nothing sure. */
static void
fill(harness_random *random, int ndim, int32_t n, int32_t n_points, bool odd, numbers *s)
{
    static const float         odds[] = {NAN, INFINITY, -INFINITY, 0x1p-149f, -0.0f};
    static const hs_thresholds limits[] = {
        {-1.0f, INFINITY}, {INFINITY, 4.0f}, {1.0f, 4.0f}, {-1.0f, -1.0f}, {-1.0f, 0.0f}};
    const float out = (float)(random_bits(random) % (8u * (unsigned)ndim));
    fill_with_integers(random, ndim, n, n_points, s);
    s->direct = (hs_thresholds){out - (float)(random_bits(random) % 4), out};
    fill_radii(random, odd, s);
    fill_supports(random, odd, s);
    if (!odd) {
        return;
    }
    for (int32_t c = 0; c < n; c++) {
        const int axis = (int)(random_bits(random) % (unsigned)ndim);
        if (random_bits(random) % 4 == 0) {
            s->y[axis][c] = odds[random_bits(random) % 5];
        }
    }
    s->q[0][0] = random_bits(random) % 5 == 0 ? odds[random_bits(random) % 4] : s->q[0][0];
    s->direct = limits[random_bits(random) % 5];
}

/* ---- the specification ---- */

/* s of candidate c and point t, rounded step by step in the order that kernel.h gives. */
static float
square_of(const numbers *s, int32_t t, int32_t c)
{
    volatile float sum = 0.0f;
    for (int k = 0; k < s->ndim; k++) {
        const volatile float along = s->y[k][c] - s->q[k][t];
        const volatile float square = along * along;
        sum = k == 0 ? square : sum + square;
    }
    return sum;
}

/* Those of one pair, each step rounded. */
static hs_thresholds
limit_thresholds_of(const numbers *s, int32_t t, int32_t c)
{
    const float    a = s->has_of_point ? s->of_point[t] : 0.0f;
    const float    b = s->has_of_block ? row_radius(s, row_of(s, t), c) : 0.0f;
    const float    larger = a > b ? a : b, smaller = a > b ? b : a;
    volatile float limit = s->rule == HS_RULE_MAX   ? larger
                           : s->rule == HS_RULE_MIN ? smaller
                                                    : a + b;
    limit = limit > s->bound ? s->bound : limit;
    volatile float in = limit * s->form.in_factor, out = limit * s->form.out_factor;
    in = in - s->form.in_less;
    out = out + s->form.out_more;
    const volatile float in_square = in > 0.0f ? in * in : 0.0f;
    const volatile float out_square = out > 0.0f ? out * out : 0.0f;
    return (hs_thresholds){in_square, out_square};
}

/* What a scan makes of one pair. */
typedef enum pair_verdict { PAIR_BEYOND, PAIR_UNSURE, PAIR_SURE } pair_verdict;

typedef pair_verdict (*pair_rule)(const numbers *s, int32_t t, int32_t c);

static pair_verdict
verdict_between(float square, hs_thresholds limits)
{
    return square > limits.out ? PAIR_BEYOND : square < limits.in ? PAIR_SURE : PAIR_UNSURE;
}

static pair_verdict
by_cutoff(const numbers *s, int32_t t, int32_t c)
{
    return verdict_between(square_of(s, t, c), s->direct);
}

static pair_verdict
by_limits(const numbers *s, int32_t t, int32_t c)
{
    return verdict_between(square_of(s, t, c), limit_thresholds_of(s, t, c));
}

/* Listed with their squares, and none is noted. */
static pair_verdict
by_squares(const numbers *s, int32_t t, int32_t c)
{
    return square_of(s, t, c) > s->direct.out ? PAIR_BEYOND : PAIR_SURE;
}

/* |N D|^2 against its thresholds: whether near, and whether sure. */
static void
meet(int ndim, const float *n, int64_t stride, const float *along, bool *near, bool *sure)
{
    const float size = n[hs_support_entries(ndim) * stride];
    float       s = 0.0f;
    for (int k = 0; k < ndim; k++) {
        float z = 0.0f;
        for (int l = 0; l < ndim; l++) {
            z += n[hs_support_at(k, l) * stride] * along[l];
        }
        s += z * z;
    }
    const float in = size < 1.0f ? 0.0f : size - 1.0f;
    const float out = size + 1.0f; /* NaN where a size is: no number is greater, or less */
    *near = !(s > out * out);
    *sure = s < in * in;
}

/* Also within the cutoff of the scene. */
static pair_verdict
by_supports(const numbers *s, int32_t t, int32_t c)
{
    float along[HS_SUPPORT_DIM], square = 0.0f;
    bool  own[2] = {false, false}, other[2] = {false, false};
    for (int k = 0; k < s->ndim; k++) {
        along[k] = s->y[k][c] - s->q[k][t];
        square += along[k] * along[k];
    }
    meet(s->ndim, s->support_of_point + t * hs_support_numbers(s->ndim), 1, along, &own[0],
         &own[1]);
    meet(s->ndim, s->support_of_block[0] + c, PITCH, along, &other[0], &other[1]);
    for (int v = 0; v < 2; v++) {
        switch (s->support_rule) {
        case HS_RULE_MAX: own[v] = own[v] || other[v]; break;
        case HS_RULE_MIN: own[v] = own[v] && other[v]; break;
        case HS_RULE_SCATTER: own[v] = other[v]; break;
        default: break;
        }
    }
    return !own[0] || square > s->direct.out ? PAIR_BEYOND
           : own[1] && square < s->direct.in ? PAIR_SURE
                                             : PAIR_UNSURE;
}

static const pair_rule rule_of[N_FORMS] = {
    [HS_SCAN_DIRECT] = by_cutoff,
    [HS_SCAN_LIMITS] = by_limits,
    [HS_SCAN_SUPPORTS] = by_supports,
    [HS_SCAN_SQUARES] = by_squares,
};

/* What points [first, next) must give, in arrays of the test. */
typedef struct expectation {
    int32_t   next;
    int64_t   n_hits;
    int32_t   n_unsure;
    int32_t   end[HS_GROUP_POINTS];
    int32_t   hits[MOST_HITS];
    hs_unsure unsure[HS_BLOCK_CANDIDATES];
} expectation;

static expectation expected;

static void
expect(const numbers *s, pair_rule rule, bool lists, int32_t first)
{
    int64_t n_hits = 0;
    int32_t n_unsure = 0, t = first;
    for (; t < s->n_points; t++) {
        if ((lists && n_hits + s->n > s->most_hits) || n_unsure + s->n > s->most_unsure) {
            break;
        }
        for (int32_t c = s->triangular ? t + 1 : 0; c < s->n; c++) {
            const pair_verdict verdict = rule(s, t, c);
            if (verdict == PAIR_UNSURE) {
                expected.unsure[n_unsure++] = (hs_unsure){t, c, (int32_t)n_hits};
            }
            if (verdict != PAIR_BEYOND && lists) {
                expected.hits[n_hits] = s->label[c];
            }
            n_hits += verdict != PAIR_BEYOND;
        }
        expected.end[t] = (int32_t)n_hits;
    }
    expected.next = t;
    expected.n_hits = n_hits;
    expected.n_unsure = n_unsure;
}

/* ---- comparisons ---- */

static bool
same_unsure(const hs_scan *scan, bool lists)
{
    bool same = scan->n_unsure == expected.n_unsure;
    for (int32_t u = 0; same && u < scan->n_unsure; u++) {
        const hs_unsure *a = &scan->unsure[u], *b = &expected.unsure[u];
        same = a->t == b->t && a->place == b->place && (!lists || a->at == b->at);
    }
    return same;
}

/* Counting leaves hits alone. */
static bool
untouched(const hs_scan *scan)
{
    bool same = true;
    for (int32_t h = 0; h < scan->most_hits + HS_PADDING; h++) {
        same = same && scan->hits[h] == -7;
    }
    return same;
}

static void
fill_with_sevens(const hs_scan *scan)
{
    for (int32_t h = 0; h < scan->most_hits + HS_PADDING; h++) {
        scan->hits[h] = -7;
    }
    for (int32_t t = 0; t < scan->n_points; t++) {
        scan->end[t] = -7;
    }
}

/* The square of each hit. */
static bool
same_squares(const hs_scan *scan, const numbers *s, int32_t first, int32_t next)
{
    bool same = true;
    for (int32_t t = first, h = 0; same && t < next; t++) {
        for (int32_t c = s->triangular ? t + 1 : 0; same && c < s->n; c++) {
            const float square = square_of(s, t, c);
            if (!(square > s->direct.out)) {
                same = isnan(square) ? isnan(scan->squares[h]) : scan->squares[h] == square;
                h++;
            }
        }
    }
    return same;
}

/* All points, however many calls that takes, exactly as the plain loop; returns the calls. */
static int
check_scan(const hs_kernel *kernel, hs_scan *scan, const numbers *s)
{
    const bool lists = !scan->counts;
    int        calls = 0;
    bool       same = true;
    for (int32_t first = 0, next; first < s->n_points && same; first = next) {
        fill_with_sevens(scan);
        expect(s, rule_of[scan->form], lists, first);
        next = kernel->scan(scan, first);
        calls++;
        same = next == expected.next && scan->n_hits == expected.n_hits && same_unsure(scan, lists);
        same = same && memcmp(scan->end + first, expected.end + first,
                              (size_t)(next - first) * sizeof(int32_t)) == 0;
        if (lists && same) {
            same = memcmp(scan->hits, expected.hits, (size_t)scan->n_hits * sizeof(int32_t)) == 0;
        } else if (same) {
            same = untouched(scan);
        }
        same = same && (scan->form != HS_SCAN_SQUARES || same_squares(scan, s, first, next));
        CHECK(same);
    }
    return calls;
}

/* Listing and counting, against the guard before and the one after. Only for numbers with which no
 * rounding can differ. */
static int
check_form(const hs_kernel *kernel, const numbers *s, hs_scan_form form)
{
    int calls = 0;
    for (int variant = 0; variant < 4; variant++) {
        const bool counts = variant & 1 && form != HS_SCAN_SQUARES;
        if (form != HS_SCAN_SUPPORTS || s->ndim <= HS_SUPPORT_DIM) {
            hs_scan scan = place_scan(s, form, counts, variant & 2);
            calls += check_scan(kernel, &scan, s);
        }
    }
    return calls;
}

/* ---- tests ---- */

static void
every_kernel_lists_what_the_plain_loop_lists(void)
{
    harness_random   random = {271828};
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int32_t n = 0; n <= SHORT_BLOCK; n++) {
            for (int trial = IS_SLOW ? n / 2 % 2 : 0; trial < 2 * HS_MAX_DIM;
                 trial += IS_SLOW ? 2 : 1) {
                const int ndim = 1 + trial % (n % 2 ? HS_SUPPORT_DIM : HS_MAX_DIM);
                fill(&random, ndim, n, 1 + (int32_t)(random_bits(&random) % 5), trial % 8 == 7,
                     &scene);
                for (int form = 0; form < N_FORMS; form++) {
                    (void)check_form(kernel, &scene, (hs_scan_form)form);
                }
            }
        }
    }
}

/* Blocks up to capacity, full groups, many hits or many unsure ones, ample room and little: a scan
 * then stops before they might not fit. */
static void
scans_stop_before_hits_might_not_fit(void)
{
    static const int32_t       sizes[] = {1,
                                          127,
                                          1000,
                                          MOST_HITS / 3 + 1, /* one too many */
                                          HS_BLOCK_CANDIDATES - 1,
                                          HS_BLOCK_CANDIDATES};
    static const hs_thresholds limits[] = {
        {100.0f, 100.0f}, {-1.0f, 100.0f}, {2.0f, 3.0f}, {-1.0f, 0.0f}};
    harness_random   random = {577215};
    const hs_kernel *kernel;
    for (int form = 0; form < N_FORMS; form++) {
        int most = 0, least = 1000;
        for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
            for (int trial = 0; trial < 24; trial++) {
                /* One of each d, and of each size but the last but one. */
                if (IS_SLOW && ((trial % 5 != 0 && trial != 7) || trial == 10)) {
                    continue;
                }
                const int32_t n = sizes[trial % 6];
                const int32_t n_points = n == 1 ? 1 : HS_GROUP_POINTS - trial % 3;
                fill(&random, 1 + trial % 3, n, n_points, false, &scene);
                if (form != HS_SCAN_SUPPORTS) {
                    scene.direct = limits[trial / 6];
                }
                scene.triangular = trial >= 12 && n >= n_points;
                if (trial / 3 % 2) {
                    scene.most_hits = MOST_HITS; /* what a large scene has */
                    scene.most_unsure = HS_BLOCK_CANDIDATES;
                }
                const int calls = check_form(kernel, &scene, (hs_scan_form)form);
                most = calls > most ? calls : most;
                least = calls < least ? calls : least;
            }
        }
        CHECK(least == 4); /* one call each */
        CHECK(most > HS_GROUP_POINTS);
    }
}

/* A NaN coordinate is a hit and unsure with every threshold. */
static void
a_nan_is_never_lost(void)
{
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int counts = 0; counts < 2; counts++) {
            for (int32_t place = 0; place < 40; place++) {
                harness_random random = {1 + (uint64_t)place};
                fill_with_integers(&random, 3, 40, 1, &scene);
                scene.triangular = false;
                scene.y[place % 3][place] = NAN;
                scene.direct = (hs_thresholds){-100.0f, -100.0f}; /* nothing else is near */
                hs_scan scan = place_scan(&scene, HS_SCAN_DIRECT, counts, true);
                CHECK(kernel->scan(&scan, 0) == 1);
                CHECK(scan.n_hits == 1 && scan.n_unsure == 1);
                CHECK(scan.unsure[0].t == 0 && scan.unsure[0].place == place);
            }
        }
    }
}

/* Any numbers, some near the cutoff: what is not fused is alike to the last bit. */
static void
every_kernel_rounds_the_same_way(void)
{
    harness_random   random = {161803};
    const hs_kernel *kernel;
    int              unsure = 0;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int trial = 0; trial < 1500; trial++) {
            const int     ndim = 1 + trial % HS_MAX_DIM;
            const int32_t n = (int32_t)(random_bits(&random) % (SHORT_BLOCK + 1));
            double        square = 0.0; /* of some pair */
            fill_with_integers(&random, ndim, n, 1, &scene);
            for (int a = 0; a < ndim; a++) {
                for (int32_t c = 0; c < n; c++) {
                    scene.y[a][c] += (float)random_unit(&random);
                }
                const double along = (double)scene.y[a][n / 2] - (double)scene.q[a][0];
                square += n > 0 ? along * along : 0.0;
            }
            scene.triangular = false;
            scene.direct = hs_thresholds_of(ndim, sqrt(square), 8.0, 0.0);
            (void)check_form(kernel, &scene, HS_SCAN_DIRECT);
            unsure += expected.n_unsure;
        }
    }
    CHECK(unsure > 1000);
}

/* Numbers of any kind, and radii of which some nearly touch. */
static void
fill_with_reals(harness_random *random, int ndim, int32_t n)
{
    fill_with_integers(random, ndim, n, 1, &scene);
    fill_radii(random, false, &scene);
    scene.triangular = false;
    scene.has_of_point = scene.has_of_block = true;
    scene.n_rows = 0;
    scene.bound = INFINITY;
    scene.form = hs_limit_form_of(ndim, 0.0, 0.0); /* these floats are the real numbers */
    scene.of_point[0] = (float)random_unit(random);
    for (int32_t c = 0; c < n; c++) {
        double square = 0.0;
        for (int k = 0; k < ndim; k++) {
            scene.y[k][c] += (float)random_unit(random);
            const double along = (double)scene.y[k][c] - (double)scene.q[k][0];
            square += along * along;
        }
        const double left = scene.rule == HS_RULE_MAX || scene.rule == HS_RULE_MIN
                                ? sqrt(square)
                                : sqrt(square) - (double)scene.of_point[0];
        scene.of_block[c] = c % 3 != 0 && left > 0.0 ? (float)left : (float)random_unit(random);
    }
}

/* |D|^2 over the square of the limit, less 1. */
static double
beyond_limit(int32_t c)
{
    const double a = (double)scene.of_point[0], b = (double)scene.of_block[c];
    const double limit = scene.rule == HS_RULE_MAX   ? fmax(a, b)
                         : scene.rule == HS_RULE_MIN ? fmin(a, b)
                                                     : a + b;
    double       square = 0.0;
    for (int k = 0; k < scene.ndim; k++) {
        const double along = (double)scene.y[k][c] - (double)scene.q[k][0];
        square += along * along;
    }
    return square / (limit * limit) - 1.0;
}

/* Whatever a kernel fuses: what it lists as sure is within the limit, and what it does not list is
 * beyond; what it cannot tell is near it. */
static void
kernels_are_right_about_any_numbers(void)
{
    harness_random   random = {264575};
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        int wrong = 0, unsure = 0, sure = 0;
        for (int trial = 0; trial < 3000; trial++) {
            fill_with_reals(&random, 1 + trial % HS_MAX_DIM,
                            (int32_t)(random_bits(&random) % (SHORT_BLOCK + 1)));
            hs_scan scan = place_scan(&scene, HS_SCAN_LIMITS, false, trial & 8);
            CHECK(kernel->scan(&scan, 0) == 1);
            for (int32_t c = 0, h = 0, u = 0; c < scene.n; c++) {
                const double beyond = beyond_limit(c);
                const bool   is_hit = h < scan.n_hits && scan.hits[h] == scene.label[c];
                const bool   is_unsure = is_hit && u < scan.n_unsure && scan.unsure[u].at == h;
                wrong += is_unsure ? fabs(beyond) > 1e-5
                         : is_hit  ? beyond > 1e-14
                                   : beyond < -1e-14;
                h += is_hit;
                u += is_unsure;
                unsure += is_unsure;
                sure += is_hit && !is_unsure;
            }
            hs_scan counted = place_scan(&scene, HS_SCAN_LIMITS, true, !(trial & 8));
            wrong += kernel->scan(&counted, 0) != 1 || counted.n_hits != scan.n_hits;
            wrong += counted.n_unsure != scan.n_unsure;
        }
        CHECK(wrong == 0 && unsure > 1000 && sure > 1000);
    }
}

static void
kernels_are_known_by_their_names(void)
{
    const char *names[MOST_KERNELS];
    const int   n = hs_kernel_names(names, MOST_KERNELS);
    CHECK(n >= 1 && n <= MOST_KERNELS);
    CHECK(hs_kernel_names(NULL, 0) == n);
    CHECK(hs_kernel_select(NULL) == hs_kernel_select(names[0]));
    CHECK(strcmp(names[n - 1], "scalar") == 0);
    for (int k = 0; k < n; k++) {
        CHECK(strcmp(hs_kernel_select(names[k])->name, names[k]) == 0);
    }
    CHECK(hs_kernel_select("") == NULL);
    CHECK(hs_kernel_select("Scalar") == NULL);
    hs_options      options = hs_options_default();
    const double    x = 0.0;
    const hs_points points = {.data = &x, .n = 1, .ndim = 1, .real = HS_FLOAT64};
    int64_t         count = -1;
    options.kernel = "abacus";
    CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &count, NULL) == HS_ERR_KERNEL);
    CHECK(count == -1);
}

void
test_kernels(void)
{
    guard_scans();
    RUN(every_kernel_lists_what_the_plain_loop_lists);
    RUN(scans_stop_before_hits_might_not_fit);
    RUN(a_nan_is_never_lost);
    RUN(every_kernel_rounds_the_same_way);
    RUN(kernels_are_right_about_any_numbers);
    RUN(kernels_are_known_by_their_names);
}
