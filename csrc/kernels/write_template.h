/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * write_template.h: the writer of one instruction set. Include it after its vocabularies
 * (wide_<isa>.h and places_<isa>.h), inside its target region.
 *
 *   WRITE   name of the hs_write_fn (write.h)
 *
 * One loop over the hits of a point, LANES at a time. D is found by the steps of
 * core/exact/metric.h, so it has their bits; |D| from D in halves (write_distance.h), for a
 * tile of hits at a time: what one of them waits for, others do meanwhile. A pair that this is not
 * sure of is measured by itself. Undefines WRITE at its end.
 */
#if !defined(WRITE)
#error "define WRITE before including write_template.h"
#endif

#include "wide_doubleword.h"
#include "write_distance.h"

#define EVERY_LANE ((1u << LANES) - 1)
#define MOST_TURNS 62.0 /* along all rows together, of what is added in halves */

/* Of one point. */
typedef struct asking {
    places number;
    reals  p[HS_WRITE_MOST_DIM];
    halves of_p[HS_WRITE_MOST_DIM];
} asking;

/* Of LANES hits of one point. */
typedef struct lanes {
    places number; /* of the candidate */
    places image[HS_WRITE_MOST_DIM];
    places S[HS_WRITE_MOST_DIM];
    reals  D[HS_WRITE_MOST_DIM];    /* rounded */
    halves of_D[HS_WRITE_MOST_DIM]; /* the high part alone is exact */
    marks  flips;                   /* pairs that are listed the other way round */
} lanes;

/* Image and S. */
HS_ALWAYS_INLINE void
find_shifts(const hs_write *write, int32_t t, const int32_t *at, lanes *of)
{
    places few[HS_WRITE_MOST_DIM];
    for (int r = 0; r < HS_WRITE_MOST_DIM; r++) {
        of->image[r] = broadcast_place(0);
    }
    if (write->image != NULL) {
        load_triples(write->image, at, of->image);
    }
    memcpy(few, of->image, sizeof few);
    if (write->few != NULL) {
        load_triples(write->few, at, few);
    }
    for (int r = 0; r < HS_WRITE_MOST_DIM; r++) {
        const int32_t turns = write->turns[r] != NULL ? write->turns[r][t] : 0;
        of->S[r] = add_places(few[r], broadcast_place(turns));
    }
}

/* Pairs that are listed the other way round: the candidate has the lower number, or it is an image
 * of the point itself and the first nonzero entry of S is negative. */
HS_ALWAYS_INLINE void
find_flips(const hs_write *write, places point, lanes *of)
{
    const places zero = broadcast_place(0);
    const marks  same = place_equal(of->number, point);
    of->flips = place_below(of->number, point);
    if (HS_UNLIKELY(mark_bits(same) != 0)) {
        marks tied = same;
        for (int r = 0; r < write->metric->n_rows; r++) {
            of->flips = either_mark(of->flips, both_marks(tied, place_below(of->S[r], zero)));
            tied = both_marks(tied, place_equal(of->S[r], zero));
        }
    }
}

/* q - p. */
HS_ALWAYS_INLINE void
find_plain(const asking *point, const record *candidates, reals grid, lanes *of, const int ndim)
{
    for (int k = 0; k < ndim; k++) {
        const halves q = halve(candidates->q[k], grid);
        of->D[k] = subtract(candidates->q[k], point->p[k]);
        of->of_D[k].large = subtract(q.large, point->of_p[k].large);
        of->of_D[k].small = subtract(q.small, point->of_p[k].small);
    }
}

/* As bits, the pairs that no row moves. */
HS_ALWAYS_INLINE unsigned
resting(const hs_write *write, const lanes *of)
{
    const places *shift = write->by_S ? of->S : of->image;
    unsigned      lanes_left = EVERY_LANE;
    for (int l = 0; l < write->metric->n_rows; l++) {
        lanes_left &= mark_bits(place_equal(shift[l], broadcast_place(0)));
    }
    return lanes_left;
}

/* Adds shift * rows; returns as bits the pairs for which that is sure. A row that does not move a
 * pair adds zero, which changes nothing but the sign of a zero, and that is not written. */
HS_ALWAYS_INLINE unsigned
add_rows(const hs_write *write, const scales *by, const asking *point, const record *candidates,
         lanes *of, const int ndim)
{
    const hs_metric *metric = write->metric;
    const places    *shift = write->by_S ? of->S : of->image;
    const reals      grid = broadcast(by->grid);
    reals            total = broadcast(0.0), turns = broadcast(0.0), largest = broadcast(0.0);
    dwords           D[HS_WRITE_MOST_DIM];
    for (int k = 0; k < ndim; k++) {
        const reals q = candidates->q[k], p = point->p[k];
        D[k] = two_sum(q, negative(p));
        total = add(total, add(magnitude(q), magnitude(p)));
    }
    for (int l = 0; l < metric->n_rows; l++) {
        if (mark_bits(place_equal(shift[l], broadcast_place(0))) == EVERY_LANE) {
            continue;
        }
        const reals times = to_reals(shift[l]);
        turns = add(turns, magnitude(times));
        for (int k = 0; k < ndim; k++) {
            if (metric->rows[l][k] != 0.0) {
                const reals  entry = broadcast(metric->rows[l][k]);
                const halves parts = halve(entry, grid);
                const dwords product = two_product(times, entry);
                D[k] = dw_add(D[k], product);
                of->of_D[k].large = add_product(times, parts.large, of->of_D[k].large);
                of->of_D[k].small = add_product(times, parts.small, of->of_D[k].small);
                total = add(total, magnitude(product.hi));
            }
        }
    }
    for (int k = 0; k < ndim; k++) {
        of->D[k] = D[k].hi;
        largest = larger(largest, magnitude(D[k].hi));
    }
    return bits(both(both(is_at_least(broadcast(by->farthest), total),
                          is_at_least(broadcast(MOST_TURNS), turns)),
                     is_at_least(largest, multiply(total, broadcast(by->cancelled)))));
}

HS_ALWAYS_INLINE void
put_distances(const hs_write *write, int64_t e, reals unit, reals distance)
{
    const reals d = multiply(distance, unit);
    const truth below = is_below(d, broadcast(write->cutoff));
    store(write->distance + e, choose(below, d, broadcast(write->largest)));
    hs_prefetch_later(write->distance + e, LANES * sizeof(double));
}

/* Plus zero: a zero has no sign, which would tell where the search met the pair. */
HS_ALWAYS_INLINE void
put_vectors(const hs_write *write, int64_t e, reals unit, const lanes *of, const int ndim)
{
    const reals zero = broadcast(0.0);
    const reals times = write->is_half ? choose(widen_marks(of->flips), negative(unit), unit)
                                       : unit;
    double     *to = write->vector + e * ndim;
    const reals x = add_product(of->D[0], times, zero), y = add_product(of->D[1], times, zero);
    if (ndim == 2) {
        put_two_reals(to, x, y);
    } else {
        put_three_reals(to, x, y, add_product(of->D[2], times, zero));
    }
    hs_prefetch_later(to, LANES * sizeof *to * (size_t)ndim);
}

/* Whether each row is the box vector of the same number: then S need not go through memory. */
HS_ALWAYS_INLINE bool
are_in_order(const hs_write *write, const int ndim)
{
    bool in_order = write->metric->n_rows == ndim;
    for (int r = 0; r < ndim && in_order; r++) {
        in_order = write->column[r] == r;
    }
    return in_order;
}

HS_ALWAYS_INLINE void
put_shifts(const hs_write *write, int64_t e, bool in_order, const lanes *of, const int ndim)
{
    int32_t *to = write->shift + e * ndim;
    places   rows[HS_WRITE_MOST_DIM], S[HS_WRITE_MOST_DIM];
    for (int r = 0; r < HS_WRITE_MOST_DIM; r++) {
        S[r] = rows[r] = write->is_half ? negate_places(of->flips, of->S[r]) : of->S[r];
    }
    if (!in_order) {
        for (int l = 0; l < HS_WRITE_MOST_DIM; l++) {
            S[l] = broadcast_place(0);
        }
        for (int r = 0; r < write->metric->n_rows; r++) {
            S[write->column[r]] = rows[r];
        }
    }
    if (ndim == 2) {
        put_two_places(to, S[0], S[1]);
    } else {
        put_three_places(to, S[0], S[1], S[2]);
    }
    hs_prefetch_later(to, LANES * sizeof *to * (size_t)ndim);
}

HS_ALWAYS_INLINE void
put_index(void *column, int index_bytes, int64_t e, places number)
{
    if (column == NULL) {
        return;
    }
    if (index_bytes == 8) {
        put_wide_places((int64_t *)column + e, number);
        hs_prefetch_later((int64_t *)column + e, LANES * sizeof(int64_t));
    } else {
        put_places((int32_t *)column + e, number);
        hs_prefetch_later((int32_t *)column + e, LANES * sizeof(int32_t));
    }
}

/* i and j; S. */
HS_ALWAYS_INLINE void
put_known(const hs_write *write, int64_t e, places point, bool in_order, const lanes *of,
          const int ndim)
{
    const bool is_half = write->is_half;
    put_index(write->i, write->index_bytes, e, is_half ? lower_place(of->number, point) : point);
    put_index(write->j, write->index_bytes, e,
              is_half ? higher_place(of->number, point) : of->number);
    if (write->shift != NULL) {
        put_shifts(write, e, in_order, of, ndim);
    }
}

/* Nothing is measured. */
HS_ALWAYS_INLINE bool
write_known(const hs_write *write, const hs_hits *hits, const int ndim)
{
    const bool in_order = are_in_order(write, ndim);
    for (int32_t t = 0, h = 0; t < hits->n; h = hits->end[t++]) {
        const places point = broadcast_place(hits->point[t]);
        for (int32_t e = h; e < hits->end[t]; e += LANES) {
            lanes of;
            of.number = load_places(write->number, hits->label + e);
            find_shifts(write, t, hits->label + e, &of);
            find_flips(write, point, &of);
            put_known(write, e, point, in_order, &of, ndim);
        }
    }
    return true;
}

/* Whether it is not too far away to be halved. */
HS_ALWAYS_INLINE bool
set_asking(const hs_write *write, const hs_hits *hits, int32_t t, const scales *by, asking *point,
           const int ndim)
{
    bool is_near = true;
    point->number = broadcast_place(hits->point[t]);
    for (int k = 0; k < ndim; k++) {
        const double p = write->p[k][t];
        is_near = is_near && fabs(p) <= by->farthest;
        point->p[k] = broadcast(p);
        point->of_p[k] = halve(point->p[k], broadcast(by->grid));
    }
    return is_near;
}

/* Hits of a tile that are measured one by one, at most: each takes as long as twenty others. */
#ifdef HS_TESTING
#define MOST_MEASURED (TILE / 4) /* so that small scenes have as many */
#else
#define MOST_MEASURED (TILE / 16)
#endif

/* Distances of the hits from the first of the tile to `end`; d and D where they are not sure. False
 * if those are many. */
static HS_NO_INLINE bool
finish_tile(const hs_write *write, const hs_hits *hits, const scales *by, tile *of, int32_t end)
{
    const reals unit = broadcast(by->unit);
    unsigned    measured = 0;
    pad_tile(of, end);
    for (int32_t e = of->first; e < end; e += LANES) {
        reals       distance;
        const reals square = load(of->square + (e - of->first));
        const reals rest = load(of->rest + (e - of->first));
        unsigned    left = end - e < LANES ? (1u << (end - e)) - 1 : EVERY_LANE;
        left &= ~find_distances(by, square, rest, &distance);
        if (HS_UNLIKELY(left != 0)) {
            const truth zero = is_equal(square, broadcast(0.0));
            left &= ~bits(zero);
            distance = choose(zero, broadcast(0.0), distance);
        }
        if (write->distance != NULL) {
            put_distances(write, e, unit, distance);
        }
        measured += count(left);
        if (HS_UNLIKELY(measured > MOST_MEASURED)) {
            return false;
        }
        for (; HS_UNLIKELY(left != 0); left &= left - 1) {
            const unsigned below = (left & (0u - left)) - 1;
            hs_write_measured(write, hits, e + (int32_t)count(below));
        }
    }
    return true;
}

HS_ALWAYS_INLINE bool
write_pairs(const hs_write *write, const hs_hits *hits, const int ndim, const bool shifted)
{
    const hs_write own = *write; /* columns do not overlap it */
    const bool     in_order = are_in_order(&own, ndim);
    int32_t        h = 0;
    scales         by;
    tile           squares;
    if (!set_scales(&own, &by)) {
        return false;
    }
    const reals grid = broadcast(by.grid), unit = broadcast(by.unit);
    squares.first = 0;
    for (int32_t t = 0; t < hits->n; t++) {
        const int32_t end = hits->end[t];
        asking        point;
        if (HS_UNLIKELY(!set_asking(&own, hits, t, &by, &point, ndim))) {
            return false;
        }
        for (int32_t e = h; e < end; e += LANES) {
            lanes        of;
            const record candidates = load_records(own.q, hits->label + e);
            unsigned     sure = EVERY_LANE;
            if (e + LANES - squares.first > TILE) {
                if (HS_UNLIKELY(!finish_tile(&own, hits, &by, &squares, e))) {
                    return false;
                }
                squares.first = e;
            }
            of.number = candidates.number;
            find_shifts(&own, t, hits->label + e, &of);
            find_flips(&own, point.number, &of);
            find_plain(&point, &candidates, grid, &of, ndim);
            if (shifted && resting(&own, &of) != EVERY_LANE) {
                sure = add_rows(&own, &by, &point, &candidates, &of, ndim);
            }
            put_squares(of.of_D, sure, &squares, e - squares.first, ndim);
            put_known(&own, e, point.number, in_order, &of, ndim);
            if (own.vector != NULL) {
                put_vectors(&own, e, unit, &of, ndim);
            }
        }
        h = end;
    }
    return finish_tile(&own, hits, &by, &squares, h);
}

bool
WRITE(const hs_write *write, const hs_hits *hits)
{
    if (write->q == NULL) {
        return write->ndim == 2 ? write_known(write, hits, 2) : write_known(write, hits, 3);
    }
    if (write->ndim == 2) {
        return write->is_shifted ? write_pairs(write, hits, 2, true)
                                 : write_pairs(write, hits, 2, false);
    }
    return write->is_shifted ? write_pairs(write, hits, 3, true)
                             : write_pairs(write, hits, 3, false);
}

#undef EVERY_LANE
#undef MOST_MEASURED
#undef MOST_TURNS
#undef WRITE
