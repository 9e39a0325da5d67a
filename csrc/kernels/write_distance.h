/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * write_distance.h: |D| for write_template.h, from D in halves: include it after the vocabularies
 * (wide_<isa>.h and places_<isa>.h) of an instruction set, inside its target region.
 *
 * large is a multiple of 2^(E - 26), where 2^(E - 1) <= cutoff < 2^E, or E = 0 for cutoff 0, so
 * that large^2 sums exactly; what is added for small is about 2^-24 of that, and its roundings are
 * of no matter. |D| needs neither a square root nor a division: it is a rounded sum root +
 * correction, known to within 2^(E - 69), and where all of that interval rounds to one number, that
 * is what any other accurate way gives (docs/exactness.md).
 */
#ifndef HS_WRITE_DISTANCE_H
#define HS_WRITE_DISTANCE_H

#define LEAST_SQUARE 0x1p-120 /* squares that a root is guessed of */
#define MOST_SQUARE  0x1p120

/* What the writer goes by. */
typedef struct scales {
    double least, most; /* squares that are computed well: 2^(2E - 32) to 1.5 * 2^(2E) */
    double error;       /* of a distance: 2^(E - 69) */
    double unit;        /* to the caller's unit: a power of two */
} scales;

/* hs_halving: large is a multiple of 2^(E - 26). */
typedef struct halves {
    reals large, small;
} halves;

/* Squares of the distances of some hits, from the first on. */
enum { TILE = 128 };
typedef struct tile {
    int32_t first;
    double  square[TILE + LANES], rest[TILE + LANES];
} tile;

/* False where the caller's unit is out of reach. */
HS_ALWAYS_INLINE bool
set_scales(const hs_write *write, scales *by)
{
    int E;
    (void)frexp(write->metric->cutoff, &E);
    const double size = ldexp(1.0, E);
    by->least = hs_larger(0x1p-32 * size * size, LEAST_SQUARE);
    by->most = hs_smaller(1.5 * size * size, MOST_SQUARE);
    by->error = 0x1p-69 * size;
    by->unit = write->first * write->second;
    return by->unit >= DBL_MIN && by->unit <= DBL_MAX;
}

/* |D|^2 as square + rest; NaN where the halves are. */
HS_ALWAYS_INLINE void
put_squares(const halves *of_D, tile *to, int32_t at, const int ndim)
{
    const reals two = broadcast(2.0);
    reals       large = broadcast(0.0), small = broadcast(0.0);
    for (int k = 0; k < ndim; k++) {
        const halves D = of_D[k];
        const reals  sum = add_product(two, D.large, D.small);
        large = k == 0 ? multiply(D.large, D.large) : add_product(D.large, D.large, large);
        small = k == 0 ? multiply(sum, D.small) : add_product(sum, D.small, small);
    }
    const reals square = add(large, small);
    store(to->square + at, square);
    store(to->rest + at, add(subtract(large, square), small));
}

/* |D|, and as bits for which lanes it is sure. */
HS_ALWAYS_INLINE unsigned
find_distances(const scales *by, reals square, reals rest, reals *distance)
{
    const reals half = broadcast(0.5), error = broadcast(by->error);
    /* Two steps of Newton's method: r = r + r (1/2 - square / 2 r r). */
    const reals halved = multiply(square, half);
    reals       r = guess_inverse_root(square);
    for (int step = 0; step < 2; step++) {
        r = add_product(r, subtract_product(multiply(halved, r), r, half), r);
    }
    const reals root = multiply(square, r);
    const reals left = add(subtract_product(root, root, square), rest);
    const reals correction = multiply(left, multiply(half, r));
    const reals above = add(root, add(correction, error));
    const reals below = add(root, subtract(correction, error));
    const truth fits =
        both(is_at_least(square, broadcast(by->least)), is_at_least(broadcast(by->most), square));
    *distance = above;
    return bits(both(is_equal(above, below), fits));
}

#endif
