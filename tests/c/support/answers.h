/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * answers.h: what each kind of search says of one scene, against the brute force's pairs and what
 * follows from them: rows, the nearest, histograms, shells, clusters, streams, systems, reaches,
 * selections, cells, lists and measures.
 */
#ifndef HS_ANSWERS_H
#define HS_ANSWERS_H

#include "../../../csrc/core/levels/levels.h"
#include "pair_checks.h"

#include <stdio.h>

enum { ANSWER_POINTS = 400, ANSWER_TYPES = 3, ANSWER_EDGES = 12, ANSWER_EXCLUDED = 40 };

/* A scene, its pairs, and what is chosen for it by `salt`. */
typedef struct asked {
    const brute_scene *scene;
    const brute_list  *half; /* ascending */
    brute_list         both; /* each pair both ways, ascending */
    brute_rows         rows;
    uint64_t           salt;
    int64_t            stride, split; /* every such pair is measured; points before it ask others */
    int64_t            n;             /* points */
    int                d;
    hs_points          points, first, rest; /* all, those before `split`, and the others */
    hs_options         options;
    hs_reach           reach;
    hs_selection       selection;
    int                quarters; /* radii count so many quarters */
    int                n_edges;
    double             edges[ANSWER_EDGES];
    double             radii[ANSWER_POINTS], weights[ANSWER_POINTS], ellipsoids[ANSWER_POINTS * 9];
    double             table[ANSWER_TYPES * ANSWER_TYPES];
    int32_t            types[ANSWER_POINTS];
    int64_t            labels[ANSWER_POINTS], groups[ANSWER_POINTS], excluded[2 * ANSWER_EXCLUDED];
} asked;

static hs_counters answer_counters; /* of the last search of a check */

typedef bool (*kept_fn)(const asked *a, const brute_pair *pair);

static inline uint64_t
chosen(asked *a, uint64_t below)
{
    a->salt = (a->salt ^ a->salt >> 29) * UINT64_C(0xbf58476d1ce4e5b9) + 1;
    return (a->salt >> 33) % below;
}

TRUTH const double *
at_point(const asked *a, int32_t i)
{
    return a->scene->x + (int64_t)i * a->d;
}

TRUTH void
shift_of_rows(const asked *a, const brute_pair *pair, int64_t *shift)
{
    for (int l = 0; l < a->rows.m; l++)
        shift[l] = pair->shift[a->rows.axis[l]];
}

TRUTH big
square_of(const asked *a, const brute_pair *pair)
{
    int64_t shift[HS_MAX_DIM];
    shift_of_rows(a, pair, shift);
    return big_square(a->d, a->rows.m, (const double(*)[8])a->rows.rows, at_point(a, pair->i),
                      at_point(a, pair->j), shift);
}

/* Whether a square is that of no more, or of less, than the limit. */
TRUTH bool
is_within(big square, big limit, bool inclusive)
{
    const int sign = big_compare(square, big_product(limit, limit));
    return sign < 0 || (inclusive && sign == 0);
}

/* Whether `times` |D| is less than r + s, or as much; in plain numbers where these can tell. */
TRUTH bool
is_within_sum(const asked *a, const brute_pair *pair, int times, double r, double s, bool inclusive)
{
    const double     *p = at_point(a, pair->i), *q = at_point(a, pair->j);
    const long double limit = ((long double)r + s) * ((long double)r + s);
    long double       square = 0.0L, sizes = limit;
    for (int k = 0; k < a->d; k++) {
        long double along = (long double)q[k] - p[k], size = fabsl((long double)q[k]) + fabs(p[k]);
        for (int l = 0; l < a->rows.m; l++) {
            along += (long double)pair->shift[a->rows.axis[l]] * a->rows.rows[l][k];
            size += fabsl((long double)pair->shift[a->rows.axis[l]] * a->rows.rows[l][k]);
        }
        square += times * times * along * along;
        sizes += times * times * size * size;
    }
    const long double slack = 0x1p-40L * sizes;
    if (slack > LDBL_MIN * 0x1p100L && slack < LDBL_MAX && fabsl(square - limit) > slack)
        return square < limit;
    return is_within(big_product(big_from_int(times * times), square_of(a, pair)),
                     big_sum(big_from_double(r), big_from_double(s)), inclusive);
}

TRUTH void
keep(brute_list *to, const brute_pair *pair)
{
    if (to->n == to->capacity) {
        to->capacity = 2 * to->capacity + 64;
        to->pairs = realloc(to->pairs, (size_t)to->capacity * sizeof *to->pairs);
        if (to->pairs == NULL)
            abort();
    }
    to->pairs[to->n++] = *pair;
}

/* Those pairs for which `kept` says so (NULL: all); both ways, and each point in its own place. */
TRUTH brute_list
pairs_kept(const asked *a, const brute_list *from, kept_fn kept, bool both_ways, bool with_self)
{
    brute_list to = {0};
    for (int64_t e = 0; e < from->n; e++) {
        brute_pair pair = from->pairs[e];
        if (kept != NULL && !kept(a, &from->pairs[e]))
            continue;
        keep(&to, &pair);
        pair.i = from->pairs[e].j;
        pair.j = from->pairs[e].i;
        for (int l = 0; l < a->d; l++)
            pair.shift[l] = -pair.shift[l];
        if (both_ways)
            keep(&to, &pair);
    }
    with_self = with_self && (a->scene->inclusive || a->scene->cutoff > 0.0);
    for (int32_t i = 0; with_self && i < a->n; i++) {
        const brute_pair self = {.i = i, .j = i};
        if (kept == NULL || kept(a, &self))
            keep(&to, &self);
    }
    if (to.n > 1 && (both_ways || with_self))
        qsort(to.pairs, (size_t)to.n, sizeof *to.pairs, brute_order);
    return to;
}

TRUTH bool
is_asked_across(const asked *a, const brute_pair *pair)
{
    return pair->i < a->split && pair->j >= a->split;
}

TRUTH bool
asks(const asked *a, const brute_pair *pair)
{
    return pair->i < a->split;
}

TRUTH bool
is_of_one_system(const asked *a, const brute_pair *pair)
{
    return (pair->i < a->split) == (pair->j < a->split);
}

TRUTH bool
is_within_radii(const asked *a, const brute_pair *pair)
{
    const double r = a->radii[pair->i], s = a->radii[pair->j];
    const double one = a->reach.rule == HS_RULE_MAX      ? fmax(r, s)
                       : a->reach.rule == HS_RULE_MIN    ? fmin(r, s)
                       : a->reach.rule == HS_RULE_GATHER ? r
                                                         : s;
    if (a->reach.rule == HS_RULE_SUM || a->reach.rule == HS_RULE_MEAN)
        return is_within_sum(a, pair, a->reach.rule == HS_RULE_MEAN ? 2 : 1, r, s,
                             a->scene->inclusive);
    if (a->quarters == 4)
        return is_within_sum(a, pair, 1, one, 0.0, a->scene->inclusive);
    return is_within(big_product(big_from_int(16), square_of(a, pair)),
                     big_product(big_from_int(a->quarters), big_from_double(one)),
                     a->scene->inclusive);
}

TRUTH bool
is_within_table(const asked *a, const brute_pair *pair)
{
    const double cutoff = a->table[a->types[pair->i] * ANSWER_TYPES + a->types[pair->j]];
    return cutoff >= 0.0 && is_within_sum(a, pair, 1, cutoff, 0.0, a->scene->inclusive);
}

/* H is whole numbers times a power of two, which the extent has too. */
TRUTH bool
is_within_support(const asked *a, const brute_pair *pair, int32_t of)
{
    int64_t shift[HS_MAX_DIM];
    big     sum = big_from_int(0);
    shift_of_rows(a, pair, shift);
    for (int r = 0; r < a->d; r++) {
        big along = big_from_int(0);
        for (int k = 0; k < a->d; k++) {
            const double entry = a->ellipsoids[of * a->d * a->d + r * a->d + k];
            const big    part = big_component(a->rows.m, (const double(*)[8])a->rows.rows,
                                              at_point(a, pair->i), at_point(a, pair->j), shift, k);
            along = big_sum(
                along, big_product(big_from_int((int64_t)(entry / a->ellipsoids[0] * 4.0)), part));
        }
        sum = big_sum(sum, big_product(along, along));
    }
    return is_within(sum, big_from_double(a->reach.extent / a->ellipsoids[0] * 4.0),
                     a->scene->inclusive);
}

TRUTH bool
is_within_supports(const asked *a, const brute_pair *pair)
{
    const bool i = is_within_support(a, pair, pair->i), j = is_within_support(a, pair, pair->j);
    return a->reach.rule == HS_RULE_MAX      ? i || j
           : a->reach.rule == HS_RULE_MIN    ? i && j
           : a->reach.rule == HS_RULE_GATHER ? i
                                             : j;
}

/* One of the half list: of its images that are as near, the first one. */
TRUTH bool
is_nearest_image(const asked *a, const brute_pair *pair)
{
    const brute_pair *begin = a->half->pairs, *end = begin + a->half->n, *q = pair;
    const big         square = square_of(a, pair);
    while (q > begin && q[-1].i == pair->i && q[-1].j == pair->j)
        q--;
    for (; q < end && q->i == pair->i && q->j == pair->j; q++) {
        const int sign = q == pair ? 1 : big_compare(square_of(a, q), square);
        if (sign < 0 || (sign == 0 && q < pair))
            return false;
    }
    return true;
}

TRUTH bool
is_selected(const asked *a, const brute_pair *pair)
{
    const hs_selection *of = &a->selection;
    const double        least = of->min_distance;
    if (of->has_groups && a->groups[pair->i] != a->groups[pair->j])
        return false;
    if (least > 0.0 && is_within_sum(a, pair, 1, least, 0.0, false))
        return false;
    bool excluded = of->has_labels && llabs(a->labels[pair->i] - a->labels[pair->j]) <= of->within;
    for (int64_t e = 0; e < of->n_excluded; e++) {
        const int64_t i = a->excluded[2 * e], j = a->excluded[2 * e + 1];
        excluded = excluded || (i == pair->i && j == pair->j) || (i == pair->j && j == pair->i);
    }
    return !excluded || pair->i == pair->j || !is_nearest_image(a, pair);
}

TRUTH bool
is_selected_within_radii(const asked *a, const brute_pair *pair)
{
    return is_within_radii(a, pair) && is_selected(a, pair);
}

static inline int64_t
number_of(const hs_pairs *found, unsigned which, int bytes, int64_t e)
{
    const void *array = hs_pairs_array(found, which);
    return bytes == 4 ? ((const int32_t *)array)[e] : ((const int64_t *)array)[e];
}

/* Whether all that was found is `expected`, whose j are `offset` more; frees both. */
static inline const char *
difference_of(const asked *a, hs_status status, hs_pairs *found, brute_list expected,
              int64_t offset)
{
    const char    *difference = status != HS_OK                        ? hs_status_text(status)
                                : hs_pairs_length(found) != expected.n ? "another number"
                                                                       : NULL;
    const int      bytes = a->options.index_bytes;
    const int32_t *shift = difference == NULL ? hs_pairs_array(found, HS_WANT_SHIFT) : NULL;
    const double  *far = difference == NULL ? hs_pairs_array(found, HS_WANT_DISTANCE) : NULL;
    const double  *vector = difference == NULL ? hs_pairs_array(found, HS_WANT_VECTOR) : NULL;
    for (int64_t e = 0; difference == NULL && e < expected.n; e++) {
        const brute_pair *pair = &expected.pairs[e];
        if (number_of(found, HS_WANT_I, bytes, e) != pair->i ||
            number_of(found, HS_WANT_J, bytes, e) + offset != pair->j)
            difference = "another pair";
        for (int l = 0; l < a->d; l++) {
            if (shift[e * a->d + l] != pair->shift[l])
                difference = "another shift";
        }
        if (difference == NULL && e % a->stride == 0 &&
            !measures_are_right(a->scene, &a->rows, pair, far[e], vector + e * a->d))
            difference = "a wrong distance or vector";
    }
    hs_pairs_free(found);
    brute_free(&expected);
    return difference;
}

/* Rows of `expected`, and how many are in each. */
static inline const char *
rows_difference(const asked *a, const hs_among *among, brute_list expected, int64_t offset)
{
    hs_pairs       *rows = NULL;
    int64_t         counts[ANSWER_POINTS];
    const hs_status counted = hs_neighbors_count(among, &a->options, counts, NULL);
    const hs_status status = hs_neighbors_find(among, &a->options, &rows, NULL);
    for (int64_t i = 0, e = 0; counted == HS_OK && status == HS_OK && i < hs_pairs_rows(rows);
         i++) {
        const int64_t begin = e;
        while (e < expected.n && expected.pairs[e].i == i)
            e++;
        if (counts[i] != e - begin || hs_pairs_offsets(rows)[i + 1] != e)
            return "another length of a row";
    }
    return difference_of(a, counted != HS_OK ? counted : status, rows, expected, offset);
}

static inline const char *
check_rows(asked *a)
{
    hs_among    among = {.points = SET(&a->points), .box = a->scene->box};
    const char *difference =
        rows_difference(a, &among, pairs_kept(a, &a->both, NULL, false, false), 0);
    among.queries = SET(&a->first);
    if (difference == NULL)
        difference = rows_difference(a, &among, pairs_kept(a, &a->both, asks, false, true), 0);
    among.points = SET(&a->rest);
    const brute_list across = pairs_kept(a, a->half, is_asked_across, false, false);
    int64_t          n = 0;
    if (difference == NULL &&
        (hs_pairs_count(&among, &a->options, &n, NULL) != HS_OK || n != across.n))
        difference = "another count between";
    return difference != NULL ? difference : rows_difference(a, &among, across, a->split);
}

typedef struct near_entry {
    const brute_pair *pair;
    big               square;
} near_entry;

TRUTH int
order_of_near(const void *a, const void *b)
{
    const near_entry *p = a, *q = b;
    const int         sign = big_compare(p->square, q->square);
    return sign != 0 ? sign : brute_order(p->pair, q->pair);
}

/* The k nearest in each row of `all`. */
static inline const char *
nearest_difference(const asked *a, const hs_pairs *rows, int64_t k, brute_list all, int64_t offset)
{
    const char    *difference = NULL;
    const int32_t *shift = hs_pairs_array(rows, HS_WANT_SHIFT);
    const double  *far = hs_pairs_array(rows, HS_WANT_DISTANCE);
    const double  *vector = hs_pairs_array(rows, HS_WANT_VECTOR);
    const int64_t *number = hs_pairs_array(rows, HS_WANT_J), n_rows = hs_pairs_length(rows) / k;
    near_entry    *sorted = array_of(all.n, sizeof *sorted);
    for (int64_t i = 0, e = 0; i < n_rows; i++) {
        int64_t n = 0;
        for (; e < all.n && all.pairs[e].i == i; e++)
            sorted[n++] = (near_entry){&all.pairs[e], square_of(a, &all.pairs[e])};
        qsort(sorted, (size_t)n, sizeof *sorted, order_of_near);
        for (int64_t r = 0; r < k; r++) {
            const int64_t     at = i * k + r;
            const brute_pair *pair = r < n ? sorted[r].pair : NULL;
            if (r >= n ? number[at] != -1 || far[at] != INFINITY : number[at] + offset != pair->j)
                difference = "another of the nearest";
            for (int l = 0; l < a->d; l++) {
                if (shift[at * a->d + l] != (r < n ? pair->shift[l] : 0))
                    difference = "another image of the nearest";
            }
            if (difference == NULL && r < n && i % a->stride == 0 &&
                !measures_are_right(a->scene, &a->rows, pair, far[at], vector + at * a->d))
                difference = "a wrong distance of the nearest";
        }
    }
    free(sorted);
    brute_free(&all);
    return difference;
}

/* Of all, between two sets, and of systems. */
static inline const char *
check_nearest(asked *a)
{
    const int64_t first[] = {0, a->split, a->split, a->n},
                  k = 1 + (int64_t)chosen(a, chosen(a, 6) ? 6 : 150);
    hs_options  options = a->options;
    const char *difference = NULL;
    options.index_bytes = 8;
    for (int kind = 0; a->scene->inclusive && difference == NULL && kind < 5; kind++) {
        hs_pairs        *rows = NULL;
        const bool       is_across = kind == 1 || kind == 4, has_systems = kind == 2;
        const hs_points *points = is_across ? &a->rest : &a->points;
        const hs_among   among = {
              .points = SET(points, .n_systems = 3, .first = has_systems ? first : NULL),
              .queries = SET(is_across ? &a->first : NULL),
              .box = a->scene->box};
        hs_cells       *cells = NULL;
        const hs_status built =
            kind < 3 ? HS_OK : hs_cells_build(points, among.box, &options, &cells, NULL);
        const hs_among  in_cells = {.cells = cells, .queries = among.queries};
        const hs_status status = built != HS_OK ? built
                                                : hs_nearest_find(kind > 2 ? &in_cells : &among, k,
                                                                  &options, &rows, NULL);
        if (status != HS_OK)
            difference = hs_status_text(status);
        else
            difference = nearest_difference(
                a, rows, k,
                is_across
                    ? pairs_kept(a, a->half, is_asked_across, false, false)
                    : pairs_kept(a, &a->both, has_systems ? is_of_one_system : NULL, false, false),
                is_across ? a->split : 0);
        hs_pairs_free(rows);
        hs_cells_free(cells);
    }
    return difference;
}

/* The first edge that the pair is below. */
TRUTH int
bin_of(const asked *a, const brute_pair *pair, bool inclusive)
{
    int k = 0;
    while (k < a->n_edges - 1 && !is_within_sum(a, pair, 1, a->edges[k], 0.0, inclusive))
        k++;
    return k;
}

/* Of one set, between two, and of systems; of the first two in cells, too. */
static inline const char *
check_histogram(asked *a)
{
    enum { SIZE = ANSWER_TYPES * ANSWER_TYPES * ANSWER_EDGES };
    static const double factors[] = {1.0, 1.75, 0.5};
    const int64_t       first[] = {0, a->split, a->split, a->n};
    const int           types = 1 + (int)chosen(a, ANSWER_TYPES), size = types * types * a->n_edges;
    for (int kind = 0; kind < 5; kind++) {
        static int64_t   counts[3 * SIZE], wanted[3 * SIZE];
        static double    sums[3 * SIZE], wanted_sums[3 * SIZE];
        const bool       inclusive = a->scene->inclusive && chosen(a, 2), is_across = kind % 2;
        const int64_t    from = is_across ? a->split : 0;
        const hs_points *points = is_across ? &a->rest : &a->points;
        hs_set           known = {.types = a->types + from, .weights = a->weights + from};
        hs_set           set = {.at = *points,
                                .types = known.types,
                                .weights = known.weights,
                                .n_systems = 3,
                                .first = kind == 2 ? first : NULL};
        hs_among         among = {
                    .points = &set,
                    .queries = SET(is_across ? &a->first : NULL, .types = a->types, .weights = a->weights),
                    .box = a->scene->box};
        hs_histogram histogram = {.n_edges = a->n_edges,
                                  .edges = a->edges,
                                  .inclusive = inclusive,
                                  .last_inclusive = a->scene->inclusive,
                                  .n_types = types,
                                  .counts = counts,
                                  .sums = sums};
        for (int64_t i = 0; i < a->n; i++)
            a->types[i] %= types;
        memset(wanted, 0, sizeof wanted);
        memset(wanted_sums, 0, sizeof wanted_sums);
        for (int64_t e = 0; e < a->half->n; e++) {
            const brute_pair *pair = &a->half->pairs[e];
            const int         s = a->types[pair->i], t = a->types[pair->j];
            if ((is_across && !is_asked_across(a, pair)) ||
                (kind == 2 && !is_of_one_system(a, pair)))
                continue;
            for (int way = 0; way < 1 + (!is_across && s != t); way++) {
                const int to = (kind == 2 && pair->i >= a->split ? 2 * size : 0) +
                               (way ? t * types + s : s * types + t) * a->n_edges +
                               bin_of(a, pair, inclusive);
                wanted[to]++;
                wanted_sums[to] += a->weights[pair->i] * a->weights[pair->j];
            }
        }
        hs_options building = a->options;
        hs_cells  *cells = NULL;
        hs_status  status = HS_OK;
        building.cutoff *= factors[chosen(a, 3)];
        if (kind > 2) {
            status = hs_cells_build(points, among.box, &building, &cells, NULL);
            among = (hs_among){.cells = cells, .points = &known, .queries = among.queries};
        }
        if (status == HS_OK)
            status = hs_pairs_histogram(&among, &a->options, &histogram, NULL);
        hs_cells_free(cells);
        const size_t n = (size_t)(kind == 2 ? 3 * size : size);
        if (status != HS_OK)
            return hs_status_text(status);
        if (memcmp(counts, wanted, n * sizeof *counts) != 0)
            return "another histogram";
        for (size_t e = 0; e < n; e++) {
            if (sums[e] != wanted_sums[e])
                return "another sum of a histogram";
        }
    }
    return NULL;
}

static inline const char *
check_shells(asked *a)
{
    hs_options options = a->options;
    hs_pairs  *pairs = NULL;
    options.want |= HS_WANT_SHELL;
    options.n_shells = a->n_edges;
    options.shells = a->edges;
    const hs_status status =
        hs_pairs_find(AMONG(&a->points, a->scene->box), &options, &pairs, NULL);
    const int32_t *shell = status == HS_OK ? hs_pairs_array(pairs, HS_WANT_SHELL) : NULL;
    for (int64_t e = 0; status == HS_OK && e < hs_pairs_length(pairs) && e < a->half->n; e++) {
        if (shell[e] != bin_of(a, &a->half->pairs[e], a->scene->inclusive))
            return "another shell";
    }
    return difference_of(a, status, pairs, pairs_kept(a, a->half, NULL, false, false), 0);
}

/* Labels as clusters have them: of core points that pairs join, and of the others near them. */
static inline const char *
check_clusters(asked *a)
{
    static int64_t label[ANSWER_POINTS], root[ANSWER_POINTS], place[ANSWER_POINTS][HS_MAX_DIM];
    static uint8_t core[ANSWER_POINTS], winding[ANSWER_POINTS], turns[ANSWER_POINTS];
    const bool     all = chosen(a, 2) == 0;
    bool           changes = true;
    int64_t        n = 0, n_found = 0;
    for (int64_t i = 0; i < a->n; i++) {
        core[i] = all || a->groups[i] == 0;
        root[i] = core[i] ? i : -1;
        turns[i] = 0;
        memset(place[i], 0, sizeof place[i]);
    }
    while (changes) { /* both ways: the lower number wins, with the shift from there */
        changes = false;
        for (int64_t e = 0; e < a->both.n; e++) {
            const brute_pair *pair = &a->both.pairs[e];
            if (core[pair->i] && core[pair->j] && root[pair->i] < root[pair->j]) {
                changes = true;
                root[pair->j] = root[pair->i];
                for (int l = 0; l < a->d; l++)
                    place[pair->j][l] = place[pair->i][l] + pair->shift[l];
            }
        }
    }
    for (int64_t i = 0; i < a->n; i++)
        label[i] = root[i] == i ? n++ : root[i] < 0 ? -1 : label[root[i]];
    for (int64_t e = 0; e < a->both.n; e++) {
        const brute_pair *pair = &a->both.pairs[e];
        const int64_t     of = core[pair->i] ? label[pair->i] : -1;
        if (of >= 0 && !core[pair->j] && (label[pair->j] < 0 || of < label[pair->j]))
            label[pair->j] = of;
        for (int l = 0; of >= 0 && core[pair->j] && l < a->d; l++) {
            if (place[pair->i][l] + pair->shift[l] != place[pair->j][l])
                turns[of] = (uint8_t)(turns[of] | 1 << l);
        }
    }
    static int64_t  found[ANSWER_POINTS], again[ANSWER_POINTS];
    hs_counters     counters;
    hs_options      options = a->options;
    const hs_among  among = {.points = SET(&a->points), .box = a->scene->box};
    const uint8_t  *given = all ? NULL : core;
    const hs_status without =
        hs_clusters_find(&among, &options, given, again, NULL, &n_found, NULL);
    options.index_bytes = 3; /* ignored */
    options.counters = &counters;
    const hs_status status =
        hs_clusters_find(&among, &options, given, found, winding, &n_found, NULL);
    if (status != HS_OK || without != HS_OK)
        return hs_status_text(status != HS_OK ? status : without);
    if (counters.pairs != a->half->n || memcmp(found, again, (size_t)a->n * sizeof *found) != 0)
        return "another count of pairs in clusters, or labels without windings";
    return n != n_found || memcmp(found, label, (size_t)a->n * sizeof *found) != 0
               ? "another cluster"
           : memcmp(winding, turns, (size_t)n) != 0 ? "another winding"
                                                    : NULL;
}

/* How far a function has come through a result, of which it sees one pair after the other. */
typedef struct seen {
    const hs_pairs *pairs;
    int64_t         n;
    int             d, bytes;
    bool            same;
} seen;

static inline int
see(int64_t i, int64_t j, const int32_t *S, const double *D, double d2, void *user)
{
    seen        *of = user;
    const size_t d = (size_t)of->d;
    if (of->n >= hs_pairs_length(of->pairs))
        return of->same = false, 1;
    const int32_t *shift = hs_pairs_array(of->pairs, HS_WANT_SHIFT);
    const double  *vector = hs_pairs_array(of->pairs, HS_WANT_VECTOR);
    const double   far = ((const double *)hs_pairs_array(of->pairs, HS_WANT_DISTANCE))[of->n];
    of->same = of->same && number_of(of->pairs, HS_WANT_I, of->bytes, of->n) == i &&
               number_of(of->pairs, HS_WANT_J, of->bytes, of->n) == j &&
               memcmp(shift + (size_t)of->n * d, S, d * sizeof *S) == 0 &&
               memcmp(vector + (size_t)of->n * d, D, d * sizeof *D) == 0 && d2 == far * far;
    of->n++;
    return 0;
}

/* Blocks, and what a function sees, are the unsorted pairs in their order. */
static inline const char *
check_streams(asked *a)
{
    const hs_among among = {.points = SET(&a->points), .box = a->scene->box};
    hs_options     options = a->options;
    hs_stream     *stream = NULL;
    hs_pairs      *pairs = NULL, *block = NULL;
    seen           of = {.d = a->d, .bytes = options.index_bytes, .same = true};
    const hs_visit visit = {.pair = see, .user = &of};
    int64_t        n = 0, at = 0;
    options.sorted = false;
    hs_status status = hs_pairs_find(&among, &options, &pairs, NULL);
    of.pairs = pairs;
    if (status == HS_OK)
        status = hs_pairs_visit(&among, &options, &visit, &n, NULL);
    of.same = of.same && (status != HS_OK || n == hs_pairs_length(pairs));
    if (status == HS_OK)
        status = hs_stream_open(&among, &options, 1 + (int64_t)chosen(a, 40), &stream, NULL);
    while (status == HS_OK && of.same) {
        status = hs_stream_next(stream, NULL, NULL, &block, NULL);
        if (block == NULL)
            break;
        const int64_t length = hs_pairs_length(block);
        const size_t  widths[] = {(size_t)options.index_bytes, (size_t)options.index_bytes, 8,
                                  8 * (size_t)a->d, 4 * (size_t)a->d};
        for (int c = 0; c < 5; c++) {
            const char *whole = hs_pairs_array(pairs, 1u << c);
            of.same = of.same && at + length <= n &&
                      memcmp(hs_pairs_array(block, 1u << c), whole + (size_t)at * widths[c],
                             (size_t)length * widths[c]) == 0;
        }
        at += length;
        hs_pairs_free(block);
    }
    hs_stream_free(stream);
    hs_pairs_free(pairs);
    return status != HS_OK ? hs_status_text(status) : of.same && at == n ? NULL : "another stream";
}

/* The points before `split`, none, and the others. */
static inline const char *
check_systems(asked *a)
{
    const int64_t  first[] = {0, a->split, a->split, a->n};
    const double   cutoffs[] = {a->scene->cutoff, 0.0, a->scene->cutoff};
    double         rows[3 * HS_MAX_DIM * HS_MAX_DIM];
    hs_each_system each = {.rows = NULL};
    hs_pairs      *pairs = NULL, *of_rows = NULL;
    int64_t        counts[3] = {0}, lengths[ANSWER_POINTS];
    for (int e = 0; a->scene->box != NULL && e < 3 * a->d * a->d; e++)
        rows[e] = a->scene->box->rows[e / a->d % a->d][e % a->d];
    each.rows = a->scene->box != NULL && chosen(a, 2) ? rows : NULL;
    each.cutoffs = chosen(a, 2) ? cutoffs : NULL;
    const hs_among *among = SYSTEMS(&a->points, 3, first, a->scene->box, &each);
    hs_status       status = hs_pairs_count(among, &a->options, counts, NULL);
    if (status == HS_OK)
        status = hs_neighbors_count(among, &a->options, lengths, NULL);
    if (status == HS_OK)
        status = hs_neighbors_find(among, &a->options, &of_rows, NULL);
    for (int64_t i = 0; status == HS_OK && i < a->n; i++) {
        if (lengths[i] != hs_pairs_offsets(of_rows)[i + 1] - hs_pairs_offsets(of_rows)[i])
            return "another length of a row of a system";
    }
    const char *difference = difference_of(
        a, status, of_rows, pairs_kept(a, &a->both, is_of_one_system, false, false), 0);
    if (difference != NULL)
        return difference;
    status = hs_pairs_find(among, &a->options, &pairs, NULL);
    if (status == HS_OK && counts[0] + counts[2] != hs_pairs_length(pairs))
        return "another count of systems";
    return difference_of(a, status, pairs, pairs_kept(a, a->half, is_of_one_system, false, false),
                         0);
}

/* Points from this one on, with what their reach and a selection go by. */
#define known_from(a, points, from)                                                           \
    SET(points, .radii = (a)->radii + (from),                                                 \
        .supports = (a)->ellipsoids + (from) * (a)->d * (a)->d, .types = (a)->types + (from), \
        .groups = (a)->groups + (from), .labels = (a)->labels + (from))

/* Of the points before `split` among the others. */
static inline const char *
known_across(asked *a, const hs_reach *reach, const hs_selection *selection, kept_fn kept)
{
    static int64_t excluded[2 * ANSWER_EXCLUDED];
    hs_selection   between = a->selection;
    const hs_among among = {.points = known_from(a, &a->rest, a->split),
                            .queries = known_from(a, &a->first, 0),
                            .box = a->scene->box,
                            .reach = reach,
                            .selection = selection != NULL ? &between : NULL};
    between.excluded = excluded;
    between.n_excluded = 0;
    for (int64_t e = 0; e < a->selection.n_excluded; e++) {
        const int64_t i = a->excluded[2 * e], j = a->excluded[2 * e + 1];
        if ((i < a->split) == (j < a->split))
            continue;
        excluded[2 * between.n_excluded] = i < j ? i : j;
        excluded[2 * between.n_excluded++ + 1] = (i < j ? j : i) - a->split;
    }
    brute_list       all = pairs_kept(a, a->half, kept, false, false);
    const brute_list expected = pairs_kept(a, &all, is_asked_across, false, false);
    int64_t          n = -1;
    brute_free(&all);
    const hs_status counted = hs_pairs_count(&among, &a->options, &n, NULL);
    if (counted == HS_OK && n != expected.n)
        return "another count between two sets";
    return rows_difference(a, &among, expected, a->split);
}

/* Pairs, or rows, by reach and selection, and their number; by one search or several. */
static inline const char *
known_difference(asked *a, const hs_reach *reach, const hs_selection *selection, kept_fn kept)
{
    const hs_among among = {.points = known_from(a, &a->points, 0),
                            .box = a->scene->box,
                            .reach = reach,
                            .selection = selection};
    const bool     directed = reach != NULL && reach->rule >= HS_RULE_GATHER && reach->n_types == 0;
    const bool     joins = hs_test_joins_levels;
    hs_test_joins_levels = chosen(a, 2) == 0;
    const char *difference = NULL;
    hs_pairs   *pairs = NULL;
    int64_t     n = -1;
    if (chosen(a, 3) == 0) {
        difference = known_across(a, reach, selection, kept);
    } else if (directed || chosen(a, 3) == 0) {
        const brute_list *from = directed ? &a->both : a->half;
        difference = rows_difference(a, &among, pairs_kept(a, from, kept, !directed, false), 0);
    } else {
        brute_list      expected = pairs_kept(a, a->half, kept, false, false);
        const hs_status counted = hs_pairs_count(&among, &a->options, &n, NULL);
        const hs_status status = hs_pairs_find(&among, &a->options, &pairs, NULL);
        const bool      is_other = counted == HS_OK && n != expected.n;
        difference = difference_of(a, status, pairs, expected, 0);
        difference = is_other ? "another count" : difference;
    }
    hs_test_joins_levels = joins;
    return difference;
}

/* Radii, edges and tables are parts of the cutoff, and distances that there are or a step beside. */
static inline double
some_length(asked *a)
{
    const double cutoff = a->scene->cutoff;
    if (a->half->n > 0 && chosen(a, 3) == 0) {
        const big square = square_of(a, &a->half->pairs[chosen(a, (uint64_t)a->half->n)]);
        double    length = sqrt(big_to_double(&square, -2148));
        if (chosen(a, 2))
            length = nextafter(length, chosen(a, 2) ? INFINITY : 0.0);
        return length <= cutoff ? length : cutoff;
    }
    return cutoff * (double)chosen(a, 9) * 0.125;
}

static inline const char *
check_radii(asked *a)
{
    a->reach = (hs_reach){.rule = (hs_rule)chosen(a, HS_RULE_END)};
    a->quarters = 4;
    const bool is_ordinary = a->scene->cutoff > 0x1p-400 && a->scene->cutoff < 0x1p400;
    if (a->reach.rule >= HS_RULE_MAX && is_ordinary && chosen(a, 2) == 0) {
        a->quarters = 1 + (int)chosen(a, 7);
        a->reach.extent = 0.25 * a->quarters;
    }
    const double least = a->reach.extent != 0.0 ? 0x1p-490 : 0x1p-1000; /* what can be halved */
    for (int64_t i = 0; i < a->n; i++) {
        const double length = some_length(a);
        a->radii[i] = length < least ? 0.0 : length;
    }
    return a->scene->cutoff > 0x1p1020 ? NULL
                                       : known_difference(a, &a->reach, NULL, is_within_radii);
}

static inline const char *
check_table(asked *a)
{
    a->reach = (hs_reach){.n_types = ANSWER_TYPES, .cutoffs = a->table};
    for (int s = 0; s < ANSWER_TYPES; s++) {
        for (int t = 0; t <= s; t++)
            a->table[s * ANSWER_TYPES + t] = a->table[t * ANSWER_TYPES + s] =
                chosen(a, 6) == 0 ? -1.0 : some_length(a);
    }
    return known_difference(a, &a->reach, NULL, is_within_table);
}

static inline const char *
check_supports(asked *a)
{
    const double unit = 0x1p-20; /* of an entry; the first one is 4 of them, which tells it */
    const bool   is_ordinary = a->scene->cutoff > 0x1p-300 && a->scene->cutoff < 0x1p300;
    if (a->d > 3 || a->n == 0 || !is_ordinary)
        return NULL;
    for (int64_t i = 0; i < a->n; i++) {
        double *h = a->ellipsoids + i * a->d * a->d;
        for (int r = 0; r < a->d; r++) {
            for (int k = 0; k <= r; k++)
                h[r * a->d + k] = h[k * a->d + r] =
                    r == k ? unit * (3 + (double)chosen(a, 4))
                           : (r - k == 1 ? unit * ((double)chosen(a, 3) - 1.0) : 0.0);
        }
    }
    a->ellipsoids[0] = 4.0 * unit;
    a->reach = (hs_reach){.rule = (hs_rule)(HS_RULE_MAX + chosen(a, 4)),
                          .has_supports = true,
                          .extent = unit * (1.0 + (double)chosen(a, 5)) * some_length(a)};
    return known_difference(a, &a->reach, NULL, is_within_supports);
}

/* Labels, or a list of pairs, to leave out; groups; a least distance. */
static inline void
choose_selection(asked *a)
{
    const uint64_t which = 1 + chosen(a, 7);
    const bool     has_list = which & 2 && a->half->n > 0 && chosen(a, 2);
    a->selection = (hs_selection){.has_groups = which & 1,
                                  .has_labels = which & 2 && !has_list,
                                  .within = which & 2 ? (int64_t)chosen(a, 3) : 0,
                                  .n_excluded = has_list ? (int64_t)chosen(a, ANSWER_EXCLUDED) : 0,
                                  .excluded = a->excluded,
                                  .min_distance = which & 4 ? some_length(a) : 0.0};
    for (int64_t e = 0; e < a->selection.n_excluded; e++) {
        const brute_pair *pair = &a->half->pairs[chosen(a, (uint64_t)a->half->n)];
        const uint64_t    turn = chosen(a, 2);
        a->excluded[2 * e + (int64_t)turn] = pair->i;
        a->excluded[2 * e + 1 - (int64_t)turn] = pair->j;
    }
}

/* Of queries that are points themselves, which find each its own point too, and of systems. */
static inline const char *
selected_otherwise(asked *a, const brute_list *selected)
{
    const int64_t  first[] = {0, a->split, a->split, a->n};
    int64_t        numbers[ANSWER_POINTS];
    hs_selection   numbered = a->selection;
    hs_pairs      *pairs = NULL;
    const hs_among own = {.points = known_from(a, &a->points, 0),
                          .queries = SET(&a->first),
                          .box = a->scene->box,
                          .selection = &numbered};
    numbered.query_numbers = numbers;
    for (int64_t i = 0; i < a->split; i++)
        numbers[i] = i;
    brute_list  both = pairs_kept(a, selected, NULL, true, false);
    const char *difference = rows_difference(a, &own, pairs_kept(a, &both, asks, false, true), 0);
    brute_free(&both);
    if (difference != NULL)
        return difference;
    hs_set set = *known_from(a, &a->points, 0);
    set.n_systems = 3;
    set.first = first;
    const hs_among  systems = {.points = &set, .box = a->scene->box, .selection = &a->selection};
    const hs_status status = hs_pairs_find(&systems, &a->options, &pairs, NULL);
    return difference_of(a, status, pairs, pairs_kept(a, selected, is_of_one_system, false, false),
                         0);
}

/* The nearest of those that are selected. */
static inline const char *
selected_nearest(asked *a, const brute_list *selected)
{
    const int64_t  k = 1 + (int64_t)chosen(a, chosen(a, 4) ? 4 : 60);
    const hs_among among = {
        .points = known_from(a, &a->points, 0), .box = a->scene->box, .selection = &a->selection};
    hs_options options = a->options;
    hs_pairs  *rows = NULL;
    if (!a->scene->inclusive)
        return NULL;
    options.index_bytes = 8;
    const hs_status status = hs_nearest_find(&among, k, &options, &rows, NULL);
    const char     *difference = hs_status_text(status);
    if (status == HS_OK)
        difference = nearest_difference(a, rows, k, pairs_kept(a, selected, NULL, true, false), 0);
    hs_pairs_free(rows);
    return difference;
}

/* How many are in each bin. */
static inline const char *
selected_histogram(asked *a, const brute_list *selected)
{
    int64_t        counts[ANSWER_EDGES] = {0};
    const hs_among among = {
        .points = known_from(a, &a->points, 0), .box = a->scene->box, .selection = &a->selection};
    hs_histogram    histogram = {.n_edges = a->n_edges,
                                 .edges = a->edges,
                                 .inclusive = a->scene->inclusive,
                                 .last_inclusive = a->scene->inclusive,
                                 .n_types = 1,
                                 .counts = counts};
    const hs_status status = hs_pairs_histogram(&among, &a->options, &histogram, NULL);
    for (int64_t e = 0; e < selected->n; e++)
        counts[bin_of(a, &selected->pairs[e], a->scene->inclusive)]--;
    for (int k = 0; status == HS_OK && k < a->n_edges; k++) {
        if (counts[k] != 0)
            return "another histogram of what is selected";
    }
    return status != HS_OK ? hs_status_text(status) : NULL;
}

/* A stream keeps what it chooses by. */
static inline const char *
selected_stream(asked *a, const hs_reach *reach, const brute_list *selected)
{
    const hs_among among = {.points = known_from(a, &a->points, 0),
                            .box = a->scene->box,
                            .reach = reach,
                            .selection = &a->selection};
    hs_stream     *stream = NULL;
    hs_pairs      *block = NULL;
    hs_status      status = hs_stream_open(&among, &a->options, INT64_MAX, &stream, NULL);
    memset(a->groups, 0, sizeof a->groups);
    memset(a->labels, 0, sizeof a->labels);
    memset(a->excluded, 0, sizeof a->excluded);
    if (status == HS_OK)
        status = hs_stream_next(stream, NULL, NULL, &block, NULL);
    const int64_t n = block != NULL ? hs_pairs_length(block) : 0;
    hs_pairs_free(block);
    hs_stream_free(stream);
    return status != HS_OK    ? hs_status_text(status)
           : n != selected->n ? "another stream of what is selected"
                              : NULL;
}

/* All, and by radii, each pair of which has a limit of its own, too. */
static inline const char *
check_selection(asked *a)
{
    const bool      has_radii = chosen(a, 4) == 0 && a->scene->cutoff < 0x1p1020;
    const hs_reach *reach = has_radii ? &a->reach : NULL;
    const kept_fn   kept = has_radii ? is_selected_within_radii : is_selected;
    choose_selection(a);
    a->reach.rule = HS_RULE_MAX;
    a->quarters = 4;
    for (int64_t i = 0; i < a->n; i++)
        a->radii[i] = some_length(a);
    brute_list  selected = pairs_kept(a, a->half, kept, false, false);
    const char *difference = known_difference(a, reach, &a->selection, kept);
    if (difference == NULL && !has_radii)
        difference = selected_otherwise(a, &selected);
    if (difference == NULL && !has_radii)
        difference = selected_histogram(a, &selected);
    if (difference == NULL && !has_radii)
        difference = selected_nearest(a, &selected);
    if (difference == NULL)
        difference = selected_stream(a, reach, &selected);
    brute_free(&selected);
    return difference;
}

/* Cells give what a search gives; ranges of candidates hold all of it. */
static inline const char *
check_cells(asked *a)
{
    static const double widths[] = {0.0, 0.0, 1.0, 0.5, 0.07, 3.0, INFINITY};
    hs_options          building = a->options;
    hs_cells           *cells = NULL;
    hs_pairs           *pairs = NULL, *ranges = NULL;
    building.cutoff = (chosen(a, 2) ? 1.0 : 0.75 * (double)chosen(a, 3)) * a->scene->cutoff;
    building.cell_size = widths[chosen(a, 7)] * (a->scene->cutoff > 0.0 ? a->scene->cutoff : 1.0);
    hs_status   status = hs_cells_build(&a->points, a->scene->box, &building, &cells, NULL);
    const char *difference = NULL;
    if (status == HS_OK)
        status = hs_pairs_find(IN_CELLS(cells), &a->options, &pairs, NULL);
    difference = difference_of(a, status, pairs, pairs_kept(a, a->half, NULL, false, false), 0);
    if (difference == NULL)
        difference = rows_difference(a, QUERIED_CELLS(cells, &a->first),
                                     pairs_kept(a, &a->both, asks, false, true), 0);
    hs_layout layout;
    hs_cells_layout(cells, &layout);
    if (difference == NULL && hs_cells_candidates(cells, NULL, &building, &ranges, NULL) == HS_OK &&
        building.cutoff == a->scene->cutoff) {
        const int64_t *offsets = hs_pairs_offsets(ranges);
        for (int64_t e = 0; e < a->both.n; e++) {
            const brute_pair *pair = &a->both.pairs[e];
            bool              is_there = false;
            for (int64_t r = offsets[pair->i]; !is_there && r < offsets[pair->i + 1]; r++) {
                const int64_t end = number_of(ranges, HS_WANT_J, 8, r);
                int64_t       p = number_of(ranges, HS_WANT_I, 8, r);
                for (; p < end && !is_there; p++)
                    is_there = layout.order[p] == pair->j;
            }
            difference = is_there ? difference : "a candidate is missing";
        }
    }
    hs_pairs_free(ranges);
    hs_cells_free(cells);
    return difference;
}

/* A list that was built for these points, or for others near them, at these points. */
static inline const char *
check_list(asked *a)
{
    static double x[ANSWER_POINTS * HS_MAX_DIM];
    const double  skin = some_length(a), move = chosen(a, 2) ? 0.125 * skin : 0.0;
    hs_points     before = a->points;
    hs_verlet    *list = hs_verlet_new();
    hs_pairs     *pairs = NULL;
    bool          rebuilt;
    if (list == NULL)
        abort();
    for (int64_t e = 0; e < a->n * a->d; e++)
        x[e] = a->scene->x[e] + move * ((double)chosen(a, 3) - 1.0);
    before.data = x;
    hs_status status =
        hs_verlet_update(list, &before, a->scene->box, &a->options, skin, false, &rebuilt, NULL);
    if (status == HS_OK)
        status = hs_verlet_update(list, &a->points, a->scene->box, &a->options, skin, false,
                                  &rebuilt, NULL);
    if (status == HS_OK)
        status = hs_verlet_find(list, &a->options, &pairs, NULL);
    hs_verlet_free(list);
    return difference_of(a, status, pairs, pairs_kept(a, a->half, NULL, false, false), 0);
}

/* Pairs with their shifts are measured as they are found; without, in their nearest image. */
static inline const char *
check_measures(asked *a)
{
    int64_t   *i = array_of(a->half->n, 8), *j = array_of(a->half->n, 8);
    int64_t   *shift = array_of(a->half->n * a->d, 8);
    hs_pairs  *measured = NULL;
    hs_options options = a->options;
    const bool nearest = chosen(a, 2) == 0;
    options.want = HS_WANT_SHIFT | HS_WANT_DISTANCE | HS_WANT_VECTOR;
    for (int64_t e = 0; e < a->half->n; e++) {
        i[e] = a->half->pairs[e].i;
        j[e] = a->half->pairs[e].j;
        memcpy(shift + e * a->d, a->half->pairs[e].shift, (size_t)a->d * 8);
    }
    const hs_pair_numbers numbers = {
        .n = a->half->n, .i = i, .j = j, .shift = nearest ? NULL : shift};
    const hs_status status =
        hs_measure(&a->points, a->scene->box, &numbers, &options, &measured, NULL);
    const char *difference = status != HS_OK ? hs_status_text(status) : NULL;
    for (int64_t e = 0; difference == NULL && e < a->half->n; e++) {
        const brute_pair *pair = &a->half->pairs[e];
        const int32_t    *S = hs_pairs_array(measured, HS_WANT_SHIFT);
        const double     *far = hs_pairs_array(measured, HS_WANT_DISTANCE);
        const double     *vector = hs_pairs_array(measured, HS_WANT_VECTOR);
        if (nearest && (pair->i == pair->j || !is_nearest_image(a, pair)))
            continue;
        for (int l = 0; l < a->d; l++) {
            if (S[e * a->d + l] != pair->shift[l])
                difference = "another image is measured";
        }
        brute_scene without = *a->scene; /* d may reach the cutoff: none is known */
        without.cutoff = INFINITY;
        if (e % a->stride == 0 &&
            !measures_are_right(&without, &a->rows, pair, far[e], vector + e * a->d))
            difference = "a wrong measure";
    }
    hs_pairs_free(measured);
    free(i);
    free(j);
    free(shift);
    return difference;
}

/* Coordinates column by column, from the last point on, in float32 where that holds them. */
static inline const char *
check_layout(asked *a)
{
    static double x[ANSWER_POINTS * HS_MAX_DIM];
    static float  narrow[ANSWER_POINTS * HS_MAX_DIM];
    bool          fits = true;
    if (a->n == 0)
        return NULL;
    for (int64_t i = 0; i < a->n; i++) {
        for (int k = 0; k < a->d; k++) {
            const double  value = a->scene->x[i * a->d + k];
            const int64_t at = k * a->n + a->n - 1 - i;
            x[at] = value;
            fits = fits && fabs(value) < 0x1p127;
            narrow[at] = fits ? (float)value : 0.0f;
            fits = fits && (double)narrow[at] == value;
        }
    }
    const ptrdiff_t size = fits ? sizeof *narrow : sizeof *x;
    const hs_points points = {.data = fits ? (const char *)narrow + (a->n - 1) * size
                                           : (const char *)x + (a->n - 1) * size,
                              .n = a->n,
                              .ndim = a->d,
                              .real = fits ? HS_FLOAT32 : HS_FLOAT64,
                              .row_stride = -size,
                              .column_stride = a->n * size};
    hs_pairs       *pairs = NULL;
    const hs_status status =
        hs_pairs_find(AMONG(&points, a->scene->box), &a->options, &pairs, NULL);
    return difference_of(a, status, pairs, pairs_kept(a, a->half, NULL, false, false), 0);
}

/* Cells are about as many as points, and the plan is that of the search that is made. */
static inline const char *
check_plan(asked *a)
{
    const hs_among  among = {.points = SET(&a->points), .box = a->scene->box};
    hs_plan         plan;
    const hs_status status = hs_plan_make(&among, &a->options, &plan, NULL);
    int64_t         n_cells = 1;
    if (status != HS_OK)
        return hs_status_text(status);
    for (int k = 0; !plan.sparse && k < a->d; k++)
        n_cells *= plan.shape[k];
    return n_cells != plan.n_cells && !plan.sparse    ? "another number of cells"
           : n_cells > 2 * a->n + 64                  ? "more cells than points need"
           : a->n > 0 && plan.n_periodic != a->rows.m ? "another plan"
           : plan.all_pairs != (plan.n_cells == 1)    ? "a plan that contradicts itself"
                                                      : NULL;
}

static const struct answer_check {
    const char *name;
    const char *(*check)(asked *a);
} answer_checks[] = {
    {"rows", check_rows},         {"nearest", check_nearest},     {"histogram", check_histogram},
    {"shells", check_shells},     {"clusters", check_clusters},   {"streams", check_streams},
    {"systems", check_systems},   {"radii", check_radii},         {"table", check_table},
    {"supports", check_supports}, {"selection", check_selection}, {"cells", check_cells},
    {"list", check_list},         {"measures", check_measures},   {"layout", check_layout},
    {"plan", check_plan},
};

enum { ANSWER_CHECKS = sizeof answer_checks / sizeof answer_checks[0] };

static inline int
compare_edges(const void *a, const void *b)
{
    const double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

/* What one check finds wrong with a scene of up to ANSWER_POINTS points, or NULL. */
static inline const char *
answer_difference(int number, const brute_scene *scene, const brute_list *half, uint64_t salt,
                  int64_t stride)
{
    static const double widths[] = {0.3, 0.01, 1.0 + 1e-13, 2.0, 1e-90, 1e90};
    static asked        a;
    memset(&a, 0, sizeof a);
    a.scene = scene;
    a.half = half;
    a.salt = salt;
    a.stride = stride;
    a.n = scene->n;
    a.d = scene->ndim;
    (void)brute_prepare(scene, &a.rows);
    a.both = pairs_kept(&a, half, NULL, true, false);
    a.split = (int64_t)chosen(&a, (uint64_t)a.n + 1);
    a.points = a.first = a.rest = points_of(scene);
    a.first.n = a.split;
    a.rest.n = a.n - a.split;
    a.rest.data = scene->x + a.split * a.d;
    a.options = options_of(scene);
    a.options.want = WANT_ALL;
    a.options.sorted = true;
    a.options.threads = 1 + (int)chosen(&a, 2);
    a.options.counters = &answer_counters;
    a.options.index_bytes = number == 1 || chosen(&a, 2) ? 8 : 4;
    if (chosen(&a, 3) == 0 && scene->cutoff > 0x1p-700 && scene->cutoff < 0x1p700)
        a.options.cell_size = widths[chosen(&a, 6)] * scene->cutoff;
    for (int64_t i = 0; i < a.n; i++) {
        a.types[i] = (int32_t)chosen(&a, ANSWER_TYPES);
        a.groups[i] = (int64_t)chosen(&a, 2);
        a.labels[i] = (int64_t)chosen(&a, 8);
        a.weights[i] = (double)chosen(&a, 9) - 4.0;
    }
    a.n_edges = 1 + (int)chosen(&a, ANSWER_EDGES);
    a.edges[a.n_edges - 1] = scene->cutoff;
    const bool are_close = chosen(&a, 6) == 0; /* so that what float32 cannot tell overlaps */
    for (int k = a.n_edges - 2; k >= 0; k--)
        a.edges[k] = are_close ? a.edges[k + 1] * (1.0 - 1e-8 * (double)chosen(&a, 9))
                               : some_length(&a);
    qsort(a.edges, (size_t)a.n_edges, sizeof a.edges[0], compare_edges);
    const char *difference = answer_checks[number].check(&a);
    brute_free(&a.both);
    return difference;
}

/* Whether the nearest within the cutoff are right, of as many and from where `salt` says. */
static inline bool
nearest_are_right(const brute_scene *scene, uint64_t salt)
{
    brute_scene inclusive = *scene;
    brute_list  half;
    inclusive.inclusive = true;
    if (!brute_find(&inclusive, 1e7, &half))
        return false;
    const char *difference = answer_difference(1, &inclusive, &half, salt, 1);
    if (difference != NULL)
        fprintf(stderr, "  d = %d, n = %d, cutoff %a, salt %d: %s\n", scene->ndim, (int)scene->n,
                scene->cutoff, (int)salt, difference);
    brute_free(&half);
    return difference == NULL;
}

#endif
