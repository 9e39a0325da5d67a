/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * write_template.h: the writer of one instruction set. Include it after its vocabularies
 * (wide_<isa>.h and places_<isa>.h), inside its target region.
 *
 *   WRITE   name of the hs_write_fn (write.h)
 *
 * One loop over the hits of a point, LANES at a time. D is found by the steps of
 * core/exact/metric_float.h, so it has their bits. |D| needs neither a square root nor a division:
 * it is a rounded sum root + rest, known to within 2^-80 of itself, and where all of that interval
 * rounds to one number, that is what any other accurate way gives (docs/exactness.md). Undefines
 * WRITE at its end.
 */
#if !defined(WRITE)
#error "define WRITE before including write_template.h"
#endif

#include "wide_doubleword.h"

#define EVERY_LANE   ((1u << LANES) - 1)
#define ROOT_ERROR   0x1p-80 /* relative, of |D|; 2^-82.8 is proven */
#define LEAST_SQUARE 0x1p-120

/* Of LANES hits of one point. */
typedef struct lanes {
    places number; /* of the candidate */
    places image[HS_WRITE_MOST_DIM];
    places S[HS_WRITE_MOST_DIM];
    dwords D[HS_WRITE_MOST_DIM];
    reals  total; /* of the magnitudes that D is a sum of; only used with shifts */
    marks  flips; /* pairs that are listed the other way round */
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
find_plain(const hs_write *write, int32_t t, const record *candidates, lanes *of, const int ndim)
{
    for (int k = 0; k < ndim; k++) {
        const reals q = candidates->q[k], p = broadcast(write->p[k][t]);
        of->D[k] = two_sum(q, negative(p));
        const reals size = add(magnitude(q), magnitude(p));
        of->total = k == 0 ? size : add(of->total, size);
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

/* Adds shift * rows. A row that does not move a pair adds zero, which changes nothing but the sign
 * of a zero, and that is not written. */
HS_ALWAYS_INLINE void
add_rows(const hs_write *write, lanes *of, const int ndim)
{
    const hs_metric *metric = write->metric;
    for (int l = 0; l < metric->n_rows; l++) {
        const reals times = to_reals(write->by_S ? of->S[l] : of->image[l]);
        for (int k = 0; k < ndim; k++) {
            const double entry = metric->rows[l][k];
            if (entry != 0.0) {
                const dwords product = two_product(times, broadcast(entry));
                of->D[k] = dw_add(of->D[k], product);
                of->total = add(of->total, magnitude(product.hi));
            }
        }
    }
}

/* |D|, and as bits for which lanes it is sure. */
HS_ALWAYS_INLINE unsigned
find_distances(const lanes *of, double least, reals *distance, const int ndim, const bool shifted)
{
    reals square = multiply(of->D[0].hi, of->D[0].hi);
    reals rest = add_product(add(of->D[0].hi, of->D[0].hi), of->D[0].lo,
                             product_error(of->D[0].hi, of->D[0].hi, square));
    for (int k = 1; k < ndim; k++) {
        const reals  hi = of->D[k].hi;
        const reals  term = multiply(hi, hi);
        const dwords sum = two_sum(square, term);
        const reals  error = add_product(add(hi, hi), of->D[k].lo, product_error(hi, hi, term));
        square = sum.hi;
        rest = add(rest, add(sum.lo, error));
    }
    /* Two steps of Newton's method: r = r + r (1/2 - square / 2 r r). */
    const reals half = broadcast(0.5), halved = multiply(square, half);
    reals       r = guess_inverse_root(square);
    for (int step = 0; step < 2; step++) {
        r = add_product(r, subtract_product(multiply(halved, r), r, half), r);
    }
    const reals root = multiply(square, r);
    const reals left = add(subtract_product(root, root, square), rest);
    const reals correction = multiply(left, multiply(half, r));
    const reals error = multiply(root, broadcast(ROOT_ERROR));
    const reals above = add(root, add(correction, error));
    const reals below = add(root, subtract(correction, error));
    truth       sure = both(is_equal(above, below), is_at_least(square, broadcast(LEAST_SQUARE)));
    if (shifted) {
        sure = both(sure, is_at_least(root, multiply(of->total, broadcast(least))));
    }
    *distance = choose(is_equal(square, broadcast(0.0)), broadcast(0.0), above);
    return bits(sure);
}

/* As bits, the pairs of coinciding points that no row moves: all is exact there. */
HS_ALWAYS_INLINE unsigned
coinciding(const hs_write *write, const lanes *of, const int ndim)
{
    unsigned lanes_left = resting(write, of);
    for (int k = 0; k < ndim; k++) {
        lanes_left &= bits(is_equal(of->D[k].hi, broadcast(0.0)));
    }
    return lanes_left;
}

HS_ALWAYS_INLINE void
put_distances(const hs_write *write, int64_t e, reals distance)
{
    const reals d = multiply(multiply(distance, broadcast(write->first)), broadcast(write->second));
    const truth below = is_below(d, broadcast(write->cutoff));
    store(write->distance + e, choose(below, d, broadcast(write->largest)));
    hs_prefetch_later(write->distance + e, LANES * sizeof(double));
}

/* Plus zero: a zero has no sign, which would tell where the search met the pair. */
HS_ALWAYS_INLINE reals
restored(const hs_write *write, const lanes *of, int k)
{
    const reals D =
        multiply(multiply(of->D[k].hi, broadcast(write->first)), broadcast(write->second));
    return add(write->is_half ? choose(widen_marks(of->flips), negative(D), D) : D, broadcast(0.0));
}

HS_ALWAYS_INLINE void
put_vectors(const hs_write *write, int64_t e, const lanes *of, const int ndim)
{
    double *to = write->vector + e * ndim;
    if (ndim == 2) {
        put_two_reals(to, restored(write, of, 0), restored(write, of, 1));
    } else {
        put_three_reals(to, restored(write, of, 0), restored(write, of, 1), restored(write, of, 2));
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
    } else {
        put_places((int32_t *)column + e, number);
    }
    hs_prefetch_later((char *)column + e * index_bytes, LANES * (size_t)index_bytes);
}

/* i and j; S. */
HS_ALWAYS_INLINE void
put_known(const hs_write *write, int64_t e, places point, bool in_order, const lanes *of,
          const int ndim)
{
    put_index(write->i, write->index_bytes, e, lower_place(of->number, point));
    put_index(write->j, write->index_bytes, e, higher_place(of->number, point));
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

HS_ALWAYS_INLINE bool
write_pairs(const hs_write *write, const hs_hits *hits, const int ndim, const bool shifted)
{
    /* An error e of D is of no matter up to a quarter of the last place of |D|. */
    const double unit = HS_DW_ADD_ERROR * (HS_FLOAT64_UNIT * HS_FLOAT64_UNIT);
    const double least = 0x1p58 * unit * HS_WRITE_MOST_DIM;
    const bool   in_order = are_in_order(write, ndim);
    unsigned     unsure = 0;
    int32_t      h = 0;
    for (int32_t t = 0; t < hits->n; t++) {
        const places  point = broadcast_place(hits->point[t]);
        const int32_t end = hits->end[t];
        for (int32_t e = h; e < end; e += LANES) {
            lanes        of;
            reals        distance;
            const record candidates = load_records(write->q, hits->label + e);
            of.number = candidates.number;
            find_shifts(write, t, hits->label + e, &of);
            find_flips(write, point, &of);
            find_plain(write, t, &candidates, &of, ndim);
            if (shifted && resting(write, &of) != EVERY_LANE) {
                add_rows(write, &of, ndim);
            }
            const unsigned present = end - e < LANES ? (1u << (end - e)) - 1 : EVERY_LANE;
            unsigned       left = ~find_distances(&of, least, &distance, ndim, shifted) & present;
            if (HS_UNLIKELY(left != 0)) {
                left &= ~coinciding(write, &of, ndim);
            }
            unsure |= left;
            put_known(write, e, point, in_order, &of, ndim);
            if (write->distance != NULL) {
                put_distances(write, e, distance);
            }
            if (write->vector != NULL) {
                put_vectors(write, e, &of, ndim);
            }
        }
        h = end;
        if (HS_UNLIKELY(unsure != 0)) {
            return false;
        }
    }
    return true;
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
#undef LEAST_SQUARE
#undef ROOT_ERROR
#undef WRITE
