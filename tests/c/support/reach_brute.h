/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * reach_brute.h: scenes in which each pair has a reach of its own, and all their pairs the plain
 * way: each image of each two points, against the real sum of their radii as an integer.
 */
#ifndef HS_REACH_BRUTE_H
#define HS_REACH_BRUTE_H

#include "pair_checks.h"
#include "random_scenes.h"

enum { REACH_TYPES = 4, REACH_STYLES = 5 };

typedef struct reach_scene {
    random_scene of; /* the points, and behind them the queries */
    int64_t      n, n_queries;
    bool         has_queries;
    double       radii[SCENE_POINTS];
    int32_t      types[SCENE_POINTS];
    double       table[REACH_TYPES * REACH_TYPES];
    double       bound;
    hs_reach     reach; /* points to the rest, as these do */
    hs_points    points, queries;
    hs_among     among;
} reach_scene;

/* Which pairs are sought. */
typedef enum reach_list { REACH_HALF, REACH_ROWS } reach_list;

/* 0: quarters; 1: tenths, whose sums are no float64s; 2: of many orders; 3: all one; 4: what the
 * distance to another point leaves, so that the two just touch, or just do not. */
static inline double
reach_radius(harness_random *random, int style, int64_t i, const reach_scene *s)
{
    const int64_t other = random_below(random, (int)(s->n + s->n_queries));
    const int     d = s->of.scene.ndim;
    double        square = 0.0;
    switch (style) {
    case 0: return 0.25 * random_below(random, 6);
    case 1: return 0.1 * random_below(random, 12);
    case 2: return ldexp(1.2 * random_unit(random), -random_below(random, 14));
    case 3: return 0.7;
    }
    for (int k = 0; k < d; k++) {
        const double along = s->of.x[i * d + k] - s->of.x[other * d + k];
        square += along * along;
    }
    const double left = sqrt(square) - (other < i ? s->radii[other] : 0.0);
    return left >= 0.0 && left < 2.0 ? left : 0.3;
}

static inline void
reach_connect(hs_rule rule, bool has_types, reach_scene *s)
{
    const ptrdiff_t row = s->of.scene.ndim * (ptrdiff_t)sizeof(double);
    s->reach = has_types
                   ? (hs_reach){.rule = rule,
                                .n_types = REACH_TYPES,
                                .types = s->types,
                                .query_types = s->types + s->n,
                                .cutoffs = s->table}
                   : (hs_reach){.rule = rule, .radii = s->radii, .query_radii = s->radii + s->n};
    s->points = (hs_points){s->of.x, s->n, s->of.scene.ndim, HS_FLOAT64, row, sizeof(double)};
    s->queries = s->points;
    s->queries.data = s->of.x + s->n * s->of.scene.ndim;
    s->queries.n = s->n_queries;
    s->among = (hs_among){.points = &s->points,
                          .box = s->of.scene.box,
                          .queries = s->has_queries ? &s->queries : NULL,
                          .reach = &s->reach};
}

/* n_queries: -1 for none. The rule HS_RULE_END: types. Everything times 2^exponent. */
static inline void
reach_make(harness_random *random, scene_kind kind, int ndim, int n, int n_queries, hs_rule rule,
           int exponent, reach_scene *s)
{
    const int    style = random_below(random, REACH_STYLES);
    const bool   has_types = rule == HS_RULE_END;
    const double size = ndim <= 2 ? 1.0 : ndim == 3 ? 0.7 : 0.4;
    s->has_queries = n_queries >= 0;
    s->n = n;
    s->n_queries = s->has_queries ? n_queries : 0;
    make_scene(random, kind, ndim, n + (int)s->n_queries, 4.0, exponent, &s->of);
    for (int e = 0; e < (n + s->n_queries) * ndim; e++)
        s->of.x[e] = ldexp(s->of.x[e], -exponent);
    for (int64_t i = 0; i < n + s->n_queries; i++) {
        s->radii[i] = reach_radius(random, style, i, s) * (style == 4 ? 1.0 : size);
        s->types[i] = random_below(random, REACH_TYPES);
    }
    for (int64_t i = 0; i < n + s->n_queries; i++)
        s->radii[i] = ldexp(s->radii[i], exponent);
    for (int e = 0; e < (n + s->n_queries) * ndim; e++)
        s->of.x[e] = ldexp(s->of.x[e], exponent);
    for (int a = 0; a < REACH_TYPES; a++) {
        for (int b = 0; b <= a; b++) {
            const double cutoff = random_below(random, 5) ? size * 2.0 * random_unit(random) : -0.5;
            const double kept = random_below(random, 3) ? cutoff : 0.25 * random_below(random, 8);
            s->table[a * REACH_TYPES + b] = s->table[b * REACH_TYPES + a] = ldexp(kept, exponent);
        }
    }
    s->bound = has_types ? 0x1p1000 : random_below(random, 3) ? HUGE_VAL : ldexp(0.75, exponent);
    reach_connect(has_types ? HS_RULE_SUM : rule, has_types, s);
}

static inline hs_options
reach_options(const reach_scene *s)
{
    hs_options options = options_of(&s->of.scene);
    options.cutoff = s->bound;
    return options;
}

/* Two numbers whose real sum is what asking point i and point j are compared with; false: no pair. */
TRUTH bool
reach_limit(const reach_scene *s, int64_t i, int64_t j, double limit[2])
{
    const int64_t asking = s->has_queries ? s->n + i : i;
    const double  a = s->radii[asking], b = s->radii[j];
    limit[1] = 0.0;
    if (s->reach.n_types > 0) {
        limit[0] = s->table[s->types[asking] * REACH_TYPES + s->types[j]];
        limit[0] = limit[0] > s->bound ? s->bound : limit[0];
        return limit[0] >= 0.0;
    }
    switch (s->reach.rule) {
    case HS_RULE_SUM: limit[0] = a, limit[1] = b; break;
    case HS_RULE_MEAN: limit[0] = 0.5 * a, limit[1] = 0.5 * b; break;
    case HS_RULE_MAX: limit[0] = a > b ? a : b; break;
    case HS_RULE_MIN: limit[0] = a < b ? a : b; break;
    case HS_RULE_GATHER: limit[0] = a; break;
    default: limit[0] = b;
    }
    if (s->bound < HUGE_VAL &&
        big_compare(big_sum(big_from_double(limit[0]), big_from_double(limit[1])),
                    big_from_double(s->bound)) > 0) {
        limit[0] = s->bound;
        limit[1] = 0.0;
    }
    return true;
}

/* What brute_force.h and pair_checks.h need to know of one pair: hi, rounded to nearest, or just
 * above the limit. */
TRUTH brute_scene
reach_scene_of_pair(const reach_scene *s, const double limit[2], bool above)
{
    brute_scene  pair = s->of.scene;
    const double sum = limit[0] + limit[1];
    const big rest = big_difference(big_sum(big_from_double(limit[0]), big_from_double(limit[1])),
                                    big_from_double(sum));
    pair.n = s->n + s->n_queries;
    pair.cutoff = above ? nextafter(sum, HUGE_VAL) : sum;
    pair.inclusive = s->of.scene.inclusive || rest.sign > 0;
    return pair;
}

TRUTH bool
reach_is_within(const reach_scene *s, const brute_rows *r, const double limit[2], const double *p,
                const double *q, const int64_t *shift)
{
    const brute_scene *scene = &s->of.scene;
    const big          sum = big_sum(big_from_double(limit[0]), big_from_double(limit[1]));
    const big square = big_square(scene->ndim, r->m, (const double(*)[8])r->rows, p, q, shift);
    const int sign = big_compare(square, big_product(sum, sum));
    return sign < 0 || (sign == 0 && scene->inclusive);
}

/* Whether the list has this pair, if it is within. */
TRUTH bool
reach_has(const reach_scene *s, reach_list kind, int64_t i, int64_t j, int m, const int64_t *shift)
{
    bool is_home = true;
    for (int l = 0; l < m; l++)
        is_home = is_home && shift[l] == 0;
    if (kind == REACH_HALF && !s->has_queries)
        return brute_is_forward((int32_t)i, (int32_t)j, m, shift);
    return s->has_queries || i != j || !is_home;
}

TRUTH void
reach_images(const reach_scene *s, reach_list kind, const brute_rows *r, int64_t i, int64_t j,
             brute_list *list)
{
    const int     d = s->of.scene.ndim;
    const double *p = s->of.x + ((s->has_queries ? s->n : 0) + i) * d, *q = s->of.x + j * d;
    int64_t       low[HS_MAX_DIM] = {0}, high[HS_MAX_DIM] = {0}, shift[HS_MAX_DIM];
    double        limit[2], images;
    if (!reach_limit(s, i, j, limit))
        return;
    const brute_scene pair = reach_scene_of_pair(s, limit, true);
    CHECK(brute_range(&pair, r, p, q, low, high, &images));
    memcpy(shift, low, sizeof shift);
    for (bool more = images > 0.0; more;) {
        if (reach_has(s, kind, i, j, r->m, shift) && reach_is_within(s, r, limit, p, q, shift))
            brute_add(list, r, (int32_t)i, (int32_t)j, shift);
        int l = r->m - 1;
        while (l >= 0 && shift[l] == high[l]) {
            shift[l] = low[l];
            l--;
        }
        more = l >= 0;
        shift[more ? l : 0] += more;
    }
}

/* All pairs, ascending. */
TRUTH void
reach_find(const reach_scene *s, reach_list kind, brute_list *list)
{
    brute_rows    r;
    const int64_t n_asking = s->has_queries ? s->n_queries : s->n;
    memset(list, 0, sizeof *list);
    CHECK(brute_prepare(&s->of.scene, &r));
    for (int64_t i = 0; i < n_asking; i++) {
        for (int64_t j = 0; j < s->n; j++)
            reach_images(s, kind, &r, i, j, list);
    }
    if (list->n > 1)
        qsort(list->pairs, (size_t)list->n, sizeof *list->pairs, brute_order);
}

/* Whether found pairs are these, in this order, with distances and vectors that are right. */
static inline bool
reach_matches(const reach_scene *s, const hs_pairs *found, const brute_list *expected)
{
    const int64_t *i = hs_pairs_array(found, HS_WANT_I), *j = hs_pairs_array(found, HS_WANT_J);
    const int32_t *shift = hs_pairs_array(found, HS_WANT_SHIFT);
    const double  *distance = hs_pairs_array(found, HS_WANT_DISTANCE);
    const double  *vector = hs_pairs_array(found, HS_WANT_VECTOR);
    const int      d = s->of.scene.ndim;
    brute_rows     r;
    bool           right = hs_pairs_length(found) == expected->n;
    (void)brute_prepare(&s->of.scene, &r);
    for (int64_t e = 0; right && e < expected->n; e++) {
        brute_pair pair = expected->pairs[e];
        double     limit[2];
        right = i[e] == pair.i && j[e] == pair.j && reach_limit(s, pair.i, pair.j, limit);
        for (int k = 0; right && k < d; k++)
            right = shift[e * d + k] == pair.shift[k];
        if (right && (e < 20 || e % 5 == 0)) {
            const brute_scene of_pair = reach_scene_of_pair(s, limit, false);
            pair.i += s->has_queries ? (int32_t)s->n : 0;
            right = measures_are_right(&of_pair, &r, &pair, distance[e], vector + e * d);
        }
    }
    return right;
}

#endif
