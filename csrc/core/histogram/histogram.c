/* SPDX-License-Identifier: BSD-3-Clause */
#include "histogram.h"
#include "../collect/parallel.h"
#include "../exact/filter.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* histogram.c: edges and their bands become a table, pairs are counted by it, weights are summed
 * without rounding, and threads' counts are joined. */

/* Bands are the filter's thresholds at each edge; the table is made as fine as keeps most
 * bands apart. */

/* Bits of a float32 that do not choose its cell, in the order in which they are tried. For each
 * power of two there are 128 cells, which tell a hundred bins apart, or 2048 for a thousand, or
 * 32768. Constants make the loop quicker. */
#define FEW_CELLS  16
#define MANY_CELLS 12
#define ALL_CELLS  8
#define MOST_CELLS (1 << 16) /* a megabyte; squares below these share cell 0 */

/* Edges of the histogram in the unit of the scene. */
static hs_status
edges_init(hs_account *account, const hs_scene *scene, double filter_error,
           const hs_histogram *histogram, hs_edges *edges)
{
    const int64_t n = histogram->n_edges;
    *edges = (hs_edges){.n = n,
                        .inclusive = histogram->inclusive,
                        .last_inclusive = histogram->last_inclusive,
                        .ndim = scene->ndim,
                        .filter_error = filter_error};
    edges->at = hs_alloc(account, HS_FOR_CANDIDATES, scene->extreme ? 3 * n : n, sizeof(double));
    if (edges->at == NULL) {
        return HS_ERR_MEMORY;
    }
    edges->lower = edges->upper = edges->at;
    if (scene->extreme) {
        edges->lower = edges->at + n;
        edges->upper = edges->lower + n;
    }
    for (int64_t k = 0; k < n; k++) {
        const double given = histogram->edges[k], scaled = hs_scale_apply(scene->scale, given);
        edges->at[k] = scene->extreme ? given : scaled;
        if (scene->extreme) { /* scaling may have rounded or flushed it */
            edges->lower[k] = given > 0.0 ? scaled - HS_SCALING_LOSS : 0.0;
            edges->upper[k] = given > 0.0 ? scaled + HS_SCALING_LOSS : 0.0;
        }
    }
    return HS_OK;
}

/* Sets the band of every edge. */
static void
set_bands(const hs_edges *edges, double extent, hs_edge_table *table)
{
    for (int64_t k = 0; k < edges->n; k++) {
        const double lower = edges->lower[k], upper = edges->upper[k];
        if (edges->at[k] == 0.0 && !hs_edge_is_inclusive(edges, k)) {
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
cell_of(const hs_edge_table *table, float square)
{
    const int32_t cell = (int32_t)(hs_bits_of_float(square) >> table->shift) - table->first;
    HS_ASSERT(square >= 0.0f && cell <= table->last);
    return cell < 0 ? 0 : cell;
}

/* Makes cells of 2^shift neighbouring floats each, from the first band that ends above zero to the
 * last. Returns how many pairs of bands share a cell although they do not overlap. */
static int64_t
set_cells(const hs_edges *edges, int shift, hs_edge_table *table)
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
fill_cells(const hs_edges *edges, hs_edge_table *table)
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
        hs_edge_cell *cell = &table->cells[c];
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

hs_status
hs_edge_table_build(const hs_edges *edges, double extent, hs_edge_table *table)
{
    hs_edge_table_free(table);
    table->in = hs_alloc(NULL, HS_FOR_CANDIDATES, 2 * edges->n, sizeof(float));
    if (table->in == NULL) {
        return HS_ERR_MEMORY;
    }
    table->out = table->in + edges->n;
    set_bands(edges, extent, table);
    table->extent = extent;
    if (!(4.0 * edges->ndim * extent * extent <= FLT_MAX)) { /* four times the largest square */
        return HS_OK;
    }
    const int64_t few = edges->n / 64; /* the last bins share first, and have the most pairs */
    if (set_cells(edges, FEW_CELLS, table) > few && set_cells(edges, MANY_CELLS, table) > few) {
        (void)set_cells(edges, ALL_CELLS, table); /* as few cells as keep most bands apart */
    }
    table->cells =
        hs_alloc(NULL, HS_FOR_CANDIDATES, (int64_t)table->last + 1, sizeof(hs_edge_cell));
    if (table->cells == NULL) {
        hs_edge_table_free(table);
        return HS_ERR_MEMORY;
    }
    fill_cells(edges, table);
    return HS_OK;
}

void
hs_edge_table_free(hs_edge_table *table)
{
    hs_free(NULL, table->cells);
    hs_free(NULL, table->in);
    *table = (hs_edge_table){0};
}

HS_ALWAYS_INLINE bool
find_slots(const hs_edge_table *table, const float *squares, int32_t n, int32_t *slots,
           const int shift)
{
    const hs_edge_cell *cells = table->cells;
    const int32_t       first = table->first;
    int32_t             odd = 0;
    for (int32_t h = 0; h < n; h++) {
        const int32_t       bits = (int32_t)hs_bits_of_float(squares[h]);
        const int32_t       at = (bits >> shift) - first;
        const hs_edge_cell *cell = &cells[at < 0 ? 0 : at];
        /* Differences of these do not overflow; their sign bits count. */
        const uint32_t below = (uint32_t)(bits - cell->in) >> 31;
        const uint32_t above = (uint32_t)(cell->out - bits) >> 31;
        slots[h] = cell->slot + 1 - (int32_t)below + (int32_t)above;
        odd |= slots[h];
    }
    return (odd & 1) != 0;
}

bool
hs_edge_slots(const hs_edge_table *table, const float *squares, int32_t n, int32_t *slots)
{
    if (table->cells == NULL) {
        for (int32_t h = 0; h < n; h++) {
            slots[h] = 1;
        }
        return true;
    }
    switch (table->shift) {
    case FEW_CELLS: return find_slots(table, squares, n, slots, FEW_CELLS);
    case MANY_CELLS: return find_slots(table, squares, n, slots, MANY_CELLS);
    default: return find_slots(table, squares, n, slots, ALL_CELLS);
    }
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

void
hs_edge_range(const hs_edge_table *table, const hs_edges *edges, float square, int32_t *low,
              int32_t *high)
{
    if (table->cells == NULL) {
        *low = 0;
        *high = (int32_t)edges->n;
        return;
    }
    const hs_edge_cell *cell = &table->cells[cell_of(table, square)];
    const int32_t       first = cell->slot / 2, end = first + cell->n_bands;
    *low = first_not_below(table->out, first, end, square);
    /* Edges with in <= s: up to the first with in > s. */
    *high = first_not_below(table->in, *low, end, nextafterf(square, INFINITY));
}

/* Weights to integers, carries between limbs, and the one rounding at the end. */

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

/* Exponents of the lowest and of the highest bit of any; 0 where all are zero. */
static hs_status
find_range(const double *weights, int64_t n, int *lowest, int *highest, hs_failure *failure)
{
    bool any = false;
    *lowest = *highest = 0;
    for (int64_t i = 0; i < n; i++) {
        int exponent, above;
        if (!isfinite(weights[i])) {
            failure->row = i;
            failure->value = weights[i];
            return HS_ERR_WEIGHTS;
        }
        if (weights[i] != 0.0) {
            (void)odd_part(weights[i], &exponent);
            (void)frexp(weights[i], &above);
            *lowest = any && *lowest < exponent ? *lowest : exponent;
            *highest = any && *highest > above ? *highest : above;
            any = true;
        }
    }
    return HS_OK;
}

/* Takes weights as integers of one exponent where 62 bits hold them, else each with a place of its
 * own. Another thread may write to the weights meanwhile: places are kept in range. */
static void
take_weights(const double *weights, const int32_t *order, int64_t n, hs_weights *taken)
{
    for (int64_t i = 0; i < n; i++) {
        const double weight = weights[order[i]];
        int          exponent = taken->exponent;
        int64_t      value = 0;
        if (weight != 0.0 && isfinite(weight)) {
            value = odd_part(weight, &exponent);
        }
        int place = exponent - taken->exponent;
        place = place < 0 ? 0 : place > taken->most_place ? taken->most_place : place;
        if (taken->place != NULL) {
            taken->value[i] = value;
            taken->place[i] = place;
        } else {
            taken->value[i] = (int64_t)((uint64_t)value << place);
        }
    }
}

hs_status
hs_weights_init(hs_account *account, const double *weights, const int32_t *order, int64_t n,
                hs_weights *taken, hs_failure *failure)
{
    int lowest, highest;
    *taken = (hs_weights){.bits = 1};
    if (weights == NULL) {
        return HS_OK;
    }
    const hs_status status = find_range(weights, n, &lowest, &highest, failure);
    if (status != HS_OK) {
        return status;
    }
    const bool one_place = highest - lowest <= VALUE_BITS;
    taken->exponent = lowest;
    taken->bits = one_place ? highest - lowest : 53;
    taken->most_place = highest - lowest;
    taken->value = hs_alloc(account, HS_FOR_POINTS, n, sizeof(int64_t));
    taken->place = one_place ? NULL : hs_alloc(account, HS_FOR_POINTS, n, sizeof(int32_t));
    if (taken->value == NULL || (!one_place && taken->place == NULL)) {
        hs_weights_free(account, taken);
        return HS_ERR_MEMORY;
    }
    take_weights(weights, order, n, taken);
    if (one_place) {
        taken->most_place = 0;
    }
    return HS_OK;
}

void
hs_weights_free(hs_account *account, hs_weights *weights)
{
    hs_free(account, weights->value);
    hs_free(account, weights->place);
    weights->value = NULL;
    weights->place = NULL;
}

hs_status
hs_sums_init(hs_account *account, int64_t n, const hs_weights *a, const hs_weights *b,
             hs_sums *sums)
{
    const int most_place = a->most_place + b->most_place;
    const int for_bits = (a->bits + b->bits + most_place + SUM_BITS) / 32 + 1;
    const int for_place = most_place / 32 + 5; /* what hs_sums_add writes to */
    *sums = (hs_sums){.n = n,
                      .n_limbs = for_bits > for_place ? for_bits : for_place,
                      .exponent = a->exponent + b->exponent};
    if (n > INT64_MAX / sums->n_limbs) {
        return HS_ERR_MEMORY;
    }
    sums->limbs = hs_alloc(account, HS_FOR_CANDIDATES, n * sums->n_limbs, sizeof(int64_t));
    if (sums->limbs == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(sums->limbs, 0, (size_t)(n * sums->n_limbs) * sizeof(int64_t));
    return HS_OK;
}

void
hs_sums_free(hs_account *account, hs_sums *sums)
{
    hs_free(account, sums->limbs);
    sums->limbs = NULL;
}

/* Limbs of 32 bits but for the highest one, which has the sign. */
void
hs_sums_carry(hs_sums *sums)
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

void
hs_sums_join(hs_sums *sums, hs_sums *more)
{
    hs_sums_carry(sums);
    hs_sums_carry(more);
    for (int64_t e = 0; e < sums->n * sums->n_limbs; e++) {
        sums->limbs[e] += more->limbs[e];
    }
    hs_sums_carry(sums);
}

/* top * 2^exponent, 2^63 <= top, and if `more` a little more, as a float64. */
static double
round_top(uint64_t top, bool more, int exponent)
{
    const int lowest = exponent + 11 > LOWEST ? exponent + 11 : LOWEST; /* 53 bits, or fewer */
    const int shift = lowest - exponent;
    if (shift > 64) {
        return 0.0; /* below half of the smallest number */
    }
    const uint64_t half = UINT64_C(1) << (shift - 1);
    const uint64_t rest = shift < 64 ? top & (2 * half - 1) : top;
    uint64_t       kept = shift < 64 ? top >> shift : 0;
    kept += rest > half || (rest == half && (more || (kept & 1)));
    return ldexp((double)kept, lowest);
}

double
hs_sums_round(const hs_sums *sums, int64_t k)
{
    const int64_t *limbs = sums->limbs + k * sums->n_limbs;
    const bool     negative = limbs[sums->n_limbs - 1] < 0;
    uint64_t       carry = negative, high = 0, low = 0; /* the last three digits so far */
    uint64_t       top_high = 0, top_low = 0;           /* the highest one that is not zero, and the
                                                           two below it */
    bool           any = false, any_below_top = false;  /* digits below these */
    int32_t        top = 0;
    for (int32_t e = 0; e < sums->n_limbs; e++) {
        /* Bits [32 e, 32 e + 32) of |sum|: of two's complement, negated, and what is carried. */
        const uint32_t limb = (uint32_t)limbs[e];
        const uint64_t next = (negative ? ~limb : limb) + carry;
        const uint32_t digit = (uint32_t)next;
        carry = next >> 32;
        any = any || (low & UINT32_MAX) != 0;
        low = low >> 32 | high << 32;
        high = digit;
        if (digit != 0) {
            top = e;
            top_high = high;
            top_low = low;
            any_below_top = any;
        }
    }
    if (top_high == 0) {
        return 0.0;
    }
    const int      dropped = hs_bit_length(top_high); /* of the 96 bits, to have 64 */
    const uint64_t leading = top_high << (64 - dropped) | top_low >> dropped;
    const bool     more = any_below_top || (top_low & ((UINT64_C(1) << dropped) - 1)) != 0;
    const double   size = round_top(leading, more, sums->exponent + 32 * (top - 2) + dropped);
    return negative ? -size : size;
}

/*
 * What one thread counts for a histogram. Hits come with their float32 squares; a table says which
 * slot each belongs to, and those that it cannot tell are decided exactly, edge by edge.
 */

/* Types and weights of one set of points, in cell order. */
typedef struct marked_set {
    int32_t   *type; /* owned; NULL: all 0 */
    hs_weights weights;
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
    hs_edge_table            tables[TALLY_TABLES]; /* owned; place: exponent of the extent */
    int64_t                  n_slots;              /* of one group */
    int                      n_copies;
    int64_t                 *counts; /* owned; n_copies * n_groups * n_slots */
    hs_sums                  sums;   /* owned; n_groups * (edges + 1) */
    int32_t                 *slots;  /* owned; of the hits of a visit */
    int32_t                 *type;   /* owned; of each candidate of the block; or NULL */
    int64_t                 *value;  /* owned; of each candidate: its weight; or NULL */
    int32_t                 *place; /* owned; of each candidate: the place of its weight; or NULL */
    int64_t                  block; /* number of the block that these are of */
    open_pair               *open;  /* owned; TALLY_OPEN */
    int32_t                  n_open;
    int32_t                 *waiting; /* owned; for each edge the first open pair, or -1 */
    int32_t                 *asked;   /* owned; edges that pairs wait for, TALLY_OPEN */
    int32_t                  n_asked;
} thread_tally;

/* What all threads count by, only read while they do. */
typedef struct tally_plan {
    hs_search        *search;          /* borrowed */
    hs_edges          edges;           /* owned */
    marked_set        points, queries; /* owned */
    const marked_set *asking;          /* one of these two */
    bool              has_types, sums; /* whether types matter; whether weights are summed */
    int32_t           n_types;
    int64_t           n_groups; /* pairs of types that are told apart */
    int32_t          *group;    /* owned; n_types * n_types; when has_types */
    bool              has_all;
    thread_tally      all; /* owned: of the threads that have ended */
} tally_plan;

/* Point i of the set has the caller's number order[i]. HS_ERR_TYPES or HS_ERR_WEIGHTS set
 * failure->row. */
static hs_status
marked_init(hs_account *account, const hs_set *known, const int32_t *order, int64_t n,
            const tally_plan *plan, marked_set *marked, hs_failure *failure)
{
    const hs_set set = hs_set_with(NULL, known);
    *marked = (marked_set){.type = NULL};
    hs_status status = hs_weights_init(account, plan->sums ? set.weights : NULL, order, n,
                                       &marked->weights, failure);
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

static void
marked_free(hs_account *account, marked_set *marked)
{
    hs_free(account, marked->type);
    hs_weights_free(account, &marked->weights);
}

/* Slots of all hits by table; hits that stay unsure wait for the edge that halves their
 * range, and a batch decides them. */

/* Slots up to which a histogram has copies: together they stay in the first-level cache. */
#define FEW_SLOTS 1024

static bool
allocate(thread_tally *tally, const hs_block *block)
{
    const tally_plan *plan = tally->plan;
    hs_account       *account = &plan->search->call->account;
    const int64_t     n_slots = tally->n_copies * plan->n_groups * tally->n_slots;
    tally->counts = hs_alloc(account, HS_FOR_CANDIDATES, n_slots, sizeof(int64_t));
    tally->slots = hs_alloc(account, HS_FOR_CANDIDATES, block->most_hits, sizeof(int32_t));
    tally->open = hs_alloc(account, HS_FOR_CANDIDATES, TALLY_OPEN, sizeof(open_pair));
    tally->asked = hs_alloc(account, HS_FOR_CANDIDATES, TALLY_OPEN, sizeof(int32_t));
    tally->waiting = hs_alloc(account, HS_FOR_CANDIDATES, plan->edges.n, sizeof(int32_t));
    bool complete = tally->counts != NULL && tally->slots != NULL && tally->open != NULL &&
                    tally->asked != NULL && tally->waiting != NULL;
    if (complete && plan->has_types) {
        tally->type = hs_alloc(account, HS_FOR_CANDIDATES, block->capacity, sizeof(int32_t));
        complete = tally->type != NULL;
    }
    if (complete && plan->sums) {
        tally->value = hs_alloc(account, HS_FOR_CANDIDATES, block->capacity, sizeof(int64_t));
        tally->place = hs_alloc(account, HS_FOR_CANDIDATES, block->capacity, sizeof(int32_t));
        complete = tally->value != NULL && tally->place != NULL &&
                   hs_sums_init(account, plan->n_groups * (plan->edges.n + 1),
                                &plan->asking->weights, &plan->points.weights,
                                &tally->sums) == HS_OK;
    }
    return complete;
}

static hs_status
open_tally(void *context, void *state, const hs_walker *walker)
{
    const tally_plan *plan = context;
    thread_tally     *tally = state;
    *tally = (thread_tally){.plan = plan, .n_slots = 2 * plan->edges.n + 1, .block = -1};
    tally->n_copies = !plan->has_types && tally->n_slots <= FEW_SLOTS ? TALLY_COPIES : 1;
    if (!allocate(tally, &walker->scanner.block)) {
        return HS_ERR_MEMORY;
    }
    memset(tally->counts, 0,
           (size_t)(tally->n_copies * plan->n_groups * tally->n_slots) * sizeof(int64_t));
    for (int64_t k = 0; k < plan->edges.n; k++) {
        tally->waiting[k] = -1;
    }
    return HS_OK;
}

static void
free_tally(hs_account *account, thread_tally *tally)
{
    for (int e = 0; e < TALLY_TABLES; e++) {
        hs_edge_table_free(&tally->tables[e]);
    }
    hs_free(account, tally->counts);
    hs_free(account, tally->slots);
    hs_free(account, tally->open);
    hs_free(account, tally->asked);
    hs_free(account, tally->waiting);
    hs_free(account, tally->type);
    hs_free(account, tally->value);
    hs_free(account, tally->place);
    hs_sums_free(account, &tally->sums);
}

/* Adds what the thread has counted to what those before have. */
static void
close_tally(void *context, void *state)
{
    tally_plan   *plan = context;
    thread_tally *tally = state, *all = &plan->all;
    if (!plan->has_all) {
        plan->has_all = true;
        *all = *tally;
        return;
    }
    const int64_t n_counts = all->n_copies * plan->n_groups * all->n_slots;
    for (int64_t e = 0; all->counts != NULL && tally->counts != NULL && e < n_counts; e++) {
        all->counts[e] += tally->counts[e];
    }
    if (all->sums.limbs != NULL && tally->sums.limbs != NULL) {
        hs_sums_join(&all->sums, &tally->sums);
    }
    free_tally(&plan->search->call->account, tally);
}

/* The table for groups up to this extent, rounded up to a power of two so that there are few. */
static const hs_edge_table *
table_for(thread_tally *tally, double extent)
{
    int exponent = 0;
    if (!(extent > 0.0) || !isfinite(extent)) { /* NaN, with which nothing is sure, or one point */
        extent = extent == 0.0 ? 0x1p-1000 : INFINITY;
    } else if (frexp(extent, &exponent) > 0.5) {
        extent = ldexp(1.0, exponent);
    }
    hs_edge_table *table = &tally->tables[(unsigned)exponent % TALLY_TABLES];
    if (table->extent != extent &&
        hs_edge_table_build(&tally->plan->edges, extent, table) != HS_OK) {
        return NULL;
    }
    return table;
}

/* Types and weights of the candidates, once for each block. */
static void
load_block(thread_tally *tally, const hs_scanner *scanner)
{
    const hs_block   *block = &scanner->block;
    const hs_weights *weights = &tally->plan->points.weights;
    if (tally->block == scanner->n_blocks || (tally->type == NULL && tally->value == NULL)) {
        return;
    }
    tally->block = scanner->n_blocks;
    for (int32_t c = 0; tally->value != NULL && c < block->n; c++) {
        const int32_t si = block->number[c];
        tally->value[c] = weights->value != NULL ? weights->value[si] : 1;
        tally->place[c] = weights->place != NULL ? weights->place[si] : 0;
    }
    for (int32_t c = 0; tally->type != NULL && c < block->n; c++) {
        tally->type[c] = tally->plan->points.type[block->number[c]];
    }
}

/* The groups of pairs of point si, by the type of the other point. */
static const int32_t *
groups_of(const thread_tally *tally, int32_t si)
{
    const tally_plan *plan = tally->plan;
    return plan->group + (int64_t)plan->asking->type[si] * plan->n_types;
}

static int64_t
group_of(const thread_tally *tally, int32_t si, int32_t place)
{
    return tally->plan->has_types ? groups_of(tally, si)[tally->type[place]] : 0;
}

/* The weight of point si. */
static int64_t
weight_of(const thread_tally *tally, int32_t si, int32_t *place)
{
    const hs_weights *weights = &tally->plan->asking->weights;
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

static void
count_plain(thread_tally *tally, int32_t n)
{
    const int32_t *slots = tally->slots;
    const int64_t  n_slots = tally->n_slots;
    int64_t       *counts = tally->counts;
    int32_t        h = 0;
    for (; tally->n_copies == TALLY_COPIES && h + TALLY_COPIES <= n; h += TALLY_COPIES) {
        counts[slots[h]]++;
        counts[n_slots + slots[h + 1]]++;
        counts[2 * n_slots + slots[h + 2]]++;
        counts[3 * n_slots + slots[h + 3]]++;
    }
    for (; h < n; h++) {
        counts[slots[h]]++;
    }
}

/* Counts hits [begin, end) of point si. */
static void
count_typed(thread_tally *tally, int32_t si, const int32_t *places, int32_t begin, int32_t end)
{
    const int32_t *groups = groups_of(tally, si), *type = tally->type;
    for (int32_t h = begin; h < end; h++) {
        tally->counts[groups[type[places[h]]] * tally->n_slots + tally->slots[h]]++;
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
    hs_sums_expect(&tally->sums, end - begin);
    for (int32_t h = begin; h < end; h++) {
        const int32_t place = has_places ? own_place + tally->place[places[h]] : 0;
        if (!(slots[h] & 1)) {
            int64_t *limbs = tally->plan->has_types
                                 ? limbs_of(tally, group_of(tally, si, places[h]), slots[h] / 2)
                                 : first + slots[h] / 2 * n_limbs;
            hs_sums_add(limbs, own, value[places[h]], place);
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
        hs_sums_expect(&tally->sums, 1);
        hs_sums_add(limbs_of(tally, group, pair->low), value, tally->value[pair->place],
                    place + tally->place[pair->place]);
    }
    tally->counts[group * tally->n_slots + 2 * pair->low]++;
}

/* Decides all pairs that wait for one edge. */
static hs_status
decide_edge(thread_tally *tally, hs_scanner *scanner, int32_t edge)
{
    const hs_metric *given = &scanner->search->scene.metric;
    const hs_edges  *edges = &tally->plan->edges;
    hs_pair_batch   *pair_batch = &scanner->pair_batch;
    hs_metric        metric;
    uint8_t          within[HS_BATCH];
    int32_t          u = tally->waiting[edge], end;
    tally->waiting[edge] = -1;
    hs_metric_init(&metric, given->ndim, given->n_rows, (const double(*)[HS_MAX_DIM])given->rows,
                   edges->at[edge], hs_edge_is_inclusive(edges, edge));
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

/* Decides all open pairs. */
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
look_again(thread_tally *tally, hs_scanner *scanner, const hs_edge_table *table, int32_t first,
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
            hs_edge_range(table, &tally->plan->edges, scanner->block.squares[h], &pair->low,
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
    const hs_edge_table *table = table_for(tally, scanner->form->extent);
    const int32_t        n = hits->end[hits->n - 1];
    if (table == NULL) {
        return HS_ERR_MEMORY;
    }
    load_block(tally, scanner);
    const bool has_places = tally->plan->points.weights.place != NULL ||
                            tally->plan->asking->weights.place != NULL;
    const bool is_open = hs_edge_slots(table, scanner->block.squares, n, tally->slots);
    if (!tally->plan->has_types) {
        count_plain(tally, n);
    }
    for (int32_t t = 0, begin = 0; t < hits->n; t++) {
        const int32_t end = hits->end[t];
        if (tally->plan->has_types) {
            count_typed(tally, first + t, hits->label, begin, end);
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

/* Which pairs of types are told apart: all, but in the half list (a, b) and (b, a) are one. */
static hs_status
plan_groups(hs_account *account, bool has_queries, tally_plan *plan)
{
    const int64_t n = plan->n_types;
    plan->n_groups = has_queries ? n * n : n * (n + 1) / 2;
    if (!plan->has_types) {
        plan->n_groups = 1;
        return HS_OK;
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
            const bool again = !has_queries && b < a;
            plan->group[a * n + b] = again ? plan->group[b * n + a] : next;
            next += !again;
        }
    }
    return HS_OK;
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
    return status == HS_OK ? plan_groups(account, search->has_queries, plan) : status;
}

/* What was counted of one group, to entry `to` and on. Returns their number. */
static int64_t
write_group(const thread_tally *all, int64_t group, int64_t to, const hs_histogram *histogram)
{
    int64_t n_pairs = 0;
    for (int64_t k = 0; k < histogram->n_edges; k++) {
        int64_t count = 0;
        for (int copy = 0; copy < all->n_copies; copy++) {
            count += all->counts[(copy * all->plan->n_groups + group) * all->n_slots + 2 * k];
        }
        if (histogram->counts != NULL) {
            histogram->counts[to + k] = count;
        }
        if (histogram->sums != NULL) {
            histogram->sums[to + k] =
                hs_sums_round(&all->sums, group * (histogram->n_edges + 1) + k);
        }
        n_pairs += count;
    }
    return n_pairs;
}

hs_status
hs_histogram_fill(hs_search *search, const hs_histogram *histogram, const hs_sets *sets,
                  int64_t *n_pairs, hs_failure *failure)
{
    hs_account      *account = &search->call->account;
    tally_plan       plan = {.search = search};
    const hs_visitor visitor = {.use = HS_BLOCK_LISTS_SQUARES,
                                .visit = tally_hits,
                                .shared = &plan,
                                .state_size = sizeof(thread_tally),
                                .open = open_tally,
                                .close = close_tally};
    const int64_t    n_types = histogram->n_types;
    hs_status        status = open_plan(histogram, sets, &plan, failure);
    if (status == HS_OK) {
        status = hs_parallel_visit(search, &visitor, NULL, failure);
    }
    if (status == HS_OK && plan.sums) {
        hs_sums_carry(&plan.all.sums);
    }
    for (int64_t at = 0; status == HS_OK && at < n_types * n_types; at++) {
        const bool    again = !search->has_queries && at % n_types < at / n_types;
        const int64_t found = write_group(&plan.all, plan.has_types ? plan.group[at] : 0,
                                          at * histogram->n_edges, histogram);
        *n_pairs += again ? 0 : found;
    }
    free_tally(account, &plan.all);
    hs_free(account, plan.edges.at);
    marked_free(account, &plan.points);
    marked_free(account, &plan.queries);
    hs_free(account, plan.group);
    return status;
}
