/* SPDX-License-Identifier: BSD-3-Clause */
/* near_rank.c: see near_rank.h. */
#include "near_rank.h"

#include <math.h>

/* Up to here keys are sorted by insertion. */
#define FEW 24
/* Up to here each key's place is counted, without a branch. */
#define COUNTED 64
/* Of so many times the keys that are wanted, the others are first set aside. */
#define MANY 3

void
hs_near_ranker_free(hs_near_ranker *ranker)
{
    if (ranker->near != NULL) {
        hs_shared_release(ranker->near->shared, (void **)&ranker->keys);
        hs_shared_release(ranker->near->shared, (void **)&ranker->spare);
    }
}

static bool
reserve(hs_near_ranker *ranker, int64_t n)
{
    hs_shared    *shared = ranker->near->shared;
    const int64_t capacity = n + n / 2 + 256;
    if (n <= ranker->capacity) {
        return true;
    }
    ranker->capacity = 0;
    if (!hs_shared_resize(shared, (void **)&ranker->keys, 0, capacity, sizeof(hs_near_key)) ||
        !hs_shared_resize(shared, (void **)&ranker->spare, 0, capacity, sizeof(hs_near_key))) {
        return false;
    }
    ranker->capacity = capacity;
    return true;
}

/* Order of two keys: true when b must come before a. */
typedef bool (*before_fn)(hs_near_ranker *ranker, const hs_near_key *b, const hs_near_key *a);

HS_ALWAYS_INLINE bool
is_smaller(hs_near_ranker *ranker, const hs_near_key *b, const hs_near_key *a)
{
    (void)ranker;
    return b->square < a->square;
}

HS_ALWAYS_INLINE void
insert_all(hs_near_ranker *ranker, hs_near_key *keys, int64_t n, before_fn before)
{
    for (int64_t e = 1; e < n; e++) {
        const hs_near_key key = keys[e];
        int64_t           at = e;
        for (; at > 0 && before(ranker, &key, &keys[at - 1]); at--) {
            keys[at] = keys[at - 1];
        }
        keys[at] = key;
    }
}

/* Stable, by merging runs of FEW; with few calls of `before` where all is in order already. */
HS_ALWAYS_INLINE void
merge_all(hs_near_ranker *ranker, hs_near_key *keys, int64_t n, before_fn before)
{
    hs_near_key *left = ranker->spare;
    for (int64_t begin = 0; begin < n; begin += FEW) {
        insert_all(ranker, keys + begin, n - begin < FEW ? n - begin : FEW, before);
    }
    for (int64_t width = FEW; width < n; width *= 2) {
        for (int64_t begin = 0; begin + width < n; begin += 2 * width) {
            hs_near_key  *to = keys + begin, *right = to + width;
            const int64_t n_right = n - begin - width < width ? n - begin - width : width;
            if (!before(ranker, right, right - 1)) {
                continue;
            }
            memcpy(left, to, (size_t)width * sizeof *left);
            for (int64_t l = 0, r = 0; l < width;) {
                const bool takes_right = r < n_right && before(ranker, &right[r], &left[l]);
                *to++ = takes_right ? right[r++] : left[l++];
            }
        }
    }
}

/*
 * Each key goes to the place that is the number of smaller ones: as float32 squares whose last bits
 * are the keys' own numbers, so that no two are equal. Insertion puts in order what these cannot
 * tell, which is next to nothing.
 */
static void
sort_by_counting(hs_near_ranker *ranker, int64_t n)
{
    const int32_t padded = ((int32_t)n + 7) / 8 * 8;
    int32_t       rough[COUNTED];
    for (int32_t e = 0; e < padded; e++) {
        const float square = e < n ? (float)ranker->keys[e].square : 0.0f;
        int32_t     bits;
        memcpy(&bits, &square, sizeof bits);
        rough[e] = e < n ? (bits & ~(COUNTED - 1)) | e : INT32_MAX;
    }
    for (int32_t e = 0; e < n; e++) {
        const int32_t own = rough[e];
        int32_t       smaller = 0;
        for (int32_t f = 0; f < padded; f++) {
            smaller += rough[f] < own;
        }
        ranker->spare[smaller] = ranker->keys[e];
    }
    memcpy(ranker->keys, ranker->spare, (size_t)n * sizeof *ranker->keys);
    insert_all(ranker, ranker->keys, n, is_smaller);
}

/* Neighbouring keys are told apart if they differ by more. */
HS_ALWAYS_INLINE double
closeness(const hs_near_ranker *ranker, double square)
{
    return 2.0 * hs_near_error(ranker->block, ranker->near->tree.ndim, square);
}

static void
sort_by_square(hs_near_ranker *ranker, int64_t n)
{
    if (n <= COUNTED) {
        sort_by_counting(ranker, n);
    } else {
        merge_all(ranker, ranker->keys, n, is_smaller);
    }
}

bool
hs_near_pair(const hs_near *near, const hs_near_block *block, int32_t si, int32_t place, double *q,
             int64_t *shift, int64_t *given)
{
    const hs_bins       *bins = &near->search->bins, *asking = hs_search_asking(near->search);
    const hs_near_image *image = &block->images[block->runs[block->run_of[place]].image];
    const int32_t        sj = hs_near_number(block, place);
    const int            m = bins->n_periodic;
    int64_t              turned[HS_MAX_DIM] = {0}, as_given[HS_MAX_DIM];
    for (int k = 0; k < bins->ndim; k++) {
        q[k] = bins->keeps_originals ? bins->originals[k][sj] : bins->x[k][sj];
    }
    for (int r = 0; r < m; r++) {
        shift[r] = image->shift[r];
    }
    if (m == 0 || (given == NULL && !bins->keeps_originals)) {
        return true;
    }
    for (int r = 0; r < m; r++) {
        turned[r] = shift[r];
        if (bins->turns.known) {
            turned[r] += hs_turns_get(&asking->turns, r, si) - hs_turns_get(&bins->turns, r, sj);
        }
    }
    if (!hs_lattice_shift(&near->search->scene.lattice, turned, as_given)) {
        return false;
    }
    for (int r = 0; r < m; r++) {
        shift[r] = bins->keeps_originals ? as_given[r] : shift[r];
        if (given != NULL) {
            given[r] = as_given[r];
        }
    }
    return true;
}

/* Where the point that asks is, for the metric. */
static void
take_origin(const hs_near *near, int32_t si, double *p)
{
    const hs_bins *asking = hs_search_asking(near->search);
    for (int k = 0; k < asking->ndim; k++) {
        p[k] = asking->keeps_originals ? asking->originals[k][si] : asking->x[k][si];
    }
}

static bool
is_nearer(hs_near_ranker *ranker, const hs_near_key *b, const hs_near_key *a)
{
    const hs_near *near = ranker->near;
    double         p[HS_MAX_DIM], q[2][HS_MAX_DIM];
    int64_t        shift[2][HS_MAX_DIM];
    take_origin(near, ranker->si, p);
    ranker->n_compared++;
    /* Shifts that pass their range are found when the pair is written; here any order will do. */
    if (!hs_near_pair(near, ranker->block, ranker->si, b->place, q[0], shift[0], NULL) ||
        !hs_near_pair(near, ranker->block, ranker->si, a->place, q[1], shift[1], NULL)) {
        return false;
    }
    return hs_metric_compare(&near->order, &(hs_span){p, q[0], shift[0]},
                             &(hs_span){p, q[1], shift[1]}, &ranker->stages) < 0;
}

/* By (j, S). Images of one j differ by their shifts over B, which the turns of i and j leave. */
static bool
is_listed_before(hs_near_ranker *ranker, const hs_near_key *b, const hs_near_key *a)
{
    const hs_search     *search = ranker->near->search;
    const hs_near_block *block = ranker->block;
    const int32_t        j = search->bins.order[hs_near_number(block, b->place)];
    const int32_t        other = search->bins.order[hs_near_number(block, a->place)];
    int64_t              difference[HS_MAX_DIM] = {0}, given[HS_MAX_DIM];
    if (j != other) {
        return j < other;
    }
    for (int r = 0; r < search->bins.n_periodic; r++) {
        difference[r] =
            (int64_t)block->images[block->runs[block->run_of[b->place]].image].shift[r] -
            block->images[block->runs[block->run_of[a->place]].image].shift[r];
    }
    if (!hs_lattice_shift(&search->scene.lattice, difference, given)) {
        return false;
    }
    for (int l = 0; l < search->bins.n_periodic; l++) {
        if (given[l] != 0) {
            return given[l] < 0;
        }
    }
    return false;
}

/* Sorted keys whose squares are too close to tell, as far as they reach into the first `wanted`. */
static void
settle_order(hs_near_ranker *ranker, int64_t n, int64_t wanted)
{
    hs_near_key *const all = ranker->keys;
    for (int64_t begin = 0, end; begin < wanted; begin = end) {
        end = begin + 1;
        while (end < n && all[end].square - all[end - 1].square <=
                              closeness(ranker, all[end].square)) {
            end++;
        }
        if (end - begin > 1) {
            merge_all(ranker, all + begin, end - begin, is_listed_before);
            merge_all(ranker, all + begin, end - begin, is_nearer);
        }
    }
}

/* Squares of the hits that are not beyond the limit; returns how many. */
HS_ALWAYS_INLINE int64_t
fill_keys(hs_near_ranker *ranker, const int32_t *hits, int64_t n, double limit, const int ndim)
{
    const hs_near_block *block = ranker->block;
    const hs_bins       *asking = hs_search_asking(ranker->near->search);
    hs_near_key         *keys = ranker->keys;
    double               at[HS_MAX_DIM];
    int64_t              n_keys = 0;
    for (int k = 0; k < ndim; k++) {
        at[k] = asking->x[k][ranker->si];
    }
    for (int64_t h = 0; h < n; h++) {
        double square = 0.0;
        for (int k = 0; k < ndim; k++) {
            const double along = (block->z[k][hits[h]] - at[k]) * block->unit;
            square += along * along;
        }
        keys[n_keys].square = square;
        keys[n_keys].place = hits[h];
        n_keys += square <= limit;
    }
    return n_keys;
}

/* The point itself, in its own image, which is among the keys of distance about 0. */
static int64_t
drop_self(hs_near_ranker *ranker, int64_t n)
{
    const hs_near_block *block = ranker->block;
    for (int64_t e = 0; e < n; e++) {
        const int32_t place = ranker->keys[e].place;
        if (ranker->keys[e].square <= block->flat_error &&
            hs_near_number(block, place) == ranker->si &&
            block->images[block->runs[block->run_of[place]].image].is_home) {
            ranker->keys[e] = ranker->keys[n - 1];
            return n - 1;
        }
    }
    return n;
}

/* Brings the `wanted` keys of least squares to the front, in no order. */
static void
select_keys(hs_near_key *keys, int64_t n, int64_t wanted)
{
    for (int64_t low = 0, high = n - 1; low < high;) {
        const double pivot = keys[low + (high - low) / 2].square;
        int64_t      i = low, j = high;
        while (i <= j) {
            while (keys[i].square < pivot) {
                i++;
            }
            while (keys[j].square > pivot) {
                j--;
            }
            if (i <= j) {
                const hs_near_key key = keys[i];
                keys[i++] = keys[j];
                keys[j--] = key;
            }
        }
        if (wanted - 1 <= j) {
            high = j;
        } else if (wanted - 1 >= i) {
            low = i;
        } else {
            return;
        }
    }
}

/* Leaves out what surely comes after the first `wanted`. */
static int64_t
keep_nearest(hs_near_ranker *ranker, int64_t n, int64_t wanted)
{
    hs_near_key *keys = ranker->keys;
    double       last = 0.0;
    int64_t      kept = wanted;
    select_keys(keys, n, wanted);
    for (int64_t e = 0; e < wanted; e++) {
        last = hs_larger(keys[e].square, last);
    }
    last += 2.0 * closeness(ranker, last);
    for (int64_t e = wanted; e < n; e++) {
        if (keys[e].square <= last) {
            const hs_near_key key = keys[e];
            keys[e] = keys[kept];
            keys[kept++] = key;
        }
    }
    return kept;
}

hs_status
hs_near_rank(hs_near_ranker *ranker, const hs_near_group *group, int32_t si, const int32_t *hits,
             int64_t n, int64_t *count)
{
    const hs_near_block *block = ranker->block;
    const int            d = ranker->near->tree.ndim;
    const int64_t        k = ranker->near->k;
    const double         reach = block->reach * block->reach;
    const double         limit = reach * (1.0 + 0x1p-40) + hs_near_error(block, d, reach);
    *count = -1;
    ranker->si = si;
    if (!reserve(ranker, n)) {
        return HS_ERR_MEMORY;
    }
    switch (d) {
    case 2: n = fill_keys(ranker, hits, n, limit, 2); break;
    case 3: n = fill_keys(ranker, hits, n, limit, 3); break;
    default: n = fill_keys(ranker, hits, n, limit, d);
    }
    n = ranker->near->omits_self ? drop_self(ranker, n) : n;
    if (n < k && !group->is_complete) {
        return HS_OK;
    }
    const int64_t wanted = n < k ? n : k;
    if (n > MANY * wanted && n > COUNTED) {
        n = keep_nearest(ranker, n, wanted);
    }
    sort_by_square(ranker, n);
    if (!group->is_complete && wanted > 0) {
        const double last = ranker->keys[wanted - 1].square;
        if (last + closeness(ranker, last) > reach * (1.0 - 0x1p-40)) {
            return HS_OK;
        }
    }
    settle_order(ranker, n, wanted);
    *count = wanted;
    return HS_OK;
}
