/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * kernel_scalar.c: the kernels in plain C; the specification of the others.
 *
 * Scans take two short loops for each tile of candidates: the first tests, without branches or
 * stores at changing addresses, so that compilers vectorise it for whatever the baseline CPU has;
 * the second packs the labels. Measured: half the time of one loop that does both.
 */
#include "kernel.h"

#include <string.h>

/* Candidates tested before they are packed; their flags stay in the first-level cache. */
#define TILE 128

/* Whether a hit, and whether surely within. */
typedef struct scalar_verdict {
    int32_t near, sure;
} scalar_verdict;

/* The support of a point, if the rule looks at it. */
typedef struct scalar_own {
    const float  *numbers;
    hs_thresholds thresholds;
} scalar_own;

/* What depends on the point that is compared. */
typedef struct scalar_scan {
    float         centre[HS_MAX_DIM];
    hs_thresholds thresholds;
    float         radius; /* for limits: of the point ... */
    const float  *others; /* ... and of the candidates */
    scalar_own    own;    /* its support */
} scalar_scan;

HS_ALWAYS_INLINE scalar_scan
set_point(const hs_scan *scan, int32_t t, const int ndim, const hs_scan_form form)
{
    scalar_scan v = {.centre = {0.0f}};
    for (int k = 0; k < ndim; k++) {
        v.centre[k] = scan->q[k][t];
    }
    v.thresholds = scan->direct;
    if (form == HS_SCAN_LIMITS) {
        v.radius = scan->limits.of_point != NULL ? scan->limits.of_point[t] : 0.0f;
        v.others = hs_limit_row(&scan->limits, t);
    }
    if (form == HS_SCAN_SUPPORTS && hs_rule_needs_asking(scan->supports.rule)) {
        v.own.numbers = scan->supports.of_point + (int64_t)t * hs_support_numbers(ndim);
        v.own.thresholds =
            hs_support_thresholds(scan->supports.form, v.own.numbers[hs_support_entries(ndim)]);
    }
    return v;
}

/* s of candidate c. */
HS_ALWAYS_INLINE float
square(const float *const *y, const float *centre, int32_t c, const int ndim)
{
    float s = 0.0f;
    for (int k = 0; k < ndim; k++) {
        const float along = y[k][c] - centre[k];
        s = k == 0 ? along * along : s + along * along;
    }
    return s;
}

/* The thresholds of candidate c, for HS_SCAN_LIMITS. */
HS_ALWAYS_INLINE hs_thresholds
thresholds_of(const hs_scan *scan, const scalar_scan *v, int32_t c)
{
    return hs_limit_thresholds(&scan->limits, v->radius, v->others != NULL ? v->others[c] : 0.0f);
}

/* |N along|^2 against its thresholds. stride: from one entry of N to the next. */
HS_ALWAYS_INLINE scalar_verdict
meet_support(const float *entries, int64_t stride, hs_thresholds thresholds, const float *along,
             const int ndim)
{
    float s = 0.0f;
    for (int k = 0; k < ndim; k++) {
        float z = entries[hs_support_at(k, 0) * stride] * along[0];
        for (int l = 1; l < ndim; l++) {
            z = z + entries[hs_support_at(k, l) * stride] * along[l];
        }
        s = k == 0 ? z * z : s + z * z;
    }
    return (scalar_verdict){!(s > thresholds.out), s < thresholds.in};
}

/* Candidate c and the point at `centre`, by the cutoff and by both supports, as the rule
 * says. */
HS_ALWAYS_INLINE scalar_verdict
meet_supports(const hs_scan *scan, const float *centre, const scalar_own *own, int32_t c,
              const int ndim)
{
    const hs_support_scan *supports = &scan->supports;
    scalar_verdict         one = {0, 0}, other = {0, 0};
    float                  along[HS_SUPPORT_DIM], s = 0.0f;
    for (int k = 0; k < ndim; k++) {
        along[k] = scan->y[k][c] - centre[k];
        s = k == 0 ? along[k] * along[k] : s + along[k] * along[k];
    }
    const int32_t near = !(s > scan->direct.out), sure = s < scan->direct.in;
    if (hs_rule_needs_asking(supports->rule)) {
        one = meet_support(own->numbers, 1, own->thresholds, along, ndim);
    }
    if (hs_rule_needs_other(supports->rule)) {
        const float *numbers = supports->of_block + c;
        const float  size = numbers[hs_support_entries(ndim) * supports->pitch];
        other = meet_support(numbers, supports->pitch, hs_support_thresholds(supports->form, size),
                             along, ndim);
    }
    return supports->rule == HS_RULE_MIN
               ? (scalar_verdict){near & one.near & other.near, sure & one.sure & other.sure}
               : (scalar_verdict){near & (one.near | other.near), sure & (one.sure | other.sure)};
}

/* Tests n candidates from `begin` on: near[c] is 1 for hits, else 0; squares to s, of
 * HS_SCAN_SQUARES alone. Returns if any is unsure. */
HS_ALWAYS_INLINE bool
test_chunk(const hs_scan *scan, const scalar_scan *v, int32_t begin, int32_t n, const int ndim,
           const hs_scan_form form, int32_t *HS_RESTRICT near, float *HS_RESTRICT s)
{
    float        in = v->thresholds.in, out = v->thresholds.out;
    const float *y[HS_MAX_DIM];
    float        centre[HS_MAX_DIM];
    int32_t      unsure = 0;
    for (int k = 0; k < ndim; k++) {
        y[k] = scan->y[k] + begin;
        centre[k] = v->centre[k];
    }
    for (int32_t c = 0; c < n; c++) {
        if (form == HS_SCAN_SUPPORTS) {
            const scalar_verdict found = meet_supports(scan, v->centre, &v->own, begin + c, ndim);
            near[c] = found.near;
            unsure |= found.near & !found.sure;
            continue;
        }
        const float sum = square(y, centre, c, ndim);
        if (form == HS_SCAN_LIMITS) {
            const hs_thresholds own = thresholds_of(scan, v, begin + c);
            in = own.in;
            out = own.out;
        }
        near[c] = !(sum > out);
        if (form == HS_SCAN_SQUARES) {
            s[c] = sum;
        } else {
            unsure |= near[c] & !(sum < in);
        }
    }
    return unsure != 0;
}

/* Notes the unsure ones of a tile, by computing its sums again. */
HS_ALWAYS_INLINE void
note_unsure(hs_scan *scan, const scalar_scan *v, int32_t t, int32_t begin, int32_t n,
            const int ndim, const hs_scan_form form, const int32_t *near, int32_t at)
{
    for (int32_t c = begin; c < begin + n; c++) {
        bool is_sure;
        if (form == HS_SCAN_SUPPORTS) {
            is_sure = meet_supports(scan, v->centre, &v->own, c, ndim).sure;
        } else {
            const float in = form == HS_SCAN_LIMITS ? thresholds_of(scan, v, c).in
                                                    : v->thresholds.in;
            is_sure = square(scan->y, v->centre, c, ndim) < in;
        }
        if (near[c - begin] && !is_sure) {
            scan->unsure[scan->n_unsure++] = (hs_unsure){t, c, at};
        }
        at += near[c - begin];
    }
}

HS_ALWAYS_INLINE int32_t
scan_points(hs_scan *scan, int32_t first, const int ndim, const hs_scan_form form, const bool lists)
{
    float   s[TILE];
    int32_t near[TILE];
    int32_t t = first, n_listed = 0;
    int64_t count = 0;
    scan->n_unsure = 0;
    for (; t < scan->n_points; t++) {
        if ((lists && n_listed + scan->n > scan->most_hits) ||
            scan->n_unsure + scan->n > scan->most_unsure) {
            break;
        }
        const scalar_scan v = set_point(scan, t, ndim, form);
        for (int32_t begin = scan->triangular ? t + 1 : 0; begin < scan->n; begin += TILE) {
            const int32_t left = scan->n - begin, n = left < TILE ? left : TILE;
            if (test_chunk(scan, &v, begin, n, ndim, form, near, s)) {
                note_unsure(scan, &v, t, begin, n, ndim, form, near, n_listed);
            }
            for (int32_t c = 0; lists && c < n; c++) {
                if (form == HS_SCAN_SQUARES) {
                    scan->squares[n_listed] = s[c];
                }
                scan->hits[n_listed] = scan->label[begin + c];
                n_listed += near[c];
            }
            for (int32_t c = 0; !lists && c < n; c++) {
                count += near[c];
            }
        }
        scan->end[t] = (int32_t)(lists ? n_listed : count);
    }
    scan->n_hits = lists ? n_listed : count;
    return t;
}

#include "scan_forms.h"

/* Appends n points from number si on, all of them. */
static void
gather_points(const hs_gather *gather, const hs_run *run, int32_t at, int32_t n)
{
    const int32_t *HS_RESTRICT order = gather->order + run->si;
    int32_t *HS_RESTRICT       id = gather->id + at;
    int32_t *HS_RESTRICT       number = gather->number + at;
    for (int k = 0; k < gather->ndim; k++) {
        const double *HS_RESTRICT x = gather->x[k] + run->si;
        float *HS_RESTRICT        y = gather->y[k] + at;
        const double              moved = run->moved[k];
        for (int32_t c = 0; c < n; c++) {
            y[c] = (float)(x[c] + moved);
        }
    }
    for (int32_t c = 0; c < n; c++) {
        id[c] = order[c];
        number[c] = run->si + c;
    }
}

/* Of n candidates from `at` on, those that are not surely far from the box, packed; returns how
 * many. */
static int32_t
keep_near(const hs_gather *gather, int32_t at, int32_t n)
{
    const hs_nearest_box *box = &gather->near;
    int32_t               to = at;
    for (int32_t c = at; c < at + n; c++) {
        float s = 0.0f;
        for (int k = 0; k < gather->ndim; k++) {
            const float y = gather->y[k][c], below = box->low[k] - y, above = y - box->high[k];
            const float most = below > above ? below : above;
            const float gap = most <= 0.0f ? 0.0f : most; /* NaN is kept */
            s = s + gap * gap;
            gather->y[k][to] = y;
        }
        gather->id[to] = gather->id[c];
        gather->number[to] = gather->number[c];
        to += !(s > box->out);
    }
    return to - at;
}

static void
gather(hs_gather *gather, hs_run *runs, int32_t n_runs)
{
    const int32_t first = gather->n;
    int32_t       largest = (int32_t)gather->largest; /* signed: SSE2 compares no others */
    for (int32_t r = 0, from = runs[0].at; r < n_runs; r++) {
        const int32_t n = runs[r + 1].at - from;
        from = runs[r + 1].at;
        runs[r].at = gather->n;
        gather_points(gather, &runs[r], gather->n, n);
        gather->n += gather->near.out < INFINITY ? keep_near(gather, gather->n, n) : n;
    }
    for (int k = 0; k < gather->ndim; k++) {
        for (int32_t c = first; c < gather->n; c++) {
            const int32_t bits =
                (int32_t)(hs_bits_of_float(gather->y[k][c]) & UINT32_C(0x7fffffff));
            largest = bits > largest ? bits : largest;
        }
    }
    gather->largest = (uint32_t)largest;
}

/* Entry h of an array of int64_t or int32_t. */
HS_ALWAYS_INLINE void
put(void *array, int32_t h, int32_t value, const bool wide)
{
    if (wide) {
        ((int64_t *)array)[h] = value;
    } else {
        ((int32_t *)array)[h] = value;
    }
}

HS_ALWAYS_INLINE void
emit_columns(const hs_hits *hits, void *i, void *j, const bool wide)
{
    const int32_t *label = hits->label;
    int32_t        begin = 0;
    for (int32_t t = 0; t < hits->n; t++) {
        const int32_t point = hits->point[t], end = hits->end[t];
        for (int32_t h = begin; i != NULL && h < end; h++) {
            put(i, h, label[h] < point ? label[h] : point, wide);
        }
        for (int32_t h = begin; j != NULL && h < end; h++) {
            put(j, h, label[h] < point ? point : label[h], wide);
        }
        begin = end;
    }
}

static void
emit(const hs_hits *hits, int index_bytes, void *i, void *j)
{
    if (index_bytes == 8) {
        emit_columns(hits, i, j, true);
    } else {
        emit_columns(hits, i, j, false);
    }
}

static void
gather_relative(const hs_relative_keys *keys, const hs_nearest_run *runs, int32_t n_runs)
{
    const float extent = (float)keys->extent;
    for (int32_t r = 0; r < n_runs; r++) {
        const hs_nearest_run *run = &runs[r];
        int32_t *HS_RESTRICT  number = keys->number + run->at;
        for (int k = 0; k < keys->ndim; k++) {
            const double *HS_RESTRICT x = keys->x[k] + run->si;
            float *HS_RESTRICT        y = keys->y[k] + run->at;
            const double              moved = keys->images[run->image].moved[k];
            for (int32_t c = 0; c < run->n; c++) {
                const float place = (float)((x[c] + moved - keys->centre[k]) * keys->unit);
                y[c] = place > extent ? extent : place < -extent ? -extent : place;
            }
        }
        for (int32_t c = 0; c < run->n; c++) {
            number[c] = run->si + c;
        }
    }
}

static void
order(const float *squares, int32_t n, int32_t *keys)
{
    int32_t own[HS_ORDER_MOST];
    memcpy(own, squares, (size_t)n * sizeof *own);
    for (int32_t e = 0; e < n; e++) {
        own[e] = (own[e] & ~(HS_ORDER_MOST - 1)) | e;
    }
    for (int32_t e = 0; e < n; e++) {
        int32_t smaller = 0;
        for (int32_t f = 0; f < n; f++) {
            smaller += own[f] < own[e];
        }
        keys[smaller] = own[e];
    }
}

static int32_t
near_boxes(const hs_boxes *boxes)
{
    int32_t at = 0;
    for (int32_t c = 0; c < boxes->n; c++) {
        float s = 0.0f;
        for (int k = 0; k < boxes->ndim; k++) {
            const float below = boxes->low[k][c] - boxes->to[k];
            const float above = boxes->from[k] - boxes->high[k][c];
            const float most = below > above ? below : above;
            const float gap = most > 0.0f ? most : 0.0f;
            s = s + gap * gap;
        }
        boxes->hits[at] = boxes->label[c];
        at += !(s > boxes->out);
    }
    return at;
}

static bool
supported(void)
{
    return hs_rounds_products();
}

const hs_kernel hs_kernel_scalar = {
    .name = "scalar",
    .supported = supported,
    HS_KERNEL_LOOPS,
    .recheck = hs_recheck_baseline,
    .decide_batch = hs_decide_batch_baseline,
    .measure = hs_measure_baseline,
};
