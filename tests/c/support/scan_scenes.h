/* SPDX-License-Identifier: BSD-3-Clause */
/* scan_scenes.h: the numbers of a scan, and the scan itself, with its arrays against guard pages. */
#ifndef HS_SCAN_SCENES_H
#define HS_SCAN_SCENES_H

#include <math.h>

#include "kernel_checks.h"

enum {
    MOST_HITS = 2 * HS_BLOCK_CANDIDATES, /* of a scan here */
    MOST_ROWS = 3                        /* of radii */
};

/* A scan with its arrays, owned by this file and reused. */
static guarded y_pages[HS_MAX_DIM], norm_pages, label_pages, q_pages[HS_MAX_DIM];
static guarded hits_pages, squares_pages, end_pages, unsure_pages;
static guarded point_radius_pages, block_radius_pages, row_pages;

static inline void
guard_scans(void)
{
    const size_t candidates = (HS_BLOCK_CANDIDATES + HS_PADDING) * sizeof(float);
    for (int k = 0; k < HS_MAX_DIM; k++) {
        y_pages[k] = guarded_pages(candidates);
        q_pages[k] = guarded_pages(HS_GROUP_POINTS * sizeof(float));
    }
    norm_pages = guarded_pages(candidates);
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
    float         norm[HS_BLOCK_CANDIDATES];
    int32_t       label[HS_BLOCK_CANDIDATES];
    float         q[HS_MAX_DIM][HS_GROUP_POINTS];
    hs_thresholds direct;
    hs_expanded   expanded;
    hs_rule       rule;
    float         bound;
    hs_limit_form form;
    bool          has_of_point, has_of_block; /* else NULL */
    float         of_point[HS_GROUP_POINTS], of_block[HS_BLOCK_CANDIDATES];
    int32_t       n_rows; /* of radii of the block; 0: one for all points */
} numbers;

/* The radius of candidate c in this row: some are negative in a row that is one of several. */
static inline float
row_radius(const numbers *s, int32_t row, int32_t c)
{
    return s->n_rows > 0 && (c + row) % 5 == 0 ? -1.0f : s->of_block[(c + 7 * row) % s->n];
}

static inline int32_t
row_of(const numbers *s, int32_t t)
{
    return s->n_rows > 0 ? t * 5 % s->n_rows : 0;
}

/* What lies past the last candidate must never be listed, whatever it is. */
static inline void
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
static inline void
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

static inline hs_scan
place_scan(const numbers *s, bool at_end)
{
    hs_scan scan = {.ndim = s->ndim,
                    .n = s->n,
                    .n_points = s->n_points,
                    .most_hits = s->most_hits,
                    .most_unsure = s->most_unsure,
                    .triangular = s->triangular,
                    .direct = s->direct,
                    .expanded = s->expanded,
                    .n_unsure = -1,
                    .n_hits = -1};
    for (int k = 0; k < s->ndim; k++) {
        float *q = guarded_place(q_pages[k], s->n_points, sizeof(float), at_end);
        memcpy(q, s->q[k], (size_t)s->n_points * sizeof(float));
        scan.q[k] = q;
        place_floats(y_pages[k], s->y[k], s->n, at_end, &scan.y[k]);
    }
    place_floats(norm_pages, s->norm, s->n, at_end, &scan.norm);
    place_limits(s, at_end, &scan.limits);
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

/* As little room for hits and unsure ones as a scan may have, or more. */
static inline void
choose_room(harness_random *random, numbers *s)
{
    const unsigned hits = (unsigned)(MOST_HITS - s->n);
    const unsigned unsure = (unsigned)(HS_BLOCK_CANDIDATES - s->n);
    const bool     least = random_bits(random) % 2;
    s->most_hits = s->n + (least ? 0 : (int32_t)(random_bits(random) % (hits + 1)));
    s->most_unsure = s->n + (least ? 0 : (int32_t)(random_bits(random) % (unsure + 1)));
}

/* Small integers: all sums are exact however they are formed. */
static inline void
fill_with_integers(harness_random *random, int ndim, int32_t n, int32_t n_points, numbers *s)
{
    s->ndim = ndim;
    s->n = n;
    s->n_points = n_points;
    s->triangular = n >= n_points && random_bits(random) % 2;
    choose_room(random, s);
    for (int32_t c = 0; c < n; c++) {
        s->norm[c] = 0.0f;
        for (int k = 0; k < ndim; k++) {
            s->y[k][c] = (float)(random_bits(random) % 7) - 3.0f;
            s->norm[c] += s->y[k][c] * s->y[k][c];
        }
        s->label[c] = (int32_t)(random_bits(random) >> 33);
    }
    for (int32_t t = 0; t < n_points; t++) {
        for (int k = 0; k < ndim; k++) {
            s->q[k][t] = (float)(random_bits(random) % 5) - 2.0f;
        }
    }
}

/* The same thresholds for both forms, on numbers that occur. */
static inline void
set_limits(numbers *s, float in, float out)
{
    s->direct = (hs_thresholds){in, out};
    s->expanded = (hs_expanded){(double)in, (double)out};
}

#endif
