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

/* Of one point. */
typedef struct asking {
    places number;
    places turns[HS_WRITE_MOST_DIM];
    reals  p[HS_WRITE_MOST_DIM];
    halves of_p[HS_WRITE_MOST_DIM];
    bool   is_fine; /* its halves and those of all candidates */
} asking;

/* Of LANES hits of one point. */
typedef struct lanes {
    places number; /* of the candidate */
    places S[HS_WRITE_MOST_DIM];
    halves of_q[HS_WRITE_MOST_DIM];
    halves of_D[HS_WRITE_MOST_DIM];
    marks  flips; /* pairs that are listed the other way round */
} lanes;

HS_ALWAYS_INLINE void
set_asking(const hs_write *write, const hs_hits *hits, int32_t t, asking *point)
{
    point->number = broadcast_place(hits->point[t]);
    for (int k = 0; k < HS_WRITE_MOST_DIM; k++) {
        point->turns[k] = broadcast_place(0);
    }
    for (int r = 0; r < write->metric->n_rows; r++) {
        const int32_t *turns = write->turns[r];
        point->turns[write->column[r]] = broadcast_place(turns != NULL ? turns[t] : 0);
    }
}

/* What there is to know of the candidates, and S. */
HS_ALWAYS_INLINE void
load_candidates(const hs_write *write, const asking *point, const int32_t *at, lanes *of)
{
    const double *from = write->candidates->large;
    reals         large[HS_RECORD], small[HS_RECORD];
    load_records(from, at, large);
    load_records(from + HS_RECORD, at, small);
    of->number = even_places(large[HS_RECORD - 1]);
    of->S[0] = add_places(odd_places(large[HS_RECORD - 1]), point->turns[0]);
    of->S[1] = add_places(even_places(small[HS_RECORD - 1]), point->turns[1]);
    of->S[2] = add_places(odd_places(small[HS_RECORD - 1]), point->turns[2]);
    for (int k = 0; k < HS_WRITE_MOST_DIM; k++) {
        of->of_q[k] = (halves){large[k], small[k]};
    }
}

/* Pairs that are listed the other way round: the candidate has the lower number, or it is an image
 * of the point itself and the first nonzero entry of S is negative. */
HS_ALWAYS_INLINE void
find_flips(places point, lanes *of, const int ndim)
{
    const places zero = broadcast_place(0);
    const marks  same = place_equal(of->number, point);
    of->flips = place_below(of->number, point);
    if (HS_UNLIKELY(mark_bits(same) != 0)) {
        marks tied = same;
        for (int k = 0; k < ndim; k++) {
            of->flips = either_mark(of->flips, both_marks(tied, place_below(of->S[k], zero)));
            tied = both_marks(tied, place_equal(of->S[k], zero));
        }
    }
}

/* D of hits of point t, by the steps of core/exact/metric.h. A row that does not move a pair adds
 * zero, which changes nothing but the sign of a zero, and that is not written. */
static HS_NO_INLINE void
find_exact_vectors(const hs_write *write, int32_t t, const int32_t *at, reals *D)
{
    for (int k = 0; k < write->ndim; k++) {
        double q[LANES];
        for (int lane = 0; lane < LANES; lane++) {
            q[lane] = hs_write_coordinate(write, at[lane], k);
        }
        dwords sum = two_sum(load(q), broadcast(-write->p[k][t]));
        for (int l = 0; l < write->metric->n_rows; l++) {
            const double entry = write->metric->rows[l][k];
            double       times[LANES];
            for (int lane = 0; lane < LANES && entry != 0.0; lane++) {
                times[lane] = (double)hs_write_shift(write, t, at[lane], l);
            }
            if (entry != 0.0) {
                sum = dw_add(sum, two_product(load(times), broadcast(entry)));
            }
        }
        D[k] = sum.hi;
    }
}

/* D, rounded. Where halves are fine their sums have no rounding, and it is what any way gives. */
HS_ALWAYS_INLINE void
find_vectors(const hs_write *write, const asking *point, int32_t t, const int32_t *at,
             const lanes *of, reals *D, const int ndim)
{
    if (HS_UNLIKELY(!point->is_fine && write->is_shifted)) {
        find_exact_vectors(write, t, at, D);
        return;
    }
    for (int k = 0; k < ndim; k++) { /* without shifts, the sum of halves is the candidate */
        D[k] = point->is_fine ? add(of->of_D[k].large, of->of_D[k].small)
                              : subtract(add(of->of_q[k].large, of->of_q[k].small), point->p[k]);
    }
}

/* Plus zero: a zero has no sign, which would tell where the search met the pair. */
HS_ALWAYS_INLINE void
put_vectors(const hs_write *write, int64_t e, reals unit, const lanes *of, const reals *D,
            const int ndim, const bool is_half)
{
    const reals zero = broadcast(0.0);
    const reals times = is_half ? choose(widen_marks(of->flips), negative(unit), unit) : unit;
    double     *to = write->vector + e * ndim;
    const reals x = add_product(D[0], times, zero), y = add_product(D[1], times, zero);
    if (ndim == 2) {
        put_two_reals(to, x, y);
    } else {
        put_three_reals(to, x, y, add_product(D[2], times, zero));
    }
    hs_prefetch_later(to, LANES * sizeof *to * (size_t)ndim);
}

HS_ALWAYS_INLINE void
put_shifts(const hs_write *write, int64_t e, const lanes *of, const int ndim, const bool is_half)
{
    int32_t *to = write->shift + e * ndim;
    places   S[HS_WRITE_MOST_DIM];
    for (int k = 0; k < HS_WRITE_MOST_DIM; k++) {
        S[k] = is_half ? negate_places(of->flips, of->S[k]) : of->S[k];
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
put_known(const hs_write *write, int64_t e, places point, const lanes *of, const int ndim,
          const bool is_half)
{
    put_index(write->i, write->index_bytes, e, is_half ? lower_place(of->number, point) : point);
    put_index(write->j, write->index_bytes, e,
              is_half ? higher_place(of->number, point) : of->number);
    if (write->shift != NULL) {
        put_shifts(write, e, of, ndim, is_half);
    }
}

/* Nothing is measured. */
HS_ALWAYS_INLINE bool
write_known(const hs_write *write, const hs_hits *hits, const int ndim, const bool is_half)
{
    for (int32_t t = 0, h = 0; t < hits->n; h = hits->end[t++]) {
        asking point;
        set_asking(write, hits, t, &point);
        for (int32_t e = h; e < hits->end[t]; e += LANES) {
            lanes of;
            load_candidates(write, &point, hits->label + e, &of);
            if (is_half) {
                find_flips(point.number, &of, ndim);
            }
            put_known(write, e, point.number, &of, ndim, is_half);
        }
    }
    return true;
}

/* Its coordinates; whether it is not too far away to be halved. */
HS_ALWAYS_INLINE bool
halve_asking(const hs_write *write, int32_t t, hs_halving by, asking *point, const int ndim)
{
    hs_moved moved = {.is_fine = true};
    int32_t  shift[HS_WRITE_MOST_DIM];
    bool     is_near = true;
    for (int r = 0; write->by_S && r < write->metric->n_rows; r++) {
        shift[r] = write->base[r] - (write->turns[r] != NULL ? write->turns[r][t] : 0);
    }
    if (write->by_S) {
        is_near = hs_write_move(write->metric, by, shift, &moved);
    }
    point->is_fine = write->is_fine && moved.is_fine;
    for (int k = 0; k < ndim; k++) {
        const double p = write->p[k][t], large = (p + by.grid) - by.grid, small = p - large;
        is_near = is_near && fabs(p) <= by.farthest;
        point->is_fine = point->is_fine && (small + by.fine) - by.fine == small;
        point->p[k] = broadcast(p);
        point->of_p[k] =
            (halves){broadcast(large + moved.large[k]), broadcast(small + moved.small[k])};
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
finish_tile(const hs_write *write, const hs_hits *hits, const scales *scale, tile *of, int32_t end)
{
    const scales by = *scale; /* columns do not overlap it */
    const reals  unit = broadcast(by.unit);
    const reals  cutoff = broadcast(write->cutoff), largest = broadcast(write->largest);
    double      *distance = write->distance;
    unsigned     measured = 0;
    store(of->square + (end - of->first), broadcast(1.0)); /* ordinary numbers behind the last */
    store(of->rest + (end - of->first), broadcast(0.0));
    for (int32_t e = of->first, at = 0; e < end; e += LANES, at += LANES) {
        reals    d;
        unsigned left = ~find_distances(&by, load(of->square + at), load(of->rest + at), &d);
        if (distance != NULL) {
            const reals own = multiply(d, unit);
            store(distance + e, choose(is_below(own, cutoff), own, largest));
            hs_prefetch_later(distance + e, LANES * sizeof(double));
        }
        left &= end - e < LANES ? (1u << (end - e)) - 1 : EVERY_LANE;
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
write_pairs(const hs_write *write, const hs_hits *hits, const int ndim, const bool is_half)
{
    const hs_write   own = *write; /* columns do not overlap it */
    const hs_halving halving = hs_write_halving(own.metric->cutoff);
    int32_t          h = 0;
    scales           by;
    tile             squares;
    if (!set_scales(&own, &by)) {
        return false;
    }
    const reals unit = broadcast(by.unit);
    squares.first = 0;
    for (int32_t t = 0; t < hits->n; t++) {
        const int32_t end = hits->end[t];
        asking        point;
        set_asking(&own, hits, t, &point);
        if (HS_UNLIKELY(!halve_asking(&own, t, halving, &point, ndim))) {
            return false;
        }
        for (int32_t e = h; e < end; e += LANES) {
            lanes of;
            if (e + LANES - squares.first > TILE) {
                if (HS_UNLIKELY(!finish_tile(&own, hits, &by, &squares, e))) {
                    return false;
                }
                squares.first = e;
            }
            load_candidates(&own, &point, hits->label + e, &of);
            if (is_half) {
                find_flips(point.number, &of, ndim);
            }
            for (int k = 0; k < ndim; k++) {
                of.of_D[k].large = subtract(of.of_q[k].large, point.of_p[k].large);
                of.of_D[k].small = subtract(of.of_q[k].small, point.of_p[k].small);
            }
            put_squares(of.of_D, &squares, e - squares.first, ndim);
            put_known(&own, e, point.number, &of, ndim, is_half);
            if (own.vector != NULL) {
                reals D[HS_WRITE_MOST_DIM];
                find_vectors(&own, &point, t, hits->label + e, &of, D, ndim);
                put_vectors(&own, e, unit, &of, D, ndim, is_half);
            }
        }
        h = end;
    }
    return finish_tile(&own, hits, &by, &squares, h);
}

HS_ALWAYS_INLINE bool
write_dimensions(const hs_write *write, const hs_hits *hits, const bool is_half)
{
    if (!write->is_measured) {
        return write->ndim == 2 ? write_known(write, hits, 2, is_half)
                                : write_known(write, hits, 3, is_half);
    }
    return write->ndim == 2 ? write_pairs(write, hits, 2, is_half)
                            : write_pairs(write, hits, 3, is_half);
}

bool
WRITE(const hs_write *write, const hs_hits *hits)
{
    return write->is_half ? write_dimensions(write, hits, true)
                          : write_dimensions(write, hits, false);
}

#undef EVERY_LANE
#undef MOST_MEASURED
#undef WRITE
