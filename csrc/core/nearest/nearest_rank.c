/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_rank.c: squares in float64 are sorted; neighbours in that order that are too close are
 * compared exactly. */
#include "nearest_rank.h"

/* A part of the largest square. The last bits of a key hold the number of its hit: this is twice
 * what two keys lose by that. */
#define KEY_ERROR 0x1p-15
/* Where there are more than so many times the keys that are wanted, the farthest are set aside
 * before the others are sorted. */
#define MANY 3
/* Among very many keys that float64 cannot tell apart, the nearest are found by insertion where no
 * more than so many are wanted. */
#define MOST_INSERTED 64

void
hs_nearest_ranker_free(hs_nearest_ranker *ranker)
{
    hs_shared_release(ranker->near->shared, (void **)&ranker->keys);
    hs_shared_release(ranker->near->shared, (void **)&ranker->spare);
}

static bool
reserve(hs_nearest_ranker *ranker, int64_t n)
{
    hs_shared    *shared = ranker->near->shared;
    const int64_t capacity = n + n / 2 + 256;
    if (n <= ranker->capacity) {
        return true;
    }
    ranker->capacity = 0;
    if (!hs_shared_resize(shared, (void **)&ranker->keys, 0, capacity, sizeof(hs_nearest_key)) ||
        !hs_shared_resize(shared, (void **)&ranker->spare, 0, capacity, sizeof(hs_nearest_key))) {
        return false;
    }
    ranker->capacity = capacity;
    return true;
}

/* Neighbouring keys are told apart if they differ by more. */
HS_ALWAYS_INLINE double
closeness(const hs_nearest_ranker *ranker, double square)
{
    return 2.0 * hs_nearest_error(ranker->block, ranker->near->tree.ndim, square);
}

bool
hs_nearest_pair(const hs_nearest *near, const hs_nearest_block *block, int32_t si, int32_t place,
                double *q, int64_t *shift, int64_t *given)
{
    const hs_bins          *bins = &near->search->bins, *asking = hs_search_asking(near->search);
    const hs_nearest_image *image = hs_nearest_image_of(block, place);
    const int32_t           sj = block->number[place];
    const int               m = bins->n_periodic;
    int64_t                 turned[HS_MAX_DIM] = {0}, as_given[HS_MAX_DIM];
    for (int k = 0; k < bins->ndim; k++) {
        q[k] = bins->keeps_originals ? bins->originals[k][sj] : bins->x[k][sj];
    }
    for (int r = 0; r < m; r++) {
        shift[r] = image->shift[r];
    }
    if (m == 0 || (given == NULL && !bins->keeps_originals)) {
        return true;
    }
    HS_ASSERT(bins->turns.known && asking->turns.known);
    for (int r = 0; r < m; r++) {
        turned[r] =
            shift[r] + hs_turns_get(&asking->turns, r, si) - hs_turns_get(&bins->turns, r, sj);
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

/* Copies the coordinates of the asking point that the metric measures from. */
static void
take_origin(const hs_nearest *near, int32_t si, double *p)
{
    const hs_bins *asking = hs_search_asking(near->search);
    for (int k = 0; k < asking->ndim; k++) {
        p[k] = asking->keeps_originals ? asking->originals[k][si] : asking->x[k][si];
    }
}

/* Sign of the difference of two distances. */
static int
compare(hs_nearest_ranker *ranker, const hs_nearest_key *one, const hs_nearest_key *other)
{
    const hs_nearest *near = ranker->near;
    double            p[HS_MAX_DIM], q[2][HS_MAX_DIM];
    int64_t           shift[2][HS_MAX_DIM];
    take_origin(near, ranker->si, p);
    ranker->n_compared++;
    /* Shifts that pass their range are found when the pair is written; here any order will do. */
    if (!hs_nearest_pair(near, ranker->block, ranker->si, one->place, q[0], shift[0], NULL) ||
        !hs_nearest_pair(near, ranker->block, ranker->si, other->place, q[1], shift[1], NULL)) {
        return 0;
    }
    return hs_metric_compare(&near->order, &(hs_span){p, q[0], shift[0]},
                             &(hs_span){p, q[1], shift[1]}, &ranker->stages);
}

static bool
is_nearer(void *ranker, const hs_nearest_key *b, const hs_nearest_key *a)
{
    return compare(ranker, b, a) < 0;
}

/* Whether b comes before a by (j, S). The turns of i and j are common to all images of one j, so
 * shifts over B tell these apart. */
static bool
is_listed_before(void *context, const hs_nearest_key *b, const hs_nearest_key *a)
{
    const hs_nearest_ranker *ranker = context;
    const hs_search         *search = ranker->near->search;
    const hs_nearest_block  *block = ranker->block;
    const int32_t            j = search->bins.order[block->number[b->place]];
    const int32_t            other = search->bins.order[block->number[a->place]];
    int64_t                  difference[HS_MAX_DIM] = {0}, given[HS_MAX_DIM];
    if (j != other) {
        return j < other;
    }
    for (int r = 0; r < search->bins.n_periodic; r++) {
        difference[r] = (int64_t)hs_nearest_image_of(block, b->place)->shift[r] -
                        hs_nearest_image_of(block, a->place)->shift[r];
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

/* Puts in exact order the first `wanted` of n keys that float64 cannot tell; the others come behind
 * them. */
static void
settle_keys(hs_nearest_ranker *ranker, hs_nearest_key *keys, int64_t n, int64_t wanted)
{
    hs_nearest_pace *pace = &ranker->pace;
    const int64_t    sorted = wanted <= MOST_INSERTED && n > 4 * wanted ? wanted : n;
    hs_nearest_merge(pace, ranker, keys, ranker->spare, sorted, is_listed_before);
    hs_nearest_merge(pace, ranker, keys, ranker->spare, sorted, is_nearer);
    for (int64_t e = sorted; e < n && hs_nearest_goes_on(pace, 1); e++) {
        const hs_nearest_key key = keys[e];
        int64_t              at = sorted;
        while (at > 0) {
            const int sign = compare(ranker, &key, &keys[at - 1]);
            if (sign > 0 || (sign == 0 && !is_listed_before(ranker, &key, &keys[at - 1]))) {
                break;
            }
            at--;
        }
        if (at < sorted) {
            keys[e] = keys[sorted - 1];
            memmove(keys + at + 1, keys + at, (size_t)(sorted - 1 - at) * sizeof *keys);
            keys[at] = key;
        }
    }
}

/* Finds sorted keys whose squares are too close to tell, among the first `wanted`, and settles
 * them. */
static void
settle_order(hs_nearest_ranker *ranker, int64_t n, int64_t wanted)
{
    hs_nearest_key *const all = ranker->keys;
    for (int64_t begin = 0, end; begin < wanted; begin = end) {
        end = begin + 1;
        while (end < n &&
               all[end].square - all[end - 1].square <= closeness(ranker, all[end].square)) {
            end++;
        }
        if (end - begin > 1) {
            settle_keys(ranker, all + begin, end - begin, wanted - begin);
        }
    }
}

/* Squares of the hits that are not beyond the limit; returns how many. */
HS_ALWAYS_INLINE int64_t
fill_keys(hs_nearest_ranker *ranker, const int32_t *hits, int64_t n, double limit, const int ndim)
{
    const hs_nearest_block     *block = ranker->block;
    const hs_bins              *asking = hs_search_asking(ranker->near->search);
    hs_nearest_key *HS_RESTRICT keys = ranker->keys;
    const double               *x[HS_MAX_DIM], unit = block->unit;
    double                      at[HS_MAX_DIM];
    int64_t                     n_keys = 0;
    for (int k = 0; k < ndim; k++) {
        at[k] = asking->x[k][ranker->si];
        x[k] = ranker->near->search->bins.x[k];
    }
    for (int64_t h = 0; h < n; h++) {
        const int32_t place = hits[h], sj = block->number[place];
        const double *moved = hs_nearest_image_of(block, place)->moved;
        double        square = 0.0;
        for (int k = 0; k < ndim; k++) {
            const double along = (x[k][sj] + moved[k] - at[k]) * unit;
            square += along * along;
        }
        keys[n_keys].square = square;
        keys[n_keys].place = place;
        n_keys += square <= limit;
    }
    return n_keys;
}

/* The point itself, in its own image, which is among the keys of distance about 0. */
static int64_t
drop_self(hs_nearest_ranker *ranker, int64_t n)
{
    const hs_nearest_block *block = ranker->block;
    for (int64_t e = 0; e < n; e++) {
        const int32_t place = ranker->keys[e].place;
        if (ranker->keys[e].square <= block->flat_error && block->number[place] == ranker->si &&
            hs_nearest_image_of(block, place)->is_home) {
            ranker->keys[e] = ranker->keys[n - 1];
            return n - 1;
        }
    }
    return n;
}

/* Leaves out what surely comes after the first `wanted`. */
static int64_t
keep_nearest(hs_nearest_ranker *ranker, int64_t n, int64_t wanted)
{
    hs_nearest_key *keys = ranker->keys;
    double          last = 0.0;
    int64_t         kept = wanted;
    hs_nearest_select(keys, n, wanted);
    for (int64_t e = 0; e < wanted; e++) {
        last = hs_larger(keys[e].square, last);
    }
    last += 2.0 * closeness(ranker, last);
    for (int64_t e = wanted; e < n; e++) {
        if (keys[e].square <= last) {
            const hs_nearest_key key = keys[e];
            keys[e] = keys[kept];
            keys[kept++] = key;
        }
    }
    return kept;
}

HS_ALWAYS_INLINE float
square_of(int32_t key)
{
    return hs_float_of_bits((uint32_t)key);
}

bool
hs_nearest_rank_fast(hs_nearest_ranker *ranker, int32_t si, const int32_t *hits,
                     const float *squares, int64_t n, int64_t *count)
{
    const hs_nearest_block *block = ranker->block;
    const bool              omits_self = ranker->near->omits_self;
    const int64_t           wanted = ranker->near->k + omits_self;
    const double            reach = block->reach * block->reach;
    /* The error of two squares, and of two keys. */
    const double least = 2.0 * block->square_error + KEY_ERROR * reach;
    int32_t      keys[HS_ORDER_MOST + 1];
    *count = -1;
    if (n < wanted || n > HS_ORDER_MOST) {
        return n < wanted;
    }
    ranker->si = si;
    ranker->near->search->call->kernel->order(squares, (int32_t)n, keys);
    keys[n] = HS_ORDER_LAST;
    bool is_sure = square_of(keys[wanted - 1]) + least < reach;
    for (int64_t e = 0; e < wanted; e++) {
        is_sure = is_sure & (square_of(keys[e + 1]) - square_of(keys[e]) > (float)least);
    }
    if (is_sure && omits_self) {
        const int32_t first = hits[keys[0] & (HS_ORDER_MOST - 1)];
        is_sure = block->number[first] == si && hs_nearest_image_of(block, first)->is_home;
    }
    if (!is_sure || !reserve(ranker, n)) {
        return false;
    }
    for (int64_t e = omits_self; e < wanted; e++) {
        const int32_t key = keys[e];
        ranker->keys[e - omits_self] =
            (hs_nearest_key){square_of(key), hits[key & (HS_ORDER_MOST - 1)]};
    }
    *count = ranker->near->k;
    return true;
}

hs_status
hs_nearest_rank(hs_nearest_ranker *ranker, const hs_nearest_group *group, int32_t si,
                const int32_t *hits, int64_t n, int64_t *count)
{
    const hs_nearest_block *block = ranker->block;
    const int               d = ranker->near->tree.ndim;
    const int64_t           k = ranker->near->k;
    const double            reach = block->reach * block->reach;
    const double            limit = reach * (1.0 + 0x1p-40) + hs_nearest_error(block, d, reach);
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
    if (!hs_nearest_goes_on(&ranker->pace, n)) {
        return ranker->pace.status;
    }
    if (n < k && !group->is_complete) {
        return HS_OK;
    }
    const int64_t wanted = n < k ? n : k;
    if (n > MANY * wanted && n > HS_NEAREST_COUNTED) {
        n = keep_nearest(ranker, n, wanted);
    }
    hs_nearest_sort(&ranker->pace, &ranker->keys, &ranker->spare, n, limit);
    if (!group->is_complete) { /* then there are as many as are wanted */
        const double last = ranker->keys[wanted - 1].square;
        if (last + closeness(ranker, last) > reach * (1.0 - 0x1p-40)) {
            return HS_OK;
        }
    }
    settle_order(ranker, n, wanted);
    *count = wanted;
    return ranker->pace.status;
}
