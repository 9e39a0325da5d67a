/* SPDX-License-Identifier: BSD-3-Clause */
/* places_avx2.h: beside wide_avx2.h, int32 lanes and what moves reals between arrays of structures
 * and lanes: the vocabulary of write_template.h for AVX2 with FMA. */
#ifndef HS_PLACES_AVX2_H
#define HS_PLACES_AVX2_H

#include "wide_avx2.h"
#include "write.h"

/* One operation a line. */
/* clang-format off */

typedef __m128i places; /* int32, as many as there are reals */
typedef __m128i marks;  /* truth about places: all bits of a lane */

HS_ALWAYS_INLINE places broadcast_place(int32_t a) { return _mm_set1_epi32(a); }
/* Four entries of each of LANES hs_candidate, from the first or the fifth on. */
HS_ALWAYS_INLINE void
load_records(const double *from, const int32_t *at, reals *entries)
{
    const reals a = _mm256_loadu_pd(from + (int64_t)at[0] * 2 * HS_RECORD);
    const reals b = _mm256_loadu_pd(from + (int64_t)at[1] * 2 * HS_RECORD);
    const reals c = _mm256_loadu_pd(from + (int64_t)at[2] * 2 * HS_RECORD);
    const reals d = _mm256_loadu_pd(from + (int64_t)at[3] * 2 * HS_RECORD);
    const reals ab_even = _mm256_unpacklo_pd(a, b), ab_odd = _mm256_unpackhi_pd(a, b);
    const reals cd_even = _mm256_unpacklo_pd(c, d), cd_odd = _mm256_unpackhi_pd(c, d);
    entries[0] = _mm256_permute2f128_pd(ab_even, cd_even, 0x20);
    entries[1] = _mm256_permute2f128_pd(ab_odd, cd_odd, 0x20);
    entries[2] = _mm256_permute2f128_pd(ab_even, cd_even, 0x31);
    entries[3] = _mm256_permute2f128_pd(ab_odd, cd_odd, 0x31);
}
/* The first, and the second, of the two places that each lane has the bits of. */
HS_ALWAYS_INLINE places
even_places(reals a)
{
    const __m256i order = _mm256_setr_epi32(0, 2, 4, 6, 0, 2, 4, 6);
    return _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(_mm256_castpd_si256(a), order));
}
HS_ALWAYS_INLINE places
odd_places(reals a)
{
    const __m256i order = _mm256_setr_epi32(1, 3, 5, 7, 1, 3, 5, 7);
    return _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(_mm256_castpd_si256(a), order));
}
HS_ALWAYS_INLINE places add_places(places a, places b) { return _mm_add_epi32(a, b); }
HS_ALWAYS_INLINE places lower_place(places a, places b) { return _mm_min_epi32(a, b); }
HS_ALWAYS_INLINE places higher_place(places a, places b) { return _mm_max_epi32(a, b); }
HS_ALWAYS_INLINE marks place_below(places a, places b) { return _mm_cmplt_epi32(a, b); }
HS_ALWAYS_INLINE marks place_equal(places a, places b) { return _mm_cmpeq_epi32(a, b); }
HS_ALWAYS_INLINE marks both_marks(marks a, marks b) { return _mm_and_si128(a, b); }
HS_ALWAYS_INLINE marks either_mark(marks a, marks b) { return _mm_or_si128(a, b); }
/* One bit a lane. */
HS_ALWAYS_INLINE unsigned
mark_bits(marks m)
{
    return (unsigned)_mm_movemask_ps(_mm_castsi128_ps(m));
}
HS_ALWAYS_INLINE truth
widen_marks(marks m)
{
    return _mm256_castsi256_pd(_mm256_cvtepi32_epi64(m));
}
/* -a where m. */
HS_ALWAYS_INLINE places
negate_places(marks m, places a)
{
    return _mm_sub_epi32(_mm_xor_si128(a, m), m);
}
/* a b + c, and c - a b, rounded once. */
HS_ALWAYS_INLINE reals add_product(reals a, reals b, reals c) { return _mm256_fmadd_pd(a, b, c); }
HS_ALWAYS_INLINE reals
subtract_product(reals a, reals b, reals c)
{
    return _mm256_fnmadd_pd(a, b, c);
}
/* About 1 / sqrt(a): within 2^-11 of it, of itself, for a from 2^-120 to 2^120. */
HS_ALWAYS_INLINE reals
guess_inverse_root(reals a)
{
    return _mm256_cvtps_pd(_mm_rsqrt_ps(_mm256_cvtpd_ps(a)));
}
HS_ALWAYS_INLINE void put_places(int32_t *to, places a) { _mm_storeu_si128((__m128i *)to, a); }
HS_ALWAYS_INLINE void
put_wide_places(int64_t *to, places a)
{
    _mm256_storeu_si256((__m256i *)to, _mm256_cvtepi32_epi64(a));
}
/* x y, x y, ... */
HS_ALWAYS_INLINE void
put_two_reals(double *to, reals x, reals y)
{
    const __m256d even = _mm256_unpacklo_pd(x, y); /* x0 y0 x2 y2 */
    const __m256d odd = _mm256_unpackhi_pd(x, y);  /* x1 y1 x3 y3 */
    _mm256_storeu_pd(to, _mm256_permute2f128_pd(even, odd, 0x20));
    _mm256_storeu_pd(to + 4, _mm256_permute2f128_pd(even, odd, 0x31));
}
/* x y z, x y z, ... */
HS_ALWAYS_INLINE void
put_three_reals(double *to, reals x, reals y, reals z)
{
    const __m256d xy = _mm256_unpacklo_pd(x, y);    /* x0 y0 x2 y2 */
    const __m256d yz = _mm256_unpackhi_pd(y, z);    /* y1 z1 y3 z3 */
    const __m256d zx = _mm256_shuffle_pd(z, x, 10); /* z0 x1 z2 x3 */
    _mm256_storeu_pd(to, _mm256_permute2f128_pd(xy, zx, 0x20));
    _mm256_storeu_pd(to + 4, _mm256_permute2f128_pd(yz, xy, 0x30));
    _mm256_storeu_pd(to + 8, _mm256_permute2f128_pd(zx, yz, 0x31));
}
HS_ALWAYS_INLINE void
put_two_places(int32_t *to, places x, places y)
{
    _mm_storeu_si128((__m128i *)to, _mm_unpacklo_epi32(x, y));
    _mm_storeu_si128((__m128i *)(to + 4), _mm_unpackhi_epi32(x, y));
}
HS_ALWAYS_INLINE void
put_three_places(int32_t *to, places x, places y, places z)
{
    const __m128 a = _mm_castsi128_ps(x), b = _mm_castsi128_ps(y), c = _mm_castsi128_ps(z);
    const __m128 low = _mm_unpacklo_ps(a, b);      /* x0 y0 x1 y1 */
    const __m128 high = _mm_unpackhi_ps(a, b);     /* x2 y2 x3 y3 */
    const __m128 zx = _mm_shuffle_ps(c, a, 0x50);  /* z0 z0 x1 x1 */
    const __m128 yz = _mm_shuffle_ps(b, c, 0x55);  /* y1 y1 z1 z1 */
    const __m128 zxs = _mm_shuffle_ps(c, a, 0xfa); /* z2 z2 x3 x3 */
    const __m128 yzs = _mm_shuffle_ps(b, c, 0xff); /* y3 y3 z3 z3 */
    _mm_storeu_ps((float *)to, _mm_shuffle_ps(low, zx, 0x84));
    _mm_storeu_ps((float *)to + 4, _mm_shuffle_ps(yz, high, 0x48));
    _mm_storeu_ps((float *)to + 8, _mm_shuffle_ps(zxs, yzs, 0x88));
}

#endif
