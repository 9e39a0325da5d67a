/* SPDX-License-Identifier: BSD-3-Clause */
#include "scan.h"
#include "../base/os.h"
#include "../memory/memory.h"
#include "limits.h"
#include "choice.h"
#include "../exact/metric.h"
#include "../base/status.h"

#include <math.h>
#include <string.h>
#include <stddef.h>

/* scan.c: a block is gathered, scanned for some points at a time, and what they hit is decided.
 * Candidates are appended as runs of point numbers; then the kernel copies all runs at once. */

int32_t
hs_block_most_hits(int32_t capacity)
{
    if (capacity < HS_BURST) {
        return capacity + HS_BURST;
    }
    return capacity < INT32_MAX / HS_HITS_PER_CANDIDATE ? HS_HITS_PER_CANDIDATE * capacity
                                                        : capacity;
}

/* Room for so many candidates and runs at a time. */
static hs_status
block_init(hs_account *account, int ndim, hs_block_use use, int32_t most, int32_t most_runs,
           hs_block *block)
{
    const int64_t capacity = (int64_t)most + HS_PADDING;
    const int64_t hits = (int64_t)hs_block_most_hits(most) + HS_PADDING;
    const bool    has_squares = use == HS_BLOCK_LISTS_SQUARES;
    hs_parts      parts;
    *block = (hs_block){.capacity = most, .most_runs = most_runs};
    block->most_hits = hs_block_most_hits(most);
    hs_parts_begin(&parts);
    for (int k = 0; k < ndim; k++) {
        hs_parts_add(&parts, (void **)&block->y[k], capacity, sizeof(float));
    }
    hs_parts_add(&parts, (void **)&block->norm, capacity, sizeof(float));
    hs_parts_add(&parts, (void **)&block->id, capacity, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&block->number, capacity, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&block->unsure, capacity, sizeof(hs_unsure));
    hs_parts_add(&parts, (void **)&block->runs, (int64_t)most_runs + 1, sizeof(hs_run));
    if (use != HS_BLOCK_COUNTS) {
        hs_parts_add(&parts, (void **)&block->hits, hits, sizeof(int32_t));
    }
    if (has_squares) {
        hs_parts_add(&parts, (void **)&block->squares, hits, sizeof(float));
    }
    if (has_squares || use == HS_BLOCK_LISTS_PLACES) {
        hs_parts_add(&parts, (void **)&block->place, capacity, sizeof(int32_t));
    }
    block->memory = hs_parts_alloc(account, HS_FOR_CANDIDATES, &parts);
    return block->memory != NULL ? HS_OK : HS_ERR_MEMORY;
}

hs_status
hs_block_add_radii(hs_account *account, int32_t n_rows, hs_block *block)
{
    block->pitch = (int64_t)block->capacity + HS_PADDING;
    block->radius = hs_alloc(account, HS_FOR_CANDIDATES, n_rows * block->pitch, sizeof(float));
    return block->radius != NULL ? HS_OK : HS_ERR_MEMORY;
}

static void
block_free(hs_account *account, hs_block *block)
{
    hs_free(account, block->radius);
    block->radius = NULL;
    hs_free(account, block->memory);
    block->memory = NULL;
}

void
hs_group_start(const hs_bins *bins, int32_t first, int32_t last, hs_group *group)
{
    group->first = first;
    group->last = last;
    group->largest = 0;
    group->near.out = INFINITY;
    /* Any double will do as a centre; one of the points is near all of them. */
    const int32_t middle = first + (last - first) / 2;
    for (int k = 0; k < bins->ndim; k++) {
        group->centre[k] = bins->x[k][middle];
    }
}

/* Its points, copied from where they are: for groups whose neighbourhood does not begin with them,
 * after hs_group_start. Rounded as candidates are. */
static void
group_load(const hs_bins *bins, hs_group *group)
{
    for (int k = 0; k < bins->ndim; k++) {
        const double *x = bins->x[k] + group->first;
        for (int32_t t = 0; t < group->last - group->first; t++) {
            const float    q = (float)(x[t] - group->centre[k]);
            const uint32_t bits = hs_bits_of_float(q) & UINT32_C(0x7fffffff);
            group->q[k][t] = q;
            group->largest = bits > group->largest ? bits : group->largest;
        }
    }
}

float
hs_group_bound(const hs_bins *bins, hs_group *group)
{
    float largest = 0.0f;
    group_load(bins, group);
    for (int k = 0; k < bins->ndim; k++) {
        float low = group->q[k][0], high = low;
        for (int32_t t = 1; t < group->last - group->first; t++) {
            low = group->q[k][t] < low ? group->q[k][t] : low;
            high = group->q[k][t] > high ? group->q[k][t] : high;
        }
        group->near.low[k] = low;
        group->near.high[k] = high;
        largest = fmaxf(largest, fmaxf(-low, high));
    }
    return largest;
}

/*
 * Appends points [si, end) of one image to the block, as many as there is room for; returns how
 * many. shift: the image's displacement, ndim doubles; image: that displacement over the rows of B.
 */
static int32_t
block_append(hs_block *block, int32_t si, int32_t end, int ndim, const double *shift,
             const int32_t *image, const hs_group *group)
{
    const int32_t room = block->capacity - block->n;
    const int32_t n = end - si < room ? end - si : room;
    hs_run       *run = &block->runs[block->n_runs++];
    run->at = block->n;
    run->si = si;
    memcpy(run->image, image, sizeof run->image);
    for (int k = 0; k < ndim; k++) {
        /* One rounding here and one for the sum: hs_grid.shift_error bounds the first, filter.h
         * counts on the second. */
        run->moved[k] = shift[k] - group->centre[k];
    }
    block->n += n;
    return n;
}

/* Some candidates after others where there are very many. */
static hs_status
gather_in_parts(const hs_kernel *kernel, const hs_options *options, const hs_block *block,
                hs_gather *gather)
{
    for (int32_t first = 0, end; first < block->n_runs; first = end) {
        hs_run       *runs = block->runs + first;
        const int32_t left = block->n_runs - first;
        if (first > 0 && hs_poll(options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
        end = first + (left < HS_RUNS_PER_POLL ? left : HS_RUNS_PER_POLL);
        kernel->gather(gather, runs, end - first);
    }
    return HS_OK;
}

/* Those that there are candidates for, and the padding. */
static void
set_places(hs_block *block)
{
    const int32_t end = block->n + HS_PADDING;
    int32_t      *place = block->place;
    for (int32_t c = block->n_places; c < end; c++) {
        place[c] = c;
    }
    block->n_places = end > block->n_places ? end : block->n_places;
}

/*
 * Copies what was appended, but for candidates that are not near the group. The first block of a
 * group must begin with the group's own points, in the image 0: they are kept as its q. Fails when
 * poll() stops the search; it is called now and then for a large block.
 */
static hs_status
block_gather(const hs_bins *bins, const hs_kernel *kernel, const hs_options *options, bool is_first,
             hs_block *block, hs_group *group)
{
    hs_gather gather;
    gather.ndim = bins->ndim;
    for (int k = 0; k < bins->ndim; k++) {
        gather.x[k] = bins->x[k];
        gather.y[k] = block->y[k];
    }
    gather.order = bins->order;
    gather.norm = block->norm;
    gather.id = block->id;
    gather.number = block->number;
    gather.near = group->near;
    gather.n = 0;
    gather.largest = group->largest;
    block->runs[block->n_runs].at = block->n;
    const hs_status status = gather_in_parts(kernel, options, block, &gather);
    if (status != HS_OK) {
        return status;
    }
    group->largest = gather.largest;
    block->n = block->runs[block->n_runs].at = gather.n;
    for (int k = 0; k < bins->ndim; k++) {
        hs_pad_lanes(block->y[k], block->n);
    }
    hs_pad_lanes(block->norm, block->n);
    if (block->place != NULL) {
        set_places(block);
    }
    if (is_first) {
        HS_ASSERT(block->runs[0].si == group->first && block->n >= group->last - group->first);
        const size_t bytes = (size_t)(group->last - group->first) * sizeof(float);
        for (int k = 0; k < bins->ndim; k++) {
            memcpy(group->q[k], block->y[k], bytes);
        }
    }
    return HS_OK;
}

/* A radix sort from the least digit, stable, of numbers that share few bits:
 * those of some hundred candidates. */

#define DIGIT_BITS 10 /* of a digit, at most: four kB of counts stay in the first-level cache */
#define LEAD_BITS  8  /* of the only digit that few candidates are sorted by; one more for others */
#define FEW        24 /* candidates that are quicker sorted by insertion */
#define MANY       160 /* from here on two digits are quicker than one and insertion */
#define CROWD      12 /* entries with the same leading digit, beyond which insertion does not pay */

static hs_status
order_init(hs_account *account, hs_block *block, hs_order *order)
{
    const int64_t n = (int64_t)block->capacity + HS_PADDING;
    order->entries = hs_alloc(account, HS_FOR_SORTING, n, sizeof(uint64_t));
    order->spare = hs_alloc(account, HS_FOR_SORTING, n, sizeof(uint64_t));
    order->column = hs_alloc(account, HS_FOR_SORTING, n, sizeof(float));
    order->shifts = hs_alloc(account, HS_FOR_SORTING, ((int64_t)block->most_runs + 1) * HS_MAX_DIM,
                             sizeof(int64_t));
    block->origin = hs_alloc(account, HS_FOR_SORTING, n, sizeof(int32_t));
    const bool complete = order->entries != NULL && order->spare != NULL && order->column != NULL &&
                          order->shifts != NULL && block->origin != NULL;
    if (complete) { /* padding of labels may be read */
        memset(block->origin, 0, (size_t)n * sizeof(int32_t));
    }
    return complete ? HS_OK : HS_ERR_MEMORY;
}

void
hs_order_free(hs_account *account, hs_block *block, hs_order *order)
{
    hs_free(account, block->origin);
    block->origin = NULL;
    hs_free(account, order->shifts);
    hs_free(account, order->column);
    hs_free(account, order->spare);
    hs_free(account, order->entries);
    *order = (hs_order){0};
}

static void
sort_few(uint64_t *entries, int32_t n)
{
    for (int32_t c = 1; c < n; c++) {
        const uint64_t entry = entries[c];
        int32_t        to = c;
        for (; to > 0 && entries[to - 1] >> 32 > entry >> 32; to--) {
            entries[to] = entries[to - 1];
        }
        entries[to] = entry;
    }
}

/* Turns the number of entries with each digit into the place of the first of them. Returns the
 * largest number. */
HS_ALWAYS_INLINE uint32_t
sum_digits(uint32_t *start, uint32_t mask)
{
    uint32_t most = 0;
    for (uint32_t digit = 0, sum = 0; digit <= mask; digit++) {
        const uint32_t count = start[digit];
        start[digit] = sum;
        sum += count;
        most = count > most ? count : most;
    }
    return most;
}

/* Distributes the entries to the spare ones, which become the entries. */
HS_ALWAYS_INLINE void
deal_out(hs_order *order, int32_t n, int shift, uint32_t mask, uint32_t *start)
{
    const uint64_t *from = order->entries;
    uint64_t       *to = order->spare;
    for (int32_t c = 0; c < n; c++) {
        to[start[(uint32_t)(from[c] >> shift) & mask]++] = from[c];
    }
    order->spare = order->entries;
    order->entries = to;
}

/* Sorts by one digit of the key. Returns the largest number of entries that agree in it. */
static uint32_t
sort_digit(hs_order *order, int32_t n, int shift, int bits)
{
    uint32_t       start[1 << DIGIT_BITS];
    const uint32_t mask = (UINT32_C(1) << bits) - 1;
    memset(start, 0, ((size_t)mask + 1) * sizeof *start);
    for (int32_t c = 0; c < n; c++) {
        start[(uint32_t)(order->entries[c] >> shift) & mask]++;
    }
    const uint32_t most = sum_digits(start, mask);
    deal_out(order, n, shift, mask, start);
    return most;
}

/* Sorts by two digits of `low` and `high` bits, which are the key: one pass counts both. */
static void
sort_two_digits(hs_order *order, int32_t n, int low, int high)
{
    uint32_t       start[1 << DIGIT_BITS], start_high[1 << DIGIT_BITS];
    const uint32_t mask = (UINT32_C(1) << low) - 1, mask_high = (UINT32_C(1) << high) - 1;
    memset(start, 0, ((size_t)mask + 1) * sizeof *start);
    memset(start_high, 0, ((size_t)mask_high + 1) * sizeof *start_high);
    for (int32_t c = 0; c < n; c++) {
        const uint32_t key = (uint32_t)(order->entries[c] >> 32);
        start[key & mask]++;
        start_high[key >> low & mask_high]++;
    }
    (void)sum_digits(start, mask);
    (void)sum_digits(start_high, mask_high);
    deal_out(order, n, 32, mask, start);
    deal_out(order, n, 32 + low, mask_high, start_high);
}

/* Sorts by the keys, stable. `any` has every bit that a key has. */
static void
sort_entries(hs_order *order, int32_t n, uint32_t any)
{
    int bits = 0;
    while (bits < 32 && any >> bits != 0) {
        bits++;
    }
    if (n <= FEW) {
        sort_few(order->entries, n);
        return;
    }
    /* The leading digit alone tells nearly all apart, when keys are spread evenly. Where two tell
     * all of them apart, they do so without the branches of an insertion. */
    const int digits = (bits + DIGIT_BITS - 1) / DIGIT_BITS;
    if (n < MANY || digits > 2) {
        const int most = n < 1 << LEAD_BITS ? LEAD_BITS : LEAD_BITS + 1;
        const int lead = bits < most ? bits : most;
        if (sort_digit(order, n, 32 + bits - lead, lead) <= CROWD) {
            sort_few(order->entries, n);
            return;
        }
    }
    if (digits == 2) {
        sort_two_digits(order, n, (bits + 1) / 2, bits / 2);
        return;
    }
    for (int digit = 0, from = 0; digit < digits; digit++) {
        const int width = (bits - from + digits - digit - 1) / (digits - digit);
        (void)sort_digit(order, n, 32 + from, width);
        from += width;
    }
}

/* Finds S of each run's image, over the box vectors as given. */
static bool
find_shifts(const hs_lattice *lattice, const hs_block *block, int64_t *shifts)
{
    for (int32_t r = 0; r < block->n_runs; r++) {
        int64_t image[HS_MAX_DIM], *given = shifts + (int64_t)r * HS_MAX_DIM;
        for (int b = 0; b < lattice->n_periodic; b++) {
            image[b] = block->runs[r].image[b];
        }
        if (!hs_lattice_shift(lattice, image, given)) {
            return false;
        }
    }
    return true;
}

/* Sorts the runs' entries by one component of S, stable: by its lower 32 bits, or by the bits
 * above. */
static void
sort_by_shift(int32_t n_runs, const int64_t *shifts, bool upper, hs_order *order)
{
    int64_t  least = INT64_MAX;
    uint32_t any = 0;
    for (int32_t r = 0; r < n_runs; r++) {
        const int64_t shift = shifts[(int64_t)r * HS_MAX_DIM];
        least = shift < least ? shift : least;
    }
    for (int32_t e = 0; e < n_runs; e++) {
        const uint32_t run = (uint32_t)(order->entries[e] & UINT32_MAX);
        const uint64_t above = (uint64_t)shifts[(int64_t)run * HS_MAX_DIM] - (uint64_t)least;
        const uint32_t key = upper ? (uint32_t)(above >> 32) : (uint32_t)above;
        order->entries[e] = (uint64_t)key << 32 | run;
        any |= key;
    }
    if (any != 0) {
        sort_entries(order, n_runs, any);
    }
}

/* From entries of the runs to one for each candidate, with its number for a key. Returns every bit
 * that a number has. */
static uint32_t
list_candidates(const hs_block *block, hs_order *order)
{
    uint64_t *to = order->spare;
    uint32_t  any = 0;
    for (int32_t e = 0; e < block->n_runs; e++) {
        const hs_run *run = &block->runs[order->entries[e] & UINT32_MAX];
        for (int32_t c = run->at; c < run[1].at; c++) {
            const uint32_t key = (uint32_t)block->id[c];
            *to++ = (uint64_t)key << 32 | (uint32_t)c;
            any |= key;
        }
    }
    to = order->spare;
    order->spare = order->entries;
    order->entries = to;
    return any;
}

/* Polls between passes over a large block. */
static hs_status
poll_large(const hs_options *options, const hs_block *block)
{
    return block->n > HS_POLL_CANDIDATES ? hs_poll(options, 0.0) : HS_OK;
}

/* Puts the candidates in the order of the entries. */
static hs_status
arrange(int ndim, const hs_options *options, hs_block_use use, hs_block *block,
        const hs_order *order)
{
    const int32_t        n = block->n;
    int32_t *HS_RESTRICT origin = block->origin;
    float *HS_RESTRICT   column = order->column;
    for (int32_t c = 0; c < n; c++) {
        origin[c] = (int32_t)(order->entries[c] & UINT32_MAX);
        if (use == HS_BLOCK_LISTS_IDS) {
            block->id[c] = (int32_t)(order->entries[c] >> 32);
        }
    }
    for (int k = 0; k <= ndim; k++) {
        float *values = k < ndim ? block->y[k] : block->norm;
        for (int32_t c = 0; c < n; c++) {
            column[c] = values[origin[c]];
        }
        memcpy(values, column, (size_t)n * sizeof *values);
        if (poll_large(options, block) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

/* Whether each number is above the one before, as in one cell, or where points are numbered as they
 * lie. */
static bool
is_ascending(const int32_t *numbers, int32_t n)
{
    int32_t descents = 0;
    for (int32_t c = 1; c < n; c++) {
        descents += numbers[c] <= numbers[c - 1];
    }
    return descents == 0;
}

/*
 * Sorts a block that has been gathered: ascending by the caller's number, then, where hits are
 * listed as places and some pair has several images, by S over the box vectors as given.
 * block->origin says where each candidate was; ids follow the new order only where these are
 * listed. HS_ERR_SHIFT_RANGE when an image passes 2^62; HS_ERR_INTERRUPTED, as options say, while a
 * large block is sorted.
 */
static hs_status
order_block(const hs_search *search, const hs_options *options, hs_block_use use, hs_block *block,
            hs_order *order)
{
    const hs_lattice *lattice = &search->scene.lattice;
    const bool        by_shift = use == HS_BLOCK_LISTS_PLACES && hs_search_repeats_images(search);
    if (poll_large(options, block) != HS_OK) { /* it was gathered */
        return HS_ERR_INTERRUPTED;
    }
    if (is_ascending(block->id, block->n)) {
        for (int32_t c = 0; c < block->n; c++) {
            block->origin[c] = c;
        }
        return HS_OK;
    }
    if (by_shift && !find_shifts(lattice, block, order->shifts)) {
        return HS_ERR_SHIFT_RANGE;
    }
    for (int32_t r = 0; r < block->n_runs; r++) {
        order->entries[r] = (uint64_t)r;
    }
    for (int l = lattice->n_periodic - 1; by_shift && l >= 0; l--) {
        sort_by_shift(block->n_runs, order->shifts + l, false, order);
        sort_by_shift(block->n_runs, order->shifts + l, true, order);
        if (poll_large(options, block) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    const uint32_t any = list_candidates(block, order);
    sort_entries(order, block->n, any);
    return arrange(lattice->ndim, options, use, block, order);
}

/* Runs of candidates are of one image, and consecutive points unless some were left out,
 * so records are written run by run. What is zero throughout the block is not written at all: most
 * blocks have no image and no turn. */

/* Turns and images up to here are few: sums of four of them are int32. */
#define MOST_FEW 0x1p28

/* Whether shifts over B are those over the box vectors as given. */
static bool
has_plain_shifts(const hs_lattice *lattice)
{
    for (int r = 0; r < lattice->n_periodic; r++) {
        for (int l = 0; l < lattice->n_periodic; l++) {
            if (lattice->U[r][l] != (r == l)) {
                return false;
            }
        }
    }
    return true;
}

/* Whether every S of the scene is the sum of an image and of turns that are known to be few. */
static bool
has_narrow_shifts(const hs_search *search)
{
    const hs_scene *scene = &search->scene;
    for (int k = 0; k < scene->ndim; k++) {
        if (scene->lattice.row_of_axis[k] >= 0 &&
            search->grid.reach[k] / search->grid.shape[k] >= MOST_FEW) {
            return false;
        }
    }
    return has_plain_shifts(&scene->lattice) &&
           (!search->bins.turns.known ||
            hs_fold_turns(&scene->lattice, scene->cloud.largest) < MOST_FEW);
}

static hs_status
records_init(const hs_search *search, const hs_block *block, const hs_options *polls,
             bool needs_given, hs_records *records)
{
    hs_account   *account = &search->call->account;
    const bool    has_rows = search->scene.lattice.n_periodic > 0;
    const int     width = search->scene.ndim <= HS_RECORD ? HS_RECORD : 2 * HS_RECORD;
    const int64_t n = (int64_t)block->capacity * width;
    hs_parts      parts;
    *records = (hs_records){.search = search, .block = block, .polls = polls, .width = width};
    records->needs_given = needs_given || search->bins.keeps_originals;
    records->is_narrow = has_narrow_shifts(search);
    hs_parts_begin(&parts);
    hs_parts_add(&parts, (void **)&records->q, n, sizeof(double));
    if (has_rows) {
        hs_parts_add(&parts, (void **)&records->image, n, sizeof(int32_t));
    }
    if (has_rows && records->needs_given && records->is_narrow) {
        hs_parts_add(&parts, (void **)&records->few, n, sizeof(int32_t));
    } else if (has_rows && records->needs_given) {
        hs_parts_add(&parts, (void **)&records->turned, n, sizeof(int64_t));
    }
    if (needs_given && records->is_narrow && search->call->kernel->write != NULL &&
        search->scene.ndim >= 2 && search->scene.ndim <= HS_WRITE_MOST_DIM) {
        hs_parts_add(&parts, (void **)&records->candidates, block->capacity, sizeof(hs_candidate));
    }
    records->memory = hs_parts_alloc(account, HS_FOR_CANDIDATES, &parts);
    return records->memory != NULL ? HS_OK : HS_ERR_MEMORY;
}

/* needs_given: whether S is wanted, or else only what the metric needs. */
static void
records_free(hs_account *account, hs_records *records)
{
    hs_free(account, records->memory);
    records->memory = NULL;
}

/* The image less the turns of each of n candidates. */
HS_ALWAYS_INLINE void
subtract_turns(const hs_bins *bins, const int32_t *image, const int32_t *number, int32_t n,
               const int m, const int width, int32_t *few)
{
    const int32_t *turns[HS_MAX_DIM];
    int32_t        moved[HS_MAX_DIM];
    for (int r = 0; r < m; r++) { /* `few` does not overlap these */
        turns[r] = bins->turns.narrow[r];
        moved[r] = image[r];
    }
    for (int32_t c = 0; c < n; c++) {
        for (int r = 0; r < m; r++) {
            few[(int64_t)c * width + r] = moved[r] - turns[r][number[c]];
        }
    }
}

/* Looks up the shifts of the candidates of one run, less their turns. */
static void
load_few(hs_records *records, const hs_run *run, int32_t n)
{
    const hs_bins *bins = &records->search->bins;
    const int      m = bins->n_periodic, width = records->width;
    int32_t       *few = records->few + (int64_t)run->at * width;
    const int32_t *number = records->block->number + run->at;
    if (m == 3 && width == HS_RECORD) {
        subtract_turns(bins, run->image, number, n, 3, HS_RECORD, few);
    } else {
        subtract_turns(bins, run->image, number, n, m, width, few);
    }
}

static void
load_given(hs_records *records, const hs_run *run, int32_t n)
{
    const hs_bins *bins = &records->search->bins;
    const int32_t *number = records->block->number + run->at;
    const int      width = records->width;
    if (records->is_narrow) {
        load_few(records, run, n);
        return;
    }
    for (int r = 0; r < bins->n_periodic; r++) {
        int64_t *turned = records->turned + (int64_t)run->at * width + r;
        for (int32_t c = 0; c < n; c++) {
            const int64_t turns = bins->turns.known ? hs_turns_get(&bins->turns, r, number[c]) : 0;
            turned[c * width] = run->image[r] - turns;
        }
    }
}

/* Coordinates of each of n candidates. */
HS_ALWAYS_INLINE void
copy_points(double *const *x, const int32_t *number, int32_t n, const int d, const int width,
            double *to)
{
    const double *from[HS_MAX_DIM];
    for (int k = 0; k < d; k++) { /* `to` does not overlap this */
        from[k] = x[k];
    }
    for (int32_t c = 0; c < n; c++, to += width) {
        for (int k = 0; k < d; k++) {
            to[k] = from[k][number[c]];
        }
    }
}

/* Looks up what the metric needs of the candidates of one run. */
static void
load_points(hs_records *records, const hs_run *run, int32_t n)
{
    const hs_bins *bins = &records->search->bins;
    const int      d = bins->ndim;
    const int32_t *number = records->block->number + run->at;
    double        *to = records->q + (int64_t)run->at * records->width;
    double *const *x = bins->keeps_originals ? bins->originals : bins->x;
    if (d == 3) {
        copy_points(x, number, n, 3, HS_RECORD, to);
    } else {
        copy_points(x, number, n, d, records->width, to);
    }
}

static void
load_images(hs_records *records, const hs_run *run, int32_t n)
{
    const int m = records->search->bins.n_periodic, width = records->width;
    int32_t  *to = records->image + (int64_t)run->at * width;
    int32_t   image[HS_MAX_DIM] = {0};
    memcpy(image, run->image, (size_t)m * sizeof *image);
    if (width == HS_RECORD) { /* a copy of constant size is one instruction */
        for (int32_t c = 0; c < n; c++) {
            memcpy(to + c * HS_RECORD, image, HS_RECORD * sizeof *image);
        }
        return;
    }
    for (int32_t c = 0; c < n; c++) {
        memcpy(to + c * width, image, (size_t)width * sizeof *image);
    }
}

/* Looks at the runs of the block once. */
bool
hs_records_has_images(hs_records *records)
{
    if (records->knows_images) {
        return records->has_images;
    }
    int32_t any = 0;
    for (const hs_run *run = records->block->runs; run->at < records->block->n; run++) {
        for (int r = 0; r < records->search->bins.n_periodic; r++) {
            any |= run->image[r];
        }
    }
    records->knows_images = true;
    records->has_images = any != 0;
    return records->has_images;
}

/* Writes down all candidates of the block, as far as that is not done yet. */
hs_status
hs_records_load(hs_records *records, bool metric)
{
    int32_t unpolled = 0;
    bool    given = records->needs_given && !records->has_given;
    metric = metric && !records->has_metric;
    if (!given && !metric) {
        return HS_OK;
    }
    const bool images = hs_records_has_images(records);
    given = given && (records->search->bins.turns.known || !records->is_narrow);
    for (const hs_run *run = records->block->runs; run->at < records->block->n; run++) {
        const int32_t n = run[1].at - run->at;
        if (n == 0) { /* all of it was left out */
            continue;
        }
        if (metric) {
            load_points(records, run, n);
        }
        if (images) {
            load_images(records, run, n);
        }
        if (given) {
            load_given(records, run, n);
        }
        unpolled += n;
        if (unpolled > HS_POLL_CANDIDATES) {
            unpolled = 0;
            if (hs_poll(records->polls, 0.0) != HS_OK) {
                return HS_ERR_INTERRUPTED;
            }
        }
    }
    records->has_given = records->needs_given;
    records->has_metric = metric;
    return HS_OK;
}

/* Candidates of one run. Returns whether they are fine. */
static bool
load_halved(hs_records *records, const hs_run *run, int32_t n, const int32_t *base, hs_halving by)
{
    const hs_search *search = records->search;
    const hs_bins   *bins = &search->bins;
    const hs_metric *metric = &search->scene.metric;
    const bool       by_S = bins->keeps_originals;
    const int        d = bins->ndim, m = bins->n_periodic;
    const int       *column = search->scene.lattice.vector_of_row;
    hs_candidate    *to = records->candidates + run->at;
    hs_candidate_run whole = {.n = n,
                              .by = by,
                              .place = records->block->number + run->at,
                              .number = records->block->id + run->at};
    int32_t          shift[HS_WRITE_MOST_DIM];
    bool             are_fine = true;
    for (int k = 0; k < d; k++) {
        whole.x[k] = by_S ? bins->originals[k] : bins->x[k];
    }
    for (int r = 0; r < m; r++) {
        whole.turns[column[r]] = bins->turns.known ? bins->turns.narrow[r] : NULL;
        whole.image[column[r]] = shift[r] = run->image[r];
    }
    (void)hs_write_move(metric, by, shift, &whole.moved);
    if (d == 3 && !by_S) {
        return search->call->kernel->candidates(&whole, to) && whole.moved.is_fine;
    }
    for (int32_t c = 0; c < n; c++) {
        const int32_t si = whole.place[c];
        double        q[HS_WRITE_MOST_DIM] = {0.0};
        int32_t       S[HS_WRITE_MOST_DIM] = {0}, any = 0;
        for (int k = 0; k < d; k++) {
            q[k] = whole.x[k][si];
            S[k] = whole.image[k] - (whole.turns[k] != NULL ? whole.turns[k][si] : 0);
        }
        for (int r = 0; by_S && r < m; r++) {
            any |= S[column[r]] + base[r] - shift[r];
        }
        if (any != 0) { /* from one candidate to the next they seldom differ */
            for (int r = 0; r < m; r++) {
                shift[r] = S[column[r]] + base[r];
            }
            are_fine = are_fine && whole.moved.is_fine;
            (void)hs_write_move(metric, by, shift, &whole.moved);
        }
        are_fine &= hs_candidate_set(&to[c], q, by, &whole.moved, whole.number[c], S);
    }
    return are_fine && whole.moved.is_fine;
}

hs_status
hs_records_load_candidates(hs_records *records, const int32_t *base)
{
    const hs_halving by = hs_write_halving(records->search->scene.metric.cutoff);
    bool             are_fine = true;
    int32_t          unpolled = 0;
    if (records->has_candidates) {
        return HS_OK;
    }
    for (const hs_run *run = records->block->runs; run->at < records->block->n; run++) {
        const int32_t n = run[1].at - run->at;
        if (n == 0) { /* all of it was left out */
            continue;
        }
        are_fine &= load_halved(records, run, n, base, by);
        unpolled += n;
        if (unpolled > HS_POLL_CANDIDATES) {
            unpolled = 0;
            if (hs_poll(records->polls, 0.0) != HS_OK) {
                return HS_ERR_INTERRUPTED;
            }
        }
    }
    records->has_candidates = true;
    records->are_fine = are_fine;
    return HS_OK;
}

/* Each batch copies from the records of its candidates, axis by axis, as the batch
 * kernels want them, or for few pairs from the points themselves. */

/* Integers up to here are float64 numbers, and what the batch kernels take. */
#define WIDEST_SHIFT (INT64_C(1) << 53)

/* One pair of so many candidates is looked up by itself, more by the records of the whole block. */
#define FEW_OF_BLOCK 8

/* n arrays of `length` entries. */
static void
add_arrays(hs_parts *parts, int n, int64_t length, size_t size, void **arrays)
{
    for (int k = 0; k < n; k++) {
        hs_parts_add(parts, &arrays[k], length, size);
    }
}

static bool
allocate(hs_account *account, hs_pair_batch *pair_batch)
{
    const int  d = pair_batch->search->scene.ndim, m = pair_batch->search->scene.lattice.n_periodic;
    const bool as_given = pair_batch->search->bins.keeps_originals,
               narrow = pair_batch->of.is_narrow;
    const int     m_given = pair_batch->of.needs_given && (as_given || !narrow) ? m : 0;
    const int     m_narrow = pair_batch->of.needs_given && narrow ? m : 0;
    const int64_t batch = HS_BATCH + HS_BATCH_PADDING;
    hs_parts      parts;
    hs_parts_begin(&parts);
    add_arrays(&parts, 1, HS_BATCH, sizeof(int32_t), (void **)&pair_batch->place);
    add_arrays(&parts, 1, HS_BATCH, sizeof(int32_t), (void **)&pair_batch->si);
    add_arrays(&parts, d, batch, sizeof(double), (void **)pair_batch->p);
    add_arrays(&parts, d, batch, sizeof(double), (void **)pair_batch->q);
    add_arrays(&parts, m, batch, sizeof(double), (void **)pair_batch->times);
    add_arrays(&parts, m, HS_BATCH, sizeof(int64_t), (void **)pair_batch->image);
    add_arrays(&parts, m_given, HS_BATCH, sizeof(int64_t), (void **)pair_batch->given);
    add_arrays(&parts, m_narrow, HS_BATCH, sizeof(int32_t), (void **)pair_batch->shift);
    pair_batch->memory = hs_parts_alloc(account, HS_FOR_CANDIDATES, &parts);
    return pair_batch->memory != NULL;
}

hs_status
hs_pair_batch_init(const hs_search *search, const hs_block *block, const hs_options *polls,
                   bool needs_given, hs_pair_batch *pair_batch)
{
    hs_account *account = &search->call->account;
    pair_batch->search = search;
    pair_batch->memory = NULL;
    pair_batch->n_rows = search->scene.lattice.n_periodic;
    pair_batch->as_given = search->bins.keeps_originals;
    pair_batch->is_plain = has_plain_shifts(&search->scene.lattice);
    pair_batch->has_zeros = false;
    hs_pair_batch_clear(pair_batch);
    hs_status status = records_init(search, block, polls, needs_given, &pair_batch->of);
    if (status == HS_OK && !allocate(account, pair_batch)) {
        status = HS_ERR_MEMORY;
    }
    if (status != HS_OK) {
        hs_pair_batch_free(account, pair_batch);
    }
    return status;
}

/* Makes it ready for what its search has become, with as many axes. False if it has other arrays
 * than that needs. */
static bool
pair_batch_renew(bool needs_given, hs_pair_batch *pair_batch)
{
    const hs_search *search = pair_batch->search;
    if (pair_batch->n_rows != search->scene.lattice.n_periodic ||
        pair_batch->as_given != search->bins.keeps_originals ||
        pair_batch->of.needs_given != (needs_given || pair_batch->as_given) ||
        pair_batch->of.is_narrow != has_narrow_shifts(search)) {
        return false;
    }
    pair_batch->is_plain = has_plain_shifts(&search->scene.lattice);
    hs_pair_batch_clear(pair_batch);
    return true;
}

void
hs_pair_batch_free(hs_account *account, hs_pair_batch *pair_batch)
{
    hs_free(account, pair_batch->memory);
    pair_batch->memory = NULL;
    records_free(account, &pair_batch->of);
}

/* Rows of B that point si was wrapped by; 0 where that is known to cancel or not needed. */
HS_ALWAYS_INLINE int64_t
turns_of(const hs_bins *bins, int r, int64_t si)
{
    return bins->turns.known ? hs_turns_get(&bins->turns, r, si) : 0;
}

int32_t
hs_pair_batch_add(hs_pair_batch *pair_batch, int32_t si, const int32_t *places, int32_t n)
{
    const int32_t room = HS_BATCH - pair_batch->n;
    int32_t      *place = pair_batch->place + pair_batch->n, *of = pair_batch->si + pair_batch->n;
    n = n < room ? n : room;
    for (int32_t e = 0; e < n; e++) {
        place[e] = places[e];
        of[e] = si;
    }
    pair_batch->n += n;
    return n;
}

/* The run that a place is in. The number of steps depends on that of runs alone: branches on where
 * the place is would be guessed, half of them wrongly. */
static const hs_run *
run_of(const hs_block *block, int32_t place)
{
    const hs_run *run = block->runs;
    for (int32_t n = block->n_runs, half; n > 1;
         n -= half) { /* it is one of run[0] to run[n - 1] */
        half = n / 2;
        run += run[half].at <= place ? half : 0;
    }
    return run;
}

/* What the metric measures between, and its shifts, without records: they are of X, over B. Where
 * the block has no image, `image` and `times` are left alone, and not read later. */
static void
look_up_few(hs_pair_batch *pair_batch)
{
    const hs_block *block = pair_batch->of.block;
    const hs_bins *bins = &pair_batch->search->bins, *asking = hs_search_asking(pair_batch->search);
    for (int k = 0; k < bins->ndim; k++) {
        for (int32_t e = 0; e < pair_batch->n; e++) {
            pair_batch->p[k][e] = asking->x[k][pair_batch->si[e]];
            pair_batch->q[k][e] = bins->x[k][block->number[pair_batch->place[e]]];
        }
    }
    int32_t    any = 0;
    const bool images = hs_records_has_images(&pair_batch->of);
    for (int32_t e = 0; images && e < pair_batch->n; e++) {
        const hs_run *run = run_of(block, pair_batch->place[e]);
        for (int r = 0; r < bins->n_periodic; r++) {
            pair_batch->image[r][e] = run->image[r];
            pair_batch->times[r][e] = (double)run->image[r];
            any |= run->image[r];
        }
    }
    pair_batch->is_shifted = any != 0;
    pair_batch->has_zeros = false;
}

static void
look_up_points(hs_pair_batch *pair_batch)
{
    const hs_bins *bins = hs_search_asking(pair_batch->search);
    const int32_t *place = pair_batch->place, *si = pair_batch->si;
    const int      width = pair_batch->of.width;
    const int32_t  n = pair_batch->n;
    for (int k = 0; k < bins->ndim; k++) {
        const double *of_p = bins->keeps_originals ? bins->originals[k] : bins->x[k];
        const double *of_q = pair_batch->of.q + k;
        double       *p = pair_batch->p[k], *q = pair_batch->q[k];
        for (int32_t e = 0; e < n; e++) {
            p[e] = of_p[si[e]];
            q[e] = of_q[(int64_t)place[e] * width];
        }
    }
}

/* S = image + turns_i - turns_j; of points as given also the metric's shift. */
static void
look_up_narrow(hs_pair_batch *pair_batch)
{
    const bool      as_given = pair_batch->search->bins.keeps_originals;
    const hs_turns *turns = &hs_search_asking(pair_batch->search)->turns;
    const int32_t  *place = pair_batch->place, *si = pair_batch->si;
    const int32_t  *few = pair_batch->search->bins.turns.known ? pair_batch->of.few
                          : pair_batch->of.has_images          ? pair_batch->of.image
                                                               : NULL;
    const int32_t   n = pair_batch->n, width = pair_batch->of.width;
    int32_t         any = 0;
    for (int r = 0; r < pair_batch->search->bins.n_periodic; r++) {
        int32_t *to = pair_batch->shift[r];
        for (int32_t e = 0; e < n; e++) {
            to[e] = few != NULL ? few[(int64_t)place[e] * width + r] : 0;
        }
        for (int32_t e = 0; turns->known && e < n; e++) {
            to[e] += (int32_t)hs_turns_get(turns, r, si[e]);
        }
        for (int32_t e = 0; as_given && e < n; e++) {
            pair_batch->given[r][e] = to[e];
            pair_batch->times[r][e] = (double)to[e];
            any |= to[e];
        }
    }
    pair_batch->is_shifted = pair_batch->is_shifted || any != 0;
}

/* S = image + turns_i - turns_j over B, then over the box vectors as given. Without turns they are
 * all known to cancel or not to be needed. Returns the first pair whose S passes its range, or
 * their number. */
static int32_t
look_up_given(hs_pair_batch *pair_batch)
{
    const hs_bins *asking = hs_search_asking(pair_batch->search);
    const int      m = pair_batch->search->bins.n_periodic;
    for (int r = 0; r < m; r++) {
        const int64_t *turned = pair_batch->of.turned + r;
        int64_t       *to = pair_batch->given[r];
        for (int32_t e = 0; e < pair_batch->n; e++) {
            to[e] = turned[(int64_t)pair_batch->place[e] * pair_batch->of.width] +
                    turns_of(asking, r, pair_batch->si[e]);
        }
    }
    for (int32_t e = 0; !pair_batch->is_plain && e < pair_batch->n; e++) {
        int64_t reduced[HS_MAX_DIM], given[HS_MAX_DIM];
        for (int r = 0; r < m; r++) {
            reduced[r] = pair_batch->given[r][e];
        }
        if (!hs_lattice_shift(&pair_batch->search->scene.lattice, reduced, given)) {
            return e;
        }
        for (int r = 0; r < m; r++) {
            pair_batch->given[r][e] = given[r];
        }
    }
    return pair_batch->n;
}

/* Shifts over B, the metric's where it measures between X. Where the block has none, they are
 * zeroed once and left alone; how many times the metric shifts is not read then. */
static void
look_up_images(hs_pair_batch *pair_batch)
{
    const bool zero = !pair_batch->of.has_images;
    int32_t    any = 0;
    if (zero && pair_batch->has_zeros) {
        return;
    }
    for (int r = 0; r < pair_batch->search->bins.n_periodic; r++) {
        const int32_t *from = pair_batch->of.image + r;
        if (zero) {
            memset(pair_batch->image[r], 0, HS_BATCH * sizeof(int64_t));
        }
        for (int32_t e = 0; e < pair_batch->n && !zero; e++) {
            const int32_t image = from[(int64_t)pair_batch->place[e] * pair_batch->of.width];
            pair_batch->image[r][e] = image;
            pair_batch->times[r][e] = (double)image;
            any |= image;
        }
    }
    pair_batch->has_zeros = zero;
    pair_batch->is_shifted = any != 0 && !pair_batch->search->bins.keeps_originals;
}

/* The metric's shift of points as given, over the box vectors as given. */
static void
look_up_times(hs_pair_batch *pair_batch)
{
    int64_t any = 0, wide = 0;
    for (int r = 0; r < pair_batch->search->bins.n_periodic; r++) {
        const int64_t *from = pair_batch->given[r];
        for (int32_t e = 0; e < pair_batch->n; e++) {
            pair_batch->times[r][e] = (double)from[e];
            any |= from[e];
            wide |= from[e] > WIDEST_SHIFT || from[e] < -WIDEST_SHIFT;
        }
    }
    pair_batch->is_shifted = any != 0;
    pair_batch->is_wide = wide != 0;
}

hs_status
hs_pair_batch_look_up(hs_pair_batch *pair_batch, bool metric, int64_t *failed_point)
{
    const hs_bins *bins = hs_search_asking(pair_batch->search);
    metric = metric ||
             !pair_batch->of.is_narrow; /* shifts of the points as given are the metric's too */
    if (!pair_batch->of.needs_given && !pair_batch->of.has_metric &&
        pair_batch->n <= pair_batch->of.block->n / FEW_OF_BLOCK) {
        look_up_few(pair_batch);
        return HS_OK;
    }
    if (hs_records_load(&pair_batch->of, metric) != HS_OK) {
        return HS_ERR_INTERRUPTED;
    }
    if (metric) {
        look_up_points(pair_batch);
        look_up_images(pair_batch);
    }
    if (pair_batch->of.needs_given && pair_batch->of.is_narrow) {
        look_up_narrow(pair_batch);
    } else if (pair_batch->of.needs_given) {
        const int32_t fitting = look_up_given(pair_batch);
        if (fitting < pair_batch->n) {
            *failed_point = bins->order[pair_batch->si[fitting]];
            return HS_ERR_SHIFT_RANGE;
        }
    }
    if (bins->keeps_originals && !pair_batch->of.is_narrow) {
        look_up_times(pair_batch);
    }
    return HS_OK;
}

/* Batch kernels read a little beyond the last of n entries, where any finite numbers will do. */
static const double *
end_with_zeros(double *entries, int32_t n)
{
    memset(entries + n, 0, HS_BATCH_PADDING * sizeof *entries);
    return entries;
}

hs_batch
hs_pair_batch_view(hs_pair_batch *pair_batch)
{
    hs_batch batch = {.n = pair_batch->n};
    for (int k = 0; k < pair_batch->search->scene.ndim; k++) {
        batch.p[k] = end_with_zeros(pair_batch->p[k], pair_batch->n);
        batch.q[k] = end_with_zeros(pair_batch->q[k], pair_batch->n);
    }
    for (int r = 0; pair_batch->is_shifted && r < pair_batch->search->scene.lattice.n_periodic;
         r++) {
        batch.shift[r] = end_with_zeros(pair_batch->times[r], pair_batch->n);
    }
    return batch;
}

const int64_t *
hs_pair_batch_pair(const hs_pair_batch *pair_batch, int32_t e, double *p, double *q, int64_t *shift)
{
    const bool as_given = pair_batch->search->bins.keeps_originals;
    for (int k = 0; k < pair_batch->search->scene.ndim; k++) {
        p[k] = pair_batch->p[k][e];
        q[k] = pair_batch->q[k][e];
    }
    if (!pair_batch->is_shifted) {
        return NULL;
    }
    for (int r = 0; r < pair_batch->search->scene.lattice.n_periodic; r++) {
        shift[r] = as_given ? pair_batch->given[r][e] : pair_batch->image[r][e];
    }
    return shift;
}

/* Thresholds for rounded extents, so that there are few of them, each computed once. */

/* Candidates from which on those are left out that are far from the whole group: with fewer that
 * costs what it saves. Fewer will do for a group whose pairs reach less far than the cutoff. */
#ifdef HS_TESTING
#define WORTH_PRUNING      24 /* so that small scenes have both */
#define WORTH_PRUNING_MORE 8
#else
#define WORTH_PRUNING      300
#define WORTH_PRUNING_MORE 64
#endif
#define SHORTER 0.85 /* of the cutoff: half of its ball, about */

/* Thresholds of one float32 comparison: no hit is unsure. */
static void
set_single(const hs_scanner *scanner, hs_form *form)
{
    const double cutoff = scanner->search->scene.cutoff;
    const float  square = (float)(cutoff * cutoff);
    form->direct.out = scanner->options.inclusive ? square : nextafterf(square, -1.0f);
    form->direct.in = INFINITY;
    form->limits = (hs_limit_form){1.0f, 0.0f, 1.0f, 0.0f};
}

/* A scaled cutoff may be known between bounds only. */
static void
set_thresholds(const hs_scanner *scanner, hs_form *form)
{
    const hs_scene *scene = &scanner->search->scene;
    const double    extent = form->extent, error = scanner->search->filter_error;
    form->direct = hs_thresholds_of(scene->ndim, scene->cutoff, extent, error);
    if (scene->extreme) {
        const double low = scene->cutoff_low;
        form->direct.in = low > 0.0 ? hs_thresholds_of(scene->ndim, low, extent, error).in : -1.0f;
    }
}

static void
set_expanded(const hs_scanner *scanner, hs_form *form)
{
    const hs_scene *scene = &scanner->search->scene;
    const double    extent = form->extent, error = scanner->search->filter_error;
    form->expanded = hs_expanded_of(scene->ndim, scene->cutoff, extent, error);
    if (scene->extreme) {
        const double low = scene->cutoff_low;
        form->expanded.in = low > 0.0 ? hs_expanded_of(scene->ndim, low, extent, error).in
                                      : -INFINITY;
    }
}

/* As in all precisions: what the filter leaves is decided by a fixed formula. */
static void
set_support_form(const hs_scanner *scanner, hs_form *form)
{
    const hs_kernel *kernel = scanner->search->call->kernel;
    const bool       counts = scanner->scans == HS_BLOCK_COUNTS;
    form->scan = counts ? kernel->count_supports : kernel->list_supports;
    set_thresholds(scanner, form);
    form->limits = hs_support_form_of(scanner->search->scene.ndim, form->extent,
                                      scanner->search->filter_error);
}

static void
set_form(const hs_scanner *scanner, hs_form *form)
{
    const hs_kernel *kernel = scanner->search->call->kernel;
    const bool       counts = scanner->scans == HS_BLOCK_COUNTS;
    form->expanded = (hs_expanded){0.0, 0.0}; /* unless it pays */
    if (scanner->search->limits != NULL && scanner->search->limits->supports != NULL) {
        set_support_form(scanner, form);
        return;
    }
    form->scan = counts ? kernel->count_direct : kernel->list_direct;
    if (scanner->search->limits != NULL) {
        form->scan = counts ? kernel->count_limits : kernel->list_limits;
    }
    if (scanner->options.precision == HS_SINGLE) {
        set_single(scanner, form);
        return;
    }
    set_thresholds(scanner, form);
    if (scanner->search->limits != NULL) {
        form->limits = hs_limit_form_of(scanner->search->scene.ndim, form->extent,
                                        scanner->search->filter_error);
    } else if (scanner->scans == HS_BLOCK_LISTS_SQUARES) {
        form->scan = kernel->squares;
    } else if (hs_expanded_pays(scanner->search->scene.cutoff, form->extent)) {
        form->scan = counts ? kernel->count : kernel->list;
        set_expanded(scanner, form);
    }
}

/* Whether it was set for this extent, which NaN never is, and for all else that differs between the
 * searches of a walker. */
static bool
is_form_of(const hs_search *search, double extent, const hs_form *form)
{
    return form->extent == extent && form->cutoff == search->scene.cutoff &&
           form->cutoff_low == search->scene.cutoff_low && form->error == search->filter_error &&
           form->is_extreme == search->scene.extreme;
}

/* The form for |y_k| and |q_k| up to the float of these bits. */
static const hs_form *
form_of(hs_scanner *scanner, uint32_t bits)
{
    const uint32_t rounded = hs_extent_bits(bits);
    const double   extent = 2.0 * (double)hs_float_of_bits(rounded);
    hs_form       *form = &scanner->forms[(rounded >> HS_EXTENT_SHIFT) % HS_FORMS];
    if (!is_form_of(scanner->search, extent, form)) {
        form->extent = extent;
        form->cutoff = scanner->search->scene.cutoff;
        form->cutoff_low = scanner->search->scene.cutoff_low;
        form->error = scanner->search->filter_error;
        form->is_extreme = scanner->search->scene.extreme;
        set_form(scanner, form);
    }
    return form;
}

/* None is known yet. */
static void
forms_init(hs_scanner *scanner)
{
    for (int f = 0; f < HS_FORMS; f++) {
        scanner->forms[f].extent = -1.0;
    }
}

void
hs_form_set(hs_scanner *scanner)
{
    scanner->form = form_of(scanner, scanner->group.largest);
}

/* A length that no pair of the group is compared with more than: that of its radii, where those of
 * all points do not make it as long as the cutoff. */
static double
group_cutoff(const hs_scanner *scanner)
{
    const hs_limits *limits = scanner->search->limits;
    const double     cutoff = scanner->search->scene.cutoff;
    if (limits == NULL || (limits->of_asking.near == NULL && limits->of_points.near == NULL)) {
        return cutoff;
    }
    float asking = 0.0f;
    for (int32_t si = scanner->group.first;
         limits->of_asking.near != NULL && si < scanner->group.last; si++) {
        asking = fmaxf(asking, limits->of_asking.near[si]);
    }
    const hs_dw limit = hs_limit_by(limits->rule, 1.0, (double)asking,
                                    (double)limits->of_points.most, (double)limits->near_bound);
    /* More than what float32 and a sum have lost. */
    return hs_smaller((limit.hi + 0x1p-20 * cutoff) * (1.0 + 0x1p-20), cutoff);
}

/* Lets candidates of the present group be left out that are beyond the cutoff of all its points, or
 * their limits, where the block has so many that this is worth it. */
static void
form_prune(hs_scanner *scanner)
{
    const hs_search *search = scanner->search;
    hs_group        *group = &scanner->group;
    const double     cutoff = group_cutoff(scanner), error = search->filter_error;
    const bool       is_shorter = cutoff < SHORTER * search->scene.cutoff;
    if (scanner->block.n < (is_shorter ? WORTH_PRUNING_MORE : WORTH_PRUNING)) {
        return;
    }
    const double largest = (double)hs_group_bound(hs_search_asking(search), group);
    const double extent = hs_reach_extent(search->scene.cutoff, largest, error);
    const float  half = (float)(0.5 * extent * (1.0 + 0x1p-23)); /* no less, when rounded */
    /* Otherwise y might not be a float. Own points are kept whatever the threshold is. */
    if (half < 0x1p100f) {
        const hs_form *form = form_of(scanner, hs_bits_of_float(half));
        const float    out =
            is_shorter ? hs_thresholds_of(search->scene.ndim, cutoff, form->extent, error).out
                          : form->direct.out;
        group->near.out = fmaxf(out, 0.0f);
    }
}

/* The memory of a scanner is kept for the next search where that will do. */

/* What a choice looks at must be listed: numbers for labels, else places. */
static hs_block_use
use_of_scans(const hs_scanner *scanner)
{
    const bool lists_less = scanner->use == HS_BLOCK_COUNTS || scanner->use == HS_BLOCK_LISTS_IDS;
    if (!scanner->chooses || !lists_less) {
        return scanner->use;
    }
    return hs_choice_needs_places(scanner->search->call->choice, scanner->options.cutoff)
               ? HS_BLOCK_LISTS_PLACES
               : HS_BLOCK_LISTS_IDS;
}

/* Whether S of hits is looked up. */
static bool
needs_shifts(const hs_scanner *scanner)
{
    return scanner->use == HS_BLOCK_LISTS_PLACES ||
           (scanner->chooses &&
            hs_choice_compares(scanner->search->call->choice, scanner->options.cutoff));
}

/* Whether pairs are only looked up to decide them: then the arrays for that are made when there are
 * some, for small searches have none. By one thread alone, since the account serves one. */
static bool
looks_up_late(const hs_scanner *scanner)
{
    return (scanner->use == HS_BLOCK_COUNTS || scanner->use == HS_BLOCK_LISTS_IDS) &&
           !scanner->chooses && scanner->search->call->team == NULL;
}

static hs_status
open_pair_batch(bool needs_given, hs_scanner *scanner)
{
    return hs_pair_batch_init(scanner->search, &scanner->block, &scanner->options, needs_given,
                              &scanner->pair_batch);
}

/* Sets all but what has memory. */
static void
begin(hs_search *search, hs_block_use use, bool is_ordered, hs_scanner *scanner)
{
    memset((char *)scanner + offsetof(hs_scanner, search), 0,
           sizeof *scanner - offsetof(hs_scanner, search));
    scanner->search = search;
    scanner->options = search->call->options;
    scanner->use = use;
    scanner->chooses = search->call->choice != NULL && use != HS_BLOCK_SIZES;
    scanner->scans = use_of_scans(scanner);
    scanner->is_ordered = is_ordered;
    scanner->candidate_limit = INT64_MAX;
}

hs_status
hs_scanner_init(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                bool is_ordered, hs_scanner *scanner)
{
    hs_account *account = &search->call->account;
    begin(search, use, is_ordered, scanner);
    forms_init(scanner);
    scanner->pair_batch.memory = scanner->pair_batch.of.memory =
        NULL; /* freed also when never set */
    hs_status status = block_init(account, search->scene.ndim, scanner->scans, capacity, most_runs,
                                  &scanner->block);
    if (status == HS_OK && search->limits != NULL) {
        status = hs_block_add_radii(account, hs_limits_rows(search), &scanner->block);
    }
    if (status == HS_OK && !looks_up_late(scanner)) {
        status = open_pair_batch(needs_shifts(scanner), scanner);
    }
    if (status == HS_OK && is_ordered) {
        status = order_init(account, &scanner->block, &scanner->order);
    }
    return status;
}

/* The arrays for pairs to decide, where hs_scanner_init has left them for later: pair_batch.memory
 * is NULL. They are kept (hs_account_keep) where the walker is. */
static hs_status
scanner_open_pair_batch(hs_scanner *scanner)
{
    const hs_status status = open_pair_batch(false, scanner);
    if (hs_search_keeps_walker(scanner->search)) {
        hs_account_keep(&scanner->search->call->account);
    }
    return status;
}

bool
hs_scanner_renew(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                 hs_scanner *scanner)
{
    const hs_block    *block = &scanner->block;
    const hs_block_use scans = scanner->scans;
    if (block->memory == NULL || block->radius != NULL || search->limits != NULL ||
        scanner->search != search || scanner->is_ordered || scanner->use != use ||
        capacity > block->capacity || most_runs > block->most_runs) {
        return false;
    }
    begin(search, use, false, scanner);
    return scanner->scans == scans &&
           (scanner->pair_batch.memory == NULL ||
            pair_batch_renew(needs_shifts(scanner), &scanner->pair_batch));
}

void
hs_scanner_flush_counters(hs_search *search, hs_scanner *scanner)
{
    const hs_counters walked = {.groups = scanner->n_groups,
                                .candidates = scanner->n_candidates,
                                .ambiguous = scanner->n_ambiguous,
                                .by_float64 = scanner->stages.by_float64,
                                .by_double_word = scanner->stages.by_double_word,
                                .by_integers = scanner->stages.by_integers};
    hs_call_add_counters(search->call, &walked);
    scanner->n_groups = scanner->n_candidates = scanner->n_ambiguous = 0;
    scanner->stages = (hs_stages){0};
}

void
hs_scanner_close(hs_search *search, hs_scanner *scanner)
{
    hs_scanner_flush_counters(search, scanner);
    hs_order_free(&search->call->account, &scanner->block, &scanner->order);
    hs_pair_batch_free(&search->call->account, &scanner->pair_batch);
    block_free(&search->call->account, &scanner->block);
}

/* A batch of pairs at a time by the batch kernel; pairs that it leaves, one by one. */

/* A fraction of the square of the cutoff, far above the rounding of a sum of 8 squares. */
#define SCALED_MARGIN 0x1p-47

/* Takes the first n of scan->unsure from the hits of points [first, next). */
static void
remove_hits(hs_scan *scan, int32_t n, int32_t first, int32_t next)
{
    int32_t t = first, removed = 0;
    for (int32_t r = 0; r < n; r++) {
        for (; t < scan->unsure[r].t; t++) {
            scan->end[t] -= removed;
        }
        const int32_t from = scan->unsure[r].at + 1;
        const int32_t to = r + 1 < n ? scan->unsure[r + 1].at : (int32_t)scan->n_hits;
        memmove(scan->hits + from - removed - 1, scan->hits + from,
                (size_t)(to - from) * sizeof *scan->hits);
        removed++;
    }
    for (; t < next; t++) {
        scan->end[t] -= removed;
    }
}

/* Takes the first n of scan->unsure from the counts, where hits are not listed. */
static void
remove_counts(hs_scan *scan, int32_t n, int32_t first, int32_t next)
{
    int32_t removed = 0;
    for (int32_t t = first; t < next; t++) {
        while (removed < n && scan->unsure[removed].t == t) {
            removed++;
        }
        scan->end[t] -= removed;
    }
}

/* Decides one pair of the batch, by all stages or by the last alone. */
static bool
decide_pair(hs_scanner *scanner, const hs_metric *metric, int32_t e, bool others_failed)
{
    double         p[HS_MAX_DIM], q[HS_MAX_DIM];
    int64_t        of_pair[HS_MAX_DIM];
    const int64_t *shift = hs_pair_batch_pair(&scanner->pair_batch, e, p, q, of_pair);
    if (scanner->options.precision == HS_DOUBLE) {
        return hs_metric_within_double(metric, p, q, shift);
    }
    return others_failed ? hs_metric_decide_by_integers(metric, p, q, shift, &scanner->stages)
                         : hs_metric_within(metric, p, q, shift, &scanner->stages);
}

/*
 * Where squares would leave float64's range: decides by differences that are scaled so that the
 * cutoff is r in [1, 2). Rounding and what scaling loses change the sum of d squares, where it is
 * near r^2, by at most (d + 4) 2^-53 of it. Pairs without a shift only.
 */
static void
decide_scaled(const hs_metric *metric, const hs_pair_batch *pair_batch, uint8_t *verdict,
              hs_stages *stages)
{
    const hs_scale scale = hs_scale_of(metric->cutoff > 0.0 ? ilogb(metric->cutoff) : 0);
    const double   r = hs_scale_apply(scale, metric->cutoff);
    const double   in = r * r * (1.0 - SCALED_MARGIN), out = r * r * (1.0 + SCALED_MARGIN);
    double         square[HS_BATCH] = {0.0}, size[HS_BATCH] = {0.0};
    for (int k = 0; k < metric->ndim; k++) {
        for (int32_t e = 0; e < pair_batch->n; e++) {
            const double component = pair_batch->q[k][e] - pair_batch->p[k][e];
            const double scaled = hs_scale_apply(scale, component);
            square[e] += scaled * scaled;
            size[e] += fabs(component); /* for cutoff 0: 0 only if all are */
        }
    }
    for (int32_t e = 0; e < pair_batch->n; e++) {
        const bool within = r > 0.0 ? square[e] < in : size[e] == 0.0 && metric->inclusive;
        const bool beyond = r > 0.0 ? square[e] > out : !within;
        verdict[e] = within   ? (uint8_t)HS_WITHIN
                     : beyond ? (uint8_t)HS_BEYOND
                              : (uint8_t)HS_UNDECIDED;
        stages->by_float64 += within || beyond;
    }
}

void
hs_decide_pair_batch(hs_scanner *scanner, const hs_metric *metric, uint8_t *within)
{
    hs_pair_batch *pair_batch = &scanner->pair_batch;
    const bool     by_batch = scanner->options.precision != HS_DOUBLE && !pair_batch->is_wide;
    uint8_t        verdict[HS_BATCH + HS_BATCH_PADDING];
    if (by_batch && !metric->floats_usable && !pair_batch->is_shifted) {
        decide_scaled(metric, pair_batch, verdict, &scanner->stages);
    } else if (by_batch) {
        const hs_batch batch = hs_pair_batch_view(pair_batch);
        scanner->search->call->kernel->decide_batch(metric, &batch, verdict, &scanner->stages);
    }
    for (int32_t e = 0; e < pair_batch->n; e++) {
        within[e] = by_batch && verdict[e] != HS_UNDECIDED
                        ? verdict[e] == HS_WITHIN
                        : decide_pair(scanner, metric, e, by_batch);
    }
}

/* Decides one pair of the batch, whose limit is its own. */
static bool
decide_by_limit(hs_scanner *scanner, int32_t e, hs_dw limit)
{
    double         p[HS_MAX_DIM], q[HS_MAX_DIM];
    int64_t        of_pair[HS_MAX_DIM];
    hs_metric      metric = scanner->search->scene.metric;
    const int64_t *shift = hs_pair_batch_pair(&scanner->pair_batch, e, p, q, of_pair);
    if (limit.hi < 0.0) {
        return false;
    }
    if (scanner->options.precision == HS_SINGLE) {
        return scanner->options.inclusive; /* its square is that of the limit */
    }
    if (scanner->options.precision == HS_DOUBLE) {
        hs_metric_set_cutoff(limit.hi, &metric);
        return hs_metric_within_double(&metric, p, q, shift);
    }
    return hs_metric_within_sum(&metric, limit, p, q, shift, &scanner->stages);
}

/* Whether each pair of the batch is within its own limit. Where that is one number, as for points
 * of one size in a crystal, they are decided together. */
static void
decide_by_limits(hs_scanner *scanner, uint8_t *within)
{
    const int32_t n = scanner->pair_batch.n;
    hs_dw         limits[HS_BATCH];
    bool          is_one = scanner->options.precision != HS_SINGLE;
    for (int32_t e = 0; e < n; e++) {
        limits[e] = hs_limit_of_pair(scanner, e);
        is_one = is_one && limits[e].hi == limits[0].hi && limits[e].hi >= 0.0 &&
                 limits[e].lo == 0.0;
    }
    if (is_one) {
        hs_metric metric = scanner->search->scene.metric;
        hs_metric_set_cutoff(limits[0].hi, &metric);
        hs_decide_pair_batch(scanner, &metric, within);
        return;
    }
    for (int32_t e = 0; e < n; e++) {
        within[e] = decide_by_limit(scanner, e, limits[e]);
    }
}

/* Whether each pair of the batch is within its supports, and within the cutoff where these reach
 * further. Supports of no extent hold nothing but D = 0. */
static void
decide_by_supports(hs_scanner *scanner, uint8_t *within)
{
    const hs_supports *supports = scanner->search->limits->supports;
    hs_metric          ball = scanner->search->scene.metric;
    uint8_t            in_ball[HS_BATCH];
    if (supports->metric.limit.cutoff == 0.0) {
        hs_metric_set_cutoff(0.0, &ball);
        hs_decide_pair_batch(scanner, &ball, within);
        return;
    }
    hs_supports_decide(scanner, within);
    if (supports->is_bounded) {
        const hs_stages counted = scanner->stages;
        hs_decide_pair_batch(scanner, &ball, in_ball);
        scanner->stages = counted; /* a pair counts once */
        for (int32_t e = 0; e < scanner->pair_batch.n; e++) {
            within[e] = within[e] && in_ball[e];
        }
    }
}

/* Traces unsure hits from `u` on, as many as fit a batch; *next: the first that did not. */
static hs_status
batch_unsure(hs_scanner *scanner, const hs_scan *scan, int32_t u, int32_t *next)
{
    hs_pair_batch *pair_batch = &scanner->pair_batch;
    hs_pair_batch_clear(pair_batch);
    for (; u < scan->n_unsure && pair_batch->n < HS_BATCH; u++) {
        const hs_unsure unsure = scan->unsure[u];
        hs_pair_batch_put(pair_batch, scanner->group.first + unsure.t,
                          scanner->is_ordered ? scanner->block.origin[unsure.place] : unsure.place);
    }
    *next = u;
    return hs_pair_batch_look_up(pair_batch, true, &scanner->failed_point);
}

/* Decides scan->unsure, of the points [first, next) of the group, and takes those that are beyond
 * the cutoff from the hits; the order stays. */
static hs_status
hs_decide(hs_scanner *scanner, hs_scan *scan, int32_t first, int32_t next)
{
    int32_t n_beyond = 0;
    uint8_t within[HS_BATCH];
    for (int32_t u = 0, end; u < scan->n_unsure; u = end) {
        const hs_status status = batch_unsure(scanner, scan, u, &end);
        if (status != HS_OK) {
            return status;
        }
        if (scanner->search->limits != NULL && scanner->search->limits->supports != NULL) {
            decide_by_supports(scanner, within);
        } else if (scanner->search->limits != NULL) {
            decide_by_limits(scanner, within);
        } else {
            hs_decide_pair_batch(scanner, &scanner->search->scene.metric, within);
        }
        for (int32_t e = 0; e < end - u; e++) {
            scan->unsure[n_beyond] = scan->unsure[u + e]; /* those beyond gather in front */
            n_beyond += !within[e];
        }
    }
    scanner->n_ambiguous += scan->n_unsure;
    if (n_beyond > 0 && scanner->scans == HS_BLOCK_COUNTS) {
        remove_counts(scan, n_beyond, first, next);
    } else if (n_beyond > 0) {
        remove_hits(scan, n_beyond, first, next);
    }
    scan->n_hits -= n_beyond;
    return HS_OK;
}

/* Candidates between two calls of poll(): some milliseconds. */
#define POLL_WORK   (INT64_C(1) << 21)
#define WORK_OF_RUN 32 /* candidates that could be tested while a run of them is found */

/* Work of a block beside that of its candidates, in candidates. */
#define WORK_OF_BLOCK 64

/* Blocks with subnormal numbers before the filter flushes: some lie behind the last candidate. */
#define FEW_SUBNORMAL 16

/* The present block and group as a kernel sees them. */
static void
set_scan(const hs_scanner *scanner, hs_scan *scan)
{
    const hs_limits *limits = scanner->search->limits;
    const hs_block  *block = &scanner->block;
    const bool       lists_places = scanner->scans == HS_BLOCK_LISTS_PLACES;
    scan->ndim = scanner->search->scene.ndim;
    for (int k = 0; k < scan->ndim; k++) {
        scan->y[k] = block->y[k];
        scan->q[k] = scanner->group.q[k];
    }
    scan->label = block->place == NULL                       ? block->id
                  : scanner->is_ordered && !scanner->chooses ? block->origin
                                                             : block->place;
    scan->n = block->n;
    scan->n_points = scanner->group.last - scanner->group.first;
    scan->triangular = scanner->block_is_first;
    scan->norm = block->norm;
    scan->direct = scanner->form->direct;
    scan->expanded = scanner->form->expanded;
    scan->hits = block->hits;
    if (limits != NULL && limits->supports != NULL) {
        hs_supports_set(scanner, scan);
    } else if (limits != NULL) {
        hs_limits_set(scanner, &scanner->form->limits, &scan->limits);
    }
    scan->squares = block->squares;
    scan->unsure = block->unsure;
    scan->n_unsure = 0;
    scan->most_hits = block->most_hits;
    if (!lists_places && block->hits != NULL && scan->most_hits > 2 * HS_BURST) {
        HS_ASSERT(block->n + HS_BURST <= block->most_hits);
        scan->most_hits = block->n + HS_BURST;
    }
    scan->most_unsure = block->capacity;
}

static void
set_flushing(const hs_scanner *scanner, bool on)
{
    if (scanner->flushes) {
        hs_fpenv_flush(on);
    }
}

static int32_t
run_scan(const hs_scanner *scanner, hs_scan *scan, int32_t first)
{
    set_flushing(scanner, true);
    const int32_t next = scanner->form->scan(scan, first);
    set_flushing(scanner, false);
    return next;
}

/* precision="single" is decided by the filter: it must not flush. */
static void
note_subnormals(hs_scanner *scanner)
{
    if (!scanner->flushes && hs_fpenv_met_subnormal()) {
        hs_fpenv_flush(false); /* forgets the flag */
        scanner->flushes = scanner->options.precision != HS_SINGLE &&
                           ++scanner->n_subnormal > FEW_SUBNORMAL;
    }
}

/* Hands the hits of points [first, next) of the group to the visitor. */
static hs_status
visit_hits(hs_scanner *scanner, const hs_scan *scan, int32_t first, int32_t next)
{
    const int32_t si = scanner->group.first + first;
    const hs_hits hits = {.n = next - first,
                          .point = hs_search_asking(scanner->search)->order + si,
                          .end = scan->end + first,
                          .label = scan->hits};
    return scanner->visit(scanner->visit_context, scanner, si, &hits);
}

/* Makes the block ready to be scanned: gathers it, and sorts it where that is wanted. */
static hs_status
fill_block(hs_scanner *scanner)
{
    hs_block *block = &scanner->block;
    scanner->n_blocks++;
    scanner->work_since_poll += WORK_OF_BLOCK + block->n;
    if (!(scanner->group.near.out < INFINITY)) {
        form_prune(scanner);
    }
    set_flushing(scanner, true);
    hs_status status = block_gather(&scanner->search->bins, scanner->search->call->kernel,
                                    &scanner->options, scanner->block_is_first, block,
                                    &scanner->group);
    set_flushing(scanner, false);
    if (status != HS_OK) {
        return status;
    }
    hs_records_reset(&scanner->pair_batch.of);
    hs_form_set(scanner);
    if (!scanner->is_ordered) {
        return HS_OK;
    }
    status =
        order_block(scanner->search, &scanner->options, scanner->scans, block, &scanner->order);
    if (status == HS_ERR_SHIFT_RANGE) {
        scanner->failed_point = hs_search_asking(scanner->search)->order[scanner->group.first];
    }
    return status;
}

static hs_status
poll_sometimes(hs_scanner *scanner)
{
    if (scanner->work_since_poll > POLL_WORK) {
        scanner->work_since_poll = 0;
        return hs_poll(&scanner->options, hs_scanner_fraction(scanner));
    }
    return HS_OK;
}

static void
empty_block(hs_scanner *scanner)
{
    scanner->block.n = 0;
    scanner->block.n_runs = 0;
    scanner->block_is_first = false;
    scanner->blocks++;
}

/* Adds the size of the block to that of the neighbourhood; scans nothing. */
static hs_status
note_size(hs_scanner *scanner)
{
    scanner->of_group.candidates += scanner->block.n;
    scanner->of_group.runs += scanner->block.n_runs;
    scanner->work_since_poll += WORK_OF_RUN * (int64_t)scanner->block.n_runs;
    empty_block(scanner);
    return poll_sometimes(scanner);
}

/* Ends the walk if a limit or the visitor says so; else polls now and then. */
static hs_status
end_block(hs_scanner *scanner)
{
    if (scanner->n_candidates > scanner->candidate_limit || scanner->leaves) {
        return HS_STOPPED;
    }
    return poll_sometimes(scanner);
}

/* Counts what was tested, and empties the block. */
static hs_status
finish_block(hs_scanner *scanner, int64_t n_points)
{
    const hs_block *block = &scanner->block;
    const int64_t   skipped = scanner->block_is_first ? n_points * (n_points + 1) / 2 : 0;
    scanner->n_candidates += n_points * block->n - skipped;
    scanner->work_since_poll += n_points * block->n;
    empty_block(scanner);
    note_subnormals(scanner);
    return end_block(scanner);
}

/* Nothing has been appended or, in a half list, only the one point of the group itself. */
static bool
is_lone(const hs_scanner *scanner)
{
    return scanner->block.n == (scanner->block_is_first ? 1 : 0);
}

/* Decides the unsure hits of points [first, next) of the group. */
static hs_status
decide(hs_scanner *scanner, hs_scan *scan, int32_t first, int32_t next)
{
    hs_status status = HS_OK;
    if (scanner->pair_batch.memory == NULL) {
        status = scanner_open_pair_batch(scanner);
    }
    return status == HS_OK ? hs_decide(scanner, scan, first, next) : status;
}

hs_status
hs_scan_block(hs_scanner *scanner)
{
    int32_t end[HS_GROUP_POINTS];
    hs_scan scan;
    if (scanner->blocks < scanner->blocks_to_skip) {
        empty_block(scanner);
        return HS_OK;
    }
    if (scanner->use == HS_BLOCK_SIZES) {
        return note_size(scanner);
    }
    if (is_lone(scanner)) {
        empty_block(scanner);
        scanner->work_since_poll += WORK_OF_BLOCK;
        return end_block(scanner);
    }
    hs_status status = fill_block(scanner);
    if (status != HS_OK) {
        return status;
    }
    set_scan(scanner, &scan);
    scan.end = end;
    for (int32_t first = 0, next; status == HS_OK && first < scan.n_points; first = next) {
        next = run_scan(scanner, &scan, first);
        if (scan.n_unsure > 0 &&
            (scanner->options.precision != HS_SINGLE || scanner->search->limits != NULL)) {
            status = decide(scanner, &scan, first, next);
        }
        if (HS_UNLIKELY(scanner->chooses) && status == HS_OK) {
            status = hs_choose(scanner, &scan, first, next);
        }
        scanner->n_found += scan.n_hits;
        if (status == HS_OK && scanner->visit != NULL && scan.n_hits > 0) {
            status = visit_hits(scanner, &scan, first, next);
        }
    }
    return status == HS_OK ? finish_block(scanner, scan.n_points) : status;
}

void
hs_scanner_start(hs_scanner *scanner, int32_t first, int32_t last)
{
    const hs_search *search = scanner->search;
    scanner->n_groups += scanner->use != HS_BLOCK_SIZES;
    scanner->blocks = 0;
    scanner->block.n = 0;
    scanner->block.n_runs = 0;
    scanner->block_is_first = !search->is_full;
    scanner->of_group = (hs_neighbourhood){0, 0};
    hs_group_start(hs_search_asking(search), first, last, &scanner->group);
    if ((search->is_full || scanner->blocks_to_skip > 0) && scanner->use != HS_BLOCK_SIZES) {
        group_load(hs_search_asking(search), &scanner->group);
    }
}

hs_status
hs_scanner_append(hs_scanner *scanner, int32_t si, int32_t end, const double *shift,
                  const int32_t *image)
{
    while (si < end) {
        if (hs_block_is_full(&scanner->block)) {
            const hs_status status = hs_scan_block(scanner);
            if (status != HS_OK) {
                return status;
            }
        }
        si += block_append(&scanner->block, si, end, scanner->search->scene.ndim, shift, image,
                           &scanner->group);
        if (scanner->block.n_runs % HS_RUNS_PER_POLL == 0 &&
            hs_poll(&scanner->options, hs_scanner_fraction(scanner)) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

static void
keep_largest(int64_t found, int64_t *largest)
{
    *largest = found > *largest ? found : *largest;
}

hs_status
hs_scanner_finish(hs_scanner *scanner)
{
    const hs_status status = hs_scan_block(scanner);
    scanner->blocks_to_skip = 0;
    keep_largest(scanner->of_group.candidates, &scanner->most.candidates);
    keep_largest(scanner->of_group.runs, &scanner->most.runs);
    return status;
}
