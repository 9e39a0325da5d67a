/* SPDX-License-Identifier: BSD-3-Clause */
#include "histogram.h"
#include "../collect/parallel.h"

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
    int64_t    n;      /* edges */
    float     *in;     /* owned, n: the band of each edge; ascending */
    float     *out;    /* in the memory of `in` */
    edge_cell *cells;  /* owned; NULL where squares may overflow: then nothing is sure */
    int        shift;  /* bits of a square that do not choose the cell */
    int32_t    first;  /* leading bits of the squares of cell 0 */
    int32_t    last;   /* number of the last cell */
} edge_table;

/* Bits of a float32 that do not choose its cell, in the order in which they are tried. For each
 * power of two there are 128 cells, which tell a hundred bins apart, or 2048 for a thousand, or
 * 32768. */
#define FEW_CELLS  16
#define MANY_CELLS 12
#define ALL_CELLS  8
#define MOST_CELLS (1 << 16) /* a megabyte; squares below these share cell 0 */

/* Edges and the bands around them. */
static void
set_bands(const hs_search *search, const hs_histogram *histogram, double extent, edge_table *table)
{
    const hs_scene *scene = &search->scene;
    for (int64_t k = 0; k < histogram->n_edges; k++) {
        const double given = histogram->edges[k], scaled = hs_scale_apply(scene->scale, given);
        /* Scaling may have rounded or flushed it. */
        const double loss = scene->extreme && given > 0.0 ? HS_SCALING_LOSS : 0.0;
        const double lower = scaled - loss, upper = scaled + loss;
        const bool   is_last = k == histogram->n_edges - 1;
        if (search->shells.at[k] == 0.0 &&
            !(is_last ? histogram->last_inclusive : histogram->inclusive)) {
            table->in[k] = table->out[k] = -1.0f; /* no distance is below zero */
            continue;
        }
        const hs_thresholds near =
            hs_thresholds_of(scene->ndim, upper, extent, search->filter_error);
        table->out[k] = near.out;
        table->in[k] = near.in;
        if (lower != upper) {
            table->in[k] =
                lower > 0.0 ? hs_thresholds_of(scene->ndim, lower, extent, search->filter_error).in
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
set_cells(int shift, edge_table *table)
{
    int64_t k = 0, shared = 0;
    while (k < table->n - 1 && table->out[k] < 0.0f) {
        k++;
    }
    const float lowest = table->out[k] < 0.0f ? 0.0f : table->out[k];
    const float highest = table->out[table->n - 1] < 0.0f ? 0.0f : table->out[table->n - 1];
    table->shift = shift;
    table->first = (int32_t)(hs_bits_of_float(lowest) >> shift);
    table->last = (int32_t)(hs_bits_of_float(highest) >> shift) - table->first;
    if (table->last >= MOST_CELLS) {
        table->first += table->last - (MOST_CELLS - 1);
        table->last = MOST_CELLS - 1;
    }
    for (; k + 1 < table->n; k++) {
        const float in = table->in[k + 1], out = table->out[k];
        shared += in > out && cell_of(table, in) == cell_of(table, out);
    }
    return shared;
}

static void
fill_cells(edge_table *table)
{
    int64_t below = 0, reached = 0; /* bands that end before the cell, or begin before its end */
    for (int32_t c = 0; c <= table->last; c++) {
        const uint32_t at = (uint32_t)(table->first + c);
        const float    least = c == 0 ? 0.0f : hs_float_of_bits(at << table->shift);
        const float    most = hs_float_of_bits(((at + 1) << table->shift) - 1);
        while (below < table->n && table->out[below] < least) {
            below++;
        }
        while (reached < table->n && (c == table->last || table->in[reached] <= most)) {
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
build_table(const hs_search *search, const hs_histogram *histogram, double extent,
            edge_table *table)
{
    const int64_t n = histogram->n_edges, few = n / 64; /* bins that may share a cell */
    free_table(table);
    table->in = hs_alloc(NULL, HS_FOR_CANDIDATES, 2 * n, sizeof(float));
    if (table->in == NULL) {
        return HS_ERR_MEMORY;
    }
    table->n = n;
    table->out = table->in + n;
    set_bands(search, histogram, extent, table);
    if (!(4.0 * search->scene.ndim * extent * extent <= FLT_MAX)) {
        table->extent = extent; /* four times the largest square overflows */
        return HS_OK;
    }
    /* The last bins share first, and have the most pairs. */
    if (set_cells(FEW_CELLS, table) > few && set_cells(MANY_CELLS, table) > few) {
        (void)set_cells(ALL_CELLS, table); /* as few cells as keep most bands apart */
    }
    table->cells = hs_alloc(NULL, HS_FOR_CANDIDATES, (int64_t)table->last + 1, sizeof(edge_cell));
    if (table->cells == NULL) {
        return HS_ERR_MEMORY;
    }
    fill_cells(table);
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
 * slot each belongs to. Those that it cannot tell are decided exactly in batches.
 */

/* Types and weights of one set of points, in cell order. */
typedef struct marked_set {
    int32_t      *type; /* owned; NULL: all 0 */
    point_weights weights;
} marked_set;

#define TALLY_TABLES 4 /* extents that a walk may meet again; each a power of two */
#define TALLY_COPIES 4 /* of small histograms: counting does not wait for the last count */

typedef struct thread_tally {
    const struct tally_plan *plan;                 /* borrowed */
    edge_table               tables[TALLY_TABLES]; /* owned; place: exponent of the extent */
    int64_t                  n_slots;              /* of one group */
    int                      n_copies;
    int64_t                 *counts; /* owned; n_copies * n_groups * n_slots */
    exact_sums               sums;   /* owned; n_groups * (edges + 1) */
    void                    *arrays; /* owned; in it: */
    int32_t                 *slots;  /* of the hits of a visit */
    int32_t                 *type;   /* of each candidate of the block; or NULL */
    int64_t                 *value;  /* of each candidate: its weight; or NULL */
    int32_t                 *place;  /* of each candidate: the place of its weight; or NULL */
    int64_t                  block;  /* number of the block that types and weights are of */
} thread_tally;

/* What all threads count by, only read while they do. */
typedef struct tally_plan {
    hs_search          *search; /* borrowed, as is the next; its shells are the edges */
    const hs_histogram *histogram;
    marked_set          points, queries; /* owned */
    const marked_set   *asking;          /* one of these two */
    bool                has_types, sums; /* whether types matter; whether weights are summed */
    int32_t             n_types;
    int64_t             n_groups; /* pairs of types that are told apart */
    int32_t            *group;    /* owned; n_types * n_types; when has_types */
    thread_tally        all; /* owned: of the threads that have ended; its plan is NULL before */
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
    const int64_t     n = plan->histogram->n_edges;
    thread_tally     *tally = state;
    *tally = (thread_tally){.plan = plan, .n_slots = 2 * n + 1, .block = -1};
    tally->n_copies = !plan->has_types && tally->n_slots <= FEW_SLOTS ? TALLY_COPIES : 1;
    const hs_block *block = &walker->scanner.block;
    hs_account     *account = &plan->search->call->account;
    const int64_t   n_counts = tally->n_copies * plan->n_groups * tally->n_slots;
    hs_parts        parts;
    hs_parts_begin(&parts);
    hs_parts_add(&parts, (void **)&tally->slots, block->most_hits, sizeof(int32_t));
    if (plan->has_types) {
        hs_parts_add(&parts, (void **)&tally->type, block->capacity, sizeof(int32_t));
    }
    if (plan->sums) {
        hs_parts_add(&parts, (void **)&tally->value, block->capacity, sizeof(int64_t));
        hs_parts_add(&parts, (void **)&tally->place, block->capacity, sizeof(int32_t));
    }
    tally->counts = hs_alloc(account, HS_FOR_CANDIDATES, n_counts, sizeof(int64_t));
    tally->arrays = hs_parts_alloc(account, HS_FOR_CANDIDATES, &parts);
    if (tally->counts == NULL || tally->arrays == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(tally->counts, 0, (size_t)n_counts * sizeof(int64_t));
    if (!plan->sums) {
        return HS_OK;
    }
    /* Zeros, for products of two weights; as many counts have been allocated: nothing overflows. */
    const point_weights *a = &plan->asking->weights, *b = &plan->points.weights;
    exact_sums          *sums = &tally->sums;
    const int            most_place = a->most_place + b->most_place;
    const int            for_bits = (a->bits + b->bits + most_place + SUM_BITS) / 32 + 1;
    const int            for_place = most_place / 32 + 5; /* what add_product writes to */
    sums->n = plan->n_groups * (n + 1);
    sums->n_limbs = for_bits > for_place ? for_bits : for_place;
    sums->exponent = a->exponent + b->exponent;
    sums->limbs = hs_alloc(account, HS_FOR_CANDIDATES, sums->n * sums->n_limbs, sizeof(int64_t));
    if (sums->limbs == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(sums->limbs, 0, (size_t)(sums->n * sums->n_limbs) * sizeof(int64_t));
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
    const int64_t n_bins = tally->plan->histogram->n_edges + 1;
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

/* Counts a pair that is beyond `low` edges and no more. */
static void
count_pair(thread_tally *tally, const hs_edge_pair *pair)
{
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

/* Looks again at hits with odd slots. */
static hs_status
look_again(thread_tally *tally, hs_scanner *scanner, const edge_table *table, int32_t first,
           const hs_hits *hits)
{
    const int32_t n = hits->end[hits->n - 1];
    hs_edge_pairs open; /* large: not cleared */
    hs_status     status = HS_OK;
    open.n = 0;
    for (int32_t h = 0, t = 0; h < n && status == HS_OK; h++) {
        while (hits->end[t] <= h) {
            t++;
        }
        if (tally->slots[h] & 1) {
            hs_edge_pair *pair = &open.pair[open.n];
            *pair =
                (hs_edge_pair){.si = first + t, .place = hits->label[h], .high = (int32_t)table->n};
            if (table->cells != NULL) {
                const float      square = scanner->block.squares[h];
                const edge_cell *cell = &table->cells[cell_of(table, square)];
                const int32_t    end = cell->slot / 2 + cell->n_bands;
                const float      next = hs_float_of_bits(hs_bits_of_float(square) + 1);
                pair->low = first_not_below(table->out, cell->slot / 2, end, square);
                /* Edges with in <= s: up to the first that is not below the next float. */
                pair->high = first_not_below(table->in, pair->low, end, next);
            }
            if (pair->low == pair->high) { /* of a cell with several bands, but in none of these */
                count_pair(tally, pair);
            } else {
                open.n++;
            }
        }
        if (open.n == HS_EDGE_PAIRS || h == n - 1) {
            status = hs_decide_edges(scanner, &open);
            for (int32_t u = 0; u < open.n && status == HS_OK; u++) {
                count_pair(tally, &open.pair[u]);
            }
            open.n = 0;
        }
    }
    return status;
}

/* A hs_visit_fn for HS_BLOCK_LISTS_SQUARES. */
static hs_status
tally_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    thread_tally        *tally = context;
    const hs_block      *block = &scanner->block;
    const point_weights *weights = &tally->plan->points.weights;
    const tally_plan    *plan = tally->plan;
    const int32_t        n = hits->end[hits->n - 1];
    const bool           is_new = tally->block != scanner->n_blocks;
    double               extent = scanner->form.extent; /* up to a power of two: there are few */
    int                  exponent = 0;
    if (!(extent > 0.0) || !isfinite(extent)) { /* NaN, with which nothing is sure, or one point */
        extent = extent == 0.0 ? 0x1p-1000 : INFINITY;
    } else if (frexp(extent, &exponent) > 0.5) {
        extent = ldexp(1.0, exponent);
    }
    edge_table *table = &tally->tables[(unsigned)exponent % TALLY_TABLES];
    if (table->extent != extent &&
        build_table(plan->search, plan->histogram, extent, table) != HS_OK) {
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
        tally->type[c] = plan->points.type[block->number[c]];
    }
    const bool has_places = weights->place != NULL || plan->asking->weights.place != NULL;
    const bool is_open = find_slots(table, block->squares, n, tally->slots);
    if (!plan->has_types) {
        count_hits(tally, first, hits->label, 0, n);
    }
    for (int32_t t = 0, begin = 0; t < hits->n; t++) {
        const int32_t end = hits->end[t];
        if (plan->has_types) {
            count_hits(tally, first + t, hits->label, begin, end);
        }
        if (plan->sums && has_places) {
            sum_hits(tally, first + t, hits->label, begin, end, true);
        } else if (plan->sums) {
            sum_hits(tally, first + t, hits->label, begin, end, false);
        }
        begin = end;
    }
    return is_open ? look_again(tally, scanner, table, first, hits) : HS_OK;
}

/* Edges, types and weights in the order of the cells, before any thread counts. */
static hs_status
open_plan(const hs_sets *sets, tally_plan *plan, hs_failure *failure)
{
    const hs_histogram *histogram = plan->histogram;
    hs_search          *search = plan->search;
    hs_shells          *shells = &search->shells;
    hs_account         *account = &search->call->account;
    plan->has_types = histogram->n_types > 1;
    plan->n_types = histogram->n_types;
    plan->sums = histogram->sums != NULL;
    plan->asking = search->has_queries ? &plan->queries : &plan->points;
    shells->n = histogram->n_edges - 1; /* the last one is the cutoff */
    shells->inclusive = histogram->inclusive;
    shells->memory = shells->at =
        hs_alloc(account, HS_FOR_CANDIDATES, histogram->n_edges, sizeof *shells->at);
    if (shells->memory == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t k = 0; k < histogram->n_edges; k++) {
        shells->at[k] = search->scene.extreme
                            ? histogram->edges[k]
                            : hs_scale_apply(search->scene.scale, histogram->edges[k]);
    }
    hs_status status = marked_init(account, sets->of_points, search->bins.order, search->bins.n,
                                   plan, &plan->points, failure);
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
    tally_plan          plan = {.search = search, .histogram = histogram};
    const hs_visitor    visitor = {.use = HS_BLOCK_LISTS_SQUARES,
                                   .visit = tally_hits,
                                   .shared = &plan,
                                   .state_size = sizeof(thread_tally),
                                   .open = open_tally,
                                   .close = close_tally};
    const thread_tally *all = &plan.all;
    const int64_t       n_types = histogram->n_types, n = histogram->n_edges;
    hs_status           status = open_plan(sets, &plan, failure);
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
    for (int s = 0; s < 2; s++) {
        marked_set *set = s == 0 ? &plan.points : &plan.queries;
        hs_free(account, set->type);
        hs_free(account, set->weights.value);
        hs_free(account, set->weights.place);
    }
    hs_free(account, plan.group);
    return status;
}
