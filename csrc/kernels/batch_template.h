/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * batch_template.h: the batch kernels, once for each instruction set. Include it after a vocabulary
 * (wide_<isa>.h), inside that instruction set's target region.
 *
 *   DECIDE_BATCH     name of the hs_decide_batch_fn (batch.h)
 *   MEASURE   name of the hs_measure_fn
 *
 * Each is one loop over groups of LANES pairs, made for 1, 2, 3 and any number of axes, with and
 * without shifts, by inlining with constants. Line by line they follow core/exact/metric.h
 * and core/exact/metric.c, which explain the steps for one pair. Undefines both parameters
 * at its end.
 */
#if !defined(DECIDE_BATCH) || !defined(MEASURE)
#error "define DECIDE_BATCH and MEASURE before including batch_template.h"
#endif

#include "wide_doubleword.h"

_Static_assert(HS_BATCH_PADDING % LANES == 0, "arrays have room for whole vectors");

#define SAFE_LARGE ldexp(1.0, HS_SAFE_EXPONENT) /* compilers see constants */
#define SAFE_SMALL ldexp(1.0, -HS_SAFE_EXPONENT)

#define EVERY_LANE ((1u << LANES) - 1)

/* D of one group of pairs; hs_difference. */
typedef struct differences {
    dwords component[HS_MAX_DIM];
    reals  error;
    truth  usable; /* what hs_difference_shifted returns; true without shifts */
    reals  lost;   /* if watched: zero only where the components are D exactly */
} differences;

/* The rows that move any of the pairs from e on, and how often; the other rows add nothing. */
typedef struct moves {
    int   n;
    int   row[HS_MAX_DIM];
    reals times[HS_MAX_DIM];
    truth resting[HS_MAX_DIM]; /* pairs that this row does not move */
} moves;

HS_ALWAYS_INLINE void
find_moves(moves *moving, const hs_metric *metric, const hs_batch *batch, int32_t e,
           const bool shifted)
{
    moving->n = 0;
    for (int l = 0; shifted && l < metric->n_rows; l++) {
        const reals times = load(batch->shift[l] + e);
        const truth resting = is_equal(times, broadcast(0.0));
        if (bits(resting) != EVERY_LANE) {
            moving->row[moving->n] = l;
            moving->times[moving->n] = times;
            moving->resting[moving->n] = resting;
            moving->n++;
        }
    }
}

/*
 * q - p + shift * rows of the pairs from e on. A pair that a row does not move keeps its sum.
 * Adding zero would change little, but not nothing: the sign of a zero, and infinity to NaN.
 */
HS_ALWAYS_INLINE void
find_differences(differences *d, const hs_metric *metric, const hs_batch *batch, int32_t e,
                 const moves *moving, const int ndim, const bool shifted, const bool watched)
{
    const reals zero = broadcast(0.0), one = broadcast(1.0);
    reals       total = zero, weighted = zero;
    int         k = 0; /* ndim is at least 1: compilers warn without this */
    d->lost = zero;
    do {
        const reals q = load(batch->q[k] + e), p = load(batch->p[k] + e);
        dwords      sum = two_sum(q, negative(p));
        reals       size = add(magnitude(q), magnitude(p));
        reals       sums = zero;
        for (int m = 0; shifted && m < moving->n; m++) {
            const double entry = metric->rows[moving->row[m]][k];
            if (entry == 0.0) {
                continue;
            }
            const truth  resting = moving->resting[m];
            const dwords product = two_product(moving->times[m], broadcast(entry));
            const dwords moved = watched ? dw_add_watched(sum, product, &d->lost)
                                         : dw_add(sum, product);
            sum.hi = choose(resting, sum.hi, moved.hi);
            sum.lo = choose(resting, sum.lo, moved.lo);
            size = add(size, magnitude(product.hi));
            sums = add(sums, choose(resting, zero, one));
        }
        d->component[k] = sum;
        total = add(total, size);
        /* Not infinity, which would make 0 sums a NaN. */
        weighted = add(weighted, multiply(sums, smaller(size, broadcast(DBL_MAX))));
    } while (++k < ndim);
    const double unit = HS_DW_ADD_ERROR * (HS_FLOAT64_UNIT * HS_FLOAT64_UNIT);
    d->error = shifted ? multiply(broadcast(unit), weighted) : zero;
    d->usable = is_at_least(broadcast(SAFE_LARGE), shifted ? total : zero);
}

/* Bits to bytes of 0 and 1, four at a time: bit b moves to bit 8 b. */
HS_ALWAYS_INLINE void
put_bytes(uint8_t *bytes, unsigned ones, unsigned twos)
{
    for (int b = 0; b < LANES; b += 4) {
        const uint32_t spread = ((ones >> b & 15) * 0x204081u & 0x1010101u) +
                                2 * ((twos >> b & 15) * 0x204081u & 0x1010101u);
        memcpy(bytes + b, &spread, LANES < 4 ? LANES : 4);
    }
}

/* Second stage: double-word verdicts as bits of *within and *beyond. hs_double_word_verdict. */
HS_ALWAYS_INLINE void
decide_in_double_words(const hs_metric *metric, const differences *d, const int ndim,
                       const bool shifted, unsigned *within, unsigned *beyond)
{
    const reals zero = broadcast(0.0);
    reals       lost = d->lost;
    dwords      square = {zero, zero};
    for (int k = 0; k < ndim; k++) {
        const dwords component = d->component[k];
        const reals  size = magnitude(component.hi);
        const reals  tiny = choose(is_below(size, broadcast(SAFE_SMALL)), size, zero);
        const dwords term = dw_square(component);
        lost = add(lost, add(magnitude(component.lo), tiny));
        square = k == 0 ? term : dw_add_watched(square, term, &lost);
    }
    const dwords limit = {broadcast(-metric->square_hi), broadcast(-metric->square_lo)};
    const reals  excess = dw_add(square, limit).hi;
    const double unit =
        (HS_DW_SQUARE_ERROR + HS_DW_ADD_ERROR * (ndim - 1)) * (HS_FLOAT64_UNIT * HS_FLOAT64_UNIT);
    const reals twice = add(square_root(square.hi), square_root(square.hi));
    reals       bound = multiply(broadcast(unit), square.hi);
    if (shifted) {
        bound = add(bound, multiply(d->error, add(twice, d->error)));
    }
    const truth decided = either(is_below(bound, magnitude(excess)), is_equal(lost, zero));
    const truth inside = metric->inclusive ? is_at_least(zero, excess) : is_below(excess, zero);
    const truth outside = metric->inclusive ? is_below(zero, excess) : is_at_least(excess, zero);
    *within = bits(both(decided, inside));
    *beyond = bits(both(decided, outside));
}

HS_ALWAYS_INLINE void
decide_loop(const hs_metric *metric, const hs_batch *batch, const int ndim, const bool shifted,
            uint8_t *verdict, hs_stages *stages)
{
    const reals sure_in = broadcast(metric->sure_in), sure_out = broadcast(metric->sure_out);
    const reals cutoff = broadcast(metric->cutoff);
    for (int32_t e = 0; e < batch->n; e += LANES) {
        const int32_t  n_left = batch->n - e;
        const unsigned present = n_left < LANES ? (1u << n_left) - 1 : EVERY_LANE;
        moves          moving;
        differences    d;
        find_moves(&moving, metric, batch, e, shifted);
        find_differences(&d, metric, batch, e, &moving, ndim, shifted, true);
        reals square = multiply(d.component[0].hi, d.component[0].hi);
        for (int k = 1; k < ndim; k++) {
            square = add(square, multiply(d.component[k].hi, d.component[k].hi));
        }
        const reals slack = multiply(multiply(broadcast(2.0), d.error), add(cutoff, d.error));
        unsigned    usable = bits(d.usable);
        if (shifted && HS_UNLIKELY((usable & present) != present)) {
            unsigned resting = EVERY_LANE; /* moved by no row: exact, however large */
            for (int m = 0; m < moving.n; m++) {
                resting &= bits(moving.resting[m]);
            }
            usable |= resting;
        }
        usable &= present;
        unsigned       within = bits(is_at_least(subtract(sure_in, square), slack)) & usable;
        unsigned       beyond = bits(is_at_least(subtract(square, sure_out), slack)) & usable;
        const unsigned open = usable & ~(within | beyond);
        stages->by_float64 += count(within | beyond);
        if (HS_UNLIKELY(open != 0)) {
            unsigned inside, outside;
            decide_in_double_words(metric, &d, ndim, shifted, &inside, &outside);
            within |= inside & open;
            beyond |= outside & open;
            stages->by_double_word += count((inside | outside) & open);
        }
        put_bytes(verdict + e, within, beyond);
    }
}

HS_ALWAYS_INLINE void
measure_loop(const hs_metric *metric, const hs_batch *batch, const int ndim, const bool shifted,
             double *distance, double *const *vector, uint8_t *done)
{
    const reals zero = broadcast(0.0);
    for (int32_t e = 0; e < batch->n; e += LANES) {
        reals       largest = zero, smallest = broadcast(SAFE_LARGE); /* of those not zero */
        moves       moving;
        differences d;
        dwords      square = {zero, zero};
        find_moves(&moving, metric, batch, e, shifted);
        find_differences(&d, metric, batch, e, &moving, ndim, shifted, false);
        for (int k = 0; k < ndim; k++) {
            const dwords component = d.component[k];
            const reals  size = magnitude(component.hi);
            const dwords term = dw_square(component);
            largest = larger(size, largest);
            smallest = smaller(choose(is_equal(size, zero), smallest, size), smallest);
            square = k == 0 ? term : dw_add(square, term);
            if (vector != NULL) {
                store(vector[k] + e, component.hi);
            }
        }
        const truth none = is_equal(largest, zero);
        const reals length = choose(none, zero, dw_sqrt(square));
        /* With nothing smaller than this every error-free product is one, fused or not. */
        truth sure = both(is_at_least(smallest, broadcast(SAFE_SMALL)),
                          is_at_least(broadcast(SAFE_LARGE), largest));
        if (shifted) {
            const reals shorter = subtract(length, multiply(broadcast(2.0), d.error));
            sure = both(both(sure, d.usable), is_equal(shorter, length));
        }
        store(distance + e, length);
        put_bytes(done + e, bits(sure), 0);
    }
}

/* loop(ndim, shifted, arguments) with constants. */
#define DISPATCH(loop, ...)                                                 \
    do {                                                                    \
        const bool shifted = metric->n_rows > 0 && batch->shift[0] != NULL; \
        switch (2 * metric->ndim + shifted) {                               \
        case 2: loop(metric, batch, 1, false, __VA_ARGS__); break;          \
        case 3: loop(metric, batch, 1, true, __VA_ARGS__); break;           \
        case 4: loop(metric, batch, 2, false, __VA_ARGS__); break;          \
        case 5: loop(metric, batch, 2, true, __VA_ARGS__); break;           \
        case 6: loop(metric, batch, 3, false, __VA_ARGS__); break;          \
        case 7: loop(metric, batch, 3, true, __VA_ARGS__); break;           \
        default: loop(metric, batch, metric->ndim, shifted, __VA_ARGS__);   \
        }                                                                   \
    } while (0)

void
DECIDE_BATCH(const hs_metric *metric, const hs_batch *batch, uint8_t *verdict, hs_stages *stages)
{
    if (!metric->floats_usable) {
        memset(verdict, HS_UNDECIDED, (size_t)batch->n);
        return;
    }
    DISPATCH(decide_loop, verdict, stages);
}

void
MEASURE(const hs_metric *metric, const hs_batch *batch, double *distance, double *const *vector,
        uint8_t *done)
{
    if (!metric->floats_usable && metric->n_rows > 0 && batch->shift[0] != NULL) {
        memset(done, 0, (size_t)batch->n);
        return;
    }
    DISPATCH(measure_loop, distance, vector, done);
}

#undef DISPATCH
#undef EVERY_LANE
#undef SAFE_LARGE
#undef SAFE_SMALL
#undef DECIDE_BATCH
#undef MEASURE
