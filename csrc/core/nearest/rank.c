/* SPDX-License-Identifier: BSD-3-Clause */
#include "rank.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* rank.c: keys of hits or of a walk, their exact order, and the rows that they become. */

/* A part of the largest square. The last bits of a key of the kernel hold the number of its hit:
 * this is twice what two keys lose by that. */
#define KEY_ERROR 0x1p-15
/* Where there are more than so many times the keys that are wanted, and more than so many, the
 * farthest are set aside before the others are sorted. */
#define MANY      3
#define MANY_KEYS 64
/* Among very many keys that float64 cannot tell apart, the nearest are found by insertion where no
 * more than so many are wanted. */
#define MOST_INSERTED 64
#define FEW           24 /* up to here keys are sorted by insertion */
/* What deciding whether a point counts may take, in points: images of it are compared. */
#define STEPS_OF_CHOICE 16

void
hs_nearest_ranker_free(hs_nearest_ranker *ranker)
{
    hs_shared *shared = ranker->near->shared;
    hs_shared_release(shared, (void **)&ranker->keys);
    hs_shared_release(shared, (void **)&ranker->spare);
    hs_shared_release(shared, (void **)&ranker->least);
    hs_shared_release(shared, (void **)&ranker->walked);
    hs_shared_release(shared, (void **)&ranker->waiting);
}

void
hs_nearest_ranker_set(hs_nearest_ranker *ranker, int32_t si)
{
    const hs_search *search = ranker->near->search;
    ranker->si = si;
    ranker->n = 0;
    ranker->status = HS_OK;
    if (search->call->choice != NULL) {
        hs_chooser_set(search->call->choice, hs_search_asking(search)->order[si], &ranker->chooser);
    }
}

/* Room for n keys beside those that there are. */
static bool
reserve(hs_nearest_ranker *ranker, int64_t n)
{
    hs_shared    *shared = ranker->near->shared;
    const int64_t capacity = ranker->n + n + (ranker->n + n) / 2 + 256;
    if (ranker->n + n <= ranker->capacity) {
        return true;
    }
    ranker->capacity = 0;
    if (!hs_shared_resize(shared, (void **)&ranker->keys, ranker->n, capacity,
                          sizeof(hs_nearest_key)) ||
        !hs_shared_resize(shared, (void **)&ranker->spare, 0, capacity, sizeof(hs_nearest_key))) {
        return false;
    }
    ranker->capacity = capacity;
    return true;
}

/* Counts so many more steps, and polls now and then; false: stop. Once what may take long does not
 * go on, keys are in any order, some of them twice, and of no use. */
HS_ALWAYS_INLINE bool
goes_on(hs_nearest_ranker *ranker, int64_t steps)
{
    ranker->steps += steps;
    if (ranker->steps >= HS_NEAREST_POLL_STEPS && ranker->status == HS_OK) {
        ranker->steps = 0;
        ranker->status = hs_poll(ranker->options, 0.0);
    }
    return ranker->status == HS_OK;
}

/* Neighbouring keys are told apart if they differ by more. */
HS_ALWAYS_INLINE double
closeness(const hs_nearest_ranker *ranker, double square)
{
    return 2.0 * hs_nearest_error(&ranker->frame, ranker->near->tree.ndim, square);
}

/* What the metric measures to, and its shift, of a key's point; also S over the periodic box
 * vectors as given when `given` is not NULL. False when a shift passes its range. */
static bool
pair_of(const hs_nearest_ranker *ranker, const hs_nearest_key *key, double *q, int64_t *shift,
        int64_t *given)
{
    const hs_search *search = ranker->near->search;
    const hs_bins   *bins = &search->bins, *asking = hs_search_asking(search);
    const int32_t   *image = ranker->images[key->image].shift;
    const int        m = bins->n_periodic;
    int64_t          turned[HS_MAX_DIM] = {0}, as_given[HS_MAX_DIM];
    for (int k = 0; k < bins->ndim; k++) {
        q[k] = bins->keeps_originals ? bins->originals[k][key->number] : bins->x[k][key->number];
    }
    for (int r = 0; r < m; r++) {
        shift[r] = image[r];
    }
    if (m == 0 || (given == NULL && !bins->keeps_originals)) {
        return true;
    }
    HS_ASSERT(bins->turns.known && asking->turns.known);
    for (int r = 0; r < m; r++) {
        turned[r] = shift[r] + hs_turns_get(&asking->turns, r, ranker->si) -
                    hs_turns_get(&bins->turns, r, key->number);
    }
    if (!hs_lattice_shift(&search->scene.lattice, turned, as_given)) {
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

/* Coordinates of the asking point that the metric measures from. */
HS_ALWAYS_INLINE void
take_origin(const hs_nearest_ranker *ranker, double *p)
{
    const hs_bins *asking = hs_search_asking(ranker->near->search);
    for (int k = 0; k < asking->ndim; k++) {
        p[k] = (asking->keeps_originals ? asking->originals : asking->x)[k][ranker->si];
    }
}

/* How far a square may be from the true one, in either direction, however far the point is. */
static double
square_error(const hs_nearest_ranker *ranker, double square)
{
    hs_nearest_frame frame;
    hs_nearest_frame_set(ranker->near->tree.ndim, 1.0, ranker->frame.error, sqrt(square), &frame);
    return 2.0 * hs_nearest_error(&frame, ranker->near->tree.ndim, square);
}

/* ---- which keys count: what the call's choice leaves out ---- */

/* Whether a pair that is excluded in its nearest image is in this one. */
static hs_status
is_excluded_here(const hs_nearest_ranker *ranker, const hs_nearest_key *key, bool *excluded)
{
    const hs_search *search = ranker->near->search;
    const hs_choice *choice = ranker->chooser.choice;
    double           q[HS_MAX_DIM];
    int64_t          shift[HS_MAX_DIM], given[HS_MAX_DIM];
    *excluded = true;
    if (choice->shortest == INFINITY) { /* there are no others */
        return HS_OK;
    }
    const double square = key->square + square_error(ranker, key->square);
    const double far = hs_scale_apply(search->scene.unscale, sqrt(square) / ranker->frame.unit);
    if (!hs_choice_compares(choice, hs_smaller(far, search->call->options.cutoff))) {
        return HS_OK;
    }
    *excluded = false;
    /* Shifts that pass their range are found when the pair is written. */
    return pair_of(ranker, key, q, shift, given)
               ? hs_choice_is_nearest(choice, ranker->chooser.point,
                                      search->bins.order[key->number], given, excluded)
               : HS_OK;
}

/* Whether a pair is that of a point with itself. */
static bool
is_itself(const hs_nearest_ranker *ranker, const hs_nearest_key *key)
{
    const hs_bins *bins = &ranker->near->search->bins;
    double         q[HS_MAX_DIM];
    int64_t        shift[HS_MAX_DIM], given[HS_MAX_DIM] = {0}, any = 0;
    if (bins->order[key->number] != ranker->chooser.excluding.itself ||
        !pair_of(ranker, key, q, shift, given)) {
        return false;
    }
    for (int r = 0; r < bins->n_periodic; r++) {
        any |= given[r];
    }
    return any == 0;
}

/* Whether a pair is nearer than the least distance. */
static bool
is_too_near(hs_nearest_ranker *ranker, const hs_nearest_key *key)
{
    const hs_nearest *near = ranker->near;
    const double      least = near->least * ranker->frame.unit, square = least * least;
    const double      error = square_error(ranker, hs_larger(square, key->square));
    double            p[HS_MAX_DIM], q[HS_MAX_DIM];
    int64_t           shift[HS_MAX_DIM];
    if (near->least == 0.0 || key->square - error > square) {
        return false;
    }
    if (!(key->square + error < square)) {
        take_origin(ranker, p);
        if (!pair_of(ranker, key, q, shift, NULL) ||
            !hs_metric_within(&near->nearer, p, q, shift, &ranker->stages)) {
            return false;
        }
    }
    return !is_itself(ranker, key);
}

/* Whether the call's choice lets a key count, decided exactly. The point itself does, unless it is
 * of another group. HS_ERR_INTERRUPTED, and any status of hs_choice_is_nearest. */
static hs_status
key_counts(hs_nearest_ranker *ranker, const hs_nearest_key *key, bool *counts)
{
    if (ranker->near->search->call->choice == NULL) {
        *counts = true;
        return HS_OK;
    }
    const int32_t number = ranker->near->search->bins.order[key->number];
    bool          excluded = false;
    hs_status     status = HS_OK;
    *counts = hs_chooser_is_of_group(&ranker->chooser, number);
    if (*counts && hs_chooser_excludes(&ranker->chooser, number)) {
        status = is_excluded_here(ranker, key, &excluded);
    }
    *counts = *counts && !excluded && !is_too_near(ranker, key);
    return status == HS_OK && !goes_on(ranker, STEPS_OF_CHOICE) ? ranker->status : status;
}

/* ---- which is nearer ---- */

/* Whether b must come before a. */
typedef bool (*before_fn)(hs_nearest_ranker *ranker, const hs_nearest_key *b,
                          const hs_nearest_key *a);

/* Stable, by merging runs that are sorted by insertion; few calls of `before` where all is in order
 * already. */
HS_ALWAYS_INLINE void
sort_keys(hs_nearest_ranker *ranker, hs_nearest_key *keys, int64_t n, before_fn before)
{
    hs_nearest_key *left = ranker->spare;
    for (int64_t begin = 0; begin < n && goes_on(ranker, FEW); begin += FEW) {
        const int64_t end = n - begin < FEW ? n : begin + FEW;
        for (int64_t e = begin + 1; e < end; e++) {
            const hs_nearest_key key = keys[e];
            int64_t              at = e;
            for (; at > begin && before(ranker, &key, &keys[at - 1]); at--) {
                keys[at] = keys[at - 1];
            }
            keys[at] = key;
        }
    }
    for (int64_t width = FEW; width < n; width *= 2) {
        for (int64_t begin = 0; begin + width < n && goes_on(ranker, 1); begin += 2 * width) {
            hs_nearest_key *to = keys + begin, *right = to + width;
            const int64_t   n_right = n - begin - width < width ? n - begin - width : width;
            if (!before(ranker, right, right - 1)) {
                continue;
            }
            memcpy(left, to, (size_t)width * sizeof *left);
            for (int64_t l = 0, r = 0; l < width && goes_on(ranker, 1);) {
                const bool takes_right = r < n_right && before(ranker, &right[r], &left[l]);
                *to++ = takes_right ? right[r++] : left[l++];
            }
        }
    }
}

HS_ALWAYS_INLINE bool
is_smaller(hs_nearest_ranker *ranker, const hs_nearest_key *b, const hs_nearest_key *a)
{
    (void)ranker;
    return b->square < a->square;
}

/* Whether b comes before a by (j, S). The turns of i and j are common to all images of one j, so
 * shifts over B tell these apart. */
static bool
is_listed_before(const hs_nearest_ranker *ranker, const hs_nearest_key *b, const hs_nearest_key *a)
{
    const hs_search *search = ranker->near->search;
    const int32_t   *order = search->bins.order;
    const int32_t   *of_b = ranker->images[b->image].shift, *of_a = ranker->images[a->image].shift;
    int64_t          difference[HS_MAX_DIM] = {0}, given[HS_MAX_DIM];
    if (b->number != a->number) {
        return order[b->number] < order[a->number];
    }
    for (int r = 0; r < search->bins.n_periodic; r++) {
        difference[r] = (int64_t)of_b[r] - of_a[r];
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

/* Whether b comes before a, in exact arithmetic. */
static bool
is_before(hs_nearest_ranker *ranker, const hs_nearest_key *b, const hs_nearest_key *a)
{
    const hs_metric *order = &ranker->near->order;
    const size_t     d = (size_t)ranker->near->tree.ndim, m = (size_t)order->n_rows;
    double           p[HS_MAX_DIM], q[2][HS_MAX_DIM];
    int64_t          shift[2][HS_MAX_DIM];
    int              sign = 0;
    take_origin(ranker, p);
    ranker->n_compared++;
    /* Shifts that pass their range are found when the pair is written; here any order will do. */
    if (pair_of(ranker, b, q[0], shift[0], NULL) && pair_of(ranker, a, q[1], shift[1], NULL) &&
        (memcmp(q[0], q[1], d * sizeof **q) != 0 ||
         memcmp(shift[0], shift[1], m * sizeof **shift) != 0)) {
        sign = hs_metric_compare(order, &(hs_span){p, q[0], shift[0]},
                                 &(hs_span){p, q[1], shift[1]}, &ranker->stages);
    }
    return sign < 0 || (sign == 0 && is_listed_before(ranker, b, a));
}

/* Puts in exact order the first `wanted` of n keys that float64 cannot tell; the others come behind
 * them. */
static void
sort_exactly(hs_nearest_ranker *ranker, hs_nearest_key *keys, int64_t n, int64_t wanted)
{
    const int64_t sorted = wanted <= MOST_INSERTED && n > 4 * wanted ? wanted : n;
    sort_keys(ranker, keys, sorted, is_before);
    for (int64_t e = sorted; e < n && goes_on(ranker, 1); e++) {
        const hs_nearest_key key = keys[e];
        int64_t              at = sorted;
        while (at > 0 && is_before(ranker, &key, &keys[at - 1])) {
            at--;
        }
        if (at < sorted) {
            keys[e] = keys[sorted - 1];
            memmove(keys + at + 1, keys + at, (size_t)(sorted - 1 - at) * sizeof *keys);
            keys[at] = key;
        }
    }
}

/* Takes a square into the heap of the k least ones. */
static bool
note_square(hs_nearest_ranker *ranker, double square)
{
    const int64_t k = ranker->near->k;
    int64_t       at = ranker->n_least;
    if (at < k) {
        if (at == ranker->least_capacity) {
            const int64_t capacity = 2 * at + 64 < k ? 2 * at + 64 : k;
            if (!hs_shared_resize(ranker->near->shared, (void **)&ranker->least, at, capacity,
                                  sizeof(double))) {
                return false;
            }
            ranker->least_capacity = capacity;
        }
        for (ranker->n_least++; at > 0 && ranker->least[(at - 1) / 2] < square; at = (at - 1) / 2) {
            ranker->least[at] = ranker->least[(at - 1) / 2];
        }
        ranker->least[at] = square;
    } else if (square < ranker->least[0]) {
        double *heap = ranker->least;
        at = 0;
        for (int64_t child = 1; child < k; child = 2 * at + 1) {
            child += child + 1 < k && heap[child + 1] > heap[child];
            if (heap[child] <= square) {
                break;
            }
            heap[at] = heap[child];
            at = child;
        }
        heap[at] = square;
    }
    return true;
}

static void
drop_far_keys(hs_nearest_ranker *ranker, double bound)
{
    int64_t kept = 0;
    for (int64_t e = 0; e < ranker->n; e++) {
        ranker->keys[kept] = ranker->keys[e];
        kept += ranker->keys[e].square <= bound;
    }
    ranker->n = kept;
}

/* Puts the keys in order of distance, then (j, S), as far as they are wanted: *count of them.
 * is_complete: no others are wanted; else *count is -1 when some beyond the reach may be. */
static hs_status
order_keys(hs_nearest_ranker *ranker, bool is_complete, int64_t *count)
{
    const int64_t   k = ranker->near->k, wanted = ranker->n < k ? ranker->n : k;
    const double    reach = ranker->frame.reach * ranker->frame.reach;
    hs_nearest_key *keys = ranker->keys;
    *count = -1;
    if (wanted < k && !is_complete) {
        return HS_OK;
    }
    if (ranker->n > MANY * wanted && ranker->n > MANY_KEYS) {
        ranker->n_least = 0;
        for (int64_t e = 0; e < ranker->n; e++) {
            if (!note_square(ranker, keys[e].square)) {
                return HS_ERR_MEMORY;
            }
        }
        const double last = ranker->least[0];
        drop_far_keys(ranker, last + 2.0 * closeness(ranker, last));
    }
    sort_keys(ranker, keys, ranker->n, is_smaller);
    if (!is_complete) {
        const double last = keys[wanted - 1].square;
        if (last + closeness(ranker, last) > reach * (1.0 - 0x1p-40)) {
            return ranker->status;
        }
    }
    for (int64_t begin = 0, end; begin < wanted; begin = end) {
        end = begin + 1;
        while (end < ranker->n &&
               keys[end].square - keys[end - 1].square <= closeness(ranker, keys[end].square)) {
            end++;
        }
        if (end - begin > 1) {
            sort_exactly(ranker, keys + begin, end - begin, wanted - begin);
        }
    }
    *count = wanted;
    return ranker->status;
}

/* ---- the keys of a point alone: the tree is walked down, nearest nodes first ---- */

/* Relative room, far more than roundings take. */
#define WALK_ROOM 0x1p-36
/* Squares below this are near underflow: another unit is needed. */
#define LEAST_SQUARE 0x1p-600
#define UNIT_STEP    400
#define LEAF_CHUNK   8 /* points of a leaf at a time */

/* The walk down the tree in one image. */
typedef struct near_walk {
    hs_nearest_ranker *ranker;
    double             at[HS_MAX_DIM]; /* the point's X less the image's displacement */
    int32_t            self;           /* the point itself is left out; -1 in other images */
    double             within;  /* what has a larger square is beyond the largest distance ... */
    double             bound;   /* ... or surely not among the nearest */
    double             slack;   /* for errors that do not fall with the square */
    double             least;   /* what has a smaller square is surely too near */
    int64_t            n_taken; /* keys in this image */
} near_walk;

/* With room for what is too close to tell from the last one: two closenesses, for a reach of twice
 * its distance. */
HS_ALWAYS_INLINE void
set_bound(near_walk *walk)
{
    const hs_nearest_ranker *ranker = walk->ranker;
    if (ranker->n_least == ranker->near->k) {
        const double last = ranker->least[0];
        const double room = walk->slack * (sqrt(last) + walk->slack);
        walk->bound = hs_smaller(last * (1.0 + WALK_ROOM) + room + 0x1p-990, walk->within);
    }
}

/* Takes a point, which is nearer than all beyond the bound, if it counts. */
static hs_status
take_key(near_walk *walk, hs_nearest_key key)
{
    hs_nearest_ranker *ranker = walk->ranker;
    bool               counts = false;
    const hs_status status = key.number != walk->self ? key_counts(ranker, &key, &counts) : HS_OK;
    if (!counts || status != HS_OK) {
        return status;
    }
    if (ranker->n == ranker->capacity) {
        drop_far_keys(ranker, walk->bound);
    }
    if (!reserve(ranker, 1) || !note_square(ranker, key.square)) {
        return HS_ERR_MEMORY;
    }
    ranker->keys[ranker->n++] = key;
    walk->n_taken++;
    set_bound(walk);
    return HS_OK;
}

/* Of a spot, points that come behind k others at the same place are of no use. */
HS_ALWAYS_INLINE hs_status
walk_leaf(near_walk *walk, const hs_tree_node *node, const int ndim)
{
    hs_nearest_ranker *ranker = walk->ranker;
    const hs_nearest  *near = ranker->near;
    const double       unit = ranker->frame.unit;
    const int64_t      most = node->is_spot ? walk->n_taken + near->k : INT64_MAX;
    const int32_t      end = node->end;
    int32_t            next;
    for (int32_t first = node->first; first < end && walk->n_taken < most; first = next) {
        double squares[LEAF_CHUNK] = {0.0};
        next = end - first < LEAF_CHUNK ? end : first + LEAF_CHUNK;
        for (int k = 0; k < ndim; k++) {
            const double *x = near->search->bins.x[k] + first, at = walk->at[k];
            for (int32_t e = 0; e < next - first; e++) {
                const double along = (x[e] - at) * unit;
                squares[e] += along * along;
            }
        }
        ranker->n_met += next - first;
        for (int32_t e = 0; e < next - first; e++) {
            if (squares[e] <= walk->bound) {
                const hs_status status =
                    take_key(walk, (hs_nearest_key){squares[e], first + e, ranker->n_walked - 1});
                if (status != HS_OK) {
                    return status;
                }
            }
        }
    }
    return HS_OK;
}

/* Whether all points of a node, whose ranges are `stride` numbers apart, are nearer than the least
 * distance, and none is the asking one, which counts; gap: the squared distance to them. */
static bool
are_too_near(const near_walk *walk, const double *lower, const double *upper, int stride,
             double gap)
{
    const hs_nearest_ranker *ranker = walk->ranker;
    double                   square = 0.0;
    if (gap <= walk->slack * walk->slack && walk->self < 0 &&
        ranker->chooser.excluding.itself >= 0) {
        return false;
    }
    for (int k = 0; k < ranker->near->tree.ndim; k++) {
        const double below = walk->at[k] - lower[k * stride];
        const double above = upper[k * stride] - walk->at[k];
        const double along = hs_larger(below, above) * ranker->frame.unit;
        square += along * along;
    }
    return square < walk->least;
}

HS_ALWAYS_INLINE hs_status
walk_tree(near_walk *walk, const int ndim)
{
    hs_nearest_ranker  *ranker = walk->ranker;
    const hs_tree      *tree = &ranker->near->tree;
    const double        unit = ranker->frame.unit;
    hs_nearest_waiting *waiting = ranker->waiting;
    const bool          has_least = walk->least > 0.0;
    int64_t             n_waiting = 1;
    waiting[0] = (hs_nearest_waiting){hs_tree_gap(tree, walk->at, walk->at, unit), 0};
    if (has_least && are_too_near(walk, tree->lower, tree->upper, 1, waiting[0].gap)) {
        return HS_OK;
    }
    while (n_waiting > 0) {
        const hs_tree_node *node = &tree->nodes[waiting[--n_waiting].number];
        double              gap[2] = {waiting[n_waiting].gap, INFINITY};
        int                 nearer = 0;
        while (gap[nearer] <= walk->bound && node->left != 0) { /* down to the nearest leaf */
            const int32_t left = node->left;
            const double *bounds = hs_tree_bounds(tree, left, ndim);
            HS_PREFETCH(&tree->nodes[left]);
            hs_tree_gaps(bounds, walk->at, walk->at, unit, ndim, gap);
            for (int side = 0; has_least && side < 2; side++) {
                if (are_too_near(walk, bounds + side, bounds + 2 + side, 4, gap[side])) {
                    gap[side] = INFINITY;
                }
            }
            nearer = gap[1] < gap[0];
            waiting[n_waiting] = (hs_nearest_waiting){gap[1 - nearer], left + 1 - nearer};
            n_waiting += gap[1 - nearer] <= walk->bound;
            node = &tree->nodes[left + nearer];
        }
        if (gap[nearer] > walk->bound) {
            continue;
        }
        const hs_status status = walk_leaf(walk, node, ndim);
        if (status != HS_OK || !goes_on(ranker, FEW)) {
            return status != HS_OK ? status : ranker->status;
        }
    }
    return HS_OK;
}

/* Walks down the tree in one image more. */
static hs_status
walk_image(near_walk *walk, const hs_nearest_image *image)
{
    hs_nearest_ranker *ranker = walk->ranker;
    const hs_nearest  *near = ranker->near;
    const hs_bins     *asking = hs_search_asking(near->search);
    hs_status          status;
    if (ranker->n_walked == ranker->walked_capacity) {
        const int32_t capacity = 2 * ranker->n_walked + 8;
        if (!hs_shared_resize(near->shared, (void **)&ranker->walked, ranker->n_walked, capacity,
                              sizeof *image)) {
            return HS_ERR_MEMORY;
        }
        ranker->walked_capacity = capacity;
    }
    ranker->walked[ranker->n_walked++] = *image;
    ranker->images = ranker->walked;
    walk->n_taken = 0;
    walk->self = near->omits_self && image->is_home ? ranker->si : -1;
    for (int k = 0; k < asking->ndim; k++) {
        walk->at[k] = asking->x[k][ranker->si] - image->moved[k];
    }
    switch (asking->ndim) {
    case 2: status = walk_tree(walk, 2); break;
    case 3: status = walk_tree(walk, 3); break;
    default: status = walk_tree(walk, asking->ndim);
    }
    ranker->n_walked -= walk->n_taken == 0; /* nothing there */
    return status;
}

/* Sets the keys in a given unit: those of the home image first, then of as many as what is found
 * there leaves in reach. */
static hs_status
walk_images(hs_nearest_ranker *ranker, const hs_nearest_group *point, double unit)
{
    const hs_nearest *near = ranker->near;
    const double      farthest = hs_nearest_farthest(near, point);
    const double      root = sqrt(near->tree.ndim);
    near_walk         walk = {.ranker = ranker};
    hs_nearest_group  group = *point;
    hs_nearest_images images;
    int64_t           low[HS_MAX_DIM], high[HS_MAX_DIM]; /* images walked through before */
    double            along = 0.5 * near->smallest_period;
    hs_nearest_images_start(near, NULL, &images);
    group.radius = near->search->scene.lattice.n_periodic == 0 ? INFINITY : -1.0;
    ranker->n = ranker->n_least = ranker->n_walked = 0;
    for (int round = 0;; round++) {
        const double error = images.error * unit, room = 8.0 * root * error;
        const double within = (near->limit * unit + room) * (1.0 + WALK_ROOM);
        hs_status    status = HS_OK;
        walk.within = walk.bound = hs_smaller(within * within, DBL_MAX);
        walk.slack = 32.0 * root * error;
        ranker->frame.unit = unit;
        ranker->frame.error = error;
        const double least = hs_smaller(near->least * unit, 0x1p500); /* a square is finite */
        walk.least = least * least - square_error(ranker, least * least);
        set_bound(&walk);
        while (status == HS_OK && hs_nearest_images_next(&images)) {
            bool is_new = round < 2 && images.next.is_home == (round == 0);
            for (int r = 0; round > 1 && !images.next.is_home && r < images.lattice->n_periodic;
                 r++) {
                const int32_t shift = images.next.shift[r];
                is_new = is_new || shift < low[r] || shift > high[r];
            }
            status = is_new ? walk_image(&walk, &images.next) : HS_OK;
            if (status == HS_OK && !goes_on(ranker, 1)) {
                status = ranker->status;
            }
        }
        const double far = ranker->n_least > 0 ? sqrt(ranker->least[0]) : 0.0;
        const bool   is_full = ranker->n_least == near->k;
        const double enough =
            hs_smaller(is_full ? (far + room) * (1.0 + WALK_ROOM) / unit : INFINITY, farthest);
        if (status != HS_OK || group.radius >= enough) {
            hs_nearest_frame_set(near->tree.ndim, unit, error, 2.0 * far + 2.0 * room,
                                 &ranker->frame);
            drop_far_keys(ranker, walk.bound);
            return status;
        }
        memcpy(low, images.low, sizeof low);
        memcpy(high, images.high, sizeof high);
        along *= 2.0;
        group.radius = hs_smaller(hypot(group.away, along), is_full ? enough : farthest);
        group.radius = hs_larger(group.radius, HS_NEAREST_LEAST_RADIUS);
        status = hs_nearest_images_start(near, &group, &images);
        if (status != HS_OK) {
            return status;
        }
    }
}

hs_status
hs_nearest_walk(hs_nearest_ranker *ranker, int64_t *count)
{
    const hs_nearest *near = ranker->near;
    const double      period = near->smallest_period;
    double            widest = period < INFINITY ? period : 0.0;
    hs_nearest_group  group;
    if (ranker->waiting == NULL &&
        !hs_shared_resize(near->shared, (void **)&ranker->waiting, 0, near->tree.depth + 2,
                          sizeof *ranker->waiting)) {
        return HS_ERR_MEMORY;
    }
    hs_nearest_group_set(near, ranker->si, ranker->si + 1, &group);
    for (int k = 0; k < near->tree.ndim; k++) {
        widest = hs_larger(fabs(near->tree.upper[k] - group.lower[k]), widest);
        widest = hs_larger(fabs(near->tree.lower[k] - group.lower[k]), widest);
    }
    /* In this unit no square overflows but those of no use. Where the nearest are so near beside
     * all others that theirs may vanish, it is raised: what was small is ordinary then. */
    widest = hs_smaller(widest, near->limit);
    for (int exponent = -ilogb(hs_larger(widest, HS_NEAREST_LEAST_RADIUS));;
         exponent = exponent + UNIT_STEP < 1000 ? exponent + UNIT_STEP : 1000) {
        const hs_status status = walk_images(ranker, &group, hs_power_of_two(exponent));
        if (status != HS_OK) {
            return status;
        }
        const double error = ranker->frame.error; /* beside which nothing vanishes */
        if (exponent >= 1000 || ranker->n_least < near->k || ranker->least[0] >= LEAST_SQUARE ||
            error * error >= LEAST_SQUARE) {
            break;
        }
    }
    return order_keys(ranker, true, count);
}

/* ---- the keys of hits of a block ---- */

/* Squares of the hits that are not beyond the reach, but for the point itself where it is left
 * out. */
HS_ALWAYS_INLINE void
fill_keys(hs_nearest_ranker *ranker, const hs_nearest_block *block, const int32_t *hits, int64_t n,
          const int ndim)
{
    const hs_bins              *asking = hs_search_asking(ranker->near->search);
    hs_nearest_key *HS_RESTRICT keys = ranker->keys;
    const double               *x[HS_MAX_DIM], unit = block->frame.unit;
    const double                reach = block->frame.reach * block->frame.reach;
    const double  limit = reach * (1.0 + 0x1p-40) + hs_nearest_error(&block->frame, ndim, reach);
    const int32_t self = ranker->near->omits_self ? ranker->si : -1;
    double        at[HS_MAX_DIM];
    int64_t       n_keys = 0;
    for (int k = 0; k < ndim; k++) {
        at[k] = asking->x[k][ranker->si];
        x[k] = ranker->near->search->bins.x[k];
    }
    for (int64_t h = 0; h < n; h++) {
        const int32_t sj = block->number[hits[h]], image = block->image_of[hits[h]];
        const double *moved = block->images[image].moved;
        double        square = 0.0;
        for (int k = 0; k < ndim; k++) {
            const double along = (x[k][sj] + moved[k] - at[k]) * unit;
            square += along * along;
        }
        keys[n_keys] = (hs_nearest_key){square, sj, image};
        n_keys += square <= limit && !(sj == self && block->images[image].is_home);
    }
    ranker->n = n_keys;
}

HS_ALWAYS_INLINE float
square_of(int32_t key)
{
    return hs_float_of_bits((uint32_t)key);
}

/* Ranks from squares in float32: false when these cannot tell. There is room for n keys. */
static bool
rank_fast(hs_nearest_ranker *ranker, const hs_nearest_block *block, const int32_t *hits,
          const float *squares, int64_t n, int64_t *count)
{
    const bool    omits_self = ranker->near->omits_self;
    const int64_t wanted = ranker->near->k + omits_self;
    const double  reach = block->frame.reach * block->frame.reach;
    /* The error of two squares, and of two keys. */
    const double least = 2.0 * block->square_error + KEY_ERROR * reach;
    int32_t      keys[HS_ORDER_MOST + 1];
    *count = -1;
    if (n < wanted || n > HS_ORDER_MOST) {
        return n < wanted;
    }
    ranker->near->search->call->kernel->order(squares, (int32_t)n, keys);
    keys[n] = HS_ORDER_LAST;
    bool is_sure = square_of(keys[wanted - 1]) + least < reach;
    for (int64_t e = 0; e < wanted; e++) {
        is_sure = is_sure & (square_of(keys[e + 1]) - square_of(keys[e]) > (float)least);
    }
    if (is_sure && omits_self) {
        const int32_t first = hits[keys[0] & (HS_ORDER_MOST - 1)];
        is_sure = block->number[first] == ranker->si &&
                  block->images[block->image_of[first]].is_home;
    }
    for (int64_t e = omits_self; is_sure && e < wanted; e++) {
        const int32_t hit = hits[keys[e] & (HS_ORDER_MOST - 1)];
        ranker->keys[e - omits_self] =
            (hs_nearest_key){square_of(keys[e]), block->number[hit], block->image_of[hit]};
    }
    *count = is_sure ? ranker->near->k : -1;
    return is_sure;
}

hs_status
hs_nearest_rank(hs_nearest_ranker *ranker, const hs_nearest_block *block, const int32_t *hits,
                const float *squares, int64_t n, bool is_complete, int64_t *count)
{
    *count = -1;
    ranker->frame = block->frame;
    ranker->images = block->images;
    if (!reserve(ranker, n)) {
        return HS_ERR_MEMORY;
    }
    if (squares != NULL && rank_fast(ranker, block, hits, squares, n, count)) {
        return HS_OK;
    }
    switch (ranker->near->tree.ndim) {
    case 2: fill_keys(ranker, block, hits, n, 2); break;
    case 3: fill_keys(ranker, block, hits, n, 3); break;
    default: fill_keys(ranker, block, hits, n, ranker->near->tree.ndim);
    }
    if (ranker->near->search->call->choice != NULL) {
        int64_t kept = 0;
        for (int64_t e = 0; e < ranker->n; e++) {
            bool            counts;
            const hs_status status = key_counts(ranker, &ranker->keys[e], &counts);
            if (status != HS_OK) {
                return status;
            }
            ranker->keys[kept] = ranker->keys[e];
            kept += counts;
        }
        ranker->n = kept;
    }
    return goes_on(ranker, n) ? order_keys(ranker, is_complete, count) : ranker->status;
}

/* ---- rows, a batch of entries at a time, measured by the batch kernel ---- */

#define LINE          64       /* bytes that are fetched at once, */
#define MOST_EXPECTED 512      /* and of a row */
#define ANY_SQUARE    0x1p1000 /* more than any key's */

void
hs_nearest_writer_init(const hs_nearest *near, hs_nearest_writer *writer)
{
    writer->near = near;
    writer->j = hs_output_column(near->rows, HS_WANT_J);
    writer->d = hs_output_column(near->rows, HS_WANT_DISTANCE);
    writer->D = hs_output_column(near->rows, HS_WANT_VECTOR);
    writer->S = hs_output_column(near->rows, HS_WANT_SHIFT);
}

void
hs_nearest_prefetch(const hs_nearest_writer *writer, int32_t si)
{
    const hs_nearest *near = writer->near;
    const int64_t     row = hs_search_asking(near->search)->order[si];
    const int64_t bytes[2] = {near->k * near->rows->index_bytes, near->k * (int64_t)sizeof(double)};
    char *const   column[2] = {writer->j, (char *)writer->d};
    for (int c = 0; c < 2; c++) {
        char *line = column[c] != NULL ? column[c] + row * bytes[c] : NULL;
        for (int64_t at = 0; line != NULL && at < bytes[c] && at < MOST_EXPECTED; at += LINE) {
            HS_PREFETCH_WRITE(line + at);
        }
    }
}

void
hs_nearest_write_nothing(const hs_nearest_writer *writer, int64_t row, int64_t from)
{
    const hs_output *rows = writer->near->rows;
    const int64_t    k = writer->near->k, begin = row * k + from, n = k - from;
    HS_ASSERT((row + 1) * k <= rows->n_pairs);
    if (writer->j != NULL) { /* all bits of -1 are set */
        memset((char *)writer->j + begin * rows->index_bytes, 0xff,
               (size_t)(n * rows->index_bytes));
    }
    for (int64_t at = begin; writer->d != NULL && at < begin + n; at++) {
        writer->d[at] = INFINITY;
    }
    for (int64_t e = begin * rows->ndim; writer->D != NULL && e < (begin + n) * rows->ndim; e++) {
        writer->D[e] = NAN;
    }
    if (writer->S != NULL) {
        memset(writer->S + begin * rows->ndim, 0, (size_t)(n * rows->ndim) * sizeof *writer->S);
    }
}

void
hs_nearest_flush(hs_nearest_writer *writer)
{
    const hs_search *search = writer->near->search;
    const hs_scale   unscale = hs_measures_unscale(&search->scene);
    hs_measured     *pairs = &writer->pairs;
    const int        d = search->scene.ndim;
    if (pairs->n > 0 && (writer->d != NULL || writer->D != NULL)) {
        hs_measured_find(search->call->kernel, &writer->near->order, writer->D != NULL, pairs);
    }
    if (writer->d != NULL) {
        hs_restore_distances(pairs->distance, pairs->n, unscale);
        if (search->call->options.cutoff < INFINITY) {
            hs_keep_all_within(pairs->distance, pairs->n, search->call->options.cutoff,
                               search->call->options.inclusive);
        }
        /* Rows ascend in exact order; a distance, known to a unit in the last place, may be lifted
         * to the one before it, which is then no further from the true one than that. */
        double before = pairs->n > 0 && !writer->is_first[0] ? writer->d[writer->at[0] - 1] : 0.0;
        for (int32_t e = 0; e < pairs->n; e++) {
            before = hs_larger(pairs->distance[e], writer->is_first[e] ? 0.0 : before);
            writer->d[writer->at[e]] = before;
        }
    }
    if (writer->D != NULL) {
        double *vector[HS_MAX_DIM], sign[HS_BATCH], packed[HS_BATCH * HS_MAX_DIM];
        for (int k = 0; k < d; k++) {
            vector[k] = pairs->vector[k];
        }
        for (int32_t e = 0; e < pairs->n; e++) {
            sign[e] = 1.0;
        }
        hs_restore_vectors(packed, vector, sign, pairs->n, d, unscale);
        for (int32_t e = 0; e < pairs->n; e++) {
            memcpy(writer->D + writer->at[e] * d, packed + (int64_t)e * d,
                   (size_t)d * sizeof(double));
        }
    }
    for (int r = 0; pairs->is_shifted && r < search->bins.n_periodic; r++) {
        memset(pairs->times[r], 0, (size_t)pairs->n * sizeof(double));
        memset(pairs->shift[r], 0, (size_t)pairs->n * sizeof(int64_t));
    }
    pairs->n = 0;
    pairs->is_shifted = pairs->is_wide = false;
}

/* n entries of the ranker's row, from `at` on; the batch has room for them. */
static hs_status
put_entries(hs_nearest_writer *writer, const hs_nearest_ranker *ranker, const hs_nearest_key *keys,
            int32_t n, int64_t at, bool is_first)
{
    const hs_bins *bins = &writer->near->search->bins;
    const int     *vector_of_row = writer->near->search->scene.lattice.vector_of_row;
    hs_measured   *pairs = &writer->pairs;
    const bool needs_given = bins->n_periodic > 0 && (bins->keeps_originals || writer->S != NULL);
    int32_t    j[HS_BATCH];
    double     p[HS_MAX_DIM];
    take_origin(ranker, p);
    for (int32_t e = 0; e < n; e++) {
        j[e] = bins->order[keys[e].number];
        writer->at[pairs->n + e] = at + e;
        writer->is_first[pairs->n + e] = is_first && e == 0;
    }
    if (writer->j != NULL) {
        const int index_bytes = writer->near->rows->index_bytes;
        hs_put_indices((char *)writer->j + at * index_bytes, index_bytes, 1, j, 1, n);
    }
    for (int k = 0; k < bins->ndim; k++) {
        const double *from = bins->keeps_originals ? bins->originals[k] : bins->x[k];
        for (int32_t e = 0; e < n; e++) {
            pairs->p[k][pairs->n + e] = p[k];
            pairs->q[k][pairs->n + e] = from[keys[e].number];
        }
    }
    if (writer->S != NULL) {
        memset(writer->S + at * bins->ndim, 0, (size_t)n * (size_t)bins->ndim * sizeof *writer->S);
    }
    for (int32_t e = 0; e < n && bins->n_periodic > 0; e++) {
        double  q[HS_MAX_DIM];
        int64_t shift[HS_MAX_DIM], given[HS_MAX_DIM];
        if (!needs_given && ranker->images[keys[e].image].is_home) { /* as it was before */
            continue;
        }
        if (!pair_of(ranker, &keys[e], q, shift, needs_given ? given : NULL)) {
            return HS_ERR_SHIFT_RANGE;
        }
        for (int r = 0; r < bins->n_periodic; r++) {
            hs_measured_shift(pairs, pairs->n + e, r, shift[r]);
            if (writer->S != NULL && given[r] >= INT32_MIN && given[r] <= INT32_MAX) {
                writer->S[(at + e) * bins->ndim + vector_of_row[r]] = (int32_t)given[r];
            } else if (writer->S != NULL) {
                return HS_ERR_SHIFT_RANGE;
            }
        }
    }
    pairs->n += n;
    return HS_OK;
}

/* How many of the ranked are within the largest distance: all before the first that is not. */
static int64_t
count_within(hs_nearest_ranker *ranker, int64_t count)
{
    const hs_nearest *near = ranker->near;
    const double      limit = near->limit * ranker->frame.unit, square = limit * limit;
    double            p[HS_MAX_DIM], q[HS_MAX_DIM];
    int64_t           shift[HS_MAX_DIM];
    if (!(square < ANY_SQUARE)) {
        return count;
    }
    take_origin(ranker, p);
    while (count > 0) {
        const hs_nearest_key *key = &ranker->keys[count - 1];
        const double          error = closeness(ranker, hs_larger(square, key->square));
        if (key->square + error < square) {
            break;
        }
        if (key->square <= square + error &&
            (!pair_of(ranker, key, q, shift, NULL) ||
             hs_metric_within(&near->within, p, q, shift, &ranker->stages))) {
            break; /* shifts that pass their range are found when they are written */
        }
        count--;
    }
    return count;
}

hs_status
hs_nearest_write(hs_nearest_writer *writer, hs_nearest_ranker *ranker, int64_t count)
{
    const hs_nearest *near = writer->near;
    const int64_t     row = hs_search_asking(near->search)->order[ranker->si];
    count = count_within(ranker, count);
    for (int64_t e = 0; e < count;) {
        const int64_t   room = HS_BATCH - writer->pairs.n;
        const int32_t   n = (int32_t)(count - e < room ? count - e : room);
        const hs_status status =
            put_entries(writer, ranker, ranker->keys + e, n, row * near->k + e, e == 0);
        if (status != HS_OK) {
            return status;
        }
        e += n;
        if (writer->pairs.n == HS_BATCH) {
            hs_nearest_flush(writer);
        }
    }
    if (count < near->k) {
        hs_nearest_write_nothing(writer, row, count);
    }
    return HS_OK;
}
