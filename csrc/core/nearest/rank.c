/* SPDX-License-Identifier: BSD-3-Clause */
#include "rank.h"

#include <math.h>
#include <string.h>

/* rank.c: few keys are placed by counting the smaller ones, many are merged; the nearest of many
 * come by partitioning. Squares too close to tell are compared exactly, then rows are written. */

HS_ALWAYS_INLINE bool
is_smaller(void *context, const hs_nearest_key *b, const hs_nearest_key *a)
{
    (void)context;
    return b->square < a->square;
}

/*
 * Each key goes to the place that is the number of smaller ones: as integers of 16 bits, the square
 * in some hundreds of steps followed by the key's own number, so that no two are equal. Insertion
 * puts in order what these cannot tell: on average less than one among thirty.
 */
static void
sort_by_counting(hs_nearest_key **keys, hs_nearest_key **spare, int64_t n, double largest)
{
    const int32_t padded = ((int32_t)n + 7) / 8 * 8;
    const int32_t numbers = n <= HS_NEAREST_COUNTED / 2 ? HS_NEAREST_COUNTED / 2
                                                        : HS_NEAREST_COUNTED;
    const double  steps = largest > 0x1p-1000 ? (double)(INT16_MAX / numbers) / largest : 0.0;
    int16_t       rough[HS_NEAREST_COUNTED];
    for (int32_t e = 0; e < n; e++) {
        rough[e] = (int16_t)((int32_t)((*keys)[e].square * steps) * numbers + e);
    }
    for (int32_t e = (int32_t)n; e < padded; e++) {
        rough[e] = INT16_MAX;
    }
    for (int32_t e = 0; e < n; e++) {
        const int16_t own = rough[e];
        int16_t       smaller = 0;
        for (int32_t f = 0; f < padded; f++) {
            smaller = (int16_t)(smaller + (rough[f] < own));
        }
        (*spare)[smaller] = (*keys)[e];
    }
    hs_nearest_key *sorted = *spare;
    *spare = *keys;
    *keys = sorted;
    hs_nearest_insert(NULL, *keys, n, is_smaller);
}

void
hs_nearest_sort(hs_nearest_pace *pace, hs_nearest_key **keys, hs_nearest_key **spare, int64_t n,
                double largest)
{
    if (n <= HS_NEAREST_COUNTED) {
        sort_by_counting(keys, spare, n, largest);
    } else {
        hs_nearest_merge(pace, NULL, *keys, *spare, n, is_smaller);
    }
}

/* Brings the `wanted` keys of least squares to the front, in no order. */
static void
nearest_select(hs_nearest_key *keys, int64_t n, int64_t wanted)
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
                const hs_nearest_key key = keys[i];
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

/* Squares in float64 are sorted; neighbours in that order that are too close are
 * compared exactly. */

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

/* What the metric measures to, and its shift, of point sj in this image; also S over the periodic
 * box vectors as given when `given` is not NULL. False when a shift passes its range. */
static bool
pair_in_image(const hs_nearest *near, int32_t si, int32_t sj, const int32_t *image, double *q,
              int64_t *shift, int64_t *given)
{
    const hs_bins *bins = &near->search->bins, *asking = hs_search_asking(near->search);
    const int      m = bins->n_periodic;
    int64_t        turned[HS_MAX_DIM] = {0}, as_given[HS_MAX_DIM];
    for (int k = 0; k < bins->ndim; k++) {
        q[k] = bins->keeps_originals ? bins->originals[k][sj] : bins->x[k][sj];
    }
    for (int r = 0; r < m; r++) {
        shift[r] = image[r];
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

/* The same of the candidate at a place of the block. */
static bool
nearest_pair(const hs_nearest *near, const hs_nearest_block *block, int32_t si, int32_t place,
             double *q, int64_t *shift, int64_t *given)
{
    return pair_in_image(near, si, block->number[place], hs_nearest_image_of(block, place)->shift,
                         q, shift, given);
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

/* ---- which of them count: what the call's choice leaves out ---- */

/* How far a squared length may be from the true one, in either direction. */
static double
square_error(const hs_nearest *near, const hs_nearest_candidate *candidate, double square)
{
    const double along = sqrt(near->tree.ndim) * candidate->error;
    return 2.0 * ((near->tree.ndim + 4) * 0x1p-51 * square + 2.1 * along * (sqrt(square) + along) +
                  0x1p-1000);
}

/* Whether a pair that is excluded in its nearest image is in this one. */
static hs_status
is_excluded_here(const hs_nearest *near, const hs_chooser *chooser,
                 const hs_nearest_candidate *candidate, bool *excluded)
{
    const hs_search *search = near->search;
    const hs_choice *choice = chooser->choice;
    double           q[HS_MAX_DIM];
    int64_t          shift[HS_MAX_DIM], given[HS_MAX_DIM];
    *excluded = true;
    if (choice->shortest == INFINITY) { /* there are no others */
        return HS_OK;
    }
    const double square = candidate->square + square_error(near, candidate, candidate->square);
    const double far = hs_scale_apply(search->scene.unscale, sqrt(square) / candidate->unit);
    if (!hs_choice_compares(choice, hs_smaller(far, search->call->options.cutoff))) {
        return HS_OK;
    }
    *excluded = false;
    /* Shifts that pass their range are found when the pair is written. */
    return pair_in_image(near, candidate->si, candidate->sj, candidate->image, q, shift, given)
               ? hs_choice_is_nearest(choice, chooser->point, search->bins.order[candidate->sj],
                                      given, excluded)
               : HS_OK;
}

/* Whether a pair is that of a point with itself. */
static bool
is_itself(const hs_nearest *near, const hs_chooser *chooser, const hs_nearest_candidate *candidate)
{
    double  q[HS_MAX_DIM];
    int64_t shift[HS_MAX_DIM], given[HS_MAX_DIM] = {0}, any = 0;
    if (near->search->bins.order[candidate->sj] != chooser->excluding.itself ||
        !pair_in_image(near, candidate->si, candidate->sj, candidate->image, q, shift, given)) {
        return false;
    }
    for (int r = 0; r < near->search->bins.n_periodic; r++) {
        any |= given[r];
    }
    return any == 0;
}

/* Whether a pair is nearer than the least distance. */
static bool
is_too_near(const hs_nearest *near, const hs_chooser *chooser,
            const hs_nearest_candidate *candidate, hs_stages *stages)
{
    const double least = near->least * candidate->unit, square = least * least;
    const double error = square_error(near, candidate, hs_larger(square, candidate->square));
    double       p[HS_MAX_DIM], q[HS_MAX_DIM];
    int64_t      shift[HS_MAX_DIM];
    if (near->least == 0.0 || candidate->square - error > square) {
        return false;
    }
    if (!(candidate->square + error < square)) {
        take_origin(near, candidate->si, p);
        if (!pair_in_image(near, candidate->si, candidate->sj, candidate->image, q, shift, NULL) ||
            !hs_metric_within(&near->nearer, p, q, shift, stages)) {
            return false;
        }
    }
    return !is_itself(near, chooser, candidate);
}

hs_status
hs_nearest_counts(const hs_nearest *near, const hs_chooser *chooser,
                  const hs_nearest_candidate *candidate, hs_stages *stages, bool *counts)
{
    const int32_t number = near->search->bins.order[candidate->sj];
    bool          excluded = false;
    hs_status     status = HS_OK;
    *counts = hs_chooser_is_of_group(chooser, number);
    if (*counts && hs_chooser_excludes(chooser, number)) {
        status = is_excluded_here(near, chooser, candidate, &excluded);
    }
    *counts = *counts && !excluded && !is_too_near(near, chooser, candidate, stages);
    return status;
}

hs_status
hs_nearest_choose(hs_nearest_ranker *ranker, int32_t si, int32_t *hits, float *squares, int32_t *n)
{
    const hs_nearest       *near = ranker->near;
    const hs_nearest_block *block = ranker->block;
    const hs_bins          *bins = &near->search->bins, *asking = hs_search_asking(near->search);
    hs_chooser              chooser;
    hs_nearest_candidate    candidate = {.si = si, .unit = block->unit, .error = block->error};
    int32_t                 kept = 0;
    hs_status               status = HS_OK;
    hs_chooser_set(near->search->call->choice, asking->order[si], &chooser);
    for (int32_t h = 0; h < *n && status == HS_OK; h++) {
        const int32_t           place = hits[h];
        const hs_nearest_image *image = hs_nearest_image_of(block, place);
        bool                    counts;
        candidate.sj = block->number[place];
        candidate.image = image->shift;
        candidate.square = 0.0;
        for (int k = 0; k < bins->ndim; k++) {
            const double along =
                (bins->x[k][candidate.sj] + image->moved[k] - asking->x[k][si]) * block->unit;
            candidate.square += along * along;
        }
        status = hs_nearest_counts(near, &chooser, &candidate, &ranker->stages, &counts);
        hits[kept] = place;
        if (squares != NULL) {
            squares[kept] = squares[h];
        }
        kept += counts;
        if (status == HS_OK && !hs_nearest_goes_on(&ranker->pace, 1)) {
            status = ranker->pace.status;
        }
    }
    *n = kept;
    return status;
}

/* ---- which is nearer ---- */

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
    if (!nearest_pair(near, ranker->block, ranker->si, one->place, q[0], shift[0], NULL) ||
        !nearest_pair(near, ranker->block, ranker->si, other->place, q[1], shift[1], NULL)) {
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
sort_keys_exactly(hs_nearest_ranker *ranker, hs_nearest_key *keys, int64_t n, int64_t wanted)
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

/* Finds sorted keys whose squares are too close to tell, among the first `wanted`, and puts
 * them in exact order. */
static void
sort_close_keys_exactly(hs_nearest_ranker *ranker, int64_t n, int64_t wanted)
{
    hs_nearest_key *const all = ranker->keys;
    for (int64_t begin = 0, end; begin < wanted; begin = end) {
        end = begin + 1;
        while (end < n &&
               all[end].square - all[end - 1].square <= closeness(ranker, all[end].square)) {
            end++;
        }
        if (end - begin > 1) {
            sort_keys_exactly(ranker, all + begin, end - begin, wanted - begin);
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

/* Key of the point itself (S = 0): one of the keys whose distance is about 0. */
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
    nearest_select(keys, n, wanted);
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
    sort_close_keys_exactly(ranker, n, wanted);
    *count = wanted;
    return ranker->pace.status;
}

/* A batch of entries at a time, measured by the batch kernel; each goes to its
 * place in the output. */

#define LINE          64  /* bytes that are fetched at once, */
#define MOST_EXPECTED 512 /* and of a row */
#define MOST_SQUARE   0x1p1000

void
hs_nearest_writer_init(const hs_nearest *near, hs_nearest_writer *writer)
{
    memset(writer, 0, sizeof *writer); /* kernels read a little beyond the last entry */
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

HS_ALWAYS_INLINE void
put_number(void *j, int index_bytes, int64_t at, int32_t number)
{
    if (j != NULL && index_bytes == 8) {
        ((int64_t *)j)[at] = number;
    } else if (j != NULL) {
        ((int32_t *)j)[at] = number;
    }
}

void
hs_nearest_write_nothing(const hs_nearest *near, int64_t row, int64_t from)
{
    const hs_output *rows = near->rows;
    const int        d = rows->ndim;
    void            *j = hs_output_column(rows, HS_WANT_J);
    double          *distance = hs_output_column(rows, HS_WANT_DISTANCE);
    double          *vector = hs_output_column(rows, HS_WANT_VECTOR);
    int32_t         *shift = hs_output_column(rows, HS_WANT_SHIFT);
    HS_ASSERT((row + 1) * near->k <= rows->n_pairs);
    for (int64_t at = row * near->k + from; at < (row + 1) * near->k; at++) {
        put_number(j, rows->index_bytes, at, -1);
        if (distance != NULL) {
            distance[at] = INFINITY;
        }
        for (int k = 0; vector != NULL && k < d; k++) {
            vector[at * d + k] = NAN;
        }
        for (int k = 0; shift != NULL && k < d; k++) {
            shift[at * d + k] = 0;
        }
    }
}

/* Rows ascend in exact order; a distance, known to a unit in the last place, may be lifted to the
 * one before it, which is then no further from the true one than that. */
static void
put_distances(hs_nearest_writer *writer, double *to)
{
    const hs_search *search = writer->near->search;
    hs_measured     *pairs = &writer->pairs;
    hs_restore_distances(pairs->distance, pairs->n, hs_measures_unscale(&search->scene));
    if (search->call->options.cutoff < INFINITY) {
        hs_keep_all_within(pairs->distance, pairs->n, search->call->options.cutoff,
                           search->call->options.inclusive);
    }
    double before = pairs->n > 0 && !writer->is_first[0] ? to[writer->at[0] - 1] : 0.0;
    for (int32_t e = 0; e < pairs->n; e++) {
        before = hs_larger(pairs->distance[e], writer->is_first[e] ? 0.0 : before);
        to[writer->at[e]] = before;
    }
}

static void
put_vectors(hs_nearest_writer *writer, double *to)
{
    const hs_search *search = writer->near->search;
    hs_measured     *pairs = &writer->pairs;
    const int        d = search->scene.ndim;
    double          *vector[HS_MAX_DIM], sign[HS_BATCH], packed[HS_BATCH * HS_MAX_DIM];
    for (int k = 0; k < d; k++) {
        vector[k] = pairs->vector[k];
    }
    for (int32_t e = 0; e < pairs->n; e++) {
        sign[e] = 1.0;
    }
    hs_restore_vectors(packed, vector, sign, pairs->n, d, hs_measures_unscale(&search->scene));
    for (int32_t e = 0; e < pairs->n; e++) {
        memcpy(to + writer->at[e] * d, packed + (int64_t)e * d, (size_t)d * sizeof *to);
    }
}

void
hs_nearest_flush(hs_nearest_writer *writer)
{
    hs_measured *pairs = &writer->pairs;
    if (pairs->n > 0 && (writer->d != NULL || writer->D != NULL)) {
        hs_measured_find(writer->near->search->call->kernel, &writer->near->order,
                         writer->D != NULL, pairs);
    }
    if (writer->d != NULL) {
        put_distances(writer, writer->d);
    }
    if (writer->D != NULL) {
        put_vectors(writer, writer->D);
    }
    if (pairs->is_shifted) {
        memset(pairs->times, 0, sizeof pairs->times);
        memset(pairs->shift, 0, sizeof pairs->shift);
    }
    pairs->n = 0;
    pairs->is_shifted = pairs->is_wide = false;
}

/* S over all box vectors; false when it does not fit int32. */
static bool
put_shift(const hs_nearest *near, const int64_t *given, int32_t *to)
{
    const hs_lattice *lattice = &near->search->scene.lattice;
    const int         d = lattice->ndim;
    bool              fits = true;
    memset(to, 0, (size_t)d * sizeof *to);
    for (int l = 0; l < lattice->n_periodic; l++) {
        fits = fits && given[l] >= INT32_MIN && given[l] <= INT32_MAX;
        to[lattice->vector_of_row[l]] = fits ? (int32_t)given[l] : 0;
    }
    return fits;
}

/* The metric's shifts, and S where that is wanted, of n entries from place `at` of the output and
 * from the batch's next entry on: where they follow from the points' turns. */
static hs_status
put_given(hs_nearest_writer *writer, const hs_nearest_ranker *ranker, const hs_nearest_key *keys,
          int32_t n, int64_t at)
{
    const hs_nearest *near = writer->near;
    const hs_bins    *asking = hs_search_asking(near->search);
    for (int32_t e = 0; e < n; e++) {
        double  q[HS_MAX_DIM];
        int64_t shift[HS_MAX_DIM], given[HS_MAX_DIM];
        if (!nearest_pair(near, ranker->block, ranker->si, keys[e].place, q, shift, given) ||
            (writer->S != NULL && !put_shift(near, given, writer->S + (at + e) * asking->ndim))) {
            return HS_ERR_SHIFT_RANGE;
        }
        for (int r = 0; r < asking->n_periodic; r++) {
            hs_measured_shift(&writer->pairs, writer->pairs.n + e, r, shift[r]);
        }
    }
    return HS_OK;
}

/* The metric's shifts where they are those of the images: all are zero before, and few are not
 * after. */
static void
put_images(hs_nearest_writer *writer, const hs_nearest_ranker *ranker, const hs_nearest_key *keys,
           int32_t n)
{
    const hs_nearest_block *block = ranker->block;
    if (block->n_images == 1 && block->images[0].is_home) {
        return;
    }
    for (int32_t e = 0; e < n; e++) {
        const hs_nearest_image *image = hs_nearest_image_of(block, keys[e].place);
        for (int r = 0; !image->is_home && r < writer->near->order.n_rows; r++) {
            hs_measured_shift(&writer->pairs, writer->pairs.n + e, r, image->shift[r]);
        }
    }
}

/* n entries of the ranker's row, from `at` on; the batch has room for them. */
static hs_status
put_entries(hs_nearest_writer *writer, const hs_nearest_ranker *ranker, const hs_nearest_key *keys,
            int32_t n, int64_t at, bool is_first)
{
    const hs_nearest *near = writer->near;
    const hs_bins    *bins = &near->search->bins, *asking = hs_search_asking(near->search);
    const int32_t     begin = writer->pairs.n;
    const int         index_bytes = near->rows->index_bytes;
    int32_t           number[HS_BATCH];
    for (int32_t e = 0; e < n; e++) {
        number[e] = ranker->block->number[keys[e].place];
        put_number(writer->j, index_bytes, at + e, bins->order[number[e]]);
    }
    for (int k = 0; k < bins->ndim; k++) {
        const double *from = bins->keeps_originals ? bins->originals[k] : bins->x[k];
        const double  own = asking->keeps_originals ? asking->originals[k][ranker->si]
                                                    : asking->x[k][ranker->si];
        for (int32_t e = 0; e < n; e++) {
            writer->pairs.p[k][begin + e] = own;
            writer->pairs.q[k][begin + e] = from[number[e]];
        }
    }
    for (int32_t e = 0; e < n; e++) {
        writer->at[begin + e] = at + e;
        writer->is_first[begin + e] = is_first && e == 0;
    }
    hs_status status = HS_OK;
    if (bins->keeps_originals || writer->S != NULL) {
        status = put_given(writer, ranker, keys, n, at);
    } else if (bins->n_periodic > 0) {
        put_images(writer, ranker, keys, n);
    }
    writer->pairs.n += n;
    return status;
}

/* How many of the ranked are within the largest distance: all before the first that is not. */
static int64_t
count_within(hs_nearest_ranker *ranker, int64_t count)
{
    const hs_nearest *near = ranker->near;
    const hs_bins    *asking = hs_search_asking(near->search);
    const double      limit = near->limit * ranker->block->unit;
    const double      square = limit * limit;
    if (!(square < MOST_SQUARE)) { /* beyond all that a block holds */
        return count;
    }
    while (count > 0) {
        const hs_nearest_key *key = &ranker->keys[count - 1];
        const double          error =
            2.0 * hs_nearest_error(ranker->block, near->tree.ndim, hs_larger(square, key->square));
        double  p[HS_MAX_DIM], q[HS_MAX_DIM];
        int64_t shift[HS_MAX_DIM];
        if (key->square + error < square) {
            break;
        }
        for (int k = 0; k < asking->ndim; k++) {
            p[k] = asking->keeps_originals ? asking->originals[k][ranker->si]
                                           : asking->x[k][ranker->si];
        }
        if (key->square <= square + error &&
            (!nearest_pair(near, ranker->block, ranker->si, key->place, q, shift, NULL) ||
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
        hs_nearest_write_nothing(near, row, count);
    }
    return HS_OK;
}
