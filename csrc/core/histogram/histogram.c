/* SPDX-License-Identifier: BSD-3-Clause */
#include "histogram.h"
#include "../collect/parallel.h"
#include "../exact/arithmetic.h"
#include "../exact/filter.h"
#include "../memory/memory.h"
#include "../search/scan.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* histogram.c: edges and their bands become a table, pairs are counted by it, weights are summed
 * without rounding, and threads' counts are joined. */

/*
 * From float32 squares to bins. Around each edge there is a band of squares that cannot tell on
 * which side of it a pair is (filter.h); between two bands the bin is sure. A table, indexed by the
 * leading bits of the square, knows for each of its cells which bands reach into it.
 *
 * A slot is 2 k for "k edges are reached, surely", and odd for pairs that must be decided exactly.
 */

/* The edges of a histogram; shared by all threads. */
typedef struct histogram_edges {
    int64_t n;
    bool    inclusive, last_inclusive; /* edges, the last edge, belong to the bin below */
    double *at;                        /* owned; as the scene's metric takes them; n */
    double *lower;                     /* at most, ... */
    double *upper; /* ... and at least the scaled edge; both in the memory of `at` */
    int     ndim;
    double  filter_error; /* of the search: bound on each component before rounding to float32 */
} histogram_edges;

/* Squares of one cell of the table: with s < in `slot`, with s > out two more, else one more. in
 * and out are the bits of floats, which order like these. */
typedef struct edge_cell {
    int32_t in, out;
    int32_t slot;
    int32_t n_bands; /* that reach into it; of several, in and out leave all to be looked at */
} edge_cell;

/* The table for neighbourhoods up to some extent; belongs to one thread. */
typedef struct edge_table {
    double     extent; /* 0 when there is no table yet */
    float     *in;     /* owned, n: the band of each edge; ascending */
    float     *out;    /* in the memory of `in` */
    edge_cell *cells;  /* owned; NULL where squares may overflow: then nothing is sure */
    int        shift;  /* bits of a square that do not choose the cell */
    int32_t    first;  /* leading bits of the squares of cell 0 */
    int32_t    last;   /* number of the last cell */
} edge_table;

/* Whether a pair at exactly edge k is below it. */
HS_ALWAYS_INLINE bool
is_inclusive(const histogram_edges *edges, int64_t k)
{
    return k == edges->n - 1 ? edges->last_inclusive : edges->inclusive;
}

/* Bits of a float32 that do not choose its cell, in the order in which they are tried. For each
 * power of two there are 128 cells, which tell a hundred bins apart, or 2048 for a thousand, or
 * 32768. */
#define FEW_CELLS  16
#define MANY_CELLS 12
#define ALL_CELLS  8
#define MOST_CELLS (1 << 16) /* a megabyte; squares below these share cell 0 */

/* Edges of the histogram in the unit of the scene. */
static hs_status
edges_init(hs_account *account, const hs_scene *scene, double filter_error,
           const hs_histogram *histogram, histogram_edges *edges)
{
    const int64_t n = histogram->n_edges;
    *edges = (histogram_edges){.n = n,
                               .inclusive = histogram->inclusive,
                               .last_inclusive = histogram->last_inclusive,
                               .ndim = scene->ndim,
                               .filter_error = filter_error};
    edges->at = hs_alloc(account, HS_FOR_CANDIDATES, 3 * n, sizeof(double));
    if (edges->at == NULL) {
        return HS_ERR_MEMORY;
    }
    edges->lower = edges->at + n;
    edges->upper = edges->lower + n;
    for (int64_t k = 0; k < n; k++) {
        const double given = histogram->edges[k], scaled = hs_scale_apply(scene->scale, given);
        /* Scaling may have rounded or flushed it. */
        const double loss = scene->extreme && given > 0.0 ? HS_SCALING_LOSS : 0.0;
        edges->at[k] = scene->extreme ? given : scaled;
        edges->lower[k] = scaled - loss;
        edges->upper[k] = scaled + loss;
    }
    return HS_OK;
}

static void
set_bands(const histogram_edges *edges, double extent, edge_table *table)
{
    for (int64_t k = 0; k < edges->n; k++) {
        const double lower = edges->lower[k], upper = edges->upper[k];
        if (edges->at[k] == 0.0 && !is_inclusive(edges, k)) {
            table->in[k] = table->out[k] = -1.0f; /* no distance is below zero */
            continue;
        }
        const hs_thresholds near =
            hs_thresholds_of(edges->ndim, upper, extent, edges->filter_error);
        table->out[k] = near.out;
        table->in[k] = near.in;
        if (lower != upper) {
            table->in[k] =
                lower > 0.0 ? hs_thresholds_of(edges->ndim, lower, extent, edges->filter_error).in
                            : -1.0f;
        }
    }
}

/* The cell of a square that is not negative, and no larger than the end of the last band. */
static int32_t
cell_of(const edge_table *table, float square)
{
    const int32_t cell = (int32_t)(hs_bits_of_float(square) >> table->shift) - table->first;
    HS_ASSERT(square >= 0.0f && cell <= table->last);
    return cell < 0 ? 0 : cell;
}

/* Makes cells of 2^shift neighbouring floats each, from the first band that ends above zero to the
 * last. Returns how many pairs of bands share a cell although they do not overlap. */
static int64_t
set_cells(const histogram_edges *edges, int shift, edge_table *table)
{
    int64_t k = 0, shared = 0;
    while (k < edges->n - 1 && table->out[k] < 0.0f) {
        k++;
    }
    const float lowest = table->out[k] < 0.0f ? 0.0f : table->out[k];
    const float highest = table->out[edges->n - 1] < 0.0f ? 0.0f : table->out[edges->n - 1];
    table->shift = shift;
    table->first = (int32_t)(hs_bits_of_float(lowest) >> shift);
    table->last = (int32_t)(hs_bits_of_float(highest) >> shift) - table->first;
    if (table->last >= MOST_CELLS) {
        table->first += table->last - (MOST_CELLS - 1);
        table->last = MOST_CELLS - 1;
    }
    for (; k + 1 < edges->n; k++) {
        const float in = table->in[k + 1], out = table->out[k];
        shared += in > out && cell_of(table, in) == cell_of(table, out);
    }
    return shared;
}

static void
fill_cells(const histogram_edges *edges, edge_table *table)
{
    int64_t below = 0, reached = 0; /* bands that end before the cell, or begin before its end */
    for (int32_t c = 0; c <= table->last; c++) {
        const uint32_t at = (uint32_t)(table->first + c);
        const float    least = c == 0 ? 0.0f : hs_float_of_bits(at << table->shift);
        const float    most = hs_float_of_bits(((at + 1) << table->shift) - 1);
        while (below < edges->n && table->out[below] < least) {
            below++;
        }
        while (reached < edges->n && (c == table->last || table->in[reached] <= most)) {
            reached++;
        }
        edge_cell *cell = &table->cells[c];
        cell->slot = (int32_t)(2 * below);
        cell->n_bands = (int32_t)(reached - below);
        cell->in = cell->n_bands == 0 ? INT32_MAX : 0;
        cell->out = INT32_MAX;
        if (cell->n_bands == 1) {
            cell->in = table->in[below] < 0.0f ? 0 : (int32_t)hs_bits_of_float(table->in[below]);
            cell->out = (int32_t)hs_bits_of_float(table->out[below]); /* not below `least` */
        }
    }
}

static void
free_table(edge_table *table)
{
    hs_free(NULL, table->cells);
    hs_free(NULL, table->in);
    *table = (edge_table){0};
}

/* Replaces the table by one for this extent (the sum of the largest |y_k| and |q_k|). Called by
 * threads as they go, so no account is charged for its memory: at most 8 bytes an edge, and a
 * megabyte. */
static hs_status
build_table(const histogram_edges *edges, double extent, edge_table *table)
{
    free_table(table);
    table->in = hs_alloc(NULL, HS_FOR_CANDIDATES, 2 * edges->n, sizeof(float));
    if (table->in == NULL) {
        return HS_ERR_MEMORY;
    }
    table->out = table->in + edges->n;
    set_bands(edges, extent, table);
    if (!(4.0 * edges->ndim * extent * extent <= FLT_MAX)) { /* four times the largest square */
        table->extent = extent;
        return HS_OK;
    }
    const int64_t few = edges->n / 64; /* the last bins share first, and have the most pairs */
    if (set_cells(edges, FEW_CELLS, table) > few && set_cells(edges, MANY_CELLS, table) > few) {
        (void)set_cells(edges, ALL_CELLS, table); /* as few cells as keep most bands apart */
    }
    table->cells = hs_alloc(NULL, HS_FOR_CANDIDATES, (int64_t)table->last + 1, sizeof(edge_cell));
    if (table->cells == NULL) {
        return HS_ERR_MEMORY;
    }
    fill_cells(edges, table);
    table->extent = extent;
    return HS_OK;
}

/* The slots of n squares, all of them from neighbourhoods up to the table's extent and !(s > out)
 * for the last edge there. Returns whether any is odd. */
static bool
find_slots(const edge_table *table, const float *squares, int32_t n, int32_t *slots)
{
    const edge_cell *cells = table->cells;
    const int32_t    first = table->first;
    const int        shift = table->shift;
    int32_t          odd = cells == NULL;
    for (int32_t h = 0; cells == NULL && h < n; h++) {
        slots[h] = 1;
    }
    for (int32_t h = 0; cells != NULL && h < n; h++) {
        const int32_t    bits = (int32_t)hs_bits_of_float(squares[h]);
        const int32_t    at = (bits >> shift) - first;
        const edge_cell *cell = &cells[at < 0 ? 0 : at];
        /* Differences of these do not overflow; their sign bits count. */
        const uint32_t below = (uint32_t)(bits - cell->in) >> 31;
        const uint32_t above = (uint32_t)(cell->out - bits) >> 31;
        slots[h] = cell->slot + 1 - (int32_t)below + (int32_t)above;
        odd |= slots[h];
    }
    return (odd & 1) != 0;
}

/* The first edge of [low, high) whose limit is not below the square. */
static int32_t
first_not_below(const float *limits, int32_t low, int32_t high, float square)
{
    while (low < high) {
        const int32_t middle = low + (high - low) / 2;
        if (limits[middle] < square) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

/* For a square whose slot is odd: at least *low edges are reached, and at most *high. */
static void
find_range_of_edges(const edge_table *table, const histogram_edges *edges, float square,
                    int32_t *low, int32_t *high)
{
    if (table->cells == NULL) {
        *low = 0;
        *high = (int32_t)edges->n;
        return;
    }
    const edge_cell *cell = &table->cells[cell_of(table, square)];
    const int32_t    first = cell->slot / 2, end = first + cell->n_bands;
    *low = first_not_below(table->out, first, end, square);
    /* Edges with in <= s: up to the first with in > s. */
    *high = first_not_below(table->in, *low, end, nextafterf(square, INFINITY));
}

/*
 * Exact sums of products of two floats, rounded once at the end, so that neither the order of the
 * terms nor the threads that add them can change a bit.
 *
 * A weight is an integer times a power of two. Each sum is a long integer in steps of 32 bits, kept
 * in limbs of 64: what is carried stays where it arose until 2^30 products have been added.
 */

/* The weights of a set of points: value[i] * 2^(place[i] + exponent). */
typedef struct point_weights {
    int64_t *value; /* owned, n; below 2^62 in size. NULL: all weights are 1 */
    int32_t *place; /* owned, n; from 0 on. NULL: all 0 */
    int      exponent;
    int      bits;       /* at least the number of bits of every value, ... */
    int      most_place; /* ... and the largest place */
} point_weights;

/* n sums; owned by one thread. */
typedef struct exact_sums {
    int64_t  n;
    int32_t  n_limbs;
    int      exponent; /* of their lowest bit */
    int64_t *limbs;    /* owned; n_limbs of each, lowest first */
    int64_t  n_added;  /* products added since carries were last passed on */
} exact_sums;

#define VALUE_BITS 62    /* of a weight, at most */
#define SUM_BITS   64    /* that 2^62 terms and a sign add to those of a term */
#define LOWEST     -1074 /* exponent of the smallest float64 */

/* A float64 that is not zero as an odd integer times a power of two. */
static int64_t
odd_part(double x, int *exponent)
{
    const double  mantissa = frexp(x, exponent);
    const int64_t whole = (int64_t)ldexp(mantissa, 53);
    const int     zeros = hs_trailing_zeros((uint64_t)(whole < 0 ? -whole : whole));
    *exponent += zeros - 53;
    return whole / (INT64_C(1) << zeros);
}

/* Weight order[i] of the caller, finite or HS_ERR_WEIGHTS, becomes number i. NULL: all are 1. */
static hs_status
init_weights(hs_account *account, const double *weights, const int32_t *order, int64_t n,
             point_weights *taken, hs_failure *failure)
{
    int  lowest = 0, highest = 0; /* exponents of the lowest and of the highest bit of any */
    bool any = false;
    *taken = (point_weights){.bits = 1};
    for (int64_t i = 0; weights != NULL && i < n; i++) {
        int exponent, above;
        if (!isfinite(weights[i])) {
            failure->row = i;
            failure->value = weights[i];
            return HS_ERR_WEIGHTS;
        }
        if (weights[i] != 0.0) {
            (void)odd_part(weights[i], &exponent);
            (void)frexp(weights[i], &above);
            lowest = any && lowest < exponent ? lowest : exponent;
            highest = any && highest > above ? highest : above;
            any = true;
        }
    }
    if (weights == NULL) {
        return HS_OK;
    }
    /* As integers of one exponent where 62 bits hold them, else each with a place of its own. */
    const bool one_place = highest - lowest <= VALUE_BITS;
    taken->exponent = lowest;
    taken->bits = one_place ? highest - lowest : 53;
    taken->most_place = one_place ? 0 : highest - lowest;
    taken->value = hs_alloc(account, HS_FOR_POINTS, n, sizeof(int64_t));
    taken->place = one_place ? NULL : hs_alloc(account, HS_FOR_POINTS, n, sizeof(int32_t));
    if (taken->value == NULL || (!one_place && taken->place == NULL)) {
        return HS_ERR_MEMORY;
    }
    for (int64_t i = 0; i < n; i++) {
        const double weight = weights[order[i]];
        int          exponent = lowest;
        int64_t      value = 0;
        if (weight != 0.0 && isfinite(weight)) {
            value = odd_part(weight, &exponent);
        }
        /* Another thread may write to the weights meanwhile: places are kept in range. */
        int place = exponent < lowest ? 0 : exponent - lowest;
        place = place > highest - lowest ? highest - lowest : place;
        taken->value[i] = one_place ? (int64_t)((uint64_t)value << place) : value;
        if (!one_place) {
            taken->place[i] = place;
        }
    }
    return HS_OK;
}

/* Zeros, for products of these two. As many counts have been allocated: no product overflows. */
static hs_status
init_sums(hs_account *account, int64_t n, const point_weights *a, const point_weights *b,
          exact_sums *sums)
{
    const int most_place = a->most_place + b->most_place;
    const int for_bits = (a->bits + b->bits + most_place + SUM_BITS) / 32 + 1;
    const int for_place = most_place / 32 + 5; /* what add_product writes to */
    *sums = (exact_sums){.n = n,
                         .n_limbs = for_bits > for_place ? for_bits : for_place,
                         .exponent = a->exponent + b->exponent};
    sums->limbs = hs_alloc(account, HS_FOR_CANDIDATES, n * sums->n_limbs, sizeof(int64_t));
    if (sums->limbs == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(sums->limbs, 0, (size_t)(n * sums->n_limbs) * sizeof(int64_t));
    return HS_OK;
}

/* Passes on what was carried in every sum: limbs are of 32 bits then but for the highest one, which
 * has the sign. */
static void
carry_sums(exact_sums *sums)
{
    for (int64_t k = 0; k < sums->n; k++) {
        int64_t *limbs = sums->limbs + k * sums->n_limbs;
        for (int32_t e = 0; e + 1 < sums->n_limbs; e++) {
            const int64_t low = limbs[e] & INT64_C(0xffffffff);
            limbs[e + 1] += (limbs[e] - low) / (INT64_C(1) << 32);
            limbs[e] = low;
        }
    }
    sums->n_added = 0;
}

#ifdef HS_TESTING
#define MOST_ADDED INT64_C(50) /* so that small scenes have as many */
#else
#define MOST_ADDED (INT64_C(1) << 30)
#endif

/* Call before n products are added: passes on carries in time. */
HS_ALWAYS_INLINE void
expect_products(exact_sums *sums, int64_t n)
{
    if (HS_UNLIKELY(sums->n_added + n > MOST_ADDED)) {
        carry_sums(sums);
    }
    sums->n_added += n;
}

/* Adds a * b * 2^place to a sum, given by its limbs; below 2^62 in size each. */
HS_ALWAYS_INLINE void
add_product(int64_t *limbs, int64_t a, int64_t b, const int32_t place)
{
    const int64_t  sign = (a ^ b) >> 63; /* 0 or -1 */
    const uint64_t size_a = a < 0 ? 0 - (uint64_t)a : (uint64_t)a;
    const uint64_t size_b = b < 0 ? 0 - (uint64_t)b : (uint64_t)b;
    const int      shift = place & 31;
    uint64_t       high = 0;
    const uint64_t low = hs_multiply_add(size_a, size_b, 0, &high);
    const uint64_t lowest = low << shift, middle = high << shift | (low >> 1) >> (63 - shift);
    const uint64_t highest = (high >> 1) >> (63 - shift);
    limbs += place >> 5;
    limbs[0] += ((int64_t)(lowest & UINT32_MAX) ^ sign) - sign;
    limbs[1] += ((int64_t)(lowest >> 32) ^ sign) - sign;
    limbs[2] += ((int64_t)(middle & UINT32_MAX) ^ sign) - sign;
    limbs[3] += ((int64_t)(middle >> 32) ^ sign) - sign;
    if (place > 0) {
        limbs[4] += ((int64_t)highest ^ sign) - sign;
    }
}

/* Limbs of a sum, at most: for weights of 53 bits with places up to 2 * 2098 together. */
#define MOST_LIMBS 144

/* Sum k, rounded to nearest, ties to even; infinite beyond the range of float64. Call carry_sums
 * first. */
static double
round_sum(const exact_sums *sums, int64_t k)
{
    const int64_t *limbs = sums->limbs + k * sums->n_limbs;
    const bool     negative = limbs[sums->n_limbs - 1] < 0;
    uint64_t       digit[MOST_LIMBS + 2] = {0}, carry = negative; /* two zeros below the lowest */
    int32_t        top = 0;
    bool           more = false;
    HS_ASSERT(sums->n_limbs <= MOST_LIMBS);
    for (int32_t e = 2; e < sums->n_limbs + 2; e++) {
        /* Bits of |sum|: of two's complement, negated, and what is carried. */
        const uint32_t limb = (uint32_t)limbs[e - 2];
        const uint64_t next = (negative ? ~limb : limb) + carry;
        digit[e] = next & UINT32_MAX;
        carry = next >> 32;
        top = digit[e] != 0 ? e : top;
    }
    if (top == 0) {
        return 0.0;
    }
    for (int32_t e = 0; e < top - 2; e++) {
        more = more || digit[e] != 0;
    }
    /* 64 bits of the three highest digits, the highest one set, and where they begin. */
    const int      dropped = hs_bit_length(digit[top]);
    const uint64_t low = digit[top - 1] << 32 | digit[top - 2];
    const uint64_t leading = digit[top] << (64 - dropped) | low >> dropped;
    const int      exponent = sums->exponent + 32 * (top - 4) + dropped;
    more = more || (low & ((UINT64_C(1) << dropped) - 1)) != 0;
    const int lowest = exponent + 11 > LOWEST ? exponent + 11 : LOWEST; /* 53 bits, or fewer */
    const int shift = lowest - exponent;
    if (shift > 64) {
        return negative ? -0.0 : 0.0; /* below half of the smallest number */
    }
    const uint64_t half = UINT64_C(1) << (shift - 1);
    const uint64_t rest = shift < 64 ? leading & (2 * half - 1) : leading;
    uint64_t       kept = shift < 64 ? leading >> shift : 0;
    kept += rest > half || (rest == half && (more || (kept & 1)));
    return ldexp(negative ? -(double)kept : (double)kept, lowest);
}

/*
 * What one thread counts for a histogram. Hits come with their float32 squares; a table says which
 * slot each belongs to. Those that it cannot tell wait for the edge that halves their range, and
 * are decided exactly in batches.
 */

/* Types and weights of one set of points, in cell order. */
typedef struct marked_set {
    int32_t      *type; /* owned; NULL: all 0 */
    point_weights weights;
} marked_set;

#define TALLY_TABLES 4    /* extents that a walk may meet again; each a power of two */
#define TALLY_COPIES 4    /* of small histograms: counting does not wait for the last count */
#define TALLY_OPEN   1024 /* pairs that are decided together, at most */

/* A pair that is decided edge by edge: it reaches at least `low` edges and at most `high`. */
typedef struct open_pair {
    int32_t si, place;
    int32_t low, high;
    int32_t next; /* of those that wait for the same edge, or -1 */
} open_pair;

typedef struct thread_tally {
    const struct tally_plan *plan;                 /* borrowed */
    edge_table               tables[TALLY_TABLES]; /* owned; place: exponent of the extent */
    int64_t                  n_slots;              /* of one group */
    int                      n_copies;
    int64_t                 *counts;  /* owned; n_copies * n_groups * n_slots */
    exact_sums               sums;    /* owned; n_groups * (edges + 1) */
    void                    *arrays;  /* owned; in it: */
    int32_t                 *slots;   /* of the hits of a visit */
    int32_t                 *type;    /* of each candidate of the block; or NULL */
    int64_t                 *value;   /* of each candidate: its weight; or NULL */
    int32_t                 *place;   /* of each candidate: the place of its weight; or NULL */
    open_pair               *open;    /* TALLY_OPEN */
    int32_t                 *waiting; /* for each edge the first open pair, or -1 */
    int32_t                 *asked;   /* edges that pairs wait for, TALLY_OPEN */
    int32_t                  n_open, n_asked;
    int64_t                  block; /* number of the block that types and weights are of */
} thread_tally;

/* What all threads count by, only read while they do. */
typedef struct tally_plan {
    hs_search        *search;          /* borrowed */
    histogram_edges   edges;           /* owned */
    marked_set        points, queries; /* owned */
    const marked_set *asking;          /* one of these two */
    bool              has_types, sums; /* whether types matter; whether weights are summed */
    int32_t           n_types;
    int64_t           n_groups; /* pairs of types that are told apart */
    int32_t          *group;    /* owned; n_types * n_types; when has_types */
    thread_tally      all;      /* owned: of the threads that have ended; its plan is NULL before */
} tally_plan;

/* Point i of the set has the caller's number order[i]. HS_ERR_TYPES or HS_ERR_WEIGHTS set
 * failure->row. */
static hs_status
marked_init(hs_account *account, const hs_set *known, const int32_t *order, int64_t n,
            const tally_plan *plan, marked_set *marked, hs_failure *failure)
{
    const hs_set set = hs_set_with(NULL, known);
    *marked = (marked_set){.type = NULL};
    hs_status status =
        init_weights(account, plan->sums ? set.weights : NULL, order, n, &marked->weights, failure);
    if (status != HS_OK || set.types == NULL || !plan->has_types) {
        return status;
    }
    marked->type = hs_alloc(account, HS_FOR_POINTS, n, sizeof(int32_t));
    if (marked->type == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t i = 0; i < n; i++) {
        marked->type[i] = set.types[order[i]];
        if (marked->type[i] < 0 || marked->type[i] >= plan->n_types) {
            failure->row = order[i];
            failure->value = marked->type[i];
            return HS_ERR_TYPES;
        }
    }
    return HS_OK;
}

/* Slots up to which a histogram has copies: those of ten bins. With three bins they take 0.82 to
 * 0.88 of the time, with a hundred or more 0.99 to 1.07 (AVX-512; 52 and 419 neighbours). */
#define FEW_SLOTS 24

static hs_status
open_tally(void *context, void *state, const hs_walker *walker)
{
    const tally_plan *plan = context;
    thread_tally     *tally = state;
    *tally = (thread_tally){.plan = plan, .n_slots = 2 * plan->edges.n + 1, .block = -1};
    tally->n_copies = !plan->has_types && tally->n_slots <= FEW_SLOTS ? TALLY_COPIES : 1;
    const hs_block *block = &walker->scanner.block;
    hs_account     *account = &plan->search->call->account;
    const int64_t   n_counts = tally->n_copies * plan->n_groups * tally->n_slots;
    hs_parts        parts;
    hs_parts_begin(&parts);
    hs_parts_add(&parts, (void **)&tally->slots, block->most_hits, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&tally->open, TALLY_OPEN, sizeof(open_pair));
    hs_parts_add(&parts, (void **)&tally->asked, TALLY_OPEN, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&tally->waiting, plan->edges.n, sizeof(int32_t));
    if (plan->has_types) {
        hs_parts_add(&parts, (void **)&tally->type, block->capacity, sizeof(int32_t));
    }
    if (plan->sums) {
        hs_parts_add(&parts, (void **)&tally->value, block->capacity, sizeof(int64_t));
        hs_parts_add(&parts, (void **)&tally->place, block->capacity, sizeof(int32_t));
    }
    tally->counts = hs_alloc(account, HS_FOR_CANDIDATES, n_counts, sizeof(int64_t));
    tally->arrays = hs_parts_alloc(account, HS_FOR_CANDIDATES, &parts);
    if (tally->counts == NULL || tally->arrays == NULL ||
        (plan->sums &&
         init_sums(account, plan->n_groups * (plan->edges.n + 1), &plan->asking->weights,
                   &plan->points.weights, &tally->sums) != HS_OK)) {
        return HS_ERR_MEMORY;
    }
    memset(tally->counts, 0, (size_t)n_counts * sizeof(int64_t));
    for (int64_t k = 0; k < plan->edges.n; k++) {
        tally->waiting[k] = -1;
    }
    return HS_OK;
}

static void
free_tally(hs_account *account, thread_tally *tally)
{
    for (int e = 0; e < TALLY_TABLES; e++) {
        free_table(&tally->tables[e]);
    }
    hs_free(account, tally->counts);
    hs_free(account, tally->arrays);
    hs_free(account, tally->sums.limbs);
}

/* Adds what the thread has counted to what those before have: the first one has counts, or there is
 * no other. */
static void
close_tally(void *context, void *state)
{
    tally_plan   *plan = context;
    thread_tally *tally = state, *all = &plan->all;
    if (all->plan == NULL) {
        *all = *tally;
        return;
    }
    const int64_t n_counts = all->n_copies * plan->n_groups * all->n_slots;
    for (int64_t e = 0; tally->counts != NULL && e < n_counts; e++) {
        all->counts[e] += tally->counts[e];
    }
    if (all->sums.limbs != NULL && tally->sums.limbs != NULL) {
        carry_sums(&all->sums);
        carry_sums(&tally->sums);
        for (int64_t e = 0; e < all->sums.n * all->sums.n_limbs; e++) {
            all->sums.limbs[e] += tally->sums.limbs[e];
        }
    }
    free_tally(&plan->search->call->account, tally);
}

/* The table for groups up to this extent, rounded up to a power of two so that there are few. */
static const edge_table *
table_for(thread_tally *tally, double extent)
{
    int exponent = 0;
    if (!(extent > 0.0) || !isfinite(extent)) { /* NaN, with which nothing is sure, or one point */
        extent = extent == 0.0 ? 0x1p-1000 : INFINITY;
    } else if (frexp(extent, &exponent) > 0.5) {
        extent = ldexp(1.0, exponent);
    }
    edge_table *table = &tally->tables[(unsigned)exponent % TALLY_TABLES];
    if (table->extent != extent && build_table(&tally->plan->edges, extent, table) != HS_OK) {
        return NULL;
    }
    return table;
}

/* The group of pairs of point si and this candidate, by their types. */
static int64_t
group_of(const thread_tally *tally, int32_t si, int32_t place)
{
    const tally_plan *plan = tally->plan;
    return plan->has_types
               ? plan->group[(int64_t)plan->asking->type[si] * plan->n_types + tally->type[place]]
               : 0;
}

static int64_t
weight_of(const thread_tally *tally, int32_t si, int32_t *place)
{
    const point_weights *weights = &tally->plan->asking->weights;
    *place = weights->place != NULL ? weights->place[si] : 0;
    return weights->value != NULL ? weights->value[si] : 1;
}

/* The sum of a group for pairs that reach so many edges. */
static int64_t *
limbs_of(const thread_tally *tally, int64_t group, int32_t n_reached)
{
    const int64_t n_bins = tally->plan->edges.n + 1;
    return tally->sums.limbs + (group * n_bins + n_reached) * tally->sums.n_limbs;
}

/* Counts hits [begin, end) of point si; without types those of all points. */
static void
count_hits(thread_tally *tally, int32_t si, const int32_t *places, int32_t begin, int32_t end)
{
    const int32_t *slots = tally->slots;
    const int64_t  n_slots = tally->n_slots;
    int64_t       *counts = tally->counts;
    int32_t        h = begin;
    for (; tally->n_copies == TALLY_COPIES && h + TALLY_COPIES <= end; h += TALLY_COPIES) {
        counts[slots[h]]++;
        counts[n_slots + slots[h + 1]]++;
        counts[2 * n_slots + slots[h + 2]]++;
        counts[3 * n_slots + slots[h + 3]]++;
    }
    for (; h < end; h++) {
        counts[group_of(tally, si, places[h]) * n_slots + slots[h]]++;
    }
}

/* Sums weights of the hits of point si whose slots are even; those beyond the last edge add to a
 * sum that is never read. has_places: otherwise all places of weights are 0. */
HS_ALWAYS_INLINE void
sum_hits(thread_tally *tally, int32_t si, const int32_t *places, int32_t begin, int32_t end,
         const bool has_places)
{
    int32_t        own_place;
    const int64_t  own = weight_of(tally, si, &own_place), *value = tally->value;
    const int64_t  n_limbs = tally->sums.n_limbs;
    const int32_t *slots = tally->slots;
    int64_t       *first = tally->sums.limbs;
    expect_products(&tally->sums, end - begin);
    for (int32_t h = begin; h < end; h++) {
        const int32_t place = has_places ? own_place + tally->place[places[h]] : 0;
        if (!(slots[h] & 1)) {
            int64_t *limbs = tally->plan->has_types
                                 ? limbs_of(tally, group_of(tally, si, places[h]), slots[h] / 2)
                                 : first + slots[h] / 2 * n_limbs;
            add_product(limbs, own, value[places[h]], place);
        }
    }
}

/* An open pair whose range is empty is decided; others wait for the edge in the middle. */
static void
count_or_wait(thread_tally *tally, int32_t u)
{
    open_pair *pair = &tally->open[u];
    if (pair->low < pair->high) {
        const int32_t edge = pair->low + (pair->high - pair->low) / 2;
        if (tally->waiting[edge] < 0) {
            tally->asked[tally->n_asked++] = edge;
        }
        pair->next = tally->waiting[edge];
        tally->waiting[edge] = u;
        return;
    }
    const int64_t group = group_of(tally, pair->si, pair->place);
    if (tally->plan->sums) {
        int32_t       place;
        const int64_t value = weight_of(tally, pair->si, &place);
        expect_products(&tally->sums, 1);
        add_product(limbs_of(tally, group, pair->low), value, tally->value[pair->place],
                    place + tally->place[pair->place]);
    }
    tally->counts[group * tally->n_slots + 2 * pair->low]++;
}

static hs_status
decide_edge(thread_tally *tally, hs_scanner *scanner, int32_t edge)
{
    const hs_metric       *given = &scanner->search->scene.metric;
    const histogram_edges *edges = &tally->plan->edges;
    hs_pair_batch         *pair_batch = &scanner->pair_batch;
    hs_metric              metric;
    uint8_t                within[HS_BATCH];
    int32_t                u = tally->waiting[edge], end;
    tally->waiting[edge] = -1;
    hs_metric_init(&metric, given->ndim, given->n_rows, (const double(*)[HS_MAX_DIM])given->rows,
                   edges->at[edge], is_inclusive(edges, edge));
    while (u >= 0) {
        hs_pair_batch_clear(pair_batch);
        for (end = u; end >= 0 && pair_batch->n < HS_BATCH; end = tally->open[end].next) {
            hs_pair_batch_put(pair_batch, tally->open[end].si, tally->open[end].place);
        }
        const hs_status status = hs_pair_batch_look_up(pair_batch, true, &scanner->failed_point);
        if (status != HS_OK) {
            return status;
        }
        hs_decide_pair_batch(scanner, &metric, within);
        for (int32_t e = 0; u != end; e++) {
            open_pair    *pair = &tally->open[u];
            const int32_t next = pair->next;
            if (within[e]) {
                pair->high = edge;
            } else {
                pair->low = edge + 1;
            }
            count_or_wait(tally, u);
            u = next;
        }
    }
    return HS_OK;
}

static hs_status
decide_open(thread_tally *tally, hs_scanner *scanner)
{
    hs_status status = HS_OK;
    scanner->n_ambiguous += tally->n_open;
    for (int32_t u = 0; u < tally->n_open; u++) {
        count_or_wait(tally, u);
    }
    while (status == HS_OK && tally->n_asked > 0) {
        status = decide_edge(tally, scanner, tally->asked[--tally->n_asked]);
    }
    tally->n_open = 0;
    return status;
}

/* Looks again at hits with odd slots. */
static hs_status
look_again(thread_tally *tally, hs_scanner *scanner, const edge_table *table, int32_t first,
           const hs_hits *hits)
{
    hs_status status = HS_OK;
    for (int32_t t = 0, h = 0; t < hits->n; t++) {
        for (; h < hits->end[t]; h++) {
            if (!(tally->slots[h] & 1)) {
                continue;
            }
            open_pair *pair = &tally->open[tally->n_open];
            *pair = (open_pair){.si = first + t, .place = hits->label[h]};
            find_range_of_edges(table, &tally->plan->edges, scanner->block.squares[h], &pair->low,
                                &pair->high);
            if (pair->low == pair->high) { /* of a cell with several bands, but in none of these */
                count_or_wait(tally, tally->n_open);
            } else if (++tally->n_open == TALLY_OPEN) {
                status = decide_open(tally, scanner);
            }
            if (status != HS_OK) {
                return status;
            }
        }
    }
    return decide_open(tally, scanner);
}

/* A hs_visit_fn for HS_BLOCK_LISTS_SQUARES. */
static hs_status
tally_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    thread_tally        *tally = context;
    const hs_block      *block = &scanner->block;
    const point_weights *weights = &tally->plan->points.weights;
    const edge_table    *table = table_for(tally, scanner->form->extent);
    const int32_t        n = hits->end[hits->n - 1];
    const bool           is_new = tally->block != scanner->n_blocks;
    if (table == NULL) {
        return HS_ERR_MEMORY;
    }
    /* Types and weights of the candidates, once for each block. */
    tally->block = scanner->n_blocks;
    for (int32_t c = 0; is_new && tally->value != NULL && c < block->n; c++) {
        const int32_t si = block->number[c];
        tally->value[c] = weights->value != NULL ? weights->value[si] : 1;
        tally->place[c] = weights->place != NULL ? weights->place[si] : 0;
    }
    for (int32_t c = 0; is_new && tally->type != NULL && c < block->n; c++) {
        tally->type[c] = tally->plan->points.type[block->number[c]];
    }
    const bool has_places = weights->place != NULL || tally->plan->asking->weights.place != NULL;
    const bool is_open = find_slots(table, block->squares, n, tally->slots);
    if (!tally->plan->has_types) {
        count_hits(tally, first, hits->label, 0, n);
    }
    for (int32_t t = 0, begin = 0; t < hits->n; t++) {
        const int32_t end = hits->end[t];
        if (tally->plan->has_types) {
            count_hits(tally, first + t, hits->label, begin, end);
        }
        if (tally->plan->sums && has_places) {
            sum_hits(tally, first + t, hits->label, begin, end, true);
        } else if (tally->plan->sums) {
            sum_hits(tally, first + t, hits->label, begin, end, false);
        }
        begin = end;
    }
    return is_open ? look_again(tally, scanner, table, first, hits) : HS_OK;
}

/* Edges, types and weights in the order of the cells, before any thread counts. */
static hs_status
open_plan(const hs_histogram *histogram, const hs_sets *sets, tally_plan *plan, hs_failure *failure)
{
    hs_search  *search = plan->search;
    hs_account *account = &search->call->account;
    plan->has_types = histogram->n_types > 1;
    plan->n_types = histogram->n_types;
    plan->sums = histogram->sums != NULL;
    plan->asking = search->has_queries ? &plan->queries : &plan->points;
    hs_status status =
        edges_init(account, &search->scene, search->filter_error, histogram, &plan->edges);
    if (status == HS_OK) {
        status = marked_init(account, sets->of_points, search->bins.order, search->bins.n, plan,
                             &plan->points, failure);
    }
    if (status == HS_OK && search->has_queries) {
        status = marked_init(account, sets->of_queries, search->query_bins.order,
                             search->query_bins.n, plan, &plan->queries, failure);
        failure->in_queries = status == HS_ERR_TYPES || status == HS_ERR_WEIGHTS;
    }
    if (status == HS_OK && plan->has_types &&
        (plan->points.type == NULL || plan->asking->type == NULL)) {
        status = HS_ERR_TYPES;
    }
    /* Which pairs of types are told apart: all, but in the half list (a, b) and (b, a) are one. */
    const int64_t n = plan->n_types;
    plan->n_groups = search->has_queries ? n * n : n * (n + 1) / 2;
    if (status != HS_OK || !plan->has_types) {
        return status;
    }
    plan->group = plan->n_groups <= INT32_MAX
                      ? hs_alloc(account, HS_FOR_CANDIDATES, n * n, sizeof(int32_t))
                      : NULL;
    if (plan->group == NULL) {
        return HS_ERR_MEMORY;
    }
    int32_t next = 0;
    for (int64_t a = 0; a < n; a++) {
        for (int64_t b = 0; b < n; b++) {
            const bool again = !search->has_queries && b < a;
            plan->group[a * n + b] = again ? plan->group[b * n + a] : next;
            next += !again;
        }
    }
    return HS_OK;
}

hs_status
hs_histogram_fill(hs_search *search, const hs_histogram *histogram, const hs_sets *sets,
                  int64_t *n_pairs, hs_failure *failure)
{
    hs_account         *account = &search->call->account;
    tally_plan          plan = {.search = search};
    const hs_visitor    visitor = {.use = HS_BLOCK_LISTS_SQUARES,
                                   .visit = tally_hits,
                                   .shared = &plan,
                                   .state_size = sizeof(thread_tally),
                                   .open = open_tally,
                                   .close = close_tally};
    const thread_tally *all = &plan.all;
    const int64_t       n_types = histogram->n_types, n = histogram->n_edges;
    hs_status           status = open_plan(histogram, sets, &plan, failure);
    if (status == HS_OK) {
        status = hs_parallel_visit(search, &visitor, NULL, failure);
    }
    if (status == HS_OK && plan.sums) {
        carry_sums(&plan.all.sums);
    }
    for (int64_t at = 0; status == HS_OK && at < n_types * n_types; at++) {
        const bool    again = !search->has_queries && at % n_types < at / n_types;
        const int64_t group = plan.has_types ? plan.group[at] : 0;
        for (int64_t k = 0; k < n; k++) {
            int64_t count = 0;
            for (int copy = 0; copy < all->n_copies; copy++) {
                count += all->counts[(copy * plan.n_groups + group) * all->n_slots + 2 * k];
            }
            if (histogram->counts != NULL) {
                histogram->counts[at * n + k] = count;
            }
            if (plan.sums) {
                histogram->sums[at * n + k] = round_sum(&all->sums, group * (n + 1) + k);
            }
            *n_pairs += again ? 0 : count;
        }
    }
    free_tally(account, &plan.all);
    hs_free(account, plan.edges.at);
    for (int s = 0; s < 2; s++) {
        marked_set *set = s == 0 ? &plan.points : &plan.queries;
        hs_free(account, set->type);
        hs_free(account, set->weights.value);
        hs_free(account, set->weights.place);
    }
    hs_free(account, plan.group);
    return status;
}
